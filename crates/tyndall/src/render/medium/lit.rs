//! What the march looks up: density and light side by side, at the samples of the density's bricks.
//!
//! Takes a grid and what gives light to a point; a look-up reads four rows of one brick and gives both at once. Light is the
//! radiance that scattering and emission add per extinction; the three colors of it, or one that they are multiples of. Invariant: where the
//! density is not 0, so is an entry; elsewhere the entry says how many bricks it is at least to the next one that is not empty.

use bytemuck::Pod;
use fearless_simd::{Level, Simd, dispatch};
use fearless_simd_macros::simd;
use glam::{Vec3, Vec3A, Vec4, Vec4Swizzles};
use rayon::prelude::*;

use super::space::Space;
use crate::math::exp_minus;
use crate::medium::Grid;
use crate::medium::grid::{BRICK, EDGE, STORED};
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
}

/// Gives light to the samples of a row, all of one brick: from a place in the lattice on, along x.
pub(super) trait Lights<L>: Sync {
    fn row(&self, first: [u32; 3], row: &mut [L; EDGE]);
}

impl<L: Spectrum> LitBricks<L> {
    /// Lights the bricks of `grid` that are not empty.
    pub(super) fn new(grid: &Grid, lights: &impl Lights<L>) -> Self {
        let space = Space::of(grid);
        let last = Vec3A::from(grid.size().map(|size| (size - 1) as f32));
        let filled = space.filled();
        let mut samples = pages::filled(filled.len() * STORED, L::Sample::default());
        let level = Level::new();
        samples.par_chunks_exact_mut(STORED).zip(&filled).for_each(|(samples, &brick)| {
            dispatch!(level, simd => fill(simd, grid, brick, lights, samples));
        });
        Self { space, last, samples }
    }

    pub(super) fn bytes(&self) -> u64 {
        std::mem::size_of_val(&self.samples[..]) as u64
    }

    /// Density and light at a place in brick number `brick` (see [`Space`]), in lattice units.
    #[inline(always)]
    pub(super) fn look_up(&self, brick: usize, place: Vec3A) -> (f32, L) {
        let place = place.max(Vec3A::ZERO).min(self.last);
        let cell = place.floor();
        let inside = cell - BRICK as f32 * (place * (1.0 / BRICK as f32)).floor();
        // Exact in floats.
        let at = inside.dot(Vec3A::new(1.0, EDGE as f32, (EDGE * EDGE) as f32)) as usize;
        L::interpolate(&self.samples[brick * STORED + at..], place - cell)
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
        lights.row([x, y + (number % EDGE) as u32, z + (number / EDGE) as u32], &mut light);
        for ((sample, &density), light) in samples.iter_mut().zip(densities).zip(light) {
            *sample = L::sample(density, light);
        }
    }
}
