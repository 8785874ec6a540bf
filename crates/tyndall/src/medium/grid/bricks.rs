//! Grids made of bricks, and taken apart into them.
//!
//! Takes a brick for every place of a lattice, gives a [`Grid`]. Bricks of one value keep no samples, and neither do those that their
//! aprons make: bricks whose samples come from constant ones alone share a stored one with all others of the same values. So a box
//! filled with one density takes as much memory as its places do.

use std::collections::HashMap;

use rayon::prelude::*;

use super::{BRICK, CORE_SAMPLES, EDGE, Grid, Lattice, Range, STORED};
use crate::error::{Error, Result};

/// The samples of a brick without its apron. Those beyond the lattice do not count.
#[derive(Clone, Debug, PartialEq)]
pub enum Brick {
    /// All are equal.
    Constant(f32),
    /// One by one, x fastest, then y, then z.
    Samples(Box<[f32; CORE_SAMPLES]>),
}

impl Brick {
    /// A brick without density.
    pub const EMPTY: Self = Self::Constant(0.0);

    pub(super) fn sample(&self, place: usize) -> f32 {
        match self {
            Self::Constant(value) => *value,
            Self::Samples(samples) => samples[place],
        }
    }

    /// The sum of its samples.
    pub(in crate::medium) fn sum(&self) -> f64 {
        match self {
            Self::Constant(value) => CORE_SAMPLES as f64 * f64::from(*value),
            Self::Samples(samples) => samples.iter().map(|&it| f64::from(it)).sum(),
        }
    }

    fn samples(&self) -> &[f32] {
        match self {
            Self::Constant(value) => std::slice::from_ref(value),
            Self::Samples(samples) => &samples[..],
        }
    }
}

impl Grid {
    /// A grid of a brick for each of the lattice's, x fastest, then y, then z ([`Lattice::bricks`]).
    ///
    /// Fails with [`Error::Setting`] if the lattice is none ([`Grid::from_dense`]), the number of bricks is not its, or a value is
    /// negative or not finite.
    pub fn from_bricks(lattice: Lattice, bricks: Vec<Brick>) -> Result<Self> {
        lattice.check()?;
        if bricks.len() != lattice.brick_count() {
            let wanted = format!("{} for {:?} samples", lattice.brick_count(), lattice.size);
            return Err(Error::setting("number of bricks", bricks.len(), wanted));
        }
        let bad = bricks
            .par_iter()
            .find_map_any(|brick| brick.samples().iter().find(|it| !(0.0..f32::INFINITY).contains(*it)));
        if let Some(bad) = bad {
            return Err(Error::setting("density", bad, "a finite number of at least 0"));
        }
        Ok(Self::from_cores(lattice, bricks))
    }

    /// The same of finite samples on a lattice that is checked.
    pub(in crate::medium) fn from_cores(lattice: Lattice, cores: Vec<Brick>) -> Self {
        let whole = Whole { lattice, bricks: lattice.bricks(), cores };
        let mut stored = vec![[0.0; STORED]];
        let mut shared: HashMap<[u32; 8], u32> = HashMap::from([([0; 8], 0)]);
        let mut places = vec![0; whole.cores.len()];
        // The numbers of the bricks that are stored, from place 1 on.
        let mut kept = Vec::new();
        for (number, place) in places.iter_mut().enumerate() {
            let mut keep = || {
                kept.push(number);
                kept.len() as u32
            };
            *place = match whole.constants(number) {
                Some(values) => *shared.entry(values).or_insert_with(keep),
                None => keep(),
            };
        }
        stored.resize(kept.len() + 1, [0.0; STORED]);
        stored[1..].par_iter_mut().zip(&kept).for_each(|(stored, &number)| *stored = whole.stored(number));
        let of_stored: Vec<Range> = stored.par_iter().map(Range::of).collect();
        let ranges = places.iter().map(|&place| of_stored[place as usize]).collect();
        let (inv_spacing, bricks) = (1.0 / lattice.spacing, whole.bricks);
        Self { lattice, inv_spacing, bricks, places, stored, ranges, finer: None }
    }

