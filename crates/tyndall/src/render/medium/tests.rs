//! The cache and the march against closed forms, and against the reference where there are none.

use glam::{DVec3, Vec3};

use super::brute::BruteForce;
use super::cache::{Cache, Multiple, Settings};
use super::columns::{Source, thickness};
use super::field::{Field, lattice_over, sample};
use super::free_path::{FreePath, Tracker};
use super::gather::{PhotonMap, Radius};
use super::harmonics::directions;
use super::march::{self, Illumination, March, Pixel};
use super::photons::{self, Stored};
use super::reference::{self, Reference};
use super::sweep::{Ordinate, Sweeper};
use crate::math::Ray;
use crate::medium::light::{Directional, Environment, Point};
use crate::medium::{Grid, Light, Medium, Noise, NoiseSettings, Optics, Phase};
use crate::random::Stream;
use crate::scene::camera::{Camera, Projection, View};

mod denoise;
mod emission;
mod finer;
mod refine;
mod solids;

const PI: f32 = std::f32::consts::PI;

/// A cube of edge 2 around the origin, of that extinction, sampled finely.
fn cube(extinction: f32, albedo: f32, g: f32) -> Medium {
    let grid = Grid::from_dense(Vec3::splat(-0.9375), 0.125, [16; 3], &[1.0; 4096]).unwrap();
    let optics = Optics { extinction: [extinction; 3], albedo: [albedo; 3], phase: Phase::new(g).unwrap() };
    Medium::new(grid, optics).unwrap()
}

/// Lumps of random size and place in a box of edge 2 around the origin.
fn lumps(optics: Optics) -> Medium {
    let mut stream = Stream::new(71, 0);
    let lumps: Vec<(Vec3, f32)> = (0..12).map(|_| (0.6 * stream.cube(), stream.range(0.15, 0.4))).collect();
    let value = |place: usize| {
        let at = Vec3::new((place % 24) as f32, (place / 24 % 24) as f32, (place / 576) as f32);
        let at = (at - 11.5) / 12.0;
        lumps
            .iter()
            .map(|(center, size)| (1.0 - (at - *center).length_squared() / (size * size)).max(0.0))
            .sum()
    };
    let values: Vec<f32> = (0..24 * 24 * 24).map(value).collect();
    let grid = Grid::from_dense(Vec3::splat(-11.5 / 12.0), 1.0 / 12.0, [24; 3], &values).unwrap();
    Medium::new(grid, optics).unwrap()
}

fn grey(extinction: f32, albedo: f32, g: f32) -> Optics {
    Optics { extinction: [extinction; 3], albedo: [albedo; 3], phase: Phase::new(g).unwrap() }
}

fn sun(irradiance: [f32; 3]) -> Light {
    Light::Directional(Directional::new(Vec3::new(0.5, -1.0, -0.4), irradiance).unwrap())
}

fn sky(radiance: [f32; 3]) -> Light {
    Light::Environment(Environment::constant(radiance).unwrap())
}

/// The box of edge 2, seen along -z by parallel rays.
fn view(size: u32) -> View {
    let projection = Projection::Orthographic { height: 2.4 };
    let camera = Camera { eye: DVec3::new(0.0, 0.0, 5.0), look_at: DVec3::ZERO, up: DVec3::Y, projection };
    camera.view(DVec3::ZERO, size, size).unwrap()
}

fn march(medium: &Medium, lights: &[Light], light: Illumination, settings: march::Settings) -> Vec<Pixel> {
    let view = view(settings.width);
    let mut march = March::new(medium, light, lights, view, settings).unwrap();
    while !march.is_done() {
        march.pass(&()).unwrap();
    }
    march.pixels()
}

const SMALL: march::Settings = march::Settings { width: 32, height: 32, samples: 4, seed: 5, step: 0.5 };

fn cached(medium: &Medium, lights: &[Light], settings: &Settings) -> Vec<Pixel> {
    let cache = Cache::new(medium, lights, settings, &()).unwrap();
    march(medium, lights, Illumination::Cached(&cache), SMALL)
}

/// Means over the picture of the scattered light.
fn mean(pixels: &[Pixel]) -> Vec3 {
    pixels.iter().map(|pixel| pixel.scattered).sum::<Vec3>() / pixels.len() as f32
}

