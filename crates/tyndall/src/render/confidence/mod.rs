//! Probabilistic occlusion culling: rays end where a pixel is likely to be covered.
//!
//! Lossy: a ray that is cut short shows the background where it should have met a particle behind. Sources: Ibrahim, Rautek, Reina,
//! Agus, Hadwiger 2021, Probabilistic Occlusion Culling using Confidence Maps for High-Quality Rendering of Large Particle Data;
//! for rays through P-k-d trees Walloner 2022, whose sections and equations are named here.

mod accumulate;
mod footprint;
mod gaussian;
mod grid;
mod histogram;
mod neighborhood;
#[cfg(test)]
mod tests;

use crate::error::{Error, Result};

pub(crate) use accumulate::{Accumulator, Pixel};
#[cfg(all(test, feature = "gpu"))]
pub(crate) use accumulate::{Estimate, covered, expected_unique, samples_needed};
#[cfg(all(test, feature = "gpu"))]
pub(crate) use footprint::population;
pub(crate) use footprint::share;
#[cfg(feature = "gpu")]
pub(crate) use gaussian::STEPS as GAUSSIAN_STEPS;
pub(crate) use grid::DensityGrid;
pub(crate) use histogram::Histogram;
pub(crate) use neighborhood::Map;

/// The knobs, with the thesis' names in brackets (table 6.2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Slices of the density grid along its shortest axis; 1 to 4096 (`vc`).
    pub voxel_count: u32,
    /// The confidence at which a depth is taken to hide all behind it (`C_occ`). Above 1 nothing is ever culled.
    pub occlusion_confidence: f32,
    /// After so many samples without a change a pixel's depth is final (`ci`).
    pub convergence_samples: u32,
    /// Samples a pixel and frame: 1, 4 or 16 (`spp`).
    pub frame_samples: u32,
    /// Whether depths are moved to the back of their voxel (`dq`).
    pub depth_quantization: bool,
    /// How the density between voxels is found (`di`).
    pub density_interpolation: Interpolation,
    /// Which pixels decide together (`ks`).
    pub neighborhood: Neighborhood,
    /// Which particles a pixel's samples are drawn from (`N`).
    pub population: Population,
    /// Within so many samples a nearer depth has to pay off; 1 to 1,000 (`N_budget`).
    pub sample_budget: u32,
}

/// How the density between the centers of voxels is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// That of the voxel.
    Nearest,
    /// Linear along each axis, between eight voxels.
    Trilinear,
}

/// Which particles the samples of a pixel are drawn from, N of the thesis' equation 5.1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Population {
    /// All of the pixel's frustum that is not culled: the thesis. Only samples up to a depth count for it, so that where the
    /// frustum holds many more behind, the same few particles are taken for ever new ones, and confidence is too high.
    Frustum,
    /// Those up to the depth that the confidence is about.
    UpToDepth,
}

/// Which pixels decide together: by the mean of their confidences, for the largest of their depths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Neighborhood {
    /// A square of this many pixels an edge around the pixel; odd, 1 to 31.
    Kernel(u32),
    /// Level of the depth-confidence pyramid: squares of 2^level pixels an edge that lie side by side; 0 to 8.
    Pyramid(u32),
}

/// How far culling is, and what it takes.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// By pixel, row by row: the distance along its rays behind which nothing is traced; infinite where nothing is culled.
    pub depths: Vec<f32>,
    /// The share of pixels whose depth is final.
    pub converged: f64,
    /// Voxels of the density grid along each axis.
    pub voxels: [usize; 3],
    /// Memory of the density grid, in bytes.
    pub grid_bytes: u64,
    /// Memory of what the pixels know, in bytes.
    pub pixel_bytes: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            voxel_count: 256,
            occlusion_confidence: 0.95,
            convergence_samples: 128,
            frame_samples: 4,
            depth_quantization: true,
            density_interpolation: Interpolation::Nearest,
            neighborhood: Neighborhood::Kernel(1),
            population: Population::Frustum,
            sample_budget: 25,
        }
    }
}

impl Options {
    /// Fails with [`Error::Setting`] if a knob is out of range.
    pub fn check(&self) -> Result<()> {
        let refuse = |name, value: &dyn std::fmt::Display, allowed| Err(Error::setting(name, value, allowed));
        if !(1..=4096).contains(&self.voxel_count) {
            return refuse("voxel-count", &self.voxel_count, "1 to 4096");
        }
        if !(self.occlusion_confidence > 0.0 && self.occlusion_confidence.is_finite()) {
            return refuse("occlusion-confidence", &self.occlusion_confidence, "a number above 0");
        }
        if self.convergence_samples == 0 {
            return refuse("convergence-samples", &self.convergence_samples, "at least 1");
        }
        if ![1, 4, 16].contains(&self.frame_samples) {
            return refuse("frame-samples", &self.frame_samples, "1, 4 or 16");
        }
        if !(1..=1000).contains(&self.sample_budget) {
            return refuse("sample-budget", &self.sample_budget, "1 to 1000");
        }
        match self.neighborhood {
            Neighborhood::Kernel(edge) if edge % 2 == 0 || edge > 31 => {
                refuse("kernel-size", &edge, "an odd number from 1 to 31")
            }
            Neighborhood::Pyramid(level) if level > 8 => refuse("pyramid-level", &level, "0 to 8"),
            _ => Ok(()),
        }
    }
}
