//! TIPSY snapshots of PKDGRAV, Gasoline and ChaNGa: standard (big-endian) and native, with single or double precision.
//!
//! A header of 28 bytes, mostly padded to 32, is followed by the records of all gas, all dark and all star particles. Nothing
//! says how long a record is: the file's size tells header, order of bytes and precision apart. Positions and velocities are
//! as in the file; units are in the run's `.param` file. Source: tipsydefs.h of TIPSY, N-Body Shop.

use std::path::Path;

use tyndall::{Error, Progress, Result};

use super::cursor::Cursor;
use super::numbers::{Kind, Order};
use super::records::{self, Source};
use super::sections::{self, Column, Section, Value};
use super::snapshot::{self, TypeNames};
use super::{Index, Request, Span};
use crate::sequence::{Frame, Options};

const HINT: &str = "was the file copied to its end, and is it a TIPSY snapshot?";

/// The types, in the order of the file.
const TYPES: [TypeNames; 3] = [&["gas", "sph"], &["dark", "dm", "halo"], &["star", "stars"]];

/// What follows mass, position and velocity in the record of each type, four bytes each.
const TAILS: [&[&str]; 3] =
    [&["rho", "temp", "eps", "metals", "phi"], &["eps", "phi"], &["metals", "tform", "eps", "phi"]];

/// Whether the file begins with counts of gas, dark and star particles that make up their sum, in three dimensions.
pub(crate) fn recognise(head: &[u8]) -> bool {
    order(head).is_some()
}

fn order(head: &[u8]) -> Option<Order> {
    [Order::Big, Order::Little].into_iter().find(|&order| {
        let header = Header::read(Path::new(""), head, order);
        header.is_ok_and(|it| {
            it.all > 0 && it.dimensions == 3 && it.time.is_finite() && it.sum() == u64::from(it.all)
        })
    })
}

struct Header {
    time: f64,
    all: u32,
    dimensions: u32,
    /// Gas, dark, star.
    counts: [u32; 3],
}

impl Header {
    fn read(path: &Path, bytes: &[u8], order: Order) -> Result<Self> {
        let mut cursor = Cursor::new(path, bytes, 0, order, HINT);
        let time = cursor.number("the time")?;
        let mut number = |what| cursor.number(what);
        let [all, dimensions] = [number("the number of particles")?, number("the number of dimensions")?];
        let counts =
            [number("the number of gas")?, number("the number of dark")?, number("the number of stars")?];
        Ok(Self { time, all, dimensions, counts })
    }

    fn sum(&self) -> u64 {
        self.counts.iter().map(|&it| u64::from(it)).sum()
    }
}

/// How the records are laid out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Shape {
    /// Bytes before the first record.
    start: usize,
    position: Kind,
    velocity: Kind,
}

impl Shape {
    /// Bytes of a record of a type.
    fn record(&self, kind: usize) -> usize {
        4 + 3 * self.position.size() + 3 * self.velocity.size() + 4 * TAILS[kind].len()
    }

    /// Bytes of the whole file.
    fn bytes(&self, counts: [u32; 3]) -> u64 {
        let records = (0..3).map(|kind| u64::from(counts[kind]) * self.record(kind) as u64);
        self.start as u64 + records.sum::<u64>()
    }

    /// The shape whose size is the file's. Of none, the usual one: it will say what is missing.
    fn of(bytes: &[u8], counts: [u32; 3]) -> Self {
        let precisions = [(Kind::F32, Kind::F32), (Kind::F64, Kind::F32), (Kind::F64, Kind::F64)];
        let shapes = precisions
            .into_iter()
            .flat_map(|(position, velocity)| [32, 28].map(|start| Self { start, position, velocity }));
        let usual = Self { start: 32, position: Kind::F32, velocity: Kind::F32 };
        // A padded file that lacks its last four bytes has the size of one without padding, but no particle has the padding's mass.
        let is_padded = bytes.get(28..32) == Some(&[0; 4]);
        let is = |it: &Self| it.bytes(counts) == bytes.len() as u64 && (it.start == 32 || !is_padded);
        shapes.into_iter().find(is).unwrap_or(usual)
    }
}

/// Finds the one frame.
pub(crate) fn index(path: &Path, bytes: &[u8], _: &Options) -> Result<Index> {
    let (header, order, shape) = open(path, bytes)?;
    let kind = match order {
        Order::Big => "standard",
        Order::Little => "native, little-endian",
    };
    let double = match (shape.position, shape.velocity) {
        (_, Kind::F64) => ", double precision",
        (Kind::F64, _) => ", double positions",
        _ => "",
    };
    Ok(Index {
        frames: vec![Span { offset: 0, line: 1, bytes: Some(shape.bytes(header.counts)) }],
        title: Some(format!("TIPSY {kind}{double}")),
        ..Index::default()
    })
}

