//! Numbers of which the formulas of shapes are made: a single one, or one on each of sixteen lanes. So a formula stands once, and gives the
//! same bits for a single ray and for sixteen: each product and sum is rounded, nothing is fused.
//!
//! All is `#[inline(always)]` and free of closures: what is not inlined into a kernel is compiled without its instruction set.

use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

use fearless_simd::{f32x16, mask32x16, prelude::*};
use glam::Vec3;

use crate::math::Ray;
use crate::simd::Lanes3;

/// See the module.
pub(crate) trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// Which of them.
    type Mask: Copy + BitAnd<Output = Self::Mask> + BitOr<Output = Self::Mask> + Not<Output = Self::Mask>;

    /// A constant, on as many lanes.
    fn like(self, value: f32) -> Self;
    /// Whether it is less.
    fn less(self, other: Self) -> Self::Mask;
    /// `one` where the mask is set, `other` where it is not.
    fn select(mask: Self::Mask, one: Self, other: Self) -> Self;
    /// The square root.
    fn root(self) -> Self;
    /// Without its sign.
    fn magnitude(self) -> Self;

    /// What `ask` finds for each ray by itself: where it enters something, if it does.
    fn by_ray(line: &Line<Self>, ask: impl Fn(&Line<f32>) -> Option<f32>) -> Entry<Self>;

    /// The lesser of two.
    #[inline(always)]
    fn lesser(self, other: Self) -> Self {
        Self::select(self.less(other), self, other)
    }

    /// The greater of two.
    #[inline(always)]
    fn greater(self, other: Self) -> Self {
        Self::select(other.less(self), self, other)
    }
}

impl Number for f32 {
    type Mask = bool;

    #[inline(always)]
    fn like(self, value: f32) -> Self {
        value
    }

    #[inline(always)]
    fn less(self, other: Self) -> bool {
        self < other
    }

    #[inline(always)]
    fn select(mask: bool, one: Self, other: Self) -> Self {
        if mask { one } else { other }
    }

    #[inline(always)]
    fn root(self) -> Self {
        self.sqrt()
    }

    #[inline(always)]
    fn magnitude(self) -> Self {
        self.abs()
    }

    fn by_ray(line: &Line<f32>, ask: impl Fn(&Line<f32>) -> Option<f32>) -> Entry<f32> {
        let found = ask(line);
        Entry { t: found.unwrap_or(f32::INFINITY), is_second: false, meets: found.is_some() }
    }
}

impl<S: Simd> Number for f32x16<S> {
    type Mask = mask32x16<S>;

    #[inline(always)]
    fn like(self, value: f32) -> Self {
        Self::splat(self.simd, value)
    }

    #[inline(always)]
    fn less(self, other: Self) -> mask32x16<S> {
        self.simd_lt(other)
    }

    #[inline(always)]
    fn select(mask: mask32x16<S>, one: Self, other: Self) -> Self {
        mask.select(one, other)
    }

    #[inline(always)]
    fn root(self) -> Self {
        self.sqrt()
    }

    #[inline(always)]
    fn magnitude(self) -> Self {
        self.abs()
    }

    fn by_ray(line: &Line<Self>, ask: impl Fn(&Line<f32>) -> Option<f32>) -> Entry<Self> {
        let simd = line.origin.x.simd;
        let (origin, direction) = (line.origin.lanes(), line.direction.lanes());
        let mut t = [f32::INFINITY; 16];
        for (t, (origin, direction)) in t.iter_mut().zip(origin.into_iter().zip(direction)) {
            *t = ask(&Line { origin, direction }).unwrap_or(*t);
        }
        let t = Self::simd_from(simd, t);
        let none = Self::splat(simd, f32::INFINITY);
        Entry { t, is_second: none.simd_lt(none), meets: t.simd_lt(none) }
    }
}

/// A vector of such numbers.
#[derive(Clone, Copy)]
pub(crate) struct Vector<R> {
    pub(crate) x: R,
    pub(crate) y: R,
    pub(crate) z: R,
}

impl<R: Number> Vector<R> {
    /// The same vector on all lanes of `like`.
    #[inline(always)]
    pub(crate) fn of(like: R, vector: Vec3) -> Self {
        Self { x: like.like(vector.x), y: like.like(vector.y), z: like.like(vector.z) }
    }

    #[inline(always)]
    pub(crate) fn dot(self, other: Self) -> R {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// Swapped factors give the negative of it, to the bit.
    #[inline(always)]
    pub(crate) fn cross(self, other: Self) -> Self {
        Self {
            x: self.y * other.z - self.z * other.y,
            y: self.z * other.x - self.x * other.z,
            z: self.x * other.y - self.y * other.x,
        }
    }
}

impl<R: Number> Add for Vector<R> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }
}

impl<R: Number> Sub for Vector<R> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}

impl<R: Number> Mul<R> for Vector<R> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: R) -> Self {
        Self { x: self.x * factor, y: self.y * factor, z: self.z * factor }
    }
}

impl<S: Simd> Vector<f32x16<S>> {
    /// Lane by lane.
    fn lanes(self) -> [Vector<f32>; 16] {
        let (x, y, z) = (self.x.to_array(), self.y.to_array(), self.z.to_array());
        std::array::from_fn(|lane| Vector { x: x[lane], y: y[lane], z: z[lane] })
    }
}

impl<S: Simd> From<Lanes3<f32x16<S>>> for Vector<f32x16<S>> {
    #[inline(always)]
    fn from(lanes: Lanes3<f32x16<S>>) -> Self {
        Self { x: lanes.x, y: lanes.y, z: lanes.z }
    }
}

/// Rays without their ends.
#[derive(Clone, Copy)]
pub(crate) struct Line<R> {
    pub(crate) origin: Vector<R>,
    pub(crate) direction: Vector<R>,
}

impl From<&Ray> for Line<f32> {
    fn from(ray: &Ray) -> Self {
        Self { origin: Vector::of(0.0, ray.origin), direction: Vector::of(0.0, ray.direction) }
    }
}

/// Where rays enter a shape.
#[derive(Clone, Copy)]
pub(crate) struct Entry<R: Number> {
    /// How far along the ray; means something only where it meets the shape, and may be behind the ray's origin.
    pub(crate) t: R,
    /// Whether in the shape's second half.
    pub(crate) is_second: R::Mask,
    /// Whether the endless line meets the shape.
    pub(crate) meets: R::Mask,
}
