//! Opening what the command line names, and reading a frame of it with what is to be said about it.

pub(crate) mod args;

use std::path::{Path, PathBuf};

use tyndall::periodic::{self, Placement};
use tyndall::scene::center::Center;
use tyndall::scene::grouped;
use tyndall::scene::sizes::Size;
use tyndall::scene::wanted::Wanted;
use tyndall::structure::Kind;
use tyndall::{Error, Particles, synthetic};
use tyndall_io::{Frame, Options, Sequence, saved};

use crate::ahead::Ahead;
use crate::report::{Outcome, Report};
use args::{Coords, Input, OnBad, Wrap};

/// Opens the files as one sequence. Of their attributes only those that are wanted need be read: all if nothing is said.
pub(crate) fn open(input: &Input, wanted: Option<Wanted>, report: &Report) -> Outcome<Sequence> {
    let wanted = wanted.map(|mut wanted| {
        wanted.filters.extend(input.center.as_ref().and_then(Center::condition).cloned());
        wanted
    });
    let options = Options {
        columns: input.columns.clone(),
        format: input.format.clone(),
        strict: input.strict,
        scaled: input.coords == Some(Coords::Scaled),
        assembly: input.assembly.clone(),
        types: input.types.clone(),
        dataset: input.dataset.clone(),
        elements: input.elements.clone(),
        index: input.index.clone(),
        units: input.units.clone(),
        index_folder: if input.no_index { None } else { cache_folder().map(|it| it.join("frames")) },
        // Molecules and image flags have names that pictures do not look at.
        wanted: wanted.filter(|_| matches!(placement(input), Placement::AsStored | Placement::Atoms)),
    };
    Ok(Sequence::open(&input.files, &options, report.progress())?)
}

/// Where programs of this user keep what they can make again; none where the system names no such place.
fn cache_folder() -> Option<PathBuf> {
    let named = |variable: &str| std::env::var_os(variable).map(PathBuf::from).filter(|it| it.is_absolute());
    let of_system = if cfg!(windows) {
        named("LOCALAPPDATA")
    } else {
        let below = if cfg!(target_os = "macos") { "Library/Caches" } else { ".cache" };
        named("HOME").map(|home| home.join(below))
    };
    named("XDG_CACHE_HOME").or(of_system).map(|it| it.join("tyndall"))
}

/// The largest number of particles that is known without reading: that of procedural sources.
pub(crate) fn known_count(files: &[PathBuf]) -> Outcome<u64> {
    let specifications = files.iter().filter_map(|path| path.to_str()?.strip_prefix("synthetic:"));
    let mut largest = 0;
    for specification in specifications {
        largest = largest.max(synthetic::count(specification)?);
    }
    Ok(largest)
}

/// Reads a frame, says what is wrong with it, and puts its particles where they are wanted.
pub(crate) fn read(sequence: &Sequence, number: usize, input: &Input, report: &Report) -> Outcome<Frame> {
    placed(as_stored(sequence, number, input, report)?, input)
}

/// The frame with its particles where they are wanted; what is said in place of the file, and where they are, are conventions more.
fn placed(frame: Frame, input: &Input) -> Outcome<Frame> {
    let (mut frame, text) = place(frame, input)?;
    frame.conventions.extend(frame.given.iter().cloned().chain(text));
    Ok(frame)
}

/// Reads a frame and says what is wrong with it.
pub(crate) fn as_stored(
    sequence: &Sequence,
    number: usize,
    input: &Input,
    report: &Report,
) -> Outcome<Frame> {
    let frame = sequence.frame(number, report.progress())?;
    told(frame, sequence, number, input, report)
}

/// Reads a frame, perhaps ahead of time, says what is wrong with it, and puts its particles where they are wanted.
pub(crate) fn read_ahead(
    (sequence, ahead): (&Sequence, &mut Ahead),
    number: usize,
    input: &Input,
    report: &Report,
) -> Outcome<Frame> {
    let frame = ahead.frame(number, report)?;
    placed(told(frame, sequence, number, input, report)?, input)
}

fn told(frame: Frame, sequence: &Sequence, number: usize, input: &Input, report: &Report) -> Outcome<Frame> {
    tell(&sequence.name(number), (&frame.particles, &frame.warnings), input, report)?;
    Ok(frame)
}

