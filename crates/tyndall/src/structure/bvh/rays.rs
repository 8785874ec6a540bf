//! Single rays through the hierarchy: nearest hit and any hit, for picking and for light that has no common direction.

use fearless_simd::{Level, dispatch, f32x8, f32x16, prelude::*};
use fearless_simd_macros::simd;

use super::{Bvh, LEAF};
use crate::math::Ray;
use crate::simd::{Lanes3, enter_sphere};
use crate::structure::Hit;

impl Bvh {
    /// See [`crate::structure::Structure::intersect`].
    pub fn intersect(&self, ray: &Ray, except: Option<u32>) -> Option<Hit> {
        let mut best = None;
        dispatch!(Level::new(), simd => walk(simd, self, ray, except, Wanted::Nearest(&mut best)));
        best
    }

    /// See [`crate::structure::Structure::occluded`].
    pub fn occluded(&self, ray: &Ray, except: Option<u32>) -> bool {
        let mut found = false;
        dispatch!(Level::new(), simd => walk(simd, self, ray, except, Wanted::Any(&mut found)));
        found
    }
}

/// What a walk looks for, and where it puts it.
enum Wanted<'a> {
    Nearest(&'a mut Option<Hit>),
    Any(&'a mut bool),
}

/// More entries than the deepest hierarchy of 2^32 particles can leave on the stack.
const STACK: usize = 128;

#[simd]
fn walk<S: Simd>(simd: S, bvh: &Bvh, ray: &Ray, except: Option<u32>, mut wanted: Wanted) {
    let Some(root) = bvh.root() else { return };
    let inv_direction = ray.inv_direction();
    let mut t_far = ray.t_max;
    let mut stack = [(0.0_f32, root); STACK];
    let mut top = 1;
    while top > 0 {
        top -= 1;
        let (near, place) = stack[top];
        if near > t_far {
            continue;
        }
        if place.level == 0 {
            let leaf = place.index as usize;
            let (t, mut met) = enter_leaf(simd, bvh, leaf, ray, t_far);
            met &= bvh.shown(leaf);
            if let Some(except) = except.filter(|&except| except as usize / LEAF == leaf) {
                met &= !(1 << (except as usize % LEAF));
            }
            match &mut wanted {
                Wanted::Any(found) if met != 0 => {
                    **found = true;
                    return;
                }
                Wanted::Nearest(best) => {
                    while met != 0 {
                        let lane = met.trailing_zeros() as usize;
                        met &= met - 1;
                        let node = (leaf * LEAF + lane) as u32;
                        Hit::keep_nearer(best, t[lane], node, &bvh.ids);
                        // Clip the ray to the nearest hit: what is behind it is hidden.
                        t_far = t_far.min(t[lane]);
                    }
                }
                Wanted::Any(_) => {}
            }
            continue;
        }
        // Meet the eight boxes at once.
        let (enter, leave) = bvh.node(place).cross(simd, ray, inv_direction, bvh.slack);
        let enter = enter.max(f32x8::splat(simd, ray.t_min));
        let leave = leave.min(f32x8::splat(simd, t_far));
        let mut kept = enter.simd_le(leave).to_bitmask() as u32 & bvh.shown_children(place);
        let enter = enter.to_array();
        let first = top;
        while kept != 0 {
            let child = kept.trailing_zeros() as usize;
            kept &= kept - 1;
            // Insertion sort: far before near, so that the nearest is popped first.
            let mut slot = top;
            while slot > first && stack[slot - 1].0 < enter[child] {
                stack[slot] = stack[slot - 1];
                slot -= 1;
            }
            stack[slot] = (enter[child], bvh.child(place, child));
            top += 1;
        }
    }
}

/// Where the ray enters each of the sixteen particles, and which it enters not behind `t_far`. [`crate::math::enter_sphere`] on lanes.
#[simd]
fn enter_leaf<S: Simd>(simd: S, bvh: &Bvh, leaf: usize, ray: &Ray, t_far: f32) -> ([f32; LEAF], u32) {
    let radius = bvh.radii(simd, leaf);
    let to_center = bvh.centers(simd, leaf).minus(Lanes3::splat(simd, ray.origin));
    let (t, meets) = enter_sphere(simd, to_center, Lanes3::splat(simd, ray.direction), radius * radius);
    let (t_min, t_max) = (f32x16::splat(simd, ray.t_min), f32x16::splat(simd, ray.t_max));
    let met = meets & t_min.simd_lt(t) & t.simd_lt(t_max) & t.simd_le(f32x16::splat(simd, t_far));
    (t.to_array(), met.to_bitmask() as u32)
}
