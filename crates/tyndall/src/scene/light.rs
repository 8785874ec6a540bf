//! What lights the particles.

use glam::Vec3;

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
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lighting {
    /// A light at the eye: brightness is the cosine between the surface's normal and the ray.
    Headlight,
    /// A key light with soft shadows and a sky with ambient occlusion, both traced.
    Studio(KeyLight, Sky),
    /// None: the pure color.
    Flat,
}

impl Lighting {
    /// The default look: the key light from the upper left behind the camera, the sky above it.
    /// `forward`, `right` and `up` are the camera's axes.
    pub fn studio(forward: Vec3, right: Vec3, up: Vec3) -> Self {
        let toward = (-forward - 0.75 * right + 0.95 * up).normalize();
        let key = KeyLight { toward, angular_radius: 5.0_f32.to_radians(), strength: 0.62 };
        let sky = Sky { zenith: 0.62, ground: 0.3, up: (up - 0.5 * forward).normalize() };
        Self::Studio(key, sky)
    }
}
