//! Particles measured from a center, around which those of a periodic box are put: what lies across its border is whole then.

use std::sync::atomic::{AtomicU32, Ordering};

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::{Lattice, Placement, place};
use crate::error::Result;
use crate::particles::{Cell, Particles};

/// Cells along each axis in which particles are counted: so many that one has [`USUAL`] particles, within these bounds.
const CELLS: [usize; 2] = [8, 64];
/// Fewer in a cell would be dense by chance.
const USUAL: usize = 8;
/// A place with fewer particles is not looked at more closely.
const FEW: usize = 64;
/// Places are looked at more closely at most so often, each time at least twice as closely: as far as single precision tells them apart.
const LEVELS: usize = 24;

/// The particles as seen from `center`, a point of their coordinates, which is 0,0,0 from now on. In a periodic box each is put where it is nearest along the edges,
/// or as `placement` says around the center. Returns too what `placement` did, in one line.
///
/// Fails as [`place`] does.
pub fn around(
    particles: Particles,
    center: DVec3,
    placement: Placement,
) -> Result<(Particles, Option<String>)> {
    let repeats = particles.cell().is_some_and(|cell| cell.periodic != [false; 3]);
    let (particles, text) = match placement {
        Placement::Unwrapped => place(particles, placement)?,
        Placement::AsStored if !repeats => (particles, None),
        _ => {
            let particles = match particles.cell() {
                Some(cell) if repeats => {
                    let shifted = shifted(cell, center)?;
                    particles.in_cell(shifted)
                }
                _ => particles,
            };
            let placement = if placement == Placement::AsStored { Placement::Atoms } else { placement };
            place(particles, placement)?
        }
    };
    Ok((particles.seen_from(center), text))
}

/// The cell with its middle at the center, along the edges that repeat.
fn shifted(cell: &Cell, center: DVec3) -> Result<Cell> {
    let lattice = Lattice::new(cell, "--center", "given")?;
    let edges = lattice.only_periodic(lattice.fractions() * (center - cell.origin) - 0.5);
    Ok(Cell { origin: cell.origin + lattice.shift(edges), ..*cell })
}

/// The middle of some of the particles, those with these ids; of the images of a particle in a periodic box that counts which is nearest to the first of them. None if there
/// are no ids.
pub fn middle(particles: &Particles, ids: &[u32]) -> Option<DVec3> {
    let units = Units::of(particles);
    let first = units.place(*ids.first()?);
    let sum: DVec3 = ids.iter().map(|&id| units.difference(units.place(id), first)).sum();
    Some(units.world(first + sum / ids.len() as f64))
}

/// The densest place: where most particles are in 2 x 2 x 2 cells of up to 64^3, then again in the surroundings of these, until few are left, whose middle it is. None without particles.
pub fn densest(particles: &Particles) -> Option<DVec3> {
    if particles.is_empty() {
        return None;
    }
    let units = Units::of(particles);
    let mut ids: Vec<u32> = (0..particles.len() as u32).collect();
    let (mut center, mut half) = (DVec3::splat(0.5), 0.5);
    for level in 0..LEVELS {
        // Only the whole box goes on behind its border.
        let goes_on = units.periodic.map(|periodic| periodic && level == 0);
        let cells = ((ids.len() / USUAL) as f64).cbrt().ceil() as usize;
        let cells = cells.clamp(CELLS[0], CELLS[1]);
        let place = |id: u32| units.difference(units.place(id), center) / half;
        let cell = |place: f64| ((0.5 * (place + 1.0) * cells as f64) as usize).min(cells - 1);
        let counts: Vec<AtomicU32> = (0..cells * cells * cells).map(|_| AtomicU32::new(0)).collect();
        ids.par_iter().with_min_len(1 << 12).for_each(|&id| {
            let [x, y, z] = place(id).to_array().map(cell);
            counts[(z * cells + y) * cells + x].fetch_add(1, Ordering::Relaxed);
        });
        let counts: Vec<u32> = counts.into_iter().map(AtomicU32::into_inner).collect();
        let [x, y, z] = fullest(&counts, cells, goes_on);
        let corner = DVec3::new(x as f64, y as f64, z as f64);
        // The middle of the window, of which the surroundings are twice as wide.
        center += half * (2.0 * (corner + 1.0) / cells as f64 - 1.0);
        half *= 4.0 / cells as f64;
        let before = ids.len();
        let is_near = |id: &u32| units.difference(units.place(*id), center).abs().max_element() <= half;
        ids = ids.into_par_iter().filter(is_near).collect();
        if ids.len() <= FEW || (level > 0 && ids.len() == before) {
            break;
        }
    }
    middle(particles, &ids)
}

