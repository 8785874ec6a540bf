//! What lights a medium: distant, point-like, conical, and all around.
//!
//! Each light answers three questions. From a point: which direction to look, and how much light comes from there
//! ([`Light::toward`]). For a photon: where it starts, where to, with which power ([`Light::emit`]). How bright it is in total
//! ([`Light::power`]), to share photons out. Positions are measured like the medium's; lights inside it are allowed.
//! Directions have unit length. Invariant: all numbers are finite and no brightness is negative.

use std::f32::consts::{PI, TAU};

use glam::Vec3;

pub use crate::environment::Environment;
use crate::environment::{Sun, brightness, sphere};
use crate::error::{Error, Result};
use crate::math::Bounds;

/// A light.
#[derive(Clone, Debug)]
pub enum Light {
    /// Parallel light from far away.
    Directional(Directional),
    /// The same in all directions from a point.
    Point(Point),
    /// A cone from a point.
    Spot(Spot),
    /// Far away, all around.
    Environment(Environment),
}

/// Parallel light from far away.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Directional {
    along: Vec3,
    irradiance: Vec3,
}

/// A light at a point, the same in all directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    position: Vec3,
    intensity: Vec3,
}

/// A light at a point that shines into a cone with a soft edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    position: Vec3,
    along: Vec3,
    intensity: Vec3,
    /// Cosine of the half angle within which it is full.
    full: f32,
    /// Cosine of the half angle beyond which it is dark.
    dark: f32,
}

/// Light that arrives at a point.
#[derive(Clone, Copy, Debug)]
pub struct Arrival {
    /// Where it comes from.
    pub toward: Vec3,
    /// How far away its source is; infinite for a distant one.
    pub distance: f32,
    /// RGB; radiance over the probability density of `toward`, or irradiance on a plane that faces a light without extent.
    pub light: Vec3,
    /// Probability density of `toward` per steradian; `None` where no other direction could have been drawn.
    pub density: Option<f32>,
}

/// The start of a photon.
#[derive(Clone, Copy, Debug)]
pub struct Emission {
    /// Where; outside the medium for distant lights.
    pub origin: Vec3,
    /// Where to.
    pub direction: Vec3,
    /// RGB power, if this were the only photon of the light.
    pub power: Vec3,
}

impl Directional {
    /// Light that travels `along` a direction of any length and brings `irradiance` to a plane across it.
    pub fn new(along: Vec3, irradiance: [f32; 3]) -> Result<Self> {
        Ok(Self { along: direction(along)?, irradiance: brightness("irradiance", irradiance)? })
    }

    /// Where it travels.
    pub fn along(&self) -> Vec3 {
        self.along
    }
}

impl From<Sun> for Directional {
    fn from(Sun { along, irradiance }: Sun) -> Self {
        Self { along, irradiance }
    }
}

impl Point {
    /// Light from `position` of `intensity` (power per steradian).
    pub fn new(position: Vec3, intensity: [f32; 3]) -> Result<Self> {
        Ok(Self { position: place(position)?, intensity: brightness("intensity", intensity)? })
    }

    /// Where it stands.
    pub fn position(&self) -> Vec3 {
        self.position
    }
}

impl Spot {
    /// Light from `position` around the direction `along`, of `intensity` (power per steradian) within the inner half angle of
    /// the cone, falling smoothly to none at the outer one; 0 <= full < dark <= pi, in radians.
    pub fn new(position: Vec3, along: Vec3, intensity: [f32; 3], cone: Cone) -> Result<Self> {
        let Cone { full, dark } = cone;
        if !(0.0 <= full && full < dark && dark <= PI) {
            let value = format!("{full} to {dark}");
            return Err(Error::setting("cone", value, "two half angles, 0 <= full < dark <= pi"));
        }
        Ok(Self {
            position: place(position)?,
            along: direction(along)?,
            intensity: brightness("intensity", intensity)?,
            full: full.cos(),
            dark: dark.cos(),
        })
    }

    /// Where it stands.
    pub fn position(&self) -> Vec3 {
        self.position
    }

    /// Share of the intensity that goes at this `cosine` to the axis: smoothstep between the two angles.
    fn share(&self, cosine: f32) -> f32 {
        let x = ((cosine - self.dark) / (self.full - self.dark)).clamp(0.0, 1.0);
        x * x * (3.0 - 2.0 * x)
    }
}

/// The half angles of a spot light, in radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Within it the light is full.
    pub full: f32,
    /// Beyond it there is none.
    pub dark: f32,
}

impl Light {
    /// Light that arrives at `at`, of a direction drawn by two random numbers in [0, 1) where there is a choice.
    #[inline]
    pub fn toward(&self, at: Vec3, random: [f32; 2]) -> Arrival {
        match self {
            Self::Directional(light) => Arrival {
                toward: -light.along,
                distance: f32::INFINITY,
                light: light.irradiance,
                density: None,
            },
            Self::Point(light) => from_point(light.position, at, |_| light.intensity),
            Self::Spot(light) => {
                from_point(light.position, at, |out| light.intensity * light.share(out.dot(light.along)))
            }
            Self::Environment(light) => {
                let toward = light.sample(random);
                let density = light.density(toward);
                let radiance = light.radiance(toward);
                let light = if density > 0.0 { radiance / density } else { Vec3::ZERO };
                Arrival { toward, distance: f32::INFINITY, light, density: Some(density) }
            }
        }
    }

