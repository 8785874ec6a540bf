//! Opaque spheres in media against closed forms, and the cache, the march and photons against the reference.

use super::*;
use crate::medium::grid::Lattice;
use crate::particles::{Columns, Particles, Positions, Radii};
use crate::render::medium::diffuse::{self, Accuracy, Bodies, Channel, Level};
use crate::render::medium::field::Field;
use crate::render::medium::harmonics;
use crate::render::medium::solids::Solids;
use crate::render::medium::sweep::Ordinate;
use crate::scene::Scene;
use crate::scene::color::ParticleColors;
use crate::scene::light::Lighting;
use crate::structure::shapes::{Mesh, Segment};
use crate::structure::{Kind, Structure};

/// Spheres of one radius and color, as the medium is measured.
fn spheres(centers: &[Vec3], radius: f32, color: [f32; 3]) -> Scene {
    let mut columns = Columns { positions: Positions::around(DVec3::ZERO), ..Columns::default() };
    columns.positions.extend(&centers.iter().map(|it| it.as_dvec3()).collect::<Vec<_>>());
    let particles = Particles::new(columns).unwrap();
    let structure = Structure::build(Kind::default(), particles, &Radii::Uniform(radius), 1.0, &()).unwrap();
    Scene::new(structure, ParticleColors::constant(color), Lighting::Flat, None)
}

pub(super) fn some_spheres() -> Scene {
    let mut stream = Stream::new(72, 0);
    let centers: Vec<Vec3> = (0..14).map(|_| 0.7 * stream.cube()).collect();
    spheres(&centers, 0.17, [0.8, 0.5, 0.2])
}

fn traced(
    medium: &Medium,
    lights: &[Light],
    solids: &Scene,
    orders: Option<u32>,
    samples: u32,
) -> Vec<Pixel> {
    let settings = reference::Settings { width: 32, height: 32, seed: 6, orders, free_path: FreePath::Delta };
    let reference = Reference::new(medium, lights, view(32), settings).unwrap();
    let mut reference = reference.with_solids(Solids::new(solids));
    reference.pass(samples, &()).unwrap();
    reference.pixels()
}

fn marched(
    medium: &Medium,
    lights: &[Light],
    solids: &Scene,
    settings: &Settings,
    samples: u32,
) -> Vec<Pixel> {
    let cache = Cache::around(medium, lights, Some(Solids::new(solids)), settings, &()).unwrap();
    marched_in(&cache, medium, lights, solids, samples)
}

/// The same in light that was found before.
fn marched_in(cache: &Cache, medium: &Medium, lights: &[Light], solids: &Scene, samples: u32) -> Vec<Pixel> {
    let bodies = Solids::new(solids);
    let knobs = march::Settings { samples, ..SMALL };
    let march = March::new(medium, Illumination::Cached(cache), lights, view(32), knobs).unwrap();
    let mut march = march.with_solids(bodies);
    while !march.is_done() {
        march.pass(&()).unwrap();
    }
    march.pixels()
}

const MIDDLE: usize = 16 * 32 + 16;

#[test]
fn a_sphere_behind_matter_that_absorbs_is_as_bright_as_the_formula_says() {
    // Light from the eye onto the point that faces it: color / pi, through the matter there and back.
    let lights = [Light::Directional(Directional::new(Vec3::NEG_Z, [PI; 3]).unwrap())];
    let solids = spheres(&[Vec3::new(0.0, 0.0, -0.5)], 0.5, [0.8, 0.4, 0.2]);
    for extinction in [0.0, 0.3, 2.0] {
        let medium = cube(extinction, 0.0, 0.0);
        let wanted = Vec3::new(0.8, 0.4, 0.2) * (-2.0 * extinction).exp();
        for pixels in [
            traced(&medium, &lights, &solids, None, 8),
            marched(&medium, &lights, &solids, &Settings::default(), 8),
        ] {
            let Pixel { scattered, environment, transmittance, .. } = pixels[MIDDLE];
            // A pixel's corner lies a little off the middle of the sphere.
            assert!(
                (scattered / wanted - 1.0).abs().max_element() < 0.03,
                "{extinction}: {scattered} {wanted}"
            );
            assert_eq!((environment, transmittance), (Vec3::ZERO, Vec3::ZERO));
        }
    }
}

