//! Photons against slabs and a point source in closed form. Numbers from `bench/volume/analytic.json`: sections
//! `slab_all_orders_flux_fractions` (adding and doubling, good to 1e-5), `infinite_medium_point_source_fluence`, `invariants`.

use super::*;
use crate::medium::light::{Directional, Environment, Point};
use crate::medium::{Grid, Optics, Phase};
use crate::progress::Progress;

const RIGHT: [FreePath; 2] = [FreePath::Exact, FreePath::Delta];

fn settings(count: u64, free_path: FreePath) -> Settings {
    Settings { count, seed: 3, free_path, stored: Stored::All, memory_bytes: None }
}

/// A plume: dense along its axis, nothing at its rim.
fn plume(albedo: f32) -> Medium {
    let size = [40, 30, 20];
    let field = |i: u32, j: u32, k: u32| {
        let across = ((j as f32 - 14.5) / 6.0).powi(2) + ((k as f32 - 9.5) / 4.0).powi(2);
        if across < 4.0 { (i * (39 - i)) as f32 / 16.0 * ((-across).exp() - 0.018) } else { 0.0 }
    };
    let mut values = Vec::new();
    for k in 0..size[2] {
        for j in 0..size[1] {
            values.extend((0..size[0]).map(|i| field(i, j, k)));
        }
    }
    let grid = Grid::from_dense(Vec3::ZERO, 0.1, size, &values).unwrap();
    let optics = Optics { extinction: [0.3; 3], albedo: [albedo; 3], phase: Phase::new(0.3).unwrap() };
    Medium::new(grid, optics).unwrap()
}

fn lights() -> Vec<Light> {
    vec![
        Light::Directional(Directional::new(Vec3::new(-1.0, -0.4, 0.2), [1.0, 2.0, 3.0]).unwrap()),
        Light::Point(Point::new(Vec3::new(2.0, 1.5, 1.0), [0.5; 3]).unwrap()),
        Light::Environment(Environment::constant([0.2; 3]).unwrap()),
    ]
}

#[test]
fn slabs_reflect_and_let_through_what_adding_and_doubling_says() {
    // Optical depth, albedo, g, cosine of the light; reflected, let through scattered and straight.
    for (depth, albedo, g, cosine, reflected, scattered, straight) in [
        (1.0, 1.0, 0.0, 1.0, 0.341_328_69, 0.290_791_74, 0.367_879_44),
        (4.0, 0.95, 0.0, 1.0, 0.512_421_68, 0.168_599_28, 0.018_315_64),
        (10.0, 0.95, 0.6, 0.6, 0.457_397_35, 0.060_463_59, 6e-8),
        (2.0, 0.9, 0.75, 1.0, 0.097_394_57, 0.525_622_34, 0.135_335_28),
    ] {
        let size = [200, 200, 1];
        let grid = Grid::from_dense(Vec3::ZERO, depth, size, &vec![1.0; 40_000]).unwrap();
        let optics = Optics { extinction: [1.0; 3], albedo: [albedo; 3], phase: Phase::new(g).unwrap() };
        let medium = Medium::new(grid, optics).unwrap();
        let sine = f32::sqrt(1.0 - cosine * cosine);
        let origin = Vec3::new(100.0 * depth, 100.0 * depth, -0.5 * depth);
        for free_path in RIGHT {
            let settings = settings(1, free_path);
            let bounds = medium.bounds();
            let tracer = Tracer { tracker: Tracker::new(&medium), solids: None, bounds, settings: &settings };
            let (mut back, mut on, mut at_once) = (0.0, 0.0, 0.0);
            let count = 20_000;
            for number in 0..count {
                let mut photons = Photons::default();
                let direction = Vec3::new(sine, 0.0, cosine);
                let emission = Emission { origin, direction, power: Vec3::ONE };
                let mut stream = Stream::new(91, number);
                let fate = tracer.follow(emission, true, &mut stream, &mut photons);
                match fate {
                    Some(_) if photons.interactions == 0 => at_once += 1.0,
                    Some(direction) if direction.z < 0.0 => back += 1.0,
                    Some(_) => on += 1.0,
                    None => (),
                }
            }
            for (found, wanted) in [(back, reflected), (on, scattered), (at_once, straight)] {
                let deviation = (wanted * (1.0 - wanted) / count as f64).sqrt().max(1e-5);
                let found = found / count as f64;
                assert!(
                    (found - wanted).abs() < 4.0 * deviation,
                    "depth {depth} {free_path:?}: {found} for {wanted}"
                );
            }
        }
    }
}

