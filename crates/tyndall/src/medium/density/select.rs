//! The N*-th smallest of many distances, sixteen points at once.
//!
//! Takes the squared distances of the particles near sixteen points and a length within which each point has at least N* of them.
//! Halves the interval by counting, guided by the counts at its ends, until N* distances are left below its upper end; the
//! greatest of them is the answer. Lanes are points, so that nothing is sorted.

use fearless_simd::{f32x16, i32x16, prelude::*};
use fearless_simd_macros::simd;

/// Steps after which the interval is narrower than the distances' digits, but for equal distances next to 0.
const STEPS: usize = 48;
/// Steps of which the place is guided by counts. The others halve the interval.
const GUIDED: usize = 12;

/// The `target`-th smallest of each lane of `distances_sq`; exact, also where distances are equal. At least `target` of a lane must
/// not exceed `upper_sq`; for a lane where this does not hold the result is below or at `upper_sq`.
#[simd]
pub(super) fn nth_smallest<S: Simd>(
    simd: S,
    distances_sq: &[[f32; 16]],
    upper_sq: &[f32; 16],
    target: u32,
) -> [f32; 16] {
    let wanted = i32x16::splat(simd, target as i32);
    let aim = f32x16::splat(simd, target as f32 - 0.5);
    let mut low = f32x16::splat(simd, -f32::MIN_POSITIVE);
    let mut high = f32x16::load_array_ref(simd, upper_sq);
    let mut low_count = f32x16::splat(simd, 0.0);
    let mut high_count = count_within(simd, distances_sq, high);
    for step in 0..STEPS {
        let open = high_count.simd_gt(wanted);
        if open.to_bitmask() == 0 {
            break;
        }
        let counted: f32x16<S> = high_count.to_float();
        let share = (aim - low_count) / (counted - low_count);
        let guided = share.max(f32x16::splat(simd, 0.05)).min(f32x16::splat(simd, 0.95));
        let half = f32x16::splat(simd, 0.5);
        let share = if step < GUIDED { guided } else { half };
        let middle = low + share * (high - low);
        let held = count_within(simd, distances_sq, middle);
        let enough = held.simd_ge(wanted);
        high = enough.select(middle, high);
        high_count = enough.select(held, high_count);
        low = enough.select(low, middle);
        low_count = enough.select(low_count, held.to_float());
    }
    let mut greatest = f32x16::splat(simd, 0.0);
    for distances in distances_sq {
        let distances = f32x16::load_array_ref(simd, distances);
        let below = distances.simd_le(high).select(distances, f32x16::splat(simd, 0.0));
        greatest = greatest.max(below);
    }
    greatest.to_array()
}

#[inline(always)]
fn count_within<S: Simd>(simd: S, distances_sq: &[[f32; 16]], limit: f32x16<S>) -> i32x16<S> {
    let one = i32x16::splat(simd, 1);
    let mut count = i32x16::splat(simd, 0);
    for distances in distances_sq {
        let inside = f32x16::load_array_ref(simd, distances).simd_le(limit);
        count = inside.select(count + one, count);
    }
    count
}

#[cfg(test)]
mod tests {
    use fearless_simd::{Level, dispatch};

    use super::*;
    use crate::random::Stream;

    #[test]
    fn the_nth_smallest_is_that_of_the_sorted_distances() {
        for seed in 0..300 {
            let mut stream = Stream::new(5, seed);
            let count = 1 + stream.below(400);
            let steps = [0.0, 4.0, 50.0][stream.below(3)];
            let distance = |stream: &mut Stream| match steps {
                0.0 => stream.unit().powi(6),
                // Many that are equal.
                steps => (steps * stream.unit()).floor() / steps,
            };
            let distances: Vec<[f32; 16]> =
                (0..count).map(|_| std::array::from_fn(|_| distance(&mut stream))).collect();
            let target = 1 + stream.below(count);
            let upper: [f32; 16] = std::array::from_fn(|_| if seed % 2 == 0 { 1.0 } else { 7.0 });
            let found =
                dispatch!(Level::new(), simd => nth_smallest(simd, &distances, &upper, target as u32));
            for (lane, found) in found.into_iter().enumerate() {
                let mut sorted: Vec<f32> = distances.iter().map(|it| it[lane]).collect();
                sorted.sort_by(f32::total_cmp);
                assert_eq!(found, sorted[target - 1], "seed {seed} lane {lane}: {target} of {count}");
            }
        }
    }
}
