//! Configurations of IMD, the molecular dynamics program of ITAP (Stuttgart), as text; OVITO writes them too.
//!
//! Lines that begin with `#`: `#F A n t m p v d` says how many columns there are of a number, a type, a mass, coordinates, velocities and other
//! data; `#C` names them all, `#X`, `#Y` and `#Z` are the edges of the box, `#E` ends them. Then an atom a row, or binary: see
//! `imd_binary.rs`. Units are those of the simulation, which the file does not tell. Source: "The IMD user guide", configuration files.

use tyndall::particles::Cell;
use tyndall::{Columns, DVec3, Progress, Result};

use super::column::{Kind, Separator};
use super::feed::Feed;
use super::rows::{self, Heading, Layout, Role};
use super::{Index, Request, Span, finish, molecules, table};
use crate::sequence::Frame;

const HINT: &str = "compare it with the description of configuration files in IMD's user guide";
/// More columns than this are a mistake, or an attack.
const MOST_COLUMNS: usize = 1 << 12;

/// How the atoms are written, if the file begins with a line of the format: `A`, or a letter of a binary form.
pub(super) fn form(head: &[u8]) -> Option<u8> {
    let line = head.split(|&byte| byte == b'\n').next().unwrap_or_default();
    let words: Vec<&[u8]> = line.split(u8::is_ascii_whitespace).filter(|it| !it.is_empty()).collect();
    match words[..] {
        [b"#F", &[form @ (b'A' | b'B' | b'L' | b'b' | b'l')], _, _, _, _, _, _] => Some(form),
        _ => None,
    }
}

/// Whether the file begins with a line of the format, and has text.
pub(crate) fn recognise(head: &[u8]) -> bool {
    form(head) == Some(b'A')
}

/// What stands before the atoms.
pub(super) struct Header {
    /// The letter of the form of the atoms.
    pub(super) form: char,
    pub(super) roles: Vec<Role>,
    pub(super) headings: Vec<Heading>,
    names: Vec<String>,
    edges: [Option<DVec3>; 3],
}

impl Header {
    /// Takes its lines.
    pub(super) fn read(feed: &mut Feed) -> Result<Self> {
        let (mut counts, mut names, mut edges) = (None, Vec::new(), [None; 3]);
        loop {
            let Some(line) = feed.line()? else {
                return Err(feed.fault("the file ends before #E, the line behind which the atoms are", HINT));
            };
            let (key, rest) = line.split_at_checked(2).unwrap_or((&line, ""));
            let words: Vec<&str> = rest.split_whitespace().collect();
            match key {
                "#F" => counts = Some(Self::counts(&words).map_err(|(what, hint)| feed.fault(what, hint))?),
                "#C" => names = words.iter().map(|it| it.to_string()).collect(),
                "#X" | "#Y" | "#Z" => {
                    let numbers: Vec<f64> =
                        words.iter().map_while(|it| fast_float2::parse(it).ok()).collect();
                    let [x, y, rest @ ..] = &numbers[..] else {
                        let what = format!(
                            "wanted an edge of the box, found '{}'",
                            rows::shortened(line.as_bytes())
                        );
                        return Err(feed.fault(what, HINT));
                    };
                    let edge = DVec3::new(*x, *y, rest.first().copied().unwrap_or(0.0));
                    edges[usize::from(key.as_bytes()[1] - b'X')] = Some(edge);
                }
                "#E" => break,
                _ if key.starts_with('#') || line.trim().is_empty() => {}
                _ => {
                    let what =
                        format!("wanted #E before the atoms, found '{}'", rows::shortened(line.as_bytes()));
                    return Err(feed.fault(what, HINT));
                }
            }
        }
        let (form, counts) = counts.ok_or_else(|| feed.fault("there is no line #F before #E", HINT))?;
        let all: usize = counts.iter().sum();
        if !names.is_empty() && names.len() != all {
            let what = format!("#F tells {all} columns, #C has {} names", names.len());
            return Err(feed.fault(what, "let both tell the same columns"));
        }
        let (roles, headings) = columns(counts, &names);
        Ok(Self { form, roles, headings, names, edges })
    }

