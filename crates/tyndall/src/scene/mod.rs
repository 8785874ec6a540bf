//! What is seen, by whom, in which light.

mod amounts;
pub mod automatic;
pub mod camera;
pub mod color;
pub mod coloring;
pub mod colormap;
mod colormap_tables;
pub mod element;
mod kinds;
pub mod light;
mod names;
pub mod outline;
pub mod quantity;
mod rgb;
mod spacing;
mod statistics;
pub mod viewpoint;

use crate::structure::{Spheres, Structure};
use color::ParticleColors;
use light::Lighting;
pub use statistics::{grouped, short};

/// Particles, and how they are seen.
pub struct Scene<'a> {
    /// The particles and their sizes.
    pub spheres: Spheres<'a>,
    /// The structure over them.
    pub structure: Structure,
    /// Their colors.
    pub colors: ParticleColors,
    /// What lights them.
    pub lighting: Lighting,
    /// Linear RGB behind them; none leaves the picture transparent there.
    pub background: Option<[f32; 3]>,
}
