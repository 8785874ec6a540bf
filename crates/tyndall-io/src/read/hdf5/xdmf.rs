//! XDMF: XML that says which arrays are the points of a grid, what they have, and which grids are steps in time.
//!
//! A uniform grid has a geometry (`XYZ`, `XY`, `X_Y_Z` or `X_Y`) and attributes, each a `DataItem`: a data set of an HDF5 file, `file.h5:/path`, or
//! numbers in the XML or in a binary file, or a hyperslab of a data set, which also other items may refer to (`items.rs`). A temporal
//! collection has a frame for each grid in it; grids that stand beside each other, or in a spatial collection, are one frame. A grid
//! without a geometry of its own has that of the first step, or the first one of the file, from where writers include it. Meshes count
//! by their points. Source: xdmf.org, "XDMF Model and Format".

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use tyndall::{Error, Progress, Result};

use super::columns::{self, Input, Numbers, Run, Term};
use super::data::Data;
use super::items::{self, Slab};
use super::rows::Rows;
use super::tree::Tree;
use crate::read::content::Content;
use crate::read::sections::{self, Column};
use crate::read::vtk::{Node, beside, elements};
use crate::read::{Index, Request, Span, content, map, records};
use crate::sequence::{Frame, Options};

const HINT: &str = "is the file whole? ParaView may say more";
/// Of what is not read.
const WAY_OUT: &str = "open it in ParaView and save the points as .vtp, or open the HDF5 file itself: --dataset PATH says which positions";

/// Whether the file is of this kind.
pub(crate) fn recognise(head: &[u8]) -> bool {
    head.trim_ascii_start().starts_with(b"<") && memchr::memmem::find(head, b"<Xdmf").is_some()
}

/// A step in time.
struct Step<'a> {
    time: Option<f64>,
    /// Its uniform grids.
    grids: Vec<&'a Node<'a>>,
}

/// The steps of a file, at least one.
fn steps<'a>(path: &Path, root: &'a Node<'a>) -> Result<Vec<Step<'a>>> {
    let fault = |what: &str| Error::format(path, "", what, HINT);
    let domain = root.child("Domain").filter(|_| root.name == "Xdmf");
    let domain = domain.ok_or_else(|| fault("there is no element Domain in one Xdmf"))?;
    let is_temporal =
        |it: &&&Node| it.get("CollectionType").is_some_and(|it| it.eq_ignore_ascii_case("Temporal"));
    let collection = domain.all("Grid").into_iter().find(|it| is_temporal(&it));
    let steps: Vec<Step> = match collection {
        Some(collection) => {
            let grids: Vec<&Node> = collection.children.iter().filter(|it| it.name == "Grid").collect();
            let times = collection.child("Time").map(|it| times(it, grids.len())).unwrap_or_default();
            let step = |(place, grid): (usize, &&'a Node<'a>)| Step {
                time: time(grid).or(times.get(place).copied()),
                grids: uniform(grid),
            };
            grids.iter().enumerate().map(step).collect()
        }
        None => {
            let top: Vec<&Node> = domain.children.iter().filter(|it| it.name == "Grid").collect();
            let time = top.first().and_then(|it| time(it));
            vec![Step { time, grids: top.into_iter().flat_map(uniform).collect() }]
        }
    };
    let whole = !steps.is_empty() && steps.iter().all(|it| !it.grids.is_empty());
    if whole { Ok(steps) } else { Err(fault("a step has no uniform grid")) }
}

/// The uniform grids of a grid: itself, or those in it.
fn uniform<'a>(grid: &'a Node<'a>) -> Vec<&'a Node<'a>> {
    match grid.get("GridType") {
        None | Some("Uniform") => vec![grid],
        _ => grid.children.iter().filter(|it| it.name == "Grid").flat_map(uniform).collect(),
    }
}

/// The time of a grid.
fn time(grid: &Node) -> Option<f64> {
    grid.child("Time")?.get("Value")?.parse().ok()
}

