//! The periodic table of a noise: four components at samples on a lattice, looked up linearly between them.
//!
//! The fourth component is Perlin noise, and of that kind the first three are. Curl noise has in their place the curl of three other
//! Perlin noises: a field without divergence, so that what it displaces is neither gathered nor thinned out. Invariant: every component lies
//! within -1 and 1. Sources: K. Perlin, "Improving noise", SIGGRAPH 2002; R. Bridson, J. Houriham, M. Nordenstam, "Curl-noise for
//! procedural fluid flow", SIGGRAPH 2007.

use glam::{Vec3, Vec4};
use rayon::prelude::*;

use super::NoiseKind;
use crate::random::hash4;

/// Cells of the noise along an edge of the table: after so many the noise repeats.
pub(super) const CELLS: u32 = 16;
/// Samples of the table along a cell.
const FINENESS: u32 = 4;
/// Samples along an edge of the table.
const EDGE: u32 = CELLS * FINENESS;

/// A layer of a noise.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Table(Vec<Vec4>);

impl Table {
    pub(super) fn new(kind: NoiseKind, seed: u32) -> Self {
        let sample = |place: u32| {
            let [i, j, k] = [place % EDGE, place / EDGE % EDGE, place / (EDGE * EDGE)];
            let (value, slopes) = perlin(Vec3::new(i as f32, j as f32, k as f32) / FINENESS as f32, seed);
            match kind {
                NoiseKind::Perlin => value,
                NoiseKind::Curl => curl(slopes).extend(value.w),
            }
        };
        let mut samples: Vec<Vec4> =
            (0..EDGE.pow(3)).into_par_iter().with_min_len(4096).map(sample).collect();
        if kind == NoiseKind::Curl {
            let most = samples.iter().map(|it| it.truncate().abs().max_element()).fold(0.0, f32::max);
            samples.iter_mut().for_each(|it| *it = (it.truncate() / most).extend(it.w));
        }
        Self(samples)
    }

    /// The value at `place`, in units of the noise's cells.
    #[inline]
    pub(super) fn value(&self, place: Vec3) -> Vec4 {
        let place = place * FINENESS as f32;
        let floor = place.floor();
        let fraction = place - floor;
        let [i, j, k] = floor.as_ivec3().to_array().map(|it| (it as u32 % EDGE) as usize);
        let edge = EDGE as usize;
        let next = |it: usize| if it + 1 == edge { 0 } else { it + 1 };
        let (x, y, z) = ([i, next(i)], [edge * j, edge * next(j)], [edge * edge * k, edge * edge * next(k)]);
        let row = |y: usize, z: usize| {
            let (low, high) = (self.0[x[0] + y + z], self.0[x[1] + y + z]);
            low + fraction.x * (high - low)
        };
        let plane = |z: usize| {
            let (low, high) = (row(y[0], z), row(y[1], z));
            low + fraction.y * (high - low)
        };
        let (low, high) = (plane(z[0]), plane(z[1]));
        low + fraction.z * (high - low)
    }
}

/// The curl of the first three of four fields, of which these are the derivatives along x, y and z.
fn curl([x, y, z]: [Vec4; 3]) -> Vec3 {
    Vec3::new(y.z - z.y, z.x - x.z, x.y - y.x)
}

