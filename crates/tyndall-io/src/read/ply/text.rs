//! The body of a PLY file as text: one row a line.
//!
//! The lines are counted first, in parallel blocks, so that each block knows where its rows go before the blocks are parsed in
//! parallel straight into the columns. Invariant: there are as many columns' places as lines that were counted, so a header cannot
//! ask for more memory than the file has lines.

use std::ops::Range;
use std::path::Path;

use glam::DVec3;
use rayon::prelude::*;
use tyndall::particles::Columns;
use tyndall::{Error, Progress, Result};

use super::Roles;
use super::header::{Element, Shape};
use crate::read::numbers::Kind;
use crate::read::records::{Builder, ORIGIN_COUNT, Slot};

/// Bytes that one thread takes at a time.
const BLOCK_BYTES: usize = 1 << 20;

/// The text behind the header.
pub(super) struct Body<'a> {
    pub(super) path: &'a Path,
    pub(super) bytes: &'a [u8],
    /// The byte where the body begins.
    pub(super) start: usize,
    /// The byte that ends a line.
    pub(super) line_end: u8,
}

/// What is wrong at a byte.
struct Fault {
    place: usize,
    what: String,
}

/// What becomes of a property: its type, or that of its count for a list, and the slot of its value.
#[derive(Clone, Copy)]
enum Action {
    Keep(Kind, usize),
    Skip,
    SkipList,
}

