//! H5MD 1.1: trajectories, a group of particles in `particles`, an element (`position`, `velocity`, …) for each quantity.
//!
//! An element is a data set, the same in all frames, or a group of `value`, `step` and `time`, one row a frame. Frames are those
//! of the positions; another element has the row of the same step, or the last before it. Positions are as in the file: `image`
//! is an attribute, not applied. Source: de Buyl, Colberg, Höfling, "H5MD: a structured, efficient, and portable file format
//! for molecular data", 2014, and nongnu.org/h5md.

use tyndall::particles::{Attribute, Values};
use tyndall::{Cell, DVec3, Progress, Result};

use super::attributes::Attributes;
use super::columns::{self, Input, Run};
use super::connectivity;
use super::data::Data;
use super::tree::{Group, Tree};
use crate::read::records;
use crate::read::sections::{self, Column};
use crate::sequence::{Frame, Options};

/// A quantity: its value, and at which steps it was taken if it changes.
pub(super) struct Element<'a> {
    pub(super) value: Data,
    /// The group of a quantity that changes.
    series: Option<Group<'a>>,
}

impl<'a> Element<'a> {
    pub(super) fn find(parent: &Group<'a>, name: &str) -> Result<Option<Self>> {
        if let Some(value) = parent.dataset(name)? {
            return Ok(Some(Self { value, series: None }));
        }
        let Some(series) = parent.group(name)? else { return Ok(None) };
        Ok(series.dataset("value")?.map(|value| Self { value, series: Some(series) }))
    }

    /// The indices before that of the particles: the row of frame `frame` of the positions, taken at `step`.
    pub(super) fn lead(&self, frame: usize, step: Option<f64>) -> Result<Vec<u64>> {
        let Some(series) = &self.series else { return Ok(Vec::new()) };
        let rows = self.value.shape().first().copied().unwrap_or(0);
        let steps = steps(series, "step", rows)?;
        let row = match (step, steps) {
            // The same step, or the last one before it.
            (Some(step), Some(steps)) => steps.iter().rposition(|it| *it <= step).unwrap_or(0),
            _ => frame.min((rows as usize).saturating_sub(1)),
        };
        Ok(vec![row as u64])
    }

    /// Numbers a row, of a list of rows of numbers.
    pub(super) fn width(&self) -> Option<u64> {
        let shape = self.value.shape();
        let dimensions = if self.series.is_some() { 3 } else { 2 };
        (shape.len() == dimensions && self.value.is_number()).then(|| shape[dimensions - 1])
    }

    /// The attributes of the group of a quantity that changes, else of its data set.
    pub(super) fn attributes(&self) -> Result<Attributes> {
        match &self.series {
            Some(series) => series.attributes(),
            None => Ok(self.value.attributes()),
        }
    }

    fn unit(&self) -> Option<String> {
        let unit = self.value.attributes().text("unit").filter(|it| !it.is_empty())?;
        Some(if matches!(unit.as_str(), "Angstrom" | "angstrom") { "Å".to_string() } else { unit })
    }
}

/// The steps or times of a series of `rows` rows: a number each, or an increment from an offset.
fn steps(series: &Group, name: &str, rows: u64) -> Result<Option<Vec<f64>>> {
    let Some(data) = series.dataset(name)?.filter(|it| it.is_number()) else { return Ok(None) };
    if rows > data.file_bytes() {
        return Ok(None);
    }
    let offset = data.attributes().number("offset").unwrap_or(0.0);
    if data.shape().is_empty() {
        let Some(increment) = data.number()? else { return Ok(None) };
        return Ok(Some((0..rows).map(|row| offset + increment * row as f64).collect()));
    }
    let steps = data.rows(&[])?.numbers()?;
    Ok((steps.len() as u64 == rows).then_some(steps))
}

/// A group of particles.
struct Chosen<'a> {
    group: Group<'a>,
    /// Its name in `particles`.
    name: String,
    /// The names of the groups that are not shown.
    others: Vec<String>,
}

