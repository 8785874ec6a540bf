//! Lamps that stand in the medium, found by paths from them to the eye.
//!
//! Few paths from the eye come near a lamp, and each that does is a firefly: there the light is thousands of times what the picture
//! shows. Paths from the lamp begin where it is bright, and each place where matter scatters them is seen from the eye; but few are
//! where the eye is near. Light that is first scattered at x and last, before the eye, at y, is found from both ends, and weighed by how
//! many paths of either kind come to x and y, per volume and without regard to what is on their way (the balance heuristic). Surfaces
//! that the eye sees first are left to its own paths. Invariant: for each path the weights of both ways add up to 1.
//!
//! Source: light tracing, as a strategy of bidirectional path tracing: E. Lafortune, Y. Willems, "Rendering participating media with
//! bidirectional path tracing", EGWR 1996; E. Veach, "Robust Monte Carlo methods for light transport simulation", 1997.

use glam::Vec3;
use rayon::prelude::*;

use super::{Met, PATHS, Reference};
use crate::math::{Bounds, Ray};
use crate::medium::light::Emission;
use crate::medium::{Light, Medium};
use crate::progress::Progress;
use crate::random::Stream;
use crate::render::medium::regular::Crossing;
use crate::render::medium::solids::cosine_direction;

/// Paths that one thread follows at a time.
const CHUNK: u32 = 4096;
/// Paths whose light is kept before it is added up.
const AT_ONCE: u32 = 64 * CHUNK;
/// Lamps up to so far from the medium's box have paths, of its diagonal: few paths of others would meet it.
const NEXT: f32 = 0.1;

/// Lamps in a medium.
pub(super) struct Lamps<'a> {
    /// Each with the share of paths that start at it or at one before it.
    lamps: Vec<(&'a Light, f32)>,
    bounds: Bounds,
    /// Paths of a sample of the picture.
    count: u32,
}

/// Light that the eye sees in a pixel.
struct Splat {
    pixel: usize,
    radiance: Vec3,
}

impl<'a> Lamps<'a> {
    /// So many paths a sample from those of `lights` that stand in `medium` or next to it; `None` if they give no light.
    pub(super) fn new(lights: &'a [Light], medium: &Medium, count: u32) -> Option<Self> {
        let bounds = medium.bounds();
        let near = bounds.grown(NEXT * bounds.extent().length());
        let mut total = 0.0;
        let inside = lights.iter().filter(|light| light.position().is_some_and(|at| near.contains(at)));
        let mut lamps: Vec<_> = inside
            .map(|light| {
                total += light.power(&bounds).element_sum();
                (light, total)
            })
            .collect();
        lamps.iter_mut().for_each(|(_, sum)| *sum /= total);
        (total > 0.0).then_some(Self { lamps, bounds, count })
    }

    /// Paths that start at one of the lights, per steradian.
    pub(super) fn per_steradian(&self, light: &Light) -> f32 {
        let place = self.lamps.iter().position(|(lamp, _)| std::ptr::eq(*lamp, light));
        place.map_or(0.0, |place| self.share(place) * self.count as f32 / light.solid_angle())
    }

    /// The share of paths that start at a lamp.
    fn share(&self, place: usize) -> f32 {
        let before = if place == 0 { 0.0 } else { self.lamps[place - 1].1 };
        self.lamps[place].1 - before
    }

    /// The start of a path, and how many start like it per steradian.
    fn emit(&self, number: u32, stream: &mut Stream) -> (Emission, f32) {
        let along = (number as f32 + stream.unit()) / self.count as f32;
        let place = self.lamps.partition_point(|(_, sum)| *sum <= along).min(self.lamps.len() - 1);
        let light = self.lamps[place].0;
        let mut emission = light.emit(&self.bounds, std::array::from_fn(|_| stream.unit()));
        let count = self.share(place) * self.count as f32;
        emission.power /= count;
        (emission, count / light.solid_angle())
    }
}

