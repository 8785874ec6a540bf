//! One column of a text table while it is read: it begins narrow and widens when a value needs it.
//!
//! Takes tokens, gives [`Values`]. Integers stay integers until a value is none; then they become 32-bit floats, or 64-bit
//! ones if an integer is too large for 24 bits of mantissa. Columns read in slices are joined by the same rules, so that the
//! result depends on the content alone.

pub(super) mod batch;

use std::borrow::Cow;
use std::collections::HashMap;

use fearless_simd::Simd;
use memchr::memchr;
use tyndall::Values;
use tyndall::pages::reserve;

use super::decimal::{self, Found};

/// What a column is before its first value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Integers, as long as all values are.
    Integer,
    /// Floats.
    Float,
    /// Truth values: `T`, `F`, `true`, `false`, `1`, `0`.
    Truth,
    /// Words.
    Text,
}

/// How fields are told apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Separator {
    /// The byte between fields; `None`: any run of blanks.
    pub(crate) byte: Option<u8>,
    /// Whether numbers are written `1,5`.
    pub(crate) decimal_comma: bool,
}

impl Separator {
    /// Runs of blanks and tabs.
    pub(crate) const BLANKS: Self = Self { byte: None, decimal_comma: false };

    #[inline(always)]
    fn ends(self, byte: u8) -> bool {
        byte == b' ' || byte == b'\t' || Some(byte) == self.byte
    }

    /// Whether a number ends before `byte`: so it does at a blank, and at a line's end. No byte below a blank belongs to a number.
    #[inline(always)]
    fn ends_number(self, byte: u8) -> bool {
        byte <= b' ' || Some(byte) == self.byte
    }

    /// Whether `byte` is a blank that means nothing.
    #[inline(always)]
    pub(crate) fn is_blank(self, byte: u8) -> bool {
        byte == b' ' || (byte == b'\t' && self.byte != Some(b'\t'))
    }

    /// The field at the front of `rest`, without quotes, and how many bytes it takes.
    pub(crate) fn token(self, rest: &[u8]) -> (&[u8], usize) {
        let Some(byte) = self.byte else {
            let end = rest.iter().position(|&it| self.ends(it)).unwrap_or(rest.len());
            return (&rest[..end], end);
        };
        if let Some(inside) = rest.strip_prefix(b"\"")
            && let Some(end) = closing_quote(inside)
        {
            return (inside[..end].trim_ascii(), end + 2);
        }
        let end = memchr(byte, rest).unwrap_or(rest.len());
        (rest[..end].trim_ascii_end(), end)
    }
}

/// Where the quote ends that began before `inside`; a doubled quote does not end it.
fn closing_quote(inside: &[u8]) -> Option<usize> {
    let mut at = 0;
    loop {
        at += memchr(b'"', &inside[at..])?;
        if inside.get(at + 1) != Some(&b'"') {
            return Some(at);
        }
        at += 2;
    }
}

/// What is left of a line, and the text behind it: fast readers look at many bytes at once.
#[derive(Clone, Copy)]
pub(crate) struct Rest<'a>(pub(crate) &'a [u8]);

impl<'a> Rest<'a> {
    /// What is left of the line, without its end.
    pub(crate) fn line(self) -> &'a [u8] {
        let line = &self.0[..memchr(b'\n', self.0).unwrap_or(self.0.len())];
        line.strip_suffix(b"\r").unwrap_or(line)
    }

    /// The field at the front: see [`Separator::token`].
    #[inline(always)]
    pub(crate) fn token(self, separator: Separator) -> (&'a [u8], usize) {
        // Words are short: a search for the line's end would take longer.
        let end = match self.0.first_chunk() {
            Some(front) if blank(front) < 8 => blank(front),
            _ => self.0.iter().position(|&byte| byte <= b' ').unwrap_or(self.0.len()),
        };
        match self.0.get(end) {
            Some(b' ' | b'\t' | b'\n') if separator.byte.is_none() => (&self.0[..end], end),
            _ => separator.token(self.line()),
        }
    }
}

