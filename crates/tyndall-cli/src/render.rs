//! `tyndall render`: particles to a picture, or to numbered pictures.
//!
//! What is not said is guessed from the first frame: camera and radius are kept for all frames, so that nothing jumps; the color
//! range follows each frame unless it is fixed. A frame that fails does not stop the others.

use std::path::Path;
use std::time::Instant;

use tyndall::particles::{Particles, Radii};
use tyndall::periodic::Placement;
use tyndall::render::estimate::Work;
use tyndall::render::illustration::Illustration;
use tyndall::render::{Culling, Settings};
use tyndall::scene::automatic::{self, Outliers};
use tyndall::scene::bonding;
use tyndall::scene::camera::{Camera, VERTICAL_ANGLE};
use tyndall::scene::color::{Key, Legend, ParticleColors, resolve};
use tyndall::scene::coloring::{Mapping, Norm, Range};
use tyndall::scene::ellipsoids::Ellipsoids;
use tyndall::scene::guesses::{Guesses, Shown};
use tyndall::scene::joined::Part;
use tyndall::scene::light::{Lighting, Lights};
use tyndall::scene::motion::displacements;
use tyndall::scene::opacity::opacities;
use tyndall::scene::outline::Outline;
use tyndall::scene::viewpoint::{Lens, Motion, Viewpoint, too_small, why_unseen};
use tyndall::scene::wanted::Wanted;
use tyndall::scene::{Scene, short};
use tyndall::structure::replicas::Replicas;
use tyndall::structure::saved::RadiiOf;
use tyndall::structure::{Kind, Spheres, Structure};
use tyndall::{Error, Source, Vec3};
use tyndall_io::annotation::Behind;
use tyndall_io::{Parts, Saved, Sequence};

use crate::ahead::Ahead;
use crate::annotate::Shown as Annotated;
use crate::args::{self, Builder, Mode, Selection};
use crate::device::{self, Goal, Held, Renders};
use crate::layers::{self, Layer, Named};
use crate::names::Numbers;
use crate::output::{Output, Pattern};
use crate::plan::{self, Picture};
use crate::report::{Failure, Outcome, Report, counted, seconds};
use crate::selection::{self, Found};
use crate::shapes::Meshes;
use crate::shot::{self, Shot};
use crate::sources::{self, Sources, Together};
use crate::values::{Background, Degrees};
use crate::{
    ahead, culling, dry_run, illustrate, input, lights, looks, medium, metadata, progress, project, structure,
};

/// Renders what the command line asks for.
pub(crate) fn run(args: &args::Render, report: &Report) -> Outcome<()> {
    args.origin.begin(report)?;
    match sources::parted(args)? {
        (Some(medium), spheres) => return medium::run(medium, &spheres, report),
        (None, _) if args.method.mode == Mode::Project => return project::run(args, report),
        (None, _) => {}
    }
    let job = Job::new(args, report)?;
    // What cannot work is refused before the reading.
    let mut output = Output::new(args, report)?;
    let known = input::known_count(&args.input.files)?;
    job.check_memory(&Work::of_count(known, job.structure, job.settings), Reading::Parts)?;
    let of_layers = layers::quantities(job.layers).map(String::from);
    let wanted = Wanted {
        coloring: args.look.color.clone(),
        filters: args.selection.all_filters(),
        quantities: args.look.opacity.iter().cloned().chain(of_layers).collect(),
        radii: args.look.radius.is_none() || args.look.bonds.is_some(),
        vectors: args.look.moving().map(String::from).into_iter().chain(args.shapes.vectors()).collect(),
    };
    let sequence = input::open(&args.input, Some(wanted), report)?;
    job.sources.check(sequence.len())?;
    let pictures = plan::pictures(args, &job.pattern, &Numbers::of(&args.input, sequence.len()), report)?;
    if args.method.dry_run {
        return job.dry_run(&sequence, &pictures);
    }
    let frames = plan::frames_to_read(&pictures, args.frames.skip_existing);
    let done = ahead::reading(&sequence, &frames, args.method.memory, |ahead| {
        plan::each_frame(&pictures, args.frames.skip_existing, report, |frame, wanted, kept, written| {
            job.pictures_of_frame((&sequence, ahead), frame, wanted, kept, (&mut output, written))
        })
    });
    output.finish(done)
}

/// The most samples of a pixel where noise or time decides, if nothing is said.
const MOST_SAMPLES: u32 = 4096;

/// Samples of a pixel where light is traced, if nothing is said: the default look of 10^6 particles has less than 1 % of noise then.
const LIT_SAMPLES: u32 = 128;

/// Samples of a pixel where each meets another scene, if nothing is said.
const DRAWN_SAMPLES: u32 = 256;

/// Whether particles are read as a whole or can be read in parts.
#[derive(Clone, Copy)]
enum Reading {
    Whole,
    Parts,
}

