//! Statistics of the normals and colors that the kept samples of each pixel met.

use fearless_simd::{Level, dispatch, prelude::*};
use fearless_simd_macros::simd;
use rayon::prelude::*;

use super::hits::{Hits, PACKETS, pixel_of};
use super::surfaces::look_up;
use super::tiles::RAYS;
use super::{FILM_EDGE, FILM_PIXELS, Film, Pass};
use crate::render::normals::NormalStatistics;

/// Of every pixel, row by row, by what `kept` kept in the same passes.
pub(crate) fn statistics(kept: &Film, passes: &[Pass], level: Level) -> Vec<NormalStatistics> {
    let (window, edge) = (kept.window, FILM_EDGE as u32);
    let tiles: Vec<Vec<NormalStatistics>> = kept
        .tiles
        .par_iter()
        .zip(&kept.kept)
        .map(|(tile, hits)| {
            let mut sums = vec![NormalStatistics::default(); FILM_PIXELS];
            let corner = (tile.x as usize, tile.y as usize);
            for (pass, hits) in passes.iter().zip(hits) {
                dispatch!(level, simd => add(simd, pass, corner, hits, &mut sums));
            }
            sums.iter_mut().for_each(|sum| sum.finish(passes.iter().map(|pass| pass.samples).sum()));
            sums
        })
        .collect();
    let mut all = vec![NormalStatistics::default(); kept.pixels() as usize];
    for (tile, sums) in kept.tiles.iter().zip(tiles) {
        let (start, end) = (tile.x.max(window.x), (tile.x + edge).min(window.x + window.width));
        for y in tile.y.max(window.y)..(tile.y + edge).min(window.y + window.height) {
            let to = ((y - window.y) * window.width + start - window.x) as usize;
            let from = ((y - tile.y) * edge + start - tile.x) as usize;
            let columns = (end - start) as usize;
            all[to..to + columns].copy_from_slice(&sums[from..from + columns]);
        }
    }
    all
}

#[simd]
fn add<S: Simd>(simd: S, pass: &Pass, corner: (usize, usize), hits: &Hits, sums: &mut [NormalStatistics]) {
    for packet in 0..PACKETS {
        for sample in 0..pass.samples {
            let at = packet * pass.samples + sample;
            let rays = pass.packet_rays(simd, corner, packet, sample);
            let found = (&hits.depth[at], &hits.node[at]);
            let Some(met) = look_up(simd, pass.scene, &pass.view, found, rays) else { continue };
            let (normal, color) = (met.normal.to_arrays(), met.color.to_arrays());
            let bits = met.hits.to_bitmask();
            for lane in 0..RAYS {
                if bits >> lane & 1 == 1 {
                    let of = |lanes: &[[f32; RAYS]; 3]| [lanes[0][lane], lanes[1][lane], lanes[2][lane]];
                    sums[pixel_of(packet, lane)].add(of(&normal), of(&color));
                }
            }
        }
    }
}
