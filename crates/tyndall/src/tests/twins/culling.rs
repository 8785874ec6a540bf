//! Culling on the card beside the CPU's, and beside no culling on the card.

use super::{device, differing_pixels, on_card, random_scene, scale, selection};
use crate::error::Error;
use crate::film::Image;
use crate::particles::Radii;
use crate::render::confidence::{Interpolation, Neighborhood, Options, Population, Report};
use crate::render::gpu::{Gpu, Renderer, Resident, Tiling, Tilings};
use crate::render::{self, Culling, Settings};
use crate::scene::Scene;
use crate::scene::camera::{Camera, Projection};
use crate::scene::color::ParticleColors;
use crate::scene::light::Lighting;
use crate::structure::{Kind, Packing, Structure};
use crate::synthetic;

/// A device whose kernels see as many buffers as culling needs, or none: then it is said that the test is skipped.
fn roomy_device() -> Option<Gpu> {
    let gpu = device(None)?;
    if gpu.storage_buffers() < 16 {
        println!("skipped: a kernel has too few buffers");
        return None;
    }
    Some(gpu)
}

/// Few voxels, and an early end.
const QUICK: Options = Options {
    voxel_count: 12,
    occlusion_confidence: 0.9,
    convergence_samples: 24,
    frame_samples: 4,
    depth_quantization: true,
    density_interpolation: Interpolation::Nearest,
    neighborhood: Neighborhood::Kernel(1),
    population: Population::Frustum,
    sample_budget: 25,
};

/// Every option in turn.
fn options(number: usize) -> Options {
    [
        QUICK,
        Options { neighborhood: Neighborhood::Kernel(3), ..QUICK },
        Options { neighborhood: Neighborhood::Pyramid(2), ..QUICK },
        Options { depth_quantization: false, ..QUICK },
        Options { density_interpolation: Interpolation::Trilinear, ..QUICK },
        Options { population: Population::UpToDepth, ..QUICK },
        Options { sample_budget: 60, frame_samples: 1, ..QUICK },
        Options { frame_samples: 16, occlusion_confidence: 0.5, ..QUICK },
    ][number % 8]
}

fn settings(options: Options, samples: u32) -> Settings {
    Settings { width: 43, height: 31, samples, seed: 7, culling: Culling::Confidence(options) }
}

/// The picture, and what culling knows at its end.
fn culled_on_card(gpu: &Gpu, scene: &Scene, camera: &Camera, settings: &Settings) -> (Image, Report) {
    let resident = Resident::load(gpu, scene, &()).unwrap();
    let mut renderer = Renderer::new(&resident, scene, camera, settings).unwrap();
    while !renderer.is_done() {
        renderer.pass(&()).unwrap();
    }
    (renderer.image().unwrap(), renderer.confidence().unwrap().unwrap())
}

fn culled_on_cpu(scene: &Scene, camera: &Camera, settings: &Settings) -> (Image, Report) {
    let mut renderer = render::Renderer::new(scene, camera, settings).unwrap();
    while !renderer.is_done() {
        renderer.pass(&()).unwrap();
    }
    (renderer.image(), renderer.confidence().unwrap())
}

/// In how many pixels rays end elsewhere.
fn other_ends(a: &Report, b: &Report, scale: f32) -> usize {
    assert_eq!(a.depths.len(), b.depths.len());
    let is_near = |a: f32, b: f32| {
        let tolerance = 1e-4 * a.abs().max(b.abs()) + 4e-6 * scale;
        a == b || (a - b).abs() <= tolerance.min(f32::MAX)
    };
    a.depths.iter().zip(&b.depths).filter(|&(&a, &b)| !is_near(a, b)).count()
}

fn is_the_same(a: &Image, b: &Image) -> bool {
    let bits = |image: &Image| {
        let color: Vec<[u32; 4]> = image.color.iter().map(|color| color.map(f32::to_bits)).collect();
        let depth: Vec<u32> = image.depth.iter().map(|depth| depth.to_bits()).collect();
        (color, depth, image.id.clone())
    };
    bits(a) == bits(b)
}

#[test]
fn a_ray_that_ends_elsewhere_is_seen_by_the_comparison() {
    let report = Report {
        depths: vec![1.0, f32::INFINITY],
        converged: 1.0,
        voxels: [1; 3],
        grid_bytes: 0,
        pixel_bytes: 0,
    };
    assert_eq!(other_ends(&report, &report, 1.0), 0);
    for depths in [vec![1.001, f32::INFINITY], vec![1.0, 3.0]] {
        assert_eq!(other_ends(&report, &Report { depths, ..report.clone() }, 1.0), 1);
    }
    let image = Image { width: 1, height: 1, color: vec![[0.5; 4]], depth: vec![1.0], id: vec![3] };
    assert!(is_the_same(&image, &image));
    assert!(!is_the_same(
        &image,
        &Image { color: vec![[0.5, 0.5, 0.5 + f32::EPSILON, 0.5]], ..image.clone() }
    ));
}

