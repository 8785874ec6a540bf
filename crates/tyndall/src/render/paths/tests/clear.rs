//! Light in clear bodies.

use glam::{DQuat, DVec3, Vec3};

use super::super::clear::COLOR_DIAMETERS;
use super::{EVEN_SKY, NO_KEY, camera, lit, mean, middle, picture, scene, with};
use crate::film::Image;
use crate::scene::Scene;
use crate::scene::light::{KeyLight, Lighting, Lights, Paths};
use crate::scene::material::Material;
use crate::structure::selection::HalfSpace;
use crate::structure::shapes::{Ellipsoid, Mesh, Segment};

/// Hardly any refraction: light goes straight on.
const STRAIGHT: Material = Material::Clear { index: 1.000_01 };

/// An ellipsoid in place of each of `spheres`.
fn of_ellipsoids(
    spheres: &[([f64; 3], f32, u8)],
    half_axes: DVec3,
    exponents: [f64; 2],
    paths: Paths,
) -> Scene {
    let mut scene = scene(spheres, Lighting::Paths(paths));
    let ellipsoid = |particle: u32| Ellipsoid { particle, half_axes, turn: DQuat::IDENTITY, exponents };
    scene.add_ellipsoids(&(0..spheres.len() as u32).map(ellipsoid).collect::<Vec<_>>()).unwrap();
    scene.scale_radii(1e-6);
    scene
}

/// What is left of light where the color is left after `COLOR_DIAMETERS`.
fn left(scene: &Scene, diameters: f32) -> f32 {
    scene.color(0)[0].powf(diameters / COLOR_DIAMETERS)
}

#[test]
fn clear_bodies_leave_their_color_of_what_crosses_a_diameter() {
    for (spheres, diameters) in [
        (vec![([0.0; 3], 1.0, 188)], 1.0),
        (vec![([0.0; 3], 1.0, 188), ([0.0, 3.0, 0.0], 1.0, 188)], 2.0),
        // Three units of one body, of which the last sphere is within the first.
        (vec![([0.0; 3], 1.0, 188), ([0.0, 1.0, 0.0], 1.0, 188), ([0.0, 0.1, 0.0], 0.3, 0)], 1.5),
    ] {
        let scene = scene(&spheres, Lighting::Paths(lit(STRAIGHT, 8)));
        let image = picture(&scene, &camera(DVec3::ZERO, 0.02), 16);
        let expected = scene.color(0)[0]
            .max(scene.color(scene.structure().len() as u32 - 1)[0])
            .powf(diameters / COLOR_DIAMETERS);
        assert!((middle(&image) - expected).abs() < 2e-3, "{} instead of {expected}", middle(&image));
    }
}

#[test]
fn round_ellipsoids_are_clear_as_spheres_are() {
    let spheres = [([0.0; 3], 1.0, 230), ([1.2, 0.3, 0.4], 1.0, 120), ([-0.9, 1.0, -0.6], 1.0, 180)];
    let lights = Lights::Studio(KeyLight { strength: 1.0, ..NO_KEY }, EVEN_SKY);
    let paths = Paths { lights, ..lit(Material::Clear { index: 1.5 }, 8) };
    let camera = camera(DVec3::ZERO, 4.0);
    let expected = picture(&scene(&spheres, Lighting::Paths(paths.clone())), &camera, 16);
    // Exponents of 2 are those of ellipsoids; what is next to them is found by steps.
    for (exponent, most) in [(2.0, 1e-3), (2.000_01, 5e-3)] {
        let scene = of_ellipsoids(&spheres, DVec3::ONE, [exponent; 2], paths.clone());
        let found = picture(&scene, &camera, 16);
        let differ = |(one, other): (&[f32; 4], &[f32; 4])| (one[0] - other[0]).abs();
        let mean = expected.color.iter().zip(&found.color).map(differ).sum::<f32>() / 576.0;
        assert!(mean < most, "{exponent}: {mean}");
    }
}

