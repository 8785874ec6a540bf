//! Grids to a file of version 224: zipped, without inactive values, with what Blender and Houdini look for.
//!
//! Takes grids of unique names, puts the file there whole or not at all. What was read from a file that this module wrote is what was
//! written, to the bit of every voxel where numbers are full floats.

use std::collections::{BTreeMap, HashSet};
use std::hash::Hasher;
use std::io::Write;
use std::path::Path;

use flate2::{Compress, Compression, FlushCompress};
use half::f16;
use rayon::prelude::*;
use twox_hash::XxHash64;
use tyndall::{Error, Progress, Result};

use super::Grid;
use super::file::{MAGIC, packed};
use super::transform::WRITTEN;
use super::tree::{LEAF, LEAF_VOXELS, LOG2, Leaf, NODES, Tile, Tree, Value};
use super::values::{is_on, left};

const VERSION: u32 = 224;
/// The release of OpenVDB that brought this version of files.
const LIBRARY: [u32; 2] = [6, 1];
/// How hard zip tries: values of simulations hardly shrink more for more work.
const LEVEL: Compression = Compression::new(1);
/// Leaves that are packed between two looks at the progress.
const BATCH: usize = 1 << 12;
/// Beyond this a 16-bit float is infinite.
const LARGEST_HALF: f32 = 65520.0;

/// How many bits numbers have in a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// 32-bit floats.
    #[default]
    Full,
    /// 16-bit floats: 11 significant bits, up to 65504.
    Half,
}

/// Writes grids; replaces the file that is there.
///
/// Fails with [`Error::Setting`] if two grids have the same name, a transform has not one positive scale, or a value is too large for
/// 16 bits; with [`Error::Interrupted`]; and with [`Error::Io`] if the system refuses.
pub fn write(path: &Path, grids: &[Grid], precision: Precision, progress: &dyn Progress) -> Result<()> {
    check(grids, precision)?;
    let leaves: usize = grids.iter().map(|it| it.tree.leaves.len()).sum();
    progress.begin("pack", Some(leaves as u64), "leaves");
    let mut parts = Parts::default();
    let head =
        [&MAGIC[..], &VERSION.to_le_bytes(), LIBRARY.map(u32::to_le_bytes).as_flattened(), &[1]].concat();
    let identified = [head.len(), head.len() + IDENTIFIER];
    let mut start = head;
    start.resize(identified[1], 0);
    start.extend(metadata(&[("creator", Metadata::Text(CREATOR))]));
    start.extend((grids.len() as u32).to_le_bytes());
    parts.push(start);
    for grid in grids {
        write_grid(grid, precision, &mut parts, progress)?;
    }
    let identifier = parts.identifier();
    parts.pieces[0][identified[0]..identified[1]].copy_from_slice(identifier.as_bytes());
    crate::write::atomically(path, |file| parts.pieces.iter().try_for_each(|piece| file.write_all(piece)))
}

/// Who wrote the file.
const CREATOR: &str = concat!("Tyndall ", env!("CARGO_PKG_VERSION"));
/// Letters of a file's identifier.
const IDENTIFIER: usize = 36;

fn check(grids: &[Grid], precision: Precision) -> Result<()> {
    let mut names = HashSet::new();
    for Grid { name, transform, tree, .. } in grids {
        if !names.insert(name) {
            return Err(Error::setting("grid", name, "a name for each grid: this one is there twice"));
        }
        let [x, y, z] = transform.scale;
        if !(x > 0.0 && x.is_finite() && x == y && x == z) {
            let allowed = "one distance above 0 along all axes";
            return Err(Error::setting("voxels", format!("{:?}", transform.scale), allowed));
        }
        let is_large = |it: &&f32| it.is_finite() && it.abs() >= LARGEST_HALF;
        let tiles = tree.tiles.iter().flat_map(|it| &it.value).chain(&tree.background);
        let large = || tree.leaves.par_iter().find_map_any(|leaf| leaf.values.iter().find(is_large));
        if precision == Precision::Half
            && let Some(large) = tiles.into_iter().find(is_large).or_else(large)
        {
            let value = format!("{name} of {large}");
            return Err(Error::setting("half", value, "values up to 65504: leave out half, or scale them"));
        }
    }
    Ok(())
}

/// The bytes of a file, piece by piece.
#[derive(Default)]
struct Parts {
    pieces: Vec<Vec<u8>>,
    length: u64,
}

