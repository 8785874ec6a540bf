//! What the samples of a film tile met: depth and node, in packets.
//!
//! A packet is one sample of each of 4 x 4 pixels: neighbors on a surface, so that light can be looked for together. `Hits` is all
//! that has to be kept to light or color a picture anew.

use std::ops::Range;

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
#[derive(Clone)]
pub(crate) struct Hits {
    pub(super) depth: Vec<[f32; RAYS]>,
    pub(super) node: Vec<[u32; RAYS]>,
}

impl Hits {
    /// Of `samples` a pixel, without any.
    pub(super) fn new(samples: usize) -> Self {
        let count = PACKETS * samples;
        Self { depth: vec![[f32::INFINITY; RAYS]; count], node: vec![[0; RAYS]; count] }
    }

    /// A copy of the first `samples` samples' worth, which is all that a pass of so many wrote.
    pub(super) fn of(&self, samples: usize) -> Self {
        let count = PACKETS * samples;
        Self { depth: self.depth[..count].to_vec(), node: self.node[..count].to_vec() }
    }

    /// Memory that it takes, in bytes.
    pub(crate) fn bytes(&self) -> u64 {
        (size_of_val(&self.depth[..]) + size_of_val(&self.node[..])) as u64
    }

    /// Takes what the rays of a tile met, whose upper left corner is pixel `corner` of the film tile.
    pub(super) fn keep(&mut self, pass: &Pass, corner: (usize, usize), tile: &Tile) {
        if pass.samples == RAYS {
            for quad in 0..BLOCKS / RAYS {
                let (in_tile, kept) = quad_and_packet(quad, corner);
                transpose(&tile.depth[in_tile.clone()], &mut self.depth[kept.clone()]);
                transpose(&tile.node[in_tile], &mut self.node[kept]);
            }
            return;
        }
        each_ray(pass, corner, |block, ray, packet, lane| {
            self.depth[packet][lane] = tile.depth[block][ray];
            self.node[packet][lane] = tile.node[block][ray];
        });
    }

    /// Gives back what [`Self::keep`] took.
    pub(super) fn restore(&self, pass: &Pass, corner: (usize, usize), tile: &mut Tile) {
        if pass.samples == RAYS {
            for quad in 0..BLOCKS / RAYS {
                let (in_tile, kept) = quad_and_packet(quad, corner);
                transpose(&self.depth[kept.clone()], &mut tile.depth[in_tile.clone()]);
                transpose(&self.node[kept], &mut tile.node[in_tile]);
            }
            return;
        }
        each_ray(pass, corner, |block, ray, packet, lane| {
            tile.depth[block][ray] = self.depth[packet][lane];
            tile.node[block][ray] = self.node[packet][lane];
        });
    }
}

/// With sixteen samples a pixel, the blocks of a quad of a tile and the samples of a packet: the quad's blocks are the packet's lanes.
fn quad_and_packet(quad: usize, (x, y): (usize, usize)) -> (Range<usize>, Range<usize>) {
    let (packet, _) = packet_of(x + quad % 2 * PACKET_EDGE, y + quad / 2 * PACKET_EDGE);
    (quad * RAYS..(quad + 1) * RAYS, packet * RAYS..(packet + 1) * RAYS)
}

/// Calls `visit` with the place of every ray in the tile and here.
fn each_ray(pass: &Pass, (x, y): (usize, usize), mut visit: impl FnMut(usize, usize, usize, usize)) {
    for block in 0..BLOCKS {
        let (block_x, block_y) = (x + block % EDGE * pass.block_px, y + block / EDGE * pass.block_px);
        for ray in 0..RAYS {
            let (pixel, sample) = (ray / pass.samples, ray % pass.samples);
            let (packet, lane) = packet_of(block_x + pixel % pass.block_px, block_y + pixel / pass.block_px);
            visit(block_at(block % EDGE, block / EDGE), ray, packet * pass.samples + sample, lane);
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
