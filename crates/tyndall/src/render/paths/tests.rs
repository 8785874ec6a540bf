//! Light against what is known in closed form.

mod clear;
mod images;

use glam::{DVec3, Vec3};

use crate::film::Image;
use crate::particles::{Attribute, Columns, Particles, Positions, Radii, Values};
use crate::render::{Settings, render};
use crate::scene::Scene;
use crate::scene::camera::{Camera, Projection};
use crate::scene::color::ParticleColors;
use crate::scene::light::{KeyLight, Lens, Lighting, Lights, Paths, Sky};
use crate::scene::material::Material;
use crate::structure::shapes::Segment;
use crate::structure::{Kind, Structure};

const EVEN_SKY: Sky = Sky { zenith: 1.0, ground: 1.0, up: Vec3::Z };
const NO_KEY: KeyLight = KeyLight { toward: Vec3::Z, angular_radius: 0.1, strength: 0.0 };

/// Spheres by center, radius and grey.
fn scene(spheres: &[([f64; 3], f32, u8)], lighting: Lighting) -> Scene {
    let mut positions = Positions::new();
    let centers: Vec<DVec3> = spheres.iter().map(|sphere| sphere.0.into()).collect();
    positions.extend(&centers);
    let sizes = Values::F32(spheres.iter().map(|sphere| sphere.1).collect());
    let attributes = vec![Attribute::new("radius", 1, sizes)];
    let radii = Radii::PerParticle { attribute: 0, scale: 1.0 };
    let particles = Particles::new(Columns { positions, attributes, ..Columns::default() }).unwrap();
    let structure = Structure::build(Kind::default(), particles, &radii, 1.0, &()).unwrap();
    let greys = spheres.iter().map(|sphere| [sphere.2; 3]).collect();
    let colors = ParticleColors::palette(greys, (0..spheres.len() as u8).collect(), String::new());
    Scene::new(structure, colors, lighting, None)
}

fn lit(material: Material, bounces: u32) -> Paths {
    Paths { lights: Lights::Studio(NO_KEY, EVEN_SKY), material, bounces, lens: None }
}

/// From +y, parallel rays; x to the left.
fn camera(look_at: DVec3, height: f64) -> Camera {
    let projection = Projection::Orthographic { height };
    Camera { eye: look_at + 20.0 * DVec3::Y, look_at, up: DVec3::Z, projection }
}

fn picture(scene: &Scene, camera: &Camera, samples: u32) -> Image {
    let settings = Settings { width: 24, height: 24, samples, seed: 3, ..Settings::default() };
    render(scene, camera, &settings, &()).unwrap()
}

fn mean(image: &Image) -> [f32; 4] {
    std::array::from_fn(|channel| {
        image.color.iter().map(|color| color[channel]).sum::<f32>() / image.color.len() as f32
    })
}

/// The mean of the pixels around the middle.
fn middle(image: &Image) -> f32 {
    let pixels = [11, 12].map(|y| [11, 12].map(|x| image.color[y * 24 + x]));
    pixels.as_flattened().iter().map(|color| color[0]).sum::<f32>() / 4.0
}

fn with(lighting: Lighting, scene: &mut Scene) -> &Scene {
    scene.lighting = lighting;
    scene
}

#[test]
fn in_light_from_everywhere_white_things_are_not_seen() {
    let spheres = [([0.0; 3], 1.0, 255), ([1.2, 0.3, 0.4], 0.8, 255), ([-0.9, 1.0, -0.6], 0.5, 255)];
    let mut scene = scene(&spheres, Lighting::Flat);
    for (material, least) in [
        (Material::Matte { roughness: 0.0 }, 1.0),
        (Material::Clear { index: 1.5 }, 1.0),
        (Material::Glossy { roughness: 0.1, index: 1.5 }, 0.97),
        (Material::Metal { roughness: 0.2 }, 0.95),
    ] {
        let image =
            picture(with(Lighting::Paths(lit(material, 1000)), &mut scene), &camera(DVec3::ZERO, 3.5), 64);
        let [light, .., alpha] = mean(&image);
        assert!(alpha > 0.3, "{alpha}");
        // Sky over alpha is 1 where all light comes back.
        assert!(
            light / alpha < 1.0 + 1e-3 && light / alpha > least - 1e-3,
            "{material:?}: {}",
            light / alpha
        );
    }
}

#[test]
fn a_sphere_is_seen_by_another_as_its_form_factor_says() {
    // A point that faces a sphere of radius r at distance d sees it by the share (r / d)^2 of what it sees at all.
    let (radius, distance) = (0.5_f32, 2.0_f32);
    let tiny = 1e-3;
    let spheres = [([0.0, -f64::from(tiny), 0.0], tiny, 255), ([0.0, f64::from(distance), 0.0], radius, 188)];
    let factor = (radius / distance).powi(2);
    let mut scene = scene(&spheres, Lighting::Flat);
    let grey = scene.color(0)[0].min(scene.color(1)[0]);
    assert!((0.4..0.6).contains(&grey));
    // From between the two, at the point that faces the large one.
    let eye = DVec3::new(0.0, 0.5, 0.0);
    let projection = Projection::Orthographic { height: 1e-5 };
    let camera = Camera { eye, look_at: DVec3::ZERO, up: DVec3::Z, projection };
    for (bounces, expected) in [(0, 1.0 - factor), (1, 1.0 - factor + factor * grey)] {
        let paths = lit(Material::Matte { roughness: 0.0 }, bounces);
        let image = picture(with(Lighting::Paths(paths), &mut scene), &camera, 256);
        let found = mean(&image)[0];
        assert!((found - expected).abs() < 1e-3, "{bounces} bounces: {found} instead of {expected}");
    }
}

