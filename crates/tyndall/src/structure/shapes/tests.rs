//! Entries against steps in double precision, and the hierarchy against trying every shape.

use glam::{DQuat, DVec3};

use super::*;
use crate::random::Stream;

fn ray(origin: Vec3, direction: Vec3) -> Ray {
    Ray { origin, direction, t_min: 0.0, t_max: f32::INFINITY }
}

/// A ray toward the surroundings of a point, from as far away as makes single precision hard.
fn ray_toward(target: Vec3, seed: u64, stream: &mut Stream) -> (Ray, f32) {
    let far = [3.0, 300.0, 3e4][seed as usize % 3];
    let direction = stream.direction();
    (ray(target - far * direction, direction), far)
}

/// Compares where a ray enters a convex shape with where points along it come inside: `depth` is by how much a point lies inside. Returns the
/// entry.
fn check_entry(
    (shape, depth): (&Shape, &dyn Fn(DVec3) -> f64),
    (ray, far): (&Ray, f32),
    seed: u64,
) -> Option<Vec3> {
    let place = |t: f64| ray.origin.as_dvec3() + t * ray.direction.as_dvec3();
    let step = 8.0 / 4000.0;
    let near = f64::from(far) - 4.0;
    let inside = (0..4000).map(|k| near + step * f64::from(k)).find(|&t| depth(place(t)) > 0.0);
    let tolerance = 2e-6 * f64::from(far) + 1e-5;
    match (inside, shape.meet(ray)) {
        (Some(first), Some((t, is_second))) => {
            let at = depth(place(f64::from(t)));
            assert!(at.abs() < tolerance, "seed {seed}: {t} near {first}, {at} inside");
            assert!(f64::from(t) < first + tolerance, "seed {seed}: {t} is behind {first}");
            let point = place(f64::from(t)).as_vec3();
            let (position, normal) = shape.surface(point, ray.direction);
            let blur = 0.01 + 20.0 * tolerance as f32;
            assert!((normal.length() - 1.0).abs() < 1e-5, "seed {seed}: {normal}");
            assert!(position.distance(point) < blur, "seed {seed}: {position} of {point}");
            // Near an edge either side may be told.
            let around = |by: f64| depth(position.as_dvec3() + by * normal.as_dvec3());
            assert!(around(0.02) < tolerance, "seed {seed}: the normal {normal} does not lead out");
            if let Shape::Cylinder(cylinder) = shape {
                let along = (position - cylinder.middle).dot(cylinder.axis);
                assert!(is_second == (along > 0.0) || along.abs() < blur, "seed {seed}");
            }
            return Some(normal);
        }
        (Some(first), None) => {
            let deepest = (0..400).map(|k| depth(place(first + 0.01 * f64::from(k)))).fold(0.0, f64::max);
            assert!(deepest < tolerance, "seed {seed}: nothing instead of {first}, {deepest}");
        }
        (None, Some((t, _))) => {
            let at = depth(place(f64::from(t)));
            assert!(at.abs() < tolerance + 1e-3, "seed {seed}: {t} instead of nothing");
        }
        (None, None) => {}
    }
    None
}

#[test]
fn rays_enter_cylinders_where_points_along_them_come_inside() {
    let (mut entered, mut ends) = (0, 0);
    for seed in 0..3000 {
        let mut stream = Stream::new(60, seed);
        let cylinder = Cylinder {
            middle: stream.cube(),
            axis: stream.direction(),
            half_length: 0.05 + stream.unit(),
            radius: 0.05 + 0.5 * stream.unit(),
        };
        let target = cylinder.middle + 0.8 * stream.cube();
        let (mut ray, far) = ray_toward(target, seed, &mut stream);
        if seed % 5 == 0 {
            ray = Ray { origin: target - far * cylinder.axis, direction: cylinder.axis, ..ray };
        }
        let depth = |point| cylinder.depth(point);
        if let Some(normal) = check_entry((&Shape::Cylinder(cylinder), &depth), (&ray, far), seed) {
            entered += 1;
            ends += u32::from(normal.dot(cylinder.axis).abs() > 0.99);
        }
    }
    assert!(entered > 500 && ends > 200, "{entered} entered, {ends} of them through an end");
}

