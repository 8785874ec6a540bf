//! GROMACS TRR: positions, and maybe velocities and forces, in single or double precision, frame after frame.
//!
//! Numbers are big-endian. A header has the size in bytes of each part that follows; precision is that of the parts. Frames
//! without positions are passed over, which the title tells. Lengths are nm. Source: GROMACS, trrio.cpp.

use std::path::Path;

use tyndall::{DVec3, Progress, Result};

use super::cursor::Cursor;
use super::numbers::{Kind, Order};
use super::records::{self, Field, Layout, Source};
use super::{Index, Request, Span, molecules};
use crate::sequence::{Frame, Options};

const HINT: &str = "check it with gmx check, and copy or write it again";
/// The number that every frame begins with, and the name that follows.
const MAGIC: u32 = 1993;
const NAME: &[u8] = b"GMX_trn_file";

/// Whether the file begins like TRR.
pub(crate) fn recognise(head: &[u8]) -> bool {
    head.starts_with(&MAGIC.to_be_bytes()) && head.get(12..24).is_none_or(|it| it == NAME)
}

fn cursor<'a>(path: &'a Path, bytes: &'a [u8], place: usize) -> Cursor<'a> {
    Cursor::new(path, bytes, place, Order::Big, HINT)
}

/// What stands before the parts of a frame.
struct Header {
    count: usize,
    kind: Kind,
    box_bytes: u64,
    /// Of virial, pressure and two parts that nobody writes any more, which stand before the positions.
    other_bytes: u64,
    position_bytes: u64,
    velocity_bytes: u64,
    force_bytes: u64,
    time: f64,
}

impl Header {
    fn read(cursor: &mut Cursor) -> Result<Self> {
        let magic: u32 = cursor.number("the magic number")?;
        let _length: u32 = cursor.number("the length of the name")?;
        let length: u32 = cursor.number("the length of the name")?;
        if magic != MAGIC || length as usize != NAME.len() || cursor.take(NAME.len(), "the name")? != NAME {
            return Err(
                cursor.fault("the magic number 1993 of a frame and its name GMX_trn_file were wanted")
            );
        }
        let mut sizes = [0u32; 10];
        for size in &mut sizes {
            *size = cursor.number("the size of a part")?;
        }
        let [input, energy, lattice, virial, pressure, topology, symbols, positions, velocities, forces] =
            sizes.map(u64::from);
        let count: u32 = cursor.number("the number of atoms")?;
        cursor.skip(8, "the step")?; // And how many energies there are.
        let values = 3 * u64::from(count);
        let double = [(lattice, 9), (positions, values), (velocities, values), (forces, values)]
            .iter()
            .find(|(bytes, values)| *bytes > 0 && *values > 0)
            .is_some_and(|(bytes, values)| bytes / values == 8);
        let kind = if double { Kind::F64 } else { Kind::F32 };
        for (bytes, values, what) in [
            (lattice, 9, "the box"),
            (positions, values, "positions"),
            (velocities, values, "velocities"),
            (forces, values, "forces"),
        ] {
            if bytes != 0 && bytes != values * kind.size() as u64 {
                return Err(cursor.fault(format!("{count} atoms do not have {bytes} bytes of {what}")));
            }
        }
        let mut real = |what: &str| match double {
            true => cursor.number::<f64>(what),
            false => cursor.number::<f32>(what).map(f64::from),
        };
        let [time, _lambda] = [real("the time")?, real("lambda")?];
        Ok(Self {
            count: count as usize,
            kind,
            box_bytes: lattice,
            other_bytes: input + energy + virial + pressure + topology + symbols,
            position_bytes: positions,
            velocity_bytes: velocities,
            force_bytes: forces,
            time,
        })
    }

    fn body_bytes(&self) -> u64 {
        self.box_bytes + self.other_bytes + self.position_bytes + self.velocity_bytes + self.force_bytes
    }

    /// Whether this is a frame of positions. One of no atoms is.
    fn has_positions(&self) -> bool {
        self.position_bytes > 0 || self.count == 0
    }
}

/// Finds the frames that have positions.
pub(crate) fn index(path: &Path, bytes: &[u8], _: &Options) -> Result<Index> {
    let mut index = Index::default();
    let (mut cursor, mut others) = (cursor(path, bytes, 0), 0);
    while cursor.left() > 0 {
        let offset = cursor.place();
        let header =
            Header::read(&mut cursor).and_then(|it| cursor.skip(it.body_bytes(), "a frame").map(|()| it));
        match header {
            Err(_) if cursor.ended() => {
                index.cut = true;
                break;
            }
            Err(error) => return Err(error),
            Ok(header) if !header.has_positions() => others += 1,
            Ok(_) => {
                let (place, bytes) = (offset as u64, Some((cursor.place() - offset) as u64));
                index.frames.push(Span { offset: place, line: index.frames.len() as u64 + 1, bytes });
            }
        }
    }
    if others > 0 {
        index.title = Some(format!("GROMACS TRR ({others} frames without positions left out)"));
    }
    if index.frames.is_empty() && others > 0 {
        return Err(
            cursor.fault(format!("none of the {others} frames has positions: set nstxout when simulating"))
        );
    }
    Ok(index)
}

