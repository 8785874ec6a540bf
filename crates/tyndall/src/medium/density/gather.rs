//! The density as a gather: each sample of the lattice finds its length and sums the particles within it.
//!
//! Takes cells and a rule for lengths, gives sums of 64 samples at a time. With N0 particles within h0 of a sample: N0 = 0 leaves
//! the density 0; up to N* leave the length h0, since no length can be right; N1 = N* leaves it h1; and a length that holds no
//! particle although N0 > N* is corrected until it does.

use fearless_simd::{Level, Simd, dispatch};
use fearless_simd_macros::simd;
use glam::Vec3;

use super::block::{Block, Near, Samples, count, distances_sq, sum};
use super::finer::Parted;
use super::length::{Bracket, Held, alpha};
use super::select::nth_smallest;
use super::volume::{Blocks, Filling};
use super::{Settings, Smoothing};
use crate::error::Result;
use crate::medium::cells::{CELL, Cells, Counted, Within};
use crate::medium::kernel::Shape;
use crate::progress::Progress;

/// How samples come to their lengths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Rule {
    /// All have h0.
    Uniform,
    /// Predicted, then corrected so often, the first time with the factor s.
    Corrected { passes: u32, scale: f32 },
    /// The distance of the N*-th particle.
    Exact,
}

impl Rule {
    /// What settings say; those of a scatter say nothing.
    pub(super) fn of(settings: &Settings) -> Self {
        match settings.smoothing {
            Smoothing::Uniform => Self::Uniform,
            Smoothing::TwoPass => Self::Corrected { passes: 0, scale: 0.0 },
            Smoothing::Exact => Self::Exact,
            Smoothing::ThreePass | Smoothing::Scatter => {
                Self::Corrected { passes: 1 + settings.further_passes, scale: settings.scale }
            }
        }
    }
}

/// What all samples share.
pub(super) struct Gather<'a, K> {
    pub(super) cells: &'a Cells,
    pub(super) block: Block,
    pub(super) shape: K,
    pub(super) rule: Rule,
    /// h0.
    pub(super) longest: f32,
    /// N*.
    pub(super) target: f32,
    /// What the particles add: their weights first, then the fields' products; the kernel's normalization is in them.
    pub(super) columns: &'a [&'a [[f32; CELL]]],
}

impl<K: Shape> Gather<'_, K> {
    /// Fills bricks with finer samples.
    pub(super) fn part(
        &self,
        filling: &mut Filling,
        parted: &[Parted],
        progress: &dyn Progress,
    ) -> Result<()> {
        let spacing = filling.lattice().spacing;
        let spaced = |level: u32| Self { block: Block::new(spacing / (1 << level) as f32), ..*self };
        filling.part(spaced, parted, progress)
    }
}

impl<K: Shape> Blocks for Gather<'_, K> {
    fn fill(&self, middle: Vec3, found: &mut Found) -> bool {
        dispatch!(Level::new(), simd => self.fill_block(simd, middle, found))
    }

    fn columns(&self) -> usize {
        self.columns.len()
    }

    fn target(&self) -> u32 {
        self.target as u32
    }
}

/// What is known about the samples of a block, and room for the work.
#[derive(Default)]
pub(super) struct Found {
    /// N0.
    pub(super) whole: Samples<u32>,
    /// Particles within the sample's length.
    pub(super) used: Samples<u32>,
    /// Squares of the samples' lengths.
    pub(super) length_sq: Samples<f32>,
    /// For each column the samples' values.
    pub(super) sums: Vec<Samples<f32>>,
    pub(super) near: Near,
    /// The reach of the particles in `near`; `None` if those that reach all of the block are missing.
    collected: Option<f32>,
    searches: Samples<Option<Search>>,
    distances_sq: Vec<[f32; 16]>,
}

/// The search for the length of a sample that has more than it needs within h0.
#[derive(Clone, Copy)]
struct Search {
    bracket: Bracket,
    /// The cube of the sample's present length.
    cubed: f32,
    /// Whether the present length is the final one.
    settled: bool,
}

/// Further corrections of a length that holds no particle, before the bracket's upper end is taken.
const HOLE_PASSES: usize = 8;
/// Particles within the length from which the exact search looks for the N*-th, over N*.
const EXCESS: f32 = 3.0;
/// By how much the exact search aims higher than N*, so that one pass usually gives enough.
const MARGIN: f32 = 1.3;
/// Passes after which the exact search takes what it has.
const EXACT_PASSES: usize = 12;
/// The square of the least length: what divides by it stays finite.
const SHORTEST_SQ: f32 = 1e-24;
/// Particles are collected anew when the needed length falls below this share of the collected one.
const REUSE: f32 = 0.8;

