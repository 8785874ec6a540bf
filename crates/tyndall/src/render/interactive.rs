//! A scene that stays resident while it is looked at and changed.
//!
//! Camera, colors, light, radius scale and what is shown change between pictures; nothing is built anew. A picture goes from coarse to
//! fine: pixels in blocks of 8 x 8, 4 x 4 and 2 x 2, one sample in the middle of each pixel, then the samples of a finished picture, pass by pass.
//! [`Interactive::refine`] goes as far as its caller lets it, and goes on there when it is called again: time is the caller's. What it
//! comes to in the end is what [`super::render`] gives, bit for bit.
//!
//! The processor makes the pictures, or a card (`Interactive::move_to_gpu`): devices stand behind the three verbs of `Backend`.

use glam::DVec3;

#[cfg(feature = "gpu")]
use super::gpu;
use super::sampling::Samples;
use super::{Settings, certified, cpu};
use crate::error::{Error, Result};
use crate::film::Image;
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::camera::{Camera, View};
use crate::scene::color::ParticleColors;
use crate::scene::light::Lighting;
use crate::scene::select::Filter;
use crate::structure::selection::HalfSpace;

/// What changed in a scene since a device saw it last, besides view, light and background, which devices are told with every pass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Changes {
    /// The colors of the particles.
    pub(crate) colors: bool,
    /// By what their radii are scaled.
    pub(crate) radii: bool,
    /// Which of them are shown.
    pub(crate) shown: bool,
}

/// One pass of one of the pictures that a device keeps.
pub(crate) struct Shot {
    /// Which picture: its place among the steps from coarse to fine.
    pub(crate) picture: usize,
    pub(crate) view: View,
    /// Its pixels, across and down.
    pub(crate) size: [u32; 2],
    pub(crate) added: Samples,
    /// Which proofs of what is hidden are sought.
    pub(crate) certified: certified::Options,
}

/// A machine that holds a scene and renders it.
pub(crate) trait Backend: Send {
    /// Takes over what changed in the scene, and forgets the samples of all pictures.
    fn load(&mut self, scene: &Scene, changes: Changes) -> Result<()>;

    /// Adds samples to the pixels that have not got them. Fails with [`Error::Interrupted`] when told to stop; begun again, it goes on.
    fn pass(&mut self, scene: &Scene, shot: &Shot, progress: &dyn Progress) -> Result<()>;

    /// Draws a picture over `image`, which has its size; pixels without samples stay as they are.
    fn film(&mut self, scene: &Scene, picture: usize, image: &mut Image) -> Result<()>;
}

/// Edges of the blocks of pixels that stand for one, from coarse to fine.
const BLOCKS: [u32; 4] = [8, 4, 2, 1];
/// The place of the finished picture among the steps.
const FINAL: usize = BLOCKS.len();

/// How fine the picture is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// Nothing of this view is finished: the picture is still that of the last one.
    Stale,
    /// One sample for blocks of so many pixels across and down.
    Block(u32),
    /// At least so many of its samples for every pixel; some may have more.
    Samples(u32),
}

/// What is seen at a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pick {
    /// The place in the file of the particle, or of that to which a shape belongs, counted from 0; none of a mesh.
    pub place: Option<u64>,
    /// Its node: those of shapes stand behind those of the particles, those of caps of what is cut behind all of these.
    pub node: u32,
    /// Distance from the eye along the ray, as in [`Image::depth`].
    pub depth: f32,
    /// Where the ray meets it, in the file's coordinates.
    pub position: DVec3,
}

/// See the module.
pub struct Interactive {
    scene: Scene,
    camera: Camera,
    settings: Settings,
    view: View,
    backend: Box<dyn Backend>,
    /// What changed that the device does not know yet; none if this view was begun.
    changed: Option<Changes>,
    /// The step that the next view begins with, by what the last ones came to.
    first: usize,
    /// The step that this view began with, and the one that is to be done: those between are done.
    start: usize,
    step: usize,
    /// Samples of the finished picture that every pixel has.
    samples_done: u32,
    image: Image,
    coarse: Image,
}

impl Interactive {
    /// Takes a scene, to be seen by `camera`; `settings` are those of the finished picture. The processor makes the pictures, until
    /// they are moved to another device. Fails as [`super::Renderer::new`] does.
    pub fn new(scene: Scene, camera: Camera, settings: Settings) -> Result<Self> {
        settings.check(&scene)?;
        scene.check_same("where a scene is looked at while it changes")?;
        let view = camera.view(scene.structure().origin(), settings.width, settings.height)?;
        settings.check_view(&scene, &view)?;
        Ok(Self {
            scene,
            camera,
            settings,
            view,
            backend: Box::new(cpu::Films::new()),
            changed: Some(Changes::default()),
            first: 0,
            start: 0,
            step: 0,
            samples_done: 0,
            image: Image::default(),
            coarse: Image::default(),
        })
    }

