//! Where the fields of whole rows begin: found for many bytes at once, before any field is read.
//!
//! Where a row is read field by field, each is looked for where the one before it ended, and a processor mostly waits. Here blanks and
//! line ends become bits of words, and the fields of some rows are then read column by column. Invariant: a row is given only if it has as
//! many fields as all should have, and nothing but blanks between them; what is unusual ends the rows, and is left to readers of one
//! row. Source: G. Langdale, D. Lemire, "Parsing gigabytes of JSON per second", 2019, section 3.1.

use fearless_simd::{prelude::*, u8x64};

use crate::read::column::Separator;
use crate::read::column::batch::Batch;
use crate::read::decimal::WINDOW;

/// Text that is looked at together: it stays in the nearest cache until all columns were read.
const MOST: usize = 16 << 10;
/// Bytes of a word of bits.
const WIDTH: usize = 64;
/// Places that are written at once: few words have more fields.
const USUAL: usize = 12;

/// The most fields that are found together: each has a byte and a blank.
const ROOM: usize = MOST / 2 + WIDTH;

/// The first bytes of fields, row by row.
pub(super) struct Fields {
    starts: Box<[u16; ROOM]>,
    /// Their places in words, and where those begin.
    places: Box<[u8; ROOM]>,
    firsts: Box<[u16; ROOM]>,
}

impl Fields {
    pub(super) fn new() -> Self {
        Self { starts: Box::new([0; ROOM]), places: Box::new([0; ROOM]), firsts: Box::new([0; ROOM]) }
    }

    /// Finds rows of `wanted` fields, which are not none, at the front of `text`, up to the first line that is no such row; and where they end.
    /// Between separators other than blanks, no field may be empty, begin behind a blank, or be quoted. With `comments` lines that begin
    /// with `#` are no rows.
    #[inline(always)]
    pub(super) fn find<'a, S: Simd>(
        &'a mut self,
        simd: S,
        text: &'a [u8],
        wanted: usize,
        separator: Separator,
        comments: bool,
    ) -> (Batch<'a>, usize) {
        // Fast readers look at bytes behind a field.
        let looked_at = &text[..text.len().saturating_sub(WINDOW).min(MOST)];
        let (mut count, mut separators, mut rows, mut end) = (0, 0, 0, 0);
        let mut before = Before::LINE;
        'words: for (first, bytes) in (0..).step_by(WIDTH).zip(looked_at.chunks(WIDTH)) {
            let mut padded = [b' '; WIDTH];
            let bytes = bytes.first_chunk().unwrap_or_else(|| {
                padded[..bytes.len()].copy_from_slice(bytes);
                &padded
            });
            let word = Word::of(u8x64::simd_from(simd, *bytes), separator, before);
            let Word { begins, mut ends, odd, .. } = word;
            before = word.last;
            let places = self.places[count..].first_chunk_mut().zip(self.firsts[count..].first_chunk_mut());
            let Some((places, firsts)) = places else { break };
            list(begins, places);
            *firsts = [first as u16; WIDTH / 2];
            if odd != 0 {
                ends &= below(odd.trailing_zeros());
            }
            while ends != 0 {
                let feed = ends.trailing_zeros();
                let fields = count + (begins & below(feed)).count_ones() as usize;
                let mut is_row = fields == wanted * (rows + 1);
                if separator.byte.is_some() {
                    let between = separators + (word.separators & below(feed)).count_ones() as usize;
                    is_row &= between == (wanted - 1) * (rows + 1);
                }
                if !is_row || (comments && text[self.start(rows * wanted)] == b'#') {
                    break 'words;
                }
                rows += 1;
                end = first + feed as usize + 1;
                ends &= ends - 1;
            }
            if odd != 0 {
                break;
            }
            count += begins.count_ones() as usize;
            separators += word.separators.count_ones() as usize;
        }
        let starts = &mut self.starts[..rows * wanted];
        for ((start, first), place) in starts.iter_mut().zip(self.firsts.iter()).zip(self.places.iter()) {
            *start = first + u16::from(*place);
        }
        (Batch { text, starts, fields: wanted, separator }, end)
    }

    /// Where a field begins.
    #[inline(always)]
    fn start(&self, field: usize) -> usize {
        usize::from(self.firsts[field]) + usize::from(self.places[field])
    }
}

/// The bits below bit `place`, which is less than 64.
#[inline(always)]
fn below(place: u32) -> u64 {
    (1 << place) - 1
}

/// Writes the numbers of the bits that are set, of which no two are neighbors; behind them stands anything.
#[inline(always)]
fn list(mut bits: u64, places: &mut [u8; WIDTH / 2]) {
    let count = bits.count_ones() as usize;
    // As many are written as there mostly are, so that no branch follows their number.
    for written in (0..WIDTH / 2).step_by(USUAL) {
        if count <= written {
            break;
        }
        for place in places.iter_mut().skip(written).take(USUAL) {
            *place = bits.trailing_zeros() as u8;
            bits &= bits.wrapping_sub(1);
        }
    }
}

/// What stands before the first byte of a word: bits that are 0 or 1.
#[derive(Clone, Copy)]
struct Before {
    /// Something that is between fields.
    between: u64,
    /// A blank that is no separator.
    blank: u64,
}

impl Before {
    /// The beginning of a line.
    const LINE: Self = Self { between: 1, blank: 0 };
}

/// What bytes are: a bit for each, the first one lowest.
struct Word {
    /// Fields begin there.
    begins: u64,
    /// Line feeds.
    ends: u64,
    /// Separators that are not just blanks.
    separators: u64,
    /// What makes a line unusual: control characters that are neither blanks nor a line's end; where blanks do not separate fields, also
    /// quotes, and fields behind blanks.
    odd: u64,
    last: Before,
}

