//! Frame after frame: particles or grids are read, become a medium with its light, and pictures of it are written.

use std::io::Write;
use std::path::Path;
use std::time::Instant;

use tyndall::medium::noise::advection::Advection;
use tyndall::medium::{Medium, density};
use tyndall::particles::{Particles, Radii};
use tyndall::scene::color::Legend;
use tyndall::scene::guesses::Shown;
use tyndall::scene::outline::Outline;
use tyndall::structure::Spheres;
use tyndall::{Cell, DVec3, Error};
use tyndall_io::annotation::Behind;
use tyndall_io::read::Described;
use tyndall_io::{Frame, Sequence, write};

use super::bodies::Bodies;
use super::drift::Drift;
use super::emission::Values;
use super::parted::Parted;
use super::picture::Renderer;
use super::values::NoiseMotion;
use super::{Content, Job, Scene, estimate, statistics};
use crate::names::Numbers;
use crate::output::{Output, Pattern};
use crate::report::{Failure, Outcome, counted};
use crate::shot::Taken;
use crate::values::Background;
use crate::{ahead, annotate, input, metadata, plan, progress, render, selection, survey, wanted};

/// What is known of a frame beside its medium.
struct Facts<'a> {
    frame: usize,
    /// With its unit.
    time: (Option<f64>, Option<&'a str>),
    length_unit: Option<&'a str>,
    cell: Option<Cell>,
    /// What the colors of what the medium gives off mean, if they mean something.
    legend: Option<Legend>,
    metadata: &'a [(String, String)],
    bodies: Option<&'a Bodies>,
    /// How the noise has gone with the particles.
    advection: Option<Advection>,
}

/// Particles of a frame.
struct Selected<'a> {
    /// All of them, if they are read in parts.
    parts: Option<Parted<'a>>,
    /// All, or a sample of the parts.
    particles: Particles,
    /// The name of the attribute that emits, if one does.
    emitting: Option<String>,
    /// What share of the frame they are, if not all.
    share: Option<String>,
}

