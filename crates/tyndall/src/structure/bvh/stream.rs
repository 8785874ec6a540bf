//! Building over more particles than fit beside their structure: they are read part by part, several times, and never held as a whole.
//!
//! A k-d tree over a sample cuts space into cells in an order in which neighbors are near. A first reading counts the particles of
//! every cell; runs of cells then make bricks, subtrees that are full but for the last. Further readings gather as many bricks at once
//! as the memory given allows; each is sorted and packed as [`super::build`] does it, and its particles are let go.
//! Where a cell lies in two bricks, the particles with the smaller ids go to the first: the result depends on the source alone.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use glam::Vec3;
use rayon::prelude::*;

use super::block::{Packing, Unfrozen};
use super::build::sort;
use super::packing_error::Sums;
use super::sizes::Sizes;
use super::{Bvh, LEAF};
use crate::error::{Error, Result};
use crate::math::Bounds;
use crate::progress::Progress;
use crate::source::Source;
use crate::structure::build::Record;

/// Particles read at a time by one thread.
const PART: u64 = 1 << if cfg!(test) { 15 } else { 20 };
/// Particles in a brick: a full subtree, 64 MiB of records, less than a tenth of a second to sort. Tests have several of fewer particles.
const BRICK: usize = LEAF << if cfg!(test) { 12 } else { 18 };
/// Particles that decide where space is cut, and levels of cuts: cells of a few thousandths of a large source.
const SAMPLE: u64 = 1 << 17;
const CUTS: u32 = 12;

impl Bvh {
    /// Builds over a source of spheres of one `radius`. Records of `at_once` particles are held at a time, 16 bytes each, but no fewer
    /// than a brick's. Returns too how many particles were not finite.
    ///
    /// Fails when interrupted or when the source fails.
    pub fn stream(
        source: &dyn Source,
        radius: f32,
        packing: Packing,
        at_once: u64,
        progress: &dyn Progress,
    ) -> Result<(Self, u64)> {
        let cells = Cells::over(source)?;
        progress.begin("scan", Some(source.len()), "particles");
        let (parts, kept) = Parts::count(source, &cells, progress)?;
        progress.begin("build", Some(kept), "particles");
        let bricks = (kept as usize).div_ceil(BRICK);
        let window = (at_once as usize / BRICK).max(1);
        let mut blocks = Unfrozen::with_capacity(packing, (kept as usize).div_ceil(LEAF));
        let mut ids = Vec::with_capacity(kept as usize);
        let mut sums = Sums::default();
        for first in (0..bricks).step_by(window) {
            for runs in parts.gather(source, &cells, first..(first + window).min(bricks), progress)? {
                let mut brick = Vec::with_capacity(runs.iter().map(|(_, run)| run.len()).sum());
                runs.into_iter().for_each(|(_, run)| brick.extend(run));
                sort(&mut brick, progress);
                blocks.extend(&brick);
                if packing != Packing::Exact {
                    let held =
                        |node: u32| (blocks.center(node as usize / LEAF, node as usize % LEAF), radius);
                    sums = sums.and(Sums::over(&brick, radius, ids.len(), held));
                }
                ids.par_extend(brick.par_iter().map(|record| record.id));
            }
            if progress.cancelled() {
                return Err(Error::Interrupted);
            }
        }
        let packing_error = (packing != Packing::Exact).then(|| sums.error(ids.len()));
        let bvh =
            Self { packing_error, ..Self::over(blocks.freeze(), Sizes::Uniform(radius), ids.into(), 1.0) };
        Ok((bvh, source.len() - kept))
    }
}

/// Space, cut into cells by a k-d tree: node `n` has children `2 n` and `2 n + 1`, the root is 1.
struct Cells {
    cuts: Vec<(u8, f32)>,
}

impl Cells {
    /// Cuts a sample in halves along its widest extent, and its halves.
    fn over(source: &dyn Source) -> Result<Self> {
        let step = source.len().div_ceil(SAMPLE).max(1);
        let mut sample = Vec::new();
        let mut one = Vec::new();
        for at in (0..source.len()).step_by(step as usize) {
            source.read(at..at + 1, &mut one)?;
            sample.extend(one.iter().copied().filter(|center| center.is_finite()));
        }
        let mut cells = Self { cuts: vec![(0, 0.0); 1 << CUTS] };
        cells.cut(1, &mut sample);
        Ok(cells)
    }

