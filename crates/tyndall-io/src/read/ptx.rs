//! PTX, the structured point clouds of Leica's terrestrial scanners: scans behind each other, each in the coordinates of its scanner.
//!
//! A scan has a line with the number of its columns, one with that of its rows, the place of the scanner and its three axes, and four rows of a
//! matrix that brings points (as rows, from the left) into the coordinates of all scans; then x y z, an intensity from 0 to 1, and maybe
//! red green blue, for each direction. `0 0 0` is a direction in which nothing was met: such points have no place, and are dropped and
//! counted. All scans are one frame. Source: Leica Geosystems, "PTX file format"; what CloudCompare reads.

use tyndall::particles::{Attribute, Values};
use tyndall::scene::wanted::Offered;
use tyndall::{Columns, DVec3, Progress, Result};

use super::column::{Kind, Separator};
use super::feed::Feed;
use super::rows::{self, Expected, Heading, Layout, Role, Scaled};
use super::{Index, Request, Span, finish, whole_lines};
use crate::sequence::Frame;

const HINT: &str =
    "compare it with the description of PTX: ten lines, then a row for each column and row of the scan";
/// The numbers on each line of a scan's header.
const HEADER: [usize; 10] = [1, 1, 3, 3, 3, 3, 4, 4, 4, 4];

/// Whether there are the lines of a scan's header, then a row of numbers or nothing.
pub(crate) fn recognise(head: &[u8]) -> bool {
    let mut lines = whole_lines(head);
    let mut has = |wanted: usize| lines.next().and_then(numbers).is_some_and(|it| it.len() == wanted);
    if !HEADER.into_iter().all(&mut has) {
        return false;
    }
    let first = lines.next().unwrap_or_default();
    first.is_empty() || numbers(first).is_some_and(|it| names(it.len()).is_some())
}

/// The numbers of a line, if it has nothing else.
fn numbers(line: &[u8]) -> Option<Vec<f64>> {
    rows::split(line, Separator::BLANKS).map(|it| fast_float2::parse(it).ok()).collect()
}

/// What stands behind the coordinates in a row of so many numbers.
fn names(fields: usize) -> Option<&'static [&'static str]> {
    match fields {
        3 => Some(&[]),
        4 => Some(&["intensity"]),
        6 => Some(&["red", "green", "blue"]),
        7 => Some(&["intensity", "red", "green", "blue"]),
        _ => None,
    }
}

/// What stands before the points of a scan.
struct Header {
    count: u64,
    /// Where the axes of the scanner's coordinates go, and where their zero is.
    axes: [DVec3; 3],
    place: DVec3,
}

impl Header {
    /// Takes its lines; `None` at the end of the content.
    fn read(feed: &mut Feed) -> Result<Option<Self>> {
        let mut all = Vec::with_capacity(HEADER.len());
        for (place, wanted) in HEADER.into_iter().enumerate() {
            let Some(line) = feed.line()? else {
                // Between scans, and behind the last one, may be empty lines.
                return if all.is_empty() {
                    Ok(None)
                } else {
                    Err(feed.fault("the file ends inside a scan's header", HINT))
                };
            };
            if place == 0 && line.trim().is_empty() && feed.peek(1 << 10)?.trim_ascii().is_empty() {
                return Ok(None);
            }
            let found = numbers(line.as_bytes())
                .filter(|it| it.len() == wanted && it.iter().all(|it| it.is_finite()));
            let Some(found) = found else {
                let what = [
                    "columns",
                    "rows",
                    "the scanner's place",
                    "an axis of the scanner",
                    "a row of the matrix",
                ];
                let what = what[match place {
                    0..3 => place,
                    3..6 => 3,
                    _ => 4,
                }];
                let what =
                    format!("wanted {what} ({wanted} numbers), found '{}'", rows::shortened(line.as_bytes()));
                return Err(feed.fault(what, HINT));
            };
            all.push(found);
        }
        let size = |line: usize| {
            let number = all[line][0];
            (number >= 0.0 && number.fract() == 0.0 && number <= f64::from(u32::MAX)).then_some(number as u64)
        };
        let (Some(columns), Some(rows)) = (size(0), size(1)) else {
            let what = format!("a scan of {} columns and {} rows", all[0][0], all[1][0]);
            return Err(feed.fault(what, HINT));
        };
        let row = |line: usize| DVec3::from_slice(&all[line][..3]);
        Ok(Some(Self { count: columns * rows, axes: [row(6), row(7), row(8)], place: row(9) }))
    }
}

