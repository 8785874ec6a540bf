//! The density of particles that are never all in memory: they are read part by part, several times, and gathered where samples need them.
//!
//! A survey counts them by place ([`Survey`]). The bricks of the lattice are then cut into regions with so few particles in them, and within
//! the longest length of them, as may be held at once; each reading gathers those of some regions, whose samples are found as
//! [`super::estimate`] finds them. Memory holds the grid and those particles. Invariant: samples and what is chosen are those of
//! [`super::estimate`], bit for bit, whatever is held at once.

mod carried;
mod survey;

#[cfg(test)]
mod tests;

use super::automatic::{self, Reached};
use super::block::Block;
use super::finer::{self, Parted};
use super::gather::{Gather, Rule};
use super::volume::Filling;
use super::{Field, Settings, Smoothing, Volume, inputs};
use crate::error::{Error, Result};
use crate::math::Bounds;
use crate::medium::cells::{CELL, Cells, Column};
use crate::medium::grid::{BRICK, Lattice};
use crate::medium::kernel::{CubicSpline, Kernel, Poly6, Shape, WendlandC2};
use crate::progress::Progress;
pub use carried::Carrier;
use carried::Load;
use survey::{Marks, Survey};

/// Particles that are held at once, at most: they take a gigabyte.
const AT_ONCE: u64 = 1 << 24;
/// How often a particle may be gathered, on average. More than that says that almost all of them are near every sample.
const MOST_GATHERED: u64 = 16;

/// Estimates the density of a source of particles. Returns too how many were not finite.
///
/// Samples are those that [`estimate`](super::estimate) finds of the same particles. Half of `memory_bytes` may be taken by particles, a
/// gigabyte at most. Fails with [`Error::Setting`] where [`estimate`](super::estimate) does, and for what needs all particles at once (the
/// scatter); with [`Error::Memory`] if the grid, or the particles around a single brick, do not fit; and with [`Error::Interrupted`].
pub fn stream(source: &dyn Carrier, settings: &Settings, progress: &dyn Progress) -> Result<(Volume, u64)> {
    stream_by(source, settings, at_once(settings), progress)
}

