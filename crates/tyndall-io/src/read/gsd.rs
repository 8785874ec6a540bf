//! GSD: snapshots of HOOMD-blue, frame after frame.
//!
//! A header tells where the index and the list of names stand. The index has an entry for every chunk: its frame, name, type, rows and
//! columns. A chunk that a frame does not have is that of frame 0, if it has as many rows, else it has the default of the schema. The box is
//! around zero, with tilts as factors. Lengths have no unit. Numbers are little-endian. Source: GSD documentation, file layer
//! (versions 1 and 2) and HOOMD schema 1.4.

use std::collections::HashMap;
use std::path::Path;

use tyndall::particles::{Attribute, Radii, Values};
use tyndall::{Cell, DVec3, Error, Progress, Result};

use super::cursor::Cursor;
use super::numbers::{Kind, Order};
use super::records::{self, Field, Layout, Source};
use super::{Index, Request, Span};
use crate::sequence::{Frame, Options};

const MAGIC: u64 = 0x65df_65df_65df_65df;
const HINT: &str = "check it with gsd read, and copy or write it again";
/// The size of an entry of the index, and of the room for a name.
const ENTRY_BYTES: usize = 32;
const NAME_BYTES: u64 = 64;
/// The columns that are read, but positions: chunk, attribute, columns.
const WANTED: [(&str, &str, usize); 10] = [
    ("particles/typeid", "typeid", 1),
    ("particles/mass", "mass", 1),
    ("particles/charge", "charge", 1),
    ("particles/diameter", "diameter", 1),
    ("particles/body", "body", 1),
    ("particles/velocity", "velocity", 3),
    ("particles/image", "image", 3),
    ("particles/orientation", "orientation", 4),
    ("particles/angmom", "angmom", 4),
    ("particles/moment_inertia", "moment_inertia", 3),
];
/// What stands before the names of quantities that users log for each particle.
const LOGGED: &str = "log/particles/";

/// Whether the file begins like GSD.
pub(crate) fn recognise(head: &[u8]) -> bool {
    head.starts_with(&MAGIC.to_le_bytes())
}

/// A chunk of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Entry {
    frame: u64,
    rows: u64,
    place: u64,
    columns: u64,
    name: u16,
    /// `None` for letters.
    kind: Option<Kind>,
}

/// The header and the names; the index is read where it is asked.
struct File<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    index: &'a [u8],
    names: HashMap<String, u16>,
}

impl<'a> File<'a> {
    fn open(path: &'a Path, bytes: &'a [u8]) -> Result<Self> {
        let mut cursor = Cursor::new(path, bytes, 0, Order::Little, HINT);
        cursor.take(8, "the magic number")?;
        let mut numbers = [0u64; 4];
        for number in &mut numbers {
            *number = cursor.number("where the index is")?;
        }
        let [index_at, index_count, names_at, names_count] = numbers;
        let _schema_version: u32 = cursor.number("the version of the schema")?;
        let version: u32 = cursor.number("the version")?;
        let major = version >> 16;
        if !(1..=2).contains(&major) {
            return Err(
                cursor.fault(format!("GSD versions 1 and 2 are read, this is {major}.{}", version & 0xffff))
            );
        }
        cursor.take(64, "the application")?;
        let schema = cursor.text(64, "the schema")?;
        let schema = schema.trim_end_matches('\0');
        if schema != "hoomd" {
            let what = format!("schema 'hoomd' is read, this is '{schema}'");
            return Err(Error::format(path, "", what, "save the particles with gsd.hoomd"));
        }
        let part = |place: u64, count: u64, size: u64, what: &str| {
            let place = usize::try_from(place).unwrap_or(usize::MAX);
            let mut cursor = Cursor::new(path, bytes, place, Order::Little, HINT);
            let count = count.checked_mul(size).and_then(|it| usize::try_from(it).ok()).unwrap_or(usize::MAX);
            cursor.take(count, what)
        };
        let index = part(index_at, index_count, ENTRY_BYTES as u64, "the index")?;
        let list = part(names_at, names_count, NAME_BYTES, "the names")?;
        // Version 1 gives each name 64 bytes, 2 sets them side by side; both end the list with an empty one.
        let width = if major == 1 { NAME_BYTES as usize } else { list.len().max(1) };
        let of_room =
            |room: &'a [u8]| room.split(|&byte| byte == 0).take(if major == 1 { 1 } else { usize::MAX });
        let names = list.chunks(width).flat_map(of_room).take_while(|it| !it.is_empty());
        let names =
            names.zip(0..=u16::MAX).map(|(name, id)| (String::from_utf8_lossy(name).into_owned(), id));
        Ok(Self { path, bytes, index, names: names.collect() })
    }

