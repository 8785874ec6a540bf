//! Columns against the cell formula and quadrature, distances against their distributions. Numbers from
//! `bench/volume/analytic.json`, which `analytic.py` beside it made with mpmath: sections `slab_transmittance`,
//! `trilinear_cell`, `free_path`.

use super::*;
use crate::medium::{Grid, Optics, Phase};
use crate::render::medium::regular::Crossing;

fn medium(grid: Grid, extinction: [f32; 3]) -> Medium {
    Medium::new(grid, Optics { extinction, albedo: [0.9; 3], phase: Phase::ISOTROPIC }).unwrap()
}

fn ray(origin: Vec3, direction: Vec3, t_max: f32) -> Ray {
    Ray { origin, direction, t_min: 0.0, t_max }
}

/// A field along x from 0 to `(count - 1) * spacing`, thin in y and z, and the ray from x = 0 through it.
fn along_x(spacing: f32, count: u32, field: impl Fn(f32) -> f32) -> (Medium, Ray) {
    let values: Vec<f32> = (0..count).map(|i| field(i as f32 * spacing)).collect();
    let grid = Grid::from_dense(Vec3::ZERO, spacing, [count, 1, 1], &values).unwrap();
    (medium(grid, [1.0; 3]), ray(Vec3::ZERO, Vec3::X, f32::INFINITY))
}

/// Random samples, a third of the lattice empty.
fn random_grid(stream: &mut Stream) -> Grid {
    let size: [u32; 3] = std::array::from_fn(|_| 1 + stream.below(21) as u32);
    let count = size.iter().product::<u32>();
    let values: Vec<f32> =
        (0..count).map(|place| if place < count / 3 { 0.0 } else { stream.range(0.0, 3.0) }).collect();
    Grid::from_dense(stream.normal3(), stream.range(0.2, 1.5), size, &values).unwrap()
}

#[test]
fn a_slab_lets_through_what_beer_and_lambert_say() {
    for (extinction, thickness, cosine, wanted) in [
        (1.0, 1.0, 1.0, 0.367_879_44),
        (0.5, 4.0, 0.5, 0.018_315_64),
        (8.0, 2.0, 0.8, 2.061_153_6e-9),
        (0.05, 20.0, 1.0, 0.367_879_44),
    ] {
        let grid = Grid::from_dense(Vec3::ZERO, thickness, [9, 9, 1], &[1.0; 81]).unwrap();
        let medium = medium(grid, [extinction; 3]);
        let tracker = Tracker::new(&medium);
        let sine = f32::sqrt(1.0 - cosine * cosine);
        let above = Vec3::new(2.0 * thickness, 4.0 * thickness, -10.0 * thickness);
        // Aimed so that it goes through the slab's faces, not its sides.
        let origin = above - Vec3::X * (9.5 * thickness * sine / cosine) + Vec3::X * thickness;
        let ray = ray(origin, Vec3::new(sine, 0.0, cosine), f32::INFINITY);
        let found = tracker.transmittance(&ray).x;
        assert!((found / wanted - 1.0).abs() < 2e-5, "{found} for {wanted}");
        // A constant density is all control: the estimate has no noise.
        let estimate = tracker.ratio_transmittance(&ray, &mut Stream::new(1, 1)).x;
        assert!((estimate / wanted - 1.0).abs() < 2e-5, "{estimate} for {wanted}");
    }
}

