//! Snapshots of Gadget-2, -3 and -4, AREPO, GIZMO and SWIFT: a group `PartTypeN` for each type of particles.
//!
//! Every data set of a type with a row for each of its particles is a column under its own name; what another type lacks is
//! NaN there. A mass that stands in the header's `MassTable` only is the column `Masses`. Coordinates stay as they are in the
//! file, comoving and with h where it has them so; the conventions say the factors. A snapshot in several files is read as one.
//! Source: the users' guides of GADGET-4, AREPO and SWIFT, sections on snapshots.

use std::path::PathBuf;

use tyndall::{Cell, DVec3, Progress, Result};

use super::attributes::Attributes;
use super::columns::{self, Input, Run};
use super::data::Data;
use super::swift::Support;
use super::tree::{Group, Tree};
use crate::read::content;
use crate::read::map;
use crate::read::records;
use crate::read::sections::{self, Column};
use crate::read::snapshot::{self, GADGET_TYPES, TypeNames};
use crate::sequence::{Frame, Options};

/// SWIFT's types.
const SWIFT_TYPES: [TypeNames; 7] = [
    &["gas"],
    &["dark", "dm", "halo"],
    &["background"],
    &["sink", "sinks"],
    &["star", "stars"],
    &["black hole", "blackhole", "bh"],
    &["neutrino", "neutrinos"],
];

/// The number of a type, of the name of its group.
pub(super) fn type_number(group: &str) -> Option<usize> {
    let number = group.strip_prefix("PartType")?;
    number
        .parse()
        .ok()
        .filter(|number: &usize| *number < 64 && number.to_string() == group["PartType".len()..])
}

/// The program that wrote a file, by what only it writes.
struct Program {
    name: &'static str,
    types: &'static [TypeNames],
}

impl Program {
    fn of(tree: &Tree) -> Result<Self> {
        let header = header(tree)?;
        let root = tree.root()?.groups()?;
        let has = |name: &str| root.iter().any(|it| it == name);
        let code = header.text("Code").or(header.text("RunName")).unwrap_or_default();
        let units = match tree.group("Units")? {
            Some(units) => units.attributes()?.number("Unit length in cgs (U_L)"),
            None => None,
        };
        if code.contains("SWIFT") || units.is_some() {
            return Ok(Self { name: "SWIFT", types: &SWIFT_TYPES });
        }
        let voronoi = match tree.group("PartType0")? {
            Some(gas) => gas.datasets()?.iter().any(|it| it == "CenterOfMass"),
            None => false,
        };
        let config = match tree.group("Config")? {
            Some(config) => config.attributes()?.has("VORONOI"),
            None => false,
        };
        Ok(if header.has("GIZMO_version") {
            Self { name: "GIZMO", types: &GADGET_TYPES }
        } else if voronoi || config {
            Self { name: "AREPO", types: &GADGET_TYPES }
        } else if has("Parameters") && has("Config") {
            Self { name: "Gadget-4", types: &GADGET_TYPES }
        } else {
            Self { name: "Gadget", types: &GADGET_TYPES }
        })
    }
}

fn header(tree: &Tree) -> Result<Attributes> {
    match tree.group("Header")? {
        Some(header) => header.attributes(),
        None => Err(tree.fault("", "a snapshot without the group Header", "is it a snapshot?")),
    }
}

/// How many files the snapshot has.
fn file_count(header: &Attributes) -> usize {
    let count = header.number("NumFilesPerSnapshot").or(header.number("NumFiles"));
    count.filter(|it| *it >= 1.0).map_or(1, |it| it as usize)
}

/// The files of the snapshot, and what is to be said about those that are missing. A SWIFT snapshot may have a file beside its
/// parts that only points to them; its parts are then read.
fn files(tree: &Tree, options: &Options) -> Result<(Vec<PathBuf>, Option<String>)> {
    let header = header(tree)?;
    let count = file_count(&header);
    if header.number("Virtual") == Some(1.0) {
        let stem = tree.path().file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let first = tree.path().with_file_name(format!("{stem}.0.hdf5"));
        // The file itself counts as the only one; its parts know how many they are.
        let count = match first.exists() {
            true => {
                let content = content::content(&first)?;
                file_count(&self::header(&Tree::open(&first, content.as_ref())?)?)
            }
            false => count,
        };
        let (files, warning) = snapshot::files(&first, count, options.strict)?;
        let there: Vec<PathBuf> = files.into_iter().filter(|it| it.exists()).collect();
        if there.is_empty() {
            let what = format!(
                "this file only points to the snapshot's parts, and {} is not there",
                first.display()
            );
            return Err(tree.fault("", what, "put them beside it, or name them"));
        }
        return Ok((there, warning));
    }
    snapshot::files(tree.path(), count, options.strict)
}

