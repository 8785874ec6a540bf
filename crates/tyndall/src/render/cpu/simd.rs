//! Vectors on SIMD lanes, and the formulas that the kernels share.
//!
//! All is `#[inline(always)]` and free of closures: what is not inlined into a kernel is compiled without its instruction set.

use fearless_simd::{f32x8, f32x16, mask32x16, prelude::*};
use glam::Vec3;

use crate::math::Ray;
use crate::structure::HIT_ROUNDING;
use crate::structure::bvh::{Bvh, LEAF, LEAF_BIT, Node, WIDTH};

/// A vector on every lane.
#[derive(Clone, Copy)]
pub(super) struct Lanes3<V> {
    pub(super) x: V,
    pub(super) y: V,
    pub(super) z: V,
}

impl<V> Lanes3<V> {
    #[inline(always)]
    pub(super) fn splat<S: Simd>(simd: S, v: Vec3) -> Self
    where
        V: SimdFloat<S, Element = f32>,
    {
        Self { x: V::simd_from(simd, v.x), y: V::simd_from(simd, v.y), z: V::simd_from(simd, v.z) }
    }

    #[inline(always)]
    pub(super) fn minus<S: Simd>(self, other: Self) -> Self
    where
        V: SimdFloat<S, Element = f32>,
    {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }

    #[inline(always)]
    pub(super) fn times<S: Simd>(self, factor: V) -> Self
    where
        V: SimdFloat<S, Element = f32>,
    {
        Self { x: self.x * factor, y: self.y * factor, z: self.z * factor }
    }

    /// Dot product, every product and sum rounded.
    #[inline(always)]
    pub(super) fn dot<S: Simd>(self, other: Self) -> V
    where
        V: SimdFloat<S, Element = f32>,
    {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// Dot product with the same vector on all lanes; fused where the machine can, so for bounds only.
    #[inline(always)]
    pub(super) fn along<S: Simd>(self, simd: S, axis: Vec3) -> V
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
    pub(super) fn load(simd: S, columns: &[[f32; LEAF]; 3]) -> Self {
        Self {
            x: f32x16::load_array_ref(simd, &columns[0]),
            y: f32x16::load_array_ref(simd, &columns[1]),
            z: f32x16::load_array_ref(simd, &columns[2]),
        }
    }

    #[inline(always)]
    pub(super) fn store(self, columns: &mut [[f32; LEAF]; 3]) {
        self.x.store_array(&mut columns[0]);
        self.y.store_array(&mut columns[1]);
        self.z.store_array(&mut columns[2]);
    }
}

/// How far things reach to both sides along an axis.
pub(super) trait Reach<S: Simd, V> {
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
pub(super) struct Ball<V>(pub(super) V);

impl<S: Simd, V: SimdFloat<S, Element = f32>> Reach<S, V> for Ball<V> {
    #[inline(always)]
    fn reach(&self, simd: S, axis: Vec3) -> V {
        self.0 * V::simd_from(simd, axis.length())
    }
}

/// Middles and half extents of a node's child boxes, measured from `eye`; the extents grown by `margin` and against rounding.
#[inline(always)]
pub(super) fn decode<S: Simd>(
    simd: S,
    node: &Node,
    eye: Vec3,
    margin: f32,
) -> (Lanes3<f32x8<S>>, Lanes3<f32x8<S>>) {
    let (x, half_x) = decode_axis(simd, node, 0, eye.x, margin);
    let (y, half_y) = decode_axis(simd, node, 1, eye.y, margin);
    let (z, half_z) = decode_axis(simd, node, 2, eye.z, margin);
    (Lanes3 { x, y, z }, Lanes3 { x: half_x, y: half_y, z: half_z })
}

#[inline(always)]
fn decode_axis<S: Simd>(simd: S, node: &Node, axis: usize, eye: f32, margin: f32) -> (f32x8<S>, f32x8<S>) {
    let mut sum = [0.0; WIDTH];
    let mut difference = [0.0; WIDTH];
    for child in 0..WIDTH {
        let (lower, upper) = (node.lower[axis][child] as i32, node.upper[axis][child] as i32);
        sum[child] = (upper + lower) as f32;
        difference[child] = (upper - lower) as f32;
    }
    let half_step = f32x8::splat(simd, 0.5 * node.step[axis]);
    let to_corner = f32x8::splat(simd, node.corner[axis] - eye);
    let middle = f32x8::load_array(simd, sum).mul_add(half_step, to_corner);
    let half = f32x8::load_array(simd, difference) * half_step;
    let rounding = f32x8::splat(simd, HIT_ROUNDING);
    (middle, (middle.abs() + half).mul_add(rounding, half + f32x8::splat(simd, margin)))
}

/// The place of child `child` of `node` among the nodes, or with [`LEAF_BIT`] among the leaves.
#[inline(always)]
pub(super) fn child_of(node: &Node, child: usize) -> u32 {
    let inner = node.node_count as usize;
    if child < inner { node.first_node + child as u32 } else { LEAF_BIT | (node.first_leaf + (child - inner) as u32) }
}

/// The radii of a leaf's particles.
#[inline(always)]
pub(super) fn radii<S: Simd>(simd: S, bvh: &Bvh, leaf: usize) -> f32x16<S> {
    match bvh.radii.get(leaf) {
        Some(radii) => f32x16::load_array_ref(simd, radii),
        None => f32x16::splat(simd, bvh.radius),
    }
}

/// Radii grown by what the rounding of [`enter_sphere`] can add to spheres at `center`, measured from the rays' origins give or
/// take `spread`.
#[inline(always)]
pub(super) fn grown<S: Simd>(simd: S, radius: f32x16<S>, center: Lanes3<f32x16<S>>, spread: f32) -> f32x16<S> {
    let distance = center.x.abs() + center.y.abs() + center.z.abs();
    let margin = f32x16::splat(simd, HIT_ROUNDING * spread);
    radius + (distance + radius).mul_add(f32x16::splat(simd, HIT_ROUNDING), margin)
}

/// [`crate::math::enter_sphere`] on lanes: where rays enter spheres, and which come near enough to. What is nearer than the ray
/// starts is for the caller to refuse.
#[inline(always)]
pub(super) fn enter_sphere<S: Simd>(
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

/// One over the direction, with no exact zero: a side parallel to the ray is met far away, on the side where the ray is.
#[inline(always)]
pub(super) fn inv_direction(ray: &Ray) -> Vec3 {
    let inverse = |d: f32| 1.0 / if d.abs() < 1e-20 { 1e-20_f32.copysign(d) } else { d };
    Vec3::new(inverse(ray.direction.x), inverse(ray.direction.y), inverse(ray.direction.z))
}
