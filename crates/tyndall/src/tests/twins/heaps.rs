//! `pkd` and `treelets` on the card, walked in both ways, beside the same structures on the CPU.

use glam::Vec3;

use super::super::scenes::Random;
use super::{device, differing_pixels, random_scene_in, scale};
use crate::math::Ray;
use crate::render::Settings;
use crate::render::gpu::{HeapWalk, Renderer, Resident};
use crate::scene::light::Lighting;
use crate::structure::pkd::{Axis, Options, Order};
use crate::structure::treelets::{self, Cut};
use crate::structure::{Hit, Kind};

const ROUND_ROBIN: Options = Options { axis: Axis::RoundRobin, order: Order::NodeFirst };
const WIDEST: Options = Options { axis: Axis::WidestExtent, order: Order::NodeFirst };

const KINDS: [Kind; 4] = [
    Kind::Pkd(WIDEST),
    Kind::Treelets(treelets::Options { size: 16, cut: Cut::Median, heap: WIDEST }),
    Kind::Pkd(ROUND_ROBIN),
    Kind::Treelets(treelets::Options { size: 200, cut: Cut::Middle, heap: ROUND_ROBIN }),
];

const WALKS: [HeapWalk; 2] = [HeapWalk::ShortStack, HeapWalk::StackFree];

#[test]
fn the_card_renders_heaps_as_the_cpu_renders_them() {
    let Some(gpu) = device(None) else { return };
    let (mut met, mut pixels, mut differing) = (0, 0, 0);
    for seed in 0..40_u64 {
        let kind = KINDS[(seed as usize + seed as usize / 8) % KINDS.len()];
        let studio = Lighting::studio(Vec3::X, Vec3::NEG_Y, Vec3::Z);
        let lighting = if seed % 3 == 0 { studio } else { Lighting::Headlight };
        let (scene, camera) = random_scene_in(kind, seed, lighting);
        let samples = [1, 4, 16][(seed as usize % 3 + seed as usize / 3) % 3];
        let settings = Settings { width: 43, height: 31, samples, seed: seed as u32, ..Settings::default() };
        let expected = crate::render::render(&scene, &camera, &settings, &()).unwrap();
        for walk in WALKS {
            let resident = Resident::load(&gpu, &scene, &()).unwrap().with_heap_walk(walk);
            let mut renderer = Renderer::new(&resident, &scene, &camera, &settings).unwrap();
            while !renderer.is_done() {
                renderer.pass(&()).unwrap();
            }
            let differs = differing_pixels(&expected, &renderer.image().unwrap(), scale(&camera));
            met += expected.id.iter().filter(|&&id| id >= 0).count();
            pixels += expected.id.len();
            differing += differs;
            // Shadows of what grazes are decided otherwise more often than hits.
            let most = expected.id.len() / if seed % 3 == 0 { 10 } else { 50 };
            assert!(differs <= most, "seed {seed}: {kind:?}, {walk:?}: {differs} pixels differ, {camera:?}");
        }
    }
    println!("{differing} of {pixels} pixels differ, {met} met a particle");
    assert!(met > 10_000 && differing * 100 < pixels, "{differing} of {pixels} differ, {met} met");
}

#[test]
fn rays_through_heaps_meet_on_the_card_what_they_meet_on_the_cpu() {
    let Some(gpu) = device(None) else { return };
    let (mut asked, mut met, mut differing) = (0, 0, 0);
    for seed in 100..132_u64 {
        let kind = KINDS[(seed as usize + seed as usize / 8) % KINDS.len()];
        let (scene, _) = random_scene_in(kind, seed, Lighting::Headlight);
        let structure = scene.structure();
        let bounds = structure.bounds();
        let size = bounds.extent().max_element().max(1e-30);
        let center = if structure.is_empty() { Vec3::ZERO } else { bounds.center() };
        let mut random = Random::new(seed);
        let ray = |_| {
            let origin = center + size * random.vector();
            let toward = (center + 0.5 * size * random.vector() - origin).normalize_or(Vec3::X);
            let axis = [Vec3::X, Vec3::NEG_Y, Vec3::Z][random.below(3) as usize];
            let direction = if random.below(4) == 0 { axis } else { toward };
            let t_max = if random.below(3) == 0 { size * random.unit() } else { f32::INFINITY };
            Ray { origin, direction, t_min: 0.0, t_max }
        };
        let rays: Vec<Ray> = (0..400).map(ray).collect();
        for walk in WALKS {
            let resident = Resident::load(&gpu, &scene, &()).unwrap().with_heap_walk(walk);
            let found = resident.intersect(structure, &rays, &()).unwrap();
            let mut differs = |(ray, found): (&Ray, &Option<Hit>)| {
                let expected = structure.intersect(ray, None);
                met += usize::from(expected.is_some());
                let is_same = match (expected, *found) {
                    (Some(a), Some(b)) => a.id == b.id && (a.t - b.t).abs() <= 1e-4 * (size + a.t),
                    (a, b) => a.is_none() && b.is_none(),
                };
                !is_same
            };
            let differs = rays.iter().zip(&found).filter(|&pair| differs(pair)).count();
            asked += rays.len();
            differing += differs;
            assert!(differs <= rays.len() / 40, "seed {seed}: {kind:?}, {walk:?}: {differs} rays differ");
        }
    }
    println!("{differing} of {asked} rays differ, {met} met a particle");
    assert!(met > 3_000 && differing * 200 < asked, "{differing} of {asked} differ, {met} met");
}