fn reference(medium: &Medium, lights: &[Light], samples: u32) -> Vec3 {
    let settings = reference::Settings {
        width: SMALL.width,
        height: SMALL.height,
        seed: 6,
        orders: None,
        free_path: FreePath::Delta,
    };
    let mut reference = Reference::new(medium, lights, view(SMALL.width), settings).unwrap();
    reference.pass(samples, &()).unwrap();
    mean(&reference.pixels())
}

#[test]
fn columns_find_what_rays_find() {
    let medium = lumps(grey(1.0, 0.5, 0.0));
    let grid = medium.density();
    let density = Field::density(grid, lattice_over(grid, grid.spacing()));
    let tracker = Tracker::new(&medium);
    let mut stream = Stream::new(72, 0);
    let distant = (0..6).map(|_| Source::Distant(stream.direction())).collect::<Vec<_>>();
    let near = [Vec3::new(0.1, -0.2, 0.05), Vec3::new(3.0, 1.0, -0.5), Vec3::new(0.0, 0.0, 1.3)];
    let sources = distant.into_iter().chain(near.map(Source::Near)).chain([Source::Distant(Vec3::NEG_Y)]);
    let mut total = 0.0;
    for source in sources {
        let found = thickness(&density, source);
        let (mut error, mut most) = (0.0_f64, 0.0_f64);
        for place in (0..found.values.len()).step_by(7) {
            let at = found.lattice.position(sample(&found.lattice, place));
            let (toward, distance) = match source {
                Source::Distant(along) => (-along, f32::INFINITY),
                Source::Near(position) => ((position - at).normalize_or_zero(), position.distance(at)),
            };
            let ray = Ray { origin: at, direction: toward, t_min: 0.0, t_max: distance };
            let wanted = f64::from(tracker.column(&ray));
            error = error.max((f64::from(found.values[place]) - wanted).abs());
            most = most.max(wanted);
        }
        // Lumps are steep within a spacing, and the box ends in their middle.
        assert!(error < 0.12 * most, "{source:?}: {error} of {most}");
        total += error / most;
    }
    assert!(total / 10.0 < 0.06, "{total}");
}

#[test]
fn a_sweep_of_constant_light_is_constant() {
    let medium = lumps(grey(20.0, 0.5, 0.0));
    let grid = medium.density();
    let mut extinction = Field::density(grid, lattice_over(grid, 0.15));
    extinction.values.iter_mut().for_each(|it| *it *= 20.0);
    let count = extinction.values.len();
    let directions = directions(64);
    let weight = 4.0 * PI / 64.0;
    let ordinates: Vec<Ordinate> =
        directions.into_iter().map(|direction| Ordinate { direction, weight, inflow: 2.0 }).collect();
    // A source of 2 per extinction in all directions: its coefficient is 2 over the first harmonic.
    let isotropic = 0.282_094_8;
    let swept = Sweeper::new(extinction).sweep(&ordinates, &[vec![2.0 / isotropic; count]]);
    let wanted = 2.0 * 4.0 * PI * isotropic;
    assert!(swept[0].iter().all(|it| (it / wanted - 1.0).abs() < 1e-4));
}

#[test]
fn a_medium_without_absorption_is_invisible_in_a_uniform_sky() {
    for (extinction, g) in [(0.5, 0.0), (5.0, 0.0), (5.0, 0.6), (3.0, -0.4)] {
        let medium = lumps(grey(extinction, 1.0, g));
        let pixels = cached(&medium, &[sky([1.0; 3])], &Settings::default());
        for pixel in pixels {
            let light = pixel.scattered.x + pixel.environment.x;
            assert!((light - 1.0).abs() < 0.015, "extinction {extinction}, g {g}: {light}");
        }
    }
}

