//! Perlin noise from a table of four components: three displace the points at which a medium is looked up (position noise), the
//! fourth makes its density uneven (density noise).
//!
//! The table is periodic and computed once; a look-up is one trilinear interpolation an octave, for all four components. The
//! noise belongs to space, not to the grid or the camera, so that animations do not swim.
//! Sources: K. Perlin, "Improving noise", SIGGRAPH 2002; D. Cha, S. Son, I. Ihm, "GPU-assisted high quality particle
//! rendering", EGSR 2009 (the table of four components, the two kinds of noise).

use glam::{Vec3, Vec4};

use crate::error::{Error, Result};
use crate::random::hash4;

/// Cells of the noise along an edge of the table: after so many the noise repeats.
const CELLS: u32 = 16;
/// Samples of the table along a cell.
const FINENESS: u32 = 4;
/// Samples along an edge of the table.
const EDGE: u32 = CELLS * FINENESS;

/// How the noise looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseSettings {
    /// How far a point is displaced at most by the first octave, in units of `scale`; 0 to 10, 0 switches position noise off.
    pub position: f32,
    /// By which part of itself the density changes at most by the first octave; 0 to 10, 0 switches density noise off.
    pub density: f32,
    /// Layers, each twice as fine and half as strong as the one before; 1 to 8.
    pub octaves: u32,
    /// Size of the cells of the first octave, in units of length; above 0.
    pub scale: f32,
    /// Where the noise is anchored, as an offset from the particles' origin.
    pub anchor: Vec3,
    /// Another seed gives another noise.
    pub seed: u32,
}

/// A noise ready to be looked up.
#[derive(Clone, Debug)]
pub struct Noise {
    settings: NoiseSettings,
    table: Vec<Vec4>,
}

impl Noise {
    /// Fills the table. Fails with [`Error::Setting`] if a number is out of its range.
    pub fn new(settings: NoiseSettings) -> Result<Self> {
        let NoiseSettings { position, density, octaves, scale, anchor, seed } = settings;
        for amplitude in [position, density] {
            if !(0.0..=10.0).contains(&amplitude) {
                return Err(Error::setting("noise", amplitude, "an amplitude from 0 to 10"));
            }
        }
        if !(1..=8).contains(&octaves) {
            return Err(Error::setting("noise", octaves, "1 to 8 octaves"));
        }
        if !(scale > 0.0 && scale.is_finite() && anchor.is_finite()) {
            return Err(Error::setting("noise-scale", scale, "a length above 0"));
        }
        let sample = |place: u32| {
            let [i, j, k] = [place % EDGE, place / EDGE % EDGE, place / (EDGE * EDGE)];
            perlin(Vec3::new(i as f32, j as f32, k as f32) / FINENESS as f32, seed)
        };
        Ok(Self { settings, table: (0..EDGE.pow(3)).map(sample).collect() })
    }

    /// The knobs that it was made with.
    pub fn settings(&self) -> &NoiseSettings {
        &self.settings
    }

    /// How far points are displaced along an axis at most.
    pub fn reach(&self) -> f32 {
        2.0 * self.settings.position * self.settings.scale
    }

    /// Where a medium is looked up in place of `at`, and what its density there is multiplied with (at least 0, 1 on average but
    /// for the clipping).
    #[inline]
    pub fn disperse(&self, at: Vec3) -> (Vec3, f32) {
        let NoiseSettings { position, density, scale, .. } = self.settings;
        let noise = self.value(at);
        (at + position * scale * noise.truncate(), (1.0 + density * noise.w).max(0.0))
    }

    /// The sum of the octaves: each component within -2 and 2, 0 on average.
    #[inline]
    pub fn value(&self, at: Vec3) -> Vec4 {
        let mut place = (at - self.settings.anchor) / self.settings.scale;
        let mut weight = 1.0;
        let mut sum = Vec4::ZERO;
        for _ in 0..self.settings.octaves {
            sum += weight * self.octave(place);
            weight *= 0.5;
            // Not exactly 2: zeros of the octaves, which all have at the cells' corners, do not meet.
            place = 2.03 * place + Vec3::new(5.3, 1.7, 9.1);
        }
        sum
    }

