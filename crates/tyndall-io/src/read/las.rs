//! LAS and its packed form LAZ, the format of airborne laser scanning: versions 1.0 to 1.4, point formats 0 to 10.
//!
//! Records of fixed size follow a header and its variable records; packed ones come out of the crate laz, pure Rust, as they
//! were. Coordinates are integers times a scale plus an offset, in double precision until the origin is off. Extra bytes that the file
//! describes are quantities too; wave forms are left out. Source: ASPRS, "LAS specification 1.4 - R15".

mod extra;
mod packed;

use std::borrow::Cow;
use std::path::Path;

use glam::DVec3;
use rayon::prelude::*;
use tyndall::scene::wanted::{Offered, Wanted};
use tyndall::{Error, Progress, Result};

use self::packed::{Chunk, Packing};
use super::cursor::Cursor;
use super::numbers::{Kind, Order};
use super::records::{self, Builder, ORIGIN_COUNT, Source, truncated};
use crate::sequence::Frame;

const HINT: &str = "was the file copied to its end? lasinfo may say more";
/// Points that a thread unpacks at a time.
const BATCH: usize = 1 << 16;
/// More points than this are not in a byte of a packed file.
const MOST_PACKED: u64 = 256;
/// Bytes of a record of each point format, without extra ones.
const RECORD_BYTES: [usize; 11] = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];

/// Whether the file begins like LAS.
pub(crate) fn recognise(head: &[u8]) -> bool {
    head.starts_with(b"LASF")
}

/// What of the header and its variable records matters here.
struct Header {
    /// Where the points begin.
    start: usize,
    /// The point format, 0 to 10.
    format: usize,
    /// Bytes of a point, unpacked.
    record: usize,
    count: u64,
    scale: DVec3,
    offset: DVec3,
    /// How the points are packed, if they are.
    packing: Option<Packing>,
    /// Whether the coordinate system is named.
    system: bool,
    /// Descriptions of extra bytes.
    extra: Vec<u8>,
}

impl Header {
    fn read(path: &Path, bytes: &[u8]) -> Result<Self> {
        let mut cursor = Cursor::new(path, bytes, 0, Order::Little, HINT);
        if cursor.take(4, "the magic word")? != b"LASF" {
            return Err(cursor.fault("wanted LASF"));
        }
        cursor.take(21, "the head of the header")?;
        let minor: u8 = cursor.number("the version")?;
        cursor.take(68, "names and a date")?;
        let size: u16 = cursor.number("the header's size")?;
        let start: u32 = cursor.number("where the points begin")?;
        let records: u32 = cursor.number("how many variable records there are")?;
        let format: u8 = cursor.number("the point format")?;
        let record: u16 = cursor.number("the size of a point")?;
        let legacy: u32 = cursor.number("the number of points")?;
        cursor.take(20, "numbers of points by return")?;
        let mut vector = |what: &str| -> Result<DVec3> {
            Ok(DVec3::new(cursor.number(what)?, cursor.number(what)?, cursor.number(what)?))
        };
        let (scale, offset) = (vector("the scale")?, vector("the offset")?);
        cursor.take(48, "the bounds")?;
        let mut count = u64::from(legacy);
        if minor >= 4 && size >= 375 {
            cursor.take(20, "where further records are")?;
            count = cursor.number("the number of points")?;
        }
        // The two topmost bits say that the points are packed.
        let (is_packed, format) = (format & 0xc0 != 0, usize::from(format & 0x3f));
        let Some(&least) = RECORD_BYTES.get(format) else {
            return Err(cursor.fault(format!("point formats 0 to 10 are known, {format} was found")));
        };
        let record = usize::from(record);
        if record < least {
            return Err(cursor.fault(format!(
                "a point of format {format} has at least {least} bytes, {record} are given"
            )));
        }

        let (mut packing, mut system, mut extra) = (None, false, Vec::new());
        let mut cursor = Cursor::new(path, bytes, size.into(), Order::Little, HINT);
        for _ in 0..records {
            cursor.take(2, "a variable record")?;
            let user = cursor.text(16, "whose record it is")?;
            let number: u16 = cursor.number("a record's number")?;
            let length: u16 = cursor.number("a record's length")?;
            cursor.take(32, "a record's description")?;
            let data = cursor.take(length.into(), "a variable record")?;
            match user.trim_end_matches('\0') {
                "laszip encoded" if number == 22204 => {
                    packing = Some(Packing::read(data).map_err(|what| cursor.fault(what))?);
                }
                "LASF_Projection" => system = true,
                "LASF_Spec" if number == 4 => extra.extend_from_slice(data),
                _ => {}
            }
        }
        if is_packed != packing.is_some() {
            return Err(cursor.fault(
                "the point format and the record of LASzip do not agree on whether points are packed",
            ));
        }
        if packing.as_ref().is_some_and(|it| it.record_bytes() != record as u64) {
            return Err(cursor.fault(format!("the record of LASzip has not {record} bytes a point")));
        }
        Ok(Self { start: start as usize, format, record, count, scale, offset, packing, system, extra })
    }

