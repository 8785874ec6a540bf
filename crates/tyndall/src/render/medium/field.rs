//! Dense scalar fields on lattices that the light transport works on, made from the sparse grid or from finer fields.
//!
//! A field's lattice goes [`PADDING`] samples beyond the samples of the grid on every side, where there is no medium, so that a
//! solver finds its boundary conditions there. Coarser fields are sums weighted by tents: they keep the total.

use glam::{IVec3, UVec3, Vec3};
use rayon::prelude::*;

use crate::medium::Grid;
use crate::medium::grid::{BRICK, Lattice};
use crate::pages;

/// Samples of a field beyond those of the grid, on each side.
pub(super) const PADDING: u32 = 2;

/// A lattice of `spacing` over the samples of `grid`, with the padding.
#[cfg(test)]
pub(super) fn lattice_over(grid: &Grid, spacing: f32) -> Lattice {
    anchored(grid, spacing, grid.origin())
}

/// The same, whose samples lie at whole spacings from `anchor`.
pub(super) fn anchored(grid: &Grid, spacing: f32, anchor: Vec3) -> Lattice {
    // What is whole but for rounding is whole: a last cell that is there by rounding only would hold nothing.
    let first = ((grid.origin() - anchor) / spacing + 1e-3).floor() - PADDING as f32;
    let origin = anchor + spacing * first;
    let last = grid.lattice().position(grid.size().map(|count| count - 1));
    let steps = ((last - origin) / spacing - 1e-3).ceil().max(Vec3::splat(PADDING as f32));
    Lattice { origin, spacing, size: steps.as_uvec3().to_array().map(|steps| steps + 1 + PADDING) }
}

/// A spacing for which a lattice over the grid has no more than `most` samples, at least `least`.
pub(super) fn spacing(grid: &Grid, least: f32, most: f64) -> f32 {
    let samples = samples(grid, least);
    if samples <= most { least } else { least * (samples / most).cbrt() as f32 }
}

/// Samples of a lattice over the grid, padding included.
pub(super) fn samples(grid: &Grid, spacing: f32) -> f64 {
    let along = |count: u32| f64::from((count - 1) as f32 * grid.spacing() / spacing) + 5.0;
    grid.size().map(along).iter().product()
}

/// Values at the samples of a lattice, x fastest, then y, then z.
#[derive(Clone, Debug)]
pub(super) struct Field {
    pub(super) lattice: Lattice,
    pub(super) values: Vec<f32>,
}

impl Field {
    /// The density of `grid`, on a lattice made by [`anchored`].
    pub(super) fn density(grid: &Grid, lattice: Lattice) -> Self {
        let row = |j: u32, k: u32, row: &mut [f32]| grid.row([j, k], row);
        if lattice.spacing < 0.999 * grid.spacing() {
            if !grid.is_even() {
                return Self::averaged(grid, lattice, |at| grid.density(at));
            }
            // Tents narrower than the grid's cells would leave gaps.
            let fine = anchored(grid, grid.spacing(), grid.origin());
            return resample(grid.lattice(), fine, row).interpolated(lattice);
        }
        resample(grid.lattice(), lattice, row)
    }

    /// The product of a density and another field on the same lattice, at the samples of a lattice made by [`anchored`].
    pub(super) fn product(grid: &Grid, other: &Grid, lattice: Lattice) -> Self {
        let row = |j: u32, k: u32, row: &mut [f32]| {
            grid.row([j, k], row);
            for (i, value) in (0..).zip(row) {
                if *value > 0.0 {
                    *value *= other.value(i, j, k);
                }
            }
        };
        if lattice.spacing < 0.999 * grid.spacing() {
            if !grid.is_even() {
                return Self::averaged(grid, lattice, |at| match grid.density(at) {
                    0.0 => 0.0,
                    density => density * other.density(at),
                });
            }
            let fine = anchored(grid, grid.spacing(), grid.origin());
            return resample(grid.lattice(), fine, row).interpolated(lattice);
        }
        resample(grid.lattice(), lattice, row)
    }