/// The place of the first blank, or of another byte below it; 8 if there is none.
#[inline(always)]
fn blank(front: &[u8; 8]) -> usize {
    let each = |byte: u8| u64::from_ne_bytes([byte; 8]);
    let text = u64::from_le_bytes(*front);
    (text.wrapping_sub(each(b' ' + 1)) & !text & each(0x80)).trailing_zeros() as usize / 8
}

/// The number at the front of `rest` and how many bytes it takes; `None` if it is none. A missing value is NaN.
#[inline(always)]
pub(crate) fn double<S: Simd>(simd: S, rest: Rest, separator: Separator) -> Option<(f64, usize)> {
    match decimal::double(simd, rest.0) {
        Some(Found { value, taken, next }) if separator.ends_number(next) => Some((value, taken)),
        _ => number(rest.line(), separator),
    }
}

/// The same in single precision.
#[inline(always)]
fn single<S: Simd>(simd: S, rest: Rest, separator: Separator) -> Option<(f32, usize)> {
    match decimal::single(simd, rest.0) {
        Some(Found { value, taken, next }) if separator.ends_number(next) => Some((value, taken)),
        _ => long_single(rest.line(), separator),
    }
}

/// The integer at the front of `rest` and how many bytes it takes; `None` if it is none or needs more than 64 bits.
#[inline(always)]
fn integer<S: Simd>(simd: S, rest: Rest, separator: Separator) -> Option<(i64, usize)> {
    match decimal::integer(simd, rest.0) {
        Some(Found { value, taken, next }) if separator.ends_number(next) => Some((value, taken)),
        _ => long_integer(rest.line(), separator),
    }
}

/// The number at the front of a line, whatever it looks like.
#[inline(never)]
pub(crate) fn number(rest: &[u8], separator: Separator) -> Option<(f64, usize)> {
    if let Ok((value, taken)) = fast_float2::parse_partial::<f64, _>(rest)
        && rest.get(taken).is_none_or(|&byte| separator.ends(byte))
    {
        return Some((value, taken));
    }
    unusual_number(rest, separator)
}

/// The same in single precision.
#[inline(never)]
fn long_single(rest: &[u8], separator: Separator) -> Option<(f32, usize)> {
    if let Ok((value, taken)) = fast_float2::parse_partial::<f32, _>(rest)
        && rest.get(taken).is_none_or(|&byte| separator.ends(byte))
    {
        return Some((value, taken));
    }
    unusual_number(rest, separator).map(|(value, taken)| (value as f32, taken))
}

/// Numbers as Fortran, Windows and spreadsheets write them.
#[cold]
fn unusual_number(rest: &[u8], separator: Separator) -> Option<(f64, usize)> {
    let (token, taken) = separator.token(rest);
    let plain = token.strip_prefix(b"-").unwrap_or(token).to_ascii_lowercase();
    let missing: [&[u8]; 5] = [b"", b"na", b"n/a", b"null", b"none"];
    let not_a_number: [&[u8]; 4] = [b"nan(", b"1.#qnan", b"1.#ind", b"1.#snan"];
    if (missing.contains(&&plain[..]) && separator.byte.is_some())
        || not_a_number.iter().any(|it| plain.starts_with(it))
        || (!plain.is_empty() && plain.iter().all(|&it| it == b'*'))
    {
        return Some((f64::NAN, taken));
    }
    if plain.starts_with(b"1.#inf") {
        return Some((if token[0] == b'-' { f64::NEG_INFINITY } else { f64::INFINITY }, taken));
    }
    let spelled: Vec<u8> = token.iter().map(|&byte| spell(byte, separator)).collect();
    Some((fast_float2::parse(&spelled).ok()?, taken))
}

fn spell(byte: u8, separator: Separator) -> u8 {
    match byte {
        b'd' | b'D' => b'e',
        b',' if separator.decimal_comma => b'.',
        other => other,
    }
}

