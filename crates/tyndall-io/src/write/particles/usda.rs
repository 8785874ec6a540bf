//! USD points, as text.

use std::io::{self, Write};

use tyndall::particles::{Attribute, View};

use super::snapshot::{Names, Snapshot};
use super::{Out, Place, rows, text};

/// Metres of the units of length that files name.
const METRES: [(&str, f64); 7] =
    [("Å", 1e-10), ("nm", 1e-9), ("µm", 1e-6), ("mm", 1e-3), ("cm", 1e-2), ("m", 1.0), ("km", 1e3)];

/// Writes the file: a `Points` prim with widths, ids, velocities and colors where the particles have them, other numbers as primvars.
pub(super) fn write(out: &mut dyn Out, snapshot: &Snapshot, place: &mut Place) -> io::Result<()> {
    let particles = snapshot.particles;
    if particles.cell().is_some() || particles.time().is_some() {
        place.note("USD points have no place for cell and time: they are left out");
    }
    let metres = METRES.iter().find(|(unit, _)| Some(*unit) == particles.length_unit());
    let unit = metres.map_or(String::new(), |(_, metres)| format!("    metersPerUnit = {metres:e}\n"));
    write!(
        out,
        "#usda 1.0\n(\n    defaultPrim = \"particles\"\n{unit}    upAxis = \"Z\"\n)\n\ndef Points \"particles\"\n{{\n"
    )?;
    // Points are 32-bit floats: what lies far from zero is moved there.
    let origin = if snapshot.fits_f32() { tyndall::DVec3::ZERO } else { particles.positions().origin() };
    if origin != tyndall::DVec3::ZERO {
        let [x, y, z] = origin.to_array();
        writeln!(
            out,
            "    double3 xformOp:translate = ({x}, {y}, {z})\n    uniform token[] xformOpOrder = [\"xformOp:translate\"]"
        )?;
    }
    array(out, snapshot.len(), "point3f[] points", "", |line, id| {
        tuple(line, (snapshot.position(id) - origin).to_array().map(|it| it as f32));
    })?;
    if particles.radii().is_some() {
        array(out, snapshot.len(), "float[] widths", "", |line, id| {
            text::number(line, f64::from(2.0 * snapshot.radius(id).unwrap_or_default()));
        })?;
    }
    let colors = snapshot.linear_colors();
    if let Some(colors) = &colors {
        array(out, snapshot.len(), "color3f[] primvars:displayColor", &of_points(1), |line, id| {
            tuple(line, colors(id))
        })?;
    }
    let id = snapshot
        .named(&["id"])
        .filter(|it| it.components == 1 && matches!(it.values.view(), View::I32(_) | View::I64(_)));
    let velocity = snapshot.named(&["velocity", "vel", "v"]).filter(|it| it.components == 3);
    let mut names = Names::beside(&["displayColor"]);
    for attribute in &snapshot.attributes {
        let is = |other: Option<&Attribute>| other.is_some_and(|it| std::ptr::eq(it, *attribute));
        if snapshot.is_radius(attribute) {
            continue;
        }
        let in_tuples = is_tuple(attribute) || is(velocity);
        let values = if in_tuples { 1 } else { attribute.components };
        let (name, metadata) = match (is(id), is(velocity)) {
            (true, _) => ("int64[] ids".to_string(), String::new()),
            (_, true) => ("vector3f[] velocities".to_string(), String::new()),
            _ => {
                let name = names.distinct(identifier(&attribute.name));
                let name = format!("{} primvars:{name}", primvar(attribute));
                (name, of_points(values))
            }
        };
        array(out, snapshot.len(), &name, &metadata, |line, id| {
            let component = |line: &mut Vec<u8>, component: usize| {
                text::value(line, attribute, id, component, |line, word| {
                    line.extend(format!("\"{}\"", word.replace('\\', "\\\\").replace('"', "\\\"")).bytes());
                });
            };
            if !in_tuples {
                for place in 0..attribute.components {
                    if place > 0 {
                        line.extend(b", ");
                    }
                    component(line, place);
                }
                return;
            }
            for place in 0..attribute.components {
                line.extend(if place == 0 { b"(".as_slice() } else { b", ".as_slice() });
                component(line, place);
            }
            line.push(b')');
        })?;
    }
    out.write_all(b"}\n")
}

/// Says of a primvar that every point has its own value, of so many elements.
fn of_points(elements: usize) -> String {
    let size = if elements > 1 { format!("\n        elementSize = {elements}") } else { String::new() };
    format!(" (\n        interpolation = \"vertex\"{size}\n    )")
}

/// Whether USD has a type for all components of a particle together.
fn is_tuple(attribute: &Attribute) -> bool {
    (2..=4).contains(&attribute.components)
        && !matches!(attribute.values.view(), View::I64(_) | View::Text { .. })
}

/// `    type name = [a, b, ...] (metadata)`
fn array(
    out: &mut dyn Out,
    count: usize,
    name: &str,
    metadata: &str,
    element: impl Fn(&mut Vec<u8>, usize) + Sync,
) -> io::Result<()> {
    write!(out, "    {name} = [")?;
    rows::write_fixed(out, count, |line, id| {
        if id > 0 {
            line.extend(if id.is_multiple_of(8) { b",\n        ".as_slice() } else { b", ".as_slice() });
        }
        element(line, id);
    })?;
    writeln!(out, "]{metadata}")
}

fn tuple(line: &mut Vec<u8>, values: [f32; 3]) {
    for (place, value) in values.into_iter().enumerate() {
        line.extend(if place == 0 { b"(".as_slice() } else { b", ".as_slice() });
        // Writing to a vector cannot fail.
        _ = write!(line, "{value:?}");
    }
    line.push(b')');
}

/// USD's type of an array.
fn primvar(attribute: &Attribute) -> String {
    let scalar = match attribute.values.view() {
        View::F32(_) => "float",
        View::F64(_) => "double",
        View::I32(_) | View::U8(_) => "int",
        View::I64(_) => "int64",
        View::Text { .. } => "string",
    };
    match attribute.components {
        count if is_tuple(attribute) => format!("{scalar}{count}[]"),
        _ => format!("{scalar}[]"),
    }
}

/// A name of letters, digits and underscores that begins with none of the digits.
fn identifier(name: &str) -> String {
    let name: String = name.chars().map(|it| if it.is_ascii_alphanumeric() { it } else { '_' }).collect();
    if name.starts_with(|it: char| it.is_ascii_alphabetic() || it == '_') { name } else { format!("_{name}") }
}
