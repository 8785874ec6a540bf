//! Smoothing kernels: how a particle's mass is spread in a ball around it.
//!
//! Takes a distance in units of the support radius, gives a weight. One convention holds everywhere: the smoothing length `h` is
//! the radius of the support, kappa = 1, so that W(r, h) = `normalization` / h^3 * `shape`(r / h), which is 0 for r >= h and whose
//! integral over space is 1. A code whose kernel ends at kappa * h' has h = kappa * h'.
//!
//! Sources: J. Monaghan, J. Lattanzio, "A refined particle method for astrophysical problems", A&A 149, 1985 (M4, there with
//! kappa = 2); W. Dehnen, H. Aly, "Improving convergence in SPH without pairing instability", MNRAS 425, 2012, table 1 (Wendland
//! C2); M. Müller, D. Charypar, M. Gross, "Particle-based fluid simulation", SCA 2003, equation 20 (poly6).

use std::f64::consts::PI;

use fearless_simd::{f32x16, prelude::*};

/// A smoothing kernel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Kernel {
    /// The cubic spline M4.
    #[default]
    CubicSpline,
    /// Wendland's C2 function: smoother, with more weight near the middle.
    WendlandC2,
    /// (1 - q^2)^3: the cheapest, with less weight in the middle.
    Poly6,
}

impl Kernel {
    /// All kernels, with their names.
    pub const NAMES: [(&str, Self); 3] =
        [("cubic", Self::CubicSpline), ("wendland", Self::WendlandC2), ("poly6", Self::Poly6)];

    /// What makes the integral of `normalization() * shape(r)` over the unit ball 1.
    pub fn normalization(self) -> f64 {
        match self {
            Self::CubicSpline => 8.0 / PI,
            Self::WendlandC2 => 21.0 / (2.0 * PI),
            Self::Poly6 => 315.0 / (64.0 * PI),
        }
    }

    /// The kernel without its normalization at `q` = r / h of at least 0: 1 in the middle, 0 from 1 on.
    pub fn shape(self, q: f64) -> f64 {
        let inside = (1.0 - q).max(0.0);
        match self {
            Self::CubicSpline => 2.0 * inside.powi(3) - 8.0 * (0.5 - q).max(0.0).powi(3),
            Self::WendlandC2 => inside.powi(4) * (1.0 + 4.0 * q),
            Self::Poly6 => (1.0 - q * q).max(0.0).powi(3),
        }
    }
}

/// Parts into which a line through the ball is cut to integrate along it.
const LINE_PARTS: u32 = 128;

impl Kernel {
    /// The integral of the normalized kernel of h = 1 along a line that passes its middle at the distance `q` of at least 0: over the
    /// disc it integrates to 1.
    pub fn column(self, q: f64) -> f64 {
        let half = (1.0 - q * q).max(0.0).sqrt();
        // Simpson's rule on either side of the place where the cubic spline changes.
        let knot = (0.25 - q * q).max(0.0).sqrt();
        let value = |z: f64| self.shape((q * q + z * z).sqrt());
        let part = |from: f64, to: f64| {
            let step = (to - from) / f64::from(LINE_PARTS);
            let sum: f64 = (0..LINE_PARTS)
                .map(|part| {
                    let low = from + f64::from(part) * step;
                    value(low) + 4.0 * value(low + 0.5 * step) + value(low + step)
                })
                .sum();
            sum * step / 6.0
        };
        2.0 * self.normalization() * (part(0.0, knot) + part(knot, half))
    }
}

/// A kernel on lanes, chosen when the code is compiled.
pub(super) trait Shape: Copy + Send + Sync {
    /// [`Kernel::shape`] of the square root of `q_sq`.
    fn shape<S: Simd>(self, simd: S, q_sq: f32x16<S>) -> f32x16<S>;
}

/// [`Kernel::CubicSpline`] on lanes.
#[derive(Clone, Copy)]
pub(super) struct CubicSpline;
/// [`Kernel::WendlandC2`] on lanes.
#[derive(Clone, Copy)]
pub(super) struct WendlandC2;
/// [`Kernel::Poly6`] on lanes.
#[derive(Clone, Copy)]
pub(super) struct Poly6;

impl Shape for CubicSpline {
    #[inline(always)]
    fn shape<S: Simd>(self, simd: S, q_sq: f32x16<S>) -> f32x16<S> {
        let (zero, q) = (f32x16::splat(simd, 0.0), q_sq.sqrt());
        let outer = (f32x16::splat(simd, 1.0) - q).max(zero);
        // 8 (1/2 - q)^3 = (1 - 2 q)^3.
        let inner = (f32x16::splat(simd, 1.0) - (q + q)).max(zero);
        let outer_cubed = outer * outer * outer;
        outer_cubed + outer_cubed - inner * inner * inner
    }
}

