//! XDMF: XML that says which data sets of HDF5 files are the points of a grid, what they have, and which grids are steps in time.
//!
//! A uniform grid has a geometry (`XYZ`, `XY`, `X_Y_Z` or `X_Y`) and attributes, each a `DataItem` of the form `file.h5:/path`. A
//! temporal collection has a frame for each grid in it; grids that stand beside each other, or in a spatial collection, are one frame. A grid
//! without a geometry of its own has that of the first step, or the first one of the file, from where writers include it. Meshes count by their points. Numbers in the XML
//! itself or in binary files are not read. Source: xdmf.org, "XDMF Model and Format".

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use tyndall::{Error, Progress, Result};

use super::columns::{self, Input, Run, Term};
use super::tree::{Data, Tree};
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

/// The HDF5 files, each opened once.
struct Files<'a> {
    path: &'a Path,
    trees: BTreeMap<PathBuf, Tree>,
}

impl Files<'_> {
    /// The data set of a `DataItem`; or why it is not read.
    fn dataset(&mut self, item: &Node) -> Result<std::result::Result<Data, String>> {
        if let Some(kind) = item.get("ItemType").filter(|it| *it != "Uniform") {
            return Ok(Err(format!("its DataItem is a {kind}")));
        }
        match item.get("Format") {
            Some(format) if format.eq_ignore_ascii_case("HDF") || format.eq_ignore_ascii_case("HDF5") => {}
            Some(format) => return Ok(Err(format!("its numbers have the format {format}"))),
            None => return Ok(Err("its DataItem has no format".into())),
        }
        let Some((file, place)) = item.text().rsplit_once(':') else {
            return Ok(Err(format!("'{}' is no FILE:/PATH", item.text())));
        };
        let file = beside(self.path, file);
        let tree = match self.trees.entry(file) {
            std::collections::btree_map::Entry::Occupied(entry) => entry.into_mut(),
            std::collections::btree_map::Entry::Vacant(entry) => {
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
        Ok(if there.is_number() { Ok(there) } else { Err("these are no numbers".into()) })
    }

    /// The positions that a geometry tells, and how many there are.
    fn positions(&mut self, geometry: &Node) -> Result<(Input, usize)> {
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
        let mut all = Vec::new();
        for item in items {
            all.push(self.dataset(item)?.map_err(wrong)?.rows(&[])?);
        }
        let count = all[0].count;
        let width = if wanted > 1 { 1 } else { kind.len() };
        if let Some(rows) = all.iter().find(|it| it.width != width) {
            return Err(wrong(format!("{kind} wants rows of {width}, {} has {}", rows.path(), rows.width)));
        }
        let positions = match all.pop() {
            Some(rows) if all.is_empty() => Input::Rows(rows),
            last => Input::Sums(all.into_iter().chain(last).map(|it| vec![Term::Rows(it, 1.0)]).collect()),
        };
        Ok((positions, count))
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
    let mut files = Files { path, trees: BTreeMap::new() };
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
            let found = match attribute.child("DataItem") {
                Some(item) => files.dataset(item)?,
                None => Err("it has no DataItem".into()),
            };
            let rows = match found {
                Ok(data) => data.quantity(&[])?,
                Err(why) => Err(why),
            };
            match rows {
                Ok(rows) if rows.count == count => {
                    if !columns.iter().any(|it| it.name == name) {
                        columns.push(Column::new(name.clone(), rows.width));
                    }
                    values.insert(name, Input::Rows(rows));
                }
                Ok(rows) => {
                    warnings.push(format!("left out: {name} ({} rows for {count} points)", rows.count))
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
    let total = files.trees.values().map(Tree::bytes).sum();
    progress.begin("read", Some(total), "B");
    let progress = &map::released(files.trees.values().filter_map(Tree::map), progress);
    let tree = files.trees.values().next().ok_or_else(changed)?;
    let mut gathered = columns::gather(tree, &columns, &runs, None, total, progress)?;
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
        assert!(message(grid(&rows.replace("HDF", "XML"), "")).contains("format XML"));
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
}