#[test]
fn kernels_with_few_buffers_are_told() {
    let Some(gpu) = device(None) else { return };
    let (scene, camera) = random_scene(0, Packing::Exact, Lighting::Headlight);
    let resident = Resident::load(&gpu, &scene, &()).unwrap();
    let made = Renderer::new(&resident, &scene, &camera, &settings(QUICK, 4));
    // The scene, its grid, what pixels know, and the film.
    match made.err() {
        Some(Error::Device(why)) => {
            assert!(gpu.storage_buffers() < 16 && why.contains("--device cpu"), "{why}")
        }
        other => assert!(other.is_none() && gpu.storage_buffers() > 10, "{other:?}"),
    }
}

#[test]
fn the_card_culls_what_the_cpu_culls() {
    let Some(gpu) = roomy_device() else { return };
    let mut compared = Compared::default();
    // Every law, packing and option; of the first sixteen, which are large, those in which rays meet few particles.
    for seed in [0, 2, 3, 10, 11, 14, 15].into_iter().chain(16..32) {
        let packing =
            [Packing::Exact, Packing::Bits16, Packing::Bits11, Packing::Bits8][seed as usize / 8 % 4];
        let (scene, camera) = random_scene(seed, packing, Lighting::Headlight);
        compared.add(&gpu, &scene, &camera, seed);
    }
    compared.are_alike(5_000, 2_000);
}

#[test]
fn what_is_hidden_takes_no_part_in_culling() {
    let Some(gpu) = roomy_device() else { return };
    let (mut compared, mut changed) = (Compared::default(), 0);
    // Of the two laws by which a ray can meet all particles, scenes of 129, not of 2,000.
    for (number, seed) in [0, 81, 82].into_iter().chain(3..12).enumerate() {
        let packing = [Packing::Exact, Packing::Bits16, Packing::Bits8][number / 4];
        let (mut scene, rules, camera) = selection::random_scene(seed, Kind::Bvh(packing));
        scene.lighting = Lighting::Headlight;
        // Without rules the card is compared above.
        let all = render::render(&scene, &camera, &settings(options(seed as usize / 3), 48), &());
        rules.apply(scene.structure_mut());
        let shown = compared.add(&gpu, &scene, &camera, seed);
        if let (Ok(all), Some(shown)) = (all, shown) {
            changed += differing_pixels(&all, &shown, scale(&camera));
        }
    }
    compared.are_alike(2_500, 500);
    assert!(changed > 1_500, "{changed} pixels changed: the scenes test nothing");
}

/// Pixels of both machines' pictures.
#[derive(Default)]
struct Compared {
    pixels: usize,
    /// That met a particle, and whose rays are cut.
    met: usize,
    cut: usize,
    /// That are another color, id or distance, and whose rays end elsewhere.
    differing: usize,
    ends: usize,
}

impl Compared {
    /// Adds a picture by both; gives the card's. Both refuse a grid of too many voxels: then there is none.
    fn add(&mut self, gpu: &Gpu, scene: &Scene, camera: &Camera, seed: u64) -> Option<Image> {
        let settings = settings(options(seed as usize / 3), 48);
        if render::Renderer::new(scene, camera, &settings).is_err() {
            // A plane of no thickness would have more slices than there can be, on either machine.
            let resident = Resident::load(gpu, scene, &()).unwrap();
            assert!(Renderer::new(&resident, scene, camera, &settings).is_err(), "seed {seed}");
            return None;
        }
        let (expected, known) = culled_on_cpu(scene, camera, &settings);
        let (found, learned) = culled_on_card(gpu, scene, camera, &settings);
        let differs = differing_pixels(&expected, &found, scale(camera));
        let elsewhere = other_ends(&known, &learned, scale(camera));
        assert_eq!(learned.voxels, known.voxels);
        let cuts = known.depths.iter().filter(|depth| depth.is_finite()).count();
        println!(
            "seed {seed}: {differs} differ, {elsewhere} end elsewhere, {cuts} are cut, {} and {} are final",
            known.converged, learned.converged
        );
        self.met += expected.id.iter().filter(|&&id| id >= 0).count();
        (self.pixels, self.cut) = (self.pixels + expected.id.len(), self.cut + cuts);
        (self.differing, self.ends) = (self.differing + differs, self.ends + elsewhere);
        Some(found)
    }

