//! Random numbers as a pure function of integers: no state is shared, so no result depends on the number of threads.
//!
//! Three things: [`hash4`], four 32-bit words to four words, for pixels, passes and photons (it has a twin on the GPU);
//! [`hash`] with [`uniform`], 64 bits, for a few numbers a particle; and [`Stream`], a short sequence of its own for every
//! key, for generators that draw an unknown number of times.
//!
//! Sources: M. Jarzynski, M. Olano, "Hash functions for GPU rendering", JCGT 9(3), 2020 (`pcg4d`); G. Steele, D. Lea,
//! C. Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014 (`splitmix64`); G. Box, M. Muller, 1958.

use std::f32::consts::TAU;

use glam::{Quat, Vec3};

/// Four words that depend on all bits of `key`, for example (x, y, pass, dimension).
///
/// The function `pcg4d` of Jarzynski and Olano 2020.
#[inline(always)]
pub fn hash4(key: [u32; 4]) -> [u32; 4] {
    let [mut x, mut y, mut z, mut w] =
        key.map(|word| word.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
    for round in 0..2 {
        x = x.wrapping_add(y.wrapping_mul(w));
        y = y.wrapping_add(z.wrapping_mul(x));
        z = z.wrapping_add(x.wrapping_mul(y));
        w = w.wrapping_add(y.wrapping_mul(z));
        if round == 0 {
            [x, y, z, w] = [x, y, z, w].map(|word| word ^ (word >> 16));
        }
    }
    [x, y, z, w]
}

/// A word as a number in `[0, 1)`: its upper 24 bits, so that every value is a float exactly.
#[inline(always)]
pub fn unit_f32(word: u32) -> f32 {
    (word >> 8) as f32 * (1.0 / (1u32 << 24) as f32)
}

/// A 64-bit word as a number in `[0, 1)`: its upper 53 bits.
#[inline(always)]
pub fn unit_f64(word: u64) -> f64 {
    (word >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
}

/// Step of the sequence of `splitmix64`: 2^64 over the golden ratio, odd.
const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// The finishing function of `splitmix64`: a permutation of the 64-bit words.
#[inline(always)]
fn mix(mut word: u64) -> u64 {
    word = (word ^ (word >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    word = (word ^ (word >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    word ^ (word >> 31)
}

/// A word that depends on all bits of the three arguments.
#[inline(always)]
pub fn hash(seed: u64, counter: u64, dimension: u32) -> u64 {
    let seeded = mix(seed.wrapping_add(GOLDEN)).wrapping_add(counter);
    mix(mix(seeded.wrapping_mul(GOLDEN)).wrapping_add(GOLDEN.wrapping_mul(u64::from(dimension) + 1)))
}

/// Number `dimension` of item `counter`: uniform in `[0, 1)`, 24 bits.
#[inline(always)]
pub fn uniform(seed: u64, counter: u64, dimension: u32) -> f32 {
    unit_f32((hash(seed, counter, dimension) >> 32) as u32)
}

/// Number `dimension` of item `counter`: uniform in `[0, 1)`, 53 bits.
#[inline(always)]
pub fn uniform_f64(seed: u64, counter: u64, dimension: u32) -> f64 {
    unit_f64(hash(seed, counter, dimension))
}

/// Two independent normal numbers (mean 0, variance 1) of two words, by Box and Muller; at most 5.8 in size.
#[inline(always)]
pub fn normal_pair(words: [u32; 2]) -> [f32; 2] {
    // 1 - u lies in (0, 1], where the logarithm is finite.
    let radius = (-2.0 * (1.0 - unit_f32(words[0])).ln()).sqrt();
    let (sin, cos) = (TAU * unit_f32(words[1])).sin_cos();
    [radius * cos, radius * sin]
}

/// A sequence of random numbers that belongs to a (seed, number): different keys give unrelated sequences.
///
/// Making one costs no more than drawing from it, so that every particle can have its own.
#[derive(Clone, Debug)]
pub struct Stream {
    state: u64,
}

impl Stream {
    /// The sequence of item `number`, from its start.
    #[inline(always)]
    pub fn new(seed: u64, number: u64) -> Self {
        Self { state: hash(seed, number, 0) }
    }

    /// The next 64 bits.
    #[inline(always)]
    pub fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(GOLDEN);
        mix(self.state)
    }

    /// Uniform in `[0, 1)`, 24 bits.
    #[inline(always)]
    pub fn unit(&mut self) -> f32 {
        unit_f32((self.bits() >> 32) as u32)
    }

    /// Uniform in `[0, 1)`, 53 bits.
    #[inline(always)]
    pub fn unit_f64(&mut self) -> f64 {
        unit_f64(self.bits())
    }

    /// Uniform from `low` to `high`.
    #[inline(always)]
    pub fn range(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// A whole number below `count`; 0 if `count` is 0. Its bias is below `count` / 2^64.
    #[inline(always)]
    pub fn below(&mut self, count: usize) -> usize {
        ((u128::from(self.bits()) * count as u128) >> 64) as usize
    }

    /// Two independent normal numbers, mean 0 and variance 1.
    #[inline(always)]
    pub fn normals(&mut self) -> [f32; 2] {
        let bits = self.bits();
        normal_pair([(bits >> 32) as u32, bits as u32])
    }

    /// A normal number, mean 0 and variance 1.
    #[inline(always)]
    pub fn normal(&mut self) -> f32 {
        self.normals()[0]
    }

    /// Three independent normal numbers, mean 0 and variance 1 each.
    #[inline(always)]
    pub fn normal3(&mut self) -> Vec3 {
        let [x, y] = self.normals();
        Vec3::new(x, y, self.normal())
    }

    /// A point uniform in the cube from -1 to 1.
    #[inline(always)]
    pub fn cube(&mut self) -> Vec3 {
        2.0 * Vec3::new(self.unit(), self.unit(), self.unit()) - 1.0
    }

    /// A direction uniform on the sphere.
    #[inline(always)]
    pub fn direction(&mut self) -> Vec3 {
        let z = self.range(-1.0, 1.0);
        let (sin, cos) = (TAU * self.unit()).sin_cos();
        let across = (1.0 - z * z).max(0.0).sqrt();
        Vec3::new(across * cos, across * sin, z)
    }

    /// A rotation, uniform over all of them.
    pub fn rotation(&mut self) -> Quat {
        let ([x, y], [z, w]) = (self.normals(), self.normals());
        let length = (x * x + y * y + z * z + w * w).sqrt();
        if length > 0.0 {
            Quat::from_xyzw(x / length, y / length, z / length, w / length)
        } else {
            Quat::IDENTITY
        }
    }

    /// A Gamma-distributed number of whole `shape` and scale 1: mean and variance are `shape`.
    pub fn gamma(&mut self, shape: u32) -> f32 {
        (0..shape).map(|_| -(1.0 - self.unit()).ln()).sum()
    }

    /// A number from `low` to `high` whose probability density falls as its power `-exponent` (other than 1).
    pub fn power_law(&mut self, low: f64, high: f64, exponent: f64) -> f64 {
        let power = 1.0 - exponent;
        let (a, b) = (low.powf(power), high.powf(power));
        (a + (b - a) * self.unit_f64()).powf(1.0 / power).clamp(low, high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COUNT: usize = 200_000;

    /// Mean, variance, and correlation with the number before.
    fn moments(numbers: &[f32]) -> [f64; 3] {
        let count = numbers.len() as f64;
        let mean = numbers.iter().map(|&it| f64::from(it)).sum::<f64>() / count;
        let variance = numbers.iter().map(|&it| (f64::from(it) - mean).powi(2)).sum::<f64>() / count;
        let product = |pair: &[f32]| (f64::from(pair[0]) - mean) * (f64::from(pair[1]) - mean);
        let correlation = numbers.windows(2).map(product).sum::<f64>() / count / variance;
        [mean, variance, correlation]
    }

    fn is_uniform(numbers: &[f32]) -> bool {
        let [mean, variance, correlation] = moments(numbers);
        let inside = numbers.iter().all(|it| (0.0..1.0).contains(it));
        // Four standard deviations of each estimate.
        let scale = 4.0 / (numbers.len() as f64).sqrt();
        inside
            && (mean - 0.5).abs() < scale * 0.289
            && (variance - 1.0 / 12.0).abs() < scale * 0.075
            && correlation.abs() < scale
    }

    #[test]
    fn neighboring_counters_give_unrelated_uniform_numbers() {
        for word in 0..4 {
            let by_x: Vec<f32> = (0..COUNT).map(|k| unit_f32(hash4([k as u32, 3, 5, 7])[word])).collect();
            let by_w: Vec<f32> = (0..COUNT).map(|k| unit_f32(hash4([3, 5, 7, k as u32])[word])).collect();
            assert!(is_uniform(&by_x) && is_uniform(&by_w), "word {word}");
        }
        for seed in [0, 1, u64::MAX] {
            let by_counter: Vec<f32> = (0..COUNT).map(|k| uniform(seed, k as u64, 0)).collect();
            let by_dimension: Vec<f32> = (0..COUNT).map(|k| uniform(seed, 9, k as u32)).collect();
            let by_seed: Vec<f32> = (0..COUNT).map(|k| uniform(k as u64, seed, 0)).collect();
            let first: Vec<f32> = (0..COUNT).map(|k| Stream::new(seed, k as u64).unit()).collect();
            let mut stream = Stream::new(seed, 0);
            let sequence: Vec<f32> = (0..COUNT).map(|_| stream.unit()).collect();
            for numbers in [by_counter, by_dimension, by_seed, first, sequence] {
                assert!(is_uniform(&numbers), "seed {seed}: {:?}", moments(&numbers));
            }
        }
    }

    #[test]
    fn the_check_for_uniform_numbers_finds_bad_ones() {
        let counting: Vec<f32> = (0..COUNT).map(|k| k as f32 / COUNT as f32).collect();
        assert!(!is_uniform(&counting));
        let squeezed: Vec<f32> = (0..COUNT).map(|k| 0.01 + 0.98 * uniform(1, k as u64, 0)).collect();
        assert!(!is_uniform(&squeezed));
    }

    #[test]
    fn normal_numbers_have_mean_zero_and_variance_one() {
        let mut stream = Stream::new(5, 0);
        let numbers: Vec<f32> = (0..COUNT / 2).flat_map(|_| stream.normals()).collect();
        let [mean, variance, correlation] = moments(&numbers);
        assert!(mean.abs() < 0.01 && (variance - 1.0).abs() < 0.015 && correlation.abs() < 0.01);
        assert!(numbers.iter().all(|it| it.abs() < 5.9));
        assert!(normal_pair([u32::MAX, 0])[0].is_finite());
    }

    #[test]
    fn drawn_distributions_have_their_means() {
        let mut stream = Stream::new(6, 0);
        let mean = |draw: &mut dyn FnMut() -> f64| (0..COUNT).map(|_| draw()).sum::<f64>() / COUNT as f64;
        assert!((mean(&mut || f64::from(stream.gamma(2))) - 2.0).abs() < 0.02);
        assert!((mean(&mut || stream.below(7) as f64) - 3.0).abs() < 0.03);
        // The mean of x^-2 over 1..100: ln(100) / (1 - 1/100).
        assert!((mean(&mut || stream.power_law(1.0, 100.0, 2.0)) - 4.652).abs() < 0.1);
        assert!(mean(&mut || f64::from(stream.direction().z)).abs() < 0.01);
        assert!((stream.rotation().length() - 1.0).abs() < 1e-5);
        assert_eq!(stream.below(0), 0);
    }

    #[test]
    fn known_values_stay() {
        assert_eq!(hash4([0, 0, 0, 0]), pcg4d_by_hand([0, 0, 0, 0]));
        assert_eq!(hash4([1, 2, 3, 4]), pcg4d_by_hand([1, 2, 3, 4]));
        assert_eq!(hash4([0, 0, 0, 0]), HASH4_ZERO);
        // The first output of splitmix64 from state 0, as in its published test vectors.
        assert_eq!(mix(GOLDEN), 0xe220_a839_7b1d_cdaf);
        assert_eq!(hash(1, 2, 3), HASH_123);
        assert_eq!((unit_f32(0), unit_f32(u32::MAX)), (0.0, 1.0 - 2f32.powi(-24)));
        assert!(unit_f64(u64::MAX) < 1.0);
    }

    const HASH4_ZERO: [u32; 4] = [251_852_841, 760_645_481, 850_445_371, 3_542_436_074];
    const HASH_123: u64 = 17_658_900_759_522_130_178;

    /// The paper's listing, line by line.
    fn pcg4d_by_hand(key: [u32; 4]) -> [u32; 4] {
        let mut v = key
            .map(|it| std::num::Wrapping(it) * std::num::Wrapping(1664525) + std::num::Wrapping(1013904223));
        v[0] += v[1] * v[3];
        v[1] += v[2] * v[0];
        v[2] += v[0] * v[1];
        v[3] += v[1] * v[2];
        v.iter_mut().for_each(|it| *it ^= *it >> 16);
        v[0] += v[1] * v[3];
        v[1] += v[2] * v[0];
        v[2] += v[0] * v[1];
        v[3] += v[1] * v[2];
        v.map(|it| it.0)
    }
}
