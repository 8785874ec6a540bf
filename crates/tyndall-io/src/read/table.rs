//! Tables: rows of numbers and words, separated by commas, semicolons, tabs, bars or blanks, with or without a header.
//!
//! Takes the text, gives columns by name. Lines that begin with `#` are comments, before the first row also those with `%`, `!` or `//`, but
//! the one that stands before the first row and has as many names as the row has values is the header. Without a header the first
//! columns are x, y, z.

use std::path::Path;

use tyndall::{Columns, Error, Progress, Result};

use super::column::{Kind, Separator, number};
use super::feed::Feed;
use super::rows::{self, Heading, Layout, Role};
use super::{Index, Request, Span, finish, is_text, whole_lines};
use crate::sequence::Frame;

/// What the coordinates are called, one row for each spelling; upper and lower case are alike.
const COORDINATES: [[&str; 3]; 14] = [
    ["x", "y", "z"],
    ["pos_x", "pos_y", "pos_z"],
    ["posx", "posy", "posz"],
    ["position_x", "position_y", "position_z"],
    ["position.x", "position.y", "position.z"],
    ["position:0", "position:1", "position:2"],
    ["points:0", "points:1", "points:2"],
    ["points_0", "points_1", "points_2"],
    ["coordinates:0", "coordinates:1", "coordinates:2"],
    ["coordinates_x", "coordinates_y", "coordinates_z"],
    ["coordinates_0", "coordinates_1", "coordinates_2"],
    ["x_coord", "y_coord", "z_coord"],
    ["px", "py", "pz"],
    ["p_x", "p_y", "p_z"],
];

/// What the first lines tell.
struct Shape {
    separator: Separator,
    /// Names from a header, which may be a comment.
    header: Option<Vec<String>>,
    /// Whether the header is a line of its own, not a comment.
    header_line: bool,
    /// How many values a row has.
    fields: usize,
    /// Whether all rows looked at have that many.
    even: bool,
    /// How many numbers stand in front of the first word of the first row.
    leading_numbers: usize,
    /// Whether the first value is a number but not an integer.
    is_measured: bool,
}

/// Whether a table begins here whose columns need no guess, or one that `path` calls a table.
pub(crate) fn recognise(head: &[u8], path: &Path) -> bool {
    let Some(shape) = shape(head).filter(|it| it.even) else { return false };
    let extension = path.extension().and_then(|it| it.to_str()).unwrap_or_default().to_ascii_lowercase();
    // Behind a compression's ending stands the format's.
    let stem = path
        .file_stem()
        .map(Path::new)
        .and_then(Path::extension)
        .and_then(|it| it.to_str())
        .unwrap_or_default();
    let named = ["csv", "tsv"].iter().any(|it| extension == *it || stem.eq_ignore_ascii_case(it));
    match &shape.header {
        Some(names) => coordinates(names).is_some() || named,
        None if shape.leading_numbers < shape.fields.min(3) => false,
        None => (3..=4).contains(&shape.fields) || (named && shape.fields >= 2),
    }
}

/// The error about a file that is none of the known formats.
pub(crate) fn unknown(path: &Path, head: &[u8]) -> Error {
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
    let (kind, hint) = match shape(head).filter(|_| is_text(head)) {
        Some(shape) => {
            let header = match &shape.header {
                Some(names) => format!("header {}", rows::shortened(names.join(",").as_bytes())),
                None => "no header".to_string(),
            };
            let guess = ["id", "type", "x", "y", "z", "vx", "vy", "vz"];
            let guess = match (shape.fields, shape.leading_numbers) {
                (4, 0) => &["element", "x", "y", "z"][..],
                (0..=4, _) => &["x", "y", "z", "radius"],
                _ if shape.is_measured => &["x", "y", "z"],
                _ => &guess,
            };
            let name =
                |column: usize| guess.get(column).map_or(format!("c{}", column + 1), |it| it.to_string());
            let columns = (0..shape.fields).map(name).collect::<Vec<_>>().join(",");
            let known = if shape.even {
                format!("text, {} columns, {header}", shape.fields)
            } else {
                "text, rows of different length".to_string()
            };
            (known, format!("try: --columns {} or --format csv", rows::shortened(columns.as_bytes())))
        }
        None if is_text(head) => (
            "text without rows of numbers".to_string(),
            "give particles as PLY, NPY, CSV, XYZ or a LAMMPS dump".to_string(),
        ),
        None => {
            let bytes: Vec<String> = head.iter().take(8).map(|byte| format!("{byte:02x}")).collect();
            (
                format!("binary, begins with {}", bytes.join(" ")),
                "give particles as PLY, NPY, CSV, XYZ or a LAMMPS dump".to_string(),
            )
        }
    };
    Error::format(path, "", format!("cannot tell the format of '{name}' ({kind})"), hint)
}

