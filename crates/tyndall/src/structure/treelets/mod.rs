//! Treelets: a shallow hierarchy of wide nodes over small k-d trees in place.
//!
//! The particles are cut into runs of at most `Options::size`; each run is a left-balanced heap (see `structure/heap/`) with a box and a
//! largest radius of its own. Above them stand the eight-wide nodes of [`super::bvh`], here with a pointer to each child, because
//! cuts through the middle of space leave runs of any length. Invariant: a decoded box holds every sphere below it. Radius counts as
//! a coordinate when runs are cut, so that a large particle inflates few treelets. `build` cuts and sorts. Source: Gralka, Wald,
//! Geringer, Reina, Ertl 2020, Spatial Partitioning Strategies for Memory-Efficient Ray Tracing of Particles.

mod build;

use fearless_simd::{Level, dispatch, f32x8, prelude::*};
use fearless_simd_macros::simd;
use glam::Vec3;

use super::Hit;
use super::bvh::{Node, WIDTH};
use super::heap::{self, Columns, Heap, Stack};
use super::pkd;
use super::search::{Observer, Search};
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
#[derive(Clone, Copy)]
struct Children {
    places: [u32; WIDTH],
    /// A bit for every child that is a treelet.
    treelets: u8,
    /// A bit for every child that there is.
    existing: u8,
}

impl Children {
    #[inline(always)]
    fn child(&self, child: usize) -> Child {
        let place = self.places[child];
        if self.treelets >> child & 1 == 1 { Child::Treelet(place) } else { Child::Node(place) }
    }
}

/// See the module.
pub struct Treelets {
    columns: Columns,
    /// One a treelet, in the order of their particles.
    heaps: Vec<Heap>,
    /// The root first; none without particles.
    nodes: Vec<Node>,
    /// Of every node.
    children: Vec<Children>,
    bounds: Bounds,
    /// By how much boxes are grown against the rounding of coordinates.
    slack: f32,
    order: pkd::Order,
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
        search.found()
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

    /// A treelet, and how many particles it has.
    #[inline(always)]
    fn heap(&self, treelet: usize) -> (&Heap, usize) {
        let end = self.heaps.get(treelet + 1).map_or(self.ids().len(), |next| next.first as usize);
        (&self.heaps[treelet], end - self.heaps[treelet].first as usize)
    }
}

/// More entries than the deepest tree can leave on the stack: see [`build`].
const STACK: usize = 192;

#[simd]
fn walk<S: Simd, O: Observer>(simd: S, treelets: &Treelets, search: &mut Search<O>) {
    if treelets.nodes.is_empty() {
        return;
    }
    let ray = *search.ray();
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
                let (columns, slack, order) = (&treelets.columns, treelets.slack, treelets.order);
                if heap::walk(simd, columns, heap, slack, order, search, &mut regions) {
                    return;
                }
                continue;
            }
        };
        // Meet the eight boxes at once.
        search.visit(1, 0);
        let (enter, leave) = treelets.nodes[place].cross(simd, &ray, search.inv_direction, treelets.slack);
        let enter = enter.max(f32x8::splat(simd, ray.t_min));
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
