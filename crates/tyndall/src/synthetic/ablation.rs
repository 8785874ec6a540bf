//! `ablation` (Lennard-Jones units): a crystal hit by a laser: a crater with a rim, drops and vapor above it.
//!
//! The block is a face-centered lattice, whole cells along x and y, where it is periodic. Its width is six times its
//! height. The radius is 0.52. Attributes: `potential energy` of an atom, about -6 in the crystal and 0 in vapor; `speed`.

use std::f64::consts::TAU;
use std::ops::Range;

use glam::{DVec3, Quat, Vec3};

use super::lattice::{FACE_CENTERED, Frame, Lattice, ball, largest};
use super::{Filled, Law, Particle, Plan, TABLES, cell, ends};
use crate::particles::Radii;
use crate::random::Stream;

/// Shares of the block, the drops and the vapor.
pub(super) const SHARES: [f64; 3] = [0.85, 0.12, 0.03];
/// Edge of a cell of the crystal.
const EDGE: f64 = 1.577;
const RADIUS: f32 = 0.52;
/// Width of the block over its height.
const ASPECT: f64 = 6.0;
/// Depth of the crater and height of its rim, in heights of the block; its width, in widths.
const CRATER: f64 = 0.6;
const RIM: f64 = 0.18;
const CRATER_WIDTH: f64 = 0.16;
/// Atoms of a drop; their number falls with its square.
const DROP: Range<f64> = 10.0..50_000.0;

struct Ablation {
    seed: u64,
    ends: [u64; 3],
    block: Lattice,
    surface: Surface,
    drops: Vec<Drop>,
    /// Sites of a ball of density 1, from the middle outward.
    ball: Vec<Vec3>,
}

/// The block's upper side.
#[derive(Clone)]
struct Surface {
    height: f64,
    width: f64,
    /// Ripples: factor, waves along x and y, phase.
    ripples: [[f64; 4]; 8],
}

/// A ball of atoms: its center, turn and size, and the number of atoms in the drops before it.
struct Drop {
    center: Vec3,
    turn: Quat,
    radius: f32,
    before: u64,
}

pub(super) fn plan(count: u64, seed: u64) -> Plan<'static> {
    let ends = ends(count, SHARES);
    let mut stream = Stream::new(seed, TABLES);
    let wanted = ends[0].max(1);
    let volume = wanted as f64 * EDGE.powi(3) / 4.0;
    let cells = ((volume * ASPECT).cbrt() / EDGE).round().max(1.0) as usize;
    let width = cells as f64 * EDGE;
    let ripples = std::array::from_fn(|_| {
        let mut waves = || (1 + stream.below(12)) as f64 * if stream.unit() < 0.5 { -1.0 } else { 1.0 };
        let [x, y] = [waves(), waves()];
        [0.35 * EDGE * f64::from(stream.normal()), x, y, TAU * stream.unit_f64()]
    });
    let surface = |height: f64| Surface { height, width, ripples };
    let frame = Frame { edge: EDGE, corner: DVec3::ZERO, cells: [cells; 2], basis: FACE_CENTERED };
    // The smallest height that holds enough: the largest 1 / height that does.
    let holds = |inverse: f64| {
        let surface = surface(1.0 / inverse);
        frame.count(|x, y| 0.0..surface.height(x, y)) >= wanted
    };
    let surface = surface(1.0 / largest(width * width / volume, holds));
    let block = Lattice::new(frame, |x, y| 0.0..surface.height(x, y));
    let drops = drops(ends[1] - ends[0], &surface, &mut stream);
    let box_height = surface.height + 6.0 * surface.plume();
    let law = Ablation { seed, ends, block, surface, drops, ball: ball(DROP.end as usize, FACE_CENTERED) };
    Plan {
        law: Box::new(law),
        radii: Radii::Uniform(RADIUS),
        attributes: vec![Filled::real("potential energy"), Filled::real("speed")],
        cell: Some(cell(DVec3::new(width, width, box_height), [true, true, false])),
        length_unit: Some("sigma"),
    }
}

impl Surface {
    /// z = H - D exp(-(r/w)^2), a rim of the crater, and ripples.
    fn height(&self, x: f64, y: f64) -> f64 {
        let [x, y] = [x / self.width, y / self.width];
        let r_sq = ((x - 0.5).powi(2) + (y - 0.5).powi(2)) / CRATER_WIDTH.powi(2);
        let rim = RIM * (-((r_sq.sqrt() - 1.6) / 0.35).powi(2)).exp();
        let wave = |[factor, kx, ky, phase]: &[f64; 4]| factor * (TAU * (kx * x + ky * y) + phase).sin();
        // A block of few layers has flat ripples, and one of height 0 no atoms.
        let steepness = (0.25 * self.height / EDGE).min(1.0);
        let ripples = steepness * self.ripples.iter().map(wave).sum::<f64>();
        (self.height * (1.0 + rim - CRATER * (-r_sq).exp()) + ripples).max(0.0)
    }

    /// Mean height of the plume over the surface.
    fn plume(&self) -> f64 {
        0.3 * self.width
    }

    /// A point of the plume, at least `margin` over the surface: `spread` times its width from its axis.
    fn over(&self, spread: f32, margin: f32, stream: &mut Stream) -> Vec3 {
        let rise = self.plume() as f32 * stream.gamma(1);
        // The plume widens as it rises.
        let width = self.width as f32;
        let across = spread * (0.5 * CRATER_WIDTH as f32 * width + 0.25 * rise);
        let [x, y] = stream.normals().map(|it| (0.5 * width + across * it).rem_euclid(width));
        let highest = (self.height * (1.0 + RIM)) as f32;
        let floor = self.height(f64::from(x), f64::from(y)) as f32;
        // A wide drop must clear the slopes around it too.
        let floor = if margin > 3.0 { highest.max(floor) } else { floor };
        Vec3::new(x, y, floor + margin + rise)
    }
}