/// Where the samples of [`stream`] will lie, and the most memory that it will take at one time, in bytes. Fails as it does.
pub fn plan_stream(
    source: &dyn Carrier,
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<(Lattice, u64)> {
    let Planned { lattice, bytes, .. } = Planned::new(source, settings, at_once(settings), progress)?;
    Ok((lattice, bytes))
}

/// Memory that `count` particles take where they are all in it with so many values beside their places, their weight being one, and while
/// [`estimate`](super::estimate) has sorted them.
pub fn particle_bytes(count: u64, columns: usize) -> u64 {
    (8 + 4 * columns as u64) * count + automatic::particle_bytes(count as usize, columns)
}

/// How many particles may be held at once.
fn at_once(settings: &Settings) -> u64 {
    let of_one = particle_bytes(1, 1 + settings.fields.len());
    settings.memory_bytes.map_or(AT_ONCE, |bytes| (bytes / 2 / of_one).min(AT_ONCE))
}

fn stream_by(
    source: &dyn Carrier,
    settings: &Settings,
    at_once: u64,
    progress: &dyn Progress,
) -> Result<(Volume, u64)> {
    let planned = Planned::new(source, settings, at_once, progress)?;
    let Planned { survey, load, lattice, longest, bytes, .. } = &planned;
    let mut notes = planned.notes.clone();
    let regions = Regions::over((survey, load.columns()), lattice, *longest, at_once)?.found;
    let all: Vec<&Region> = regions.iter().collect();
    let mut filling = Filling::new(*lattice, load.columns());
    progress.begin("density", Some(regions.iter().map(Region::brick_count).sum()), "bricks");
    let whole = planned.each_reading((&all, at_once), progress, |held, numbers| {
        gather(held, (settings, *longest), (&mut filling, Samples::OfLattice(numbers)), progress)
    })?;

    let (most, room_bytes) = finer::most(settings);
    let parted = filling.parted(most, room_bytes);
    notes.extend(finer::note(&parted));
    progress.begin("refine", Some(parted.len() as u64), "bricks");
    let found = |number: usize| parted.binary_search_by_key(&number, |it| it.brick).ok();
    let again: Vec<&Region> =
        regions.iter().filter(|it| it.bricks(lattice).any(|number| found(number).is_some())).collect();
    let refined = planned.each_reading((&again, at_once), progress, |held, numbers| {
        let own: Vec<Parted> =
            numbers.iter().filter_map(|&number| found(number)).map(|it| parted[it]).collect();
        gather(held, (settings, *longest), (&mut filling, Samples::Finer(&own)), progress)
    })?;
    let readings = whole + refined;
    notes.push(format!("particles gathered in {readings} readings of the source, at most {at_once} at once"));
    let (mut grids, statistics) = filling.finish();
    let (length, peak_bytes) = (Some(*longest), *bytes);
    let products = grids.split_off(1);
    let named = load.fields.iter().zip(products);
    let fields = named.map(|((name, component), product)| Field {
        name: name.clone(),
        component: *component,
        product,
    });
    let (density, fields) = (grids.remove(0), fields.collect());
    let volume = Volume { density, fields, statistics, length, peak_bytes, notes };
    Ok((volume, source.len() - survey.kept))
}

/// Which samples are to be found.
#[derive(Clone, Copy)]
enum Samples<'a> {
    /// Those of bricks of these numbers.
    OfLattice(&'a [usize]),
    /// Finer ones.
    Finer(&'a [Parted]),
}

/// Particles that are held, sorted, and their values.
struct Held {
    cells: Cells,
    columns: Vec<Column>,
}

/// Fills bricks from the particles around them.
fn gather(
    Held { cells, columns }: &Held,
    (settings, longest): (&Settings, f32),
    (filling, samples): (&mut Filling, Samples),
    progress: &dyn Progress,
) -> Result<()> {
    let columns: Vec<&[[f32; CELL]]> = columns.iter().map(|it| &it[..]).collect();
    let (block, rule) = (Block::new(filling.lattice().spacing), Rule::of(settings));
    let (target, columns) = (settings.neighbors as f32, &columns[..]);
    match settings.kernel {
        Kernel::CubicSpline => fill(
            &Gather { cells, block, shape: CubicSpline, rule, longest, target, columns },
            filling,
            samples,
            progress,
        ),
        Kernel::WendlandC2 => fill(
            &Gather { cells, block, shape: WendlandC2, rule, longest, target, columns },
            filling,
            samples,
            progress,
        ),
        Kernel::Poly6 => fill(
            &Gather { cells, block, shape: Poly6, rule, longest, target, columns },
            filling,
            samples,
            progress,
        ),
    }
}

fn fill(
    gather: &Gather<impl Shape>,
    filling: &mut Filling,
    samples: Samples,
    progress: &dyn Progress,
) -> Result<()> {
    match samples {
        Samples::OfLattice(numbers) => filling.fill(gather, numbers, progress),
        Samples::Finer(parted) => gather.part(filling, parted, progress),
    }
}

/// What is decided before the work.
struct Planned<'a> {
    source: &'a dyn Carrier,
    settings: &'a Settings,
    load: Load<'a>,
    survey: Survey,
    lattice: Lattice,
    /// h0.
    longest: f32,
    /// The most memory at one time.
    bytes: u64,
    notes: Vec<String>,
}

impl<'a> Planned<'a> {
    fn new(
        source: &'a dyn Carrier,
        settings: &'a Settings,
        at_once: u64,
        progress: &dyn Progress,
    ) -> Result<Self> {
        check(settings)?;
        let survey = Survey::of(source, progress)?;
        inputs::check(survey.kept, settings)?;
        let mut notes = Vec::new();
        let load = Load::of(source, settings, &mut notes)?;
        let sorted = match automatic::asks(settings) {
            true => survey.lengths(source, settings.neighbors, at_once, progress)?,
            false => Vec::new(),
        };
        let (lattice, longest) = automatic::choose(survey.bounds, settings, &sorted, &mut notes)?;
        let reached = || {
            let mut reached = Reached::none(&lattice);
            survey
                .filled()
                .for_each(|it| reached.add(it.grown(longest.max(lattice.spacing) + lattice.spacing)));
            reached.count()
        };
        let columns = load.columns();
        let held = particle_bytes(at_once.min(survey.kept), columns) + Survey::BYTES;
        let bytes = automatic::check_memory(held, reached, (&lattice, columns), settings)?;
        Ok(Self { source, settings, load, survey, lattice, longest, bytes, notes })
    }

    /// Sorts the particles in marked cells.
    fn held(&self, marks: &Marks, progress: &dyn Progress) -> Result<Held> {
        let (positions, values) = self.survey.gather_loaded(self.source, marks, &self.load, progress)?;
        let cells = Cells::within(self.survey.bounds, positions.len(), |place| positions[place]);
        drop(positions);
        let mut columns: Vec<Column> = values.iter().map(|values| cells.column(|id| values[id])).collect();
        if columns.is_empty() {
            columns.push(vec![[1.0; CELL]; cells.centers().len()]);
        }
        let normalization = self.settings.kernel.normalization() as f32;
        for value in columns.iter_mut().flat_map(|it| it.as_flattened_mut()) {
            *value *= normalization;
        }
        Ok(Held { cells, columns })
    }

    /// Reads the source as often as it takes to sort the particles of all regions, at most `at_once` at a time; `act` gets some with the
    /// numbers of the bricks around which they are. Returns how many readings there were.
    fn each_reading(
        &self,
        (regions, at_once): (&[&Region], u64),
        progress: &dyn Progress,
        mut act: impl FnMut(&Held, &[usize]) -> Result<()>,
    ) -> Result<usize> {
        let (mut left, mut readings) = (regions, 0);
        while !left.is_empty() {
            let mut held = 0;
            let fits = |region: &&&Region| {
                held += region.particles;
                held <= at_once
            };
            let (some, others) = left.split_at(left.iter().take_while(fits).count());
            let mut marks = Marks::none();
            some.iter().for_each(|it| marks.add(&self.survey, it.reach(&self.lattice, self.longest)));
            let held = self.held(&marks, progress)?;
            let numbers: Vec<usize> = some.iter().flat_map(|it| it.bricks(&self.lattice)).collect();
            act(&held, &numbers)?;
            (left, readings) = (others, readings + 1);
        }
        Ok(readings)
    }
}

/// Refuses what needs more than some particles at a time.
fn check(settings: &Settings) -> Result<()> {
    if settings.smoothing == Smoothing::Scatter {
        let allowed =
            "a gather, such as three-pass: the particles do not fit the memory, and each needs its neighbors";
        return Err(Error::setting("smoothing", "scatter", allowed));
    }
    Ok(())
}

/// A box of bricks: from the first one to before the last.
struct Region {
    first: [u32; 3],
    end: [u32; 3],
    /// In it and within the longest length of it, at most.
    particles: u64,
}

impl Region {
    fn brick_count(&self) -> u64 {
        (0..3).map(|axis| u64::from(self.end[axis] - self.first[axis])).product()
    }

    /// The numbers of its bricks.
    fn bricks(&self, lattice: &Lattice) -> impl Iterator<Item = usize> + use<> {
        let ([x, y, _], first, end) = (lattice.bricks().map(|it| it as usize), self.first, self.end);
        (first[2]..end[2]).flat_map(move |k| {
            (first[1]..end[1]).flat_map(move |j| {
                let row = (k as usize * y + j as usize) * x;
                row + first[0] as usize..row + end[0] as usize
            })
        })
    }

    /// The box around all particles that its samples meet.
    fn reach(&self, lattice: &Lattice, longest: f32) -> Bounds {
        let min = lattice.position(self.first.map(|it| it * BRICK));
        // Finer samples go on to the first ones of the next bricks.
        let max = lattice.position(self.end.map(|it| it * BRICK));
        // What rounding leaves in doubt is in it.
        let far = min.abs().max(max.abs()).max_element() + longest;
        Bounds { min, max }.grown(longest + 1e-5 * far)
    }
}

/// Regions that cover all bricks with particles near them.
struct Regions<'a> {
    survey: &'a Survey,
    lattice: &'a Lattice,
    longest: f32,
    at_once: u64,
    /// Values that each particle has.
    columns: usize,
    found: Vec<Region>,
    /// Particles of all, each as often as it is in one.
    gathered: u64,
}

