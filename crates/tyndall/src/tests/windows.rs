//! Parts of pictures, and what is told of the surfaces that pixels show.

use super::scenes::{Law, Random, particles};
use super::visibility::{differing_pixels, scene};
use crate::film::Window;
use crate::render::{Culling, Renderer, Settings, certified, confidence};
use crate::scene::camera::{Camera, Projection};
use crate::scene::light::{Lens, Lighting};
use crate::scene::looks::{Adjustments, Look};
use crate::structure::{Kind, Packing};
use glam::{DVec3, Vec3};

const SIZE: [u32; 2] = [83, 61];

fn settings(samples: u32) -> Settings {
    let culling = Culling::Certified(certified::Options::default());
    Settings { width: SIZE[0], height: SIZE[1], samples, seed: 5, culling }
}

/// A camera that sees all of a cloud from -1 to 1.
fn camera(is_orthographic: bool) -> Camera {
    let projection = match is_orthographic {
        true => Projection::Orthographic { height: 2.6 },
        false => Projection::Perspective { vertical_angle: 0.7 },
    };
    Camera { eye: DVec3::new(0.3, -4.0, 0.7), look_at: DVec3::ZERO, up: DVec3::Z, projection }
}

#[test]
fn a_part_of_a_picture_is_that_of_the_whole() {
    let (particles, radii) = particles(Law::Uniform, 700, &mut Random::new(3));
    for (kind, samples) in [(Kind::Bvh(Packing::Exact), 21), (Kind::Bvh(Packing::Exact), 1), (Kind::Brute, 4)]
    {
        let camera = camera(samples == 1);
        let view = camera.view(particles.positions().origin(), SIZE[0], SIZE[1]).unwrap();
        let lighting = Lighting::studio(view.forward, view.right, view.up);
        let scene = scene(&particles, &radii, kind, lighting);
        let render = |window: Window| {
            let mut renderer = Renderer::of_window(&scene, &camera, &settings(samples), window).unwrap();
            renderer.finish(&()).unwrap();
            (renderer.image(), renderer.surfaces())
        };
        let (whole, surfaces) = render(Window::whole(SIZE[0], SIZE[1]));
        assert!(whole.id.iter().any(|&id| id >= 0));
        for (x, y, width, height) in [(0, 0, 32, 32), (31, 33, 2, 28), (82, 60, 1, 1), (5, 0, 70, 61)] {
            let window = Window { x, y, width, height };
            let (part, of_part) = render(window);
            assert_eq!(differing_pixels(&part, &whole.part(window)), 0, "{window:?}");
            let first = (y * SIZE[0] + x) as usize;
            assert_eq!(of_part[0], surfaces[first], "{window:?}");
        }
    }
}

#[test]
fn where_neighbors_decide_there_are_no_parts() {
    let (particles, radii) = particles(Law::Uniform, 10, &mut Random::new(3));
    let scene = scene(&particles, &radii, Kind::default(), Lighting::Flat);
    let camera = camera(false);
    let culling = Culling::Confidence(confidence::Options::default());
    let settings = Settings { culling, ..settings(4) };
    let window = Window { x: 0, y: 0, width: 8, height: 8 };
    assert!(Renderer::of_window(&scene, &camera, &settings, window).is_err());
    let beyond = Window { x: 80, ..window };
    assert!(Renderer::of_window(&scene, &camera, &self::settings(4), beyond).is_err());
}

#[test]
fn surfaces_lie_on_their_particles_where_the_depth_is() {
    let (particles, radii) = particles(Law::Uniform, 300, &mut Random::new(9));
    for (samples, orthographic) in [(1, true), (16, false), (20, true)] {
        let scene = scene(&particles, &radii, Kind::default(), Lighting::Flat);
        let camera = camera(orthographic);
        let mut renderer = Renderer::new(&scene, &camera, &settings(samples)).unwrap();
        renderer.finish(&()).unwrap();
        let (image, surfaces) = (renderer.image(), renderer.surfaces());
        let origin = particles.positions().origin();
        let view = camera.view(origin, SIZE[0], SIZE[1]).unwrap();
        let mut count = 0;
        for (at, surface) in surfaces.iter().enumerate() {
            let Ok(id) = u32::try_from(image.id[at]) else {
                assert_eq!(surface.normal, [0.0; 3]);
                continue;
            };
            let structure = scene.structure();
            let node = (0..structure.nodes()).find(|&node| structure.place(node) == u64::from(id)).unwrap();
            let (center, radius) = structure.sphere(node);
            let position = (Vec3::from(surface.position).as_dvec3() - origin).as_vec3();
            let normal = Vec3::from(surface.normal);
            assert!((normal.length() - 1.0).abs() < 1e-5 && normal.dot(view.toward(position)) < 1e-2);
            assert!(position.abs_diff_eq(center + radius * normal, 1e-4 * (1.0 + radius)), "{at}");
            // Back in the picture it lies in its pixel, at its depth.
            let offset = position - view.eye;
            let depth = if view.perspective { offset.length() } else { offset.dot(view.forward) };
            assert!((depth / image.depth[at] - 1.0).abs() < 1e-3, "{depth} {}", image.depth[at]);
            let scale = if view.perspective { offset.dot(view.forward) } else { 1.0 };
            let x = (offset.dot(view.right) / scale - view.left) / view.pixel;
            let y = (view.top - offset.dot(view.up) / scale) / view.pixel;
            let (column, row) = (at as u32 % SIZE[0], at as u32 / SIZE[0]);
            assert!((x - column as f32 - 0.5).abs() < 0.6 && (y - row as f32 - 0.5).abs() < 0.6, "{x} {y}");
            count += 1;
        }
        assert!(count > 50, "{count}");
    }
}

#[test]
fn a_panorama_shows_what_its_rays_meet() {
    let (particles, radii) = particles(Law::Uniform, 500, &mut Random::new(8));
    let around =
        Camera { eye: DVec3::new(0.05, 0.1, -0.02), projection: Projection::Panorama, ..camera(false) };
    let settings = Settings { width: 80, height: 40, ..settings(1) };
    let view = around.view(particles.positions().origin(), 80, 40).unwrap();
    let lighting = Lighting::studio(view.forward, view.right, view.up);
    let mut images = Vec::new();
    for kind in [Kind::default(), Kind::Brute] {
        let scene = scene(&particles, &radii, kind, lighting.clone());
        let mut renderer = Renderer::new(&scene, &around, &settings).unwrap();
        renderer.finish(&()).unwrap();
        let image = renderer.image();
        for at in 0..image.id.len() {
            let ray = view.ray((at % 80) as f32 + 0.5, (at / 80) as f32 + 0.5);
            let hit = scene.structure().intersect(&ray, None);
            let place = hit.map_or(-1, |hit| scene.structure().place(hit.node) as i64);
            assert_eq!(image.id[at], place, "{at}");
        }
        assert!(image.id.iter().filter(|id| **id >= 0).count() > 1000);
        images.push(image);
    }
    assert_eq!(differing_pixels(&images[0], &images[1]), 0);
    // A lens has a line of sight.
    let lens = Adjustments { lens: Some(Lens { radius: 0.1, focus: 1.0 }), ..Adjustments::default() };
    let lit = Look::Matte.lighting([Vec3::X, Vec3::NEG_Y, Vec3::Z], &lens);
    assert!(Renderer::new(&scene(&particles, &radii, Kind::default(), lit), &around, &settings).is_err());
}
