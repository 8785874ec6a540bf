//! From a scene to a picture: passes of samples into a film.
//!
//! [`Renderer::pass`] adds up to sixteen samples to every pixel; [`Renderer::image`] is the picture so far; [`Interactive`] keeps a scene that
//! changes. The same settings
//! give the same picture, bit for bit, whatever the number of threads and the width of SIMD.

pub mod certified;
pub mod confidence;
pub mod cpu;
mod drawn;
pub mod estimate;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod illustration;
pub mod interactive;
pub mod medium;
pub mod normals;
mod paths;
pub mod project;
pub mod refine;
mod samples;
mod sampling;
mod shade;
pub mod stereo;
mod surface;

use std::slice;

use crate::error::{Error, Result};
use crate::film::{Image, Surface, Window};
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::camera::{Camera, View};
use crate::scene::light::{Lighting, Paths};
use cpu::Film;
use drawn::Drawn;
pub use interactive::Interactive;
pub use samples::SampleBuffer;
use sampling::{Nearness, PATTERN, Samples};

/// The knobs of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Pixels in a row; 1 to 65536.
    pub width: u32,
    /// Rows; 1 to 65536.
    pub height: u32,
    /// Samples a pixel; with one, the sample is the pixel's center. At least 1.
    pub samples: u32,
    /// Another seed gives other random numbers.
    pub seed: u32,
    /// What is not traced because it is likely, or sure, to be hidden.
    pub culling: Culling,
}

/// How particles that others hide are left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Culling {
    /// Not at all, beyond what each ray finds for itself.
    Off,
    /// Where a pixel is likely to be covered. Lossy.
    Confidence(confidence::Options),
    /// Where that is proven. The picture is that of `Off`, bit for bit.
    Certified(certified::Options),
}

impl Culling {
    /// Which proofs are sought.
    fn certified(&self) -> certified::Options {
        match self {
            Self::Certified(options) => *options,
            _ => certified::Options::OFF,
        }
    }
}

impl Default for Culling {
    fn default() -> Self {
        Self::Certified(certified::Options::default())
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self { width: 1920, height: 1080, samples: 64, seed: 0, culling: Culling::default() }
    }
}

impl Settings {
    /// Fails with [`Error::Setting`] if a knob is out of range, or not for what `scene` shows.
    fn check(&self, scene: &Scene) -> Result<()> {
        let Self { width, height, samples, .. } = *self;
        if !(1..=65536).contains(&width) || !(1..=65536).contains(&height) {
            return Err(Error::setting("size", format!("{width}x{height}"), "1x1 to 65536x65536 pixels"));
        }
        if samples == 0 {
            return Err(Error::setting("samples", samples, "at least 1 a pixel"));
        }
        scene.lighting.check()?;
        scene.check_cut()?;
        let replicated = scene.structure().replicas().is_some();
        let has_shapes = scene.shapes().is_some();
        match &self.culling {
            Culling::Confidence(_) if replicated || has_shapes => Err(Error::setting(
                "culling",
                "confidence",
                "off or certified with shapes beside spheres or periodic images",
            )),
            Culling::Confidence(_) if scene.cut().is_some() => {
                Err(Error::setting("culling", "confidence", "off or certified where particles are cut"))
            }
            Culling::Certified(options) if replicated && options.coverage => {
                Err(Error::setting("certified", "coverage", "without coverage with periodic images"))
            }
            Culling::Certified(options) if scene.cut().is_some() && options.coverage => {
                Err(Error::setting("certified", "coverage", "without coverage where particles are cut"))
            }
            Culling::Off | Culling::Certified(_) => Ok(()),
            Culling::Confidence(options) => {
                scene.check_same("with --culling confidence")?;
                options.check()
            }
        }
    }

    /// Fails with [`Error::Setting`] if light or culling are not for a panorama, where `view` is one.
    fn check_view(&self, scene: &Scene, view: &View) -> Result<()> {
        let refused = |name: &str, value: &str, allowed: &str| Err(Error::setting(name, value, allowed));
        match &self.culling {
            _ if !view.panorama => Ok(()),
            Culling::Confidence(_) => refused("culling", "confidence", "off or certified in a panorama"),
            Culling::Certified(options) if options.coverage => {
                refused("certified", "coverage", "without coverage in a panorama")
            }
            _ if matches!(scene.lighting, Lighting::Paths(Paths { lens: Some(_), .. })) => {
                refused("--aperture", "given", "left out of a panorama, which has no lens")
            }
            _ => Ok(()),
        }
    }
}

