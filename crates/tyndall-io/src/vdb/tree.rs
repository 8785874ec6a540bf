//! The voxels of a grid: leaves of 8^3, and tiles of one value for all that is larger.
//!
//! Invariants: origins are multiples of a node's edge; a leaf has 512 values of `components` numbers each, z fastest, then y, then x, as
//! the file has them, and the numbers of a value stand side by side. No two nodes cover the same voxel. What no node covers has the
//! background's value and is not active.

/// Voxels along an edge of a leaf.
pub const LEAF: i32 = 8;
/// Voxels of a leaf.
pub const LEAF_VOXELS: usize = 512;
/// Voxels along the edges of what the two kinds of internal nodes cover: 16 leaves, and 32 of these.
pub(super) const NODES: [i32; 2] = [LEAF << LOG2[1], LEAF << (LOG2[1] + LOG2[0])];
/// The binary logarithms of how many children stand along an edge of an internal node, the upper one first.
pub(super) const LOG2: [u32; 2] = [5, 4];

/// A value of up to three numbers; those that a grid has not are 0.
pub type Value = [f32; 3];

/// See the module.
#[derive(Clone, Debug, PartialEq)]
pub struct Tree {
    /// Numbers of a value: 1 or 3.
    pub components: usize,
    /// The value outside.
    pub background: Value,
    /// In any order.
    pub leaves: Vec<Leaf>,
    /// In any order.
    pub tiles: Vec<Tile>,
}

/// A block of 8^3 voxels.
#[derive(Clone, Debug, PartialEq)]
pub struct Leaf {
    /// Its voxel of smallest coordinates.
    pub origin: [i32; 3],
    /// Which voxels are active: bit `n % 64` of word `n / 64` for voxel `n`.
    pub active: [u64; 8],
    /// See the module.
    pub values: Vec<f32>,
}

/// A cube of voxels of one value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tile {
    /// Its voxel of smallest coordinates.
    pub origin: [i32; 3],
    /// Voxels along its edge: 8, 128 or 4096.
    pub edge: i32,
    /// What all voxels have.
    pub value: Value,
    /// Whether they are active.
    pub is_active: bool,
}

/// Where voxel (x, y, z) of a leaf stands among its values.
pub fn place_in_leaf([x, y, z]: [usize; 3]) -> usize {
    x << 6 | y << 3 | z
}

impl Leaf {
    /// The least and the greatest coordinates of its active voxels.
    fn active_box(&self) -> Option<[[i32; 3]; 2]> {
        if self.active == [u64::MAX; 8] {
            return Some([self.origin, self.origin.map(|it| it + (LEAF - 1))]);
        }
        let active = (0..LEAF_VOXELS).filter(|place| self.is_active(*place));
        let places = active.map(|place| {
            let step = [place >> 6, place >> 3 & 7, place & 7];
            std::array::from_fn(|axis| self.origin[axis] + step[axis] as i32)
        });
        places.map(|at| [at; 2]).reduce(joined)
    }

    /// Whether voxel `place` is active.
    pub fn is_active(&self, place: usize) -> bool {
        self.active[place / 64] >> (place % 64) & 1 == 1
    }
}

/// The box around two boxes.
fn joined([low, high]: [[i32; 3]; 2], [other_low, other_high]: [[i32; 3]; 2]) -> [[i32; 3]; 2] {
    [
        std::array::from_fn(|axis| low[axis].min(other_low[axis])),
        std::array::from_fn(|axis| high[axis].max(other_high[axis])),
    ]
}

impl Tree {
    /// The least and the greatest coordinates of the active voxels; `None` if there are none.
    pub fn active_box(&self) -> Option<[[i32; 3]; 2]> {
        let tiles = self.tiles.iter().filter(|it| it.is_active);
        let boxes = tiles.map(|it| [it.origin, it.origin.map(|low| low + (it.edge - 1))]);
        boxes.chain(self.leaves.iter().filter_map(Leaf::active_box)).reduce(joined)
    }

    /// How many voxels are active.
    pub fn active_count(&self) -> u64 {
        let of_tiles = self.tiles.iter().filter(|it| it.is_active).map(|it| (it.edge as u64).pow(3));
        let of_leaves =
            self.leaves.iter().flat_map(|it| it.active.iter()).map(|word| u64::from(word.count_ones()));
        of_tiles.fold(of_leaves.sum(), u64::saturating_add)
    }
}
