//! Tyndall turns particles into pictures.
//!
//! The road of the data: [`Particles`] are checked once on entry, a structure is built over them, a scene says how they are
//! seen, a renderer fills a film, and the result is an [`Image`].

pub mod error;
pub mod film;
pub mod math;
pub mod particles;
pub mod progress;
pub mod random;
pub mod render;
pub mod scene;
mod simd;
pub mod srgb;
pub mod structure;
pub mod synthetic;

#[cfg(test)]
mod tests;

pub use error::{Error, Result};
pub use film::Image;
pub use glam::{DVec3, Vec3};
pub use particles::{Attribute, Cell, Columns, Particles, Positions, Radii, Values};
pub use progress::Progress;
