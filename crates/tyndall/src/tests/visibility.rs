//! What every structure and kernel finds equals what brute force finds, bit for bit.

use super::scenes::{LAWS, Law, Random, camera, particles};
use crate::film::Image;
use crate::math::Ray;
use crate::particles::{Attribute, Columns, Particles, Positions, Radii, Values};
use crate::render::{Culling, Renderer, Settings};
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::scene::color;
use crate::scene::coloring::Mapping;
use crate::scene::light::Lighting;
use crate::structure::pkd::{Axis, Options, Order};
use crate::structure::treelets::{self, Cut};
use crate::structure::{Hit, Kind, Packing, Structure};
use fearless_simd::{Level, Simd};
use glam::Vec3;

const fn treelets(size: u32, cut: Cut, axis: Axis, order: Order) -> Kind {
    Kind::Treelets(treelets::Options { size, cut, heap: Options { axis, order } })
}

pub(super) const KINDS: [Kind; 12] = [
    Kind::Bvh(Packing::Exact),
    Kind::Brute,
    Kind::Pkd(Options { axis: Axis::WidestExtent, order: Order::NodeFirst }),
    Kind::Pkd(Options { axis: Axis::WidestExtent, order: Order::NearChildFirst }),
    Kind::Pkd(Options { axis: Axis::RoundRobin, order: Order::NodeFirst }),
    Kind::Pkd(Options { axis: Axis::RoundRobin, order: Order::NearChildFirst }),
    treelets(16, Cut::Median, Axis::WidestExtent, Order::NodeFirst),
    treelets(64, Cut::Median, Axis::WidestExtent, Order::NearChildFirst),
    treelets(1024, Cut::Median, Axis::RoundRobin, Order::NodeFirst),
    treelets(16, Cut::Middle, Axis::RoundRobin, Order::NearChildFirst),
    treelets(100, Cut::Middle, Axis::WidestExtent, Order::NodeFirst),
    treelets(4096, Cut::Middle, Axis::WidestExtent, Order::NodeFirst),
];

pub(super) const COUNTS: [usize; 10] = [0, 1, 2, 3, 16, 17, 100, 129, 700, 3000];

/// Every particle has a color of its own, of a few.
pub(super) fn scene(particles: &Particles, radii: &Radii, kind: Kind, lighting: Lighting) -> Scene {
    let structure = Structure::build(kind, particles.clone(), radii, 1.0, &()).unwrap();
    let colors = color::resolve(particles, &"radius".parse().unwrap(), &Mapping::default()).unwrap();
    Scene::new(structure, colors, lighting, None)
}

pub(super) fn image(scene: &Scene, camera: &Camera, settings: &Settings, level: Level) -> Image {
    let mut renderer = Renderer::new(scene, camera, settings).unwrap().with_level(level);
    renderer.finish(&()).unwrap();
    renderer.image()
}

/// How many pixels differ in any bit of any layer.
pub(super) fn differing_pixels(a: &Image, b: &Image) -> usize {
    let bits =
        |image: &Image, k: usize| (image.color[k].map(f32::to_bits), image.depth[k].to_bits(), image.id[k]);
    assert_eq!((a.width, a.height), (b.width, b.height));
    (0..a.color.len()).filter(|&k| bits(a, k) != bits(b, k)).count()
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
        |image: &mut Image| image.color[1][2] = 0.5_f32.next_up(),
        |image: &mut Image| image.depth[0] = 1.0_f32.next_down(),
        |image: &mut Image| image.id[1] = 0,
    ] {
        let mut altered = image.clone();
        alter(&mut altered);
        assert_eq!(differing_pixels(&image, &altered), 1);
    }
}

#[test]
fn every_structure_renders_what_brute_force_renders() {
    let mut met = 0;
    // Every law with every number of particles, twice.
    for seed in 0..160 {
        let mut random = Random::new(seed);
        let law = LAWS[seed as usize % LAWS.len()];
        let count = COUNTS[seed as usize / LAWS.len() % COUNTS.len()];
        let (particles, radii) = particles(law, count, &mut random);
        let camera = camera(&particles.bounds(), &mut random);
        let samples = [1, 4, 16][random.below(3) as usize];
        let settings = Settings { width: 21, height: 13, samples, seed: seed as u32, culling: Culling::Off };
        let brute = scene(&particles, &radii, Kind::Brute, Lighting::Headlight);
        let expected = image(&brute, &camera, &settings, Level::new());
        met += expected.id.iter().filter(|&&id| id >= 0).count();
        for kind in KINDS.into_iter().filter(|&kind| kind != Kind::Brute) {
            let scene = scene(&particles, &radii, kind, Lighting::Headlight);
            let found = image(&scene, &camera, &settings, Level::new());
            let differing = differing_pixels(&expected, &found);
            assert_eq!(
                differing, 0,
                "seed {seed}: {law:?}, {count} particles, {samples} samples, {kind:?}, {camera:?}"
            );
        }
    }
    assert!(met > 10_000, "only {met} pixels met a particle: the scenes test nothing");
}

