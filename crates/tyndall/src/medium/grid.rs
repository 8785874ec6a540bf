//! A scalar field on a lattice: sparse bricks of 8^3 samples, each with the range of the field inside it.
//!
//! Takes finite samples, gives the trilinear field between them. Sample (i, j, k) sits at
//! `origin + spacing * (i, j, k)`; the box of the field is the box of the samples grown by half a spacing on each side; inside
//! it look-ups clamp to the samples at the border, outside it the field is 0.
//!
//! Invariant: a brick is stored with an apron of one sample beyond its far sides (9^3 values; at the border of the lattice the
//! border's samples again), so that the eight corners of a cell lie in one brick. Bricks of nothing but 0 share the
//! first stored one, which is all zero, so that a look-up has no branch for them; others that are alike share one too ([`Brick`]).
//! Some bricks may be parted into finer ones, which are stored as they are (`finer.rs`).

mod bricks;
mod finer;

use glam::{UVec3, Vec3};
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::math::Bounds;
pub use bricks::Brick;
pub(in crate::medium) use finer::Fine;
use finer::Levels;
pub use finer::MOST_LEVELS;
pub(crate) use finer::Piece;

/// Samples along an edge of a brick.
pub const BRICK: u32 = 8;
/// Samples of a brick without its apron.
pub const CORE_SAMPLES: usize = (BRICK * BRICK * BRICK) as usize;
/// Samples along an edge of a brick with its apron.
pub(crate) const EDGE: usize = BRICK as usize + 1;
/// Samples of a brick with its apron.
pub(crate) const STORED: usize = EDGE * EDGE * EDGE;

/// Where samples lie: (i, j, k) at `origin + spacing * (i, j, k)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    /// The first sample, as an offset from the particles' origin.
    pub origin: Vec3,
    /// Distance of neighbors along each axis.
    pub spacing: f32,
    /// Samples along x, y, z.
    pub size: [u32; 3],
}

impl Lattice {
    /// Where sample (i, j, k) lies.
    #[inline(always)]
    pub fn position(&self, sample: [u32; 3]) -> Vec3 {
        self.origin + self.spacing * UVec3::from_array(sample).as_vec3()
    }

    /// The box of the samples grown by half a spacing.
    pub fn bounds(&self) -> Bounds {
        let last = UVec3::from_array(self.size) - UVec3::ONE;
        Bounds { min: self.origin, max: self.position(last.to_array()) }.grown(0.5 * self.spacing)
    }

    /// How many samples there are.
    pub fn sample_count(&self) -> u64 {
        self.size.iter().map(|&it| u64::from(it)).product()
    }

    /// Bricks along x, y, z.
    pub fn bricks(&self) -> [u32; 3] {
        self.size.map(|it| it.div_ceil(BRICK))
    }

    /// How many bricks there are, stored or not.
    pub fn brick_count(&self) -> usize {
        self.bricks().iter().map(|&it| it as usize).product()
    }

    /// The coordinates of brick `number`, which counts x fastest.
    pub fn brick(&self, number: usize) -> [u32; 3] {
        let [x, y, _] = self.bricks().map(|it| it as usize);
        [number % x, number / x % y, number / (x * y)].map(|it| it as u32)
    }

    /// Fails with [`Error::Setting`] unless there are samples at finite places, at most 2^31 bricks of them.
    pub(super) fn check(&self) -> Result<()> {
        let Self { origin, spacing, size } = *self;
        if size.contains(&0) || size.iter().any(|&it| it > 1 << 24) {
            let allowed = "1 to 2^24 samples along each axis";
            return Err(Error::setting("size of the grid", format!("{size:?}"), allowed));
        }
        if self.bricks().iter().map(|&it| u64::from(it)).product::<u64>() > 1 << 31 {
            return Err(Error::setting(
                "size of the grid",
                format!("{size:?}"),
                "at most 2^31 bricks of 8^3",
            ));
        }
        if !(spacing > 0.0 && spacing.is_finite()) {
            return Err(Error::setting("spacing of the grid", spacing, "a length above 0"));
        }
        if !(origin.is_finite() && self.bounds().max.is_finite()) {
            return Err(Error::setting("origin of the grid", origin, "finite coordinates"));
        }
        Ok(())
    }
}

