//! `tyndall bench culling`: the evaluation of Walloner 2022, chapter 6, on stand-ins for its data sets, and what it lacks, as a folder
//! with a report in Markdown and pictures.
//!
//! Four views of each set, orthographic, 800 x 800, four samples a pixel and frame, the parameters of the thesis' table 6.2. Times
//! and picture quality are those of nine windows that lie evenly over the picture, at full resolution: a frame of the whole picture
//! takes as much longer as it has more pixels. What is shown whole is rendered whole.

mod figures;
mod measure;
mod plots;
mod quality;
mod sets;
mod text;

use std::fs;
use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use tyndall::render::confidence::Options;
use tyndall::scene::Scene;
use tyndall::scene::coloring::{Coloring, Mapping};
use tyndall::scene::light::Lighting;
use tyndall::scene::{automatic, color};
use tyndall::structure::{Kind, Structure, pkd, treelets};
use tyndall::{Error, Particles, synthetic};

use crate::args;
use crate::bench::{forget_peak, peak_bytes, rays};
use crate::report::{Failure, Outcome, Report};
use crate::structure;
use measure::{Culler, Measured, Windows};
use sets::{SETS, Set, cameras};

/// With `bench culling`.
#[derive(Args)]
#[command(next_help_heading = "With culling")]
pub(crate) struct CullingBench {
    /// Short for --fraction 0.1
    #[arg(long, conflicts_with = "fraction")]
    quick: bool,
    /// Share of the particles of each set, above 0
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = share)]
    fraction: f64,
    /// Folder for the report and its pictures
    #[arg(long, value_name = "DIR", default_value = "culling-report")]
    report: PathBuf,
    /// Frames after which a view is taken to have converged
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    frames: u32,
    /// The same for pictures that are rendered whole
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    picture_frames: u32,
    /// Edge in pixels of the windows that are measured; a multiple of 32
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(32..=256))]
    window: u32,
}

impl CullingBench {
    fn fraction(&self) -> f64 {
        if self.quick { 0.1 } else { self.fraction }
    }

    /// The knobs for a share of the particles: as many of them in a voxel as of all.
    fn scaled(&self, options: Options) -> Options {
        let voxel_count = (f64::from(options.voxel_count) * self.fraction().cbrt()).round().max(1.0) as u32;
        Options { voxel_count, ..options }
    }
}

/// Reads a share above 0, at most 1.
fn share(text: &str) -> Result<f64, Error> {
    let number = text.parse().ok().filter(|it: &f64| *it > 0.0 && *it <= 1.0);
    number.ok_or_else(|| Error::setting("--fraction", text, "above 0, at most 1"))
}

/// One set, measured.
struct Evaluated {
    set: &'static Set,
    particles: usize,
    /// Seconds to build, bytes of centers and nodes, millions of coherent rays a second, by structure.
    structures: Vec<(&'static str, f64, u64, f64)>,
    peak_bytes: Option<u64>,
    views: Vec<Measured>,
    /// What other knobs do to one view: what they are, and the view.
    variants: Vec<(String, Measured)>,
    /// File names of figures, with their captions.
    figures: Vec<(String, String)>,
}

/// Measures and writes the report.
pub(crate) fn run(args: &args::Bench, report: &Report) -> Outcome<()> {
    let chosen = chosen(args)?;
    let folder = &args.culling.report;
    fs::create_dir_all(folder).map_err(|error| Failure::Output(Error::io(folder, error)))?;
    plots::load_font();
    let kind = match args.structure.structure {
        Some(_) => structure::kind(&args.structure)?,
        None => Kind::Pkd(pkd::Options::default()),
    };
    let start = Instant::now();
    let mut evaluated = Vec::new();
    for set in chosen {
        evaluated.push(evaluate(set, kind, args, report)?);
        // What is there is written at once: a long run that is stopped leaves a report.
        let written = text::report(&evaluated, kind, args, start.elapsed().as_secs_f64());
        let path = folder.join("report.md");
        fs::write(&path, written).map_err(|error| Failure::Output(Error::io(&path, error)))?;
    }
    report.note(format_args!("{}", folder.join("report.md").display()));
    Ok(())
}

/// The sets that are asked for.
fn chosen(args: &args::Bench) -> Outcome<Vec<&'static Set>> {
    if args.sets.is_empty() {
        return Ok(SETS.iter().collect());
    }
    let find = |name: &String| {
        let found = SETS.iter().find(|set| set.name == name);
        found.ok_or_else(|| {
            let allowed = "nozzle, virion, fluid or ablation with bench culling";
            Failure::from(Error::setting("--sets", name, allowed))
        })
    };
    args.sets.iter().map(find).collect()
}

