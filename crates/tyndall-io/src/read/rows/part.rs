//! A slice of text to columns of its own, in one pass: no line end is looked for before its row is read.
//!
//! Invariant: fast readers of numbers decide nothing about meaning, as what they leave is read by slower ones.

use fearless_simd::{Level, Simd, dispatch};
use fearless_simd_macros::simd;
use tyndall::{DVec3, Error, Positions};

use super::{Layout, Role, shortened, split};
use crate::read::column::{Column, Kind, Rest, Separator, double};

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
}

impl Part {
    /// None yet.
    pub(super) fn new(layout: &Layout) -> Self {
        let columns = layout.headings.iter().map(|it| Column::new(it.kind, 0)).collect();
        Self { axes: Default::default(), columns, lines: 0 }
    }

    /// Reads a slice in place of what was read before.
    pub(super) fn read(&mut self, slice: &[u8], layout: &Layout) -> std::result::Result<(), Stop> {
        self.lines = 0;
        self.axes.iter_mut().for_each(Vec::clear);
        for (column, heading) in self.columns.iter_mut().zip(&layout.headings) {
            column.restart(heading.kind);
        }
        let filled = dispatch!(Level::new(), simd => fill(simd, self, slice, layout));
        filled.map_err(|what| Stop::Fault { line: self.lines, what })
    }

    /// Reads the lines of `text`, in one pass.
    #[inline(always)]
    fn rows_between<S: Simd>(
        &mut self,
        simd: S,
        text: &[u8],
        layout: &Layout,
        separator: Separator,
    ) -> std::result::Result<(), String> {
        let mut at = 0;
        while at < text.len() {
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

/// Reads the lines of `text` into `part`; gives what is wrong with the one that cannot be read.
#[simd]
fn fill<S: Simd>(simd: S, part: &mut Part, text: &[u8], layout: &Layout) -> std::result::Result<(), String> {
    // Between blanks nearly all numbers stand: the loops for them are made apart.
    match layout.separator {
        Separator::BLANKS => part.rows_between(simd, text, layout, Separator::BLANKS),
        other => part.rows_between(simd, text, layout, other),
    }
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
