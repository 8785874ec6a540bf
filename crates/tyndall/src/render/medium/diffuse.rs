//! Radiance that reaches a medium from the sky or by scattering, solved without noise: sweeps along many directions, repeated until
//! scattering in is in balance with what was scattered, first on a coarse lattice, then on finer ones.
//!
//! Takes the density on lattices from fine to coarse, and what lights without extent add by their first scattering. Gives
//! coefficients of the radiance in spherical harmonics. Exact but for the lattice and the number of directions: all orders of
//! scattering are in it.
//! Source: K. Lathrop, B. Carlson, "Discrete ordinates angular quadrature of the neutron transport equation", 1965 (directions);
//! A. Brandt, "Multi-level adaptive solutions to boundary-value problems", 1977 (coarse lattices first).

use rayon::prelude::*;

use super::field::Field;
use super::harmonics::{ORDER, count};
use super::sweep::{Ordinate, Sweeper};
use crate::error::{Error, Result};
use crate::medium::grid::Lattice;
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
    /// Order of the spherical harmonics.
    pub(super) order: usize,
}

/// A lattice to solve on.
pub(super) struct Level {
    /// The medium's density.
    pub(super) density: Field,
    /// Coefficients of the radiance of lights without extent, before any scattering.
    pub(super) direct: Vec<Vec<f32>>,
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
    let mut solved: Option<Vec<Field>> = None;
    for (place, level) in levels.iter().enumerate().rev() {
        let lattice = level.density.lattice;
        let most = accuracy.sweeps[usize::from(place + 1 < levels.len())];
        let sweeper = sweeper(channel, &level.density);
        let mut radiance = match solved.take() {
            Some(coarse) => coarse.into_iter().map(|it| it.interpolated(lattice).values).collect(),
            None => vec![vec![0.0; level.density.values.len()]; count(channel.order)],
        };
        for _ in 0..most {
            if progress.cancelled() {
                return Err(Error::Interrupted);
            }
            let next = sweeper.sweep(ordinates, &scattered(channel, &radiance, &level.direct));
            let change = change(&radiance[0], &next[0]);
            radiance = next;
            if change < accuracy.change {
                break;
            }
        }
        solved = Some(fields(lattice, radiance));
    }
    Ok(solved.unwrap_or_default())
}

/// Coefficients of the radiance of the sky alone, before any scattering.
pub(super) fn sky(channel: Channel, density: &Field, ordinates: &[Ordinate]) -> Vec<Field> {
    let dark = vec![vec![0.0; density.values.len()]; count(channel.order)];
    fields(density.lattice, sweeper(channel, density).sweep(ordinates, &dark))
}

fn fields(lattice: Lattice, coefficients: Vec<Vec<f32>>) -> Vec<Field> {
    coefficients.into_iter().map(|values| Field { lattice, values }).collect()
}

fn sweeper(channel: Channel, density: &Field) -> Sweeper {
    let values = density.values.iter().map(|it| channel.extinction * it).collect();
    Sweeper::new(Field { lattice: density.lattice, values })
}

/// Coefficients of what scattering adds per extinction.
fn scattered(channel: Channel, radiance: &[Vec<f32>], direct: &[Vec<f32>]) -> Vec<Vec<f32>> {
    let of_coefficient = |number: usize| {
        let share = channel.albedo * channel.g.powi(ORDER[number]);
        radiance[number].iter().zip(&direct[number]).map(|(a, b)| share * (a + b)).collect()
    };
    (0..radiance.len()).into_par_iter().map(of_coefficient).collect()
}

/// How much two solutions differ, relative to the second: root mean squares.
fn change(before: &[f32], after: &[f32]) -> f32 {
    let (mut difference, mut total) = (0.0_f64, 0.0_f64);
    for (a, b) in before.iter().zip(after) {
        difference += f64::from(a - b).powi(2);
        total += f64::from(*b).powi(2);
    }
    if total > 0.0 { (difference / total).sqrt() as f32 } else { 0.0 }
}