#[test]
fn one_cell_is_integrated_and_solved_exactly() {
    let values = [0.2, 1.7, 0.0, 2.3, 3.1, 0.4, 1.1, 5.0];
    let grid = Grid::from_dense(Vec3::ZERO, 1.0, [2, 2, 2], &values).unwrap();
    let medium = medium(grid, [1.0; 3]);
    let tracker = Tracker::new(&medium);
    // From, to, optical depth, distances at five quantiles; none where light leaves before.
    let none = f64::INFINITY;
    let cases = [
        (
            Vec3::ZERO,
            Vec3::ONE,
            3.492_969_128_597_236,
            [0.141_973_912_2, 0.443_607_316_8, 0.760_898_500_7, 1.126_063_871_3, 1.625_595_195_1],
        ),
        (
            Vec3::new(0.1, 0.9, 0.0),
            Vec3::new(0.8, 0.2, 1.0),
            2.017_113_297_512_066,
            [0.132_512_278_7, 0.411_416_661_2, 0.694_793_931_9, 1.065_170_062_7, none],
        ),
        (
            Vec3::new(1.0, 0.25, 0.5),
            Vec3::new(0.0, 0.25, 0.5),
            1.5375,
            [0.030_260_053_5, 0.172_054_420_6, 0.424_999_195_2, 0.891_425_441_3, none],
        ),
    ];
    for (from, to, depth, distances) in cases {
        let length = from.distance(to);
        let ray = ray(from, (to - from) / length, length);
        assert!((f64::from(tracker.column(&ray)) / depth - 1.0).abs() < 1e-6);
        let path = Path::new(&medium, &ray).unwrap();
        for (xi, wanted) in [0.05, 0.25, 0.5, 0.75, 0.95_f64].into_iter().zip(distances) {
            match tracker.advance(&path, -(1.0 - xi).ln() as f32) {
                Reached::At { distance } => {
                    assert!((f64::from(distance) - wanted).abs() < 2e-6, "{distance} {wanted}")
                }
                Reached::End { .. } => assert_eq!(wanted, none),
            }
        }
    }
}

#[test]
fn columns_agree_with_fine_sums_on_any_ray() {
    for seed in 0..40 {
        let mut stream = Stream::new(61, seed);
        let grid = random_grid(&mut stream);
        let (bounds, size) = (grid.bounds(), grid.bounds().extent());
        let medium = medium(grid, [1.0; 3]);
        let tracker = Tracker::new(&medium);
        for kind in 0..6 {
            let inside = bounds.min + size * Vec3::new(stream.unit(), stream.unit(), stream.unit());
            let direction = match kind {
                0 => Vec3::X,
                1 => Vec3::NEG_Y,
                2 => -Vec3::Z,
                3 => (Vec3::X - Vec3::Y).normalize(),
                _ => stream.direction(),
            };
            // From outside, or from a point of the medium.
            let back = if kind == 5 { 0.0 } else { 2.0 * size.length() };
            let length = back + stream.unit() * size.length();
            let ray = ray(inside - back * direction, direction, length);
            let steps = 20_000;
            let at = |step: i32| ray.origin + ray.direction * ((step as f32 + 0.5) * length / steps as f32);
            let sum: f64 = (0..steps).map(|step| f64::from(medium.density().density(at(step)))).sum();
            let (wanted, found) =
                (sum * f64::from(length) / f64::from(steps), f64::from(tracker.column(&ray)));
            assert!(
                (found - wanted).abs() < 2e-3 * (1.0 + wanted),
                "seed {seed} kind {kind}: {found} for {wanted}"
            );
            // Following the path to half of its column ends where the column is half.
            if found > 0.01 {
                let path = Path::new(&medium, &ray).unwrap();
                let Reached::At { distance } = tracker.advance(&path, 0.5 * found as f32) else {
                    panic!("seed {seed}: half is not reached")
                };
                let half = tracker.column(&Ray { t_max: path.enter + distance, ..ray });
                assert!((f64::from(half) / found - 0.5).abs() < 1e-4, "seed {seed}: {half} of {found}");
            }
        }
    }
}

/// A medium with a distribution of distances in closed form.
struct Law {
    medium: Medium,
    ray: Ray,
    distribution: fn(f64) -> f64,
    escape: f64,
}

