//! `tyndall bench`: the sets and cameras with which other renderers of spheres were measured, as Markdown tables or JSON.
//!
//! 800x800 pixels; the unit cube seen from an oblique direction, z up; orthographic of height 1.8, and perspective of 30 degrees
//! from 3.5. One sample: median of 5. Sixteen: median of 3. All samples count, also those that meet nothing. Pictures are made
//! again and again in the same memory, as a viewer makes them; one before those that count. `AO` is one ray a sample to the sky, the
//! default look has one to the key light as well. Single rays are asked of `bvh` and of `pkd` over the same particles; `structures`
//! asks all.

pub(crate) mod rays;
mod structures;
pub(crate) mod table;

use std::time::Instant;

use glam::DVec3;
use serde_json::json;
use tyndall::math::{Bounds, Ray};
use tyndall::render::estimate::Work;
use tyndall::render::{Renderer, Settings};
use tyndall::scene::camera::{Camera, Projection};
use tyndall::scene::color::ParticleColors;
use tyndall::scene::light::{KeyLight, Lighting};
use tyndall::scene::{Scene, automatic};
use tyndall::structure::{Kind, Structure, pkd};
use tyndall::{Image, Vec3, synthetic};

use crate::args;
use crate::dry_run::check_memory;
use crate::report::{Outcome, Report};
use crate::structure;
use crate::{bench_bodies, bench_culling, bench_medium};
use table::{Cell, Table};

/// What is measured if nothing is said.
pub(crate) const SETS: [&str; 3] = ["packed", "uniform", "clustered"];

const PICTURES: [&str; 13] = [
    "set",
    "particles",
    "camera",
    "build s",
    "B/particle",
    "ids B/particle",
    "peak MiB",
    "1 sample ms",
    "16 samples ms",
    "16 samples Msamples/s",
    "16 + 1 AO ms",
    "default look 16 ms",
    "default look Msamples/s",
];
const RAYS: [&str; 9] = [
    "set",
    "particles",
    "camera",
    "coherent Mrays/s",
    "pkd coherent Mrays/s",
    "coherent bvh : pkd",
    "incoherent Mrays/s",
    "pkd incoherent Mrays/s",
    "incoherent bvh : pkd",
];

/// Measures every set at every count.
pub(crate) fn run(args: &args::Bench, report: &Report) -> Outcome<()> {
    if matches!(args.what, args::BenchWhat::Spheres | args::BenchWhat::Structures) {
        let threads = rayon::current_num_threads();
        report.note(format_args!("tyndall {}, {threads} threads", env!("CARGO_PKG_VERSION")));
    }
    match args.what {
        args::BenchWhat::Spheres => {}
        args::BenchWhat::Structures => return structures::run(args, report),
        args::BenchWhat::Medium => return bench_medium::run(report),
        args::BenchWhat::Bodies => return bench_bodies::run(args, report),
        args::BenchWhat::Culling => return bench_culling::run(args, report),
        #[cfg(feature = "gpu")]
        args::BenchWhat::Gpu => return crate::bench_gpu::run(args, report),
        #[cfg(not(feature = "gpu"))]
        args::BenchWhat::Gpu => {
            let why = "this build knows no GPU — build it with --features gpu";
            return Err(tyndall::Error::Device(why.into()).into());
        }
    }
    let mut bench = Bench::new(args, report)?;
    for (set, count) in jobs(args) {
        bench.measure(set, count)?;
    }
    if args.json {
        let tables = json!({ "pictures": bench.pictures.json(), "rays": bench.rays.json() });
        return report.out(&format!("{tables:#}\n"));
    }
    report.out(&bench.pictures.markdown())?;
    match bench.rays.is_empty() {
        true => Ok(()),
        false => report.out(&format!("\n{}", bench.rays.markdown())),
    }
}

