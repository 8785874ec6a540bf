//! PCD, the point clouds of PCL: versions 0.5 to 0.7, as text, as records, or packed by columns.
//!
//! A text header names fields with size, type and count. Points of an organised cloud are read row by row; those that are NaN
//! are dropped with the others that have no place. A packed color (`rgb`, `rgba`) keeps its number under its own name, and
//! becomes red, green, blue beside it. Source: pointclouds.org, "The PCD (Point Cloud Data) file format"; PCL, pcd_io.cpp.

use std::path::Path;

use rayon::prelude::*;
use tyndall::particles::{Attribute, Columns, Values};
use tyndall::scene::wanted::{Offered, Wanted};
use tyndall::{Error, Progress, Result};

use super::column::{self, Separator};
use super::feed::Feed;
use super::numbers::{Kind, Order};
use super::records::{self, Field, Layout, Source};
use super::rows::{self, Heading, Role};
use super::{lzf, open_end, whole_lines};
use crate::sequence::Frame;

const HINT: &str = "write it again with PCL, or save it as PLY";
/// What a packed color becomes.
const CHANNELS: [&str; 3] = ["red", "green", "blue"];

/// Whether the file begins like a PCD.
pub(crate) fn recognise(head: &[u8]) -> bool {
    let first = whole_lines(head).find(|line| !line.is_empty() && line[0] != b'#').unwrap_or_default();
    let named = head.starts_with(b"# .PCD") || first.starts_with(b"VERSION");
    // Old files have no version; the fields come first.
    let fields = first.starts_with(b"FIELDS") || first.starts_with(b"COLUMNS");
    (named || fields) && memchr::memmem::find(&head[..head.len().min(4096)], b"\nDATA ").is_some()
}

/// A field of every point.
struct Entry {
    name: String,
    kind: Kind,
    count: usize,
    /// Bytes of a point before it.
    offset: usize,
    /// Whether it becomes a column: not padding, which is called `_`, nor what is not wanted.
    kept: bool,
}

impl Entry {
    fn bytes(&self) -> usize {
        self.count * self.kind.size()
    }
}

/// How the points stand behind the header.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Form {
    Text,
    Records,
    /// Columns, packed with LZF.
    Packed,
}

struct Header {
    fields: Vec<Entry>,
    points: usize,
    form: Form,
    /// Whether the sensor's pose is another than none.
    posed: bool,
    /// Where the points begin, and in which line.
    start: usize,
    line: u64,
}

