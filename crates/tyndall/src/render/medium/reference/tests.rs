//! The reference against slabs and a sphere in closed form, and against what must hold in any medium. Numbers from
//! `bench/volume/analytic.json`: sections `slab_single_scattering`, `sphere_single_scattering_directional`,
//! `sphere_single_scattering_point_at_centre`, `slab_all_orders_flux_fractions`, `invariants`.

use std::f32::consts::PI;

use super::*;
use crate::medium::light::{Cone, Directional, Environment, Point, Spot};
use crate::medium::{Grid, Optics, Phase};
use crate::render::medium::photons;
use crate::scene::camera::{Camera, Projection};
use glam::DVec3;

fn settings(width: u32, height: u32) -> Settings {
    Settings { width, height, seed: 5, orders: None, free_path: FreePath::Delta }
}

fn sun(along: Vec3, irradiance: f32) -> Light {
    Light::Directional(Directional::new(along, [irradiance; 3]).unwrap())
}

fn sky(radiance: f32) -> Light {
    Light::Environment(Environment::constant([radiance; 3]).unwrap())
}

fn optics(albedo: f32, g: f32) -> Optics {
    Optics { extinction: [1.0; 3], albedo: [albedo; 3], phase: Phase::new(g).unwrap() }
}

/// A slab of optical depth `depth` between z = 0 and `depth`, 200 times as wide.
fn slab(depth: f32, optics: Optics) -> Medium {
    let origin = depth * Vec3::new(-99.5, -99.5, 0.5);
    Medium::new(Grid::from_dense(origin, depth, [200, 200, 1], &vec![1.0; 40_000]).unwrap(), optics).unwrap()
}

fn view(eye: DVec3, look_at: DVec3, width: u32, height: u32, extent: f64) -> View {
    let up = if (look_at - eye).normalize().cross(DVec3::Y).length() > 0.1 { DVec3::Y } else { DVec3::X };
    let camera = Camera { eye, look_at, up, projection: Projection::Orthographic { height: extent } };
    camera.view(DVec3::ZERO, width, height).unwrap()
}

/// Mean pixel and its standard deviation, of the red channel of what is scattered.
fn mean(pixels: &[Pixel]) -> (f64, f64) {
    let count = pixels.len() as f64;
    let mean = pixels.iter().map(|pixel| f64::from(pixel.scattered.x)).sum::<f64>() / count;
    let spread = pixels.iter().map(|pixel| (f64::from(pixel.scattered.x) - mean).powi(2)).sum::<f64>();
    (mean, (spread / (count - 1.0) / count).sqrt())
}

fn render(medium: &Medium, lights: &[Light], view: View, settings: Settings, samples: u32) -> Vec<Pixel> {
    let mut reference = Reference::new(medium, lights, view, settings).unwrap();
    reference.pass(samples, &()).unwrap();
    reference.pixels()
}

#[test]
fn a_slab_scatters_once_what_the_formula_says() {
    // Optical depth, cosines of light and view, g, albedo; radiance reflected and let through, for irradiance 1.
    for (depth, light, eye, g, albedo, reflected, through) in [
        (1.0, 1.0, 1.0, 0.0, 1.0, 0.034_403_916, 0.029_274_916),
        (1.0, 1.0, 0.5, 0.0, 0.9, 0.045_369_326, 0.033_309_497),
        (4.0, 0.6, 0.8, 0.0, 0.95, 0.032_399_121, 0.001_239_510_0),
        (2.0, 0.6, 0.8, 0.6, 0.95, 0.013_035_718, 0.071_013_504),
        (0.1, 1.0, 1.0, 0.6, 0.5, 0.000_563_474_54, 0.036_002_337),
    ] {
        let medium = slab(depth, optics(albedo, g));
        let lean = |cosine: f64| DVec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
        let lights = [sun(lean(light).as_vec3(), 1.0)];
        let middle = DVec3::new(0.0, 0.0, 0.5 * f64::from(depth));
        // The light travels down along +z. Reflected light travels to an eye above that lies on the far side of the light
        // (azimuth 0: the same side of the normal as the light travels to), let through to one below.
        for (side, wanted) in [(-1.0, reflected), (1.0, through)] {
            let toward_eye = lean(eye) * DVec3::new(1.0, 1.0, side);
            let distance = 3.0 * f64::from(depth);
            let view = view(middle + distance * toward_eye, middle, 24, 24, 0.5 * f64::from(depth));
            for free_path in [FreePath::Delta, FreePath::Exact] {
                let settings = Settings { orders: Some(1), free_path, ..settings(24, 24) };
                let (found, deviation) = mean(&render(&medium, &lights, view, settings, 4));
                let tolerance = 4.0 * deviation + 1e-4 * wanted;
                assert!(deviation < 0.08 * wanted, "{deviation} of {wanted}");
                assert!(
                    (found - wanted).abs() < tolerance,
                    "depth {depth} side {side}: {found} +- {deviation} for {wanted}"
                );
            }
        }
    }
}

