//! The illumination cache: light that reaches the medium, kept at the samples of lattices of its own, from which the march takes it.
//!
//! Takes a medium and its lights, gives for any point and direction the radiance that scattering adds there per extinction. Lights
//! without extent are looked up through the medium between them and the point ([`columns`]); what comes from the sky or was
//! scattered before is one smooth field in spherical harmonics, by sweeps without noise ([`diffuse`]) or from photons
//! ([`gather`]). It does not depend on the camera: it is kept for as many views as one likes.
//! Source: D. Cha, S. Son, I. Ihm, "GPU-assisted high quality particle rendering", EGSR 2009 (illumination cache).

use glam::Vec3;
use rayon::prelude::*;

use super::columns::{self, Source};
use super::diffuse::{self, Accuracy, Channel, Level};
use super::field::{Field, cell, lattice_over, sample, trilinear};
use super::gather::{PhotonMap, Radius};
use super::harmonics::{self, count};
use super::photons::{self, Stored};
use super::sweep::Ordinate;
use crate::error::{Error, Result};
use crate::medium::grid::Lattice;
use crate::medium::{Grid, Light, Medium};
use crate::progress::Progress;

/// The knobs of the cache.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Distance of the samples that hold the light of lights without extent; `None`: that of the density, or more where these
    /// would be more than 4 million.
    pub spacing: Option<f32>,
    /// Distance of the samples that hold what is smooth: the light of the sky and that scattered before; `None`: twice the one
    /// above, or more where these would be more than half a million.
    pub diffuse_spacing: Option<f32>,
    /// Directions in which light travels; 8 to 4096.
    pub directions: u32,
    /// How light that was scattered more than once is found.
    pub multiple: Multiple,
}

/// How light that was scattered more than once is found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Multiple {
    /// By sweeps: without noise.
    #[default]
    Sweeps,
    /// From photons.
    Photons(photons::Settings, Radius),
    /// Not at all: light is scattered once.
    None,
}

impl Default for Settings {
    fn default() -> Self {
        Self { spacing: None, diffuse_spacing: None, directions: 64, multiple: Multiple::default() }
    }
}

/// More samples than this are too many unless asked for: of the light of lights without extent, and of what is smooth.
const MOST_SAMPLES: [f64; 2] = [4e6, 5e5];
/// The coarsest lattice that a solve begins on has about so many samples.
const COARSEST: u64 = 6000;
const ACCURACY: Accuracy = Accuracy { change: 1e-3, sweeps: [200, 3] };

/// Light in a medium. See the module.
#[derive(Clone, Debug)]
pub struct Cache {
    albedo: Vec3,
    g: f32,
    /// Lights that are looked up on their own.
    direct: Vec<Direct>,
    /// Everything else: coefficients of radiance, interleaved.
    lattice: Lattice,
    smooth: Vec<f32>,
    order: usize,
    channels: Channels,
}

/// A light without extent, and how much of it reaches the samples.
#[derive(Clone, Debug)]
struct Direct {
    light: Light,
    lattice: Lattice,
    /// Transmittance of each sample, one for all channels or one each.
    transmittance: Vec<f32>,
    channels: usize,
}

/// Which channels have to be solved, and how the others follow.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Channels {
    /// One, which the three are multiples of.
    One(usize, Vec3),
    Three,
}

impl Channels {
    fn of(medium: &Medium, lights: &[Light]) -> Self {
        let optics = medium.optics();
        let is_grey = |rgb: [f32; 3]| rgb[0] == rgb[1] && rgb[1] == rgb[2];
        if !is_grey(optics.extinction) || !is_grey(optics.albedo) {
            return Self::Three;
        }
        let mut common: Option<Vec3> = None;
        for light in lights {
            if matches!(light, Light::Environment(sky) if !sky.is_constant()) {
                return Self::Three;
            }
            let power = light.power(&medium.bounds());
            if power == Vec3::ZERO {
                continue;
            }
            let color = power / power.max_element();
            if common.is_some_and(|common| !common.abs_diff_eq(color, 1e-6)) {
                return Self::Three;
            }
            common = Some(color);
        }
        let color = common.unwrap_or(Vec3::ONE);
        Self::One(color.max_position(), color)
    }

