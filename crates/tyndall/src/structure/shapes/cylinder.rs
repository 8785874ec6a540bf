//! Cylinders with flat ends.

use glam::Vec3;

use super::Ball;
use super::number::{Entry, Line, Number, Vector};

/// A cylinder by its middle, the unit vector along it, half its length, and its radius.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cylinder {
    pub(crate) middle: Vec3,
    pub(crate) axis: Vec3,
    pub(crate) half_length: f32,
    pub(crate) radius: f32,
}

/// Rays that go straighter along an axis, or straighter across it, count as if they went so.
pub(super) const LEAST_SPEED: f32 = 1e-12;

impl Cylinder {
    /// Between two points; none if they are one.
    pub(super) fn between([from, to]: [Vec3; 2], radius: f32) -> Option<Self> {
        let along = to - from;
        let axis = along.try_normalize()?;
        Some(Self { middle: 0.5 * from + 0.5 * to, axis, half_length: 0.5 * along.length(), radius })
    }

    /// The ball around it.
    pub(super) fn ball(&self) -> Ball {
        let reach = (self.half_length * self.half_length + self.radius * self.radius).sqrt();
        Ball { center: self.middle, radius: 1.000_001 * reach }
    }

    /// Where rays enter it. As with spheres, differences of vectors near the cylinder in place of squared lengths, which would cancel far away.
    #[inline(always)]
    pub(super) fn enter<R: Number>(&self, line: &Line<R>) -> Entry<R> {
        let one = line.direction.x.like(1.0);
        let (zero, least) = (one.like(0.0), one.like(LEAST_SPEED));
        let axis = Vector::of(one, self.axis);
        let to_middle = Vector::of(one, self.middle) - line.origin;
        let closest = to_middle.dot(line.direction);
        // From the middle to the point of the ray that is nearest to it: the origin of what follows.
        let start = line.direction * closest - to_middle;
        let start_along = start.dot(axis);
        let speed_along = line.direction.dot(axis);
        let start_across = start - axis * start_along;
        let speed_across = line.direction - axis * speed_along;
        // The stretch within the endless cylinder.
        let speed_sq = speed_across.dot(speed_across).greater(least);
        let nearest = -start_across.dot(speed_across) / speed_sq;
        let off = start_across + speed_across * nearest;
        let half_chord_sq = (one.like(self.radius * self.radius) - off.dot(off)) / speed_sq;
        let half_chord = half_chord_sq.greater(zero).root();
        // The stretch between the ends.
        let is_across = speed_along.magnitude().less(least);
        let inverse = one / R::select(is_across, least, speed_along);
        let half_length = one.like(self.half_length);
        let low = (-half_length - start_along) * inverse;
        let high = (half_length - start_along) * inverse;
        let enter = (nearest - half_chord).greater(low.lesser(high));
        let leave = (nearest + half_chord).lesser(low.greater(high));
        Entry {
            t: closest + enter,
            is_second: zero.less(start_along + enter * speed_along),
            meets: zero.less(half_chord_sq) & enter.less(leave),
        }
    }

    /// Place and normal of the surface near a point.
    pub(super) fn surface(&self, point: Vec3, direction: Vec3) -> (Vec3, Vec3) {
        let center = self.center_of(point);
        let normal = (point - center).normalize_or(-direction);
        (center + self.radius * normal, normal)
    }

    /// The point on the axis from which a point of the surface lies away at a right angle, as far as the radius; of a point on an end, one
    /// behind it.
    fn center_of(&self, point: Vec3) -> Vec3 {
        let off = point - self.middle;
        let along = off.dot(self.axis);
        let across = off - along * self.axis;
        let is_end = self.half_length - along.abs() < self.radius - across.length();
        if is_end {
            return point - along.signum() * self.radius * self.axis;
        }
        self.middle + along.clamp(-self.half_length, self.half_length) * self.axis
    }
}

#[cfg(test)]
impl Cylinder {
    /// By how much in f64 a point lies within it: negative outside.
    pub(super) fn depth(&self, point: glam::DVec3) -> f64 {
        let off = point - self.middle.as_dvec3();
        let axis = self.axis.as_dvec3();
        let along = off.dot(axis);
        let across = (off - along * axis).length();
        (f64::from(self.half_length) - along.abs()).min(f64::from(self.radius) - across)
    }
}
