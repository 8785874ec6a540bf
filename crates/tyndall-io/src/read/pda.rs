//! Maya's particle data as text, PDA.
//!
//! A line of names, a line of types (V vector, R real, I integer), a count, and a row for each particle. `position` is where it is.
//! Source: Autodesk's description of the PDA format, and partio (Disney, BSD), PDA.cpp.

use tyndall::{Columns, Progress, Result};

use super::column::{Kind, Separator};
use super::feed::Feed;
use super::rows::{self, Heading, Layout, Role};
use super::{Index, Request, Span, finish};
use crate::sequence::Frame;

const HINT: &str = "write it again as PDA, with an attribute position of type V";
/// More attributes than this are a mistake, or an attack.
const MOST_ATTRIBUTES: usize = 1 << 12;

/// Whether the file begins like one.
pub(crate) fn recognise(head: &[u8]) -> bool {
    head.trim_ascii_start()
        .strip_prefix(b"ATTRIBUTES")
        .is_some_and(|rest| rest.first().is_some_and(u8::is_ascii_whitespace) && super::is_text(head))
}

/// The layout of the rows, and how many there are.
struct Header {
    count: u64,
    roles: Vec<Role>,
    headings: Vec<Heading>,
}

impl Header {
    /// Takes the header's lines.
    fn read(feed: &mut Feed) -> Result<Self> {
        let names = Self::words_between(feed, "ATTRIBUTES", "TYPES")?;
        let mut types = Vec::new();
        let count = loop {
            let Some(line) = feed.line()? else {
                return Err(feed.fault("the file ends before NUMBER_OF_PARTICLES", HINT));
            };
            match line.trim().strip_prefix("NUMBER_OF_PARTICLES:") {
                Some(count) => break count.trim().to_string(),
                None => types.extend(line.split_whitespace().map(str::to_string)),
            }
            if types.len() > MOST_ATTRIBUTES {
                return Err(feed.fault("more types than attributes", HINT));
            }
        };
        let number = count.parse();
        let count =
            number.map_err(|_| feed.fault(format!("a count was wanted, '{count}' was found"), HINT))?;
        if names.len() != types.len() {
            let what = format!("{} attributes have {} types", names.len(), types.len());
            return Err(feed.fault(what, HINT));
        }
        let begin = feed.line()?.unwrap_or_default();
        if !begin.split_whitespace().eq(["BEGIN", "DATA"]) {
            return Err(feed.fault(format!("BEGIN DATA was wanted, '{begin}' was found"), HINT));
        }
        let (mut roles, mut headings, mut placed) = (Vec::new(), Vec::new(), false);
        for (name, kind) in names.into_iter().zip(types) {
            let (kind, components) = match kind.as_str() {
                "V" => (Kind::Float, 3),
                "R" => (Kind::Float, 1),
                "I" => (Kind::Integer, 1),
                other => {
                    return Err(
                        feed.fault(format!("'{name}' has type '{other}'; V, R and I are known"), HINT)
                    );
                }
            };
            if name == "position" && components == 3 && !placed {
                placed = true;
                roles.extend((0..3).map(Role::Axis));
            } else {
                roles.extend((0..components).map(|_| Role::Attribute(headings.len())));
                headings.push(Heading { name, components, kind, unit: None });
            }
        }
        if !placed {
            return Err(feed.fault("there is no attribute position", HINT));
        }
        Ok(Self { count, roles, headings })
    }

    /// The words between two lines that are `first` and `last`.
    fn words_between(feed: &mut Feed, first: &str, last: &str) -> Result<Vec<String>> {
        let mut words = Vec::new();
        let mut begun = false;
        while let Some(line) = feed.line()? {
            let mut line = line.trim();
            if !begun && !line.is_empty() {
                line = line.strip_prefix(first).unwrap_or(line);
                begun = true;
            }
            if line == last {
                return Ok(words);
            }
            words.extend(line.split_whitespace().map(str::to_string));
            if words.len() > MOST_ATTRIBUTES {
                break;
            }
        }
        Err(feed.fault(format!("the line {last} is missing"), HINT))
    }
}

