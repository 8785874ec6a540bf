//! Finer bricks: where a lattice is too coarse, a brick is parted into 8, 64 or 512 bricks of half, a quarter or an eighth of its spacing.
//!
//! Takes the bricks of a lattice and, for some of them, samples as fine; gives the [`Grid`]. Each part is stored as all bricks are, with its
//! apron and its range, so that whoever has found it looks up as ever. Invariant: the field is continuous: where bricks of several levels
//! touch, the finer ones have the values of the coarsest between its samples. The samples of the lattice inside a brick that is parted are
//! means of the finer ones, weighted by tents, so that what works on the lattice alone finds as much as there is.

use glam::Vec3;
use rayon::prelude::*;

use super::{BRICK, Brick, CORE_SAMPLES, EDGE, Grid, Lattice, Range, STORED, trilinear};

/// Levels of finer bricks.
pub const MOST_LEVELS: u32 = 3;

/// A brick of a level, by its place among those of the level; those of level 0 are the lattice's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Piece {
    pub(crate) at: [u32; 3],
    pub(crate) level: u32,
}

/// Finer samples of a brick.
#[derive(Clone, Debug)]
pub(in crate::medium) struct Fine {
    /// The brick's number.
    pub(in crate::medium) brick: usize,
    /// The spacing was halved so often: from 1 to [`MOST_LEVELS`].
    pub(in crate::medium) level: u32,
    /// From the brick's first sample to the first of the next one ([`Fine::along`] on each axis), x fastest, then y, then z.
    pub(in crate::medium) samples: Vec<f32>,
}

/// Which bricks are parted.
#[derive(Clone, Debug)]
pub(super) struct Levels {
    /// The level of each brick.
    levels: Vec<u8>,
    /// The number of the first part of each brick that is parted.
    firsts: Vec<u32>,
    /// The place of each part among what is stored, and its range.
    places: Vec<u32>,
    ranges: Vec<Range>,
    /// How many parts are stored.
    stored: usize,
}

impl Fine {
    /// Samples along each axis of a brick of that level.
    pub(in crate::medium) fn along(level: u32) -> usize {
        ((BRICK << level) + 1) as usize
    }

    #[inline(always)]
    fn sample(&self, [x, y, z]: [usize; 3]) -> f32 {
        let along = Self::along(self.level);
        self.samples[(z * along + y) * along + x]
    }

    /// Makes the samples inside the brick means of the finer ones.
    fn thin_out(&self, core: &mut Brick) {
        let parts = 1_isize << self.level;
        let weight = |step: isize| (1.0 - step.abs() as f32 / parts as f32) / parts as f32;
        let mut samples = Box::new(std::array::from_fn::<f32, CORE_SAMPLES, _>(|place| core.sample(place)));
        for (place, sample) in samples.iter_mut().enumerate() {
            let at = [place & 7, place >> 3 & 7, place >> 6];
            // What lies on a side is shared with the neighbors there.
            if at.contains(&0) {
                continue;
            }
            let steps = 1 - parts..parts;
            let near = |axis: usize, step: isize| ((at[axis] as isize * parts) + step) as usize;
            *sample = 0.0;
            for z in steps.clone() {
                for y in steps.clone() {
                    let across = weight(z) * weight(y);
                    let row =
                        steps.clone().map(|x| weight(x) * self.sample([near(0, x), near(1, y), near(2, z)]));
                    *sample += across * row.sum::<f32>();
                }
            }
        }
        *core = Brick::Samples(samples);
    }
}

