//! Where the particles of a source are, roughly: how many lie in each cell of a lattice of 64 cells an axis over all of them.
//!
//! Its cells are runs of the curve along which [`Cells`] sorts, so that ranks along it are known before anything is sorted: the particles that
//! are asked how far their neighbors are can be the same as where all are in memory.

use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering};

use glam::Vec3;
use rayon::prelude::*;

use super::carried::{Carrier, Load};
use super::too_many;
use crate::error::{Error, Result};
use crate::math::Bounds;
use crate::medium::cells::{CELL, Cells, Curve};
use crate::medium::density::automatic::ASKED_CELLS;
use crate::medium::density::neighbors::{Asked, lengths_of, sorted};
use crate::progress::Progress;
use crate::source::Source;

/// Cells along an axis; tests have several in few particles.
const SIDE: u32 = if cfg!(test) { 16 } else { 64 };
const CELLS: usize = (SIDE * SIDE * SIDE) as usize;
/// Cells of the curve along the edge of one.
const STEP: u32 = Curve::CELLS / SIDE;
/// Particles read at a time by one thread.
const PART: u64 = 1 << if cfg!(test) { 8 } else { 20 };

/// See the module.
pub(super) struct Survey {
    /// The box of the particles.
    pub(super) bounds: Bounds,
    /// Particles that are finite.
    pub(super) kept: u64,
    curve: Curve,
    /// Particles in each cell, x fastest, then y, then z.
    counts: Vec<u32>,
}

/// A box of cells, the last ones too.
#[derive(Clone, Copy)]
struct CellBox {
    low: [u32; 3],
    high: [u32; 3],
}

impl CellBox {
    /// As many cells larger on every side.
    fn grown(self, by: u32) -> Self {
        let low = self.low.map(|it| it.saturating_sub(by));
        Self { low, high: self.high.map(|it| it.saturating_add(by).min(SIDE - 1)) }
    }

    fn is_everything(&self) -> bool {
        self.low == [0; 3] && self.high == [SIDE - 1; 3]
    }

    /// Its rows, as numbers of cells.
    fn rows(self) -> impl Iterator<Item = std::ops::Range<usize>> {
        let Self { low, high } = self;
        (low[2]..=high[2]).flat_map(move |z| {
            (low[1]..=high[1]).map(move |y| {
                let row = ((z * SIDE + y) * SIDE) as usize;
                row + low[0] as usize..row + high[0] as usize + 1
            })
        })
    }
}

/// Cells whose particles are wanted.
pub(super) struct Marks(Vec<bool>);

impl Marks {
    pub(super) fn none() -> Self {
        Self(vec![false; CELLS])
    }

    /// Adds the cells that a box touches.
    pub(super) fn add(&mut self, survey: &Survey, bounds: Bounds) {
        survey.touched(bounds).into_iter().flat_map(CellBox::rows).for_each(|row| self.0[row].fill(true));
    }
}

impl Survey {
    /// Memory that it takes.
    pub(super) const BYTES: u64 = 5 * CELLS as u64;

    /// Reads everything twice: for the box, and to count.
    pub(super) fn of(source: &dyn Source, progress: &dyn Progress) -> Result<Self> {
        progress.begin("scan", Some(2 * source.len()), "particles");
        let boxes = parts(source, progress, |centers| {
            progress.advance(centers.len() as u64);
            let finite = centers.iter().copied().filter(|it| it.is_finite());
            finite.fold((Bounds::EMPTY, 0), |(bounds, kept), center| (bounds.with(center), kept + 1))
        })?;
        let join = |(bounds, kept): (Bounds, u64), (more, count)| (bounds.union(more), kept + count);
        let (bounds, kept) = boxes.into_iter().fold((Bounds::EMPTY, 0), join);
        let mut survey = Self { bounds, kept, curve: Curve::through(bounds), counts: Vec::new() };
        let counts: Vec<AtomicU32> = (0..CELLS).map(|_| AtomicU32::new(0)).collect();
        parts(source, progress, |centers| {
            progress.advance(centers.len() as u64);
            for &center in centers.iter().filter(|it| it.is_finite()) {
                counts[survey.cell(center)].fetch_add(1, Ordering::Relaxed);
            }
        })?;
        survey.counts = counts.into_iter().map(AtomicU32::into_inner).collect();
        Ok(survey)
    }

    /// The number of the cell around a center.
    #[inline(always)]
    fn cell(&self, center: Vec3) -> usize {
        let [x, y, z] = self.curve.cell(center).map(|it| it / STEP);
        ((z * SIDE + y) * SIDE + x) as usize
    }

    /// The cells that a box touches.
    fn touched(&self, bounds: Bounds) -> Option<CellBox> {
        let (min, max) = (bounds.min.max(self.bounds.min), bounds.max.min(self.bounds.max));
        let cell = |at: Vec3| self.curve.cell(at).map(|it| it / STEP);
        min.cmple(max).all().then(|| CellBox { low: cell(min), high: cell(max) })
    }

