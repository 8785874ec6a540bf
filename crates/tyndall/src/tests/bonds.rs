//! Bonds in pictures, against single rays at every bond and every particle.

use glam::{DVec3, Vec3};

use super::replicas;
use super::scenes::Random;
use super::visibility::{KINDS, differing_pixels, image, scene};
use crate::particles::Particles;
use crate::render::{Culling, Renderer, Settings, certified, confidence};
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::scene::light::Lighting;
use crate::structure::Kind;
use crate::structure::bonds::Segment;
use crate::structure::replicas::Replicas;
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

#[test]
fn pictures_show_what_single_rays_meet() {
    let (mut particles_met, mut bonds_met) = (0, 0);
    for seed in 0..24 {
        let mut random = Random::new(8000 + seed);
        let images = [[1; 3], [2, 1, 2]][seed as usize % 2];
        let [(particles, _), _] = replicas::particles(30, images, &mut random);
        let segments = segments(&particles, 60, &mut random);
        let camera = replicas::camera(&mut random);
        let settings = Settings { width: 37, height: 23, samples: 1, seed: 0, culling: Culling::Off };
        let view = camera.view(DVec3::ZERO, 37, 23).unwrap();
        for kind in [KINDS[0], KINDS[1], KINDS[2 + seed as usize % 10]] {
            let scene = bonded(&particles, &segments, kind, Lighting::Flat, images);
            let found = image(&scene, &camera, &settings, Level::new());
            for pixel in 0..37 * 23 {
                let ray = view.ray((pixel % 37) as f32 + 0.5, (pixel / 37) as f32 + 0.5);
                let particle = scene.structure().intersect(&ray, None).map(|hit| (hit.t, hit.node));
                let bond = scene.bond_before(&ray, particle.map(|(depth, _)| depth));
                let wanted = bond.or(particle);
                particles_met += u32::from(bond.is_none() && particle.is_some());
                bonds_met += u32::from(bond.is_some());
                let told = format!("seed {seed}: {kind:?}, pixel {pixel}, {camera:?}");
                assert_eq!(found.depth[pixel], wanted.map_or(f32::INFINITY, |(depth, _)| depth), "{told}");
                assert_eq!(
                    found.id[pixel],
                    wanted.map_or(-1, |(_, node)| scene.place(node) as i64),
                    "{told}"
                );
            }
        }
    }
    assert!(particles_met > 100 && bonds_met > 400, "{particles_met} particles, {bonds_met} bonds");
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
            let scene = bonded(&particles, &segments, kind, lighting(), images);
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
        projection: crate::scene::camera::Projection::Orthographic { height: 6.0 },
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
    let all = scene.bonds().unwrap().bvh().ids().len();
    let filter = "radius=0.3:".parse().unwrap();
    scene.keep(vec![crate::scene::select::Selectable::of(&particles, &filter).unwrap()]);
    scene.select(&[filter], &[]).unwrap();
    let is_shown = |id: u32| particles.radius(particles.radii().unwrap(), id as usize) >= 0.3;
    let wanted =
        segments.iter().filter(|it| it.from != it.to && it.ends.iter().all(|&id| is_shown(id))).count();
    assert!(wanted > 0 && wanted < all);
    assert_eq!(scene.bonds().unwrap().bvh().ids().len(), wanted);
    scene.select(&[], &[]).unwrap();
    assert_eq!(scene.bonds().unwrap().bvh().ids().len(), all);
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
    let unknown = Segment { ends: [0, 20], ..segments[0] };
    scene.bond(&[unknown], 0.1).unwrap();
    assert!(scene.bonds().is_none(), "there is no particle 20");
    scene.bond(&segments, 0.1).unwrap();
    let camera = replicas::camera(&mut random);
    let culling = Culling::Confidence(confidence::Options::default());
    assert!(Renderer::new(&scene, &camera, &Settings { culling, ..Settings::default() }).is_err());
    let culling = Culling::Certified(certified::Options { coverage: true, ..certified::Options::default() });
    assert!(Renderer::new(&scene, &camera, &Settings { culling, ..Settings::default() }).is_ok());
}
