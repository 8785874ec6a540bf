//! Shapes beside particles in pictures, against single rays at every shape and every particle.

use glam::{DQuat, DVec3, Vec3};

use super::replicas;
use super::scenes::Random;
use super::visibility::{KINDS, differing_pixels, image, scene};
use crate::math::Ray;
use crate::particles::{Cell, Columns, Particles, Positions, Radii};
use crate::render::{Culling, Renderer, Settings, certified, confidence};
use crate::scene::Scene;
use crate::scene::camera::{Camera, Projection};
use crate::scene::color::resolve;
use crate::scene::coloring::Mapping;
use crate::scene::light::{KeyLight, Lighting, Sky};
use crate::scene::looks::{Adjustments, Look};
use crate::srgb::linear_from_encoded;
use crate::structure::replicas::Replicas;
use crate::structure::shapes::{Arrow, Ellipsoid, Mesh, Segment};
use crate::structure::{Kind, Structure};
use fearless_simd::Level;

/// Bonds between any particles, some of them twice, some without length, some halves.
fn segments(particles: &Particles, count: usize, random: &mut Random) -> Vec<Segment> {
    let mut segments: Vec<Segment> = Vec::new();
    for bond in 0..count {
        let ends = [random.below(particles.len() as u32), random.below(particles.len() as u32)];
        let [from, to] = ends.map(|id| particles.positions().offset(id as usize));
        segments.push(match bond % 9 {
            4 => segments[bond - 1],
            6 => Segment { from, to: 0.5 * from + 0.5 * to, ends: [ends[0]; 2] },
            _ => Segment { from, to: from + (to - from).clamp_length_max(1.5), ends },
        });
    }
    segments
}

fn bonded(
    particles: &Particles,
    segments: &[Segment],
    kind: Kind,
    lighting: Lighting,
    images: [u32; 3],
) -> Scene {
    let radii = particles.radii().unwrap();
    let mut scene = scene(particles, radii, kind, lighting);
    scene.scale_radii(0.3);
    scene.replicate(&Replicas::new(particles.cell(), images).unwrap()).unwrap();
    scene.bond(segments, 0.06).unwrap();
    scene
}

/// Adds shapes of all other kinds at some of the particles.
fn furnish(scene: &mut Scene, particles: &Particles) {
    scene.add_mesh(&walls(particles), [0.2, 0.4, 0.6]).unwrap();
    let mut random = Random::new(8002);
    let ids = 0..particles.len().min(12) as u32;
    let from = |id: u32| particles.positions().offset(id as usize);
    let arrows: Vec<Arrow> =
        ids.clone().map(|id| Arrow { from: from(id), vector: random.vector(), particle: id }).collect();
    scene.add_arrows(&arrows, 0.05).unwrap();
    let ellipsoid = |id: u32| {
        let half_axes = DVec3::new(0.1, 0.2, 0.5);
        let turn = DQuat::from_rotation_arc(DVec3::Z, random.vector().as_dvec3().normalize_or(DVec3::X));
        let exponents = if id.is_multiple_of(4) { [4.0, 3.0] } else { Ellipsoid::ROUND };
        Ellipsoid { particle: id, half_axes, turn, exponents }
    };
    scene.add_ellipsoids(&ids.filter(|id| id.is_multiple_of(2)).map(ellipsoid).collect::<Vec<_>>()).unwrap();
}

/// Triangles at some of the particles, one of them without area.
fn walls(particles: &Particles) -> Mesh {
    let mut random = Random::new(8001);
    let mut corners = Vec::new();
    for id in 0..particles.len().min(12) {
        let at = particles.positions().world(id);
        corners.extend([(); 3].map(|()| at + 0.8 * random.vector().as_dvec3()));
    }
    let mut triangles: Vec<[u32; 3]> =
        (0..corners.len() as u32 / 3).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    triangles.push([0, 1, 1]);
    Mesh::new("walls", corners, triangles).unwrap()
}

