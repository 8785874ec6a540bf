//! How fast light is traced in a medium: `photons/<free path>` in emitted photons a second, `transmittance/<how>` in rays a
//! second, `reference` in samples a second. All threads but for `transmittance`; a plume of 128 x 96 x 96 samples, its density
//! rough like that of few particles, optical depth about 7 through its middle, albedo 0.95.

use divan::Bencher;
use divan::counter::ItemsCount;
use tyndall::math::Ray;
use tyndall::medium::light::{Directional, Environment};
use tyndall::medium::{Grid, Light, Medium, Optics, Phase};
use tyndall::random::Stream;
use tyndall::render::medium::free_path::{FreePath, Tracker};
use tyndall::render::medium::photons::{self, Stored, trace};
use tyndall::render::medium::reference::{Reference, Settings};
use tyndall::scene::camera::{Camera, Projection};
use tyndall::{DVec3, Vec3};

fn main() {
    divan::main();
}

const SIZE: [u32; 3] = [128, 96, 96];

fn medium() -> Medium {
    let mut stream = Stream::new(1, 0);
    let mut values = Vec::new();
    for k in 0..SIZE[2] {
        for j in 0..SIZE[1] {
            for i in 0..SIZE[0] {
                let axis = Vec3::new(0.0, 48.0, 48.0 + 20.0 * (0.05 * i as f32).sin());
                let across = Vec3::new(0.0, j as f32, k as f32).distance_squared(axis) / 400.0;
                let rough = 0.5 + stream.unit();
                values.push(if across < 4.0 { rough * (-across).exp() } else { 0.0 });
            }
        }
    }
    let grid = Grid::from_dense(Vec3::ZERO, 1.0 / 128.0, SIZE, &values).expect("a valid grid");
    let optics = Optics { extinction: [24.0; 3], albedo: [0.95; 3], phase: Phase::ISOTROPIC };
    Medium::new(grid, optics).expect("valid optics")
}

fn lights() -> [Light; 2] {
    let along = Vec3::new(0.6, -0.64, -0.48);
    [
        Light::Directional(Directional::new(along, [3.0; 3]).expect("a valid light")),
        Light::Environment(Environment::constant([0.25; 3]).expect("a valid light")),
    ]
}

#[divan::bench(args = ["exact", "delta"], sample_count = 5)]
fn photons(bencher: Bencher, name: &str) {
    let (medium, lights) = (medium(), lights());
    let free_path: FreePath = name.parse().expect("a known name");
    let settings = photons::Settings {
        count: 200_000,
        seed: 1,
        free_path,
        stored: Stored::Multiple,
        memory_bytes: None,
    };
    bencher
        .counter(ItemsCount::new(settings.count))
        .bench(|| trace(&medium, &lights, &settings, &()).expect("nobody interrupts"));
}

#[divan::bench(args = ["exact", "ratio"], sample_count = 5)]
fn transmittance(bencher: Bencher, name: &str) {
    let medium = medium();
    let tracker = Tracker::new(&medium);
    let mut stream = Stream::new(2, 0);
    let bounds = medium.bounds();
    let mut ray = || {
        let at = bounds.min + bounds.extent() * Vec3::new(stream.unit(), stream.unit(), stream.unit());
        Ray { origin: at, direction: stream.direction(), t_min: 0.0, t_max: f32::INFINITY }
    };
    let rays: Vec<Ray> = (0..20_000).map(|_| ray()).collect();
    let bencher = bencher.counter(ItemsCount::new(rays.len()));
    if name == "exact" {
        bencher.bench(|| rays.iter().map(|ray| tracker.transmittance(ray)).sum::<Vec3>());
    } else {
        let mut stream = Stream::new(3, 0);
        bencher.bench_local(|| {
            rays.iter().map(|ray| tracker.ratio_transmittance(ray, &mut stream)).sum::<Vec3>()
        });
    }
}

#[divan::bench(sample_count = 5)]
fn reference(bencher: Bencher) {
    let (medium, lights) = (medium(), lights());
    let camera = Camera {
        eye: DVec3::new(0.5, 0.4, 3.0),
        look_at: DVec3::new(0.5, 0.375, 0.375),
        up: DVec3::Y,
        projection: Projection::Perspective { vertical_angle: 0.4 },
    };
    let settings = Settings { width: 128, height: 96, seed: 1, orders: None, free_path: FreePath::Delta };
    let view = camera.view(DVec3::ZERO, settings.width, settings.height).expect("a valid camera");
    bencher.counter(ItemsCount::new(4 * settings.width * settings.height)).bench(|| {
        let mut reference = Reference::new(&medium, &lights, view, settings).expect("valid settings");
        reference.pass(4, &()).expect("nobody interrupts");
        reference.pixels()
    });
}
