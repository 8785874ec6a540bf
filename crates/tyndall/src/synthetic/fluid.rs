//! `fluid` (m): water in a basin of 8 x 4 after a dam broke at x = 0: a body under waves, a breaking lip, ballistic spray.
//!
//! The body is a body-centered lattice with jitter. The radius is half the distance of its neighbors. Attributes: `speed`
//! (m/s), by Bernoulli's law from the highest level; `density` (kg/m^3), which grows with depth and falls off at the surface.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::lattice::{BODY_CENTERED, Frame, Lattice, even, largest};
use super::{Filled, Law, Particle, Plan, TABLES, ends};
use crate::particles::Radii;
use crate::random::Stream;

/// Shares of the body, the lip and the spray.
pub(super) const SHARES: [f64; 3] = [0.987, 0.010, 0.003];
/// Size of the basin, m.
const BASIN: [f64; 2] = [8.0, 4.0];
/// Lines of the table of heights along x and y.
const LINES: [usize; 2] = [801, 401];
const WAVES: usize = 64;
/// The water is nowhere shallower than this, m.
const SHALLOWEST: f64 = 0.06;
const GRAVITY: f32 = 9.81;
/// Where the lip leaves the surface, m, and the radius of its curl.
const LIP: f64 = 1.15;
const CURL: f32 = 0.2;

struct Fluid {
    seed: u64,
    ends: [u64; 3],
    body: Lattice,
    edge: f32,
    surface: Surface,
    phase: f32,
}

/// Heights of the water, tabulated; linear between the lines of the table.
struct Surface {
    heights: Vec<f32>,
    highest: f32,
}

pub(super) fn plan(count: u64, seed: u64) -> Plan<'static> {
    let ends = ends(count, SHARES);
    let mut stream = Stream::new(seed, TABLES);
    let surface = Surface::new(&mut stream);
    let phase = TAU as f32 * stream.unit();
    let wanted = ends[0].max(1);
    let span = |x: f64, y: f64| {
        let inside = x < BASIN[0] && y < BASIN[1];
        0.0..if inside { f64::from(surface.height(x as f32, y as f32)) } else { 0.0 }
    };
    let guess = (2.0 * surface.volume() / wanted as f64).cbrt();
    let edge = largest(guess, |edge| frame(edge).count(span) >= wanted);
    let body = Lattice::new(frame(edge), span);
    let radius = edge * 0.75f64.sqrt() * 0.5;
    let edge = edge as f32;
    Plan {
        law: Box::new(Fluid { seed, ends, body, edge, surface, phase }),
        radii: Radii::Uniform(radius as f32),
        attributes: vec![Filled::in_unit("speed", "m/s"), Filled::in_unit("density", "kg/m^3")],
        cell: None,
        length_unit: Some("m"),
    }
}

fn frame(edge: f64) -> Frame {
    let cells = BASIN.map(|size| (size / edge).ceil() as usize);
    Frame { edge, corner: DVec3::ZERO, cells, basis: BODY_CENTERED }
}

impl Surface {
    /// h(x, y) = 0.25 + 0.7 exp(-(x/1.6)^2) + the sum of 64 waves 0.4 k^-1.5 cos(k.x + phase), these scaled down until no
    /// point is too shallow.
    fn new(stream: &mut Stream) -> Self {
        let wave = |_| {
            let k = 1.5 * (40.0f64 / 1.5).powf(stream.unit_f64());
            let angle = TAU * stream.unit_f64();
            [0.4 * k.powf(-1.5), k * angle.cos(), k * angle.sin(), TAU * stream.unit_f64()]
        };
        let waves: Vec<[f64; 4]> = (0..WAVES).map(wave).collect();
        let point = |place: usize| {
            let [x, y] = [place / LINES[1], place % LINES[1]].map(|line| line as f64);
            (x * BASIN[0] / (LINES[0] - 1) as f64, y * BASIN[1] / (LINES[1] - 1) as f64)
        };
        let calm = |x: f64| 0.25 + 0.7 * (-(x / 1.6).powi(2)).exp();
        let rough: Vec<f64> = (0..LINES[0] * LINES[1])
            .into_par_iter()
            .map(|place| {
                let (x, y) = point(place);
                waves.iter().map(|[factor, kx, ky, phase]| factor * (kx * x + ky * y + phase).cos()).sum()
            })
            .collect();
        let allowed = |place: usize| (calm(point(place).0) - SHALLOWEST) / (-rough[place]).max(1e-9);
        let scale = (0..rough.len()).map(allowed).fold(1.0, f64::min);
        let heights: Vec<f32> = rough
            .iter()
            .enumerate()
            .map(|(place, rough)| (calm(point(place).0) + scale * rough) as f32)
            .collect();
        let highest = heights.iter().copied().fold(0.0, f32::max);
        Self { heights, highest }
    }

    /// Height of the water over a point of the basin, m; beyond the basin, as at its wall.
    fn height(&self, x: f32, y: f32) -> f32 {
        let line = |place: f32, size: f64, lines: usize| {
            let place = (place / size as f32 * (lines - 1) as f32).clamp(0.0, (lines - 1) as f32);
            let line = (place as usize).min(lines - 2);
            (line, place - line as f32)
        };
        let (i, u) = line(x, BASIN[0], LINES[0]);
        let (j, v) = line(y, BASIN[1], LINES[1]);
        let at = |i: usize, j: usize| self.heights[i * LINES[1] + j];
        let near = at(i, j) + v * (at(i, j + 1) - at(i, j));
        let far = at(i + 1, j) + v * (at(i + 1, j + 1) - at(i + 1, j));
        near + u * (far - near)
    }

