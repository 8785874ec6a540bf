//! Points that LASzip packed, unpacked by the crate laz: one after the other, but chunks of them in any order.
//!
//! That crate asks for the memory that sizes in the file promise, so what it will read of them is checked before: the number of chunks in
//! their table and, where a chunk has a layer for each quantity, the sizes of the layers. Source: M. Isenburg, "LASzip: lossless compression of
//! LiDAR data", 2013; the layout of chunks as in LASzip 3.

use std::borrow::Cow;
use std::io::Cursor as Reader;
use std::ops::Range;
use std::path::Path;

use laz::laszip::{ChunkTable, LazItemType};
use laz::{DecompressionSelection, LasZipDecompressor, LazVlr, LazVlrBuilder};
use tyndall::{Error, Result};

use super::HINT;
use crate::read::cursor::Cursor;
use crate::read::guard::guarded;
use crate::read::numbers::Order;

/// Packed bytes of a chunk that is taken out of the file.
const MOST_CHUNK: usize = 16 << 20;

/// What extra bytes are called among the quantities that are wanted.
pub(super) const EXTRA_BYTES: &str = "extra bytes";

/// How the points are packed.
pub(super) struct Packing {
    vlr: LazVlr,
    /// Whether they are cut into chunks, with a table of them.
    chunked: bool,
    /// Whether the chunks have layers.
    layered: bool,
}

impl Packing {
    /// From the record of LASzip; says what is wrong with it.
    pub(super) fn read(record: &[u8]) -> std::result::Result<Self, String> {
        let vlr = LazVlr::from_buffer(record).map_err(|error| error.to_string())?;
        let layers = |it: LazItemType| layers(it).is_some();
        let [all, any] = [
            vlr.items().iter().all(|it| layers(it.item_type())),
            vlr.items().iter().any(|it| layers(it.item_type())),
        ];
        match record {
            [1 | 2, 0, ..] if !any => Ok(Self { vlr, chunked: record[0] == 2, layered: false }),
            [3, 0, ..] if all => Ok(Self { vlr, chunked: true, layered: true }),
            _ => Err("the way of packing does not go with the quantities that are packed".into()),
        }
    }

    /// Bytes of a point, unpacked.
    pub(super) fn record_bytes(&self) -> u64 {
        self.vlr.items_size()
    }
}

/// The layers of a quantity; `None` if it is packed without them.
fn layers(item: LazItemType) -> Option<usize> {
    match item {
        LazItemType::Point14 => Some(9),
        LazItemType::RGB14 | LazItemType::WavePacket14 => Some(1),
        LazItemType::RGBNIR14 => Some(2),
        LazItemType::Byte14(bytes) => Some(bytes.into()),
        _ => None,
    }
}

/// Points that are packed without regard to those before them.
pub(super) struct Chunk {
    /// Their bytes in the file; `None` if nobody tells, so that all points are one chunk.
    bytes: Option<Range<usize>>,
    pub(super) points: usize,
}

impl Packing {
    /// The chunks of `count` points that begin at byte `start` of a file, in order. Fails where the decoder would ask for memory that no
    /// file of this size needs.
    pub(super) fn chunks(&self, path: &Path, bytes: &[u8], start: usize, count: u64) -> Result<Vec<Chunk>> {
        if self.chunked {
            check_table(path, bytes, start, count)?;
        }
        let chunks = match (self.chunked, self.layered) {
            (_, true) => Some(layered_chunks(path, bytes, start, &self.vlr, count)?),
            (true, false) => self.chunks_of_table(bytes, start, count),
            (false, false) => None,
        };
        // A few large ones are better unpacked where they lie.
        let size = |it: &Chunk| it.bytes.as_ref().map_or(0, ExactSizeIterator::len);
        let chunks = chunks.filter(|it| it.len() > 1 && it.iter().all(|it| size(it) <= MOST_CHUNK));
        Ok(chunks.unwrap_or_else(|| vec![Chunk { bytes: None, points: count as usize }]))
    }

    /// The chunks that the table tells; `None` if it does not tell those of all points.
    fn chunks_of_table(&self, bytes: &[u8], start: usize, count: u64) -> Option<Vec<Chunk>> {
        let mut content = Reader::new(bytes);
        content.set_position(start as u64);
        let table = guarded(|| ChunkTable::read_from(&mut content, &self.vlr))?.ok()?;
        let (mut place, mut left, mut chunks) = (content.position(), count, Vec::new());
        for entry in table.as_ref() {
            let points = if self.vlr.uses_variable_size_chunks() {
                entry.point_count
            } else {
                entry.point_count.min(left)
            };
            let end = place.checked_add(entry.byte_count).filter(|&it| it <= bytes.len() as u64)?;
            left = left.checked_sub(points).filter(|_| points > 0)?;
            chunks.push(Chunk { bytes: Some(place as usize..end as usize), points: points as usize });
            place = end;
        }
        (left == 0).then_some(chunks)
    }

