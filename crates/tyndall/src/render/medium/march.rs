//! The march: along each ray front to back through the bricks that hold something, light taken from the cache.
//!
//! Takes a medium, the light in it and a view; adds samples to every pixel in passes. A ray is cut into steps of one length; in
//! each, extinction and light are those of one point, and the light that comes from it is integrated exactly. Where on the first
//! step the points lie is drawn for each sample (one sample alone takes the middle), so that steps leave noise and no bands.
//! Invariant: the same seed gives the same bits for any number of threads.

use std::borrow::Cow;

use fearless_simd::{Level, Simd, dispatch};
use fearless_simd_macros::simd;
use glam::{Vec3, Vec3A};
use rayon::prelude::*;

use super::brute::BruteForce;
use super::cache::{Cache, Lit};
use super::lit::{LitBricks, Spectrum};
use super::packet::{self, Gathered, Matter, Paths};
use super::space::Space;
use super::walk::Path;
use crate::error::{Error, Result};
use crate::math::{Bounds, Ray};
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
    /// RGB radiance that the medium scatters and emits to the camera.
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
    light: Source<'a>,
    skies: Vec<&'a Environment>,
    noise: Option<&'a Noise>,
    /// Where the medium may be, with its noise.
    bounds: Bounds,
    space: Space,
    view: View,
    settings: Settings,
    sums: Vec<Sums>,
    samples_done: u32,
}