impl Grid {
    /// A grid of finite samples on a lattice that is checked, finer in some bricks.
    pub(in crate::medium) fn from_levels(lattice: Lattice, mut cores: Vec<Brick>, fine: &[Fine]) -> Self {
        if fine.is_empty() {
            return Self::from_cores(lattice, cores);
        }
        let mut levels = Levels {
            levels: vec![0; cores.len()],
            firsts: vec![0; cores.len()],
            places: Vec::new(),
            ranges: Vec::new(),
            stored: 0,
        };
        for fine in fine {
            fine.thin_out(&mut cores[fine.brick]);
            levels.levels[fine.brick] = fine.level as u8;
        }
        let mut grid = Self::from_cores(lattice, cores);
        grid.finer = Some(Box::new(levels));
        grid.stored.reserve_exact(fine.iter().map(|it| 1_usize << (3 * it.level)).sum());
        // Coarse ones first: what touches them takes their values.
        for level in 1..=MOST_LEVELS {
            let of_level: Vec<&Fine> = fine.iter().filter(|it| it.level == level).collect();
            let joined: Vec<Vec<[f32; STORED]>> = of_level.par_iter().map(|it| grid.parted(it)).collect();
            for (fine, parts) in of_level.into_iter().zip(joined) {
                grid.add(fine.brick, parts);
            }
        }
        grid
    }

    /// The parts of a brick, all coarser bricks being there.
    fn parted(&self, fine: &Fine) -> Vec<[f32; STORED]> {
        let (along, parts) = (Fine::along(fine.level), 1_usize << fine.level);
        let brick = self.lattice.brick(fine.brick);
        // Beyond the last sample of the lattice it counts again.
        let last: [usize; 3] = std::array::from_fn(|axis| {
            ((self.lattice.size[axis] - 1 - brick[axis] * BRICK) as usize * parts).min(along - 1)
        });
        let value = |at: [usize; 3]| {
            let at: [usize; 3] = std::array::from_fn(|axis| at[axis].min(last[axis]));
            match self.coarsest(brick, fine.level, at) {
                Some(coarse) => {
                    let step = Vec3::from(at.map(|it| it as f32)) / parts as f32;
                    self.in_brick(coarse, Vec3::from(brick.map(|it| (it * BRICK) as f32)) + step)
                }
                None => fine.sample(at),
            }
        };
        let part = |number: usize| {
            let first = [number % parts, number / parts % parts, number / (parts * parts)];
            std::array::from_fn(|place| {
                let inside = [place % EDGE, place / EDGE % EDGE, place / (EDGE * EDGE)];
                value(std::array::from_fn(|axis| first[axis] * BRICK as usize + inside[axis]))
            })
        };
        (0..parts.pow(3)).map(part).collect()
    }

    /// The coarsest brick that touches a finer sample of a brick, if it is coarser than the brick.
    pub(crate) fn coarsest(&self, brick: [u32; 3], level: u32, at: [usize; 3]) -> Option<[u32; 3]> {
        let end = Fine::along(level) - 1;
        if at.iter().all(|&it| it != 0 && it != end) {
            return None;
        }
        let sides: [std::ops::RangeInclusive<u32>; 3] = std::array::from_fn(|axis| {
            let before = brick[axis].saturating_sub(u32::from(at[axis] == 0));
            before..=(brick[axis] + u32::from(at[axis] == end)).min(self.bricks[axis] - 1)
        });
        let [x, y, z] = sides;
        let all = z.flat_map(|z| y.clone().map(move |y| (y, z)));
        let all = all.flat_map(|(y, z)| x.clone().map(move |x| [x, y, z]));
        all.min_by_key(|&it| self.level(it)).filter(|&it| self.level(it) < level)
    }

    /// Stores the parts of a brick.
    fn add(&mut self, brick: usize, parts: Vec<[f32; STORED]>) {
        let Some(levels) = &mut self.finer else { return };
        levels.firsts[brick] = levels.places.len() as u32;
        for part in parts {
            let range = Range::of(&part);
            let whole = &mut self.ranges[brick];
            *whole = Range { min: whole.min.min(range.min), max: whole.max.max(range.max) };
            levels.ranges.push(range);
            if range == Range::default() {
                levels.places.push(0);
            } else {
                levels.places.push(self.stored.len() as u32);
                levels.stored += 1;
                self.stored.push(part);
            }
        }
    }

    /// The level of a brick of the lattice.
    #[inline(always)]
    pub(crate) fn level(&self, brick: [u32; 3]) -> u32 {
        self.finer.as_ref().map_or(0, |it| it.levels[self.brick_number(brick)].into())
    }

