//! The part of the command line's definition that is about media.

use clap::{Args, ValueEnum};
use tyndall::medium::density::{self, Resolution, Smoothing, Weight};
use tyndall::medium::{Kernel, NoiseKind, automatic};
use tyndall::render::medium::free_path::FreePath;

use super::emission::EmissionSpec;
use super::values::{Gather, LightSpec, Noise, NoiseAmount, NoiseMotion, Rgb, Voxel, positive};
use crate::values::count;

/// From particles to density.
#[derive(Args)]
#[command(next_help_heading = "Density")]
pub(crate) struct Density {
    /// Who has a smoothing length: uniform, two-pass, three-pass, exact (each grid point) or scatter (each particle)
    #[arg(long, value_name = "NAME", default_value = "three-pass")]
    pub(crate) smoothing: SmoothingName,
    /// Longest smoothing length, the radius of the kernel's support [default: by the particles' distances]
    #[arg(long, value_name = "LENGTH", value_parser = positive, allow_hyphen_values = true)]
    pub(crate) h0: Option<f32>,
    /// Wanted number of particles within a smoothing length (N*)
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) neighbors: u32,
    /// Corrections of the lengths after those of three-pass; each takes about 8 % more time and brings N nearer to N*
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=16))]
    pub(crate) further_passes: u32,
    /// How much corrected lengths that held too many particles are shortened beyond the paper's formula (s), from 0 to below 1
    #[arg(long, value_name = "S", default_value_t = 0.0, allow_hyphen_values = true)]
    pub(crate) correction_scale: f32,
    /// How a particle is spread: cubic, wendland or poly6
    #[arg(long, value_name = "NAME", default_value = "cubic")]
    pub(crate) kernel: KernelName,
    /// Distance of grid points; auto finds it by the smoothing lengths, from 64 to 256 points along the longest axis [default: auto]
    #[arg(long, value_name = "LENGTH", conflicts_with = "grid", allow_hyphen_values = true)]
    pub(crate) voxel: Option<Voxel>,
    /// Grid points along the longest axis
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..))]
    pub(crate) grid: Option<u32>,
    /// Halves the distance of grid points up to N times, 3 at most, in bricks of 8x8x8 where smoothing lengths are short [default: 3 where
    /// the distance is found by the smoothing lengths, else 0]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=3))]
    pub(crate) finer: Option<u32>,
    /// What a particle weighs: an attribute, or one [default: its mass if it has one]
    #[arg(long, value_name = "NAME")]
    pub(crate) weight: Option<String>,
}

