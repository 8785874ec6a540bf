//! All blocks of a lattice on all threads: sums of blocks become grids.
//!
//! Takes something that fills a block, gives one grid a column. Runs of bricks are the unit of work; a block's values depend on
//! nothing but the block, and runs are joined in order, so that the number of threads changes nothing.

use glam::Vec3;
use rayon::prelude::*;

use super::gather::Found;
use super::statistics::Statistics;
use crate::error::{Error, Result};
use crate::medium::grid::{BRICK, Brick, CORE_SAMPLES, Grid, Lattice};
use crate::progress::Progress;

/// What gives samples their values, 64 at a time.
pub(super) trait Blocks: Sync {
    /// Fills `found.sums` with the values of the block around `middle`, one for each column, and says how many particles its
    /// samples have. `false`: all are 0.
    fn fill(&self, middle: Vec3, found: &mut Found) -> bool;
    /// How many values a sample has.
    fn columns(&self) -> usize;
    /// N*, for the statistics.
    fn target(&self) -> u32;
}

/// Fills the lattice: a grid for each column, and what the samples used. Fails with [`Error::Interrupted`].
pub(super) fn fill(
    blocks: &impl Blocks,
    lattice: &Lattice,
    progress: &dyn Progress,
) -> Result<(Vec<Grid>, Statistics)> {
    let all: Vec<usize> = (0..lattice.brick_count()).collect();
    progress.begin("density", Some(all.len() as u64), "bricks");
    let mut filling = Filling::new(*lattice, blocks.columns());
    filling.fill(blocks, &all, progress)?;
    Ok(filling.finish())
}

/// Grids of which some bricks are filled.
pub(super) struct Filling {
    lattice: Lattice,
    /// The bricks of each column.
    cores: Vec<Vec<Brick>>,
    statistics: Statistics,
}

/// Bricks that a thread fills at a time.
const RUN: usize = 16;

impl Filling {
    /// Grids of that many columns without density.
    pub(super) fn new(lattice: Lattice, columns: usize) -> Self {
        let cores = vec![vec![Brick::EMPTY; lattice.brick_count()]; columns];
        Self { lattice, cores, statistics: Statistics::default() }
    }

    /// Where the samples lie.
    pub(super) fn lattice(&self) -> Lattice {
        self.lattice
    }

    /// Fills the bricks of these numbers, none of which was filled before. Fails with [`Error::Interrupted`].
    pub(super) fn fill(
        &mut self,
        blocks: &impl Blocks,
        numbers: &[usize],
        progress: &dyn Progress,
    ) -> Result<()> {
        let run = |found: &mut Found, numbers: &[usize]| {
            if progress.cancelled() {
                return Err(Error::Interrupted);
            }
            let mut statistics = Statistics::default();
            let cores: Vec<Vec<Brick>> = numbers
                .iter()
                .map(|&number| brick(blocks, &self.lattice, number, (found, &mut statistics)))
                .collect();
            progress.advance(numbers.len() as u64);
            Ok((cores, statistics))
        };
        let runs: Vec<(Vec<Vec<Brick>>, Statistics)> =
            numbers.par_chunks(RUN).map_init(Found::default, run).collect::<Result<_>>()?;
        for (numbers, (bricks, statistics)) in numbers.chunks(RUN).zip(runs) {
            self.statistics = self.statistics.with(statistics);
            for (&number, brick) in numbers.iter().zip(bricks) {
                self.cores.iter_mut().zip(brick).for_each(|(column, core)| column[number] = core);
            }
        }
        Ok(())
    }

    /// The grids, and what their samples used.
    pub(super) fn finish(self) -> (Vec<Grid>, Statistics) {
        let Self { lattice, cores, statistics } = self;
        (cores.into_iter().map(|cores| Grid::from_cores(lattice, cores)).collect(), statistics)
    }
}

/// The samples of brick `number`, column by column.
fn brick(
    blocks: &impl Blocks,
    lattice: &Lattice,
    number: usize,
    (found, statistics): (&mut Found, &mut Statistics),
) -> Vec<Brick> {
    let first = lattice.brick(number).map(|it| it * BRICK);
    let mut cores: Vec<Option<Box<[f32; CORE_SAMPLES]>>> = vec![None; blocks.columns()];
    for block in 0..8_u32 {
        let corner: [u32; 3] = std::array::from_fn(|axis| 4 * (block >> axis & 1));
        let begin: [u32; 3] = std::array::from_fn(|axis| first[axis] + corner[axis]);
        let outside = (0..3).any(|axis| begin[axis] >= lattice.size[axis]);
        if outside || !blocks.fill(lattice.position(begin) + 1.5 * lattice.spacing, found) {
            continue;
        }
        for sample in 0..64_u32 {
            let place: [u32; 3] = std::array::from_fn(|axis| corner[axis] + (sample >> (2 * axis) & 3));
            if (0..3).any(|axis| first[axis] + place[axis] >= lattice.size[axis]) {
                continue;
            }
            let sample = sample as usize;
            let [whole, used] = [&found.whole, &found.used].map(|it| it.as_flattened()[sample]);
            statistics.add(whole, used, blocks.target());
            for (core, sums) in cores.iter_mut().zip(&found.sums) {
                let core = core.get_or_insert_with(|| Box::new([0.0; CORE_SAMPLES]));
                core[(place[2] * 64 + place[1] * 8 + place[0]) as usize] = sums.as_flattened()[sample];
            }
        }
    }
    let filled = |core: Option<Box<[f32; CORE_SAMPLES]>>| {
        core.filter(|core| core.iter().any(|&it| it != 0.0)).map_or(Brick::EMPTY, Brick::Samples)
    };
    cores.into_iter().map(filled).collect()
}
