//! A slice of text to columns of its own: usual rows column by column, others in one pass, field by field.
//!
//! Invariant: fast readers of numbers decide nothing about meaning, as what they leave is read by slower ones.

use fearless_simd::{Level, Simd, dispatch};
use fearless_simd_macros::simd;
use tyndall::{DVec3, Error, Positions};

use super::fields::Fields;
use super::{Layout, Role, shortened, split};
use crate::read::column::batch::{Batch, Reader};
use crate::read::column::{Column, Kind, Rest, Separator, double};

/// So often the number of lines doubles that are read one by one where rows were looked for in vain.
const MISSES: u32 = 6;

/// Why a slice could not be read.
pub(super) enum Stop {
    Cancelled,
    /// In line `line` of the slice, counted from 0.
    Fault {
        line: u64,
        what: String,
    },
}

impl Stop {
    pub(super) fn at(self, path: &std::path::Path, first_line: u64) -> Error {
        match self {
            Self::Cancelled => Error::Interrupted,
            Self::Fault { line, what } => {
                let hint = "correct the line, or leave it out";
                Error::format(path, format!("line {}", first_line + line), what, hint)
            }
        }
    }
}

/// A slice, read.
pub(super) struct Part {
    pub(super) axes: [Vec<f64>; 3],
    pub(super) columns: Vec<Column>,
    /// How many lines it had.
    pub(super) lines: u64,
    /// What reads rows together, once there were some.
    together: Option<Box<Together>>,
}

/// What reads rows together.
struct Together {
    fields: Fields,
    reader: Reader,
    /// The fields of each attribute, in order.
    own: Vec<Vec<usize>>,
}

impl Together {
    fn new(layout: &Layout) -> Self {
        let fields = layout.roles.len();
        let of = |place: usize| (0..fields).filter(move |&it| layout.roles[it] == Role::Attribute(place));
        let own = (0..layout.headings.len()).map(|place| of(place).collect()).collect();
        Self { fields: Fields::new(), reader: Reader::new(fields), own }
    }
}

impl Part {
    /// None yet.
    pub(super) fn new(layout: &Layout) -> Self {
        let columns = layout.headings.iter().map(|it| Column::new(it.kind, 0)).collect();
        Self { axes: Default::default(), columns, lines: 0, together: None }
    }

    /// Empties it for other rows.
    fn restart(&mut self, layout: &Layout) {
        self.lines = 0;
        self.axes.iter_mut().for_each(Vec::clear);
        for (column, heading) in self.columns.iter_mut().zip(&layout.headings) {
            column.restart(heading.kind);
        }
    }

    /// Reads a slice in place of what was read before.
    pub(super) fn read(&mut self, slice: &[u8], layout: &Layout) -> std::result::Result<(), Stop> {
        let filled = dispatch!(Level::new(), simd => fill(simd, self, slice, layout));
        filled.map_err(|what| Stop::Fault { line: self.lines, what })
    }

    /// Reads the lines of `text`: those whose fields are found together column by column, others in one pass.
    #[inline(always)]
    fn rows_between<S: Simd>(
        &mut self,
        simd: S,
        text: &[u8],
        layout: &Layout,
        separator: Separator,
        mut together: Option<&mut Together>,
    ) -> std::result::Result<(), String> {
        let (mut at, mut misses, mut wait) = (0, 0, 0);
        while at < text.len() {
            if wait > 0 {
                wait -= 1;
            } else if let Some(Together { fields, reader, own }) = together.as_deref_mut() {
                let (rows, end) = fields.find(simd, &text[at..], layout.roles.len(), separator, layout.gaps);
                if end > 0 {
                    self.columns(simd, (reader, own), rows, layout).ok_or_else(String::new)?;
                    at += end;
                    misses = 0;
                    continue;
                }
                // Lines that are no usual rows often follow each other: ever more are read one by one before the next try.
                misses = (misses + 1).min(MISSES);
                wait = (1 << misses) - 1;
            }
            let may_be_gap = layout.gaps && matches!(text[at], 0..=b' ' | b'#');
            at = if may_be_gap && is_gap(Rest(&text[at..]).line()) {
                next_line(text, at)
            } else {
                self.row(simd, (text, at), layout, separator)?
            };
            self.lines += 1;
        }
        Ok(())
    }