    /// The entry at a place of the index; `None` at its end.
    fn entry(&self, place: usize) -> Option<Entry> {
        let start = place.checked_mul(ENTRY_BYTES)?;
        let entry = self.index.get(start..start + ENTRY_BYTES)?;
        let word = |at: usize| u64::from_le_bytes(entry[at..at + 8].try_into().expect("eight bytes"));
        let rest = word(24);
        let kind = match (rest >> 48) as u8 {
            1 => Some(Kind::U8),
            2 => Some(Kind::U16),
            3 => Some(Kind::U32),
            4 => Some(Kind::U64),
            5 => Some(Kind::I8),
            6 => Some(Kind::I16),
            7 => Some(Kind::I32),
            8 => Some(Kind::I64),
            9 => Some(Kind::F32),
            10 => Some(Kind::F64),
            _ => None,
        };
        let [frame, rows, place] = [word(0), word(8), word(16)];
        // Entries that are not used have no place.
        (place != 0).then_some(Entry {
            frame,
            rows,
            place,
            columns: rest & 0xffff_ffff,
            name: (rest >> 32) as u16,
            kind,
        })
    }

    /// How many entries the index has. They stand in order of their frames, before those that are not used.
    fn entry_count(&self) -> usize {
        let (mut low, mut high) = (0, self.index.len() / ENTRY_BYTES);
        while low < high {
            let middle = usize::midpoint(low, high);
            if self.entry(middle).is_some() { low = middle + 1 } else { high = middle }
        }
        low
    }

    /// The chunks of a frame.
    fn chunks(&self, frame: u64, count: usize) -> Vec<Entry> {
        let (mut low, mut high) = (0, count);
        while low < high {
            let middle = usize::midpoint(low, high);
            if self.entry(middle).is_some_and(|it| it.frame < frame) {
                low = middle + 1
            } else {
                high = middle
            }
        }
        (low..count).map_while(|place| self.entry(place)).take_while(|it| it.frame == frame).collect()
    }

    /// Whether the bytes of a chunk are there.
    fn is_whole(&self, entry: &Entry) -> bool {
        let size = entry.kind.map_or(1, Kind::size) as u64;
        let end = entry
            .rows
            .checked_mul(entry.columns)
            .and_then(|it| it.checked_mul(size))
            .and_then(|it| it.checked_add(entry.place));
        end.is_some_and(|end| end <= self.bytes.len() as u64)
    }
}

/// Finds the frames.
pub(crate) fn index(path: &Path, bytes: &[u8], _: &Options) -> Result<Index> {
    let file = File::open(path, bytes)?;
    let count = file.entry_count();
    let mut index = Index::default();
    let mut next = 0;
    for entry in (0..count).map_while(|place| file.entry(place)) {
        // A frame in which nothing differs from the first has no entries.
        if entry.frame.saturating_add(1) < next || entry.frame > bytes.len() as u64 {
            let what = format!("frame {} stands behind frame {} in the index", entry.frame, next as i64 - 1);
            return Err(Error::format(path, "the index", what, HINT));
        }
        if !file.is_whole(&entry) {
            index.cut = true;
            index.frames.truncate(entry.frame as usize);
            break;
        }
        while next <= entry.frame {
            next += 1;
            index.frames.push(Span { offset: next - 1, line: next, bytes: None });
        }
    }
    Ok(index)
}