#[test]
fn a_slab_of_all_orders_agrees_with_adding_and_doubling() {
    for (depth, albedo, g, cosine, reflected, through) in [
        (1.0, 0.95, 0.0, 1.0, 0.301_717_46, 0.254_687_69),
        (4.0, 0.95, 0.0, 1.0, 0.512_421_68, 0.168_599_28),
        (2.0, 0.9, 0.75, 1.0, 0.097_394_57, 0.525_622_34),
        (10.0, 0.95, 0.6, 0.6, 0.457_397_35, 0.060_463_59),
    ] {
        let medium = slab(depth, optics(albedo, g));
        let along = Vec3::new(f32::sqrt(1.0 - cosine * cosine), 0.0, cosine);
        // Irradiance 1 on the slab's own plane.
        let lights = [sun(along, 1.0 / cosine)];
        for free_path in [FreePath::Delta, FreePath::Exact] {
            let view = view(DVec3::NEG_Z, DVec3::ZERO, 1, 1, 1.0);
            let settings = Settings { free_path, ..settings(1, 1) };
            let reference = Reference::new(&medium, &lights, view, settings).unwrap();
            for (side, wanted) in [(-1.0, reflected), (1.0, through)] {
                // Exitance: pi times the mean radiance over directions drawn by their cosine.
                let count = 8_000;
                let (mut sum, mut square) = (0.0, 0.0);
                let mut crossing = Crossing::default();
                for number in 0..count {
                    let mut stream = Stream::new(17, number);
                    let across = stream.unit().sqrt();
                    let (sin, cos) = (2.0 * PI * stream.unit()).sin_cos();
                    let out = Vec3::new(across * cos, across * sin, side * (1.0 - across * across).sqrt());
                    let face = if side < 0.0 { 0.0 } else { depth };
                    let ray = Ray {
                        origin: Vec3::new(0.0, 0.0, face) + 0.1 * out,
                        direction: -out,
                        t_min: 0.0,
                        t_max: f32::INFINITY,
                    };
                    reference.tracker.cross(&ray, &mut crossing);
                    let random = [stream.unit(), stream.unit()];
                    let (distance, weight) = reference.tracker.forced(&crossing, random);
                    let start = Ray { origin: ray.origin + distance * ray.direction, ..ray };
                    let mut stream = Stream::new(18, number);
                    let random = [stream.unit(), stream.unit()];
                    let radiance =
                        f64::from(reference.path(Met::Matter, start, weight, random, &mut stream).x);
                    sum += radiance * f64::from(PI);
                    square += (radiance * f64::from(PI)).powi(2);
                }
                let found = sum / count as f64;
                let deviation = ((square / count as f64 - found * found) / count as f64).sqrt();
                assert!(deviation < 0.05 * wanted, "{deviation} of {wanted}");
                assert!(
                    (found - wanted).abs() < 4.0 * deviation,
                    "depth {depth} side {side}: {found} +- {deviation} for {wanted}"
                );
            }
        }
    }
}

/// A ball of radius 1 and density 1, with `edge` samples across; samples at the rim have the share of their cell inside.
fn ball(edge: u32, extinction: f32, optics: Optics) -> Medium {
    let spacing = 2.1 / edge as f32;
    let first = -0.5 * spacing * (edge - 1) as f32;
    let mut values = Vec::with_capacity((edge * edge * edge) as usize);
    for k in 0..edge {
        for j in 0..edge {
            for i in 0..edge {
                let at = Vec3::splat(first) + spacing * Vec3::new(i as f32, j as f32, k as f32);
                values.push((0.5 + (1.0 - at.length()) / spacing).clamp(0.0, 1.0));
            }
        }
    }
    let grid = Grid::from_dense(Vec3::splat(first), spacing, [edge; 3], &values).unwrap();
    Medium::new(grid, Optics { extinction: [extinction; 3], ..optics }).unwrap()
}