/// What is guessed on the first frame and kept.
struct Kept {
    camera: Camera,
    outline: Outline,
    uniform: Option<Radii>,
    range: Option<(Norm, Range)>,
    layers: Vec<sources::Kept>,
}

/// What a saved structure brings along.
struct Opened {
    structure: Structure,
    guesses: Guesses,
    /// Particles that stand for all.
    sample: Particles,
}

impl Opened {
    fn spheres(&self, radius_scale: f32) -> Spheres<'_> {
        let radii = self.sample.radii().unwrap_or(&Radii::Uniform(0.0));
        Spheres { particles: &self.sample, radii, radius_scale }
    }
}

/// The command line, translated.
struct Job<'a> {
    args: &'a args::Render,
    report: &'a Report,
    settings: Settings,
    structure: Kind,
    /// Whether another structure will not do.
    is_structure_asked_for: bool,
    viewpoint: Viewpoint,
    background: Option<[f32; 3]>,
    lights: Option<Lights>,
    illustration: Illustration,
    pattern: Pattern,
    layers: &'a [Named],
    renders: Renders,
    goal: Goal,
    meshes: Meshes,
    sources: Sources<'a>,
}

impl<'a> Job<'a> {
    fn new(args: &'a args::Render, report: &'a Report) -> Outcome<Self> {
        let args::Picture { samples, seed, background, .. } = &args.picture;
        let [width, height] = args.picture.pixels();
        let goal = Goal { noise: args.medium.most_noise(), time: args.picture.time };
        if args.medium.noise.is_some() && goal.noise.is_none() {
            let text = "position noise is for --mode medium; of spheres --noise 1% is how much may be left";
            return Err(Failure::Usage(text.into()));
        }
        let most = match args.look.drawn() {
            _ if goal.is_given() => MOST_SAMPLES,
            Some(_) => DRAWN_SAMPLES,
            None if looks::is_traced(args.look.look) => LIT_SAMPLES,
            None => Settings::default().samples,
        };
        let samples = samples.unwrap_or(most);
        if let Some(window) = args.picture.crop {
            window.check(width, height)?;
        }
        let culling = culling::culling(&args.method.culling);
        if let Culling::Confidence(options) = culling {
            options.check()?;
        }
        let images = args.look.images();
        let shape = args.look.bonds.map(|_| "--bonds").or(args.shapes.name());
        let coverage = matches!(culling, Culling::Certified(proofs) if proofs.coverage);
        if images.is_some() && coverage {
            return Err(Error::setting("--certified", "coverage", "without coverage with --replicate").into());
        }
        let cut = args.cut.name();
        if let Some(name) = cut.filter(|_| coverage) {
            let allowed = format!("without coverage with {name}");
            return Err(Error::setting("--certified", "coverage", allowed).into());
        }
        let of_picture = shot::beyond_cards(args);
        if images.is_some() && !args.layers.sources.is_empty() {
            return Err(Failure::Usage(
                "--replicate is not for several layers — leave out one of them".into(),
            ));
        }
        if let Some(name) = args.shapes.rods().filter(|_| images.is_some()) {
            return Err(Failure::Usage(format!(
                "{name} is not for --replicate, whose cells share edges — leave out one of them"
            )));
        }
        let beyond = images.map(|_| "--replicate").or(shape).or(args.look.drawn()).or(cut);
        looks::check(args)?;
        if args.look.moving().is_some() && args.picture.wants_surfaces() {
            let allowed = "without normal and position with --shutter: what moves has several";
            return Err(Error::setting("--layers", "given", allowed).into());
        }
        if let (Some(wanted), Culling::Confidence(_)) = (beyond, culling) {
            let allowed = format!("off or certified with {wanted}");
            return Err(Error::setting("--culling", "confidence", allowed).into());
        }
        let settings = Settings { width, height, samples, seed: *seed, culling };
        let asked = structure::kind(&args.method.structure)?;
        let is_structure_asked_for = args.method.structure.structure.is_some() || asked != Kind::default();
        // A file's own structure is as good as any other.
        let saved = input::saved_kind(&args.input.files).filter(|_| !is_structure_asked_for);
        let structure = saved.unwrap_or(asked);
        let background = match background.unwrap_or(Background::Color([1.0; 3])) {
            Background::Nothing => None,
            Background::Color(color) => Some(color),
            // What lights the particles is behind them.
            Background::Sky => None,
        };
        Ok(Self {
            args,
            report,
            settings,
            structure,
            is_structure_asked_for,
            viewpoint: viewpoint(args)?,
            background: background.filter(|_| args.picture.is_opaque()),
            lights: lights::of_spheres(args, report)?,
            illustration: illustrate::illustration(args)?,
            pattern: Pattern::new(&args.picture.output),
            layers: layers::asked(&args.picture, &args.picture.written(0), &Layer::OF_SPHERES)?,
            renders: Renders::new(
                &args.method.device,
                device::Work {
                    structure,
                    culling,
                    build: args.method.build,
                    beyond_cards: beyond.or(looks::beyond_cards(args)).or(of_picture),
                },
                report,
            )?,
            goal,
            meshes: args.shapes.meshes()?,
            sources: Sources::open(&args.layers.sources.iter().collect::<Vec<_>>(), report)?,
        })
    }

