//! Treelets: a shallow hierarchy of wide nodes over small k-d trees in place.
//!
//! The particles are cut into runs of at most `Options::size`; each run is a left-balanced heap (see `structure/heap/`) with a box and a
//! largest radius of its own. Above them stand the eight-wide nodes of [`super::bvh`], here with a pointer to each child, because
//! cuts through the middle of space leave runs of any length. Invariant: a decoded box holds every sphere below it. Radius counts as
//! a coordinate when runs are cut, so that a large particle inflates few treelets. `build` cuts and sorts. Source: Gralka, Wald,
//! Geringer, Reina, Ertl 2020, Spatial Partitioning Strategies for Memory-Efficient Ray Tracing of Particles.

mod build;
mod saved;

use bytemuck::{Pod, Zeroable};
use fearless_simd::{Level, dispatch, f32x8, prelude::*};
use fearless_simd_macros::simd;
use glam::Vec3;

use super::bvh::{Node, Slabs, WIDTH};
use super::heap::{self, Columns, Heap, Stack};
#[cfg(feature = "gpu")]
use super::heap::{NodeArrays, NodeRecord};
use super::pkd;
use super::search::{Observer, Search};
#[cfg(feature = "gpu")]
use super::selection::Bits;
use super::selection::Test;
use super::{Hit, box_slack};
use crate::frozen::Frozen;
use crate::math::{Bounds, Ray};

/// Where a run of particles is cut in two.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Cut {
    /// Half of the particles go to each side, but for whole treelets: all treelets are full but the last.
    #[default]
    Median,
    /// Through the middle of the space that the centers take: treelets are of any size, boxes fit better where particles cluster.
    Middle,
}

/// How to build and walk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// Particles in a treelet, at most; from 16 to 4096 is sensible.
    pub size: u32,
    /// Where runs are cut until they are treelets.
    pub cut: Cut,
    /// The k-d trees.
    pub heap: pkd::Options,
}

impl Default for Options {
    fn default() -> Self {
        Self { size: 64, cut: Cut::default(), heap: pkd::Options::default() }
    }
}

/// A node or a treelet, by its place among its like.
#[derive(Clone, Copy)]
enum Child {
    Node(u32),
    Treelet(u32),
}

/// What the eight boxes of a node hold.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Children {
    places: [u32; WIDTH],
    /// A bit for every child that is a treelet.
    treelets: u8,
    /// A bit for every child that there is.
    existing: u8,
    unused: [u8; 2],
}

impl Children {
    #[inline(always)]
    fn child(&self, child: usize) -> Child {
        let place = self.places[child];
        if self.treelets >> child & 1 == 1 { Child::Treelet(place) } else { Child::Node(place) }
    }
}

/// See the module.
#[derive(Clone)]
pub struct Treelets {
    columns: Columns,
    /// One a treelet, in the order of their particles.
    heaps: Frozen<Heap>,
    /// The root first; none without particles.
    nodes: Frozen<Node>,
    /// Of every node.
    children: Frozen<Children>,
    bounds: Bounds,
    /// By how much boxes are grown against the rounding of coordinates.
    slack: f32,
    options: Options,
}

impl Treelets {
    /// See [`super::Structure::intersect`].
    pub fn intersect(&self, ray: &Ray, except: Option<u32>) -> Option<Hit> {
        self.search(Search::nearest(ray, except))
    }

    /// See [`super::Structure::occluded`].
    pub fn occluded(&self, ray: &Ray, except: Option<u32>) -> bool {
        self.search(Search::any(ray, except)).is_some()
    }

    /// Ends a search that has begun.
    pub(super) fn search<O: Observer>(&self, mut search: Search<O>) -> Option<Hit> {
        dispatch!(Level::new(), simd => walk(simd, self, &mut search));
        search.found(self.ids())
    }

    /// The same particles with radii `scale` times those that were built; boxes are found anew.
    pub(super) fn scaled(mut self, scale: f32) -> Self {
        self.columns.scale_radii(scale);
        if !self.nodes.is_empty() {
            let mut nodes = self.nodes.to_vec();
            self.bounds = self.fit(&mut nodes, 0);
            self.nodes = nodes.into();
        }
        self.slack = box_slack(&self.bounds);
        self
    }

    /// Finds the boxes of the children of a node anew; its own box.
    fn fit(&self, nodes: &mut [Node], node: usize) -> Bounds {
        let children = self.children[node];
        let count = children.existing.count_ones() as usize;
        let boxes: Vec<Bounds> = (0..count)
            .map(|child| match children.child(child) {
                Child::Node(place) => self.fit(nodes, place as usize),
                Child::Treelet(place) => {
                    let (heap, count) = self.heap(place as usize);
                    let nodes = heap.first..heap.first + count as u32;
                    let spheres = nodes.map(|node| self.sphere(node));
                    let boxes =
                        spheres.map(|(center, radius)| Bounds { min: center, max: center }.grown(radius));
                    boxes.fold(Bounds::EMPTY, Bounds::union)
                }
            })
            .collect();
        nodes[node] = Node::encode(&boxes);
        boxes.into_iter().fold(Bounds::EMPTY, Bounds::union)
    }

