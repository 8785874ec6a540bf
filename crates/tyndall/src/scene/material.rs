//! What surfaces are made of: how they throw light on, in the color of their particle.

use crate::error::{Error, Result};

/// One material for all particles of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Material {
    /// Throws light evenly in all directions (Lambert), or as rough ground does, which is nearly as bright at its edge as in its middle.
    Matte {
        /// 0 (even) to 1 (like the full moon).
        roughness: f32,
    },
    /// Matte under a clear coat with highlights.
    Glossy {
        /// Of the coat: 0.02 (polished) to 1.
        roughness: f32,
        /// Refractive index of the coat, above 1.
        index: f32,
    },
    /// A mirror in the particle's color.
    Metal {
        /// 0.02 (polished) to 1.
        roughness: f32,
    },
    /// Clear; the particle's color is what is left of white light that crosses four of its diameters. Particles that overlap are one body.
    Clear {
        /// Refractive index, above 1: 1.33 of water, 1.5 of glass.
        index: f32,
    },
}

impl Material {
    /// The smallest roughness of coats and mirrors: below it highlights of small lights are too rare to be found.
    pub const LEAST_ROUGHNESS: f32 = 0.02;

    /// Fails with [`Error::Setting`] if a number is out of range.
    pub(crate) fn check(&self) -> Result<()> {
        let (roughness, index) = match *self {
            Self::Matte { roughness } => (Some((roughness, 0.0)), None),
            Self::Metal { roughness } => (Some((roughness, Self::LEAST_ROUGHNESS)), None),
            Self::Glossy { roughness, index } => (Some((roughness, Self::LEAST_ROUGHNESS)), Some(index)),
            Self::Clear { index } => (None, Some(index)),
        };
        if let Some((roughness, least)) = roughness
            && !(least..=1.0).contains(&roughness)
        {
            return Err(Error::setting("--roughness", roughness, format!("between {least} and 1")));
        }
        match index {
            Some(index) if !(index > 1.0 && index <= 4.0) => {
                Err(Error::setting("--refraction", index, "above 1, at most 4"))
            }
            _ => Ok(()),
        }
    }
}
