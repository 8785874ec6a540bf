//! Samples until the noise is small enough: what is told against converged pictures.

use super::solids::some_spheres;
use super::*;
use crate::render::medium::refine::Goal;
use crate::render::medium::solids::Solids;
use crate::render::medium::{Backdrop, Showing};
use crate::render::refine::Quality;

const SIZE: [u32; 2] = [64, 32];
const SHOWING: Showing = Showing { backdrop: Backdrop::Nothing, exposure: 1.0 };

fn wide_view() -> View {
    let projection = Projection::Orthographic { height: 2.4 };
    let camera = Camera { eye: DVec3::new(0.5, 0.0, 5.0), look_at: DVec3::X * 0.5, up: DVec3::Y, projection };
    camera.view(DVec3::ZERO, SIZE[0], SIZE[1]).unwrap()
}

/// Root mean square difference of values as they are shown.
fn difference(one: &[Pixel], other: &[Pixel]) -> f32 {
    let shown = |pixel: &Pixel| pixel.scattered.clamp(Vec3::ZERO, Vec3::ONE).map(f32::sqrt);
    let squares = one.iter().zip(other).map(|(one, other)| (shown(one) - shown(other)).length_squared());
    (squares.sum::<f32>() / (3 * one.len()) as f32).sqrt()
}

/// The noise is below `wanted`, within a factor that of the picture against a converged one, and some parts need fewer samples.
fn check(name: &str, (quality, pixels): &(Quality, Vec<Pixel>), converged: &[Pixel], wanted: f32) {
    let found = difference(pixels, converged);
    println!("{name}: {found}, {quality:?}");
    assert!(quality.noise <= wanted && quality.samples[0] < quality.samples[1], "{name}: {quality:?}");
    assert!(found < 1.4 * quality.noise && found > 0.4 * quality.noise, "{name}: {found}, {quality:?}");
}

#[test]
fn the_noise_that_is_left_is_what_is_told() {
    let (medium, solids) = (lumps(grey(3.0, 0.9, 0.0)), some_spheres());
    let lights = [sun([2.0, 1.5, 1.0]), sky([0.1, 0.15, 0.2])];
    let bodies = Solids::new(&solids);
    let [width, height] = SIZE;
    let goal = |noise: f32| Goal { noise, samples: 1024, showing: SHOWING };

    let traced = |seed: u32, goal: &Goal| {
        let settings = reference::Settings { width, height, seed, orders: None, free_path: FreePath::Delta };
        let mut reference =
            Reference::new(&medium, &lights, wide_view(), settings).unwrap().with_solids(bodies);
        let quality = reference.refine(goal, &mut || false, &()).unwrap();
        (quality, reference.pixels())
    };
    let converged = traced(6, &Goal { samples: 48, ..goal(0.0) }).1;
    let refined = traced(7, &goal(0.005));
    check("path tracer", &refined, &converged, 0.005);
    assert_eq!(traced(7, &goal(0.005)), refined);

    let cache = Cache::around(&medium, &lights, Some(bodies), &Settings::default(), &()).unwrap();
    let marched = |seed: u32, goal: &Goal, is_late: &mut dyn FnMut() -> bool| {
        let settings = march::Settings { width, height, samples: 2, seed, step: 0.5 };
        let march = March::new(&medium, Illumination::Cached(&cache), &lights, wide_view(), settings);
        let mut march = march.unwrap().with_solids(bodies);
        let quality = march.refine(goal, is_late, &()).unwrap();
        (quality, march.pixels())
    };
    let converged = marched(6, &Goal { samples: 64, ..goal(0.0) }, &mut || false).1;
    check("march", &marched(7, &goal(0.004), &mut || false), &converged, 0.004);

    // The time ends it after any pass; what a round has not compared is not known.
    let mut passes = 0;
    let mut is_late = || {
        passes += 1;
        passes == 3
    };
    let (quality, pixels) = marched(7, &goal(0.0), &mut is_late);
    assert_eq!((quality.samples, quality.noise), ([3; 2], f32::INFINITY));
    assert_eq!(pixels, marched(7, &Goal { samples: 3, ..goal(0.0) }, &mut || false).1);
}
