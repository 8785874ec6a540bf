//! Which particles are shown: rules, decided once for every particle when they change, so that walks read a bit and nothing else.
//!
//! A rule asks for a number of the particle ([`Column`], a stream apart from the leaves that no walk touches) or for the place of its
//! center. [`super::Structure::show`] decides it for every particle by itself, so that what is shown is exact; bounding boxes, and masks
//! of which of 32 bins of numbers a subtree holds, only spare that where all or none of a subtree are wanted. The result is a bit a
//! particle, and for the subtrees of a structure whether any is shown.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::by_node;
use crate::math::Bounds;

/// Nodes whose bits stand in one word: a leaf of the hierarchy.
pub(super) const RUN: usize = 16;
/// Runs under a mask of the next level: children of a node of the hierarchy.
const WIDTH: usize = 8;
/// Bins of a column's numbers; the last one is that of NaN.
const BINS: usize = 32;
/// Numbers that decide where bins end.
const SAMPLE: usize = 4096;

/// A number of every particle, in single precision where that is exact.
pub struct Numbers(Store);

enum Store {
    Single(Vec<f32>),
    Double(Vec<f64>),
}

impl Numbers {
    /// Those that `number` gives for 0 to `count`.
    pub fn collect(count: usize, number: impl Fn(usize) -> f64 + Sync + Send) -> Self {
        let ids = || (0..count).into_par_iter().with_min_len(1 << 14);
        let is_single = |id| {
            let exact: f64 = number(id);
            exact.is_nan() || f64::from(exact as f32) == exact
        };
        Self(if ids().all(is_single) {
            Store::Single(ids().map(|id| number(id) as f32).collect())
        } else {
            Store::Double(ids().map(number).collect())
        })
    }

    #[inline(always)]
    fn number(&self, place: usize) -> f64 {
        match &self.0 {
            Store::Single(column) => f64::from(column[place]),
            Store::Double(column) => column[place],
        }
    }

    /// What `of` makes of each.
    pub fn map<T: Send>(&self, of: impl Fn(f64) -> T + Sync + Send) -> Vec<T> {
        (0..self.len()).into_par_iter().with_min_len(1 << 14).map(|place| of(self.number(place))).collect()
    }

    fn len(&self) -> usize {
        match &self.0 {
            Store::Single(column) => column.len(),
            Store::Double(column) => column.len(),
        }
    }
}

/// Of each bin the least and the greatest number in it; empty bins have none.
type Bins = [Option<[f64; 2]>; BINS];

/// A number of every particle of a structure, by node, with masks of which numbers occur where.
pub struct Column {
    numbers: Numbers,
    bins: Bins,
    /// A bit for every bin that occurs: by runs of 16 nodes, by 8 such runs, by 8 of these, and so on.
    presence: Vec<Vec<u32>>,
}

impl Column {
    /// Arranges numbers that stand by id; `ids` are those of the structure's nodes.
    pub fn new(numbers: &Numbers, ids: &[u32]) -> Self {
        let numbers = Numbers(match &numbers.0 {
            Store::Single(column) => Store::Single(by_node(column, ids, f32::NAN)),
            Store::Double(column) => Store::Double(by_node(column, ids, f64::NAN)),
        });
        let ends = ends(&numbers);
        let bin = |number: f64| match number.is_nan() {
            true => BINS - 1,
            false => ends.partition_point(|&end| end <= number),
        };
        let none = || [None; BINS];
        let run = |run: usize| {
            let (mut mask, mut bins) = (0, none());
            for node in run * RUN..((run + 1) * RUN).min(numbers.len()) {
                let number = numbers.number(node);
                let bin = bin(number);
                mask |= 1 << bin;
                bins[bin] = joined(bins[bin], Some([number; 2]));
            }
            (mask, bins)
        };
        let runs = (0..numbers.len().div_ceil(RUN)).into_par_iter().with_min_len(1 << 10);
        let parts = runs.fold(
            || (Vec::new(), none()),
            |(mut masks, bins), at| {
                let (mask, own) = run(at);
                masks.push(mask);
                (masks, std::array::from_fn(|bin| joined(bins[bin], own[bin])))
            },
        );
        let (masks, bins): (Vec<Vec<u32>>, Vec<Bins>) = parts.collect::<Vec<_>>().into_iter().unzip();
        let bins = bins.into_iter().fold(none(), |a, b| std::array::from_fn(|bin| joined(a[bin], b[bin])));
        let mut presence = vec![masks.concat()];
        while let Some(below) = presence.last().filter(|below| below.len() > 1) {
            let above = below.par_chunks(WIDTH).map(|masks| masks.iter().fold(0, |all, mask| all | mask));
            presence.push(above.collect());
        }
        Self { numbers, bins, presence }
    }

    /// The least and the greatest number that occur; none where all are missing.
    pub fn span(&self) -> Option<[f64; 2]> {
        self.bins[..BINS - 1].iter().copied().fold(None, joined)
    }

    /// The numbers that occur, in ascending order, where they are few.
    pub fn values(&self) -> Option<Vec<f64>> {
        let present = self.bins[..BINS - 1].iter().flatten();
        present.map(|&[least, greatest]| (least == greatest).then_some(least)).collect()
    }
}

