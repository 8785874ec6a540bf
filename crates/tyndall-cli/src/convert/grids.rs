//! Particles to grids of voxels, and grids to grids: `tyndall convert FILE -o out.vdb`.

use std::path::Path;
use std::time::Instant;

use tyndall::Error;
use tyndall::medium::density;
use tyndall::names::nearest;
use tyndall::particles::Particles;
use tyndall::scene::short;
use tyndall_io::vdb::{self, DENSITY, Grid, Precision};

use crate::medium::emission::EmissionSpec;
use crate::medium::parted::Parted;
use crate::names::Numbers;
use crate::output::Pattern;
use crate::report::{Failure, Outcome, Report, bytes, counted, seconds};
use crate::{args, dry_run, input, medium, progress, selection, wanted};

/// Whether a name is that of a file of grids.
pub(super) fn is_grids(path: &Path) -> bool {
    path.extension().is_some_and(|it| it.eq_ignore_ascii_case("vdb"))
}

/// Writes each frame that is asked for into a file.
pub(super) fn run(args: &args::Convert, report: &Report) -> Outcome<()> {
    if medium::are_grids(&args.input.files)? {
        if !args.selection.is_empty() {
            let text = "--filter, --select and --clip are for particles, not for a grid — leave them out";
            return Err(Failure::Usage(text.into()));
        }
        return copy(args, report);
    }
    let job = Job { args, report, pattern: Pattern::new(&args.output) };
    let mut wanted = wanted::of_density(&args.density, &args.selection);
    wanted.quantities.extend(args.fields.iter().flatten().filter(|it| *it != DENSITY).cloned());
    let sequence = input::open(&args.input, Some(wanted), report)?;
    job.each(sequence.len(), |number, path| {
        input::refuse_to_replace(path, sequence.paths())?;
        let attributes = args.fields.iter().flatten().filter(|it| *it != DENSITY).count();
        let asked = (&args.input, &args.selection);
        let parts = Parted::of(&sequence, number, asked, (EmissionSpec::None, attributes), None)?;
        if let Some(parts) = parts {
            report.note("particles are read in parts");
            return grids(args, (&parts.sample(report)?, Some(&parts)), report);
        }
        let frame = input::read(&sequence, number, &args.input, report)?;
        let (particles, share) = selection::keep(&args.selection, frame.particles)?;
        share.iter().for_each(|share| report.note(format_args!("{share}")));
        grids(args, (&particles, None), report)
    })
}

/// Grids of files again, some of them or with other numbers.
fn copy(args: &args::Convert, report: &Report) -> Outcome<()> {
    let job = Job { args, report, pattern: Pattern::new(&args.output) };
    job.each(args.input.files.len(), |number, path| {
        let file = &args.input.files[number];
        input::refuse_to_replace(path, &args.input.files)?;
        let (grids, notes) = vdb::read(file, args.fields.as_deref(), report.progress())?;
        notes.iter().for_each(|note| report.warn(note));
        Ok(grids)
    })
}

/// The density of particles, or of the parts of which they are a sample, and means of their attributes; says how they were made.
fn grids(
    args: &args::Convert,
    (particles, parts): (&Particles, Option<&Parted>),
    report: &Report,
) -> Outcome<Vec<Grid>> {
    let names = args.fields.clone().unwrap_or_else(|| vec![DENSITY.to_string()]);
    check(&names, particles)?;
    let fields = names.iter().filter(|name| *name != DENSITY).cloned().collect();
    let settings = args.density.settings(dry_run::available_bytes());
    // A file has the lattice alone, whose samples are means where bricks are finer.
    let settings = density::Settings { fields, finer: settings.finer.or(Some(0)), ..settings };
    let start = Instant::now();
    let (volume, count) = match parts {
        Some(parts) => parts.density(&settings, &args.input, report)?,
        None => (density::estimate(particles, &settings, report.progress())?, particles.len()),
    };
    report.detail(format_args!("density: {}", seconds(start.elapsed().as_secs_f64())));
    volume.notes.iter().for_each(|note| report.detail(note));
    let [x, y, z] = volume.density.size();
    let how = match settings.resolution {
        density::Resolution::Automatic => ", found by the smoothing lengths",
        _ => "",
    };
    report.note(format_args!(
        "tyndall: {} · grid {x}x{y}x{z} · voxels of {}{how}",
        counted(count, "particle"),
        short(volume.density.spacing().into())
    ));
    if volume.density.max() <= 0.0 {
        let text = "the density is 0 everywhere — do the particles weigh anything? (--weight one)";
        return Err(Failure::Unseen(text.into()));
    }
    Ok(vdb::of_volume(&volume, &names, particles.positions().origin()))
}

