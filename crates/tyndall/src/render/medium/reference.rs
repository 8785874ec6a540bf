//! The reference: a path tracer for media without bias, by which every approximation is judged.
//!
//! Takes a medium, its lights and a view; adds samples to every pixel in passes. Along the camera's ray the column is integrated
//! exactly, so that what comes through has no noise, and first scatterings are drawn from the part that does not come through.
//! From there null collisions find the next scattering; at each one, the lights without extent are looked at through an
//! estimated transmittance, and an image of the sky both by its own and by the phase function's directions; what matter emits is
//! added where a path meets it. Lamps in the medium are found by paths that start at them, too (`reference/lamps.rs`). There is no limit of
//! orders: paths end by Russian roulette. Invariant: with a right free path and all orders the expected value of every pixel is its
//! radiance; the same seed gives the same bits for any number of threads.
//!
//! Sources: J. Novak, I. Georgiev, J. Hanika, W. Jarosz, "Monte Carlo methods for volumetric light transport simulation",
//! Eurographics STAR 2018; B. Miller, I. Georgiev, W. Jarosz, "A null-scattering path integral formulation of light transport",
//! SIGGRAPH 2019.

mod lamps;

use glam::Vec3;
use rayon::prelude::*;

use self::lamps::Lamps;
use super::film::{Film, Pixel, Sums};
use super::free_path::{FreePath, Tracker};
use super::lights::Lights;
use super::refine::{Gathering, Goal, refine};
use super::regular::Crossing;
use super::solids::{Solids, cosine_direction, thrown};
use crate::error::{Error, Result};
use crate::math::Ray;
use crate::medium::{Light, Medium};
use crate::progress::Progress;
use crate::random::Stream;
use crate::render::refine::Quality;
use crate::render::sampling::{Dimension, point, shuffled_point};
use crate::render::surface::Surface;
use crate::scene::camera::View;

/// The knobs of a reference picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Pixels in a row; 1 to 65536.
    pub width: u32,
    /// Rows; 1 to 65536.
    pub height: u32,
    /// Another seed gives other random numbers.
    pub seed: u32,
    /// Most scatterings of a path that count; `None` for all orders.
    pub orders: Option<u32>,
    /// How distances between scatterings are drawn; the wrong ones make a wrong picture.
    pub free_path: FreePath,
}

/// A reference picture in the making.
pub struct Reference<'a> {
    tracker: Tracker<'a>,
    lights: Lights<'a>,
    /// Those from which paths start.
    lamps: Option<Lamps<'a>>,
    solids: Option<Solids<'a>>,
    view: View,
    settings: Settings,
    film: Film,
}

/// Paths of one camera ray. To integrate along the ray takes about as long as a path, so that two halve the variance for half as
/// much time again (Mitsuba's scene: variance times seconds 0.0033, 0.0025, 0.0023 with 1, 2 and 4).
const PATHS: u32 = 2;

/// Paths whose throughput falls below this are ended with a chance: see [`Reference::path`].
const ROULETTE: f32 = 0.25;

impl<'a> Reference<'a> {
    /// A picture of `medium` without samples yet. Fails with [`Error::Setting`] for an impossible size.
    pub fn new(medium: &'a Medium, lights: &'a [Light], view: View, settings: Settings) -> Result<Self> {
        let Settings { width, height, .. } = settings;
        if !(1..=65536).contains(&width) || !(1..=65536).contains(&height) {
            return Err(Error::setting("size", format!("{width}x{height}"), "1x1 to 65536x65536 pixels"));
        }
        let lamps = match settings.free_path {
            FreePath::Exact | FreePath::Delta => Lamps::new(lights, medium, width.saturating_mul(height)),
            // All light is to be as wrong as it is along such paths.
            FreePath::Homogeneous | FreePath::Scaled { .. } => None,
        };
        let paths = |light: &Light| lamps.as_ref().map_or(0.0, |lamps| lamps.per_steradian(light));
        Ok(Self {
            tracker: Tracker::new(medium),
            lights: Lights::with_paths(lights, paths),
            lamps,
            solids: None,
            view,
            settings,
            film: Film::new(width, height),
        })
    }

    /// The same with opaque bodies in the medium.
    pub fn with_solids(self, solids: Solids<'a>) -> Self {
        Self { solids: Some(solids), ..self }
    }