/// The least and the greatest of both.
fn joined(a: Option<[f64; 2]>, b: Option<[f64; 2]>) -> Option<[f64; 2]> {
    match (a, b) {
        (Some(a), Some(b)) => Some([a[0].min(b[0]), a[1].max(b[1])]),
        (one, None) | (None, one) => one,
    }
}

/// Where bins end, so that each holds one of few numbers, or a like share of many.
fn ends(numbers: &Numbers) -> Vec<f64> {
    let step = numbers.len().div_ceil(SAMPLE).max(1);
    let sample = (0..numbers.len()).step_by(step).map(|place| numbers.number(place));
    let mut sample: Vec<f64> = sample.filter(|number| !number.is_nan()).collect();
    sample.sort_unstable_by(f64::total_cmp);
    let ends = BINS - 2;
    let mut distinct = sample.clone();
    distinct.dedup();
    if distinct.len() > ends + 1 {
        distinct = (0..=ends).map(|bin| sample[bin * sample.len() / (ends + 1)]).collect();
        distinct.dedup();
    }
    distinct.drain(..distinct.len().min(1));
    distinct
}

/// The points `p` of the file's coordinates with `dot(normal, p) <= distance`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfSpace {
    /// Points out of it; of any length.
    pub normal: DVec3,
    /// How far along the normal it reaches, times the normal's length.
    pub distance: f64,
}

/// What a particle must fulfill to be shown.
#[derive(Clone, Copy)]
pub enum Rule<'a> {
    /// Its number lies in one of these closed intervals; NaN lies in none.
    Within(&'a Column, &'a [[f64; 2]]),
    /// Its center lies in the half space. It is shown as a whole or not at all.
    HalfSpace(HalfSpace),
}

/// Whether all, none or some of the particles of a subtree fulfill a rule.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Verdict {
    All,
    None,
    Some,
}

/// A rule made ready for many particles of one structure.
pub(super) enum Test<'a> {
    Within {
        column: &'a Column,
        intervals: &'a [[f64; 2]],
        /// Bins of which all numbers are wanted, and those of which some may be.
        all: u32,
        some: u32,
    },
    /// Measured from the structure's origin.
    HalfSpace(HalfSpace),
}

impl<'a> Test<'a> {
    /// Of a rule for a structure whose centers are measured from `origin`.
    pub(super) fn new(rule: &Rule<'a>, origin: DVec3) -> Self {
        match *rule {
            Rule::HalfSpace(HalfSpace { normal, distance }) => {
                Self::HalfSpace(HalfSpace { normal, distance: distance - normal.dot(origin) })
            }
            Rule::Within(column, intervals) => {
                let mask = |wanted: &dyn Fn(&[f64; 2], &[f64; 2]) -> bool| {
                    let bins = column.bins.iter().enumerate();
                    let wanted = bins.filter(|(_, bin)| {
                        bin.is_some_and(|bin| intervals.iter().any(|interval| wanted(interval, &bin)))
                    });
                    wanted.fold(0, |mask, (bin, _)| mask | 1 << bin)
                };
                // Comparisons with the NaN of the last bin are false.
                let all = mask(&|interval, bin| interval[0] <= bin[0] && bin[1] <= interval[1]);
                let some = mask(&|interval, bin| interval[0] <= bin[1] && bin[0] <= interval[1]);
                Self::Within { column, intervals, all, some }
            }
        }
    }

    /// Whether the particle at `node` with its center at `center` fulfills it.
    #[inline(always)]
    pub(super) fn holds(&self, node: usize, center: Vec3) -> bool {
        match self {
            Self::HalfSpace(it) => it.normal.dot(center.as_dvec3()) <= it.distance,
            Self::Within { column, intervals, .. } => {
                let number = column.numbers.number(node);
                intervals.iter().any(|[low, high]| *low <= number && number <= *high)
            }
        }
    }

    /// What is known without looking at the particles of a subtree with the box `bounds`, the one at `index` of its level; level 0 are
    /// runs of sixteen.
    pub(super) fn verdict(&self, level: usize, index: usize, bounds: &Bounds) -> Verdict {
        match self {
            Self::HalfSpace(it) => {
                let (min, max) = (bounds.min.as_dvec3() * it.normal, bounds.max.as_dvec3() * it.normal);
                match () {
                    () if min.max(max).element_sum() <= it.distance => Verdict::All,
                    () if min.min(max).element_sum() > it.distance => Verdict::None,
                    () => Verdict::Some,
                }
            }
            Self::Within { column, all, some, .. } => match column.presence[level][index] {
                present if present & !all == 0 => Verdict::All,
                present if present & some == 0 => Verdict::None,
                _ => Verdict::Some,
            },
        }
    }
}

/// What is shown, for a device that holds a copy and walks it there.
#[cfg(feature = "gpu")]
#[derive(Clone, Copy)]
pub(crate) struct Bits<'a> {
    /// A bit a particle, by node, sixteen a word.
    pub(crate) particles: &'a [u16],
    /// Which subtrees show any: of a hierarchy a byte a node with a bit for every child, of heaps a bit a node.
    pub(crate) subtrees: &'a [u8],
}

