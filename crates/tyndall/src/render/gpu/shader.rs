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
const FIRST: &str = include_str!("first.wgsl");
const SECOND: &str = include_str!("second.wgsl");
const TILES: &str = include_str!("tiles.wgsl");
const SHADE: &str = include_str!("shade.wgsl");
const RAYS: &str = include_str!("rays.wgsl");
const INTERSECT: &str = include_str!("intersect.wgsl");

/// What a workgroup of the tile sample buffer is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Tiling {
    /// Pixels of a tile, across and down; powers of two.
    pub tile: [u32; 2],
    /// Threads of a pixel: 1, 4 or 16. Where it has fewer samples, the others help to walk.
    pub split: u32,
    /// Nodes whose children are tested at once, at most an eighth of the threads.
    pub nodes: u32,
}

impl Tiling {
    /// Threads of a workgroup.
    pub fn threads(&self) -> u32 {
        self.tile[0] * self.tile[1] * self.split
    }
}

/// From so many particles on a tile of a picture of usual size holds many.
const MANY: usize = 20_000_000;

/// How the tile sample buffer is walked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Tilings {
    /// The tiles of a picture.
    pub first: Tiling,
    /// After so many steps a tile is laid aside, and goes on in parts, so that nobody waits for a single one; 0: never.
    pub patience: u32,
    /// The parts of what was laid aside: no larger than a tile.
    pub second: Tiling,
}

impl Tilings {
    /// What was fastest on an H200, by samples a pixel and particles. Where many particles lie in a tile, smaller tiles of more threads win,
    /// though with few samples a thread.
    pub fn of(samples: u32, particles: usize) -> Self {
        let first = match (samples, particles) {
            (16.., _) | (4.., MANY..) => Tiling { tile: [8, 4], split: 4, nodes: 8 },
            _ => Tiling { tile: [8, 8], split: 1, nodes: 4 },
        };
        Self { first, patience: 96, second: Tiling { tile: [4, 4], split: 4, nodes: 8 } }
    }

    /// How many parts a tile has, across and down.
    pub(super) fn parts(&self) -> [u32; 2] {
        [0, 1].map(|axis| (self.first.tile[axis] / self.second.tile[axis]).max(1))
    }
}

/// What a walk begins with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Walk {
    /// The root, for every tile; some are laid aside.
    First,
    /// What the first walk has found, for parts of what was laid aside.
    Second,
    /// As the first, to the end; tells what it did instead of what it found.
    Counted,
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
    pub(super) tilings: Tilings,
}

/// How many tiles can be laid aside at one time: as many as a dispatch may have workgroups.
pub(super) const MOST_ASIDE: u32 = 65535;

impl Shape {
    /// The kernel of the tile sample buffer.
    pub(super) fn tiles(&self, sampling: Sampling, walk: Walk) -> String {
        let Sampling { samples, tilings, .. } = sampling;
        let mut head = self.head(sampling);
        let tiling = if walk == Walk::Second { tilings.second } else { tilings.first };
        let own_samples = (samples / tiling.split).max(1);
        let lanes = if own_samples == 1 { LANES1 } else { LANES4 };
        let [across, down] = tilings.parts();
        let patience = if walk == Walk::First { tilings.patience } else { 0 };
        let threads = tiling.threads();
        let nodes = tiling.nodes.min(threads / 8);
        for (name, value) in [
            ("TILE_W", tiling.tile[0]),
            ("TILE_H", tiling.tile[1]),
            ("SPLIT", tiling.split),
            ("THREADS", threads),
            ("OWN_SAMPLES", own_samples),
            // Vectors of samples that a thread has.
            ("GROUPS", own_samples.div_ceil(4)),
            ("NODES", nodes),
            ("LEAVES", threads / 16),
            // At most the children of the nodes of one step lie on the stack, of each level.
            ("STACK", 8 * nodes * self.levels + 1),
            ("PATIENCE", patience),
            ("MOST_ASIDE", MOST_ASIDE),
            ("PARTS_ACROSS", across),
            ("PARTS_DOWN", down),
        ] {
            head += &format!("const {name}: u32 = {value}u;\n");
        }
        head += &format!("const IS_SECOND: bool = {};\n", walk == Walk::Second);
        head += &format!("const COUNTED: bool = {};\n", walk == Walk::Counted);
        let begin = if walk == Walk::Second { SECOND } else { FIRST };
        head + &[MATH, BVH, CAMERA, PASS, lanes, BEAM, begin, TILES].join("\n")
    }

    /// The kernels that light the samples.
    pub(super) fn shade(&self, sampling: Sampling) -> String {
        self.head(sampling) + &[MATH, BVH, CAMERA, PASS, RAYS, SHADE].join("\n")
    }

    /// The kernel of single rays.
    pub(super) fn rays(&self) -> String {
        // They depend on no picture.
        let sampling = Sampling { samples: 1, perspective: false, tilings: Tilings::of(1, 0) };
        self.head(sampling) + &[MATH, BVH, RAYS, INTERSECT].join("\n")
    }

    /// The formulas without any kernel.
    #[cfg(test)]
    pub(super) fn formulas(&self, sampling: Sampling) -> String {
        self.head(sampling) + &[MATH, BVH, CAMERA, BEAM, ""].join("\n")
    }

    fn head(&self, sampling: Sampling) -> String {
        let Sampling { samples, perspective, .. } = sampling;
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