impl Parts {
    fn push(&mut self, piece: Vec<u8>) {
        self.length += piece.len() as u64;
        self.pieces.push(piece);
    }

    /// A UUID of the content: version 8, as RFC 9562 calls those that are made in another way.
    fn identifier(&self) -> String {
        let hash = |seed: u64| {
            let mut hash = XxHash64::with_seed(seed);
            self.pieces.iter().for_each(|it| hash.write(it));
            hash.finish()
        };
        let [high, low] = [0, 1].map(hash);
        let high = high & !(0xf << 12) | 8 << 12;
        let low = low & !(3 << 62) | 2 << 62;
        let (first, second, third) = (high >> 32, high >> 16 & 0xffff, high & 0xffff);
        format!("{first:08x}-{second:04x}-{third:04x}-{:04x}-{:012x}", low >> 48, low & 0xffff_ffff_ffff)
    }
}

/// A value of metadata.
enum Metadata<'a> {
    Text(&'a str),
    Flag(bool),
    Count(u64),
    Voxel([i32; 3]),
}

fn metadata(entries: &[(&str, Metadata)]) -> Vec<u8> {
    let mut bytes = (entries.len() as u32).to_le_bytes().to_vec();
    for (name, value) in entries {
        let (kind, value) = match value {
            Metadata::Text(text) => ("string", text.as_bytes().to_vec()),
            Metadata::Flag(flag) => ("bool", vec![u8::from(*flag)]),
            Metadata::Count(count) => ("int64", count.to_le_bytes().to_vec()),
            Metadata::Voxel(voxel) => ("vec3i", voxel.map(i32::to_le_bytes).concat()),
        };
        text(&mut bytes, name);
        text(&mut bytes, kind);
        bytes.extend((value.len() as u32).to_le_bytes());
        bytes.extend(value);
    }
    bytes
}

fn text(bytes: &mut Vec<u8>, text: &str) {
    bytes.extend((text.len() as u32).to_le_bytes());
    bytes.extend(text.as_bytes());
}

fn write_grid(grid: &Grid, precision: Precision, parts: &mut Parts, progress: &dyn Progress) -> Result<()> {
    let Grid { name, class, transform, tree } = grid;
    let is_half = precision == Precision::Half;
    let kind = if tree.components == 1 { "Tree_float_5_4_3" } else { "Tree_vec3s_5_4_3" };
    let mut begin = Vec::new();
    text(&mut begin, name);
    text(&mut begin, &format!("{kind}{}", if is_half { "_HalfFloat" } else { "" }));
    text(&mut begin, "");
    let [low, high] = tree.active_box().unwrap_or_default();
    let mut about = (packed::ZIP | packed::ACTIVE_MASK).to_le_bytes().to_vec();
    about.extend(metadata(&[
        ("class", Metadata::Text(class.name())),
        ("creator", Metadata::Text(CREATOR)),
        ("file_bbox_max", Metadata::Voxel(high)),
        ("file_bbox_min", Metadata::Voxel(low)),
        ("file_compression", Metadata::Text("zip + active values")),
        ("file_voxel_count", Metadata::Count(tree.active_count())),
        ("is_saved_as_half_float", Metadata::Flag(is_half)),
        ("name", Metadata::Text(name)),
    ]));
    text(&mut about, WRITTEN);
    about.extend(transform.bytes());
    about.extend(1_u32.to_le_bytes());
    let mut packer = Packer::new(tree, precision);
    let leaves = packer.topology(tree, &mut about);

    let place = parts.pieces.len();
    let grid_at = parts.length + begin.len() as u64 + 24;
    let blocks_at = grid_at + about.len() as u64;
    parts.push([begin, vec![0; 24]].concat());
    parts.push(about);
    for leaves in leaves.chunks(BATCH) {
        if progress.cancelled() {
            return Err(Error::Interrupted);
        }
        let pack = |packer: &mut Packer, leaf: &&Leaf| {
            let mut bytes = Vec::new();
            let active = leaf.active.map(u64::to_le_bytes);
            bytes.extend(active.as_flattened());
            packer.values(&leaf.values, active.as_flattened(), &[0; LEAF_VOXELS / 8], &mut bytes);
            bytes
        };
        let packed: Vec<Vec<u8>> =
            leaves.par_iter().map_init(|| Packer::new(tree, precision), pack).collect();
        parts.push(packed.concat());
        progress.advance(leaves.len() as u64);
    }
    let places = [grid_at, blocks_at, parts.length].map(u64::to_le_bytes);
    let begin = &mut parts.pieces[place];
    let at = begin.len() - 24;
    begin[at..].copy_from_slice(places.as_flattened());
    Ok(())
}

