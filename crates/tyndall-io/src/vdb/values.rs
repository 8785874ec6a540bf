//! The values of a node: packed or plain, whole or without those that are not active.
//!
//! Values that are not active are mostly one of two, the background and its negative: then they are left out, and a byte ([`Left`])
//! says what they are, with the values and the mask that it needs. Source: openvdb/io/Compression.h.

use flate2::{Decompress, FlushDecompress, Status};
use half::f16;
use tyndall::Result;

use super::blosc;
use super::file::{packed, since};
use super::tree::Value;
use crate::read::cursor::Cursor;

/// What a file says of all values of a grid.
#[derive(Clone, Copy, Debug)]
pub(super) struct Encoding {
    pub(super) version: u32,
    /// Bits of [`packed`].
    pub(super) packed: u32,
    pub(super) is_half: bool,
    /// Numbers of a value.
    pub(super) components: usize,
    /// Bytes of a number that is no half.
    pub(super) number_bytes: usize,
    pub(super) background: Value,
}

/// The values of a node as they stand in the file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stored<'a> {
    /// Packed or plain.
    bytes: &'a [u8],
    is_packed: bool,
    /// How many values these are.
    count: usize,
    /// What those are that were left out, if some were.
    left: Option<Left<'a>>,
}

/// The values that are not active: the first of them where the mask is off, the second where it is on.
#[derive(Clone, Copy, Debug)]
struct Left<'a> {
    values: [Value; 2],
    mask: Option<&'a [u8]>,
}

impl Stored<'_> {
    /// Whether all values that are not active were left out, and are the background's.
    pub(super) fn is_background_elsewhere(&self, background: Value) -> bool {
        let is_background = |left: &Left| left.values[0].map(f32::to_bits) == background.map(f32::to_bits);
        self.left.as_ref().is_some_and(|left| left.mask.is_none() && is_background(left))
    }
}

/// What is said of the values that are not active, by number.
pub(super) mod left {
    pub(in crate::vdb) const BACKGROUND: u8 = 0;
    pub(in crate::vdb) const NEGATIVE: u8 = 1;
    pub(in crate::vdb) const ONE: u8 = 2;
    pub(in crate::vdb) const NEGATIVE_OR_BACKGROUND: u8 = 3;
    pub(in crate::vdb) const ONE_OR_BACKGROUND: u8 = 4;
    pub(in crate::vdb) const ONE_OR_OTHER: u8 = 5;
    pub(in crate::vdb) const NOTHING: u8 = 6;
}

/// Whether bit `place` of a mask is on.
pub(super) fn is_on(mask: &[u8], place: usize) -> bool {
    mask[place / 8] >> (place % 8) & 1 == 1
}

/// How many bits of a mask are on.
pub(super) fn count_on(mask: &[u8]) -> usize {
    mask.iter().map(|byte| byte.count_ones() as usize).sum()
}

impl Encoding {
    /// A value in full precision.
    pub(super) fn value(&self, cursor: &mut Cursor) -> Result<Value> {
        let mut value = Value::default();
        for number in &mut value[..self.components] {
            *number = match self.number_bytes {
                8 => cursor.number::<f64>("a value")? as f32,
                _ => cursor.number("a value")?,
            };
        }
        Ok(value)
    }

    fn value_bytes(&self) -> usize {
        self.components * if self.is_half { 2 } else { self.number_bytes }
    }

