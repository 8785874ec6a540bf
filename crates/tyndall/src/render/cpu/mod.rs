//! The CPU: threads over tiles of the film, and what happens in a tile.
//!
//! A film tile of 32 x 32 pixels is the unit of work. A pass finds what its rays meet (the tile sample buffer of `tiles` for the
//! hierarchy, a ray each for other structures), then lights it, sixteen pixels of one class at a time.

mod shadows;
mod tiles;

use fearless_simd::{Level, Simd, dispatch, f32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::Vec3;
use rayon::prelude::*;

use super::sampling::{Dimension, point};
use super::shade::{CLASSES, LightSample, class, key_radiance, light_sample, sky_radiance};
use crate::film::Image;
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::camera::View;
use crate::scene::light::Lighting;
use crate::simd::Lanes3;
use crate::structure::Structure;
use shadows::Points;
use tiles::{BLOCKS, Beam, EDGE, Entry, RAYS, Tile, block_at};

/// Pixels along the edge of a film tile.
const FILM_EDGE: usize = 32;
const FILM_PIXELS: usize = FILM_EDGE * FILM_EDGE;
/// Pixels along the edge of the pattern in which samples and light directions repeat.
const PATTERN: usize = 8;

/// The sums of samples of 32 x 32 pixels.
struct FilmTile {
    /// Place in pixels of the upper left corner.
    x: u32,
    y: u32,
    /// Sum of the light of samples that met a particle, and their number.
    sum: [[f32; 4]; FILM_PIXELS],
    /// What the sample nearest the pixel's center met, and that sample's squared distance from it.
    depth: [f32; FILM_PIXELS],
    id: [u32; FILM_PIXELS],
    nearest_sq: [f32; FILM_PIXELS],
}

/// Samples gathered so far.
pub(crate) struct Film {
    width: u32,
    height: u32,
    tiles: Vec<FilmTile>,
}

impl Film {
    /// Without samples. Tiles lie along a Morton curve, so that neighbors in time are neighbors in the picture.
    pub(crate) fn new(width: u32, height: u32) -> Self {
        let across = width.div_ceil(FILM_EDGE as u32);
        let down = height.div_ceil(FILM_EDGE as u32);
        let mut corners: Vec<(u32, u32)> = (0..down).flat_map(|y| (0..across).map(move |x| (x, y))).collect();
        corners.sort_by_key(|&(x, y)| {
            (0..16).fold(0_u64, |key, bit| {
                key | u64::from(x >> bit & 1) << (2 * bit) | u64::from(y >> bit & 1) << (2 * bit + 1)
            })
        });
        let tiles = corners.into_iter().map(|(x, y)| FilmTile {
            x: x * FILM_EDGE as u32,
            y: y * FILM_EDGE as u32,
            sum: [[0.0; 4]; FILM_PIXELS],
            depth: [f32::INFINITY; FILM_PIXELS],
            id: [0; FILM_PIXELS],
            nearest_sq: [f32::INFINITY; FILM_PIXELS],
        });
        Self { width, height, tiles: tiles.collect() }
    }

    /// The mean of `samples` samples a pixel, over the scene's background.
    pub(crate) fn image(&self, scene: &Scene, samples: u32) -> Image {
        let pixels = self.width as usize * self.height as usize;
        let mut color = vec![[0.0; 4]; pixels];
        let mut depth = vec![f32::INFINITY; pixels];
        let mut id = vec![-1; pixels];
        let inv_samples = 1.0 / samples.max(1) as f32;
        for tile in &self.tiles {
            for pixel in 0..FILM_PIXELS {
                let x = tile.x as usize + pixel % FILM_EDGE;
                let y = tile.y as usize + pixel / FILM_EDGE;
                if x >= self.width as usize || y >= self.height as usize {
                    continue;
                }
                let at = y * self.width as usize + x;
                let [r, g, b, count] = tile.sum[pixel].map(|sum| sum * inv_samples);
                color[at] = match scene.background {
                    Some(back) => {
                        let open = 1.0 - count;
                        [r + open * back[0], g + open * back[1], b + open * back[2], 1.0]
                    }
                    None => [r, g, b, count],
                };
                depth[at] = tile.depth[pixel];
                if depth[at] < f32::INFINITY {
                    id[at] = scene.spheres.particles.place(tile.id[pixel] as usize) as i64;
                }
            }
        }
        Image { width: self.width, height: self.height, color, depth, id }
    }
}

/// What all tiles of a pass have in common.
pub(crate) struct Pass<'a> {
    scene: &'a Scene<'a>,
    view: View,
    /// Samples a pixel: 16, 4 or 1.
    samples: usize,
    /// Pixels along the edge of a block of sixteen rays.
    block_px: usize,
    /// Where in its pixel each sample lies, by pixel of the pattern.
    offsets: Vec<[[f32; 2]; RAYS]>,
    /// Light directions by sample and class.
    lights: Vec<[LightSample; CLASSES]>,
}

