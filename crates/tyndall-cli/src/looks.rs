//! From the command line to a look.

use clap::ValueEnum;
use tyndall::scene::camera::Camera;
use tyndall::scene::light::Lens;
use tyndall::scene::looks::{self, Adjustments, Look};
use tyndall::scene::short;
use tyndall::{Error, Result};

use crate::args::{self, LightLook};
use crate::medium::args::MethodName;
use crate::report::counted;
use crate::values::Focus;

/// The look of spheres that is named; none if it is one of media alone.
pub(crate) fn look(name: LightLook) -> Option<Look> {
    Some(match name {
        LightLook::Default => Look::Default,
        LightLook::Headlight => Look::Headlight,
        LightLook::Flat => Look::Flat,
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

/// What is said beside its name, for a camera.
pub(crate) fn adjustments(args: &args::Render, camera: &Camera) -> Adjustments {
    let forward = (camera.look_at - camera.eye).normalize_or_zero();
    let lens = args.look.aperture.map(|radius| {
        let point = match args.look.focus {
            None => camera.look_at,
            Some(Focus::Distance(distance)) => camera.eye + distance * forward,
            Some(Focus::Point(point)) => point,
        };
        Lens { radius, focus: (point - camera.eye).dot(forward) as f32 }
    });
    let args::Look { bounces, roughness, refraction, .. } = args.look;
    let traced = args.medium.method == MethodName::Reference;
    Adjustments { traced, bounces, roughness, index: refraction, lens }
}

/// The option that has light traced by paths, if one does.
pub(crate) fn traced_by(args: &args::Render) -> Option<&'static str> {
    let look = &args.look;
    match look.look {
        LightLook::Headlight | LightLook::Flat => None,
        LightLook::Default if look.aperture.is_some() => Some("--aperture"),
        LightLook::Default if look.bounces.is_some() => Some("--bounces"),
        LightLook::Default if args.medium.method == MethodName::Reference => Some("--method path"),
        LightLook::Default => None,
        _ => Some("this look"),
    }
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
    let look = &args.look;
    let is_traced = traced_by(args).is_some();
    let (has_roughness, has_index) = match look.look {
        LightLook::Default | LightLook::Headlight | LightLook::Flat => (is_traced, false),
        LightLook::Glass | LightLook::Water => (false, true),
        LightLook::Glossy => (true, true),
        _ => (true, false),
    };
    let refused = [
        ("--bounces", look.bounces.is_some(), is_traced, "a look other than headlight and flat"),
        ("--aperture", look.aperture.is_some(), is_traced, "a look other than headlight and flat"),
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
