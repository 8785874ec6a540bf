//! The bounding volume hierarchy: eight-wide nodes with quantised child boxes over leaves of sixteen particles.
//!
//! Leaf `k` holds the particles `16 k ..`, node `k` of a level the leaves (or the nodes of the level below) `8 k ..`: all are full but
//! the last, and nothing points to anything. A node is one cache line: the boxes of its children in 8 bits a coordinate, rounded
//! outward: invariant: a decoded box holds every sphere below it, as its block decodes it.
//! `build` sorts the particles and writes all this; `block` and `sizes` are what a leaf holds, `packing_error` what that costs; `rays`
//! walks it with single rays, `shown` hides particles from all walks; the walks of many rays at once stand in `render::cpu`.

#[cfg(feature = "gpu")]
mod arrays;
mod block;
mod build;
#[cfg(test)]
mod check;
mod packing_error;
mod rays;
mod saved;
mod shown;
mod sizes;
mod stream;

use fearless_simd::{f32x8, f32x16, prelude::*};
use glam::Vec3;

use super::box_slack;
use crate::frozen::Frozen;
use crate::math::{Bounds, HIT_ROUNDING};
use crate::simd::{Lanes3, floats_of_bytes};
#[cfg(feature = "gpu")]
pub(crate) use arrays::{Array, Arrays, Outline, SizeArrays};
pub use block::Packing;
use block::{Blocks, power_of_two, step_exponent};
use bytemuck::{Pod, Zeroable};
pub use packing_error::PackingError;
pub(super) use rays::Slabs;
use shown::Shown;
#[cfg(feature = "gpu")]
pub(crate) use sizes::Law;
use sizes::Sizes;

/// Particles in a leaf.
pub const LEAF: usize = 16;
/// Children of a node.
pub const WIDTH: usize = 8;

/// A leaf (level 0) or a node (levels above), by its place in its level.
#[derive(Clone, Copy)]
pub(crate) struct Place {
    pub(crate) index: u32,
    pub(crate) level: u8,
}

/// The boxes of up to eight children.
#[derive(Clone, Copy, Default, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Node {
    /// Child box = `corner + step * (lower..upper)`, by axis; the step is a power of two, of which this is the biased exponent.
    corner: [f32; 3],
    exponent: [u8; 3],
    /// Puts the steps where whole words begin.
    unused: u8,
    /// The lower steps of all children, then the upper ones.
    steps: [[u8; 2 * WIDTH]; 3],
}

impl Node {
    /// Holds at most eight boxes, rounded outward.
    pub(in crate::structure) fn encode(boxes: &[Bounds]) -> Self {
        let all = boxes.iter().copied().fold(Bounds::EMPTY, Bounds::union);
        let mut node = Self::default();
        for axis in 0..3 {
            let corner = all.min[axis];
            // A hair more than the extent, so that 255 steps reach past its end in spite of rounding.
            let exponent = step_exponent(all.extent()[axis] * 1.000_001, 255.0);
            let step = power_of_two(exponent);
            (node.corner[axis], node.exponent[axis]) = (corner, exponent);
            for (child, bounds) in boxes.iter().enumerate() {
                let steps = |at: f32| (at - corner) / step;
                node.steps[axis][child] = steps(bounds.min[axis]).floor().clamp(0.0, 255.0) as u8;
                node.steps[axis][WIDTH + child] = steps(bounds.max[axis]).ceil().clamp(0.0, 255.0) as u8;
            }
        }
        node
    }

    /// Middles and half extents of the child boxes, measured from `eye`; the extents grown by `margin` and against rounding.
    #[inline(always)]
    pub(crate) fn decode<S: Simd>(
        &self,
        simd: S,
        eye: Vec3,
        margin: f32,
    ) -> (Lanes3<f32x8<S>>, Lanes3<f32x8<S>>) {
        let (x, half_x) = self.decode_axis(simd, 0, eye.x, margin);
        let (y, half_y) = self.decode_axis(simd, 1, eye.y, margin);
        let (z, half_z) = self.decode_axis(simd, 2, eye.z, margin);
        (Lanes3 { x, y, z }, Lanes3 { x: half_x, y: half_y, z: half_z })
    }

