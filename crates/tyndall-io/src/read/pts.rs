//! PTS, the point clouds of Leica's scanners: a count, then a row for each point; further scans may follow in the same way.
//!
//! A row has x y z, then an intensity if there are four or seven numbers, then red, green, blue if there are six or seven. Each
//! scan is a frame. Source: paulbourke.net, "PTS laser scan file format", and what CloudCompare and Leica Cyclone write.

use tyndall::{Columns, Progress, Result};

use super::column::{Kind, Separator};
use super::feed::Feed;
use super::rows::{self, Heading, Layout, Role};
use super::{Index, Request, Span, finish, whole_lines};
use crate::sequence::Frame;

/// Whether there is a count, then rows of numbers without a comment between.
pub(crate) fn recognise(head: &[u8]) -> bool {
    let mut lines = whole_lines(head);
    let numbers = |line: Option<&[u8]>| -> Option<usize> {
        let tokens: Vec<_> = rows::split(line?, Separator::BLANKS).collect();
        let all = tokens.iter().all(|it| fast_float2::parse::<f64, _>(it).is_ok());
        all.then_some(tokens.len())
    };
    let count = lines.next();
    let is_count = count.is_some_and(|line| parse_count(line).is_some());
    let rows = [numbers(lines.next()), numbers(lines.next())];
    let is_row = |fields: Option<usize>| matches!(fields, Some(3..=7) | None);
    // A single point stands alone; else two rows say that they are of one kind.
    is_count
        && rows[0].is_some_and(|fields| (3..=7).contains(&fields))
        && is_row(rows[1])
        && (rows[0] == rows[1] || count == Some(b"1"))
}

fn parse_count(line: &[u8]) -> Option<u64> {
    std::str::from_utf8(line).ok()?.trim().parse().ok()
}

/// Finds the scans.
pub(crate) fn index(feed: &mut Feed) -> Result<Index> {
    let mut index = Index::default();
    loop {
        let (offset, line) = (feed.offset(), feed.line_number());
        if feed.peek(1 << 10)?.trim_ascii().is_empty() {
            break;
        }
        let count = feed.line()?.unwrap_or_default();
        let Some(count) = parse_count(count.as_bytes()) else {
            let what = format!(
                "wanted the number of points of a scan, found '{}'",
                rows::shortened(count.as_bytes())
            );
            return Err(feed.fault(what, "does the count before match its lines?"));
        };
        let fields = |row: &[u8]| rows::split(row, Separator::BLANKS).count();
        let wanted = feed.peek(1 << 10)?.split(|&byte| byte == b'\n').next().map_or(0, fields);
        let found = feed.skip_lines(count)?;
        let short = feed.ragged().is_some_and(|row| count > 0 && (feed.cut() || fields(row) < wanted));
        if found < count || short {
            index.cut = true;
            break;
        }
        index.frames.push(Span { offset, line, bytes: Some(feed.offset() - offset) });
    }
    index.cut |= feed.cut();
    Ok(index)
}