    /// Means of a field around samples that are closer than those of `grid`, of whose bricks some are finer still; 0 beyond its samples.
    fn averaged(grid: &Grid, lattice: Lattice, field: impl Fn(Vec3) -> f32 + Sync) -> Self {
        let [low, high] = [[0; 3], grid.size().map(|count| count - 1)].map(|it| grid.lattice().position(it));
        let mean = |at: Vec3| {
            let inside = at.cmpge(low).all() && at.cmple(high).all();
            if !inside {
                return 0.0;
            }
            let corner = |k: u32| {
                let side = UVec3::new(k & 1, k >> 1 & 1, k >> 2).as_vec3() - 0.5;
                let cell = grid.cell_point(at + lattice.spacing * side)?.cell;
                Some(grid.level(cell.map(|it| it / BRICK)))
            };
            let level = (0..8).filter_map(corner).max().unwrap_or(0);
            let finest = grid.spacing() / (1 << level) as f32;
            let along = (lattice.spacing / finest - 1e-3).ceil().max(1.0);
            if along == 1.0 {
                return field(at);
            }
            let (count, step) = (along as u32, lattice.spacing / along);
            let first = at - 0.5 * (along - 1.0) * step;
            let place = |k: u32| UVec3::new(k % count, k / count % count, k / (count * count)).as_vec3();
            let all = count.pow(3);
            (0..all).map(|k| field(first + step * place(k))).sum::<f32>() / all as f32
        };
        let value = |place: usize| mean(lattice.position(sample(&lattice, place)));
        Self { lattice, values: (0..lattice.sample_count() as usize).into_par_iter().map(value).collect() }
    }

    /// This field of products over their weights: the mean at each sample. Beside samples with weight that without one has the mean of
    /// its neighbors, further away 0.
    pub(super) fn over(&self, weights: &Self) -> Self {
        let lattice = self.lattice;
        let [width, height, depth] = lattice.size.map(|it| it as i32);
        let mean = |place: usize| self.values[place] / weights.values[place];
        let value = |place: usize| {
            if weights.values[place] > 0.0 {
                return mean(place);
            }
            let at = IVec3::from_array(sample(&lattice, place).map(|it| it as i32));
            let (mut sum, mut count) = (0.0, 0);
            for step in (0..27).map(|k| IVec3::new(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1)) {
                let near = at + step;
                let inside = near.cmpge(IVec3::ZERO).all();
                if inside && near.cmplt(IVec3::new(width, height, depth)).all() {
                    let place = ((near.z * height + near.y) as usize) * width as usize + near.x as usize;
                    if weights.values[place] > 0.0 {
                        (sum, count) = (sum + mean(place), count + 1);
                    }
                }
            }
            sum / count.max(1) as f32
        };
        Self { lattice, values: (0..self.values.len()).into_par_iter().map(value).collect() }
    }

    /// The same total on a coarser lattice over the same samples; interpolated if it is not coarser.
    pub(super) fn coarsened(&self, lattice: Lattice) -> Self {
        if lattice.spacing < 0.999 * self.lattice.spacing {
            return self.interpolated(lattice);
        }
        let [width, height, _] = self.lattice.size.map(|it| it as usize);
        let row = |j: u32, k: u32, row: &mut [f32]| {
            let first = (k as usize * height + j as usize) * width;
            row.copy_from_slice(&self.values[first..first + width]);
        };
        resample(self.lattice, lattice, row)
    }

    /// The values at the samples of another lattice, interpolated.
    pub(super) fn interpolated(&self, lattice: Lattice) -> Self {
        let [x, y, z] = [0, 1, 2].map(|axis| cells(&self.lattice, &lattice, axis));
        let [width, height, _] = self.lattice.size.map(|it| it as usize);
        let row = |[y, z]: [usize; 2]| &self.values[(z * height + y) * width..][..width];
        let mut values = pages::zeros(lattice.sample_count() as usize);
        let rows = values.par_chunks_exact_mut(x.len()).enumerate();
        // A row between four is found first, then the samples along it.
        rows.for_each_init(
            || vec![0.0; width],
            |between, (number, values)| {
                let (y, z) = (&y[number % y.len()], &z[number / y.len()]);
                let corners =
                    [[y.first, z.first], [y.second, z.first], [y.first, z.second], [y.second, z.second]];
                let [a, b, c, d] = corners.map(row);
                for (between, (((a, b), c), d)) in between.iter_mut().zip(a.iter().zip(b).zip(c).zip(d)) {
                    let (low, high) = (a + y.share * (b - a), c + y.share * (d - c));
                    *between = low + z.share * (high - low);
                }
                for (value, x) in values.iter_mut().zip(&x) {
                    let low = between[x.first];
                    *value = low + x.share * (between[x.second] - low);
                }
            },
        );
        Self { lattice, values }
    }

