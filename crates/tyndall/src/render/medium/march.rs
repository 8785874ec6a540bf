//! The march: along each ray front to back through the bricks that hold something, light taken from the cache.
//!
//! Takes a medium, the light in it and a view; adds samples to every pixel in passes. A ray is cut into steps of one length, those around finer
//! bricks into 2, 4 or 8 as long as their spacing asks for; in each, extinction and light are those of one point, and the light that comes from it is integrated exactly. Where on the first
//! step the points lie is drawn for each sample (one sample alone takes the middle), so that steps leave noise and no bands.
//! Invariant: the same seed gives the same bits for any number of threads.

use std::borrow::Cow;

use fearless_simd::{Level, Simd, dispatch};
use fearless_simd_macros::simd;
use glam::{Vec3, Vec3A};
use rayon::prelude::*;

use super::brute::BruteForce;
use super::cache::{Cache, Lit};
pub use super::film::Pixel;
use super::film::{EDGE, Film, Sums};
use super::free_path::{FreePath, Tracker};
use super::lights::Lights;
use super::lit::{LitBricks, Spectrum};
use super::packet::{self, Gathered, Matter, Paths};
use super::refine::{Gathering, Goal, refine};
use super::solids::{Solids, cosine_direction, thrown};
use super::space::Space;
use super::walk::Path;
use crate::error::{Error, Result};
use crate::math::{Bounds, Ray};
use crate::medium::{Light, Medium, Noise};
use crate::progress::Progress;
use crate::random::Stream;
use crate::render::refine::Quality;
use crate::render::sampling::{Dimension, point, shuffled_point};
use crate::render::surface::Surface;
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
    lights: Lights<'a>,
    solids: Option<Solids<'a>>,
    tracker: Tracker<'a>,
    noise: Option<&'a Noise>,
    /// Where the medium may be, with its noise.
    bounds: Bounds,
    space: Space,
    view: View,
    settings: Settings,
    film: Film,
}

/// Where light comes from.
enum Source<'a> {
    /// The cache, and what of it the eye sees.
    Cached(&'a Cache, Cow<'a, Lit>),
    BruteForce(&'a BruteForce<'a>),
}

