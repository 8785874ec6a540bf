//! Vectors on SIMD lanes, and the formulas that the kernels share.
//!
//! All is `#[inline(always)]` and free of closures: what is not inlined into a kernel is compiled without its instruction set.

use fearless_simd::{f32x16, mask32x16, prelude::*, u8x16, u16x16};
use glam::Vec3;

use crate::math::HIT_ROUNDING;

/// A vector on every lane.
#[derive(Clone, Copy)]
pub(crate) struct Lanes3<V> {
    pub(crate) x: V,
    pub(crate) y: V,
    pub(crate) z: V,
}

impl<V> Lanes3<V> {
    #[inline(always)]
    pub(crate) fn splat<S: Simd>(simd: S, v: Vec3) -> Self
    where
        V: SimdFloat<S, Element = f32>,
    {
        Self { x: V::simd_from(simd, v.x), y: V::simd_from(simd, v.y), z: V::simd_from(simd, v.z) }
    }

    #[inline(always)]
    pub(crate) fn minus<S: Simd>(self, other: Self) -> Self
    where
        V: SimdFloat<S, Element = f32>,
    {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }

    #[inline(always)]
    pub(crate) fn plus<S: Simd>(self, other: Self) -> Self
    where
        V: SimdFloat<S, Element = f32>,
    {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }

    #[inline(always)]
    pub(crate) fn times<S: Simd>(self, factor: V) -> Self
    where
        V: SimdFloat<S, Element = f32>,
    {
        Self { x: self.x * factor, y: self.y * factor, z: self.z * factor }
    }

    /// Dot product, every product and sum rounded.
    #[inline(always)]
    pub(crate) fn dot<S: Simd>(self, other: Self) -> V
    where
        V: SimdFloat<S, Element = f32>,
    {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// Dot product with the same vector on all lanes; fused where the machine can, so for bounds only.
    #[inline(always)]
    pub(crate) fn along<S: Simd>(self, simd: S, axis: Vec3) -> V
    where
        V: SimdFloat<S, Element = f32>,
    {
        let by_x = self.x * V::simd_from(simd, axis.x);
        let by_y = self.y.mul_add(V::simd_from(simd, axis.y), by_x);
        self.z.mul_add(V::simd_from(simd, axis.z), by_y)
    }
}

impl<S: Simd> Lanes3<f32x16<S>> {
    #[inline(always)]
    pub(crate) fn load(simd: S, columns: &[[f32; 16]; 3]) -> Self {
        Self {
            x: f32x16::load_array_ref(simd, &columns[0]),
            y: f32x16::load_array_ref(simd, &columns[1]),
            z: f32x16::load_array_ref(simd, &columns[2]),
        }
    }

    /// `self` where the mask is set, `other` where it is not.
    #[inline(always)]
    pub(crate) fn where_else(self, mask: mask32x16<S>, other: Self) -> Self {
        Self {
            x: mask.select(self.x, other.x),
            y: mask.select(self.y, other.y),
            z: mask.select(self.z, other.z),
        }
    }

    #[inline(always)]
    pub(crate) fn to_arrays(self) -> [[f32; 16]; 3] {
        [self.x.to_array(), self.y.to_array(), self.z.to_array()]
    }

    #[inline(always)]
    pub(crate) fn store(self, columns: &mut [[f32; 16]; 3]) {
        self.x.store_array(&mut columns[0]);
        self.y.store_array(&mut columns[1]);
        self.z.store_array(&mut columns[2]);
    }
}

/// Sixteen bytes as floats.
#[inline(always)]
pub(crate) fn floats_of_bytes<S: Simd>(simd: S, bytes: &[u8; 16]) -> f32x16<S> {
    let (low, high) = u8x16::load_array_ref(simd, bytes).widen();
    let ((a, b), (c, d)) = (low.widen(), high.widen());
    f32x16::float_from(a.combine(b).combine(c.combine(d)))
}

/// Sixteen 16-bit numbers as floats.
#[inline(always)]
pub(crate) fn floats_of_words<S: Simd>(simd: S, words: &[u16; 16]) -> f32x16<S> {
    let (low, high) = u16x16::load_array_ref(simd, words).widen();
    f32x16::float_from(low.combine(high))
}

/// How far things reach to both sides along an axis.
pub(crate) trait Reach<S: Simd, V> {
    fn reach(&self, simd: S, axis: Vec3) -> V;
}

/// Half extents of boxes.
impl<S: Simd, V: SimdFloat<S, Element = f32>> Reach<S, V> for Lanes3<V> {
    #[inline(always)]
    fn reach(&self, simd: S, axis: Vec3) -> V {
        self.along(simd, axis.abs())
    }
}

/// Radii of spheres.
pub(crate) struct Ball<V>(pub(crate) V);

impl<S: Simd, V: SimdFloat<S, Element = f32>> Reach<S, V> for Ball<V> {
    #[inline(always)]
    fn reach(&self, simd: S, axis: Vec3) -> V {
        self.0 * V::simd_from(simd, axis.length())
    }
}

/// Radii grown by what the rounding of [`enter_sphere`] can add to spheres at `center`, measured from the rays' origins give or
/// take `spread`.
#[inline(always)]
pub(crate) fn grown<S: Simd>(
    simd: S,
    radius: f32x16<S>,
    center: Lanes3<f32x16<S>>,
    spread: f32,
) -> f32x16<S> {
    let distance = center.x.abs() + center.y.abs() + center.z.abs();
    let margin = f32x16::splat(simd, HIT_ROUNDING * spread);
    radius + (distance + radius).mul_add(f32x16::splat(simd, HIT_ROUNDING), margin)
}

/// [`crate::math::enter_sphere`] on lanes: where rays enter spheres, and which come near enough to. What is nearer than the ray
/// starts is for the caller to refuse.
#[inline(always)]
pub(crate) fn enter_sphere<S: Simd>(
    simd: S,
    to_center: Lanes3<f32x16<S>>,
    direction: Lanes3<f32x16<S>>,
    radius_sq: f32x16<S>,
) -> (f32x16<S>, mask32x16<S>) {
    let closest = to_center.dot(direction);
    let off_axis = to_center.minus(direction.times(closest));
    let half_chord_sq = radius_sq - off_axis.dot(off_axis);
    let zero = f32x16::splat(simd, 0.0);
    (closest - half_chord_sq.max(zero).sqrt(), half_chord_sq.simd_gt(zero))
}