/// Reads the frame at `span`.
pub(crate) fn frame(
    path: &Path,
    bytes: &[u8],
    span: Span,
    request: &Request,
    progress: &dyn Progress,
) -> Result<Frame> {
    progress.begin("read", span.bytes, "B");
    let mut cursor = cursor(path, bytes, span.offset as usize);
    let header = Header::read(&mut cursor)?;
    let mut cell = None;
    if header.box_bytes > 0 {
        let source = part(bytes, &header, cursor.place());
        cursor.skip(header.box_bytes, "the box")?;
        let edge = |edge: usize| DVec3::from_array([0, 1, 2].map(|axis| source.component(axis).number(edge)));
        cell = molecules::cell([edge(0), edge(1), edge(2)]);
    }
    cursor.skip(header.other_bytes, "a part before the positions")?;
    let positions = part(bytes, &header, cursor.place());
    cursor.skip(header.position_bytes, "the positions")?;
    let velocities = cursor.place();
    cursor.skip(header.velocity_bytes, "the velocities")?;
    let forces = cursor.place();
    let field = |name: &str, place: usize, part_bytes: u64| {
        let field = Field { name: name.into(), components: 3, source: part(bytes, &header, place) };
        (part_bytes > 0).then_some(field)
    };
    let fields =
        [field("velocity", velocities, header.velocity_bytes), field("force", forces, header.force_bytes)];
    let axes = [0, 1, 2].map(|axis| Some(positions.component(axis)));
    let layout = Layout { count: header.count, axes, fields: fields.into_iter().flatten().collect() };
    let total = span.bytes.unwrap_or_default() as usize;
    let mut columns = layout.gather(path, total, progress)?.into_columns();
    for attribute in &mut columns.attributes {
        let unit = if attribute.name == "force" { "kJ/(mol nm)" } else { "nm/ps" };
        attribute.unit = Some(unit.to_string());
    }
    columns.cell = cell;
    columns.time = Some(header.time);
    columns.time_unit = Some("ps".to_string());
    columns.length_unit = Some("nm".to_string());
    let mut conventions = vec!["lengths: nm (TRR convention)".to_string()];
    request.complete(&mut columns, path, span, &mut conventions)?;
    records::frame(columns, conventions, vec![])
}

/// Vectors one behind the other.
fn part<'a>(bytes: &'a [u8], header: &Header, start: usize) -> Source<'a> {
    let step = header.kind.size();
    Source { bytes, kind: header.kind, order: Order::Big, start, stride: 3 * step, step }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::real_data;
    use tyndall::Values;

    /// A frame whose numbers tell atom and axis; `parts` are those of positions, velocities, forces.
    fn sample(count: u32, double: bool, parts: [bool; 3], virial: bool) -> Vec<u8> {
        let size = if double { 8 } else { 4 };
        let mut file = Vec::new();
        let put = |file: &mut Vec<u8>, number: f64| match double {
            true => file.extend(number.to_be_bytes()),
            false => file.extend((number as f32).to_be_bytes()),
        };
        for number in [MAGIC, 13, 12] {
            file.extend(number.to_be_bytes());
        }
        file.extend(NAME);
        let of = |there: bool, values: u32| if there { values * size } else { 0 };
        let [x, v, f] = parts.map(|it| of(it, 3 * count));
        for number in [0, 0, 9 * size, of(virial, 9), 0, 0, 0, x, v, f, count, 7, 0] {
            file.extend(number.to_be_bytes());
        }
        put(&mut file, 2.5);
        put(&mut file, 0.0);
        for number in [2.0, 0.0, 0.0, 0.5, 3.0, 0.0, 0.0, 0.25, 4.0] {
            put(&mut file, number);
        }
        (0..if virial { 9 } else { 0 }).for_each(|_| put(&mut file, 99.0));
        for (part, _) in parts.iter().enumerate().filter(|(_, there)| **there) {
            for value in 0..3 * count {
                put(&mut file, f64::from(value) + 100.0 * part as f64 + 0.125);
            }
        }
        file
    }

    #[test]
    fn both_precisions_and_all_parts_are_read() {
        for double in [false, true] {
            let file = [
                sample(2, double, [true, true, true], true),
                sample(2, double, [false, true, false], false),
                sample(1, double, [true, false, false], false),
                sample(0, double, [true, false, false], false),
            ]
            .concat();
            let frames = real_data::open(&file).unwrap();
            assert_eq!(frames.iter().map(|it| it.particles.len()).collect::<Vec<_>>(), [2, 1, 0]);
            let particles = &frames[0].particles;
            assert_eq!(particles.positions().world(1), DVec3::new(3.125, 4.125, 5.125));
            assert_eq!(particles.attribute("velocity").unwrap().number(1, 2), 105.125);
            assert_eq!(particles.attribute("force").unwrap().number(0, 0), 200.125);
            assert_eq!(matches!(particles.attributes()[0].values, Values::F64(_)), double);
            assert_eq!(particles.cell().unwrap().vectors[1], DVec3::new(0.5, 3.0, 0.0));
            assert_eq!((particles.time(), particles.length_unit()), (Some(2.5), Some("nm")));
            assert!(frames[1].particles.attributes().is_empty());
        }
        let message =
            real_data::open(&sample(2, false, [false, true, false], false)).unwrap_err().to_string();
        assert!(message.contains("none of the 1 frames has positions"), "{message}");
    }

    #[test]
    fn what_is_cut_or_contradicts_itself_is_noticed() {
        let whole = sample(2, false, [true, true, false], false);
        let file = whole.repeat(2);
        for length in whole.len() + 1..file.len() {
            let index = index(Path::new("test"), &file[..length], &Options::default()).unwrap();
            assert_eq!((index.frames.len(), index.cut), (1, true), "{length}");
        }
        let mut huge = whole.clone();
        huge[64..68].fill(0xff);
        let message = real_data::open(&huge).unwrap_err().to_string();
        assert!(message.contains("4294967295 atoms do not have"), "{message}");
        let open = &real_data::recognised(&whole).open;
        real_data::damage(&file, |file| drop(real_data::frames(open, file, &Options::default())));
    }
}