#[test]
fn matter_in_the_shadow_of_a_sphere_scatters_nothing() {
    // Thin matter in light across the view: of the way through the cube, what the sphere shadows is dark.
    let lights = [Light::Directional(Directional::new(Vec3::NEG_Y, [1.0; 3]).unwrap())];
    let medium = cube(1e-3, 1.0, 0.0);
    let solids = spheres(&[Vec3::new(0.0, 0.6, 0.0)], 0.3, [0.0; 3]);
    let below = 22 * 32 + 16;
    let lit = |pixels: &[Pixel]| pixels[below].scattered.x / (1e-3 / (4.0 * PI));
    let reference = lit(&traced(&medium, &lights, &solids, Some(1), 128));
    let found = lit(&marched(&medium, &lights, &solids, &Settings::default(), 16));
    // 2 long, less the chord of the shadow: 0.6 but for the width of the pixel.
    assert!((reference - 1.4).abs() < 0.02, "{reference}");
    assert!((found - 1.4).abs() < 0.06, "{found}");
}

#[test]
fn white_spheres_in_white_matter_under_an_even_sky_are_not_seen() {
    let (medium, solids) = (lumps(grey(6.0, 1.0, 0.3)), some_spheres());
    let solids = {
        let mut white = solids;
        white.recolor(ParticleColors::constant([1.0; 3]));
        white
    };
    let lights = [sky([1.0; 3])];
    let pixels = traced(&medium, &lights, &solids, None, 24);
    let mean = pixels.iter().map(|it| it.scattered + it.environment).sum::<Vec3>() / pixels.len() as f32;
    assert!((mean - 1.0).abs().max_element() < 5e-3, "{mean}");
    // The cache takes bodies as matter: it loses a little light beside them.
    let pixels = marched(&medium, &lights, &solids, &Settings::default(), 16);
    let mean = pixels.iter().map(|it| it.scattered + it.environment).sum::<Vec3>() / pixels.len() as f32;
    assert!((mean - 1.0).abs().max_element() < 0.03, "{mean}");
}

/// Mean of squared differences over the squared reference, of pixels that are not black.
pub(super) fn relative_error(found: &[Pixel], wanted: &[Pixel]) -> f32 {
    let total = |pixel: &Pixel| pixel.scattered + pixel.environment;
    let error = |(found, wanted): (&Pixel, &Pixel)| {
        let (found, wanted) = (total(found), total(wanted));
        ((found - wanted) * (found - wanted) / (wanted * wanted + 1e-2)).element_sum() / 3.0
    };
    found.iter().zip(wanted).map(error).sum::<f32>() / found.len() as f32
}

#[test]
fn spheres_in_smoke_are_those_of_the_reference() {
    let point = Light::Point(Point::new(Vec3::new(0.9, 0.9, 0.9), [2.0, 1.6, 1.2]).unwrap());
    let solids = some_spheres();
    let scenes = [
        (lumps(grey(3.0, 0.9, 0.0)), vec![sun([4.0, 3.0, 2.0]), sky([0.3, 0.4, 0.6])]),
        (lumps(grey(8.0, 0.6, 0.5)), vec![sun([4.0; 3])]),
        (lumps(grey(2.0, 0.8, 0.0)), vec![point, sky([0.2; 3])]),
    ];
    for (number, (medium, lights)) in scenes.iter().enumerate() {
        let wanted = traced(medium, lights, &solids, None, 96);
        let found = marched(medium, lights, &solids, &Settings::default(), 32);
        let error = relative_error(&found, &wanted);
        let [found, wanted] = [mean(&found), mean(&wanted)];
        println!("scene {number}: relMSE {error:.5}, means {found} and {wanted}");
        assert!(error < 0.01, "scene {number}: {error}");
        assert!((found / wanted - 1.0).abs().max_element() < 0.035, "scene {number}: {found} {wanted}");
    }
}

#[test]
fn photons_from_spheres_bring_their_light() {
    let (medium, solids) = (lumps(grey(3.0, 0.9, 0.0)), some_spheres());
    let lights = [sun([4.0, 3.0, 2.0])];
    let photons = photons::Settings {
        count: 200_000,
        seed: 3,
        free_path: FreePath::Delta,
        stored: Stored::Multiple,
        memory_bytes: None,
    };
    let bodies = Solids::new(&solids);
    let emitted = photons::trace_around(&medium, &lights, Some(bodies), &photons, &()).unwrap();
    let kept = emitted.escaped_power + emitted.absorbed_power;
    assert!(kept.abs_diff_eq(emitted.emitted_power, 1e-3 * emitted.emitted_power.x), "{emitted:?}");

    let multiple = Multiple::Photons(photons, Radius::default(), 1);
    let settings = Settings { multiple, ..Settings::default() };
    let by_photons = mean(&marched(&medium, &lights, &solids, &settings, 16));
    let wanted = mean(&traced(&medium, &lights, &solids, None, 96));
    println!("photons {by_photons}, reference {wanted}");
    assert!((by_photons / wanted - 1.0).abs().max_element() < 0.02, "{by_photons} {wanted}");
}

