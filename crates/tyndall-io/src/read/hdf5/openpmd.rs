//! openPMD 1 and 2: series of iterations, a group for each species of particles, a record for each quantity.
//!
//! A record is a data set, or a group with a component for each axis; a component that is the same for all particles is a group
//! with `value` and `shape`. What is stored times `unitSI` is the value in SI units, which is what is read; positions are
//! `position` plus `positionOffset`. The BeamPhysics extension may have its particles at the root.
//! Source: the openPMD standard, github.com/openPMD/openPMD-standard.

use tyndall::{Error, Progress, Result};

use super::attributes::Attributes;
use super::columns::{self, Input, Run, Term};
use super::tree::{Group, Tree};
use crate::read::records;
use crate::read::sections::{self, Column};
use crate::read::snapshot;
use crate::sequence::{Frame, Options};

/// The components of a vector, in order.
const AXES: [&str; 3] = ["x", "y", "z"];

/// What the file is called.
pub(super) fn title(tree: &Tree) -> Result<String> {
    let version = tree.root()?.attributes()?.text("openPMD").unwrap_or_default();
    Ok(format!("openPMD {version} HDF5"))
}

/// The paths of the iterations, in order of their numbers. The root where iterations have no groups.
fn iterations(tree: &Tree) -> Result<Vec<String>> {
    let base = tree.root()?.attributes()?.text("basePath").unwrap_or_else(|| "/data/%T/".to_string());
    let Some((before, after)) = base.split_once("%T") else { return Ok(vec![base]) };
    let Some(parent) = tree.group(before)? else { return Ok(Vec::new()) };
    let mut numbers: Vec<(u64, String)> = parent
        .groups()?
        .into_iter()
        .filter_map(|name| Some((name.parse().ok()?, format!("{before}{name}{after}"))))
        .collect();
    numbers.sort();
    Ok(numbers.into_iter().map(|it| it.1).collect())
}

/// How many iterations there are.
pub(super) fn frames(tree: &Tree) -> Result<usize> {
    Ok(iterations(tree)?.len())
}

/// The species of an iteration, with their names.
fn species<'a>(tree: &'a Tree, iteration: &str) -> Result<Vec<(String, Group<'a>)>> {
    let folder = tree.root()?.attributes()?.text("particlesPath").unwrap_or_else(|| "particles/".to_string());
    let path = format!("{iteration}/{folder}");
    let Some(parent) = tree.group(&path)? else { return Ok(Vec::new()) };
    let has_positions =
        |group: &Group| -> Result<bool> { Ok(group.groups()?.iter().any(|it| it == "position")) };
    if has_positions(&parent)? {
        let attributes = parent.attributes()?;
        let name = attributes.text("speciesType").unwrap_or_else(|| "particles".to_string());
        return Ok(vec![(name, parent)]);
    }
    let mut species = Vec::new();
    for name in parent.groups()? {
        if let Some(group) = parent.group(&name)?
            && has_positions(&group)?
        {
            species.push((name, group));
        }
    }
    Ok(species)
}

/// A component of a record.
enum Component {
    /// A number for each particle, times a factor.
    Each(super::rows::Rows, f64),
    /// The same for all: the value in SI units, and for how many particles.
    All(f64, Option<usize>),
}

impl Component {
    fn find(record: &Group, name: &str) -> Result<Option<Self>> {
        if let Some(data) = record.dataset(name)?.filter(|it| it.is_number()) {
            let factor = data.attributes().number("unitSI").unwrap_or(1.0);
            return Ok(Some(Self::Each(data.rows(&[])?, factor)));
        }
        let Some(constant) = record.group(name)? else { return Ok(None) };
        Ok(Self::constant(&constant.attributes()?))
    }

    fn constant(attributes: &Attributes) -> Option<Self> {
        let value = attributes.number("value")?;
        let count = attributes.number("shape").map(|it| it as usize);
        Some(Self::All(value * attributes.number("unitSI").unwrap_or(1.0), count))
    }

    fn count(&self) -> Option<usize> {
        match self {
            Self::Each(rows, _) => Some(rows.count),
            Self::All(_, count) => *count,
        }
    }

    fn term(self) -> Term {
        match self {
            Self::Each(rows, factor) => Term::Rows(rows, factor),
            Self::All(value, _) => Term::All(value),
        }
    }
}

/// Reads an iteration.
pub(super) fn frame(tree: &Tree, number: usize, options: &Options, progress: &dyn Progress) -> Result<Frame> {
    let iterations = iterations(tree)?;
    let iteration = iterations
        .get(number)
        .ok_or_else(|| tree.fault("", "the iteration is gone", "was the file changed?"))?;
    let all = species(tree, iteration)?;
    if all.is_empty() {
        let what = "no species of particles has positions here";
        return Err(tree.fault(iteration.as_str(), what, "does the series have meshes only?"));
    }
    let names: Vec<&str> = all.iter().map(|it| it.0.as_str()).collect();
    let mut wanted = vec![options.types.is_none(); all.len()];
    for word in options.types.iter().flatten().map(|it| it.trim()) {
        let place = names.iter().position(|name| name.eq_ignore_ascii_case(word));
        let place = place.or_else(|| word.parse().ok().filter(|&place| place < names.len()));
        let place =
            place.ok_or_else(|| Error::setting("type", word, format!("one of {}", names.join(", "))))?;
        wanted[place] = true;
    }
    let chosen: Vec<&(String, Group)> = all.iter().zip(&wanted).filter(|it| *it.1).map(|it| it.0).collect();

    let mut columns: Vec<Column> = Vec::new();
    for (_, group) in &chosen {
        for column in columns_of(group)? {
            if !columns.iter().any(|it| it.name == column.name) {
                columns.push(column);
            }
        }
    }
    let flags = sections::flags(&columns, options.wanted.as_ref());
    let columns = sections::flagged(columns, &flags);
    let runs = chosen.iter().map(|it| run(tree, &it.1, &columns)).collect::<Result<Vec<_>>>()?;
    let mut gathered = columns::gather(tree.path(), &columns, &runs, None, tree.bytes(), progress)?;
    if all.len() > 1 {
        let kinds = chosen.iter().zip(&runs).map(|(species, run)| (species.0.as_str(), run.count));
        gathered.attributes.insert(0, snapshot::type_attribute(kinds));
    }
    gathered.length_unit = Some("m".to_string());
    if let Some(group) = tree.group(iteration)? {
        let attributes = group.attributes()?;
        let unit = attributes.number("timeUnitSI").unwrap_or(1.0);
        gathered.time = attributes.number("time").map(|it| it * unit);
        gathered.time_unit = gathered.time.map(|_| "s".to_string());
    }
    let convention = "values are in SI units: what is stored times unitSI".to_string();
    records::frame(gathered, vec![convention], Vec::new())
}

