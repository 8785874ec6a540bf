//! Gadget-1 and -2 binary snapshots and initial conditions: formats 1 and 2, in either order of bytes, in one file or several.
//!
//! A file is a chain of Fortran records, each between two copies of its length: a header of 256 bytes, then a block for each
//! quantity, in which the particles stand sorted by their six types. In format 2 a small record before each block has its name;
//! in format 1 the blocks have Gadget-2's order. Which types a block covers follows from its name and size, whether its numbers
//! have four or eight bytes from its size. Lengths that did not fit 32 bits are found by their second copy.
//! Source: Springel, "User guide for GADGET-2", section 6; io.c of Gadget-2.0.7.

use std::path::Path;

use tyndall::{Cell, DVec3, Error, Progress, Result};

use super::content::{self, Content};
use super::cursor::Cursor;
use super::numbers::{Kind, Order};
use super::records::{self, Source};
use super::sections::{self, Column, Section, Value};
use super::snapshot::{self, GADGET_TYPES};
use super::{Index, Request, Span, map};
use crate::sequence::{Frame, Options};

const HINT: &str = "was the file copied to its end, and is it a Gadget snapshot?";
/// Bytes of the header's record.
const HEADER_BYTES: usize = 256;

/// What types a block may cover.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cover {
    All,
    /// Those whose mass is not in the header.
    Weighed,
    Gas,
    Stars,
    GasAndStars,
}

/// A quantity that Gadget and its relatives write.
struct Quantity {
    /// The name of its block in format 2, in lower case.
    name: &'static str,
    components: usize,
    cover: Cover,
}

const fn quantity(name: &'static str, components: usize, cover: Cover) -> Quantity {
    Quantity { name, components, cover }
}

/// The quantities, in the order in which Gadget-2 writes them.
const QUANTITIES: [Quantity; 15] = [
    quantity("pos", 3, Cover::All),
    quantity("vel", 3, Cover::All),
    quantity("id", 1, Cover::All),
    quantity("mass", 1, Cover::Weighed),
    quantity("u", 1, Cover::Gas),
    quantity("rho", 1, Cover::Gas),
    quantity("ne", 1, Cover::Gas),
    quantity("nh", 1, Cover::Gas),
    quantity("hsml", 1, Cover::Gas),
    quantity("sfr", 1, Cover::Gas),
    quantity("age", 1, Cover::Stars),
    quantity("z", 1, Cover::GasAndStars),
    quantity("pot", 1, Cover::All),
    quantity("acce", 3, Cover::All),
    quantity("endt", 1, Cover::Gas),
];

/// Whether the file begins with Gadget's header, or with its name.
pub(crate) fn recognise(head: &[u8]) -> bool {
    order(head).is_some()
}

/// In which order the bytes stand, and whether blocks have names; `None` if this is no such file.
fn order(head: &[u8]) -> Option<(Order, bool)> {
    let number = |at: usize, order| {
        let bytes: [u8; 4] = head.get(at..at + 4)?.try_into().expect("four bytes");
        Some(match order {
            Order::Little => u32::from_le_bytes(bytes),
            Order::Big => u32::from_be_bytes(bytes),
        })
    };
    [Order::Little, Order::Big].into_iter().find_map(|order| {
        let is_record = |at: usize, length: u32| {
            Some(length) == number(at, order) && Some(length) == number(at + 4 + length as usize, order)
        };
        if is_record(0, HEADER_BYTES as u32) {
            return Some((order, false));
        }
        let named = is_record(0, 8)
            && head.get(4..8) == Some(b"HEAD")
            && number(16, order) == Some(HEADER_BYTES as u32);
        named.then_some((order, true))
    })
}

/// What of the header matters here.
#[derive(Clone, Debug)]
struct Header {
    counts: [u32; 6],
    masses: [f64; 6],
    time: f64,
    redshift: f64,
    totals: [u64; 6],
    files: usize,
    box_size: f64,
    omega: f64,
    hubble: f64,
    /// Whether gas cools: then its blocks have electron and hydrogen fractions among them.
    cooling: bool,
}

