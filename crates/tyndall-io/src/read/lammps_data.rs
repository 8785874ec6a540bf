//! LAMMPS data files: what `read_data` reads and `write_data` writes: one frame, in sections.
//!
//! Takes the sections Atoms, Velocities, Bonds, Masses and Atom Type Labels; angles and the like are counted and left out. What the columns
//! of an atom are depends on its style: the word behind `Atoms #` tells it, else their number and which of them are integers, and
//! the guess is said. Image flags behind them are optional. Velocities are joined by id. Source: LAMMPS documentation of
//! `read_data` and `write_data`.

mod columns;

use std::collections::HashMap;

use tyndall::particles::{Attribute, Values, View};
use tyndall::scene::element::Element;
use tyndall::scene::grouped;
use tyndall::{Cell, Columns, DVec3, Error, Progress, Result};

use self::columns::Sample;
use super::column::{Kind, Separator};
use super::feed::Feed;
use super::rows::{self, Heading, Layout, Role, Rows};
use super::{Index, Request, Span, finish, lammps, whole_lines};
use crate::sequence::Frame;

const HINT: &str = "let LAMMPS write it again with write_data";

/// Whether the file begins like a data file: a comment, then a count of atoms among the first lines.
pub(crate) fn recognise(head: &[u8]) -> bool {
    let is_count = |line: &[u8]| {
        let mut words = line.split(|byte| byte.is_ascii_whitespace()).filter(|it| !it.is_empty());
        words.next().is_some_and(|it| it.iter().all(u8::is_ascii_digit)) && words.next() == Some(b"atoms")
    };
    super::is_text(head) && whole_lines(head).skip(1).take(40).any(is_count)
}

/// What stands before the sections.
#[derive(Debug)]
struct Header {
    title: String,
    /// How many there are of each thing: `atoms`, `bonds`, `atom types`.
    counts: HashMap<String, u64>,
    cell: Cell,
}

impl Header {
    /// Reads up to the first section, whose name is given back; `None` if there is none.
    fn read(feed: &mut Feed) -> Result<(Self, Option<Section>)> {
        let title = feed.line()?.unwrap_or_default();
        let mut counts = HashMap::new();
        let (mut bounds, mut tilts) = ([[-0.5, 0.5]; 3], [0.0; 3]);
        let mut general: [Option<DVec3>; 4] = [None; 4];
        let heading = loop {
            let Some(line) = feed.line()? else { break None };
            if let Some(heading) = Section::of(&line) {
                break Some(heading);
            }
            let line = line.split('#').next().unwrap_or_default();
            let numbers: Vec<f64> =
                line.split_whitespace().map_while(|word| fast_float2::parse(word).ok()).collect();
            let what: Vec<&str> = line.split_whitespace().skip(numbers.len()).collect();
            let what = what.join(" ");
            let is_bound = ["xhi", "yhi", "zhi"].iter().any(|it| what.ends_with(it));
            let axis = ["xlo xhi", "ylo yhi", "zlo zhi"].iter().position(|it| *it == what);
            let edge = ["avec", "bvec", "cvec", "abc origin"].iter().position(|it| *it == what);
            match (axis, edge, &numbers[..]) {
                (_, _, []) if what.is_empty() => {}
                (Some(axis), _, &[low, high]) => bounds[axis] = [low, high],
                (_, Some(edge), &[x, y, z]) => general[edge] = Some(DVec3::new(x, y, z)),
                (None, None, &[xy, xz, yz]) if what == "xy xz yz" => tilts = [xy, xz, yz],
                (None, None, &[count]) if count >= 0.0 && count.fract() == 0.0 && !is_bound => {
                    counts.insert(what, count as u64);
                }
                (None, None, _) if !what.is_empty() && !is_bound => {} // Later versions may say more.
                _ => {
                    let what =
                        format!("cannot understand the header's line '{}'", rows::shortened(line.as_bytes()));
                    return Err(feed.fault(what, "write '0 10 xlo xhi', '0 0 0 xy xz yz' or '100 atoms'"));
                }
            }
        };
        let periodic = [true; 3];
        let [x, y, z] = bounds.map(|it| it[1] - it[0]);
        let [xy, xz, yz] = tilts;
        let origin = DVec3::from_array(bounds.map(|it| it[0]));
        let vectors = [DVec3::new(x, 0.0, 0.0), DVec3::new(xy, y, 0.0), DVec3::new(xz, yz, z)];
        let cell = match general {
            [Some(a), Some(b), Some(c), origin] => {
                Cell { origin: origin.unwrap_or_default(), vectors: [a, b, c], periodic }
            }
            _ => Cell { origin, vectors, periodic },
        };
        if !cell.vectors.iter().chain([&cell.origin]).all(|it| it.is_finite()) {
            return Err(feed.fault("the box is not finite", HINT));
        }
        Ok((Self { title, counts, cell }, heading))
    }

