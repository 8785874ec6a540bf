//! Many numbers at once, in passes: step by step through one number after the other, a processor mostly waits for the step before.
//!
//! Takes where the numbers begin in a text, gives all of them, or none if one is no everyday number. Each pass does one step for all:
//! windows of bytes are gathered, become bits, the bits places of points and ends, and the digits numbers. No branch follows the text, and
//! no pass brings to addresses what the same pass has in vectors, so that work on many numbers goes on at once. Invariant: what is
//! given is correctly rounded. Sources: as of [`super`].

use fearless_simd::{i16x8, i32x4, prelude::*, u8x16, u8x64};

use super::{ALIGNED, POWERS, WIDTH, exponent, fours, unsigned};

/// So many numbers at most.
pub(crate) const GROUP: usize = 64;
/// So many windows become bits together.
const TOGETHER: usize = 64 / WIDTH;
/// What fills windows without a number.
const ZERO: [u8; WIDTH] = *b"0               ";

/// Bits of windows, eight bytes for each [`TOGETHER`] of them.
type Bits = [[u8; 8]; GROUP / TOGETHER];

/// Numbers that are read together, and what is known of each between the passes. This is memory of its own: a compiler that knew all of it
/// would carry bits from pass to pass one by one, a third of the speed away (BENCHMARKS.md).
pub(crate) struct Group {
    /// The bytes behind the sign, and 1 if that is a minus.
    windows: [[u8; WIDTH]; GROUP],
    minuses: [u16; GROUP],
    /// Whether a byte is no digit, is a point, and may end a number.
    others: Bits,
    points: Bits,
    ends: Bits,
    /// Places in [`ALIGNED`] and in [`POWERS`].
    shapes: [u8; GROUP],
    scales: [u8; GROUP],
    /// The upper and the lower eight of sixteen digits, and the power of ten by which they are to be divided.
    halves: [[i32; 2]; GROUP],
    powers: [f64; GROUP],
    /// Those by which they are to be multiplied, where there are exponents.
    factors: [f64; GROUP],
    values: [f64; GROUP],
}

impl Group {
    /// Without numbers.
    pub(crate) fn new() -> Box<Self> {
        Box::new(Self {
            windows: [ZERO; GROUP],
            minuses: [0; GROUP],
            others: Bits::default(),
            points: Bits::default(),
            ends: Bits::default(),
            shapes: [0; GROUP],
            scales: [0; GROUP],
            halves: [[0; 2]; GROUP],
            powers: [1.0; GROUP],
            factors: [1.0; GROUP],
            values: [0.0; GROUP],
        })
    }

    /// Reads the numbers that begin at `starts` of `text`, at most [`GROUP`]; zeros follow them. `None` if not all are everyday ones: of at
    /// most fifteen bytes between the sign and an exponent, which may not be large, with a blank, a control character or `separator` behind,
    /// and not among the last bytes of the text; with `integers`, without a point and an exponent.
    #[inline(always)]
    pub(crate) fn read<S: Simd>(
        &mut self,
        simd: S,
        text: &[u8],
        starts: &[u16],
        separator: u8,
        integers: bool,
    ) -> Option<&[f64; GROUP]> {
        let count = starts.len().min(GROUP);
        let known = self.windows.iter_mut().zip(&mut self.minuses);
        for ((window, minus), &start) in known.zip(starts) {
            let (is_negative, bytes) = unsigned(text.get(usize::from(start)..)?)?;
            *window = *bytes;
            *minus = u16::from(is_negative);
        }
        self.windows[count..].fill(ZERO);
        self.find_bits(simd, separator);
        self.factors = [1.0; GROUP];
        match self.find_shapes(integers) {
            Shapes::Plain => {}
            Shapes::Others if !integers => self.find_exponents(text, &starts[..count], separator)?,
            _ => return None,
        }
        for place in 0..count {
            let values = u8x16::simd_from(simd, self.windows[place]) - b'0';
            let fours = fours(simd, values, &ALIGNED.as_flattened()[usize::from(self.shapes[place])]);
            let [high, low, ..]: [i32; 4] = eights(simd, fours).into();
            self.halves[place] = [high, low];
            self.powers[place] = POWERS.as_flattened()[usize::from(self.scales[place]) % 64];
        }
        self.halves[count..].fill([0; 2]);
        let scales = self.powers.iter().zip(&self.factors);
        for ((value, halves), (power, factor)) in self.values.iter_mut().zip(&self.halves).zip(scales) {
            let [high, low] = halves.map(f64::from);
            // Products and sums below 1e15 are exact, and so is one of the last two steps, which is by 1.
            *value = (high * 1e8 + low) * factor / power;
        }
        Some(&self.values)
    }

