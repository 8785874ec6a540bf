//! Rows of text to columns, many slices at once: what XYZ, LAMMPS dumps and tables have in common.
//!
//! A block of whole lines is cut into slices at line ends, each slice is parsed into columns of its own, and these are joined
//! in order, every column by itself. Blocks and slices have fixed sizes, so the result does not depend on the number of threads. In
//! flight are one block of text and its columns; all else is the final columns.

mod fields;
mod part;

use rayon::prelude::*;
use tyndall::pages::reserve;
use tyndall::scene::wanted::{Offered, Wanted};
use tyndall::{Attribute, Cell, DVec3, Positions, Progress, Result};

use super::column::{Column, Kind, Separator, number};
use super::feed::Feed;
use part::{Part, Stop};

/// Text that is parsed together.
const BLOCK: usize = 8 << 20;
/// Text that one thread parses at a time.
const SLICE: usize = 256 << 10;
/// Rows that are looked at to tell numbers from words.
const SAMPLE: usize = 100;

/// What a field of a row is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    /// The coordinate along an axis.
    Axis(usize),
    /// The next component of an attribute.
    Attribute(usize),
    /// Nothing that is wanted.
    Skipped,
}

/// An attribute before it is read.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Heading {
    pub(crate) name: String,
    pub(crate) components: usize,
    pub(crate) kind: Kind,
    pub(crate) unit: Option<String>,
}

impl Heading {
    /// A scalar without a unit.
    pub(crate) fn scalar(name: impl Into<String>, kind: Kind) -> Self {
        Self { name: name.into(), components: 1, kind, unit: None }
    }

    fn offered(&self) -> Offered<'_> {
        // What begins with whole numbers may go on with others.
        let is_measured = matches!(self.kind, Kind::Integer | Kind::Float);
        Offered { name: &self.name, components: self.components, is_measured }
    }
}

/// What the coordinates of a row are, where they are no places.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Scaled {
    /// Fractions of a cell's edges.
    Fractions(Cell),
    /// In the coordinates of a scanner, the axes and the zero of which lie there; a point at zero has no place.
    Scanner([DVec3; 3], DVec3),
}

impl Scaled {
    /// The place that these coordinates mean.
    #[inline(always)]
    fn place(&self, coordinates: [f64; 3]) -> [f64; 3] {
        let ([a, b, c], origin) = match self {
            Self::Fractions(cell) => (cell.vectors, cell.origin),
            Self::Scanner(..) if coordinates == [0.0; 3] => return [f64::NAN; 3],
            Self::Scanner(axes, place) => (*axes, *place),
        };
        let [x, y, z] = coordinates;
        (origin + x * a + y * b + z * c).to_array()
    }
}

/// How a row is to be understood.
#[derive(Clone, Debug)]
pub(crate) struct Layout {
    /// How fields are told apart.
    pub(crate) separator: Separator,
    /// What each field is, in order.
    pub(crate) roles: Vec<Role>,
    /// The attributes.
    pub(crate) headings: Vec<Heading>,
    /// How coordinates become places, if they are none.
    pub(crate) scaled: Option<Scaled>,
    /// Whether empty lines and lines that begin with `#` may stand between rows, and comments that do behind them.
    pub(crate) gaps: bool,
    /// Where the file's middle is, if that is known.
    pub(crate) origin: Option<DVec3>,
}

impl Layout {
    /// Passes over the attributes that are not wanted.
    pub(crate) fn keep(&mut self, wanted: Option<&Wanted>) {
        let Some(wanted) = wanted else { return };
        let flags = wanted.flags(&self.headings.iter().map(Heading::offered).collect::<Vec<_>>());
        let new_place = |place: usize| flags[..place].iter().filter(|&&it| it).count();
        for role in &mut self.roles {
            *role = match *role {
                Role::Attribute(place) if flags[place] => Role::Attribute(new_place(place)),
                Role::Attribute(_) => Role::Skipped,
                role => role,
            };
        }
        let mut flags = flags.iter();
        self.headings.retain(|_| *flags.next().expect("a flag a heading"));
    }
}