    /// See [`super::Structure::show`].
    pub(super) fn show(&mut self, tests: &[Test]) -> u64 {
        self.columns.show(tests, &self.heaps)
    }

    /// See [`super::Structure::thinned`].
    pub(super) fn thin(&mut self, keeps: impl Fn(u32) -> bool + Sync) {
        self.columns.thin(keeps, &self.heaps);
    }

    /// See [`super::Structure::shows`].
    pub(super) fn shows(&self, node: u32) -> bool {
        self.columns.shows(node as usize)
    }

    /// What is shown, where that is not all.
    #[cfg(feature = "gpu")]
    pub(super) fn shown_bits(&self) -> Option<Bits<'_>> {
        self.columns.shown_bits()
    }

    /// See [`super::Structure::sphere`].
    #[inline(always)]
    pub fn sphere(&self, node: u32) -> (Vec3, f32) {
        self.columns.sphere(node)
    }

    /// The ids, by node.
    pub fn ids(&self) -> &[u32] {
        self.columns.ids()
    }

    /// The box of all particles, radii included.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Memory that it takes in bytes, without the ids.
    pub fn bytes(&self) -> u64 {
        let nodes = size_of_val(&self.nodes[..]) + size_of_val(&self.children[..]);
        self.columns.bytes() + (nodes + size_of_val(&self.heaps[..])) as u64
    }

    /// A copy for a device.
    #[cfg(feature = "gpu")]
    pub(crate) fn arrays(&self) -> heap::Arrays<'_> {
        let place = |child| match child {
            Child::Node(place) => place,
            Child::Treelet(place) => place | HIGHEST_BIT,
        };
        let record = |(node, children): (&Node, &Children)| NodeRecord {
            boxes: bytemuck::cast(*node),
            places: std::array::from_fn(|child| place(children.child(child))),
            count: children.existing.count_ones(),
            unused: [0; 3],
        };
        let nodes: Vec<NodeRecord> = self.nodes.iter().zip(&self.children).map(record).collect();
        // A node stands before its children.
        let mut depths = vec![1; nodes.len()];
        for (place, node) in nodes.iter().enumerate() {
            for &child in node.places[..node.count as usize].iter().filter(|&&child| child < HIGHEST_BIT) {
                depths[child as usize] = depths[place] + 1;
            }
        }
        let nodes = NodeArrays { nodes, levels: depths.into_iter().max().unwrap_or(1) };
        heap::Arrays { nodes: Some(nodes), ..self.columns.arrays(&self.heaps, self.slack) }
    }

    /// A treelet, and how many particles it has.
    #[inline(always)]
    fn heap(&self, treelet: usize) -> (&Heap, usize) {
        (&self.heaps[treelet], heap::count(&self.heaps, treelet, self.ids().len()))
    }
}

/// Tells a treelet's place from a node's where both are numbers.
#[cfg(feature = "gpu")]
const HIGHEST_BIT: u32 = 1 << 31;

/// More entries than the deepest tree can leave on the stack: see [`build`].
const STACK: usize = 192;

#[simd]
fn walk<S: Simd, O: Observer>(simd: S, treelets: &Treelets, search: &mut Search<O>) {
    if treelets.nodes.is_empty() {
        return;
    }
    let t_from = search.t_from;
    let slabs = Slabs::new(simd, (treelets.bounds, treelets.slack), search.ray(), search.inv_direction);
    let mut regions = Stack::default();
    let mut stack = [(0.0_f32, Child::Node(0)); STACK];
    let mut top = 1;
    while top > 0 {
        top -= 1;
        let (near, child) = stack[top];
        if near > search.t_far {
            continue;
        }
        let place = match child {
            Child::Node(place) => place as usize,
            Child::Treelet(place) => {
                let heap = treelets.heap(place as usize);
                let (columns, slack, order) =
                    (&treelets.columns, treelets.slack, treelets.options.heap.order);
                if heap::walk(simd, columns, heap, slack, order, search, &mut regions) {
                    return;
                }
                continue;
            }
        };
        // Meet the eight boxes at once.
        search.visit(1, 0);
        let (enter, leave) = slabs.cross(simd, &treelets.nodes[place]);
        let enter = enter.max(f32x8::splat(simd, t_from));
        let leave = leave.min(f32x8::splat(simd, search.t_far));
        let children = &treelets.children[place];
        let mut kept = enter.simd_le(leave).to_bitmask() as u32 & u32::from(children.existing);
        let enter = enter.to_array();
        let first = top;
        while kept != 0 {
            let child = kept.trailing_zeros() as usize;
            kept &= kept - 1;
            // Insertion sort: far before near, so that the nearest is popped first.
            let mut slot = top;
            while slot > first && stack[slot - 1].0 < enter[child] {
                stack[slot] = stack[slot - 1];
                slot -= 1;
            }
            stack[slot] = (enter[child], children.child(child));
            top += 1;
        }
    }
}
