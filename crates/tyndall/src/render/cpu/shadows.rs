//! Shadow rays that share a direction, sixteen at a time.
//!
//! Sixteen points are projected along the direction; the walk follows the rectangle that holds those still lit, visits only what
//! lies in front of them, and tests a particle against all sixteen in one step, with the formula of [`crate::math::enter_sphere`].

use fearless_simd::{f32x8, f32x16, prelude::*, u32x16};
use fearless_simd_macros::simd;
use glam::Vec3;

use super::tiles::{LEAF_BIT, RAYS, child_of, decode};
use crate::structure::HIT_ROUNDING;
use crate::structure::bvh::Bvh;

/// Points from which light is looked for, by axis, and the particles on which they lie, which do not shadow them.
#[derive(Clone, Copy)]
pub(super) struct Points {
    pub(super) position: [[f32; RAYS]; 3],
    pub(super) on: [u32; RAYS],
}

/// What the lit points span: a rectangle across the direction, and the depth of the first of them along it.
struct Span {
    middle: [f32; 2],
    half: [f32; 2],
    first: f32,
}

impl Span {
    /// The span of the points in the mask `lit`, which is not zero. `projected` holds two coordinates across, one along.
    #[simd]
    fn of<S: Simd>(simd: S, projected: &[f32x16<S>; 3], lit: u32) -> Self {
        let lit = fearless_simd::mask32x16::from_bitmask(simd, lit as u64);
        let low = |k: usize| lit.select(projected[k], f32x16::splat(simd, f32::INFINITY)).reduce_min();
        let high = |k: usize| lit.select(projected[k], f32x16::splat(simd, f32::NEG_INFINITY)).reduce_max();
        let (low_high, first) = ([0, 1].map(|k| (low(k), high(k))), low(2));
        Self {
            middle: low_high.map(|(low, high)| 0.5 * (low + high)),
            half: low_high.map(|(low, high)| 0.5 * (high - low)),
            first,
        }
    }

    /// Which of the things at `center` that reach `reach(axis)` along an axis can shadow one of the points.
    #[inline(always)]
    fn meets<S: Simd, V: SimdFloat<S, Element = f32>>(&self, simd: S, center: &[V; 3], reach: [V; 3]) -> u32 {
        let splat = |x: f32| V::simd_from(simd, x);
        let across = |k: usize| (center[k] - splat(self.middle[k])).abs().simd_le(reach[k] + splat(self.half[k]));
        let along = (center[2] + reach[2]).simd_ge(splat(self.first));
        (across(0) & across(1) & along).to_bitmask() as u32
    }
}

/// Coordinates across and along a direction, measured from a point near those that look for light.
struct Light {
    axes: [Vec3; 3],
    origin: Vec3,
    /// Largest distance from `origin` to a point, in each coordinate.
    spread: f32,
}

impl Light {
    #[inline(always)]
    fn project<S: Simd, V: SimdFloat<S, Element = f32>>(&self, simd: S, center: &[V; 3]) -> [V; 3] {
        let splat = |x: f32| V::simd_from(simd, x);
        self.axes.map(|axis| {
            center[2].mul_add(splat(axis.z), center[1].mul_add(splat(axis.y), center[0] * splat(axis.x)))
        })
    }
}

/// Which of the points in the bit mask `lit` see past every particle along `toward_light`. `stack` is scratch.
#[simd]
pub(super) fn unoccluded<S: Simd>(
    simd: S,
    bvh: &Bvh,
    toward_light: Vec3,
    points: &Points,
    mut lit: u32,
    stack: &mut Vec<(f32, u32)>,
) -> u32 {
    if lit == 0 || bvh.nodes.is_empty() {
        return lit;
    }
    let position = [0, 1, 2].map(|axis| f32x16::load_array_ref(simd, &points.position[axis]));
    let one = lit.trailing_zeros() as usize;
    let origin = Vec3::from_array([0, 1, 2].map(|axis| points.position[axis][one]));
    let (u, v) = toward_light.any_orthonormal_pair();
    let mut light = Light { axes: [u, v, toward_light], origin, spread: 0.0 };
    let offset = [0, 1, 2].map(|axis| position[axis] - origin[axis]);
    light.spread = farthest(simd, &offset, lit);
    let projected = light.project(simd, &offset);
    let mut span = Span::of(simd, &projected, lit);

    stack.clear();
    stack.push((0.0, 0));
    while let Some((_, child)) = stack.pop() {
        if child & LEAF_BIT == 0 {
            push_children(simd, bvh, child, &light, &span, stack);
            continue;
        }
        let shadowed = shadow_of_leaf(simd, bvh, (child & !LEAF_BIT) as usize, &light, &span, points, lit);
        if shadowed != 0 {
            lit &= !shadowed;
            if lit == 0 {
                return 0;
            }
            span = Span::of(simd, &projected, lit);
        }
    }
    lit
}

