//! Tests that look inside: structures and kernels against brute force, on random and on degenerate scenes.

mod bonds;
mod certified;
mod culling;
mod interactive;
mod opacity;
mod oracle;
mod refine;
mod relight;
mod replicas;
pub(crate) mod scenes;
mod selection;
#[cfg(feature = "gpu")]
mod twins;
mod visibility;
mod windows;
