//! Glowing media against closed forms, and the cache and photons against the reference.

use super::*;
use crate::medium::Emission;

/// Lumps that glow in a color that changes from place to place.
fn glowing_lumps(optics: Optics) -> Medium {
    let medium = lumps(optics);
    let emission = Emission::of(medium.density(), |[i, j, k]| {
        let [x, y, z] = [i, j, k].map(|it| it as f32 / 23.0);
        [4.0 * x * x, y + 0.2 * z, 0.5 * (1.0 - x)]
    });
    medium.with_emission(emission).unwrap()
}

/// The brightness of the middle pixels of a picture of the path tracer.
fn traced(medium: &Medium, lights: &[Light], samples: u32) -> Vec<Pixel> {
    let free_path = FreePath::Delta;
    let settings = reference::Settings { width: 32, height: 32, seed: 6, orders: None, free_path };
    let mut reference = Reference::new(medium, lights, view(32), settings).unwrap();
    reference.pass(samples, &()).unwrap();
    reference.pixels()
}

const MIDDLE: usize = 16 * 32 + 16;

#[test]
fn an_isothermal_slab_has_its_closed_form() {
    let glow = Vec3::new(2.0, 1.0, 0.25);
    for extinction in [0.05, 0.7, 4.0] {
        let medium = cube(extinction, 0.0, 0.0).with_emission(Emission::even(glow.to_array()).unwrap());
        let medium = medium.unwrap();
        let wanted = (1.0 - (-2.0 * extinction).exp()) * glow;
        let marched = cached(&medium, &[], &Settings::default())[MIDDLE];
        assert!((marched.scattered / wanted - 1.0).abs().max_element() < 2e-3, "{extinction}: {marched:?}");
        // Without scattering a path is its first collision: nothing is left to chance.
        let traced = traced(&medium, &[], 1)[MIDDLE];
        assert!((traced.scattered / wanted - 1.0).abs().max_element() < 1e-4, "{extinction}: {traced:?}");
    }
}

#[test]
fn light_that_is_only_added_is_thickness_times_radiance() {
    let even = Emission::even([2.0, 1.0, 0.5]).unwrap().additive();
    let medium = cube(3.0, 0.0, 0.0).with_emission(even.clone()).unwrap();
    let wanted = 3.0 * 2.0 * Vec3::new(2.0, 1.0, 0.5);
    let marched = cached(&medium, &[sky([0.5; 3])], &Settings::default())[MIDDLE];
    let traced_middle = traced(&medium, &[sky([0.5; 3])], 1)[MIDDLE];
    assert!((marched.scattered / wanted - 1.0).abs().max_element() < 2e-3, "{marched:?}");
    assert!((traced_middle.scattered / wanted - 1.0).abs().max_element() < 1e-4, "{traced_middle:?}");
    assert_eq!((marched.transmittance, marched.environment), (Vec3::ONE, Vec3::splat(0.5)));
    assert_eq!(traced_middle.transmittance, Vec3::ONE);

    let optics = Optics { extinction: [1.0, 2.0, 3.0], albedo: [0.0; 3], phase: Phase::ISOTROPIC };
    let field = glowing_lumps(optics);
    let field = field.clone().with_emission(field.emission().unwrap().clone().additive()).unwrap();
    let found = mean(&cached(&field, &[], &Settings::default()));
    let wanted = mean(&traced(&field, &[], 4));
    assert!((found / wanted - 1.0).abs().max_element() < 0.01, "{found} {wanted}");
    assert!(cube(3.0, 0.5, 0.0).with_emission(even).is_err(), "what scatters cannot only add");
}

#[test]
fn a_medium_as_bright_as_the_sky_is_invisible() {
    for (albedo, g) in [(0.7, 0.0), (0.3, 0.6)] {
        let medium = lumps(grey(5.0, albedo, g)).with_emission(Emission::even([1.0; 3]).unwrap()).unwrap();
        for pixel in cached(&medium, &[sky([1.0; 3])], &Settings::default()) {
            let light = pixel.scattered.x + pixel.environment.x;
            assert!((light - 1.0).abs() < 0.01, "albedo {albedo}, g {g}: {light}");
        }
        let pixels = traced(&medium, &[sky([1.0; 3])], 8);
        let mean = pixels.iter().map(|it| it.scattered.x + it.environment.x).sum::<f32>() / 1024.0;
        assert!((mean - 1.0).abs() < 0.01, "albedo {albedo}, g {g}: {mean}");
    }
}

#[test]
fn glowing_matter_lights_itself_as_the_reference_says() {
    let optics = Optics { extinction: [4.0, 5.0, 8.0], albedo: [0.9, 0.8, 0.7], phase: Phase::ISOTROPIC };
    let medium = glowing_lumps(optics);
    let wanted = reference(&medium, &[], 32);
    let found = |multiple| {
        let settings = Settings { multiple, directions: 32, ..Settings::default() };
        mean(&cached(&medium, &[], &settings))
    };
    // A ball much smaller than a lump: in a larger one the middle of the lump counts at its edge, too.
    let photons = Multiple::Photons(photon_settings(40_000), Radius::Fixed(0.07), 1);
    for multiple in [Multiple::Sweeps, photons] {
        let found = found(multiple);
        let error = (found / wanted - 1.0).abs().max_element();
        assert!(error < 0.04, "{multiple:?}: {found} {wanted}");
    }
    // The comparison would see further scatterings missing.
    assert!((found(Multiple::None) / wanted - 1.0).abs().max_element() > 0.08);
}

#[test]
fn light_beside_a_flame_is_not_below_zero() {
    // A small flame at one side of smoke that throws light mostly on.
    let medium = cube(3.0, 0.9, 0.7);
    let emission = Emission::of(medium.density(), |[i, j, k]| match [i, j, k] {
        [2..4, 7..9, 7..9] => [1000.0, 1.0, 0.0],
        _ => [0.0; 3],
    });
    let medium = medium.with_emission(emission).unwrap();
    let cache = Cache::new(&medium, &[], &Settings::default(), &()).unwrap();
    let mut stream = Stream::new(81, 0);
    for _ in 0..4000 {
        let (at, direction) = (0.9 * stream.cube(), stream.direction());
        let light = cache.scattered(at, direction);
        assert!(light.cmpge(Vec3::ZERO).all(), "{at} {direction}: {light}");
    }
}

#[test]
fn photons_of_matter_carry_its_power() {
    let medium = glowing_lumps(grey(6.0, 0.8, 0.0));
    let photons = photons::trace(&medium, &[], &photon_settings(40_000), &()).unwrap();
    let spacing = f64::from(medium.density().spacing());
    let mut power = glam::DVec3::ZERO;
    for place in 0..24_u32.pow(3) {
        let at = [place % 24, place / 24 % 24, place / 576];
        let density = medium.density().value(at[0], at[1], at[2]);
        let radiance = medium.emission().unwrap().sample(at);
        power += f64::from(density) * radiance.as_dvec3();
    }
    let wanted = power * 4.0 * std::f64::consts::PI * 6.0 * 0.2 * spacing.powi(3);
    let error = (photons.emitted_power / wanted - 1.0).abs().max_element();
    assert!(error < 0.03, "{} {wanted}", photons.emitted_power);
    let rest = photons.escaped_power + photons.absorbed_power - photons.emitted_power;
    assert!(rest.abs().max_element() < 1e-3 * power.max_element(), "{rest}");
}
