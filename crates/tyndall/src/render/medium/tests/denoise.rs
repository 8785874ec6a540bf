//! Pictures with less noise against converged ones.

use super::solids::{relative_error, some_spheres};
use super::*;
use crate::render::medium::solids::Solids;

/// A part of the box as a large picture of it shows it.
fn near_view(size: u32) -> View {
    let projection = Projection::Orthographic { height: 0.3 };
    let look_at = DVec3::new(0.25, 0.1, 0.0);
    let camera = Camera { eye: look_at + 5.0 * DVec3::Z, look_at, up: DVec3::Y, projection };
    camera.view(DVec3::ZERO, size, size).unwrap()
}

/// A picture with less noise has a third of the relMSE, and is as bright.
fn check(name: &str, noisy: &[Pixel], denoised: &[Pixel], converged: &[Pixel]) {
    let [before, after] = [noisy, denoised].map(|it| relative_error(it, converged));
    let bias = mean(denoised) / mean(noisy) - 1.0;
    println!(
        "{name}: relMSE {before:.2e} and {after:.2e}, {:.1} times less; mean off by {bias}",
        before / after
    );
    assert!(before > 3.0 * after, "{name}: {before} {after}");
    assert!(bias.abs().max_element() < 5e-3, "{name}: {bias}");
}

#[test]
fn a_picture_with_less_noise_is_nearer_to_a_converged_one() {
    let solids = some_spheres();
    let bodies = Solids::new(&solids);
    let lights = [sun([4.0, 3.0, 2.0]), sky([0.3, 0.4, 0.6])];
    let medium = lumps(grey(3.0, 0.9, 0.0));
    let size = 32;

    for bodies in [None, Some(bodies)] {
        let traced = |seed: u32, samples: u32| {
            let settings = reference::Settings {
                width: size,
                height: size,
                seed,
                orders: None,
                free_path: FreePath::Delta,
            };
            let mut reference =
                Reference::new(&medium, &lights, near_view(size), settings).unwrap().with_halves();
            if let Some(bodies) = bodies {
                reference = reference.with_solids(bodies);
            }
            reference.pass(samples, &()).unwrap();
            reference
        };
        let converged = traced(6, 96).pixels();
        let noisy = traced(7, 8);
        let name = format!("path tracer, spheres: {}", bodies.is_some());
        check(&name, &noisy.pixels(), &noisy.denoised().unwrap(), &converged);
        // Marched, matter alone has hardly any noise.
        let Some(bodies) = bodies else { continue };

        let cache = Cache::around(&medium, &lights, Some(bodies), &Settings::default(), &()).unwrap();
        let marched = |seed: u32, samples: u32| {
            let settings = march::Settings { width: size, height: size, samples, seed, step: 2.0 };
            let view = near_view(size);
            let march = March::new(&medium, Illumination::Cached(&cache), &lights, view, settings);
            let mut march = march.unwrap().with_solids(bodies).with_halves();
            while !march.is_done() {
                march.pass(&()).unwrap();
            }
            march
        };
        let noisy = marched(7, 8);
        check("march", &noisy.pixels(), &noisy.denoised().unwrap(), &marched(6, 96).pixels());
        assert!(marched(7, 1).denoised().is_none(), "one sample tells no noise");
    }
}
