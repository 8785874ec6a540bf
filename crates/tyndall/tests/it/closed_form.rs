//! Pictures whose values are known beforehand.

use std::f32::consts::PI;

use tyndall::particles::{Columns, Particles, Positions, Radii};
use tyndall::render::{Culling, Settings, render};
use tyndall::scene::Scene;
use tyndall::scene::camera::{Camera, Projection};
use tyndall::scene::color::ParticleColors;
use tyndall::scene::light::{KeyLight, Lighting, Sky};
use tyndall::structure::{Kind, Structure};
use tyndall::{DVec3, Image, Vec3};

/// Renders spheres (center, radius 1 unless told) seen along -z from z = 10, orthographic, four units high.
fn picture(centers: &[DVec3], radius: f32, lighting: Lighting, samples: u32) -> Image {
    let mut positions = Positions::around(DVec3::ZERO);
    positions.extend(centers);
    let particles = Particles::new(Columns { positions, ..Columns::default() }).unwrap();
    let radii = Radii::Uniform(radius);
    let structure = Structure::build(Kind::default(), particles, &radii, 1.0, &()).unwrap();
    let colors = ParticleColors::constant([1.0, 0.5, 0.25]);
    let scene = Scene::new(structure, colors, lighting, None);
    let camera = Camera {
        eye: DVec3::new(0.0, 0.0, 10.0),
        look_at: DVec3::ZERO,
        up: DVec3::Y,
        projection: Projection::Orthographic { height: 4.0 },
    };
    render(&scene, &camera, &Settings { width: 64, height: 64, samples, seed: 1, culling: Culling::Off }, &())
        .unwrap()
}

fn pixel(x: f32, y: f32) -> usize {
    let at = |u: f32| ((u / 4.0 + 0.5) * 64.0) as usize;
    at(-y) * 64 + at(x)
}

#[test]
fn a_sphere_covers_its_disc_and_is_as_bright_as_its_cosine() {
    let image = picture(&[DVec3::ZERO], 1.0, Lighting::Headlight, 64);
    let pixel_area = (4.0_f32 / 64.0).powi(2);
    let area = pixel_area * image.color.iter().map(|color| color[3]).sum::<f32>();
    assert!((area - PI).abs() < 0.003, "area {area}");
    // The cosine over the disc of a sphere integrates to two thirds of its area.
    let light = pixel_area * image.color.iter().map(|color| color[0]).sum::<f32>();
    assert!((light - PI * 2.0 / 3.0).abs() < 0.003, "light {light}");
    let middle = image.color[pixel(0.01, 0.01)];
    assert!((middle[1] / middle[0] - 0.5).abs() < 1e-6 && middle[3] == 1.0);
}

#[test]
fn light_in_levels_has_as_much_of_each_as_the_sphere_faces_it() {
    // From the side: what faces the light within 60 degrees is a segment of the disc beyond half its radius; half of the disc is away from it.
    let image = picture(&[DVec3::ZERO], 1.0, Lighting::Toon { toward: Vec3::X }, 64);
    let pixel_area = (4.0_f32 / 64.0).powi(2);
    let light = pixel_area * image.color.iter().map(|color| color[0]).sum::<f32>();
    let segment = PI / 3.0 - 3.0_f32.sqrt() / 4.0;
    let exact = segment + 0.6 * (0.5 * PI - segment) + 0.3 * 0.5 * PI;
    assert!((light - exact).abs() < 0.004, "{light} {exact}");
    for (x, level) in [(0.8, 1.0), (0.25, 0.6), (-0.25, 0.3), (-0.8, 0.3)] {
        assert_eq!(image.color[pixel(x, 0.1)], [level, 0.5 * level, 0.25 * level, 1.0], "{x}");
    }
    // Edges between levels are smooth.
    let between = image.color[pixel(0.5, 0.1)][0];
    assert!(between > 0.6 && between <= 1.0 && image.color[pixel(0.001, 0.1)][0] < 1.0);
}

#[test]
fn depth_is_the_distance_from_the_plane_through_the_eye() {
    let image = picture(&[DVec3::ZERO], 1.0, Lighting::Flat, 1);
    for y in 0..64 {
        for x in 0..64 {
            let [u, v] = [x, y].map(|k| (k as f32 + 0.5) / 16.0 - 2.0);
            let half_chord_sq = 1.0 - u * u - v * v;
            let at = y * 64 + x;
            if half_chord_sq > 0.0 {
                assert!((image.depth[at] - (10.0 - half_chord_sq.sqrt())).abs() < 1e-5);
                assert_eq!((image.id[at], image.color[at]), (0, [1.0, 0.5, 0.25, 1.0]));
            } else {
                assert_eq!((image.depth[at], image.id[at], image.color[at]), (f32::INFINITY, -1, [0.0; 4]));
            }
        }
    }
}

