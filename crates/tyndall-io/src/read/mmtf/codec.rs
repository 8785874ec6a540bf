//! The encodings of MMTF's binary fields: a header of twelve bytes that names one, then what it makes of the values.
//!
//! Takes a field's bytes, gives the column. Invariant: no column becomes longer than the caller allows, whatever its run lengths say.
//! Source: MMTF specification 1.1, "Codecs" (Bradley et al., PLoS Comput. Biol. 2017).

use crate::read::numbers::{Kind, Order};
use crate::read::records::Source;

/// The codec, the number of values and a parameter: 32 bits each.
const HEADER: usize = 12;

/// A column as it was before it was encoded.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Column<'a> {
    Integers(Vec<i32>),
    Floats(Vec<f64>),
    /// Words of so many bytes each, filled up with zeros.
    Words(&'a [u8], usize),
    /// Letters, zero where there is none.
    Letters(Vec<i32>),
}

/// Undoes the encoding of a field that may have `most` values.
pub(super) fn decode(field: &[u8], most: usize) -> Result<Column<'_>, String> {
    let (header, bytes) = field.split_at_checked(HEADER).ok_or("it has no header of twelve bytes")?;
    let number = |place: usize| i32::from_be_bytes(std::array::from_fn(|byte| header[4 * place + byte]));
    let (codec, length, parameter) = (number(0), number(1), number(2));
    let length = usize::try_from(length).map_err(|_| format!("it claims {length} values"))?;
    if length > most {
        return Err(format!("{length} values are more than the {most} that there may be"));
    }
    let column = match codec {
        1 => Column::Floats(numbers(bytes, Kind::F32).collect()),
        2 => Column::Integers(integers(bytes, Kind::I8)),
        3 => Column::Integers(integers(bytes, Kind::I16)),
        4 => Column::Integers(integers(bytes, Kind::I32)),
        5 => {
            let size = usize::try_from(parameter).ok().filter(|&it| it > 0);
            Column::Words(bytes, size.ok_or_else(|| format!("its words have {parameter} bytes"))?)
        }
        6 => Column::Letters(runs(&integers(bytes, Kind::I32), length)?),
        7 => Column::Integers(runs(&integers(bytes, Kind::I32), length)?),
        8 => Column::Integers(sums(runs(&integers(bytes, Kind::I32), length)?)),
        9 => divided(runs(&integers(bytes, Kind::I32), length)?, parameter)?,
        10 => divided(sums(unpacked(bytes, Kind::I16)), parameter)?,
        11 => divided(integers(bytes, Kind::I16), parameter)?,
        12 => divided(unpacked(bytes, Kind::I16), parameter)?,
        13 => divided(unpacked(bytes, Kind::I8), parameter)?,
        14 => Column::Integers(unpacked(bytes, Kind::I16)),
        15 => Column::Integers(unpacked(bytes, Kind::I8)),
        16 => Column::Integers(runs(&integers(bytes, Kind::I8), length)?),
        _ => return Err(format!("it is encoded by strategy {codec}, known are 1 to 16")),
    };
    let found = match &column {
        Column::Integers(values) | Column::Letters(values) => values.len(),
        Column::Floats(values) => values.len(),
        Column::Words(bytes, size) => bytes.len() / size,
    };
    if found != length {
        return Err(format!("{found} values were found, {length} were promised"));
    }
    Ok(column)
}

fn numbers(bytes: &[u8], kind: Kind) -> impl Iterator<Item = f64> {
    let step = kind.size();
    let source = Source { bytes, kind, order: Order::Big, start: 0, stride: step, step };
    (0..bytes.len() / step).map(move |place| source.number(place))
}

fn integers(bytes: &[u8], kind: Kind) -> Vec<i32> {
    numbers(bytes, kind).map(|it| it as i32).collect()
}

/// Values that stand in pairs with how often each comes.
fn runs(pairs: &[i32], length: usize) -> Result<Vec<i32>, String> {
    let mut all = Vec::new();
    for pair in pairs.chunks_exact(2) {
        let count = usize::try_from(pair[1]).map_err(|_| format!("a value stands {} times", pair[1]))?;
        if count > length - all.len() {
            return Err(format!("run lengths make more than the {length} values that were promised"));
        }
        all.extend(std::iter::repeat_n(pair[0], count));
    }
    Ok(all)
}

/// Values of which each is told as the difference from the one before.
fn sums(differences: Vec<i32>) -> Vec<i32> {
    let sum = |last: &mut i32, it: i32| {
        *last = last.wrapping_add(it);
        Some(*last)
    };
    differences.into_iter().scan(0, sum).collect()
}