impl<K: Shape> Gather<'_, K> {
    /// Fills `found` for the block around `middle`. `false`: no particle is within h0 of the block, and nothing was summed.
    #[simd]
    fn fill_block<S: Simd>(&self, simd: S, middle: Vec3, found: &mut Found) -> bool {
        found.length_sq = [[self.longest * self.longest; 16]; 4];
        found.collected = None;
        found.sums.resize(self.columns.len(), [[0.0; 16]; 4]);
        if self.rule == Rule::Uniform {
            self.collect(simd, middle, self.longest, found);
            if found.near.len() == 0 {
                return false;
            }
            self.sum(simd, middle, found);
            found.whole = found.used;
            divide_by_volume(found);
            return true;
        }

        // Predict: count within h0.
        let none = [self.columns[0]; 2];
        found.near.collect(simd, self.cells, (&self.block, middle), &Counted(self.longest), none);
        if found.near.len() == 0 && found.near.everywhere() == 0 {
            return false;
        }
        count(simd, &self.block, &found.near, &found.length_sq, &mut found.whole);
        self.predict(found);

        // Correct.
        match self.rule {
            Rule::Uniform => {}
            Rule::Corrected { passes, scale } => {
                for pass in 0..passes {
                    self.correct(simd, middle, if pass == 0 { scale } else { 0.0 }, found);
                }
            }
            Rule::Exact => self.search(simd, middle, found),
        }

        // Sum, and mend lengths that hold no particle.
        self.sum(simd, middle, found);
        for pass in 0..=HOLE_PASSES {
            if !self.mend(pass, found) {
                break;
            }
            self.sum(simd, middle, found);
        }
        divide_by_volume(found);
        true
    }

    /// Collects the particles within `reach` of the block, unless those at hand serve.
    #[inline(always)]
    fn collect<S: Simd>(&self, simd: S, middle: Vec3, reach: f32, found: &mut Found) {
        if found.collected.is_some_and(|it| reach <= it && reach >= REUSE * it) {
            return;
        }
        let columns = [self.columns[0]; 2];
        found.near.collect(simd, self.cells, (&self.block, middle), &Within(reach), columns);
        found.collected = Some(reach);
    }

    /// The first lengths.
    fn predict(&self, found: &mut Found) {
        let cubed = self.longest.powi(3);
        for sample in 0..64 {
            let n0 = found.whole.as_flattened()[sample] as f32;
            let enough = if self.rule == Rule::Exact { n0 >= self.target } else { n0 > self.target };
            // h0 itself is a good start for the exact search.
            let settled = self.rule == Rule::Exact && n0 <= EXCESS * self.target;
            found.searches.as_flattened_mut()[sample] = enough.then(|| {
                let bracket = Bracket::below(Held { cubed, count: n0 });
                let cubed = if settled { cubed } else { bracket.interpolate(self.target) };
                if !settled {
                    found.length_sq.as_flattened_mut()[sample] = squared(cubed);
                }
                Search { bracket, cubed, settled }
            });
        }
    }

    /// Counts within the present lengths that are not settled.
    #[inline(always)]
    fn count_open<S: Simd>(&self, simd: S, middle: Vec3, found: &mut Found) {
        let mut reach_sq = 0.0_f32;
        for (search, &length_sq) in found.searches.as_flattened().iter().zip(found.length_sq.as_flattened()) {
            if search.is_some_and(|it| !it.settled) {
                reach_sq = reach_sq.max(length_sq);
            }
        }
        self.collect(simd, middle, reach_sq.sqrt(), found);
        count(simd, &self.block, &found.near, &found.length_sq, &mut found.used);
    }

    /// One correction: counts, and moves on the tightest bracket.
    #[inline(always)]
    fn correct<S: Simd>(&self, simd: S, middle: Vec3, scale: f32, found: &mut Found) {
        self.count_open(simd, middle, found);
        for sample in 0..64 {
            let Some(search) = &mut found.searches.as_flattened_mut()[sample] else { continue };
            let held = Held { cubed: search.cubed, count: found.used.as_flattened()[sample] as f32 };
            search.settled |= held.count == self.target;
            if search.settled {
                continue;
            }
            let n0 = found.whole.as_flattened()[sample] as f32;
            search.bracket = search.bracket.narrowed(held, self.target);
            search.cubed = search.bracket.interpolate(self.target);
            if held.count > self.target {
                search.cubed *= alpha(scale, held.count, n0).powi(3);
            }
            found.length_sq.as_flattened_mut()[sample] = squared(search.cubed);
        }
    }

    /// Finds lengths that hold N* and little more, then the N*-th distance itself.
    #[inline(always)]
    fn search<S: Simd>(&self, simd: S, middle: Vec3, found: &mut Found) {
        for _ in 0..EXACT_PASSES {
            if found.searches.as_flattened().iter().flatten().all(|it| it.settled) {
                break;
            }
            self.count_open(simd, middle, found);
            for sample in 0..64 {
                let Some(search) = &mut found.searches.as_flattened_mut()[sample] else { continue };
                if search.settled {
                    continue;
                }
                let held = Held { cubed: search.cubed, count: found.used.as_flattened()[sample] as f32 };
                search.bracket = search.bracket.narrowed(held, self.target);
                search.settled = (self.target..=EXCESS * self.target).contains(&held.count);
                if !search.settled {
                    let aim = (MARGIN * self.target).min(search.bracket.high.count);
                    search.cubed = search.bracket.interpolate(aim);
                    found.length_sq.as_flattened_mut()[sample] = squared(search.cubed);
                }
            }
        }
        let mut reach_sq = 0.0_f32;
        for sample in 0..64 {
            let length_sq = &mut found.length_sq.as_flattened_mut()[sample];
            match found.searches.as_flattened()[sample] {
                Some(it) if !it.settled => {
                    *length_sq = squared(it.bracket.high.cubed) * (1.0 + 4.0 * f32::EPSILON)
                }
                Some(_) => {}
                None => continue,
            }
            reach_sq = reach_sq.max(*length_sq);
        }
        if reach_sq == 0.0 {
            return;
        }
        self.collect(simd, middle, reach_sq.sqrt(), found);
        let target = self.target as u32;
        for plane in 0..4 {
            distances_sq(simd, &self.block, &found.near, plane, &mut found.distances_sq);
            let lengths =
                nth_smallest(simd, &found.distances_sq[..found.near.len()], &found.length_sq[plane], target);
            for (lane, length_sq) in lengths.into_iter().enumerate() {
                if found.searches[plane][lane].is_some() {
                    // N* particles at the sample itself would leave a length of 0.
                    found.length_sq[plane][lane] = length_sq.max(SHORTEST_SQ);
                }
            }
        }
    }

    /// Lengthens what holds no particle. `false`: there is none.
    fn mend(&self, pass: usize, found: &mut Found) -> bool {
        let mut holes = false;
        for sample in 0..64 {
            let Some(search) = &mut found.searches.as_flattened_mut()[sample] else { continue };
            if found.used.as_flattened()[sample] > 0 {
                continue;
            }
            holes = true;
            search.bracket.low = Held { cubed: search.cubed.max(search.bracket.low.cubed), count: 0.0 };
            let Bracket { low, high } = search.bracket;
            search.cubed = match pass {
                0 => search.bracket.interpolate(self.target),
                // Beside a wall of particles the count leaps and interpolation creeps: halve.
                1..HOLE_PASSES => 0.5 * (low.cubed + high.cubed),
                _ => high.cubed,
            };
            found.length_sq.as_flattened_mut()[sample] = squared(search.cubed);
        }
        holes
    }

    /// Sums every column within the present lengths.
    #[inline(always)]
    fn sum<S: Simd>(&self, simd: S, middle: Vec3, found: &mut Found) {
        let longest_sq = found.length_sq.as_flattened().iter().copied().fold(0.0, f32::max);
        self.collect(simd, middle, longest_sq.sqrt(), found);
        let kernel = (self.shape, &self.block);
        sum(simd, kernel, &found.near, &found.length_sq, (&mut found.sums[0], &mut found.used));
        for (place, column) in self.columns.iter().enumerate().skip(1) {
            let reach = Within(longest_sq.sqrt());
            found.near.collect(simd, self.cells, (&self.block, middle), &reach, [column; 2]);
            found.collected = None;
            sum(simd, kernel, &found.near, &found.length_sq, (&mut found.sums[place], &mut found.used));
        }
    }
}

