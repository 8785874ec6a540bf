//! The CPU: threads over tiles of the film, and what happens in a tile.
//!
//! A film tile of 32 x 32 pixels is the unit of work. A pass finds what its rays meet (the tile sample buffer of `tiles` for the
//! hierarchy, a ray each for other structures), then lights it, sixteen neighboring pixels at a time.

mod lighting;
mod shadows;
mod tiles;

use fearless_simd::{Level, Simd, dispatch, f32x16, prelude::*};
use fearless_simd_macros::simd;
use rayon::prelude::*;

use super::sampling::{Dimension, point};
use super::shade::{LightSample, key_radiance, light_sample, sky_radiance};
use crate::film::Image;
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::camera::View;
use crate::scene::light::Lighting;
use crate::simd::Lanes3;
use crate::structure::Structure;
use lighting::Surfaces;
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
    /// The sample nearest the pixel's center and its squared distance from it, by pixel of the pattern.
    nearest: Vec<(usize, f32)>,
    /// Light directions by sample, the same for all pixels.
    lights: Vec<LightSample>,
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
        let offsets: Vec<[[f32; 2]; RAYS]> =
            (0..PATTERN * PATTERN).map(|pixel| std::array::from_fn(|sample| offset(pixel, sample))).collect();
        let center_sq = |[x, y]: [f32; 2]| (x - 0.5).powi(2) + (y - 0.5).powi(2);
        let nearest = |offsets: &[[f32; 2]; RAYS]| {
            let by_distance = offsets[..samples].iter().map(|&offset| center_sq(offset)).enumerate();
            by_distance.min_by(|a, b| a.1.total_cmp(&b.1)).expect("a pass has a sample")
        };
        let nearest = offsets.iter().map(nearest).collect();
        let lights = match &scene.lighting {
            Lighting::Studio(key, _) => {
                (first..first + count).map(|sample| light_sample(key, seed, sample)).collect()
            }
            _ => Vec::new(),
        };
        let block_px = match samples {
            1 => 4,
            4 => 2,
            _ => 1,
        };
        Self { scene, view, samples, block_px, offsets, nearest, lights }
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
    /// What each sample of the film tile's pixels met, where light is traced.
    surfaces: Vec<Surfaces>,
}

/// Adds a pass to the film. The only place where threads appear: each takes film tiles until none is left.
pub(crate) fn for_each_tile(film: &mut Film, pass: &Pass, level: Level, progress: &dyn Progress) {
    let (width, height) = (film.width, film.height);
    let scratch = || Scratch {
        tile: Tile::new(),
        stack: Vec::new(),
        shadow_stack: Vec::new(),
        surfaces: pass.lights.iter().map(|_| Surfaces::new()).collect(),
    };
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
            keep_nearest(pass, (x, y), film_tile, &scratch.tile);
            for area_y in (0..tile_px).step_by(PATTERN) {
                for area_x in (0..tile_px).step_by(PATTERN) {
                    let area = Area { in_tile: (area_x, area_y), in_film: (x + area_x, y + area_y) };
                    for sample in 0..pass.samples {
                        for quarter in 0..4 {
                            find_surfaces(simd, pass, &area, sample, quarter, film_tile, scratch);
                        }
                    }
                }
            }
        }
    }
    light(simd, pass, film_tile, scratch);
}

/// 8 x 8 pixels: where they lie in the tile and in the film tile.
struct Area {
    in_tile: (usize, usize),
    in_film: (usize, usize),
}