#[test]
fn what_comes_through_is_beers_law() {
    let medium = cube(1.5, 0.0, 0.0);
    let lights = [sky([0.3; 3])];
    let pixels = cached(&medium, &lights, &Settings::default());
    let middle = pixels[16 * 32 + 16];
    let wanted = (-1.5 * 2.0_f32).exp();
    assert!((middle.transmittance.x / wanted - 1.0).abs() < 1e-3, "{}", middle.transmittance.x);
    assert!((middle.environment.x / (0.3 * wanted) - 1.0).abs() < 1e-3);
    assert_eq!(middle.scattered, Vec3::ZERO);
    assert_eq!((pixels[0].transmittance, pixels[0].depth), (Vec3::ONE, f32::INFINITY));
    // Light is lost at 4 + x on average, x of an exponential law that ends at 2.
    let lost = 4.0 + (1.0 - wanted * (1.0 + 1.5 * 2.0)) / (1.5 * (1.0 - wanted));
    assert!((middle.depth - lost).abs() < 0.02, "{} {lost}", middle.depth);
    let settings =
        reference::Settings { width: 32, height: 32, seed: 6, orders: None, free_path: FreePath::Delta };
    let mut reference = Reference::new(&medium, &lights, view(32), settings).unwrap();
    reference.pass(64, &()).unwrap();
    let traced = reference.pixels()[16 * 32 + 16];
    assert!((traced.depth - lost).abs() < 0.02, "{} {lost}", traced.depth);
}

#[test]
fn single_scattering_of_a_sun_behind_the_camera_is_its_closed_form() {
    for g in [0.0, 0.5] {
        let (extinction, albedo) = (0.8, 1e-3);
        let medium = cube(extinction, albedo, g);
        let light = Light::Directional(Directional::new(Vec3::NEG_Z, [2.0; 3]).unwrap());
        let pixels = cached(&medium, &[light], &Settings::default());
        let backward = (1.0 - g * g) / (4.0 * PI * (1.0_f32 + g).powi(3));
        let wanted = albedo * backward * 2.0 * (1.0 - (-2.0 * extinction * 2.0_f32).exp()) / 2.0;
        let found = pixels[16 * 32 + 16].scattered.x;
        assert!((found / wanted - 1.0).abs() < 0.01, "g {g}: {found} {wanted}");
    }
}

#[test]
fn pictures_agree_with_the_reference() {
    let color = Optics { extinction: [3.0, 5.0, 8.0], albedo: [0.9, 0.8, 0.95], phase: Phase::ISOTROPIC };
    let point = Light::Point(Point::new(Vec3::new(0.3, 0.9, 0.5), [0.5, 1.0, 0.7]).unwrap());
    let image: Vec<[f32; 3]> = (0..32).map(|k| if k < 16 { [1.0, 0.8, 0.6] } else { [0.1; 3] }).collect();
    let image = Light::Environment(Environment::image(8, &image).unwrap());
    for (name, medium, lights) in [
        ("grey sun and sky", lumps(grey(6.0, 0.95, 0.0)), vec![sun([PI; 3]), sky([0.25; 3])]),
        ("forward", lumps(grey(6.0, 0.9, 0.6)), vec![sun([PI; 3]), sky([0.25; 3])]),
        ("straight on", lumps(grey(9.0, 0.95, 0.85)), vec![sun([PI; 3]), sky([0.25; 3])]),
        ("backward", lumps(grey(6.0, 0.9, -0.3)), vec![sun([PI, 2.0, 1.0])]),
        ("colored", lumps(color), vec![sun([3.0, 2.0, 1.0]), sky([0.1, 0.2, 0.4])]),
        ("point inside", lumps(grey(4.0, 0.9, 0.3)), vec![point]),
        ("image of the sky", lumps(grey(4.0, 0.9, 0.0)), vec![image]),
    ] {
        let found = mean(&cached(&medium, &lights, &Settings::default()));
        let wanted = reference(&medium, &lights, 64);
        let error = (found / wanted - 1.0).abs().max_element();
        // Near a light at a place the lattice of what is smooth is coarse.
        let most = if name == "point inside" { 0.04 } else { 0.03 };
        assert!(error < most, "{name}: {found} {wanted}");
    }
}

#[test]
fn a_channel_that_is_mixed_is_as_if_it_were_solved() {
    let colors = [[3.0, 2.5, 2.0], [0.1, 0.2, 0.4], [0.3, 0.1, 0.3]];
    for (g, count) in [(0.0, 2), (0.4, 2), (0.0, 3)] {
        let medium = lumps(grey(6.0, 0.9, g));
        let lit = |color: &dyn Fn(usize) -> [f32; 3], multiple| {
            let second = Light::Directional(Directional::new(Vec3::X, color(2)).unwrap());
            let lights = [sun(color(0)), sky(color(1)), second];
            mean(&cached(&medium, &lights[..count], &Settings { multiple, ..Settings::default() }))
        };
        for multiple in [Multiple::Sweeps, Multiple::None] {
            let found = lit(&|light| colors[light], multiple);
            for channel in 0..3 {
                let alone = lit(&|light| [colors[light][channel]; 3], multiple).x;
                let error = (found[channel] / alone - 1.0).abs();
                // A solve ends where a sweep changes a thousandth.
                assert!(error < 2e-3, "g {g}, {count} lights, {multiple:?}, channel {channel}: {error}");
            }
        }
    }
}

