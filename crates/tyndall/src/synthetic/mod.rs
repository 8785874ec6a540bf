//! Synthetic clouds: seeded particles of any count, for tests, benchmarks and examples that need no file.
//!
//! [`generate`] takes a specification such as `nozzle?n=1e6&seed=7` and gives particles. Ten laws are known ([`NAMES`]):
//! three plain ones in the unit cube (`uniform`, `packed`, `clustered`) and seven that imitate the structure of published
//! data sets at their counts (`nozzle`, `fluid`, `virion`, `ablation`; `cloud1`, `cloud2`, `smoke`).
//!
//! Invariant: particle `k` is a function of the law, the count, the seed and `k` alone. So the number of threads changes
//! nothing, and memory holds the final columns and small tables. Logarithms and sines are the platform's: between
//! platforms the last bits may differ.

mod ablation;
mod clouds;
mod clustered;
mod fluid;
mod lattice;
mod nozzle;
mod packed;
mod specification;
mod turbulence;
mod uniform;
mod virion;

use std::ops::Range;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::particles::{Attribute, Cell, Columns, Particles, Positions, Radii, Values};
use crate::progress::Progress;
use crate::source::Source;
use specification::Specification;

/// The names of the laws, for help texts.
pub const NAMES: [&str; 10] =
    ["uniform", "packed", "clustered", "nozzle", "fluid", "virion", "ablation", "cloud1", "cloud2", "smoke"];

/// The parameters of a specification, for help texts.
pub const KEYS: [&str; 3] = ["n", "seed", "radius"];

/// Particles made at a time by one thread, and per report of progress.
const CHUNK: usize = 1 << 16;

/// Number of the stream from which a law draws its tables; particles have the streams from 0 up.
const TABLES: u64 = u64::MAX;

/// Makes the particles of a specification: `NAME` or `NAME?KEY=VALUE&KEY=VALUE`.
///
/// Keys: `n`, the count (any from 0 to 2^32 - 2, also as `1e7` or `1_000_000`; default: the published set's, or 1e6);
/// `seed` (default: the count); `radius`, in place of the law's, in its unit of length.
///
/// Fails with [`Error::Setting`] on an unknown name or key and on a bad value, and with [`Error::Interrupted`].
pub fn generate(specification: &str, progress: &dyn Progress) -> Result<Particles> {
    let Specification { name, count, seed, radius } = Specification::parse(specification)?;
    make(plan(name, count, seed), count, radius, progress)
}

/// The law of that name.
fn plan(name: &str, count: u64, seed: u64) -> Plan<'static> {
    match name {
        "uniform" => uniform::plan(count, seed),
        "packed" => packed::plan(count, seed),
        "clustered" => clustered::plan(seed),
        "nozzle" => nozzle::plan(count, seed),
        "fluid" => fluid::plan(count, seed),
        "virion" => virion::plan(count, seed),
        "ablation" => ablation::plan(count, seed),
        "cloud1" => clouds::cloud1(count, seed),
        "cloud2" => clouds::cloud2(count, seed),
        _ => clouds::smoke(count, seed),
    }
}

/// The particles of a specification, made when they are read: for counts that do not fit the memory.
pub struct Synthetic {
    plan: Plan<'static>,
    count: u64,
    radius: Option<f32>,
}

impl Synthetic {
    /// Makes nothing yet. Fails as [`generate`] does.
    pub fn new(specification: &str) -> Result<Self> {
        let Specification { name, count, seed, radius } = Specification::parse(specification)?;
        Ok(Self { plan: plan(name, count, seed), count, radius })
    }

    /// At most `count` of the particles, spread evenly over all, with all that [`generate`] would say of them.
    pub fn sample(&self, count: u64, progress: &dyn Progress) -> Result<Particles> {
        let step = self.count.div_ceil(count.max(1)).max(1);
        self.some(EveryNth { law: &*self.plan.law, first: 0, step }, self.count.div_ceil(step), progress)
    }