    /// Fails unless the file may hold the points.
    fn check(&self, path: &Path, bytes: &[u8]) -> Result<()> {
        let most = match self.packing {
            Some(_) => (bytes.len() as u64).saturating_mul(MOST_PACKED),
            None => (bytes.len().saturating_sub(self.start) / self.record) as u64,
        };
        let fits = self.count <= most && self.start <= bytes.len();
        if fits {
            Ok(())
        } else {
            Err(truncated(path, self.count, self.record, bytes.len().saturating_sub(self.start)))
        }
    }
}

/// Where a quantity stands in a record.
#[derive(Clone, Copy, Debug)]
enum Place {
    /// A number at a byte.
    Number(Kind, usize),
    /// Bits of a byte: how many are below them, and how many they are.
    Bits(usize, u32, u32),
    /// Steps of 0.006 degrees.
    Angle(usize),
    /// Numbers at a byte, each times a scale plus an offset.
    Scaled { kind: Kind, at: usize, scales: [f64; 3], offsets: [f64; 3] },
}

/// What points have beside their place.
#[derive(Clone, Debug)]
struct Quantity {
    name: String,
    components: usize,
    place: Place,
    /// Whether it is behind what the point format has.
    extra: bool,
}

/// The quantities of a point format.
fn quantities(format: usize) -> Vec<Quantity> {
    use Place::{Angle, Bits, Number};
    let mut quantities = vec![("intensity", Number(Kind::U16, 12))];
    let mut end = if format >= 6 {
        quantities.extend([
            ("return_number", Bits(14, 0, 4)),
            ("number_of_returns", Bits(14, 4, 4)),
            ("synthetic", Bits(15, 0, 1)),
            ("key_point", Bits(15, 1, 1)),
            ("withheld", Bits(15, 2, 1)),
            ("overlap", Bits(15, 3, 1)),
            ("scanner_channel", Bits(15, 4, 2)),
            ("scan_direction_flag", Bits(15, 6, 1)),
            ("edge_of_flight_line", Bits(15, 7, 1)),
            ("classification", Number(Kind::U8, 16)),
            ("user_data", Number(Kind::U8, 17)),
            ("scan_angle", Angle(18)),
            ("point_source_id", Number(Kind::U16, 20)),
        ]);
        22
    } else {
        quantities.extend([
            ("return_number", Bits(14, 0, 3)),
            ("number_of_returns", Bits(14, 3, 3)),
            ("scan_direction_flag", Bits(14, 6, 1)),
            ("edge_of_flight_line", Bits(14, 7, 1)),
            ("classification", Bits(15, 0, 5)),
            ("synthetic", Bits(15, 5, 1)),
            ("key_point", Bits(15, 6, 1)),
            ("withheld", Bits(15, 7, 1)),
            ("scan_angle_rank", Number(Kind::I8, 16)),
            ("user_data", Number(Kind::U8, 17)),
            ("point_source_id", Number(Kind::U16, 18)),
        ]);
        20
    };
    if !matches!(format, 0 | 2) {
        quantities.push(("gps_time", Number(Kind::F64, end)));
        end += 8;
    }
    if matches!(format, 2 | 3 | 5 | 7 | 8 | 10) {
        let channels = ["red", "green", "blue"].into_iter().zip([0, 2, 4]);
        quantities.extend(channels.map(|(name, offset)| (name, Number(Kind::U16, end + offset))));
        end += 6;
    }
    if matches!(format, 8 | 10) {
        quantities.push(("nir", Number(Kind::U16, end)));
    }
    let quantity =
        |(name, place): (&str, Place)| Quantity { name: name.into(), components: 1, place, extra: false };
    quantities.into_iter().map(quantity).collect()
}