#[test]
fn rays_enter_cones_where_points_along_them_come_inside() {
    let (mut entered, mut bases) = (0, 0);
    for seed in 0..3000 {
        let mut stream = Stream::new(63, seed);
        let (height, radius) = (0.1 + stream.unit(), 0.1 + [0.4, 1.5][seed as usize % 2] * stream.unit());
        let cone = Cone { tip: stream.cube(), axis: stream.direction(), height, radius };
        let target = cone.tip - 0.5 * height * cone.axis + 0.5 * stream.cube();
        let (mut ray, far) = ray_toward(target, seed, &mut stream);
        if seed % 5 == 0 {
            let along = if seed % 2 == 0 { cone.axis } else { -cone.axis };
            ray = Ray { origin: target - far * along, direction: along, ..ray };
        }
        let depth = |point| cone.depth(point);
        let ball = cone.ball();
        let rim = cone.tip - height * cone.axis + radius * cone.axis.any_orthonormal_vector();
        assert!(rim.distance(ball.center).max(cone.tip.distance(ball.center)) < ball.radius, "seed {seed}");
        if let Some(normal) = check_entry((&Shape::Cone(cone), &depth), (&ray, far), seed) {
            entered += 1;
            bases += u32::from(normal.dot(cone.axis) < -0.99);
        }
    }
    assert!(entered > 500 && bases > 100, "{entered} entered, {bases} of them through the base");
}

#[test]
fn rays_enter_ellipsoids_where_points_along_them_come_inside() {
    let mut entered = 0;
    for seed in 0..3000 {
        let mut stream = Stream::new(64, seed);
        let half_axes = DVec3::from([(); 3].map(|()| f64::from(0.1 + stream.unit())));
        let turn = DQuat::from_rotation_arc(DVec3::Z, stream.direction().as_dvec3());
        let turn = turn * DQuat::from_rotation_z(6.0 * f64::from(stream.unit()));
        let center = stream.cube();
        let ellipsoid =
            Stretched::new(center, &Ellipsoid { particle: 0, half_axes, turn, exponents: Ellipsoid::ROUND });
        let (ray, far) = ray_toward(center + 0.7 * stream.cube(), seed, &mut stream);
        let depth = |point| ellipsoid.depth(point);
        if let Some(normal) = check_entry((&Shape::Ellipsoid(ellipsoid), &depth), (&ray, far), seed) {
            entered += 1;
            // The closed form, in the space before the turn.
            let local = |it: Vec3| turn.inverse() * it.as_dvec3();
            let (from, speed) = (local(ray.origin - center) / half_axes, local(ray.direction) / half_axes);
            let (square, half, rest) = (speed.dot(speed), from.dot(speed), from.dot(from) - 1.0);
            let wanted = (-half - (half * half - square * rest).max(0.0).sqrt()) / square;
            let found = f64::from(Shape::Ellipsoid(ellipsoid).meet(&ray).unwrap().0);
            let point = from + wanted * speed;
            let exact = turn * (point / half_axes).normalize();
            // A ray that grazes is told its depth by a square root of what rounding leaves.
            let facing = -exact.dot(ray.direction.as_dvec3());
            if facing > 0.2 {
                let tolerance = 3e-6 * f64::from(far) + 1e-5;
                assert!((found - wanted).abs() < tolerance / facing, "seed {seed}: {found}, {wanted}");
                assert!(
                    normal.as_dvec3().dot(exact) > 1.0 - 50.0 * tolerance,
                    "seed {seed}: {normal}, {exact}"
                );
            }
        }
    }
    assert!(entered > 1000, "{entered}");
}

#[test]
fn rays_enter_superquadrics_where_points_along_them_come_inside() {
    let mut entered = 0;
    for seed in 0..2000 {
        let mut stream = Stream::new(65, seed);
        let half_axes = DVec3::from([(); 3].map(|()| f64::from(0.2 + stream.unit())));
        let turn = DQuat::from_rotation_arc(DVec3::Z, stream.direction().as_dvec3());
        let exponents = [(); 2].map(|()| [1.0, 2.0, 2.5, 4.0, 9.0, 30.0][(6.0 * stream.unit()) as usize % 6]);
        let center = stream.cube();
        let ellipsoid = Ellipsoid { particle: 0, half_axes, turn, exponents };
        let superquadric = Superquadric::new(center, &ellipsoid);
        let (ray, far) = ray_toward(center + 0.7 * stream.cube(), seed, &mut stream);
        let depth = |point| superquadric.depth(point);
        let shape = Shape::Superquadric(superquadric);
        entered += u32::from(check_entry((&shape, &depth), (&ray, far), seed).is_some());
        if exponents == Ellipsoid::ROUND {
            let round = Shape::Ellipsoid(Stretched::new(center, &ellipsoid)).meet(&ray).map(|met| met.0);
            let found = shape.meet(&ray).map(|met| met.0);
            let differ = |(one, other): (f32, f32)| (one - other).abs() > 1e-2;
            assert!(!round.zip(found).is_some_and(differ), "seed {seed}: {found:?} instead of {round:?}");
        }
    }
    assert!(entered > 800, "{entered}");
}