/// Puts the particles of a frame where they are wanted, and says what that was; nothing where they stay.
pub(crate) fn place(frame: Frame, input: &Input) -> tyndall::Result<(Frame, Option<String>)> {
    let (particles, text) = match &input.center {
        Some(center) => {
            let (particles, text) = center.place(frame.particles, placement(input))?;
            (particles, Some(text))
        }
        None => periodic::place(frame.particles, placement(input))?,
    };
    Ok((Frame { particles, ..frame }, text))
}

/// Whether particles are where the file says.
pub(crate) fn are_as_stored(input: &Input) -> bool {
    placement(input) == Placement::AsStored && input.center.is_none()
}

/// Where particles of a periodic box are wanted.
fn placement(input: &Input) -> Placement {
    match (input.unwrap, input.wrap) {
        (true, _) => Placement::Unwrapped,
        (false, Wrap::None) => Placement::AsStored,
        (false, Wrap::Atoms) => Placement::Atoms,
        (false, Wrap::Molecules) => Placement::Molecules,
    }
}

/// Refuses to write `path` if it is one of the `files` that are read.
pub(crate) fn refuse_to_replace(path: &Path, files: &[PathBuf]) -> tyndall::Result<()> {
    let is_read = path
        .canonicalize()
        .is_ok_and(|place| files.iter().any(|it| it.canonicalize().is_ok_and(|it| it == place)));
    match is_read {
        true => Err(Error::setting("-o", path.display(), "another file: this one is being read")),
        false => Ok(()),
    }
}

/// The structure that the first of the files has, if it has one.
pub(crate) fn saved_kind(files: &[PathBuf]) -> Option<Kind> {
    saved::kind_of(files.first()?)
}

/// Says what is wrong with the frame called `name`, of which there are warnings, or refuses it.
pub(crate) fn tell(
    name: &str,
    (particles, warnings): (&Particles, &[String]),
    input: &Input,
    report: &Report,
) -> tyndall::Result<()> {
    let dropped = particles.dropped();
    if input.on_bad == OnBad::Error && dropped.total() > 0 {
        let all = particles.len() as u64 + dropped.total();
        let what = format!(
            "{} of {} particles cannot be drawn ({} NaN or infinite positions, {} bad radii)",
            grouped(dropped.total() as usize),
            grouped(all as usize),
            grouped(dropped.position as usize),
            grouped(dropped.radius as usize)
        );
        return Err(Error::format(name, "", what, "--on-bad drop leaves them out"));
    }
    for warning in warnings {
        match dropped.total() > 0 && warning.starts_with("dropped") {
            true => report.warn(&format!("{warning}; --on-bad error to stop")),
            false => report.warn(warning),
        }
    }
    Ok(())
}

/// Gives the particles the radii that are asked for, if each has its own, and says how many cannot be drawn with them, or refuses these.
pub(crate) fn sized(
    particles: Particles,
    size: Option<&Size>,
    input: &Input,
    report: &Report,
) -> Outcome<Particles> {
    let Some(size) = size else { return Ok(particles) };
    let (before, all) = (particles.dropped().radius, particles.len());
    let particles = size.apply(particles)?;
    let bad = (particles.dropped().radius - before) as usize;
    if bad > 0 {
        let what = format!("{} of {} particles", grouped(bad), grouped(all));
        if input.on_bad == OnBad::Error {
            let allowed = format!(
                "0 or more for each particle: {what} have another one; --on-bad drop leaves them out"
            );
            return Err(Error::setting("--radius", size, allowed).into());
        }
        report
            .warn(&format!("dropped {what} without a radius of 0 or more by {size}; --on-bad error to stop"));
    }
    Ok(particles)
}

/// Says how many of `all` particles that were read in parts are not finite, or refuses them.
pub(crate) fn tell_dropped(dropped: u64, all: u64, input: &Input, report: &Report) -> Outcome<()> {
    if dropped == 0 {
        return Ok(());
    }
    let what =
        format!("{} of {} particles (NaN positions)", grouped(dropped as usize), grouped(all as usize));
    if input.on_bad == OnBad::Error {
        let path = input.files.first().cloned().unwrap_or_default();
        return Err(
            Error::format(path, "", format!("cannot draw {what}"), "--on-bad drop leaves them out").into()
        );
    }
    report.warn(&format!("dropped {what}; --on-bad error to stop"));
    Ok(())
}
