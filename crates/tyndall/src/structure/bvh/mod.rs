//! The bounding volume hierarchy: eight-wide nodes with quantised child boxes over leaves of sixteen particles.
//!
//! `build` cuts the particles along their widest axis into leaves that are full but for the last. The cuts depend on counts
//! alone, so the shape of the tree is known beforehand and all its parts are filled in parallel, in place. A node holds the
//! boxes of its children in 8 bits a coordinate, rounded outward: invariant: a decoded box holds every sphere below it.
//! `rays` walks it with single rays; the walks of many rays at once stand in `render::cpu`.

mod rays;

use fearless_simd::{f32x8, f32x16, prelude::*};
use glam::Vec3;

use super::build::{RADIUS, Record, cut, records, widest};
use super::{Spheres, box_slack};
use crate::error::{Error, Result};
use crate::math::{Bounds, HIT_ROUNDING};
use crate::progress::Progress;
use crate::simd::Lanes3;

/// Particles in a leaf, children of a node.
pub const LEAF: usize = 16;
/// Children of a node.
pub const WIDTH: usize = 8;

/// Marks a place among the leaves where a place among the nodes could stand too.
pub(crate) const LEAF_BIT: u32 = 1 << 31;

/// Sixteen particles as columns. Places that are left over hold NaN, which no test accepts.
#[derive(Clone, Copy)]
pub(crate) struct Leaf {
    pub(crate) center: [[f32; LEAF]; 3],
    pub(crate) id: [u32; LEAF],
}

const EMPTY_LEAF: Leaf = Leaf { center: [[f32::NAN; LEAF]; 3], id: [u32::MAX; LEAF] };

/// Up to eight children: first inner nodes, then leaves, each kind side by side in its array.
#[derive(Clone, Copy, Default)]
pub(crate) struct Node {
    /// Child box = `corner + step * (lower..upper)`, by axis.
    pub(crate) corner: [f32; 3],
    pub(crate) step: [f32; 3],
    pub(crate) lower: [[u8; WIDTH]; 3],
    pub(crate) upper: [[u8; WIDTH]; 3],
    pub(crate) first_node: u32,
    pub(crate) first_leaf: u32,
    pub(crate) node_count: u8,
    pub(crate) leaf_count: u8,
}

impl Node {
    /// The place of child `child` among the nodes, or with [`LEAF_BIT`] among the leaves.
    #[inline(always)]
    pub(crate) fn child(&self, child: usize) -> u32 {
        let inner = self.node_count as usize;
        if child < inner {
            self.first_node + child as u32
        } else {
            LEAF_BIT | (self.first_leaf + (child - inner) as u32)
        }
    }

