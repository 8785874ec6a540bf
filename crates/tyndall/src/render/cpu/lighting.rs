//! Which surfaces of a film tile see a light, all in the same direction.
//!
//! The surfaces of one sample of all pixels are asked together: by bounds in the space of the light (`beams`), or, without them, in
//! packets of sixteen (`shadows`). Sixteen neighboring pixels are a packet where they lie close to each other across the direction; where
//! they met particles far from each other, surfaces are sorted first.

use fearless_simd::{f32x16, mask32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::Vec3;

use super::beams::{self, Spans};
use super::hits::PACKETS;
use super::replicas::{Moved, Replicated, shadow_of_images};
use super::shadows::{self, Light};
use super::shapes;
use super::surfaces::Layer;
use super::tiles::RAYS;
use super::{FILM_PIXELS, Pass};
use crate::math::Ray;
use crate::render::certified::Counts;
use crate::simd::Lanes3;
use crate::structure::Store;
use crate::structure::bvh::Bvh;

/// Cells along each of the two axes by which surfaces are sorted.
const CELLS: usize = 16;

/// Packets as they lie in the picture are left so where their rectangles would not fill that of all more often than this: sorting costs
/// less than packets whose points lie apart, but on closed surfaces it is in vain.
const MOST_OVERLAP: f32 = 2.0;

/// The surfaces that face a light, and what is needed to find out which of them see it.
pub(super) struct Lit {
    /// By packet a bit for each lane that faces the light, and, in the end, sees it.
    pub(super) lanes: [u16; PACKETS],
    /// The cosine between normal and direction.
    cosine: [[f32; RAYS]; PACKETS],
    /// By axis, across, across and along the direction.
    pub(super) at: [[[f32; RAYS]; 3]; PACKETS],
    sorted: Sorted,
    beam_stack: Vec<beams::Entry>,
    pub(super) shadow_stack: Vec<shadows::Entry>,
    /// What an image sees of the surfaces, where there are images.
    pub(super) moved: Option<Box<Moved>>,
}

/// Surfaces in new packets.
struct Sorted {
    count: usize,
    /// Where each was: packet times sixteen, and lane.
    place: [u16; FILM_PIXELS],
    lanes: [u16; PACKETS],
    position: [[[f32; RAYS]; 3]; PACKETS],
    at: [[[f32; RAYS]; 3]; PACKETS],
    on: [[u32; RAYS]; PACKETS],
}

impl Lit {
    pub(super) fn new() -> Box<Self> {
        Box::new(Self {
            lanes: [0; PACKETS],
            cosine: [[0.0; RAYS]; PACKETS],
            at: [[[0.0; RAYS]; 3]; PACKETS],
            sorted: Sorted {
                count: 0,
                place: [0; FILM_PIXELS],
                lanes: [0; PACKETS],
                position: [[[0.0; RAYS]; 3]; PACKETS],
                at: [[[0.0; RAYS]; 3]; PACKETS],
                on: [[0; RAYS]; PACKETS],
            },
            beam_stack: Vec::new(),
            shadow_stack: Vec::new(),
            moved: None,
        })
    }
}

/// Adds `radiance` times the cosine to every surface of the layer that sees the light in direction `toward`.
#[simd]
pub(super) fn gather<S: Simd>(
    simd: S,
    pass: &Pass,
    (toward, radiance): (Vec3, f32),
    layer: &mut Layer,
    scratch: &mut Lit,
    counts: &mut Counts,
) {
    find_facing(simd, layer, toward, scratch);
    if pass.secondary.cut().is_some() {
        let is_lit = |ray: &Ray, on: u32| !pass.secondary.is_shadowed(ray, Some(on));
        ask_single_rays(is_lit, toward, layer, &mut scratch.lanes);
        return add_light(simd, radiance, layer, scratch);
    }
    let structure = pass.secondary.structure();
    let replicated = Replicated::of(pass.secondary);
    if let Store::Bvh(bvh) = &structure.store {
        if pass.certified.light_bounds {
            counts.light_points +=
                scratch.lanes.iter().map(|lanes| u64::from(lanes.count_ones())).sum::<u64>();
        }
        if replicated.is_none() {
            let surfaces = Surfaces { position: &layer.position, on: &layer.node };
            shadow(simd, bvh, pass, toward, surfaces, scratch, counts);
        }
    } else {
        let is_lit = |ray: &Ray, on: u32| !structure.occluded(ray, Some(on));
        ask_single_rays(is_lit, toward, layer, &mut scratch.lanes);
    }
    match (replicated, pass.secondary.shapes()) {
        (Some(replicated), _) => shadow_of_images(simd, replicated, pass, toward, layer, scratch, counts),
        (None, Some(shapes)) => {
            let surfaces = Surfaces { position: &layer.position, on: &layer.node };
            let shapes = (shapes, structure.nodes());
            shapes::shadow(simd, shapes, toward, surfaces, &mut scratch.lanes, &mut scratch.shadow_stack);
        }
        (None, None) => {}
    }
    add_light(simd, radiance, layer, scratch);
}

/// Adds `radiance` times the cosine to every surface that is lit.
#[inline(always)]
fn add_light<S: Simd>(simd: S, radiance: f32, layer: &mut Layer, scratch: &Lit) {
    let zero = f32x16::splat(simd, 0.0);
    for packet in 0..PACKETS {
        if scratch.lanes[packet] != 0 {
            let lit = mask32x16::from_bitmask(simd, u64::from(scratch.lanes[packet]));
            let light = f32x16::load_array_ref(simd, &scratch.cosine[packet]) * f32x16::splat(simd, radiance);
            let brightness = &mut layer.brightness[packet];
            (f32x16::load_array_ref(simd, brightness) + lit.select(light, zero)).store_array(brightness);
        }
    }
}

/// Surfaces by packet: where they are in space, and the nodes of the particles on which they lie.
#[derive(Clone, Copy)]
pub(super) struct Surfaces<'a> {
    pub(super) position: &'a [[[f32; RAYS]; 3]; PACKETS],
    pub(super) on: &'a [[u32; RAYS]; PACKETS],
}

