//! Photons summed over the balls around all samples of a lattice at once: instead of looking for the photons of a sample, each photon
//! goes to the samples that it is near to.
//!
//! In a row of samples those are a run. Only its ends are written, and one sum along the row makes the runs of all photons
//! out of them: the work is that of the rows that a ball meets, not of its samples, of which a wide one has thousands. Sums are
//! whole numbers: what begins and ends cancels exactly, and neither threads nor the order of photons change a bit.

use fearless_simd::{Level, Simd, dispatch, f32x16, prelude::*, u32x16};
use fearless_simd_macros::simd;
use glam::Vec3;
use rayon::prelude::*;

use super::harmonics;
use super::photons::Photon;
use crate::error::{Error, Result};
use crate::medium::grid::Lattice;
use crate::progress::Progress;

/// What is summed: coefficients up to an order of spherical harmonics, of some channels.
pub(super) struct Wanted<'a> {
    pub(super) order: usize,
    pub(super) channels: &'a [usize],
}

/// Whole numbers that the power of all photons is split into: room is left for harmonics above 1 and the sign.
const PARTS: f64 = (1_u64 << 58) as f64;

/// For each sample the sum of the photons' power within `radius`, times harmonics of their direction: all coefficients of the first
/// channel, then those of the next. Reports planes to `progress`; fails only when interrupted.
pub(super) fn sums(
    lattice: &Lattice,
    photons: &[Photon],
    radius: f32,
    wanted: &Wanted,
    progress: &dyn Progress,
) -> Result<Vec<Vec<f32>>> {
    let [width, height, depth] = lattice.size.map(|it| it as usize);
    let number = harmonics::count(wanted.order) * wanted.channels.len();
    let total: f64 = photons.iter().map(|photon| f64::from(photon.power.element_sum())).sum();
    let scale = if total > 0.0 { PARTS / total } else { 0.0 };
    // In units of the lattice, by planes: those of a plane are neighbors.
    let place = |photon: &Photon| (photon.position - lattice.origin) / lattice.spacing;
    let mut sorted: Vec<(Vec3, u32)> =
        photons.par_iter().enumerate().map(|(at, photon)| (place(photon), at as u32)).collect();
    sorted.par_sort_unstable_by(|a, b| a.0.z.total_cmp(&b.0.z).then(a.1.cmp(&b.1)));
    let mut values = vec![0_i64; sorted.len() * number];
    values.par_chunks_exact_mut(number).zip(&sorted).for_each(|(values, &(_, photon))| {
        set_values(&photons[photon as usize], wanted, scale, values);
    });
    let radius = radius / lattice.spacing;
    let size = [width, height];

    progress.begin("gather", Some(depth as u64), "planes");
    let level = Level::new();
    let plane = |z: usize| {
        if progress.cancelled() {
            return Vec::new();
        }
        let mut ends = vec![0_i64; (width + 1) * height * number];
        let z = z as f32;
        let near = sorted.partition_point(|it| it.0.z < z - radius)
            ..sorted.partition_point(|it| it.0.z <= z + radius);
        for (&(at, _), values) in
            sorted[near.clone()].iter().zip(values[near.start * number..].chunks_exact(number))
        {
            let across_sq = (radius * radius - (at.z - z) * (at.z - z)).max(0.0);
            dispatch!(level, simd => add_disc(simd, at, across_sq, size, values, &mut ends));
        }
        progress.advance(1);
        summed(&ends, size, number, 1.0 / scale.max(f64::MIN_POSITIVE))
    };
    let planes: Vec<Vec<f32>> = (0..depth).into_par_iter().map(plane).collect();
    if progress.cancelled() {
        return Err(Error::Interrupted);
    }
    let size = width * height;
    let column = |coefficient: usize| {
        planes.iter().flat_map(|plane| &plane[coefficient * size..][..size]).copied().collect()
    };
    Ok((0..number).into_par_iter().map(column).collect())
}

/// Samples within `reach` of a place on an axis of `count`.
#[inline(always)]
fn run(at: f32, reach: f32, count: usize) -> std::ops::Range<usize> {
    let first = (at - reach).ceil().max(0.0);
    let end = (at + reach).floor().min((count - 1) as f32) + 1.0;
    if first < end { first as usize..end as usize } else { 0..0 }
}

