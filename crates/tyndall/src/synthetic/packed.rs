//! `packed`: a face-centered crystal fills the unit cube but for a ball about its corner (1, 1, 1), with thermal noise.
//!
//! Particles come in the order of the lattice. Surplus sites are dropped on the face x = 0, far from the hole. The radius is
//! half the distance of neighbors, so that the spheres touch.

use std::ops::Range;

use glam::DVec3;

use super::lattice::{FACE_CENTERED, Frame, Lattice};
use super::{Law, Particle, Plan, cell};
use crate::particles::Radii;
use crate::random::Stream;

/// Radius of the hole, in edges of the cube.
const HOLE: f64 = 0.45;
/// Standard deviation of the noise, in distances of neighbors, along each axis.
const NOISE: f64 = 0.04;

struct Packed {
    seed: u64,
    lattice: Lattice,
    surplus: u64,
    noise: f32,
}

pub(super) fn plan(count: u64, seed: u64) -> Plan<'static> {
    let hole = std::f64::consts::PI / 6.0 * HOLE.powi(3);
    let mut cells = ((count as f64 / 4.0 / (1.0 - hole)).cbrt().ceil() as usize).max(1);
    while frame(cells).count(span) < count {
        cells += 1;
    }
    let lattice = Lattice::new(frame(cells), span);
    let neighbors = 0.5f64.sqrt() / cells as f64;
    let surplus = lattice.total() - count;
    Plan {
        law: Box::new(Packed { seed, lattice, surplus, noise: (NOISE * neighbors) as f32 }),
        radii: Radii::Uniform((0.5 * neighbors) as f32),
        attributes: Vec::new(),
        cell: Some(cell(DVec3::ONE, [false; 3])),
        length_unit: None,
    }
}

fn frame(cells: usize) -> Frame {
    Frame { edge: 1.0 / cells as f64, corner: DVec3::ZERO, cells: [cells; 2], basis: FACE_CENTERED }
}

/// Heights below the hole.
fn span(x: f64, y: f64) -> Range<f64> {
    let off_axis_sq = (1.0 - x).powi(2) + (1.0 - y).powi(2);
    0.0..1.0 - (HOLE * HOLE - off_axis_sq).max(0.0).sqrt()
}

impl Packed {
    fn at(&self, k: u64, site: DVec3) -> Particle {
        let noise = self.noise * Stream::new(self.seed, k).normal3();
        Particle { position: site.as_vec3() + noise, ..Particle::default() }
    }
}

impl Law for Packed {
    fn particle(&self, k: u64) -> Particle {
        self.at(k, self.lattice.site(k + self.surplus))
    }

    fn run(&self, range: Range<u64>, take: &mut dyn FnMut(Particle)) {
        let sites = self.lattice.sites(range.start + self.surplus..range.end + self.surplus);
        range.zip(sites).for_each(|(k, site)| take(self.at(k, site)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::tests::{generated, neighbor_distances};
    use glam::Vec3;

    #[test]
    fn spheres_nearly_touch_and_the_corner_is_empty() {
        let cloud = generated("packed?n=50000&seed=5");
        let Some(Radii::Uniform(radius)) = cloud.radii() else { panic!("one radius") };
        let distances = neighbor_distances(&cloud, 4.0 * radius);
        let middle = distances[distances.len() / 2];
        // The nearest of twelve noisy neighbors stands a little nearer than they do without noise.
        assert!((1.7..2.0).contains(&(middle / radius)), "{} radii", middle / radius);
        for id in 0..cloud.len() {
            let position = cloud.positions().offset(id);
            assert!(position.distance(Vec3::ONE) > 0.44 && position.min_element() > 0.0, "particle {id}");
            assert!(position.max_element() < 1.0, "particle {id}");
        }
    }

    #[test]
    fn the_surplus_is_dropped_on_the_far_face() {
        let plan = super::plan(50_000, 5);
        let first = plan.law.particle(0).position.x;
        let last = plan.law.particle(49_999).position.x;
        assert!(first < last && last > 0.95);
    }
}
