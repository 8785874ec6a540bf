//! Culling by confidence on the CPU: a ray a sample, cut where its pixel is likely to be covered.
//!
//! A pass is a frame. In it each pixel knows only itself, and after it all decide from what all knew at its end, so that no result
//! depends on the order of work. A pixel whose depth is final asks for the first hit only; the others for every hit.

use rayon::prelude::*;

use super::pass::Pass;
use super::tiles::{BLOCKS, EDGE, RAYS, Tile, block_at};
use super::{FILM_EDGE, FILM_PIXELS, Film};
use crate::error::Result;
use crate::random::{hash4, unit_f32};
use crate::render::confidence::{Accumulator, DensityGrid, Histogram, Map, Options, Pixel, Report, share};
use crate::scene::Scene;
use crate::structure::Hit;

/// What all pixels of a picture know, and what they draw on.
pub(crate) struct Confidence {
    options: Options,
    grid: DensityGrid,
    accumulator: Accumulator,
    width: usize,
    height: usize,
    /// By film tile and pixel of it.
    tiles: Vec<[Pixel; FILM_PIXELS]>,
    /// Pixels of the picture whose depth is final.
    converged: usize,
}

/// What is the same for all tiles of a frame.
#[derive(Clone, Copy)]
pub(super) struct Frame<'a> {
    options: Options,
    grid: &'a DensityGrid,
    accumulator: &'a Accumulator,
    width: usize,
    height: usize,
}

impl Confidence {
    /// For pictures of `scene` on a film like `film`. Fails if the density grid would have too many voxels.
    pub(crate) fn new(scene: &Scene, film: &Film, options: Options) -> Result<Self> {
        Ok(Self {
            options,
            grid: DensityGrid::new(scene.structure(), options.voxel_count)?,
            accumulator: Accumulator::new(options.sample_budget, options.population),
            width: film.width as usize,
            height: film.height as usize,
            tiles: vec![[Pixel::NEW; FILM_PIXELS]; film.tiles.len()],
            converged: 0,
        })
    }

    /// Forgets what the pixels know, for another view.
    pub(crate) fn restart(&mut self) {
        self.tiles.fill([Pixel::NEW; FILM_PIXELS]);
        self.converged = 0;
    }

    /// Takes the depths at which rays end for final.
    pub(crate) fn settle(&mut self) {
        self.tiles.iter_mut().flatten().for_each(|pixel| pixel.unchanged = u32::MAX);
        self.converged = self.width * self.height;
    }

    /// What a frame's tiles share, and the pixels of each.
    pub(super) fn split(&mut self) -> (Frame<'_>, &mut [[Pixel; FILM_PIXELS]]) {
        let Self { options, grid, accumulator, width, height, tiles, .. } = self;
        (Frame { options: *options, grid, accumulator, width: *width, height: *height }, tiles)
    }

    /// Decides, after a frame of `samples` samples a pixel on `film`, where the rays of the next one end.
    pub(super) fn decide(&mut self, film: &Film, samples: u32) {
        if self.converged == self.width * self.height {
            return;
        }
        let (width, height, options) = (self.width, self.height, self.options);
        let mut pairs = vec![[0.0; 2]; width * height];
        for (tile, pixels) in film.tiles.iter().zip(&self.tiles) {
            let (left, top) = (tile.x as usize, tile.y as usize);
            let columns = FILM_EDGE.min(width - left);
            for (row, pixels) in (top..height).zip(pixels.chunks_exact(FILM_EDGE)) {
                let row = &mut pairs[row * width + left..][..columns];
                for (pair, pixel) in row.iter_mut().zip(pixels) {
                    *pair = [pixel.cull.depth, pixel.cull.confidence];
                }
            }
        }
        let map = Map::new(width, pairs, options.neighborhood);
        let tiles = film.tiles.par_iter().zip(&mut self.tiles);
        let converged = tiles.map(|(tile, pixels)| {
            let mut converged = 0;
            for (place, pixel) in pixels.iter_mut().enumerate() {
                let (x, y) = (tile.x as usize + place % FILM_EDGE, tile.y as usize + place / FILM_EDGE);
                if x >= width || y >= height {
                    continue;
                }
                if pixel.unchanged < options.convergence_samples {
                    pixel.unchanged = pixel.unchanged.saturating_add(samples);
                    if let Some(depth) = map.clip(x, y, &options).filter(|&depth| depth < pixel.clip) {
                        (pixel.clip, pixel.unchanged) = (depth, 0);
                    }
                }
                converged += usize::from(pixel.unchanged >= options.convergence_samples);
            }
            converged
        });
        self.converged = converged.sum();
    }

