//! `tyndall bench medium`: the tables of Cha, Son and Ihm 2009 with ours beside them, as Markdown.
//!
//! The sets imitate the paper's by count and shape. A time is one run; that of a stage is what the stage takes in a whole picture.
//! The paper's times are those of its GTX 280 and of its CPU (Core 2 Duo, one program for both).

use std::time::Instant;

use tyndall::medium::density::{self, Resolution, Smoothing};
use tyndall::medium::light::{Directional, Environment};
use tyndall::medium::{Light, Medium, Optics, Phase, automatic};
use tyndall::render::medium::cache::{self, Cache, Multiple};
use tyndall::render::medium::free_path::FreePath;
use tyndall::render::medium::gather::Radius;
use tyndall::render::medium::march::{self, Illumination, March};
use tyndall::render::medium::photons::{self, Stored};
use tyndall::scene::automatic::{Outliers, framing_of};
use tyndall::scene::camera::View;
use tyndall::scene::outline::Outline;
use tyndall::scene::viewpoint::{Lens, Motion, Side, Viewpoint};
use tyndall::structure::Spheres;
use tyndall::{DVec3, Particles, Radii, Vec3, synthetic};

use crate::bench_density;
use crate::report::{Outcome, Report};

/// A set, and what the paper says about it.
struct Set {
    name: &'static str,
    h0: f32,
    /// Samples along the longest axis of the density in the paper's picture.
    grid: u32,
    /// Pictures of the march's table.
    sizes: [[u32; 2]; 2],
    /// Samples along the longest axis of two caches, the radius of photons, and the seconds of the paper's GPU and CPU for single
    /// and for multiple scattering.
    caches: [(u32, f32, [f64; 2], [f64; 2]); 2],
    /// Seconds of the march, GPU and CPU: 1K, 2K, and 2K with four samples.
    march: [[f64; 2]; 3],
    /// Seconds of density, photons, cache, march at 1K and at 2K: GPU and CPU.
    overall: [[f64; 5]; 2],
}

const SETS: [Set; 3] = [
    Set {
        name: "cloud1",
        h0: 1.07,
        grid: 361,
        sizes: [[1024, 576], [2048, 1152]],
        caches: [(200, 2.8, [0.012, 4.5], [0.98, 19.2]), (300, 2.8, [0.032, 16.4], [1.84, 62.2])],
        march: [[0.14, 296.1], [0.83, 498.3], [2.72, 1962.6]],
        overall: [[1.90, 0.79, 2.22, 0.55, 2.16], [15.37, 1.40, 65.81, 43.26, 164.58]],
    },
    Set {
        name: "cloud2",
        h0: 1.6,
        grid: 301,
        sizes: [[1024, 576], [2048, 1152]],
        caches: [(200, 2.6, [0.119, 38.6], [3.01, 121.3]), (300, 2.6, [0.502, 165.5], [9.25, 394.1])],
        march: [[0.21, 356.6], [1.36, 1409.2], [4.47, 7605.6]],
        overall: [[0.55, 0.74, 8.29, 0.66, 2.54], [13.97, 2.05, 307.69, 168.21, 585.52]],
    },
    Set {
        name: "smoke",
        h0: 1.44,
        grid: 280,
        sizes: [[1024, 768], [2048, 1536]],
        caches: [(200, 0.8, [0.136, 55.3], [0.94, 17.5]), (300, 0.8, [0.630, 257.3], [2.08, 56.1])],
        march: [[0.19, 290.0], [1.77, 1118.0], [4.38, 6410.5]],
        overall: [[10.56, 1.39, 3.90, 0.74, 2.94], [64.17, 16.59, 175.76, 191.77, 517.39]],
    },
];

/// The volume-resolution series of cloud2: samples along the longest axis, and the paper's DVG, VPT, ICC, RM.
const SERIES: [(u32, [f64; 4]); 5] = [
    (101, [0.11, 0.54, 0.69, 0.54]),
    (151, [0.15, 0.51, 1.21, 0.54]),
    (201, [0.23, 0.49, 2.60, 0.58]),
    (251, [0.35, 0.53, 4.67, 0.62]),
    (301, [0.55, 0.74, 8.29, 0.66]),
];

/// Photons that are emitted: about as many are stored as in the paper.
const PHOTONS: u64 = 100_000;

