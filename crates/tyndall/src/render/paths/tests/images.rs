//! Light from images.

use std::f32::consts::{PI, TAU};
use std::ops::Range;
use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::{camera, lit, mean, middle, picture, scene, with};
use crate::environment::Environment;
use crate::film::Image;
use crate::scene::camera::{Camera, Projection};
use crate::scene::image_light::ImageLight;
use crate::scene::light::{Lighting, Lights, Paths};
use crate::scene::material::Material;

const MATTE: Material = Material::Matte { roughness: 0.0 };

fn of(light: ImageLight, material: Material, bounces: u32) -> Paths {
    let lights = Lights::Image { light: Arc::new(light), is_seen: false };
    Paths { lights, ..lit(material, bounces) }
}

fn seen(paths: Paths) -> Paths {
    match paths.lights {
        Lights::Image { light, .. } => Paths { lights: Lights::Image { light, is_seen: true }, ..paths },
        Lights::Studio(..) => paths,
    }
}

/// An image of 64 x 32 pixels, by column and row.
fn image(pixel: impl Fn(usize, usize) -> [f32; 3]) -> Environment {
    let pixels: Vec<[f32; 3]> = (0..64 * 32).map(|at| pixel(at % 64, at / 64)).collect();
    Environment::image(64, &pixels).unwrap()
}

/// Direction and solid angle of a pixel of such an image.
fn direction(column: usize, row: usize) -> (Vec3, f32) {
    let (across, y) = (PI * (row as f32 + 0.5) / 32.0).sin_cos();
    let (sin, cos) = (TAU * ((column as f32 + 0.5) / 64.0 - 0.5)).sin_cos();
    let edge = |row: usize| (PI * row as f32 / 32.0).cos();
    (Vec3::new(across * sin, y, -across * cos), TAU / 64.0 * (edge(row) - edge(row + 1)))
}

#[test]
fn in_an_even_image_white_things_are_not_seen() {
    let spheres = [([0.0; 3], 1.0, 255), ([1.2, 0.3, 0.4], 0.8, 255), ([-0.9, 1.0, -0.6], 0.5, 255)];
    let mut scene = scene(&spheres, Lighting::Flat);
    let even = [Environment::constant([2.0; 3]).unwrap(), image(|_, _| [2.0; 3])];
    for (environment, (material, least, noise)) in even.into_iter().cycle().zip([
        (MATTE, 1.0, 1e-4),
        (MATTE, 1.0, 1e-4),
        // Light that is mirrored within too often is given up.
        (Material::Clear { index: 1.5 }, 1.0, 5e-4),
        (Material::Glossy { roughness: 0.1, index: 1.5 }, 0.97, 2e-3),
        (Material::Metal { roughness: 0.2 }, 0.95, 2e-3),
    ]) {
        let paths = of(ImageLight::new(environment), material, 1000);
        let image = picture(with(Lighting::Paths(paths), &mut scene), &camera(DVec3::ZERO, 3.5), 64);
        let [light, .., alpha] = mean(&image);
        let share = light / (2.0 * alpha);
        assert!(share < 1.0 + noise && share > least - noise, "{material:?}: {share}");
    }
}

#[test]
fn a_bright_pixel_is_a_distant_light() {
    // Seen from +y at phase angle a, a matte sphere throws (2/3) (sin a + (pi - a) cos a) / pi of the irradiance over pi on, on average over its disc.
    for (column, row) in [(40, 3), (10, 12), (50, 18)] {
        let (toward, angle) = direction(column, row);
        let environment = image(|x, y| if (x, y) == (column, row) { [PI / angle; 3] } else { [0.0; 3] });
        let paths = of(ImageLight::new(environment), MATTE, 0);
        let scene = scene(&[([0.0; 3], 1.0, 255)], Lighting::Paths(paths));
        let [light, .., alpha] = mean(&picture(&scene, &camera(DVec3::ZERO, 2.2), 64));
        let phase = toward.y.acos();
        let expected = 2.0 / 3.0 * (phase.sin() + (PI - phase) * phase.cos()) / PI;
        assert!((light / alpha - expected).abs() < 4e-3, "{} instead of {expected}", light / alpha);
    }
}

