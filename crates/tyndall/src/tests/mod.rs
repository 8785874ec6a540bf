//! Tests that look inside: structures and kernels against brute force, on random and on degenerate scenes.

mod certified;
mod culling;
mod oracle;
mod relight;
pub(crate) mod scenes;
#[cfg(feature = "gpu")]
mod twins;
mod visibility;