    /// Whether no brick is parted.
    #[inline(always)]
    pub(crate) fn is_even(&self) -> bool {
        self.finer.is_none()
    }

    /// How many bricks there are of each level, parts of one counted as one.
    pub fn levels(&self) -> [usize; MOST_LEVELS as usize + 1] {
        let mut counts = [0; MOST_LEVELS as usize + 1];
        match &self.finer {
            Some(finer) => finer.levels.iter().for_each(|&level| counts[usize::from(level)] += 1),
            None => counts[0] = self.places.len(),
        }
        counts
    }

    /// The distance of the closest samples.
    pub(crate) fn finest_spacing(&self) -> f32 {
        let level = self.levels().iter().rposition(|&count| count > 0).unwrap_or(0);
        self.lattice.spacing / (1 << level) as f32
    }

    /// How many parts are stored.
    pub(super) fn stored_parts(&self) -> usize {
        self.finer.as_ref().map_or(0, |it| it.stored)
    }

    /// The number of a part of a brick that is parted so.
    #[inline(always)]
    fn part(&self, piece: Piece) -> Option<(&Levels, usize)> {
        let finer = self.finer.as_deref().filter(|_| piece.level > 0)?;
        let number = self.brick_number(piece.at.map(|it| it >> piece.level));
        if u32::from(finer.levels[number]) != piece.level {
            return None;
        }
        let mask = (1 << piece.level) - 1;
        let [x, y, z] = piece.at.map(|it| (it & mask) as usize);
        let inside = ((z << piece.level | y) << piece.level) | x;
        Some((finer, finer.firsts[number] as usize + inside))
    }

    /// The stored samples of a brick of any level; those of the lattice's brick, and which it is, where that is not parted so.
    #[inline(always)]
    pub(crate) fn piece_samples(&self, piece: Piece) -> (&[f32; STORED], Piece) {
        match self.part(piece) {
            Some((finer, number)) => (&self.stored[finer.places[number] as usize], piece),
            None => {
                let at = piece.at.map(|it| it >> piece.level);
                (self.brick_samples(at), Piece { at, level: 0 })
            }
        }
    }

    /// The least and the greatest value of the field in a brick of any level.
    #[inline(always)]
    pub(crate) fn piece_range(&self, piece: Piece) -> Range {
        match self.part(piece) {
            Some((finer, number)) => finer.ranges[number],
            None => self.brick_range(piece.at.map(|it| it >> piece.level)),
        }
    }

    /// The corners of the cell around a place in a brick of the lattice (in units of the spacing, its sides too), the place in the cell,
    /// and cells a spacing.
    #[inline(always)]
    pub(super) fn cell_in(&self, brick: [u32; 3], place: Vec3) -> ([f32; 8], Vec3, f32) {
        let level = self.level(brick);
        let parts = 1_u32 << level;
        let place = place * parts as f32;
        let (mut at, mut cell, mut fraction) = ([0; 3], [0_usize; 3], Vec3::ZERO);
        for axis in 0..3 {
            let first = brick[axis] << level;
            at[axis] = (place[axis] as u32 / BRICK).clamp(first, first + parts - 1);
            let inside = place[axis] - (at[axis] * BRICK) as f32;
            cell[axis] = (inside as usize).min(BRICK as usize - 1);
            fraction[axis] = inside - cell[axis] as f32;
        }
        let (samples, _) = self.piece_samples(Piece { at, level });
        let [x, y, z] = cell;
        let first = (z * EDGE + y) * EDGE + x;
        let corner = |number: usize| {
            samples[first + (number >> 2) * EDGE * EDGE + (number >> 1 & 1) * EDGE + (number & 1)]
        };
        (std::array::from_fn(corner), fraction, parts as f32)
    }

    /// The field at a place in a brick of the lattice or on its sides.
    fn in_brick(&self, brick: [u32; 3], place: Vec3) -> f32 {
        let (corners, fraction, _) = self.cell_in(brick, place);
        trilinear(&corners, fraction)
    }

