//! What follows from the particles: the smoothing length, the lattice, and whether memory suffices.
//!
//! Takes cells and settings, gives a [`Plan`] with a line for everything that was chosen. Lengths come from the distances of the
//! N*-th neighbors of some thousand particles, the same at every run.

use glam::Vec3;

use super::{Resolution, Settings, Smoothing, neighbors};
use crate::error::{Error, Result};
use crate::math::Bounds;
use crate::medium::cells::{CELL, Cells, Column};
use crate::medium::grid::{BRICK, Grid, Lattice};
use crate::particles::Particles;

/// Lengths and weights are below this, so that squares and cubes of lengths are floats.
pub(super) const LONGEST: f32 = 1e12;
/// Lengths are above this, for the same reason.
pub(super) const SHORTEST: f32 = 1e-12;
/// Cells of which particles are asked for their neighbors.
pub(super) const ASKED_CELLS: usize = 256;
/// Share of the particles whose N*-th neighbor is within the automatic h0 of adaptive lengths.
const REACHED: f32 = 0.95;
/// Share of the particles that have N* neighbors within three automatic spacings.
const RESOLVED: f32 = 0.1;
/// Automatic samples along the longest axis, at least and at most.
const AUTOMATIC_SAMPLES: [f32; 2] = [64.0, 256.0];

/// Who has a length.
pub(super) enum Lengths {
    /// The samples: at most this, h0.
    Samples(f32),
    /// The particles.
    Particles(Column),
}

/// What is decided before the work.
pub(super) struct Plan {
    pub(super) lattice: Lattice,
    pub(super) lengths: Lengths,
    /// The most memory that the work takes at one time, beside the particles' own.
    pub(super) bytes: u64,
}

impl Plan {
    /// Chooses what is not set. `of_particles` are the scatter's lengths; `columns` are the values on the grid.
    pub(super) fn new(
        cells: &Cells,
        settings: &Settings,
        of_particles: Option<Column>,
        columns: usize,
        notes: &mut Vec<String>,
    ) -> Result<Self> {
        let sorted = match &of_particles {
            Some(lengths) => neighbors::sorted(lengths),
            None => {
                let step = cells.centers().len().div_ceil(ASKED_CELLS);
                neighbors::sorted(&neighbors::lengths(cells, settings.neighbors, step))
            }
        };
        let (lattice, longest) = choose(cells.bounds(), settings, &sorted, notes)?;
        let lengths = of_particles.map_or(Lengths::Samples(longest), Lengths::Particles);
        let of_particles = particle_bytes(cells.len(), columns);
        let reached = || reached_bricks(cells, &lattice, &lengths);
        let bytes = check_memory(of_particles, reached, (&lattice, columns), settings)?;
        Ok(Self { lattice, lengths, bytes })
    }
}

/// Whether [`choose`] asks how far the neighbors of particles are that have no lengths of their own.
pub(super) fn asks(settings: &Settings) -> bool {
    settings.length.is_none() || settings.resolution == Resolution::Automatic
}

/// The lattice and the longest length, for particles within `bounds`; `sorted` are the lengths of some.
pub(super) fn choose(
    bounds: Bounds,
    settings: &Settings,
    sorted: &[f32],
    notes: &mut Vec<String>,
) -> Result<(Lattice, f32)> {
    let quantile = |share: f32| {
        let place = (share * sorted.len().saturating_sub(1) as f32).round() as usize;
        sorted.get(place).copied().unwrap_or(f32::INFINITY)
    };
    let longest = match (settings.smoothing, settings.length) {
        (Smoothing::Scatter, _) => quantile(REACHED),
        (_, Some(length)) => length,
        (Smoothing::Uniform, None) => chosen_length(quantile(0.5), settings, notes)?,
        (_, None) => chosen_length(quantile(REACHED), settings, notes)?,
    };
    if settings.smoothing != Smoothing::Scatter && longest > bounds.extent().length() {
        notes.push(format!("the smoothing length {longest} is larger than the scene"));
    }
    let finest = quantile(RESOLVED).min(longest);
    let lattice = lattice(bounds, (longest, finest / 3.0), settings.resolution)?;
    lattice.check()?;
    if settings.resolution == Resolution::Automatic {
        let [x, y, z] = lattice.size;
        notes.push(format!("grid of {x}x{y}x{z} samples {} apart (automatic)", lattice.spacing));
    }
    Ok((lattice, longest))
}

/// The automatic h0.
fn chosen_length(length: f32, settings: &Settings, notes: &mut Vec<String>) -> Result<f32> {
    if !(SHORTEST..LONGEST).contains(&length) {
        let allowed = "a length above 0: the particles lie at one place, or farther apart than numbers reach";
        return Err(Error::setting("smoothing length", "automatic", allowed));
    }
    let target = settings.neighbors;
    let share = if settings.smoothing == Smoothing::Uniform { "half" } else { "19 of 20" };
    notes.push(format!(
        "smoothing length {length} (automatic: {share} of the particles have {target} within it)"
    ));
    Ok(length)
}

