//! Radiance from photons: those in a ball around a point, over what scatters in the ball.
//!
//! A photon's power is what is scattered where it lies, so that power over the scattering coefficient's integral over the ball is
//! radiance: right where the density changes within the ball, and at its border. Invariant: photons are sorted by the cells of a
//! lattice as wide as the radius, so that a ball meets at most 27 cells.
//! Source: H. Jensen, P. Christensen, SIGGRAPH 1998; D. Cha, S. Son, I. Ihm, EGSR 2009.

use std::sync::Arc;

use glam::{IVec3, Vec3};
use rayon::prelude::*;

use super::balls::{self, Wanted};
use super::field::{Field, anchored, sample, spacing};
use super::harmonics;
use super::photons::{Photon, Photons};
use super::solids::Solids;
use crate::error::{Error, Result};
use crate::medium::Medium;
use crate::medium::grid::Lattice;
use crate::progress::Progress;

/// How wide the ball is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Radius {
    /// For 100 photons a ball, on average over the bricks that hold something.
    #[default]
    Automatic,
    /// This length.
    Fixed(f32),
    /// As wide as it takes for so many photons, at most this length.
    Nearest(u32, f32),
}

/// Photons a ball holds on average where nobody says how wide it is.
const AUTOMATIC: f64 = 100.0;
/// Alpha of progressive passes, between 0 (fewer photons count) and 1 (the radius stays).
const SHRINKAGE: f32 = 2.0 / 3.0;
/// Points of a ball at which the density is looked up, and of one that is mostly empty: there the few may miss what little there is.
const POINTS: usize = 32;
const FINE_POINTS: usize = 256;
/// Samples of the space that bodies take.
const MOST_SAMPLES: f64 = 4e6;
/// So few filled points are mostly empty.
const FEW: usize = POINTS / 4;

/// Photons, sorted by place.
pub struct PhotonMap<'a> {
    medium: &'a Medium,
    radius: Radius,
    widest: f32,
    origin: Vec3,
    size: [usize; 3],
    /// The first photon of every cell, and the end.
    starts: Vec<u32>,
    photons: Vec<Photon>,
    points: Vec<Vec3>,
    fine_points: Vec<Vec3>,
    /// The share of space that bodies take, in which nothing scatters.
    covered: Option<Arc<Field>>,
}

impl<'a> PhotonMap<'a> {
    /// Sorts photons. Fails with [`Error::Setting`] for a radius that is not above 0 or a number of photons that is 0.
    pub fn new(medium: &'a Medium, photons: &Photons, radius: Radius) -> Result<Self> {
        let bounds = medium.bounds();
        let widest = match radius {
            Radius::Automatic => automatic(medium, photons.stored.len()),
            Radius::Fixed(radius) | Radius::Nearest(_, radius) => radius,
        };
        if !(widest > 0.0 && widest.is_finite()) {
            return Err(Error::setting("gather-radius", widest, "a length above 0"));
        }
        if matches!(radius, Radius::Nearest(0, _)) {
            return Err(Error::setting("gather-radius", 0, "at least one photon"));
        }
        // Cells as wide as the ball, unless these would be too many for a table.
        let edge = widest.max(bounds.extent().max_element() / 1000.0);
        let size = (bounds.extent() / edge).to_array().map(|cells| cells as usize + 1);
        let mut map = Self {
            medium,
            radius: if radius == Radius::Automatic { Radius::Fixed(widest) } else { radius },
            widest: edge,
            origin: bounds.min,
            size,
            starts: vec![0; size.iter().product::<usize>() + 1],
            photons: photons.stored.clone(),
            points: ball(POINTS),
            fine_points: ball(FINE_POINTS),
            covered: None,
        };
        let cell = |photon: &Photon| map.cell(photon.position);
        let mut keyed: Vec<(u32, u32)> = photons
            .stored
            .par_iter()
            .enumerate()
            .map(|(place, it)| (cell(it) as u32, place as u32))
            .collect();
        keyed.par_sort_unstable();
        for (to, &(cell, from)) in keyed.iter().enumerate() {
            map.photons[to] = photons.stored[from as usize];
            map.starts[cell as usize + 1] = to as u32 + 1;
        }
        for cell in 1..map.starts.len() {
            map.starts[cell] = map.starts[cell].max(map.starts[cell - 1]);
        }
        Ok(map)
    }

