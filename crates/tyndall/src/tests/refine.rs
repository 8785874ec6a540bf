//! Samples until the noise is small enough.

use glam::{DVec3, Vec3};

use super::scenes::{Law, Random, particles};
use super::visibility::scene;
use crate::film::Image;
use crate::render::{Culling, Renderer, Settings, confidence, render};
use crate::scene::Scene;
use crate::scene::camera::{Camera, Projection};
use crate::scene::light::{Lighting, Lights, Paths};
use crate::scene::material::Material;
use crate::structure::Kind;

fn traced() -> (Scene, Camera) {
    let (particles, radii) = particles(Law::Uniform, 300, &mut Random::new(77));
    let Lighting::Studio(key, sky) = Lighting::studio(Vec3::NEG_X, Vec3::Y, Vec3::Z) else { panic!() };
    let material = Material::Metal { roughness: 0.5 };
    let paths = Paths { lights: Lights::Studio(key, sky), material, bounces: 2, lens: None };
    let bounds = particles.bounds();
    let look_at = particles.positions().origin() + bounds.center().as_dvec3();
    let size = f64::from(bounds.extent().max_element());
    let projection = Projection::Orthographic { height: 2.0 * size };
    let camera = Camera { eye: look_at + 4.0 * size * DVec3::X, look_at, up: DVec3::Z, projection };
    (scene(&particles, &radii, Kind::default(), Lighting::Paths(paths)), camera)
}

fn settings(samples: u32) -> Settings {
    Settings { width: 96, height: 32, samples, seed: 4, ..Settings::default() }
}

/// Root mean square difference of values as they are shown.
fn difference(one: &Image, other: &Image) -> f32 {
    let shown = |image: &Image, at: usize| Vec3::from_slice(&image.color[at]).clamp(Vec3::ZERO, Vec3::ONE);
    let shown = |image: &Image, at: usize| Vec3::from_array(shown(image, at).to_array().map(f32::sqrt));
    let squares = (0..one.color.len()).map(|at| (shown(one, at) - shown(other, at)).length_squared());
    (squares.sum::<f32>() / (3 * one.color.len()) as f32).sqrt()
}

#[test]
fn the_noise_that_is_left_is_what_is_told_and_tiles_stop_by_themselves() {
    let (scene, camera) = traced();
    let expected = render(&scene, &camera, &settings(1024), &()).unwrap();
    let wanted = 0.005;
    let settings = Settings { seed: 9, ..settings(1024) };
    let refined = || {
        let mut renderer = Renderer::new(&scene, &camera, &settings).unwrap();
        let quality = renderer.refine(wanted, &mut || false, &()).unwrap();
        (quality, renderer.image())
    };
    let (quality, image) = refined();
    let found = difference(&image, &expected);
    assert!(quality.noise <= wanted, "{quality:?}");
    assert!(found < 1.4 * quality.noise && found > 0.4 * quality.noise, "{found}, {quality:?}");
    // Tiles that show little need few.
    assert!(quality.samples[0] < quality.samples[1], "{quality:?}");
    assert_eq!(refined().1, image);
}

#[test]
fn samples_end_with_the_time_and_with_the_settings() {
    let (scene, camera) = traced();
    let mut renderer = Renderer::new(&scene, &camera, &settings(4096)).unwrap();
    let mut passes = 0;
    let mut is_late = || {
        passes += 1;
        passes == 3
    };
    let quality = renderer.refine(0.0, &mut is_late, &()).unwrap();
    assert_eq!(quality.samples, [48; 2]);
    assert_eq!(renderer.image(), render(&scene, &camera, &settings(48), &()).unwrap());
    let mut renderer = Renderer::new(&scene, &camera, &settings(40)).unwrap();
    assert_eq!(renderer.refine(0.0, &mut || false, &()).unwrap().samples, [40; 2]);
    let culling = Culling::Confidence(confidence::Options::default());
    let mut renderer = Renderer::new(&scene, &camera, &Settings { culling, ..settings(40) }).unwrap();
    assert!(renderer.refine(0.1, &mut || false, &()).is_err());
}