/// The lattice over the particles and `margin` around them.
fn lattice(particles: Bounds, (margin, finest): (f32, f32), resolution: Resolution) -> Result<Lattice> {
    let extent = particles.extent() + 2.0 * margin;
    let longest = extent.max_element();
    let spacing = match resolution {
        Resolution::Lattice(lattice) => return Ok(lattice),
        Resolution::Continued(lattice) => return Ok(continued(lattice, particles.grown(margin))),
        Resolution::Voxel(spacing) => spacing,
        Resolution::Samples(samples) if samples < 2 => {
            return Err(Error::setting("grid", samples, "at least 2 samples along the longest axis"));
        }
        Resolution::Samples(samples) => longest / (samples - 1) as f32,
        Resolution::Automatic => {
            let [fewest, most] = AUTOMATIC_SAMPLES;
            finest.clamp(longest / (most - 1.0), longest / (fewest - 1.0))
        }
    };
    if !(SHORTEST..LONGEST).contains(&spacing) {
        return Err(Error::setting("spacing of the grid", spacing, "a length above 0"));
    }
    // Rounding must not add a sample to what divides evenly.
    let steps = (extent / spacing - 1e-4).ceil().max(Vec3::ONE);
    let size = (steps + 1.0).as_uvec3();
    Ok(Lattice { origin: particles.center() - 0.5 * spacing * steps, spacing, size: size.to_array() })
}

/// The lattice with bricks added or left out at its sides, so that its samples are just over a box.
fn continued(lattice: Lattice, bounds: Bounds) -> Lattice {
    let edge = BRICK as f32 * lattice.spacing;
    let last = lattice.position(lattice.size.map(|it| it - 1));
    // What divides evenly but for rounding does.
    let before = ((bounds.min - lattice.origin) / edge + 1e-3).floor();
    let behind = ((bounds.max - last) / edge - 1e-3).ceil();
    let size = Vec3::from(lattice.size.map(|it| it as f32)) + BRICK as f32 * (behind - before);
    Lattice {
        origin: lattice.origin + edge * before,
        spacing: lattice.spacing,
        size: size.max(Vec3::splat(2.0)).as_uvec3().to_array(),
    }
}

/// Refuses particles that do not fit the memory while they are sorted, before anything is allocated.
pub(super) fn check_particles(particles: &Particles, columns: usize, settings: &Settings) -> Result<()> {
    let needed_bytes = particle_bytes(particles.len(), columns);
    let available_bytes = settings.memory_bytes.unwrap_or(u64::MAX);
    if needed_bytes <= available_bytes {
        return Ok(());
    }
    let what = format!("sorting {} particles", particles.len());
    Err(Error::Memory { what, needed_bytes, available_bytes, hint: "take fewer particles".into() })
}

/// Memory of sorted particles, or of sorting them if that is more: weights, fields, lengths, shares and reaches too.
pub(super) fn particle_bytes(count: usize, columns: usize) -> u64 {
    Cells::bytes_to_make(count).max(Cells::bytes(count) + 4 * (2 * columns as u64 + 6) * count as u64)
}

/// The most memory that the work takes, where particles take so much and reach so many bricks. Fails with [`Error::Memory`] if that is more
/// than there is.
pub(super) fn check_memory(
    of_particles: u64,
    reached: impl FnOnce() -> u64,
    (lattice, columns): (&Lattice, usize),
    settings: &Settings,
) -> Result<u64> {
    let of_bricks = |stored: u64| {
        of_particles + columns as u64 * Grid::bytes_to_make(lattice.brick_count() as u64, stored)
    };
    let available_bytes = settings.memory_bytes.unwrap_or(u64::MAX);
    let dense = of_bricks(lattice.brick_count() as u64);
    if dense <= available_bytes {
        return Ok(dense);
    }
    // It may yet fit, if most bricks are empty.
    let mut needed_bytes = dense;
    if of_bricks(0) <= available_bytes {
        needed_bytes = of_bricks(reached());
        if needed_bytes <= available_bytes {
            return Ok(needed_bytes);
        }
    }
    let [x, y, z] = lattice.size;
    // What fits whatever is empty.
    let for_grid = available_bytes.saturating_sub(of_particles) as f64;
    let share = (for_grid / (dense - of_particles) as f64).cbrt();
    let fits = (0.95 * share * f64::from(x.max(y).max(z))) as u32;
    let hint = match fits {
        0 | 1 => "take fewer particles".into(),
        fits => {
            let spacing = lattice.spacing * x.max(y).max(z) as f32 / fits as f32;
            format!("a grid of {fits} samples along the longest axis fits, {spacing} apart")
        }
    };
    Err(Error::Memory { what: format!("a grid of {x}x{y}x{z} samples"), needed_bytes, available_bytes, hint })
}

