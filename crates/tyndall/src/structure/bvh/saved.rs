//! The hierarchy taken apart and put together: nodes, blocks, radii and ids; see [`crate::structure::saved`].

use super::block::Blocks;
use super::build::Levels;
use super::sizes::{Sizes, padded};
use super::{Bvh, LEAF, Packing};
use crate::structure::Kind;
use crate::structure::saved::{Arrays, Broken, Facts, Named, RadiiOf};

impl Bvh {
    /// See [`crate::structure::Structure::saved`].
    pub(in crate::structure) fn saved(&self) -> Option<(Facts, Vec<Named<'_>>)> {
        let mut arrays: Vec<Named> =
            vec![("nodes", bytemuck::cast_slice(&self.nodes)), ("blocks", self.blocks.as_bytes())];
        let radii = match &self.sizes {
            Sizes::Uniform(radius) => RadiiOf::One(*radius),
            Sizes::Table { radii, .. } => RadiiOf::Table(radii.to_vec()),
            Sizes::Each(_) => RadiiOf::Each,
            Sizes::Log(_) => RadiiOf::Packed,
        };
        if !matches!(radii, RadiiOf::One(_)) {
            arrays.push(("radii", self.sizes.as_bytes()));
        }
        arrays.push(("ids", bytemuck::cast_slice(&self.ids)));
        let facts = Facts {
            kind: Kind::Bvh(self.blocks.packing()),
            count: self.ids.len(),
            bounds: self.bounds,
            radii,
            largest_radius: 0.0,
            packing_error: self.packing_error,
        };
        (self.radius_scale == 1.0).then_some((facts, arrays))
    }

    /// See [`crate::structure::Structure::restore`].
    pub(in crate::structure) fn restore(
        facts: Facts,
        packing: Packing,
        arrays: &mut Arrays,
    ) -> Result<Self, Broken> {
        let Facts { count: particles, bounds, packing_error, .. } = facts;
        let levels = Levels::over(particles);
        let leaves = particles.div_ceil(LEAF);
        let nodes = arrays.of("nodes", levels.count[1..].iter().map(|&count| count as usize).sum())?;
        let region = arrays.region("blocks")?;
        let bytes = region.bytes().len();
        let blocks = Blocks::of(packing, region).filter(|blocks| blocks.hold(particles));
        let blocks = blocks.ok_or_else(|| {
            ("blocks", format!("{bytes} bytes are not {leaves} leaves of {particles} particles"))
        })?;
        let sizes = match facts.radii {
            RadiiOf::One(radius) => Sizes::Uniform(radius),
            RadiiOf::Table(table) if table.len() > 256 => {
                return Err(("radii", format!("a table of {}, at most 256", table.len())));
            }
            RadiiOf::Table(table) => {
                Sizes::Table { radii: padded(&table), codes: arrays.of("radii", leaves)? }
            }
            RadiiOf::Each => Sizes::Each(arrays.of("radii", leaves)?),
            RadiiOf::Packed => Sizes::Log(arrays.of("radii", leaves)?),
        };
        let ids = arrays.of("ids", particles)?;
        Ok(Self { packing_error, ..Self::of(levels, nodes, blocks, sizes, ids, bounds) })
    }
}