#[test]
fn a_ball_scatters_once_what_the_formula_says() {
    // The light travels along +x, the eye looks along -z at (x, y). Irradiance 1.
    for (extinction, albedo, g, x, y, wanted) in [
        (1.0, 0.9, 0.0, 0.0, 0.0, 0.029_973_215),
        (1.0, 0.9, 0.0, 0.5, 0.0, 0.015_604_318),
        (1.0, 0.9, 0.0, -0.5, 0.3, 0.042_608_519),
        (4.0, 0.95, 0.0, 0.0, 0.0, 0.012_590_313),
        (4.0, 0.95, 0.6, -0.6, 0.2, 0.016_246_838),
    ] {
        let medium = ball(64, extinction, optics(albedo, g));
        let lights = [sun(Vec3::X, 1.0)];
        let view = view(DVec3::new(x, y, 4.0), DVec3::new(x, y, 0.0), 24, 24, 1e-3);
        let pixels = render(&medium, &lights, view, Settings { orders: Some(1), ..settings(24, 24) }, 4);
        let (found, deviation) = mean(&pixels);
        // The rim of the ball is one cell wide.
        assert!(
            (found - wanted).abs() < 4.0 * deviation + 0.01 * wanted,
            "{x} {y}: {found} +- {deviation} for {wanted}"
        );
    }
}

#[test]
fn a_light_inside_a_ball_scatters_once_what_the_formula_says() {
    // A source of intensity 1 in the middle, seen along a ray that passes it at `impact`.
    for (extinction, impact, wanted) in
        [(1.0, 0.2, 0.277_808_52), (1.0, 0.6, 0.052_685_143), (5.0, 0.3, 0.007_097_169_2)]
    {
        let medium = ball(64, extinction, optics(0.9, 0.0));
        let lights = [Light::Point(Point::new(Vec3::ZERO, [1.0; 3]).unwrap())];
        let view = view(DVec3::new(impact, 0.0, 4.0), DVec3::new(impact, 0.0, 0.0), 32, 32, 1e-3);
        let settings = Settings { orders: Some(1), ..settings(32, 32) };
        let found = mean(&render(&medium, &lights, view, settings, 16));
        let allowed = 4.0 * found.1 + 0.01 * wanted;
        assert!((found.0 - wanted).abs() < allowed, "{impact}: {found:?} for {wanted}");
    }
}

/// Random density with empty parts.
fn cloud(optics: Optics, extinction: [f32; 3]) -> Medium {
    let mut stream = Stream::new(29, 0);
    let size = [24, 20, 18];
    let values: Vec<f32> = (0..24 * 20 * 18)
        .map(|place| if place % 24 < 5 { 0.0 } else { stream.range(0.0, 2.0).powi(3) })
        .collect();
    let grid = Grid::from_dense(Vec3::new(-1.2, -1.0, -0.9), 0.1, size, &values).unwrap();
    Medium::new(grid, Optics { extinction, ..optics }).unwrap()
}

fn at_the_cloud() -> View {
    let camera = Camera {
        eye: DVec3::new(2.0, 1.0, 5.0),
        look_at: DVec3::ZERO,
        up: DVec3::Y,
        projection: Projection::Perspective { vertical_angle: 0.5 },
    };
    camera.view(DVec3::ZERO, 24, 16).unwrap()
}