#[test]
fn clear_shapes_leave_their_color_of_what_crosses_them() {
    let through = |scene: &Scene| middle(&picture(scene, &camera(DVec3::ZERO, 0.02), 16));
    let paths = lit(STRAIGHT, 8);
    // Along y as long as three times its shortest axis, by which its color is measured.
    let scene_of = |exponents| {
        of_ellipsoids(&[([0.0; 3], 1.0, 188)], DVec3::new(0.5, 1.5, 0.7), exponents, paths.clone())
    };
    let ellipsoid = scene_of(Ellipsoid::ROUND);
    assert!((through(&ellipsoid) - left(&ellipsoid, 3.0)).abs() < 2e-3, "{}", through(&ellipsoid));
    let block = scene_of([8.0, 8.0]);
    assert!((through(&block) - left(&block, 3.0)).abs() < 4e-3, "{}", through(&block));

    // A bond across the rays and, longer than it is thick, one along them; their ends lie in no sphere.
    for (along, diameters) in [(Vec3::Z, 1.0), (Vec3::Y, 4.0)] {
        let mut bonded = scene(&[([0.0; 3], 1e-6, 188)], Lighting::Paths(paths.clone()));
        let bond = Segment { from: -along, to: along, ends: [0, 0] };
        bonded.bond(&[bond], 0.25).unwrap();
        assert!((through(&bonded) - left(&bonded, diameters)).abs() < 2e-3, "{along}: {}", through(&bonded));
    }

    // A pane stands for one diameter, at whatever angle.
    let mut paned = scene(&[([5.0, 0.0, 0.0], 1.0, 188)], Lighting::Paths(paths));
    let corners = [[-9.0, 0.5, -9.0], [9.0, 0.0, -9.0], [0.0, -0.5, 20.0]].map(DVec3::from_array);
    let grey = paned.color(0);
    paned.add_mesh(&Mesh::new("m", corners.to_vec(), vec![[0, 1, 2]]).unwrap(), grey).unwrap();
    assert!((through(&paned) - left(&paned, 1.0)).abs() < 2e-3, "{}", through(&paned));
}

#[test]
fn caps_of_clear_bodies_are_clear_unless_they_are_painted() {
    let spheres = [([0.0; 3], 1.0, 188)];
    // What is behind y = 0.5, or before it, and within a slab.
    let side = |normal: DVec3, distance: f64| HalfSpace { normal, distance };
    for (cuts, diameters) in [
        (vec![side(DVec3::Y, 0.5)], 0.75),
        (vec![side(DVec3::NEG_Y, -0.5)], 0.25),
        (vec![side(DVec3::Y, 0.5), side(DVec3::NEG_Y, 0.5)], 0.5),
    ] {
        let mut scene = scene(&spheres, Lighting::Paths(lit(STRAIGHT, 8)));
        scene.set_cut(&cuts, None);
        let found = middle(&picture(&scene, &camera(DVec3::ZERO, 0.02), 16));
        let expected = left(&scene, diameters);
        assert!((found - expected).abs() < 2e-3, "{found} instead of {expected}");
        scene.set_cut(&cuts, Some([0.0; 3]));
        let painted = middle(&picture(&scene, &camera(DVec3::ZERO, 0.02), 16));
        let is_capped = cuts[0].normal.y > 0.0;
        assert!((painted == 0.0) == is_capped, "{painted}");
    }
}

#[test]
fn light_that_comes_in_by_a_cap_goes_on_in_all_that_holds_it() {
    // The cap lies in both, deeper in the first one, which ends before the other.
    let spheres = [([0.0; 3], 1.0, 188), ([0.0, -0.8, 0.0], 1.0, 188)];
    let mut scene = scene(&spheres, Lighting::Paths(lit(STRAIGHT, 8)));
    scene.set_cut(&[HalfSpace { normal: DVec3::Y, distance: -0.1 }], None);
    let found = middle(&picture(&scene, &camera(DVec3::ZERO, 0.02), 16));
    let expected = left(&scene, 0.5 * (1.8 - 0.1));
    assert!((found - expected).abs() < 2e-3, "{found} instead of {expected}");
}

#[test]
fn white_clear_shapes_are_not_seen_in_light_from_everywhere() {
    let spheres = [([0.0; 3], 1.0, 255), ([1.2, 0.3, 0.4], 1.0, 255)];
    let paths = lit(Material::Clear { index: 1.5 }, 1000);
    let mut scene = of_ellipsoids(&spheres, DVec3::new(0.8, 0.5, 1.0), [2.0, 4.0], paths.clone());
    scene.bond(&[Segment { from: Vec3::NEG_Z, to: Vec3::new(1.0, 0.5, 1.0), ends: [0, 1] }], 0.2).unwrap();
    let corners = [[-2.0, -0.6, -2.0], [2.0, 0.8, -2.0], [0.0, 0.0, 2.0]].map(DVec3::from_array);
    scene.add_mesh(&Mesh::new("m", corners.to_vec(), vec![[0, 1, 2]]).unwrap(), [1.0; 3]).unwrap();
    let check = |image: &Image| {
        let [light, .., alpha] = mean(image);
        assert!(alpha > 0.3 && (light / alpha - 1.0).abs() < 2e-3, "{light} of {alpha}");
    };
    check(&picture(with(Lighting::Paths(paths), &mut scene), &camera(DVec3::ZERO, 3.5), 32));
    scene.set_cut(&[HalfSpace { normal: DVec3::new(0.2, 1.0, 0.1), distance: 0.2 }], None);
    check(&picture(&scene, &camera(DVec3::ZERO, 3.5), 32));
}
