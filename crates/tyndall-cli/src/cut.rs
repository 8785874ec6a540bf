//! What is cut, and the colors of cut surfaces, as the command line has them.

use std::str::FromStr;

use clap::Args;
use tyndall::particles::Particles;
use tyndall::scene::Scene;
use tyndall::scene::coloring::{self, linear};
use tyndall::scene::select::Clip;
use tyndall::scene::short;
use tyndall::structure::selection::HalfSpace;
use tyndall::{Error, Result};

use crate::report::{Failure, Outcome};

/// Cuts through particles.
#[derive(Args)]
#[command(next_help_heading = "Selection")]
pub(crate) struct Cut {
    /// Cuts through particles and shapes, where --clip shows them whole or not at all: only what lies there is left, and cut surfaces are closed. WHERE is as with
    /// --clip: z<10, z<0.5L, 'plane X,Y,Z NX,NY,NZ', 'box X,Y,Z X,Y,Z'; may be repeated. What is cut away casts no shadow. On the CPU
    #[arg(long = "cut", value_name = "WHERE", allow_hyphen_values = true)]
    pub(crate) cuts: Vec<Clip>,
    /// Color of cut surfaces: particle, which is that of what is cut, #rrggbb or a color's name
    #[arg(long, value_name = "COLOR", default_value = "particle", requires = "cuts")]
    pub(crate) cap: Cap,
}

/// The color of cut surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Cap {
    /// That of what is cut.
    Particle,
    /// One for all.
    Color([u8; 3]),
}

impl FromStr for Cap {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match (text.trim(), coloring::color(text)) {
            ("particle", _) => Ok(Self::Particle),
            (_, Ok(color)) => Ok(Self::Color(color)),
            (_, Err(Error::Setting { allowed, .. })) => {
                Err(Error::setting("--cap", text, format!("particle, or a color: {allowed}")))
            }
            (_, Err(other)) => Err(other),
        }
    }
}

impl Cut {
    /// The flag, if it is given.
    pub(crate) fn name(&self) -> Option<&'static str> {
        (!self.cuts.is_empty()).then_some("--cut")
    }

    /// Fails if something is cut; `mode` has no surfaces.
    pub(crate) fn refuse(&self, mode: &str) -> Outcome<()> {
        match self.name() {
            Some(flag) => {
                let text = format!("{flag} is for spheres — leave it out with {mode}, or take --clip");
                Err(Failure::Usage(text))
            }
            None => Ok(()),
        }
    }

    /// What is left lies in all of these.
    pub(crate) fn half_spaces(&self, particles: &Particles) -> Vec<HalfSpace> {
        self.cuts.iter().flat_map(|it| it.half_spaces(particles)).collect()
    }

    /// Linear RGB of all cut surfaces, if it is one.
    pub(crate) fn color(&self) -> Option<[f32; 3]> {
        match self.cap {
            Cap::Particle => None,
            Cap::Color(color) => Some(linear(color)),
        }
    }

    /// What is done, in words; none if nothing is cut.
    pub(crate) fn description(&self) -> Option<String> {
        self.name().map(|_| format!("cut: {}", self.places()))
    }

    /// Why a picture of what is left shows nothing.
    pub(crate) fn why_unseen(&self, scene: &Scene) -> Option<String> {
        self.name()?;
        let (origin, bounds) = (scene.structure().origin(), scene.structure().bounds());
        let (min, max) = (origin + bounds.min.as_dvec3(), origin + bounds.max.as_dvec3());
        let sides = ["x", "y", "z"].into_iter().enumerate();
        let sides: Vec<String> =
            sides.map(|(axis, name)| format!("{name} {}..{}", short(min[axis]), short(max[axis]))).collect();
        let (places, sides) = (self.places(), sides.join(", "));
        Some(format!("nothing of what --cut '{places}' leaves is in view — particles are in {sides}"))
    }

    fn places(&self) -> String {
        self.cuts.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
    }
}