/// Renders one picture, pass by pass.
pub struct Renderer<'a> {
    scene: &'a Scene,
    view: View,
    settings: Settings,
    film: Film,
    culling: Option<cpu::Confidence>,
    samples_done: u32,
    /// Those since the start.
    passes: Vec<Samples>,
    counts: certified::Counts,
    level: fearless_simd::Level,
}

impl<'a> Renderer<'a> {
    /// A picture without samples yet. Fails with [`Error::Setting`] if a knob or the camera is out of range.
    pub fn new(scene: &'a Scene, camera: &Camera, settings: &Settings) -> Result<Self> {
        Self::of_window(scene, camera, settings, Window::whole(settings.width, settings.height))
    }

    /// The same for a part of the picture, whose pixels are those of the whole, bit for bit; memory is that of the part.
    /// Fails too if the window is not within the picture, or if pixels outside of it count, as with culling by confidence.
    pub fn of_window(scene: &'a Scene, camera: &Camera, settings: &Settings, window: Window) -> Result<Self> {
        settings.check(scene)?;
        let Settings { width, height, .. } = *settings;
        window.check(width, height)?;
        if matches!(settings.culling, Culling::Confidence(_)) && window != Window::whole(width, height) {
            let allowed = "off or certified for a part of a picture: neighbors decide together";
            return Err(Error::setting("culling", "confidence", allowed));
        }
        let view = camera.view(scene.structure().origin(), width, height)?;
        settings.check_view(scene, &view)?;
        let film = Film::of_window(width, height, window);
        let culling = match settings.culling {
            Culling::Off | Culling::Certified(_) => None,
            Culling::Confidence(options) => Some(cpu::Confidence::new(scene, &film, options)?),
        };
        let level = fearless_simd::Level::new();
        let (passes, counts) = (Vec::new(), certified::Counts::default());
        Ok(Self { scene, view, settings: *settings, film, culling, samples_done: 0, passes, counts, level })
    }

    /// Finds what samples meet, and does not light it.
    pub(crate) fn unlit(mut self) -> Self {
        self.film.is_unlit = true;
        self
    }

    /// Depth and node of what each pixel shows, row by row; where it shows nothing, the depth is infinite.
    pub(crate) fn met(&self) -> (Vec<f32>, Vec<u32>) {
        self.film.met()
    }

    /// Uses narrower SIMD than the machine has.
    #[cfg(test)]
    pub(crate) fn with_level(self, level: fearless_simd::Level) -> Self {
        Self { level, ..self }
    }

    /// Whether every pixel has all its samples.
    pub fn is_done(&self) -> bool {
        self.samples_done >= self.settings.samples
    }

    /// Adds up to sixteen samples to every pixel, with culling by confidence those of a frame. Fails only when interrupted; some parts of
    /// the picture then have them, and the next pass goes on with the others.
    pub fn pass(&mut self, progress: &dyn Progress) -> Result<()> {
        let pass = self.next_pass(self.samples_done);
        self.add(pass.into_iter().collect(), progress)
    }

    /// Adds all samples that are missing, tile by tile. Fails only when interrupted, as [`Renderer::pass`] does.
    pub fn finish(&mut self, progress: &dyn Progress) -> Result<()> {
        let pixels = self.film.pixels();
        let samples = u64::from(self.settings.samples - self.samples_done);
        progress.begin("render", Some(pixels * samples), "samples");
        let mut passes: Vec<cpu::Pass> = Vec::new();
        let mut done = self.samples_done;
        while let Some(pass) = self.next_pass(done) {
            done = pass.end();
            passes.push(pass);
        }
        self.add(passes, progress)
    }

