//! How far the particles are from each other: the median distance to the nearest neighbor.
//!
//! Exact for a sample of the particles, the queries, over all particles, without a structure over all of them. Each query keeps
//! the distance to the nearest one seen, first among the queries, then in a sample, then among all. A hash of the cells that the
//! queries' balls of that radius touch tells each particle which queries it can be nearer to. Cells are as large as the balls,
//! to a power of two, so that clustered clouds need some more sizes of cells, but no more time a cell. A point lies in few such
//! balls (Miller, Teng, Thurston and Vavasis, J. ACM 44, 1 (1997), section 2.1), so the work grows with the count only.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::DVec3;
use rayon::prelude::*;

use super::statistics::{quantiles, sampled_ids};
use crate::particles::Positions;

/// Particles whose nearest neighbor is looked for.
pub(crate) const QUERIES: usize = 10_000;
/// One particle of so many shrinks the queries' balls in each round; the last one looks at all.
const ROUNDS: [usize; 3] = [64, 8, 1];
/// Bits of the filter, which says of most cells that no ball touches them: a power of two, small enough for a core's cache.
const SLOTS: usize = 1 << 20;
/// Buckets of the hash, each of some slots.
const BUCKETS: usize = 1 << 18;
/// Bits of a fixed-point coordinate, on either side of zero.
const FIXED_BITS: u32 = 46;
/// What makes fixed-point coordinates positive.
const OFFSET: f64 = (1u64 << FIXED_BITS) as f64;

/// The median distance to the nearest neighbor that is not at the same place; `None` if there is none. Uses at most
/// [`QUERIES`] particles, the same at every run.
pub(crate) fn median_spacing(positions: &Positions) -> Option<f64> {
    let place = |id: usize| positions.offset(id).as_dvec3();
    let ids = sampled_ids(positions.len(), QUERIES);
    let mut places: Vec<DVec3> = ids.map(place).collect();

    // Particles at one place are one query, which counts as often: else each of them would look at all the others.
    let key = |it: &DVec3| (it.x, it.y, it.z);
    places.par_sort_unstable_by(|a, b| key(a).partial_cmp(&key(b)).expect("positions are finite"));
    let mut queries: Vec<(DVec3, usize)> = Vec::new();
    for place in places {
        match queries.last_mut() {
            Some((last, count)) if *last == place => *count += 1,
            _ => queries.push((place, 1)),
        }
    }

    let points: Vec<DVec3> = queries.iter().map(|(point, _)| *point).collect();
    let mut nearest_sq = nearest_among(&points);
    if points.len() == 1 {
        // A ball around everything, so that the search below finds whatever there is.
        let farthest = |id: usize| place(id).distance_squared(points[0]);
        let farthest_sq = (0..positions.len()).into_par_iter().map(farthest).reduce(|| 0.0, f64::max);
        nearest_sq[0] = if farthest_sq > 0.0 { farthest_sq } else { return None };
    }
    if positions.len() > QUERIES {
        for part in ROUNDS {
            nearest_sq = nearer_by(positions, positions.len().div_ceil(part), &points, nearest_sq);
        }
    }

    let counted =
        queries.iter().zip(&nearest_sq).flat_map(|((_, count), sq)| std::iter::repeat_n(sq.sqrt(), *count));
    let mut distances: Vec<f64> = counted.filter(|distance| distance.is_finite()).collect();
    quantiles(&mut distances, [0.5]).map(|[median]| median)
}

/// For each point the squared distance to the nearest other; infinity if there is none. Points are distinct and sorted by x.
fn nearest_among(points: &[DVec3]) -> Vec<f64> {
    let nearest = |place: usize| {
        let point = points[place];
        let mut best = f64::INFINITY;
        // Outward from the point in both directions until x alone is too far.
        let mut visit = |other: &DVec3| {
            best = best.min(point.distance_squared(*other));
            (other.x - point.x).powi(2) < best
        };
        points[..place].iter().rev().all(&mut visit);
        points[place + 1..].iter().all(&mut visit);
        best
    };
    (0..points.len()).into_par_iter().map(nearest).collect()
}

/// Lowers each squared distance to that of the nearest of `limit` sampled particles at another place.
fn nearer_by(positions: &Positions, limit: usize, points: &[DVec3], nearest_sq: Vec<f64>) -> Vec<f64> {
    let balls = Balls::new(points, &nearest_sq);
    // Positive floats are ordered like their bits, so the least can be kept without a lock, in any order.
    let shared: Vec<AtomicU64> = nearest_sq.into_iter().map(|sq| AtomicU64::new(sq.to_bits())).collect();
    sampled_ids(positions.len(), limit).for_each(|id| {
        let place = positions.offset(id).as_dvec3();
        balls.each_query_near(place, |query| {
            let bits = points[query].distance_squared(place).to_bits();
            if bits > 0 && bits < shared[query].load(Ordering::Relaxed) {
                shared[query].fetch_min(bits, Ordering::Relaxed);
            }
        });
    });
    shared.into_iter().map(|bits| f64::from_bits(bits.into_inner())).collect()
}

