//! The formulas against simulation, the exact binomial, quadrature, and counting.

use glam::{DVec3, Vec3};

use super::accumulate::{Accumulator, Estimate, covered, expected_unique};
use super::grid::DensityGrid;
use super::histogram::Histogram;
use super::{Interpolation, Population, footprint};
use crate::particles::Radii;
use crate::random::Stream;
use crate::scene::camera::{Camera, Projection, View};
use crate::structure::{Kind, Structure};
use crate::synthetic;

#[test]
fn different_particles_are_as_many_as_drawing_with_replacement_finds() {
    for population in [1_u32, 2, 7, 50, 400] {
        for samples in [1_u32, 2, 10, 60, 500] {
            let trials = 400;
            let mut stream = Stream::new(11, u64::from(population * 1000 + samples));
            let mut sum = 0;
            for _ in 0..trials {
                let mut seen = vec![false; population as usize];
                for _ in 0..samples {
                    seen[(stream.unit_f64() * f64::from(population)) as usize] = true;
                }
                sum += seen.iter().filter(|&&seen| seen).count();
            }
            let mean = sum as f64 / f64::from(trials);
            let expected = f64::from(expected_unique(population as f32, samples));
            // The spread of the number of different ones is below the square root of what is drawn.
            let tolerance = 4.0 * (mean.sqrt() / f64::from(trials).sqrt()).max(1e-6);
            assert!(
                (mean - expected).abs() < tolerance,
                "seed 11, {population} {samples}: {mean} {expected}"
            );
        }
    }
}

#[test]
fn large_populations_and_small_shares_do_not_cancel() {
    for population in [1e6_f32, 1e9, 1e12] {
        for samples in [1_u32, 3, 1000] {
            let (n, k) = (f64::from(population), f64::from(samples));
            let expected = -n * (k * (-1.0 / n).ln_1p()).exp_m1();
            let found = f64::from(expected_unique(population, samples));
            assert!((found / expected - 1.0).abs() < 1e-5, "{population} {samples}: {found} {expected}");
        }
    }
    let found = covered(0.0, 1e-9, 1.0);
    assert!((found / 1e-9 - 1.0).abs() < 1e-5, "{found}");
    // 1 - (1 - 0.1)^3, in two steps.
    let found = covered(covered(0.0, 0.1, 1.0), 0.1, 2.0);
    assert!((found - 0.271).abs() < 1e-6, "{found}");
}

/// The probability of at least `wanted` of `trials`, by the terms of the binomial distribution.
fn binomial_tail(trials: u32, wanted: u32, p: f64) -> f64 {
    let mut term = (1.0 - p).powi(trials as i32);
    let mut tail = 0.0;
    for successes in 0..=trials {
        if successes >= wanted {
            tail += term;
        }
        term *= f64::from(trials - successes) / f64::from(successes + 1) * p / (1.0 - p);
    }
    tail
}

#[test]
fn acceptance_is_near_the_exact_binomial() {
    for budget in [25, 100] {
        let accumulator = Accumulator::new(budget, Population::Frustum);
        for step in 1..100 {
            let p = f64::from(step) / 100.0;
            for wanted in 0..=budget {
                let exact = binomial_tail(budget, wanted, p);
                let found = f64::from(accumulator.at_least(wanted, p as f32));
                let variance = f64::from(budget) * p * (1.0 - p);
                // The error of the normal distribution falls with the variance (Berry and Esseen).
                let tolerance = if variance < 1.0 { 0.11 } else { 0.066 / variance.sqrt() };
                assert!((found - exact).abs() < tolerance, "{budget} {wanted} {p}: {found} {exact}");
            }
        }
    }
    let accumulator = Accumulator::new(25, Population::Frustum);
    assert_eq!([0, 1, 25, 26].map(|wanted| accumulator.at_least(wanted, 1.0)), [1.0, 1.0, 1.0, 0.0]);
    assert_eq!([0, 1, 25, 26].map(|wanted| accumulator.at_least(wanted, 0.0)), [1.0, 0.0, 0.0, 0.0]);
}

