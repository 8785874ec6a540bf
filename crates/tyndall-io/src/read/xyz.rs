//! XYZ and extended XYZ: a count, a comment, and a line for every particle; again for every frame.
//!
//! Extended files say in the comment what the columns are: `Lattice="…" Properties=species:S:1:pos:R:3 pbc="T T F" Time=1.5`,
//! the lattice one cell vector after the other. Plain files have an element, a type or nothing before x, y, z; columns behind
//! them are numbered. Lengths are Å by convention. Source: the extended XYZ specification of libAtoms.

use tyndall::{Cell, Columns, DVec3, Error, Progress, Result};

use super::column::{Kind, Separator, number};
use super::feed::Feed;
use super::rows::{self, Heading, Layout, Role};
use super::{Index, Request, Span, finish, whole_lines};
use crate::sequence::Frame;

/// More columns than this are a mistake, or an attack.
const MOST_COLUMNS: usize = 1 << 16;

/// Whether the file begins like XYZ: a count, a comment, and a row with three numbers at its front or behind a word.
pub(crate) fn recognise(head: &[u8]) -> bool {
    if !super::is_text(head) {
        return false;
    }
    let mut lines = whole_lines(head).skip_while(|line| line.is_empty());
    let Some(count) = lines.next().and_then(|line| parse_count(&String::from_utf8_lossy(line))) else {
        return false;
    };
    let Some(comment) = lines.next() else { return count == 0 };
    let Some(row) = lines.next().filter(|row| !row.is_empty()) else { return count <= 1 };
    let numbers = are_numbers(row);
    let placed = |first: usize| numbers.len() >= first + 3 && numbers[first..first + 3].iter().all(|&it| it);
    let extended = memchr::memmem::find(comment, b"Properties=").is_some();
    // The same count of numbers where the comment should be: a list of points behind its length.
    let points = numbers.iter().all(|&it| it) && are_numbers(comment) == numbers;
    (extended || placed(0) || placed(1) || count == 0) && !points
}

fn are_numbers(line: &[u8]) -> Vec<bool> {
    let separator = Separator::BLANKS;
    let is_number =
        |token: &[u8]| matches!(number(token, separator), Some((_, taken)) if taken == token.len());
    rows::split(line, separator).map(is_number).collect()
}

fn parse_count(line: &str) -> Option<u64> {
    line.trim().parse().ok()
}

/// Finds the frames by their counts.
pub(crate) fn index(feed: &mut Feed) -> Result<Index> {
    let mut index = Index::default();
    loop {
        let (offset, line) = (feed.offset(), feed.line_number());
        let Some(count) = feed.line()? else { break };
        if count.is_empty() {
            continue;
        }
        let Some(count) = parse_count(&count) else {
            if feed.at_end()? && feed.cut() {
                index.cut = true;
                break;
            }
            let what = format!(
                "wanted the particle count of the next frame, found '{}'",
                rows::shortened(count.as_bytes())
            );
            return Err(feed.fault(what, "does the count of the frame before match its lines?"));
        };
        let comment = feed.line()?;
        let fields =
            feed.peek(1 << 10)?.split(|&byte| byte == b'\n').next().map_or(0, |row| are_numbers(row).len());
        let found = feed.skip_lines(count)?;
        let short =
            feed.ragged().is_some_and(|row| count > 0 && (feed.cut() || are_numbers(row).len() < fields));
        if comment.is_none() || found < count || short {
            index.cut = true;
            break;
        }
        index.frames.push(Span { offset, line, bytes: Some(feed.offset() - offset) });
    }
    index.cut |= feed.cut();
    Ok(index)
}

/// Reads a frame.
pub(crate) fn frame(feed: &mut Feed, request: &Request, progress: &dyn Progress) -> Result<Frame> {
    let count = feed.line()?.unwrap_or_default();
    let count = parse_count(&count).ok_or_else(|| {
        feed.fault(format!("wanted a particle count, found '{count}'"), "was the file changed?")
    })?;
    let comment = feed.line()?.unwrap_or_default();
    let pairs = pairs(&comment);
    let value = |key: &str| {
        pairs.iter().find(|(name, _)| name.eq_ignore_ascii_case(key)).map(|(_, value)| value.as_str())
    };

    let cell = match value("Lattice") {
        Some(lattice) => Some(
            cell(lattice, value("Origin").or(value("cell_origin")), value("pbc"))
                .map_err(|what| feed.fault(what, "write Lattice=\"ax ay az bx by bz cx cy cz\""))?,
        ),
        None => None,
    };
    let mut conventions = vec!["lengths: Å (XYZ convention)".to_string()];
    let fields = match value("Properties") {
        Some(properties) => extended(properties)
            .map_err(|what| feed.fault(what, "write for example Properties=species:S:1:pos:R:3"))?,
        None => {
            let fields = plain(feed, count, request)?;
            conventions.push(format!("columns: {}", names(&fields)));
            fields
        }
    };
    let (roles, headings) = fields;
    let origin = cell.map(|cell| cell.center()).filter(|center| center.is_finite());
    let mut layout =
        Layout { separator: Separator::BLANKS, roles, headings, scaled: None, gaps: false, origin };
    layout.keep(request.options.wanted.as_ref());
    let rows = rows::read(feed, &layout, Some(count), request.bytes, progress)?;
    let columns = Columns {
        positions: rows.positions,
        attributes: rows.attributes,
        radii: None,
        cell,
        time: value("Time")
            .or(value("Timestep"))
            .or(value("Step"))
            .and_then(|it| it.parse().ok())
            .or_else(|| lammps_step(&comment)),
        // A time's unit is not agreed upon; a step has none.
        time_unit: (value("Time").is_none()).then(|| "step".to_string()),
        length_unit: Some("Å".to_string()),
        bonds: Vec::new(),
    };
    finish(columns, conventions, Vec::new())
}

