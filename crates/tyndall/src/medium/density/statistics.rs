//! How many particles the samples of a density used: what tells a good choice of lengths from a bad one.
//!
//! Sums are whole numbers, so that the order in which threads add them does not matter.

/// Mean and deviation of the number of particles within the samples' lengths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Used {
    samples: u64,
    sum: u64,
    sum_sq: u128,
}

impl Used {
    /// Counts a sample that used `particles`.
    #[inline(always)]
    pub(super) fn add(&mut self, particles: u32) {
        self.samples += 1;
        self.sum += u64::from(particles);
        self.sum_sq += u128::from(particles) * u128::from(particles);
    }

    fn with(self, other: Self) -> Self {
        Self {
            samples: self.samples + other.samples,
            sum: self.sum + other.sum,
            sum_sq: self.sum_sq + other.sum_sq,
        }
    }

    /// How many samples there are.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Particles a sample, on average; 0 without samples.
    pub fn mean(&self) -> f64 {
        self.sum as f64 / self.samples.max(1) as f64
    }

    /// The standard deviation of that.
    pub fn deviation(&self) -> f64 {
        let mean_sq = self.sum_sq as f64 / self.samples.max(1) as f64;
        (mean_sq - self.mean().powi(2)).max(0.0).sqrt()
    }

    /// Deviation over mean; 0 without samples.
    pub fn ratio(&self) -> f64 {
        if self.sum == 0 { 0.0 } else { self.deviation() / self.mean() }
    }
}

/// The particles used by the samples of a grid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// By the samples with N0 > 0: at least one particle within h0.
    pub touched: Used,
    /// By those with N0 >= N*: no length can give the others N* particles.
    pub full: Used,
}

impl Statistics {
    /// Counts a sample with N0 = `whole`.
    #[inline(always)]
    pub(super) fn add(&mut self, whole: u32, used: u32, target: u32) {
        if whole > 0 {
            self.touched.add(used);
        }
        if whole >= target {
            self.full.add(used);
        }
    }

    /// Both together.
    pub(super) fn with(self, other: Self) -> Self {
        Self { touched: self.touched.with(other.touched), full: self.full.with(other.full) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_deviation_are_those_of_the_numbers() {
        let mut used = Used::default();
        assert_eq!((used.mean(), used.deviation(), used.ratio()), (0.0, 0.0, 0.0));
        [2, 4, 4, 4, 5, 5, 7, 9].into_iter().for_each(|it| used.add(it));
        assert_eq!((used.samples(), used.mean(), used.deviation(), used.ratio()), (8, 5.0, 2.0, 0.4));
        assert_eq!(used.with(Used::default()), used);
    }
}