/// How many numbers the next row has.
fn fields(feed: &mut Feed) -> Result<usize> {
    let head = feed.peek(1 << 12)?;
    let row = head.split(|&byte| byte == b'\n').next().unwrap_or_default();
    Ok(rows::split(row, Separator::BLANKS).count())
}

/// Finds the scans that are whole.
pub(crate) fn index(feed: &mut Feed) -> Result<Index> {
    let mut index = Index::default();
    let mut end = 0;
    loop {
        let header = match Header::read(feed) {
            Ok(None) => break,
            Ok(Some(header)) => header,
            // A header that is cut.
            Err(_) if end > 0 && feed.at_end()? => {
                index.cut = true;
                break;
            }
            Err(error) => return Err(error),
        };
        let wanted = fields(feed)?;
        let found = feed.skip_lines(header.count)?;
        let short = feed.ragged().is_some_and(|row| {
            header.count > 0 && (feed.cut() || rows::split(row, Separator::BLANKS).count() < wanted)
        });
        if found < header.count || short {
            index.cut = true;
            break;
        }
        end = feed.offset();
    }
    index.cut |= feed.cut();
    if end > 0 {
        index.frames.push(Span { offset: 0, line: 1, bytes: Some(end) });
    }
    Ok(index)
}

/// Reads the points of all scans.
pub(crate) fn frame(feed: &mut Feed, request: &Request, progress: &dyn Progress) -> Result<Frame> {
    progress.begin("read", request.bytes, "B");
    let end = request.bytes.map_or(u64::MAX, |bytes| feed.offset() + bytes);
    let wanted = request.options.wanted.as_ref();
    let (mut builder, mut first, mut counts): (Option<rows::Builder>, Option<(usize, Layout)>, Vec<u64>) =
        (None, None, Vec::new());
    while feed.offset() < end {
        let Some(header) = Header::read(feed)? else { break };
        counts.push(header.count);
        if header.count == 0 {
            continue;
        }
        let fields = fields(feed)?;
        let (_, mut layout) = match first.take() {
            Some((before, layout)) if before == fields => (before, layout),
            Some((before, _)) => {
                let what = format!("rows of {fields} numbers in a scan, of {before} in those before");
                return Err(feed.fault(what, "give each scan as a file of its own"));
            }
            None => {
                let mut layout = layout(feed, fields)?;
                layout.keep(wanted);
                (fields, layout)
            }
        };
        layout.scaled = Some(Scaled::Scanner(header.axes, header.place));
        let bytes = request.bytes.map(|_| end.saturating_sub(feed.offset()));
        let expected = Expected { count: Some(header.count), bytes };
        builder.get_or_insert_with(|| rows::Builder::new(&layout)).add(feed, &layout, expected, progress)?;
        first = Some((fields, layout));
    }
    let mut columns = Columns::default();
    if let (Some(builder), Some((_, layout))) = (builder, &first) {
        let rows = builder.finish(layout);
        (columns.positions, columns.attributes) = (rows.positions, rows.attributes);
    }
    let scan = Offered { name: "scan", components: 1, is_measured: false };
    if counts.len() > 1 && wanted.is_none_or(|it| it.flags(&[scan]) == [true]) {
        let numbers = counts
            .iter()
            .enumerate()
            .flat_map(|(scan, &count)| std::iter::repeat_n(scan as i32, count as usize));
        columns.attributes.push(Attribute::new("scan", 1, Values::I32(numbers.collect())));
    }
    columns.length_unit = Some("m".to_string());
    let conventions = vec![
        "each scan is brought to its place by its matrix".to_string(),
        "points at 0 0 0 of their scan are directions without an echo".to_string(),
    ];
    finish(columns, conventions, Vec::new())
}