/// The sets and counts that are asked for, all sets of one count together.
fn jobs(args: &args::Bench) -> impl Iterator<Item = (&str, u64)> {
    let counts = if args.n.is_empty() { vec![1_000_000] } else { args.n.clone() };
    let sets =
        if args.sets.is_empty() { SETS.to_vec() } else { args.sets.iter().map(String::as_str).collect() };
    counts.into_iter().flat_map(move |count| sets.clone().into_iter().map(move |set| (set, count)))
}

/// What is measured with, and what was found.
struct Bench<'a> {
    args: &'a args::Bench,
    report: &'a Report,
    kind: Kind,
    pictures: Table,
    rays: Table,
}

/// Which set at which count is seen by which camera.
type Names = [Cell; 3];

fn names(set: &str, count: usize, camera: &str) -> Names {
    [Cell::Word(set.into()), Cell::Count(count), Cell::Word(camera.into())]
}

impl<'a> Bench<'a> {
    /// Without rows yet.
    fn new(args: &'a args::Bench, report: &'a Report) -> Outcome<Self> {
        let kind = structure::kind(&args.structure)?;
        Ok(Self { args, report, kind, pictures: Table::new(&PICTURES), rays: Table::new(&RAYS) })
    }

    /// Builds once and renders with each camera and light; then single rays.
    fn measure(&mut self, set: &str, count: u64) -> Outcome<()> {
        let work = Work::of_count(count, self.kind, self.settings(1));
        check_memory(&work, work.memory_bytes(), None)?;
        forget_peak();
        let (structure, build_secs) = self.build(set, count, self.kind)?;
        let count = structure.len();
        let each = |bytes: u64| bytes as f64 / count.max(1) as f64;
        let (held, ids) = (each(structure.bytes()), each(size_of_val(structure.ids()) as u64));
        let colors = ParticleColors::constant([0.7; 3]);
        let mut scene = Scene::new(structure, colors, Lighting::Headlight, Some([1.0; 3]));
        for (name, projection) in PROJECTIONS {
            let camera = camera_of_cube(projection);
            let view =
                camera.view(scene.structure().origin(), self.args.size.width, self.args.size.height)?;
            let studio = Lighting::studio(view.forward, view.right, view.up);
            let headlight = Lighting::Headlight;
            let lights = [
                (headlight.clone(), 1, 5),
                (headlight, 16, 3),
                (sky_only(studio.clone()), 16, 3),
                (studio, 16, 3),
            ];
            let mut times = [0.0; 4];
            for (secs, (lighting, samples, runs)) in times.iter_mut().zip(lights) {
                scene.lighting = lighting;
                *secs = self.picture_secs(&scene, &camera, samples, runs)?;
            }
            let peak = peak_bytes()
                .map_or(Cell::Unknown, |bytes| Cell::Number(bytes as f64 / f64::from(1 << 20), 0));
            let million_samples = 16e-6 * f64::from(self.args.size.width) * f64::from(self.args.size.height);
            let [one, sixteen, sky, look] = times;
            let number = |(number, decimals)| Cell::Number(number, decimals);
            let built = [(build_secs, 2), (held, 1), (ids, 1)].map(number);
            let drawn = [
                (1e3 * one, 1),
                (1e3 * sixteen, 1),
                (million_samples / sixteen, 1),
                (1e3 * sky, 1),
                (1e3 * look, 1),
                (million_samples / look, 1),
            ];
            let cells = built.into_iter().chain([peak]).chain(drawn.map(number));
            self.pictures.add(names(set, count, name).into_iter().chain(cells));
        }
        match self.kind {
            Kind::Bvh(_) => self.measure_rays(set, scene.into_structure()),
            Kind::Pkd(_) | Kind::Treelets(_) | Kind::Brute => Ok(()),
        }
    }

