//! Which device renders: `--device`, and the list of `tyndall devices`.

use std::str::FromStr;
use std::time::{Duration, Instant};

use tyndall::render::refine::Quality;
use tyndall::render::{Culling, Renderer, Settings};
use tyndall::scene::Scene;
use tyndall::scene::camera::Camera;
use tyndall::structure::Kind;
use tyndall::{Error, Image, Result};

use crate::args::Builder;
use crate::culling;
use crate::report::Report;

/// What `--device` says.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) enum Choice {
    /// A card if there is one and the particles fit, else the processor.
    #[default]
    Auto,
    /// The processor.
    Cpu,
    /// A card, or a program that does what one would; part of its name.
    Gpu(Option<String>),
}

impl FromStr for Choice {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text.split_once(':').unwrap_or((text, "")) {
            ("auto", "") => Ok(Self::Auto),
            ("cpu", "") => Ok(Self::Cpu),
            ("gpu", "") => Ok(Self::Gpu(None)),
            ("gpu", name) => Ok(Self::Gpu(Some(name.to_string()))),
            _ => Err(Error::setting(
                "--device",
                text,
                "auto, cpu, gpu or gpu:NAME; `tyndall devices` has the names",
            )),
        }
    }
}

#[cfg(feature = "gpu")]
pub(crate) use card::{Held, Renders, list};
#[cfg(not(feature = "gpu"))]
pub(crate) use processor::{Held, Renders, list};

/// What decides where structures and pictures are made.
#[cfg_attr(not(feature = "gpu"), expect(dead_code, reason = "the processor makes all"))]
#[derive(Clone, Copy)]
pub(crate) struct Work {
    pub(crate) structure: Kind,
    pub(crate) culling: Culling,
    pub(crate) build: Builder,
    /// What cards do not draw, if anything of that is wanted, as the command line calls it.
    pub(crate) beyond_cards: Option<&'static str>,
}

/// Fails if a card is to draw or build what it does not.
fn check(choice: &Choice, work: Work) -> Result<()> {
    if let (Some(wanted), Choice::Gpu(_)) = (work.beyond_cards, choice) {
        return Err(Error::setting(
            "--device",
            "gpu",
            format!("auto or cpu with {wanted}: cards do not draw that"),
        ));
    }
    let allowed = match (work.build, work.structure, choice) {
        (Builder::Gpu, _, Choice::Cpu) => "cpu with --device cpu",
        (Builder::Gpu, Kind::Pkd(_) | Kind::Treelets(_) | Kind::Brute, _) => {
            "cpu for structures other than bvh"
        }
        _ => return Ok(()),
    };
    Err(Error::setting("--build", "gpu", allowed))
}

/// How a picture is made beside its settings.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Goal {
    /// How much noise may be left, if that is asked for.
    pub(crate) noise: Option<f32>,
    /// How long samples are added, if that is asked for.
    pub(crate) time: Option<Duration>,
}

impl Goal {
    /// Whether samples are added as they are needed.
    pub(crate) fn is_given(&self) -> bool {
        self.name().is_some()
    }

    /// The option that asks for it.
    pub(crate) fn name(&self) -> Option<&'static str> {
        self.noise.map(|_| "--noise").or(self.time.map(|_| "--time"))
    }

    /// That of a share of the picture, from 0 to 1.
    pub(crate) fn of_share(self, share: f64) -> Self {
        Self { time: self.time.map(|time| time.mul_f64(share)), ..self }
    }

    /// Says from now on whether the time is over.
    pub(crate) fn is_late(self) -> impl FnMut() -> bool {
        let start = Instant::now();
        move || self.time.is_some_and(|time| start.elapsed() >= time)
    }
}

/// Says what a picture came to.
pub(crate) fn tell(Quality { noise, samples: [least, most] }: Quality, report: &Report) {
    let text =
        if noise.is_finite() { format!("noise {:.2} %", 100.0 * noise) } else { "noise unknown".into() };
    report.note(format_args!("{text}, {least} to {most} samples"));
}

/// A picture by the processor, with what culling saved.
fn on_processor(
    scene: &Scene,
    camera: &Camera,
    (settings, goal): (&Settings, Goal),
    report: &Report,
) -> Result<Image> {
    let mut renderer = Renderer::new(scene, camera, settings)?;
    complete(&mut renderer, goal, report)?;
    culling::tell(&settings.culling, &renderer.counts(), report);
    if let Some(found) = renderer.confidence().filter(|_| report.is_verbose()) {
        culling::tell_confidence(&found, report);
    }
    Ok(renderer.image())
}

/// Takes the samples of a picture: all of them, or as many as the goal needs, which is said.
pub(crate) fn complete(renderer: &mut Renderer, goal: Goal, report: &Report) -> Result<()> {
    if goal.is_given() {
        let mut is_late = goal.is_late();
        tell(renderer.refine(goal.noise.unwrap_or(0.0), &mut is_late, report.progress())?, report);
    } else {
        renderer.finish(report.progress())?;
    }
    Ok(())
}

