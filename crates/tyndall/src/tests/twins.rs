//! Whole pictures of the card beside those of the CPU. Products and sums may be fused on the card, so that a ray that grazes a sphere may
//! be decided otherwise: such pixels are counted.

mod built;
mod culling;
mod heaps;
mod selection;

use super::scenes::{LAWS, Law, Random, camera, particles};
use crate::error::Error;
use crate::film::Image;
use crate::math::Ray;
use crate::particles::{Particles, Radii};
use crate::render::gpu::{Gpu, Options, Renderer, Resident, Tiling, Tilings};
use crate::render::{Settings, render};
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::scene::color::{self, ParticleColors};
use crate::scene::coloring::Mapping;
use crate::scene::light::Lighting;
use crate::structure::{Hit, Kind, Packing, Structure};
use glam::Vec3;

/// A device, or none: then it is said that the test is skipped.
pub(super) fn device(page_bytes: Option<u64>) -> Option<Gpu> {
    match Gpu::open(Options { page_bytes, checked: true, ..Options::default() }) {
        Ok(gpu) => Some(gpu),
        Err(error) => {
            println!("skipped: no adapter ({error})");
            None
        }
    }
}

/// A device whose kernels see one array more than other scenes have: the bits of what is shown.
pub(super) fn device_that_hides() -> Option<Gpu> {
    let gpu = device(None)?;
    let few = gpu.storage_buffers() < 11;
    if few {
        println!(
            "left out: {} buffers are too few to hide particles of every structure",
            gpu.storage_buffers()
        );
    }
    (!few).then_some(gpu)
}

/// Random particles by a seed, as a scene takes them, with a camera.
fn random_particles(seed: u64) -> (Particles, Radii, ParticleColors, Camera) {
    const COUNTS: [usize; 7] = [3000, 700, 129, 17, 2, 1, 0];
    let mut random = Random::new(seed);
    let law = LAWS[seed as usize % LAWS.len()];
    let count = COUNTS[(seed as usize / LAWS.len()) % COUNTS.len()];
    let (particles, radii) = particles(law, count, &mut random);
    let camera = camera(&particles.bounds(), &mut random);
    let spec = if seed.is_multiple_of(3) { "#8090a0" } else { "radius" };
    let colors = color::resolve(&particles, &spec.parse().unwrap(), &Mapping::default()).unwrap();
    (particles, radii, colors, camera)
}

/// A random scene by a seed, with its camera.
fn random_scene(seed: u64, packing: Packing, lighting: Lighting) -> (Scene, Camera) {
    random_scene_in(Kind::Bvh(packing), seed, lighting)
}

/// The same in any structure.
fn random_scene_in(kind: Kind, seed: u64, lighting: Lighting) -> (Scene, Camera) {
    let (particles, radii, colors, camera) = random_particles(seed);
    let structure = Structure::build(kind, particles, &radii, 1.0, &()).unwrap();
    (Scene::new(structure, colors, lighting, None), camera)
}

fn on_card(
    gpu: &Gpu,
    scene: &Scene,
    camera: &Camera,
    settings: &Settings,
    tilings: Option<Tilings>,
) -> Image {
    picture(&Resident::load(gpu, scene, &()).unwrap(), scene, camera, settings, tilings)
}

fn picture(
    resident: &Resident,
    scene: &Scene,
    camera: &Camera,
    settings: &Settings,
    tilings: Option<Tilings>,
) -> Image {
    let mut renderer = Renderer::new(resident, scene, camera, settings).unwrap();
    if let Some(tilings) = tilings {
        renderer = renderer.with_tilings(tilings);
    }
    while !renderer.is_done() {
        renderer.pass(&()).unwrap();
    }
    renderer.image().unwrap()
}

