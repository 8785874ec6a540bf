//! Plain HDF5: a data set of N rows of coordinates, or one for each axis, or one of records, and beside it others with N rows.
//!
//! The positions are the data set that the caller names, else the one that is called like positions, else the only one of two or
//! three columns. H5Part keeps its frames in groups `Step#0`, `Step#1`, …: then each of these is a frame. Positions in three dimensions
//! are those of frames, as MDTraj and AMBER (NetCDF-4) keep them, with cells as lengths and angles. Values are multiplied by the attribute
//! `scale_factor` of their data set and moved by its `add_offset`, as NetCDF's conventions say (AMBER's velocities have 20.455).

use std::collections::HashSet;
use std::ops::Range;

use tyndall::{Cell, DVec3, Error, Positions, Progress, Result};

use super::columns::{self, Input, Run, Term};
use super::compound;
use super::data::Data;
use super::tree::{Group, Tree};
use crate::read::sections::{self, Column};
use crate::read::{molecules, records, table};
use crate::sequence::{Frame, Options};

/// What positions are called, best first.
pub(super) const NAMES: [&str; 10] =
    ["coordinates", "positions", "position", "pos", "points", "xyz", "coords", "vertices", "x", "r"];
/// How PyTables calls the groups of its indexes.
const INDEX: &str = "_i_";
/// So deep are groups looked into.
const DEPTH: usize = 8;

/// Where the positions are.
#[derive(Clone, Debug, PartialEq)]
enum Place {
    /// A data set with a row for each particle: its group and name.
    Rows(String, String),
    /// A data set with a row for each particle of each frame.
    Frames(String, String),
    /// Data sets for each axis: their group and names.
    Axes(String, [String; 3]),
    /// A data set of records: its group and name.
    Records(String, String),
}

impl Place {
    fn group(&self) -> &str {
        match self {
            Self::Rows(group, _)
            | Self::Frames(group, _)
            | Self::Axes(group, _)
            | Self::Records(group, _) => group,
        }
    }

    /// How it is named to people.
    fn path(&self) -> String {
        let (group, name) = match self {
            Self::Rows(group, name) | Self::Frames(group, name) | Self::Records(group, name) => {
                (group, name.clone())
            }
            Self::Axes(group, names) => (group, names.join(",")),
        };
        if group.is_empty() { name } else { format!("{group}/{name}") }
    }
}

/// The steps of H5Part, in order; empty if there are none.
fn steps(tree: &Tree) -> Result<Vec<String>> {
    let groups = tree.root()?.groups()?;
    let mut steps: Vec<(u64, String)> = groups
        .into_iter()
        .filter_map(|name| Some((name.strip_prefix("Step#")?.parse().ok()?, name)))
        .collect();
    steps.sort();
    Ok(steps.into_iter().map(|it| it.1).collect())
}

/// How many frames there are, and what the file is called.
pub(super) fn index(tree: &Tree, options: &Options) -> Result<(usize, String)> {
    let steps = steps(tree)?;
    if steps.is_empty() {
        let place = find(tree, "", options)?;
        let frames = match &place {
            Place::Frames(group, name) => frames(tree, group, name)?,
            Place::Rows(..) | Place::Axes(..) | Place::Records(..) => 1,
        };
        return Ok((frames, "HDF5".to_string()));
    }
    Ok((steps.len(), "H5Part HDF5".to_string()))
}

/// How many frames positions have.
fn frames(tree: &Tree, group: &str, name: &str) -> Result<usize> {
    let data = match tree.group(group)? {
        Some(group) => group.dataset(name)?,
        None => None,
    };
    let frames = data.and_then(|it| it.shape().first().copied()).unwrap_or(0);
    if frames > tree.bytes() {
        let what = format!("{frames} frames in a file of {} bytes", tree.bytes());
        return Err(tree.fault(name, what, "was the file copied to its end?"));
    }
    Ok(frames as usize)
}

