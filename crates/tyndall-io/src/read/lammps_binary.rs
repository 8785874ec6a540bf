//! LAMMPS binary dumps: what `dump … FILE.bin` writes, `atom` or `custom`, frame after frame.
//!
//! A header like that of a text dump, then the values of all atoms as doubles, in a chunk for every processor. Frames of later
//! versions begin with the length of their name, negated, and that name, the order of their bytes and a revision; from revision 2 on
//! they name their columns. Frames of earlier versions begin with the step: they are known by a box and counts that make sense, in
//! one order of bytes or the other. Steps and counts of 8 bytes are read, as all builds but "smallsmall" write them.
//! Columns and coordinates are understood as in text. Source: LAMMPS, tools/binary2txt.cpp and dump_custom.cpp.

use std::path::Path;

use tyndall::particles::{Attribute, Values};
use tyndall::{Cell, DVec3, Error, Progress, Result};

use super::content::{self, Content};
use super::cursor::Cursor;
use super::lammps::{self, Axes, Common, MEASURED};
use super::map;
use super::numbers::{Kind, Order};
use super::records::{self, Field, Layout, Source};
use super::sections::{self, Column};
use super::{Index, Request, Span};
use crate::sequence::{Frame, Options};

const HINT: &str = "if it is not cut off, turn it into text with the binary2txt of the LAMMPS that wrote it";
/// More columns or chunks than these are a mistake, or an attack.
const MOST_COLUMNS: i32 = 1 << 16;
const MOST_CHUNKS: i32 = 1 << 24;

/// Whether the file begins like a binary dump.
pub(crate) fn recognise(head: &[u8]) -> bool {
    [Order::Little, Order::Big].iter().any(|&order| {
        let cursor = &mut Cursor::new(Path::new(""), head, 0, order, HINT);
        begins(cursor)
    })
}

/// Whether a header begins here, in this order of bytes.
fn begins(cursor: &mut Cursor) -> bool {
    let named = head_name(cursor).is_ok_and(|it| it.is_some());
    // Without a name, all that stands before the atoms has to make sense.
    named || Header::read(cursor).is_ok_and(|it| it.is_plausible())
}

/// The name that headers of later versions begin with: passed over if it is there.
fn head_name(cursor: &mut Cursor) -> Result<Option<String>> {
    let start = cursor.clone();
    let length: i64 = cursor.number("the length of the name")?;
    if !(-64..0).contains(&length) {
        *cursor = start;
        return Ok(None);
    }
    let name = cursor.text(length.unsigned_abs() as usize, "the name")?;
    if !name.starts_with("DUMP") {
        return Err(cursor.fault(format!("the name of a dump was wanted, '{name}' was found")));
    }
    Ok(Some(name))
}

/// What stands before the atoms.
struct Header {
    step: i64,
    count: i64,
    cell: Cell,
    columns: Vec<String>,
    /// Values an atom.
    size: i32,
    units: Option<String>,
    time: Option<f64>,
    chunks: i32,
}

