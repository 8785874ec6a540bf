//! What the builders share: records that move, and cuts along the widest axis.

use glam::Vec3;
use rayon::prelude::*;

use super::Spheres;

/// A particle while it is sorted: its center, with `N` = 4 also its radius, and where it came from.
#[derive(Clone, Copy)]
pub(super) struct Record<const N: usize> {
    pub(super) coordinates: [f32; N],
    pub(super) id: u32,
}

impl<const N: usize> Record<N> {
    pub(super) fn center(&self) -> Vec3 {
        Vec3::from_slice(&self.coordinates)
    }

    /// Its radius, or `uniform` where it has none of its own.
    pub(super) fn radius(&self, uniform: f32) -> f32 {
        self.coordinates.get(3).copied().unwrap_or(uniform)
    }
}

/// All particles as records, in order of their ids. Where all radii are one, three coordinates do.
pub(super) fn records<const N: usize>(spheres: Spheres) -> Vec<Record<N>> {
    (0..spheres.len() as u32).into_par_iter().with_min_len(1 << 14).map(|id| record(spheres, id)).collect()
}

/// All particles as records, in the order of `ids`.
#[cfg(feature = "gpu")]
pub(super) fn arranged<const N: usize>(spheres: Spheres, ids: &[u32]) -> Vec<Record<N>> {
    ids.par_iter().with_min_len(1 << 14).map(|&id| record(spheres, id)).collect()
}

#[inline(always)]
fn record<const N: usize>(spheres: Spheres, id: u32) -> Record<N> {
    let [x, y, z] = spheres.center(id as usize).to_array();
    let sphere = [x, y, z, if N > 3 { spheres.radius(id as usize) } else { 0.0 }];
    Record { coordinates: std::array::from_fn(|axis| sphere[axis]), id }
}

/// How many records decide where to cut; more would cost a pass and change the axis almost never.
pub(super) const PROBES: usize = 1024;

/// The coordinate in which the records are widest, from about `probes` of them. Radius counts as a coordinate: large particles are
/// cut off from small ones as soon as they differ by more than the region they share is wide, so that a large particle
/// inflates boxes of its own size only.
pub(super) fn widest<const N: usize>(records: &[Record<N>], probes: usize) -> usize {
    middle(records, probes).0
}

/// The coordinate in which the records are widest, and its middle between the least and the greatest, from about `probes` of them.
pub(super) fn middle<const N: usize>(records: &[Record<N>], probes: usize) -> (usize, f32) {
    let mut min = [f32::INFINITY; N];
    let mut max = [f32::NEG_INFINITY; N];
    for record in records.iter().step_by(records.len().div_ceil(probes)) {
        for axis in 0..N {
            min[axis] = min[axis].min(record.coordinates[axis]);
            max[axis] = max[axis].max(record.coordinates[axis]);
        }
    }
    let extent = |axis: usize| max[axis] - min[axis];
    let axis = (1..N).fold(0, |best, axis| if extent(axis) > extent(best) { axis } else { best });
    (axis, 0.5 * min[axis] + 0.5 * max[axis])
}

/// Moves the `left_count` records that are smallest along `axis` to the front; equal ones in order of their ids, so that the
/// result does not depend on the order they come in.
pub(super) fn cut<const N: usize>(records: &mut [Record<N>], axis: usize, left_count: usize) {
    records.select_nth_unstable_by(left_count, |a, b| {
        a.coordinates[axis].total_cmp(&b.coordinates[axis]).then(a.id.cmp(&b.id))
    });
}