    /// The samples of a brick without its apron, 0 beyond the lattice. Panics if there is no such brick.
    pub fn brick(&self, brick: [u32; 3]) -> Brick {
        if self.places[self.brick_number(brick)] == 0 {
            return Brick::EMPTY;
        }
        let stored = self.brick_samples(brick);
        let inside: [usize; 3] =
            std::array::from_fn(|axis| (self.lattice.size[axis] - brick[axis] * BRICK).min(BRICK) as usize);
        let mut samples = Box::new([0.0; CORE_SAMPLES]);
        for (row, samples) in samples.chunks_mut(BRICK as usize).enumerate() {
            let (y, z) = (row % BRICK as usize, row / BRICK as usize);
            if y < inside[1] && z < inside[2] {
                let first = (z * EDGE + y) * EDGE;
                samples[..inside[0]].copy_from_slice(&stored[first..first + inside[0]]);
            }
        }
        let first = samples[0];
        if samples.iter().all(|it| it.to_bits() == first.to_bits()) {
            return Brick::Constant(first);
        }
        Brick::Samples(samples)
    }
}

/// All bricks of a lattice, before they have aprons.
struct Whole {
    lattice: Lattice,
    bricks: [u32; 3],
    cores: Vec<Brick>,
}

impl Whole {
    fn core(&self, brick: [u32; 3]) -> &Brick {
        let [x, y, z] = brick.map(|it| it as usize);
        &self.cores[(z * self.bricks[1] as usize + y) * self.bricks[0] as usize + x]
    }

    /// The bits of the values of a brick and of the seven that its apron reaches, if all of these are constant.
    fn constants(&self, number: usize) -> Option<[u32; 8]> {
        let brick = self.lattice.brick(number);
        let mut values = [0; 8];
        for (corner, bits) in values.iter_mut().enumerate() {
            let reached = std::array::from_fn(|axis| {
                (brick[axis] + (corner as u32 >> axis & 1)).min(self.bricks[axis] - 1)
            });
            let Brick::Constant(value) = self.core(reached) else { return None };
            // There is one zero for the bricks without density.
            *bits = if *value == 0.0 { 0 } else { value.to_bits() };
        }
        Some(values)
    }

