//! MegaMol's particle lists, MMPLD 1.0 to 1.3.
//!
//! Takes the content, gives a frame's lists one after the other. Attributes: `list`, the number of the list, where there is more than
//! one; `radius`, where it is not one for all; `color`, 8 bits a channel; `intensity`, NaN in lists that have none. All is little-endian:
//! a header with two boxes and a table of frames; a frame has a time (since 1.2) and lists, each with its own layout. Source:
//! MegaMol (VISUS, Stuttgart), MMPLDDataSource.cpp and MMPLDWriter.cpp.

use std::path::Path;

use rayon::prelude::*;
use tyndall::particles::{Attribute, Columns, Radii, Values};
use tyndall::{Error, Progress, Result};

use super::cursor::Cursor;
use super::numbers::{Kind, Order};
use super::records::{self, Field, JOB_ROWS, Layout, Source};
use super::{Index, Request, Span};
use crate::sequence::{Frame, Options};

const HINT: &str = "the file is cut off or damaged: copy it again or write it again with MegaMol";
/// The color of particles that have an intensity only, as MegaMol has it.
const GREY: [u8; 4] = [192, 192, 192, 255];

/// Whether the file begins like one.
pub(crate) fn recognise(head: &[u8]) -> bool {
    head.starts_with(b"MMPLD\0")
}

/// Reads the header, up to the table of frames.
fn header(cursor: &mut Cursor) -> Result<(u16, u32)> {
    cursor.take(6, "the magic word")?;
    let version = cursor.number("the version")?;
    if !(100..=103).contains(&version) {
        let what = format!("version 1.0 to 1.3 was wanted, {}.{} was found", version / 100, version % 100);
        return Err(cursor.fault(what));
    }
    let frames = cursor.number("how many frames")?;
    cursor.take(12 * 4, "the boxes")?;
    Ok((version, frames))
}

/// Finds the frames by the table in the header.
pub(crate) fn index(path: &Path, bytes: &[u8], _: &Options) -> Result<Index> {
    let mut cursor = Cursor::new(path, bytes, 0, Order::Little, HINT);
    let (version, frames) = header(&mut cursor)?;
    let table = cursor.take((frames as usize + 1).saturating_mul(8), "the table of frames")?;
    let places: Vec<u64> = table.as_chunks::<8>().0.iter().map(|&place| u64::from_le_bytes(place)).collect();
    let mut index =
        Index { title: Some(format!("MMPLD {}.{}", version / 100, version % 100)), ..Index::default() };
    for (number, ends) in (1u64..).zip(places.windows(2)) {
        let [start, end] = [ends[0], ends[1]];
        if start < cursor.place() as u64 || end < start {
            return Err(cursor.fault(format!("frame {number} lies at bytes {start} to {end}")));
        }
        if end > bytes.len() as u64 {
            index.cut = true;
            break;
        }
        index.frames.push(Span { offset: start, line: number, bytes: Some(end - start) });
    }
    Ok(index)
}

