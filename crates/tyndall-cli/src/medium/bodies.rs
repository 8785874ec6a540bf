//! Layers of spheres in a medium.

use tyndall::DVec3;
use tyndall::progress::Progress;
use tyndall::scene::Scene;
use tyndall::scene::automatic::Outliers;
use tyndall::scene::guesses::Shown;
use tyndall::scene::light::Lighting;
use tyndall::scene::outline::Outline;
use tyndall::structure::{Kind, Structure};

use super::Job;
use super::args::{self, CacheName, MethodName};
use crate::args::Render;
use crate::looks::LightLook;
use crate::report::{Failure, Outcome};
use crate::sources::{self, Together};

/// The spheres of a frame.
pub(super) struct Bodies {
    pub(super) scene: Scene,
    pub(super) outlines: Vec<Outline>,
    /// What was chosen and guessed, layer by layer.
    pub(super) descriptions: Vec<String>,
    pub(super) kept: Vec<sources::Kept>,
}

/// Refuses what cannot be seen in one picture with a medium, of it and of layers of spheres.
pub(super) fn check(medium: &Render, spheres: &[&Render]) -> Outcome<()> {
    if spheres.is_empty() && medium.shapes.holdout().is_none() {
        return Ok(());
    }
    let asked = &medium.medium;
    let by_photons = match asked.cache {
        _ if asked.method == MethodName::Reference => None,
        CacheName::Photons => Some("--cache photons with --emission"),
        CacheName::Off => Some("--cache off with --emission"),
        CacheName::Sweeps | CacheName::Single => None,
    };
    if asked.show != args::Shown::Light {
        let text = "--show is not for spheres and a medium in one picture, nor with --holdout — leave out one of them";
        return Err(Failure::Usage(text.into()));
    }
    for layer in spheres {
        let look = &layer.look;
        let is_matte = matches!(look.look, LightLook::Default | LightLook::Matte);
        let of_spheres = [
            (!is_matte, "a --look other than matte"),
            (look.drawn().is_some(), look.drawn().unwrap_or_default()),
            (look.images().is_some(), "--replicate"),
            (layer.shapes.name().is_some(), layer.shapes.name().unwrap_or_default()),
            (look.aperture.is_some(), "--aperture"),
            (layer.cut.name().is_some(), "--cut"),
            (layer.medium.emission.is_some() && by_photons.is_some(), by_photons.unwrap_or_default()),
            (layer.illustrate.name().is_some(), layer.illustrate.name().unwrap_or_default()),
        ];
        let refused = of_spheres.iter().find(|(is_given, _)| *is_given);
        if let Some((_, name)) = refused {
            let text =
                format!("{name} is not for spheres and a medium in one picture — leave out one of them");
            return Err(Failure::Usage(text));
        }
    }
    Ok(())
}

impl Bodies {
    /// Of a frame, measured from `origin`; `kept` is what was kept of the first frame.
    pub(super) fn of(
        job: &Job,
        number: usize,
        origin: DVec3,
        kept: &[sources::Kept],
    ) -> Outcome<Option<Self>> {
        if !job.has_bodies() {
            return Ok(None);
        }
        let frames = job.spheres.read(number, kept, job.report)?;
        let mut outlines: Vec<Outline> = frames.iter().map(|frame| frame.outline.clone()).collect();
        let descriptions = frames.iter().map(|frame| frame.description.clone());
        let descriptions = descriptions.chain(job.holdouts.description()).collect();
        let kept = sources::kept(&frames);
        let Together { particles, radii, radius_scale, colors, beside } =
            Together::joined(None, frames, origin)?;
        let progress: &dyn Progress = job.report.progress();
        let structure = Structure::build(Kind::default(), particles, &radii, radius_scale, progress)?;
        let mut scene = Scene::new(structure, colors, Lighting::Flat, None);
        beside.add_to(&mut scene)?;
        job.holdouts.add_to(&mut scene)?;
        if job.args.camera.frame_shown && !outlines.is_empty() {
            let shown = Shown::of_scene(&scene, 0.0, Outliers::Left);
            outlines = shown.map(|(shown, _)| shown.outline).into_iter().collect();
        }
        Ok(Some(Self { scene, outlines, descriptions, kept }))
    }
}