/// The least and the greatest value of the interpolated field somewhere.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Range {
    /// The least.
    pub min: f32,
    /// The greatest: the majorant.
    pub max: f32,
}

impl Range {
    /// Of a brick's samples.
    fn of(samples: &[f32; STORED]) -> Self {
        let ends = |(min, max): (f32, f32), &it: &f32| (min.min(it), max.max(it));
        let (min, max) = samples.iter().fold((f32::INFINITY, f32::NEG_INFINITY), ends);
        Self { min, max }
    }
}

/// A place in the lattice: a cell, and where in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellPoint {
    /// The sample at the cell's corner of smallest coordinates.
    pub cell: [u32; 3],
    /// From 0 at that corner to 1 at the opposite one; 0 where the look-up clamps to the last sample of an axis.
    pub fraction: Vec3,
}

/// A scalar field of sparse bricks. See the module for where samples lie and what holds between them.
#[derive(Clone, Debug)]
pub struct Grid {
    lattice: Lattice,
    inv_spacing: f32,
    bricks: [u32; 3],
    /// The place in `stored` of each brick, x fastest; 0 for those without density. Bricks that are alike may share one.
    places: Vec<u32>,
    stored: Vec<[f32; STORED]>,
    ranges: Vec<Range>,
    /// The bricks that are parted into finer ones.
    finer: Option<Box<Levels>>,
}

impl Grid {
    /// A grid of all its samples, x fastest, then y, then z.
    ///
    /// Fails with [`Error::Setting`] if a size is 0 or above 2^24, the number of values is not their product, the spacing is not
    /// above 0, the origin is not finite, or a value is negative or not finite.
    pub fn from_dense(origin: Vec3, spacing: f32, size: [u32; 3], values: &[f32]) -> Result<Self> {
        let lattice = Lattice { origin, spacing, size };
        lattice.check()?;
        if values.len() as u64 != lattice.sample_count() {
            let wanted = format!("{} for {size:?} samples", lattice.sample_count());
            return Err(Error::setting("number of densities", values.len(), wanted));
        }
        if let Some(bad) = values.iter().find(|it| !(0.0..f32::INFINITY).contains(*it)) {
            return Err(Error::setting("density", bad, "a finite number of at least 0"));
        }
        let [x_size, y_size, _] = size.map(|it| it as usize);
        let cut = |number| {
            let first = lattice.brick(number).map(|it| it * BRICK);
            let mut core = Box::new([0.0; CORE_SAMPLES]);
            for (place, sample) in core.iter_mut().enumerate() {
                let [i, j, k]: [u32; 3] =
                    std::array::from_fn(|axis| first[axis] + (place as u32 >> (3 * axis) & 7));
                if i < size[0] && j < size[1] && k < size[2] {
                    *sample = values[(k as usize * y_size + j as usize) * x_size + i as usize];
                }
            }
            if core.iter().any(|&it| it > 0.0) { Brick::Samples(core) } else { Brick::EMPTY }
        };
        Ok(Self::from_cores(lattice, (0..lattice.brick_count()).into_par_iter().map(cut).collect()))
    }

    /// Where the samples lie.
    pub fn lattice(&self) -> Lattice {
        self.lattice
    }

    /// The first sample's place, as an offset from the particles' origin.
    pub fn origin(&self) -> Vec3 {
        self.lattice.origin
    }

    /// Distance of neighboring samples.
    pub fn spacing(&self) -> f32 {
        self.lattice.spacing
    }

    /// Samples along x, y, z.
    pub fn size(&self) -> [u32; 3] {
        self.lattice.size
    }

    /// The box of the field: that of the samples grown by half a spacing.
    pub fn bounds(&self) -> Bounds {
        self.lattice.bounds()
    }

    /// Sample (i, j, k); inside a brick that is parted into finer ones a mean of theirs. Panics beyond the lattice.
    pub fn value(&self, i: u32, j: u32, k: u32) -> f32 {
        self.corner([i, j, k])[0]
    }

