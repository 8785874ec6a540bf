//! Where a medium is and where it is not: for every brick of its density, which filled brick it is, or how far the next one is.
//!
//! Takes a grid, or a grid whose matter may be found some way beyond where it lies (noise moves it). Distances are counted in
//! bricks, diagonals as 1: all bricks nearer than that are empty, so that a ray may cross them at once. Where bricks are parted into finer ones, it
//! also says how short steps have to be.

use glam::{IVec3, Vec3A};

use super::walk::Path;
use crate::medium::Grid;
use crate::medium::grid::BRICK;

/// See the module.
#[derive(Clone, Debug)]
pub(super) struct Space {
    /// Bricks along x, y, z, those of the margin too.
    pub(super) size: [usize; 3],
    /// Bricks beyond the grid, on each side.
    pub(super) margin: i32,
    /// The last brick along x, y, z, counted from the first one of the margin.
    pub(super) last: Vec3A,
    /// The number of a filled brick, or minus the distance of the next one.
    pub(super) entries: Vec<i32>,
    /// The spacing of the finest samples that are found in each, as a share of the lattice's; none if no brick is parted.
    pub(super) shares: Vec<f32>,
}

/// Distances are not told apart beyond this one.
const FAR: i32 = 1 << 20;

impl Space {
    /// The bricks of a grid.
    pub(super) fn of(grid: &Grid) -> Self {
        Self::within(grid, 0)
    }

    /// The bricks within `reach` (in spacings) of matter. None of them has a number: all that are reached are number 0.
    pub(super) fn reached(grid: &Grid, reach: f32) -> Self {
        let bricks = (reach / BRICK as f32).ceil() as i32;
        let mut space = Self::within(grid, bricks);
        // What noise brings there may be from the finest of them.
        space.spread_shares(bricks as usize);
        for entry in &mut space.entries {
            *entry = if *entry > 0 { 0 } else { *entry };
            *entry = (*entry + bricks).min(0);
        }
        space
    }

    fn within(grid: &Grid, margin: i32) -> Self {
        let size = grid.bricks().map(|count| count as usize + 2 * margin as usize);
        let mut entries = vec![-FAR; size.iter().product()];
        let mut filled = 0;
        let inside = |at: usize, axis: usize| {
            let at = at as i32 - margin;
            (0..grid.bricks()[axis] as i32).contains(&at).then_some(at as u32)
        };
        for (place, entry) in entries.iter_mut().enumerate() {
            let at = position(size, place);
            let brick = inside(at[0], 0).zip(inside(at[1], 1)).zip(inside(at[2], 2));
            if let Some(((x, y), z)) = brick
                && grid.brick_range([x, y, z]).max > 0.0
            {
                *entry = filled;
                filled += 1;
            }
        }
        let last = Vec3A::from(size.map(|count| (count - 1) as f32));
        let share = |place: usize| {
            let at = position(size, place);
            let brick = inside(at[0], 0).zip(inside(at[1], 1)).zip(inside(at[2], 2));
            brick.map_or(1.0, |((x, y), z)| 1.0 / (1 << grid.level([x, y, z])) as f32)
        };
        let shares = if grid.is_even() { Vec::new() } else { (0..entries.len()).map(share).collect() };
        let mut space = Self { size, margin, last, entries, shares };
        space.measure();
        space
    }

    /// Gives every brick the least share of those within so many bricks of it: along each axis in turn.
    fn spread_shares(&mut self, reach: usize) {
        let [width, height, _] = self.size;
        for (axis, stride) in [1, width, width * height].into_iter().enumerate() {
            let least = |place: usize| {
                let at = position(self.size, place)[axis];
                let from = at.saturating_sub(reach);
                let end = (at + reach).min(self.size[axis] - 1);
                (from..=end).map(|it| self.shares[place + it * stride - at * stride]).fold(1.0, f32::min)
            };
            self.shares = (0..self.shares.len()).map(least).collect();
        }
    }

    /// How long a step around a place should be, as a share of one in bricks that are not parted.
    #[inline(always)]
    pub(super) fn share(&self, place: Vec3A) -> f32 {
        if self.shares.is_empty() { 1.0 } else { self.shares[self.place(place)] }
    }

    /// The place among the entries of what is at a place in lattice units.
    #[inline(always)]
    fn place(&self, place: Vec3A) -> usize {
        let brick = (place * (1.0 / BRICK as f32)).floor() + self.margin as f32;
        let brick = brick.max(Vec3A::ZERO).min(self.last);
        let (x, y, z) = (brick.x as usize, brick.y as usize, brick.z as usize);
        let [width, height, _] = self.size;
        (z * height + y) * width + x
    }

