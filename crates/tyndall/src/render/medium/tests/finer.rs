//! Media of which some bricks are parted into finer ones.

use super::*;
use crate::medium::density::{Resolution, Settings as Density, estimate};
use crate::medium::grid::Lattice;
use crate::particles::{Columns, Particles, Positions};

/// A dense ball in a thin one, on a lattice that is too coarse for it but where it is parted.
fn core_and_tail(optics: Optics, finer: u32) -> Medium {
    let mut stream = Stream::new(31, 4);
    let mut offsets: [Vec<f32>; 3] = Default::default();
    for k in 0..3000 {
        let (radius, center) = if k % 2 == 0 { (0.2, Vec3::new(0.45, -0.1, 0.0)) } else { (0.9, Vec3::ZERO) };
        let place = center + radius * stream.unit().cbrt() * stream.direction();
        (0..3).for_each(|axis| offsets[axis].push(place[axis]));
    }
    let positions = Positions::from_offsets(DVec3::ZERO, offsets);
    let particles = Particles::new(Columns { positions, ..Columns::default() }).unwrap();
    let lattice = Lattice { origin: Vec3::splat(-1.2), spacing: 0.16, size: [16; 3] };
    let (resolution, finer) = (Resolution::Lattice(lattice), Some(finer));
    let settings = Density { length: Some(0.4), resolution, finer, ..Density::default() };
    Medium::new(estimate(&particles, &settings, &()).unwrap().density, optics).unwrap()
}

#[test]
fn columns_are_integrals_of_the_finest_field() {
    let medium = core_and_tail(grey(1e-4, 0.5, 0.0), 2);
    assert!(medium.density().levels()[2] > 0, "{:?}", medium.density().levels());
    let tracker = Tracker::new(&medium);
    let mut stream = Stream::new(77, 0);
    for number in 0..30 {
        let target = Vec3::new(0.45, -0.1, 0.0) + 0.3 * stream.cube();
        let direction = if number < 6 { Vec3::AXES[number % 3] } else { stream.direction() };
        let ray = Ray { origin: target - 3.0 * direction, direction, t_min: 0.0, t_max: f32::INFINITY };
        let step = 6.0 / 4000.0;
        let point = |k: i32| target + (-3.0 + step * (k as f32 + 0.5)) * direction;
        let wanted = step * (0..4000).map(|k| medium.density().density(point(k))).sum::<f32>();
        let found = tracker.column(&ray);
        assert!((found / wanted - 1.0).abs() < 3e-3, "{direction}: {found} for {wanted}");
        // Distances are where the column says, and chances are right on average.
        let through = tracker.transmittance(&ray).x;
        let estimate: f32 =
            (0..400).map(|_| tracker.ratio_transmittance(&ray, &mut stream).x).sum::<f32>() / 400.0;
        assert!((estimate - through).abs() < 0.08, "{direction}: {estimate} for {through}");
    }
}

#[test]
fn finer_bricks_are_marched_as_they_are_traced() {
    let lights = [sun([3.0; 3]), sky([0.3; 3])];
    let [even, finer] = [0, 2].map(|levels| core_and_tail(grey(1e-4, 0.8, 0.0), levels));
    let tracker = Tracker::new(&finer);
    let pixels = cached(&finer, &lights, &Settings::default());
    let view = view(SMALL.width);
    let (mut marched, mut exact) = (0.0, 0.0);
    for (place, pixel) in pixels.iter().enumerate() {
        let ray = view.ray((place % 32) as f32 + 0.5, (place / 32) as f32 + 0.5);
        marched += 1.0 - pixel.transmittance.x;
        exact += 1.0 - tracker.transmittance(&ray).x;
    }
    assert!((marched / exact - 1.0).abs() < 0.02, "{marched} {exact}");
    let (found, wanted) = (mean(&pixels), reference(&finer, &lights, 24));
    assert!((found / wanted - 1.0).abs().max_element() < 0.06, "{found} {wanted}");
    let difference = |other: &[Pixel]| {
        let pairs = pixels.iter().zip(other);
        pairs.map(|(a, b)| (a.transmittance - b.transmittance).abs().x).fold(0.0, f32::max)
    };
    assert!(difference(&cached(&even, &lights, &Settings::default())) > 0.02, "finer bricks are seen");
}