/// The chunks of one frame, with those of the first behind them.
struct Chunks<'f, 'a> {
    file: &'f File<'a>,
    own: Vec<Entry>,
    first: Vec<Entry>,
}

impl<'a> Chunks<'_, 'a> {
    fn find(&self, entries: &[Entry], name: &str) -> Option<Entry> {
        let id = *self.file.names.get(name)?;
        entries.iter().find(|it| it.name == id).copied()
    }

    /// The chunk, whatever its rows: that of the frame, else that of the first.
    fn any(&self, name: &str) -> Option<Entry> {
        self.find(&self.own, name).or_else(|| self.find(&self.first, name))
    }

    /// The chunk with so many rows: that of the frame, else that of the first if it has as many.
    fn of_particles(&self, name: &str, count: u64, columns: u64) -> Result<Option<Entry>> {
        let fits = |it: &Entry| it.rows == count && it.columns == columns;
        if let Some(entry) = self.find(&self.own, name) {
            if !fits(&entry) || entry.kind.is_none() {
                let what = format!(
                    "{name} has {} rows of {}, there are {count} particles",
                    entry.rows, entry.columns
                );
                return Err(Error::format(self.file.path, format!("frame {}", entry.frame), what, HINT));
            }
            return Ok(Some(entry));
        }
        Ok(self.find(&self.first, name).filter(|it| fits(it) && it.kind.is_some()))
    }

    fn source(&self, entry: &Entry) -> Source<'a> {
        let kind = entry.kind.unwrap_or(Kind::U8);
        let step = kind.size();
        let (start, stride) = (entry.place as usize, step * entry.columns as usize);
        Source { bytes: self.file.bytes, kind, order: Order::Little, start, stride, step }
    }

    fn numbers<const N: usize>(&self, name: &str) -> Option<[f64; N]> {
        let entry = self
            .any(name)
            .filter(|it| it.rows.saturating_mul(it.columns) >= N as u64 && it.kind.is_some())?;
        let source = Source { stride: self.source(&entry).step, ..self.source(&entry) };
        Some(std::array::from_fn(|place| source.number(place)))
    }

    /// The names of the types: rows of letters, filled up with zeros.
    fn types(&self) -> Vec<String> {
        let Some(entry) = self.any("particles/types").filter(|it| it.columns > 0) else {
            return vec!["A".to_string()];
        };
        let (start, width) = (entry.place as usize, entry.columns as usize);
        let rows = self.file.bytes[start..start + width * entry.rows as usize].chunks(width);
        let name = |row: &[u8]| {
            String::from_utf8_lossy(row.split(|&it| it == 0).next().unwrap_or_default()).into_owned()
        };
        rows.map(name).collect()
    }
}

