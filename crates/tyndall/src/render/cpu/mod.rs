//! The CPU: threads over tiles of the film, and what happens in a tile.
//!
//! A film tile of 32 x 32 pixels is the unit of work. A pass finds what its rays meet (the tile sample buffer of `tiles` for the
//! hierarchy, a ray each for other structures), then lights it, sixteen neighboring pixels at a time.

mod films;
mod lighting;
mod pass;
mod shadows;
mod tiles;

use fearless_simd::{Level, Simd, dispatch, f32x16, mask32x16, prelude::*, u32x16};
use fearless_simd_macros::simd;
use glam::Vec3;
use rayon::prelude::*;

use super::shade::{key_radiance, sky_radiance};
use crate::film::Image;
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::camera::View;
use crate::scene::light::Lighting;
use crate::simd::Lanes3;
use crate::structure::Store;
use bytemuck::Zeroable;
pub(crate) use films::Films;
use lighting::Surface;
use pass::PATTERN;
pub(crate) use pass::{Pass, Samples};
use tiles::{BLOCKS, Beam, EDGE, Entry, RAYS, Tile, block_at};

/// Pixels along the edge of a film tile.
const FILM_EDGE: usize = 32;
const FILM_PIXELS: usize = FILM_EDGE * FILM_EDGE;

/// The sums of samples of 32 x 32 pixels.
#[derive(Clone, Copy, Zeroable)]
struct FilmTile {
    /// Place in pixels of the upper left corner.
    x: u32,
    y: u32,
    /// How many samples each of its pixels has.
    samples: u32,
    /// Sum of the light of samples that met a particle, and their number.
    sum: [[f32; 4]; FILM_PIXELS],
    /// What the sample nearest the pixel's center met.
    depth: [f32; FILM_PIXELS],
    node: [u32; FILM_PIXELS],
}

/// Samples gathered so far.
pub(crate) struct Film {
    width: u32,
    height: u32,
    tiles: Vec<FilmTile>,
    /// Squared distance from the pixel's center of the sample nearest it, by the pixel's place in the pattern of samples.
    nearest_sq: [f32; PATTERN * PATTERN],
    /// The first sample of the pass begun last, and what was known then.
    begun: (u32, [f32; PATTERN * PATTERN]),
}