/// The largest coordinate, of either sign, of the points in the mask.
#[simd]
fn farthest<S: Simd>(simd: S, offset: &[f32x16<S>; 3], lit: u32) -> f32 {
    let farthest = offset[0].abs().max(offset[1].abs()).max(offset[2].abs());
    let lit = fearless_simd::mask32x16::from_bitmask(simd, lit as u64);
    lit.select(farthest, f32x16::splat(simd, 0.0)).reduce_max()
}

/// Pushes the children that can shadow a point, the one nearest to the points last.
#[simd]
fn push_children<S: Simd>(
    simd: S,
    bvh: &Bvh,
    child: u32,
    light: &Light,
    span: &Span,
    stack: &mut Vec<(f32, u32)>,
) {
    let node = &bvh.nodes[child as usize];
    let (center, half) = decode(simd, node, light.origin, HIT_ROUNDING * light.spread + bvh.slack);
    let center = light.project(simd, &center);
    let reach = light.axes.map(|axis| {
        let [x, y, z] = axis.abs().to_array().map(|x| f32x8::splat(simd, x));
        half[2].mul_add(z, half[1].mul_add(y, half[0] * x))
    });
    let existing = (1u32 << (node.node_count + node.leaf_count)) - 1;
    let mut kept = span.meets(simd, &center, reach) & existing;
    let along = center[2].to_array();
    let first = stack.len();
    while kept != 0 {
        let child = kept.trailing_zeros() as usize;
        kept &= kept - 1;
        // Insertion sort: far before near, so that the nearest is popped first.
        let entry = (along[child], child_of(node, child));
        stack.push(entry);
        let mut place = stack.len() - 1;
        while place > first && stack[place - 1].0 < entry.0 {
            stack[place] = stack[place - 1];
            place -= 1;
        }
        stack[place] = entry;
    }
}

/// Which of the points in `lit` lie in the shadow of a particle of the leaf.
#[simd]
fn shadow_of_leaf<S: Simd>(
    simd: S,
    bvh: &Bvh,
    place: usize,
    light: &Light,
    span: &Span,
    points: &Points,
    lit: u32,
) -> u32 {
    let leaf = &bvh.leaves[place];
    let radius = match bvh.radii.get(place) {
        Some(radii) => f32x16::load_array_ref(simd, radii),
        None => f32x16::splat(simd, bvh.radius),
    };
    let center = [0, 1, 2].map(|axis| f32x16::load_array_ref(simd, &leaf.center[axis]) - light.origin[axis]);
    let distance = center[0].abs() + center[1].abs() + center[2].abs();
    let margin = f32x16::splat(simd, HIT_ROUNDING * light.spread);
    let grown = radius + (distance + radius).mul_add(HIT_ROUNDING, margin);
    let mut kept = span.meets(simd, &light.project(simd, &center), [grown; 3]);
    let radius = radius.to_array();
    let direction = light.axes[2].to_array().map(|d| f32x16::splat(simd, d));
    let zero = f32x16::splat(simd, 0.0);
    let on = u32x16::load_array_ref(simd, &points.on);
    let mut shadowed = 0;
    while kept != 0 {
        let lane = kept.trailing_zeros() as usize;
        kept &= kept - 1;
        // `math::enter_sphere`, for sixteen rays at once.
        let to_center =
            [0, 1, 2].map(|k| leaf.center[k][lane] - f32x16::load_array_ref(simd, &points.position[k]));
        let closest = to_center[0] * direction[0] + to_center[1] * direction[1] + to_center[2] * direction[2];
        let off_axis = [0, 1, 2].map(|k| to_center[k] - closest * direction[k]);
        let off_axis_sq = off_axis[0] * off_axis[0] + off_axis[1] * off_axis[1] + off_axis[2] * off_axis[2];
        let half_chord_sq = f32x16::splat(simd, radius[lane] * radius[lane]) - off_axis_sq;
        let t = closest - half_chord_sq.max(zero).sqrt();
        let enters = half_chord_sq.simd_gt(zero) & zero.simd_lt(t);
        let enters = enters & !on.simd_eq(u32x16::splat(simd, leaf.id[lane]));
        shadowed |= enters.to_bitmask() as u32;
        if shadowed & lit == lit {
            break;
        }
    }
    shadowed & lit
}
