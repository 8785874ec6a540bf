//! How long the smoothing length of a sample is: the predictor and the corrector.
//!
//! Takes how many particles lie within some lengths of a point, gives the length that should hold N* of them. Invariant: a
//! bracket holds fewer than N* within its lower length and at least N* within its upper one, so that no length exceeds h0.
//!
//! Source: D. Cha, S. Son, I. Ihm, "GPU-assisted high quality particle rendering", EGSR 2009. Between two lengths the particles
//! are taken to be even, so that their number is linear in h^3. On the bracket from 0 to h0 this is the paper's prediction,
//! h1^3 = h0^3 N* / N0; with N1 < N* it is its case 1 on the bracket from h1 to h0, and with N1 > N* its case 2 on the bracket from
//! 0 to h1, there with the factor alpha. More passes are the same on the tightest bracket known.

/// A length and how many particles lie within it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Held {
    /// The length's cube.
    pub(super) cubed: f32,
    /// How many particles.
    pub(super) count: f32,
}

/// Two lengths between which N* particles are reached.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Bracket {
    /// Fewer than N*.
    pub(super) low: Held,
    /// At least N*.
    pub(super) high: Held,
}

impl Bracket {
    /// From 0 to the length within which more than N* were found.
    pub(super) fn below(high: Held) -> Self {
        Self { low: Held::default(), high }
    }

    /// The cube of the length that should hold `target` particles.
    pub(super) fn interpolate(&self, target: f32) -> f32 {
        let Self { low, high } = *self;
        let share = (target - low.count) / (high.count - low.count);
        low.cubed + share * (high.cubed - low.cubed)
    }

    /// The tighter bracket after `held` was counted.
    pub(super) fn narrowed(self, held: Held, target: f32) -> Self {
        if held.count < target { Self { low: held, ..self } } else { Self { high: held, ..self } }
    }
}

/// The paper's factor for a length that held too many: alpha = 1 - s N1 / N0.
pub(super) fn alpha(scale: f32, n1: f32, n0: f32) -> f32 {
    1.0 - scale * n1 / n0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The worked examples of the analytic table: N0, N1, s, h1, h*; h0 = 0.96, N* = 32.
    const EXAMPLES: [(f32, f32, f32, f32, f32); 6] = [
        (1000.0, 20.0, 0.1, 0.304_781, 0.338_535_75),
        (1000.0, 32.0, 0.1, 0.304_781, 0.304_781),
        (1000.0, 50.0, 0.1, 0.304_781, 0.261_339_04),
        (1000.0, 50.0, 0.0, 0.304_781, 0.262_652_3),
        (40.0, 40.0, 0.1, 0.891_185_06, 0.744_572_6),
        (40.0, 10.0, 0.1, 0.891_185_06, 0.942_620_6),
    ];

    #[test]
    fn lengths_are_those_of_the_worked_examples() {
        for (n0, n1, scale, h1, wanted) in EXAMPLES {
            let whole = Bracket::below(Held { cubed: 0.96_f32.powi(3), count: n0 });
            let first = whole.interpolate(32.0);
            assert!((first.cbrt() - h1).abs() < 1e-6, "{} for {h1}", first.cbrt());
            let factor = if n1 > 32.0 { alpha(scale, n1, n0) } else { 1.0 };
            let bracket = whole.narrowed(Held { cubed: first, count: n1 }, 32.0);
            let found = factor * bracket.interpolate(32.0).cbrt();
            assert!((found - wanted).abs() < 1e-6, "N0 {n0}, N1 {n1}: {found} for {wanted}");
        }
    }

    #[test]
    fn brackets_stay_brackets() {
        let whole = Bracket::below(Held { cubed: 1.0, count: 200.0 });
        let tight = whole.narrowed(Held { cubed: 0.3, count: 10.0 }, 64.0);
        let tight = tight.narrowed(Held { cubed: 0.6, count: 80.0 }, 64.0);
        assert_eq!((tight.low.cubed, tight.high.cubed), (0.3, 0.6));
        let found = tight.interpolate(64.0);
        assert!(0.3 < found && found < 0.6);
    }
}
