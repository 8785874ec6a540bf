//! How particles are spread where no grid is made of them: their weights, lengths and volumes.
//!
//! Lengths are those of the scatter: an attribute of that name, read as the radius of the kernel's support, or else, also where that has no
//! number, the distance of the N*-th neighbor.

use std::f64::consts::PI;

use rayon::prelude::*;

use super::{Cells, DENSITY_NAMES, Settings, Smoothing, inputs, neighbors};
use crate::error::{Error, Result};
use crate::particles::{Attribute, Particles};
use crate::progress::Progress;

/// How particles are spread, in their order.
#[derive(Clone, Debug)]
pub struct Spread<'a> {
    particles: &'a Particles,
    weight: Option<&'a Attribute>,
    /// Radii of the kernels' supports, at least 0.
    pub lengths: Vec<f32>,
    /// N*, within those lengths.
    neighbors: u32,
    /// Whether the lengths are those of an attribute.
    are_given: bool,
    /// What was chosen and guessed, a line each.
    pub notes: Vec<String>,
}

/// How `particles` are spread: by the weight, the N* and the attribute of lengths of `settings`. Fails as
/// [`estimate`](super::estimate) does.
pub fn spread<'a>(
    particles: &'a Particles,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Spread<'a>> {
    let settings = Settings { smoothing: Smoothing::Scatter, ..settings.clone() };
    inputs::check(particles.len() as u64, &settings)?;
    let mut notes = Vec::new();
    let weight = inputs::weight_attribute(particles, &settings.weight, &mut notes)?;
    let attribute = inputs::any_length_attribute(particles, &settings)?;
    let target = settings.neighbors;
    let given = |id: usize| attribute.map_or(f64::NAN, |it| it.number(id, 0)) as f32;
    let mut lengths: Vec<f32> = (0..particles.len()).into_par_iter().map(given).collect();
    if let Some(attribute) = attribute {
        notes.push(format!("lengths: '{}', read as the kernel's radius", attribute.name));
    }
    let is_missing = |length: &f32| !(0.0..f32::INFINITY).contains(length);
    let missing = lengths.par_iter().filter(|length| is_missing(length)).count();
    if missing > 0 {
        let of = if attribute.is_some() { format!(" of the {missing} without one") } else { String::new() };
        notes.push(format!("lengths{of}: as far as the {target}-th neighbor is, itself counted"));
        let found = nearest(particles, target, progress);
        let pairs = lengths.par_iter_mut().zip(found).filter(|(length, _)| is_missing(length));
        pairs.for_each(|(length, found)| *length = found);
    }
    if progress.cancelled() {
        return Err(Error::Interrupted);
    }
    Ok(Spread { particles, weight, lengths, neighbors: target, are_given: attribute.is_some(), notes })
}

/// The distance of each particle's N*-th neighbor, itself counted.
fn nearest(particles: &Particles, target: u32, progress: &dyn Progress) -> Vec<f32> {
    progress.begin("sort", None, "particles");
    let cells = Cells::new(particles.positions());
    let found = neighbors::lengths(&cells, target, 1);
    let mut lengths = vec![0.0; particles.len()];
    for (ids, found) in cells.ids().iter().zip(&found) {
        for (&id, &length) in ids.iter().zip(found).filter(|(id, _)| **id != u32::MAX) {
            lengths[id as usize] = length;
        }
    }
    lengths
}