#[test]
fn lamps_light_what_photons_light() {
    // The oracle: the eye looks at each scattering of each photon, and what it sees is shared out over the picture.
    let Optics { albedo, phase, .. } = optics(0.9, 0.4);
    let density = ball(20, 1.0, optics(0.9, 0.4)).density().clone();
    let medium = Medium::new(density, Optics { extinction: [2.0, 1.5, 1.0], albedo, phase }).unwrap();
    let cone = Cone { full: 0.4, dark: 0.9 };
    let lights = [
        Light::Point(Point::new(Vec3::new(0.3, 0.1, -0.2), [1.0, 2.0, 1.0]).unwrap()),
        Light::Spot(Spot::new(Vec3::new(0.1, 1.1, 0.4), Vec3::NEG_Y, [3.0, 1.0, 1.0], cone).unwrap()),
    ];
    let (stored, free_path) = (photons::Stored::All, FreePath::Exact);
    let knobs = photons::Settings { count: 60_000, seed: 3, free_path, stored, memory_bytes: None };
    let photons = photons::trace(&medium, &lights, &knobs, &()).unwrap();
    let tracker = Tracker::new(&medium);
    // The whole ball is in the first picture; in the other the eye is next to it.
    for (eye, angle) in [(5.0, 0.5), (1.8, 0.8)] {
        let (eye, up) = (DVec3::new(0.2, 0.1, eye), DVec3::Y);
        let projection = Projection::Perspective { vertical_angle: angle };
        let view = Camera { eye, look_at: DVec3::ZERO, up, projection }.view(DVec3::ZERO, 24, 16).unwrap();
        let mut wanted = Vec3::ZERO;
        for photon in &photons.stored {
            let inside = |[x, y]: [f32; 2]| (0.0..24.0).contains(&x) && (0.0..16.0).contains(&y);
            if view.pixel_of(photon.position).is_some_and(inside) {
                let (toward, t_max) = (-view.toward(photon.position), view.eye.distance(photon.position));
                let ray = Ray { origin: photon.position, direction: toward, t_min: 0.0, t_max };
                let share = phase.evaluate(photon.direction.dot(toward)) / view.pixel_area(photon.position);
                wanted += photon.power * share * tracker.transmittance(&ray) / (24.0 * 16.0);
            }
        }
        let pixels = render(&medium, &lights, view, settings(24, 16), 64);
        let found = pixels.iter().map(|pixel| pixel.scattered).sum::<Vec3>() / pixels.len() as f32;
        assert!((found / wanted - 1.0).abs().max_element() < 0.03, "{eye}: {found} for {wanted}");
    }
}

#[test]
fn a_medium_of_albedo_one_in_even_light_is_invisible() {
    for g in [0.0, 0.7, -0.4] {
        for free_path in [FreePath::Delta, FreePath::Exact] {
            let medium = cloud(optics(1.0, g), [2.0; 3]);
            let settings = Settings { free_path, ..settings(24, 16) };
            for pixel in render(&medium, &[sky(0.25)], at_the_cloud(), settings, 4) {
                let seen = pixel.scattered + pixel.environment;
                assert!(seen.abs_diff_eq(Vec3::splat(0.25), 1e-5), "g {g}: {seen}");
            }
        }
    }
    // With extinction by color, and the sky as an image, on average.
    let medium = cloud(optics(1.0, 0.3), [2.0, 1.0, 0.5]);
    let image = Light::Environment(Environment::image(8, &[[0.25; 3]; 32]).unwrap());
    let pixels = render(&medium, &[image], at_the_cloud(), settings(24, 16), 64);
    let sum: Vec3 = pixels.iter().map(|pixel| pixel.scattered + pixel.environment).sum();
    let mean = sum / pixels.len() as f32;
    assert!(mean.abs_diff_eq(Vec3::splat(0.25), 0.003), "{mean}");
}

#[test]
fn what_is_wrong_in_a_furnace_is_seen() {
    let medium = cloud(optics(0.98, 0.0), [2.0; 3]);
    let pixels = render(&medium, &[sky(0.25)], at_the_cloud(), settings(24, 16), 4);
    let middle = pixels[8 * 24 + 12];
    assert!((middle.scattered + middle.environment).x < 0.249);
}

#[test]
fn a_black_medium_only_dims_and_an_empty_one_does_nothing() {
    let medium = cloud(optics(0.0, 0.0), [2.0; 3]);
    let lights = [sky(0.25), sun(Vec3::X, 3.0)];
    for pixel in render(&medium, &lights, at_the_cloud(), settings(24, 16), 1) {
        assert_eq!(pixel.scattered, Vec3::ZERO);
        assert_eq!(pixel.environment, 0.25 * pixel.transmittance);
    }
    let grid = Grid::from_dense(Vec3::ZERO, 1.0, [3; 3], &[0.0; 27]).unwrap();
    let empty = Medium::new(grid, optics(1.0, 0.0)).unwrap();
    let wanted = Pixel { environment: Vec3::splat(0.25), transmittance: Vec3::ONE, ..NOTHING };
    assert!(
        render(&empty, &lights, at_the_cloud(), settings(24, 16), 1).iter().all(|pixel| *pixel == wanted)
    );
}

