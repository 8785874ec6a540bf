//! The texts of the kernels that build: four stages, each with its arrays.

use std::fmt::Write;

use super::super::pages::{declare, declare_elements, declare_words};
use super::super::shader::{BVH, Colors, MATH, SHOWN, Shape, Sizes, Walked};
use super::order::{CLASSES, CURVE_BITS};
use crate::structure::Packing;

const ENCODE: &str = include_str!("encode.wgsl");
const TASK: &str = include_str!("task.wgsl");
const KEYS: &str = include_str!("keys.wgsl");
const SORT: &str = include_str!("sort.wgsl");
const LEAVES: &str = include_str!("leaves.wgsl");
const TREE: &str = include_str!("tree.wgsl");

/// How often a workgroup of 256 threads takes a record each.
pub(super) const ROUNDS: u32 = 16;

/// Kernels with the same arrays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::render::gpu) enum Stage {
    Keys,
    Sort,
    Leaves,
    Tree,
}

/// What a stage does with an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Access {
    /// Reads elements.
    Read,
    /// Writes elements, and may read them.
    Elements,
    /// Writes words.
    Words,
}

impl Stage {
    /// Names of the arrays, in the order of their bindings.
    pub(super) fn arrays(self) -> &'static [(&'static str, Access)] {
        use Access::{Elements, Read, Words};
        match self {
            Self::Keys => &[("xs", Read), ("ys", Read), ("zs", Read), ("radii", Read), ("records", Elements)],
            Self::Sort => &[("sorted", Read), ("records", Elements)],
            Self::Leaves => &[
                ("sorted", Read),
                ("xs", Read),
                ("ys", Read),
                ("zs", Read),
                ("table", Read),
                ("blocks", Words),
                ("sizes", Words),
                ("ids", Words),
            ],
            Self::Tree => {
                &[("nodes", Elements), ("blocks", Read), ("sizes", Read), ("ids", Read), ("boxes", Elements)]
            }
        }
    }

    /// The text of its kernels; `pages` says of each array how many pages it has, and their shift.
    pub(in crate::render::gpu) fn text(
        self,
        packing: Packing,
        sizes: Sizes,
        pages: impl Iterator<Item = (usize, u32)>,
    ) -> String {
        let mut arrays = String::new();
        // The first binding is the outline of the hierarchy.
        let mut binding = 1;
        for (&(name, access), (count, shift)) in self.arrays().iter().zip(pages) {
            arrays += &match access {
                Access::Read => declare(name, (1, binding), count, shift),
                Access::Elements => declare_elements(name, binding, count, shift),
                Access::Words => declare_words(name, binding, count, shift),
            };
            binding += count;
        }
        let walked = Walked::Bvh(packing, sizes);
        let shape = Shape { walked, colors: Colors::Constant, hides: false, levels: 4, arrays };
        let numbers = &numbers(packing);
        match self {
            Self::Keys => shape.build(&[numbers, MATH, ENCODE, TASK, KEYS]),
            Self::Sort => shape.build(&[numbers, TASK, SORT]),
            Self::Leaves => shape.build(&[numbers, MATH, ENCODE, TASK, LEAVES]),
            Self::Tree => shape.build(&[numbers, MATH, SHOWN, BVH, ENCODE, TASK, TREE]),
        }
    }
}

/// The formulas alone, for tests.
#[cfg(test)]
pub(in crate::render::gpu) fn formulas() -> String {
    numbers(Packing::Exact) + ENCODE
}

/// What the texts have from here.
fn numbers(packing: Packing) -> String {
    let most = match packing {
        Packing::Exact => [0; 3],
        Packing::Bits16 => [0xffff; 3],
        Packing::Bits11 => [0x7ff, 0x7ff, 0x3ff],
        Packing::Bits8 => [0xff; 3],
    };
    let [x, y, z] = most;
    let mut text = String::new();
    for (name, value) in [
        ("CURVE_BITS", CURVE_BITS),
        ("CLASSES", CLASSES),
        ("ROUNDS", ROUNDS),
        ("NAN_BITS", f32::NAN.to_bits()),
    ] {
        // Writing to a string cannot fail.
        _ = writeln!(text, "const {name}: u32 = {value}u;");
    }
    _ = writeln!(text, "const PACKED_MOST = vec3f({x}.0, {y}.0, {z}.0);");
    text + "// The least positive number that is not flushed to zero.\nconst LEAST_RATIO: f32 = 0x1p-126f;\n"
}
