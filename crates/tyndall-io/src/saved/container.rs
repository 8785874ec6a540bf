//! The file: a header, sections that begin where pages do, and a table of them at the end. Invariant of a [`Table`]: all its sections lie
//! in the file, between header and table.
//!
//! All numbers are little-endian. Header and table have checksums that are looked at whenever a file is opened; those of the sections
//! take a pass over the file. A file is whole where it is as long as its header says.

use std::collections::HashSet;
use std::hash::Hasher;
use std::io::{self, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::Path;

use rayon::prelude::*;
use twox_hash::XxHash3_64;
use tyndall::{Error, Progress, Result};

use super::fault;

/// What a file begins with: no text, and broken by what breaks line ends.
pub(crate) const MAGIC: [u8; 8] = *b"\x89TYN\r\n\x1a\n";
/// The version of the layout that is written, and the latest that is read.
pub(crate) const VERSION: u32 = 1;
/// Says in which order bytes are.
const ORDER: u32 = 0x0102_0304;
/// Where sections may begin: a multiple of the size of pages.
const ALIGNMENT: u64 = 4096;
const HEADER_BYTES: usize = 128;
/// An entry of the table: name, kind, offset, length, checksum.
const ENTRY_BYTES: usize = 64;
const NAME_BYTES: usize = 32;
const KIND_BYTES: usize = 8;
/// Where the header says who wrote the file, and where its own checksum is.
const WRITER: Range<usize> = 48..112;
const HEADER_CHECKSUM: usize = 120;
/// How much is written or checked between two looks at the progress.
const STEP: usize = 1 << 20;

/// A run of bytes with a name.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Section {
    pub(super) name: String,
    /// What its items are: `f32`, `f64`, `i32`, `i64`, `u8`, `u32`, `u64`, `json`, or `record`.
    pub(super) kind: String,
    pub(super) range: Range<usize>,
    checksum: u64,
}

/// What is in a file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Table {
    pub(super) writer: String,
    pub(super) sections: Vec<Section>,
}

fn checksum(bytes: &[u8]) -> u64 {
    XxHash3_64::oneshot(bytes)
}

/// The number at a place that is there.
fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes"))
}

fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(bytes[at..at + 8].try_into().expect("eight bytes"))
}

/// Text that ends where zeros begin.
fn text(bytes: &[u8]) -> Option<String> {
    let end = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
    let rest_is_zero = bytes[end..].iter().all(|&byte| byte == 0);
    std::str::from_utf8(&bytes[..end]).ok().filter(|_| rest_is_zero).map(str::to_string)
}

impl Table {
    /// Reads and checks header and table of a file with this content.
    pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<Self> {
        if cfg!(target_endian = "big") {
            let hint = "read it on another machine";
            return Err(Error::format(
                path,
                "",
                "its numbers are little-endian, this machine's are not",
                hint,
            ));
        }
        let cut = |there: u64, wanted: u64| {
            let what = format!("the file ends early: it has {there} of {wanted} bytes");
            Error::format(path, "", what, "was it written and copied to its end?")
        };
        let there = bytes.len() as u64;
        let Some(header) = bytes.get(..HEADER_BYTES) else { return Err(cut(there, HEADER_BYTES as u64)) };
        if !header.starts_with(&MAGIC) {
            return Err(fault(path, "header", "it does not begin like a .tyn file"));
        }
        let (version, order) = (u32_at(header, 8), u32_at(header, 12));
        if order == ORDER.swap_bytes() {
            return Err(fault(path, "header", "it was written by a big-endian machine"));
        }
        if version > VERSION && order == ORDER {
            let what = format!("it is a .tyn file of version {version}, versions up to {VERSION} are known");
            return Err(Error::format(path, "header", what, "take a newer Tyndall, or build the file anew"));
        }
        let is_whole = checksum(&header[..HEADER_CHECKSUM]) == u64_at(header, HEADER_CHECKSUM);
        if !is_whole || order != ORDER || version == 0 {
            return Err(fault(path, "header", "it is damaged: its checksum is another"));
        }
        let [at, count, length] = [16, 24, 32].map(|place| u64_at(header, place));
        if there != length {
            return match there < length {
                true => Err(cut(there, length)),
                false => Err(fault(path, "", format!("it has {there} bytes, its header tells of {length}"))),
            };
        }
        let table = usize::try_from(at).ok().and_then(|at| bytes.get(at..));
        let table = table.filter(|table| Some(table.len() as u64) == count.checked_mul(ENTRY_BYTES as u64));
        let Some(table) = table.filter(|_| at >= HEADER_BYTES as u64) else {
            return Err(fault(path, "header", "its table of sections is not at the end of the file"));
        };
        if checksum(table) != u64_at(header, 40) {
            return Err(fault(path, "table of sections", "it is damaged: its checksum is another"));
        }
        let (mut sections, mut names) = (Vec::new(), HashSet::new());
        for (place, entry) in table.chunks_exact(ENTRY_BYTES).enumerate() {
            let section = section(entry, at).filter(|it| names.insert(it.name.clone()));
            let section = section.ok_or_else(|| {
                fault(path, format!("table of sections, entry {place}"), "no section can be so")
            })?;
            sections.push(section);
        }
        let writer = text(&header[WRITER]).unwrap_or_default();
        Ok(Self { writer, sections })
    }