    /// Reads rows column by column; `None` if a field of them cannot be read, and then what was appended is of no use.
    #[inline(always)]
    fn columns<S: Simd>(
        &mut self,
        simd: S,
        (reader, own): (&mut Reader, &[Vec<usize>]),
        rows: Batch,
        layout: &Layout,
    ) -> Option<()> {
        let first = self.rows();
        self.axes.iter_mut().for_each(|axis| axis.resize(first + rows.rows(), 0.0));
        for (field, role) in layout.roles.iter().enumerate() {
            if let Role::Axis(axis) = *role {
                rows.doubles(simd, reader, field, &mut self.axes[axis][first..])?;
            }
        }
        if let Some(scaled) = &layout.scaled {
            for row in first..self.rows() {
                let place = scaled.place(self.axes.each_ref().map(|axis| axis[row]));
                (0..3).for_each(|axis| self.axes[axis][row] = place[axis]);
            }
        }
        for (column, own) in self.columns.iter_mut().zip(own) {
            column.extend(simd, reader, rows, own)?;
        }
        self.lines += rows.rows() as u64;
        Some(())
    }

    /// How many particles it has.
    pub(super) fn rows(&self) -> usize {
        self.axes[0].len()
    }

    /// The middle of its positions.
    pub(super) fn middle(&self) -> DVec3 {
        let position = |row: usize| DVec3::from_array(std::array::from_fn(|axis| self.axes[axis][row]));
        let mut positions = Positions::new();
        positions.extend(&(0..self.rows()).map(position).collect::<Vec<_>>());
        positions.origin()
    }

    /// Reads the line at byte `start` of `text`, and says where the next one begins; gives what is wrong with it if it cannot be read.
    #[inline(always)]
    fn row<S: Simd>(
        &mut self,
        simd: S,
        (text, start): (&[u8], usize),
        layout: &Layout,
        separator: Separator,
    ) -> std::result::Result<usize, String> {
        let mut position = [0.0; 3];
        let mut at = start;
        for (field, role) in layout.roles.iter().enumerate() {
            at = blanks_end(text, at, separator);
            let rest = Rest(&text[at..]);
            let taken = match *role {
                Role::Axis(axis) => match double(simd, rest, separator) {
                    Some((value, taken)) => {
                        position[axis] = value;
                        Some(taken)
                    }
                    None => None,
                },
                Role::Attribute(attribute) => self.columns[attribute].push(simd, rest, separator),
                Role::Skipped => Some(rest.token(separator).1),
            };
            // Between blanks no field is empty: the line ends before it.
            match taken {
                Some(taken) if taken > 0 || separator.byte.is_some() => at += taken,
                _ => return Err(wrong_value(Rest(&text[start..]).line(), layout, field, rest.line())),
            }
            if let Some(byte) = separator.byte {
                at = blanks_end(text, at, separator);
                let is_last = field + 1 == layout.roles.len();
                match text.get(at) {
                    Some(&next) if next == byte => at += 1,
                    _ if !ends_line(&text[at..]) => {
                        return Err(wrong_value(Rest(&text[start..]).line(), layout, field, rest.line()));
                    }
                    _ if is_last => {}
                    // The last field may be missing: the separator before it is then the line's last byte.
                    _ => return Err(wrong_count(Rest(&text[start..]).line(), layout)),
                }
                if field + 2 == layout.roles.len() && ends_line(&text[at..]) {
                    if self.missing(simd, layout.roles[field + 1], &mut position).is_none() {
                        return Err(wrong_count(Rest(&text[start..]).line(), layout));
                    }
                    break;
                }
            }
        }
        let next = match text.get(at) {
            Some(b'\n') => at + 1,
            _ => {
                let line = Rest(&text[at..]).line();
                match line.trim_ascii_start() {
                    [] => {}
                    [b'#', ..] if layout.gaps => {}
                    _ => return Err(wrong_count(Rest(&text[start..]).line(), layout)),
                }
                next_line(text, at + line.len())
            }
        };
        if let Some(scaled) = &layout.scaled {
            position = scaled.place(position);
        }
        for (axis, column) in self.axes.iter_mut().enumerate() {
            column.push(position[axis]);
        }
        Ok(next)
    }