/// With the feature `gpu`.
#[cfg(feature = "gpu")]
mod card {
    use tyndall::particles::{Particles, Radii};
    use tyndall::render::gpu::{self, AdapterInfo, Gpu, Hierarchy, Options, Resident};
    use tyndall::render::{Culling, Settings};
    use tyndall::scene::Scene;
    use tyndall::scene::camera::Camera;
    use tyndall::structure::{Kind, Spheres, Structure};
    use tyndall::{Error, Image, Result};

    use super::{Choice, Goal, Work, check, on_processor};
    use crate::args::Builder;
    use crate::culling;
    use crate::report::{Outcome, Report, bytes};

    /// One line a device, as `--device` names it.
    pub(crate) fn list(report: &Report) -> Outcome<()> {
        let line = |info: &AdapterInfo| {
            let AdapterInfo { name, kind, driver, .. } = info;
            let memory = info.memory_bytes.map_or("not told".into(), bytes);
            let (binding, buffer) = (bytes(info.binding_bytes), bytes(info.buffer_bytes));
            format!(
                "gpu:{name} · {kind} · {driver} · memory {memory}, {buffer} a buffer, {binding} a binding\n"
            )
        };
        let cards: String = gpu::adapters().iter().map(line).collect();
        report.out(&format!("cpu · {} threads\n{cards}", rayon::current_num_threads()))
    }

    /// What renders pictures.
    pub(crate) enum Renders {
        Processor,
        Card {
            gpu: Box<Gpu>,
            /// Whether nothing else will do.
            is_asked_for: bool,
            builder: Builder,
        },
    }

    /// What the card holds of a structure before the scene is complete.
    pub(crate) struct Held<'a>(Option<Hierarchy<'a>>);

    impl Held<'_> {
        /// Nothing.
        pub(crate) const NONE: Self = Self(None);

        /// Where the structure was built, for those who want to know how long it took.
        pub(crate) fn builder(&self) -> &'static str {
            if self.0.is_some() { " on the card" } else { "" }
        }
    }

    impl Renders {
        /// Opens the device. `auto` says in a line if there is no card.
        pub(crate) fn new(choice: &Choice, work: Work, report: &Report) -> Outcome<Self> {
            check(choice, work)?;
            let is_lossy = matches!(work.culling, Culling::Confidence(_));
            let options = match choice {
                Choice::Cpu => return Ok(Self::Processor),
                // What is there to be compared is compared on one kind of machine, wherever the command runs, unless a card is asked for.
                Choice::Auto if is_lossy || !matches!(work.structure, Kind::Bvh(_)) => {
                    return Ok(Self::Processor);
                }
                Choice::Auto if let Some(wanted) = work.beyond_cards => {
                    let threads = rayon::current_num_threads();
                    report.note(format_args!(
                        "note: cards do not draw {wanted}; CPU backend, {threads} threads"
                    ));
                    return Ok(Self::Processor);
                }
                Choice::Auto => Options { hardware_only: true, ..Options::default() },
                Choice::Gpu(name) => Options { name: name.clone(), ..Options::default() },
            };
            let is_asked_for = *choice != Choice::Auto;
            match Gpu::open(options) {
                Ok(gpu) => Ok(Self::Card { gpu: Box::new(gpu), is_asked_for, builder: work.build }),
                Err(Error::Device(why)) if !is_asked_for => {
                    let threads = rayon::current_num_threads();
                    report.note(format_args!("note: {why}; CPU backend, {threads} threads"));
                    Ok(Self::Processor)
                }
                Err(error) => Err(error.into()),
            }
        }

        /// What it is called.
        pub(crate) fn name(&self) -> String {
            match self {
                Self::Processor => format!("cpu {} threads", rayon::current_num_threads()),
                Self::Card { gpu, .. } => format!("gpu {}", gpu.info().name),
            }
        }

        /// Arranges particles. What a card has no room for, the processor builds, unless the card was asked for.
        pub(crate) fn build(
            &self,
            kind: Kind,
            particles: Particles,
            radii: &Radii,
            radius_scale: f32,
            report: &Report,
        ) -> Outcome<(Structure, Held<'_>)> {
            let progress = report.progress();
            if let (Self::Card { gpu, is_asked_for, builder: Builder::Gpu }, Kind::Bvh(packing)) =
                (self, kind)
            {
                let spheres = Spheres { particles: &particles, radii, radius_scale };
                match Hierarchy::build(gpu, spheres, packing, progress) {
                    Ok(hierarchy) => {
                        let structure = hierarchy.structure(particles, radii, radius_scale, progress)?;
                        return Ok((structure, Held(Some(hierarchy))));
                    }
                    Err(error) if *is_asked_for || matches!(error, Error::Interrupted) => {
                        return Err(error.into());
                    }
                    Err(error) => tell_why_not(&error, report),
                }
            }
            let structure = Structure::build(kind, particles, radii, radius_scale, progress)?;
            Ok((structure, Held::NONE))
        }

        /// Makes the scene ready. What a card has no room for, the processor renders, unless the card was asked for.
        pub(crate) fn load(&self, scene: &Scene, held: Held<'_>, report: &Report) -> Outcome<Loaded> {
            let Self::Card { gpu, is_asked_for, .. } = self else { return Ok(Loaded::Processor) };
            let loaded = match held.0 {
                Some(hierarchy) => Resident::built(hierarchy, scene, report.progress()),
                None => Resident::load(gpu, scene, report.progress()),
            };
            match loaded {
                Ok(resident) => Ok(Loaded::Card(Box::new(resident))),
                Err(error) if *is_asked_for || matches!(error, Error::Interrupted) => Err(error.into()),
                Err(error) => {
                    tell_why_not(&error, report);
                    Ok(Loaded::Processor)
                }
            }
        }
    }

    fn tell_why_not(error: &Error, report: &Report) {
        match error {
            Error::Memory { what, needed_bytes, available_bytes, .. } => report.note(format_args!(
                "{what} needs {}, the card offers {}: using the CPU",
                bytes(*needed_bytes),
                bytes(*available_bytes)
            )),
            error => report.note(format_args!("{error}: using the CPU")),
        }
    }

    /// A scene that is ready.
    pub(crate) enum Loaded {
        Processor,
        Card(Box<Resident>),
    }

    impl Loaded {
        /// A picture of the scene that was loaded, with whatever light it has now.
        pub(crate) fn image(
            &self,
            scene: &Scene,
            camera: &Camera,
            (settings, goal): (&Settings, Goal),
            report: &Report,
        ) -> Result<Image> {
            match self {
                Self::Processor => on_processor(scene, camera, (settings, goal), report),
                Self::Card(resident) => {
                    let mut renderer = gpu::Renderer::new(resident, scene, camera, settings)?;
                    renderer.complete(report.progress())?;
                    if report.is_verbose() {
                        culling::tell(&settings.culling, &renderer.counts()?, report);
                        if let Some(found) = renderer.confidence()? {
                            culling::tell_confidence(&found, report);
                        }
                    }
                    renderer.image()
                }
            }
        }
    }
}