#[test]
fn photons_of_a_point_source_make_its_fluence() {
    // Albedo 0.9, extinction 1, a source of power 1 in the middle of a box of 16 free paths on each side.
    let edge = 32;
    let grid =
        Grid::from_dense(Vec3::splat(-15.5), 1.0, [edge; 3], &vec![1.0; (edge * edge * edge) as usize])
            .unwrap();
    let optics = Optics { extinction: [1.0; 3], albedo: [0.9; 3], phase: Phase::ISOTROPIC };
    let medium = Medium::new(grid, optics).unwrap();
    let intensity = 0.25 / std::f32::consts::PI;
    let lights = [Light::Point(Point::new(Vec3::ZERO, [intensity; 3]).unwrap())];
    let rows = [(0.5, 0.482_832_69), (1.0, 0.143_283_86), (2.0, 0.037_126_40), (4.0, 0.006_194_053)];
    for free_path in RIGHT {
        let photons = trace(&medium, &lights, &settings(40_000, free_path), &()).unwrap();
        for (distance, fluence) in rows {
            // A shell of a tenth of its radius on both sides; within it the fluence is near a power law.
            let (inner, outer) = (0.95 * distance, 1.05 * distance);
            let inside = photons.stored.iter().filter(|it| (inner..outer).contains(&it.position.length()));
            let power: f64 = inside.map(|it| f64::from(it.power.x)).sum();
            let volume = 4.0 / 3.0 * std::f64::consts::PI * f64::from(outer.powi(3) - inner.powi(3));
            let found = power / 0.9 / volume;
            assert!(
                (found / fluence - 1.0).abs() < 0.05,
                "{free_path:?} at {distance}: {found} for {fluence}"
            );
        }
        // Collisions of a photon: 1 / (1 - albedo).
        let mean = photons.interactions as f64 / photons.emitted as f64;
        assert!((mean - 10.0).abs() < 0.2, "{mean}");
    }
}

#[test]
fn what_is_emitted_leaves_or_is_absorbed() {
    for free_path in RIGHT {
        for albedo in [0.0, 0.6, 1.0] {
            let photons = trace(&plume(albedo), &lights(), &settings(5_000, free_path), &()).unwrap();
            let balance = photons.escaped_power + photons.absorbed_power;
            assert!((balance - photons.emitted_power).length() < 1e-9 * balance.length());
            assert_eq!(photons.absorbed_power.length() < 1e-9 * balance.length(), albedo == 1.0);
            assert!(photons.emitted.abs_diff(5_000) < 3);
            if albedo == 0.0 {
                assert!(photons.stored.iter().all(|it| it.power == Vec3::ZERO));
            }
        }
    }
}

#[test]
fn rgb_extinction_stores_the_power_that_each_color_alone_would_store() {
    let grid = plume(0.8).density().clone();
    let optics = Optics { extinction: [0.3, 0.1, 0.2], albedo: [0.8, 0.95, 0.5], phase: Phase::ISOTROPIC };
    let together = Medium::new(grid.clone(), optics).unwrap();
    let power = |medium: &Medium, free_path: FreePath| -> DVec3 {
        let photons = trace(medium, &lights(), &settings(60_000, free_path), &()).unwrap();
        photons.stored.iter().map(|it| it.power.as_dvec3()).sum()
    };
    for free_path in RIGHT {
        let found = power(&together, free_path);
        for channel in 0..3 {
            let (extinction, albedo) = ([optics.extinction[channel]; 3], [optics.albedo[channel]; 3]);
            let alone = Medium::new(grid.clone(), Optics { extinction, albedo, ..optics }).unwrap();
            let wanted = power(&alone, FreePath::Delta)[channel];
            let ratio = found[channel] / wanted;
            assert!((ratio - 1.0).abs() < 0.03, "{free_path:?}, channel {channel}: {ratio}");
        }
    }
}