#[test]
fn pictures_show_what_single_rays_meet() {
    let (mut particles_met, mut others_met, mut walls_met) = (0, 0, 0);
    for seed in 0..24 {
        let mut random = Random::new(8000 + seed);
        let images = [[1; 3], [2, 1, 2]][seed as usize % 2];
        let [(particles, _), _] = replicas::particles(30, images, &mut random);
        let segments = segments(&particles, 60, &mut random);
        let mut camera = replicas::camera(&mut random);
        if seed % 4 > 1 {
            camera.projection = Projection::Panorama;
        }
        let settings = Settings { width: 37, height: 23, samples: 1, seed: 0, culling: Culling::Off };
        let view = camera.view(DVec3::ZERO, 37, 23).unwrap();
        for kind in [KINDS[0], KINDS[1], KINDS[2 + seed as usize % 10]] {
            let mut scene = bonded(&particles, &segments, kind, Lighting::Flat, images);
            furnish(&mut scene, &particles);
            let found = image(&scene, &camera, &settings, Level::new());
            for pixel in 0..37 * 23 {
                let ray = view.ray((pixel % 37) as f32 + 0.5, (pixel / 37) as f32 + 0.5);
                let particle = scene.structure().intersect(&ray, None).map(|hit| (hit.t, hit.node));
                let shape = scene.shape_before(&ray, particle.map(|(depth, _)| depth));
                let wanted = shape.or(particle);
                particles_met += u32::from(shape.is_none() && particle.is_some());
                let place = wanted.and_then(|(_, node)| scene.place(node)).map(|place| place as i64);
                others_met += u32::from(shape.is_some() && place.is_some());
                walls_met += u32::from(shape.is_some() && place.is_none());
                let told = format!("seed {seed}: {kind:?}, pixel {pixel}, {camera:?}");
                assert_eq!(found.depth[pixel], wanted.map_or(f32::INFINITY, |(depth, _)| depth), "{told}");
                assert_eq!(found.id[pixel], place.unwrap_or(-1), "{told}");
            }
        }
    }
    let told = format!("{particles_met} particles, {others_met} other shapes, {walls_met} walls");
    assert!(particles_met > 100 && others_met > 400 && walls_met > 150, "{told}");
}

#[test]
fn light_is_the_same_for_all_structures_and_ways_of_asking() {
    for seed in 0..6 {
        let mut random = Random::new(8100 + seed);
        let images = [[1; 3], [2, 1, 2]][seed as usize % 2];
        let [(particles, _), _] = replicas::particles(40, images, &mut random);
        let segments = segments(&particles, 80, &mut random);
        let camera = replicas::camera(&mut random);
        let view = camera.view(DVec3::ZERO, 37, 23).unwrap();
        let lighting = || Lighting::studio(view.forward, view.right, view.up);
        let picture = |kind: Kind, culling: Culling| {
            let settings = Settings { width: 37, height: 23, samples: 20, seed: 1, culling };
            let mut scene = bonded(&particles, &segments, kind, lighting(), images);
            furnish(&mut scene, &particles);
            image(&scene, &camera, &settings, Level::new())
        };
        let expected = picture(Kind::Brute, Culling::Off);
        for kind in [KINDS[0], KINDS[2], KINDS[7]] {
            for culling in [Culling::Off, Culling::default()] {
                assert_eq!(
                    differing_pixels(&expected, &picture(kind, culling)),
                    0,
                    "seed {seed}: {kind:?} {culling:?}"
                );
            }
        }
    }
}

#[test]
fn a_bond_shadows_and_is_shadowed() {
    // A rod above a large ball, seen and lit from above: it lies in front of the ball, and darkens what is below.
    let mut random = Random::new(8200);
    let [(particles, _), _] = replicas::particles(2, [1; 3], &mut random);
    let at = particles.positions().offset(0);
    let rod =
        Segment { from: at + Vec3::new(-3.0, 0.0, 2.0), to: at + Vec3::new(3.0, 0.0, 2.0), ends: [0, 1] };
    let center = at.as_dvec3();
    let camera = Camera {
        eye: center + DVec3::new(0.0, -20.0, 20.0),
        look_at: center,
        up: DVec3::Z,
        projection: Projection::Orthographic { height: 6.0 },
    };
    let view = camera.view(DVec3::ZERO, 60, 60).unwrap();
    let settings = Settings { width: 60, height: 60, samples: 64, ..Settings::default() };
    let picture = |segments: &[Segment]| {
        let mut scene = scene(
            &particles,
            particles.radii().unwrap(),
            Kind::default(),
            Lighting::studio(view.forward, view.right, view.up),
        );
        scene.scale_radii(3.0);
        scene.bond(segments, 0.2).unwrap();
        image(&scene, &camera, &settings, Level::new())
    };
    let (with, without) = (picture(&[rod]), picture(&[]));
    let rod_shown = (0..3600).filter(|&k| with.id[k] >= 0 && without.id[k] < 0).count();
    assert!(rod_shown > 20, "{rod_shown}");
    let darker =
        |k: usize| with.depth[k] == without.depth[k] && with.color[k][0] < 0.98 * without.color[k][0];
    assert!((0..3600).filter(|&k| darker(k)).count() > 20, "the ball lies in the rod's shadow");
}

