//! How far light goes in a medium before it meets matter, and how much of it goes on.
//!
//! Extinction is the density's trilinear field times an RGB factor, so that one integral, the column (density along the way),
//! gives the optical depth of all three: extinction times column. Takes rays, gives distances and RGB weights. Invariant: with
//! [`FreePath::Exact`] and [`FreePath::Delta`] the expected weight of an interaction in a short piece of the ray is
//! transmittance times extinction of the piece, for each of RGB, and that of leaving is the transmittance.
//!
//! Sources: the distances that solve the integral, and the two wrong ones: D. Cha, S. Son, I. Ihm, "GPU-assisted high quality
//! particle rendering", EGSR 2009; null collisions with weights for RGB: P. Kutz, R. Habel, Y. Li, J. Novak, "Spectral and
//! decomposition tracking", SIGGRAPH 2017; transmittance with a control: J. Novak, A. Selle, W. Jarosz, "Residual ratio
//! tracking", SIGGRAPH Asia 2014.

use std::str::FromStr;

use glam::Vec3;

use super::regular::Reached;
use super::walk::{Brick, Path, Step};
use crate::error::{Error, Result};
use crate::math::Ray;
use crate::medium::Medium;
use crate::random::Stream;

/// How the distance to the next interaction is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FreePath {
    /// Right: the integral of the interpolated field, solved cell by cell.
    Exact,
    /// Right: null collisions against the greatest density of each brick.
    Delta,
    /// Wrong, for comparison: as if the density were everywhere that where the flight begins. A flight that begins in emptiness
    /// takes the mean density of the first cell that is not empty, from where it enters it.
    Homogeneous,
    /// Wrong, for comparison: the same with the density scaled up, and flights that end at a bound.
    Scaled {
        /// What the density is multiplied with; above 0.
        factor: f32,
        /// The longest flight; infinite for none.
        bound: f32,
    },
}

/// The factor of the paper's figure.
const FACTOR: f32 = 50.0;

impl FreePath {
    /// The names that [`FreePath::from_str`] knows.
    pub const NAMES: [&'static str; 4] = ["exact", "delta", "homogeneous", "scaled"];

    /// [`FreePath::Scaled`], checked: [`Error::Setting`] unless both are above 0.
    pub fn scaled(factor: f32, bound: f32) -> Result<Self> {
        if !(factor > 0.0 && factor.is_finite()) {
            return Err(Error::setting("free-path factor", factor, "a finite number above 0"));
        }
        if bound.is_nan() || bound <= 0.0 {
            return Err(Error::setting("free-path bound", bound, "a length above 0"));
        }
        Ok(Self::Scaled { factor, bound })
    }

    /// The name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::Delta => "delta",
            Self::Homogeneous => "homogeneous",
            Self::Scaled { .. } => "scaled",
        }
    }
}

impl FromStr for FreePath {
    type Err = Error;

    /// By name; `scaled` is that of the paper: factor 50, no bound.
    fn from_str(name: &str) -> Result<Self> {
        match name {
            "exact" => Ok(Self::Exact),
            "delta" => Ok(Self::Delta),
            "homogeneous" => Ok(Self::Homogeneous),
            "scaled" => Ok(Self::Scaled { factor: FACTOR, bound: f32::INFINITY }),
            _ => Err(Error::setting("free-path", name, format!("one of {}", Self::NAMES.join(", ")))),
        }
    }
}

/// A medium, ready to be flown through.
#[derive(Clone, Copy)]
pub struct Tracker<'a> {
    pub(super) medium: &'a Medium,
    pub(super) extinction: Vec3,
    /// The largest of the three.
    pub(super) greatest: f32,
    pub(super) is_grey: bool,
}

impl<'a> Tracker<'a> {
    /// For flights through `medium`.
    pub fn new(medium: &'a Medium) -> Self {
        // Light that is only added meets nothing on its way.
        let extinction = if medium.is_additive() { [0.0; 3] } else { medium.optics().extinction };
        let extinction = Vec3::from(extinction);
        let is_grey = extinction.min_element() == extinction.max_element();
        Self { medium, extinction, greatest: extinction.max_element(), is_grey }
    }