    /// A missing last value.
    #[inline(always)]
    fn missing<S: Simd>(&mut self, simd: S, role: Role, position: &mut [f64; 3]) -> Option<usize> {
        match role {
            Role::Axis(axis) => {
                position[axis] = f64::NAN;
                Some(0)
            }
            Role::Attribute(attribute) => {
                let comma = Separator { byte: Some(b','), decimal_comma: false };
                self.columns[attribute].push(simd, Rest(b""), comma)
            }
            Role::Skipped => Some(0),
        }
    }
}

/// Reads the lines of `text` into `part`, in place of what that had; gives what is wrong with the one that cannot be read.
#[simd]
fn fill<S: Simd>(simd: S, part: &mut Part, text: &[u8], layout: &Layout) -> std::result::Result<(), String> {
    // Between blanks nearly all numbers stand: the loops for them are made apart.
    match layout.separator {
        Separator::BLANKS => fill_between(simd, part, text, layout, Separator::BLANKS),
        other => fill_between(simd, part, text, layout, other),
    }
}

#[inline(always)]
fn fill_between<S: Simd>(
    simd: S,
    part: &mut Part,
    text: &[u8],
    layout: &Layout,
    separator: Separator,
) -> std::result::Result<(), String> {
    part.restart(layout);
    let mut together = part.together.take().unwrap_or_else(|| Box::new(Together::new(layout)));
    together.reader.restart();
    let read = part.rows_between(simd, text, layout, separator, Some(&mut together));
    part.together = Some(together);
    if read.is_ok() {
        return Ok(());
    }
    // Of all lines that cannot be read the first one is told.
    part.restart(layout);
    part.rows_between(simd, text, layout, separator, None)
}

/// Where the blanks end that begin at byte `at`.
#[inline(always)]
fn blanks_end(text: &[u8], mut at: usize, separator: Separator) -> usize {
    while at < text.len() && separator.is_blank(text[at]) {
        at += 1;
    }
    at
}

/// Whether nothing is left of a line.
#[inline(always)]
fn ends_line(rest: &[u8]) -> bool {
    matches!(rest, [] | [b'\n', ..] | [b'\r'] | [b'\r', b'\n', ..])
}

/// Where the line after that at byte `at` begins.
fn next_line(text: &[u8], at: usize) -> usize {
    memchr::memchr(b'\n', &text[at..]).map_or(text.len(), |length| at + length + 1)
}

fn is_gap(line: &[u8]) -> bool {
    let line = line.trim_ascii_start();
    line.is_empty() || line[0] == b'#'
}

#[cold]
fn wrong_count(line: &[u8], layout: &Layout) -> String {
    let wanted = layout.roles.len();
    let found = split(line, layout.separator).count();
    format!("wanted {wanted} values, found {found}: '{}'", shortened(line))
}