    /// Passes over the values of a node with `count` values, of which `active` says which are active.
    pub(super) fn stored<'a>(
        &self,
        cursor: &mut Cursor<'a>,
        count: usize,
        active: &[u8],
    ) -> Result<Stored<'a>> {
        let is_masked = self.version >= since::MASK_COMPRESSION;
        let what = if is_masked { cursor.number("what was left out")? } else { left::NOTHING };
        if what > left::NOTHING {
            return Err(cursor.fault(format!("values are left out in an unknown way ({what})")));
        }
        let background = self.background;
        let negative = background.map(|it| -it);
        let first = match what {
            left::BACKGROUND => background,
            left::ONE | left::ONE_OR_BACKGROUND | left::ONE_OR_OTHER => self.value(cursor)?,
            _ => negative,
        };
        let second = if what == left::ONE_OR_OTHER { self.value(cursor)? } else { background };
        let has_mask =
            [left::NEGATIVE_OR_BACKGROUND, left::ONE_OR_BACKGROUND, left::ONE_OR_OTHER].contains(&what);
        let mask = if has_mask { Some(cursor.take(count / 8, "a mask")?) } else { None };
        let is_short = self.packed & packed::ACTIVE_MASK != 0 && what != left::NOTHING;
        let stored = if is_short { count_on(active) } else { count };
        // Of no halves there is not even a size, but of no other numbers.
        let is_nothing = stored == 0 && self.is_half;
        let is_packed = self.packed & (packed::ZIP | packed::BLOSC) != 0 && !is_nothing;
        let (bytes, is_packed) = if is_packed {
            let size = cursor.number::<i64>("a size of values")?;
            (cursor.take(usize::try_from(size.unsigned_abs()).unwrap_or(usize::MAX), "values")?, size > 0)
        } else {
            (cursor.take(stored * self.value_bytes(), "values")?, false)
        };
        if !is_packed && bytes.len() != stored * self.value_bytes() {
            let what = format!("{} bytes of values were found where {stored} values belong", bytes.len());
            return Err(cursor.fault(what));
        }
        let left = (stored != count).then_some(Left { values: [first, second], mask });
        Ok(Stored { bytes, is_packed, count: stored, left })
    }
}

/// Unpacks values, again and again.
pub(super) struct Unpacker {
    encoding: Encoding,
    zip: Decompress,
    plain: Vec<u8>,
    numbers: Vec<f32>,
}

impl Unpacker {
    pub(super) fn new(encoding: Encoding) -> Self {
        Self { encoding, zip: Decompress::new(true), plain: Vec::new(), numbers: Vec::new() }
    }

    /// All values of a node, of which `active` says which are active, number by number; says what is wrong with them.
    pub(super) fn values(
        &mut self,
        stored: &Stored,
        active: &[u8],
        values: &mut Vec<f32>,
    ) -> std::result::Result<(), String> {
        values.clear();
        let Some(left) = stored.left else {
            return self.numbers(stored).map(|()| values.extend_from_slice(&self.numbers));
        };
        self.numbers(stored)?;
        let components = self.encoding.components;
        let mut next = self.numbers.chunks_exact(components);
        for place in 0..8 * active.len() {
            match is_on(active, place).then(|| next.next()).flatten() {
                Some(value) => values.extend_from_slice(value),
                None => {
                    let is_second = left.mask.is_some_and(|mask| is_on(mask, place));
                    values.extend_from_slice(&left.values[usize::from(is_second)][..components]);
                }
            }
        }
        Ok(())
    }

    /// The values that the file has.
    fn numbers(&mut self, stored: &Stored) -> std::result::Result<(), String> {
        let bytes = stored.count * self.encoding.value_bytes();
        let plain = if stored.is_packed {
            self.plain.clear();
            self.plain.resize(bytes, 0);
            if bytes == 0 {
                // A container of nothing.
            } else if self.encoding.packed & packed::BLOSC != 0 {
                blosc::unpack(stored.bytes, &mut self.plain)?;
            } else {
                self.zip.reset(true);
                let done = self.zip.decompress(stored.bytes, &mut self.plain, FlushDecompress::Finish);
                let done = done.map_err(|error| format!("zipped values are damaged: {error}"))?;
                let count = self.zip.total_out() as usize;
                if done != Status::StreamEnd || count != bytes {
                    return Err(format!("zipped values have not the {bytes} bytes that belong here"));
                }
            }
            &self.plain[..]
        } else {
            stored.bytes
        };
        self.numbers.clear();
        match (self.encoding.is_half, self.encoding.number_bytes) {
            (true, _) => {
                let halves = plain.as_chunks().0.iter();
                self.numbers.extend(halves.map(|&it| f16::from_le_bytes(it).to_f32()));
            }
            (false, 8) => {
                self.numbers.extend(plain.as_chunks().0.iter().map(|&it| f64::from_le_bytes(it) as f32));
            }
            (false, _) => self.numbers.extend(plain.as_chunks().0.iter().map(|&it| f32::from_le_bytes(it))),
        }
        Ok(())
    }
}