impl Header {
    fn read(cursor: &mut Cursor) -> Result<Self> {
        let name = head_name(cursor)?;
        let mut revision = 0;
        if name.is_some() {
            let _order: i32 = cursor.number("the order of bytes")?;
            revision = cursor.number("the revision")?;
        }
        let step: i64 = cursor.number("the step")?;
        let count: i64 = cursor.number("the number of atoms")?;
        let tilted: i32 = cursor.number("whether the box is tilted")?;
        let mut periodic = [false; 3];
        for flag in &mut periodic {
            let [low, high]: [i32; 2] = numbers(cursor, "a boundary")?;
            if !(0..4).contains(&low) || !(0..4).contains(&high) {
                return Err(cursor.fault(format!("boundaries are 0 to 3, {low} and {high} were found")));
            }
            *flag = low == 0;
        }
        let cell = cell(cursor, tilted, periodic)?;
        let size: i32 = cursor.number("the values of an atom")?;
        let mut header =
            Self { step, count, cell, columns: vec![], size, units: None, time: None, chunks: 0 };
        if revision > 1 {
            header.units = Some(text(cursor, "the units")?).filter(|it| !it.is_empty());
            if cursor.number::<u8>("whether there is a time")? != 0 {
                header.time = Some(cursor.number("the time")?);
            }
            header.columns =
                text(cursor, "the names of the columns")?.split_whitespace().map(str::to_string).collect();
        } else if name.as_deref() == Some("DUMPATOM") && (size == 5 || size == 8) {
            let names = ["id", "type", "xs", "ys", "zs", "ix", "iy", "iz"];
            header.columns = names[..size as usize].iter().map(|it| it.to_string()).collect();
        }
        header.chunks = cursor.number("the number of chunks")?;
        if count < 0 || !(1..MOST_COLUMNS).contains(&size) || !(0..MOST_CHUNKS).contains(&header.chunks) {
            let what = format!("{count} atoms of {size} values in {} chunks make no sense", header.chunks);
            return Err(cursor.fault(what));
        }
        Ok(header)
    }

    /// Whether this may be the header of a file that does not say what it is.
    fn is_plausible(&self) -> bool {
        let edges = self.cell.vectors.map(|it| it.length());
        let box_makes_sense = edges.iter().all(|edge| (1e-100..1e100).contains(edge))
            && self.cell.origin.abs().max_element() < 1e100;
        // What has three coordinates has at least three values; zeros everywhere are no dump.
        box_makes_sense && self.step >= 0 && self.size >= 3 && self.chunks >= 1
    }

    /// The chunks that follow at `cursor`: the place of each, and how many values it has.
    fn chunks(&self, cursor: &mut Cursor) -> Result<Vec<(usize, usize)>> {
        let mut chunks = Vec::new();
        let mut values = 0;
        for _ in 0..self.chunks {
            let size: i32 = cursor.number("the size of a chunk")?;
            if size < 0 || size % self.size != 0 {
                let what = format!("a chunk of {size} values has no whole number of atoms of {}", self.size);
                return Err(cursor.fault(what));
            }
            // Processors without atoms write empty chunks.
            if size > 0 {
                chunks.push((cursor.place(), size as usize / self.size as usize));
            }
            cursor.skip(8 * size as u64, "a chunk")?;
            values += i64::from(size);
        }
        if Some(values) != self.count.checked_mul(self.size.into()) {
            let what = format!(
                "{} atoms of {} values were wanted, {values} values are there",
                self.count, self.size
            );
            return Err(cursor.fault(what));
        }
        Ok(chunks)
    }
}

fn numbers<T: super::numbers::Number + Default, const N: usize>(
    cursor: &mut Cursor,
    what: &str,
) -> Result<[T; N]> {
    let mut numbers = [T::default(); N];
    for number in &mut numbers {
        *number = cursor.number(what)?;
    }
    Ok(numbers)
}

/// A word behind its length.
fn text(cursor: &mut Cursor, what: &str) -> Result<String> {
    let length: i32 = cursor.number(what)?;
    cursor.text(usize::try_from(length).map_err(|_| cursor.fault(format!("{what}: length {length}")))?, what)
}

/// The box: bounds, bounding box and tilts, or three edges and a corner.
fn cell(cursor: &mut Cursor, tilted: i32, periodic: [bool; 3]) -> Result<Cell> {
    let cell = match tilted {
        0 | 1 => {
            let bounds = [(); 3].map(|()| numbers(cursor, "the bounds of the box"));
            let [x, y, z] = bounds;
            let tilts = if tilted == 1 { numbers(cursor, "the tilts of the box")? } else { [0.0; 3] };
            lammps::bounded_cell([x?, y?, z?], tilts, periodic)
        }
        2 => {
            let [a, b, c, origin] = [(); 4].map(|()| numbers(cursor, "the edges of the box"));
            Cell {
                origin: DVec3::from_array(origin?),
                vectors: [a?, b?, c?].map(DVec3::from_array),
                periodic,
            }
        }
        _ => {
            return Err(
                cursor.fault(format!("a box is straight (0), tilted (1) or general (2), not {tilted}"))
            );
        }
    };
    let is_finite = cell.vectors.iter().chain([&cell.origin]).all(|it| it.is_finite());
    if is_finite { Ok(cell) } else { Err(cursor.fault("the box is not finite")) }
}