fn is_number(token: &[u8], separator: Separator) -> bool {
    !token.is_empty() && matches!(number(token, separator), Some((_, taken)) if taken == token.len())
}

/// Looks at the first lines; `None` if they are no table.
fn shape(head: &[u8]) -> Option<Shape> {
    if !is_text(head) {
        return None;
    }
    let lines: Vec<&[u8]> =
        whole_lines(head).map(<[u8]>::trim_ascii).filter(|line| !line.is_empty()).take(100).collect();
    let (comments, mut body): (Vec<&[u8]>, Vec<&[u8]>) =
        lines.iter().partition(|line| comment(line).is_some());
    let first = *body.first()?;
    // The last line may not be whole: its reader will judge it.
    if body.len() > 2 && !head.ends_with(b"\n") {
        body.pop();
    }
    let separator = separator(&body);
    let tokens: Vec<&[u8]> = rows::split(first, separator).collect();
    let header_line =
        !tokens.iter().any(|token| is_number(token, separator)) && tokens.iter().any(|it| !it.is_empty());
    let rows = if header_line { &body[1..] } else { &body[..] };
    let count = |row: &&[u8]| rows::split(row, separator).count();
    let first = rows.first().map_or(tokens.len(), count);
    // The first row may lack its last value, behind a separator.
    let is_open =
        rows.first().is_some_and(|row| separator.byte.is_some() && row.last() == separator.byte.as_ref());
    let fields = first + usize::from(is_open && rows.iter().map(count).max() == Some(first + 1));
    let has_number =
        rows.first().is_none_or(|row| rows::split(row, separator).any(|it| is_number(it, separator)));
    if !has_number {
        return None;
    }
    // The last value of a row may be missing, so one field less is no other table.
    let even = rows.iter().all(|row| {
        let count = rows::split(row, separator).count();
        count == fields || (separator.byte.is_some() && count + 1 == fields)
    });
    let header = if header_line {
        Some(tokens.iter().map(|it| text(it)).collect())
    } else {
        let before_rows = comments.iter().rev().map(|line| line.trim_ascii_start().trim_ascii());
        before_rows.filter_map(|line| comment_names(line, separator, fields)).next()
    };
    let values = || rows.first().into_iter().flat_map(|row| rows::split(row, separator));
    let leading_numbers = values().take_while(|it| is_number(it, separator)).count();
    let is_measured =
        leading_numbers > 0 && values().next().is_some_and(|it| it.iter().any(|it| b".,eE".contains(it)));
    Some(Shape { separator, header, header_line, fields, even, leading_numbers, is_measured })
}

fn text(token: &[u8]) -> String {
    String::from_utf8_lossy(token).trim().trim_matches('"').trim().to_string()
}

/// What a comment says; `None` for other lines.
fn comment(line: &[u8]) -> Option<&[u8]> {
    let line = line.trim_ascii_start();
    ["#", "%", "!", "//"].iter().find_map(|mark| line.strip_prefix(mark.as_bytes()))
}

/// The names in a comment, if there are as many as columns.
fn comment_names(line: &[u8], separator: Separator, fields: usize) -> Option<Vec<String>> {
    let line = comment(line)?.trim_ascii();
    [separator, Separator::BLANKS].iter().find_map(|&separator| {
        let names: Vec<String> = rows::split(line, separator).map(text).collect();
        (names.len() == fields && !names.iter().any(|it| is_number(it.as_bytes(), separator)))
            .then_some(names)
    })
}

/// The separator of lines that are no comments.
fn separator(lines: &[&[u8]]) -> Separator {
    let has = |line: &&[u8], byte: u8| memchr::memchr(byte, line).is_some();
    // Between the numbers of some rows stand tabs and blanks.
    let is_mixed = |line: &&[u8]| {
        let words: Vec<&[u8]> = rows::split(line, Separator::BLANKS).collect();
        words.len() > 1 + memchr::memchr_iter(b'\t', line).count()
            && words.iter().all(|it| is_number(it, Separator::BLANKS))
    };
    for byte in [b';', b'\t', b'|', b','] {
        let is_mixed = || byte == b'\t' && lines.last().is_some_and(is_mixed);
        if lines.iter().all(|line| has(line, byte)) && !is_mixed() {
            // Between semicolons, tabs or bars a comma is a decimal point, unless there are points too.
            let numbers = if lines.len() > 1 { &lines[1..] } else { lines };
            let commas = numbers.iter().any(|line| has(line, b','));
            let points = numbers.iter().any(|line| has(line, b'.'));
            return Separator { byte: Some(byte), decimal_comma: byte != b',' && commas && !points };
        }
    }
    Separator::BLANKS
}

