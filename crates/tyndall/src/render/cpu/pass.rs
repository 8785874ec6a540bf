//! What all tiles of a pass have in common: where its rays go, which sample of which pixel each is, and where its light is.
//!
//! Samples and light directions repeat from tile to tile, so that all of it is worked out once a pass.

use std::sync::Mutex;

use fearless_simd::{f32x16, prelude::*};
use fearless_simd_macros::simd;

use super::FILM_EDGE;
use super::hits::{PACKET_EDGE, corner_of};
use super::tiles::{BLOCKS, EDGE, RAYS, Tile, block_at};
use crate::render::certified::{Counts, Options};
use crate::render::sampling::{Nearness, PATTERN, Samples};
use crate::render::shade::{LightSample, light_sample};
use crate::scene::Scene;
use crate::scene::camera::View;
use crate::scene::light::Lighting;
use crate::simd::Lanes3;

/// See the module.
pub(crate) struct Pass<'a> {
    pub(super) scene: &'a Scene,
    /// What rays meet that go on from what was seen.
    pub(super) secondary: &'a Scene,
    /// The scene's; none where only what is met is wanted.
    pub(super) lighting: Option<Lighting>,
    pub(super) view: View,
    pub(super) samples: usize,
    /// Whether samples lie in the middle of their pixel.
    pub(super) centered: bool,
    /// Pixels along the edge of a block of sixteen rays.
    pub(super) block_px: usize,
    /// Where the rays pass through the picture, in pixels from the tile's corner, by the block's place in the tile.
    x: Vec<[f32; RAYS]>,
    y: Vec<[f32; RAYS]>,
    /// The same by packet of the tile, and by sample in each packet; see `hits`.
    packet_x: Vec<[f32; RAYS]>,
    packet_y: Vec<[f32; RAYS]>,
    /// Which proofs of being hidden are sought.
    pub(super) certified: Options,
    /// By lane of a block: how far its pixel lies in a film tile behind the block's first.
    pub(super) pixel: [usize; RAYS],
    pub(super) seed: u32,
    /// The first of its samples: what the film has before it.
    pub(super) first: u32,
    /// By the block's place: the lanes that are nearer the centers of their pixels than all samples before.
    pub(super) nearest: Vec<Vec<usize>>,
    /// Light directions by sample, the same for all pixels.
    pub(super) lights: Vec<LightSample>,
    counts: Mutex<Counts>,
}

