//! Arrows of a vector attribute: one from the center of each particle, as long as its vector times a scale.

use rayon::prelude::*;

use super::quantity::vector_by_id;
use super::spacing::median_spacing;
use super::statistics::{grouped, quantiles, sampled_ids, short};
use crate::error::Result;
use crate::particles::Particles;
use crate::structure::Spheres;
use crate::structure::shapes::Arrow;

/// Which arrows are wanted.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// The vector attribute: one of two or three numbers, or the stem of scalars like `vx vy vz`.
    pub name: String,
    /// Length of an arrow over that of its vector, above 0; none makes most arrows as long as particles can tell apart.
    pub scale: Option<f32>,
    /// The radius of a shaft, above 0; none is a share of the usual length.
    pub radius: Option<f32>,
}

/// Arrows to be drawn.
#[derive(Clone, Debug)]
pub struct Arrows {
    /// Where they are; vectors that are zero or not finite have none.
    pub arrows: Vec<Arrow>,
    /// The radius of their shafts.
    pub radius: f32,
    /// How they were found, in one line.
    pub description: String,
}

/// Vectors and radii that are looked at for the usual ones.
const SAMPLES: usize = 10_000;
/// The share of vectors that are not longer than what decides the scale: a few fast particles shall not make all others dots.
const MOST: f64 = 0.95;
/// The length of such an arrow over the distance of neighbors, and over a particle's radius, from within which it has to reach out.
const LENGTHS: [f64; 2] = [1.5, 3.0];
/// The radius of a shaft over that length.
const THICKNESS: f64 = 0.04;

/// The usual radius of particles.
pub fn usual_radius(spheres: Spheres) -> f64 {
    let mut radii: Vec<f64> =
        sampled_ids(spheres.len(), SAMPLES).map(|id| f64::from(spheres.radius(id))).collect();
    quantiles(&mut radii, [0.5]).map_or(0.0, |[usual]| usual)
}

/// Finds arrows; `particle_radius` is the usual radius of particles as they are shown, 0 if they are not.
///
/// Fails with [`Error::Setting`](crate::Error::Setting) if there is no such vector.
pub fn find(particles: &Particles, options: &Options, particle_radius: f64) -> Result<Arrows> {
    let Options { name, scale, radius } = options;
    let vector = vector_by_id(particles, "--arrows", name)?;
    let lengths = sampled_ids(particles.len(), SAMPLES).map(|id| vector(id).length());
    let mut lengths: Vec<f64> = lengths.filter(|it| it.is_finite() && *it > 0.0).collect();
    let usual = quantiles(&mut lengths, [MOST]).map_or(1.0, |[usual]| usual);
    let scale = scale.map_or_else(
        || {
            let [by_spacing, by_radius] = LENGTHS;
            let spacing = median_spacing(particles.positions()).unwrap_or(1.0);
            (by_spacing * spacing).max(by_radius * particle_radius) / usual
        },
        f64::from,
    );
    let radius = radius.unwrap_or((THICKNESS * scale * usual) as f32);
    let arrow = |id: usize| {
        let vector = (scale * vector(id)).as_vec3();
        let from = particles.positions().offset(id);
        (vector.is_finite() && vector.length() > 0.0).then_some(Arrow { from, vector, particle: id as u32 })
    };
    let arrows: Vec<Arrow> = (0..particles.len()).into_par_iter().filter_map(arrow).collect();
    let description = match arrows.len() {
        0 => format!("no arrows: {name} is 0 everywhere"),
        count => {
            let arrows = if count == 1 { "arrow" } else { "arrows" };
            let [scale, radius] = [scale, radius.into()].map(short);
            format!("{} {arrows} of {name}, {scale} times as long, radius {radius}", grouped(count))
        }
    };
    Ok(Arrows { arrows, radius, description })
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::particles::{Attribute, Columns, Positions, Values};

    fn particles() -> Particles {
        let mut positions = Positions::around(DVec3::splat(100.0));
        positions.extend(
            &(0..40).map(|id| DVec3::splat(100.0) + DVec3::X * 2.0 * f64::from(id)).collect::<Vec<_>>(),
        );
        let column = |name: &str, number: fn(usize) -> f32| {
            Attribute::new(name, 1, Values::F32((0..40).map(number).collect()))
        };
        let mut force = vec![0.0; 120];
        (force[0], force[4], force[6]) = (3.0, 4.0, f32::NAN);
        let attributes = vec![
            column("vx", |id| if id == 7 { 0.0 } else { 10.0 }),
            column("vy", |id| if id == 3 { 1e4 } else { 0.0 }),
            column("q", |_| 1.0),
            Attribute::new("force", 3, Values::F32(force)),
        ];
        Particles::new(Columns { positions, attributes, ..Columns::default() }).unwrap()
    }

    fn options(name: &str) -> Options {
        Options { name: name.into(), scale: None, radius: None }
    }

    #[test]
    fn arrows_are_as_long_as_neighbors_are_far() {
        let found = find(&particles(), &options("v"), 0.0).unwrap();
        assert_eq!(found.description, "39 arrows of v, 0.3 times as long, radius 0.12");
        let arrow = found.arrows[2];
        assert_eq!((arrow.particle, arrow.from), (2, particles().positions().offset(2)));
        assert!(
            arrow.vector.abs_diff_eq(glam::Vec3::X * 3.0, 1e-5),
            "1.5 times the distance: {}",
            arrow.vector
        );
        assert!(found.arrows[3].vector.length() > 2000.0, "a fast one does not make the others dots");
        assert!(found.arrows.iter().all(|arrow| arrow.particle != 7), "no vector, no arrow");
        let found = find(&particles(), &options("v"), 5.0).unwrap();
        assert!((found.arrows[2].vector.length() - 15.0).abs() < 1e-4, "out of large particles");
        let given = Options { scale: Some(2.0), radius: Some(0.5), ..options("force") };
        let found = find(&particles(), &given, 1.0).unwrap();
        assert_eq!(found.description, "2 arrows of force, 2 times as long, radius 0.5");
        assert_eq!(
            found.arrows.iter().map(|it| it.vector.to_array()).collect::<Vec<_>>(),
            [[6.0, 0.0, 0.0], [0.0, 8.0, 0.0]]
        );
    }

    #[test]
    fn what_is_no_vector_is_refused() {
        let said = |name| find(&particles(), &options(name), 0.0).unwrap_err().to_string();
        assert!(
            said("forces").contains("the file has: v, force; did you mean 'force'?"),
            "{}",
            said("forces")
        );
        assert!(said("q").contains("--arrows cannot be 'q' — a vector attribute"), "{}", said("q"));
    }
}
