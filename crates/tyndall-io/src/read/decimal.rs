//! Decimal numbers at the front of text, fast: sixteen bytes at once, without a step for each digit.
//!
//! Takes text that may go on behind the number, gives the number and how many bytes it takes. What is not an everyday number (more
//! than fifteen bytes behind the sign, exponents beyond 22, words, the last bytes of the text) is left to slower
//! readers: `None` says nothing about the text. Invariant: what is given is correctly rounded. Sources: W. D. Clinger, "How to read
//! floating point numbers accurately", 1990 (small numbers times exact powers of ten); W. Muła, "SIMD-ized conversion of decimal
//! numbers", 2018 (digits to the right end of a vector by a table, then sums of neighbors).

pub(super) mod group;

use fearless_simd::{i16x8, i32x4, prelude::*, u8x16, u16x8, u64x2};

/// So many bytes must follow for a number to be read here: a sign, what is looked at, and as much as an exponent may have.
pub(super) const WINDOW: usize = 32;
/// How many bytes are looked at together.
const WIDTH: usize = 16;

/// Powers of ten that are exact, and the same below zero; behind them no numbers.
static POWERS: [[f64; 32]; 2] = {
    let exact = [
        1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17,
        1e18, 1e19, 1e20, 1e21, 1e22,
    ];
    let mut powers = [[f64::NAN; 32]; 2];
    let mut place = 0;
    while place < exact.len() {
        powers[0][place] = exact[place];
        powers[1][place] = -exact[place];
        place += 1;
    }
    powers
};

/// From where the bytes of a vector come so that the digits up to `end`, but not the point at `point`, stand at its right end behind
/// zeros, as `ALIGNED[point][end]`. Without a point both are the same.
static ALIGNED: [[[u8; WIDTH]; WIDTH]; WIDTH] = {
    let mut table = [[[u8::MAX; WIDTH]; WIDTH]; WIDTH];
    let mut point = 0;
    while point < WIDTH {
        let mut end = point;
        while end < WIDTH {
            let (mut from, mut to) = (end, WIDTH);
            while from > 0 {
                from -= 1;
                if from != point {
                    to -= 1;
                    table[point][end][to] = from as u8;
                }
            }
            end += 1;
        }
        point += 1;
    }
    table
};

/// A number that was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Found<T> {
    pub(super) value: T,
    /// How many bytes it takes.
    pub(super) taken: usize,
    /// The byte behind it: whether a number may end there is not looked at.
    pub(super) next: u8,
}

/// An integer of at most fifteen digits.
#[inline(always)]
pub(super) fn integer<S: Simd>(simd: S, text: &[u8]) -> Option<Found<i64>> {
    let (is_negative, window) = unsigned(text)?;
    let digits = Digits::of(simd, window);
    let end = digits.others.trailing_zeros() as usize;
    if end == 0 || end >= WIDTH {
        return None;
    }
    let value = digits.value(simd, end, end) as i64;
    let value = if is_negative { -value } else { value };
    Some(Found { value, taken: usize::from(is_negative) + end, next: window[end] })
}

/// A number.
#[inline(always)]
pub(super) fn double<S: Simd>(simd: S, text: &[u8]) -> Option<Found<f64>> {
    let (is_negative, window) = unsigned(text)?;
    let digits = Digits::of(simd, window);
    let point = digits.others.trailing_zeros() as usize;
    let point_bit = digits.others & digits.others.wrapping_neg() & digits.points;
    let end = (digits.others ^ point_bit).trailing_zeros() as usize;
    if end >= WIDTH || end == usize::from(point_bit != 0) {
        return None;
    }
    // The number is `size` over ten to the power of `decimals`. The size is taken as signed: that is one instruction, and fifteen digits
    // fit.
    let size = digits.value(simd, point, end) as i64 as f64;
    let decimals = (end - point).saturating_sub(1);
    let (taken, next) = (usize::from(is_negative) + end, window[end]);
    if next | 0x20 == b'e' {
        return with_exponent(text, is_negative, size, decimals, taken);
    }
    // The sign without a branch: signs follow no rule.
    Some(Found { value: size / POWERS[usize::from(is_negative)][decimals], taken, next })
}

