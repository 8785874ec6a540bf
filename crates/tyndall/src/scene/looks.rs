//! Looks by name: lights, a material, and how far light is followed.

use glam::Vec3;

use super::light::{KeyLight, Lens, Lighting, Lights, Paths, Sky};
use super::material::Material;

/// A look.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Look {
    /// A key light with soft shadows, and a sky with ambient occlusion.
    #[default]
    Default,
    /// A light at the eye, without shadows.
    Headlight,
    /// The pure colors.
    Flat,
    /// The key light in three levels, as if drawn.
    Toon,
    /// Even surfaces that light each other.
    Matte,
    /// Matte under a clear coat.
    Glossy,
    /// Brushed mirrors.
    Metal,
    /// Clear bodies in a bright room.
    Glass,
    /// The same with less refraction.
    Water,
    /// Rough ground in the default light.
    Clay,
    /// Even surfaces in much sky and little sun: what prints well.
    Paper,
    /// Rough ground in a hard sun.
    Sand,
    /// Rough ground under an overcast sky.
    Dust,
}

/// What replaces the numbers of a look that is traced by paths.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Adjustments {
    /// Whether the default look is traced too, as matte.
    pub traced: bool,
    /// In place of the look's own lights; the default look is traced too then.
    pub lights: Option<Lights>,
    /// See [`Paths::bounces`].
    pub bounces: Option<u32>,
    /// Of the material.
    pub roughness: Option<f32>,
    /// Refractive index of coats and clear bodies.
    pub index: Option<f32>,
    /// See [`Paths::lens`].
    pub lens: Option<Lens>,
}

/// How often light is thrown on if nothing is said.
pub const BOUNCES: u32 = 4;

impl Look {
    /// Whether light goes from particle to particle.
    pub fn is_traced(self, adjustments: &Adjustments) -> bool {
        match self {
            Self::Default => {
                adjustments.traced
                    || adjustments.lights.is_some()
                    || adjustments.lens.is_some()
                    || adjustments.bounces.is_some()
            }
            Self::Headlight | Self::Flat | Self::Toon => false,
            _ => true,
        }
    }

    /// Its lights and material, for a camera with these axes.
    pub fn lighting(self, [forward, right, up]: [Vec3; 3], adjustments: &Adjustments) -> Lighting {
        let studio = Lighting::studio(forward, right, up);
        let Lighting::Studio(key, sky) = studio else { return studio };
        let matte = |roughness| Material::Matte { roughness };
        let light = |strength: f32, degrees: f32, zenith, ground| {
            let angular_radius = degrees.to_radians();
            (KeyLight { strength, angular_radius, ..key }, Sky { zenith, ground, ..sky })
        };
        let (material, (key, sky)) = match self {
            Self::Headlight => return Lighting::Headlight,
            Self::Flat => return Lighting::Flat,
            Self::Toon => return Lighting::Toon { toward: key.toward },
            Self::Default if !self.is_traced(adjustments) => return studio,
            Self::Default | Self::Matte => (matte(0.0), (key, sky)),
            Self::Glossy => (Material::Glossy { roughness: 0.3, index: 1.5 }, (key, sky)),
            Self::Metal => (Material::Metal { roughness: 0.3 }, light(0.8, 10.0, 1.1, 0.1)),
            Self::Glass => (Material::Clear { index: 1.5 }, light(0.3, 25.0, 1.0, 0.8)),
            Self::Water => (Material::Clear { index: 1.33 }, light(0.3, 25.0, 1.0, 0.8)),
            Self::Clay => (matte(0.8), (key, sky)),
            Self::Paper => (matte(0.0), light(0.2, 20.0, 0.9, 0.75)),
            Self::Sand => (matte(1.0), light(1.05, 1.0, 0.32, 0.15)),
            Self::Dust => (matte(1.0), light(0.35, 30.0, 0.75, 0.45)),
        };
        let material = match material {
            Material::Matte { roughness } => matte(adjustments.roughness.unwrap_or(roughness)),
            Material::Metal { roughness } => {
                Material::Metal { roughness: adjustments.roughness.unwrap_or(roughness) }
            }
            Material::Glossy { roughness, index } => Material::Glossy {
                roughness: adjustments.roughness.unwrap_or(roughness),
                index: adjustments.index.unwrap_or(index),
            },
            Material::Clear { index } => Material::Clear { index: adjustments.index.unwrap_or(index) },
        };
        let bounces = adjustments.bounces.unwrap_or(BOUNCES);
        let lights = adjustments.lights.clone().unwrap_or(Lights::Studio(key, sky));
        Lighting::Paths(Paths { lights, material, bounces, lens: adjustments.lens })
    }
}