/// Without the feature `gpu`.
#[cfg(not(feature = "gpu"))]
mod processor {
    use std::marker::PhantomData;

    use tyndall::particles::{Particles, Radii};
    use tyndall::render::Settings;
    use tyndall::scene::Scene;
    use tyndall::scene::camera::Camera;
    use tyndall::structure::{Kind, Structure};
    use tyndall::{Error, Image, Result};

    use super::{Choice, Goal, Work, check, on_processor};
    use crate::args::Builder;
    use crate::report::{Outcome, Report};

    /// One line a device.
    pub(crate) fn list(report: &Report) -> Outcome<()> {
        report.out(&format!("cpu · {} threads\n", rayon::current_num_threads()))
    }

    /// The processor; cards are not known.
    pub(crate) struct Renders;

    /// Nothing: all is with the processor.
    pub(crate) struct Held<'a>(PhantomData<&'a ()>);

    impl Held<'_> {
        pub(crate) const NONE: Self = Self(PhantomData);

        pub(crate) fn builder(&self) -> &'static str {
            ""
        }
    }

    impl Renders {
        pub(crate) fn new(choice: &Choice, work: Work, _: &Report) -> Outcome<Self> {
            check(choice, work)?;
            match (choice, work.build) {
                (Choice::Auto | Choice::Cpu, Builder::Cpu) => Ok(Self),
                _ => {
                    Err(Error::Device("this build knows no GPU — build it with --features gpu".into()).into())
                }
            }
        }

        pub(crate) fn build(
            &self,
            kind: Kind,
            particles: Particles,
            radii: &Radii,
            radius_scale: f32,
            report: &Report,
        ) -> Outcome<(Structure, Held<'_>)> {
            let structure = Structure::build(kind, particles, radii, radius_scale, report.progress())?;
            Ok((structure, Held::NONE))
        }

        pub(crate) fn name(&self) -> String {
            format!("cpu {} threads", rayon::current_num_threads())
        }

        pub(crate) fn load(&self, _: &Scene, _: Held<'_>, _: &Report) -> Outcome<&Self> {
            Ok(self)
        }

        pub(crate) fn image(
            &self,
            scene: &Scene,
            camera: &Camera,
            (settings, goal): (&Settings, Goal),
            report: &Report,
        ) -> Result<Image> {
            on_processor(scene, camera, (settings, goal), report)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn devices_have_names() {
        let choice = |text: &str| text.parse::<Choice>().ok();
        assert_eq!(choice("auto"), Some(Choice::Auto));
        assert_eq!(choice("cpu"), Some(Choice::Cpu));
        assert_eq!(choice("gpu"), Some(Choice::Gpu(None)));
        assert_eq!(choice("gpu:NVIDIA H200"), Some(Choice::Gpu(Some("NVIDIA H200".into()))));
        assert_eq!((choice("cuda"), choice("cpu:0")), (None, None));
    }
}
