//! The voxels of a grid from a file.
//!
//! First come all masks and the values of internal nodes, from the root down and depth first; then in the same order the values of the
//! leaves, which all threads unpack. Nodes of one kind are read that OpenVDB's grids have: 32^3 children of 16^3 leaves of 8^3 voxels.
//! Source: openvdb/tree/RootNode.h, InternalNode.h, LeafNode.h.

use std::collections::HashSet;

use rayon::prelude::*;
use tyndall::{Error, Progress, Result};

use super::file::{File, Header, since};
use super::tree::{LEAF, LEAF_VOXELS, LOG2, Leaf, NODES, Tile, Tree, Value};
use super::values::{Encoding, Stored, Unpacker, count_on, is_on};
use crate::read::cursor::Cursor;
use crate::read::numbers::Order;

const HINT: &str = "was the file copied to its end?";
/// Leaves whose values are found before they are unpacked.
const BATCH: usize = 1 << 14;

/// Reads the tree of a grid whose kind is one that is read.
pub(super) fn tree(file: &File, header: &Header, progress: &dyn Progress) -> Result<Tree> {
    let Some((components, number_bytes)) = header.kind.value() else {
        let what = format!("grid '{}' is of type {}", header.name, header.kind.name());
        return Err(Error::format(file.path, "", what, "grids of floats, doubles and vec3s are read"));
    };
    let mut cursor = Cursor::new(file.path, file.bytes, header.tree, Order::Little, HINT);
    if cursor.number::<u32>("a number of buffers")? != 1 {
        return Err(cursor.fault("a tree has several buffers, which OpenVDB no longer writes"));
    }
    let encoding = Encoding {
        version: file.version,
        packed: header.packed,
        is_half: header.is_half,
        components,
        number_bytes,
        background: Value::default(),
    };
    let background = encoding.value(&mut cursor)?;
    let encoding = Encoding { background, ..encoding };
    let mut walk =
        Walk { encoding, unpacker: Unpacker::new(encoding), leaves: Vec::new(), tiles: Vec::new() };
    walk.root(&mut cursor)?;
    let Walk { leaves, tiles, .. } = walk;
    progress.begin("read", Some(leaves.len() as u64), "leaves");
    let mut read = Vec::new();
    for leaves in leaves.chunks(BATCH) {
        if progress.cancelled() {
            return Err(Error::Interrupted);
        }
        buffers(&mut cursor, &encoding, leaves, &mut read)?;
        progress.advance(leaves.len() as u64);
    }
    Ok(Tree { components, background, leaves: read, tiles })
}

/// A leaf whose values are still to come.
struct Bare<'a> {
    origin: [i32; 3],
    active: &'a [u8],
}

struct Walk<'a> {
    encoding: Encoding,
    unpacker: Unpacker,
    leaves: Vec<Bare<'a>>,
    tiles: Vec<Tile>,
}

impl<'a> Walk<'a> {
    fn root(&mut self, cursor: &mut Cursor<'a>) -> Result<()> {
        let tiles: u32 = cursor.number("a number of tiles")?;
        let children: u32 = cursor.number("a number of nodes")?;
        let mut origins = HashSet::new();
        let mut origin = |cursor: &mut Cursor| {
            let origin = root_origin(cursor)?;
            match origins.insert(origin) {
                true => Ok(origin),
                false => Err(cursor.fault(format!("two nodes of the root begin at {origin:?}"))),
            }
        };
        for _ in 0..tiles {
            let origin = origin(cursor)?;
            let value = self.encoding.value(cursor)?;
            let is_active = cursor.number::<u8>("a flag")? != 0;
            self.tile(Tile { origin, edge: NODES[1], value, is_active });
        }
        for _ in 0..children {
            let origin = origin(cursor)?;
            self.node(cursor, origin, 0)?;
        }
        Ok(())
    }

