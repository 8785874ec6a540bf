//! VTK's XML polygonal data: points with their attributes, as one poly-vertex, raw bytes at the end of the file.
//!
//! Source: the VTK file formats document, "XML file formats".

use std::io;

use tyndall::particles::{Attribute, Values, View};

use super::snapshot::Snapshot;
use super::{Out, Place, rows};

/// Writes the file.
pub(super) fn write(out: &mut dyn Out, snapshot: &Snapshot, place: &mut Place) -> io::Result<()> {
    let particles = snapshot.particles;
    let count = snapshot.len() as u64;
    if particles.cell().is_some() {
        place.note("VTP has no place for the cell: it is left out");
    }
    let is_single = snapshot.fits_f32();
    let axis_bytes = if is_single { 4 } else { 8 };
    let cells = u64::from(count > 0);
    let mut text =
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" \
                    header_type=\"UInt64\">\n<PolyData>\n"
            .to_string();
    if let Some(time) = particles.time() {
        text += &format!(
            "<FieldData><DataArray type=\"Float64\" Name=\"TimeValue\" NumberOfTuples=\"1\" format=\"ascii\">{time}</DataArray></FieldData>\n"
        );
    }
    text += &format!(
        "<Piece NumberOfPoints=\"{count}\" NumberOfVerts=\"{cells}\" NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"0\">\n<PointData>\n"
    );
    // Each array has its size in front.
    let mut offset = 0;
    let mut place_of = |bytes: u64| {
        let at = offset;
        offset += 8 + bytes;
        at
    };
    for attribute in &snapshot.attributes {
        let name = escaped(&attribute.name);
        let components = attribute.components;
        if let View::Text { codes, names } = attribute.values.view() {
            text += &format!(
                "<Array type=\"String\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"ascii\">\n"
            );
            for code in codes {
                names[*code as usize].bytes().for_each(|byte| text += &format!("{byte} "));
                text += "0\n";
            }
            text += "</Array>\n";
            continue;
        }
        let at = place_of(count * row_bytes(attribute));
        text += &format!(
            "<DataArray type=\"{}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"appended\" offset=\"{at}\"/>\n",
            type_name(&attribute.values)
        );
    }
    let positions = place_of(3 * axis_bytes * count);
    let (connectivity, offsets) = (place_of(8 * count), place_of(8 * cells));
    text += &format!(
        "</PointData>\n<Points><DataArray type=\"Float{}\" Name=\"Points\" NumberOfComponents=\"3\" format=\"appended\" offset=\"{positions}\"/></Points>\n\
         <Verts><DataArray type=\"Int64\" Name=\"connectivity\" format=\"appended\" offset=\"{connectivity}\"/>\
         <DataArray type=\"Int64\" Name=\"offsets\" format=\"appended\" offset=\"{offsets}\"/></Verts>\n\
         </Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_",
        8 * axis_bytes
    );
    out.write_all(text.as_bytes())?;
    for attribute in snapshot.attributes.iter().filter(|it| !matches!(it.values.view(), View::Text { .. })) {
        out.write_all(&(count * row_bytes(attribute)).to_le_bytes())?;
        rows::write_fixed(out, snapshot.len(), |bytes, id| rows::stored(bytes, attribute, id))?;
    }
    out.write_all(&(3 * axis_bytes * count).to_le_bytes())?;
    rows::write_fixed(out, snapshot.len(), |bytes, id| {
        for coordinate in snapshot.position(id).to_array() {
            match is_single {
                true => bytes.extend((coordinate as f32).to_le_bytes()),
                false => bytes.extend(coordinate.to_le_bytes()),
            }
        }
    })?;
    out.write_all(&(8 * count).to_le_bytes())?;
    rows::write_fixed(out, snapshot.len(), |bytes, id| bytes.extend((id as i64).to_le_bytes()))?;
    out.write_all(&(8 * cells).to_le_bytes())?;
    if cells > 0 {
        out.write_all(&count.to_le_bytes())?;
    }
    out.write_all(b"\n</AppendedData>\n</VTKFile>\n")
}

fn row_bytes(attribute: &Attribute) -> u64 {
    let bytes = match attribute.values.view() {
        View::U8(_) => 1,
        View::F32(_) | View::I32(_) | View::Text { .. } => 4,
        View::F64(_) | View::I64(_) => 8,
    };
    bytes * attribute.components as u64
}

fn type_name(values: &Values) -> &'static str {
    match values.view() {
        View::F32(_) => "Float32",
        View::F64(_) => "Float64",
        View::I32(_) => "Int32",
        View::I64(_) => "Int64",
        View::U8(_) => "UInt8",
        View::Text { .. } => "String",
    }
}

fn escaped(name: &str) -> String {
    name.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
