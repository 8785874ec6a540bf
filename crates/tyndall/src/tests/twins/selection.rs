//! Particles that are hidden, and radii that are scaled, after the structure was built: on the card as on the CPU.

use glam::Vec3;

use super::super::scenes::{LAWS, Law, Random, camera, particles};
use super::super::selection::Rules;
use super::{device_that_hides, differing_pixels, scale};
use crate::math::Ray;
use crate::render::gpu::{self, HeapWalk, Resident};
use crate::render::{Settings, render};
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::scene::color;
use crate::scene::coloring::Mapping;
use crate::scene::light::Lighting;
use crate::structure::pkd::{Axis, Options, Order};
use crate::structure::treelets::{self, Cut};
use crate::structure::{Kind, Packing, Structure};

const HEAP: Options = Options { axis: Axis::WidestExtent, order: Order::NodeFirst };

const KINDS: [(Kind, HeapWalk); 8] = [
    (Kind::Bvh(Packing::Exact), HeapWalk::ShortStack),
    (Kind::Bvh(Packing::Bits16), HeapWalk::ShortStack),
    (Kind::Bvh(Packing::Bits11), HeapWalk::ShortStack),
    (Kind::Bvh(Packing::Bits8), HeapWalk::ShortStack),
    (Kind::Pkd(HEAP), HeapWalk::ShortStack),
    (Kind::Pkd(HEAP), HeapWalk::StackFree),
    (Kind::Treelets(treelets::Options { size: 16, cut: Cut::Median, heap: HEAP }), HeapWalk::ShortStack),
    (Kind::Treelets(treelets::Options { size: 200, cut: Cut::Middle, heap: HEAP }), HeapWalk::StackFree),
];

/// A scene of that kind with particles by the seed's law, all shown and as they were built; what will be shown of it, and a camera.
pub(super) fn random_scene(seed: u64, kind: Kind) -> (Scene, Rules, Camera) {
    const COUNTS: [usize; 5] = [2000, 300, 129, 17, 1];
    let mut random = Random::new(20_000 + seed);
    let law = LAWS[seed as usize % LAWS.len()];
    // Each law with each kind: eight of both.
    let count = COUNTS[seed as usize / 3 % COUNTS.len()];
    let (particles, radii) = particles(law, count, &mut random);
    let rules = Rules::random(&particles, &mut random);
    let camera = camera(&particles.bounds(), &mut random);
    let colors = color::resolve(&particles, &"radius".parse().unwrap(), &Mapping::default()).unwrap();
    let structure = Structure::build(kind, particles, &radii, 1.0, &()).unwrap();
    let studio = Lighting::studio(Vec3::X, Vec3::NEG_Y, Vec3::Z);
    let has_shadows = seed.is_multiple_of(3) && !matches!(law, Law::Equal);
    let lighting = if has_shadows { studio } else { Lighting::Headlight };
    (Scene::new(structure, colors, lighting, None), rules, camera)
}

/// Factors of radii, by seed.
fn factor(seed: u64) -> f32 {
    [1.0, 0.4, 2.5, 1.0, 0.0][seed as usize % 5]
}

#[test]
fn the_card_shows_and_scales_what_the_cpu_shows_and_scales() {
    let Some(gpu) = device_that_hides() else { return };
    let (mut met, mut pixels, mut differing, mut hidden) = (0, 0, 0, 0);
    for seed in 0..64_u64 {
        let (kind, walk) = KINDS[(seed / 8) as usize];
        let (mut scene, rules, camera) = random_scene(seed, kind);
        let samples = [1, 4, 16][seed as usize % 3];
        let settings = Settings { width: 43, height: 31, samples, seed: seed as u32, ..Settings::default() };
        let all = render(&scene, &camera, &settings, &()).unwrap();
        rules.apply(scene.structure_mut());
        scene.scale_radii(factor(seed));
        let expected = render(&scene, &camera, &settings, &()).unwrap();
        let resident = Resident::load(&gpu, &scene, &()).unwrap().with_heap_walk(walk);
        let found = gpu::render(&resident, &scene, &camera, &settings, &()).unwrap();
        let differs = differing_pixels(&expected, &found, scale(&camera));
        hidden += differing_pixels(&all, &found, scale(&camera));
        met += expected.id.iter().filter(|&&id| id >= 0).count();
        pixels += expected.id.len();
        differing += differs;
        println!("seed {seed}: {differs} differ");
        // Shadows of what grazes are decided otherwise more often than hits.
        let most = expected.id.len() / if matches!(scene.lighting, Lighting::Studio(..)) { 10 } else { 50 };
        assert!(differs <= most, "seed {seed}: {kind:?}, {walk:?}: {differs} pixels differ, {camera:?}");
    }
    println!("{differing} of {pixels} pixels differ, {met} met a particle, {hidden} changed");
    assert!(met > 8_000 && differing * 100 < pixels, "{differing} of {pixels} differ, {met} met");
    assert!(hidden > 8_000, "{hidden} pixels changed: the scenes test nothing");
}

#[test]
fn single_rays_pass_through_what_is_hidden() {
    let Some(gpu) = device_that_hides() else { return };
    let (mut met, mut count, mut differing, mut changed) = (0, 0, 0, 0);
    for seed in 0..32_u64 {
        let (kind, walk) = KINDS[(seed / 4) as usize];
        let (mut scene, rules, _) = random_scene(seed, kind);
        let bounds = scene.structure().bounds();
        let (center, size) = (bounds.center(), bounds.extent().max_element().max(1e-30));
        let mut random = Random::new(seed);
        let ray = |_| {
            let origin = center + size * random.vector();
            let direction = (center + 0.5 * size * random.vector() - origin).normalize_or(Vec3::X);
            Ray { origin, direction, t_min: 0.0, t_max: f32::INFINITY }
        };
        let rays: Vec<Ray> = (0..500).map(ray).collect();
        let met_by = |scene: &Scene| -> Vec<Option<u32>> {
            rays.iter().map(|ray| scene.structure().intersect(ray, None).map(|hit| hit.id)).collect()
        };
        let all = met_by(&scene);
        rules.apply(scene.structure_mut());
        scene.scale_radii(factor(seed));
        let expected = met_by(&scene);
        let resident = Resident::load(&gpu, &scene, &()).unwrap().with_heap_walk(walk);
        let found = resident.intersect(scene.structure(), &rays, &()).unwrap();
        for ((all, expected), found) in all.iter().zip(&expected).zip(found) {
            let found = found.map(|hit| hit.id);
            met += usize::from(found.is_some());
            changed += usize::from(*all != found);
            differing += usize::from(*expected != found);
            count += 1;
        }
    }
    println!(
        "{differing} of {count} rays differ, {met} met a particle, {changed} met another one than before"
    );
    assert!(met > 1_000 && changed > 1_000 && differing * 200 < count, "{differing} of {count}, {met} met");
}
