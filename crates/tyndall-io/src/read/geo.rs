//! Houdini's text geometry, GEO version 5: what Houdini before 12 and partio write.
//!
//! Takes the whole file, gives its points with their point attributes; primitives, groups and other attributes are left out, said. A
//! header of counts, a line for each point attribute, then for every point x y z w and its attributes in parentheses. Source: partio
//! (Disney, BSD), GEO.cpp.

use std::path::Path;

use tyndall::scene::wanted::Wanted;
use tyndall::{Columns, Error, Progress, Result};

use super::bgeo::{WEIGHTS_ARE_KEPT, left_out, spell_out};
use super::column::{Kind, Separator};
use super::feed::Feed;
use super::finish;
use super::rows::{self, Heading, Layout, Role};
use crate::sequence::Frame;

const HINT: &str = "write it again as .geo of version 5 or as .bhclassic";
/// More values than these are a mistake, or an attack.
const MOST_VALUES: usize = 1 << 16;

/// Whether the file begins like one.
pub(crate) fn recognise(head: &[u8]) -> bool {
    head.starts_with(b"PGEOMETRY")
}

/// Reads the points.
pub(crate) fn read(
    path: &Path,
    bytes: &[u8],
    wanted: Option<&Wanted>,
    progress: &dyn Progress,
) -> Result<Frame> {
    let mut words = Words { path, bytes, place: 0 };
    let magic = [words.next()?, words.next()?];
    if magic != ["PGEOMETRY", "V5"] {
        return Err(words.fault(format!("PGEOMETRY V5 was wanted, '{}' was found", magic.join(" "))));
    }
    let counts = Counts::read(&mut words)?;
    let mut definitions = match counts.point_attributes {
        0 => vec![],
        _ => {
            words.expect("PointAttrib")?;
            (0..counts.point_attributes).map(|_| Definition::read(&mut words)).collect::<Result<Vec<_>>>()?
        }
    };
    // What has no components has no values.
    definitions.retain(|it: &Definition| it.components > 0);
    let values = 4 + definitions.iter().map(|it| it.components).sum::<usize>();
    if values > MOST_VALUES {
        return Err(words.fault(format!("{values} values a point")));
    }
    let mut roles: Vec<Role> = (0..3).map(Role::Axis).collect();
    roles.push(Role::Skipped);
    let mut headings = Vec::new();
    for definition in &definitions {
        roles.extend((0..definition.components).map(|_| Role::Attribute(headings.len())));
        let Definition { name, components, kind, .. } = definition;
        headings.push(Heading { name: name.clone(), components: *components, kind: *kind, unit: None });
    }

    // From here on parentheses mean no more than blanks.
    let start = words.place + words.bytes[words.place..].iter().take_while(|it| **it != b'\n').count() + 1;
    let start = start.min(bytes.len());
    let blank = |byte: &u8| if matches!(byte, b'(' | b')') { b' ' } else { *byte };
    let mut text: Vec<u8> = bytes[..start].iter().map(|it| if *it == b'\n' { b'\n' } else { b' ' }).collect();
    text.extend(bytes[start..].iter().map(blank));
    let mut feed = Feed::over(path, &text);
    let lines = memchr::memchr_iter(b'\n', &text[..start]).count() as u64;
    feed.skip_lines(lines)?;
    let mut layout =
        Layout { separator: Separator::BLANKS, roles, headings, scaled: None, gaps: false, origin: None };
    layout.keep(wanted);
    // The fourth coordinate is always looked at.
    layout.roles[3] = Role::Attribute(layout.headings.len());
    layout.headings.push(Heading::scalar("Pw", Kind::Float));
    let rows =
        rows::read(&mut feed, &layout, Some(counts.points), Some((bytes.len() - start) as u64), progress)?;

    let mut attributes = rows.attributes;
    let weights = attributes.pop().expect("its heading is the last one");
    let mut definitions = definitions.into_iter();
    for attribute in &mut attributes {
        let is_its = |it: &Definition| it.name == attribute.name && it.components == attribute.components;
        if let Some(names) = definitions.find(is_its).and_then(|it| it.names) {
            spell_out(attribute, names);
        }
    }
    let mut conventions = Vec::new();
    if (0..rows.positions.len()).any(|id| weights.number(id, 0) != 1.0) {
        conventions.push(WEIGHTS_ARE_KEPT.into());
        attributes.push(weights);
    }
    let columns = Columns { positions: rows.positions, attributes, ..Columns::default() };
    finish(columns, conventions, left_out(counts.primitives, counts.other_attributes))
}

