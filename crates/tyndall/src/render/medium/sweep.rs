//! Radiance along many directions, carried through a lattice from plane to plane: each sample takes it from its neighbors in the
//! plane before, weakened and with what is added on the way. One sweep costs as much as one look at every sample, not a march.
//!
//! Takes extinction and source (light added per extinction) at the samples, gives the integral of the radiance over all
//! directions, times spherical harmonics. Along the segment between two planes extinction and source are linear, and transport is
//! exact for that: optically thick cells come out right, and where source and inflow are one constant so is the radiance.
//! Within a plane radiance is interpolated by cubics, which blurs it a little; what has sharp shadows goes by `columns` instead.
//! Invariant: the outermost samples of the lattice have no extinction; what flows in starts there.
//! Source: P. Kunasz, L. Auer, "Short characteristic integration of radiative transfer problems", JQSRT 39, 1988.

use fearless_simd::{Level, dispatch, f32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::Vec3;
use rayon::prelude::*;

use super::field::Field;
use super::harmonics;
use crate::medium::grid::Lattice;
use crate::pages;

/// Directions of one dominant axis are shared out to so many sums. Fixed, so that results do not depend on the threads.
const GROUPS: usize = 3;

/// A direction in which light travels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ordinate {
    /// Unit length.
    pub(super) direction: Vec3,
    /// The solid angle that it stands for.
    pub(super) weight: f32,
    /// Radiance that enters the lattice.
    pub(super) inflow: f32,
}

/// A lattice ready to be swept along any axis.
pub(super) struct Sweeper {
    lattice: Lattice,
    /// Extinction per unit length, in both orders of the samples.
    extinction: [Vec<f32>; 2],
}

/// The order in which a sweep along an axis visits samples. Lanes lie side by side in memory.
struct Order {
    lanes: usize,
    rows: usize,
    planes: usize,
    row_step: usize,
    plane_step: usize,
    /// The axes along lanes, rows and planes.
    axes: [usize; 3],
}

impl Sweeper {
    /// Takes the extinction per unit length.
    pub(super) fn new(extinction: Field) -> Self {
        let lattice = extinction.lattice;
        let turned = turned(&lattice, &extinction.values);
        Self { lattice, extinction: [extinction.values, turned] }
    }

    /// Coefficients of the radiance: for each spherical harmonic its integral with the radiance, at every sample.
    ///
    /// `sources` are coefficients of what is added per extinction, as many as are wanted back.
    pub(super) fn sweep(&self, ordinates: &[Ordinate], sources: &[Vec<f32>]) -> Vec<Vec<f32>> {
        let turned: Vec<Vec<f32>> = sources.par_iter().map(|source| turned(&self.lattice, source)).collect();
        let sources = [sources, &turned[..]];
        let groups = groups(ordinates);
        let sums: Vec<(usize, Vec<Vec<f32>>)> = groups
            .into_par_iter()
            .map(|(axis, group)| {
                let version = usize::from(axis == 0);
                let order = self.order(axis);
                let inputs = Inputs { extinction: &self.extinction[version], sources: sources[version] };
                let sum = |_: &Vec<f32>| pages::zeros(self.extinction[0].len());
                let mut sums: Vec<Vec<f32>> = inputs.sources.iter().map(sum).collect();
                for ordinate in group {
                    let pass = Pass::new(&order, &ordinate, self.lattice.spacing);
                    dispatch!(Level::new(), simd => carry(simd, &order, &pass, &inputs, &mut sums));
                }
                (version, sums)
            })
            .collect();
        // Sums in the other order of samples are turned back once.
        let total = |coefficient: usize| {
            let mut totals = [(); 2].map(|()| pages::zeros(self.extinction[0].len()));
            for (version, sums) in &sums {
                totals[*version].iter_mut().zip(&sums[coefficient]).for_each(|(total, &sum)| *total += sum);
            }
            let [mut total, turned] = totals;
            turned_back(&self.lattice, &turned, &mut total);
            total
        };
        (0..sources[0].len()).into_par_iter().map(total).collect()
    }