    fn solved(&self) -> Vec<usize> {
        match self {
            Self::One(channel, _) => vec![*channel],
            Self::Three => vec![0, 1, 2],
        }
    }
}

/// What the march knows of a ray once for all its points.
#[derive(Clone, Copy, Debug)]
pub struct Toward {
    direction: Vec3,
    /// What each coefficient of radiance adds in this direction.
    weights: [f32; harmonics::COUNT],
}

impl Cache {
    /// Lights a medium. Fails with [`Error::Setting`] if a knob is out of range, and when interrupted.
    pub fn new(
        medium: &Medium,
        lights: &[Light],
        settings: &Settings,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let builder = Builder::new(medium, lights, settings, progress)?;
        let direct = builder.direct();
        let mut fields = Vec::new();
        match settings.multiple {
            Multiple::Sweeps => {
                for channel in builder.channels.solved() {
                    fields.push(builder.diffuse(&direct, channel)?);
                }
            }
            Multiple::None => {
                let nothing =
                    vec![[Vec3::ZERO; harmonics::COUNT]; builder.lattices[0].sample_count() as usize];
                for channel in builder.channels.solved() {
                    fields.push(builder.with_sky(&nothing, channel));
                }
            }
            Multiple::Photons(settings, radius) => {
                let settings = photons::Settings { stored: Stored::Multiple, ..settings };
                let photons = photons::trace(medium, lights, &settings, progress)?;
                let gathered = builder.gathered(&PhotonMap::new(medium, &photons, radius)?)?;
                for channel in builder.channels.solved() {
                    fields.push(builder.with_sky(&gathered, channel));
                }
            }
        }
        Ok(builder.finish(direct, fields))
    }

    /// The radiance that scattering adds at a point, per extinction, to light that travels to where `toward` comes from.
    #[inline]
    pub fn scattered(&self, at: Vec3, toward: &Toward) -> Vec3 {
        let mut sum = self.smooth(at, toward);
        for direct in &self.direct {
            sum += direct.scattered(at, self.g, toward);
        }
        self.albedo * sum
    }

    /// Prepares for the points of a ray; `direction` is where the ray goes, against the light.
    pub fn toward(&self, direction: Vec3) -> Toward {
        Toward { direction, weights: harmonics::scattered(-direction, self.g) }
    }

    /// Memory that it takes.
    pub fn bytes(&self) -> u64 {
        let direct: usize = self.direct.iter().map(|it| it.transmittance.len()).sum();
        4 * (direct + self.smooth.len()) as u64
    }

    /// Samples of the lattice of what is smooth.
    pub fn size(&self) -> [u32; 3] {
        self.lattice.size
    }

    #[inline(always)]
    fn smooth(&self, at: Vec3, toward: &Toward) -> Vec3 {
        let number = count(self.order);
        match self.channels {
            Channels::One(_, color) if number == 1 => {
                toward.weights[0] * trilinear(&self.lattice, &self.smooth, at) * color
            }
            Channels::One(_, color) => {
                let [sum] = interpolate::<1>(&self.lattice, &self.smooth, number, &toward.weights, at);
                sum * color
            }
            Channels::Three => {
                Vec3::from(interpolate::<3>(&self.lattice, &self.smooth, number, &toward.weights, at))
            }
        }
    }
}

/// A sum of `number` coefficients of `N` channels, interleaved, at a point between samples.
#[inline(always)]
fn interpolate<const N: usize>(
    lattice: &Lattice,
    values: &[f32],
    number: usize,
    weights: &[f32],
    at: Vec3,
) -> [f32; N] {
    let (first, [x, y, z], fraction) = cell(lattice, at);
    let near = Vec3::ONE - fraction;
    let mut sum = [0.0; N];
    for corner in 0..8 {
        let side = |bit: usize, near: f32, far: f32| if corner >> bit & 1 == 0 { near } else { far };
        let share = side(0, near.x, fraction.x) * side(1, near.y, fraction.y) * side(2, near.z, fraction.z);
        let step = |bit: usize, step: usize| if corner >> bit & 1 == 0 { 0 } else { step };
        let place = (first + step(0, x) + step(1, y) + step(2, z)) * number * N;
        let of_sample = &values[place..place + number * N];
        for (coefficients, weight) in of_sample.chunks_exact(N).zip(weights) {
            for (sum, coefficient) in sum.iter_mut().zip(coefficients) {
                *sum += share * weight * coefficient;
            }
        }
    }
    sum
}

