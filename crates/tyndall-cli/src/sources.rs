//! `--layer`: particles beside those of the command line in the same picture, each with colors, radii and choice of its own.

use tyndall::particles::{Particles, Radii};
use tyndall::scene::bonding::{self, Bonded};
use tyndall::scene::color::{ParticleColors, resolve};
use tyndall::scene::coloring::{Mapping, Norm, Range};
use tyndall::scene::guesses::Shown;
use tyndall::scene::joined::{Hidden, Joined, Part, join};
use tyndall::scene::outline::Outline;
use tyndall::scene::sizes::Size;
use tyndall::scene::wanted::Wanted;
use tyndall::scene::{Scene, automatic, short};
use tyndall::structure::Spheres;
use tyndall::structure::shapes::Segment;
use tyndall::{DVec3, Error};
use tyndall_io::Sequence;

use crate::args::{Mode, Render};
use crate::medium::emission;
use crate::report::{Failure, Outcome, Report, counted};
use crate::{input, looks, medium, render, selection};

/// Whether what is asked for is seen as a medium.
pub(crate) fn is_medium(args: &Render) -> Outcome<bool> {
    let by_look = args.method.mode == Mode::Spheres && looks::look(args.look.look).is_none();
    let is_grid = args.origin.grid.is_some() || medium::are_grids(&args.input.files)?;
    Ok(args.method.mode == Mode::Medium || by_look || is_grid)
}

/// The one of the layers that is a medium, if one is, and those that are spheres. Fails if several are media.
pub(crate) fn parted(args: &Render) -> Outcome<(Option<&Render>, Vec<&Render>)> {
    let (mut medium, mut spheres) = (None, Vec::new());
    for layer in std::iter::once(args).chain(&args.layers.sources) {
        let name = || layer.input.files.first().map_or(String::new(), |file| file.display().to_string());
        if layer.method.mode == Mode::Project && !args.layers.sources.is_empty() {
            let text =
                format!("{}: a map of numbers has no layers — leave out --mode project or --layer", name());
            return Err(Failure::Usage(text));
        }
        match is_medium(layer)? {
            false => spheres.push(layer),
            true if medium.replace(layer).is_some() => {
                let text =
                    format!("{}: one layer of a picture is a medium, this would be another one", name());
                return Err(Failure::Usage(text));
            }
            true => {}
        }
    }
    Ok((medium, spheres))
}

/// What is kept of a source's first frame.
#[derive(Clone)]
pub(crate) struct Kept {
    uniform: Option<Radii>,
    range: Option<(Norm, Range)>,
}

/// A layer of spheres.
struct Source<'a> {
    args: &'a Render,
    sequence: Sequence,
}

/// Layers of spheres.
pub(crate) struct Sources<'a>(Vec<Source<'a>>);

/// A frame of a layer.
pub(crate) struct Frame {
    pub(crate) part: Part,
    pub(crate) outline: Outline,
    bonded: Option<Bonded>,
    /// What was chosen and guessed.
    pub(crate) description: String,
    kept: Kept,
}