impl Header {
    fn read(path: &Path, bytes: &[u8]) -> Result<Self> {
        let (mut names, mut sizes, mut types, mut counts) = (vec![], vec![], vec![], vec![]);
        let (mut width, mut height, mut points) = (None, Some(1), None);
        let (mut start, mut line, mut posed) = (0, 0, false);
        let form = loop {
            let rest = &bytes[start..];
            let end = memchr::memchr(b'\n', rest);
            line += 1;
            let fault = |what: String| Error::format(path, format!("line {line}"), what, HINT);
            let text = String::from_utf8_lossy(&rest[..end.unwrap_or(rest.len()).min(1 << 16)]).into_owned();
            start += end.map_or(rest.len(), |end| end + 1);
            let mut words = text.split_whitespace().map(str::to_string);
            let key = words.next().unwrap_or_default();
            let words: Vec<String> = words.collect();
            let number = || words.first().and_then(|word| word.parse::<usize>().ok());
            let numbers = || words.iter().map(|word| word.parse::<usize>().ok()).collect::<Option<Vec<_>>>();
            let wrong = || fault(format!("wanted whole numbers behind {key}, found '{}'", words.join(" ")));
            match key.as_str() {
                "FIELDS" | "COLUMNS" => names = words,
                "SIZE" => sizes = numbers().ok_or_else(wrong)?,
                "TYPE" => types = words,
                "COUNT" => counts = numbers().ok_or_else(wrong)?,
                "WIDTH" => width = Some(number().ok_or_else(wrong)?),
                "HEIGHT" => height = Some(number().ok_or_else(wrong)?),
                "POINTS" => points = Some(number().ok_or_else(wrong)?),
                "VIEWPOINT" => posed = words != ["0", "0", "0", "1", "0", "0", "0"],
                "DATA" => match words.first().map(|it| it.to_ascii_lowercase()).as_deref() {
                    Some("ascii") => break Form::Text,
                    Some("binary") => break Form::Records,
                    Some("binary_compressed") => break Form::Packed,
                    _ => return Err(fault(format!("DATA is '{}'", words.join(" ")))),
                },
                _ => {}
            }
            if end.is_none() {
                return Err(fault("the header ends without DATA".into()));
            }
        };
        let fault = |what: String| Error::format(path, "header", what, HINT);
        counts.resize(if counts.is_empty() { names.len() } else { counts.len() }, 1);
        if names.len() != sizes.len() || names.len() != types.len() || names.len() != counts.len() {
            return Err(fault(format!(
                "{} fields have {} sizes, {} types and {} counts",
                names.len(),
                sizes.len(),
                types.len(),
                counts.len()
            )));
        }
        let (mut fields, mut offset) = (Vec::new(), 0usize);
        for (((name, size), kind), count) in names.into_iter().zip(sizes).zip(types).zip(counts) {
            let kind = match (kind.as_str(), size) {
                ("F", 4) => Kind::F32,
                ("F", 8) => Kind::F64,
                ("I", 1) => Kind::I8,
                ("I", 2) => Kind::I16,
                ("I", 4) => Kind::I32,
                ("I", 8) => Kind::I64,
                ("U", 1) => Kind::U8,
                ("U", 2) => Kind::U16,
                ("U", 4) => Kind::U32,
                ("U", 8) => Kind::U64,
                (kind, size) => return Err(fault(format!("field '{name}' has type {kind} of {size} bytes"))),
            };
            if count > 1 << 16 {
                return Err(fault(format!("field '{name}' has {count} numbers a point")));
            }
            let kept = name != "_" && count > 0;
            let entry = Entry { name, kind, count, offset, kept };
            offset += entry.bytes();
            fields.push(entry);
        }
        let product = width.and_then(|width: usize| width.checked_mul(height.unwrap_or(1)));
        let points = points
            .or(product)
            .ok_or_else(|| fault("neither POINTS nor WIDTH and HEIGHT are given".into()))?;
        Ok(Self { fields, points, form, posed, start, line: line + 1 })
    }

    /// Bytes of a point.
    fn stride(&self) -> usize {
        self.fields.iter().map(Entry::bytes).sum()
    }

    /// The field of each axis.
    fn axes(&self, path: &Path) -> Result<[usize; 3]> {
        let place = |name: &str| self.fields.iter().position(|it| it.name == name && it.count == 1);
        match ["x", "y", "z"].map(place) {
            [Some(x), Some(y), Some(z)] => Ok([x, y, z]),
            _ => {
                let names: Vec<&str> = self.fields.iter().map(|it| it.name.as_str()).collect();
                let what = format!("no fields x, y and z among: {}", names.join(" "));
                Err(Error::format(path, "header", what, HINT))
            }
        }
    }

    /// The fields that become attributes: not the coordinates.
    fn others(&self, axes: [usize; 3]) -> impl Iterator<Item = (usize, &Entry)> {
        let is_other = move |it: &(usize, &Entry)| !axes.contains(&it.0) && it.1.kept;
        self.fields.iter().enumerate().filter(is_other)
    }

    /// The packed color, if it becomes red, green and blue: where there are no fields that are called so.
    fn packed_color(&self) -> Option<&Entry> {
        let has = |name: &str| self.fields.iter().any(|it| it.name == name && it.count > 0);
        self.fields.iter().find(|it| is_packed_color(it)).filter(|_| !CHANNELS.into_iter().any(has))
    }

