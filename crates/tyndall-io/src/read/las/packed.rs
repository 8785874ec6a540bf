//! Points that LASzip packed, unpacked one after the other by the crate laz.
//!
//! That crate asks for the memory that sizes in the file promise, so what it will read of them is checked before: the number of chunks in
//! their table and, where a chunk has a layer for each quantity, the sizes of the layers. Source: M. Isenburg, "LASzip: lossless compression of
//! LiDAR data", 2013; the layout of chunks as in LASzip 3.

use std::io::Cursor as Reader;
use std::path::Path;

use laz::laszip::LazItemType;
use laz::{DecompressionSelection, LasZipDecompressor, LazVlr};
use tyndall::{Error, Result};

use super::HINT;
use crate::read::cursor::Cursor;
use crate::read::guard::guarded;
use crate::read::numbers::Order;

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

/// The points that are still packed.
pub(super) struct Packed<'a> {
    path: &'a Path,
    decompressor: LasZipDecompressor<'a, Reader<&'a [u8]>>,
}

impl<'a> Packed<'a> {
    /// `count` points that begin at byte `start` of a file. Of these quantities and the coordinates there are right numbers when they are
    /// unpacked, of others only where they are not in layers of their own.
    pub(super) fn new(
        (path, bytes): (&'a Path, &'a [u8]),
        start: usize,
        packing: &Packing,
        count: u64,
        names: &[&str],
    ) -> Result<Self> {
        let vlr = &packing.vlr;
        if packing.chunked {
            check_table(path, bytes, start, count)?;
        }
        if packing.layered {
            check_layers(path, bytes, start, vlr, count)?;
        }
        let mut content = Reader::new(bytes);
        content.set_position(start as u64);
        let made = guarded(|| LasZipDecompressor::selective(content, vlr.clone(), selection(names)));
        let made = made.ok_or_else(|| fault(path, "the data are damaged".into()))?;
        Ok(Self { path, decompressor: made.map_err(|error| fault(path, error.to_string()))? })
    }

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

/// Fails if layers are larger than the file. A chunk is its first point, how many points it has, the sizes of its layers, the layers.
fn check_layers(path: &Path, bytes: &[u8], start: usize, vlr: &LazVlr, count: u64) -> Result<()> {
    let layers: usize = vlr.items().iter().filter_map(|it| layers(it.item_type())).sum();
    let mut cursor = Cursor::new(path, bytes, start, Order::Little, HINT);
    cursor.skip(8, "the place of the table of chunks")?;
    let mut left = count;
    while left > 0 {
        cursor.skip(vlr.items_size(), "the first point of a chunk")?;
        let points: u32 = cursor.number("how many points a chunk has")?;
        let sizes = (0..layers).map(|_| cursor.number::<u32>("the size of a layer").map(u64::from));
        let sizes = sizes.collect::<Result<Vec<_>>>()?;
        cursor.skip(sizes.iter().sum(), "the layers of a chunk")?;
        let points = if vlr.uses_variable_size_chunks() { points } else { vlr.chunk_size() };
        left = left.saturating_sub(points.max(1).into());
    }
    Ok(())
}