/// The times of a collection: a list, or a start, a step and a count.
fn times(node: &Node, count: usize) -> Vec<f64> {
    let text = node.child("DataItem").map_or("", Node::text);
    let numbers: Vec<f64> = text.split_whitespace().map_while(|it| it.parse().ok()).collect();
    match (node.get("TimeType"), &numbers[..]) {
        (Some("List"), _) => numbers,
        (Some("HyperSlab"), [start, step, ..]) => (0..count).map(|it| start + step * it as f64).collect(),
        _ => Vec::new(),
    }
}

/// Finds the steps.
pub(crate) fn index(path: &Path, bytes: &[u8], _: &Options) -> Result<Index> {
    let root = elements(path, bytes, false)?;
    let count = steps(path, &root)?.len();
    let span = |number: usize| Span { offset: 0, line: number as u64, bytes: None };
    Ok(Index { frames: (1..=count).map(span).collect(), title: Some("XDMF".into()), ..Index::default() })
}

/// The files that it names, each opened once.
struct Files<'a> {
    path: &'a Path,
    root: &'a Node<'a>,
    trees: BTreeMap<PathBuf, Tree>,
    binaries: BTreeMap<PathBuf, Arc<Content>>,
}

/// The array of a `DataItem`.
enum Array {
    Data(Box<Data>, Slab),
    Numbers(Numbers),
}

/// Its rows, a point each.
enum Points {
    Rows(Rows),
    Numbers(Numbers),
}

impl Points {
    /// How many there are, and the numbers in each.
    fn shape(&self) -> (usize, usize) {
        match self {
            Self::Rows(rows) => (rows.count, rows.width),
            Self::Numbers(numbers) => (numbers.count, numbers.width),
        }
    }

    /// The same with `width` numbers a point, if they stand in one row now.
    fn in_rows_of(self, width: usize) -> Self {
        match self {
            Self::Numbers(it) if it.width == 1 && it.count % width == 0 => {
                let stride = width * it.kind.size();
                Self::Numbers(Numbers { count: it.count / width, width, stride, ..it })
            }
            other => other,
        }
    }

    fn input(self) -> Input {
        match self {
            Self::Rows(rows) => Input::Rows(rows),
            Self::Numbers(numbers) => Input::Numbers(numbers),
        }
    }

    fn term(self) -> Vec<Term> {
        match self {
            Self::Rows(rows) => vec![Term::Rows(rows, 1.0)],
            Self::Numbers(numbers) => vec![Term::Numbers(numbers, 1.0)],
        }
    }
}

impl<'a> Files<'a> {
    /// The array of a `DataItem`; or why it is not read.
    fn array(&mut self, item: &'a Node<'a>) -> Result<std::result::Result<Array, String>> {
        let item = match items::target(self.root, item) {
            Ok(item) => item,
            Err(why) => return Ok(Err(why)),
        };
        match item.get("ItemType") {
            None | Some("Uniform") => {}
            Some("HyperSlab") => return self.slab(item),
            Some(kind) => return Ok(Err(format!("its DataItem is a {kind}"))),
        }
        match item.get("Format").unwrap_or("XML").to_ascii_uppercase().as_str() {
            "XML" => Ok(items::text(item).map(Array::Numbers)),
            "BINARY" => self.binary(item),
            "HDF" | "HDF5" => self.dataset(item),
            format => Ok(Err(format!("its numbers have the format {format}"))),
        }
    }

    /// Some rows of a data set.
    fn slab(&mut self, item: &'a Node<'a>) -> Result<std::result::Result<Array, String>> {
        let items: Vec<&Node> = item.children.iter().filter(|it| it.name == "DataItem").collect();
        let [slab, source] = items[..] else {
            return Ok(Err(format!("its HyperSlab has {} DataItems, not two", items.len())));
        };
        let source = match items::target(self.root, source) {
            Ok(source) if source.get("ItemType").is_none_or(|it| it == "Uniform") => self.array(source)?,
            Ok(_) => Err("its HyperSlab is one of another item than a data set".into()),
            Err(why) => Err(why),
        };
        Ok(source.and_then(|array| match array {
            Array::Data(data, _) => {
                let slab = Slab::of(slab, data.shape())?;
                Ok(Array::Data(data, slab))
            }
            Array::Numbers(_) => Err("its HyperSlab is one of another item than a data set".into()),
        }))
    }

