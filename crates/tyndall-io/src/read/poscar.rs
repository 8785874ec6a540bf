//! Structures of VASP: POSCAR and CONTCAR, and their trajectories, XDATCAR.
//!
//! A comment, a scale, three edges of the cell, maybe the elements, how many atoms of each, maybe `Selective dynamics`, then
//! `Direct` (fractions of the edges) or `Cartesian`, and an atom a line. A negative scale is the volume of the cell; three scales are
//! one for each axis. Velocities may follow the atoms. XDATCAR has frames, each behind a line `Direct configuration=`, before which all up to
//! there may stand anew. Lengths are Å. Source: the VASP Wiki, POSCAR and XDATCAR.

use std::path::Path;

use glam::{DMat3, DVec3};
use rayon::prelude::*;
use tyndall::particles::{Attribute, Values};
use tyndall::scene::element::Element;
use tyndall::{Cell, Columns, Error, Positions, Progress, Result};

use super::column::Separator;
use super::lines::Lines;
use super::{Index, Request, Span, finish, molecules, rows, whole_lines};
use crate::sequence::{Frame, Options};

const HINT: &str = "compare it with the description of POSCAR in the VASP Wiki";

/// Whether the file begins like POSCAR.
pub(crate) fn recognise(head: &[u8]) -> bool {
    super::is_text(head) && {
        let text: Vec<u8> = whole_lines(head).take(12).flat_map(|line| [line, b"\n"].concat()).collect();
        Head::read(&mut Lines::new(&text, 0, 1)).is_ok_and(|head| head.atoms() > 0 || head.counts.len() > 1)
    }
}

fn words(line: &[u8]) -> Vec<&[u8]> {
    rows::split(line, Separator::BLANKS).collect()
}

/// The numbers at the front of a line, `least` or more of them.
fn numbers(line: Option<&[u8]>, least: usize, what: &str) -> std::result::Result<Vec<f64>, String> {
    let line = line.ok_or_else(|| format!("wanted {what}, the file ends"))?;
    let numbers: Vec<f64> = words(line).iter().map_while(|it| fast_float2::parse(it).ok()).collect();
    let found = numbers.len() >= least && numbers.iter().all(|it: &f64| it.is_finite());
    found.then_some(numbers).ok_or_else(|| format!("wanted {what}, found '{}'", rows::shortened(line)))
}

/// What stands before the atoms.
struct Head {
    edges: DMat3,
    /// What Cartesian coordinates are multiplied by.
    scale: DVec3,
    /// The elements, where they are told.
    names: Vec<String>,
    counts: Vec<u64>,
    direct: bool,
    selective: bool,
    /// Of XDATCAR the number in the line before the atoms.
    configuration: Option<f64>,
}

