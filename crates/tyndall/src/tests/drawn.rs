//! Particles that are seen through, against composition in order, ray by ray; particles that move, against closed forms.

use glam::{DVec3, Vec3};

use super::scenes::Random;
use super::visibility::{KINDS, differing_pixels, image, scene};
use crate::particles::{Attribute, Columns, Particles, Positions, Radii, Values};
use crate::render::{Culling, Renderer, Settings, confidence, render};
use crate::scene::Scene;
use crate::scene::camera::{Camera, Projection};
use crate::scene::color::ParticleColors;
use crate::scene::light::{KeyLight, Lighting, Lights, Paths, Sky};
use crate::scene::material::Material;
use crate::structure::shapes::Segment;
use crate::structure::{Kind, Packing, Structure};
use fearless_simd::Level;

const RADII: Radii = Radii::PerParticle { attribute: 0, scale: 1.0 };

fn spheres(places: &[[f64; 3]], radii: Vec<f32>) -> Particles {
    let mut positions = Positions::new();
    positions.extend(&places.iter().copied().map(DVec3::from).collect::<Vec<_>>());
    let attributes = vec![Attribute::new("radius", 1, Values::F32(radii))];
    Particles::new(Columns { positions, attributes, ..Columns::default() }).unwrap()
}

/// Along -z, parallel rays.
fn camera(height: f64) -> Camera {
    let projection = Projection::Orthographic { height };
    Camera { eye: 50.0 * DVec3::Z, look_at: DVec3::ZERO, up: DVec3::Y, projection }
}

fn settings(size: u32, samples: u32) -> Settings {
    Settings { width: size, height: size, samples, seed: 5, culling: Culling::Off }
}

/// Color times cover, and cover, of what a ray meets in order.
fn composed(scene: &Scene, opacity: &[f32], ray: &crate::math::Ray) -> [f32; 4] {
    let mut met = Vec::new();
    scene.structure().hits(ray, &mut |t, node| met.push((t, node)));
    met.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut sum, mut left) = ([0.0; 4], 1.0);
    for (_, node) in met {
        let share = left * opacity[scene.structure().ids()[node as usize] as usize];
        let [r, g, b] = scene.color(node);
        sum.iter_mut().zip([r, g, b, 1.0]).for_each(|(sum, channel)| *sum += share * channel);
        left -= share;
    }
    sum
}

#[test]
fn particles_are_composed_in_the_order_of_each_ray() {
    const SIZE: u32 = 12;
    const CELLS: u32 = 8;
    for seed in 0..2 {
        let mut random = Random::new(900 + seed);
        let mut number = || random.unit();
        let places: Vec<[f64; 3]> =
            (0..14).map(|_| [0; 3].map(|_| f64::from(2.0 * number() - 1.0))).collect();
        let particles = spheres(&places, (0..14).map(|_| 0.3 + 0.9 * number()).collect());
        let opacity: Vec<f32> = (0..14).map(|id| [0.0, 1.0, number(), 0.3 * number()][id % 4]).collect();
        let picture = |kind: Kind, samples: u32| {
            let mut scene = scene(&particles, &RADII, kind, Lighting::Flat);
            scene.set_opacity(Some(&opacity)).unwrap();
            (image(&scene, &camera(4.0), &settings(SIZE, samples), Level::new()), scene)
        };
        // Whatever the structure, the same particles are there.
        let (few, _) = picture(KINDS[0], 20);
        for kind in [KINDS[1], KINDS[2], KINDS[6 + seed as usize]] {
            assert_eq!(differing_pixels(&few, &picture(kind, 20).0), 0, "seed {seed}: {kind:?}");
        }
        let (found, scene) = picture(KINDS[0], 1024);
        let view = camera(4.0).view(scene.structure().origin(), SIZE, SIZE).unwrap();
        let mut off_sq = 0.0;
        for pixel in 0..SIZE * SIZE {
            let mut wanted = [0.0_f32; 4];
            for cell in 0..CELLS * CELLS {
                let x = (pixel % SIZE) as f32 + ((cell % CELLS) as f32 + 0.5) / CELLS as f32;
                let y = (pixel / SIZE) as f32 + ((cell / CELLS) as f32 + 0.5) / CELLS as f32;
                let one = composed(&scene, &opacity, &view.ray(x, y));
                wanted.iter_mut().zip(one).for_each(|(sum, one)| *sum += one / (CELLS * CELLS) as f32);
            }
            let color = found.color[pixel as usize];
            off_sq += (0..4).map(|channel| (color[channel] - wanted[channel]).powi(2)).sum::<f32>();
        }
        let off = (off_sq / (4 * SIZE * SIZE) as f32).sqrt();
        assert!(off < 0.015, "seed {seed}: {off}");
    }
}

