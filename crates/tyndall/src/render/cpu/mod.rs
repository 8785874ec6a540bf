//! The CPU: threads over tiles of the film, and what happens in a tile.
//!
//! A film tile of 32 x 32 pixels is the unit of work. A pass finds what its rays meet (the tile sample buffer of `tiles` for the
//! hierarchy, a ray each for other structures), then lights it, sixteen neighboring pixels at a time.

mod beams;
mod clip;
mod confidence;
mod coverage;
mod films;
mod hits;
mod lighting;
pub(super) mod normals;
mod pass;
mod paths;
mod replicas;
pub(super) mod seen;
mod settling;
mod shadows;
mod shapes;
mod surfaces;
mod tiles;

use fearless_simd::{Level, Simd, dispatch, f32x16, mask32x16, prelude::*};
use fearless_simd_macros::simd;
use rayon::prelude::*;

use super::certified::{Counts, Options};
use super::confidence::{Histogram, Pixel};
use super::shade::{TOON_LEVELS, key_radiance, mean_of, sky_radiance};
use crate::film::{Image, Window};
use crate::progress::Progress;
use crate::render::sampling::{Nearness, Samples};
use crate::scene::Scene;
use crate::scene::camera::View;
use crate::scene::light::{KeyLight, Lighting, Sky};
use crate::simd::Lanes3;
use crate::structure::Store;
use bytemuck::Zeroable;
pub(crate) use confidence::Confidence;
use coverage::Visible;
pub(crate) use films::Films;
use hits::{Hits, PACKET_EDGE, PACKETS, pixel_of};
use lighting::Lit;
pub(crate) use pass::Pass;
use replicas::Replicated;
use surfaces::{Layer, Met, look_up};
use tiles::{BLOCKS, Beam, EDGE, Entry, Memory, RAYS, Tile, block_at};

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
    /// Whether these are enough.
    settled: bool,
    /// Sum of the light of samples that met a particle, and their number.
    sum: [[f32; 4]; FILM_PIXELS],
    /// What the sample nearest the pixel's center met.
    depth: [f32; FILM_PIXELS],
    node: [u32; FILM_PIXELS],
}

/// Samples gathered so far.
pub(crate) struct Film {
    /// Of the whole picture.
    width: u32,
    height: u32,
    /// The part of it that is wanted. Tiles lie as in the whole, so that what is in them is the same.
    window: Window,
    tiles: Vec<FilmTile>,
    /// How near samples have come to the centers of their pixels.
    nearness: Nearness,
    /// The first samples of the passes that were begun, and what was known then.
    begun: Vec<(u32, Nearness)>,
    /// What the samples met, by film tile and pass, where that is kept.
    kept: Vec<Vec<Hits>>,
    pub(super) keeps: bool,
    /// Whether what samples meet is all that is wanted: nothing is lit.
    pub(super) is_unlit: bool,
    /// By film tile what it was a round ago, where noise is measured.
    earlier: Vec<super::refine::Earlier>,
}

impl Film {
    /// Memory that the kept samples take, in bytes.
    pub(super) fn kept_bytes(&self) -> u64 {
        self.kept.iter().flatten().map(Hits::bytes).sum()
    }