#[test]
fn without_a_cache_spheres_shadow_matter_too() {
    let (medium, solids) = (lumps(grey(3.0, 0.9, 0.0)), some_spheres());
    let lights = [sun([4.0, 3.0, 2.0])];
    let photons = photons::Settings {
        count: 40_000,
        seed: 3,
        free_path: FreePath::Delta,
        stored: Stored::Multiple,
        memory_bytes: None,
    };
    let bodies = Solids::new(&solids);
    let multiple = Multiple::Photons(photons, Radius::default(), 1);
    let photons = photons::trace_around(&medium, &lights, Some(bodies), &photons, &()).unwrap();
    let found = |photons: &photons::Photons, is_shadowed: bool| {
        let map = PhotonMap::new(&medium, photons, Radius::default()).unwrap();
        let brute = BruteForce::new(&medium, &lights, map);
        let brute = if is_shadowed { brute.with_solids(bodies) } else { brute };
        let knobs = march::Settings { samples: 2, step: 2.0, ..SMALL };
        let light = Illumination::BruteForce(&brute);
        let mut march = March::new(&medium, light, &lights, view(32), knobs).unwrap().with_solids(bodies);
        march.pass(&()).unwrap();
        march.pass(&()).unwrap();
        mean(&march.pixels())
    };
    let cached = |multiple| {
        let settings = Settings { multiple, ..Settings::default() };
        mean(&marched(&medium, &lights, &solids, &settings, 4))
    };
    let none = photons::Photons::default();
    let pairs = [(found(&photons, true), cached(multiple)), (found(&none, true), cached(Multiple::None))];
    for (found, wanted) in pairs {
        println!("{found} and {wanted} from a cache");
        assert!((found / wanted - 1.0).abs().max_element() < 0.05, "{found} {wanted}");
    }
    let without = found(&none, false);
    assert!((without / pairs[1].0).min_element() > 1.03, "{without} {pairs:?}");
}

#[test]
fn bodies_that_give_off_what_they_absorb_are_invisible_in_a_furnace() {
    let radiance = 0.25;
    let lights = [sky([radiance; 3])];
    let (medium, mut solids) = (cube(2.0, 1.0, 0.4), some_spheres());
    let glow = [0.8, 0.5, 0.2].map(|color| radiance * (1.0 - color));
    solids.set_glow(Some(&[glow; 14])).unwrap();
    for (pixels, most) in [
        (traced(&medium, &lights, &solids, None, 16), 0.002),
        (marched(&medium, &lights, &solids, &Settings::default(), 4), 0.01),
    ] {
        let seen = pixels.iter().map(|pixel| pixel.scattered + pixel.environment);
        let mean = seen.sum::<Vec3>() / pixels.len() as f32;
        assert!((mean / radiance - 1.0).abs().max_element() < most, "{mean}");
    }
}

#[test]
fn spheres_that_glow_are_seen_and_light_the_matter_around_them() {
    let mut black = spheres(&[Vec3::new(0.0, 0.0, -0.5)], 0.5, [0.0; 3]);
    let glow = Vec3::new(2.0, 1.0, 0.5);
    black.set_glow(Some(&[glow.to_array()])).unwrap();
    let medium = cube(0.7, 0.0, 0.0);
    let wanted = glow * (-0.7_f32).exp();
    for pixels in
        [traced(&medium, &[], &black, None, 4), marched(&medium, &[], &black, &Settings::default(), 4)]
    {
        let found = pixels[MIDDLE].scattered;
        assert!((found / wanted - 1.0).abs().max_element() < 0.01, "{found} {wanted}");
    }

    let mut solids = some_spheres();
    solids.set_glow(Some(&[glow.to_array(); 14])).unwrap();
    let medium = lumps(grey(4.0, 0.9, 0.0));
    let wanted = mean(&traced(&medium, &[], &solids, None, 64));
    let found = mean(&marched(&medium, &[], &solids, &Settings::default(), 16));
    println!("glowing: {found} and {wanted}");
    assert!((found / wanted - 1.0).abs().max_element() < 0.04, "{found} {wanted}");
    assert!(solids.set_glow(Some(&[[-1.0, 0.0, 0.0]; 14])).is_err());
}

