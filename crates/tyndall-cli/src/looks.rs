//! Colors, sizes and light, as the command line has them; from a look's name to a look.

use clap::{Args, ValueEnum};
use tyndall::scene::bonding::Bonding;
use tyndall::scene::camera::Camera;
use tyndall::scene::coloring::{self, Coloring, Mapping, Norm, Range};
use tyndall::scene::colormap::Colormap;
use tyndall::scene::light::{Lens, Lights};
use tyndall::scene::looks::{self, Adjustments};
use tyndall::scene::short;
use tyndall::scene::sizes::Size;
use tyndall::{Error, Particles, Result};

use crate::args::{self, Mode};
use crate::lights;
use crate::medium::args::MethodName;
use crate::report::counted;
use crate::values::{Focus, length};

/// Colors, sizes, light.
#[derive(Args)]
#[command(next_help_heading = "Look")]
pub(crate) struct Look {
    /// What is shown as color: an attribute (c_pe), a component (v.x), a magnitude (|v|), an expression (c_pe/mass), element, type, #rrggbb, a color's name, auto
    #[arg(long, value_name = "SPEC", default_value = "auto")]
    pub(crate) color: Coloring,
    /// Color map by matplotlib's name, reversed with _r [default: by the quantity]
    #[arg(long, value_name = "NAME", value_parser = Colormap::named)]
    pub(crate) cmap: Option<Colormap>,
    /// How numbers are spread over the map: linear or log [default: by the quantity]
    #[arg(long, value_name = "NORM")]
    pub(crate) norm: Option<Norm>,
    /// Short for --norm log
    #[arg(long, conflicts_with = "norm")]
    pub(crate) log: bool,
    /// Numbers of the first and last color: LOW:HIGH, full, or auto (1st to 99th percentile)
    #[arg(long, value_name = "LOW:HIGH", default_value = "auto", allow_hyphen_values = true)]
    pub(crate) range: Range,
    /// Color of particles without a value: #rrggbb or a color's name [default: gray]
    #[arg(long, value_name = "COLOR", value_parser = coloring::color)]
    pub(crate) missing: Option<[u8; 3]>,
    /// Color of numbers below the range [default: the first of the map]
    #[arg(long, value_name = "COLOR", value_parser = coloring::color)]
    pub(crate) below: Option<[u8; 3]>,
    /// Color of numbers above the range [default: the last of the map]
    #[arg(long, value_name = "COLOR", value_parser = coloring::color)]
    pub(crate) above: Option<[u8; 3]>,
    /// How opaque particles are, 0 to 1: a number, an attribute, or an expression such as "if(type == 1, 1, 0.2)". In the order along
    /// each ray, shadows too; bonds have the lesser of their particles. On the CPU, and of 256 samples
    #[arg(long, value_name = "NUMBER", allow_hyphen_values = true)]
    pub(crate) opacity: Option<String>,
    /// Motion blur: how long the shutter is open around the frame's time, in the file's unit of time. On the CPU, and of 256 samples
    #[arg(long, value_name = "TIME", group = "open-shutter", allow_hyphen_values = true)]
    pub(crate) shutter: Option<f64>,
    /// Short for --shutter SHARE/FPS, in seconds: how much of the time from frame to frame, of which there are --fps a second, the shutter is open; 0.5 is half of it, a
    /// shutter of 180 degrees. For velocities per second: files with times in another unit, or in none, need --shutter
    #[arg(
        long,
        value_name = "SHARE",
        group = "open-shutter",
        conflicts_with = "shutter",
        allow_hyphen_values = true
    )]
    pub(crate) motion_blur: Option<f64>,
    /// The velocity that particles move with while the shutter is open: an attribute of two or three numbers, or the stem of scalars like vx vy vz
    #[arg(long, value_name = "NAME", default_value = "v", requires = "open-shutter")]
    pub(crate) velocity: String,
    /// Radius of the particles: a number for all, an attribute, or an expression such as diameter/2 or "if(type == 1, 0.5, 1)"
    /// [default: the file's, else by element, else half the usual distance]
    #[arg(long, value_name = "R", allow_hyphen_values = true)]
    pub(crate) radius: Option<Size>,
    /// Shows periodic images too: so many along each edge of the cell, from the file's own on; NX,NY,NZ or one number for all. They take
    /// no memory, and show what is chosen alike
    #[arg(long, value_name = "NX,NY,NZ", value_parser = crate::values::images)]
    pub(crate) replicate: Option<[u32; 3]>,
    /// Draws bonds, each half in the color of its particle: those of the file, else or besides by the elements (auto), or file, elements, or up to this
    /// distance. Spheres keep their radius: --radius-scale 0.25 shows balls and sticks
    #[arg(long, value_name = "WHICH", num_args = 0..=1, default_missing_value = "auto")]
    pub(crate) bonds: Option<Bonding>,
    /// Radius of a bond [default: a tenth of their usual length]
    #[arg(long, value_name = "R", value_parser = length, allow_hyphen_values = true, requires = "bonds")]
    pub(crate) bond_radius: Option<f32>,
    /// What every radius is multiplied with
    #[arg(long, value_name = "S", default_value = "1", value_parser = length, allow_hyphen_values = true)]
    pub(crate) radius_scale: f32,
    /// Light and material of spheres: from matte to dust light also goes from particle to particle (path tracing, on the CPU). Or defaults of a medium:
    /// with --mode medium dust, and smoke, cloud, steam, fire, explosion, nebula, spray and foam, which imply that mode
    #[arg(long, value_name = "LOOK", default_value = "default")]
    pub(crate) look: LightLook,
    /// With a look that is traced: how often light is thrown on by surfaces [default: 4]; with the default look traces it as matte
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=1000))]
    pub(crate) bounces: Option<u32>,
    /// Roughness of its material: 0 to 1, of coats and metal 0.02 to 1 [default: by the look]
    #[arg(long, value_name = "R", allow_hyphen_values = true)]
    pub(crate) roughness: Option<f32>,
    /// Refractive index of glossy, glass and water: above 1 [default: by the look]
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    pub(crate) refraction: Option<f32>,
    /// Radius of the camera's lens, in the unit of the file: what is not in focus is blurred
    #[arg(long, value_name = "LENGTH", value_parser = length, allow_hyphen_values = true)]
    pub(crate) aperture: Option<f32>,
    /// Distance from the eye that is in focus, or the point X,Y,Z [default: what the camera looks at]
    #[arg(long, value_name = "LENGTH", requires = "aperture", allow_hyphen_values = true)]
    pub(crate) focus: Option<Focus>,
}