/// Keeps depth and id of the sample nearest each pixel's center; the tile lies at `corner` of the film tile.
fn keep_nearest(pass: &Pass, corner: (usize, usize), film_tile: &mut FilmTile, tile: &Tile) {
    for y in 0..EDGE * pass.block_px {
        for x in 0..EDGE * pass.block_px {
            let (sample, center_sq) = pass.nearest[y % PATTERN * PATTERN + x % PATTERN];
            let pixel = (corner.1 + y) * FILM_EDGE + corner.0 + x;
            if center_sq < film_tile.nearest_sq[pixel] {
                let (block, lane) = pass.slot(x, y, sample);
                film_tile.nearest_sq[pixel] = center_sq;
                film_tile.depth[pixel] = tile.depth[block][lane];
                if tile.depth[block][lane] < f32::INFINITY {
                    film_tile.id[pixel] = pass.scene.structure.sphere(tile.node[block][lane]).2;
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
                        tile.node[block][lane] = hit.node;
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

/// Finds the surfaces that one sample of the 4 x 4 pixels of a quarter of the area met. Without traced light they go to the film.
#[simd]
fn find_surfaces<S: Simd>(
    simd: S,
    pass: &Pass,
    area: &Area,
    sample: usize,
    quarter: usize,
    film_tile: &mut FilmTile,
    scratch: &mut Scratch,
) {
    let scene = pass.scene;
    let in_area = |lane: usize| (lane % 4 + quarter % 2 * 4, lane / 4 + quarter / 2 * 4);

    // What was met.
    let mut hits = 0_u32;
    let mut depth = [0.0; RAYS];
    let mut varying = [[0.0; RAYS]; 3];
    let mut center = [[0.0; RAYS]; 3];
    let mut radius = [0.0; RAYS];
    let mut color = [[0.0; 3]; RAYS];
    let mut node = [u32::MAX; RAYS];
    for lane in 0..RAYS {
        let (x, y) = in_area(lane);
        let (block, ray_lane) = pass.slot(area.in_tile.0 + x, area.in_tile.1 + y, sample);
        depth[lane] = scratch.tile.depth[block][ray_lane];
        if depth[lane] == f32::INFINITY {
            continue;
        }
        hits |= 1 << lane;
        node[lane] = scratch.tile.node[block][ray_lane];
        let (at, size, id) = scene.structure.sphere(node[lane]);
        color[lane] = scene.colors.color(id as usize);
        radius[lane] = size;
        for axis in 0..3 {
            center[axis][lane] = at[axis];
            varying[axis][lane] = scratch.tile.varying[block][axis][ray_lane];
        }
    }
    if hits == 0 {
        return;
    }

    // Its normal, and its place on the sphere.
    let varying = Lanes3::load(simd, &varying);
    let (origin, direction) = if pass.view.perspective {
        (Lanes3::splat(simd, pass.view.eye), varying)
    } else {
        (varying, Lanes3::splat(simd, pass.view.forward))
    };
    let center = Lanes3::load(simd, &center);
    let outward = origin.plus(direction.times(f32x16::load_array(simd, depth))).minus(center);
    // A sphere so small that rounding leaves no direction faces the eye.
    let length_sq = outward.dot(outward);
    let is_clear = length_sq.simd_gt(f32x16::splat(simd, f32::MIN_POSITIVE));
    let normal = outward.times(f32x16::splat(simd, 1.0) / length_sq.sqrt());
    let normal = Lanes3 {
        x: is_clear.select(normal.x, -direction.x),
        y: is_clear.select(normal.y, -direction.y),
        z: is_clear.select(normal.z, -direction.z),
    };

    // Without traced light it is done; else it waits for the others that its light can be asked with.
    let zero = f32x16::splat(simd, 0.0);
    let brightness = match &scene.lighting {
        Lighting::Flat => f32x16::splat(simd, 1.0),
        Lighting::Headlight => (-normal.dot(direction)).max(zero),
        Lighting::Studio(..) => zero,
    };
    let brightness = brightness.to_array();
    let traced = matches!(scene.lighting, Lighting::Studio(..));
    let position = center.plus(normal.times(f32x16::load_array(simd, radius)));
    let (position, normal) = (position.to_arrays(), normal.to_arrays());
    for lane in 0..RAYS {
        if hits >> lane & 1 == 0 {
            continue;
        }
        let (x, y) = in_area(lane);
        let pixel = (area.in_film.1 + y) * FILM_EDGE + area.in_film.0 + x;
        if traced {
            let surfaces = &mut scratch.surfaces[sample];
            let place = surfaces.count;
            surfaces.count += 1;
            for axis in 0..3 {
                surfaces.position[axis][place] = position[axis][lane];
                surfaces.normal[axis][place] = normal[axis][lane];
            }
            surfaces.color[place] = color[lane];
            surfaces.node[place] = node[lane];
            surfaces.pixel[place] = pixel as u16;
            surfaces.brightness[place] = 0.0;
        } else {
            add(&mut film_tile.sum[pixel], color[lane], brightness[lane]);
        }
    }
}

/// Adds a sample that met something to a pixel's sum.
#[inline(always)]
fn add(sum: &mut [f32; 4], color: [f32; 3], brightness: f32) {
    for channel in 0..3 {
        sum[channel] += color[channel] * brightness;
    }
    sum[3] += 1.0;
}

/// Lights all that the film tile's samples met, and adds it to the film.
#[simd]
fn light<S: Simd>(simd: S, pass: &Pass, film_tile: &mut FilmTile, scratch: &mut Scratch) {
    let Lighting::Studio(key, sky) = &pass.scene.lighting else {
        return;
    };
    for (surfaces, light) in scratch.surfaces.iter_mut().zip(&pass.lights) {
        let lights = [(light.key, key_radiance(key)), (light.sky, sky_radiance(sky, light.sky))];
        for (toward, radiance) in lights {
            lighting::gather(
                simd,
                &pass.scene.structure,
                toward,
                radiance,
                surfaces,
                &mut scratch.shadow_stack,
            );
        }
        for place in 0..surfaces.count {
            let sum = &mut film_tile.sum[surfaces.pixel[place] as usize];
            add(sum, surfaces.color[place], surfaces.brightness[place]);
        }
        surfaces.count = 0;
    }
}