/// How many bricks the particles may reach, and those before them, whose aprons they reach.
fn reached_bricks(cells: &Cells, lattice: &Lattice, lengths: &Lengths) -> u64 {
    let mut reached = Reached::none(lattice);
    for (cell, center) in cells.centers().iter().enumerate() {
        let places = (0..CELL).map(|lane| Vec3::new(center[0][lane], center[1][lane], center[2][lane]));
        let bounds = places.filter(|it| it.is_finite()).fold(Bounds::EMPTY, Bounds::with);
        let length = match lengths {
            Lengths::Samples(longest) => *longest,
            Lengths::Particles(column) => column[cell].iter().copied().fold(0.0, f32::max),
        };
        reached.add(bounds.grown(length.max(lattice.spacing) + lattice.spacing));
    }
    reached.count()
}

/// Bricks of a lattice that boxes touch.
pub(super) struct Reached<'a> {
    lattice: &'a Lattice,
    bricks: Vec<bool>,
}

impl<'a> Reached<'a> {
    pub(super) fn none(lattice: &'a Lattice) -> Self {
        Self { lattice, bricks: vec![false; lattice.brick_count()] }
    }

    /// Adds those that a box touches.
    pub(super) fn add(&mut self, bounds: Bounds) {
        let bricks = self.lattice.bricks();
        let edge = self.lattice.spacing * BRICK as f32;
        let place = |at: Vec3| ((at - self.lattice.origin) / edge).floor().max(Vec3::ZERO).as_uvec3();
        let (low, high) = (place(bounds.min), place(bounds.max));
        for k in low.z..=high.z.min(bricks[2] - 1) {
            for j in low.y..=high.y.min(bricks[1] - 1) {
                let row = (k as usize * bricks[1] as usize + j as usize) * bricks[0] as usize;
                let end = high.x.min(bricks[0] - 1) as usize;
                if low.x as usize <= end {
                    self.bricks[row + low.x as usize..=row + end].fill(true);
                }
            }
        }
    }

    pub(super) fn count(&self) -> u64 {
        self.bricks.iter().filter(|&&it| it).count() as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lattices_cover_the_particles_and_what_they_reach() {
        let particles = Bounds { min: Vec3::ZERO, max: Vec3::new(8.0, 4.0, 0.0) };
        let by = |resolution| lattice(particles, (1.0, 0.05), resolution).unwrap();
        let voxel = by(Resolution::Voxel(0.5));
        assert_eq!((voxel.size, voxel.origin), ([21, 13, 5], Vec3::splat(-1.0)));
        let samples = by(Resolution::Samples(41));
        assert_eq!((samples.size, samples.spacing), ([41, 25, 9], 0.25));
        assert_eq!(by(Resolution::Automatic).size[0], 201);
        assert_eq!(by(Resolution::Lattice(voxel)), voxel);
        let uneven = by(Resolution::Voxel(0.7));
        assert!(uneven.bounds().contains(particles.min) && uneven.bounds().contains(particles.max));
        assert!(lattice(particles, (1.0, 1.0), Resolution::Samples(1)).is_err());
    }

    #[test]
    fn a_lattice_is_continued_by_bricks() {
        let particles = Bounds { min: Vec3::ZERO, max: Vec3::new(8.0, 4.0, 0.0) };
        let first = lattice(particles, (1.0, 0.05), Resolution::Voxel(0.3)).unwrap();
        let continued = |by: Vec3| {
            let moved = Bounds { min: particles.min + by, max: particles.max + by };
            (moved.grown(1.0), lattice(moved, (1.0, 0.05), Resolution::Continued(first)).unwrap())
        };
        assert_eq!(continued(Vec3::ZERO).1, first);
        for by in [Vec3::splat(0.1), Vec3::new(-3.3, 1.9, 40.0), Vec3::new(2.4, -4.8, 0.01)] {
            let (bounds, found) = continued(by);
            let bricks = (found.origin - first.origin) / 2.4;
            assert!((bricks - bricks.round()).abs().max_element() < 1e-3, "{by}: {bricks}");
            let last = found.position(found.size.map(|it| it - 1));
            assert!(
                found.origin.cmple(bounds.min + 1e-3).all() && last.cmpge(bounds.max - 3e-3).all(),
                "{by}"
            );
            assert!(
                (found.origin + 2.4).cmpge(bounds.min).all() && (last - 2.4).cmple(bounds.max).all(),
                "{by}"
            );
        }
        assert!(lattice(particles, (1.0, 1.0), Resolution::Voxel(0.0)).is_err());
    }
}