impl Body<'_> {
    /// Reads the vertices, which stand behind the elements `before`.
    pub(super) fn read(
        &self,
        before: &[Element],
        element: &Element,
        roles: &Roles,
        progress: &dyn Progress,
    ) -> Result<Columns> {
        let mut start = self.start;
        for element in before.iter().filter(|it| !it.properties.is_empty()) {
            start = self.skip_lines(start, element.count);
        }
        let (blocks, rows) = self.blocks(start, element.count, progress)?;
        let count: usize = rows.iter().sum();
        let bytes = self.bytes.len() - start;
        // A value needs a digit and a blank at least: what is shorter must not ask for columns.
        let values = count.saturating_mul(element.properties.len());
        if (count as u64) < element.count || values > bytes.div_ceil(2) {
            let (promised, values) = (element.count, element.properties.len());
            let what = format!(
                "the header promises {promised} vertices of {values} values, {count} lines of {bytes} bytes are there"
            );
            return Err(Error::format(self.path, "", what, super::CUT_OFF));
        }

        let head = match blocks.first() {
            Some(block) => self.head(block.clone(), rows[0].min(ORIGIN_COUNT), element, roles)?,
            None => vec![],
        };
        let columns = roles.attributes.iter().filter_map(|&place| {
            let property = &element.properties[place];
            Some((property.name.clone(), 1, property.kind()?))
        });
        let mut builder = Builder::new(count, &head, columns);
        let actions = actions(element, |place| {
            let axis = roles.axes.iter().position(|axis| *axis == Some(place));
            axis.or_else(|| roles.attributes.iter().position(|it| *it == place).map(|slot| 3 + slot))
        });
        let jobs: Vec<_> = builder.split(&rows).into_iter().zip(blocks).zip(&rows).collect();
        let fault = jobs.into_par_iter().find_map_first(|((mut slots, block), &rows)| {
            if progress.cancelled() {
                return Some(Fault { place: block.start, what: String::new() });
            }
            let length = block.len();
            let fault = self.parse(block, rows, &actions, &mut slots).err();
            progress.advance(length as u64);
            fault
        });
        match fault {
            Some(fault) if fault.what.is_empty() => Err(Error::Interrupted),
            Some(fault) => Err(self.error(fault)),
            None => Ok(builder.into_columns()),
        }
    }

    /// Cuts the text into blocks of whole lines, and counts the lines of each, as long as rows are wanted.
    fn blocks(
        &self,
        start: usize,
        wanted: u64,
        progress: &dyn Progress,
    ) -> Result<(Vec<Range<usize>>, Vec<usize>)> {
        let mut blocks = Vec::new();
        let mut begin = start;
        while begin < self.bytes.len() && wanted > 0 {
            let end = (begin + BLOCK_BYTES).min(self.bytes.len());
            let end = end + self.line(&self.bytes[end..]);
            blocks.push(begin..end);
            begin = end;
        }
        let count = |block: &Range<usize>| {
            if progress.cancelled() { 0 } else { self.lines(block.clone()).count() }
        };
        let mut rows: Vec<usize> = blocks.par_iter().map(count).collect();
        if progress.cancelled() {
            return Err(Error::Interrupted);
        }
        let mut left = wanted;
        for rows in &mut rows {
            *rows = left.min(*rows as u64) as usize;
            left -= *rows as u64;
        }
        Ok((blocks, rows))
    }

    /// The positions of the first rows.
    fn head(
        &self,
        block: Range<usize>,
        count: usize,
        element: &Element,
        roles: &Roles,
    ) -> Result<Vec<DVec3>> {
        let mut axes = [(); 3].map(|()| vec![0.0; count]);
        let actions = actions(element, |place| roles.axes.iter().position(|axis| *axis == Some(place)));
        let mut slots: Vec<Slot> = axes.iter_mut().map(|axis| Slot::F64(axis)).collect();
        self.parse(block, count, &actions, &mut slots).map_err(|fault| self.error(fault))?;
        Ok((0..count).map(|id| DVec3::new(axes[0][id], axes[1][id], axes[2][id])).collect())
    }

    /// Parses the first `rows` rows of a block into the slots.
    fn parse(
        &self,
        block: Range<usize>,
        rows: usize,
        actions: &[Action],
        slots: &mut [Slot],
    ) -> std::result::Result<(), Fault> {
        for (row, line) in self.lines(block).take(rows).enumerate() {
            let mut words = Words { rest: line };
            for action in actions {
                let place = self.place_of(words.rest);
                let parsed = match *action {
                    Action::Keep(kind, slot) => words.value(kind, &mut slots[slot], row),
                    Action::Skip => words.next().map(|_| ()).ok_or("a value"),
                    Action::SkipList => words.skip_list(),
                };
                parsed.map_err(|wanted| Fault { place, what: self.wanted(wanted, line, place) })?;
            }
            if let Some(word) = words.next() {
                let what =
                    format!("the line has more values than the header promises, from '{}' on", quote(word));
                return Err(Fault { place: self.place_of(line), what });
            }
        }
        Ok(())
    }

    fn wanted(&self, wanted: &str, line: &[u8], place: usize) -> String {
        let line_end = self.place_of(line) + line.len();
        match (Words { rest: &self.bytes[place..line_end] }).next() {
            Some(word) => format!("{wanted} was wanted, '{}' was found", quote(word)),
            None => "the line has fewer values than the header promises".into(),
        }
    }

    /// The lines of a block that are not blank, without their ends.
    fn lines(&self, block: Range<usize>) -> impl Iterator<Item = &[u8]> {
        let mut rest = &self.bytes[block];
        std::iter::from_fn(move || {
            while !rest.is_empty() {
                let (line, behind) = rest.split_at(self.line(rest));
                rest = behind;
                if line[0] > b' ' || !line.trim_ascii().is_empty() {
                    return Some(line);
                }
            }
            None
        })
    }

    /// The length of the first line, with its end.
    fn line(&self, text: &[u8]) -> usize {
        memchr::memchr(self.line_end, text).map_or(text.len(), |end| end + 1)
    }

    /// Where the text goes on behind `count` lines.
    fn skip_lines(&self, start: usize, count: u64) -> usize {
        let mut lines = self.lines(start..self.bytes.len());
        let mut end = start;
        for _ in 0..count {
            let Some(line) = lines.next() else { return self.bytes.len() };
            end = self.place_of(line) + line.len();
        }
        end
    }

    /// The byte at which `part`, a piece of the file, begins.
    fn place_of(&self, part: &[u8]) -> usize {
        part.as_ptr().addr() - self.bytes.as_ptr().addr()
    }

    fn error(&self, fault: Fault) -> Error {
        let line = 1 + memchr::memchr_iter(self.line_end, &self.bytes[..fault.place]).count();
        Error::format(
            self.path,
            format!("line {line}"),
            fault.what,
            "correct the line or write the file again",
        )
    }
}

/// What becomes of each property, if its value goes to the slot that `slot_of` says.
fn actions(element: &Element, slot_of: impl Fn(usize) -> Option<usize>) -> Vec<Action> {
    let action = |(place, property): (usize, &super::Property)| match (property.shape, slot_of(place)) {
        (Shape::List { .. }, _) => Action::SkipList,
        (Shape::Scalar(kind), Some(slot)) => Action::Keep(kind, slot),
        (Shape::Scalar(_), None) => Action::Skip,
    };
    element.properties.iter().enumerate().map(action).collect()
}

/// The first letters of a word, to be shown.
fn quote(word: &[u8]) -> String {
    String::from_utf8_lossy(&word[..word.len().min(24)]).into_owned()
}

/// The words of a line, one after the other.
struct Words<'a> {
    rest: &'a [u8],
}

impl<'a> Words<'a> {
    fn skip_blanks(&mut self) {
        while let [first, rest @ ..] = self.rest
            && *first <= b' '
        {
            self.rest = rest;
        }
    }