    /// How many particles are in the cells that a box touches.
    pub(super) fn count(&self, bounds: Bounds) -> u64 {
        self.touched(bounds).map_or(0, |it| self.held(it))
    }

    fn held(&self, cells: CellBox) -> u64 {
        cells.rows().flat_map(|row| &self.counts[row]).map(|&it| u64::from(it)).sum()
    }

    /// The boxes of the cells that hold particles.
    pub(super) fn filled(&self) -> impl Iterator<Item = Bounds> {
        let edge = STEP as f32 * self.curve.edge();
        self.counts.iter().enumerate().filter(|(_, count)| **count > 0).map(move |(number, _)| {
            let min = self.bounds.min + edge * Vec3::from(place(number).map(|it| it as f32));
            Bounds { min, max: min + edge }.grown(1e-3 * edge)
        })
    }

    /// The particles in marked cells with their values, in their order.
    pub(super) fn gather_loaded(
        &self,
        source: &dyn Carrier,
        marks: &Marks,
        load: &Load,
        progress: &dyn Progress,
    ) -> Result<(Vec<Vec3>, Vec<Vec<f32>>)> {
        if load.is_bare {
            return Ok((self.gather(source, marks, progress)?, Vec::new()));
        }
        let found = ranges(source, progress, |_, range| {
            let (centers, particles) = source.part(range)?;
            let columns = load.values(&particles)?;
            let is_wanted: Vec<bool> = centers.iter().map(|it| marks.0[self.cell(*it)]).collect();
            let columns: Vec<Vec<f32>> = columns.iter().map(|column| kept(column, &is_wanted)).collect();
            Ok((kept(&centers, &is_wanted), columns))
        })?;
        let mut columns = vec![Vec::new(); load.columns()];
        let mut all = Vec::new();
        for (centers, values) in found {
            all.extend(centers);
            columns.iter_mut().zip(values).for_each(|(column, values)| column.extend(values));
        }
        Ok((all, columns))
    }

    /// The particles in marked cells, in their order.
    pub(super) fn gather(
        &self,
        source: &dyn Source,
        marks: &Marks,
        progress: &dyn Progress,
    ) -> Result<Vec<Vec3>> {
        let wanted = |center: &Vec3| center.is_finite() && marks.0[self.cell(*center)];
        let found =
            parts(source, progress, |centers| centers.iter().copied().filter(wanted).collect::<Vec<Vec3>>())?;
        Ok(found.concat())
    }

    /// How far the N*-th neighbors are of the particles that [`Cells`] of all would ask, sorted.
    pub(super) fn lengths(
        &self,
        source: &dyn Source,
        target: u32,
        at_once: u64,
        progress: &dyn Progress,
    ) -> Result<Vec<f32>> {
        let target = target.min(self.kept as u32);
        let asked = self.asked(source, at_once, progress)?;
        let mut open: Vec<Open> = asked.into_iter().map(|center| self.open(center, target)).collect();
        let mut found = Vec::new();
        while !open.is_empty() {
            // As many as may be held, of which some will have to know more.
            let (mut marks, mut held, mut some) = (Marks::none(), 0, Vec::new());
            while let Some(next) = open.pop() {
                let unmarked = next.cells().rows().flatten().filter(|&cell| !marks.0[cell]);
                held += unmarked.map(|cell| u64::from(self.counts[cell])).sum::<u64>();
                if held > at_once && some.is_empty() {
                    return Err(too_many(held, at_once, 1, "among which neighbors are looked for"));
                }
                if held > at_once {
                    open.push(next);
                    break;
                }
                next.cells().rows().for_each(|row| marks.0[row].fill(true));
                some.push(next);
            }
            let positions = self.gather(source, &marks, progress)?;
            let cells = Cells::within(self.bounds, positions.len(), |place| positions[place]);
            let asked: Vec<Asked> = some.iter().map(|it| self.known(it)).collect();
            for (asked, lengths) in some.into_iter().zip(lengths_of(&cells, target, &asked)) {
                match lengths {
                    Ok(lengths) => found.push(lengths),
                    Err(distance) => {
                        let rings = (distance / self.edge()).ceil().min(SIDE as f32) as u32;
                        open.push(Open { rings: rings.max(asked.rings + 1), ..asked });
                    }
                }
            }
        }
        Ok(sorted(&found))
    }

    /// Particles that look for their neighbors, among those that are likely to be near enough.
    fn open(&self, center: [[f32; CELL]; 3], target: u32) -> Open {
        let places = (0..CELL).map(|lane| Vec3::new(center[0][lane], center[1][lane], center[2][lane]));
        let bounds = places.filter(|it| it.is_finite()).fold(Bounds::EMPTY, Bounds::with);
        let cell = |at: Vec3| self.curve.cell(at).map(|it| it / STEP);
        let mut open =
            Open { center, own: CellBox { low: cell(bounds.min), high: cell(bounds.max) }, rings: 1 };
        while self.held(open.cells()) < 2 * u64::from(target) && !open.cells().is_everything() {
            open.rings += 1;
        }
        open
    }

