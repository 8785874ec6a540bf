//! PDB: atoms in fixed columns, models as frames, and the assemblies of REMARK 350.
//!
//! Frames end at ENDMDL or END, or where the next MODEL begins; what stands before a model belongs to it, so that each may have a
//! cell of its own. Serial numbers that ran over their columns are hybrid-36 or VMD's hexadecimal. Elements come from columns 77
//! and 78, else from the atom's name and where it stands. Alternate locations are all kept. Lengths are Å. A cell is taken where it
//! is that of a simulation: that of a crystal (space group other than P 1) holds more than the atoms of the file. Anisotropic displacement parameters are `U`.
//! Source: wwPDB, Atomic Coordinate Entry Format 3.3; hybrid-36 after R. W. Grosse-Kunstleve, cci.lbl.gov/hybrid_36.

mod displacements;
mod numbers;

use std::path::Path;

use rayon::prelude::*;
use tyndall::particles::{Attribute, Values};
use tyndall::scene::element::Element;
use tyndall::{Cell, Columns, DVec3, Error, Positions, Progress, Result};

use super::assembly::{self, Assembly, Group, Operator};
use super::column::{Column, Words};
use super::{Index, Request, Span, finish, molecules, rows};
use crate::sequence::{Frame, Options};

const HINT: &str = "write it again with the columns of the PDB format, or as mmCIF";
/// Records that files begin with.
const FIRST: [&[u8]; 18] = [
    b"HEADER", b"OBSLTE", b"TITLE ", b"SPLIT ", b"CAVEAT", b"COMPND", b"SOURCE", b"KEYWDS", b"EXPDTA",
    b"NUMMDL", b"AUTHOR", b"REVDAT", b"REMARK", b"SEQRES", b"CRYST1", b"MODEL ", b"ATOM  ", b"HETATM",
];

/// Whether the file begins like PDB: with one of its records, and with an atom in its columns if one is near.
pub(crate) fn recognise(head: &[u8]) -> bool {
    let mut lines = super::whole_lines(head).skip_while(|line| line.is_empty()).skip(1);
    let atom = super::whole_lines(head).find(|line| is_atom(line));
    // A word such as TITLE may also head a table: without an atom there has to be a second record.
    let second = || {
        lines
            .next()
            .is_some_and(|line| line.len() >= 6 && line[..6].iter().all(|it| !it.is_ascii_lowercase()))
    };
    begins(head) && super::is_text(head) && atom.map_or_else(second, |line| position(line).is_some())
}

/// Whether the first line is one of its records.
pub(super) fn begins(head: &[u8]) -> bool {
    let first = super::whole_lines(head).find(|line| !line.is_empty());
    first.is_some_and(|first| FIRST.iter().any(|it| first.starts_with(it) || first == it.trim_ascii_end()))
}

fn is_atom(line: &[u8]) -> bool {
    line.starts_with(b"ATOM  ") || line.starts_with(b"HETATM")
}

/// Columns `first..=last` of a line, counted from 1, without blanks around.
fn field(line: &[u8], first: usize, last: usize) -> &[u8] {
    line.get(first - 1..last.min(line.len())).unwrap_or_default().trim_ascii()
}

fn position(line: &[u8]) -> Option<DVec3> {
    let number = |first: usize| fast_float2::parse::<f64, _>(field(line, first, first + 7)).ok();
    Some(DVec3::new(number(31)?, number(39)?, number(47)?))
}

/// The lines of `text`, each with the place of its first byte, without their ends.
fn lines(text: &[u8]) -> impl Iterator<Item = (usize, &[u8])> {
    let mut place = 0;
    std::iter::from_fn(move || {
        let rest = text.get(place..).filter(|it| !it.is_empty())?;
        let end = memchr::memchr(b'\n', rest).unwrap_or(rest.len());
        let line = (place, rest[..end].trim_ascii_end());
        place += end + 1;
        Some(line)
    })
}

