//! What a picture will cost, before the work: memory by arithmetic, time by constants measured once.
//!
//! The times are those of one core of a 2.x GHz server; they say whether to wait for seconds or for hours, no more.

use super::{Culling, Settings};
use crate::particles::Particles;
use crate::structure::{AT_ONCE, Kind, Packing};

/// Memory of a particle without attributes: three coordinates.
const POSITION_BYTES: u64 = 12;
/// Memory of a particle's color: a place in a palette.
const COLOR_BYTES: u64 = 1;
/// Memory of a particle's id, beside any structure.
const ID_BYTES: u64 = 4;
/// Memory of a particle while a structure is built: the records that are sorted.
const RECORD_BYTES: u64 = 20;
/// Memory of a pixel: sums, depth, id, and the same in the finished picture, and its bytes on their way to the file.
pub const PIXEL_BYTES: u64 = 72;
/// Memory of a pixel for culling by confidence: two pairs with their counts, the depth at which its rays end, and a copy to read.
const CONFIDENCE_BYTES: u64 = 48;
/// Memory of a voxel of its density grid.
const VOXEL_BYTES: u64 = 4;
/// Time of a particle in a build, in seconds of a core.
const BUILD_SECS: f64 = 0.3e-6;
/// Time of a sample of a headlight or flat picture, in seconds of a core.
const PRIMARY_SECS: f64 = 0.04e-6;
/// Time of a sample with a shadow ray and a sky ray, in seconds of a core.
const TRACED_SECS: f64 = 0.2e-6;

/// The work of one picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Work {
    /// How many particles.
    pub particles: u64,
    /// Memory of their columns.
    pub columns_bytes: u64,
    /// The structure over them.
    pub structure: Kind,
    /// The picture.
    pub settings: Settings,
    /// Whether light is traced.
    pub traced: bool,
    /// How many pixels are held at one time: all, unless the picture is made in parts.
    pub held_pixels: u64,
}

impl Work {
    /// Of particles that are there; light is traced.
    pub fn of(particles: &Particles, structure: Kind, settings: Settings) -> Self {
        let columns_bytes = particles.bytes();
        Self { columns_bytes, ..Self::of_count(particles.len() as u64, structure, settings) }
    }

    /// Of particles of which no more is known than their number.
    pub fn of_count(particles: u64, structure: Kind, settings: Settings) -> Self {
        let columns_bytes = particles.saturating_mul(POSITION_BYTES);
        let held_pixels = u64::from(settings.width) * u64::from(settings.height);
        Self { particles, columns_bytes, structure, settings, traced: true, held_pixels }
    }

    /// The most memory that it needs at one time, in bytes.
    pub fn memory_bytes(&self) -> u64 {
        // The columns are let go when the records are there, before the structure is.
        let sorted = self.particles.saturating_mul(RECORD_BYTES);
        let structure = self.particles.saturating_mul(self.arranged_bytes()).max(self.columns_bytes);
        let colors = self.particles.saturating_mul(COLOR_BYTES);
        sorted.saturating_add(structure).saturating_add(colors).saturating_add(self.pixel_bytes())
    }

    /// The size of a file that holds the particles with their structure, in bytes.
    pub fn saved_bytes(&self) -> u64 {
        self.columns_bytes.saturating_add(self.particles.saturating_mul(self.arranged_bytes()))
    }

    /// The same where the particles are read in parts; see [`crate::structure::Structure::stream`].
    pub fn streamed_bytes(&self) -> u64 {
        let sorted = self.particles.min(AT_ONCE).saturating_mul(RECORD_BYTES);
        let structure = self.particles.saturating_mul(self.arranged_bytes());
        sorted.saturating_add(structure).saturating_add(self.pixel_bytes())
    }

    /// Memory of a particle in the structure, and of its id.
    fn arranged_bytes(&self) -> u64 {
        let bytes = match self.structure {
            Kind::Bvh(Packing::Exact) => 14,
            Kind::Bvh(Packing::Bits16) => 9,
            Kind::Bvh(Packing::Bits11) => 7,
            Kind::Bvh(Packing::Bits8) => 6,
            // A box of 32 bytes, and a share of a node of 100, each treelet; cuts through the middle leave treelets half full.
            Kind::Treelets(options) => 13 + 4 + 100_u64.div_ceil(u64::from(options.size.max(1))),
            Kind::Pkd(_) => 17,
            Kind::Brute => 16,
        };
        ID_BYTES + bytes
    }

    /// Memory of the picture, and of what culling keeps; its grid is taken to be a cube, as it is for particles that fill one.
    fn pixel_bytes(&self) -> u64 {
        let pixels = self.held_pixels;
        let culling = match self.settings.culling {
            Culling::Off | Culling::Certified(_) => 0,
            Culling::Confidence(options) => {
                let voxels = u64::from(options.voxel_count).pow(3).saturating_mul(VOXEL_BYTES);
                voxels.saturating_add(pixels * CONFIDENCE_BYTES)
            }
        };
        (pixels * PIXEL_BYTES).saturating_add(culling)
    }

    /// The time that it takes `threads` cores to build and render, in seconds.
    pub fn seconds(&self, threads: usize) -> f64 {
        let samples = f64::from(self.settings.width)
            * f64::from(self.settings.height)
            * f64::from(self.settings.samples);
        let sample = if self.traced { TRACED_SECS } else { PRIMARY_SECS };
        let (build, tries) = match self.structure {
            Kind::Brute => (0.0, self.particles as f64 / 16.0),
            Kind::Bvh(_) => (BUILD_SECS, 1.0),
            Kind::Treelets(_) => (2.0 * BUILD_SECS, 4.0),
            Kind::Pkd(_) => (2.0 * BUILD_SECS, 8.0),
        };
        (self.particles as f64 * build + samples * sample * tries.max(1.0)) / threads.max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_work_costs_more() {
        let settings = Settings { width: 800, height: 800, samples: 16, ..Settings::default() };
        let few = Work::of_count(1_000, Kind::default(), settings);
        let many = Work { particles: 1_000_000_000, columns_bytes: 12_000_000_000, ..few };
        assert!(many.memory_bytes() > 30_000_000_000 && many.memory_bytes() < 50_000_000_000);
        assert!(few.memory_bytes() > 40_000_000 && few.memory_bytes() < 60_000_000);
        assert!(many.seconds(2) > few.seconds(2) && few.seconds(1) > few.seconds(2));
        let all = Work::of_count(u64::MAX, Kind::default(), settings);
        assert_eq!(all.memory_bytes(), u64::MAX);
        let culling = Culling::Confidence(super::super::confidence::Options::default());
        let culled = Work { settings: Settings { culling, ..settings }, ..few };
        assert!(culled.memory_bytes() > few.memory_bytes() + (1 << 26));
        let in_parts = Work { held_pixels: 1000, ..few };
        assert!(in_parts.memory_bytes() < 1_000_000 && in_parts.seconds(2) == few.seconds(2));
        assert!(many.streamed_bytes() < 25_000_000_000, "{}", many.streamed_bytes());
    }
}
