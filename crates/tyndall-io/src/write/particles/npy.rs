//! NumPy: an array of structures (NPY), or an archive of arrays (NPZ).

use std::io::{self, Write};

use tyndall::particles::{Attribute, View};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::snapshot::{Names, Snapshot};
use super::{Out, Place, rows};

/// Writes positions and attributes as one array of structures; an array of shape (N, 3) if there are no attributes.
pub(super) fn write_array(out: &mut dyn Out, snapshot: &Snapshot, place: &mut Place) -> io::Result<()> {
    note_losses(snapshot, place);
    let is_single = snapshot.fits_f32();
    let axes = if is_single { "<f4" } else { "<f8" };
    if snapshot.attributes.is_empty() {
        out.write_all(&header(&format!("'{axes}'"), &[snapshot.len(), 3]))?;
        return positions(out, snapshot, is_single);
    }
    let mut members = format!("[('pos', '{axes}', (3,))");
    let columns: Vec<Column> = snapshot.attributes.iter().map(|it| Column::of(it)).collect();
    let mut names = Names::beside(&["pos"]);
    for column in &columns {
        let name = literal(&names.distinct(column.attribute.name.clone()));
        members += &match column.attribute.components {
            1 => format!(", ({name}, '{}')", column.kind),
            count => format!(", ({name}, '{}', ({count},))", column.kind),
        };
    }
    members += "]";
    out.write_all(&header(&members, &[snapshot.len()]))?;
    rows::write_fixed(out, snapshot.len(), |bytes, id| {
        position(bytes, snapshot, id, is_single);
        columns.iter().for_each(|it| it.push(bytes, id));
    })
}

/// Writes `pos` of shape (N, 3), and an array for each attribute.
pub(super) fn write_archive(out: &mut dyn Out, snapshot: &Snapshot, place: &mut Place) -> io::Result<()> {
    if snapshot.particles.cell().is_some() {
        place.note("NPZ has no place for the cell: it is left out");
    }
    let is_single = snapshot.fits_f32();
    let mut archive = ZipWriter::new(out);
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored).large_file(true);
    archive.start_file("pos.npy", options)?;
    archive.write_all(&header(if is_single { "'<f4'" } else { "'<f8'" }, &[snapshot.len(), 3]))?;
    positions(&mut archive, snapshot, is_single)?;
    let mut names = Names::beside(&["pos", "time"]);
    for attribute in &snapshot.attributes {
        let column = Column::of(attribute);
        let name = names.distinct(attribute.name.replace('/', "_"));
        archive.start_file(format!("{name}.npy"), options)?;
        let shape = match attribute.components {
            1 => vec![snapshot.len()],
            count => vec![snapshot.len(), count],
        };
        archive.write_all(&header(&format!("'{}'", column.kind), &shape))?;
        rows::write_fixed(&mut archive, snapshot.len(), |bytes, id| column.push(bytes, id))?;
    }
    if let Some(time) = snapshot.particles.time() {
        archive.start_file("time.npy", options)?;
        archive.write_all(&header("'<f8'", &[]))?;
        archive.write_all(&time.to_le_bytes())?;
    }
    archive.finish()?;
    Ok(())
}

fn note_losses(snapshot: &Snapshot, place: &mut Place) {
    if snapshot.particles.cell().is_some() || snapshot.particles.time().is_some() {
        place.note("an array has no place for cell and time: they are left out");
    }
}

fn positions(out: &mut (impl Write + ?Sized), snapshot: &Snapshot, is_single: bool) -> io::Result<()> {
    rows::write_fixed(out, snapshot.len(), |bytes, id| position(bytes, snapshot, id, is_single))
}

fn position(bytes: &mut Vec<u8>, snapshot: &Snapshot, id: usize, is_single: bool) {
    for coordinate in snapshot.position(id).to_array() {
        match is_single {
            true => bytes.extend((coordinate as f32).to_le_bytes()),
            false => bytes.extend(coordinate.to_le_bytes()),
        }
    }
}

/// An attribute, and what NumPy calls its type.
struct Column<'a> {
    attribute: &'a Attribute,
    kind: String,
    /// Letters of the longest word.
    letters: usize,
}

impl<'a> Column<'a> {
    fn of(attribute: &'a Attribute) -> Self {
        let mut letters = 0;
        let kind = match attribute.values.view() {
            View::F32(_) => "<f4".to_string(),
            View::F64(_) => "<f8".to_string(),
            View::I32(_) => "<i4".to_string(),
            View::I64(_) => "<i8".to_string(),
            View::U8(_) => "|u1".to_string(),
            View::Text { names, .. } => {
                letters = names.iter().map(|it| it.chars().count()).max().unwrap_or(0).max(1);
                format!("<U{letters}")
            }
        };
        Self { attribute, kind, letters }
    }

    fn push(&self, bytes: &mut Vec<u8>, id: usize) {
        let View::Text { codes, names } = self.attribute.values.view() else {
            return rows::stored(bytes, self.attribute, id);
        };
        for code in &codes[id * self.attribute.components..][..self.attribute.components] {
            let end = bytes.len() + 4 * self.letters;
            names[*code as usize].chars().for_each(|it| bytes.extend(u32::from(it).to_le_bytes()));
            bytes.resize(end, 0);
        }
    }
}

/// A name as Python writes it.
fn literal(name: &str) -> String {
    format!("'{}'", name.replace('\\', "\\\\").replace('\'', "\\'"))
}

/// The bytes in front of the values: magic, version, and a dictionary that is padded to a multiple of 64.
pub(in crate::write) fn header(element: &str, shape: &[usize]) -> Vec<u8> {
    let shape = match shape {
        [count] => format!("({count},)"),
        _ => format!("({})", shape.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")),
    };
    let mut text = format!("{{'descr': {element}, 'fortran_order': False, 'shape': {shape}, }}");
    // Version 3 has UTF-8 and a length of 32 bits.
    let is_plain = text.is_ascii() && text.len() < 60_000;
    let front = if is_plain { 10 } else { 12 };
    let padding = 63 - (front + text.len()) % 64;
    text += &" ".repeat(padding);
    text.push('\n');
    let mut bytes = b"\x93NUMPY".to_vec();
    match is_plain {
        true => {
            bytes.extend([1, 0]);
            bytes.extend((text.len() as u16).to_le_bytes());
        }
        false => {
            bytes.extend([3, 0]);
            bytes.extend((text.len() as u32).to_le_bytes());
        }
    }
    bytes.extend(text.as_bytes());
    bytes
}