/// Halos in a box of edge 2 around the origin, tens of thousands of times as dense in their middle as between them.
fn halos(optics: Optics) -> Medium {
    let mut stream = Stream::new(71, 0);
    let halos: Vec<(Vec3, f32)> = (0..12).map(|_| (0.7 * stream.cube(), stream.range(0.1, 0.3))).collect();
    let value = |place: usize| {
        let at = Vec3::new((place % 24) as f32, (place / 24 % 24) as f32, (place / 576) as f32);
        let at = (at - 11.5) / 12.0;
        let density = |(center, size): &(Vec3, f32)| {
            let size_sq = size * size;
            (size_sq / ((at - *center).length_squared() + 1e-3 * size_sq)).powf(1.5)
        };
        halos.iter().map(density).sum()
    };
    let values: Vec<f32> = (0..24 * 24 * 24).map(value).collect();
    let grid = Grid::from_dense(Vec3::splat(-11.5 / 12.0), 1.0 / 12.0, [24; 3], &values).unwrap();
    Medium::new(grid, optics).unwrap()
}

#[test]
fn solid_matter_is_as_bright_as_thick_matter() {
    let lights = [sun([2.0, 1.5, 1.0]), sky([0.2, 0.3, 0.5])];
    // Two lattices to solve on.
    let settings = Settings { diffuse_spacing: Some(1.0 / 12.0), ..Settings::default() };
    let [thick, solid] = [1e2, 1e6].map(|extinction| {
        let medium = halos(grey(extinction, 0.99, 0.0));
        mean(&cached(&medium, &lights, &settings))
    });
    let ratio = solid / thick;
    assert!(ratio.min_element() > 0.7 && ratio.max_element() < 1.3, "{solid} beside {thick}");
}

fn photon_settings(count: u64) -> photons::Settings {
    photons::Settings {
        count,
        seed: 3,
        free_path: FreePath::Delta,
        stored: Stored::Multiple,
        memory_bytes: None,
    }
}

#[test]
fn photons_sweeps_and_brute_force_agree() {
    for g in [0.0, 0.4] {
        let medium = lumps(grey(6.0, 0.9, g));
        let lights = [sun([PI; 3]), sky([0.3; 3])];
        let by_sweeps = mean(&cached(&medium, &lights, &Settings::default())).x;
        for radius in [Radius::Automatic, Radius::Fixed(0.1), Radius::Nearest(60, 0.2)] {
            let multiple = Multiple::Photons(photon_settings(60_000), radius, 1);
            let by_photons = mean(&cached(&medium, &lights, &Settings { multiple, ..Settings::default() })).x;
            assert!((by_photons / by_sweeps - 1.0).abs() < 0.04, "{radius:?}: {by_photons} {by_sweeps}");
        }
        let stored = photons::trace(&medium, &lights, &photon_settings(60_000), &()).unwrap();
        let map = PhotonMap::new(&medium, &stored, Radius::Automatic).unwrap();
        let brute = BruteForce::new(&medium, &lights, map);
        let settings = march::Settings { samples: 1, ..SMALL };
        let by_force = mean(&march(&medium, &lights, Illumination::BruteForce(&brute), settings)).x;
        assert!((by_force / by_sweeps - 1.0).abs() < 0.04, "g {g}: {by_force} {by_sweeps}");
    }
}

/// An image of the sky, dark but for the pixel that is seen in a direction, which brings that irradiance; and the direction.
fn lone_pixel(toward: Vec3, irradiance: f32, around: f32) -> (Light, Vec3) {
    let [width, height] = [512, 256];
    let angle = |row: usize| (PI * row as f32 / height as f32).cos();
    let row = (toward.y.acos() / PI * height as f32) as usize;
    let column = ((toward.x.atan2(-toward.z) / (2.0 * PI) + 0.5) * width as f32) as usize;
    let solid_angle = 2.0 * PI / width as f32 * (angle(row) - angle(row + 1));
    let mut pixels = vec![[around; 3]; width * height];
    pixels[row * width + column] = [irradiance / solid_angle; 3];
    let (sin, y) = (PI * (row as f32 + 0.5) / height as f32).sin_cos();
    let turn = 2.0 * PI * ((column as f32 + 0.5) / width as f32 - 0.5);
    let middle = Vec3::new(sin * turn.sin(), y, -sin * turn.cos());
    (Light::Environment(Environment::image(width as u32, &pixels).unwrap()), middle)
}

