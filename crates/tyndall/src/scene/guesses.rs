//! What is guessed by looking at all particles, kept so that nobody has to look at them again.

use rayon::iter::ParallelIterator;

use super::automatic::{Framing, Outliers, framing_of};
use super::outline::Outline;
use super::statistics::sampled_ids;
use crate::structure::Spheres;

/// Particles that stand for all when it is asked how small they are.
const SAMPLES: usize = 1 << 16;

/// See the module.
#[derive(Clone, Debug, PartialEq)]
pub struct Guesses {
    /// How the radii were found, in one line.
    pub radii: String,
    /// What a camera shows without far outliers.
    pub without_outliers: Shown,
    /// What a camera shows that shows all.
    pub all: Shown,
    /// Centers, as offsets from the particles' origin, and radii of some of them, evenly spread.
    pub sample: Vec<[f32; 4]>,
}

/// What a camera is to show.
#[derive(Clone, Debug, PartialEq)]
pub struct Shown {
    /// Its box.
    pub framing: Framing,
    /// Its outline.
    pub outline: Outline,
}

impl Shown {
    /// Of particles; `outliers` says whether the farthest are shown too.
    pub fn of(spheres: Spheres, outliers: Outliers) -> Self {
        let framing = framing_of(spheres, outliers);
        let outline = Outline::of(spheres, &framing);
        Self { framing, outline }
    }
}

impl Guesses {
    /// Of particles whose radii were found as `radii` says.
    pub fn of(spheres: Spheres, radii: String) -> Self {
        let sphere = |id| {
            let [x, y, z] = spheres.center(id).to_array();
            [x, y, z, spheres.radius(id)]
        };
        Self {
            radii,
            without_outliers: Shown::of(spheres, Outliers::Left),
            all: Shown::of(spheres, Outliers::Shown),
            sample: sampled_ids(spheres.len(), SAMPLES).map(sphere).collect(),
        }
    }

    /// What a camera shows.
    pub fn shown(&self, outliers: Outliers) -> &Shown {
        match outliers {
            Outliers::Left => &self.without_outliers,
            Outliers::Shown => &self.all,
        }
    }
}
