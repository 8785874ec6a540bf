//! Media of which some bricks are parted into finer ones.

use glam::Vec3A;

use super::super::cache::Lit;
use super::*;
use crate::medium::density::{Resolution, Settings as Density, estimate};
use crate::medium::grid::Lattice;
use crate::particles::{Columns, Particles, Positions};

/// Light that is found quickly.
const COARSE: Settings = Settings {
    spacing: Some(0.16),
    diffuse_spacing: Some(0.32),
    anchor: None,
    directions: 64,
    multiple: Multiple::Sweeps,
    photon_noise: None,
};

/// A dense ball in a thin one, on a lattice that is too coarse for it but where it is parted.
fn core_and_tail(optics: Optics, finer: u32) -> Medium {
    let lattice = Lattice { origin: Vec3::splat(-1.2), spacing: 0.16, size: [16; 3] };
    on_lattice(optics, lattice, finer)
}

/// The same with the spacing of twice parted bricks everywhere.
fn finely(optics: Optics) -> Medium {
    on_lattice(optics, Lattice { origin: Vec3::splat(-1.2), spacing: 0.04, size: [61; 3] }, 0)
}

fn on_lattice(optics: Optics, lattice: Lattice, finer: u32) -> Medium {
    let mut stream = Stream::new(31, 4);
    let mut offsets: [Vec<f32>; 3] = Default::default();
    for k in 0..3000 {
        let (radius, center) = if k % 2 == 0 { (0.2, Vec3::new(0.45, -0.1, 0.0)) } else { (0.9, Vec3::ZERO) };
        let place = center + radius * stream.unit().cbrt() * stream.direction();
        (0..3).for_each(|axis| offsets[axis].push(place[axis]));
    }
    let positions = Positions::from_offsets(DVec3::ZERO, offsets);
    let particles = Particles::new(Columns { positions, ..Columns::default() }).unwrap();
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

#[test]
fn packets_go_through_finer_bricks_as_single_rays_do() {
    let colored = Optics { extinction: [3e-4, 7e-4, 2e-3], albedo: [0.9, 0.8, 0.7], ..grey(0.0, 0.0, 0.3) };
    let inside = Projection::Perspective { vertical_angle: 1.2 };
    let views = [
        (DVec3::new(0.0, 0.0, 5.0), Projection::Orthographic { height: 2.4 }),
        (DVec3::new(0.5, -0.1, 0.2), inside),
        (DVec3::new(-2.0, 1.0, 0.0), inside),
    ];
    for medium in [core_and_tail(grey(4e-4, 0.9, 0.0), 3), core_and_tail(colored, 2)] {
        let lights = [sun([PI, 2.0, 1.0]), sky([0.3; 3])];
        let cache = Cache::new(&medium, &lights, &COARSE, &()).unwrap();
        for ((eye, projection), step) in views.into_iter().zip([1.3, 2.0, 7.0]) {
            let camera = Camera { eye, look_at: DVec3::ZERO, up: DVec3::Y, projection };
            let view = camera.view(DVec3::ZERO, 21, 9).unwrap();
            let settings = march::Settings { width: 21, height: 9, samples: 2, seed: 9, step };
            let march =
                || March::new(&medium, Illumination::Cached(&cache), &lights, view, settings).unwrap();
            let [mut packets, mut rays] = [march(), march()];
            for _ in 0..2 {
                packets.pass(&()).unwrap();
                rays.pass_by_rays();
            }
            let (packets, rays) = (packets.pixels(), rays.pixels());
            assert_eq!(packets.iter().zip(&rays).filter(|(a, b)| a != b).count(), 0, "eye {eye}");
            assert!(rays.iter().any(|pixel| pixel.scattered.x > 0.0));
        }
    }
}

/// Root mean square of the differences of what comes through.
fn difference(a: &[Pixel], b: &[Pixel]) -> f32 {
    let sum: f32 = a.iter().zip(b).map(|(a, b)| (a.transmittance.x - b.transmittance.x).powi(2)).sum();
    (sum / a.len() as f32).sqrt()
}

#[test]
fn steps_in_finer_bricks_are_as_short_as_on_a_finer_lattice() {
    let optics = grey(1e-3, 0.8, 0.0);
    let (fine, finer) = (finely(optics), core_and_tail(optics, 2));
    let lights = [sun([3.0; 3])];
    let settings =
        NoiseSettings { position: 0.3, octaves: 2, scale: 0.2, detail: 0.0, ..NoiseSettings::default() };
    let noise = Noise::new(settings).unwrap();
    // With a sample a pixel, whose points are the middles of steps.
    let picture = |medium: &Medium, kind: usize, step: f32| {
        let settings = march::Settings { width: 16, height: 16, samples: 1, step, ..SMALL };
        let cache = Cache::new(medium, &lights, &COARSE, &()).unwrap();
        let traced = photons::trace(medium, &lights, &photon_settings(200), &()).unwrap();
        let map = PhotonMap::new(medium, &traced, Radius::Automatic).unwrap();
        let brute = BruteForce::new(medium, &lights, map);
        let light = if kind == 2 { Illumination::BruteForce(&brute) } else { Illumination::Cached(&cache) };
        let mut march = March::new(medium, light, &lights, view(16), settings).unwrap();
        if kind == 1 {
            march = march.with_noise(&noise);
        }
        march.pass(&()).unwrap();
        march.pixels()
    };
    for kind in 0..3 {
        let error = |medium: &Medium, step: f32| {
            difference(&picture(medium, kind, step), &picture(medium, kind, 0.25 * step))
        };
        let [found, on_fine, coarse] = [error(&finer, 2.0), error(&fine, 2.0), error(&fine, 8.0)];
        println!("{kind} {found} {on_fine} {coarse}");
        assert!(found < 0.2 * coarse, "{kind}: {found}, {on_fine} and {coarse} on a finer lattice");
    }
}

#[test]
fn light_in_finer_bricks_is_as_close_as_the_cache_and_continuous() {
    let medium = core_and_tail(grey(2e-3, 0.5, 0.0), 2);
    let grid = medium.density();
    let lights = [sun([3.0; 3])];
    let find = |spacing: Option<f32>| {
        let settings = Settings { spacing, multiple: Multiple::None, ..Settings::default() };
        Cache::new(&medium, &lights, &settings, &()).unwrap()
    };
    let (close, wide) = (find(None), find(Some(grid.spacing())));
    let view = view(SMALL.width);
    let [close_lit, wide_lit] = [&close, &wide].map(|it| it.seen(&medium, &view));
    let (Lit::Grey(bricks, _), Lit::Grey(wide_bricks, _)) = (&*close_lit, &*wide_lit) else { panic!() };
    let mut stream = Stream::new(78, 0);
    let (mut errors, mut count) = ([0.0; 2], 0);
    let place = |at: Vec3| Vec3A::from((at - grid.origin()) / grid.spacing());
    for _ in 0..4000 {
        let at = Vec3::new(0.45, -0.1, 0.0) + 0.25 * stream.cube();
        let brick = grid.cell_point(at).unwrap().cell.map(|it| it / 8);
        let (density, light) = bricks.at(place(at));
        if grid.level(brick) < 2 || density == 0.0 {
            continue;
        }
        let wanted = close.scattered(at, Vec3::Z).x;
        let (_, wide) = wide_bricks.at(place(at));
        errors.iter_mut().zip([light, wide]).for_each(|(sum, it)| *sum += (it - wanted).abs());
        count += 1;
    }
    assert!(count > 300 && errors[0] < 0.3 * errors[1], "{errors:?} {count}");
    // From both sides of sides of bricks.
    let mut sides = Vec::new();
    for _ in 0..4000 {
        let mut at = Vec3::new(0.3, -0.1, 0.0) + 0.6 * stream.cube();
        let axis = stream.below(3);
        let side = (place(at)[axis] / 8.0).round() * 8.0;
        at[axis] = grid.origin()[axis] + grid.spacing() * side;
        let aside = 1e-4 * grid.spacing() * Vec3::AXES[axis];
        let [(before, a), (after, b)] = [-1.0, 1.0].map(|way| bricks.at(place(at + way * aside)));
        if before > 0.0 && after > 0.0 {
            sides.push((at, a, b));
        }
    }
    assert!(sides.len() > 1000, "{}", sides.len());
    // Deep in shadow rounded places tell more than light does.
    let brightest = sides.iter().fold(0.0, |most, (_, a, _)| a.max(most));
    for (at, a, b) in sides {
        assert!((a - b).abs() < 2e-3 * (a + b) + 1e-4 * brightest, "{at}: {a} {b} of {brightest}");
    }
}
