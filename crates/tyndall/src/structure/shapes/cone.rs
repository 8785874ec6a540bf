//! Cones with a flat base, the tips of arrows.

use glam::Vec3;

use super::Ball;
use super::cylinder::LEAST_SPEED;
use super::number::{Entry, Line, Number, Vector};

/// A cone by its tip, the unit vector from the base to it, its height, and the radius of its base.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cone {
    pub(crate) tip: Vec3,
    pub(crate) axis: Vec3,
    pub(crate) height: f32,
    pub(crate) radius: f32,
}

impl Cone {
    fn slope(&self) -> f32 {
        self.radius / self.height
    }

    /// The least ball around it.
    pub(super) fn ball(&self) -> Ball {
        let Self { height, radius, .. } = *self;
        // As far from the tip as from the rim of the base; of a flat cone the middle of the base.
        let below = (0.5 * (height + radius * self.slope())).min(height);
        let reach = if radius < height { below } else { radius };
        Ball { center: self.tip - below * self.axis, radius: 1.000_01 * reach }
    }

    /// Where rays enter it: the stretches within the endless double cone, cut by the planes through tip and base. A ray that goes steeper along
    /// than the sides is within from its second crossing on, or up to its first.
    #[inline(always)]
    pub(super) fn enter<R: Number>(&self, line: &Line<R>) -> Entry<R> {
        let one = line.direction.x.like(1.0);
        let (zero, least, far) = (one.like(0.0), one.like(LEAST_SPEED), one.like(f32::MAX));
        let axis = Vector::of(one, self.axis);
        let to_tip = Vector::of(one, self.tip) - line.origin;
        let closest = to_tip.dot(line.direction);
        // From the tip to the point of the ray that is nearest to it: the origin of what follows.
        let start = line.direction * closest - to_tip;
        let start_down = -start.dot(axis);
        let speed_down = -line.direction.dot(axis);
        let start_across = start + axis * start_down;
        let speed_across = line.direction + axis * speed_down;
        // Within is where square s^2 + 2 half s + rest < 0.
        let slope_sq = one.like(self.slope() * self.slope());
        let square = speed_across.dot(speed_across) - slope_sq * (speed_down * speed_down);
        let square = R::select(square.magnitude().less(least), least, square);
        let half = start_across.dot(speed_across) - slope_sq * (start_down * speed_down);
        let rest = start_across.dot(start_across) - slope_sq * (start_down * start_down);
        let root_sq = half * half - square * rest;
        let root = root_sq.greater(zero).root();
        // The crossings, without a difference of what is nearly equal.
        let sum = -(half + R::select(half.less(zero), -root, root));
        let (low, high) = ((sum / square).lesser(rest / sum), (sum / square).greater(rest / sum));
        let is_steep = square.less(zero);
        let goes_down = zero.less(speed_down);
        let within_from = R::select(is_steep, R::select(goes_down, high, -far), low);
        let within_to = R::select(is_steep, R::select(goes_down, far, low), high);
        // The stretch between tip and base.
        let inverse = one / R::select(speed_down.magnitude().less(least), least, speed_down);
        let at_tip = -start_down * inverse;
        let at_base = (one.like(self.height) - start_down) * inverse;
        let enter = within_from.greater(at_tip.lesser(at_base));
        let leave = within_to.lesser(at_tip.greater(at_base));
        let never = zero.less(zero);
        Entry { t: closest + enter, is_second: never, meets: zero.less(root_sq) & enter.less(leave) }
    }

    /// Place and normal of the surface near a point.
    pub(super) fn surface(&self, point: Vec3, direction: Vec3) -> (Vec3, Vec3) {
        let Self { tip, axis, height, .. } = *self;
        let off = point - tip;
        let down = -off.dot(axis);
        let across = off + down * axis;
        let normal = (across.normalize_or(-direction) + self.slope() * axis).normalize_or(-direction);
        let inside_side = -off.dot(normal);
        if height - down < inside_side {
            return (point - (height - down) * axis, -axis);
        }
        (point + inside_side * normal, normal)
    }
}

#[cfg(test)]
impl Cone {
    /// By how much in f64 a point lies within it: negative outside.
    pub(super) fn depth(&self, point: glam::DVec3) -> f64 {
        let axis = self.axis.as_dvec3();
        let (height, radius) = (f64::from(self.height), f64::from(self.radius));
        let off = point - self.tip.as_dvec3();
        let down = -off.dot(axis);
        let across = (off + down * axis).length();
        let side = (radius * down - height * across) / height.hypot(radius);
        side.min(height - down)
    }
}
