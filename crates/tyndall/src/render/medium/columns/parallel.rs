//! Parallel columns, for distant light: all that cross a plane of samples lie alike between them, so that a plane is a sum of four
//! shifted planes with the same weights, on lanes.
//!
//! Columns are as dense as samples and start at a plane's samples where light comes in, and beside it. Invariant: the two
//! outermost samples of the lattice have no density ([`PADDING`]), so that a column has none where it enters or leaves.

use fearless_simd::{Level, Simd, dispatch};
use fearless_simd_macros::simd;
use glam::Vec3;
use rayon::prelude::*;

use super::super::field::Field;
use super::super::sweep::{turned, turned_back};
use crate::pages;

/// Planes of samples across the light: lanes lie side by side in memory.
struct Planes {
    /// Lanes, rows, planes.
    size: [usize; 3],
    /// From a row and from a plane to the next.
    steps: [usize; 2],
    /// By how many samples a column moves on from plane to plane, along lanes and rows.
    slopes: [f32; 2],
    /// Whether light goes to the planes before.
    backward: bool,
    /// Half the length of a column between two planes.
    half_length: f32,
}

/// The sums of one row of columns.
struct Row {
    /// The first plane on which it is over the lattice.
    first: usize,
    /// For each plane that it is over: the sums of the columns from the one before the first sample to the one behind the last.
    sums: Vec<f32>,
}

/// The integral of `density` between each of its samples and where light that travels `along` comes from.
pub(super) fn thickness(density: &Field, along: Vec3) -> Field {
    let lattice = density.lattice;
    let [x, y, z] = lattice.size.map(|it| it as usize);
    let axis = along.abs().max_position();
    let (axes, size, steps) = match axis {
        0 => ([1, 2], [y, z, x], [y, y * z]),
        1 => ([0, 2], [x, z, y], [x * y, x]),
        _ => ([0, 1], [x, y, z], [x, x * y]),
    };
    let slopes = axes.map(|across| along[across] / along[axis].abs());
    let half_length = 0.5 * lattice.spacing / along[axis].abs();
    let planes = Planes { size, steps, slopes, backward: along[axis] < 0.0, half_length };
    let mut values = pages::zeros(density.values.len());
    if axis == 0 {
        let mut of_planes = pages::zeros(values.len());
        planes.thickness(&turned(&lattice, &density.values), &mut of_planes);
        turned_back(&lattice, &of_planes, &mut values);
    } else {
        planes.thickness(&density.values, &mut values);
    }
    Field { lattice, values }
}

impl Planes {
    fn thickness(&self, density: &[f32], values: &mut [f32]) {
        let level = Level::new();
        let [_, rows, planes] = self.size;
        // Rows of columns over the lattice on any plane: -1 is the one before the first row of samples, where light comes in.
        let beside = self.moved(planes - 1, 1).0.unsigned_abs() + 1;
        let beside = if self.slopes[1] > 0.0 { [beside, 0] } else { [0, beside] };
        let all = -(beside[0] as isize) - 1..(rows + beside[1]) as isize + 1;
        let columns: Vec<Row> = all
            .clone()
            .into_par_iter()
            .map(|row| dispatch!(level, simd => summed(simd, self, row, density)))
            .collect();
        let of_row = |row: isize, plane: usize| {
            let found = columns.get(usize::try_from(row - all.start).ok()?)?;
            let pitch = self.size[0] + 2;
            found.sums.get(plane.checked_sub(found.first)? * pitch..)?.get(..pitch)
        };
        let [row_step, plane_step] = self.steps;
        values.par_chunks_mut(row_step.max(plane_step)).enumerate().for_each(|(outer, values)| {
            for (inner, values) in values.chunks_mut(row_step.min(plane_step)).enumerate() {
                let (row, place) = if row_step > plane_step { (outer, inner) } else { (inner, outer) };
                let plane = self.plane(place);
                let (moved, share) = self.moved(plane, 1);
                let low = of_row(row as isize - moved - 1, plane).unwrap_or(&[]);
                let high = of_row(row as isize - moved, plane).unwrap_or(&[]);
                let (_, lane_share) = self.moved(plane, 0);
                dispatch!(level, simd => between(simd, [low, high], [lane_share, share], values));
            }
        });
    }

