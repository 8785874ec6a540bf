//! The integral of the Gaussian from a table, for the shares of a particle in voxels and for the acceptance probability.

/// Steps of the table.
pub(crate) const STEPS: usize = 512;

/// Integral of the standard normal density over [-limit, z], divided by that over [-limit, limit].
pub(crate) struct GaussianIntegral {
    limit: f32,
    values: [f32; STEPS + 1],
}

impl GaussianIntegral {
    /// The table for a density that is cut off at `limit` standard deviations.
    pub(crate) fn new(limit: f32) -> Self {
        // Simpson's rule in each step: its error is far below f32.
        let width = 2.0 * f64::from(limit) / STEPS as f64;
        let density = |z: f64| (-0.5 * z * z).exp();
        let mut sums = [0.0_f64; STEPS + 1];
        for step in 0..STEPS {
            let low = -f64::from(limit) + step as f64 * width;
            let piece = density(low) + 4.0 * density(low + 0.5 * width) + density(low + width);
            sums[step + 1] = sums[step] + piece;
        }
        let total = sums[STEPS];
        Self { limit, values: sums.map(|sum| (sum / total) as f32) }
    }

    /// Where the table ends, in standard deviations.
    #[cfg(feature = "gpu")]
    pub(crate) fn limit(&self) -> f32 {
        self.limit
    }

    /// The table: its values at even steps from one end to the other.
    #[cfg(feature = "gpu")]
    pub(crate) fn values(&self) -> &[f32; STEPS + 1] {
        &self.values
    }

    /// Its value at `z`: 0 below -limit, 1 above limit, linear between the table's entries.
    #[inline(always)]
    pub(crate) fn at(&self, z: f32) -> f32 {
        let place = (z + self.limit) * (STEPS as f32 / (2.0 * self.limit));
        if place.is_nan() || place <= 0.0 {
            return 0.0;
        }
        if place >= STEPS as f32 {
            return 1.0;
        }
        let step = place as usize;
        let along = place - step as f32;
        self.values[step] + (self.values[step + 1] - self.values[step]) * along
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values_of_the_normal_distribution() {
        let table = GaussianIntegral::new(5.0);
        for (z, expected) in
            [(-6.0, 0.0), (-1.959_964, 0.025), (0.0, 0.5), (0.674_49, 0.75), (2.326_348, 0.99), (6.0, 1.0)]
        {
            assert!((table.at(z) - expected).abs() < 2e-5, "{z}: {}", table.at(z));
        }
        assert_eq!(table.at(f32::NAN), 0.0);
    }
}
