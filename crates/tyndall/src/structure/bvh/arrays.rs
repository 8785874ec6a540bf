//! The hierarchy's memory as it is, for a device that holds a copy and walks it there, or that has built it.
//!
//! Layouts: [`Node`], the blocks of each [`Packing`], and the radii of `sizes`; all are written once, by the builder.

use super::block::Blocks;
use super::build::Levels;
use super::sizes::{Law, Sizes, padded};
use super::{Bvh, LEAF, LEVELS, Node, Packing};
use crate::error::Result;
use crate::math::Bounds;
use crate::pages;

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

#[cfg(test)]
impl SizeArrays<'_> {
    /// Whether radii are powers of two that are not whole.
    pub(crate) fn is_log(&self) -> bool {
        matches!(self, Self::Log(_))
    }
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

/// What a hierarchy will be like, before anything of it is written: for a device that builds it.
pub(crate) struct Outline {
    pub(crate) particles: usize,
    levels: Levels,
    pub(crate) packing: Packing,
    law: Law,
}

/// The arrays of a hierarchy, in this order wherever they stand in a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Array {
    Nodes,
    Blocks,
    Sizes,
    Ids,
}

impl Outline {
    /// Over so many particles with one radius.
    pub(crate) fn uniform(particles: usize, radius: f32, packing: Packing) -> Self {
        Self { particles, levels: Levels::over(particles), packing, law: Law::Uniform(radius) }
    }

    /// Over particles with these radii.
    pub(crate) fn of(radii: &[f32], packing: Packing) -> Self {
        let law = Law::of(radii, packing);
        Self { particles: radii.len(), levels: Levels::over(radii.len()), packing, law }
    }

    /// By level where it begins among the nodes, and how many it has; level 0 are the leaves.
    pub(crate) fn levels(&self) -> [[u32; 2]; LEVELS] {
        std::array::from_fn(|level| [self.levels.first[level], self.levels.count[level]])
    }

    /// The root's level; 0 without particles.
    pub(crate) fn top(&self) -> u32 {
        self.levels.top.into()
    }

    /// How many leaves there are.
    pub(crate) fn leaves(&self) -> usize {
        self.particles.div_ceil(LEAF)
    }

    /// How radii are held.
    pub(crate) fn law(&self) -> &Law {
        &self.law
    }

    /// The table of radii, where there is one, filled up with zeros.
    pub(crate) fn table(&self) -> Box<[f32; 256]> {
        match &self.law {
            Law::Table(table) => padded(table),
            _ => padded(&[]),
        }
    }

    fn nodes(&self) -> usize {
        self.levels.count[1..].iter().map(|&count| count as usize).sum()
    }

    /// Bytes of each [`Array`].
    pub(crate) fn bytes(&self) -> [u64; 4] {
        let block = match self.packing {
            Packing::Exact => 12 * LEAF,
            Packing::Bits16 => 16 + 6 * LEAF,
            Packing::Bits11 => 16 + 4 * LEAF,
            Packing::Bits8 => 16 + 3 * LEAF,
        };
        let sizes = match self.law {
            Law::Uniform(_) => 0,
            Law::Table(_) => LEAF,
            Law::Each => 4 * LEAF,
            Law::Log => 8 + LEAF,
        };
        let leaves = self.leaves();
        [size_of::<Node>() * self.nodes(), block * leaves, sizes * leaves, 4 * self.particles]
            .map(|bytes| bytes as u64)
    }

    /// The hierarchy, of whose arrays `read` fills the bytes; `bounds` is the root's box.
    pub(crate) fn read(
        &self,
        bounds: Bounds,
        mut read: impl FnMut(Array, &mut [u8]) -> Result<()>,
    ) -> Result<Bvh> {
        let nodes = pages::written(self.nodes(), |bytes| read(Array::Nodes, bytes))?;
        let blocks = Blocks::read(self.packing, self.leaves(), |bytes| read(Array::Blocks, bytes))?;
        let sizes = Sizes::read(&self.law, self.leaves(), |bytes| read(Array::Sizes, bytes))?;
        let ids = pages::written(self.particles, |bytes| read(Array::Ids, bytes))?;
        Ok(Bvh::of(self.levels, nodes, blocks, sizes, ids, bounds))
    }
}
