//! The arrays of a VTK file: how their bytes are come by.
//!
//! An [`Array`] knows where it stands and how it is written (text, bytes, base64, compressed in blocks); [`Array::decode`] gives its
//! bytes. What is neither compressed nor text is not copied. No memory is asked for that the file's own bytes cannot fill.
//! Source: VTK's file formats guide, and vtkXMLDataParser.cxx for the headers of encoded arrays.

use std::borrow::Cow;
use std::io::Read;
use std::path::Path;

use flate2::read::ZlibDecoder;
use lzma_rust2::XzReader;
use rayon::prelude::*;
use tyndall::{Error, Result};

use crate::read::column::{self, Separator};
use crate::read::numbers::{Kind, Order};

/// Text that one thread parses at a time.
const SLICE: usize = 512 << 10;

const CUT_OFF: &str = "the file is cut off or damaged: copy it again or write it again";

/// A named array of a data set, not decoded yet.
#[derive(Clone, Debug)]
pub(super) struct Array<'a> {
    pub(super) name: String,
    pub(super) components: usize,
    pub(super) kind: Kind,
    pub(super) content: Content<'a>,
}

/// How an array is written.
#[derive(Clone, Debug)]
pub(super) enum Content<'a> {
    /// Numbers between blanks.
    Text(&'a [u8]),
    /// Numbers from 0 to 1 between blanks that stand for bytes from 0 to 255.
    Shares(&'a [u8]),
    /// The bytes of the numbers and nothing else.
    Plain(&'a [u8], Order),
    /// Bytes behind a header that says how many there are.
    Encoded(Encoded<'a>),
}

/// Bytes behind a header, as XML files have them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Encoded<'a> {
    /// What begins with the header and is at least as long as the array.
    pub(super) bytes: &'a [u8],
    /// Whether all this is written in base64.
    pub(super) base64: bool,
    /// How numbers and the header are written.
    pub(super) style: Style,
}

/// What an XML file says of all its arrays.
#[derive(Clone, Copy, Debug)]
pub(super) struct Style {
    pub(super) order: Order,
    /// Whether numbers in headers have 64 bits; else 32.
    pub(super) wide: bool,
    pub(super) compressor: Option<Compressor>,
}

/// What a block of LZMA may ask for to be unpacked, in KiB: its highest preset needs 65 MiB.
const MOST_LZMA_KIB: u32 = 128 << 10;

/// How the blocks of an array are compressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Compressor {
    Zlib,
    Lz4,
    /// Each block is a file of the program xz.
    Lzma,
}

impl Compressor {
    /// How much a byte can become at most: by this a header that promises too much is found out.
    fn most(self) -> usize {
        match self {
            Self::Zlib => 1032,
            Self::Lz4 => 255,
            Self::Lzma => 1 << 14,
        }
    }

    /// Fills `out` with the block.
    fn unpack(self, block: &[u8], out: &mut [u8]) -> std::result::Result<(), String> {
        match self {
            Self::Zlib => ZlibDecoder::new(block).read_exact(out).map_err(|error| error.to_string()),
            Self::Lzma => XzReader::new_mem_limit(block, false, MOST_LZMA_KIB)
                .read_exact(out)
                .map_err(|error| error.to_string()),
            Self::Lz4 => {
                let count =
                    lz4_flex::block::decompress_into(block, out).map_err(|error| error.to_string())?;
                let whole = count == out.len();
                whole.then_some(()).ok_or_else(|| format!("{count} bytes instead of {}", out.len()))
            }
        }
    }
}

impl<'a> Array<'a> {
    /// The bytes of `count` tuples, and their order. Fails if the array has not exactly as many.
    pub(super) fn decode(&self, path: &Path, count: usize) -> Result<(Cow<'a, [u8]>, Order)> {
        let place = || format!("array '{}'", self.name);
        let fault = |what: String| Error::format(path, place(), what, CUT_OFF);
        let values = count.checked_mul(self.components);
        let wanted = values.and_then(|values| values.checked_mul(self.kind.size()));
        let (Some(values), Some(wanted)) = (values, wanted) else {
            return Err(fault(format!("{count} tuples of {} numbers are no size", self.components)));
        };
        match &self.content {
            Content::Text(text) => {
                Ok((Cow::Owned(parse(text, self.kind, values).map_err(fault)?), Order::Little))
            }
            Content::Shares(text) => {
                let shares = parse(text, Kind::F32, values).map_err(fault)?;
                let shares = shares.as_chunks::<4>().0.iter().map(|&it| f32::from_le_bytes(it));
                let bytes = shares.map(|it| (255.0 * it).round().clamp(0.0, 255.0) as u8).collect();
                Ok((Cow::Owned(bytes), Order::Little))
            }
            Content::Plain(bytes, order) if bytes.len() == wanted => Ok((Cow::Borrowed(bytes), *order)),
            Content::Plain(bytes, _) => Err(fault(wrong_size(wanted, bytes.len()))),
            Content::Encoded(encoded) => Ok((encoded.decode(wanted).map_err(fault)?, encoded.style.order)),
        }
    }
}

fn wrong_size(wanted: usize, found: usize) -> String {
    format!("{wanted} bytes were wanted, {found} are there")
}

impl<'a> Encoded<'a> {
    fn decode(self, wanted: usize) -> std::result::Result<Cow<'a, [u8]>, String> {
        let mut stream = Stream { rest: self.bytes, base64: self.base64, spare: Vec::new() };
        let size = if self.style.wide { 8 } else { 4 };
        let first = self.number(&mut stream, size)?;
        let Some(compressor) = self.style.compressor else {
            // A header of 32 bits counts large arrays modulo 2^32.
            let alike = first == wanted as u64 || (size == 4 && first == wanted as u64 & 0xffff_ffff);
            return match alike {
                true => stream.take(wanted),
                false => Err(wrong_size(wanted, first as usize)),
            };
        };
        let [block_size, last] = [self.number(&mut stream, size)?, self.number(&mut stream, size)?];
        let blocks = first;
        let total = match (blocks, last) {
            (0, _) => Some(0),
            (_, 0) => blocks.checked_mul(block_size),
            _ => (blocks - 1).checked_mul(block_size).and_then(|it| it.checked_add(last)),
        };
        if total != Some(wanted as u64) || (blocks > 0 && (block_size == 0 || last > block_size)) {
            return Err(format!(
                "{wanted} bytes were wanted, its header promises {blocks} blocks of {block_size}, the last of {last}"
            ));
        }
        let table = (blocks as usize).checked_mul(size).ok_or("its header promises too many blocks")?;
        let table = stream.take(table)?;
        let lengths: Vec<usize> = table.chunks_exact(size).map(|it| self.value(it) as usize).collect();
        let packed = lengths.iter().try_fold(0usize, |sum, &it| sum.checked_add(it));
        let packed = stream.take(packed.ok_or("its header promises blocks beyond all size")?)?;
        if wanted / compressor.most() > packed.len() {
            return Err(format!("{} compressed bytes cannot become {wanted}", packed.len()));
        }
        let mut bytes = vec![0; wanted];
        let mut rest = &packed[..];
        let jobs: Vec<_> = bytes
            .chunks_mut(block_size.max(1) as usize)
            .zip(lengths)
            .map(|(out, length)| {
                let (block, tail) = rest.split_at(length);
                rest = tail;
                (block, out)
            })
            .collect();
        jobs.into_par_iter()
            .try_for_each(|(block, out)| compressor.unpack(block, out))
            .map_err(|error| format!("a block cannot be unpacked: {error}"))?;
        Ok(Cow::Owned(bytes))
    }

    /// The next number of a header.
    fn number(&self, stream: &mut Stream<'a>, size: usize) -> std::result::Result<u64, String> {
        Ok(self.value(&stream.take(size)?))
    }

    fn value(&self, bytes: &[u8]) -> u64 {
        let digits = |sum: u64, &byte: &u8| sum << 8 | u64::from(byte);
        match self.style.order {
            Order::Big => bytes.iter().fold(0, digits),
            Order::Little => bytes.iter().rev().fold(0, digits),
        }
    }
}