impl Header {
    fn read(path: &Path, bytes: &[u8], place: usize, order: Order) -> Result<Self> {
        let mut cursor = Cursor::new(path, bytes, place, order, HINT);
        let (mut counts, mut masses) = ([0; 6], [0.0; 6]);
        for count in &mut counts {
            *count = cursor.number("a count of the header")?;
        }
        for mass in &mut masses {
            *mass = cursor.number("a mass of the header")?;
        }
        let [time, redshift] = [cursor.number("the time")?, cursor.number("the redshift")?];
        cursor.take(8, "two flags")?;
        let mut totals = [0u64; 6];
        for total in &mut totals {
            *total = cursor.number::<u32>("a total")?.into();
        }
        let cooling = cursor.number::<i32>("a flag")? != 0;
        let files = cursor.number::<i32>("the number of files")?;
        let box_size = cursor.number("the size of the box")?;
        let omega = cursor.number("the density of matter")?;
        cursor.take(8, "the density of dark energy")?;
        let hubble = cursor.number("the Hubble parameter")?;
        cursor.take(8, "two flags")?;
        for total in &mut totals {
            *total |= u64::from(cursor.number::<u32>("the high word of a total")?) << 32;
        }
        let files = usize::try_from(files).unwrap_or(0).max(1);
        Ok(Self { counts, masses, time, redshift, totals, files, box_size, omega, hubble, cooling })
    }

    fn covers(&self, cover: Cover, kind: usize) -> bool {
        match cover {
            Cover::All => true,
            Cover::Weighed => self.masses[kind] == 0.0,
            Cover::Gas => kind == 0,
            Cover::Stars => kind == 4,
            Cover::GasAndStars => kind == 0 || kind == 4,
        }
    }

    /// How many particles of this file a block of that kind has.
    fn covered(&self, cover: Cover) -> u64 {
        (0..6).filter(|&kind| self.covers(cover, kind)).map(|kind| u64::from(self.counts[kind])).sum()
    }

    /// Whether it is the snapshot of a universe that expands: then the time is the scale factor.
    fn expands(&self) -> bool {
        let is_cosmological = self.omega > 0.0 || self.redshift > 0.0;
        is_cosmological && self.time > 0.0 && (self.time * (1.0 + self.redshift) - 1.0).abs() < 1e-3
    }
}

/// A quantity in a file.
#[derive(Clone, Debug)]
struct Block {
    name: String,
    components: usize,
    cover: Cover,
    kind: Kind,
    start: usize,
}

/// One file, of which the blocks are known.
#[derive(Clone)]
struct File<'a> {
    bytes: &'a [u8],
    order: Order,
    /// Whether its blocks have names: format 2.
    named: bool,
    header: Header,
    blocks: Vec<Block>,
    warnings: Vec<String>,
}

/// A record: its name in format 2, where its content begins and how long that is.
struct Record {
    name: Option<String>,
    start: usize,
    length: usize,
}

/// The record at byte `at`. The length in the file is that of the record modulo 2^32.
fn record(path: &Path, bytes: &[u8], at: usize, order: Order) -> Result<(usize, usize)> {
    let mut cursor = Cursor::new(path, bytes, at, order, HINT);
    let length: u32 = cursor.number("the length of a block")?;
    let start = cursor.place();
    let mut candidate = length as usize;
    while start
        .checked_add(candidate)
        .and_then(|end| end.checked_add(4))
        .is_some_and(|end| end <= bytes.len())
    {
        let mut behind = Cursor::new(path, bytes, start + candidate, order, HINT);
        if behind.number::<u32>("the length behind a block")? == length {
            return Ok((start, candidate));
        }
        candidate += 1 << 32;
    }
    let left = cursor.left();
    Err(cursor.fault(if left < length as usize + 4 {
        format!("a block of {length} bytes begins here, {left} bytes are left")
    } else {
        format!("a block of {length} bytes begins here, but its length is not repeated behind it")
    }))
}

