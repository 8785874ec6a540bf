//! Radiance that reaches a medium from the sky, from its own glowing matter or by scattering, solved without noise: sweeps along many directions, repeated until
//! scattering in is in balance with what was scattered, first on a coarse lattice, then on finer ones.
//!
//! Takes the density on lattices from fine to coarse, and what lights without extent add by their first scattering. Gives
//! coefficients of the radiance in spherical harmonics. Exact but for the lattice and the number of directions: all orders of
//! scattering are in it.
//! Source: K. Lathrop, B. Carlson, "Discrete ordinates angular quadrature of the neutron transport equation", 1965 (directions);
//! A. Brandt, "Multi-level adaptive solutions to boundary-value problems", 1977 (coarse lattices first).

use super::field::Field;
use super::harmonics::{ORDER, count};
use super::sweep::{Ordinate, Sweeper};
use crate::error::{Error, Result};
use crate::medium::grid::Lattice;
use crate::pages;
use crate::progress::Progress;

/// One channel of a medium.
#[derive(Clone, Copy, Debug)]
pub(super) struct Channel {
    /// Extinction of density 1, per unit length.
    pub(super) extinction: f32,
    /// Part of it that scatters.
    pub(super) albedo: f32,
    /// Mean cosine of scattering.
    pub(super) g: f32,
    /// The share of what a direction scatters that is taken as not scattered: extinction and albedo are without it.
    pub(super) peak: f32,
    /// Order of the spherical harmonics.
    pub(super) order: usize,
}

/// A lattice to solve on.
pub(super) struct Level {
    /// The medium's density.
    pub(super) density: Field,
    /// Coefficients of the radiance of lights without extent, before any scattering.
    pub(super) direct: Vec<Vec<f32>>,
    /// The first coefficient of what matter emits per extinction, if it does.
    pub(super) emitted: Option<Vec<f32>>,
    /// Opaque bodies, if there are any.
    pub(super) bodies: Option<Bodies>,
}

/// Opaque bodies as they are for smooth light, in one channel.
pub(super) struct Bodies {
    /// The extinction that they add, per unit length.
    pub(super) extinction: Vec<f32>,
    /// The share of what they stop that they throw back.
    pub(super) albedo: f32,
    /// The first coefficient of what they give off, if they do.
    pub(super) emitted: Option<Vec<f32>>,
}

impl Level {
    /// Extinction per unit length.
    fn extinction(&self, channel: Channel) -> Field {
        let mut values: Vec<f32> = self.density.values.iter().map(|it| channel.extinction * it).collect();
        if let Some(bodies) = &self.bodies {
            values.iter_mut().zip(&bodies.extinction).for_each(|(sum, it)| *sum += it);
        }
        Field { lattice: self.density.lattice, values }
    }

    /// The first coefficient of what is emitted per extinction, by matter and by bodies with this share of it; `None` if nothing is.
    fn source(&self, share_of_bodies: Option<&[f32]>) -> Option<Vec<f32>> {
        let of_bodies = self.bodies.as_ref().and_then(|bodies| bodies.emitted.as_ref());
        if self.emitted.is_none() && of_bodies.is_none() {
            return None;
        }
        let mut sum = self.emitted.clone().unwrap_or_else(|| pages::zeros(self.density.values.len()));
        if let Some(share) = share_of_bodies {
            sum.iter_mut().zip(share).for_each(|(it, share)| *it *= 1.0 - share);
            for ((sum, share), it) in sum.iter_mut().zip(share).zip(of_bodies.into_iter().flatten()) {
                *sum += share * it;
            }
        }
        Some(sum)
    }

    /// Of each sample the share of the extinction that is the bodies'.
    fn share(&self, channel: Channel) -> Option<Vec<f32>> {
        let bodies = self.bodies.as_ref()?;
        let of_both = self.density.values.iter().zip(&bodies.extinction);
        let share = |(density, bodies): (&f32, &f32)| {
            bodies / (channel.extinction * density + bodies).max(f32::MIN_POSITIVE)
        };
        Some(of_both.map(share).collect())
    }
}

/// When a solve is good enough.
#[derive(Clone, Copy, Debug)]
pub(super) struct Accuracy {
    /// Relative change of the radiance in one sweep of all directions.
    pub(super) change: f32,
    /// Sweeps at most, on the coarsest lattice and on each finer one.
    pub(super) sweeps: [usize; 2],
}

