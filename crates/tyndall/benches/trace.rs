//! How fast pictures are traced: `trace/<what>/<law>`, in samples (or rays) a second; 400 x 400 pixels, all threads.

mod cube;

use divan::Bencher;
use divan::counter::ItemsCount;
use glam::DQuat;
use tyndall::math::Ray;
use tyndall::render::{Culling, Interactive, Settings, render};
use tyndall::scene::camera::Projection;
use tyndall::structure::{Kind, Structure, pkd};
use tyndall::{DVec3, synthetic};

use cube::{Look, ORTHOGRAPHIC, PERSPECTIVE};

fn main() {
    divan::main();
}

const LAWS: [&str; 3] = ["packed?n=1e6", "uniform?n=1e6", "clustered?n=1e6"];
const EDGE: u32 = 400;

/// What is drawn, beside the particles.
struct Picture {
    kind: Kind,
    projection: Projection,
    look: Look,
    samples: u32,
}

fn structure(law: &str, kind: Kind) -> Structure {
    cube::arranged(synthetic::generate(law, &()).expect("a known law"), kind)
}

fn picture(bencher: Bencher, law: &str, picture: Picture) {
    let camera = cube::camera(picture.projection);
    let scene = cube::scene(structure(law, picture.kind), &camera, picture.look);
    let settings =
        Settings { width: EDGE, height: EDGE, samples: picture.samples, seed: 1, culling: Culling::Off };
    bencher
        .counter(ItemsCount::new((EDGE * EDGE * picture.samples) as usize))
        .bench(|| render(&scene, &camera, &settings, &()).expect("valid settings"));
}

#[divan::bench(args = LAWS, sample_count = 10)]
fn tiles_orthographic_1(bencher: Bencher, law: &str) {
    let (projection, look) = (ORTHOGRAPHIC, Look::Headlight);
    picture(bencher, law, Picture { kind: Kind::default(), projection, look, samples: 1 });
}

#[divan::bench(args = LAWS, sample_count = 10)]
fn tiles_orthographic_16(bencher: Bencher, law: &str) {
    let (projection, look) = (ORTHOGRAPHIC, Look::Headlight);
    picture(bencher, law, Picture { kind: Kind::default(), projection, look, samples: 16 });
}

#[divan::bench(args = LAWS, sample_count = 10)]
fn tiles_perspective_16(bencher: Bencher, law: &str) {
    let (projection, look) = (PERSPECTIVE, Look::Headlight);
    picture(bencher, law, Picture { kind: Kind::default(), projection, look, samples: 16 });
}

#[divan::bench(args = LAWS, sample_count = 5)]
fn default_look_16(bencher: Bencher, law: &str) {
    let (projection, look) = (PERSPECTIVE, Look::Studio);
    picture(bencher, law, Picture { kind: Kind::default(), projection, look, samples: 16 });
}

#[divan::bench(args = LAWS, sample_count = 5)]
fn pkd_rays_1(bencher: Bencher, law: &str) {
    let (projection, look) = (PERSPECTIVE, Look::Headlight);
    picture(bencher, law, Picture { kind: Kind::Pkd(pkd::Options::default()), projection, look, samples: 1 });
}

/// Pictures of a resident scene in a turn around it, one sample a pixel, headlight: items are frames.
#[divan::bench(args = ["packed?n=1e6", "packed?n=1e7", "uniform?n=1e6", "uniform?n=1e7", "clustered?n=1e6", "clustered?n=1e7"], sample_count = 60)]
fn orbit_800x800(bencher: Bencher, law: &str) {
    let mut camera = cube::camera(PERSPECTIVE);
    let scene = cube::scene(structure(law, Kind::default()), &camera, Look::Headlight);
    let settings = Settings { width: 800, height: 800, samples: 1, seed: 1, culling: Culling::default() };
    let mut interactive = Interactive::new(scene, camera, settings).expect("valid settings");
    bencher.counter(ItemsCount::new(1_u32)).bench_local(|| {
        let turned = DQuat::from_rotation_z(6_f64.to_radians()) * (camera.eye - camera.look_at);
        camera.eye = camera.look_at + turned;
        interactive.look_from(camera).expect("a valid camera");
        interactive.refine(&()).expect("nothing fails")
    });
}

/// Single rays through the hierarchy, on one thread, one beside the other as in picking.
#[divan::bench(args = LAWS, sample_count = 10)]
fn bvh_rays(bencher: Bencher, law: &str) {
    let view = cube::camera(PERSPECTIVE).view(DVec3::ZERO, EDGE, EDGE).expect("a valid camera");
    let ray = |at: u32| view.ray((at % 100 * 4) as f32 + 0.5, (at / 100 * 4) as f32 + 0.5);
    single_rays(bencher, law, &(0..10_000).map(ray).collect::<Vec<_>>());
}

/// The same with rays that share nothing, as light is scattered.
#[divan::bench(args = LAWS, sample_count = 10)]
fn bvh_incoherent_rays(bencher: Bencher, law: &str) {
    single_rays(bencher, law, &cube::incoherent_rays(100_000));
}

fn single_rays(bencher: Bencher, law: &str, rays: &[Ray]) {
    let structure = structure(law, Kind::default());
    bencher
        .counter(ItemsCount::new(rays.len()))
        .bench(|| rays.iter().filter(|ray| structure.intersect(ray, None).is_some()).count());
}