    /// That in a binary file.
    fn binary(&mut self, item: &Node) -> Result<std::result::Result<Array, String>> {
        let file = beside(self.path, item.text().trim());
        let content = match self.binaries.entry(file) {
            Entry::Occupied(entry) => entry.into_mut(),
            Entry::Vacant(entry) => {
                let content = Arc::new(Content::Mapped(map::map_binary(entry.key())?));
                entry.insert(content)
            }
        };
        Ok(items::binary(item, Arc::clone(content)).map(Array::Numbers))
    }

    /// That in a data set.
    fn dataset(&mut self, item: &Node) -> Result<std::result::Result<Array, String>> {
        let Some((file, place)) = item.text().rsplit_once(':') else {
            return Ok(Err(format!("'{}' is no FILE:/PATH", item.text())));
        };
        let file = beside(self.path, file);
        let tree = match self.trees.entry(file) {
            Entry::Occupied(entry) => entry.into_mut(),
            Entry::Vacant(entry) => {
                let content = content::content(entry.key())?;
                let tree = Tree::open(entry.key(), content.as_ref())?;
                entry.insert(tree)
            }
        };
        let (group, name) = place.rsplit_once('/').unwrap_or(("", place));
        let data = match tree.group(group)? {
            Some(group) => group.dataset(name)?,
            None => None,
        };
        let there =
            data.ok_or_else(|| tree.fault(place, "there is no such data set", "was the file changed?"))?;
        Ok(if there.is_number() {
            Ok(Array::Data(Box::new(there), Slab::default()))
        } else {
            Err("these are no numbers".into())
        })
    }

    /// The positions that a geometry tells, and how many there are.
    fn positions(&mut self, geometry: &'a Node<'a>) -> Result<(Input, usize)> {
        let path = self.path;
        let wrong = |what: String| Error::format(path, "Geometry", what, WAY_OUT);
        let kind =
            geometry.get("GeometryType").or(geometry.get("Type")).unwrap_or("XYZ").to_ascii_uppercase();
        let items: Vec<&Node> = geometry.children.iter().filter(|it| it.name == "DataItem").collect();
        let wanted = match kind.as_str() {
            "XYZ" | "XY" => 1,
            "X_Y_Z" => 3,
            "X_Y" => 2,
            _ => return Err(wrong(format!("a grid of type {kind} has no points of its own"))),
        };
        if items.len() != wanted {
            return Err(wrong(format!("{kind} wants {wanted} DataItems, {} are there", items.len())));
        }
        let width = if wanted > 1 { 1 } else { kind.len() };
        let mut all = Vec::new();
        for item in items {
            let points = match self.array(item)?.map_err(wrong)? {
                Array::Data(data, slab) => {
                    let rows = data.rows(&slab.lead)?;
                    Points::Rows(slab.cut(rows).map_err(wrong)?)
                }
                Array::Numbers(numbers) => Points::Numbers(numbers).in_rows_of(width),
            };
            all.push(points);
        }
        let count = all[0].shape().0;
        if let Some(other) = all.iter().map(Points::shape).find(|it| *it != (count, width)) {
            let what =
                format!("{kind} wants {count} rows of {width}, a DataItem has {} of {}", other.0, other.1);
            return Err(wrong(what));
        }
        let positions = match all.pop() {
            Some(points) if all.is_empty() => points.input(),
            last => Input::Sums(all.into_iter().chain(last).map(Points::term).collect()),
        };
        Ok((positions, count))
    }