/// The counts at the beginning that matter here.
#[derive(Default)]
struct Counts {
    points: u64,
    primitives: u64,
    point_attributes: u64,
    other_attributes: u64,
}

impl Counts {
    fn read(words: &mut Words) -> Result<Self> {
        let mut counts = Self::default();
        loop {
            let name = words.next()?;
            let number = words.number("a count")?;
            match name.as_str() {
                "NPoints" => counts.points = number,
                "NPrims" => counts.primitives = number,
                "NPointAttrib" => counts.point_attributes = number,
                "NVertexAttrib" | "NPrimAttrib" => {
                    counts.other_attributes = counts.other_attributes.saturating_add(number)
                }
                "NAttrib" => {
                    counts.other_attributes = counts.other_attributes.saturating_add(number);
                    return Ok(counts);
                }
                _ => {}
            }
        }
    }
}

/// A point attribute.
struct Definition {
    name: String,
    components: usize,
    kind: Kind,
    /// The words that the integers count, for an attribute of words.
    names: Option<Vec<String>>,
}

impl Definition {
    fn read(words: &mut Words) -> Result<Self> {
        let name = words.next()?;
        let components = words.number("how many components")? as usize;
        if components > MOST_VALUES {
            return Err(words.fault(format!("attribute '{name}' has {components} components")));
        }
        let word = words.next()?;
        let kind = match word.as_str() {
            "float" | "vector" => Kind::Float,
            "int" | "index" => Kind::Integer,
            other => {
                let what =
                    format!("attribute '{name}' has type '{other}'; float, vector, int and index are known");
                return Err(words.fault(what));
            }
        };
        let mut names = None;
        if word == "index" {
            let count = words.number("how many words")?;
            names = Some((0..count).map(|_| words.next()).collect::<Result<Vec<_>>>()?);
        } else {
            for _ in 0..components {
                words.next()?; // The default value, which no point needs.
            }
        }
        Ok(Self { name, components, kind, names })
    }
}

/// Words of the header, which may be quoted.
struct Words<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    place: usize,
}

impl Words<'_> {
    fn fault(&self, what: impl Into<String>) -> Error {
        let line = 1 + memchr::memchr_iter(b'\n', &self.bytes[..self.place]).count();
        Error::format(self.path, format!("line {line}"), what, HINT)
    }

    /// The next word.
    fn next(&mut self) -> Result<String> {
        let rest = &self.bytes[self.place..];
        let start = rest.iter().position(|it| !it.is_ascii_whitespace());
        let start = start.ok_or_else(|| self.fault("the file ends inside its header"))?;
        let rest = &rest[start..];
        let mut word = Vec::new();
        let quoted = rest[0] == b'"';
        let mut at = usize::from(quoted);
        loop {
            match rest.get(at) {
                Some(b'\\') if quoted => {
                    word.extend(rest.get(at + 1));
                    at += 2;
                }
                Some(b'"') if quoted => {
                    at += 1;
                    break;
                }
                Some(byte) if quoted || !byte.is_ascii_whitespace() => {
                    word.push(*byte);
                    at += 1;
                }
                None if quoted => return Err(self.fault("a quoted word has no end")),
                _ => break,
            }
        }
        self.place += start + at;
        Ok(String::from_utf8_lossy(&word).into_owned())
    }

    fn number(&mut self, what: &str) -> Result<u64> {
        let word = self.next()?;
        word.parse().map_err(|_| self.fault(format!("{what} was wanted, '{word}' was found")))
    }

    fn expect(&mut self, wanted: &str) -> Result<()> {
        let word = self.next()?;
        if word == wanted {
            Ok(())
        } else {
            Err(self.fault(format!("{wanted} was wanted, '{word}' was found")))
        }
    }
}