#[test]
fn bonds_of_hidden_particles_are_hidden() {
    let mut random = Random::new(8300);
    let [(particles, _), _] = replicas::particles(30, [1; 3], &mut random);
    let segments = segments(&particles, 60, &mut random);
    let mut scene = bonded(&particles, &segments, Kind::default(), Lighting::Flat, [1; 3]);
    let all = scene.shapes().unwrap().bvh().ids().len();
    let filter = "radius=0.3:".parse().unwrap();
    scene.keep(vec![crate::scene::select::Selectable::of(&particles, &filter).unwrap()]);
    scene.select(&[filter], &[]).unwrap();
    let is_shown = |id: u32| particles.radius(particles.radii().unwrap(), id as usize) >= 0.3;
    let wanted =
        segments.iter().filter(|it| it.from != it.to && it.ends.iter().all(|&id| is_shown(id))).count();
    assert!(wanted > 0 && wanted < all);
    assert_eq!(scene.shapes().unwrap().bvh().ids().len(), wanted);
    scene.select(&[], &[]).unwrap();
    assert_eq!(scene.shapes().unwrap().bvh().ids().len(), all);
}

#[test]
fn what_bonds_cannot_be_is_refused() {
    let mut random = Random::new(8400);
    let [(particles, _), _] = replicas::particles(20, [1; 3], &mut random);
    let segments = segments(&particles, 5, &mut random);
    let mut scene = bonded(&particles, &segments, Kind::default(), Lighting::Flat, [1; 3]);
    for radius in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert!(scene.bond(&segments, radius).is_err(), "{radius}");
    }
    let nodes = scene.nodes();
    let unknown = Segment { ends: [0, 20], ..segments[0] };
    scene.bond(&[unknown], 0.1).unwrap();
    assert_eq!(scene.nodes(), nodes, "there is no particle 20");
    let camera = replicas::camera(&mut random);
    let culling = Culling::Confidence(confidence::Options::default());
    assert!(Renderer::new(&scene, &camera, &Settings { culling, ..Settings::default() }).is_err());
    let culling = Culling::Certified(certified::Options { coverage: true, ..certified::Options::default() });
    assert!(Renderer::new(&scene, &camera, &Settings { culling, ..Settings::default() }).is_ok());
}

/// One particle of that radius at the origin, gray.
/// The nearest of the rods of a cell that a ray enters, by capsules in double precision.
fn entered(cell: &Cell, radius: f64, ray: &Ray) -> f64 {
    let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let distance = |point: DVec3| {
        let to = |[from, to]: [DVec3; 2]| {
            let along = to - from;
            let share = ((point - from).dot(along) / along.length_squared()).clamp(0.0, 1.0);
            point.distance(from + share * along)
        };
        cell.edges().map(to).fold(f64::INFINITY, f64::min) - radius
    };
    // Spheres around points of the ray that hold nothing.
    let mut t = 0.0;
    for _ in 0..500 {
        let free = distance(origin + t * direction);
        if free < 1e-9 || t > 100.0 {
            break;
        }
        t += free;
    }
    t
}

#[test]
fn a_cell_is_rods_with_round_ends() {
    let cell = Cell {
        origin: DVec3::new(-1.0, -1.2, -0.9),
        vectors: [DVec3::new(2.0, 0.1, 0.0), DVec3::new(0.3, 2.2, 0.1), DVec3::new(0.0, -0.2, 1.9)],
        periodic: [true; 3],
    };
    let radius = 0.06;
    let mut scene = lone(0.05, Lighting::Flat);
    scene.add_cell(&cell, radius, [0.1, 0.2, 0.3]).unwrap();
    let camera = Camera {
        eye: DVec3::new(4.0, 3.0, 2.5),
        look_at: DVec3::ZERO,
        up: DVec3::Z,
        projection: Projection::Perspective { vertical_angle: 0.7 },
    };
    let settings = Settings { width: 96, height: 96, samples: 1, ..Settings::default() };
    let found = image(&scene, &camera, &settings, Level::new());
    let view = camera.view(scene.structure().origin(), 96, 96).unwrap();
    let mut seen = 0;
    for (pixel, &depth) in found.depth.iter().enumerate() {
        let ray = view.ray((pixel % 96) as f32 + 0.5, (pixel / 96) as f32 + 0.5);
        let expected = entered(&cell, radius.into(), &ray);
        if found.id[pixel] < 0 && depth < f32::INFINITY {
            assert!((f64::from(depth) - expected).abs() < 1e-3, "{pixel}: {depth} instead of {expected}");
            assert!(found.color[pixel][2] > 0.29);
            seen += 1;
        } else {
            // At a rim rounding decides.
            assert!(expected > 90.0 || found.id[pixel] == 0 || expected.is_nan(), "{pixel}: {expected}");
        }
    }
    assert!(seen > 500, "{seen}");
    assert!(scene.add_cell(&cell, 0.0, [0.0; 3]).is_err());
}

