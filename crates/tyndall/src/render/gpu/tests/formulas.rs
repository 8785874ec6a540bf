//! Formulas that stand in Rust and in WGSL, asked the same on both machines, thousands of times.

use glam::{Vec3, Vec4};

use super::super::build::{self, CURVE_BITS, Order};
use super::super::layout;
use super::super::shader::{Sampling, Shape, Sizes, Tilings, Walked};
use super::super::{Gpu, Options, Resident};
use crate::math::{Ray, enter_sphere};
use crate::particles::{Attribute, Columns, Particles, Positions, Radii, Values};
use crate::random::Stream;
use crate::scene::Scene;
use crate::scene::camera::{Camera, Projection};
use crate::scene::color::ParticleColors;
use crate::scene::light::Lighting;
use crate::structure::selection::HalfSpace;
use crate::structure::{Kind, Packing, Structure};
use glam::DVec3;

const COUNT: usize = 4096;

pub(super) fn device() -> Option<Gpu> {
    match Gpu::open(Options { checked: true, ..Options::default() }) {
        Ok(gpu) => Some(gpu),
        Err(error) => {
            println!("skipped: no adapter ({error})");
            None
        }
    }
}

/// Particles in the unit cube with such radii, on the CPU.
pub(super) fn scene(packing: Packing, radius: impl Fn(&mut Stream) -> f32) -> Scene {
    let mut stream = Stream::new(11, 0);
    let mut columns: [Vec<f32>; 3] = Default::default();
    let mut radii = Vec::new();
    for _ in 0..1000 {
        columns.iter_mut().for_each(|column| column.push(stream.unit()));
        radii.push(radius(&mut stream));
    }
    let positions = Positions::from_offsets(DVec3::ZERO, columns);
    let attributes = vec![Attribute::new("radius", 1, Values::F32(radii))];
    let particles = Particles::new(Columns { positions, attributes, ..Columns::default() }).unwrap();
    let radii = Radii::PerParticle { attribute: 0, scale: 1.0 };
    let structure = Structure::build(Kind::Bvh(packing), particles, &radii, 1.0, &()).unwrap();
    Scene::new(structure, ParticleColors::constant([1.0; 3]), Lighting::Flat, None)
}

/// What an expression is on the card, of each of the inputs `a` to `d`.
fn evaluate(
    resident: &Resident,
    sampling: Sampling,
    expression: &str,
    inputs: &[[[f32; 4]; 4]],
) -> Vec<[f32; 4]> {
    evaluate_with("", resident, sampling, expression, inputs)
}

/// The same with more functions than those of a scene.
fn evaluate_with(
    functions: &str,
    resident: &Resident,
    sampling: Sampling,
    expression: &str,
    inputs: &[[[f32; 4]; 4]],
) -> Vec<[f32; 4]> {
    let kernel = format!(
        "struct Inputs {{ a: vec4f, b: vec4f, c: vec4f, d: vec4f }}
        @group(0) @binding(0) var<storage, read> inputs: array<Inputs>;
        @group(0) @binding(1) var<storage, read_write> outputs: array<vec4f>;
        fn value(a: vec4f, b: vec4f, c: vec4f, d: vec4f) -> vec4f {{ {expression} }}
        @compute @workgroup_size(64)
        fn evaluate(@builtin(global_invocation_id) thread: vec3u) {{
            if thread.x < arrayLength(&inputs) {{
                let each = inputs[thread.x];
                outputs[thread.x] = value(each.a, each.b, each.c, each.d);
            }}
        }}"
    );
    let text = resident.shape().formulas(sampling) + functions + &kernel;
    resident.evaluate(text, bytemuck::cast_slice(inputs), inputs.len(), None)
}

fn sampling(perspective: bool) -> Sampling {
    Sampling { samples: 1, perspective, tilings: Tilings::of(1, 0) }
}

