//! Building: the particles are sorted so that every leaf and every node is a run of them, then all is written level by level.
//!
//! Cuts go along the widest axis and depend on counts alone: a share of a node is a full subtree, but for the last.

use glam::Vec3;
use rayon::prelude::*;

use super::block::{Blocks, Packing, Unfrozen};
use super::shown::Shown;
use super::sizes::Sizes;
use super::{Bvh, LEAF, LEVELS, Node, WIDTH, box_slack, packing_error};
use crate::error::{Error, Result};
use crate::frozen::Frozen;
use crate::math::Bounds;
use crate::progress::Progress;
#[cfg(feature = "gpu")]
use crate::structure::Spheres;
#[cfg(feature = "gpu")]
use crate::structure::build::arranged;
use crate::structure::build::{PROBES, Record, cut, widest};

/// Below this many particles a subtree is sorted by one thread.
const PARALLEL_COUNT: usize = 1 << 14;
/// Progress is told for subtrees with children of this many particles.
const TOLD_SHARE: usize = LEAF * WIDTH * WIDTH;

impl Bvh {
    /// Builds over `records`, in parallel; `radius` is that of all where the records have none. Fails only when interrupted.
    pub(in crate::structure) fn build<const N: usize>(
        mut records: Vec<Record<N>>,
        radius: f32,
        packing: Packing,
        progress: &dyn Progress,
    ) -> Result<Self> {
        sort(&mut records, progress);
        if progress.cancelled() {
            return Err(Error::Interrupted);
        }
        let sizes = if N > 3 {
            let radii: Vec<f32> = records.par_iter().map(|record| record.radius(radius)).collect();
            Sizes::encode(&radii, packing)
        } else {
            Sizes::Uniform(radius)
        };
        let mut blocks = Unfrozen::with_capacity(packing, records.len().div_ceil(LEAF));
        blocks.extend(&records);
        let blocks = blocks.freeze();
        let ids: Vec<u32> = records.par_iter().map(|record| record.id).collect();
        let ids = Frozen::from(ids);
        if packing == Packing::Exact {
            // Nothing to compare with: their memory is free for the nodes.
            drop(records);
            return Ok(Self::over(blocks, sizes, ids, 1.0));
        }
        let bvh = Self::over(blocks, sizes, ids, 1.0);
        let packing_error = Some(packing_error::measure(&records, radius, &bvh));
        Ok(Self { packing_error, ..bvh })
    }

    /// The same hierarchy, with what packing cost beside the `spheres` that it was built from.
    #[cfg(feature = "gpu")]
    pub(in crate::structure) fn measured(self, spheres: Spheres) -> Self {
        if self.blocks.packing() == Packing::Exact {
            return self;
        }
        let packing_error = Some(match spheres.uniform() {
            Some(radius) => packing_error::measure(&arranged::<3>(spheres, &self.ids), radius, &self),
            None => packing_error::measure(&arranged::<4>(spheres, &self.ids), 0.0, &self),
        });
        Self { packing_error, ..self }
    }

    /// The same particles at the same nodes, `by` away from where they are. Boxes are fitted anew; the order of the particles stays.
    pub(in crate::structure) fn moved(&self, by: impl Fn(u32) -> Vec3 + Sync) -> Self {
        let nodes = (0..self.ids.len() as u32).into_par_iter().with_min_len(1 << 12);
        let record = |node| Record { coordinates: (self.sphere(node).0 + by(node)).to_array(), id: node };
        let records: Vec<Record<3>> = nodes.map(record).collect();
        let mut blocks = Unfrozen::with_capacity(self.blocks.packing(), records.len().div_ceil(LEAF));
        blocks.extend(&records);
        let (sizes, ids) = (self.sizes.clone(), self.ids.clone());
        Self { shown: self.shown.clone(), ..Self::over(blocks.freeze(), sizes, ids, self.radius_scale) }
    }