/// Finds the models.
pub(crate) fn index(path: &Path, bytes: &[u8], _: &Options) -> Result<Index> {
    let mut index = Index::default();
    let (mut start, mut start_line, mut line_number) = (0, 1, 0);
    let (mut has_atoms, mut is_model, mut ended, mut row_bytes) = (false, false, false, 0);
    // Whether models are known to have an end of their own.
    let mut closes_models = false;
    let mut last: &[u8] = b"";
    let close = |start: usize, end: usize, line: u64, index: &mut Index| {
        index.frames.push(Span { offset: start as u64, line, bytes: Some((end - start) as u64) });
    };
    for (place, line) in lines(bytes) {
        line_number += 1;
        let is_begin = line.starts_with(b"MODEL") && line.get(5).is_none_or(|it| *it == b' ');
        let is_end = line.starts_with(b"ENDMDL") || line == b"END";
        if is_atom(line) {
            (has_atoms, ended) = (true, false);
            row_bytes = row_bytes.max(line.len());
        }
        if is_begin && has_atoms {
            // The model before did not say where it ends.
            close(start, place, start_line, &mut index);
            (start, start_line, has_atoms) = (place, line_number, false);
        }
        is_model |= is_begin;
        if is_end {
            closes_models |= is_model;
            if has_atoms {
                let end = bytes.len().min(place + line.len() + 1);
                close(start, end, start_line, &mut index);
                (start, start_line) = (end, line_number + 1);
            }
            (has_atoms, ended, is_model) = (false, true, false);
        }
        last = line;
    }
    // What follows the last end is no frame: connections, or a count of the records.
    if has_atoms {
        let torn =
            !bytes.ends_with(b"\n") && is_atom(last) && (last.len() < row_bytes || position(last).is_none());
        let is_entry = bytes.starts_with(b"HEADER");
        index.cut = torn || is_model && closes_models;
        if !index.cut && is_entry && !ended {
            let what =
                "the file begins with a HEADER, but there is no END behind its last atom: it is cut off";
            return Err(Error::format(
                path,
                format!("line {line_number}"),
                what,
                "if it is whole, add a line END",
            ));
        }
        if !index.cut {
            let doubt = "no END follows the last atom, so nobody can tell whether it is the last one";
            index.doubt = Some(doubt.to_string());
            close(start, bytes.len(), start_line, &mut index);
        }
    }
    Ok(index)
}

/// Atoms while they are read.
#[derive(Default)]
struct Part {
    lines: u64,
    positions: Vec<DVec3>,
    serials: Vec<[u8; 5]>,
    names: Words,
    alternates: Words,
    residues: Words,
    chains: Words,
    residue_numbers: Vec<Option<i64>>,
    insertions: Words,
    occupancies: Vec<f32>,
    b_factors: Vec<f32>,
    segments: Words,
    groups: Words,
    /// What tells the element: see [`element`].
    keys: Words,
}

impl Part {
    /// Reads the atoms of a slice; on failure says in which line, counted from 0.
    fn read(slice: &[u8]) -> std::result::Result<Self, (u64, String)> {
        let mut part = Self::default();
        let number = |field: &[u8]| fast_float2::parse(field).unwrap_or(f32::NAN);
        for (_, line) in lines(slice) {
            part.lines += 1;
            if !is_atom(line) {
                continue;
            }
            let position = position(line).ok_or_else(|| {
                let what = "wanted coordinates of 8 columns each from column 31 on, found";
                (part.lines - 1, format!("{what} '{}'", rows::shortened(line.get(30..).unwrap_or_default())))
            })?;
            part.positions.push(position);
            let mut serial = [b' '; 5];
            serial.copy_from_slice(&line[6..11]);
            part.serials.push(serial);
            part.names.push(field(line, 13, 16));
            part.alternates.push(field(line, 17, 17));
            part.residues.push(field(line, 18, 21));
            part.chains.push(field(line, 22, 22));
            part.residue_numbers.push(numbers::hybrid36(&line[22..26]));
            part.insertions.push(field(line, 27, 27));
            part.occupancies.push(number(field(line, 55, 60)));
            part.b_factors.push(number(field(line, 61, 66)));
            part.segments.push(field(line, 73, 76));
            part.groups.push(line[..6].trim_ascii_end());
            let mut key = [b' '; 11];
            key[0] = line[0];
            key[1..5].copy_from_slice(&line[12..16]);
            key[5..9].copy_from_slice(&line[17..21]);
            let symbol = field(line, 77, 78);
            key[9..9 + symbol.len()].copy_from_slice(symbol);
            part.keys.push(&key);
        }
        Ok(part)
    }