#[test]
fn without_bounces_it_is_the_light_of_the_studio() {
    let spheres = [([0.0; 3], 1.0, 255), ([0.9, 0.8, 0.7], 0.6, 188), ([-0.9, 1.0, 0.4], 0.5, 220)];
    let mut scene = scene(&spheres, Lighting::Flat);
    let camera = camera(DVec3::ZERO, 3.0);
    let Lighting::Studio(key, sky) = Lighting::studio(Vec3::NEG_Y, Vec3::NEG_X, Vec3::Z) else { panic!() };
    let expected = picture(with(Lighting::Studio(key, sky), &mut scene), &camera, 1024);
    let material = Material::Matte { roughness: 0.0 };
    let paths = Paths { lights: Lights::Studio(key, sky), material, bounces: 0, lens: None };
    let found = picture(with(Lighting::Paths(paths), &mut scene), &camera, 1024);
    let differ = |of: fn(f32) -> f32| {
        let pairs = expected.color.iter().zip(&found.color);
        pairs.map(|(one, other)| of(one[0] - other[0])).sum::<f32>() / 576.0
    };
    assert!(differ(|it| it).abs() < 1e-3, "{}", differ(|it| it));
    assert!(differ(f32::abs) < 6e-3, "{}", differ(f32::abs));
    assert_eq!((expected.depth, expected.id), (found.depth, found.id));
}

#[test]
fn a_lens_blurs_what_is_not_at_its_focus() {
    // A small sphere becomes a disc of the lens' radius, by its distance from the plane in focus.
    const SIZE: f32 = 0.15;
    let material = Material::Matte { roughness: 0.0 };
    for (focus, height) in [(20.0_f32, 0.5), (10.0, 3.0), (40.0, 2.0)] {
        let lens = Lens { radius: 0.8, focus };
        let paths = Paths { lens: Some(lens), ..lit(material, 0) };
        let scene = scene(&[([0.0; 3], SIZE, 255)], Lighting::Paths(paths));
        let image = picture(&scene, &camera(DVec3::ZERO, height), 512);
        let blur = f64::from(lens.radius * (1.0 - 20.0 / focus).abs());
        let pixel = height / 24.0;
        let reach = |pick: fn(usize) -> usize| {
            let lit = (0..576).filter(|&at| image.color[at][3] > 0.0).map(pick);
            let (low, high) = lit.fold((24, 0), |(low, high), at| (low.min(at), high.max(at)));
            (high + 1 - low) as f64 * pixel / 2.0
        };
        for found in [reach(|at| at % 24), reach(|at| at / 24)] {
            assert!(
                (found - blur - f64::from(SIZE)).abs() < 1.3 * pixel,
                "{found} instead of {blur} at focus {focus}"
            );
        }
        // What is spread is not lost.
        let seen = f64::from(mean(&image)[3]) * height * height;
        let area = std::f64::consts::PI * f64::from(SIZE * SIZE);
        assert!((seen / area - 1.0).abs() < 0.15, "{seen} of {area} at focus {focus}");
    }
}

#[test]
fn paths_are_the_same_on_any_number_of_threads_and_know_bonds() {
    let spheres: Vec<_> =
        (0..40).map(|k| ([f64::from(k % 7), f64::from(k % 5), f64::from(k % 3)], 0.3, 200)).collect();
    let lights = Lights::Studio(KeyLight { strength: 1.0, ..NO_KEY }, EVEN_SKY);
    let paths = Paths { lights, ..lit(Material::Metal { roughness: 0.2 }, 3) };
    let mut scene = scene(&spheres, Lighting::Paths(paths));
    let camera = camera(DVec3::new(3.0, 2.0, 1.0), 8.0);
    let bare = picture(&scene, &camera, 4);
    let at = |id: u32| DVec3::from(spheres[id as usize].0).as_vec3();
    let origin = scene.structure().origin().as_vec3();
    let segments: Vec<Segment> =
        (0..30).map(|k| Segment { from: at(k) - origin, to: at(k + 1) - origin, ends: [k, k + 1] }).collect();
    scene.bond(&segments, 0.1).unwrap();
    let bonded = picture(&scene, &camera, 4);
    assert_ne!(bare.color, bonded.color);
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(alone.install(|| picture(&scene, &camera, 4)), bonded);
}

#[test]
fn what_is_out_of_range_is_refused() {
    for paths in [
        lit(Material::Clear { index: 1.0 }, 1),
        lit(Material::Clear { index: f32::NAN }, 1),
        lit(Material::Metal { roughness: 0.0 }, 1),
        lit(Material::Matte { roughness: 1.5 }, 1),
        Paths { lens: Some(Lens { radius: 0.0, focus: 1.0 }), ..lit(Material::Matte { roughness: 0.0 }, 1) },
        Paths {
            lens: Some(Lens { radius: 1.0, focus: f32::NAN }),
            ..lit(Material::Matte { roughness: 0.0 }, 1)
        },
    ] {
        let scene = scene(&[([0.0; 3], 1.0, 255)], Lighting::Paths(paths.clone()));
        let settings = Settings { width: 4, height: 4, samples: 1, ..Settings::default() };
        assert!(render(&scene, &camera(DVec3::ZERO, 1.0), &settings, &()).is_err(), "{paths:?}");
    }
}
