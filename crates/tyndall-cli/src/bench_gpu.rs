//! `tyndall bench gpu`: spheres on a graphics card, as Markdown tables or JSON.
//!
//! The stand-ins of the thesis at their own counts and the sets of `tyndall bench` at those that are given, 800x800. Frames follow each
//! other without a wait for any but the one before, as a viewer makes them; nothing is read back. `hits ms` and `light ms` are the card's
//! own clock. `floors` says what bounds finding hits: bytes that the walk reads at least once a tile over the memory's rate, operations over
//! the card's peak, and the steps that wait for each other in a tile over the tiles that are at work at one time. `builds` has the processor's
//! structure beside the card's. Incoherent rays come from random points around the particles' box to random points in it; `structures` are
//! asked them too, where there are few enough particles. More than 2^28 particles are packed in 8 bits and read in parts. Culling has a table of its
//! own: see `culling`.

mod builds;
mod culling;
mod structures;

use std::time::{Duration, Instant};

use serde_json::json;
use tyndall::render::gpu::{Gpu, Kind as AdapterKind, Options, Renderer, Resident, Tiling, Tilings};
use tyndall::render::{Culling, Settings};
use tyndall::scene::automatic::{self, Outliers};
use tyndall::scene::camera::{Camera, VERTICAL_ANGLE};
use tyndall::scene::color::ParticleColors;
use tyndall::scene::light::Lighting;
use tyndall::scene::outline::Outline;
use tyndall::scene::viewpoint::{Lens, Motion, Side, Viewpoint};
use tyndall::scene::{Scene, grouped};
use tyndall::structure::{Kind, Packing, Spheres, Structure};
use tyndall::synthetic::{self, Synthetic};

use crate::args;
use crate::bench::table::{Cell, Table};
use crate::bench::{PROJECTIONS, SETS, camera_of_cube, rays};
use crate::device::Choice;
use crate::report::{Outcome, Report};
use crate::structure;
use builds::{BUILDS, Secs};

/// At their own counts.
const STAND_INS: [&str; 4] = ["nozzle", "virion", "fluid", "ablation"];
const COUNTS: [u64; 3] = [1_000_000, 10_000_000, 100_000_000];
/// From here on particles are read in parts.
const STREAMED: u64 = 1 << 28;
/// Of each measurement: how long it may take, and how many frames it has at least and at most.
const MEASURED: Duration = Duration::from_millis(400);
const FRAMES: [u32; 2] = [2, 2000];
/// How long a way to walk is tried.
const VARIED: Duration = Duration::from_millis(150);
/// Rays that share nothing, on hardware and on a program.
const RAYS: [u64; 2] = [1 << 22, 1 << 12];

const PICTURES: [&str; 16] = [
    "set",
    "particles",
    "camera",
    "build s",
    "upload s",
    "MiB on card",
    "1 sample frames/s",
    "4 samples frames/s",
    "16 samples frames/s",
    "4 samples Msamples/s",
    "16 samples Msamples/s",
    "hits 4 ms",
    "hits 16 ms",
    "light 4 ms",
    "default look 4 frames/s",
    "incoherent Mrays/s",
];
const VARIANTS: [&str; 7] = ["set", "camera", "samples", "first walk", "second walk", "checks", "hits ms"];

const FLOORS: [&str; 15] = [
    "set",
    "particles",
    "camera",
    "samples",
    "steps a tile",
    "longest tile",
    "nodes a tile",
    "leaves a tile",
    "tests a sample",
    "hits us",
    "memory us",
    "arithmetic us",
    "latency us",
    "longest us",
    "limit",
];

/// What a card can do at most.
struct Card {
    name: &'static str,
    bytes_a_sec: f64,
    /// Operations in single precision; a fused one counts twice.
    operations_a_sec: f64,
    processors: f64,
}