/// Measures all sets and prints the tables.
pub(crate) fn run(report: &Report) -> Outcome<()> {
    let smoke = synthetic::generate("smoke", report.progress())?;
    bench_density::run(&smoke, report)?;
    report.out("\n| cache | resolution | sun alone, s | GPU, CPU then | sun and sky, s | multiple by photons (stored), s | GPU, CPU then | by sweeps, s |\n|---|---|---|---|---|---|---|---|\n")?;
    let mut marched = String::from(
        "\n| march | 1K, s | 2K | 2K, 4 samples | GPU then | CPU then |\n|---|---|---|---|---|---|\n",
    );
    let mut overall = String::from(
        "\n| overall | density | photons | cache | march 1K | 2K | total 1K | GPU then | CPU then |\n|---|---|---|---|---|---|---|---|---|\n",
    );
    for set in &SETS {
        let particles = synthetic::generate(set.name, report.progress())?;
        let mut lit = Lit::new(set, &particles, set.grid, report)?;
        for cache in &set.caches {
            report.out(&lit.cache_row(set, cache)?)?;
        }
        let [gpu, cpu] = set.overall;
        let stages = lit.overall(set.sizes)?;
        let [density, photons, cache, near, far] = stages;
        let total = density + photons + cache + near;
        overall += &format!(
            "| {} | {density:.2} | {photons:.2} | {cache:.2} | {near:.2} | {far:.2} | {total:.2} | {:.2} | {:.1} |\n",
            set.name,
            gpu[..4].iter().sum::<f64>(),
            cpu[..4].iter().sum::<f64>()
        );
        let four = lit.march(set.sizes[1], 4)?;
        let [then_1, then_2, then_4] = set.march;
        marched += &format!(
            "| {} | {near:.2} | {far:.2} | {four:.2} | {}, {}, {} | {}, {}, {} |\n",
            set.name, then_1[0], then_2[0], then_4[0], then_1[1], then_2[1], then_4[1]
        );
    }
    report.out(&marched)?;
    report.out(&overall)?;
    series(report)
}

/// cloud2 on grids of several sizes.
fn series(report: &Report) -> Outcome<()> {
    report.out("\n| cloud2, grid | density | photons | cache | march 1K | GPU then: DVG, VPT, ICC, RM |\n|---|---|---|---|---|---|\n")?;
    let set = &SETS[1];
    let particles = synthetic::generate(set.name, report.progress())?;
    for (grid, then) in SERIES {
        let mut lit = Lit::new(set, &particles, grid, report)?;
        let [density, photons, cache, near, _] = lit.overall([set.sizes[0], [64, 36]])?;
        let [x, y, z] = lit.medium.density().size();
        report.out(&format!(
            "| {x}x{y}x{z} | {density:.2} | {photons:.2} | {cache:.2} | {near:.2} | {then:?} |\n"
        ))?;
    }
    Ok(())
}

/// A set as a medium in sun and sky.
struct Lit<'a> {
    medium: Medium,
    lights: Vec<Light>,
    outline: Outline,
    origin: DVec3,
    density_secs: f64,
    cache: Option<Cache>,
    report: &'a Report,
}

impl<'a> Lit<'a> {
    fn new(set: &Set, particles: &Particles, grid: u32, report: &'a Report) -> Outcome<Self> {
        let settings = density::Settings {
            smoothing: Smoothing::ThreePass,
            length: Some(set.h0),
            neighbors: 32,
            resolution: Resolution::Samples(grid),
            ..density::Settings::default()
        };
        let start = Instant::now();
        let grid = density::estimate(particles, &settings, report.progress())?.density;
        let density_secs = start.elapsed().as_secs_f64();
        let extinction = [automatic::extinction(&grid, automatic::THICKNESS); 3];
        let radii = Radii::Uniform(2.0 * grid.spacing());
        let medium = Medium::new(grid, Optics { extinction, albedo: [0.95; 3], phase: Phase::ISOTROPIC })?;
        let sun = Directional::new(Vec3::new(0.6, -0.64, -0.48), [std::f32::consts::PI; 3])?;
        let lights = vec![Light::Directional(sun), Light::Environment(Environment::constant([0.25; 3])?)];
        let spheres = Spheres { particles, radii: &radii, radius_scale: 1.0 };
        let outline = Outline::of(spheres, &framing_of(spheres, Outliers::Left));
        let origin = particles.positions().origin();
        Ok(Self { medium, lights, outline, origin, density_secs, cache: None, report })
    }