    fn order(&self, axis: usize) -> Order {
        let [x, y, z] = self.lattice.size.map(|it| it as usize);
        match axis {
            0 => Order { lanes: y, rows: z, planes: x, row_step: y, plane_step: y * z, axes: [1, 2, 0] },
            1 => Order { lanes: x, rows: z, planes: y, row_step: x * y, plane_step: x, axes: [0, 2, 1] },
            _ => Order { lanes: x, rows: y, planes: z, row_step: x, plane_step: x * y, axes: [0, 1, 2] },
        }
    }
}

/// Ordinates by their dominant axis, a few groups an axis.
fn groups(ordinates: &[Ordinate]) -> Vec<(usize, Vec<Ordinate>)> {
    let mut groups = Vec::new();
    for axis in 0..3 {
        let of_axis: Vec<Ordinate> =
            ordinates.iter().filter(|it| it.direction.abs().max_position() == axis).copied().collect();
        let size = of_axis.len().div_ceil(GROUPS).max(1);
        groups.extend(of_axis.chunks(size).map(|group| (axis, group.to_vec())));
    }
    groups
}

/// Samples with y fastest, then z, then x, from samples with x fastest, then y, then z.
pub(super) fn turned(lattice: &Lattice, values: &[f32]) -> Vec<f32> {
    let [x, y, z] = lattice.size.map(|it| it as usize);
    let mut turned = pages::zeros(values.len());
    for i in 0..x {
        for k in 0..z {
            let row = &mut turned[(i * z + k) * y..][..y];
            row.iter_mut().enumerate().for_each(|(j, value)| *value = values[(k * y + j) * x + i]);
        }
    }
    turned
}

/// Adds samples that are [`turned`] to those that are not.
pub(super) fn turned_back(lattice: &Lattice, turned: &[f32], values: &mut [f32]) {
    let [x, y, z] = lattice.size.map(|it| it as usize);
    for i in 0..x {
        for k in 0..z {
            let row = &turned[(i * z + k) * y..][..y];
            row.iter().enumerate().for_each(|(j, value)| values[(k * y + j) * x + i] += value);
        }
    }
}

/// The columns that a sweep reads.
struct Inputs<'a> {
    extinction: &'a [f32],
    sources: &'a [Vec<f32>],
}

/// One direction, in the order of a sweep.
struct Pass {
    inflow: f32,
    forward: bool,
    /// Half the distance from the plane before.
    half_step: f32,
    /// Which sample of the plane before lies at or before the point that the light comes from, along lanes and rows: -1 or 0.
    lane: isize,
    row: isize,
    /// Weights of that sample, the next along lanes, the next along rows, and the next along both.
    weights: [f32; 4],
    /// Weights of four samples along lanes and along rows, from one before that sample: a cubic.
    cubic: [[f32; 4]; 2],
    /// What each coefficient of the source adds in this direction.
    harmonics: [f32; harmonics::COUNT],
    /// What the radiance adds to each coefficient.
    share: [f32; harmonics::COUNT],
}

impl Pass {
    fn new(order: &Order, ordinate: &Ordinate, spacing: f32) -> Self {
        let [lane, row, along] = order.axes.map(|axis| ordinate.direction[axis]);
        let upstream = [-lane / along.abs(), -row / along.abs()];
        let step = spacing * (1.0 + upstream[0] * upstream[0] + upstream[1] * upstream[1]).sqrt();
        let [lane, row] = upstream.map(|offset| if offset < 0.0 { -1 } else { 0 });
        let [u, v] = [upstream[0] - lane as f32, upstream[1] - row as f32];
        let harmonics = harmonics::evaluate(ordinate.direction);
        Self {
            inflow: ordinate.inflow,
            forward: along > 0.0,
            half_step: 0.5 * step,
            lane,
            row,
            weights: [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v],
            cubic: [cubic(u), cubic(v)],
            harmonics,
            share: harmonics.map(|it| it * ordinate.weight),
        }
    }
}

