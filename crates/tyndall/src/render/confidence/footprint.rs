//! A particle's share of a pixel, and of how many such particles a pixel's samples are drawn.
//!
//! The model (Walloner 2022, equation 2.1) knows particles of one share a, all inside the pixel. Real ones reach over its edges:
//! their discs are cut, and more of them than have their center in the pixel's frustum can be met. A sample meets a particle with a
//! probability that is its share A, so that the mean share of the particles that are met is E(A^2) / E(A) over all places of the
//! disc; and with N = n pi r^2 / a of them the samples find as much in their way as there is. For small particles this is the
//! thesis' a = pi r^2, N = n; it stays right for those larger than half a pixel. The mean share is pi r^2 times the mean overlap
//! (1 - |x|)(1 - |y|) of two pixels that lie as far apart as two random points of the disc.

use std::f32::consts::PI;

/// Twice the mean distance along an axis of two random points of the unit disc.
const TWICE_DISTANCE: f32 = 512.0 / (45.0 * PI * PI);

/// Of a pixel a particle covers never quite all: the logarithm of what it leaves is finite.
const MOST: f32 = 1.0 - 0.5 * f32::EPSILON;

/// The mean share of the pixel that a particle covers, of those that samples meet; `radius` is in pixels.
///
/// Exact up to half a pixel; beyond, 1 - (1/3 - c / r^2) / r, continuous, within 1 %.
#[inline(always)]
pub(crate) fn share(radius: f32) -> f32 {
    if radius <= 0.5 {
        PI * radius * radius * (1.0 - TWICE_DISTANCE * radius + radius * radius / PI)
    } else {
        (1.0 - (1.0 / 3.0 - 0.007_73 / (radius * radius)) / radius).min(MOST)
    }
}

/// How many particles samples are drawn from for each that has its center in the frustum, at a depth where a pixel's edge is
/// `pixel`; `[radius, radius_sq]` are means over all particles.
#[inline(always)]
pub(crate) fn population([radius, radius_sq]: [f32; 2], pixel: f32) -> f32 {
    let share = share(radius / pixel);
    if share > 0.0 { PI * radius_sq / (pixel * pixel * share) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    #[test]
    fn the_share_is_the_mean_overlap_with_what_a_sample_meets() {
        for radius in [0.01_f32, 0.1, 0.3, 0.5, 0.6, 0.8, 1.0, 1.5, 3.0, 8.0] {
            let mut stream = Stream::new(7, 0);
            let mut in_disc = || loop {
                let [x, y] = [0, 1].map(|_| stream.range(-radius, radius));
                if x * x + y * y < radius * radius {
                    return [x, y];
                }
            };
            let count = 200_000;
            let overlap: f64 = (0..count)
                .map(|_| {
                    let ([ax, ay], [bx, by]) = (in_disc(), in_disc());
                    let apart = |a: f32, b: f32| f64::from((1.0 - (a - b).abs()).max(0.0));
                    apart(ax, bx) * apart(ay, by)
                })
                .sum::<f64>()
                / f64::from(count);
            let expected = std::f64::consts::PI * f64::from(radius * radius) * overlap;
            let found = f64::from(share(radius));
            // The error of the simulation grows with the radius: few pairs overlap.
            let tolerance = 0.01 + 0.004 * f64::from(radius);
            assert!(
                (found / expected - 1.0).abs() < tolerance,
                "seed 7, radius {radius}: {found} {expected}"
            );
        }
    }

    #[test]
    fn small_particles_are_their_discs_and_large_ones_fill_the_pixel() {
        assert!((share(1e-3) / (PI * 1e-6) - 1.0).abs() < 2e-3);
        for radius in [1e3, 1e9, 1e30, f32::INFINITY] {
            assert!(share(radius) > 0.999 && share(radius) < 1.0, "{radius}: {}", share(radius));
        }
        assert!((population([1e-3, 1e-6], 1.0) - 1.0).abs() < 2e-3);
        assert_eq!(population([0.0, 0.0], 1.0), 1.0);
    }
}
