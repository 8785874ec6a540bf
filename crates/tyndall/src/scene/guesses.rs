//! What is guessed by looking at all particles, kept so that nobody has to look at them again.

use rayon::prelude::*;

use super::Scene;
use super::automatic::{Framing, Outliers, framing_of};
use super::outline::Outline;
use super::statistics::{sampled_ids, scrambled};
use crate::particles::{Attribute, Columns, Particles, Positions, Values};
use crate::structure::Spheres;

/// Particles that stand for all when it is asked how small they are.
const SAMPLES: usize = 1 << 16;
/// About so many of the particles that a scene shows are looked at, at most; the few that stick out further are within the picture's margin.
const SHOWN: usize = 1 << 22;

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

    /// The same of those that a scene shows, in all images: of particles that are not hidden, and, where something is cut, reach into what is left. Spheres count
    /// as at least as large as `least_radius`, where other shapes stand in their place. Also returns these particles, or some of them if they are many; none if nothing is shown.
    pub fn of_scene(scene: &Scene, least_radius: f32, outliers: Outliers) -> Option<(Self, Particles)> {
        let structure = scene.structure();
        let sphere = |node: u32| {
            let (center, radius) = structure.sphere(node);
            (center, radius.max(least_radius))
        };
        let is_shown = |node: &u32| {
            let (center, radius) = sphere(*node);
            structure.shows(*node) && scene.cut().is_none_or(|cut| cut.reaches(center, radius))
        };
        let shown = || (0..structure.nodes()).into_par_iter().with_min_len(1 << 12).filter(is_shown);
        let every = shown().count().div_ceil(SHOWN).max(1) as u64;
        let spheres: Vec<[f32; 4]> = shown()
            .filter(|node| scrambled(u64::from(*node)).is_multiple_of(every))
            .map(|node| {
                let (center, radius) = sphere(node);
                center.extend(radius).to_array()
            })
            .collect();
        let column = |axis: usize| spheres.iter().map(|it| it[axis]).collect::<Vec<f32>>();
        let particles = Particles::new(Columns {
            positions: Positions::from_offsets(structure.origin(), [0, 1, 2].map(column)),
            attributes: vec![Attribute::new("radius", 1, Values::F32(column(3)))],
            ..Columns::default()
        });
        let particles = particles.ok().filter(|particles| !particles.is_empty())?;
        let spheres = Spheres { particles: &particles, radii: particles.radii()?, radius_scale: 1.0 };
        let mut shown = Self::of(spheres, outliers);
        shown.framing.description = "framed on what is shown".into();
        Some((shown, particles))
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