    #[inline(always)]
    fn decode_axis<S: Simd>(&self, simd: S, axis: usize, eye: f32, margin: f32) -> (f32x8<S>, f32x8<S>) {
        let (lower, upper) = floats_of_bytes(simd, &self.steps[axis]).split();
        let half_step = f32x8::splat(simd, 0.5 * power_of_two(self.exponent[axis]));
        let to_corner = f32x8::splat(simd, self.corner[axis] - eye);
        let middle = (upper + lower).mul_add(half_step, to_corner);
        let half = (upper - lower) * half_step;
        let rounding = f32x8::splat(simd, HIT_ROUNDING);
        (middle, (middle.abs() + half).mul_add(rounding, half + f32x8::splat(simd, margin)))
    }
}

/// Pushes `entry` onto the part of the stack from `first` on, so that what is nearest comes off first. For the few children of a node.
#[inline(always)]
pub(crate) fn push_sorted<E: Copy>(stack: &mut Vec<E>, first: usize, entry: E, distance: fn(&E) -> f32) {
    stack.push(entry);
    let mut place = stack.len() - 1;
    while place > first && distance(&stack[place - 1]) < distance(&entry) {
        stack[place] = stack[place - 1];
        place -= 1;
    }
    stack[place] = entry;
}

/// More levels than 2^32 particles need.
const LEVELS: usize = 12;

/// See the module. Clones share all but what is shown.
#[derive(Clone)]
pub struct Bvh {
    /// All nodes, level by level from those over the leaves to the root.
    nodes: Frozen<Node>,
    /// Where each level begins among `nodes`, and how many it has; level 0 are the leaves.
    first: [u32; LEVELS],
    count: [u32; LEVELS],
    top: u8,
    blocks: Blocks,
    /// Radii as they were built; `radius_scale` times that is what is seen.
    sizes: Sizes,
    radius_scale: f32,
    /// Of every particle of the tree the id.
    ids: Frozen<u32>,
    /// By how much boxes are grown against the rounding of decoded coordinates, and since radii were scaled.
    pub(crate) slack: f32,
    bounds: Bounds,
    /// What the boxes of the root hold, without the margin of scaled radii.
    boxes: Bounds,
    packing_error: Option<PackingError>,
    /// Which particles are shown.
    shown: Shown,
}

impl Bvh {
    /// The root; none without particles.
    #[inline(always)]
    pub(crate) fn root(&self) -> Option<Place> {
        (self.top > 0).then_some(Place { index: 0, level: self.top })
    }

    /// A node; its place is not that of a leaf.
    #[inline(always)]
    pub(crate) fn node(&self, place: Place) -> &Node {
        &self.nodes[(self.first[place.level as usize] + place.index) as usize]
    }

    /// Child `child` of a node.
    #[inline(always)]
    pub(crate) fn child(&self, place: Place, child: usize) -> Place {
        Place { index: place.index * WIDTH as u32 + child as u32, level: place.level - 1 }
    }

    /// How many leaves there are.
    pub(crate) fn leaf_count(&self) -> usize {
        self.count[0] as usize
    }

    /// A bit for every child that a node has.
    #[inline(always)]
    fn existing(&self, place: Place) -> u32 {
        let below = self.count[place.level as usize - 1] - place.index * WIDTH as u32;
        (1 << below.min(WIDTH as u32)) - 1
    }

    /// The centers of a leaf's particles; NaN at places that are left over.
    #[inline(always)]
    pub(crate) fn centers<S: Simd>(&self, simd: S, leaf: usize) -> Lanes3<f32x16<S>> {
        self.blocks.centers(simd, leaf)
    }

    /// The radii of a leaf's particles.
    #[inline(always)]
    pub(crate) fn radii<S: Simd>(&self, simd: S, leaf: usize) -> f32x16<S> {
        self.sizes.radii(simd, leaf) * f32x16::splat(simd, self.radius_scale)
    }

