//! `tyndall render`: particles to a picture, or to numbered pictures.
//!
//! What is not said is guessed from the first frame: camera and radius are kept for all frames, so that nothing jumps; the color
//! range follows each frame unless it is fixed. A frame that fails does not stop the others.

mod frame;
mod guesses;
mod reading;

use std::path::Path;

use tyndall::particles::Radii;
use tyndall::render::estimate::Work;
use tyndall::render::illustration::Illustration;
use tyndall::render::{Culling, Settings};
use tyndall::scene::camera::{Camera, VERTICAL_ANGLE};
use tyndall::scene::color::{Key, Legend};
use tyndall::scene::coloring::{Norm, Range};
use tyndall::scene::light::Lights;
use tyndall::scene::outline::Outline;
use tyndall::scene::viewpoint::{Lens, Motion, Viewpoint};
use tyndall::scene::wanted::Wanted;
use tyndall::structure::Kind;
use tyndall::{DVec3, Error};
use tyndall_io::Sequence;
use tyndall_io::annotation::Behind;

use crate::args::{self, Mode};
use crate::device::{self, Goal, Renders};
use crate::layers::{self, Layer, Named};
use crate::names::Numbers;
use crate::output::{Output, Pattern};
use crate::plan::{self, Picture};
use crate::report::{Failure, Outcome, Report, counted};
use crate::shapes::Meshes;
use crate::shot;
use crate::sources::{self, Sources};
use crate::values::{Background, Degrees};
use crate::{ahead, culling, dry_run, illustrate, input, lights, looks, medium, project, structure};

/// Renders what the command line asks for.
pub(crate) fn run(args: &args::Render, report: &Report) -> Outcome<()> {
    args.origin.begin(report)?;
    check_center(args)?;
    match sources::parted(args)? {
        (Some(medium), spheres) => return medium::run(medium, &spheres, report),
        (None, _) if args.method.mode == Mode::Project => return project::run(args, report),
        (None, _) => {}
    }
    let mut job = Job::new(args, report)?;
    // What cannot work is refused before the reading.
    let mut output = Output::new(args, report)?;
    let known = input::known_count(&args.input.files)?;
    job.check_memory(&Work::of_count(known, job.structure, job.settings), Reading::Parts)?;
    let of_layers = layers::quantities(&job.layers).map(String::from);
    let wanted = Wanted {
        coloring: args.look.color.clone(),
        filters: args.selection.all_filters(),
        quantities: args.look.quantities().map(String::from).chain(of_layers).collect(),
        radii: args.look.radius.is_none() || args.look.bonds.is_some(),
        vectors: args.look.moving().map(String::from).into_iter().chain(args.shapes.vectors()).collect(),
        ..Wanted::default()
    };
    let sequence = input::open(&args.input, Some(wanted), report)?;
    job.sources.check(sequence.len())?;
    let pictures = plan::pictures(args, &job.pattern, &Numbers::of(&args.input, sequence.len()), report)?;
    if args.method.dry_run {
        return job.dry_run(&sequence, &pictures);
    }
    job.surveyed = job.survey(&sequence)?;
    let frames = plan::frames_to_read(&pictures, args.frames.skip_existing);
    let done = ahead::reading(&sequence, &frames, args.method.memory, |ahead| {
        plan::each_frame(&pictures, args.frames.skip_existing, report, |frame, wanted, kept, written| {
            job.pictures_of_frame((&sequence, ahead), frame, wanted, kept, (&mut output, written))
        })
    });
    output.finish(done)
}

/// Refuses to measure particles from a center beside what has coordinates of its own.
fn check_center(args: &args::Render) -> Outcome<()> {
    let beside = [
        (!args.layers.sources.is_empty(), "--layer"),
        (args.shapes.has_meshes(), "--mesh"),
        (args.shapes.holdout().is_some(), "--holdout"),
        (args.camera.described().is_some(), "the camera of a stage"),
    ];
    match beside.into_iter().find(|(is_given, _)| *is_given && args.input.center.is_some()) {
        Some((_, name)) => Err(Failure::Usage(format!(
            "--center measures the particles of one source anew, and {name} would stay where it is — try --look-at X,Y,Z instead of --center"
        ))),
        None => Ok(()),
    }
}

/// The most samples of a pixel where noise or time decides, if nothing is said.
pub(crate) const MOST_SAMPLES: u32 = 4096;

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
    layers: Vec<Named>,
    renders: Renders,
    goal: Goal,
    meshes: Meshes,
    sources: Sources<'a>,
    /// Of the whole sequence, if that is framed.
    surveyed: Surveyed,
}

/// What the frames of a sequence have in common.
#[derive(Default)]
struct Surveyed {
    outlines: Vec<Outline>,
    range: Option<(Norm, Range)>,
}

impl<'a> Job<'a> {
    fn new(args: &'a args::Render, report: &'a Report) -> Outcome<Self> {
        let args::Picture { samples, seed, background, .. } = &args.picture;
        let [width, height] = args.picture.pixels();
        let goal = Goal { noise: args.medium.most_noise(), time: args.picture.time };
        if args.medium.position_noise().is_some() {
            let text = "position noise is for --mode medium; of spheres --noise 1% is how much may be left";
            return Err(Failure::Usage(text.into()));
        }
        if args.medium.denoise {
            return Err(Failure::Usage("--denoise is for --mode medium; of spheres take --noise 1%".into()));
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
        let shape = args.look.bonds.map(|_| "--bonds").or(args.shapes.name()).or(args.shapes.holdout());
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
        if let (Some(drawn), Some(_)) = (args.illustrate.name(), args.shapes.holdout()) {
            let text =
                format!("{drawn} is not for --holdout, over which it would draw — leave out one of them");
            return Err(Failure::Usage(text));
        }
        if args.look.moving().is_some() && args.picture.wants_surfaces() {
            let allowed =
                "without normal and position with --shutter and --motion-blur: what moves has several";
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
            surveyed: Surveyed::default(),
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
    let look_at = camera.look_at.or(args.input.center.as_ref().map(|_| DVec3::ZERO));
    Ok(Viewpoint { eye: camera.eye, look_at, up: camera.up, side, lens, motion })
}