/// A cloud of `count` particles of that radius in the unit cube, as a structure.
fn cloud(specification: &str, radius: f32) -> Structure {
    let particles = synthetic::generate(specification, &()).unwrap();
    Structure::build(Kind::Brute, particles, &Radii::Uniform(radius), 1.0, &()).unwrap()
}

fn view(structure: &Structure, direction: DVec3, projection: Projection) -> View {
    let look_at = structure.origin() + structure.bounds().center().as_dvec3();
    let camera = Camera { eye: look_at - 3.0 * direction.normalize(), look_at, up: DVec3::Y, projection };
    camera.view(structure.origin(), 12, 12).unwrap()
}

const PROJECTIONS: [Projection; 2] =
    [Projection::Orthographic { height: 1.2 }, Projection::Perspective { vertical_angle: 0.4 }];

#[test]
fn every_particle_counts_as_one() {
    for (count, radius, voxels) in [(1, 0.1, 4), (5000, 0.004, 20), (5000, 0.2, 40), (3, 0.0, 9)] {
        let structure = cloud(&format!("uniform?n={count}&seed=3"), radius);
        let grid = DensityGrid::new(&structure, voxels).unwrap();
        let [x, y, z] = grid.voxels();
        let center = |at: [usize; 3]| {
            grid.bounds().min
                + Vec3::new(at[0] as f32, at[1] as f32, at[2] as f32) * grid.edge()
                + 0.5 * grid.edge()
        };
        let sum: f64 = (0..x * y * z)
            .map(|at| center([at % x, at / x % y, at / x / y]))
            .map(|at| f64::from(grid.density(at, Interpolation::Nearest)))
            .sum();
        assert!((sum / f64::from(count) - 1.0).abs() < 1e-3, "{count} {radius} {voxels}: {sum}");
    }
}

#[test]
fn a_voxel_with_more_particles_than_its_count_holds_takes_a_coarser_unit() {
    // 100,000 at one place: more than 2^16 whole particles of 2^16 units.
    let structure = cloud("uniform?n=1e5&seed=3", 2000.0);
    let grid = DensityGrid::new(&structure, 1).unwrap();
    assert_eq!(grid.voxels(), [1, 1, 1]);
    let found = grid.density(grid.bounds().center(), Interpolation::Trilinear);
    assert!((found / 1e5 - 1.0).abs() < 1e-4, "{found}");
}

#[test]
fn shares_of_voxels_are_near_the_volumes_of_the_particle_in_them() {
    // Two particles, of which the first one makes the box large; the shares of the second are read.
    let mut stream = Stream::new(5, 0);
    let mut worst: f32 = 0.0;
    for _ in 0..40 {
        let (structure, center, radius) = loop {
            let number = (stream.unit() * 1e6) as u32;
            let structure = cloud(&format!("uniform?n=40&seed={number}"), 0.02);
            let (center, radius) = structure.sphere(7);
            let alone = (0..40).all(|node| node == 7 || structure.sphere(node).0.distance(center) > 0.4);
            let inside = structure.bounds().grown(-0.3).contains(center);
            if alone || inside {
                break (structure, center, radius);
            }
        };
        let grid = DensityGrid::new(&structure, 6).unwrap();
        // Only voxels that no other particle reaches into.
        let place = |point: Vec3| ((point - grid.bounds().min) / grid.edge()).floor();
        let own = place(center);
        let reaches = |node: u32, voxel: Vec3| {
            let (center, radius) = structure.sphere(node);
            let low = grid.bounds().min + voxel * grid.edge();
            center.clamp(low, low + grid.edge()).distance(center) <= radius
        };
        for corner in 0..27 {
            let step = Vec3::new((corner % 3) as f32, (corner / 3 % 3) as f32, (corner / 9) as f32) - 1.0;
            let voxel = own + step;
            let middle = grid.bounds().min + (voxel + 0.5) * grid.edge();
            if (0..40).any(|node| node != 7 && reaches(node, voxel)) || !grid.bounds().contains(middle) {
                continue;
            }
            // Quadrature: the share of a fine lattice of points of the sphere that falls into the voxel.
            let (mut all, mut inside) = (0, 0);
            let steps = 40;
            for at in 0..steps * steps * steps {
                let at =
                    Vec3::new((at % steps) as f32, (at / steps % steps) as f32, (at / steps / steps) as f32);
                let offset = (at + 0.5) * (2.0 / steps as f32) - 1.0;
                if offset.length_squared() < 1.0 {
                    all += 1;
                    inside += i32::from(place(center + radius * offset) == voxel);
                }
            }
            let exact = inside as f32 / all as f32;
            let found = grid.density(middle, Interpolation::Nearest);
            worst = worst.max((found - exact).abs());
        }
    }
    assert!(worst > 0.0 && worst < 0.08, "{worst}");
}

