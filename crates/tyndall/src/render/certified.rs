//! Certified culling: what is left out is proven to be hidden, so that the picture is that without culling, bit for bit.
//!
//! Each layer stands for one proof and can be switched off alone; [`Counts`] says what each saved. See `ARCHITECTURE.md`, "Certified
//! culling". The deepest sample of the tile buffer is such a proof too, and always in use.

use std::ops::AddAssign;

/// Which proofs are sought.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// Single rays (structures other than `bvh`) end at a depth behind which the next sample of a pixel seldom lies; one that
    /// finds nothing goes on from there. Takes more time than it saves: a ray tests hardly anything behind what it meets anyway.
    pub clip: bool,
    /// Of several passes at once, those after the first begin with the leaves that the first went through, and walk only what is
    /// no longer hidden behind them (structure `bvh`).
    pub visible_set: bool,
    /// After the first pass, pixels are searched for parts that are covered for good; what starts behind them is dropped from the visible set,
    /// and what no tile can see is counted. Takes more time than it saves at 64 samples.
    pub coverage: bool,
    /// Shadow rays of a direction are answered together, by bounds on both sides in the space of the light: surely shadowed,
    /// surely lit, and traced only between the two (structure `bvh`).
    pub light_bounds: bool,
}

impl Options {
    /// No proofs: the baseline.
    pub const OFF: Self = Self { clip: false, visible_set: false, coverage: false, light_bounds: false };
}

impl Default for Options {
    fn default() -> Self {
        Self { clip: false, visible_set: true, coverage: false, light_bounds: true }
    }
}

/// What was counted while rendering.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Single rays that were clipped, and those of them that went on behind the clip.
    pub clipped_rays: u64,
    /// See there.
    pub resumed_rays: u64,
    /// Leaves that passes after the first knew of before they began, over all tiles.
    pub remembered_leaves: u64,
    /// Leaves and bricks (4 million particles) of the structure, and those of them that no ray of the view can see.
    pub leaves: u64,
    /// See there.
    pub evicted_leaves: u64,
    /// See there.
    pub bricks: u64,
    /// See there.
    pub evicted_bricks: u64,
    /// Points that looked for a light by the bounds of `light_bounds`.
    pub light_points: u64,
    /// Those of them that a bound proved to be shadowed.
    pub surely_shadowed: u64,
    /// Those of them for which the formula of a ray had to decide.
    pub traced: u64,
}

impl AddAssign for Counts {
    fn add_assign(&mut self, other: Self) {
        self.clipped_rays += other.clipped_rays;
        self.resumed_rays += other.resumed_rays;
        self.remembered_leaves += other.remembered_leaves;
        self.leaves += other.leaves;
        self.evicted_leaves += other.evicted_leaves;
        self.bricks += other.bricks;
        self.evicted_bricks += other.evicted_bricks;
        self.light_points += other.light_points;
        self.surely_shadowed += other.surely_shadowed;
        self.traced += other.traced;
    }
}