    /// Sends the scene to a card, which makes the pictures from now on; `progress` is told of the upload and can stop it. What changes
    /// afterwards is sent alone. Fails as [`gpu::Resident::load`] does; then pictures are made where they were before.
    ///
    /// ```
    /// use tyndall::render::gpu::{Gpu, Options};
    /// use tyndall::render::{Interactive, Settings};
    /// use tyndall::scene::light::Lighting;
    /// use tyndall::scene::{Scene, camera::Camera, camera::Projection, color::ParticleColors};
    /// use tyndall::structure::{Kind, Structure};
    /// use tyndall::{DVec3, synthetic};
    ///
    /// let particles = synthetic::generate("packed?n=1e3", &())?;
    /// let radii = particles.radii().expect("this source has a radius").clone();
    /// let structure = Structure::build(Kind::default(), particles, &radii, 1.0, &())?;
    /// let scene = Scene::new(structure, ParticleColors::constant([0.6; 3]), Lighting::Headlight, None);
    /// let camera = Camera {
    ///     eye: DVec3::new(3.0, 2.0, 2.0),
    ///     look_at: DVec3::splat(0.5),
    ///     up: DVec3::Z,
    ///     projection: Projection::Orthographic { height: 1.8 },
    /// };
    /// let settings = Settings { width: 32, height: 32, samples: 1, ..Settings::default() };
    /// let mut interactive = Interactive::new(scene, camera, settings)?;
    /// // Where there is no card, or it has no room, the processor goes on.
    /// let moved = Gpu::open(Options::default()).and_then(|gpu| interactive.move_to_gpu(&gpu, &()));
    /// if let Err(why) = moved {
    ///     println!("{why}; using the CPU");
    /// }
    /// interactive.scale_radii(1.5)?;
    /// // With a deadline instead of `()` it returns in time, with what there is.
    /// interactive.refine(&())?;
    /// assert!(interactive.is_done() && interactive.pick(16, 16).is_some());
    /// # Ok::<(), tyndall::Error>(())
    /// ```
    #[cfg(feature = "gpu")]
    pub fn move_to_gpu(&mut self, gpu: &gpu::Gpu, progress: &dyn Progress) -> Result<()> {
        self.backend = Box::new(gpu::Films::load(gpu, &self.scene, progress)?);
        self.changed = Some(Changes::default());
        Ok(())
    }

    /// The processor makes the pictures from now on: as at the beginning, or after an error of a card.
    pub fn move_to_cpu(&mut self) {
        self.backend = Box::new(cpu::Films::new());
        self.changed = Some(Changes::default());
    }

    /// The scene as it is now.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The camera as it is now.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Gives back the scene.
    pub fn into_scene(self) -> Scene {
        self.scene
    }

    /// Looks from elsewhere. Fails if the camera cannot be.
    pub fn look_from(&mut self, camera: Camera) -> Result<()> {
        let Settings { width, height, .. } = self.settings;
        let view = camera.view(self.scene.structure().origin(), width, height)?;
        self.settings.check_view(&self.scene, &view)?;
        (self.view, self.camera) = (view, camera);
        self.restart(|_| ());
        Ok(())
    }

    /// Changes size, samples or seed of the finished picture. Fails if one is out of range.
    pub fn set(&mut self, settings: Settings) -> Result<()> {
        settings.check(&self.scene)?;
        let view = self.camera.view(self.scene.structure().origin(), settings.width, settings.height)?;
        settings.check_view(&self.scene, &view)?;
        (self.view, self.settings) = (view, settings);
        self.restart(|_| ());
        Ok(())
    }

    /// Gives the particles other colors, which stand by id.
    pub fn recolor(&mut self, colors: ParticleColors) {
        self.scene.recolor(colors);
        self.restart(|changes| changes.colors = true);
    }

    /// Lights the scene otherwise, before linear RGB or, without, nothing.
    pub fn light(&mut self, lighting: Lighting, background: Option<[f32; 3]>) {
        (self.scene.lighting, self.scene.background) = (lighting, background);
        self.restart(|_| ());
    }

    /// Scales all radii to `scale` times those of the structure that was built. Fails unless it is finite and not negative.
    pub fn scale_radii(&mut self, scale: f32) -> Result<()> {
        if !(0.0..f32::INFINITY).contains(&scale) {
            return Err(Error::setting("radius scale", scale, "a number not below 0"));
        }
        self.scene.scale_radii(scale);
        self.restart(|changes| changes.radii = true);
        Ok(())
    }

