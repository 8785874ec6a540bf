//! Extended XYZ, as libAtoms, ASE and OVITO read it.

use std::io;

use tyndall::particles::View;

use super::snapshot::Snapshot;
use super::{Out, Place, text};

/// Appends a frame.
pub(super) fn write(out: &mut dyn Out, snapshot: &Snapshot, place: &mut Place) -> io::Result<()> {
    let particles = snapshot.particles;
    writeln!(out, "{}", snapshot.len())?;
    let mut comment = String::new();
    if let Some(cell) = particles.cell() {
        let numbers: Vec<String> =
            cell.vectors.iter().flat_map(|it| it.to_array()).map(|it| it.to_string()).collect();
        comment += &format!("Lattice=\"{}\" ", numbers.join(" "));
        let [x, y, z] = cell.origin.to_array();
        if [x, y, z] != [0.0; 3] {
            comment += &format!("Origin=\"{x} {y} {z}\" ");
        }
        let flags = cell.periodic.map(|it| if it { "T" } else { "F" });
        comment += &format!("pbc=\"{}\" ", flags.join(" "));
    }
    // Where there is an element, programs look for it in front.
    let element = snapshot.named(&["element", "species", "type_name"]);
    let element = element.filter(|it| it.components == 1 && matches!(it.values.view(), View::Text { .. }));
    let others: Vec<_> = snapshot
        .attributes
        .iter()
        .copied()
        .filter(|it| element.is_none_or(|element| !std::ptr::eq(element, *it)))
        .collect();
    comment += if element.is_some() { "Properties=species:S:1:pos:R:3" } else { "Properties=pos:R:3" };
    for attribute in &others {
        let kind = match attribute.values.view() {
            View::F32(_) | View::F64(_) => 'R',
            View::I32(_) | View::I64(_) | View::U8(_) => 'I',
            View::Text { .. } => 'S',
        };
        let name = text::plain_name(&attribute.name, &[':', '=', '"']);
        comment += &format!(":{name}:{kind}:{}", attribute.components);
    }
    if let Some(time) = particles.time() {
        comment += &format!(" Time={time}");
    }
    writeln!(out, "{comment}")?;
    for attribute in others.iter().chain(&element).filter(|it| text::is_changed_between_blanks(it)) {
        place.note(format!("'{}': blanks in words are written as _, empty words as -", attribute.name));
    }
    if particles.length_unit().is_some_and(|unit| unit != "Å") {
        place.note(format!(
            "lengths are in {}; readers of XYZ take them for Å",
            particles.length_unit().unwrap_or_default()
        ));
    }
    text::rows(out, particles.positions(), |line, id, coordinates| {
        if let Some(element) = element {
            text::value(line, element, id, 0, text::between_blanks);
        }
        text::end_row(line, id, coordinates, &others, b' ', text::between_blanks);
    })
}
