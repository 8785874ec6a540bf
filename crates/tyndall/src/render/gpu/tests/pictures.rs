//! Whole pictures of the card beside those of the CPU. Products and sums may be fused on the card, so that a ray that grazes a sphere may
//! be decided otherwise: such pixels are counted.

use super::super::{Gpu, Options, Renderer, Resident, Tiling};
use crate::film::Image;
use crate::render::Settings;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::scene::color;
use crate::scene::coloring::Range;
use crate::scene::light::Lighting;
use crate::structure::{Kind, Packing, Structure};
use crate::tests::scenes::{LAWS, Random, camera, particles};

/// A device, or none: then it is said that the test is skipped.
pub(super) fn device(binding_bytes: Option<u64>) -> Option<Gpu> {
    match Gpu::open(Options { binding_bytes, ..Options::default() }) {
        Ok(gpu) => Some(gpu),
        Err(error) => {
            println!("skipped: no adapter ({error})");
            None
        }
    }
}

/// A random scene by a seed, with its camera.
pub(super) fn random_scene(seed: u64, packing: Packing, lighting: Lighting) -> (Scene, Camera) {
    const COUNTS: [usize; 7] = [3000, 700, 129, 17, 2, 1, 0];
    let mut random = Random::new(seed);
    let law = LAWS[seed as usize % LAWS.len()];
    let count = COUNTS[(seed as usize / LAWS.len()) % COUNTS.len()];
    let (particles, radii) = particles(law, count, &mut random);
    let camera = camera(&particles.bounds(), &mut random);
    let spec = if seed % 3 == 0 { "#8090a0" } else { "radius" };
    let colors = color::resolve(&particles, &spec.parse().unwrap(), None, None, Range::Auto).unwrap();
    let structure = Structure::build(Kind::Bvh(packing), particles, &radii, 1.0, &()).unwrap();
    (Scene::new(structure, colors, lighting, None), camera)
}

pub(super) fn on_card(
    gpu: &Gpu,
    scene: &Scene,
    camera: &Camera,
    settings: &Settings,
    tiling: Tiling,
) -> Image {
    let resident = Resident::load(gpu, scene, &()).unwrap();
    let mut renderer = Renderer::new(&resident, scene, camera, settings).unwrap().with_tiling(tiling);
    while !renderer.is_done() {
        renderer.pass(&()).unwrap();
    }
    renderer.image().unwrap()
}

/// In how many pixels two pictures differ by more than rounding: in the id, in the distance by more than a share, or in the color.
fn differing_pixels(a: &Image, b: &Image) -> usize {
    assert_eq!((a.width, a.height), (b.width, b.height));
    let is_near = |a: f32, b: f32| a == b || (a - b).abs() <= (1e-4 * a.abs().max(b.abs())).min(f32::MAX);
    let differs = |k: &usize| {
        let k = *k;
        let color = (0..4).any(|channel| (a.color[k][channel] - b.color[k][channel]).abs() > 2e-3);
        color || a.id[k] != b.id[k] || !is_near(a.depth[k], b.depth[k])
    };
    (0..a.color.len()).filter(differs).count()
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
    assert_eq!(differing_pixels(&image, &image), 0);
    for alter in [
        |image: &mut Image| image.color[1][2] = 0.51,
        |image: &mut Image| image.depth[0] = 1.001,
        |image: &mut Image| image.depth[1] = 1.0,
        |image: &mut Image| image.id[1] = 0,
    ] {
        let mut altered = image.clone();
        alter(&mut altered);
        assert_eq!(differing_pixels(&image, &altered), 1);
    }
}

#[test]
fn the_card_renders_what_the_cpu_renders() {
    let Some(gpu) = device(None) else { return };
    let (mut met, mut pixels, mut differing) = (0, 0, 0);
    for seed in 0..48_u64 {
        let packing =
            [Packing::Exact, Packing::Bits16, Packing::Bits11, Packing::Bits8][seed as usize / 8 % 4];
        let lighting = if seed % 2 == 0 { Lighting::Headlight } else { Lighting::Flat };
        let (scene, camera) = random_scene(seed, packing, lighting);
        let samples = [1, 4, 16, 21][seed as usize % 4];
        let settings = Settings { width: 83, height: 61, samples, seed: seed as u32, ..Settings::default() };
        let expected = crate::render::render(&scene, &camera, &settings, &()).unwrap();
        let found = on_card(&gpu, &scene, &camera, &settings, Tiling::default());
        let differs = differing_pixels(&expected, &found);
        met += expected.id.iter().filter(|&&id| id >= 0).count();
        pixels += expected.id.len();
        differing += differs;
        // Where all particles lie in one plane that the eye looks along, or far from it, more rays graze.
        assert!(differs <= expected.id.len() / 50, "seed {seed}: {differs} pixels differ, {camera:?}");
    }
    println!("{differing} of {pixels} pixels differ, {met} met a particle");
    assert!(met > 20_000 && differing * 500 < pixels, "{differing} of {pixels} differ, {met} met");
}