impl Look {
    /// How numbers become colors.
    pub(crate) fn mapping(&self) -> Mapping {
        Mapping {
            map: self.cmap.clone(),
            norm: if self.log { Some(Norm::Log) } else { self.norm },
            range: self.range,
            missing: self.missing.unwrap_or(Mapping::default().missing),
            below: self.below,
            above: self.above,
        }
    }

    /// The flag for which each sample meets a scene of its own, if one is given.
    pub(crate) fn drawn(&self) -> Option<&'static str> {
        let shutter = self.shutter.map(|_| "--shutter").or(self.motion_blur.map(|_| "--motion-blur"));
        self.opacity.as_ref().map(|_| "--opacity").or(shutter)
    }

    /// What is looked at beside colors: of radii and opacities.
    pub(crate) fn quantities(&self) -> impl Iterator<Item = &str> {
        self.radius.as_ref().and_then(Size::quantity).into_iter().chain(self.opacity.as_deref())
    }

    /// How long the shutter is open, in the unit of time of `particles`, where there are so many frames a second; none if nothing moves.
    ///
    /// Fails with [`Error::Setting`] if that is a share of a time that nobody knows.
    pub(crate) fn exposure(&self, frames_a_second: f64, particles: &Particles) -> Result<Option<f64>> {
        let Some(share) = self.motion_blur else { return Ok(self.shutter) };
        if !(frames_a_second > 0.0 && frames_a_second.is_finite()) {
            return Err(Error::setting("--fps", frames_a_second, "a number above 0"));
        }
        if particles.time().is_some() && particles.time_unit() != Some("s") {
            let unit =
                particles.time_unit().map_or("in no unit that is known".into(), |unit| format!("in {unit}"));
            let allowed = format!(
                "given where times of the file are {unit}, not in seconds: --shutter TIME says how long"
            );
            return Err(Error::setting("--motion-blur", share, allowed));
        }
        if !(share >= 0.0 && share.is_finite()) {
            return Err(Error::setting(
                "--motion-blur",
                share,
                "a share of the time between frames, 0 or more",
            ));
        }
        Ok(Some(share / frames_a_second))
    }

    /// The velocity with which particles move, if they do.
    pub(crate) fn moving(&self) -> Option<&str> {
        self.shutter.or(self.motion_blur).map(|_| self.velocity.as_str())
    }

    /// How many images along each edge, if there are several.
    pub(crate) fn images(&self) -> Option<[u32; 3]> {
        self.replicate.filter(|images| *images != [1; 3])
    }
}