/// From their makers' data sheets, SXM modules.
const CARDS: [Card; 3] = [
    Card { name: "H200", bytes_a_sec: 4.8e12, operations_a_sec: 66.9e12, processors: 132.0 },
    Card { name: "H100", bytes_a_sec: 3.35e12, operations_a_sec: 66.9e12, processors: 132.0 },
    Card { name: "A100", bytes_a_sec: 2.04e12, operations_a_sec: 19.5e12, processors: 108.0 },
];
/// Operations of a test of a sample, and of projecting a child's box or a particle; counted in the shader's text.
const TEST_OPERATIONS: f64 = 29.0;
const PROJECT_OPERATIONS: f64 = 70.0;
/// Seconds of a step at least: a read from the second cache (270 cycles), three barriers and the arithmetic between (300), at 1.7 GHz.
const STEP_SECS: f64 = 0.34e-6;
/// Tiles that a processor holds at one time: 2048 threads in groups of 64.
const TILES_AT_ONCE: f64 = 32.0;

/// Ways to walk that are compared, for so many samples.
fn variants(samples: u32, particles: usize) -> Vec<Tilings> {
    let tiling = |tile, split, nodes| Tiling { tile, split, nodes };
    let default = Tilings::of(samples, particles);
    let endless = |first| Tilings { first, patience: 0, ..default };
    let patient = |patience, second| Tilings { patience, second, ..default };
    let (small, tiny) = (tiling([4, 4], 4, 8), tiling([2, 2], 16, 8));
    vec![
        endless(tiling([8, 8], 1, 4)),
        endless(tiling([8, 4], 4, 8)),
        endless(tiling([4, 4], 4, 4)),
        // Groups of as many threads as cards run in step: barriers cost nothing there.
        endless(tiling([8, 4], 1, 4)),
        endless(tiling([4, 2], 4, 4)),
        endless(tiling([8, 8], 4, 16)),
        patient(32, small),
        patient(64, small),
        patient(128, small),
        patient(256, small),
        patient(64, tiny),
        patient(128, tiny),
        Tilings { first: tiling([8, 4], 4, 8), ..patient(64, small) },
        Tilings { first: tiling([4, 4], 4, 4), ..patient(64, tiny) },
        patient(64, tiling([8, 8], 4, 16)),
    ]
}

/// What is measured with, and what was found.
struct Bench<'a> {
    args: &'a args::Bench,
    report: &'a Report,
    gpu: Gpu,
    /// Another handle on the same card, whose kernels check themselves.
    checked: Option<Gpu>,
    pictures: Table,
    builds: Table,
    floors: Table,
    structures: Table,
    culling: Table,
    variants: Table,
    start: Instant,
}

/// Measures every set at every count, and tells what was found also if that fails midway.
pub(crate) fn run(args: &args::Bench, report: &Report) -> Outcome<()> {
    let name = match &args.device {
        Choice::Gpu(name) => name.clone(),
        Choice::Auto | Choice::Cpu => None,
    };
    let gpu = Gpu::open(Options { name: name.clone(), ..Options::default() })?;
    let checked = match args.variants {
        true => Some(Gpu::open(Options { name, checked: true, ..Options::default() })?),
        false => None,
    };
    let info = gpu.info();
    report.note(format_args!("tyndall {}, {} ({})", env!("CARGO_PKG_VERSION"), info.name, info.driver));
    let mut bench = Bench {
        args,
        report,
        gpu,
        checked,
        pictures: Table::new(&PICTURES),
        builds: Table::new(&BUILDS),
        floors: Table::new(&FLOORS),
        structures: Table::new(&structures::HEADINGS),
        culling: Table::new(&culling::HEADINGS),
        variants: Table::new(&VARIANTS),
        start: Instant::now(),
    };
    let done = bench.measure_all();
    if args.json {
        report.out(&format!("{:#}\n", bench.json()))?;
    } else {
        report.out(&bench.pictures.markdown())?;
        for table in [&bench.culling, &bench.structures, &bench.builds, &bench.floors, &bench.variants]
            .into_iter()
            .filter(|table| !table.is_empty())
        {
            report.out(&format!("\n{}", table.markdown()))?;
        }
    }
    done
}