    /// Reads the first frame only, and says what the pictures would cost.
    fn dry_run(&self, sequence: &Sequence, pictures: &[Picture]) -> Outcome<()> {
        let known = input::known_count(&self.args.input.files)?;
        let work = match known {
            0 if self.saved(sequence, pictures[0].frame, None)?.is_some() => {
                Work::of_count(0, self.structure, self.settings)
            }
            0 => {
                let frame = input::read(sequence, pictures[0].frame, &self.args.input, self.report)?;
                self.report.note(format_args!(
                    "tyndall: {} · {}",
                    sequence.format(),
                    counted(frame.particles.len(), "particle")
                ));
                Work::of(&frame.particles, self.structure, self.settings)
            }
            count => Work::of_count(count, self.structure, self.settings),
        };
        let traced = looks::is_traced(self.args.look.look);
        let work = self.held(Work { traced, ..work });
        self.check_memory(&work, if known > 0 { Reading::Parts } else { Reading::Whole })?;
        dry_run::tell(&work, pictures.len(), self.report)
    }

    /// Rows that are made at one time of a picture, if it is made in bands.
    fn band_rows(&self, path: &Path) -> Option<u32> {
        shot::band_rows(&self.args.picture, path, self.args.method.memory)
    }

    /// The same work, of which so many pixels are in memory as will be.
    fn held(&self, work: Work) -> Work {
        let args::Picture { crop, .. } = &self.args.picture;
        let width = u64::from(self.settings.width);
        let rows = self.band_rows(&self.args.picture.written(0));
        let part = crop.map(|window| u64::from(window.width) * u64::from(window.height));
        let held_pixels = rows.map(|rows| width * u64::from(rows)).or(part).unwrap_or(work.held_pixels);
        Work { held_pixels, ..work }
    }

    /// Refuses work that does not fit the memory.
    fn check_memory(&self, work: &Work, reading: Reading) -> Outcome<()> {
        let work = &self.held(*work);
        let needed_bytes = match (reading, self.structure) {
            (Reading::Parts, Kind::Bvh(_)) => work.memory_bytes().min(work.streamed_bytes()),
            _ => work.memory_bytes(),
        };
        dry_run::check_memory(work, needed_bytes, self.args.method.memory)
    }

    /// The frame as parts, if it has to be read in parts and can be.
    fn parts(&self, sequence: &Sequence, number: usize) -> Option<Parts> {
        // Particles that are put elsewhere, bonded or drawn as other shapes are all needed at once.
        let needs_all =
            self.args.look.bonds.is_some() || self.args.shapes.are_of_particles() || !self.sources.is_empty();
        if needs_all || input::placement(&self.args.input) != Placement::AsStored {
            return None;
        }
        // What is wrong with the file is said when it is read.
        let parts =
            sequence.parts(number).ok().flatten().filter(|_| matches!(self.structure, Kind::Bvh(_)))?;
        let work = self.held(Work::of_count(parts.len(), self.structure, self.settings));
        (!dry_run::fits(work.memory_bytes(), self.args.method.memory)).then_some(parts)
    }

    /// The frame with the structure that was saved with it, if that is what is asked for; says why if it is not.
    fn saved(&self, sequence: &Sequence, number: usize, kept: Option<&Kept>) -> Outcome<Option<Saved>> {
        let Some(saved) = sequence.saved(number)? else { return Ok(None) };
        if let Some(why) = self.why_not(&saved, kept) {
            let kind = structure::name(saved.kind());
            self.tell(kept.is_none(), &format!("note: the saved structure ({kind}) is not used: {why}"));
            return Ok(None);
        }
        let told = (&saved.particles, &saved.warnings[..]);
        input::tell(&sequence.name(number), told, &self.args.input, self.report)?;
        Ok(Some(saved))
    }

