//! `tyndall render --mode medium`: particles, or a density from a file, as a medium in light.
//!
//! The road: density (from particles or a grid file), extinction, lights, illumination cache, march, picture. What is not said is
//! guessed from the first frame and printed; camera, extinction, lights and where samples lie are kept for all frames, so that nothing jumps.

pub(crate) mod args;
mod bodies;
mod drift;
pub(crate) mod emission;
pub(crate) mod estimate;
mod frames;
pub(crate) mod looks;
pub(crate) mod parted;
mod picture;
mod statistics;
pub(crate) mod values;

use std::path::PathBuf;
use std::time::Instant;

use clap::ValueEnum;
use tyndall::medium::density::{self, Resolution, Volume};
use tyndall::medium::grid::{Lattice, MOST_LEVELS};
use tyndall::medium::light::{Directional, Environment};
use tyndall::medium::{Emission, Grid, Light, Medium, Noise, NoiseSettings, Optics, Phase, automatic};
use tyndall::particles::{Particles, Radii};
use tyndall::render::medium::{cache, march};
use tyndall::scene::automatic::framing_of;
use tyndall::scene::camera::{Camera, View};
use tyndall::scene::outline::Outline;
use tyndall::scene::short;
use tyndall::structure::Spheres;
use tyndall::{DVec3, Error, Vec3};
use tyndall_io::read;
use tyndall_io::vdb;

use self::args::{CacheName, MethodName, NoiseKindName, OpticsName};
use self::emission::{EmissionSpec, Source, Values};
use self::looks::MediumLook;
use crate::args::{Picture, Render};
use crate::device::Goal;
use crate::layers::{self, Layer};
use crate::looks::LightLook;
use crate::render::MOST_SAMPLES;
use crate::report::{Failure, Outcome, Report, counted, seconds};
use crate::shapes::Meshes;
use crate::sources::{self, Sources};
use crate::values::Background;
use crate::{dry_run, render, survey};
use bodies::Bodies;
use parted::Parted;
use values::{NoiseMotion, Rgb};

/// Whether files are grids of OpenVDB, as the first of them is.
pub(crate) fn are_grids(files: &[PathBuf]) -> Outcome<bool> {
    Ok(files.first().is_some_and(|file| file.is_file() && vdb::is_vdb(file).unwrap_or(false)))
}

/// Renders what the command line asks for, a density from files or of particles, with the layers of `spheres` in it.
pub(crate) fn run(args: &Render, spheres: &[&Render], report: &Report) -> Outcome<()> {
    bodies::check(args, spheres)?;
    let files = &args.input.files;
    let holdouts = spheres.iter().try_fold(args.shapes.holdouts()?, |all, layer| {
        Ok::<_, Failure>(all.and(layer.shapes.holdouts()?))
    })?;
    let spheres = &Sources::open(spheres, report)?;
    let job = Job { args, spheres, holdouts: &holdouts, report };
    if let Some(grid) = &args.origin.grid {
        return job.run_grids(1, |_, names| (grid.file(), grid.density(names, report)));
    }
    if are_grids(files)? {
        return job.run_grids(files.len(), |number, names| {
            let of_density = args.input.dataset.as_deref();
            let names = if names.is_empty() { of_density.as_slice() } else { names };
            let density = read::described_density(&files[number], names, 1.0, report.progress());
            (&files[number], density.map_err(Failure::from))
        });
    }
    job.run()
}

/// What lights the medium and looks at it: guessed on the first frame and kept.
#[derive(Clone)]
struct Scene {
    extinction: [f32; 3],
    lights: Vec<Light>,
    source: Option<Source>,
    noise: Option<NoiseSettings>,
    camera: Camera,
    outline: Outline,
    /// The origin of the first frame's particles, from which the media of all frames are measured.
    origin: DVec3,
    /// Where the samples of the density lie, and the longest smoothing length.
    lattice: Lattice,
    length: Option<f32>,
    /// Where the samples of the cache lie.
    cache: cache::Settings,
    /// Of layers of spheres.
    layers: Vec<sources::Kept>,
    /// What was chosen, piece by piece.
    guesses: Vec<String>,
}

