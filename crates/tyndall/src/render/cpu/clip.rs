//! Single rays that are clipped, and go on behind the clip where they found nothing.
//!
//! Of `m` samples of a pixel that were drawn alike, the next is deeper than the `k`-th largest of them with probability `k / (m + 1)`,
//! whatever the scene: no density, no footprint and no threshold enters. A ray ends there; one that has met nothing goes on behind,
//! so that it finds what it would have found without the clip. The two parts of a ray share no distance and leave none out.

use super::Pass;
use super::tiles::{RAYS, Tile};
use crate::math::Ray;
use crate::render::certified::Counts;
use crate::structure::{Hit, Structure};

/// Finds what the rays of a block meet.
pub(super) fn find_block(pass: &Pass, block: usize, tile: &mut Tile, counts: &mut Counts) {
    let structure = pass.scene.structure();
    for lane in 0..RAYS {
        let ray = tile.ray(&pass.view, block, lane);
        let is_plain = pass.scene.cut().is_none() && pass.scene.shapes().is_none();
        if !is_plain && asks_single_rays(pass) {
            if let Some(met) = pass.scene.meet(&ray) {
                (tile.depth[block][lane], tile.node[block][lane]) = met;
            }
            continue;
        }
        // The samples of a pixel lie side by side; the deepest of those before is the clip.
        let earlier = &tile.depth[block][lane - lane % pass.samples..lane];
        let clip = earlier.iter().copied().fold(0.0, f32::max);
        let hit = if pass.certified.clip && clip > 0.0 && clip < f32::INFINITY {
            counts.clipped_rays += 1;
            intersect(structure, &ray, clip, &mut counts.resumed_rays)
        } else {
            structure.intersect(&ray, None)
        };
        if let Some(hit) = hit {
            tile.depth[block][lane] = hit.t;
            tile.node[block][lane] = hit.node;
        }
    }
}

/// Whether each ray of a picture is asked by itself: no plane holds a panorama, and no cap is in a box.
pub(super) fn asks_single_rays(pass: &Pass) -> bool {
    pass.view.panorama || pass.scene.cut().is_some()
}

/// What the ray meets first, looked for up to `clip` and then behind it.
fn intersect(structure: &Structure, ray: &Ray, clip: f32, resumed: &mut u64) -> Option<Hit> {
    // A ray's interval is open: up to and with `clip`, then beyond.
    structure.intersect(&Ray { t_max: clip.next_up().min(ray.t_max), ..*ray }, None).or_else(|| {
        *resumed += 1;
        structure.intersect(&Ray { t_min: clip.max(ray.t_min), ..*ray }, None)
    })
}