    /// The same, which keeps what [`Reference::denoised`] needs: twice the memory.
    pub fn with_halves(self) -> Self {
        Self { film: self.film.with_halves(), ..self }
    }

    /// Adds `samples` to every pixel; reports `width * height * samples` to `progress`. Fails only when interrupted; the
    /// picture is then incomplete.
    pub fn pass(&mut self, samples: u32, progress: &dyn Progress) -> Result<()> {
        let until = self.film.samples_done + samples;
        while self.film.samples_done < until {
            let added = self.film.at_once().min(until - self.film.samples_done);
            self.add_samples(added, progress)?;
        }
        Ok(())
    }

    fn add_samples(&mut self, added: u32, progress: &dyn Progress) -> Result<()> {
        self.film.begin();
        let mut sums = std::mem::take(&mut self.film.sums);
        let width = self.settings.width as usize;
        let first = self.film.samples_done;
        sums.par_chunks_mut(width).enumerate().for_each(|(row, sums)| {
            if progress.cancelled() {
                return;
            }
            let mut crossing = Crossing::default();
            for (column, sums) in (0..).zip(sums).filter(|(column, _)| self.film.wants(*column, row as u32)) {
                for sample in first..first + added {
                    self.sample([column, row as u32], sample, &mut crossing, sums);
                }
            }
            progress.advance(u64::from(added) * width as u64);
        });
        self.film.sums = sums;
        for sample in first..first + added {
            self.add_lamps(sample, progress);
        }
        self.film.advance(added);
        if progress.cancelled() { Err(Error::Interrupted) } else { Ok(()) }
    }

    /// Adds samples until the goal is reached or `is_late` says so, which is asked after each sample of all pixels. Fails as [`Reference::pass`] does.
    pub fn refine(
        &mut self,
        goal: &Goal,
        is_late: &mut dyn FnMut() -> bool,
        progress: &dyn Progress,
    ) -> Result<Quality> {
        refine(self, goal, is_late, progress)
    }

    /// Samples that every pixel has.
    pub fn samples_done(&self) -> u32 {
        self.film.samples_done
    }

    /// The means so far, row by row from the top left; zero without samples. Where light is only added there is no depth.
    pub fn pixels(&self) -> Vec<Pixel> {
        self.film.pixels()
    }

    /// The same with less noise in the light that is scattered, as the differences between samples tell it. `None` if pixels have a single
    /// sample, or without [`Reference::with_halves`].
    pub fn denoised(&self) -> Option<Vec<Pixel>> {
        self.film.denoised()
    }

    /// Adds a sample to the pixel in a column and row.
    fn sample(&self, [column, row]: [u32; 2], sample: u32, crossing: &mut Crossing, sums: &mut Sums) {
        let seed = self.settings.seed;
        let number = row * self.settings.width + column;
        let [x, y] = point(seed, Dimension::Pixel, number, sample);
        let mut ray = self.view.ray(column as f32 + x, row as f32 + y);
        let met = self.solids.and_then(|it| it.show(&mut ray));

        self.tracker.cross(&ray, crossing);
        let through = self.tracker.through(crossing.column);
        let transmittance = if met.is_some() { Vec3::ZERO } else { through };
        sums.transmittance += transmittance;
        sums.environment += transmittance * self.lights.seen(ray.direction);
        if self.tracker.medium().is_additive() {
            sums.scattered += self.tracker.added(&ray);
        }
        if let Some(surface) = met.filter(|_| through != Vec3::ZERO) {
            let mut stream = Stream::new(u64::from(seed), u64::from(number) << 32 | u64::from(!sample));
            let random = shuffled_point(seed, Dimension::Lens, number, sample);
            let most = through.max_element();
            let start = Ray { origin: surface.position, ..ray };
            let radiance = self.path(Met::Surface(surface), start, through / most, random, &mut stream);
            sums.scattered += most * radiance;
            sums.add_depth(ray.t_max, through);
        }
        if through == Vec3::ONE {
            return;
        }
        for path in sample * PATHS..(sample + 1) * PATHS {
            let at = |dimension| shuffled_point(seed, dimension, number, path);
            let (distance, weight) = self.tracker.forced(crossing, at(Dimension::Key));
            let mut stream = Stream::new(u64::from(seed), u64::from(number) << 32 | u64::from(path));
            let start = Ray { origin: ray.origin + distance * ray.direction, ..ray };
            // The roulette must not end a path because little of the medium is in the way.
            let scale = weight.max_element();
            let radiance = self.path(Met::Matter, start, weight / scale, at(Dimension::Sky), &mut stream);
            sums.scattered += scale / PATHS as f32 * radiance;
            sums.add_depth(distance, weight / PATHS as f32);
        }
    }