/// Paths from body to body whose throughput falls below this are ended with a chance.
const ROULETTE: f32 = 0.25;
/// Rays end where less than this comes through.
pub(super) const DARK: f32 = 1e-3;
/// Pixels along an edge of a tile.
const TILE: usize = packet::RAYS;
const _: () = assert!((EDGE as usize).is_multiple_of(TILE));

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
        let light = match light {
            Illumination::Cached(cache) => Source::Cached(cache, cache.seen(medium, &view)),
            Illumination::BruteForce(brute) => Source::BruteForce(brute),
        };
        Ok(Self {
            medium,
            light,
            lights: Lights::new(lights),
            solids: None,
            tracker: Tracker::new(medium),
            noise: None,
            bounds: medium.bounds(),
            space: Space::of(medium.density()),
            view,
            settings,
            film: Film::new(width, height),
        })
    }

    /// The same with the medium dispersed by noise; nothing changes where pixels are too wide for any of it.
    pub fn with_noise(self, noise: &'a Noise) -> Self {
        let nearest = self.view.eye.clamp(self.bounds.min, self.bounds.max).distance(self.view.eye);
        if noise.has_faded(self.view.footprint((nearest - noise.reach()).max(0.0))) {
            return self;
        }
        let grid = self.medium.density();
        let bounds = self.medium.bounds().grown(noise.reach());
        let space = Space::reached(grid, noise.reach() / grid.spacing());
        Self { noise: Some(noise), bounds, space, ..self }
    }

    /// The same with opaque bodies in the medium: those that the light's [`Cache::around`] knows.
    pub fn with_solids(self, solids: Solids<'a>) -> Self {
        Self { solids: Some(solids), ..self }
    }

    /// The same, which keeps what [`March::denoised`] needs: twice the memory.
    pub fn with_halves(self) -> Self {
        Self { film: self.film.with_halves(), ..self }
    }

    /// Whether every pixel has all its samples.
    pub fn is_done(&self) -> bool {
        self.film.samples_done >= self.settings.samples
    }

    /// Adds a sample to every pixel; reports `width * height` to `progress`. Fails only when interrupted; the picture is then
    /// incomplete.
    pub fn pass(&mut self, progress: &dyn Progress) -> Result<()> {
        self.film.begin();
        let mut sums = std::mem::take(&mut self.film.sums);
        let width = self.settings.width as usize;
        let level = Level::new();
        sums.par_chunks_mut(width * TILE).enumerate().for_each(|(band, sums)| {
            if progress.cancelled() {
                return;
            }
            dispatch!(level, simd => sample_band(simd, self, (band * TILE) as u32, sums));
            progress.advance(sums.len() as u64);
        });
        self.film.sums = sums;
        self.film.advance(1);
        if progress.cancelled() { Err(Error::Interrupted) } else { Ok(()) }
    }

    /// Adds samples until the goal, which counts in place of the samples of the settings, is reached or `is_late` says so, which is asked after each pass.
    /// Fails as [`March::pass`] does.
    pub fn refine(
        &mut self,
        goal: &Goal,
        is_late: &mut dyn FnMut() -> bool,
        progress: &dyn Progress,
    ) -> Result<Quality> {
        refine(self, goal, is_late, progress)
    }

    /// The means so far, row by row from the top left.
    pub fn pixels(&self) -> Vec<Pixel> {
        self.film.pixels()
    }

    /// The same with less noise in the light that is scattered, as the differences between samples tell it. `None` if pixels have a single
    /// sample, or without [`March::with_halves`].
    pub fn denoised(&self) -> Option<Vec<Pixel>> {
        self.film.denoised()
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
        let (number, sample) = (row * width + column, self.film.samples_done);
        let at = |dimension| if samples == 1 { [0.5; 2] } else { point(seed, dimension, number, sample) };
        let [x, y] = at(Dimension::Pixel);
        let [start, _] = at(Dimension::Key);
        (self.view.ray(column as f32 + x, row as f32 + y), start)
    }

    /// Adds a sample to a pixel.
    #[inline(always)]
    fn sample(&self, column: u32, row: u32, sums: &mut Sums) {
        let Settings { width, seed, .. } = self.settings;
        let (mut ray, start) = self.ray(column, row);
        let met = self.solids.and_then(|it| it.show(&mut ray));
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
                    Stream::new(u64::from(seed), u64::from(number) << 32 | u64::from(self.film.samples_done));
                self.brute(&ray, start, brute, stream).add_to(sums, Vec3::ONE)
            }
        };
        self.add_behind(&ray, (met, through), row * width + column, sums);
    }

    /// Adds what comes through, of the surface at the end of a ray of that pixel or from behind everything.
    #[inline(always)]
    fn add_behind(&self, ray: &Ray, (met, through): (Option<Surface>, Vec3), pixel: u32, sums: &mut Sums) {
        let Some(surface) = met else {
            sums.environment += through * self.lights.seen(ray.direction);
            sums.transmittance += through;
            return;
        };
        sums.add_depth(ray.t_max, through);
        if through != Vec3::ZERO {
            sums.scattered += through * self.surface_radiance(surface, pixel);
        }
    }

    /// The radiance that a surface throws back toward the eye, a sample of it: by a path from body to body, which takes the medium's light where it meets the
    /// medium, and ends there.
    #[inline(never)]
    fn surface_radiance(&self, surface: Surface, pixel: u32) -> Vec3 {
        let (seed, sample) = (self.settings.seed, self.film.samples_done);
        let mut stream = Stream::new(u64::from(seed), u64::from(pixel) << 32 | u64::from(!sample));
        let mut random = shuffled_point(seed, Dimension::Sky, pixel, sample);
        let (mut surface, mut throughput, mut radiance) = (surface, Vec3::ONE, Vec3::ZERO);
        loop {
            radiance += throughput * surface.glow;
            throughput *= surface.color;
            let share = |toward: Vec3| thrown(&surface, toward);
            let through = |ray: &Ray, stream: &mut Stream| match self.solids {
                Some(solids) if solids.block(ray, Some(surface.node)) => Vec3::ZERO,
                _ => self.tracker.ratio_transmittance(ray, stream),
            };
            radiance +=
                throughput * self.lights.direct(surface.position, f32::INFINITY, share, through, &mut stream);
            let most = throughput.max_element();
            if most < ROULETTE {
                if stream.unit() * ROULETTE >= most {
                    return radiance;
                }
                throughput *= ROULETTE / most;
            }
            let direction = cosine_direction(&surface, random);
            let density = thrown(&surface, direction);
            let mut ray = Ray { origin: surface.position, direction, t_min: 0.0, t_max: f32::INFINITY };
            let met = self.solids.and_then(|it| it.meet(&mut ray, Some(surface.node)));
            if self.medium.is_additive() {
                radiance += throughput * self.tracker.added(&ray);
            }
            let flown = self.tracker.next(FreePath::Delta, &ray, &mut throughput, &mut stream);
            surface = match (flown, met) {
                (Some(distance), _) => {
                    let at = ray.origin + distance * direction;
                    return radiance + throughput * self.scattered(at, direction, &mut stream);
                }
                (None, Some(next)) => next,
                (None, None) => return radiance + throughput * self.lights.left_over(direction, density),
            };
            random = [stream.unit(), stream.unit()];
        }
    }

    /// The radiance that matter at a point adds, per extinction, to light that travels against `direction`.
    fn scattered(&self, at: Vec3, direction: Vec3, stream: &mut Stream) -> Vec3 {
        match &self.light {
            Source::Cached(cache, _) => cache.scattered(at, direction) + self.medium.emitted(at),
            Source::BruteForce(brute) => brute.scattered(at, direction, stream),
        }
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
        let mut rays = [self.ray(column, row).0; packet::RAYS];
        let mut met = [const { None }; packet::RAYS];
        for (lane, (ray, met)) in rays.iter_mut().zip(&mut met).enumerate().take(sums.len()) {
            let start;
            (*ray, start) = self.ray(column + lane as u32, row);
            *met = self.solids.and_then(|it| it.show(ray));
            if let Some(path) = Path::within(&self.bounds, self.medium.density(), ray) {
                paths.set(lane, &path, start);
            }
        }
        let first = row * self.settings.width + column;
        let extinction = Vec3::from(self.medium.optics().extinction) * self.step();
        let additive = self.medium.is_additive();
        match lit {
            Lit::Grey(bricks, hue) => {
                let matter = Matter { extinction: [extinction[hue.channel]], additive };
                let found = packet::march::<_, _, 1, 2>(simd, &paths, bricks, self.step(), &matter);
                self.add_packet(&found, hue.color, (&rays, &met), first, sums);
            }
            Lit::Colored(bricks) => {
                let matter = Matter { extinction: extinction.to_array(), additive };
                let found = packet::march::<_, _, 3, 4>(simd, &paths, bricks, self.step(), &matter);
                self.add_packet(&found, Vec3::ONE, (&rays, &met), first, sums);
            }
        }
    }

    /// Adds what a packet gathered, light in units of `color`, and what comes through.
    #[inline(always)]
    fn add_packet<const C: usize>(
        &self,
        found: &Gathered<C>,
        color: Vec3,
        (rays, met): (&[Ray], &[Option<Surface>]),
        first: u32,
        sums: &mut [Sums],
    ) {
        for (lane, ((sums, ray), met)) in sums.iter_mut().zip(rays).zip(met).enumerate() {
            sums.scattered += packet::rgb(&found.scattered, lane) * color;
            sums.depth += found.depth[lane];
            sums.lost += found.lost[lane];
            let through = packet::rgb(&found.transmittance, lane);
            self.add_behind(ray, (*met, through), first + lane as u32, sums);
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
        while let Some((distance, share, brick)) = crossing.next(&self.space) {
            let t = crossing.path.enter + distance;
            let (density, light, at) = match self.noise {
                None => {
                    let (density, light) = bricks.look_up(brick, crossing.path.at(distance));
                    (density, light, ray.origin + t * ray.direction)
                }
                Some(noise) => {
                    let (at, factor) = noise.disperse(ray.origin + t * ray.direction, self.view.footprint(t));
                    let (density, light) = bricks.at(Vec3A::from((at - grid.origin()) / grid.spacing()));
                    (factor * density, light, at)
                }
            };
            if density > 0.0 {
                let light = match cache.has_near() {
                    false => light,
                    true => light + L::of(cache.near(at, ray.direction), walk.channel),
                };
                walk.step(extinction * (share * density), light, t);
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
        while let Some((distance, share, _)) = crossing.next(&self.space) {
            let t = crossing.path.enter + distance;
            let at = ray.origin + t * ray.direction;
            let (at, factor) =
                self.noise.map_or((at, 1.0), |noise| noise.disperse(at, self.view.footprint(t)));
            let density = factor * self.medium.density().density(at);
            if density > 0.0 {
                let light = brute.scattered(at, ray.direction, &mut stream);
                walk.step(extinction * (share * density), light, t);
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
        Some(Crossing { path, step: self.step(), start, number: 0.0, part: 0.0, share: 1.0 })
    }
}

impl Gathering for March<'_> {
    fn film(&mut self) -> &mut Film {
        &mut self.film
    }

    fn add(&mut self, progress: &dyn Progress) -> Result<()> {
        self.pass(progress)
    }
}

#[cfg(test)]
impl March<'_> {
    /// What [`March::pass`] does, a ray at a time.
    pub(super) fn pass_by_rays(&mut self) {
        let mut sums = std::mem::take(&mut self.film.sums);
        for (number, sums) in (0..).zip(&mut sums) {
            self.sample(number % self.settings.width, number / self.settings.width, sums);
        }
        self.film.sums = sums;
        self.film.advance(1);
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
    /// Parts of the present one that are done, and what share of it each is.
    part: f32,
    share: f32,
}

impl Crossing {
    /// The next step or part of one: its distance along the path, what share of a step it is, and the number of its brick.
    ///
    /// Into how many parts a step is cut says its middle, wherever its points lie: so each of them stands for as much of the path as others.
    #[inline(always)]
    fn next(&mut self, space: &Space) -> Option<(f32, f32, usize)> {
        loop {
            if self.part == 0.0 && !space.shares.is_empty() {
                self.share = space.share(self.path.at((self.number + 0.5) * self.step));
            }
            let (number, share) = (self.number, self.share);
            let distance = (number + share * (self.part + self.start)) * self.step;
            if distance >= self.path.length {
                return None;
            }
            self.part += 1.0;
            if self.part * share >= 1.0 {
                (self.number, self.part) = (number + 1.0, 0.0);
            }
            let place = self.path.at(distance);
            match space.entry(place) {
                Ok(brick) => return Some((distance, share, brick)),
                Err(away) => {
                    let end = space.leave(&self.path, place, away) / self.step;
                    // A step that ends behind what is empty may have its middle or other parts there.
                    let margin = if space.shares.is_empty() { self.start } else { 1.0 };
                    let ahead = (end - margin).ceil();
                    if ahead > number {
                        (self.number, self.part) = (ahead.max(self.number), 0.0);
                    }
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
    for left in (0..width).step_by(TILE).filter(|left| march.film.wants(*left as u32, first)) {
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
