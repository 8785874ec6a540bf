//! Decimal numbers at the front of text, fast: eight bytes at once, without a step for each digit.
//!
//! Takes text that may go on behind the number, gives the number and how many bytes it takes. What is not an everyday number (more
//! than seven digits before the point, fifteen in all, exponents beyond 22, words, the last bytes of the text) is left to slower
//! readers: `None` says nothing about the text. Invariant: what is given is correctly rounded. Sources: W. D. Clinger, "How to read
//! floating point numbers accurately", 1990 (small numbers times exact powers of ten); D. Lemire, "Number parsing at a gigabyte per
//! second", 2021 (eight digits by three products).

/// So many bytes must follow for a number to be read here.
const WINDOW: usize = 32;

/// Powers of ten that are exact.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18,
    1e19, 1e20, 1e21, 1e22,
];
/// The same as integers.
const SCALES: [u64; 16] = {
    let mut scales = [1; 16];
    let mut place = 1;
    while place < 16 {
        scales[place] = 10 * scales[place - 1];
        place += 1;
    }
    scales
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
pub(super) fn integer(text: &[u8]) -> Option<Found<i64>> {
    let window = text.first_chunk::<WINDOW>()?;
    let (is_negative, signed) = sign(window);
    let word = Word::at(window, signed)?;
    let digits = word.digits();
    let (mut value, mut taken) = (word.value(digits), signed + digits);
    if digits == 8 {
        let word = Word::at(window, taken)?;
        let more = word.digits();
        if more == 8 {
            return None;
        }
        value = value * SCALES[more] + word.value(more);
        taken += more;
    }
    if taken == signed {
        return None;
    }
    let value = if is_negative { -(value as i64) } else { value as i64 };
    Some(Found { value, taken, next: *window.get(taken)? })
}

/// A number.
#[inline(always)]
pub(super) fn double(text: &[u8]) -> Option<Found<f64>> {
    let window = text.first_chunk::<WINDOW>()?;
    let (is_negative, signed) = sign(window);
    let word = Word::at(window, signed)?;
    let whole = word.digits();
    if whole == 8 {
        return None;
    }
    // The number is `size` over ten to the power of `decimals`.
    let (size, decimals, taken) = if window[signed + whole] != b'.' {
        (word.value(whole), 0, signed + whole)
    } else if let Some((joined, decimals)) = word.without_point(whole) {
        (joined.value(whole + decimals), decimals, signed + whole + 1 + decimals)
    } else {
        let place = signed + whole + 1;
        let next = Word::at(window, place)?;
        let mut decimals = next.digits();
        let mut size = word.value(whole) * SCALES[decimals] + next.value(decimals);
        if decimals == 8 {
            let last = Word::at(window, place + 8)?;
            let more = last.digits();
            if whole + 8 + more > 15 {
                return None;
            }
            size = size * SCALES[more] + last.value(more);
            decimals += more;
        }
        (size, decimals, place + decimals)
    };
    if whole + decimals == 0 {
        return None;
    }
    // Signed: that is one instruction, and fifteen digits fit.
    let size = size as i64 as f64;
    let next = *window.get(taken)?;
    if next | 0x20 == b'e' {
        return with_exponent(text, is_negative, size, decimals, taken);
    }
    let value = size / POWERS[decimals];
    Some(Found { value: if is_negative { -value } else { value }, taken, next })
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
    let exponent = text.get(place + 1..)?;
    let (is_small, signed) = match exponent.first() {
        Some(b'-') => (true, 1),
        Some(b'+') => (false, 1),
        _ => (false, 0),
    };
    let digits = exponent[signed..].iter().take_while(|it| it.is_ascii_digit()).take(4).count();
    if !(1..=3).contains(&digits) {
        return None;
    }
    let digits = &exponent[signed..signed + digits];
    let taken = place + 1 + signed + digits.len();
    let exponent = digits.iter().fold(0, |value, digit| 10 * value + i32::from(digit - b'0'));
    let value = match if is_small { -exponent } else { exponent } - decimals as i32 {
        power @ -22..0 => size / POWERS[-power as usize],
        power @ 0..=22 => size * POWERS[power as usize],
        _ => return None,
    };
    Some(Found { value: if is_negative { -value } else { value }, taken, next: *text.get(taken)? })
}

/// A number in single precision, rounded once.
#[inline(always)]
pub(super) fn single(text: &[u8]) -> Option<Found<f32>> {
    let Found { value, taken, next } = double(text)?;
    // Rounding twice errs only where the first rounding ends halfway between two single numbers; none is as small as those with
    // fewer digits.
    let is_halfway = value.to_bits() & 0x1fff_ffff == 0x1000_0000;
    if is_halfway { None } else { Some(Found { value: value as f32, taken, next }) }
}

/// Whether a minus stands in front, and how many bytes it takes.
#[inline(always)]
fn sign(window: &[u8; WINDOW]) -> (bool, usize) {
    let is_negative = window[0] == b'-';
    (is_negative, usize::from(is_negative))
}

/// Eight bytes of text, the first one lowest.
#[derive(Clone, Copy)]
struct Word {
    text: u64,
    /// The highest bit of each byte that is no digit.
    others: u64,
}

impl Word {
    #[inline(always)]
    fn at(window: &[u8; WINDOW], place: usize) -> Option<Self> {
        let text = u64::from_le_bytes(*window.get(place..)?.first_chunk()?);
        let digits = text ^ each(b'0');
        let others = (((digits & each(0x7f)) + each(0x7f - 9)) | digits) & each(0x80);
        Some(Self { text, others })
    }

    /// How many digits it begins with.
    #[inline(always)]
    fn digits(self) -> usize {
        self.others.trailing_zeros() as usize / 8
    }

    /// The number that its first `digits` bytes are.
    #[inline(always)]
    fn value(self, digits: usize) -> u64 {
        // What is shifted in front counts as zeros.
        let aligned = if digits == 8 { self.text } else { self.text << 8 << (56 - 8 * digits) };
        let pairs = (aligned & each(0x0f)).wrapping_mul(2561) >> 8;
        let fours = (pairs & 0x00ff_00ff_00ff_00ff).wrapping_mul(6_553_601) >> 16;
        (fours & 0x0000_ffff_0000_ffff).wrapping_mul(42_949_672_960_001) >> 32
    }

    /// The digits around the point at byte `whole`, and how many stand behind it, if their end is in this word.
    #[inline(always)]
    fn without_point(self, whole: usize) -> Option<(Self, usize)> {
        let others = self.others & (self.others - 1);
        let before = (1 << (8 * whole)) - 1;
        let text = (self.text & before) | ((self.text >> 8) & !before);
        (others != 0).then(|| (Self { text, others }, others.trailing_zeros() as usize / 8 - whole - 1))
    }
}

/// The byte `value` eight times.
const fn each(value: u8) -> u64 {
    u64::from_ne_bytes([value; 8])
}

#[cfg(test)]
mod tests {
    use super::*;

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
        assert_eq!(check("999999999999999"), 1);
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
