//! What is drawn over pictures, against closed forms.

use super::scenes::{Law, Random, particles};
use super::visibility::{differing_pixels, scene};
use crate::film::{Image, Window};
use crate::particles::{Attribute, Columns, Particles, Positions, Radii, Values};
use crate::render::illustration::{Contours, Halo, Illustration};
use crate::render::{Culling, Renderer, Settings};
use crate::scene::Scene;
use crate::scene::camera::{Camera, Projection};
use crate::scene::light::{Lens, Lighting};
use crate::scene::looks::{Adjustments, Look};
use crate::structure::Kind;
use crate::structure::shapes::{Mesh, Segment};
use glam::{DVec3, Vec3};

const RED: [f32; 3] = [1.0, 0.0, 0.0];

/// Spheres by center and radius, flat and gray before a background.
fn spheres(all: &[([f64; 3], f32)], background: Option<[f32; 3]>) -> Scene {
    let mut positions = Positions::around(DVec3::ZERO);
    positions.extend(&all.iter().map(|(center, _)| DVec3::from_array(*center)).collect::<Vec<_>>());
    let radius = Attribute::new("radius", 1, Values::F32(all.iter().map(|(_, radius)| *radius).collect()));
    let particles =
        Particles::new(Columns { positions, attributes: vec![radius], ..Columns::default() }).unwrap();
    let radii = Radii::PerParticle { attribute: 0, scale: 1.0 };
    let mut scene = scene(&particles, &radii, Kind::default(), Lighting::Flat);
    scene.background = background;
    scene
}

/// From z = 10 down, four units high, parallel.
fn above() -> Camera {
    Camera {
        eye: DVec3::new(0.0, 0.0, 10.0),
        look_at: DVec3::ZERO,
        up: DVec3::Y,
        projection: Projection::Orthographic { height: 4.0 },
    }
}

fn settings(edge: u32) -> Settings {
    Settings { width: edge, height: edge, samples: 16, seed: 1, culling: Culling::Off }
}

/// A picture before and after it is drawn over.
fn pictures(scene: &Scene, camera: &Camera, settings: &Settings, over: Illustration) -> [Image; 2] {
    let mut renderer = Renderer::new(scene, camera, settings).unwrap();
    renderer.finish(&()).unwrap();
    let before = renderer.image();
    let mut after = before.clone();
    let size = [settings.width, settings.height];
    over.draw((scene, camera), size, Window::whole(size[0], size[1]), &mut after, &()).unwrap();
    [before, after]
}

fn lines(width: f32, jump: f32) -> Illustration {
    Illustration { contours: Some(Contours { width, color: RED, jump }), ..Illustration::default() }
}

/// Red lines over blue-less gray: how much of each pixel is under them.
fn covered(scene: &Scene, edge: u32, over: Illustration) -> Vec<f32> {
    let [before, after] = pictures(scene, &above(), &settings(edge), over);
    let share = |(before, after): (&[f32; 4], &[f32; 4])| 1.0 - after[1] / before[1];
    before.color.iter().zip(&after.color).map(share).collect()
}

#[test]
fn a_sphere_has_a_ring_of_the_stated_width_around_its_silhouette_at_any_size() {
    for (edge, radius) in [(128, 1.2_f32), (96, 0.7)] {
        let scene = spheres(&[([0.11, -0.05, 0.0], radius)], Some([0.25; 3]));
        // In units of the scene: four of them are 1080 rows.
        let width = 27.0;
        let half = 0.5 * width / 1080.0 * 4.0;
        let pixel = 4.0 / edge as f32;
        let found = covered(&scene, edge, lines(width, 2.0));
        for (at, share) in found.iter().enumerate() {
            let x = ((at as u32 % edge) as f32 + 0.5) * pixel - 2.0 - 0.11;
            let y = 2.0 - ((at as u32 / edge) as f32 + 0.5) * pixel + 0.05;
            // At least so far within the line, in pixels; a pixel is up to 0.71 wide on either side.
            let within = (half - (x.hypot(y) - radius).abs()) / pixel;
            if within.abs() > 0.9 {
                assert!((share - if within > 0.0 { 1.0 } else { 0.0 }).abs() < 1e-5, "{edge} {at}: {share}");
            }
        }
        let area = found.iter().sum::<f32>() * pixel * pixel;
        let exact = std::f32::consts::TAU * radius * 2.0 * half;
        assert!((area / exact - 1.0).abs() < 0.02, "{edge}: {area} {exact}");
        // Smooth: many shades between none and all.
        let between = found.iter().filter(|share| **share > 0.02 && **share < 0.98).count();
        assert!(between as f32 * pixel > 2.0 * radius, "{between}");
    }
}