/// In how many pixels two pictures differ by more than rounding: in the id, in the color, or in the distance by more than a share of
/// it or of `scale`, the distance to the scene's middle.
pub(super) fn differing_pixels(a: &Image, b: &Image, scale: f32) -> usize {
    assert_eq!((a.width, a.height), (b.width, b.height));
    let is_near = |a: f32, b: f32| {
        let tolerance = 1e-4 * a.abs().max(b.abs()) + 4e-6 * scale;
        a == b || (a - b).abs() <= tolerance.min(f32::MAX)
    };
    let differs = |&k: &usize| {
        let color = (0..4).any(|channel| (a.color[k][channel] - b.color[k][channel]).abs() > 2e-3);
        color || a.id[k] != b.id[k] || !is_near(a.depth[k], b.depth[k])
    };
    (0..a.color.len()).filter(differs).count()
}

/// From the eye to what it looks at.
pub(super) fn scale(camera: &Camera) -> f32 {
    camera.eye.distance(camera.look_at) as f32
}

#[test]
fn a_single_altered_value_is_seen_by_the_comparison() {
    let image = Image {
        width: 2,
        height: 1,
        color: vec![[0.5; 4]; 2],
        depth: vec![1.0, f32::INFINITY],
        id: vec![3, -1],
    };
    assert_eq!(differing_pixels(&image, &image, 1.0), 0);
    for alter in [
        |image: &mut Image| image.color[1][2] = 0.51,
        |image: &mut Image| image.depth[0] = 1.001,
        |image: &mut Image| image.depth[1] = 1.0,
        |image: &mut Image| image.id[1] = 0,
    ] {
        let mut altered = image.clone();
        alter(&mut altered);
        assert_eq!(differing_pixels(&image, &altered, 1.0), 1);
    }
}

#[test]
fn the_card_renders_what_the_cpu_renders() {
    let Some(gpu) = device(None) else { return };
    let (mut met, mut pixels, mut differing) = (0, 0, 0);
    for seed in 0..48_u64 {
        let packing =
            [Packing::Exact, Packing::Bits16, Packing::Bits11, Packing::Bits8][seed as usize / 8 % 4];
        let lighting = if seed.is_multiple_of(2) { Lighting::Headlight } else { Lighting::Flat };
        let (scene, camera) = random_scene(seed, packing, lighting);
        let samples = [1, 4, 16, 21][seed as usize % 4];
        let settings = Settings { width: 83, height: 61, samples, seed: seed as u32, ..Settings::default() };
        let expected = render(&scene, &camera, &settings, &()).unwrap();
        let found = on_card(&gpu, &scene, &camera, &settings, None);
        let differs = differing_pixels(&expected, &found, scale(&camera));
        met += expected.id.iter().filter(|&&id| id >= 0).count();
        pixels += expected.id.len();
        differing += differs;
        println!("seed {seed}: {differs} differ");
        // Where all particles lie in one plane that the eye looks along, or far from it, more rays graze.
        assert!(differs <= expected.id.len() / 50, "seed {seed}: {differs} pixels differ, {camera:?}");
    }
    println!("{differing} of {pixels} pixels differ, {met} met a particle");
    assert!(met > 20_000 && differing * 500 < pixels, "{differing} of {pixels} differ, {met} met");
}

#[test]
fn the_card_casts_the_shadows_that_the_cpu_casts() {
    let Some(gpu) = device(None) else { return };
    let (mut pixels, mut differing) = (0, 0);
    for seed in 0..16_u64 {
        let studio = Lighting::studio(Vec3::X, Vec3::NEG_Y, Vec3::Z);
        let packing = if seed.is_multiple_of(2) { Packing::Exact } else { Packing::Bits16 };
        let (scene, camera) = random_scene(seed, packing, studio);
        let settings =
            Settings { width: 31, height: 29, samples: 4, seed: seed as u32, ..Settings::default() };
        let expected = render(&scene, &camera, &settings, &()).unwrap();
        let found = on_card(&gpu, &scene, &camera, &settings, None);
        let differs = differing_pixels(&expected, &found, scale(&camera));
        println!("seed {seed}: {differs} of {} pixels differ", expected.id.len());
        // Where all particles share a center, what a shadow ray starts on lies within rounding of the others.
        if !matches!(LAWS[seed as usize % LAWS.len()], Law::Equal) {
            differing += differs;
            pixels += expected.id.len();
        }
    }
    // A shadow ray that grazes a sphere, of eight a pixel, changes the color by an eighth.
    assert!(differing * 100 < pixels, "{differing} of {pixels}");
}