type Fields = (Vec<Role>, Vec<Heading>);

/// The names of all columns, coordinates too.
fn names((roles, headings): &Fields) -> String {
    let name = |role: &Role| match *role {
        Role::Axis(axis) => ["x", "y", "z"][axis],
        Role::Attribute(attribute) => headings[attribute].name.as_str(),
        Role::Skipped => "_",
    };
    roles.iter().map(name).collect::<Vec<_>>().join(" ")
}

/// The columns that `Properties=` tells: triples of name, type and count.
fn extended(properties: &str) -> std::result::Result<Fields, String> {
    let (mut roles, mut headings) = (Vec::new(), Vec::<Heading>::new());
    let words: Vec<&str> = properties.split(':').collect();
    if !words.len().is_multiple_of(3) {
        return Err(format!(
            "Properties={} is not made of name:type:count",
            rows::shortened(properties.as_bytes())
        ));
    }
    for triple in words.chunks_exact(3) {
        let [name, kind, count] = [triple[0], triple[1], triple[2]];
        let kind = match kind {
            "R" | "r" => Kind::Float,
            "I" | "i" => Kind::Integer,
            "S" | "s" => Kind::Text,
            "L" | "l" => Kind::Truth,
            other => return Err(format!("the type of {name} is '{other}', wanted R, I, S or L")),
        };
        let components = count.parse::<usize>().ok().filter(|count| (1..=4096).contains(count));
        let components = components.ok_or_else(|| format!("{name} has '{count}' columns"))?;
        let axis = ["x", "y", "z"].iter().position(|it| it.eq_ignore_ascii_case(name));
        let is_position = ["pos", "position", "positions"].iter().any(|it| it.eq_ignore_ascii_case(name));
        if is_position && components == 3 && !roles.contains(&Role::Axis(0)) {
            roles.extend([0, 1, 2].map(Role::Axis));
        } else if let Some(axis) = axis.filter(|&axis| components == 1 && !roles.contains(&Role::Axis(axis)))
        {
            roles.push(Role::Axis(axis));
        } else {
            roles.extend(std::iter::repeat_n(Role::Attribute(headings.len()), components));
            headings.push(Heading { name: name.to_string(), components, kind, unit: None });
        }
    }
    if roles.len() > MOST_COLUMNS {
        return Err(format!("Properties has {} columns, at most {MOST_COLUMNS} are read", roles.len()));
    }
    if !(0..3).all(|axis| roles.contains(&Role::Axis(axis))) {
        return Err("Properties has no pos:R:3".to_string());
    }
    Ok((roles, headings))
}

/// The columns of a plain file, by its first rows.
fn plain(feed: &mut Feed, count: u64, request: &Request) -> Result<Fields> {
    let line = feed.line_number();
    let path = feed.path().to_path_buf();
    let text = feed.peek(1 << 14)?;
    let text = &text
        [..memchr::memchr_iter(b'\n', text).nth((count.min(100) as usize).max(1) - 1).unwrap_or(text.len())];
    let row = text.split(|&byte| byte == b'\n').next().unwrap_or_default();
    let tokens: Vec<&[u8]> = rows::split(row, Separator::BLANKS).collect();
    if count == 0 {
        return Ok(([0, 1, 2].map(Role::Axis).to_vec(), Vec::new()));
    }
    if tokens.len() < 3 {
        let what = format!("wanted an element and x y z, found '{}'", rows::shortened(row));
        return Err(Error::format(path, format!("line {line}"), what, "is this an XYZ file?"));
    }
    let kinds = rows::kinds(text, Separator::BLANKS, tokens.len());
    if let Some(names) = &request.options.columns {
        return super::table::fields(names, &kinds, &path);
    }
    // x, y, z come first if there is no room for an element, or if what stands there is a number but no label.
    let labelled = tokens.len() > 3
        && (kinds[0] == Kind::Text || tokens[0].iter().all(|it| it.is_ascii_digit() || *it == b'-'));
    let (mut roles, mut headings) = (Vec::new(), Vec::new());
    for (column, &kind) in kinds.iter().enumerate() {
        let first = usize::from(labelled);
        if (first..first + 3).contains(&column) {
            roles.push(Role::Axis(column - first));
            continue;
        }
        let name = match (column, kind) {
            (0, Kind::Text) => "element".to_string(),
            (0, _) => "type".to_string(),
            _ => format!("c{}", column + 1),
        };
        roles.push(Role::Attribute(headings.len()));
        headings.push(Heading::scalar(name, kind));
    }
    Ok((roles, headings))
}

