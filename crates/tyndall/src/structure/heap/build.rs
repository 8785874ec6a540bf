//! Sorting particles into a heap: first in order along the cuts, then by levels.

use super::Options;
use crate::math::Bounds;
use crate::progress::Progress;
use crate::structure::build::{Record, cut};

/// Below this many particles a subtree is sorted by one thread.
const PARALLEL_COUNT: usize = 1 << 14;

/// Particles in the left subtree of a heap of `count`.
fn left_count(count: usize) -> usize {
    if count < 2 {
        return 0;
    }
    let levels = count.ilog2();
    let last_level = count + 1 - (1 << levels);
    let half_level = 1 << (levels - 1);
    half_level - 1 + last_level.min(half_level)
}

/// Sorts the records in order: left subtree, node, right subtree. `centers` is their box, `depth` that of their root.
pub(in crate::structure) fn sort<const N: usize>(
    records: &mut [Record<N>],
    centers: Bounds,
    depth: u32,
    options: Options,
    progress: &dyn Progress,
) {
    if records.len() < 2 || progress.cancelled() {
        return;
    }
    let axis = options.axis(&centers, depth);
    let middle = left_count(records.len());
    cut(records, axis, middle);
    let split = records[middle].coordinates[axis];
    let (left, rest) = records.split_at_mut(middle);
    let right = &mut rest[1..];
    let (mut left_centers, mut right_centers) = (centers, centers);
    left_centers.max[axis] = split;
    right_centers.min[axis] = split;
    let count = left.len() + right.len() + 1;
    if count > PARALLEL_COUNT {
        rayon::join(
            || sort(left, left_centers, depth + 1, options, progress),
            || sort(right, right_centers, depth + 1, options, progress),
        );
    } else {
        sort(left, left_centers, depth + 1, options, progress);
        sort(right, right_centers, depth + 1, options, progress);
        if count > PARALLEL_COUNT / 2 {
            progress.advance(count as u64);
        }
    }
}

/// The place that the particle of `node` has when the `count` particles of a heap are sorted in order.
pub(in crate::structure) fn place_in_order(node: usize, count: usize) -> usize {
    // Where it would be if the last level were full, less what is missing there before it.
    let depth = (node + 1).ilog2();
    let last = count.ilog2();
    let across = node + 1 - (1 << depth);
    let place = (2 * across + 1) * (1 << (last - depth)) - 1;
    let on_last_level = count + 1 - (1 << last);
    place - place.div_ceil(2).saturating_sub(on_last_level)
}

/// Puts records that are sorted in order into the order of the heap.
pub(in crate::structure) fn reorder<const N: usize>(records: &mut [Record<N>]) {
    let in_order = records.to_vec();
    for (node, record) in records.iter_mut().enumerate() {
        *record = in_order[place_in_order(node, in_order.len())];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::structure::pkd::Axis;

    #[test]
    fn left_subtrees_are_balanced_and_filled_from_the_left() {
        let expected = [0, 0, 1, 1, 2, 3, 3, 3, 4, 5, 6, 7, 7, 7, 7, 7, 8];
        for (count, left) in expected.into_iter().enumerate() {
            assert_eq!(left_count(count), left, "{count} particles");
        }
    }

    /// Walks the heap as its definition says.
    fn places(node: usize, first: usize, count: usize, found: &mut [usize]) {
        if count > 0 {
            let left = left_count(count);
            found[node] = first + left;
            places(2 * node + 1, first, left, found);
            places(2 * node + 2, first + left + 1, count - left - 1, found);
        }
    }

    #[test]
    fn places_in_order_are_those_of_a_walk_from_left_to_right() {
        for count in (0..70).chain([127, 128, 129, 1000, 1023, 1024, 4095]) {
            let mut expected = vec![0; count];
            places(0, 0, count, &mut expected);
            let found: Vec<usize> = (0..count).map(|node| place_in_order(node, count)).collect();
            assert_eq!(found, expected, "{count} particles");
        }
    }

    /// Checks what is below `node` and collects its coordinates along every axis.
    fn visit(records: &[Record<3>], node: usize, centers: Bounds, depth: u32, options: Options) -> Bounds {
        if node >= records.len() {
            return Bounds::EMPTY;
        }
        let axis = options.axis(&centers, depth);
        let split = records[node].coordinates[axis];
        let (mut left_centers, mut right_centers) = (centers, centers);
        left_centers.max[axis] = split;
        right_centers.min[axis] = split;
        let left = visit(records, 2 * node + 1, left_centers, depth + 1, options);
        let right = visit(records, 2 * node + 2, right_centers, depth + 1, options);
        assert!(left.is_empty() || left.max[axis] <= split, "node {node} of {}", records.len());
        assert!(right.is_empty() || right.min[axis] >= split, "node {node} of {}", records.len());
        left.union(right).with(records[node].center())
    }

    #[test]
    fn a_heap_lies_left_and_right_of_each_of_its_nodes() {
        for axis in [Axis::WidestExtent, Axis::RoundRobin] {
            for count in [1, 2, 3, 7, 8, 100, 1024, 4095] {
                let options = Options { axis, ..Options::default() };
                // Of the same coordinates there are several.
                let at = |id: usize, step: f32| (16.0 * (id as f32 * step).fract()).floor();
                let record = |id: usize| Record {
                    coordinates: [at(id, 0.754_877), 2.0 * at(id, 0.569_84), at(id, 0.618_034)],
                    id: id as u32,
                };
                let mut records: Vec<Record<3>> = (0..count).map(record).collect();
                let centers = records.iter().fold(Bounds::EMPTY, |bounds, it| bounds.with(it.center()));
                sort(&mut records, centers, 0, options, &());
                reorder(&mut records);
                assert_eq!(visit(&records, 0, centers, 0, options), centers);
                let mut ids: Vec<u32> = records.iter().map(|record| record.id).collect();
                ids.sort_unstable();
                assert!(ids.into_iter().eq(0..count as u32), "{count} particles");
            }
        }
    }
}
