//! Hierarchies that the card builds: what must hold of them, and that they make the picture that the CPU's make.

use super::*;
use crate::particles::{Attribute, Columns, Positions, Values};
use crate::progress::Progress;
use crate::render::gpu::Hierarchy;
use crate::scene::camera::Projection;
use crate::structure::{Bvh, Spheres, Store};
use crate::synthetic;
use glam::DVec3;

const PACKINGS: [Packing; 4] = [Packing::Exact, Packing::Bits16, Packing::Bits11, Packing::Bits8];

fn build<'a>(
    gpu: &'a Gpu,
    particles: Particles,
    radii: &Radii,
    packing: Packing,
) -> (Hierarchy<'a>, Structure) {
    let spheres = Spheres { particles: &particles, radii, radius_scale: 1.0 };
    let hierarchy = Hierarchy::build(gpu, spheres, packing, &()).unwrap();
    let structure = hierarchy.structure(particles, radii, 1.0, &()).unwrap();
    (hierarchy, structure)
}

fn bvh(structure: Structure) -> Bvh {
    match structure.store {
        Store::Bvh(bvh) => bvh,
        _ => unreachable!("the card builds a hierarchy"),
    }
}

/// Columns of centers and radii as particles.
fn particles_of(columns: [Vec<f32>; 3], radii: Vec<f32>) -> (Particles, Radii) {
    let positions = Positions::from_offsets(DVec3::ZERO, columns);
    let attributes = vec![Attribute::new("radius", 1, Values::F32(radii))];
    let particles = Particles::new(Columns { positions, attributes, ..Columns::default() }).unwrap();
    (particles, Radii::PerParticle { attribute: 0, scale: 1.0 })
}

/// Builds, and checks all that must hold; `case` says of what.
fn check(gpu: &Gpu, particles: Particles, radii: &Radii, packing: Packing, case: &str) {
    let spheres = Spheres { particles: &particles, radii, radius_scale: 1.0 };
    let given: Vec<_> = (0..spheres.len()).map(|id| (spheres.center(id), spheres.radius(id))).collect();
    let (_, structure) = build(gpu, particles, radii, packing);
    for (node, &id) in structure.ids().iter().enumerate() {
        let ((center, radius), (given, given_radius)) = (structure.sphere(node as u32), given[id as usize]);
        if packing == Packing::Exact {
            assert_eq!((center, radius), (given, given_radius), "{case}, node {node}");
        }
        // In 8 bits of the whole, and of radii over seven orders.
        let off = (center - given).abs();
        let allowed = structure.bounds().extent() / 127.0 + 1e-6 * given.abs();
        assert!(off.cmple(allowed).all(), "{case}, {packing:?}, node {node}: {off}");
        assert!(
            (radius - given_radius).abs() <= 0.05 * given_radius,
            "{case}, {packing:?}: {radius} {given_radius}"
        );
    }
    assert_eq!(structure.packing_error().is_some(), packing != Packing::Exact);
    let bvh = bvh(structure);
    assert_eq!(bvh.check(), Ok(()), "{case}, {packing:?}");
    let (count, is_log) = (given.len(), bvh.arrays().sizes.is_log());
    let differing = bvh.differing_nodes();
    // Only powers of two that are not whole are rounded otherwise.
    assert!(differing == 0 || is_log, "{case}, {packing:?}: {differing} nodes of {count} particles differ");
}

#[test]
fn what_the_card_builds_is_whole() {
    let Some(gpu) = device(None) else { return };
    for (at, law) in LAWS.into_iter().enumerate() {
        for (number, count) in [0, 1, 2, 16, 17, 129, 5000].into_iter().enumerate() {
            let mut random = Random::new((10 * at + number) as u64);
            let (particles, radii) = particles(law, count, &mut random);
            check(&gpu, particles, &radii, PACKINGS[(at + number) % 4], &format!("{law:?}, {count}"));
        }
    }
}