    /// The section of that name.
    pub(super) fn section(&self, name: &str) -> Option<&Section> {
        self.sections.iter().find(|it| it.name == name)
    }

    /// The bytes of a section, which are as they were written.
    pub(super) fn checked<'a>(&self, path: &Path, bytes: &'a [u8], name: &str) -> Result<&'a [u8]> {
        let section = self.section(name).ok_or_else(|| fault(path, name, "the section is not there"))?;
        let bytes = &bytes[section.range.clone()];
        match checksum(bytes) == section.checksum {
            true => Ok(bytes),
            false => Err(damaged(path, section)),
        }
    }

    /// See [`super::Saved::check`].
    pub(super) fn check(&self, path: &Path, bytes: &[u8], progress: &dyn Progress) -> Result<()> {
        let total = self.sections.iter().map(|it| it.range.len() as u64).sum();
        progress.begin("check", Some(total), "B");
        let check = |section: &Section| {
            let mut hasher = XxHash3_64::new();
            for part in bytes[section.range.clone()].chunks(STEP) {
                if progress.cancelled() {
                    return Err(Error::Interrupted);
                }
                hasher.write(part);
                progress.advance(part.len() as u64);
            }
            if hasher.finish() == section.checksum { Ok(()) } else { Err(damaged(path, section)) }
        };
        self.sections.par_iter().with_max_len(1).try_for_each(check)
    }
}

fn damaged(path: &Path, section: &Section) -> Error {
    let Range { start, end } = section.range;
    fault(
        path,
        &section.name,
        format!("the section is damaged, bytes {start} to {end}: its checksum is another"),
    )
}

/// The section that an entry of the table tells of, if it ends before `end`.
fn section(entry: &[u8], end: u64) -> Option<Section> {
    let (name, rest) = entry.split_at(NAME_BYTES);
    let (kind, numbers) = rest.split_at(KIND_BYTES);
    let (start, bytes) = (u64_at(numbers, 0), u64_at(numbers, 8));
    let stop = start.checked_add(bytes).filter(|&stop| stop <= end)?;
    let is_placed = start.is_multiple_of(ALIGNMENT) && start >= ALIGNMENT;
    let range = usize::try_from(start).ok()?..usize::try_from(stop).ok()?;
    is_placed.then_some(Section {
        name: text(name)?,
        kind: text(kind)?,
        range,
        checksum: u64_at(numbers, 16),
    })
}

/// Writes a file from front to back, and its header last.
pub(super) struct Writer<'a, W> {
    out: &'a mut W,
    at: u64,
    table: Vec<u8>,
    progress: &'a dyn Progress,
}

impl<'a, W: Write + Seek> Writer<'a, W> {
    pub(super) fn new(out: &'a mut W, progress: &'a dyn Progress) -> io::Result<Self> {
        out.write_all(&[0; ALIGNMENT as usize])?;
        Ok(Self { out, at: ALIGNMENT, table: Vec::new(), progress })
    }

    /// Appends a section. Names have at most 32 bytes, kinds at most 8.
    pub(super) fn section(&mut self, name: &str, kind: &str, bytes: &[u8]) -> io::Result<()> {
        let mut hasher = XxHash3_64::new();
        for part in bytes.chunks(STEP) {
            if self.progress.cancelled() {
                return Err(io::Error::other(Error::Interrupted));
            }
            hasher.write(part);
            self.out.write_all(part)?;
            self.progress.advance(part.len() as u64);
        }
        let start = self.at;
        self.padded(name, NAME_BYTES);
        self.padded(kind, KIND_BYTES);
        for number in [start, bytes.len() as u64, hasher.finish()] {
            self.table.extend(number.to_le_bytes());
        }
        let end = start + bytes.len() as u64;
        self.at = end.next_multiple_of(ALIGNMENT);
        self.out.write_all(&[0; ALIGNMENT as usize][..(self.at - end) as usize])
    }

    fn padded(&mut self, text: &str, bytes: usize) {
        assert!(text.len() <= bytes, "'{text}' has more than {bytes} bytes");
        let end = self.table.len() + bytes;
        self.table.extend(text.bytes());
        self.table.resize(end, 0);
    }

    /// Writes table and header; how many bytes the file has.
    pub(super) fn finish(self, writer: &str) -> io::Result<u64> {
        self.out.write_all(&self.table)?;
        let length = self.at + self.table.len() as u64;
        let mut header = MAGIC.to_vec();
        header.extend(VERSION.to_le_bytes());
        header.extend(ORDER.to_le_bytes());
        header.extend(self.at.to_le_bytes());
        header.extend(((self.table.len() / ENTRY_BYTES) as u64).to_le_bytes());
        header.extend(length.to_le_bytes());
        header.extend(checksum(&self.table).to_le_bytes());
        header.extend(writer.bytes().take(WRITER.len()));
        header.resize(HEADER_CHECKSUM, 0);
        header.extend(checksum(&header).to_le_bytes());
        self.out.seek(SeekFrom::Start(0))?;
        self.out.write_all(&header)?;
        Ok(length)
    }
}