/// Finds the frame: there is one.
pub(crate) fn index(feed: &mut Feed) -> Result<Index> {
    let (offset, line) = (feed.offset(), feed.line_number());
    let header = Header::read(feed)?;
    let found = feed.skip_lines(header.count)?;
    let fields = header.roles.len();
    let short = feed
        .ragged()
        .is_some_and(|row| header.count > 0 && rows::split(row, Separator::BLANKS).count() < fields);
    let mut index = Index { cut: feed.cut(), ..Index::default() };
    if found < header.count || short {
        index.cut = true;
    } else {
        index.frames.push(Span { offset, line, bytes: Some(feed.offset() - offset) });
    }
    Ok(index)
}

/// Reads the frame.
pub(crate) fn frame(feed: &mut Feed, request: &Request, progress: &dyn Progress) -> Result<Frame> {
    let Header { count, roles, headings } = Header::read(feed)?;
    let mut layout =
        Layout { separator: Separator::BLANKS, roles, headings, scaled: None, gaps: false, origin: None };
    layout.keep(request.options.wanted.as_ref());
    let rows = rows::read(feed, &layout, Some(count), request.bytes, progress)?;
    let columns = Columns { positions: rows.positions, attributes: rows.attributes, ..Columns::default() };
    finish(columns, vec![], vec![])
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use tyndall::Values;

    use super::*;
    use crate::read::real_data;
    use crate::sequence::Options;

    fn read(text: &[u8]) -> Result<Frame> {
        let index = index(&mut Feed::over(Path::new("test"), text))?;
        let mut feed = Feed::over(Path::new("test"), text);
        let options = Options::default();
        match index.frames.first() {
            Some(span) => frame(
                &mut feed,
                &Request { options: &options, bytes: span.bytes, units: None, topology: None, others: &() },
                &(),
            ),
            None => Err(feed.fault("cut", "")),
        }
    }

    const TEXT: &str = "ATTRIBUTES\n id position rgbPP\nTYPES\n I V V\nNUMBER_OF_PARTICLES: 2\nBEGIN DATA\n\
        7 1 2 3 0.5 0 1 \n-8 4 5 6 0 0 1e-3 \n";

    #[test]
    fn rows_are_particles() {
        for text in [TEXT.to_string(), TEXT.replace('\n', "\r\n"), TEXT.trim_end().to_string()] {
            assert!(recognise(text.as_bytes()));
            let particles = read(text.as_bytes()).unwrap().particles;
            assert_eq!(particles.positions().world(1).to_array(), [4.0, 5.0, 6.0]);
            assert_eq!(particles.attribute("id").unwrap().values, Values::I32(vec![7, -8]));
            let color = particles.attribute("rgbPP").unwrap();
            assert_eq!((color.components, color.number(1, 2)), (3, f64::from(1e-3f32)));
        }
        let none = TEXT.replace("PARTICLES: 2", "PARTICLES: 0");
        assert_eq!(read(none.as_bytes()).unwrap().particles.len(), 0);
    }

    #[test]
    fn faults_are_told() {
        for (from, to, what) in [
            (" I V V", " I V", "3 attributes have 2 types"),
            (" I V V", " I Q V", "has type 'Q'"),
            ("position", "place", "no attribute position"),
            ("BEGIN DATA", "BEGIN", "BEGIN DATA was wanted"),
            ("TYPES", "KINDS", "the line TYPES is missing"),
            (": 2", ": two", "'two' was found"),
            (": 2", ": 3", "cut"),
        ] {
            let message = read(TEXT.replace(from, to).as_bytes()).unwrap_err().to_string();
            assert!(message.contains(what), "{to}: {message}");
        }
        real_data::damage(TEXT.as_bytes(), |file| drop(read(file)));
    }

    #[test]
    fn a_real_file_is_read_as_partio_reads_it() {
        let read = |_: &Path, bytes: &[u8], _: &dyn Progress| read(bytes);
        real_data::compare("partio/fluid50.pda", recognise, read);
    }
}