/// What is in a frame beside the density.
#[derive(Clone, Copy)]
struct Content<'a> {
    /// Those of which the density is.
    particles: Option<&'a Particles>,
    /// Their longest smoothing length.
    length: Option<f32>,
    bodies: Option<&'a Bodies>,
    /// Of the centers in the frames that stand for the sequence, if all of it is framed.
    surveyed: &'a [Outline],
}

/// The command line.
#[derive(Clone, Copy)]
struct Job<'a> {
    args: &'a Render,
    /// Layers of spheres in it.
    spheres: &'a Sources<'a>,
    /// What hides it without being shown.
    holdouts: &'a Meshes,
    report: &'a Report,
}

impl Job<'_> {
    /// Refuses before the work what cannot be.
    fn check(&self) -> Outcome<()> {
        let noise = self.args.medium.position_noise().or(self.args.medium.density_noise);
        if noise.is_some() && self.args.medium.method == MethodName::Reference {
            let text = "--method reference knows no noise — leave out --noise and --density-noise";
            return Err(Failure::Usage(text.into()));
        }
        if self.args.look.aperture.is_some() {
            return Err(Failure::Usage("--aperture is for spheres — leave it out with --mode medium".into()));
        }
        let of_light = self.goal().name().or(self.args.medium.denoise.then_some("--denoise"));
        if let Some(name) = of_light.filter(|_| self.args.medium.show != args::Shown::Light) {
            let text = format!("{name} is for pictures of light — leave it out, or --show");
            return Err(Failure::Usage(text));
        }
        if self.args.medium.denoise && self.settings().samples == 1 {
            let allowed = "at least 2 with --denoise: noise is what differs between samples";
            return Err(Error::setting("--samples", 1, allowed).into());
        }
        self.args.illustrate.refuse("--mode medium")?;
        self.args.cut.refuse("--mode medium")?;
        let picture = &self.args.picture;
        layers::asked(picture, &picture.written(0), &Layer::OF_MEDIA)?;
        if picture.stereo.is_some() {
            return Err(Failure::Usage("--stereo is for spheres — leave it out, or --mode medium".into()));
        }
        if let Some(window) = picture.crop {
            let [width, height] = picture.pixels();
            window.check(width, height)?;
        }
        let look = self.args.look.look;
        if !matches!(look, LightLook::Default | LightLook::Headlight | LightLook::Flat)
            && self.look().is_none()
        {
            let text = "this --look is for spheres — of a medium it is dust, smoke, cloud, steam, fire, explosion, nebula, spray or foam";
            return Err(Failure::Usage(text.into()));
        }
        if self.args.look.images().is_some() {
            let text = "--replicate is for spheres — leave it out, or --mode medium";
            return Err(Failure::Usage(text.into()));
        }
        if let Some(flag) = self.args.annotate.of_colors().filter(|_| !self.emission_spec().is_mapped()) {
            let text = format!(
                "{flag} is for colors that stand for numbers, which this medium has not — try --emission NAME of a quantity, --mode project, or leave it out"
            );
            return Err(Failure::Usage(text));
        }
        let shape =
            self.args.look.bonds.map(|_| "--bonds").or(self.args.shapes.name()).or(self.args.look.drawn());
        if let Some(name) = shape {
            let text = format!("{name} is for spheres — leave it out, or --mode medium");
            return Err(Failure::Usage(text));
        }
        if self.args.medium.optics == OpticsName::Absorption && self.emission_spec() != EmissionSpec::None {
            let text = "--optics absorption emits nothing — leave --emission out, or take --optics emission-absorption";
            return Err(Failure::Usage(text.into()));
        }
        if self.args.medium.optics != OpticsName::Scattering && self.args.medium.albedo.is_some() {
            let text =
                format!("--optics {} scatters nothing — leave --albedo out", name(self.args.medium.optics));
            return Err(Failure::Usage(text));
        }
        let grid = Grid::from_dense(Vec3::ZERO, 1.0, [1; 3], &[1.0])?;
        Medium::new(grid, self.optics(self.args.medium.extinction.map_or([0.0; 3], |it| it.0))?)?;
        for light in &self.args.medium.lights {
            light.light(DVec3::ZERO, self.up())?;
        }
        let noise = self.noise(1.0, DVec3::ZERO).map(Noise::new).transpose()?;
        let motion = &self.args.medium.noise_motion;
        if noise.is_none() && matches!(motion, NoiseMotion::Ids(_) | NoiseMotion::Velocities(_)) {
            let text = "--noise-motion moves noise, of which there is none — give --noise or --density-noise, or leave it out";
            return Err(Failure::Usage(text.into()));
        }
        Ok(())
    }

    /// The settings that are written into the picture.
    fn spheres_settings(&self) -> tyndall::render::Settings {
        let march::Settings { width, height, samples, seed, .. } = self.settings();
        let culling = tyndall::render::Culling::Off;
        tyndall::render::Settings { width, height, samples, seed, culling }
    }

    fn optics(&self, extinction: [f32; 3]) -> Outcome<Optics> {
        Ok(Optics { extinction, albedo: self.albedo(), phase: Phase::new(self.phase_g())? })
    }

    /// Share of the extinction that scatters.
    fn albedo(&self) -> [f32; 3] {
        match (self.args.medium.optics, self.args.medium.albedo) {
            (OpticsName::Scattering, Some(Rgb(albedo))) => albedo,
            (OpticsName::Scattering, None) => match self.look() {
                Some(look) => look.albedo,
                None if self.emission_spec() == EmissionSpec::None => [ALBEDO; 3],
                None => [ALBEDO_OF_FIRE; 3],
            },
            _ => [0.0; 3],
        }
    }

    /// Mean cosine of scattering.
    fn phase_g(&self) -> f32 {
        self.args.medium.phase_g.or(self.look().map(|it| it.g)).unwrap_or(0.0)
    }

    /// Optical thickness of the median column, where the extinction is not said.
    fn thickness(&self) -> f32 {
        match (self.args.medium.optics, self.look()) {
            (OpticsName::Scattering, Some(look)) => look.thickness,
            (optics, _) => optics.thickness(),
        }
    }

    /// The defaults that are asked for by name.
    fn look(&self) -> Option<MediumLook> {
        looks::of(self.args.look.look)
    }

    /// What is to be given off.
    fn emission_spec(&self) -> EmissionSpec {
        EmissionSpec::of(self.args)
    }

    /// Until when samples are added, if that is asked for.
    fn goal(&self) -> Goal {
        Goal { noise: self.args.medium.most_noise(), time: self.args.picture.time }
    }

    fn settings(&self) -> march::Settings {
        let Picture { samples, seed, .. } = &self.args.picture;
        let [width, height] = self.args.picture.pixels();
        march::Settings {
            width,
            height,
            samples: samples.unwrap_or(match self.has_bodies() {
                _ if self.goal().is_given() => MOST_SAMPLES,
                false => march::Settings::default().samples,
                true => SAMPLES_WITH_BODIES,
            }),
            seed: *seed,
            step: self.args.medium.step,
        }
    }

    fn background(&self) -> Background {
        let picture = &self.args.picture;
        // What only absorbs is seen before light.
        let usual = if self.args.medium.optics == OpticsName::Absorption { 1.0 } else { 0.0 };
        let background = picture.background.unwrap_or(Background::Color([usual; 3]));
        if picture.is_opaque() { background } else { Background::Nothing }
    }

    fn view(&self, camera: &Camera, origin: DVec3) -> Outcome<View> {
        let march::Settings { width, height, .. } = self.settings();
        Ok(camera.view(origin, width, height)?)
    }

    /// Which direction is up.
    fn up(&self) -> Vec3 {
        self.args.camera.up.unwrap_or(DVec3::Z).as_vec3()
    }

    /// Memory that may be used, if anybody knows.
    fn memory_bytes(&self) -> Option<u64> {
        self.args.method.memory.or_else(dry_run::available_bytes)
    }

    /// Says what the pictures would cost: a density of that lattice, for which so much memory and time is needed, and its light.
    fn dry_run(&self, lattice: &Lattice, bytes: u64, secs: f64, pictures: usize) -> Outcome<()> {
        let work = estimate::Work {
            lattice: *lattice,
            density_bytes: bytes,
            density_secs: secs,
            picture: self.settings(),
            is_reference: self.args.medium.method == MethodName::Reference,
            photons: match self.args.medium.cache {
                CacheName::Photons | CacheName::Off => self.args.medium.photons,
                CacheName::Sweeps | CacheName::Single => 0,
            },
        };
        dry_run::tell_medium(&work, pictures, self.memory_bytes(), self.report)
    }

    /// How the density of particles is estimated, and a field beside it.
    fn density_settings(&self, field: Option<String>) -> density::Settings {
        let settings = self.args.medium.density.settings(self.memory_bytes());
        density::Settings { fields: field.into_iter().collect(), ..settings }
    }

    /// From particles to their density, and a field beside it; after the first frame as there. Gives too how many they are.
    fn density(
        &self,
        (particles, parts): (&Particles, Option<&Parted>),
        field: Option<String>,
        kept: Option<&Scene>,
    ) -> Outcome<(Volume, usize)> {
        let mut settings = self.density_settings(field);
        if let Some(scene) = kept {
            if settings.resolution == Resolution::Automatic {
                settings.finer = settings.finer.or(Some(MOST_LEVELS));
            }
            settings.resolution = Resolution::Continued(scene.lattice);
            settings.length = scene.length.or(settings.length);
        }
        let start = Instant::now();
        let (volume, count) = match parts {
            Some(parts) => parts.density(&settings, &self.args.input, self.report)?,
            None => (density::estimate(particles, &settings, self.report.progress())?, particles.len()),
        };
        self.report.detail(format_args!("density: {}", seconds(start.elapsed().as_secs_f64())));
        let statistics = &volume.statistics;
        for (name, used) in [("with any particle", statistics.touched), ("with N* or more", statistics.full)]
        {
            if used.samples() > 0 {
                self.report.detail(format_args!(
                    "particles used by grid points {name} within h0: {:.1} ± {:.1} (ratio {:.2}), {}",
                    used.mean(),
                    used.deviation(),
                    used.ratio(),
                    counted(used.samples() as usize, "point")
                ));
            }
        }
        volume.notes.iter().for_each(|note| self.report.detail(note));
        Ok((volume, count))
    }

    fn described(&self, count: usize, volume: &Volume) -> Vec<String> {
        let args = &self.args.medium.density;
        let mut smoothing = name(args.smoothing);
        if let Some(length) = volume.length {
            smoothing += &format!(" h0 {}", short(length.into()));
        }
        smoothing += &format!(", N* {}, {} kernel", args.neighbors, name(args.kernel));
        vec![
            format!("medium, cpu {} threads", rayon::current_num_threads()),
            counted(count, "particle"),
            smoothing,
        ]
    }

    /// What of the medium and its light is not said, guessed.
    fn scene(
        &self,
        (grid, values): (Grid, Option<Values>),
        content: Content,
        kept: Option<&Scene>,
    ) -> Outcome<(Medium, Scene)> {
        let Content { particles, length, bodies, surveyed } = content;
        let args = &self.args.medium;
        let origin = particles.map_or(DVec3::ZERO, |it| it.positions().origin());
        if grid.max() <= 0.0 {
            let text = match particles {
                Some(_) => "the density is 0 everywhere — do the particles weigh anything? (--weight one)",
                None => "the density is 0 everywhere — is it the right grid, the right scale?",
            };
            return Err(Failure::Unseen(text.into()));
        }
        if let Some(scene) = kept {
            let scene = scene.clone();
            let emission = scene.source.as_ref().map(|it| it.emission(self.args, &grid, values.as_ref()));
            return Ok((self.medium(grid, scene.extinction, emission.transpose()?)?, scene));
        }
        let (extinction, text) = match args.extinction {
            Some(Rgb(extinction)) => (extinction, format!("extinction {} given", shown(extinction))),
            None => {
                let thickness = self.thickness();
                let extinction = automatic::extinction(&grid, thickness);
                let thickness = short(thickness.into());
                let text = format!(
                    "extinction {}: the median column is {thickness} thick",
                    short(extinction.into())
                );
                ([extinction; 3], text)
            }
        };
        let [x, y, z] = grid.size();
        let [stored, all] = grid.stored_bricks();
        let finer = match grid.levels()[1..].iter().sum::<usize>() {
            0 => String::new(),
            count => format!(", {count} of them finer"),
        };
        let spacing = short(grid.spacing().into());
        let mut guesses = vec![
            format!("grid {x}x{y}x{z}, spacing {spacing}, {stored} of {all} bricks{finer}"),
            self.model(particles.and_then(Particles::length_unit)),
            text,
        ];
        if let Some(look) = self.look() {
            guesses.push(format!("look {}", look.name));
        }
        if args.optics == OpticsName::Scattering {
            guesses.push(format!("albedo {}, g {}", shown(self.albedo()), self.phase_g()));
        }
        let source = Source::of(self.args, &self.emission_spec(), &grid, values.as_ref())?;
        let (source, text) = source.unzip();
        guesses.extend(text);
        if args.emission_scale != 1.0 {
            guesses.push(format!("emission times {}", short(args.emission_scale.into())));
        }
        let emission =
            source.as_ref().map(|it| it.emission(self.args, &grid, values.as_ref())).transpose()?;
        let medium = self.medium(grid, extinction, emission)?;
        let lattice = medium.density().lattice();
        let cache = cache::Settings { spacing: args.cache_voxel, ..cache::Settings::default() }.kept(&medium);

        let viewpoint = render::viewpoint(self.args)?;
        let radius = 2.0 * f64::from(medium.density().spacing());
        let (outline, framed) = survey::framed(self.outline(&medium, particles), surveyed, radius);
        let (outline, framed) = match bodies {
            None => (outline, framed),
            Some(bodies) if bodies.outlines.is_empty() => {
                guesses.extend(bodies.descriptions.iter().cloned());
                (outline, framed)
            }
            Some(bodies) => {
                guesses.extend(bodies.descriptions.iter().cloned());
                let others = bodies.outlines.iter().cloned();
                let all: Vec<Outline> = std::iter::once(outline).chain(others).collect();
                (Outline::joined(&all), "framed on all layers".into())
            }
        };
        let march::Settings { width, height, samples, .. } = self.settings();
        let camera = viewpoint.camera(&outline, f64::from(width) / f64::from(height));
        let view = self.view(&camera, origin)?;
        let lights = if args.lights.is_empty() && args.optics != OpticsName::Scattering {
            Vec::new()
        } else if args.lights.is_empty() {
            guesses.push("lit by a sun from the upper left and a sky".into());
            default_lights(&view)?
        } else {
            args.lights.iter().map(|light| light.light(origin, self.up())).collect::<tyndall::Result<_>>()?
        };
        let noise = self.noise(medium.bounds().extent().max_element(), origin);
        if let Some(noise) = &noise {
            let kind = if args.noise_kind == NoiseKindName::Curl { "curl " } else { "" };
            guesses.push(format!(
                "{kind}noise {} octaves, scale {}",
                noise.octaves,
                short(noise.scale.into())
            ));
        }
        guesses.push(match (args.method, args.cache) {
            (MethodName::Reference, _) => "path tracer".into(),
            _ if args.optics != OpticsName::Scattering => "marched".into(),
            (_, CacheName::Sweeps) => "cache by sweeps".into(),
            (_, CacheName::Photons) => "cache from photons".into(),
            (_, CacheName::Single) => "light scattered once".into(),
            (_, CacheName::Off) => "no cache".into(),
        });
        let given = self.args.camera.described().or(viewpoint.eye.map(|_| "camera given".into()));
        let framing = given.unwrap_or(framed);
        let most = if self.goal().is_given() { "at most " } else { "" };
        guesses.extend([framing, format!("{width}x{height}, {most}{samples} samples")]);
        guesses.extend(args.denoise.then(|| "denoised".into()));
        let layers = bodies.map_or(Vec::new(), |bodies| bodies.kept.clone());
        let scene = Scene {
            extinction,
            lights,
            source,
            noise,
            camera,
            outline,
            origin,
            lattice,
            length,
            cache,
            layers,
            guesses,
        };
        Ok((medium, scene))
    }

    /// Layers of spheres in a frame, measured from `origin`.
    fn bodies(&self, number: usize, origin: DVec3, kept: Option<&Scene>) -> Outcome<Option<Bodies>> {
        Bodies::of(self, number, origin, kept.map_or(&[][..], |kept| &kept.layers))
    }

    /// Whether anything in the medium ends rays.
    fn has_bodies(&self) -> bool {
        !self.spheres.is_empty() || self.holdouts.have_holdouts()
    }

    /// How many frames there are, where the medium has so many.
    fn frames(&self, own: usize) -> Outcome<usize> {
        let count = if own == 1 { self.spheres.frames().max(1) } else { own };
        self.spheres.check(count)?;
        Ok(count)
    }

    /// A medium of that density.
    fn medium(&self, grid: Grid, extinction: [f32; 3], emission: Option<Emission>) -> Outcome<Medium> {
        let medium = Medium::new(grid, self.optics(extinction)?)?;
        Ok(match emission {
            Some(emission) => medium.with_emission(emission)?,
            None => medium,
        })
    }

    /// The optical model by name, its equation and its unit.
    fn model(&self, length_unit: Option<&str>) -> String {
        let optics = self.args.medium.optics;
        let emits = self.emission_spec() != EmissionSpec::None;
        let emission = if emits && optics == OpticsName::Scattering { " and emission" } else { "" };
        let unit = length_unit.unwrap_or("length");
        format!("optics {}{emission}, {}, k per {unit}", name(optics), optics.equation(emits))
    }

    /// What the camera shows, and how it was found: the particles without far outliers, each as wide as a few grid points.
    fn outline(&self, medium: &Medium, particles: Option<&Particles>) -> (Outline, String) {
        let Some(particles) = particles else {
            let bounds = medium.density().filled_bounds().unwrap_or(medium.bounds());
            return (Outline::of_box(&bounds, DVec3::ZERO), "framed on the medium".into());
        };
        let radii = Radii::Uniform(2.0 * medium.density().spacing());
        let spheres = Spheres { particles, radii: &radii, radius_scale: 1.0 };
        let outliers = self.args.camera.outliers();
        let framing = framing_of(spheres, outliers);
        (Outline::of(spheres, &framing), framing.description)
    }

    /// The noise that is asked for, in a medium of that size.
    fn noise(&self, extent: f32, origin: DVec3) -> Option<NoiseSettings> {
        let args = &self.args.medium;
        // The path tracer knows no noise: what nobody asks for is left out.
        let of_look = self.look().and_then(|it| it.noise).filter(|_| args.method != MethodName::Reference);
        let position = if args.density_noise.is_some() {
            args.position_noise()
        } else {
            args.position_noise().or(of_look)
        };
        let octaves = position.or(args.density_noise)?.octaves;
        Some(NoiseSettings {
            kind: args.noise_kind.kind(),
            position: position.map_or(0.0, |it| it.amplitude),
            density: args.density_noise.map_or(0.0, |it| it.amplitude),
            octaves,
            scale: args.noise_scale.unwrap_or(extent / NOISE_CELLS),
            // Noise belongs to the coordinates of the file, wherever its particles are.
            anchor: (-origin).as_vec3(),
            detail: args.noise_detail,
            seed: self.args.picture.seed,
        })
    }
}

