//! Lights as paths look at them: from a point in the medium or on a surface, each by what finds it best.

use glam::Vec3;

use crate::math::Ray;
use crate::medium::Light;
use crate::medium::light::{Arrival, Environment};
use crate::random::Stream;

/// The lights by how they are looked at.
pub(super) struct Lights<'a> {
    /// Those without extent: by a shadow ray.
    lamps: Vec<Lamp<'a>>,
    /// The sum of all constant environments: by paths that leave.
    constant: Vec3,
    /// By both.
    images: Vec<(&'a Light, &'a Environment)>,
}

/// A light without extent.
struct Lamp<'a> {
    light: &'a Light,
    /// How many paths start at it per steradian, which find its light too.
    paths: f32,
}

impl Lamp<'_> {
    /// What it brings to a point, where `seen` paths of the eye per volume scattered first: the balance heuristic between those and its own.
    fn toward(&self, at: Vec3, seen: f32) -> Arrival {
        let arrival = self.light.toward(at, [0.5; 2]);
        let square = arrival.distance * arrival.distance;
        let ratio = if self.paths > 0.0 { self.paths / (square * seen).max(f32::MIN_POSITIVE) } else { 0.0 };
        Arrival { light: arrival.light / (1.0 + ratio), ..arrival }
    }
}

impl<'a> Lights<'a> {
    pub(super) fn new(lights: &'a [Light]) -> Self {
        Self::with_paths(lights, |_| 0.0)
    }

    /// The same where so many paths per steradian start at each light, too.
    pub(super) fn with_paths(lights: &'a [Light], paths: impl Fn(&Light) -> f32) -> Self {
        let mut sorted = Self { lamps: Vec::new(), constant: Vec3::ZERO, images: Vec::new() };
        for light in lights {
            match light {
                Light::Environment(sky) if sky.is_constant() => sorted.constant += sky.mean(),
                Light::Environment(sky) => sorted.images.push((light, sky)),
                Light::Directional(_) | Light::Point(_) | Light::Spot(_) => {
                    sorted.lamps.push(Lamp { light, paths: paths(light) });
                }
            }
        }
        sorted
    }

    /// Radiance of the environment in a direction.
    pub(super) fn seen(&self, toward: Vec3) -> Vec3 {
        self.images.iter().fold(self.constant, |sum, (_, sky)| sum + sky.radiance(toward))
    }

    /// What a path that leaves in a direction drawn with `density` adds to what looking at the images has found.
    pub(super) fn left_over(&self, toward: Vec3, density: f32) -> Vec3 {
        let image = |sky: &Environment| density / (density + sky.density(toward)) * sky.radiance(toward);
        self.images.iter().fold(self.constant, |sum, (_, sky)| sum + image(sky))
    }

    /// Light that arrives at a point from the lights that can be looked at, each times the share that is thrown on, which is the probability density
    /// with which a path would go there. `through` says how much comes along a shadow ray; `seen` how many paths per volume scatter where the
    /// path of the eye first did.
    pub(super) fn direct(
        &self,
        at: Vec3,
        seen: f32,
        share: impl Fn(Vec3) -> f32,
        mut through: impl FnMut(&Ray, &mut Stream) -> Vec3,
        stream: &mut Stream,
    ) -> Vec3 {
        let mut radiance = Vec3::ZERO;
        let shadow =
            |toward: Vec3, distance: f32| Ray { origin: at, direction: toward, t_min: 0.0, t_max: distance };
        // One of the lights without extent, in proportion to what it would bring through emptiness.
        let bring = |lamp: &Lamp| {
            let arrival = lamp.toward(at, seen);
            (arrival, share(arrival.toward) * arrival.light)
        };
        let chosen = match self.lamps.as_slice() {
            [] => None,
            [lamp] => Some((bring(lamp), 1.0)),
            lamps => choose(lamps.iter().map(|lamp| bring(lamp).1.element_sum()), stream)
                .map(|(number, chance)| (bring(&lamps[number]), chance)),
        };
        if let Some(((arrival, brought), chance)) = chosen
            && brought != Vec3::ZERO
        {
            let ray = shadow(arrival.toward, arrival.distance);
            radiance += brought / chance * through(&ray, stream);
        }
        for (light, environment) in &self.images {
            let arrival = light.toward(at, [stream.unit(), stream.unit()]);
            let density = environment.density(arrival.toward);
            let share = share(arrival.toward);
            if share <= 0.0 {
                continue;
            }
            // The balance heuristic between the sky's directions and those in which paths go on.
            let weight = share * density / (density + share);
            let ray = shadow(arrival.toward, f32::INFINITY);
            radiance += weight * arrival.light * through(&ray, stream);
        }
        radiance
    }
}

/// The number of one of `weights`, drawn in proportion, and its chance; `None` if all are 0.
fn choose(weights: impl Iterator<Item = f32> + Clone, stream: &mut Stream) -> Option<(usize, f32)> {
    let total: f32 = weights.clone().sum();
    let mut rest = stream.unit() * total;
    let mut last = None;
    for (number, weight) in weights.enumerate() {
        if weight > 0.0 {
            last = Some((number, weight / total));
            if rest < weight {
                break;
            }
            rest -= weight;
        }
    }
    last
}