/// The header, and how the rest is to be read. Fails if the file is too short for its particles.
fn open(path: &Path, bytes: &[u8]) -> Result<(Header, Order, Shape)> {
    let order = order(bytes).ok_or_else(|| {
        Error::format(
            path,
            "byte 0",
            "wanted the header of a TIPSY file: a time, then counts that add up",
            HINT,
        )
    })?;
    let header = Header::read(path, bytes, order)?;
    let shape = Shape::of(bytes, header.counts);
    if shape.bytes(header.counts) > bytes.len() as u64 {
        let [gas, dark, star] = header.counts;
        let what = format!(
            "the header promises {gas} gas, {dark} dark and {star} star particles, which need {} bytes; {} are there",
            shape.bytes(header.counts),
            bytes.len()
        );
        return Err(Error::format(path, "", what, HINT));
    }
    Ok((header, order, shape))
}

/// Reads the particles of the wanted types.
pub(crate) fn frame(
    path: &Path,
    bytes: &[u8],
    _: Span,
    request: &Request,
    progress: &dyn Progress,
) -> Result<Frame> {
    progress.begin("read", Some(bytes.len() as u64), "B");
    let (header, order, shape) = open(path, bytes)?;
    let wanted = snapshot::wanted(request.options, &TYPES)?;
    let present: Vec<usize> = (0..3).filter(|&kind| header.counts[kind] > 0).collect();
    let kinds: Vec<usize> = present.iter().copied().filter(|&kind| wanted[kind]).collect();
    if kinds.is_empty() {
        let names: Vec<&str> = present.iter().map(|&kind| TYPES[kind][0]).collect();
        return Err(snapshot::none_wanted(request.options, &names));
    }
    let mut columns = vec![Column::new("mass", 1), Column::new("vel", 3)];
    for name in kinds.iter().flat_map(|&kind| TAILS[kind]) {
        if !columns.iter().any(|it| it.name == *name) {
            columns.push(Column::new(*name, 1));
        }
    }
    let mut start = shape.start;
    let mut sections = Vec::new();
    for kind in 0..3 {
        let count = header.counts[kind] as usize;
        if kinds.contains(&kind) {
            sections.push(section(bytes, order, shape, kind, start, count, &columns));
        }
        start += count * shape.record(kind);
    }
    let mut gathered = sections::gather(path, &columns, &sections, None, bytes.len() as u64, progress)?;
    let runs = kinds.iter().map(|&kind| (TYPES[kind][0], header.counts[kind] as usize));
    gathered.attributes.insert(0, snapshot::type_attribute(runs));
    gathered.time = Some(header.time);

    let mut conventions = vec!["units are not in the file but in the run's .param file".to_string()];
    if kinds.contains(&0) {
        conventions.push(
            "eps of gas is what the file has there: a softening or a smoothing length, by program"
                .to_string(),
        );
    }
    let left = bytes.len() as u64 - shape.bytes(header.counts);
    let warnings =
        (left > 0).then(|| format!("left out: {left} bytes behind the last particle")).into_iter().collect();
    records::frame(gathered, conventions, warnings)
}

/// The `count` particles of a type that begin at byte `start`.
fn section<'a>(
    bytes: &'a [u8],
    order: Order,
    shape: Shape,
    kind: usize,
    start: usize,
    count: usize,
    columns: &[Column],
) -> Section<'a> {
    let stride = shape.record(kind);
    let source = |number: Kind, place: usize| Source {
        bytes,
        kind: number,
        order,
        start: start + place,
        stride,
        step: number.size(),
    };
    let velocity = 4 + 3 * shape.position.size();
    let tail = velocity + 3 * shape.velocity.size();
    let value = |column: &Column| match column.name.as_str() {
        "mass" => Value::Each(source(Kind::F32, 0)),
        "vel" => Value::Each(source(shape.velocity, velocity)),
        name => match TAILS[kind].iter().position(|it| *it == name) {
            Some(place) => Value::Each(source(Kind::F32, tail + 4 * place)),
            None => Value::Missing,
        },
    };
    let positions = source(shape.position, 4);
    Section {
        count,
        axes: [0, 1, 2].map(|axis| positions.component(axis)),
        values: columns.iter().map(value).collect(),
    }
}

#[cfg(test)]
mod tests {
    use tyndall::Values;

    use super::*;
    use crate::read::real_data;

    /// Two gas, one dark and one star particle; every number of a record is its place in the file, from 0 on; the first
    /// one, a mass, is 0.5 in its stead.
    fn sample(shape: Shape, order: Order) -> Vec<u8> {
        write(shape, order, [2, 1, 1])
    }

