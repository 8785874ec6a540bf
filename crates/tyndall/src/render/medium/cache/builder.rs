//! Filling the cache: lattices are chosen, lights without extent are looked up through the medium, the rest is solved or gathered.

use glam::Vec3;
use rayon::prelude::*;

use super::super::columns::{self, Source};
use super::super::diffuse::{self, Accuracy, Channel, Level};
use super::super::field::{Field, lattice_over, sample};
use super::super::gather::PhotonMap;
use super::super::harmonics::{self, count};
use super::super::photons::{self, Stored};
use super::super::sweep::Ordinate;
use super::{Cache, Channels, Direct, Multiple, Settings};
use crate::error::{Error, Result};
use crate::medium::grid::Lattice;
use crate::medium::{Grid, Light, Medium};
use crate::progress::Progress;

/// More samples than this are too many unless asked for: of the light of lights without extent, and of what is smooth.
const MOST_SAMPLES: [f64; 2] = [4e6, 5e5];
/// The coarsest lattice that a solve begins on has about so many samples.
const COARSEST: u64 = 6000;
/// More samples than this are refused: 2 GB a field.
const ALLOWED_SAMPLES: f64 = 5e8;
const ACCURACY: Accuracy = Accuracy { change: 1e-3, sweeps: [200, 3] };

/// The cache in the making.
pub(super) struct Builder<'a> {
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
    pub(super) fn new(
        medium: &'a Medium,
        lights: &'a [Light],
        settings: &Settings,
        progress: &'a dyn Progress,
    ) -> Result<Self> {
        let grid = medium.density();
        let given = [("cache-voxel", settings.spacing), ("diffuse-voxel", settings.diffuse_spacing)];
        for (name, spacing) in given {
            if spacing.is_some_and(|it| !(it > 0.0 && it.is_finite())) {
                return Err(Error::setting(name, spacing.unwrap_or_default(), "a length above 0"));
            }
        }
        if !(8..=4096).contains(&settings.directions) {
            return Err(Error::setting("directions", settings.directions, "8 to 4096"));
        }
        for (name, spacing) in given.into_iter().filter_map(|(name, spacing)| Some((name, spacing?))) {
            let samples = samples(grid, spacing);
            if samples > ALLOWED_SAMPLES {
                let least = f64::from(spacing) * (samples / ALLOWED_SAMPLES).cbrt();
                return Err(Error::setting(
                    name,
                    spacing,
                    format!("at least {least:.3e}, or it would not fit"),
                ));
            }
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
    pub(super) fn direct(&self) -> Vec<Direct> {
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

    /// Coefficients of the light of the sky and of that scattered before, in each channel that is solved.
    pub(super) fn smooth(&self, direct: &[Direct], multiple: Multiple) -> Result<Vec<Vec<Field>>> {
        let channels = self.channels.solved().into_iter();
        let gathered = match multiple {
            Multiple::Sweeps => return channels.map(|channel| self.diffuse(direct, channel)).collect(),
            Multiple::None => {
                vec![[Vec3::ZERO; harmonics::COUNT]; self.lattices[0].sample_count() as usize]
            }
            Multiple::Photons(settings, radius) => {
                let settings = photons::Settings { stored: Stored::Multiple, ..settings };
                let photons = photons::trace(self.medium, self.lights, &settings, self.progress)?;
                self.gathered(&PhotonMap::new(self.medium, &photons, radius)?)?
            }
        };
        Ok(channels.map(|channel| self.with_sky(&gathered, channel)).collect())
    }

    /// The same by sweeps, in one channel.
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

    /// Interleaves the fields, and lights the density's bricks where that can be done once for all views.
    pub(super) fn finish(self, direct: Vec<Direct>, fields: Vec<Vec<Field>>) -> Cache {
        let optics = self.medium.optics();
        let lattice = self.lattices[0];
        let columns: Vec<&[f32]> = (0..count(self.order))
            .flat_map(|number| fields.iter().map(move |of_channel| &of_channel[number].values[..]))
            .collect();
        let mut smooth = vec![0.0; columns.len() * lattice.sample_count() as usize];
        smooth.par_chunks_exact_mut(columns.len()).enumerate().with_min_len(4096).for_each(
            |(place, values)| {
                values.iter_mut().zip(&columns).for_each(|(value, column)| *value = column[place]);
            },
        );
        let (far, near) = direct.into_iter().partition(|it| matches!(it.light, Light::Directional(_)));
        let mut cache = Cache {
            albedo: Vec3::from(optics.albedo),
            phase: optics.phase,
            far,
            near,
            lattice,
            smooth,
            order: self.order,
            channels: self.channels,
            lit: None,
        };
        if self.order == 0 {
            cache.lit = Some(cache.lit(self.medium, None));
            cache.far = Vec::new();
        }
        cache
    }
}

/// A spacing for which a lattice over the grid has no more than `most` samples, at least `least`.
fn spacing(grid: &Grid, least: f32, most: f64) -> f32 {
    let samples = samples(grid, least);
    if samples <= most { least } else { least * (samples / most).cbrt() as f32 }
}

/// Samples of a lattice over the grid, padding included.
fn samples(grid: &Grid, spacing: f32) -> f64 {
    let along = |count: u32| f64::from((count - 1) as f32 * grid.spacing() / spacing) + 5.0;
    grid.size().map(along).iter().product()
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
