//! A frame: guessed where nothing is said, built once, and shown in its pictures.

use std::time::Instant;

use tyndall::particles::Radii;
use tyndall::render::Settings;
use tyndall::scene::Scene;
use tyndall::scene::arrows::Arrows;
use tyndall::scene::bonding::{self, Bonded};
use tyndall::scene::camera::Camera;
use tyndall::scene::color::{Legend, ParticleColors};
use tyndall::scene::ellipsoids::Ellipsoids;
use tyndall::scene::joined::Part;
use tyndall::scene::light::Lighting;
use tyndall::scene::motion::displacements;
use tyndall::scene::opacity::opacities;
use tyndall::scene::outline::Outline;
use tyndall::scene::viewpoint::{too_small, why_unseen};
use tyndall::structure::Spheres;
use tyndall::structure::replicas::Replicas;
use tyndall::structure::selection::HalfSpace;
use tyndall::{Cell, Error, Vec3};
use tyndall_io::Sequence;
use tyndall_io::annotation::Behind;

use super::reading::{Frame, Opened};
use super::{Job, Kept, range_of};
use crate::ahead::Ahead;
use crate::annotate::Shown as Annotated;
use crate::device::Held;
use crate::layers::Numbers;
use crate::output::Output;
use crate::plan::Picture;
use crate::report::{Failure, Outcome, seconds};
use crate::selection::{self, Found};
use crate::shot::Shot;
use crate::sources::{self, Together};
use crate::{looks, metadata, progress, structure, survey};

/// What is asked for or guessed of a frame's particles.
struct Guessed {
    radii: Radii,
    radius_scale: f32,
    camera: Camera,
    outline: Outline,
    replicas: Option<Replicas>,
    ellipsoids: Option<Ellipsoids>,
    /// Radii of the spheres around most of the ellipsoids, if there are any.
    around: Option<Radii>,
    colors: ParticleColors,
    bonded: Option<Bonded>,
    moves: Option<Vec<Vec3>>,
    opacities: Option<Vec<f32>>,
    arrows: Option<Arrows>,
    cuts: Vec<HalfSpace>,
    /// Which particles are shown: by the scene's own selection, or, beside layers, noted of each.
    selection: Option<Found>,
    shown: Option<Vec<bool>>,
    /// What is to be said of those.
    share: Option<String>,
    /// For layers of the pictures.
    numbers: Vec<Numbers>,
    /// All of this in words.
    words: Vec<String>,
}

/// A scene of a frame, and what its pictures say of it.
struct Built<'a> {
    number: usize,
    start: Instant,
    scene: Scene,
    held: Held<'a>,
    /// Particles that were not finite.
    dropped: u64,
    camera: Camera,
    outline: Outline,
    numbers: Vec<Numbers>,
    words: Vec<String>,
    time: Option<f64>,
    time_unit: Option<String>,
    length_unit: Option<String>,
    cell: Option<Cell>,
    legend: Option<Legend>,
    color_text: String,
}

