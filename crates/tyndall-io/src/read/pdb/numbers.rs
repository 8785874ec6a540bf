//! Numbers in columns that are too narrow for them.

use std::collections::HashMap;

use tyndall::particles::Values;

use crate::read::molecules;

/// The number in a field of four or five columns: decimal as far as it goes, then hybrid-36: letters and digits to the base 36, first
/// with capitals, then without. `None` if it is neither.
pub(super) fn hybrid36(field: &[u8]) -> Option<i64> {
    let text = std::str::from_utf8(field).ok()?;
    if let Ok(number) = text.trim().parse() {
        return Some(number);
    }
    let width = field.len() as u32;
    let first = text.chars().next().filter(char::is_ascii_alphabetic)?;
    let is_small = first.is_ascii_lowercase();
    let mixed = |letter: char| letter.is_ascii_alphabetic() && letter.is_ascii_lowercase() != is_small;
    let number = if text.contains(mixed) { None } else { i64::from_str_radix(text, 36).ok() }?;
    let capitals = 26 * 36i64.pow(width - 1);
    let before = 10i64.pow(width) + if is_small { capitals } else { 0 };
    Some(number - 10 * 36i64.pow(width - 1) + before)
}

/// Serial numbers, in the order of the file. VMD goes on after 99,999 with hexadecimal ones, the first of which is 186a0; what is no
/// number at all is counted on.
pub(super) fn serials(fields: &[[u8; 5]]) -> Values {
    let mut is_hexadecimal = false;
    let numbers: Vec<Option<i64>> = fields
        .iter()
        .map(|field| {
            let small = field.iter().any(|it| matches!(it, b'a'..=b'f'));
            is_hexadecimal |= small && field[0].is_ascii_digit();
            match std::str::from_utf8(field) {
                Ok(text) if is_hexadecimal => i64::from_str_radix(text.trim(), 16).ok(),
                _ => hybrid36(field),
            }
        })
        .collect();
    molecules::counted_on(&numbers, 99_999, 1)
}

/// Places by serial numbers as they are written; those that come twice, as in files of too many atoms, name none.
pub(super) fn places(serials: &[[u8; 5]]) -> HashMap<&[u8], Option<u32>> {
    let mut places: HashMap<&[u8], Option<u32>> = HashMap::with_capacity(serials.len());
    for (place, serial) in serials.iter().enumerate() {
        places.entry(serial.trim_ascii()).and_modify(|it| *it = None).or_insert(Some(place as u32));
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hybrid_numbers_go_on_where_decimal_ones_end() {
        // From the examples of the definition.
        let cases = [
            ("    0", 0),
            ("   -1", -1),
            ("99999", 99_999),
            ("A0000", 100_000),
            ("A0001", 100_001),
            ("A000Z", 100_035),
            ("A0010", 100_036),
            ("ZZZZZ", 43_770_015),
            ("a0000", 43_770_016),
            ("zzzzz", 87_440_031),
            ("9999", 9999),
            ("A000", 10_000),
            ("ZZZZ", 1_223_055),
            ("a000", 1_223_056),
            ("zzzz", 2_436_111),
        ];
        for (text, number) in cases {
            assert_eq!(hybrid36(text.as_bytes()), Some(number), "{text}");
        }
        for text in ["*****", "     ", "A00a0", "1A000", "A 000"] {
            assert_eq!(hybrid36(text.as_bytes()), None, "{text}");
        }
    }

    #[test]
    fn serials_may_be_hexadecimal_or_lost() {
        let values = |texts: &[&str]| {
            serials(&texts.iter().map(|it| it.as_bytes().try_into().unwrap()).collect::<Vec<[u8; 5]>>())
        };
        assert_eq!(
            values(&["99999", "186a0", "186a1", "20000", "a0000"]),
            Values::I32(vec![99_999, 100_000, 100_001, 131_072, 655_360])
        );
        assert_eq!(values(&["99999", "A0000"]), Values::I32(vec![99_999, 100_000]));
        assert_eq!(values(&["99999", "*****", "*****"]), Values::I32(vec![99_999, 100_000, 100_001]));
        assert_eq!(values(&["99999", "    0", "    1"]), Values::I32(vec![99_999, 100_000, 100_001]));
    }
}
