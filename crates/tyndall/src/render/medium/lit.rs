//! What the march looks up: density and light side by side, at the samples of the density's bricks.
//!
//! Takes a grid and what gives light to a point; a look-up reads four rows of one brick and gives both at once. Light is the
//! radiance that scattering and emission add per extinction; the three colors of it, or one that they are multiples of. Bricks that are parted
//! into finer ones have entries of their parts, with light as close as who gives it knows it, and continuous as the density is. Invariant: where the
//! density is not 0, so is an entry; elsewhere the entry says how many bricks it is at least to the next one that is not empty.

use bytemuck::Pod;
use fearless_simd::{Level, Simd, dispatch};
use fearless_simd_macros::simd;
use glam::{Vec3, Vec3A, Vec4, Vec4Swizzles};
use rayon::prelude::*;

use super::space::Space;
use crate::math::exp_minus;
use crate::medium::Grid;
use crate::medium::grid::{BRICK, EDGE, Piece, STORED};
use crate::pages;

/// Light of one color, or of three.
pub(super) trait Spectrum:
    Copy
    + Send
    + Sync
    + std::ops::Add<Output = Self>
    + std::ops::Mul<Output = Self>
    + std::ops::Mul<f32, Output = Self>
{
    /// Density and light of a sample, in this order.
    type Sample: Pod + Default + Send + Sync;

    /// All equal.
    fn splat(value: f32) -> Self;
    /// Of RGB; `channel` is the one that stands for all where there is one.
    fn of(rgb: Vec3, channel: usize) -> Self;
    /// The same in RGB, each times that of `color`.
    fn times(self, color: Vec3) -> Vec3;
    /// The greatest.
    fn most(self) -> f32;
    /// Of all three.
    fn sum(self) -> f32;
    /// e^-x of each.
    fn exp_minus(self) -> Self;
    fn sample(density: f32, light: Self) -> Self::Sample;
    /// Density and light in the cell whose first sample is the first of `samples`.
    fn interpolate(samples: &[Self::Sample], fraction: Vec3A) -> (f32, Self);
}

/// Beyond the first sample of a cell, the last one.
const CELL_END: usize = EDGE * EDGE + EDGE + 2;

/// Two neighbors along x.
#[inline(always)]
fn pair(samples: &[[f32; 2]], at: usize) -> Vec4 {
    let [[a, b], [c, d]] = [samples[at], samples[at + 1]];
    Vec4::new(a, b, c, d)
}

#[inline(always)]
fn mixed(a: Vec4, b: Vec4, share: f32) -> Vec4 {
    a + share * (b - a)
}

impl Spectrum for f32 {
    type Sample = [f32; 2];

    #[inline(always)]
    fn splat(value: f32) -> Self {
        value
    }

    #[inline(always)]
    fn of(rgb: Vec3, channel: usize) -> Self {
        rgb[channel]
    }

    #[inline(always)]
    fn times(self, color: Vec3) -> Vec3 {
        self * color
    }

    #[inline(always)]
    fn most(self) -> f32 {
        self
    }

    #[inline(always)]
    fn sum(self) -> f32 {
        3.0 * self
    }

    #[inline(always)]
    fn exp_minus(self) -> Self {
        exp_minus(self)
    }

    #[inline(always)]
    fn sample(density: f32, light: Self) -> Self::Sample {
        [density, light]
    }

    #[inline(always)]
    fn interpolate(samples: &[Self::Sample], fraction: Vec3A) -> (f32, Self) {
        let samples = &samples[..CELL_END];
        let low = mixed(pair(samples, 0), pair(samples, EDGE * EDGE), fraction.z);
        let high = mixed(pair(samples, EDGE), pair(samples, EDGE * EDGE + EDGE), fraction.z);
        let both = mixed(low, high, fraction.y);
        let found = both + fraction.x * (both.zwzw() - both);
        (found.x, found.y)
    }
}

impl Spectrum for Vec3 {
    type Sample = Vec4;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Vec3::splat(value)
    }

    #[inline(always)]
    fn of(rgb: Vec3, _: usize) -> Self {
        rgb
    }

    #[inline(always)]
    fn times(self, color: Vec3) -> Vec3 {
        self * color
    }

    #[inline(always)]
    fn most(self) -> f32 {
        self.max_element()
    }

    #[inline(always)]
    fn sum(self) -> f32 {
        self.element_sum()
    }

    #[inline(always)]
    fn exp_minus(self) -> Self {
        Vec3::new(exp_minus(self.x), exp_minus(self.y), exp_minus(self.z))
    }

    #[inline(always)]
    fn sample(density: f32, light: Self) -> Self::Sample {
        Vec4::new(density, light.x, light.y, light.z)
    }

    #[inline(always)]
    fn interpolate(samples: &[Self::Sample], fraction: Vec3A) -> (f32, Self) {
        let s = &samples[..CELL_END];
        let along_z = |at: usize| mixed(s[at], s[at + EDGE * EDGE], fraction.z);
        let along_y = |at: usize| mixed(along_z(at), along_z(at + EDGE), fraction.y);
        let found = mixed(along_y(0), along_y(1), fraction.x);
        (found.x, found.yzw())
    }
}