impl Job<'_> {
    /// Reads a frame, builds once, and makes its pictures.
    pub(super) fn pictures_of_frame(
        &self,
        (sequence, ahead): (&Sequence, &mut Ahead),
        number: usize,
        pictures: &[&Picture],
        kept: &mut Option<Kept>,
        (output, written): (&mut Output, &mut usize),
    ) -> Outcome<()> {
        let frame = self.read((sequence, ahead), number, kept.as_ref())?;
        // What is shown is known when the scene stands.
        let frames_shown = kept.is_none() && self.args.camera.frame_shown;
        let is_first = kept.is_none();
        let guessed = self.guess(&frame, pictures, kept)?;
        if pictures.is_empty() && !frames_shown {
            return Ok(());
        }
        let around = guessed.around.clone();
        let mut built = self.build(frame, guessed, is_first)?;
        if frames_shown && let Some((camera, outline)) = self.shown(&built.scene, around) {
            if let Some(kept) = kept {
                (kept.camera, kept.outline) = (camera, outline.clone());
            }
            (built.camera, built.outline) = (camera, outline);
        }
        if pictures.is_empty() {
            return Ok(());
        }
        self.show(built, sequence, pictures, (output, written))
    }

    /// Guesses what is not said, and tells it.
    fn guess(&self, frame: &Frame, pictures: &[&Picture], kept: &mut Option<Kept>) -> Outcome<Guessed> {
        let guessing = Instant::now();
        let Frame { number, parts, opened, particles, conventions, layers, .. } = frame;
        let is_first = kept.is_none();
        let guesses = opened.as_ref().map(|opened| &opened.guesses);
        let (radii, radius_text) = self.radii(particles, guesses, kept.as_ref());
        let radius_scale = self.args.look.radius_scale;
        let spheres = Spheres { particles, radii: &radii, radius_scale };
        let ellipsoids = if parts.is_none() { self.ellipsoids(spheres, is_first)? } else { None };
        // What frames ellipsoids are the spheres around most of them.
        let around = ellipsoids.as_ref().map(|it| Radii::Uniform(it.reach));
        let (spheres, guesses, radius_text) = match (&around, &ellipsoids) {
            (Some(radii), Some(it)) => {
                let text = format!("{radius_text}; {}", it.description);
                (Spheres { radii, radius_scale: 1.0, ..spheres }, None, text)
            }
            _ => (spheres, guesses, radius_text),
        };
        let images = self.args.look.images();
        let replicas = images.map(|images| Replicas::new(particles.cell(), images)).transpose()?;
        let (camera, outline, framing_text) = match kept.as_ref() {
            Some(kept) => {
                survey::warn(self.args, particles, &kept.camera, self.report)?;
                (kept.camera, kept.outline.clone(), "framed as the first frame".to_string())
            }
            None => self.camera(spheres, replicas.as_ref(), guesses, layers),
        };
        let colors = self.colors(particles, kept.as_ref())?;
        let look = &self.args.look;
        let bonded = look.bonds.map(|which| bonding::find(particles, which, look.bond_radius)).transpose()?;
        let exposure = look.exposure(self.args.frames.fps, particles)?;
        let moves =
            exposure.map(|exposure| displacements(particles, &look.velocity, exposure)).transpose()?;
        let opacities = look.opacity.as_deref().map(|text| opacities(particles, text)).transpose()?;
        let arrows = self.args.shapes.arrows(spheres)?;
        let (selection, (shown, share)) = match layers.is_empty() {
            true => (Some(Found::of(&self.args.selection, particles)?), (None, None)),
            false => (None, selection::shown(&self.args.selection, particles)?),
        };
        let numbers = Numbers::of(particles, &self.layers, &look.color)?;
        if parts.is_some() && !numbers.is_empty() {
            let allowed =
                "without numbers of particles: these do not fit the memory with what each has of its own";
            return Err(Error::setting("--layers", "given", allowed).into());
        }
        let mut words = self.guesses(conventions, frame.count(), &radius_text, &colors, &framing_text);
        words.extend(bonded.iter().map(|bonded| bonded.description.clone()));
        words.extend(arrows.iter().map(|arrows| arrows.description.clone()));
        words.extend(self.meshes.description());
        words.extend(layers.iter().map(|layer| layer.description.clone()));
        if is_first {
            self.report.note(format_args!("tyndall: {}", words.join(" · ")));
            let has_spheres =
                ellipsoids.is_none() && !self.args.shapes.arrows_only && !self.args.camera.frame_shown;
            if has_spheres {
                let sample = opened.as_ref().map_or(spheres, |opened| opened.spheres(spheres.radius_scale));
                let Settings { width, height, .. } = self.settings;
                let first =
                    pictures.first().map(|it| it.camera(self.args, &self.viewpoint, (&camera, &outline)));
                let first = first.transpose()?.unwrap_or(camera);
                let view = first.view(particles.positions().origin(), width, height)?;
                too_small(sample, &view).iter().for_each(|warning| self.report.warn(warning));
            }
            if look.bonds.is_some() && look.radius.is_none() && look.radius_scale == 1.0 {
                let text = "note: bonds lie within the spheres where these touch; --radius-scale 0.25 shows balls and sticks";
                self.report.note(text);
            }
            let range = colors.legend.as_ref().and_then(range_of);
            let uniform = matches!(radii, Radii::Uniform(_)).then(|| radii.clone());
            *kept = Some(Kept {
                camera,
                outline: outline.clone(),
                uniform,
                range: range.filter(|_| self.args.frames.fixed_range),
                layers: sources::kept(layers),
            });
        } else {
            self.report.detail(format_args!("frame {number}: {}", words.join(" · ")));
        }
        self.report.detail(format_args!("guessing: {}", seconds(guessing.elapsed().as_secs_f64())));
        let cuts = self.args.cut.half_spaces(particles);
        Ok(Guessed {
            radii,
            radius_scale,
            camera,
            outline,
            replicas,
            ellipsoids,
            around,
            colors,
            bonded,
            moves,
            opacities,
            arrows,
            cuts,
            selection,
            shown,
            share,
            numbers,
            words,
        })
    }

    /// Arranges the particles and what stands beside them.
    fn build(&self, frame: Frame, guessed: Guessed, is_first: bool) -> Outcome<Built<'_>> {
        let building = Instant::now();
        let all = frame.count_of_all();
        let Frame { number, start, parts, opened, particles, layers, .. } = frame;
        let Guessed { radii, colors, mut words, ellipsoids, shown, .. } = guessed;
        let (time, dropped) = (particles.time(), particles.dropped().total());
        let [time_unit, length_unit] =
            [particles.time_unit(), particles.length_unit()].map(|it| it.map(str::to_string));
        let cell = particles.cell().copied();
        let (legend, color_text) = (colors.legend.clone(), colors.description.clone());
        // Where other shapes stand in their place, spheres are not seen.
        let no_spheres = ellipsoids.is_some() || self.args.shapes.arrows_only;
        let scale = if no_spheres { 0.0 } else { guessed.radius_scale };
        let origin = particles.positions().origin();
        let part = Part { particles, radii, radius_scale: scale, colors, glow: None, shown };
        let together = if layers.is_empty() {
            Together::alone(part)
        } else {
            Together::joined(Some(part), layers, origin)?
        };
        let Together { particles, radii, radius_scale: scale, colors, beside } = together;
        let ((structure, dropped), held) = match (&parts, opened) {
            (Some(parts), _) => (self.stream(parts, &radii, &colors)?, Held::NONE),
            (None, Some(Opened { mut structure, .. })) => {
                if scale != 1.0 {
                    structure.scale_radii(scale);
                }
                ((structure, dropped), Held::NONE)
            }
            (None, None) => {
                let (structure, held) =
                    self.renders.build(self.structure, particles, &radii, scale, self.report)?;
                ((structure, dropped), held)
            }
        };
        let secs = building.elapsed().as_secs_f64();
        self.report.detail(format_args!("build{}: {}", held.builder(), seconds(secs)));
        if let Some(error) = structure.packing_error() {
            let text = structure::packing_error(error);
            self.tell(is_first, &text);
            let by_axis = structure::packing_error_by_axis(error);
            self.report.detail(&by_axis);
            words.extend([text, by_axis]);
        }
        let mut scene = Scene::new(structure, colors, Lighting::Flat, self.background);
        if let Some(replicas) = &guessed.replicas {
            scene.replicate(replicas)?;
        }
        if let Some(bonded) = guessed.bonded.filter(|bonded| !bonded.segments.is_empty()) {
            scene.bond(&bonded.segments, bonded.radius)?;
        }
        if let Some(found) = &ellipsoids {
            scene.add_ellipsoids(&found.ellipsoids)?;
        }
        if let Some(arrows) = guessed.arrows.filter(|arrows| !arrows.arrows.is_empty()) {
            scene.add_arrows(&arrows.arrows, arrows.radius)?;
        }
        self.meshes.add_to(&mut scene)?;
        if let Some(warning) = self.args.shapes.add_cell(cell.as_ref(), &mut scene)? {
            self.report.warn(warning);
        }
        // What layers do not say: they are opaque and stand still.
        scene.set_opacity(guessed.opacities.map(|it| extended(it, all, 1.0)).as_deref())?;
        scene.set_motion(guessed.moves.map(|it| extended(it, all, Vec3::ZERO)).as_deref())?;
        scene.set_cut(&guessed.cuts, self.args.cut.color());
        beside.add_to(&mut scene)?;
        let hidden = guessed.selection.map(|found| found.hide_others(&mut scene)).transpose()?.flatten();
        if let Some(text) = hidden.or(guessed.share) {
            self.tell(is_first, &text);
            words.push(text);
        }
        let Guessed { camera, outline, numbers, .. } = guessed;
        Ok(Built {
            number,
            start,
            scene,
            held,
            dropped,
            camera,
            outline,
            numbers,
            words,
            time,
            time_unit,
            length_unit,
            cell,
            legend,
            color_text,
        })
    }

    /// Makes the pictures of a frame.
    fn show(
        &self,
        built: Built,
        sequence: &Sequence,
        pictures: &[&Picture],
        (output, written): (&mut Output, &mut usize),
    ) -> Outcome<()> {
        let Built { number, start, mut scene, held, dropped, time, .. } = built;
        let loading = Instant::now();
        let loaded = self.renders.load(&scene, held, self.report)?;
        self.report.detail(format_args!("upload: {}", seconds(loading.elapsed().as_secs_f64())));
        let entries = metadata::of_frame(self.args, sequence, number, time, &self.settings, &built.words);
        let annotated = Annotated {
            behind: self.behind(),
            colors: (built.legend.as_ref(), &built.color_text),
            frame: number,
            time: (time, built.time_unit.as_deref()),
            length_unit: built.length_unit.as_deref(),
            cell: built.cell,
        };
        let whole = |scene: &Scene, camera: &Camera| {
            loaded.image(scene, camera, (&self.settings, self.goal), self.report)
        };
        let shot = Shot {
            picture: &self.args.picture,
            layers: &self.layers,
            numbers: &built.numbers,
            settings: &self.settings,
            goal: self.goal,
            illustration: self.illustration,
            report: self.report,
            whole: &whole,
        };
        for (place, picture) in pictures.iter().enumerate() {
            let rendering = Instant::now();
            let camera = picture.camera(self.args, &self.viewpoint, (&built.camera, &built.outline))?;
            self.set_light(&mut scene, dropped, (&camera, picture.lens()))?;
            output.check(&annotated, &camera)?;
            let options = self.args.picture.options(metadata::of_picture(entries.clone(), picture));
            let since = if place == 0 { start } else { rendering };
            if let Some(rows) = self.band_rows(&picture.path) {
                let band = |first| shot.band(&scene, &camera, first, rows);
                let over = output.bands(&camera, &annotated, || shot.preview(&scene, &camera))?;
                let of_band = (matches!(self.behind(), Behind::Nothing), options);
                if !output.write_bands(&picture.path, of_band, over, band, || since.elapsed())? {
                    return Err(self.unseen(&scene, dropped, &camera));
                }
            } else {
                let taken = shot.take(&mut scene, &camera)?;
                if taken.shows_nothing() && self.args.picture.crop.is_none() {
                    self.check_seen(&scene, dropped, &camera)?;
                }
                self.report.detail(format_args!("render: {}", seconds(rendering.elapsed().as_secs_f64())));
                output.write(&picture.path, (taken, options), &annotated, || since.elapsed())?;
            }
            *written += 1;
            if progress::stopped() {
                return Err(Error::Interrupted.into());
            }
        }
        Ok(())
    }

    /// Fails about a picture that shows nothing, which only hold-outs may lead to.
    fn check_seen(&self, scene: &Scene, dropped: u64, camera: &Camera) -> Outcome<()> {
        let failure = self.unseen(scene, dropped, camera);
        if !self.meshes.have_holdouts() {
            return Err(failure);
        }
        self.report.warn(&format!("nothing is seen, but for --holdout: {failure}"));
        Ok(())
    }

    /// The error about a picture that shows nothing.
    fn unseen(&self, scene: &Scene, dropped: u64, camera: &Camera) -> Failure {
        if let Some(why) = self.args.cut.why_unseen(scene) {
            return Failure::Unseen(why);
        }
        let Settings { width, height, .. } = self.settings;
        match camera.view(scene.structure().origin(), width, height) {
            Ok(view) => Failure::Unseen(why_unseen(scene.structure(), dropped, &view)),
            Err(error) => error.into(),
        }
    }

    /// Lights the scene for a camera with a lens of that radius, if it has one. Fails if there is nothing to light.
    fn set_light(
        &self,
        scene: &mut Scene,
        dropped: u64,
        (camera, lens): (&Camera, Option<f64>),
    ) -> Outcome<()> {
        let Settings { width, height, .. } = self.settings;
        let view = camera.view(scene.structure().origin(), width, height)?;
        if scene.structure().is_empty() {
            return Err(Failure::Unseen(why_unseen(scene.structure(), dropped, &view)));
        }
        let adjustments = looks::adjustments(self.args, (camera, lens), self.lights.clone());
        let axes = [view.forward, view.right, view.up];
        scene.lighting = looks::look(self.args.look.look).unwrap_or_default().lighting(axes, &adjustments);
        Ok(())
    }
}
/// The same with as many more `values` as make `count`.
fn extended<T: Clone>(mut values: Vec<T>, count: usize, value: T) -> Vec<T> {
    values.resize(count, value);
    values
}
