//! Tests that look inside: structures and kernels against brute force, on random and on degenerate scenes.

mod certified;
mod culling;
mod cut;
mod drawn;
mod holdouts;
mod illustration;
mod interactive;
mod oracle;
mod refine;
mod relight;
mod replicas;
pub(crate) mod scenes;
mod selection;
mod shapes;
#[cfg(feature = "gpu")]
mod twins;
mod visibility;
mod windows;
