//! The density grid: how many particles there are around each point (Walloner 2022, section 5.2.1).
//!
//! The box of the particles is cut into `voxel_count` slices along its shortest axis, and along the others so that voxels are as
//! near to cubes as whole numbers allow. Each particle counts as one, shared among the at most eight voxels that it reaches into.
//! Counts are whole numbers of a small unit, so that the sum does not depend on the order in which threads add.

use std::sync::atomic::{AtomicU32, Ordering};

use glam::Vec3;
use rayon::prelude::*;

use super::Interpolation;
use super::gaussian::GaussianIntegral;
use crate::error::{Error, Result};
use crate::math::Bounds;
use crate::structure::Structure;

/// Where the Gaussian that stands for a particle's extent along an axis is cut off, in standard deviations: the particle's surface.
/// With this one the integral is nearest, within 1.1 % of the volume, to the volume of a sphere on one side of a plane.
const GAUSSIAN_LIMIT: f32 = 1.89;

/// The most voxels: 8 GiB.
const LARGEST: f64 = (1u64 << 31) as f64;

/// Bits behind the point of a voxel's count; fewer where more particles share a voxel than fit.
const FRACTION_BITS: [u32; 3] = [16, 8, 0];

/// Particles that a thread takes at a time.
const SHARE: usize = 1 << 14;

/// See the module.
pub(crate) struct DensityGrid {
    bounds: Bounds,
    /// Voxels along each axis.
    voxels: [usize; 3],
    /// Edges of a voxel.
    edge: Vec3,
    inv_edge: Vec3,
    /// Counts by voxel, x fastest, and what one of them stands for, in particles.
    counts: Vec<u32>,
    unit: f32,
    /// Means over the particles, of the radius and of its square.
    radius: f32,
    radius_sq: f32,
}

impl DensityGrid {
    /// Counts the particles of `structure`. Fails with [`Error::Setting`] if there would be too many voxels.
    pub(crate) fn new(structure: &Structure, voxel_count: u32) -> Result<Self> {
        let bounds = structure.bounds();
        let (voxels, edge) = divide(bounds.extent(), voxel_count)?;
        let inv_edge = 1.0 / edge;
        let count: usize = voxels.iter().product();
        let mut grid = Self {
            bounds,
            voxels,
            edge,
            inv_edge,
            counts: Vec::new(),
            unit: 0.0,
            radius: 0.0,
            radius_sq: 0.0,
        };
        for bits in FRACTION_BITS {
            let counts: Vec<AtomicU32> = (0..count).into_par_iter().map(|_| AtomicU32::new(0)).collect();
            if grid.splat(structure, &counts, bits) {
                grid.counts = counts.into_iter().map(AtomicU32::into_inner).collect();
                grid.unit = 1.0 / (1u64 << bits) as f32;
                break;
            }
        }
        [grid.radius, grid.radius_sq] = mean_radius(structure);
        Ok(grid)
    }

    /// Adds every particle to `counts`; whether none of them overflowed.
    fn splat(&self, structure: &Structure, counts: &[AtomicU32], bits: u32) -> bool {
        let integral = GaussianIntegral::new(GAUSSIAN_LIMIT);
        let one = (1u64 << bits) as f32;
        let nodes = (0..structure.len() as u32).into_par_iter().with_min_len(SHARE);
        nodes.filter(|&node| structure.shows(node)).all(|node| {
            let (center, radius) = structure.sphere(node);
            let shares = self.shares(&integral, center, radius);
            let mut fits = true;
            for corner in 0..8 {
                let pick = [corner & 1, corner >> 1 & 1, corner >> 2 & 1];
                let share: f32 = (0..3).map(|axis| shares[axis][pick[axis]].1).product();
                if share > 0.0 {
                    let [x, y, z] = [0, 1, 2].map(|axis| shares[axis][pick[axis]].0);
                    let add = (share * one).round() as u32;
                    let before = counts[self.place(x, y, z)].fetch_add(add, Ordering::Relaxed);
                    fits &= before.checked_add(add).is_some();
                }
            }
            fits
        })
    }

    /// Along each axis the voxel that holds the particle's center and the nearer of its neighbors, and how much of the particle is
    /// in each. Together they have all of it: a particle wider than a voxel is shared among the same two.
    fn shares(&self, integral: &GaussianIntegral, center: Vec3, radius: f32) -> [[(usize, f32); 2]; 3] {
        let place = (center - self.bounds.min) * self.inv_edge;
        std::array::from_fn(|axis| {
            let last = self.voxels[axis] - 1;
            let own = (place[axis] as usize).min(last);
            let along = place[axis] - own as f32;
            let (neighbor, to_side) = if along < 0.5 {
                (own.checked_sub(1), along)
            } else {
                (Some(own + 1).filter(|&neighbor| neighbor <= last), 1.0 - along)
            };
            // How far the side between the two lies from the center, in radii.
            let side = to_side.max(0.0) * self.edge[axis] / radius;
            match neighbor {
                Some(neighbor) if side < 1.0 => {
                    let share = integral.at(GAUSSIAN_LIMIT * side);
                    [(own, share), (neighbor, 1.0 - share)]
                }
                _ => [(own, 1.0), (own, 0.0)],
            }
        })
    }