    fn count(&self, what: &str) -> Option<u64> {
        self.counts.get(what).copied()
    }

    /// The word behind `name =` in the title, as `write_data` puts it there.
    fn title_value(&self, name: &str) -> Option<&str> {
        let (_, rest) = self.title.split_once(&format!("{name} ="))?;
        rest.split(',').next()?.split_whitespace().next()
    }
}

/// The name of a section, and the comment behind it.
#[derive(Debug)]
struct Section {
    name: String,
    comment: String,
}

impl Section {
    /// A section's name begins with a letter and has no number in it, unlike what stands in sections.
    fn of(line: &str) -> Option<Self> {
        let (name, comment) = line.split_once('#').unwrap_or((line, ""));
        let name = name.trim();
        let is_number = |word: &str| fast_float2::parse::<f64, _>(word).is_ok();
        let is_name = name.starts_with(|it: char| it.is_ascii_alphabetic())
            && !name.split_whitespace().any(is_number)
            && name.len() < 100;
        is_name.then(|| Self { name: name.to_string(), comment: comment.trim().to_string() })
    }
}

/// Takes blank lines, and says what follows.
fn peek_rows<'a>(feed: &'a mut Feed) -> Result<&'a [u8]> {
    loop {
        let text = feed.peek(1 << 14)?;
        let end = memchr::memchr(b'\n', text);
        match end {
            Some(end) if text[..end].trim_ascii().is_empty() => drop(feed.line()?),
            _ => break,
        }
    }
    feed.peek(1 << 14)
}

/// Passes on to the next section.
fn next_section(feed: &mut Feed) -> Result<Option<Section>> {
    while let Some(line) = feed.line()? {
        if let Some(section) = Section::of(&line) {
            return Ok(Some(section));
        }
    }
    Ok(None)
}

/// What sections hold that are passed over at once: as many rows as the header says.
const ROWS: [(&str, &str); 8] = [
    ("Atoms", "atoms"),
    ("Velocities", "atoms"),
    ("Bonds", "bonds"),
    ("Angles", "angles"),
    ("Dihedrals", "dihedrals"),
    ("Impropers", "impropers"),
    ("Ellipsoids", "ellipsoids"),
    ("Lines", "lines"),
];

/// Sees whether all atoms are there.
pub(crate) fn index(feed: &mut Feed) -> Result<Index> {
    let (header, mut section) = Header::read(feed)?;
    let count = count(feed, &header)?;
    let mut index = Index { units: header.title_value("units").map(str::to_string), ..Index::default() };
    while let Some(it) = section {
        let rows = peek_rows(feed)?;
        if it.name == "Atoms" {
            let fields = Sample::of(rows).fields;
            let found = feed.skip_lines(count)?;
            let is_short = |row: &[u8]| Sample::of(row).fields < fields;
            index.cut = found < count || count > 0 && feed.ragged().is_some_and(is_short);
            if !index.cut {
                index.frames.push(Span { offset: 0, line: 1, bytes: None });
            }
            return Ok(index);
        }
        skip(feed, &header, &it.name)?;
        section = next_section(feed)?;
    }
    // A file of no atoms has no section of them.
    match count {
        0 => index.frames.push(Span { offset: 0, line: 1, bytes: None }),
        _ => index.cut = true,
    }
    Ok(index)
}

