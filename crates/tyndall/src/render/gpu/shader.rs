//! Joins the WGSL files to the text of a kernel, behind a head with what depends on scene, picture and device.
//!
//! What depends on these stands in constants, not in `override`s: sizes of private arrays and types depend on it.

use std::fmt::Write;

use super::layout;
use crate::math::HIT_ROUNDING;
use crate::render::confidence::GAUSSIAN_STEPS;
use crate::structure::Packing;

pub(super) const MATH: &str = include_str!("math.wgsl");
pub(super) const BVH: &str = include_str!("bvh.wgsl");
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
pub(super) const SHOWN: &str = include_str!("shown.wgsl");
const MET: &str = include_str!("met.wgsl");
const BOXES: &str = include_str!("boxes.wgsl");
const HEAP: &str = include_str!("heap.wgsl");
const PKD: &str = include_str!("pkd.wgsl");
const TREELETS: &str = include_str!("treelets.wgsl");
const SINGLE: &str = include_str!("single.wgsl");
const INTERSECT: &str = include_str!("intersect.wgsl");
const NOTED_TEXT: &str = include_str!("noted.wgsl");
const FORGOTTEN: &str = include_str!("forgotten.wgsl");
const EXPONENTIAL: &str = include_str!("exponential.wgsl");
const RANDOM: &str = include_str!("random.wgsl");
const CULLING: &str = include_str!("culling.wgsl");
const CONFIDENCE: &str = include_str!("confidence.wgsl");
const CULLED: &str = include_str!("culled.wgsl");
const NEIGHBORHOOD: &str = include_str!("neighborhood.wgsl");

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
    /// The root, and notes what later passes need not look for.
    Noting,
    /// What was noted.
    Again,
    /// As the first, to the end; tells what it did instead of what it found.
    Counted,
    /// As again, to the end; tells what it did instead of what it found.
    CountedAgain,
}

impl Walk {
    /// Whether it tells what it did.
    fn is_counted(self) -> bool {
        matches!(self, Self::Counted | Self::CountedAgain)
    }

    /// Whether it begins with what was noted.
    fn remembers(self) -> bool {
        matches!(self, Self::Again | Self::CountedAgain)
    }
}

/// Leaves of a tile that are noted, and subtrees that it left out; of a tile with more nothing is.
pub(super) const NOTED: [u32; 2] = [256, 512];

/// How a scene's arrays are laid out.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Shape {
    pub(super) walked: Walked,
    pub(super) colors: Colors,
    /// Whether there are particles that are not shown.
    pub(super) hides: bool,
    /// More levels of nodes than the structure has.
    pub(super) levels: u32,
    /// Declarations of the functions that read the arrays.
    pub(super) arrays: String,
}

/// The structure that is walked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Walked {
    Bvh(Packing, Sizes),
    /// One heap.
    Pkd(Heaps),
    /// Heaps under nodes.
    Treelets(Heaps),
}

impl Walked {
    /// Whether it is walked once a tile, not once a sample.
    pub(super) fn has_tiles(self) -> bool {
        matches!(self, Self::Bvh(..))
    }
}

/// How heaps are walked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Heaps {
    /// Levels of the highest above those that are tried at once.
    pub(super) upper_levels: u32,
    pub(super) walk: HeapWalk,
}