/// Names of [`tyndall::scene::looks::Look`].
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum LightLook {
    /// A key light with soft shadows, and a sky with ambient occlusion
    Default,
    /// A light at the eye, without shadows
    Headlight,
    /// The pure colors
    Flat,
    /// Light in three levels, with --outline, as if drawn
    Toon,
    /// Even surfaces that light each other
    Matte,
    /// Matte under a clear coat
    Glossy,
    /// Brushed mirrors in the particles' colors
    Metal,
    /// Clear bodies; the particles' colors are what light has after four diameters
    Glass,
    /// The same with less refraction
    Water,
    /// Rough ground
    Clay,
    /// Even surfaces in much sky and little sun, for print
    Paper,
    /// Rough ground in a hard sun
    Sand,
    /// Rough ground under an overcast sky; of a medium brown
    Dust,
    /// Gray, half of it thick
    Smoke,
    /// Thick and white
    Cloud,
    /// Thin and white
    Steam,
    /// Glows by its temperature
    Fire,
    /// Glows by its temperature in thick smoke
    Explosion,
    /// Thin and red, glowing
    Nebula,
    /// Thin drops of water
    Spray,
    /// Thick bubbles
    Foam,
}

/// The look of spheres that is named; none if it is one of media alone.
pub(crate) fn look(name: LightLook) -> Option<looks::Look> {
    use looks::Look;
    Some(match name {
        LightLook::Default => Look::Default,
        LightLook::Headlight => Look::Headlight,
        LightLook::Flat => Look::Flat,
        LightLook::Toon => Look::Toon,
        LightLook::Matte => Look::Matte,
        LightLook::Glossy => Look::Glossy,
        LightLook::Metal => Look::Metal,
        LightLook::Glass => Look::Glass,
        LightLook::Water => Look::Water,
        LightLook::Clay => Look::Clay,
        LightLook::Paper => Look::Paper,
        LightLook::Sand => Look::Sand,
        LightLook::Dust => Look::Dust,
        LightLook::Smoke
        | LightLook::Cloud
        | LightLook::Steam
        | LightLook::Fire
        | LightLook::Explosion
        | LightLook::Nebula
        | LightLook::Spray
        | LightLook::Foam => return None,
    })
}

/// Whether the lens that the camera of a stage has is that of the picture: where light is traced by paths, and no flag says otherwise.
pub(crate) fn has_lens_of_stage(args: &args::Render) -> bool {
    let is_of_spheres = args.method.mode == Mode::Spheres && traced_by(args).is_some();
    is_of_spheres && args.look.aperture.is_none() && args.illustrate.name().is_none()
}

