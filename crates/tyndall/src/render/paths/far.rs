//! Light from far away, as paths find it: by looking for it, and by going there.
//!
//! Each of both is weighted by the balance heuristic, so that a direction which both may find counts once.

use std::f32::consts::{PI, TAU};

use glam::Vec3;

use crate::render::shade::{in_cone, sky_brightness};
use crate::scene::image_light::ImageLight;
use crate::scene::light::{KeyLight, Lights, Sky};

/// What is far away.
pub(super) enum Far<'a> {
    /// Only the key light is looked for.
    Studio {
        key: &'a KeyLight,
        sky: &'a Sky,
        disc: Disc,
    },
    Image(&'a ImageLight),
}

/// Of the key light.
pub(super) struct Disc {
    radiance: f32,
    /// One over its solid angle.
    density: f32,
    cosine: f32,
}

/// A direction that was drawn to look for light in.
pub(super) struct Look {
    pub(super) toward: Vec3,
    /// RGB.
    pub(super) radiance: Vec3,
    /// Probability density of drawing it, per steradian.
    pub(super) density: f32,
}

impl<'a> Far<'a> {
    pub(super) fn new(lights: &'a Lights) -> Self {
        match lights {
            Lights::Image { light, .. } => Self::Image(light),
            Lights::Studio(key, sky) => {
                // A point-like key light is a small disc.
                let angle = key.angular_radius.clamp(1e-3, PI);
                let solid_angle = TAU * 2.0 * (0.5 * angle).sin().powi(2);
                let radiance = PI * key.strength / solid_angle;
                Self::Studio {
                    key,
                    sky,
                    disc: Disc { radiance, density: 1.0 / solid_angle, cosine: angle.cos() },
                }
            }
        }
    }

    /// Where to look for light, by two random numbers in [0, 1); none where nothing is worth it.
    pub(super) fn look(&self, random: [f32; 2]) -> Option<Look> {
        match self {
            Self::Studio { key, disc, .. } => (key.strength > 0.0).then(|| Look {
                toward: in_cone(key.toward, disc.cosine, random.into()),
                radiance: Vec3::splat(disc.radiance),
                density: disc.density,
            }),
            Self::Image(light) => {
                let toward = light.sample(random)?;
                let radiance = light.environment().radiance(toward);
                Some(Look { toward, radiance, density: light.density(toward) })
            }
        }
    }

    /// RGB radiance that a direction sees which was drawn with a density, beyond what looking finds; all of it without a density.
    pub(super) fn seen(&self, direction: Vec3, density: Option<f32>) -> Vec3 {
        let share = |looked: f32| density.map_or(1.0, |density| density / (density + looked));
        match self {
            Self::Studio { key, sky, disc } => {
                let mut radiance = sky_brightness(sky, direction);
                if direction.dot(key.toward) >= disc.cosine {
                    radiance += share(disc.density) * disc.radiance;
                }
                Vec3::splat(radiance)
            }
            Self::Image(light) => share(light.density(direction)) * light.environment().radiance(direction),
        }
    }
}