impl Head {
    /// Reads it up to the line before the first atom.
    fn read(lines: &mut Lines) -> std::result::Result<Self, String> {
        let comment = lines.next().ok_or("the file is empty")?;
        let scales = numbers(lines.next(), 1, "a scale")?;
        let mut edge =
            || numbers(lines.next(), 3, "an edge of the cell").map(|it| DVec3::new(it[0], it[1], it[2]));
        let edges = DMat3::from_cols(edge()?, edge()?, edge()?);
        let scale = match scales[..] {
            [x, y, z, ..] => DVec3::new(x, y, z),
            [volume, ..] if volume < 0.0 => DVec3::splat((-volume / edges.determinant().abs()).cbrt()),
            _ => DVec3::splat(scales[0]),
        };
        if !scale.is_finite() || scale.min_element() <= 0.0 {
            return Err(format!("the scale {} makes no cell", scales[0]));
        }
        let line = lines.next().ok_or("the file ends before the numbers of atoms")?;
        let count = |word: &&[u8]| std::str::from_utf8(word).ok()?.parse::<u64>().ok();
        let counts = |line: &[u8]| -> Option<Vec<u64>> {
            // Behind them may stand a comment.
            let counts: Vec<u64> = words(line).iter().map_while(count).collect();
            (!counts.is_empty()).then_some(counts)
        };
        // Potentials have names such as Fe_pv, and hashes behind a slash.
        let name = |word: &&[u8]| {
            let word = String::from_utf8_lossy(word);
            word.split(['_', '/']).next().unwrap_or_default().to_string()
        };
        let (names, counts) = match counts(line) {
            // Before version 5 the comment may tell the elements.
            Some(counts) => {
                let names: Vec<String> = words(comment).iter().map(name).collect();
                let known =
                    |it: &String| Element::from_symbol(it).is_some_and(|element| element.symbol() == it);
                let told = names.len() == counts.len() && names.iter().all(known);
                (if told { names } else { Vec::new() }, counts)
            }
            None => {
                let names: Vec<String> = words(line).iter().map(name).collect();
                let line = lines.next().ok_or("the file ends before the numbers of atoms")?;
                let counts = counts(line).filter(|it| it.len() == names.len());
                let wrong =
                    || format!("wanted {} numbers of atoms, found '{}'", names.len(), rows::shortened(line));
                let counts = counts.ok_or_else(wrong)?;
                (names, counts)
            }
        };
        let letter = |line: &[u8]| line.first().map(u8::to_ascii_lowercase);
        let mut line = lines.next().ok_or("the file ends before the atoms")?;
        let selective = letter(line) == Some(b's');
        if selective {
            line = lines.next().ok_or("the file ends before the atoms")?;
        }
        let direct = match letter(line) {
            Some(b'd') => true,
            Some(b'c' | b'k') => false,
            _ => return Err(format!("wanted Direct or Cartesian, found '{}'", rows::shortened(line))),
        };
        Ok(Self { edges, scale, names, counts, direct, selective, configuration: configuration(line) })
    }

    fn atoms(&self) -> u64 {
        self.counts.iter().fold(0, |sum, it| sum.saturating_add(*it))
    }

    fn vectors(&self) -> [DVec3; 3] {
        [self.edges.x_axis, self.edges.y_axis, self.edges.z_axis].map(|it| it * self.scale)
    }

    /// The position with these coordinates.
    fn position(&self, coordinates: DVec3) -> DVec3 {
        if self.direct { self.edges * coordinates * self.scale } else { coordinates * self.scale }
    }
}

/// The number of a frame of XDATCAR, before whose atoms `line` stands.
fn configuration(line: &[u8]) -> Option<f64> {
    let (word, number) = line.split_at(line.iter().position(|it| *it == b'=')?);
    let is_one = word.len() > 6 && memchr::memmem::find(word, b"onfiguration").is_some();
    std::str::from_utf8(&number[1..]).ok()?.trim().parse().ok().filter(|_| is_one)
}

/// Finds the frames. A span begins with what stands before the atoms, or with the line before them alone.
pub(crate) fn index(path: &Path, bytes: &[u8], _: &Options) -> Result<Index> {
    let mut lines = Lines::new(bytes, 0, 1);
    let fault = |line: u64, what: String| Error::format(path, format!("line {line}"), what, HINT);
    let mut head = Head::read(&mut lines).map_err(|what| fault(lines.number - 1, what))?;
    let mut index = Index { doubt: rows::open_end(bytes), ..Index::default() };
    let (mut start, mut number) = (0, 1);
    loop {
        let Some(atoms) = lines.block(head.atoms()) else {
            index.cut = true;
            return Ok(index);
        };
        // A last line that is shorter than the first is no whole atom.
        let first = atoms.split(|it| *it == b'\n').next().unwrap_or_default();
        let last = atoms.trim_ascii_end().rsplit(|it| *it == b'\n').next().unwrap_or_default();
        if lines.rest().is_empty() && !bytes.ends_with(b"\n") && words(last).len() < words(first).len() {
            index.cut = true;
            return Ok(index);
        }
        index.frames.push(Span {
            offset: start as u64,
            line: number,
            bytes: Some((lines.place - start) as u64),
        });
        if head.configuration.is_none() || lines.rest().trim_ascii().is_empty() {
            let last = index.frames.last_mut().expect("one was added");
            last.bytes = Some(bytes.len() as u64 - last.offset);
            return Ok(index);
        }
        (start, number) = (lines.place, lines.number);
        if lines.clone().next().and_then(configuration).is_some() {
            lines.next();
            continue;
        }
        match Head::read(&mut lines) {
            Ok(again) => head = again,
            Err(_) if lines.rest().is_empty() => {
                index.cut = true;
                return Ok(index);
            }
            Err(what) => return Err(fault(lines.number - 1, what)),
        }
    }
}

