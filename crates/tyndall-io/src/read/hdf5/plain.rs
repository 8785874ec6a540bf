//! Plain HDF5: a data set of N rows of coordinates, or one for each axis, and beside it others with N rows.
//!
//! The positions are the data set that the caller names, else the one that is called like positions, else the only one of two or
//! three columns. H5Part keeps its frames in groups `Step#0`, `Step#1`, …: then each of these is a frame.

use std::collections::HashSet;

use tyndall::{Error, Progress, Result};

use super::columns::{self, Input, Run, Term};
use super::tree::{Data, Group, Tree};
use crate::read::records;
use crate::read::sections::{self, Column};
use crate::sequence::{Frame, Options};

/// What positions are called, best first.
const NAMES: [&str; 10] =
    ["coordinates", "positions", "position", "pos", "points", "xyz", "coords", "vertices", "x", "r"];
/// So deep are groups looked into.
const DEPTH: usize = 8;

/// Where the positions are.
#[derive(Clone, Debug, PartialEq)]
enum Place {
    /// A data set with a row for each particle: its group and name.
    Rows(String, String),
    /// Data sets for each axis: their group and names.
    Axes(String, [String; 3]),
}

impl Place {
    fn group(&self) -> &str {
        match self {
            Self::Rows(group, _) | Self::Axes(group, _) => group,
        }
    }

    /// How it is named to people.
    fn path(&self) -> String {
        let (group, name) = match self {
            Self::Rows(group, name) => (group, name.clone()),
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
        find(tree, "", options)?;
        return Ok((1, "HDF5".to_string()));
    }
    Ok((steps.len(), "H5Part HDF5".to_string()))
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
        Place::Axes(..) => Some(NAMES.len()),
        Place::Rows(_, name) => NAMES.iter().position(|it| it.eq_ignore_ascii_case(name)),
    };
    let best = places.iter().filter_map(rank).min();
    let candidates: Vec<&Place> = places.iter().filter(|it| best.is_none() || rank(it) == best).collect();
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
        for name in group.groups()? {
            if let Some(child) = group.group(&name)? {
                collect(&child, depth + 1, places, seen)?;
            }
        }
    }
    Ok(())
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
    let (names, positions, count) = match &place {
        Place::Rows(_, name) => {
            let rows = dataset(name)?.rows(&[])?;
            let count = rows.count;
            (vec![name.clone()], Input::Rows(rows), count)
        }
        Place::Axes(_, names) => {
            let rows = names.iter().map(|name| dataset(name)?.rows(&[])).collect::<Result<Vec<_>>>()?;
            let count = rows[0].count;
            let sums = rows.into_iter().map(|rows| vec![Term::Rows(rows, 1.0)]).collect();
            (names.to_vec(), Input::Sums(sums), count)
        }
    };

    let (mut columns, mut values, mut warnings) = (Vec::new(), Vec::new(), Vec::new());
    let mut left_out = Vec::new();
    for name in group.datasets()?.into_iter().filter(|it| !names.contains(it)) {
        let data = dataset(&name)?;
        if data.shape().first() != Some(&(count as u64)) || !data.is_number() {
            left_out.push(name);
            continue;
        }
        let attributes = data.attributes();
        let unit = ["unit", "units", "Unit", "Units"]
            .into_iter()
            .find_map(|it| attributes.text(it))
            .filter(|it| !it.is_empty());
        match data.quantity(&[])? {
            Ok(rows) => {
                columns.push(Column { unit, ..Column::new(name, rows.width) });
                values.push(Input::Rows(rows));
            }
            Err(why) => warnings.push(format!("left out: {name} ({why})")),
        }
    }
    let flags = sections::flags(&columns, options.wanted.as_ref());
    let (columns, values) = (sections::flagged(columns, &flags), sections::flagged(values, &flags));
    let run = Run { count, positions, values };
    let mut gathered = columns::gather(tree, &columns, &[run], None, tree.bytes(), progress)?;
    gathered.time = group.attributes()?.number("TimeValue").or(group.attributes()?.number("time"));
    let conventions = vec![format!("positions: data set {}", place.path())];
    if !left_out.is_empty() {
        warnings.push(format!("left out: {} (no {count} rows of numbers)", left_out.join(", ")));
    }
    records::frame(gathered, conventions, warnings)
}
