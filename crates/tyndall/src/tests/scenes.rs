//! Random scenes and cameras, reproducible by seed, the degenerate ones among them.

use glam::{DVec3, Vec3};

use crate::math::Bounds;
use crate::particles::{Attribute, Columns, Particles, Positions, Radii, Values};
use crate::scene::camera::{Camera, Projection};

/// A small generator (PCG-XSH-RR) for tests.
pub(super) struct Random(u64);

impl Random {
    pub(super) fn new(seed: u64) -> Self {
        let mut random = Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x1234_5678);
        random.bits();
        random
    }

    pub(super) fn bits(&mut self) -> u32 {
        let state = self.0;
        self.0 = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((((state >> 18) ^ state) >> 27) as u32).rotate_right((state >> 59) as u32)
    }

    pub(super) fn unit(&mut self) -> f32 {
        (self.bits() >> 8) as f32 / 16_777_216.0
    }

    pub(super) fn below(&mut self, count: u32) -> u32 {
        self.bits() % count
    }

    pub(super) fn vector(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }
}

/// What a random scene is like.
#[derive(Clone, Copy, Debug)]
pub(super) enum Law {
    Uniform,
    Equal,
    Collinear,
    Lattice,
    MixedRadii,
    Huge,
    Tiny,
    Planar,
}

pub(super) const LAWS: [Law; 8] = [
    Law::Uniform,
    Law::Equal,
    Law::Collinear,
    Law::Lattice,
    Law::MixedRadii,
    Law::Huge,
    Law::Tiny,
    Law::Planar,
];

/// Particles by a law, with a radius each where `radii` differ.
pub(super) fn particles(law: Law, count: usize, random: &mut Random) -> (Particles, Radii) {
    let scale = match law {
        Law::Huge => 1e12,
        Law::Tiny => 1e-12,
        _ => 1.0,
    };
    let line = random.vector();
    let edge = (count as f32).cbrt().ceil().max(1.0) as usize;
    let mut columns: [Vec<f32>; 3] = Default::default();
    let mut radii = Vec::new();
    for id in 0..count {
        let place = match law {
            Law::Equal => Vec3::splat(0.25),
            Law::Collinear => line * random.unit(),
            Law::Lattice => {
                let at = [id % edge, id / edge % edge, id / edge / edge].map(|k| k as f32);
                Vec3::from_array(at) * (2.0 / edge as f32) - 1.0
            }
            Law::Planar => random.vector() * Vec3::new(1.0, 0.0, 1.0),
            _ => random.vector(),
        };
        for axis in 0..3 {
            columns[axis].push(scale * place[axis]);
        }
        let spacing = 1.0 / edge as f32;
        radii.push(match law {
            Law::MixedRadii => 1e-6 * 10_f32.powf(6.0 * random.unit().powi(3) + 5.7 * random.unit().powi(9)),
            _ => scale * spacing * (0.2 + random.unit()),
        });
    }
    let each = random.below(2) == 0 || matches!(law, Law::MixedRadii);
    let uniform = radii.first().copied().unwrap_or(1.0);
    let attributes = vec![Attribute::new("radius", 1, Values::F32(radii))];
    let positions = Positions::from_offsets(DVec3::ZERO, columns);
    let particles = Particles::new(Columns { positions, attributes, ..Columns::default() }).unwrap();
    let radii = if each { Radii::PerParticle { attribute: 0, scale: 1.0 } } else { Radii::Uniform(uniform) };
    (particles, radii)
}

/// A camera of either projection: from outside along an axis, a diagonal or any direction, or from within the cloud.
pub(super) fn camera(bounds: &Bounds, random: &mut Random) -> Camera {
    let center = if bounds.is_empty() { Vec3::ZERO } else { bounds.center() };
    let size = bounds.extent().max_element().max(0.1 * center.abs().max_element()).max(1e-20);
    let direction = match random.below(4) {
        0 => [Vec3::X, Vec3::Y, Vec3::Z][random.below(3) as usize],
        1 => Vec3::ONE,
        _ => random.vector(),
    };
    let distance = if random.below(4) == 0 { 0.1 } else { 0.5 + 2.0 * random.unit() };
    let eye = center - direction.normalize_or(Vec3::X) * (distance * size);
    let up = if direction.normalize_or(Vec3::X).cross(Vec3::Z).length() < 0.1 { Vec3::Y } else { Vec3::Z };
    let projection = if random.below(2) == 0 {
        Projection::Perspective { vertical_angle: (0.2 + 1.8 * random.unit()) as f64 }
    } else {
        Projection::Orthographic { height: (size * (0.05 + 1.5 * random.unit())) as f64 }
    };
    Camera { eye: eye.as_dvec3(), look_at: center.as_dvec3(), up: up.as_dvec3(), projection }
}