#[test]
fn looking_for_light_finds_what_is_found_without_and_sooner() {
    let spheres = [([0.0; 3], 1.0, 220), ([1.1, 0.9, 0.6], 0.5, 255), ([-0.8, 1.0, 0.7], 0.4, 200)];
    let mut scene = scene(&spheres, Lighting::Flat);
    let camera = camera(DVec3::ZERO, 3.2);
    // A blue sky with a sun in the upper half, which is toward the eye; a large one also finds who does not look for it.
    let sky = |columns: Range<usize>, light: f32| {
        let is_sun = |x: usize, y: usize| columns.contains(&x) && (6..9).contains(&y);
        image(|x, y| if is_sun(x, y) { [light, 0.7 * light, 0.3 * light] } else { [0.1, 0.2, 0.4] })
    };
    let [large, small] =
        [(6..30, 5.0), (18..20, 60.0)].map(|(columns, light)| ImageLight::new(sky(columns, light)));
    for (material, bounces) in [
        (Material::Matte { roughness: 1.0 }, 0),
        (Material::Glossy { roughness: 0.5, index: 1.5 }, 2),
        (Material::Metal { roughness: 0.5 }, 2),
    ] {
        let mut shot = |light: &ImageLight, samples: u32| {
            let paths = Lighting::Paths(of(light.clone(), material, bounces));
            picture(with(paths, &mut scene), &camera, samples)
        };
        let [found, expected] =
            [&large, &large.clone().not_looked_for()].map(|light| mean(&shot(light, 256)));
        for channel in 0..3 {
            let (found, expected) = (found[channel], expected[channel]);
            assert!((found / expected - 1.0).abs() < 0.015, "{material:?}: {found} instead of {expected}");
        }
        let reference = shot(&small, 128);
        let error = |light: &ImageLight| {
            let image = shot(light, 4);
            let pairs = image.color.iter().zip(&reference.color);
            pairs.map(|(one, other)| (one[0] - other[0]).powi(2)).sum::<f32>()
        };
        let [looked, plain] = [&small, &small.clone().not_looked_for()].map(error);
        assert!(looked < 0.2 * plain, "{material:?}: {looked} {plain}");
    }
}

#[test]
fn an_image_is_seen_behind_in_mirrors_and_through_clear_bodies() {
    let of_pixel = |column: usize, row: usize| [column as f32 / 64.0, row as f32 / 32.0, 0.3];
    let environment = image(of_pixel);
    let mut scene = scene(&[([0.0; 3], 1.0, 255)], Lighting::Flat);
    // Along -x and up, all within a pixel of the image.
    let (toward, _) = direction(16, 9);
    let up = DVec3::Y;
    let narrow = |eye: DVec3, along: Vec3| Camera {
        eye,
        look_at: eye + along.as_dvec3(),
        up,
        projection: Projection::Orthographic { height: 0.01 },
    };
    let rgb = |image: &Image, expected: [f32; 3], what: &str| {
        let found = mean(image);
        let close = found[..3].iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 0.02);
        assert!(close && found[3] > 0.999, "{what}: {found:?} instead of {expected:?}");
    };
    let mut shot = |material: Material, camera: &Camera| {
        let paths = seen(of(ImageLight::new(environment.clone()), material, 3));
        picture(with(Lighting::Paths(paths), &mut scene), camera, 64)
    };
    let past = narrow(DVec3::new(0.0, 0.0, 9.0), toward);
    rgb(&shot(MATTE, &past), of_pixel(16, 9), "behind");
    let facing = narrow(-9.0 * toward.as_dvec3(), toward);
    let polished = shot(Material::Metal { roughness: Material::LEAST_ROUGHNESS }, &facing);
    let (x, y) = (16 + 32, 31 - 9);
    rgb(&polished, of_pixel(x, y), "mirrored");
    rgb(&shot(Material::Clear { index: 1.01 }, &facing), of_pixel(16, 9), "through a clear body");
    assert!(middle(&polished) > 0.0);
}

#[test]
fn images_are_the_same_on_any_number_of_threads() {
    let spheres: Vec<_> =
        (0..40).map(|k| ([f64::from(k % 7), f64::from(k % 5), f64::from(k % 3)], 0.6, 200)).collect();
    let environment = image(|x, y| if (x, y) == (20, 9) { [900.0; 3] } else { [0.1, 0.2, y as f32 / 50.0] });
    let paths = seen(of(ImageLight::new(environment), Material::Glossy { roughness: 0.3, index: 1.5 }, 3));
    let scene = scene(&spheres, Lighting::Paths(paths));
    let camera = camera(DVec3::new(3.0, 2.0, 1.0), 8.0);
    let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let [one, two] = [1, 2].map(|threads| pool(threads).install(|| picture(&scene, &camera, 4)));
    assert_eq!(one, two);
    assert!(one.color.iter().all(|color| color[3] == 1.0));
}
