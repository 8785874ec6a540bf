//! Krakatoa's particle files, PRT 1.0 and 1.1.
//!
//! Takes the content, gives every channel but the position as an attribute of its own name. A header with meta data is followed by the
//! definitions of the channels, then by one zlib stream of particles, all little-endian, which is unpacked in batches: beside the columns
//! there are never more than two of them. Its PRT 2 is another format. Source: Thinkbox, "PRT File Format v1.1".

use std::io::Read;
use std::path::Path;

use flate2::read::ZlibDecoder;
use tyndall::particles::Columns;
use tyndall::scene::wanted::Wanted;
use tyndall::{Error, Progress, Result};

use super::cursor::Cursor;
use super::numbers::{Kind, Number, Order};
use super::records::{self, Field, Growing, Layout, Source};
use super::{Index, Request, Span};
use crate::sequence::{Frame, Options};

const MAGIC: &[u8] = b"\xc0PRT\r\n\x1a\n";
const HINT: &str = "the file is cut off or damaged: copy it again or export it again";
/// Bytes that are unpacked between two looks at the progress.
const STEP: u64 = 1 << 20;
/// Bytes that are unpacked, and brought into columns, at a time.
const BATCH_BYTES: usize = 8 << 20;
/// A byte of a zlib stream becomes at most so many.
const MOST: usize = 1032;

/// Whether the file begins like one.
pub(crate) fn recognise(head: &[u8]) -> bool {
    head.starts_with(MAGIC)
}

/// Whether the file is of the second version, or of the spatially sorted kind.
pub(crate) fn is_later(head: &[u8]) -> bool {
    head.starts_with(b"\xc0PRT2\r\n\x1a") || head.starts_with(b"\xc0tst\r\n\x1a\n")
}

/// There is one frame.
pub(crate) fn index(path: &Path, bytes: &[u8], _: &Options) -> Result<Index> {
    let header = Header::read(path, bytes)?;
    let version = if header.version > 1 { "1.1" } else { "1.0" };
    let span = Span { offset: 0, line: 1, bytes: Some(bytes.len() as u64) };
    Ok(Index { frames: vec![span], title: Some(format!("Krakatoa PRT {version}")), ..Index::default() })
}

/// Reads the particles, with those of the channels that are wanted.
pub(crate) fn frame(
    path: &Path,
    bytes: &[u8],
    _: Span,
    request: &Request,
    progress: &dyn Progress,
) -> Result<Frame> {
    read(path, bytes, request.options, (BATCH_BYTES, progress))
}

/// Reads them in batches of about so many bytes.
fn read(
    path: &Path,
    bytes: &[u8],
    options: &Options,
    (batch_bytes, progress): (usize, &dyn Progress),
) -> Result<Frame> {
    let header = Header::read(path, bytes)?;
    progress.begin("read", Some(bytes.len() as u64), "B");
    let position = header.position(path)?;
    let (stride, packed) = (header.stride(), &bytes[header.start..]);
    let count = usize::try_from(header.count).ok();
    let unfinished = format!("the file was not finished: its count of particles is {}", header.count);
    let most = packed.len().saturating_mul(MOST);
    let wanted =
        count.map_or(Some(most), |count| count.checked_mul(stride)).filter(|it| *it / MOST <= packed.len());
    let Some(wanted) = wanted else {
        let what = format!(
            "the header promises {} particles of {stride} bytes, {} compressed bytes are there",
            header.count,
            packed.len()
        );
        return Err(Error::format(path, "header", what, HINT));
    };
    if count.is_none() && options.strict {
        let hint = "without --strict the particles that are there are read";
        return Err(Error::format(path, "header", unfinished, hint));
    }

    let batch_bytes = (batch_bytes / stride).max(1) * stride;
    let mut stream = Stream { decoder: ZlibDecoder::new(packed), left: wanted, told: 0, fault: None };
    let mut columns = Growing::default();
    let mut rows = stream.take(batch_bytes, progress)?;
    while rows.len() >= stride {
        let layout = header.layout(position, &rows, options.wanted.as_ref());
        // While one batch is brought into columns the next one is unpacked.
        let (added, next) = rayon::join(
            || columns.add(path, &layout, wanted / stride, progress),
            || stream.take(batch_bytes, progress),
        );
        added?;
        rows = next?;
    }
    let found = columns.len();
    let mut warnings = Vec::new();
    match count {
        Some(count) if found < count => {
            let why = stream.fault.map_or(String::new(), |it| format!(" ({it})"));
            let what = format!("the data end after {found} of {count} particles{why}");
            return Err(Error::format(path, "particles", what, HINT));
        }
        Some(_) => {}
        None => warnings.push(format!("{unfinished} — {found} particles read (use --strict to fail)")),
    }
    let columns = match found {
        // Without rows there are columns all the same.
        0 => header.layout(position, &[], options.wanted.as_ref()).gather(path, 0, progress)?.into_columns(),
        _ => columns.into_columns(),
    };
    let columns = Columns { length_unit: header.unit, ..columns };
    records::frame(columns, vec![], warnings)
}