/// The positions in a group or below it.
fn find(tree: &Tree, group: &str, options: &Options) -> Result<Place> {
    let (mut places, mut seen) = (Vec::new(), HashSet::new());
    let root =
        tree.group(group)?.ok_or_else(|| tree.fault(group, "the group is gone", "was the file changed?"))?;
    collect(&root, 0, &mut places, &mut seen)?;
    let names = || places.iter().take(20).map(Place::path).collect::<Vec<_>>().join(", ");
    if let Some(wanted) = &options.dataset {
        let wanted = wanted.trim_matches('/');
        let is_wanted = |place: &&Place| {
            let path = place.path();
            path == wanted || path.ends_with(&format!("/{wanted}"))
        };
        let place = places.iter().find(is_wanted).cloned();
        return place.ok_or_else(|| {
            let there = if places.is_empty() { "none has two or three columns".to_string() } else { names() };
            Error::setting("dataset", wanted, format!("a data set of coordinates: {there}"))
        });
    }
    // A name counts more than anything else; of equal ones the first.
    let rank = |place: &Place| match place {
        Place::Axes(..) | Place::Records(..) => Some(NAMES.len()),
        Place::Rows(_, name) | Place::Frames(_, name) => {
            NAMES.iter().position(|it| it.eq_ignore_ascii_case(name))
        }
    };
    let best = places.iter().filter_map(rank).min();
    let may_be = |place: &Place| match place {
        Place::Rows(_, name) | Place::Frames(_, name) => !table::is_other_vector(name),
        Place::Axes(..) | Place::Records(..) => true,
    };
    let is_candidate = |place: &&Place| if best.is_none() { may_be(place) } else { rank(place) == best };
    let candidates: Vec<&Place> = places.iter().filter(is_candidate).collect();
    match candidates[..] {
        [] => {
            let what = "no data set has rows of two or three coordinates";
            Err(tree.fault(
                group,
                what,
                "store the positions as one data set of N x 3 numbers, or as x, y and z",
            ))
        }
        [place] => Ok(place.clone()),
        _ => {
            let what = format!("more than one data set may be the positions: {}", names());
            Err(tree.fault(group, what, "say which: --dataset PATH"))
        }
    }
}

/// The candidates in a group and below it, but for the groups that were seen.
fn collect(
    group: &Group,
    depth: usize,
    places: &mut Vec<Place>,
    seen: &mut HashSet<(usize, u64)>,
) -> Result<()> {
    if !seen.insert(group.identity()) {
        return Ok(());
    }
    let names = group.datasets()?;
    for name in &names {
        let Ok(Some(data)) = group.dataset(name) else { continue };
        let shape = data.shape();
        if shape.len() == 2 && (2..=3).contains(&shape[1]) && data.is_number() {
            places.push(Place::Rows(group.path().to_string(), name.clone()));
        }
        let is_named = || NAMES.iter().any(|it| it.eq_ignore_ascii_case(name));
        if shape.len() == 3 && (2..=3).contains(&shape[2]) && data.is_number() && is_named() {
            places.push(Place::Frames(group.path().to_string(), name.clone()));
        }
        if compound::is_table(&data) {
            places.push(Place::Records(group.path().to_string(), name.clone()));
        }
    }
    for axes in [["x", "y", "z"], ["X", "Y", "Z"], ["pos_x", "pos_y", "pos_z"]] {
        let is_axis = |name: &&str| -> Result<bool> {
            Ok(group.dataset(name)?.is_some_and(|it| it.shape().len() == 1 && it.is_number()))
        };
        if axes.iter().map(is_axis).collect::<Result<Vec<_>>>()?.into_iter().all(|it| it) {
            places.push(Place::Axes(group.path().to_string(), axes.map(String::from)));
        }
    }
    if depth < DEPTH {
        for name in group.groups()?.into_iter().filter(|it| !it.starts_with(INDEX)) {
            if let Some(child) = group.group(&name)? {
                collect(&child, depth + 1, places, seen)?;
            }
        }
    }
    Ok(())
}

/// What stands beside positions.
#[derive(Default)]
pub(super) struct Beside {
    pub(super) columns: Vec<Column>,
    pub(super) values: Vec<Input>,
    /// Data sets that are no quantities of these particles.
    pub(super) left_out: Vec<String>,
    pub(super) warnings: Vec<String>,
}

