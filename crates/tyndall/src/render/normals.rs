//! What the surfaces in a pixel are like together, where they are smaller than the pixel.
//!
//! The first two moments of the normals say how bright the pixel is in any light without shadows, without its samples: along a direction
//! the normals' components are taken to be normally distributed. Sources: Olano and Baker 2010, LEAN Mapping (moments of
//! normals); Heitz, Dupuy, Crassin, Dachsbacher 2015, The SGGX Microflake Distribution (the matrix of second moments).

use glam::{Mat3, Vec3};

/// Moments of the normals and the mean color of what the samples of a pixel met.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NormalStatistics {
    /// Share of the samples that met something, 0 to 1.
    pub coverage: f32,
    /// Mean unit normal of those; shorter than 1 where normals differ.
    pub mean: Vec3,
    /// Mean of the products of two components of the normal: xx, yy, zz, xy, yz, zx.
    pub products: [f32; 6],
    /// Mean linear RGB.
    pub color: Vec3,
}

impl NormalStatistics {
    /// Adds a sample; sums, until [`Self::finish`].
    pub(crate) fn add(&mut self, normal: [f32; 3], color: [f32; 3]) {
        let [x, y, z] = normal;
        self.coverage += 1.0;
        self.mean += Vec3::from_array(normal);
        for (sum, product) in self.products.iter_mut().zip([x * x, y * y, z * z, x * y, y * z, z * x]) {
            *sum += product;
        }
        self.color += Vec3::from_array(color);
    }

    /// Turns sums into means, of `samples` samples.
    pub(crate) fn finish(&mut self, samples: usize) {
        if self.coverage > 0.0 {
            let inverse = 1.0 / self.coverage;
            self.mean *= inverse;
            self.products = self.products.map(|sum| sum * inverse);
            self.color *= inverse;
            self.coverage /= samples as f32;
        }
    }

    /// The mean over the surfaces of the cosine to the unit direction `toward`, counted as zero where they face away: how bright a
    /// white pixel is in a light from there.
    pub fn cosine(&self, toward: Vec3) -> f32 {
        let [xx, yy, zz, xy, yz, zx] = self.products;
        let products = Mat3::from_cols_array(&[xx, xy, zx, xy, yy, yz, zx, yz, zz]);
        let mean = self.mean.dot(toward);
        let deviation = (toward.dot(products * toward) - mean * mean).max(0.0).sqrt();
        if deviation < 1e-4 {
            return mean.max(0.0);
        }
        let at = mean / deviation;
        let density = (-0.5 * at * at).exp() / std::f32::consts::TAU.sqrt();
        (mean * normal_probability(at) + deviation * density).max(0.0)
    }
}

/// The probability that a standard normal variable is below `x`; Abramowitz and Stegun 26.2.17, off by at most 1e-6 here.
fn normal_probability(x: f32) -> f32 {
    let t = 1.0 / (1.0 + 0.231_641_9 * x.abs());
    let series = [1.330_274_4, -1.821_255_98, 1.781_477_9, -0.356_563_78, 0.319_381_53];
    let tail = series.iter().fold(0.0, |sum, factor| (sum + factor) * t) * (-0.5 * x * x).exp()
        / std::f32::consts::TAU.sqrt();
    if x < 0.0 { tail } else { 1.0 - tail }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probabilities_are_those_of_the_tables() {
        for (x, expected) in [(0.0, 0.5), (1.0, 0.841_344_7), (-1.0, 0.158_655_3), (2.5, 0.993_790_3)] {
            assert!((normal_probability(x) - expected).abs() < 2e-6, "{x}: {}", normal_probability(x));
        }
    }

    #[test]
    fn a_plane_is_as_bright_as_its_cosine() {
        let mut statistics = NormalStatistics::default();
        (0..4).for_each(|_| statistics.add([0.0, 0.6, 0.8], [0.5; 3]));
        statistics.finish(8);
        assert_eq!((statistics.coverage, statistics.color), (0.5, Vec3::splat(0.5)));
        assert!((statistics.cosine(Vec3::Z) - 0.8).abs() < 1e-3);
        assert!(statistics.cosine(Vec3::NEG_Z) < 1e-3);
    }

    #[test]
    fn a_sphere_smaller_than_a_pixel_is_nearly_as_bright_as_its_visible_half() {
        // Normals of a sphere seen from z: uniform over the disc.
        let mut statistics = NormalStatistics::default();
        let mut normals = Vec::new();
        for at in 0..100 * 100 {
            let (x, y) = ((at % 100) as f32 / 50.0 - 0.99, (at / 100) as f32 / 50.0 - 0.99);
            if x * x + y * y < 1.0 {
                normals.push(Vec3::new(x, y, (1.0 - x * x - y * y).sqrt()));
            }
        }
        normals.iter().for_each(|normal| statistics.add(normal.to_array(), [1.0; 3]));
        statistics.finish(normals.len());
        for toward in [Vec3::Z, Vec3::X, Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.0, 0.8, -0.6)] {
            let exact =
                normals.iter().map(|normal| normal.dot(toward).max(0.0)).sum::<f32>() / normals.len() as f32;
            assert!((statistics.cosine(toward) - exact).abs() < 0.02, "{toward}: {exact}");
        }
    }
}