    #[inline(always)]
    fn place(&self, x: usize, y: usize, z: usize) -> usize {
        (z * self.voxels[1] + y) * self.voxels[0] + x
    }

    /// Particles per voxel at `point`; none outside the box.
    #[inline(always)]
    pub(crate) fn density(&self, point: Vec3, interpolation: Interpolation) -> f32 {
        if !self.bounds.contains(point) {
            return 0.0;
        }
        let place = (point - self.bounds.min) * self.inv_edge;
        let count = match interpolation {
            Interpolation::Nearest => {
                let [x, y, z] = [0, 1, 2].map(|axis| (place[axis] as usize).min(self.voxels[axis] - 1));
                self.counts[self.place(x, y, z)] as f32
            }
            Interpolation::Trilinear => self.between(place - 0.5),
        };
        count * self.unit
    }

    /// The count at a place between the centers of voxels, which lie at whole numbers; outside of them that of the nearest.
    fn between(&self, place: Vec3) -> f32 {
        let mut low = [0; 3];
        let mut high = [0; 3];
        let mut along = [0.0; 3];
        for axis in 0..3 {
            let last = self.voxels[axis] - 1;
            let inside = place[axis].clamp(0.0, last as f32);
            low[axis] = (inside as usize).min(last);
            high[axis] = (low[axis] + 1).min(last);
            along[axis] = inside - low[axis] as f32;
        }
        let count = |x: usize, y: usize, z: usize| self.counts[self.place(x, y, z)] as f32;
        let mix = |a: f32, b: f32, along: f32| a + (b - a) * along;
        let line = |y: usize, z: usize| mix(count(low[0], y, z), count(high[0], y, z), along[0]);
        let plane = |z: usize| mix(line(low[1], z), line(high[1], z), along[1]);
        mix(plane(low[2]), plane(high[2]), along[2])
    }

    /// The box of the particles.
    pub(crate) fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    /// Counts by voxel, x fastest.
    #[cfg(feature = "gpu")]
    pub(crate) fn counts(&self) -> &[u32] {
        &self.counts
    }

    /// What one of a voxel's count stands for, in particles.
    #[cfg(feature = "gpu")]
    pub(crate) fn unit(&self) -> f32 {
        self.unit
    }

    /// Edges of a voxel.
    pub(crate) fn edge(&self) -> Vec3 {
        self.edge
    }

    /// Means over the particles, of the radius and of its square.
    pub(crate) fn mean_radius(&self) -> [f32; 2] {
        [self.radius, self.radius_sq]
    }

    /// Voxels along each axis.
    pub(crate) fn voxels(&self) -> [usize; 3] {
        self.voxels
    }

    /// Memory that it takes, in bytes.
    pub(crate) fn bytes(&self) -> u64 {
        size_of_val(&self.counts[..]) as u64
    }
}

/// Means over the particles, of the radius and of its square.
fn mean_radius(structure: &Structure) -> [f32; 2] {
    let add = |[sum, sum_sq]: [f64; 2], radius: f64| [sum + radius, sum_sq + radius * radius];
    let count = structure.len();
    let share = |number: usize| {
        let nodes = number * SHARE..((number + 1) * SHARE).min(count);
        nodes.map(|node| f64::from(structure.sphere(node as u32).1)).fold([0.0; 2], add)
    };
    // Shares of one size, added in order: which thread took which does not matter.
    let shares: Vec<[f64; 2]> = (0..count.div_ceil(SHARE)).into_par_iter().map(share).collect();
    let [sum, sum_sq] = shares.into_iter().fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
    [sum, sum_sq].map(|sum| (sum / count.max(1) as f64) as f32)
}

/// Voxels along each axis, and their edges. An axis without extent has one slice.
fn divide(extent: Vec3, voxel_count: u32) -> Result<([usize; 3], Vec3)> {
    let extents = extent.to_array().into_iter().filter(|&extent| extent > 0.0);
    let shortest = extents.fold(f32::INFINITY, f32::min);
    let wanted = if shortest < f32::INFINITY { shortest / voxel_count as f32 } else { 1.0 };
    let slices = extent.to_array().map(|extent| (f64::from(extent) / f64::from(wanted)).round().max(1.0));
    let count: f64 = slices.iter().product();
    if count > LARGEST {
        let allowed = format!(
            "fewer slices: with so many the grid has {:.0}x{:.0}x{:.0} voxels, more than 2^31",
            slices[0], slices[1], slices[2]
        );
        return Err(Error::setting("voxel-count", voxel_count, allowed));
    }
    let edge = |axis: usize| if extent[axis] > 0.0 { extent[axis] / slices[axis] as f32 } else { wanted };
    Ok((slices.map(|slices| slices as usize), Vec3::new(edge(0), edge(1), edge(2))))
}