#[test]
fn lines_stand_where_depth_jumps_or_surfaces_cut_each_other() {
    let middle = |found: &[f32], x: f32| found[32 * 64 + ((x / 4.0 + 0.5) * 64.0) as usize];
    // A line of 34 pixels of 1080 rows is 0.126 wide: two pixels of these.
    let at = |scene: &Scene, jump: f32, x: f32| middle(&covered(scene, 64, lines(34.0, jump)), x);
    // A sphere before another, whose surface is 1 behind its silhouette.
    let behind = spheres(&[([0.0, 0.0, 0.0], 0.8), ([0.0, 0.0, -41.0], 40.0)], Some([1.0; 3]));
    assert!(at(&behind, 2.0, 0.8) > 0.9);
    assert_eq!(at(&behind, 11.0, 0.8), 0.0);
    assert_eq!(at(&behind, 2.0, 0.3), 0.0);
    // Two that cut each other at x = 0 at a right angle, or nearly as one.
    let cutting =
        |radius: f32, x: f64| spheres(&[([-x, 0.0, 0.0], radius), ([x, 0.0, 0.0], radius)], Some([1.0; 3]));
    assert!(at(&cutting(1.0, 0.707), 2.0, 0.0) > 0.9);
    assert_eq!(at(&cutting(1.0, 0.1), 2.0, 0.0), 0.0);
    // Smaller than the line and its jump.
    assert_eq!(at(&cutting(0.6, 0.42), 5.0, 0.0), 0.0);
    // A third of the radius is the widest: 0.2 at most, of which half lies outside.
    let small = spheres(&[([0.0; 3], 0.6)], Some([1.0; 3]));
    let found = covered(&small, 64, lines(100.0, 2.0));
    let area = found.iter().sum::<f32>() / 256.0;
    let exact = std::f32::consts::TAU * 0.6 * 0.2;
    assert!((area / exact - 1.0).abs() < 0.02, "{area} {exact}");
}

#[test]
fn a_mesh_has_lines_along_its_borders_and_folds_and_none_between_its_triangles() {
    let mut scene = spheres(&[([0.0, 0.0, -9.0], 0.1)], Some([1.0; 3]));
    // Two triangles in a plane, and one that goes down from their right border.
    let corners = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [1.5, 0.0, -1.0]];
    let triangles = vec![[0, 1, 2], [0, 2, 3], [1, 4, 2]];
    let mesh = Mesh::new("roof", corners.map(DVec3::from_array).into(), triangles).unwrap();
    scene.add_mesh(&mesh, [0.5; 3]).unwrap();
    let found = covered(&scene, 64, lines(34.0, 2.0));
    let at = |x: f32, y: f32| found[((2.0 - y) * 16.0) as usize * 64 + ((x + 2.0) * 16.0) as usize];
    for (x, y) in [(-1.0, 0.3), (0.3, 1.0), (-0.4, -1.0), (1.0, 0.2)] {
        assert!(at(x, y) > 0.8, "{x} {y}: {}", at(x, y));
    }
    for (x, y) in [(0.0, 0.0), (0.5, 0.5), (-0.3, 0.6), (1.2, 0.1)] {
        assert_eq!(at(x, y), 0.0, "{x} {y}");
    }
}

#[test]
fn a_line_hides_what_is_under_it_also_where_nothing_is() {
    let over = lines(50.0, 2.0);
    let [_, clear] = pictures(&spheres(&[([0.0; 3], 1.0)], None), &above(), &settings(64), over);
    let [_, solid] =
        pictures(&spheres(&[([0.0; 3], 1.0)], Some([0.0, 1.0, 0.0])), &above(), &settings(64), over);
    let mut faint = 0;
    for (clear, solid) in clear.color.iter().zip(&solid.color) {
        let [r, g, b, alpha] = *clear;
        for (channel, back) in [(r, 0.0), (g, 1.0), (b, 0.0)].into_iter().enumerate() {
            assert!((back.0 + back.1 * (1.0 - alpha) - solid[channel]).abs() < 1e-5, "{clear:?} {solid:?}");
        }
        faint += usize::from(alpha > 0.01 && alpha < 0.99);
    }
    assert!(faint > 50, "{faint}");
    assert_eq!(clear.color[32 * 64 + 47], [1.0, 0.0, 0.0, 1.0]);
    assert_eq!(clear.color[0], [0.0; 4]);
}