impl Direct {
    #[inline(always)]
    fn scattered(&self, at: Vec3, g: f32, toward: &Toward) -> Vec3 {
        let arrival = self.light.toward(at, [0.5; 2]);
        let transmittance = match self.channels {
            1 => Vec3::splat(trilinear(&self.lattice, &self.transmittance, at)),
            _ => Vec3::from(interpolate::<3>(&self.lattice, &self.transmittance, 1, &[1.0], at)),
        };
        // Both point away from the scattering: light came the other way along one of them.
        let cosine = arrival.toward.dot(toward.direction);
        phase(g, cosine) * transmittance * arrival.light
    }
}

/// The phase function of Henyey and Greenstein.
#[inline(always)]
fn phase(g: f32, cosine: f32) -> f32 {
    let spread = (1.0 + g * g - 2.0 * g * cosine).max(1e-6);
    0.25 * std::f32::consts::FRAC_1_PI * (1.0 - g * g) / (spread * spread.sqrt())
}

/// The cache in the making.
struct Builder<'a> {
    medium: &'a Medium,
    lights: &'a [Light],
    density: Field,
    /// Lattices to solve on, from fine to coarse.
    lattices: Vec<Lattice>,
    order: usize,
    channels: Channels,
    ordinates: Vec<Vec3>,
    progress: &'a dyn Progress,
}

impl<'a> Builder<'a> {
    fn new(
        medium: &'a Medium,
        lights: &'a [Light],
        settings: &Settings,
        progress: &'a dyn Progress,
    ) -> Result<Self> {
        let grid = medium.density();
        for (name, spacing) in
            [("cache-voxel", settings.spacing), ("diffuse-voxel", settings.diffuse_spacing)]
        {
            if spacing.is_some_and(|it| !(it > 0.0 && it.is_finite())) {
                return Err(Error::setting(name, spacing.unwrap_or_default(), "a length above 0"));
            }
        }
        if !(8..=4096).contains(&settings.directions) {
            return Err(Error::setting("directions", settings.directions, "8 to 4096"));
        }
        let spacing = settings.spacing.unwrap_or_else(|| spacing(grid, grid.spacing(), MOST_SAMPLES[0]));
        let smooth =
            settings.diffuse_spacing.unwrap_or_else(|| self::spacing(grid, 2.0 * spacing, MOST_SAMPLES[1]));
        let mut lattices = vec![lattice_over(grid, smooth)];
        while let Some(last) = lattices.last().filter(|it| it.sample_count() > COARSEST) {
            lattices.push(lattice_over(grid, 2.0 * last.spacing));
        }
        progress.begin("light", None, "");
        let g = medium.optics().phase.g();
        Ok(Self {
            medium,
            lights,
            density: Field::density(grid, lattice_over(grid, spacing)),
            lattices,
            order: harmonics::order_for(g),
            channels: Channels::of(medium, lights),
            ordinates: harmonics::directions(settings.directions as usize),
            progress,
        })
    }

