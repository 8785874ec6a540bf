//! The density's part of `tyndall bench medium`: the tables of Cha, Son and Ihm 2009 with ours beside them, as Markdown.
//!
//! Takes particles in the box of the paper's smoke (20.48 x 16.32 x 16.96), as `synthetic:smoke` makes them; other particles are
//! measured on the same lattices and lengths, and cannot be compared with the paper. A time is that of the whole estimate, from
//! particles to grid, sorting included, like the paper's; the median of three.

use std::time::Instant;

use tyndall::medium::density::{Resolution, Settings, Smoothing, Volume, Weight, estimate};
use tyndall::medium::grid::Lattice;
use tyndall::{Particles, Progress, Vec3};

use crate::report::{Outcome, Report, bytes};

/// The paper's grids, by samples; both span 20.48 along x.
const GRIDS: [[u32; 3]; 2] = [[129, 103, 107], [257, 206, 213]];
const BOX_X: f32 = 20.48;
/// Runs of which the median counts.
const RUNS: usize = 3;

/// A grid, h0, and the paper's seconds on a GTX 280 for uniform, two-pass and three-pass.
const PAPER_SECS: [(usize, f32, [f64; 3]); 3] =
    [(0, 0.96, [0.53, 0.92, 1.20]), (1, 0.96, [1.84, 3.55, 4.66]), (1, 1.44, [4.53, 7.47, 9.98])];
/// h0 and the paper's mean and deviation of the particles used by uniform lengths.
const PAPER_UNIFORM: [(f32, f64, f64); 4] =
    [(0.24, 11.08, 15.42), (0.48, 74.37, 55.50), (0.96, 447.49, 250.21), (1.44, 1282.80, 667.91)];
/// h0, N*, and the same of two-pass and three-pass lengths.
const PAPER_ADAPTIVE: [(f32, u32, [[f64; 2]; 2]); 4] = [
    (0.96, 32, [[61.32, 30.65], [33.05, 10.14]]),
    (0.96, 64, [[98.14, 41.47], [62.21, 12.22]]),
    (1.44, 32, [[80.21, 41.25], [34.65, 8.51]]),
    (1.44, 64, [[136.66, 59.76], [67.00, 13.03]]),
];

/// Measures densities of `particles` and prints the tables.
pub(crate) fn run(particles: &Particles, report: &Report) -> Outcome<()> {
    run_times(particles, report)?;
    particles_used(particles, report)?;
    more_passes(particles, report)?;
    lengths_of_neighbors(particles, report)
}

/// Settings on one of the paper's grids.
fn settings(grid: usize, smoothing: Smoothing, length: f32, neighbors: u32) -> Settings {
    let size = GRIDS[grid];
    let lattice = Lattice { origin: Vec3::ZERO, spacing: BOX_X / (size[0] - 1) as f32, size };
    Settings {
        smoothing,
        length: Some(length),
        neighbors,
        weight: Weight::One,
        resolution: Resolution::Lattice(lattice),
        ..Settings::default()
    }
}

fn run_times(particles: &Particles, report: &Report) -> Outcome<()> {
    let smoothings = [Smoothing::Uniform, Smoothing::TwoPass, Smoothing::ThreePass];
    let mut text = String::from(
        "| grid | h0 | uniform s | two-pass s | three-pass s | the paper's GPU, s |\n|---|---|---|---|---|---|\n",
    );
    for (grid, length, paper) in PAPER_SECS {
        let [x, y, z] = GRIDS[grid];
        text += &format!("| {x}x{y}x{z} | {length} ");
        for smoothing in smoothings {
            let (secs, _) = median(particles, &settings(grid, smoothing, length, 32), report.progress())?;
            text += &format!("| {secs:.2} ");
        }
        let [uniform, two, three] = paper;
        text += &format!("| {uniform}, {two}, {three} |\n");
    }
    report.out(&text)
}