/// Reads the frame whose number is the offset of `span`.
pub(crate) fn frame(
    path: &Path,
    bytes: &[u8],
    span: Span,
    request: &Request,
    progress: &dyn Progress,
) -> Result<Frame> {
    let file = File::open(path, bytes)?;
    let entries = file.entry_count();
    let chunks =
        Chunks { file: &file, own: file.chunks(span.offset, entries), first: file.chunks(0, entries) };
    let place = || format!("frame {}", span.offset);
    if let Some(entry) = chunks.own.iter().chain(&chunks.first).find(|it| !file.is_whole(it)) {
        let what = format!("{} rows of {} at byte {} are not there", entry.rows, entry.columns, entry.place);
        return Err(Error::format(path, place(), what, HINT));
    }
    let [count] = chunks.numbers("particles/N").unwrap_or([0.0]);
    let count = count as u64;

    let mut conventions = Vec::new();
    let position = chunks.of_particles("particles/position", count, 3)?;
    if position.is_none() && count > 0 {
        conventions.push("no positions: all at zero, as the schema says".to_string());
        // No chunk has a row for each particle then, so their number is only a claim.
        if count > bytes.len() as u64 {
            let what = format!("{count} particles without positions");
            return Err(Error::format(path, place(), what, HINT));
        }
    }
    let source = position.map(|it| chunks.source(&it));
    let axes = [0, 1, 2].map(|axis| source.map(|it| it.component(axis)));
    let mut fields = Vec::new();
    for (chunk, name, columns) in WANTED {
        if let Some(entry) = chunks.of_particles(chunk, count, columns as u64)? {
            fields.push(Field { name: name.to_string(), components: columns, source: chunks.source(&entry) });
        }
    }
    let mut logged: Vec<&str> = file.names.keys().filter_map(|it| it.strip_prefix(LOGGED)).collect();
    logged.sort_unstable();
    for name in logged {
        let entry = chunks.find(&chunks.own, &format!("{LOGGED}{name}"));
        let fits = |it: &Entry| it.rows == count && (1..=16).contains(&it.columns) && it.kind.is_some();
        if let Some(entry) = entry.filter(fits) {
            let (name, components) = (name.to_string(), entry.columns as usize);
            fields.push(Field { name, components, source: chunks.source(&entry) });
        }
    }
    let stride: usize =
        fields.iter().map(|it| it.source.stride).sum::<usize>() + source.map_or(0, |it| it.stride);
    let total = stride.saturating_mul(count as usize);
    progress.begin("read", Some(total as u64), "B");
    let mut columns =
        Layout { count: count as usize, axes, fields }.gather(path, total, progress)?.into_columns();

    types(&mut columns.attributes, chunks.types(), count as usize);
    let has_diameters = columns.attributes.iter().any(|it| it.name == "diameter");
    // Elements have radii of their own, which say more than a default.
    if !has_diameters && request.options.elements.is_none() {
        conventions.push("no diameters: 1, as the schema says".to_string());
        columns.radii = Some(Radii::Uniform(0.5));
    }
    let dimensions = chunks.numbers::<1>("configuration/dimensions").map_or(3.0, |it| it[0]);
    columns.cell = cell(
        chunks.numbers("configuration/box").unwrap_or([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]),
        dimensions == 2.0,
    );
    columns.time = Some(chunks.numbers::<1>("configuration/step").map_or(0.0, |it| it[0]));
    columns.time_unit = Some("step".to_string());
    if let Some(entry) = chunks.any("bonds/group").filter(|it| it.columns == 2 && it.kind.is_some()) {
        let source = chunks.source(&entry);
        let [one, other] = [0, 1].map(|end| source.component(end));
        let [count] = chunks.numbers("bonds/N").unwrap_or([0.0]);
        let rows = 0..entry.rows.min(count as u64) as usize;
        columns.bonds = rows.map(|row| [one.number(row) as u32, other.number(row) as u32]).collect();
    }
    let left_out: Vec<String> = ["angles", "dihedrals", "impropers", "constraints", "pairs"]
        .iter()
        .filter_map(|what| {
            let [count] = chunks.numbers(&format!("{what}/N")).filter(|it| it[0] > 0.0)?;
            Some(format!("{} {what}", tyndall::scene::grouped(count as usize)))
        })
        .collect();
    if !left_out.is_empty() {
        conventions.push(format!("left out: {}", left_out.join(", ")));
    }
    records::frame(columns, conventions, vec![])
}

/// Puts the words for `typeid` into a column `type`; without `typeid` all are of the first type.
fn types(attributes: &mut Vec<Attribute>, mut names: Vec<String>, count: usize) {
    let codes: Vec<u32> = match attributes.iter().find(|it| it.name == "typeid") {
        Some(ids) => (0..count).map(|id| ids.number(id, 0).clamp(0.0, f64::from(u32::MAX)) as u32).collect(),
        None => vec![0; count],
    };
    let known = names.len() as u32;
    let codes: Vec<u32> = codes.into_iter().map(|it| it.min(known)).collect();
    if codes.contains(&known) {
        names.push(String::new());
    }
    attributes.insert(0, Attribute::new("type", 1, Values::Text { codes, names }));
}