/// Reads the lists of a frame.
pub(crate) fn frame(
    path: &Path,
    bytes: &[u8],
    span: Span,
    _: &Request,
    progress: &dyn Progress,
) -> Result<Frame> {
    let version = header(&mut Cursor::new(path, bytes, 0, Order::Little, HINT))?.0;
    let start = span.offset as usize;
    let end = start.checked_add(span.bytes.unwrap_or_default() as usize);
    let content = end.and_then(|end| bytes.get(..end));
    let content = content.ok_or_else(|| Error::format(path, "", "the file became shorter", HINT))?;
    let cursor = || Cursor::new(path, content, start, Order::Little, HINT);
    // Old MegaMol wrote files of version 1.3 without the time; then only the lists without it fill the frame.
    let mut lists = lists(&mut cursor(), version, version >= 102);
    if version == 103 && !matches!(&lists, Ok((.., 0))) {
        let timeless = self::lists(&mut cursor(), version, false);
        if matches!(&timeless, Ok((.., 0))) {
            lists = timeless;
        }
    }
    let (time, lists, left) = lists?;
    progress.begin("read", span.bytes, "B");
    let mut warnings = Vec::new();
    if left > 0 {
        warnings.push(format!("left out: {left} bytes behind the lists of frame {}", span.line));
    }
    let empty = lists.iter().filter(|it| it.vertex == Vertex::None);
    let empty = empty.fold(0u64, |sum, it| sum.saturating_add(it.count as u64));
    if empty > 0 {
        warnings.push(format!("left out: {empty} particles of lists without positions"));
    }
    let several = lists.len() > 1;
    let lists: Vec<List> = lists.into_iter().filter(|it| it.vertex != Vertex::None && it.count > 0).collect();
    let mut columns = gather(path, &lists, several, content, progress)?;
    columns.time = time;
    let mut conventions = Vec::new();
    if lists.iter().any(|it| it.vertex == Vertex::Short) {
        conventions.push("16-bit coordinates are taken as they are, from 0 to 65535".into());
    }
    columns.attributes.extend(colors(&lists, content, progress));
    columns.attributes.extend(intensities(&lists, content, progress));
    records::frame(columns, conventions, warnings)
}

/// Where the particles of a list stand.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Vertex {
    None,
    Float,
    /// A radius behind the position.
    FloatRadius,
    Short,
    Double,
}

/// The color of each particle of a list.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Color {
    /// One for all.
    List([u8; 4]),
    /// So many channels of that kind.
    Channels(Kind, usize),
    Intensity(Kind),
}

/// A list of a frame.
#[derive(Clone, Debug)]
struct List {
    number: i32,
    vertex: Vertex,
    color: Color,
    /// The radius for all, if there is one.
    radius: [u8; 4],
    count: usize,
    /// The first particle's first byte in the file.
    start: usize,
}

impl List {
    fn vertex_bytes(&self) -> usize {
        match self.vertex {
            Vertex::None => 0,
            Vertex::Float => 12,
            Vertex::FloatRadius => 16,
            Vertex::Short => 6,
            Vertex::Double => 24,
        }
    }

    fn stride(&self) -> usize {
        self.vertex_bytes()
            + match self.color {
                Color::List(_) => 0,
                Color::Channels(kind, count) => count * kind.size(),
                Color::Intensity(kind) => kind.size(),
            }
    }

    fn source<'a>(&self, bytes: &'a [u8], kind: Kind, at: usize) -> Source<'a> {
        let (start, stride) = (self.start + at, self.stride());
        Source { bytes, kind, order: Order::Little, start, stride, step: kind.size() }
    }
}