#[test]
fn a_part_of_a_drawn_picture_is_that_of_the_whole() {
    let (particles, radii) = particles(Law::Uniform, 60, &mut Random::new(3));
    let camera = Camera {
        eye: DVec3::new(0.3, -4.0, 0.7),
        look_at: DVec3::ZERO,
        up: DVec3::Z,
        projection: Projection::Perspective { vertical_angle: 0.7 },
    };
    let size = [300, 280];
    let settings = Settings { width: size[0], height: size[1], samples: 1, seed: 5, culling: Culling::Off };
    let mut scene = scene(&particles, &radii, Kind::default(), Lighting::Headlight);
    let segments: Vec<Segment> = (0..20)
        .map(|id| Segment { from: scene.structure().sphere(id).0, to: Vec3::ZERO, ends: [id, id + 1] })
        .collect();
    scene.bond(&segments, 0.05).unwrap();
    let halo = Some(Halo { width: 60.0, color: Some([0.2; 3]) });
    let over = Illustration { halo, depth_cue: Some(0.8), ..lines(12.0, 2.0) };
    let [before, whole] = pictures(&scene, &camera, &settings, over);
    assert!(differing_pixels(&before, &whole) > 1000);
    assert_eq!((&before.depth, &before.id), (&whole.depth, &whole.id));
    for (x, y, width, height) in [(250, 250, 20, 20), (0, 31, 300, 3), (101, 77, 1, 1)] {
        let window = Window { x, y, width, height };
        let mut part = before.part(window);
        over.draw((&scene, &camera), size, window, &mut part, &()).unwrap();
        assert_eq!(differing_pixels(&part, &whole.part(window)), 0, "{window:?}");
    }
}

#[test]
fn a_depth_cue_fades_in_proportion_to_the_depth() {
    // A ball that fills the picture: seen from z = 10 between 9 and 10 or so.
    let ball = [([0.0, 0.0, -19.0], 20.0)];
    let back = [0.0, 0.1, 0.9];
    for (background, depths) in
        [(Some(back), Some([8.5, 9.75])), (None, Some([8.5, 9.75])), (Some(back), None)]
    {
        let over = Illustration { depth_cue: Some(0.6), depths, ..Illustration::default() };
        let [before, after] = pictures(&spheres(&ball, background), &above(), &settings(64), over);
        let corner = before.depth[0];
        let [near, far] = depths.unwrap_or([9.0, corner]);
        for at in [0, 17, 64 * 20 + 40, 64 * 32 + 32] {
            let faded = 0.6 * ((before.depth[at] - near) / (far - near)).clamp(0.0, 1.0);
            let behind = background.map_or([0.0; 4], |[r, g, b]| [r, g, b, 1.0]);
            for ((before, after), behind) in before.color[at].into_iter().zip(after.color[at]).zip(behind) {
                let wanted = before * (1.0 - faded) + behind * faded;
                assert!((after - wanted).abs() < 5e-3, "{depths:?} {at}: {after} {wanted}");
            }
        }
        let alpha = match background {
            Some(_) => 1.0,
            None => 1.0 - 0.6 * ((corner - 8.5) / 1.25).min(1.0),
        };
        let tolerance = if background.is_some() { 0.0 } else { 5e-3 };
        assert!((after.color[0][3] - alpha).abs() <= tolerance, "{:?}", after.color[0]);
        assert!(background.is_none() || after.color.iter().all(|color| color[3] == 1.0));
    }
}

