//! How what was met is lit: formulas that all machines share.

use glam::{Vec2, Vec3};

use super::sampling::{Dimension, shuffled_point};
use crate::scene::light::{KeyLight, Sky};

/// Directions toward the light of one sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightSample {
    /// A point of the key light.
    pub(crate) key: Vec3,
    /// A point of the sky.
    pub(crate) sky: Vec3,
}

/// The directions of sample `sample`.
///
/// They are the same for all pixels, so that shadow rays are parallel; over the samples they cover the lights evenly, and what
/// would be noise is the sum of many hard shadows.
pub(crate) fn light_sample(key: &KeyLight, seed: u32, sample: u32) -> LightSample {
    LightSample {
        key: in_cone(
            key.toward,
            key.angular_radius.cos(),
            shuffled_point(seed, Dimension::Key, 0, sample).into(),
        ),
        sky: on_sphere(shuffled_point(seed, Dimension::Sky, 0, sample).into()),
    }
}

/// A direction uniformly distributed over the cone around `axis` whose half angle has this cosine.
pub(super) fn in_cone(axis: Vec3, cosine: f32, random: Vec2) -> Vec3 {
    let z = 1.0 - random.x * (1.0 - cosine);
    let r = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = (std::f32::consts::TAU * random.y).sin_cos();
    let (u, v) = axis.any_orthonormal_pair();
    (u * (r * cos) + v * (r * sin) + axis * z).normalize()
}

/// A direction uniformly distributed over the sphere.
fn on_sphere(random: Vec2) -> Vec3 {
    in_cone(Vec3::Z, -1.0, random)
}

/// Light that a matte white surface sends to the eye when it sees the key light, by the cosine of its angle to it.
#[inline(always)]
pub(crate) fn key_radiance(key: &KeyLight) -> f32 {
    key.strength
}

/// Light that a matte white surface sends to the eye when it sees the sky in the sampled direction, by the cosine of its angle
/// to it: radiance over pi, divided by the density 1/(4 pi) of directions.
#[inline(always)]
pub(crate) fn sky_radiance(sky: &Sky, toward: Vec3) -> f32 {
    4.0 * sky_brightness(sky, toward)
}

/// How bright surfaces are that face a light in levels, from the least cosine on that stands first; the later of two counts.
pub(crate) const TOON_LEVELS: [[f32; 2]; 3] = [[f32::NEG_INFINITY, 0.3], [0.0, 0.6], [0.5, 1.0]];

/// Radiance of the sky in a direction.
#[inline(always)]
pub(crate) fn sky_brightness(sky: &Sky, toward: Vec3) -> f32 {
    let height = 0.5 + 0.5 * toward.dot(sky.up);
    sky.ground + (sky.zenith - sky.ground) * height
}

/// The color of a pixel of `samples` samples, of the sum of the light of those that met a particle and their number; a background
/// shows through the others.
pub(crate) fn mean_of(samples: u32, background: Option<[f32; 3]>) -> impl Fn([f32; 4]) -> [f32; 4] {
    let inv_samples = if samples == 0 { 0.0 } else { 1.0 / samples as f32 };
    move |sum| {
        let [r, g, b, count] = sum.map(|sum| sum * inv_samples);
        match background {
            Some(back) => {
                let open = 1.0 - count;
                [r + open * back[0], g + open * back[1], b + open * back[2], 1.0]
            }
            None => [r, g, b, count],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_open_surface_under_an_even_sky_is_as_bright_as_the_sky() {
        let sky = Sky { zenith: 0.7, ground: 0.7, up: Vec3::Z };
        let key = KeyLight { toward: Vec3::X, angular_radius: 0.1, strength: 1.0 };
        for normal in [Vec3::X, Vec3::NEG_Y, Vec3::new(0.6, 0.0, 0.8)] {
            let count = 1024;
            let lights = (0..count).map(|sample| light_sample(&key, 7, sample));
            let mean = lights
                .map(|light| sky_radiance(&sky, light.sky) * normal.dot(light.sky).max(0.0))
                .sum::<f32>()
                / count as f32;
            assert!((mean - 0.7).abs() < 0.01, "{mean}");
        }
    }

    #[test]
    fn key_light_directions_stay_in_their_cone() {
        let key = KeyLight { toward: Vec3::new(0.36, 0.48, 0.8), angular_radius: 0.1, strength: 1.0 };
        for sample in 0..500 {
            let light = light_sample(&key, 3, sample);
            assert!(light.key.dot(key.toward) > 0.1_f32.cos() - 1e-6 && light.key.is_normalized());
        }
    }
}
