//! Single rays through the hierarchy: nearest hit and any hit, for picking and for light that has no common direction.

use fearless_simd::{Level, dispatch, f32x8, f32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::Vec3;

use super::{Bvh, LEAF, LEVELS, Node, Place, WIDTH, power_of_two};
use crate::math::{Bounds, HIT_ROUNDING, Ray};
use crate::simd::{Lanes3, floats_of_bytes};
use crate::structure::Hit;
use crate::structure::search::{Observer, Search};

impl Bvh {
    /// See [`crate::structure::Structure::intersect`].
    pub fn intersect(&self, ray: &Ray, except: Option<u32>) -> Option<Hit> {
        self.search(Search::nearest(ray, except))
    }

    /// See [`crate::structure::Structure::occluded`].
    pub fn occluded(&self, ray: &Ray, except: Option<u32>) -> bool {
        self.search(Search::any(ray, except)).is_some()
    }

    /// Ends a search that has begun.
    pub(in crate::structure) fn search<O: Observer>(&self, mut search: Search<O>) -> Option<Hit> {
        dispatch!(Level::new(), simd => walk(simd, self, &mut search));
        search.found(&self.ids)
    }
}

/// A subtree that is still to be walked: where the ray enters its box, above the subtree's place. In order of their numbers the
/// nearest comes first, so that sorting needs no branches.
#[derive(Clone, Copy)]
struct Entry(u64);

/// Places in a level of the hierarchy, of which leaves have the most: 2^32 particles in leaves of sixteen.
const INDEX_BITS: u32 = 28;

impl Entry {
    /// `near` is not negative.
    #[inline(always)]
    fn new(near: f32, place: Place) -> Self {
        let place = u32::from(place.level) << INDEX_BITS | place.index;
        Self(u64::from(near.to_bits()) << 32 | u64::from(place))
    }

    #[inline(always)]
    fn near(self) -> f32 {
        f32::from_bits((self.0 >> 32) as u32)
    }

    #[inline(always)]
    fn place(self) -> Place {
        let place = self.0 as u32;
        Place { index: place & ((1 << INDEX_BITS) - 1), level: (place >> INDEX_BITS) as u8 }
    }
}

/// More entries than the deepest hierarchy of 2^32 particles can leave on the stack.
const STACK: usize = LEVELS * WIDTH;

#[simd]
fn walk<S: Simd, O: Observer>(simd: S, bvh: &Bvh, search: &mut Search<O>) {
    let Some(root) = bvh.root() else { return };
    let slabs = Slabs::new(simd, (bvh.bounds(), bvh.slack), search.ray(), search.inv_direction);
    let t_from = search.t_from;
    let mut stack = [Entry(0); STACK];
    let mut top = 0;
    let mut next = Entry::new(0.0, root);
    loop {
        let place = next.place();
        if place.level == 0 {
            let leaf = place.index as usize;
            search.visit(0, LEAF as u64);
            let (t, mut met) = search.enter(simd, bvh.centers(simd, leaf), bvh.radii(simd, leaf));
            while met != 0 {
                let lane = met.trailing_zeros() as usize;
                met &= met - 1;
                let node = (leaf * LEAF + lane) as u32;
                if bvh.shows(node) && search.meet(t[lane], node, &bvh.ids) {
                    return;
                }
            }
        } else {
            // Meet the eight boxes at once.
            search.visit(1, 0);
            let (enter, leave) = slabs.cross(simd, bvh.node(place));
            let enter = enter.max(f32x8::splat(simd, t_from));
            let leave = leave.min(f32x8::splat(simd, search.t_far));
            let mut kept = enter.simd_le(leave).to_bitmask() as u32 & bvh.shown_children(place);
            if kept != 0 {
                let near = enter.max(f32x8::splat(simd, 0.0)).to_array();
                let mut take = || {
                    let child = kept.trailing_zeros() as usize;
                    kept &= kept - 1;
                    (Entry::new(near[child % WIDTH], bvh.child(place, child)), kept)
                };
                // The nearest is walked next; the others go onto the stack, the farthest first.
                let mut left;
                (next, left) = take();
                let first = top;
                while left != 0 {
                    let mut entry;
                    (entry, left) = take();
                    (next, entry) = ordered(next, entry);
                    for slot in &mut stack[first..top] {
                        (entry, *slot) = ordered(entry, *slot);
                    }
                    stack[top] = entry;
                    top += 1;
                }
                continue;
            }
        }
        // The next subtree that does not begin behind the nearest hit.
        loop {
            if top == 0 {
                return;
            }
            top -= 1;
            next = stack[top];
            if next.near() <= search.t_far.max(0.0) {
                break;
            }
        }
    }
}

/// The nearer first.
#[inline(always)]
fn ordered(a: Entry, b: Entry) -> (Entry, Entry) {
    (Entry(a.0.min(b.0)), Entry(a.0.max(b.0)))
}

/// A ray made ready for boxes: along each axis, where it starts and one over its direction, and how far lower and upper sides give
/// way to it: by the rounding of what lies there and the slack of the boxes.
pub(in crate::structure) struct Slabs<S: Simd> {
    origin: Vec3,
    inv_direction: Vec3,
    give: Lanes3<f32x16<S>>,
}

impl<S: Simd> Slabs<S> {
    /// For nodes whose boxes lie in `bounds` and are grown by `slack`.
    #[inline(always)]
    pub(in crate::structure) fn new(
        simd: S,
        (bounds, slack): (Bounds, f32),
        ray: &Ray,
        inv_direction: Vec3,
    ) -> Self {
        let (Bounds { min, max }, origin) = (bounds, ray.origin);
        // No coordinate of a node lies farther: its 255 steps reach less than twice beyond its boxes.
        let farthest = (min - origin).abs().max((max - origin).abs()) + 2.0 * (max - min);
        let give = (HIT_ROUNDING * farthest + slack) * inv_direction;
        // The lower side comes earlier where the ray goes up, and later where it goes down.
        let sides = |give: f32| f32x8::splat(simd, -give).combine(f32x8::splat(simd, give));
        let give = Lanes3 { x: sides(give.x), y: sides(give.y), z: sides(give.z) };
        Self { origin, inv_direction, give }
    }

    /// Where the ray enters and leaves the child boxes, which it meets where the first is not behind the second.
    #[inline(always)]
    pub(in crate::structure) fn cross(&self, simd: S, node: &Node) -> (f32x8<S>, f32x8<S>) {
        let Self { origin, inv_direction, give } = self;
        let x = node.cross_axis(simd, 0, origin.x, inv_direction.x, give.x);
        let y = node.cross_axis(simd, 1, origin.y, inv_direction.y, give.y);
        let z = node.cross_axis(simd, 2, origin.z, inv_direction.z, give.z);
        (x.0.max(y.0).max(z.0), x.1.min(y.1).min(z.1))
    }
}

impl Node {
    /// Where a ray enters and leaves the slabs of the child boxes along one axis, in order; lower and upper sides are moved by `give`.
    #[inline(always)]
    fn cross_axis<S: Simd>(
        &self,
        simd: S,
        axis: usize,
        origin: f32,
        inv_direction: f32,
        give: f32x16<S>,
    ) -> (f32x8<S>, f32x8<S>) {
        let step = power_of_two(self.exponent[axis]) * inv_direction;
        let to_corner = (self.corner[axis] - origin) * inv_direction;
        let steps = floats_of_bytes(simd, &self.steps[axis]);
        let t = steps.mul_add(f32x16::splat(simd, step), give + f32x16::splat(simd, to_corner));
        let (lower, upper) = t.split();
        (lower.min(upper), lower.max(upper))
    }
}