/// Reads the headers of all lists: the time, the lists, and how many bytes are left.
fn lists(cursor: &mut Cursor, version: u16, timed: bool) -> Result<(Option<f64>, Vec<List>, usize)> {
    let time = if timed { Some(f64::from(cursor.number::<f32>("the time")?)) } else { None };
    let count: u32 = cursor.number("how many lists")?;
    let mut lists = Vec::new();
    for number in 0..count {
        let [vertex, color]: [u8; 2] =
            [cursor.number("the type of positions")?, cursor.number("the type of colors")?];
        let vertex = match vertex {
            0 => Vertex::None,
            1 => Vertex::Float,
            2 => Vertex::FloatRadius,
            3 => Vertex::Short,
            4 => Vertex::Double,
            _ => return Err(cursor.fault(format!("list {number}: there are no positions of type {vertex}"))),
        };
        let radius = match vertex {
            Vertex::None | Vertex::FloatRadius => [0; 4],
            _ => cursor.take(4, "the radius")?.try_into().expect("four bytes"),
        };
        let channels = match color {
            0 => Color::List(cursor.take(4, "the color")?.try_into().expect("four bytes")),
            1 => Color::Channels(Kind::U8, 3),
            2 => Color::Channels(Kind::U8, 4),
            3 => Color::Intensity(Kind::F32),
            4 => Color::Channels(Kind::F32, 3),
            5 => Color::Channels(Kind::F32, 4),
            6 => Color::Channels(Kind::U16, 4),
            7 => Color::Intensity(Kind::F64),
            _ => return Err(cursor.fault(format!("list {number}: there are no colors of type {color}"))),
        };
        if let Color::Intensity(_) = channels {
            cursor.take(8, "the range of intensities")?;
        }
        let count: u64 = cursor.number("how many particles")?;
        if version >= 103 {
            cursor.take(24, "the box of a list")?;
        }
        let count = usize::try_from(count).unwrap_or(usize::MAX);
        let list =
            List { number: number as i32, vertex, color: channels, radius, count, start: cursor.place() };
        if vertex != Vertex::None {
            let size = count.checked_mul(list.stride()).filter(|&size| size <= cursor.left());
            let size = size.ok_or_else(|| {
                let (stride, left) = (list.stride(), cursor.left());
                cursor.fault(format!(
                    "list {number} promises {count} particles of {stride} bytes, {left} bytes are there"
                ))
            })?;
            cursor.take(size, "the particles")?;
        }
        if version == 101 {
            cursor.take(4, "how many clusters")?;
            let size: u64 = cursor.number("the size of the clusters")?;
            cursor.take(usize::try_from(size).unwrap_or(usize::MAX), "the clusters")?;
        }
        lists.push(list);
    }
    Ok((time, lists, cursor.left()))
}

/// Positions, numbers of lists, and radii.
fn gather(
    path: &Path,
    lists: &[List],
    several: bool,
    bytes: &[u8],
    progress: &dyn Progress,
) -> Result<Columns> {
    let uniform = lists
        .first()
        .filter(|first| lists.iter().all(|it| it.vertex != Vertex::FloatRadius && it.radius == first.radius));
    let numbers: Vec<[u8; 4]> = lists.iter().map(|it| it.number.to_le_bytes()).collect();
    let mut layouts = Vec::new();
    for (list, number) in lists.iter().zip(&numbers) {
        let coordinates = match list.vertex {
            Vertex::Double => Kind::F64,
            Vertex::Short => Kind::U16,
            _ => Kind::F32,
        };
        let mut fields = Vec::new();
        if several {
            fields.push(Field { name: "list".into(), components: 1, source: once(number, Kind::I32) });
        }
        if uniform.is_none() {
            let source = match list.vertex {
                Vertex::FloatRadius => list.source(bytes, Kind::F32, 12),
                _ => once(&list.radius, Kind::F32),
            };
            fields.push(Field { name: "radius".into(), components: 1, source });
        }
        let axis = |axis| Some(list.source(bytes, coordinates, axis * coordinates.size()));
        layouts.push(Layout { count: list.count, axes: [axis(0), axis(1), axis(2)], fields });
    }
    // The other half is read for colors and intensities.
    let read = lists.iter().map(|it| it.count * it.stride() / 2).sum();
    let mut columns = records::join(path, &layouts, read, progress)?.into_columns();
    columns.radii = uniform.map(|it| Radii::Uniform(f32::from_le_bytes(it.radius)));
    Ok(columns)
}

/// What is said once: a source in which all particles stand at one place.
fn once(bytes: &[u8; 4], kind: Kind) -> Source<'_> {
    Source { bytes, kind, order: Order::Little, start: 0, stride: 0, step: 0 }
}