fn particles_used(particles: &Particles, report: &Report) -> Outcome<()> {
    let mut text = String::from(
        "\n| smoothing | h0 | N* | N0 > 0: mean, deviation, ratio | N0 >= N*: mean, deviation, ratio | the paper's |\n|---|---|---|---|---|---|\n",
    );
    let mut row =
        |smoothing: Smoothing, length: f32, neighbors: u32, paper: Option<[f64; 2]>| -> Outcome<()> {
            let used = estimate(particles, &settings(1, smoothing, length, neighbors), report.progress())?
                .statistics;
            let numbers =
                |mean: f64, deviation: f64| format!("{mean:.2}, {deviation:.2}, {:.2}", deviation / mean);
            let name = Smoothing::NAMES.iter().find(|it| it.1 == smoothing).map_or("", |it| it.0);
            let [touched, full] = [used.touched, used.full].map(|it| numbers(it.mean(), it.deviation()));
            let paper = paper.map_or(String::new(), |it| numbers(it[0], it[1]));
            text += &match smoothing {
                Smoothing::Uniform => format!("| {name} | {length} | | {touched} | | {paper} |\n"),
                _ => format!("| {name} | {length} | {neighbors} | {touched} | {full} | {paper} |\n"),
            };
            Ok(())
        };
    for (length, mean, deviation) in PAPER_UNIFORM {
        row(Smoothing::Uniform, length, 1, Some([mean, deviation]))?;
    }
    for (length, neighbors, [two, three]) in PAPER_ADAPTIVE {
        row(Smoothing::TwoPass, length, neighbors, Some(two))?;
        row(Smoothing::ThreePass, length, neighbors, Some(three))?;
        row(Smoothing::Exact, length, neighbors, None)?;
    }
    report.out(&text)
}

fn more_passes(particles: &Particles, report: &Report) -> Outcome<()> {
    let mut text = String::from(
        "\n| passes | h0 0.96, N* 32: s | N0 >= N*: mean, ratio | h0 1.44, N* 32: s | N0 >= N*: mean, ratio |\n|---|---|---|---|---|\n",
    );
    for further_passes in 0..5 {
        text += &format!("| {} ", 3 + further_passes);
        for length in [0.96, 1.44] {
            let settings = Settings { further_passes, ..settings(1, Smoothing::ThreePass, length, 32) };
            let (secs, volume) = median(particles, &settings, report.progress())?;
            let used = volume.statistics.full;
            text += &format!("| {secs:.2} | {:.2}, {:.3} ", used.mean(), used.ratio());
        }
        text += "|\n";
    }
    report.out(&text)
}

/// What other programs do: the exact distance of the 32nd neighbor at each sample, and at each particle.
fn lengths_of_neighbors(particles: &Particles, report: &Report) -> Outcome<()> {
    let mut text = String::from(
        "\n| smoothing, N* 32 | grid | s | mass on the grid over mass | memory at most |\n|---|---|---|---|---|\n",
    );
    for (name, smoothing) in [("exact, h0 1.44", Smoothing::Exact), ("scatter", Smoothing::Scatter)] {
        for (grid, [x, y, z]) in GRIDS.into_iter().enumerate() {
            let (secs, volume) = median(particles, &settings(grid, smoothing, 1.44, 32), report.progress())?;
            let mass = volume.density.mass() / particles.len() as f64;
            let peak = bytes(volume.peak_bytes);
            text += &format!("| {name} | {x}x{y}x{z} | {secs:.2} | {mass:.5} | {peak} |\n");
        }
    }
    report.out(&text)
}

/// The median time of some runs, and the last run's volume.
fn median(particles: &Particles, settings: &Settings, progress: &dyn Progress) -> Outcome<(f64, Volume)> {
    let mut runs = Vec::with_capacity(RUNS);
    for _ in 0..RUNS {
        let start = Instant::now();
        let volume = estimate(particles, settings, progress)?;
        runs.push((start.elapsed().as_secs_f64(), volume));
    }
    runs.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(runs.swap_remove(RUNS / 2))
}
