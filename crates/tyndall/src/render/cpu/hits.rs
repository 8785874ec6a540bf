//! What the samples of a film tile met: depth and node, in packets.
//!
//! A packet is one sample of each of 4 x 4 pixels: neighbors on a surface, so that light can be looked for together. `Hits` is all that has to
//! be kept to light or color a picture anew.

use fearless_simd::prelude::*;

use super::pass::Pass;
use super::tiles::{BLOCKS, EDGE, RAYS, Tile, block_at};
use super::{FILM_EDGE, FILM_PIXELS};

/// Packets of one sample in a film tile, and pixels along a packet's edge.
pub(super) const PACKETS: usize = FILM_PIXELS / RAYS;
pub(super) const PACKET_EDGE: usize = 4;

/// Where in a film tile pixel `lane` of a packet lies.
#[inline(always)]
pub(super) fn pixel_of(packet: usize, lane: usize) -> usize {
    let [x, y] = corner_of(packet);
    (y + lane / PACKET_EDGE) * FILM_EDGE + x + lane % PACKET_EDGE
}

/// Where in a film tile the upper left pixel of a packet lies. Packets are ordered as the blocks of a tile are: those of a quarter of
/// the film tile lie side by side.
#[inline(always)]
pub(super) fn corner_of(packet: usize) -> [usize; 2] {
    let (quad, inside) = (packet / 16, packet % 16);
    [quad % 2 * 4 + inside % 4, quad / 2 * 4 + inside / 4].map(|at| at * PACKET_EDGE)
}

/// The packet and the lane of a film tile's pixel.
#[inline(always)]
fn packet_of(x: usize, y: usize) -> (usize, usize) {
    (block_at(x / PACKET_EDGE, y / PACKET_EDGE), y % PACKET_EDGE * PACKET_EDGE + x % PACKET_EDGE)
}

/// See the module. By packet, and by sample in each packet.
pub(super) struct Hits {
    pub(super) depth: Vec<[f32; RAYS]>,
    pub(super) node: Vec<[u32; RAYS]>,
}

impl Hits {
    /// Of `samples` a pixel, without any.
    pub(super) fn new(samples: usize) -> Self {
        let count = PACKETS * samples;
        Self { depth: vec![[f32::INFINITY; RAYS]; count], node: vec![[0; RAYS]; count] }
    }

    /// Takes what the rays of a tile met, whose upper left corner is pixel (x, y) of the film tile.
    pub(super) fn keep<S: Simd>(&mut self, simd: S, pass: &Pass, (x, y): (usize, usize), tile: &Tile) {
        if pass.samples == RAYS {
            // A quad's sixteen blocks are the pixels of a packet, their lanes the samples.
            for quad in 0..BLOCKS / RAYS {
                let (packet, _) = packet_of(x + quad % 2 * PACKET_EDGE, y + quad / 2 * PACKET_EDGE);
                let (from, to) = (quad * RAYS..(quad + 1) * RAYS, packet * RAYS..(packet + 1) * RAYS);
                transpose(&tile.depth[from.clone()], &mut self.depth[to.clone()]);
                transpose(&tile.node[from], &mut self.node[to]);
            }
            let _ = simd;
            return;
        }
        for block in 0..BLOCKS {
            let at = block_at(block % EDGE, block / EDGE);
            let (block_x, block_y) = (x + block % EDGE * pass.block_px, y + block / EDGE * pass.block_px);
            for ray in 0..RAYS {
                let (pixel, sample) = (ray / pass.samples, ray % pass.samples);
                let (packet, lane) =
                    packet_of(block_x + pixel % pass.block_px, block_y + pixel / pass.block_px);
                self.depth[packet * pass.samples + sample][lane] = tile.depth[at][ray];
                self.node[packet * pass.samples + sample][lane] = tile.node[at][ray];
            }
        }
    }
}

/// Rows become columns.
#[inline(always)]
fn transpose<T: Copy>(from: &[[T; RAYS]], to: &mut [[T; RAYS]]) {
    for (lane, to) in to.iter_mut().enumerate() {
        for (value, from) in to.iter_mut().zip(from) {
            *value = from[lane];
        }
    }
}