#[test]
fn particles_have_the_keys_that_they_have_on_the_cpu() {
    let Some(gpu) = device() else { return };
    let scene = scene(Packing::Exact, |_| 0.01);
    let resident = Resident::load(&gpu, &scene, &()).unwrap();
    let mut stream = Stream::new(12, 0);
    let mut inputs = Vec::new();
    let mut expected = Vec::new();
    for k in 0..4 * COUNT {
        let scale = 10_f32.powf(stream.range(-12.0, 12.0));
        let inv_edge = if k % 100 == 0 { 0.0 } else { (1 << CURVE_BITS) as f32 / scale };
        let order = Order { low: scale * stream.cube(), inv_edge, giant: scale * stream.unit() };
        // Some lie outside of the lattice.
        let center = order.low + scale * 1.2 * (stream.cube() + 0.4);
        let radius = scale * 100.0 * stream.unit().powi(9);
        expected.push(order.key(center, radius));
        let low = order.low.extend(inv_edge);
        inputs
            .push([center.extend(radius), low, Vec4::splat(order.giant), Vec4::ZERO].map(|it| it.to_array()));
    }
    let text = "let key = key_of(a.xyz, a.w, b.xyz, b.w, c.x);
        return vec4f(vec4u(key.x & 0xffffu, key.x >> 16u, key.y & 0xffffu, key.y >> 16u));";
    let found = evaluate_with(&build::formulas(), &resident, sampling(false), text, &inputs);
    let key = |words: [f32; 4]| words.iter().rev().fold(0, |key, &word| key << 16 | word as u64);
    let differing =
        found.iter().zip(&expected).filter(|(found, expected)| key(**found) != **expected).count();
    let mut different = expected.clone();
    different.sort_unstable();
    different.dedup();
    assert!(different.len() > 3 * COUNT, "{} different keys", different.len());
    // A cell's edge may be passed by rounding.
    assert!(differing * 1000 <= expected.len(), "{differing} of {} differ", expected.len());
}

/// How many values differ by more than `tolerance`, relative to `scale`.
pub(super) fn differing(found: &[f32], expected: &[f32], tolerance: f32, scale: f32) -> usize {
    assert_eq!(found.len(), expected.len());
    let differs = |(a, b): &(&f32, &f32)| {
        let is_near = a == b || (*a - *b).abs() <= tolerance * scale;
        !is_near
    };
    found.iter().zip(expected).filter(differs).count()
}

#[test]
fn an_altered_value_is_seen_by_the_comparison() {
    assert_eq!(differing(&[1.0, 2.0], &[1.0, 2.0], 1e-6, 2.0), 0);
    assert_eq!(differing(&[1.0, 2.0], &[1.0, 2.001], 1e-6, 2.0), 1);
    assert_eq!(differing(&[1.0, f32::NAN], &[1.0, 2.0], 1e-6, 2.0), 1);
}

#[test]
fn rays_enter_spheres_where_they_do_on_the_cpu() {
    let Some(gpu) = device() else { return };
    let scene = scene(Packing::Exact, |_| 0.01);
    let resident = Resident::load(&gpu, &scene, &()).unwrap();
    let mut stream = Stream::new(5, 0);
    let mut inputs = Vec::new();
    let mut expected = Vec::new();
    for k in 0..COUNT {
        let (origin, center) = (4.0 * stream.cube(), stream.cube());
        let radius = 10_f32.powf(-3.0 * stream.unit());
        let aim = center + 1.3 * radius * stream.direction() * stream.unit();
        let t_max = if k % 3 == 0 { 3.0 } else { f32::MAX };
        let ray = Ray { origin, direction: (aim - origin).normalize(), t_min: 0.0, t_max };
        inputs.push(
            [origin.extend(0.0), ray.direction.extend(t_max), center.extend(radius), glam::Vec4::ZERO]
                .map(|it| it.to_array()),
        );
        expected.push(enter_sphere(&ray, center, radius));
    }
    let text = "return vec4f(enter_sphere(Ray(a.xyz, a.w, b.xyz, b.w), c.xyz, c.w), 0.0, 0.0, 0.0);";
    let found: Vec<f32> =
        evaluate(&resident, sampling(false), text, &inputs).iter().map(|it| it[0]).collect();
    // Where a ray grazes, rounding decides whether it enters at all, and moves where by the root of rounding.
    let entered = expected.iter().filter(|&&t| t < 100.0).count();
    assert!(entered > COUNT / 4, "{entered} rays enter");
    let strict = differing(&found, &expected, 1e-5, 4.0);
    let loose = differing(&found, &expected, 1e-3, 4.0);
    println!("{strict} of {COUNT} differ by more than 1e-5, {loose} by more than 1e-3");
    assert!(strict < COUNT / 100 && loose < COUNT / 500, "{strict}, {loose}");
}

