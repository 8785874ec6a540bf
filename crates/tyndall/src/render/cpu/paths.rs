//! Paths from what the samples of a film tile met: a path a sample.

use fearless_simd::prelude::*;
use fearless_simd_macros::simd;
use glam::Vec3;

use super::hits::{Hits, PACKETS, pixel_of};
use super::tiles::RAYS;
use super::{FILM_EDGE, FilmTile, Pass};
use crate::math::Ray;
use crate::render::paths::{Sample, Tracer, through_lens};
use crate::scene::light::Paths;

/// Follows a path from each sample, and adds its light to the film. Behind a lens rays are other ones, so that only depths and nodes are those of
/// the samples.
#[simd]
pub(super) fn light<S: Simd>(simd: S, pass: &Pass, paths: &Paths, film_tile: &mut FilmTile, hits: &Hits) {
    let tracer = Tracer::new(pass.secondary, paths);
    let corner = [film_tile.x as usize, film_tile.y as usize];
    for sample in 0..pass.samples {
        for packet in 0..PACKETS {
            let at = packet * pass.samples + sample;
            let varying = pass.packet_rays(simd, corner.into(), packet, sample).to_arrays();
            for lane in 0..RAYS {
                let pixel = pixel_of(packet, lane);
                let place = [pixel % FILM_EDGE + corner[0], pixel / FILM_EDGE + corner[1]];
                let number = pass.first + sample as u32;
                let sample = Sample { seed: pass.seed, pixel: place.map(|at| at as u32), number };
                let varying = Vec3::from(varying.map(|axis| axis[lane]));
                let (origin, direction) = if pass.view.perspective {
                    (pass.view.eye, varying)
                } else {
                    (varying, pass.view.forward)
                };
                let mut ray = Ray { origin, direction, t_min: 0.0, t_max: f32::INFINITY };
                let depth = hits.depth[at][lane];
                let mut met = (depth < f32::INFINITY).then_some((depth, hits.node[at][lane]));
                if let Some(lens) = &paths.lens {
                    ray = through_lens(&pass.view, lens, &ray, sample);
                    met = pass.secondary.meet(&ray).filter(|met| !pass.scene.is_holdout(met.1));
                }
                let light = match met {
                    Some(met) => Some(tracer.radiance(&ray, met, sample)),
                    None => tracer.behind(ray.direction),
                };
                let Some(light) = light else { continue };
                for (sum, light) in film_tile.sum[pixel].iter_mut().zip([light.x, light.y, light.z, 1.0]) {
                    *sum += light;
                }
            }
        }
    }
}
