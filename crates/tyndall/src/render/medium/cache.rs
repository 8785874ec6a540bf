//! The illumination cache: light that reaches the medium, kept at the samples of lattices of its own, from which the march takes it.
//!
//! Takes a medium and its lights, gives for any point and direction the radiance that scattering and emission add there per extinction. Lights
//! without extent are looked up through the medium between them and the point (`columns.rs`); what comes from the sky or was
//! scattered before is one smooth field in spherical harmonics, by sweeps without noise (`diffuse.rs`) or from photons
//! (`gather.rs`). It does not depend on the camera: it is kept for as many views as one likes.
//! Source: D. Cha, S. Son, I. Ihm, "GPU-assisted high quality particle rendering", EGSR 2009 (illumination cache).

mod builder;

use std::borrow::Cow;

use glam::Vec3;

use self::builder::Builder;
use super::field::{cell, trilinear, trilinear_row};
use super::gather::Radius;
use super::harmonics::{self, count};
use super::lit::{Lights, LitBricks, Spectrum};
use super::photons;
use super::solids::Solids;
use crate::error::Result;
use crate::medium::grid::{EDGE, Lattice};
use crate::medium::{Light, Medium, Phase};
use crate::progress::Progress;
use crate::scene::camera::View;

/// The knobs of the cache.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Distance of the samples that hold the light of lights without extent; `None`: that of the density's finest bricks, or more where these
    /// would be more than 4 million.
    pub spacing: Option<f32>,
    /// Distance of the samples that hold what is smooth: the light of the sky and that scattered before; `None`: twice the one
    /// above, in a medium that emits just that, or more where these would be more than half a million.
    pub diffuse_spacing: Option<f32>,
    /// A point from which all samples lie at whole spacings, measured as the density is; `None`: the first sample of the density.
    pub anchor: Option<Vec3>,
    /// Directions in which light travels; 8 to 4096.
    pub directions: u32,
    /// How light that was scattered more than once is found.
    pub multiple: Multiple,
    /// Passes of photons end when the light that they bring has changed by less than this share of itself, root mean square, since there were half as
    /// many; `None`: after all passes.
    pub photon_noise: Option<f32>,
}

/// Photons of a cache.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gathered {
    /// Passes of them.
    pub passes: u32,
    /// By which share of itself their light has changed since there were half as many, root mean square; infinite where nobody asked.
    pub change: f32,
}

/// How light that was scattered more than once is found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Multiple {
    /// By sweeps: without noise.
    #[default]
    Sweeps,
    /// From photons, gathered within a radius; the mean of so many passes, each with photons of its own and a smaller radius than the
    /// one before, at least 1.
    Photons(photons::Settings, Radius, u32),
    /// Not at all: light is scattered once.
    None,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            spacing: None,
            diffuse_spacing: None,
            anchor: None,
            directions: 64,
            multiple: Multiple::default(),
            photon_noise: None,
        }
    }
}

impl Settings {
    /// The same with the lattices that they mean for this medium. With these the samples of other media, such as those of later frames, lie at the
    /// same places, wherever the media end, so that light does not flicker.
    pub fn kept(self, medium: &Medium) -> Self {
        let [spacing, diffuse] = builder::spacings(medium, &self);
        let anchor = self.anchor.unwrap_or(medium.density().origin());
        Self { spacing: Some(spacing), diffuse_spacing: Some(diffuse), anchor: Some(anchor), ..self }
    }
}

/// Light in a medium. See the module.
#[derive(Clone, Debug)]
pub struct Cache {
    albedo: Vec3,
    phase: Phase,
    /// Distant lights, looked up on their own.
    far: Vec<Direct>,
    /// Lights at places: how bright they are changes too fast near them to be kept at samples.
    near: Vec<Direct>,
    /// Everything else: coefficients of radiance, interleaved.
    lattice: Lattice,
    smooth: Vec<f32>,
    order: usize,
    channels: Channels,
    /// All but the near lights at the samples of the density, where that is the same from everywhere.
    lit: Option<Lit>,
    gathered: Option<Gathered>,
}

/// Density and light, ready for the march.
#[derive(Clone, Debug)]
pub(super) enum Lit {
    /// Of one color.
    Grey(LitBricks<f32>, Hue),
    Colored(LitBricks<Vec3>),
}