    /// Shows other particles, and tells how many: see [`Scene::select`].
    pub fn select(&mut self, filters: &[Filter], half_spaces: &[HalfSpace]) -> Result<u64> {
        let count = self.scene.select(filters, half_spaces)?;
        self.restart(|changes| changes.shown = true);
        Ok(count)
    }

    /// Whether the picture is finished.
    pub fn is_done(&self) -> bool {
        self.changed.is_none() && self.samples_done >= self.settings.samples
    }

    /// Refines the picture until it is finished or `progress` says stop, which is noticed within a tile of it, on a card within a band that
    /// takes some 8 ms: a deadline, or an event that makes the view obsolete. Says how fine it is. Fails only when the device does.
    pub fn refine(&mut self, progress: &dyn Progress) -> Result<Detail> {
        let is_new = self.changed.is_some();
        if let Some(changes) = self.changed {
            self.backend.load(&self.scene, changes)?;
            self.changed = None;
            (self.start, self.step, self.samples_done) = (self.first, self.first, 0);
        }
        while let Some(shot) = self.next() {
            match self.backend.pass(&self.scene, &shot, progress) {
                Ok(()) if shot.picture == FINAL => self.samples_done += shot.added.count,
                Ok(()) => self.step += 1,
                Err(Error::Interrupted) => break,
                Err(error) => return Err(error),
            }
        }
        if is_new {
            // The next view begins with the finest step that this one came to, so that no time goes into coarser ones.
            self.first = match self.samples_done {
                0 if self.step == self.start => self.start.saturating_sub(1),
                0 => self.step - 1,
                _ => FINAL,
            };
        }
        self.draw()
    }

    /// The picture as it is after [`Interactive::refine`].
    pub fn image(&self) -> &Image {
        &self.image
    }

    /// What is seen in the middle of a pixel, by a ray of its own; exact, however coarse the picture is. Nothing where a hold-out hides it.
    pub fn pick(&self, x: u32, y: u32) -> Option<Pick> {
        let ray = self.view.ray(x as f32 + 0.5, y as f32 + 0.5);
        let structure = self.scene.structure();
        let whole = || {
            let particle = structure.intersect(&ray, None).map(|hit| (hit.t, hit.node));
            self.scene.shape_before(&ray, particle.map(|(depth, _)| depth)).or(particle)
        };
        let met = if self.scene.cut().is_some() { self.scene.meet(&ray) } else { whole() };
        let (depth, node) = met.filter(|met| !self.scene.is_holdout(met.1))?;
        let position = structure.origin() + (ray.origin + depth * ray.direction).as_dvec3();
        Some(Pick { place: self.scene.place(node), node, depth, position })
    }

    /// Begins anew with the next picture; the device is told then.
    fn restart(&mut self, change: impl FnOnce(&mut Changes)) {
        change(self.changed.get_or_insert_default());
    }

    /// The pass that comes next; none if the picture is finished.
    fn next(&self) -> Option<Shot> {
        let Settings { width, height, samples, seed, culling } = self.settings;
        let certified = culling.certified();
        // With one sample a pixel, that is the finished picture.
        if self.step < FINAL && !(samples == 1 && BLOCKS[self.step] == 1) {
            let edge = BLOCKS[self.step];
            let view = View { pixel: self.view.pixel * edge as f32, ..self.view };
            let size = [width.div_ceil(edge), height.div_ceil(edge)];
            let added = Samples { seed, first: 0, count: 1, centered: true };
            return Some(Shot { picture: self.step, view, size, added, certified });
        }
        let added = Samples::after(self.samples_done, samples, seed)?;
        Some(Shot { picture: FINAL, view: self.view, size: [width, height], added, certified })
    }

    /// Draws what there is, the finest where it is there.
    fn draw(&mut self) -> Result<Detail> {
        let Self { scene, backend, image, coarse, .. } = self;
        let Settings { width, height, .. } = self.settings;
        let detail = match self.samples_done {
            0 if self.step == self.start => return Ok(Detail::Stale),
            0 => Detail::Block(BLOCKS[self.step - 1]),
            samples => Detail::Samples(samples),
        };
        image.resize(width, height);
        if let Detail::Block(edge) = detail {
            coarse.resize(width.div_ceil(edge), height.div_ceil(edge));
            backend.film(scene, self.step - 1, coarse)?;
            image.enlarge(coarse, edge);
        }
        backend.film(scene, FINAL, image)?;
        Ok(detail)
    }
}