    /// Where it stands; `None` for distant ones.
    pub fn position(&self) -> Option<Vec3> {
        match self {
            Self::Point(light) => Some(light.position),
            Self::Spot(light) => Some(light.position),
            Self::Directional(_) | Self::Environment(_) => None,
        }
    }

    /// The directions into which it shines, in steradians, edge of a cone included.
    pub(crate) fn solid_angle(&self) -> f32 {
        match self {
            Self::Spot(light) => TAU * (1.0 - light.dark),
            Self::Directional(_) | Self::Point(_) | Self::Environment(_) => 4.0 * PI,
        }
    }

    /// Whether its light has the same color in all directions and everywhere.
    pub(crate) fn has_one_color(&self) -> bool {
        !matches!(self, Self::Environment(sky) if !sky.is_constant())
    }

    /// RGB power that a medium within `bounds` can get of this light: what a distant light sends through the box (of an image all
    /// around the box's mean cross section is taken), all that another one emits.
    pub fn power(&self, bounds: &Bounds) -> Vec3 {
        match self {
            Self::Directional(light) => faces(bounds, light.along).element_sum() * light.irradiance,
            Self::Point(light) => 4.0 * PI * light.intensity,
            // The integral of smoothstep over its interval is one half of it.
            Self::Spot(light) => TAU * light.intensity * (1.0 - light.full + 0.5 * (light.full - light.dark)),
            Self::Environment(light) => {
                // The mean cross section of a convex body is a quarter of its surface (Cauchy).
                let sides = faces(bounds, Vec3::ONE).element_sum();
                4.0 * PI * (0.5 * sides) * light.mean()
            }
        }
    }

    /// A photon for a medium within `bounds`, drawn by four random numbers in [0, 1). One of a distant light starts where it
    /// enters the box.
    pub fn emit(&self, bounds: &Bounds, random: [f32; 4]) -> Emission {
        let [a, b, c, d] = random;
        match self {
            Self::Directional(light) => Emission {
                origin: entry(bounds, light.along, [a, b]),
                direction: light.along,
                power: self.power(bounds),
            },
            Self::Point(light) => {
                Emission { origin: light.position, direction: sphere([a, b]), power: self.power(bounds) }
            }
            Self::Spot(light) => {
                // Uniform in the cone; the power carries the soft edge.
                let cosine = 1.0 - a * (1.0 - light.dark);
                let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
                let (sin_around, cos_around) = (TAU * b).sin_cos();
                let (u, v) = light.along.any_orthonormal_pair();
                let direction = sine * cos_around * u + sine * sin_around * v + cosine * light.along;
                let power = TAU * (1.0 - light.dark) * light.share(cosine) * light.intensity;
                Emission { origin: light.position, direction: direction.normalize(), power }
            }
            Self::Environment(light) => {
                let toward = light.sample([c, d]);
                let density = light.density(toward);
                let section = faces(bounds, toward).element_sum();
                let power =
                    if density > 0.0 { light.radiance(toward) * (section / density) } else { Vec3::ZERO };
                Emission { origin: entry(bounds, -toward, [a, b]), direction: -toward, power }
            }
        }
    }
}

/// Light of a source at `position` with the intensity `intensity(direction)`, at `at`. None where both are one point.
#[inline(always)]
fn from_point(position: Vec3, at: Vec3, intensity: impl Fn(Vec3) -> Vec3) -> Arrival {
    let offset = position - at;
    let distance = offset.length();
    let toward = if distance > 0.0 { offset / distance } else { Vec3::Z };
    let light = if distance > 0.0 { intensity(-toward) / (distance * distance) } else { Vec3::ZERO };
    Arrival { toward, distance, light, density: None }
}

/// Areas of the box's faces across x, y and z, as they are seen along a direction.
fn faces(bounds: &Bounds, along: Vec3) -> Vec3 {
    let extent = bounds.extent();
    along.abs() * Vec3::new(extent.y * extent.z, extent.z * extent.x, extent.x * extent.y)
}

/// Where parallel light along a direction enters the box: uniform over its cross section.
fn entry(bounds: &Bounds, along: Vec3, random: [f32; 2]) -> Vec3 {
    let faces = faces(bounds, along);
    let mut rest = random[0] * faces.element_sum();
    let mut axis = 0;
    while axis < 2 && rest >= faces[axis] {
        rest -= faces[axis];
        axis += 1;
    }
    // What is left of the first number, within the chosen face, is a random number again.
    let again = if faces[axis] > 0.0 { (rest / faces[axis]).min(1.0) } else { 0.0 };
    let mut share = Vec3::ZERO;
    share[axis] = if along[axis] > 0.0 { 0.0 } else { 1.0 };
    share[(axis + 1) % 3] = again;
    share[(axis + 2) % 3] = random[1];
    bounds.min + share * bounds.extent()
}