/// Where the rows of a data set with this name and extent are: indices of the dimensions before them, and which ones; `None` if it has none
/// for these particles.
type Rows<'a> = dyn Fn(&str, &[u64]) -> Result<Option<(Vec<u64>, Range<usize>)>> + 'a;

/// The quantities in a group, but those of `others`.
pub(super) fn beside(group: &Group, others: &[String], rows: &Rows) -> Result<Beside> {
    let mut beside = Beside::default();
    for name in group.datasets()?.into_iter().filter(|it| !others.contains(it)) {
        let Some(data) = group.dataset(&name)? else { continue };
        let Some((lead, range)) = rows(&name, data.shape())?.filter(|_| data.is_number()) else {
            beside.left_out.push(name);
            continue;
        };
        let unit = unit(&data);
        match data.quantity(&lead)? {
            Ok(rows) => match rows.within(range) {
                Some(rows) => {
                    beside.columns.push(Column { unit, ..Column::new(name, rows.width) });
                    beside.values.push(Input::Rows(rows));
                }
                None => beside.left_out.push(name),
            },
            Err(why) => beside.warnings.push(format!("left out: {name} ({why})")),
        }
    }
    Ok(beside)
}

/// The unit that a data set tells.
fn unit(data: &Data) -> Option<String> {
    let attributes = data.attributes();
    let mut words = ["unit", "units", "Unit", "Units"].into_iter().filter_map(|it| attributes.text(it));
    words.find(|it| !it.is_empty())
}

/// What values are multiplied by, and what is added then, where a data set tells either.
fn scaling(data: &Data) -> Option<(f64, f64)> {
    let attributes = data.attributes();
    let number = |name: &str| attributes.number(name).filter(|it| it.is_finite());
    let found = (number("scale_factor").unwrap_or(1.0), number("add_offset").unwrap_or(0.0));
    (found != (1.0, 0.0)).then_some(found)
}

/// The same positions, scaled.
fn scaled(positions: &Positions, (factor, offset): (f64, f64)) -> Positions {
    let column = |values: &[f32]| values.iter().map(|it| (factor * f64::from(*it)) as f32).collect();
    let origin = factor * positions.origin() + DVec3::splat(offset);
    Positions::from_offsets(origin, positions.offsets().map(column))
}

/// The cell of a frame whose edges and angles, in degrees, stand beside the positions.
fn cell(group: &Group, frame: usize) -> Result<Option<Cell>> {
    let three = |name: &str| -> Result<Option<[f64; 3]>> {
        let Some(data) = group.dataset(name)?.filter(|it| it.is_number() && it.shape().last() == Some(&3))
        else {
            return Ok(None);
        };
        let lead = if data.shape().len() == 2 { vec![frame as u64] } else { Vec::new() };
        let (factor, offset) = scaling(&data).unwrap_or((1.0, 0.0));
        let numbers = data.rows(&lead)?.numbers()?;
        Ok(numbers.first_chunk().map(|it: &[f64; 3]| it.map(|it| factor * it + offset)))
    };
    let lengths = three("cell_lengths")?;
    Ok(lengths
        .zip(three("cell_angles")?)
        .and_then(|(lengths, angles)| molecules::cell_of_angles(lengths, angles)))
}