    /// The samples of a brick with its apron.
    fn stored(&self, number: usize) -> [f32; STORED] {
        let first = self.lattice.brick(number).map(|it| it * BRICK);
        // Along each axis, from which brick (its own or the next) a sample comes, and which of its samples it is.
        let along: [[(u32, usize); EDGE]; 3] = std::array::from_fn(|axis| {
            std::array::from_fn(|step| {
                let at = (first[axis] + step as u32).min(self.lattice.size[axis] - 1);
                (at / BRICK, (at % BRICK) as usize)
            })
        });
        let mut stored = [0.0; STORED];
        for (row, samples) in stored.chunks_mut(EDGE).enumerate() {
            let ((brick_y, y), (brick_z, z)) = (along[1][row % EDGE], along[2][row / EDGE]);
            let inside = (z * BRICK as usize + y) * BRICK as usize;
            for (sample, &(brick_x, x)) in samples.iter_mut().zip(&along[0]) {
                *sample = self.core([brick_x, brick_y, brick_z]).sample(inside + x);
            }
        }
        stored
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;
    use glam::Vec3;

    /// Bricks of which each is empty, constant or of random samples.
    fn bricks(lattice: &Lattice, stream: &mut Stream) -> Vec<Brick> {
        let values = [0.0, 0.5, 2.0];
        let brick = |_| match stream.below(3) {
            0 => Brick::EMPTY,
            1 => Brick::Constant(values[stream.below(3)]),
            _ => Brick::Samples(Box::new(std::array::from_fn(|_| stream.range(0.0, 5.0)))),
        };
        (0..lattice.brick_count()).map(brick).collect()
    }

    #[test]
    fn bricks_become_the_grid_of_their_dense_samples() {
        for seed in 0..40 {
            let mut stream = Stream::new(224, seed);
            let size: [u32; 3] = std::array::from_fn(|_| 1 + stream.below(30) as u32);
            let lattice = Lattice { origin: Vec3::ONE, spacing: 0.5, size };
            let bricks = bricks(&lattice, &mut stream);
            let number = |brick: [u32; 3]| {
                let [x, y, _] = lattice.bricks();
                ((brick[2] * y + brick[1]) * x + brick[0]) as usize
            };
            let value = |[i, j, k]: [u32; 3]| {
                let inside = (k % 8 * 8 + j % 8) * 8 + i % 8;
                bricks[number([i / 8, j / 8, k / 8])].sample(inside as usize)
            };
            let mut values = Vec::new();
            for k in 0..size[2] {
                for j in 0..size[1] {
                    values.extend((0..size[0]).map(|i| value([i, j, k])));
                }
            }
            let dense = Grid::from_dense(lattice.origin, lattice.spacing, size, &values).unwrap();
            let grid = Grid::from_bricks(lattice, bricks.clone()).unwrap();
            for place in 0..lattice.brick_count() {
                let brick = lattice.brick(place);
                assert_eq!(grid.brick_samples(brick), dense.brick_samples(brick), "seed {seed} {brick:?}");
                assert_eq!(grid.brick_range(brick), dense.brick_range(brick), "seed {seed} {brick:?}");
                assert_eq!(grid.brick(brick), dense.brick(brick), "seed {seed} {brick:?}");
                for (inside, sample) in (0..512).map(|inside| (inside, grid.brick(brick).sample(inside))) {
                    let at = std::array::from_fn(|axis| brick[axis] * 8 + (inside as u32 >> (3 * axis) & 7));
                    let wanted = if (0..3).all(|axis| at[axis] < size[axis]) { value(at) } else { 0.0 };
                    assert_eq!(sample, wanted, "seed {seed} {at:?}");
                }
            }
            assert_eq!((grid.max(), grid.mass()), (dense.max(), dense.mass()), "seed {seed}");
        }
    }

    #[test]
    fn a_box_of_one_value_stores_a_brick_for_each_kind_of_neighborhood() {
        let lattice = Lattice { origin: Vec3::ZERO, spacing: 1.0, size: [128; 3] };
        let is_inside = |brick: [u32; 3]| brick.iter().all(|it| (2..14).contains(it));
        let brick =
            |number| if is_inside(lattice.brick(number)) { Brick::Constant(3.0) } else { Brick::EMPTY };
        let bricks: Vec<Brick> = (0..lattice.brick_count()).map(brick).collect();
        let grid = Grid::from_bricks(lattice, bricks.clone()).unwrap();
        // Along each axis a brick is before, inside or at the end of the box: 27 kinds.
        assert_eq!(grid.stored_bricks(), [27, 4096]);
        assert_eq!(grid.mass(), 3.0 * 96.0_f64.powi(3));
        assert_eq!(grid.density(Vec3::splat(15.5)), 0.375);
        let filled = grid.filled_bounds().unwrap();
        assert_eq!((filled.min, filled.max), (Vec3::splat(15.0), Vec3::splat(112.0)));

        let refused = |bricks: Vec<Brick>| Grid::from_bricks(lattice, bricks).unwrap_err().to_string();
        assert!(refused(bricks[1..].to_vec()).contains("number of bricks"));
        let mut bad = bricks;
        bad[77] = Brick::Constant(f32::NAN);
        assert!(refused(bad.clone()).contains("density"));
        bad[77] = Brick::Samples(Box::new([-1.0; CORE_SAMPLES]));
        assert!(refused(bad).contains("density"));
    }
}
