//! Filling the cache: lattices are chosen, lights without extent are looked up through the medium, the rest is solved or gathered.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::super::balls::Wanted;
use super::super::columns::{self, Source};
use super::super::diffuse::{self, Accuracy, Bodies, Channel, Level};
use super::super::field::{Field, anchored, sample, samples, spacing};
use super::super::gather::{PhotonMap, Radius};
use super::super::harmonics::{self, count};
use super::super::photons::{self, Stored};
use super::super::solids::{Smooth, Solids};
use super::super::sweep::Ordinate;
use super::{Cache, Channels, Direct, Gathered, Multiple, Settings};
use crate::error::{Error, Result};
use crate::math::exp_minus;
use crate::medium::grid::Lattice;
use crate::medium::{Light, Medium};
use crate::pages;
use crate::progress::Progress;

/// More samples than this are too many unless asked for: of the light of lights without extent, and of what is smooth.
const MOST_SAMPLES: [f64; 2] = [4e6, 5e5];
/// The coarsest lattice that a solve begins on has about so many samples.
const COARSEST: u64 = 6000;
/// More samples than this are refused: 2 GB a field.
const ALLOWED_SAMPLES: f64 = 5e8;
/// More passes of photons are a mistake.
const MOST_PASSES: u32 = 1_000_000;
const ACCURACY: Accuracy = Accuracy { change: 1e-3, sweeps: [200, 3] };

/// The cache in the making.
pub(super) struct Builder<'a> {
    medium: &'a Medium,
    lights: &'a [Light],
    /// The same, with the suns of images of the sky as lights of their own.
    parted: Vec<Light>,
    /// Outside bodies.
    density: Field,
    /// The share of space that bodies take, at the same samples.
    covered: Option<Arc<Field>>,
    /// Lattices to solve on, from fine to coarse.
    lattices: Vec<Lattice>,
    order: usize,
    /// The share of scattering that is taken as going straight on, like light that was not scattered.
    peak: f32,
    channels: Channels,
    ordinates: Vec<Vec3>,
    solids: Option<Solids<'a>>,
    /// The same for smooth light, on each lattice.
    bodies: Vec<Smooth>,
    progress: &'a dyn Progress,
}