impl<'a> Pass<'a> {
    /// Samples `first..first + count` of every pixel; `count` is 16, 4 or 1.
    pub(crate) fn new(
        scene: &'a Scene<'a>,
        view: View,
        seed: u32,
        first: u32,
        count: u32,
        centered: bool,
    ) -> Self {
        let samples = count as usize;
        let offset = |pixel: usize, sample: usize| {
            if centered || sample >= samples {
                [0.5; 2]
            } else {
                point(seed, Dimension::Pixel, 1 + pixel as u32, first + sample as u32)
            }
        };
        let offsets =
            (0..PATTERN * PATTERN).map(|pixel| std::array::from_fn(|sample| offset(pixel, sample))).collect();
        let lights = match &scene.lighting {
            Lighting::Studio(key, _) => (first..first + count)
                .map(|sample| std::array::from_fn(|class| light_sample(key, seed, sample, class as u32)))
                .collect(),
            _ => Vec::new(),
        };
        let block_px = match samples {
            1 => 4,
            4 => 2,
            _ => 1,
        };
        Self { scene, view, samples, block_px, offsets, lights }
    }

    /// Block and lane of a sample of the tile's pixel (x, y).
    #[inline(always)]
    fn slot(&self, x: usize, y: usize, sample: usize) -> (usize, usize) {
        let px = self.block_px;
        (block_at(x / px, y / px), ((y % px) * px + x % px) * self.samples + sample)
    }
}

/// What a thread keeps from tile to tile.
struct Scratch {
    tile: Box<Tile>,
    stack: Vec<Entry>,
    shadow_stack: Vec<shadows::Entry>,
}

/// Adds a pass to the film. The only place where threads appear: each takes film tiles until none is left.
pub(crate) fn for_each_tile(film: &mut Film, pass: &Pass, level: Level, progress: &dyn Progress) {
    let (width, height) = (film.width, film.height);
    let scratch = || Scratch { tile: Tile::new(), stack: Vec::new(), shadow_stack: Vec::new() };
    film.tiles.par_iter_mut().for_each_init(scratch, |scratch, film_tile| {
        if progress.cancelled() {
            return;
        }
        dispatch!(level, simd => render_film_tile(simd, pass, film_tile, scratch));
        let columns = (width - film_tile.x).min(FILM_EDGE as u32);
        let rows = (height - film_tile.y).min(FILM_EDGE as u32);
        progress.advance(columns as u64 * rows as u64 * pass.samples as u64);
    });
}