impl Bench<'_> {
    /// The sets and counts that are asked for.
    fn jobs(&self) -> Vec<(String, Option<u64>)> {
        let counts = if self.args.n.is_empty() { COUNTS.to_vec() } else { self.args.n.clone() };
        let sets: Vec<String> = match self.args.sets.is_empty() {
            true => STAND_INS.iter().chain(&SETS).map(|set| set.to_string()).collect(),
            false => self.args.sets.clone(),
        };
        let (own, others): (Vec<_>, Vec<_>) =
            sets.into_iter().partition(|set| STAND_INS.contains(&set.as_str()) && self.args.n.is_empty());
        let of_count = |count: u64| others.iter().map(move |set| (set.clone(), Some(count)));
        own.into_iter().map(|set| (set, None)).chain(counts.into_iter().flat_map(of_count)).collect()
    }

    fn measure_all(&mut self) -> Outcome<()> {
        for (set, count) in self.jobs() {
            if self.args.time.is_some_and(|secs| self.start.elapsed().as_secs() >= secs) {
                self.report.note(format_args!("note: no time left for {set} and what comes after"));
                break;
            }
            self.measure(&set, count)?;
            if let Some(path) = &self.args.figures {
                let text = format!("{:#}\n", self.json());
                std::fs::write(path, text).map_err(|error| tyndall::Error::io(path, error))?;
            }
        }
        Ok(())
    }

    /// All figures so far.
    fn json(&self) -> serde_json::Value {
        let info = self.gpu.info();
        json!({
            "adapter": info.name,
            "driver": info.driver,
            "memory_bytes": info.memory_bytes,
            "version": env!("CARGO_PKG_VERSION"),
            "threads": rayon::current_num_threads(),
            "size": [self.args.size.width, self.args.size.height],
            "secs": self.start.elapsed().as_secs_f64(),
            "pictures": self.pictures.json(),
            "structures": self.structures.json(),
            "builds": self.builds.json(),
            "culling": self.culling.json(),
            "floors": self.floors.json(),
            "variants": self.variants.json(),
        })
    }

    /// Builds and loads once, then measures with each camera.
    fn measure(&mut self, set: &str, count: Option<u64>) -> Outcome<()> {
        let kind = structure::kind(&self.args.structure)?;
        let (structure, cameras, build_secs) = self.build(set, count, kind)?;
        let colors = ParticleColors::constant([0.7; 3]);
        let mut scene = Scene::new(structure, colors, Lighting::Headlight, Some([1.0; 3]));
        let start = Instant::now();
        let resident = Resident::load(&self.gpu, &scene, self.report.progress())?;
        let upload_secs = start.elapsed().as_secs_f64();
        let rays = self.incoherent(&resident, &scene)?;
        let particles = scene.structure().len();
        for (name, camera) in &cameras {
            scene.lighting = Lighting::Headlight;
            let frames = [1, 4, 16].map(|samples| self.frames(&resident, &scene, camera, samples));
            let [one, four, sixteen] = frames;
            let [one, four, sixteen] = [one?, four?, sixteen?];
            for (samples, frames) in [(1, &one), (4, &four), (16, &sixteen)] {
                let row = self.floors_of(set, name, &resident, &scene, camera, samples, frames)?;
                row.into_iter().for_each(|row| self.floors.add(row));
            }
            for samples in culling::SAMPLES {
                let row = self.culled(set, name, &resident, &scene, camera, samples)?;
                self.culling.add(row);
            }
            let view =
                camera.view(scene.structure().origin(), self.args.size.width, self.args.size.height)?;
            scene.lighting = Lighting::studio(view.forward, view.right, view.up);
            let look = self.frames(&resident, &scene, camera, 4)?;
            let pixels = f64::from(self.args.size.width) * f64::from(self.args.size.height);
            let ms = |secs: Option<[f64; 2]>, at: usize| {
                secs.map_or(Cell::Unknown, |secs| Cell::Number(1e3 * secs[at], 3))
            };
            self.pictures.add([
                Cell::Word(set.into()),
                Cell::Count(particles),
                Cell::Word((*name).into()),
                Cell::Number(build_secs, 2),
                Cell::Number(upload_secs, 2),
                Cell::Number(resident.bytes() as f64 / f64::from(1 << 20), 0),
                Cell::Number(one.rate, 0),
                Cell::Number(four.rate, 0),
                Cell::Number(sixteen.rate, 0),
                Cell::Number(4e-6 * pixels * four.rate, 0),
                Cell::Number(16e-6 * pixels * sixteen.rate, 0),
                ms(four.secs, 0),
                ms(sixteen.secs, 0),
                ms(four.secs, 1),
                Cell::Number(look.rate, 1),
                Cell::Number(1e-6 * rays, 1),
            ]);
            self.report.note(format_args!(
                "{set} {} {name}: {:.0} / {:.0} / {:.0} frames/s with 1, 4, 16 samples, default look {:.1}; {:.0} Mrays/s",
                grouped(particles),
                one.rate,
                four.rate,
                sixteen.rate,
                look.rate,
                1e-6 * rays
            ));
        }
        drop(resident);
        self.measure_structures(set, count)?;
        scene.lighting = Lighting::Headlight;
        if let Some((_, camera)) = cameras.last() {
            let secs = Secs { build: build_secs, copy: upload_secs };
            self.measure_builds(&text_of(set, count), &scene, camera, secs)?;
        }
        if self.args.variants {
            self.compare(set, &scene, &cameras)?;
        }
        Ok(())
    }

    /// Counts what the walk does, and says how long that takes at least.
    #[expect(clippy::too_many_arguments, reason = "what was measured, by name")]
    fn floors_of(
        &self,
        set: &str,
        camera_name: &str,
        resident: &Resident,
        scene: &Scene,
        camera: &Camera,
        samples: u32,
        frames: &Frames,
    ) -> Outcome<Option<[Cell; FLOORS.len()]>> {
        let mut renderer = Renderer::new(resident, scene, camera, &self.settings(samples))?;
        let Some(work) = renderer.count_work(self.report.progress())? else { return Ok(None) };
        let particles = scene.structure().len();
        let [tiles, steps, nodes, leaves, tests] =
            [work.tiles, work.steps, work.nodes, work.leaves, work.tests].map(|count| count as f64);
        let all = f64::from(samples) * f64::from(self.args.size.width) * f64::from(self.args.size.height);
        // Nodes and leaves that several tiles read come from a cache: each byte of the tree counts once at most.
        let leaf_bytes = resident.bytes() as f64 / particles.max(1) as f64 * 16.0;
        let bytes = (64.0 * nodes + leaf_bytes * leaves).min(resident.bytes() as f64) + 8.0 * all;
        let operations = TEST_OPERATIONS * tests + PROJECT_OPERATIONS * (8.0 * nodes + 16.0 * leaves);
        let card = CARDS.iter().find(|card| self.gpu.info().name.contains(card.name));
        let floors = card.map(|card| {
            [
                ("memory", bytes / card.bytes_a_sec),
                ("arithmetic", operations / card.operations_a_sec),
                ("latency", steps * STEP_SECS / tiles.min(TILES_AT_ONCE * card.processors)),
                ("longest tile", work.most_steps as f64 * STEP_SECS),
            ]
        });
        let us = |secs: Option<f64>| secs.map_or(Cell::Unknown, |secs| Cell::Number(1e6 * secs, 1));
        let floor = |at: usize| us(floors.map(|floors| floors[at].1));
        let limit = floors.and_then(|floors| floors.into_iter().max_by(|a, b| a.1.total_cmp(&b.1)));
        Ok(Some([
            Cell::Word(set.into()),
            Cell::Count(particles),
            Cell::Word(camera_name.into()),
            Cell::Count(samples as usize),
            Cell::Number(steps / tiles, 1),
            Cell::Count(work.most_steps as usize),
            Cell::Number(nodes / tiles, 1),
            Cell::Number(leaves / tiles, 1),
            Cell::Number(tests / all, 2),
            us(frames.secs.map(|secs| secs[0])),
            floor(0),
            floor(1),
            floor(2),
            floor(3),
            limit.map_or(Cell::Unknown, |(name, _)| Cell::Word(name.into())),
        ]))
    }

    /// Times the kernels that find hits in each way to walk; with checks the default alone.
    fn compare(&mut self, set: &str, scene: &Scene, cameras: &[(&str, Camera)]) -> Outcome<()> {
        let progress = self.report.progress();
        let particles = scene.structure().len();
        for (gpu, checks) in [(Some(&self.gpu), "off"), (self.checked.as_ref(), "on")] {
            let Some(gpu) = gpu else { continue };
            let resident = Resident::load(gpu, scene, progress)?;
            for ((name, camera), samples) in
                cameras.iter().flat_map(|camera| [1, 4, 16].map(|samples| (camera, samples)))
            {
                let all = if checks == "on" {
                    vec![Tilings::of(samples, particles)]
                } else {
                    variants(samples, particles)
                };
                for tilings in all {
                    let Tilings { first, second, patience } = tilings;
                    if first.threads().max(second.threads()) > gpu.workgroup_threads() {
                        continue;
                    }
                    let settings = self.settings(samples);
                    let mut renderer =
                        Renderer::new(&resident, scene, camera, &settings)?.with_tilings(tilings);
                    renderer.prepare(progress)?;
                    // A card that has waited has a slow clock: it is kept at work.
                    let start = Instant::now();
                    let mut times = Vec::new();
                    while times.len() < 5 || (start.elapsed() < VARIED && times.len() < 200) {
                        for _ in 0..8 {
                            renderer.restart(camera)?;
                            renderer.pass(progress)?;
                        }
                        let Some([hits, _]) = renderer.time_pass(progress)? else { break };
                        times.push(hits);
                    }
                    times.sort_by(f64::total_cmp);
                    let text = |tiling: Tiling| {
                        format!("{}x{}/{}/{}", tiling.tile[0], tiling.tile[1], tiling.split, tiling.nodes)
                    };
                    let after = if patience == 0 {
                        "none".into()
                    } else {
                        format!("{} after {patience}", text(second))
                    };
                    self.variants.add([
                        Cell::Word(set.into()),
                        Cell::Word((*name).into()),
                        Cell::Count(samples as usize),
                        Cell::Word(text(first)),
                        Cell::Word(after),
                        Cell::Word(checks.into()),
                        times.get(times.len() / 4).map_or(Cell::Unknown, |secs| Cell::Number(1e3 * secs, 3)),
                    ]);
                }
            }
        }
        Ok(())
    }

    fn settings(&self, samples: u32) -> Settings {
        let args::Bench { size, .. } = self.args;
        Settings { width: size.width, height: size.height, samples, seed: 0, culling: Culling::Off }
    }

    /// Makes a set and arranges it in a structure.
    fn build(&self, set: &str, count: Option<u64>, kind: Kind) -> Outcome<Built> {
        let progress = self.report.progress();
        let text = text_of(set, count);
        let count = synthetic::count(&text)?;
        let is_cube = SETS.contains(&set);
        if count >= STREAMED {
            let source = Synthetic::new(&text)?;
            let sample = source.sample(1 << 20, progress)?;
            let (radius, _) = automatic::radii(&sample);
            let cameras =
                self.cameras(is_cube, Spheres { particles: &sample, radii: &radius, radius_scale: 1.0 });
            let start = Instant::now();
            let tyndall::Radii::Uniform(each) = radius else {
                return Err(tyndall::Error::setting(
                    "--sets",
                    set,
                    "sets of one radius at so many particles",
                )
                .into());
            };
            let origin = sample.positions().origin();
            let (structure, _) = Structure::stream(&source, origin, each, Packing::Bits8, progress)?;
            return Ok((structure, cameras, start.elapsed().as_secs_f64()));
        }
        let particles = synthetic::generate(&text, progress)?;
        let (radii, _) = automatic::radii(&particles);
        let cameras =
            self.cameras(is_cube, Spheres { particles: &particles, radii: &radii, radius_scale: 1.0 });
        let start = Instant::now();
        let structure = Structure::build(kind, particles, &radii, 1.0, progress)?;
        Ok((structure, cameras, start.elapsed().as_secs_f64()))
    }

    /// The cameras of `tyndall bench` for the unit cube; for the stand-ins those of `tyndall render`.
    fn cameras(&self, is_cube: bool, spheres: Spheres) -> Vec<(&'static str, Camera)> {
        if is_cube {
            return PROJECTIONS.map(|(name, projection)| (name, camera_of_cube(projection))).to_vec();
        }
        let framing = automatic::framing_of(spheres, Outliers::Left);
        let outline = Outline::of(spheres, &framing);
        let aspect = f64::from(self.args.size.width) / f64::from(self.args.size.height);
        let lenses = [
            ("orthographic", Lens::Orthographic { height: None }),
            ("perspective", Lens::Perspective { vertical_angle: VERTICAL_ANGLE }),
        ];
        let camera = |lens| {
            let (side, motion) = (Side::default(), Motion::Still);
            Viewpoint { eye: None, look_at: None, up: None, side, lens, motion }.camera(&outline, aspect)
        };
        lenses.map(|(name, lens)| (name, camera(lens))).to_vec()
    }

    /// Frames in a second, and the card's own seconds of one.
    fn frames(&self, resident: &Resident, scene: &Scene, camera: &Camera, samples: u32) -> Outcome<Frames> {
        let progress = self.report.progress();
        let mut renderer = Renderer::new(resident, scene, camera, &self.settings(samples))?;
        renderer.prepare(progress)?;
        // Bands grow to what the card can do.
        for _ in 0..3 {
            renderer.restart(camera)?;
            renderer.pass(progress)?;
        }
        renderer.finish()?;
        let start = Instant::now();
        let mut count = 0;
        while count < FRAMES[0] || (count < FRAMES[1] && start.elapsed() < MEASURED) {
            renderer.restart(camera)?;
            renderer.pass(progress)?;
            count += 1;
        }
        renderer.finish()?;
        let rate = f64::from(count) / start.elapsed().as_secs_f64();
        let mut times = Vec::new();
        for _ in 0..5 {
            times.extend(renderer.time_pass(progress)?);
        }
        times.sort_by(|a, b| a[0].total_cmp(&b[0]));
        Ok(Frames { rate, secs: times.get(times.len() / 2).copied() })
    }

    /// Rays that share nothing, answered in a second.
    fn incoherent(&self, resident: &Resident, scene: &Scene) -> Outcome<f64> {
        let is_program = self.gpu.info().kind == AdapterKind::Software;
        let count = RAYS[usize::from(is_program)];
        let rays = rays::incoherent(&scene.structure().bounds(), count);
        let batch = resident.batch(&rays)?;
        let mut times = Vec::new();
        for _ in 0..6 {
            times.push(batch.time(self.report.progress())?);
        }
        times.sort_by(f64::total_cmp);
        Ok(count as f64 / times[times.len() / 2])
    }
}

/// A set as the library makes it, at a count or at its own.
fn text_of(set: &str, count: Option<u64>) -> String {
    match count {
        Some(count) => format!("{set}?n={count}&seed=1"),
        None => set.to_string(),
    }
}

/// A structure, its cameras by name, and the seconds to build it.
type Built = (Structure, Vec<(&'static str, Camera)>, f64);

/// What was measured of one picture.
struct Frames {
    rate: f64,
    secs: Option<[f64; 2]>,
}