    /// The same with the distance up to which all particles are in its cells.
    fn known(&self, open: &Open) -> Asked {
        let known = match open.cells().is_everything() {
            true => f32::INFINITY,
            false => 0.999 * self.edge() * open.rings as f32,
        };
        Asked { center: open.center, known }
    }

    fn edge(&self) -> f32 {
        STEP as f32 * self.curve.edge()
    }

    /// The particles of every so many-th sixteen along the curve, as [`Cells`] of all would have them.
    fn asked(
        &self,
        source: &dyn Source,
        at_once: u64,
        progress: &dyn Progress,
    ) -> Result<Vec<[[f32; CELL]; 3]>> {
        // Cells in the order of the curve, each with the rank of its first particle.
        let filled = (0..CELLS).into_par_iter().filter(|&cell| self.counts[cell] > 0);
        let mut order: Vec<(u64, usize)> =
            filled.map(|cell| (Curve::place(place(cell).map(|it| it * STEP)), cell)).collect();
        order.par_sort_unstable();
        let sixteens = (self.kept as usize).div_ceil(CELL);
        let step = (sixteens.div_ceil(ASKED_CELLS) * CELL) as u64;
        let mut rank = 0;
        let mut wanted = Vec::new();
        for &(_, cell) in &order {
            let end = rank + u64::from(self.counts[cell]);
            let (before, next) = (rank / step * step, rank.div_ceil(step) * step);
            if rank < before + CELL as u64 || next < end {
                wanted.push((cell, rank));
            }
            rank = end;
        }

        let mut asked = vec![[[f32::INFINITY; CELL]; 3]; self.kept.div_ceil(step) as usize];
        let mut left = &wanted[..];
        while !left.is_empty() {
            let (mut held, mut marks) = (0, Marks::none());
            let fits = |(cell, _): &&(usize, u64)| {
                held += u64::from(self.counts[*cell]);
                held <= at_once
            };
            let (some, others) = left.split_at(left.iter().take_while(fits).count());
            if some.is_empty() {
                return Err(too_many(held, at_once, 1, "at about one place"));
            }
            some.iter().for_each(|(cell, _)| marks.0[*cell] = true);
            let positions = self.gather(source, &marks, progress)?;
            let mut sorted: Vec<(u64, u32)> = (0_u32..)
                .zip(&positions)
                .map(|(id, &center)| (Curve::place(self.curve.cell(center)), id))
                .collect();
            sorted.par_sort_unstable();
            let mut sorted = sorted.into_iter();
            for &(cell, first) in some {
                let of_cell = sorted.by_ref().take(self.counts[cell] as usize);
                for (rank, (_, id)) in (first..).zip(of_cell) {
                    let (number, lane) = ((rank / step) as usize, (rank % step) as usize);
                    if lane < CELL {
                        let center = positions[id as usize];
                        (0..3).for_each(|axis| asked[number][axis][lane] = center[axis]);
                    }
                }
            }
            left = others;
        }
        Ok(asked)
    }
}

/// Sixteen particles that look for their neighbors.
struct Open {
    center: [[f32; CELL]; 3],
    /// The cells around them.
    own: CellBox,
    /// By how many more cells on each side they look.
    rings: u32,
}

impl Open {
    fn cells(&self) -> CellBox {
        self.own.grown(self.rings)
    }
}

/// Reads a source part by part on all threads: what is made of each, in their order.
fn parts<T: Send>(
    source: &dyn Source,
    progress: &dyn Progress,
    make: impl Fn(&[Vec3]) -> T + Sync,
) -> Result<Vec<T>> {
    ranges(source, progress, |centers, range| {
        source.read(range, centers)?;
        Ok(make(centers))
    })
}

/// What is made of each part of a source, in their order; `make` has room for centers.
fn ranges<T: Send>(
    source: &dyn Source,
    progress: &dyn Progress,
    make: impl Fn(&mut Vec<Vec3>, Range<u64>) -> Result<T> + Sync,
) -> Result<Vec<T>> {
    let starts: Vec<u64> = (0..source.len()).step_by(PART as usize).collect();
    let one = |centers: &mut Vec<Vec3>, start: u64| {
        if progress.cancelled() {
            return Err(Error::Interrupted);
        }
        make(centers, start..(start + PART).min(source.len()))
    };
    starts.into_par_iter().with_max_len(1).map_init(Vec::new, one).collect()
}

/// The values that are flagged.
fn kept<T: Copy>(values: &[T], flags: &[bool]) -> Vec<T> {
    values.iter().zip(flags).filter_map(|(&value, &flag)| flag.then_some(value)).collect()
}

/// Where a cell lies.
fn place(cell: usize) -> [u32; 3] {
    let cell = cell as u32;
    [cell % SIDE, cell / SIDE % SIDE, cell / (SIDE * SIDE)]
}