fn laws() -> Vec<Law> {
    let (ramp, ray) = along_x(0.5, 12, |s| 2.0 * s);
    let (exponential, _) = along_x(0.005, 2400, |s| 3.0 * (-s / 0.5).exp());
    let (gaussian, _) = along_x(0.005, 800, |s| 4.0 * (-(s - 1.0) * (s - 1.0) / 0.18).exp());
    /// The error function to 1.2e-7: W. Press et al., "Numerical recipes", 2nd ed., 1992, section 6.2 (`erfcc`).
    fn erf(x: f64) -> f64 {
        let t = 1.0 / (1.0 + 0.5 * x.abs());
        let terms = [
            -1.26551223,
            1.00002368,
            0.37409196,
            0.09678418,
            -0.18628806,
            0.27886807,
            -1.13520398,
            1.48851587,
            -0.82215223,
            0.17087277,
        ];
        let sum = terms.iter().rev().fold(0.0, |sum, term| sum * t + term);
        (1.0 - t * (-x * x + sum).exp()).copysign(x)
    }
    vec![
        Law { medium: ramp, ray, distribution: |s| 1.0 - (-s * s).exp(), escape: 0.0 },
        Law {
            medium: exponential,
            ray,
            distribution: |s| 1.0 - (-1.5 * (1.0 - (-2.0 * s).exp())).exp(),
            escape: 0.223_130_16,
        },
        Law {
            medium: gaussian,
            ray,
            distribution: |s| {
                let scale = 4.0 * 0.3 * (std::f64::consts::PI / 2.0).sqrt();
                let to = |s: f64| erf((s - 1.0) / (0.3 * std::f64::consts::SQRT_2));
                1.0 - (-scale * (to(s) - to(0.0))).exp()
            },
            escape: 0.049_456_423,
        },
    ]
}

/// Whether distances follow `law`: the count that leaves within four standard deviations, the others by Kolmogorov and
/// Smirnov's test at the 1 % level.
fn follows(law: &Law, free_path: FreePath) -> bool {
    let tracker = Tracker::new(&law.medium);
    let mut stream = Stream::new(71, 0);
    let count = 20_000;
    let mut throughput = Vec3::ONE;
    let mut distances: Vec<f32> =
        (0..count).filter_map(|_| tracker.next(free_path, &law.ray, &mut throughput, &mut stream)).collect();
    assert_eq!(throughput, Vec3::ONE);
    let escaped = f64::from(count) - distances.len() as f64;
    let p = law.escape;
    if (escaped - f64::from(count) * p).abs() > 4.0 * (f64::from(count) * p * (1.0 - p)).sqrt() {
        return false;
    }
    distances.sort_by(f32::total_cmp);
    let met = distances.len() as f64;
    let farthest = distances.iter().enumerate().map(|(rank, &s)| {
        ((law.distribution)(f64::from(s)) / (1.0 - p) - (rank as f64 + 0.5) / met).abs() + 0.5 / met
    });
    farthest.fold(0.0, f64::max) < 1.628 / met.sqrt()
}

#[test]
fn exact_and_delta_distances_follow_the_law_and_the_wrong_ones_do_not() {
    let wrong = [
        FreePath::Homogeneous,
        FreePath::scaled(50.0, f32::INFINITY).unwrap(),
        FreePath::scaled(1.0, 0.3).unwrap(),
    ];
    for (number, law) in laws().iter().enumerate() {
        assert!(follows(law, FreePath::Exact), "exact, law {number}");
        assert!(follows(law, FreePath::Delta), "delta, law {number}");
        for free_path in wrong {
            assert!(!follows(law, free_path), "{free_path:?}, law {number}");
        }
    }
}

#[test]
fn the_homogeneous_method_is_wrong_as_the_paper_says() {
    // Beyond s = 2 of the exponential medium: exp(-6) by the wrong method, 0.2293 in truth.
    let law = &laws()[1];
    let tracker = Tracker::new(&law.medium);
    let mut stream = Stream::new(72, 0);
    let count = 40_000;
    let beyond = |free_path: FreePath, stream: &mut Stream| {
        let far = (0..count).filter(|_| {
            let distance = tracker.next(free_path, &law.ray, &mut Vec3::ONE.clone(), stream);
            distance.is_none_or(|distance| distance > 2.0)
        });
        far.count() as f64 / f64::from(count)
    };
    for (free_path, wanted) in [
        (FreePath::Homogeneous, 0.002_478_75),
        (FreePath::Exact, 0.229_345_3),
        (FreePath::Delta, 0.229_345_3),
    ] {
        let found = beyond(free_path, &mut stream);
        let deviation = (wanted * (1.0 - wanted) / f64::from(count)).sqrt();
        assert!((found - wanted).abs() < 4.0 * deviation, "{free_path:?}: {found} for {wanted}");
    }
}