#[cfg(test)]
mod tests {
    use tyndall::Values;

    use super::*;
    use crate::read::real_data;

    const TEXT: &str = "PGEOMETRY V5\nNPoints 2 NPrims 1\nNPointGroups 0 NPrimGroups 0\n\
        NPointAttrib 3 NVertexAttrib 0 NPrimAttrib 0 NAttrib 0\nPointAttrib\nv 3 vector 0 0 0\nid 1 int 0\n\
        kind 1 index 2 \"wet \\\"one\\\"\" dry\n0 0.5 1 1 (1 2 3\t7 1)\n-1 2 3e1 1 (4 5 6\t8 0)\nPart 2 0 1 [0]\n\
        beginExtra\nendExtra\n";

    fn read_text(text: &str) -> Result<Frame> {
        read(Path::new("test"), text.as_bytes(), None, &())
    }

    #[test]
    fn points_keep_their_attributes() {
        for text in [TEXT.to_string(), TEXT.replace('\n', "\r\n")] {
            let frame = read_text(&text).unwrap();
            let particles = &frame.particles;
            assert_eq!(particles.positions().world(1).to_array(), [-1.0, 2.0, 30.0]);
            assert_eq!(particles.attribute("v").unwrap().number(1, 2), 6.0);
            assert_eq!(particles.attribute("id").unwrap().values, Values::I32(vec![7, 8]));
            let names = ["wet \"one\"", "dry"].map(String::from).to_vec();
            assert_eq!(
                particles.attribute("kind").unwrap().values,
                Values::Text { codes: vec![1, 0], names }
            );
            assert_eq!((frame.warnings.len(), frame.conventions.len()), (1, 0));
            assert!(particles.attribute("Pw").is_none());
        }
        let frame = read_text(&TEXT.replace("0.5 1 1", "0.5 1 2")).unwrap();
        assert_eq!(
            (frame.particles.attribute("Pw").unwrap().number(0, 0), frame.conventions.len()),
            (2.0, 1)
        );
        let bare = "PGEOMETRY V5\nNPoints 1 NPrims 0\nNPointGroups 0 NPrimGroups 0\n\
            NPointAttrib 0 NVertexAttrib 0 NPrimAttrib 0 NAttrib 0\n1 2 3 1";
        assert_eq!(read_text(bare).unwrap().particles.len(), 1);
        assert_eq!(read_text(&bare.replace("NPoints 1", "NPoints 0")).unwrap().particles.len(), 0);
    }

    #[test]
    fn faults_are_told_with_their_line() {
        for (from, to, what) in [
            ("V5", "V6", "'PGEOMETRY V6' was found"),
            ("NPoints 2", "NPoints x", "line 2"),
            ("id 1 int", "id 1 real", "has type 'real'"),
            ("PointAttrib\nv", "v", "PointAttrib was wanted"),
            ("(4 5 6\t8 0)", "(4 5 6)", "line 10"),
            ("NPoints 2", "NPoints 9", "line"),
        ] {
            let message = read_text(&TEXT.replacen(from, to, 1)).unwrap_err().to_string();
            assert!(message.contains(what), "{to}: {message}");
        }
        real_data::damage(TEXT.as_bytes(), |file| drop(read(Path::new("test"), file, None, &())));
    }

    #[test]
    fn a_real_file_is_read_as_partio_reads_it() {
        real_data::compare("houdini/partio_test.geo", recognise, |path, bytes, progress| {
            read(path, bytes, None, progress)
        });
    }
}