/// Atoms while they are read.
#[derive(Default)]
struct Part {
    positions: Vec<DVec3>,
    free: Vec<u8>,
}

impl Part {
    /// Reads the atoms of a slice; on failure says in which line, counted from 0.
    fn read(slice: &[u8], head: &Head) -> std::result::Result<Self, (u64, String)> {
        let mut part = Self::default();
        for (place, line) in slice.strip_suffix(b"\n").unwrap_or(slice).split(|it| *it == b'\n').enumerate() {
            let coordinates =
                numbers(Some(line), 3, "three coordinates").map_err(|what| (place as u64, what))?;
            part.positions.push(head.position(DVec3::new(coordinates[0], coordinates[1], coordinates[2])));
            if head.selective {
                let flags = words(line);
                let is_free =
                    |at: usize| flags.get(at).is_none_or(|it| !it.trim_ascii_start().starts_with(b"F"));
                part.free.extend([3, 4, 5].map(|at| u8::from(is_free(at))));
            }
        }
        Ok(part)
    }
}

/// Reads the frame at `span`.
pub(crate) fn frame(
    path: &Path,
    bytes: &[u8],
    span: Span,
    _: &Request,
    progress: &dyn Progress,
) -> Result<Frame> {
    progress.begin("read", span.bytes, "B");
    let fault = |line: u64, what: String| Error::format(path, format!("line {line}"), what, HINT);
    let mut lines = Lines::new(bytes, span.offset as usize, span.line);
    let mut head = None;
    if let Some(number) = lines.clone().next().and_then(configuration) {
        // What was said before holds.
        let mut before = Lines::new(bytes, 0, 1);
        let first = Head::read(&mut before).map_err(|what| fault(before.number - 1, what))?;
        head = Some(Head { configuration: Some(number), ..first });
        lines.next();
    }
    let head = match head {
        Some(head) => head,
        None => Head::read(&mut lines).map_err(|what| fault(lines.number - 1, what))?,
    };
    let first_line = lines.number;
    let atoms = lines.block(head.atoms()).ok_or_else(|| fault(first_line, "the atoms are cut off".into()))?;

    let slices = if atoms.is_empty() { Vec::new() } else { rows::slices(atoms) };
    let read = |slice: &&[u8]| {
        progress.advance(slice.len() as u64);
        if progress.cancelled() { None } else { Some(Part::read(slice, &head)) }
    };
    let parts: Vec<_> = slices.par_iter().map(read).collect();
    let cell = molecules::cell(head.vectors());
    let mut positions =
        cell.as_ref().map_or_else(Positions::new, |cell| Positions::around(Cell::center(cell)));
    let (mut free, mut line) = (Vec::new(), first_line);
    for part in parts {
        let part = part.ok_or(Error::Interrupted)?.map_err(|(within, what)| fault(line + within, what))?;
        line += part.positions.len() as u64;
        positions.extend(&part.positions);
        free.extend(part.free);
    }

    let mut conventions = vec!["lengths: Å (VASP)".to_string()];
    let mut attributes = vec![kinds(&head, &mut conventions)];
    if head.selective {
        attributes.push(Attribute::new("free", 3, Values::U8(free)));
    }
    let mut warnings = Vec::new();
    if head.configuration.is_none() {
        match velocities(&mut lines, head.atoms()) {
            Some(Ok(values)) => attributes
                .push(Attribute { unit: Some("Å/fs".into()), ..Attribute::new("velocity", 3, values) }),
            Some(Err(what)) => warnings.push(format!("left out: velocities ({what})")),
            None => {}
        }
    }
    let columns = Columns {
        positions,
        attributes,
        cell,
        time: head.configuration,
        time_unit: head.configuration.map(|_| "step".to_string()),
        length_unit: Some("Å".to_string()),
        ..Columns::default()
    };
    finish(columns, conventions, warnings)
}

