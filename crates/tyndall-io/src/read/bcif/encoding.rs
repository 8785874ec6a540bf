//! The encodings of BinaryCIF, undone from the last to the first.
//!
//! Invariant: no column becomes longer than the rows that the caller allows, whatever its run lengths say. Source: BinaryCIF
//! specification 0.3.0 (Sehnal et al., PLoS Comput. Biol. 2020).

use crate::read::message::Value;
use crate::read::numbers::{Kind, Order};
use crate::read::records::Source;

/// A column while its encodings are undone.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Column<'a> {
    Bytes(&'a [u8]),
    Integers(Vec<i32>),
    Floats(Vec<f64>),
    /// The words, and for each row which of them it has; none where that is negative.
    Words {
        words: Vec<&'a str>,
        codes: Vec<i32>,
    },
}

/// The column of a `data` or `mask` entry: its `data`, decoded. `most` is how many values it may have.
pub(super) fn decode<'a>(entry: &Value<'a>, most: usize) -> Result<Column<'a>, String> {
    let encodings = entry.get("encoding").and_then(Value::list).ok_or("there is no list of encodings")?;
    let bytes = entry.get("data").and_then(Value::bytes).ok_or("there are no bytes")?;
    undo(Column::Bytes(bytes), encodings, most)
}

fn undo<'a>(mut column: Column<'a>, encodings: &[Value<'a>], most: usize) -> Result<Column<'a>, String> {
    for encoding in encodings.iter().rev() {
        let kind = encoding.get("kind").and_then(Value::text).ok_or("an encoding has no kind")?;
        column = match (kind, column) {
            ("ByteArray", Column::Bytes(bytes)) => byte_array(bytes, encoding)?,
            ("FixedPoint", Column::Integers(values)) => {
                let factor = number(encoding, "factor")?;
                Column::Floats(values.iter().map(|&it| f64::from(it) / factor).collect())
            }
            ("IntervalQuantization", Column::Integers(values)) => {
                let [min, max] = [number(encoding, "min")?, number(encoding, "max")?];
                let steps = number(encoding, "numSteps")?;
                let step = (max - min) / (steps - 1.0);
                Column::Floats(values.iter().map(|&it| min + f64::from(it) * step).collect())
            }
            ("RunLength", Column::Integers(values)) => run_length(&values, most)?,
            ("Delta", Column::Integers(values)) => {
                let origin = number(encoding, "origin").unwrap_or(0.0) as i32;
                let sum = |last: &mut i32, it: i32| {
                    *last = last.wrapping_add(it);
                    Some(*last)
                };
                Column::Integers(values.into_iter().scan(origin, sum).collect())
            }
            ("IntegerPacking", Column::Integers(values)) => integer_packing(&values, encoding)?,
            ("StringArray", Column::Bytes(bytes)) => string_array(bytes, encoding, most)?,
            (kind, _) => {
                return Err(format!("the encoding {kind} is not known, or does not fit what it encodes"));
            }
        };
    }
    Ok(column)
}

fn number(encoding: &Value, name: &str) -> Result<f64, String> {
    encoding.get(name).and_then(Value::number).ok_or_else(|| format!("an encoding has no {name}"))
}

fn byte_array<'a>(bytes: &'a [u8], encoding: &Value) -> Result<Column<'a>, String> {
    let code = encoding.get("type").and_then(Value::count).unwrap_or(0);
    let kind = match code {
        1 => Kind::I8,
        2 => Kind::I16,
        3 => Kind::I32,
        4 => Kind::U8,
        5 => Kind::U16,
        6 => Kind::U32,
        32 => Kind::F32,
        33 => Kind::F64,
        _ => return Err(format!("an array of bytes has type {code}")),
    };
    let step = kind.size();
    let source = Source { bytes, kind, order: Order::Little, start: 0, stride: step, step };
    let numbers = (0..bytes.len() / step).map(|place| source.number(place));
    Ok(match kind {
        Kind::F32 | Kind::F64 => Column::Floats(numbers.collect()),
        // Unsigned ones of 32 bits wrap, as they do where the format comes from.
        _ => Column::Integers(numbers.map(|it| it as i64 as i32).collect()),
    })
}

/// Pairs of value and count.
fn run_length<'a>(values: &[i32], most: usize) -> Result<Column<'a>, String> {
    let mut all = Vec::new();
    for pair in values.chunks_exact(2) {
        let count = usize::try_from(pair[1]).map_err(|_| format!("a value stands {} times", pair[1]))?;
        if count > most - all.len() {
            return Err(format!("run lengths make more than {most} values"));
        }
        all.extend(std::iter::repeat_n(pair[0], count));
    }
    Ok(Column::Integers(all))
}

/// Numbers as sums of narrow ones: the largest and smallest ones go on in the next.
fn integer_packing<'a>(values: &[i32], encoding: &Value) -> Result<Column<'a>, String> {
    let size = encoding.get("byteCount").and_then(Value::count).unwrap_or(0);
    let is_unsigned = encoding.get("isUnsigned") == Some(&Value::Bool(true));
    let bits = match size {
        1 | 2 | 4 => 8 * size as u32,
        _ => return Err(format!("packed integers have {size} bytes")),
    };
    if bits == 32 {
        return Ok(Column::Integers(values.to_vec()));
    }
    let (high, low) =
        if is_unsigned { ((1 << bits) - 1, None) } else { ((1 << (bits - 1)) - 1, Some(-(1 << (bits - 1)))) };
    let (mut all, mut sum) = (Vec::new(), 0i32);
    for &value in values {
        sum = sum.wrapping_add(value);
        if value != high && Some(value) != low {
            all.push(std::mem::take(&mut sum));
        }
    }
    Ok(Column::Integers(all))
}