impl<'a> Regions<'a> {
    fn over(
        (survey, columns): (&'a Survey, usize),
        lattice: &'a Lattice,
        longest: f32,
        at_once: u64,
    ) -> Result<Self> {
        let mut regions = Self { survey, columns, lattice, longest, at_once, found: Vec::new(), gathered: 0 };
        regions.cut([0; 3], lattice.bricks())?;
        Ok(regions)
    }

    /// Halves a box of bricks until its particles can be held.
    fn cut(&mut self, first: [u32; 3], end: [u32; 3]) -> Result<()> {
        let mut region = Region { first, end, particles: 0 };
        region.particles = self.survey.count(region.reach(self.lattice, self.longest));
        let particles = region.particles;
        if particles == 0 {
            return Ok(());
        }
        let is_one = region.brick_count() == 1;
        let most = MOST_GATHERED * self.survey.kept;
        if particles <= self.at_once && self.gathered + particles <= most {
            self.gathered += particles;
            self.found.push(region);
            return Ok(());
        }
        if is_one || self.gathered + particles > most {
            let place = format!("within {} of a brick", self.longest);
            return Err(too_many(particles, self.at_once, self.columns, &place));
        }
        let axis = (0..3).max_by_key(|&axis| end[axis] - first[axis]).unwrap_or(0);
        let (mut middle_end, mut middle_first) = (end, first);
        let middle = first[axis] + (end[axis] - first[axis]) / 2;
        (middle_end[axis], middle_first[axis]) = (middle, middle);
        self.cut(first, middle_end)?;
        self.cut(middle_first, end)
    }
}

/// So many particles with so many values each would have to be held at once.
fn too_many(particles: u64, at_once: u64, columns: usize, place: &str) -> Error {
    Error::Memory {
        what: format!("{particles} particles {place}"),
        needed_bytes: 2 * particle_bytes(particles, columns),
        available_bytes: 2 * particle_bytes(at_once, columns),
        hint: "take a shorter longest smoothing length, fewer neighbors or fewer particles".into(),
    }
}