    /// Why a saved structure is not what is asked for, if it is not.
    fn why_not(&self, saved: &Saved, kept: Option<&Kept>) -> Option<String> {
        let uniform = match saved.particles.radii() {
            Some(Radii::Uniform(radius)) => Some(*radius),
            _ => None,
        };
        if self.is_structure_asked_for && saved.kind() != self.structure {
            return Some(format!("{} is asked for, built otherwise", structure::name(self.structure)));
        }
        if self.args.method.build == Builder::Gpu {
            return Some("--build gpu".into());
        }
        if input::placement(&self.args.input) != Placement::AsStored {
            return Some("its particles are to be elsewhere".into());
        }
        if !self.sources.is_empty() {
            return Some("there are other layers".into());
        }
        if let Some((Radii::Uniform(radius), _)) = self.asked_radius(kept)
            && uniform != Some(radius)
        {
            let own =
                uniform.map_or("a radius for each".into(), |own| format!("radius {}", short(own.into())));
            return Some(format!("it has {own}, radius {} is asked for", short(radius.into())));
        }
        // Packed radii are right to a share of the radius that they were packed with.
        let is_packed = saved.structure.saved().is_some_and(|(facts, _)| facts.radii == RadiiOf::Packed);
        (is_packed && self.args.look.radius_scale != 1.0)
            .then(|| "its radii are packed, and --radius-scale changes them".into())
    }

    /// Builds over parts. Returns too how many particles were not finite.
    fn stream(&self, parts: &Parts, radii: &Radii, colors: &ParticleColors) -> Outcome<(Structure, u64)> {
        let allowed = "one for all: the particles do not fit the memory with what each has of its own";
        let (&Radii::Uniform(radius), Kind::Bvh(packing)) = (radii, self.structure) else {
            return Err(Error::setting("--radius", "each its own", allowed).into());
        };
        if !colors.is_constant() {
            return Err(Error::setting("--color", &colors.description, allowed).into());
        }
        let Selection { filters, conditions, .. } = &self.args.selection;
        if let Some(filter) = filters.iter().chain(conditions).next() {
            let allowed = "given: the particles do not fit the memory with what each has of its own — --clip is possible";
            return Err(Error::setting("--filter and --select", filter, allowed).into());
        }
        if let Some(name) = self.args.look.drawn() {
            let allowed = "left out: the particles do not fit the memory with what each has of its own";
            return Err(Error::setting(name, "given", allowed).into());
        }
        let radius = radius * self.args.look.radius_scale;
        let (structure, dropped) =
            Structure::stream(parts, parts.origin(), radius, packing, self.report.progress())?;
        input::tell_dropped(dropped, parts.len(), &self.args.input, self.report)?;
        Ok((structure, dropped))
    }