/// Coefficients of the radiance without that of lights without extent, on the first of the `levels`, which go from fine to coarse.
pub(super) fn solve(
    channel: Channel,
    levels: &[Level],
    ordinates: &[Ordinate],
    accuracy: Accuracy,
    progress: &dyn Progress,
) -> Result<Vec<Field>> {
    let solver = Solver::new(channel, levels, ordinates);
    let coarsest = levels.len() - 1;
    let mut radiance = solver.nothing(coarsest);
    for place in (0..levels.len()).rev() {
        if place < coarsest {
            radiance = solver.finer(place, radiance);
        }
        // What was there before the last correction by the coarser lattice, and how much the radiance changed then.
        let mut uncorrected: Option<(Radiance, f32)> = None;
        let mut is_corrected = place < coarsest;
        for _ in 0..accuracy.sweeps[usize::from(place < coarsest)] {
            if progress.cancelled() {
                return Err(Error::Interrupted);
            }
            let next = solver.lit(place, &radiance);
            let rest = difference(&next, &radiance);
            let change = (norm(&rest[0]) / norm(&next[0]).max(f64::MIN_POSITIVE)) as f32;
            if let Some((before, _)) = uncorrected.take_if(|(_, before)| change > *before) {
                // Through optically thick cells errors stay rough, which a coarser lattice takes for smooth ones: sweeps go on without it.
                (radiance, is_corrected) = (before, false);
                continue;
            }
            radiance = next;
            if change < accuracy.change {
                break;
            }
            if is_corrected {
                // What is still missing is smooth: it is found on the coarser lattice.
                let missing = solver.finer(place, solver.missing(place + 1, solver.coarser(place, &rest)));
                uncorrected = Some((radiance.clone(), change));
                add(&mut radiance, &missing);
            }
        }
    }
    Ok(fields(levels[0].density.lattice, radiance))
}

/// Coefficients of the radiance of the sky and of what is emitted, before any scattering; the light of lights without extent is left out.
pub(super) fn sky(channel: Channel, level: Level, ordinates: &[Ordinate]) -> Vec<Field> {
    let lattice = level.density.lattice;
    let samples = level.density.values.len();
    let mut source: Radiance = (0..count(channel.order)).map(|_| pages::zeros(samples)).collect();
    let emitted = level.source(level.share(channel).as_deref());
    if emitted.is_none() && ordinates.iter().all(|ordinate| ordinate.inflow == 0.0) {
        return fields(lattice, source);
    }
    if let Some(emitted) = emitted {
        source[0] = emitted;
    }
    fields(lattice, Sweeper::new(level.extinction(channel)).sweep(ordinates, &source))
}

/// Coefficients of radiance at the samples of a lattice.
type Radiance = Vec<Vec<f32>>;

struct Solver<'a> {
    channel: Channel,
    levels: &'a [Level],
    sweepers: Vec<Sweeper>,
    /// For every level, of each sample the share of bodies in the extinction, if there are any.
    shares: Vec<Option<Vec<f32>>>,
    /// For every level what is emitted: see [`Level::source`].
    sources: Vec<Option<Vec<f32>>>,
    ordinates: &'a [Ordinate],
    /// The same directions with nothing that flows in.
    dark: Vec<Ordinate>,
    /// For every level but the last: the weights of its samples in means, and their sums on the next level.
    weights: Vec<[Field; 2]>,
}

impl<'a> Solver<'a> {
    fn new(channel: Channel, levels: &'a [Level], ordinates: &'a [Ordinate]) -> Self {
        let weights = levels.windows(2).map(|pair| {
            let weights = weights(&pair[0].density);
            let sums = weights.coarsened(pair[1].density.lattice);
            [weights, sums]
        });
        let shares: Vec<_> = levels.iter().map(|level| level.share(channel)).collect();
        let sources = levels.iter().zip(&shares).map(|(level, share)| level.source(share.as_deref()));
        Self {
            channel,
            levels,
            sources: sources.collect(),
            sweepers: levels.iter().map(|level| Sweeper::new(level.extinction(channel))).collect(),
            shares,
            ordinates,
            dark: ordinates.iter().map(|it| Ordinate { inflow: 0.0, ..*it }).collect(),
            weights: weights.collect(),
        }
    }

    fn nothing(&self, place: usize) -> Radiance {
        vec![vec![0.0; self.levels[place].density.values.len()]; count(self.channel.order)]
    }

    /// The radiance after one more scattering, with that of the lights and of the matter.
    fn lit(&self, place: usize, radiance: &Radiance) -> Radiance {
        let mut arriving = radiance.clone();
        add(&mut arriving, &self.levels[place].direct);
        let mut source = self.scattered(place, arriving);
        if let Some(emitted) = &self.sources[place] {
            source[0].iter_mut().zip(emitted).for_each(|(sum, it)| *sum += it);
        }
        self.sweepers[place].sweep(self.ordinates, &source)
    }

