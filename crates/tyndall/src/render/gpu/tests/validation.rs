//! What can be checked without a device: that every kernel is valid, and that records stand in memory as the shaders read them.

use std::mem::offset_of;

use wgpu::naga::{self, TypeInner, valid};

use super::super::build::Stage;
use super::super::layout;
use super::super::pages::declare;
use super::super::shader::{
    Colors, HeapWalk, Heaps, Sampling, Shape, Sizes, Tiling, Tilings, Walk, Walked, neighborhood,
};
use crate::structure::Packing;

const PACKINGS: [Packing; 4] = [Packing::Exact, Packing::Bits16, Packing::Bits11, Packing::Bits8];
const SIZES: [Sizes; 4] = [Sizes::Uniform, Sizes::Table, Sizes::Each, Sizes::Log];
const COLORS: [Colors; 3] = [Colors::Constant, Colors::Palette, Colors::Direct];

/// A scene's shape with so many pages an array.
pub(super) fn shape(packing: Packing, sizes: Sizes, colors: Colors, pages: usize) -> Shape {
    let arrays = arrays(&["nodes", "blocks", "sizes", "ids", "colors"], pages);
    Shape { walked: Walked::Bvh(packing, sizes), colors, hides: false, levels: 6, arrays }
}

/// The same where not all particles are shown.
fn hiding(shape: &Shape, pages: usize) -> Shape {
    let binding = 2 + shape.arrays.matches("@binding").count();
    let arrays = shape.arrays.clone() + &declare("shown", (1, binding), pages, 10);
    Shape { hides: true, arrays, ..shape.clone() }
}

/// Declares arrays of so many pages each.
fn arrays(names: &[&str], pages: usize) -> String {
    (2..).step_by(pages).zip(names).map(|(binding, name)| declare(name, (1, binding), pages, 10)).collect()
}

/// Scenes of k-d trees: one, and many under nodes.
fn shapes_of_heaps(walk: HeapWalk, colors: Colors, pages: usize) -> [Shape; 2] {
    let heaps = Heaps { upper_levels: 9, walk };
    let of_one = ["spheres", "heaps", "axes", "ids", "colors"];
    let of_many = ["spheres", "heaps", "axes", "ids", "nodes", "colors"];
    let shapes = [
        (Walked::Pkd(heaps), 4, arrays(&of_one, pages)),
        (Walked::Treelets(heaps), 6, arrays(&of_many, pages)),
    ];
    shapes.map(|(walked, levels, arrays)| Shape { walked, colors, hides: false, levels, arrays })
}

/// Parses and validates a shader. Panics with the place of what is wrong.
fn validate(text: &str) -> naga::Module {
    let module =
        naga::front::wgsl::parse_str(text).unwrap_or_else(|error| panic!("{}", error.emit_to_string(text)));
    let mut validator = valid::Validator::new(valid::ValidationFlags::all(), valid::Capabilities::empty());
    match validator.validate(&module) {
        Ok(_) => module,
        Err(error) => panic!("{}", error.emit_to_string(text)),
    }
}

#[test]
fn every_kernel_is_valid_for_every_layout() {
    let seconds = [Tiling { tile: [4, 4], split: 4, nodes: 8 }, Tiling { tile: [2, 2], split: 16, nodes: 8 }];
    for packing in PACKINGS {
        for sizes in SIZES {
            let shape = shape(packing, sizes, COLORS[sizes as usize % 3], 1 + sizes as usize % 2);
            validate(&shape.rays());
            let hiding = hiding(&shape, 1 + packing as usize % 2);
            validate(&hiding.rays());
            for (samples, perspective) in [(1, false), (4, true), (16, true)] {
                for second in seconds {
                    let tilings = Tilings { second, ..Tilings::of(samples, 0) };
                    let sampling = Sampling { samples, perspective, tilings };
                    for walk in [
                        Walk::First,
                        Walk::Second,
                        Walk::Noting,
                        Walk::Again,
                        Walk::Counted,
                        Walk::CountedAgain,
                    ] {
                        validate(&shape.tiles(sampling, walk));
                    }
                }
                let sampling = Sampling { samples, perspective, tilings: Tilings::of(samples, 0) };
                validate(&shape.shade(sampling));
                validate(&hiding.shade(sampling));
                validate(&hiding.tiles(sampling, Walk::First));
                validate(&hiding.tiles(sampling, Walk::Second));
            }
        }
    }
}

#[test]
fn every_kernel_of_the_build_is_valid_for_every_layout() {
    for (packing, sizes) in PACKINGS.into_iter().flat_map(|packing| SIZES.map(|sizes| (packing, sizes))) {
        for pages in [1, 3] {
            for stage in [Stage::Keys, Stage::Sort, Stage::Leaves, Stage::Tree] {
                validate(&stage.text(packing, sizes, std::iter::repeat((pages, 10))));
            }
        }
    }
}