#[test]
fn bonds_stop_and_throw_back_smooth_light_as_in_the_reference() {
    let mut stream = Stream::new(79, 0);
    let centers: Vec<Vec3> = (0..30).map(|_| 0.8 * stream.cube()).collect();
    let mut solids = spheres(&centers, 0.03, [0.1, 0.2, 0.6]);
    let segment = |k: u32| {
        let ends = [2 * k, 2 * k + 1];
        Segment { from: centers[ends[0] as usize], to: centers[ends[1] as usize], ends }
    };
    solids.bond(&(0..15).map(segment).collect::<Vec<_>>(), 0.08).unwrap();
    let medium = lumps(grey(4.0, 1.0, 0.0));
    let lights = [sky([1.0; 3])];
    let wanted = traced(&medium, &lights, &solids, None, 48);
    let found = marched(&medium, &lights, &solids, &Settings::default(), 16);
    let unbonded = spheres(&centers, 0.03, [0.1, 0.2, 0.6]);
    let around = Some(Solids::new(&unbonded));
    let cache = Cache::around(&medium, &lights, around, &Settings::default(), &()).unwrap();
    let without = marched_in(&cache, &medium, &lights, &solids, 16);
    let error = relative_error(&found, &wanted);
    let total = |pixels: &[Pixel]| {
        mean(pixels) + pixels.iter().map(|it| it.environment).sum::<Vec3>() / pixels.len() as f32
    };
    let [found, without, wanted] = [&found[..], &without[..], &wanted[..]].map(total);
    println!("bonds: relMSE {error:.5}, means {found}, {without} without them in the light, and {wanted}");
    assert!(error < 0.006, "{error}");
    let [found, without] = [found, without].map(|it| (it / wanted - 1.0).abs().max_element());
    assert!(found < 0.02 && without > 2.0 * found, "{found} {without}");
}

#[test]
fn no_spheres_change_nothing() {
    let medium = lumps(grey(3.0, 0.9, 0.0));
    let lights = [sun([4.0; 3]), sky([0.3; 3])];
    let nothing = spheres(&[], 1.0, [1.0; 3]);
    let with = mean(&marched(&medium, &lights, &nothing, &Settings::default(), 4));
    let without = mean(&cached(&medium, &lights, &Settings::default()));
    assert!((with / without - 1.0).abs().max_element() < 1e-3, "{with} {without}");
}

#[test]
fn balls_for_smooth_light_throw_back_what_spheres_do() {
    let [even, ..] = harmonics::evaluate(Vec3::Z);
    let along = Vec3::new(0.48, 0.6, -0.64);
    let ordinate = |direction, inflow| Ordinate { direction, weight: 4.0 * PI / 64.0, inflow };
    for wide in [0.3_f32, 1.0, 2.0, 4.0] {
        let edge = (2.0 * wide + 6.0).ceil() as u32;
        let lattice = Lattice { origin: Vec3::ZERO, spacing: 1.0, size: [edge; 3] };
        let nothing = vec![0.0; lattice.sample_count() as usize];
        for color in [0.0, 0.2, 0.5, 0.9] {
            let solids = spheres(&[Vec3::splat(0.5 * edge as f32 - 0.37)], wide, [color; 3]);
            let smooth = Solids::new(&solids).smooth(lattice);
            let albedo = smooth.color.x;
            let extinction = Field { lattice, values: smooth.extinction };
            let beam: Vec<f32> = thickness(&extinction, Source::Distant(along))
                .values
                .iter()
                .map(|t| even * (-t).exp())
                .collect();
            // The share that is kept of an even sky's light, and of a beam's.
            for (inflow, direct, light) in [(1.0, &nothing, 4.0 * PI), (0.0, &beam, 1.0)] {
                let ordinates: Vec<_> =
                    harmonics::directions(64).into_iter().map(|it| ordinate(it, inflow)).collect();
                let bodies = Bodies { extinction: extinction.values.clone(), albedo, emitted: None };
                let density = Field { lattice, values: nothing.clone() };
                let level =
                    Level { density, direct: vec![direct.clone()], emitted: None, bodies: Some(bodies) };
                let channel = Channel { extinction: 1.0, albedo: 0.0, g: 0.0, order: 0, peak: 0.0 };
                let accuracy = Accuracy { change: 1e-3, sweeps: [100, 3] };
                let found = diffuse::solve(channel, &[level], &ordinates, accuracy, &()).unwrap();
                let arrived =
                    found[0].values.iter().zip(direct).map(|(found, direct)| (found + direct) / even);
                let stopped: f32 = arrived.zip(&extinction.values).map(|(light, k)| light * k).sum();
                let kept = (1.0 - albedo) * stopped / (light * PI * wide * wide);
                println!("{wide} cells, {color}: keeps {kept}");
                assert!((kept - (1.0 - color)).abs() < 0.12 * (1.0 - color), "{wide} {color}: {kept}");
            }
        }
    }
}