/// A pixel without samples, or of rays that meet nothing in the dark.
const NOTHING: Pixel =
    Pixel { scattered: Vec3::ZERO, environment: Vec3::ZERO, transmittance: Vec3::ZERO, depth: f32::INFINITY };

#[test]
fn twice_the_light_is_twice_the_picture_whatever_the_threads() {
    let medium = cloud(optics(0.9, 0.3), [2.0, 1.5, 1.0]);
    let lights = |strength: f32| [sun(Vec3::new(1.0, -0.3, 0.2), strength), sky(0.5 * strength)];
    let once = render(&medium, &lights(1.0), at_the_cloud(), settings(24, 16), 2);
    let twice = render(&medium, &lights(2.0), at_the_cloud(), settings(24, 16), 2);
    for (once, twice) in once.iter().zip(&twice) {
        assert_eq!((2.0 * once.scattered, 2.0 * once.environment), (twice.scattered, twice.environment));
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let alone = pool.install(|| render(&medium, &lights(1.0), at_the_cloud(), settings(24, 16), 2));
    assert_eq!(alone, once);
}

#[test]
fn passes_add_up() {
    let medium = cloud(optics(0.9, 0.0), [2.0; 3]);
    let lights = [sun(Vec3::X, 1.0)];
    let mut reference = Reference::new(&medium, &lights, at_the_cloud(), settings(24, 16)).unwrap();
    assert!(reference.pixels().iter().all(|pixel| *pixel == NOTHING));
    reference.pass(1, &()).unwrap();
    reference.pass(3, &()).unwrap();
    assert_eq!(reference.samples_done(), 4);
    assert_eq!(reference.pixels(), render(&medium, &lights, at_the_cloud(), settings(24, 16), 4));
    assert!(Reference::new(&medium, &lights, at_the_cloud(), settings(0, 16)).is_err());
}

#[test]
fn looking_at_an_image_and_leaving_into_it_agree() {
    // A sky with a bright spot; the oracle is the same picture of paths that only leave, without looking at the sky.
    let medium = cloud(optics(0.9, 0.6), [2.0; 3]);
    let mut pixels = vec![[0.1; 3]; 16 * 8];
    pixels[16 * 2 + 3..16 * 2 + 6].fill([6.0; 3]);
    let bright = Environment::image(16, &pixels).unwrap();
    let with = render(&medium, &[Light::Environment(bright.clone())], at_the_cloud(), settings(24, 16), 64);
    let lights = [Light::Environment(bright)];
    let mut reference = Reference::new(&medium, &lights, at_the_cloud(), settings(24, 16)).unwrap();
    let (mut sum, mut square) = (0.0, 0.0);
    let count = 60_000;
    for number in 0..count {
        let mut stream = Stream::new(37, number);
        let ray = reference.view.ray(24.0 * stream.unit(), 16.0 * stream.unit());
        let radiance = f64::from(leaving(&mut reference, ray, &mut stream).x);
        sum += radiance;
        square += radiance * radiance;
    }
    let (wanted, found) = (sum / count as f64, mean(&with));
    let deviation = ((square / count as f64 - wanted * wanted) / count as f64).sqrt();
    assert!(deviation < 0.03 * wanted, "{deviation} of {wanted}");
    let allowed = 4.0 * deviation + 0.02 * wanted;
    assert!((found.0 - wanted).abs() < allowed, "{found:?} for {wanted} +- {deviation}");
}

/// Scattered radiance by paths that see the sky only when they leave.
fn leaving(reference: &mut Reference, ray: Ray, stream: &mut Stream) -> Vec3 {
    let optics = reference.tracker.medium().optics();
    let (mut ray, mut throughput) = (ray, Vec3::ONE);
    let mut is_scattered = false;
    while let Some(distance) = reference.tracker.next(FreePath::Exact, &ray, &mut throughput, stream) {
        throughput *= optics.albedo[0];
        let direction = optics.phase.sample(ray.direction, [stream.unit(), stream.unit()]);
        ray = Ray { origin: ray.origin + distance * ray.direction, direction, ..ray };
        is_scattered = true;
    }
    if is_scattered { throughput * reference.lights.seen(ray.direction) } else { Vec3::ZERO }
}