    /// Transmittance between the samples and each light without extent.
    fn direct(&self) -> Vec<Direct> {
        let extinction = self.medium.optics().extinction;
        let is_grey = extinction[0] == extinction[1] && extinction[1] == extinction[2];
        let channels = if is_grey { &extinction[..1] } else { &extinction[..] };
        let sharp = self.lights.iter().filter_map(|light| Some((light, source(light)?)));
        let direct = |(light, source): (&Light, Source)| {
            let thickness = columns::thickness(&self.density, source);
            let of_sample =
                |&thickness: &f32| channels.iter().map(move |extinction| (-extinction * thickness).exp());
            let transmittance = if channels.len() == 1 {
                thickness.values.par_iter().map(|thickness| (-channels[0] * thickness).exp()).collect()
            } else {
                thickness.values.iter().flat_map(of_sample).collect()
            };
            Direct {
                light: light.clone(),
                lattice: self.density.lattice,
                transmittance,
                channels: channels.len(),
            }
        };
        sharp.map(direct).collect()
    }

    /// Coefficients of the light of the sky and of that scattered before, in one channel.
    fn diffuse(&self, direct: &[Direct], channel: usize) -> Result<Vec<Field>> {
        let level = |&lattice: &Lattice| Level {
            density: self.density.coarsened(lattice),
            direct: self.unscattered(direct, channel, lattice),
        };
        let levels: Vec<Level> = self.lattices.iter().map(level).collect();
        diffuse::solve(self.channel(channel), &levels, &self.inflow(channel), ACCURACY, self.progress)
    }

    /// Coefficients of the light that was scattered before, from photons, at each sample.
    fn gathered(&self, photons: &PhotonMap) -> Result<Vec<[Vec3; harmonics::COUNT]>> {
        let lattice = self.lattices[0];
        self.progress.begin("gather", Some(lattice.sample_count()), "samples");
        let of_sample = |place: usize| {
            if self.progress.cancelled() {
                return [Vec3::ZERO; harmonics::COUNT];
            }
            photons.coefficients(lattice.position(sample(&lattice, place)), self.order)
        };
        let samples = (0..lattice.sample_count() as usize).into_par_iter().with_min_len(256);
        let gathered = samples.map(of_sample).collect();
        if self.progress.cancelled() { Err(Error::Interrupted) } else { Ok(gathered) }
    }

    /// What was gathered, and the light of the sky, in one channel.
    fn with_sky(&self, gathered: &[[Vec3; harmonics::COUNT]], channel: usize) -> Vec<Field> {
        let density = self.density.coarsened(self.lattices[0]);
        let mut fields = diffuse::sky(self.channel(channel), &density, &self.inflow(channel));
        for (number, field) in fields.iter_mut().enumerate() {
            let added = gathered.iter().map(|coefficients| coefficients[number][channel]);
            field.values.iter_mut().zip(added).for_each(|(value, added)| *value += added);
        }
        fields
    }

    fn channel(&self, channel: usize) -> Channel {
        let optics = self.medium.optics();
        Channel {
            extinction: optics.extinction[channel],
            albedo: optics.albedo[channel],
            g: optics.phase.g(),
            order: self.order,
        }
    }

    /// Coefficients of the light of lights without extent at the samples of a coarse lattice: means weighted by density.
    fn unscattered(&self, direct: &[Direct], channel: usize, lattice: Lattice) -> Vec<Vec<f32>> {
        let mut coefficients = vec![vec![0.0; lattice.sample_count() as usize]; count(self.order)];
        let weights = diffuse::weights(&self.density);
        let total = weights.coarsened(lattice);
        for direct in direct {
            let first = channel.min(direct.channels - 1);
            let of_channel: Vec<f32> =
                direct.transmittance[first..].iter().step_by(direct.channels).copied().collect();
            let transmittance = diffuse::mean(&weights, &total, &of_channel);
            for (place, &transmittance) in transmittance.values.iter().enumerate() {
                let arrival = direct.light.toward(lattice.position(sample(&lattice, place)), [0.5; 2]);
                let light = arrival.light[channel] * transmittance;
                let harmonics = harmonics::evaluate(-arrival.toward);
                for (coefficients, harmonic) in coefficients.iter_mut().zip(harmonics) {
                    coefficients[place] += light * harmonic;
                }
            }
        }
        coefficients
    }