#[test]
fn directions_are_inverted_as_on_the_cpu() {
    let Some(gpu) = device() else { return };
    let scene = scene(Packing::Exact, |_| 0.01);
    let resident = Resident::load(&gpu, &scene, &()).unwrap();
    let mut stream = Stream::new(6, 0);
    let directions: Vec<Vec3> = (0..COUNT)
        .map(|k| match k {
            0 => Vec3::X,
            1 => Vec3::new(0.0, -1.0, -0.0),
            2 => Vec3::new(1e-17, 1e-12, 1.0),
            _ => stream.direction(),
        })
        .collect();
    let inputs: Vec<_> =
        directions.iter().map(|it| [it.extend(0.0).to_array(), [0.0; 4], [0.0; 4], [0.0; 4]]).collect();
    let found = evaluate(&resident, sampling(false), "return vec4f(inv_direction(a.xyz), 0.0);", &inputs);
    for (direction, found) in directions.iter().zip(found) {
        let ray = Ray { origin: Vec3::ZERO, direction: *direction, t_min: 0.0, t_max: 1.0 };
        let expected = ray.inv_direction();
        for axis in 0..3 {
            // Both machines take zero for a small number of one sign or the other.
            let ratio = (found[axis] / expected[axis]).abs();
            assert!((ratio - 1.0).abs() < 1e-6, "{direction}: {found:?}, {expected}");
        }
    }
}

#[test]
fn particles_are_decoded_as_on_the_cpu() {
    let Some(gpu) = device() else { return };
    type RadiusOf = fn(&mut Stream) -> f32;
    let laws: [RadiusOf; 3] =
        [|_| 0.01, |stream| 0.01 * (1 + stream.below(5)) as f32, |stream| 0.1 * stream.unit().powi(5)];
    for packing in [Packing::Exact, Packing::Bits16, Packing::Bits11, Packing::Bits8] {
        for law in laws {
            let scene = scene(packing, law);
            let resident = Resident::load(&gpu, &scene, &()).unwrap();
            let structure = scene.structure();
            let inputs: Vec<_> = (0..structure.len())
                .map(|node| [[node as f32, 0.0, 0.0, 0.0], [0.0; 4], [0.0; 4], [0.0; 4]])
                .collect();
            let text = "let node = u32(a.x);
                return vec4f(center_of(node / 16u, node % 16u), radius_of(node / 16u, node % 16u));";
            let found = evaluate(&resident, sampling(false), text, &inputs);
            let ids = evaluate(
                &resident,
                sampling(false),
                "return vec4f(f32(id_of(u32(a.x))), 0.0, 0.0, 0.0);",
                &inputs,
            );
            for (node, found) in found.iter().enumerate() {
                let (center, radius) = structure.sphere(node as u32);
                assert_eq!([found[0], found[1], found[2]], center.to_array(), "{packing:?}, node {node}");
                assert!(
                    (found[3] - radius).abs() <= 1e-6 * radius,
                    "{packing:?}, node {node}: {} {radius}",
                    found[3]
                );
                assert_eq!(ids[node][0], structure.ids()[node] as f32);
            }
        }
    }
}

#[test]
fn what_is_shown_is_read_as_on_the_cpu() {
    let Some(gpu) = device() else { return };
    let mut scene = scene(Packing::Exact, |_| 0.01);
    scene.select(&[], &[HalfSpace { normal: DVec3::new(1.0, 0.5, -0.3), distance: 0.45 }]).unwrap();
    let resident = Resident::load(&gpu, &scene, &()).unwrap();
    let structure = scene.structure();
    let inputs: Vec<_> = (0..structure.len())
        .map(|node| [[node as f32, 0.0, 0.0, 0.0], [0.0; 4], [0.0; 4], [0.0; 4]])
        .collect();
    let text = "let node = u32(a.x);
        let four = select(vec4f(0.0), vec4f(1.0), shows_four(node & ~3u));
        let leaf = has_child(place_of(1u, node / 128u), (node / 16u) % 8u);
        return vec4f(select(0.0, 1.0, shows(node)), four[node & 3u], select(0.0, 1.0, leaf), 0.0);";
    let found = evaluate(&resident, sampling(false), text, &inputs);
    let (mut shown, mut leaves) = (0, 0);
    for (node, found) in (0_u32..).zip(&found) {
        let leaf = node / 16 * 16..(node / 16 * 16 + 16).min(structure.len() as u32);
        let expected =
            [structure.shows(node), structure.shows(node), leaf.clone().any(|it| structure.shows(it))];
        assert_eq!(found[..3], expected.map(|it| f32::from(u8::from(it))), "node {node}");
        shown += usize::from(expected[0]);
        leaves += usize::from(node == leaf.start && !expected[2]);
    }
    assert!((200..800).contains(&shown) && leaves > 3, "{shown} are shown, {leaves} leaves show none");
}