/// Integers with many digits, and those at the end of the text.
#[inline(never)]
fn long_integer(rest: &[u8], separator: Separator) -> Option<(i64, usize)> {
    let signed = usize::from(matches!(rest.first(), Some(b'-' | b'+')));
    let digits = rest[signed..].iter().take_while(|it| it.is_ascii_digit()).count();
    let end = signed + digits;
    if digits == 0 || rest.get(end).is_some_and(|&byte| !separator.ends(byte)) {
        return None;
    }
    if digits > 18 {
        let value = std::str::from_utf8(&rest[..end]).ok()?.parse().ok()?;
        return Some((value, end));
    }
    let value = rest[signed..end].iter().fold(0, |value: i64, digit| 10 * value + i64::from(digit - b'0'));
    Some((if rest[0] == b'-' { -value } else { value }, end))
}

/// A column that grows.
#[derive(Debug)]
pub(crate) enum Column {
    Int(Vec<i32>),
    Long(Vec<i64>),
    Float(Vec<f32>),
    Double(Vec<f64>),
    Truth(Vec<u8>),
    Text(Words),
}

impl Column {
    /// An empty column with room for `count` values.
    pub(crate) fn new(kind: Kind, count: usize) -> Self {
        match kind {
            Kind::Integer => Self::Int(Vec::with_capacity(count)),
            Kind::Float => Self::Float(Vec::with_capacity(count)),
            Kind::Truth => Self::Truth(Vec::with_capacity(count)),
            Kind::Text => Self::Text(Words { codes: Vec::with_capacity(count), ..Words::default() }),
        }
    }

    /// Makes room for `count` more values.
    pub(crate) fn reserve(&mut self, count: usize) {
        match self {
            Self::Int(column) => reserve(column, count),
            Self::Long(column) => reserve(column, count),
            Self::Float(column) => reserve(column, count),
            Self::Double(column) => reserve(column, count),
            Self::Truth(column) => reserve(column, count),
            Self::Text(words) => reserve(&mut words.codes, count),
        }
    }

    /// Appends the field at the front of `rest`; says how many bytes it takes, `None` if it does not fit the column.
    #[inline(always)]
    pub(crate) fn push<S: Simd>(&mut self, simd: S, rest: Rest, separator: Separator) -> Option<usize> {
        match self {
            Self::Float(column) => {
                let (value, taken) = single(simd, rest, separator)?;
                column.push(value);
                return Some(taken);
            }
            Self::Int(column) => {
                if let Some((value, taken)) = integer(simd, rest, separator)
                    && let Ok(value) = i32::try_from(value)
                {
                    column.push(value);
                    return Some(taken);
                }
            }
            Self::Long(column) => {
                if let Some((value, taken)) = integer(simd, rest, separator) {
                    column.push(value);
                    return Some(taken);
                }
            }
            Self::Double(column) => {
                let (value, taken) = double(simd, rest, separator)?;
                column.push(value);
                return Some(taken);
            }
            Self::Truth(column) => {
                let (token, taken) = rest.token(separator);
                column.push(truth(token)?);
                return Some(taken);
            }
            Self::Text(words) => {
                let (token, taken) = rest.token(separator);
                words.push(token);
                return Some(taken);
            }
        }
        self.widen(rest.line(), separator)
    }

    /// Makes room for the number at the front of `rest`, which is no 32-bit (or no) integer, and appends it.
    #[cold]
    fn widen(&mut self, rest: &[u8], separator: Separator) -> Option<usize> {
        let (token, token_end) = separator.token(rest);
        let other = if let Some((value, _)) = long_integer(token, separator) {
            let narrow = i32::try_from(value).map(|value| Self::Int(vec![value]));
            (narrow.unwrap_or(Self::Long(vec![value])), token_end)
        } else {
            let (value, taken) = number(rest, separator)?;
            // An integer that needs more than 64 bits is more than 32 bits can tell.
            let large = value.is_finite() && value.abs() >= i64::MAX as f64;
            (if large { Self::Double(vec![value]) } else { Self::Float(vec![value as f32]) }, taken)
        };
        self.append(&other.0);
        Some(other.1)
    }