impl<'a> Pass<'a> {
    /// A pass over `scene` in that light, seen by `view`. `nearness` tells and learns how near samples came to the centers of their pixels.
    pub(super) fn new(
        (scene, lighting): (&'a Scene, Option<Lighting>),
        view: View,
        added: Samples,
        certified: Options,
        nearness: &mut Nearness,
    ) -> Self {
        let samples = added.count as usize;
        let block_px = match samples {
            1 => 4,
            4 => 2,
            _ => 1,
        };
        let (mut x, mut y) = (vec![[0.0; RAYS]; BLOCKS], vec![[0.0; RAYS]; BLOCKS]);
        let (mut packet_x, mut packet_y) = (x.clone(), y.clone());
        let chosen = nearness.add(&added);
        let mut nearest = vec![Vec::new(); BLOCKS];
        for block in 0..BLOCKS {
            for lane in 0..RAYS {
                let (pixel, sample) = (lane / samples, (lane % samples) as u32);
                let column = block % EDGE * block_px + pixel % block_px;
                let row = block / EDGE * block_px + pixel / block_px;
                let place = row % PATTERN * PATTERN + column % PATTERN;
                let offset = added.offset(place, sample);
                (x[block][lane], y[block][lane]) = (column as f32 + offset[0], row as f32 + offset[1]);
                let packet = row / PACKET_EDGE * (EDGE * block_px / PACKET_EDGE) + column / PACKET_EDGE;
                let inside = row % PACKET_EDGE * PACKET_EDGE + column % PACKET_EDGE;
                let at = packet * samples + lane % samples;
                (packet_x[at][inside], packet_y[at][inside]) = (x[block][lane], y[block][lane]);
                if chosen[place] == Some(sample) {
                    nearest[block].push(lane);
                }
            }
        }
        let pixel = std::array::from_fn(|lane| {
            let pixel = lane / samples;
            pixel / block_px * FILM_EDGE + pixel % block_px
        });
        let lights = match &lighting {
            Some(Lighting::Studio(key, _)) => (added.first..added.first + added.count)
                .map(|sample| light_sample(key, added.seed, sample))
                .collect(),
            _ => Vec::new(),
        };
        Self {
            seed: added.seed,
            first: added.first,
            scene,
            secondary: scene,
            lighting,
            view,
            samples,
            centered: added.centered,
            block_px,
            x,
            y,
            packet_x,
            packet_y,
            certified,
            pixel,
            nearest,
            lights,
            counts: Mutex::default(),
        }
    }

    /// The same pass over `scene`, whose rays go on in `secondary`. Both have the nodes of the scene that it was over.
    pub(crate) fn through<'b>(self, scene: &'b Scene, secondary: &'b Scene) -> Pass<'b>
    where
        'a: 'b,
    {
        Pass { scene, secondary, ..self }
    }

    /// Adds what was counted in a film tile.
    pub(super) fn count(&self, counts: Counts) {
        *self.counts.lock().expect("no panic while it is held") += counts;
    }

    /// What was counted so far.
    pub(crate) fn counts(&self) -> Counts {
        *self.counts.lock().expect("no panic while it is held")
    }

    /// How many samples the film has after it.
    pub(crate) fn end(&self) -> u32 {
        self.first + self.samples as u32
    }

    /// Pixels along the edge of a tile.
    pub(super) fn tile_px(&self) -> usize {
        EDGE * self.block_px
    }

    /// Sets the rays of the tile whose upper left corner is pixel `corner`.
    #[simd]
    pub(super) fn set_rays<S: Simd>(&self, simd: S, corner: (usize, usize), tile: &mut Tile) {
        let view = self.view;
        for block in 0..BLOCKS {
            let x = f32x16::load_array_ref(simd, &self.x[block]) + corner.0 as f32;
            let y = f32x16::load_array_ref(simd, &self.y[block]) + corner.1 as f32;
            varying(simd, &view, x, y).store(&mut tile.varying[block_at(block % EDGE, block / EDGE)]);
        }
    }

    /// The rays of sample `sample` through a packet of the film tile whose upper left corner is pixel `corner`.
    #[inline(always)]
    pub(super) fn packet_rays<S: Simd>(
        &self,
        simd: S,
        corner: (usize, usize),
        packet: usize,
        sample: usize,
    ) -> Lanes3<f32x16<S>> {
        let [x, y] = corner_of(packet);
        let edge = self.tile_px();
        let inside = y % edge / PACKET_EDGE * (edge / PACKET_EDGE) + x % edge / PACKET_EDGE;
        let at = inside * self.samples + sample;
        let tile = ((corner.0 + x - x % edge) as f32, (corner.1 + y - y % edge) as f32);
        let x = f32x16::load_array_ref(simd, &self.packet_x[at]) + tile.0;
        let y = f32x16::load_array_ref(simd, &self.packet_y[at]) + tile.1;
        varying(simd, &self.view, x, y)
    }

    /// Rays through the middles of the 4 x 4 cells of a pixel.
    #[inline(always)]
    pub(super) fn cell_rays<S: Simd>(&self, simd: S, pixel: (usize, usize)) -> Lanes3<f32x16<S>> {
        let x = f32x16::load_array_ref(simd, &CELLS[0]) + pixel.0 as f32;
        let y = f32x16::load_array_ref(simd, &CELLS[1]) + pixel.1 as f32;
        varying(simd, &self.view, x, y)
    }
}

/// Where the middles of the 4 x 4 cells of a pixel lie, across and down.
const CELLS: [[f32; RAYS]; 2] = {
    let mut cells = [[0.0; RAYS]; 2];
    let mut cell = 0;
    while cell < RAYS {
        (cells[0][cell], cells[1][cell]) =
            ((cell % 4) as f32 * 0.25 + 0.125, (cell / 4) as f32 * 0.25 + 0.125);
        cell += 1;
    }
    cells
};

/// Origins (orthographic) or directions (perspective) of rays through the picture at (x, y) pixels: [`View::ray`] on lanes.
#[inline(always)]
fn varying<S: Simd>(simd: S, view: &View, x: f32x16<S>, y: f32x16<S>) -> Lanes3<f32x16<S>> {
    let u = x * view.pixel + view.left;
    let v = f32x16::splat(simd, view.top) - y * view.pixel;
    if view.panorama {
        let (longitudes, latitudes) = (u.to_array(), v.to_array());
        let mut directions = [[0.0; RAYS]; 3];
        for lane in 0..RAYS {
            let direction = view.direction_at(longitudes[lane], latitudes[lane]).to_array();
            for axis in 0..3 {
                directions[axis][lane] = direction[axis];
            }
        }
        return Lanes3::load(simd, &directions);
    }
    let across = Lanes3 {
        x: u * view.right.x + v * view.up.x,
        y: u * view.right.y + v * view.up.y,
        z: u * view.right.z + v * view.up.z,
    };
    let base = if view.perspective { view.forward } else { view.eye };
    let varying = across.plus(Lanes3::splat(simd, base));
    if view.perspective {
        return varying.times(f32x16::splat(simd, 1.0) / varying.dot(varying).sqrt());
    }
    varying
}
