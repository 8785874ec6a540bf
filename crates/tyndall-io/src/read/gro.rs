//! GROMACS GRO: a title, a count, an atom a line in fixed columns, and the box; again for every frame.
//!
//! A line is residue number, residue, atom, atom number (5 columns each), then x, y, z and maybe velocities; the distance of their
//! decimal points tells how wide they are, so that any precision is read. Lengths are nm. Numbers wrap at 100,000 and are counted on.
//! The box has three numbers or nine, in the order xx yy zz xy xz yx yz zx zy. Source: GROMACS manual, file formats.

use rayon::prelude::*;
use tyndall::particles::Attribute;
use tyndall::{Cell, Columns, DVec3, Error, Positions, Progress, Result};

use super::column::{Column, Words};
use super::feed::Feed;
use super::{Index, Request, Span, finish, molecules, rows, whole_lines};
use crate::sequence::Frame;

/// Text that is parsed together.
const BLOCK: usize = 16 << 20;
/// Where the coordinates begin.
const COORDINATES: usize = 20;
/// The largest number that the columns of atoms and residues have room for.
const LARGEST: i64 = 99_999;
const HINT: &str = "write it again with gmx editconf";

/// Whether the file begins like GRO.
pub(crate) fn recognise(head: &[u8]) -> bool {
    let mut lines = whole_lines(head).skip(1);
    let count = lines.next().and_then(|line| std::str::from_utf8(line).ok()?.trim().parse::<u64>().ok());
    let Some(line) = lines.next() else { return false };
    match count {
        Some(0) => super::is_text(head) && cell(&String::from_utf8_lossy(line)).is_ok(),
        Some(_) => super::is_text(head) && width(line).is_some_and(|width| row(line, width).is_ok()),
        None => false,
    }
}

/// How wide the columns of coordinates are, by the first line.
fn width(line: &[u8]) -> Option<usize> {
    let numbers = line.get(COORDINATES..)?;
    let mut points = memchr::memchr_iter(b'.', numbers);
    let width = points.next().zip(points.next()).map(|(first, second)| second - first)?;
    (3..64).contains(&width).then_some(width)
}

/// A line, cut into its fields.
struct Row<'a> {
    residue_number: &'a [u8],
    residue: &'a [u8],
    name: &'a [u8],
    number: &'a [u8],
    position: [f64; 3],
    velocity: Option<[f64; 3]>,
}

fn row(line: &[u8], width: usize) -> std::result::Result<Row<'_>, String> {
    let field =
        |start: usize, end: usize| line.get(start..end.min(line.len())).unwrap_or_default().trim_ascii();
    let number = |place: usize| {
        let start = COORDINATES + place * width;
        fast_float2::parse::<f64, _>(field(start, start + width)).ok()
    };
    let three = |first: usize| Some([number(first)?, number(first + 1)?, number(first + 2)?]);
    let position = three(0).ok_or_else(|| {
        format!(
            "wanted coordinates of {width} columns behind column {COORDINATES}, found '{}'",
            rows::shortened(line)
        )
    })?;
    Ok(Row {
        residue_number: field(0, 5),
        residue: field(5, 10),
        name: field(10, 15),
        number: field(15, 20),
        position,
        velocity: three(3),
    })
}

