//! Culling by confidence: what must not change, what must be the same whoever works, and what every ray must tell of itself.

use glam::Vec3;

use super::scenes::{LAWS, Law, Random, camera, particles};
use super::visibility::{COUNTS, KINDS, differing_pixels, scene};
use crate::math::{Ray, enter_sphere};
use crate::particles::Radii;
use crate::render::confidence::{Interpolation, Neighborhood, Options, Population};
use crate::render::{Culling, Renderer, Settings, render};
use crate::scene::camera::Camera;
use crate::scene::color::ParticleColors;
use crate::scene::light::Lighting;
use crate::scene::{Scene, camera as cameras};
use crate::structure::{Kind, Structure, Visits, pkd};
use crate::{Image, synthetic};

fn settings(options: Options, samples: u32) -> Settings {
    Settings { width: 45, height: 37, samples, seed: 3, culling: Culling::Confidence(options) }
}

/// Few voxels, and an early end.
const QUICK: Options = Options {
    voxel_count: 24,
    occlusion_confidence: 0.95,
    convergence_samples: 32,
    frame_samples: 4,
    depth_quantization: true,
    density_interpolation: Interpolation::Nearest,
    neighborhood: Neighborhood::Kernel(1),
    population: Population::Frustum,
    sample_budget: 25,
};

#[test]
fn a_threshold_that_is_never_reached_changes_no_bit() {
    for seed in 0..48 {
        let mut random = Random::new(7000 + seed);
        let law = LAWS[seed as usize % LAWS.len()];
        let count = [0, 1, 2, 17, 200, 700][seed as usize / LAWS.len() % 6];
        let (particles, radii) = particles(law, count, &mut random);
        let camera = camera(&particles.bounds(), &mut random);
        let options = Options {
            occlusion_confidence: 1.5,
            depth_quantization: random.below(2) == 0,
            density_interpolation: [Interpolation::Nearest, Interpolation::Trilinear]
                [random.below(2) as usize],
            neighborhood: [Neighborhood::Kernel(3), Neighborhood::Pyramid(2)][random.below(2) as usize],
            voxel_count: 3,
            ..QUICK
        };
        let culled = Settings { width: 21, height: 13, ..settings(options, 12) };
        let off = Settings { culling: Culling::Off, ..culled };
        for kind in KINDS {
            let scene = scene(&particles, &radii, kind, Lighting::Headlight);
            let [expected, found] = [off, culled].map(|it| render(&scene, &camera, &it, &()).unwrap());
            let differing = differing_pixels(&expected, &found);
            assert_eq!(differing, 0, "seed {seed}: {law:?}, {count} particles, {kind:?}, {options:?}");
        }
    }
}

/// A dense ball of many small particles, seen along an axis and obliquely, from near and from far.
fn dense() -> (Scene, [Camera; 4]) {
    let particles = synthetic::generate("packed?n=2e5&seed=2", &()).unwrap();
    let radii = particles.radii().unwrap().clone();
    let kind = Kind::Pkd(pkd::Options::default());
    let structure = Structure::build(kind, particles, &radii, 1.0, &()).unwrap();
    let (bounds, origin) = (structure.bounds(), structure.origin());
    let corners = cameras::corners(&bounds, origin);
    let center = origin + bounds.center().as_dvec3();
    let camera = |direction: Vec3, angle| {
        Camera::framing(center, &corners, direction.as_dvec3(), glam::DVec3::Z, 45.0 / 37.0, angle)
    };
    let oblique = Vec3::new(-2.0, -1.3, -1.0);
    let cameras = [
        camera(Vec3::X, None),
        camera(oblique, None),
        camera(Vec3::X, Some(0.6)),
        camera(oblique, Some(0.6)),
    ];
    let colors = ParticleColors::constant([0.6, 0.7, 0.9]);
    (Scene::new(structure, colors, Lighting::Headlight, Some([1.0; 3])), cameras)
}

