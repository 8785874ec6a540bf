//! Heaps as a device that walks them there wants them: what a ray's thread reads together lies together.

use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;

use super::{Columns, Heap, upper_levels};

/// What a device holds of heaps.
pub(crate) struct Arrays<'a> {
    pub(in crate::structure) columns: &'a Columns,
    /// One a heap, and one more that tells where the last one ends.
    pub(crate) heaps: Vec<HeapRecord>,
    /// By what radii are scaled, here and of the spheres.
    pub(crate) radius_scale: f32,
    /// See [`Columns`].
    pub(crate) axes: &'a [u8],
    /// By node the ids.
    pub(crate) ids: &'a [u32],
    /// Levels of the highest heap above those that are tried at once.
    pub(crate) upper_levels: u32,
    /// By how much boxes are grown against the rounding of coordinates.
    pub(crate) slack: f32,
    /// What stands above the heaps, if there are many.
    pub(crate) nodes: Option<NodeArrays>,
}

/// Wide nodes over heaps.
pub(crate) struct NodeArrays {
    /// The root first. Of each the node, the places of its children (a heap's with the highest bit set), and their number.
    pub(crate) nodes: Vec<NodeRecord>,
    /// How deep they lie at most.
    pub(crate) levels: u32,
}

/// See [`NodeArrays`]: 112 bytes.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct NodeRecord {
    pub(crate) boxes: [u32; 16],
    pub(crate) places: [u32; 8],
    pub(crate) count: u32,
    pub(crate) unused: [u32; 3],
}

/// A heap: the box of its centers, its largest radius, and where it begins.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct HeapRecord {
    low: [f32; 3],
    radius: f32,
    high: [f32; 3],
    first: u32,
}

impl Arrays<'_> {
    /// By node center and radius as it was built: sixteen bytes, where the columns here need twelve if all radii are one.
    pub(crate) fn spheres(&self) -> Vec<[f32; 4]> {
        let Columns { center: [x, y, z], radii, uniform, .. } = self.columns;
        let sphere = |node: usize| [x[node], y[node], z[node], radii.get(node).copied().unwrap_or(*uniform)];
        (0..self.ids.len()).into_par_iter().with_min_len(1 << 14).map(sphere).collect()
    }
}

impl Columns {
    /// A copy for a device; `heaps` are all of them.
    pub(in crate::structure) fn arrays(&self, heaps: &[Heap], slack: f32) -> Arrays<'_> {
        let record = |heap: &Heap| HeapRecord {
            low: heap.centers.min.to_array(),
            radius: heap.radius,
            high: heap.centers.max.to_array(),
            first: heap.first,
        };
        let end = HeapRecord { first: self.ids.len() as u32, ..HeapRecord::zeroed() };
        let heaps: Vec<HeapRecord> = heaps.iter().map(record).chain([end]).collect();
        let counts = heaps.windows(2).map(|pair| (pair[1].first - pair[0].first) as usize);
        Arrays {
            columns: self,
            radius_scale: self.radius_scale,
            upper_levels: counts.max().map_or(0, upper_levels),
            heaps,
            axes: &self.axes,
            ids: &self.ids,
            slack,
            nodes: None,
        }
    }
}