fn count(feed: &Feed, header: &Header) -> Result<u64> {
    header.count("atoms").ok_or_else(|| feed.fault("the header has no line '… atoms'", HINT))
}

/// Passes over the rows of a section, if the header says how many there are.
fn skip(feed: &mut Feed, header: &Header, name: &str) -> Result<()> {
    if let Some((_, what)) = ROWS.iter().find(|(section, _)| *section == name) {
        feed.skip_lines(header.count(what).unwrap_or(0))?;
    }
    Ok(())
}

/// Reads the atoms.
pub(crate) fn frame(feed: &mut Feed, request: &Request, progress: &dyn Progress) -> Result<Frame> {
    let (header, mut section) = Header::read(feed)?;
    let count = count(feed, &header)?;
    let mut conventions = Vec::new();
    let (mut names, mut atoms, mut velocities) = (Vec::new(), None, None);
    let (mut types, mut bonds) = (Types::default(), Vec::new());
    while let Some(it) = section {
        let sample = Sample::of(peek_rows(feed)?);
        match it.name.as_str() {
            "Atoms" if count > 0 => {
                let line = feed.line_number();
                let told = match &request.options.columns {
                    Some(columns) => Ok((columns.clone(), format!("columns: {}", columns.join(" ")))),
                    None => columns::of_atoms(&it.comment, &sample),
                };
                let hint =
                    "name the columns: --columns id,type,x,y,z, or write 'Atoms # full', the atom style";
                let (told, convention) =
                    told.map_err(|what| Error::format(feed.path(), format!("line {line}"), what, hint))?;
                names = told;
                conventions.push(convention);
                let layout = layout(feed, &names, Some(header.cell.center()))?;
                if !(0..3).all(|axis| layout.roles.contains(&Role::Axis(axis))) {
                    let what = format!("no coordinates among the columns: {}", names.join(" "));
                    return Err(Error::format(feed.path(), format!("line {line}"), what, hint));
                }
                atoms = Some(rows::read(feed, &layout, Some(count), request.bytes, progress)?);
            }
            "Velocities" if count > 0 => {
                let names = columns::of_velocities(&names, &sample);
                let layout = layout(feed, &names, None)?;
                velocities = Some(rows::read(feed, &layout, Some(count), request.bytes, progress)?);
            }
            "Bonds" => bonds = bonded(feed, header.count("bonds"))?,
            "Masses" => types.masses(feed, header.count("atom types"))?,
            "Atom Type Labels" => types.labels(feed, header.count("atom types"))?,
            name => skip(feed, &header, name)?,
        }
        section = next_section(feed)?;
    }

    let atoms = match atoms {
        Some(atoms) => atoms,
        None if count == 0 => Rows { positions: Default::default(), attributes: vec![] },
        None => return Err(feed.fault("there is no section Atoms", HINT)),
    };
    let mut attributes = atoms.attributes;
    if let Some(velocities) = velocities {
        join(&mut attributes, velocities.attributes).map_err(|what| feed.fault(what, HINT))?;
    }
    let said = request.options.units.as_ref().and_then(|units| Some(units.style()?.name));
    let units = said.or(header.title_value("units"));
    types.tell(&mut attributes, &mut conventions, units);
    if names.iter().any(|it| it == "ix") {
        conventions.push("image flags ix iy iz: kept as attributes, not applied".to_string());
    }
    conventions.push("the file does not say whether the box repeats: taken as periodic".to_string());
    let mut warnings = Vec::new();
    let (bonds, unknown) = places(&bonds, &attributes);
    let missing = header.count("bonds").unwrap_or(0).saturating_sub((bonds.len() + unknown) as u64);
    if unknown > 0 {
        warnings.push(format!("left out {} bonds of atoms that are not there", grouped(unknown)));
    }
    if missing > 0 {
        warnings.push(format!("{} bonds of the header are not there", grouped(missing as usize)));
    }
    let left_out: Vec<String> = ["angles", "dihedrals", "impropers"]
        .iter()
        .filter_map(|what| Some((what, header.count(what).filter(|&it| it > 0)?)))
        .map(|(what, count)| format!("{} {what}", grouped(count as usize)))
        .collect();
    if !left_out.is_empty() {
        conventions.push(format!("left out: {}", left_out.join(", ")));
    }
    let mut columns = Columns {
        positions: atoms.positions,
        attributes,
        cell: Some(header.cell),
        time: header.title_value("timestep").and_then(|it| it.parse().ok()),
        bonds,
        ..Columns::default()
    };
    lammps::tell_units(&mut columns, false, header.title_value("units"));
    finish(columns, conventions, warnings)
}

