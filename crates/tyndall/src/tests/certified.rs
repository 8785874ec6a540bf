//! Certified culling changes no bit of any picture, whichever of its proofs are sought.

use super::scenes::{LAWS, Law, Random, camera, particles};
use super::visibility::{differing_pixels, image, scene};
use crate::particles::{Attribute, Columns, Particles, Positions, Radii, Values};
use crate::render::certified::Options;
use crate::render::{Culling, Renderer, Settings};
use crate::scene::Scene;
use crate::scene::automatic;
use crate::scene::camera::{Camera, Projection};
use crate::scene::color::ParticleColors;
use crate::scene::light::Lighting;
use crate::structure::{Kind, Packing, Structure, pkd, treelets};
use crate::synthetic;
use fearless_simd::Level;
use glam::{DVec3, Vec3};

/// Every proof alone, those that are sought by default, and all.
fn proofs() -> Vec<Options> {
    let alone = [
        |options: &mut Options| options.clip = true,
        |options: &mut Options| options.visible_set = true,
        |options: &mut Options| options.coverage = true,
        |options: &mut Options| options.light_bounds = true,
    ];
    let alone = alone.map(|set| {
        let mut options = Options::OFF;
        set(&mut options);
        options
    });
    let all = Options { clip: true, visible_set: true, coverage: true, light_bounds: true };
    alone.into_iter().chain([Options::default(), all]).collect()
}

const KINDS: [Kind; 5] = [
    Kind::Bvh(Packing::Exact),
    Kind::Bvh(Packing::Bits11),
    Kind::Pkd(pkd::Options { axis: pkd::Axis::WidestExtent, order: pkd::Order::NodeFirst }),
    Kind::Pkd(pkd::Options { axis: pkd::Axis::RoundRobin, order: pkd::Order::NearChildFirst }),
    Kind::Treelets(treelets::Options {
        size: 16,
        cut: treelets::Cut::Middle,
        heap: pkd::Options { axis: pkd::Axis::WidestExtent, order: pkd::Order::NodeFirst },
    }),
];

/// The picture without and with each of the proofs must be the same; says how many pixels met something.
fn compare(scene: &Scene, camera: &Camera, settings: &Settings, what: &str) -> usize {
    let picture = |culling| image(scene, camera, &Settings { culling, ..*settings }, Level::new());
    let off = picture(Culling::Off);
    for options in proofs() {
        let certified = picture(Culling::Certified(options));
        assert_eq!(differing_pixels(&off, &certified), 0, "{what}, {options:?}");
    }
    off.id.iter().filter(|&&id| id >= 0).count()
}

#[test]
fn no_sample_differs_on_random_scenes() {
    let mut met = 0;
    for seed in 0..64 {
        let mut random = Random::new(11_000 + seed);
        let law = LAWS[seed as usize % LAWS.len()];
        let kind = KINDS[random.below(KINDS.len() as u32) as usize];
        let most = if matches!(kind, Kind::Bvh(_)) { 3000 } else { 150 };
        let count = [1, 2, 17, 100, most][random.below(5) as usize];
        let (particles, radii) = particles(law, count, &mut random);
        let camera = camera(&particles.bounds(), &mut random);
        let samples = [1, 5, 20, 36][random.below(4) as usize];
        let settings = Settings { width: 39, height: 21, samples, seed: seed as u32, ..Settings::default() };
        let lighting = match random.below(3) {
            0 => Lighting::Headlight,
            _ => Lighting::studio(random.vector().normalize_or(Vec3::X), Vec3::NEG_Y, Vec3::Z),
        };
        let scene = scene(&particles, &radii, kind, lighting);
        met += compare(&scene, &camera, &settings, &format!("seed {seed}: {law:?}, {count}, {kind:?}"));
    }
    assert!(met > 5000, "only {met} pixels met a particle: the scenes test nothing");
}

/// Where the eye is: along an axis, along a diagonal, and obliquely.
const VIEWS: [DVec3; 3] = [DVec3::X, DVec3::ONE, DVec3::new(0.8, 0.55, 0.45)];

/// Cameras of both projections that show a whole cloud.
fn cameras(particles: &Particles) -> impl Iterator<Item = Camera> {
    let bounds = particles.bounds();
    let look_at = particles.positions().origin() + bounds.center().as_dvec3();
    let size = f64::from(bounds.extent().length());
    VIEWS.into_iter().enumerate().map(move |(at, direction)| {
        let eye = look_at + direction.normalize() * (1.6 * size);
        let projection = match at % 2 {
            0 => Projection::Perspective { vertical_angle: 0.6 },
            _ => Projection::Orthographic { height: size },
        };
        Camera { eye, look_at, up: DVec3::Z, projection }
    })
}