    /// The samples of every pixel that come after the first `done`, if any are missing.
    fn next_pass(&mut self, done: u32) -> Option<cpu::Pass<'a>> {
        let Settings { samples, seed, culling, .. } = self.settings;
        let at_once = match culling {
            _ if self.scene.differs_by_sample() => 1,
            Culling::Off | Culling::Certified(_) => u32::MAX,
            Culling::Confidence(options) => options.frame_samples,
        };
        let added = Samples::after(done, samples, seed)?.at_most(at_once);
        self.passes.retain(|before| before.first < added.first);
        self.passes.push(added);
        Some(self.film.pass(self.scene, self.view, added, culling.certified()))
    }

    fn add(&mut self, passes: Vec<cpu::Pass>, progress: &dyn Progress) -> Result<()> {
        let done = passes.last().map(cpu::Pass::end);
        if self.scene.differs_by_sample() {
            for pass in passes {
                let Drawn { seen, secondary } = Drawn::new(self.scene, self.settings.seed, pass.end() - 1);
                let pass = pass.through(&seen, secondary.as_ref().unwrap_or(&seen));
                cpu::for_each_tile(&mut self.film, slice::from_ref(&pass), None, self.level, progress);
                self.counts += pass.counts();
                if progress.cancelled() {
                    break;
                }
            }
        } else {
            self.add_together(&passes, progress);
        }
        if let Some(done) = done {
            if !self.film.has(done) {
                return Err(Error::Interrupted);
            }
            self.samples_done = done;
        }
        if progress.cancelled() { Err(Error::Interrupted) } else { Ok(()) }
    }

    fn add_together(&mut self, passes: &[cpu::Pass], progress: &dyn Progress) {
        match &mut self.culling {
            None => cpu::for_each_tile(&mut self.film, passes, None, self.level, progress),
            // Each pass begins with what all pixels learned in the one before.
            Some(culling) => passes.chunks(1).for_each(|pass| {
                cpu::for_each_tile(&mut self.film, pass, Some(&mut *culling), self.level, progress);
            }),
        }
        for pass in passes {
            self.counts += pass.counts();
        }
    }

    /// What certified culling saved, and what it could not, since this was made.
    pub fn counts(&self) -> certified::Counts {
        self.counts
    }

    /// Starts anew with another camera, in the same memory. Fails as [`Renderer::new`] does.
    pub fn restart(&mut self, camera: &Camera) -> Result<()> {
        let Settings { width, height, .. } = self.settings;
        let view = camera.view(self.scene.structure().origin(), width, height)?;
        self.settings.check_view(self.scene, &view)?;
        self.view = view;
        self.samples_done = 0;
        self.film.clear();
        self.passes.clear();
        if let Some(culling) = &mut self.culling {
            culling.restart();
        }
        Ok(())
    }

    /// Takes what culling by confidence has learned of this view for final, and starts the picture anew.
    pub fn settle(&mut self) {
        self.samples_done = 0;
        self.film.clear();
        if let Some(culling) = &mut self.culling {
            culling.settle();
        }
    }

    /// How far culling by confidence is; none with any other.
    pub fn confidence(&self) -> Option<confidence::Report> {
        Some(self.culling.as_ref()?.report(&self.film))
    }

    /// The picture of the samples so far.
    pub fn image(&self) -> Image {
        let mut image = Image::default();
        self.image_into(&mut image);
        image
    }

    /// What the pixels' samples nearest to their centers met, whose depths are those of the image, row by row.
    pub fn surfaces(&self) -> Vec<Surface> {
        let mut nearness = Nearness::NONE;
        let mut offsets = [[0.5; 2]; PATTERN * PATTERN];
        for samples in self.passes.iter().filter(|samples| samples.first < self.samples_done) {
            for (place, nearest) in nearness.add(samples).into_iter().enumerate() {
                offsets[place] = nearest.map_or(offsets[place], |sample| samples.offset(place, sample));
            }
        }
        self.film.surfaces(self.scene, &self.view, &offsets)
    }

    /// Writes the picture of the samples so far, whatever `image` was before.
    pub fn image_into(&self, image: &mut Image) {
        self.film.image_into(self.scene, image);
    }
}

/// Renders a whole picture.
pub fn render(scene: &Scene, camera: &Camera, settings: &Settings, progress: &dyn Progress) -> Result<Image> {
    let mut renderer = Renderer::new(scene, camera, settings)?;
    renderer.finish(progress)?;
    Ok(renderer.image())
}