    /// The particles in a range, with all that [`generate`] would say of them and their places among all.
    pub fn part(&self, range: Range<u64>) -> Result<Particles> {
        let law = EveryNth { law: &*self.plan.law, first: range.start, step: 1 };
        Ok(self.some(law, range.end - range.start, &())?.numbered_from(range.start))
    }

    fn some(&self, law: EveryNth, count: u64, progress: &dyn Progress) -> Result<Particles> {
        let (radii, attributes) = (self.plan.radii.clone(), self.plan.attributes.clone());
        make(Plan { law: Box::new(law), radii, attributes, ..self.plan }, count, self.radius, progress)
    }
}

impl Source for Synthetic {
    fn len(&self) -> u64 {
        self.count
    }

    fn read(&self, range: Range<u64>, into: &mut Vec<Vec3>) -> Result<()> {
        into.clear();
        into.reserve((range.end - range.start) as usize);
        self.plan.law.run(range, &mut |particle| into.push(particle.position));
        Ok(())
    }
}

/// Every `step`th particle of a law, from one on.
struct EveryNth<'a> {
    law: &'a dyn Law,
    first: u64,
    step: u64,
}

impl Law for EveryNth<'_> {
    fn particle(&self, k: u64) -> Particle {
        self.law.particle(self.first + k * self.step)
    }

    fn run(&self, range: Range<u64>, take: &mut dyn FnMut(Particle)) {
        match self.step {
            1 => self.law.run(self.first + range.start..self.first + range.end, take),
            _ => range.for_each(|k| take(self.particle(k))),
        }
    }
}

/// How many particles [`generate`] would make. Fails as it does.
pub fn count(specification: &str) -> Result<u64> {
    Ok(Specification::parse(specification)?.count)
}

/// One particle: its position, and its attributes in the order of [`Plan::attributes`].
#[derive(Clone, Copy, Default)]
struct Particle {
    position: Vec3,
    /// Codes and whole numbers too: all are below 2^24, where floats are exact.
    values: [f32; 3],
}

/// Where particles are and what they carry, as a function of their number.
trait Law: Sync {
    /// Particle `k`, below the count for which the law was made.
    fn particle(&self, k: u64) -> Particle;

    /// Hands on the particles of a range in order, which may take less than to ask for each.
    fn run(&self, range: Range<u64>, take: &mut dyn FnMut(Particle)) {
        range.for_each(|k| take(self.particle(k)));
    }
}

/// An attribute that a law fills.
#[derive(Clone)]
struct Filled {
    name: &'static str,
    unit: Option<&'static str>,
    kind: Kind,
}

/// What the values of an attribute are.
#[derive(Clone)]
enum Kind {
    Real,
    Whole,
    /// Codes of these words.
    Words(&'static [&'static str]),
}

impl Filled {
    fn real(name: &'static str) -> Self {
        Self { name, unit: None, kind: Kind::Real }
    }

    fn in_unit(name: &'static str, unit: &'static str) -> Self {
        Self { name, unit: Some(unit), kind: Kind::Real }
    }
}

/// A law ready to be asked, and what else a file would say.
struct Plan<'a> {
    law: Box<dyn Law + 'a>,
    radii: Radii,
    attributes: Vec<Filled>,
    cell: Option<Cell>,
    length_unit: Option<&'static str>,
}

/// A box at the origin with edges along the axes.
fn cell(size: DVec3, periodic: [bool; 3]) -> Cell {
    let vectors = [DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z];
    Cell { origin: DVec3::ZERO, vectors, periodic }
}

/// Ends of the parts of `count` particles whose shares are given; the last end is `count`, whatever the rounding.
fn ends<const PARTS: usize>(count: u64, shares: [f64; PARTS]) -> [u64; PARTS] {
    let mut sum = 0.0;
    let mut ends = shares.map(|share| {
        sum += share;
        ((count as f64 * sum).round() as u64).min(count)
    });
    ends[PARTS - 1] = count;
    ends
}