    /// From windows to bits.
    #[inline(always)]
    fn find_bits<S: Simd>(&mut self, simd: S, separator: u8) {
        let (windows, _) = self.windows.as_flattened().as_chunks();
        for (place, window) in windows.iter().enumerate() {
            let bytes = u8x64::simd_from(simd, *window);
            self.others[place] = (bytes - b'0').simd_gt(9).to_bitmask().to_le_bytes();
            self.points[place] = bytes.simd_eq(b'.').to_bitmask().to_le_bytes();
            let ends = bytes.simd_le(b' ') | bytes.simd_eq(separator);
            self.ends[place] = ends.to_bitmask().to_le_bytes();
        }
    }

    /// From bits to places in tables. It has no branch and becomes vectors by itself.
    #[inline(always)]
    fn find_shapes(&mut self, integers: bool) -> Shapes {
        let of_window = |bits: &Bits, place: usize| {
            let bytes = bits.as_flattened();
            u16::from_le_bytes([bytes[2 * place], bytes[2 * place + 1]])
        };
        let (mut are_numbers, mut are_plain) = (true, true);
        for place in 0..GROUP {
            let others = of_window(&self.others, place);
            let point_bit = others & others.wrapping_neg() & of_window(&self.points, place);
            let rest = others ^ point_bit;
            let [point, end] = [others, rest].map(|bits| bits.trailing_zeros() as u16);
            let has_point = u16::from(point_bit != 0);
            // At least a digit, and no more than are looked at.
            are_numbers &= (rest != 0) & (end > has_point) & !(integers & (has_point == 1));
            are_plain &= rest & rest.wrapping_neg() & of_window(&self.ends, place) != 0;
            let decimals = end.wrapping_sub(point + has_point) & 15;
            self.shapes[place] = (point << 4 | end) as u8;
            self.scales[place] = (self.minuses[place] << 5 | decimals) as u8;
        }
        match (are_numbers, are_plain) {
            (true, true) => Shapes::Plain,
            (true, false) => Shapes::Others,
            _ => Shapes::None,
        }
    }

    /// Takes exponents together with decimals; `None` if something else stands behind a number.
    fn find_exponents(&mut self, text: &[u8], starts: &[u16], separator: u8) -> Option<()> {
        let ends = |byte: u8| byte <= b' ' || byte == separator;
        for (place, &start) in starts.iter().enumerate() {
            let end = usize::from(start + self.minuses[place]) + usize::from(self.shapes[place] & 15);
            if ends(text[end]) {
                continue;
            }
            let (exponent, taken) = exponent(&text[end..])?;
            if !text.get(end + taken).is_some_and(|&behind| ends(behind)) {
                return None;
            }
            let (minus, decimals) = (self.scales[place] & 32, self.scales[place] & 15);
            let power = match exponent - i32::from(decimals) {
                power @ -22..0 => -power as u8,
                power @ 0..=22 => {
                    self.factors[place] = POWERS[0][power as usize];
                    0
                }
                _ => return None,
            };
            self.scales[place] = minus | power;
        }
        Some(())
    }
}

/// What numbers look like.
enum Shapes {
    /// Everyday numbers without exponents.
    Plain,
    /// Something stands behind some of them.
    Others,
    /// Not all are numbers.
    None,
}

