//! How far away things are, from the nearest to the farthest.

use rayon::prelude::*;

use super::fine::Fine;
use crate::error::Result;
use crate::film::Window;
use crate::render::{Culling, Settings};
use crate::scene::Scene;
use crate::scene::camera::Camera;

/// Pixels along the longer edge of the picture in which nearest and farthest are looked for.
const LOOKED_AT: f32 = 512.0;

/// Depths from 0 to 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Depths {
    near: f32,
    far: f32,
}

impl Depths {
    /// From the first of the depths that are given to the second; else from the nearest to the farthest that a coarse picture of `size` shows: the same
    /// for all parts of a picture. Fails as [`crate::render::Renderer::new`] does.
    pub(super) fn of(
        given: Option<[f32; 2]>,
        (scene, camera): (&Scene, &Camera),
        size: [u32; 2],
    ) -> Result<Self> {
        if let Some([near, far]) = given {
            return Ok(Self { near, far });
        }
        let scale = (LOOKED_AT / size[0].max(size[1]) as f32).min(1.0);
        let [width, height] = size.map(|edge| ((edge as f32 * scale).round() as u32).max(1));
        let settings = Settings { width, height, samples: 1, seed: 0, culling: Culling::Off };
        let fine = Fine::of((scene, camera), &settings, Window::whole(width, height))?;
        let depths = || fine.depth.par_iter().copied().filter(|depth| *depth < f32::INFINITY);
        let near = depths().reduce(|| f32::INFINITY, f32::min);
        let far = depths().reduce(|| 0.0, f32::max);
        Ok(Self { near, far })
    }

    /// 0 for what is as near as the nearest, 1 for what is as far as the farthest, or further.
    pub(super) fn share(&self, depth: f32) -> f32 {
        let all = self.far - self.near;
        if all > 0.0 { ((depth - self.near) / all).clamp(0.0, 1.0) } else { 0.0 }
    }
}
