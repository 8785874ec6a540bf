//! A frozen random velocity field without divergence, periodic, on a grid of 64^3 points, linear between them.
//!
//! White noise is filtered in Fourier space to amplitudes k^(-11/6) (so that energy falls as Kolmogorov's k^(-5/3)), its
//! divergence is projected out, and it is scaled to unit root mean square a component.

use std::f64::consts::TAU;

use glam::{DVec3, Vec3, Vec4};
use rayon::prelude::*;

use crate::random::Stream;

/// Points along an axis: a power of two.
const SIDE: usize = 64;
const SLOPE: f64 = -11.0 / 6.0;
/// Wave numbers that are present.
const LOWEST: f64 = 1.5;
const HIGHEST: f64 = SIDE as f64 / 2.5;

/// A complex number.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Complex {
    re: f64,
    im: f64,
}

impl Complex {
    fn plus(self, other: Self) -> Self {
        Self { re: self.re + other.re, im: self.im + other.im }
    }

    fn minus(self, other: Self) -> Self {
        Self { re: self.re - other.re, im: self.im - other.im }
    }

    fn times(self, other: Self) -> Self {
        Self { re: self.re * other.re - self.im * other.im, im: self.re * other.im + self.im * other.re }
    }
}

/// The field; see the module.
pub(super) struct Turbulence {
    /// x, y, z and an unused fourth, for loads of one step; z runs fastest.
    points: Vec<Vec4>,
}

impl Turbulence {
    pub(super) fn new(seed: u64) -> Self {
        let mut waves: Vec<Vec<Complex>> = (0..3u64)
            .into_par_iter()
            .map(|component| {
                let mut stream = Stream::new(seed, u64::MAX - 1 - component);
                let noise = |_| Complex { re: f64::from(stream.normal()), im: 0.0 };
                let mut grid: Vec<Complex> = (0..SIDE * SIDE * SIDE).map(noise).collect();
                transform(&mut grid, -1.0);
                grid
            })
            .collect();
        for place in 0..SIDE * SIDE * SIDE {
            let wave = wave_vector(place);
            let length = wave.length();
            let factor = if (LOWEST..HIGHEST).contains(&length) { length.powf(SLOPE) } else { 0.0 };
            let part = |pick: fn(Complex) -> f64| {
                let vector = factor * DVec3::from_array(std::array::from_fn(|axis| pick(waves[axis][place])));
                vector - wave * (wave.dot(vector) / wave.length_squared().max(1.0))
            };
            let (re, im) = (part(|it| it.re), part(|it| it.im));
            for (axis, component) in waves.iter_mut().enumerate() {
                component[place] = Complex { re: re[axis], im: im[axis] };
            }
        }
        waves.par_iter_mut().for_each(|component| transform(component, 1.0));
        let velocity = |place: usize| DVec3::from_array(std::array::from_fn(|axis| waves[axis][place].re));
        let count = SIDE * SIDE * SIDE;
        let mean_sq =
            (0..count).map(|place| velocity(place).length_squared()).sum::<f64>() / (3 * count) as f64;
        let scale = 1.0 / mean_sq.sqrt();
        Self { points: (0..count).map(|place| (scale * velocity(place)).as_vec3().extend(0.0)).collect() }
    }

    /// The velocity at `position`, where the field repeats after `period` along each axis.
    #[inline(always)]
    pub(super) fn at(&self, position: Vec3, period: f32) -> Vec3 {
        let place = position * (SIDE as f32 / period);
        // Rounding toward zero and one comparison: `floor` is a call on machines without an instruction for it.
        let rounded = place.as_ivec3();
        let lower = rounded
            + glam::IVec3::select(place.cmplt(rounded.as_vec3()), glam::IVec3::NEG_ONE, glam::IVec3::ZERO);
        let share = place - lower.as_vec3();
        let mask = SIDE as i32 - 1;
        let line =
            |place: i32, step: usize| [(place & mask) as usize * step, ((place + 1) & mask) as usize * step];
        let x = line(lower.x, SIDE * SIDE);
        let y = line(lower.y, SIDE);
        let z = line(lower.z, 1);
        let along_z = |row: usize| {
            let (near, far) = (self.points[row + z[0]], self.points[row + z[1]]);
            near + share.z * (far - near)
        };
        let along_y = |plane: usize| {
            let (near, far) = (along_z(plane + y[0]), along_z(plane + y[1]));
            near + share.y * (far - near)
        };
        let (near, far) = (along_y(x[0]), along_y(x[1]));
        (near + share.x * (far - near)).truncate()
    }
}