#[simd]
fn render_film_tile<S: Simd>(simd: S, pass: &Pass, film_tile: &mut FilmTile, scratch: &mut Scratch) {
    let tile_px = EDGE * pass.block_px;
    for y in (0..FILM_EDGE).step_by(tile_px) {
        for x in (0..FILM_EDGE).step_by(tile_px) {
            let corner = (film_tile.x as usize + x, film_tile.y as usize + y);
            find_hits(simd, pass, corner, scratch);
            for sample in 0..pass.samples {
                for area_y in (0..tile_px).step_by(PATTERN) {
                    for area_x in (0..tile_px).step_by(PATTERN) {
                        for class in 0..CLASSES {
                            shade_class(
                                simd,
                                pass,
                                (area_x, area_y),
                                sample,
                                class,
                                (x, y),
                                film_tile,
                                scratch,
                            );
                        }
                    }
                }
            }
        }
    }
}

/// Finds what every ray of the tile at pixel `corner` meets.
#[simd]
fn find_hits<S: Simd>(simd: S, pass: &Pass, corner: (usize, usize), scratch: &mut Scratch) {
    let tile = &mut scratch.tile;
    tile.clear();
    set_rays(simd, pass, corner, tile);
    match &pass.scene.structure {
        Structure::Bvh(bvh) => {
            let beam = Beam::new(&pass.view, corner.0 as f32, corner.1 as f32, pass.block_px as f32);
            tiles::walk(simd, bvh, &pass.view, &beam, tile, &mut scratch.stack);
        }
        structure => {
            for block in 0..BLOCKS {
                for lane in 0..RAYS {
                    if let Some(hit) = structure.intersect(&tile.ray(&pass.view, block, lane), None) {
                        tile.depth[block][lane] = hit.t;
                        tile.id[block][lane] = hit.id;
                    }
                }
            }
        }
    }
}

/// Sets the tile's rays: [`View::ray`] on lanes.
#[simd]
fn set_rays<S: Simd>(simd: S, pass: &Pass, corner: (usize, usize), tile: &mut Tile) {
    let (px, samples, view) = (pass.block_px, pass.samples, &pass.view);
    for block_y in 0..EDGE {
        for block_x in 0..EDGE {
            let mut x = [0.0; RAYS];
            let mut y = [0.0; RAYS];
            for lane in 0..RAYS {
                let (pixel, sample) = (lane / samples, lane % samples);
                let (column, row) = (block_x * px + pixel % px, block_y * px + pixel / px);
                let offset = pass.offsets[row % PATTERN * PATTERN + column % PATTERN][sample];
                x[lane] = (corner.0 + column) as f32 + offset[0];
                y[lane] = (corner.1 + row) as f32 + offset[1];
            }
            let u = f32x16::load_array(simd, x) * view.pixel + view.left;
            let v = f32x16::splat(simd, view.top) - f32x16::load_array(simd, y) * view.pixel;
            let across = Lanes3 {
                x: u * view.right.x + v * view.up.x,
                y: u * view.right.y + v * view.up.y,
                z: u * view.right.z + v * view.up.z,
            };
            let base = if view.perspective { view.forward } else { view.eye };
            let mut varying = Lanes3 { x: across.x + base.x, y: across.y + base.y, z: across.z + base.z };
            if view.perspective {
                varying = varying.times(f32x16::splat(simd, 1.0) / varying.dot(varying).sqrt());
            }
            varying.store(&mut tile.varying[block_at(block_x, block_y)]);
        }
    }
}

