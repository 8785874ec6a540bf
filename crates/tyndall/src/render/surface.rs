//! What a single ray meets: the surface of a particle, or of a shape beside it.

use glam::Vec3;

use crate::math::Ray;
use crate::scene::Scene;

/// A surface that a ray met.
#[derive(Clone, Copy)]
pub(super) struct Surface {
    pub(super) node: u32,
    pub(super) position: Vec3,
    pub(super) normal: Vec3,
    pub(super) color: Vec3,
    /// Radiance that it gives off.
    pub(super) glow: Vec3,
}

impl Surface {
    /// Where a ray meets the particle or shape at a node, at distance `t`.
    pub(super) fn new(scene: &Scene, ray: &Ray, (t, node): (f32, u32)) -> Self {
        let point = ray.origin + t * ray.direction;
        let structure = scene.structure();
        if let Some((cut, of)) = scene.cap_of(node) {
            let normal = cut.normal(point, ray.direction);
            let color = scene.cap_color(cut, of).into();
            return Self { node, position: point, normal, color, glow: Vec3::ZERO };
        }
        if let Some((shapes, own, shift)) = scene.locate_shape(node) {
            let (position, normal) = shapes.shape(own / 2).surface(point - shift, ray.direction);
            let color = shapes.color(own, |owner| scene.color(owner)).into();
            let owner = shapes.particle(own).filter(|_| scene.glows());
            let glow = owner.map_or(Vec3::ZERO, |owner| scene.glow(owner).into());
            return Self { node, position: position + shift, normal, color, glow };
        }
        let (center, radius) = structure.sphere(node);
        // A sphere so small that rounding leaves no direction faces the ray.
        let normal = (point - center).normalize_or(-ray.direction);
        Self {
            node,
            position: center + radius * normal,
            normal,
            color: scene.color(structure.original(node)).into(),
            glow: scene.glow(structure.original(node)).into(),
        }
    }
}