    /// The values that an attribute has for `count` points; or why they are not read.
    fn values(
        &mut self,
        attribute: &'a Node<'a>,
        count: usize,
    ) -> Result<std::result::Result<Points, String>> {
        let Some(item) = attribute.child("DataItem") else { return Ok(Err("it has no DataItem".into())) };
        let points = match self.array(item)? {
            Ok(Array::Data(data, slab)) => {
                let rows = data.quantity(&slab.lead)?;
                rows.and_then(|rows| slab.cut(rows)).map(Points::Rows)
            }
            Ok(Array::Numbers(numbers)) => Ok(Points::Numbers(numbers)),
            Err(why) => Err(why),
        };
        let width = match attribute.get("AttributeType") {
            Some("Vector") => 3,
            Some("Tensor6") => 6,
            Some("Tensor") => 9,
            _ => 1,
        };
        Ok(points.and_then(|points| {
            let is_flat = points.shape() == (count.saturating_mul(width), 1);
            let points = if is_flat { points.in_rows_of(width) } else { points };
            match points.shape().0 {
                rows if rows == count => Ok(points),
                rows => Err(format!("{rows} rows for {count} points")),
            }
        }))
    }
}

/// A grid, as it stands in the files.
struct Piece {
    positions: Input,
    count: usize,
    values: BTreeMap<String, Input>,
}

/// Reads the step whose number, counted from 1, is the line of `span`.
pub(crate) fn frame(
    path: &Path,
    bytes: &[u8],
    span: Span,
    request: &Request,
    progress: &dyn Progress,
) -> Result<Frame> {
    let root = elements(path, bytes, false)?;
    let all = steps(path, &root)?;
    let changed = || Error::format(path, "", "there are fewer steps than before", "was the file changed?");
    let step = all.get((span.line as usize).wrapping_sub(1)).ok_or_else(changed)?;
    let mut files = Files { path, root: &root, trees: BTreeMap::new(), binaries: BTreeMap::new() };
    let (mut columns, mut pieces, mut warnings) = (Vec::<Column>::new(), Vec::new(), Vec::new());
    let mut is_borrowed = false;
    for (place, grid) in step.grids.iter().enumerate() {
        let has_points = |it: &&Node| it.children.iter().any(|it| it.name == "DataItem");
        let own = grid.child("Geometry").filter(has_points);
        let first = all.first().and_then(|it| it.grids.get(place)?.child("Geometry")).filter(has_points);
        let any = || root.all("Geometry").into_iter().find(has_points);
        is_borrowed |= own.is_none();
        let geometry = own.or(first).or_else(any);
        let geometry = geometry.ok_or_else(|| Error::format(path, "Grid", "it has no Geometry", WAY_OUT))?;
        let (positions, count) = files.positions(geometry)?;
        let mut values = BTreeMap::new();
        for attribute in grid.children.iter().filter(|it| it.name == "Attribute") {
            let name = attribute.get("Name").unwrap_or("unnamed").to_string();
            match files.values(attribute, count)? {
                Ok(points) => {
                    if !columns.iter().any(|it| it.name == name) {
                        columns.push(Column::new(name.clone(), points.shape().1));
                    }
                    values.insert(name, points.input());
                }
                Err(why) => warnings.push(format!("left out: {name} ({why})")),
            }
        }
        pieces.push(Piece { positions, count, values });
    }
    let flags = sections::flags(&columns, request.options.wanted.as_ref());
    let columns = sections::flagged(columns, &flags);
    let runs: Vec<Run> = pieces
        .into_iter()
        .map(|mut it| {
            let values =
                columns.iter().map(|column| it.values.remove(&column.name).unwrap_or(Input::Missing));
            Run { count: it.count, values: values.collect(), positions: it.positions }
        })
        .collect();
    let maps = || {
        let binaries = files.binaries.values().filter_map(|it| it.map());
        files.trees.values().filter_map(Tree::map).chain(binaries)
    };
    let total = (bytes.len() + maps().map(|it| it.len()).sum::<usize>()) as u64;
    progress.begin("read", Some(total), "B");
    let progress = &map::released(maps(), progress);
    let mut gathered = columns::gather(path, &columns, &runs, None, total, progress)?;
    gathered.time = step.time;
    let mut conventions = Vec::new();
    if is_borrowed {
        conventions.push("a grid without a geometry has the first one of the file".to_string());
    }
    records::frame(gathered, conventions, warnings)
}

#[cfg(test)]
mod tests;