/// A cursor at `place`, in the order of bytes of the file.
fn cursor<'a>(path: &'a Path, bytes: &'a [u8], place: usize) -> Cursor<'a> {
    let at = |place, order| Cursor::new(path, bytes, place, order, HINT);
    let order = if begins(&mut at(0, Order::Big)) { Order::Big } else { Order::Little };
    at(place, order)
}

/// Finds the frames.
pub(crate) fn index(path: &Path, bytes: &[u8], _: &Options) -> Result<Index> {
    let mut index = Index::default();
    let mut cursor = cursor(path, bytes, 0);
    while cursor.left() > 0 {
        let offset = cursor.place();
        let header = Header::read(&mut cursor).and_then(|it| it.chunks(&mut cursor).map(|_| it));
        match header {
            Ok(header) => index.units = index.units.or(header.units),
            Err(_) if cursor.ended() => {
                index.cut = true;
                break;
            }
            Err(error) => return Err(error),
        }
        let bytes = Some((cursor.place() - offset) as u64);
        index.frames.push(Span { offset: offset as u64, line: index.frames.len() as u64 + 1, bytes });
    }
    Ok(index)
}

/// What a file has of a frame.
struct Piece<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    order: Order,
    header: Header,
    /// The place of each chunk, and how many atoms it has.
    chunks: Vec<(usize, usize)>,
}

impl<'a> Piece<'a> {
    fn read(path: &'a Path, bytes: &'a [u8], span: Span) -> Result<Self> {
        let mut cursor = cursor(path, bytes, span.offset as usize);
        let header = Header::read(&mut cursor)?;
        let chunks = header.chunks(&mut cursor)?;
        Ok(Self { path, bytes, order: cursor.order, header, chunks })
    }

    fn common(&self) -> Common<'_> {
        let Header { step, columns, size, cell, .. } = &self.header;
        Common { step: Some(*step as f64), columns, size: *size as usize, cell: Some(cell) }
    }

    /// Where the values of its atoms stand, chunk by chunk: coordinates, and other columns with their names.
    fn layouts(&self, axes: Axes, others: &[(usize, &str)]) -> impl Iterator<Item = Layout<'a>> {
        let stride = 8 * self.header.size as usize;
        self.chunks.iter().map(move |&(place, count)| {
            let source = |column: usize| Source {
                bytes: self.bytes,
                kind: Kind::F64,
                order: self.order,
                start: place + 8 * column,
                stride,
                step: 8,
            };
            let field = |&(column, name): &(usize, &str)| Field {
                name: name.into(),
                components: 1,
                source: source(column),
            };
            Layout {
                count,
                axes: axes.map(|axis| axis.map(source)),
                fields: others.iter().map(field).collect(),
            }
        })
    }
}

