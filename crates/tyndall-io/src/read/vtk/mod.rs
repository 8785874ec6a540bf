//! VTK: legacy files, XML files, and files that name the pieces or the time steps of a data set.
//!
//! Takes the content, gives the points of PolyData, unstructured and structured grids with the arrays that belong to points. Whether
//! points have vertices does not matter; lines, polygons and other cells are left out, said. Each array is decoded by itself, so that
//! a copy of one of them at most stands beside the columns.

mod data;
mod image;
mod legacy;
mod list;
#[cfg(test)]
mod tests;
mod words;
mod xml;

use std::borrow::Cow;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

use tyndall::particles::{Attribute, Columns, Positions, Values};
use tyndall::{Error, Progress, Result};

use self::data::Array;
#[cfg(feature = "hdf5")]
pub(super) use self::data::parse as numbers;
pub(crate) use self::image::image;
use self::list::Step;
#[cfg(feature = "hdf5")]
pub(super) use self::list::beside;
use self::words::WordArray;
use self::xml::Document;
#[cfg(feature = "hdf5")]
pub(super) use self::xml::{Node, elements};
use super::map::Map;
use super::numbers::Order;
use super::records::{self, Field, Layout, Source};
use super::{Index, Packing, Request, Span, lattice};
use crate::sequence::{Frame, Options};

/// Bits of `vtkGhostType`: the point is a copy of another piece's, or hidden.
const GHOST: u8 = 3;

/// Whether the file begins like one of VTK's, or like a list of such files.
pub(crate) fn recognise(head: &[u8]) -> bool {
    legacy::recognise(head) || is_xml(head) || list::recognise_series(head)
}

fn is_xml(head: &[u8]) -> bool {
    let start = head.trim_ascii_start();
    start.starts_with(b"<") && memchr::memmem::find(&head[..head.len().min(4096)], b"<VTKFile").is_some()
}

/// A data set, or some pieces of one.
#[derive(Debug, Default)]
struct Set<'a> {
    pieces: Vec<Piece<'a>>,
    time: Option<f64>,
    /// Arrays of cells, and arrays of points that hold no numbers.
    cell_arrays: Vec<String>,
    odd_arrays: Vec<String>,
    /// Cells that are no points.
    other_cells: usize,
    warnings: Vec<String>,
}

/// Points that stand together.
#[derive(Debug)]
struct Piece<'a> {
    path: &'a Path,
    count: usize,
    points: Array<'a>,
    attributes: Vec<Array<'a>>,
    words: Vec<WordArray<'a>>,
}

impl Set<'_> {
    /// Takes over the time, if it is in this array of the whole.
    fn note_time(&mut self, path: &Path, array: &Array, count: usize) -> Result<()> {
        let is_time = ["TimeValue", "TIME"].iter().any(|it| array.name.eq_ignore_ascii_case(it));
        if is_time && array.components == 1 && count == 1 {
            let (bytes, order) = array.decode(path, 1)?;
            self.time = Some(source(array, &bytes, order).number(0));
        }
        Ok(())
    }

    /// Counts the cells that are no points, by their types.
    fn note_cell_types(&mut self, path: &Path, count: usize, types: &Array) -> Result<()> {
        let (bytes, order) = types.decode(path, count)?;
        let source = source(types, &bytes, order);
        // Nothing, a vertex, several vertices.
        self.other_cells += (0..count).filter(|&cell| source.number(cell) > 2.0).count();
        Ok(())
    }

    /// What is not shown.
    fn left_out(&self) -> Vec<String> {
        let mut lines = self.warnings.clone();
        let list = |names: &[String]| {
            let mut seen = HashSet::new();
            names.iter().filter(|it| seen.insert(it.as_str())).cloned().collect::<Vec<_>>().join(", ")
        };
        if self.other_cells > 0 {
            lines.push(format!(
                "left out: {} lines, polygons or other cells; all points are particles",
                self.other_cells
            ));
        }
        if !self.cell_arrays.is_empty() {
            lines.push(format!("left out: arrays of cells, not of points: {}", list(&self.cell_arrays)));
        }
        if !self.odd_arrays.is_empty() {
            lines.push(format!("left out: arrays of words or bits: {}", list(&self.odd_arrays)));
        }
        lines
    }
}

