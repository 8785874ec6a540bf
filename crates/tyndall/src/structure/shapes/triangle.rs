//! Triangles of meshes: flat, without thickness, seen from both sides.

use glam::Vec3;

use super::Ball;
use super::number::{Entry, Line, Number, Vector};

/// A triangle by its corners.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Triangle {
    pub(crate) corners: [Vec3; 3],
}

/// Points on a triangle are lifted to the side from which it is seen by so much of the greatest coordinate, more than rounding moves them: light does
/// not leak or stop at the edge of a neighbor in the same plane.
const LIFT: f32 = 4.0 * f32::EPSILON;

impl Triangle {
    pub(super) fn double_area(&self) -> Vec3 {
        let [a, b, c] = self.corners.map(|corner| corner.as_dvec3());
        (b - a).cross(c - a).as_vec3()
    }

    pub(super) fn area(&self) -> f32 {
        0.5 * self.double_area().length()
    }

    /// Where rays meet it. Corners are projected along the ray, so that a corner that triangles share has one place for all of them, and an
    /// edge, asked from both sides, gives opposite numbers to the bit: no ray passes between two triangles with common corners. Source: S. Woop,
    /// C. Benthin, I. Wald, "Watertight ray/triangle intersection", JCGT 2013.
    #[inline(always)]
    pub(super) fn enter<R: Number>(&self, line: &Line<R>) -> Entry<R> {
        let zero = line.direction.x.like(0.0);
        let [a, b, c] = self.corners;
        let a = Vector::of(zero, a) - line.origin;
        let b = Vector::of(zero, b) - line.origin;
        let c = Vector::of(zero, c) - line.origin;
        let (along_a, along_b, along_c) =
            (a.dot(line.direction), b.dot(line.direction), c.dot(line.direction));
        let a = a - line.direction * along_a;
        let b = b - line.direction * along_b;
        let c = c - line.direction * along_c;
        // Twice the areas between the ray and the edges, seen along it.
        let by_a = line.direction.dot(b.cross(c));
        let by_b = line.direction.dot(c.cross(a));
        let by_c = line.direction.dot(a.cross(b));
        let sum = by_a + by_b + by_c;
        let is_left = by_a.less(zero) | by_b.less(zero) | by_c.less(zero);
        let is_right = zero.less(by_a) | zero.less(by_b) | zero.less(by_c);
        let t = (by_a * along_a + by_b * along_b + by_c * along_c) / sum;
        let never = zero.less(zero);
        // Not on both sides of the edges, and not seen from the edge.
        Entry { t, is_second: never, meets: !(is_left & is_right) & (sum.less(zero) | zero.less(sum)) }
    }

    /// Place and normal of the surface near a point, on the side from which `direction` comes.
    pub(super) fn surface(&self, point: Vec3, direction: Vec3) -> (Vec3, Vec3) {
        let normal = self.double_area().normalize_or(-direction);
        let normal = if normal.dot(direction) > 0.0 { -normal } else { normal };
        let [a, b, c] = self.corners;
        let greatest = [point, a, b, c].into_iter().map(|it| it.abs().max_element()).fold(0.0, f32::max);
        let above = (point - a).as_dvec3().dot(normal.as_dvec3()) as f32;
        (point + (LIFT * greatest - above) * normal, normal)
    }

    /// Balls that hold it together, none of them larger than `most` unless it was halved `depth` times.
    pub(super) fn balls(&self, most: f32, depth: u32, found: &mut impl FnMut(Ball)) {
        let ball = self.ball();
        if ball.radius <= most || depth == 0 {
            return found(ball);
        }
        // Halved at its longest edge, which comes to lie between the first two corners.
        let [a, b, c] = self.corners;
        let length = |[one, other]: [Vec3; 2]| one.distance_squared(other);
        let [a, b, c] = [[a, b, c], [b, c, a], [c, a, b]]
            .into_iter()
            .max_by(|one, other| length([one[0], one[1]]).total_cmp(&length([other[0], other[1]])))
            .unwrap_or([a, b, c]);
        let middle = 0.5 * a + 0.5 * b;
        Self { corners: [a, middle, c] }.balls(most, depth - 1, found);
        Self { corners: [middle, b, c] }.balls(most, depth - 1, found);
    }

    /// A ball around it, a hair larger than it needs to be.
    fn ball(&self) -> Ball {
        let [a, b, c] = self.corners;
        // Half way along the longest edge, which is the best of an obtuse one, or the centroid.
        let centers = [0.5 * a + 0.5 * b, 0.5 * b + 0.5 * c, 0.5 * c + 0.5 * a, (a + b + c) / 3.0];
        let reach = |center: Vec3| self.corners.map(|it| it.distance(center)).into_iter().fold(0.0, f32::max);
        let balls = centers.map(|center| Ball { center, radius: 1.001 * reach(center) });
        balls.into_iter().min_by(|one, other| one.radius.total_cmp(&other.radius)).unwrap_or(balls[3])
    }
}