    /// Demands that at most one pixel in a hundred differs, of pictures that show and cut something.
    fn are_alike(&self, least_met: usize, least_cut: usize) {
        let Self { pixels, met, cut, differing, ends } = *self;
        println!(
            "{differing} of {pixels} pixels differ, {ends} end elsewhere; {cut} are cut, {met} met a particle"
        );
        assert!(met > least_met && cut > least_cut, "{met} met, {cut} are cut");
        assert!(differing * 100 < pixels && ends * 100 < pixels, "{differing} and {ends} of {pixels}");
    }
}

#[test]
fn structures_of_single_rays_are_refused_with_confidence() {
    let Some(gpu) = device(None) else { return };
    let particles = synthetic::generate("uniform?n=100&seed=2", &()).unwrap();
    let kind = Kind::Pkd(crate::structure::pkd::Options::default());
    let structure = Structure::build(kind, particles, &Radii::Uniform(0.01), 1.0, &()).unwrap();
    let scene = Scene::new(structure, ParticleColors::constant([0.7; 3]), Lighting::Headlight, None);
    let (_, camera, _) = far_sight([8, 8]);
    let resident = Resident::load(&gpu, &scene, &()).unwrap();
    let refused = Renderer::new(&resident, &scene, &camera, &settings(QUICK, 4)).err();
    assert!(matches!(refused, Some(Error::Setting { .. })), "{refused:?}");
}

#[test]
fn a_threshold_that_is_never_reached_changes_no_bit_on_the_card() {
    let Some(gpu) = roomy_device() else { return };
    for seed in 8..20_u64 {
        let (scene, camera) = random_scene(seed, Packing::Exact, Lighting::Headlight);
        let samples = [1, 4, 16][seed as usize % 3];
        let options = Options { occlusion_confidence: 1.5, frame_samples: samples, ..options(seed as usize) };
        let culled = settings(options, samples);
        let resident = Resident::load(&gpu, &scene, &()).unwrap();
        if Renderer::new(&resident, &scene, &camera, &culled).is_err() {
            continue;
        }
        let expected = on_card(&gpu, &scene, &camera, &Settings { culling: Culling::Off, ..culled }, None);
        let (found, report) = culled_on_card(&gpu, &scene, &camera, &culled);
        assert!(is_the_same(&expected, &found), "seed {seed}");
        assert!(report.depths.iter().all(|depth| depth.is_infinite()), "seed {seed}");
    }
}

/// Walks of other shapes than the default: without parts, with parts soon, and with many threads a pixel.
fn tilings(number: usize) -> Option<Tilings> {
    let tiling = |tile, split, nodes| Tiling { tile, split, nodes };
    [
        None,
        Some(Tilings { first: tiling([8, 4], 4, 8), patience: 0, second: tiling([4, 4], 4, 8) }),
        Some(Tilings { first: tiling([8, 8], 1, 4), patience: 4, second: tiling([4, 4], 4, 8) }),
        Some(Tilings { first: tiling([4, 4], 4, 4), patience: 9, second: tiling([2, 2], 16, 8) }),
        Some(Tilings { first: tiling([16, 16], 1, 16), patience: 40, second: tiling([8, 8], 4, 16) }),
    ][number % 5]
}

/// The picture, and how many leaves passes knew of.
fn certified_on_card(
    gpu: &Gpu,
    (scene, camera): (&Scene, &Camera),
    settings: &Settings,
    tilings: Option<Tilings>,
) -> (Image, u64) {
    let resident = Resident::load(gpu, scene, &()).unwrap();
    let mut renderer = Renderer::new(&resident, scene, camera, settings).unwrap();
    if let Some(tilings) = tilings {
        renderer = renderer.with_tilings(tilings);
    }
    renderer.prepare(&()).unwrap();
    // What was noted of another view is of no use for this one.
    let mut turned = *camera;
    turned.up = -turned.up;
    renderer.restart(&turned).unwrap();
    renderer.pass(&()).unwrap();
    renderer.restart(camera).unwrap();
    while !renderer.is_done() {
        renderer.pass(&()).unwrap();
    }
    (renderer.image().unwrap(), renderer.counts().unwrap().remembered_leaves)
}