impl Film {
    /// What a pass over this film has to know of the samples before it. A pass that was interrupted can be begun again: it goes on with
    /// the tiles that are left.
    pub(crate) fn pass<'a>(&mut self, scene: &'a Scene, view: View, added: Samples) -> Pass<'a> {
        if added.first == 0 {
            self.nearest_sq.fill(f32::INFINITY);
        } else if added.first == self.begun.0 {
            self.nearest_sq = self.begun.1;
        }
        self.begun = (added.first, self.nearest_sq);
        Pass::new(scene, view, added, &mut self.nearest_sq)
    }

    /// Forgets all samples.
    pub(crate) fn clear(&mut self) {
        self.tiles.iter_mut().for_each(|tile| tile.samples = 0);
    }

    /// Whether every pixel has at least so many samples.
    pub(crate) fn has(&self, samples: u32) -> bool {
        self.tiles.iter().all(|tile| tile.samples >= samples)
    }

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
        // The first pass empties a tile before it adds to it: memory is touched by the thread that uses it.
        let mut tiles: Vec<FilmTile> = bytemuck::zeroed_vec(corners.len());
        for (tile, (x, y)) in tiles.iter_mut().zip(corners) {
            (tile.x, tile.y) = (x * FILM_EDGE as u32, y * FILM_EDGE as u32);
        }
        let nearest_sq = [f32::INFINITY; PATTERN * PATTERN];
        Self { width, height, tiles, nearest_sq, begun: (0, nearest_sq) }
    }

    /// Writes the mean of the samples of each pixel, over the scene's background; nothing but background where there are none.
    pub(crate) fn image_into(&self, scene: &Scene, image: &mut Image) {
        image.resize(self.width, self.height);
        if !self.has(1) {
            image.color.fill(scene.background.map_or([0.0; 4], |[r, g, b]| [r, g, b, 1.0]));
            image.depth.fill(f32::INFINITY);
            image.id.fill(-1);
        }
        self.draw_over(scene, image);
    }

    /// Writes the same into `image`, which has its size, but leaves pixels without samples as they are.
    pub(crate) fn draw_over(&self, scene: &Scene, image: &mut Image) {
        let width = self.width as usize;
        let mean = |sum: [f32; 4], inv_samples: f32| {
            let [r, g, b, count] = sum.map(|sum| sum * inv_samples);
            match scene.background {
                Some(back) => {
                    let open = 1.0 - count;
                    [r + open * back[0], g + open * back[1], b + open * back[2], 1.0]
                }
                None => [r, g, b, count],
            }
        };
        let mut rows: Vec<Vec<&FilmTile>> = vec![Vec::new(); self.height.div_ceil(FILM_EDGE as u32) as usize];
        for tile in self.tiles.iter().filter(|tile| tile.samples > 0) {
            rows[tile.y as usize / FILM_EDGE].push(tile);
        }
        let stretch = FILM_EDGE * width;
        let columns = (
            image.color.par_chunks_mut(stretch),
            image.depth.par_chunks_mut(stretch),
            image.id.par_chunks_mut(stretch),
        );
        columns.into_par_iter().zip(rows).for_each(|((color, depth, id), tiles)| {
            for tile in tiles {
                let inv_samples = 1.0 / tile.samples as f32;
                let columns = FILM_EDGE.min(width - tile.x as usize);
                // Neighboring pixels often show the same particle.
                let mut last = (u32::MAX, 0);
                for (row, pixels) in (0..color.len() / width).zip((0..).step_by(FILM_EDGE)) {
                    for (at, pixel) in (row * width + tile.x as usize..).zip(pixels..pixels + columns) {
                        color[at] = mean(tile.sum[pixel], inv_samples);
                        depth[at] = tile.depth[pixel];
                        id[at] = if depth[at] < f32::INFINITY {
                            if tile.node[pixel] != last.0 {
                                last = (tile.node[pixel], scene.structure().place(tile.node[pixel]) as i64);
                            }
                            last.1
                        } else {
                            -1
                        };
                    }
                }
            }
        });
    }
}

/// What a thread keeps from tile to tile.
struct Scratch {
    tile: Box<Tile>,
    stack: Vec<Entry>,
    shadow_stack: Vec<shadows::Entry>,
    /// By sample: what the film tile's pixels met, where light is traced.
    surfaces: Vec<Vec<Surface>>,
}

/// Adds a pass to the film. The only place where threads appear: each takes film tiles until none is left.
pub(crate) fn for_each_tile(film: &mut Film, pass: &Pass, level: Level, progress: &dyn Progress) {
    let (width, height) = (film.width, film.height);
    let scratch = || Scratch {
        tile: Tile::new(),
        stack: Vec::new(),
        shadow_stack: Vec::new(),
        surfaces: pass.lights.iter().map(|_| Vec::with_capacity(FILM_PIXELS)).collect(),
    };
    film.tiles.par_iter_mut().for_each_init(scratch, |scratch, film_tile| {
        // A pass that was interrupted has left some tiles.
        if film_tile.samples != pass.first || progress.cancelled() {
            return;
        }
        dispatch!(level, simd => render_film_tile(simd, pass, film_tile, scratch));
        film_tile.samples += pass.samples as u32;
        let columns = (width - film_tile.x).min(FILM_EDGE as u32);
        let rows = (height - film_tile.y).min(FILM_EDGE as u32);
        progress.advance(columns as u64 * rows as u64 * pass.samples as u64);
    });
}