/// The cell of `Lattice=`, of which some write the lengths alone; it repeats along all edges unless `pbc` says otherwise.
fn cell(lattice: &str, origin: Option<&str>, pbc: Option<&str>) -> std::result::Result<Cell, String> {
    let numbers = |text: &str| -> Vec<f64> {
        let words =
            text.split(|it: char| it.is_whitespace() || ",[]".contains(it)).filter(|it| !it.is_empty());
        words.map(|word| fast_float2::parse(word).unwrap_or(f64::NAN)).collect()
    };
    let mut values = numbers(lattice);
    if let [x, y, z] = values[..] {
        values = vec![x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, z];
    }
    if values.len() != 9 || !values.iter().all(|it| it.is_finite()) {
        return Err(format!("Lattice has not nine numbers: '{}'", rows::shortened(lattice.as_bytes())));
    }
    let origin = origin.map(numbers).filter(|it| it.len() == 3 && it.iter().all(|it| it.is_finite()));
    let flags: Vec<bool> = pbc
        .unwrap_or("T T T")
        .split([' ', ',', '[', ']', '\t'])
        .filter(|it| !it.is_empty())
        .map(|it| matches!(it, "T" | "t" | "1" | "True" | "true"))
        .collect();
    Ok(Cell {
        origin: origin.map_or(DVec3::ZERO, |it| DVec3::from_slice(&it)),
        vectors: [0, 3, 6].map(|first| DVec3::from_slice(&values[first..first + 3])),
        periodic: std::array::from_fn(|axis| flags.get(axis).copied().unwrap_or(false)),
    })
}

/// `key=value` and `key="quoted value"`; a key alone has an empty value.
fn pairs(comment: &str) -> Vec<(String, String)> {
    let mut pairs = Vec::new();
    let mut rest = comment.trim_start();
    while !rest.is_empty() {
        let end = rest.find(|it: char| it == '=' || it.is_whitespace()).unwrap_or(rest.len());
        let key = rest[..end].trim_matches('"').to_string();
        rest = rest[end..].trim_start();
        let Some(tail) = rest.strip_prefix('=') else {
            pairs.push((key, String::new()));
            continue;
        };
        rest = tail.trim_start();
        let (value, tail) = value(rest);
        pairs.push((key, value));
        rest = tail.trim_start();
    }
    pairs
}

/// The value at the front of `rest`, without its quotes, and what follows.
fn value(rest: &str) -> (String, &str) {
    let closing = match rest.chars().next() {
        Some('"') => '"',
        Some('\'') => '\'',
        Some('{') => '}',
        _ => {
            let end = rest.find(char::is_whitespace).unwrap_or(rest.len());
            return (rest[..end].to_string(), &rest[end..]);
        }
    };
    let mut value = String::new();
    let mut letters = rest.char_indices().skip(1);
    while let Some((place, letter)) = letters.next() {
        if letter == closing {
            return (value, &rest[place + letter.len_utf8()..]);
        }
        // A backslash keeps the next letter from closing the quote.
        match (letter, letters.clone().next()) {
            ('\\', Some((_, next))) => {
                value.push(next);
                letters.next();
            }
            _ => value.push(letter),
        }
    }
    (value, "")
}