/// Where light comes from.
enum Source<'a> {
    /// The cache, and what of it the eye sees.
    Cached(&'a Cache, Cow<'a, Lit>),
    BruteForce(&'a BruteForce<'a>),
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
pub(super) const DARK: f32 = 1e-3;
/// Pixels along an edge of a tile.
const TILE: usize = packet::RAYS;

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
        let light = match light {
            Illumination::Cached(cache) => Source::Cached(cache, cache.seen(medium, &view)),
            Illumination::BruteForce(brute) => Source::BruteForce(brute),
        };
        Ok(Self {
            medium,
            light,
            skies: skies.collect(),
            noise: None,
            bounds: medium.bounds(),
            space: Space::of(medium.density()),
            view,
            settings,
            sums: vec![Sums::default(); width as usize * height as usize],
            samples_done: 0,
        })
    }

    /// The same with the medium dispersed by noise.
    pub fn with_noise(self, noise: &'a Noise) -> Self {
        let grid = self.medium.density();
        let bounds = self.medium.bounds().grown(noise.reach());
        let space = Space::reached(grid, noise.reach() / grid.spacing());
        Self { noise: Some(noise), bounds, space, ..self }
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
        sums.par_chunks_mut(width * TILE).enumerate().for_each(|(band, sums)| {
            if progress.cancelled() {
                return;
            }
            dispatch!(level, simd => sample_band(simd, self, (band * TILE) as u32, sums));
            progress.advance(sums.len() as u64);
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

    /// Length of a step.
    #[inline(always)]
    fn step(&self) -> f32 {
        self.settings.step * self.medium.density().spacing()
    }

    /// The ray of a pixel's next sample, and where on a step its points lie.
    #[inline(always)]
    fn ray(&self, column: u32, row: u32) -> (Ray, f32) {
        let Settings { width, samples, seed, .. } = self.settings;
        let (number, sample) = (row * width + column, self.samples_done);
        let at = |dimension| if samples == 1 { [0.5; 2] } else { point(seed, dimension, number, sample) };
        let [x, y] = at(Dimension::Pixel);
        let [start, _] = at(Dimension::Key);
        (self.view.ray(column as f32 + x, row as f32 + y), start)
    }

    /// Adds a sample to a pixel.
    #[inline(always)]
    fn sample(&self, column: u32, row: u32, sums: &mut Sums) {
        let Settings { width, seed, .. } = self.settings;
        let (ray, start) = self.ray(column, row);
        let through = match &self.light {
            Source::Cached(cache, lit) => match &**lit {
                Lit::Grey(bricks, hue) => {
                    let walk = self.cached(&ray, start, self.walk(hue.channel), (cache, bricks));
                    walk.add_to(sums, hue.color)
                }
                Lit::Colored(bricks) => {
                    self.cached(&ray, start, self.walk(0), (cache, bricks)).add_to(sums, Vec3::ONE)
                }
            },
            Source::BruteForce(brute) => {
                let number = row * width + column;
                let stream =
                    Stream::new(u64::from(seed), u64::from(number) << 32 | u64::from(self.samples_done));
                self.brute(&ray, start, brute, stream).add_to(sums, Vec3::ONE)
            }
        };
        self.add_behind(ray.direction, through, sums);
    }

    /// Adds what comes through from behind the medium.
    #[inline(always)]
    fn add_behind(&self, direction: Vec3, through: Vec3, sums: &mut Sums) {
        let behind: Vec3 = self.skies.iter().map(|sky| sky.radiance(direction)).sum();
        sums.environment += through * behind;
        sums.transmittance += through;
    }

    /// What can be marched in packets, if that is all: light from the cache, without noise.
    #[inline(always)]
    fn packets(&self) -> Option<&Lit> {
        match &self.light {
            Source::Cached(cache, lit) if self.noise.is_none() && !cache.has_near() => Some(lit),
            _ => None,
        }
    }

    /// Adds a sample to each of at most sixteen pixels side by side.
    #[inline(always)]
    fn sample_packet<S: Simd>(&self, simd: S, lit: &Lit, column: u32, row: u32, sums: &mut [Sums]) {
        let mut paths = Paths::new();
        let mut directions = [Vec3::ZERO; packet::RAYS];
        for (lane, direction) in directions.iter_mut().enumerate().take(sums.len()) {
            let (ray, start) = self.ray(column + lane as u32, row);
            *direction = ray.direction;
            if let Some(path) = Path::within(&self.bounds, self.medium.density(), &ray) {
                paths.set(lane, &path, start);
            }
        }
        let extinction = Vec3::from(self.medium.optics().extinction) * self.step();
        let additive = self.medium.is_additive();
        match lit {
            Lit::Grey(bricks, hue) => {
                let matter = Matter { extinction: [extinction[hue.channel]], additive };
                let found = packet::march::<_, _, 1, 2>(simd, &paths, bricks, self.step(), &matter);
                self.add_packet(&found, hue.color, &directions, sums);
            }
            Lit::Colored(bricks) => {
                let matter = Matter { extinction: extinction.to_array(), additive };
                let found = packet::march::<_, _, 3, 4>(simd, &paths, bricks, self.step(), &matter);
                self.add_packet(&found, Vec3::ONE, &directions, sums);
            }
        }
    }

    /// Adds what a packet gathered, light in units of `color`, and what comes through.
    #[inline(always)]
    fn add_packet<const C: usize>(
        &self,
        found: &Gathered<C>,
        color: Vec3,
        directions: &[Vec3],
        sums: &mut [Sums],
    ) {
        for (lane, (sums, &direction)) in sums.iter_mut().zip(directions).enumerate() {
            sums.scattered += packet::rgb(&found.scattered, lane) * color;
            sums.depth += found.depth[lane];
            sums.lost += found.lost[lane];
            self.add_behind(direction, packet::rgb(&found.transmittance, lane), sums);
        }
    }

    /// Along a ray with light from the cache.
    #[inline(always)]
    fn cached<L: Spectrum>(
        &self,
        ray: &Ray,
        start: f32,
        mut walk: Walk<L>,
        (cache, bricks): (&Cache, &LitBricks<L>),
    ) -> Walk<L> {
        let grid = self.medium.density();
        let extinction = L::of(Vec3::from(self.medium.optics().extinction), walk.channel) * self.step();
        let Some(mut crossing) = self.crossing(ray, start) else { return walk };
        while let Some((distance, brick)) = crossing.next(&self.space) {
            let t = crossing.path.enter + distance;
            let (density, light, at) = match self.noise {
                None => {
                    let (density, light) = bricks.look_up(brick, crossing.path.at(distance));
                    (density, light, ray.origin + t * ray.direction)
                }
                Some(noise) => {
                    let (at, factor) = noise.disperse(ray.origin + t * ray.direction);
                    let (density, light) = bricks.at(Vec3A::from((at - grid.origin()) / grid.spacing()));
                    (factor * density, light, at)
                }
            };
            if density > 0.0 {
                let light = match cache.has_near() {
                    false => light,
                    true => light + L::of(cache.near(at, ray.direction), walk.channel),
                };
                walk.step(extinction * density, light, t);
                if walk.is_dark() {
                    break;
                }
            }
        }
        walk
    }

    /// Along a ray with light that is found at every step.
    fn brute(&self, ray: &Ray, start: f32, brute: &BruteForce, mut stream: Stream) -> Walk<Vec3> {
        let mut walk = self.walk(0);
        let extinction = Vec3::from(self.medium.optics().extinction) * self.step();
        let Some(mut crossing) = self.crossing(ray, start) else { return walk };
        while let Some((distance, _)) = crossing.next(&self.space) {
            let t = crossing.path.enter + distance;
            let at = ray.origin + t * ray.direction;
            let (at, factor) = self.noise.map_or((at, 1.0), |noise| noise.disperse(at));
            let density = factor * self.medium.density().density(at);
            if density > 0.0 {
                walk.step(extinction * density, brute.scattered(at, ray.direction, &mut stream), t);
                if walk.is_dark() {
                    break;
                }
            }
        }
        walk
    }

    /// Nothing gathered yet; `channel` stands for all where there is one color.
    #[inline(always)]
    fn walk<L: Spectrum>(&self, channel: usize) -> Walk<L> {
        Walk {
            channel,
            additive: self.medium.is_additive(),
            transmittance: L::splat(1.0),
            scattered: L::splat(0.0),
            depth: 0.0,
            lost: 0.0,
        }
    }

    /// The steps along a ray; `None` if it misses the medium.
    #[inline(always)]
    fn crossing(&self, ray: &Ray, start: f32) -> Option<Crossing> {
        let path = Path::within(&self.bounds, self.medium.density(), ray)?;
        Some(Crossing { path, step: self.step(), start, number: 0.0 })
    }
}

#[cfg(test)]
impl March<'_> {
    /// What [`March::pass`] does, a ray at a time.
    pub(super) fn pass_by_rays(&mut self) {
        let mut sums = std::mem::take(&mut self.sums);
        for (number, sums) in (0..).zip(&mut sums) {
            self.sample(number % self.settings.width, number / self.settings.width, sums);
        }
        self.sums = sums;
        self.samples_done += 1;
    }
}

/// The steps along a path that are not known to be empty.
struct Crossing {
    path: Path,
    step: f32,
    /// Where on a step its point lies.
    start: f32,
    /// Steps that are done or crossed.
    number: f32,
}

impl Crossing {
    /// The next step: its distance along the path, and the number of its brick.
    #[inline(always)]
    fn next(&mut self, space: &Space) -> Option<(f32, usize)> {
        loop {
            let distance = (self.number + self.start) * self.step;
            if distance >= self.path.length {
                return None;
            }
            self.number += 1.0;
            let place = self.path.at(distance);
            match space.entry(place) {
                Ok(brick) => return Some((distance, brick)),
                Err(away) => {
                    let end = space.leave(&self.path, place, away);
                    self.number = self.number.max((end / self.step - self.start).ceil());
                }
            }
        }
    }
}

/// Adds a sample to each pixel of a band of rows, tile by tile: the bricks that a tile's rays meet stay in the processor's cache,
/// those of a whole row do not. All of it is compiled for the machine at hand, on lanes or not.
#[simd]
fn sample_band<S: Simd>(simd: S, march: &March, first: u32, sums: &mut [Sums]) {
    let width = march.settings.width as usize;
    for left in (0..width).step_by(TILE) {
        for (row, sums) in (first..).zip(sums.chunks_exact_mut(width)) {
            let end = (left + TILE).min(width);
            match march.packets() {
                Some(lit) => march.sample_packet(simd, lit, left as u32, row, &mut sums[left..end]),
                None => {
                    for (column, sum) in (left as u32..).zip(&mut sums[left..end]) {
                        march.sample(column, row, sum);
                    }
                }
            }
        }
    }
}

/// What a ray has gathered.
struct Walk<L> {
    /// The channel that stands for all where there is one color.
    channel: usize,
    /// Whether nothing is absorbed.
    additive: bool,
    transmittance: L,
    scattered: L,
    depth: f32,
    lost: f32,
}

impl<L: Spectrum> Walk<L> {
    /// One step of that optical thickness and light, at the distance `t`.
    #[inline(always)]
    fn step(&mut self, thickness: L, light: L, t: f32) {
        let mut lost = thickness;
        if !self.additive {
            let through = self.transmittance * thickness.exp_minus();
            lost = self.transmittance + through * -1.0;
            self.transmittance = through;
        }
        self.scattered = self.scattered + lost * light;
        let lost = lost.sum();
        self.depth += lost * t;
        self.lost += lost;
    }

    #[inline(always)]
    fn is_dark(&self) -> bool {
        self.transmittance.most() < DARK
    }

    /// Adds what it gathered to a pixel, light in units of `color`. Gives what comes through.
    #[inline(always)]
    fn add_to(self, sums: &mut Sums, color: Vec3) -> Vec3 {
        sums.scattered += self.scattered.times(color);
        sums.depth += self.depth;
        sums.lost += self.lost;
        self.transmittance.times(Vec3::ONE)
    }
}
