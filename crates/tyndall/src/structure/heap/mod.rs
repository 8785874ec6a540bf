//! Left-balanced heaps: k-d trees over runs of particles that have no nodes beside them.
//!
//! In a heap of `count` particles, node `n` has children `2n + 1` and `2n + 2` where these are below `count`. Invariant: along a node's
//! axis no center in its left subtree lies above its own, none in its right subtree below. The axis follows from the box that the cuts
//! above leave to the node (its widest extent), or from the node's depth (round robin). Coordinates keep all their bits: axes are kept
//! beside them, but of no node in the lowest four levels, which are tried at once: less than a byte for eight particles. `build` sorts particles so, `walk` goes through them with single rays. One heap over all particles is the P-k-d tree
//! of Wald, Knoll, Johnson, Usher, Pascucci, Papka 2015, CPU Ray Tracing Large Particle Data with Balanced P-k-d Trees; many small
//! ones are the treelets of Gralka, Wald, Geringer, Reina, Ertl 2020, Spatial Partitioning Strategies for Memory-Efficient Ray
//! Tracing of Particles.

#[cfg(feature = "gpu")]
mod arrays;
mod build;
mod saved;
mod shown;
mod walk;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use rayon::prelude::*;

use super::build::Record;
use crate::frozen::Frozen;
use crate::math::Bounds;
use crate::pages;
#[cfg(feature = "gpu")]
pub(crate) use arrays::{Arrays, NodeArrays, NodeRecord};
pub(super) use build::{place_in_order, reorder, sort};
use shown::Shown;
pub(super) use walk::{Stack, walk};

/// Which dimension a node splits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Axis {
    /// The widest extent of the box that is left to the node; of equal ones the first.
    #[default]
    WidestExtent,
    /// x, y, z in turn by depth.
    RoundRobin,
}

/// When a node's own particle is tested.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Order {
    /// Before both children.
    #[default]
    NodeFirst,
    /// After the near child and before the far one: strictly front to back along the axis.
    NearChildFirst,
}

/// How to build and walk.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// Which dimension a node splits.
    pub axis: Axis,
    /// When a node's own particle is tested.
    pub order: Order,
}

impl Options {
    /// The axis that a node of this box and depth splits.
    #[inline(always)]
    fn axis(&self, centers: &Bounds, depth: u32) -> usize {
        match self.axis {
            Axis::RoundRobin => depth as usize % 3,
            Axis::WidestExtent => {
                let extent = centers.max - centers.min;
                if extent.x >= extent.y && extent.x >= extent.z {
                    0
                } else if extent.y >= extent.z {
                    1
                } else {
                    2
                }
            }
        }
    }
}

/// A run of particles that is one heap.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Heap {
    /// The box of its centers.
    pub(super) centers: Bounds,
    /// The largest radius in it.
    pub(super) radius: f32,
    /// Where it begins.
    pub(super) first: u32,
}

impl Heap {
    /// Over `records`, the first of which comes to place `first`; `uniform` is the radius of all that have none of their own.
    pub(super) fn over<const N: usize>(records: &[Record<N>], uniform: f32, first: u32) -> Self {
        let of = |records: &[Record<N>]| {
            let centers = records.iter().fold(Bounds::EMPTY, |bounds, record| bounds.with(record.center()));
            (centers, records.iter().map(|record| record.radius(uniform)).fold(0.0, f32::max))
        };
        let both = |a: (Bounds, f32), b: (Bounds, f32)| (a.0.union(b.0), a.1.max(b.1));
        let (centers, radius) = records.par_chunks(1 << 16).map(of).reduce(|| (Bounds::EMPTY, 0.0), both);
        Self { centers, radius, first }
    }
}

/// The particles of all heaps, column by column.
#[derive(Clone)]
pub(super) struct Columns {
    /// A few more than there are particles, NaN, so that lanes may be loaded behind the last one.
    center: [Frozen<f32>; 3],
    /// One a node, and a few more, where radii differ.
    radii: Frozen<f32>,
    /// The radius of all where they do not.
    uniform: f32,
    /// By what radii are scaled since they were built, here and in the heaps.
    radius_scale: f32,
    /// Which particles are shown, where that is not all.
    shown: Option<Shown>,
    /// Of every node the id.
    ids: Frozen<u32>,
    /// The axes of each heap's nodes above the lowest levels, from the eighth part of its first place on.
    axes: Frozen<u8>,
}