/// Reads a frame.
pub(super) fn frame(tree: &Tree, number: usize, options: &Options, progress: &dyn Progress) -> Result<Frame> {
    let steps = steps(tree)?;
    let place = find(tree, steps.get(number).map_or("", String::as_str), options)?;
    let group = tree
        .group(place.group())?
        .ok_or_else(|| tree.fault(place.path(), "it is gone", "was the file changed?"))?;
    let dataset = |name: &str| -> Result<Data> {
        group.dataset(name)?.ok_or_else(|| tree.fault(name, "it is gone", "was the file changed?"))
    };
    let (mut length_unit, mut scale, mut table) = (None, None, Beside::default());
    let (names, positions, count, frames) = match &place {
        Place::Rows(_, name) | Place::Frames(_, name) => {
            let data = dataset(name)?;
            (length_unit, scale) = (unit(&data), scaling(&data));
            let is_series = matches!(place, Place::Frames(..));
            let frames = is_series.then(|| data.shape()[0]);
            let lead = if is_series { vec![number as u64] } else { Vec::new() };
            let rows = data.rows(&lead)?;
            let count = rows.count;
            (vec![name.clone()], Input::Rows(rows), count, frames)
        }
        Place::Axes(_, names) => {
            let rows = names.iter().map(|name| dataset(name)?.rows(&[])).collect::<Result<Vec<_>>>()?;
            let count = rows[0].count;
            let sums = rows.into_iter().map(|rows| vec![Term::Rows(rows, 1.0)]).collect();
            (names.to_vec(), Input::Sums(sums), count, None)
        }
        Place::Records(_, name) => {
            let found = compound::read(&dataset(name)?)?
                .ok_or_else(|| tree.fault(name, "it has no coordinates", "was the file changed?"))?;
            let compound::Table { positions, count, columns, values, left_out } = found;
            table = Beside { columns, values, left_out, ..Beside::default() };
            (vec![name.clone()], positions, count, None)
        }
    };
    let cell = if frames.is_some() { cell(&group, number)? } else { None };
    let rows = |_: &str, shape: &[u64]| {
        let of_frame = frames.is_some_and(|frames| shape.get(..2) == Some(&[frames, count as u64][..]));
        let of_all = shape.first() == Some(&(count as u64));
        let lead = if of_frame { vec![number as u64] } else { Vec::new() };
        Ok((of_frame || of_all).then_some((lead, 0..count)))
    };
    let taken: Vec<String> = table.columns.iter().map(|it| it.name.clone()).chain(names).collect();
    let Beside { columns, values, mut left_out, mut warnings } = beside(&group, &taken, &rows)?;
    let columns = [table.columns, columns].concat();
    let values = table.values.into_iter().chain(values).collect();
    left_out.splice(..0, table.left_out);
    let flags = sections::flags(&columns, options.wanted.as_ref());
    let (columns, values) = (sections::flagged(columns, &flags), sections::flagged(values, &flags));
    let run = Run { count, positions, values };
    let mut gathered = columns::gather(tree.path(), &columns, &[run], None, tree.bytes(), progress)?;
    if let Some(scale) = scale {
        gathered.positions = scaled(&gathered.positions, scale);
    }
    for attribute in &mut gathered.attributes {
        if let Some((factor, offset)) = group.dataset(&attribute.name)?.and_then(|data| scaling(&data)) {
            records::scale(attribute, factor, offset);
        }
    }
    gathered.time = group.attributes()?.number("TimeValue").or(group.attributes()?.number("time"));
    gathered.length_unit = length_unit.map(|it| match it.to_ascii_lowercase().as_str() {
        "angstrom" | "angstroms" => "Å".to_string(),
        "nanometer" | "nanometers" => "nm".to_string(),
        _ => it,
    });
    if let Some(frames) = frames {
        left_out.retain(|it| !["time", "cell_lengths", "cell_angles"].contains(&it.as_str()));
        let times = group.dataset("time")?.filter(|it| it.shape() == [frames] && it.is_number());
        if let Some(times) = times {
            gathered.time_unit =
                unit(&times).map(|it| if it.starts_with("picosecond") { "ps".into() } else { it });
            let (factor, offset) = scaling(&times).unwrap_or((1.0, 0.0));
            gathered.time = times.rows(&[])?.numbers()?.get(number).map(|it| factor * it + offset);
        }
        gathered.cell = cell;
    }
    let mut conventions = vec![format!("positions: data set {}", place.path())];
    if let Some((factor, _)) = scale {
        conventions.push(format!("coordinates are scaled by {factor}, their scale_factor"));
    }
    if !left_out.is_empty() {
        warnings.push(format!("left out: {} (no {count} rows of numbers)", left_out.join(", ")));
    }
    records::frame(gathered, conventions, warnings)
}
