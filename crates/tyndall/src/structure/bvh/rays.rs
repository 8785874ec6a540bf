//! Single rays through the hierarchy: nearest hit and any hit, for picking and for light that has no common direction.

use fearless_simd::{Level, dispatch, f32x8, prelude::*};
use fearless_simd_macros::simd;

use super::{Bvh, LEAF};
use crate::math::Ray;
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
        search.found()
    }
}

/// More entries than the deepest hierarchy of 2^32 particles can leave on the stack.
const STACK: usize = 128;

#[simd]
fn walk<S: Simd, O: Observer>(simd: S, bvh: &Bvh, search: &mut Search<O>) {
    let Some(root) = bvh.root() else { return };
    let ray = *search.ray();
    let mut stack = [(0.0_f32, root); STACK];
    let mut top = 1;
    while top > 0 {
        top -= 1;
        let (near, place) = stack[top];
        if near > search.t_far {
            continue;
        }
        if place.level == 0 {
            let leaf = place.index as usize;
            search.visit(0, LEAF as u64);
            let (t, mut met) = search.enter(simd, bvh.centers(simd, leaf), bvh.radii(simd, leaf));
            while met != 0 {
                let lane = met.trailing_zeros() as usize;
                met &= met - 1;
                if search.meet(t[lane], (leaf * LEAF + lane) as u32, &bvh.ids) {
                    return;
                }
            }
            continue;
        }
        // Meet the eight boxes at once.
        search.visit(1, 0);
        let (enter, leave) = bvh.node(place).cross(simd, &ray, search.inv_direction, bvh.slack);
        let enter = enter.max(f32x8::splat(simd, ray.t_min));
        let leave = leave.min(f32x8::splat(simd, search.t_far));
        let mut kept = enter.simd_le(leave).to_bitmask() as u32 & bvh.existing(place);
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