    fn cut(&mut self, node: usize, sample: &mut [Vec3]) {
        if node >= self.cuts.len() || sample.is_empty() {
            return;
        }
        let bounds = sample.iter().fold(Bounds::EMPTY, |bounds, &center| bounds.with(center));
        let axis = bounds.extent().max_position();
        let middle = sample.len() / 2;
        sample.select_nth_unstable_by(middle, |a, b| a[axis].total_cmp(&b[axis]));
        self.cuts[node] = (axis as u8, sample[middle][axis]);
        let (left, right) = sample.split_at_mut(middle);
        self.cut(2 * node, left);
        self.cut(2 * node + 1, right);
    }

    /// The cell in which a center lies.
    #[inline(always)]
    fn of(&self, center: Vec3) -> usize {
        let mut node = 1;
        for _ in 0..CUTS {
            let (axis, at) = self.cuts[node];
            node = 2 * node + usize::from(center[axis as usize] >= at);
        }
        node - self.cuts.len()
    }
}

/// Particles of one part in one brick, and the part's number.
type Run = (usize, Vec<Record<3>>);

/// Where the particles of each part go in the order of cells.
struct Parts {
    ranges: Vec<Range<u64>>,
    /// By part and cell: the place of its first particle there. A last row has the ends.
    places: Vec<Vec<u32>>,
}

impl Parts {
    /// Reads everything once. Returns too how many particles are finite.
    fn count(source: &dyn Source, cells: &Cells, progress: &dyn Progress) -> Result<(Self, u64)> {
        let starts = (0..source.len()).step_by(PART as usize);
        let ranges: Vec<_> = starts.map(|start| start..(start + PART).min(source.len())).collect();
        let count = |centers: &mut Vec<Vec3>, range: &Range<u64>| {
            if progress.cancelled() {
                return Err(Error::Interrupted);
            }
            source.read(range.clone(), centers)?;
            let mut counts = vec![0_u32; cells.cuts.len()];
            for &center in centers.iter().filter(|center| center.is_finite()) {
                counts[cells.of(center)] += 1;
            }
            progress.advance(range.end - range.start);
            Ok(counts)
        };
        let mut places: Vec<Vec<u32>> = ranges.par_iter().map_init(Vec::new, count).collect::<Result<_>>()?;
        places.push(vec![0; cells.cuts.len()]);
        let mut place = 0;
        for cell in 0..cells.cuts.len() {
            for row in &mut places {
                place += std::mem::replace(&mut row[cell], place);
            }
        }
        Ok((Self { ranges, places }, place.into()))
    }

