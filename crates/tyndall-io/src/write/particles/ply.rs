//! PLY, binary and little-endian.

use std::io;

use tyndall::particles::{Attribute, Values, View};

use super::snapshot::{Names, Snapshot, component_names};
use super::{Out, Place, rows, text};

/// What a property is.
#[derive(Clone, Copy, PartialEq)]
enum Type {
    Float,
    Double,
    Int,
    Uchar,
}

impl Type {
    /// What holds all values: PLY has no integers of 64 bits, so large ones become floats.
    fn of(values: &Values) -> Self {
        match values.view() {
            View::F32(_) => Self::Float,
            View::F64(_) => Self::Double,
            View::I32(_) | View::Text { .. } => Self::Int,
            View::U8(_) => Self::Uchar,
            View::I64(values) if values.iter().all(|&it| i32::try_from(it).is_ok()) => Self::Int,
            View::I64(_) => Self::Double,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Float => "float",
            Self::Double => "double",
            Self::Int => "int",
            Self::Uchar => "uchar",
        }
    }

    fn push(self, bytes: &mut Vec<u8>, value: f64) {
        match self {
            Self::Float => bytes.extend((value as f32).to_le_bytes()),
            Self::Double => bytes.extend(value.to_le_bytes()),
            Self::Int => bytes.extend((value as i32).to_le_bytes()),
            Self::Uchar => bytes.push(value as u8),
        }
    }
}

/// Writes the file.
pub(super) fn write(out: &mut dyn Out, snapshot: &Snapshot, place: &mut Place) -> io::Result<()> {
    let particles = snapshot.particles;
    let axes = if snapshot.fits_f32() { Type::Float } else { Type::Double };
    let mut header = "ply\nformat binary_little_endian 1.0\ncomment written by Tyndall\n".to_string();
    if let Some(unit) = particles.length_unit() {
        header += &format!("comment lengths in {unit}\n");
    }
    if let Some(time) = particles.time() {
        header += &format!("comment time {time}\n");
    }
    if particles.cell().is_some() {
        place.note("PLY has no place for the cell: it is left out");
    }
    let mut properties = String::new();
    for axis in ["x", "y", "z"] {
        properties += &format!("property {} {axis}\n", axes.name());
    }
    let columns: Vec<(&Attribute, Type)> =
        snapshot.attributes.iter().map(|it| (*it, Type::of(&it.values))).collect();
    let mut taken = Names::beside(&["x", "y", "z"]);
    for (attribute, kind) in &columns {
        for name in component_names(attribute) {
            properties +=
                &format!("property {} {}\n", kind.name(), taken.distinct(text::plain_name(&name, &[])));
        }
        if let View::Text { names, .. } = attribute.values.view() {
            place.note(format!(
                "'{}': PLY has no words; numbers stand for them, a comment says which",
                attribute.name
            ));
            for (code, name) in names.iter().enumerate() {
                header +=
                    &format!("comment {} {code} is {}\n", attribute.name, name.replace(['\n', '\r'], " "));
            }
        }
    }
    write!(out, "{header}element vertex {}\n{properties}end_header\n", snapshot.len())?;
    rows::write_fixed(out, snapshot.len(), |bytes, id| {
        snapshot.position(id).to_array().into_iter().for_each(|it| axes.push(bytes, it));
        for (attribute, kind) in &columns {
            (0..attribute.components).for_each(|component| kind.push(bytes, attribute.number(id, component)));
        }
    })
}