#[test]
fn pixels_that_are_covered_are_culled_and_the_picture_hardly_changes() {
    let (scene, cameras) = dense();
    for camera in cameras {
        let off = Settings { culling: Culling::Off, ..settings(QUICK, 400) };
        let expected = render(&scene, &camera, &off, &()).unwrap();
        for neighborhood in [Neighborhood::Kernel(1), Neighborhood::Kernel(3), Neighborhood::Pyramid(1)] {
            let culled = settings(Options { neighborhood, ..QUICK }, 400);
            let mut renderer = Renderer::new(&scene, &camera, &culled).unwrap();
            assert_eq!(renderer.confidence().unwrap().converged, 0.0);
            while !renderer.is_done() {
                renderer.pass(&()).unwrap();
            }
            let report = renderer.confidence().unwrap();
            assert_eq!(report.converged, 1.0, "{camera:?} {neighborhood:?}");
            let found = renderer.image();
            let covered = expected.color.iter().filter(|color| color[3] > 0.0 && color[0] < 1.0).count();
            let cut = report.depths.iter().filter(|depth| depth.is_finite()).count();
            assert!(cut * 3 > covered, "{camera:?} {neighborhood:?}: {cut} of {covered}");
            // One ray in twenty may miss by the threshold alone: the mean of what is white and what is not differs by less.
            let error = mean_error(&expected, &found);
            assert!(error < 0.05, "{camera:?} {neighborhood:?}: {error}");
        }
    }
}

fn mean_error(a: &Image, b: &Image) -> f32 {
    let sum: f32 = a.color.iter().zip(&b.color).map(|(a, b)| (a[0] - b[0]).abs()).sum();
    sum / a.color.len() as f32
}

#[test]
fn a_larger_kernel_cuts_deeper_or_not_at_all() {
    let (scene, cameras) = dense();
    let depths = |neighborhood| {
        let settings = settings(Options { neighborhood, ..QUICK }, 40);
        let mut renderer = Renderer::new(&scene, &cameras[1], &settings).unwrap();
        // Before the first cut all that pixels know is the same.
        renderer.pass(&()).unwrap();
        renderer.confidence().unwrap().depths
    };
    let (one, three) = (depths(Neighborhood::Kernel(1)), depths(Neighborhood::Kernel(3)));
    assert!(one.iter().any(|depth| depth.is_finite()));
    assert!(one.iter().zip(&three).all(|(one, three)| three >= one || one.is_infinite()));
}

#[test]
fn any_number_of_threads_culls_the_same() {
    let (scene, cameras) = dense();
    for options in [QUICK, Options { neighborhood: Neighborhood::Kernel(3), ..QUICK }] {
        let rendered = [1, 2, 5].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut renderer = Renderer::new(&scene, &cameras[3], &settings(options, 48)).unwrap();
                while !renderer.is_done() {
                    renderer.pass(&()).unwrap();
                }
                (renderer.image(), renderer.confidence().unwrap())
            })
        });
        assert!(rendered[0].1.depths.iter().any(|depth| depth.is_finite()));
        for other in &rendered[1..] {
            assert_eq!(differing_pixels(&rendered[0].0, &other.0), 0);
            assert_eq!(rendered[0].1, other.1);
        }
    }
}

#[test]
fn a_renderer_that_starts_anew_forgets_what_is_hidden() {
    let (scene, cameras) = dense();
    let settings = settings(QUICK, 24);
    let expected = render(&scene, &cameras[0], &settings, &()).unwrap();
    let mut renderer = Renderer::new(&scene, &cameras[1], &settings).unwrap();
    while !renderer.is_done() {
        renderer.pass(&()).unwrap();
    }
    renderer.restart(&cameras[0]).unwrap();
    while !renderer.is_done() {
        renderer.pass(&()).unwrap();
    }
    assert_eq!(differing_pixels(&expected, &renderer.image()), 0);
}

