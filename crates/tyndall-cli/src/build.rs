//! `tyndall build`: particles and their structure in one file that opens at once.

use std::time::Instant;

use tyndall::render::Settings;
use tyndall::render::estimate::Work;
use tyndall::scene::automatic;
use tyndall::scene::sizes::Size;
use tyndall::scene::wanted::Wanted;
use tyndall::structure::Kind;
use tyndall::{Error, Particles};
use tyndall_io::saved::{self, Recipe};
use tyndall_io::write;

use crate::names::Numbers;
use crate::report::{Failure, Outcome, Report, bytes, counted, seconds};
use crate::{args, dry_run, input, structure, wanted};

/// Reads a frame and saves it.
pub(crate) fn run(args: &args::Build, report: &Report) -> Outcome<()> {
    let start = Instant::now();
    let path = &args.output;
    // What cannot work is refused before the reading.
    if !path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("tyn")) {
        return Err(Failure::Output(Error::setting(
            "-o",
            path.display(),
            "the extension of what is built is .tyn",
        )));
    }
    write::check_place(path).map_err(Failure::Output)?;
    let kind = structure::kind(&args.structure)?;
    if kind == Kind::Brute {
        return Err(Error::setting(
            "--structure",
            "brute",
            "bvh, pkd or treelets: brute has nothing to save",
        )
        .into());
    }
    let known = Work::of_count(input::known_count(&args.input.files)?, kind, NO_PICTURE);
    dry_run::check_memory(&known, known.memory_bytes(), args.memory)?;
    let wanted = wanted::of_fields(args.fields.as_deref(), Vec::new());
    let sizes = args.radius.as_ref().and_then(Size::quantity).map(String::from);
    let wanted = wanted.map(|it| Wanted {
        radii: args.radius.is_none(),
        quantities: sizes.into_iter().collect(),
        ..it
    });
    let sequence = input::open(&args.input, wanted, report)?;
    input::refuse_to_replace(path, sequence.paths())?;
    let numbers = Numbers::of(&args.input, sequence.len());
    let number = numbers.chosen(args.frame, None, false)?[0];
    if args.frame.is_none() && sequence.len() > 1 {
        let first = numbers.number(0);
        report.note(format_args!("note: frame {first} of {}; --frame N for another", sequence.len()));
    }
    let frame = input::read(&sequence, number, &args.input, report)?;
    frame.given.iter().for_each(|text| report.note(text));
    if !input::are_as_stored(&args.input) {
        frame.conventions.last().into_iter().for_each(|text| report.note(text));
    }
    let particles = input::sized(frame.particles, args.radius.as_ref(), &args.input, report)?;
    let (radii, radii_text) =
        args.radius.as_ref().and_then(Size::uniform).unwrap_or_else(|| automatic::radii(&particles));
    let particles = with_fields(particles.with_radii(radii), args.fields.as_deref())?;
    let work = Work::of(&particles, kind, NO_PICTURE);
    dry_run::check_memory(&work, work.memory_bytes(), args.memory)?;
    if args.dry_run {
        return dry_run::tell_build(&work, report);
    }
    let count = counted(particles.len(), "particle");
    report.note(format_args!("tyndall: {} · {count} · {radii_text}", structure::name(kind)));
    let recipe = Recipe {
        kind,
        radii_text,
        conventions: frame.conventions,
        sources: vec![sequence.name(number)],
        writer: format!("tyndall {}", env!("CARGO_PKG_VERSION")),
    };
    let written = saved::build(path, particles, recipe, report.progress()).map_err(|error| match error {
        Error::Io { path: ref of, .. } if of == path => Failure::Output(error),
        error => error.into(),
    })?;
    if let Some(error) = &written.packing_error {
        report.note(structure::packing_error(error));
        report.detail(structure::packing_error_by_axis(error));
    }
    let (size, secs) = (bytes(written.file_bytes), seconds(start.elapsed().as_secs_f64()));
    report.note(format_args!("{}  {count} · {size} · {secs}", path.display()));
    Ok(())
}

/// Building needs no picture.
const NO_PICTURE: Settings =
    Settings { width: 1, height: 1, samples: 1, seed: 0, culling: tyndall::render::Culling::Off };

/// The particles with these attributes, all if none are named.
fn with_fields(particles: Particles, fields: Option<&[String]>) -> Outcome<Particles> {
    let Some(fields) = fields else { return Ok(particles) };
    let mut wanted = Vec::new();
    for field in fields {
        let attribute = particles.attribute(field).ok_or_else(|| {
            let known: Vec<&str> = particles.attributes().iter().map(|it| it.name.as_str()).collect();
            Error::setting("--fields", field, format!("the file has: {}", known.join(" ")))
        })?;
        wanted.push(attribute.name.clone());
    }
    Ok(particles.with_attributes(|it| wanted.contains(&it.name)))
}
