//! What lights the particles.

use std::sync::Arc;

use glam::Vec3;

use super::image_light::ImageLight;
use super::material::Material;
use crate::error::{Error, Result};

/// A distant light with a disc that makes soft shadows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeyLight {
    /// Unit direction toward its middle.
    pub toward: Vec3,
    /// Half the angle that it subtends, in radians.
    pub angular_radius: f32,
    /// Brightness of a white surface that faces it.
    pub strength: f32,
}

/// A sky all around, brightest at the zenith, dimmest at the nadir, even between.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sky {
    /// Brightness overhead; that of a white surface if the sky were this bright everywhere.
    pub zenith: f32,
    /// Brightness from below.
    pub ground: f32,
    /// Unit direction to the zenith.
    pub up: Vec3,
}

/// How particles are lit.
#[derive(Clone, Debug, PartialEq)]
pub enum Lighting {
    /// A light at the eye: brightness is the cosine between the surface's normal and the ray.
    Headlight,
    /// A key light with soft shadows and a sky with ambient occlusion, both traced.
    Studio(KeyLight, Sky),
    /// The same lights or an image, and all light that goes from particle to particle.
    Paths(Paths),
    /// None: the pure color.
    Flat,
    /// A light in three levels, without shadows: what faces it within 60 degrees has the pure color, what faces it less, or not, is darker.
    Toon {
        /// Unit direction toward it.
        toward: Vec3,
    },
}

/// Light by path tracing: where it comes from, what surfaces are made of, and how far it is followed.
#[derive(Clone, Debug, PartialEq)]
pub struct Paths {
    /// Where it comes from.
    pub lights: Lights,
    /// Of all particles.
    pub material: Material,
    /// How often light is thrown on from one surface to another before it reaches the eye; 0 is what `Studio` shows. Surfaces that light goes
    /// through do not count.
    pub bounces: u32,
    /// A lens that is sharp at one distance; none is sharp everywhere.
    pub lens: Option<Lens>,
}

/// Where light comes from that is followed by paths. Shiny surfaces mirror it, clear ones break it.
#[derive(Clone, Debug, PartialEq)]
pub enum Lights {
    /// See [`Lighting::Studio`]. Behind the particles is the scene's background.
    Studio(KeyLight, Sky),
    /// An image of all that is far away, or one radiance all around.
    Image {
        /// The image.
        light: Arc<ImageLight>,
        /// Whether it is seen behind the particles too, where the picture then is opaque.
        is_seen: bool,
    },
}

impl Paths {
    /// Fails with [`Error::Setting`] if a material or a lens is out of range.
    pub(crate) fn check(&self) -> Result<()> {
        self.material.check()?;
        match self.lens {
            Some(Lens { radius, .. }) if !(radius > 0.0 && radius.is_finite()) => {
                Err(Error::setting("--aperture", radius, "a length greater than 0"))
            }
            Some(Lens { focus, .. }) if !(focus > 0.0 && focus.is_finite()) => {
                Err(Error::setting("--focus", focus, "a distance in front of the eye"))
            }
            _ => Ok(()),
        }
    }
}

/// A thin lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Radius of its opening, in the unit of the particles; greater than 0.
    pub radius: f32,
    /// Distance of the plane that is sharp, along the line of sight from the eye; greater than 0.
    pub focus: f32,
}

impl Lighting {
    /// Fails with [`Error::Setting`] if something is out of range.
    pub(crate) fn check(&self) -> Result<()> {
        match self {
            Self::Paths(paths) => paths.check(),
            Self::Headlight | Self::Studio(..) | Self::Flat | Self::Toon { .. } => Ok(()),
        }
    }

    /// The default look: the key light from the upper left behind the camera, the sky above it.
    /// `forward`, `right` and `up` are the camera's axes.
    pub fn studio(forward: Vec3, right: Vec3, up: Vec3) -> Self {
        let toward = (-forward - 0.75 * right + 0.95 * up).normalize();
        let key = KeyLight { toward, angular_radius: 5.0_f32.to_radians(), strength: 0.62 };
        let sky = Sky { zenith: 0.62, ground: 0.3, up: (up - 0.5 * forward).normalize() };
        Self::Studio(key, sky)
    }
}
