//! Which surfaces of a film tile see a light, all in the same direction.
//!
//! Surfaces are sorted by where they lie across the direction, so that the sixteen of a packet look through the same part of
//! space even where neighboring pixels met particles far from each other.

use fearless_simd::prelude::*;
use fearless_simd_macros::simd;
use glam::Vec3;

use super::FILM_PIXELS;
use super::shadows::{self, Points};
use super::tiles::RAYS;
use crate::math::Ray;
use crate::structure::{Store, Structure};

/// What a sample met.
#[derive(Clone, Copy)]
pub(super) struct Surface {
    pub(super) position: Vec3,
    /// The node that was met.
    pub(super) node: u32,
    pub(super) normal: Vec3,
    /// The film tile's pixel.
    pub(super) pixel: u32,
    pub(super) color: Vec3,
    /// Light gathered so far.
    pub(super) brightness: f32,
}

/// Cells along each of the two axes by which surfaces are sorted.
const CELLS: usize = 16;

/// Adds `radiance` times the cosine to every surface that sees the light in direction `toward`. `stack` is scratch.
#[simd]
pub(super) fn gather<S: Simd>(
    simd: S,
    structure: &Structure,
    toward: Vec3,
    radiance: f32,
    surfaces: &mut [Surface],
    stack: &mut Vec<shadows::Entry>,
) {
    // Who faces the light, and where it lies across the direction.
    let (u, v) = toward.any_orthonormal_pair();
    let mut facing = [0_u16; FILM_PIXELS];
    let mut cosine = [0.0_f32; FILM_PIXELS];
    let mut across = [[0.0_f32; 2]; FILM_PIXELS];
    let (mut low, mut high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
    let mut count = 0;
    for (place, surface) in surfaces.iter().enumerate() {
        let normal = surface.normal;
        let cos = normal.x * toward.x + normal.y * toward.y + normal.z * toward.z;
        if cos > 0.0 {
            let at = [surface.position.dot(u), surface.position.dot(v)];
            for axis in 0..2 {
                low[axis] = low[axis].min(at[axis]);
                high[axis] = high[axis].max(at[axis]);
            }
            (facing[count], cosine[count], across[count]) = (place as u16, cos, at);
            count += 1;
        }
    }

    // Sort them by cells along a Morton curve.
    let scale = [0, 1].map(|axis| CELLS as f32 / (high[axis] - low[axis]).max(f32::MIN_POSITIVE));
    let mut cell = [0_u8; FILM_PIXELS];
    let mut starts = [0_u16; CELLS * CELLS + 1];
    for k in 0..count {
        let at = |axis: usize| (((across[k][axis] - low[axis]) * scale[axis]) as usize).min(CELLS - 1);
        cell[k] = MORTON[at(0)] | MORTON[at(1)] << 1;
        starts[cell[k] as usize + 1] += 1;
    }
    for k in 1..starts.len() {
        starts[k] += starts[k - 1];
    }
    let mut order = [0_u16; FILM_PIXELS];
    for k in 0..count {
        let next = &mut starts[cell[k] as usize];
        order[*next as usize] = k as u16;
        *next += 1;
    }

    // Sixteen at a time.
    for packet in order[..count].chunks(RAYS) {
        let mut points = Points { position: [[0.0; RAYS]; 3], on: [0; RAYS] };
        for (lane, &k) in packet.iter().enumerate() {
            let surface = &surfaces[facing[k as usize] as usize];
            for axis in 0..3 {
                points.position[axis][lane] = surface.position[axis];
            }
            points.on[lane] = surface.node;
        }
        let all = ((1_u64 << packet.len()) - 1) as u32;
        let lit = match &structure.store {
            Store::Bvh(bvh) => shadows::unoccluded(simd, bvh, toward, &points, all, stack),
            _ => unoccluded(structure, toward, &points, packet.len()),
        };
        for (lane, &k) in packet.iter().enumerate() {
            if lit >> lane & 1 == 1 {
                surfaces[facing[k as usize] as usize].brightness += cosine[k as usize] * radiance;
            }
        }
    }
}

/// The bits of 0 to 15, spread to every second place.
const MORTON: [u8; CELLS] =
    [0x00, 0x01, 0x04, 0x05, 0x10, 0x11, 0x14, 0x15, 0x40, 0x41, 0x44, 0x45, 0x50, 0x51, 0x54, 0x55];

/// Which of the first `count` points see past every particle: a ray each.
fn unoccluded(structure: &Structure, toward: Vec3, points: &Points, count: usize) -> u32 {
    let mut lit = 0;
    for lane in 0..count {
        let [x, y, z] = &points.position;
        let origin = Vec3::new(x[lane], y[lane], z[lane]);
        let ray = Ray { origin, direction: toward, t_min: 0.0, t_max: f32::INFINITY };
        lit |= u32::from(!structure.occluded(&ray, Some(points.on[lane]))) << lane;
    }
    lit
}