impl<'a> File<'a> {
    fn read(path: &Path, bytes: &'a [u8]) -> Result<Self> {
        let Some((order, named)) = order(bytes) else {
            let what = "wanted the header of a Gadget snapshot: a record of 256 bytes";
            return Err(Error::format(path, "byte 0", what, HINT));
        };
        let (mut records, mut warnings) = (Vec::new(), Vec::new());
        let (mut at, mut name) = (0, None);
        // What is shorter than an empty record is none.
        while bytes.len() - at >= 8 {
            let (start, length) = record(path, bytes, at, order)?;
            at = start + length + 4;
            if named && name.is_none() && length == 8 {
                name = Some(String::from_utf8_lossy(&bytes[start..start + 4]).trim().to_lowercase());
            } else {
                records.push(Record { name: name.take(), start, length });
            }
        }
        match bytes.len() - at {
            0 => {}
            1 => warnings.push("left out: 1 byte behind the last block".to_string()),
            left => warnings.push(format!("left out: {left} bytes behind the last block")),
        }
        if let Some(name) = name {
            let what = format!("the name of block '{name}' stands at the end, without the block");
            return Err(Error::format(path, "", what, HINT));
        }
        let header = Header::read(path, bytes, if named { 20 } else { 4 }, order)?;
        let mut file = Self { bytes, order, named, header, blocks: Vec::new(), warnings };
        file.name_blocks(records.into_iter().skip(1).collect());
        let all = file.header.covered(Cover::All);
        let has_positions =
            file.block("pos").is_some_and(|block| (block.components, block.cover) == (3, Cover::All));
        if all > 0 && !has_positions {
            let what = format!("the header promises {all} particles, but no block has their positions");
            return Err(Error::format(path, "", what, HINT));
        }
        Ok(file)
    }

    /// Gives the records names and types. In format 1 the next quantity of Gadget's order that has the record's size is it.
    fn name_blocks(&mut self, records: Vec<Record>) {
        let gas = self.header.covered(Cover::Gas);
        let in_gas = |record: &&Record| {
            gas > 0
                && [4, 8].contains(&(record.length as u64 / gas))
                && (record.length as u64).is_multiple_of(gas)
        };
        // Electrons and hydrogen come before the smoothing length, in files that have them.
        let cooled = self.header.cooling && records.iter().filter(in_gas).count() >= 5;
        let is_expected = |quantity: &&Quantity| cooled || !matches!(quantity.name, "ne" | "nh");
        let mut expected: Vec<&Quantity> = QUANTITIES.iter().filter(is_expected).collect();
        for (number, record) in records.into_iter().enumerate() {
            if record.length == 0 {
                continue;
            }
            let fits = |quantity: &&&Quantity| {
                self.value_bytes(record.length, quantity.components, quantity.cover).is_some()
            };
            let known = match &record.name {
                Some(name) => QUANTITIES.iter().find(|it| it.name == name).filter(|it| fits(&it)),
                None => {
                    let place = expected.iter().position(|it| fits(&it));
                    place.map(|place| expected.drain(..=place).next_back().expect("it was found"))
                }
            };
            let name = record.name.or(known.map(|it| it.name.to_string()));
            let name = name.unwrap_or_else(|| format!("block{}", number + 1));
            let shape =
                known.map(|it| (it.components, it.cover)).or_else(|| self.shape_by_size(record.length));
            let Some((components, cover)) = shape else {
                self.warnings.push(format!(
                    "left out: block '{name}' of {} bytes, which is no number of values for any type of particles",
                    record.length
                ));
                continue;
            };
            let wide = self.value_bytes(record.length, components, cover) == Some(8);
            let kind = match (name.as_str(), wide) {
                ("id", false) => Kind::U32,
                ("id", true) => Kind::U64,
                (_, false) => Kind::F32,
                (_, true) => Kind::F64,
            };
            self.blocks.push(Block { name, components, cover, kind, start: record.start });
        }
    }

    /// Four or eight, if that is what a block of `length` bytes has for each of its values.
    fn value_bytes(&self, length: usize, components: usize, cover: Cover) -> Option<u64> {
        let values = self.header.covered(cover) * components as u64;
        [4, 8].into_iter().find(|bytes| values > 0 && values * bytes == length as u64)
    }