/// What was read.
pub(crate) struct Rows {
    pub(crate) positions: Positions,
    pub(crate) attributes: Vec<Attribute>,
}

/// Reads `count` rows, or all that are left. `bytes` is their size, as far as it is known: no room is made for more rows than
/// could stand there. Fewer rows than `count` are an error.
pub(crate) fn read(
    feed: &mut Feed,
    layout: &Layout,
    count: Option<u64>,
    bytes: Option<u64>,
    progress: &dyn Progress,
) -> Result<Rows> {
    progress.begin("read", bytes, "B");
    let mut builder = Builder::new(layout);
    builder.add(feed, layout, Expected { count, bytes }, progress)?;
    Ok(builder.finish(layout))
}

/// What is known of rows before they are read.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Expected {
    /// How many there are; all that are left if nobody knows.
    pub(crate) count: Option<u64>,
    /// Their size, as far as it is known.
    pub(crate) bytes: Option<u64>,
}

/// The columns while they are filled: from one text, or from several that follow each other.
pub(crate) struct Builder {
    origin: Option<DVec3>,
    offsets: [Vec<f32>; 3],
    columns: Vec<Column>,
}

impl Builder {
    /// No rows yet.
    pub(crate) fn new(layout: &Layout) -> Self {
        let columns = layout.headings.iter().map(|it| Column::new(it.kind, 0)).collect();
        Self { origin: layout.origin, offsets: Default::default(), columns }
    }

    /// Appends the rows that follow in `feed`; advances `progress` by their bytes. See [`read`].
    pub(crate) fn add(
        &mut self,
        feed: &mut Feed,
        layout: &Layout,
        Expected { count, bytes }: Expected,
        progress: &dyn Progress,
    ) -> Result<()> {
        // A row has at least a digit and a separator a field.
        let most = bytes.map_or(1 << 16, |bytes| bytes / (2 * layout.roles.len() as u64));
        let expected = count.or(bytes.map(|bytes| bytes / row_bytes(feed))).unwrap_or(0).min(most) as usize;
        self.offsets.iter_mut().for_each(|column| reserve(column, expected));
        for (column, heading) in self.columns.iter_mut().zip(&layout.headings) {
            column.reserve(expected.saturating_mul(heading.components));
        }

        let path = feed.path().to_path_buf();
        let mut left = count.unwrap_or(u64::MAX);
        // They are filled again and again, so that no memory is asked for.
        let mut parts: Vec<Part> = Vec::new();
        let block_bytes = bytes.map_or(BLOCK, |bytes| bytes.clamp(1 << 12, BLOCK as u64) as usize);
        loop {
            let parsed = feed.block(block_bytes, left, |block| {
                let slices = slices(block.bytes);
                parts.resize_with(parts.len().max(slices.len()), || Part::new(layout));
                let parts = &mut parts[..slices.len()];
                let parse = |(part, slice): (&mut Part, &&[u8])| {
                    let read =
                        if progress.cancelled() { Err(Stop::Cancelled) } else { part.read(slice, layout) };
                    progress.advance(slice.len() as u64);
                    read
                };
                // One by one, so that no thread waits long for the others.
                let read: Vec<_> = parts.par_iter_mut().zip(&slices).with_max_len(1).map(parse).collect();
                let (mut line, mut rows) = (block.first_line, 0);
                for ((part, slice), read) in parts.iter().zip(slices).zip(read) {
                    read.map_err(|stop| stop.at(&path, line))?;
                    line += part.lines;
                    debug_assert_eq!(part.lines, part_lines(slice));
                    rows += part.rows() as u64;
                }
                let middle = || parts.first().map_or(DVec3::ZERO, Part::middle);
                let origin = *self.origin.get_or_insert_with(middle);
                join(parts, origin, &mut self.offsets, &mut self.columns);
                Ok(rows)
            })?;
            let Some(rows) = parsed else { break };
            left -= rows;
        }
        match count.filter(|_| left > 0) {
            Some(count) => {
                let what = format!("the file ends after {} of {count} particles", count - left);
                Err(feed.fault(what, "was it changed or cut while it was read?"))
            }
            None => Ok(()),
        }
    }