#[test]
fn the_histogram_counts_the_particles_of_the_frustum() {
    // Voxels of about a hundred particles, nearly as wide as a pixel.
    let structure = cloud("uniform?n=400000&seed=8", 0.001);
    let grid = DensityGrid::new(&structure, 16).unwrap();
    for direction in [DVec3::X, DVec3::NEG_Z, DVec3::new(1.0, 0.6, -0.8), DVec3::ONE] {
        for projection in PROJECTIONS {
            let view = view(&structure, direction, projection);
            for interpolation in [Interpolation::Nearest, Interpolation::Trilinear] {
                let (mut counted, mut marched) = ([0.0; 3], [0.0; 3]);
                let ends = [2.8_f32, 3.1, f32::INFINITY];
                for (x, y) in [(5, 5), (6, 5), (5, 6), (6, 6), (7, 5)] {
                    let ray = view.ray(x as f32 + 0.5, y as f32 + 0.5);
                    let mut histogram = Histogram::default();
                    histogram.march(&grid, &view, &ray, interpolation);
                    for (end, marched) in ends.iter().zip(&mut marched) {
                        *marched += histogram.before(*end);
                    }
                    for node in 0..structure.len() as u32 {
                        let offset = structure.sphere(node).0 - view.eye;
                        let depth = offset.dot(view.forward);
                        let scale = if view.perspective { 1.0 / depth } else { 1.0 };
                        let u = (offset.dot(view.right) * scale - view.left) / view.pixel;
                        let v = (view.top - offset.dot(view.up) * scale) / view.pixel;
                        if u.floor() == x as f32 && v.floor() == y as f32 {
                            let t = depth / ray.direction.dot(view.forward);
                            for (end, counted) in ends.iter().zip(&mut counted) {
                                *counted += f32::from(u8::from(t < *end));
                            }
                        }
                    }
                }
                for (counted, marched) in counted.into_iter().zip(marched) {
                    // Half a percent by what particles reach over, and the noise of about a thousand.
                    let tolerance = 0.07 * counted + 30.0;
                    assert!(
                        (counted - marched).abs() < tolerance,
                        "{direction} {projection:?} {interpolation:?}: {counted} {marched}"
                    );
                }
            }
        }
    }
}