#[test]
fn the_wrong_methods_store_too_few_and_too_many() {
    // As on the paper's slides: most photons fly through with the first density met, most stop at the rim when it is scaled up.
    let stored = |free_path: FreePath| {
        let lights = &lights()[..1];
        trace(&plume(0.8), lights, &settings(20_000, free_path), &()).unwrap().stored.len() as f64
    };
    let exact = stored(FreePath::Exact);
    assert!((stored(FreePath::Delta) / exact - 1.0).abs() < 0.03);
    assert!(stored(FreePath::Homogeneous) < 0.5 * exact, "{} of {exact}", stored(FreePath::Homogeneous));
    let scaled = FreePath::scaled(50.0, f32::INFINITY).unwrap();
    assert!(stored(scaled) > 1.2 * exact, "{} of {exact}", stored(scaled));
}

#[test]
fn the_first_scattering_is_left_out_on_demand() {
    let medium = plume(0.8);
    let all = trace(&medium, &lights(), &settings(3_000, FreePath::Delta), &()).unwrap();
    let multiple = Settings { stored: Stored::Multiple, ..settings(3_000, FreePath::Delta) };
    let later = trace(&medium, &lights(), &multiple, &()).unwrap();
    assert_eq!(all.interactions, later.interactions);
    assert_eq!(all.stored.len() as u64, all.interactions);
    assert!(later.stored.len() < all.stored.len() && later.stored.len() * 10 > all.stored.len());
    assert!(later.stored.iter().all(|photon| all.stored.contains(photon)));
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let medium = plume(0.8);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| trace(&medium, &lights(), &settings(10_000, FreePath::Delta), &()).unwrap())
    };
    let (one, three) = (with(1), with(3));
    assert_eq!(one.stored, three.stored);
    assert_eq!(one.escaped_power, three.escaped_power);
}

#[test]
fn degenerate_requests_are_defined() {
    let medium = plume(0.8);
    assert_eq!(trace(&medium, &lights(), &settings(0, FreePath::Delta), &()).unwrap_err().code(), "setting");
    assert_eq!(trace(&medium, &[], &settings(10, FreePath::Delta), &()).unwrap().emitted, 0);
    let black = [Light::Point(Point::new(Vec3::ZERO, [0.0; 3]).unwrap())];
    assert_eq!(trace(&medium, &black, &settings(10, FreePath::Delta), &()).unwrap().emitted, 0);
    let grid = Grid::from_dense(Vec3::ZERO, 1.0, [2; 3], &[0.0; 8]).unwrap();
    let empty = Medium::new(grid, *medium.optics()).unwrap();
    let photons = trace(&empty, &lights(), &settings(100, FreePath::Exact), &()).unwrap();
    assert!(photons.stored.is_empty() && photons.interactions == 0);

    struct Stop;
    impl Progress for Stop {
        fn begin(&self, _: &str, _: Option<u64>, _: &'static str) {}
        fn advance(&self, _: u64) {}
        fn cancelled(&self) -> bool {
            true
        }
    }
    let stopped = trace(&medium, &lights(), &settings(10_000, FreePath::Delta), &Stop);
    assert_eq!(stopped.unwrap_err().code(), "interrupted");
}

#[test]
fn photons_that_do_not_fit_say_what_would() {
    let medium = plume(0.9);
    let attempt = |memory_bytes| {
        let settings = Settings { memory_bytes, ..settings(100_000, FreePath::Delta) };
        trace(&medium, &lights(), &settings, &())
    };
    let all = attempt(None).unwrap();
    let needed = STORED_BYTES * all.stored.len() as u64;
    assert_eq!(attempt(Some(needed)).unwrap().stored, all.stored);
    let Err(Error::Memory { needed_bytes, available_bytes, hint, .. }) = attempt(Some(needed / 4)) else {
        panic!("a quarter of the memory is not enough");
    };
    assert_eq!(available_bytes, needed / 4);
    // Found from the photons followed until then, most of them of the first light.
    assert!((0.5..2.0).contains(&(needed_bytes as f64 / needed as f64)), "{needed_bytes} {needed}");
    assert!(hint.contains("--photons ") && hint.contains("--photon-passes"), "{hint}");
}