#[test]
fn every_tiling_renders_the_same_picture() {
    let Some(gpu) = device(None) else { return };
    let tiling = |tile, split, nodes| Tiling { tile, split, nodes };
    for (seed, samples) in [(0, 16), (4, 4), (3, 1)] {
        let (scene, camera) = random_scene(seed, Packing::Exact, Lighting::Headlight);
        let settings = Settings { width: 67, height: 45, samples, seed: 1, ..Settings::default() };
        let expected = on_card(&gpu, &scene, &camera, &settings, None);
        for (first, patience, second) in [
            (tiling([8, 8], 1, 1), 0, tiling([8, 8], 1, 1)),
            (tiling([8, 4], 1, 4), 3, tiling([4, 4], 1, 4)),
            (tiling([8, 8], 1, 8), 1, tiling([4, 4], 4, 4)),
            (tiling([16, 16], 1, 16), 5, tiling([8, 8], 4, 16)),
            (tiling([8, 8], 4, 16), 2, tiling([2, 2], 16, 8)),
        ] {
            let tilings = Tilings { first, patience, second };
            let found = on_card(&gpu, &scene, &camera, &settings, Some(tilings));
            let differing = differing_pixels(&expected, &found, scale(&camera));
            assert_eq!(differing, 0, "{samples} samples, {tilings:?}");
        }
    }
}

#[test]
fn many_small_pages_hold_what_one_large_page_holds() {
    let Some(whole) = device(None) else { return };
    // With so many bindings as some drivers have, the leaves alone can be in two pages.
    let few = [(0, 32 << 10)];
    let many = [(0, 8 << 10), (4, 8 << 10)];
    let has_many = whole.storage_buffers() >= 20;
    for (seed, page_bytes) in few.into_iter().chain(many.into_iter().filter(|_| has_many)) {
        let Some(paged) = device(Some(page_bytes)) else { return };
        let (scene, camera) = random_scene(seed, Packing::Exact, Lighting::Headlight);
        let settings = Settings { width: 64, height: 48, samples: 4, seed: 2, ..Settings::default() };
        let [expected, found] = [&whole, &paged].map(|gpu| on_card(gpu, &scene, &camera, &settings, None));
        assert_eq!(differing_pixels(&expected, &found, scale(&camera)), 0);
    }
}

#[test]
fn what_does_not_fit_is_refused_with_both_sizes() {
    // More pages than there are bindings.
    let Some(gpu) = device(Some(16)) else { return };
    let (scene, camera) = random_scene(0, Packing::Exact, Lighting::Flat);
    let refused = Resident::load(&gpu, &scene, &()).err().unwrap();
    let Error::Memory { needed_bytes, .. } = &refused else { panic!("{refused}") };
    assert!(*needed_bytes > 3000 * 12, "{refused}");
    let Some(gpu) = device(None) else { return };
    let resident = Resident::load(&gpu, &scene, &()).unwrap();
    let settings = Settings { width: 65536, height: 65536, ..Settings::default() };
    let refused = Renderer::new(&resident, &scene, &camera, &settings).err().unwrap();
    assert!(matches!(refused, Error::Memory { .. }), "{refused}");
}

#[test]
fn structures_that_the_card_does_not_walk_are_refused() {
    let Some(gpu) = device(None) else { return };
    let mut random = Random::new(1);
    let (particles, radii) = particles(LAWS[0], 100, &mut random);
    let structure = Structure::build(Kind::Brute, particles, &radii, 1.0, &()).unwrap();
    let scene = Scene::new(structure, ParticleColors::constant([1.0; 3]), Lighting::Flat, None);
    assert!(matches!(Resident::load(&gpu, &scene, &()), Err(Error::Setting { .. })));
}

#[test]
fn an_adapter_of_no_such_name_is_an_error() {
    let refused = Gpu::open(Options { name: Some("no such card".into()), ..Options::default() });
    assert!(matches!(refused, Err(Error::Device(_))));
}

