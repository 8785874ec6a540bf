//! AtomEye CFG, in its standard and its extended form: a header of `key = value`, then atoms at fractions of the cell's edges.
//!
//! In the extended form, which names further quantities, the mass and the element of the atoms that follow stand on lines of their own. Lengths
//! are those of `A` times the edges `H0`, in Å; velocities are in Å times the unit of `R`, 1/ns. Source: J. Li, AtomEye, "Standard CFG" and
//! "Extended CFG"; LAMMPS' dump style cfg.

use std::path::Path;

use glam::DMat3;
use tyndall::particles::{Attribute, Values};
use tyndall::{Columns, DVec3, Error, Positions, Progress, Result};

use super::column::{Column, Separator, Words};
use super::lines::Lines;
use super::{Index, Request, Span, finish, molecules, rows};
use crate::sequence::{Frame, Options};

const HINT: &str = "compare it with AtomEye's description of CFG";
/// So many lines are read between two looks at the progress.
const LINES: u64 = 1 << 16;
/// More quantities than this are a mistake.
const MOST_ENTRIES: usize = 1 << 12;

/// Whether the file begins like CFG.
pub(crate) fn recognise(head: &[u8]) -> bool {
    let mut lines =
        super::whole_lines(head).map(<[u8]>::trim_ascii).filter(|line| !line.is_empty() && line[0] != b'#');
    super::is_text(head) && lines.next().is_some_and(|line| line.starts_with(b"Number of particles"))
}

/// What stands before the atoms.
#[derive(Debug)]
struct Header {
    count: u64,
    edges: DMat3,
    /// What velocities are multiplied by.
    rate: f64,
    has_velocities: bool,
    /// Numbers an atom of the extended form has, and what those behind coordinates and velocities are, with their units.
    entries: Option<usize>,
    others: Vec<(String, Option<String>)>,
    /// The place of the first line behind it, and its number.
    end: usize,
    line: u64,
}

impl Header {
    fn read(path: &Path, bytes: &[u8]) -> Result<Self> {
        let fault = |line: u64, what: String| Error::format(path, format!("line {line}"), what, HINT);
        let (mut count, mut length, mut edges) = (None, 1.0, [[f64::NAN; 3]; 3]);
        let (mut rate, mut has_velocities, mut entries, mut others) = (1.0, true, None, Vec::new());
        let mut lines = Lines::new(bytes, 0, 1);
        let (mut end, mut number);
        loop {
            (end, number) = (lines.place, lines.number);
            let Some(line) = lines.next() else { break };
            let text = String::from_utf8_lossy(line);
            let text = text.split('#').next().unwrap_or_default().trim();
            if text.eq_ignore_ascii_case(".NO_VELOCITY.") {
                has_velocities = false;
                continue;
            }
            if text.is_empty() {
                continue;
            }
            // The first line that is no pair belongs to an atom.
            let Some((key, value)) = text.split_once('=').map(|(key, value)| (key.trim(), value.trim()))
            else {
                break;
            };
            let word = value.split_whitespace().next().unwrap_or_default();
            let wrong = || fault(number, format!("{key}: a number was wanted, found '{word}'"));
            let real =
                || fast_float2::parse::<f64, _>(word).ok().filter(|it| it.is_finite()).ok_or_else(wrong);
            match key {
                "Number of particles" => count = Some(word.parse().map_err(|_| wrong())?),
                "A" => length = real()?,
                "R" => rate = real()?,
                "entry_count" => {
                    let found = word.parse::<usize>().ok().filter(|it| (3..=MOST_ENTRIES).contains(it));
                    entries = Some(found.ok_or_else(wrong)?);
                }
                _ if key.starts_with("auxiliary") => {
                    let unit = value.split_once('[').and_then(|(_, unit)| unit.strip_suffix(']'));
                    let unit = unit.map(str::trim).filter(|it| !it.is_empty() && *it != "reduced unit");
                    others.push((word.to_string(), unit.map(str::to_string)));
                }
                _ => {
                    let place = |name: &str| {
                        let within = key.strip_prefix(name)?.strip_prefix('(')?.strip_suffix(')')?;
                        let (row, column) = within.split_once(',')?;
                        let index = |it: &str| {
                            it.trim().parse::<usize>().ok().filter(|it| (1..=3).contains(it)).map(|it| it - 1)
                        };
                        Some((index(row)?, index(column)?))
                    };
                    if let Some((row, column)) = place("H0") {
                        edges[row][column] = real()?;
                    } else if let Some((row, column)) = place("Transform").or(place("eta")) {
                        let rest = f64::from(u8::from(key.starts_with('T') && row == column));
                        if real()? != rest {
                            return Err(fault(
                                number,
                                format!("the cell is turned or strained ({key}), which is not read"),
                            ));
                        }
                    }
                }
            }
        }
        let count = count.ok_or_else(|| fault(1, "there is no Number of particles".into()))?;
        if edges.iter().flatten().any(|it| it.is_nan()) {
            return Err(fault(number, "the edges H0 of the cell are not all there".into()));
        }
        let edges = DMat3::from_cols_array_2d(&edges) * length;
        let before = if has_velocities { 6 } else { 3 };
        if let Some(entries) = entries {
            if entries < before {
                return Err(fault(number, format!("entry_count is {entries}, {before} are needed")));
            }
            let first = others.len();
            others.extend((first..entries - before).map(|it| (format!("auxiliary{it}"), None)));
            others.truncate(entries - before);
        }
        Ok(Self { count, edges, rate, has_velocities, entries, others, end, line: number })
    }