    /// Passes over the fields that are not wanted. A packed color is wanted where its channels are.
    fn keep(&mut self, axes: [usize; 3], wanted: Option<&Wanted>) {
        let Some(wanted) = wanted else { return };
        let of = |(_, entry): (usize, &'_ Entry)| (entry.name.clone(), entry.count, entry.kind.is_float());
        let mut names: Vec<_> = self.others(axes).map(of).collect();
        let places: Vec<usize> = self.others(axes).map(|it| it.0).collect();
        let color = self.packed_color().map(|it| it.name.clone());
        if let Some(color) = &color {
            let channels = CHANNELS.into_iter().chain((color == "rgba").then_some("alpha"));
            names.extend(channels.map(|it| (it.to_string(), 1, false)));
        }
        let offered: Vec<Offered> = names
            .iter()
            .map(|(name, components, is_measured)| Offered {
                name,
                components: *components,
                is_measured: *is_measured,
            })
            .collect();
        let flags = wanted.flags(&offered);
        let (own, channels) = flags.split_at(places.len());
        let is_seen = channels.contains(&true);
        for (place, flag) in places.into_iter().zip(own) {
            let entry = &mut self.fields[place];
            entry.kept = *flag || is_seen && color.as_ref() == Some(&entry.name);
        }
    }
}

/// Reads the points.
pub(crate) fn read(
    path: &Path,
    bytes: &[u8],
    wanted: Option<&Wanted>,
    progress: &dyn Progress,
) -> Result<Frame> {
    let mut header = Header::read(path, bytes)?;
    let axes = header.axes(path)?;
    header.keep(axes, wanted);
    let mut columns = match header.form {
        Form::Text => text(path, bytes, &header, axes, progress)?,
        Form::Records | Form::Packed => binary(path, bytes, &header, axes, progress)?,
    };
    let mut conventions = Vec::new();
    split_color(&mut columns.attributes, &header, &mut conventions);
    if header.posed {
        conventions.push("VIEWPOINT, the sensor's pose, is not applied to the points".to_string());
    }
    let doubt = if header.form == Form::Text { open_end(bytes) } else { None };
    records::frame(columns, conventions, doubt.into_iter().collect())
}

fn text(
    path: &Path,
    bytes: &[u8],
    header: &Header,
    axes: [usize; 3],
    progress: &dyn Progress,
) -> Result<Columns> {
    let (mut roles, mut headings) = (Vec::new(), Vec::new());
    for (place, entry) in header.fields.iter().enumerate() {
        if let Some(axis) = axes.iter().position(|&it| it == place) {
            roles.push(Role::Axis(axis));
            continue;
        }
        if !entry.kept {
            roles.extend(std::iter::repeat_n(Role::Skipped, entry.count));
            continue;
        }
        let kind = match entry.kind {
            Kind::F32 | Kind::F64 => column::Kind::Float,
            _ => column::Kind::Integer,
        };
        roles.extend(std::iter::repeat_n(Role::Attribute(headings.len()), entry.count));
        headings.push(Heading { name: entry.name.clone(), components: entry.count, kind, unit: None });
    }
    let mut feed = Feed::over(path, bytes);
    feed.skip_to(header.start as u64, header.line, &())?;
    let layout = rows::Layout {
        separator: Separator::BLANKS,
        roles,
        headings,
        scaled: None,
        gaps: true,
        origin: None,
    };
    let size = (bytes.len() - header.start) as u64;
    let rows = rows::read(&mut feed, &layout, Some(header.points as u64), Some(size), progress)?;
    Ok(Columns { positions: rows.positions, attributes: rows.attributes, ..Columns::default() })
}

fn binary(
    path: &Path,
    bytes: &[u8],
    header: &Header,
    axes: [usize; 3],
    progress: &dyn Progress,
) -> Result<Columns> {
    progress.begin("read", Some(bytes.len() as u64), "B");
    let packed = header.form == Form::Packed;
    let unpacked = if packed { unpack(path, &bytes[header.start..])? } else { Vec::new() };
    let content = if packed { &unpacked[..] } else { &bytes[header.start..] };
    let stride = header.stride();
    let needed = stride.checked_mul(header.points);
    if needed.is_none_or(|needed| needed > content.len()) {
        return Err(records::truncated(path, header.points as u64, stride, content.len()));
    }
    let source = |entry: &Entry| Source {
        bytes: content,
        kind: entry.kind,
        order: Order::Little,
        // Packed, each field stands for itself, all its points one after the other.
        start: if packed { entry.offset * header.points } else { entry.offset },
        stride: if packed { entry.bytes() } else { stride },
        step: entry.kind.size(),
    };
    let fields = header.others(axes).map(|(_, entry)| Field {
        name: entry.name.clone(),
        components: entry.count,
        source: Source { kind: color_kind(entry), ..source(entry) },
    });
    let fields = fields.collect();
    let axes = axes.map(|axis| Some(source(&header.fields[axis])));
    let layout = Layout { count: header.points, axes, fields };
    Ok(layout.gather(path, bytes.len(), progress)?.into_columns())
}

/// The columns behind their packed and unpacked sizes.
fn unpack(path: &Path, bytes: &[u8]) -> Result<Vec<u8>> {
    let fault = |what: String| Error::format(path, "", what, "was the file copied to its end?");
    let word = |at: usize| -> Option<usize> {
        Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().expect("four bytes")) as usize)
    };
    let (Some(packed), Some(unpacked)) = (word(0), word(4)) else {
        return Err(fault("the file ends before its packed points".into()));
    };
    let Some(content) = bytes.get(8..8 + packed) else {
        return Err(fault(format!(
            "{packed} bytes of packed points were wanted, {} are there",
            bytes.len() - 8
        )));
    };
    let content = lzf::unpack(content, unpacked).map_err(|what| fault(what.into()))?;
    if content.len() != unpacked {
        return Err(fault(format!("the points unpack to {} bytes, {unpacked} were promised", content.len())));
    }
    Ok(content)
}