/// With --mode medium: from particles to density, and light in it.
#[derive(Args)]
#[command(next_help_heading = "Medium")]
pub(crate) struct Medium {
    /// What matter does to light: scattering, absorption, emission (light is only added up), emission-absorption; the latter three scatter
    /// nothing, so that lights are seen behind the medium only
    #[arg(long, value_name = "MODEL", default_value = "scattering")]
    pub(crate) optics: OpticsName,
    /// What matter gives off, as thick matter is seen: blackbody:NAME (its temperature in kelvins; luminance 1 at the 99th percentile of the
    /// mass, or at K with blackbody:NAME@K), a quantity through --cmap, --norm and --range, one number or R,G,B, or none [default: none; of
    /// --optics emission and emission-absorption --color, else 1]
    #[arg(long, value_name = "WHAT", allow_hyphen_values = true)]
    pub(crate) emission: Option<EmissionSpec>,
    /// What the emission is multiplied with
    #[arg(long, value_name = "S", default_value = "1", value_parser = positive, allow_hyphen_values = true)]
    pub(crate) emission_scale: f32,
    /// Extinction per length where the density is 1, one number or R,G,B [default: so that the median column is 6 thick; with --optics
    /// absorption or emission 1, with emission-absorption 2]
    #[arg(long, value_name = "X", allow_hyphen_values = true)]
    pub(crate) extinction: Option<Rgb>,
    /// Share of the extinction that scatters, one number or R,G,B from 0 to 1; the rest absorbs, and emits [default: 0.95, with --emission 0.3]
    #[arg(long, value_name = "X", allow_hyphen_values = true)]
    pub(crate) albedo: Option<Rgb>,
    /// Mean cosine of scattering, between -1 (back) and 1 (forward) [default: 0]
    #[arg(long, visible_alias = "g", value_name = "G", allow_hyphen_values = true)]
    pub(crate) phase_g: Option<f32>,
    /// A light: sun:X,Y,Z:E (travels along X,Y,Z, irradiance E), point:X,Y,Z:I (intensity I), spot:X,Y,Z:X,Y,Z:DEGREES:I (where it is, where it shines, half the cone), sky:L (radiance L), image:FILE or image:S:FILE (all around, from an equirectangular EXR or Radiance HDR picture, times S; --up is up in it); numbers or R,G,B; may be repeated. Of spheres one image or sky, in place of the look's own lights, which light follows from particle to particle (path tracing); --background sky shows it [default: a sun from the upper left, and a sky]
    #[arg(long = "light", value_name = "LIGHT", allow_hyphen_values = true)]
    pub(crate) lights: Vec<LightSpec>,
    /// How light is found: march (illumination cache and ray march) or reference (path tracer without bias, also called path); of spheres path
    /// traces the default look, too
    #[arg(long, value_name = "NAME", default_value = "march")]
    pub(crate) method: MethodName,
    /// How light that was scattered before is found: sweeps (without noise), photons, single (not at all), or off (no cache: brute force with photons)
    #[arg(long, value_name = "HOW", default_value = "sweeps")]
    pub(crate) cache: CacheName,
    /// Distance of the cache's samples [default: that of the closest grid points]
    #[arg(long, value_name = "LENGTH", value_parser = positive, allow_hyphen_values = true)]
    pub(crate) cache_voxel: Option<f32>,
    /// Photons to emit
    #[arg(long, value_name = "N", default_value = "1e6", value_parser = count)]
    pub(crate) photons: u64,
    /// How photons find their next scattering: exact, delta; homogeneous, scaled and scaled:FACTOR are wrong, for comparison
    #[arg(long, value_name = "NAME", default_value = "delta")]
    pub(crate) free_path: FreePath,
    /// Around each sample of the cache photons count within this radius; auto, R, or N@R for the nearest N within R
    #[arg(long, value_name = "RADIUS", default_value = "auto", allow_hyphen_values = true)]
    pub(crate) gather_radius: Gather,
    /// With --cache photons: means of so many passes, each with photons of its own and a radius that shrinks from pass to pass; the error by the radius vanishes, the memory stays that of one pass. With --noise 1% at most so many, doubled until light changes by less than that share of itself [default: 1, with --noise 1% 64]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(crate) photon_passes: Option<u32>,
    /// Of a medium position noise: AMPLITUDE@OCTAVES, such as 0.6@3. Of any picture 1%: adds samples until so little noise is left, root mean
    /// square, as a share of white; then --samples is the most that a pixel gets [default of it: 4096]. Both: 0.6@3,1%
    #[arg(long, value_name = "A@N", allow_hyphen_values = true)]
    pub(crate) noise: Option<Noise>,
    /// Density noise: AMPLITUDE@OCTAVES
    #[arg(long, value_name = "A@N", allow_hyphen_values = true)]
    pub(crate) density_noise: Option<NoiseAmount>,
    /// Takes noise out of the picture of a medium, by averaging pixels that differ by noise only; from 2 samples a pixel. What --noise 1% measures is
    /// the noise before
    #[arg(long)]
    pub(crate) denoise: bool,
    /// Size of the largest features of the noise [default: a thirtieth of the medium]
    #[arg(long, value_name = "LENGTH", value_parser = positive, allow_hyphen_values = true)]
    pub(crate) noise_scale: Option<f32>,
    /// How --noise displaces: perlin (gathers matter in some places, thins it out in others) or curl (stirs it, and keeps its density)
    #[arg(long, value_name = "KIND", default_value = "perlin")]
    pub(crate) noise_kind: NoiseKindName,
    /// Octaves of the noise whose features are narrower than so many pixels fade out, without a change of the mean; 0 keeps them all
    #[arg(long, value_name = "PIXELS", default_value_t = 1.0, allow_hyphen_values = true)]
    pub(crate) noise_detail: f32,
    /// How the noise of a sequence goes with the particles: auto (by ids if there are any, else by velocities, else it stands in space), id (id:NAME of
    /// another attribute, id:index where particles keep their order), velocity (velocity:NAME), or none. Matter that rests, or moves or turns as a
    /// whole, keeps its noise; where it is stirred new noise takes the old one's place
    #[arg(long, value_name = "HOW", default_value = "auto")]
    pub(crate) noise_motion: NoiseMotion,
    /// How many frames noise goes with matter that is stirred, from coming in until it has gone
    #[arg(long, value_name = "FRAMES", default_value_t = 24, value_parser = clap::value_parser!(u32).range(2..=10_000))]
    pub(crate) noise_life: u32,
    /// The time from frame to frame in the unit of the velocities that noise moves with [default: that between the first two frames]
    #[arg(long, value_name = "TIME", value_parser = positive, allow_hyphen_values = true)]
    pub(crate) noise_frame_time: Option<f32>,
    /// Length of a step of the march, in grid spacings
    #[arg(long, value_name = "S", default_value = "2", value_parser = positive, allow_hyphen_values = true)]
    pub(crate) step: f32,
    /// Brightness in stops: each doubles the light; of spheres that of --light
    #[arg(long, value_name = "EV", default_value_t = 0.0, allow_hyphen_values = true)]
    pub(crate) exposure: f32,
    /// Writes how many particles the grid points used, and what was chosen for the density, as JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) statistics: Option<std::path::PathBuf>,
    /// What the picture shows: light, photons (as points) or density (per column)
    #[arg(long, value_name = "WHAT", default_value = "light")]
    pub(crate) show: Shown,
    #[command(flatten)]
    pub(crate) density: Density,
}