    /// The medium.
    pub fn medium(&self) -> &'a Medium {
        self.medium
    }

    /// An estimate of the transmittance along `ray`, right on average, by far fewer look-ups than the exact one.
    ///
    /// Residual ratio tracking with the least density of each brick as the control: weights stay between 0 and 1. (The middle of
    /// the range halves the look-ups, but weights of up to 2 a look-up raised the variance of the reference by three quarters.)
    #[inline]
    pub fn ratio_transmittance(&self, ray: &Ray, stream: &mut Stream) -> Vec3 {
        let Some(path) = Path::new(self.medium, ray) else { return Vec3::ONE };
        let grid = self.medium.density();
        let mut weight = Vec3::ONE;
        let mut control_column = 0.0;
        let mut depth = exponential(stream);
        for step in path.bricks(grid) {
            let (brick, Step { from, to, .. }) = (step.brick(), step);
            let range = grid.piece_range(brick);
            if range.max == 0.0 {
                continue;
            }
            let control = range.min;
            control_column += control * (to - from);
            let majorant = self.greatest * (range.max - control);
            if majorant <= 0.0 {
                continue;
            }
            let samples = Brick::new(grid, brick);
            let mut t = from;
            loop {
                let left = (to - t) * majorant;
                if depth > left {
                    depth -= left;
                    break;
                }
                t += depth / majorant;
                depth = exponential(stream);
                let residual = samples.density(path.at(t)) - control;
                weight *= 1.0 - residual / majorant * self.extinction;
            }
        }
        weight * self.through(control_column)
    }

    /// The distance along `ray` to the next interaction, `None` if it leaves. `throughput` gets the weight that belongs to it: it
    /// stays as it is where extinction is grey.
    #[inline]
    pub fn next(
        &self,
        free_path: FreePath,
        ray: &Ray,
        throughput: &mut Vec3,
        stream: &mut Stream,
    ) -> Option<f32> {
        let path = Path::new(self.medium, ray)?;
        let distance = match free_path {
            FreePath::Exact => self.exact(&path, throughput, stream),
            FreePath::Delta if self.is_grey => self.delta::<true>(&path, throughput, stream),
            FreePath::Delta => self.delta::<false>(&path, throughput, stream),
            FreePath::Homogeneous => self.wrong(&path, [1.0, f32::INFINITY], stream),
            FreePath::Scaled { factor, bound } => self.wrong(&path, [factor, bound], stream),
        };
        distance.map(|distance| path.enter + distance)
    }

    /// Draws the optical depth, and finds where the column reaches it.
    fn exact(&self, path: &Path, throughput: &mut Vec3, stream: &mut Stream) -> Option<f32> {
        let depth = exponential(stream);
        if self.is_grey {
            return match self.advance(path, depth / self.greatest) {
                Reached::At { distance } => Some(distance),
                Reached::End { .. } => None,
            };
        }
        // One of RGB draws, chosen in proportion to its throughput; the weight is that of all three ways to come there.
        let chance = chances(*throughput);
        let channel = pick(chance, stream.unit());
        let column = depth / self.extinction[channel];
        match self.advance(path, column) {
            Reached::At { distance } => {
                let density = self.extinction * self.through(column);
                *throughput *= density / chance.dot(density);
                Some(distance)
            }
            Reached::End { column } => {
                let leaving = self.through(column);
                *throughput *= leaving / chance.dot(leaving);
                None
            }
        }
    }

    /// Null collisions: what the majorant adds to the density scatters straight on.
    #[inline(always)]
    fn delta<const GREY: bool>(
        &self,
        path: &Path,
        throughput: &mut Vec3,
        stream: &mut Stream,
    ) -> Option<f32> {
        let grid = self.medium.density();
        let mut depth = exponential(stream);
        for step in path.bricks(grid) {
            let (brick, Step { from, to, .. }) = (step.brick(), step);
            let max = grid.piece_range(brick).max;
            let majorant = self.greatest * max;
            let left = (to - from) * majorant;
            if depth > left {
                depth -= left;
                continue;
            }
            let samples = Brick::new(grid, brick);
            let mut t = from;
            loop {
                let left = (to - t) * majorant;
                if depth > left {
                    depth -= left;
                    break;
                }
                t += depth / majorant;
                depth = exponential(stream);
                let share = samples.density(path.at(t)) / max;
                if GREY {
                    if stream.unit() < share {
                        return Some(t);
                    }
                } else {
                    let real = share / self.greatest * self.extinction;
                    let chance = chances(*throughput).dot(real).min(1.0);
                    if stream.unit() < chance {
                        *throughput *= real / chance;
                        return Some(t);
                    }
                    *throughput *= (Vec3::ONE - real) / (1.0 - chance);
                }
            }
        }
        None
    }

    /// The paper's wrong methods: one density for the whole flight, scaled and bounded.
    fn wrong(&self, path: &Path, [factor, bound]: [f32; 2], stream: &mut Stream) -> Option<f32> {
        let (start, density) = self.first_density(path)?;
        let extinction = factor * density * self.extinction.element_sum() / 3.0;
        let distance = start + (exponential(stream) / extinction).min(bound);
        (distance < path.length).then_some(distance)
    }

    /// Where the path first is in density, and how much there is: see [`FreePath::Homogeneous`].
    fn first_density(&self, path: &Path) -> Option<(f32, f32)> {
        let grid = self.medium.density();
        for step in path.bricks(grid) {
            let (brick, Step { from, to, .. }) = (step.brick(), step);
            if grid.piece_range(brick).max == 0.0 {
                continue;
            }
            let samples = Brick::new(grid, brick);
            let here = samples.density(path.at(from));
            if here > 0.0 {
                return Some((from, here));
            }
            for cell in samples.steps(path, [from, to]) {
                let middle = 0.5 * (cell.from + cell.to);
                let [center, far] = samples.pair(path, cell.at, [middle, cell.to]);
                let mean = (4.0 * center + far) / 6.0;
                if mean > 0.0 && cell.to > cell.from {
                    return Some((cell.from, mean));
                }
            }
        }
        None
    }
}

/// An exponentially distributed number of mean 1; greater than 0.
#[inline(always)]
fn exponential(stream: &mut Stream) -> f32 {
    // Half a step up, so that it is never 0 and never infinite.
    -(stream.unit() + 0.5 / (1 << 24) as f32).min(1.0 - f32::EPSILON / 2.0).ln()
}

/// Shares of the channels in `weights`, which are at least 0 and not all 0.
#[inline(always)]
pub(super) fn chances(weights: Vec3) -> Vec3 {
    weights / weights.element_sum().max(f32::MIN_POSITIVE)
}

/// A channel, with those chances.
#[inline(always)]
pub(super) fn pick(chances: Vec3, random: f32) -> usize {
    if random < chances.x {
        0
    } else if random < chances.x + chances.y || chances.z == 0.0 {
        1
    } else {
        2
    }
}

#[cfg(test)]
mod tests;
