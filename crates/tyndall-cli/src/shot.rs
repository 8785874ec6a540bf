//! A picture of spheres: all of it, a part, or one for each eye, with the layers that are asked for.

use std::path::Path;

use tyndall::film::{Surface, Window};
use tyndall::render::estimate::PIXEL_BYTES;
use tyndall::render::illustration::Illustration;
use tyndall::render::stereo::{Eyes, anaglyph, beside, side_by_side};
use tyndall::render::{Renderer, Settings};
use tyndall::scene::Scene;
use tyndall::scene::camera::Camera;
use tyndall::{Image, Result};
use tyndall_io::annotation::Frame;
use tyndall_io::write;

use crate::annotate::Seen;
use crate::args::{self, Stereo};
use crate::device::{self, Goal};
use crate::layers::{Channels, Layer, Named, Numbers};
use crate::report::{Outcome, Report};

/// Pictures of more pixels are written in bands, where the file takes that, so that they need not be in memory.
const BAND_PIXELS: u64 = 1 << 25;
/// Pixels of a band, about.
const PIXELS_AT_ONCE: u64 = 1 << 23;
/// Pictures of more pixels are too large for cards.
const CARD_PIXELS: u64 = 1 << 28;
/// Rows of a band are a multiple of this: of the edge of a film's tile.
const TILE_ROWS: u32 = 32;

/// Rows that are made at one time of a picture, if it is made in bands: where it is large, or takes more than half of `memory`.
pub(crate) fn band_rows(picture: &args::Picture, path: &Path, memory: Option<u64>) -> Option<u32> {
    let [width, height] = picture.pixels();
    let is_plain = picture.crop.is_none() && picture.stereo.is_none();
    let fitting = memory.map_or(u64::MAX, |bytes| bytes / (2 * PIXEL_BYTES));
    let is_large = u64::from(width) * u64::from(height) > BAND_PIXELS.min(fitting);
    let rows = PIXELS_AT_ONCE.min(fitting / 2) / u64::from(width);
    let rows = (rows as u32 / TILE_ROWS).max(1) * TILE_ROWS;
    (is_large && is_plain && write::takes_bands(path)).then_some(rows.min(height))
}

/// A picture as it was taken, or one for each eye.
pub(crate) struct Taken {
    first: Seen,
    second: Option<(Stereo, Seen)>,
}

impl Taken {
    /// A picture that is for both eyes.
    pub(crate) fn one(seen: Seen) -> Self {
        Self { first: seen, second: None }
    }

    /// Whether nothing is seen.
    pub(crate) fn shows_nothing(&self) -> bool {
        let second = self.second.as_ref().map(|(_, seen)| seen);
        std::iter::once(&self.first).chain(second).all(|seen| seen.image.shows_nothing())
    }

    /// The picture, and the channels beside its colors, after something was done to that of each eye. An anaglyph has the channels of the left eye.
    pub(crate) fn finished(
        self,
        mut each: impl FnMut(&mut Seen) -> Outcome<()>,
    ) -> Outcome<(Image, Channels)> {
        let Self { first: mut left, second } = self;
        each(&mut left)?;
        let Some((stereo, mut right)) = second else { return Ok((left.image, left.channels)) };
        each(&mut right)?;
        Ok(match stereo {
            Stereo::SideBySide => {
                let width = left.image.width;
                for ((_, left), (_, right)) in left.channels.iter_mut().zip(&right.channels) {
                    *left = beside(width, left, right);
                }
                (side_by_side(&left.image, &right.image), left.channels)
            }
            Stereo::Anaglyph => (anaglyph(&left.image, &right.image), left.channels),
        })
    }
}

/// What of a picture cards do not draw, as the command line calls it, if anything of that is wanted.
pub(crate) fn beyond_cards(args: &args::Render) -> Option<&'static str> {
    let picture = &args.picture;
    let [width, height] = picture.pixels();
    [
        (picture.crop.is_some(), "--crop"),
        (picture.stereo.is_some(), "--stereo"),
        (args.camera.panorama, "--panorama"),
        (picture.wants_surfaces(), "--layers normal and position"),
        (u64::from(width) * u64::from(height) > CARD_PIXELS, "pictures of so many pixels"),
    ]
    .into_iter()
    .find_map(|(is_wanted, name)| is_wanted.then_some(name))
}

/// Pixels of the longer side of a preview.
const PREVIEW: f64 = 1024.0;

/// What makes pictures of a scene.
pub(crate) struct Shot<'a> {
    pub(crate) picture: &'a args::Picture,
    pub(crate) layers: &'a [Named],
    pub(crate) numbers: &'a [Numbers],
    pub(crate) settings: &'a Settings,
    pub(crate) goal: Goal,
    pub(crate) illustration: Illustration,
    pub(crate) report: &'a Report,
    /// Makes a whole picture, on the device that was chosen.
    pub(crate) whole: &'a dyn Fn(&Scene, &Camera) -> Result<Image>,
}

