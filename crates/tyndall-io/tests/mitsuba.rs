//! The reference path tracer beside Mitsuba 3: the scene of `bench/volume/scene.json` and its picture `ref_g0.exr`.
//!
//! Mitsuba's picture has 1,760 samples a pixel; its means over 8 x 8 pixels are good to 0.0006 (`bench/volume/RESULTS.md`).
#![allow(clippy::unwrap_used, reason = "all of this is tests")]

use std::path::{Path, PathBuf};

use serde_json::Value;
use tyndall::medium::light::{Directional, Environment};
use tyndall::medium::{Light, Medium, Optics, Phase};
use tyndall::render::medium::free_path::FreePath;
use tyndall::render::medium::reference::{Reference, Settings};
use tyndall::scene::camera::{Camera, Projection};
use tyndall::{DVec3, Vec3};
use tyndall_io::read::{RawGrid, Sample, density};

/// Pixels along the edge of a block.
const BLOCK: usize = 8;

fn vector(value: &Value) -> DVec3 {
    let numbers: Vec<f64> = value.as_array().unwrap().iter().flat_map(Value::as_f64).collect();
    DVec3::from_slice(&numbers)
}

fn medium(folder: &Path, scene: &Value) -> Medium {
    let grid = &scene["grid"];
    let size: Vec<u32> =
        grid["size"].as_array().unwrap().iter().map(|it| it.as_u64().unwrap() as u32).collect();
    let raw = RawGrid {
        size: size.try_into().unwrap(),
        sample: Sample::U16,
        scale: grid["rho_max"].as_f64().unwrap() / 65535.0,
        origin: Vec3::ZERO,
        spacing: grid["spacing"].as_f64().unwrap() as f32,
    };
    let grid = density(&folder.join(grid["file"].as_str().unwrap()), &raw, &()).unwrap();
    let bounds = grid.bounds();
    assert!(bounds.min.as_dvec3().abs_diff_eq(vector(&scene["grid"]["medium_box_min"]), 1e-5));
    assert!(bounds.max.as_dvec3().abs_diff_eq(vector(&scene["grid"]["medium_box_max"]), 1e-5));
    let optics = Optics {
        extinction: [scene["medium"]["sigma_t_scale"].as_f64().unwrap() as f32; 3],
        albedo: [scene["medium"]["albedo"].as_f64().unwrap() as f32; 3],
        phase: Phase::ISOTROPIC,
    };
    Medium::new(grid, optics).unwrap()
}

fn lights(scene: &Value) -> [Light; 2] {
    let [sun, sky] = [0, 1].map(|number| &scene["lights"][number]);
    let along = vector(&sun["travels_along"]).as_vec3();
    let irradiance = sun["irradiance_on_perpendicular_plane"].as_f64().unwrap() as f32;
    let radiance = sky["radiance"].as_f64().unwrap() as f32;
    [
        Light::Directional(Directional::new(along, [irradiance; 3]).unwrap()),
        Light::Environment(Environment::constant([radiance; 3]).unwrap()),
    ]
}

/// Means over blocks of the picture.
fn blocks(width: usize, pixels: &[f64]) -> Vec<f64> {
    let rows = pixels.len() / width / BLOCK;
    let block = |number: usize| {
        let corner = number / (width / BLOCK) * BLOCK * width + number % (width / BLOCK) * BLOCK;
        let row = |row: usize| pixels[corner + row * width..][..BLOCK].iter().sum::<f64>();
        (0..BLOCK).map(row).sum::<f64>() / (BLOCK * BLOCK) as f64
    };
    (0..rows * width / BLOCK).map(block).collect()
}

/// Why `found` is not `wanted`, given what two independent halves of `found` say of its noise.
fn differs(wanted: &[f64], halves: &[Vec<f64>; 2], width: usize) -> Option<String> {
    let mean = |pixels: &[f64]| pixels.iter().sum::<f64>() / pixels.len() as f64;
    let found: Vec<f64> = halves[0].iter().zip(&halves[1]).map(|(a, b)| 0.5 * (a + b)).collect();
    let ratio = mean(&found) / mean(wanted);
    if (ratio - 1.0).abs() > 0.005 {
        return Some(format!("the mean is {ratio} times Mitsuba's"));
    }
    let (found, wanted) = (blocks(width, &found), blocks(width, wanted));
    let [first, second] = [0, 1].map(|half| blocks(width, &halves[half]));
    // Bias: the blocks' squared errors must be what the halves' differences and Mitsuba's own noise explain.
    let count = found.len() as f64;
    let error: f64 = found.iter().zip(&wanted).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / count;
    let noise: f64 = first.iter().zip(&second).map(|(a, b)| 0.25 * (a - b).powi(2)).sum::<f64>() / count;
    let explained = noise + 0.0006_f64.powi(2);
    // Some 300 blocks see the smoke: both estimates of the variance are good to 8 %.
    if error > 1.4 * explained {
        return Some(format!("blocks differ by {} rms, {} is noise", error.sqrt(), explained.sqrt()));
    }
    None
}

#[test]
fn the_reference_renders_what_mitsuba_renders() {
    let folder: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/bench/volume");
    let Ok(json) = std::fs::read_to_string(folder.join("scene.json")) else {
        println!("skipped: no ../shared ({})", folder.display());
        return;
    };
    let scene: Value = serde_json::from_str(&json).unwrap();
    let (medium, lights) = (medium(&folder, &scene), lights(&scene));
    let film = &scene["film"];
    let (width, height) = (film["width"].as_u64().unwrap() as u32, film["height"].as_u64().unwrap() as u32);
    let camera = &scene["camera"];
    let horizontal = camera["horizontal_fov_deg"].as_f64().unwrap().to_radians();
    let aspect = f64::from(width) / f64::from(height);
    let camera = Camera {
        eye: vector(&camera["origin"]),
        look_at: vector(&camera["target"]),
        up: vector(&camera["up"]),
        projection: Projection::Perspective {
            vertical_angle: 2.0 * ((0.5 * horizontal).tan() / aspect).atan(),
        },
    };
    let view = camera.view(DVec3::ZERO, width, height).unwrap();
    let half = |seed: u32| -> Vec<f64> {
        let settings = Settings { width, height, seed, orders: None, free_path: FreePath::Delta };
        let mut reference = Reference::new(&medium, &lights, view, settings).unwrap();
        reference.pass(4, &()).unwrap();
        reference.pixels().iter().map(|pixel| f64::from((pixel.scattered + pixel.environment).x)).collect()
    };
    let halves = [half(1), half(2)];

    let wanted = exr::prelude::read_first_rgba_layer_from_file(
        folder.join("ref_g0.exr"),
        |size, _| vec![0.0; size.width() * size.height()],
        move |pixels: &mut Vec<f64>, at, (red, _, _, _): (f32, f32, f32, f32)| {
            pixels[at.y() * width as usize + at.x()] = f64::from(red);
        },
    );
    let wanted = wanted.unwrap().layer_data.channel_data.pixels;
    assert_eq!(differs(&wanted, &halves, width as usize), None);

    // A comparison must be seen to fail: by a picture that is 1 % brighter, and by one that is shifted by a pixel.
    let brighter = halves.clone().map(|half| half.iter().map(|value| 1.01 * value).collect());
    assert!(differs(&wanted, &brighter, width as usize).is_some());
    let shifted = halves.map(|half| half[1..].iter().chain(&half[..1]).copied().collect());
    assert!(differs(&wanted, &shifted, width as usize).is_some());
}