/// The box in the last line of a frame; `None` inside if it has no extent.
fn cell(line: &str) -> std::result::Result<Option<Cell>, String> {
    let numbers: Option<Vec<f64>> = line.split_whitespace().map(|it| fast_float2::parse(it).ok()).collect();
    let numbers = numbers.unwrap_or_default();
    let [xx, yy, zz, xy, xz, yx, yz, zx, zy] = match numbers[..] {
        [x, y, z] => [x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [xx, yy, zz, xy, xz, yx, yz, zx, zy] => [xx, yy, zz, xy, xz, yx, yz, zx, zy],
        _ => {
            return Err(format!(
                "wanted a box of 3 or 9 numbers, found '{}'",
                rows::shortened(line.as_bytes())
            ));
        }
    };
    Ok(molecules::cell([DVec3::new(xx, xy, xz), DVec3::new(yx, yy, yz), DVec3::new(zx, zy, zz)]))
}

/// The number behind `t=` in the title.
fn time(title: &str) -> Option<f64> {
    let (_, rest) = title.rsplit_once("t=")?;
    rest.split_whitespace().next()?.parse().ok()
}

/// Whether a last line without its line feed may have lost some of its end: its last number is shorter than the others.
fn is_cut(line: &str) -> bool {
    let decimals = |word: &str| word.rsplit_once('.').map(|(_, decimals)| decimals.len());
    let lengths: Vec<Option<usize>> = line.split_whitespace().map(decimals).collect();
    let torn = match lengths[..] {
        [first, .., last] => last != first && lengths[..lengths.len() - 1].iter().all(|it| *it == first),
        _ => true,
    };
    torn || cell(line).is_err()
}

/// Finds the frames by their counts.
pub(crate) fn index(feed: &mut Feed) -> Result<Index> {
    let mut index = Index::default();
    while !feed.peek(1 << 10)?.trim_ascii().is_empty() {
        let (offset, line) = (feed.offset(), feed.line_number());
        let _title = feed.line()?;
        let Some(count) = feed.line()? else {
            index.cut = true;
            break;
        };
        let last = feed.at_end()?;
        let Ok(count) = count.trim().parse::<u64>() else {
            if last && feed.cut() {
                index.cut = true;
                break;
            }
            let what = format!("wanted the number of atoms, found '{}'", rows::shortened(count.as_bytes()));
            return Err(feed.fault(what, "does the count of the frame before match its lines?"));
        };
        let found = feed.skip_lines(count)?;
        let closed = memchr::memchr(b'\n', feed.peek(1 << 12)?).is_some();
        let end = feed.line()?.filter(|_| found == count);
        let Some(end) = end else {
            index.cut = true;
            break;
        };
        if !closed && (feed.cut() || is_cut(&end)) {
            index.cut = true;
            break;
        }
        index.frames.push(Span { offset, line, bytes: Some(feed.offset() - offset) });
    }
    index.cut |= feed.cut();
    Ok(index)
}

/// The columns while they are filled.
#[derive(Default)]
struct Part {
    lines: u64,
    positions: Vec<DVec3>,
    residue_numbers: Vec<Option<i64>>,
    residues: Words,
    names: Words,
    numbers: Vec<Option<i64>>,
    velocities: Vec<f32>,
}

impl Part {
    /// Reads the lines of a slice; on failure says in which one, counted from 0.
    fn read(slice: &[u8], width: usize) -> std::result::Result<Self, (u64, String)> {
        let mut part = Self::default();
        let text = slice.strip_suffix(b"\n").unwrap_or(slice);
        let number = |field: &[u8]| std::str::from_utf8(field).ok()?.parse().ok();
        for line in text.split(|&byte| byte == b'\n') {
            let row = row(line.trim_ascii_end(), width).map_err(|what| (part.lines, what))?;
            part.lines += 1;
            part.positions.push(DVec3::from_array(row.position));
            part.residue_numbers.push(number(row.residue_number));
            part.residues.push(row.residue);
            part.names.push(row.name);
            part.numbers.push(number(row.number));
            part.velocities.extend(row.velocity.unwrap_or([f64::NAN; 3]).map(|it| it as f32));
        }
        Ok(part)
    }

    fn append(&mut self, other: Self) {
        self.residue_numbers.extend(other.residue_numbers);
        self.residues.append(&other.residues);
        self.names.append(&other.names);
        self.numbers.extend(other.numbers);
        self.velocities.extend(other.velocities);
    }
}

/// Reads a frame.
pub(crate) fn frame(feed: &mut Feed, request: &Request, progress: &dyn Progress) -> Result<Frame> {
    progress.begin("read", request.bytes, "B");
    let title = feed.line()?.unwrap_or_default();
    let count = feed.line()?.unwrap_or_default();
    let count: u64 = count
        .trim()
        .parse()
        .map_err(|_| feed.fault("wanted the number of atoms", "was the file changed?"))?;
    let first = feed.peek(1 << 10)?.split(|&byte| byte == b'\n').next().unwrap_or_default();
    let width = match width(first) {
        Some(width) => width,
        None if count == 0 => 8,
        None => {
            let what =
                format!("wanted three coordinates with decimal points, found '{}'", rows::shortened(first));
            return Err(Error::format(feed.path(), format!("line {}", feed.line_number()), what, HINT));
        }
    };

    let path = feed.path().to_path_buf();
    let (mut all, mut positions) = (Part::default(), Positions::new());
    let mut left = count;
    while left > 0 {
        let lines = feed.block(BLOCK, left, |block| {
            let slices = rows::slices(block.bytes);
            let read = |slice: &&[u8]| {
                progress.advance(slice.len() as u64);
                if progress.cancelled() { None } else { Some(Part::read(slice, width)) }
            };
            let parts: Vec<_> = slices.par_iter().map(read).collect();
            let mut line = block.first_line;
            for part in parts {
                let part = part.ok_or(Error::Interrupted)?.map_err(|(within, what)| {
                    Error::format(&path, format!("line {}", line + within), what, HINT)
                })?;
                line += part.lines;
                positions.extend(&part.positions);
                all.append(part);
            }
            Ok(block.lines)
        })?;
        let Some(lines) = lines else {
            let what = format!("the file ends after {} of {count} atoms", count - left);
            return Err(feed.fault(what, "was it changed or cut while it was read?"));
        };
        left -= lines;
    }
    let cell = cell(&feed.line()?.unwrap_or_default()).map_err(|what| feed.fault(what, HINT))?;

    let mut conventions = vec!["lengths: nm (GRO convention)".to_string()];
    if all.numbers.contains(&Some(LARGEST)) && all.numbers.last() != Some(&Some(LARGEST)) {
        conventions.push("numbers of atoms and residues are counted on beyond 99,999".to_string());
    }
    let mut attributes = vec![
        Attribute::new("resid", 1, molecules::counted_on(&all.residue_numbers, LARGEST, 0)),
        Attribute::new("resname", 1, Column::Text(all.residues).into_values()),
        Attribute::new("name", 1, Column::Text(all.names).into_values()),
        Attribute::new("id", 1, molecules::counted_on(&all.numbers, LARGEST, 1)),
    ];
    if all.velocities.iter().any(|it| it.is_finite()) {
        let mut velocity = Attribute::new("velocity", 3, tyndall::Values::F32(all.velocities));
        velocity.unit = Some("nm/ps".to_string());
        attributes.push(velocity);
    }
    let columns = Columns {
        positions,
        attributes,
        radii: None,
        cell,
        time: time(&title),
        time_unit: Some("ps".to_string()),
        length_unit: Some("nm".to_string()),
        bonds: Vec::new(),
    };
    finish(columns, conventions, Vec::new())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::real_data;
    use crate::sequence::Options;
    use tyndall::Values;

    const SMALL: &str = "Water, t=   1.50000 step= 3\n    3\n99999SOL     OW99998   0.126  -1.624   1.679  0.1227 -0.0580  0.0434\n\
        99999SOL    HW199999   0.190   1.661   1.747  0.8085  0.3191 -0.7791\n    0SOL      M    0   0.177   1.568   1.613 -0.9045 -2.6469  1.3180\n\
        1.86824   2.0 3.0   0 0  0.5 0 0.25 -0.125\n";

    fn read(text: &str) -> Result<Vec<Frame>> {
        real_data::open(text.as_bytes())
    }

    #[test]
    fn names_numbers_velocities_and_box_are_read() {
        for text in [
            SMALL.to_string(),
            SMALL.replace('\n', "\r\n"),
            SMALL.trim_end().replace("2.0 3.0", "2.0 3.00000"),
        ] {
            let frame = read(&text).unwrap().remove(0);
            let particles = &frame.particles;
            assert!(particles.positions().world(0).abs_diff_eq(DVec3::new(0.126, -1.624, 1.679), 1e-7));
            assert_eq!(
                particles.attribute("resid").unwrap().values,
                Values::I32(vec![99_999, 99_999, 100_000])
            );
            assert_eq!(particles.attribute("id").unwrap().values, Values::I32(vec![99_998, 99_999, 100_000]));
            let Values::Text { codes, names } = &particles.attribute("name").unwrap().values else {
                panic!()
            };
            assert_eq!((codes.as_slice(), names.join(" ")), (&[0, 1, 2][..], "OW HW1 M".to_string()));
            assert_eq!(particles.attribute("velocity").unwrap().number(2, 1), f64::from(-2.6469f32));
            let edges =
                [DVec3::new(1.86824, 0.0, 0.0), DVec3::new(0.5, 2.0, 0.0), DVec3::new(0.25, -0.125, 3.0)];
            assert_eq!(particles.cell().unwrap().vectors, edges);
            assert_eq!((particles.time(), particles.length_unit()), (Some(1.5), Some("nm")));
            assert_eq!(frame.conventions.len(), 2);
        }
    }

    #[test]
    fn any_precision_and_many_frames_are_read() {
        let wide = "a\n1\n    1LYS     CA    1    0.123456   -1.654321    2.000001\n0 0 0\n";
        let narrow =
            "\n2\n    1LYS     CA*****   0.1   1.5   2.0\n    1LYS     CB*****   0.1   1.5   2.0\n 5 5 5\n\n";
        let frames = read(&format!("{wide}{narrow}")).unwrap();
        assert_eq!(frames.iter().map(|it| it.particles.len()).collect::<Vec<_>>(), [1, 2]);
        assert!(
            frames[0]
                .particles
                .positions()
                .world(0)
                .abs_diff_eq(DVec3::new(0.123456, -1.654321, 2.000001), 1e-7)
        );
        assert!(frames[0].particles.cell().is_none() && frames[1].particles.cell().is_some());
        assert_eq!(frames[1].particles.attribute("id").unwrap().values, Values::I32(vec![1, 2]));
        assert!(read("none\n0\n1 1 1\n").unwrap()[0].particles.is_empty());
    }

    #[test]
    fn what_is_wrong_is_said() {
        let message = |text: &str| {
            let index = index(&mut Feed::over(std::path::Path::new("test"), text.as_bytes()));
            let read = index.and_then(|_| {
                real_data::frames(
                    &real_data::recognised(SMALL.as_bytes()).open,
                    text.as_bytes(),
                    &Options::default(),
                )
            });
            read.unwrap_err().to_string()
        };
        assert!(message(&SMALL.replace("1.661", "x.661")).contains("line 4"));
        assert!(message(&SMALL.replace("-0.125", "")).contains("3 or 9 numbers"));
        assert!(message(&SMALL.replacen("    3", "    2", 1)).contains("3 or 9 numbers"));
        let huge = SMALL.replacen("    3", "1152921504606846976", 1);
        assert!(
            index(&mut Feed::over(std::path::Path::new("test"), huge.as_bytes())).unwrap().frames.is_empty()
        );
    }

    #[test]
    fn a_cut_frame_is_noticed_and_damage_never_panics() {
        let two = SMALL.replace("2.0 3.0   0 0  0.5 0 0.25 -0.125", "2.00000 3.00000").repeat(2);
        for length in two.len() / 2 + 1..two.len() - 2 {
            let index = index(&mut Feed::over(std::path::Path::new("test"), &two.as_bytes()[..length]));
            let Ok(index) = index else { continue };
            assert_eq!((index.frames.len(), index.cut), (1, true), "{length}");
        }
        let open = &real_data::recognised(SMALL.as_bytes()).open;
        real_data::damage(SMALL.as_bytes(), |file| drop(real_data::frames(open, file, &Options::default())));
    }
}
