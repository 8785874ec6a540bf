//! Numbers and words as text.

use std::fmt::{Display, LowerExp};
use std::io::{self, Write};

use tyndall::particles::{Attribute, Positions, View};

use super::Out;

/// Writes `count` rows: `row` appends row `id` with its line feed. Coordinates are asked of the [`Coordinates`] that it gets.
pub(super) fn rows<'a>(
    out: &mut dyn Out,
    positions: &'a Positions,
    row: impl Fn(&mut Vec<u8>, usize, &mut Coordinates<'a>) + Sync,
) -> io::Result<()> {
    let start = || Coordinates { positions, digits: [6; 3], text: String::new() };
    super::rows::write(out, positions.len(), start, row)
}

/// Coordinates with as few decimals as say what is stored.
pub(super) struct Coordinates<'a> {
    positions: &'a Positions,
    /// Decimals that the last coordinate along each axis needed.
    digits: [usize; 3],
    text: String,
}

impl Coordinates<'_> {
    /// Appends a coordinate of particle `id`.
    pub(super) fn push(&mut self, line: &mut Vec<u8>, id: usize, axis: usize) {
        let offset = self.positions.offset(id)[axis];
        let origin = self.positions.origin()[axis];
        let exact = origin + f64::from(offset);
        let text = &mut self.text;
        let mut fits = |digits: usize| {
            use std::fmt::Write;
            text.clear();
            // Writing to a string cannot fail.
            _ = write!(text, "{exact:.digits$}");
            text.parse::<f64>().is_ok_and(|it| (it - origin) as f32 == offset)
        };
        let mut digits = self.digits[axis];
        if !(1e-5..1e15).contains(&exact.abs()) {
            number(line, self.positions.decimal(axis, offset));
            return;
        }
        if fits(digits) {
            while digits > 0 && fits(digits - 1) {
                digits -= 1;
            }
        } else {
            digits += 1;
            while digits < 17 && !fits(digits) {
                digits += 1;
            }
        }
        self.digits[axis] = digits;
        if fits(digits) {
            line.extend_from_slice(self.text.as_bytes());
        } else {
            number(line, exact);
        }
    }
}

/// Appends the coordinates and attributes of particle `id` behind what its row has already, and ends it; words go through `word`.
pub(super) fn end_row(
    line: &mut Vec<u8>,
    id: usize,
    coordinates: &mut Coordinates,
    attributes: &[&Attribute],
    separator: u8,
    word: impl Fn(&mut Vec<u8>, &str),
) {
    let separate = |line: &mut Vec<u8>| {
        if line.last().is_some_and(|&byte| byte != b'\n') {
            line.push(separator);
        }
    };
    for axis in 0..3 {
        separate(line);
        coordinates.push(line, id, axis);
    }
    for attribute in attributes {
        for component in 0..attribute.components {
            separate(line);
            value(line, attribute, id, component, &word);
        }
    }
    line.push(b'\n');
}

/// Appends a number: the shortest text that says it.
pub(super) fn number(line: &mut Vec<u8>, value: f64) {
    shortest(line, value, value.abs());
}

/// The same of a number of 32 or 64 bits whose size is `size`.
fn shortest(line: &mut Vec<u8>, value: impl Display + LowerExp, size: f64) {
    // Writing to a vector cannot fail.
    _ = match size {
        0.0 => write!(line, "0"),
        1e-5..1e16 => write!(line, "{value}"),
        _ if size.is_finite() => write!(line, "{value:e}"),
        _ => write!(line, "{value}"),
    };
}

/// Appends a component of an attribute; words go through `word`.
pub(super) fn value(
    line: &mut Vec<u8>,
    attribute: &Attribute,
    id: usize,
    component: usize,
    word: impl Fn(&mut Vec<u8>, &str),
) {
    let place = id * attribute.components + component;
    match attribute.values.view() {
        View::F32(values) => shortest(line, values[place], values[place].abs().into()),
        View::F64(values) => number(line, values[place]),
        View::I32(values) => _ = write!(line, "{}", values[place]),
        View::I64(values) => _ = write!(line, "{}", values[place]),
        View::U8(values) => _ = write!(line, "{}", values[place]),
        View::Text { codes, names } => word(line, &names[codes[place] as usize]),
    }
}

/// A word between blanks: blanks in it become underscores, and an empty one a dash.
pub(super) fn between_blanks(line: &mut Vec<u8>, word: &str) {
    if word.is_empty() {
        line.push(b'-');
    }
    line.extend(word.bytes().map(|byte| if byte.is_ascii_whitespace() { b'_' } else { byte }));
}

/// Whether a word cannot stand between blanks as it is.
pub(super) fn is_changed_between_blanks(attribute: &Attribute) -> bool {
    let View::Text { names, .. } = attribute.values.view() else { return false };
    names.iter().any(|name| name.is_empty() || name.bytes().any(|byte| byte.is_ascii_whitespace()))
}

/// A name without what separates names in a header.
pub(super) fn plain_name(name: &str, separators: &[char]) -> String {
    let name = if name.is_empty() { "value" } else { name };
    name.chars().map(|it| if it.is_whitespace() || separators.contains(&it) { '_' } else { it }).collect()
}

#[cfg(test)]
mod tests {
    use tyndall::DVec3;

    use super::*;

    #[test]
    fn coordinates_have_the_digits_of_the_file() {
        let mut positions = Positions::new();
        let numbers = [0.1, 1234.567, 0.5, -3.0, 1e-7, 2.5e20, 0.0, 99.000_001];
        positions.extend(&numbers.map(|x: f64| DVec3::new(x.min(1e6), -x.min(1e6), x)));
        let mut text = std::io::Cursor::new(Vec::new());
        rows(&mut text, &positions, |line, id, coordinates| {
            coordinates.push(line, id, 0);
            line.push(b'\n');
        })
        .unwrap();
        let text = String::from_utf8(text.into_inner()).unwrap();
        let read: Vec<f64> = text.lines().map(|line| line.parse().unwrap()).collect();
        for (id, read) in read.iter().enumerate() {
            let origin = positions.origin().x;
            assert_eq!((read - origin) as f32, positions.offset(id).x, "{text}");
        }
    }

    #[test]
    fn numbers_are_short_and_exact() {
        for value in [0.0, 1.0, -2.5, 0.1, 1e-30, 1.7e300, 123_456_789.25] {
            let mut line = Vec::new();
            number(&mut line, value);
            let text = String::from_utf8(line).unwrap();
            assert_eq!(text.parse::<f64>().unwrap(), value);
            assert!(text.len() < 14, "{text}");
        }
    }
}
