//! The hot loops of the density: 64 samples against the particles near them.
//!
//! A block is 4 x 4 x 4 samples: four planes of sixteen lanes. Each particle near the block meets all 64 samples: its distance in
//! the plane is common to the four planes, its distance from each plane was computed before ([`Near::depth_sq`]). Nothing is
//! fused and lanes are samples, so that the result is the same for every width of SIMD.

use fearless_simd::{f32x16, i32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::Vec3;

use crate::medium::cells::{CELL, Candidates, Cells, Radius, Region};
use crate::medium::kernel::Shape;

/// Samples along an edge of a block.
pub(super) const EDGE: usize = 4;
/// A value of each sample of a block, plane by plane.
pub(super) type Samples<T> = [[T; EDGE * EDGE]; EDGE];

/// Where the samples of every block lie, measured from its middle.
pub(super) struct Block {
    x: [f32; 16],
    y: [f32; 16],
    z: [f32; EDGE],
    half: f32,
}

impl Block {
    /// Blocks of a lattice of this spacing.
    pub(super) fn new(spacing: f32) -> Self {
        let aside = |place: usize| (place as f32 - 1.5) * spacing;
        Self {
            x: std::array::from_fn(|lane| aside(lane % EDGE)),
            y: std::array::from_fn(|lane| aside(lane / EDGE)),
            z: std::array::from_fn(aside),
            half: 1.5 * spacing,
        }
    }

    /// The box of the samples of the block around `middle`.
    pub(super) fn region(&self, middle: Vec3) -> Region {
        Region { center: middle, half: Vec3::splat(self.half) }
    }
}

/// The particles near a block.
#[derive(Default)]
pub(super) struct Near {
    found: Candidates,
    /// Squares of the distances from the four planes.
    depth_sq: [Vec<f32>; EDGE],
}

impl Near {
    /// How many particles reach all of the block, and are not among these.
    pub(super) fn everywhere(&self) -> u32 {
        self.found.everywhere
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.found.len()
    }

    /// Finds the particles that reach the block around `middle`, with two of their values.
    #[simd]
    pub(super) fn collect<S: Simd>(
        &mut self,
        simd: S,
        cells: &Cells,
        (block, middle): (&Block, Vec3),
        radius: &impl Radius,
        columns: [&[[f32; CELL]]; 2],
    ) {
        cells.collect(simd, block.region(middle), radius, columns, &mut self.found);
        let z = self.found.center()[2];
        for (plane, column) in self.depth_sq.iter_mut().enumerate() {
            if column.len() < z.len() {
                column.resize(2 * z.len(), 0.0);
            }
            let plane = block.z[plane];
            for (depth_sq, z) in column.iter_mut().zip(z) {
                let depth = z - plane;
                *depth_sq = depth * depth;
            }
        }
    }

    #[inline(always)]
    fn depth_sq(&self, plane: usize) -> &[f32] {
        &self.depth_sq[plane][..self.found.len()]
    }
}

/// How many of the particles lie within each sample's length.
#[simd]
pub(super) fn count<S: Simd>(
    simd: S,
    block: &Block,
    near: &Near,
    length_sq: &Samples<f32>,
    counts: &mut Samples<u32>,
) {
    let (lanes_x, lanes_y) = (f32x16::load_array(simd, block.x), f32x16::load_array(simd, block.y));
    let limit0 = f32x16::load_array(simd, length_sq[0]);
    let limit1 = f32x16::load_array(simd, length_sq[1]);
    let limit2 = f32x16::load_array(simd, length_sq[2]);
    let limit3 = f32x16::load_array(simd, length_sq[3]);
    let one = i32x16::splat(simd, 1);
    let zero = i32x16::splat(simd, 0);
    let (mut count0, mut count1, mut count2, mut count3) = (zero, zero, zero, zero);
    let [x, y, _] = near.found.center();
    let (depth0, depth1) = (near.depth_sq(0), near.depth_sq(1));
    let (depth2, depth3) = (near.depth_sq(2), near.depth_sq(3));
    for (k, (&x, &y)) in x.iter().zip(y).enumerate() {
        let aside_x = lanes_x - f32x16::splat(simd, x);
        let aside_y = lanes_y - f32x16::splat(simd, y);
        let aside_sq = aside_x * aside_x + aside_y * aside_y;
        let in0 = (aside_sq + f32x16::splat(simd, depth0[k])).simd_le(limit0);
        let in1 = (aside_sq + f32x16::splat(simd, depth1[k])).simd_le(limit1);
        let in2 = (aside_sq + f32x16::splat(simd, depth2[k])).simd_le(limit2);
        let in3 = (aside_sq + f32x16::splat(simd, depth3[k])).simd_le(limit3);
        count0 = in0.select(count0 + one, count0);
        count1 = in1.select(count1 + one, count1);
        count2 = in2.select(count2 + one, count2);
        count3 = in3.select(count3 + one, count3);
    }
    for (counts, found) in counts.iter_mut().zip([count0, count1, count2, count3]) {
        let found = found.to_array();
        for (count, found) in counts.iter_mut().zip(found) {
            *count = found as u32 + near.found.everywhere;
        }
    }
}

/// The sum of weight * shape(distance / length) over the particles, and how many of them lie within the length. The first value
/// that was collected with the particles is the weight.
#[simd]
pub(super) fn sum<S: Simd>(
    simd: S,
    (shape, block): (impl Shape, &Block),
    near: &Near,
    length_sq: &Samples<f32>,
    (sums, counts): (&mut Samples<f32>, &mut Samples<u32>),
) {
    let (lanes_x, lanes_y) = (f32x16::load_array(simd, block.x), f32x16::load_array(simd, block.y));
    let [x, y, _] = near.found.center();
    let [weight, _] = near.found.values();
    let one = i32x16::splat(simd, 1);
    // Two planes at a time: four would not leave registers for the kernel.
    for pair in [0, 2] {
        let limit0 = f32x16::load_array(simd, length_sq[pair]);
        let limit1 = f32x16::load_array(simd, length_sq[pair + 1]);
        let inverse0 = f32x16::splat(simd, 1.0) / limit0;
        let inverse1 = f32x16::splat(simd, 1.0) / limit1;
        let (depth0, depth1) = (near.depth_sq(pair), near.depth_sq(pair + 1));
        let (mut sum0, mut sum1) = (f32x16::splat(simd, 0.0), f32x16::splat(simd, 0.0));
        let (mut count0, mut count1) = (i32x16::splat(simd, 0), i32x16::splat(simd, 0));
        for (k, (&x, &y)) in x.iter().zip(y).enumerate() {
            let aside_x = lanes_x - f32x16::splat(simd, x);
            let aside_y = lanes_y - f32x16::splat(simd, y);
            let aside_sq = aside_x * aside_x + aside_y * aside_y;
            let weight = f32x16::splat(simd, weight[k]);
            let distance0 = aside_sq + f32x16::splat(simd, depth0[k]);
            let distance1 = aside_sq + f32x16::splat(simd, depth1[k]);
            sum0 += weight * shape.shape(simd, distance0 * inverse0);
            sum1 += weight * shape.shape(simd, distance1 * inverse1);
            count0 = distance0.simd_le(limit0).select(count0 + one, count0);
            count1 = distance1.simd_le(limit1).select(count1 + one, count1);
        }
        sum0.store_array(&mut sums[pair]);
        sum1.store_array(&mut sums[pair + 1]);
        counts[pair] = count0.to_array().map(|it| it as u32);
        counts[pair + 1] = count1.to_array().map(|it| it as u32);
    }
}

/// The squared distances of all particles from the sixteen samples of a plane.
#[simd]
pub(super) fn distances_sq<S: Simd>(
    simd: S,
    block: &Block,
    near: &Near,
    plane: usize,
    distances_sq: &mut Vec<[f32; 16]>,
) {
    let (lanes_x, lanes_y) = (f32x16::load_array(simd, block.x), f32x16::load_array(simd, block.y));
    if distances_sq.len() < near.len() {
        distances_sq.resize(2 * near.len(), [0.0; 16]);
    }
    let [x, y, _] = near.found.center();
    for (((&x, &y), &depth_sq), distance_sq) in
        x.iter().zip(y).zip(near.depth_sq(plane)).zip(distances_sq.iter_mut())
    {
        let aside_x = lanes_x - f32x16::splat(simd, x);
        let aside_y = lanes_y - f32x16::splat(simd, y);
        let aside_sq = aside_x * aside_x + aside_y * aside_y;
        (aside_sq + f32x16::splat(simd, depth_sq)).store_array(distance_sq);
    }
}

/// The sum of weight * shape(distance / length) over the particles, each with its own length. The first value that was collected
/// with the particles is the weight, the second one over the square of the length.
#[simd]
pub(super) fn sum_reaching<S: Simd>(
    simd: S,
    (shape, block): (impl Shape, &Block),
    near: &Near,
    sums: &mut Samples<f32>,
) {
    let (lanes_x, lanes_y) = (f32x16::load_array(simd, block.x), f32x16::load_array(simd, block.y));
    let [x, y, _] = near.found.center();
    let [weight, inverse_sq] = near.found.values();
    for pair in [0, 2] {
        let (depth0, depth1) = (near.depth_sq(pair), near.depth_sq(pair + 1));
        let (mut sum0, mut sum1) = (f32x16::splat(simd, 0.0), f32x16::splat(simd, 0.0));
        for (k, (&x, &y)) in x.iter().zip(y).enumerate() {
            let aside_x = lanes_x - f32x16::splat(simd, x);
            let aside_y = lanes_y - f32x16::splat(simd, y);
            let aside_sq = aside_x * aside_x + aside_y * aside_y;
            let weight = f32x16::splat(simd, weight[k]);
            let inverse_sq = f32x16::splat(simd, inverse_sq[k]);
            let distance0 = aside_sq + f32x16::splat(simd, depth0[k]);
            let distance1 = aside_sq + f32x16::splat(simd, depth1[k]);
            sum0 += weight * shape.shape(simd, distance0 * inverse_sq);
            sum1 += weight * shape.shape(simd, distance1 * inverse_sq);
        }
        sum0.store_array(&mut sums[pair]);
        sum1.store_array(&mut sums[pair + 1]);
    }
}