    /// Seconds that the cache takes, and the cache.
    fn lit(&self, spacing: Option<f32>, multiple: Multiple) -> Outcome<(f64, Cache)> {
        self.lit_by(&self.lights, spacing, multiple)
    }

    /// The same by some lights.
    fn lit_by(&self, lights: &[Light], spacing: Option<f32>, multiple: Multiple) -> Outcome<(f64, Cache)> {
        let settings = cache::Settings { spacing, multiple, ..cache::Settings::default() };
        let start = Instant::now();
        let cache = Cache::new(&self.medium, lights, &settings, self.report.progress())?;
        Ok((start.elapsed().as_secs_f64(), cache))
    }

    fn photons(&self) -> Outcome<(f64, usize)> {
        let start = Instant::now();
        let photons = photons::trace(&self.medium, &self.lights, &photon_settings(), self.report.progress())?;
        Ok((start.elapsed().as_secs_f64(), photons.stored.len()))
    }

    fn cache_row(&self, set: &Set, cache: &(u32, f32, [f64; 2], [f64; 2])) -> Outcome<String> {
        let &(samples, radius, single_then, multiple_then) = cache;
        let extent = self.medium.density().bounds().extent();
        let edge = extent.max_element() / samples as f32;
        let spacing = Some(edge);
        let (sun, _) = self.lit_by(&self.lights[..1], spacing, Multiple::None)?;
        let (single, _) = self.lit(spacing, Multiple::None)?;
        let (tracing, stored) = self.photons()?;
        let by_photons = Multiple::Photons(photon_settings(), Radius::Fixed(radius), 1);
        let (with_photons, _) = self.lit(spacing, by_photons)?;
        let (with_sweeps, _) = self.lit(spacing, Multiple::Sweeps)?;
        let size = (extent / edge).to_array().map(|it| it.round() as u32);
        let [x, y, z] = size;
        let multiple = (with_photons - single - tracing).max(0.0);
        let sweeps = (with_sweeps - single).max(0.0);
        Ok(format!(
            "| {} | {x}x{y}x{z} ({radius}) | {sun:.2} | {}, {} | {single:.2} | {multiple:.2} ({stored}) | {}, {} | {sweeps:.2} |\n",
            set.name, single_then[0], single_then[1], multiple_then[0], multiple_then[1]
        ))
    }

    /// Seconds of density, photons (traced, though sweeps do without), cache by sweeps, and march at two sizes.
    fn overall(&mut self, sizes: [[u32; 2]; 2]) -> Outcome<[f64; 5]> {
        let (tracing, _) = self.photons()?;
        let (caching, cache) = self.lit(None, Multiple::Sweeps)?;
        self.cache = Some(cache);
        Ok([self.density_secs, tracing, caching, self.march(sizes[0], 1)?, self.march(sizes[1], 1)?])
    }

    /// Seconds of a picture from the cache.
    fn march(&self, size: [u32; 2], samples: u32) -> Outcome<f64> {
        let Some(cache) = &self.cache else { return Ok(0.0) };
        let settings =
            march::Settings { width: size[0], height: size[1], samples, ..march::Settings::default() };
        let view = self.view(size)?;
        let start = Instant::now();
        let mut march = March::new(&self.medium, Illumination::Cached(cache), &self.lights, view, settings)?;
        while !march.is_done() {
            march.pass(self.report.progress())?;
        }
        march.pixels();
        Ok(start.elapsed().as_secs_f64())
    }

    fn view(&self, [width, height]: [u32; 2]) -> Outcome<View> {
        let viewpoint = Viewpoint {
            eye: None,
            look_at: None,
            up: Some(DVec3::Y),
            side: Side { direction: DVec3::new(0.0, -0.2, -1.0), up: DVec3::Y },
            lens: Lens::Perspective { vertical_angle: 0.6 },
            motion: Motion::Still,
        };
        let camera = viewpoint.camera(&self.outline, f64::from(width) / f64::from(height));
        Ok(camera.view(self.origin, width, height)?)
    }
}

fn photon_settings() -> photons::Settings {
    photons::Settings {
        count: PHOTONS,
        seed: 1,
        free_path: FreePath::Delta,
        stored: Stored::Multiple,
        memory_bytes: None,
    }
}