#[test]
fn arrows_keep_their_form_and_end_at_their_tips() {
    let arrow = |vector| Arrow { from: Vec3::ONE, vector, particle: 0 }.parts(0.1);
    let Some([Shape::Cylinder(shaft), Shape::Cone(tip)]) = arrow(Vec3::X * 4.0) else { panic!("a long one") };
    assert_eq!((tip.tip, tip.height, shaft.radius), (Vec3::new(5.0, 1.0, 1.0), 0.5, 0.1));
    assert!((shaft.middle.x + shaft.half_length - 4.5).abs() < 1e-6, "the shaft ends at the base");
    assert!(tip.radius > 2.0 * shaft.radius);
    let Some([Shape::Cylinder(shaft), Shape::Cone(tip)]) = arrow(Vec3::Y * 0.1) else {
        panic!("a short one")
    };
    assert_eq!((tip.height, shaft.radius), (0.05, 0.01));
    assert!((2.0 * shaft.half_length - 0.05).abs() < 1e-6, "half of it is shaft");
    assert!(arrow(Vec3::ZERO).is_none());
}

#[test]
fn what_starts_inside_does_not_enter() {
    let cylinder =
        Shape::Cylinder(Cylinder { middle: Vec3::ZERO, axis: Vec3::Z, half_length: 1.0, radius: 0.5 });
    let meet = |origin, direction| cylinder.meet(&Ray { t_max: 10.0, ..ray(origin, direction) });
    assert_eq!(meet(Vec3::ZERO, Vec3::X), None);
    assert_eq!(meet(Vec3::X * 2.0, Vec3::NEG_X), Some((1.5, false)));
    assert_eq!(meet(Vec3::Z * 3.0, Vec3::NEG_Z), Some((2.0, true)));
    assert_eq!(meet(Vec3::Z * -3.0, Vec3::Z), Some((2.0, false)));
    assert_eq!(meet(Vec3::X * 20.0, Vec3::NEG_X), None, "too far");
}

/// Where a ray meets a triangle in double precision, and its smallest barycentric coordinate there. Source: T. Möller, B. Trumbore, "Fast,
/// minimum storage ray/triangle intersection", JGT 1997.
fn triangle_met(triangle: &Triangle, ray: &Ray) -> (f64, f64) {
    let [a, b, c] = triangle.corners.map(|it| it.as_dvec3());
    let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let across = direction.cross(c - a);
    let volume = (b - a).dot(across);
    let u = (origin - a).dot(across) / volume;
    let behind = (origin - a).cross(b - a);
    let v = direction.dot(behind) / volume;
    ((c - a).dot(behind) / volume, u.min(v).min(1.0 - u - v))
}

#[test]
fn rays_meet_triangles_where_double_precision_says() {
    let (mut met, mut missed) = (0, 0);
    for seed in 0..3000 {
        let mut stream = Stream::new(61, seed);
        let triangle = Triangle { corners: [(); 3].map(|()| stream.cube()) };
        let target = triangle.corners[0].lerp(triangle.corners[1], stream.unit()) + 0.3 * stream.cube();
        let (ray, far) = ray_toward(target, seed, &mut stream);
        let (wanted, inside) = triangle_met(&triangle, &ray);
        let slant = triangle.double_area().normalize().dot(ray.direction).abs();
        let tolerance = 4e-6 * far / slant.min(triangle.double_area().length());
        if inside.abs() < f64::from(tolerance) {
            continue;
        }
        match Shape::Triangle(triangle).meet(&ray) {
            Some((t, _)) => {
                assert!(inside > 0.0, "seed {seed}: {t} instead of nothing, {inside}");
                assert!((f64::from(t) - wanted).abs() < f64::from(tolerance), "seed {seed}: {t}, {wanted}");
                let point = ray.origin + t * ray.direction;
                let (position, normal) = triangle.surface(point, ray.direction);
                assert!(normal.dot(ray.direction) < 0.0, "seed {seed}: it faces where the ray comes from");
                let lifted = (position - triangle.corners[0]).as_dvec3().dot(normal.as_dvec3());
                assert!((0.0..3e-6).contains(&lifted), "seed {seed}: {lifted} above");
                met += 1;
            }
            None => {
                assert!(inside < 0.0, "seed {seed}: nothing instead of {wanted}, {inside}");
                missed += 1;
            }
        }
    }
    assert!(met > 300 && missed > 300, "{met} met, {missed} missed");
}