#[test]
fn no_sample_differs_on_the_synthetic_sets() {
    let sets = ["packed", "uniform", "clustered", "ablation", "virion", "nozzle", "fluid"];
    for set in sets {
        let particles = synthetic::generate(&format!("{set}?n=8000&seed=3"), &()).unwrap();
        let (radii, _) = automatic::radii(&particles);
        // So few particles of a cluster or a spray would be seen by few rays.
        let scale = if matches!(set, "clustered" | "nozzle") { 20.0 } else { 1.0 };
        let mut met = 0;
        for (at, camera) in cameras(&particles).enumerate() {
            let settings = Settings { width: 50, height: 36, samples: 20, seed: 1, ..Settings::default() };
            let view = camera.view(particles.positions().origin(), 50, 36).unwrap();
            let lighting = Lighting::studio(view.forward, view.right, view.up);
            let kind = KINDS[[0, 2, 1][at]];
            let structure = Structure::build(kind, particles.clone(), &radii, scale, &()).unwrap();
            let scene = Scene::new(structure, ParticleColors::constant([0.6; 3]), lighting, None);
            met += compare(&scene, &camera, &settings, &format!("{set}, view {at}, {kind:?}"));
        }
        assert!(met > 150, "{set}: {met} pixels met something");
    }
}

/// A wall of a lattice, from which thin rows of small particles stick out toward the eye, and one giant.
fn spikes() -> (Particles, Radii) {
    let mut columns: [Vec<f32>; 3] = Default::default();
    let mut radii = Vec::new();
    let mut add = |center: [f32; 3], radius: f32| {
        for (column, at) in columns.iter_mut().zip(center) {
            column.push(at);
        }
        radii.push(radius);
    };
    for y in 0..20 {
        for z in 0..20 {
            add([0.0, y as f32, z as f32], 0.5);
            add([-1.0, y as f32, z as f32], 0.5);
        }
    }
    for spike in 0..12 {
        let (y, z) = ((spike * 7 % 20) as f32, (spike * 11 % 20) as f32);
        for step in 0..40 {
            add([0.5 + 0.25 * step as f32, y, z], 0.02);
        }
    }
    add([-12.0, 10.0, 10.0], 8.0);
    let attributes = vec![Attribute::new("radius", 1, Values::F32(radii))];
    let positions = Positions::from_offsets(DVec3::ZERO, columns);
    let particles = Particles::new(Columns { positions, attributes, ..Columns::default() }).unwrap();
    (particles, Radii::PerParticle { attribute: 0, scale: 1.0 })
}

#[test]
fn no_sample_differs_on_spikes_and_a_lattice_seen_along_its_rows() {
    let (particles, radii) = spikes();
    for kind in KINDS {
        for camera in cameras(&particles) {
            let settings = Settings { width: 36, height: 36, samples: 20, seed: 4, ..Settings::default() };
            let scene = scene(&particles, &radii, kind, Lighting::studio(-Vec3::X, Vec3::Y, Vec3::Z));
            let met = compare(&scene, &camera, &settings, &format!("{kind:?}, {camera:?}"));
            assert!(met > 100, "{met} pixels met something");
        }
    }
}

#[test]
fn passes_after_the_first_know_the_leaves_of_the_first() {
    let mut random = Random::new(6);
    let (particles, radii) = particles(Law::Uniform, 3000, &mut random);
    let camera = camera(&particles.bounds(), &mut random);
    let scene = scene(&particles, &radii, Kind::default(), Lighting::Headlight);
    let remembered = |samples, options| {
        let culling = Culling::Certified(options);
        let settings = Settings { width: 64, height: 64, samples, seed: 0, culling };
        let mut renderer = Renderer::new(&scene, &camera, &settings).unwrap();
        renderer.finish(&()).unwrap();
        renderer.counts().remembered_leaves
    };
    let [one_pass, four] = [16, 64].map(|samples| remembered(samples, Options::default()));
    assert_eq!(one_pass, 0);
    // A tile that is seen draws a leaf at least, three times again.
    assert!(four >= 3 * 10, "{four}");
    assert_eq!(remembered(64, Options { visible_set: false, ..Options::default() }), 0);
}

#[test]
fn bounds_decide_nearly_all_shadows_and_say_how_many() {
    let mut random = Random::new(5);
    let (particles, radii) = particles(Law::Uniform, 3000, &mut random);
    let camera = camera(&particles.bounds(), &mut random);
    let settings = Settings { width: 64, height: 64, samples: 16, seed: 0, ..Settings::default() };
    let scene = scene(&particles, &radii, Kind::default(), Lighting::studio(Vec3::X, Vec3::NEG_Y, Vec3::Z));
    let mut renderer = Renderer::new(&scene, &camera, &settings).unwrap();
    renderer.finish(&()).unwrap();
    let counts = renderer.counts();
    assert!(counts.light_points > 10_000 && counts.surely_shadowed > 1000, "{counts:?}");
    assert!(counts.traced < counts.light_points / 100, "{counts:?}");
}