/// The box around zero: lengths, and tilts as factors xy, xz, yz. In two dimensions it does not repeat along z.
fn cell([x, y, z, xy, xz, yz]: [f64; 6], is_flat: bool) -> Option<Cell> {
    let vectors = [DVec3::new(x, 0.0, 0.0), DVec3::new(xy * y, y, 0.0), DVec3::new(xz * z, yz * z, z)];
    let origin = -0.5 * (vectors[0] + vectors[1] + vectors[2]);
    let has_extent = x > 0.0 && y > 0.0 && z >= 0.0 && origin.is_finite();
    has_extent.then_some(Cell { origin, vectors, periodic: [true, true, !is_flat] })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::real_data;

    /// A chunk's frame, name, rows, columns, kind of numbers, and bytes.
    type Chunk<'a> = (u64, &'a str, u64, u32, u8, Vec<u8>);

    /// Writes a file: chunks in the order of their frames.
    fn file(major: u32, chunks: &[Chunk]) -> Vec<u8> {
        let mut names: Vec<&str> = Vec::new();
        let mut file = vec![0; 256];
        let mut index = Vec::new();
        for (frame, name, rows, columns, kind, data) in chunks {
            let id = names.iter().position(|it| it == name).unwrap_or_else(|| {
                names.push(name);
                names.len() - 1
            });
            for number in [*frame, *rows, file.len() as u64] {
                index.extend(number.to_le_bytes());
            }
            index.extend(columns.to_le_bytes());
            index.extend((id as u16).to_le_bytes());
            index.extend([*kind, 0]);
            file.extend(data);
        }
        index.resize(index.len() + 2 * ENTRY_BYTES, 0);
        let mut list = Vec::new();
        for name in &names {
            list.extend(name.bytes());
            list.resize(if major == 1 { list.len().next_multiple_of(64) } else { list.len() + 1 }, 0);
        }
        list.resize((list.len() + 1).next_multiple_of(64), 0);
        let header = [
            MAGIC,
            file.len() as u64,
            (index.len() / ENTRY_BYTES) as u64,
            (file.len() + index.len()) as u64,
            list.len() as u64 / 64,
        ];
        let mut start: Vec<u8> = header.iter().flat_map(|it| it.to_le_bytes()).collect();
        start.extend([0x0001_0004u32, major << 16].iter().flat_map(|it| it.to_le_bytes()));
        start.resize(start.len() + 64, 0);
        start.extend(b"hoomd");
        file[..start.len()].copy_from_slice(&start);
        [file, index, list].concat()
    }

    fn floats(values: &[f32]) -> Vec<u8> {
        values.iter().flat_map(|it| it.to_le_bytes()).collect()
    }

    /// Three frames: two particles, the same a step further, one particle.
    fn sample(major: u32) -> Vec<u8> {
        file(
            major,
            &[
                (0, "configuration/box", 6, 1, 9, floats(&[4.0, 2.0, 8.0, 0.5, 0.0, 0.25])),
                (0, "particles/N", 1, 1, 3, 2u32.to_le_bytes().to_vec()),
                (0, "particles/types", 2, 3, 5, b"Xe\0B\0\0".to_vec()),
                (0, "particles/typeid", 2, 1, 3, [1u32, 0].iter().flat_map(|it| it.to_le_bytes()).collect()),
                (0, "particles/diameter", 2, 1, 9, floats(&[3.0, 5.0])),
                (0, "particles/position", 2, 3, 9, floats(&[1.0, 2.0, 3.0, -1.0, -0.5, 0.0])),
                (0, "bonds/N", 1, 1, 3, 1u32.to_le_bytes().to_vec()),
                (0, "bonds/group", 1, 2, 3, [1u32, 0].iter().flat_map(|it| it.to_le_bytes()).collect()),
                (0, "angles/N", 1, 1, 3, 4u32.to_le_bytes().to_vec()),
                (1, "configuration/step", 1, 1, 4, 500u64.to_le_bytes().to_vec()),
                (1, "particles/position", 2, 3, 9, floats(&[1.5, 2.0, 3.0, -1.0, -0.5, 0.0])),
                (
                    1,
                    "log/particles/energy",
                    2,
                    1,
                    10,
                    [0.5f64, -0.5].iter().flat_map(|it| it.to_le_bytes()).collect(),
                ),
                (2, "particles/N", 1, 1, 3, 1u32.to_le_bytes().to_vec()),
                (2, "particles/position", 1, 3, 9, floats(&[0.0, 0.5, 0.0])),
            ],
        )
    }

    #[test]
    fn what_a_frame_lacks_is_that_of_the_first_or_the_default() {
        for major in [1, 2] {
            let frames = real_data::open(&sample(major)).unwrap();
            assert_eq!(frames.iter().map(|it| it.particles.len()).collect::<Vec<_>>(), [2, 2, 1]);
            let [first, second, third] = [0, 1, 2].map(|it| &frames[it].particles);
            assert_eq!(
                (first.bonds(), second.bonds(), third.bonds().len()),
                (&[[0, 1]][..], &[[0, 1]][..], 0)
            );
            let cell = second.cell().unwrap();
            assert_eq!(
                cell.vectors,
                [DVec3::new(4.0, 0.0, 0.0), DVec3::new(1.0, 2.0, 0.0), DVec3::new(0.0, 2.0, 8.0)]
            );
            assert_eq!((cell.center(), cell.periodic), (DVec3::ZERO, [true; 3]));
            assert_eq!((first.time(), second.time()), (Some(0.0), Some(500.0)));
            assert_eq!(second.positions().world(0), DVec3::new(1.5, 2.0, 3.0));
            assert_eq!(second.radius(second.radii().unwrap(), 1), 2.5);
            assert_eq!(third.radii(), Some(&Radii::Uniform(0.5)));
            let names = ["Xe", "B"].map(str::to_string).to_vec();
            assert_eq!(
                second.attribute("type").unwrap().values,
                Values::Text { codes: vec![1, 0], names: names.clone() }
            );
            assert_eq!(third.attribute("type").unwrap().values, Values::Text { codes: vec![0], names });
            assert_eq!(second.attribute("energy").unwrap().values, Values::F64(vec![0.5, -0.5]));
            assert!(
                frames[0].conventions.contains(&"left out: 4 angles".to_string()),
                "{:?}",
                frames[0].conventions
            );
        }
    }

    #[test]
    fn a_default_diameter_gives_way_to_elements() {
        let file = sample(2);
        let options = Options { elements: Some("Xe=Xe".parse().unwrap()), ..Options::default() };
        let frames = real_data::frames(&real_data::recognised(&file).open, &file, &options).unwrap();
        assert_eq!(frames[2].particles.radii(), None);
        assert!(
            frames[2].conventions.iter().all(|it| !it.contains("diameter")),
            "{:?}",
            frames[2].conventions
        );
        assert!(frames[0].particles.radii().is_some(), "diameters of the file stay");
    }

    #[test]
    fn other_schemas_versions_and_hostile_counts_are_refused() {
        let message = |file: &[u8]| real_data::open(file).unwrap_err().to_string();
        let mut other = sample(2);
        other[112] = b'x';
        assert!(message(&other).contains("schema 'hoomd' is read"), "{}", message(&other));
        let mut newer = sample(2);
        newer[46] = 7;
        assert!(message(&newer).contains("this is 7.0"), "{}", message(&newer));
        let huge = file(2, &[(0, "particles/N", 1, 1, 3, u32::MAX.to_le_bytes().to_vec())]);
        assert!(message(&huge).contains("4294967295 particles without positions"), "{}", message(&huge));
        let wrong = file(
            2,
            &[
                (0, "particles/N", 1, 1, 3, 3u32.to_le_bytes().to_vec()),
                (0, "particles/position", 2, 3, 9, floats(&[0.0; 6])),
            ],
        );
        assert!(message(&wrong).contains("2 rows of 3, there are 3 particles"), "{}", message(&wrong));
        let none = file(2, &[(0, "particles/N", 1, 1, 3, vec![0; 4])]);
        assert!(real_data::open(&none).unwrap()[0].particles.is_empty());
    }

    #[test]
    fn damage_never_panics() {
        for major in [1, 2] {
            let file = sample(major);
            let open = &real_data::recognised(&file).open;
            real_data::damage(&file, |file| drop(real_data::frames(open, file, &Options::default())));
        }
    }
}