#[test]
fn no_ray_passes_between_triangles_with_common_corners() {
    let mut stream = Stream::new(62, 0);
    for seed in 0..2000 {
        let middle = stream.cube();
        let rim: Vec<Vec3> = (0..6)
            .map(|k| {
                let (sin, cos) = (f32::from(k as u8) * 1.05).sin_cos();
                middle + Vec3::new(cos, sin, 0.2 * stream.unit())
            })
            .collect();
        let fan = (0..6).map(|k| Triangle { corners: [middle, rim[k], rim[(k + 1) % 6]] });
        // Exactly toward what they share: the corner, and points of the edges.
        let target = middle.lerp(rim[seed % 6], [0.0, 0.5, stream.unit()][seed % 3]);
        let direction = (stream.direction() - Vec3::Z * 2.0).normalize();
        let ray = ray(target - [2.0, 50.0, 1e3][seed / 3 % 3] * direction, direction);
        let count = fan.filter(|it| Shape::Triangle(*it).meet(&ray).is_some()).count();
        assert!(count > 0, "seed {seed}: {ray:?} passes");
    }
}

/// Shapes of all kinds.
fn shapes(stream: &mut Stream) -> Shapes {
    let mut all = Shapes::new().unwrap();
    for number in 0..300 {
        let center = 4.0 * stream.cube();
        let shape = match number % 5 {
            0 => {
                let axis = stream.direction();
                Shape::Cylinder(Cylinder { middle: center, axis, half_length: 0.5, radius: 0.1 })
            }
            1 => Shape::Cone(Cone { tip: center, axis: stream.direction(), height: 0.6, radius: 0.3 }),
            2 => {
                let half_axes = DVec3::new(0.2, 0.1, 0.6);
                let turn = DQuat::from_rotation_arc(DVec3::Z, stream.direction().as_dvec3());
                Shape::Ellipsoid(Stretched::new(
                    center,
                    &Ellipsoid { particle: 0, half_axes, turn, exponents: Ellipsoid::ROUND },
                ))
            }
            3 => {
                let half_axes = DVec3::new(0.2, 0.3, 0.5);
                let turn = DQuat::from_rotation_arc(DVec3::Z, stream.direction().as_dvec3());
                let ellipsoid = Ellipsoid { particle: 0, half_axes, turn, exponents: [5.0, 3.0] };
                Shape::Superquadric(Superquadric::new(center, &ellipsoid))
            }
            _ => Shape::Triangle(Triangle { corners: [(); 3].map(|()| center + 2.0 * stream.cube()) }),
        };
        all.push(shape, Owner::Mesh(0));
    }
    all.mesh_ball = 0.5;
    all
}

#[test]
fn the_hierarchy_finds_what_trying_every_shape_finds() {
    let mut stream = Stream::new(11, 0);
    let particles = crate::particles::Particles::new(Default::default()).unwrap();
    let radii = crate::particles::Radii::Uniform(1.0);
    let structure = Structure::build(super::super::Kind::default(), particles, &radii, 1.0, &()).unwrap();
    let mut shapes = shapes(&mut stream);
    shapes.show(&structure).unwrap();
    assert!(shapes.bvh.ids().len() > 350, "large triangles have several balls");
    let mut met = 0;
    for _ in 0..2000 {
        let ray = Ray { t_max: 6.0, ..ray(5.0 * stream.cube(), stream.direction()) };
        let expected = shapes.intersect(&ray);
        assert_eq!(shapes.nearest(&ray, None), expected);
        if let Some((_, node)) = expected {
            met += 1;
            let behind = shapes.nearest(&ray, Some(node / 2));
            assert!(behind.is_none_or(|(t, other)| other / 2 != node / 2 && t >= expected.unwrap().0));
        }
    }
    assert!(met > 200, "{met}");
}