/// Levels at the bottom of a heap that are tried at once.
const LOWEST: u32 = 4;

/// How far lanes may reach behind the last particle.
const PADDING: usize = 8;

impl Columns {
    /// Takes for each node the record at `place(node)`; `uniform` is the radius of all where the records have none. `heaps` are all, in
    /// order.
    pub(super) fn gather<const N: usize>(
        records: &[Record<N>],
        uniform: f32,
        place: impl Fn(usize) -> usize + Sync,
        heaps: &[Heap],
        options: Options,
    ) -> Self {
        let nodes = || (0..records.len()).into_par_iter().with_min_len(1 << 12);
        let column = |coordinate: usize| {
            let mut column = pages::with_capacity(records.len() + PADDING);
            column.par_extend(nodes().map(|node| records[place(node)].coordinates[coordinate]));
            column.extend([f32::NAN; PADDING]);
            Frozen::from(column)
        };
        let center = [column(0), column(1), column(2)];
        let mut axes = vec![0; records.len() / 8];
        for (place, heap) in heaps.iter().enumerate() {
            let axes = &mut axes[heap.first as usize / 8..];
            let depth = upper_levels(count(heaps, place, records.len()));
            note_axes(axes, &center, heap, (0, heap.centers), (0, depth), options);
        }
        let ids: Vec<u32> = nodes().map(|node| records[place(node)].id).collect();
        Self {
            center,
            radii: if N > 3 { column(N - 1) } else { Frozen::default() },
            uniform,
            radius_scale: 1.0,
            shown: None,
            ids: ids.into(),
            axes: axes.into(),
        }
    }

    /// Center and radius of the particle at `node`.
    #[inline(always)]
    pub(super) fn sphere(&self, node: u32) -> (Vec3, f32) {
        let node = node as usize;
        let center = Vec3::new(self.center[0][node], self.center[1][node], self.center[2][node]);
        let radius = if self.radii.is_empty() { self.uniform } else { self.radii[node] };
        (center, self.radius_scale * radius)
    }

    /// Scales radii, by a factor on those that were built.
    pub(super) fn scale_radii(&mut self, scale: f32) {
        self.radius_scale = scale;
    }

    /// By what radii are scaled.
    pub(super) fn radius_scale(&self) -> f32 {
        self.radius_scale
    }

    /// The ids, by node.
    pub(super) fn ids(&self) -> &[u32] {
        &self.ids
    }

    /// Memory that centers, radii and axes take, in bytes.
    pub(super) fn bytes(&self) -> u64 {
        let columns: usize = self.center.iter().map(|column| size_of_val(&column[..])).sum();
        (columns + size_of_val(&self.radii[..]) + size_of_val(&self.axes[..])) as u64
    }
}

/// How many particles a heap has; the last one ends at `end`.
#[inline(always)]
pub(super) fn count(heaps: &[Heap], heap: usize, end: usize) -> usize {
    heaps.get(heap + 1).map_or(end, |next| next.first as usize) - heaps[heap].first as usize
}

/// The levels of a heap of `count` particles above those that are tried at once.
#[inline(always)]
fn upper_levels(count: usize) -> u32 {
    count.checked_ilog2().map_or(0, |last| (last + 1).saturating_sub(LOWEST))
}

/// Notes the axes of the subtree at `node`, to whose centers the cuts above leave a box, down to `depth.1`.
fn note_axes(
    axes: &mut [u8],
    center: &[Frozen<f32>; 3],
    heap: &Heap,
    (node, centers): (usize, Bounds),
    (depth, end): (u32, u32),
    options: Options,
) {
    if depth == end {
        return;
    }
    let axis = options.axis(&centers, depth);
    axes[node] = axis as u8;
    let split = center[axis][heap.first as usize + node];
    let (mut left, mut right) = (centers, centers);
    left.max[axis] = split;
    right.min[axis] = split;
    note_axes(axes, center, heap, (2 * node + 1, left), (depth + 1, end), options);
    note_axes(axes, center, heap, (2 * node + 2, right), (depth + 1, end), options);
}