    /// What a block of which nothing else is known may be, by its size.
    fn shape_by_size(&self, length: usize) -> Option<(usize, Cover)> {
        let covers = [Cover::Gas, Cover::All, Cover::Stars, Cover::GasAndStars];
        let shapes = [1, 3].into_iter().flat_map(|components| covers.map(|cover| (components, cover)));
        shapes.into_iter().find(|&(components, cover)| self.value_bytes(length, components, cover).is_some())
    }

    fn block(&self, name: &str) -> Option<&Block> {
        self.blocks.iter().find(|it| it.name == name)
    }

    /// Where a block has the particles of a type.
    fn source(&self, block: &Block, kind: usize) -> Option<Source<'a>> {
        if !self.header.covers(block.cover, kind) {
            return None;
        }
        let before = (0..kind).filter(|&kind| self.header.covers(block.cover, kind));
        let before: usize = before.map(|kind| self.header.counts[kind] as usize).sum();
        let step = block.kind.size();
        let stride = block.components * step;
        Some(Source {
            bytes: self.bytes,
            kind: block.kind,
            order: self.order,
            start: block.start + before * stride,
            stride,
            step,
        })
    }

    /// What it has of a column for a type.
    fn value(&self, column: &str, kind: usize) -> Value<'a> {
        if column == "mass" && self.header.masses[kind] != 0.0 {
            return Value::All(self.header.masses[kind]);
        }
        self.block(column).and_then(|block| self.source(block, kind)).map_or(Value::Missing, Value::Each)
    }
}

/// Finds the one frame.
pub(crate) fn index(path: &Path, bytes: &[u8], options: &Options) -> Result<Index> {
    let file = File::read(path, bytes)?;
    let format = if file.named { 2 } else { 1 };
    let order = match file.order {
        Order::Little => "little",
        Order::Big => "big",
    };
    let (files, _) = snapshot::files(path, file.header.files, options.strict)?;
    let spread = match files.len() {
        1 => String::new(),
        count => format!(", {count} files"),
    };
    Ok(Index {
        frames: vec![Span { offset: 0, line: 1, bytes: Some(bytes.len() as u64) }],
        title: Some(format!("Gadget format {format}, {order}-endian{spread}")),
        files,
        ..Index::default()
    })
}