    /// One layer, `place` in units of its cells.
    #[inline]
    fn octave(&self, place: Vec3) -> Vec4 {
        let place = place * FINENESS as f32;
        let floor = place.floor();
        let fraction = place - floor;
        let [i, j, k] = floor.as_ivec3().to_array().map(|it| (it as u32 % EDGE) as usize);
        let edge = EDGE as usize;
        let next = |it: usize| if it + 1 == edge { 0 } else { it + 1 };
        let (x, y, z) = ([i, next(i)], [edge * j, edge * next(j)], [edge * edge * k, edge * edge * next(k)]);
        let row = |y: usize, z: usize| {
            let (low, high) = (self.table[x[0] + y + z], self.table[x[1] + y + z]);
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

/// Four independent gradient noises, periodic after [`CELLS`]; each within -1 and 1.
fn perlin(place: Vec3, seed: u32) -> Vec4 {
    let floor = place.floor();
    let fraction = place - floor;
    let cell = floor.as_uvec3();
    let fade = fraction * fraction * fraction * (fraction * (6.0 * fraction - 15.0) + 10.0);
    let mut sum = Vec4::ZERO;
    for corner in 0..8 {
        let step = glam::UVec3::new(corner & 1, corner >> 1 & 1, corner >> 2);
        let at = (cell + step) % CELLS;
        let words = hash4([at.x, at.y, at.z, seed]);
        let offset = fraction - step.as_vec3();
        let near = Vec3::select(step.cmpeq(glam::UVec3::ONE), fade, 1.0 - fade);
        let weight = near.x * near.y * near.z;
        sum += weight * Vec4::from_array(words.map(|word| gradient(word).dot(offset)));
    }
    sum
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

    const SETTINGS: NoiseSettings = NoiseSettings {
        position: 0.5,
        density: 0.7,
        octaves: 3,
        scale: 2.0,
        anchor: Vec3::new(1.0, -2.0, 0.5),
        seed: 3,
    };

    fn mean_and_deviation(values: &[f32]) -> [f64; 2] {
        let count = values.len() as f64;
        let mean = values.iter().map(|&it| f64::from(it)).sum::<f64>() / count;
        let variance = values.iter().map(|&it| (f64::from(it) - mean).powi(2)).sum::<f64>() / count;
        [mean, variance.sqrt()]
    }

    #[test]
    fn each_component_is_zero_on_average_and_independent_of_the_others() {
        let noise = Noise::new(SETTINGS).unwrap();
        let mut stream = Stream::new(1, 0);
        let at: Vec<Vec4> = (0..100_000).map(|_| noise.value(1000.0 * stream.cube())).collect();
        for component in 0..4 {
            let [mean, deviation] =
                mean_and_deviation(&at.iter().map(|it| it[component]).collect::<Vec<_>>());
            assert!(mean.abs() < 0.02, "component {component}: {mean}");
            assert!((0.2..0.5).contains(&deviation), "component {component}: {deviation}");
            for other in 0..component {
                let product: f64 = at.iter().map(|it| f64::from(it[component] * it[other])).sum();
                assert!((product / 1e5).abs() < 0.01, "components {component} and {other}");
            }
            assert!(at.iter().all(|it| it[component].abs() <= 2.0));
        }
    }

    #[test]
    fn the_table_is_the_noise_at_its_samples_and_periodic() {
        let settings = NoiseSettings { octaves: 1, scale: 1.0, anchor: Vec3::ZERO, ..SETTINGS };
        let noise = Noise::new(settings).unwrap();
        for place in [Vec3::new(0.25, 3.5, 7.75), Vec3::new(15.75, 15.75, 0.5)] {
            let wanted = perlin(place, settings.seed);
            for whole in [-2, 0, 5] {
                let shifted = place + (whole * CELLS as i32) as f32;
                assert!(noise.value(shifted).abs_diff_eq(wanted, 1e-5), "{shifted}");
            }
        }
        assert_eq!(perlin(Vec3::new(3.0, 1.0, 2.0), 9), Vec4::ZERO);
    }

    #[test]
    fn noise_is_continuous_and_scales_with_its_cells() {
        let noise = Noise::new(SETTINGS).unwrap();
        let finer = Noise::new(NoiseSettings { scale: 1.0, ..SETTINGS }).unwrap();
        let mut stream = Stream::new(2, 0);
        for _ in 0..1000 {
            let at = 50.0 * stream.cube();
            let step = 1e-3 * stream.cube();
            assert!(noise.value(at).abs_diff_eq(noise.value(at + step), 0.03), "{at}");
            let offset = at - SETTINGS.anchor;
            let near = finer.value(SETTINGS.anchor + 0.5 * offset);
            assert!(noise.value(at).abs_diff_eq(near, 1e-3), "{at}");
        }
    }

    #[test]
    fn dispersed_densities_keep_their_mean_and_displacements_their_bound() {
        let noise = Noise::new(SETTINGS).unwrap();
        let mut stream = Stream::new(3, 0);
        let dispersed = (0..100_000).map(|_| {
            let at = 100.0 * stream.cube();
            let (moved, factor) = noise.disperse(at);
            assert!(moved.distance(at) <= 2.0 * 3_f32.sqrt() * 0.5 * 2.0 && factor >= 0.0);
            factor
        });
        let [mean, _] = mean_and_deviation(&dispersed.collect::<Vec<_>>());
        assert!((mean - 1.0).abs() < 0.02, "{mean}");
    }

    #[test]
    fn the_seed_decides_and_bad_settings_are_refused() {
        let values = |seed| Noise::new(NoiseSettings { seed, ..SETTINGS }).unwrap().table;
        assert_eq!(values(7), values(7));
        assert_ne!(values(7), values(8));
        for bad in [
            NoiseSettings { position: -0.1, ..SETTINGS },
            NoiseSettings { density: f32::NAN, ..SETTINGS },
            NoiseSettings { octaves: 0, ..SETTINGS },
            NoiseSettings { octaves: 9, ..SETTINGS },
            NoiseSettings { scale: 0.0, ..SETTINGS },
        ] {
            assert_eq!(Noise::new(bad).unwrap_err().code(), "setting");
        }
    }
}
