//! XDMF: XML that says which arrays are the points of a grid, what they have, and which grids are steps in time.
//!
//! A uniform grid has a geometry (`XYZ`, `XY`, `X_Y_Z` or `X_Y`) and attributes, each a `DataItem`: a data set of an HDF5 file, `file.h5:/path`, or
//! numbers in the XML or in a binary file, or a hyperslab of a data set, which also other items may refer to (`items.rs`). A temporal collection has a frame for each grid in it; grids that stand beside each other, or in
//! a spatial collection, are one frame. A grid without a geometry of its own has that of the first step, or the first one of the file, from where writers
//! include it. Meshes count by their points. Source: xdmf.org, "XDMF Model and Format".

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use tyndall::{Error, Progress, Result};

use super::columns::{self, Input, Numbers, Run, Term};
use super::items::{self, Slab};
use super::tree::{Data, Rows, Tree};
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
mod tests {
    use tyndall::Particles;

    use super::*;
    use crate::sequence::Sequence;

    fn folder() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/samples")
    }

    fn at(particles: &Particles, id: usize) -> [f64; 3] {
        particles.positions().world(id).to_array()
    }

    /// Reads the frames of a text that stands beside the samples.
    fn read(text: &str) -> Result<Vec<Frame>> {
        let path = folder().join("a.xdmf");
        let options = Options::default();
        let request = Request { options: &options, bytes: None, units: None, topology: None, others: &() };
        let index = index(&path, text.as_bytes(), &options)?;
        index.frames.iter().map(|it| frame(&path, text.as_bytes(), *it, &request, &())).collect()
    }

    const ITEM: &str = "<DataItem Format=\"HDF\" Dimensions=\"4\">series_xdmf.h5:/";

    fn grid(geometry: &str, attributes: &str) -> String {
        format!(
            "<?xml version=\"1.0\"?><Xdmf><Domain><Grid><Topology TopologyType=\"Polyvertex\"/>{geometry}{attributes}</Grid></Domain></Xdmf>"
        )
    }

    #[test]
    fn a_series_has_its_steps_times_and_grids() {
        let sequence = Sequence::open(&[folder().join("series.xdmf")], &Options::default(), &()).unwrap();
        assert_eq!(sequence.len(), 2);
        let first = sequence.frame(0, &()).unwrap();
        assert_eq!((at(&first.particles, 3), first.particles.time()), ([9.0, 10.0, 11.0], Some(0.5)));
        assert!(first.conventions.is_empty() && first.warnings.is_empty(), "{:?}", first.warnings);
        let second = sequence.frame(1, &()).unwrap();
        assert_eq!((at(&second.particles, 3), second.particles.time()), ([9.0, 10.0, 11.0], Some(0.75)));
        assert_eq!(second.conventions, ["a grid without a geometry has the first one of the file"]);
        for (frame, sign) in [(&first, 1.0), (&second, -1.0)] {
            let velocity = frame.particles.attribute("velocity").unwrap();
            assert_eq!((velocity.components, velocity.number(2, 1)), (3, sign * 7.0));
            assert_eq!(frame.particles.attribute("mass").unwrap().number(3, 0), sign * 3.0);
        }
    }

    #[test]
    fn axes_may_stand_alone_and_grids_beside_each_other() {
        let axes = format!("<Geometry GeometryType=\"X_Y\">{ITEM}x</DataItem>{ITEM}y</DataItem></Geometry>");
        let particles = read(&grid(&axes, "")).unwrap().remove(0).particles;
        assert_eq!(at(&particles, 2), [2.0, 20.0, 0.0]);
        let rows = format!("<Geometry Type=\"XYZ\">{ITEM}step_0/position</DataItem></Geometry>");
        let mass =
            format!("<Attribute Name=\"mass\" Center=\"Node\">{ITEM}step_0/mass</DataItem></Attribute>");
        let both = grid(&rows, &mass)
            .replace("</Grid>", &format!("</Grid><Grid GridType=\"Uniform\">{axes}</Grid>"));
        let frames = read(&both).unwrap();
        let mass = frames[0].particles.attribute("mass").unwrap();
        assert_eq!((frames.len(), frames[0].particles.len(), mass.number(3, 0)), (1, 8, 3.0));
        assert!(mass.number(4, 0).is_nan());
        assert_eq!(at(&frames[0].particles, 6), [2.0, 20.0, 0.0]);
    }

    #[test]
    fn times_may_be_a_list_or_steps_and_a_mesh_may_stand_beside() {
        let mesh = format!("<Grid><Geometry>{ITEM}step_0/position</DataItem></Geometry></Grid>");
        let steps = [(&*mesh, "", "List", "2 3.5"), ("<Grid/>", &*mesh, "HyperSlab", "2.0 1.5 2")];
        for (step, beside, kind, numbers) in steps {
            let time =
                format!("<Time TimeType=\"{kind}\"><DataItem Format=\"XML\">{numbers}</DataItem></Time>");
            let text = format!(
                "<Xdmf><Domain><Grid GridType=\"Collection\" CollectionType=\"Temporal\">{time}{step}{step}</Grid>{beside}</Domain></Xdmf>"
            );
            let frames = read(&text).unwrap();
            let times: Vec<_> = frames.iter().map(|it| it.particles.time()).collect();
            assert_eq!(times, [Some(2.0), Some(3.5)], "{kind}");
            assert_eq!(at(&frames[1].particles, 1), [3.0, 4.0, 5.0]);
        }
    }

    #[test]
    fn what_is_not_read_is_said() {
        let rows = format!("<Geometry>{ITEM}step_0/position</DataItem></Geometry>");
        let message = |text: String| read(&text).err().unwrap().to_string();
        assert!(message(grid(&rows.replace("HDF", "TIFF"), "")).contains("format TIFF"));
        assert!(message(grid(&rows.replace("HDF", "XML"), "")).contains("a number was wanted, 'series_xdmf"));
        assert!(message(grid(&rows.replace("step_0", "step_7"), "")).contains("no such data set"));
        assert!(
            message(grid(&rows.replace("<Geometry>", "<Geometry Type=\"ORIGIN_DXDYDZ\">"), ""))
                .contains("no points")
        );
        assert!(message(grid("", "")).contains("no Geometry"));
        assert!(message(grid(&rows, "").replace("Domain", "Range")).contains("no element Domain"));
        let odd = format!(
            "<Attribute Name=\"a\">{ITEM}one</DataItem></Attribute><Attribute Name=\"b\"><DataItem ItemType=\"Function\"/></Attribute>"
        );
        let frame = read(&grid(&rows, &odd)).unwrap().remove(0);
        assert_eq!(
            frame.warnings,
            ["left out: a (1 rows for 4 points)", "left out: b (its DataItem is a Function)"]
        );
    }

    /// Positions `k, 2, 3` and what else is said of three points, in the XML.
    const POINTS: &str = "<Geometry GeometryType=\"XYZ\"><DataItem Dimensions=\"3 3\">0 2 3\n 1 2 3\t2 2 3</DataItem></Geometry>";

    fn attribute(name: &str, item: &str, numbers: &str) -> String {
        format!(
            "<Attribute Name=\"{name}\" AttributeType=\"Vector\"><DataItem {item}>{numbers}</DataItem></Attribute>"
        )
    }

    #[test]
    fn numbers_may_stand_in_the_xml() {
        let flat = POINTS.replace("3 3", "9").replace("XYZ", "xyz");
        let axes = "<Geometry Type=\"X_Y\"><DataItem Dimensions=\"3\" Format=\"XML\" Precision=\"8\">0 1 2</DataItem>\
                    <DataItem Dimensions=\"3\" NumberType=\"Int\">2 2 2</DataItem></Geometry>";
        for (geometry, depth) in [(POINTS, 3.0), (&flat, 3.0), (axes, 0.0)] {
            let attributes =
                attribute("id", "Dimensions=\"3 1\" NumberType=\"UInt\" Precision=\"8\"", "7 8 9000000000")
                    + &attribute("v", "Dimensions=\"9\" Format=\"XML\"", "1 2 3 4 5 6 7 8 9.5e-1");
            let frame = read(&grid(geometry, &attributes)).unwrap().remove(0);
            let particles = &frame.particles;
            assert_eq!((particles.len(), at(particles, 2)), (3, [2.0, 2.0, depth]));
            assert_eq!(particles.attribute("id").unwrap().number(2, 0), 9e9);
            let velocity = particles.attribute("v").unwrap();
            assert_eq!((velocity.components, velocity.number(2, 2)), (3, f64::from(0.95f32)));
            assert!(frame.warnings.is_empty(), "{:?}", frame.warnings);
        }
        let none = POINTS.replace("3 3", "0 3").replace("0 2 3\n 1 2 3\t2 2 3", " ");
        assert_eq!(read(&grid(&none, "")).unwrap()[0].particles.len(), 0);
    }

    #[test]
    fn numbers_may_stand_in_binary_files() {
        let place = tempfile::tempdir().unwrap();
        let mut file = vec![0xef, 0xbb, 0xbf];
        file.extend((0..9).flat_map(|it| (f64::from(it) / 2.0).to_be_bytes()));
        file.extend([-1i16, 2, 300].into_iter().flat_map(i16::to_le_bytes));
        std::fs::write(place.path().join("a.bin"), &file).unwrap();
        let item = |what: &str| format!("<DataItem Format=\"Binary\" {what}>\n a.bin \n</DataItem>");
        let rows = item("Dimensions=\"3 3\" NumberType=\"Float\" Precision=\"8\" Endian=\"Big\" Seek=\"3\"");
        let read = |attribute: &str| {
            let kind = format!("<Attribute Name=\"kind\">{}</Attribute>", item(attribute));
            let path = place.path().join("a.xmf");
            std::fs::write(&path, grid(&format!("<Geometry>{rows}</Geometry>"), &kind)).unwrap();
            Sequence::open(&[path], &Options::default(), &()).unwrap().frame(0, &())
        };
        let short = "Dimensions=\"3\" NumberType=\"Short\" Endian=\"Little\"";
        let frame = read(&format!("{short} Seek=\"75\"")).unwrap();
        assert_eq!(at(&frame.particles, 2), [3.0, 3.5, 4.0]);
        let kind = frame.particles.attribute("kind").unwrap();
        assert_eq!([0, 1, 2].map(|id| kind.number(id, 0)), [-1.0, 2.0, 300.0]);
        // What a hostile or damaged file says.
        let left_out = |attribute: &str| read(attribute).unwrap().warnings.concat();
        assert!(left_out(&format!("{short} Seek=\"76\"")).contains("more than a file of 81 bytes has"));
        assert!(left_out(&format!("{short} Seek=\"18446744073709551615\"")).contains("more than a file"));
        assert!(left_out(&format!("{short} Seek=\"-1\"")).contains("Seek is '-1'"));
        assert!(left_out(&short.replace("Little", "Middle")).contains("no order of bytes 'middle'"));
        assert!(
            left_out(&short.replace("Short", "Float\" Precision=\"16")).contains("type Float of 16 bytes")
        );
        assert!(left_out(&format!("{short} Compression=\"Zlib\"")).contains("compressed: Zlib"));
        for wrong in ["9223372036854775807 4", "4 99999999", "-3", "", "3 0"] {
            let told = left_out(&short.replace("\"3\"", &format!("\"{wrong}\"")));
            assert!(told.contains("Dimensions are"), "{wrong}: {told}");
        }
        assert!(left_out(&short.replace("\"3\"", "\"9223372036854775807\"")).contains("more than a file"));
        assert!(left_out("").contains("no Dimensions"));
        std::fs::remove_file(place.path().join("a.bin")).unwrap();
        assert!(read(short).unwrap_err().to_string().contains("a.bin"));
    }

    #[test]
    fn items_may_refer_to_others() {
        let shared = "<DataItem Name=\"p/q\" Dimensions=\"3 3\">0 2 3 1 2 3 2 2 3</DataItem>";
        let paths = [
            "Reference=\"/Xdmf/Domain/DataItem[@Name='p/q']\"/>",
            "Reference=\"/Xdmf/Domain/DataItem\"/>",
            "Reference=\"XML\"> /Xdmf/Domain/DataItem[1] </DataItem>",
        ];
        let text = |path: &str| {
            grid(&format!("<Geometry><DataItem {path}</Geometry>"), "")
                .replace("<Domain>", &format!("<Domain>{shared}"))
        };
        for path in paths {
            assert_eq!(at(&read(&text(path)).unwrap()[0].particles, 2), [2.0, 2.0, 3.0], "{path}");
        }
        let itself = "Reference=\"/Xdmf/Domain/Grid/Geometry/DataItem\"/>";
        for (path, wrong) in [
            (itself, "in a circle"),
            ("Reference=\"/Xdmf/Range/[[\"/>", "not there"),
            ("Reference=\"/Xdmf/Domain/DataItem[0]\"/>", "not there"),
        ] {
            let message = read(&text(path)).err().unwrap().to_string();
            assert!(message.contains(wrong), "{message}");
        }
    }

    #[test]
    fn hyperslabs_take_rows() {
        let slab = |numbers: &str, source: &str| {
            format!(
                "<DataItem ItemType=\"HyperSlab\"><DataItem Dimensions=\"3 2\">{numbers}</DataItem>{source}</DataItem>"
            )
        };
        let rows = format!("{ITEM}step_0/position</DataItem>");
        let mass = format!(
            "<Attribute Name=\"mass\">{}</Attribute>",
            slab("2 1 2", &format!("{ITEM}step_0/mass</DataItem>"))
        );
        let text = |numbers: &str| grid(&format!("<Geometry>{}</Geometry>", slab(numbers, &rows)), &mass);
        let frame = read(&text("2 0 1 1 2 3")).unwrap().remove(0);
        assert_eq!((frame.particles.len(), at(&frame.particles, 1)), (2, [9.0, 10.0, 11.0]));
        assert_eq!(frame.particles.attribute("mass").unwrap().number(1, 0), 3.0);
        assert_eq!(read(&text("0 0 1 1 4 3")).unwrap()[0].warnings, ["left out: mass (2 rows for 4 points)"]);
        for wrong in
            ["2 0 1 1 3 3", "0 0 2 1 2 3", "0 1 1 1 4 2", "1 2 3", "", "18446744073709551615 0 1 1 2 3"]
        {
            let message = read(&text(wrong)).err().unwrap().to_string();
            assert!(message.contains("HyperSlab"), "{wrong}: {message}");
        }
        let message =
            read(&grid(&format!("<Geometry>{}</Geometry>", slab("0 0 1 1 1 3", POINTS)), "")).err().unwrap();
        assert!(message.to_string().contains("1 DataItems, not two"), "{message}");
    }

    #[test]
    fn damage_never_panics() {
        let attributes =
            attribute("v", "Dimensions=\"3 3\" NumberType=\"Int\" Format=\"XML\"", "1 2 3 4 5 6 7 8 9");
        let text = grid(POINTS, &attributes);
        crate::read::real_data::damage_some(text.as_bytes(), |file| {
            drop(read(&String::from_utf8_lossy(file)))
        });
        for wrong in ["4 3", "3 4", "2 3", "99999999999 3"] {
            let message = read(&text.replacen("3 3", wrong, 1)).err().unwrap().to_string();
            assert!(message.contains("numbers were wanted") || message.contains("wants 3 rows"), "{message}");
        }
    }
}
