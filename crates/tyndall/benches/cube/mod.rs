//! What benches measure: synthetic particles in the unit cube, seen from an oblique direction.

use tyndall::math::Ray;
use tyndall::random::Stream;
use tyndall::scene::Scene;
use tyndall::scene::camera::{Camera, Projection};
use tyndall::scene::color::ParticleColors;
use tyndall::scene::light::Lighting;
use tyndall::structure::{Kind, Structure};
use tyndall::{DVec3, Particles, Vec3};

/// The whole cube, in parallel rays.
pub(crate) const ORTHOGRAPHIC: Projection = Projection::Orthographic { height: 1.8 };
/// The whole cube, as an eye sees it.
pub(crate) const PERSPECTIVE: Projection =
    Projection::Perspective { vertical_angle: std::f64::consts::PI / 6.0 };

/// The light that a picture is made with.
#[derive(Clone, Copy)]
pub(crate) enum Look {
    /// By the angle alone.
    Headlight,
    /// With shadows and sky.
    Studio,
}

/// The camera before the cube.
pub(crate) fn camera(projection: Projection) -> Camera {
    let look_at = DVec3::splat(0.5);
    let eye = look_at + 3.5 * DVec3::new(0.80, 0.55, 0.45).normalize();
    Camera { eye, look_at, up: DVec3::Z, projection }
}

/// Arranges particles that have radii.
pub(crate) fn arranged(particles: Particles, kind: Kind) -> Structure {
    let radii = particles.radii().expect("synthetic particles have a radius").clone();
    Structure::build(kind, particles, &radii, 1.0, &()).expect("nobody interrupts")
}

/// What `camera` is to see.
pub(crate) fn scene(structure: Structure, camera: &Camera, look: Look) -> Scene {
    let view = camera.view(structure.origin(), 1, 1).expect("a valid camera");
    let lighting = match look {
        Look::Headlight => Lighting::Headlight,
        Look::Studio => Lighting::studio(view.forward, view.right, view.up),
    };
    Scene::new(structure, ParticleColors::constant([0.8; 3]), lighting, None)
}

/// Rays that share nothing: from random points around the cube to random points in it, as `benches/embree/spheres.cpp` has them.
pub(crate) fn incoherent_rays(count: u64) -> Vec<Ray> {
    let ray = |number| {
        let mut stream = Stream::new(1, number);
        let origin = Vec3::splat(0.5) + 2.0 * stream.direction();
        let target = Vec3::new(stream.unit(), stream.unit(), stream.unit());
        Ray { origin, direction: (target - origin).normalize(), t_min: 0.0, t_max: f32::INFINITY }
    };
    (0..count).map(ray).collect()
}