/// The stream of particles.
struct Stream<'a> {
    decoder: ZlibDecoder<&'a [u8]>,
    /// Bytes that are still wanted of it.
    left: usize,
    /// Packed bytes that progress was told of.
    told: u64,
    /// Why it ended early.
    fault: Option<String>,
}

impl Stream<'_> {
    /// Unpacks the next bytes; fewer than `most` at the end, or where there is a fault.
    fn take(&mut self, most: usize, progress: &dyn Progress) -> Result<Vec<u8>> {
        let wanted = most.min(self.left);
        let mut rows = Vec::new();
        while rows.len() < wanted && self.fault.is_none() {
            if progress.cancelled() {
                return Err(Error::Interrupted);
            }
            let step = STEP.min((wanted - rows.len()) as u64);
            match (&mut self.decoder).take(step).read_to_end(&mut rows) {
                Ok(0) => break,
                Ok(_) => {}
                Err(error) => self.fault = Some(error.to_string()),
            }
            progress.advance(self.decoder.total_in() - self.told);
            self.told = self.decoder.total_in();
        }
        self.left -= rows.len();
        Ok(rows)
    }
}

/// What stands before the particles.
struct Header {
    version: u32,
    /// -1 in a file that was not finished.
    count: i64,
    unit: Option<String>,
    channels: Vec<Channel>,
    /// Where the stream begins.
    start: usize,
}

/// A quantity: where it stands in a particle.
struct Channel {
    name: String,
    kind: Kind,
    components: usize,
    offset: usize,
}

impl Header {
    fn read(path: &Path, bytes: &[u8]) -> Result<Self> {
        let mut cursor = Cursor::new(path, bytes, 0, Order::Little, HINT);
        cursor.take(MAGIC.len(), "the magic word")?;
        let size: u32 = cursor.number("the size of the header")?;
        cursor.take(32, "the signature")?;
        let version = cursor.number("the version")?;
        let count = cursor.number("how many particles")?;
        let size = size as usize;
        if size < cursor.place() || size > bytes.len() {
            return Err(cursor.fault(format!("a header of {size} bytes was not expected")));
        }
        let unit = if version > 1 {
            unit(&mut Cursor::new(path, &bytes[..size], cursor.place(), Order::Little, HINT))
        } else {
            None
        };
        let mut cursor = Cursor::new(path, bytes, size, Order::Little, HINT);
        cursor.take(4, "a reserved number")?;
        let channel_count: u32 = cursor.number("how many channels")?;
        let length: u32 = cursor.number("the size of a channel")?;
        if length < 44 {
            return Err(cursor.fault(format!("44 bytes for a channel were wanted, {length} were found")));
        }
        let mut channels = Vec::new();
        for _ in 0..channel_count {
            let bytes = cursor.take(length as usize, "a channel")?;
            channels.push(Channel::read(&mut Cursor::new(path, bytes, 0, Order::Little, HINT))?);
        }
        Ok(Self { version, count, unit, channels, start: cursor.place() })
    }

    /// The channel of the positions.
    fn position(&self, path: &Path) -> Result<usize> {
        let exact = self.channels.iter().position(|it| it.name == "Position");
        let position =
            exact.or_else(|| self.channels.iter().position(|it| it.name.eq_ignore_ascii_case("position")));
        position.filter(|&place| self.channels[place].components == 3).ok_or_else(|| {
            let names: Vec<&str> = self.channels.iter().map(|it| it.name.as_str()).collect();
            let what = format!("a channel Position of three numbers was wanted; found: {}", names.join(", "));
            Error::format(path, "header", what, "export the channel Position too")
        })
    }

    /// Where the positions and the channels that are wanted stand in some rows.
    fn layout<'a>(&self, position: usize, rows: &'a [u8], wanted: Option<&Wanted>) -> Layout<'a> {
        let stride = self.stride();
        let source = |channel: &Channel| {
            let step = channel.kind.size();
            Source {
                bytes: rows,
                kind: channel.kind,
                order: Order::Little,
                start: channel.offset,
                stride,
                step,
            }
        };
        let center = source(&self.channels[position]);
        let others = self.channels.iter().enumerate().filter(|(place, _)| *place != position);
        let fields = others
            .map(|(_, it)| Field { name: it.name.clone(), components: it.components, source: source(it) })
            .collect();
        let axes = [0, 1, 2].map(|axis| Some(center.component(axis)));
        Layout { count: rows.len() / stride, axes, fields: records::wanted_fields(fields, wanted) }
    }

    /// The size of a particle.
    fn stride(&self) -> usize {
        let ends = self.channels.iter().map(|it| it.offset + it.components * it.kind.size());
        ends.max().unwrap_or(0)
    }
}

