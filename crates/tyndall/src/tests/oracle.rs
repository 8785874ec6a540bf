//! Slow truth in double precision, independent of the kernels' formula and rounding.

use glam::DVec3;

use super::scenes::{LAWS, Law, Random, camera, particles};
use crate::math::Ray;
use crate::structure::{Kind, Spheres, Structure};

/// What the ray meets: distance and id of the nearest sphere it enters, and by how much the answer hangs on rounding: the least
/// relative change of a radius or distance that would alter it.
fn trace(spheres: &Spheres, ray: &Ray) -> (Option<(f64, u32)>, f64) {
    let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3().normalize());
    let mut best: Option<(f64, u32)> = None;
    let mut slack = f64::INFINITY;
    for id in 0..spheres.len() {
        let (center, radius) = (spheres.center(id).as_dvec3(), spheres.radius(id) as f64);
        let to_center: DVec3 = center - origin;
        let closest = to_center.dot(direction);
        let off_axis = to_center.cross(direction).length();
        let scale = to_center.length();
        let half_chord_sq = radius * radius - off_axis * off_axis;
        let t = closest - half_chord_sq.max(0.0).sqrt();
        // Grazing, or starting on the surface: single precision may decide otherwise.
        if closest > -radius {
            slack = slack.min((off_axis - radius).abs() / scale);
        }
        if off_axis < radius * (1.0 + 1e-5) + 1e-5 * scale {
            slack = slack.min((scale - radius).abs() / scale);
        }
        if half_chord_sq > 0.0 && t > 0.0 {
            if let Some((nearest, _)) = best {
                slack = slack.min((nearest - t).abs() / scale);
            }
            if best.is_none_or(|(nearest, _)| t < nearest) {
                best = Some((t, id as u32));
            }
        }
    }
    (best, slack)
}

#[test]
fn single_precision_finds_what_double_precision_finds() {
    let (mut compared, mut undecided) = (0, 0);
    for seed in 0..64 {
        let mut random = Random::new(5000 + seed);
        let law = LAWS[seed as usize % LAWS.len()];
        let (particles, radii) = particles(law, 300, &mut random);
        let spheres = Spheres { particles: &particles, radii: &radii, radius_scale: 1.0 };
        let structure = Structure::build(Kind::default(), particles.clone(), &radii, 1.0, &()).unwrap();
        let view = camera(&particles.bounds(), &mut random).view(DVec3::ZERO, 24, 24).unwrap();
        for pixel in 0..24 * 24 {
            let ray = view.ray((pixel % 24) as f32 + 0.5, (pixel / 24) as f32 + 0.5);
            let (expected, slack) = trace(&spheres, &ray);
            if slack < 1e-5 {
                undecided += 1;
                continue;
            }
            compared += 1;
            let found = structure.intersect(&ray, None);
            assert_eq!(
                found.map(|hit| hit.id),
                expected.map(|(_, id)| id),
                "seed {seed}: {law:?}, pixel {pixel}"
            );
            if let (Some(hit), Some((t, id))) = (found, expected) {
                let reach = (spheres.center(id as usize) - ray.origin).length() as f64;
                // Where the ray grazes, the distance is as uncertain as the root of the rounding.
                assert!((hit.t as f64 - t).abs() < 1e-3 * reach, "seed {seed}: {law:?}, {} {t}", hit.t);
            }
        }
    }
    println!("{compared} rays compared, {undecided} too close to call in single precision");
    assert!(compared > 20 * undecided, "{compared} compared, {undecided} undecided");
    assert!(matches!(LAWS[1], Law::Equal), "degenerate laws are among them");
}