    /// Empties the column, so that it is one of the kind `kind` before its first value; keeps its memory where that fits.
    pub(crate) fn restart(&mut self, kind: Kind) {
        match (&mut *self, kind) {
            (Self::Int(column), Kind::Integer) => column.clear(),
            (Self::Float(column), Kind::Float) => column.clear(),
            (Self::Truth(column), Kind::Truth) => column.clear(),
            (Self::Text(words), Kind::Text) if words.names.len() <= SLOTS => words.codes.clear(),
            _ => *self = Self::new(kind, 0),
        }
    }

    /// Appends a column that was read by itself.
    pub(crate) fn append(&mut self, other: &Self) {
        use Column::{Double, Float, Int, Long, Text, Truth};
        match (&mut *self, other) {
            (Int(to), Int(from)) => to.extend_from_slice(from),
            (Long(to), Long(from)) => to.extend_from_slice(from),
            (Float(to), Float(from)) => to.extend_from_slice(from),
            (Double(to), Double(from)) => to.extend_from_slice(from),
            (Truth(to), Truth(from)) => to.extend_from_slice(from),
            (Text(to), Text(from)) => to.append(from),
            (Long(to), Int(from)) => to.extend(from.iter().copied().map(i64::from)),
            (Int(to), Long(from)) => {
                let mut wide: Vec<i64> = to.iter().map(|&value| value.into()).collect();
                wide.extend(from);
                *self = Long(wide);
            }
            (_, other) => {
                let (fits, other_fits) = (self.fits_float(), other.fits_float());
                let (mut wide, more) = (self.doubles(), other.doubles());
                *self = if fits && other_fits {
                    // Both come from values of at most 32 bits: nothing is lost on the way back.
                    Float(wide.iter().chain(more.iter()).map(|&value| value as f32).collect())
                } else {
                    wide.to_mut().extend_from_slice(&more);
                    Double(wide.into_owned())
                };
            }
        }
    }

    /// Whether 32-bit floats hold all values of this column.
    fn fits_float(&self) -> bool {
        match self {
            Self::Int(column) => column.iter().all(|value| value.unsigned_abs() <= 1 << 24),
            Self::Long(column) => column.iter().all(|value| value.unsigned_abs() <= 1 << 24),
            Self::Double(_) => false,
            Self::Float(_) | Self::Truth(_) | Self::Text(_) => true,
        }
    }

    fn doubles(&self) -> Cow<'_, [f64]> {
        match self {
            Self::Int(column) => column.iter().map(|&value| value.into()).collect(),
            Self::Long(column) => column.iter().map(|&value| value as f64).collect(),
            Self::Float(column) => column.iter().map(|&value| value.into()).collect(),
            Self::Double(column) => Cow::Borrowed(column),
            Self::Truth(column) => column.iter().map(|&value| value.into()).collect(),
            Self::Text(words) => words.codes.iter().map(|&value| value.into()).collect(),
        }
    }

    /// The finished column.
    pub(crate) fn into_values(self) -> Values {
        match self {
            Self::Int(column) => Values::I32(column),
            Self::Long(column) => Values::I64(column),
            Self::Float(column) => Values::F32(column),
            Self::Double(column) => Values::F64(column),
            Self::Truth(column) => Values::U8(column),
            Self::Text(words) => Values::Text { codes: words.codes, names: words.names },
        }
    }
}

fn truth(token: &[u8]) -> Option<u8> {
    let is = |words: [&[u8]; 3]| words.iter().any(|word| token.eq_ignore_ascii_case(word));
    match token {
        _ if is([b"T", b"true", b"1"]) => Some(1),
        _ if is([b"F", b"false", b"0"]) => Some(0),
        _ => None,
    }
}

/// Words by code, in order of first appearance.
#[derive(Debug)]
pub(crate) struct Words {
    codes: Vec<u32>,
    names: Vec<String>,
    known: HashMap<Vec<u8>, u32>,
    /// Short words as numbers, and their codes, at the places of [`slot`]: looked up without a hash and, as words follow no rule,
    /// without a branch that could be guessed wrong.
    short: Box<[(u64, u32); SLOTS]>,
}

/// So many short words are looked up quickly at most. Elements and types are fewer.
const SLOTS: usize = 64;