/// How a ray finds its way through the k-d trees of `pkd` and `treelets`. It finds the same either way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum HeapWalk {
    /// Keeps the far side of each plane that it has passed, and where along the ray that is.
    #[default]
    ShortStack,
    /// Keeps nothing but where it came from.
    StackFree,
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
    /// The kernel that finds what samples meet: the first walk of tiles, or single rays where no tile can be walked as a whole.
    pub(super) fn hits(&self, sampling: Sampling) -> String {
        if self.walked.has_tiles() {
            return self.tiles(sampling, Walk::First);
        }
        let [across, down] = sampling.tilings.first.tile;
        let size = format!("const TILE_W: u32 = {across}u;\nconst TILE_H: u32 = {down}u;\n");
        self.head(sampling) + &size + &self.walk() + &["", CAMERA, PASS, SINGLE].join("\n")
    }

    /// The kernel of the tile sample buffer.
    pub(super) fn tiles(&self, sampling: Sampling, walk: Walk) -> String {
        let Sampling { samples, tilings, .. } = sampling;
        let mut head = self.head(sampling);
        let tiling = if walk == Walk::Second { tilings.second } else { tilings.first };
        let own_samples = (samples / tiling.split).max(1);
        let lanes = if own_samples == 1 { LANES1 } else { LANES4 };
        let [across, down] = tilings.parts();
        let is_patient = walk == Walk::Second || walk.is_counted();
        let patience = if is_patient { 0 } else { tilings.patience };
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
            // At most the children of the nodes of one step lie on the stack, of each level, above what was put there at once.
            ("STACK", 8 * nodes * self.levels + if walk.remembers() { threads.min(64) } else { 1 }),
            ("NOTED_LEAVES", NOTED[0]),
            ("NOTED_LEFT_OUT", NOTED[1]),
            ("PATIENCE", patience),
            ("MOST_ASIDE", MOST_ASIDE),
            ("PARTS_ACROSS", across),
            ("PARTS_DOWN", down),
        ] {
            head += &format!("const {name}: u32 = {value}u;\n");
        }
        head += &format!("const IS_SECOND: bool = {};\n", walk == Walk::Second);
        head += &format!("const COUNTED: bool = {};\n", walk.is_counted());
        head += &format!("const NOTES: bool = {};\n", walk == Walk::Noting);
        head += &format!("const REMEMBERS: bool = {};\n", walk.remembers());
        let begin = if walk == Walk::Second { SECOND } else { FIRST };
        let notes = if walk == Walk::Noting || walk.remembers() { NOTED_TEXT } else { FORGOTTEN };
        head + &[MATH, SHOWN, BVH, CAMERA, PASS, lanes, BEAM, begin, notes, TILES].join("\n")
    }

    /// The kernels that light the samples.
    pub(super) fn shade(&self, sampling: Sampling) -> String {
        // Kernels that only look for hits are the same for all colors.
        let mut colors = String::new();
        for (name, value) in
            [("COLORS", self.colors), ("COLORS_PALETTE", Colors::Palette), ("COLORS_DIRECT", Colors::Direct)]
        {
            colors += &format!("const {name}: u32 = {}u;\n", value as u32);
        }
        self.head(sampling) + &colors + &self.walk() + &["", CAMERA, PASS, SHADE].join("\n")
    }

    /// The kernel of a frame of culling by confidence, but for the declaration of its grid.
    pub(super) fn culled(&self, sampling: Sampling) -> String {
        let files = ["", CAMERA, PASS, EXPONENTIAL, RANDOM, CONFIDENCE, CULLED, ""];
        self.head(sampling) + &culling() + &self.walk() + &files.join("\n")
    }

    /// The kernel of single rays.
    pub(super) fn rays(&self) -> String {
        // They depend on no picture.
        let sampling = Sampling { samples: 1, perspective: false, tilings: Tilings::of(1, 0) };
        self.head(sampling) + &self.walk() + "\n" + INTERSECT
    }

    /// A kernel that builds: the arrays and these texts.
    pub(super) fn build(&self, texts: &[&str]) -> String {
        // It depends on no picture.
        let sampling = Sampling { samples: 1, perspective: false, tilings: Tilings::of(1, 0) };
        self.head(sampling) + &texts.join("\n")
    }

    /// The formulas of a hierarchy without any kernel.
    #[cfg(test)]
    pub(super) fn formulas(&self, sampling: Sampling) -> String {
        self.head(sampling) + &[MATH, SHOWN, BVH, CAMERA, BEAM, ""].join("\n")
    }

    /// Single rays through the structure.
    fn walk(&self) -> String {
        match self.walked {
            Walked::Bvh(..) => [MATH, SHOWN, MET, BOXES, BVH, RAYS].join("\n"),
            Walked::Pkd(_) => [MATH, SHOWN, MET, HEAP, PKD].join("\n"),
            Walked::Treelets(_) => [MATH, SHOWN, MET, BOXES, HEAP, TREELETS].join("\n"),
        }
    }

    fn head(&self, sampling: Sampling) -> String {
        let Sampling { samples, perspective, .. } = sampling;
        let mut head = String::new();
        let mut number = |name: &str, value: u32| {
            // Writing to a string cannot fail.
            _ = writeln!(head, "const {name}: u32 = {value}u;");
        };
        match self.walked {
            Walked::Bvh(packing, sizes) => {
                let [exact, bits16, bits11, bits8] =
                    [Packing::Exact, Packing::Bits16, Packing::Bits11, Packing::Bits8].map(|it| it as u32);
                number("PACKING", packing as u32);
                number("PACKING_EXACT", exact);
                number("PACKING_16", bits16);
                number("PACKING_11", bits11);
                number("PACKING_8", bits8);
                number("BLOCK", block_elements(packing));
                number("SIZES", sizes as u32);
                number("SIZES_UNIFORM", Sizes::Uniform as u32);
                number("SIZES_TABLE", Sizes::Table as u32);
                number("SIZES_EACH", Sizes::Each as u32);
                number("SIZES_LOG", Sizes::Log as u32);
            }
            Walked::Pkd(heaps) | Walked::Treelets(heaps) => {
                // Few different numbers, so that kernels are seldom made anew.
                number("HEAP_STACK", heaps.upper_levels.max(1).next_multiple_of(4));
                number("HEAP_WALK", heaps.walk as u32);
                number("STACK_FREE", HeapWalk::StackFree as u32);
            }
        }
        number("HEADLIGHT", layout::HEADLIGHT);
        number("NONE", layout::NONE);
        number("LEVELS", self.levels);
        number("SAMPLES", samples);
        _ = writeln!(head, "const PERSPECTIVE: bool = {perspective};");
        _ = writeln!(head, "const HIT_ROUNDING: f32 = {HIT_ROUNDING:e};");
        _ = writeln!(head, "const HIDES: bool = {};", self.hides);
        if !self.hides {
            // Kernels name the array that is not there.
            head += "fn shown(at: u32) -> vec4u { return vec4u(0xffffffffu); }\n";
        }
        head + &self.arrays
    }
}

/// The kernels that decide, after a frame of culling by confidence, where rays end.
pub(super) fn neighborhood() -> String {
    culling() + &[MATH, NEIGHBORHOOD].join("\n")
}

/// Records of culling by confidence.
fn culling() -> String {
    let (vectors, steps) = (layout::NORMAL_VECTORS, GAUSSIAN_STEPS);
    format!("const NORMAL_VECTORS: u32 = {vectors}u;\nconst NORMAL_STEPS: u32 = {steps}u;\n{CULLING}\n")
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
