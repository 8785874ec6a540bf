//! Vectors' companions: boxes, rays, and where a ray meets a sphere or a box.
//!
//! `enter_sphere` is the one formula of sphere visibility: every structure, width of SIMD and machine uses these steps in this
//! order, without fused multiply-add, so that they agree bit for bit.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// An axis-aligned box. Empty when `min` exceeds `max`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Bounds {
    /// Smallest coordinates.
    pub min: Vec3,
    /// Largest coordinates.
    pub max: Vec3,
}

impl Bounds {
    /// The box that holds nothing.
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The smallest box that holds `self` and `point`.
    pub fn with(self, point: Vec3) -> Self {
        Self { min: self.min.min(point), max: self.max.max(point) }
    }

    /// The smallest box that holds both.
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// The box grown by `margin` on every side.
    pub fn grown(self, margin: f32) -> Self {
        Self { min: self.min - margin, max: self.max + margin }
    }

    /// The box moved by `offset`.
    pub fn moved(self, offset: Vec3) -> Self {
        Self { min: self.min + offset, max: self.max + offset }
    }

    /// Whether the box holds no point.
    pub fn is_empty(&self) -> bool {
        !(self.min.cmple(self.max).all())
    }

    /// Whether `point` is in the box or on its border.
    pub fn contains(&self, point: Vec3) -> bool {
        point.cmpge(self.min).all() && point.cmple(self.max).all()
    }

    /// The middle of a box that is not empty.
    pub fn center(&self) -> Vec3 {
        0.5 * self.min + 0.5 * self.max
    }

    /// Edge lengths; zero for the empty box.
    pub fn extent(&self) -> Vec3 {
        if self.is_empty() { Vec3::ZERO } else { self.max - self.min }
    }

    /// The distances between which `ray` is inside the box; `None` if it never is within its interval.
    #[inline(always)]
    pub fn clip(&self, ray: &Ray) -> Option<[f32; 2]> {
        let inverse = ray.inv_direction();
        let forward = inverse.cmpgt(Vec3::ZERO);
        // The sides by the ray's way, not by the nearer of the two: the empty box stays empty.
        let (near, far) =
            (Vec3::select(forward, self.min, self.max), Vec3::select(forward, self.max, self.min));
        let enter = ((near - ray.origin) * inverse).max_element().max(ray.t_min);
        let leave = ((far - ray.origin) * inverse).min_element().min(ray.t_max);
        (enter < leave).then_some([enter, leave])
    }
}

/// A half-line, with the open interval of distances that counts.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Where it starts.
    pub origin: Vec3,
    /// Where it goes; unit length.
    pub direction: Vec3,
    /// What it meets at this distance or before does not count.
    pub t_min: f32,
    /// What it meets at this distance or after does not count.
    pub t_max: f32,
}

impl Ray {
    /// One over the direction, with nothing near zero: a side parallel to the ray is met far away, on the side where the ray is.
    /// What that turns the ray by is far below [`HIT_ROUNDING`].
    #[inline(always)]
    pub(crate) fn inv_direction(&self) -> Vec3 {
        let inverse = |d: f32| 1.0 / if d.abs() < 1e-16 { 1e-16_f32.copysign(d) } else { d };
        Vec3::new(inverse(self.direction.x), inverse(self.direction.y), inverse(self.direction.z))
    }
}

/// What the rounding of [`enter_sphere`] can add to the size of a sphere, relative to its distance: 32 units in the last place.
/// Boxes are grown by it, so that no structure loses a grazing hit that brute force finds.
pub(crate) const HIT_ROUNDING: f32 = 2.0e-6;

/// Distance at which `ray` enters the sphere, or `ray.t_max` if it does not enter it before that.
/// The direction has unit length. A ray that starts inside does not enter.
#[inline(always)]
pub fn enter_sphere(ray: &Ray, center: Vec3, radius: f32) -> f32 {
    let (closest, half_chord_sq) = chord(ray, center, radius);
    let t = closest - half_chord_sq.max(0.0).sqrt();
    if half_chord_sq > 0.0 && ray.t_min < t && t < ray.t_max { t } else { ray.t_max }
}

/// Distance at which the line of `ray` leaves a sphere that it meets.
#[inline(always)]
pub(crate) fn leave_sphere(ray: &Ray, center: Vec3, radius: f32) -> f32 {
    let (closest, half_chord_sq) = chord(ray, center, radius);
    closest + half_chord_sq.max(0.0).sqrt()
}

/// Distance at which the line of `ray` comes nearest to the center of a sphere, and the square of half its chord: not above 0 where it misses.
#[inline(always)]
fn chord(ray: &Ray, center: Vec3, radius: f32) -> (f32, f32) {
    let to_center = center - ray.origin;
    let closest =
        to_center.x * ray.direction.x + to_center.y * ray.direction.y + to_center.z * ray.direction.z;
    // A difference of vectors, not of squared lengths: those cancel for a small sphere far away.
    let off_axis = to_center - closest * ray.direction;
    let off_axis_sq = off_axis.x * off_axis.x + off_axis.y * off_axis.y + off_axis.z * off_axis.z;
    (closest, radius * radius - off_axis_sq)
}

/// e^-x for x of at least 0; 0 beyond 87. The relative error is below 1e-7 (4 + x): what grows with x is the rounding of x log2(e).
/// Without a branch or a call, so that compilers put it on lanes, and the same on every machine.
#[inline(always)]
pub(crate) fn exp_minus(x: f32) -> f32 {
    // Powers of 2: the whole part goes to the exponent, the rest is at most a half.
    let power = (-std::f32::consts::LOG2_E * x).max(-125.0);
    let shifted = power + ROUNDS;
    let rest = power - (shifted - ROUNDS);
    let mut sum = 1.540_353_e-4;
    for coefficient in [1.333_355_8e-3, 9.618_129e-3, 5.550_411e-2, 0.240_226_5, std::f32::consts::LN_2, 1.0]
    {
        sum = sum * rest + coefficient;
    }
    let scaled = f32::from_bits(sum.to_bits().wrapping_add(shifted.to_bits() << 23));
    if x < 87.0 { scaled } else { 0.0 }
}

/// Added to a number below 2^22 and subtracted again, it leaves the nearest whole number, whose bits are the sum's last.
const ROUNDS: f32 = 12_582_912.0;

#[cfg(test)]
mod tests {
    use super::exp_minus;

    #[test]
    fn the_exponential_is_that_of_f64() {
        for step in 0..200_000 {
            let x = 4.3e-4 * step as f32;
            let wanted = (-f64::from(x)).exp();
            let error = (f64::from(exp_minus(x)) / wanted - 1.0).abs();
            assert!(error < 1e-7 * (4.0 + f64::from(x)), "{x}: {error}");
        }
        assert_eq!((exp_minus(0.0), exp_minus(88.0), exp_minus(f32::INFINITY)), (1.0, 0.0, 0.0));
    }
}
