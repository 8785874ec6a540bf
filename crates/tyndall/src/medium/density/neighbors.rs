//! How far each particle's N*-th neighbor is: lengths for the scatter, and what the defaults follow from.
//!
//! The sixteen particles of a cell look together: all within a radius are collected, the radius grows until each of the sixteen
//! has N* of them. A particle is its own first neighbor.

use fearless_simd::{Level, dispatch, f32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::Vec3;
use rayon::prelude::*;

use super::select::nth_smallest;
use crate::math::Bounds;
use crate::medium::cells::{CELL, Candidates, Cells, Column, Region, Within};

/// The lengths of the particles of every `step`-th cell, with NaN where there is no particle.
pub(super) fn lengths(cells: &Cells, target: u32, step: usize) -> Column {
    let target = target.min(cells.len() as u32);
    let asked: Vec<Asked> =
        cells.centers().iter().step_by(step).map(|&center| Asked { center, known: f32::INFINITY }).collect();
    let found = lengths_of(cells, target, &asked);
    found.into_iter().map(|found| found.unwrap_or([f32::NAN; CELL])).collect()
}

/// Sixteen particles at most, infinitely far away where there is none.
#[derive(Clone, Copy)]
pub(super) struct Asked {
    pub(super) center: [[f32; CELL]; 3],
    /// Cells hold all particles up to this distance from the box of the sixteen.
    pub(super) known: f32,
}

/// The lengths of particles that were a cell where all particles were sorted; of each that must know more, up to which distance.
pub(super) fn lengths_of(cells: &Cells, target: u32, asked: &[Asked]) -> Vec<Result<[f32; CELL], f32>> {
    let none = vec![[0.0; CELL]; cells.centers().len()];
    let of_one = |search: &mut Search, asked: &Asked| dispatch!(Level::new(), simd => search.lengths(simd, (cells, &none), asked, target));
    asked.par_iter().map_init(Search::default, of_one).collect()
}

/// Those of particles, sorted.
pub(super) fn sorted(lengths: &[[f32; CELL]]) -> Vec<f32> {
    let mut sorted: Vec<f32> = lengths.as_flattened().iter().copied().filter(|it| !it.is_nan()).collect();
    sorted.par_sort_unstable_by(f32::total_cmp);
    sorted
}

/// Particles near a cell, over N*, from which on its particles look alone.
const CROWD: usize = 40;
/// The least first radius, over the diagonal of everything.
const FIRST_RADIUS: f32 = 1e-4;

/// How the search for the lengths of some points ends.
enum End {
    Found([f32; CELL]),
    /// So many particles are near that each point should look alone.
    Crowded,
    /// All particles up to this distance must be known.
    Beyond(f32),
}

/// Room for the work.
#[derive(Default)]
struct Search {
    found: Candidates,
    distances_sq: Vec<[f32; 16]>,
}

impl Search {
    #[simd]
    fn lengths<S: Simd>(
        &mut self,
        simd: S,
        (cells, none): (&Cells, &Column),
        asked: &Asked,
        target: u32,
    ) -> Result<[f32; CELL], f32> {
        match self.nearest(simd, (cells, none), asked, target, CROWD * target as usize) {
            End::Found(lengths) => return Ok(lengths),
            End::Beyond(distance) => return Err(distance),
            End::Crowded => {}
        }
        // The cell reaches from one dense place to another: each of its particles looks alone.
        let mut lengths = [f32::NAN; CELL];
        for (lane, length) in lengths.iter_mut().enumerate() {
            let alone = Asked { center: asked.center.map(|column| [column[lane]; CELL]), ..*asked };
            match self.nearest(simd, (cells, none), &alone, target, usize::MAX) {
                End::Found(lengths) => *length = lengths[0],
                End::Beyond(distance) => return Err(distance),
                End::Crowded => {}
            }
        }
        Ok(lengths)
    }

    /// The lengths of sixteen points, NaN for those that are infinitely far away. No more than `most` particles may be near.
    #[simd]
    fn nearest<S: Simd>(
        &mut self,
        simd: S,
        (cells, none): (&Cells, &Column),
        Asked { center, known }: &Asked,
        target: u32,
        most: usize,
    ) -> End {
        let place = |lane: usize| Vec3::new(center[0][lane], center[1][lane], center[2][lane]);
        let bounds = (0..CELL).map(place).filter(|it| it.is_finite()).fold(Bounds::EMPTY, Bounds::with);
        if bounds.is_empty() {
            return End::Found([f32::NAN; CELL]);
        }
        let region = Region { center: bounds.center(), half: 0.5 * bounds.extent() };
        let everything = cells.bounds().extent().length() * 1.001 + f32::MIN_POSITIVE;

        // As if the particles were as dense around the cell as in it.
        let edges = bounds.extent().max(Vec3::splat(0.125 * bounds.extent().length()));
        let mut radius = 0.62 * (edges.element_product() * target as f32 / CELL as f32).cbrt();
        radius = radius.max(FIRST_RADIUS * everything);
        loop {
            radius = radius.min(everything);
            cells.collect(simd, region, &Within(radius), [none, none], &mut self.found);
            if self.found.len() > most {
                return End::Crowded;
            }
            if radius > *known {
                return End::Beyond(radius);
            }
            let fewest = self.measure(simd, region.center, center, radius);
            if fewest >= target || radius >= everything {
                break;
            }
            radius *= (1.2 * target as f32 / fewest.max(1) as f32).cbrt().clamp(1.15, 2.0);
        }
        let upper_sq = [radius * radius; 16];
        let near = &self.distances_sq[..self.found.len()];
        let mut lengths = nth_smallest(simd, near, &upper_sq, target);
        for (lane, length) in lengths.iter_mut().enumerate() {
            *length = if place(lane).is_finite() { length.sqrt() } else { f32::NAN };
        }
        End::Found(lengths)
    }

    /// The distances of all that was found from the cell's particles, and how many within the radius the one has that has fewest.
    #[inline(always)]
    fn measure<S: Simd>(&mut self, simd: S, middle: Vec3, center: &[[f32; CELL]; 3], radius: f32) -> u32 {
        if self.distances_sq.len() < self.found.len() {
            self.distances_sq.resize(2 * self.found.len(), [0.0; 16]);
        }
        let lanes_x = f32x16::load_array_ref(simd, &center[0]) - f32x16::splat(simd, middle.x);
        let lanes_y = f32x16::load_array_ref(simd, &center[1]) - f32x16::splat(simd, middle.y);
        let lanes_z = f32x16::load_array_ref(simd, &center[2]) - f32x16::splat(simd, middle.z);
        let limit = f32x16::splat(simd, radius * radius);
        let (one, mut count) = (f32x16::splat(simd, 1.0), f32x16::splat(simd, 0.0));
        let [x, y, z] = self.found.center();
        for (((&x, &y), &z), distance_sq) in x.iter().zip(y).zip(z).zip(self.distances_sq.iter_mut()) {
            let aside_x = lanes_x - f32x16::splat(simd, x);
            let aside_y = lanes_y - f32x16::splat(simd, y);
            let aside_z = lanes_z - f32x16::splat(simd, z);
            let distance = aside_x * aside_x + aside_y * aside_y + aside_z * aside_z;
            count = distance.simd_le(limit).select(count + one, count);
            distance.store_array(distance_sq);
        }
        let counts = count.to_array();
        let real = counts.iter().zip(&center[0]).filter(|(_, x)| x.is_finite());
        real.map(|(&count, _)| count as u32).min().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::particles::Positions;
    use crate::random::Stream;

    #[test]
    fn lengths_are_the_distances_of_the_nth_neighbors() {
        for seed in 0..60 {
            let mut stream = Stream::new(31, seed);
            let count = 1 + stream.below(600);
            let target = 1 + stream.below(40) as u32;
            let place = |stream: &mut Stream| match seed % 4 {
                0 => stream.cube(),
                1 => stream.normal3() * stream.unit().powi(6),
                2 => Vec3::Y * stream.below(9) as f32,
                _ => Vec3::ONE,
            };
            let places: Vec<Vec3> = (0..count).map(|_| place(&mut stream)).collect();
            let offsets = [0, 1, 2].map(|axis| places.iter().map(|it| it[axis]).collect());
            let cells = Cells::new(&Positions::from_offsets(DVec3::ZERO, offsets));
            let found = lengths(&cells, target, 1);
            assert_eq!(sorted(&found).len(), count, "seed {seed}");
            for (lengths, ids) in found.iter().zip(cells.ids()) {
                for (&length, &id) in lengths.iter().zip(ids).filter(|&(_, &id)| id != u32::MAX) {
                    let mut all: Vec<f32> =
                        places.iter().map(|it| it.distance(places[id as usize])).collect();
                    all.sort_by(f32::total_cmp);
                    let wanted = all[(target as usize).min(count) - 1];
                    assert!((length - wanted).abs() < 1e-5, "seed {seed}: {length} for {wanted}");
                }
            }
        }
    }
}