impl Shape for WendlandC2 {
    #[inline(always)]
    fn shape<S: Simd>(self, simd: S, q_sq: f32x16<S>) -> f32x16<S> {
        let q = q_sq.sqrt();
        let inside = (f32x16::splat(simd, 1.0) - q).max(f32x16::splat(simd, 0.0));
        let squared = inside * inside;
        squared * squared * (f32x16::splat(simd, 1.0) + f32x16::splat(simd, 4.0) * q)
    }
}

impl Shape for Poly6 {
    #[inline(always)]
    fn shape<S: Simd>(self, simd: S, q_sq: f32x16<S>) -> f32x16<S> {
        let inside = (f32x16::splat(simd, 1.0) - q_sq).max(f32x16::splat(simd, 0.0));
        inside * inside * inside
    }
}

#[cfg(test)]
mod tests {
    use fearless_simd::{Level, dispatch};
    use fearless_simd_macros::simd;

    use super::*;

    #[test]
    fn columns_are_their_closed_forms() {
        // Of the cubic spline: antiderivatives of powers of r = sqrt(q^2 + z^2) along z.
        let cubed = |q: f64, end: f64| {
            let z = (end * end - q * q).sqrt();
            let log = q * q * ((z + end) / q).ln();
            let squares = q * q * z + z.powi(3) / 3.0;
            let cubes = z * end.powi(3) / 4.0 + 0.375 * q * q * (z * end + log);
            end.powi(3) * z - 3.0 * end * end * 0.5 * (z * end + log) + 3.0 * end * squares - cubes
        };
        for q in [0.01, 0.2, 0.45, 0.55, 0.9, 0.999] {
            let inner = if q < 0.5 { 8.0 * cubed(q, 0.5) } else { 0.0 };
            let wanted = 16.0 / PI * (2.0 * cubed(q, 1.0) - inner);
            let found = Kernel::CubicSpline.column(q);
            assert!((found - wanted).abs() < 1e-7, "{q}: {found} {wanted}");
            let wanted = 4.5 / PI * (1.0 - q * q).powf(3.5);
            assert!((Kernel::Poly6.column(q) - wanted).abs() < 1e-7, "{q}");
        }
        assert!((Kernel::CubicSpline.column(0.0) - 6.0 / PI).abs() < 1e-9);
        for (name, kernel) in Kernel::NAMES {
            let steps = 2000;
            let ring = |step: u32| {
                let q = (f64::from(step) + 0.5) / f64::from(steps);
                2.0 * PI * q * kernel.column(q) / f64::from(steps)
            };
            let sum: f64 = (0..steps).map(ring).sum();
            assert!((sum - 1.0).abs() < 1e-5, "{name}: {sum}");
            assert_eq!(kernel.column(1.0), 0.0);
        }
    }

    /// The integral over the unit ball, by the midpoint rule.
    fn integral(kernel: Kernel, of: impl Fn(f64) -> f64) -> f64 {
        let steps = 20_000;
        let shell = |step: u32| {
            let q = (f64::from(step) + 0.5) / f64::from(steps);
            4.0 * PI * q * q * of(kernel.normalization() * kernel.shape(q)) / f64::from(steps)
        };
        (0..steps).map(shell).sum()
    }

    #[test]
    fn kernels_hold_one_unit_of_mass() {
        for (name, kernel) in Kernel::NAMES {
            let mass = integral(kernel, |it| it);
            assert!((mass - 1.0).abs() < 1e-7, "{name}: {mass}");
            assert_eq!((kernel.shape(0.0), kernel.shape(1.0), kernel.shape(1.5)), (1.0, 0.0, 0.0), "{name}");
        }
    }

    #[test]
    fn the_noise_of_the_cubic_spline_is_that_of_the_analytic_table() {
        // V times the integral of W^2, which makes a density of N neighbors as noisy as sqrt(4.1566 / N).
        let noise = 4.0 / 3.0 * PI * integral(Kernel::CubicSpline, |it| it * it);
        assert!((noise - 4.156_613_756_613_757).abs() < 1e-6, "{noise}");
    }

    #[simd]
    fn on_lanes<S: Simd>(simd: S, kernel: impl Shape, q_sq: [f32; 16]) -> [f32; 16] {
        kernel.shape(simd, f32x16::load_array(simd, q_sq)).to_array()
    }

    #[test]
    fn lanes_have_the_formulas_values() {
        for first in 0..40 {
            let q: [f32; 16] = std::array::from_fn(|lane| (first * 16 + lane) as f32 / 500.0);
            let q_sq = q.map(|it| it * it);
            for (name, kernel) in Kernel::NAMES {
                let found = dispatch!(Level::new(), simd => match kernel {
                    Kernel::CubicSpline => on_lanes(simd, CubicSpline, q_sq),
                    Kernel::WendlandC2 => on_lanes(simd, WendlandC2, q_sq),
                    Kernel::Poly6 => on_lanes(simd, Poly6, q_sq),
                });
                for (found, q) in found.into_iter().zip(q) {
                    let wanted = kernel.shape(f64::from(q));
                    assert!((f64::from(found) - wanted).abs() < 2e-6, "{name} at {q}: {found} for {wanted}");
                }
            }
        }
    }
}