/// The colors of all particles, as bytes; `None` if no list has one.
fn colors(lists: &[List], bytes: &[u8], progress: &dyn Progress) -> Option<Attribute> {
    if lists.iter().all(|it| matches!(it.color, Color::Intensity(_))) {
        return None;
    }
    let opaque = |it: &List| match it.color {
        Color::List(color) => color[3] == 255,
        Color::Channels(_, channels) => channels == 3,
        Color::Intensity(_) => true,
    };
    let channels = if lists.iter().all(opaque) { 3 } else { 4 };
    let mut values = vec![0; channels * lists.iter().map(|it| it.count).sum::<usize>()];
    fill(lists, bytes, &mut values, channels, progress, |list, first, out: &mut [u8]| {
        let rows = out.chunks_exact_mut(channels).zip(first..);
        match list.color {
            Color::List(color) => rows.for_each(|(out, _)| out.copy_from_slice(&color[..channels])),
            Color::Intensity(_) => rows.for_each(|(out, _)| out.copy_from_slice(&GREY[..channels])),
            Color::Channels(kind, count) => {
                let source = list.source(bytes, kind, list.vertex_bytes());
                let factor = match kind {
                    Kind::U8 => 1.0,
                    Kind::U16 => 255.0 / 65535.0,
                    _ => 255.0,
                };
                let byte = |id: usize, channel: usize| match channel < count {
                    true => (source.component(channel).number(id) * factor).round().clamp(0.0, 255.0) as u8,
                    false => 255,
                };
                rows.for_each(|(out, id)| {
                    out.iter_mut().enumerate().for_each(|(channel, out)| *out = byte(id, channel));
                });
            }
        }
        !matches!(list.color, Color::Intensity(_))
    });
    Some(Attribute::new("color", channels, Values::U8(values)))
}

/// The intensities of all particles; `None` if no list has them.
fn intensities(lists: &[List], bytes: &[u8], progress: &dyn Progress) -> Option<Attribute> {
    let kinds = lists.iter().filter_map(|it| match it.color {
        Color::Intensity(kind) => Some(kind),
        _ => None,
    });
    let wide = kinds.clone().any(|kind| kind == Kind::F64);
    kinds.clone().next()?;
    let values = match wide {
        true => Values::F64(floats(lists, bytes, f64::NAN, progress, |it| it)),
        false => Values::F32(floats(lists, bytes, f32::NAN, progress, |it| it as f32)),
    };
    Some(Attribute::new("intensity", 1, values))
}

/// The intensities of all particles, `missing` where a list has none.
fn floats<T: Copy + Send>(
    lists: &[List],
    bytes: &[u8],
    missing: T,
    progress: &dyn Progress,
    number: impl Fn(f64) -> T + Sync,
) -> Vec<T> {
    let mut values = vec![missing; lists.iter().map(|it| it.count).sum()];
    fill(lists, bytes, &mut values, 1, progress, |list, first, out: &mut [T]| {
        if let Color::Intensity(kind) = list.color {
            let source = list.source(bytes, kind, list.vertex_bytes());
            out.iter_mut().zip(first..).for_each(|(out, id)| *out = number(source.number(id)));
        }
        matches!(list.color, Color::Intensity(_))
    });
    values
}

