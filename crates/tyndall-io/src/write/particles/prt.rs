//! Krakatoa's PRT, version 1: a header of named channels, then the particles, compressed.
//!
//! Source: Thinkbox's description of the format.

use std::io;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use tyndall::particles::{Attribute, View};

use super::snapshot::Snapshot;
use super::{Out, Place, rows};

/// Bytes of the header and of a channel's definition.
const HEADER_BYTES: u32 = 56;
const CHANNEL_BYTES: u32 = 44;
/// Letters that the name of a channel may have.
const NAME_LETTERS: usize = 31;

/// Names that Krakatoa knows for what others call otherwise.
const NAMES: [(&str, &str); 8] = [
    ("id", "ID"),
    ("velocity", "Velocity"),
    ("vel", "Velocity"),
    ("v", "Velocity"),
    ("color", "Color"),
    ("cd", "Color"),
    ("density", "Density"),
    ("normal", "Normal"),
];

/// Writes the file.
pub(super) fn write(out: &mut dyn Out, snapshot: &Snapshot, place: &mut Place) -> io::Result<()> {
    if snapshot.particles.cell().is_some() || snapshot.particles.time().is_some() {
        place.note("PRT has no place for cell and time: they are left out");
    }
    let is_single = snapshot.fits_f32();
    // Type codes: 1 and 2 are integers, 4 and 5 floats, of 32 and 64 bits, 10 bytes.
    let mut channels = vec![("Position".to_string(), if is_single { 4u32 } else { 5 }, 3)];
    let mut columns: Vec<&Attribute> = Vec::new();
    for attribute in &snapshot.attributes {
        let code = match attribute.values.view() {
            View::I32(_) => 1,
            View::I64(_) => 2,
            View::F32(_) => 4,
            View::F64(_) => 5,
            View::U8(_) => 10,
            View::Text { .. } => {
                place.note(format!("'{}': PRT has no words; numbers stand for them", attribute.name));
                7
            }
        };
        let name = channel_name(&attribute.name);
        if channels.iter().any(|(other, ..)| *other == name) {
            place.note(format!("'{}' is left out: its channel {name} is there already", attribute.name));
            continue;
        }
        channels.push((name, code, attribute.components as u32));
        columns.push(attribute);
    }

    let mut head = b"\xc0PRT\r\n\x1a\n".to_vec();
    head.extend(HEADER_BYTES.to_le_bytes());
    let mut words = b"Extensible Particle Format".to_vec();
    words.resize(32, 0);
    head.extend(words);
    head.extend(1u32.to_le_bytes());
    head.extend((snapshot.len() as i64).to_le_bytes());
    head.extend(4u32.to_le_bytes());
    head.extend((channels.len() as u32).to_le_bytes());
    head.extend(CHANNEL_BYTES.to_le_bytes());
    let mut offset = 0u32;
    for (name, code, arity) in channels {
        let mut letters = name.into_bytes();
        letters.resize(NAME_LETTERS + 1, 0);
        head.extend(letters);
        head.extend(code.to_le_bytes());
        head.extend(arity.to_le_bytes());
        head.extend(offset.to_le_bytes());
        offset += arity * [2, 4, 8, 2, 4, 8, 2, 4, 8, 1, 1][code as usize];
    }
    out.write_all(&head)?;
    let mut packed = ZlibEncoder::new(out, Compression::fast());
    rows::write_fixed(&mut packed, snapshot.len(), |bytes, id| {
        for coordinate in snapshot.position(id).to_array() {
            match is_single {
                true => bytes.extend((coordinate as f32).to_le_bytes()),
                false => bytes.extend(coordinate.to_le_bytes()),
            }
        }
        columns.iter().for_each(|attribute| rows::stored(bytes, attribute, id));
    })?;
    packed.finish()?;
    Ok(())
}

/// A name of letters, digits and underscores, by which Krakatoa finds what it knows.
fn channel_name(name: &str) -> String {
    if let Some((_, known)) = NAMES.iter().find(|(other, _)| name.eq_ignore_ascii_case(other)) {
        return known.to_string();
    }
    let letter = |it: char| if it.is_ascii_alphanumeric() { it } else { '_' };
    let name: String = name.chars().take(NAME_LETTERS).map(letter).collect();
    match name.chars().next() {
        Some(first) if !first.is_ascii_digit() => name,
        _ => format!("c{name}").chars().take(NAME_LETTERS).collect(),
    }
}