/// Whether a member of a species is a quantity of its own.
fn is_quantity(name: &str) -> bool {
    !matches!(name, "position" | "positionOffset" | "particlePatches")
}

/// The columns of a species: data sets, constant records, and records with components.
fn columns_of(group: &Group) -> Result<Vec<Column>> {
    let mut columns = Vec::new();
    for name in group.datasets()?.into_iter().filter(|it| is_quantity(it)) {
        if let Some(data) = group.dataset(&name)?.filter(|it| it.is_number() && it.shape().len() == 1) {
            columns.push(Column { unit: unit(&data.attributes()), ..Column::new(name, 1) });
        }
    }
    for name in group.groups()?.into_iter().filter(|it| is_quantity(it)) {
        let Some(record) = group.group(&name)? else { continue };
        let attributes = record.attributes()?;
        let components = axes(&record)?.len();
        if attributes.number("value").is_some() {
            columns.push(Column { unit: unit(&attributes), ..Column::new(name, 1) });
        } else if components > 0 {
            let own = match record.dataset(axes(&record)?[0])? {
                Some(data) => unit(&data.attributes()),
                None => None,
            };
            columns.push(Column { unit: unit(&attributes).or(own), ..Column::new(name, components) });
        }
    }
    Ok(columns)
}

/// The axes that a record has components for.
fn axes(record: &Group) -> Result<Vec<&'static str>> {
    let (sets, groups) = (record.datasets()?, record.groups()?);
    Ok(AXES.into_iter().filter(|axis| sets.iter().chain(&groups).any(|it| it == axis)).collect())
}

/// Where a species has its positions and columns.
fn run(tree: &Tree, group: &Group, columns: &[Column]) -> Result<Run> {
    let record = group.group("position")?.expect("species are chosen for their positions");
    let offsets = group.group("positionOffset")?;
    let (mut count, mut sums) = (None, Vec::new());
    for axis in AXES {
        let mut terms = Vec::new();
        for record in [Some(&record), offsets.as_ref()].into_iter().flatten() {
            if let Some(component) = Component::find(record, axis)? {
                count = count.or(component.count());
                terms.push(component.term());
            }
        }
        sums.push(terms);
    }
    let count = count.or(group.attributes()?.number("numParticles").map(|it| it as usize));
    let Some(count) = count else {
        return Err(tree.fault(record.path(), "no component has positions", "is it an openPMD file?"));
    };
    // All positions may be constant; then nothing in the file bounds their number but its own size.
    let each = sums.iter().flatten().any(|it| matches!(it, Term::Rows(..)));
    if !each && count as u64 > tree.bytes() {
        return Err(tree.fault(
            record.path(),
            format!("{count} particles at one place"),
            "is the file whole?",
        ));
    }
    let mut values = Vec::new();
    for column in columns {
        values.push(value(group, column)?);
    }
    Ok(Run { count, positions: Input::Sums(sums), values })
}

fn value(group: &Group, column: &Column) -> Result<Input> {
    let component = match Component::find(group, &column.name)? {
        Some(component) => component,
        None => {
            let Some(record) = group.group(&column.name)? else { return Ok(Input::Missing) };
            let axes = axes(&record)?;
            if axes.len() != column.components {
                return Ok(Input::Missing);
            }
            let mut sums = Vec::new();
            for axis in axes {
                sums.push(Component::find(&record, axis)?.map(Component::term).into_iter().collect());
            }
            return Ok(Input::Sums(sums));
        }
    };
    Ok(match component {
        _ if column.components != 1 => Input::Missing,
        // What is stored as it is keeps its type.
        Component::Each(rows, 1.0) => Input::Rows(rows),
        Component::Each(rows, factor) => Input::Sums(vec![vec![Term::Rows(rows, factor)]]),
        Component::All(value, _) => Input::All(value),
    })
}

/// The SI unit of a record, by the powers of the base units that it gives.
fn unit(attributes: &Attributes) -> Option<String> {
    const BASES: [&str; 7] = ["m", "kg", "s", "A", "K", "mol", "cd"];
    let powers = attributes.numbers("unitDimension");
    let factors = BASES.iter().zip(&powers).filter(|it| *it.1 != 0.0).map(|(base, power)| match power {
        1.0 => base.to_string(),
        power => format!("{base}^{power}"),
    });
    let unit = factors.collect::<Vec<_>>().join(" ");
    (!unit.is_empty()).then_some(unit)
}