/// The number whose exponent begins at byte `place`.
#[inline(never)]
fn with_exponent(
    text: &[u8],
    is_negative: bool,
    size: f64,
    decimals: usize,
    place: usize,
) -> Option<Found<f64>> {
    let (exponent, taken) = exponent(text.get(place..)?)?;
    let powers = POWERS[usize::from(is_negative)];
    let value = match exponent - decimals as i32 {
        power @ -22..0 => size / powers[-power as usize],
        power @ 0..=22 => size * powers[power as usize],
        _ => return None,
    };
    Some(Found { value, taken: place + taken, next: *text.get(place + taken)? })
}

/// The exponent at the front of `text`, with its letter, and how many bytes it takes.
#[inline(always)]
fn exponent(text: &[u8]) -> Option<(i32, usize)> {
    let (b'e' | b'E', sign) = (*text.first()?, *text.get(1)?) else { return None };
    let first = 1 + usize::from(matches!(sign, b'-' | b'+'));
    let (mut exponent, mut taken) = (0, first);
    while let Some(digit @ b'0'..=b'9') = text.get(taken) {
        if taken == first + 3 {
            return None;
        }
        exponent = 10 * exponent + i32::from(digit - b'0');
        taken += 1;
    }
    (taken > first).then_some((if sign == b'-' { -exponent } else { exponent }, taken))
}

/// A number in single precision, rounded once.
#[inline(always)]
pub(super) fn single<S: Simd>(simd: S, text: &[u8]) -> Option<Found<f32>> {
    let Found { value, taken, next } = double(simd, text)?;
    if is_halfway(value) { None } else { Some(Found { value: value as f32, taken, next }) }
}

/// Whether a number lies halfway between two in single precision: there rounding twice may err. It errs nowhere else, as none is as
/// small as those with fewer digits.
#[inline(always)]
pub(super) fn is_halfway(value: f64) -> bool {
    value.to_bits() & 0x1fff_ffff == 0x1000_0000
}

/// Whether a minus stands in front, and what follows it.
#[inline(always)]
fn unsigned(text: &[u8]) -> Option<(bool, &[u8; WIDTH])> {
    let window = text.first_chunk::<WINDOW>()?;
    let is_negative = window[0] == b'-';
    Some((is_negative, window[usize::from(is_negative)..].first_chunk()?))
}

/// Bytes of text as digits.
#[derive(Clone, Copy)]
struct Digits<S: Simd> {
    /// Their values, where they are digits.
    values: u8x16<S>,
    /// A bit for each byte that is no digit, the first one lowest.
    others: u32,
    /// The same for each point.
    points: u32,
}

impl<S: Simd> Digits<S> {
    #[inline(always)]
    fn of(simd: S, text: &[u8; WIDTH]) -> Self {
        let text = u8x16::simd_from(simd, *text);
        let values = text - b'0';
        let others = values.simd_gt(9).to_bitmask() as u32;
        let points = text.simd_eq(b'.').to_bitmask() as u32;
        Self { values, others, points }
    }

    /// The number that the digits up to `end` are, but for the point at `point`.
    #[inline(always)]
    fn value(self, simd: S, point: usize, end: usize) -> u64 {
        let fours = fours(simd, self.values, &ALIGNED[point % WIDTH][end]);
        let [high, low]: [u64; 2] = fours.bitcast::<u64x2<S>>().into();
        eight(high) * 100_000_000 + eight(low)
    }
}

/// Four numbers of four digits each, from the digits that come from the places `aligned`.
#[inline(always)]
fn fours<S: Simd>(simd: S, values: u8x16<S>, aligned: &[u8; WIDTH]) -> i32x4<S> {
    let digits = values.swizzle_dyn_precise(u8x16::simd_from(simd, *aligned));
    // Ten times one and its neighbor, in the upper byte of a product.
    let twos: u16x8<S> = (digits.bitcast::<u16x8<S>>() * (10 << 8 | 1)) >> 8;
    let weights = i16x8::simd_from(simd, [100, 1, 100, 1, 100, 1, 100, 1]);
    twos.bitcast::<i16x8<S>>().pairwise_dot_product(weights)
}

/// The number of eight digits that two of four are, the first one in the lower half.
#[inline(always)]
fn eight(fours: u64) -> u64 {
    fours.wrapping_mul(10_000 << 32 | 1) >> 32
}