/// Refuses names of which there is nothing, or which are there twice.
fn check(names: &[String], particles: &Particles) -> Outcome<()> {
    let mut known = vec![DENSITY];
    known.extend(particles.attributes().iter().map(|it| it.name.as_str()));
    for (place, name) in names.iter().enumerate() {
        if names[..place].contains(name) {
            return Err(Error::setting("--fields", name, "each grid once").into());
        }
        if name != DENSITY && particles.attribute(name).is_none() {
            let meant = nearest(name, known.iter().copied());
            let meant = meant.map_or(String::new(), |it| format!("did you mean '{it}'? "));
            let allowed = format!("{meant}there are: {}", known.join(" "));
            return Err(Error::setting("--fields", name, allowed).into());
        }
    }
    Ok(())
}

/// What is to be written where.
struct Job<'a> {
    args: &'a args::Convert,
    report: &'a Report,
    pattern: Pattern,
}

impl Job<'_> {
    /// Writes the frames of `count` that are asked for; `make` gives the grids of one for the file of that name.
    fn each(&self, count: usize, make: impl Fn(usize, &Path) -> Outcome<Vec<Grid>>) -> Outcome<()> {
        let Self { args, report, pattern } = self;
        let takes_all = pattern.is_numbered();
        let numbers = Numbers::of(&args.input, count);
        let frames = numbers.chosen(args.frame, args.frames.as_ref(), takes_all)?;
        if frames.len() > 1 && !takes_all {
            let allowed = format!(
                "a file of this format holds one frame, not {}: give a number in its name, such as NAME.%04d.vdb",
                frames.len()
            );
            return Err(Error::setting("-o", args.output.display(), allowed).into());
        }
        if !takes_all && args.frame.is_none() && args.frames.is_none() && count > 1 {
            report.note(format_args!(
                "note: frame {} of {count}; --frame N for another, -o NAME.%04d.vdb for all of them",
                numbers.number(0)
            ));
        }
        tyndall_io::write::check_place(&pattern.name(numbers.number(frames[0]))).map_err(Failure::Output)?;
        let precision = if args.half { Precision::Half } else { Precision::Full };
        for (written, &number) in frames.iter().enumerate() {
            let path = pattern.name(numbers.number(number));
            if args.skip_existing && path.exists() {
                report.note(format_args!("note: {} is there already", path.display()));
                continue;
            }
            if progress::stopped() {
                return Err(Failure::Interrupted(format!("{written} of {} files written", frames.len())));
            }
            let grids = make(number, &path)?;
            let start = Instant::now();
            vdb::write(&path, &grids, precision, report.progress()).map_err(|error| match error {
                error @ Error::Io { .. } => Failure::Output(error),
                error => error.into(),
            })?;
            let size = bytes(std::fs::metadata(&path).map_or(0, |it| it.len()));
            let told = grids.iter().map(|grid| {
                let voxels = counted(grid.tree.active_count() as usize, "active voxel");
                format!("{} ({voxels})", grid.name)
            });
            report.note(format_args!(
                "{}  {} · {size} · {}",
                path.display(),
                told.collect::<Vec<_>>().join(", "),
                seconds(start.elapsed().as_secs_f64())
            ));
        }
        Ok(())
    }
}