impl Medium {
    /// By how much noise moves the medium.
    pub(crate) fn position_noise(&self) -> Option<NoiseAmount> {
        self.noise.and_then(|it| it.position)
    }

    /// How much noise may be left in the picture.
    pub(crate) fn most_noise(&self) -> Option<f32> {
        self.noise.and_then(|it| it.most)
    }
}

impl Density {
    /// How the density of particles is estimated, in so much memory.
    pub(crate) fn settings(&self, memory_bytes: Option<u64>) -> density::Settings {
        let resolution = match (self.voxel, self.grid) {
            (Some(Voxel::Length(spacing)), _) => Resolution::Voxel(spacing),
            (_, Some(samples)) => Resolution::Samples(samples),
            (Some(Voxel::Auto) | None, None) => Resolution::Automatic,
        };
        density::Settings {
            smoothing: match self.smoothing {
                SmoothingName::Uniform => Smoothing::Uniform,
                SmoothingName::TwoPass => Smoothing::TwoPass,
                SmoothingName::ThreePass => Smoothing::ThreePass,
                SmoothingName::Exact => Smoothing::Exact,
                SmoothingName::Scatter => Smoothing::Scatter,
            },
            kernel: self.kernel.kernel(),
            length: self.h0,
            neighbors: self.neighbors,
            scale: self.correction_scale,
            further_passes: self.further_passes,
            weight: match self.weight.as_deref() {
                None => Weight::Automatic,
                Some("one") => Weight::One,
                Some(name) => Weight::Attribute(name.into()),
            },
            resolution,
            finer: self.finer,
            memory_bytes,
            ..density::Settings::default()
        }
    }
}

/// Which terms the equation of transfer has.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum OpticsName {
    /// Light is scattered and absorbed; with --emission matter emits too
    Scattering,
    /// Light from behind is absorbed
    Absorption,
    /// Light is added up, as from thin gas: nothing is absorbed
    Emission,
    /// Light is emitted and absorbed, as in the usual volume rendering
    EmissionAbsorption,
}

impl OpticsName {
    /// What happens to radiance L along a length s, for the printed line; k is the extinction, B the emission, S what is scattered in.
    pub(crate) fn equation(self, emits: bool) -> &'static str {
        match (self, emits) {
            (Self::Scattering, false) => "dL/ds = k (a S - L)",
            (Self::Scattering, true) => "dL/ds = k (a S + (1 - a) B - L)",
            (Self::Absorption, _) => "dL/ds = -k L",
            (Self::Emission, _) => "dL/ds = k B",
            (Self::EmissionAbsorption, _) => "dL/ds = k (B - L)",
        }
    }

    /// Optical thickness of the median column, where the extinction is not said.
    pub(crate) fn thickness(self) -> f32 {
        match self {
            Self::Scattering => automatic::THICKNESS,
            Self::Absorption | Self::Emission => 1.0,
            Self::EmissionAbsorption => 2.0,
        }
    }
}

/// Names of [`tyndall::medium::density::Smoothing`].
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SmoothingName {
    /// One length everywhere
    Uniform,
    /// Predicted from the number of particles
    TwoPass,
    /// Predicted and corrected
    ThreePass,
    /// The distance of the N*-th particle
    Exact,
    /// Each particle has its own; conserves mass
    Scatter,
}

/// Names of [`NoiseKind`].
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum NoiseKindName {
    /// Each axis by a noise of its own
    Perlin,
    /// By the curl of three noises
    Curl,
}

impl NoiseKindName {
    pub(crate) fn kind(self) -> NoiseKind {
        match self {
            Self::Perlin => NoiseKind::Perlin,
            Self::Curl => NoiseKind::Curl,
        }
    }
}

/// Names of [`tyndall::medium::Kernel`].
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum KernelName {
    /// The cubic spline M4
    Cubic,
    /// Wendland's C2 function
    Wendland,
    /// (1 - q^2)^3
    Poly6,
}

impl KernelName {
    pub(crate) fn kernel(self) -> Kernel {
        match self {
            Self::Cubic => Kernel::CubicSpline,
            Self::Wendland => Kernel::WendlandC2,
            Self::Poly6 => Kernel::Poly6,
        }
    }
}

/// How light is found.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum MethodName {
    /// The illumination cache, and a ray march
    March,
    /// A path tracer without bias
    #[value(alias = "path")]
    Reference,
}

/// What fills the illumination cache.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum CacheName {
    /// Sweeps along many directions
    Sweeps,
    /// Photons
    Photons,
    /// Light is scattered once
    Single,
    /// There is none: light is found at every step
    Off,
}

/// What a picture of a medium shows.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Shown {
    /// How it looks
    Light,
    /// Where photons were scattered
    Photons,
    /// How much of it there is
    Density,
}