/// Bytes that follow each other, in base64 or as they are.
struct Stream<'a> {
    rest: &'a [u8],
    base64: bool,
    /// Bytes of the last four letters that nobody took yet.
    spare: Vec<u8>,
}

impl<'a> Stream<'a> {
    /// The next `count` bytes.
    fn take(&mut self, count: usize) -> std::result::Result<Cow<'a, [u8]>, String> {
        if !self.base64 {
            let Some((taken, rest)) = self.rest.split_at_checked(count) else {
                return Err(wrong_size(count, self.rest.len()));
            };
            self.rest = rest;
            return Ok(Cow::Borrowed(taken));
        }
        if count > self.spare.len() + self.rest.len() / 4 * 3 {
            return Err(wrong_size(count, self.spare.len() + self.rest.len() / 4 * 3));
        }
        let mut bytes = Vec::with_capacity(count + 3);
        bytes.append(&mut self.spare);
        while bytes.len() < count {
            let before = bytes.len();
            self.quad(&mut bytes)?;
            if bytes.len() == before {
                return Err(wrong_size(count, before));
            }
        }
        self.spare = bytes.split_off(count);
        Ok(Cow::Owned(bytes))
    }

    /// Appends what the next four letters say: three bytes, or fewer where it is padded, which may be in the middle: the header
    /// of a compressed array is encoded by itself. Nothing at the end of the text.
    fn quad(&mut self, bytes: &mut Vec<u8>) -> std::result::Result<(), String> {
        let (mut bits, mut letters, mut padding) = (0u32, 0, 0);
        while letters + padding < 4 {
            let Some((&letter, rest)) = self.rest.split_first() else {
                return if letters == 0 { Ok(()) } else { Err("its base64 text ends early".into()) };
            };
            let value = match letter {
                b'A'..=b'Z' => letter - b'A',
                b'a'..=b'z' => letter - b'a' + 26,
                b'0'..=b'9' => letter - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                b'=' => {
                    padding += 1;
                    self.rest = rest;
                    continue;
                }
                // The end of appended data.
                b'<' => return if letters == 0 { Ok(()) } else { Err("its base64 text ends early".into()) },
                _ if letter.is_ascii_whitespace() => {
                    self.rest = rest;
                    continue;
                }
                _ => return Err(format!("'{}' is no base64", letter.escape_ascii())),
            };
            if padding > 0 {
                return Err("its base64 text is padded in the middle of a group".into());
            }
            bits = bits << 6 | u32::from(value);
            letters += 1;
            self.rest = rest;
        }
        if letters < 2 {
            return Err("its base64 text is padded too much".into());
        }
        bits <<= 6 * (4 - letters);
        bytes.extend_from_slice(&bits.to_be_bytes()[1..letters]);
        Ok(())
    }
}

