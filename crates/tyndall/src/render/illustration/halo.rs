//! Rims around what stands before something else, on what lies behind.
//!
//! Around each place at a silhouette a cone opens backwards in depth, as wide as the halo at the depth of the farthest; what lies behind its surface is in
//! the halo. So a rim is the wider and the stronger the further behind the next surface lies, and where things touch there is none. Sources: Everts,
//! Bekker, Roerdink, Isenberg 2009, Depth-Dependent Halos (lines whose rims are displaced in depth); Luft, Colditz, Deussen 2006, Image Enhancement by
//! Unsharp Masking the Depth Buffer (how strong by how deep).

use rayon::prelude::*;

use super::depths::Depths;
use super::fine::Fine;
use super::nearest::nearest;

/// How far behind the cone's surface a halo has its full strength, as a share of all depths.
const FULL: f32 = 0.2;
/// The least jump of depth that has a halo, in its widths: what is less is a fold of a surface.
const LEAST_JUMP: f32 = 0.1;

/// How far silhouettes are looked for around a place, for halos of `width` places.
pub(super) fn reach(width: f32) -> i32 {
    width.ceil() as i32
}

/// How strong the halo is at each place, 0 to 1; `width` is in places.
pub(super) fn strength(fine: &Fine, width: f32, depths: &Depths) -> Vec<f32> {
    let places = fine.depth.len();
    let silhouettes: Vec<f32> = (0..places)
        .into_par_iter()
        .map(|place| {
            let depth = fine.depth[place];
            let is_one = depth < f32::INFINITY && ends(fine, place, LEAST_JUMP * width);
            if is_one { depths.share(fine.silhouette(place)) } else { f32::INFINITY }
        })
        .collect();
    let cost = |offset: i32| (offset as f32 / width).powi(2);
    let cones = nearest(&silhouettes, fine.width(), reach(width), [&cost, &cost]);
    let strength = |(&depth, cone): (&f32, f32)| {
        let is_met = depth < f32::INFINITY;
        if is_met { ((depths.share(depth) - cone) / FULL).clamp(0.0, 1.0) } else { 0.0 }
    };
    fine.depth.par_iter().zip(cones).map(strength).collect()
}

/// Whether what a place shows ends there: a neighboring place shows something else, further away by more than so many edges of a place.
fn ends(fine: &Fine, place: usize, least: f32) -> bool {
    let (width, depth) = (fine.width(), fine.depth[place]);
    let column = place % width;
    let neighbors = [
        (column > 0).then(|| place - 1),
        (column + 1 < width).then(|| place + 1),
        place.checked_sub(width),
        Some(place + width).filter(|below| *below < fine.depth.len()),
    ];
    let beyond = depth + least * fine.edge_at(depth);
    neighbors.into_iter().flatten().any(|other| {
        fine.depth[other] > beyond
            && (fine.depth[other] == f32::INFINITY || fine.node[other] != fine.node[place])
    })
}
