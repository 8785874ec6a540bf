//! Superquadrics: (|x|^n2 + |y|^n2)^(n1/n2) + |z|^n1 < 1 behind a linear map, convex for exponents from 1.
//!
//! The left side to the power of 1/n1 is a norm, so that it is a convex function along a ray: Newton's steps from where the ray enters the box around
//! never pass the surface, and a ray along which it grows again has missed. Source: A. Barr, "Superquadrics and angle-preserving transformations",
//! IEEE CG&A 1981; the exponents as LIGGGHTS has them.

use glam::{DVec3, Vec3};

use super::Ball;
use super::ellipsoid::{Ellipsoid, Stretched};
use super::number::Line;

/// A superquadric by the ellipsoid of its half axes, and its exponents n1 and n2.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Superquadric {
    ellipsoid: Stretched,
    exponents: [f32; 2],
    /// See [`Ellipsoid::reach`].
    reach: f32,
}

/// Steps after which a ray that has come no nearer grazes.
const MOST_STEPS: u32 = 100;
/// So near in the norm a point is on the surface.
const NEAR: f64 = 1e-9;

impl Superquadric {
    pub(super) fn new(center: Vec3, ellipsoid: &Ellipsoid) -> Self {
        Self {
            ellipsoid: Stretched::new(center, ellipsoid),
            exponents: ellipsoid.exponents.map(|it| it as f32),
            reach: ellipsoid.reach() as f32,
        }
    }

    /// The ball around it.
    pub(super) fn ball(&self) -> Ball {
        Ball { center: self.ellipsoid.center, radius: 1.000_01 * self.reach }
    }

    /// The shortest of its half axes.
    pub(super) fn shortest(&self) -> f32 {
        self.ellipsoid.shortest()
    }

    fn rows(&self) -> [DVec3; 3] {
        self.ellipsoid.rows.map(|row| row.as_dvec3())
    }

    /// The norm of a point of the space in which the half axes are 1, and its gradient.
    fn norm(&self, point: DVec3) -> (f64, DVec3) {
        let [n1, n2] = self.exponents.map(f64::from);
        let [x, y, z] = point.abs().to_array();
        let around = x.powf(n2) + y.powf(n2);
        let sum = around.powf(n1 / n2) + z.powf(n1);
        if sum <= 0.0 {
            return (0.0, DVec3::ZERO);
        }
        let norm = sum.powf(1.0 / n1);
        let outer = norm / sum;
        let inner = if around > 0.0 { around.powf(n1 / n2 - 1.0) } else { 0.0 };
        let across = |at: f64| if at > 0.0 { inner * at.powf(n2 - 1.0) } else { 0.0 };
        let along = if z > 0.0 { z.powf(n1 - 1.0) } else { 0.0 };
        (norm, outer * DVec3::new(across(x), across(y), along) * point.signum())
    }

    /// Where a ray enters it, if its line meets it.
    pub(super) fn enter(&self, line: &Line<f32>) -> Option<f32> {
        let vector = |it: super::number::Vector<f32>| Vec3::new(it.x, it.y, it.z).as_dvec3();
        let (direction, off) =
            (vector(line.direction), vector(line.origin) - self.ellipsoid.center.as_dvec3());
        let map = |it: DVec3| DVec3::from(self.rows().map(|row| row.dot(it)));
        let (origin, speed) = (map(off), map(direction));
        // The stretch within the box.
        let inverse = DVec3::from(speed.to_array().map(|it| 1.0 / if it.abs() < 1e-30 { 1e-30 } else { it }));
        let (low, high) = ((-DVec3::ONE - origin) * inverse, (DVec3::ONE - origin) * inverse);
        let (mut t, leave) = (low.min(high).max_element(), low.max(high).min_element());
        for _ in 0..MOST_STEPS {
            let (norm, gradient) = self.norm(origin + t * speed);
            let slope = gradient.dot(speed);
            if norm - 1.0 < NEAR {
                return (slope < 0.0).then_some(t as f32);
            }
            if slope >= 0.0 || t > leave {
                return None;
            }
            t -= (norm - 1.0) / slope;
        }
        None
    }

    /// Place and normal of the surface near a point.
    pub(super) fn surface(&self, point: Vec3, direction: Vec3) -> (Vec3, Vec3) {
        let off = (point - self.ellipsoid.center).as_dvec3();
        let (norm, gradient) = self.norm(DVec3::from(self.rows().map(|row| row.dot(off))));
        let [x, y, z] = self.rows();
        let normal = (gradient.x * x + gradient.y * y + gradient.z * z).as_vec3();
        let position = self.ellipsoid.center + (off / norm.max(f64::MIN_POSITIVE)).as_vec3();
        (position, normal.normalize_or(-direction))
    }
}

#[cfg(test)]
impl Superquadric {
    /// By how much in f64 a point lies within it, at most: negative outside.
    pub(super) fn depth(&self, point: DVec3) -> f64 {
        let off = point - self.ellipsoid.center.as_dvec3();
        let [n1, n2] = self.exponents.map(f64::from);
        let [x, y, z] = self.rows().map(|row| row.dot(off).abs());
        let sum = (x.powf(n2) + y.powf(n2)).powf(n1 / n2) + z.powf(n1);
        let steepest = self.rows().map(DVec3::length).into_iter().fold(0.0, f64::max);
        (1.0 - sum.powf(1.0 / n1)) / (3_f64.sqrt() * steepest)
    }
}
