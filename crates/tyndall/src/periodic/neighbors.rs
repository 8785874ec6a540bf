//! Pairs of particles that are near each other, also across the faces of a periodic cell.
//!
//! Particles are folded into the cell and sorted into bins, which are at least as thick as the longest distance: what is near lies in the
//! same bin or in one beside it, around the cell's faces where it repeats.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::lattice::Lattice;
use crate::particles::Particles;

/// At most so many bins along an edge, and in all two a particle.
const MOST_BINS: f64 = 1024.0;

/// The bins.
struct Bins<'a> {
    lattice: Option<&'a Lattice>,
    periodic: [bool; 3],
    counts: [i64; 3],
    /// By particle its place in the cell.
    places: Vec<DVec3>,
    /// By particle its bin along each edge.
    bins: Vec<[i64; 3]>,
    /// All particles, bin by bin, and where each bin begins.
    order: Vec<u32>,
    starts: Vec<u32>,
}

impl<'a> Bins<'a> {
    fn new(particles: &Particles, lattice: Option<&'a Lattice>, most: f64) -> Self {
        let ids = (0..particles.len()).into_par_iter().with_min_len(1 << 12);
        let places: Vec<DVec3> = ids
            .map(|id| {
                let place = particles.positions().world(id);
                lattice.map_or(place, |lattice| place - lattice.shift(lattice.image(place)))
            })
            .collect();
        let periodic = lattice.map_or([false; 3], Lattice::periodic);
        let fractions = lattice.map_or(DMat3::IDENTITY, Lattice::fractions);
        let along: Vec<DVec3> = places.par_iter().map(|place| fractions * *place).collect();
        let (low, high) = along
            .par_iter()
            .map(|it| (*it, *it))
            .reduce(|| (DVec3::INFINITY, DVec3::NEG_INFINITY), |a, b| (a.0.min(b.0), a.1.max(b.1)));
        // The whole cell where it repeats, else what the particles take; with a hair more, so that the last is inside.
        let corner = lattice.map_or(DVec3::ZERO, |lattice| fractions * lattice.origin());
        let [mut first, mut extent] = [low, (high - low).max(DVec3::splat(f64::MIN_POSITIVE))];
        for axis in (0..3).filter(|&axis| periodic[axis]) {
            (first[axis], extent[axis]) = (corner[axis], 1.0);
        }
        // Faces of the cell are as far apart as the rows of what counts edges are short.
        let rows = [0, 1, 2].map(|axis| fractions.row(axis).length());
        let thickness = extent / DVec3::from_array(rows);
        let mut counts = (thickness / most).floor().clamp(DVec3::ONE, DVec3::splat(MOST_BINS));
        while counts.x * counts.y * counts.z > (2 * particles.len() + 8) as f64 {
            counts = (0.75 * counts).floor().max(DVec3::ONE);
        }
        let bin = |at: &DVec3| -> [i64; 3] {
            let bin = ((*at - first) / extent * counts).floor();
            std::array::from_fn(|axis| (bin[axis] as i64).clamp(0, counts[axis] as i64 - 1))
        };
        let bins: Vec<[i64; 3]> = along.par_iter().map(bin).collect();
        let counts = counts.to_array().map(|count| count as i64);
        let number = |[x, y, z]: [i64; 3]| (x + counts[0] * (y + counts[1] * z)) as usize;
        let mut starts = vec![0_u32; counts.iter().product::<i64>() as usize + 1];
        for bin in &bins {
            starts[number(*bin) + 1] += 1;
        }
        for at in 1..starts.len() {
            starts[at] += starts[at - 1];
        }
        let mut ends = starts.clone();
        let mut order = vec![0_u32; bins.len()];
        for (id, bin) in bins.iter().enumerate() {
            let end = &mut ends[number(*bin)];
            order[*end as usize] = id as u32;
            *end += 1;
        }
        Self { lattice, periodic, counts, places, bins, order, starts }
    }