#[test]
fn weights_of_rgb_extinction_are_right_on_average() {
    for seed in 0..6 {
        let mut stream = Stream::new(81, seed);
        let grid = random_grid(&mut stream);
        let (bounds, extent) = (grid.bounds(), grid.bounds().extent());
        let scale = 3.0 / (extent.length() * grid.max());
        let medium = medium(grid, [scale, 0.4 * scale, 0.0]);
        let tracker = Tracker::new(&medium);
        let direction = stream.direction();
        let ray = ray(bounds.center() - extent.length() * direction, direction, f32::INFINITY);
        let through = tracker.transmittance(&ray);
        let half_way = extent.length();
        let column = tracker.column(&Ray { t_max: half_way, ..ray });
        let before_half = Vec3::ONE - tracker.through(column);
        let count = 40_000;
        for free_path in [FreePath::Exact, FreePath::Delta] {
            let (mut escaped, mut near) = (Vec3::ZERO, Vec3::ZERO);
            for _ in 0..count {
                let mut throughput = Vec3::ONE;
                match tracker.next(free_path, &ray, &mut throughput, &mut stream) {
                    None => escaped += throughput / count as f32,
                    Some(distance) if distance < half_way => near += throughput / count as f32,
                    Some(_) => (),
                }
            }
            assert!(escaped.abs_diff_eq(through, 0.02), "seed {seed} {free_path:?}: {escaped} {through}");
            assert!(near.abs_diff_eq(before_half, 0.02), "seed {seed} {free_path:?}: {near} {before_half}");
        }
        let mut near = Vec3::ZERO;
        let mut crossing = Crossing::default();
        tracker.cross(&ray, &mut crossing);
        for _ in 0..count {
            let (distance, weight) = tracker.forced(&crossing, [stream.unit(), stream.unit()]);
            near += if distance < half_way { weight / count as f32 } else { Vec3::ZERO };
        }
        assert!(near.abs_diff_eq(before_half, 0.02), "seed {seed} forced: {near} {before_half}");
    }
}

#[test]
fn estimated_transmittance_is_right_on_average() {
    for seed in 0..6 {
        let mut stream = Stream::new(82, seed);
        let grid = random_grid(&mut stream);
        let (bounds, extent) = (grid.bounds(), grid.bounds().extent());
        let scale = 3.0 / (extent.length() * grid.max());
        let medium = medium(grid, [scale, 0.3 * scale, 0.8 * scale]);
        let tracker = Tracker::new(&medium);
        let ray = ray(bounds.center(), stream.direction(), f32::INFINITY);
        let wanted = tracker.transmittance(&ray);
        let count = 40_000;
        let sum: Vec3 = (0..count).map(|_| tracker.ratio_transmittance(&ray, &mut stream)).sum();
        let found = sum / count as f32;
        assert!(found.abs_diff_eq(wanted, 0.01), "seed {seed}: {found} for {wanted}");
    }
}

#[test]
fn emptiness_is_flown_through() {
    let grid = Grid::from_dense(Vec3::ZERO, 1.0, [4, 4, 4], &[0.0; 64]).unwrap();
    let empty = medium(grid, [1.0; 3]);
    let clear = medium(Grid::from_dense(Vec3::ZERO, 1.0, [4, 4, 4], &[1.0; 64]).unwrap(), [0.0; 3]);
    let ray = ray(Vec3::new(1.0, 1.5, -9.0), Vec3::Z, f32::INFINITY);
    for medium in [&empty, &clear] {
        let tracker = Tracker::new(medium);
        let mut stream = Stream::new(1, 2);
        for name in FreePath::NAMES {
            let free_path: FreePath = name.parse().unwrap();
            assert_eq!(free_path.name(), name);
            assert_eq!(tracker.next(free_path, &ray, &mut Vec3::ONE.clone(), &mut stream), None, "{name}");
        }
        assert_eq!(tracker.transmittance(&ray), Vec3::ONE);
        assert_eq!(tracker.ratio_transmittance(&ray, &mut stream), Vec3::ONE);
    }
}

#[test]
fn unknown_and_impossible_methods_are_refused() {
    assert_eq!("wrong".parse::<FreePath>().unwrap_err().code(), "setting");
    assert!(FreePath::scaled(0.0, 1.0).is_err() && FreePath::scaled(f32::NAN, 1.0).is_err());
    assert!(FreePath::scaled(1.0, 0.0).is_err() && FreePath::scaled(1.0, f32::NAN).is_err());
    assert!(FreePath::scaled(50.0, f32::INFINITY).is_ok());
}