/// What the file is called, and all files that belong to it.
pub(super) fn index(tree: &Tree, options: &Options) -> Result<(String, Vec<PathBuf>)> {
    let (files, _) = files(tree, options)?;
    let spread = if files.len() > 1 { format!(", {} files", files.len()) } else { String::new() };
    Ok((format!("{} HDF5{spread}", Program::of(tree)?.name), files))
}

/// A type's particles in one of the files.
struct Part<'a> {
    kind: usize,
    group: Group<'a>,
    count: usize,
    mass: f64,
}

/// Reads the particles of the wanted types, from all files.
pub(super) fn frame(tree: &Tree, options: &Options, progress: &dyn Progress) -> Result<Frame> {
    let program = Program::of(tree)?;
    let wanted = snapshot::wanted(options, program.types)?;
    let (paths, missing) = files(tree, options)?;
    let mut warnings: Vec<String> = missing.into_iter().collect();
    let others = paths.iter().filter(|it| *it != tree.path());
    let others: Vec<Tree> =
        others.map(|path| Tree::open(path, content::content(path)?.as_ref())).collect::<Result<_>>()?;
    let mut others = others.iter();
    let trees: Vec<&Tree> = paths
        .iter()
        .map(|path| if path == tree.path() { tree } else { others.next().expect("one a path") })
        .collect();

    let (mut parts, mut present) = (Vec::new(), Vec::new());
    for tree in &trees {
        for part in parts_of(tree)? {
            if part.count == 0 {
                continue;
            }
            present.push(part.kind);
            if wanted.get(part.kind).copied().unwrap_or(options.types.is_none()) {
                parts.push(part);
            }
        }
    }
    let name =
        |kind: usize| program.types.get(kind).map_or(format!("type {kind}"), |names| names[0].to_string());
    if parts.is_empty() && options.types.is_some() {
        present.sort_unstable();
        present.dedup();
        let present: Vec<String> = present.into_iter().map(name).collect();
        let present: Vec<&str> = present.iter().map(String::as_str).collect();
        return Err(snapshot::none_wanted(options, &present));
    }
    let columns = columns_of(&parts, &mut warnings)?;
    let mut support = match program.name {
        "SWIFT" => Support::of(tree, &columns)?,
        _ => None,
    };
    let flags = match &mut support {
        Some(support) => support.flags(&columns, options.wanted.as_ref()),
        None => sections::flags(&columns, options.wanted.as_ref()),
    };
    let columns = sections::flagged(columns, &flags);
    let runs = parts.iter().map(|part| run(tree, part, &columns)).collect::<Result<Vec<_>>>()?;

    let header = header(tree)?;
    let factors = Factors::of(tree, &header, parts.first())?;
    let cell = cell(&header);
    let total = trees.iter().map(|it| it.bytes()).sum();
    let middle = cell.map(|it| it.center());
    let others = trees.iter().filter(|it| !std::ptr::eq(**it, tree));
    let progress = &map::released(others.filter_map(|it| it.map()), progress);
    let mut gathered = columns::gather(tree.path(), &columns, &runs, middle, total, progress)?;
    let names: Vec<(String, usize)> = parts.iter().map(|part| (name(part.kind), part.count)).collect();
    let types = snapshot::type_attribute(names.iter().map(|(name, count)| (name.as_str(), *count)));
    gathered.attributes.insert(0, types);
    gathered.cell = cell;
    gathered.time = factors.a.or(header.number("Time"));
    gathered.time_unit = factors.a.map(|_| "a".to_string());
    gathered.length_unit = factors.length_unit();

    warnings.extend(disagreement(&header, &trees, &program)?);
    let mut conventions = vec![factors.convention()];
    let length = columns.iter().find(|it| it.name.starts_with("SmoothingLength"));
    conventions.extend(length.and_then(|length| match program.name {
        "SWIFT" => match support {
            Some(support) => support.add(&mut gathered.attributes),
            None => Some(format!(
                "{} are SWIFT's h: of a kernel that is not known, whose support is wider",
                length.name
            )),
        },
        _ => Some(format!("{} is the radius of the kernel's support, as in Gadget", length.name)),
    }));
    if cell.is_some() {
        conventions.push("BoxSize is taken as a cell that repeats, from 0 on".to_string());
    }
    if trees.len() > 1 {
        conventions.push(format!("{} files are read as one snapshot", trees.len()));
    }
    records::frame(gathered, conventions, warnings)
}