/// Drops for `count` atoms in all; the last one is cut to fit.
fn drops(count: u64, surface: &Surface, stream: &mut Stream) -> Vec<Drop> {
    let mut drops = Vec::new();
    let mut before = 0;
    while before < count {
        let size = stream.power_law(DROP.start, DROP.end, 2.0).floor();
        let radius = (size * EDGE.powi(3) / 4.0 * 0.75 / std::f64::consts::PI).cbrt() as f32;
        let center = surface.over(1.0, radius + 1.0, stream);
        drops.push(Drop { center, turn: stream.rotation(), radius, before });
        before += size as u64;
    }
    drops
}

impl Ablation {
    /// An atom of the block; `thermal` is its velocity at temperature 1.
    fn block_atom(&self, k: u64, thermal: Vec3, stream: &mut Stream) -> Particle {
        let site = self.block.site_of(k, self.ends[0]);
        let depth = (self.surface.height(site.x, site.y) - site.z) as f32;
        let heat = (-depth / (0.2 * self.surface.height as f32)).exp();
        let jitter = 0.04 + 0.16 * heat;
        let position = site.as_vec3() + jitter * stream.normal3();
        let energy = -6.6 + 2.2 * (-depth / 1.2).exp() + 1.2 * heat + (0.1 + jitter) * stream.normal();
        let speed = thermal.length() * (0.15 + 0.55 * heat).sqrt();
        Particle { position: self.wrapped(position), values: [energy, speed, 0.0] }
    }

    fn drop_atom(&self, place: u64, thermal: Vec3, stream: &mut Stream) -> Particle {
        let drop = &self.drops[self.drops.partition_point(|it| it.before <= place) - 1];
        let edge = (EDGE / 4.0f64.cbrt()) as f32;
        let site = edge * self.ball[(place - drop.before) as usize];
        let position = drop.center + drop.turn * site + 0.12 * stream.normal3();
        let depth = (drop.radius - site.length()).max(0.0);
        let energy = -5.4 + 2.4 * (-depth / 0.9).exp() + 0.3 * stream.normal();
        let speed = (self.flow(drop.center) + 0.8 * thermal).length();
        Particle { position: self.wrapped(position), values: [energy, speed, 0.0] }
    }

    fn vapor_atom(&self, thermal: Vec3, stream: &mut Stream) -> Particle {
        let position = self.surface.over(1.6, 1.0, stream);
        let energy = -0.4 * stream.unit().powi(2);
        let speed = (self.flow(position) + 1.1 * thermal).length();
        Particle { position, values: [energy, speed, 0.0] }
    }

    /// Velocity of the plume: the higher, the faster.
    fn flow(&self, position: Vec3) -> Vec3 {
        let rise = (position.z - self.surface.height as f32) / self.surface.plume() as f32;
        Vec3::Z * (1.0 + 1.5 * rise.max(0.0))
    }

    /// The copy of a position in the cell, which repeats along x and y.
    fn wrapped(&self, position: Vec3) -> Vec3 {
        let width = self.surface.width as f32;
        Vec3::new(position.x.rem_euclid(width), position.y.rem_euclid(width), position.z)
    }
}

impl Law for Ablation {
    fn particle(&self, k: u64) -> Particle {
        let mut stream = Stream::new(self.seed, k);
        let thermal = stream.normal3();
        let [block, drops, _] = self.ends;
        if k < block {
            self.block_atom(k, thermal, &mut stream)
        } else if k < drops {
            self.drop_atom(k - block, thermal, &mut stream)
        } else {
            self.vapor_atom(thermal, &mut stream)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::tests::{generated, neighbor_distances};

    #[test]
    fn the_parts_have_their_shares_and_places() {
        let cloud = generated("ablation?n=200000&seed=6");
        let [block, drops, all] = ends(200_000, SHARES).map(|it| it as usize);
        assert_eq!([block, drops - block, all - drops], [170_000, 24_000, 6_000]);
        let cell = cloud.cell().unwrap();
        assert_eq!(cell.periodic, [true, true, false]);
        let width = cell.vectors[0].x as f32;
        let height = width / ASPECT as f32;
        let energy = cloud.attribute("potential energy").unwrap();
        for id in 0..all {
            let position = cloud.positions().offset(id);
            assert!((0.0..=width).contains(&position.x) && (0.0..=width).contains(&position.y), "{id}");
            assert!(
                position.z > -1.0 && (id >= block || position.z < 1.5 * height + 2.0),
                "{id}: {position}"
            );
            assert!(id < drops || energy.number(id, 0) > -0.5);
        }
        let vapor = (drops..all).filter(|&id| cloud.positions().offset(id).z > height).count();
        assert!(vapor > 4_000, "{vapor} atoms of vapor over the block");
    }

    #[test]
    fn neighbors_stand_as_in_the_crystal_across_the_seam_too() {
        let cloud = generated("ablation?n=30000&seed=7");
        let distances = neighbor_distances(&cloud, 3.0);
        let middle = f64::from(distances[distances.len() / 2]);
        // Neighbors in the crystal are 1.115 apart.
        assert!((0.8..1.1).contains(&middle), "{middle}");
        let plan = super::plan(30_000, 7);
        let width = plan.cell.unwrap().vectors[0].x;
        assert!((width / EDGE - (width / EDGE).round()).abs() < 1e-9);
    }
}