    /// The same where bodies take a share of space, as [`covered`] finds it.
    pub(super) fn outside(self, covered: Option<Arc<Field>>) -> Self {
        Self { covered, ..self }
    }

    /// The widest that a ball is.
    pub fn radius(&self) -> f32 {
        match self.radius {
            Radius::Fixed(radius) | Radius::Nearest(_, radius) => radius,
            Radius::Automatic => self.widest,
        }
    }

    /// The radius of the pass after number `pass`, counted from 0: the volume of the ball shrinks as slowly as lets both the error
    /// by its width and the noise of the mean vanish. Source: C. Knaus, M. Zwicker, "Progressive photon mapping: a probabilistic
    /// approach", ACM TOG 30, 2011, section 4 (volumes: the cube of the radius shrinks by (i + alpha) / (i + 1)).
    pub(super) fn shrunk(&self, pass: u32) -> Radius {
        let pass = pass as f32 + 1.0;
        let share = ((pass + SHRINKAGE) / (pass + 1.0)).cbrt();
        match self.radius {
            Radius::Nearest(count, most) => Radius::Nearest(count, share * most),
            _ => Radius::Fixed(share * self.radius()),
        }
    }

    /// Coefficients of the radiance at all samples of a lattice up to an order of spherical harmonics, of some channels: one column
    /// each, those of the first channel first. Fails only when interrupted.
    pub(super) fn columns(
        &self,
        lattice: &Lattice,
        wanted: &Wanted,
        progress: &dyn Progress,
    ) -> Result<Vec<Vec<f32>>> {
        let number = harmonics::count(wanted.order);
        let count = lattice.sample_count() as usize;
        let position = |place: usize| lattice.position(sample(lattice, place));
        if let Radius::Nearest(..) = self.radius {
            progress.begin("gather", Some(count as u64), "samples");
            let of_sample = |place: usize| match progress.cancelled() {
                true => [Vec3::ZERO; harmonics::COUNT],
                false => self.coefficients(position(place), wanted.order),
            };
            let found: Vec<_> = (0..count).into_par_iter().with_min_len(256).map(of_sample).collect();
            let column =
                |(&channel, number): (&usize, usize)| found.iter().map(|it| it[number][channel]).collect();
            let columns = wanted.channels.iter().flat_map(|channel| (0..number).map(move |it| (channel, it)));
            return if progress.cancelled() {
                Err(Error::Interrupted)
            } else {
                Ok(columns.map(column).collect())
            };
        }
        let radius = self.radius();
        let mut columns = balls::sums(lattice, &self.photons, radius, wanted, progress)?;
        // What scatters in the balls, where there are photons: elsewhere the sums are 0 anyway.
        let is_lit = |place: usize| columns.iter().step_by(number).any(|column| column[place] != 0.0);
        let mass = |place: usize| if is_lit(place) { self.mass(position(place), radius) } else { 0.0 };
        let masses: Vec<f32> = (0..count).into_par_iter().with_min_len(256).map(mass).collect();
        for (place, column) in columns.iter_mut().enumerate() {
            let channel = wanted.channels[place / number];
            column
                .par_iter_mut()
                .zip(&masses)
                .for_each(|(sum, &mass)| *sum *= self.per_scattering(mass)[channel]);
        }
        Ok(columns)
    }

    /// Mass in a ball, outside bodies.
    fn mass(&self, at: Vec3, radius: f32) -> f32 {
        let density = |point: &Vec3| {
            let at = at + radius * point;
            let free = self.covered.as_ref().map_or(1.0, |covered| 1.0 - covered.value(at));
            free * self.medium.density().density(at)
        };
        let (mut sum, mut filled) = (0.0, 0);
        for found in self.points.iter().map(density) {
            sum += found;
            filled += usize::from(found > 0.0);
        }
        let mean = match filled >= FEW {
            true => sum / POINTS as f32,
            false => self.fine_points.iter().map(density).sum::<f32>() / FINE_POINTS as f32,
        };
        mean * (4.0 / 3.0 * std::f32::consts::PI * radius.powi(3))
    }

    /// One over what a mass scatters; 0 where that is nothing.
    fn per_scattering(&self, mass: f32) -> Vec3 {
        let optics = self.medium.optics();
        let scattering = mass * Vec3::from(optics.extinction) * Vec3::from(optics.albedo);
        scattering.map(|it| if it > 0.0 { 1.0 / it } else { 0.0 })
    }