/// A bit for each of sixteen nodes from `first` on: whether it fulfills all tests. `center` gives the center of a node below `count`.
#[inline(always)]
pub(super) fn bits<'a>(
    first: usize,
    count: usize,
    tests: impl Iterator<Item = &'a Test<'a>> + Clone,
    center: impl Fn(usize) -> Vec3,
) -> u16 {
    let nodes = first..(first + RUN).min(count);
    nodes.fold(0, |bits, node| {
        let at = center(node);
        bits | u16::from(tests.clone().all(|test| test.holds(node, at))) << (node - first)
    })
}

/// The bits of `count` nodes, sixteen a word, each decided by itself.
pub(super) fn all_bits(count: usize, tests: &[Test], center: impl Fn(usize) -> Vec3 + Sync) -> Vec<u16> {
    let runs = (0..count.div_ceil(RUN)).into_par_iter().with_min_len(1 << 8);
    runs.map(|run| bits(run * RUN, count, tests.iter(), &center)).collect()
}

/// Of `shown`, or of all `count` nodes, the bits of those that `keeps` keeps.
pub(super) fn thinned(count: usize, shown: Option<&[u16]>, keeps: impl Fn(u32) -> bool + Sync) -> Vec<u16> {
    let runs = (0..count.div_ceil(RUN)).into_par_iter().with_min_len(1 << 8);
    runs.map(|run| {
        let first = run * RUN;
        let kept = |node: usize| shown.is_none_or(|shown| shows(shown, node)) && keeps(node as u32);
        (first..(first + RUN).min(count)).fold(0, |bits, node| bits | u16::from(kept(node)) << (node - first))
    })
    .collect()
}

/// Whether the bit of `node` is set.
#[inline(always)]
pub(super) fn shows(bits: &[u16], node: usize) -> bool {
    bits[node / RUN] >> (node % RUN) & 1 == 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    /// Numbers of several kinds, with missing and infinite ones.
    fn numbers(seed: u64, count: usize) -> Numbers {
        Numbers::collect(count, |id| {
            let mut stream = Stream::new(seed, id as u64);
            match (seed % 4, stream.unit()) {
                (_, share) if share < 0.02 => f64::NAN,
                (_, share) if share < 0.03 => f64::INFINITY,
                (0, _) => f64::from((9.0 * stream.unit()) as i32),
                (1, _) => f64::from(stream.unit()).powi(9) / 3.0,
                (2, _) => f64::from(stream.unit()) - 0.5,
                _ => 4.0,
            }
        })
    }

    #[test]
    fn masks_hold_every_number_and_never_decide_wrongly() {
        for seed in 0..12 {
            let count = [0, 1, 17, 2000, 9000][seed as usize % 5];
            let numbers = numbers(seed, count);
            let ids: Vec<u32> = (0..count as u32).rev().collect();
            let column = Column::new(&numbers, &ids);
            let intervals = [[-0.1, 0.2], [4.0, 4.0]];
            let test = Test::new(&Rule::Within(&column, &intervals), DVec3::ZERO);
            let mut decided = 0;
            for (level, masks) in column.presence.iter().enumerate() {
                let width = RUN * WIDTH.pow(level as u32);
                for index in 0..masks.len() {
                    let nodes = index * width..((index + 1) * width).min(count);
                    let held = nodes.clone().filter(|&node| test.holds(node, Vec3::ZERO)).count();
                    match test.verdict(level, index, &Bounds::EMPTY) {
                        Verdict::All => assert_eq!(held, nodes.len(), "seed {seed}"),
                        Verdict::None => assert_eq!(held, 0, "seed {seed}"),
                        Verdict::Some => continue,
                    }
                    decided += 1;
                }
            }
            assert!(
                seed % 4 == 0 || count < 17 || decided > 0 || seed % 4 == 2,
                "seed {seed}: masks skip nothing"
            );
            for (node, &id) in ids.iter().enumerate() {
                let (held, given) = (column.numbers.number(node), numbers.number(id as usize));
                assert!(held == given || (held.is_nan() && given.is_nan()));
            }
        }
    }

    #[test]
    fn few_numbers_are_told_one_by_one() {
        let numbers = Numbers::collect(1000, |id| if id == 9 { f64::NAN } else { (id % 3) as f64 });
        let column = Column::new(&numbers, &(0..1000).collect::<Vec<_>>());
        assert_eq!((column.values(), column.span()), (Some(vec![0.0, 1.0, 2.0]), Some([0.0, 2.0])));
        let many = Column::new(&Numbers::collect(1000, |id| id as f64), &(0..1000).collect::<Vec<_>>());
        assert_eq!((many.values(), many.span()), (None, Some([0.0, 999.0])));
        assert_eq!(Column::new(&Numbers::collect(0, |_| 0.0), &[]).span(), None);
    }

    #[test]
    fn numbers_that_single_precision_cannot_hold_stay_exact() {
        for number in [0.1, 16_777_217.0, 1e300] {
            assert_eq!(Numbers::collect(1, |_| number).number(0), number);
        }
    }
}