#[test]
fn a_sun_of_one_pixel_is_a_distant_light_and_an_even_image_a_constant_sky() {
    let medium = lumps(grey(6.0, 0.9, 0.0));
    let even = Light::Environment(Environment::image(8, &[[0.3; 3]; 32]).unwrap());
    let (pixel, toward) = lone_pixel(Vec3::new(-0.5, 1.0, 0.4).normalize(), PI, 0.3);
    let sun = Light::Directional(Directional::new(-toward, [PI; 3]).unwrap());
    let photons = Multiple::Photons(photon_settings(600_000), Radius::Automatic, 1);
    for (name, image, plain) in
        [("even", vec![even], vec![sky([0.3; 3])]), ("sun", vec![pixel], vec![sun, sky([0.3; 3])])]
    {
        for (multiple, most) in [(Multiple::Sweeps, 2e-3), (photons, 0.02)] {
            let settings = Settings { multiple, ..Settings::default() };
            let [found, wanted] = [&image, &plain].map(|lights| mean(&cached(&medium, lights, &settings)));
            let error = (found / wanted - 1.0).abs().max_element();
            assert!(error < most, "{name}, {multiple:?}: {found} {wanted}");
        }
        let [found, wanted] = [&image, &plain].map(|lights| reference(&medium, lights, 64));
        assert!((found / wanted - 1.0).abs().max_element() < 0.02, "{name}: {found} {wanted}");
    }
}

#[test]
fn passes_of_photons_come_nearer_to_the_sweeps() {
    let medium = lumps(grey(6.0, 0.9, 0.0));
    let lights = [sun([PI; 3])];
    let settings = Settings { diffuse_spacing: Some(1.0 / 12.0), ..Settings::default() };
    let by_sweeps = cached(&medium, &lights, &settings);
    // A ball as wide as a lump: blurred, whatever the number of photons.
    let error = |passes: u32, radius| {
        let multiple = Multiple::Photons(photon_settings(40_000), radius, passes);
        let by_photons = cached(&medium, &lights, &Settings { multiple, ..settings });
        let pairs = by_photons.iter().zip(&by_sweeps);
        pairs.map(|(a, b)| (a.scattered - b.scattered).length_squared()).sum::<f32>()
    };
    for radius in [Radius::Fixed(0.35), Radius::Nearest(4000, 0.35)] {
        let errors = [error(1, radius), error(12, radius)];
        assert!(errors[1] < 0.7 * errors[0], "{radius:?}: {errors:?}");
    }
    // Passes double until twice as many make no more than the wanted difference.
    let multiple = Multiple::Photons(photon_settings(4000), Radius::Fixed(0.35), 64);
    let until = |photon_noise: Option<f32>| {
        let settings = Settings { multiple, photon_noise, ..settings };
        Cache::new(&medium, &lights, &settings, &()).unwrap().gathered().unwrap()
    };
    let (rough, fine) = (until(Some(0.1)), until(Some(0.05)));
    println!("{rough:?} {fine:?}");
    assert!(rough.change < 0.1 && fine.change < 0.05, "{rough:?} {fine:?}");
    assert!(rough.passes < fine.passes && fine.passes < 64, "{rough:?} {fine:?}");
    let none = Multiple::Photons(photon_settings(1000), Radius::Automatic, 0);
    let refused = Cache::new(&medium, &lights, &Settings { multiple: none, ..settings }, &());
    assert_eq!(refused.unwrap_err().code(), "setting");
}

#[test]
fn the_comparison_of_pictures_finds_light_that_is_missing() {
    let medium = lumps(grey(6.0, 0.95, 0.0));
    let lights = [sun([PI; 3]), sky([0.25; 3])];
    let found = mean(&cached(&medium, &lights[..1], &Settings::default()));
    assert!((found / reference(&medium, &lights, 16) - 1.0).abs().max_element() > 0.1);
}