/// The wave vector of a place in the transformed grid, in periods a side: from -32 to 31.
fn wave_vector(place: usize) -> DVec3 {
    let signed = |place: usize| if place < SIDE / 2 { place as f64 } else { place as f64 - SIDE as f64 };
    DVec3::new(signed(place / (SIDE * SIDE)), signed(place / SIDE % SIDE), signed(place % SIDE))
}

/// The discrete Fourier transform of the grid along all axes, not scaled; `sign` -1 forward, 1 back.
fn transform(grid: &mut [Complex], sign: f64) {
    let roots: Vec<Complex> = (0..SIDE / 2)
        .map(|k| (sign * TAU * k as f64 / SIDE as f64).sin_cos())
        .map(|(im, re)| Complex { re, im })
        .collect();
    let mut row = [Complex::default(); SIDE];
    for step in [1, SIDE, SIDE * SIDE] {
        for start in (0..grid.len()).filter(|start| start / step % SIDE == 0) {
            for (place, value) in row.iter_mut().enumerate() {
                *value = grid[start + place * step];
            }
            transform_row(&mut row, &roots);
            for (place, value) in row.iter().enumerate() {
                grid[start + place * step] = *value;
            }
        }
    }
}

/// The transform of one row (Cooley and Tukey 1965, in place).
fn transform_row(row: &mut [Complex; SIDE], roots: &[Complex]) {
    for place in 0..SIDE {
        let mirrored = place.reverse_bits() >> (usize::BITS - SIDE.trailing_zeros());
        if place < mirrored {
            row.swap(place, mirrored);
        }
    }
    let mut half = 1;
    while half < SIDE {
        for start in (0..SIDE).step_by(2 * half) {
            for k in 0..half {
                let even = row[start + k];
                let odd = row[start + k + half].times(roots[k * (SIDE / 2 / half)]);
                row[start + k] = even.plus(odd);
                row[start + k + half] = even.minus(odd);
            }
        }
        half *= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_transformed_row_is_the_sum_over_its_waves() {
        let mut stream = Stream::new(3, 0);
        let row: [Complex; SIDE] = std::array::from_fn(|_| Complex {
            re: f64::from(stream.normal()),
            im: f64::from(stream.normal()),
        });
        let root = |turns: usize| (-TAU * (turns % SIDE) as f64 / SIDE as f64).sin_cos();
        let roots: Vec<Complex> = (0..SIDE / 2).map(root).map(|(im, re)| Complex { re, im }).collect();
        let mut fast = row;
        transform_row(&mut fast, &roots);
        for (k, found) in fast.iter().enumerate() {
            let wanted = row.iter().enumerate().fold(Complex::default(), |sum, (place, value)| {
                let (im, re) = root(k * place);
                sum.plus(value.times(Complex { re, im }))
            });
            assert!((found.re - wanted.re).abs() + (found.im - wanted.im).abs() < 1e-10, "wave {k}");
        }
    }

    #[test]
    fn the_field_has_unit_size_no_divergence_and_repeats() {
        let field = Turbulence::new(4);
        let at = |x: usize, y: usize, z: usize| field.points[(x % 64 * 64 + y % 64) * 64 + z % 64];
        let mean_sq: f32 = field.points.iter().map(|it| it.length_squared()).sum::<f32>() / (3.0 * 262_144.0);
        assert!((mean_sq - 1.0).abs() < 1e-3);
        // Central differences see waves of low wave number well, and those carry nearly all of the field.
        let (mut divergence_sq, mut slope_sq) = (0.0, 0.0);
        for place in (0..262_144).step_by(7) {
            let (x, y, z) = (place / 4096 + 63, place / 64 % 64 + 63, place % 64 + 63);
            let dx = at(x + 2, y + 1, z + 1) - at(x, y + 1, z + 1);
            let dy = at(x + 1, y + 2, z + 1) - at(x + 1, y, z + 1);
            let dz = at(x + 1, y + 1, z + 2) - at(x + 1, y + 1, z);
            divergence_sq += (dx.x + dy.y + dz.z).powi(2);
            slope_sq += dx.x.powi(2) + dy.y.powi(2) + dz.z.powi(2);
        }
        assert!(divergence_sq < 0.05 * slope_sq, "divergence {divergence_sq}, slopes {slope_sq}");
        let point = Vec3::new(1.3, -2.7, 4.1);
        assert!(field.at(point, 5.0).distance(field.at(point + Vec3::new(5.0, -10.0, 5.0), 5.0)) < 1e-3);
    }
}