/// The types of a file, in order.
fn parts_of(tree: &Tree) -> Result<Vec<Part<'_>>> {
    let masses = header(tree)?.numbers("MassTable");
    let root = tree.root()?;
    let mut numbered: Vec<(usize, String)> =
        root.groups()?.into_iter().filter_map(|name| Some((type_number(&name)?, name))).collect();
    numbered.sort();
    let mut parts = Vec::new();
    for (kind, name) in numbered {
        let Some(group) = root.group(&name)? else { continue };
        let count = match group.dataset("Coordinates")? {
            Some(data) => data.shape().first().copied().unwrap_or(0) as usize,
            None => 0,
        };
        parts.push(Part { kind, group, count, mass: masses.get(kind).copied().unwrap_or(0.0) });
    }
    Ok(parts)
}

/// All columns of all parts. Says what is left out.
fn columns_of(parts: &[Part], warnings: &mut Vec<String>) -> Result<Vec<Column>> {
    let mut columns: Vec<Column> = Vec::new();
    for part in parts {
        let mut found = Vec::new();
        for name in part.group.datasets()?.into_iter().filter(|it| it != "Coordinates") {
            let Some(data) = part.group.dataset(&name)?.filter(|it| is_column(it, part.count)) else {
                continue;
            };
            let unit = unit(&data.attributes());
            match data.quantity(&[])? {
                Ok(rows) => found.push(Column { unit, ..Column::new(name, rows.width) }),
                Err(why) => {
                    let warning = format!("left out: {name} ({why})");
                    if !warnings.contains(&warning) {
                        warnings.push(warning);
                    }
                }
            }
        }
        if part.mass != 0.0 && !found.iter().any(|it| it.name == "Masses") {
            found.push(Column::new("Masses", 1));
        }
        found.retain(|column| !columns.iter().any(|it| it.name == column.name));
        columns.extend(found);
    }
    Ok(columns)
}

/// Whether a data set has numbers for each of `count` particles.
fn is_column(data: &Data, count: usize) -> bool {
    data.shape().first() == Some(&(count as u64)) && data.is_number()
}

/// Where a part has its columns.
fn run(tree: &Tree, part: &Part, columns: &[Column]) -> Result<Run> {
    let positions = part.group.dataset("Coordinates")?.expect("only parts with coordinates have particles");
    let (path, shape) = (positions.path().to_string(), positions.shape().to_vec());
    let positions = positions.rows(&[])?;
    if positions.width > 3 {
        let what = format!("coordinates of shape {shape:?} are not up to three for each particle");
        return Err(tree.fault(path, what, "is it a snapshot?"));
    }
    let value = |column: &Column| -> Result<Input> {
        let data = part.group.dataset(&column.name)?.filter(|it| is_column(it, part.count));
        match data {
            Some(data) => Ok(match data.quantity(&[])? {
                Ok(rows) if rows.width == column.components => Input::Rows(rows),
                _ => Input::Missing,
            }),
            None if column.name == "Masses" && part.mass != 0.0 => Ok(Input::All(part.mass)),
            None => Ok(Input::Missing),
        }
    };
    let values = columns.iter().map(value).collect::<Result<_>>()?;
    Ok(Run { count: part.count, positions: Input::Rows(positions), values })
}