    /// Coefficients of the radiance at a point up to an order of spherical harmonics, RGB.
    pub(super) fn coefficients(&self, at: Vec3, order: usize) -> [Vec3; harmonics::COUNT] {
        let mut sums = [Vec3::ZERO; harmonics::COUNT];
        let radius = match self.radius {
            Radius::Nearest(wanted, most) => self.nearest(at, wanted as usize, most),
            _ => self.radius(),
        };
        let mass = self.mass(at, radius);
        if mass <= 0.0 {
            return sums;
        }
        if order == 0 {
            self.each(at, radius, |photon, _| sums[0] += photon.power);
            sums[0] *= harmonics::evaluate(Vec3::Z)[0];
        } else {
            let number = harmonics::count(order);
            self.each(at, radius, |photon, _| {
                let harmonics = harmonics::evaluate(photon.direction);
                for (sum, harmonic) in sums[..number].iter_mut().zip(harmonics) {
                    *sum += harmonic * photon.power;
                }
            });
        }
        let inverse = self.per_scattering(mass);
        sums.map(|sum| sum * inverse)
    }

    /// The distance of the photon number `wanted` by distance, at most `most`.
    fn nearest(&self, at: Vec3, wanted: usize, most: f32) -> f32 {
        let mut distances = Vec::new();
        self.each(at, most, |_, distance_sq| distances.push(distance_sq));
        if distances.len() < wanted {
            return most;
        }
        let (_, distance_sq, _) = distances.select_nth_unstable_by(wanted - 1, f32::total_cmp);
        distance_sq.sqrt()
    }

    /// All photons in a ball, with their squared distances, in a fixed order.
    fn each(&self, at: Vec3, radius: f32, mut visit: impl FnMut(&Photon, f32)) {
        let [low, high] = [at - radius, at + radius].map(|corner| self.place(corner));
        for z in low.z..=high.z {
            for y in low.y..=high.y {
                let row = (z as usize * self.size[1] + y as usize) * self.size[0];
                let first = self.starts[row + low.x as usize] as usize;
                let end = self.starts[row + high.x as usize + 1] as usize;
                for photon in &self.photons[first..end] {
                    let distance_sq = photon.position.distance_squared(at);
                    if distance_sq <= radius * radius {
                        visit(photon, distance_sq);
                    }
                }
            }
        }
    }

    fn place(&self, at: Vec3) -> IVec3 {
        let last = IVec3::from_array(self.size.map(|it| it as i32 - 1));
        ((at - self.origin) / self.widest).floor().as_ivec3().clamp(IVec3::ZERO, last)
    }

    fn cell(&self, at: Vec3) -> usize {
        let place = self.place(at);
        (place.z as usize * self.size[1] + place.y as usize) * self.size[0] + place.x as usize
    }
}

/// The share of space in a medium that bodies take, around which photons were traced.
pub(super) fn covered(medium: &Medium, solids: Solids) -> Arc<Field> {
    let grid = medium.density();
    let spacing = spacing(grid, grid.spacing(), MOST_SAMPLES);
    Arc::new(solids.covered(anchored(grid, spacing, grid.origin())))
}

/// A radius for [`AUTOMATIC`] photons a ball.
fn automatic(medium: &Medium, photons: usize) -> f32 {
    let grid = medium.density();
    let [stored, _] = grid.stored_bricks();
    let volume = stored as f64 * f64::from(8.0 * grid.spacing()).powi(3);
    let share = AUTOMATIC / photons.max(1) as f64;
    let radius = (volume * share / (4.0 / 3.0 * std::f64::consts::PI)).cbrt() as f32;
    radius.clamp(grid.spacing(), 0.25 * medium.bounds().extent().max_element().max(grid.spacing()))
}

/// Points spread evenly in the unit ball.
fn ball(count: usize) -> Vec<Vec3> {
    let directions = harmonics::directions(count);
    // Radii in an order that has nothing to do with that of the directions.
    let radius = |place: usize| ((place as f32 * 0.754_877_7).fract() + 1e-3).cbrt().min(1.0);
    directions.into_iter().enumerate().map(|(place, direction)| radius(place) * direction).collect()
}
