//! Shadow rays that share a direction, sixteen at a time.
//!
//! Sixteen points are projected along the direction; the walk follows the rectangle that holds those still lit, visits only what
//! lies in front of them, and tests a particle against all sixteen in one step, with the formula of [`crate::math::enter_sphere`].

use fearless_simd::{f32x16, mask32x16, prelude::*, u32x16};
use fearless_simd_macros::simd;
use glam::Vec3;

use super::tiles::RAYS;
use crate::math::HIT_ROUNDING;
use crate::simd::{Ball, Lanes3, Reach, enter_sphere, grown};
use crate::structure::bvh::{Bvh, LEAF, Place, push_sorted};

/// Points from which light is looked for, by axis, and the nodes of the particles on which they lie, which do not shadow them.
#[derive(Clone, Copy)]
pub(super) struct Points<'a> {
    pub(super) position: &'a [[f32; RAYS]; 3],
    pub(super) on: &'a [u32; RAYS],
}

/// What the lit points span: a rectangle across the direction, and the depth of the first of them along it.
pub(super) struct Span {
    pub(super) middle: [f32; 2],
    pub(super) half: [f32; 2],
    pub(super) first: f32,
}

impl Span {
    /// The span of the points in the mask `lit`, which is not zero; coordinates are across, across and along.
    #[inline(always)]
    pub(super) fn of<S: Simd>(simd: S, projected: &Lanes3<f32x16<S>>, lit: u32) -> Self {
        let lit = mask32x16::from_bitmask(simd, lit as u64);
        let (none_low, none_high) =
            (f32x16::splat(simd, f32::INFINITY), f32x16::splat(simd, f32::NEG_INFINITY));
        let low =
            [lit.select(projected.x, none_low).reduce_min(), lit.select(projected.y, none_low).reduce_min()];
        let high = [
            lit.select(projected.x, none_high).reduce_max(),
            lit.select(projected.y, none_high).reduce_max(),
        ];
        Self {
            middle: [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])],
            half: [0.5 * (high[0] - low[0]), 0.5 * (high[1] - low[1])],
            first: lit.select(projected.z, none_low).reduce_min(),
        }
    }

    /// Which of the things at `center` that reach `reach` to both sides can shadow one of the points.
    #[inline(always)]
    pub(super) fn meets<S: Simd, V: SimdFloat<S, Element = f32>>(
        &self,
        simd: S,
        center: &Lanes3<V>,
        reach: &Lanes3<V>,
    ) -> u32 {
        let off_x = (center.x - V::simd_from(simd, self.middle[0])).abs();
        let off_y = (center.y - V::simd_from(simd, self.middle[1])).abs();
        let across = off_x.simd_le(reach.x + V::simd_from(simd, self.half[0]))
            & off_y.simd_le(reach.y + V::simd_from(simd, self.half[1]));
        (across & (center.z + reach.z).simd_ge(V::simd_from(simd, self.first))).to_bitmask() as u32
    }
}

/// Coordinates across and along a direction, measured from a point near those that look for light.
pub(super) struct Light {
    /// Two axes across, and the direction toward the light.
    pub(super) across: [Vec3; 2],
    pub(super) toward: Vec3,
    pub(super) origin: Vec3,
    /// Largest distance from `origin` to a point, in each coordinate.
    pub(super) spread: f32,
}

impl Light {
    pub(super) fn new(toward: Vec3, origin: Vec3, spread: f32) -> Self {
        let (u, v) = toward.any_orthonormal_pair();
        Self { across: [u, v], toward, origin, spread }
    }

    /// Coordinates of points measured from the origin.
    #[inline(always)]
    pub(super) fn project<S: Simd, V: SimdFloat<S, Element = f32>>(
        &self,
        simd: S,
        center: Lanes3<V>,
    ) -> Lanes3<V> {
        Lanes3 {
            x: center.along(simd, self.across[0]),
            y: center.along(simd, self.across[1]),
            z: center.along(simd, self.toward),
        }
    }