/// What a file is.
enum Outline<'a> {
    Legacy(legacy::Header),
    /// Points in XML.
    Points(Document<'a>),
    Pieces(Document<'a>, Vec<PathBuf>),
    /// The list's name, and what it holds.
    Steps(&'static str, Vec<Step>),
}

impl<'a> Outline<'a> {
    fn of(path: &'a Path, bytes: &'a [u8]) -> Result<Self> {
        if legacy::recognise(bytes) {
            let header = legacy::Header::read(path, bytes)?;
            header.check(path)?;
            return Ok(Self::Legacy(header));
        }
        if list::recognise_series(bytes) {
            return Ok(Self::Steps("ParaView file series", list::series(path, bytes)?));
        }
        let document = Document::read(path, bytes)?;
        if let Some(files) = list::pieces(path, &document)? {
            return Ok(Self::Pieces(document, files));
        }
        match document.kind.as_str() {
            "PolyData" | "UnstructuredGrid" | "StructuredGrid" => Ok(Self::Points(document)),
            "Collection" => Ok(Self::Steps("ParaView collection", list::collection(path, &document)?)),
            "ImageData" | "RectilinearGrid" | "PImageData" | "PRectilinearGrid" | "HyperTreeGrid" => {
                Err(lattice::no_particles(path, &document.kind))
            }
            other => {
                let what = format!("a data set with points was wanted, the file's type is '{other}'");
                Err(Error::format(path, "VTKFile", what, "save the points in ParaView as .vtp"))
            }
        }
    }
}

/// Finds the frames: one, or those of a list.
pub(crate) fn index(path: &Path, bytes: &[u8], _: &Options) -> Result<Index> {
    let (title, count) = match Outline::of(path, bytes)? {
        Outline::Legacy(header) => (header.title(), 1),
        Outline::Points(document) => (document.title(), 1),
        Outline::Pieces(document, files) => (format!("{} of {} pieces", document.title(), files.len()), 1),
        Outline::Steps(name, steps) => (name.to_string(), steps.len()),
    };
    let span = |number: usize| Span { offset: 0, line: number as u64, bytes: None };
    Ok(Index { frames: (1..=count).map(span).collect(), title: Some(title), ..Index::default() })
}

/// Reads the points of a frame.
pub(crate) fn frame(
    path: &Path,
    bytes: &[u8],
    span: Span,
    _: &Request,
    progress: &dyn Progress,
) -> Result<Frame> {
    let (files, time) = match Outline::of(path, bytes)? {
        Outline::Legacy(_) => return assemble(path, legacy::read(path, bytes)?, progress),
        Outline::Points(document) => return assemble(path, document.set()?, progress),
        Outline::Pieces(_, files) => (files, None),
        Outline::Steps(_, mut steps) => {
            let step = steps.get_mut(span.line as usize - 1);
            let step = step.ok_or_else(|| changed(path))?;
            (std::mem::take(&mut step.files), step.time)
        }
    };
    let mut contents = Vec::new();
    for file in files {
        Loaded::add(file, 0, &mut contents, progress)?;
    }
    let mut all = Set::default();
    for Loaded { path, content } in &contents {
        let set = match Outline::of(path, content.bytes())? {
            Outline::Legacy(_) => legacy::read(path, content.bytes())?,
            Outline::Points(document) => document.set()?,
            Outline::Pieces(..) | Outline::Steps(..) => return Err(changed(path)),
        };
        all.time = all.time.or(set.time);
        all.pieces.extend(set.pieces);
        all.cell_arrays.extend(set.cell_arrays);
        all.odd_arrays.extend(set.odd_arrays);
        all.other_cells = all.other_cells.saturating_add(set.other_cells);
        all.warnings.extend(set.warnings);
    }
    all.time = time.or(all.time);
    assemble(path, all, progress)
}

fn changed(path: &Path) -> Error {
    Error::format(path, "", "the file is not what it was when it was opened", "read it again")
}

/// A file that another one names.
struct Loaded {
    path: PathBuf,
    content: Content,
}

enum Content {
    Mapped(Map),
    Unpacked(Vec<u8>),
}

impl Content {
    fn bytes(&self) -> &[u8] {
        match self {
            Self::Mapped(map) => map,
            Self::Unpacked(bytes) => bytes,
        }
    }
}

impl Loaded {
    /// Adds the file at `path`, or the files of its pieces; `depth` counts lists within each other.
    fn add(path: PathBuf, depth: usize, to: &mut Vec<Self>, progress: &dyn Progress) -> Result<()> {
        if progress.cancelled() {
            return Err(Error::Interrupted);
        }
        let (head, packing) = super::head(&path)?;
        if !recognise(&head) {
            let what = "a list of VTK files names it, but it is none";
            return Err(Error::format(&path, "", what, "give the files themselves, for example with a glob"));
        }
        let content = match packing {
            Packing::Plain => Content::Mapped(super::map(&path)?),
            _ => Content::Unpacked(super::unpack(&path, packing, progress)?),
        };
        let files = match Outline::of(&path, content.bytes())? {
            Outline::Legacy(_) | Outline::Points(_) => None,
            Outline::Pieces(_, files) if depth < 8 => Some(files),
            Outline::Pieces(..) | Outline::Steps(..) => {
                let what = "a list within a list was not expected here";
                return Err(Error::format(&path, "", what, "name the data sets themselves"));
            }
        };
        match files {
            None => to.push(Self { path, content }),
            Some(files) => {
                for file in files {
                    Self::add(file, depth + 1, to, progress)?;
                }
            }
        }
        Ok(())
    }
}

fn source<'a>(array: &Array, bytes: &'a [u8], order: Order) -> Source<'a> {
    let step = array.kind.size();
    Source { bytes, kind: array.kind, order, start: 0, stride: step * array.components, step }
}

