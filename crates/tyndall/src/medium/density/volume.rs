//! All blocks of a lattice on all threads: sums of blocks become grids.
//!
//! Takes something that fills a block, gives one grid a column. Runs of bricks are the unit of work; a block's values depend on
//! nothing but the block, and runs are joined in order, so that the number of threads changes nothing.

use glam::Vec3;
use rayon::prelude::*;

use super::finer::Parted;
use super::gather::Found;
use super::statistics::Statistics;
use crate::error::{Error, Result};
use crate::medium::grid::{BRICK, Brick, CORE_SAMPLES, Fine, Grid, Lattice, MOST_LEVELS};
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

/// Grids of which some bricks are filled.
pub(super) struct Filling {
    lattice: Lattice,
    /// The bricks of each column.
    cores: Vec<Vec<Brick>>,
    /// The square of the shortest length of each brick's samples; infinite without particles.
    shortest_sq: Vec<f32>,
    /// Finer samples of each column.
    fine: Vec<Vec<Fine>>,
    statistics: Statistics,
}

/// A brick that is filled.
struct Filled {
    columns: Vec<Brick>,
    shortest_sq: f32,
}

/// Share of the mass for which no brick is parted.
const NEGLIGIBLE: f64 = 0.01;
/// Bricks that a thread fills at a time.
const RUN: usize = 16;

impl Filling {
    /// Grids of that many columns without density.
    pub(super) fn new(lattice: Lattice, columns: usize) -> Self {
        let cores = vec![vec![Brick::EMPTY; lattice.brick_count()]; columns];
        let shortest_sq = vec![f32::INFINITY; lattice.brick_count()];
        let fine = vec![Vec::new(); columns];
        Self { lattice, cores, shortest_sq, fine, statistics: Statistics::default() }
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
            let filled: Vec<Filled> = numbers
                .iter()
                .map(|&number| brick(blocks, &self.lattice, number, (found, &mut statistics)))
                .collect();
            progress.advance(numbers.len() as u64);
            Ok((filled, statistics))
        };
        let runs: Vec<(Vec<Filled>, Statistics)> =
            numbers.par_chunks(RUN).map_init(Found::default, run).collect::<Result<_>>()?;
        for (numbers, (bricks, statistics)) in numbers.chunks(RUN).zip(runs) {
            self.statistics = self.statistics.with(statistics);
            for (&number, brick) in numbers.iter().zip(bricks) {
                self.shortest_sq[number] = brick.shortest_sq;
                self.cores.iter_mut().zip(brick.columns).for_each(|(column, core)| column[number] = core);
            }
        }
        Ok(())
    }

    /// Which bricks are to be parted, at most `most` times in halves, in so much memory: those of which a sample has a length below six
    /// spacings of the lattice, so that three spacings of their own are not more than it. None if they hold no more than
    /// [`NEGLIGIBLE`] of the mass.
    pub(super) fn parted(&self, most: u32, room_bytes: u64) -> Vec<Parted> {
        let asked: Vec<Parted> = (0..)
            .zip(&self.shortest_sq)
            .map(|(brick, length_sq)| {
                let level = (3.0 * self.lattice.spacing / length_sq.sqrt()).log2().floor() as u32;
                Parted { brick, level: level.min(most) }
            })
            .filter(|it| it.level > 0)
            .collect();
        let mass = |brick: usize| self.cores[0][brick].sum();
        let of_asked: f64 = asked.iter().map(|it| mass(it.brick)).sum();
        let of_all: f64 = (0..self.cores[0].len()).map(mass).sum();
        if of_asked <= NEGLIGIBLE * of_all {
            return Vec::new();
        }
        let at_most = |level: u32| asked.iter().map(move |it| Parted { level: it.level.min(level), ..*it });
        let bytes = |level: u32| at_most(level).map(|it| it.bytes()).sum::<u64>() * self.cores.len() as u64;
        let fits = (1..=most).rev().find(|&level| bytes(level) <= room_bytes);
        fits.map_or(Vec::new(), |level| at_most(level).collect())
    }

    /// Fills bricks with finer samples: `blocks` gives what does so by level. Fails with [`Error::Interrupted`].
    pub(super) fn part<B: Blocks>(
        &mut self,
        blocks: impl Fn(u32) -> B,
        parted: &[Parted],
        progress: &dyn Progress,
    ) -> Result<()> {
        let blocks: Vec<B> = (0..=MOST_LEVELS).map(blocks).collect();
        let one = |found: &mut Found, parted: &Parted| {
            if progress.cancelled() {
                return Err(Error::Interrupted);
            }
            let samples = parted.samples(&blocks[parted.level as usize], &self.lattice, found);
            progress.advance(1);
            Ok(samples)
        };
        let found: Vec<Vec<Vec<f32>>> =
            parted.par_iter().map_init(Found::default, one).collect::<Result<_>>()?;
        for (&Parted { brick, level }, columns) in parted.iter().zip(found) {
            for (fine, samples) in self.fine.iter_mut().zip(columns) {
                fine.push(Fine { brick, level, samples });
            }
        }
        Ok(())
    }

    /// The grids, and what their samples used.
    pub(super) fn finish(self) -> (Vec<Grid>, Statistics) {
        let Self { lattice, cores, fine, statistics, .. } = self;
        let grids = cores.into_iter().zip(&fine).map(|(cores, fine)| Grid::from_levels(lattice, cores, fine));
        (grids.collect(), statistics)
    }
}

/// The samples of brick `number`, column by column.
fn brick(
    blocks: &impl Blocks,
    lattice: &Lattice,
    number: usize,
    (found, statistics): (&mut Found, &mut Statistics),
) -> Filled {
    let mut shortest_sq = f32::INFINITY;
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
            if whole > 0 {
                shortest_sq = shortest_sq.min(found.length_sq.as_flattened()[sample]);
            }
            for (core, sums) in cores.iter_mut().zip(&found.sums) {
                let core = core.get_or_insert_with(|| Box::new([0.0; CORE_SAMPLES]));
                core[(place[2] * 64 + place[1] * 8 + place[0]) as usize] = sums.as_flattened()[sample];
            }
        }
    }
    let filled = |core: Option<Box<[f32; CORE_SAMPLES]>>| {
        core.filter(|core| core.iter().any(|&it| it != 0.0)).map_or(Brick::EMPTY, Brick::Samples)
    };
    Filled { columns: cores.into_iter().map(filled).collect(), shortest_sq }
}