fn is_packed_color(entry: &Entry) -> bool {
    matches!(entry.name.as_str(), "rgb" | "rgba") && entry.count == 1 && entry.kind.size() == 4
}

/// A packed color is an integer, also where it is written as a float.
fn color_kind(entry: &Entry) -> Kind {
    if is_packed_color(entry) { Kind::U32 } else { entry.kind }
}

/// Puts red, green and blue beside a packed color, and alpha beside `rgba`.
fn split_color(attributes: &mut Vec<Attribute>, header: &Header, conventions: &mut Vec<String>) {
    let Some(entry) = header.packed_color() else { return };
    let Some(place) = attributes.iter().position(|it| it.name == entry.name) else { return };
    let as_float = header.form == Form::Text && entry.kind == Kind::F32;
    let values = &attributes[place].values;
    let number = |id: usize| match as_float {
        true => (values.number(id) as f32).to_bits(),
        false => values.number(id) as i64 as u32,
    };
    let numbers: Vec<u32> = (0..values.len()).into_par_iter().map(number).collect();
    let channel = |shift: u32| Values::U8(numbers.iter().map(|it| (it >> shift) as u8).collect());
    let mut channels: Vec<(&str, u32)> = CHANNELS.into_iter().zip([16, 8, 0]).collect();
    if entry.name == "rgba" {
        channels.push(("alpha", 24));
    }
    attributes.extend(channels.into_iter().map(|(name, shift)| Attribute::new(name, 1, channel(shift))));
    attributes[place].values = Values::I64(numbers.iter().map(|&it| it.into()).collect());
    conventions.push(format!("{} is a packed color: red, green, blue stand beside it", entry.name));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::real_data;

    const FIELDS: &str = "FIELDS x y z rgb _ normal\nSIZE 4 4 8 4 1 2\nTYPE F F F F U I\nCOUNT 1 1 1 1 3 2\n";

    fn header(points: usize, form: &str) -> Vec<u8> {
        format!("# .PCD v0.7\nVERSION 0.7\n{FIELDS}WIDTH {points}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {points}\nDATA {form}\n")
            .into_bytes()
    }

    /// The bytes of each field of a point.
    fn point(id: usize) -> [Vec<u8>; 6] {
        let at = id as f32;
        let color = f32::from_bits(0x0010_2030 + id as u32);
        [
            at.to_le_bytes().to_vec(),
            (-at).to_le_bytes().to_vec(),
            (0.5 * f64::from(at)).to_le_bytes().to_vec(),
            color.to_le_bytes().to_vec(),
            vec![7; 3],
            [(id as i16).to_le_bytes(), (-3i16).to_le_bytes()].concat(),
        ]
    }

    fn binary_sample(points: usize) -> Vec<u8> {
        let mut file = header(points, "binary");
        file.extend((0..points).flat_map(|id| point(id).concat()));
        file
    }

    /// Packed without any copy: literals only.
    fn packed_sample(points: usize) -> Vec<u8> {
        let columns: Vec<u8> =
            (0..6).flat_map(|field| (0..points).flat_map(move |id| point(id)[field].clone())).collect();
        let packed: Vec<u8> =
            columns.chunks(32).flat_map(|run| [vec![run.len() as u8 - 1], run.to_vec()].concat()).collect();
        let mut file = header(points, "binary_compressed");
        file.extend((packed.len() as u32).to_le_bytes());
        file.extend((columns.len() as u32).to_le_bytes());
        file.extend(packed);
        file
    }

    fn text_sample(points: usize, end: &str) -> Vec<u8> {
        let mut file = String::from_utf8(header(points, "ascii")).unwrap().replace('\n', end).into_bytes();
        for id in 0..points {
            let color = f32::from_bits(0x0010_2030 + id as u32);
            let at = id as f64;
            let line = format!("{at} {} {} {color:e} 7 7 7 {id} -3{end}", -at, 0.5 * at);
            file.extend(line.bytes());
        }
        file
    }

    fn read(bytes: &[u8]) -> Result<Frame> {
        super::read(Path::new("test"), bytes, None, &())
    }

    #[test]
    fn all_forms_have_the_same_points() {
        let text = text_sample(5, "\n");
        let forms =
            [binary_sample(5), packed_sample(5), text[..text.len() - 1].to_vec(), text_sample(5, "\r\n")];
        for bytes in forms {
            assert!(recognise(&bytes));
            let frame = read(&bytes).unwrap();
            let particles = &frame.particles;
            assert_eq!((particles.len(), particles.positions().world(4).to_array()), (5, [4.0, -4.0, 2.0]));
            let number = |name: &str, component| particles.attribute(name).unwrap().number(4, component);
            assert_eq!(["red", "green", "blue"].map(|name| number(name, 0)), [16.0, 32.0, 52.0]);
            assert_eq!(number("rgb", 0), f64::from(0x0010_2034));
            assert_eq!([0, 1].map(|component| number("normal", component)), [4.0, -3.0]);
            assert!(particles.attribute("_").is_none() && particles.attribute("alpha").is_none());
        }
    }

    #[test]
    fn none_and_one_point_are_fine_and_nan_is_dropped() {
        for points in [0, 1] {
            for bytes in [binary_sample(points), packed_sample(points), text_sample(points, "\n")] {
                assert_eq!(read(&bytes).unwrap().particles.len(), points);
            }
        }
        let nan = b"VERSION .5\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 2\nHEIGHT 1\nDATA ascii\nnan nan nan\n1 2 3";
        let particles = read(nan).unwrap().particles;
        assert_eq!((particles.len(), particles.dropped().position), (1, 1));
    }

    #[test]
    fn what_is_missing_is_said() {
        let bytes = binary_sample(5);
        let message = read(&bytes[..bytes.len() - 1]).unwrap_err().to_string();
        assert!(message.contains("promises 5 particles of 27 bytes"), "{message}");
        let bytes = packed_sample(5);
        assert!(read(&bytes[..bytes.len() - 1]).is_err());
        let text = text_sample(5, "\n");
        assert!(read(&text[..text.len() - 30]).unwrap_err().to_string().contains("4 of 5"));
        let without = b"VERSION .7\nFIELDS a b\nSIZE 4 4\nTYPE F F\nCOUNT 1 1\nWIDTH 0\nDATA ascii\n";
        assert!(read(without).unwrap_err().to_string().contains("no fields x, y and z among: a b"));
    }

    #[test]
    fn hostile_headers_ask_for_no_memory() {
        let hostile = |from: &str, to: &str| {
            let text = String::from_utf8(header(3, "binary")).unwrap().replace(from, to);
            assert!(read(text.as_bytes()).is_err(), "{to}");
        };
        hostile("POINTS 3", "POINTS 18446744073709551615");
        hostile("POINTS 3", "POINTS 1000000000000");
        hostile("POINTS 3", "POINTS -1");
        hostile("COUNT 1 1 1 1 3 2", "COUNT 1 1 1 1 3 9999999999");
        hostile("SIZE 4 4 8 4 1 2", "SIZE 4 4 8 4 1 3");
        hostile("DATA binary", "DATA what");
        let mut packed = header(3, "binary_compressed");
        packed.extend([0xff; 12]);
        assert!(read(&packed).is_err());
    }

    #[test]
    fn damage_never_panics() {
        for bytes in [binary_sample(2), packed_sample(2), text_sample(2, "\n")] {
            real_data::damage(&bytes, |file| drop(read(file)));
        }
    }
}