/// Four independent gradient noises, periodic after [`CELLS`], each within -1 and 1; and their derivatives along x, y and z.
fn perlin(place: Vec3, seed: u32) -> (Vec4, [Vec4; 3]) {
    let floor = place.floor();
    let fraction = place - floor;
    let cell = floor.as_uvec3();
    let fade = fraction * fraction * fraction * (fraction * (6.0 * fraction - 15.0) + 10.0);
    let steepness = 30.0 * fraction * fraction * (fraction * (fraction - 2.0) + 1.0);
    let (mut sum, mut slopes) = (Vec4::ZERO, [Vec4::ZERO; 3]);
    for corner in 0..8 {
        let step = glam::UVec3::new(corner & 1, corner >> 1 & 1, corner >> 2);
        let at = (cell + step) % CELLS;
        let gradients = hash4([at.x, at.y, at.z, seed]).map(gradient);
        let offset = fraction - step.as_vec3();
        let is_far = step.cmpeq(glam::UVec3::ONE);
        let near = Vec3::select(is_far, fade, 1.0 - fade);
        let rise = Vec3::select(is_far, steepness, -steepness);
        let weight = near.x * near.y * near.z;
        let rises = [rise.x * near.y * near.z, near.x * rise.y * near.z, near.x * near.y * rise.z];
        let value = Vec4::from_array(gradients.map(|it| it.dot(offset)));
        sum += weight * value;
        for (axis, (slope, rise)) in slopes.iter_mut().zip(rises).enumerate() {
            *slope += rise * value + weight * Vec4::from_array(gradients.map(|it| it[axis]));
        }
    }
    (sum, slopes)
}

/// A direction to one of the twelve edges of a cube.
fn gradient(word: u32) -> Vec3 {
    let sign = |bit: u32| if word >> bit & 1 == 0 { 1.0 } else { -1.0 };
    let (a, b) = (sign(8), sign(9));
    match (word >> 16) % 3 {
        0 => Vec3::new(a, b, 0.0),
        1 => Vec3::new(a, 0.0, b),
        _ => Vec3::new(0.0, a, b),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    #[test]
    fn the_table_is_the_noise_at_its_samples_and_periodic() {
        let table = Table::new(NoiseKind::Perlin, 3);
        for place in [Vec3::new(0.25, 3.5, 7.75), Vec3::new(15.75, 15.75, 0.5)] {
            let (wanted, _) = perlin(place, 3);
            for whole in [-2, 0, 5] {
                let shifted = place + (whole * CELLS as i32) as f32;
                assert!(table.value(shifted).abs_diff_eq(wanted, 1e-5), "{shifted}");
            }
        }
        assert_eq!(perlin(Vec3::new(3.0, 1.0, 2.0), 9).0, Vec4::ZERO);
    }

    #[test]
    fn slopes_are_those_of_differences() {
        let mut stream = Stream::new(4, 0);
        for _ in 0..200 {
            let place = 8.0 + 7.5 * stream.cube();
            let (_, slopes) = perlin(place, 5);
            for (axis, slope) in slopes.iter().enumerate() {
                let step = 5e-3 * Vec3::AXES[axis];
                let difference = (perlin(place + step, 5).0 - perlin(place - step, 5).0) / 1e-2;
                assert!(slope.abs_diff_eq(difference, 0.01), "{place}, axis {axis}: {slope} {difference}");
            }
        }
    }

    /// What a field of displacements gathers, beside how much it changes from place to place.
    fn divergence(table: &Table) -> f64 {
        let mut stream = Stream::new(6, 0);
        let (mut gathered, mut changed) = (0.0, 0.0);
        for _ in 0..2000 {
            let place = 16.0 * stream.cube();
            let along = |axis: usize| {
                let step = 0.25 * Vec3::AXES[axis];
                2.0 * (table.value(place + step) - table.value(place - step))
            };
            let [x, y, z] = [0, 1, 2].map(along);
            gathered += f64::from(x.x + y.y + z.z).powi(2);
            changed += [x, y, z].map(|it| f64::from(it.truncate().length_squared())).iter().sum::<f64>();
        }
        (gathered / changed).sqrt()
    }

    #[test]
    fn curl_noise_has_no_divergence_and_perlin_noise_has() {
        let [perlin, curl] = [NoiseKind::Perlin, NoiseKind::Curl].map(|kind| Table::new(kind, 7));
        let (of_perlin, of_curl) = (divergence(&perlin), divergence(&curl));
        assert!(of_perlin > 0.4 && of_curl < 0.1, "{of_perlin} {of_curl}");
        assert!(curl.0.iter().all(|it| it.abs().max_element() <= 1.0));
        assert!(perlin.0.iter().zip(&curl.0).all(|(perlin, curl)| perlin.w == curl.w));
    }
}