    /// Puts nodes over leaves of particles with `radius_scale` times the radii of `sizes`.
    pub(super) fn over(blocks: Blocks, sizes: Sizes, ids: Frozen<u32>, radius_scale: f32) -> Self {
        let Levels { first, count, top } = Levels::over(ids.len());
        let mut boxes: Vec<Bounds> = (0..count[0] as usize)
            .into_par_iter()
            .with_min_len(1 << 10)
            .map(|leaf| {
                let places = 0..LEAF.min(ids.len() - leaf * LEAF);
                let sphere = |place| {
                    let center = blocks.center(leaf, place);
                    Bounds { min: center, max: center }.grown(radius_scale * sizes.radius(leaf, place))
                };
                places.map(sphere).fold(Bounds::EMPTY, Bounds::union)
            })
            .collect();
        let mut nodes: Vec<Node> = Vec::new();
        for _ in 0..top {
            nodes.par_extend(boxes.par_chunks(WIDTH).map(Node::encode));
            boxes = boxes
                .par_chunks(WIDTH)
                .map(|boxes| boxes.iter().copied().fold(Bounds::EMPTY, Bounds::union))
                .collect();
        }
        let bounds = boxes.first().copied().unwrap_or(Bounds::EMPTY);
        let levels = Levels { first, count, top };
        Self { radius_scale, ..Self::of(levels, nodes.into(), blocks, sizes, ids, bounds) }
    }

    /// A hierarchy of these arrays, with radii as they are held, none of them packed, and all particles shown.
    pub(super) fn of(
        levels: Levels,
        nodes: Frozen<Node>,
        blocks: Blocks,
        sizes: Sizes,
        ids: Frozen<u32>,
        bounds: Bounds,
    ) -> Self {
        let Levels { first, count, top } = levels;
        Self {
            nodes,
            first,
            count,
            top,
            blocks,
            sizes,
            radius_scale: 1.0,
            ids,
            slack: box_slack(&bounds),
            bounds,
            boxes: bounds,
            packing_error: None,
            shown: Shown::default(),
        }
    }
}

/// What levels a hierarchy has: see [`Bvh`].
#[derive(Clone, Copy)]
pub(super) struct Levels {
    pub(super) first: [u32; LEVELS],
    pub(super) count: [u32; LEVELS],
    pub(super) top: u8,
}

impl Levels {
    /// Those over so many particles.
    pub(super) fn over(particles: usize) -> Self {
        let mut levels = Self { first: [0; LEVELS], count: [0; LEVELS], top: 0 };
        let (mut count, mut nodes) = (particles.div_ceil(LEAF) as u32, 0);
        levels.count[0] = count;
        while count > 1 || (levels.top == 0 && count > 0) {
            count = count.div_ceil(WIDTH as u32);
            levels.top += 1;
            levels.first[levels.top as usize] = nodes;
            levels.count[levels.top as usize] = count;
            nodes += count;
        }
        levels
    }
}

/// Sorts records so that each full subtree is a run of them.
pub(super) fn sort<const N: usize>(records: &mut [Record<N>], progress: &dyn Progress) {
    if progress.cancelled() {
        return;
    }
    let mut share = LEAF;
    while share * WIDTH < records.len() {
        share *= WIDTH;
    }
    cut_shares(records, share);
    if share > PARALLEL_COUNT {
        records.par_chunks_mut(share).for_each(|records| sort(records, progress));
    } else if share > LEAF {
        records.chunks_mut(share).for_each(|records| sort(records, progress));
    }
    if share == TOLD_SHARE {
        progress.advance(records.len() as u64);
    }
}

/// Permutes `records` so that each run of `share` lies together, by cuts along the widest axis, half of the runs at a time.
fn cut_shares<const N: usize>(records: &mut [Record<N>], share: usize) {
    let shares = records.len().div_ceil(share);
    if shares < 2 {
        return;
    }
    let left_count = shares.div_ceil(2) * share;
    let axis = widest(records, PROBES);
    cut(records, axis, left_count);
    let (left, right) = records.split_at_mut(left_count);
    if left_count > PARALLEL_COUNT {
        rayon::join(|| cut_shares(left, share), || cut_shares(right, share));
    } else {
        cut_shares(left, share);
        cut_shares(right, share);
    }
}