/// Which balls touch the cell of a point.
struct Balls {
    /// Fixed-point units a length: a cell of size `s` has `2^s` units along an edge.
    scale: f64,
    /// The sizes of cells in use.
    sizes: Vec<u32>,
    /// One bit a slot: whether it has queries.
    filter: Vec<u64>,
    /// The queries of bucket `b` are `queries[starts[b]..starts[b + 1]]`. Cells that share a bucket only cost time.
    starts: Vec<u32>,
    queries: Vec<u32>,
}

impl Balls {
    fn new(points: &[DVec3], radii_sq: &[f64]) -> Self {
        // A ball's cells are as large as its radius, or up to twice that; all fit the fixed-point numbers with their distance.
        let reach = |query: usize| points[query].abs().max_element() + radii_sq[query].sqrt();
        let farthest = (0..points.len()).map(reach).fold(f64::MIN_POSITIVE, f64::max).log2().ceil() as i32;
        let size_of = |sq: f64| (sq.sqrt().log2().ceil() as i32).max(farthest - FIXED_BITS as i32 + 1);
        let mut by_size: BTreeMap<i32, Vec<usize>> = BTreeMap::new();
        for (query, sq) in radii_sq.iter().enumerate() {
            by_size.entry(size_of(*sq)).or_default().push(query);
        }
        let smallest = by_size.keys().next().copied().unwrap_or(0);
        let by_size = with_few_sizes(by_size);

        let scale = (-smallest as f64).exp2();
        let mut entries: Vec<(u32, u32)> = Vec::new();
        for (&size, queries) in &by_size {
            let size = (size - smallest) as u32;
            let inv_edge = (-(size as f64)).exp2();
            for &query in queries {
                let (point, radius) = (points[query], radii_sq[query].sqrt() * (1.0 + 1e-12));
                let low = fixed(point - radius, scale).map(|it| it >> size);
                let high = fixed(point + radius, scale).map(|it| it >> size);
                // In cells; the slack covers the rounding of fixed-point numbers.
                let (center, reach) = ((point * scale + OFFSET) * inv_edge, radius * scale * inv_edge + 0.05);
                for x in low[0]..=high[0] {
                    for y in low[1]..=high[1] {
                        for z in low[2]..=high[2] {
                            let corner = DVec3::new(x as f64, y as f64, z as f64);
                            let gap = (corner - center).max(center - corner - 1.0).max(DVec3::ZERO);
                            if gap.length_squared() <= reach * reach {
                                entries.push((slot(size, [x, y, z]), query as u32));
                            }
                        }
                    }
                }
            }
        }

        let bucket = |slot: u32| slot / (SLOTS / BUCKETS) as u32;
        entries.sort_unstable();
        let mut filter = vec![0; SLOTS / 64];
        let mut starts = vec![0; BUCKETS + 1];
        for &(slot, _) in &entries {
            filter[slot as usize / 64] |= 1 << (slot % 64);
            starts[bucket(slot) as usize + 1] += 1;
        }
        for bucket in 0..BUCKETS {
            starts[bucket + 1] += starts[bucket];
        }
        let sizes = by_size.keys().map(|size| (size - smallest) as u32).collect();
        Self { scale, sizes, filter, starts, queries: entries.into_iter().map(|(_, query)| query).collect() }
    }

    /// Calls `visit` with every query whose ball holds `place`, and a few more.
    #[inline]
    fn each_query_near(&self, place: DVec3, mut visit: impl FnMut(usize)) {
        let units = fixed(place, self.scale);
        for &size in &self.sizes {
            let slot = slot(size, units.map(|it| it >> size)) as usize;
            if self.filter[slot / 64] >> (slot % 64) & 1 == 1 {
                let bucket = slot / (SLOTS / BUCKETS);
                let (start, end) = (self.starts[bucket] as usize, self.starts[bucket + 1] as usize);
                self.queries[start..end].iter().for_each(|&query| visit(query as usize));
            }
        }
    }
}