fn lone(radius: f32, lighting: Lighting) -> Scene {
    let positions = Positions::from_offsets(DVec3::ZERO, [0, 1, 2].map(|_| vec![0.0]));
    let particles = Particles::new(Columns { positions, ..Columns::default() }).unwrap();
    let colors = resolve(&particles, &"#808080".parse().unwrap(), &Mapping::default()).unwrap();
    let radii = Radii::Uniform(radius);
    Scene::new(
        Structure::build(Kind::default(), particles, &radii, 1.0, &()).unwrap(),
        colors,
        lighting,
        None,
    )
}

fn parallel(eye: DVec3, height: f64) -> Camera {
    let projection = Projection::Orthographic { height };
    Camera { eye, look_at: DVec3::ZERO, up: DVec3::Z, projection }
}

/// A unit sphere of so many bands of triangles.
fn tessellated(bands: u32) -> Mesh {
    let point = |band: u32, turn: u32| {
        let step = std::f64::consts::PI / f64::from(bands);
        let ((sin, cos), (y, x)) = ((step * f64::from(band)).sin_cos(), (step * f64::from(turn)).sin_cos());
        DVec3::new(sin * x, sin * y, cos)
    };
    let around = 2 * bands;
    let corners = (0..=bands).flat_map(|band| (0..around).map(move |turn| point(band, turn))).collect();
    let at = |band: u32, turn: u32| band * around + turn % around;
    let triangles = (0..bands).flat_map(|band| {
        (0..around).flat_map(move |turn| {
            let [a, b, c, d] =
                [at(band, turn), at(band, turn + 1), at(band + 1, turn), at(band + 1, turn + 1)];
            [[a, c, d], [a, d, b]]
        })
    });
    Mesh::new("a sphere", corners, triangles.collect()).unwrap()
}

#[test]
fn a_sphere_of_triangles_looks_like_a_sphere() {
    const BANDS: u32 = 90;
    let camera = parallel(DVec3::new(2.0, -20.0, 4.0), 3.0);
    let view = camera.view(DVec3::ZERO, 48, 48).unwrap();
    let settings = Settings { width: 48, height: 48, samples: 16, ..Settings::default() };
    for lighting in [
        Lighting::Headlight,
        Lighting::studio(view.forward, view.right, view.up),
        Look::Matte.lighting([view.forward, view.right, view.up], &Adjustments::default()),
    ] {
        let exact = image(&lone(1.0, lighting.clone()), &camera, &settings, Level::new());
        let mut scene = lone(0.01, lighting.clone());
        scene.add_mesh(&tessellated(BANDS), [linear_from_encoded(128.0 / 255.0); 3]).unwrap();
        let found = image(&scene, &camera, &settings, Level::new());
        let (mut shown, mut difference) = (0, 0.0);
        for pixel in 0..48 * 48 {
            let ray = view.ray((pixel % 48) as f32 + 0.5, (pixel / 48) as f32 + 0.5);
            let facing = (ray.origin + exact.depth[pixel] * ray.direction).dot(-view.forward);
            // Not at the rim, where triangles cover less.
            if exact.id[pixel] == 0 && facing > 0.3 {
                assert_eq!(found.id[pixel], -1, "a mesh is no particle");
                let deeper = found.depth[pixel] - exact.depth[pixel];
                let most = 1.01 * (1.0 - (std::f32::consts::PI / BANDS as f32).cos()) / facing;
                assert!((-1e-5..most).contains(&deeper), "{pixel}: {deeper} deeper");
                difference += f64::from(found.color[pixel][0] - exact.color[pixel][0]).abs();
                shown += 1;
            }
        }
        let difference = difference / f64::from(shown);
        assert!(shown > 600 && difference < 4e-3, "{shown} pixels differ by {difference} in {lighting:?}");
    }
}