#[test]
fn the_same_seed_gives_the_same_bits_for_any_number_of_threads() {
    let medium = lumps(grey(6.0, 0.9, 0.3));
    let lights = [sun([PI, 2.0, 1.0]), sky([0.3; 3])];
    let pictures = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let by_photons = Multiple::Photons(photon_settings(5000), Radius::Automatic, 2);
            let settings = Settings { multiple: by_photons, ..Settings::default() };
            (cached(&medium, &lights, &Settings::default()), cached(&medium, &lights, &settings))
        })
    });
    assert!(pictures[0] == pictures[1]);
}

#[test]
fn packets_of_rays_find_what_each_ray_finds_bit_for_bit() {
    let colored = Optics { extinction: [4.0, 7.0, 12.0], albedo: [0.9, 0.8, 0.7], ..grey(0.0, 0.0, 0.3) };
    // Lumps with empty bricks between them, and a cloud that is opaque and far off center.
    let mut stream = Stream::new(73, 0);
    let size = [70, 41, 56];
    let corner = |stream: &mut Stream| size.map(|count| (stream.unit() * (count - 9) as f32) as u32);
    let corners: Vec<[u32; 3]> = (0..9).map(|_| corner(&mut stream)).collect();
    let value = |place: u32| {
        let at = [place % size[0], place / size[0] % size[1], place / (size[0] * size[1])];
        let inside =
            |corner: &[u32; 3]| (0..3).all(|axis| (corner[axis]..corner[axis] + 9).contains(&at[axis]));
        corners.iter().filter(|corner| inside(corner)).count() as f32 * (1.0 + at[0] as f32 / 70.0)
    };
    let values: Vec<f32> = (0..size.iter().product()).map(value).collect();
    let grid = Grid::from_dense(Vec3::new(-1.0, -0.6, -0.8), 2.0 / 70.0, size, &values).unwrap();
    let sparse = |optics| Medium::new(grid.clone(), optics).unwrap();
    for medium in [lumps(grey(9.0, 0.9, 0.0)), lumps(colored), sparse(grey(40.0, 0.9, 0.0)), sparse(colored)]
    {
        let lights = [sun([PI, 2.0, 1.0]), sky([0.3; 3])];
        let cache = Cache::new(&medium, &lights, &Settings::default(), &()).unwrap();
        let inside = Projection::Perspective { vertical_angle: 1.2 };
        let eyes = [DVec3::new(0.0, 0.0, 5.0), DVec3::new(0.1, 0.2, 0.3), DVec3::new(-2.0, 1.0, 0.0)];
        let projections = [Projection::Orthographic { height: 2.4 }, inside, inside];
        for (eye, projection) in eyes.into_iter().zip(projections) {
            let camera = Camera { eye, look_at: DVec3::ZERO, up: DVec3::Y, projection };
            let view = camera.view(DVec3::ZERO, 37, 21).unwrap();
            for samples in [1, 2] {
                let settings = march::Settings { width: 37, height: 21, samples, seed: 9, step: 1.3 };
                let march =
                    || March::new(&medium, Illumination::Cached(&cache), &lights, view, settings).unwrap();
                let [mut packets, mut rays] = [march(), march()];
                for _ in 0..samples {
                    packets.pass(&()).unwrap();
                    rays.pass_by_rays();
                }
                let different =
                    packets.pixels().into_iter().zip(rays.pixels()).filter(|(a, b)| a != b).count();
                assert_eq!(different, 0, "eye {eye}, {samples} samples");
                assert!(rays.pixels().iter().any(|pixel| pixel.scattered.x > 0.0));
            }
        }
    }
}

#[test]
fn noise_of_amplitude_zero_changes_little_and_noise_keeps_the_mean() {
    let medium = cube(0.5, 0.9, 0.0);
    let lights = [sky([1.0; 3])];
    let cache = Cache::new(&medium, &lights, &Settings::default(), &()).unwrap();
    let with = |position: f32, density: f32| {
        let settings =
            NoiseSettings { position, density, octaves: 3, scale: 0.2, seed: 1, ..NoiseSettings::default() };
        let noise = Noise::new(settings).unwrap();
        let light = Illumination::Cached(&cache);
        let mut march = March::new(&medium, light, &lights, view(32), SMALL).unwrap().with_noise(&noise);
        while !march.is_done() {
            march.pass(&()).unwrap();
        }
        mean(&march.pixels()).x
    };
    let without = mean(&march(&medium, &lights, Illumination::Cached(&cache), SMALL)).x;
    assert!((with(0.0, 0.0) / without - 1.0).abs() < 0.01);
    let changed = [with(0.5, 0.0), with(0.0, 0.8)];
    assert!(
        changed.iter().all(|it| *it != without && (it / without - 1.0).abs() < 0.1),
        "{changed:?} {without}"
    );
}