/// Everything about one set.
fn evaluate(set: &'static Set, kind: Kind, args: &args::Bench, report: &Report) -> Outcome<Evaluated> {
    let count = ((set.count as f64 * args.culling.fraction()) as u64).max(1);
    forget_peak();
    let specification = format!("{}?n={count}", set.name);
    let particles = synthetic::generate(&specification, report.progress())?;
    report.note(format_args!("{}: {} particles", set.name, tyndall::scene::grouped(particles.len())));
    let mut structures = Vec::new();
    // Other structures are asked for rays only; the one that is measured comes last and stays.
    let treelets = Kind::Treelets(treelets::Options::default());
    for other in [Kind::default(), treelets, Kind::Pkd(pkd::Options::default())] {
        if std::mem::discriminant(&other) != std::mem::discriminant(&kind) {
            build(particles.clone(), other, &mut structures, report)?;
        }
    }
    let colors = color::resolve(&particles, &Coloring::default(), &Mapping::default())?;
    let structure = build(particles, kind, &mut structures, report)?;
    let scene = Scene::new(structure, colors, Lighting::Headlight, Some([1.0; 3]));

    let frames = args.culling.frames;
    let cameras = cameras(&scene);
    let windows = cameras.map(|camera| Windows::of(&camera, args.culling.window));
    let mut culler = Culler::new(&scene, &windows[0], args.culling.scaled(set.options), frames)?;
    let mut views = Vec::new();
    for windows in &windows {
        let off = measure::off(&scene, windows, report)?;
        views.push(culler.measure(windows, &off, report)?);
    }
    drop(culler);
    let mut evaluated = Evaluated {
        set,
        particles: scene.structure().len(),
        structures,
        peak_bytes: None,
        views,
        variants: Vec::new(),
        figures: Vec::new(),
    };
    variants(&scene, args, &mut evaluated, report)?;
    figures::draw(&scene, &cameras, args, &mut evaluated, report)?;
    evaluated.peak_bytes = peak_bytes();
    Ok(evaluated)
}

/// Builds a structure, and says how long that took and how fast it answers the rays of the first view.
fn build(
    particles: Particles,
    kind: Kind,
    structures: &mut Vec<(&'static str, f64, u64, f64)>,
    report: &Report,
) -> Outcome<Structure> {
    let (radii, _) = automatic::radii(&particles);
    let start = Instant::now();
    let structure = Structure::build(kind, particles, &radii, 1.0, report.progress())?;
    let build_secs = start.elapsed().as_secs_f64();
    let [first, ..] = sets::cameras_of(structure.bounds(), structure.origin());
    let view = first.view(structure.origin(), sets::EDGE, sets::EDGE)?;
    let rate = rays::rate(&structure, &rays::coherent(&view, sets::EDGE, sets::EDGE));
    structures.push((structure::name(kind), build_secs, structure.bytes(), rate));
    Ok(structure)
}

/// What the knobs of section 6.1 do to the view of figure 6.2, and those of figure 6.3 to its views.
fn variants(scene: &Scene, args: &args::Bench, evaluated: &mut Evaluated, report: &Report) -> Outcome<()> {
    let Some((view, variants)) = sets::variants(evaluated.set) else { return Ok(()) };
    let windows = Windows::of(&cameras(scene)[view], args.culling.window);
    let off = measure::off(scene, &windows, report)?;
    for (name, options) in variants {
        let options = args.culling.scaled(options);
        let mut culler = Culler::new(scene, &windows, options, args.culling.frames)?;
        let measured = culler.measure(&windows, &off, report)?;
        evaluated.variants.push((name, measured));
    }
    Ok(())
}