#[test]
fn shadows_weaken_with_opacity_and_are_drawn_apart_from_what_is_seen() {
    // A wide floor, and between it and the light a black ball in the way of the eye too, or beside it.
    let key = |toward: Vec3| KeyLight { toward: toward.normalize(), angular_radius: 0.0, strength: 1.0 };
    let sky = Sky { zenith: 0.0, ground: 0.0, up: Vec3::Z };
    let paths = |key| Paths {
        lights: Lights::Studio(key, sky),
        material: Material::Matte { roughness: 0.0 },
        bounces: 0,
        lens: None,
    };
    for (at, toward, wanted) in [
        ([0.0, 0.0, 4.0], Vec3::Z, 0.6 * 0.6),
        ([4.0, 0.0, 4.0], Vec3::new(1.0, 0.0, 1.0), 0.6 * 0.5_f32.sqrt()),
    ] {
        let particles = spheres(&[[0.0, 0.0, -1e4], at], vec![1e4, 1.0]);
        let structure = Structure::build(Kind::default(), particles, &RADII, 1.0, &()).unwrap();
        let colors = ParticleColors::palette(vec![[255; 3], [0; 3]], vec![0, 1], String::new());
        let mut scene = Scene::new(structure, colors, Lighting::Studio(key(toward), sky), None);
        scene.set_opacity(Some(&[1.0, 0.4])).unwrap();
        for lighting in [scene.lighting.clone(), Lighting::Paths(paths(key(toward)))] {
            scene.lighting = lighting.clone();
            let image = render(&scene, &camera(0.2), &settings(4, 256), &()).unwrap();
            let found = image.color[5][0];
            assert!((found - wanted).abs() < 0.03, "{lighting:?}: {found} for {wanted}");
        }
    }
}