    fn volume(&self) -> f64 {
        let mean = self.heights.iter().map(|&it| f64::from(it)).sum::<f64>() / self.heights.len() as f64;
        mean * BASIN[0] * BASIN[1]
    }
}

impl Fluid {
    /// A line across the sheet that curls forward over the surface, at `y`: its start, `share` of its length on.
    fn curl(&self, y: f32, share: f32) -> (Vec3, Vec3) {
        let x = LIP as f32 + 0.12 * (1.7 * y + self.phase).sin();
        let reach = 1.0 + 0.25 * (3.1 * y + 2.0 * self.phase).sin();
        let start = (PI / 180.0 * 150.0) as f32;
        let angle = start - share * reach * 2.4;
        let outward = |angle: f32| Vec3::new(angle.cos(), 0.0, angle.sin());
        let base = Vec3::new(x, y, self.surface.height(x, y));
        (base + CURL * (outward(angle) - outward(start)), outward(angle))
    }

    /// Even points in the sheet, thick at its foot and thin at its tip.
    fn lip(&self, k: u64, stream: &mut Stream) -> Vec3 {
        let [y, share, depth] = even(k);
        // The thickness falls from 0.085 to 0.03 m: the inverse of its integral gives even density.
        let (foot, tip) = (0.085f32, 0.03f32);
        let at = (foot - (foot * foot - share * (foot * foot - tip * tip)).sqrt()) / (foot - tip);
        let (point, outward) = self.curl(BASIN[1] as f32 * y, at);
        point + outward * (depth - 0.5) * (foot + (tip - foot) * at) + 0.1 * self.edge * stream.cube()
    }

    /// A drop on its way from the lip, or a little above the water if it has arrived already.
    fn spray(&self, stream: &mut Stream) -> Vec3 {
        let y = BASIN[1] as f32 * stream.unit();
        let (start, _) = self.curl(y, stream.range(0.3, 1.0));
        let start = start + 0.02 * stream.normal3();
        let velocity = Vec3::new(2.2, 0.0, 2.0) + Vec3::new(0.8, 0.45, 0.7) * stream.normal3();
        let time = 0.5 * stream.unit();
        let mut point = start + velocity * time - Vec3::Z * (0.5 * GRAVITY * time * time);
        point.x = point.x.clamp(0.0, BASIN[0] as f32);
        point.y = point.y.clamp(0.0, BASIN[1] as f32);
        let water = self.surface.height(point.x, point.y);
        point.z = point.z.max(water + self.edge * (0.5 + stream.unit()));
        point
    }
}

impl Law for Fluid {
    fn particle(&self, k: u64) -> Particle {
        let mut stream = Stream::new(self.seed, k);
        let [body, lip, _] = self.ends;
        let position = if k < body {
            self.body.site_of(k, body).as_vec3() + 0.15 * self.edge * stream.cube()
        } else if k < lip {
            self.lip(k - body, &mut stream)
        } else {
            self.spray(&mut stream)
        };
        let speed = (2.0 * GRAVITY * (self.surface.highest - position.z).max(0.0)).sqrt();
        let depth = if k < body { self.surface.height(position.x, position.y) - position.z } else { 0.0 };
        // Weakly compressible water: the speed of sound is ten times the highest speed of flow.
        let compression = depth.max(0.0) / (200.0 * self.surface.highest);
        let lack = 0.12 * (-depth.max(0.0) / (2.0 * self.edge)).exp();
        let density = 1000.0 * (1.0 + compression - lack + 0.003 * stream.normal());
        Particle { position, values: [speed, density, 0.0] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::tests::{generated, neighbor_distances};

    #[test]
    fn the_body_lies_under_the_surface_and_the_rest_in_the_basin() {
        let cloud = generated("fluid?n=100000&seed=6");
        let surface = Surface::new(&mut Stream::new(6, TABLES));
        let [body, lip, all] = ends(100_000, SHARES).map(|it| it as usize);
        assert_eq!([body, lip - body, all - lip], [98_700, 1_000, 300]);
        let edge = (2.0 * surface.volume() / 98_700.0).cbrt() as f32;
        for id in 0..all {
            let position = cloud.positions().offset(id);
            let height = surface.height(position.x, position.y);
            assert!(position.z > -0.01 && position.z < 2.5, "particle {id}: {position}");
            assert!(
                (-0.05..8.05).contains(&position.x) && (-0.05..4.05).contains(&position.y),
                "particle {id}"
            );
            assert!(id >= body || position.z < height + 0.5 * edge, "particle {id} of the body");
            assert!(id < lip || position.z > height, "particle {id} of the spray");
        }
        assert!(surface.heights.iter().all(|&it| it >= 0.9 * SHALLOWEST as f32));
    }

    #[test]
    fn neighbors_stand_as_in_a_crystal() {
        let cloud = generated("fluid?n=40000&seed=7");
        let Some(Radii::Uniform(radius)) = cloud.radii() else { panic!("one radius") };
        let distances = neighbor_distances(&cloud, 6.0 * radius);
        let middle = distances[distances.len() / 2] / radius;
        assert!((1.5..2.0).contains(&middle), "{middle} radii");
    }

    #[test]
    fn speed_follows_bernoulli() {
        let cloud = generated("fluid?n=10000&seed=8");
        let speed = cloud.attribute("speed").unwrap();
        let level =
            |id: usize| f64::from(cloud.positions().offset(id).z) + speed.number(id, 0).powi(2) / 2.0 / 9.81;
        for id in 0..9_000 {
            assert!((level(id) - level(0)).abs() < 1e-3, "particle {id}");
        }
    }
}
