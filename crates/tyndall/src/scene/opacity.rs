//! Particles that are seen through. How pictures are made of them, `render::drawn` tells.

use rayon::prelude::*;

use super::Scene;
use super::meaning::Meaning;
use crate::error::{Error, Result};
use crate::particles::Particles;
use crate::structure::by_node;

/// The opacity of every particle that `text` gives: a number for all, or an attribute or expression, as colors are written. Where that is missing,
/// particles are opaque.
///
/// Fails as [`super::quantity::Quantity::find`] does, and with [`Error::Setting`] if the text stands for words.
pub fn opacities(particles: &Particles, text: &str) -> Result<Vec<f32>> {
    if let Ok(all) = text.trim().parse() {
        return Ok(vec![all; particles.len()]);
    }
    let quantity = Meaning::number(particles, "--opacity", text)?;
    let ids = (0..particles.len()).into_par_iter().with_min_len(1 << 14);
    let opacity = |id| Some(quantity.value(id)).filter(|it| !it.is_nan()).unwrap_or(1.0);
    Ok(ids.map(|id| opacity(id) as f32).collect())
}

impl Scene {
    /// From now on particles have these opacities, 0 to 1, by id; none makes all opaque. Bonds have the lesser one of their particles.
    ///
    /// Fails with [`Error::Setting`] if one is not in that range.
    pub fn set_opacity(&mut self, opacity: Option<&[f32]>) -> Result<()> {
        if let Some(wrong) = opacity.iter().copied().flatten().find(|it| !(0.0..=1.0).contains(*it)) {
            return Err(Error::setting("--opacity", wrong, "numbers from 0 (not seen) to 1 (opaque)"));
        }
        let seen_through = opacity.filter(|opacity| opacity.iter().any(|&it| it < 1.0));
        self.opacity = seen_through.map(|opacity| by_node(opacity, self.structure.ids(), 1.0).into());
        Ok(())
    }

    /// Whether any particle is seen through.
    pub fn is_translucent(&self) -> bool {
        self.opacity.is_some()
    }

    /// The same scene of opaque particles alone: those for which `is_there` says so, who is told id and opacity. What joins particles is there if that is said of
    /// its first particle with the lesser opacity of both. Memory is shared.
    pub(crate) fn opaque(&self, is_there: impl Fn(u32, f32) -> bool + Sync) -> Self {
        let ids = self.structure.ids();
        let opacity = |node: u32| self.opacity.as_ref().map_or(1.0, |opacity| opacity[node as usize]);
        let keeps = |node: u32, opacity: f32| is_there(ids[node as usize], opacity);
        let shapes = self.shapes.as_ref();
        let keeps_shape = |[first, second]: [u32; 2]| keeps(first, opacity(first).min(opacity(second)));
        let structure = self.structure.thinned(|node| keeps(node, opacity(node)));
        self.with(structure, shapes.map(|it| it.thinned(keeps_shape)), None)
    }
}
