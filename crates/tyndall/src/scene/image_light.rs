//! Light from an image of all that is far away, as paths look for it.
//!
//! A surface looks where the image is brighter than on average, in proportion to by how much, and where its material throws light from; both
//! are weighted by the balance heuristic. So a sun of a few pixels and an even sky both cost few samples, and an image without anything bright
//! costs no looking at all. Source: see [`Environment::above_mean`].

use glam::Vec3;

use crate::environment::Environment;

/// An image of all that is far away, and where to look for its light.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageLight {
    environment: Environment,
    bright: Option<Environment>,
}

impl ImageLight {
    /// Light of an image, or of one radiance all around. A white surface is as bright as the mean radiance of what it faces.
    pub fn new(environment: Environment) -> Self {
        let bright = environment.above_mean();
        Self { environment, bright }
    }

    /// The image.
    pub fn environment(&self) -> &Environment {
        &self.environment
    }

    /// The same light, which is not looked for.
    #[cfg(test)]
    pub(crate) fn not_looked_for(self) -> Self {
        Self { bright: None, ..self }
    }

    /// A direction to look for light in, drawn by two random numbers in [0, 1); none where looking does not pay.
    pub(crate) fn sample(&self, random: [f32; 2]) -> Option<Vec3> {
        self.bright.as_ref().map(|bright| bright.sample(random))
    }

    /// Probability density of [`Self::sample`], per steradian.
    pub(crate) fn density(&self, toward: Vec3) -> f32 {
        self.bright.as_ref().map_or(0.0, |bright| bright.density(toward))
    }
}