    /// The samples (0.., j, k) from the first on. Panics beyond the lattice.
    pub(crate) fn row(&self, [j, k]: [u32; 2], row: &mut [f32]) {
        let inside = ((k % BRICK) as usize * EDGE + (j % BRICK) as usize) * EDGE;
        let first = self.brick_number([0, j / BRICK, k / BRICK]);
        for (samples, &place) in row.chunks_mut(BRICK as usize).zip(&self.places[first..]) {
            samples.copy_from_slice(&self.stored[place as usize][inside..inside + samples.len()]);
        }
    }

    /// The field at a point: trilinear, 0 outside the box.
    #[inline]
    pub fn density(&self, at: Vec3) -> f32 {
        let Some(point) = self.cell_point(at) else { return 0.0 };
        if self.is_even() {
            return trilinear(&self.corners(point.cell), point.fraction);
        }
        let (corners, fraction, _) = self.finest(&point);
        trilinear(&corners, fraction)
    }

    /// The derivative of the field along the axes, per unit length: that of the trilinear field inside a cell; 0 outside the box
    /// and along an axis on which the look-up clamps.
    pub fn gradient(&self, at: Vec3) -> Vec3 {
        let Some(point) = self.cell_point(at) else { return Vec3::ZERO };
        let (corners, fraction, cells) = self.finest(&point);
        let place = self.to_lattice(at);
        let slope = |axis: usize| {
            let clamps = !(0.0..(self.lattice.size[axis] - 1) as f32).contains(&place[axis]);
            let side = |end: f32| {
                let mut fraction = fraction;
                fraction[axis] = end;
                trilinear(&corners, fraction)
            };
            if clamps { 0.0 } else { (side(1.0) - side(0.0)) * cells * self.inv_spacing }
        };
        Vec3::new(slope(0), slope(1), slope(2))
    }

    /// The corners of the finest cell around a point of the lattice, the point's place in it, and cells a spacing.
    fn finest(&self, CellPoint { cell, fraction }: &CellPoint) -> ([f32; 8], Vec3, f32) {
        let place = UVec3::from_array(*cell).as_vec3() + *fraction;
        self.cell_in(cell.map(|it| it / BRICK), place)
    }

    /// The cell of the lattice around a point and the point's place in it; `None` outside the box.
    #[inline(always)]
    pub fn cell_point(&self, at: Vec3) -> Option<CellPoint> {
        let place = self.to_lattice(at);
        let last = (UVec3::from_array(self.lattice.size) - UVec3::ONE).as_vec3();
        let inside = place.cmpge(Vec3::splat(-0.5)).all() && place.cmple(last + 0.5).all();
        if !inside {
            return None;
        }
        let place = place.clamp(Vec3::ZERO, last);
        let cell = place.as_uvec3();
        Some(CellPoint { cell: cell.to_array(), fraction: place - cell.as_vec3() })
    }

    /// The samples at the corners of a cell whose first sample is `cell`: x is bit 0 of a corner's number, y bit 1, z bit 2.
    /// Beyond the last sample of an axis the last one counts again. Panics if `cell` is not in the lattice.
    #[inline(always)]
    pub fn corners(&self, cell: [u32; 3]) -> [f32; 8] {
        let at = self.corner(cell);
        let (y, z) = (EDGE, EDGE * EDGE);
        // One check of the length serves all eight.
        let at = &at[..z + y + 2];
        [at[0], at[1], at[y], at[y + 1], at[z], at[z + 1], at[z + y], at[z + y + 1]]
    }

    /// The stored samples from that of `cell` on.
    #[inline(always)]
    fn corner(&self, cell: [u32; 3]) -> &[f32] {
        let stored = &self.stored[self.places[self.brick_number(cell.map(|it| it / BRICK))] as usize];
        let [x, y, z] = cell.map(|it| (it % BRICK) as usize);
        &stored[(z * EDGE + y) * EDGE + x..]
    }

    /// A point in units of the spacing, from the first sample.
    #[inline(always)]
    fn to_lattice(&self, at: Vec3) -> Vec3 {
        (at - self.lattice.origin) * self.inv_spacing
    }

