//! How large the particles are.

use super::Attribute;

/// How large the particles are, in the unit of the positions.
#[derive(Clone, Debug, PartialEq)]
pub enum Radii {
    /// All alike.
    Uniform(f32),
    /// By the value of a discrete attribute (integers from 0, or the codes of words): `radii[value]`; values beyond the table
    /// have its last entry.
    PerType {
        /// Which of the particles' attributes holds the type.
        attribute: usize,
        /// The radius of each type.
        radii: Vec<f32>,
    },
    /// Each its own: `scale` times the attribute (1/2 where the file holds diameters).
    PerParticle {
        /// Which of the particles' attributes holds the size.
        attribute: usize,
        /// Radius over attribute.
        scale: f32,
    },
}

/// Names that attributes holding a radius have in the files of the known programs, best first, and radius over value.
const NAMES: [(&str, f32); 6] =
    [("radius", 1.0), ("R", 1.0), ("pscale", 1.0), ("diameter", 0.5), ("width", 0.5), ("widths", 0.5)];

/// Whether an attribute of this name may be taken for radii.
pub(crate) fn is_radius(name: &str) -> bool {
    NAMES.iter().any(|(known, _)| known.eq_ignore_ascii_case(name))
}

/// The first attribute that is named like a radius.
pub(super) fn radii_by_name(attributes: &[Attribute]) -> Option<Radii> {
    NAMES.iter().find_map(|&(name, scale)| {
        // `r` may be red or a distance: a single letter counts only as it is written here.
        let named =
            |it: &Attribute| it.name == name || (name.len() > 1 && it.name.eq_ignore_ascii_case(name));
        let attribute = attributes.iter().position(|it| it.components == 1 && named(it))?;
        Some(Radii::PerParticle { attribute, scale })
    })
}

/// The radius of particle `id`.
#[inline(always)]
pub(super) fn radius_of(radii: &Radii, attributes: &[Attribute], id: usize) -> f32 {
    match radii {
        Radii::Uniform(radius) => *radius,
        Radii::PerType { attribute, radii } => {
            let kind = attributes[*attribute].number(id, 0).max(0.0) as usize;
            radii[kind.min(radii.len() - 1)]
        }
        Radii::PerParticle { attribute, scale } => scale * attributes[*attribute].number(id, 0) as f32,
    }
}
