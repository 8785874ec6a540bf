//! The march: along each ray front to back through the bricks that hold something, light taken from the cache.
//!
//! Takes a medium, the light in it and a view; adds samples to every pixel in passes. A ray is cut into steps of one length; in
//! each, extinction and light are those of one point, and the light scattered from it is integrated exactly. Where on the first
//! step the points lie is drawn for each sample (one sample alone takes the middle), so that steps leave noise and no bands.
//! Invariant: the same seed gives the same bits for any number of threads.

use fearless_simd::{Level, Simd, dispatch};
use fearless_simd_macros::simd;
use glam::Vec3;
use rayon::prelude::*;

use super::brute::BruteForce;
use super::cache::{Cache, Toward};
use super::walk::{Brick, Path};
use crate::error::{Error, Result};
use crate::math::Ray;
use crate::medium::light::Environment;
use crate::medium::{Light, Medium, Noise};
use crate::progress::Progress;
use crate::random::Stream;
use crate::render::sampling::{Dimension, point};
use crate::scene::camera::View;

/// The knobs of a marched picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Pixels in a row; 1 to 65536.
    pub width: u32,
    /// Rows; 1 to 65536.
    pub height: u32,
    /// Samples a pixel; with one, it is the pixel's center. At least 1.
    pub samples: u32,
    /// Another seed gives other random numbers.
    pub seed: u32,
    /// Length of a step in spacings of the density; above 0.
    pub step: f32,
}

impl Default for Settings {
    fn default() -> Self {
        Self { width: 1920, height: 1080, samples: 4, seed: 0, step: 2.0 }
    }
}

/// A pixel of a marched picture: means over its samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pixel {
    /// RGB radiance that the medium scatters to the camera.
    pub scattered: Vec3,
    /// RGB radiance of the environment lights that comes through the medium.
    pub environment: Vec3,
    /// RGB share of what is behind the medium that comes through.
    pub transmittance: Vec3,
    /// Distance from the eye (orthographic: from the plane through it) at which light is scattered or absorbed, on average;
    /// infinite where none is.
    pub depth: f32,
}

/// Where the march takes light from.
#[derive(Clone, Copy)]
pub enum Illumination<'a> {
    /// The cache.
    Cached(&'a Cache),
    /// Lights and photons, at every point anew.
    BruteForce(&'a BruteForce<'a>),
}

/// A picture in the making.
pub struct March<'a> {
    medium: &'a Medium,
    light: Illumination<'a>,
    skies: Vec<&'a Environment>,
    noise: Option<&'a Noise>,
    view: View,
    settings: Settings,
    sums: Vec<Sums>,
    samples_done: u32,
}

/// What the samples of a pixel add up to.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    scattered: Vec3,
    environment: Vec3,
    transmittance: Vec3,
    /// Distances times what is lost there, and what is lost.
    depth: f32,
    lost: f32,
}

/// Rays end where less than this comes through.
const DARK: f32 = 1e-3;

impl<'a> March<'a> {
    /// A picture without samples yet. Fails with [`Error::Setting`] if a knob is out of range.
    pub fn new(
        medium: &'a Medium,
        light: Illumination<'a>,
        lights: &'a [Light],
        view: View,
        settings: Settings,
    ) -> Result<Self> {
        let Settings { width, height, samples, step, .. } = settings;
        if !(1..=65536).contains(&width) || !(1..=65536).contains(&height) {
            return Err(Error::setting("size", format!("{width}x{height}"), "1x1 to 65536x65536 pixels"));
        }
        if samples == 0 {
            return Err(Error::setting("samples", samples, "at least 1 a pixel"));
        }
        if !(1e-3..1e3).contains(&step) {
            return Err(Error::setting("step", step, "0.001 to 1000 spacings of the density"));
        }
        let skies = lights.iter().filter_map(|light| match light {
            Light::Environment(sky) => Some(sky),
            _ => None,
        });
        let skies = skies.collect();
        let sums = vec![Sums::default(); width as usize * height as usize];
        Ok(Self { medium, light, skies, noise: None, view, settings, sums, samples_done: 0 })
    }

    /// The same with the medium dispersed by noise.
    pub fn with_noise(self, noise: &'a Noise) -> Self {
        Self { noise: Some(noise), ..self }
    }

    /// Whether every pixel has all its samples.
    pub fn is_done(&self) -> bool {
        self.samples_done >= self.settings.samples
    }

    /// Adds a sample to every pixel; reports `width * height` to `progress`. Fails only when interrupted; the picture is then
    /// incomplete.
    pub fn pass(&mut self, progress: &dyn Progress) -> Result<()> {
        let mut sums = std::mem::take(&mut self.sums);
        let width = self.settings.width as usize;
        let level = Level::new();
        sums.par_chunks_mut(width).enumerate().for_each(|(row, sums)| {
            if progress.cancelled() {
                return;
            }
            dispatch!(level, simd => sample_row(simd, self, row as u32, sums));
            progress.advance(width as u64);
        });
        self.sums = sums;
        self.samples_done += 1;
        if progress.cancelled() { Err(Error::Interrupted) } else { Ok(()) }
    }

