//! `nozzle` (mm): liquid leaves a nozzle at the origin along z and falls apart: core jet, ligaments, droplets, mist.
//!
//! Core, ligaments and droplets have one density of particles, that of a simple cubic lattice filling the core. The radius
//! is 0.6 of that lattice's edge. Attributes: `speed`, 1 on the axis at the mouth; `age`, the time since the mouth, in
//! units of 1 mm over the speed on the axis. The sizes of the jet, its ligaments and its cones are the same for every
//! count: more particles stand closer, and make smaller and more droplets.

use std::f32::consts::{PI, TAU};
use std::ops::Range;

use glam::{DVec3, Quat, Vec3};

use super::lattice::{Frame, Lattice, SIMPLE, ball, even, largest};
use super::{Filled, Law, Particle, Plan, TABLES, ends};
use crate::particles::Radii;
use crate::random::Stream;

/// Shares of core, ligaments, droplets and mist.
pub(super) const SHARES: [f64; 4] = [0.32, 0.19, 0.33, 0.16];
/// Length of the core jet, mm; its radius is 1.
const CORE: f32 = 8.0;
const LIGAMENTS: usize = 400;
/// Straight pieces of a ligament.
const PIECES: usize = 48;
/// Particles of a droplet, and the exponent of their distribution.
const DROPLET: Range<f64> = 8.0..4000.0;
const DROPLET_EXPONENT: f64 = 1.8;
/// Tangents of the half angles of the cones of droplets (14 degrees) and of mist (22 degrees).
const DROPLET_SLOPE: f32 = 0.249_33;
const MIST_SLOPE: f32 = 0.404_03;
/// Droplets and mist keep this far from the axis beside the core, mm.
const CLEAR: f32 = 1.25;
/// The Gamma distribution of their distance from the nozzle: its scale, mm, and its shapes for droplets and for mist, which
/// needs longer to form.
const REACH: f32 = 12.0;
const DROPLET_SHAPE: u32 = 2;
const MIST_SHAPE: u32 = 3;

struct Nozzle {
    seed: u64,
    ends: [u64; 4],
    edge: f32,
    core: Lattice,
    surface: Surface,
    ligaments: Vec<Ligament>,
    droplets: Vec<Droplet>,
    /// Sites of a ball, in edges of the lattice, from the middle outward.
    ball: Vec<Vec3>,
}

/// Waves on the surface of the core: factor cos(turns theta + along z + phase).
struct Surface {
    phase: f32,
    noise: Vec<[f32; 4]>,
}

/// A tube about a polygon.
struct Ligament {
    points: [Vec3; PIECES + 1],
    radius: f32,
}

/// A ball of particles: its center, its turn, and the number of particles in the droplets before it.
struct Droplet {
    center: Vec3,
    turn: Quat,
    before: u64,
}

pub(super) fn plan(count: u64, seed: u64) -> Plan<'static> {
    let ends = ends(count, SHARES);
    let wanted = ends[0].max(1);
    let volume = f64::from(PI * CORE);
    let edge = largest((volume / wanted as f64).cbrt(), |edge| frame(edge).count(cylinder) >= wanted);
    let core = Lattice::new(frame(edge), cylinder);
    let edge = edge as f32;

    let mut stream = Stream::new(seed, TABLES);
    let surface = Surface::new(&mut stream);
    let each = (ends[1] - ends[0]) as f32 / LIGAMENTS as f32;
    let ligaments = (0..LIGAMENTS).map(|_| Ligament::new(&mut stream, each * edge.powi(3))).collect();
    let droplets = droplets(ends[2] - ends[1], edge, &mut stream);
    let law = Nozzle {
        seed,
        ends,
        edge,
        core,
        surface,
        ligaments,
        droplets,
        ball: ball(DROPLET.end as usize, SIMPLE),
    };
    Plan {
        law: Box::new(law),
        radii: Radii::Uniform(0.6 * edge),
        attributes: vec![Filled::real("speed"), Filled::real("age")],
        cell: None,
        length_unit: Some("mm"),
    }
}

fn frame(edge: f64) -> Frame {
    let across = (2.0 / edge).ceil() as usize;
    let corner = -0.5 * edge * across as f64;
    Frame { edge, corner: DVec3::new(corner, corner, 0.0), cells: [across; 2], basis: SIMPLE }
}

/// The core before its surface is given waves.
fn cylinder(x: f64, y: f64) -> Range<f64> {
    if x * x + y * y < 1.0 { 0.0..f64::from(CORE) } else { 0.0..0.0 }
}