#[cfg(test)]
mod tests {
    use fearless_simd::{Level, dispatch};

    use super::*;

    fn double(text: &[u8]) -> Option<Found<f64>> {
        dispatch!(Level::new(), simd => super::double(simd, text))
    }

    fn single(text: &[u8]) -> Option<Found<f32>> {
        dispatch!(Level::new(), simd => super::single(simd, text))
    }

    fn integer(text: &[u8]) -> Option<Found<i64>> {
        dispatch!(Level::new(), simd => super::integer(simd, text))
    }

    /// Text and what the standard library reads from it, with much behind it.
    fn check(text: &str) -> usize {
        let behind = format!("{text} 12345678901234567890123456789012");
        let mut found = 0;
        if let Some(Found { value, taken, next }) = double(behind.as_bytes()) {
            assert_eq!(next, b' ');
            assert_eq!(taken, text.len(), "{text}");
            assert_eq!(value.to_bits(), text.parse::<f64>().unwrap().to_bits(), "{text}");
            found += 1;
        }
        if let Some(Found { value, taken, .. }) = single(behind.as_bytes()) {
            assert_eq!(taken, text.len(), "{text}");
            assert_eq!(value.to_bits(), text.parse::<f32>().unwrap().to_bits(), "{text}");
            found += 1;
        }
        if let Ok(wanted) = text.parse::<i64>()
            && let Some(read) = integer(behind.as_bytes())
        {
            assert_eq!((read.value, read.taken, read.next), (wanted, text.len(), b' '), "{text}");
            found += 1;
        }
        found
    }

    #[test]
    fn random_numbers_are_those_of_the_standard_library() {
        let mut state = 1u64;
        let mut random = |below: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % below
        };
        let (mut found, mut all) = (0, 0);
        for _ in 0..200_000 {
            let mut text: String = ["", "-", "+"][random(3) as usize].to_string();
            let [whole, decimals] = [random(12), random(14)];
            (0..whole).for_each(|_| text.push((b'0' + random(10) as u8) as char));
            if random(4) > 0 {
                text.push('.');
                (0..decimals).for_each(|_| text.push((b'0' + random(10) as u8) as char));
            }
            if whole + decimals > 0 && random(4) == 0 {
                text += ["e", "E", "e-", "e+"][random(4) as usize];
                let below = [30, 400][random(2) as usize];
                text += &random(below).to_string();
            }
            // What the standard library refuses is checked below.
            if text.parse::<f64>().is_ok() {
                found += check(&text).min(1);
                all += 1;
            }
        }
        assert!(found > all / 3, "{found} of {all} were read");
    }

    #[test]
    fn everyday_numbers_are_read_here() {
        for text in
            ["0", "-0.0", "1.", ".5", "-12.345678", "1.23e-05", "4.5E+2", "1e-22", "00012", "0.000244140625"]
        {
            assert!(check(text) >= 2, "{text}");
        }
        assert_eq!(check("999999999999999"), 3);
    }

    #[test]
    fn halves_between_single_numbers_are_rounded_once() {
        // 1 + 2^-24 lies halfway between 1 and the next single number; a little more is rounded up, which a double cannot tell.
        for text in ["16777217", "16777217.0", "16777219", "33554434.0", "1.00000005960464", "8388608.5"] {
            check(text);
        }
        assert!(single(b"16777217.0 12345678901234567890123456789012").is_none());
    }

    #[test]
    fn what_is_no_everyday_number_is_left_to_others() {
        for text in [
            "",
            "-",
            "+",
            ".",
            "-.",
            "x",
            "nan",
            "inf",
            "e5",
            ".e5",
            "1e",
            "1e+",
            "1e400",
            "1234567890123456",
        ] {
            let behind = format!("{text} 12345678901234567890123456789012");
            assert_eq!(double(behind.as_bytes()), None, "{text}");
        }
        assert!(double(b"1.5").is_none() && integer(b"15").is_none(), "the last bytes of the text");
        assert_eq!(
            double(b"1.2.3 12345678901234567890123456789012").map(|it| (it.taken, it.next)),
            Some((3, b'.'))
        );
        assert!(integer(b"x 12345678901234567890123456789012").is_none());
    }
}