    /// Whether there are two coordinates only.
    fn is_flat(&self) -> bool {
        !self.roles.contains(&Role::Axis(2))
    }

    /// The box.
    pub(super) fn cell(&self) -> Option<Cell> {
        let [Some(a), Some(b), c] = self.edges else { return None };
        molecules::cell([a, b, c.unwrap_or(if self.is_flat() { DVec3::Z } else { DVec3::ZERO })])
    }

    /// What is to be told of the columns.
    pub(super) fn conventions(&self) -> Vec<String> {
        let names = (!self.names.is_empty()).then(|| format!("columns: {}", self.names.join(" ")));
        let flat = self.is_flat().then(|| "two-dimensional: z = 0".to_string());
        names.into_iter().chain(flat).collect()
    }

    /// The form and the numbers of columns of the line #F.
    fn counts(words: &[&str]) -> std::result::Result<(char, [usize; 6]), (String, &'static str)> {
        let [form, counts @ ..] = words else { return Err(("#F is empty".into(), HINT)) };
        let form = match form.as_bytes() {
            [letter @ (b'A' | b'B' | b'L' | b'b' | b'l')] => char::from(*letter),
            _ => return Err((format!("wanted #F with one of A, B, L, b and l, found '#F {form}'"), HINT)),
        };
        let numbers: Vec<usize> = counts.iter().map_while(|it| it.parse().ok()).collect();
        match numbers[..] {
            [number @ 0..=1, kind @ 0..=1, mass @ 0..=1, places @ 2..=3, rates @ (0 | 2 | 3), others]
                if others <= MOST_COLUMNS =>
            {
                Ok((form, [number, kind, mass, places, rates, others]))
            }
            _ => Err((format!("wanted #F A n t m p v d, found '#F {}'", words.join(" ")), HINT)),
        }
    }
}

/// The columns, which have the names of `#C`, if there are any, but for those that other formats have too.
fn columns(
    [number, kind, mass, places, rates, others]: [usize; 6],
    names: &[String],
) -> (Vec<Role>, Vec<Heading>) {
    let (mut roles, mut headings) = (Vec::new(), Vec::new());
    for (there, name, kind) in
        [(number, "id", Kind::Integer), (kind, "type", Kind::Integer), (mass, "mass", Kind::Float)]
    {
        if there == 1 {
            roles.push(Role::Attribute(headings.len()));
            headings.push(Heading::scalar(name, kind));
        }
    }
    roles.extend((0..places).map(Role::Axis));
    if rates > 0 {
        roles.extend(std::iter::repeat_n(Role::Attribute(headings.len()), rates));
        headings.push(Heading { name: "velocity".into(), components: rates, kind: Kind::Float, unit: None });
    }
    for place in roles.len()..roles.len() + others {
        let name = names.get(place).cloned().unwrap_or_else(|| format!("c{}", place + 1));
        roles.push(Role::Attribute(headings.len()));
        headings.push(Heading::scalar(name, Kind::Float));
    }
    (roles, headings)
}

/// Takes the header of a text.
fn text(feed: &mut Feed) -> Result<Header> {
    let header = Header::read(feed)?;
    if header.form == 'A' {
        return Ok(header);
    }
    let what = format!("the atoms are binary (#F {})", header.form);
    Err(feed.fault(what, "leave out --format, or say imd-binary"))
}

/// A file is one frame, and does not tell how many atoms it has: nothing has to be read to know that.
pub(crate) fn index(feed: &mut Feed) -> Result<Index> {
    text(feed)?;
    Ok(Index { frames: vec![Span { offset: 0, line: 1, bytes: None }], ..Index::default() })
}