    /// A bit for every child that exists.
    #[inline(always)]
    pub(crate) fn existing(&self) -> u32 {
        (1 << (self.node_count + self.leaf_count)) - 1
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
        let mut sum = [0.0; WIDTH];
        let mut difference = [0.0; WIDTH];
        for child in 0..WIDTH {
            let (lower, upper) = (self.lower[axis][child] as i32, self.upper[axis][child] as i32);
            sum[child] = (upper + lower) as f32;
            difference[child] = (upper - lower) as f32;
        }
        let half_step = f32x8::splat(simd, 0.5 * self.step[axis]);
        let to_corner = f32x8::splat(simd, self.corner[axis] - eye);
        let middle = f32x8::load_array(simd, sum).mul_add(half_step, to_corner);
        let half = f32x8::load_array(simd, difference) * half_step;
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

/// See the module.
pub struct Bvh {
    pub(crate) nodes: Vec<Node>,
    pub(crate) leaves: Vec<Leaf>,
    /// A row a leaf, where radii differ.
    pub(crate) radii: Vec<[f32; LEAF]>,
    /// The radius, where all are alike.
    pub(crate) radius: f32,
    /// By how much boxes are grown against the rounding of decoded coordinates.
    pub(crate) slack: f32,
    bounds: Bounds,
}

impl Bvh {
    /// Builds over `spheres`, in parallel. Fails only when interrupted.
    pub fn build(spheres: Spheres, progress: &dyn Progress) -> Result<Self> {
        let leaf_count = spheres.len().div_ceil(LEAF);
        let mut records = records(spheres);
        let mut bvh = Self {
            nodes: vec![Node::default(); if leaf_count == 0 { 0 } else { 1 + descendants(leaf_count) }],
            leaves: vec![EMPTY_LEAF; leaf_count],
            radii: vec![[0.0; LEAF]; if spheres.uniform().is_some() { 0 } else { leaf_count }],
            radius: spheres.uniform().unwrap_or(0.0),
            slack: 0.0,
            bounds: Bounds::EMPTY,
        };
        if let Some((root, descendants)) = bvh.nodes.split_first_mut() {
            let span = Span {
                records: &mut records,
                nodes: descendants,
                leaves: &mut bvh.leaves,
                radii: &mut bvh.radii,
                first_node: 1,
                first_leaf: 0,
            };
            bvh.bounds = fill_node(root, span, progress);
            bvh.slack = box_slack(&bvh.bounds);
        }
        if progress.cancelled() { Err(Error::Interrupted) } else { Ok(bvh) }
    }

    /// See [`super::Structure::sphere`]: a node is a leaf's place, times sixteen, plus the particle's place therein.
    #[inline(always)]
    pub fn sphere(&self, node: u32) -> (Vec3, f32, u32) {
        let (leaf, place) = (node as usize / LEAF, node as usize % LEAF);
        let [x, y, z] = &self.leaves[leaf].center;
        let radius = self.radii.get(leaf).map_or(self.radius, |radii| radii[place]);
        (Vec3::new(x[place], y[place], z[place]), radius, self.leaves[leaf].id[place])
    }

    /// The radii of a leaf's particles.
    #[inline(always)]
    pub(crate) fn radii<S: Simd>(&self, simd: S, leaf: usize) -> f32x16<S> {
        match self.radii.get(leaf) {
            Some(radii) => f32x16::load_array_ref(simd, radii),
            None => f32x16::splat(simd, self.radius),
        }
    }

    /// The box of all particles, radii included.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Memory it takes, in bytes.
    pub fn bytes(&self) -> u64 {
        (size_of_val(&self.nodes[..]) + size_of_val(&self.leaves[..]) + size_of_val(&self.radii[..])) as u64
    }
}

/// The parts of the tree that one subtree fills: its particles, the nodes below its root, its leaves.
struct Span<'a> {
    records: &'a mut [Record],
    nodes: &'a mut [Node],
    leaves: &'a mut [Leaf],
    radii: &'a mut [[f32; LEAF]],
    /// Place of `nodes[0]` and `leaves[0]` in the whole tree.
    first_node: usize,
    first_leaf: usize,
}

/// Leaves below each full child of a node with `leaf_count` leaves: the power of eight that needs the fewest levels.
fn child_capacity(leaf_count: usize) -> usize {
    let mut capacity = 1;
    while capacity * WIDTH < leaf_count {
        capacity *= WIDTH;
    }
    capacity
}

/// Nodes below the root of a tree with `leaf_count` leaves. All children but the last are full.
fn descendants(leaf_count: usize) -> usize {
    let capacity = child_capacity(leaf_count);
    if capacity == 1 {
        return 0;
    }
    let full = leaf_count / capacity;
    let rest = leaf_count % capacity;
    let below = |leaves: usize| if leaves > 1 { 1 + descendants(leaves) } else { 0 };
    full * ((capacity - 1) / (WIDTH - 1)) + below(rest)
}

/// Below this many particles a subtree is filled by one thread.
const PARALLEL_COUNT: usize = 1 << 14;

/// Fills `node` and all below it, and returns its box.
fn fill_node(node: &mut Node, span: Span, progress: &dyn Progress) -> Bounds {
    if progress.cancelled() {
        return Bounds::EMPTY;
    }
    let leaf_count = span.leaves.len();
    let capacity = child_capacity(leaf_count);
    let child_count = leaf_count.div_ceil(capacity);
    let sizes: Vec<usize> =
        (0..child_count).map(|child| capacity.min(leaf_count - child * capacity)).collect();

    // Cut the particles into the children's shares, halving the list of children each time.
    cut_shares(span.records, &sizes);

    // A share of one leaf is a leaf, all others are nodes; only the last share can be smaller than the others.
    let node_count = sizes.iter().filter(|&&size| size > 1).count();
    node.node_count = node_count as u8;
    node.leaf_count = (child_count - node_count) as u8;
    node.first_node = span.first_node as u32;
    node.first_leaf = (span.first_leaf + node_count * capacity) as u32;

    let (children, mut nodes) = span.nodes.split_at_mut(node_count);
    let mut children = children.iter_mut();
    let (mut records, mut leaves, mut radii) = (span.records, span.leaves, span.radii);
    let (mut first_node, mut first_leaf) = (span.first_node + node_count, span.first_leaf);
    let mut boxes = [Bounds::EMPTY; WIDTH];
    let parallel = records.len() > PARALLEL_COUNT;
    rayon::in_place_scope(|scope| {
        for (slot, &size) in boxes.iter_mut().zip(&sizes) {
            let (share, later_records) = records.split_at_mut((size * LEAF).min(records.len()));
            let (own_leaves, later_leaves) = leaves.split_at_mut(size);
            let (own_radii, later_radii) = radii.split_at_mut(size.min(radii.len()));
            (records, leaves, radii) = (later_records, later_leaves, later_radii);
            if size == 1 {
                *slot = fill_leaf(&mut own_leaves[0], own_radii.first_mut(), share);
            } else {
                let child = children.next().expect("a node for every share of more than a leaf");
                let (own_nodes, later_nodes) = nodes.split_at_mut(descendants(size));
                nodes = later_nodes;
                let span = Span {
                    records: share,
                    leaves: own_leaves,
                    radii: own_radii,
                    first_node,
                    first_leaf,
                    nodes: own_nodes,
                };
                first_node += span.nodes.len();
                if parallel {
                    scope.spawn(move |_| {
                        let count = span.records.len();
                        *slot = fill_node(child, span, progress);
                        if count <= PARALLEL_COUNT {
                            progress.advance(count as u64);
                        }
                    });
                } else {
                    *slot = fill_node(child, span, progress);
                }
            }
            first_leaf += size;
        }
    });
    encode(node, &boxes[..child_count])
}

/// Permutes `records` so that each share of `sizes` leaves lies together, by cuts along the widest axis.
fn cut_shares(records: &mut [Record], sizes: &[usize]) {
    if sizes.len() < 2 {
        return;
    }
    let (left_sizes, right_sizes) = sizes.split_at(sizes.len().div_ceil(2));
    let left_count = left_sizes.iter().sum::<usize>() * LEAF;
    let axis = widest(records);
    cut(records, axis, left_count);
    let (left, right) = records.split_at_mut(left_count);
    if left_count > PARALLEL_COUNT {
        rayon::join(|| cut_shares(left, left_sizes), || cut_shares(right, right_sizes));
    } else {
        cut_shares(left, left_sizes);
        cut_shares(right, right_sizes);
    }
}

/// Writes at most sixteen particles into a leaf and returns their box.
fn fill_leaf(leaf: &mut Leaf, radii: Option<&mut [f32; LEAF]>, records: &[Record]) -> Bounds {
    let mut bounds = Bounds::EMPTY;
    for (place, record) in records.iter().enumerate() {
        for axis in 0..3 {
            leaf.center[axis][place] = record.coordinates[axis];
        }
        leaf.id[place] = record.id;
        let center = Vec3::from_slice(&record.coordinates);
        bounds = bounds.union(Bounds { min: center, max: center }.grown(record.coordinates[RADIUS]));
    }
    if let Some(radii) = radii {
        for (radius, record) in radii.iter_mut().zip(records) {
            *radius = record.coordinates[RADIUS];
        }
    }
    bounds
}

/// Writes the boxes into the node, rounded outward, and returns the box of all.
fn encode(node: &mut Node, boxes: &[Bounds]) -> Bounds {
    let all = boxes.iter().copied().fold(Bounds::EMPTY, Bounds::union);
    for axis in 0..3 {
        let corner = all.min[axis];
        // A hair more than the extent, so that 255 steps reach past its end in spite of rounding.
        let step = (all.extent()[axis] * (1.000_001 / 255.0)).max(f32::MIN_POSITIVE);
        node.corner[axis] = corner;
        node.step[axis] = step;
        for (child, bounds) in boxes.iter().enumerate() {
            node.lower[axis][child] = ((bounds.min[axis] - corner) / step).floor().clamp(0.0, 255.0) as u8;
            node.upper[axis][child] = ((bounds.max[axis] - corner) / step).ceil().clamp(0.0, 255.0) as u8;
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::particles::{Columns, Particles, Positions, Radii};
    use glam::DVec3;

    fn particles(count: usize) -> Particles {
        let column = |step: f32| (0..count).map(|id| (id as f32 * step).fract()).collect();
        let positions =
            Positions::from_offsets(DVec3::ZERO, [column(0.754_877), column(0.569_840), column(0.618_034)]);
        Particles::new(Columns { positions, ..Columns::default() }).unwrap()
    }

    /// Walks the whole tree, checks every box, and collects the ids.
    fn visit(bvh: &Bvh, node: u32, ids: &mut Vec<u32>) -> Bounds {
        let node = &bvh.nodes[node as usize];
        let mut all = Bounds::EMPTY;
        for child in 0..(node.node_count + node.leaf_count) as usize {
            let inside = if child < node.node_count as usize {
                visit(bvh, node.first_node + child as u32, ids)
            } else {
                let leaf = node.first_leaf as usize + child - node.node_count as usize;
                let mut inside = Bounds::EMPTY;
                for place in (0..LEAF).filter(|&place| bvh.leaves[leaf].id[place] != u32::MAX) {
                    ids.push(bvh.leaves[leaf].id[place]);
                    let center =
                        Vec3::from_array(std::array::from_fn(|axis| bvh.leaves[leaf].center[axis][place]));
                    inside = inside.union(Bounds { min: center, max: center }.grown(bvh.radius));
                }
                inside
            };
            for axis in 0..3 {
                let decode = |step: u8| node.corner[axis] + node.step[axis] * step as f32;
                assert!(decode(node.lower[axis][child]) <= inside.min[axis] + bvh.slack);
                assert!(decode(node.upper[axis][child]) >= inside.max[axis] - bvh.slack);
            }
            all = all.union(inside);
        }
        all
    }

    #[test]
    fn every_particle_is_in_one_leaf_and_every_box_holds_what_is_below_it() {
        for count in [0, 1, 2, 15, 16, 17, 127, 128, 129, 1000, 1025, 16 * 8 * 9, 40_000] {
            let particles = particles(count);
            let spheres = Spheres { particles: &particles, radii: &Radii::Uniform(0.01), radius_scale: 1.0 };
            let bvh = Bvh::build(spheres, &()).unwrap();
            let mut ids = Vec::new();
            if count > 0 {
                visit(&bvh, 0, &mut ids);
            }
            ids.sort_unstable();
            assert!(ids.iter().copied().eq(0..count as u32), "{count} particles");
        }
    }

    #[test]
    fn leaves_are_full_and_nodes_are_few() {
        let particles = particles(16 * 512);
        let spheres = Spheres { particles: &particles, radii: &Radii::Uniform(0.01), radius_scale: 1.0 };
        let bvh = Bvh::build(spheres, &()).unwrap();
        assert_eq!((bvh.leaves.len(), bvh.nodes.len()), (512, 1 + 8 + 64));
    }
}
