//! VTKHDF: points and their data as VTK's writers keep them in HDF5, of one step or of several behind each other.
//!
//! `VTKHDF/Points` are the points of all pieces and steps, `VTKHDF/PointData` what they have; `VTKHDF/Steps` says where each step begins. Meshes count
//! by their points, as in other files of VTK. Source: docs.vtk.org, "VTKHDF File Format".

use std::ops::Range;

use tyndall::{Error, Progress, Result};

use super::columns::{self, Input, Run};
use super::data::Data;
use super::plain::{Beside, beside};
use super::tree::{Group, Tree};
use crate::read::{records, sections};
use crate::sequence::{Frame, Options};

const HINT: &str = "was the file written to its end?";

/// The group of the points, if the file is of this kind.
pub(super) fn root<'a>(tree: &'a Tree) -> Result<Option<Group<'a>>> {
    let Some(group) = tree.group("VTKHDF")? else { return Ok(None) };
    Ok(group.datasets()?.iter().any(|it| it == "Points").then_some(group))
}

fn points(tree: &Tree) -> Result<Group<'_>> {
    root(tree)?.ok_or_else(|| tree.fault("VTKHDF", "there are no Points", HINT))
}

/// How many steps there are: one where the file says nothing of steps.
pub(super) fn frames(tree: &Tree) -> Result<usize> {
    let Some(steps) = points(tree)?.group("Steps")? else { return Ok(1) };
    let count = steps.attributes()?.number("NSteps").unwrap_or(0.0);
    if !(count >= 1.0 && count <= tree.bytes() as f64) {
        return Err(tree.fault("VTKHDF/Steps", format!("NSteps is {count}"), HINT));
    }
    Ok(count as usize)
}

/// Whole numbers of a data set, which begin with those of the steps.
fn whole(data: Option<Data>) -> Result<Vec<usize>> {
    let Some(data) = data.filter(|it| it.shape().len() == 1 && it.is_number()) else { return Ok(Vec::new()) };
    Ok(data.rows(&[])?.numbers()?.into_iter().map(|it| it.max(0.0) as usize).collect())
}

/// The rows of a step.
struct Step<'a> {
    points: Range<usize>,
    steps: Group<'a>,
}

/// The rows of step `number`; `None` where the file says nothing of steps.
fn step<'a>(tree: &Tree, group: &Group<'a>, number: usize) -> Result<Option<Step<'a>>> {
    let Some(steps) = group.group("Steps")? else { return Ok(None) };
    let counts = whole(group.dataset("NumberOfPoints")?)?;
    let at = |name: &str| -> Result<Option<usize>> { Ok(whole(steps.dataset(name)?)?.get(number).copied()) };
    let fault = |what: &str| Error::format(tree.path(), "VTKHDF/Steps", what, HINT);
    let first_part = at("PartOffsets")?.unwrap_or(number);
    let parts = at("NumberOfParts")?.unwrap_or(1);
    let counts = first_part.checked_add(parts).and_then(|end| counts.get(first_part..end));
    let count = counts
        .ok_or_else(|| fault("a step has pieces that are not there"))?
        .iter()
        .fold(0, |sum: usize, it| sum.saturating_add(*it));
    let start =
        at("PointOffsets")?.ok_or_else(|| fault("it is not said where the points of a step begin"))?;
    Ok(Some(Step { points: start..start.saturating_add(count), steps }))
}

/// Reads step `number`.
pub(super) fn frame(tree: &Tree, number: usize, options: &Options, progress: &dyn Progress) -> Result<Frame> {
    let group = points(tree)?;
    let positions = group
        .dataset("Points")?
        .ok_or_else(|| tree.fault("VTKHDF", "there are no Points", HINT))?
        .rows(&[])?;
    let step = step(tree, &group, number)?;
    let total = positions.count;
    let rows = step.as_ref().map_or(0..total, |it| it.points.clone());
    let beyond = |path: &str| tree.fault(path, "a step has more points than there are", HINT);
    let positions = positions.within(rows.clone()).ok_or_else(|| beyond("VTKHDF/Points"))?;
    let count = rows.len();
    let offsets = match &step {
        Some(step) => step.steps.group("PointDataOffsets")?,
        None => None,
    };
    let place = |name: &str, shape: &[u64]| -> Result<Option<(Vec<u64>, Range<usize>)>> {
        let Some(&length) = shape.first() else { return Ok(None) };
        let own = match &offsets {
            Some(offsets) => whole(offsets.dataset(name)?)?.get(number).copied(),
            None => None,
        };
        let start = own.unwrap_or(rows.start);
        let end = start.checked_add(count).filter(|&end| end as u64 <= length);
        let whole = step.is_some() || length == total as u64;
        Ok(end.filter(|_| whole).map(|end| (Vec::new(), start..end)))
    };
    let found = match group.group("PointData")? {
        Some(data) => beside(&data, &[], &place)?,
        None => Beside::default(),
    };
    let Beside { columns, values, left_out, mut warnings } = found;
    let flags = sections::flags(&columns, options.wanted.as_ref());
    let (columns, values) = (sections::flagged(columns, &flags), sections::flagged(values, &flags));
    let run = Run { count, positions: Input::Rows(positions), values };
    let mut gathered = columns::gather(tree.path(), &columns, &[run], None, tree.bytes(), progress)?;
    if let Some(step) = &step
        && let Some(times) =
            step.steps.dataset("Values")?.filter(|it| it.shape().len() == 1 && it.is_number())
    {
        gathered.time = times.rows(&[])?.numbers()?.get(number).copied();
    }
    if !left_out.is_empty() {
        warnings.push(format!("left out: {} (no {count} rows of numbers)", left_out.join(", ")));
    }
    records::frame(gathered, Vec::new(), warnings)
}