/// Reads the frame at `span`, from all files over which it is spread.
pub(crate) fn frame(
    path: &Path,
    bytes: &[u8],
    span: Span,
    request: &Request,
    progress: &dyn Progress,
) -> Result<Frame> {
    let total = request.bytes_of_all();
    progress.begin("read", total, "B");
    let places = request.others.places();
    let contents: Vec<Content> =
        places.iter().map(|(path, _)| content::content(path)).collect::<Result<_>>()?;
    let progress = &map::released(contents.iter().filter_map(Content::map), progress);
    let mut pieces = vec![Piece::read(path, bytes, span)?];
    for ((path, span), content) in places.iter().zip(&contents) {
        let piece = Piece::read(path, content.as_ref(), *span)?;
        piece.common().check(path, pieces[0].common(), pieces[0].path)?;
        pieces.push(piece);
    }

    let header = &pieces[0].header;
    let names = request.options.columns.as_ref().unwrap_or(&header.columns);
    let size = header.size as usize;
    let wrong = |what: String, hint: &str| Error::format(path, format!("frame {}", span.line), what, hint);
    if names.is_empty() {
        let what = format!("this dump does not name its {size} columns");
        return Err(wrong(what, "name them in order, as the dump command does: --columns id,type,x,y,z"));
    }
    if names.len() != size {
        let what = format!("{} columns are named, an atom has {size}: {}", names.len(), names.join(" "));
        return Err(wrong(what, "name all columns, in order"));
    }
    let (axes, scaled) = lammps::coordinates(names).ok_or_else(|| {
        let what = format!("no coordinates among the columns: {}", names.join(" "));
        wrong(what, "dump x y z, xu yu zu, xs ys zs or xsu ysu zsu")
    })?;
    let scaled = scaled || request.options.scaled;

    let others: Vec<(usize, &str)> = (0..size)
        .filter(|column| !axes.contains(&Some(*column)))
        .map(|column| (column, names[column].as_str()))
        .collect();
    let offered: Vec<Column> = others.iter().map(|(_, name)| Column::new(*name, 1)).collect();
    let others = sections::flagged(others, &sections::flags(&offered, request.options.wanted.as_ref()));
    let layouts: Vec<Layout> = pieces.iter().flat_map(|it| it.layouts(axes, &others)).collect();
    let total = total.unwrap_or_default() as usize;
    let mut columns = match layouts.is_empty() {
        true => Default::default(),
        false => records::join(path, &layouts, total, progress)?.into_columns(),
    };
    if scaled {
        // Fractions in doubles, before anything is rounded.
        let first: Vec<usize> = layouts
            .iter()
            .scan(0, |before, layout| Some(std::mem::replace(before, *before + layout.count)))
            .collect();
        let position = |id: usize| {
            let chunk = first.partition_point(|&first| first <= id) - 1;
            let fraction = layouts[chunk].axes.map(|it| it.map_or(0.0, |it| it.number(id - first[chunk])));
            header.cell.origin + (0..3).map(|axis| fraction[axis] * header.cell.vectors[axis]).sum::<DVec3>()
        };
        let count = layouts.iter().map(|it| it.count).sum();
        columns.positions = records::positions(count, Some(header.cell.center()), position);
    }
    columns.attributes.iter_mut().for_each(narrow);
    columns.cell = Some(header.cell);
    columns.time = header.time.or(Some(header.step as f64));
    let units = header.units.as_deref().or(request.units);
    lammps::tell_units(&mut columns, header.time.is_some(), units);
    let conventions = lammps::conventions(names, axes, Some(&header.cell), scaled);
    let mut frame = records::frame(columns, conventions, vec![])?;
    frame.warnings.extend(lammps::looks_scaled(&frame.particles, names, axes).filter(|_| !scaled));
    Ok(frame)
}

/// Makes of doubles what they would be in a text dump: integers where all are, else 32-bit floats.
fn narrow(attribute: &mut Attribute) {
    let Values::F64(values) = &attribute.values else { return };
    let whole = |most: f64| values.iter().all(|it| it.fract() == 0.0 && it.abs() <= most);
    let is_measured = MEASURED.contains(&attribute.name.as_str());
    attribute.values = match values {
        values if is_measured => Values::F32(values.iter().map(|&it| it as f32).collect()),
        values if whole(f64::from(i32::MAX)) => Values::I32(values.iter().map(|&it| it as i32).collect()),
        values if whole((1u64 << 53) as f64) => Values::I64(values.iter().map(|&it| it as i64).collect()),
        values => Values::F32(values.iter().map(|&it| it as f32).collect()),
    };
}

#[cfg(test)]
mod tests;