#[test]
fn every_kernel_is_valid_for_every_walk_of_heaps() {
    for walk in [HeapWalk::ShortStack, HeapWalk::StackFree] {
        for (colors, pages) in COLORS.into_iter().zip(1..) {
            let shapes = shapes_of_heaps(walk, colors, pages);
            for shape in shapes.iter().flat_map(|shape| [shape.clone(), hiding(shape, pages)]) {
                validate(&shape.rays());
                for perspective in [false, true] {
                    let sampling = Sampling { samples: 4, perspective, tilings: Tilings::of(4, 0) };
                    validate(&shape.hits(sampling));
                    validate(&shape.shade(sampling));
                }
            }
        }
    }
}

#[test]
fn every_kernel_of_culling_by_confidence_is_valid() {
    validate(&neighborhood());
    for (packing, sizes) in PACKINGS.into_iter().zip(SIZES) {
        for pages in [1, 3] {
            let shape = shape(packing, sizes, Colors::Constant, pages);
            for (samples, perspective) in [(1, false), (4, true), (16, false)] {
                let sampling = Sampling { samples, perspective, tilings: Tilings::of(samples, 0) };
                validate(&(shape.culled(sampling) + &declare("voxels", (2, 4), pages, 10)));
            }
        }
    }
}

/// Name and offset of the members of a shader's record, and its size.
type Members = (Vec<(String, u32)>, u32);

/// What the shader declares under that name.
fn members(module: &naga::Module, name: &str) -> Members {
    let (_, declared) =
        module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some(name)).expect("the record is declared");
    let TypeInner::Struct { members, span } = &declared.inner else { panic!("{name} is no record") };
    let named = |member: &naga::StructMember| (member.name.clone().unwrap_or_default(), member.offset);
    (members.iter().map(named).collect(), *span)
}

/// What the library declares: the fields that are named, and the size.
macro_rules! record {
    ($record:ty: $($field:ident),+) => {
        (
            vec![$((stringify!($field).to_string(), offset_of!($record, $field) as u32)),+],
            size_of::<$record>() as u32,
        )
    };
}

#[test]
fn records_stand_where_the_shaders_read_them() {
    let shape = shape(Packing::Exact, Sizes::Table, Colors::Constant, 1);
    let sampling = Sampling { samples: 4, perspective: true, tilings: Tilings::of(4, 0) };
    let module = validate(&shape.shade(sampling));
    let view = record!(layout::View: eye, left, forward, top, right, pixel, up, unused);
    assert_eq!(members(&module, "View"), view);
    let pass = record!(layout::Pass: view, size, first_row, pattern_px, centered, is_first, lighting, unused, nearest, lights);
    assert_eq!(members(&module, "Pass"), pass);
    let bvh = record!(layout::Bvh: levels, radii, top, particles, slack, radius, radius_scale, unused_0, unused_1, unused_2);
    assert_eq!(members(&module, "Bvh"), bvh);
    let ray = record!(layout::RayRecord: origin, t_min, direction, t_max);
    assert_eq!(members(&validate(&shape.rays()), "Ray"), ray);
    let [_, treelets] = shapes_of_heaps(HeapWalk::default(), Colors::Constant, 1);
    let outline = record!(layout::Outline: particles, slack, radius_scale, unused);
    assert_eq!(members(&validate(&treelets.rays()), "Outline"), outline);
    let task = record!(layout::Task: low, inv_edge, giant, count, first, runs, bit, level, next_level, nodes);
    let keys = Stage::Keys.text(Packing::Exact, Sizes::Each, std::iter::repeat((1, 10)));
    assert_eq!(members(&validate(&keys), "Task"), task);
    let module = validate(&neighborhood());
    let estimate = record!(layout::Estimate: depth, confidence, next, unique);
    assert_eq!(members(&module, "Estimate"), estimate);
    assert_eq!(members(&module, "Pixel"), record!(layout::Pixel: accumulation, cull, clip, unchanged));
    let culling = record!(
        layout::Culling: low, unit, high, radius, edge, radius_sq, inv_edge, stride, voxels, first, samples, seed, is_new,
        convergence_samples, sample_budget, occlusion_confidence, depth_quantization, trilinear, up_to_depth, kernel, level,
        normal_limit, normal
    );
    assert_eq!(members(&module, "Culling"), culling);
    assert_eq!(members(&module, "Level"), record!(layout::Level: from_size, to_size));
}

#[test]
fn a_moved_member_is_seen_by_the_comparison() {
    let module = validate("struct Ray { origin: vec3f, direction: vec3f, t_min: f32, t_max: f32 }");
    let ray = record!(layout::RayRecord: origin, t_min, direction, t_max);
    assert_ne!(members(&module, "Ray"), ray);
}

#[test]
fn an_invalid_kernel_is_refused() {
    let shape = shape(Packing::Exact, Sizes::Uniform, Colors::Constant, 1);
    let broken = shape.rays().replace("t_far: f32", "t_far: u32");
    assert!(std::panic::catch_unwind(|| validate(&broken)).is_err());
}