#[test]
fn bonds_have_the_lesser_opacity_of_their_particles() {
    let particles = spheres(&[[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], vec![0.2; 2]);
    for (opacity, wanted) in [([1.0, 0.25], 0.25), ([0.5, 0.5], 0.5), ([0.75, 1.0], 0.75)] {
        let mut scene = scene(&particles, &RADII, Kind::default(), Lighting::Flat);
        let origin = scene.structure().origin().as_vec3();
        let [from, to] = [Vec3::NEG_X - origin, Vec3::X - origin];
        scene.bond(&[Segment { from, to, ends: [0, 1] }], 0.1).unwrap();
        scene.set_opacity(Some(&opacity)).unwrap();
        let image = render(&scene, &camera(0.1), &settings(4, 64), &()).unwrap();
        assert_eq!(image.color[5][3], wanted);
    }
}

#[test]
fn what_is_opaque_is_drawn_as_without_opacity_and_nothing_at_none() {
    let particles = spheres(&[[0.0; 3], [0.7, 0.0, 0.4]], vec![0.5; 2]);
    let of = |opacity: Option<&[f32]>| {
        let mut scene = scene(&particles, &RADII, Kind::default(), Lighting::Headlight);
        scene.set_opacity(opacity).unwrap();
        image(&scene, &camera(2.0), &settings(16, 16), Level::new())
    };
    assert_eq!(differing_pixels(&of(Some(&[1.0; 2])), &of(None)), 0);
    assert!(of(Some(&[0.0; 2])).shows_nothing());

    let mut scene = scene(&particles, &RADII, Kind::default(), Lighting::Headlight);
    for wrong in [-0.1, 1.5, f32::NAN] {
        let error = scene.set_opacity(Some(&[1.0, wrong])).unwrap_err().to_string();
        assert!(error.contains("--opacity"), "{error}");
    }
    scene.set_opacity(Some(&[0.5; 2])).unwrap();
    let culling = Culling::Confidence(confidence::Options::default());
    let refused = Renderer::new(&scene, &camera(2.0), &Settings { culling, ..settings(16, 16) });
    assert!(refused.is_err_and(|error| error.to_string().contains("--opacity")));
}

#[test]
fn what_moves_covers_a_pixel_as_long_as_it_is_there() {
    const SIZE: u32 = 64;
    const RADIUS: f32 = 0.5;
    for (moved, at) in [(1.5, 0.0), (0.2, -0.4), (0.0, 0.3)] {
        let particles = spheres(&[[at, 0.0, 0.0], [0.0, 30.0, 0.0]], vec![RADIUS; 2]);
        for kind in [KINDS[0], Kind::Bvh(Packing::Bits16), KINDS[1]] {
            let mut scene = scene(&particles, &RADII, kind, Lighting::Flat);
            scene.set_motion(Some(&[moved * Vec3::X, Vec3::ZERO])).unwrap();
            assert_eq!(scene.is_moving(), moved > 0.0);
            let image = image(&scene, &camera(3.0), &settings(SIZE, 256), Level::new());
            // Along the row through the middle; pixels are so small that the chord is that of the row's middle.
            let pixel = 3.0 / SIZE as f32;
            let chord = (RADIUS * RADIUS - 0.25 * pixel * pixel).sqrt();
            let mut off_sq = 0.0;
            for column in 0..SIZE {
                let x = (column as f32 + 0.5) * pixel - 1.5 - at as f32;
                // The share of the exposure in which |x - moved * time| < chord, averaged over the pixel.
                let share = |x: f32| match moved > 0.0 {
                    true => ((x + chord) / moved).clamp(-0.5, 0.5) - ((x - chord) / moved).clamp(-0.5, 0.5),
                    false => f32::from(x.abs() < chord),
                };
                let wanted =
                    (0..32).map(|k| share(x + ((k as f32 + 0.5) / 32.0 - 0.5) * pixel)).sum::<f32>() / 32.0;
                let found = image.color[(SIZE / 2 * SIZE + column) as usize][3];
                off_sq += (found - wanted).powi(2) / SIZE as f32;
            }
            assert!(off_sq.sqrt() < 0.015, "{kind:?}, {moved}: {}", off_sq.sqrt());
        }
    }
}

#[test]
fn what_moves_is_found_as_by_brute_force_and_casts_shadows_where_it_is() {
    let mut random = Random::new(31);
    for seed in 0..4 {
        let count = [0, 1, 40, 500][seed];
        let mut number = || random.unit();
        let places: Vec<[f64; 3]> = (0..count).map(|_| [0; 3].map(|_| f64::from(number()))).collect();
        let particles = spheres(&places, (0..count).map(|_| 0.02 + 0.1 * number()).collect());
        let displacements: Vec<Vec3> =
            (0..count).map(|_| 0.5 * Vec3::from([0; 3].map(|_| number() - 0.5))).collect();
        let opacity: Vec<f32> = (0..count).map(|id| [1.0, number()][id % 2]).collect();
        for is_translucent in [false, true] {
            let pictures = [KINDS[0], KINDS[1]].map(|kind| {
                let key = KeyLight { toward: Vec3::ONE.normalize(), angular_radius: 0.1, strength: 0.8 };
                let sky = Sky { zenith: 0.5, ground: 0.1, up: Vec3::Z };
                let mut scene = scene(&particles, &RADII, kind, Lighting::Studio(key, sky));
                scene.set_motion(Some(&displacements)).unwrap();
                scene.set_opacity(is_translucent.then_some(&opacity)).unwrap();
                image(&scene, &camera(2.0), &settings(24, 6), Level::new())
            });
            assert_eq!(
                differing_pixels(&pictures[0], &pictures[1]),
                0,
                "{count} particles, {is_translucent}"
            );
        }
    }
}

#[test]
fn what_cannot_move_is_refused() {
    let particles = spheres(&[[0.0; 3], [0.7, 0.0, 0.4]], vec![0.5; 2]);
    let moves = [Vec3::X, Vec3::ZERO];
    for kind in [KINDS[2], KINDS[6]] {
        let mut scene = scene(&particles, &RADII, kind, Lighting::Flat);
        assert!(scene.set_motion(Some(&moves)).is_err_and(|error| error.to_string().contains("bvh")));
        scene.set_motion(Some(&[Vec3::ZERO; 2])).unwrap();
    }
    let mut scene = scene(&particles, &RADII, Kind::default(), Lighting::Flat);
    scene.bond(&[Segment { from: Vec3::ZERO, to: Vec3::X, ends: [0, 1] }], 0.1).unwrap();
    assert!(scene.set_motion(Some(&moves)).is_err_and(|error| error.to_string().contains("bonds")));
}
