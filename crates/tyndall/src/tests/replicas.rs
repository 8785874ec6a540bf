//! Periodic images without copies equal copies, bit for bit, where moving by the cell's edges rounds nothing.

use glam::{DVec3, Vec3};

use super::scenes::Random;
use super::visibility::{KINDS, differing_pixels, image, scene};
use crate::math::Ray;
use crate::particles::{Attribute, Cell, Columns, Particles, Positions, Radii, Values};
use crate::render::{Culling, Renderer, Settings, certified, confidence};
use crate::scene::camera::{Camera, Projection};
use crate::scene::light::Lighting;
use crate::structure::replicas::Replicas;
use crate::structure::{Kind, Structure};
use fearless_simd::Level;

/// All coordinates of a picture lie between 16 and 64, where single precision has steps of 2^-19 and 2^-18: moving what is there by
/// these edges is exact, and so is moving back.
const CELL: Cell = Cell {
    origin: DVec3::splat(16.5),
    vectors: [DVec3::new(4.0, 0.0, 0.0), DVec3::new(1.5, 3.75, 0.0), DVec3::new(0.25, 0.5, 3.5)],
    periodic: [true; 3],
};
const COUNTS: [[u32; 3]; 6] = [[2, 2, 3], [1, 1, 2], [2, 1, 1], [1, 3, 1], [2, 3, 2], [1, 1, 1]];

/// Particles near the cell's corner, some of them where images of others are, and the same with copies.
pub(super) fn particles(count: usize, counts: [u32; 3], random: &mut Random) -> [(Particles, Radii); 2] {
    let mut places = Vec::new();
    let mut radii = Vec::new();
    for id in 0..count {
        let place = 17.0 + 2.0 * Vec3::new(random.unit(), random.unit(), random.unit());
        places.push(match id % 7 {
            3 => places[id - 1] + CELL.vectors[0].as_vec3(),
            5 => places[id - 1],
            _ => place,
        });
        radii.push(match id % 7 {
            3 | 5 => radii[id - 1],
            _ => 0.1 + 0.6 * random.unit().powi(2),
        });
    }
    let replicas = Replicas::new(Some(&CELL), counts).unwrap();
    let all = (0..replicas.count()).map(|at| {
        let [x, y, _] = counts;
        replicas.shift([at % x, at / x % y, at / x / y]).as_vec3()
    });
    let of = |shifts: Vec<Vec3>| {
        let moved = |axis: usize| {
            shifts.iter().flat_map(|shift| places.iter().map(move |it| it[axis] + shift[axis])).collect()
        };
        let positions = Positions::from_offsets(DVec3::ZERO, [0, 1, 2].map(moved));
        let sizes = shifts.iter().flat_map(|_| radii.iter().copied()).collect();
        let attributes = vec![Attribute::new("radius", 1, Values::F32(sizes))];
        let columns = Columns { positions, attributes, cell: Some(CELL), ..Columns::default() };
        (Particles::new(columns).unwrap(), Radii::PerParticle { attribute: 0, scale: 1.0 })
    };
    [of(vec![Vec3::ZERO]), of(all.collect())]
}

/// From outside, from within, or along the x axis with parallel rays.
pub(super) fn camera(random: &mut Random) -> Camera {
    let (perspective, parallel) =
        (Projection::Perspective { vertical_angle: 0.4 }, Projection::Orthographic { height: 8.0 });
    let (eye, look_at, projection) = match random.below(4) {
        0 => (DVec3::new(60.0, 24.0, 22.0), DVec3::new(20.0, 24.0, 22.0), parallel),
        1 => (DVec3::new(22.0, 19.0, 20.0), DVec3::new(24.0, 24.0, 22.0), perspective),
        2 => (DVec3::new(40.0, 45.0, 42.0), DVec3::new(22.0, 20.0, 20.0), perspective),
        _ => (DVec3::new(60.0, 18.0, 42.0), DVec3::new(22.0, 22.0, 20.0), perspective),
    };
    Camera { eye, look_at, up: DVec3::Z, projection }
}

/// As a picture of copies, but with the ids of those that were copied.
fn without_copies(mut image: crate::Image, count: usize) -> crate::Image {
    image.id.iter_mut().filter(|id| **id >= 0).for_each(|id| *id %= count as i64);
    image
}

