//! The depth-confidence pairs of a pixel, and what a sample makes of them (Walloner 2022, sections 2.3 and 5.3).
//!
//! A sample is any particle that a ray enters, not only the first (section 4.1). Two pairs are kept: the accumulation buffer
//! follows nearer depths where that is likely to pay off, the cull buffer keeps the best so far (algorithm 2.1).

use super::Population;
use super::gaussian::GaussianIntegral;
use super::histogram::Histogram;

/// A depth, and how sure it is that all behind it is hidden.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Estimate {
    /// Distance along the rays, d.
    pub(crate) depth: f32,
    /// Probability that a ray meets a particle up to there, C.
    pub(crate) confidence: f32,
    /// Number k of the next sample.
    pub(crate) next: u32,
    /// Different particles that the samples so far are expected to have met, E(n(k-1)).
    pub(crate) unique: f32,
}

impl Estimate {
    /// Before any sample.
    pub(crate) const NONE: Self = Self { depth: f32::INFINITY, confidence: 0.0, next: 1, unique: 0.0 };

    /// After one sample. The thesis resets to k = 1 and E(n(k-1)) = 0, by which the next sample counts as the first, although
    /// the confidence holds that one already; here the next sample is the second.
    fn first(depth: f32, share: f32) -> Self {
        Self { depth, confidence: share, next: 2, unique: 1.0 }
    }

    /// Adds a sample in front of the depth (equations 5.1 and 5.4).
    pub(crate) fn accumulate(&mut self, share: f32, population: f32) {
        let unique = expected_unique(population, self.next);
        // Where the population shrank by a cut, fewer are expected than before: then there is nothing new.
        let new = (unique - self.unique).max(0.0);
        self.confidence = covered(self.confidence, share, new);
        self.next = self.next.saturating_add(1);
        self.unique = unique;
    }

    /// Particles that a cut at this depth is expected to save, OP (equation 2.2).
    fn occluded(&self, histogram: &Histogram) -> f32 {
        histogram.behind(self.depth) * self.confidence
    }
}

/// Different particles expected after `samples` draws with replacement from `population`, E(n(k)) = (1 - M^k) / (1 - M) with
/// M = 1 - 1/N (equation 5.1); without cancellation. The population is at least 1.
pub(crate) fn expected_unique(population: f32, samples: u32) -> f32 {
    -population * (samples as f32 * (-1.0 / population).ln_1p()).exp_m1()
}

/// Confidence after `new` more particles that each cover `share` of the pixel, 1 - (1 - C)(1 - a)^n (equation 5.4); without
/// cancellation.
pub(crate) fn covered(confidence: f32, share: f32, new: f32) -> f32 {
    confidence - (1.0 - confidence) * (new * (-share).ln_1p()).exp_m1()
}

/// What a pixel knows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pixel {
    /// The accumulation buffer.
    pub(crate) accumulation: Estimate,
    /// The cull buffer.
    pub(crate) cull: Estimate,
    /// The depth d_max behind which nothing is traced.
    pub(crate) clip: f32,
    /// Samples since that depth changed.
    pub(crate) unchanged: u32,
}

impl Pixel {
    /// Before any sample.
    pub(crate) const NEW: Self =
        Self { accumulation: Estimate::NONE, cull: Estimate::NONE, clip: f32::INFINITY, unchanged: 0 };
}

/// What the samples of a frame have in common.
pub(crate) struct Accumulator {
    integral: GaussianIntegral,
    sample_budget: u32,
    population: Population,
}

/// Standard deviations at which the acceptance probability's table ends.
const NORMAL_LIMIT: f32 = 5.0;

impl Accumulator {
    pub(crate) fn new(sample_budget: u32, population: Population) -> Self {
        Self { integral: GaussianIntegral::new(NORMAL_LIMIT), sample_budget, population }
    }

    /// The integral from which the acceptance probability is taken.
    #[cfg(feature = "gpu")]
    pub(crate) fn integral(&self) -> &GaussianIntegral {
        &self.integral
    }

    /// The particles that samples up to `depth` are drawn from, N; at least the one that asks.
    fn population(&self, histogram: &Histogram, depth: f32) -> f32 {
        let population = match self.population {
            Population::Frustum => histogram.total(),
            Population::UpToDepth => histogram.before(depth),
        };
        population.max(1.0)
    }

    /// One iteration of algorithm 2.1: a particle that covers `share` of the pixel was met at `depth`. `chance` is a random number
    /// in [0, 1).
    pub(crate) fn add(
        &self,
        pixel: &mut Pixel,
        histogram: &Histogram,
        depth: f32,
        share: f32,
        chance: impl FnOnce() -> f32,
    ) {
        if depth <= pixel.cull.depth {
            pixel.cull.accumulate(share, self.population(histogram, pixel.cull.depth));
        }
        if depth <= pixel.accumulation.depth {
            if depth < pixel.accumulation.depth
                && chance() < self.acceptance(&pixel.accumulation, histogram, depth, share)
            {
                pixel.accumulation = Estimate::first(depth, share);
            } else {
                let population = self.population(histogram, pixel.accumulation.depth);
                pixel.accumulation.accumulate(share, population);
            }
        }
        if pixel.cull.occluded(histogram) < pixel.accumulation.occluded(histogram) {
            pixel.cull = pixel.accumulation;
        }
    }

    /// The probability that the nearer `depth` will save more than `current` within the budget of samples (section 5.3.2).
    ///
    /// It must reach the confidence C with C D(depth, d_max) = OP(current); that takes k samples by equations 5.1 and 5.4. The
    /// sample that asks is one of them, so that k - 1 of those to come must be as near, each with probability p of equation 5.6.
    pub(crate) fn acceptance(
        &self,
        current: &Estimate,
        histogram: &Histogram,
        depth: f32,
        share: f32,
    ) -> f32 {
        let behind = histogram.behind(depth);
        let total = histogram.total();
        if !(behind > 0.0 && total > 0.0) {
            return 0.0;
        }
        let wanted = current.occluded(histogram) / behind;
        let population = self.population(histogram, depth);
        let Some(samples) = samples_needed(wanted, share, population) else { return 0.0 };
        self.at_least(samples.saturating_sub(1), histogram.before(depth) / total)
    }

    /// The probability of at least `wanted` successes of probability `p` in the budget of samples (equation 5.5), by the normal
    /// distribution of the same mean and variance, with continuity correction.
    pub(crate) fn at_least(&self, wanted: u32, p: f32) -> f32 {
        let trials = self.sample_budget as f32;
        if wanted == 0 {
            return 1.0;
        }
        if wanted > self.sample_budget {
            return 0.0;
        }
        let deviation = (trials * p * (1.0 - p)).max(0.0).sqrt();
        let below = wanted as f32 - 0.5 - trials * p;
        // All samples are alike: as many succeed as there are, or none.
        if deviation < 1e-6 {
            return if below < 0.0 { 1.0 } else { 0.0 };
        }
        self.integral.at(-below / deviation)
    }
}

/// Samples that it takes to reach a confidence above `wanted` with particles of that `share`, drawn from `population`: equations 5.1
/// and 5.4 solved for k. None if no number of samples does.
pub(crate) fn samples_needed(wanted: f32, share: f32, population: f32) -> Option<u32> {
    if wanted < share {
        return Some(1);
    }
    let unique = (-wanted).ln_1p() / (-share).ln_1p();
    if unique.is_nan() || unique >= population {
        return None;
    }
    let samples = (-unique / population).ln_1p() / (-1.0 / population).ln_1p();
    Some((samples.floor() + 1.0) as u32)
}