    /// Begins to unpack a chunk of a file whose points begin at byte `start`. Of these quantities and the coordinates there are right numbers
    /// when they are unpacked, of others only where they are not in layers of their own.
    pub(super) fn open<'a>(
        &self,
        (path, bytes): (&'a Path, &'a [u8]),
        start: usize,
        chunk: &Chunk,
        names: &[&str],
    ) -> Result<Packed<'a>> {
        let (content, vlr) = match &chunk.bytes {
            None => {
                let mut content = Reader::new(Cow::Borrowed(bytes));
                content.set_position(start as u64);
                (content, self.vlr.clone())
            }
            Some(range) => {
                let items = LazVlrBuilder::new(self.vlr.items().clone());
                let vlr = items.with_fixed_chunk_size(chunk.points.min(u32::MAX as usize - 1) as u32).build();
                (Reader::new(Cow::Owned(alone(&bytes[range.clone()]))), vlr)
            }
        };
        let made = guarded(|| LasZipDecompressor::selective(content, vlr, selection(names)));
        let made = made.ok_or_else(|| fault(path, "the data are damaged".into()))?;
        Ok(Packed { path, decompressor: made.map_err(|error| fault(path, error.to_string()))? })
    }
}

/// A chunk as the only one of a file: where the table is, the chunk, and a table without chunks, of which the decoder needs none then.
fn alone(chunk: &[u8]) -> Vec<u8> {
    let table = 8 + chunk.len() as i64;
    [&table.to_le_bytes(), chunk, &[0; 8]].concat()
}

/// The points that are still packed.
pub(super) struct Packed<'a> {
    path: &'a Path,
    decompressor: LasZipDecompressor<'a, Reader<Cow<'a, [u8]>>>,
}

impl Packed<'_> {
    /// Unpacks the next points.
    pub(super) fn unpack(&mut self, into: &mut [u8]) -> Result<()> {
        // The decoder asserts what damaged data may break.
        let unpacked = guarded(|| self.decompressor.decompress_many(into));
        let unpacked = unpacked.ok_or_else(|| fault(self.path, "the data are damaged".into()))?;
        unpacked.map_err(|error| fault(self.path, error.to_string()))
    }
}

/// The layers in which the coordinates and these quantities are.
fn selection(names: &[&str]) -> DecompressionSelection {
    let base = DecompressionSelection::xy_returns_channel().decompress_z();
    names.iter().fold(base, |selection, name| match *name {
        "classification" => selection.decompress_classification(),
        "synthetic"
        | "key_point"
        | "withheld"
        | "overlap"
        | "scan_direction_flag"
        | "edge_of_flight_line" => selection.decompress_flags(),
        "intensity" => selection.decompress_intensity(),
        "scan_angle" => selection.decompress_scan_angle(),
        "user_data" => selection.decompress_user_data(),
        "point_source_id" => selection.decompress_point_source_id(),
        "gps_time" => selection.decompress_gps_time(),
        "red" | "green" | "blue" => selection.decompress_rgb(),
        "nir" => selection.decompress_nir(),
        EXTRA_BYTES => selection.decompress_extra_bytes(),
        // Numbers of returns and the channel come with the coordinates.
        _ => selection,
    })
}

fn fault(path: &Path, what: String) -> Error {
    Error::format(path, "", format!("the points cannot be unpacked: {what}"), HINT)
}

/// Fails if the table of chunks has more of them than there are points. Where it stands is written before the points, or, by programs that
/// could not go back, at the very end.
fn check_table(path: &Path, bytes: &[u8], start: usize, count: u64) -> Result<()> {
    let place = |at: usize| -> Option<usize> {
        let place = Cursor::new(path, bytes, at, Order::Little, HINT).number::<i64>("a place").ok()?;
        usize::try_from(place).ok().filter(|&it| it > start)
    };
    let Some(table) = place(start).or_else(|| place(bytes.len().checked_sub(8)?)) else { return Ok(()) };
    let mut cursor = Cursor::new(path, bytes, table, Order::Little, HINT);
    // A table that is not there is none: the decoder does without it or says so.
    let (Ok(_), Ok(chunks)) = (cursor.number::<u32>("the version"), cursor.number::<u32>("how many chunks"))
    else {
        return Ok(());
    };
    if u64::from(chunks) > count {
        return Err(cursor.fault(format!("{chunks} chunks are promised for {count} points")));
    }
    Ok(())
}

/// The chunks of points in layers; fails if layers are larger than the file. A chunk is its first point, how many points it has, the sizes
/// of its layers, the layers.
fn layered_chunks(path: &Path, bytes: &[u8], start: usize, vlr: &LazVlr, count: u64) -> Result<Vec<Chunk>> {
    let layers: usize = vlr.items().iter().filter_map(|it| layers(it.item_type())).sum();
    let mut cursor = Cursor::new(path, bytes, start, Order::Little, HINT);
    cursor.skip(8, "the place of the table of chunks")?;
    let (mut left, mut chunks) = (count, Vec::new());
    while left > 0 {
        let begin = cursor.place();
        cursor.skip(vlr.items_size(), "the first point of a chunk")?;
        let points: u32 = cursor.number("how many points a chunk has")?;
        let sizes = (0..layers).map(|_| cursor.number::<u32>("the size of a layer").map(u64::from));
        let sizes = sizes.collect::<Result<Vec<_>>>()?;
        cursor.skip(sizes.iter().sum(), "the layers of a chunk")?;
        let points = if vlr.uses_variable_size_chunks() { points } else { vlr.chunk_size() };
        let points = u64::from(points.max(1)).min(left);
        left -= points;
        chunks.push(Chunk { bytes: Some(begin..cursor.place()), points: points as usize });
    }
    Ok(chunks)
}
