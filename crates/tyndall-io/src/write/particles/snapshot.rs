//! A frame as its writers see it: positions, and the attributes that were asked for.

use std::collections::HashSet;

use rayon::prelude::*;
use tyndall::particles::{Attribute, Radii, View};
use tyndall::srgb::linear_from_encoded;
use tyndall::{DVec3, Error, Particles, Result};

/// See the module.
pub(super) struct Snapshot<'a> {
    pub(super) particles: &'a Particles,
    pub(super) attributes: Vec<&'a Attribute>,
}

/// Names of three attributes, or of one with three components, that are the particles' color.
const COLORS: [[&str; 3]; 2] = [["red", "green", "blue"], ["r", "g", "b"]];
const COLOR_VECTORS: [&str; 4] = ["Cd", "color", "colour", "rgb"];

impl<'a> Snapshot<'a> {
    /// All attributes, or those that are named. Fails with [`Error::Setting`] if there is none of a name.
    pub(super) fn new(particles: &'a Particles, fields: Option<&[String]>) -> Result<Self> {
        let attributes = match fields {
            None => particles.attributes().iter().collect(),
            Some(names) => names
                .iter()
                .map(|name| {
                    particles.attribute(name).ok_or_else(|| {
                        let known: Vec<&str> =
                            particles.attributes().iter().map(|it| it.name.as_str()).collect();
                        Error::setting("--fields", name, format!("the file has: {}", known.join(" ")))
                    })
                })
                .collect::<Result<_>>()?,
        };
        Ok(Self { particles, attributes })
    }

    /// How many particles.
    pub(super) fn len(&self) -> usize {
        self.particles.len()
    }

    /// Where particle `id` is, in the coordinates of the file.
    pub(super) fn position(&self, id: usize) -> DVec3 {
        self.particles.positions().world(id)
    }

    /// The attribute of one of these names that is written, the first name first.
    pub(super) fn named(&self, names: &[&str]) -> Option<&'a Attribute> {
        let of = |name: &&str| self.attributes.iter().find(|it| it.name.eq_ignore_ascii_case(name)).copied();
        names.iter().find_map(of)
    }

    /// Whether 32-bit floats hold the positions as well as they are known: exactly, or because zero is not far beside their spread.
    pub(super) fn fits_f32(&self) -> bool {
        let (origin, bounds) = (self.particles.positions().origin(), self.particles.bounds());
        let [low, high] = [bounds.min, bounds.max].map(|corner| corner.as_dvec3());
        let spread = low.abs().max(high.abs()).max_element();
        let farthest = (origin + low).abs().max((origin + high).abs()).max_element();
        let is_exact = |id: usize| self.position(id).as_vec3().as_dvec3() == self.position(id);
        farthest <= 8.0 * spread || (0..self.len()).into_par_iter().all(is_exact)
    }

    /// The radius of particle `id`, if the particles have one.
    pub(super) fn radius(&self, id: usize) -> Option<f32> {
        self.particles.radii().map(|radii| self.particles.radius(radii, id))
    }

    /// The radius that all share, if they do.
    pub(super) fn uniform_radius(&self) -> Option<f32> {
        match self.particles.radii() {
            Some(Radii::Uniform(radius)) => Some(*radius),
            _ => None,
        }
    }

    /// Whether an attribute is where the radii come from.
    pub(super) fn is_radius(&self, attribute: &Attribute) -> bool {
        let Some(Radii::PerParticle { attribute: place, .. }) = self.particles.radii() else { return false };
        std::ptr::eq(&self.particles.attributes()[*place], attribute)
    }

    /// The color of each particle, 0 to 1, sRGB or whatever the file has; none if it has none.
    pub(super) fn colors(&self) -> Option<impl Fn(usize) -> [f32; 3] + Sync + use<'a>> {
        let (channels, full) = self.channels()?;
        Some(move |id: usize| channels.map(|channel| value(channel, full, id)))
    }

    /// The same in linear light: numbers that are not whole are that already.
    pub(super) fn linear_colors(&self) -> Option<impl Fn(usize) -> [f32; 3] + Sync + use<'a>> {
        let (channels, full) = self.channels()?;
        let linear = move |channel: Channel, id| match channel.0.values.is_discrete() {
            true => linear_from_encoded(value(channel, full, id)),
            false => value(channel, full, id),
        };
        Some(move |id: usize| channels.map(|channel| linear(channel, id)))
    }

    /// Where red, green and blue are, and the whole number that means all light: of 8 bits, or of 16 where there are larger ones.
    fn channels(&self) -> Option<([Channel<'a>; 3], f32)> {
        let find = |name: &str, components: usize| {
            self.attributes
                .iter()
                .copied()
                .find(|it| it.components == components && it.name.eq_ignore_ascii_case(name))
                .filter(|it| !matches!(it.values.view(), View::Text { .. }))
        };
        let three = COLORS.iter().find_map(|names| {
            let [Some(red), Some(green), Some(blue)] = names.map(|name| find(name, 1)) else { return None };
            Some([(red, 0), (green, 0), (blue, 0)])
        });
        let one = || {
            let vector = COLOR_VECTORS.iter().find_map(|name| find(name, 3))?;
            Some([(vector, 0), (vector, 1), (vector, 2)])
        };
        let channels = three.or_else(one)?;
        let is_wide = |id| channels.iter().any(|it| it.0.number(id, it.1) > 255.0);
        let full = if (0..self.len()).into_par_iter().any(is_wide) { 65535.0 } else { 255.0 };
        Some((channels, full))
    }
}

/// A component of an attribute.
type Channel<'a> = (&'a Attribute, usize);

fn value((attribute, component): Channel, full: f32, id: usize) -> f32 {
    let value = attribute.number(id, component) as f32;
    if attribute.values.is_discrete() { value / full } else { value }
}

/// Names of columns that are all different.
pub(super) struct Names(HashSet<String>);

impl Names {
    /// Beside those that the format has itself.
    pub(super) fn beside(own: &[&str]) -> Self {
        Self(own.iter().map(|it| it.to_string()).collect())
    }

    /// The name, with a number if it is taken.
    pub(super) fn distinct(&mut self, name: String) -> String {
        let mut other = name.clone();
        let mut number = 2;
        while !self.0.insert(other.clone()) {
            other = format!("{name}_{number}");
            number += 1;
        }
        other
    }
}

/// Names of the components of an attribute, each a column of its own: `velocity` becomes `vx vy vz`.
pub(super) fn component_names(attribute: &Attribute) -> Vec<String> {
    const SHORT: [(&str, &str); 6] =
        [("velocity", "v"), ("vel", "v"), ("v", "v"), ("force", "f"), ("forces", "f"), ("normal", "n")];
    let name = &attribute.name;
    let short = SHORT.iter().find(|(long, _)| name.eq_ignore_ascii_case(long));
    match (attribute.components, short) {
        (1, _) => vec![name.clone()],
        (3, Some((_, short))) => ["x", "y", "z"].map(|axis| format!("{short}{axis}")).to_vec(),
        (2 | 3, _) => {
            ["x", "y", "z"][..attribute.components].iter().map(|axis| format!("{name}_{axis}")).collect()
        }
        (count, _) => (0..count).map(|component| format!("{name}_{component}")).collect(),
    }
}