/// Radius of the cone of the given slope about the mouth's rim.
fn cone(slope: f32, z: f32) -> f32 {
    1.0 + slope * z
}

/// A point in a cone at `z`, beside the core where that is near; a ball of radius `margin` about it is free.
fn place_in_cone(stream: &mut Stream, slope: f32, z: f32, margin: f32) -> Vec3 {
    let inner = if z < CORE + 1.0 + margin { CLEAR + margin } else { 0.0 };
    let outer = cone(slope, z).max(inner);
    let r = (inner * inner + (outer * outer - inner * inner) * stream.unit()).sqrt();
    let (sin, cos) = (TAU * stream.unit()).sin_cos();
    Vec3::new(r * cos, r * sin, z)
}

impl Surface {
    fn new(stream: &mut Stream) -> Self {
        let phase = TAU * stream.unit();
        let wave = |_| {
            let turns = stream.range(2.0, 24.0).floor();
            [0.06 / turns.sqrt() * stream.normal(), turns, stream.range(-8.0, 8.0), TAU * stream.unit()]
        };
        Self { phase, noise: (0..12).map(wave).collect() }
    }

    /// Distance of the surface from the axis; 1 at the mouth.
    fn radius(&self, theta: f32, z: f32) -> f32 {
        let noise = self
            .noise
            .iter()
            .map(|[factor, turns, along, phase]| factor * (turns * theta + along * z + phase).cos());
        let growth = (0.5 * z).min(1.0);
        1.0 + 0.02 * z * (6.0 * theta + 2.1 * z + self.phase).sin() + 0.5 * growth * noise.sum::<f32>()
    }
}

impl Ligament {
    /// A random walk outward and downstream from the core's surface or end, as long as `volume` lasts.
    fn new(stream: &mut Stream, volume: f32) -> Self {
        // Thin ones are more frequent.
        let radius = 0.05 + 0.15 * stream.unit().powi(2);
        let z = stream.range(6.0, 12.0);
        let (sin, cos) = (TAU * stream.unit()).sin_cos();
        let outward = Vec3::new(cos, sin, 0.0);
        let r = if z < CORE { 1.0 } else { cone(DROPLET_SLOPE, z - CORE) * stream.unit().sqrt() };
        let mut point = r * outward + Vec3::Z * z;
        let mut direction =
            (outward * stream.range(0.1, 1.0) + Vec3::Z + 0.5 * stream.normal3()).normalize_or(Vec3::Z);
        let piece = volume / (PI * radius * radius) / PIECES as f32;
        let points = std::array::from_fn(|_| {
            let here = point;
            point += piece * direction;
            // The walk forgets its direction over about 1 mm, whatever the length of the pieces.
            let bend = (2.0 * piece).sqrt().min(0.6) * stream.normal3();
            direction = (direction + 0.8 * bend).normalize_or(Vec3::Z);
            here
        });
        Self { points, radius }
    }

    /// The point at a share of the length and of the cross-section's area, at an angle, all in `[0, 1)`.
    fn point(&self, along: f32, area: f32, angle: f32) -> Vec3 {
        let place = along * PIECES as f32;
        let piece = (place as usize).min(PIECES - 1);
        let (start, end) = (self.points[piece], self.points[piece + 1]);
        let (u, v) = (end - start).normalize_or(Vec3::Z).any_orthonormal_pair();
        let (sin, cos) = (TAU * angle).sin_cos();
        // Rounded ends.
        let taper = (along.min(1.0 - along) * 12.0 + 0.15).min(1.0).sqrt();
        start.lerp(end, place - piece as f32) + self.radius * taper * area.sqrt() * (u * cos + v * sin)
    }
}

/// Droplets for `count` particles in all; the last one is cut to fit.
fn droplets(count: u64, edge: f32, stream: &mut Stream) -> Vec<Droplet> {
    let mut droplets = Vec::new();
    let mut before = 0;
    while before < count {
        let size = stream.power_law(DROPLET.start, DROPLET.end, DROPLET_EXPONENT);
        let radius = edge * (size as f32 * 0.75 / PI).cbrt();
        let z = radius + REACH * stream.gamma(DROPLET_SHAPE);
        let center = place_in_cone(stream, DROPLET_SLOPE, z, radius);
        droplets.push(Droplet { center, turn: stream.rotation(), before });
        before += size as u64;
    }
    droplets
}