    /// How far things reach along each coordinate.
    #[inline(always)]
    pub(super) fn reach<S: Simd, V: SimdFloat<S, Element = f32>>(
        &self,
        simd: S,
        thing: impl Reach<S, V>,
    ) -> Lanes3<V> {
        Lanes3 {
            x: thing.reach(simd, self.across[0]),
            y: thing.reach(simd, self.across[1]),
            z: thing.reach(simd, self.toward),
        }
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
    stack: &mut Vec<Entry>,
) -> u32 {
    let Some(root) = bvh.root().filter(|_| lit != 0) else { return lit };
    let one = lit.trailing_zeros() as usize;
    let origin = Vec3::new(points.position[0][one], points.position[1][one], points.position[2][one]);
    let offset = Lanes3::load(simd, points.position).minus(Lanes3::splat(simd, origin));
    let light = Light::new(toward_light, origin, farthest(simd, &offset, lit));
    let projected = light.project(simd, offset);
    let span = Span::of(simd, &projected, lit);

    stack.clear();
    stack.push(Entry::of_all(root, lit));
    while let Some(Entry { place, lanes, .. }) = stack.pop() {
        let lanes = lanes & lit;
        if lanes == 0 {
            continue;
        }
        if place.level > 0 {
            push_children(simd, bvh, place, &light, &span, &projected, lanes, stack);
        } else {
            lit &= !shadow_of_leaf(simd, bvh, place.index as usize, &light, &span, points, lanes);
            if lit == 0 {
                return 0;
            }
        }
    }
    lit
}

/// A subtree that is still to be walked, for the points in the mask `lanes`.
#[derive(Clone, Copy)]
pub(super) struct Entry {
    /// From the points to its middle, along the direction.
    distance: f32,
    pub(super) place: Place,
    pub(super) lanes: u32,
}

impl Entry {
    /// Everything, for the points in the mask.
    pub(super) fn of_all(place: Place, lanes: u32) -> Self {
        Self { distance: 0.0, place, lanes }
    }
}

/// The largest coordinate, of either sign, of the points in the mask.
#[inline(always)]
pub(super) fn farthest<S: Simd>(simd: S, offset: &Lanes3<f32x16<S>>, lit: u32) -> f32 {
    let farthest = offset.x.abs().max(offset.y.abs()).max(offset.z.abs());
    let lit = mask32x16::from_bitmask(simd, lit as u64);
    lit.select(farthest, f32x16::splat(simd, 0.0)).reduce_max()
}

/// Pushes the children that can shadow a point, the one nearest to the points last. A call would cost walks without bonds a twentieth.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "one walk, cut where it is readable")]
pub(super) fn push_children<S: Simd>(
    simd: S,
    bvh: &Bvh,
    place: Place,
    light: &Light,
    span: &Span,
    projected: &Lanes3<f32x16<S>>,
    lanes: u32,
    stack: &mut Vec<Entry>,
) {
    let (center, half) = bvh.node(place).decode(simd, light.origin, HIT_ROUNDING * light.spread + bvh.slack);
    let center = light.project(simd, center);
    let reach = light.reach(simd, half);
    let mut kept = span.meets(simd, &center, &reach) & bvh.shown_children(place);
    let (x, y, z) = (center.x.to_array(), center.y.to_array(), center.z.to_array());
    let (reach_x, reach_y, reach_z) = (reach.x.to_array(), reach.y.to_array(), reach.z.to_array());
    let first = stack.len();
    while kept != 0 {
        let child = kept.trailing_zeros() as usize;
        kept &= kept - 1;
        let (middle, reach) = ([x[child], y[child]], [reach_x[child], reach_y[child]]);
        let lanes = under(simd, projected, middle, reach, z[child] + reach_z[child]) & lanes;
        if lanes == 0 {
            continue;
        }
        let entry = Entry { distance: z[child].abs(), place: bvh.child(place, child), lanes };
        push_sorted(stack, first, entry, |entry| entry.distance);
    }
}

/// Which points, in coordinates across, across and along, something at (x, y) that reaches so far to both sides, and up to `top`, can
/// shadow.
#[inline(always)]
pub(super) fn under<S: Simd>(
    simd: S,
    points: &Lanes3<f32x16<S>>,
    [x, y]: [f32; 2],
    reach: [f32; 2],
    top: f32,
) -> u32 {
    let off_x = (points.x - f32x16::splat(simd, x)).abs();
    let off_y = (points.y - f32x16::splat(simd, y)).abs();
    let under = off_x.simd_le(f32x16::splat(simd, reach[0]))
        & off_y.simd_le(f32x16::splat(simd, reach[1]))
        & points.z.simd_le(f32x16::splat(simd, top));
    under.to_bitmask() as u32
}

/// Which of the points in the mask `lanes` lie in the shadow of a particle of the leaf.
#[simd]
fn shadow_of_leaf<S: Simd>(
    simd: S,
    bvh: &Bvh,
    leaf: usize,
    light: &Light,
    span: &Span,
    points: &Points,
    lanes: u32,
) -> u32 {
    let radius = bvh.radii(simd, leaf);
    let direction = Lanes3::splat(simd, light.toward);
    let particles = bvh.centers(simd, leaf);
    let center = particles.minus(Lanes3::splat(simd, light.origin));
    let ball = Ball(grown(simd, radius, center, light.spread));
    let shown = bvh.shown(leaf);
    let mut kept = span.meets(simd, &light.project(simd, center), &light.reach(simd, ball)) & shown;
    let zero = f32x16::splat(simd, 0.0);
    let mut shadowed = 0;
    if lanes.count_ones() < kept.count_ones() {
        // Few points: each against the sixteen particles.
        let first = (leaf * LEAF) as u32;
        let nodes = u32x16::load_array(simd, std::array::from_fn(|k| first + k as u32));
        let mut left = lanes;
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            let [x, y, z] = points.position;
            let origin = Lanes3::splat(simd, Vec3::new(x[lane], y[lane], z[lane]));
            let (t, meets) = enter_sphere(simd, particles.minus(origin), direction, radius * radius);
            let other = !nodes.simd_eq(u32x16::splat(simd, points.on[lane]));
            let met = (other & meets & zero.simd_lt(t)).to_bitmask() as u32 & shown;
            shadowed |= u32::from(met != 0) << lane;
        }
    } else {
        // Few particles: each against the sixteen points.
        let on = u32x16::load_array_ref(simd, points.on);
        let origin = Lanes3::load(simd, points.position);
        let radius = radius.to_array();
        let [x, y, z] = &particles.to_arrays();
        while kept != 0 && shadowed & lanes != lanes {
            let lane = kept.trailing_zeros() as usize;
            kept &= kept - 1;
            let center = Lanes3::splat(simd, Vec3::new(x[lane], y[lane], z[lane]));
            let radius_sq = f32x16::splat(simd, radius[lane] * radius[lane]);
            let (t, meets) = enter_sphere(simd, center.minus(origin), direction, radius_sq);
            let other = !on.simd_eq(u32x16::splat(simd, (leaf * LEAF + lane) as u32));
            shadowed |= (other & meets & zero.simd_lt(t)).to_bitmask() as u32;
        }
    }
    shadowed & lanes
}