/// Density and light. See the module.
#[derive(Clone, Debug)]
pub(super) struct LitBricks<L: Spectrum> {
    pub(super) space: Space,
    /// The last sample along each axis.
    pub(super) last: Vec3A,
    pub(super) samples: Vec<L::Sample>,
    /// Of each brick that is not empty; none if no brick is parted.
    pub(super) parts: Vec<Parts>,
}

/// The parts of a brick.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parts {
    /// How many there are along an edge: 1 where the brick is whole.
    pub(super) along: f32,
    /// The number of the first one among all entries.
    pub(super) first: u32,
}

/// Gives light to the samples of a row, all of one brick: from a place on, along x, of a lattice with so many samples along each spacing of the density's.
pub(super) trait Lights<L>: Sync {
    fn row(&self, first: [u32; 3], along: u32, row: &mut [L; EDGE]);
    /// How far apart places are at which it tells light apart.
    fn spacing(&self) -> f32;
}

impl<L: Spectrum> LitBricks<L> {
    /// Lights the bricks of `grid` that are not empty.
    pub(super) fn new(grid: &Grid, lights: &impl Lights<L>) -> Self {
        let space = Space::of(grid);
        let last = Vec3A::from(grid.size().map(|size| (size - 1) as f32));
        let filled = space.filled();
        let mut parts = Vec::new();
        let mut count = filled.len();
        if !grid.is_even() {
            for (number, &brick) in (0..).zip(&filled) {
                let level = grid.level(brick);
                let first = if level > 0 { count as u32 } else { number };
                parts.push(Parts { along: (1 << level) as f32, first });
                count += if level > 0 { 1 << (3 * level) } else { 0 };
            }
        }
        let mut samples = pages::filled(count * STORED, L::Sample::default());
        let level = Level::new();
        let (own, mut others) = samples.split_at_mut(filled.len() * STORED);
        own.par_chunks_exact_mut(STORED).zip(&filled).for_each(|(samples, &brick)| {
            dispatch!(level, simd => fill(simd, grid, brick, lights, samples));
        });
        let mut finer = Vec::new();
        for (brick, level) in filled.iter().map(|&it| (it, grid.level(it))).filter(|it| it.1 > 0) {
            let (of_brick, rest) = std::mem::take(&mut others).split_at_mut(STORED << (3 * level));
            finer.push((brick, level, of_brick));
            others = rest;
        }
        finer.into_par_iter().for_each(|(brick, level, samples)| {
            fill_parts(grid, (brick, level), lights, samples);
        });
        Self { space, last, samples, parts }
    }

    /// Whether no brick is parted.
    pub(super) fn is_even(&self) -> bool {
        self.parts.is_empty()
    }

    pub(super) fn bytes(&self) -> u64 {
        std::mem::size_of_val(&self.samples[..]) as u64
    }

    /// Density and light at a place in brick number `brick` (see [`Space`]), in lattice units.
    #[inline(always)]
    pub(super) fn look_up(&self, brick: usize, place: Vec3A) -> (f32, L) {
        let place = place.max(Vec3A::ZERO).min(self.last);
        if let Some(parts) = self.parts.get(brick).filter(|it| it.along > 1.0) {
            return self.look_up_part(*parts, place);
        }
        let cell = place.floor();
        let inside = cell - BRICK as f32 * (place * (1.0 / BRICK as f32)).floor();
        // Exact in floats.
        let at = inside.dot(Vec3A::new(1.0, EDGE as f32, (EDGE * EDGE) as f32)) as usize;
        L::interpolate(&self.samples[brick * STORED + at..], place - cell)
    }

    /// The same in a brick that is parted.
    fn look_up_part(&self, Parts { along, first }: Parts, place: Vec3A) -> (f32, L) {
        let corner = along * (place * (1.0 / BRICK as f32)).floor();
        let place = along * place;
        let part = (place * (1.0 / BRICK as f32)).floor();
        let number = (part - corner).dot(Vec3A::new(1.0, along, along * along)) as usize;
        let inside = place - BRICK as f32 * part;
        let cell = inside.floor();
        let at = cell.dot(Vec3A::new(1.0, EDGE as f32, (EDGE * EDGE) as f32)) as usize;
        L::interpolate(&self.samples[(first as usize + number) * STORED + at..], inside - cell)
    }

    /// Density and light at any place of the lattice.
    #[inline(always)]
    pub(super) fn at(&self, place: Vec3A) -> (f32, L) {
        let inside = place.cmpge(Vec3A::splat(-0.5)).all() && place.cmple(self.last + 0.5).all();
        if !inside {
            return (0.0, L::splat(0.0));
        }
        match self.space.entry(place.max(Vec3A::ZERO).min(self.last)) {
            Ok(brick) => self.look_up(brick, place),
            Err(_) => (0.0, L::splat(0.0)),
        }
    }
}