#[test]
fn every_structure_casts_the_shadows_that_brute_force_casts() {
    for seed in 0..40 {
        let mut random = Random::new(1000 + seed);
        let law = LAWS[seed as usize % LAWS.len()];
        let (particles, radii) = particles(law, 400, &mut random);
        let camera = camera(&particles.bounds(), &mut random);
        let settings =
            Settings { width: 16, height: 16, samples: 4, seed: seed as u32, culling: Culling::Off };
        let studio = Lighting::studio(Vec3::X, Vec3::NEG_Y, Vec3::Z);
        let brute = scene(&particles, &radii, Kind::Brute, studio.clone());
        let expected = image(&brute, &camera, &settings, Level::new());
        for kind in KINDS {
            let scene = scene(&particles, &radii, kind, studio.clone());
            let differing = differing_pixels(&expected, &image(&scene, &camera, &settings, Level::new()));
            assert_eq!(differing, 0, "seed {seed}: {law:?}, {kind:?}");
        }
    }
}

#[test]
fn packed_particles_are_rendered_as_brute_force_renders_what_the_blocks_decode() {
    for packing in [Packing::Bits16, Packing::Bits11, Packing::Bits8] {
        for seed in 0..40 {
            let mut random = Random::new(6000 + seed);
            let law = LAWS[seed as usize % LAWS.len()];
            let count = COUNTS[seed as usize / LAWS.len() % COUNTS.len()];
            let (particles, radii) = particles(law, count, &mut random);
            let packed = Structure::build(Kind::Bvh(packing), particles.clone(), &radii, 1.0, &()).unwrap();
            let (decoded, decoded_radii) = decoded(&packed);
            let camera = camera(&particles.bounds(), &mut random);
            let settings =
                Settings { width: 21, height: 13, samples: 16, seed: seed as u32, culling: Culling::Off };
            for lighting in [Lighting::Headlight, Lighting::studio(Vec3::X, Vec3::NEG_Y, Vec3::Z)] {
                let expected = scene(&decoded, &decoded_radii, Kind::Brute, lighting.clone());
                let expected = image(&expected, &camera, &settings, Level::new());
                let colors = color::resolve(&decoded, &"radius".parse().unwrap(), &Mapping::default());
                let packed = Structure::build(Kind::Bvh(packing), particles.clone(), &radii, 1.0, &());
                let packed = Scene::new(packed.unwrap(), colors.unwrap(), lighting, None);
                let found = image(&packed, &camera, &settings, Level::new());
                assert_eq!(differing_pixels(&expected, &found), 0, "seed {seed}: {law:?}, {packing:?}");
            }
        }
    }
}

#[test]
fn scaled_radii_are_seen_as_if_they_had_been_built() {
    for seed in 0..60 {
        let mut random = Random::new(7000 + seed);
        let law = LAWS[seed as usize % LAWS.len()];
        let count = COUNTS[seed as usize / LAWS.len() % COUNTS.len()];
        let (particles, radii) = particles(law, count, &mut random);
        let scale = [0.0, 0.3, 0.999, 1.0, 1.7, 20.0][random.below(6) as usize];
        let camera = camera(&particles.bounds(), &mut random);
        let settings = Settings {
            width: 21,
            height: 13,
            samples: [1, 16][seed as usize % 2],
            seed: 3,
            culling: Culling::default(),
        };
        let studio = Lighting::studio(Vec3::X, Vec3::NEG_Y, Vec3::Z);
        for kind in [KINDS[0], KINDS[1], KINDS[2], KINDS[5], KINDS[7], KINDS[10]] {
            let built = |scale: f32| Structure::build(kind, particles.clone(), &radii, scale, &()).unwrap();
            let seen = |structure: Structure| {
                let colors = color::resolve(&particles, &"radius".parse().unwrap(), &Mapping::default());
                let scene = Scene::new(structure, colors.unwrap(), studio.clone(), None);
                image(&scene, &camera, &settings, Level::new())
            };
            let mut scaled = built(1.0);
            // Not from one scale to the next, but from what was built.
            scaled.scale_radii(3.0);
            scaled.scale_radii(scale);
            let differing = differing_pixels(&seen(built(scale)), &seen(scaled));
            assert_eq!(differing, 0, "seed {seed}: {law:?}, {count} particles, {kind:?}, scaled by {scale}");
        }
    }
}

/// The particles as a structure holds them, in order of their ids.
pub(super) fn decoded(structure: &Structure) -> (Particles, Radii) {
    let mut nodes: Vec<u32> = (0..structure.len() as u32).collect();
    nodes.sort_by_key(|&node| structure.ids()[node as usize]);
    let axis = |axis: usize| nodes.iter().map(|&node| structure.sphere(node).0[axis]).collect();
    let positions = Positions::from_offsets(structure.origin(), [axis(0), axis(1), axis(2)]);
    let radii = nodes.iter().map(|&node| structure.sphere(node).1).collect();
    let attributes = vec![Attribute::new("radius", 1, Values::F32(radii))];
    let particles = Particles::new(Columns { positions, attributes, ..Columns::default() }).unwrap();
    (particles, Radii::PerParticle { attribute: 0, scale: 1.0 })
}

