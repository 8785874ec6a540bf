//! Particles that do not fit the memory: they are read in parts, and a sample stands for them where guesses are made.

use tyndall::medium::density::{self, Settings, Volume};
use tyndall::medium::grid::Lattice;
use tyndall::periodic::Placement;
use tyndall::{Error, Source};
use tyndall_io::{Parts, Sequence};

use crate::args::{Input, Selection};
use crate::report::{Outcome, Report};
use crate::{dry_run, input};

/// The frame as parts, if it has to be read in parts and can be; `limit` is the memory that may be used instead of what is free.
pub(crate) fn parts(
    sequence: &Sequence,
    number: usize,
    (input, selection): (&Input, &Selection),
    limit: Option<u64>,
) -> Outcome<Option<Parts>> {
    if input::placement(input) != Placement::AsStored {
        return Ok(None);
    }
    // What is wrong with the file is said when it is read.
    let Some(parts) = sequence.parts(number).ok().flatten() else { return Ok(None) };
    if dry_run::fits(density::particle_bytes(parts.len()), limit) {
        return Ok(None);
    }
    if !selection.is_empty() {
        let allowed = "left out: the particles do not fit the memory with what each has of its own";
        return Err(Error::setting("--filter, --select and --clip", "given", allowed).into());
    }
    Ok(Some(parts))
}

/// Their density; says what is wrong with the particles.
pub(crate) fn density(parts: &Parts, settings: &Settings, input: &Input, report: &Report) -> Outcome<Volume> {
    let (volume, dropped) = density::stream(parts, settings, report.progress())?;
    input::tell_dropped(dropped, parts.len(), input, report)?;
    Ok(volume)
}

/// Where the samples of it will lie, and the most memory that it will take.
pub(crate) fn plan(parts: &Parts, settings: &Settings, report: &Report) -> Outcome<(Lattice, u64)> {
    Ok(density::plan_stream(parts, settings, report.progress())?)
}