    fn write(shape: Shape, order: Order, counts: [u32; 3]) -> Vec<u8> {
        let big = order == Order::Big;
        let word = |value: u32| if big { value.to_be_bytes() } else { value.to_le_bytes() };
        let double = |value: f64| if big { value.to_be_bytes() } else { value.to_le_bytes() };
        let mut file = double(0.25).to_vec();
        for number in [counts.iter().sum(), 3].iter().chain(&counts) {
            file.extend(word(*number));
        }
        file.resize(shape.start, 0);
        let mut next = 0.5;
        for (kind, count) in counts.into_iter().enumerate() {
            for _ in 0..count {
                let mut kinds = vec![Kind::F32];
                kinds.extend([shape.position; 3]);
                kinds.extend([shape.velocity; 3]);
                kinds.extend(TAILS[kind].iter().map(|_| Kind::F32));
                for kind in kinds {
                    match kind {
                        Kind::F64 => file.extend(double(next)),
                        _ => file.extend(word((next as f32).to_bits())),
                    }
                    next = f64::floor(next) + 1.0;
                }
            }
        }
        file
    }

    const USUAL: Shape = Shape { start: 32, position: Kind::F32, velocity: Kind::F32 };

    fn read_with(bytes: &[u8], options: &Options) -> Result<Frame> {
        let path = Path::new("test");
        let index = index(path, bytes, options)?;
        let request = Request { options, bytes: None, units: None, topology: None, others: &() };
        frame(path, bytes, index.frames[0], &request, &())
    }

    fn read(bytes: &[u8]) -> Result<Frame> {
        read_with(bytes, &Options::default())
    }

    #[test]
    fn every_shape_is_read_in_either_order() {
        for order in [Order::Big, Order::Little] {
            for start in [28, 32] {
                for (position, velocity) in
                    [(Kind::F32, Kind::F32), (Kind::F64, Kind::F32), (Kind::F64, Kind::F64)]
                {
                    let shape = Shape { start, position, velocity };
                    let bytes = sample(shape, order);
                    assert!(recognise(&bytes), "{shape:?}");
                    let frame = read(&bytes).unwrap();
                    let particles = &frame.particles;
                    let number = |name: &str, id: usize| particles.attribute(name).unwrap().number(id, 0);
                    // Records have 12, 12, 9 and 11 numbers.
                    assert_eq!(particles.positions().world(2).to_array(), [25.0, 26.0, 27.0], "{shape:?}");
                    assert_eq!([0, 1, 2, 3].map(|id| number("mass", id)), [0.5, 12.0, 24.0, 33.0]);
                    assert_eq!([0, 1, 2, 3].map(|id| number("eps", id)), [9.0, 21.0, 31.0, 42.0]);
                    assert_eq!([0, 1, 2, 3].map(|id| number("phi", id)), [11.0, 23.0, 32.0, 43.0]);
                    assert_eq!(particles.attribute("vel").unwrap().number(3, 2), 39.0);
                    assert!(number("tform", 0).is_nan() && number("tform", 3) == 41.0);
                    assert!(number("rho", 3).is_nan() && number("rho", 1) == 19.0);
                    let names = ["gas", "dark", "star"].map(String::from).to_vec();
                    let types = Values::Text { codes: vec![0, 0, 1, 2], names };
                    assert_eq!(particles.attribute("type").unwrap().values, types);
                    assert_eq!((particles.time(), frame.warnings.len()), (Some(0.25), 0));
                }
            }
        }
    }

    #[test]
    fn wanted_types_alone_are_read() {
        let types = |word: &str| Options { types: Some(vec![word.into()]), ..Options::default() };
        let bytes = sample(USUAL, Order::Big);
        let stars = read_with(&bytes, &types("star")).unwrap().particles;
        assert_eq!((stars.len(), stars.positions().world(0).x), (1, 34.0));
        assert!(stars.attribute("rho").is_none() && stars.attribute("tform").is_some());
        assert_eq!(read_with(&bytes, &types("0")).unwrap().particles.len(), 2);
        let only_dark = write(USUAL, Order::Big, [0, 1, 0]);
        let message = read_with(&only_dark, &types("gas")).unwrap_err().to_string();
        assert!(message.contains("has particles here: dark"), "{message}");
    }

    #[test]
    fn a_size_that_does_not_fit_is_said() {
        let mut bytes = sample(USUAL, Order::Little);
        for length in 28..bytes.len() {
            let cut = &bytes[..length];
            let short = read(cut).is_err();
            assert!(short, "{length} bytes");
        }
        let message = read(&bytes[..60]).unwrap_err().to_string();
        assert!(
            message.contains("2 gas, 1 dark and 1 star") && message.contains("60 are there"),
            "{message}"
        );
        bytes.extend([0; 5]);
        assert!(read(&bytes).unwrap().warnings[0].contains("5 bytes"));
    }

    #[test]
    fn hostile_counts_and_damage_never_panic() {
        let bytes = sample(USUAL, Order::Big);
        for place in (8..28).step_by(4) {
            let mut hostile = bytes.clone();
            hostile[place..][..4].fill(0xff);
            assert!(read(&hostile).is_err(), "{place}");
        }
        real_data::damage(&bytes, |file| drop(read(file)));
    }
}
