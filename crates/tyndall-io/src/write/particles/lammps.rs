//! LAMMPS dumps, as text.

use std::io;

use tyndall::particles::{Attribute, View};
use tyndall::{Cell, DVec3, Particles};

use super::snapshot::{Names, Snapshot, component_names};
use super::{Out, Place, text};

/// Appends a frame.
pub(super) fn write(out: &mut dyn Out, snapshot: &Snapshot, place: &mut Place) -> io::Result<()> {
    let particles = snapshot.particles;
    let time = particles.time().unwrap_or(place.frame as f64);
    if time.fract() != 0.0 || !(0.0..9e15).contains(&time) {
        writeln!(out, "ITEM: TIME\n{time}\nITEM: TIMESTEP\n{}", place.frame)?;
    } else {
        writeln!(out, "ITEM: TIMESTEP\n{time}")?;
    }
    writeln!(out, "ITEM: NUMBER OF ATOMS\n{}", snapshot.len())?;
    out.write_all(bounds(particles).as_bytes())?;

    let integer = |name: &str| {
        snapshot
            .named(&[name])
            .filter(|it| it.components == 1 && matches!(it.values.view(), View::I32(_) | View::I64(_)))
    };
    let (id_column, kind) = (integer("id"), integer("type"));
    let element = snapshot.named(&["element"]).filter(|it| matches!(it.values.view(), View::Text { .. }));
    let is = |a: &Attribute, b: Option<&Attribute>| b.is_some_and(|b| std::ptr::eq(a, b));
    let others: Vec<&Attribute> =
        snapshot.attributes.iter().copied().filter(|it| !is(it, id_column) && !is(it, kind)).collect();
    let mut header = "ITEM: ATOMS id type x y z".to_string();
    let mut names = Names::beside(&["id", "type", "x", "y", "z"]);
    for attribute in &others {
        for name in component_names(attribute) {
            header = header + " " + &names.distinct(text::plain_name(&name, &[]));
        }
        if text::is_changed_between_blanks(attribute) {
            place.note(format!("'{}': blanks in words are written as _, empty words as -", attribute.name));
        }
    }
    writeln!(out, "{header}")?;
    text::rows(out, particles.positions(), |line, id, coordinates| {
        match id_column {
            Some(column) => text::value(line, column, id, 0, text::between_blanks),
            None => text::number(line, (particles.place(id) + 1) as f64),
        }
        line.push(b' ');
        match (kind, element) {
            (Some(column), _) => text::value(line, column, id, 0, text::between_blanks),
            (None, Some(element)) => text::number(line, element.number(id, 0) + 1.0),
            (None, None) => line.push(b'1'),
        }
        text::end_row(line, id, coordinates, &others, b' ', text::between_blanks);
    })
}

/// The item of the box: the cell, or the bounds of the particles if there is none. A cell whose edges lie as LAMMPS wants them is
/// written with tilt factors, any other by its vectors.
fn bounds(particles: &Particles) -> String {
    let around = || {
        let [min, max] = particles.world_bounds().unwrap_or_default();
        let size = DVec3::from_array(max) - DVec3::from_array(min);
        let vectors = [DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z];
        Cell { origin: DVec3::from_array(min), vectors, periodic: [false; 3] }
    };
    let Cell { origin, vectors: [a, b, c], periodic } = particles.cell().copied().unwrap_or_else(around);
    let styles = periodic.map(|it| if it { "pp" } else { "ff" }).join(" ");
    if a.y != 0.0 || a.z != 0.0 || b.z != 0.0 {
        let lines = [(a, origin.x), (b, origin.y), (c, origin.z)]
            .map(|(edge, origin)| format!("{} {} {} {origin}\n", edge.x, edge.y, edge.z));
        return format!("ITEM: BOX BOUNDS abc origin {styles}\n{}", lines.concat());
    }
    let (xy, xz, yz) = (b.x, c.x, c.y);
    let reach = [[0.0, xy, xz, xy + xz], [0.0, yz, 0.0, yz], [0.0; 4]];
    let edges = [a.x, b.y, c.z];
    let low: [f64; 3] =
        std::array::from_fn(|axis| origin[axis] + reach[axis].into_iter().fold(0.0, f64::min));
    let high: [f64; 3] =
        std::array::from_fn(|axis| origin[axis] + edges[axis] + reach[axis].into_iter().fold(0.0, f64::max));
    let is_tilted = [xy, xz, yz].iter().any(|&it| it != 0.0);
    let line = |axis: usize| match is_tilted {
        true => format!("{} {} {}\n", low[axis], high[axis], [xy, xz, yz][axis]),
        false => format!("{} {}\n", low[axis], high[axis]),
    };
    let tilts = if is_tilted { "xy xz yz " } else { "" };
    format!("ITEM: BOX BOUNDS {tilts}{styles}\n{}{}{}", line(0), line(1), line(2))
}