    /// The radiance after one more scattering.
    fn scattered_once(&self, place: usize, radiance: Radiance) -> Radiance {
        self.sweepers[place].sweep(&self.dark, &self.scattered(place, radiance))
    }

    /// Coefficients of what scattering adds per extinction.
    fn scattered(&self, place: usize, mut radiance: Radiance) -> Radiance {
        let bodies = self.levels[place].bodies.as_ref().map_or(0.0, |bodies| bodies.albedo);
        let share_of_bodies = self.shares[place].as_deref();
        for (coefficients, order) in radiance.iter_mut().zip(ORDER) {
            let Channel { albedo, g, peak, .. } = self.channel;
            let share = albedo * (g.powi(order) - peak) / (1.0 - peak);
            // What bodies throw back is taken as even.
            let back = if order == 0 { bodies } else { 0.0 };
            match share_of_bodies {
                None => coefficients.iter_mut().for_each(|it| *it *= share),
                Some(of_bodies) => coefficients.iter_mut().zip(of_bodies).for_each(|(it, of_bodies)| {
                    *it *= share + of_bodies * (back - share);
                }),
            }
        }
        radiance
    }

    /// All further scatterings of `rest`, roughly.
    fn missing(&self, place: usize, rest: Radiance) -> Radiance {
        if place + 1 < self.levels.len() {
            let mut all = self.finer(place, self.missing(place + 1, self.coarser(place, &rest)));
            add(&mut all, &rest);
            return self.scattered_once(place, all);
        }
        let mut missing = self.scattered_once(place, rest.clone());
        for _ in 0..MISSING_SWEEPS {
            let mut all = missing.clone();
            add(&mut all, &rest);
            let next = self.scattered_once(place, all);
            let change = norm(&difference(&next, &missing)[0]) / norm(&next[0]).max(f64::MIN_POSITIVE);
            missing = next;
            if change < MISSING_CHANGE {
                break;
            }
        }
        missing
    }

    fn finer(&self, place: usize, coarse: Radiance) -> Radiance {
        let lattice = self.levels[place].density.lattice;
        let coarse = fields(self.levels[place + 1].density.lattice, coarse);
        coarse.into_iter().map(|it| it.interpolated(lattice).values).collect()
    }

    /// Means weighted by density.
    fn coarser(&self, place: usize, radiance: &Radiance) -> Radiance {
        let [weights, sums] = &self.weights[place];
        radiance.iter().map(|values| mean(weights, sums, values).values).collect()
    }
}

/// The coarse solve for what is missing need not be better than this, as a change from sweep to sweep.
const MISSING_CHANGE: f64 = 1e-2;
const MISSING_SWEEPS: usize = 100;

/// Weights of samples in means over coarser lattices: their density, or next to nothing where there is none.
pub(super) fn weights(density: &Field) -> Field {
    let most = density.values.iter().fold(0.0_f32, |most, &it| most.max(it));
    let least = (1e-6 * most).max(f32::MIN_POSITIVE);
    Field { lattice: density.lattice, values: density.values.iter().map(|it| it + least).collect() }
}

/// Weighted means of `values` on the lattice of `sums`, which has the coarsened weights.
pub(super) fn mean(weights: &Field, sums: &Field, values: &[f32]) -> Field {
    let weighted = weights.values.iter().zip(values).map(|(weight, value)| weight * value).collect();
    let mut mean = Field { lattice: weights.lattice, values: weighted }.coarsened(sums.lattice);
    let sums = sums.values.iter().map(|it| it.max(f32::MIN_POSITIVE));
    mean.values.iter_mut().zip(sums).for_each(|(value, sum)| *value /= sum);
    mean
}

fn fields(lattice: Lattice, coefficients: Radiance) -> Vec<Field> {
    coefficients.into_iter().map(|values| Field { lattice, values }).collect()
}

fn add(sum: &mut Radiance, radiance: &Radiance) {
    for (sum, radiance) in sum.iter_mut().zip(radiance) {
        sum.iter_mut().zip(radiance).for_each(|(sum, it)| *sum += it);
    }
}

fn difference(a: &Radiance, b: &Radiance) -> Radiance {
    a.iter().zip(b).map(|(a, b)| a.iter().zip(b).map(|(a, b)| a - b).collect()).collect()
}

/// The root of the sum of squares.
fn norm(values: &[f32]) -> f64 {
    values.iter().map(|&it| f64::from(it).powi(2)).sum::<f64>().sqrt()
}