/// What is said beside its name, for a camera, whose lens may be that of a stage; `lights` are in place of its own.
pub(crate) fn adjustments(
    args: &args::Render,
    (camera, lens): (&Camera, Option<f64>),
    lights: Option<Lights>,
) -> Adjustments {
    let forward = (camera.look_at - camera.eye).normalize_or_zero();
    let lens = lens.filter(|_| has_lens_of_stage(args)).map(|radius| radius as f32);
    let lens = args.look.aperture.or(lens).map(|radius| {
        let point = match args.look.focus {
            None => camera.look_at,
            Some(Focus::Distance(distance)) => camera.eye + distance * forward,
            Some(Focus::Point(point)) => point,
        };
        Lens { radius, focus: (point - camera.eye).dot(forward) as f32 }
    });
    let Look { bounces, roughness, refraction, .. } = args.look;
    let traced = args.medium.method == MethodName::Reference;
    Adjustments { traced, lights, bounces, roughness, index: refraction, lens }
}

/// The option that has light traced by paths, if one does.
pub(crate) fn traced_by(args: &args::Render) -> Option<&'static str> {
    let look = &args.look;
    match look.look {
        LightLook::Headlight | LightLook::Flat | LightLook::Toon => None,
        LightLook::Default if look.aperture.is_some() => Some("--aperture"),
        LightLook::Default if look.bounces.is_some() => Some("--bounces"),
        LightLook::Default if !args.medium.lights.is_empty() => Some("--light"),
        LightLook::Default if args.medium.method == MethodName::Reference => Some("--method path"),
        LightLook::Default => None,
        _ => Some("this look"),
    }
}

/// The option that has light that cards do not draw, if one does.
pub(crate) fn beyond_cards(args: &args::Render) -> Option<&'static str> {
    traced_by(args).or((args.look.look == LightLook::Toon).then_some("--look toon"))
}

/// Whether rays look for light.
pub(crate) fn is_traced(look: LightLook) -> bool {
    !matches!(look, LightLook::Headlight | LightLook::Flat | LightLook::Toon)
}

/// What is traced, in words; none if light is not.
pub(crate) fn description(args: &args::Render) -> Option<String> {
    traced_by(args)?;
    let name = args.look.look.to_possible_value().map_or_else(String::new, |value| value.get_name().into());
    let bounces = args.look.bounces.unwrap_or(looks::BOUNCES);
    let mut text = format!("look {name} by paths of {}", counted(bounces as usize, "bounce"));
    if let Some(radius) = args.look.aperture {
        text += &format!(", lens of radius {}", short(radius.into()));
    }
    Some(text)
}

/// Fails if a look is adjusted in what it has not.
pub(crate) fn check(args: &args::Render) -> Result<()> {
    lights::check(args)?;
    let look = &args.look;
    let is_traced = traced_by(args).is_some();
    let (has_roughness, has_index) = match look.look {
        LightLook::Default | LightLook::Headlight | LightLook::Flat | LightLook::Toon => (is_traced, false),
        LightLook::Glass | LightLook::Water => (false, true),
        LightLook::Glossy => (true, true),
        _ => (true, false),
    };
    let refused = [
        ("--bounces", look.bounces.is_some(), is_traced, "a look other than headlight, flat and toon"),
        ("--aperture", look.aperture.is_some(), is_traced, "a look other than headlight, flat and toon"),
        (
            "--roughness",
            look.roughness.is_some(),
            has_roughness,
            "--look matte, glossy, metal, clay, paper, sand or dust",
        ),
        ("--refraction", look.refraction.is_some(), has_index, "--look glossy, glass or water"),
    ];
    match refused.iter().find(|(_, is_given, has, _)| *is_given && !has) {
        Some((name, .., with)) => Err(Error::setting(*name, "given", format!("given with {with}"))),
        None => Ok(()),
    }
}