/// Lights what one sample of the sixteen pixels of a class met, in the 8 x 8 area at `area` of the tile, and adds it to the film;
/// the tile lies at `corner` of the film tile.
#[simd]
#[expect(clippy::too_many_arguments, reason = "the loops around it stand in one place")]
fn shade_class<S: Simd>(
    simd: S,
    pass: &Pass,
    area: (usize, usize),
    sample: usize,
    class_: usize,
    corner: (usize, usize),
    film_tile: &mut FilmTile,
    scratch: &mut Scratch,
) {
    let scene = pass.scene;
    let mut hits = 0_u32;
    let mut color = [Vec3::ZERO; RAYS];
    let mut normal = [Vec3::ZERO; RAYS];
    let mut points = Points { position: [[0.0; RAYS]; 3], on: [u32::MAX; RAYS] };
    let mut brightness = [1.0_f32; RAYS];
    let pixel_of = |lane: usize| (area.0 + lane % 4 * 2 + class_ % 2, area.1 + lane / 4 * 2 + class_ / 2);

    // What was met: color, place and normal.
    for lane in 0..RAYS {
        let (x, y) = pixel_of(lane);
        let (block, ray_lane) = pass.slot(x, y, sample);
        let t = scratch.tile.depth[block][ray_lane];
        let id = scratch.tile.id[block][ray_lane];
        let pixel = (corner.1 + y) * FILM_EDGE + corner.0 + x;
        let offset = pass.offsets[y % PATTERN * PATTERN + x % PATTERN][sample];
        let center_sq = (offset[0] - 0.5).powi(2) + (offset[1] - 0.5).powi(2);
        if center_sq < film_tile.nearest_sq[pixel] {
            film_tile.nearest_sq[pixel] = center_sq;
            film_tile.depth[pixel] = t;
            film_tile.id[pixel] = id;
        }
        if t == f32::INFINITY {
            continue;
        }
        hits |= 1 << lane;
        color[lane] = Vec3::from_array(scene.colors.color(id as usize));
        if scene.lighting == Lighting::Flat {
            continue;
        }
        let ray = scratch.tile.ray(&pass.view, block, ray_lane);
        let center = scene.spheres.center(id as usize);
        normal[lane] = (ray.origin + t * ray.direction - center).normalize_or(-ray.direction);
        let position = center + scene.spheres.radius(id as usize) * normal[lane];
        for axis in 0..3 {
            points.position[axis][lane] = position[axis];
        }
        points.on[lane] = id;
        brightness[lane] = normal[lane].dot(-ray.direction).max(0.0);
    }
    if hits == 0 {
        return;
    }

    // How it is lit.
    if let Lighting::Studio(key, sky) = &scene.lighting {
        let light = &pass.lights[sample][class_];
        brightness = [0.0; RAYS];
        for (toward, radiance) in [
            (light.key, &(|normal| key_radiance(key, light, normal)) as &dyn Fn(Vec3) -> f32),
            (light.sky, &|normal| sky_radiance(sky, light, normal)),
        ] {
            let facing = (0..RAYS).filter(|&lane| hits >> lane & 1 == 1 && normal[lane].dot(toward) > 0.0);
            let facing = facing.fold(0, |mask, lane| mask | 1 << lane);
            let lit = match &scene.structure {
                Structure::Bvh(bvh) => {
                    shadows::unoccluded(simd, bvh, toward, &points, facing, &mut scratch.shadow_stack)
                }
                structure => unoccluded(structure, toward, &points, facing),
            };
            for lane in (0..RAYS).filter(|lane| lit >> lane & 1 == 1) {
                brightness[lane] += radiance(normal[lane]);
            }
        }
    }

    // Into the film.
    for lane in (0..RAYS).filter(|lane| hits >> lane & 1 == 1) {
        let (x, y) = pixel_of(lane);
        debug_assert_eq!(class(x, y), class_);
        let sum = &mut film_tile.sum[(corner.1 + y) * FILM_EDGE + corner.0 + x];
        let light = color[lane] * brightness[lane];
        for (sum, light) in sum.iter_mut().zip([light.x, light.y, light.z, 1.0]) {
            *sum += light;
        }
    }
}

/// Which of the points see past every particle: a ray each.
fn unoccluded(structure: &Structure, toward_light: Vec3, points: &Points, facing: u32) -> u32 {
    (0..RAYS).filter(|lane| facing >> lane & 1 == 1).fold(0, |lit, lane| {
        let origin = Vec3::from_array([0, 1, 2].map(|axis| points.position[axis][lane]));
        let ray = crate::math::Ray { origin, direction: toward_light, t_min: 0.0, t_max: f32::INFINITY };
        lit | u32::from(!structure.occluded(&ray, Some(points.on[lane]))) << lane
    })
}