#[test]
fn what_the_card_builds_of_extremes_is_whole() {
    let Some(gpu) = device(None) else { return };
    let mut random = Random::new(77);
    let mut column = |scale: f32| -> Vec<f32> { (0..3000).map(|_| scale * random.unit()).collect() };
    for scale in [1e-30, 1e-12, 1e12, 1e18] {
        let columns = [column(scale), column(scale), column(scale)];
        let (particles, radii) = particles_of(columns, vec![0.01 * scale; 3000]);
        check(&gpu, particles, &radii, Packing::Exact, &format!("scale {scale}"));
    }
    let mut giant = vec![1e-3; 3000];
    giant[1234] = 100.0;
    for packing in PACKINGS {
        let columns = [column(1.0), column(1.0), column(1.0)];
        let (particles, radii) = particles_of(columns, giant.clone());
        check(&gpu, particles, &radii, packing, "one giant");
        // Radii of many kinds, some of them zero.
        let radii: Vec<f32> = column(1.0).into_iter().map(|it| (0.1 * it.powi(9) - 1e-4).max(0.0)).collect();
        let (particles, radii) = particles_of([column(1.0), column(1.0), column(1.0)], radii);
        check(&gpu, particles, &radii, packing, "radii of many kinds");
    }
    let mut far = [column(1.0), column(1.0), column(1.0)];
    far[0][7] = 1e9;
    let (particles, radii) = particles_of(far, vec![0.01; 3000]);
    check(&gpu, particles, &radii, Packing::Exact, "one far out");
}

#[test]
fn the_card_sorts_by_key_and_then_by_id() {
    let Some(gpu) = device(None) else { return };
    // More than a block of counts has.
    let count = 45_000;
    let mut random = Random::new(5);
    let columns: [Vec<f32>; 3] = std::array::from_fn(|_| (0..count).map(|_| random.unit().powi(3)).collect());
    // Many lie in the same place.
    let columns = columns.map(|column| column.iter().map(|at| (40.0 * at).floor() / 40.0).collect());
    let (particles, radii) = particles_of(columns, (0..count).map(|id| 0.001 * (id % 7) as f32).collect());
    let spheres = Spheres { particles: &particles, radii: &radii, radius_scale: 1.0 };
    let order = crate::render::gpu::order_of(spheres);
    let (_, structure) = build(&gpu, particles, &radii, Packing::Exact);
    let keys: Vec<(u64, u32)> = structure
        .ids()
        .iter()
        .enumerate()
        .map(|(node, &id)| {
            let (center, radius) = structure.sphere(node as u32);
            (order(center, radius), id)
        })
        .collect();
    // A cell's edge may be passed by rounding.
    let falls = keys.windows(2).filter(|pair| pair[0] > pair[1]).count();
    let equal = keys.windows(2).filter(|pair| pair[0].0 == pair[1].0).count();
    assert!(falls * 1000 <= count && equal > 1000, "{falls} fall, {equal} are equal");
}

#[test]
fn many_small_pages_build_what_one_large_page_builds() {
    let (Some(whole), Some(paged)) = (device(None), device(Some(8 << 10))) else { return };
    if whole.storage_buffers() < 24 {
        println!("left out: {} has too few bindings for pages", whole.info().name);
        return;
    }
    for (seed, packing) in [(0, Packing::Exact), (4, Packing::Bits16), (4, Packing::Bits8)] {
        let [expected, found] = [&whole, &paged].map(|gpu| {
            let (particles, radii, ..) = random_particles(seed);
            bvh(build(gpu, particles, &radii, packing).1)
        });
        let (expected, found) = (expected.arrays(), found.arrays());
        assert!(expected.ids == found.ids && expected.blocks.len() > 8 << 10);
        assert!(expected.nodes == found.nodes && expected.blocks == found.blocks);
    }
}

#[test]
fn pictures_of_what_the_card_builds_are_those_of_what_the_cpu_builds() {
    let Some(gpu) = device(None) else { return };
    let (mut met, mut pixels, mut differing) = (0, 0, 0);
    // All laws of many and of some particles, and few to none.
    for seed in (0..16).chain([24, 33, 40, 48_u64]) {
        let packing = if seed.is_multiple_of(2) { Packing::Exact } else { Packing::Bits16 };
        let lighting = if seed % 3 == 0 { Lighting::Headlight } else { Lighting::Flat };
        let (particles, radii, colors, camera) = random_particles(seed);
        let (hierarchy, structure) = build(&gpu, particles, &radii, packing);
        let scene = Scene::new(structure, colors, lighting.clone(), None);
        let resident = Resident::built(hierarchy, &scene, &()).unwrap();
        let samples = [1, 4, 16][seed as usize % 3];
        let settings = Settings { width: 71, height: 53, samples, seed: seed as u32, ..Settings::default() };
        let found = picture(&resident, &scene, &camera, &settings, None);
        // Packed centers depend on who shares a leaf: the copy is of the same bits.
        let (of_cpu, _) = random_scene(seed, packing, lighting);
        let expected = match packing {
            Packing::Exact => render(&of_cpu, &camera, &settings, &()).unwrap(),
            _ => render(&scene, &camera, &settings, &()).unwrap(),
        };
        let differs = differing_pixels(&expected, &found, scale(&camera));
        println!("seed {seed}: {differs} differ");
        assert!(differs <= expected.id.len() / 50, "seed {seed}: {differs} pixels differ");
        met += expected.id.iter().filter(|&&id| id >= 0).count();
        pixels += expected.id.len();
        differing += differs;
    }
    assert!(met > 6_000 && differing * 500 < pixels, "{differing} of {pixels} differ, {met} met");
}