/// What a photon adds: its power times harmonics, as whole numbers.
fn set_values(photon: &Photon, wanted: &Wanted, scale: f64, values: &mut [i64]) {
    let harmonics = harmonics::evaluate(photon.direction);
    let number = harmonics::count(wanted.order);
    for (values, &channel) in values.chunks_exact_mut(number).zip(wanted.channels) {
        let power = scale * f64::from(photon.power[channel]);
        for (value, harmonic) in values.iter_mut().zip(harmonics) {
            *value = (power * f64::from(harmonic)) as i64;
        }
    }
}

/// Rows that are cut at once.
const ROWS: usize = 16;

/// Adds values to where the rows of a plane enter a disc, and subtracts them behind where they leave it.
#[simd]
fn add_disc<S: Simd>(
    simd: S,
    at: Vec3,
    across_sq: f32,
    [width, height]: [usize; 2],
    values: &[i64],
    ends: &mut [i64],
) {
    let number = |it: f32| f32x16::splat(simd, it);
    let rows = run(at.y, across_sq.sqrt(), height);
    for first_row in rows.clone().step_by(ROWS) {
        let row = f32x16::load_array(simd, std::array::from_fn(|row| (first_row + row) as f32));
        let offset = number(at.y) - row;
        let reach = (number(across_sq) - offset * offset).max(number(0.0)).sqrt();
        let first = (number(at.x) - reach).ceil().max(number(0.0));
        let end = (number(at.x) + reach).floor().min(number((width - 1) as f32)) + number(1.0);
        let is_run = first.simd_lt(end);
        // Beyond the lattice nothing begins and ends: at one place.
        let (first, end) = (is_run.select(first, number(0.0)), is_run.select(end, number(0.0)));
        let [first, end] = [first, end].map(|it| it.to_int::<u32x16<S>>().to_array());
        for (row, (&first, &end)) in (first_row..rows.end).zip(first.iter().zip(&end)) {
            let [first, end] = [first, end].map(|place| (row * (width + 1) + place as usize) * values.len());
            for (number, value) in values.iter().enumerate() {
                ends[first + number] += value;
                ends[end + number] -= value;
            }
        }
    }
}

/// The sums along the rows of a plane: coefficient by coefficient.
fn summed(ends: &[i64], [width, height]: [usize; 2], number: usize, unit: f64) -> Vec<f32> {
    let mut sums = vec![0.0; number * width * height];
    for (y, row) in ends.chunks_exact((width + 1) * number).enumerate() {
        for coefficient in 0..number {
            let mut sum = 0_i64;
            let sums = &mut sums[coefficient * width * height + y * width..][..width];
            for (value, ends) in sums.iter_mut().zip(row.chunks_exact(number)) {
                sum += ends[coefficient];
                *value = (sum as f64 * unit) as f32;
            }
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    #[test]
    fn sums_are_those_of_trying_every_photon() {
        let lattice = Lattice { origin: Vec3::new(-1.0, 0.5, 2.0), spacing: 0.25, size: [13, 9, 7] };
        let mut stream = Stream::new(81, 0);
        let photon = |_| Photon {
            position: lattice.bounds().center() + 2.5 * stream.cube(),
            direction: stream.direction(),
            power: Vec3::new(stream.unit(), 2.0, 0.0),
        };
        let photons: Vec<Photon> = (0..300).map(photon).collect();
        for (order, channels) in [(0, &[1][..]), (0, &[0, 1, 2]), (3, &[0, 1, 2])] {
            for radius in [0.01, 0.3, 0.9, 50.0] {
                let wanted = Wanted { order, channels };
                let found = sums(&lattice, &photons, radius, &wanted, &()).unwrap();
                let number = harmonics::count(order);
                assert_eq!(found.len(), number * channels.len());
                for place in 0..lattice.sample_count() as usize {
                    let at = lattice.position(super::super::field::sample(&lattice, place));
                    let near = photons.iter().filter(|it| it.position.distance(at) <= radius);
                    let near: Vec<&Photon> = near.collect();
                    for (row, values) in found.iter().enumerate() {
                        let (channel, harmonic) = (channels[row / number], row % number);
                        let value =
                            |it: &&Photon| it.power[channel] * harmonics::evaluate(it.direction)[harmonic];
                        let wanted: f32 = near.iter().map(value).sum();
                        let error = (values[place] - wanted).abs();
                        assert!(error <= 1e-4 * (1.0 + wanted.abs()), "{radius} {order} {row}: {error}");
                    }
                }
            }
        }
        let none = sums(&lattice, &[], 1.0, &Wanted { order: 0, channels: &[0] }, &()).unwrap();
        assert!(none[0].iter().all(|&it| it == 0.0));
    }
}
