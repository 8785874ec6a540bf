//! Houdini's classic BGEO, version 5: see `read/bgeo.rs`.

use std::io;

use tyndall::particles::{Attribute, View};

use super::snapshot::Snapshot;
use super::{Out, Place, rows};

/// Writes the file. Numbers have 32 bits.
pub(super) fn write(out: &mut dyn Out, snapshot: &Snapshot, place: &mut Place) -> io::Result<()> {
    let count = u32::try_from(snapshot.len()).map_err(|_| io::Error::other("too many points for BGEO"))?;
    if !snapshot.fits_f32() {
        place.note("BGEO has 32-bit positions: those far from zero are rounded");
    }
    if snapshot.particles.cell().is_some() || snapshot.particles.time().is_some() {
        place.note("BGEO has no place for cell and time: they are left out");
    }
    // Houdini's name for radii, unless the file has it already.
    let with_radius = snapshot.particles.radii().is_some() && snapshot.named(&["pscale"]).is_none();
    let kept = snapshot.attributes.iter().copied().filter(|it| !(with_radius && snapshot.is_radius(it)));
    let columns: Vec<(&Attribute, bool)> = kept.map(|it| (it, is_integer(it))).collect();
    let mut head = b"BgeoV".to_vec();
    let attributes = columns.len() as u32 + u32::from(with_radius);
    for number in [5, count, 0, 0, 0, attributes, 0, 0, 0] {
        head.extend(number.to_be_bytes());
    }
    for &(attribute, is_integer) in &columns {
        define(&mut head, attribute, is_integer);
        if matches!(attribute.values.view(), View::F64(_) | View::I64(_)) && !is_integer {
            place.note(format!("'{}': BGEO has numbers of 32 bits; it is rounded", attribute.name));
        }
    }
    if with_radius {
        string(&mut head, "pscale");
        head.extend([0, 1, 0, 0, 0, 0, 0, 0, 0, 0]);
    }
    out.write_all(&head)?;
    rows::write_fixed(out, snapshot.len(), |bytes, id| {
        for coordinate in snapshot.position(id).extend(1.0).to_array() {
            bytes.extend((coordinate as f32).to_be_bytes());
        }
        for &(attribute, is_integer) in &columns {
            for component in 0..attribute.components {
                let value = attribute.number(id, component);
                match is_integer {
                    true => bytes.extend((value as i32).to_be_bytes()),
                    false => bytes.extend((value as f32).to_be_bytes()),
                }
            }
        }
        if with_radius {
            bytes.extend(snapshot.radius(id).unwrap_or_default().to_be_bytes());
        }
    })?;
    // No primitives; the end of the file.
    out.write_all(&[0, 0xff])
}

/// Whether it is stored as integers: not where they would not fit.
fn is_integer(attribute: &Attribute) -> bool {
    match attribute.values.view() {
        View::I64(values) => values.iter().all(|&it| i32::try_from(it).is_ok()),
        _ => attribute.values.is_discrete(),
    }
}

fn define(head: &mut Vec<u8>, attribute: &Attribute, is_integer: bool) {
    const VECTORS: [&str; 6] = ["v", "velocity", "vel", "n", "normal", "force"];
    string(head, &attribute.name);
    head.extend((attribute.components as u16).to_be_bytes());
    if let View::Text { names, .. } = attribute.values.view() {
        head.extend(4u32.to_be_bytes());
        head.extend((names.len() as u32).to_be_bytes());
        names.iter().for_each(|name| string(head, name));
        return;
    }
    let is_vector =
        attribute.components == 3 && VECTORS.iter().any(|it| attribute.name.eq_ignore_ascii_case(it));
    let code: u32 = if is_integer {
        1
    } else if is_vector {
        5
    } else {
        0
    };
    head.extend(code.to_be_bytes());
    head.resize(head.len() + 4 * attribute.components, 0);
}

fn string(head: &mut Vec<u8>, text: &str) {
    let bytes = &text.as_bytes()[..text.len().min(u16::MAX.into())];
    head.extend((bytes.len() as u16).to_be_bytes());
    head.extend_from_slice(bytes);
}