/// Puts the balls of a size that few have into cells of twice that size: to look there anyway costs less than one size more.
fn with_few_sizes(mut by_size: BTreeMap<i32, Vec<usize>>) -> BTreeMap<i32, Vec<usize>> {
    let sizes: Vec<i32> = by_size.keys().copied().collect();
    for size in sizes {
        // Eight times the volume: as many visits as the larger ones make already.
        let (few, larger) = (by_size[&size].len(), by_size.get(&(size + 1)).map_or(0, Vec::len));
        if 8 * few <= larger {
            let moved = by_size.remove(&size).unwrap_or_default();
            by_size.entry(size + 1).or_default().extend(moved);
        }
    }
    by_size
}

/// The fixed-point units of a place, all positive for what lies in a ball. Monotonic, so that a ball's cells hold its points.
#[inline]
fn fixed(place: DVec3, scale: f64) -> [u64; 3] {
    (place * scale + OFFSET).to_array().map(|units| units as i64 as u64)
}

/// The slot of a cell in the filter.
#[inline]
fn slot(size: u32, [x, y, z]: [u64; 3]) -> u32 {
    let mixed = x.wrapping_mul(0x9e37_79b9_7f4a_7c15)
        ^ y.wrapping_mul(0xc2b2_ae3d_27d4_eb4f).rotate_left(21)
        ^ z.wrapping_add(size as u64).wrapping_mul(0x1656_67b1_9e37_79f9).rotate_left(42);
    ((mixed ^ mixed >> 32).wrapping_mul(0x94d0_49bb_1331_11eb) >> (64 - SLOTS.ilog2())) as u32
}

#[cfg(test)]
mod tests {
    use super::super::statistics::scrambled;
    use super::*;

    fn uniform(key: usize) -> f64 {
        scrambled(key as u64) as f64 / u64::MAX as f64
    }

    fn point(key: usize) -> DVec3 {
        DVec3::new(uniform(3 * key), uniform(3 * key + 1), uniform(3 * key + 2))
    }

    fn positions(count: usize, place: impl Fn(usize) -> DVec3) -> Positions {
        let mut positions = Positions::around(DVec3::ZERO);
        (0..count).map(place).collect::<Vec<_>>().chunks(1 << 12).for_each(|chunk| positions.extend(chunk));
        positions
    }

    /// The nearest neighbor of the same queries by trying every particle.
    fn slow(positions: &Positions) -> Option<f64> {
        let place = |id: usize| positions.offset(id).as_dvec3();
        let nearest = |query: usize| {
            let others = (0..positions.len()).map(|id| place(id).distance_squared(place(query)));
            others.filter(|sq| *sq > 0.0).fold(f64::INFINITY, f64::min).sqrt()
        };
        let mut all: Vec<f64> =
            sampled_ids(positions.len(), QUERIES).with_max_len(100).map(nearest).collect();
        all.retain(|distance| distance.is_finite());
        quantiles(&mut all, [0.5]).map(|[median]| median)
    }

    /// Clusters of very different density, and some particles far away.
    fn clustered(key: usize) -> DVec3 {
        let size = 10f64.powi(-((key % 7) as i32));
        DVec3::splat((key % 7) as f64)
            + size * point(key)
            + if key.is_multiple_of(997) { 1e4 * point(key) } else { DVec3::ZERO }
    }

    #[test]
    fn the_sampled_search_finds_what_trying_all_finds() {
        let lattice =
            |key: usize| DVec3::new((key % 23) as f64, (key / 23 % 23) as f64, (key / 529) as f64) - 11.0;
        let pairs = |key: usize| point(key / 2) * 1e-20;
        let line = |key: usize| DVec3::new(uniform(key) * 1e20, 0.0, 0.0);
        let clouds: [&dyn Fn(usize) -> DVec3; 5] = [&point, &clustered, &lattice, &pairs, &line];
        for (cloud, place) in clouds.into_iter().enumerate() {
            for count in [2, 3, 100, 12_167] {
                let it = positions(count, place);
                assert_eq!(median_spacing(&it), slow(&it), "cloud {cloud} count {count}");
            }
        }
        assert_eq!(median_spacing(&positions(12_167, lattice)), Some(1.0));
    }

    #[test]
    fn the_comparison_notices_a_neighbor_that_is_missed() {
        let it = positions(12_167, point);
        let half = positions(6_000, point);
        assert_ne!(median_spacing(&half), slow(&it));
    }

    #[test]
    fn few_or_equal_particles_are_fine() {
        for count in [0, 1] {
            assert_eq!(median_spacing(&positions(count, point)), None);
        }
        for count in [2, 20_000] {
            assert_eq!(median_spacing(&positions(count, |_| DVec3::ONE)), None);
            let two_places = |key: usize| DVec3::X * if key == 1 { 3.0 } else { 0.0 };
            assert_eq!(median_spacing(&positions(count, two_places)), Some(3.0));
        }
    }
}