/// The group of particles that is shown.
fn particles<'a>(tree: &'a Tree, options: &Options) -> Result<Chosen<'a>> {
    let hint = "H5MD keeps them in particles/NAME/position";
    let all =
        tree.group("particles")?.ok_or_else(|| tree.fault("", "there is no group 'particles'", hint))?;
    let mut groups = Vec::new();
    for name in all.groups()? {
        let Some(group) = all.group(&name)? else { continue };
        if Element::find(&group, "position")?.is_some() {
            groups.push((name, group));
        }
    }
    let names: Vec<String> = groups.iter().map(|it| it.0.clone()).collect();
    let place = match &options.dataset {
        Some(wanted) => {
            let wanted = wanted.trim_matches('/');
            let is_wanted = |name: &String| name == wanted || format!("particles/{name}") == wanted;
            Some(names.iter().position(is_wanted).ok_or_else(|| {
                tyndall::Error::setting("dataset", wanted, format!("one of {}", names.join(", ")))
            })?)
        }
        None => names.iter().position(|it| it == "all").or((!names.is_empty()).then_some(0)),
    };
    let place = place.ok_or_else(|| tree.fault("particles", "no group here has positions", hint))?;
    let others = names.iter().enumerate().filter(|it| it.0 != place).map(|it| it.1.clone()).collect();
    let (name, group) = groups.swap_remove(place);
    Ok(Chosen { group, name, others })
}

/// How many frames the positions have.
pub(super) fn frames(tree: &Tree, options: &Options) -> Result<usize> {
    let Chosen { group, .. } = particles(tree, options)?;
    let positions = Element::find(&group, "position")?.expect("the group was chosen for its positions");
    let rows = positions.value.shape().first().copied().unwrap_or(0);
    if rows > tree.bytes() {
        let what = format!("{rows} frames in a file of {} bytes", tree.bytes());
        return Err(tree.fault("particles", what, "was the file copied to its end?"));
    }
    Ok(if positions.series.is_some() { rows as usize } else { 1 })
}

/// Reads a frame.
pub(super) fn frame(tree: &Tree, frame: usize, options: &Options, progress: &dyn Progress) -> Result<Frame> {
    let Chosen { group, name: group_name, others } = particles(tree, options)?;
    let positions = Element::find(&group, "position")?.expect("the group was chosen for its positions");
    let frames = positions.value.shape().first().copied().unwrap_or(0);
    let at = |name: &str| -> Result<Option<f64>> {
        let Some(series) = &positions.series else { return Ok(None) };
        Ok(steps(series, name, frames)?.and_then(|it| it.get(frame).copied()))
    };
    let (step, time) = (at("step")?, at("time")?);
    let length_unit = positions.unit();
    let lead = if positions.series.is_some() { vec![frame as u64] } else { Vec::new() };
    let path = positions.value.path().to_string();
    let rows = positions.value.rows(&lead)?;
    if rows.width > 3 {
        return Err(tree.fault(
            path,
            format!("{} coordinates a particle", rows.width),
            "one to three can be shown",
        ));
    }
    let count = rows.count;

    let (mut columns, mut values, mut warnings) = (Vec::new(), Vec::new(), Vec::new());
    let mut words = Vec::new();
    for name in group.datasets()?.into_iter().chain(group.groups()?) {
        if name == "position" || name == "box" {
            continue;
        }
        let Some(element) = Element::find(&group, &name)?.filter(|it| it.value.is_number()) else { continue };
        if connectivity::is_own(&name, &element) {
            continue;
        }
        let lead = element.lead(frame, step)?;
        if element.value.shape().get(lead.len()) != Some(&(count as u64)) {
            warnings.push(format!("left out: '{name}' does not have {count} rows, one a particle"));
            continue;
        }
        let (unit, names) = (element.unit(), element.value.words());
        let rows = match element.value.quantity(&lead)? {
            Ok(rows) => rows,
            Err(why) => {
                warnings.push(format!("left out: '{name}' ({why})"));
                continue;
            }
        };
        words.push(if rows.width == 1 { names } else { Vec::new() });
        columns.push(Column { unit, ..Column::new(name, rows.width) });
        values.push(Input::Rows(rows));
    }

    let has_image = columns.iter().any(|it| it.name == "image");
    // Bonds are between ids.
    let flags = sections::flags(&columns, options.wanted.as_ref());
    let flags: Vec<bool> = columns.iter().zip(flags).map(|(it, flag)| flag || it.name == "id").collect();
    let (columns, values) = (sections::flagged(columns, &flags), sections::flagged(values, &flags));
    let words = sections::flagged(words, &flags);

    let cell = cell(&group, frame, step)?;
    let run = Run { count, positions: Input::Rows(rows), values };
    let middle = cell.map(|it| it.center());
    let mut gathered = columns::gather(tree.path(), &columns, &[run], middle, tree.bytes(), progress)?;
    for (attribute, names) in gathered.attributes.iter_mut().zip(words).filter(|it| !it.1.is_empty()) {
        spell_out(attribute, &names);
    }
    gathered.cell = cell;
    gathered.time = time.or(step);
    gathered.time_unit = match (time, &positions.series) {
        (Some(_), Some(series)) => series.dataset("time")?.and_then(|it| it.attributes().text("unit")),
        (None, Some(_)) => Some("step".to_string()),
        (_, None) => None,
    };
    gathered.length_unit = length_unit;

    let of = connectivity::Of { group: &group, name: &group_name, others: &others, frame, step };
    let ids = gathered.attributes.iter().find(|it| it.name == "id");
    let found = connectivity::bonds(tree, of, count, ids)?;
    let mut conventions = found.conventions();
    warnings.extend(found.warnings());
    gathered.bonds = found.bonds;
    if has_image {
        conventions.push("image: kept as an attribute, not applied to the positions".to_string());
    }
    if !others.is_empty() {
        warnings.push(format!(
            "left out: {}; --dataset NAME shows another group of particles",
            others.iter().map(|it| format!("particles/{it}")).collect::<Vec<_>>().join(", ")
        ));
    }
    records::frame(gathered, conventions, warnings)
}