    /// Whether no row was appended.
    pub(crate) fn is_empty(&self) -> bool {
        self.offsets[0].is_empty()
    }

    /// All rows that were appended.
    pub(crate) fn finish(self, layout: &Layout) -> Rows {
        let attributes = layout.headings.iter().zip(self.columns).map(|(heading, column)| Attribute {
            name: heading.name.clone(),
            components: heading.components,
            unit: heading.unit.clone(),
            values: column.into_values(),
        });
        let positions = Positions::from_offsets(self.origin.unwrap_or(DVec3::ZERO), self.offsets);
        Rows { positions, attributes: attributes.collect() }
    }
}

/// Appends what slices had, every column on a thread of its own.
fn join(parts: &[Part], origin: DVec3, offsets: &mut [Vec<f32>; 3], columns: &mut [Column]) {
    let append = |(place, column): (usize, &mut Column)| {
        parts.iter().for_each(|part| column.append(&part.columns[place]));
    };
    let extend = |(axis, offsets): (usize, &mut Vec<f32>)| {
        let origin = origin[axis];
        for part in parts {
            offsets.extend(part.axes[axis].iter().map(|value| (value - origin) as f32));
        }
    };
    rayon::join(
        || offsets.par_iter_mut().enumerate().with_max_len(1).for_each(extend),
        || columns.par_iter_mut().enumerate().with_max_len(1).for_each(append),
    );
}

/// Says that the last value of a text may be cut, where no line end follows it. Two lines before whose last numbers are written
/// alike, with as many digits behind the point, show that it is whole.
pub(crate) fn open_end(text: &[u8]) -> Option<String> {
    if text.last().is_none_or(u8::is_ascii_whitespace) {
        return None;
    }
    let tail = &text[text.len().saturating_sub(1 << 12)..];
    let lines = tail.rsplit(|&byte| byte == b'\n').map(<[u8]>::trim_ascii).filter(|it| !it.is_empty());
    let mut words = lines.filter_map(|line| line.rsplit(|byte| b" \t,;".contains(byte)).next());
    let last = words.next()?;
    let form = |word: &[u8]| -> Option<Vec<u8>> {
        let point = word.iter().position(|&byte| byte == b'.')?;
        let form = word[point + 1..].iter().map(|&it| if it.is_ascii_digit() { b'0' } else { it });
        Some(form.map(|it| if it == b'+' { b'-' } else { it }).collect())
    };
    let wanted = form(last).filter(|it| !it.is_empty());
    if wanted.is_some() && words.by_ref().take(2).filter(|word| form(word) == wanted).count() == 2 {
        return None;
    }
    let last = shortened(last);
    Some(format!(
        "no line end follows the last value, '{last}': if the file was cut there, it may be a part of the value"
    ))
}

/// The kind of each field, by the first rows of `text`: words where a field is no number, integers where all are.
pub(crate) fn kinds(text: &[u8], separator: Separator, fields: usize) -> Vec<Kind> {
    let mut kinds = vec![Kind::Integer; fields];
    for line in text.split(|&byte| byte == b'\n').filter(|it| !it.trim_ascii().is_empty()).take(SAMPLE) {
        for (kind, token) in kinds.iter_mut().zip(split(line, separator)) {
            let is_number = matches!(number(token, separator), Some((_, taken)) if taken == token.len());
            if !is_number && !token.is_empty() {
                *kind = Kind::Text;
            }
        }
    }
    kinds
}