/// Clears the lanes of surfaces that do not see past every particle in direction `toward`.
#[inline(always)]
pub(super) fn shadow<S: Simd>(
    simd: S,
    bvh: &Bvh,
    pass: &Pass,
    toward: Vec3,
    surfaces: Surfaces,
    scratch: &mut Lit,
    counts: &mut Counts,
) {
    let Some(light) = place(simd, surfaces.position, toward, scratch) else { return };
    let spans = Spans::of(simd, &scratch.at, &scratch.lanes);
    if pass.certified.light_bounds {
        if spans.overlap < MOST_OVERLAP {
            let points = beams::Points { position: surfaces.position, at: &scratch.at, on: surfaces.on };
            let (lit, stack) = (&mut scratch.lanes, &mut scratch.beam_stack);
            beams::shadow(simd, bvh, &light, points, spans, lit, stack, counts);
        } else {
            scratch.sorted.sort(surfaces, &scratch.at, &scratch.lanes, &spans);
            let sorted = &mut scratch.sorted;
            let points = beams::Points { position: &sorted.position, at: &sorted.at, on: &sorted.on };
            let spans = Spans::of(simd, points.at, &sorted.lanes);
            let (lit, stack) = (&mut sorted.lanes, &mut scratch.beam_stack);
            beams::shadow(simd, bvh, &light, points, spans, lit, stack, counts);
            sorted.put_back(&mut scratch.lanes);
        }
    } else {
        scratch.sorted.sort(surfaces, &scratch.at, &scratch.lanes, &spans);
        let sorted = &mut scratch.sorted;
        for packet in 0..sorted.count.div_ceil(RAYS) {
            let points = shadows::Points { position: &sorted.position[packet], on: &sorted.on[packet] };
            let all = u32::from(sorted.lanes[packet]);
            let lit = shadows::unoccluded(simd, bvh, toward, &points, all, &mut scratch.shadow_stack);
            sorted.lanes[packet] = lit as u16;
        }
        sorted.put_back(&mut scratch.lanes);
    }
}

/// Finds which surfaces face the light.
#[inline(always)]
fn find_facing<S: Simd>(simd: S, layer: &Layer, toward: Vec3, scratch: &mut Lit) {
    let direction = Lanes3::splat(simd, toward);
    for packet in 0..PACKETS {
        scratch.lanes[packet] = 0;
        if layer.hits[packet] != 0 {
            let cosine = Lanes3::load(simd, &layer.normal[packet]).dot(direction);
            let lanes = cosine.simd_gt(f32x16::splat(simd, 0.0)).to_bitmask() as u16 & layer.hits[packet];
            if lanes != 0 {
                scratch.lanes[packet] = lanes;
                cosine.store_array(&mut scratch.cosine[packet]);
            }
        }
    }
}