#[simd]
fn render_film_tile<S: Simd>(simd: S, pass: &Pass, film_tile: &mut FilmTile, scratch: &mut Scratch) {
    if pass.first == 0 {
        film_tile.sum = [[0.0; 4]; FILM_PIXELS];
    }
    for y in (0..FILM_EDGE).step_by(pass.tile_px()) {
        for x in (0..FILM_EDGE).step_by(pass.tile_px()) {
            find_hits(simd, pass, (film_tile.x as usize + x, film_tile.y as usize + y), scratch);
            for block in 0..BLOCKS {
                let first = (y + block / EDGE * pass.block_px) * FILM_EDGE + x + block % EDGE * pass.block_px;
                keep_nearest(pass, block, first, film_tile, &scratch.tile);
                let at = block_at(block % EDGE, block / EDGE);
                if let Some(met) = look_up(simd, pass, at, &scratch.tile) {
                    match &pass.scene.lighting {
                        Lighting::Studio(..) => {
                            keep(pass, &met, &scratch.tile.node[at], first, &mut scratch.surfaces);
                        }
                        _ => draw(simd, pass, &met, first, film_tile),
                    }
                }
            }
        }
    }
    light(simd, pass, film_tile, scratch);
}

/// Keeps depth and node of the block's samples that are the nearest so far to the centers of their pixels; the block's first
/// pixel is `first`.
fn keep_nearest(pass: &Pass, block: usize, first: usize, film_tile: &mut FilmTile, tile: &Tile) {
    let at = block_at(block % EDGE, block / EDGE);
    for &lane in &pass.nearest[block] {
        let pixel = first + pass.pixel[lane];
        film_tile.depth[pixel] = tile.depth[at][lane];
        film_tile.node[pixel] = tile.node[at][lane];
    }
}