impl<'a> Sources<'a> {
    /// Opens their files.
    pub(crate) fn open(layers: &[&'a Render], report: &Report) -> Outcome<Self> {
        let open = |args: &&'a Render| {
            let look = &args.look;
            let wanted = Wanted {
                coloring: look.color.clone(),
                filters: args.selection.all_filters(),
                quantities: look.quantities().map(String::from).collect(),
                radii: look.radius.is_none() || look.bonds.is_some(),
                ..Wanted::default()
            };
            Ok(Source { args, sequence: input::open(&args.input, Some(wanted), report)? })
        };
        Ok(Self(layers.iter().map(open).collect::<Outcome<_>>()?))
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Frames of that which has most.
    pub(crate) fn frames(&self) -> usize {
        self.0.iter().map(|it| it.sequence.len()).max().unwrap_or(0)
    }

    /// Fails if a layer has another number of frames than the `count` of what it is shown with, and more than one.
    pub(crate) fn check(&self, count: usize) -> Outcome<()> {
        let other = self.0.iter().find(|it| it.sequence.len() != 1 && it.sequence.len() != count);
        let Some(other) = other else { return Ok(()) };
        let given = format!("{} with {}", other.sequence.name(0), counted(other.sequence.len(), "frame"));
        let allowed =
            format!("a layer has one frame, or as many as what it is shown with, which has {count}");
        Err(Error::setting("--layer", given, allowed).into())
    }

    /// Reads the frame of that number of each, the first of those that have one. `kept` is what was kept of the first frame, of as many.
    pub(crate) fn read(&self, number: usize, kept: &[Kept], report: &Report) -> Outcome<Vec<Frame>> {
        self.0.iter().enumerate().map(|(place, it)| it.read(number, kept.get(place), report)).collect()
    }
}

impl Source<'_> {
    fn read(&self, number: usize, kept: Option<&Kept>, report: &Report) -> Outcome<Frame> {
        let Render { input, look, selection, .. } = self.args;
        let number = number.min(self.sequence.len() - 1);
        let frame = input::read(&self.sequence, number, input, report)?;
        let particles = input::sized(frame.particles, look.radius.as_ref(), input, report)?;
        let (radii, mut text) = match (&look.radius, kept.and_then(|kept| kept.uniform.clone())) {
            (None, Some(radii)) => (radii, "radius of the first frame".into()),
            (asked, _) => {
                asked.as_ref().and_then(Size::uniform).unwrap_or_else(|| automatic::radii(&particles))
            }
        };
        if look.radius_scale != 1.0 {
            text += &format!(", scaled by {}", short(look.radius_scale.into()));
        }
        let mapping = match kept.and_then(|kept| kept.range) {
            Some((norm, range)) => Mapping { norm: Some(norm), range, ..look.mapping() },
            None => look.mapping(),
        };
        let colors = resolve(&particles, &look.color, &mapping)?;
        let bonded =
            look.bonds.map(|which| bonding::find(&particles, which, look.bond_radius)).transpose()?;
        let (glow, glowing) = emission::of_spheres(self.args, &particles)?.unzip();
        let (shown, share) = selection::shown(selection, &particles)?;
        let spheres = Spheres { particles: &particles, radii: &radii, radius_scale: look.radius_scale };
        let outliers = self.args.camera.outliers();
        let Shown { outline, .. } = Shown::of(spheres, outliers);

        let name = self.sequence.name(number);
        let mut pieces = vec![format!("layer {name}: {}", counted(particles.len(), "particle"))];
        pieces.extend(frame.conventions);
        pieces.extend([text, colors.description.clone()]);
        pieces.extend(bonded.as_ref().map(|bonded| bonded.description.clone()));
        pieces.extend(glowing.into_iter().chain(share));
        let range = colors.legend.as_ref().and_then(render::range_of);
        let kept = Kept {
            uniform: matches!(radii, Radii::Uniform(_)).then(|| radii.clone()),
            range: range.filter(|_| self.args.frames.fixed_range),
        };
        let part = Part { particles, radii, radius_scale: look.radius_scale, colors, glow, shown };
        Ok(Frame { part, outline, bonded, description: pieces.join(", "), kept })
    }
}

/// What is kept of first frames.
pub(crate) fn kept(frames: &[Frame]) -> Vec<Kept> {
    frames.iter().map(|frame| frame.kept.clone()).collect()
}

/// Particles as they are arranged: alone, or with those of layers.
pub(crate) struct Together {
    pub(crate) particles: Particles,
    pub(crate) radii: Radii,
    pub(crate) radius_scale: f32,
    pub(crate) colors: ParticleColors,
    pub(crate) beside: Beside,
}

/// What belongs to layers beside particles.
#[derive(Default)]
pub(crate) struct Beside {
    /// Bonds, between particles among all.
    bonds: Vec<(Vec<Segment>, f32)>,
    glow: Option<Vec<[f32; 3]>>,
    hidden: Hidden,
}

impl Together {
    pub(crate) fn alone(part: Part) -> Self {
        let Part { particles, radii, radius_scale, colors, .. } = part;
        Self { particles, radii, radius_scale, colors, beside: Beside::default() }
    }

    /// Joins frames of layers to what stands before them; positions are measured from `origin`.
    pub(crate) fn joined(before: Option<Part>, frames: Vec<Frame>, origin: DVec3) -> Outcome<Self> {
        let mut parts: Vec<Part> = before.into_iter().collect();
        let mut bonded = Vec::new();
        for Frame { part, bonded: of_layer, .. } in frames {
            bonded.extend(of_layer.map(|it| (parts.len(), it)));
            parts.push(part);
        }
        let Joined { particles, radii, colors, starts, glow, hidden } = join(parts, origin)?;
        let bonds = bonded.into_iter().map(|(place, it)| (starts[place].segments(&it.segments), it.radius));
        let beside = Beside { bonds: bonds.collect(), glow, hidden };
        Ok(Self { particles, radii, radius_scale: 1.0, colors, beside })
    }
}

impl Beside {
    /// Shows bonds in the scene of the particles, and hides what is not shown.
    pub(crate) fn add_to(self, scene: &mut Scene) -> Outcome<()> {
        for (segments, radius) in self.bonds.iter().filter(|(segments, _)| !segments.is_empty()) {
            scene.bond(segments, *radius)?;
        }
        scene.set_glow(self.glow.as_deref())?;
        Ok(self.hidden.apply(scene)?)
    }
}