#[test]
fn every_width_of_simd_renders_the_same_bits() {
    let widest = Level::new();
    let levels = [
        Some(Level::baseline()),
        widest.as_sse4_2().map(|token| token.level()),
        widest.as_avx2().map(|token| token.level()),
        Some(widest),
    ];
    for seed in 0..24 {
        let mut random = Random::new(2000 + seed);
        let (particles, radii) = particles(LAWS[seed as usize % LAWS.len()], 1000, &mut random);
        let camera = camera(&particles.bounds(), &mut random);
        let settings =
            Settings { width: 33, height: 20, samples: 20, seed: seed as u32, culling: Culling::Off };
        let scene =
            scene(&particles, &radii, Kind::default(), Lighting::studio(Vec3::X, Vec3::NEG_Y, Vec3::Z));
        let expected = image(&scene, &camera, &settings, levels[0].expect("the baseline is always there"));
        for level in levels.into_iter().flatten() {
            let differing = differing_pixels(&expected, &image(&scene, &camera, &settings, level));
            assert_eq!(differing, 0, "seed {seed}, {level:?}");
        }
    }
}

#[test]
fn a_renderer_that_starts_anew_forgets_what_it_saw() {
    let mut random = Random::new(91);
    let (particles, radii) = particles(Law::MixedRadii, 500, &mut random);
    let settings = Settings { width: 40, height: 30, samples: 5, seed: 2, culling: Culling::Off };
    let scene = scene(&particles, &radii, Kind::default(), Lighting::Headlight);
    let [first, second] = [0, 1].map(|_| camera(&particles.bounds(), &mut random));
    let expected = image(&scene, &second, &settings, Level::new());
    let mut renderer = Renderer::new(&scene, &first, &settings).unwrap();
    assert!(renderer.image().shows_nothing(), "no pass, no picture");
    renderer.pass(&()).unwrap();
    renderer.restart(&second).unwrap();
    assert!(renderer.image().shows_nothing(), "no pass, no picture");
    while !renderer.is_done() {
        renderer.pass(&()).unwrap();
    }
    let mut found = image(&scene, &first, &settings, Level::new());
    renderer.image_into(&mut found);
    assert_eq!(differing_pixels(&expected, &found), 0);
}

#[test]
fn one_thread_and_two_render_the_same_bits() {
    let mut random = Random::new(77);
    let (particles, radii) = particles(Law::MixedRadii, 50_000, &mut random);
    let camera = camera(&particles.bounds(), &mut random);
    let settings = Settings { width: 150, height: 70, samples: 16, seed: 5, culling: Culling::Off };
    let rendered = [1, 2].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let scene =
                scene(&particles, &radii, Kind::default(), Lighting::studio(Vec3::X, Vec3::NEG_Y, Vec3::Z));
            image(&scene, &camera, &settings, Level::new())
        })
    });
    assert_eq!(differing_pixels(&rendered[0], &rendered[1]), 0);
}

#[test]
fn rays_find_what_brute_force_finds() {
    for seed in 0..200 {
        let mut random = Random::new(3000 + seed);
        let law = LAWS[seed as usize % LAWS.len()];
        let count = COUNTS[random.below(COUNTS.len() as u32) as usize];
        let (particles, radii) = particles(law, count, &mut random);
        let build = |kind| Structure::build(kind, particles.clone(), &radii, 1.0, &()).unwrap();
        let brute = build(Kind::Brute);
        let structures = KINDS.map(build);
        let size = particles.bounds().extent().max_element().max(1e-30);
        for _ in 0..50 {
            let axis = [Vec3::X, Vec3::NEG_Y, Vec3::Z][random.below(3) as usize];
            let any = random.vector();
            let direction = if random.below(4) == 0 { axis } else { any.normalize_or(Vec3::Z) };
            let origin = if random.below(3) == 0 && count > 0 {
                brute.sphere(random.below(count as u32)).0
            } else {
                random.vector() * size
            };
            let t_max = if random.below(3) == 0 { size * random.unit() } else { f32::INFINITY };
            let ray = Ray { origin, direction, t_min: 0.0, t_max };
            let except = (random.below(2) == 0 && count > 0).then(|| random.below(count as u32));
            let expected = brute.intersect(&ray, except);
            for (kind, structure) in KINDS.iter().zip(&structures) {
                let except = except.and_then(|id| structure.ids().iter().position(|&it| it == id));
                let except = except.map(|node| node as u32);
                let found = structure.intersect(&ray, except);
                let of = |hit: Option<Hit>| hit.map(|hit| (hit.t, hit.id));
                assert_eq!(of(found), of(expected), "seed {seed}: {law:?}, {kind:?}, {ray:?}");
                assert_eq!(
                    structure.occluded(&ray, except),
                    expected.is_some(),
                    "seed {seed}: {law:?}, {kind:?}"
                );
                if let Some(hit) = found {
                    assert_eq!(structure.ids()[hit.node as usize], hit.id, "seed {seed}: {law:?}, {kind:?}");
                }
            }
        }
    }
}
