//! Joins the WGSL files to the text of a kernel, behind a head with what depends on scene, picture and device.
//!
//! What depends on these stands in constants, not in `override`s: sizes of private arrays and types depend on it.

use std::fmt::Write;

use super::layout;
use crate::math::HIT_ROUNDING;
use crate::structure::Packing;

const MATH: &str = include_str!("math.wgsl");
const BVH: &str = include_str!("bvh.wgsl");
const CAMERA: &str = include_str!("camera.wgsl");
const PASS: &str = include_str!("pass.wgsl");
const LANES1: &str = include_str!("lanes1.wgsl");
const LANES4: &str = include_str!("lanes4.wgsl");
const BEAM: &str = include_str!("beam.wgsl");
const TILES: &str = include_str!("tiles.wgsl");
const SHADE: &str = include_str!("shade.wgsl");
const RAYS: &str = include_str!("rays.wgsl");
const INTERSECT: &str = include_str!("intersect.wgsl");

/// What a workgroup of the tile sample buffer is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Tiling {
    /// Pixels of a tile, across and down; powers of two.
    pub tile: [u32; 2],
    /// Threads that share a pixel's samples: 1, 4 or 16, no more than there are samples.
    pub split: u32,
    /// Nodes whose children are tested at once, at most an eighth of the threads.
    pub nodes: u32,
}

impl Tiling {
    /// Threads of a workgroup.
    pub fn threads(&self) -> u32 {
        self.tile[0] * self.tile[1] * self.split
    }

    /// The same for so many samples.
    pub(super) fn of(self, samples: u32) -> Self {
        Self { split: self.split.min(samples), ..self }
    }
}

impl Default for Tiling {
    fn default() -> Self {
        Self { tile: [8, 8], split: 1, nodes: 8 }
    }
}

/// How a scene's arrays are laid out.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Shape {
    pub(super) packing: Packing,
    pub(super) sizes: Sizes,
    pub(super) colors: Colors,
    /// More levels than the hierarchy has.
    pub(super) levels: u32,
    /// Declarations of the functions that read the arrays.
    pub(super) arrays: String,
}

/// How radii are held: see `structure::bvh`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Sizes {
    Uniform,
    Table,
    Each,
    Log,
}

/// How colors are held: see `scene::color`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Colors {
    Constant,
    Palette,
    Direct,
}

/// What of a picture a kernel depends on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sampling {
    /// 16, 4 or 1 a pixel.
    pub(super) samples: u32,
    pub(super) perspective: bool,
    pub(super) tiling: Tiling,
}

impl Shape {
    /// The kernel of the tile sample buffer.
    pub(super) fn tiles(&self, sampling: Sampling) -> String {
        let lanes = if sampling.samples / sampling.tiling.split == 1 { LANES1 } else { LANES4 };
        self.head(sampling) + &[MATH, BVH, CAMERA, PASS, lanes, BEAM, TILES].join("\n")
    }

    /// The kernels that light the samples.
    pub(super) fn shade(&self, sampling: Sampling) -> String {
        self.head(sampling) + &[MATH, BVH, CAMERA, PASS, RAYS, SHADE].join("\n")
    }

    /// The kernel of single rays.
    pub(super) fn rays(&self) -> String {
        self.formulas() + &[RAYS, INTERSECT].join("\n")
    }

    /// The formulas without any kernel.
    pub(super) fn formulas(&self) -> String {
        let sampling = Sampling { samples: 1, perspective: false, tiling: Tiling::default() };
        self.head(sampling) + &[MATH, BVH, ""].join("\n")
    }

    fn head(&self, sampling: Sampling) -> String {
        let Sampling { samples, perspective, tiling } = sampling;
        let mut head = String::new();
        let mut number = |name: &str, value: u32| {
            // Writing to a string cannot fail.
            _ = writeln!(head, "const {name}: u32 = {value}u;");
        };
        let [exact, bits16, bits11, bits8] =
            [Packing::Exact, Packing::Bits16, Packing::Bits11, Packing::Bits8].map(|it| it as u32);
        number("PACKING", self.packing as u32);
        number("PACKING_EXACT", exact);
        number("PACKING_16", bits16);
        number("PACKING_11", bits11);
        number("PACKING_8", bits8);
        number("BLOCK", block_elements(self.packing));
        number("SIZES", self.sizes as u32);
        number("SIZES_UNIFORM", Sizes::Uniform as u32);
        number("SIZES_TABLE", Sizes::Table as u32);
        number("SIZES_EACH", Sizes::Each as u32);
        number("SIZES_LOG", Sizes::Log as u32);
        number("COLORS", self.colors as u32);
        number("COLORS_PALETTE", Colors::Palette as u32);
        number("COLORS_DIRECT", Colors::Direct as u32);
        number("HEADLIGHT", layout::HEADLIGHT);
        number("NONE", layout::NONE);
        number("LEVELS", self.levels);
        number("SAMPLES", samples);
        number("TILE_W", tiling.tile[0]);
        number("TILE_H", tiling.tile[1]);
        number("SPLIT", tiling.split);
        number("THREADS", tiling.threads());
        // Vectors of samples that a thread has.
        number("GROUPS", (samples / tiling.split).div_ceil(4));
        number("NODES", tiling.nodes);
        number("LEAVES", tiling.threads() / 16);
        // At most the children of the nodes of one step lie on the stack, of each level.
        number("STACK", 8 * tiling.nodes * self.levels + 1);
        _ = writeln!(head, "const PERSPECTIVE: bool = {perspective};");
        _ = writeln!(head, "const HIT_ROUNDING: f32 = {HIT_ROUNDING:e};");
        head + &self.arrays
    }
}

/// Elements of sixteen bytes in a leaf's block.
pub(super) fn block_elements(packing: Packing) -> u32 {
    match packing {
        Packing::Exact => 12,
        Packing::Bits16 => 7,
        Packing::Bits11 => 5,
        Packing::Bits8 => 4,
    }
}