#[test]
fn walks_through_what_the_card_builds_are_little_longer() {
    let Some(gpu) = device(None) else { return };
    for set in ["packed", "uniform", "clustered"] {
        let particles = || synthetic::generate(&format!("{set}?n=40000&seed=1"), &()).unwrap();
        let radii = crate::scene::automatic::radii(&particles()).0;
        let camera = Camera {
            eye: DVec3::new(0.4, -1.6, 0.9),
            look_at: DVec3::splat(0.5),
            up: DVec3::Z,
            projection: Projection::Perspective { vertical_angle: 0.7 },
        };
        let settings = Settings { width: 128, height: 128, samples: 4, ..Settings::default() };
        let work = |resident: &Resident, scene: &Scene| {
            let mut renderer = Renderer::new(resident, scene, &camera, &settings).unwrap();
            renderer.count_work(&()).unwrap().unwrap()
        };
        let white = || ParticleColors::constant([1.0; 3]);
        let structure = Structure::build(Kind::default(), particles(), &radii, 1.0, &()).unwrap();
        let scene = Scene::new(structure, white(), Lighting::Flat, None);
        let of_cpu = work(&Resident::load(&gpu, &scene, &()).unwrap(), &scene);
        let (hierarchy, structure) = build(&gpu, particles(), &radii, Packing::Exact);
        let scene = Scene::new(structure, white(), Lighting::Flat, None);
        let of_card = work(&Resident::built(hierarchy, &scene, &()).unwrap(), &scene);
        let ratio = |of: fn(&crate::render::gpu::Work) -> u64| of(&of_card) as f64 / of(&of_cpu) as f64;
        let (nodes, leaves, steps) = (ratio(|it| it.nodes), ratio(|it| it.leaves), ratio(|it| it.steps));
        println!("{set}: {nodes:.2} times the nodes, {leaves:.2} the leaves, {steps:.2} the steps");
        assert!(nodes < 1.5 && leaves < 1.5, "{set}: {nodes} {leaves}");
    }
}

#[test]
fn a_build_that_does_not_fit_is_refused_with_its_size() {
    let Some(gpu) = device(Some(16)) else { return };
    let (particles, radii, ..) = random_particles(0);
    let spheres = Spheres { particles: &particles, radii: &radii, radius_scale: 1.0 };
    let refused = Hierarchy::build(&gpu, spheres, Packing::Exact, &()).err().unwrap();
    let Error::Memory { needed_bytes, hint, .. } = &refused else { panic!("{refused}") };
    assert!(*needed_bytes > 3000 * 50 && hint.contains("--build cpu"), "{refused}");
}

/// Wants to stop at once.
struct Stopped;

impl Progress for Stopped {
    fn begin(&self, _: &str, _: Option<u64>, _: &'static str) {}
    fn advance(&self, _: u64) {}
    fn cancelled(&self) -> bool {
        true
    }
}

#[test]
fn a_build_stops_when_it_is_told_to() {
    let Some(gpu) = device(None) else { return };
    let (particles, radii, ..) = random_particles(0);
    let spheres = Spheres { particles: &particles, radii: &radii, radius_scale: 1.0 };
    let stopped = Hierarchy::build(&gpu, spheres, Packing::Exact, &Stopped).err().unwrap();
    assert!(matches!(stopped, Error::Interrupted), "{stopped}");
    let hierarchy = Hierarchy::build(&gpu, spheres, Packing::Exact, &()).unwrap();
    let stopped = hierarchy.structure(particles, &radii, 1.0, &Stopped).err().unwrap();
    assert!(matches!(stopped, Error::Interrupted), "{stopped}");
}

#[test]
fn another_scene_is_refused() {
    let Some(gpu) = device(None) else { return };
    let (particles, radii, ..) = random_particles(0);
    let (hierarchy, _) = build(&gpu, particles, &radii, Packing::Exact);
    let (scene, _) = random_scene(8, Packing::Exact, Lighting::Flat);
    assert!(matches!(Resident::built(hierarchy, &scene, &()), Err(Error::Device(_))));
}
