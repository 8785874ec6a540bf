//! One medium in its light, pictured from as many sides as one likes: the light is found once.

use std::time::Instant;

use tyndall::Image;
use tyndall::medium::noise::advection::Advection;
use tyndall::medium::{Medium, Noise};
use tyndall::render::medium::brute::BruteForce;
use tyndall::render::medium::cache::{self, Cache, Gathered, Multiple};
use tyndall::render::medium::gather::PhotonMap;
use tyndall::render::medium::march::{self, Illumination, March, Pixel};
use tyndall::render::medium::photons::{self, Photons, Stored};
use tyndall::render::medium::reference::{self, Reference};
use tyndall::render::medium::refine::Goal;
use tyndall::render::medium::solids::Solids;
use tyndall::render::medium::{Backdrop, Showing, picture, show};
use tyndall::scene::camera::View;

use super::args::{CacheName, MethodName, Shown};
use super::bodies::Bodies;
use super::{Job, Scene};
use crate::device;
use crate::layers::{Channels, Layer};
use crate::report::{Failure, Outcome, bytes, counted, seconds};
use crate::values::Background;

/// The most passes of photons where noise decides, if nothing is said.
const MOST_PASSES: u32 = 64;

/// A medium in its light.
pub(super) struct Renderer<'a> {
    job: &'a Job<'a>,
    medium: &'a Medium,
    scene: &'a Scene,
    noise: Option<Noise>,
    solids: Option<Solids<'a>>,
    light: Found<'a>,
}

/// Light, as far as it is found before the picture.
enum Found<'a> {
    Nothing,
    Photons(Photons),
    Cache(Cache),
    BruteForce(BruteForce<'a>),
}