    /// How far it is, and what it takes.
    pub(crate) fn report(&self, film: &Film) -> Report {
        let mut depths = vec![f32::INFINITY; self.width * self.height];
        for (tile, pixels) in film.tiles.iter().zip(&self.tiles) {
            for (place, pixel) in pixels.iter().enumerate() {
                let (x, y) = (tile.x as usize + place % FILM_EDGE, tile.y as usize + place / FILM_EDGE);
                if x < self.width && y < self.height {
                    depths[y * self.width + x] = pixel.clip;
                }
            }
        }
        Report {
            depths,
            converged: self.converged as f64 / (self.width * self.height) as f64,
            voxels: self.grid.voxels(),
            grid_bytes: self.grid.bytes(),
            pixel_bytes: size_of_val(&self.tiles[..]) as u64,
        }
    }
}

/// Finds what every ray of a tile meets, and what its pixels learn from it. The tile lies at pixel `inside` of a film tile with these
/// `pixels`, whose upper left corner is pixel `corner` of the picture.
pub(super) fn trace(
    frame: &Frame,
    pass: &Pass,
    (corner, inside): ([usize; 2], [usize; 2]),
    pixels: &mut [Pixel; FILM_PIXELS],
    (tile, histogram): (&mut Tile, &mut Histogram),
) {
    let structure = pass.scene.structure();
    for block in 0..BLOCKS {
        let at = block_at(block % EDGE, block / EDGE);
        let first =
            (inside[1] + block / EDGE * pass.block_px) * FILM_EDGE + inside[0] + block % EDGE * pass.block_px;
        let mut marched = None;
        for lane in 0..RAYS {
            let place = first + pass.pixel[lane];
            let (x, y) = (corner[0] + place % FILM_EDGE, corner[1] + place / FILM_EDGE);
            if x >= frame.width || y >= frame.height {
                continue;
            }
            let pixel = &mut pixels[place];
            let mut ray = tile.ray(&pass.view, at, lane);
            // What is met at the depth itself is not behind it.
            ray.t_max = pixel.clip.next_up();
            let hit: Option<Hit> = if pixel.unchanged >= frame.options.convergence_samples {
                structure.intersect(&ray, None)
            } else {
                let view = &pass.view;
                let clip = ray.t_max;
                let cosine = if view.perspective { ray.direction.dot(view.forward) } else { 1.0 };
                let key = [x as u32, y as u32, pass.first + (lane % pass.samples) as u32];
                let mut number = 0;
                structure.hits(&ray, &mut |t, node| {
                    if marched != Some(place) {
                        marched = Some(place);
                        let mut center = view.ray(x as f32 + 0.5, y as f32 + 0.5);
                        center.t_max = clip;
                        histogram.march(frame.grid, view, &center, frame.options.density_interpolation);
                    }
                    let pixel_edge = if view.perspective { view.pixel * t * cosine } else { view.pixel };
                    let share = share(structure.sphere(node).1 / pixel_edge);
                    let depth = if frame.options.depth_quantization { histogram.back_of_slab(t) } else { t };
                    let [x, y, sample] = key;
                    let chance = || unit_f32(hash4([x | y << 16, sample, number, pass.seed])[0]);
                    frame.accumulator.add(pixel, histogram, depth, share, chance);
                    number += 1;
                })
            };
            if let Some(hit) = hit {
                (tile.depth[at][lane], tile.node[at][lane]) = (hit.t, hit.node);
            }
        }
    }
}