    /// Reads a frame, builds once, and makes its pictures.
    fn pictures_of_frame(
        &self,
        (sequence, ahead): (&Sequence, &mut Ahead),
        number: usize,
        pictures: &[&Picture],
        kept: &mut Option<Kept>,
        (output, written): (&mut Output, &mut usize),
    ) -> Outcome<()> {
        let start = Instant::now();
        let parts = self.parts(sequence, number);
        let saved = self.saved(sequence, number, kept.as_ref())?;
        let mut opened = None;
        let (particles, conventions) = match (&parts, saved) {
            (Some(parts), _) => (parts.sample(self.report.progress())?, vec!["read in parts".to_string()]),
            (None, Some(saved)) => {
                let sample = saved.sample()?;
                opened = Some(Opened { structure: saved.structure, guesses: saved.guesses, sample });
                (saved.particles, saved.conventions)
            }
            (None, None) => {
                let frame = input::read_ahead((sequence, ahead), number, &self.args.input, self.report)?;
                let work = Work::of(&frame.particles, self.structure, self.settings);
                self.check_memory(&Work { columns_bytes: 0, ..work }, Reading::Whole)?;
                (frame.particles, frame.conventions)
            }
        };
        self.report.detail(format_args!("read: {}", seconds(start.elapsed().as_secs_f64())));
        let count = parts.as_ref().map_or(particles.len(), |parts| parts.len() as usize);
        let is_first = kept.is_none();
        let of_layers = kept.as_ref().map_or(&[][..], |kept| &kept.layers);
        let layers = self.sources.read(number, of_layers, self.report)?;
        let all = count + layers.iter().map(|layer| layer.part.particles.len()).sum::<usize>();
        if all > count {
            self.check_memory(&Work::of_count(all as u64, self.structure, self.settings), Reading::Whole)?;
        }
        let frames_shown = is_first && self.args.camera.frame_shown;

        // Guess what is not said.
        let guessing = Instant::now();
        let guesses = opened.as_ref().map(|opened| &opened.guesses);
        let (radii, radius_text) = self.radii(&particles, guesses, kept.as_ref());
        let radius_scale = self.args.look.radius_scale;
        let spheres = Spheres { particles: &particles, radii: &radii, radius_scale };
        let ellipsoids = if parts.is_none() { self.ellipsoids(spheres, is_first)? } else { None };
        // What frames ellipsoids are the spheres around most of them.
        let around = ellipsoids.as_ref().map(|it| (Radii::Uniform(it.reach), it.description.clone()));
        let (spheres, guesses, radius_text) = match &around {
            Some((radii, text)) => {
                (Spheres { radii, radius_scale: 1.0, ..spheres }, None, format!("{radius_text}; {text}"))
            }
            None => (spheres, guesses, radius_text),
        };
        let images = self.args.look.images();
        let replicas = images.map(|images| Replicas::new(particles.cell(), images)).transpose()?;
        let (camera, outline, framing_text) = match kept.as_ref() {
            Some(kept) => (kept.camera, kept.outline.clone(), "framed as the first frame".to_string()),
            None => self.camera(spheres, replicas.as_ref(), guesses, &layers),
        };
        let colors = self.colors(&particles, kept.as_ref())?;
        let look = &self.args.look;
        let bonded =
            look.bonds.map(|which| bonding::find(&particles, which, look.bond_radius)).transpose()?;
        let moves =
            look.shutter.map(|exposure| displacements(&particles, &look.velocity, exposure)).transpose()?;
        let opacities = look.opacity.as_deref().map(|text| opacities(&particles, text)).transpose()?;
        // What layers do not say: they are opaque and stand still.
        let moves = moves.map(|moves| extended(moves, all, Vec3::ZERO));
        let opacities = opacities.map(|opacities| extended(opacities, all, 1.0));
        let arrows = self.args.shapes.arrows(spheres)?;
        // Beside layers it is noted of each particle whether it is shown.
        let (selection, (shown, share)) = match layers.is_empty() {
            true => (Some(Found::of(&self.args.selection, &particles)?), (None, None)),
            false => (None, selection::shown(&self.args.selection, &particles)?),
        };
        let cuts = self.args.cut.half_spaces(&particles);
        let numbers = layers::Numbers::of(&particles, self.layers, &look.color)?;
        if parts.is_some() && !numbers.is_empty() {
            let allowed =
                "without numbers of particles: these do not fit the memory with what each has of its own";
            return Err(Error::setting("--layers", "given", allowed).into());
        }
        let mut guesses = self.guesses(&conventions, count, &radius_text, &colors, &framing_text);
        guesses.extend(bonded.iter().map(|bonded| bonded.description.clone()));
        guesses.extend(arrows.iter().map(|arrows| arrows.description.clone()));
        guesses.extend(self.meshes.description());
        guesses.extend(layers.iter().map(|layer| layer.description.clone()));
        if is_first {
            self.report.note(format_args!("tyndall: {}", guesses.join(" · ")));
            let Settings { width, height, .. } = self.settings;
            let view = camera.view(particles.positions().origin(), width, height)?;
            let sample = opened.as_ref().map_or(spheres, |opened| opened.spheres(spheres.radius_scale));
            let has_spheres = ellipsoids.is_none() && !self.args.shapes.arrows_only && !frames_shown;
            if let Some(warning) = too_small(sample, &view).filter(|_| has_spheres) {
                self.report.warn(&warning);
            }
            if look.bonds.is_some() && look.radius.is_none() && look.radius_scale == 1.0 {
                let text = "note: bonds lie within the spheres where these touch; --radius-scale 0.25 shows balls and sticks";
                self.report.note(text);
            }
            let range = colors.legend.as_ref().and_then(range_of);
            let uniform = matches!(radii, Radii::Uniform(_)).then(|| radii.clone());
            *kept = Some(Kept {
                camera,
                outline: outline.clone(),
                uniform,
                range: range.filter(|_| self.args.frames.fixed_range),
                layers: sources::kept(&layers),
            });
        } else {
            self.report.detail(format_args!("frame {number}: {}", guesses.join(" · ")));
        }
        self.report.detail(format_args!("guessing: {}", seconds(guessing.elapsed().as_secs_f64())));
        if pictures.is_empty() && !frames_shown {
            return Ok(());
        }

        let building = Instant::now();
        let (time, dropped) = (particles.time(), particles.dropped().total());
        let units = [particles.time_unit(), particles.length_unit()].map(|it| it.map(str::to_string));
        let [time_unit, length_unit] = units.each_ref().map(Option::as_deref);
        let cell = particles.cell().copied();
        let (legend, color_text) = (colors.legend.clone(), colors.description.clone());
        // Where other shapes stand in their place, spheres are not seen.
        let no_spheres = ellipsoids.is_some() || self.args.shapes.arrows_only;
        let scale = if no_spheres { 0.0 } else { radius_scale };
        let origin = particles.positions().origin();
        let part = Part { particles, radii, radius_scale: scale, colors, glow: None, shown };
        let together = if layers.is_empty() {
            Together::alone(part)
        } else {
            Together::joined(Some(part), layers, origin)?
        };
        let Together { particles, radii, radius_scale: scale, colors, beside } = together;
        let ((structure, dropped), held) = match (&parts, opened) {
            (Some(parts), _) => (self.stream(parts, &radii, &colors)?, Held::NONE),
            (None, Some(Opened { mut structure, .. })) => {
                if scale != 1.0 {
                    structure.scale_radii(scale);
                }
                ((structure, dropped), Held::NONE)
            }
            (None, None) => {
                let (structure, held) =
                    self.renders.build(self.structure, particles, &radii, scale, self.report)?;
                ((structure, dropped), held)
            }
        };
        let secs = building.elapsed().as_secs_f64();
        self.report.detail(format_args!("build{}: {}", held.builder(), seconds(secs)));
        if let Some(error) = structure.packing_error() {
            let text = structure::packing_error(error);
            self.tell(is_first, &text);
            let by_axis = structure::packing_error_by_axis(error);
            self.report.detail(&by_axis);
            guesses.extend([text, by_axis]);
        }
        let mut scene = Scene::new(structure, colors, Lighting::Flat, self.background);
        if let Some(replicas) = &replicas {
            scene.replicate(replicas)?;
        }
        if let Some(bonded) = bonded.filter(|bonded| !bonded.segments.is_empty()) {
            scene.bond(&bonded.segments, bonded.radius)?;
        }
        if let Some(found) = &ellipsoids {
            scene.add_ellipsoids(&found.ellipsoids)?;
        }
        if let Some(arrows) = arrows.filter(|arrows| !arrows.arrows.is_empty()) {
            scene.add_arrows(&arrows.arrows, arrows.radius)?;
        }
        self.meshes.add_to(&mut scene)?;
        if let Some(warning) = self.args.shapes.add_cell(cell.as_ref(), &mut scene)? {
            self.report.warn(warning);
        }
        scene.set_opacity(opacities.as_deref())?;
        scene.set_motion(moves.as_deref())?;
        scene.set_cut(&cuts, self.args.cut.color());
        beside.add_to(&mut scene)?;
        let hidden = selection.map(|found| found.hide_others(&mut scene)).transpose()?.flatten();
        if let Some(text) = hidden.or(share) {
            self.tell(is_first, &text);
            guesses.push(text);
        }
        let shown = if frames_shown { self.shown(&scene, around.map(|(radii, _)| radii)) } else { None };
        if let (Some(kept), Some((camera, outline))) = (kept.as_mut(), &shown) {
            (kept.camera, kept.outline) = (*camera, outline.clone());
        }
        let (camera, outline) = shown.unwrap_or((camera, outline));
        if pictures.is_empty() {
            return Ok(());
        }
        let loading = Instant::now();
        let loaded = self.renders.load(&scene, held, self.report)?;
        self.report.detail(format_args!("upload: {}", seconds(loading.elapsed().as_secs_f64())));
        let entries = metadata::of_frame(self.args, sequence, number, time, &self.settings, &guesses);
        for (place, picture) in pictures.iter().enumerate() {
            let rendering = Instant::now();
            let camera = picture.camera(self.args, &self.viewpoint, (&camera, &outline))?;
            self.set_light(&mut scene, dropped, &camera)?;
            let annotated = Annotated {
                behind: self.behind(),
                colors: (legend.as_ref(), &color_text),
                frame: number,
                time: (time, time_unit),
                length_unit,
                cell,
            };
            output.check(&annotated, &camera)?;
            let whole = |scene: &Scene, camera: &Camera| {
                loaded.image(scene, camera, (&self.settings, self.goal), self.report)
            };
            let shot = Shot {
                picture: &self.args.picture,
                layers: self.layers,
                numbers: &numbers,
                settings: &self.settings,
                goal: self.goal,
                illustration: self.illustration,
                report: self.report,
                whole: &whole,
            };
            let options = self.args.picture.options(metadata::of_picture(entries.clone(), picture));
            let since = if place == 0 { start } else { rendering };
            if let Some(rows) = self.band_rows(&picture.path) {
                let band = |first| shot.band(&scene, &camera, first, rows);
                let over = output.bands(&camera, &annotated, || shot.preview(&scene, &camera))?;
                let of_band = (matches!(self.behind(), Behind::Nothing), options);
                if !output.write_bands(&picture.path, of_band, over, band, || since.elapsed())? {
                    return Err(self.unseen(&scene, dropped, &camera));
                }
            } else {
                let taken = shot.take(&mut scene, &camera)?;
                if taken.shows_nothing() && self.args.picture.crop.is_none() {
                    return Err(self.unseen(&scene, dropped, &camera));
                }
                self.report.detail(format_args!("render: {}", seconds(rendering.elapsed().as_secs_f64())));
                output.write(&picture.path, (taken, options), &annotated, || since.elapsed())?;
            }
            *written += 1;
            if progress::stopped() {
                return Err(Error::Interrupted.into());
            }
        }
        Ok(())
    }