/// Light in a brick that is parted, from its first sample to the first one of the next brick.
struct Close<L> {
    /// Samples a spacing of the lattice.
    along: usize,
    samples: Vec<L>,
}

impl<L: Spectrum> Close<L> {
    fn new(grid: &Grid, (brick, level): ([u32; 3], u32), lights: &impl Lights<L>) -> Self {
        let of_level = |level: u32| {
            let enough = |it: &u32| grid.spacing() / (1 << it) as f32 <= 1.001 * lights.spacing();
            1_usize << (0..level).find(enough).unwrap_or(level)
        };
        let along = of_level(level);
        let edge = BRICK as usize * along + 1;
        let mut samples = vec![L::splat(0.0); edge * edge * edge];
        for (number, samples) in samples.chunks_exact_mut(edge).enumerate() {
            let inside = [0, number % edge, number / edge];
            let mut row = [L::splat(0.0); EDGE];
            for part in 0..along {
                let start = part * BRICK as usize;
                let first = [start, inside[1], inside[2]];
                let first =
                    std::array::from_fn(|axis| brick[axis] * BRICK * along as u32 + first[axis] as u32);
                lights.row(first, along as u32, &mut row);
                samples[start..start + EDGE].copy_from_slice(&row);
            }
        }
        let mut close = Self { along, samples };
        // What coarser bricks touch is between their samples, the coarsest first.
        let on_sides: Vec<(usize, usize)> = (0..close.samples.len())
            .filter_map(|place| {
                let at = close.at(place).map(|it| it << level >> along.trailing_zeros());
                let coarsest = grid.coarsest(brick, level, at)?;
                Some((of_level(grid.level(coarsest)), place))
            })
            .collect();
        for coarser in (0..along.trailing_zeros()).map(|it| 1 << it) {
            for &(_, place) in on_sides.iter().filter(|it| it.0 == coarser) {
                close.samples[place] = close.between(close.at(place), along / coarser, along / coarser);
            }
        }
        close
    }

    /// Where a sample lies.
    fn at(&self, place: usize) -> [usize; 3] {
        let edge = BRICK as usize * self.along + 1;
        [place % edge, place / edge % edge, place / (edge * edge)]
    }

    /// Light at a place in units of which there are `units` in `stride` samples, between every `stride`-th sample.
    fn between(&self, place: [usize; 3], units: usize, stride: usize) -> L {
        let edge = BRICK as usize * self.along + 1;
        let last = (edge - 1) / stride - 1;
        let cell = place.map(|it| (it / units).min(last));
        let share: [f32; 3] =
            std::array::from_fn(|axis| (place[axis] - cell[axis] * units) as f32 / units as f32);
        let mix = |a: L, b: L, share: f32| a * (1.0 - share) + b * share;
        let along_x = |y: usize, z: usize| {
            let first = stride * (((cell[2] + z) * edge + cell[1] + y) * edge + cell[0]);
            mix(self.samples[first], self.samples[first + stride], share[0])
        };
        let along_y = |z: usize| mix(along_x(0, z), along_x(1, z), share[1]);
        mix(along_y(0), along_y(1), share[2])
    }
}

/// Fills the parts of a brick, with their aprons.
fn fill_parts<L: Spectrum>(
    grid: &Grid,
    (brick, level): ([u32; 3], u32),
    lights: &impl Lights<L>,
    samples: &mut [L::Sample],
) {
    let parts = 1_usize << level;
    let close = Close::new(grid, (brick, level), lights);
    for (number, samples) in samples.chunks_exact_mut(STORED).enumerate() {
        let part = [number % parts, number / parts % parts, number / (parts * parts)];
        let at = std::array::from_fn(|axis| (brick[axis] << level) + part[axis] as u32);
        let (densities, _) = grid.piece_samples(Piece { at, level });
        for (place, (sample, &density)) in samples.iter_mut().zip(densities).enumerate() {
            let inside = [place % EDGE, place / EDGE % EDGE, place / (EDGE * EDGE)];
            let fine = std::array::from_fn(|axis| part[axis] * BRICK as usize + inside[axis]);
            *sample = L::sample(density, close.between(fine, parts / close.along, 1));
        }
    }
}

/// Fills a brick with its apron.
#[simd]
fn fill<S: Simd, L: Spectrum>(
    simd: S,
    grid: &Grid,
    brick: [u32; 3],
    lights: &impl Lights<L>,
    samples: &mut [L::Sample],
) {
    let _ = simd;
    let densities = grid.brick_samples(brick);
    let [x, y, z] = brick.map(|it| it * BRICK);
    let rows = samples.chunks_exact_mut(EDGE).zip(densities.chunks_exact(EDGE)).enumerate();
    for (number, (samples, densities)) in rows {
        let mut light = [L::splat(0.0); EDGE];
        lights.row([x, y + (number % EDGE) as u32, z + (number / EDGE) as u32], 1, &mut light);
        for ((sample, &density), light) in samples.iter_mut().zip(densities).zip(light) {
            *sample = L::sample(density, light);
        }
    }
}