/// Values as sums of narrow ones: the largest and the smallest ones go on in the next.
fn unpacked(bytes: &[u8], kind: Kind) -> Vec<i32> {
    let (low, high) = match kind {
        Kind::I8 => (i32::from(i8::MIN), i32::from(i8::MAX)),
        _ => (i32::from(i16::MIN), i32::from(i16::MAX)),
    };
    let mut sum = 0i32;
    let value = |part: f64| {
        let part = part as i32;
        sum = sum.wrapping_add(part);
        (part != low && part != high).then(|| std::mem::take(&mut sum))
    };
    numbers(bytes, kind).filter_map(value).collect()
}

fn divided<'a>(values: Vec<i32>, divisor: i32) -> Result<Column<'a>, String> {
    if divisor == 0 {
        return Err("its values are to be divided by zero".to_string());
    }
    Ok(Column::Floats(values.iter().map(|&it| f64::from(it) / f64::from(divisor)).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field(codec: i32, length: i32, parameter: i32, bytes: &[u8]) -> Vec<u8> {
        let header = [codec, length, parameter].map(i32::to_be_bytes).concat();
        [&header[..], bytes].concat()
    }

    fn wide(values: &[i32]) -> Vec<u8> {
        values.iter().flat_map(|it| it.to_be_bytes()).collect()
    }

    fn short(values: &[i16]) -> Vec<u8> {
        values.iter().flat_map(|it| it.to_be_bytes()).collect()
    }

    #[test]
    fn all_strategies_are_undone() {
        let floats = |values: &[f64]| Column::Floats(values.to_vec());
        let integers = |values: &[i32]| Column::Integers(values.to_vec());
        let tens: Vec<i32> = [vec![1; 2], vec![2; 3]].concat();
        let cases: [(i32, i32, Vec<u8>, Column); 16] = [
            (1, 0, [1.5f32, -2.0].iter().flat_map(|it| it.to_be_bytes()).collect(), floats(&[1.5, -2.0])),
            (2, 0, vec![3, 0xff], integers(&[3, -1])),
            (3, 0, short(&[-7, 300]), integers(&[-7, 300])),
            (4, 0, wide(&[1 << 30, -1]), integers(&[1 << 30, -1])),
            (5, 4, b"B\0\0\0DAXY".to_vec(), Column::Words(b"B\0\0\0DAXY", 4)),
            (6, 0, wide(&[0, 2, 65, 1]), Column::Letters(vec![0, 0, 65])),
            (7, 0, wide(&[1, 2, 2, 3]), integers(&tens)),
            (8, 0, wide(&[1, 3, 5, 1, 1, 2]), integers(&[1, 2, 3, 8, 9, 10])),
            (9, 100, wide(&[100, 2, 50, 1]), floats(&[1.0, 1.0, 0.5])),
            (10, 1000, short(&[i16::MAX, 3, 1, -5]), floats(&[32.770, 32.771, 32.766])),
            (11, 10, short(&[25, -5]), floats(&[2.5, -0.5])),
            (12, 10, short(&[i16::MIN, 0, 4]), floats(&[-3276.8, 0.4])),
            (13, 10, vec![0x7f, 0x7f, 6, 0x80, 0], floats(&[26.0, -12.8])),
            (14, 0, short(&[i16::MAX, 0, 7]), integers(&[32767, 7])),
            (15, 0, vec![0x7f, 1, 0x80, 0xff], integers(&[128, -129])),
            (16, 0, vec![0xff, 2, 4, 1], integers(&[-1, -1, 4])),
        ];
        for (codec, parameter, bytes, wanted) in cases {
            let length = match &wanted {
                Column::Integers(values) | Column::Letters(values) => values.len(),
                Column::Floats(values) => values.len(),
                Column::Words(..) => 2,
            };
            let whole = field(codec, length as i32, parameter, &bytes);
            assert_eq!(decode(&whole, 10), Ok(wanted), "strategy {codec}");
            for cut in 0..whole.len() {
                // Half a value is no value.
                assert!(decode(&whole[..cut], 10).is_err(), "strategy {codec} cut to {cut} bytes");
            }
        }
    }

    #[test]
    fn more_than_may_be_is_refused() {
        let message = |field: &[u8]| decode(field, 10).unwrap_err();
        assert!(message(&field(7, 11, 0, &wide(&[1, 11]))).contains("more than the 10"));
        assert!(message(&field(7, 10, 0, &wide(&[1, i32::MAX]))).contains("more than the 10"));
        assert!(message(&field(7, 2, 0, &wide(&[1, -2]))).contains("stands -2 times"));
        assert!(message(&field(2, -1, 0, &[])).contains("claims -1 values"));
        assert!(message(&field(9, 1, 0, &wide(&[1, 1]))).contains("zero"));
        assert!(message(&field(5, 1, 0, b"A")).contains("0 bytes"));
        assert!(message(&field(17, 1, 0, b"A")).contains("strategy 17"));
    }
}