/// The fields of a line. A separator at the line's end has no field behind it.
pub(crate) fn split(line: &[u8], separator: Separator) -> impl Iterator<Item = &[u8]> {
    let mut rest = line.trim_ascii();
    std::iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        let (token, taken) = separator.token(rest);
        rest = trim_start(&rest[taken..], separator);
        if let Some(byte) = separator.byte {
            // Whatever stands between a closing quote and the separator belongs to no field.
            let next = memchr::memchr(byte, rest).map_or(rest.len(), |place| place + 1);
            rest = trim_start(&rest[next..], separator);
        }
        Some(token)
    })
}

fn trim_start(mut rest: &[u8], separator: Separator) -> &[u8] {
    while let [first, tail @ ..] = rest
        && separator.is_blank(*first)
    {
        rest = tail;
    }
    rest
}

/// The mean length of the next rows, for estimates.
fn row_bytes(feed: &mut Feed) -> u64 {
    let text = feed.peek(1 << 16).unwrap_or_default();
    (text.len() as u64 / part_lines(text).max(1)).max(1)
}

fn part_lines(text: &[u8]) -> u64 {
    memchr::memchr_iter(b'\n', text).count() as u64 + u64::from(!text.is_empty() && !text.ends_with(b"\n"))
}

/// Cuts at line ends.
pub(crate) fn slices(block: &[u8]) -> Vec<&[u8]> {
    let mut slices = Vec::with_capacity(block.len() / SLICE + 1);
    let mut rest = block;
    while rest.len() > SLICE {
        let end = memchr::memchr(b'\n', &rest[SLICE..]).map_or(rest.len(), |place| SLICE + place + 1);
        let (slice, tail) = rest.split_at(end);
        slices.push(slice);
        rest = tail;
    }
    slices.push(rest);
    slices
}

