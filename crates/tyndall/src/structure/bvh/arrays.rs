//! The hierarchy's memory as it is, for a device that holds a copy and walks it there.
//!
//! Layouts: [`Node`], the blocks of each [`Packing`], and the radii of `sizes`; all are written once, by the builder.

use super::{Bvh, LEVELS, Packing, sizes::Sizes};

/// What a copy has to hold.
pub(crate) struct Arrays<'a> {
    /// All nodes, level by level from those over the leaves to the root.
    pub(crate) nodes: &'a [u8],
    /// By level where it begins among the nodes, and how many it has; level 0 are the leaves.
    pub(crate) levels: [[u32; 2]; LEVELS],
    /// The root's level; 0 without particles.
    pub(crate) top: u32,
    /// The centers, leaf by leaf.
    pub(crate) blocks: &'a [u8],
    pub(crate) packing: Packing,
    /// Radii as they were built; `radius_scale` times that is what is seen.
    pub(crate) sizes: SizeArrays<'a>,
    pub(crate) radius_scale: f32,
    /// By node the ids.
    pub(crate) ids: &'a [u32],
    /// By how much boxes are grown against the rounding of decoded coordinates.
    pub(crate) slack: f32,
}

/// The radii, leaf by leaf.
pub(crate) enum SizeArrays<'a> {
    /// All alike.
    Uniform(f32),
    /// Sixteen bytes a leaf: places in a table.
    Table { radii: &'a [f32; 256], codes: &'a [u8] },
    /// Sixteen floats a leaf.
    Each(&'a [u8]),
    /// Two floats and sixteen bytes a leaf: see `sizes::LogRadii`.
    Log(&'a [u8]),
}

impl Bvh {
    /// Its memory as it is.
    pub(crate) fn arrays(&self) -> Arrays<'_> {
        Arrays {
            nodes: bytemuck::cast_slice(&self.nodes),
            levels: std::array::from_fn(|level| [self.first[level], self.count[level]]),
            top: self.top.into(),
            blocks: self.blocks.as_bytes(),
            packing: self.blocks.packing(),
            sizes: match &self.sizes {
                Sizes::Uniform(radius) => SizeArrays::Uniform(*radius),
                Sizes::Table { radii, codes } => SizeArrays::Table { radii, codes: codes.as_flattened() },
                Sizes::Each(radii) => SizeArrays::Each(bytemuck::cast_slice(radii)),
                Sizes::Log(radii) => SizeArrays::Log(bytemuck::cast_slice(radii)),
            },
            radius_scale: self.radius_scale,
            ids: &self.ids,
            slack: self.slack,
        }
    }
}
