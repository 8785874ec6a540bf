//! Meshes that hide what is behind them without being shown, against the same meshes as they are shown.

use glam::{DVec3, Vec3};

use super::visibility::{KINDS, scene};
use crate::film::Image;
use crate::particles::{Attribute, Columns, Particles, Radii, Values};
use crate::render::{Culling, Interactive, Renderer, Settings};
use crate::scene::Scene;
use crate::scene::camera::{Camera, Projection};
use crate::scene::light::{Lens, Lighting, Paths};
use crate::scene::looks::{Adjustments, Look};
use crate::structure::Kind;
use crate::structure::shapes::Mesh;

const SETTINGS: Settings = Settings { width: 48, height: 40, samples: 4, seed: 3, culling: Culling::Off };

fn particles() -> Particles {
    let mut columns = Columns::default();
    let centers: Vec<DVec3> =
        (0..60).map(|id| DVec3::from([(id % 5), (id / 5 % 4), (id / 20)].map(f64::from))).collect();
    columns.positions.extend(&centers);
    columns.attributes.push(Attribute::new("radius", 1, Values::F32(vec![0.45; 60])));
    Particles::new(columns).unwrap()
}

/// A triangle between the particles and the camera, another one behind them.
fn walls() -> Mesh {
    let corners = [
        [0.0, -2.0, 3.0],
        [9.0, -2.0, 3.0],
        [2.0, 9.0, 1.5],
        [-9.0, -9.0, -2.0],
        [9.0, -9.0, -2.0],
        [0.0, 19.0, -2.0],
    ];
    Mesh::new("walls", corners.map(DVec3::from_array).to_vec(), vec![[0, 1, 2], [3, 4, 5]]).unwrap()
}

fn camera() -> Camera {
    let projection = Projection::Perspective { vertical_angle: 0.8 };
    Camera { eye: DVec3::new(2.5, 1.5, 12.0), look_at: DVec3::new(2.0, 1.5, 1.0), up: DVec3::Y, projection }
}

fn with(mesh: impl FnOnce(&mut Scene), kind: Kind, lighting: Lighting) -> Scene {
    let mut scene = scene(&particles(), &Radii::Uniform(0.45), kind, lighting);
    mesh(&mut scene);
    scene
}

fn image(scene: &Scene, samples: u32) -> Image {
    let mut renderer = Renderer::new(scene, &camera(), &Settings { samples, ..SETTINGS }).unwrap();
    renderer.finish(&()).unwrap();
    renderer.image()
}

fn matte(lens: Option<Lens>) -> Lighting {
    Look::Matte.lighting([Vec3::NEG_Z, Vec3::X, Vec3::Y], &Adjustments { lens, ..Adjustments::default() })
}

#[test]
fn a_holdout_leaves_a_hole_and_all_else_as_with_the_mesh() {
    let studio = Lighting::studio(Vec3::NEG_Z, Vec3::X, Vec3::Y);
    let lightings = [Lighting::Flat, Lighting::Headlight, studio, matte(None)];
    let all = lightings.iter().flat_map(|lighting| KINDS.iter().map(move |kind| (*kind, lighting)));
    for (kind, lighting) in all {
        let shown = with(|scene| scene.add_mesh(&walls(), [0.5; 3]).unwrap(), kind, lighting.clone());
        let held_out = with(|scene| scene.add_holdout(&walls(), [0.5; 3]).unwrap(), kind, lighting.clone());
        let (shown, found) = (image(&shown, 1), image(&held_out, 1));
        let (mut holes, mut left) = (0, 0);
        for pixel in 0..shown.color.len() {
            let is_mesh = shown.id[pixel] < 0 && shown.depth[pixel] < f32::INFINITY;
            let wanted = match is_mesh {
                true => ([0.0; 4], f32::INFINITY, -1),
                false => (shown.color[pixel], shown.depth[pixel], shown.id[pixel]),
            };
            assert_eq!(
                (found.color[pixel], found.depth[pixel], found.id[pixel]),
                wanted,
                "{kind:?} {lighting:?} {pixel}"
            );
            holes += usize::from(is_mesh);
            left += usize::from(found.id[pixel] >= 0);
        }
        assert!(holes > 300 && left > 100, "{holes} {left}");
    }
}

#[test]
fn edges_of_holdouts_are_parts_of_pixels() {
    let lighting = Lighting::Flat;
    let without = image(&with(|_| (), Kind::default(), lighting.clone()), 64);
    let shown = image(
        &with(|scene| scene.add_mesh(&walls(), [0.0; 3]).unwrap(), Kind::default(), lighting.clone()),
        64,
    );
    let mut held_out =
        with(|scene| scene.add_holdout(&walls(), [0.0; 3]).unwrap(), Kind::default(), lighting);
    let found = image(&held_out, 64);
    let partly = found.color.iter().filter(|it| (0.05..0.95).contains(&it[3])).count();
    assert!(partly > 50, "{partly}");
    for (pixel, color) in found.color.iter().enumerate() {
        // The mesh is black: it adds nothing but to alpha, which is there what is not hidden.
        let wanted = shown.color[pixel];
        assert!((0..3).all(|channel| (color[channel] - wanted[channel]).abs() < 1e-6), "{pixel}");
        assert!(color[3] <= without.color[pixel][3] && color[3] <= wanted[3], "{pixel}");
    }
    // Before a background it shows that.
    held_out.background = Some([0.25, 0.5, 0.75]);
    let over = image(&held_out, 64);
    for (over, color) in over.color.iter().zip(&found.color) {
        let behind = 1.0 - color[3];
        let wanted = [color[0] + 0.25 * behind, color[1] + 0.5 * behind, color[2] + 0.75 * behind, 1.0];
        assert!((0..4).all(|channel| (over[channel] - wanted[channel]).abs() < 1e-5), "{over:?} {wanted:?}");
    }
}

#[test]
fn light_goes_on_as_with_the_mesh_behind_a_lens_too() {
    let lens = Some(Lens { radius: 0.5, focus: 11.0 });
    let lighting = matte(lens);
    let Lighting::Paths(Paths { bounces, .. }) = &lighting else { panic!() };
    assert!(*bounces > 0);
    let black = [0.0; 3];
    let shown =
        image(&with(|scene| scene.add_mesh(&walls(), black).unwrap(), Kind::default(), lighting.clone()), 16);
    let found =
        image(&with(|scene| scene.add_holdout(&walls(), black).unwrap(), Kind::default(), lighting), 16);
    let mut lower = 0;
    for (found, shown) in found.color.iter().zip(&shown.color) {
        assert!((0..3).all(|channel| (found[channel] - shown[channel]).abs() < 1e-6), "{found:?} {shown:?}");
        lower += usize::from(found[3] < shown[3]);
    }
    assert!(lower > 500, "{lower}");
}

#[test]
fn nothing_is_picked_where_a_holdout_hides() {
    let scene = with(|scene| scene.add_holdout(&walls(), [0.5; 3]).unwrap(), Kind::default(), Lighting::Flat);
    let found = image(&scene, 1);
    let interactive = Interactive::new(scene, camera(), Settings { samples: 1, ..SETTINGS }).unwrap();
    for y in 0..SETTINGS.height {
        for x in 0..SETTINGS.width {
            let id = found.id[(y * SETTINGS.width + x) as usize];
            assert_eq!(interactive.pick(x, y).is_some(), id >= 0, "{x} {y}");
        }
    }
}
