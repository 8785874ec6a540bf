//! Light in a participating medium, on the CPU.

pub mod brute;
pub mod cache;
mod columns;
mod diffuse;
mod field;
pub mod free_path;
pub mod gather;
mod harmonics;
pub mod march;
pub mod photons;
pub mod reference;
mod sweep;
mod walk;