/// Reads the atoms.
pub(crate) fn frame(feed: &mut Feed, request: &Request, progress: &dyn Progress) -> Result<Frame> {
    let header = text(feed)?;
    let (cell, conventions) = (header.cell(), header.conventions());
    let Header { roles, headings, .. } = header;
    let origin = cell.map(|it| it.center()).filter(|it| it.is_finite());
    let mut layout =
        Layout { separator: Separator::BLANKS, roles, headings, scaled: None, gaps: true, origin };
    layout.keep(request.options.wanted.as_ref());
    let rows = rows::read(feed, &layout, None, request.bytes, progress)?;
    let warnings = table::cut(feed, rows.positions.len(), request)?.into_iter().collect();
    let columns =
        Columns { positions: rows.positions, attributes: rows.attributes, cell, ..Columns::default() };
    finish(columns, conventions, warnings)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use tyndall::Values;

    use super::*;
    use crate::read::real_data;
    use crate::sequence::Options;

    /// Written by OVITO 3, without its comments.
    const OVITO: &str = "#F A 1 1 1 3 3 1\n#C number type mass x y z vx vy vz PotentialEnergy\n#X 10.0 0.0 0.0\n#Y 1.0 11.0 0.0\n\
                         #Z 0.0 0.0 12.0\n## Generated by hand\n#E\n1 1 1.0 1.0 2.0 3.0 0.0 0.5 1.0 -1.0\n2 2 2.0 4.5 0.0 1.0 1.5 2.0 2.5 -2.0\n";

    fn read(text: &str) -> Result<Frame> {
        let (path, options) = (Path::new("a.imd"), Options::default());
        let request = Request { options: &options, bytes: None, units: None, topology: None, others: &() };
        index(&mut Feed::over(path, text.as_bytes()))?;
        frame(&mut Feed::over(path, text.as_bytes()), &request, &())
    }

    #[test]
    fn columns_and_box_are_those_that_ovito_wrote() {
        for text in [OVITO.to_string(), OVITO.replace('\n', "\r\n")] {
            assert!(recognise(text.as_bytes()));
            let particles = read(&text).unwrap().particles;
            assert_eq!(particles.positions().world(1), DVec3::new(4.5, 0.0, 1.0));
            assert_eq!(particles.attribute("id").unwrap().values, Values::I32(vec![1, 2]));
            assert_eq!(particles.attribute("type").unwrap().values, Values::I32(vec![1, 2]));
            assert_eq!(particles.attribute("mass").unwrap().number(1, 0), 2.0);
            assert_eq!(particles.attribute("velocity").unwrap().number(1, 2), 2.5);
            assert_eq!(particles.attribute("PotentialEnergy").unwrap().number(0, 0), -1.0);
            let cell = particles.cell().unwrap();
            assert_eq!((cell.vectors[1], cell.vectors[2]), (DVec3::new(1.0, 11.0, 0.0), 12.0 * DVec3::Z));
        }
    }

    #[test]
    fn columns_that_are_not_there_are_passed_over() {
        let frame = read("#F A 0 1 0 2 0 1\n#X 4 0\n#Y 0 5\n#E\n3 1 2 7.5\n0 3 2 -1\n").unwrap();
        let particles = &frame.particles;
        let names: Vec<&str> = particles.attributes().iter().map(|it| it.name.as_str()).collect();
        assert_eq!((names, particles.positions().world(1)), (vec!["type", "c4"], DVec3::new(3.0, 2.0, 0.0)));
        assert_eq!(particles.cell().unwrap().vectors[1], 5.0 * DVec3::Y);
        assert_eq!(frame.conventions, ["two-dimensional: z = 0"]);
    }

    #[test]
    fn what_is_wrong_is_said() {
        let message = |text: &str| read(text).err().unwrap().to_string();
        assert!(message(&OVITO.replace("#F A", "#F l")).contains("the atoms are binary"));
        assert!(message(&OVITO.replace("mass x", "x")).contains("#F tells 10 columns, #C has 9 names"));
        assert!(message(OVITO.split("#E").next().unwrap()).contains("ends before #E"));
        assert!(message(&OVITO.replace("#E\n", "")).contains("wanted #E before the atoms"));
        assert!(message(&OVITO.replace(" -2.0", "")).contains("wanted 10 values, found 9"));
        assert!(message(&OVITO.replace("#Y 1.0", "#Y high")).contains("wanted an edge"));
        assert!(!recognise(b"#F x y z\n1 2 3\n") && !recognise(b"# a b\n1 2\n"));
    }

    #[test]
    fn damage_never_panics() {
        real_data::damage(OVITO.as_bytes(), |file| drop(read(&String::from_utf8_lossy(file))));
    }
}