/// A run of one attribute's column.
enum Run<'a> {
    Real(&'a mut [f32]),
    Whole(&'a mut [i32]),
    Code(&'a mut [u32]),
}

/// A run of all columns, from particle `first` on.
struct Chunk<'a> {
    first: u64,
    positions: [&'a mut [f32]; 3],
    attributes: Vec<Run<'a>>,
}

impl Chunk<'_> {
    fn fill(&mut self, law: &dyn Law) {
        let Self { first, positions, attributes } = self;
        let count = positions[0].len();
        let mut place = 0;
        law.run(*first..*first + count as u64, &mut |particle| {
            for (axis, column) in positions.iter_mut().enumerate() {
                column[place] = particle.position[axis];
            }
            for (run, value) in attributes.iter_mut().zip(particle.values) {
                match run {
                    Run::Real(column) => column[place] = value,
                    Run::Whole(column) => column[place] = value as i32,
                    Run::Code(column) => column[place] = value as u32,
                }
            }
            place += 1;
        });
    }
}

/// Asks the law for all particles, in parallel, each chunk straight into its place in the columns.
fn make(plan: Plan, count: u64, radius: Option<f32>, progress: &dyn Progress) -> Result<Particles> {
    let size = usize::try_from(count)
        .map_err(|_| Error::setting("n", count, "fewer: it does not fit the memory"))?;
    progress.begin("generate", Some(count), "particles");

    // The pages of these columns are first touched by the threads that fill them.
    let mut offsets: [Vec<f32>; 3] = std::array::from_fn(|_| vec![0.0; size]);
    let mut values: Vec<Values> = plan
        .attributes
        .iter()
        .map(|it| match it.kind {
            Kind::Real => Values::F32(vec![0.0; size]),
            Kind::Whole => Values::I32(vec![0; size]),
            Kind::Words(names) => {
                Values::Text { codes: vec![0; size], names: names.iter().map(|&it| it.into()).collect() }
            }
        })
        .collect();

    chunks(&mut offsets, &mut values).into_par_iter().try_for_each(|mut chunk| {
        if progress.cancelled() {
            return Err(Error::Interrupted);
        }
        chunk.fill(&*plan.law);
        progress.advance(chunk.positions[0].len() as u64);
        Ok(())
    })?;

    let attributes = plan.attributes.iter().zip(values).map(|(filled, values)| {
        let unit = filled.unit.map(String::from);
        Attribute { unit, ..Attribute::new(filled.name, 1, values) }
    });
    Particles::new(Columns {
        positions: Positions::from_offsets(DVec3::ZERO, offsets),
        attributes: attributes.collect(),
        radii: Some(radius.map_or(plan.radii, Radii::Uniform)),
        cell: plan.cell,
        time: None,
        time_unit: None,
        length_unit: plan.length_unit.map(String::from),
        bonds: Vec::new(),
    })
}

/// The columns, cut into runs of [`CHUNK`] particles.
fn chunks<'a>(offsets: &'a mut [Vec<f32>; 3], values: &'a mut [Values]) -> Vec<Chunk<'a>> {
    let [x, y, z] = offsets;
    let positions = x.chunks_mut(CHUNK).zip(y.chunks_mut(CHUNK)).zip(z.chunks_mut(CHUNK));
    let mut chunks: Vec<Chunk> = positions
        .enumerate()
        .map(|(number, ((x, y), z))| Chunk {
            first: number as u64 * CHUNK as u64,
            positions: [x, y, z],
            attributes: Vec::new(),
        })
        .collect();
    for column in values {
        let runs: Vec<Run> = match column {
            Values::F32(column) => column.chunks_mut(CHUNK).map(Run::Real).collect(),
            Values::I32(column) => column.chunks_mut(CHUNK).map(Run::Whole).collect(),
            Values::Text { codes, .. } => codes.chunks_mut(CHUNK).map(Run::Code).collect(),
            _ => unreachable!("laws fill floats, whole numbers and words"),
        };
        for (chunk, run) in chunks.iter_mut().zip(runs) {
            chunk.attributes.push(run);
        }
    }
    chunks
}

#[cfg(test)]
mod tests;
