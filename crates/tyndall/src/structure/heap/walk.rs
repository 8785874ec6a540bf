//! A single ray through a heap: near before far, the particles of four levels at a time.

use fearless_simd::{f32x4, f32x8, f32x16, prelude::*};
use fearless_simd_macros::simd;

use super::{Columns, Heap, LOWEST, Order, upper_levels};
use crate::math::HIT_ROUNDING;
use crate::simd::Lanes3;
use crate::structure::search::{Observer, Search};

/// A subtree that is still to be walked.
#[derive(Clone, Copy)]
struct Region {
    node: u32,
    /// Levels below it, without the lowest.
    levels: u16,
    /// Whether only the node's own particle is left to test.
    test_only: bool,
    /// Where along the ray its particles can be met.
    t_near: f32,
    t_far: f32,
}

impl Region {
    const NONE: Self = Self { node: 0, levels: 0, test_only: false, t_near: 0.0, t_far: 0.0 };
}

/// Two entries a level, of 32 levels.
pub(in crate::structure) struct Stack([Region; 64]);

impl Default for Stack {
    #[inline(always)]
    fn default() -> Self {
        Self([Region::NONE; 64])
    }
}

/// Looks for particles among the `count` of `heap`; whether the search is over. `slack` is the rounding of their coordinates.
#[simd]
pub(in crate::structure) fn walk<S: Simd, O: Observer>(
    simd: S,
    columns: &Columns,
    (heap, count): (&Heap, usize),
    slack: f32,
    order: Order,
    search: &mut Search<O>,
    stack: &mut Stack,
) -> bool {
    if count == 0 {
        return false;
    }
    let first = heap.first as usize;
    let axes = &columns.axes[first / 8..];
    let inv_direction = search.inv_direction;
    let ray = *search.ray();
    let farthest = (heap.centers.center() - ray.origin).abs() + heap.centers.extent();
    let margin = columns.radius_scale * heap.radius * (1.0 + HIT_ROUNDING)
        + HIT_ROUNDING * farthest.max_element()
        + slack;
    let t_margin = (margin * inv_direction).abs().to_array();
    let grown = heap.centers.grown(margin);
    let (to_min, to_max) =
        ((grown.min - ray.origin) * inv_direction, (grown.max - ray.origin) * inv_direction);
    let (origin, inv_direction) = (ray.origin.to_array(), inv_direction.to_array());
    let levels = upper_levels(count) as u16;
    let mut region = Region {
        levels,
        t_near: to_min.min(to_max).max_element().max(search.t_from),
        t_far: to_min.max(to_max).min_element(),
        ..Region::NONE
    };
    let mut top = 0;
    loop {
        let place = first + region.node as usize;
        // Regions of the lowest levels may lie behind the last particle.
        let is_shown = region.node as usize >= count || columns.shows_any(place);
        if region.t_near <= region.t_far && region.t_near <= search.t_far && is_shown {
            search.visit(1, 0);
            // Nodes are tried before their children, those of four levels together: some of the topmost twice, which changes
            // nothing, unless every hit is to be told once.
            let left_over = u32::from(region.levels) % LOWEST;
            let is_first = left_over == 0 || region.levels == levels;
            if region.levels == 0 || (is_first && order == Order::NodeFirst) {
                let levels = if left_over == 0 { LOWEST } else { left_over };
                let node = region.node as usize;
                if try_four_levels(simd, columns, (first, count), node, levels, search) {
                    return true;
                }
            } else if region.test_only {
                search.visit(0, 1);
                let (center, radius) = columns.sphere(place as u32);
                if columns.shows(place) && search.try_one(center, radius, place as u32, &columns.ids) {
                    return true;
                }
            }
            if region.levels > 0 && !region.test_only {
                let axis = (axes[region.node as usize] as usize).min(2);
                let t_split = (columns.center[axis][place] - origin[axis]) * inv_direction[axis];
                let near_is_right = u32::from(inv_direction[axis] < 0.0);
                let (left, levels) = (2 * region.node + 1, region.levels - 1);
                // The near side ends a margin behind the plane, the far side begins a margin before it.
                let near_end = region.t_far.min(t_split + t_margin[axis]);
                let far_begin = region.t_near.max(t_split - t_margin[axis]);
                // The last one pushed is walked first.
                if far_begin <= region.t_far && far_begin <= search.t_far {
                    stack.0[top] =
                        Region { node: left + 1 - near_is_right, levels, t_near: far_begin, ..region };
                    top += 1;
                }
                if order == Order::NearChildFirst {
                    stack.0[top] = Region { test_only: true, ..region };
                    top += 1;
                }
                region = Region { node: left + near_is_right, levels, t_far: near_end, ..region };
                continue;
            }
        }
        if top == 0 {
            return false;
        }
        top -= 1;
        region = stack.0[top];
    }
}

/// Tries the particles of four levels from `node` down at once, of `levels` if every hit is to be told once; whether the search is
/// over.
#[simd]
fn try_four_levels<S: Simd, O: Observer>(
    simd: S,
    columns: &Columns,
    (first, count): (usize, usize),
    node: usize,
    levels: u32,
    search: &mut Search<O>,
) -> bool {
    // Each level of the subtree is a run, of which a part may lie behind the end.
    let starts = [8 * node + 7, 4 * node + 3, 2 * node + 1, node].map(|start| first + start.min(count));
    let [x, y, z] = &columns.center;
    let center = Lanes3 { x: lanes(simd, x, starts), y: lanes(simd, y, starts), z: lanes(simd, z, starts) };
    let radius = match columns.radii.is_empty() {
        true => f32x16::splat(simd, columns.uniform),
        false => lanes(simd, &columns.radii, starts),
    };
    let (t, met) = search.enter(simd, center, radius * f32x16::splat(simd, columns.radius_scale));
    let existing = |start: usize, width: usize| (1u32 << (first + count - start).min(width)) - 1;
    let existing = existing(starts[0], 8)
        | existing(starts[1], 4) << 8
        | existing(starts[2], 2) << 12
        | existing(starts[3], 1) << 14;
    // The lanes of the upper levels are 1, 3, 7 or 15 from the last down.
    let upper = 0x7fff & !(0x7fff >> ((1u32 << levels) - 1));
    let tried = if O::EVERY { existing & upper } else { existing };
    search.visit(0, u64::from(tried.count_ones()));
    let mut met = met & tried;
    while met != 0 {
        let lane = met.trailing_zeros() as usize;
        met &= met - 1;
        let place = match lane {
            0..8 => starts[0] + lane,
            8..12 => starts[1] + lane - 8,
            12..14 => starts[2] + lane - 12,
            _ => starts[3],
        };
        if columns.shows(place) && search.meet(t[lane], place as u32, &columns.ids) {
            return true;
        }
    }
    false
}

/// Eight values of a column from the first start on, four from the second, two from the third, one from the fourth.
#[inline(always)]
fn lanes<S: Simd>(simd: S, column: &[f32], starts: [usize; 4]) -> f32x16<S> {
    let eight = f32x8::from_slice(simd, &column[starts[0]..starts[0] + 8]);
    let four = f32x4::from_slice(simd, &column[starts[1]..starts[1] + 4]);
    let pair = &column[starts[2]..starts[2] + 2];
    let rest = f32x4::load_array(simd, [pair[0], pair[1], column[starts[3]], f32::NAN]);
    eight.combine(four.combine(rest))
}
