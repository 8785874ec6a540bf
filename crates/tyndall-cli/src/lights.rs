//! What lights spheres in place of a look's own lights: an image of all that is far away, or one radiance all around.

use std::sync::Arc;

use tyndall::medium::Light;
use tyndall::scene::image_light::ImageLight;
use tyndall::scene::light::Lights;
use tyndall::scene::short;
use tyndall::{DVec3, Error, Result};

use crate::args;
use crate::looks;
use crate::report::Report;
use crate::values::Background;

/// Mean radiance of the default look's lights, with which white things are about white.
const USUAL_MEAN: f32 = 0.6;
/// Images whose mean is so many stops away from that are told.
const TOLD_STOPS: f32 = 2.0;

/// Fails if spheres cannot be lit as is asked for.
pub(super) fn check(args: &args::Render) -> Result<()> {
    let lights = &args.medium.lights;
    if lights.is_empty() {
        if args.picture.background == Some(Background::Sky) {
            let allowed = "a color or none; sky is what --light image:FILE shows, or a medium's lights";
            return Err(Error::setting("--background", "sky", allowed));
        }
        if args.medium.exposure != 0.0 {
            let allowed = "given with --light image:FILE, or for a medium";
            return Err(Error::setting("--exposure", args.medium.exposure, allowed));
        }
        return Ok(());
    }
    if let Some(other) = lights.iter().find(|light| !light.is_all_around()) {
        let allowed = "image:FILE or sky:RADIANCE for spheres; suns, points and spots are for --mode medium";
        return Err(Error::setting("--light", other.kind(), allowed));
    }
    if lights.len() > 1 {
        return Err(Error::setting("--light", "given more than once", "one image or sky for spheres"));
    }
    if !looks::is_traced(args.look.look) {
        let allowed = "given with a look other than headlight, flat and toon";
        return Err(Error::setting("--light", "given", allowed));
    }
    if !args.medium.exposure.is_finite() {
        return Err(Error::setting("--exposure", args.medium.exposure, "a finite number of stops"));
    }
    Ok(())
}

/// The lights that are asked for, if any are; tells whether they are far brighter or darker than usual. Fails if the image cannot be read.
pub(crate) fn of_spheres(args: &args::Render, report: &Report) -> Result<Option<Lights>> {
    let Some(spec) = args.medium.lights.first() else { return Ok(None) };
    let up = args.camera.up.unwrap_or(DVec3::Z);
    let spec = spec.times(args.medium.exposure.exp2());
    let Light::Environment(environment) = spec.light(DVec3::ZERO, up.as_vec3())? else { return Ok(None) };
    let mean = environment.mean().element_sum() / 3.0;
    let stops = (USUAL_MEAN / mean).log2();
    if mean > 0.0 && stops.abs() > TOLD_STOPS {
        let (is, asked) = (short(mean.into()), args.medium.exposure + stops);
        report.note(format_args!(
            "note: the mean radiance of the light is {is}; --exposure {asked:.1} makes it {USUAL_MEAN}, which is usual"
        ));
    }
    let is_seen = args.picture.background == Some(Background::Sky);
    Ok(Some(Lights::Image { light: Arc::new(ImageLight::new(environment)), is_seen }))
}

/// How bright the lights are, in words.
pub(crate) fn description(lights: &Lights) -> Option<String> {
    let Lights::Image { light, .. } = lights else { return None };
    let mean = light.environment().mean().element_sum() / 3.0;
    let what = if light.environment().is_constant() { "light all around" } else { "an image" };
    Some(format!("lit by {what} of mean radiance {}", short(mean.into())))
}