/// Which columns the coordinates are: x, y and, where there is one, z.
pub(crate) fn coordinates(names: &[String]) -> Option<(usize, usize, Option<usize>)> {
    let names: Vec<String> = names.iter().map(|it| name_and_unit(it).0.to_ascii_lowercase()).collect();
    let place = |name: &str| names.iter().position(|it| it == name);
    COORDINATES.iter().find_map(|[x, y, z]| Some((place(x)?, place(y)?, place(z))))
}

/// Whether an array of vectors with this name is something else than positions.
pub(crate) fn is_other_vector(name: &str) -> bool {
    const OTHERS: [&str; 24] = [
        "vel",
        "velocity",
        "velocities",
        "v",
        "acc",
        "acceleration",
        "accelerations",
        "force",
        "forces",
        "momentum",
        "momenta",
        "normal",
        "normals",
        "color",
        "colors",
        "colour",
        "rgb",
        "box",
        "cell",
        "cells",
        "lattice",
        "boxsize",
        "cell_lengths",
        "cell_angles",
    ];
    let name = name_and_unit(name).0;
    OTHERS.iter().any(|it| it.eq_ignore_ascii_case(name))
}

/// `x [m]` and `x (m)` are the name and the unit.
pub(crate) fn name_and_unit(heading: &str) -> (&str, Option<&str>) {
    for (open, close) in [(" [", ']'), (" (", ')'), ("[", ']')] {
        if let Some((name, unit)) = heading.split_once(open)
            && let Some(unit) = unit.strip_suffix(close)
            && !name.trim().is_empty()
            && !unit.trim().is_empty()
        {
            return (name.trim(), Some(unit.trim()));
        }
    }
    (heading, None)
}

/// Roles and headings of columns with these names and kinds.
pub(crate) fn fields(names: &[String], kinds: &[Kind], path: &Path) -> Result<(Vec<Role>, Vec<Heading>)> {
    let wrong = |what: String| Error::format(path, "", what, "name the columns: --columns x,y,z,…");
    if names.len() != kinds.len() {
        return Err(wrong(format!("there are {} names for {} columns", names.len(), kinds.len())));
    }
    let (x, y, z) = coordinates(names)
        .ok_or_else(|| wrong(format!("no x, y, z among the columns {}", names.join(", "))))?;
    let (mut roles, mut headings) = (Vec::new(), Vec::new());
    for (column, (heading, &kind)) in names.iter().zip(kinds).enumerate() {
        let axis = [Some(x), Some(y), z].iter().position(|&it| it == Some(column));
        roles.push(axis.map_or(Role::Attribute(headings.len()), Role::Axis));
        if axis.is_none() {
            let (name, unit) = name_and_unit(heading);
            let name = if name.is_empty() { format!("c{}", column + 1) } else { name.to_string() };
            headings.push(Heading { name, components: 1, kind, unit: unit.map(str::to_string) });
        }
    }
    Ok((roles, headings))
}

/// A table is one frame; nothing has to be read to know that.
pub(crate) fn index(_feed: &mut Feed) -> Result<Index> {
    Ok(Index { frames: vec![Span { offset: 0, line: 1, bytes: None }], ..Index::default() })
}

/// Reads the table.
pub(crate) fn frame(feed: &mut Feed, request: &Request, progress: &dyn Progress) -> Result<Frame> {
    let path = feed.path().to_path_buf();
    let head = feed.peek(super::HEAD as usize)?;
    let shape = shape(head)
        .ok_or_else(|| Error::format(&path, "", "wanted rows of numbers, found none", "is this a table?"))?;
    let sample: Vec<u8> = rows_of(head, shape.header_line);
    let kinds = rows::kinds(&sample, shape.separator, shape.fields);
    let mut conventions = Vec::new();

    let names = match (&request.options.columns, shape.header) {
        (Some(names), _) => names.clone(),
        (None, Some(names)) if names.len() == shape.fields => names,
        (None, Some(names)) => {
            let what = format!("the header has {} names, the first row {} values", names.len(), shape.fields);
            return Err(Error::format(
                &path,
                "line 1",
                what,
                "correct the header, or name the columns: --columns x,y,z,…",
            ));
        }
        (None, None) => {
            let names = guessed(shape.fields);
            conventions.push(format!("no header: columns taken as {}", names.join(" ")));
            names
        }
    };
    let (roles, headings) = fields(&names, &kinds, &path)?;
    let Some((x, _, z)) = coordinates(&names) else { unreachable!("`fields` has found them") };
    if z.is_none() {
        conventions.push("two-dimensional: z = 0".to_string());
    }
    if shape.separator.decimal_comma {
        conventions.push("decimal commas".to_string());
    }
    pass_head(feed, shape.header_line)?;
    let mut layout =
        Layout { separator: shape.separator, roles, headings, scaled: None, gaps: true, origin: None };
    layout.keep(request.options.wanted.as_ref());
    let rows = rows::read(feed, &layout, None, request.bytes, progress)?;
    let warnings = cut(feed, rows.positions.len(), request)?.into_iter().collect();
    let columns = Columns {
        positions: rows.positions,
        attributes: rows.attributes,
        length_unit: name_and_unit(&names[x]).1.map(str::to_string),
        ..Columns::default()
    };
    finish(columns, conventions, warnings)
}