/// Words cut from one text, and the place of each row's.
fn string_array<'a>(bytes: &'a [u8], encoding: &Value<'a>, most: usize) -> Result<Column<'a>, String> {
    let list =
        |name: &str| encoding.get(name).and_then(Value::list).ok_or_else(|| format!("words have no {name}"));
    let text = encoding.get("stringData").and_then(Value::text).ok_or("words have no stringData")?;
    let offsets = encoding.get("offsets").and_then(Value::bytes).ok_or("words have no offsets")?;
    let integers = |column| match column {
        Column::Integers(values) => Ok(values),
        _ => Err("words have places that are no integers".to_string()),
    };
    let offsets = integers(undo(Column::Bytes(offsets), list("offsetEncoding")?, most.max(text.len()) + 1)?)?;
    let codes = integers(undo(Column::Bytes(bytes), list("dataEncoding")?, most)?)?;
    let word = |pair: &[i32]| {
        let range = usize::try_from(pair[0]).ok()?..usize::try_from(pair[1]).ok()?;
        text.get(range)
    };
    let words: Option<Vec<&str>> = offsets.windows(2).map(word).collect();
    let words = words.ok_or("words lie outside of their text")?;
    if codes.iter().any(|&it| usize::try_from(it).is_ok_and(|it| it >= words.len())) {
        return Err("a row has a word that is not there".to_string());
    }
    Ok(Column::Words { words, codes })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn encoding<'a>(kind: &'a str, entries: &[(&'a str, Value<'a>)]) -> Value<'a> {
        let kind = (Value::Text("kind"), Value::Text(kind));
        Value::Map(
            std::iter::once(kind)
                .chain(entries.iter().map(|(key, value)| (Value::Text(key), value.clone())))
                .collect(),
        )
    }

    fn integers(values: &[i32]) -> Column<'static> {
        Column::Integers(values.to_vec())
    }

    #[test]
    fn the_examples_of_the_specification_are_decoded() {
        let undo = |column, kind, entries: &[(&'static str, Value<'static>)]| {
            undo(column, &[encoding(kind, entries)], 100)
        };
        let int = Value::Integer;
        assert_eq!(
            undo(integers(&[120, 123, 12]), "FixedPoint", &[("factor", int(100))]),
            Ok(Column::Floats(vec![1.2, 1.23, 0.12]))
        );
        let quantized = [("min", int(1)), ("max", int(2)), ("numSteps", int(3))];
        assert_eq!(
            undo(integers(&[0, 0, 1, 2, 2, 1]), "IntervalQuantization", &quantized),
            Ok(Column::Floats(vec![1.0, 1.0, 1.5, 2.0, 2.0, 1.5]))
        );
        assert_eq!(undo(integers(&[1, 3, 2, 1, 3, 2]), "RunLength", &[]), Ok(integers(&[1, 1, 1, 2, 3, 3])));
        assert_eq!(
            undo(integers(&[0, 3, 2, 1]), "Delta", &[("origin", int(1000))]),
            Ok(integers(&[1000, 1003, 1005, 1006]))
        );
        let packed = [("byteCount", int(1)), ("isUnsigned", Value::Bool(false))];
        assert_eq!(
            undo(integers(&[1, 2, -3, 127, 1]), "IntegerPacking", &packed),
            Ok(integers(&[1, 2, -3, 128]))
        );
        let packed = [("byteCount", int(1)), ("isUnsigned", Value::Bool(true))];
        assert_eq!(
            undo(integers(&[1, 255, 255, 0, 255, 7]), "IntegerPacking", &packed),
            Ok(integers(&[1, 510, 262]))
        );
        let bytes = [("type", int(3))];
        assert_eq!(
            undo(Column::Bytes(&[1, 0, 0, 0, 255, 255, 255, 255]), "ByteArray", &bytes),
            Ok(integers(&[1, -1]))
        );
        let whole = |_: ()| Value::List(vec![encoding("ByteArray", &[("type", Value::Integer(4))])]);
        let words = [
            ("stringData", Value::Text("aAB")),
            ("offsets", Value::Bytes(&[0, 1, 3])),
            ("offsetEncoding", whole(())),
            ("dataEncoding", Value::List(vec![encoding("ByteArray", &[("type", Value::Integer(1))])])),
        ];
        let wanted = Column::Words { words: vec!["a", "AB"], codes: vec![0, 1, 0, -1] };
        assert_eq!(undo(Column::Bytes(&[0, 1, 0, 255]), "StringArray", &words), Ok(wanted));
        assert!(undo(Column::Bytes(&[2]), "StringArray", &words).is_err());
    }

    #[test]
    fn run_lengths_are_bounded() {
        let encodings = [encoding("RunLength", &[])];
        for pairs in [[1, i32::MAX], [1, -1], [1, 101]] {
            assert!(undo(integers(&pairs), &encodings, 100).is_err(), "{pairs:?}");
        }
    }
}
