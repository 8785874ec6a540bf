//! The columns of heaps taken apart and put together; see [`crate::structure::saved`].

use super::{Columns, PADDING};
use crate::frozen::Frozen;
use crate::structure::saved::{Arrays, Broken, Named, RadiiOf};

impl Columns {
    /// The arrays, and how radii are held; none where these were scaled since they were built.
    pub(in crate::structure) fn saved(&self) -> Option<(RadiiOf, Vec<Named<'_>>)> {
        let [x, y, z] = self.center.each_ref().map(|column| bytemuck::cast_slice(column));
        let mut arrays: Vec<Named> = vec![("x", x), ("y", y), ("z", z)];
        let radii = match self.radii.is_empty() {
            true => RadiiOf::One(self.uniform),
            false => {
                arrays.push(("radii", bytemuck::cast_slice(&self.radii)));
                RadiiOf::Each
            }
        };
        arrays.extend([("axes", &self.axes[..]), ("ids", bytemuck::cast_slice(&self.ids))]);
        (self.radius_scale == 1.0).then_some((radii, arrays))
    }

    /// The columns of `count` particles.
    pub(in crate::structure) fn restore(
        count: usize,
        radii: &RadiiOf,
        arrays: &mut Arrays,
    ) -> Result<Self, Broken> {
        let padded = count + PADDING;
        let center = [arrays.of("x", padded)?, arrays.of("y", padded)?, arrays.of("z", padded)?];
        let (uniform, radii) = match radii {
            RadiiOf::One(radius) => (*radius, Frozen::default()),
            RadiiOf::Each => (0.0, arrays.of("radii", padded)?),
            _ => return Err(("radii", "only bvh has a table of radii, or packs them".into())),
        };
        let (axes, ids) = (arrays.of("axes", count / 8)?, arrays.of("ids", count)?);
        Ok(Self { center, radii, uniform, radius_scale: 1.0, shown: None, ids, axes })
    }
}
