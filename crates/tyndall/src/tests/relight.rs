//! A picture lit and colored anew from the samples that were kept is that of a new rendering; a first frame is right on average.

use super::scenes::{LAWS, Law, Random, camera, particles};
use super::visibility::{differing_pixels, image, scene};
use crate::particles::Radii;
use crate::render::{Renderer, SampleBuffer, Settings};
use crate::scene::Scene;
use crate::scene::camera::{Camera, Projection};
use crate::scene::color::ParticleColors;
use crate::scene::light::Lighting;
use crate::structure::{Kind, pkd};
use fearless_simd::Level;
use glam::{DVec3, Vec3};

fn kept(scene: &Scene, camera: &Camera, settings: &Settings) -> SampleBuffer {
    let mut renderer = Renderer::new(scene, camera, settings).unwrap().keeping_samples();
    renderer.finish(&()).unwrap();
    renderer.into_samples().unwrap()
}

#[test]
fn a_picture_lit_and_colored_anew_is_that_of_a_new_rendering() {
    for seed in 0..24 {
        let mut random = Random::new(21_000 + seed);
        let law = LAWS[seed as usize % LAWS.len()];
        let (particles, radii) = particles(law, 300, &mut random);
        let camera = camera(&particles.bounds(), &mut random);
        let samples = [1, 6, 20, 32][random.below(4) as usize];
        let settings = Settings { width: 37, height: 35, samples, seed: seed as u32, ..Settings::default() };
        let kind = [Kind::default(), Kind::Pkd(pkd::Options::default())][random.below(2) as usize];
        let mut scene = scene(&particles, &radii, kind, Lighting::Headlight);
        let buffer = kept(&scene, &camera, &settings);
        assert_eq!((buffer.samples(), buffer.bytes()), (samples, 4 * 1024 * 8 * u64::from(samples)));
        let studio = Lighting::studio(random.vector().normalize_or(Vec3::X), Vec3::NEG_Y, Vec3::Z);
        for lighting in [Lighting::Headlight, studio, Lighting::Flat] {
            scene.lighting = lighting.clone();
            let expected = image(&scene, &camera, &settings, Level::new());
            let found = buffer.image(&scene, &()).unwrap();
            assert_eq!(differing_pixels(&expected, &found), 0, "seed {seed}: {law:?}, {lighting:?}");
        }
        scene.recolor(ParticleColors::constant([0.1, 0.8, 0.3]));
        let expected = image(&scene, &camera, &settings, Level::new());
        let found = buffer.image(&scene, &()).unwrap();
        assert_eq!(differing_pixels(&expected, &found), 0, "seed {seed}: {law:?}, recolored");
    }
}

#[test]
fn samples_of_other_particles_are_refused() {
    let mut random = Random::new(3);
    let (few, radii) = particles(Law::Uniform, 10, &mut random);
    let (many, more_radii) = particles(Law::Uniform, 11, &mut random);
    let camera = camera(&few.bounds(), &mut random);
    let settings = Settings { width: 8, height: 8, samples: 1, ..Settings::default() };
    let seen = scene(&few, &radii, Kind::default(), Lighting::Flat);
    let other = scene(&many, &more_radii, Kind::default(), Lighting::Flat);
    let buffer = kept(&seen, &camera, &settings);
    assert!(buffer.image(&other, &()).is_err());
    assert!(Renderer::new(&seen, &camera, &settings).unwrap().into_samples().is_none());
}

/// A cloud of particles of a tenth of a pixel, seen from afar.
fn dust() -> (Scene, Camera) {
    let mut random = Random::new(8);
    let (particles, _) = particles(Law::Uniform, 3000, &mut random);
    let radii = Radii::Uniform(0.012);
    let camera = Camera {
        eye: DVec3::new(5.0, 2.0, 1.0),
        look_at: DVec3::ZERO,
        up: DVec3::Z,
        projection: Projection::Orthographic { height: 1.9 },
    };
    let view = camera.view(DVec3::ZERO, 16, 16).unwrap();
    let studio = Lighting::studio(view.forward, view.right, view.up);
    (scene(&particles, &radii, Kind::default(), studio), camera)
}

#[test]
fn a_first_frame_is_right_on_average() {
    let (scene, camera) = dust();
    let settings = |samples, seed| Settings { width: 16, height: 16, samples, seed, ..Settings::default() };
    let expected = image(&scene, &camera, &settings(2048, 99), Level::new());
    let seeds = 256;
    let mut sums = vec![[0.0_f64; 2]; 256];
    for seed in 0..seeds {
        // One pass of many: its samples are not centered.
        let mut renderer = Renderer::new(&scene, &camera, &settings(64, seed)).unwrap();
        renderer.pass(&()).unwrap();
        for (sum, color) in sums.iter_mut().zip(renderer.image().color) {
            let value = f64::from(color[0] + color[1] + color[2]);
            *sum = [sum[0] + value, sum[1] + value * value];
        }
    }
    let count = f64::from(seeds);
    let (mut deviations_sq, mut total, mut expected_total) = (0.0, 0.0, 0.0);
    for ([sum, sum_sq], color) in sums.iter().zip(&expected.color) {
        let (mean, expected) = (sum / count, f64::from(color[0] + color[1] + color[2]));
        let variance = (sum_sq / count - mean * mean) / count;
        deviations_sq += (mean - expected).powi(2) / variance.max(1e-9);
        total += mean;
        expected_total += expected;
    }
    // Standardized squares average to 1; the reference has noise of its own, correlated from pixel to pixel by common lights.
    let score = deviations_sq / 256.0;
    println!("mean standardized square {score}, totals {total} and {expected_total}");
    assert!(score < 3.0, "{score}");
    assert!((total / expected_total - 1.0).abs() < 0.01, "{total} {expected_total}");
}

#[test]
fn normal_statistics_predict_the_headlight_without_samples() {
    let (mut scene, camera) = dust();
    scene.lighting = Lighting::Headlight;
    scene.recolor(ParticleColors::constant([1.0; 3]));
    let settings = Settings { width: 16, height: 16, samples: 64, ..Settings::default() };
    let buffer = kept(&scene, &camera, &settings);
    let image = buffer.image(&scene, &()).unwrap();
    let statistics = buffer.normals(&scene).unwrap();
    let backward = -camera.view(DVec3::ZERO, 16, 16).unwrap().forward;
    let mut met = 0;
    for (statistics, color) in statistics.iter().zip(&image.color) {
        assert!((statistics.coverage - color[3]).abs() < 1e-5);
        if color[3] > 0.2 {
            met += 1;
            let (found, expected) = (statistics.coverage * statistics.cosine(backward), color[0]);
            assert!((found - expected).abs() < 0.02, "{found} {expected}");
            assert!((statistics.mean.dot(backward) * statistics.coverage - expected).abs() < 1e-3);
            assert!(statistics.color == Vec3::ONE || (statistics.color - 1.0).length() < 1e-5);
        }
    }
    assert!(met > 50, "{met}");
}