/// The corner of the 2 x 2 x 2 of `cells` cells an axis with most in them, the first of several; axes that go on have windows across the border.
fn fullest(counts: &[u32], cells: usize, goes_on: [bool; 3]) -> [usize; 3] {
    let corners = goes_on.map(|goes_on| if goes_on { cells } else { cells - 1 });
    let planes = (0..corners[2]).into_par_iter().map(|z| {
        let mut best = (0, [0; 3]);
        for y in 0..corners[1] {
            for x in 0..corners[0] {
                let [xs, ys, zs] = [x, y, z].map(|it| [it, (it + 1) % cells]);
                let rows = zs.into_iter().flat_map(|z| ys.map(|y| (z * cells + y) * cells));
                let sum: u64 = rows.flat_map(|row| xs.map(|x| u64::from(counts[row + x]))).sum();
                if sum > best.0 {
                    best = (sum, [x, y, z]);
                }
            }
        }
        best
    });
    let planes: Vec<(u64, [usize; 3])> = planes.collect();
    planes.into_iter().reduce(|a, b| if b.0 > a.0 { b } else { a }).map_or([0; 3], |best| best.1)
}

/// Coordinates of 0 to 1: along the edges that repeat within the cell, else within the box around the particles.
struct Units<'a> {
    particles: &'a Particles,
    /// From an offset of the positions, and back.
    to_units: DMat3,
    to_offsets: DMat3,
    corner: DVec3,
    periodic: [bool; 3],
}

impl<'a> Units<'a> {
    fn of(particles: &'a Particles) -> Self {
        let origin = particles.positions().origin();
        let lattice = particles.cell().and_then(|cell| Lattice::new(cell, "", "").ok());
        let (mut to_units, periodic, start) = match &lattice {
            Some(lattice) => (lattice.fractions(), lattice.periodic(), lattice.origin() - origin),
            None => (DMat3::IDENTITY, [false; 3], DVec3::ZERO),
        };
        // Axes that do not repeat have the extent of the particles.
        let fractions = |id: u32| to_units * (particles.positions().offset(id as usize).as_dvec3() - start);
        let none = || [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let [low, high] = (0..particles.len() as u32)
            .into_par_iter()
            .map(|id| [fractions(id); 2])
            .reduce(none, |a, b| [a[0].min(b[0]), a[1].max(b[1])]);
        let mut corner = to_units * start;
        for axis in (0..3).filter(|&axis| !periodic[axis]) {
            let extent = high[axis] - low[axis];
            let scale = if extent > 0.0 { 1.0 / extent } else { 1.0 };
            corner[axis] = (corner[axis] + low[axis]) * scale;
            for column in [&mut to_units.x_axis, &mut to_units.y_axis, &mut to_units.z_axis] {
                column[axis] *= scale;
            }
        }
        Self { particles, to_units, to_offsets: to_units.inverse(), corner, periodic }
    }

    fn place(&self, id: u32) -> DVec3 {
        self.to_units * self.particles.positions().offset(id as usize).as_dvec3() - self.corner
    }

    /// How a place lies from another: of its images the nearest.
    fn difference(&self, place: DVec3, from: DVec3) -> DVec3 {
        let by = place - from;
        DVec3::from_array(std::array::from_fn(|axis| {
            if self.periodic[axis] { by[axis] - by[axis].round() } else { by[axis] }
        }))
    }

    /// In the coordinates of the particles' file.
    fn world(&self, place: DVec3) -> DVec3 {
        self.particles.positions().origin() + self.to_offsets * (place + self.corner)
    }
}