    /// The field at a point: trilinear, clamped to the samples at the border.
    #[inline]
    pub(super) fn value(&self, at: Vec3) -> f32 {
        trilinear(&self.lattice, &self.values, at)
    }
}

/// A field at a point: trilinear, clamped to the samples at the border.
#[inline(always)]
pub(super) fn trilinear(lattice: &Lattice, values: &[f32], at: Vec3) -> f32 {
    let (first, [x, y, z], fraction) = cell(lattice, at);
    // One check of the length serves all eight.
    let v = &values[first..first + x + y + z + 1];
    let mix = |a: f32, b: f32, t: f32| a + t * (b - a);
    let row = |at: usize| mix(v[at], v[at + x], fraction.x);
    let plane = |at: usize| mix(row(at), row(at + y), fraction.y);
    mix(plane(0), plane(z), fraction.z)
}

/// A field at `start` and at points each `step` further along x: as [`trilinear`] finds it, but for rounding.
#[inline(always)]
pub(super) fn trilinear_row<const N: usize>(
    lattice: &Lattice,
    values: &[f32],
    start: Vec3,
    step: f32,
) -> [f32; N] {
    let (first, [x, y, z], fraction) = cell(lattice, start);
    let width = lattice.size[0] as usize;
    let row = first - first % width;
    let [a, b, c, d] = [0, y, z, z + y].map(|corner| &values[row + corner..][..width]);
    let mix = |a: f32, b: f32, t: f32| a + t * (b - a);
    // Between the four rows first, as far as the points reach, then along them.
    let mut mixed = [0.0; SPAN];
    let mut span = 0..0;
    let mut found = [0.0; N];
    for (number, value) in found.iter_mut().enumerate() {
        let place = (start.x + number as f32 * step - lattice.origin.x) / lattice.spacing;
        let place = place.clamp(0.0, (width - 1) as f32);
        let at = (place as usize).min(width.saturating_sub(2));
        if !span.contains(&(at + x)) {
            span = at..(at + SPAN).min(width);
            let rows =
                a[span.clone()].iter().zip(&b[span.clone()]).zip(&c[span.clone()]).zip(&d[span.clone()]);
            for (mixed, (((a, b), c), d)) in mixed.iter_mut().zip(rows) {
                *mixed = mix(mix(*a, *b, fraction.y), mix(*c, *d, fraction.y), fraction.z);
            }
        }
        let at = at - span.start;
        *value = mix(mixed[at], mixed[at + x], place - (at + span.start) as f32);
    }
    found
}

/// Samples of a row that are mixed at a time.
const SPAN: usize = 16;

/// Sample number `place` of a lattice.
#[inline(always)]
pub(super) fn sample(lattice: &Lattice, place: usize) -> [u32; 3] {
    let [x, y, _] = lattice.size.map(|it| it as usize);
    [place % x, place / x % y, place / (x * y)].map(|it| it as u32)
}

/// The cell around a point: the place of its first sample, the steps to the next sample along each axis (0 at the border, where
/// look-ups clamp), and the point's place in it.
#[inline(always)]
pub(super) fn cell(lattice: &Lattice, at: Vec3) -> (usize, [usize; 3], Vec3) {
    let last = (UVec3::from_array(lattice.size) - UVec3::ONE).as_vec3();
    let place = ((at - lattice.origin) / lattice.spacing).clamp(Vec3::ZERO, last);
    // The last sample of an axis is the end of the cell before it, where there is one.
    let before_last = lattice.size.map(|count| count.saturating_sub(2) as i32);
    let first: [i32; 3] = std::array::from_fn(|axis| (place[axis] as i32).min(before_last[axis]));
    let fraction = place - Vec3::from(first.map(|it| it as f32));
    let [x, y, z] = first.map(|it| it as usize);
    let [width, height, depth] = lattice.size.map(|it| it as usize);
    let step = |count: usize, step: usize| if count > 1 { step } else { 0 };
    let steps = [step(width, 1), step(height, width), step(depth, width * height)];
    ((z * height + y) * width + x, steps, fraction)
}

