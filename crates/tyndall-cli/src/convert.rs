//! `tyndall convert`: particles to another format, or to a density.

mod grids;

use std::path::Path;
use std::time::Instant;

use tyndall::Error;
use tyndall_io::{Sequence, write};

use crate::ahead::{self, Ahead};
use crate::medium::args::Density;
use crate::names::Numbers;
use crate::output::Pattern;
use crate::report::{Failure, Outcome, Report, bytes, counted, seconds};
use crate::{args, input, progress, selection, wanted};

/// Writes the frames that are asked for: into one file if its format holds them, else each into its own.
pub(crate) fn run(args: &args::Convert, report: &Report) -> Outcome<()> {
    if grids::is_grids(&args.output) {
        return grids::run(args, report);
    }
    let Density { voxel, grid, h0, weight, .. } = &args.density;
    if args.half || voxel.is_some() || grid.is_some() || h0.is_some() || weight.is_some() {
        let text = "--half, --voxel, --grid, --h0 and --weight are for a density — give -o NAME.vdb, or leave them out";
        return Err(Failure::Usage(text.into()));
    }
    let pattern = Pattern::new(&args.output);
    let holds_frames = write::particles::holds_frames(&pattern.name(0)).map_err(Failure::Output)?;
    let wanted = wanted::of_fields(args.fields.as_deref(), args.selection.all_filters());
    let sequence = input::open(&args.input, wanted, report)?;
    let takes_all = pattern.is_numbered() || holds_frames;
    let numbers = Numbers::of(&args.input, sequence.len());
    let chosen = numbers.chosen(args.frame, args.frames.as_ref(), takes_all)?;
    if !takes_all && args.frame.is_none() && args.frames.is_none() && sequence.len() > 1 {
        report.note(format_args!(
            "note: frame {} of {}; --frame N for another, -o NAME.%04d.EXT for all of them",
            numbers.number(0),
            sequence.len()
        ));
    }
    let files: Vec<&[usize]> = if pattern.is_numbered() { chosen.chunks(1).collect() } else { vec![&chosen] };
    ahead::reading(&sequence, &chosen, None, |ahead| {
        let (mut written, count) = (0, files.len());
        for frames in files {
            let path = pattern.name(numbers.number(frames[0]));
            input::refuse_to_replace(&path, sequence.paths())?;
            if args.skip_existing && path.exists() {
                report.note(format_args!("note: {} is there already", path.display()));
                continue;
            }
            write_file(args, &path, frames, (&sequence, ahead), report).map_err(|failure| match failure {
                Failure::Interrupted(_) => {
                    Failure::Interrupted(format!("{written} of {count} files written"))
                }
                failure => failure,
            })?;
            written += 1;
        }
        Ok(())
    })
}

/// Writes frames into one file.
fn write_file(
    args: &args::Convert,
    path: &Path,
    frames: &[usize],
    (sequence, ahead): (&Sequence, &mut Ahead),
    report: &Report,
) -> Outcome<()> {
    let start = Instant::now();
    let (mut particles, mut failed) = (0, None);
    let notes = write::particles::particles(path, args.fields.as_deref(), frames.len(), |place| {
        if progress::stopped() {
            return Err(Error::Interrupted);
        }
        let frame = ahead.frame(frames[place], report)?;
        let told = (&frame.particles, &frame.warnings[..]);
        input::tell(&sequence.name(frames[place]), told, &args.input, report)?;
        let (frame, text) = input::place(frame, &args.input)?;
        for text in frame.given.into_iter().chain(text) {
            match place {
                0 => report.note(text),
                _ => report.detail(text),
            }
        }
        let (kept, share) = selection::keep(&args.selection, frame.particles).map_err(|failure| {
            failed = Some(failure);
            Error::Interrupted
        })?;
        // The first frame's stands for all.
        if let Some(share) = share.filter(|_| place == 0) {
            report.note(share);
        }
        particles += kept.len();
        Ok(kept)
    })
    .map_err(|error| match (error, failed) {
        (Error::Interrupted, Some(failure)) => failure,
        (Error::Io { path: of, source }, _) if of == path => Failure::Output(Error::Io { path: of, source }),
        (error, _) => Failure::from(error),
    })?;
    for note in notes {
        report.warn(&note);
    }
    let size = bytes(std::fs::metadata(path).map_or(0, |it| it.len()));
    report.note(format_args!(
        "{}  {} · {} · {size} · {}",
        path.display(),
        counted(particles, "particle"),
        counted(frames.len(), "frame"),
        seconds(start.elapsed().as_secs_f64())
    ));
    Ok(())
}