impl Channel {
    fn read(cursor: &mut Cursor) -> Result<Self> {
        let name = cursor.take(32, "a channel's name")?;
        let name = name.split(|&byte| byte == 0).next().unwrap_or_default();
        let name = String::from_utf8_lossy(name).into_owned();
        let code: u32 = cursor.number("a type")?;
        let [components, offset]: [u32; 2] =
            [cursor.number("how many components")?, cursor.number("an offset")?];
        let kind = kind(code)
            .ok_or_else(|| cursor.fault(format!("channel '{name}' has type {code}; 0 to 10 are known")))?;
        // More would be no particle; it also keeps sums within their type.
        if components == 0 || components > 1 << 16 || offset > 1 << 20 {
            let what = format!("channel '{name}' has {components} components at {offset}");
            return Err(cursor.fault(what));
        }
        Ok(Self { name, kind, components: components as usize, offset: offset as usize })
    }
}

/// The numbers of a type.
fn kind(code: u32) -> Option<Kind> {
    const KINDS: [Kind; 11] = [
        Kind::I16,
        Kind::I32,
        Kind::I64,
        Kind::F16,
        Kind::F32,
        Kind::F64,
        Kind::U16,
        Kind::U32,
        Kind::U64,
        Kind::I8,
        Kind::U8,
    ];
    KINDS.get(code as usize).copied()
}

/// The unit of lengths, if the meta data say it. They are chunks: a channel's name or none, the name, the type, the value.
fn unit(cursor: &mut Cursor) -> Option<String> {
    loop {
        let word = cursor.take(4, "a chunk").ok()?;
        let length: u32 = cursor.number("its length").ok()?;
        let chunk = cursor.take(length as usize, "its content").ok()?;
        if word == b"Stop" {
            return None;
        }
        let value = chunk.strip_prefix(b"\0LengthUnitInMeters\0").and_then(|it| it.get(4..12));
        if let (b"Meta", Some(value)) = (word, value) {
            return Some(unit_name(f64::from_bytes::<false>(value)));
        }
    }
}