#[test]
fn the_march_is_that_of_a_slow_one() {
    let structure = cloud("clustered?n=20000&seed=4", 0.004);
    let grid = DensityGrid::new(&structure, 24).unwrap();
    let mut stream = Stream::new(21, 0);
    let mut met = 0;
    for trial in 0..300 {
        let direction = match trial % 4 {
            0 => DVec3::X,
            1 => DVec3::new(1.0, -1.0, 1.0),
            _ => stream.direction().as_dvec3(),
        };
        let view = view(&structure, direction, PROJECTIONS[trial % 2]);
        let mut ray = view.ray(12.0 * stream.unit(), 12.0 * stream.unit());
        if trial % 3 == 0 {
            ray.t_max = 2.5 + stream.unit();
        }
        let mut histogram = Histogram::default();
        histogram.march(&grid, &view, &ray, Interpolation::Nearest);

        // Every slab in turn, in double precision, by where the ray meets its planes.
        let axis =
            (1..3).fold(
                0,
                |best, axis| {
                    if ray.direction[axis].abs() > ray.direction[best].abs() { axis } else { best }
                },
            );
        let meets = |slab: usize| {
            let plane = f64::from(grid.bounds().min[axis]) + slab as f64 * f64::from(grid.edge()[axis]);
            (plane - f64::from(ray.origin[axis])) / f64::from(ray.direction[axis])
        };
        let inside = grid.bounds().clip(&ray);
        for end in [2.6_f64, 3.0, 3.3, 9.0] {
            let mut sum = 0.0;
            for slab in 0..grid.voxels()[axis] {
                let Some([enter, leave]) = inside.map(|ends| ends.map(f64::from)) else { continue };
                let (a, b) = (meets(slab), meets(slab + 1));
                let (near, far) = (a.min(b).max(enter), a.max(b).min(leave));
                if near >= far {
                    continue;
                }
                let middle = 0.5 * (near + far);
                let point = ray.origin + middle as f32 * ray.direction;
                let cosine = f64::from(ray.direction.dot(view.forward));
                let pixel = f64::from(view.pixel) * if view.perspective { middle * cosine } else { 1.0 };
                let voxel = f64::from(grid.edge().element_product());
                let part = ((end - near) / (far - near)).clamp(0.0, 1.0);
                sum += part * f64::from(grid.density(point, Interpolation::Nearest)) / voxel
                    * pixel
                    * pixel
                    * cosine
                    * (far - near)
                    * f64::from(footprint::population(grid.mean_radius(), pixel as f32));
            }
            met += usize::from(sum > 0.0);
            let found = f64::from(histogram.before(end as f32));
            // A sample on the border of two voxels may fall into either.
            assert!((found - sum).abs() <= 0.03 * sum + 1e-3, "seed 21, {trial} {end}: {found} {sum}");
        }
        for _ in 0..20 {
            let t = 2.0 + 2.0 * stream.unit();
            let back = histogram.back_of_slab(t);
            assert!(back >= t, "{back} {t}");
            assert!(histogram.before(back) >= histogram.before(t));
            let sum = histogram.before(t) + histogram.behind(t);
            assert!((sum - histogram.total()).abs() <= 1e-5 * sum, "{t}");
        }
    }
    assert!(met > 500, "{met}");
}

#[test]
fn depths_in_a_slab_are_one() {
    let structure = cloud("uniform?n=1000&seed=4", 0.01);
    let grid = DensityGrid::new(&structure, 10).unwrap();
    let view = view(&structure, DVec3::new(0.3, 1.0, 0.2), PROJECTIONS[0]);
    let mut histogram = Histogram::default();
    histogram.march(&grid, &view, &view.ray(6.2, 5.9), Interpolation::Nearest);
    let mut backs: Vec<u32> =
        (0..1000).map(|at| histogram.back_of_slab(2.45 + 1.1e-3 * at as f32).to_bits()).collect();
    backs.dedup();
    assert!((9..=14).contains(&backs.len()), "{}", backs.len());
}

#[test]
fn a_nearer_depth_is_taken_if_it_can_pay_off_within_the_budget() {
    let structure = cloud("uniform?n=1e6&seed=4", 0.005);
    let grid = DensityGrid::new(&structure, 40).unwrap();
    let view = view(&structure, DVec3::X, PROJECTIONS[0]);
    let mut histogram = Histogram::default();
    histogram.march(&grid, &view, &view.ray(6.5, 6.5), Interpolation::Nearest);
    let accumulator = Accumulator::new(25, Population::Frustum);
    let share = 0.05;
    let accept = |current: &Estimate, depth| accumulator.acceptance(current, &histogram, depth, share);
    // Before any sample any depth is better.
    assert_eq!(accept(&Estimate::NONE, 2.7), 1.0);
    // At the end nothing is left to save.
    assert_eq!(accept(&Estimate::NONE, 9.0), 0.0);
    // What is as sure and saves more is hard to reach when few samples are so near.
    let sure = Estimate { depth: 3.2, confidence: 0.9, ..Estimate::NONE };
    let chances = [2.52, 2.6, 2.8, 3.0, 3.15].map(|depth| accept(&sure, depth));
    assert!(chances[0] < 1e-3, "{chances:?}");
    let unsure = Estimate { confidence: 0.2, ..sure };
    for (depth, chance) in [2.52, 2.6, 2.8, 3.0, 3.15].into_iter().zip(chances) {
        assert!(accept(&unsure, depth) >= chance, "{depth}");
    }
}