#[test]
fn culling_stands_degenerate_scenes() {
    for seed in 0..60 {
        let mut random = Random::new(8000 + seed);
        let law = LAWS[seed as usize % LAWS.len()];
        let (particles, radii) = particles(law, [0, 1, 2, 300][random.below(4) as usize], &mut random);
        let radii = if seed % 5 == 0 { Radii::Uniform(0.0) } else { radii };
        let camera = camera(&particles.bounds(), &mut random);
        let options = Options { occlusion_confidence: 0.3, voxel_count: 3, ..QUICK };
        for kind in KINDS {
            let scene = scene(&particles, &radii, kind, Lighting::Headlight);
            let settings = Settings { width: 21, height: 13, ..settings(options, 64) };
            let Ok(image) = render(&scene, &camera, &settings, &()) else {
                // A plane of no thickness would have more slices than there can be.
                assert!(matches!(law, Law::Planar | Law::Collinear | Law::MixedRadii), "{law:?}");
                continue;
            };
            assert!(image.color.iter().flatten().all(|value| value.is_finite()), "seed {seed}: {law:?}");
        }
    }
}

#[test]
fn a_knob_that_is_out_of_range_is_named() {
    let (scene, cameras) = dense();
    for (options, name) in [
        (Options { voxel_count: 0, ..QUICK }, "voxel-count"),
        (Options { occlusion_confidence: f32::NAN, ..QUICK }, "occlusion-confidence"),
        (Options { convergence_samples: 0, ..QUICK }, "convergence-samples"),
        (Options { frame_samples: 5, ..QUICK }, "frame-samples"),
        (Options { neighborhood: Neighborhood::Kernel(4), ..QUICK }, "kernel-size"),
        (Options { neighborhood: Neighborhood::Pyramid(9), ..QUICK }, "pyramid-level"),
        (Options { sample_budget: 0, ..QUICK }, "sample-budget"),
        (Options { voxel_count: 4096, ..QUICK }, "voxel-count"),
    ] {
        let error = Renderer::new(&scene, &cameras[0], &settings(options, 4)).err().unwrap();
        assert!(error.to_string().starts_with(name), "{error}");
    }
}

#[test]
fn every_structure_tells_every_hit_and_what_the_first_one_took() {
    for seed in 0..100 {
        let mut random = Random::new(9000 + seed);
        let law = LAWS[seed as usize % LAWS.len()];
        let count = COUNTS[random.below(COUNTS.len() as u32) as usize];
        let (particles, radii) = particles(law, count, &mut random);
        let size = particles.bounds().extent().max_element().max(1e-30);
        let structures =
            KINDS.map(|kind| Structure::build(kind, particles.clone(), &radii, 1.0, &()).unwrap());
        for _ in 0..20 {
            let direction = random.vector().normalize_or(Vec3::Z);
            let t_max = if random.below(3) == 0 { size * random.unit() } else { f32::INFINITY };
            let ray = Ray { origin: random.vector() * size, direction, t_min: 0.0, t_max };
            for structure in &structures {
                let mut expected: Vec<(u32, u32)> = (0..structure.len() as u32)
                    .map(|node| {
                        let (center, radius) = structure.sphere(node);
                        (enter_sphere(&ray, center, radius), node)
                    })
                    .filter(|&(t, _)| t < t_max)
                    .map(|(t, node)| (node, t.to_bits()))
                    .collect();
                let mut found = Vec::new();
                let first = structure.hits(&ray, &mut |t, node| found.push((node, t.to_bits())));
                expected.sort_unstable();
                found.sort_unstable();
                assert_eq!(found, expected, "seed {seed}: {law:?}");
                let mut visits = Visits::default();
                let counted = structure.intersect_counted(&ray, &mut visits);
                assert_eq!(first, structure.intersect(&ray, None), "seed {seed}: {law:?}");
                assert_eq!(first, counted, "seed {seed}: {law:?}");
                assert!(counted.is_none() || visits.particles > 0);
                // Heaps try some of their topmost particles twice.
                assert!(visits.particles <= 2 * structure.len().next_multiple_of(16) as u64);
            }
        }
    }
}