#[test]
fn images_are_seen_and_cast_shadows_as_copies_do() {
    let mut met = 0;
    for seed in 0..36 {
        let mut random = Random::new(7000 + seed);
        let counts = COUNTS[seed as usize % COUNTS.len()];
        let count = [0, 1, 17, 130, 400, 400][random.below(6) as usize];
        let [(one, radii), (copies, all_radii)] = particles(count, counts, &mut random);
        let camera = camera(&mut random);
        let samples = [1, 4, 16][random.below(3) as usize];
        let eye = camera.view(DVec3::ZERO, 40, 24).unwrap();
        let lighting = || match seed % 3 {
            0 => Lighting::Headlight,
            _ => Lighting::studio(eye.forward, eye.right, eye.up),
        };
        let proofs = certified::Options { clip: seed % 2 == 0, ..certified::Options::default() };
        let culling = [Culling::Off, Culling::Certified(proofs)][seed as usize % 2];
        let settings = Settings { width: 40, height: 24, samples, seed: seed as u32, culling };
        let copied = scene(&copies, &all_radii, Kind::default(), lighting());
        let expected = without_copies(image(&copied, &camera, &settings, Level::new()), count);
        met += expected.id.iter().filter(|&&id| id >= 0).count();
        for kind in KINDS {
            let mut scene = scene(&one, &radii, kind, lighting());
            scene.replicate(&Replicas::new(one.cell(), counts).unwrap()).unwrap();
            let found = image(&scene, &camera, &settings, Level::new());
            let differing = differing_pixels(&expected, &found);
            let told = format!("seed {seed}: {count} particles, {counts:?}, {samples} samples, {camera:?}");
            assert_eq!(differing, 0, "{told}, {kind:?}");
        }
    }
    assert!(met > 3000, "only {met} pixels met a particle: the scenes test nothing");
}

#[test]
fn single_rays_meet_images_as_they_meet_copies() {
    let (mut hits, mut blocked) = (0, 0);
    for seed in 0..40 {
        let mut random = Random::new(7500 + seed);
        let counts = COUNTS[seed as usize % COUNTS.len()];
        let [(one, radii), (copies, all_radii)] = particles(60, counts, &mut random);
        let copied = Structure::build(Kind::Brute, copies, &all_radii, 1.0, &()).unwrap();
        let kind = KINDS[seed as usize % KINDS.len()];
        let mut structure = Structure::build(kind, one.clone(), &radii, 1.0, &()).unwrap();
        structure.replicate(&Replicas::new(one.cell(), counts).unwrap()).unwrap();
        assert_eq!(structure.nodes() as usize, copied.len());
        assert_eq!(structure.bounds().union(copied.bounds()), structure.bounds());
        for _ in 0..200 {
            let direction = random.vector().normalize_or(Vec3::X);
            let origin = 17.0 + 8.0 * Vec3::new(random.unit(), random.unit(), random.unit());
            let ray = Ray { origin, direction, t_min: 0.0, t_max: 1.0 + 20.0 * random.unit() };
            let first = copied.intersect(&ray, None);
            let found = structure.intersect(&ray, None);
            assert_eq!(
                found.map(|hit| (hit.t, hit.node / 60, hit.id, structure.place(hit.node))),
                first.map(|hit| (hit.t, hit.id / 60, hit.id % 60, u64::from(hit.id) % 60)),
                "seed {seed}: {kind:?} {ray:?}"
            );
            let Some((found, first)) = found.zip(first) else { continue };
            assert_eq!(structure.sphere(found.node), copied.sphere(first.node));
            let beyond = copied.intersect(&ray, Some(first.node)).map(|hit| hit.t);
            assert_eq!(structure.intersect(&ray, Some(found.node)).map(|hit| hit.t), beyond);
            assert_eq!(structure.occluded(&ray, Some(found.node)), beyond.is_some());
            hits += 1;
            blocked += usize::from(beyond.is_some());
        }
    }
    assert!(hits > 1000 && blocked > 300 && blocked < hits, "{hits} hits, {blocked} blocked");
}