/// The bytes, little-endian, of `count` numbers of a text.
pub(in crate::read) fn parse(text: &[u8], kind: Kind, count: usize) -> std::result::Result<Vec<u8>, String> {
    let mut slices = Vec::new();
    let mut rest = text;
    while rest.len() > SLICE {
        let end = rest[SLICE..].iter().position(u8::is_ascii_whitespace).map_or(rest.len(), |at| SLICE + at);
        let (slice, tail) = rest.split_at(end);
        slices.push(slice);
        rest = tail;
    }
    slices.push(rest);
    let parts = slices.into_par_iter().map(|slice| {
        let mut bytes = Vec::with_capacity(slice.len() / 2 * kind.size() / 4);
        for token in tokens(slice) {
            push(token, kind, &mut bytes)
                .ok_or_else(|| format!("a number was wanted, '{}' was found", show(token)))?;
        }
        Ok::<_, String>(bytes)
    });
    let bytes = parts.collect::<std::result::Result<Vec<_>, _>>()?.concat();
    match bytes.len() / kind.size() {
        found if found == count => Ok(bytes),
        found => Err(format!("{count} numbers were wanted, {found} are there")),
    }
}

/// What stands between blanks.
pub(super) fn tokens(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    text.split(u8::is_ascii_whitespace).filter(|it| !it.is_empty())
}

/// The start of a token, for messages.
pub(super) fn show(token: &[u8]) -> String {
    String::from_utf8_lossy(&token[..token.len().min(40)]).into_owned()
}