fn direction(along: Vec3) -> Result<Vec3> {
    along
        .try_normalize()
        .ok_or_else(|| Error::setting("direction", along, "three finite numbers, not all zero"))
}

fn place(position: Vec3) -> Result<Vec3> {
    if position.is_finite() {
        return Ok(position);
    }
    Err(Error::setting("position", position, "three finite numbers"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    fn lights() -> Vec<Light> {
        let rgb = [3.0, 2.0, 1.0];
        let pixels: Vec<[f32; 3]> = (0..32).map(|k| [k as f32, 1.0, 0.3]).collect();
        vec![
            Light::Directional(Directional::new(Vec3::new(1.0, -2.0, 0.5), rgb).unwrap()),
            Light::Point(Point::new(Vec3::new(0.5, 0.2, 0.1), rgb).unwrap()),
            Light::Spot(
                Spot::new(Vec3::new(0.3, 2.0, 0.5), Vec3::NEG_Y, rgb, Cone { full: 0.3, dark: 0.7 }).unwrap(),
            ),
            Light::Environment(Environment::constant(rgb).unwrap()),
            Light::Environment(Environment::image(8, &pixels).unwrap()),
        ]
    }

    /// The fluence (radiance over all directions) at points of a ball in an empty box, by photons and by looking at the light:
    /// a photon adds its power times its way through the ball over the ball's volume.
    #[test]
    fn photons_bring_what_looking_at_the_light_sees() {
        let bounds = Bounds { min: Vec3::new(-1.0, 0.0, -0.5), max: Vec3::new(1.0, 1.0, 1.5) };
        let (center, radius) = (Vec3::new(-0.3, 0.5, 0.6), 0.3);
        for (number, light) in lights().into_iter().enumerate() {
            let mut stream = Stream::new(51, number as u64);
            let count = 200_000;
            let (mut carried, mut seen) = (0.0_f64, 0.0_f64);
            for _ in 0..count {
                let random = std::array::from_fn(|_| stream.unit());
                let photon = light.emit(&bounds, random);
                let to_center = center - photon.origin;
                let closest = to_center.dot(photon.direction);
                let half_sq = radius * radius - (to_center - closest * photon.direction).length_squared();
                if half_sq > 0.0 && closest > 0.0 {
                    carried += f64::from(photon.power.element_sum() * 2.0 * half_sq.sqrt());
                }
                let at = center + radius * stream.unit().cbrt() * stream.direction();
                let arrival = light.toward(at, [stream.unit(), stream.unit()]);
                seen += f64::from(arrival.light.element_sum());
            }
            let volume = 4.0 / 3.0 * std::f64::consts::PI * f64::from(radius).powi(3);
            let ratio = carried / volume / seen;
            assert!((ratio - 1.0).abs() < 0.03, "light {number}: {ratio}");
        }
    }

    #[test]
    fn photons_carry_the_power_of_the_light_and_start_on_the_box() {
        let bounds = Bounds { min: Vec3::new(-1.0, 0.0, -0.5), max: Vec3::new(1.0, 1.0, 1.5) };
        for (number, light) in lights().into_iter().enumerate().take(4) {
            let mut stream = Stream::new(52, number as u64);
            let mut sum = Vec3::ZERO;
            let count = 40_000;
            for _ in 0..count {
                let photon = light.emit(&bounds, std::array::from_fn(|_| stream.unit()));
                assert!(photon.direction.is_normalized());
                sum += photon.power / count as f32;
                let share = (photon.origin - bounds.min) / bounds.extent();
                let edge = ((share - 0.5).abs().max_element() - 0.5).abs();
                assert!(number == 1 || number == 2 || edge < 1e-6, "light {number}: {share}");
            }
            let power = light.power(&bounds);
            assert!(sum.abs_diff_eq(power, 0.02 * power.max_element()), "light {number}: {sum} {power}");
        }
    }

    #[test]
    fn a_point_light_at_the_very_point_adds_nothing() {
        let light = Light::Point(Point::new(Vec3::ONE, [1.0; 3]).unwrap());
        let arrival = light.toward(Vec3::ONE, [0.0; 2]);
        assert!(arrival.light == Vec3::ZERO && arrival.toward.is_normalized());
    }

    #[test]
    fn impossible_lights_are_refused() {
        assert!(Directional::new(Vec3::ZERO, [1.0; 3]).is_err());
        assert!(Directional::new(Vec3::Y, [-1.0, 0.0, 0.0]).is_err());
        assert!(Point::new(Vec3::NAN, [1.0; 3]).is_err());
        for (full, dark) in [(0.5, 0.5), (-0.1, 1.0), (0.1, 4.0), (f32::NAN, 1.0)] {
            assert!(Spot::new(Vec3::ZERO, Vec3::Y, [1.0; 3], Cone { full, dark }).is_err());
        }
    }
}