    fn next(&mut self) -> Option<&'a [u8]> {
        self.skip_blanks();
        let end = self.rest.iter().position(|byte| *byte <= b' ').unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        self.rest = rest;
        (!word.is_empty()).then_some(word)
    }

    /// Reads a value into `slot[row]`; else says what was wanted.
    fn value(&mut self, kind: Kind, slot: &mut Slot, row: usize) -> std::result::Result<(), &'static str> {
        match slot {
            Slot::F32(out) => out[row] = self.float()?,
            Slot::Offset { origin, out } => out[row] = (self.number(kind)? - *origin) as f32,
            Slot::F64(out) => out[row] = self.number(kind)?,
            Slot::I32(out) => out[row] = self.integer(kind)? as i32,
            Slot::I64(out) => out[row] = self.integer(kind)?,
            Slot::U8(out) => out[row] = self.integer(kind)? as u8,
        }
        Ok(())
    }

    /// A number of the given type, as f64: what is said to be single precision is rounded to it.
    fn number(&mut self, kind: Kind) -> std::result::Result<f64, &'static str> {
        match kind {
            Kind::F64 => self.float::<f64>(),
            Kind::F32 | Kind::F16 => self.float::<f32>().map(f64::from),
            _ => self.integer(kind).map(|value| value as f64),
        }
    }

    fn float<T: fast_float2::FastFloat + From<f32>>(&mut self) -> std::result::Result<T, &'static str> {
        self.skip_blanks();
        if let Ok((value, length)) = fast_float2::parse_partial::<T, _>(self.rest)
            && self.rest.get(length).is_none_or(|byte| *byte <= b' ')
        {
            self.rest = &self.rest[length..];
            return Ok(value);
        }
        // The ways in which C libraries write what is not a number: -nan(ind), 1.#QNAN, -1.#INF.
        let word = self.next().unwrap_or_default().to_ascii_lowercase();
        let sign = if word.starts_with(b"-") { -1.0 } else { 1.0 };
        let magnitude = word.strip_prefix(b"-").unwrap_or(&word);
        if magnitude.starts_with(b"1.#inf") {
            Ok(T::from(sign * f32::INFINITY))
        } else if magnitude.starts_with(b"nan(") || magnitude.starts_with(b"1.#") {
            Ok(T::from(f32::NAN))
        } else {
            Err("a number")
        }
    }

    fn integer(&mut self, kind: Kind) -> std::result::Result<i64, &'static str> {
        const WANTED: &str = "an integer of the property's type";
        let word = self.next().ok_or(WANTED)?;
        let (negative, digits) = match word {
            [b'-', digits @ ..] => (true, digits),
            [b'+', digits @ ..] => (false, digits),
            digits => (false, digits),
        };
        let mut magnitude = 0i64;
        for digit in digits {
            let digit = digit.wrapping_sub(b'0');
            // 3.0 and 1e3 are integers too, written by programs that know only floats.
            let larger = magnitude.checked_mul(10).and_then(|it| it.checked_add(digit.into()));
            let Some(larger) = larger.filter(|_| digit < 10) else {
                let value: f64 = fast_float2::parse(word).map_err(|_| WANTED)?;
                let exact = value.fract() == 0.0 && value.abs() < 2f64.powi(53);
                return if exact { in_range(value as i64, kind).ok_or(WANTED) } else { Err(WANTED) };
            };
            magnitude = larger;
        }
        let value = if negative { -magnitude } else { magnitude };
        in_range(value, kind).filter(|_| !digits.is_empty()).ok_or(WANTED)
    }

    /// Skips a count and so many words.
    fn skip_list(&mut self) -> std::result::Result<(), &'static str> {
        const WANTED: &str = "a list's count and so many values";
        let count = self.integer(Kind::I64).map_err(|_| WANTED)?;
        for _ in 0..count {
            self.next().ok_or(WANTED)?;
        }
        Ok(())
    }
}

/// The value, if a property of this type can have it.
fn in_range(value: i64, kind: Kind) -> Option<i64> {
    let fits = match kind {
        Kind::I8 => i8::try_from(value).is_ok(),
        Kind::U8 => u8::try_from(value).is_ok(),
        Kind::I16 => i16::try_from(value).is_ok(),
        Kind::U16 => u16::try_from(value).is_ok(),
        Kind::I32 => i32::try_from(value).is_ok(),
        Kind::U32 => u32::try_from(value).is_ok(),
        Kind::U64 => value >= 0,
        Kind::I64 | Kind::F16 | Kind::F32 | Kind::F64 => true,
    };
    fits.then_some(value)
}