/// An internal node: what it has at its places.
#[derive(Default)]
struct Node<'a> {
    tiles: BTreeMap<usize, &'a Tile>,
    nodes: BTreeMap<usize, Node<'a>>,
    leaves: BTreeMap<usize, &'a Leaf>,
}

/// Where a voxel stands among the children of a node of `kind`.
fn place_in_node(voxel: [i32; 3], kind: usize) -> usize {
    let (log2, edge) = (LOG2[kind], [NODES[0], LEAF][kind]);
    let mask = (1 << log2) - 1;
    voxel.iter().fold(0, |place, &it| place << log2 | (it.div_euclid(edge) & mask) as usize)
}

/// Packs values, again and again.
struct Packer {
    components: usize,
    precision: Precision,
    background: Value,
    zip: Compress,
    plain: Vec<u8>,
}

impl Packer {
    fn new(tree: &Tree, precision: Precision) -> Self {
        let mut packer = Self {
            components: tree.components,
            precision,
            background: tree.background,
            zip: Compress::new(LEVEL, true),
            plain: Vec::new(),
        };
        packer.background = packer.stored(tree.background);
        packer
    }

    /// What comes back of a value.
    fn stored(&self, value: Value) -> Value {
        match self.precision {
            Precision::Full => value,
            Precision::Half => value.map(|it| f16::from_f32(it).to_f32()),
        }
    }

    /// Appends a value in full precision.
    fn value(&self, value: Value, bytes: &mut Vec<u8>) {
        bytes.extend(self.stored(value)[..self.components].iter().flat_map(|it| it.to_le_bytes()));
    }