impl Job<'_> {
    /// Renders the density of particles.
    pub(super) fn run(&self) -> Outcome<()> {
        self.check()?;
        let mut output = Output::new(self.args, self.report)?;
        let pattern = Pattern::new(&self.args.picture.output);
        let mut wanted = wanted::of_density(&self.args.medium.density, &self.args.selection);
        self.emission_spec().want(&mut wanted);
        Drift::want(&self.args.medium, &mut wanted);
        let sequence = input::open(&self.args.input, Some(wanted), self.report)?;
        let mut drift = Drift::new(self, &sequence)?;
        let count = self.frames(sequence.len())?;
        let pictures =
            plan::pictures(self.args, &pattern, &Numbers::of(&self.args.input, count), self.report)?;
        if self.args.method.dry_run {
            return self.dry_run_of_particles(&sequence, &pictures);
        }
        let statistics = self.args.medium.statistics.as_deref().map(Pattern::new);
        let several = pictures.iter().any(|it| it.frame != pictures[0].frame);
        if several && statistics.as_ref().is_some_and(|it| !it.is_numbered()) {
            let text = "--statistics of several frames needs a number in the name, such as NAME.%04d.json";
            return Err(Failure::Usage(text.into()));
        }
        let surveyed = self.survey(&sequence)?;
        let skips = self.args.frames.skip_existing;
        let mut frames = plan::frames_to_read(&pictures, skips);
        let own = |number: usize| number.min(sequence.len() - 1);
        frames.iter_mut().for_each(|number| *number = own(*number));
        let done = ahead::reading(&sequence, &frames, self.args.method.memory, |ahead| {
            plan::each_frame(
                &pictures,
                skips,
                self.report,
                |number, wanted, kept: &mut Option<Scene>, written| {
                    let own = own(number);
                    let read = || input::read_ahead((&sequence, ahead), own, &self.args.input, self.report);
                    let selected = self.selected(&sequence, own, kept.as_ref(), read)?;
                    let Selected { parts, particles, emitting, share } = selected;
                    let (mut density, count) =
                        self.density((&particles, parts.as_ref()), emitting, kept.as_ref())?;
                    if let Some(statistics) = &statistics {
                        let settings = self.density_settings(None);
                        let text = statistics::json((&particles, count), &settings, &density);
                        let path = statistics.name(number);
                        write::atomically(&path, |file| file.write_all(text.as_bytes()))
                            .map_err(Failure::Output)?;
                    }
                    let mut guesses = self.described(count, &density);
                    guesses.extend(share);
                    let values = density.fields.pop().map(Values::Means);
                    let values = values.or_else(|| self.emission_spec().of_density());
                    let bodies = self.bodies(number, particles.positions().origin(), kept.as_ref())?;
                    let length = density.length;
                    if let Some(scene) = kept {
                        survey::warn(self.args, &particles, &scene.camera, self.report)?;
                    }
                    let (particles_of, bodies_of) = (Some(&particles), bodies.as_ref());
                    let content =
                        Content { particles: particles_of, length, bodies: bodies_of, surveyed: &surveyed };
                    let (medium, scene) = self.scene((density.density, values), content, kept.as_ref())?;
                    guesses.extend(scene.guesses.clone());
                    let (advection, text) = drift.advection(own, &particles, &scene)?.unzip();
                    guesses.extend(text);
                    if kept.is_none() {
                        self.report.note(format_args!("tyndall: {}", guesses.join(" · ")));
                    }
                    let (time, settings) = (particles.time(), self.spheres_settings());
                    let metadata = metadata::of_frame(self.args, &sequence, own, time, &settings, &guesses);
                    let facts = Facts {
                        frame: number,
                        time: (time, particles.time_unit()),
                        length_unit: particles.length_unit(),
                        cell: particles.cell().copied(),
                        legend: scene.source.as_ref().and_then(|it| it.legend(Some(&particles))),
                        metadata: &metadata,
                        bodies: bodies.as_ref(),
                        advection: advection.flatten(),
                    };
                    self.pictures(&medium, kept.insert(scene), wanted, &facts, (&mut output, written))
                },
            )
        });
        output.finish(done)
    }

    /// Says what the pictures of particles would take.
    fn dry_run_of_particles(&self, sequence: &Sequence, pictures: &[plan::Picture]) -> Outcome<()> {
        let number = pictures[0].frame.min(sequence.len() - 1);
        let read = || input::read(sequence, number, &self.args.input, self.report);
        let Selected { parts, particles, emitting, .. } = self.selected(sequence, number, None, read)?;
        let count = parts.as_ref().map_or(particles.len(), Parted::count);
        let settings = self.density_settings(emitting);
        let (lattice, bytes) = match &parts {
            Some(parts) => parts.plan(&settings, self.report)?,
            None => density::plan(&particles, &settings, self.report.progress())?,
        };
        let secs = estimate::density_seconds(&settings, &lattice, rayon::current_num_threads());
        self.report.note(format_args!("tyndall: {} · {}", sequence.format(), counted(count, "particle")));
        self.dry_run(&lattice, bytes, secs, pictures.len())
    }

    /// The outlines of the centers in the frames that stand for the sequence, if all of it is framed.
    fn survey(&self, sequence: &Sequence) -> Outcome<Vec<Outline>> {
        survey::of(self.args, sequence.len(), |number| {
            let read = || survey::read(sequence, number, self.args, self.report);
            let Selected { particles, .. } = self.selected(sequence, number, None, read)?;
            let spheres = Spheres { particles: &particles, radii: &Radii::Uniform(0.0), radius_scale: 1.0 };
            let outliers = self.args.camera.outliers();
            Ok(Shown::of(spheres, outliers).outline)
        })
    }

    /// The particles of a frame, as `read` finds them unless it has to be read in parts and can be; after the first frame measured as there.
    fn selected(
        &self,
        sequence: &Sequence,
        number: usize,
        kept: Option<&Scene>,
        read: impl FnOnce() -> Outcome<Frame>,
    ) -> Outcome<Selected<'_>> {
        let asked = (&self.args.input, &self.args.selection);
        let emission = self.emission_spec();
        let attributes = usize::from(emission.is_of_particles());
        let parts = Parted::of(sequence, number, asked, (emission, attributes), self.args.method.memory)?;
        let parts = match kept {
            Some(scene) => parts.map(|it| it.measured_from(scene.origin)),
            None => parts,
        };
        let (particles, share) = match &parts {
            Some(parts) => (parts.sample(self.report)?, Some("read in parts".into())),
            None => selection::keep(&self.args.selection, read()?.particles)?,
        };
        let particles = match kept {
            Some(scene) => particles.measured_from(scene.origin),
            None => particles,
        };
        let (particles, emitting) = self.emission_spec().prepare(particles)?;
        Ok(Selected { parts, particles, emitting, share })
    }

    /// Renders densities from files; `load` gives the path and the density of a frame of `count`, or the first array of some names
    /// that the same file has.
    pub(super) fn run_grids<'a>(
        &self,
        count: usize,
        load: impl Fn(usize, &[&str]) -> (&'a Path, Outcome<Described>),
    ) -> Outcome<()> {
        self.check()?;
        let mut output = Output::new(self.args, self.report)?;
        let pattern = Pattern::new(&self.args.picture.output);
        let (own, count) = (count, self.frames(count)?);
        let pictures =
            plan::pictures(self.args, &pattern, &Numbers::of(&self.args.input, count), self.report)?;
        if matches!(self.args.medium.noise_motion, NoiseMotion::Ids(_) | NoiseMotion::Velocities(_)) {
            let text = "--noise-motion by ids or velocities is for particles, not for a grid — leave it out";
            return Err(Failure::Usage(text.into()));
        }
        if self.args.medium.statistics.is_some() {
            return Err(Failure::Usage("--statistics is for particles, not for a grid".into()));
        }
        if !self.args.selection.is_empty() {
            let text = "--filter, --select and --clip are for particles, not for a grid — leave them out";
            return Err(Failure::Usage(text.into()));
        }
        if self.args.input.center.is_some() {
            return Err(Failure::Usage(
                "--center is for particles, not for a grid — --look-at moves the camera".into(),
            ));
        }
        if self.args.method.dry_run {
            let density = load(pictures[0].frame, &[]).1?.grid;
            return self.dry_run(&density.lattice(), 0, 0.0, pictures.len());
        }
        let surveyed = survey::of(self.args, own, |number| {
            let grid = load(number, &[]).1?.grid;
            let bounds = grid.filled_bounds().ok_or_else(|| Failure::Unseen("an empty grid".into()))?;
            Ok(Outline::of_box(&bounds, DVec3::ZERO))
        })?;
        let skips = self.args.frames.skip_existing;
        let done = plan::each_frame(&pictures, skips, self.report, |number, wanted, kept, written| {
            let own = number.min(own - 1);
            let (path, density) = load(own, &[]);
            let Described { grid, conventions, .. } = density?;
            let values = self.emission_spec().of_grids(|names| load(own, names).1)?;
            let bodies = self.bodies(number, DVec3::ZERO, kept.as_ref())?;
            let content =
                Content { particles: None, length: None, bodies: bodies.as_ref(), surveyed: &surveyed };
            let (medium, scene) = self.scene((grid, values), content, kept.as_ref())?;
            let mut guesses = vec![format!("medium, cpu {} threads", rayon::current_num_threads())];
            guesses.extend(conventions);
            guesses.extend(scene.guesses.clone());
            if kept.is_none() {
                self.report.note(format_args!("tyndall: {}", guesses.join(" · ")));
            }
            let metadata = metadata::of_grid(self.args, path, &self.spheres_settings(), &guesses);
            let facts = Facts {
                frame: number,
                time: (None, None),
                length_unit: None,
                cell: None,
                legend: scene.source.as_ref().and_then(|it| it.legend(None)),
                metadata: &metadata,
                bodies: bodies.as_ref(),
                advection: None,
            };
            self.pictures(&medium, kept.insert(scene), wanted, &facts, (&mut output, written))
        });
        output.finish(done)
    }

    /// Lights the medium and makes pictures of it, if any are wanted.
    fn pictures(
        &self,
        medium: &Medium,
        scene: &Scene,
        pictures: &[&plan::Picture],
        facts: &Facts,
        (output, written): (&mut Output, &mut usize),
    ) -> Outcome<()> {
        if pictures.is_empty() {
            return Ok(());
        }
        let start = Instant::now();
        let renderer = Renderer::new(self, medium, scene, (facts.bodies, facts.advection.as_ref()))?;
        for (place, picture) in pictures.iter().enumerate() {
            let marching = Instant::now();
            let viewpoint = render::viewpoint(self.args)?;
            let camera = picture.camera(self.args, &viewpoint, (&scene.camera, &scene.outline))?;
            let options = self.args.picture.options(metadata::of_picture(facts.metadata.to_vec(), picture));
            let since = if place == 0 { start } else { marching };
            let shown = annotate::Shown {
                behind: match self.background() {
                    Background::Nothing => Behind::Nothing,
                    Background::Color(color) => Behind::Color(color),
                    Background::Sky => Behind::Picture,
                },
                colors: (facts.legend.as_ref(), "of light"),
                frame: facts.frame,
                time: facts.time,
                length_unit: facts.length_unit,
                cell: facts.cell,
            };
            output.check(&shown, &camera)?;
            let (image, channels) = renderer.picture(&self.view(&camera, scene.origin)?)?;
            let frame = self.args.picture.frame();
            let taken = Taken::one(annotate::Seen { image, channels, camera, frame });
            output.write(&picture.path, (taken, options), &shown, || since.elapsed())?;
            *written += 1;
            if progress::stopped() {
                return Err(Error::Interrupted.into());
            }
        }
        Ok(())
    }
}
