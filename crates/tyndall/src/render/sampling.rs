//! Where in a pixel, and toward which part of a light, each sample goes.
//!
//! Points of the Sobol (0,2)-sequence, Owen-scrambled by hashing: any aligned run of 4^k points is stratified in a grid of
//! 2^k x 2^k, so that passes can stop anywhere and go on. Sources: Kollig and Keller 2002, Efficient Multidimensional Sampling;
//! Burley 2020, Practical Hash-based Owen Scrambling.

/// Pixels along the edge of the pattern in which samples repeat.
pub(super) const PATTERN: usize = 8;

/// Which samples of a picture a pass adds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Samples {
    pub(crate) seed: u32,
    /// The first one's number.
    pub(crate) first: u32,
    /// 16, 4 or 1 a pixel.
    pub(crate) count: u32,
    /// Whether they lie in the middle of their pixel.
    pub(crate) centered: bool,
}

impl Samples {
    /// Those that come after the first `done` of a picture with `all` samples a pixel; none if it has them.
    pub(super) fn after(done: u32, all: u32, seed: u32) -> Option<Self> {
        let samples = Self { seed, first: done, count: 16, centered: all == 1 };
        (done < all).then(|| samples.at_most(all - done))
    }

    /// The first of these, at most so many.
    pub(super) fn at_most(self, most: u32) -> Self {
        let count = match most.min(self.count) {
            ..4 => 1,
            4..16 => 4,
            _ => 16,
        };
        Self { count, ..self }
    }

    /// Where sample `sample` of these lies in a pixel, by the pixel's place in the pattern.
    pub(super) fn offset(&self, place: usize, sample: u32) -> [f32; 2] {
        if self.centered {
            return [0.5; 2];
        }
        point(self.seed, Dimension::Pixel, 1 + place as u32, self.first + sample)
    }
}

/// How near samples have come to the centers of their pixels, squared, by the pixel's place in the pattern.
#[derive(Clone)]
pub(super) struct Nearness([f32; PATTERN * PATTERN]);

impl Nearness {
    /// Without samples.
    pub(super) const NONE: Self = Self([f32::INFINITY; PATTERN * PATTERN]);

    /// Which of the samples that are added is nearer than all before, by the pixel's place in the pattern.
    pub(super) fn add(&mut self, samples: &Samples) -> [Option<u32>; PATTERN * PATTERN] {
        std::array::from_fn(|place| {
            let mut nearest = None;
            for sample in 0..samples.count {
                let [x, y] = samples.offset(place, sample);
                let center_sq = (x - 0.5).powi(2) + (y - 0.5).powi(2);
                if center_sq < self.0[place] {
                    (self.0[place], nearest) = (center_sq, Some(sample));
                }
            }
            nearest
        })
    }
}

/// Which random decision a sequence belongs to. Each has a scrambling of its own.
#[derive(Clone, Copy)]
pub(crate) enum Dimension {
    Pixel,
    Key,
    Sky,
    Lens,
}

/// Point `index` of the sequence for `dimension`, in [0, 1)^2; `stream` tells pixels apart.
pub(crate) fn point(seed: u32, dimension: Dimension, stream: u32, index: u32) -> [f32; 2] {
    let scramble = mix(seed ^ mix(stream.wrapping_mul(4) + dimension as u32));
    let x = owen(index.reverse_bits(), scramble);
    let y = owen(second_sobol(index), mix(scramble ^ 0x9e37_79b9));
    [unit(x), unit(y)]
}

/// Point `index` of a decision that is taken together with others: the points come in another order, shuffled within every aligned
/// run of 2^k. Without that the halves in which two decisions of a sample fall would always belong together.
pub(crate) fn shuffled_point(seed: u32, dimension: Dimension, stream: u32, index: u32) -> [f32; 2] {
    let shuffle = mix(!seed ^ mix(stream.wrapping_mul(4) + dimension as u32));
    point(seed, dimension, stream, owen(index, shuffle))
}

/// A number in [0, 1) for `index`, of a decision of its own for each `stream`. Any aligned run of 2^k indices has a number in every
/// 2^k-th part of the interval, in an order that streams do not share.
pub(crate) fn shuffled_number(seed: u32, stream: u32, index: u32) -> f32 {
    let scramble = mix(seed ^ mix(stream));
    unit(owen(owen(index, mix(!scramble)).reverse_bits(), scramble))
}

/// The second dimension of the Sobol sequence as a 32-bit fraction; the first is the reversed index.
fn second_sobol(mut index: u32) -> u32 {
    let (mut fraction, mut column) = (0, 1 << 31);
    while index != 0 {
        if index & 1 == 1 {
            fraction ^= column;
        }
        column ^= column >> 1;
        index >>= 1;
    }
    fraction
}

/// Flips each bit of `fraction` by a hash of the higher ones: nested uniform scrambling.
fn owen(fraction: u32, seed: u32) -> u32 {
    let mut x = fraction.reverse_bits();
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x.reverse_bits()
}

/// An integer hash with good avalanche (Wellons 2018, lowbias32).
fn mix(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// The fraction as a float in [0, 1).
fn unit(fraction: u32) -> f32 {
    (fraction >> 8) as f32 * (1.0 / 16_777_216.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_aligned_run_of_sixteen_is_stratified() {
        for seed in 0..50 {
            for first in [0, 16, 64, 1024] {
                let mut seen = [[false; 4]; 4];
                for index in first..first + 16 {
                    let [x, y] = point(seed, Dimension::Pixel, seed * 7, index);
                    assert!((0.0..1.0).contains(&x) && (0.0..1.0).contains(&y));
                    let stratum = &mut seen[(y * 4.0) as usize][(x * 4.0) as usize];
                    assert!(!*stratum, "seed {seed}, run from {first}");
                    *stratum = true;
                }
            }
        }
    }

    #[test]
    fn shuffled_dimensions_are_stratified_and_unrelated() {
        // Streams in which two decisions of sixteen samples fall into halves of their intervals that always belong together.
        let tied = |key: fn(u32, Dimension, u32, u32) -> [f32; 2]| {
            let is_tied = |stream: &u32| {
                let same = |index: &u32| {
                    let pixel = point(3, Dimension::Pixel, *stream, *index)[0] < 0.5;
                    pixel == (key(3, Dimension::Key, *stream, *index)[0] < 0.5)
                };
                [0, 16].contains(&(0..16).filter(same).count())
            };
            (0..200).filter(is_tied).count()
        };
        assert_eq!(tied(point), 200);
        assert!(tied(shuffled_point) < 10, "{}", tied(shuffled_point));
        for stream in 0..200 {
            let mut seen = [[false; 4]; 4];
            for index in 16..32 {
                let [x, y] = shuffled_point(3, Dimension::Key, stream, index);
                seen[(y * 4.0) as usize][(x * 4.0) as usize] = true;
            }
            assert_eq!(seen, [[true; 4]; 4], "stream {stream}");
        }
    }

    #[test]
    fn streams_and_dimensions_differ() {
        let here = point(1, Dimension::Pixel, 0, 5);
        assert_ne!(here, point(1, Dimension::Pixel, 1, 5));
        assert_ne!(here, point(1, Dimension::Key, 0, 5));
        assert_ne!(here, point(2, Dimension::Pixel, 0, 5));
    }
}