/// The color of all light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hue {
    /// A channel in which the color is 1.
    pub(super) channel: usize,
    pub(super) color: Vec3,
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
    fn of(medium: &Medium, lights: &[Light], solids: Option<Solids>) -> Self {
        // Bodies throw back light of their colors.
        if solids.is_some() || !medium.optics().is_grey() {
            return Self::Three;
        }
        let mut common: Option<Vec3> = None;
        for light in lights {
            if !light.has_one_color() {
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
        if let Some(emission) = medium.emission() {
            match emission.one_radiance() {
                None => return Self::Three,
                Some(Vec3::ZERO) => {}
                Some(radiance) => {
                    let color = radiance / radiance.max_element();
                    if common.is_some_and(|common| !common.abs_diff_eq(color, 1e-6)) {
                        return Self::Three;
                    }
                    common = Some(color);
                }
            }
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

impl Cache {
    /// Lights a medium. Fails with [`crate::Error::Setting`] if a knob is out of range, and when interrupted.
    pub fn new(
        medium: &Medium,
        lights: &[Light],
        settings: &Settings,
        progress: &dyn Progress,
    ) -> Result<Self> {
        Self::around(medium, lights, None, settings, progress)
    }

    /// The same with opaque bodies in the medium, which shadow it and throw light back into it.
    pub fn around(
        medium: &Medium,
        lights: &[Light],
        solids: Option<Solids>,
        settings: &Settings,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let builder = Builder::new(medium, lights, solids, settings, progress)?;
        let mut direct = builder.direct();
        let (fields, gathered) = builder.smooth(&direct, settings)?;
        builder.shade(&mut direct);
        Ok(builder.finish(direct, fields, gathered))
    }

    /// Density and light as `view` sees them: without the lights that [`Cache::near`] adds.
    pub(super) fn seen(&self, medium: &Medium, view: &View) -> Cow<'_, Lit> {
        match &self.lit {
            Some(lit) => Cow::Borrowed(lit),
            None => Cow::Owned(self.lit(medium, Some(view))),
        }
    }

    /// All but the near lights at the samples of the density, as it is seen in a view, or from anywhere.
    fn lit(&self, medium: &Medium, view: Option<&View>) -> Lit {
        let grid = medium.density();
        let far = self.far.iter().map(|it| it.lattice.spacing);
        let spacing = far.fold(self.lattice.spacing, f32::min);
        let seen = Seen { cache: self, medium, lattice: grid.lattice(), spacing, view };
        match self.channels {
            Channels::One(channel, color) => Lit::Grey(LitBricks::new(grid, &seen), Hue { channel, color }),
            Channels::Three => Lit::Colored(LitBricks::new(grid, &seen)),
        }
    }

    /// Whether [`Cache::near`] has anything to add.
    #[inline(always)]
    pub(super) fn has_near(&self) -> bool {
        !self.near.is_empty()
    }

    /// The radiance that scattering of lights at places adds at a point, per extinction, to light that travels against
    /// `direction`.
    pub(super) fn near(&self, at: Vec3, direction: Vec3) -> Vec3 {
        self.albedo * self.near.iter().map(|light| light.scattered(at, self.phase, direction)).sum::<Vec3>()
    }

    /// The radiance that scattering adds at a point, per extinction, to light that travels against `direction`. Never below 0, as the few harmonics of
    /// light that comes from one side, such as beside fire, may be on the other.
    pub(super) fn scattered(&self, at: Vec3, direction: Vec3) -> Vec3 {
        let weights = harmonics::scattered(-direction, self.phase.g());
        let far: Vec3 = self.far.iter().map(|light| light.scattered(at, self.phase, direction)).sum();
        self.albedo * (self.smooth(at, &weights) + far).max(Vec3::ZERO) + self.near(at, direction)
    }

    /// Memory that it takes.
    pub fn bytes(&self) -> u64 {
        let direct: usize = self.far.iter().chain(&self.near).map(|it| it.transmittance.len()).sum();
        let lit = match &self.lit {
            Some(Lit::Grey(bricks, _)) => bricks.bytes(),
            Some(Lit::Colored(bricks)) => bricks.bytes(),
            None => 0,
        };
        4 * (direct + self.smooth.len()) as u64 + lit
    }

    /// Its photons, if light comes from some.
    pub fn gathered(&self) -> Option<Gathered> {
        self.gathered
    }

    /// Samples of the lattice of what is smooth.
    pub fn size(&self) -> [u32; 3] {
        self.lattice.size
    }

    #[inline(always)]
    fn smooth(&self, at: Vec3, weights: &[f32; harmonics::COUNT]) -> Vec3 {
        let number = count(self.order);
        match self.channels {
            Channels::One(_, color) if number == 1 => {
                weights[0] * trilinear(&self.lattice, &self.smooth, at) * color
            }
            Channels::One(_, color) => {
                let [sum] = interpolate::<1>(&self.lattice, &self.smooth, number, weights, at);
                sum * color
            }
            Channels::Three => Vec3::from(interpolate::<3>(&self.lattice, &self.smooth, number, weights, at)),
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
    /// The radiance that scattering adds to light that travels against `direction`.
    #[inline(always)]
    fn scattered(&self, at: Vec3, phase: Phase, direction: Vec3) -> Vec3 {
        let arrival = self.light.toward(at, [0.5; 2]);
        let transmittance = match self.channels {
            1 => Vec3::splat(trilinear(&self.lattice, &self.transmittance, at)),
            _ => Vec3::from(interpolate::<3>(&self.lattice, &self.transmittance, 1, &[1.0], at)),
        };
        // Both point away from the scattering: light came the other way along one of them.
        phase.evaluate(arrival.toward.dot(direction)) * transmittance * arrival.light
    }
}

/// The light of a cache at the samples of the density.
struct Seen<'a> {
    cache: &'a Cache,
    medium: &'a Medium,
    lattice: Lattice,
    /// The least distance of samples that hold light.
    spacing: f32,
    view: Option<&'a View>,
}

impl<L: Spectrum> Lights<L> for Seen<'_> {
    #[inline(always)]
    fn row(&self, first: [u32; 3], along: u32, row: &mut [L; EDGE]) {
        let Cache { albedo, phase, channels, order, .. } = *self.cache;
        let spacing = self.lattice.spacing / along as f32;
        let lattice = Lattice { spacing, ..self.lattice };
        let start = lattice.position(first);
        // Loops, not maps: what is done in closures of arrays leaves the instruction set.
        let (mut at, mut directions) = ([Vec3::ZERO; EDGE], [Vec3::Z; EDGE]);
        for place in 0..EDGE {
            at[place] = lattice.position([first[0] + place as u32, first[1], first[2]]);
            // What is the same from everywhere may be seen from anywhere.
            if let Some(view) = self.view {
                directions[place] = view.toward(at[place]);
            }
        }

        let mut sums = [Vec3::ZERO; EDGE];
        match channels {
            Channels::One(_, color) if order == 0 => {
                let [weight, ..] = harmonics::evaluate(Vec3::Z);
                let smooth = trilinear_row::<EDGE>(&self.cache.lattice, &self.cache.smooth, start, spacing);
                for (sum, smooth) in sums.iter_mut().zip(smooth) {
                    *sum = weight * smooth * color;
                }
            }
            _ => {
                for place in 0..EDGE {
                    let weights = harmonics::scattered(-directions[place], phase.g());
                    sums[place] = self.cache.smooth(at[place], &weights);
                }
            }
        }
        for far in &self.cache.far {
            if far.channels == 1 {
                let arrival = far.light.toward(start, [0.5; 2]);
                let transmittance = trilinear_row::<EDGE>(&far.lattice, &far.transmittance, start, spacing);
                for place in 0..EDGE {
                    let share = phase.evaluate(arrival.toward.dot(directions[place])) * transmittance[place];
                    sums[place] += share * arrival.light;
                }
            } else {
                for place in 0..EDGE {
                    sums[place] += far.scattered(at[place], phase, directions[place]);
                }
            }
        }
        let channel = match channels {
            Channels::One(channel, _) => channel,
            Channels::Three => 0,
        };
        let share = self.medium.emitting_share();
        for (place, (light, sum)) in row.iter_mut().zip(sums).enumerate() {
            let mut sum = albedo * sum.max(Vec3::ZERO);
            if let Some(emission) = self.medium.emission() {
                let [i, j, k] = self.lattice.size.map(|count| (count - 1) * along);
                let within = [i.min(first[0] + place as u32), j.min(first[1]), k.min(first[2])];
                sum += share
                    * match along {
                        1 => emission.sample(within),
                        _ => emission.radiance(lattice.position(within)),
                    };
            }
            *light = L::of(sum, channel);
        }
    }

    fn spacing(&self) -> f32 {
        self.spacing
    }
}