    /// What a pass over this film has to know of the samples before it. A pass that was interrupted can be begun again: it goes on with
    /// the tiles that are left.
    pub(crate) fn pass<'a>(
        &mut self,
        scene: &'a Scene,
        view: View,
        added: Samples,
        certified: Options,
    ) -> Pass<'a> {
        if let Some(again) = self.begun.iter().position(|&(first, _)| first == added.first) {
            self.nearness = self.begun[again].1.clone();
            self.begun.truncate(again);
        }
        self.begun.push((added.first, self.nearness.clone()));
        let lighting = (!self.is_unlit).then(|| scene.lighting.clone());
        Pass::new((scene, lighting), view, added, certified, &mut self.nearness)
    }

    /// Forgets all samples.
    pub(crate) fn clear(&mut self) {
        self.begun.clear();
        self.nearness = Nearness::NONE;
        self.tiles.iter_mut().for_each(|tile| (tile.samples, tile.settled) = (0, false));
        self.earlier.clear();
    }

    /// Whether every pixel has at least so many samples, or enough.
    pub(crate) fn has(&self, samples: u32) -> bool {
        self.tiles.iter().all(|tile| tile.settled || tile.samples >= samples)
    }

    /// Without samples.
    pub(crate) fn new(width: u32, height: u32) -> Self {
        Self::of_window(width, height, Window::whole(width, height))
    }

    /// Without samples, of a part of a picture. Tiles lie along a Morton curve, so that neighbors in time are neighbors in the picture.
    pub(crate) fn of_window(width: u32, height: u32, window: Window) -> Self {
        let tiles =
            |start: u32, length: u32| start / FILM_EDGE as u32..(start + length).div_ceil(FILM_EDGE as u32);
        let (across, down) = (tiles(window.x, window.width), tiles(window.y, window.height));
        let mut corners: Vec<(u32, u32)> = down.flat_map(|y| across.clone().map(move |x| (x, y))).collect();
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
        let kept = vec![Vec::new(); tiles.len()];
        let (nearness, begun, earlier) = (Nearness::NONE, Vec::new(), Vec::new());
        let (keeps, is_unlit) = (false, false);
        Self { width, height, window, tiles, nearness, begun, kept, keeps, is_unlit, earlier }
    }

    /// Without samples, of the same part of a picture.
    pub(super) fn like(&self) -> Self {
        Self::of_window(self.width, self.height, self.window)
    }

    /// Writes the mean of the samples of each pixel, over the scene's background; nothing but background where there are none.
    pub(crate) fn image_into(&self, scene: &Scene, image: &mut Image) {
        if self.has(1) {
            image.resize(self.window.width, self.window.height);
        } else {
            *image = Image::empty(self.window.width, self.window.height, scene.background);
        }
        self.draw_over(scene, image);
    }

    /// Writes the same into `image`, which has its size, but leaves pixels without samples as they are.
    pub(crate) fn draw_over(&self, scene: &Scene, image: &mut Image) {
        let width = self.window.width as usize;
        let rows = (
            image.color.par_chunks_mut(width),
            image.depth.par_chunks_mut(width),
            image.id.par_chunks_mut(width),
        );
        let tiles = self.tile_rows();
        rows.into_par_iter().enumerate().for_each(|(row, (color, depth, id))| {
            for stretch in self.stretches(&tiles, row) {
                let tile = stretch.tile;
                let mean = mean_of(tile.samples, scene.background);
                // Neighboring pixels often show the same particle.
                let mut last = (u32::MAX, 0);
                for (at, pixel) in stretch.pixels() {
                    color[at] = mean(tile.sum[pixel]);
                    depth[at] = tile.depth[pixel];
                    id[at] = if depth[at] < f32::INFINITY {
                        if tile.node[pixel] != last.0 {
                            let place = scene.place(tile.node[pixel]);
                            last = (tile.node[pixel], place.map_or(-1, |place| place as i64));
                        }
                        last.1
                    } else {
                        -1
                    };
                }
            }
        });
    }

    /// How many pixels are wanted.
    pub(crate) fn pixels(&self) -> u64 {
        u64::from(self.window.width) * u64::from(self.window.height)
    }

    /// The tiles that have samples, by rows of tiles.
    fn tile_rows(&self) -> Vec<Vec<&FilmTile>> {
        let edge = FILM_EDGE as u32;
        let (first, end) = (self.window.y / edge, (self.window.y + self.window.height).div_ceil(edge));
        let mut rows: Vec<Vec<&FilmTile>> = vec![Vec::new(); (end - first) as usize];
        for tile in self.tiles.iter().filter(|tile| tile.samples > 0) {
            rows[(tile.y / edge - first) as usize].push(tile);
        }
        rows
    }

    /// What the tiles have of a row of the window.
    fn stretches<'a>(
        &self,
        rows: &'a [Vec<&'a FilmTile>],
        row: usize,
    ) -> impl Iterator<Item = Stretch<'a>> + use<'a> {
        let (window, edge) = (self.window, FILM_EDGE as u32);
        let y = window.y + row as u32;
        rows[(y / edge - window.y / edge) as usize].iter().map(move |tile| {
            let (start, end) = (tile.x.max(window.x), (tile.x + edge).min(window.x + window.width));
            let first = (y % edge) as usize * FILM_EDGE + (start - tile.x) as usize;
            Stretch { tile, at: (start - window.x) as usize, first, length: (end - start) as usize }
        })
    }
}