/// The step in the comment that LAMMPS writes: `Atoms. Timestep: 2100`.
fn lammps_step(comment: &str) -> Option<f64> {
    let (_, rest) = comment.split_once("Timestep:")?;
    rest.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sequence::Options;
    use std::path::Path;
    use tyndall::Values;

    fn read(text: &str) -> Result<Vec<Frame>> {
        let options = Options::default();
        let mut feed = Feed::over(Path::new("a.xyz"), text.as_bytes());
        let index = index(&mut feed)?;
        let mut frames = Vec::new();
        for span in &index.frames {
            let mut feed = Feed::over(Path::new("a.xyz"), text.as_bytes());
            feed.skip_to(span.offset, span.line, &())?;
            let request =
                Request { options: &options, bytes: span.bytes, units: None, topology: None, others: &() };
            frames.push(frame(&mut feed, &request, &())?);
        }
        Ok(frames)
    }

    #[test]
    fn extended_properties_cell_and_time_are_read() {
        let text = "2\nLattice=\"1 0 0 0.5 2 0 0 0 3\" IsStrange Properties=pos:R:3:kind:I:1:ok:L:1:f:R:2 \
                    pbc=\"T F T\" Time = 2.5 note=\"a \\\" b\"\n1 2 3 7 T 0.5 1\n4 5 6 8 F 1.5 2\n";
        let frames = read(text).unwrap();
        let particles = &frames[0].particles;
        assert_eq!(particles.positions().world(1), DVec3::new(4.0, 5.0, 6.0));
        assert_eq!(particles.attribute("kind").unwrap().values, Values::I32(vec![7, 8]));
        assert_eq!(particles.attribute("ok").unwrap().values, Values::U8(vec![1, 0]));
        let vector = particles.attribute("f").unwrap();
        assert_eq!((vector.components, &vector.values), (2, &Values::F32(vec![0.5, 1.0, 1.5, 2.0])));
        let cell = particles.cell().unwrap();
        assert_eq!((cell.vectors[1], cell.periodic), (DVec3::new(0.5, 2.0, 0.0), [true, false, true]));
        assert_eq!((particles.time(), particles.length_unit()), (Some(2.5), Some("Å")));
    }

    #[test]
    fn plain_first_columns_are_elements_types_or_coordinates() {
        let frames =
            read("1\n\nHe 1 2 3 0.5 7\n\n1\r\nc\r\n 2\t1\t2\t3\r\n1\n\n0.5 1 2 3\n1\n\n1 2 3\n\n\n").unwrap();
        assert_eq!(frames.len(), 4);
        let names =
            |k: usize| frames[k].particles.attributes().iter().map(|it| it.name.clone()).collect::<Vec<_>>();
        assert_eq!(names(0), ["element", "c5", "c6"]);
        assert_eq!(names(1), ["type"]);
        assert_eq!(
            (names(2), frames[2].particles.positions().world(0)),
            (vec!["c4".to_string()], DVec3::new(0.5, 1.0, 2.0))
        );
        assert!(names(3).is_empty());
    }

    #[test]
    fn a_lattice_of_three_numbers_is_a_box() {
        let frame = &read("1\nLattice=\"4 5 6\"\nO 1 1 1\n").unwrap()[0];
        let vectors = [DVec3::X * 4.0, DVec3::Y * 5.0, DVec3::Z * 6.0];
        assert_eq!(frame.particles.cell().unwrap().vectors, vectors);
    }

    #[test]
    fn a_truncated_frame_is_noticed() {
        let cut = |text: &str| {
            let index = index(&mut Feed::over(Path::new("a.xyz"), text.as_bytes())).unwrap();
            (index.frames.len(), index.cut)
        };
        let whole = "1\n\nO 0 0 0\n";
        assert_eq!(cut(&format!("{whole}2\n\nO 0 0 0\nH 1 1")), (1, true));
        assert_eq!(cut(&format!("{whole}2\n\nO 0 0 0\n")), (1, true));
        assert_eq!(cut(&format!("{whole}2")), (1, true));
        assert_eq!(cut(&format!("{whole}1\n\nO 0 0 0")), (2, false));
        assert_eq!(cut("1152921504606846976\n\nO 0 0 0\n"), (0, true));
        assert_eq!(cut("0\n\n0\nempty\n"), (2, false));
    }

    #[test]
    fn what_is_wrong_is_said() {
        let message = |text: &str| read(text).err().unwrap().to_string();
        assert!(message("1\n\nO 0 0 0\nO 0 0 0\n").contains("wanted the particle count of the next frame"));
        assert!(message("1\nProperties=species:S:1\nO\n").contains("no pos:R:3"));
        assert!(message("1\nProperties=pos:R\nO\n").contains("name:type:count"));
        assert!(message("1\nLattice=\"1 2\"\nO 1 1 1\n").contains("nine numbers"));
        assert!(message("2\n\nO 0 0 0\nO 0 0\n").contains("line 4"));
    }

    #[test]
    fn particles_that_are_not_finite_are_dropped() {
        let frames = read("2\n\nO nan 0 0\nH 1 1 inf\n").unwrap();
        assert_eq!((frames[0].particles.len(), frames[0].particles.dropped().position), (0, 2));
    }

    #[test]
    fn lists_of_points_are_not_taken_for_it() {
        assert!(!recognise(b"2\n0 0 0 1\n1 0 0 2\n"));
        assert!(recognise(b"1\n-1.5\n6 0 0 0\n") && recognise(b"2\n\nO 0 0 0\nO 0 0 0\n"));
    }
}