impl<'a> Builder<'a> {
    pub(super) fn new(
        medium: &'a Medium,
        lights: &'a [Light],
        solids: Option<Solids<'a>>,
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
        if let Multiple::Photons(_, _, passes) = settings.multiple
            && !(1..=MOST_PASSES).contains(&passes)
        {
            return Err(Error::setting("photon-passes", passes, format!("1 to {MOST_PASSES}")));
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
        let [spacing, smooth] = spacings(medium, settings);
        let anchor = settings.anchor.unwrap_or(grid.origin());
        let lattice = anchored(grid, spacing, anchor);
        let covered = solids.map(|it| Arc::new(it.covered(lattice)));
        let density = outside(Field::density(grid, lattice), covered.as_deref());
        let mut lattices = vec![anchored(grid, smooth, anchor)];
        while let Some(last) = lattices.last().filter(|it| it.sample_count() > COARSEST) {
            lattices.push(anchored(grid, 2.0 * last.spacing, anchor));
        }
        progress.begin("light", None, "");
        let g = medium.optics().phase.g();
        let order = harmonics::order_for(g);
        // What photons bring was scattered in every direction.
        let peak = if settings.multiple == Multiple::Sweeps { harmonics::peak(g, order) } else { 0.0 };
        Ok(Self {
            medium,
            lights,
            parted: lights.iter().flat_map(parted).collect(),
            density,
            covered,
            bodies: solids.iter().flat_map(|it| lattices.iter().map(|lattice| it.smooth(*lattice))).collect(),
            solids,
            lattices,
            order,
            peak,
            channels: Channels::of(medium, lights, solids),
            ordinates: harmonics::directions(settings.directions as usize),
            progress,
        })
    }

    /// Transmittance of the medium alone, straight on, between the samples and each light without extent.
    pub(super) fn direct(&self) -> Vec<Direct> {
        let extinction = [0, 1, 2].map(|channel| self.channel(channel).extinction);
        let is_grey = extinction[0] == extinction[1] && extinction[1] == extinction[2];
        let channels = if is_grey { &extinction[..1] } else { &extinction[..] };
        let sharp = self.parted.iter().filter_map(|light| Some((light, source(light)?)));
        let direct = |(light, source): (&Light, Source)| {
            let mut transmittance = columns::thickness(&self.density, source).values;
            if let [extinction] = channels {
                transmittance.par_iter_mut().for_each(|it| *it = exp_minus(extinction * *it));
            } else {
                let of_sample = |&it: &f32| channels.iter().map(move |extinction| exp_minus(extinction * it));
                transmittance = transmittance.iter().flat_map(of_sample).collect();
            }
            Direct {
                light: light.clone(),
                lattice: self.density.lattice,
                transmittance,
                channels: channels.len(),
            }
        };
        sharp.map(direct).collect()
    }

    /// Dims lights where bodies hide them.
    pub(super) fn shade(&self, direct: &mut [Direct]) {
        let Some(solids) = &self.solids else { return };
        for Direct { light, lattice, transmittance, channels } in direct {
            let toward = |at: Vec3| {
                let arrival = light.toward(at, [0.5; 2]);
                (arrival.toward, arrival.distance)
            };
            solids.shade(lattice, transmittance, *channels, toward);
        }
    }

    /// Coefficients of the light of the sky and of that scattered before, in each channel that is solved.
    pub(super) fn smooth(
        &self,
        direct: &[Direct],
        settings: &Settings,
    ) -> Result<(Vec<Vec<Field>>, Option<Gathered>)> {
        let multiple = settings.multiple;
        if self.medium.optics().albedo == [0.0; 3] {
            return Ok((self.each_channel(|_| Ok(self.dark()))?, None));
        }
        if multiple == Multiple::Sweeps {
            return Ok((self.each_channel(|channel| self.diffuse(direct, channel))?, None));
        }
        let density = self.density.coarsened(self.lattices[0]);
        let sky = |channel| {
            // Photons bring what is emitted.
            let emitted = match multiple {
                Multiple::Photons(..) => None,
                _ => self.emitted(channel, &density),
            };
            let level = Level {
                density: density.clone(),
                direct: Vec::new(),
                emitted,
                bodies: self.bodies_of(0, channel),
            };
            diffuse::sky(self.channel(channel), level, &self.inflow(channel))
        };
        let mut fields = self.each_channel(|channel| Ok(sky(channel)))?;
        let mut done = None;
        if let Multiple::Photons(photons, radius, passes) = multiple {
            let noise = settings.photon_noise;
            let found = self.gathered(&photons, (radius, passes), noise, &density.values)?;
            done = Some(found.1);
            for (field, gathered) in fields.iter_mut().flatten().zip(found.0) {
                field.values.iter_mut().zip(gathered).for_each(|(value, added)| *value += added);
            }
        }
        Ok((fields, done))
    }

    /// What `solve` finds in each channel that is solved; one that is a mix of two others is mixed.
    fn each_channel(&self, solve: impl Fn(usize) -> Result<Vec<Field>>) -> Result<Vec<Vec<Field>>> {
        let channels = self.channels.solved();
        // Bodies of a color are another transport in each channel.
        let is_mixed = channels.len() == 3 && self.solids.is_none();
        let mix = Mix::of(self.medium, &self.parted).filter(|_| is_mixed);
        let Some(Mix { channel: mixed, of: [(a, share_a), (b, share_b)] }) = mix else {
            return channels.into_iter().map(solve).collect();
        };
        let (a, b) = (solve(a)?, solve(b)?);
        let mut both = a.clone();
        for (mixed, b) in both.iter_mut().zip(&b) {
            let values = mixed.values.par_iter_mut().zip(&b.values);
            values.for_each(|(value, b)| *value = share_a * *value + share_b * b);
        }
        let mut fields = vec![a, b];
        fields.insert(mixed, both);
        Ok(fields)
    }

    /// The same by sweeps, in one channel.
    fn diffuse(&self, direct: &[Direct], channel: usize) -> Result<Vec<Field>> {
        let level = |(place, &lattice): (usize, &Lattice)| {
            let density = self.density.coarsened(lattice);
            let emitted = self.emitted(channel, &density);
            let direct = self.unscattered(direct, channel, place);
            Level { direct, density, emitted, bodies: self.bodies_of(place, channel) }
        };
        let levels: Vec<Level> = self.lattices.iter().enumerate().map(level).collect();
        diffuse::solve(self.channel(channel), &levels, &self.inflow(channel), ACCURACY, self.progress)
    }

    /// The bodies on the lattice of that number, in one channel.
    fn bodies_of(&self, place: usize, channel: usize) -> Option<Bodies> {
        let Smooth { extinction, color, glow } = self.bodies.get(place)?;
        let [even, ..] = harmonics::evaluate(Vec3::Z);
        let emitted = glow.as_ref().map(|it| it[channel].iter().map(|radiance| radiance / even).collect());
        Some(Bodies { extinction: extinction.clone(), albedo: color[channel], emitted })
    }

    /// Coefficients of the light that was scattered before, from photons, at each sample: the mean of some passes, each of which
    /// has its own photons and a smaller radius than the one before.
    fn gathered(
        &self,
        settings: &photons::Settings,
        (radius, most): (Radius, u32),
        noise: Option<f32>,
        density: &[f32],
    ) -> Result<(Vec<Vec<f32>>, Gathered)> {
        let wanted = Wanted { order: self.order, channels: &self.channels.solved() };
        let mut sums: Vec<Vec<f32>> = Vec::new();
        let mut before = Vec::new();
        let mut radius = radius;
        let mut done = Gathered { passes: 0, change: f32::INFINITY };
        while done.passes < most {
            let seed = settings.seed.wrapping_add(done.passes);
            let settings = photons::Settings { seed, stored: Stored::Multiple, ..*settings };
            let photons =
                photons::trace_around(self.medium, self.lights, self.solids, &settings, self.progress)?;
            let map = PhotonMap::new(self.medium, &photons, radius)?.outside(self.covered.clone());
            let gathered = map.columns(&self.lattices[0], &wanted, self.progress)?;
            sums.resize_with(gathered.len(), || pages::zeros(self.lattices[0].sample_count() as usize));
            for (sum, gathered) in sums.iter_mut().zip(gathered) {
                sum.iter_mut().zip(gathered).for_each(|(sum, it)| *sum += it);
            }
            radius = map.shrunk(done.passes);
            done.passes += 1;
            if let Some(noise) = noise.filter(|_| done.passes.is_power_of_two()) {
                if done.passes > 1 {
                    done.change = change(&before, &sums, density);
                }
                if done.change < noise {
                    break;
                }
                before.clone_from(&sums);
            }
        }
        let share = 1.0 / done.passes as f32;
        sums.iter_mut().flatten().for_each(|it| *it *= share);
        Ok((sums, done))
    }

    /// Coefficients of no light at all.
    fn dark(&self) -> Vec<Field> {
        let lattice = self.lattices[0];
        let field = |_| Field { lattice, values: pages::zeros(lattice.sample_count() as usize) };
        (0..count(self.order)).map(field).collect()
    }

    /// The radiance that is emitted per extinction at the samples of a density on a coarse lattice, as the first coefficient: means
    /// weighted by density, so that all that is emitted is on any lattice. `None` if nothing is.
    fn emitted(&self, channel: usize, density: &Field) -> Option<Vec<f32>> {
        let emission = self.medium.emission()?;
        let [even, ..] = harmonics::evaluate(Vec3::Z);
        let share = self.medium.emitting_share()[channel] / (even * self.left(channel));
        let Some(glow) = emission.channel(channel) else {
            let radiance = emission.one_radiance().map_or(0.0, |it| it[channel]);
            return Some(vec![share * radiance; density.values.len()]);
        };
        let product = Field::product(self.medium.density(), glow, self.density.lattice);
        let product = outside(product, self.covered.as_deref());
        let mut emitted = product.coarsened(density.lattice).over(density).values;
        emitted.par_iter_mut().for_each(|it| *it *= share);
        Some(emitted)
    }

    /// The share of the extinction that is not scattering straight on.
    fn left(&self, channel: usize) -> f32 {
        1.0 - self.medium.optics().albedo[channel] * self.peak
    }

    fn channel(&self, channel: usize) -> Channel {
        let optics = self.medium.optics();
        let (extinction, albedo) = (optics.extinction[channel], optics.albedo[channel]);
        let left = self.left(channel);
        Channel {
            extinction: left * extinction,
            albedo: albedo * (1.0 - self.peak) / left,
            g: optics.phase.g(),
            peak: self.peak,
            order: self.order,
        }
    }

    /// Coefficients of the light of lights without extent at the samples of the lattice of that number: means weighted by density. Bodies weaken it as they weaken
    /// smooth light, so that they throw back the right share of what they stop.
    fn unscattered(&self, direct: &[Direct], channel: usize, place: usize) -> Vec<Vec<f32>> {
        let lattice = self.lattices[place];
        let bodies = self.bodies.get(place).map(|it| Field { lattice, values: it.extinction.clone() });
        let samples = lattice.sample_count() as usize;
        let mut coefficients: Vec<Vec<f32>> = (0..count(self.order)).map(|_| pages::zeros(samples)).collect();
        let weights = diffuse::weights(&self.density);
        let total = weights.coarsened(lattice);
        // Of a ball as large as a cell.
        let radius = lattice.spacing * (0.75 / std::f32::consts::PI).cbrt();
        for direct in direct {
            let first = channel.min(direct.channels - 1);
            let of_channel: Vec<f32> =
                direct.transmittance[first..].iter().step_by(direct.channels).copied().collect();
            let mut transmittance = diffuse::mean(&weights, &total, &of_channel);
            if let Some((bodies, source)) = bodies.as_ref().zip(source(&direct.light)) {
                let thickness = columns::thickness(bodies, source).values;
                transmittance.values.iter_mut().zip(thickness).for_each(|(it, t)| *it *= exp_minus(t));
            }
            for (place, &transmittance) in transmittance.values.iter().enumerate() {
                let arrival = direct.light.toward(lattice.position(sample(&lattice, place)), [0.5; 2]);
                let spread =
                    if arrival.distance.is_finite() { spread(arrival.distance, radius) } else { 1.0 };
                let light = arrival.light[channel] * spread * transmittance;
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
        let skies = self.parted.iter().filter_map(|light| match light {
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
    pub(super) fn finish(
        self,
        direct: Vec<Direct>,
        fields: Vec<Vec<Field>>,
        gathered: Option<Gathered>,
    ) -> Cache {
        let optics = self.medium.optics();
        let lattice = self.lattices[0];
        let columns: Vec<&[f32]> = (0..count(self.order))
            .flat_map(|number| fields.iter().map(move |of_channel| &of_channel[number].values[..]))
            .collect();
        let mut smooth = pages::zeros(columns.len() * lattice.sample_count() as usize);
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
            gathered,
        };
        if self.order == 0 {
            cache.lit = Some(cache.lit(self.medium, None));
        }
        cache
    }
}

/// How a channel follows from the two others: in a medium that treats all alike, what every light has of it is the same mix of them.
/// So it is for any two colors of light, as those of sun and sky.
struct Mix {
    channel: usize,
    /// The others in order, each with its share.
    of: [(usize, f32); 2],
}

/// Shares that sum to more would make errors larger.
const MOST_SHARES: f64 = 2.0;

impl Mix {
    /// The mix of the smallest shares, if there is one.
    fn of(medium: &Medium, lights: &[Light]) -> Option<Self> {
        if !medium.optics().is_grey() || !lights.iter().all(Light::has_one_color) {
            return None;
        }
        let power = |light: &Light| light.power(&medium.bounds()).as_dvec3();
        let emitted = match medium.emission() {
            Some(emission) => Some(emission.one_radiance()?.as_dvec3()),
            None => None,
        };
        let colors: Vec<DVec3> = lights
            .iter()
            .map(power)
            .chain(emitted)
            .filter(|it| *it != DVec3::ZERO)
            .map(|it| it / it.max_element())
            .collect();
        let mix = |channel: usize| {
            let [a, b] = [[1, 2], [0, 2], [0, 1]][channel];
            // The least squares of what is left of the channel.
            let dot = |i: usize, j: usize| colors.iter().map(|color| color[i] * color[j]).sum::<f64>();
            let determinant = dot(a, a) * dot(b, b) - dot(a, b) * dot(a, b);
            let share = |a: usize, b: usize| {
                (dot(channel, a) * dot(b, b) - dot(channel, b) * dot(a, b)) / determinant
            };
            let (share_a, share_b) = (share(a, b), share(b, a));
            let is_mix = |it: &DVec3| (it[channel] - share_a * it[a] - share_b * it[b]).abs() < 1e-6;
            let sum = share_a.abs() + share_b.abs();
            let is_good = sum <= MOST_SHARES && colors.iter().all(is_mix);
            is_good.then_some((sum, Self { channel, of: [(a, share_a as f32), (b, share_b as f32)] }))
        };
        (0..3).filter_map(mix).min_by(|(a, _), (b, _)| a.total_cmp(b)).map(|(_, mix)| mix)
    }
}

/// Root mean square by which the means of twice as many passes differ from those of the first ones, over those of all. What counts is what is scattered:
/// light times density.
fn change(before: &[Vec<f32>], sums: &[Vec<f32>], density: &[f32]) -> f32 {
    let (mut change, mut all) = (0.0, 0.0);
    for (before, sums) in before.iter().zip(sums) {
        for ((before, sum), density) in before.iter().zip(sums).zip(density) {
            change += f64::from(density * (2.0 * before - sum)).powi(2);
            all += f64::from(density * sum).powi(2);
        }
    }
    (change / all.max(f64::MIN_POSITIVE)).sqrt() as f32
}

/// What is left of a field outside bodies, which take a share of the space at each sample.
fn outside(mut field: Field, covered: Option<&Field>) -> Field {
    for (value, covered) in field.values.iter_mut().zip(covered.iter().flat_map(|it| &it.values)) {
        *value *= 1.0 - covered;
    }
    field
}

/// Distances of the samples of lights without extent, and of what is smooth.
pub(super) fn spacings(medium: &Medium, settings: &Settings) -> [f32; 2] {
    let grid = medium.density();
    let sharp = settings.spacing.unwrap_or_else(|| spacing(grid, grid.finest_spacing(), MOST_SAMPLES[0]));
    // Matter that glows is brightest beside itself.
    let steps = if medium.emission().is_some() { 1.0 } else { 2.0 };
    let smooth = || spacing(grid, steps * sharp, MOST_SAMPLES[1]);
    [sharp, settings.diffuse_spacing.unwrap_or_else(smooth)]
}

/// The mean of one over the square of the distance from a light over a ball whose middle is `distance` away, in units of that at the
/// middle: what a sample near the light stands for is much less than what arrives at the very sample.
fn spread(distance: f32, radius: f32) -> f32 {
    let x = distance / radius;
    if x > 8.0 {
        return 1.0 + 0.2 / (x * x);
    }
    let logarithm = ((1.0 + x) / (1.0 - x).abs().max(f32::MIN_POSITIVE)).ln();
    // Without the light's own place, where the square is 0 and the product is all that counts.
    0.75 * x * x * (2.0 + (1.0 - x * x) / x.max(f32::MIN_POSITIVE) * logarithm)
}

/// A light, or in place of an image of the sky its suns and the rest.
fn parted(light: &Light) -> Vec<Light> {
    match light {
        Light::Environment(sky) => {
            let (suns, rest) = sky.without_suns();
            suns.into_iter()
                .map(|sun| Light::Directional(sun.into()))
                .chain([Light::Environment(rest)])
                .collect()
        }
        light => vec![light.clone()],
    }
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
