//! What is seen, by whom, in which light.

mod amounts;
pub mod automatic;
pub mod camera;
pub mod color;
pub mod coloring;
pub mod colormap;
mod colormap_tables;
pub mod element;
pub mod guesses;
mod kinds;
pub mod light;
mod names;
pub mod outline;
pub mod quantity;
mod rgb;
pub mod select;
mod spacing;
mod statistics;
pub mod viewpoint;
pub mod wanted;

use crate::error::Result;
use crate::structure::Structure;
use crate::structure::replicas::Replicas;
use crate::structure::selection::Column;
#[cfg(feature = "gpu")]
use color::ColorColumn;
use color::ParticleColors;
use light::Lighting;
use select::Selectable;
pub use statistics::{grouped, short};

/// Particles, and how they are seen.
pub struct Scene {
    /// What lights them.
    pub lighting: Lighting,
    /// Linear RGB behind them; none leaves the picture transparent there.
    pub background: Option<[f32; 3]>,
    structure: Structure,
    /// By node.
    colors: ParticleColors,
    /// Quantities that filters may ask for.
    selectables: Vec<Selectable<Column>>,
}

impl Scene {
    /// Particles with the colors that were resolved for them before they were arranged.
    pub fn new(
        structure: Structure,
        colors: ParticleColors,
        lighting: Lighting,
        background: Option<[f32; 3]>,
    ) -> Self {
        let colors = colors.arranged(structure.ids());
        Self { lighting, background, structure, colors, selectables: Vec::new() }
    }

    /// The particles.
    pub fn structure(&self) -> &Structure {
        &self.structure
    }

    /// The particles, to be hidden by rules of a test's own.
    #[cfg(all(test, feature = "gpu"))]
    pub(crate) fn structure_mut(&mut self) -> &mut Structure {
        &mut self.structure
    }

    /// Colors the particles anew, with colors resolved for them in the order of their ids.
    pub fn recolor(&mut self, colors: ParticleColors) {
        self.colors = colors.arranged(self.structure.ids());
    }

    /// Gives back the particles.
    pub fn into_structure(self) -> Structure {
        self.structure
    }

    /// Shows periodic images too: see [`Structure::replicate`].
    pub fn replicate(&mut self, replicas: &Replicas) -> Result<()> {
        self.structure.replicate(replicas)
    }

    /// Scales all radii: see [`Structure::scale_radii`].
    pub fn scale_radii(&mut self, scale: f32) {
        self.structure.scale_radii(scale);
    }

    /// The colors as they are held, by node.
    #[cfg(feature = "gpu")]
    pub(crate) fn color_column(&self) -> ColorColumn<'_> {
        self.colors.column()
    }

    /// The color of the particle at `node`, without images: linear RGB, 0 to 1.
    #[inline(always)]
    pub(crate) fn color(&self, node: u32) -> [f32; 3] {
        self.colors.color(node as usize)
    }
}