#[cold]
fn wrong_value(line: &[u8], layout: &Layout, field: usize, rest: &[u8]) -> String {
    let (token, _) = layout.separator.token(rest);
    let (name, wanted) = match layout.roles[field] {
        Role::Axis(axis) => (["x", "y", "z"][axis], "a number"),
        Role::Attribute(attribute) => {
            let heading = &layout.headings[attribute];
            (heading.name.as_str(), if heading.kind == Kind::Truth { "T or F" } else { "a number" })
        }
        Role::Skipped => ("what is skipped", "a value"),
    };
    // A field that is neither may have lost its separator, so that the count is what the reader needs.
    let found = split(line, layout.separator).count();
    if found != layout.roles.len() {
        return wrong_count(line, layout);
    }
    format!("wanted {wanted} for {name} (column {}), found '{}'", field + 1, shortened(token))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::rows::{Heading, Scaled};

    #[test]
    fn columns_read_together_are_those_of_single_rows() {
        let mut state = 5u64;
        let mut random = |below: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize % below
        };
        let usual = ["0", "-1.5", "102.364", "0.000123", "16777216", "-3.", "7", "1e-3"];
        let unusual =
            ["nan", "1e300", "12345678901234567890", "+4", "16777217.0", "1.00000005960464", "****"];
        let kinds = [Kind::Integer, Kind::Float, Kind::Text, Kind::Truth];
        let vectors = [DVec3::X, 2.0 * DVec3::Y, DVec3::new(0.5, 0.0, 3.0)];
        let cell = tyndall::Cell { origin: DVec3::ONE, vectors, periodic: [true; 3] };
        for round in 0..200 {
            let headings: Vec<Heading> = (0..random(4))
                .map(|place| {
                    let components = 1 + random(3);
                    Heading { components, ..Heading::scalar(format!("a{place}"), kinds[random(4)]) }
                })
                .collect();
            let mut roles: Vec<Role> = (0..3).map(Role::Axis).collect();
            for (place, heading) in headings.iter().enumerate() {
                let at = random(roles.len() + 1);
                roles.splice(at..at, vec![Role::Attribute(place); heading.components]);
            }
            roles.insert(random(roles.len() + 1), Role::Skipped);
            let scaled = (round % 3 == 0).then_some(Scaled::Fractions(cell));
            let byte = [None, Some(b','), Some(b'\t'), Some(b';')][round % 4];
            let separator = Separator { byte, decimal_comma: byte == Some(b';') };
            let layout = Layout { separator, roles, headings, scaled, gaps: true, origin: None };
            let between: &[&str] = match byte {
                None => &[" ", "  ", "\t"],
                Some(b',') => &[",", ",", " ,", ", "],
                Some(b';') => &[";"],
                _ => &["\t"],
            };
            let mut text = String::new();
            for _ in 0..random(3000) {
                for (field, role) in layout.roles.iter().enumerate() {
                    if field > 0 {
                        text += between[random(between.len())];
                    }
                    let kind = match *role {
                        Role::Attribute(it) => layout.headings[it].kind,
                        _ => Kind::Float,
                    };
                    text += match (kind, random(500)) {
                        (Kind::Truth, other) => ["T", "0", "false"][other % 3],
                        (Kind::Float, 0) if byte.is_some() => "",
                        (Kind::Text, 0) if byte.is_some() => "\"1 2\"",
                        (_, 0) => unusual[random(unusual.len())],
                        (Kind::Float, 1) if separator.decimal_comma => "1,5",
                        _ => usual[random(usual.len())],
                    };
                }
                let remark = if byte.is_none() { " # a remark\n" } else { "\n" };
                text += ["\n", " \n", "\r\n", "\n\n", remark, "\n# 1 2 3 4 5 6 7\n"][random(6)];
            }
            let (mut together, mut single) = (Part::new(&layout), Part::new(&layout));
            if let Err(Stop::Fault { line, what }) = together.read(text.as_bytes(), &layout) {
                panic!("line {line}: {what}");
            }
            let filled = dispatch!(Level::new(), simd => {
                single.rows_between(simd, text.as_bytes(), &layout, separator, None)
            });
            assert_eq!((filled, together.lines), (Ok(()), single.lines), "round {round}");
            // What is no number equals nothing: the text of all tells of it.
            let told = |part: Part| {
                let values: Vec<_> = part.columns.into_iter().map(Column::into_values).collect();
                format!("{:?} {values:?}", part.axes)
            };
            assert!(told(together) == told(single), "round {round}");
        }
    }
}