#[test]
fn boxes_of_children_hold_what_is_below_them() {
    let Some(gpu) = device() else { return };
    let scene = scene(Packing::Bits16, |stream| 0.05 * stream.unit());
    let resident = Resident::load(&gpu, &scene, &()).unwrap();
    let structure = scene.structure();
    let eye = Vec3::new(0.3, -2.0, 0.7);
    let leaves = structure.len().div_ceil(16);
    let inputs: Vec<_> =
        (0..leaves).map(|leaf| [eye.extend(leaf as f32).to_array(), [0.0; 4], [0.0; 4], [0.0; 4]]).collect();
    let of = |field: &str| {
        let text = format!(
            "let leaf = u32(a.w);
            let bounds = child_box(node_at(place_of(1u, leaf / 8u)), leaf % 8u, a.xyz, 0.0);
            return vec4f(bounds.{field}, f32(children_of(place_of(1u, leaf / 8u))));"
        );
        evaluate(&resident, sampling(false), &text, &inputs)
    };
    let (middle, half) = (of("middle"), of("half"));
    for leaf in 0..leaves {
        let [middle, half] = [middle[leaf], half[leaf]].map(|it| Vec3::new(it[0], it[1], it[2]));
        for node in 16 * leaf..(16 * leaf + 16).min(structure.len()) {
            let (center, radius) = structure.sphere(node as u32);
            let off = (center - eye - middle).abs() + radius;
            assert!(off.cmple(half + 1e-6).all(), "leaf {leaf}: {off} {half}");
        }
        // Not too large either: a step of 1/255 of a node's extent more on each side.
        assert!(half.max_element() < 0.5, "{half}");
    }
    let last = of("half")[leaves - 1][3] as usize;
    assert_eq!(last, (leaves - 1) % 8 + 1, "children of the last node");
}

/// Cameras of both kinds, by number.
pub(super) fn camera(number: usize, stream: &mut Stream) -> Camera {
    let projection = if number.is_multiple_of(2) {
        Projection::Perspective { vertical_angle: 0.2 + f64::from(stream.unit()) }
    } else {
        Projection::Orthographic { height: 0.5 + f64::from(stream.unit()) }
    };
    let eye = 3.0 * stream.direction().as_dvec3();
    Camera { eye, look_at: 0.2 * stream.cube().as_dvec3(), up: DVec3::Z, projection }
}

/// How the shaders are told of a view.
pub(super) fn written(view: &layout::View) -> String {
    let vector = |v: [f32; 3]| format!("vec3f({:?}, {:?}, {:?})", v[0], v[1], v[2]);
    format!(
        "View({}, {:?}, {}, {:?}, {}, {:?}, {}, 0.0)",
        vector(view.eye),
        view.left,
        vector(view.forward),
        view.top,
        vector(view.right),
        view.pixel,
        vector(view.up)
    )
}

