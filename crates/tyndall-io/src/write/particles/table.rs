//! Tables: a header, then a row for each particle, with commas or tabs.

use std::io;

use super::snapshot::{Names, Snapshot, component_names};
use super::{Out, Place, text};

/// Writes a table with commas.
pub(super) fn write_csv(out: &mut dyn Out, snapshot: &Snapshot, place: &mut Place) -> io::Result<()> {
    write(out, snapshot, place, b',')
}

/// Writes a table with tabs.
pub(super) fn write_tsv(out: &mut dyn Out, snapshot: &Snapshot, place: &mut Place) -> io::Result<()> {
    write(out, snapshot, place, b'\t')
}

fn write(out: &mut dyn Out, snapshot: &Snapshot, place: &mut Place, separator: u8) -> io::Result<()> {
    let particles = snapshot.particles;
    if particles.cell().is_some() || particles.time().is_some() {
        place.note("a table has no place for cell and time: they are left out");
    }
    let with_unit = |name: &str, unit: Option<&str>| match unit {
        Some(unit) => format!("{name} [{unit}]"),
        None => name.to_string(),
    };
    let axes = ["x", "y", "z"].map(|axis| with_unit(axis, particles.length_unit()));
    let mut names = Names::beside(&["x", "y", "z"]);
    let mut attributes = Vec::new();
    for attribute in &snapshot.attributes {
        let own = component_names(attribute).into_iter().map(|name| names.distinct(name));
        attributes.extend(own.map(|name| with_unit(&name, attribute.unit.as_deref())));
    }
    let mut header = Vec::new();
    for (column, name) in axes.into_iter().chain(attributes).enumerate() {
        if column > 0 {
            header.push(separator);
        }
        quoted(&mut header, &name, separator);
    }
    header.push(b'\n');
    out.write_all(&header)?;
    text::rows(out, particles.positions(), |line, id, coordinates| {
        let word = |line: &mut Vec<u8>, word: &str| quoted(line, word, separator);
        text::end_row(line, id, coordinates, &snapshot.attributes, separator, word);
    })
}

/// A word as it is, or in quotes where it could be misread.
fn quoted(line: &mut Vec<u8>, word: &str, separator: u8) {
    let is_plain =
        !word.bytes().any(|byte| byte == separator || byte == b'"' || byte == b'\n' || byte == b'\r');
    match is_plain {
        true => line.extend_from_slice(word.as_bytes()),
        false => line.extend_from_slice(format!("\"{}\"", word.replace('"', "\"\"")).as_bytes()),
    }
}