impl Place {
    fn kind(self) -> Kind {
        match self {
            Self::Number(kind, _) => kind,
            Self::Bits(..) => Kind::U8,
            Self::Angle(_) => Kind::F32,
            Self::Scaled { .. } => Kind::F64,
        }
    }
}

/// Those of the quantities that are wanted, all if nothing is said.
fn wanted_of(quantities: Vec<Quantity>, wanted: Option<&Wanted>) -> Vec<Quantity> {
    let Some(wanted) = wanted else { return quantities };
    let offered = quantities.iter().map(|it| Offered {
        name: &it.name,
        components: it.components,
        is_measured: it.place.kind().is_float(),
    });
    let flags = wanted.flags(&offered.collect::<Vec<_>>());
    quantities.into_iter().zip(flags).filter_map(|(quantity, flag)| flag.then_some(quantity)).collect()
}

/// Reads the points, with those of their quantities that are wanted.
pub(crate) fn read(
    path: &Path,
    bytes: &[u8],
    wanted: Option<&Wanted>,
    progress: &dyn Progress,
) -> Result<Frame> {
    progress.begin("read", Some(bytes.len() as u64), "B");
    let header = Header::read(path, bytes)?;
    header.check(path, bytes)?;
    let (count, record) = (header.count as usize, header.record);
    let (mut quantities, own) = (quantities(header.format), RECORD_BYTES[header.format]);
    let (extra, unknown) = extra::quantities(&header.extra, own, record);
    // A name that the format has goes to the quantity of the format.
    let is_new = |it: &Quantity| !it.name.is_empty() && quantities.iter().all(|own| own.name != it.name);
    let (extra, doubled): (Vec<_>, Vec<_>) = extra.into_iter().partition(is_new);
    quantities.extend(extra);
    let quantities = wanted_of(quantities, wanted);

    // Without points there is nothing, not even where their chunks are.
    let packing = header.packing.as_ref().filter(|_| count > 0);
    let chunks = packing.map(|it| it.chunks(path, bytes, header.start, header.count)).transpose()?;
    let names: Vec<&str> =
        quantities.iter().map(|it| if it.extra { packed::EXTRA_BYTES } else { it.name.as_str() }).collect();
    let open = |packing: &Packing, chunk: &Chunk| packing.open((path, bytes), header.start, chunk, &names);

    // The first points decide the origin.
    let first = ORIGIN_COUNT.min(count) * record;
    let head = match packing.zip(chunks.as_deref().and_then(<[_]>::first)) {
        Some((packing, chunk)) => {
            let mut head = vec![0; first.min(chunk.points * record)];
            open(packing, chunk)?.unpack(&mut head)?;
            Cow::Owned(head)
        }
        None => Cow::Borrowed(&bytes[header.start..][..first]),
    };
    let head = [0, 1, 2].map(|axis| coordinates(&head, &header, axis));
    let head: Vec<DVec3> =
        (0..head[0].len()).map(|id| DVec3::new(head[0][id], head[1][id], head[2][id])).collect();
    let columns = quantities.iter().map(|it| (it.name.clone(), it.components, it.place.kind()));
    let mut builder = Builder::new(count, &head, columns);
    let fill_batch = |start: usize, slots: &mut [records::Slot], records: &[u8]| {
        if progress.cancelled() {
            return Err(Error::Interrupted);
        }
        let axes = [0, 1, 2].map(|axis| coordinates(records, &header, axis));
        fill(slots, &axes, records, record, &quantities);
        let share = |rows: usize| rows as u128 * bytes.len() as u128 / count as u128;
        progress.let_go(records);
        progress.advance((share(start + records.len() / record) - share(start)) as u64);
        Ok(())
    };
    // Chunks are unpacked side by side, each in batches.
    let batches = |start: usize, end: usize| {
        (start..end).step_by(BATCH).map(move |start| (start, BATCH.min(end - start)))
    };
    let (mut rows, mut jobs, mut place) = (Vec::new(), Vec::new(), 0);
    for chunk in chunks.iter().flatten() {
        rows.extend(batches(place, place + chunk.points));
        jobs.push((Some(chunk), chunk.points.div_ceil(BATCH)));
        place += chunk.points;
    }
    if chunks.is_none() {
        rows.extend(batches(0, count));
        jobs.extend(rows.iter().map(|_| (None, 1)));
    }
    let counts: Vec<usize> = rows.iter().map(|it| it.1).collect();
    let mut slots = builder.split(&counts).into_iter().zip(rows);
    let jobs: Vec<_> = jobs
        .into_iter()
        .map(|(chunk, count)| (chunk, slots.by_ref().take(count).collect::<Vec<_>>()))
        .collect();
    jobs.into_par_iter().try_for_each(|(chunk, batches)| {
        let mut packed = packing.zip(chunk).map(|(packing, chunk)| open(packing, chunk)).transpose()?;
        let mut unpacked = Vec::new();
        for (mut slots, (start, rows)) in batches {
            let records = match &mut packed {
                Some(packed) => {
                    unpacked.resize(rows * record, 0);
                    packed.unpack(&mut unpacked)?;
                    &unpacked[..]
                }
                None => &bytes[header.start + start * record..][..rows * record],
            };
            fill_batch(start, &mut slots, records)?;
        }
        Ok(())
    })?;
    let columns = builder.into_columns();

    let mut conventions = vec!["coordinates: integers times the header's scale, plus its offset".to_string()];
    if header.system {
        conventions.push(
            "the coordinate system, which the file names, is not looked at: no unit of length".to_string(),
        );
    }
    let mut warnings = Vec::new();
    if unknown > 0 {
        warnings
            .push(format!("left out: {unknown} extra bytes of each point, which the file does not describe"));
    }
    for quantity in doubled {
        warnings.push(format!("left out: extra bytes named '{}', as another quantity is", quantity.name));
    }
    if matches!(header.format, 4 | 5 | 9 | 10) {
        warnings.push("left out: wave forms".to_string());
    }
    records::frame(columns, conventions, warnings)
}

