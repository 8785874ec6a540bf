//! What nobody said, guessed from the first frame and kept where it would jump.

use tyndall::particles::{Particles, Radii};
use tyndall::render::{Culling, Settings};
use tyndall::scene::Scene;
use tyndall::scene::automatic;
use tyndall::scene::camera::Camera;
use tyndall::scene::color::{ParticleColors, resolve};
use tyndall::scene::coloring::{Mapping, Norm, Range};
use tyndall::scene::ellipsoids::Ellipsoids;
use tyndall::scene::guesses::{Guesses, Shown};
use tyndall::scene::outline::Outline;
use tyndall::scene::short;
use tyndall::scene::viewpoint::{Lens, too_small};
use tyndall::structure::Spheres;
use tyndall::structure::replicas::Replicas;
use tyndall_io::Sequence;

use super::{Job, Kept, Surveyed, range_of};
use crate::report::{Outcome, counted};
use crate::{culling, device, lights, looks, selection, sources, structure, survey};

impl Job<'_> {
    /// Looks at the frames that stand for a sequence.
    pub(super) fn survey(&self, sequence: &Sequence) -> Outcome<Surveyed> {
        let look = &self.args.look;
        let outliers = self.args.camera.outliers();
        let found = survey::of(self.args, sequence.len(), |number| {
            let particles = match self.parts(sequence, number) {
                Some(parts) => parts.sample(self.report.progress())?,
                None => survey::read(sequence, number, self.args, self.report)?.particles,
            };
            let particles = match &look.radius {
                Some(size) => size.apply(particles)?,
                None => particles,
            };
            let range = match self.args.frames.fixed_range {
                true => resolve(&particles, &look.color, &look.mapping())?.legend.as_ref().and_then(range_of),
                false => None,
            };
            let particles = match self.args.camera.frame_shown {
                true => selection::keep(&self.args.selection, particles)?.0,
                false => particles,
            };
            let (radii, _) = self.radii(&particles, None, None);
            let spheres = Spheres { particles: &particles, radii: &radii, radius_scale: look.radius_scale };
            let layers = self.sources.read(number, &[], self.report)?;
            let of_layers = layers.into_iter().map(|layer| layer.outline);
            let outlines = std::iter::once(Shown::of(spheres, outliers).outline).chain(of_layers);
            Ok((Outline::joined(&outlines.collect::<Vec<_>>()), range))
        })?;
        let (outlines, ranges): (Vec<Outline>, Vec<_>) = found.into_iter().unzip();
        let wider = |a: (Norm, Range), b: (Norm, Range)| match (a.1, b.1) {
            (Range::Given(low, high), Range::Given(other_low, other_high)) => {
                (a.0, Range::Given(low.min(other_low), high.max(other_high)))
            }
            _ => a,
        };
        let range = ranges.into_iter().flatten().reduce(wider);
        Ok(Surveyed { outlines, range })
    }

    pub(super) fn radii(
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
    pub(super) fn asked_radius(&self, kept: Option<&Kept>) -> Option<(Radii, String)> {
        match (&self.args.look.radius, kept.and_then(|kept| kept.uniform.clone())) {
            (Some(size), _) => size.uniform(),
            (None, kept) => kept.map(|radii| (radii, "radius of the first frame".into())),
        }
    }

    /// The ellipsoids of a frame. Where a picture is made that knows spheres alone, particles that only the file has as ellipsoids are spheres, which is
    /// said.
    pub(super) fn ellipsoids(&self, spheres: Spheres, is_first: bool) -> Outcome<Option<Ellipsoids>> {
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

    pub(super) fn camera(
        &self,
        spheres: Spheres,
        replicas: Option<&Replicas>,
        guesses: Option<&Guesses>,
        layers: &[sources::Frame],
    ) -> (Camera, Outline, String) {
        let outliers = self.args.camera.outliers();
        let guessed = guesses.filter(|_| spheres.radius_scale == 1.0);
        let shown = guessed.map_or_else(|| Shown::of(spheres, outliers), |it| it.shown(outliers).clone());
        let Shown { framing, outline } = shown;
        let outline = self.framed(outline);
        let outline = replicas.map_or_else(|| outline.clone(), |replicas| outline.replicated(replicas));
        let others = layers.iter().map(|layer| layer.outline.clone());
        let outline = Outline::joined(&std::iter::once(outline).chain(others).collect::<Vec<_>>());
        let aspect = f64::from(self.settings.width) / f64::from(self.settings.height);
        let camera = self.viewpoint.camera(&outline, aspect);
        if let Some(text) = self.args.camera.described() {
            return (camera, outline, text);
        }
        if self.viewpoint.eye.is_some() {
            return (camera, outline, "camera given".into());
        }
        if self.viewpoint.lens == Lens::Panorama {
            return (camera, outline, "panorama from the middle".into());
        }
        if !self.surveyed.outlines.is_empty() {
            return (camera, outline, "framed on the whole sequence".into());
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

    /// What is framed: of the frames that stand for the sequence, if that is asked for, else of this one.
    fn framed(&self, own: Outline) -> Outline {
        match &self.surveyed.outlines[..] {
            [] => own,
            surveyed => Outline::joined(surveyed),
        }
    }

    /// The camera that frames what a scene shows, and the outline of that; none if nothing is shown. `around` are radii of the spheres around other shapes that stand in
    /// place of spheres.
    pub(super) fn shown(&self, scene: &Scene, around: Option<Radii>) -> Option<(Camera, Outline)> {
        let outliers = self.args.camera.outliers();
        let least_radius = match around {
            Some(Radii::Uniform(radius)) => radius,
            _ => 0.0,
        };
        let (Shown { framing, outline }, particles) = Shown::of_scene(scene, least_radius, outliers)?;
        let outline = self.framed(outline);
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

    pub(super) fn colors(&self, particles: &Particles, kept: Option<&Kept>) -> Outcome<ParticleColors> {
        let look = &self.args.look;
        let mapping = look.mapping();
        let mapping = match kept.and_then(|kept| kept.range).or(self.surveyed.range) {
            Some((norm, range)) => Mapping { norm: Some(norm), range, ..mapping },
            None => mapping,
        };
        let mut colors = resolve(particles, &look.color, &mapping)?;
        if self.surveyed.range.is_some() {
            colors.description = colors.description.replace("(given)", "(of the whole sequence)");
        }
        Ok(colors)
    }

    /// All that was chosen and guessed, piece by piece.
    pub(super) fn guesses(
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
