//! The particles near a region, found by a walk through the boxes.
//!
//! Takes a box and how far particles reach, gives those that reach it as columns. A box of the hierarchy is left out if it is
//! too far from the region, and counted as a whole if that is wanted and all of the region is within reach of all of it.
//!
//! Invariant: what is found stands in the order of the curve, whatever else is sorted with it: sums over it depend on the particles
//! near the region alone, to the bit.

use fearless_simd::{f32x8, f32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::Vec3;
use rayon::prelude::*;

use super::{CELL, Cells, Column, Node, WIDTH};
use crate::simd::Lanes3;

/// What rounding can add to a distance, relative to the largest coordinate: some units in the last place.
const ROUNDING: f32 = 1e-6;

/// Points among which particles are looked for: their box.
#[derive(Clone, Copy)]
pub(in crate::medium) struct Region {
    /// Its middle, from which found particles are measured.
    pub(in crate::medium) center: Vec3,
    /// Half its edges.
    pub(in crate::medium) half: Vec3,
}

/// How far particles reach: all alike, or each its own.
pub(in crate::medium) trait Radius {
    /// The greatest reach of each child of a node.
    fn children<S: Simd>(&self, simd: S, level: usize, node: usize) -> f32x8<S>;
    /// The reach of each particle of a cell.
    fn particles<S: Simd>(&self, simd: S, cell: usize) -> f32x16<S>;
    /// The reach of what is counted instead of collected if all of the region is within it.
    fn inner(&self) -> Option<f32>;
}

/// All particles reach this far.
pub(in crate::medium) struct Within(pub(in crate::medium) f32);

/// All particles reach this far, and those that reach all of the region are counted only.
pub(in crate::medium) struct Counted(pub(in crate::medium) f32);

/// Each particle has its own reach. Made by [`Cells::reach`].
pub(in crate::medium) struct Reach {
    levels: Vec<Vec<[f32; WIDTH]>>,
    cells: Column,
}

impl Radius for Within {
    #[inline(always)]
    fn children<S: Simd>(&self, simd: S, _level: usize, _node: usize) -> f32x8<S> {
        f32x8::splat(simd, self.0)
    }

    #[inline(always)]
    fn particles<S: Simd>(&self, simd: S, _cell: usize) -> f32x16<S> {
        f32x16::splat(simd, self.0)
    }

    #[inline(always)]
    fn inner(&self) -> Option<f32> {
        None
    }
}

impl Radius for Counted {
    #[inline(always)]
    fn children<S: Simd>(&self, simd: S, _level: usize, _node: usize) -> f32x8<S> {
        f32x8::splat(simd, self.0)
    }

    #[inline(always)]
    fn particles<S: Simd>(&self, simd: S, _cell: usize) -> f32x16<S> {
        f32x16::splat(simd, self.0)
    }

    #[inline(always)]
    fn inner(&self) -> Option<f32> {
        Some(self.0)
    }
}

impl Radius for Reach {
    #[inline(always)]
    fn children<S: Simd>(&self, simd: S, level: usize, node: usize) -> f32x8<S> {
        f32x8::load_array_ref(simd, &self.levels[level][node])
    }

    #[inline(always)]
    fn particles<S: Simd>(&self, simd: S, cell: usize) -> f32x16<S> {
        f32x16::load_array_ref(simd, &self.cells[cell])
    }

    #[inline(always)]
    fn inner(&self) -> Option<f32> {
        None
    }
}

/// Particles near a region, as columns.
#[derive(Default)]
pub(in crate::medium) struct Candidates {
    /// How many there are; the columns are longer.
    len: usize,
    /// Centers, measured from the middle of the region.
    center: [Vec<f32>; 3],
    /// What else was asked for.
    values: [Vec<f32>; 2],
    /// How many particles reach all of the region, and are not among these. See [`Counted`].
    pub(in crate::medium) everywhere: u32,
    stack: Vec<(u32, u32)>,
}

impl Candidates {
    /// How many there are.
    pub(in crate::medium) fn len(&self) -> usize {
        self.len
    }

    /// Their centers, measured from the middle of the region.
    pub(in crate::medium) fn center(&self) -> [&[f32]; 3] {
        [&self.center[0][..self.len], &self.center[1][..self.len], &self.center[2][..self.len]]
    }

    /// Their values in the columns that were asked for.
    pub(in crate::medium) fn values(&self) -> [&[f32]; 2] {
        [&self.values[0][..self.len], &self.values[1][..self.len]]
    }

    /// Makes room for sixteen more.
    #[inline(always)]
    fn reserve(&mut self) {
        if self.center[0].len() < self.len + CELL {
            let len = 2 * (self.len + CELL);
            self.center.iter_mut().chain(&mut self.values).for_each(|it| it.resize(len, 0.0));
        }
    }
}

impl Cells {
    /// The greatest value of a column in each child of each node, level by level.
    pub(in crate::medium) fn reach(&self, column: &[[f32; CELL]]) -> Reach {
        let greatest = |values: &[f32]| values.iter().copied().fold(0.0, f32::max);
        let mut below: Vec<f32> = column.par_iter().map(|values| greatest(values)).collect();
        let mut levels = Vec::new();
        for _ in &self.levels {
            let level: Vec<[f32; WIDTH]> = below
                .par_chunks(WIDTH)
                .map(|chunk| std::array::from_fn(|child| chunk.get(child).copied().unwrap_or(0.0)))
                .collect();
            below = level.par_iter().map(|values| greatest(values)).collect();
            levels.push(level);
        }
        Reach { levels, cells: column.to_vec() }
    }

    /// Finds the particles whose reach touches the region, with their values in two columns. What rounding leaves in doubt is
    /// among them.
    #[simd]
    pub(in crate::medium) fn collect<S: Simd>(
        &self,
        simd: S,
        region: Region,
        radius: &impl Radius,
        columns: [&[[f32; CELL]]; 2],
        found: &mut Candidates,
    ) {
        let Region { center: middle, half } = region;
        let far_corner = self.bounds.min.abs().max(self.bounds.max.abs()).max(middle.abs() + half);
        let half = half + ROUNDING * far_corner.max_element();
        let inner_sq = radius.inner().map_or(-1.0, |it| it * it);
        let (middle8, half8) =
            (Lanes3::<f32x8<S>>::splat(simd, middle), Lanes3::<f32x8<S>>::splat(simd, half));

        found.len = 0;
        found.everywhere = 0;
        found.stack.clear();
        if !self.levels.is_empty() {
            found.stack.push((self.levels.len() as u32 - 1, 0));
        }
        while let Some((level, place)) = found.stack.pop() {
            // Meet the eight boxes: the least and the greatest distance from the region.
            let node = &self.levels[level as usize][place as usize];
            let (near_x, far_x) = apart(simd, node, 0, middle8.x, half8.x);
            let (near_y, far_y) = apart(simd, node, 1, middle8.y, half8.y);
            let (near_z, far_z) = apart(simd, node, 2, middle8.z, half8.z);
            let near_sq = near_x * near_x + near_y * near_y + near_z * near_z;
            let far_sq = far_x * far_x + far_y * far_y + far_z * far_z;
            let reach = radius.children(simd, level as usize, place as usize);
            let touched = near_sq.simd_le(reach * reach).to_bitmask();
            let covered = far_sq.simd_le(f32x8::splat(simd, inner_sq)).to_bitmask();

            // In the order of the curve: the last child waits longest on the stack.
            let (mut open, first) = (touched & !covered, place * WIDTH as u32);
            while open != 0 {
                let child = if level == 0 { open.trailing_zeros() } else { open.ilog2() };
                open ^= 1 << child;
                match level {
                    0 => {
                        let cell = (first + child) as usize;
                        self.collect_cell(simd, cell, (middle, half), (radius, columns), found);
                    }
                    _ => found.stack.push((level - 1, first + child)),
                }
            }
            let mut inside = covered;
            while inside != 0 {
                let child = (place as usize) * WIDTH + inside.trailing_zeros() as usize;
                inside &= inside - 1;
                let below = CELL << (3 * level);
                found.everywhere += (self.count - child * below).min(below) as u32;
            }
        }
    }

    /// Finds those of one cell.
    #[inline(always)]
    fn collect_cell<S: Simd>(
        &self,
        simd: S,
        cell: usize,
        (middle, half): (Vec3, Vec3),
        (radius, columns): (&impl Radius, [&[[f32; CELL]]; 2]),
        found: &mut Candidates,
    ) {
        let zero = f32x16::splat(simd, 0.0);
        let center = Lanes3::load(simd, &self.centers[cell]);
        let center = center.minus(Lanes3::splat(simd, middle));
        let apart = Lanes3 { x: center.x.abs(), y: center.y.abs(), z: center.z.abs() };
        let half = Lanes3::<f32x16<S>>::splat(simd, half);
        let near = apart.minus(half);
        let near = Lanes3 { x: near.x.max(zero), y: near.y.max(zero), z: near.z.max(zero) };
        let reach = radius.particles(simd, cell);
        let mut kept = near.dot(near).simd_le(reach * reach);
        if let Some(inner) = radius.inner() {
            let far = apart.plus(half);
            let covered = far.dot(far).simd_le(f32x16::splat(simd, inner * inner));
            found.everywhere += covered.to_bitmask().count_ones();
            kept &= !covered;
        }
        let bits = kept.to_bitmask();
        if bits == 0 {
            return;
        }
        found.reserve();
        let end = found.len + CELL;
        let place = found.len..end;
        center.x.compress(kept).store_slice(&mut found.center[0][place.clone()]);
        center.y.compress(kept).store_slice(&mut found.center[1][place.clone()]);
        center.z.compress(kept).store_slice(&mut found.center[2][place.clone()]);
        let values = [&columns[0][cell], &columns[1][cell]];
        f32x16::load_array_ref(simd, values[0])
            .compress(kept)
            .store_slice(&mut found.values[0][place.clone()]);
        f32x16::load_array_ref(simd, values[1]).compress(kept).store_slice(&mut found.values[1][place]);
        found.len = end - CELL + bits.count_ones() as usize;
    }
}

/// The least and the greatest distance along an axis of the eight boxes from a region.
#[inline(always)]
fn apart<S: Simd>(
    simd: S,
    node: &Node,
    axis: usize,
    middle: f32x8<S>,
    half: f32x8<S>,
) -> (f32x8<S>, f32x8<S>) {
    let centers = (f32x8::load_array_ref(simd, &node.center[axis]) - middle).abs();
    let halves = f32x8::load_array_ref(simd, &node.half[axis]) + half;
    ((centers - halves).max(f32x8::splat(simd, 0.0)), centers + halves)
}