/// Makes densities of sums.
fn divide_by_volume(found: &mut Found) {
    for sums in &mut found.sums {
        for (sum, length_sq) in sums.as_flattened_mut().iter_mut().zip(found.length_sq.as_flattened()) {
            let density = *sum / (length_sq * length_sq.sqrt());
            *sum = density.clamp(f32::MIN, f32::MAX);
        }
    }
}

/// The square of the length whose cube is given.
#[inline(always)]
fn squared(cubed: f32) -> f32 {
    let length = cubed.cbrt();
    length * length
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::medium::kernel::CubicSpline;
    use crate::particles::Positions;
    use crate::random::Stream;

    #[test]
    fn the_width_of_lanes_changes_nothing() {
        let mut stream = Stream::new(21, 0);
        let mut offsets: [Vec<f32>; 3] = Default::default();
        for _ in 0..2000 {
            let place = stream.normal3() * stream.unit();
            (0..3).for_each(|axis| offsets[axis].push(place[axis]));
        }
        let cells = Cells::new(&Positions::from_offsets(DVec3::ZERO, offsets));
        let weights = cells.column(|id| 1.0 + id as f32 * 1e-3);
        let columns: [&[[f32; CELL]]; 1] = [&weights];
        let corrected = Rule::Corrected { passes: 2, scale: 0.1 };
        for (rule, longest) in [(Rule::Uniform, 0.4), (corrected, 0.9), (Rule::Exact, 0.9)] {
            let (block, target) = (Block::new(0.1), 30.0);
            let gather =
                Gather { cells: &cells, block, shape: CubicSpline, rule, longest, target, columns: &columns };
            let by = |level: Level| {
                let mut found = Found::default();
                let filled = dispatch!(level, simd => gather.fill_block(simd, Vec3::splat(0.2), &mut found));
                assert!(filled, "{rule:?}");
                (found.sums[0].map(|plane| plane.map(f32::to_bits)), found.used)
            };
            assert_eq!(by(Level::new()), by(Level::baseline()), "{rule:?}");
        }
    }
}