fn cell(header: &Attributes) -> Option<Cell> {
    let edges = header.numbers("BoxSize");
    let edge = |axis: usize| edges.get(axis).or(edges.first()).copied().unwrap_or(0.0);
    let edges = DVec3::new(edge(0), edge(1), edge(2));
    (edges.is_finite() && edges.min_element() > 0.0).then(|| Cell {
        origin: DVec3::ZERO,
        vectors: [DVec3::X * edges.x, DVec3::Y * edges.y, DVec3::Z * edges.z],
        periodic: [true; 3],
    })
}

/// What is to be said where the files do not have as many particles as their header promises.
fn disagreement(header: &Attributes, trees: &[&Tree], program: &Program) -> Result<Option<String>> {
    let (low, high) = (header.numbers("NumPart_Total"), header.numbers("NumPart_Total_HighWord"));
    let mut found = vec![0.0; low.len()];
    for tree in trees {
        for part in parts_of(tree)? {
            if let Some(found) = found.get_mut(part.kind) {
                *found += part.count as f64;
            }
        }
    }
    let promised = |kind: usize| low[kind] + high.get(kind).map_or(0.0, |it| it * 2f64.powi(32));
    let differs = (0..low.len()).find(|&kind| promised(kind) != found[kind]);
    Ok(differs.map(|kind| {
        let name = program.types.get(kind).map_or("other", |names| names[0]);
        format!("the header promises {} particles of type {name}, {} are there", promised(kind), found[kind])
    }))
}

/// What turns the coordinates into physical ones.
#[derive(Debug, Default, PartialEq)]
struct Factors {
    /// The scale factor, of a universe that expands.
    a: Option<f64>,
    /// The Hubble parameter over 100 km/s/Mpc.
    h: Option<f64>,
    /// The powers of a and h by which coordinates are to be multiplied.
    powers: [f64; 2],
    /// The unit of lengths, in centimetres.
    centimetres: Option<f64>,
}

impl Factors {
    fn of(tree: &Tree, header: &Attributes, part: Option<&Part>) -> Result<Self> {
        let coordinates = match part {
            Some(part) => part.group.dataset("Coordinates")?.map(|it| it.attributes()),
            None => None,
        };
        let said = |names: &[&str]| {
            coordinates.as_ref().and_then(|it| names.iter().find_map(|name| it.number(name)))
        };
        let parameters = match tree.group("Parameters")? {
            Some(group) => Some(group.attributes()?),
            None => None,
        };
        let cosmology = match tree.group("Cosmology")? {
            Some(group) => Some(group.attributes()?),
            None => None,
        };
        let units = match tree.group("Units")? {
            Some(group) => Some(group.attributes()?),
            None => None,
        };
        let groups =
            || [Some(header), parameters.as_ref(), cosmology.as_ref(), units.as_ref()].into_iter().flatten();
        let number = |names: &[&str]| groups().find_map(|it| names.iter().find_map(|name| it.number(name)));
        let time = header.number("Time");
        let redshift = number(&["Redshift"]);
        let from_redshift = redshift.filter(|it| *it > -1.0).map(|redshift| 1.0 / (1.0 + redshift));
        // Gadget's time is the scale factor where it expands; elsewhere the redshift is 0 and says nothing.
        let expands = |a: &f64| {
            time.is_none_or(|time| (time - a).abs() < 1e-3 * a) || number(&["Scale-factor"]).is_some()
        };
        let flag = number(&["ComovingIntegrationOn", "Cosmological run"]);
        let is_static = flag == Some(0.0);
        let a = number(&["Scale-factor"]).or(from_redshift.filter(expands)).filter(|_| !is_static);
        let h = number(&["HubbleParam", "h"]).filter(|it| *it > 0.0);
        let usual = if a.is_some() && units.is_none() { [1.0, -1.0] } else { [0.0, 0.0] };
        let powers = [
            said(&["a-scale exponent", "aexp-scale-exponent", "a_scaling"]).unwrap_or(usual[0]),
            said(&["h-scale exponent", "h-scale-exponent", "h_scaling"]).unwrap_or(usual[1]),
        ];
        let centimetres = said(&[
            "Conversion factor to CGS (not including cosmological corrections)",
            "CGSConversionFactor",
            "to_cgs",
        ])
        .filter(|it| *it > 0.0)
        .or_else(|| number(&["Unit length in cgs (U_L)", "UnitLength_in_cm", "UnitLength_In_CGS"]));
        Ok(Self { a, h, powers, centimetres })
    }

