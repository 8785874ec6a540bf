//! Sources whose particles carry attributes, and which of these a density is of.

use std::ops::Range;

use glam::Vec3;

use crate::error::Result;
use crate::medium::density::{Settings, Weight, inputs};
use crate::particles::Particles;
use crate::source::Source;

/// A source that knows more of its particles than where they are.
pub trait Carrier: Source {
    /// The particles in `range` whose centers are finite, as [`Source::read`] gives these, and what they carry, with their places in the whole.
    fn part(&self, range: Range<u64>) -> Result<(Vec<Vec3>, Particles)>;
}

/// What is summed on a grid: the weight, and products with it.
pub(super) struct Load<'a> {
    settings: &'a Settings,
    /// Whether each particle weighs 1, and nothing is beside it.
    pub(super) is_bare: bool,
    /// The components of attributes.
    pub(super) fields: Vec<(String, usize)>,
}

impl<'a> Load<'a> {
    /// Of a source: looks at its first particle. Fails if there is no such attribute.
    pub(super) fn of(source: &dyn Carrier, settings: &'a Settings, notes: &mut Vec<String>) -> Result<Self> {
        if settings.weight == Weight::One && settings.fields.is_empty() {
            return Ok(Self { settings, is_bare: true, fields: Vec::new() });
        }
        let (_, first) = source.part(0..source.len().min(1))?;
        let weighs = inputs::weight_attribute(&first, &settings.weight, notes)?.is_some();
        let fields = inputs::fields(&first, &settings.fields)?;
        let fields: Vec<(String, usize)> =
            fields.into_iter().map(|(attribute, component)| (attribute.name.clone(), component)).collect();
        Ok(Self { settings, is_bare: !weighs && fields.is_empty(), fields })
    }

    /// Values that each sample has.
    pub(super) fn columns(&self) -> usize {
        1 + self.fields.len()
    }

    /// The values of some particles, column by column. Fails if one is not allowed.
    pub(super) fn values(&self, particles: &Particles) -> Result<Vec<Vec<f32>>> {
        let weight = inputs::weight_attribute(particles, &self.settings.weight, &mut Vec::new())?;
        let weight_of = |id: usize| weight.map_or(1.0, |it| it.number(id, 0) as f32);
        let ids = 0..particles.len();
        let mut columns = vec![ids.clone().map(weight_of).collect()];
        for (attribute, component) in inputs::fields(particles, &self.settings.fields)? {
            let product = |id: usize| weight_of(id) * attribute.number(id, component) as f32;
            columns.push(ids.clone().map(product).collect());
        }
        Ok(columns)
    }
}