#[test]
fn what_is_hidden_and_scaled_is_so_in_all_images() {
    let mut random = Random::new(7900);
    let counts = [2, 2, 2];
    let [(one, radii), (copies, all_radii)] = particles(200, counts, &mut random);
    let camera = Camera {
        eye: DVec3::new(40.0, 45.0, 42.0),
        look_at: DVec3::splat(20.0),
        up: DVec3::Z,
        projection: Projection::Perspective { vertical_angle: 0.5 },
    };
    let settings = Settings { width: 60, height: 40, samples: 4, ..Settings::default() };
    for kind in KINDS {
        let pictures = [(&one, &radii), (&copies, &all_radii)].map(|(particles, radii)| {
            let mut scene = scene(particles, radii, kind, Lighting::Headlight);
            if particles.len() == one.len() {
                scene.replicate(&Replicas::new(one.cell(), counts).unwrap()).unwrap();
            }
            let filter = "radius=0.2:".parse().unwrap();
            let quantity = crate::scene::select::Selectable::of(particles, &filter).unwrap();
            scene.keep(vec![quantity]);
            let shown = scene.select(&[filter], &[]).unwrap();
            assert!((1..particles.len() as u64).contains(&shown));
            scene.scale_radii(0.75);
            without_copies(image(&scene, &camera, &settings, Level::new()), one.len())
        });
        assert_eq!(differing_pixels(&pictures[0], &pictures[1]), 0, "{kind:?}");
        assert!(pictures[0].id.iter().filter(|&&id| id >= 0).count() > 100);
    }
}

#[test]
fn kept_samples_know_their_image() {
    let mut random = Random::new(7950);
    let [(one, radii), _] = particles(100, [3, 2, 1], &mut random);
    let camera = camera(&mut random);
    let view = camera.view(DVec3::ZERO, 40, 24).unwrap();
    let lighting = Lighting::studio(view.forward, view.right, view.up);
    let mut scene = scene(&one, &radii, Kind::default(), lighting);
    let replicas = Replicas::new(one.cell(), [3, 2, 1]).unwrap();
    scene.replicate(&replicas).unwrap();
    let settings = Settings { width: 40, height: 24, samples: 20, ..Settings::default() };
    let mut renderer = Renderer::new(&scene, &camera, &settings).unwrap().keeping_samples();
    renderer.finish(&()).unwrap();
    let expected = renderer.image();
    let samples = renderer.into_samples().unwrap();
    assert_eq!(differing_pixels(&samples.image(&scene, &()).unwrap(), &expected), 0);
    scene.replicate(&Replicas::new(one.cell(), [1; 3]).unwrap()).unwrap();
    assert!(samples.image(&scene, &()).is_err(), "another number of images is another scene");
}

#[test]
fn what_images_cannot_be_is_refused() {
    let refused =
        |cell: Option<&Cell>, counts: [u32; 3]| Replicas::new(cell, counts).unwrap_err().to_string();
    assert!(refused(None, [2, 1, 1]).contains("--replicate cannot be '2,1,1' — for files that have a cell"));
    assert!(refused(Some(&CELL), [0, 1, 1]).contains("at least 1"));
    assert!(refused(Some(&CELL), [u32::MAX; 3]).contains("at most 1,048,576"));
    let slab = Cell { periodic: [true, true, false], ..CELL };
    assert!(refused(Some(&slab), [3, 3, 2]).contains("1 along the third edge"));
    assert!(Replicas::new(Some(&slab), [3, 3, 1]).is_ok());
    let flat = Cell { vectors: [DVec3::X, DVec3::Y, DVec3::ZERO], ..CELL };
    assert!(Replicas::new(Some(&flat), [1, 1, 2]).is_err());

    let [(one, radii), _] = particles(5000, [1; 3], &mut Random::new(1));
    let mut scene = scene(&one, &radii, Kind::default(), Lighting::Headlight);
    let most = scene.replicate(&Replicas::new(Some(&CELL), [100, 100, 100]).unwrap()).unwrap_err();
    assert!(most.to_string().contains("at most 858992 images"), "{most}");
    scene.replicate(&Replicas::new(Some(&CELL), [100, 100, 85]).unwrap()).unwrap();
    let camera = camera(&mut Random::new(2));
    let coverage = certified::Options { coverage: true, ..certified::Options::default() };
    for culling in [Culling::Confidence(confidence::Options::default()), Culling::Certified(coverage)] {
        let settings = Settings { culling, width: 8, height: 8, samples: 4, seed: 0 };
        assert!(Renderer::new(&scene, &camera, &settings).is_err(), "{culling:?}");
    }
}