impl Default for Words {
    fn default() -> Self {
        // No word is the largest number.
        Self {
            codes: Vec::new(),
            names: Vec::new(),
            known: HashMap::new(),
            short: Box::new([(u64::MAX, 0); SLOTS]),
        }
    }
}

/// A word of up to seven bytes, none of which is 0, as a number that no other one has: its bytes, the first one lowest.
#[inline(always)]
fn number_of_word(word: &[u8]) -> Option<u64> {
    let byte = |place: usize| u64::from(word[place]) << (8 * place);
    match word.len() {
        _ if word.contains(&0) => None,
        0 => Some(0),
        // Without a step for each byte: the first, the middle and the last one, which may be the same.
        length @ 1..4 => Some(byte(0) | byte(length / 2) | byte(length - 1)),
        length @ 4..8 => Some((0..length).map(byte).sum()),
        _ => None,
    }
}

/// Where a short word is looked up.
#[inline(always)]
fn slot(number: u64) -> usize {
    // By the golden ratio, which spreads numbers that are alike.
    (number.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 58) as usize % SLOTS
}

impl Words {
    /// How many words were appended.
    pub(crate) fn len(&self) -> usize {
        self.codes.len()
    }

    /// Appends a word.
    #[inline]
    pub(crate) fn push(&mut self, token: &[u8]) {
        match number_of_word(token) {
            Some(number) => self.push_short(number, token),
            None => {
                let code = self.code(token);
                self.codes.push(code);
            }
        }
    }

    /// Appends the word at the front of a text, up to the first blank, without a branch for its length if it is short.
    #[inline(always)]
    fn push_front(&mut self, text: &[u8]) {
        match text.first_chunk() {
            Some(front) if blank(front) < 8 => {
                let number = u64::from_le_bytes(*front) & !(u64::MAX << (8 * blank(front)));
                self.push_short(number, &text[..blank(front)]);
            }
            _ => self.push(Rest(text).token(Separator::BLANKS).0),
        }
    }

    /// Appends a word that has a number.
    #[inline(always)]
    fn push_short(&mut self, number: u64, token: &[u8]) {
        let (known, mut code) = self.short[slot(number)];
        if known != number {
            code = self.code(token);
            self.short[slot(number)] = (number, code);
        }
        self.codes.push(code);
    }

    fn code(&mut self, token: &[u8]) -> u32 {
        if let Some(&code) = self.known.get(token) {
            return code;
        }
        let code = self.names.len() as u32;
        self.names.push(String::from_utf8_lossy(token).replace("\"\"", "\""));
        self.known.insert(token.to_vec(), code);
        code
    }

    /// Appends words that were read by themselves.
    pub(crate) fn append(&mut self, other: &Self) {
        let codes: Vec<u32> = other.names.iter().map(|name| self.code(name.as_bytes())).collect();
        self.codes.extend(other.codes.iter().map(|&code| codes[code as usize]));
    }
}

#[cfg(test)]
mod tests {
    use fearless_simd::{Level, dispatch};

    use super::*;

    const COMMA: Separator = Separator { byte: Some(b','), decimal_comma: false };

    fn push(column: &mut Column, token: &[u8], separator: Separator) -> Option<usize> {
        dispatch!(Level::new(), simd => column.push(simd, Rest(token), separator))
    }

    fn read(kind: Kind, tokens: &[&str]) -> Values {
        let mut column = Column::new(kind, 0);
        for token in tokens {
            assert_eq!(push(&mut column, token.as_bytes(), COMMA), Some(token.len()), "{token}");
        }
        column.into_values()
    }

    #[test]
    fn integers_widen_only_when_a_value_needs_it() {
        assert_eq!(read(Kind::Integer, &["1", "-2", "+3"]), Values::I32(vec![1, -2, 3]));
        assert_eq!(read(Kind::Integer, &["1", "3000000000"]), Values::I64(vec![1, 3_000_000_000]));
        assert_eq!(read(Kind::Integer, &["1", "2.5"]), Values::F32(vec![1.0, 2.5]));
        assert_eq!(read(Kind::Integer, &["16777217", "2.5"]), Values::F64(vec![16_777_217.0, 2.5]));
        assert_eq!(read(Kind::Integer, &["3000000000", "2.5"]), Values::F64(vec![3e9, 2.5]));
        assert_eq!(read(Kind::Integer, &["1", "99999999999999999999"]), Values::F64(vec![1.0, 1e20]));
    }