impl<'a> Renderer<'a> {
    /// Lights the medium.
    pub(super) fn new(
        job: &'a Job<'a>,
        medium: &'a Medium,
        scene: &'a Scene,
        (bodies, advection): (Option<&'a Bodies>, Option<&Advection>),
    ) -> Outcome<Self> {
        let solids = bodies.map(|bodies| Solids::new(&bodies.scene));
        let noise = scene.noise.map(Noise::new).transpose()?;
        let noise = match advection {
            Some(advection) => noise.map(|noise| noise.advected(advection.clone())),
            None => noise,
        };
        let start = Instant::now();
        let args = &job.args.medium;
        let most_noise = args.most_noise();
        let light = match (args.show, args.method, args.cache) {
            (Shown::Density, ..) | (Shown::Light, MethodName::Reference, _) => Found::Nothing,
            (Shown::Photons, ..) => Found::Photons(Self::photons(job, (medium, None), scene, Stored::All)?),
            (_, _, CacheName::Off) => {
                let photons = Self::photons(job, (medium, solids), scene, Stored::Multiple)?;
                let map = PhotonMap::new(medium, &photons, args.gather_radius.0)?;
                let brute = BruteForce::new(medium, &scene.lights, map);
                Found::BruteForce(match solids {
                    Some(solids) => brute.with_solids(solids),
                    None => brute,
                })
            }
            (_, _, name) => {
                let multiple = match name {
                    CacheName::Photons => Multiple::Photons(
                        Self::photon_settings(job, Stored::Multiple),
                        args.gather_radius.0,
                        args.photon_passes.unwrap_or(if most_noise.is_some() { MOST_PASSES } else { 1 }),
                    ),
                    CacheName::Single => Multiple::None,
                    CacheName::Sweeps | CacheName::Off => Multiple::Sweeps,
                };
                let settings = cache::Settings { multiple, photon_noise: most_noise, ..scene.cache };
                let cache = Cache::around(medium, &scene.lights, solids, &settings, job.report.progress())?;
                job.report.detail(format_args!("cache: {}", bytes(cache.bytes())));
                if let Some(Gathered { passes, change }) = cache.gathered().filter(|_| most_noise.is_some()) {
                    let change = 100.0 * change;
                    job.report.note(format_args!("photons: {passes} passes, light changed by {change:.2} %"));
                }
                Found::Cache(cache)
            }
        };
        job.report.detail(format_args!("light: {}", seconds(start.elapsed().as_secs_f64())));
        Ok(Self { job, medium, scene, noise, solids, light })
    }

    fn photon_settings(job: &Job, stored: Stored) -> photons::Settings {
        let args = &job.args.medium;
        photons::Settings {
            count: args.photons,
            seed: job.args.picture.seed,
            free_path: args.free_path,
            stored,
            memory_bytes: job.memory_bytes(),
        }
    }

    fn photons(
        job: &Job,
        (medium, solids): (&Medium, Option<Solids>),
        scene: &Scene,
        stored: Stored,
    ) -> Outcome<Photons> {
        let start = Instant::now();
        let settings = Self::photon_settings(job, stored);
        let progress = job.report.progress();
        let photons = photons::trace_around(medium, &scene.lights, solids, &settings, progress)?;
        job.report.detail(format_args!(
            "photons: {} emitted, {} stored, {}",
            counted(photons.emitted as usize, "photon"),
            counted(photons.stored.len(), "scattering"),
            seconds(start.elapsed().as_secs_f64())
        ));
        Ok(photons)
    }

    /// Makes a picture, with the channels beside its colors.
    pub(super) fn picture(&self, view: &View) -> Outcome<(Image, Channels)> {
        let start = Instant::now();
        let (image, pixels) = self.image(view)?;
        self.job.report.detail(format_args!("picture: {}", seconds(start.elapsed().as_secs_f64())));
        let layer = |name: &str, channel: usize| {
            let values = pixels.iter().map(|pixel| pixel.transmittance[channel]).collect();
            (format!("transmittance.{name}"), values)
        };
        let has_layer = self.job.args.picture.has_layer(Layer::Transmittance);
        let mut channels =
            if has_layer { vec![layer("R", 0), layer("G", 1), layer("B", 2)] } else { Vec::new() };
        let Some(window) = self.job.args.picture.crop else { return Ok((image, channels)) };
        // What is scattered in a medium is found for all of the picture.
        for (_, values) in &mut channels {
            *values = window.cut(image.width, values);
        }
        Ok((image.part(window), channels))
    }

    fn image(&self, view: &View) -> Outcome<(Image, Vec<Pixel>)> {
        let settings = self.job.settings();
        let march::Settings { width, height, .. } = settings;
        let pixels = match &self.light {
            Found::Photons(photons) => show::photons(&photons.stored, view, width, height),
            Found::Nothing if self.job.args.medium.show == Shown::Density => {
                show::density(self.medium, view, width, height)
            }
            Found::Nothing => self.reference(view)?,
            Found::Cache(cache) => self.march(view, Illumination::Cached(cache))?,
            Found::BruteForce(brute) => self.march(view, Illumination::BruteForce(brute))?,
        };
        let shows_nothing = |pixel: &Pixel| {
            pixel.transmittance == tyndall::Vec3::ONE && pixel.scattered == tyndall::Vec3::ZERO
        };
        if pixels.iter().all(shows_nothing) {
            let text =
                "nothing of the medium is in the picture — where does the camera look? (--look-at, --eye)";
            if !self.job.holdouts.have_holdouts() {
                return Err(Failure::Unseen(text.into()));
            }
            self.job.report.warn(text);
        }
        Ok((picture(&pixels, width, self.showing()), pixels))
    }

    /// How the picture is shown.
    fn showing(&self) -> Showing {
        let backdrop = match self.job.background() {
            Background::Nothing => Backdrop::Nothing,
            Background::Color(color) => Backdrop::Color(color),
            Background::Sky => Backdrop::Lights,
        };
        let exposure = match self.job.args.medium.show {
            Shown::Light => self.job.args.medium.exposure.exp2(),
            _ => 1.0,
        };
        Showing { backdrop, exposure }
    }

    /// When the picture has samples enough, if it gets them as they are needed.
    fn goal(&self) -> Option<Goal> {
        let (asked, samples) = (self.job.goal(), self.job.settings().samples);
        let noise = asked.noise.unwrap_or(0.0);
        asked.is_given().then(|| Goal { noise, samples, showing: self.showing() })
    }

    fn march(&self, view: &View, light: Illumination) -> Outcome<Vec<Pixel>> {
        let settings = self.job.settings();
        let mut march = March::new(self.medium, light, &self.scene.lights, *view, settings)?;
        if let Some(noise) = &self.noise {
            march = march.with_noise(noise);
        }
        if let Some(solids) = self.solids {
            march = march.with_solids(solids);
        }
        if self.job.args.medium.denoise {
            march = march.with_halves();
        }
        let progress = self.job.report.progress();
        if let Some(goal) = self.goal() {
            tyndall::Progress::begin(progress, "march", None, "samples");
            device::tell(march.refine(&goal, &mut self.job.goal().is_late(), progress)?, self.job.report);
        } else {
            tyndall::Progress::begin(progress, "march", Some(work(&settings)), "samples");
            while !march.is_done() {
                march.pass(progress)?;
            }
        }
        Ok(self.denoised(|| march.denoised()).unwrap_or_else(|| march.pixels()))
    }

    fn reference(&self, view: &View) -> Outcome<Vec<Pixel>> {
        let settings = self.job.settings();
        let march::Settings { width, height, samples, seed, .. } = settings;
        let free_path = self.job.args.medium.free_path;
        let of_reference = reference::Settings { width, height, seed, orders: None, free_path };
        let mut reference = Reference::new(self.medium, &self.scene.lights, *view, of_reference)?;
        if let Some(solids) = self.solids {
            reference = reference.with_solids(solids);
        }
        if self.job.args.medium.denoise {
            reference = reference.with_halves();
        }
        let progress = self.job.report.progress();
        if let Some(goal) = self.goal() {
            tyndall::Progress::begin(progress, "trace", None, "samples");
            let quality = reference.refine(&goal, &mut self.job.goal().is_late(), progress)?;
            device::tell(quality, self.job.report);
        } else {
            tyndall::Progress::begin(progress, "trace", Some(work(&settings)), "samples");
            while reference.samples_done() < samples {
                reference.pass((samples - reference.samples_done()).min(16), progress)?;
            }
        }
        Ok(self.denoised(|| reference.denoised()).unwrap_or_else(|| reference.pixels()))
    }

    /// The pixels with less noise, if that is asked for and can be.
    fn denoised(&self, pixels: impl FnOnce() -> Option<Vec<Pixel>>) -> Option<Vec<Pixel>> {
        if !self.job.args.medium.denoise {
            return None;
        }
        let start = Instant::now();
        let pixels = pixels();
        match &pixels {
            Some(_) => {
                self.job.report.detail(format_args!("denoised: {}", seconds(start.elapsed().as_secs_f64())));
            }
            None => self.job.report.note(format_args!("note: not denoised, a single sample tells no noise")),
        }
        pixels
    }
}

/// Samples of a whole picture.
fn work(settings: &march::Settings) -> u64 {
    u64::from(settings.width) * u64::from(settings.height) * u64::from(settings.samples)
}