/// Where a sample of one axis lies between two of another: the two, and the share of the second.
struct Between {
    first: usize,
    second: usize,
    share: f32,
}

/// Of all samples of an axis of the lattice `to` between those of `from`, clamped to its border.
fn cells(from: &Lattice, to: &Lattice, axis: usize) -> Vec<Between> {
    let last = from.size[axis] as usize - 1;
    let cell = |sample: u32| {
        let at = to.origin[axis] + sample as f32 * to.spacing;
        let place = ((at - from.origin[axis]) / from.spacing).clamp(0.0, last as f32);
        let first = (place as usize).min(last.saturating_sub(1));
        Between { first, second: (first + 1).min(last), share: place - first as f32 }
    };
    (0..to.size[axis]).map(cell).collect()
}

/// Weights of tents: which samples of a coarse axis a sample of a fine axis goes to. The first, and the share of the next one.
struct Tents {
    first: Vec<usize>,
    share: Vec<f32>,
}

impl Tents {
    fn new(count: u32, from: (f32, f32), to: (f32, f32)) -> Self {
        let place = |sample: u32| (from.0 + sample as f32 * from.1 - to.0) / to.1;
        // Samples that coincide but for rounding are not parted.
        let (first, share) = (0..count)
            .map(place)
            .map(|at| {
                let nearest = at.round();
                let at = if (at - nearest).abs() < 1e-4 { nearest } else { at.max(0.0) };
                (at.floor() as usize, at.fract())
            })
            .unzip();
        Self { first, share }
    }
}