    /// The error about a picture that shows nothing.
    fn unseen(&self, scene: &Scene, dropped: u64, camera: &Camera) -> Failure {
        if let Some(why) = self.args.cut.why_unseen(scene) {
            return Failure::Unseen(why);
        }
        let Settings { width, height, .. } = self.settings;
        match camera.view(scene.structure().origin(), width, height) {
            Ok(view) => Failure::Unseen(why_unseen(scene.structure(), dropped, &view)),
            Err(error) => error.into(),
        }
    }

    /// The ellipsoids of a frame. Where a picture is made that knows spheres alone, particles that only the file has as ellipsoids are spheres, which is
    /// said.
    fn ellipsoids(&self, spheres: Spheres, is_first: bool) -> Outcome<Option<Ellipsoids>> {
        let found = self.args.shapes.ellipsoids(spheres)?;
        let with = [
            (matches!(self.settings.culling, Culling::Confidence(_)), "--culling confidence"),
            (matches!(self.args.method.device, device::Choice::Gpu(_)), "--device gpu"),
        ];
        let refused = with.into_iter().find_map(|(is_so, name)| is_so.then_some(name));
        if let (Some(_), Some(name)) = (&found, refused) {
            self.tell(is_first, &format!("note: the file has ellipsoids, which are spheres with {name}"));
        }
        Ok(found.filter(|_| refused.is_none()))
    }