/// How many leaves later passes knew of; fails if certified culling changes the picture.
fn leaves_known(gpu: &Gpu, scene: &Scene, camera: &Camera, seed: u64) -> u64 {
    let samples = [33, 48, 64][seed as usize % 3];
    let culling = Culling::default();
    let settings = Settings { width: 37, height: 29, samples, seed: seed as u32, culling };
    let tilings = tilings(seed as usize);
    let off = Settings { culling: Culling::Off, ..settings };
    let expected = on_card(gpu, scene, camera, &off, tilings);
    let (found, leaves) = certified_on_card(gpu, (scene, camera), &settings, tilings);
    assert!(is_the_same(&expected, &found), "seed {seed}, {samples} samples, {tilings:?}");
    leaves
}

#[test]
fn certified_culling_changes_no_bit_on_the_card() {
    let Some(gpu) = roomy_device() else { return };
    let (mut known, mut known_of_shown) = (0, 0);
    // Every law, and every tiling twice.
    for seed in 0..10_u64 {
        let studio = Lighting::studio(glam::Vec3::X, glam::Vec3::NEG_Y, glam::Vec3::Z);
        let lighting = if seed == 4 { studio } else { Lighting::Headlight };
        let packing = [Packing::Exact, Packing::Bits16][seed as usize % 2];
        let (scene, camera) = random_scene(seed, packing, lighting);
        known += leaves_known(&gpu, &scene, &camera, seed);
        if seed % 2 == 1 {
            continue;
        }
        let (mut scene, rules, camera) = selection::random_scene(seed, Kind::Bvh(packing));
        rules.apply(scene.structure_mut());
        known_of_shown += leaves_known(&gpu, &scene, &camera, seed);
    }
    println!("{known} leaves were known, {known_of_shown} where particles are hidden");
    assert!(known > 2_000 && known_of_shown > 300, "{known}, {known_of_shown}");
}

/// A cloud through which one sees far, in a picture of so many pixels.
fn far_sight(size: [u32; 2]) -> (Scene, Camera, Settings) {
    let particles = synthetic::generate("uniform?n=2e4&seed=2", &()).unwrap();
    let structure =
        Structure::build(Kind::Bvh(Packing::Exact), particles, &Radii::Uniform(0.004), 1.0, &()).unwrap();
    let scene = Scene::new(structure, ParticleColors::constant([0.7; 3]), Lighting::Headlight, None);
    let look_at = scene.structure().origin() + scene.structure().bounds().center().as_dvec3();
    let camera = Camera {
        eye: look_at - 2.0 * glam::DVec3::X,
        look_at,
        up: glam::DVec3::Z,
        projection: Projection::Orthographic { height: 1.0 },
    };
    let [width, height] = size;
    (scene, camera, Settings { width, height, samples: 48, seed: 3, culling: Culling::default() })
}

#[test]
fn a_later_pass_looks_for_nothing_that_the_first_has_found() {
    let Some(gpu) = roomy_device() else { return };
    let (scene, camera, settings) = far_sight([64, 64]);
    let resident = Resident::load(&gpu, &scene, &()).unwrap();
    let mut renderer = Renderer::new(&resident, &scene, &camera, &settings).unwrap();
    let first = renderer.count_work(&()).unwrap().unwrap();
    let again = renderer.count_work_again(&()).unwrap().unwrap();
    println!("first {first:?}, again {again:?}");
    assert!(again.leaves > 0 && again.tests > 0, "{again:?}");
    assert!(again.nodes * 4 < first.nodes && again.steps < first.steps, "first {first:?}, again {again:?}");
    let off = Settings { culling: Culling::Off, ..settings };
    let mut renderer = Renderer::new(&resident, &scene, &camera, &off).unwrap();
    assert_eq!(renderer.count_work_again(&()).unwrap(), None);
}

#[test]
fn a_tile_with_too_much_to_note_begins_at_the_root() {
    let Some(gpu) = roomy_device() else { return };
    // All of the 1,250 leaves lie in four tiles.
    let (scene, camera, settings) = far_sight([9, 7]);
    let tilings = Some(Tilings { patience: 0, ..Tilings::of(16, 20_000) });
    let off = Settings { culling: Culling::Off, ..settings };
    let expected = on_card(&gpu, &scene, &camera, &off, tilings);
    let (found, leaves) = certified_on_card(&gpu, (&scene, &camera), &settings, tilings);
    assert!(is_the_same(&expected, &found));
    println!("{leaves} leaves were known");
    // At most those of the tiles at the border, which see a column and a few rows of pixels.
    assert!(leaves < 2 * 1250, "{leaves}");
}