/// The columns of the rows that follow.
fn layout(feed: &mut Feed, fields: usize) -> Result<Layout> {
    let Some(names) = names(fields) else {
        let what = format!("a row of {fields} numbers: x y z, intensity and a color were wanted");
        return Err(feed.fault(what, HINT));
    };
    let mut roles: Vec<Role> = [0, 1, 2].map(Role::Axis).to_vec();
    roles.extend((0..names.len()).map(Role::Attribute));
    let kind = |name: &str| if name == "intensity" { Kind::Float } else { Kind::Integer };
    let headings = names.iter().map(|name| Heading::scalar(*name, kind(name))).collect();
    Ok(Layout { separator: Separator::BLANKS, roles, headings, scaled: None, gaps: false, origin: None })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::read::real_data;
    use crate::sequence::Options;

    /// A quarter turn about z, then a step by 1e6 along x.
    const TURNED: &str = "2\n2\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n0 1 0 0\n-1 0 0 0\n0 0 1 0\n1000000 0 0 1\n";

    fn read(text: &[u8]) -> Result<Vec<Frame>> {
        let (path, options) = (Path::new("a.ptx"), Options::default());
        let index = index(&mut Feed::over(path, text))?;
        let frame = |span: &Span| {
            let request =
                Request { options: &options, bytes: span.bytes, units: None, topology: None, others: &() };
            frame(&mut Feed::over(path, text), &request, &())
        };
        index.frames.iter().map(frame).collect()
    }

    fn sample() -> String {
        let identity = "1\n2\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
        format!(
            "{TURNED}1 2 3 0.5 10 20 30\n0 0 0 0.5 0 0 0\n0 2 0 0.25 1 2 3\n1 0 0.125 1 4 5 6\n{identity}0 0 0 0 0 0 0\n9 8 7 1 7 7 7\n"
        )
    }

    #[test]
    fn scans_are_brought_to_their_places_and_empty_points_dropped() {
        for text in [sample(), sample().replace('\n', "\r\n"), format!("{}\n\n", sample())] {
            assert!(recognise(text.as_bytes()));
            let frames = read(text.as_bytes()).unwrap();
            let particles = &frames[0].particles;
            assert_eq!((frames.len(), particles.len(), particles.dropped().position), (1, 4, 2));
            let places: Vec<[f64; 3]> = (0..4).map(|id| particles.positions().world(id).to_array()).collect();
            // (x, y, z) becomes (1e6 - y, x, z).
            assert_eq!(places[..3], [[999_998.0, 1.0, 3.0], [999_998.0, 0.0, 0.0], [1e6, 1.0, 0.125]]);
            assert_eq!(places[3], [9.0, 8.0, 7.0]);
            let numbers = |name: &str| {
                let attribute = particles.attribute(name).unwrap();
                (0..4).map(|id| attribute.number(id, 0)).collect::<Vec<_>>()
            };
            assert_eq!(numbers("intensity"), [0.5, 0.25, 1.0, 1.0]);
            assert_eq!(numbers("green"), [20.0, 2.0, 5.0, 7.0]);
            assert_eq!(numbers("scan"), [0.0, 0.0, 0.0, 1.0]);
        }
    }

    #[test]
    fn scans_that_are_whole_are_kept_of_a_file_that_is_cut() {
        let text = sample();
        let index = |text: &str| index(&mut Feed::over(Path::new("a.ptx"), text.as_bytes())).unwrap();
        let first = text.rfind("1\n2\n0 0 0\n").unwrap();
        for end in [text.len() - 15, text.len() - 60, first + 3] {
            let index = index(&text[..end]);
            assert_eq!((index.frames.len(), index.cut), (1, true), "{end}");
        }
        let index = index(&text[..first - 30]);
        assert_eq!((index.frames.len(), index.cut), (0, true));
    }

    #[test]
    fn what_is_wrong_is_said() {
        let message = |text: String| read(text.as_bytes()).err().unwrap().to_string();
        assert!(
            message(sample().replace("0 1 0 0\n-1", "0 1 0\n-1")).contains("a row of the matrix (4 numbers)")
        );
        assert!(message(sample().replacen("2\n2\n", "2\n-2\n", 1)).contains("2 columns and -2 rows"));
        assert!(
            message(sample().replace(" 0 0 0 0\n9 8 7 1 7 7 7", "\n9 8 7 1"))
                .contains("of 7 in those before")
        );
        let huge = sample().replacen("2\n2\n", "4294967295\n4294967295\n", 1);
        assert!(read(huge.as_bytes()).unwrap().is_empty());
    }

    #[test]
    fn other_texts_are_not_taken_for_it() {
        for text in
            [&b"2\n1 2 3\n4 5 6\n"[..], b"2\n\nO 0 0 0\nO 1 1 1\n", b"1\n2\n3\n4\n5\n6\n7\n8\n9\n10\n11\n"]
        {
            assert!(!recognise(text));
        }
    }

    #[test]
    fn damage_never_panics() {
        real_data::damage(sample().as_bytes(), |file| drop(read(file)));
    }
}