/// What is said of a file without a count whose compressed data end early, after so many rows; an error if that is wanted.
pub(super) fn cut(feed: &Feed, rows: usize, request: &Request) -> Result<Option<String>> {
    if !feed.cut() {
        return Ok(None);
    }
    let path = feed.path();
    if request.options.strict {
        return Err(Error::format(
            path,
            "",
            "the file ends inside its compressed data",
            "copy it again, or read what is whole without --strict",
        ));
    }
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
    Ok(Some(format!(
        "{name} ends inside its compressed data — {rows} whole rows read (use --strict to fail)"
    )))
}

/// The names of columns that have none.
fn guessed(fields: usize) -> Vec<String> {
    let name = |column: usize| match column {
        0..3 => ["x", "y", "z"][column].to_string(),
        3 if fields == 4 => "radius".to_string(),
        _ => format!("c{}", column + 1),
    };
    (0..fields).map(name).collect()
}

/// The lines of `head` that are rows.
fn rows_of(head: &[u8], header_line: bool) -> Vec<u8> {
    let rows = whole_lines(head).filter(|line| !line.is_empty() && comment(line).is_none());
    rows.skip(usize::from(header_line)).collect::<Vec<_>>().join(&b'\n')
}

/// Passes the comments before the first row, and the header if it is a line.
fn pass_head(feed: &mut Feed, header_line: bool) -> Result<()> {
    loop {
        let head = feed.peek(super::HEAD as usize)?;
        let line = head.split(|&byte| byte == b'\n').next().unwrap_or_default();
        if head.is_empty() || !line.trim_ascii().is_empty() && comment(line).is_none() {
            break;
        }
        feed.line()?;
    }
    if header_line {
        feed.line()?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sequence::Options;
    use tyndall::{DVec3, Values};

    fn read_as(text: &str, columns: Option<&str>) -> Result<Frame> {
        let columns = columns.map(|it| it.split(',').map(str::to_string).collect());
        let options = Options { columns, ..Options::default() };
        let mut feed = Feed::over(Path::new("a.csv"), text.as_bytes());
        frame(
            &mut feed,
            &Request {
                options: &options,
                bytes: Some(text.len() as u64),
                units: None,
                topology: None,
                others: &(),
            },
            &(),
        )
    }

    fn read(text: &str) -> Frame {
        read_as(text, None).unwrap_or_else(|error| panic!("{text:?}: {error}"))
    }

    fn names(frame: &Frame) -> Vec<&str> {
        frame.particles.attributes().iter().map(|it| it.name.as_str()).collect()
    }

    #[test]
    fn columns_that_are_proposed_fit_the_first_value() {
        let hint = |text: &str| unknown(Path::new("a.dat"), text.as_bytes()).to_string();
        assert!(hint("0.5 1 2 0.1 0.2\n").contains("--columns x,y,z,c4,c5"), "{}", hint("0.5 1 2 0.1 0.2\n"));
        assert!(hint("1 1 0.5 2 3\n").contains("--columns id,type,x,y,z"));
    }

    #[test]
    fn marks_of_comments_are_known_before_the_rows_only() {
        assert!(recognise(b"// by hand\n% x y z\n1 2 3\n", Path::new("a.asc")));
        let message = read_as("% x y z\n1 2 3\n% 4\n5 6 7\n", None).err().unwrap().to_string();
        assert!(message.contains("line 3"), "{message}");
    }

    #[test]
    fn separators_headers_and_line_ends_of_all_kinds_are_read() {
        let cases = [
            "x,y,z,id\n1,2,3,4\n",
            "id;X;Y;Z\r\n4;1,0;2,0;3,0\r\n",
            "# id x y z\n\n4 1 2 3\n",
            "# made by hand\n\"Points:0\",\"Points:1\",\"Points:2\",\"id\"\n1,2,3,4,\n",
            "pos_x\tpos_y\tpos_z\tid\n1\t2\t3\t4",
            "#a comment, with commas\n#x,y,z,id\n1,2,3,4\n",
            "x|y|z|id\n1|2|3|4|\n",
            "//X Y Z id\n1 2 3 4\n# the end\n",
            "! Fortran\r\n\r\n% x y z id\r\n  1 2 3 4\r\n",
        ];
        for case in cases {
            let frame = read(case);
            assert_eq!(frame.particles.positions().world(0), DVec3::new(1.0, 2.0, 3.0), "{case:?}");
            assert_eq!(frame.particles.attribute("id").unwrap().values, Values::I32(vec![4]), "{case:?}");
        }
    }

    #[test]
    fn units_in_the_header_are_kept() {
        let frame = read("x [mm],y [mm],z [mm],speed (m/s),name\n1,2,3,4.5,\"a b\"\n");
        assert_eq!(frame.particles.length_unit(), Some("mm"));
        let speed = frame.particles.attribute("speed").unwrap();
        assert_eq!((speed.unit.as_deref(), &speed.values), (Some("m/s"), &Values::F32(vec![4.5])));
        let name = &frame.particles.attribute("name").unwrap().values;
        assert_eq!(*name, Values::Text { codes: vec![0], names: vec!["a b".to_string()] });
    }

    #[test]
    fn columns_without_names_are_guessed_aloud() {
        let frame = read("# words about it\n1 2 3 0.5\n4 5 6 0.5\n");
        assert_eq!(names(&frame), ["radius"]);
        assert_eq!(frame.conventions, ["no header: columns taken as x y z radius"]);
        assert_eq!(names(&read("1,2,3,4,5\n")), ["c4", "c5"]);
        let flat = read("1,2\n3,4\n");
        assert_eq!(flat.particles.positions().world(1), DVec3::new(3.0, 4.0, 0.0));
        assert_eq!(flat.conventions[1], "two-dimensional: z = 0");
    }

    #[test]
    fn given_names_take_the_place_of_the_header() {
        let frame = read_as("a,b,c,d\n9,1,2,3\n", Some("id,x,y,z")).unwrap();
        assert_eq!(
            (names(&frame), frame.particles.positions().world(0)),
            (vec!["id"], DVec3::new(1.0, 2.0, 3.0))
        );
        let error = read_as("1,2,3\n", Some("x,y")).unwrap_err().to_string();
        assert!(error.contains("2 names for 3 columns"), "{error}");
    }

    #[test]
    fn what_is_wrong_is_said() {
        let message = |text: &str| read_as(text, None).unwrap_err().to_string();
        assert!(
            message("x,y,z\n1,2,3\n1,2,q\n")
                .contains("wanted a number for z (column 3), found 'q' (a.csv: line 3)")
        );
        assert!(message("x,y,z\n1,2,3\n1,2,3,4\n").contains("line 3"));
        assert!(message("a,b,c\n1,2,3\n").contains("no x, y, z among the columns a, b, c"));
    }

    #[test]
    fn missing_and_infinite_values_pass_to_the_check_on_entry() {
        let frame = read("x,y,z,radius\n1,,3,1\nnan,2,3,1\n1,2,inf,1\n1,2,3,-1\n1,2,3,1\n");
        assert_eq!((frame.particles.len(), frame.particles.dropped().position), (1, 3));
        assert_eq!(frame.particles.dropped().radius, 1);
    }

    #[test]
    fn the_first_row_may_lack_its_last_value() {
        let frame = read("x,y,z,q\n1,2,3,\n4,5,6,7\n");
        let q = frame.particles.attribute("q").unwrap();
        assert!(q.number(0, 0).is_nan() && q.number(1, 0) == 7.0);
        assert!(recognise(b"x,y,z,q\n1,2,3,\n4,5,6,7\n", Path::new("a.csv")));
    }

    #[test]
    fn tabs_and_blanks_may_stand_between_the_numbers_of_a_row() {
        let frame = read("# id x y z\n  7 1.5\t2 3  \n8 4\t5 6\n");
        assert_eq!(frame.particles.positions().world(0), DVec3::new(1.5, 2.0, 3.0));
        assert_eq!(names(&frame), ["id"]);
        // Words between tabs may have blanks in them.
        assert_eq!(names(&read("x\ty\tz\tname\n1\t2\t3\ta b\n")), ["name"]);
    }

    #[test]
    fn a_header_alone_is_a_table_without_particles() {
        assert!(read("x,y,z,mass\n").particles.is_empty());
    }
}