    /// Says what concerns a frame: of the first to all, of others to the curious.
    fn tell(&self, is_first: bool, text: &str) {
        if is_first {
            self.report.note(text);
        } else {
            self.report.detail(text);
        }
    }

    /// What is behind the particles.
    fn behind(&self) -> Behind {
        match (self.background, &self.lights) {
            (Some(color), _) => Behind::Color(color),
            (None, Some(Lights::Image { is_seen: true, .. })) => Behind::Picture,
            (None, _) => Behind::Nothing,
        }
    }

    /// Lights the scene for a camera. Fails if there is nothing to light.
    fn set_light(&self, scene: &mut Scene, dropped: u64, camera: &Camera) -> Outcome<()> {
        let Settings { width, height, .. } = self.settings;
        let view = camera.view(scene.structure().origin(), width, height)?;
        if scene.structure().is_empty() {
            return Err(Failure::Unseen(why_unseen(scene.structure(), dropped, &view)));
        }
        let adjustments = looks::adjustments(self.args, camera, self.lights.clone());
        let axes = [view.forward, view.right, view.up];
        scene.lighting = looks::look(self.args.look.look).unwrap_or_default().lighting(axes, &adjustments);
        Ok(())
    }

    fn radii(
        &self,
        particles: &Particles,
        guesses: Option<&Guesses>,
        kept: Option<&Kept>,
    ) -> (Radii, String) {
        let (radii, mut text) = match (self.asked_radius(kept), particles.radii(), guesses) {
            (Some(found), ..) => found,
            (None, Some(radii), Some(guesses)) => (radii.clone(), guesses.radii.clone()),
            (None, ..) => automatic::radii(particles),
        };
        let scale = self.args.look.radius_scale;
        if scale != 1.0 {
            text += &format!(", scaled by {}", short(scale.into()));
        }
        (radii, text)
    }

    /// The radius that is given, or kept from the first frame.
    fn asked_radius(&self, kept: Option<&Kept>) -> Option<(Radii, String)> {
        match (self.args.look.radius, kept.and_then(|kept| kept.uniform.clone())) {
            (Some(radius), _) => {
                Some((Radii::Uniform(radius), format!("radius {} given", short(radius.into()))))
            }
            (None, kept) => kept.map(|radii| (radii, "radius of the first frame".into())),
        }
    }

    fn camera(
        &self,
        spheres: Spheres,
        replicas: Option<&Replicas>,
        guesses: Option<&Guesses>,
        layers: &[sources::Frame],
    ) -> (Camera, Outline, String) {
        let outliers = if self.args.camera.frame_all { Outliers::Shown } else { Outliers::Left };
        let guessed = guesses.filter(|_| spheres.radius_scale == 1.0);
        let shown = guessed.map_or_else(|| Shown::of(spheres, outliers), |it| it.shown(outliers).clone());
        let Shown { framing, outline } = shown;
        let outline = replicas.map_or_else(|| outline.clone(), |replicas| outline.replicated(replicas));
        let others = layers.iter().map(|layer| layer.outline.clone());
        let outline = Outline::joined(&std::iter::once(outline).chain(others).collect::<Vec<_>>());
        let aspect = f64::from(self.settings.width) / f64::from(self.settings.height);
        let camera = self.viewpoint.camera(&outline, aspect);
        if self.viewpoint.eye.is_some() {
            return (camera, outline, "camera given".into());
        }
        if self.viewpoint.lens == Lens::Panorama {
            return (camera, outline, "panorama from the middle".into());
        }
        if self.args.camera.frame_shown {
            return (camera, outline, "framed on what is shown".into());
        }
        if !layers.is_empty() {
            return (camera, outline, "framed on all layers".into());
        }
        if let Some(warning) = framing.warning {
            self.report.warn(&warning);
        }
        (camera, outline, framing.description)
    }