    #[test]
    fn slices_join_as_if_read_at_once() {
        let tokens = ["1", "16777217", "3000000000", "2.5", "7"];
        let whole = read(Kind::Integer, &tokens);
        let mut joined = Column::new(Kind::Integer, 0);
        for token in tokens {
            let mut part = Column::new(Kind::Integer, 0);
            push(&mut part, token.as_bytes(), COMMA).unwrap();
            joined.append(&part);
        }
        assert_eq!(joined.into_values(), whole);
    }

    #[test]
    fn unusual_numbers_are_understood() {
        let value = |text: &str, separator| number(text.as_bytes(), separator);
        assert_eq!(value("1.5D+02 x", Separator::BLANKS), Some((150.0, 7)));
        let semicolon = Separator { byte: Some(b';'), decimal_comma: true };
        assert_eq!(value("1,25;3", semicolon), Some((1.25, 4)));
        assert_eq!(value("\"1.5\",2", COMMA), Some((1.5, 5)));
        for text in ["nan", "-nan(ind)", "NaN", "-1.#IND", "*****"] {
            assert!(value(text, Separator::BLANKS).unwrap().0.is_nan(), "{text}");
        }
        assert!(value(",2", COMMA).unwrap().0.is_nan());
        assert_eq!(value("abc", COMMA), None);
        assert_eq!(value("1.2.3", Separator::BLANKS), None);
    }

    #[test]
    fn many_and_long_words_keep_their_codes() {
        let words: Vec<String> = (0..60).map(|k| ["a".repeat(k % 20), k.to_string()].concat()).collect();
        let mut column = Column::new(Kind::Text, 0);
        for word in words.iter().chain(words.iter().rev()) {
            push(&mut column, word.as_bytes(), Separator::BLANKS).unwrap();
        }
        let codes = (0..60).chain((0..60).rev()).collect();
        assert_eq!(column.into_values(), Values::Text { codes, names: words });
    }

    #[test]
    fn words_are_told_apart_whatever_their_length() {
        let mut all: Vec<String> = ["", "\0", "a\0", "a", "aa", "aaa", "Cu", "uC"].map(String::from).into();
        all.extend((1..12).map(|length| "abcdefghijkl"[..length].to_string()));
        all.extend((1..5).map(|length| "\u{e9}".repeat(length)));
        all.sort();
        all.dedup();
        let (mut words, mut fronts) = (Words::default(), Words::default());
        for word in all.iter().chain(all.iter().rev()) {
            words.push(word.as_bytes());
            let is_front = !word.is_empty() && !word.contains('\0');
            fronts.push_front(if is_front { word } else { "x" }.as_bytes());
        }
        let count = all.len() as u32;
        assert_eq!(words.codes, (0..count).chain((0..count).rev()).collect::<Vec<_>>());
        let told = |words: &Words, place: usize| words.names[words.codes[place] as usize].clone();
        for (place, word) in
            all.iter().enumerate().filter(|(_, word)| !word.is_empty() && !word.contains('\0'))
        {
            assert_eq!(told(&fronts, place), *word);
            fronts.push_front(format!("{word} and more").as_bytes());
            assert_eq!(told(&fronts, fronts.len() - 1), *word);
        }
    }

    #[test]
    fn words_are_counted_once_across_slices() {
        let mut column = Column::new(Kind::Text, 0);
        let mut more = Column::new(Kind::Text, 0);
        for token in ["O", "H", "H"] {
            push(&mut column, token.as_bytes(), COMMA).unwrap();
        }
        for token in ["\"H\"", "C,", "O"] {
            push(&mut more, token.as_bytes(), COMMA).unwrap();
        }
        column.append(&more);
        let names = ["O", "H", "C"].map(str::to_string).to_vec();
        assert_eq!(column.into_values(), Values::Text { codes: vec![0, 1, 1, 1, 2, 0], names });
    }
}