    fn append(&mut self, other: Self) {
        self.serials.extend(other.serials);
        self.residue_numbers.extend(other.residue_numbers);
        self.occupancies.extend(other.occupancies);
        self.b_factors.extend(other.b_factors);
        let words = [
            (&mut self.names, &other.names),
            (&mut self.alternates, &other.alternates),
            (&mut self.residues, &other.residues),
            (&mut self.chains, &other.chains),
            (&mut self.insertions, &other.insertions),
            (&mut self.segments, &other.segments),
            (&mut self.groups, &other.groups),
            (&mut self.keys, &other.keys),
        ];
        for (words, more) in words {
            words.append(more);
        }
    }
}

/// The element of an atom, by the first letter of its record, its name in four columns, its residue in four, and its symbol in two.
fn element(key: &str) -> Option<Element> {
    let (record, name) = (key.get(..1)?, key.get(1..5)?);
    let (residue, symbol) = (key.get(5..9)?.trim(), key.get(9..)?.trim());
    let exact =
        |symbol: &str| Element::from_symbol(symbol).filter(|it| it.symbol().eq_ignore_ascii_case(symbol));
    if let Some(element) = exact(symbol).or_else(|| exact("H").filter(|_| symbol == "D")) {
        return Some(element);
    }
    // A name that begins in the first column is that of an element with two letters, unless it is a long name of hydrogen.
    let two = name.get(..2).filter(|it| it.bytes().all(|it| it.is_ascii_alphabetic()));
    let is_long = name.starts_with('H') && name.trim().len() == 4;
    let aligned = two.filter(|_| !is_long).and_then(exact);
    let is_ion = |element: &Element| {
        element.symbol().eq_ignore_ascii_case(residue.trim_matches(|it: char| !it.is_alphabetic()))
    };
    aligned.filter(|it| record == "H" || is_ion(it)).or_else(|| Element::from_atom_name(name))
}

/// Reads the model at `span`.
pub(crate) fn frame(
    path: &Path,
    bytes: &[u8],
    span: Span,
    request: &Request,
    progress: &dyn Progress,
) -> Result<Frame> {
    progress.begin("read", span.bytes, "B");
    let start = span.offset as usize;
    let text = bytes.get(start..start + span.bytes.unwrap_or_default() as usize);
    let text = text
        .ok_or_else(|| Error::format(path, "", "the model is not there any more", "was the file changed?"))?;
    let slices = rows::slices(text);
    let read = |slice: &&[u8]| {
        progress.advance(slice.len() as u64);
        if progress.cancelled() { None } else { Some(Part::read(slice)) }
    };
    let parts: Vec<_> = slices.par_iter().map(read).collect();
    let (mut all, mut positions) = (Part::default(), Positions::new());
    let mut line = span.line;
    for part in parts {
        let part = part
            .ok_or(Error::Interrupted)?
            .map_err(|(within, what)| Error::format(path, format!("line {}", line + within), what, HINT))?;
        line += part.lines;
        positions.extend(&part.positions);
        all.append(part);
    }

    let mut conventions = vec!["lengths: Å (PDB convention)".to_string()];
    let before = |text| lines(text).map(|(_, line)| line).take_while(|line| !is_atom(line));
    // What stands before the first model holds for all, unless another says otherwise.
    let lattice = |line: &&[u8]| line.starts_with(b"CRYST1");
    let lattice = before(text).find(lattice).or_else(|| before(bytes).find(lattice));
    let cell = lattice.and_then(|line| simulation_cell(line, &mut conventions));
    let time = before(text).filter(|line| line.starts_with(b"TITLE")).find_map(|line| {
        let title = String::from_utf8_lossy(line).into_owned();
        title.rsplit_once("t=")?.1.split_whitespace().next()?.parse().ok()
    });
    let assemblies = assemblies(before(bytes));
    let bonds = connections(bytes, start, &all.serials);
    // Copies of an assembly are turned, tensors are not: there they are left out.
    let displacements = displacements::displacements(text, &all.serials);
    let displacements = displacements.filter(|_| request.options.assembly.is_none());
    let mut attributes = attributes(all);
    attributes.extend(displacements);
    let columns = Columns {
        positions,
        attributes,
        radii: None,
        cell,
        time,
        // GROMACS writes it.
        time_unit: time.map(|_| "ps".to_string()),
        length_unit: Some("Å".to_string()),
        bonds,
    };
    let columns = match &request.options.assembly {
        Some(wanted) => assembly::apply(columns, &assemblies, wanted, "chain")?,
        None => {
            conventions.extend(assembly::offer(&assemblies));
            columns
        }
    };
    finish(columns, conventions, Vec::new())
}

