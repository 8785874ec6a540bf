//! The density of particles on a grid: each sample of a lattice sums the particles around it.
//!
//! rho(p) = sum of m W(|p - q|, h) over the particles q. [`estimate`] takes particles and [`Settings`], gives a [`Volume`]. Four
//! gathers give each sample p a length h ([`Smoothing`]); a scatter gives each particle its own and conserves mass. `h` is the
//! radius of the kernel's support (kappa = 1), see [`crate::medium::kernel`].
//!
//! Invariant: a sample's value depends on the particles, the lattice and the settings alone, not on threads.
//!
//! Source: D. Cha, S. Son, I. Ihm, "GPU-assisted high quality particle rendering", EGSR 2009.

mod automatic;
mod block;
mod finer;
mod gather;
mod inputs;
mod length;
mod neighbors;
mod scatter;
mod select;
mod spread;
pub mod statistics;
mod stream;
mod volume;

#[cfg(test)]
mod tests;

use self::automatic::{Lengths, Plan};
use self::block::Block;
use self::gather::{Gather, Rule};
use self::scatter::Scatter;
pub use self::spread::{Spread, spread};
use self::statistics::Statistics;
pub use self::stream::{Carrier, particle_bytes, plan_stream, stream};
use self::volume::Filling;
use super::cells::{CELL, Cells, Column};
use super::grid::{Grid, Lattice};
use super::kernel::{CubicSpline, Kernel, Poly6, Shape, WendlandC2};
use crate::error::{Error, Result};
use crate::particles::{Attribute, Particles};
use crate::progress::Progress;

/// Who has a smoothing length, and how it is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Smoothing {
    /// All samples have h0: bumps where particles are few, blur where they are many.
    Uniform,
    /// Predicted from how many particles lie within h0.
    TwoPass,
    /// Predicted, and corrected by how many lie within the prediction.
    #[default]
    ThreePass,
    /// The distance of the N*-th particle, at most h0.
    Exact,
    /// Each particle has its own and spreads its mass, all of which arrives on the grid.
    Scatter,
}

impl Smoothing {
    /// All of them, with their names.
    pub const NAMES: [(&str, Self); 5] = [
        ("uniform", Self::Uniform),
        ("two-pass", Self::TwoPass),
        ("three-pass", Self::ThreePass),
        ("exact", Self::Exact),
        ("scatter", Self::Scatter),
    ];
}

/// Where the samples lie.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Resolution {
    /// A spacing of a third of the length that a tenth of the particles need to have N* neighbors; from 64 to 256 samples along
    /// the longest axis.
    #[default]
    Automatic,
    /// This spacing, over the particles and as far around them as they reach.
    Voxel(f32),
    /// So many samples along the longest axis, over the same box; at least 2.
    Samples(u32),
    /// This lattice, whatever it covers.
    Lattice(Lattice),
    /// This lattice with bricks added or left out at its sides, so that it is over the same box: of particles that move samples stay at their places.
    Continued(Lattice),
}

/// How much a particle weighs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Weight {
    /// Its mass, if an attribute is named so ([`MASS_NAMES`]), else 1.
    #[default]
    Automatic,
    /// 1: the density is a number of particles per volume.
    One,
    /// The attribute of this name, which has one component of at least 0; `mass` means the mass by any of its names.
    Attribute(String),
}

/// Names of attributes that hold a particle's mass, best first.
pub const MASS_NAMES: [&str; 4] = ["mass", "Masses", "m", "particle_mass"];
/// Names of attributes that hold the density at a particle, best first; in any case.
pub const DENSITY_NAMES: [&str; 5] = ["Densities", "Density", "rho", "Rhop", "RHO"];
/// Names of attributes that hold a particle's smoothing length, best first. The first one is the radius of the support by name, as readers find it
/// where a program's lengths are others.
pub const LENGTH_NAMES: [&str; 6] =
    ["SupportRadius", "SmoothingLength", "smoothing_length", "hsml", "smoothlength", "h"];

