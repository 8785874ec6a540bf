//! The outline of what a picture shall show: few points whose hull is nearly that of all particles.
//!
//! A camera that frames these frames the particles, where the corners of their box would leave a round cloud off the middle.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3, Vec3};
use rayon::prelude::*;

use super::automatic::Framing;
use super::camera::corners;
use super::statistics::sampled_ids;
use crate::math::Bounds;
use crate::structure::Spheres;
use crate::structure::replicas::Replicas;

/// At most so many particles are looked at; the few that stick out further are within the picture's margin.
const SAMPLES: usize = 300_000;
/// Directions along an edge of the cube on whose surface they lie.
const EDGE: i32 = 5;
/// Positions in a turn that are kept in view.
const TURNS: usize = 24;

/// Points to keep in view, in the coordinates of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Outline {
    /// The middle of their box.
    pub center: DVec3,
    /// The points; at least one.
    pub points: Vec<DVec3>,
}

impl Outline {
    /// The corners of a box measured from `origin`; of the unit box where it is empty.
    pub fn of_box(bounds: &Bounds, origin: DVec3) -> Self {
        // Nothing to show has a camera too, so that it can be said why there is nothing.
        let bounds = if bounds.is_empty() { Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE } } else { *bounds };
        Self { center: origin + bounds.center().as_dvec3(), points: corners(&bounds, origin).to_vec() }
    }

    /// Of the particles within a frame; of the frame itself where it is the cell.
    pub fn of(spheres: Spheres, framing: &Framing) -> Self {
        let origin = spheres.particles.positions().origin();
        let whole = Self::of_box(&framing.bounds, origin);
        let Bounds { min, max } = framing.bounds;
        if framing.of_cell {
            return whole;
        }
        // In each direction the particle that reaches farthest; of equal ones the first.
        let directions = directions();
        let none = || vec![(f32::NEG_INFINITY, Vec3::ZERO); directions.len()];
        let farther = |a: (f32, Vec3), b: (f32, Vec3)| if b.0 > a.0 { b } else { a };
        let ids = sampled_ids(spheres.len(), SAMPLES).filter(|&id| {
            let center = spheres.center(id);
            center.cmpge(min).all() && center.cmple(max).all()
        });
        let add = |mut best: Vec<(f32, Vec3)>, id: usize| {
            let (center, radius) = (spheres.center(id), spheres.radius(id));
            for (slot, direction) in best.iter_mut().zip(&directions) {
                *slot = farther(*slot, (center.dot(*direction) + radius, center + radius * *direction));
            }
            best
        };
        let join = |a: Vec<_>, b: Vec<_>| a.into_iter().zip(b).map(|(a, b)| farther(a, b)).collect();
        let best = ids.fold(none, add).reduce(none, join);
        let reached = best.into_iter().filter(|(reach, _)| reach.is_finite());
        let points: Vec<DVec3> = reached.map(|(_, point)| origin + point.as_dvec3()).collect();
        if points.is_empty() { whole } else { Self { points, ..whole } }
    }

    /// Of all that these are outlines of, at least one.
    pub fn joined(outlines: &[Self]) -> Self {
        let points: Vec<DVec3> = outlines.iter().flat_map(|it| it.points.iter().copied()).collect();
        let corner =
            |pick: fn(DVec3, DVec3) -> DVec3| points.iter().copied().reduce(pick).unwrap_or_default();
        match outlines {
            [only] => only.clone(),
            _ => Self { center: 0.5 * (corner(DVec3::min) + corner(DVec3::max)), points },
        }
    }

    /// As much larger as a radius makes it whose centers it is the outline of.
    pub fn grown(&self, radius: f64) -> Self {
        let grown = |point: &DVec3| *point + radius * (*point - self.center).normalize_or_zero();
        Self { center: self.center, points: self.points.iter().map(grown).collect() }
    }

    /// Of periodic images of what it is the outline of.
    pub fn replicated(&self, replicas: &Replicas) -> Self {
        let corners = replicas.corners();
        let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
        let points = corners.iter().flat_map(|shift| self.points.iter().map(move |point| *point + *shift));
        Self { center: self.center + middle, points: points.collect() }
    }

    /// With all places where the points come when turned around the axis through the center.
    pub fn turned_all_around(&self, axis: DVec3) -> Self {
        let axis = axis.normalize_or(DVec3::Z);
        let turns = (0..TURNS).map(|turn| DQuat::from_axis_angle(axis, TAU * turn as f64 / TURNS as f64));
        let turned =
            turns.flat_map(|turn| self.points.iter().map(move |it| self.center + turn * (*it - self.center)));
        Self { center: self.center, points: turned.collect() }
    }
}

/// Unit vectors all around, those of the axes and the diagonals among them.
fn directions() -> Vec<Vec3> {
    let last = EDGE - 1;
    let steps = |place: i32| (2 * place - last) as f32 / last as f32;
    let mut directions = Vec::new();
    for x in 0..EDGE {
        for y in 0..EDGE {
            for z in 0..EDGE {
                if [x, y, z].iter().any(|&place| place == 0 || place == last) {
                    directions.push(Vec3::new(steps(x), steps(y), steps(z)).normalize());
                }
            }
        }
    }
    directions
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::particles::{Columns, Particles, Radii};
    use crate::random::Stream;
    use crate::scene::automatic::{Outliers, framing_of};

    /// Points on a ball of radius 10 around (100, 0, 0).
    fn ball(count: u64) -> Particles {
        let mut columns = Columns::default();
        let mut stream = Stream::new(7, 0);
        let points: Vec<DVec3> =
            (0..count).map(|_| DVec3::X * 100.0 + 10.0 * stream.direction().as_dvec3()).collect();
        columns.positions.extend(&points);
        Particles::new(columns).unwrap()
    }

    #[test]
    fn a_round_cloud_has_a_round_outline() {
        let particles = ball(5000);
        let radii = Radii::Uniform(0.5);
        let spheres = Spheres { particles: &particles, radii: &radii, radius_scale: 1.0 };
        let outline = Outline::of(spheres, &framing_of(spheres, Outliers::Left));
        assert!(outline.center.abs_diff_eq(DVec3::X * 100.0, 0.1), "{}", outline.center);
        for point in outline.points.iter().chain(&outline.turned_all_around(DVec3::Y).points) {
            let reach = point.distance(outline.center);
            assert!((10.0..10.7).contains(&reach), "{reach}");
        }
        assert_eq!(outline.points.len(), 98);
    }

    #[test]
    fn nothing_has_the_outline_of_the_unit_box() {
        let particles = Particles::new(Columns::default()).unwrap();
        let radii = Radii::Uniform(0.5);
        let spheres = Spheres { particles: &particles, radii: &radii, radius_scale: 1.0 };
        let outline = Outline::of(spheres, &framing_of(spheres, Outliers::Left));
        assert_eq!((outline.center, outline.points.len()), (DVec3::ZERO, 8));
    }
}