impl Shot<'_> {
    /// The picture, or that of each eye.
    pub(crate) fn take(&self, scene: &mut Scene, camera: &Camera) -> Outcome<Taken> {
        let Settings { width, height, .. } = *self.settings;
        let Some(stereo) = self.picture.stereo else {
            let (image, channels) =
                self.with_layers((scene, camera), (self.settings, self.goal), self.picture.crop)?;
            let frame = self.picture.frame();
            return Ok(Taken::one(Seen { image, channels, camera: *camera, frame }));
        };
        let eyes = Eyes::new(camera, self.picture.eye_separation.map(f64::from), [width, height])?;
        let settings = Settings { width: eyes.width, ..*self.settings };
        let goal = self.goal.of_share(0.5);
        let mut of_eye = |eye: usize| -> Outcome<Seen> {
            let (camera, part) = (eyes.cameras[eye], eyes.windows[eye]);
            let (image, channels) = self.with_layers((scene, &camera), (&settings, goal), Some(part))?;
            let frame = Frame { seen: [eyes.width, height], part };
            Ok(Seen { image, channels, camera, frame })
        };
        Ok(Taken { first: of_eye(0)?, second: Some((stereo, of_eye(1)?)) })
    }

    /// All of the picture in a small size, which tells where there is room.
    pub(crate) fn preview(&self, scene: &Scene, camera: &Camera) -> Outcome<Image> {
        let Settings { width, height, .. } = *self.settings;
        let share = PREVIEW / f64::from(width.max(height));
        let [width, height] = [width, height].map(|it| (f64::from(it) * share).round().max(1.0) as u32);
        let settings = Settings { width, height, samples: 1, ..*self.settings };
        let mut renderer = Renderer::new(scene, camera, &settings)?;
        renderer.finish(&())?;
        Ok(renderer.image())
    }

    fn with_layers(
        &self,
        (scene, camera): (&mut Scene, &Camera),
        (settings, goal): (&Settings, Goal),
        window: Option<Window>,
    ) -> Outcome<(Image, Channels)> {
        let (mut image, surfaces) = match window {
            None if !self.picture.wants_surfaces() => ((self.whole)(scene, camera)?, Vec::new()),
            _ => self.part((scene, camera), (settings, goal), window)?,
        };
        self.illustrate((scene, camera), settings, window, &mut image)?;
        let mut channels: Channels = self.numbers.iter().map(|it| it.channel(&image.id)).collect();
        for named in self.layers {
            let &Named::Layer(layer) = named else { continue };
            if matches!(layer, Layer::Normal | Layer::Position) {
                channels.extend(layer.of_surfaces(&surfaces));
            }
            if let Some(light) = layer.light(&scene.lighting)? {
                let own = (std::mem::replace(&mut scene.lighting, light), scene.background.take());
                let lit = match window {
                    None => (self.whole)(scene, camera),
                    Some(_) => self.part((scene, camera), (settings, goal), window).map(|(image, _)| image),
                };
                (scene.lighting, scene.background) = own;
                channels.extend(layer.of_colors(&lit?));
            }
        }
        Ok((image, channels))
    }

    /// Draws over a picture, or a part of it.
    fn illustrate(
        &self,
        seen: (&Scene, &Camera),
        settings: &Settings,
        window: Option<Window>,
        image: &mut Image,
    ) -> Result<()> {
        let size = [settings.width, settings.height];
        let window = window.unwrap_or(Window::whole(settings.width, settings.height));
        self.illustration.draw(seen, size, window, image, self.report.progress())
    }

    /// A part of a picture, or all of it, with its surfaces.
    fn part(
        &self,
        (scene, camera): (&Scene, &Camera),
        (settings, goal): (&Settings, Goal),
        window: Option<Window>,
    ) -> Result<(Image, Vec<Surface>)> {
        let window = window.unwrap_or(Window::whole(settings.width, settings.height));
        let mut renderer = Renderer::of_window(scene, camera, settings, window)?;
        device::complete(&mut renderer, goal, self.report)?;
        let surfaces = if self.picture.wants_surfaces() { renderer.surfaces() } else { Vec::new() };
        Ok((renderer.image(), surfaces))
    }

    /// The band of `rows` rows that begins with row `first`.
    pub(crate) fn band(&self, scene: &Scene, camera: &Camera, first: u32, rows: u32) -> Result<Image> {
        let Settings { width, height, .. } = *self.settings;
        let window = Window { x: 0, y: first, width, height: rows.min(height - first) };
        let goal = self.goal.of_share(f64::from(window.height) / f64::from(height));
        let (mut image, _) = self.part((scene, camera), (self.settings, goal), Some(window))?;
        self.illustrate((scene, camera), self.settings, Some(window), &mut image)?;
        Ok(image)
    }
}