/// How a density is estimated.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Who has a smoothing length.
    pub smoothing: Smoothing,
    /// How mass is spread within it.
    pub kernel: Kernel,
    /// h0, the longest length, above 0. `None`: the length within which 19 of 20 particles have N* neighbors, for `uniform` one
    /// of two. May be larger than the scene: then every sample meets every particle. The scatter has no h0.
    pub length: Option<f32>,
    /// N*, the wanted number of particles within a length: at least 1. 32 leave 37 % noise in the density, 64 leave 26 %.
    pub neighbors: u32,
    /// s, in [0, 1): shortens corrected lengths that held too many. 0 is within 5 % of the best everywhere it was measured.
    pub scale: f32,
    /// Corrections after that of `three-pass`: at most 16.
    pub further_passes: u32,
    /// How much a particle weighs.
    pub weight: Weight,
    /// For the scatter: the attribute that holds the particles' lengths as radii of the support. `None`: one named so
    /// ([`LENGTH_NAMES`]), else the distance of each particle's N*-th neighbor, itself counted.
    pub particle_length: Option<String>,
    /// Attributes to put on the grid too, as means weighted like the density.
    pub fields: Vec<String>,
    /// Where the samples lie.
    pub resolution: Resolution,
    /// How often the spacing may be halved in bricks where lengths are below three spacings, at most 3. `None`: as often as lengths ask
    /// for with [`Resolution::Automatic`], else never. Finer bricks take a gigabyte at most, and a quarter of `memory_bytes`. The scatter has none.
    pub finer: Option<u32>,
    /// Memory that may be taken, in bytes; `None`: as much as it takes.
    pub memory_bytes: Option<u64>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            smoothing: Smoothing::default(),
            kernel: Kernel::default(),
            length: None,
            neighbors: 64,
            scale: 0.0,
            further_passes: 0,
            weight: Weight::default(),
            particle_length: None,
            fields: Vec::new(),
            resolution: Resolution::default(),
            finer: None,
            memory_bytes: None,
        }
    }
}

/// A density, and what came with it.
#[derive(Clone, Debug)]
pub struct Volume {
    /// Weight per volume.
    pub density: Grid,
    /// One for each component of the attributes that were asked for.
    pub fields: Vec<Field>,
    /// How many particles the samples used; nothing was counted by the scatter.
    pub statistics: Statistics,
    /// h0; `None` for the scatter.
    pub length: Option<f32>,
    /// The most memory that the work took at one time, in bytes, by arithmetic.
    pub peak_bytes: u64,
    /// What was chosen and guessed, a line each.
    pub notes: Vec<String>,
}

/// An attribute on the grid.
#[derive(Clone, Debug)]
pub struct Field {
    /// The attribute's name.
    pub name: String,
    /// Which of its components.
    pub component: usize,
    /// Weight times attribute, per volume.
    pub product: Grid,
}

impl Field {
    /// The attribute's mean at a point, weighted as in `density`, which is of the same volume; `None` where that is 0.
    pub fn mean(&self, density: &Grid, at: glam::Vec3) -> Option<f32> {
        let weight = density.density(at);
        (weight > 0.0).then(|| self.product.density(at) / weight)
    }
}

/// Estimates the density of particles.
///
/// Fails with [`Error::Setting`] on a value that is not allowed, an attribute that is not there or not a number of at least 0
/// where one is wanted, and without particles; with [`Error::Memory`] if the grid does not fit `memory_bytes`, and says what
/// would; and with [`Error::Interrupted`].
pub fn estimate(particles: &Particles, settings: &Settings, progress: &dyn Progress) -> Result<Volume> {
    inputs::check(particles.len() as u64, settings)?;
    let mut notes = Vec::new();
    let weight = inputs::weight_attribute(particles, &settings.weight, &mut notes)?;
    let fields = inputs::fields(particles, &settings.fields)?;
    let lengths = inputs::length_attribute(particles, settings)?;
    automatic::check_particles(particles, 1 + fields.len(), settings)?;

    progress.begin("sort", None, "particles");
    let cells = Cells::new(particles.positions());
    let lengths = particle_lengths(&cells, settings, lengths, &mut notes);
    let Plan { lattice, lengths, bytes } =
        Plan::new(&cells, settings, lengths, 1 + fields.len(), &mut notes)?;
    if progress.cancelled() {
        return Err(Error::Interrupted);
    }

    let weight_of = |id: usize| weight.map_or(1.0, |it| it.number(id, 0) as f32);
    let mut columns = vec![cells.column(weight_of)];
    for &(attribute, component) in &fields {
        columns.push(cells.column(|id| weight_of(id) * attribute.number(id, component) as f32));
    }
    let length = match lengths {
        Lengths::Samples(longest) => Some(longest),
        Lengths::Particles(_) => None,
    };
    let work = Work { cells: &cells, settings, lattice, lengths, columns };
    let (mut grids, statistics) = match settings.kernel {
        Kernel::CubicSpline => work.fill(CubicSpline, &mut notes, progress),
        Kernel::WendlandC2 => work.fill(WendlandC2, &mut notes, progress),
        Kernel::Poly6 => work.fill(Poly6, &mut notes, progress),
    }?;
    let products = grids.split_off(1);
    let named = fields.iter().zip(products).map(|(&(attribute, component), product)| Field {
        name: attribute.name.clone(),
        component,
        product,
    });
    Ok(Volume {
        fields: named.collect(),
        density: grids.remove(0),
        statistics,
        length,
        peak_bytes: bytes,
        notes,
    })
}