/// Text for a message.
pub(crate) fn shortened(text: &[u8]) -> String {
    let text = String::from_utf8_lossy(text);
    let mut short: String = text.trim().chars().take(60).collect();
    if short.len() < text.trim().len() {
        short.push('…');
    }
    short
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;
    use tyndall::{Error, Values};

    fn layout(separator: Separator) -> Layout {
        let headings = vec![Heading::scalar("id", Kind::Integer)];
        let roles = vec![Role::Attribute(0), Role::Axis(0), Role::Axis(1), Role::Axis(2)];
        Layout { separator, roles, headings, scaled: None, gaps: false, origin: None }
    }

    fn rows(text: &str, count: Option<u64>, layout: &Layout) -> Result<Rows> {
        let mut feed = Feed::over(Path::new("rows"), text.as_bytes());
        read(&mut feed, layout, count, Some(text.len() as u64), &())
    }

    #[test]
    fn slices_join_to_what_one_thread_reads() {
        let count = 100_000;
        let text: String = (0..count).map(|k| format!("{k} {}.5 -{k}e-3\t{}\r\n", k, 2 * k)).collect();
        let rows = rows(&text, Some(count), &layout(Separator::BLANKS)).unwrap();
        assert_eq!(rows.attributes[0].values, Values::I32((0..count as i32).collect()));
        for k in [0, 1, 54_321, 99_999] {
            let wanted = DVec3::new(k as f64 + 0.5, k as f64 * -1e-3, 2.0 * k as f64);
            assert!(rows.positions.world(k).abs_diff_eq(wanted, 1e-2), "row {k}");
        }
    }

    #[test]
    fn gaps_do_not_count_as_rows() {
        let layout = Layout { gaps: true, ..layout(Separator::BLANKS) };
        let text = "1 2 3 4\n\n# more\n2 2 3 4\n3 2 3 4\n4 0 0 0\n";
        assert_eq!(rows(text, Some(3), &layout).unwrap().positions.len(), 3);
        assert!(rows(text, Some(5), &layout).err().unwrap().to_string().contains("after 4 of 5 particles"));
    }

    #[test]
    fn numbers_are_those_of_the_standard_library_whatever_stands_around_them() {
        let mut state = 7u64;
        let mut random = |below: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % below
        };
        for separator in [Separator::BLANKS, Separator { byte: Some(b','), decimal_comma: false }] {
            let (mut text, mut wanted) = (String::new(), vec![[0.0; 4]; 2000]);
            for row in &mut wanted {
                for (field, wanted) in row.iter_mut().enumerate() {
                    let value = random(2_000_000_000) as f64 - 1e9;
                    let number = match (field, random(6)) {
                        (0, _) => format!("{:.0}", value / [1.0, 1e4, 1e8][random(3) as usize]),
                        (_, 0) => format!("{value:e}"),
                        (_, 1) => format!("{:.17}", value * 1e-9),
                        (_, 2) => format!("+{:.3}", value.abs() * 1e-7),
                        (_, decimals) => format!("{:.*}", 2 * decimals as usize, value * 1e-7),
                    };
                    *wanted = number.parse::<f64>().unwrap();
                    text += ["", "", " ", "  "][random(4) as usize];
                    text += &number;
                    let between = if separator.byte.is_some() { [",", " ,"] } else { [" ", " \t"] };
                    text += if field < 3 { between[random(2) as usize] } else { "" };
                }
                text += ["\n", "\r\n", " \n", "\t\r\n"][random(4) as usize];
            }
            let rows = rows(text.trim_end(), Some(2000), &layout(separator)).unwrap();
            let origin = rows.positions.origin();
            for (row, wanted) in wanted.iter().enumerate() {
                assert_eq!(rows.attributes[0].values.number(row), wanted[0], "row {row}");
                let offsets = rows.positions.offset(row).to_array();
                let expected = [0, 1, 2].map(|axis| (wanted[axis + 1] - origin[axis]) as f32);
                assert_eq!(offsets, expected, "row {row}");
            }
        }
    }

    #[test]
    fn faults_name_line_and_value() {
        let layout = layout(Separator::BLANKS);
        let message = |text: &str| rows(text, None, &layout).err().unwrap().to_string();
        assert_eq!(
            message("1 2 3 4\n1 2 x 4\n"),
            "wanted a number for y (column 3), found 'x' (rows: line 2) — correct the line, or leave it out"
        );
        assert!(message("1 2 3 4\n1 2 3\n").contains("wanted 4 values, found 3"));
        assert!(message("1 2 3 4\n1 2 3 4 5\n").contains("wanted 4 values, found 5"));
        assert!(message("1 2 3 4\n\n1 2 3 4\n").contains("found 0"));
    }

    #[test]
    fn a_count_beyond_the_bytes_makes_no_room() {
        let fault = rows("1 2 3 4\n", Some(1 << 60), &layout(Separator::BLANKS)).err().unwrap();
        assert!(fault.to_string().contains("ends after 1 of 1152921504606846976"), "{fault}");
    }

    #[test]
    fn separated_rows_may_lack_values_and_end_with_a_separator() {
        let comma = Separator { byte: Some(b','), decimal_comma: false };
        let rows = rows("1, 2 ,3,4\n\"2\",,3,4,\n3,1,1,\n", None, &layout(comma)).unwrap();
        assert_eq!(rows.attributes[0].values, Values::I32(vec![1, 2, 3]));
        assert!(rows.positions.world(1).x.is_nan() && rows.positions.world(2).z.is_nan());
        assert_eq!(rows.positions.world(0), DVec3::new(2.0, 3.0, 4.0));
    }

    #[test]
    fn cancelling_stops_the_read() {
        struct Cancelled;
        impl Progress for Cancelled {
            fn begin(&self, _: &str, _: Option<u64>, _: &'static str) {}
            fn advance(&self, _: u64) {}
            fn cancelled(&self) -> bool {
                true
            }
        }
        let mut feed = Feed::over(Path::new("rows"), b"1 2 3 4\n");
        let read = read(&mut feed, &layout(Separator::BLANKS), None, None, &Cancelled);
        assert!(matches!(read.err(), Some(Error::Interrupted)));
    }
}