#[test]
fn a_mesh_shadows_a_mesh_where_the_light_says() {
    let toward = DVec3::new(0.3, -0.2, 1.0).normalize();
    let key = KeyLight { toward: toward.as_vec3(), angular_radius: 0.0, strength: 1.0 };
    let sky = Sky { zenith: 0.0, ground: 0.0, up: Vec3::Z };
    let mut scene = lone(1e-3, Lighting::Studio(key, sky));
    let floor = [[-4.0, -4.0], [4.0, -4.0], [4.0, 4.0], [-4.0, 4.0]].map(|[x, y]| DVec3::new(x, y, -1.0));
    scene.add_mesh(&Mesh::new("floor", floor.into(), vec![[0, 1, 2], [0, 2, 3]]).unwrap(), [1.0; 3]).unwrap();
    let roof = [DVec3::new(-1.5, -1.0, 1.0), DVec3::new(1.5, -1.2, 1.0), DVec3::new(0.2, 1.6, 1.0)];
    scene.add_mesh(&Mesh::new("roof", roof.into(), vec![[0, 2, 1]]).unwrap(), [1.0; 3]).unwrap();
    let camera = parallel(DVec3::new(0.0, -30.0, 20.0), 4.0);
    let settings = Settings { width: 64, height: 64, samples: 1, ..Settings::default() };
    let view = camera.view(DVec3::ZERO, 64, 64).unwrap();
    let found = image(&scene, &camera, &settings, Level::new());
    let (mut lit, mut dark) = (0, 0);
    for pixel in 0..64 * 64 {
        let ray = view.ray((pixel % 64) as f32 + 0.5, (pixel / 64) as f32 + 0.5);
        let point = (ray.origin + found.depth[pixel] * ray.direction).as_dvec3();
        if !point.is_finite() || (point.z + 1.0).abs() > 1e-3 {
            continue;
        }
        let above = point + toward * (2.0 / toward.z);
        let beside = |k: usize| {
            let edge = (roof[(k + 1) % 3] - roof[k]).truncate();
            edge.perp_dot((above - roof[k]).truncate()) / edge.length()
        };
        let inside = beside(0).min(beside(1)).min(beside(2));
        let light = found.color[pixel][0];
        if inside.abs() > 1e-3 {
            let wanted = if inside > 0.0 { 0.0 } else { toward.z as f32 };
            assert!((light - wanted).abs() < 1e-5, "pixel {pixel}: {light}, {inside} within the roof");
            *(if inside > 0.0 { &mut dark } else { &mut lit }) += 1;
        }
    }
    assert!(lit > 500 && dark > 200, "{lit} lit, {dark} in the shadow");
}

#[test]
fn an_arrow_or_an_ellipsoid_that_cannot_be_is_refused() {
    let mut scene = lone(1.0, Lighting::Flat);
    let arrow = Arrow { from: Vec3::ZERO, vector: Vec3::X, particle: 0 };
    for radius in [0.0, f32::NAN, f32::INFINITY] {
        assert!(scene.add_arrows(&[arrow], radius).is_err(), "{radius}");
    }
    let round =
        Ellipsoid { particle: 0, half_axes: DVec3::ONE, turn: DQuat::IDENTITY, exponents: Ellipsoid::ROUND };
    for wrong in [
        Ellipsoid { half_axes: DVec3::new(1.0, 0.0, 1.0), ..round },
        Ellipsoid { half_axes: DVec3::splat(f64::NAN), ..round },
        Ellipsoid { exponents: [0.9, 2.0], ..round },
        Ellipsoid { exponents: [2.0, f64::NAN], ..round },
    ] {
        assert!(scene.add_ellipsoids(&[wrong]).is_err(), "{wrong:?}");
    }
    assert!(scene.shapes().is_none(), "nothing was added");
    scene.add_ellipsoids(&[round]).unwrap();
    scene.add_arrows(&[arrow, Arrow { particle: 1, ..arrow }], 0.1).unwrap();
    assert_eq!(scene.nodes(), 1 + 2 * 3, "there is no particle 1");
}

#[test]
fn what_is_no_mesh_is_refused() {
    let corners = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::splat(f64::NAN)];
    let refused = |triangles| Mesh::new("a.stl", corners.clone(), triangles).unwrap_err().to_string();
    assert!(refused(vec![]).contains("a.stl cannot be 'without faces'"));
    assert!(refused(vec![[0, 1, 2], [0, 1, 4]]).contains("with corner 4 in face 1, of 4 corners"));
    assert!(refused(vec![[0, 1, 3]]).contains("corners at finite places"));
    assert_eq!(Mesh::new("a.stl", corners.clone(), vec![[0, 1, 2]]).unwrap().len(), 1, "that is not used");
}