/// Appends a number; `None` if the token is none of its kind.
fn push(token: &[u8], kind: Kind, bytes: &mut Vec<u8>) -> Option<()> {
    let real = || {
        let (value, taken) = column::number(token, Separator::BLANKS)?;
        (taken == token.len()).then_some(value)
    };
    match kind {
        Kind::F32 => match fast_float2::parse::<f32, _>(token) {
            Ok(value) => bytes.extend(value.to_le_bytes()),
            Err(_) => bytes.extend((real()? as f32).to_le_bytes()),
        },
        Kind::F64 => bytes.extend(real()?.to_le_bytes()),
        Kind::F16 => return None,
        _ => {
            let text = std::str::from_utf8(token).ok()?;
            // What an integer cannot be is written by some as 1.0 or 1e3.
            let whole = || real().filter(|it| it.fract() == 0.0 && it.abs() < 9e18).map(|it| it as i128);
            let value = text.parse::<i128>().ok().or_else(whole)?;
            match kind {
                Kind::I8 => bytes.extend(i8::try_from(value).ok()?.to_le_bytes()),
                Kind::U8 => bytes.extend(u8::try_from(value).ok()?.to_le_bytes()),
                Kind::I16 => bytes.extend(i16::try_from(value).ok()?.to_le_bytes()),
                Kind::U16 => bytes.extend(u16::try_from(value).ok()?.to_le_bytes()),
                Kind::I32 => bytes.extend(i32::try_from(value).ok()?.to_le_bytes()),
                Kind::U32 => bytes.extend(u32::try_from(value).ok()?.to_le_bytes()),
                Kind::I64 => bytes.extend(i64::try_from(value).ok()?.to_le_bytes()),
                _ => bytes.extend(u64::try_from(value).ok()?.to_le_bytes()),
            }
        }
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn encoded(bytes: &[u8], base64: bool) -> Encoded<'_> {
        Encoded { bytes, base64, style: Style { order: Order::Little, wide: false, compressor: None } }
    }

    #[test]
    fn base64_may_be_padded_after_the_header_and_broken_into_lines() {
        // 4 bytes of length, then abcdef; encoded together, apart, and with blanks.
        for text in ["BgAAAGFiY2RlZg==", "BgAAAA==YWJjZGVm", " BgAA\nAGFi Y2RlZg==\n<"] {
            assert_eq!(&*encoded(text.as_bytes(), true).decode(6).unwrap(), b"abcdef", "{text}");
        }
        for (text, what) in [
            ("BgAAAGFiY2Rl", "6 bytes were wanted"),
            ("BgAAAA=A", "padded"),
            ("BgAAAGFiY2RlZ     ", "early"),
            ("B?AAAAAA", "'?'"),
        ] {
            let error = encoded(text.as_bytes(), true).decode(6).unwrap_err();
            assert!(error.contains(what), "{text}: {error}");
        }
    }

    #[test]
    fn headers_that_promise_too_much_ask_for_no_memory() {
        let big = encoded(&[0xff; 12], false);
        assert!(big.decode(u32::MAX as usize).unwrap_err().contains("8 are there"));
        let style = Style { order: Order::Big, wide: true, compressor: Some(Compressor::Zlib) };
        let numbers =
            |numbers: &[u64]| -> Vec<u8> { numbers.iter().flat_map(|it| it.to_be_bytes()).collect() };
        for (header, wanted) in [
            (numbers(&[1, 1 << 60, 0, 0]), 1 << 60),
            (numbers(&[1 << 60, 1, 0, 0]), 1 << 60),
            (numbers(&[2, 8, 8, u64::MAX, 8]), 16),
            (numbers(&[2, 0, 0, 8, 8]), 0),
            (numbers(&[1, 8, 9, 8]), 9),
        ] {
            let encoded = Encoded { bytes: &header, base64: false, style };
            assert!(encoded.decode(wanted).is_err(), "{header:?}");
        }
    }

    #[test]
    fn numbers_are_those_of_their_kind() {
        let bytes = |text: &str, kind| parse(text.as_bytes(), kind, 2);
        assert_eq!(bytes("1\n-2", Kind::I8).unwrap(), [1, 0xfe]);
        assert_eq!(bytes("1.0 1e3", Kind::I16).unwrap(), [1, 0, 0xe8, 3]);
        let wide = bytes("9223372036854775807 -9223372036854775808", Kind::I64).unwrap();
        assert_eq!(wide, [i64::MAX.to_le_bytes(), i64::MIN.to_le_bytes()].concat());
        assert!(bytes("1 256", Kind::U8).unwrap_err().contains("'256'"));
        assert!(bytes("1 x", Kind::F32).is_err() && bytes("1", Kind::F32).is_err());
        assert!(bytes("nan 1D2", Kind::F32).unwrap().ends_with(&100f32.to_le_bytes()));
        let long = "1.5 ".repeat(SLICE);
        let all = parse(long.as_bytes(), Kind::F32, SLICE).unwrap();
        assert!(all.chunks(4).all(|it| it == 1.5f32.to_le_bytes()));
    }
}