impl Nozzle {
    fn position(&self, k: u64, stream: &mut Stream) -> Vec3 {
        let [core, ligaments, droplets, _] = self.ends;
        if k < core {
            let site = self.core.site_of(k, core).as_vec3() + 0.2 * self.edge * stream.cube();
            let stretch = self.surface.radius(site.y.atan2(site.x), site.z);
            Vec3::new(site.x * stretch, site.y * stretch, site.z.max(0.0))
        } else if k < ligaments {
            // Each has the same number of particles, up to one.
            let (place, count) = (u128::from(k - core), u128::from(ligaments - core));
            let ligament = (place * LIGAMENTS as u128 / count) as usize;
            let start = (ligament as u128 * count).div_ceil(LIGAMENTS as u128);
            let end = ((ligament as u128 + 1) * count).div_ceil(LIGAMENTS as u128);
            let along = ((place - start) as f32 + 0.5) / (end - start) as f32;
            let within = (place - start) as u64;
            let [area, angle, _] = even(within);
            self.ligaments[ligament].point(along, area, angle) + 0.1 * self.edge * stream.cube()
        } else if k < droplets {
            let place = k - ligaments;
            let droplet = &self.droplets[self.droplets.partition_point(|it| it.before <= place) - 1];
            let site = self.ball[(place - droplet.before) as usize] + 0.2 * stream.cube();
            droplet.center + self.edge * (droplet.turn * site)
        } else {
            let z = REACH * stream.gamma(MIST_SHAPE);
            place_in_cone(stream, MIST_SLOPE, z, 0.0)
        }
    }
}

impl Law for Nozzle {
    fn particle(&self, k: u64) -> Particle {
        let mut stream = Stream::new(self.seed, k);
        let position = self.position(k, &mut stream);
        let share = position.truncate().length() / cone(MIST_SLOPE, position.z.max(0.0));
        let speed = (1.0 - share * share + 0.05 * stream.normal()).max(0.0);
        // The oldest move slowest: a tenth of the axis' speed bounds the age of the mist.
        let age = position.length() / speed.max(0.1);
        Particle { position, values: [speed, age, 0.0] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::tests::{generated, neighbor_distances};

    #[test]
    fn parts_have_their_shares_and_places() {
        let count = 200_000;
        let cloud = generated("nozzle?n=200000&seed=6");
        let [core, ligaments, droplets, all] = ends(count, SHARES).map(|end| end as usize);
        assert_eq!(
            [core, ligaments - core, droplets - ligaments, all - droplets],
            [64_000, 38_000, 66_000, 32_000]
        );
        let position = |id: usize| cloud.positions().offset(id);
        let off_axis = |id: usize| position(id).truncate().length();
        for id in 0..core {
            assert!(off_axis(id) < 1.5 && (0.0..8.2).contains(&position(id).z), "core {id}");
        }
        for id in core..ligaments {
            assert!(position(id).z > 0.0 && position(id).z < 25.0, "ligament {id}: {}", position(id));
        }
        for id in ligaments..droplets {
            assert!(off_axis(id) < cone(DROPLET_SLOPE, position(id).z) + 3.0, "droplet {id}");
        }
        for id in droplets..all {
            assert!(off_axis(id) < cone(MIST_SLOPE, position(id).z) * 1.0001 + CLEAR - 1.0, "mist {id}");
        }
        let z: f64 = (droplets..all).map(|id| f64::from(position(id).z)).sum::<f64>() / 32_000.0;
        assert!((z - 36.0).abs() < 0.5, "mist is {z} mm away on average");
        let beside = |id: &usize| off_axis(*id) < 0.9 && position(*id).z < 7.9;
        let strangers = (core..all).filter(beside).count();
        assert!(strangers < 2000, "{strangers} other particles are inside the core");
    }

    #[test]
    fn particles_of_the_liquid_stand_as_on_a_lattice() {
        let cloud = generated("nozzle?n=60000&seed=8");
        let Some(Radii::Uniform(radius)) = cloud.radii() else { panic!("one radius") };
        let edge = radius / 0.6;
        let distances = neighbor_distances(&cloud, 4.0 * edge);
        let middle = distances[distances.len() / 2] / edge;
        assert!((0.6..1.05).contains(&middle), "{middle} edges");
    }

    #[test]
    fn speed_falls_from_the_axis_outward() {
        let cloud = generated("nozzle?n=20000&seed=9");
        let speed = cloud.attribute("speed").unwrap();
        for id in 0..cloud.len() {
            let position = cloud.positions().offset(id);
            let share = position.truncate().length() / cone(MIST_SLOPE, position.z);
            let wanted = f64::from(1.0 - share * share).max(0.0);
            assert!((speed.number(id, 0) - wanted).abs() < 0.3, "particle {id}");
        }
    }
}