/// The name of a unit of so many meters.
fn unit_name(meters: f64) -> String {
    let known = [
        (1e3, "km"),
        (1.0, "m"),
        (0.1, "dm"),
        (0.01, "cm"),
        (1e-3, "mm"),
        (1e-6, "µm"),
        (0.3048, "ft"),
        (0.0254, "in"),
    ];
    let name = known.iter().find(|(size, _)| (size / meters - 1.0).abs() < 1e-6);
    name.map_or_else(|| format!("{meters} m"), |(_, name)| name.to_string())
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use tyndall::particles::Values;

    use super::*;
    use crate::read::real_data;

    /// A file of `count` particles; the header says `told`. A gap stands behind each particle's last channel but one.
    fn file(count: u16, told: i64) -> Vec<u8> {
        file_of(count, told, |id| 1 << 40 | u64::from(id))
    }

    /// The same with these ids.
    fn file_of(count: u16, told: i64, ids: impl Fn(u16) -> u64) -> Vec<u8> {
        let mut meta = b"Meta\x26\0\0\0\0BoundBox\0\x04\0\0\0".to_vec();
        meta.extend([0; 24]);
        meta.extend(b"Meta\x20\0\0\0\0LengthUnitInMeters\0\x05\0\0\0");
        meta.extend(0.01f64.to_le_bytes());
        meta.extend(b"Stop\0\0\0\0");
        let mut bytes = MAGIC.to_vec();
        bytes.extend((56 + meta.len() as u32).to_le_bytes());
        bytes.extend(b"Extensible Particle Format\0\0\0\0\0\0");
        bytes.extend(2u32.to_le_bytes());
        bytes.extend(told.to_le_bytes());
        bytes.extend(meta);
        let channels = [("ID", 8, 1, 24), ("Position", 5, 3, 0), ("Velocity", 3, 3, 34), ("Flag", 9, 1, 40)];
        bytes.extend([4u32, 4, 48].iter().flat_map(|it| it.to_le_bytes()));
        for (name, kind, components, offset) in channels {
            bytes.extend([name.as_bytes(), &[0; 32][name.len()..]].concat());
            bytes.extend([kind, components, offset, 0u32].iter().flat_map(|it| it.to_le_bytes()));
        }
        let mut rows = Vec::new();
        for id in 0..count {
            rows.extend([f64::from(id), 0.1, 1e9].iter().flat_map(|it| it.to_le_bytes()));
            rows.extend(ids(id).to_le_bytes());
            rows.extend([9, 9]);
            // 1, -2 and the least half float.
            rows.extend([0x3c00u16, 0xc000, 1].iter().flat_map(|it| it.to_le_bytes()));
            rows.push(0xff);
        }
        let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
        encoder.write_all(&rows).unwrap();
        bytes.extend(encoder.finish().unwrap());
        bytes
    }

    fn read_by(bytes: &[u8], strict: bool) -> Result<Frame> {
        let (path, options) = (Path::new("test"), Options { strict, ..Options::default() });
        let index = index(path, bytes, &options)?;
        let request = Request { options: &options, bytes: None, units: None, topology: None, others: &() };
        frame(path, bytes, index.frames[0], &request, &())
    }

    fn read(bytes: &[u8]) -> Result<Frame> {
        read_by(bytes, false)
    }

    #[test]
    fn batches_of_any_size_are_what_all_at_once_is() {
        let bytes = file(9000, 9000);
        let whole = read(&bytes).unwrap().particles;
        // The first batch has the positions that decide the origin.
        for batch in [4096, 5000, 8999, 9000, 20_000] {
            let progress = (batch * 41, &() as &dyn Progress);
            let some =
                super::read(Path::new("test"), &bytes, &Options::default(), progress).unwrap().particles;
            assert!(some.positions() == whole.positions(), "{batch}");
            assert_eq!(some.attributes(), whole.attributes(), "{batch}");
        }
        // One row at a time, with an integer that is too large for its type on the way.
        let ids = |id: u16| if id == 2 { u64::MAX } else { u64::from(id) };
        let some =
            super::read(Path::new("test"), &file_of(4, 4, ids), &Options::default(), (1, &())).unwrap();
        let values = &some.particles.attribute("ID").unwrap().values;
        assert_eq!(*values, Values::F64(vec![0.0, 1.0, u64::MAX as f64, 3.0]));
    }

    #[test]
    fn channels_are_attributes_of_their_own_types() {
        for count in [0, 1, 3] {
            let particles = read(&file(count, count.into())).unwrap().particles;
            assert_eq!((particles.len(), particles.length_unit()), (count.into(), Some("cm")));
            let values = |name: &str| &particles.attribute(name).unwrap().values;
            let ids = (0..i64::from(count)).map(|id| 1 << 40 | id).collect();
            assert_eq!(*values("ID"), Values::I64(ids));
            assert_eq!(*values("Flag"), Values::I32(vec![-1; count.into()]));
            let half = [1.0, -2.0, 2f32.powi(-24)];
            assert_eq!(*values("Velocity"), Values::F32(half.repeat(count.into())));
            for id in 0..usize::from(count) {
                assert!((particles.positions().world(id).x - id as f64).abs() < 1e-6);
                assert_eq!(particles.positions().world(id).z, 1e9);
            }
        }
    }

    #[test]
    fn unfinished_files_give_what_is_there() {
        let bytes = file(3, -1);
        let frame = read(&bytes).unwrap();
        assert_eq!((frame.particles.len(), frame.warnings.len()), (3, 1));
        assert!(read_by(&bytes, true).unwrap_err().to_string().contains("not finished"));
        // Its stream may end anywhere.
        let frame = read(&file(3, -1)[..bytes.len() - 8]).unwrap();
        assert!(frame.particles.len() <= 3 && frame.warnings[0].contains("use --strict"));
    }

    #[test]
    fn a_file_cut_anywhere_is_refused() {
        let bytes = file(3, 3);
        // The checksum at the end says nothing about particles.
        for length in 0..bytes.len() - 4 {
            if let Ok(frame) = read(&bytes[..length]) {
                assert_eq!(frame.particles.len(), 3, "{length}");
                assert!(length + 8 > bytes.len(), "{length}");
            }
        }
        assert!(read(&file(3, 4)).unwrap_err().to_string().contains("after 3 of 4 particles"));
        for told in [1 << 40, i64::MAX] {
            assert!(read(&file(3, told)).unwrap_err().to_string().contains("compressed bytes are there"));
        }
    }

    #[test]
    fn damage_never_panics() {
        for told in [2, -1] {
            real_data::damage(&file(2, told), |file| drop(read(file)));
        }
    }

    #[test]
    fn units_have_names() {
        assert_eq!([1.0, 0.0254, 0.05].map(unit_name), ["m", "in", "0.05 m"]);
        assert!(is_later(b"\xc0PRT2\r\n\x1a") && is_later(b"\xc0tst\r\n\x1a\n") && !is_later(MAGIC));
    }

    #[test]
    fn real_files_are_read_as_partio_reads_them() {
        for name in ["fluid50", "fractal_312"] {
            let read = |_: &Path, bytes: &[u8], _: &dyn Progress| read(bytes);
            real_data::compare(&format!("prt/{name}.prt"), recognise, read);
        }
    }
}