    /// The directions in which light travels, with what the sky sends in along them.
    fn inflow(&self, channel: usize) -> Vec<Ordinate> {
        let skies = self.lights.iter().filter_map(|light| match light {
            Light::Environment(sky) => Some(sky),
            _ => None,
        });
        let number = self.ordinates.len();
        let weight = 4.0 * std::f32::consts::PI / number as f32;
        let mut inflow = vec![0.0_f32; number];
        for sky in skies {
            if sky.is_constant() {
                inflow.iter_mut().for_each(|it| *it += sky.mean()[channel]);
                continue;
            }
            // Each direction takes the mean of the sky nearest to it.
            let nearest = |toward: &Vec3| {
                let cosine = |ordinate: &Vec3| -ordinate.dot(*toward);
                let best = (0..number)
                    .max_by(|&a, &b| cosine(&self.ordinates[a]).total_cmp(&cosine(&self.ordinates[b])));
                best.unwrap_or(0)
            };
            let (mut sums, mut counts) = (vec![0.0_f32; number], vec![0_u32; number]);
            for toward in harmonics::directions(256 * number) {
                let ordinate = nearest(&toward);
                sums[ordinate] += sky.radiance(toward)[channel];
                counts[ordinate] += 1;
            }
            for ((inflow, sum), count) in inflow.iter_mut().zip(sums).zip(counts) {
                *inflow += sum / count.max(1) as f32;
            }
        }
        let ordinate = |(&direction, inflow)| Ordinate { direction, weight, inflow };
        self.ordinates.iter().zip(inflow).map(ordinate).collect()
    }

    /// Interleaves the fields. Where scattering is isotropic, distant lights go into the smooth field, which then is as fine as theirs.
    fn finish(self, mut direct: Vec<Direct>, mut fields: Vec<Vec<Field>>) -> Cache {
        let optics = self.medium.optics();
        let mut lattice = self.lattices[0];
        let is_merged = |direct: &Direct| self.order == 0 && matches!(direct.light, Light::Directional(_));
        if direct.iter().any(is_merged) {
            lattice = self.density.lattice;
            for (fields, channel) in fields.iter_mut().zip(self.channels.solved()) {
                let mut merged = fields[0].interpolated(lattice);
                let isotropic = harmonics::evaluate(Vec3::Z)[0];
                for direct in direct.iter().filter(|it| is_merged(it)) {
                    let irradiance = isotropic * direct.light.toward(Vec3::ZERO, [0.5; 2]).light[channel];
                    let first = channel.min(direct.channels - 1);
                    let of_channel = direct.transmittance[first..].iter().step_by(direct.channels);
                    merged.values.iter_mut().zip(of_channel).for_each(|(sum, it)| *sum += irradiance * it);
                }
                fields[0] = merged;
            }
            direct.retain(|it| !is_merged(it));
        }
        let columns: Vec<&[f32]> = (0..count(self.order))
            .flat_map(|number| fields.iter().map(move |of_channel| &of_channel[number].values[..]))
            .collect();
        let mut smooth = vec![0.0; columns.len() * lattice.sample_count() as usize];
        smooth.par_chunks_exact_mut(columns.len()).enumerate().with_min_len(4096).for_each(
            |(place, values)| {
                values.iter_mut().zip(&columns).for_each(|(value, column)| *value = column[place]);
            },
        );
        Cache {
            albedo: Vec3::from(optics.albedo),
            g: optics.phase.g(),
            direct,
            lattice,
            smooth,
            order: self.order,
            channels: self.channels,
        }
    }
}

/// A spacing for which a lattice over the grid has no more than `most` samples, at least `least`.
fn spacing(grid: &Grid, least: f32, most: f64) -> f32 {
    let samples: f64 =
        grid.size().iter().map(|&it| f64::from((it - 1) as f32 * grid.spacing() / least + 5.0)).product();
    if samples <= most { least } else { least * (samples / most).cbrt() as f32 }
}

/// Where a light without extent comes from.
fn source(light: &Light) -> Option<Source> {
    match light {
        Light::Directional(light) => Some(Source::Distant(light.along())),
        Light::Point(light) => Some(Source::Near(light.position())),
        Light::Spot(light) => Some(Source::Near(light.position())),
        Light::Environment(_) => None,
    }
}