    /// Finds distances: through each plane, row and line forward and back. Entries are numbers or minus [`FAR`] before.
    fn measure(&mut self) {
        let count = self.entries.len();
        // Neighbors that were visited before, in the order of the entries: 13 of 26.
        let steps: Vec<IVec3> = (0..13).map(|k| IVec3::new(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1)).collect();
        for (way, places) in [(1, Vec::from_iter(0..count)), (-1, Vec::from_iter((0..count).rev()))] {
            for place in places {
                if self.entries[place] >= 0 {
                    continue;
                }
                let at = IVec3::from_array(position(self.size, place).map(|it| it as i32));
                let nearest = steps.iter().filter_map(|&step| {
                    let next = at + way * step;
                    let inside = (0..3).all(|axis| (0..self.size[axis] as i32).contains(&next[axis]));
                    inside.then(|| self.entries[self.number(next)].min(0))
                });
                let nearest = nearest.max().unwrap_or(-FAR);
                self.entries[place] = self.entries[place].max((nearest - 1).max(-FAR));
            }
        }
    }

    fn number(&self, at: IVec3) -> usize {
        let [x, y, z] = at.to_array().map(|it| it as usize);
        (z * self.size[1] + y) * self.size[0] + x
    }

    /// The bricks that are not empty, by their numbers. Of a grid without margin.
    pub(super) fn filled(&self) -> Vec<[u32; 3]> {
        let filled = (0..self.entries.len()).filter(|&place| self.entries[place] >= 0);
        filled.map(|place| position(self.size, place).map(|it| it as u32)).collect()
    }

    /// What is at a place, in lattice units: the number of a brick, or how far the next one is. Beyond all bricks the last ones
    /// count.
    #[inline(always)]
    pub(super) fn entry(&self, place: Vec3A) -> Result<usize, f32> {
        let entry = self.entries[self.place(place)];
        if entry >= 0 { Ok(entry as usize) } else { Err(-entry as f32) }
    }

    /// How far along `path` it is at least, from where it enters, to what is not known to be empty around `place`, which is
    /// `distance` bricks from the next one that is filled.
    #[inline(always)]
    pub(super) fn leave(&self, path: &Path, place: Vec3A, distance: f32) -> f32 {
        let brick = (place * (1.0 / BRICK as f32)).floor();
        path.leave(BRICK as f32 * (brick - (distance - 1.0)), BRICK as f32 * (brick + distance))
    }
}

/// The coordinates of an entry.
fn position(size: [usize; 3], place: usize) -> [usize; 3] {
    let [x, y, _] = size;
    [place % x, place / x % y, place / (x * y)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;
    use glam::Vec3;

    fn grid(seed: u64) -> Grid {
        let mut stream = Stream::new(61, seed);
        let size = [40, 24, 56];
        let lonely: Vec<u32> = (0..4).map(|_| (stream.unit() * (40 * 24 * 56) as f32) as u32).collect();
        let values: Vec<f32> = (0..40 * 24 * 56).map(|k| f32::from(lonely.contains(&k))).collect();
        Grid::from_dense(Vec3::ZERO, 1.0, size, &values).unwrap()
    }

    /// The distance by looking at every brick.
    fn wanted(grid: &Grid, at: [i32; 3]) -> i32 {
        let [x, y, z] = grid.bricks();
        let all = (0..x * y * z).map(|k| [k % x, k / x % y, k / (x * y)]);
        let filled = all.filter(|&brick| grid.brick_range(brick).max > 0.0);
        let distance =
            |brick: [u32; 3]| (0..3).map(|axis| (brick[axis] as i32 - at[axis]).abs()).max().unwrap_or(0);
        filled.map(distance).min().unwrap_or(FAR)
    }

    #[test]
    fn distances_are_those_of_brute_force() {
        for seed in 0..20 {
            let grid = grid(seed);
            let space = Space::of(&grid);
            let reached = Space::reached(&grid, 11.0);
            assert_eq!((space.margin, reached.margin), (0, 2));
            for place in 0..reached.entries.len() {
                let at = position(reached.size, place).map(|it| it as i32 - 2);
                let distance = wanted(&grid, at);
                assert_eq!(-reached.entries[place], (distance - 2).max(0), "seed {seed}: {at:?}");
                let center = Vec3A::from(at.map(|it| 8.0 * it as f32 + 4.0));
                if (0..3).all(|axis| (0..grid.bricks()[axis] as i32).contains(&at[axis])) {
                    let found = space.entry(center).err().unwrap_or(0.0);
                    assert_eq!(found, distance as f32, "seed {seed}: {at:?}");
                }
            }
            assert!(space.shares.is_empty() && reached.shares.is_empty());
            let filled = space.filled();
            for (number, brick) in filled.iter().enumerate() {
                let center = Vec3A::from(brick.map(|it| (8 * it + 4) as f32));
                assert_eq!(space.entry(center), Ok(number));
            }
        }
    }
}
