//! How fast pictures are traced: `trace/<what>/<law>`, in samples (or rays) a second; 400 x 400 pixels, all threads.

use divan::Bencher;
use divan::counter::ItemsCount;
use tyndall::math::Ray;
use tyndall::render::{Settings, render};
use tyndall::scene::Scene;
use tyndall::scene::camera::{Camera, Projection};
use tyndall::scene::color::ParticleColors;
use tyndall::scene::light::Lighting;
use tyndall::structure::{Kind, Structure, pkd};
use tyndall::{DVec3, synthetic};

fn main() {
    divan::main();
}

const LAWS: [&str; 3] = ["packed?n=1e6", "uniform?n=1e6", "clustered?n=1e6"];
const EDGE: u32 = 400;

fn structure(law: &str, kind: Kind) -> Structure {
    let particles = synthetic::generate(law, &()).expect("a known law");
    let radii = particles.radii().expect("synthetic particles have a radius").clone();
    Structure::build(kind, particles, &radii, 1.0, &()).expect("nobody interrupts")
}

/// The unit cube from an oblique direction.
fn camera(perspective: bool) -> Camera {
    let look_at = DVec3::splat(0.5);
    let projection = if perspective {
        Projection::Perspective { vertical_angle: 30_f64.to_radians() }
    } else {
        Projection::Orthographic { height: 1.8 }
    };
    let eye = look_at + 3.5 * DVec3::new(0.80, 0.55, 0.45).normalize();
    Camera { eye, look_at, up: DVec3::Z, projection }
}

fn picture(bencher: Bencher, law: &str, kind: Kind, perspective: bool, studio: bool, samples: u32) {
    let camera = camera(perspective);
    let view = camera.view(DVec3::ZERO, EDGE, EDGE).expect("a valid camera");
    let lighting =
        if studio { Lighting::studio(view.forward, view.right, view.up) } else { Lighting::Headlight };
    let scene = Scene::new(structure(law, kind), ParticleColors::constant([0.8; 3]), lighting, None);
    let settings = Settings { width: EDGE, height: EDGE, samples, seed: 1 };
    bencher
        .counter(ItemsCount::new((EDGE * EDGE * samples) as usize))
        .bench(|| render(&scene, &camera, &settings, &()).expect("valid settings"));
}

#[divan::bench(args = LAWS, sample_count = 10)]
fn tiles_orthographic_1(bencher: Bencher, law: &str) {
    picture(bencher, law, Kind::default(), false, false, 1);
}

#[divan::bench(args = LAWS, sample_count = 10)]
fn tiles_orthographic_16(bencher: Bencher, law: &str) {
    picture(bencher, law, Kind::default(), false, false, 16);
}

#[divan::bench(args = LAWS, sample_count = 10)]
fn tiles_perspective_16(bencher: Bencher, law: &str) {
    picture(bencher, law, Kind::default(), true, false, 16);
}

#[divan::bench(args = LAWS, sample_count = 5)]
fn default_look_16(bencher: Bencher, law: &str) {
    picture(bencher, law, Kind::default(), true, true, 16);
}

#[divan::bench(args = LAWS, sample_count = 5)]
fn pkd_rays_1(bencher: Bencher, law: &str) {
    picture(bencher, law, Kind::Pkd(pkd::Options::default()), true, false, 1);
}

/// Single rays through the hierarchy, on one thread, as picking and incoherent light need them.
#[divan::bench(args = LAWS, sample_count = 10)]
fn bvh_rays(bencher: Bencher, law: &str) {
    let structure = structure(law, Kind::default());
    let view = camera(true).view(DVec3::ZERO, EDGE, EDGE).expect("a valid camera");
    let ray = |at: u32| view.ray((at % 100 * 4) as f32 + 0.5, (at / 100 * 4) as f32 + 0.5);
    let rays: Vec<Ray> = (0..10_000).map(ray).collect();
    bencher
        .counter(ItemsCount::new(rays.len()))
        .bench(|| rays.iter().filter(|ray| structure.intersect(ray, None).is_some()).count());
}