/// Weights of the samples at -1, 0, 1 and 2 for the value at `x` from 0 to 1: the cubic through all four.
fn cubic(x: f32) -> [f32; 4] {
    let y = 1.0 - x;
    [
        -x * y * (1.0 + y) / 6.0,
        y * (1.0 + x) * (1.0 + y) / 2.0,
        x * (1.0 + x) * (1.0 + y) / 2.0,
        -x * y * (1.0 + x) / 6.0,
    ]
}

/// Samples that are carried at once.
const LANES: usize = 16;
/// Places of a plane's row before its first sample.
const MARGIN: usize = 2;

/// Radiance, source and extinction in one plane, with room at both ends of each row for whole lanes.
#[derive(Clone)]
struct Plane {
    radiance: Vec<f32>,
    source: Vec<f32>,
    extinction: Vec<f32>,
}

/// Sweeps one direction through all planes and adds its radiance to the sums.
#[simd]
fn carry<S: Simd>(simd: S, order: &Order, pass: &Pass, inputs: &Inputs, sums: &mut [Vec<f32>]) {
    let inner = order.lanes - 2;
    let pitch = MARGIN + 1 + inner.next_multiple_of(LANES) + 2;
    let area = pitch * order.rows;
    let mut before =
        Plane { radiance: vec![pass.inflow; area], source: vec![0.0; area], extinction: vec![0.0; area] };
    let mut here = before.clone();
    let mut between = vec![pass.inflow; area];
    for step in 0..order.planes {
        let plane = if pass.forward { step } else { order.planes - 1 - step };
        // Gather the plane's extinction, and its source in this direction.
        for row in 0..order.rows {
            let first = plane * order.plane_step + row * order.row_step;
            let place = row * pitch + MARGIN;
            let source = &mut here.source[place..][..order.lanes];
            for (number, coefficients) in inputs.sources.iter().enumerate() {
                let weight = pass.harmonics[number];
                let coefficients = &coefficients[first..][..order.lanes];
                if number == 0 {
                    source.iter_mut().zip(coefficients).for_each(|(sum, &it)| *sum = weight * it);
                } else {
                    source.iter_mut().zip(coefficients).for_each(|(sum, &it)| *sum += weight * it);
                }
            }
            here.extinction[place..][..order.lanes]
                .copy_from_slice(&inputs.extinction[first..][..order.lanes]);
        }
        // Carry radiance over from the plane before; at the lattice's border it is what flows in.
        if step > 0 {
            for row in 0..order.rows {
                shift_row(simd, pass, row, pitch, &before.radiance, &mut between);
            }
            for row in 1..order.rows - 1 {
                carry_row(simd, pass, [row, order.rows], &between, &before, &mut here);
                here.radiance[row * pitch + MARGIN + inner + 1..(row + 1) * pitch].fill(pass.inflow);
            }
        }
        // Add it to the sums.
        for (sum, &share) in sums.iter_mut().zip(&pass.share) {
            for row in 0..order.rows {
                let first = plane * order.plane_step + row * order.row_step;
                let sum = &mut sum[first..][..order.lanes];
                let radiance = &here.radiance[row * pitch + MARGIN..][..order.lanes];
                sum.iter_mut().zip(radiance).for_each(|(sum, &it)| *sum += share * it);
            }
        }
        std::mem::swap(&mut before, &mut here);
    }
}