/// Decodes the arrays of all pieces, and makes particles of them.
fn assemble(path: &Path, set: Set, progress: &dyn Progress) -> Result<Frame> {
    let mut warnings = set.left_out();
    let names = common_arrays(&set.pieces, &mut warnings);
    let array_bytes = |array: &Array, count: usize| {
        count.saturating_mul(array.components).saturating_mul(array.kind.size())
    };
    let total = set.pieces.iter().map(|piece| {
        let kept = piece.attributes.iter().filter(|it| names.contains(&it.name));
        kept.chain([&piece.points]).map(|it| array_bytes(it, piece.count)).fold(0, usize::saturating_add)
    });
    progress.begin("read", Some(total.fold(0, usize::saturating_add) as u64), "B");

    let gather = |name: Option<&str>| -> Result<Columns> {
        let mut decoded: Vec<(usize, &Array, Cow<[u8]>, Order)> = Vec::new();
        for piece in &set.pieces {
            if progress.cancelled() {
                return Err(Error::Interrupted);
            }
            let array = match name {
                None => &piece.points,
                Some(name) => piece.attributes.iter().find(|it| it.name == name).expect("all pieces have it"),
            };
            let (bytes, order) = array.decode(piece.path, piece.count)?;
            decoded.push((piece.count, array, bytes, order));
        }
        let mut layouts = Vec::new();
        for (count, array, bytes, order) in &decoded {
            let source = source(array, bytes, *order);
            let mut layout = Layout { count: *count, axes: [None; 3], fields: Vec::new() };
            match name {
                None => {
                    layout.axes =
                        [0, 1, 2].map(|axis| (axis < array.components).then(|| source.component(axis)))
                }
                Some(name) => {
                    layout.fields.push(Field {
                        name: name.to_string(),
                        components: array.components,
                        source,
                    });
                }
            }
            layouts.push(layout);
        }
        let bytes = decoded.iter().map(|it| it.2.len()).sum();
        Ok(records::join(path, &layouts, bytes, progress)?.into_columns())
    };
    let mut columns = gather(None)?;
    for name in names {
        columns.attributes.extend(gather(Some(&name))?.attributes);
    }
    columns.attributes.extend(words::attributes(&set.pieces, &mut warnings));
    columns.time = set.time;
    drop_ghosts(&mut columns, &mut warnings);
    let mut conventions = Vec::new();
    records::spell_out_colors(&mut columns.attributes, &mut conventions);
    records::frame(columns, conventions, warnings)
}

/// The names of the arrays that all pieces have, with as many components.
fn common_arrays(pieces: &[Piece], warnings: &mut Vec<String>) -> Vec<String> {
    let Some(first) = pieces.first() else { return vec![] };
    let mut names: Vec<String> = Vec::new();
    for array in &first.attributes {
        let alike = |it: &Array| it.name == array.name && it.components == array.components;
        if names.contains(&array.name) {
            warnings.push(format!("left out: a second array '{}'", array.name));
        } else if pieces
            .iter()
            .all(|piece| piece.attributes.iter().find(|it| it.name == array.name).is_some_and(alike))
        {
            names.push(array.name.clone());
        }
    }
    let mut partial: Vec<&str> =
        pieces.iter().flat_map(|it| &it.attributes).map(|it| it.name.as_str()).collect();
    partial.sort_unstable();
    partial.dedup();
    partial.retain(|it| !names.iter().any(|name| name == it));
    if !partial.is_empty() {
        warnings.push(format!("left out: arrays that not all pieces have alike: {}", partial.join(", ")));
    }
    names
}

/// Leaves out the points that a piece has only as copies of another's.
fn drop_ghosts(columns: &mut Columns, warnings: &mut Vec<String>) {
    let place = columns.attributes.iter().position(|it| it.name == "vtkGhostType" && it.components == 1);
    let Some(place) = place else { return };
    let Values::U8(flags) = columns.attributes.remove(place).values else { return };
    let keep: Vec<bool> = flags.iter().map(|flag| flag & GHOST == 0).collect();
    let ghosts = keep.iter().filter(|keep| !**keep).count();
    if ghosts == 0 {
        return;
    }
    warnings.push(format!("left out: {ghosts} points that are copies of others or hidden (vtkGhostType)"));
    let offsets = columns.positions.offsets().map(|column| retained(column, 1, &keep));
    columns.positions = Positions::from_offsets(columns.positions.origin(), offsets);
    for Attribute { components, values, .. } in &mut columns.attributes {
        match values {
            Values::F32(column) => *column = retained(column, *components, &keep),
            Values::F64(column) => *column = retained(column, *components, &keep),
            Values::I32(column) => *column = retained(column, *components, &keep),
            Values::I64(column) => *column = retained(column, *components, &keep),
            Values::U8(column) => *column = retained(column, *components, &keep),
            Values::Text { codes, .. } => *codes = retained(codes, *components, &keep),
            Values::Frozen(_) => unreachable!("pieces are read into columns of their own"),
        }
    }
}

/// The rows that are kept.
fn retained<T: Copy>(column: &[T], components: usize, keep: &[bool]) -> Vec<T> {
    let rows = column.chunks_exact(components).zip(keep).filter(|(_, keep)| **keep);
    rows.flat_map(|(row, _)| row).copied().collect()
}