    #[inline(always)]
    fn brick_number(&self, brick: [u32; 3]) -> usize {
        let [x, y, z] = brick.map(|it| it as usize);
        (z * self.bricks[1] as usize + y) * self.bricks[0] as usize + x
    }

    /// Bricks along x, y, z: the majorant cells. Brick (a, b, c) holds the cells of the samples from (8a, 8b, 8c) up to but not
    /// including (8a + 8, 8b + 8, 8c + 8); those at the border of the lattice also half a spacing beyond it.
    pub fn bricks(&self) -> [u32; 3] {
        self.bricks
    }

    /// The least and greatest value of the interpolated field in a brick, to the rounding of the interpolation.
    #[inline(always)]
    pub fn brick_range(&self, brick: [u32; 3]) -> Range {
        self.ranges[self.brick_number(brick)]
    }

    /// The stored samples of a brick with its apron: [`BRICK`] + 1 along each axis, x fastest.
    #[inline(always)]
    pub(crate) fn brick_samples(&self, brick: [u32; 3]) -> &[f32; STORED] {
        &self.stored[self.places[self.brick_number(brick)] as usize]
    }

    /// The box of a brick: together they fill [`Grid::bounds`].
    pub fn brick_bounds(&self, brick: [u32; 3]) -> Bounds {
        let whole = self.bounds();
        let mut bounds = whole;
        for axis in 0..3 {
            let side = |brick: u32| self.lattice.origin[axis] + self.lattice.spacing * (brick * BRICK) as f32;
            if brick[axis] > 0 {
                bounds.min[axis] = side(brick[axis]);
            }
            if brick[axis] + 1 < self.bricks[axis] {
                bounds.max[axis] = side(brick[axis] + 1);
            }
        }
        bounds
    }

    /// The greatest value of the field.
    pub fn max(&self) -> f32 {
        self.ranges.iter().fold(0.0, |max, it| max.max(it.max))
    }

    /// Bricks that are stored, and those that the lattice has; finer ones do not count.
    pub fn stored_bricks(&self) -> [usize; 2] {
        [self.stored.len() - 1 - self.stored_parts(), self.places.len()]
    }

    /// The box of the samples that are not 0, grown by a spacing: outside it the field is 0. `None` if all are 0.
    pub fn filled_bounds(&self) -> Option<Bounds> {
        let mut ends: Option<[UVec3; 2]> = None;
        for number in (0..self.places.len()).filter(|&number| self.places[number] > 0) {
            let brick = self.lattice.brick(number);
            let first = UVec3::from_array(brick) * BRICK;
            let beyond = UVec3::from_array(self.lattice.size) - first;
            let full = (0..EDGE * EDGE * EDGE).filter(|&at| self.brick_samples(brick)[at] != 0.0);
            for at in full {
                let step = [at % EDGE, at / EDGE % EDGE, at / (EDGE * EDGE)];
                let step = UVec3::from_array(step.map(|it| it as u32));
                // An apron repeats what is in its neighbor, or beyond the lattice what is at its end.
                if step.max_element() < BRICK && step.cmplt(beyond).all() {
                    let at = first + step;
                    ends = Some(ends.map_or([at; 2], |[low, high]| [low.min(at), high.max(at)]));
                }
            }
        }
        let [low, high] = ends?.map(|at| self.lattice.position(at.to_array()));
        Some(Bounds { min: low, max: high }.grown(self.lattice.spacing))
    }

    /// The sum of the samples, the finest there are, times the volume of a cell: the mass that the grid holds.
    pub fn mass(&self) -> f64 {
        let own = |number: usize| {
            if let Some(sum) = self.sum_of_parts(number) {
                return sum;
            }
            let stored = &self.stored[self.places[number] as usize];
            let brick = self.lattice.brick(number);
            let [x, y, z] = std::array::from_fn(|axis| {
                (self.lattice.size[axis] - brick[axis] * BRICK).min(BRICK) as usize
            });
            let rows = (0..y * z).map(|row| (row / y * EDGE + row % y) * EDGE);
            rows.flat_map(|row| &stored[row..row + x]).map(|&it| f64::from(it)).sum::<f64>()
        };
        let full = (0..self.places.len()).filter(|&number| self.places[number] > 0);
        full.map(own).sum::<f64>() * f64::from(self.lattice.spacing).powi(3)
    }

