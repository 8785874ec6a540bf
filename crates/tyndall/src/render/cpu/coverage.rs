//! Certificates that parts of a tile are covered: what starts behind them is hidden from every ray that can ever go through there.
//!
//! A pixel is cut into 4 x 4 cells. A cell that lies wholly inside the disc of a projected sphere is closed behind the depth at which
//! the last of its rays enters that sphere. A quarter of a tile is closed behind the deepest of its cells, if all are closed. The
//! spheres that are tried are those that samples met. All bounds give way by the rounding of the hit formula.

use std::sync::atomic::{AtomicU64, Ordering};

use fearless_simd::{f32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::Vec3;

use super::Pass;
use super::tiles::{BLOCKS, EDGE, Entry, Memory, QUADS, RAYS, Tile, block_at};
use crate::math::HIT_ROUNDING;
use crate::simd::{Lanes3, grown};
use crate::structure::bvh::{Bvh, Place, WIDTH};

/// Forgets what is hidden behind covered quads of the tile at pixel `corner`, whose blocks are one pixel each.
pub(super) fn forget_hidden<S: Simd>(
    simd: S,
    pass: &Pass,
    bvh: &Bvh,
    corner: (usize, usize),
    tile: &Tile,
    memory: &mut Memory,
) {
    let mut closed = [f32::INFINITY; QUADS];
    for (quad, closed) in closed.iter_mut().enumerate() {
        *closed = closed_behind(simd, pass, bvh, corner, quad, tile);
    }
    let can_be_seen =
        |entry: &Entry| (0..QUADS).any(|quad| entry.touched >> quad & 1 == 1 && entry.near <= closed[quad]);
    memory.leaves.retain(can_be_seen);
    memory.behind.retain(can_be_seen);
}

/// The depth behind which no ray through the quad sees anything.
#[simd]
fn closed_behind<S: Simd>(
    simd: S,
    pass: &Pass,
    bvh: &Bvh,
    corner: (usize, usize),
    quad: usize,
    tile: &Tile,
) -> f32 {
    let blocks = quad * (BLOCKS / QUADS)..(quad + 1) * (BLOCKS / QUADS);
    let mut nodes = Vec::with_capacity(BLOCKS);
    for block in blocks.clone() {
        for lane in 0..RAYS {
            if tile.depth[block][lane] < f32::INFINITY && nodes.last() != Some(&tile.node[block][lane]) {
                nodes.push(tile.node[block][lane]);
            }
        }
    }
    nodes.sort_unstable();
    nodes.dedup();
    let mut deepest = 0.0_f32;
    for y in quad / 2 * 4..quad / 2 * 4 + EDGE / 2 {
        for x in quad % 2 * 4..quad % 2 * 4 + EDGE / 2 {
            debug_assert!(blocks.contains(&block_at(x, y)));
            let cells = pass.cell_rays(simd, (corner.0 + x, corner.1 + y));
            let mut behind = f32x16::splat(simd, f32::INFINITY);
            for &node in &nodes {
                behind = behind.min(covered_behind(simd, pass, bvh.sphere(node), cells));
            }
            deepest = deepest.max(behind.reduce_max());
            if deepest == f32::INFINITY {
                return deepest;
            }
        }
    }
    deepest
}

/// By cell the depth behind which the sphere hides all; infinite where it does not cover the cell. `varying` are the rays through
/// the middles of the cells.
#[inline(always)]
fn covered_behind<S: Simd>(
    simd: S,
    pass: &Pass,
    (center, radius): (Vec3, f32),
    varying: Lanes3<f32x16<S>>,
) -> f32x16<S> {
    let view = &pass.view;
    let (to_center, direction) = if view.perspective {
        (Lanes3::splat(simd, center - view.eye), varying)
    } else {
        (Lanes3::splat(simd, center).minus(varying), Lanes3::splat(simd, view.forward))
    };
    let zero = f32x16::splat(simd, 0.0);
    let closest = to_center.dot(direction);
    let off = to_center.minus(direction.times(closest));
    let off_axis = off.dot(off).sqrt();
    // How far a ray of the cell passes from the ray through its middle: half a diagonal, at the sphere's distance.
    // Half the diagonal of a quarter of a pixel; a picture's coordinates are rounded in proportion to its size.
    let half_diagonal =
        f32x16::splat(simd, 0.177 * view.pixel + 2.0 * HIT_ROUNDING * (view.left.abs() + view.top.abs()));
    let apart = if view.perspective {
        half_diagonal * to_center.dot(to_center).sqrt() * f32x16::splat(simd, 1.000_01)
    } else {
        half_diagonal
    };
    let size = f32x16::splat(simd, radius);
    let margin = grown(simd, size, to_center, 0.0) - size;
    let farthest = off_axis + apart + margin + margin;
    let half_chord_sq = size * size - farthest * farthest;
    let covers = half_chord_sq.simd_gt(zero) & closest.simd_gt(size + size);
    let ahead = if view.perspective { closest + apart } else { closest };
    let last = ahead - half_chord_sq.max(zero).sqrt() + margin;
    covers.select(last, f32x16::splat(simd, f32::INFINITY))
}

/// The leaves that can be seen by rays of a view, as bits.
pub(crate) struct Visible {
    words: Vec<AtomicU64>,
    leaves: usize,
}

/// Leaves of a brick: 4 million particles.
const BRICK_LEAVES: usize = 1 << 18;

impl Visible {
    /// None of `bvh` so far.
    pub(crate) fn new(bvh: &Bvh) -> Self {
        let leaves = bvh.leaf_count();
        Self { words: (0..leaves.div_ceil(64)).map(|_| AtomicU64::new(0)).collect(), leaves }
    }

    /// Adds what a tile remembers.
    pub(super) fn add(&self, memory: &Memory) {
        for entry in memory.leaves.iter().chain(&memory.behind) {
            let Place { index, level } = entry.place;
            let below = WIDTH.pow(u32::from(level));
            let first = index as usize * below;
            for leaf in first..(first + below).min(self.leaves) {
                let (word, bit) = (&self.words[leaf / 64], 1 << (leaf % 64));
                // Reading first: most are set already, and are shared by all threads.
                if word.load(Ordering::Relaxed) & bit == 0 {
                    word.fetch_or(bit, Ordering::Relaxed);
                }
            }
        }
    }

    /// How many leaves and bricks there are, and how many of each cannot be seen.
    pub(crate) fn evicted(&self) -> [[u64; 2]; 2] {
        let seen = |leaf: usize| self.words[leaf / 64].load(Ordering::Relaxed) >> (leaf % 64) & 1 == 1;
        let hidden = (0..self.leaves).filter(|&leaf| !seen(leaf)).count();
        let bricks = self.leaves.div_ceil(BRICK_LEAVES);
        let brick = |brick: usize| brick * BRICK_LEAVES..((brick + 1) * BRICK_LEAVES).min(self.leaves);
        let hidden_bricks = (0..bricks).filter(|&at| !brick(at).any(seen)).count();
        [[self.leaves as u64, hidden as u64], [bricks as u64, hidden_bricks as u64]]
    }
}
