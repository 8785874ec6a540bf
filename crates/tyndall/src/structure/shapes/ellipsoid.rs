//! Ellipsoids: unit spheres behind a linear map; and what a particle says of itself that is one, or a superquadric.

use glam::{DQuat, DVec3, Vec3};

use super::Ball;
use super::number::{Entry, Line, Number, Vector};

/// The shape of a particle that is an ellipsoid around its center, or a superquadric.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ellipsoid {
    /// The id of the particle.
    pub particle: u32,
    /// Half axes along x, y and z before it is turned, above 0.
    pub half_axes: DVec3,
    /// How it is turned; of length 1.
    pub turn: DQuat,
    /// Exponents n1 and n2 of (|x|^n2 + |y|^n2)^(n1/n2) + |z|^n1 = 1, from 1 to [`Ellipsoid::MOST_EXPONENT`]: an ellipsoid has 2 and 2, what is nearly a box
    /// large ones, what is nearly a cylinder along z a large n1 and 2.
    pub exponents: [f64; 2],
}

impl Ellipsoid {
    /// Exponents of a true ellipsoid.
    pub const ROUND: [f64; 2] = [2.0; 2];
    /// Edges of larger exponents are sharper than rounding shows.
    pub const MOST_EXPONENT: f64 = 100.0;

    /// No point of it is farther from its center: of what has corners, those of the box around it.
    pub fn reach(&self) -> f64 {
        let has_corners = self.exponents.iter().any(|exponent| *exponent > 2.0);
        if has_corners { self.half_axes.length() } else { self.half_axes.max_element() }
    }
}

/// An ellipsoid by its center, the rows of the map that makes a unit sphere of it, and its longest half axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stretched {
    pub(crate) center: Vec3,
    pub(crate) rows: [Vec3; 3],
    pub(crate) longest: f32,
}

impl Stretched {
    pub(super) fn new(center: Vec3, ellipsoid: &Ellipsoid) -> Self {
        let Ellipsoid { half_axes, turn, .. } = *ellipsoid;
        let row = |axis: DVec3| (turn * axis / half_axes.dot(axis)).as_vec3();
        Self {
            center,
            rows: [DVec3::X, DVec3::Y, DVec3::Z].map(row),
            longest: half_axes.max_element() as f32,
        }
    }

    /// Its shortest half axis.
    pub(super) fn shortest(&self) -> f32 {
        1.0 / self.rows.iter().map(|row| row.length()).fold(0.0, f32::max)
    }

    /// The ball around it.
    pub(super) fn ball(&self) -> Ball {
        Ball { center: self.center, radius: 1.000_01 * self.longest }
    }

    /// Where rays enter it: where they enter the unit sphere, along themselves.
    #[inline(always)]
    pub(super) fn enter<R: Number>(&self, line: &Line<R>) -> Entry<R> {
        let one = line.direction.x.like(1.0);
        let zero = one.like(0.0);
        let to_center = Vector::of(one, self.center) - line.origin;
        let closest = to_center.dot(line.direction);
        // From the center to the point of the ray that is nearest to it: what is mapped is small.
        let start = line.direction * closest - to_center;
        let [x, y, z] = self.rows;
        let (x, y, z) = (Vector::of(one, x), Vector::of(one, y), Vector::of(one, z));
        let from = Vector { x: x.dot(start), y: y.dot(start), z: z.dot(start) };
        let speed = Vector { x: x.dot(line.direction), y: y.dot(line.direction), z: z.dot(line.direction) };
        let speed_sq = speed.dot(speed);
        let nearest = -from.dot(speed) / speed_sq;
        let off = from + speed * nearest;
        let half_chord_sq = (one - off.dot(off)) / speed_sq;
        let half_chord = half_chord_sq.greater(zero).root();
        let never = zero.less(zero);
        Entry { t: closest + (nearest - half_chord), is_second: never, meets: zero.less(half_chord_sq) }
    }

    /// Place and normal of the surface near a point.
    pub(super) fn surface(&self, point: Vec3, direction: Vec3) -> (Vec3, Vec3) {
        let off = point - self.center;
        let mapped = Vec3::from(self.rows.map(|row| row.dot(off)));
        let [x, y, z] = self.rows;
        let normal = (mapped.x * x + mapped.y * y + mapped.z * z).normalize_or(-direction);
        (self.center + off / mapped.length().max(f32::MIN_POSITIVE), normal)
    }
}

#[cfg(test)]
impl Stretched {
    /// By how much in f64 a point lies within it, at most: negative outside.
    pub(super) fn depth(&self, point: DVec3) -> f64 {
        let off = point - self.center.as_dvec3();
        let mapped = DVec3::from(self.rows.map(|row| row.as_dvec3().dot(off)));
        let steepest = self.rows.map(|row| row.as_dvec3().length()).into_iter().fold(0.0, f64::max);
        (1.0 - mapped.length()) / steepest
    }
}