/// Finds where the surfaces that are still lit lie along and across the light; none if there are none.
#[inline(always)]
pub(super) fn place<S: Simd>(
    simd: S,
    position: &[[[f32; RAYS]; 3]; PACKETS],
    toward: Vec3,
    scratch: &mut Lit,
) -> Option<Light> {
    let first = scratch.lanes.iter().position(|&lanes| lanes != 0)?;
    let lane = scratch.lanes[first].trailing_zeros() as usize;
    let [x, y, z] = &position[first];
    let mut light = Light::new(toward, Vec3::new(x[lane], y[lane], z[lane]), 0.0);
    let origin = Lanes3::splat(simd, light.origin);
    let mut farthest = f32x16::splat(simd, 0.0);
    for (packet, position) in position.iter().enumerate().skip(first) {
        if scratch.lanes[packet] != 0 {
            let lanes = mask32x16::from_bitmask(simd, u64::from(scratch.lanes[packet]));
            let offset = Lanes3::load(simd, position).minus(origin);
            let largest = offset.x.abs().max(offset.y.abs()).max(offset.z.abs());
            farthest = lanes.select(farthest.max(largest), farthest);
            light.project(simd, offset).store(&mut scratch.at[packet]);
        }
    }
    light.spread = farthest.reduce_max();
    Some(light)
}

impl Sorted {
    /// Takes the surfaces in the masks `lanes`, by cells along a Morton curve across the light.
    fn sort(
        &mut self,
        surfaces: Surfaces,
        at: &[[[f32; RAYS]; 3]; PACKETS],
        lanes: &[u16; PACKETS],
        spans: &Spans,
    ) {
        let scale =
            [0, 1].map(|axis| CELLS as f32 / (spans.high[axis] - spans.low[axis]).max(f32::MIN_POSITIVE));
        let mut cells = [0_u8; FILM_PIXELS];
        let mut places = [0_u16; FILM_PIXELS];
        let mut starts = [0_u16; CELLS * CELLS + 1];
        let mut count = 0;
        for packet in 0..PACKETS {
            let mut left = lanes[packet];
            while left != 0 {
                let lane = left.trailing_zeros() as usize;
                left &= left - 1;
                let [x, y] = [0, 1].map(|axis| {
                    let cell = (at[packet][axis][lane] - spans.low[axis]) * scale[axis];
                    MORTON[(cell as usize).min(CELLS - 1)]
                });
                let cell = x | y << 1;
                (cells[count], places[count]) = (cell, (packet * RAYS + lane) as u16);
                starts[cell as usize + 1] += 1;
                count += 1;
            }
        }
        for k in 1..starts.len() {
            starts[k] += starts[k - 1];
        }
        for (&cell, &place) in cells[..count].iter().zip(&places) {
            let to = starts[cell as usize] as usize;
            starts[cell as usize] += 1;
            self.place[to] = place;
            let (packet, lane) = (place as usize / RAYS, place as usize % RAYS);
            let (to_packet, to_lane) = (to / RAYS, to % RAYS);
            put(&mut self.position[to_packet], to_lane, &surfaces.position[packet], lane);
            put(&mut self.at[to_packet], to_lane, &at[packet], lane);
            self.on[to_packet][to_lane] = surfaces.on[packet][lane];
        }
        self.count = count;
        for (packet, lanes) in self.lanes.iter_mut().enumerate() {
            let left = count.saturating_sub(packet * RAYS).min(RAYS);
            *lanes = ((1_u32 << left) - 1) as u16;
        }
    }

    /// Sets the bits of `lanes` to those of the surfaces in their new packets.
    fn put_back(&self, lanes: &mut [u16; PACKETS]) {
        *lanes = [0; PACKETS];
        for (at, &place) in self.place[..self.count].iter().enumerate() {
            let lit = self.lanes[at / RAYS] >> (at % RAYS) & 1;
            lanes[place as usize / RAYS] |= lit << (place as usize % RAYS);
        }
    }
}

/// Copies a vector from a lane to another.
fn put(to: &mut [[f32; RAYS]; 3], to_lane: usize, from: &[[f32; RAYS]; 3], lane: usize) {
    for (to, from) in to.iter_mut().zip(from) {
        to[to_lane] = from[lane];
    }
}

/// The bits of 0 to 15, spread to every second place.
const MORTON: [u8; CELLS] =
    [0x00, 0x01, 0x04, 0x05, 0x10, 0x11, 0x14, 0x15, 0x40, 0x41, 0x44, 0x45, 0x50, 0x51, 0x54, 0x55];

/// Clears the bits of surfaces of which `is_lit` says, of a ray and the node where it starts, that they are not lit: a ray each.
fn ask_single_rays(
    is_lit: impl Fn(&Ray, u32) -> bool,
    toward: Vec3,
    layer: &Layer,
    lanes: &mut [u16; PACKETS],
) {
    for (packet, lanes) in lanes.iter_mut().enumerate() {
        let [x, y, z] = &layer.position[packet];
        for lane in 0..RAYS {
            if *lanes >> lane & 1 == 1 {
                let origin = Vec3::new(x[lane], y[lane], z[lane]);
                let ray = Ray { origin, direction: toward, t_min: 0.0, t_max: f32::INFINITY };
                let is_lit = is_lit(&ray, layer.node[packet][lane]);
                *lanes &= !(u16::from(!is_lit) << lane);
            }
        }
    }
}