/// Reads a scan.
pub(crate) fn frame(feed: &mut Feed, request: &Request, progress: &dyn Progress) -> Result<Frame> {
    let count = feed.line()?.unwrap_or_default();
    let count = parse_count(count.as_bytes())
        .ok_or_else(|| feed.fault("wanted the number of points", "was the file changed?"))?;
    let head = feed.peek(1 << 14)?;
    let first = head.split(|&byte| byte == b'\n').next().unwrap_or_default();
    let fields = if count == 0 { 3 } else { rows::split(first, Separator::BLANKS).count() };
    let names: &[&str] = match fields {
        3 => &[],
        4 => &["intensity"],
        5 => &["intensity", "c5"],
        6 => &["red", "green", "blue"],
        7 => &["intensity", "red", "green", "blue"],
        _ => {
            let what = format!("a row of {fields} numbers: x y z, intensity and a color were wanted");
            return Err(feed.fault(what, "take off the first line and read it with --columns x,y,z,…"));
        }
    };
    let kinds = rows::kinds(head, Separator::BLANKS, fields);
    let mut roles: Vec<Role> = [0, 1, 2].map(Role::Axis).to_vec();
    let mut headings = Vec::new();
    for (place, name) in names.iter().enumerate() {
        let kind = if kinds[3 + place] == Kind::Text { Kind::Float } else { kinds[3 + place] };
        roles.push(Role::Attribute(headings.len()));
        headings.push(Heading::scalar(*name, kind));
    }
    let mut layout =
        Layout { separator: Separator::BLANKS, roles, headings, scaled: None, gaps: false, origin: None };
    layout.keep(request.options.wanted.as_ref());
    let rows = rows::read(feed, &layout, Some(count), request.bytes, progress)?;
    let columns = Columns { positions: rows.positions, attributes: rows.attributes, ..Columns::default() };
    let conventions = vec![format!("columns: x y z {}", names.join(" ")).trim_end().to_string()];
    finish(columns, conventions, Vec::new())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::read::real_data;
    use crate::sequence::Options;

    fn read(text: &[u8]) -> Result<Vec<Frame>> {
        let (path, options) = (Path::new("a.pts"), Options::default());
        let index = index(&mut Feed::over(path, text))?;
        let frame = |span: &Span| {
            let mut feed = Feed::over(path, text);
            feed.skip_to(span.offset, span.line, &())?;
            frame(
                &mut feed,
                &Request { options: &options, bytes: span.bytes, units: None, topology: None, others: &() },
                &(),
            )
        };
        index.frames.iter().map(frame).collect()
    }

    fn names(frame: &Frame) -> Vec<&str> {
        frame.particles.attributes().iter().map(|it| it.name.as_str()).collect()
    }

    #[test]
    fn the_number_of_fields_says_what_they_are() {
        for (row, wanted) in [
            ("1 2 3", vec![]),
            ("1 2 3 -800", vec!["intensity"]),
            ("1 2 3 10 20 30", vec!["red", "green", "blue"]),
            ("1 2 3 0.5 10 20 30", vec!["intensity", "red", "green", "blue"]),
        ] {
            for text in [format!("2\n{row}\n{row}\n"), format!("2\r\n{row}\r\n{row}"), format!("1\n{row}")] {
                assert!(recognise(text.as_bytes()), "{text}");
                let frames = read(text.as_bytes()).unwrap();
                assert_eq!((frames.len(), names(&frames[0])), (1, wanted.clone()), "{text}");
                assert_eq!(frames[0].particles.positions().world(0).to_array(), [1.0, 2.0, 3.0]);
            }
        }
        assert!(read(b"2\n1 2 3 4 5 6 7 8\n1 2 3 4 5 6 7 8\n").is_err());
    }

    #[test]
    fn scans_are_frames() {
        let frames = read(b"1\n1 2 3\n0\n2\n4 5 6\n7 8 9\n\n").unwrap();
        assert_eq!(frames.iter().map(|it| it.particles.len()).collect::<Vec<_>>(), [1, 0, 2]);
    }

    #[test]
    fn a_count_that_does_not_fit_is_noticed() {
        let cut = |text: &[u8]| {
            let index = index(&mut Feed::over(Path::new("a.pts"), text)).unwrap();
            (index.frames.len(), index.cut)
        };
        assert_eq!(cut(b"3\n1 2 3\n4 5 6\n"), (0, true));
        assert_eq!(cut(b"2\n1 2 3\n4 5"), (0, true));
        assert_eq!(cut(b"1152921504606846976\n1 2 3\n"), (0, true));
        assert!(index(&mut Feed::over(Path::new("a.pts"), b"1\n1 2 3\n4 5 6\n")).is_err());
    }

    #[test]
    fn tables_are_not_taken_for_it() {
        for text in [&b"1 2 3\n4 5 6\n"[..], b"2\n\nO 0 0 0\n", b"5\n6\n7\n", b"2\nx y z\n1 2 3\n"] {
            assert!(!recognise(text));
        }
    }

    #[test]
    fn damage_never_panics() {
        real_data::damage(b"2\n1 2 3 0.5 10 20 30\n4 5 6 0.25 40 50 60\n", |file| drop(read(file)));
    }
}
