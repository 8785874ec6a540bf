//! Certified culling beside none: `cargo bench -p tyndall --bench certified -- SET?n=COUNT ...` prints a Markdown table.
//!
//! 800 x 800 pixels, three views (along an axis, a diagonal, oblique), alternating projections. Pictures with and without are made in
//! turn in the same memory; a time is the median of three pairs after a first one. A ratio below 1 means that certified is faster. `kept` is a
//! picture whose samples are kept beside one that is colored and lit anew from them.

use std::time::Instant;

use tyndall::render::certified::{Counts, Options};
use tyndall::render::{Culling, Renderer, Settings};
use tyndall::scene::camera::{Camera, Projection};
use tyndall::scene::color::ParticleColors;
use tyndall::scene::light::Lighting;
use tyndall::scene::{Scene, automatic};
use tyndall::structure::{Kind, Structure, pkd};
use tyndall::{DVec3, Image, synthetic};

const VIEWS: [DVec3; 3] = [DVec3::X, DVec3::ONE, DVec3::new(0.8, 0.55, 0.45)];
const EDGE: u32 = 800;
const ROUNDS: usize = 3;

fn main() {
    println!(
        "| set | view | picture | off ms | certified ms | ratio | surely lit, surely shadowed, traced % |"
    );
    println!("|---|---|---|---|---|---|---|");
    for set in std::env::args().skip(1).filter(|argument| !argument.starts_with("--")) {
        measure(&set);
    }
}

/// Prints the rows of a set.
fn measure(set: &str) {
    let build = |kind| {
        let particles = synthetic::generate(set, &()).expect("a set that there is");
        let (radii, _) = automatic::radii(&particles);
        let bounds = particles.bounds();
        let look_at = particles.positions().origin() + bounds.center().as_dvec3();
        let structure = Structure::build(kind, particles, &radii, 1.0, &()).expect("not interrupted");
        let colors = ParticleColors::constant([0.7; 3]);
        let scene = Scene::new(structure, colors, Lighting::Headlight, Some([1.0; 3]));
        (scene, look_at, f64::from(bounds.extent().length()))
    };
    let (mut scene, look_at, size) = build(Kind::default());
    for (at, direction) in VIEWS.into_iter().enumerate() {
        let camera = camera(at, direction, look_at, size);
        let view = camera.view(scene.structure().origin(), EDGE, EDGE).expect("a valid camera");
        let studio = Lighting::studio(view.forward, view.right, view.up);
        for (name, lighting, samples) in [
            ("headlight, 16", Lighting::Headlight, 16),
            ("headlight, 64", Lighting::Headlight, 64),
            ("default look, 16", studio.clone(), 16),
            ("default look, 64", studio, 64),
        ] {
            scene.lighting = lighting;
            let [off, certified, ratio] = pair(&scene, &camera, samples);
            let counts = counts(&scene, &camera, samples, Options::default());
            let percent = |count: u64| 100.0 * count as f64 / counts.light_points.max(1) as f64;
            let lit = counts.light_points.saturating_sub(counts.surely_shadowed + counts.traced);
            println!(
                "| {set} | {at} | {name} | {off:.1} | {certified:.1} | {ratio:.3} | {:.2}, {:.2}, {:.4} |",
                percent(lit),
                percent(counts.surely_shadowed),
                percent(counts.traced),
            );
        }
        scene.lighting = Lighting::Headlight;
        let [made, anew] = anew(&scene, &camera);
        println!("| {set} | {at} | headlight, 16, kept | {made:.1} | {anew:.1} | {:.3} | |", anew / made);
        let coverage = Options { coverage: true, ..Options::default() };
        let counts = counts(&scene, &camera, 64, coverage);
        let percent = 100.0 * counts.evicted_leaves as f64 / counts.leaves.max(1) as f64;
        println!(
            "| {set} | {at} | coverage | | | | {percent:.1} % of leaves, {} of {} bricks evicted |",
            counts.evicted_bricks, counts.bricks
        );
    }
    drop(scene);
    let (scene, look_at, size) = build(Kind::Pkd(pkd::Options::default()));
    let camera = camera(2, VIEWS[2], look_at, size);
    let [off, certified, ratio] = pair(&scene, &camera, 16);
    println!("| {set} | 2 | pkd, headlight, 16 | {off:.1} | {certified:.1} | {ratio:.3} | |");
}

fn camera(at: usize, direction: DVec3, look_at: DVec3, size: f64) -> Camera {
    let eye = look_at + direction.normalize() * (2.0 * size);
    let projection = match at % 2 {
        0 => Projection::Orthographic { height: size },
        _ => Projection::Perspective { vertical_angle: 0.5 },
    };
    Camera { eye, look_at, up: DVec3::Z, projection }
}

fn settings(samples: u32, culling: Culling) -> Settings {
    Settings { width: EDGE, height: EDGE, samples, seed: 0, culling }
}

/// Milliseconds without and with, and the median ratio of pairs.
fn pair(scene: &Scene, camera: &Camera, samples: u32) -> [f64; 3] {
    let mut renderers = [Culling::Off, Culling::default()]
        .map(|culling| Renderer::new(scene, camera, &settings(samples, culling)).expect("valid settings"));
    let mut image = Image::default();
    let mut pairs = Vec::new();
    for _ in 0..=ROUNDS {
        pairs.push(renderers.each_mut().map(|renderer| {
            let start = Instant::now();
            renderer.restart(camera).expect("the same camera");
            renderer.finish(&()).expect("not interrupted");
            renderer.image_into(&mut image);
            1e3 * start.elapsed().as_secs_f64()
        }));
    }
    // The first ones have to get their memory.
    pairs.remove(0);
    let median = |of: fn(&[f64; 2]) -> f64| {
        let mut values: Vec<f64> = pairs.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    [median(|pair| pair[0]), median(|pair| pair[1]), median(|pair| pair[1] / pair[0])]
}

/// Milliseconds of a picture whose samples are kept, and of the same colored and lit anew from them: medians.
fn anew(scene: &Scene, camera: &Camera) -> [f64; 2] {
    let mut times = [Vec::new(), Vec::new()];
    for _ in 0..=ROUNDS {
        let renderer =
            Renderer::new(scene, camera, &settings(16, Culling::default())).expect("valid settings");
        let mut renderer = renderer.keeping_samples();
        let start = Instant::now();
        renderer.finish(&()).expect("not interrupted");
        times[0].push(1e3 * start.elapsed().as_secs_f64());
        let samples = renderer.into_samples().expect("they are kept");
        let start = Instant::now();
        samples.image(scene, &()).expect("the same scene");
        times[1].push(1e3 * start.elapsed().as_secs_f64());
    }
    times.map(|mut times| {
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    })
}

fn counts(scene: &Scene, camera: &Camera, samples: u32, options: Options) -> Counts {
    let settings = settings(samples, Culling::Certified(options));
    let mut renderer = Renderer::new(scene, camera, &settings).expect("valid settings");
    renderer.finish(&()).expect("not interrupted");
    renderer.counts()
}