/// Radiance of a row between its samples: where the light comes from along lanes.
#[inline(always)]
fn shift_row<S: Simd>(simd: S, pass: &Pass, row: usize, pitch: usize, radiance: &[f32], between: &mut [f32]) {
    let weights = splat(simd, pass.cubic[0]);
    let radiance = &radiance[row * pitch..][..pitch];
    let between = &mut between[row * pitch..][..pitch];
    for place in (MARGIN + 1..pitch - 2).step_by(LANES) {
        let from = (place - 1).wrapping_add_signed(pass.lane);
        let window = &radiance[from..from + LANES + 3];
        let mut sum = weights[0] * f32x16::from_slice(simd, &window[..LANES]);
        for tap in 1..4 {
            sum += weights[tap] * f32x16::from_slice(simd, &window[tap..tap + LANES]);
        }
        sum.store_slice(&mut between[place..place + LANES]);
    }
}

/// Radiance at the samples of a row but its first, from the plane before. Writes some samples beyond its end.
///
/// With t the optical thickness of the segment: radiance' = e radiance + (q - e) source + (1 - q) source', where
/// e = exp(-t) and q = (1 - e) / t, by their Pade approximants of order 4, whose error is below 1e-5 up to t = 2.
#[inline(always)]
fn carry_row<S: Simd>(
    simd: S,
    pass: &Pass,
    row: [usize; 2],
    between: &[f32],
    before: &Plane,
    here: &mut Plane,
) {
    let number = |it: f32| f32x16::splat(simd, it);
    let [row, rows] = row;
    let pitch = between.len() / rows;
    let weights = splat(simd, pass.weights);
    let cubic = splat(simd, pass.cubic[1]);
    let upstream = (row as isize + pass.row) as usize;
    let taps = [upstream.saturating_sub(1), upstream, upstream + 1, (upstream + 2).min(rows - 1)];
    let corner = upstream * pitch;
    for chunk in (MARGIN + 1..pitch - 2).step_by(LANES) {
        let place = row * pitch + chunk;
        let at = corner + chunk.wrapping_add_signed(pass.lane);
        let mut radiance = number(0.0);
        for (tap, weight) in taps.into_iter().zip(cubic) {
            let first = tap * pitch + chunk;
            radiance += weight * f32x16::from_slice(simd, &between[first..first + LANES]);
        }
        let source = blend(simd, &before.source, at, pitch, weights);
        let extinction = blend(simd, &before.extinction, at, pitch, weights);
        let source_here = f32x16::from_slice(simd, &here.source[place..place + LANES]);
        let extinction_here = f32x16::from_slice(simd, &here.extinction[place..place + LANES]);
        let t = number(pass.half_step) * (extinction + extinction_here);
        let x = (number(0.5) * t).min(number(MOST));
        let x_sq = x * x;
        let even = number(105.0) + number(10.0) * x_sq;
        let inv = number(1.0) / (number(105.0) + number(45.0) * x_sq + x_sq * x_sq + x * even);
        let q = even * inv;
        let e = number(1.0) - number(2.0) * x * q;
        let carried = e * radiance + (q - e) * source + (number(1.0) - q) * source_here;
        carried.store_slice(&mut here.radiance[place..place + LANES]);
    }
}

/// Half the optical thickness beyond which a segment counts as no thicker: exp(-8) is nothing.
const MOST: f32 = 4.0;

#[inline(always)]
fn splat<S: Simd>(simd: S, [a, b, c, d]: [f32; 4]) -> [f32x16<S>; 4] {
    [f32x16::splat(simd, a), f32x16::splat(simd, b), f32x16::splat(simd, c), f32x16::splat(simd, d)]
}

/// Sixteen values between samples.
#[inline(always)]
fn blend<S: Simd>(simd: S, column: &[f32], at: usize, pitch: usize, weights: [f32x16<S>; 4]) -> f32x16<S> {
    let low = &column[at..at + LANES + 1];
    let high = &column[at + pitch..at + pitch + LANES + 1];
    let [a, b] = [f32x16::from_slice(simd, &low[..LANES]), f32x16::from_slice(simd, &low[1..])];
    let [c, d] = [f32x16::from_slice(simd, &high[..LANES]), f32x16::from_slice(simd, &high[1..])];
    weights[0] * a + weights[1] * b + weights[2] * c + weights[3] * d
}