/// The bonds of the records CONECT from byte `start` on, between atoms with these serial numbers, as they are written. Numbers that come
/// twice, as in files of too many atoms, name none.
fn connections(bytes: &[u8], start: usize, serials: &[[u8; 5]]) -> Vec<[u32; 2]> {
    let Some(first) = memchr::memmem::find(&bytes[start..], b"\nCONECT") else { return Vec::new() };
    let places = numbers::places(serials);
    let place = |field: &[u8]| places.get(field).copied().flatten();
    let mut bonds = Vec::new();
    for (_, line) in lines(&bytes[start + first..]).filter(|(_, line)| line.starts_with(b"CONECT")) {
        let Some(one) = place(field(line, 7, 11)) else { continue };
        let others = [12, 17, 22, 27].into_iter().filter_map(|at| place(field(line, at, at + 4)));
        bonds.extend(others.map(|other| [one, other]));
    }
    bonds
}

/// The columns; those that are empty everywhere are left out.
fn attributes(part: Part) -> Vec<Attribute> {
    let text = |words: Words| Column::Text(words).into_values();
    let Values::Text { mut codes, names: keys } = text(part.keys) else { return vec![] };
    let mut symbols = Words::default();
    keys.iter().for_each(|key| symbols.push(element(key).map_or("", Element::symbol).as_bytes()));
    let Values::Text { codes: of_keys, names } = text(symbols) else { return vec![] };
    codes.iter_mut().for_each(|code| *code = of_keys[*code as usize]);
    let all = [
        ("id", numbers::serials(&part.serials)),
        ("name", text(part.names)),
        ("element", Values::Text { codes, names }),
        ("altloc", text(part.alternates)),
        ("resname", text(part.residues)),
        ("chain", text(part.chains)),
        ("resid", molecules::counted_on(&part.residue_numbers, 9999, 0)),
        ("icode", text(part.insertions)),
        ("occupancy", Values::F32(part.occupancies)),
        ("b_factor", Values::F32(part.b_factors)),
        ("segment", text(part.segments)),
        ("group", text(part.groups)),
    ];
    let optional = ["altloc", "icode", "segment", "chain"];
    let is_told = |(name, values): &(&str, Values)| match values {
        Values::Text { names, .. } => !optional.contains(name) || names.iter().any(|it| !it.is_empty()),
        Values::F32(values) => values.iter().any(|it| it.is_finite()),
        _ => true,
    };
    let told = all.into_iter().filter(is_told);
    told.map(|(name, values)| Attribute::new(name, 1, values)).collect()
}

/// The cell of CRYST1, if it is that of a simulation; says so if it is that of a crystal.
fn simulation_cell(line: &[u8], conventions: &mut Vec<String>) -> Option<Cell> {
    let number = |first: usize, last: usize| fast_float2::parse::<f64, _>(field(line, first, last)).ok();
    let lengths = [number(7, 15)?, number(16, 24)?, number(25, 33)?];
    let angles = [number(34, 40)?, number(41, 47)?, number(48, 54)?];
    // A cell of 1 Å is what stands where there is none.
    let cell = molecules::cell_of_angles(lengths, angles).filter(|_| lengths != [1.0; 3])?;
    let group = String::from_utf8_lossy(field(line, 56, 66)).into_owned();
    if !molecules::is_simple(&group) {
        conventions.push(molecules::crystal(&group));
        return None;
    }
    Some(cell)
}