    /// Appends all but the values of leaves; gives the leaves in the order in which these follow.
    fn topology<'a>(&mut self, tree: &'a Tree, bytes: &mut Vec<u8>) -> Vec<&'a Leaf> {
        let mut roots: BTreeMap<[i32; 3], Node> = BTreeMap::new();
        let root_of = |voxel: [i32; 3]| voxel.map(|it| it & !(NODES[1] - 1));
        let (whole, tiles): (Vec<&Tile>, Vec<&Tile>) = tree.tiles.iter().partition(|it| it.edge == NODES[1]);
        for tile in tiles {
            let upper = roots.entry(root_of(tile.origin)).or_default();
            let place = place_in_node(tile.origin, 0);
            if tile.edge == NODES[0] {
                upper.tiles.insert(place, tile);
            } else {
                let lower = upper.nodes.entry(place).or_default();
                lower.tiles.insert(place_in_node(tile.origin, 1), tile);
            }
        }
        for leaf in &tree.leaves {
            let upper = roots.entry(root_of(leaf.origin)).or_default();
            let lower = upper.nodes.entry(place_in_node(leaf.origin, 0)).or_default();
            lower.leaves.insert(place_in_node(leaf.origin, 1), leaf);
        }
        self.value(tree.background, bytes);
        bytes.extend((whole.len() as u32).to_le_bytes());
        bytes.extend((roots.len() as u32).to_le_bytes());
        for tile in whole {
            bytes.extend(tile.origin.map(i32::to_le_bytes).as_flattened());
            self.value(tile.value, bytes);
            bytes.push(u8::from(tile.is_active));
        }
        let mut leaves = Vec::with_capacity(tree.leaves.len());
        for (origin, node) in &roots {
            bytes.extend(origin.map(i32::to_le_bytes).as_flattened());
            self.node(node, 0, bytes);
            for lower in node.nodes.values() {
                self.node(lower, 1, bytes);
                for leaf in lower.leaves.values() {
                    bytes.extend(leaf.active.map(u64::to_le_bytes).as_flattened());
                    leaves.push(*leaf);
                }
            }
        }
        leaves
    }

    /// Appends the masks and the tiles of an internal node.
    fn node(&mut self, node: &Node, kind: usize, bytes: &mut Vec<u8>) {
        let count = 1_usize << (3 * LOG2[kind]);
        let mut children = vec![0; count / 8];
        let mut active = vec![0; count / 8];
        let on = |mask: &mut [u8], place: usize| mask[place / 8] |= 1 << (place % 8);
        node.nodes.keys().chain(node.leaves.keys()).for_each(|&place| on(&mut children, place));
        let background = &self.background[..self.components];
        let mut values = background.repeat(count);
        for (&place, tile) in &node.tiles {
            if tile.is_active {
                on(&mut active, place);
            }
            let first = place * self.components;
            values[first..first + self.components].copy_from_slice(&tile.value[..self.components]);
        }
        bytes.extend(&children);
        bytes.extend(&active);
        self.values(&values, &active, &children, bytes);
    }

    /// Appends the values of a node; those at `children` do not count.
    fn values(&mut self, values: &[f32], active: &[u8], children: &[u8], bytes: &mut Vec<u8>) {
        let components = self.components;
        let value = |place: usize| {
            let mut value = Value::default();
            value[..components].copy_from_slice(&values[place * components..][..components]);
            self.stored(value)
        };
        let count = 8 * active.len();
        let bits = |value: Value| value.map(f32::to_bits);
        let is_left = |place: &usize| !is_on(active, *place) && !is_on(children, *place);
        // The different values that are not active: with more than two, all are written.
        let mut others: Vec<Value> = Vec::new();
        for place in (0..count).filter(is_left) {
            let value = value(place);
            if !others.iter().any(|it| bits(*it) == bits(value)) {
                others.push(value);
                if others.len() > 2 {
                    break;
                }
            }
        }
        let background = bits(self.background);
        let negative = bits(self.background.map(|it| -it));
        // Numbers that a value has not are no negative zeros.
        let negative: [u32; 3] = std::array::from_fn(|k| if k < components { negative[k] } else { 0 });
        others.sort_by_key(|it| bits(*it) == background);
        let (what, listed) = match others[..] {
            [] => (left::BACKGROUND, 0),
            [one] if bits(one) == background => (left::BACKGROUND, 0),
            [one] if bits(one) == negative => (left::NEGATIVE, 0),
            [_] => (left::ONE, 1),
            [one, two] if bits(two) == background && bits(one) == negative => {
                (left::NEGATIVE_OR_BACKGROUND, 0)
            }
            [_, two] if bits(two) == background => (left::ONE_OR_BACKGROUND, 1),
            [_, _] => (left::ONE_OR_OTHER, 2),
            _ => (left::NOTHING, 0),
        };
        bytes.push(what);
        others[..listed].iter().for_each(|it| self.value(*it, bytes));
        if [left::NEGATIVE_OR_BACKGROUND, left::ONE_OR_BACKGROUND, left::ONE_OR_OTHER].contains(&what) {
            let mut mask = vec![0_u8; count / 8];
            for place in (0..count).filter(is_left).filter(|&place| bits(value(place)) == bits(others[1])) {
                mask[place / 8] |= 1 << (place % 8);
            }
            bytes.extend(mask);
        }
        let all = what == left::NOTHING;
        self.plain.clear();
        for place in (0..count).filter(|&place| all || is_on(active, place)) {
            for number in &values[place * components..][..components] {
                match self.precision {
                    Precision::Full => self.plain.extend(number.to_le_bytes()),
                    Precision::Half => self.plain.extend(f16::from_f32(*number).to_le_bytes()),
                }
            }
        }
        // Of no halves there is not even a size, but of no other numbers.
        if !(self.plain.is_empty() && self.precision == Precision::Half) {
            self.zipped(bytes);
        }
    }

    /// Appends `plain`, zipped where that makes it smaller, behind its size, which is negative where it is not zipped.
    fn zipped(&mut self, bytes: &mut Vec<u8>) {
        self.zip.reset();
        let place = bytes.len();
        bytes.extend([0; 8]);
        let mut packed = vec![0; self.plain.len()];
        let done = self.zip.compress(&self.plain, &mut packed, FlushCompress::Finish);
        let is_done = matches!(done, Ok(flate2::Status::StreamEnd));
        let length = self.zip.total_out() as usize;
        if is_done && length < self.plain.len() {
            bytes.extend(&packed[..length]);
            bytes[place..place + 8].copy_from_slice(&(length as i64).to_le_bytes());
        } else {
            bytes.extend(&self.plain);
            bytes[place..place + 8].copy_from_slice(&(-(self.plain.len() as i64)).to_le_bytes());
        }
    }
}