/// Reads the particles of the wanted types, from all files of the snapshot.
pub(crate) fn frame(
    path: &Path,
    bytes: &[u8],
    _: Span,
    request: &Request,
    progress: &dyn Progress,
) -> Result<Frame> {
    let wanted = snapshot::wanted(request.options, &GADGET_TYPES)?;
    let own = File::read(path, bytes)?;
    let (paths, missing) = snapshot::files(path, own.header.files, request.options.strict)?;
    let others: Vec<Option<Content>> = paths
        .iter()
        .map(|other| if other == path { Ok(None) } else { content::content(other).map(Some) })
        .collect::<Result<_>>()?;
    let files: Vec<File> = paths
        .iter()
        .zip(&others)
        .map(|(path, other)| match other {
            Some(content) => File::read(path, content.as_ref()),
            None => Ok(own.clone()),
        })
        .collect::<Result<_>>()?;
    let total = files.iter().map(|it| it.bytes.len() as u64).sum();
    progress.begin("read", Some(total), "B");
    let maps = others.iter().flatten().filter_map(Content::map);
    let progress = &map::released(maps, progress);

    let chosen = |file: &File, kind: usize| wanted[kind] && file.header.counts[kind] > 0;
    let runs: Vec<(&File, usize)> = files
        .iter()
        .flat_map(|file| (0..6).filter(|&kind| chosen(file, kind)).map(move |kind| (file, kind)))
        .collect();
    let is_present = |kind: &usize| files.iter().any(|file| file.header.counts[*kind] > 0);
    if runs.is_empty() && request.options.types.is_some() {
        let present: Vec<&str> = (0..6).filter(is_present).map(|kind| GADGET_TYPES[kind][0]).collect();
        return Err(snapshot::none_wanted(request.options, &present));
    }
    let mut columns: Vec<Column> = Vec::new();
    for (file, kind) in &runs {
        for block in file.blocks.iter().filter(|it| it.name != "pos" && file.header.covers(it.cover, *kind)) {
            if !columns.iter().any(|it| it.name == block.name) {
                columns.push(Column::new(&block.name, block.components));
            }
        }
        if file.header.masses[*kind] != 0.0 && !columns.iter().any(|it| it.name == "mass") {
            columns.push(Column::new("mass", 1));
        }
    }
    let flags = sections::flags(&columns, request.options.wanted.as_ref());
    let columns = sections::flagged(columns, &flags);
    let sections: Vec<Section> = runs
        .iter()
        .map(|&(file, kind)| {
            let positions =
                file.block("pos").and_then(|block| file.source(block, kind)).expect("checked by File::read");
            let values = columns.iter().map(|it| match file.value(&it.name, kind) {
                // Files of one snapshot that disagree about a block's shape are damaged.
                Value::Each(_)
                    if file.block(&it.name).is_some_and(|block| block.components != it.components) =>
                {
                    Value::Missing
                }
                value => value,
            });
            Section {
                count: file.header.counts[kind] as usize,
                axes: [0, 1, 2].map(|axis| positions.component(axis)),
                values: values.collect(),
            }
        })
        .collect();

    let cell = cell(&own.header);
    let mut gathered =
        sections::gather(path, &columns, &sections, cell.map(|it| it.center()), total, progress)?;
    let runs = runs.iter().map(|&(file, kind)| (GADGET_TYPES[kind][0], file.header.counts[kind] as usize));
    gathered.attributes.insert(0, snapshot::type_attribute(runs));
    gathered.cell = cell;
    gathered.time = own.header.time.is_finite().then_some(own.header.time);
    gathered.time_unit = own.header.expands().then(|| "a".to_string());

    let is_whole = missing.is_none() && own.header.files > 1;
    let mut warnings: Vec<String> = missing.into_iter().collect();
    warnings.extend(files.iter().flat_map(|it| it.warnings.clone()));
    warnings.extend(disagreement(&own.header, &files).filter(|_| is_whole));
    records::frame(gathered, conventions(&own, files.len()), warnings)
}

/// The periodic box, if the header has one.
fn cell(header: &Header) -> Option<Cell> {
    let edge = header.box_size;
    (edge > 0.0 && edge.is_finite()).then(|| Cell {
        origin: DVec3::ZERO,
        vectors: [DVec3::X * edge, DVec3::Y * edge, DVec3::Z * edge],
        periodic: [true; 3],
    })
}

/// What is to be said where the files do not have as many particles as their header promises.
fn disagreement(own: &Header, files: &[File]) -> Option<String> {
    let found: Vec<u64> =
        (0..6).map(|kind| files.iter().map(|it| u64::from(it.header.counts[kind])).sum()).collect();
    let kind = (0..6).find(|&kind| found[kind] != own.totals[kind])?;
    Some(format!(
        "the header promises {} particles of type {} in all files, {} are there",
        own.totals[kind], GADGET_TYPES[kind][0], found[kind]
    ))
}

fn conventions(own: &File, files: usize) -> Vec<String> {
    let (mut lines, header) = (Vec::new(), &own.header);
    if !own.named && !own.blocks.is_empty() {
        let names: Vec<&str> = own.blocks.iter().map(|it| it.name.as_str()).collect();
        lines.push(format!(
            "blocks have no names in this format: taken by order and size as {}",
            names.join(" ")
        ));
    }
    let hubble = if header.hubble > 0.0 { format!(", h = {}", header.hubble) } else { String::new() };
    let usual = "units are not in the file, usual are kpc/h, 10^10 Msun/h and km/s";
    lines.push(match header.expands() {
        true => format!(
            "lengths and velocities as in the file: comoving, a = {:.6}{hubble}; vel times sqrt(a) is the peculiar velocity; {usual}",
            header.time
        ),
        false => format!("lengths and velocities as in the file; {usual}"),
    });
    if cell(header).is_some() {
        lines.push("BoxSize is taken as a cell that repeats, from 0 on".to_string());
    }
    if files > 1 {
        lines.push(format!("{files} files are read as one snapshot"));
    }
    lines
}

#[cfg(test)]
mod tests;