/// The assemblies of REMARK 350. Its numbers stand between blanks: operators from 1000 on have a column more than the format gives them.
fn assemblies<'a>(lines: impl Iterator<Item = &'a [u8]>) -> Vec<Assembly> {
    let mut assemblies: Vec<Assembly> = Vec::new();
    // The rows of an operator while it is read.
    let mut rows: Vec<(DVec3, f64)> = Vec::new();
    let mut begins = true;
    let remarks = lines.filter_map(|line| line.strip_prefix(b"REMARK 350"));
    for line in remarks.map(String::from_utf8_lossy) {
        let line = line.trim();
        let chains = |list: &str| -> Vec<String> {
            let names = list.split([',', ' ']).filter(|it| !it.is_empty() && *it != "NULL");
            names.map(str::to_string).collect()
        };
        if let Some(name) = line.strip_prefix("BIOMOLECULE:") {
            assemblies.push(Assembly { name: name.trim().to_string(), groups: vec![] });
            begins = true;
        } else if let Some((what, list)) = line.split_once("CHAINS:") {
            if assemblies.is_empty() {
                assemblies.push(Assembly { name: "1".to_string(), groups: vec![] });
            }
            let groups = &mut assemblies.last_mut().expect("there is one now").groups;
            if !what.starts_with("AND") || groups.is_empty() {
                groups.push(Group { chains: vec![], operators: vec![] });
            }
            groups.last_mut().expect("there is one now").chains.extend(chains(list));
            begins = false;
        } else if let Some(row) = line.strip_prefix("BIOMT") {
            let axis = row.chars().next().and_then(|it| it.to_digit(10)).unwrap_or(0) as usize;
            let numbers: Vec<f64> =
                row.split_whitespace().skip(1).filter_map(|it| fast_float2::parse(it).ok()).collect();
            if axis == 1 {
                rows.clear();
            }
            if let &[_, x, y, z, shift] = &numbers[..] {
                rows.push((DVec3::new(x, y, z), shift));
            }
            if let (3, &[x, y, z]) = (axis, &rows[..]) {
                let operator = Operator { rows: [x.0, y.0, z.0], shift: DVec3::new(x.1, y.1, z.1) };
                if assemblies.is_empty() {
                    assemblies.push(Assembly { name: "1".to_string(), groups: vec![] });
                }
                let groups = &mut assemblies.last_mut().expect("there is one now").groups;
                if begins {
                    groups.push(Group { chains: vec![], operators: vec![] });
                    begins = false;
                }
                groups.last_mut().expect("there is one now").operators.push(operator);
            }
        }
    }
    assemblies
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::real_data::{self, words};

    const REMARKS: &str = "REMARK 350 BIOMOLECULE: 1\nREMARK 350 APPLY THE FOLLOWING TO CHAINS: A\n\
        REMARK 350   BIOMT1   1  1.000000  0.000000  0.000000        0.00000\n\
        REMARK 350   BIOMT2   1  0.000000  1.000000  0.000000        0.00000\n\
        REMARK 350   BIOMT3   1  0.000000  0.000000  1.000000        0.00000\n\
        REMARK 350   BIOMT1  1001 -1.000000  0.000000  0.000000       10.00000\n\
        REMARK 350   BIOMT2  1001  0.000000 -1.000000  0.000000        0.00000\n\
        REMARK 350   BIOMT3  1001  0.000000  0.000000  1.000000        0.00000\n\
        REMARK 350 BIOMOLECULE: 2\nREMARK 350 APPLY THE FOLLOWING TO CHAINS: A,\nREMARK 350                    AND CHAINS: B\n\
        REMARK 350   BIOMT1   1  1.000000  0.000000  0.000000        0.00000\n\
        REMARK 350   BIOMT2   1  0.000000  1.000000  0.000000        0.00000\n\
        REMARK 350   BIOMT3   1  0.000000  0.000000  1.000000        1.00000\n";
    const ATOMS: &str = "CRYST1   10.000   20.000   30.000  90.00  90.00  90.00 P 1           1\n\
        ATOM  99999  N   ALA A   1       1.000   2.000   3.000  1.00  9.50      PROA N\n\
        ATOM  A0000  CA AALA A   1A     -1.500   2.000   3.000  0.50  9.50      PROA\n\
        HETATMA0001 FE   HEM B9999      -1.500  -2.000   3.000\n\
        HETATMA0002 CA    CA BA000       0.000   0.000   0.000  1.00  9.50          CA\n";

    fn read(text: &str, assembly: Option<&str>) -> Result<Vec<Frame>> {
        let options = Options { assembly: assembly.map(str::to_string), ..Options::default() };
        real_data::frames(&real_data::recognised(ATOMS.as_bytes()).open, text.as_bytes(), &options)
    }

    #[test]
    fn connections_are_bonds_of_every_model_and_of_the_copies_of_an_assembly() {
        let bonds = "CONECTA000199999A0000\nCONECT99999A0001\nCONECTA0001A0009\nEND\n";
        let frames = read(&format!("{ATOMS}{bonds}"), None).unwrap();
        assert_eq!(frames[0].particles.bonds(), [[0, 2], [1, 2]]);
        let atoms = ATOMS.lines().skip(1).collect::<Vec<_>>().join("\n");
        let models = format!("MODEL        1\n{atoms}\nENDMDL\nMODEL        2\n{atoms}\nENDMDL\n{bonds}");
        let frames = read(&models, None).unwrap();
        assert_eq!(frames.len(), 2);
        assert!(frames.iter().all(|frame| frame.particles.bonds() == [[0, 2], [1, 2]]));
        // Of chain A alone, twice: bonds within it.
        let inside = "CONECT99999A0000A0001\n";
        let assembly = read(&format!("{REMARKS}{ATOMS}{inside}"), Some("1")).unwrap();
        assert_eq!(assembly[0].particles.bonds(), [[0, 1], [2, 3]]);
    }

    #[test]
    fn displacement_parameters_are_those_of_their_atoms() {
        let records = "ANISOUA0001 FE   HEM B9999     2406   1892   1614    198    519   -328      FE\nANISOUA0009 XX\n";
        let particles = &read(&format!("{ATOMS}{records}END\n"), None).unwrap()[0].particles;
        let tensors = particles.attribute("U").unwrap();
        assert_eq!((tensors.components, tensors.unit.as_deref()), (6, Some("Å²")));
        let found = [0, 1, 2, 3, 4, 5].map(|place| tensors.number(2, place));
        let expected = [0.2406, 0.1892, 0.1614, 0.0198, 0.0519, -0.0328];
        assert!(found.iter().zip(expected).all(|(found, wanted): (&f64, f64)| (found - wanted).abs() < 1e-7));
        assert!(tensors.number(1, 0).is_nan() && tensors.number(3, 5).is_nan());
        // Copies that are turned have none.
        let text = format!("{REMARKS}{ATOMS}{records}");
        assert!(read(&text, Some("1")).unwrap()[0].particles.attribute("U").is_none());
        assert!(read(ATOMS, None).unwrap()[0].particles.attribute("U").is_none());
    }

    #[test]
    fn columns_are_read_by_their_places() {
        let ended = format!("{ATOMS}END\n");
        for text in
            [ATOMS.to_string(), ATOMS.trim_end().to_string(), ended.clone(), ended.replace('\n', "\r\n")]
        {
            let frames = read(&text, None).unwrap();
            assert_eq!(frames.len(), 1);
            let particles = &frames[0].particles;
            assert_eq!(particles.positions().world(2), DVec3::new(-1.5, -2.0, 3.0));
            assert_eq!(
                particles.attribute("id").unwrap().values,
                Values::I32(vec![99_999, 100_000, 100_001, 100_002])
            );
            assert_eq!(particles.attribute("resid").unwrap().values, Values::I32(vec![1, 1, 9999, 10_000]));
            assert_eq!(words(particles, "name"), "N CA FE CA");
            assert_eq!(words(particles, "element"), "N C Fe Ca");
            assert_eq!(words(particles, "altloc"), " A  ");
            assert_eq!(words(particles, "icode"), " A  ");
            assert_eq!(words(particles, "segment"), "PROA PROA  ");
            assert_eq!(words(particles, "chain"), "A A B B");
            assert_eq!(words(particles, "group"), "ATOM ATOM HETATM HETATM");
            assert!(particles.attribute("occupancy").unwrap().number(2, 0).is_nan());
            assert_eq!(particles.cell().unwrap().vectors[1], 20.0 * DVec3::Y);
        }
        let crystal = read(&ATOMS.replace("P 1  ", "P 21 "), None).unwrap();
        assert!(crystal[0].particles.cell().is_none() && crystal[0].conventions[1].contains("P 21"));
        assert!(
            read(&ATOMS.replace("10.000   20.000   30.000", " 1.000    1.000    1.000"), None).unwrap()[0]
                .particles
                .cell()
                .is_none()
        );
    }

    #[test]
    fn models_are_frames_however_they_end() {
        let atom = |x: f64| format!("ATOM      1  O   HOH A   1    {x:8.3}   0.000   0.000  1.00  0.00\n");
        let count = |text: &str| {
            let frames = read(text, None).unwrap();
            frames.iter().map(|it| it.particles.positions().world(0).x).collect::<Vec<_>>()
        };
        let model = |number: u32, end: &str| format!("MODEL     {number:4}\n{}{end}", atom(number.into()));
        assert_eq!(
            count(&format!("TITLE     two\n{}{}END\n", model(1, "ENDMDL\n"), model(2, "ENDMDL\n"))),
            [1.0, 2.0]
        );
        assert_eq!(count(&format!("{}{}", model(1, "TER\n"), model(2, "TER\n"))), [1.0, 2.0]);
        assert_eq!(count(&format!("REMARK VMD\n{}END\n{}END\n", atom(1.0), atom(2.0))), [1.0, 2.0]);
        assert_eq!(
            count(&format!("REMARK x\n{}ENDMDL\n{}ENDMDL\nCONECT    1\nEND", atom(1.0), atom(2.0))),
            [1.0, 2.0]
        );
        let cell = |edge: f64| {
            format!(
                "TITLE     step t= {edge:.1}\nCRYST1 {edge:8.3} {edge:8.3} {edge:8.3}  90.00  90.00  90.00 P 1\n"
            )
        };
        let frames = read(
            &format!("{}{}{}{}", cell(5.0), model(1, "ENDMDL\n"), cell(6.0), model(2, "ENDMDL\n")),
            None,
        )
        .unwrap();
        let edges: Vec<f64> = frames.iter().map(|it| it.particles.cell().unwrap().vectors[0].x).collect();
        assert_eq!((edges, frames[1].particles.time()), (vec![5.0, 6.0], Some(6.0)));
    }

    #[test]
    fn assemblies_are_those_of_the_remarks() {
        let text = format!("{REMARKS}{ATOMS}");
        let frames = read(&text, None).unwrap();
        assert!(
            frames[0].conventions.iter().any(|it| it.contains("assembly 1 is made by 2 operators")),
            "{:?}",
            frames[0].conventions
        );
        let first = &read(&text, Some("1")).unwrap()[0].particles;
        assert_eq!((first.len(), first.positions().world(2)), (4, DVec3::new(9.0, -2.0, 3.0)));
        assert_eq!((first.attribute("operator").unwrap().values.number(3), first.cell()), (2.0, None));
        let second = &read(&text, Some("2")).unwrap()[0].particles;
        assert_eq!((second.len(), second.positions().world(3)), (4, DVec3::new(0.0, 0.0, 1.0)));
        assert_eq!(read(&text, Some("all")).unwrap()[0].particles.len(), 8);
        assert!(read(&text, Some("9")).is_err() && read(ATOMS, Some("1")).is_err());
    }

    #[test]
    fn what_is_wrong_or_cut_is_said() {
        let message = |text: &str| read(text, None).unwrap_err().to_string();
        let wrong = message(&ATOMS.replace("-2.000", "-2.x00"));
        assert!(wrong.contains("line 4") && wrong.contains("8 columns"), "{wrong}");
        assert!(message(&format!("HEADER    VIRUS\n{ATOMS}")).contains("add a line END"));
        let two = format!("MODEL        1\n{ATOMS}ENDMDL\n").repeat(2);
        for length in two.len() / 2 + 100..two.len() - 8 {
            let index = index(Path::new("test"), &two.as_bytes()[..length], &Options::default()).unwrap();
            assert_eq!((index.frames.len(), index.cut), (1, true), "{length}");
        }
        assert!(!recognise(b"TITLE,x,y,z\nword,1,2,3\n") && !recognise(b"REMARK\nthis is no protein\n"));
        assert!(recognise(b"HEADER    VIRUS\nREMARK 350\n"));
    }

    #[test]
    fn damage_never_panics() {
        let text = format!("{REMARKS}MODEL        1\n{ATOMS}ENDMDL\nEND\n");
        real_data::damage(text.as_bytes(), |file| {
            recognise(file);
            drop(read(&String::from_utf8_lossy(file), Some("all")));
        });
    }
}