    /// Asks single rays of `bvh`, and then of a `pkd` over the same particles.
    fn measure_rays(&mut self, set: &str, bvh: Structure) -> Outcome<()> {
        let (width, height) = (self.args.size.width, self.args.size.height);
        let mut sets: Vec<Vec<Ray>> = Vec::new();
        for (_, projection) in PROJECTIONS {
            sets.push(rays::coherent(
                &camera_of_cube(projection).view(bvh.origin(), width, height)?,
                width,
                height,
            ));
        }
        let cube = Bounds { min: Vec3::ZERO, max: Vec3::ONE };
        sets.push(rays::incoherent(&cube.moved(-bvh.origin().as_vec3()), rays::INCOHERENT));
        let rates = |structure: &Structure| -> Vec<f64> {
            sets.iter().map(|rays| rays::rate(structure, rays)).collect()
        };
        let (count, of_bvh) = (bvh.len(), rates(&bvh));
        drop(bvh);
        let of_pkd = rates(&self.build(set, count as u64, Kind::Pkd(pkd::Options::default()))?.0);
        let incoherent = PROJECTIONS.len();
        for (at, (name, _)) in PROJECTIONS.iter().enumerate() {
            let both = [at, incoherent].map(|at| {
                [(of_bvh[at], 2), (of_pkd[at], 2), (of_bvh[at] / of_pkd[at], 1)]
                    .map(|(number, decimals)| Cell::Number(number, decimals))
            });
            self.rays.add(names(set, count, name).into_iter().chain(both.into_iter().flatten()));
        }
        Ok(())
    }

    /// A structure over `count` particles of `set`, and the time to build it.
    fn build(&self, set: &str, count: u64, kind: Kind) -> Outcome<(Structure, f64)> {
        let particles = synthetic::generate(&format!("{set}?n={count}&seed=1"), self.report.progress())?;
        let (radii, _) = automatic::radii(&particles);
        let start = Instant::now();
        let structure = Structure::build(kind, particles, &radii, 1.0, self.report.progress())?;
        Ok((structure, start.elapsed().as_secs_f64()))
    }

    fn settings(&self, samples: u32) -> Settings {
        Settings {
            width: self.args.size.width,
            height: self.args.size.height,
            samples,
            ..Settings::default()
        }
    }

    /// The median time of `runs` pictures in the same memory.
    fn picture_secs(&self, scene: &Scene, camera: &Camera, samples: u32, runs: usize) -> Outcome<f64> {
        let mut renderer = Renderer::new(scene, camera, &self.settings(samples))?;
        let mut image = Image::default();
        let mut times = Vec::with_capacity(runs + 1);
        for _ in 0..=runs {
            let start = Instant::now();
            renderer.restart(camera)?;
            while !renderer.is_done() {
                renderer.pass(self.report.progress())?;
            }
            renderer.image_into(&mut image);
            times.push(start.elapsed().as_secs_f64());
        }
        // The first one has to get its memory.
        times.remove(0);
        Ok(median(times))
    }
}

pub(crate) const PROJECTIONS: [(&str, Projection); 2] = [
    ("orthographic", Projection::Orthographic { height: 1.8 }),
    ("perspective", Projection::Perspective { vertical_angle: std::f64::consts::PI / 6.0 }),
];

/// Of the unit cube.
pub(crate) fn camera_of_cube(projection: Projection) -> Camera {
    camera_of(projection, DVec3::splat(0.5), 1.0)
}

/// Of what is `size` wide around `look_at`.
fn camera_of(projection: Projection, look_at: DVec3, size: f64) -> Camera {
    let eye = look_at + 3.5 * size * DVec3::new(0.80, 0.55, 0.45).normalize();
    Camera { eye, look_at, up: DVec3::Z, projection }
}

/// Without the key light.
fn sky_only(lighting: Lighting) -> Lighting {
    match lighting {
        Lighting::Studio(key, sky) => Lighting::Studio(KeyLight { strength: 0.0, ..key }, sky),
        other => other,
    }
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// Lets the most memory be counted anew, where the system does that.
pub(crate) fn forget_peak() {
    // Elsewhere the peak is that of all sets so far.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

/// The most memory that the process has had, where the system tells.
pub(crate) fn peak_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? * 1024)
}