    /// The plane of samples that light reaches as number `plane`, and the other way round.
    fn plane(&self, plane: usize) -> usize {
        if self.backward { self.size[2] - 1 - plane } else { plane }
    }

    /// How far columns have moved on a plane, in whole samples and the rest.
    fn moved(&self, plane: usize, side: usize) -> (isize, f32) {
        let moved = f64::from(self.slopes[side]) * plane as f64;
        (moved.floor() as isize, (moved - moved.floor()) as f32)
    }
}

/// Sums a row of columns, which on the first plane goes through row `row` of samples.
#[simd]
fn summed<S: Simd>(simd: S, planes: &Planes, row: isize, density: &[f32]) -> Row {
    let _ = simd;
    let [lanes, rows, count] = planes.size;
    let [row_step, plane_step] = planes.steps;
    // Columns -1 - beside.. of the first plane: all that are over the lattice on some plane.
    let beside = planes.moved(count - 1, 0).0.unsigned_abs() + 1;
    let before = if planes.slopes[0] > 0.0 { beside } else { 0 };
    let mut sums = vec![0.0_f32; lanes + beside + 2];
    let mut last = sums.clone();
    let is_over = |at: isize| (-1..rows as isize).contains(&at);
    let over = (0..count).filter(|&plane| is_over(row + planes.moved(plane, 1).0)).count();
    let mut found = Row { first: 0, sums: Vec::with_capacity(over * (lanes + 2)) };
    for plane in 0..count {
        let ((moved, lane_share), (down, row_share)) = (planes.moved(plane, 0), planes.moved(plane, 1));
        // The column before the first sample.
        let first = (before as isize - moved) as usize;
        let at = row + down;
        if at >= 0 && at + 1 < rows as isize {
            let start = planes.plane(plane) * plane_step + at as usize * row_step;
            let low = &density[start..start + lanes];
            let high = &density[start + row_step..start + row_step + lanes];
            let inner = first + 1..first + lanes;
            add_plane(
                [low, high],
                [lane_share, row_share],
                planes.half_length,
                &mut sums[inner.clone()],
                &mut last[inner],
            );
        }
        if is_over(at) {
            if found.sums.is_empty() {
                found.first = plane;
            }
            found.sums.extend_from_slice(&sums[first..first + lanes + 2]);
        }
    }
    found
}

/// Adds the density of a plane, between four samples, and that of the plane before to the sums of columns.
#[inline(always)]
fn add_plane(
    [low, high]: [&[f32]; 2],
    share: [f32; 2],
    half_length: f32,
    sums: &mut [f32],
    last: &mut [f32],
) {
    let [a, b, c, d] = weights(share);
    let samples = low.iter().zip(&low[1..]).zip(high.iter().zip(&high[1..]));
    for ((sum, last), ((p, q), (r, s))) in sums.iter_mut().zip(last).zip(samples) {
        let here = a * p + b * q + c * r + d * s;
        *sum += half_length * (*last + here);
        *last = here;
    }
}

/// Values at samples, between four columns: the rows before and behind, from the column before the first sample on. Rows without
/// columns are empty.
#[simd]
fn between<S: Simd>(simd: S, [low, high]: [&[f32]; 2], share: [f32; 2], values: &mut [f32]) {
    let _ = simd;
    // A column that has moved on by a share lies before the sample by the rest of it.
    let [a, b, c, d] = weights(share.map(|it| 1.0 - it));
    for (row, near, far) in [(low, a, b), (high, c, d)] {
        let columns = row.iter().zip(row.get(1..).unwrap_or(&[]));
        for (value, (p, q)) in values.iter_mut().zip(columns) {
            *value += near * p + far * q;
        }
    }
}

/// Of the four neighbors of what lies between them by these shares: along lanes first.
#[inline(always)]
fn weights([x, y]: [f32; 2]) -> [f32; 4] {
    [(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y]
}
