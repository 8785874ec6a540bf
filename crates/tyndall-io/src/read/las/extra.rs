//! Extra bytes of points: quantities that a file adds behind those of its point format, and describes in a record of its own.
//!
//! Each has a type, a name and maybe a scale and an offset. Source: ASPRS, "LAS specification 1.4 - R15", the record "Extra Bytes".

use super::{Place, Quantity};
use crate::read::numbers::Kind;

/// Bytes of a description.
const DESCRIPTION: usize = 192;
/// Types in the order of their numbers, from 1 on.
const KINDS: [Kind; 10] = [
    Kind::U8,
    Kind::I8,
    Kind::U16,
    Kind::I16,
    Kind::U32,
    Kind::I32,
    Kind::U64,
    Kind::I64,
    Kind::F32,
    Kind::F64,
];

/// The quantities that the record `descriptions` tells of points of `record` bytes, of which the first `start` are those of the format;
/// and how many bytes it says nothing of.
pub(super) fn quantities(descriptions: &[u8], start: usize, record: usize) -> (Vec<Quantity>, usize) {
    let (mut quantities, mut at, mut unknown) = (Vec::new(), start, 0);
    for text in descriptions.chunks_exact(DESCRIPTION) {
        let (number, options) = (usize::from(text[2]), text[3]);
        let (kind, components) = match number {
            0 => (None, usize::from(options)),
            // Two and three of a type, which version 1.4 R15 discourages.
            1..=30 => (Some(KINDS[(number - 1) % 10]), (number - 1) / 10 + 1),
            _ => break,
        };
        let bytes = components * kind.map_or(1, Kind::size);
        if at + bytes > record {
            break;
        }
        let double = |at: usize| text[at..].first_chunk().map_or(0.0, |it| f64::from_le_bytes(*it));
        let three = |at: usize| [double(at), double(at + 8), double(at + 16)];
        let scales = if options & 8 == 0 { [1.0; 3] } else { three(112) };
        let offsets = if options & 16 == 0 { [0.0; 3] } else { three(136) };
        match kind {
            None => unknown += bytes,
            Some(kind) => {
                let name = text[4..36].split(|it| *it == 0).next().unwrap_or_default();
                let name = String::from_utf8_lossy(name).trim().to_string();
                let place = match options & 24 {
                    0 => Place::Number(kind, at),
                    _ => Place::Scaled { kind, at, scales, offsets },
                };
                quantities.push(Quantity { name, components, place, extra: true });
            }
        }
        at += bytes;
    }
    (quantities, unknown + record - at)
}