/// Pixels side by side in a tile.
struct Stretch<'a> {
    tile: &'a FilmTile,
    /// The place of the first one in its row of the window, and in the tile.
    at: usize,
    first: usize,
    length: usize,
}

impl Stretch<'_> {
    /// The places of the pixels in the row and in the tile.
    fn pixels(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        (self.at..self.at + self.length).zip(self.first..)
    }
}

/// What a thread keeps from tile to tile.
struct Scratch {
    tile: Box<Tile>,
    stack: Vec<Entry>,
    /// The rays of a tile, where images see them from elsewhere.
    rays: Box<replicas::Rays>,
    /// By tile of the film tile, where they serve the next pass.
    memories: Vec<Memory>,
    /// Whether they are empty yet.
    is_new: bool,
    /// What the film tile's samples met, where light is traced, and one sample of it.
    hits: Hits,
    layer: Box<Layer>,
    light: Box<Lit>,
    counts: Counts,
    histogram: Histogram,
}

/// What a film tile's pixels know of what hides what, where they learn.
type Culled<'a> = Option<(confidence::Frame<'a>, &'a mut [Pixel; FILM_PIXELS])>;

/// Where what samples meet comes from.
enum Found<'a> {
    /// It has to be found, and kept if so said.
    New { keeps: bool, culled: Culled<'a> },
    /// It was found before.
    Before(&'a Hits),
}

/// Adds passes to the film, one after the other in each tile. Where `culling` learns from pass to pass, there is one.
pub(crate) fn for_each_tile(
    film: &mut Film,
    passes: &[Pass],
    mut culling: Option<&mut Confidence>,
    level: Level,
    progress: &dyn Progress,
) {
    let visible = passes.first().and_then(|pass| match &pass.scene.structure().store {
        Store::Bvh(bvh) if pass.certified.coverage => Some(Visible::new(bvh)),
        _ => None,
    });
    let (window, keeps) = (film.window, film.keeps);
    let culled: Vec<Culled> = match &mut culling {
        Some(culling) => {
            let (frame, tiles) = culling.split();
            tiles.iter_mut().map(|pixels| Some((frame, pixels))).collect()
        }
        None => film.tiles.iter().map(|_| None).collect(),
    };
    let tiles = film.tiles.par_iter_mut().zip(&mut film.kept).zip(culled);
    tiles.for_each_init(
        || Scratch::new(passes),
        |scratch, ((film_tile, kept), culled)| {
            let mut found = Found::New { keeps, culled };
            scratch.memories.clear();
            for pass in passes {
                if progress.cancelled() {
                    return;
                }
                // Passes that were interrupted have left some tiles.
                if film_tile.settled || film_tile.samples != pass.first {
                    continue;
                }
                scratch.remember(passes, pass);
                dispatch!(level, simd => render_film_tile(simd, pass, &mut found, film_tile, scratch));
                film_tile.samples += pass.samples as u32;
                if keeps {
                    if pass.first == 0 {
                        kept.clear();
                    }
                    kept.push(scratch.hits.of(pass.samples));
                }
                pass.count(std::mem::take(&mut scratch.counts));
                progress.advance(
                    window.pixels_of(film_tile.x, film_tile.y, FILM_EDGE as u32) * pass.samples as u64,
                );
            }
            if let Some(visible) = &visible {
                scratch.memories.iter().for_each(|memory| visible.add(memory));
            }
        },
    );
    if let Some(culling) = culling {
        let samples: usize = passes.iter().map(|pass| pass.samples).sum();
        culling.decide(film, samples as u32);
    }
    if let (Some(visible), Some(pass)) = (visible, passes.last()) {
        let [[leaves, evicted_leaves], [bricks, evicted_bricks]] = visible.evicted();
        pass.count(Counts { leaves, evicted_leaves, bricks, evicted_bricks, ..Counts::default() });
    }
}

/// Makes an empty film of what was kept by another, in the same passes.
pub(crate) fn shade_each_tile(
    film: &mut Film,
    kept: &Film,
    passes: &[Pass],
    level: Level,
    progress: &dyn Progress,
) {
    let window = film.window;
    let tiles = film.tiles.par_iter_mut().zip(&kept.kept);
    tiles.for_each_init(
        || Scratch::new(passes),
        |scratch, (film_tile, kept)| {
            for (at, pass) in passes.iter().enumerate() {
                if progress.cancelled() {
                    return;
                }
                let mut found = Found::Before(&kept[at]);
                dispatch!(level, simd => render_film_tile(simd, pass, &mut found, film_tile, scratch));
                film_tile.samples += pass.samples as u32;
                progress.advance(
                    window.pixels_of(film_tile.x, film_tile.y, FILM_EDGE as u32) * pass.samples as u64,
                );
            }
        },
    );
}

impl Scratch {
    fn new(passes: &[Pass]) -> Self {
        let samples = passes.iter().map(|pass| pass.samples).max().unwrap_or(0);
        Self {
            tile: Tile::new(),
            stack: Vec::new(),
            rays: bytemuck::zeroed_box(),
            memories: Vec::new(),
            is_new: false,
            hits: Hits::new(samples),
            layer: Layer::new(),
            light: Lit::new(),
            counts: Counts::default(),
            histogram: Histogram::default(),
        }
    }

    /// Makes room for what the tiles of the pass remember, if that serves; forgets it if the tiles are others than before.
    fn remember(&mut self, passes: &[Pass], pass: &Pass) {
        let serves = passes.len() > 1 && pass.certified.visible_set || pass.certified.coverage;
        let tiles = if serves { (FILM_EDGE / pass.tile_px()).pow(2) } else { 0 };
        self.is_new = self.memories.len() != tiles;
        if self.is_new {
            self.memories.clear();
            self.memories.resize_with(tiles, Memory::default);
        }
    }
}

#[simd]
fn render_film_tile<S: Simd>(
    simd: S,
    pass: &Pass,
    found: &mut Found,
    film_tile: &mut FilmTile,
    scratch: &mut Scratch,
) {
    if pass.first == 0 {
        film_tile.sum = [[0.0; 4]; FILM_PIXELS];
    }
    let is_lit_later = matches!(pass.lighting, Some(Lighting::Studio(..) | Lighting::Paths(_)));
    let tile_px = pass.tile_px();
    for y in (0..FILM_EDGE).step_by(tile_px) {
        for x in (0..FILM_EDGE).step_by(tile_px) {
            let place = ([film_tile.x as usize, film_tile.y as usize], [x, y]);
            pass.set_rays(simd, (place.0[0] + x, place.0[1] + y), &mut scratch.tile);
            match found {
                Found::New { culled, .. } => find_hits(simd, pass, place, culled, scratch),
                Found::Before(hits) => hits.restore(pass, (x, y), &mut scratch.tile),
            }
            for block in 0..BLOCKS {
                let first = (y + block / EDGE * pass.block_px) * FILM_EDGE + x + block % EDGE * pass.block_px;
                keep_nearest(pass, block, first, film_tile, &scratch.tile);
                if is_lit_later || pass.lighting.is_none() {
                    continue;
                }
                let at = block_at(block % EDGE, block / EDGE);
                let met = (&scratch.tile.depth[at], &scratch.tile.node[at]);
                let rays = Lanes3::load(simd, &scratch.tile.varying[at]);
                if let Some(met) = look_up(simd, pass.scene, &pass.view, met, rays) {
                    draw(simd, pass, &met, first, film_tile);
                }
            }
            if matches!(found, Found::New { keeps: true, .. }) || is_lit_later {
                scratch.hits.keep(pass, (x, y), &scratch.tile);
            }
        }
    }
    match &pass.lighting {
        Some(Lighting::Studio(key, sky)) => light(simd, pass, (key, sky), film_tile, scratch),
        Some(Lighting::Paths(paths)) => paths::light(simd, pass, paths, film_tile, &scratch.hits),
        Some(Lighting::Headlight | Lighting::Flat | Lighting::Toon { .. }) | None => {}
    }
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

/// Finds what every ray of a tile shows, which lies at pixel `inside` of the film tile at pixel `corner`: what it meets, or nothing where that is not shown.
#[simd]
fn find_hits<S: Simd>(
    simd: S,
    pass: &Pass,
    place: ([usize; 2], [usize; 2]),
    culled: &mut Culled,
    scratch: &mut Scratch,
) {
    meet(simd, pass, place, culled, scratch);
    if pass.scene.has_holdouts() {
        let rays = scratch
            .tile
            .depth
            .iter_mut()
            .zip(&scratch.tile.node)
            .flat_map(|(depth, node)| depth.iter_mut().zip(node));
        for (depth, &node) in rays.filter(|(depth, _)| **depth < f32::INFINITY) {
            if pass.scene.is_holdout(node) {
                *depth = f32::INFINITY;
            }
        }
    }
}

/// Finds what every ray of a tile meets.
#[simd]
fn meet<S: Simd>(
    simd: S,
    pass: &Pass,
    (corner, inside): ([usize; 2], [usize; 2]),
    culled: &mut Culled,
    scratch: &mut Scratch,
) {
    let tile = &mut scratch.tile;
    tile.clear();
    if let Some((frame, pixels)) = culled {
        return confidence::trace(frame, pass, (corner, inside), pixels, (tile, &mut scratch.histogram));
    }
    if clip::asks_single_rays(pass) {
        (0..BLOCKS).for_each(|block| clip::find_block(pass, block, tile, &mut scratch.counts));
        return tile.update_depths(simd);
    }
    let scene = pass.scene;
    let place = (corner[0] + inside[0], corner[1] + inside[1]);
    let beam = Beam::new(pass, place.0 as f32, place.1 as f32);
    let view = &pass.view;
    let replicated = Replicated::of(scene);
    match &scene.structure().store {
        Store::Bvh(bvh) if replicated.is_none() => {
            let tile_px = pass.tile_px();
            let number = inside[1] / tile_px * (FILM_EDGE / tile_px) + inside[0] / tile_px;
            let mut memory = scratch.memories.get_mut(number);
            if let Some(memory) = memory.as_deref() {
                scratch.counts.remembered_leaves += memory.leaves.len() as u64;
            }
            tiles::walk(simd, bvh, view, &beam, tile, &mut scratch.stack, memory.as_deref_mut());
            if let Some(memory) =
                memory.filter(|_| scratch.is_new && pass.certified.coverage && pass.block_px == 1)
            {
                coverage::forget_hidden(simd, pass, bvh, place, tile, memory);
            }
        }
        Store::Bvh(_) => {}
        _ => {
            for block in 0..BLOCKS {
                clip::find_block(pass, block, tile, &mut scratch.counts);
            }
            tile.update_depths(simd);
        }
    }
    match (replicated, scene.shapes()) {
        (Some(replicated), _) => {
            replicas::walk(simd, replicated, (view, &beam), tile, &mut scratch.rays, &mut scratch.stack);
        }
        (None, Some(shapes)) => {
            let shapes = (shapes, scene.structure().nodes());
            shapes::walk(simd, shapes, view, &beam, tile, &mut scratch.stack);
        }
        (None, None) => {}
    }
}

/// Adds what a block's rays met to the film, by the cosine to the eye, in levels or flat; the block's first pixel is `first`.
#[simd]
fn draw<S: Simd>(simd: S, pass: &Pass, met: &Met<S>, first: usize, film_tile: &mut FilmTile) {
    let zero = f32x16::splat(simd, 0.0);
    let brightness = match &pass.lighting {
        Some(Lighting::Headlight) => met.cosine.max(zero),
        Some(Lighting::Toon { toward }) => {
            let cosine = met.normal.dot(Lanes3::splat(simd, *toward));
            TOON_LEVELS.iter().fold(zero, |before, &[least, level]| {
                let level = f32x16::splat(simd, level);
                cosine.simd_ge(f32x16::splat(simd, least)).select(level, before)
            })
        }
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

/// Lights all that the film tile's samples met with lights of the studio, and adds it to the film.
#[simd]
fn light<S: Simd>(
    simd: S,
    pass: &Pass,
    (key, sky): (&KeyLight, &Sky),
    film_tile: &mut FilmTile,
    scratch: &mut Scratch,
) {
    let corner = (film_tile.x as usize, film_tile.y as usize);
    for (sample, light) in pass.lights.iter().enumerate() {
        for packet in 0..PACKETS {
            let at = packet * pass.samples + sample;
            let (depth, node) = (&scratch.hits.depth[at], &scratch.hits.node[at]);
            let rays = pass.packet_rays(simd, corner, packet, sample);
            let met = look_up(simd, pass.scene, &pass.view, (depth, node), rays);
            scratch.layer.set(packet, node, met);
        }
        let lights = [(light.key, key_radiance(key)), (light.sky, sky_radiance(sky, light.sky))];
        for (toward, radiance) in lights.into_iter().filter(|&(_, radiance)| radiance > 0.0) {
            let Scratch { layer, light, counts, .. } = scratch;
            lighting::gather(simd, pass, (toward, radiance), layer, light, counts);
        }
        let layer = &scratch.layer;
        for packet in (0..PACKETS).filter(|&packet| layer.hits[packet] != 0) {
            add_lit(simd, layer, packet, film_tile);
        }
    }
}

/// Adds a lit packet to the film.
#[inline(always)]
fn add_lit<S: Simd>(simd: S, layer: &Layer, packet: usize, film_tile: &mut FilmTile) {
    let zero = f32x16::splat(simd, 0.0);
    let hits = mask32x16::from_bitmask(simd, u64::from(layer.hits[packet]));
    let brightness = f32x16::load_array_ref(simd, &layer.brightness[packet]);
    let color = Lanes3::load(simd, &layer.color[packet]).times(brightness);
    let lights = [
        hits.select(color.x, zero).to_array(),
        hits.select(color.y, zero).to_array(),
        hits.select(color.z, zero).to_array(),
        hits.select(f32x16::splat(simd, 1.0), zero).to_array(),
    ];
    let first = pixel_of(packet, 0);
    for row in 0..PACKET_EDGE {
        let sums = &mut film_tile.sum[first + row * FILM_EDGE..][..PACKET_EDGE];
        for (column, sum) in sums.iter_mut().enumerate() {
            for (total, light) in sum.iter_mut().zip(&lights) {
                *total += light[row * PACKET_EDGE + column];
            }
        }
    }
}
