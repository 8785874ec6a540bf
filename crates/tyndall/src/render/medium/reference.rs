//! The reference: a path tracer for media without bias, by which every approximation is judged.
//!
//! Takes a medium, its lights and a view; adds samples to every pixel in passes. Along the camera's ray the column is integrated
//! exactly, so that what comes through has no noise, and first scatterings are drawn from the part that does not come through.
//! From there null collisions find the next scattering; at each one, the lights without extent are looked at through an
//! estimated transmittance, and an image of the sky both by its own and by the phase function's directions; what matter emits is
//! added where a path meets it. There is no limit of orders: paths end by Russian roulette. Invariant: with a right free path and all orders the expected value of every pixel is its radiance;
//! the same seed gives the same bits for any number of threads.
//!
//! Sources: J. Novak, I. Georgiev, J. Hanika, W. Jarosz, "Monte Carlo methods for volumetric light transport simulation",
//! Eurographics STAR 2018; B. Miller, I. Georgiev, W. Jarosz, "A null-scattering path integral formulation of light transport",
//! SIGGRAPH 2019.

use glam::Vec3;
use rayon::prelude::*;

use super::free_path::{FreePath, Tracker};
use super::regular::Crossing;
use crate::error::{Error, Result};
use crate::math::Ray;
use crate::medium::light::Environment;
use crate::medium::{Light, Medium};
use crate::progress::Progress;
use crate::random::Stream;
use crate::render::sampling::{Dimension, point, shuffled_point};
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

/// A pixel of a reference picture: means over its samples, RGB.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pixel {
    /// Radiance that the medium scatters and emits to the camera.
    pub scattered: Vec3,
    /// Radiance of the environment lights that comes through the medium.
    pub environment: Vec3,
    /// Share of what is behind the medium that comes through.
    pub transmittance: Vec3,
}

/// A reference picture in the making.
pub struct Reference<'a> {
    tracker: Tracker<'a>,
    lights: Lights<'a>,
    view: View,
    settings: Settings,
    sums: Vec<Pixel>,
    samples_done: u32,
}