/// Share of the extinction that scatters where nobody says, without and with emission: of clouds, of soot.
const ALBEDO: f32 = 0.95;
const ALBEDO_OF_FIRE: f32 = 0.3;
/// Samples of a pixel where light is thrown back by spheres, if nobody says.
const SAMPLES_WITH_BODIES: u32 = 32;
/// Cells of the noise along the longest side of a medium, where nobody says.
const NOISE_CELLS: f32 = 30.0;

/// How the command line calls a value.
fn name(value: impl ValueEnum) -> String {
    value.to_possible_value().map_or(String::new(), |it| it.get_name().to_string())
}

/// One number where all are equal.
fn shown(rgb: [f32; 3]) -> String {
    let [r, g, b] = rgb.map(|it| short(it.into()));
    if r == g && g == b { r } else { format!("{r},{g},{b}") }
}

/// A warm sun from the upper left, a little behind the medium, and a cool sky.
fn default_lights(view: &View) -> Outcome<Vec<Light>> {
    let toward = 0.9 * view.up - 0.75 * view.right + 0.25 * view.forward;
    let sun = Directional::new(-toward, [5.4, 5.0, 4.5])?;
    let sky = Environment::constant([0.12, 0.16, 0.22])?;
    Ok(vec![Light::Directional(sun), Light::Environment(sky)])
}