    /// Whether a line is one of an atom, not of a mass or an element.
    fn is_atom(&self, line: &[u8]) -> bool {
        rows::split(line, Separator::BLANKS).nth(1).is_some()
    }
}

/// Finds the atoms: a file is one frame.
pub(crate) fn index(path: &Path, bytes: &[u8], _: &Options) -> Result<Index> {
    let header = Header::read(path, bytes)?;
    let (mut count, mut last): (u64, &[u8]) = (0, b"");
    for line in Lines::new(bytes, header.end, header.line).filter(|line| header.is_atom(line)) {
        count += 1;
        last = line;
    }
    let numbers = header.entries.unwrap_or(8);
    let torn = !bytes.ends_with(b"\n") && rows::split(last, Separator::BLANKS).count() < numbers;
    let whole = Span { offset: 0, line: 1, bytes: Some(bytes.len() as u64) };
    let cut = count < header.count || torn && count == header.count && count > 0;
    Ok(Index {
        frames: if cut { vec![] } else { vec![whole] },
        cut,
        doubt: rows::open_end(bytes),
        ..Index::default()
    })
}

/// Reads the atoms.
pub(crate) fn frame(
    path: &Path,
    bytes: &[u8],
    span: Span,
    _: &Request,
    progress: &dyn Progress,
) -> Result<Frame> {
    progress.begin("read", span.bytes, "B");
    let header = Header::read(path, bytes)?;
    let origin = (header.edges * DVec3::splat(0.5)).is_finite().then(|| header.edges * DVec3::splat(0.5));
    let mut positions = origin.map_or_else(Positions::new, Positions::around);
    let (mut batch, mut masses, mut elements) = (Vec::new(), Vec::new(), Words::default());
    let (mut velocities, mut others) = (Vec::new(), vec![Vec::new(); header.others.len()]);
    let (mut mass, mut element): (f32, &[u8]) = (f32::NAN, b"");
    let (mut lines, mut told) = (Lines::new(bytes, header.end, header.line), header.end);
    while let Some(line) = lines.next() {
        if lines.number.is_multiple_of(LINES) {
            progress.advance((lines.place - told) as u64);
            told = lines.place;
            if progress.cancelled() {
                return Err(Error::Interrupted);
            }
            positions.extend(&batch);
            batch.clear();
        }
        if masses.len() as u64 == header.count {
            break;
        }
        let fault = |what: &str| {
            let what = format!("wanted {what}, found '{}'", rows::shortened(line));
            Error::format(path, format!("line {}", lines.number - 1), what, HINT)
        };
        let mut words = rows::split(line, Separator::BLANKS);
        if !header.is_atom(line) {
            match words.next().map(|word| (word, fast_float2::parse(word))) {
                Some((_, Ok(number))) => mass = number,
                Some((word, Err(_))) => element = word,
                None => {}
            }
            continue;
        }
        if header.entries.is_none() {
            let own = words.next().and_then(|it| fast_float2::parse(it).ok());
            mass = own.ok_or_else(|| fault("the mass of an atom"))?;
            element = words.next().unwrap_or_default();
        }
        let mut next = || words.next().and_then(|it| fast_float2::parse::<f64, _>(it).ok());
        let mut three = || Some(DVec3::new(next()?, next()?, next()?));
        let fractions = three().ok_or_else(|| fault("three fractions of the cell"))?;
        batch.push(header.edges * fractions);
        if header.has_velocities {
            let velocity = three().ok_or_else(|| fault("three components of a velocity"))?;
            velocities.extend((header.edges * velocity * header.rate).to_array().map(|it| it as f32));
        }
        for values in &mut others {
            let value = next().ok_or_else(|| fault(&format!("{} numbers", header.entries.unwrap_or(8))))?;
            values.push(value as f32);
        }
        masses.push(mass);
        elements.push(element);
    }
    positions.extend(&batch);
    if (masses.len() as u64) < header.count {
        let what = format!("the file ends after {} of {} particles", masses.len(), header.count);
        return Err(Error::format(
            path,
            format!("line {}", lines.number),
            what,
            "was it changed or cut while it was read?",
        ));
    }
    let mut attributes = vec![
        Attribute::new("element", 1, Column::Text(elements).into_values()),
        Attribute::new("mass", 1, Values::F32(masses)),
    ];
    // Programs without velocities write zeros.
    if header.has_velocities && velocities.iter().any(|it| *it != 0.0) {
        attributes.push(Attribute {
            unit: Some("Å/ns".into()),
            ..Attribute::new("velocity", 3, Values::F32(velocities))
        });
    }
    for ((name, unit), values) in header.others.into_iter().zip(others) {
        attributes.push(Attribute { unit, ..Attribute::new(name, 1, Values::F32(values)) });
    }
    let columns = Columns {
        positions,
        attributes,
        cell: molecules::cell([header.edges.x_axis, header.edges.y_axis, header.edges.z_axis]),
        length_unit: Some("Å".to_string()),
        ..Columns::default()
    };
    finish(columns, vec!["coordinates: fractions of the cell's edges".to_string()], Vec::new())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::real_data;

    const HEAD: &str = "# made by hand\nNumber of particles = 3\nA = 2.0 Angstrom (basic length-scale)\nH0(1,1) = 5 A\nH0(1,2) = 0 A\n\
                        H0(1,3) = 0 A\nH0(2,1) = 1 A\nH0(2,2) = 5 A\nH0(2,3) = 0 A\nH0(3,1) = 0 A\nH0(3,2) = 0 A\nH0(3,3) = 4 A\n";

    fn read(text: &str) -> Result<Frame> {
        let (path, options) = (Path::new("a.cfg"), Options::default());
        let request = Request { options: &options, bytes: None, units: None, topology: None, others: &() };
        let index = index(path, text.as_bytes(), &options)?;
        let span = index.frames.first().ok_or_else(|| Error::format(path, "", "cut", ""))?;
        frame(path, text.as_bytes(), *span, &request, &())
    }

    #[test]
    fn extended_files_name_their_quantities() {
        let text = format!(
            "{HEAD}.NO_VELOCITY.\nentry_count = 5\nauxiliary[0] = pote [eV]\nauxiliary[1] = csp [reduced unit]\n63.5\nCu\n0 0 0 -3.5 1\n.5 .5 0 -3.25 2\n16\nO\n0 0 .5 -1 3\n"
        );
        for text in [&text, &text.replace('\n', "\r\n")] {
            assert!(recognise(text.as_bytes()));
            let particles = read(text).unwrap().particles;
            assert_eq!(particles.positions().world(1).to_array(), [6.0, 5.0, 0.0]);
            assert_eq!(particles.cell().unwrap().vectors[1].to_array(), [2.0, 10.0, 0.0]);
            let names = vec!["Cu".to_string(), "O".to_string()];
            assert_eq!(
                particles.attribute("element").unwrap().values,
                Values::Text { codes: vec![0, 0, 1], names }
            );
            assert_eq!(particles.attribute("mass").unwrap().values, Values::F32(vec![63.5, 63.5, 16.0]));
            let energy = particles.attribute("pote").unwrap();
            assert_eq!((energy.unit.as_deref(), energy.number(1, 0)), (Some("eV"), -3.25));
            assert_eq!(particles.attribute("csp").unwrap().number(2, 0), 3.0);
        }
    }

    #[test]
    fn standard_files_have_mass_element_and_velocity_in_each_row() {
        let text =
            format!("{HEAD}R = 3.0 [ns^-1]\n63.5 Cu 0 0 0 0 0 0\n63.5 Cu .5 .5 0 1 0 0\n16 O 0 0 .5 0 0 0\n");
        let particles = read(&text).unwrap().particles;
        assert_eq!((particles.len(), particles.attribute("velocity").unwrap().number(1, 0)), (3, 30.0));
        assert!(read(&text[..text.len() - 3]).is_err() && read(text.split("16 O").next().unwrap()).is_err());
    }

    #[test]
    fn what_is_wrong_is_said() {
        let rows = "1 H 0 0 0 0 0 0\n".repeat(3);
        let message = |text: &str| read(text).err().unwrap().to_string();
        assert!(message(&HEAD.replace("H0(3,3) = 4 A\n", &rows)).contains("H0"));
        assert!(message(&format!("{HEAD}Transform(1,1) = 2\n{rows}")).contains("turned or strained"));
        assert!(
            message(&format!("{HEAD}{}", rows.replace("0 0 0 0 0 0", "0 x 0 0 0 0")))
                .contains("three fractions")
        );
        assert!(message(&HEAD.replace("= 3\n", "= 99999999999999\n")).contains("cut"));
    }

    #[test]
    fn damage_never_panics() {
        let text = format!(
            "{HEAD}entry_count = 7\nauxiliary[0] = a [b]\n1\nH\n0 0 0 1 1 1 2\n0 0 .5 1 1 1 2\n.5 0 0 1 1 1 2\n"
        );
        real_data::damage(text.as_bytes(), |file| drop(read(&String::from_utf8_lossy(file))));
    }
}
