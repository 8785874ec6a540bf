//! NPZ: arrays in a zip archive, stored or deflated.
//!
//! Takes the archive, gives the headers of its arrays, then those that are asked for; a stored one is not copied. Memory is asked for as
//! values come out of the decoder, never more than the array's own header needs, and entries that overlap (a way to make a small file unpack
//! to a huge one) are refused.

use std::borrow::Cow;
use std::io::{Cursor, Read};
use std::path::Path;

use rayon::prelude::*;
use tyndall::{Error, Progress, Result};
use zip::read::ZipFile;
use zip::{CompressionMethod, ZipArchive};

use super::header::{Fault, Header};

/// Bytes that are unpacked between two looks at the progress.
const CHUNK_BYTES: usize = 1 << 20;

const HINT: &str = "the file is cut off or damaged: write it again with numpy.savez";

/// An archive whose arrays are known by their headers.
pub(super) struct Archive<'a> {
    bytes: &'a [u8],
    zip: ZipArchive<Cursor<&'a [u8]>>,
    /// The arrays.
    pub(super) entries: Vec<Entry>,
    /// The place of each in the directory.
    places: Vec<usize>,
}

/// An array of an archive: its name, and what it is, or why that cannot be read.
pub(super) struct Entry {
    pub(super) name: String,
    pub(super) header: std::result::Result<Header, Fault>,
}

fn wrong(path: &Path, place: &str, what: String) -> Error {
    Error::format(path, place, what, HINT)
}

impl<'a> Archive<'a> {
    /// Reads the headers.
    pub(super) fn open(path: &Path, bytes: &'a [u8]) -> Result<Self> {
        let zip = ZipArchive::new(Cursor::new(bytes)).map_err(|error| {
            wrong(path, "", format!("the directory of the archive cannot be read: {error}"))
        })?;
        let packed =
            (0..zip.len()).map(|place| zip.by_index_data(place).map_or(0, |it| it.compressed_size()));
        if packed.fold(0, u64::saturating_add) > bytes.len() as u64 {
            return Err(wrong(path, "", "the entries of the archive overlap".into()));
        }
        let entry = |place| Ok(read_header(path, &mut zip.clone(), place)?.map(|entry| (place, entry)));
        let found: Vec<(usize, Entry)> =
            (0..zip.len()).into_par_iter().map(entry).filter_map(Result::transpose).collect::<Result<_>>()?;
        let (places, entries) = found.into_iter().unzip();
        Ok(Self { bytes, zip, entries, places })
    }

    /// Reads those of the arrays that are needed, in parallel, with their headers; advances `progress` by the bytes of all.
    pub(super) fn read(
        &self,
        path: &Path,
        is_needed: impl Fn(usize) -> bool + Sync,
        progress: &dyn Progress,
    ) -> Result<Vec<Option<Cow<'a, [u8]>>>> {
        let read = |number: usize| {
            let mut zip = self.zip.clone();
            let Entry { name, header } = &self.entries[number];
            let mut file =
                zip.by_index(self.places[number]).map_err(|error| wrong(path, name, error.to_string()))?;
            let packed_bytes = file.compressed_size();
            let content = match header {
                // The header of a damaged one may be what is damaged.
                _ if file.compression() == CompressionMethod::Stored
                    && (is_needed(number) || header.is_err()) =>
                {
                    Some(Cow::Borrowed(self.stored(path, name, &mut file, progress)?))
                }
                Ok(header) if is_needed(number) => {
                    let values = inflate(&mut file, header, progress).map_err(|error| match error {
                        Stop::Interrupted => Error::Interrupted,
                        Stop::Read(error) => {
                            wrong(path, name, format!("the array cannot be unpacked: {error}"))
                        }
                    })?;
                    Some(Cow::Owned(values))
                }
                _ => None,
            };
            progress.advance(packed_bytes);
            Ok(content)
        };
        (0..self.entries.len()).into_par_iter().map(read).collect()
    }

    /// A stored entry, which is as it was written.
    fn stored(
        &self,
        path: &Path,
        name: &str,
        file: &mut ZipFile<'_, Cursor<&'a [u8]>>,
        progress: &dyn Progress,
    ) -> Result<&'a [u8]> {
        let start = file.data_start().and_then(|start| usize::try_from(start).ok());
        let length = usize::try_from(file.size()).ok();
        let values = start.zip(length).and_then(|(start, length)| self.bytes.get(start..)?.get(..length));
        let values =
            values.ok_or_else(|| wrong(path, name, "the array reaches beyond the end of the file".into()))?;
        let mut sum = flate2::Crc::new();
        for chunk in values.chunks(CHUNK_BYTES) {
            if progress.cancelled() {
                return Err(Error::Interrupted);
            }
            sum.update(chunk);
        }
        match sum.sum() == file.crc32() {
            true => Ok(values),
            false => Err(wrong(path, name, "the array's checksum is wrong".into())),
        }
    }
}

/// Reads the header of an array; `None` if the entry is none.
fn read_header(path: &Path, zip: &mut ZipArchive<Cursor<&[u8]>>, place: usize) -> Result<Option<Entry>> {
    let mut file =
        zip.by_index(place).map_err(|error| wrong(path, &format!("entry {place}"), error.to_string()))?;
    let name = file.name().map_or_else(|_| format!("entry {place}"), Cow::into_owned);
    let Some(name) = name.strip_suffix(".npy").map(str::to_string) else { return Ok(None) };
    let head = |file: &mut dyn Read| -> std::io::Result<_> {
        let mut head = Vec::new();
        file.take(12).read_to_end(&mut head)?;
        Ok(match Header::length(&head) {
            Ok(length) => {
                file.take((length as u64).saturating_sub(12)).read_to_end(&mut head)?;
                Header::read(&head)
            }
            Err(fault) => Err(fault),
        })
    };
    let header = head(&mut file)
        .map_err(|error| wrong(path, &name, format!("the array cannot be unpacked: {error}")))?;
    Ok(Some(Entry { name, header }))
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

/// Unpacks an array with this header.
fn inflate(
    file: &mut ZipFile<'_, Cursor<&[u8]>>,
    header: &Header,
    progress: &dyn Progress,
) -> std::result::Result<Vec<u8>, Stop> {
    let needed =
        header.values_bytes().map_or(u64::MAX, |bytes| (bytes as u64).saturating_add(header.start as u64));
    let mut values = Vec::new();
    let mut left = needed.min(file.size());
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
    Ok(values)
}