/// The ids of the atoms of each bond.
fn bonded(feed: &mut Feed, count: Option<u64>) -> Result<Vec<[i64; 2]>> {
    let mut bonds = Vec::new();
    for _ in 0..count.unwrap_or(0) {
        let Some(line) = feed.line()? else { break };
        let mut ids = line.split_whitespace().skip(2).map(str::parse);
        let (Some(Ok(one)), Some(Ok(other))) = (ids.next(), ids.next()) else {
            let what = format!(
                "wanted a bond, its type and two atoms, found '{}'",
                rows::shortened(line.as_bytes())
            );
            return Err(feed.fault(what, HINT));
        };
        bonds.push([one, other]);
    }
    Ok(bonds)
}

/// The places of the atoms of each bond, and how many bonds name an atom that is not there.
fn places(bonds: &[[i64; 2]], attributes: &[Attribute]) -> (Vec<[u32; 2]>, usize) {
    let Some(ids) = attributes.iter().find(|it| it.name == "id").filter(|_| !bonds.is_empty()) else {
        return (Vec::new(), bonds.len());
    };
    let places: HashMap<i64, u32> =
        (0..ids.values.len()).map(|place| (ids.number(place, 0) as i64, place as u32)).collect();
    let place = |[one, other]: &[i64; 2]| Some([*places.get(one)?, *places.get(other)?]);
    let found: Vec<[u32; 2]> = bonds.iter().filter_map(place).collect();
    let unknown = bonds.len() - found.len();
    (found, unknown)
}

/// How rows with these columns are to be understood.
fn layout(feed: &mut Feed, names: &[String], origin: Option<DVec3>) -> Result<Layout> {
    let text = feed.peek(1 << 14)?;
    let own: Vec<u8> = text
        .split(|&byte| byte == b'\n')
        .take_while(|row| !row.trim_ascii().is_empty())
        .flat_map(|row| row.iter().copied().chain([b'\n']))
        .collect();
    let kinds = rows::kinds(&own, Separator::BLANKS, names.len());
    let (mut roles, mut headings) = (Vec::new(), Vec::new());
    for (name, kind) in names.iter().zip(kinds) {
        if let Some(axis) = ["x", "y", "z"].iter().position(|it| it == name) {
            roles.push(Role::Axis(axis));
            continue;
        }
        let is_counted =
            ["id", "mol", "type", "ix", "iy", "iz"].contains(&name.as_str()) || name.ends_with("flag");
        let kind = if kind == Kind::Integer && !is_counted { Kind::Float } else { kind };
        roles.push(Role::Attribute(headings.len()));
        headings.push(Heading::scalar(name, kind));
    }
    Ok(Layout { separator: Separator::BLANKS, roles, headings, scaled: None, gaps: true, origin })
}

/// Puts the columns `more` behind `attributes`, in the order of their ids.
fn join(attributes: &mut Vec<Attribute>, mut more: Vec<Attribute>) -> std::result::Result<(), String> {
    let Some(ids) = attributes.iter().find(|it| it.name == "id") else {
        return Err("velocities need ids, and the columns of Atoms have none".to_string());
    };
    let theirs = more.remove(0);
    if ids.values != theirs.values {
        let key = |values: &Values, place: usize| values.number(place).to_bits();
        let places: HashMap<u64, usize> =
            (0..theirs.values.len()).map(|place| (key(&theirs.values, place), place)).collect();
        let place = |atom: usize| {
            let place = places.get(&key(&ids.values, atom)).copied();
            place.ok_or_else(|| format!("atom {} has no velocity", ids.number(atom, 0)))
        };
        let order: Vec<usize> = (0..ids.values.len()).map(place).collect::<std::result::Result<_, _>>()?;
        for attribute in &mut more {
            if let Values::F32(values) = &mut attribute.values {
                *values = order.iter().map(|&place| values[place]).collect();
            } else {
                let number = |&place: &usize| attribute.values.number(place);
                attribute.values = Values::F64(order.iter().map(number).collect());
            }
        }
    }
    attributes.extend(more);
    Ok(())
}

