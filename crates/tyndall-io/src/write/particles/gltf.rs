//! glTF 2.0 points, as one binary file (GLB).
//!
//! Source: the glTF 2.0 specification of the Khronos Group, sections 3.6, 3.7 and 4.

use std::io;

use tyndall::particles::View;

use super::snapshot::{Names, Snapshot};
use super::{Out, Place, rows};

/// Writes the file: positions, colors, and numbers of one to four components as attributes `_NAME`.
pub(super) fn write(out: &mut dyn Out, snapshot: &Snapshot, place: &mut Place) -> io::Result<()> {
    let particles = snapshot.particles;
    let count = snapshot.len() as u64;
    if particles.cell().is_some() || particles.time().is_some() {
        place.note("glTF has no place for cell and time: they are left out");
    }
    let origin = if snapshot.fits_f32() { tyndall::DVec3::ZERO } else { particles.positions().origin() };
    let colors = snapshot.linear_colors();
    let mut arrays = vec![("POSITION".to_string(), 3)];
    if colors.is_some() {
        arrays.push(("COLOR_0".to_string(), 3));
    }
    let (mut columns, mut names) = (Vec::new(), Names::beside(&[]));
    for attribute in &snapshot.attributes {
        if matches!(attribute.values.view(), View::Text { .. }) || attribute.components > 4 {
            place.note(format!(
                "'{}' is left out: glTF has numbers of one to four components",
                attribute.name
            ));
            continue;
        }
        if matches!(attribute.values.view(), View::F64(_) | View::I32(_) | View::I64(_)) {
            place.note(format!("'{}': glTF has floats of 32 bits; it is rounded", attribute.name));
        }
        let letter = |it: char| if it.is_ascii_alphanumeric() { it.to_ascii_uppercase() } else { '_' };
        let name = format!("_{}", attribute.name.chars().map(letter).collect::<String>());
        arrays.push((names.distinct(name), attribute.components));
        columns.push(*attribute);
    }

    let (mut views, mut accessors, mut attributes, mut offset) = (Vec::new(), Vec::new(), Vec::new(), 0);
    for (place, (name, components)) in arrays.iter().enumerate() {
        let bytes = 4 * *components as u64 * count;
        let limits = if place == 0 { limits(snapshot, origin) } else { String::new() };
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][components - 1];
        views.push(format!(
            "{{\"buffer\":0,\"byteOffset\":{offset},\"byteLength\":{bytes},\"target\":34962}}"
        ));
        accessors.push(format!(
            "{{\"bufferView\":{place},\"componentType\":5126,\"count\":{count},\"type\":\"{kind}\"{limits}}}"
        ));
        attributes.push(format!("\"{name}\":{place}"));
        offset += bytes;
    }
    let [x, y, z] = origin.to_array();
    let scene = match count {
        // An accessor has at least one element.
        0 => "\"scenes\":[{}]".to_string(),
        _ => format!(
            "\"scenes\":[{{\"nodes\":[0]}}],\"nodes\":[{{\"mesh\":0,\"name\":\"particles\",\"translation\":[{x},{y},{z}]}}],\
             \"meshes\":[{{\"primitives\":[{{\"mode\":0,\"attributes\":{{{}}}}}]}}],\"accessors\":[{}],\"bufferViews\":[{}],\
             \"buffers\":[{{\"byteLength\":{offset}}}]",
            attributes.join(","),
            accessors.join(","),
            views.join(",")
        ),
    };
    let mut json =
        format!("{{\"asset\":{{\"version\":\"2.0\",\"generator\":\"Tyndall\"}},\"scene\":0,{scene}}}");
    json += &" ".repeat((4 - json.len() % 4) % 4);
    let chunks = 12 + 8 + json.len() as u64 + if count > 0 { 8 + offset } else { 0 };
    let length = u32::try_from(chunks)
        .map_err(|_| io::Error::other("a GLB holds at most 4 GiB: write fewer fields, or another format"))?;
    let mut head = b"glTF".to_vec();
    for number in [2, length, json.len() as u32] {
        head.extend(number.to_le_bytes());
    }
    head.extend(b"JSON");
    head.extend(json.as_bytes());
    if count > 0 {
        head.extend((offset as u32).to_le_bytes());
        head.extend(b"BIN\0");
    }
    out.write_all(&head)?;
    let float = |bytes: &mut Vec<u8>, value: f32| bytes.extend(value.to_le_bytes());
    rows::write_fixed(out, snapshot.len(), |bytes, id| {
        (snapshot.position(id) - origin).to_array().into_iter().for_each(|it| float(bytes, it as f32));
    })?;
    if let Some(colors) = &colors {
        rows::write_fixed(out, snapshot.len(), |bytes, id| {
            colors(id).into_iter().for_each(|it| float(bytes, it));
        })?;
    }
    for attribute in columns {
        rows::write_fixed(out, snapshot.len(), |bytes, id| {
            (0..attribute.components).for_each(|it| float(bytes, attribute.number(id, it) as f32));
        })?;
    }
    Ok(())
}

/// The least and the greatest position, which an accessor of positions has to name.
fn limits(snapshot: &Snapshot, origin: tyndall::DVec3) -> String {
    let mut least = [f32::INFINITY; 3];
    let mut greatest = [f32::NEG_INFINITY; 3];
    for id in 0..snapshot.len() {
        let position = (snapshot.position(id) - origin).as_vec3().to_array();
        for (axis, value) in position.into_iter().enumerate() {
            least[axis] = least[axis].min(value);
            greatest[axis] = greatest[axis].max(value);
        }
    }
    format!(",\"min\":{least:?},\"max\":{greatest:?}")
}
