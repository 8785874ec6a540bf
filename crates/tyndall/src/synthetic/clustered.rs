//! `clustered`: points about five nested levels of centers, and a background of 15 %, in the periodic unit cube.
//!
//! Source: R. Soneira, P. J. E. Peebles, Astron. J. 83, 1978, for the nested levels. Every particle draws its own center,
//! so the order is random already. The radius is 4e-4 at every count.

use glam::{DVec3, Vec3};

use super::{Law, Particle, Plan, TABLES, cell};
use crate::particles::Radii;
use crate::random::Stream;

/// Centers of the first level, and children a center has on average on each of the four levels below.
const CENTERS: usize = 24;
const CHILDREN: usize = 6;
/// Spread of the children about the centers of the first level, and its factor from level to level.
const SPREAD: f32 = 0.09;
const SHRINK: f32 = 0.45;
/// Share of particles that belong to no center.
const BACKGROUND: f32 = 0.15;

struct Clustered {
    seed: u64,
    centers: Vec<Vec3>,
    spread: f32,
}

pub(super) fn plan(seed: u64) -> Plan<'static> {
    let mut stream = Stream::new(seed, TABLES);
    let mut centers: Vec<Vec3> = (0..CENTERS).map(|_| 0.5 * stream.cube() + 0.5).collect();
    let mut spread = SPREAD;
    for _ in 0..4 {
        let child = |_| centers[stream.below(centers.len())] + spread * stream.normal3();
        centers = (0..CHILDREN * centers.len()).map(child).collect();
        spread *= SHRINK;
    }
    Plan {
        law: Box::new(Clustered { seed, centers, spread: 0.8 * spread }),
        radii: Radii::Uniform(4e-4),
        attributes: Vec::new(),
        cell: Some(cell(DVec3::ONE, [true; 3])),
        length_unit: None,
    }
}

impl Law for Clustered {
    fn particle(&self, k: u64) -> Particle {
        let mut stream = Stream::new(self.seed, k);
        let position = if stream.unit() < BACKGROUND {
            Vec3::new(stream.unit(), stream.unit(), stream.unit())
        } else {
            let center = self.centers[stream.below(self.centers.len())];
            let scale = self.spread * stream.unit().powi(2);
            wrapped(center + scale * stream.normal3())
        };
        Particle { position, ..Particle::default() }
    }
}

/// The point's copy in the unit cube. A tiny negative number less its floor rounds to 1, which is 0.
fn wrapped(point: Vec3) -> Vec3 {
    let inside = point - point.floor();
    Vec3::select(inside.cmplt(Vec3::ONE), inside, Vec3::ZERO)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::tests::generated;

    #[test]
    fn most_particles_crowd_into_few_cells() {
        let cloud = generated("clustered?n=100000&seed=4");
        let mut cells = vec![0u32; 32 * 32 * 32];
        for id in 0..cloud.len() {
            let place = (32.0 * cloud.positions().offset(id)).floor().as_uvec3();
            cells[((place.x * 32 + place.y) * 32 + place.z) as usize] += 1;
        }
        cells.sort_unstable_by(|a, b| b.cmp(a));
        let crowded: u32 = cells[..cells.len() / 20].iter().sum();
        assert!(crowded > 40_000, "the fullest 5 % of the cells hold {crowded} of 100000");
        let empty = cells.iter().filter(|&&it| it == 0).count();
        assert!(empty > 8_000, "{empty} of 32768 cells are empty");
    }

    #[test]
    fn wrapping_ends_inside_the_cube() {
        assert_eq!(wrapped(Vec3::new(-1e-12, 1.25, -0.25)), Vec3::new(0.0, 0.25, 0.75));
    }
}