    /// The particles of some bricks, as runs in the order of their parts.
    fn gather(
        &self,
        source: &dyn Source,
        cells: &Cells,
        bricks: Range<usize>,
        progress: &dyn Progress,
    ) -> Result<Vec<Vec<Run>>> {
        let gathered: Vec<Mutex<Vec<Run>>> = bricks.clone().map(|_| Mutex::default()).collect();
        let wanted = (bricks.start * BRICK) as u64..(bricks.end * BRICK) as u64;
        let holds_wanted = |part: &usize| {
            let (firsts, ends) = (&self.places[*part], &self.places[*part + 1]);
            let mut places = firsts.iter().zip(ends).filter(|(first, end)| first < end);
            places.any(|(&first, &end)| u64::from(first) < wanted.end && u64::from(end) > wanted.start)
        };
        let read = |centers: &mut Vec<Vec3>, part: usize| {
            if progress.cancelled() {
                return Err(Error::Interrupted);
            }
            let range = self.ranges[part].clone();
            source.read(range.clone(), centers)?;
            let mut places = self.places[part].clone();
            let mut own: Vec<Vec<Record<3>>> = vec![Vec::new(); bricks.len()];
            for (id, &center) in (range.start as u32..).zip(centers.iter()) {
                if !center.is_finite() {
                    continue;
                }
                let place = &mut places[cells.of(center)];
                if wanted.contains(&u64::from(*place)) {
                    let record = Record { coordinates: center.to_array(), id };
                    own[*place as usize / BRICK - bricks.start].push(record);
                }
                *place += 1;
            }
            for (brick, own) in gathered.iter().zip(own).filter(|(_, own)| !own.is_empty()) {
                brick.lock().unwrap_or_else(PoisonError::into_inner).push((part, own));
            }
            Ok(())
        };
        let parts: Vec<usize> = (0..self.ranges.len()).filter(holds_wanted).collect();
        parts.into_par_iter().with_max_len(1).map_init(Vec::new, read).collect::<Result<()>>()?;
        let in_order = |runs: Mutex<Vec<Run>>| {
            let mut runs = runs.into_inner().unwrap_or_else(PoisonError::into_inner);
            runs.sort_unstable_by_key(|(part, _)| *part);
            runs
        };
        Ok(gathered.into_iter().map(in_order).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Ray;
    use crate::random::Stream;

    /// Points on a curve and around it, some of them lost, each a function of its number.
    struct Points(u64);

    impl Source for Points {
        fn len(&self) -> u64 {
            self.0
        }

        fn read(&self, range: Range<u64>, into: &mut Vec<Vec3>) -> Result<()> {
            into.clear();
            into.extend(range.map(|k| {
                let mut stream = Stream::new(7, k);
                let t = k as f32 / self.0 as f32;
                let near = 0.01 * stream.direction() * stream.unit();
                if k % 1000 == 999 {
                    Vec3::NAN
                } else {
                    Vec3::new(t, (9.0 * t).sin(), (7.0 * t).cos()) + near
                }
            }));
            Ok(())
        }
    }

    #[test]
    fn every_particle_is_found_whatever_is_held_at_once() {
        for count in [0, 1, 15, 1000, 20_000] {
            let points = Points(count);
            let (bvh, dropped) = Bvh::stream(&points, 1e-4, Packing::Exact, 1, &()).unwrap();
            assert_eq!(dropped, count / 1000);
            let mut centers = Vec::new();
            points.read(0..count, &mut centers).unwrap();
            assert_eq!(bvh.ids().len() as u64, count - dropped);
            for (node, &id) in bvh.ids().iter().enumerate() {
                assert_eq!(bvh.sphere(node as u32), (centers[id as usize], 1e-4));
                let origin = centers[id as usize] + Vec3::X * 2e-4;
                let ray = Ray { origin, direction: Vec3::NEG_X, t_min: 0.0, t_max: 1.0 };
                assert!(
                    bvh.intersect(&ray, None).is_some_and(|hit| hit.t <= 1.1e-4),
                    "{count}: particle {id}"
                );
            }
        }
    }

    #[test]
    fn several_bricks_hold_every_particle_once() {
        let count = 2 * BRICK as u64 + 12_345;
        let points = Points(count);
        let trees = [1, 2 * BRICK as u64].map(|at_once| {
            let (bvh, dropped) = Bvh::stream(&points, 1e-4, Packing::Bits8, at_once, &()).unwrap();
            assert_eq!(dropped, count / 1000);
            bvh
        });
        assert!(trees[0].ids() == trees[1].ids(), "what is held at once changes nothing");
        assert_eq!(trees[0].packing_error(), trees[1].packing_error());
        let mut centers = Vec::new();
        points.read(0..count, &mut centers).unwrap();
        let off = (0..)
            .zip(trees[0].ids())
            .map(|(node, &id)| (trees[0].sphere(node).0 - centers[id as usize]).abs());
        let largest = off.fold(Vec3::ZERO, Vec3::max);
        assert_eq!(trees[0].packing_error().unwrap().center_largest, largest.to_array());
        let mut ids = trees[0].ids().to_vec();
        ids.par_sort_unstable();
        assert!(ids.into_iter().eq((0..count as u32).filter(|id| id % 1000 != 999)));
    }
}
