//! The nearest of many seeds, for every place of a grid: the least of a seed's value and a cost that grows with the distance.
//!
//! The cost is a sum of one across and one down, so that rows and then columns are enough. Every seed within reach is tried, in any order:
//! the same bits wherever the grid begins.

use std::ops::Add;

use rayon::prelude::*;

/// The least of `seeds[place + offset] + costs` by place; `costs` are those of a seed so many places to the right, and below, up to `reach`.
pub(super) fn nearest<T: Copy + Send + Sync + PartialOrd + Add<Output = T>>(
    seeds: &[T],
    width: usize,
    reach: i32,
    costs: [&(dyn Fn(i32) -> T + Sync); 2],
) -> Vec<T> {
    let [across, down] = costs;
    let mut by_row = seeds.to_vec();
    by_row.par_chunks_mut(width).zip(seeds.par_chunks(width)).for_each(|(found, seeds)| {
        begin(found, seeds, across(0));
        for offset in (1..=reach).take_while(|&offset| (offset as usize) < width) {
            let away = offset as usize;
            improve(&mut found[..width - away], &seeds[away..], across(offset));
            improve(&mut found[away..], &seeds[..width - away], across(-offset));
        }
    });
    let height = seeds.len() / width;
    let mut all = by_row.clone();
    all.par_chunks_mut(width).enumerate().for_each(|(row, found)| {
        let of_row = |row: usize| &by_row[row * width..][..width];
        begin(found, of_row(row), down(0));
        for offset in 1..=reach {
            let away = offset as usize;
            if row + away < height {
                improve(found, of_row(row + away), down(offset));
            }
            if away <= row {
                improve(found, of_row(row - away), down(-offset));
            }
        }
    });
    all
}

fn begin<T: Copy + Add<Output = T>>(found: &mut [T], seeds: &[T], cost: T) {
    for (found, seed) in found.iter_mut().zip(seeds) {
        *found = *seed + cost;
    }
}

fn improve<T: Copy + PartialOrd + Add<Output = T>>(found: &mut [T], seeds: &[T], cost: T) {
    for (found, seed) in found.iter_mut().zip(seeds) {
        let other = *seed + cost;
        *found = if other < *found { other } else { *found };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    #[test]
    fn it_is_what_trying_every_seed_finds() {
        let (width, height, reach) = (23, 17, 5);
        let mut stream = Stream::new(3, 0);
        let mut unit = || 0.5 + 0.5 * stream.direction().x;
        let seeds: Vec<f32> =
            (0..width * height).map(|_| if unit() < 0.9 { f32::INFINITY } else { unit() }).collect();
        let (across, down) =
            (|offset: i32| (offset * offset) as f32, |offset: i32| (offset as f32 + 0.5).powi(2));
        let found = nearest(&seeds, width, reach, [&across, &down]);
        for (place, found) in found.iter().enumerate() {
            let mut least = f32::INFINITY;
            for (seed, value) in seeds.iter().enumerate() {
                let [right, below] = [(seed % width, place % width), (seed / width, place / width)]
                    .map(|(seed, place)| seed as i32 - place as i32);
                if right.abs() <= reach && below.abs() <= reach {
                    least = least.min(value + across(right) + down(below));
                }
            }
            assert_eq!(*found, least, "{place}");
        }
    }
}
