//! The density as a scatter: each particle spreads its mass over the samples within its own length.
//!
//! Takes cells and a length for each particle. What a particle gives to its samples is divided by the sum of the kernel over
//! them, so that all of its mass arrives, however coarse the lattice is and wherever it ends. A particle narrower than the
//! spacing is as wide as the spacing: then at least one sample of the lattice is within its reach if it lies in the lattice's box.
//! A particle outside that box gives only what it would give there if the lattice went on.
//!
//! Written as a gather (each block collects the particles that reach it), so that no two threads write to one sample.

use fearless_simd::{Level, dispatch, f32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::{UVec3, Vec3};
use rayon::prelude::*;

use super::block::{Block, sum_reaching};
use super::gather::Found;
use super::volume::Blocks;
use crate::medium::cells::{CELL, Cells, Column, Reach};
use crate::medium::grid::Lattice;
use crate::medium::kernel::Shape;

/// What all samples share.
pub(super) struct Scatter<'a, K> {
    cells: &'a Cells,
    block: Block,
    shape: K,
    reach: Reach,
    inverse_sq: Column,
    /// Each column of values, divided by the particles' shares and the volume of a cell of the lattice.
    columns: Vec<Column>,
}

impl<'a, K: Shape> Scatter<'a, K> {
    /// Of particles with these lengths, which spread the values of these columns. Also how many particles are outside the box.
    pub(super) fn new(
        cells: &'a Cells,
        lattice: &Lattice,
        shape: K,
        mut lengths: Column,
        mut columns: Vec<Column>,
    ) -> (Self, usize) {
        lengths.par_iter_mut().for_each(|lengths| *lengths = lengths.map(|it| it.max(lattice.spacing)));
        let inverse_sq: Column =
            lengths.par_iter().map(|lengths| lengths.map(|it| 1.0 / (it * it))).collect();
        let held: Column = (0..lengths.len())
            .into_par_iter()
            .map(|cell| {
                std::array::from_fn(|lane| {
                    let center = cells.centers()[cell];
                    let center = Vec3::new(center[0][lane], center[1][lane], center[2][lane]);
                    let exists = center.is_finite();
                    let length = lengths[cell][lane];
                    let hold = || dispatch!(Level::new(), simd => held(simd, lattice, shape, center, length));
                    if exists { hold() } else { 0.0 }
                })
            })
            .collect();
        let bounds = lattice.bounds();
        let outside = cells.centers().iter().map(|center| {
            let places = (0..CELL).map(|lane| Vec3::new(center[0][lane], center[1][lane], center[2][lane]));
            places.filter(|it| it.is_finite() && !bounds.contains(*it)).count()
        });
        let outside = outside.sum();
        let volume = lattice.spacing.powi(3);
        let share = |value: f32, held: f32| if held > 0.0 { value / (held * volume) } else { 0.0 };
        for column in &mut columns {
            column.par_iter_mut().zip(&held).for_each(|(values, held)| {
                *values = std::array::from_fn(|lane| share(values[lane], held[lane]));
            });
        }
        let reach = cells.reach(&lengths);
        (Self { cells, block: Block::new(lattice.spacing), shape, reach, inverse_sq, columns }, outside)
    }

    #[simd]
    fn fill_block<S: Simd>(&self, simd: S, middle: Vec3, found: &mut Found) -> bool {
        found.sums.resize(self.columns.len(), [[0.0; 16]; 4]);
        for (place, column) in self.columns.iter().enumerate() {
            let values: [&[[f32; CELL]]; 2] = [column, &self.inverse_sq];
            found.near.collect(simd, self.cells, (&self.block, middle), &self.reach, values);
            if found.near.len() == 0 {
                return false;
            }
            sum_reaching(simd, (self.shape, &self.block), &found.near, &mut found.sums[place]);
        }
        true
    }
}

impl<K: Shape> Blocks for Scatter<'_, K> {
    fn fill(&self, middle: Vec3, found: &mut Found) -> bool {
        dispatch!(Level::new(), simd => self.fill_block(simd, middle, found))
    }

    fn columns(&self) -> usize {
        self.columns.len()
    }

    fn target(&self) -> u32 {
        u32::MAX
    }
}

/// The sum of the kernel over the samples of the lattice, or of one without end if the particle is outside.
#[simd]
fn held<S: Simd>(simd: S, lattice: &Lattice, shape: impl Shape, center: Vec3, length: f32) -> f32 {
    let last = UVec3::from_array(lattice.size).as_vec3() - 1.0;
    let place = (center - lattice.origin) / lattice.spacing;
    let reach = length / lattice.spacing;
    let (mut low, mut high) = ((place - reach).ceil(), (place + reach).floor());
    if lattice.bounds().contains(center) {
        (low, high) = (low.max(Vec3::ZERO), high.min(last));
    }
    let count = (high - low + 1.0).as_uvec3();
    let aside = lattice.origin + lattice.spacing * low - center;
    let inverse_sq = f32x16::splat(simd, 1.0 / (length * length));
    let steps = f32x16::load_array(simd, STEPS);
    let mut sum = f32x16::splat(simd, 0.0);
    for k in 0..count.z {
        let z = aside.z + k as f32 * lattice.spacing;
        for j in 0..count.y {
            let y = aside.y + j as f32 * lattice.spacing;
            let row_sq = f32x16::splat(simd, y * y + z * z);
            for i in (0..count.x).step_by(16) {
                let place = steps + f32x16::splat(simd, i as f32);
                let x = place * f32x16::splat(simd, lattice.spacing) + f32x16::splat(simd, aside.x);
                let value = shape.shape(simd, (x * x + row_sq) * inverse_sq);
                let inside = place.simd_lt(f32x16::splat(simd, count.x as f32));
                sum += inside.select(value, f32x16::splat(simd, 0.0));
            }
        }
    }
    // One after the other: how a vector is summed may depend on its width.
    sum.to_array().iter().sum()
}

/// The numbers of the lanes.
const STEPS: [f32; 16] =
    [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0];