    /// The most memory that making a grid with so many bricks takes, of which `stored` have density: those are held twice.
    pub(super) fn bytes_to_make(bricks: u64, stored: u64) -> u64 {
        let brick = 2 * size_of::<Brick>() + size_of::<Vec<u8>>() + size_of::<u32>() + size_of::<Range>();
        let samples = size_of::<[f32; STORED]>() + size_of::<[f32; CORE_SAMPLES]>() + size_of::<usize>();
        bricks * brick as u64 + (stored + 1) * samples as u64
    }

    /// Memory it takes, in bytes.
    pub fn bytes(&self) -> u64 {
        (size_of_val(&self.stored[..]) + size_of_val(&self.places[..]) + size_of_val(&self.ranges[..])) as u64
    }
}

/// The trilinear mean of the corners of a cell, numbered as by [`Grid::corners`].
#[inline(always)]
pub fn trilinear(corners: &[f32; 8], fraction: Vec3) -> f32 {
    let along_x = |near: usize| corners[near] + fraction.x * (corners[near + 1] - corners[near]);
    let along_y = |near: usize| {
        let (low, high) = (along_x(near), along_x(near + 2));
        low + fraction.y * (high - low)
    };
    let (low, high) = (along_y(0), along_y(4));
    low + fraction.z * (high - low)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    /// Samples of which about a third of the bricks' volume is empty.
    fn samples(size: [u32; 3], stream: &mut Stream) -> Vec<f32> {
        let count = size.iter().product::<u32>();
        let empty = count * (stream.below(3) as u32) / 3;
        (0..count).map(|place| if place < empty { 0.0 } else { stream.range(0.0, 5.0) }).collect()
    }

    /// The module's definition in f64, corner by corner.
    fn slow(origin: Vec3, spacing: f32, size: [u32; 3], values: &[f32], at: Vec3) -> f64 {
        let place = (at - origin).as_dvec3() / f64::from(spacing);
        if (0..3).any(|axis| place[axis] < -0.5 || place[axis] > f64::from(size[axis]) - 0.5) {
            return 0.0;
        }
        let mut sum = 0.0;
        for k in 0..size[2] {
            for j in 0..size[1] {
                for i in 0..size[0] {
                    let weight: f64 = [i, j, k]
                        .iter()
                        .enumerate()
                        .map(|(axis, &it)| {
                            let clamped = place[axis].clamp(0.0, f64::from(size[axis] - 1));
                            (1.0 - (clamped - f64::from(it)).abs()).max(0.0)
                        })
                        .product();
                    sum += weight * f64::from(values[((k * size[1] + j) * size[0] + i) as usize]);
                }
            }
        }
        sum
    }

    #[test]
    fn the_field_is_the_slow_trilinear_of_the_dense_samples() {
        for seed in 0..60 {
            let mut stream = Stream::new(2009, seed);
            let size: [u32; 3] = std::array::from_fn(|_| 1 + stream.below(20) as u32);
            let origin = 3.0 * stream.normal3();
            let spacing = stream.range(0.1, 2.0);
            let values = samples(size, &mut stream);
            let grid = Grid::from_dense(origin, spacing, size, &values).unwrap();
            let [stored, all] = grid.stored_bricks();
            assert!(stored <= all, "seed {seed}");
            for (place, &value) in values.iter().enumerate() {
                let place = place as u32;
                let (i, j, k) = (place % size[0], place / size[0] % size[1], place / (size[0] * size[1]));
                assert_eq!(grid.value(i, j, k), value, "seed {seed}");
            }
            let sum: f64 = values.iter().map(|&it| f64::from(it)).sum();
            assert!((grid.mass() / f64::from(spacing).powi(3) - sum).abs() <= 1e-9 * sum, "seed {seed}");
            let bounds = grid.bounds();
            for _ in 0..40 {
                let share = Vec3::new(stream.unit(), stream.unit(), stream.unit()) * 1.1 - 0.05;
                let at = bounds.min + share * bounds.extent();
                let wanted = slow(origin, spacing, size, &values, at);
                let edge = (share - 0.5).abs().max_element() - 0.5;
                if edge.abs() < 1e-4 {
                    continue;
                }
                let found = grid.density(at);
                assert!((f64::from(found) - wanted).abs() < 2e-4, "seed {seed}: {found} for {wanted}");
                let Some(point) = grid.cell_point(at) else { continue };
                let range = grid.brick_range(point.cell.map(|it| it / BRICK));
                assert!(range.min - 1e-5 <= found && found <= range.max + 1e-5, "seed {seed}: {range:?}");
                let brick = grid.brick_bounds(point.cell.map(|it| it / BRICK)).grown(1e-4 * spacing);
                assert!(brick.min.cmple(at).all() && at.cmple(brick.max).all(), "seed {seed}");
            }
        }
    }

    #[test]
    fn the_gradient_is_the_difference_quotient() {
        let mut stream = Stream::new(7, 0);
        let values = samples([9, 10, 11], &mut stream);
        let grid = Grid::from_dense(Vec3::ONE, 0.5, [9, 10, 11], &values).unwrap();
        let step = 1e-2;
        for _ in 0..200 {
            let cell = Vec3::new(stream.below(8) as f32, stream.below(9) as f32, stream.below(10) as f32);
            let inside = Vec3::new(stream.unit(), stream.unit(), stream.unit())
                .clamp(Vec3::splat(0.1), Vec3::splat(0.9));
            let at = Vec3::ONE + 0.5 * (cell + inside);
            for axis in 0..3 {
                let aside = step * Vec3::AXES[axis];
                let wanted = (grid.density(at + aside) - grid.density(at - aside)) / (2.0 * step);
                assert!((grid.gradient(at)[axis] - wanted).abs() < 1e-2, "{at} axis {axis}");
            }
        }
        assert_eq!(grid.gradient(grid.bounds().min + 1e-3), Vec3::ZERO);
        assert_eq!(grid.gradient(grid.bounds().max + 1e-3), Vec3::ZERO);
    }

    #[test]
    fn bricks_without_density_are_not_stored() {
        let mut values = vec![0.0; 32 * 32 * 32];
        values[(16 * 32 + 16) * 32 + 16] = 1.0;
        let grid = Grid::from_dense(Vec3::ZERO, 1.0, [32; 3], &values).unwrap();
        // Its own brick and the seven whose aprons reach it.
        assert_eq!(grid.stored_bricks(), [8, 64]);
        assert_eq!((grid.max(), grid.density(Vec3::splat(15.5))), (1.0, 0.125));
        assert_eq!(grid.brick_range([0; 3]), Range::default());
        let empty = Grid::from_dense(Vec3::ZERO, 1.0, [9; 3], &[0.0; 729]).unwrap();
        assert_eq!((empty.stored_bricks(), empty.max(), empty.mass()), ([0, 8], 0.0, 0.0));
        assert_eq!(empty.density(Vec3::splat(4.5)), 0.0);
    }

    #[test]
    fn what_is_no_grid_is_refused() {
        let try_new = |spacing, size, values: &[f32]| Grid::from_dense(Vec3::ZERO, spacing, size, values);
        assert!(try_new(1.0, [1; 3], &[1.0]).is_ok());
        for (spacing, size, values) in [
            (0.0, [1; 3], [1.0]),
            (f32::NAN, [1; 3], [1.0]),
            (1.0, [0, 1, 1], [1.0]),
            (1.0, [2, 1, 1], [1.0]),
            (1.0, [1; 3], [-1.0]),
            (1.0, [1; 3], [f32::NAN]),
            (1.0, [1; 3], [f32::INFINITY]),
        ] {
            assert!(
                matches!(try_new(spacing, size, &values), Err(Error::Setting { .. })),
                "{spacing} {size:?}"
            );
        }
        assert!(Grid::from_dense(Vec3::NAN, 1.0, [1; 3], &[1.0]).is_err());
    }
}