impl Word {
    #[inline(always)]
    fn of<S: Simd>(bytes: u8x64<S>, separator: Separator, before: Before) -> Self {
        let ends = bytes.simd_eq(b'\n').to_bitmask();
        let returns = bytes.simd_eq(b'\r').to_bitmask();
        let blanks = (bytes.simd_eq(b' ') | bytes.simd_eq(b'\t')).to_bitmask();
        let controls = bytes.simd_le(b' ').to_bitmask();
        let [separators, quotes] = match separator.byte {
            Some(byte) => [byte, b'"'].map(|byte| bytes.simd_eq(byte).to_bitmask()),
            None => [0; 2],
        };
        // A carriage return is part of a line's end if a line feed follows it in the same word.
        let between = blanks | separators | ends | (returns & ends >> 1);
        let begins = !(controls | separators) & (between << 1 | before.between);
        let other_blanks = if separator.byte.is_some() { blanks & !separators } else { 0 };
        let behind_blanks = begins & (other_blanks << 1 | before.blank);
        Self {
            begins,
            ends,
            separators,
            odd: controls & !between | quotes | behind_blanks,
            last: Before { between: between >> 63, blank: other_blanks >> 63 },
        }
    }
}

#[cfg(test)]
mod tests {
    use fearless_simd::{Level, dispatch};

    use super::*;

    /// The rows of `wanted` fields of a text as (line, where its fields begin), found together; what is not is passed over by lines.
    fn rows(text: &[u8], wanted: usize, separator: Separator, comments: bool) -> Vec<(usize, Vec<usize>)> {
        let (mut fields, mut found, mut at, mut line) = (Fields::new(), Vec::new(), 0, 0);
        while at < text.len() {
            let mut others = Fields::new();
            let (other, other_end) = dispatch!(Level::baseline(), simd => others.find(simd, &text[at..], wanted, separator, comments));
            let (rows, end) =
                dispatch!(Level::new(), simd => fields.find(simd, &text[at..], wanted, separator, comments));
            assert_eq!((rows.starts, end), (other.starts, other_end), "vectors of all machines");
            assert_eq!(rows.rows() == 0, end == 0);
            for row in rows.starts.chunks(wanted) {
                found.push((line, row.iter().map(|&start| at + usize::from(start)).collect()));
                line += 1;
            }
            at += end;
            if end == 0 {
                at += text[at..].iter().position(|&byte| byte == b'\n').map_or(text.len() - at, |it| it + 1);
                line += 1;
            }
        }
        found
    }

    #[test]
    fn rows_are_found_with_whatever_stands_between() {
        let mut state = 3u64;
        let mut random = |below: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize % below
        };
        for byte in [None, Some(b','), Some(b'\t')] {
            let separator = Separator { byte, decimal_comma: false };
            let (mut all, mut together) = (0, 0);
            for round in 0..300 {
                let (wanted, comments) = (1 + random(9), round % 2 == 0);
                let (mut text, mut right) = (Vec::new(), Vec::new());
                for line in 0..random(2000) {
                    let is_usual = random(40) > 0;
                    let count = if is_usual { wanted } else { random(12) };
                    let (mut starts, mut is_row) = (Vec::new(), true);
                    (0..if byte.is_none() { random(3) } else { 0 })
                        .for_each(|_| text.push(b" \t"[random(2)]));
                    for field in 0..count {
                        match byte {
                            _ if field == 0 => {}
                            None => (0..1 + random(2)).for_each(|_| text.push(b" \t"[random(2)])),
                            Some(byte) => {
                                (0..random(2)).for_each(|_| text.push(b' '));
                                text.push(byte);
                                if random(200) == 0 {
                                    text.push([byte, b' '][random(2)]);
                                    is_row = false;
                                }
                            }
                        }
                        starts.push(text.len());
                        let letters: &[u8] = if random(60) == 0 { b"#\xc3\x7f" } else { b"0123456789.-eX" };
                        (0..1 + random(8)).for_each(|_| text.push(letters[random(letters.len())]));
                        if byte.is_some() && random(300) == 0 {
                            text.push(b'"');
                            is_row = false;
                        }
                    }
                    (0..random(2)).for_each(|_| text.push(b' '));
                    if random(200) == 0 {
                        text.extend([b"\x0b\x00\r"[random(3)], b'1']);
                        is_row = false;
                    }
                    let is_comment = comments && starts.first().is_some_and(|&start| text[start] == b'#');
                    if is_row && starts.len() == wanted && !is_comment {
                        right.push((line, starts));
                    }
                    text.extend([&b"\n"[..], b"\r\n"][random(2)]);
                }
                let found = rows(&text, wanted, separator, comments);
                all += right.len();
                together += found.len();
                let right: std::collections::HashMap<_, _> = right.into_iter().collect();
                assert!(
                    found.iter().all(|(line, starts)| right.get(line) == Some(starts)),
                    "{byte:?} {round}"
                );
            }
            assert!(together > all * 9 / 10, "{together} of {all}");
        }
    }

    #[test]
    fn unusual_texts_have_no_rows() {
        let long = [vec![b'1'; 2 * MOST], b"\n2\n".to_vec()].concat();
        for text in [&b""[..], b"\n\n\n", b"1 2", b"1 2\n", &long, &[0; 100], &[b' '; 100]] {
            let padded = [text, &[b'x'; 2 * WINDOW]].concat();
            let found = rows(&padded, 2, Separator::BLANKS, false);
            assert!(found.len() <= usize::from(text == b"1 2\n"), "{found:?}");
        }
    }
}