/// The coordinates along an axis.
fn coordinates(records: &[u8], header: &Header, axis: usize) -> Vec<f64> {
    let stride = header.record;
    let source =
        Source { bytes: records, kind: Kind::I32, order: Order::Little, start: 4 * axis, stride, step: 0 };
    let (scale, offset) = (header.scale[axis], header.offset[axis]);
    let mut values = vec![0.0; records.len() / stride];
    source.convert_all(&mut values, 0, 1, |number| number * scale + offset);
    values
}

/// Numbers in this machine's order of bytes.
fn native(bytes: &[u8], kind: Kind) -> Source<'_> {
    let order = if cfg!(target_endian = "big") { Order::Big } else { Order::Little };
    Source { bytes, kind, order, start: 0, stride: kind.size(), step: 0 }
}

/// Brings a batch of records into their slots.
fn fill(
    slots: &mut [records::Slot],
    coordinates: &[Vec<f64>; 3],
    bytes: &[u8],
    stride: usize,
    quantities: &[Quantity],
) {
    let count = coordinates[0].len();
    let (axes, values) = slots.split_at_mut(3);
    for (slot, coordinates) in axes.iter_mut().zip(coordinates) {
        slot.fill(&native(bytemuck::cast_slice(coordinates), Kind::F64), 0, 1, 0..count);
    }
    for (slot, quantity) in values.iter_mut().zip(quantities) {
        let components = quantity.components;
        match quantity.place {
            Place::Number(kind, start) => {
                let source = Source { bytes, kind, order: Order::Little, start, stride, step: kind.size() };
                slot.fill(&source, 0, components, 0..count);
            }
            Place::Bits(at, below, bits) => {
                let value = |record: &[u8]| record[at] >> below & ((1 << bits) - 1) as u8;
                let values: Vec<u8> = bytes.chunks_exact(stride).map(value).collect();
                slot.fill(&native(&values, Kind::U8), 0, 1, 0..count);
            }
            Place::Angle(start) => {
                let source = Source { bytes, kind: Kind::I16, order: Order::Little, start, stride, step: 0 };
                let mut values = vec![0.0; count];
                source.convert_all(&mut values, 0, 1, |number| (0.006 * number) as f32);
                slot.fill(&native(bytemuck::cast_slice(&values), Kind::F32), 0, 1, 0..count);
            }
            Place::Scaled { kind, at, scales, offsets } => {
                let source =
                    Source { bytes, kind, order: Order::Little, start: at, stride, step: kind.size() };
                let mut values = vec![0.0; count * components];
                source.convert_all(&mut values, 0, components, |number| number);
                for point in values.chunks_exact_mut(components) {
                    for ((value, scale), offset) in point.iter_mut().zip(scales).zip(offsets) {
                        *value = *value * scale + offset;
                    }
                }
                let stride = 8 * components;
                let source = Source { stride, step: 8, ..native(bytemuck::cast_slice(&values), Kind::F64) };
                slot.fill(&source, 0, components, 0..count);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use laz::{LasZipCompressor, LazItemRecordBuilder, LazVlr, LazVlrBuilder};

    use super::*;
    use crate::read::real_data;
    use tyndall::scene::coloring::Coloring;

    /// The record of a point: x = 6e6 + id, y = -2 id, z = 0.25 in steps of 0.01.
    fn record(id: usize, format: usize) -> Vec<u8> {
        let mut record = Vec::new();
        for step in [100 * id as i32, -200 * id as i32 + 10_000, 25] {
            record.extend(step.to_le_bytes());
        }
        record.extend((100 + id as u16 % 1000).to_le_bytes());
        let withheld = u8::from(id == 1);
        if format >= 6 {
            record.extend([0x21, withheld << 2 | 1 << 7, 5, 7]);
            record.extend(500i16.to_le_bytes());
        } else {
            record.extend([0x11 | 1 << 7, withheld << 7 | 5, 3, 7]);
        }
        record.extend(300u16.to_le_bytes());
        if !matches!(format, 0 | 2) {
            record.extend((0.5 + id as f64).to_le_bytes());
        }
        if matches!(format, 2 | 3 | 5 | 7 | 8 | 10) {
            record.extend([1u16, 2, 65535].iter().flat_map(|it| it.to_le_bytes()));
        }
        if matches!(format, 8 | 10) {
            record.extend(9u16.to_le_bytes());
        }
        record.resize(RECORD_BYTES[format], 0);
        record
    }

    fn points(count: usize, format: usize, packed: bool) -> Vec<u8> {
        if packed { packed_points(count, format, Some(50_000)) } else { file_of(count, format, None) }
    }

    /// Points in chunks of that size, or of several sizes.
    fn packed_points(count: usize, format: usize, chunk: Option<u32>) -> Vec<u8> {
        let items = LazItemRecordBuilder::default_for_point_format_id(format as u8, 0).unwrap();
        let builder = LazVlrBuilder::new(items);
        let vlr = match chunk {
            Some(size) => builder.with_fixed_chunk_size(size),
            None => builder.with_variable_chunk_size(),
        };
        file_of(count, format, Some(vlr.build()))
    }

    fn file_of(count: usize, format: usize, packing: Option<LazVlr>) -> Vec<u8> {
        let packed = packing.is_some();
        let mut file = b"LASF".to_vec();
        file.resize(24, 0);
        file.extend([1, 4]);
        file.resize(94, 0);
        let mut vlr = Vec::new();
        if let Some(packing) = &packing {
            packing.write_to(&mut vlr).unwrap();
        }
        let variable = if packed { 54 + vlr.len() } else { 0 };
        file.extend(375u16.to_le_bytes());
        file.extend((375 + variable as u32).to_le_bytes());
        file.extend(u32::from(packed).to_le_bytes());
        file.push(format as u8 | if packed { 0x80 } else { 0 });
        file.extend((RECORD_BYTES[format] as u16).to_le_bytes());
        file.extend([0; 24]);
        for number in [0.01, 0.01, 0.01, 6e6, -100.0, 0.0] {
            file.extend(f64::to_le_bytes(number));
        }
        file.resize(247, 0);
        file.extend((count as u64).to_le_bytes());
        file.resize(375, 0);
        let records: Vec<u8> = (0..count).flat_map(|id| record(id, format)).collect();
        let Some(packing) = packing else {
            file.extend(records);
            return file;
        };
        file.extend([0; 2]);
        file.extend(b"laszip encoded\0\0");
        file.extend(22204u16.to_le_bytes());
        file.extend((vlr.len() as u16).to_le_bytes());
        file.extend([0; 32]);
        file.extend(vlr);
        let end = file.len() as u64;
        let mut out = std::io::Cursor::new(file);
        out.set_position(end);
        let is_variable = packing.uses_variable_size_chunks();
        let mut compressor = LasZipCompressor::new(&mut out, packing).unwrap();
        for (id, record) in records.chunks_exact(RECORD_BYTES[format]).enumerate() {
            if is_variable && [700, 701, 40_000].contains(&id) {
                compressor.finish_current_chunk().unwrap();
            }
            compressor.compress_one(record).unwrap();
        }
        compressor.done().unwrap();
        drop(compressor);
        out.into_inner()
    }

    fn read(bytes: &[u8]) -> Result<Frame> {
        super::read(Path::new("test"), bytes, None, &())
    }

    #[test]
    fn every_point_format_is_read() {
        for (format, packed) in
            (0..=10).map(|it| (it, false)).chain([0, 1, 2, 3, 6, 7, 8].map(|it| (it, true)))
        {
            let bytes = points(5, format, packed);
            assert!(recognise(&bytes));
            let frame = read(&bytes).unwrap();
            let particles = &frame.particles;
            let what = format!("format {format}, packed {packed}");
            let place = particles.positions().world(4);
            assert!(place.abs_diff_eq(DVec3::new(6e6 + 4.0, -8.0, 0.25), 1e-5), "{what}: {place}");
            let number = |name: &str| particles.attribute(name).map(|it| it.number(4, 0));
            assert_eq!(
                (number("intensity"), number("number_of_returns")),
                (Some(104.0), Some(2.0)),
                "{what}"
            );
            assert_eq!(
                (number("return_number"), number("edge_of_flight_line")),
                (Some(1.0), Some(1.0)),
                "{what}"
            );
            assert_eq!((number("classification"), number("user_data")), (Some(5.0), Some(7.0)), "{what}");
            assert_eq!(number("point_source_id"), Some(300.0), "{what}");
            let timed = ![0, 2].contains(&format);
            let colored = [2, 3, 5, 7, 8, 10].contains(&format);
            assert_eq!(number("gps_time"), timed.then_some(4.5), "{what}");
            assert_eq!(number("blue"), colored.then_some(65535.0), "{what}");
            assert_eq!(number("nir"), [8, 10].contains(&format).then_some(9.0), "{what}");
            let angle = number(if format >= 6 { "scan_angle" } else { "scan_angle_rank" }).unwrap();
            assert!((angle - 3.0).abs() < 1e-6, "{what}: {angle}");
            let withheld = particles.attribute("withheld").unwrap();
            assert_eq!([0, 1, 2].map(|id| withheld.number(id, 0)), [0.0, 1.0, 0.0], "{what}");
        }
    }

    /// Points of format 6 with three quantities behind it, two of which the file describes in full.
    fn with_extra_bytes() -> Vec<u8> {
        let describe = |kind: u8, options: u8, name: &str, scale: f64, offset: f64| {
            let mut text = vec![0u8; 192];
            (text[2], text[3]) = (kind, options);
            text[4..4 + name.len()].copy_from_slice(name.as_bytes());
            for axis in 0..3 {
                text[112 + 8 * axis..][..8].copy_from_slice(&scale.to_le_bytes());
                text[136 + 8 * axis..][..8].copy_from_slice(&offset.to_le_bytes());
            }
            text
        };
        let texts = [
            describe(24, 0, "normal", 0.0, 0.0),
            describe(0, 3, "", 0.0, 0.0),
            describe(3, 24, "height", 0.5, 100.0),
            describe(1, 0, "intensity", 0.0, 0.0),
        ];
        let mut file = points(5, 6, false);
        let records = file.split_off(375);
        let extra = 6 + 3 + 2 + 1;
        file[96..100].copy_from_slice(&(375u32 + 54 + 4 * 192).to_le_bytes());
        file[100..104].copy_from_slice(&1u32.to_le_bytes());
        file[105..107].copy_from_slice(&(RECORD_BYTES[6] as u16 + extra).to_le_bytes());
        file.extend([0; 2]);
        file.extend(b"LASF_Spec\0\0\0\0\0\0\0");
        file.extend([4u16, 4 * 192].iter().flat_map(|it| it.to_le_bytes()));
        file.extend([0; 32]);
        file.extend(texts.concat());
        for (id, record) in records.chunks_exact(RECORD_BYTES[6]).enumerate() {
            file.extend(record);
            file.extend([id as i16, -1, 7].iter().flat_map(|it| it.to_le_bytes()));
            file.extend([9; 3]);
            file.extend((10 * id as u16).to_le_bytes());
            file.push(1);
        }
        file
    }

    #[test]
    fn extra_bytes_that_are_described_are_quantities() {
        let frame = read(&with_extra_bytes()).unwrap();
        let number = |name: &str, component| frame.particles.attribute(name).unwrap().number(4, component);
        assert_eq!([0, 1, 2].map(|it| number("normal", it)), [4.0, -1.0, 7.0]);
        assert_eq!((number("height", 0), number("intensity", 0)), (120.0, 104.0));
        assert_eq!(
            frame.warnings,
            [
                "left out: 3 extra bytes of each point, which the file does not describe",
                "left out: extra bytes named 'intensity', as another quantity is"
            ]
        );
    }

    #[test]
    fn what_is_wanted_is_what_is_read_of_all() {
        for (format, packed) in (0..=10).map(|it| (it, false)).chain([3, 6, 7, 8].map(|it| (it, true))) {
            let bytes = points(500, format, packed);
            let all = read(&bytes).unwrap().particles;
            let names: Vec<String> = all.attributes().iter().map(|it| it.name.clone()).collect();
            for name in &names {
                let wanted = Wanted {
                    coloring: Coloring::Constant([0.0; 3]),
                    quantities: vec![name.clone()],
                    ..Wanted::default()
                };
                let one = super::read(Path::new("test"), &bytes, Some(&wanted), &()).unwrap().particles;
                assert!(one.positions() == all.positions(), "format {format}, {name}");
                assert_eq!(one.attributes(), [all.attribute(name).unwrap().clone()], "format {format}");
            }
        }
    }

    #[test]
    fn points_of_many_chunks_keep_their_order() {
        let count = BATCH + 3;
        let check = |bytes: &[u8], what: &str| {
            let particles = read(bytes).unwrap_or_else(|error| panic!("{what}: {error}")).particles;
            let time = particles.attribute("gps_time").unwrap();
            assert!((0..count).all(|id| time.number(id, 0) == 0.5 + id as f64), "{what}");
            assert_eq!(particles.len(), count, "{what}");
        };
        for format in [3, 7] {
            for chunk in [Some(50_000), Some(BATCH as u32 + 1), Some(1_000), Some(u32::MAX - 1), None] {
                let mut bytes = packed_points(count, format, chunk);
                check(&bytes, &format!("format {format}, chunks of {chunk:?}"));
                if format == 7 && chunk.is_some_and(|it| (it as usize) < count) {
                    // Layers tell where chunks end, also without the table.
                    let start = u32::from_le_bytes(bytes[96..100].try_into().unwrap()) as usize;
                    bytes[start..start + 8].fill(0xff);
                    bytes.extend([0xff; 8]);
                    check(&bytes, &format!("format {format}, chunks of {chunk:?} without a table"));
                }
            }
        }
    }

    #[test]
    fn none_and_one_point_are_fine() {
        for packed in [false, true] {
            for count in [0, 1] {
                assert_eq!(read(&points(count, 3, packed)).unwrap().particles.len(), count);
            }
        }
    }

    #[test]
    fn cut_files_and_hostile_counts_are_refused() {
        let bytes = points(50, 1, false);
        for length in (0..bytes.len()).step_by(7) {
            assert!(read(&bytes[..length]).is_err(), "{length} of {}", bytes.len());
        }
        for packed in [false, true] {
            let mut hostile = points(50, 1, packed);
            hostile[247..255].fill(0x7f);
            assert!(read(&hostile).is_err());
        }
    }

    #[test]
    fn damage_never_panics() {
        for packed in [false, true] {
            real_data::damage_some(&points(20, 3, packed), |file| drop(read(file)));
        }
        real_data::damage_some(&with_extra_bytes(), |file| drop(read(file)));
    }
}