/// Numbers of eight digits each from those of four, in the lower half.
#[inline(always)]
fn eights<S: Simd>(simd: S, fours: i32x4<S>) -> i32x4<S> {
    let lower = u8x16::simd_from(simd, [0, 1, 4, 5, 8, 9, 12, 13, 0, 1, 4, 5, 8, 9, 12, 13]);
    let fours = fours.bitcast::<u8x16<S>>().swizzle_dyn_precise(lower).bitcast::<i16x8<S>>();
    fours.pairwise_dot_product(i16x8::simd_from(simd, [10_000, 1, 10_000, 1, 10_000, 1, 10_000, 1]))
}

#[cfg(test)]
mod tests {
    use fearless_simd::{Level, dispatch};

    use super::*;

    /// What vectors of this machine and those of every machine of its kind read alike.
    fn read(text: &str, starts: &[u16], integers: bool) -> Option<[f64; GROUP]> {
        let [found, other] = [Level::new(), Level::baseline()].map(|level| {
            let mut group = Group::new();
            dispatch!(level, simd => group.read(simd, text.as_bytes(), starts, b';', integers).copied())
        });
        assert_eq!(found.map(|it| it.map(f64::to_bits)), other.map(|it| it.map(f64::to_bits)));
        found
    }

    /// Words as a text with enough behind them, and where they begin.
    fn text(words: &[String]) -> (String, Vec<u16>) {
        let (mut text, mut starts) = (String::new(), Vec::new());
        for word in words {
            starts.push(text.len() as u16);
            text += word;
            text.push([' ', '\t', '\n', ';'][starts.len() % 4]);
        }
        (text + &" 1".repeat(16), starts)
    }

    #[test]
    fn groups_of_everyday_numbers_are_those_of_the_standard_library() {
        let mut state = 7u64;
        let mut random = |below: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % below
        };
        for round in 0..4000 {
            let integers = round % 3 == 0;
            let words: Vec<String> = (0..random(GROUP as u64 + 1))
                .map(|_| {
                    let whole = random(14) + u64::from(integers);
                    let decimals = if integers { 0 } else { random(14 - whole) + u64::from(whole == 0) };
                    let mut word = ["", "-"][random(2) as usize].to_string();
                    (0..whole).for_each(|_| word.push((b'0' + random(10) as u8) as char));
                    if decimals > 0 || (!integers && random(2) == 0) {
                        word.push('.');
                    }
                    (0..decimals).for_each(|_| word.push((b'0' + random(10) as u8) as char));
                    if !integers && round % 2 == 0 && random(3) > 0 {
                        word += ["e", "E+", "e-0"][random(3) as usize];
                        word += &random(9).to_string();
                    }
                    word
                })
                .collect();
            let (text, starts) = text(&words);
            let found = read(&text, &starts, integers).unwrap_or_else(|| panic!("{text}"));
            for (word, value) in words.iter().zip(found) {
                assert_eq!(value.to_bits(), word.parse::<f64>().unwrap().to_bits(), "{word}");
            }
            assert!(found[words.len()..].iter().all(|&it| it == 0.0));
        }
    }

    #[test]
    fn one_that_is_not_of_every_day_leaves_the_group_to_others() {
        let words = |odd: &str, place: usize| {
            let mut words = vec!["-1.5".to_string(); GROUP];
            words[place] = odd.into();
            words
        };
        for odd in [
            "1e5,",
            "1.5e-33",
            "1e",
            "1e+",
            "1e0000",
            "1.5x",
            "1234567890123456",
            "+1",
            "",
            "-",
            ".",
            "-.",
            "nan",
            "x",
            "1.2.3",
            "1,5",
            "--1",
        ] {
            for place in [0, 17, GROUP - 1] {
                let (text, starts) = text(&words(odd, place));
                assert_eq!(read(&text, &starts, false), None, "{odd} at {place}");
            }
        }
        let (text, starts) = text(&words("2.5", 0));
        assert!(read(&text, &starts, false).is_some() && read(&text, &starts, true).is_none());
        let (text, starts) = super::tests::text(&["2e3".to_string()]);
        assert!(read(&text, &starts, false).is_some() && read(&text, &starts, true).is_none());
        assert_eq!(read("1 2", &[0, 2], false), None, "the last bytes of a text");
        assert_eq!(read("1", &[2], false), None, "behind a text");
        assert_eq!(read("", &[], false), Some([0.0; GROUP]));
    }
}