/// Finds what every ray of the tile at pixel `corner` meets.
#[simd]
fn find_hits<S: Simd>(simd: S, pass: &Pass, corner: (usize, usize), scratch: &mut Scratch) {
    let tile = &mut scratch.tile;
    tile.clear();
    pass.set_rays(simd, corner, tile);
    match &pass.scene.structure().store {
        Store::Bvh(bvh) => {
            let beam = Beam::new(pass, corner.0 as f32, corner.1 as f32);
            tiles::walk(simd, bvh, &pass.view, &beam, tile, &mut scratch.stack);
        }
        _ => {
            let structure = pass.scene.structure();
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

/// What the sixteen rays of a block met, where they met anything.
struct Met<S: Simd> {
    hits: mask32x16<S>,
    position: Lanes3<f32x16<S>>,
    normal: Lanes3<f32x16<S>>,
    /// The cosine between the normal and the way back to the eye.
    cosine: f32x16<S>,
    color: Lanes3<f32x16<S>>,
}

/// Looks up what the rays of the block stored at `at` met; none if they met nothing.
#[simd]
fn look_up<S: Simd>(simd: S, pass: &Pass, at: usize, tile: &Tile) -> Option<Met<S>> {
    let scene = pass.scene;
    let depth = f32x16::load_array_ref(simd, &tile.depth[at]);
    let hits = depth.simd_lt(f32x16::splat(simd, f32::INFINITY));
    let bits = hits.to_bitmask();
    if bits == 0 {
        return None;
    }

    // Neighboring rays often meet the same particle: it is looked up once for all of them.
    let zero = f32x16::splat(simd, 0.0);
    let mut center = Lanes3 { x: zero, y: zero, z: zero };
    let mut radius = zero;
    let mut color = Lanes3 { x: zero, y: zero, z: zero };
    let nodes = u32x16::load_array_ref(simd, &tile.node[at]);
    let mut left = bits;
    while left != 0 {
        let node = tile.node[at][left.trailing_zeros() as usize];
        let same = nodes.simd_eq(u32x16::splat(simd, node));
        left &= !same.to_bitmask();
        let sphere = scene.structure().sphere(node);
        center = Lanes3::splat(simd, sphere.0).where_else(same, center);
        radius = same.select(f32x16::splat(simd, sphere.1), radius);
        color = Lanes3::splat(simd, Vec3::from_array(scene.color(node))).where_else(same, color);
    }

    let varying = Lanes3::load(simd, &tile.varying[at]);
    let (origin, direction) = if pass.view.perspective {
        (Lanes3::splat(simd, pass.view.eye), varying)
    } else {
        (varying, Lanes3::splat(simd, pass.view.forward))
    };
    let outward = origin.plus(direction.times(depth)).minus(center);
    // A sphere so small that rounding leaves no direction faces the eye.
    let length_sq = outward.dot(outward);
    let is_clear = length_sq.simd_gt(f32x16::splat(simd, f32::MIN_POSITIVE));
    let normal = outward.times(f32x16::splat(simd, 1.0) / length_sq.sqrt());
    let normal = normal.where_else(is_clear, Lanes3 { x: -direction.x, y: -direction.y, z: -direction.z });
    let position = center.plus(normal.times(radius));
    Some(Met { hits, position, normal, cosine: -normal.dot(direction), color })
}

/// Adds what a block's rays met to the film, by the cosine to the eye or flat; the block's first pixel is `first`.
#[simd]
fn draw<S: Simd>(simd: S, pass: &Pass, met: &Met<S>, first: usize, film_tile: &mut FilmTile) {
    let zero = f32x16::splat(simd, 0.0);
    let brightness = match &pass.scene.lighting {
        Lighting::Headlight => met.cosine.max(zero),
        _ => f32x16::splat(simd, 1.0),
    };
    let brightness = met.hits.select(brightness, zero);
    let mut lights = [zero; 4];
    for (light, color) in lights.iter_mut().zip([met.color.x, met.color.y, met.color.z]) {
        *light = color * brightness;
    }
    lights[3] = met.hits.select(f32x16::splat(simd, 1.0), zero);
    for (channel, light) in lights.into_iter().enumerate() {
        if pass.samples == RAYS {
            // All are samples of one pixel: summed by halves, in the same order for every width of SIMD.
            let (low, high) = light.split();
            let (low, high) = (low + high).split();
            let [a, b, c, d] = (low + high).to_array();
            film_tile.sum[first][channel] += (a + b) + (c + d);
        } else {
            for (lane, light) in light.to_array().into_iter().enumerate() {
                film_tile.sum[first + pass.pixel[lane]][channel] += light;
            }
        }
    }
}

/// Keeps what a block's rays met until its light can be asked for with that of others.
fn keep<S: Simd>(pass: &Pass, met: &Met<S>, node: &[u32; RAYS], first: usize, surfaces: &mut [Vec<Surface>]) {
    let (position, normal, color) = (met.position.to_arrays(), met.normal.to_arrays(), met.color.to_arrays());
    let mut bits = met.hits.to_bitmask();
    while bits != 0 {
        let lane = bits.trailing_zeros() as usize;
        bits &= bits - 1;
        let vector = |lanes: &[[f32; RAYS]; 3]| Vec3::new(lanes[0][lane], lanes[1][lane], lanes[2][lane]);
        surfaces[pass.sample[lane]].push(Surface {
            position: vector(&position),
            node: node[lane],
            normal: vector(&normal),
            pixel: (first + pass.pixel[lane]) as u32,
            color: vector(&color),
            brightness: 0.0,
        });
    }
}

/// Lights all that the film tile's samples met, and adds it to the film.
#[simd]
fn light<S: Simd>(simd: S, pass: &Pass, film_tile: &mut FilmTile, scratch: &mut Scratch) {
    let Lighting::Studio(key, sky) = &pass.scene.lighting else {
        return;
    };
    for (surfaces, light) in scratch.surfaces.iter_mut().zip(&pass.lights) {
        let lights = [(light.key, key_radiance(key)), (light.sky, sky_radiance(sky, light.sky))];
        for (toward, radiance) in lights.into_iter().filter(|&(_, radiance)| radiance > 0.0) {
            lighting::gather(
                simd,
                pass.scene.structure(),
                toward,
                radiance,
                surfaces,
                &mut scratch.shadow_stack,
            );
        }
        for surface in surfaces.drain(..) {
            let sum = &mut film_tile.sum[surface.pixel as usize];
            for (total, color) in sum.iter_mut().zip(surface.color.to_array()) {
                *total += color * surface.brightness;
            }
            sum[3] += 1.0;
        }
    }
}