    /// The means so far, row by row from the top left.
    pub fn pixels(&self) -> Vec<Pixel> {
        let scale = 1.0 / self.samples_done.max(1) as f32;
        let pixel = |sums: &Sums| Pixel {
            scattered: scale * sums.scattered,
            environment: scale * sums.environment,
            transmittance: scale * sums.transmittance,
            depth: if sums.lost > 0.0 { sums.depth / sums.lost } else { f32::INFINITY },
        };
        self.sums.iter().map(pixel).collect()
    }

    /// Adds a sample to a pixel.
    #[inline(always)]
    fn sample(&self, column: u32, row: u32, sums: &mut Sums) {
        let Settings { width, samples, seed, .. } = self.settings;
        let (number, sample) = (row * width + column, self.samples_done);
        let at = |dimension| if samples == 1 { [0.5; 2] } else { point(seed, dimension, number, sample) };
        let [x, y] = at(Dimension::Pixel);
        let ray = self.view.ray(column as f32 + x, row as f32 + y);
        let [start, _] = at(Dimension::Key);

        let stream = Stream::new(u64::from(seed), u64::from(number) << 32 | u64::from(sample));
        let source = match self.light {
            Illumination::Cached(cache) => Source::Cached(cache, cache.toward(ray.direction)),
            Illumination::BruteForce(brute) => Source::BruteForce(brute, ray.direction, stream),
        };
        let mut walk = Walk { transmittance: Vec3::ONE, source, sums };
        match self.noise {
            None => self.march(&ray, start, &mut walk),
            Some(noise) => self.march_dispersed(noise, &ray, start, &mut walk),
        }
        let Walk { transmittance, sums, .. } = walk;
        let behind: Vec3 = self.skies.iter().map(|sky| sky.radiance(ray.direction)).sum();
        sums.environment += transmittance * behind;
        sums.transmittance += transmittance;
    }

    /// Through the bricks that are not empty.
    #[inline(always)]
    fn march(&self, ray: &Ray, start: f32, walk: &mut Walk) {
        let Some(path) = Path::new(self.medium, ray) else { return };
        let grid = self.medium.density();
        let extinction = Vec3::from(self.medium.optics().extinction);
        let step = self.settings.step * grid.spacing();
        for piece in path.bricks(grid) {
            let at = piece.brick();
            if grid.brick_range(at).max == 0.0 {
                continue;
            }
            let brick = Brick::new(grid, at);
            let mut number = (piece.from / step - start).ceil().max(0.0);
            loop {
                let distance = (number + start) * step;
                if distance >= piece.to {
                    break;
                }
                number += 1.0;
                let density = brick.density(path.at(distance));
                if density > 0.0 {
                    let t = path.enter + distance;
                    walk.step(step * density * extinction, t, ray.origin + t * ray.direction);
                    if walk.is_dark() {
                        return;
                    }
                }
            }
        }
    }

    /// Through all that noise may fill.
    fn march_dispersed(&self, noise: &Noise, ray: &Ray, start: f32, walk: &mut Walk) {
        let bounds = self.medium.bounds().grown(noise.reach());
        let Some([enter, leave]) = bounds.clip(ray) else { return };
        let grid = self.medium.density();
        let extinction = Vec3::from(self.medium.optics().extinction);
        let step = self.settings.step * grid.spacing();
        let mut t = enter + start * step;
        while t < leave && !walk.is_dark() {
            let (at, factor) = noise.disperse(ray.origin + t * ray.direction);
            let density = factor * grid.density(at);
            if density > 0.0 {
                walk.step(step * density * extinction, t, at);
            }
            t += step;
        }
    }
}

/// Adds a sample to each pixel of a row: nothing in it is on lanes, but all of it is compiled for the machine at hand.
#[simd]
fn sample_row<S: Simd>(simd: S, march: &March, row: u32, sums: &mut [Sums]) {
    let _ = simd;
    for (column, sum) in sums.iter_mut().enumerate() {
        march.sample(column as u32, row, sum);
    }
}

/// Where the light of one ray comes from.
enum Source<'a> {
    Cached(&'a Cache, Toward),
    BruteForce(&'a BruteForce<'a>, Vec3, Stream),
}

/// What a ray has gathered.
struct Walk<'a> {
    transmittance: Vec3,
    source: Source<'a>,
    sums: &'a mut Sums,
}

impl Walk<'_> {
    /// One step of that optical thickness, at the distance `t`, with light as it is `at` a point.
    #[inline(always)]
    fn step(&mut self, thickness: Vec3, t: f32, at: Vec3) {
        let is_grey = thickness.x == thickness.y && thickness.y == thickness.z;
        let through = match is_grey {
            true => Vec3::splat((-thickness.x).exp()),
            false => Vec3::new((-thickness.x).exp(), (-thickness.y).exp(), (-thickness.z).exp()),
        };
        let lost = self.transmittance * (1.0 - through);
        self.sums.scattered += lost
            * match &mut self.source {
                Source::Cached(cache, toward) => cache.scattered(at, toward),
                Source::BruteForce(brute, direction, stream) => brute.scattered(at, *direction, stream),
            };
        let lost = lost.element_sum();
        self.sums.depth += lost * t;
        self.sums.lost += lost;
        self.transmittance *= through;
    }

    #[inline(always)]
    fn is_dark(&self) -> bool {
        self.transmittance.max_element() < DARK
    }
}
