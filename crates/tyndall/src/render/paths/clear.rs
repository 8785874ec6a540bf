//! Light in clear bodies: mirrored or broken where it enters, and followed until it leaves.
//!
//! Spheres that overlap are one body: light within goes on where another sphere begins before the first one ends. Spheres that hold the point
//! where light was mirrored within are not known, so that it may leave them early.

use glam::Vec3;

use super::scatter::fresnel;
use super::{MOST_CLEAR, Tracer};
use crate::math::Ray;
use crate::random::Stream;
use crate::render::surface::Surface;

/// Diameters after which light has a sphere's color: colors of maps are too dark for one.
pub(super) const COLOR_DIAMETERS: f32 = 4.0;

/// Light that goes on from the surface of a clear body.
pub(super) struct Out {
    pub(super) origin: Vec3,
    pub(super) direction: Vec3,
    /// Of the particle on which it starts.
    pub(super) node: u32,
    pub(super) throughput: Vec3,
}

/// Follows light that comes along `direction` to a sphere's surface until it leaves the body; chance decides at each surface whether it is
/// mirrored or broken.
pub(super) fn cross(
    tracer: &Tracer,
    (surface, sphere): (&Surface, (Vec3, f32)),
    direction: Vec3,
    index: f32,
    stream: &mut Stream,
) -> Out {
    let Surface { node, position, normal, color, .. } = *surface;
    let (mirrored, other) = fresnel((-direction.dot(normal)).clamp(0.0, 1.0), index);
    if stream.unit() < mirrored {
        return Out { origin: position, direction: mirror(direction, normal), node, throughput: Vec3::ONE };
    }
    let mut within = broken(direction, normal, 1.0 / index, other);
    let mut inside = Inside { node, sphere, color };
    let (mut origin, mut throughput) = (position, Vec3::ONE);
    for _ in 0..MOST_CLEAR {
        let (distance, clearness) = inside.run_to_end(tracer, origin, within);
        throughput *= clearness;
        origin += distance * within;
        let (center, radius) = inside.sphere;
        let outward = (origin - center).normalize_or(within);
        origin = center + radius * outward;
        let (mirrored, other) = fresnel(within.dot(outward).clamp(0.0, 1.0), 1.0 / index);
        if stream.unit() >= mirrored {
            let direction = broken(within, -outward, index, other);
            return Out { origin, direction, node: inside.node, throughput };
        }
        within = mirror(within, outward);
    }
    Out { origin, direction: within, node: inside.node, throughput: Vec3::ZERO }
}

/// The sphere in which light is.
struct Inside {
    node: u32,
    sphere: (Vec3, f32),
    color: Vec3,
}

impl Inside {
    /// How far it is to the end of the body from a point on or in the sphere, and the share of light that is left there. Afterwards this is the
    /// sphere in which the body ends.
    fn run_to_end(&mut self, tracer: &Tracer, origin: Vec3, direction: Vec3) -> (f32, Vec3) {
        let mut clearness = Vec3::ONE;
        let (mut start, mut end) = (0.0, leave_sphere(origin, direction, self.sphere));
        // Spheres that begin before the last one ends.
        let mut from = self.node;
        let mut reached = 0.0;
        for _ in 0..MOST_CLEAR {
            let ray = Ray { origin, direction, t_min: reached, t_max: end };
            let Some(hit) = tracer.scene.structure().intersect(&ray, Some(from)) else { break };
            (reached, from) = (hit.t, hit.node);
            let sphere = tracer.scene.structure().sphere(hit.node);
            let other_end = leave_sphere(origin, direction, sphere);
            if other_end > end {
                clearness *= self.left(hit.t - start);
                let color = tracer.scene.color(tracer.scene.structure().original(hit.node)).into();
                *self = Self { node: hit.node, sphere, color };
                (start, end) = (hit.t, other_end);
            }
        }
        (end, clearness * self.left(end - start))
    }

    /// The share of light that is left after a length within the sphere.
    fn left(&self, length: f32) -> Vec3 {
        let depths = (length / (COLOR_DIAMETERS * 2.0 * self.sphere.1)).max(0.0);
        Vec3::from_array(self.color.to_array().map(|channel| channel.max(1e-6).powf(depths).min(1.0)))
    }
}

/// How far it is from a point in or on a sphere to its surface.
fn leave_sphere(origin: Vec3, direction: Vec3, (center, radius): (Vec3, f32)) -> f32 {
    let to_center = center - origin;
    let closest = to_center.dot(direction);
    let off = to_center - closest * direction;
    (closest + (radius * radius - off.dot(off)).max(0.0).sqrt()).max(0.0)
}

fn mirror(direction: Vec3, normal: Vec3) -> Vec3 {
    (direction - 2.0 * direction.dot(normal) * normal).normalize_or(normal)
}

/// Where light goes on through a surface whose normal is against it; `relative` is the index of this side over that of the other, `other` the
/// cosine there.
fn broken(direction: Vec3, normal: Vec3, relative: f32, other: f32) -> Vec3 {
    let cosine = -direction.dot(normal);
    (relative * direction + (relative * cosine - other) * normal).normalize_or(direction)
}