    /// See [`super::Structure::sphere`]: a node is a leaf's place, times sixteen, plus the particle's place therein.
    #[inline(always)]
    pub fn sphere(&self, node: u32) -> (Vec3, f32) {
        let (leaf, place) = (node as usize / LEAF, node as usize % LEAF);
        (self.blocks.center(leaf, place), self.radius_scale * self.sizes.radius(leaf, place))
    }

    /// The same particles with radii `scale` times those that were built. One radius for all moves all boxes alike, by a margin that
    /// walks add; where radii differ, boxes are found anew.
    pub(in crate::structure) fn scaled(self, scale: f32) -> Self {
        let built = Self { radius_scale: scale, ..self };
        let Sizes::Uniform(radius) = built.sizes else {
            let Self { blocks, sizes, ids, shown, packing_error, .. } = built;
            return Self { shown, packing_error, ..Self::over(blocks, sizes, ids, scale) };
        };
        let grown = (scale - 1.0) * radius;
        let bounds = built.boxes.grown(grown);
        let slack = box_slack(&built.boxes.union(bounds)) + grown;
        Self { bounds, slack, ..built }
    }

    /// The ids, by node.
    #[inline(always)]
    pub fn ids(&self) -> &[u32] {
        &self.ids
    }

    /// The box of all particles, radii included.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// What packing cost; none where centers and radii are exact.
    pub fn packing_error(&self) -> Option<&PackingError> {
        self.packing_error.as_ref()
    }

    /// Memory that it takes in bytes, without the ids.
    pub fn bytes(&self) -> u64 {
        (size_of_val(&self.nodes[..]) + self.blocks.bytes() + self.sizes.bytes()) as u64
    }
}

#[cfg(test)]
impl Node {
    /// The least and greatest corner of a child's box.
    pub(super) fn decoded(&self, child: usize) -> [Vec3; 2] {
        [child, WIDTH + child].map(|at| {
            let decode = |axis: usize| {
                self.corner[axis] + power_of_two(self.exponent[axis]) * f32::from(self.steps[axis][at])
            };
            Vec3::new(decode(0), decode(1), decode(2))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Kind, Structure};
    use super::*;
    use crate::particles::{Columns, Particles, Positions, Radii};
    use glam::DVec3;

    fn build(count: usize, packing: Packing) -> Bvh {
        let column = |step: f32| (0..count).map(|id| (id as f32 * step).fract()).collect();
        let positions =
            Positions::from_offsets(DVec3::ZERO, [column(0.754_877), column(0.569_840), column(0.618_034)]);
        let particles = Particles::new(Columns { positions, ..Columns::default() }).unwrap();
        let radii = Radii::Uniform(0.01);
        match Structure::build(Kind::Bvh(packing), particles, &radii, 1.0, &()).unwrap().store {
            super::super::Store::Bvh(bvh) => bvh,
            _ => unreachable!("a hierarchy was asked for"),
        }
    }

    #[test]
    fn every_particle_is_in_one_leaf_and_every_box_holds_what_is_below_it() {
        for packing in [Packing::Exact, Packing::Bits16, Packing::Bits11, Packing::Bits8] {
            for count in [0, 1, 2, 15, 16, 17, 127, 128, 129, 1000, 1025, 16 * 8 * 9, 40_000] {
                let bvh = build(count, packing);
                bvh.check().unwrap_or_else(|broken| panic!("{packing:?}, {count} particles: {broken}"));
            }
        }
    }

    #[test]
    fn what_is_broken_is_seen() {
        for (number, sabotage) in check::SABOTAGES.into_iter().enumerate() {
            let mut bvh = build(1000, Packing::Exact);
            assert_eq!(bvh.check(), Ok(()));
            sabotage(&mut bvh);
            assert!(bvh.check().is_err(), "sabotage {number}");
        }
    }

    #[test]
    fn leaves_are_full_and_nodes_are_few_and_small() {
        let bvh = build(16 * 512, Packing::Bits16);
        assert_eq!((bvh.count[0], bvh.nodes.len(), size_of::<Node>()), (512, 64 + 8 + 1, 64));
        assert_eq!(bvh.bytes(), 512 * 112 + 73 * 64);
    }
}