/// The elements of the atoms, or where they are not told the numbers of their kinds, from 1 on.
fn kinds(head: &Head, conventions: &mut Vec<String>) -> Attribute {
    let each = head.counts.iter().enumerate();
    let each = each.flat_map(|(kind, &count)| std::iter::repeat_n(kind, count as usize));
    if head.names.is_empty() {
        conventions.push("elements are not told: types are numbered in order".to_string());
        return Attribute::new("type", 1, Values::I32(each.map(|kind| kind as i32 + 1).collect()));
    }
    let mut names: Vec<String> = Vec::new();
    let mut code = |name: &String| {
        names.iter().position(|it| it == name).unwrap_or_else(|| {
            names.push(name.clone());
            names.len() - 1
        })
    };
    let codes: Vec<u32> = head.names.iter().map(|name| code(name) as u32).collect();
    let codes = each.map(|kind| codes[kind]).collect();
    Attribute::new("element", 1, Values::Text { codes, names })
}

/// The velocities behind the atoms, in Å/fs; `None` if there are none, or why they are not read.
fn velocities(lines: &mut Lines, count: u64) -> Option<std::result::Result<Values, String>> {
    let mut line = lines.next()?;
    if line.first().is_some_and(|it| it.eq_ignore_ascii_case(&b'l')) {
        // Lattice velocities and vectors: a flag and six lines.
        lines.block(7)?;
        line = lines.next()?;
    }
    match line.first().map(u8::to_ascii_lowercase) {
        None | Some(b'c' | b'k') => {}
        Some(b'd') => return Some(Err("they are in fractions of the cell".into())),
        _ => return None,
    }
    if lines.rest().trim_ascii().is_empty() {
        return None;
    }
    let Some(text) = lines.block(count) else { return Some(Err("the file ends within them".into())) };
    let mut values = Vec::with_capacity(3 * count as usize);
    for line in text.strip_suffix(b"\n").unwrap_or(text).split(|it| *it == b'\n') {
        match numbers(Some(line), 3, "three velocities") {
            Ok(three) => values.extend(three[..3].iter().map(|it| *it as f32)),
            Err(what) => return Some(Err(what)),
        }
    }
    Some(Ok(Values::F32(values)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::real_data;

    const CUBE: &str = "cube\n2.0\n1 0 0\n0.5 2 0\n0 0 3\nCu_pv O\n2 1\n";

    fn frames(text: &str) -> Result<Vec<Frame>> {
        let (path, options) = (Path::new("POSCAR"), Options::default());
        let request = Request { options: &options, bytes: None, units: None, topology: None, others: &() };
        let index = index(path, text.as_bytes(), &options)?;
        index.frames.iter().map(|span| frame(path, text.as_bytes(), *span, &request, &())).collect()
    }

    fn places(frame: &Frame) -> Vec<[f64; 3]> {
        (0..frame.particles.len()).map(|id| frame.particles.positions().world(id).to_array()).collect()
    }

    #[test]
    fn fractions_and_lengths_are_the_same_places() {
        let direct = format!("{CUBE}Direct\n0 0 0\n.5 .5 0 Cu\n0 0 .5\n");
        let lengths = format!("{CUBE}Cartesian\n0 0 0\n0.75 1 0\n0 0 1.5\n");
        // The volume is 2^3 times 6.
        let volume = direct.replace("2.0\n", "-48\n");
        for text in
            [&direct, &lengths, &volume, &direct.replace('\n', "\r\n"), &direct.replace("2.0\n", "2 2 2\n")]
        {
            assert!(recognise(text.as_bytes()), "{text}");
            let frames = frames(text).unwrap();
            assert_eq!(places(&frames[0]), [[0.0; 3], [1.5, 2.0, 0.0], [0.0, 0.0, 3.0]], "{text}");
            let particles = &frames[0].particles;
            assert_eq!(particles.cell().unwrap().vectors[1], DVec3::new(1.0, 4.0, 0.0));
            let names = vec!["Cu".to_string(), "O".to_string()];
            assert_eq!(
                particles.attribute("element").unwrap().values,
                Values::Text { codes: vec![0, 0, 1], names }
            );
        }
        let unknown = direct.replace("Cu_pv O\n", "");
        let types = frames(&unknown).unwrap().remove(0).particles;
        assert_eq!(types.attribute("type").unwrap().values, Values::I32(vec![1, 1, 2]));
        let comment = frames(&unknown.replace("cube", "Cu O")).unwrap().remove(0).particles;
        assert!(comment.attribute("element").is_some());
    }

    #[test]
    fn flags_and_velocities_are_attributes() {
        let text = format!(
            "{CUBE}Selective dynamics\nDirect\n0 0 0 T T T\n.5 .5 0 F F T\n0 0 .5 T F F\n\n1 2 3\n4 5 6\n7 8 9\n\n 1\n"
        );
        let particles = frames(&text).unwrap().remove(0).particles;
        assert_eq!(particles.attribute("free").unwrap().values, Values::U8(vec![1, 1, 1, 0, 0, 1, 1, 0, 0]));
        assert_eq!(particles.attribute("velocity").unwrap().number(2, 1), 8.0);
        let lattice = text.replace(
            "\n\n1 2 3",
            "\nLattice velocities and vectors\n1\n0 0 0\n0 0 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n\n1 2 3",
        );
        assert_eq!(frames(&lattice).unwrap()[0].particles.attribute("velocity").unwrap().number(2, 1), 8.0);
        let cut = frames(text.split("7 8 9").next().unwrap()).unwrap().remove(0);
        assert_eq!(cut.warnings, ["left out: velocities (the file ends within them)"]);
    }

    #[test]
    fn trajectories_have_a_cell_for_all_or_for_each() {
        let atoms = "0 0 0\n.5 .5 0\n0 0 .5\n";
        let fixed = format!(
            "{CUBE}Direct configuration=     1\n{atoms}Direct configuration=     2\n0.25 0 0\n.5 .5 0\n0 0 .5\n"
        );
        let changing = format!(
            "{CUBE}Direct configuration=     1\n{atoms}{}Direct configuration=     2\n{atoms}",
            CUBE.replace("2.0", "4.0")
        );
        for (text, x) in [(&fixed, 1.5), (&changing, 3.0)] {
            assert!(recognise(text.as_bytes()));
            let frames = frames(text).unwrap();
            assert_eq!(
                (frames.len(), frames[1].particles.time(), places(&frames[1])[1][0]),
                (2, Some(2.0), x)
            );
        }
        let index = |text: &str| index(Path::new("XDATCAR"), text.as_bytes(), &Options::default()).unwrap();
        let cut = index(&fixed[..fixed.len() - 10]);
        assert_eq!((cut.frames.len(), cut.cut), (1, true));
        assert!(index(&changing[..changing.len() - 60]).cut);
    }

    #[test]
    fn other_texts_are_not_taken_for_it() {
        for text in [
            "3\nc\nO 0 0 0\nO 0 0 1\nO 0 1 1\n",
            "1 2 3\n4 5 6\n7 8 9\n1 2 3\n4 5 6\n7 8 9\n1 2 3\n",
            "a\n1\n1 0 0\n0 1 0\n",
        ] {
            assert!(!recognise(text.as_bytes()), "{text}");
        }
        let error = frames(&format!("{CUBE}Direct\n0 0 0\n.5 x 0\n0 0 0\n")).err().unwrap().to_string();
        assert!(
            error.contains("wanted three coordinates, found '.5 x 0'") && error.contains("line 10"),
            "{error}"
        );
        let hostile = CUBE.replace("2 1", "2 99999999999999999");
        assert!(
            index(Path::new("a"), format!("{hostile}Direct\n0 0 0\n").as_bytes(), &Options::default())
                .unwrap()
                .cut
        );
    }

    #[test]
    fn damage_never_panics() {
        let text = format!(
            "{CUBE}Selective\nDirect\n0 0 0 T T T\n.5 .5 0 F F T\n0 0 .5 T F F\n\n1 2 3\n4 5 6\n7 8 9\n"
        );
        real_data::damage(text.as_bytes(), |file| drop(frames(&String::from_utf8_lossy(file))));
    }
}
