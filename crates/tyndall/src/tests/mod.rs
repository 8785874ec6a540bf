//! Tests that look inside: structures and kernels against brute force, on random and on degenerate scenes.

mod certified;
mod interactive;
mod oracle;
pub(crate) mod scenes;
mod selection;
mod visibility;