/// What the file says of its atom types, by the word that the column `type` has for them.
#[derive(Default)]
struct Types {
    masses: HashMap<String, f64>,
    /// The words of comments behind masses.
    comments: HashMap<String, String>,
    /// The label of each number.
    labels: HashMap<String, String>,
}

impl Types {
    fn masses(&mut self, feed: &mut Feed, count: Option<u64>) -> Result<()> {
        for _ in 0..count.unwrap_or(0) {
            let Some(line) = feed.line()? else { break };
            let (values, comment) = line.split_once('#').unwrap_or((&line, ""));
            let mut words = values.split_whitespace();
            let (name, mass) =
                (words.next(), words.next().and_then(|it| fast_float2::parse::<f64, _>(it).ok()));
            let (Some(name), Some(mass)) = (name, mass) else {
                let what =
                    format!("wanted a type and its mass, found '{}'", rows::shortened(line.as_bytes()));
                return Err(feed.fault(what, HINT));
            };
            self.masses.insert(name.to_string(), mass);
            self.comments.insert(name.to_string(), comment.trim().to_string());
        }
        Ok(())
    }

    fn labels(&mut self, feed: &mut Feed, count: Option<u64>) -> Result<()> {
        for _ in 0..count.unwrap_or(0) {
            let Some(line) = feed.line()? else { break };
            let mut words = line.split_whitespace();
            if let (Some(number), Some(label)) = (words.next(), words.next()) {
                self.labels.insert(number.to_string(), label.to_string());
            }
        }
        Ok(())
    }

    /// The element of a type: by its label or comment where that is a symbol, else by its mass.
    fn element(&self, name: &str) -> Option<Element> {
        let exact = |word: &str| Element::from_symbol(word).filter(|it| it.symbol() == word);
        let label = self.labels.get(name).map_or(name, String::as_str);
        let comment = self.comments.get(name).map_or("", String::as_str);
        exact(label).or_else(|| exact(comment)).or_else(|| Element::from_mass(*self.masses.get(name)?))
    }