    /// An internal node: the upper kind is 0, the lower 1.
    fn node(&mut self, cursor: &mut Cursor<'a>, first: [i32; 3], kind: usize) -> Result<()> {
        let log2 = LOG2[kind];
        let count = 1_usize << (3 * log2);
        let edge = [NODES[0], LEAF][kind];
        let children = cursor.take(count / 8, "a mask")?;
        let active = cursor.take(count / 8, "a mask")?;
        let place = cursor.place();
        // Older files have no values where there are children.
        let is_older = self.encoding.version < since::MASK_COMPRESSION;
        let own = if is_older { count - count_on(children) } else { count };
        let stored = self.encoding.stored(cursor, own, active)?;
        let origin = |number: usize| {
            let steps: [usize; 3] =
                std::array::from_fn(|axis| number >> (log2 * (2 - axis as u32)) & ((1 << log2) - 1));
            std::array::from_fn(|axis| first[axis] + steps[axis] as i32 * edge)
        };
        // Most nodes have children and nothing else.
        if count_on(active) > 0 || !stored.is_background_elsewhere(self.encoding.background) {
            let mut values = Vec::new();
            let unpacked = self.unpacker.values(&stored, active, &mut values);
            unpacked.map_err(|what| Error::format(cursor.path(), format!("byte {place}"), what, HINT))?;
            let mut values = values.chunks_exact(self.encoding.components);
            for number in 0..count {
                let is_child = is_on(children, number);
                if is_child && is_older {
                    continue;
                }
                let Some(numbers) = values.next() else { break };
                let mut value = Value::default();
                value[..numbers.len()].copy_from_slice(numbers);
                if !is_child {
                    self.tile(Tile { origin: origin(number), edge, value, is_active: is_on(active, number) });
                }
            }
        }
        for number in (0..count).filter(|&number| is_on(children, number)) {
            let origin = origin(number);
            if kind == 0 {
                self.node(cursor, origin, 1)?;
            } else {
                self.leaves.push(Bare { origin, active: cursor.take(LEAF_VOXELS / 8, "a mask")? });
            }
        }
        Ok(())
    }

    /// Keeps a tile unless it is like the outside.
    fn tile(&mut self, tile: Tile) {
        if tile.is_active || tile.value.map(f32::to_bits) != self.encoding.background.map(f32::to_bits) {
            self.tiles.push(tile);
        }
    }
}

/// Where a child of the root begins.
fn root_origin(cursor: &mut Cursor) -> Result<[i32; 3]> {
    let mut origin = [0; 3];
    for coordinate in &mut origin {
        *coordinate = cursor.number::<i32>("where a node begins")? & !(NODES[1] - 1);
    }
    Ok(origin)
}

/// Reads the values of leaves that follow each other.
fn buffers<'a>(
    cursor: &mut Cursor<'a>,
    encoding: &Encoding,
    leaves: &[Bare<'a>],
    read: &mut Vec<Leaf>,
) -> Result<()> {
    let mut found: Vec<(&Bare, usize, Stored)> = Vec::with_capacity(leaves.len());
    for leaf in leaves {
        let place = cursor.place();
        // The mask is there again; that of the topology counts, as in OpenVDB.
        cursor.skip(LEAF_VOXELS as u64 / 8, "a mask")?;
        let mut buffers = 1;
        if encoding.version < since::MASK_COMPRESSION {
            cursor.skip(12, "where a leaf begins")?;
            buffers = cursor.number::<i8>("a number of buffers")?;
        }
        found.push((leaf, place, encoding.stored(cursor, LEAF_VOXELS, leaf.active)?));
        for _ in 1..buffers {
            encoding.stored(cursor, LEAF_VOXELS, leaf.active)?;
        }
    }
    let unpack = |unpacker: &mut Unpacker, (leaf, place, stored): &(&Bare, usize, Stored)| {
        let mut values = Vec::new();
        let unpacked = unpacker.values(stored, leaf.active, &mut values);
        unpacked.map_err(|what| Error::format(cursor.path(), format!("byte {place}"), what, HINT))?;
        let words = leaf.active.as_chunks().0;
        let active = std::array::from_fn(|word| u64::from_le_bytes(words[word]));
        Ok(Leaf { origin: leaf.origin, active, values })
    };
    let unpacked: Result<Vec<Leaf>> =
        found.par_iter().map_init(|| Unpacker::new(*encoding), unpack).collect();
    read.extend(unpacked?);
    Ok(())
}