impl Spread<'_> {
    /// What a particle weighs.
    #[inline]
    pub fn weight(&self, id: usize) -> f64 {
        self.weight.map_or(1.0, |it| it.number(id, 0))
    }

    /// What weighs the particles, for people.
    pub fn weight_name(&self) -> &str {
        self.weight.map_or("number", |it| &it.name)
    }

    /// The volume that each particle stands for, and how it was found: its mass over its density where it has both, else the
    /// volume of a ball around it over the number of particles in the ball.
    pub fn volumes(&self, progress: &dyn Progress) -> (Vec<f64>, String) {
        let known = DENSITY_NAMES.iter().filter_map(|&name| self.particles.attribute(name));
        let density = known.into_iter().find(|it| it.components == 1);
        if let (Some(density), Some(weight)) = (density, self.weight) {
            let volume = |id: usize| weight.number(id, 0) / density.number(id, 0);
            let volumes: Vec<f64> = (0..self.particles.len()).into_par_iter().map(volume).collect();
            if volumes.par_iter().all(|it| it.is_finite()) {
                return (volumes, format!("volumes: {} over {}", weight.name, density.name));
            }
        }
        let target = self.neighbors;
        let held = f64::from(target).min(self.particles.len() as f64);
        let volume = |length: &f32| 4.0 / 3.0 * PI * f64::from(*length).powi(3) / held;
        let volumes = match self.are_given {
            true => nearest(self.particles, target, progress).iter().map(volume).collect(),
            false => self.lengths.iter().map(volume).collect(),
        };
        (volumes, format!("volumes: a ball's of {target} particles, over {target}"))
    }
}

#[cfg(test)]
mod tests {
    use super::super::Weight;
    use super::*;
    use crate::particles::{Columns, Positions, Values};

    fn particles(attributes: Vec<Attribute>) -> Particles {
        let x: Vec<f32> = (0..40).map(|k| (k * 17 % 40) as f32).collect();
        let positions = Positions::from_offsets(glam::DVec3::ZERO, [x, vec![0.0; 40], vec![0.0; 40]]);
        Particles::new(Columns { positions, attributes, ..Columns::default() }).unwrap()
    }

    #[test]
    fn lengths_are_those_of_neighbors_in_the_order_of_the_particles() {
        let particles = particles(Vec::new());
        let settings = Settings { neighbors: 3, ..Settings::default() };
        let spread = spread(&particles, &settings, &()).unwrap();
        for id in 0..40 {
            let x = particles.positions().offset(id).x;
            let wanted = if x == 0.0 || x == 39.0 { 2.0 } else { 1.0 };
            assert!((spread.lengths[id] - wanted).abs() < 1e-5, "{id}: {}", spread.lengths[id]);
        }
        let (volumes, how) = spread.volumes(&());
        assert!(how.contains("ball") && volumes.iter().all(|it| *it > 1.3 && *it < 12.0), "{how}");
        assert_eq!((spread.weight(3), spread.weight_name()), (1.0, "number"));
    }

    #[test]
    fn what_has_no_length_reaches_its_neighbors() {
        let mut own = vec![7.5_f32; 40];
        (own[3], own[9]) = (f32::NAN, -1.0);
        let particles = particles(vec![Attribute::new("hsml", 1, Values::F32(own))]);
        let settings = Settings { neighbors: 3, ..Settings::default() };
        let spread = spread(&particles, &settings, &()).unwrap();
        assert_eq!((spread.lengths[0], spread.lengths[3] < 2.5, spread.lengths[9] > 0.0), (7.5, true, true));
        assert!(spread.notes.iter().any(|note| note.contains("of the 2 without one")), "{:?}", spread.notes);
    }

    #[test]
    fn mass_by_any_name_weighs_and_over_density_is_a_volume() {
        let column = |name: &str, value: f32| Attribute::new(name, 1, Values::F32(vec![value; 40]));
        let attributes =
            vec![column("Masses", 6.0), column("Densities", 2.0), column("SmoothingLength", 5.0)];
        let particles = particles(attributes);
        let settings = Settings { weight: Weight::Attribute("mass".into()), ..Settings::default() };
        let spread = spread(&particles, &settings, &()).unwrap();
        assert_eq!((spread.weight(7), spread.weight_name(), spread.lengths[7]), (6.0, "Masses", 5.0));
        assert_eq!(spread.volumes(&()).0, vec![3.0; 40]);
        let unknown = Settings { weight: Weight::Attribute("densites".into()), ..Settings::default() };
        let message = super::spread(&particles, &unknown, &()).unwrap_err().to_string();
        assert!(message.contains("did you mean 'Densities'?"), "{message}");
    }
}