    /// The radiance of a path that first meets something at the origin of `ray`, coming along its direction from the camera.
    fn path(&self, met: Met, ray: Ray, weight: Vec3, random: [f32; 2], stream: &mut Stream) -> Vec3 {
        let medium = self.tracker.medium();
        let optics = medium.optics();
        let (mut met, mut at, mut direction) = (met, ray.origin, ray.direction);
        let seen = self.seen_paths(&met, at);
        let mut throughput = weight;
        let mut radiance = Vec3::ZERO;
        let mut random = random;
        let mut scatterings = 0;
        loop {
            radiance += throughput
                * match &met {
                    Met::Matter => medium.emitted(at),
                    Met::Surface(surface) => surface.glow,
                };
            if self.settings.orders.is_some_and(|orders| scatterings >= orders) {
                return radiance;
            }
            throughput *= match &met {
                Met::Matter => Vec3::from(optics.albedo),
                Met::Surface(surface) => surface.color,
            };
            // Looks at the lights.
            radiance += throughput * self.direct(seen, &met, at, direction, stream);
            // Goes on in a direction of the phase function's or the surface's, unless the dice end the path.
            let most = throughput.max_element();
            if most < ROULETTE {
                if stream.unit() * ROULETTE >= most {
                    return radiance;
                }
                throughput *= ROULETTE / most;
            }
            let before = direction;
            direction = match &met {
                Met::Matter => optics.phase.sample(direction, random),
                Met::Surface(surface) => cosine_direction(surface, random),
            };
            let mut next = Ray { origin: at, direction, t_min: 0.0, t_max: f32::INFINITY };
            let surface = self.solids.and_then(|it| it.meet(&mut next, met.node()));
            if medium.is_additive() {
                radiance += throughput * self.tracker.added(&next);
            }
            let flown = self.tracker.next(self.settings.free_path, &next, &mut throughput, stream);
            (at, met) = match (flown, surface) {
                (Some(distance), _) => (at + distance * direction, Met::Matter),
                (None, Some(surface)) => (surface.position, Met::Surface(surface)),
                // Leaves: sees what of the sky it has not looked at.
                (None, None) => {
                    let density = met.share(medium, before, direction);
                    return radiance + throughput * self.lights.left_over(direction, density);
                }
            };
            scatterings += 1;
            random = [stream.unit(), stream.unit()];
        }
    }

    /// Light that arrives at a point from the lights that can be looked at, times the share that goes against `direction`.
    fn direct(&self, seen: f32, met: &Met, at: Vec3, direction: Vec3, stream: &mut Stream) -> Vec3 {
        let share = |toward: Vec3| met.share(self.tracker.medium(), direction, toward);
        self.lights.direct(at, seen, share, |ray, stream| self.arriving(ray, met, stream), stream)
    }

    /// How much comes along a shadow ray from what was met.
    fn arriving(&self, ray: &Ray, met: &Met, stream: &mut Stream) -> Vec3 {
        match self.solids {
            Some(solids) if solids.block(ray, met.node()) => Vec3::ZERO,
            _ => self.tracker.ratio_transmittance(ray, stream),
        }
    }
}

impl Gathering for Reference<'_> {
    fn film(&mut self) -> &mut Film {
        &mut self.film
    }

    fn add(&mut self, progress: &dyn Progress) -> Result<()> {
        self.pass(1, progress)
    }
}

/// What a path met.
enum Met {
    Matter,
    Surface(Surface),
}

impl Met {
    /// The share of light from `toward` that goes against `direction`: per solid angle, the density with which a path goes there.
    fn share(&self, medium: &Medium, direction: Vec3, toward: Vec3) -> f32 {
        match self {
            Self::Matter => medium.optics().phase.evaluate(direction.dot(toward)),
            Self::Surface(surface) => thrown(surface, toward),
        }
    }

    /// The node of a surface, which rays from it do not meet.
    fn node(&self) -> Option<u32> {
        match self {
            Self::Matter => None,
            Self::Surface(surface) => Some(surface.node),
        }
    }
}

#[cfg(test)]
mod tests;