/// Makes words of the numbers of an enumeration.
fn spell_out(attribute: &mut Attribute, words: &[(i64, String)]) {
    let numbers: Vec<f64> = (0..attribute.values.len()).map(|place| attribute.values.number(place)).collect();
    let mut names: Vec<String> = words.iter().map(|it| it.1.clone()).collect();
    let place = |number: &f64| words.iter().position(|it| it.0 as f64 == *number);
    let codes: Option<Vec<u32>> = numbers.iter().map(|it| place(it).map(|place| place as u32)).collect();
    // Numbers without a word stay numbers.
    if let Some(codes) = codes {
        names.shrink_to_fit();
        attribute.values = Values::Text { codes, names };
    }
}

/// The cell: edges of a box or its vectors, the same in all frames or one a frame.
fn cell(group: &Group, frame: usize, step: Option<f64>) -> Result<Option<Cell>> {
    let Some(cell) = group.group("box")? else { return Ok(None) };
    let Some(edges) = Element::find(&cell, "edges")? else { return Ok(None) };
    let lead = edges.lead(frame, step)?;
    let shape = &edges.value.shape()[lead.len().min(edges.value.shape().len())..];
    let matrix = shape.len() == 2;
    let dimension = shape.first().copied().unwrap_or(0) as usize;
    if !(1..=3).contains(&dimension) || (matrix && shape[1] != shape[0]) || shape.len() > 2 {
        return Ok(None);
    }
    let numbers = edges.value.rows(&lead)?.numbers()?;
    let mut vectors = [DVec3::ZERO; 3];
    for (row, vector) in vectors.iter_mut().enumerate().take(dimension) {
        for axis in 0..dimension {
            vector[axis] = match matrix {
                true => numbers[row * dimension + axis],
                false if row == axis => numbers[axis],
                false => 0.0,
            };
        }
    }
    let mut boundary = cell.attributes()?.texts("boundary");
    if boundary.is_empty() {
        boundary = cell.dataset("boundary")?.map_or(Vec::new(), |it| it.texts());
    }
    let periodic = std::array::from_fn(|axis| boundary.get(axis).is_some_and(|it| it == "periodic"));
    let is_finite = vectors.iter().all(|it| it.is_finite());
    Ok(is_finite.then_some(Cell { origin: DVec3::ZERO, vectors, periodic }))
}
