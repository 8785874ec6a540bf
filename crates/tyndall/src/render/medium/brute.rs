//! Light in a medium without a cache: at every point of the march anew, by a march to each light and by gathering photons.
//!
//! Gives the same as [`super::cache::Cache`] with photons, but for the cache's lattices and for noise from the sky, of which one
//! direction is looked at for each point. It is what the cache saves: hundreds of times slower.

use glam::Vec3;

use super::free_path::Tracker;
use super::gather::{self, PhotonMap};
use super::harmonics;
use super::solids::Solids;
use crate::math::Ray;
use crate::medium::{Light, Medium};
use crate::random::Stream;

/// Lights and photons, looked up where they are needed.
pub struct BruteForce<'a> {
    tracker: Tracker<'a>,
    lights: &'a [Light],
    photons: PhotonMap<'a>,
    order: usize,
    solids: Option<Solids<'a>>,
}

impl<'a> BruteForce<'a> {
    /// Takes the lights, and photons of their second and further scatterings.
    pub fn new(medium: &'a Medium, lights: &'a [Light], photons: PhotonMap<'a>) -> Self {
        let order = harmonics::order_for(medium.optics().phase.g());
        Self { tracker: Tracker::new(medium), lights, photons, order, solids: None }
    }

    /// The same with opaque bodies in the medium: those around which the photons were traced.
    pub fn with_solids(self, solids: Solids<'a>) -> Self {
        let covered = gather::covered(self.tracker.medium(), solids);
        Self { solids: Some(solids), photons: self.photons.outside(Some(covered)), ..self }
    }

    /// The radiance that scattering and emission add at a point, per extinction, against `direction`.
    pub(super) fn scattered(&self, at: Vec3, direction: Vec3, stream: &mut Stream) -> Vec3 {
        let optics = self.tracker.medium().optics();
        let mut sum = Vec3::ZERO;
        for light in self.lights {
            let arrival = light.toward(at, [stream.unit(), stream.unit()]);
            let ray = Ray { origin: at, direction: arrival.toward, t_min: 0.0, t_max: arrival.distance };
            if self.solids.is_some_and(|solids| solids.block(&ray, None)) {
                continue;
            }
            let share = optics.phase.evaluate(arrival.toward.dot(direction));
            sum += share * arrival.light * self.tracker.transmittance(&ray);
        }
        let weights = harmonics::scattered(-direction, optics.phase.g());
        let coefficients = self.photons.coefficients(at, self.order);
        for (weight, coefficient) in weights.into_iter().zip(coefficients) {
            sum += weight * coefficient;
        }
        Vec3::from(optics.albedo) * sum + self.tracker.medium().emitted(at)
    }
}