#[test]
fn confidence_becomes_the_share_that_is_covered_if_samples_are_drawn_from_what_is_counted() {
    // Discs at random places without structure, all that the model asks for; about thirty a pixel, a quarter of them nearer.
    let radius = 0.02;
    let particles = synthetic::generate("uniform?n=3000&seed=6", &()).unwrap();
    let kind = Kind::Pkd(crate::structure::pkd::Options::default());
    let structure = Structure::build(kind, particles, &Radii::Uniform(radius), 1.0, &()).unwrap();
    let grid = DensityGrid::new(&structure, 12).unwrap();
    let view = view(&structure, DVec3::Z, PROJECTIONS[0]);
    let share = footprint::share(radius / view.pixel);
    let depth = 2.75;
    let (mut believed, mut covered) = ([0.0; 2], 0.0);
    let (pixels, samples) = (64, 600);
    for at in 0..pixels {
        let (x, y) = ((2 + at % 8) as f32, (2 + at / 8) as f32);
        let mut histogram = Histogram::default();
        histogram.march(&grid, &view, &view.ray(x + 0.5, y + 0.5), Interpolation::Nearest);
        let mut stream = Stream::new(17, at);
        let mut estimates = [Estimate { depth, ..Estimate::NONE }; 2];
        for _ in 0..samples {
            let ray = view.ray(x + stream.unit(), y + stream.unit());
            let first = structure.hits(&ray, &mut |t, _| {
                if t <= depth {
                    let populations = [histogram.total(), histogram.before(depth)];
                    for (estimate, population) in estimates.iter_mut().zip(populations) {
                        estimate.accumulate(share, population.max(1.0));
                    }
                }
            });
            covered += f32::from(u8::from(first.is_some_and(|hit| hit.t <= depth))) / samples as f32;
        }
        for (sum, estimate) in believed.iter_mut().zip(estimates) {
            *sum += estimate.confidence;
        }
    }
    let [of_frustum, of_depth, covered] = [believed[0], believed[1], covered].map(|sum| sum / pixels as f32);
    assert!((of_depth - covered).abs() < 0.05, "seed 17: {of_depth} {covered}");
    // Drawn from all of the frustum, as the thesis has it, the same few particles are taken for ever new ones.
    assert!(of_frustum > 0.95 && covered < 0.75, "seed 17: {of_frustum} {covered}");
}

#[test]
fn as_many_samples_are_wanted_as_accumulation_takes() {
    let mut stream = Stream::new(31, 0);
    for _ in 0..2000 {
        let share = 0.3 * stream.unit() + 1e-3;
        let population = 1.0 + 300.0 * stream.unit() * stream.unit();
        let wanted = stream.unit();
        let mut confidence = 0.0;
        let mut unique = 0.0;
        let reached = (1..5000).find(|&samples| {
            let now = expected_unique(population, samples);
            confidence = covered(confidence, share, now - unique);
            unique = now;
            confidence > wanted
        });
        let found = super::accumulate::samples_needed(wanted, share, population);
        let near = match (reached, found) {
            (Some(reached), Some(found)) => reached.abs_diff(found) <= 1 + reached / 50,
            // Where the limit of the confidence is all but what is wanted, it is reached by rounding.
            (None, Some(found)) => found > 1000,
            (Some(reached), None) => reached > 500,
            (None, None) => true,
        };
        assert!(near, "seed 31: {share} {population} {wanted}: {reached:?} {found:?}");
    }
}