    /// The unit of lengths: `kpc`, in a universe that expands `ckpc`, with h `ckpc/h`.
    fn length_unit(&self) -> Option<String> {
        let name = length_name(self.centimetres?)?;
        let comoving = if self.powers[0] == 1.0 { "c" } else { "" };
        let over_h = if self.powers[1] == -1.0 { "/h" } else { "" };
        Some(format!("{comoving}{name}{over_h}"))
    }

    fn convention(&self) -> String {
        let mut factors = Vec::new();
        if let (Some(a), true) = (self.a, self.powers[0] != 0.0) {
            factors.push(match self.powers[0] {
                1.0 => format!("a = {a:.6}"),
                power => format!("a^{power} with a = {a:.6}"),
            });
        }
        if let (Some(h), true) = (self.h, self.powers[1] != 0.0) {
            factors.push(match self.powers[1] {
                -1.0 => format!("1/h with h = {h}"),
                power => format!("h^{power} with h = {h}"),
            });
        }
        let known =
            if self.centimetres.is_some() { "" } else { "; the unit is not in the file, usual are kpc/h" };
        match factors.is_empty() {
            true => format!("coordinates as in the file{known}"),
            false => format!(
                "coordinates as in the file: physical ones are these times {}{known}",
                factors.join(" and ")
            ),
        }
    }
}

/// The name of a unit of length.
fn length_name(centimetres: f64) -> Option<&'static str> {
    const PARSEC: f64 = 3.085_677_58e18;
    let names = [
        (1e6 * PARSEC, "Mpc"),
        (1e3 * PARSEC, "kpc"),
        (PARSEC, "pc"),
        (1.495_978_707e13, "AU"),
        (6.957e10, "Rsun"),
        (6.371e8, "Rearth"),
        (1e5, "km"),
        (1e2, "m"),
        (1.0, "cm"),
    ];
    names.into_iter().find(|(size, _)| (centimetres / size - 1.0).abs() < 1e-3).map(|(_, name)| name)
}

/// The unit of a data set, where it is one that people know: SWIFT and Gadget-4 give exponents and a factor.
fn unit(attributes: &Attributes) -> Option<String> {
    let number = |names: [&str; 2]| names.into_iter().find_map(|name| attributes.number(name));
    let factor = number(["Conversion factor to CGS (not including cosmological corrections)", "to_cgs"])?;
    let [length, mass, time] = match attributes.number("U_L exponent") {
        Some(length) => [length, attributes.number("U_M exponent")?, attributes.number("U_t exponent")?],
        // Gadget-4 has a velocity in place of a time.
        None => {
            let velocity = attributes.number("velocity_scaling")?;
            [attributes.number("length_scaling")? + velocity, attributes.number("mass_scaling")?, -velocity]
        }
    };
    let name = match [length, mass, time] {
        [1.0, 0.0, 0.0] => length_name(factor)?.to_string(),
        [1.0, 0.0, -1.0] if (factor / 1e5 - 1.0).abs() < 1e-3 => "km/s".to_string(),
        [0.0, 1.0, 0.0] if (factor / 1.9885e43 - 1.0).abs() < 1e-3 => "10^10 Msun".to_string(),
        [0.0, 1.0, 0.0] if (factor / 1.9885e33 - 1.0).abs() < 1e-3 => "Msun".to_string(),
        _ => return None,
    };
    Some(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_are_numbered_groups() {
        assert_eq!(type_number("PartType0"), Some(0));
        assert_eq!(["PartType", "PartType01", "PartTypeX", "Header"].map(type_number), [None; 4]);
    }

    #[test]
    fn factors_are_said_in_words() {
        let comoving =
            Factors { a: Some(0.5), h: Some(0.7), powers: [1.0, -1.0], centimetres: Some(3.085_678e21) };
        assert_eq!(comoving.length_unit().unwrap(), "ckpc/h");
        assert!(
            comoving.convention().contains("a = 0.500000 and 1/h with h = 0.7"),
            "{}",
            comoving.convention()
        );
        assert_eq!(Factors::default().length_unit(), None);
        assert!(Factors::default().convention().contains("unit is not in the file"));
    }
}