/// The lights by how they are looked at.
struct Lights<'a> {
    /// Those without extent: by a shadow ray.
    sharp: Vec<&'a Light>,
    /// The sum of all constant environments: by paths that leave.
    constant: Vec3,
    /// By both.
    images: Vec<(&'a Light, &'a Environment)>,
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
        let sums = vec![Pixel::default(); width as usize * height as usize];
        let lights = Lights::new(lights);
        Ok(Self { tracker: Tracker::new(medium), lights, view, settings, sums, samples_done: 0 })
    }

    /// Adds `samples` to every pixel; reports `width * height * samples` to `progress`. Fails only when interrupted; the
    /// picture is then incomplete.
    pub fn pass(&mut self, samples: u32, progress: &dyn Progress) -> Result<()> {
        let mut sums = std::mem::take(&mut self.sums);
        let width = self.settings.width as usize;
        sums.par_chunks_mut(width).enumerate().for_each(|(row, sums)| {
            if progress.cancelled() {
                return;
            }
            let mut crossing = Crossing::default();
            for (column, sum) in sums.iter_mut().enumerate() {
                for sample in self.samples_done..self.samples_done + samples {
                    let added = self.sample([column as u32, row as u32], sample, &mut crossing);
                    sum.scattered += added.scattered;
                    sum.environment += added.environment;
                    sum.transmittance += added.transmittance;
                }
            }
            progress.advance(u64::from(samples) * width as u64);
        });
        self.sums = sums;
        self.samples_done += samples;
        if progress.cancelled() { Err(Error::Interrupted) } else { Ok(()) }
    }

    /// Samples that every pixel has.
    pub fn samples_done(&self) -> u32 {
        self.samples_done
    }

    /// The means so far, row by row from the top left; zero without samples.
    pub fn pixels(&self) -> Vec<Pixel> {
        let scale = 1.0 / self.samples_done.max(1) as f32;
        let mean = |sum: &Pixel| Pixel {
            scattered: scale * sum.scattered,
            environment: scale * sum.environment,
            transmittance: scale * sum.transmittance,
        };
        self.sums.iter().map(mean).collect()
    }

    /// One sample of the pixel in a column and row.
    fn sample(&self, [column, row]: [u32; 2], sample: u32, crossing: &mut Crossing) -> Pixel {
        let seed = self.settings.seed;
        let number = row * self.settings.width + column;
        let [x, y] = point(seed, Dimension::Pixel, number, sample);
        let ray = self.view.ray(column as f32 + x, row as f32 + y);

        let behind = self.lights.seen(ray.direction);
        self.tracker.cross(&ray, crossing);
        let transmittance = self.tracker.through(crossing.column);
        let mut pixel = Pixel { scattered: Vec3::ZERO, environment: transmittance * behind, transmittance };
        if self.tracker.medium().is_additive() {
            pixel.scattered = self.tracker.added(&ray);
        }
        if transmittance == Vec3::ONE {
            return pixel;
        }
        for path in sample * PATHS..(sample + 1) * PATHS {
            let at = |dimension| shuffled_point(seed, dimension, number, path);
            let (distance, weight) = self.tracker.forced(crossing, at(Dimension::Key));
            let mut stream = Stream::new(u64::from(seed), u64::from(number) << 32 | u64::from(path));
            let start = Ray { origin: ray.origin + distance * ray.direction, ..ray };
            // The roulette must not end a path because little of the medium is in the way.
            let scale = weight.max_element();
            let radiance = self.path(start, weight / scale, at(Dimension::Sky), &mut stream);
            pixel.scattered += scale / PATHS as f32 * radiance;
        }
        pixel
    }

    /// The radiance of a path that first meets matter at the origin of `ray`, coming along its direction from the camera.
    fn path(&self, ray: Ray, weight: Vec3, random: [f32; 2], stream: &mut Stream) -> Vec3 {
        let medium = self.tracker.medium();
        let optics = medium.optics();
        let albedo = Vec3::from(optics.albedo);
        let (mut at, mut direction) = (ray.origin, ray.direction);
        let mut throughput = weight;
        let mut radiance = Vec3::ZERO;
        let mut random = random;
        let mut scatterings = 0;
        loop {
            radiance += throughput * medium.emitted(at);
            if self.settings.orders.is_some_and(|orders| scatterings >= orders) {
                return radiance;
            }
            throughput *= albedo;
            // Looks at the lights.
            radiance += throughput * self.direct(at, direction, stream);
            // Goes on in a direction of the phase function's, unless the dice end the path.
            let most = throughput.max_element();
            if most < ROULETTE {
                if stream.unit() * ROULETTE >= most {
                    return radiance;
                }
                throughput *= ROULETTE / most;
            }
            let before = direction;
            direction = optics.phase.sample(direction, random);
            let next = Ray { origin: at, direction, t_min: 0.0, t_max: f32::INFINITY };
            match self.tracker.next(self.settings.free_path, &next, &mut throughput, stream) {
                // Leaves: sees what of the sky it has not looked at.
                None => {
                    let density = optics.phase.evaluate(before.dot(direction));
                    return radiance + throughput * self.lights.left_over(direction, density);
                }
                Some(distance) => at += distance * direction,
            }
            scatterings += 1;
            random = [stream.unit(), stream.unit()];
        }
    }

    /// Light that arrives at a point from the lights that can be looked at, times the phase function toward `direction`.
    fn direct(&self, at: Vec3, direction: Vec3, stream: &mut Stream) -> Vec3 {
        let phase = self.tracker.medium().optics().phase;
        let mut radiance = Vec3::ZERO;
        let shadow =
            |toward: Vec3, distance: f32| Ray { origin: at, direction: toward, t_min: 0.0, t_max: distance };
        let scattered = |toward: Vec3| phase.evaluate(direction.dot(toward));
        // One of the lights without extent, in proportion to what it would bring through emptiness.
        let bring = |light: &Light| {
            let arrival = light.toward(at, [0.5; 2]);
            (arrival, scattered(arrival.toward) * arrival.light)
        };
        let chosen = match self.lights.sharp.as_slice() {
            [] => None,
            [light] => Some((bring(light), 1.0)),
            lights => choose(lights.iter().map(|light| bring(light).1.element_sum()), stream)
                .map(|(number, chance)| (bring(lights[number]), chance)),
        };
        if let Some(((arrival, brought), chance)) = chosen
            && brought != Vec3::ZERO
        {
            let ray = shadow(arrival.toward, arrival.distance);
            radiance += brought / chance * self.tracker.ratio_transmittance(&ray, stream);
        }
        for (light, environment) in &self.lights.images {
            let arrival = light.toward(at, [stream.unit(), stream.unit()]);
            let density = environment.density(arrival.toward);
            let share = scattered(arrival.toward);
            // The balance heuristic between the sky's directions and the phase function's.
            let weight = share * density / (density + share);
            let ray = shadow(arrival.toward, f32::INFINITY);
            radiance += weight * arrival.light * self.tracker.ratio_transmittance(&ray, stream);
        }
        radiance
    }
}

impl<'a> Lights<'a> {
    fn new(lights: &'a [Light]) -> Self {
        let mut sorted = Self { sharp: Vec::new(), constant: Vec3::ZERO, images: Vec::new() };
        for light in lights {
            match light {
                Light::Environment(sky) if sky.is_constant() => sorted.constant += sky.mean(),
                Light::Environment(sky) => sorted.images.push((light, sky)),
                Light::Directional(_) | Light::Point(_) | Light::Spot(_) => sorted.sharp.push(light),
            }
        }
        sorted
    }

    /// Radiance of the environment in a direction.
    fn seen(&self, toward: Vec3) -> Vec3 {
        self.images.iter().fold(self.constant, |sum, (_, sky)| sum + sky.radiance(toward))
    }

    /// What a path that leaves in a direction drawn with `density` adds to what looking at the images has found.
    fn left_over(&self, toward: Vec3, density: f32) -> Vec3 {
        let image = |sky: &Environment| density / (density + sky.density(toward)) * sky.radiance(toward);
        self.images.iter().fold(self.constant, |sum, (_, sky)| sum + image(sky))
    }
}

/// The number of one of `weights`, drawn in proportion, and its chance; `None` if all are 0.
fn choose(weights: impl Iterator<Item = f32> + Clone, stream: &mut Stream) -> Option<(usize, f32)> {
    let total: f32 = weights.clone().sum();
    let mut rest = stream.unit() * total;
    let mut last = None;
    for (number, weight) in weights.enumerate() {
        if weight > 0.0 {
            last = Some((number, weight / total));
            if rest < weight {
                break;
            }
        }
        rest -= weight;
    }
    last
}

#[cfg(test)]
mod tests;