#[test]
fn single_rays_meet_on_the_card_what_they_meet_on_the_cpu() {
    let Some(gpu) = device(None) else { return };
    let (mut met, mut differing, mut count) = (0, 0, 0);
    for seed in 0..24_u64 {
        let packing = [Packing::Exact, Packing::Bits16, Packing::Bits11, Packing::Bits8][seed as usize / 6];
        let (scene, _) = random_scene(seed % 16, packing, Lighting::Flat);
        let bounds = scene.structure().bounds();
        let (center, half) = (bounds.center(), 0.5 * bounds.extent());
        let mut random = Random::new(100 + seed);
        let ray = |k: usize| {
            let from_outside = center + 3.0 * half.max_element() * random.vector().normalize_or(Vec3::X);
            let origin = if k.is_multiple_of(4) { center + half * random.vector() } else { from_outside };
            let direction = match k % 5 {
                0 => [Vec3::X, Vec3::NEG_Y, Vec3::Z][k % 3],
                _ => (center + half * random.vector() - origin).normalize_or(Vec3::X),
            };
            let t_max = if k.is_multiple_of(3) { half.max_element() } else { f32::INFINITY };
            Ray { origin, direction, t_min: 0.0, t_max }
        };
        let rays: Vec<Ray> =
            if scene.structure().is_empty() { Vec::new() } else { (0..1000).map(ray).collect() };
        let found = resident_hits(&gpu, &scene, &rays);
        for (ray, found) in rays.iter().zip(found) {
            let expected = scene.structure().intersect(ray, None);
            met += usize::from(expected.is_some());
            differing += usize::from(expected.map(|hit| hit.id) != found.map(|hit| hit.id));
            count += 1;
        }
    }
    println!("{differing} of {count} rays differ, {met} met a particle");
    assert!(met > 5_000 && differing * 500 < count, "{differing} of {count} differ, {met} met");
}

fn resident_hits(gpu: &Gpu, scene: &Scene, rays: &[Ray]) -> Vec<Option<Hit>> {
    Resident::load(gpu, scene, &()).unwrap().intersect(scene.structure(), rays, &()).unwrap()
}

#[test]
fn a_picked_pixel_is_that_of_the_picture() {
    let Some(gpu) = device(None) else { return };
    let (scene, camera) = random_scene(0, Packing::Exact, Lighting::Flat);
    let settings = Settings { width: 40, height: 30, samples: 4, seed: 0, ..Settings::default() };
    let resident = Resident::load(&gpu, &scene, &()).unwrap();
    let mut renderer = Renderer::new(&resident, &scene, &camera, &settings).unwrap();
    assert_eq!(renderer.pick(3, 3).unwrap(), None, "without samples nothing is seen");
    renderer.pass(&()).unwrap();
    let image = renderer.image().unwrap();
    let mut seen = 0;
    for (x, y) in (0..40).step_by(7).flat_map(|x| (0..30).step_by(7).map(move |y| (x, y))) {
        let at = (y * 40 + x) as usize;
        let picked = renderer.pick(x, y).unwrap();
        seen += usize::from(picked.is_some());
        assert_eq!(picked.map_or(-1, |(place, _)| place as i64), image.id[at]);
        assert_eq!(picked.map_or(f32::INFINITY, |(_, depth)| depth), image.depth[at]);
    }
    assert!(seen > 5, "{seen} pixels show something");
    assert_eq!(renderer.pick(40, 0).unwrap(), None);
}

#[test]
fn counted_work_is_that_of_the_picture() {
    let Some(gpu) = device(None) else { return };
    let (scene, camera) = random_scene(0, Packing::Exact, Lighting::Flat);
    let resident = Resident::load(&gpu, &scene, &()).unwrap();
    let settings = Settings { width: 40, height: 30, samples: 4, seed: 0, ..Settings::default() };
    let mut renderer = Renderer::new(&resident, &scene, &camera, &settings).unwrap();
    let work = renderer.count_work(&()).unwrap().unwrap();
    assert_eq!(work.tiles, 5 * 4);
    assert!(work.leaves > 0 && work.nodes >= work.tiles && work.tests > 0, "{work:?}");
    assert!(
        work.steps >= work.nodes / 8 + work.leaves / 4
            && work.steps <= work.nodes + work.leaves + work.tiles * 64
    );
}