/// Has `job` fill the rows of all particles, parallel: it gets a list, its first particle and rows from there on, and says whether it read
/// the list; then `progress` is told of half of its bytes.
fn fill<T: Send>(
    lists: &[List],
    bytes: &[u8],
    mut rows: &mut [T],
    components: usize,
    progress: &dyn Progress,
    job: impl Fn(&List, usize, &mut [T]) -> bool + Sync,
) {
    for list in lists {
        let (mine, rest) = rows.split_at_mut(components * list.count);
        rows = rest;
        mine.par_chunks_mut(components * JOB_ROWS).enumerate().for_each(|(number, out)| {
            let (first, count) = (number * JOB_ROWS, out.len() / components);
            if job(list, first, out) {
                let start = list.start + first * list.stride();
                progress.let_go(&bytes[start..start + count * list.stride()]);
                progress.advance((count * list.stride() / 2) as u64);
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::real_data;

    /// A list: types of positions and colors, what stands before the count, and the particles.
    struct Part {
        types: [u8; 2],
        head: Vec<u8>,
        count: u64,
        rows: Vec<u8>,
    }

    fn floats(values: &[f32]) -> Vec<u8> {
        values.iter().flat_map(|it| it.to_le_bytes()).collect()
    }

    /// Lists of all types of positions and colors, three particles each but the last.
    fn parts() -> Vec<Part> {
        let row = |vertex: u8, id: u8| match vertex {
            2 => floats(&[id.into(), 2.0, 3.0, 0.5 + f32::from(id)]),
            3 => [u16::from(id), 2, 65535].iter().flat_map(|it| it.to_le_bytes()).collect(),
            4 => [f64::from(id), 2.0, 3.0].iter().flat_map(|it| it.to_le_bytes()).collect(),
            _ => floats(&[id.into(), 2.0, 3.0]),
        };
        let color = |color: u8, id: u8| match color {
            1 => vec![id, 10, 20],
            2 => vec![id, 10, 20, 30],
            3 => floats(&[f32::from(id) + 0.25]),
            4 => floats(&[1.0, 0.0, 7.0]),
            5 => floats(&[1.0, 0.0, 0.2, f32::NAN]),
            6 => [65535u16, 0, 257, 514].iter().flat_map(|it| it.to_le_bytes()).collect(),
            7 => (f64::from(id) + 0.5).to_le_bytes().to_vec(),
            _ => vec![],
        };
        let part = |types: [u8; 2]| {
            let mut head = if types[0] == 2 { vec![] } else { floats(&[0.125]) };
            match types[1] {
                0 => head.extend([9, 8, 7, 255]),
                3 | 7 => head.extend(floats(&[0.0, 1.0])),
                _ => {}
            }
            let rows = (0..3).flat_map(|id| [row(types[0], id), color(types[1], id)].concat()).collect();
            Part { types, head, count: 3, rows }
        };
        [[1, 0], [2, 1], [3, 2], [4, 3], [1, 4], [2, 5], [4, 6], [1, 7]].map(part).into()
    }

    /// A file of as many frames as there are slices.
    fn file(version: u16, frames: &[&[Part]], timed: bool) -> Vec<u8> {
        let frame = |parts: &&[Part]| {
            let mut bytes = if timed { floats(&[1.5]) } else { vec![] };
            bytes.extend((parts.len() as u32).to_le_bytes());
            for part in *parts {
                bytes.extend(part.types);
                bytes.extend(&part.head);
                bytes.extend(part.count.to_le_bytes());
                bytes.extend(if version == 103 { vec![0; 24] } else { vec![] });
                bytes.extend(&part.rows);
                if version == 101 {
                    bytes.extend([[1, 0, 0, 0], [4, 0, 0, 0], [0; 4], [7; 4]].concat());
                }
            }
            bytes
        };
        let frames: Vec<Vec<u8>> = frames.iter().map(frame).collect();
        let mut bytes = b"MMPLD\0".to_vec();
        bytes.extend(version.to_le_bytes());
        bytes.extend((frames.len() as u32).to_le_bytes());
        bytes.extend([0; 48]);
        let mut place = bytes.len() as u64 + 8 * (frames.len() as u64 + 1);
        bytes.extend(place.to_le_bytes());
        for frame in &frames {
            place += frame.len() as u64;
            bytes.extend(place.to_le_bytes());
        }
        [bytes, frames.concat()].concat()
    }

    fn read_all(bytes: &[u8]) -> Result<Vec<Frame>> {
        let (path, options) = (Path::new("test"), Options::default());
        let index = index(path, bytes, &options)?;
        let request = Request { options: &options, bytes: None, units: None, topology: None, others: &() };
        index.frames.iter().map(|&span| frame(path, bytes, span, &request, &())).collect()
    }

    #[test]
    fn lists_of_all_types_are_joined() {
        let parts = parts();
        for (version, timed) in [(100, false), (101, false), (102, true), (103, true), (103, false)] {
            let frame = read_all(&file(version, &[&parts], timed)).unwrap().remove(0);
            let particles = &frame.particles;
            assert_eq!((particles.len(), particles.time()), (24, timed.then_some(1.5)), "{version}");
            for id in 0..24 {
                let z = if id / 3 == 2 { 65535.0 } else { 3.0 };
                assert_eq!(
                    particles.positions().world(id).to_array(),
                    [(id % 3) as f64, 2.0, z],
                    "{version}"
                );
            }
            let number =
                |name: &str, id: usize, part: usize| particles.attribute(name).unwrap().number(id, part);
            assert_eq!((number("list", 0, 0), number("list", 23, 0)), (0.0, 7.0));
            assert_eq!(
                (number("radius", 2, 0), number("radius", 5, 0), number("radius", 6, 0)),
                (0.125, 2.5, 0.125)
            );
            let color = |id: usize| [0, 1, 2, 3].map(|part| number("color", id, part) as u8);
            let colors = [0, 4, 7, 9, 12, 15, 18, 21].map(color);
            let wanted = [
                [9, 8, 7, 255],
                [1, 10, 20, 255],
                [1, 10, 20, 30],
                GREY,
                [255, 0, 255, 255],
                [255, 0, 51, 0],
                [255, 0, 1, 2],
                GREY,
            ];
            assert_eq!(colors, wanted);
            assert!(number("intensity", 0, 0).is_nan());
            assert_eq!((number("intensity", 10, 0), number("intensity", 22, 0)), (1.25, 1.5));
            assert!(frame.warnings.is_empty() && frame.conventions.len() == 1);
        }
    }

    #[test]
    fn one_list_has_its_radius_and_nothing_that_is_not_there() {
        let parts = parts();
        let frame = read_all(&file(102, &[&parts[3..4]], true)).unwrap().remove(0);
        assert_eq!(frame.particles.radii(), Some(&Radii::Uniform(0.125)));
        let names: Vec<_> = frame.particles.attributes().iter().map(|it| it.name.as_str()).collect();
        assert_eq!(names, ["intensity"]);
        assert_eq!(frame.particles.attributes()[0].values, Values::F32(vec![0.25, 1.25, 2.25]));
        let none = Part { types: [0, 0], head: vec![0; 4], count: 5, rows: vec![] };
        let empty = Part { types: [1, 0], head: vec![0; 8], count: 0, rows: vec![] };
        let frame = read_all(&file(102, &[&[none, empty]], true)).unwrap().remove(0);
        assert_eq!((frame.particles.len(), frame.warnings.len()), (0, 1));
        assert_eq!(read_all(&file(100, &[&[]], false)).unwrap()[0].particles.len(), 0);
    }

    #[test]
    fn frames_are_found_by_the_table_and_cut_ones_counted() {
        let parts = parts();
        let bytes = file(102, &[&parts[..1], &parts[1..3]], true);
        let counts: Vec<_> = read_all(&bytes).unwrap().iter().map(|it| it.particles.len()).collect();
        assert_eq!(counts, [3, 6]);
        let options = Options::default();
        for length in 0..bytes.len() {
            let Ok(index) = index(Path::new("test"), &bytes[..length], &options) else { continue };
            assert!(index.cut && index.frames.len() < 2, "{length}");
        }
    }

    #[test]
    fn hostile_headers_are_refused_and_damage_never_panics() {
        let mut parts = parts();
        let bytes = file(103, &[&parts], true);
        real_data::damage(&bytes, |file| drop(read_all(file)));
        parts[0].count = u64::MAX / 3;
        let message = read_all(&file(103, &[&parts], true)).unwrap_err().to_string();
        assert!(message.contains("promises 6148914691236517205 particles of 12 bytes"), "{message}");
        let mut version = bytes.clone();
        version[6] = 104;
        assert!(read_all(&version).unwrap_err().to_string().contains("1.4 was found"));
        let mut frames = bytes;
        frames[8..12].fill(0xff);
        assert!(read_all(&frames).unwrap_err().to_string().contains("table of frames"));
    }
}