impl Reference<'_> {
    /// Paths of the eye of a sample per volume that first meet something at a place: see the module.
    pub(super) fn seen_paths(&self, met: &Met, at: Vec3) -> f32 {
        match met {
            Met::Matter => PATHS as f32 / self.view.pixel_area(at),
            Met::Surface(_) => f32::INFINITY,
        }
    }

    /// Adds what a sample of the picture sees of the lamps in the medium.
    pub(super) fn add_lamps(&mut self, sample: u32, progress: &dyn Progress) {
        let Some(lamps) = &self.lamps else { return };
        for first in (0..lamps.count).step_by(AT_ONCE as usize) {
            let starts: Vec<u32> =
                (first..lamps.count.min(first.saturating_add(AT_ONCE))).step_by(CHUNK as usize).collect();
            let splats: Vec<Vec<Splat>> = starts
                .into_par_iter()
                .map(|start| {
                    let mut splats = Vec::new();
                    let mut crossing = Crossing::default();
                    let numbers =
                        if progress.cancelled() { 0..0 } else { start..lamps.count.min(start + CHUNK) };
                    for number in numbers {
                        let seed = u64::from(self.settings.seed) | 1 << 32;
                        let mut stream = Stream::new(seed, u64::from(number) << 32 | u64::from(sample));
                        self.follow(lamps.emit(number, &mut stream), &mut crossing, &mut stream, &mut splats);
                    }
                    splats
                })
                .collect();
            for Splat { pixel, radiance } in splats.into_iter().flatten() {
                self.film.sums[pixel].scattered += radiance;
            }
        }
    }

    /// Follows a path from a lamp, and looks from the eye at each place where it scatters.
    fn follow(
        &self,
        (emission, paths): (Emission, f32),
        crossing: &mut Crossing,
        stream: &mut Stream,
        splats: &mut Vec<Splat>,
    ) {
        let optics = self.tracker.medium().optics();
        let Emission { mut origin, mut direction, mut power } = emission;
        let mut met = Met::Matter;
        let mut lit_paths = 0.0;
        for scatterings in 1.. {
            if power == Vec3::ZERO || self.settings.orders.is_some_and(|orders| scatterings > orders) {
                return;
            }
            let mut ray = Ray { origin, direction, t_min: 0.0, t_max: f32::INFINITY };
            let surface = self.solids.and_then(|solids| solids.meet(&mut ray, met.node()));
            let flown = if scatterings == 1 && surface.is_none() {
                // Nothing is behind the matter: the path scatters in it, and its weight says how likely that was.
                self.tracker.cross(&ray, crossing);
                if self.tracker.through(crossing.column) == Vec3::ONE {
                    return;
                }
                let (distance, weight) = self.tracker.forced(crossing, [stream.unit(), stream.unit()]);
                power *= weight;
                Some(distance)
            } else {
                self.tracker.next(self.settings.free_path, &ray, &mut power, stream)
            };
            let color;
            (origin, color, met) = match (flown, surface) {
                (Some(distance), _) => {
                    (origin + distance * direction, Vec3::from(optics.albedo), Met::Matter)
                }
                (None, Some(surface)) => (surface.position, surface.color, Met::Surface(surface)),
                (None, None) => return,
            };
            if scatterings == 1 {
                lit_paths = paths / origin.distance_squared(emission.origin);
            }
            let scattered = power * color;
            splats.extend(self.seen(&met, origin, direction, scattered, lit_paths, stream));
            // Russian roulette by the share that is left: power stays as it is where the color is grey.
            let survival = scattered.max_element() / power.max_element();
            if stream.unit() >= survival {
                return;
            }
            power = scattered / survival;
            let random = [stream.unit(), stream.unit()];
            direction = match &met {
                Met::Matter => optics.phase.sample(direction, random),
                Met::Surface(surface) => cosine_direction(surface, random),
            };
        }
    }

    /// What the eye sees of `power` that came along a direction and is scattered at a place; `lit_paths` per volume met something where this one first did.
    fn seen(
        &self,
        met: &Met,
        at: Vec3,
        direction: Vec3,
        power: Vec3,
        lit_paths: f32,
        stream: &mut Stream,
    ) -> Option<Splat> {
        let [column, row] = self.view.pixel_of(at)?.map(f32::floor);
        let height = self.film.sums.len() as u32 / self.settings.width;
        if !(column >= 0.0 && row >= 0.0 && column < self.settings.width as f32 && row < height as f32) {
            return None;
        }
        let [column, row] = [column as u32, row as u32];
        if !self.film.wants(column, row) {
            return None;
        }
        let toward = -self.view.toward(at);
        let share = met.share(self.tracker.medium(), direction, toward);
        let offset = self.view.eye - at;
        let distance = if self.view.perspective { offset.length() } else { offset.dot(toward) };
        let ray = Ray { origin: at, direction: toward, t_min: 0.0, t_max: distance };
        let weight = 1.0 / (1.0 + self.seen_paths(met, at) / lit_paths);
        if weight * share <= 0.0 {
            return None;
        }
        let radiance = power * (weight * share / self.view.pixel_area(at)) * self.arriving(&ray, met, stream);
        let pixel = row as usize * self.settings.width as usize + column as usize;
        (radiance != Vec3::ZERO).then_some(Splat { pixel, radiance })
    }
}
