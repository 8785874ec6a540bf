//! What happens where light meets the medium: the phase function of Henyey and Greenstein.
//!
//! A direction is always where light travels to; the cosine is between travel before and travel after, so that g > 0 scatters
//! forward. Source: L. Henyey, J. Greenstein, "Diffuse radiation in the galaxy", Astrophysical Journal 93, 1941.

use std::f32::consts::{PI, TAU};

use glam::Vec3;

use crate::error::{Error, Result};

/// How scattered light is spread over directions: normalised to 1 over the sphere, g is the mean cosine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Phase {
    g: f32,
}

/// Below this |g| the phase function is taken as isotropic: the inversion divides by g.
const ISOTROPIC: f32 = 1e-3;

impl Phase {
    /// The same in all directions.
    pub const ISOTROPIC: Self = Self { g: 0.0 };

    /// With the mean cosine `g` between -1 (back) and 1 (forward), both excluded: [`Error::Setting`] else.
    pub fn new(g: f32) -> Result<Self> {
        if !(g > -1.0 && g < 1.0) {
            return Err(Error::setting("g", g, "a mean cosine between -1 and 1, both excluded"));
        }
        Ok(Self { g: if g.abs() < ISOTROPIC { 0.0 } else { g } })
    }

    /// The mean cosine.
    pub fn g(self) -> f32 {
        self.g
    }

    /// Whether all directions are alike.
    #[inline(always)]
    pub fn is_isotropic(self) -> bool {
        self.g == 0.0
    }

    /// Share of the light, per steradian, that goes on at this `cosine`; also the probability density of [`Phase::sample`].
    #[inline(always)]
    pub fn evaluate(self, cosine: f32) -> f32 {
        if self.is_isotropic() {
            return 0.25 / PI;
        }
        let spread = 1.0 + self.g * self.g - 2.0 * self.g * cosine;
        // The difference loses digits where g is near 1: never below its value at cosine 1.
        let spread = spread.max((1.0 - self.g.abs()).powi(2));
        0.25 / PI * (1.0 - self.g * self.g) / (spread * spread.sqrt())
    }

    /// The direction in which light that travelled along `direction` (unit length) goes on, for two random numbers in [0, 1).
    #[inline(always)]
    pub fn sample(self, direction: Vec3, random: [f32; 2]) -> Vec3 {
        let (sin_around, cos_around) = (TAU * random[1]).sin_cos();
        if self.is_isotropic() {
            let z = 1.0 - 2.0 * random[0];
            let across = (1.0 - z * z).max(0.0).sqrt();
            return Vec3::new(across * cos_around, across * sin_around, z);
        }
        let share = (1.0 - self.g * self.g) / (1.0 + self.g - 2.0 * self.g * random[0]);
        let cosine = ((1.0 + self.g * self.g - share * share) / (2.0 * self.g)).clamp(-1.0, 1.0);
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        let (u, v) = direction.any_orthonormal_pair();
        (sine * cos_around * u + sine * sin_around * v + cosine * direction).normalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    const ALL_G: [f32; 7] = [-0.95, -0.5, 0.0, 0.01, 0.3, 0.6, 0.98];

    /// Integral of `f(cosine)` over the sphere, by the midpoint rule.
    fn over_sphere(f: impl Fn(f32) -> f32) -> f64 {
        let steps = 200_000;
        let cosine = |step: i32| 2.0 * (f64::from(step) + 0.5) / f64::from(steps) - 1.0;
        let sum: f64 = (0..steps).map(|step| f64::from(f(cosine(step) as f32))).sum();
        sum * std::f64::consts::TAU * 2.0 / f64::from(steps)
    }

    #[test]
    fn the_phase_function_is_normalised_and_g_is_its_mean_cosine() {
        for g in ALL_G {
            let phase = Phase::new(g).unwrap();
            assert!((over_sphere(|cosine| phase.evaluate(cosine)) - 1.0).abs() < 2e-3, "g {g}");
            let mean = over_sphere(|cosine| cosine * phase.evaluate(cosine));
            assert!((mean - f64::from(phase.g())).abs() < 2e-3, "g {g}: {mean}");
        }
    }

    #[test]
    fn samples_follow_the_phase_function() {
        for (number, g) in ALL_G.into_iter().enumerate() {
            let phase = Phase::new(g).unwrap();
            let mut stream = Stream::new(31, number as u64);
            let direction = stream.direction();
            let count = 20_000;
            let mut cosines: Vec<f32> = (0..count)
                .map(|_| {
                    let next = phase.sample(direction, [stream.unit(), stream.unit()]);
                    assert!((next.length() - 1.0).abs() < 1e-5);
                    next.dot(direction)
                })
                .collect();
            cosines.sort_by(f32::total_cmp);
            // Kolmogorov and Smirnov at the 0.1 % level, against the integral of Henyey and Greenstein's function.
            let integral = |cosine: f64| {
                let g = f64::from(phase.g());
                if g == 0.0 {
                    return 0.5 * (cosine + 1.0);
                }
                let root = (1.0 + g * g - 2.0 * g * cosine).sqrt();
                (1.0 - g * g) / (2.0 * g) * (1.0 / root - 1.0 / (1.0 + g))
            };
            let farthest = cosines.iter().enumerate().map(|(rank, &cosine)| {
                (integral(f64::from(cosine)) - (rank as f64 + 0.5) / f64::from(count)).abs()
            });
            let farthest = farthest.fold(0.0, f64::max);
            assert!(farthest < 1.95 / f64::from(count).sqrt(), "g {g}: {farthest}");
        }
    }

    #[test]
    fn a_mean_cosine_out_of_range_is_refused() {
        for g in [-1.0, 1.0, 1.5, f32::NAN, f32::NEG_INFINITY] {
            assert_eq!(Phase::new(g).unwrap_err().code(), "setting");
        }
        assert!(Phase::new(0.9999).unwrap().evaluate(1.0).is_finite());
    }
}