    /// The sum of the samples of a brick's parts within the lattice, in units of its own; `None` if it is not parted.
    pub(super) fn sum_of_parts(&self, number: usize) -> Option<f64> {
        let finer = self.finer.as_ref()?;
        let (level, brick) = (u32::from(finer.levels[number]), self.lattice.brick(number));
        if level == 0 {
            return None;
        }
        let parts = 1_u32 << level;
        let mut sum = 0.0;
        for part in 0..parts.pow(3) {
            let inside = [part % parts, part / parts % parts, part / (parts * parts)];
            let at: [u32; 3] = std::array::from_fn(|axis| (brick[axis] << level) + inside[axis]);
            let (samples, _) = self.piece_samples(Piece { at, level });
            // A sample stands for what is nearer to it than to others; the lattice ends half a spacing of its own behind its last one.
            let end = |axis: usize| {
                let last = (self.lattice.size[axis] - 1) * parts + parts / 2;
                (last + 1).saturating_sub(at[axis] * BRICK).min(BRICK) as usize
            };
            let [x, y, z] = [end(0), end(1), end(2)];
            let rows = (0..z).flat_map(|k| (0..y).map(move |j| (k * EDGE + j) * EDGE));
            sum += rows.flat_map(|row| &samples[row..row + x]).map(|&it| f64::from(it)).sum::<f64>();
        }
        Some(sum / f64::from(parts).powi(3))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    /// A smooth field that is finer than the lattice, of which some bricks are parted.
    fn grid(seed: u64, field: impl Fn(Vec3) -> f32) -> Grid {
        let mut stream = Stream::new(511, seed);
        let size: [u32; 3] = std::array::from_fn(|_| 9 + stream.below(12) as u32);
        let lattice = Lattice { origin: Vec3::new(1.0, -2.0, 0.5), spacing: 0.25, size };
        let at = |brick: [u32; 3], inside: [usize; 3], parts: f32| {
            let step = Vec3::from(inside.map(|it| it as f32)) / parts;
            lattice.position(brick.map(|it| it * BRICK)) + lattice.spacing * step
        };
        let core = |number: usize| {
            let brick = lattice.brick(number);
            let sample = |place: usize| {
                let inside = [place & 7, place >> 3 & 7, place >> 6];
                let is_in = (0..3).all(|axis| brick[axis] * BRICK + (inside[axis] as u32) < size[axis]);
                if is_in { field(at(brick, inside, 1.0)) } else { 0.0 }
            };
            Brick::Samples(Box::new(std::array::from_fn(sample)))
        };
        let mut fine = Vec::new();
        for brick in 0..lattice.brick_count() {
            let level = stream.below(4) as u32;
            if level > 0 {
                let (along, place) = (Fine::along(level), lattice.brick(brick));
                let inside = |k: usize| [k % along, k / along % along, k / (along * along)];
                let sample = |k: usize| field(at(place, inside(k), (1 << level) as f32));
                fine.push(Fine { brick, level, samples: (0..along.pow(3)).map(sample).collect() });
            }
        }
        let cores = (0..lattice.brick_count()).map(core).collect();
        Grid::from_levels(lattice, cores, &fine)
    }

    /// A point of the lattice's box of samples.
    fn point(grid: &Grid, stream: &mut Stream) -> Vec3 {
        let last = grid.lattice.position(grid.size().map(|it| it - 1));
        let share = Vec3::new(stream.unit(), stream.unit(), stream.unit());
        grid.origin() + share * (last - grid.origin())
    }

    #[test]
    fn a_linear_field_is_itself_at_every_level() {
        let plane = |at: Vec3| 9.0 + 0.5 * at.x - 0.25 * at.y + at.z;
        for seed in 0..4 {
            let grid = grid(seed, plane);
            let mut stream = Stream::new(512, seed);
            for _ in 0..300 {
                let at = point(&grid, &mut stream);
                assert!((grid.density(at) - plane(at)).abs() < 1e-4, "seed {seed} {at}");
                let gradient = grid.gradient(at);
                assert!((gradient - Vec3::new(0.5, -0.25, 1.0)).abs().max_element() < 1e-2, "{gradient}");
            }
        }
    }

    #[test]
    fn the_field_is_continuous_where_levels_touch_and_finer_inside() {
        let wave = |at: Vec3| 2.0 + (9.0 * at.x).sin() * (7.0 * at.y).cos() + 0.5 * (11.0 * at.z).sin();
        let (mut fine_error, mut coarse_error) = ([0.0_f32; 2], [0.0_f32; 2]);
        for seed in 0..4 {
            let grid = grid(seed, wave);
            assert!(grid.levels()[1..].iter().sum::<usize>() > 0 && !grid.is_even());
            let mut stream = Stream::new(513, seed);
            for _ in 0..400 {
                // On a side of a brick, from both sides.
                let mut at = point(&grid, &mut stream);
                let axis = stream.below(3);
                let sides = (grid.bricks()[axis] - 1) as usize;
                if sides > 0 {
                    let side = (1 + stream.below(sides)) as f32 * BRICK as f32;
                    at[axis] = grid.origin()[axis] + grid.spacing() * side;
                    let aside = 1e-4 * grid.spacing() * Vec3::AXES[axis];
                    let jump = grid.density(at + aside) - grid.density(at - aside);
                    assert!(jump.abs() < 2e-3, "seed {seed} {at}: {jump}");
                }
                // Every value within the range of its brick.
                let at = point(&grid, &mut stream);
                let brick = grid.cell_point(at).unwrap().cell.map(|it| it / BRICK);
                let level = grid.level(brick);
                let place = (at - grid.origin()) / grid.spacing() * (1 << level) as f32 / BRICK as f32;
                let piece = Piece { at: place.as_uvec3().to_array(), level };
                let (found, range) = (grid.density(at), grid.piece_range(piece));
                assert!(range.min - 1e-4 <= found && found <= range.max + 1e-4, "seed {seed} {at}");
                let whole = grid.brick_range(brick);
                assert!(whole.min <= range.min && range.max <= whole.max);
                let error = [(found - wave(at)).abs(), 1.0];
                let sum = if level == 3 { &mut fine_error } else { &mut coarse_error };
                sum.iter_mut().zip(error).for_each(|(sum, it)| *sum += if level % 3 == 0 { it } else { 0.0 });
            }
        }
        let [fine, coarse] = [fine_error, coarse_error].map(|[sum, count]| sum / count);
        assert!(fine < 0.2 * coarse, "{fine} {coarse}");
    }

    #[test]
    fn samples_of_the_lattice_hold_what_finer_ones_do() {
        let lattice = Lattice { origin: Vec3::ZERO, spacing: 1.0, size: [17; 3] };
        for level in 1..=MOST_LEVELS {
            let (along, parts) = (Fine::along(level), (1 << level) as f32);
            // A bump that is narrower than the spacing, between the lattice's samples.
            let bump = |place: usize| {
                let at = [place % along, place / along % along, place / (along * along)];
                let at = Vec3::from(at.map(|it| it as f32)) / parts;
                (0.4 - at.distance_squared(Vec3::new(3.5, 4.5, 5.3))).max(0.0)
            };
            let fine = Fine { brick: 0, level, samples: (0..along.pow(3)).map(bump).collect() };
            let grid = Grid::from_levels(lattice, vec![Brick::EMPTY; lattice.brick_count()], &[fine]);
            assert_eq!(grid.levels()[level as usize], 1);
            assert!((grid.density(Vec3::new(3.5, 4.5, 5.5)) - 0.36).abs() < 1e-5, "level {level}");
            let sum: f64 = (0..17 * 17 * 17)
                .map(|place| f64::from(grid.value(place % 17, place / 17 % 17, place / 289)))
                .sum();
            let mass = grid.mass();
            assert!(mass > 0.1 && (sum / mass - 1.0).abs() < 1e-5, "level {level}: {sum} {mass}");
        }
    }
}
