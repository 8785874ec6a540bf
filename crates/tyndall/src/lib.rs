//! Tyndall turns particles into pictures.
//!
//! The road of the data: [`Particles`] are checked once on entry, a structure is built over them, a scene says how they are
//! seen, a renderer fills a film, and the result is an [`Image`].
//!
//! ```
//! use tyndall::render::{Settings, render};
//! use tyndall::scene::light::Lighting;
//! use tyndall::scene::{Scene, camera::Camera, camera::Projection, color::ParticleColors};
//! use tyndall::structure::{Kind, Structure};
//! use tyndall::{DVec3, synthetic};
//!
//! // Ten thousand particles in the unit cube; `()` listens to no progress.
//! let particles = synthetic::generate("packed?n=1e4", &())?;
//! let radii = particles.radii().expect("this source has a radius").clone();
//! let structure = Structure::build(Kind::default(), particles, &radii, 1.0, &())?;
//! let colors = ParticleColors::constant([0.6, 0.7, 0.9]);
//! let scene = Scene::new(structure, colors, Lighting::Headlight, Some([1.0; 3]));
//! let camera = Camera {
//!     eye: DVec3::new(3.0, 2.0, 2.0),
//!     look_at: DVec3::splat(0.5),
//!     up: DVec3::Z,
//!     projection: Projection::Orthographic { height: 1.8 },
//! };
//! let settings = Settings { width: 64, height: 64, samples: 4, ..Settings::default() };
//! let image = render(&scene, &camera, &settings, &())?;
//! assert!(image.id[64 * 32 + 32] >= 0, "the middle of the picture shows a particle");
//! # Ok::<(), tyndall::Error>(())
//! ```

mod curve;
pub mod environment;
pub mod error;
pub mod film;
pub mod frozen;
pub mod math;
pub mod medium;
pub mod names;
pub mod pages;
pub mod particles;
pub mod periodic;
pub mod progress;
pub mod random;
pub mod render;
pub mod scene;
mod simd;
pub mod source;
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
pub use source::Source;
