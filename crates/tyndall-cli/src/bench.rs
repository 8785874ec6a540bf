//! `tyndall bench`: the sets and cameras with which other renderers of spheres were measured, as a Markdown table.
//!
//! 800x800 pixels; the unit cube seen from an oblique direction, z up; orthographic of height 1.8, and perspective of 30 degrees
//! from 3.5. One sample: median of 5. Sixteen: median of 3. All samples count, also those that meet nothing.

use std::time::Instant;

use glam::DVec3;
use tyndall::particles::Particles;
use tyndall::render::estimate::Work;
use tyndall::render::{Settings, render};
use tyndall::scene::camera::{Camera, Projection};
use tyndall::scene::color::ParticleColors;
use tyndall::scene::light::Lighting;
use tyndall::scene::{Scene, automatic, grouped};
use tyndall::structure::Structure;
use tyndall::{Progress, synthetic};

use crate::args;
use crate::dry_run::check_memory;
use crate::report::{Outcome, Report, bytes};
use crate::structure;

/// Measures every set at every count.
pub(crate) fn run(args: &args::Bench, report: &Report) -> Outcome<()> {
    let args::BenchWhat::Spheres = args.what;
    report.note(format_args!(
        "tyndall {}, {} threads",
        env!("CARGO_PKG_VERSION"),
        rayon::current_num_threads()
    ));
    let mut table = Table::new();
    for &count in &args.n {
        for set in &args.sets {
            let specification = format!("{set}?n={count}&seed=1");
            let size = Settings { width: args.size.width, height: args.size.height, samples: 1, seed: 0 };
            let work = Work::of_count(count, structure::kind(&args.structure)?, size);
            check_memory(&work, work.memory_bytes(), None)?;
            let particles = synthetic::generate(&specification, report.progress())?;
            let rows = measure(set, particles, args, report)?;
            rows.into_iter().for_each(|row| table.add(row));
        }
    }
    report.out(&table.text())?;
    match peak_bytes() {
        Some(peak) => report.out(&format!("\nPeak memory of the process: {}.\n", bytes(peak))),
        None => Ok(()),
    }
}

/// Builds once, then renders with each camera and light.
fn measure(set: &str, particles: Particles, args: &args::Bench, report: &Report) -> Outcome<Vec<Row>> {
    let (radii, _) = automatic::radii(&particles);
    let count = particles.len();
    let start = Instant::now();
    let structure =
        Structure::build(structure::kind(&args.structure)?, particles, &radii, 1.0, report.progress())?;
    let build_secs = start.elapsed().as_secs_f64();
    let bytes_per_particle = structure.bytes() as f64 / count.max(1) as f64;
    let colors = ParticleColors::constant([0.7; 3]);
    let mut scene = Scene::new(structure, colors, Lighting::Headlight, Some([1.0; 3]));
    let mut rows = Vec::new();
    for (name, projection) in PROJECTIONS {
        let camera = camera(projection);
        let view = camera.view(scene.structure().origin(), args.size.width, args.size.height)?;
        let studio = Lighting::studio(view.forward, view.right, view.up);
        let mut times = [0.0; 3];
        for (slot, (lighting, samples, runs)) in
            times.iter_mut().zip([(Lighting::Headlight, 1, 5), (Lighting::Headlight, 16, 3), (studio, 16, 3)])
        {
            scene.lighting = lighting;
            *slot = {
                let settings =
                    Settings { width: args.size.width, height: args.size.height, samples, seed: 0 };
                median_secs(&scene, &camera, &settings, runs, report.progress())?
            };
        }
        let pixels = f64::from(args.size.width) * f64::from(args.size.height);
        rows.push(Row {
            set: set.into(),
            count,
            camera: name,
            build_secs,
            bytes_per_particle,
            times,
            pixels,
        });
    }
    Ok(rows)
}

const PROJECTIONS: [(&str, Projection); 2] = [
    ("orthographic", Projection::Orthographic { height: 1.8 }),
    ("perspective", Projection::Perspective { vertical_angle: std::f64::consts::PI / 6.0 }),
];

fn camera(projection: Projection) -> Camera {
    let look_at = DVec3::splat(0.5);
    let eye = look_at + 3.5 * DVec3::new(0.80, 0.55, 0.45).normalize();
    Camera { eye, look_at, up: DVec3::Z, projection }
}

fn median_secs(
    scene: &Scene,
    camera: &Camera,
    settings: &Settings,
    runs: usize,
    progress: &dyn Progress,
) -> Outcome<f64> {
    let mut times = Vec::with_capacity(runs);
    for _ in 0..runs {
        let start = Instant::now();
        render(scene, camera, settings, progress)?;
        times.push(start.elapsed().as_secs_f64());
    }
    times.sort_by(f64::total_cmp);
    Ok(times[runs / 2])
}

/// One line of the table. Times are those of 1 sample and of 16 by headlight, and of 16 in the default look.
struct Row {
    set: String,
    count: usize,
    camera: &'static str,
    build_secs: f64,
    bytes_per_particle: f64,
    times: [f64; 3],
    pixels: f64,
}

/// Cells, aligned when printed.
struct Table {
    rows: Vec<Vec<String>>,
}

impl Table {
    fn new() -> Self {
        let head = [
            "set",
            "particles",
            "camera",
            "build s",
            "B/particle",
            "1 sample ms",
            "16 samples ms",
            "Msamples/s",
            "default look 16 ms",
            "Msamples/s",
        ];
        Self { rows: vec![head.map(String::from).to_vec()] }
    }

    fn add(&mut self, row: Row) {
        let million_samples = 16e-6 * row.pixels;
        let [one, sixteen, look] = row.times;
        let millis = |secs: f64| format!("{:.1}", 1e3 * secs);
        let rate = |secs: f64| format!("{:.1}", million_samples / secs);
        let (build, size) = (format!("{:.2}", row.build_secs), format!("{:.1}", row.bytes_per_particle));
        let (count, camera) = (grouped(row.count), row.camera.to_string());
        let times = [millis(one), millis(sixteen), rate(sixteen), millis(look), rate(look)];
        self.rows.push([row.set, count, camera, build, size].into_iter().chain(times).collect());
    }

    /// Markdown: words to the left, numbers to the right.
    fn text(&self) -> String {
        let columns = self.rows[0].len();
        let width =
            |column: usize| self.rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
        let is_word = |column: usize| column == 0 || column == 2;
        let mut text = String::new();
        for (place, row) in self.rows.iter().enumerate() {
            for (column, cell) in row.iter().enumerate() {
                let width = width(column);
                text += &if is_word(column) {
                    format!("| {cell:<width$} ")
                } else {
                    format!("| {cell:>width$} ")
                };
            }
            text += "|\n";
            if place == 0 {
                for column in 0..columns {
                    let end = if is_word(column) { '-' } else { ':' };
                    text += &format!("|{}{end}", "-".repeat(width(column) + 1));
                }
                text += "|\n";
            }
        }
        text
    }
}

/// The most memory that the process has had, where the system tells.
fn peak_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? * 1024)
}
