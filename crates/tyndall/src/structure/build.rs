//! What the builders share: records that move, and cuts along the widest axis.

use rayon::prelude::*;

use super::Spheres;

/// A particle while it is sorted: center and radius as four coordinates, and where it came from.
#[derive(Clone, Copy)]
pub(super) struct Record {
    pub(super) coordinates: [f32; 4],
    pub(super) id: u32,
}

/// Which coordinate of a [`Record`] is the radius.
pub(super) const RADIUS: usize = 3;

/// All particles as records, in order of their ids.
pub(super) fn records(spheres: Spheres) -> Vec<Record> {
    (0..spheres.len() as u32)
        .into_par_iter()
        .with_min_len(1 << 14)
        .map(|id| {
            let center = spheres.center(id as usize);
            Record { coordinates: [center.x, center.y, center.z, spheres.radius(id as usize)], id }
        })
        .collect()
}

/// How many records decide where to cut; more would cost a pass and change the axis almost never.
const PROBES: usize = 1024;

/// The coordinate in which the records are widest, from a sample of them. Radius counts as a coordinate: large particles are
/// cut off from small ones as soon as they differ by more than the region they share is wide, so that a large particle
/// inflates boxes of its own size only.
pub(super) fn widest(records: &[Record]) -> usize {
    let mut min = [f32::INFINITY; 4];
    let mut max = [f32::NEG_INFINITY; 4];
    for record in records.iter().step_by(records.len().div_ceil(PROBES)) {
        for axis in 0..4 {
            min[axis] = min[axis].min(record.coordinates[axis]);
            max[axis] = max[axis].max(record.coordinates[axis]);
        }
    }
    let extent = |axis: usize| max[axis] - min[axis];
    (1..4).fold(0, |best, axis| if extent(axis) > extent(best) { axis } else { best })
}

/// Moves the `left_count` records that are smallest along `axis` to the front; equal ones in order of their ids, so that the
/// result does not depend on the order they come in.
pub(super) fn cut(records: &mut [Record], axis: usize, left_count: usize) {
    records.select_nth_unstable_by(left_count, |a, b| {
        a.coordinates[axis].total_cmp(&b.coordinates[axis]).then(a.id.cmp(&b.id))
    });
}