    /// Calls `visit` with the larger ids of particles in and around a particle's bin, and how near their images come to it.
    fn around(&self, id: u32, visit: &mut impl FnMut(u32, f64)) {
        let steps = |axis: usize| -> Vec<(i64, bool)> {
            let (at, count) = (self.bins[id as usize][axis], self.counts[axis]);
            let mut steps: Vec<(i64, bool)> = match self.periodic[axis] {
                // Around so few bins, every one is beside itself.
                true => (at - 1..=at + 1)
                    .map(|it| (it.rem_euclid(count), count < 3 || it != it.rem_euclid(count)))
                    .collect(),
                false => {
                    (at - 1..=at + 1).filter(|it| (0..count).contains(it)).map(|it| (it, false)).collect()
                }
            };
            steps.sort_unstable();
            steps.dedup();
            steps
        };
        let [xs, ys, zs] = [0, 1, 2].map(steps);
        let place = self.places[id as usize];
        for &(z, wraps_z) in &zs {
            for &(y, wraps_y) in &ys {
                for &(x, wraps_x) in &xs {
                    let bin = (x + self.counts[0] * (y + self.counts[1] * z)) as usize;
                    let members = &self.order[self.starts[bin] as usize..self.starts[bin + 1] as usize];
                    for &other in members.iter().filter(|&&other| other > id) {
                        let offset = self.places[other as usize] - place;
                        let nearest = match self.lattice.filter(|_| wraps_x || wraps_y || wraps_z) {
                            Some(lattice) => lattice.nearest(offset),
                            None => offset,
                        };
                        visit(other, nearest.length());
                    }
                }
            }
        }
    }
}

/// Pairs of particles whose images come at most as near as `reach` says of the two, which is at most `most`; none if that would be more
/// than `limit` pairs a particle, by a sample.
pub(crate) fn pairs(
    particles: &Particles,
    lattice: Option<&Lattice>,
    most: f64,
    limit: usize,
    reach: impl Fn(u32, u32) -> f64 + Sync,
) -> Option<Vec<[u32; 2]>> {
    if particles.is_empty() || most <= 0.0 {
        return Some(Vec::new());
    }
    let bins = Bins::new(particles, lattice, most);
    let count = particles.len() as u32;
    let sampled: Vec<u32> = (0..count).step_by((count as usize).div_ceil(1000)).collect();
    let count_of = |id: &u32| {
        let mut found = 0;
        bins.around(*id, &mut |other, distance| found += usize::from(distance <= reach(*id, other)));
        found
    };
    let found: usize = sampled.par_iter().map(count_of).sum();
    if found > limit * sampled.len() {
        return None;
    }
    let of = |id: u32| {
        let mut pairs = Vec::new();
        bins.around(id, &mut |other, distance| {
            if distance <= reach(id, other) {
                pairs.push([id, other]);
            }
        });
        pairs
    };
    Some((0..count).into_par_iter().with_min_len(256).flat_map_iter(of).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::particles::{Cell, Columns, Positions};
    use crate::random::Stream;

    #[test]
    fn pairs_are_those_of_a_search_over_all() {
        let skewed = [DVec3::new(9.0, 0.0, 0.0), DVec3::new(5.0, 8.0, 0.0), DVec3::new(-4.0, 3.0, 7.0)];
        let thin = [DVec3::new(2.5, 0.0, 0.0), DVec3::new(0.0, 20.0, 0.0), DVec3::new(0.0, 0.0, 4.0)];
        let mut crossed = 0;
        for seed in 0..40 {
            let mut stream = Stream::new(70, seed);
            let periodic = [[true; 3], [true, false, true], [false, true, false]][seed as usize % 3];
            let vectors = if seed % 2 == 0 { skewed } else { thin };
            let cell = Cell { origin: DVec3::new(1.0, -2.0, 0.5), vectors, periodic };
            let cell = (seed % 5 != 4).then_some(cell);
            let count = [0, 1, 2, 60, 200][(seed / 2) as usize % 5];
            let places: Vec<DVec3> = (0..count).map(|_| 12.0 * stream.cube().as_dvec3()).collect();
            let mut positions = Positions::around(DVec3::ZERO);
            positions.extend(&places);
            let particles = Particles::new(Columns { positions, cell, ..Columns::default() }).unwrap();
            let lattice = particles.cell().map(|cell| Lattice::new(cell, "", "").unwrap());
            let reach = |a: u32, b: u32| if (a + b).is_multiple_of(3) { 1.0 } else { 1.9 };
            let mut found = pairs(&particles, lattice.as_ref(), 1.9, 1000, reach).unwrap();
            found.sort_unstable();
            let mut wanted = Vec::new();
            for a in 0..count {
                for b in a + 1..count {
                    let [from, to] = [a, b].map(|id| particles.positions().world(id as usize));
                    let nearest = lattice.as_ref().map_or(to - from, |it| it.nearest(to - from));
                    if nearest.length() <= reach(a, b) {
                        wanted.push([a, b]);
                        crossed += u32::from((to - from).length() > 1.9);
                    }
                }
            }
            assert_eq!(found, wanted, "seed {seed}");
            if wanted.len() > 50 {
                assert!(pairs(&particles, lattice.as_ref(), 1.9, 0, reach).is_none(), "too many are refused");
            }
        }
        assert!(crossed > 100, "only {crossed} pairs across faces");
    }
}