#[test]
fn under_an_even_sky_a_lone_sphere_is_as_bright_as_the_sky() {
    let key = KeyLight { toward: Vec3::Z, angular_radius: 0.01, strength: 0.0 };
    let sky = Sky { zenith: 0.6, ground: 0.6, up: Vec3::Y };
    let image = picture(&[DVec3::ZERO], 1.0, Lighting::Studio(key, sky), 256);
    for at in [pixel(0.0, 0.0), pixel(0.5, 0.3), pixel(-0.6, -0.5)] {
        assert!((image.color[at][0] - 0.6).abs() < 0.03, "{:?}", image.color[at]);
    }
}

#[test]
fn a_sphere_shadows_what_lies_behind_it_and_nothing_else() {
    // Light along +x: the left sphere lies wholly in the shadow of the right one, of equal size.
    let key = KeyLight { toward: Vec3::X, angular_radius: 0.001, strength: 1.0 };
    let sky = Sky { zenith: 0.0, ground: 0.0, up: Vec3::Y };
    let centers = [DVec3::new(-1.0, 0.0, 0.0), DVec3::new(1.0, 0.0, 0.0)];
    let image = picture(&centers, 0.5, Lighting::Studio(key, sky), 16);
    let brightness = |x: f32, y: f32| image.color[pixel(x, y)][0];
    assert!(brightness(-0.7, 0.1) < 1e-3, "{}", brightness(-0.7, 0.1));
    assert!((brightness(1.3, 0.0) - 0.6).abs() < 0.1, "{}", brightness(1.3, 0.0));
    assert_eq!(brightness(0.7, 0.0), 0.0, "the side away from the light");
}

/// Edge of a pixel of [`picture`].
const PIXEL: f64 = 4.0 / 64.0;

#[test]
fn particles_smaller_than_pixels_make_no_moire() {
    // A lattice a little finer than the pixels, over all of the picture: everywhere as much is covered.
    let spacing = 0.9 * PIXEL;
    let place = |k: i32| spacing * f64::from(k);
    let centers: Vec<DVec3> =
        (-37..=37).flat_map(|i| (-37..=37).map(move |j| DVec3::new(place(i), place(j), 0.0))).collect();
    // How far off blocks of 8 x 8 pixels are at most, over what is right.
    let most_off = |samples| {
        let image = picture(&centers, 0.4 * spacing as f32, Lighting::Flat, samples);
        let blocks = (0..64).map(|block| {
            let corner = block / 8 * 8 * 64 + block % 8 * 8;
            let pixels = (0..64).map(|it| image.color[corner + it / 8 * 64 + it % 8][3]);
            pixels.sum::<f32>() / 64.0 / (PI * 0.4 * 0.4)
        });
        blocks.map(|it| (it - 1.0).abs()).fold(0.0, f32::max)
    };
    // A block is no whole number of cells, so that even without any sampling it is off by up to 4 %.
    let (sampled, centers_alone) = (most_off(64), most_off(1));
    assert!(sampled < 0.06 && centers_alone > 0.2, "{sampled} {centers_alone}");
}

#[test]
fn a_particle_smaller_than_a_pixel_does_not_sparkle_as_it_moves() {
    let radius = 0.2 * PIXEL;
    let seen = |step: usize, samples| {
        let center = DVec3::new(0.31 * PIXEL * step as f64, 0.17 * PIXEL * step as f64, 0.0);
        let image = picture(&[center], radius as f32, Lighting::Flat, samples);
        image.color.iter().map(|color| color[3]).sum::<f32>() / (PI * 0.2 * 0.2)
    };
    let spread = |samples| {
        let seen: Vec<f32> = (0..24).map(|step| seen(step, samples)).collect();
        let mean = seen.iter().sum::<f32>() / seen.len() as f32;
        let square = seen.iter().map(|it| (it - mean).powi(2)).sum::<f32>() / seen.len() as f32;
        (mean, square.sqrt())
    };
    let (mean, sampled) = spread(64);
    assert!((mean - 1.0).abs() < 0.05 && sampled < 0.15, "{mean} {sampled}");
    assert!(spread(1).1 > 1.0);
}
