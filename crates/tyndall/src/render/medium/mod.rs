//! Light in a participating medium, on the CPU.

pub mod free_path;
pub mod photons;
pub mod reference;
mod regular;
mod walk;