/// Where the samples of [`estimate`] will lie, and the most memory that it will take at one time, in bytes. Fails as it does.
pub fn plan(particles: &Particles, settings: &Settings, progress: &dyn Progress) -> Result<(Lattice, u64)> {
    inputs::check(particles.len() as u64, settings)?;
    let mut notes = Vec::new();
    inputs::weight_attribute(particles, &settings.weight, &mut notes)?;
    let columns = 1 + inputs::fields(particles, &settings.fields)?.len();
    let lengths = inputs::length_attribute(particles, settings)?;
    automatic::check_particles(particles, columns, settings)?;
    progress.begin("sort", None, "particles");
    let cells = Cells::new(particles.positions());
    let lengths = particle_lengths(&cells, settings, lengths, &mut notes);
    let Plan { lattice, bytes, .. } = Plan::new(&cells, settings, lengths, columns, &mut notes)?;
    Ok((lattice, bytes))
}

/// The particles' lengths, if they have some: those of an attribute or the distances of neighbors.
fn particle_lengths(
    cells: &Cells,
    settings: &Settings,
    attribute: Option<&Attribute>,
    notes: &mut Vec<String>,
) -> Option<Column> {
    if settings.smoothing != Smoothing::Scatter {
        return None;
    }
    if let Some(attribute) = attribute {
        notes.push(format!(
            "particles spread their mass over '{}', read as the kernel's radius",
            attribute.name
        ));
        return Some(cells.column(|id| attribute.number(id, 0) as f32));
    }
    let target = settings.neighbors;
    notes.push(format!(
        "particles spread their mass as far as their {target}-th neighbor is, themselves counted"
    ));
    Some(neighbors::lengths(cells, target, 1))
}

/// Everything that is decided.
struct Work<'a> {
    cells: &'a Cells,
    settings: &'a Settings,
    lattice: Lattice,
    lengths: Lengths,
    columns: Vec<Column>,
}

impl Work<'_> {
    /// Sums the columns with one of the kernels.
    fn fill(
        mut self,
        shape: impl Shape,
        notes: &mut Vec<String>,
        progress: &dyn Progress,
    ) -> Result<(Vec<Grid>, Statistics)> {
        let Self { cells, settings, lattice, .. } = self;
        let all: Vec<usize> = (0..lattice.brick_count()).collect();
        let mut filling = Filling::new(lattice, self.columns.len());
        let longest = match self.lengths {
            Lengths::Samples(longest) => longest,
            Lengths::Particles(lengths) => {
                let (scatter, outside) = Scatter::new(cells, &lattice, shape, lengths, self.columns);
                if outside > 0 {
                    notes.push(format!("{outside} particles lie outside the grid's box"));
                }
                progress.begin("density", Some(all.len() as u64), "bricks");
                filling.fill(&scatter, &all, progress)?;
                return Ok(filling.finish());
            }
        };
        let normalization = settings.kernel.normalization() as f32;
        for value in self.columns.iter_mut().flat_map(|it| it.as_flattened_mut()) {
            *value *= normalization;
        }
        let columns: Vec<&[[f32; CELL]]> = self.columns.iter().map(|it| &it[..]).collect();
        let (block, target) = (Block::new(lattice.spacing), settings.neighbors as f32);
        let rule = Rule::of(settings);
        let gather = Gather { cells, block, shape, rule, longest, target, columns: &columns };
        progress.begin("density", Some(all.len() as u64), "bricks");
        filling.fill(&gather, &all, progress)?;
        let (most, room_bytes) = finer::most(settings);
        let parted = filling.parted(most, room_bytes);
        notes.extend(finer::note(&parted));
        progress.begin("refine", Some(parted.len() as u64), "bricks");
        gather.part(&mut filling, &parted, progress)?;
        Ok(filling.finish())
    }
}