/// The picture of `medium` in noise, `size` pixels wide, with one sample in the middle of each.
fn dispersed(medium: &Medium, cache: &Cache, size: u32, noise: NoiseSettings) -> Vec<Pixel> {
    let settings = march::Settings { width: size, height: size, samples: 1, seed: 1, step: 1.0 };
    let noise = Noise::new(noise).unwrap();
    let march = March::new(medium, Illumination::Cached(cache), &[], view(size), settings).unwrap();
    let mut march = march.with_noise(&noise);
    march.pass(&()).unwrap();
    march.pixels()
}

#[test]
fn wide_pixels_show_the_mean_of_narrow_ones_where_octaves_fade() {
    let medium = cube(0.7, 0.9, 0.0);
    let cache = Cache::new(&medium, &[sky([1.0; 3])], &Settings::default(), &()).unwrap();
    const WIDE: usize = 12;
    const SHARE: usize = 6;
    let noise = NoiseSettings { density: 1.5, octaves: 2, scale: 0.1, seed: 2, ..NoiseSettings::default() };
    let all = NoiseSettings { detail: 0.0, ..noise };
    let fine = dispersed(&medium, &cache, (WIDE * SHARE) as u32, all);
    let mean_of = |number: usize| {
        let corner = number / WIDE * SHARE * WIDE * SHARE + number % WIDE * SHARE;
        let part = (0..SHARE * SHARE).map(|it| fine[corner + it / SHARE * WIDE * SHARE + it % SHARE]);
        part.map(|it| it.transmittance.x).sum::<f32>() / (SHARE * SHARE) as f32
    };
    let error = |noise: NoiseSettings| {
        let wide = dispersed(&medium, &cache, WIDE as u32, noise);
        // Away from the borders of the cube.
        let inner =
            (0..WIDE * WIDE).filter(|it| [it / WIDE, it % WIDE].iter().all(|at| (2..WIDE - 2).contains(at)));
        inner.map(|it| (wide[it].transmittance.x - mean_of(it)).powi(2)).sum::<f32>().sqrt()
    };
    let [with, without] = [noise, all].map(error);
    println!("{with} where octaves fade, {without} where not");
    assert!(with < 0.7 * without, "{with} {without}");

    // From so far that nothing is left of it, noise changes nothing and costs nothing.
    let none = NoiseSettings { density: 0.0, ..noise };
    let [far, near] = [0.19, 0.26].map(|scale| NoiseSettings { scale, octaves: 4, ..noise });
    let settings =
        march::Settings { width: WIDE as u32, height: WIDE as u32, samples: 1, seed: 1, step: 1.0 };
    let plain = march(&medium, &[], Illumination::Cached(&cache), settings);
    assert!(dispersed(&medium, &cache, WIDE as u32, far) == plain);
    assert!(dispersed(&medium, &cache, WIDE as u32, near) != dispersed(&medium, &cache, WIDE as u32, none));
}

#[test]
fn what_cannot_be_is_refused() {
    let medium = cube(1.0, 0.5, 0.0);
    let refused = |settings: Settings| Cache::new(&medium, &[], &settings, &()).is_err();
    assert!(refused(Settings { directions: 7, ..Settings::default() }));
    assert!(refused(Settings { spacing: Some(0.0), ..Settings::default() }));
    assert!(refused(Settings { diffuse_spacing: Some(f32::NAN), ..Settings::default() }));
    let none = photons::Photons::default();
    assert!(PhotonMap::new(&medium, &none, Radius::Fixed(-1.0)).is_err());
    assert!(PhotonMap::new(&medium, &none, Radius::Nearest(0, 1.0)).is_err());
    // No light is no light, and no photons are none.
    let dark = cached(&medium, &[], &Settings::default());
    assert_eq!(mean(&dark), Vec3::ZERO);
    assert!(PhotonMap::new(&medium, &none, Radius::Automatic).is_ok());
}
