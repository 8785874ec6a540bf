//! NPZ: arrays in a zip archive, stored or deflated.
//!
//! Takes the archive, gives its arrays; a stored one is not copied. Memory is asked for as values come out of the decoder, never
//! more than the array's own header needs, and entries that overlap (a way to make a small file unpack to a huge one) are refused.

use std::borrow::Cow;
use std::io::{Cursor, Read};
use std::path::Path;

use rayon::prelude::*;
use tyndall::{Error, Progress, Result};
use zip::{CompressionMethod, ZipArchive};

use super::header::{Fault, Header};

/// Bytes that are unpacked between two looks at the progress.
const CHUNK_BYTES: usize = 1 << 20;

const HINT: &str = "the file is cut off or damaged: write it again with numpy.savez";

/// An array of an archive: its name, and what it holds, or why that cannot be read.
pub(super) struct Entry<'a> {
    pub(super) name: String,
    pub(super) content: std::result::Result<(Header, Cow<'a, [u8]>), Fault>,
}

/// Reads all arrays, in parallel, and advances `progress` by the bytes of the file.
pub(super) fn read<'a>(path: &Path, bytes: &'a [u8], progress: &dyn Progress) -> Result<Vec<Entry<'a>>> {
    let wrong = |what: String| Error::format(path, "", what, HINT);
    let archive = ZipArchive::new(Cursor::new(bytes))
        .map_err(|error| wrong(format!("the directory of the archive cannot be read: {error}")))?;
    let packed =
        (0..archive.len()).map(|place| archive.by_index_data(place).map_or(0, |it| it.compressed_size()));
    if packed.fold(0, u64::saturating_add) > bytes.len() as u64 {
        return Err(wrong("the entries of the archive overlap".into()));
    }
    let entry = |place| {
        let mut archive = archive.clone();
        read_entry(path, bytes, &mut archive, place, progress)
    };
    (0..archive.len()).into_par_iter().map(entry).filter_map(Result::transpose).collect()
}

/// Reads one array; `None` if the entry is none.
fn read_entry<'a>(
    path: &Path,
    bytes: &'a [u8],
    archive: &mut ZipArchive<Cursor<&'a [u8]>>,
    place: usize,
    progress: &dyn Progress,
) -> Result<Option<Entry<'a>>> {
    let wrong = |name: &str, what: String| Error::format(path, name, what, HINT);
    let mut file =
        archive.by_index(place).map_err(|error| wrong(&format!("entry {place}"), error.to_string()))?;
    let name = file.name().map_or_else(|_| format!("entry {place}"), Cow::into_owned);
    let Some(name) = name.strip_suffix(".npy").map(str::to_string) else { return Ok(None) };
    let (packed_bytes, size) = (file.compressed_size(), file.size());
    let content = if file.compression() == CompressionMethod::Stored {
        let start = file.data_start().and_then(|start| usize::try_from(start).ok());
        let length = usize::try_from(size).ok();
        let values = start.zip(length).and_then(|(start, length)| bytes.get(start..)?.get(..length));
        let values =
            values.ok_or_else(|| wrong(&name, "the array reaches beyond the end of the file".into()))?;
        let mut sum = flate2::Crc::new();
        for chunk in values.chunks(CHUNK_BYTES) {
            if progress.cancelled() {
                return Err(Error::Interrupted);
            }
            sum.update(chunk);
        }
        if sum.sum() != file.crc32() {
            return Err(wrong(&name, "the array's checksum is wrong".into()));
        }
        Header::read(values).map(|header| (header, Cow::Borrowed(values)))
    } else {
        inflate(&mut file, size, progress)
            .map_err(|error| match error {
                Stop::Interrupted => Error::Interrupted,
                Stop::Read(error) => wrong(&name, format!("the array cannot be unpacked: {error}")),
            })?
            .map(|(header, values)| (header, Cow::Owned(values)))
    };
    progress.advance(packed_bytes);
    Ok(Some(Entry { name, content }))
}

enum Stop {
    Interrupted,
    Read(std::io::Error),
}

impl From<std::io::Error> for Stop {
    fn from(error: std::io::Error) -> Self {
        Self::Read(error)
    }
}

/// Unpacks an array: its header first, which says how much is behind it.
fn inflate(
    file: &mut impl Read,
    size: u64,
    progress: &dyn Progress,
) -> std::result::Result<std::result::Result<(Header, Vec<u8>), Fault>, Stop> {
    let mut values = Vec::new();
    file.by_ref().take(12).read_to_end(&mut values)?;
    let header = match Header::length(&values) {
        Ok(length) => {
            file.by_ref().take((length as u64).saturating_sub(12)).read_to_end(&mut values)?;
            Header::read(&values)
        }
        Err(fault) => Err(fault),
    };
    let header = match header {
        Ok(header) => header,
        Err(fault) => return Ok(Err(fault)),
    };
    let needed =
        header.values_bytes().map_or(u64::MAX, |bytes| (bytes as u64).saturating_add(header.start as u64));
    let mut left = needed.min(size).saturating_sub(values.len() as u64);
    while left > 0 {
        if progress.cancelled() {
            return Err(Stop::Interrupted);
        }
        let got = file.by_ref().take(left.min(CHUNK_BYTES as u64)).read_to_end(&mut values)?;
        if got == 0 {
            break;
        }
        left -= got as u64;
    }
    // The checksum is compared when the end is met.
    if file.read(&mut [0])? > 0 {
        return Err(Stop::Read(std::io::Error::other("there is more in the entry than the array")));
    }
    Ok(Ok((header, values)))
}