    /// Adds the columns `mass`, `type_label` and `element`, as far as they are known.
    fn tell(&self, attributes: &mut Vec<Attribute>, conventions: &mut Vec<String>, units: Option<&str>) {
        let Some(kinds) = attributes.iter().find(|it| it.name == "type") else { return };
        // The types that there are, each once, and which of them each atom has.
        let (names, codes) = match kinds.values.view() {
            View::Text { codes, names } => (names.to_vec(), codes.to_vec()),
            _ => {
                let values = &kinds.values;
                let mut numbers: Vec<i64> =
                    (0..values.len()).map(|place| values.number(place) as i64).collect();
                let all = numbers.clone();
                numbers.sort_unstable();
                numbers.dedup();
                let code = |it: &i64| numbers.partition_point(|known| known < it) as u32;
                (numbers.iter().map(i64::to_string).collect(), all.iter().map(code).collect())
            }
        };
        let mut more = Vec::new();
        if !attributes.iter().any(|it| it.name == "mass")
            && names.iter().all(|it| self.masses.contains_key(it))
        {
            let mass = |code: &u32| self.masses[&names[*code as usize]] as f32;
            more.push(Attribute::new("mass", 1, Values::F32(codes.iter().map(mass).collect())));
        }
        let labels: Option<Vec<String>> = names.iter().map(|it| self.labels.get(it).cloned()).collect();
        if let Some(names) = labels {
            more.push(Attribute::new("type_label", 1, Values::Text { codes: codes.clone(), names }));
        }
        let elements: Option<Vec<Element>> = names.iter().map(|name| self.element(name)).collect();
        // Masses of 1 and 4 are as often plain numbers as hydrogen and helium.
        let heavy = |it: &Element| !["H", "He"].contains(&it.symbol());
        if let Some(elements) = elements.filter(|it| it.iter().any(heavy) && units != Some("lj")) {
            let told: Vec<String> = names
                .iter()
                .zip(&elements)
                .map(|(name, element)| format!("{name} {}", element.symbol()))
                .collect();
            conventions.push(format!("elements of types by label or mass: {}", told.join(", ")));
            let names = elements.iter().map(|it| it.symbol().to_string()).collect();
            more.push(Attribute::new("element", 1, Values::Text { codes, names }));
        }
        attributes.extend(more.into_iter().filter(|it| !it.values.is_empty()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::real_data;
    use crate::sequence::Options;

    const SMALL: &str = "made up, timestep = 40, units = real\n\n2 atoms\n3 bonds\n2 atom types\n\n-1 1 xlo xhi\n0 4 ylo yhi # tall\n\
        0 8 zlo zhi\n0.5 0 -1 xy xz yz\n\nMasses\n\n1 15.9994 # OW\n2 1.008\n\nPair Coeffs # lj/cut\n\n1 0.1 3\n2 0 0\n\n\
        Atoms # full\n\n7 1 2 0.5 0.25 0.5 -1 0 0 1 # second\n3 1 1 -1 0.5 0.5 0.5 0 0 0\n\n\
        Velocities\n\n3 1 2 3\n7 -1 -2 -3\n\nBonds\n\n1 1 3 7\n2 1 7 3\n3 1 3 9\n";

    fn read(text: &str) -> Result<Frame> {
        real_data::open(text.as_bytes()).map(|mut frames| frames.remove(0))
    }

    fn message(text: &str) -> String {
        read(text).unwrap_err().to_string()
    }

    #[test]
    fn sections_are_read_and_joined_by_id() {
        for text in [SMALL.to_string(), SMALL.replace('\n', "\r\n"), SMALL.trim_end().to_string()] {
            let frame = read(&text).unwrap();
            let particles = &frame.particles;
            let names: Vec<&str> = particles.attributes().iter().map(|it| it.name.as_str()).collect();
            assert_eq!(
                names,
                ["id", "mol", "type", "q", "ix", "iy", "iz", "vx", "vy", "vz", "mass", "element"]
            );
            assert_eq!(particles.positions().world(0), DVec3::new(0.25, 0.5, -1.0));
            assert_eq!(particles.attribute("vx").unwrap().values, Values::F32(vec![-1.0, 1.0]));
            assert_eq!(particles.attribute("mass").unwrap().values, Values::F32(vec![1.008, 15.9994]));
            assert_eq!(particles.attribute("iz").unwrap().values, Values::I32(vec![1, 0]));
            let Values::Text { codes, names } = &particles.attribute("element").unwrap().values else {
                panic!()
            };
            assert_eq!((codes.as_slice(), names.join(" ").as_str()), (&[1, 0][..], "O H"));
            let cell = particles.cell().unwrap();
            assert_eq!((cell.origin, cell.periodic), (DVec3::new(-1.0, 0.0, 0.0), [true; 3]));
            assert_eq!(cell.vectors[1..], [DVec3::new(0.5, 4.0, 0.0), DVec3::new(0.0, -1.0, 8.0)]);
            assert_eq!((particles.time(), particles.length_unit()), (Some(40.0), Some("Å")));
            assert_eq!(frame.conventions[0], "atom style full: id mol type q x y z ix iy iz");
            assert_eq!(particles.bonds(), [[0, 1]]);
            assert_eq!(frame.warnings, ["left out 1 bonds of atoms that are not there"]);
        }
    }

    #[test]
    fn bonds_that_are_cut_or_malformed_are_told() {
        let cut = read(SMALL.strip_suffix("3 1 3 9\n").unwrap()).unwrap();
        assert_eq!(cut.warnings, ["1 bonds of the header are not there"]);
        assert!(
            message(&SMALL.replace("3 1 3 9", "3 1 x 9")).contains("wanted a bond, its type and two atoms")
        );
    }

    #[test]
    fn styles_types_as_words_and_general_boxes_are_read() {
        let text = "t\n1 atoms\n1 atom types\n1 2 0 avec\n0 3 0 bvec\n0 0 4 cvec\n5 6 7 abc origin\n\n\
            Atom Type Labels\n\n1 Cu\n\nMasses\n\nCu 63.55\n\nAtoms # sphere\n\n1 Cu 3 1 0 0 0\n";
        let particles = read(text).unwrap().particles;
        let cell = particles.cell().unwrap();
        assert_eq!((cell.origin, cell.vectors[0]), (DVec3::new(5.0, 6.0, 7.0), DVec3::new(1.0, 2.0, 0.0)));
        assert_eq!(particles.radius(particles.radii().unwrap(), 0), 1.5);
        assert_eq!(particles.attribute("type").unwrap().values.type_name(), "text");
        assert_eq!(particles.attribute("mass").unwrap().number(0, 0), f64::from(63.55f32));
        assert!(particles.attribute("element").is_some());
        let lj = "t\n1 atoms\n1 atom types\n\nMasses\n\n1 1.0\n\nAtoms\n\n1 1 0.5 0 0\n";
        let lj = read(lj).unwrap().particles;
        assert!(lj.attribute("element").is_none() && lj.cell().unwrap().origin == DVec3::splat(-0.5));
        // Masses are those of elements unless somebody says that units are reduced.
        let has_element = |units: &str| {
            let options = Options { units: units.parse().ok(), ..Options::default() };
            let frames =
                real_data::frames(&real_data::recognised(text.as_bytes()).open, text.as_bytes(), &options);
            frames.unwrap()[0].particles.attribute("element").is_some()
        };
        assert!(has_element("metal") && has_element("") && !has_element("lj"));
    }

    #[test]
    fn none_is_fine_and_what_is_missing_is_said() {
        assert!(read("t\n0 atoms\n").unwrap().particles.is_empty());
        assert!(
            message("t\n1 atoms\n1 bogus xlo xhi\n\nAtoms\n\n1 1 0.5 0 0\n")
                .contains("the header's line '1 bogus xlo xhi'")
        );
        assert!(message(&SMALL.replace("7 -1 -2 -3", "8 -1 -2 -3")).contains("atom 7 has no velocity"));
        assert!(message(&SMALL.replace("# full", "# dipole")).contains("--columns"));
        assert!(message(&SMALL.replace("0.5 0.5 0.5 0 0 0", "0.5 0.5 x 0 0 0")).contains("'x'"));
        let named = Options {
            columns: Some("id mol q type x y z ix iy iz".split(' ').map(str::to_string).collect()),
            ..Options::default()
        };
        let frames =
            real_data::frames(&real_data::recognised(SMALL.as_bytes()).open, SMALL.as_bytes(), &named)
                .unwrap();
        assert_eq!(frames[0].particles.attribute("q").unwrap().values, Values::F32(vec![2.0, 1.0]));
    }

    #[test]
    fn a_file_cut_within_its_atoms_has_no_frame() {
        let end = SMALL.find("\n\nVelocities").unwrap();
        let start = SMALL.find("7 1 2").unwrap();
        for length in start..end - 1 {
            let index = index(&mut Feed::over(std::path::Path::new("test"), &SMALL.as_bytes()[..length]));
            assert!(index.unwrap().frames.is_empty(), "{}", &SMALL[start..length]);
        }
        let huge = SMALL.replacen("2 atoms", "1152921504606846976 atoms", 1);
        let index = index(&mut Feed::over(std::path::Path::new("test"), huge.as_bytes())).unwrap();
        assert!(index.cut && index.frames.is_empty());
    }

    #[test]
    fn damage_never_panics() {
        let open = &real_data::recognised(SMALL.as_bytes()).open;
        real_data::damage(SMALL.as_bytes(), |file| drop(real_data::frames(open, file, &Options::default())));
    }
}