/// A wide wall through the box that hides without being shown: where the coordinate along `axis` is `at`, on the side of it where that along `other` is below `end`.
fn add_wall(scene: &mut Scene, (axis, at): (usize, f64), (other, end): (usize, f64), color: [f32; 3]) {
    let third = 3 - axis - other;
    let corner = |along: f64, across: f64| {
        let mut corner = DVec3::ZERO;
        (corner[axis], corner[other], corner[third]) = (at, along, across);
        corner
    };
    let corners = vec![corner(-9.0, -9.0), corner(end, -9.0), corner(end, 9.0), corner(-9.0, 9.0)];
    let mesh = Mesh::new("wall", corners, vec![[0, 1, 2], [0, 2, 3]]).unwrap();
    scene.add_holdout(&mesh, color).unwrap();
}

#[test]
fn a_holdout_ends_rays_and_is_not_shown() {
    // Through the middle of the box, on the left side of the view: one sphere is behind it, one before.
    let mut solids = spheres(&[Vec3::new(-0.5, 0.0, -0.5), Vec3::new(-0.5, 0.7, 0.5)], 0.2, [0.5; 3]);
    add_wall(&mut solids, (2, 0.0), (0, 0.0), [0.5; 3]);
    let (medium, lights) = (cube(1.0, 0.0, 0.0), [sky([2.0; 3])]);
    let mut alone = spheres(&[], 0.2, [0.5; 3]);
    add_wall(&mut alone, (2, 0.0), (0, 0.0), [0.5; 3]);
    for pixels in [
        traced(&medium, &lights, &solids, None, 8),
        marched(&medium, &lights, &solids, &Settings::default(), 8),
        traced(&medium, &lights, &alone, None, 8),
        marched(&medium, &lights, &alone, &Settings::default(), 8),
    ] {
        for (row, column, depth) in [(16, 9, 1.0_f32), (16, 22, 2.0)] {
            let Pixel { scattered, environment, transmittance, .. } = pixels[row * 32 + column];
            assert!((transmittance - (-depth).exp()).abs().max_element() < 0.01, "{depth}: {transmittance}");
            assert!((environment - 2.0 * transmittance).abs().max_element() < 1e-5, "{environment}");
            assert_eq!(scattered, Vec3::ZERO);
        }
    }
    let in_front = 6 * 32 + 9;
    assert_eq!(
        marched(&medium, &lights, &solids, &Settings::default(), 8)[in_front].transmittance,
        Vec3::ZERO
    );
    assert!(marched(&medium, &lights, &alone, &Settings::default(), 8)[in_front].transmittance.x > 0.3);
}

#[test]
fn a_holdout_keeps_light_off() {
    // Thin matter below a wall across the light is dark, above it is not.
    let lights = [Light::Directional(Directional::new(Vec3::NEG_Y, [1.0; 3]).unwrap())];
    let mut ceiling = spheres(&[], 1.0, [0.0; 3]);
    add_wall(&mut ceiling, (1, 0.05), (0, 9.0), [0.0; 3]);
    let lit = |pixels: &[Pixel], row: usize| pixels[row * 32 + 16].scattered.x / (1e-3 / (4.0 * PI));
    for pixels in [
        traced(&cube(1e-3, 1.0, 0.0), &lights, &ceiling, Some(1), 32),
        marched(&cube(1e-3, 1.0, 0.0), &lights, &ceiling, &Settings::default(), 8),
    ] {
        assert!(
            (lit(&pixels, 8) - 2.0).abs() < 0.05 && lit(&pixels, 22) < 0.02,
            "{} {}",
            lit(&pixels, 8),
            lit(&pixels, 22)
        );
    }
}