/// Spreads rows of samples `from` one lattice over the samples of the lattice `to`.
fn resample(from: Lattice, to: Lattice, row: impl Fn(u32, u32, &mut [f32]) + Sync) -> Field {
    let size = from.size;
    let axis = |axis: usize| {
        Tents::new(size[axis], (from.origin[axis], from.spacing), (to.origin[axis], to.spacing))
    };
    let (x, y, z) = (axis(0), axis(1), axis(2));
    let [width, height, _] = to.size.map(|it| it as usize);
    let scale = (from.spacing / to.spacing).powi(3);
    let mut values = pages::zeros(to.sample_count() as usize);
    // Each plane of the result gathers the planes that reach it, so that no two threads write to one place.
    values.par_chunks_mut(width * height).enumerate().for_each(|(plane, values)| {
        let mut fine = vec![0.0; size[0] as usize];
        let mut coarse = vec![0.0; width + 1];
        for k in 0..size[2] {
            let weight = match z.first[k as usize] {
                first if first == plane => 1.0 - z.share[k as usize],
                first if first + 1 == plane => z.share[k as usize],
                _ => continue,
            };
            if weight == 0.0 {
                continue;
            }
            for j in 0..size[1] {
                row(j, k, &mut fine);
                coarse.fill(0.0);
                for ((&value, &first), &share) in fine.iter().zip(&x.first).zip(&x.share) {
                    coarse[first] += (1.0 - share) * value;
                    coarse[first + 1] += share * value;
                }
                let (first, share) = (y.first[j as usize], y.share[j as usize]);
                for (row, share) in [(first, 1.0 - share), (first + 1, share)] {
                    if share > 0.0 && row < height {
                        let weight = scale * weight * share;
                        let row = &mut values[row * width..][..width];
                        row.iter_mut().zip(&coarse).for_each(|(value, &add)| *value += weight * add);
                    }
                }
            }
        }
    });
    Field { lattice: to, values }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    fn random_grid(size: [u32; 3]) -> Grid {
        let mut stream = Stream::new(11, 0);
        let values: Vec<f32> = (0..size.iter().product()).map(|_| stream.unit()).collect();
        Grid::from_dense(Vec3::new(1.0, 2.0, 3.0), 0.5, size, &values).unwrap()
    }

    #[test]
    fn a_field_as_fine_as_the_grid_is_the_grid() {
        let grid = random_grid([7, 5, 9]);
        let field = Field::density(&grid, lattice_over(&grid, 0.5));
        assert_eq!(field.lattice.size, [11, 9, 13]);
        for (i, j, k) in [(0, 0, 0), (6, 4, 8), (3, 2, 5)] {
            let at = grid.lattice().position([i, j, k]);
            assert!((field.value(at) - grid.value(i, j, k)).abs() < 1e-6);
        }
        assert_eq!(field.value(grid.bounds().min - 1.0), 0.0);
    }

    #[test]
    fn an_anchor_decides_where_samples_lie() {
        let grid = random_grid([7, 5, 9]);
        assert_eq!(anchored(&grid, 0.8, grid.origin()), lattice_over(&grid, 0.8));
        for spacing in [0.5, 0.8, 3.7] {
            for shift in [-7.3, 0.2, 2.0] {
                let anchor = grid.origin() + shift * Vec3::new(1.0, -0.7, 0.3);
                let lattice = anchored(&grid, spacing, anchor);
                let whole = (lattice.origin - anchor) / spacing;
                assert!((whole - whole.round()).abs().max_element() < 1e-3, "{spacing} {shift}: {whole}");
                let margin = PADDING as f32 * spacing - 1e-3;
                let (low, high) = (grid.lattice().position([0; 3]), grid.lattice().position([6, 4, 8]));
                let end = lattice.position(lattice.size.map(|it| it - 1));
                for space in [low - lattice.origin, end - high] {
                    assert!(space.min_element() >= margin && space.max_element() < margin + spacing);
                }
                let mass = f64::from(spacing).powi(3)
                    * Field::density(&grid, lattice).values.iter().map(|&it| f64::from(it)).sum::<f64>();
                assert!((mass / grid.mass() - 1.0).abs() < 1e-3 || spacing < 0.8, "{spacing} {shift}");
            }
        }
    }

    #[test]
    fn coarser_fields_keep_the_total() {
        let grid = random_grid([23, 18, 31]);
        let total = |field: &Field| {
            field.values.iter().map(|&it| f64::from(it)).sum::<f64>()
                * f64::from(field.lattice.spacing).powi(3)
        };
        for spacing in [0.5, 0.8, 1.0, 2.0, 3.7, 100.0] {
            let lattice = lattice_over(&grid, spacing);
            let field = Field::density(&grid, lattice);
            assert!((total(&field) / grid.mass() - 1.0).abs() < 1e-4, "spacing {spacing}");
            let fine = Field::density(&grid, lattice_over(&grid, 0.5));
            let coarsened = fine.coarsened(lattice);
            for (a, b) in coarsened.values.iter().zip(&field.values) {
                assert!((a - b).abs() < 1e-4, "spacing {spacing}: {a} {b}");
            }
        }
    }

    #[test]
    fn rows_are_points_one_after_the_other() {
        for (size, step) in [([23, 18, 31], 0.3), ([40, 3, 4], 3.1), ([1, 5, 1], 0.2), ([2, 1, 1], 0.7)] {
            let grid = random_grid(size);
            let field = Field::density(&grid, lattice_over(&grid, 0.5));
            let mut stream = Stream::new(13, 0);
            for _ in 0..50 {
                let start = field.lattice.bounds().center() + field.lattice.bounds().extent() * stream.cube();
                let row: [f32; 9] = trilinear_row(&field.lattice, &field.values, start, step);
                for (number, value) in row.into_iter().enumerate() {
                    let point = field.value(start + Vec3::X * (number as f32 * step));
                    assert!((value - point).abs() < 1e-4, "{size:?} {start} {number}: {value} {point}");
                }
            }
        }
    }

    #[test]
    fn interpolation_of_a_linear_field_is_exact() {
        let grid = random_grid([6, 6, 6]);
        let lattice = lattice_over(&grid, 0.7);
        let plane = |at: Vec3| 0.3 * at.x - 0.2 * at.y + at.z;
        let values = (0..lattice.sample_count() as usize)
            .map(|place| plane(lattice.position(sample(&lattice, place))));
        let field = Field { lattice, values: values.collect() };
        let mut stream = Stream::new(12, 0);
        for _ in 0..100 {
            let at = lattice.bounds().center() + 0.4 * lattice.bounds().extent() * stream.cube();
            assert!((field.value(at) - plane(at)).abs() < 1e-4);
        }
        let finer = field.interpolated(lattice_over(&grid, 0.5));
        let at = finer.lattice.position([5, 6, 7]);
        assert!((finer.value(at) - plane(at)).abs() < 1e-4);
    }
}