#[test]
fn rays_leave_the_camera_as_on_the_cpu() {
    let Some(gpu) = device() else { return };
    let scene = scene(Packing::Exact, |_| 0.01);
    let resident = Resident::load(&gpu, &scene, &()).unwrap();
    let mut stream = Stream::new(8, 0);
    for number in 0..6 {
        let view = camera(number, &mut stream).view(DVec3::ZERO, 320, 200).unwrap();
        let points: Vec<[f32; 2]> =
            (0..COUNT).map(|_| [320.0 * stream.unit(), 200.0 * stream.unit()]).collect();
        let inputs: Vec<_> =
            points.iter().map(|&[x, y]| [[x, y, 0.0, 0.0], [0.0; 4], [0.0; 4], [0.0; 4]]).collect();
        let of = |field: &str| {
            let text = format!(
                "return vec4f(view_ray({}, a.x, a.y).{field}, 0.0);",
                written(&layout::View::of(&view))
            );
            evaluate(&resident, sampling(view.perspective), &text, &inputs)
        };
        let (origins, directions) = (of("origin"), of("direction"));
        for (k, &[x, y]) in points.iter().enumerate() {
            let ray = view.ray(x, y);
            let near = |found: [f32; 4], expected: Vec3| {
                differing(&found[..3], &expected.to_array(), 1e-6, 4.0) == 0
            };
            assert!(
                near(origins[k], ray.origin) && near(directions[k], ray.direction),
                "camera {number}, {x} {y}"
            );
        }
    }
}

#[test]
fn a_projected_sphere_covers_every_pixel_whose_ray_enters_it() {
    let Some(gpu) = device() else { return };
    let scene = scene(Packing::Exact, |_| 0.01);
    let resident = Resident::load(&gpu, &scene, &()).unwrap();
    let mut stream = Stream::new(9, 0);
    let mut entered = 0;
    for number in 0..8 {
        let view = camera(number, &mut stream).view(DVec3::ZERO, 320, 200).unwrap();
        let corner = [8 * stream.below(40), 8 * stream.below(25)];
        let mut rays = Vec::new();
        let inputs: Vec<_> = (0..COUNT)
            .map(|_| {
                let [x, y] = corner.map(|at| at as f32 + 8.0 * stream.unit());
                let ray = view.ray(x, y);
                let radius = 0.1 * stream.unit();
                let center =
                    ray.origin + (1.0 + 3.0 * stream.unit()) * ray.direction + radius * stream.direction();
                let t = enter_sphere(&ray, center, radius);
                rays.push((x - corner[0] as f32 - 4.0, y - corner[1] as f32 - 4.0, t));
                [center.extend(radius).to_array(), [0.0; 4], [0.0; 4], [0.0; 4]]
            })
            .collect();
        let of = |value: &str| {
            let text = format!(
                "let view = {};
                let beam = beam_of(view, vec2f({}.0, {}.0), vec2f(8.0));
                let from_eye = a.xyz - view.eye;
                let ball = project(view, beam, from_eye, reach_of_ball(view, beam, grown(a.w, from_eye, beam.spread)));
                let cube = project(view, beam, from_eye, reach_of_box(view, beam, vec3f(a.w * 1.00001)));
                return {value};",
                written(&layout::View::of(&view)),
                corner[0],
                corner[1]
            );
            evaluate(&resident, sampling(view.perspective), &text, &inputs)
        };
        for shape in ["ball", "cube"] {
            let across = of(&format!("vec4f({shape}.low, {shape}.high)"));
            let depths =
                of(&format!("vec4f({shape}.near, {shape}.far, f32(quads_of({shape}, vec2f(4.0))), 0.0)"));
            for (k, &(x, y, t)) in rays.iter().enumerate() {
                if t == f32::INFINITY {
                    continue;
                }
                entered += 1;
                let ([low_x, low_y, high_x, high_y], [near, far, quads, _]) = (across[k], depths[k]);
                let is_inside = low_x <= x && x <= high_x && low_y <= y && y <= high_y;
                let quad = u32::from(x > 0.0) + 2 * u32::from(y > 0.0);
                assert!(
                    is_inside && near <= t + 1e-5 && far > 0.0 && quads as u32 >> quad & 1 == 1,
                    "camera {number}, {shape} {k}: {x} {y} {t}, {:?} {:?}",
                    across[k],
                    depths[k]
                );
            }
        }
    }
    assert!(entered > COUNT, "{entered} rays enter");
}

#[test]
fn a_scene_of_a_shape_has_the_kernels_of_that_shape() {
    let Some(gpu) = device() else { return };
    let scene = scene(Packing::Bits8, |stream| stream.unit());
    let resident = Resident::load(&gpu, &scene, &()).unwrap();
    let Shape { walked, levels, .. } = resident.shape();
    assert_eq!((*walked, *levels), (Walked::Bvh(Packing::Bits8, Sizes::Log), 4));
}