#[test]
fn a_halo_narrows_and_fades_as_its_formula_says() {
    // A sphere before a nearly flat ball, one behind its silhouette, of four that count; a halo of 0.4 of the four units that are the picture's rows.
    let scene = spheres(&[([0.0, 0.0, 0.0], 0.8), ([0.0, 0.0, -4001.0], 4000.0)], Some([1.0; 3]));
    let halo = Some(Halo { width: 100.0, color: Some(RED) });
    let over = Illustration { halo, depths: Some([8.0, 12.0]), ..Illustration::default() };
    let width = 100.0 / 1080.0 * 4.0;
    let [before, after] = pictures(&scene, &above(), &settings(96), over);
    let (mut partial, mut error) = (0, 0.0);
    for (at, (before, after)) in before.color.iter().zip(&after.color).enumerate() {
        let x = ((at % 96) as f32 + 0.5) / 24.0 - 2.0;
        let y = 2.0 - ((at / 96) as f32 + 0.5) / 24.0;
        let outside = x.hypot(y) - 0.8;
        let wanted = ((0.25 - (outside / width).powi(2)) / 0.2).clamp(0.0, 1.0);
        let found = 1.0 - after[1] / before[1];
        if outside < -0.04 {
            assert_eq!(found, 0.0, "{outside}");
        } else if outside > 0.04 {
            assert!((found - wanted).abs() < 0.2, "{outside}: {found} {wanted}");
            if found > 0.05 && found < 0.95 {
                (partial, error) = (partial + 1, error + found - wanted);
            }
        }
    }
    assert!(partial > 50 && error.abs() < 0.04 * partial as f32, "{partial} {error}");
    // In the background's color, or away, there is as much of it; what stands before nothing has none.
    for (background, color) in [(Some([1.0; 3]), None), (None, None)] {
        let scene = spheres(&[([0.0, 0.0, 0.0], 0.8)], background);
        let over = Illustration {
            halo: Some(Halo { width: 100.0, color }),
            depths: Some([8.0, 12.0]),
            ..Illustration::default()
        };
        let [before, after] = pictures(&scene, &above(), &settings(32), over);
        assert_eq!(differing_pixels(&before, &after), 0);
    }
}

#[test]
fn lines_fade_with_what_they_are_of() {
    let scene = spheres(&[([0.0; 3], 1.0)], Some([0.0, 0.0, 1.0]));
    // The silhouette is 10 away: halfway, so that a quarter of the line is background.
    let over = Illustration { depth_cue: Some(0.5), depths: Some([9.0, 11.0]), ..lines(50.0, 2.0) };
    let [_, after] = pictures(&scene, &above(), &settings(64), over);
    let found = after.color[32 * 64 + 47];
    for (channel, wanted) in [0.75, 0.0, 0.25, 1.0].into_iter().enumerate() {
        assert!((found[channel] - wanted).abs() < 0.05, "{found:?}");
    }
}

#[test]
fn what_cannot_be_drawn_is_refused() {
    let mut scene = spheres(&[([0.0; 3], 1.0)], None);
    let draw = |scene: &Scene, over: Illustration| {
        let window = Window::whole(8, 8);
        over.draw((scene, &above()), [8, 8], window, &mut Image::empty(8, 8, None), &())
    };
    assert!(draw(&scene, lines(1.0, 0.0)).is_ok());
    for (width, jump) in
        [(0.0, 1.0), (-1.0, 1.0), (101.0, 1.0), (f32::NAN, 1.0), (1.0, -1.0), (1.0, f32::INFINITY)]
    {
        assert!(draw(&scene, lines(width, jump)).is_err(), "{width} {jump}");
    }
    for over in [
        Illustration { halo: Some(Halo { width: 0.0, color: None }), ..lines(1.0, 0.0) },
        Illustration { depth_cue: Some(1.1), ..lines(1.0, 0.0) },
        Illustration { depth_cue: Some(0.5), depths: Some([2.0, 2.0]), ..Illustration::default() },
        Illustration { depth_cue: Some(0.5), depths: Some([f32::NAN, 2.0]), ..Illustration::default() },
    ] {
        assert!(draw(&scene, over).is_err(), "{over:?}");
    }
    let lens = Adjustments { lens: Some(Lens { radius: 0.1, focus: 1.0 }), ..Adjustments::default() };
    scene.lighting = Look::Matte.lighting([Vec3::X, Vec3::NEG_Y, Vec3::Z], &lens);
    assert!(draw(&scene, lines(1.0, 0.0)).is_err());
    assert!(draw(&scene, Illustration::default()).is_ok());
}