    /// The camera that frames what a scene shows, and the outline of that; none if nothing is shown. `around` are radii of the spheres around other shapes that stand in
    /// place of spheres.
    fn shown(&self, scene: &Scene, around: Option<Radii>) -> Option<(Camera, Outline)> {
        let outliers = if self.args.camera.frame_all { Outliers::Shown } else { Outliers::Left };
        let least_radius = match around {
            Some(Radii::Uniform(radius)) => radius,
            _ => 0.0,
        };
        let (Shown { framing, outline }, particles) = Shown::of_scene(scene, least_radius, outliers)?;
        let Settings { width, height, .. } = self.settings;
        let camera = self.viewpoint.camera(&outline, f64::from(width) / f64::from(height));
        if let Some(warning) = framing.warning.filter(|_| self.viewpoint.eye.is_none()) {
            self.report.warn(&warning);
        }
        let spheres = Spheres { particles: &particles, radii: particles.radii()?, radius_scale: 1.0 };
        let view = camera.view(scene.structure().origin(), width, height).ok()?;
        if let Some(warning) = too_small(spheres, &view).filter(|_| !self.args.shapes.arrows_only) {
            self.report.warn(&warning);
        }
        Some((camera, outline))
    }

    fn colors(&self, particles: &Particles, kept: Option<&Kept>) -> Outcome<ParticleColors> {
        let look = &self.args.look;
        let mapping = look.mapping();
        let mapping = match kept.and_then(|kept| kept.range) {
            Some((norm, range)) => Mapping { norm: Some(norm), range, ..mapping },
            None => mapping,
        };
        Ok(resolve(particles, &look.color, &mapping)?)
    }

    /// All that was chosen and guessed, piece by piece.
    fn guesses(
        &self,
        conventions: &[String],
        count: usize,
        radius: &str,
        colors: &ParticleColors,
        framing: &str,
    ) -> Vec<String> {
        let name = structure::name(self.structure);
        let Settings { width, height, samples, .. } = self.settings;
        let mut guesses = vec![format!("{name}, {}", self.renders.name())];
        guesses.push(counted(count, "particle"));
        if let Some([x, y, z]) = self.args.look.images() {
            guesses.push(format!("in {x}×{y}×{z} periodic images"));
        }
        guesses.extend(conventions.iter().cloned());
        guesses.extend([radius.to_string(), colors.description.clone(), framing.to_string()]);
        guesses.push(format!("{width}x{height}, {samples} samples"));
        guesses.extend(looks::description(self.args));
        guesses.extend(self.args.cut.description());
        guesses.extend(self.lights.as_ref().and_then(lights::description));
        if self.settings.culling != Culling::default() {
            guesses.push(culling::description(&self.settings.culling));
        }
        guesses
    }
}

/// The same with as many more `values` as make `count`.
fn extended<T: Clone>(mut values: Vec<T>, count: usize, value: T) -> Vec<T> {
    values.resize(count, value);
    values
}

/// How numbers are spread, and over which range, if colors stand for numbers.
pub(crate) fn range_of(legend: &Legend) -> Option<(Norm, Range)> {
    match &legend.key {
        Key::Amounts(scale) => Some((scale.norm, Range::Given(scale.low, scale.high))),
        Key::Kinds(_) => None,
    }
}

/// What the command line says about the camera.
pub(crate) fn viewpoint(args: &args::Render) -> Outcome<Viewpoint> {
    let camera = &args.camera;
    let [width, height] = args.picture.pixels().map(f64::from);
    let aspect = width / height;
    let lens = match (camera.ortho, camera.fov, camera.horizontal_fov) {
        (Some(ortho), ..) => Lens::Orthographic { height: ortho.0 },
        (None, Some(Degrees(fov)), _) | (None, None, Some(Degrees(fov))) if !(fov > 0.0 && fov < 180.0) => {
            let name = if camera.fov.is_some() { "--fov" } else { "--horizontal-fov" };
            return Err(Error::setting(name, fov, "between 0 and 180 degrees").into());
        }
        (None, Some(Degrees(fov)), _) => Lens::Perspective { vertical_angle: fov.to_radians() },
        (None, None, Some(Degrees(fov))) => {
            Lens::Perspective { vertical_angle: 2.0 * ((0.5 * fov.to_radians()).tan() / aspect).atan() }
        }
        (None, None, None) if camera.panorama => Lens::Panorama,
        (None, None, None) => Lens::Perspective { vertical_angle: VERTICAL_ANGLE },
    };
    let motion = if args.frames.orbit.is_some() { Motion::Orbit } else { Motion::Still };
    let side = camera.view.unwrap_or_default();
    Ok(Viewpoint { eye: camera.eye, look_at: camera.look_at, up: camera.up, side, lens, motion })
}
