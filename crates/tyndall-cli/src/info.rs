//! `tyndall info`: what is in a file, for people or as JSON.

mod grids;

use tyndall::Error;
use tyndall::particles::{Attribute, Particles};
use tyndall::render::Settings;
use tyndall::render::estimate::Work;
use tyndall::scene::{grouped, short};
use tyndall::structure::Kind;
use tyndall_io::{Frame, Saved, Sequence};

use crate::args;
use crate::report::{Outcome, Report, bytes, counted};
use crate::values::frame as frame_number;
use crate::{dry_run, input, json, medium, structure};

/// Describes a frame.
pub(crate) fn run(args: &args::Info, report: &Report) -> Outcome<()> {
    if medium::are_grids(&args.input.files)? {
        return grids::run(&args.input.files, args.json, report);
    }
    let settings = Settings { width: 1, height: 1, samples: 1, ..Settings::default() };
    let work = Work::of_count(input::known_count(&args.input.files)?, Kind::Brute, settings);
    dry_run::check_memory(&work, work.memory_bytes(), None)?;
    let sequence = input::open(&args.input, None, report)?;
    let number = frame_number(args.frame, sequence.len())?;
    let saved = sequence.saved(number)?;
    if args.check {
        let allowed = "for .tyn files only: others have no checksums that Tyndall knows";
        let saved =
            saved.as_ref().ok_or_else(|| Error::setting("--check", sequence.name(number), allowed))?;
        saved.check(report.progress())?;
    }
    let mut structure = saved.as_ref().map(described);
    if let Some(text) = structure.as_mut().filter(|_| args.check) {
        text.push_str(" · all checksums right");
    }
    let frame = match saved {
        Some(Saved { particles, conventions, given, warnings, .. }) => {
            input::tell(&sequence.name(number), (&particles, &warnings), &args.input, report)?;
            Frame { particles, conventions, given, warnings }
        }
        None => input::as_stored(&sequence, number, &args.input, report)?,
    };
    let (mut frame, placed) = input::place(frame, &args.input)?;
    match args.json {
        true => {
            frame.conventions.extend(placed);
            report.out(&json::describe(&sequence, number, &frame))
        }
        false => {
            let placed = placed.map_or(String::new(), |it| format!("positions {it}\n"));
            let lacks_unit = frame.particles.length_unit().is_none() && args.input.units.is_none();
            let note = if lacks_unit { "note: no length unit in the file (set --units Å)\n" } else { "" };
            report.out(&(text(&sequence, number, &frame, structure) + note + &placed))
        }
    }
}

/// What a file says about its structure.
fn described(saved: &Saved) -> String {
    let kind = structure::name(saved.kind());
    let each = bytes(saved.structure.bytes());
    format!("structure {kind} · {each} · {} · written by {}", saved.guesses.radii, saved.writer())
}

/// A few lines for people.
fn text(sequence: &Sequence, number: usize, frame: &Frame, structure: Option<String>) -> String {
    let particles = &frame.particles;
    let frames = counted(sequence.len(), "frame");
    let files = match sequence.paths() {
        [_] => String::new(),
        paths => format!(" in {} files", grouped(paths.len())),
    };
    let mut lines =
        vec![format!("{} · {frames}{files} · {}", sequence.format(), counted(particles.len(), "particle"))];
    if sequence.len() > 1 {
        lines.push(format!("frame {number}: {}", sequence.name(number)));
    }
    lines.extend(cell(particles));
    let unit = particles.length_unit().map_or(String::new(), |unit| format!(" {unit}"));
    if let Some([min, max]) = particles.world_bounds() {
        let side = |axis: usize| format!("{}..{}", short(min[axis]), short(max[axis]));
        lines.push(format!("bounds x {} · y {} · z {}{unit}", side(0), side(1), side(2)));
    }
    if let Some(time) = particles.time() {
        let unit = particles.time_unit().map_or(String::new(), |unit| format!(" ({unit})"));
        lines.push(format!("time {time}{unit}"));
    }
    let columns: Vec<String> = particles.attributes().iter().map(column).collect();
    lines.push(match columns.is_empty() {
        true => "columns position".to_string(),
        false => format!("columns position · {}", columns.join(" · ")),
    });
    if !particles.bonds().is_empty() {
        lines.push(format!("bonds {}", grouped(particles.bonds().len())));
    }
    lines.extend(structure);
    let dropped = particles.dropped().total();
    if dropped > 0 {
        lines.push(format!("dropped {} that cannot be drawn", grouped(dropped as usize)));
    }
    lines.extend(frame.conventions.iter().map(|guess| format!("guessed: {guess}")));
    lines.extend(frame.given.iter().map(|text| format!("given: {text}")));
    lines.join("\n") + "\n"
}

/// The cell: its kind, edges and which of them repeat.
fn cell(particles: &Particles) -> Option<String> {
    let cell = particles.cell()?;
    let edge = |axis: usize| cell.vectors[axis];
    let along_axes = (0..3).all(|axis| (0..3).all(|other| axis == other || edge(axis)[other] == 0.0));
    let kind = if along_axes { "orthogonal" } else { "triclinic" };
    let edges: Vec<String> = (0..3).map(|axis| short(edge(axis).length())).collect();
    let repeats: Vec<&str> =
        cell.periodic.iter().map(|&periodic| if periodic { "pp" } else { "ff" }).collect();
    let unit = particles.length_unit().map_or(String::new(), |unit| format!(" {unit}"));
    Some(format!("cell {kind} {}{unit} {}", edges.join("×"), repeats.join(" ")))
}

/// A column's name, type and unit: `vel f32[3] m/s`.
fn column(attribute: &Attribute) -> String {
    let components =
        if attribute.components == 1 { String::new() } else { format!("[{}]", attribute.components) };
    let unit = attribute.unit.as_ref().map_or(String::new(), |unit| format!(" {unit}"));
    format!("{} {}{components}{unit}", attribute.name, attribute.values.type_name())
}
