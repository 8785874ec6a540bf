//! Samples until the noise is small enough, or the time is over.
//!
//! Rounds double the samples of a pixel. A film tile of 32 x 32 pixels whose picture has changed by less than is wanted since the round before has
//! enough; the others go on. The mean of twice as many samples differs from the mean of the first half by as much as it is itself likely to be off,
//! whatever the scene.

use super::{Culling, Renderer};
use crate::error::{Error, Result};
use crate::progress::Progress;

/// What a refined picture came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quality {
    /// Estimated root mean square error of a channel, as a share of white, of values as they are shown (square roots of linear ones).
    pub noise: f32,
    /// The fewest and the most samples of a pixel.
    pub samples: [u32; 2],
}

/// Samples of the first round.
const FIRST: u32 = 16;

/// A linear mean as it is shown.
pub(crate) fn shown(linear: [f32; 3]) -> [f32; 3] {
    linear.map(|channel| channel.clamp(0.0, 1.0).sqrt())
}

/// A part of a picture a round ago.
#[derive(Clone, Debug)]
pub(crate) struct Earlier {
    /// As it is shown; none before the first round.
    shown: Vec<[f32; 3]>,
    /// Mean square of the change in the last round; infinite before the second one.
    pub(crate) change_sq: f32,
}

impl Earlier {
    /// Before the first round.
    pub(crate) const NONE: Self = Self { shown: Vec::new(), change_sq: f32::INFINITY };

    /// Takes the part as it is `shown` after a round, in which the pixels that `counts` names count. Whether it has changed by less than `noise`.
    pub(crate) fn settle(
        &mut self,
        shown: Vec<[f32; 3]>,
        noise: f32,
        counts: impl Fn(usize) -> bool,
    ) -> bool {
        if !self.shown.is_empty() {
            let mut sum = 0.0_f32;
            let mut count = 0;
            for pixel in (0..shown.len()).filter(|&pixel| counts(pixel)) {
                let [now, before] = [shown[pixel], self.shown[pixel]];
                sum += now.iter().zip(before).map(|(now, before)| (now - before).powi(2)).sum::<f32>();
                count += 3;
            }
            self.change_sq = sum / count.max(1) as f32;
        }
        self.shown = shown;
        self.change_sq < noise * noise
    }
}

impl Renderer<'_> {
    /// Adds samples until no film tile has more than this noise, every pixel has all samples of the settings, or `is_late` says so, which is asked
    /// after each pass. Fails with [`Error::Setting`] with culling by confidence, and when interrupted, as [`Renderer::pass`] does.
    pub fn refine(
        &mut self,
        noise: f32,
        is_late: &mut dyn FnMut() -> bool,
        progress: &dyn Progress,
    ) -> Result<Quality> {
        if let Culling::Confidence(_) = self.settings.culling {
            return Err(Error::setting(
                "--culling",
                "confidence",
                "off or certified where noise is measured",
            ));
        }
        progress.begin("render", None, "samples");
        let mut is_over = false;
        while !is_over && !self.is_done() {
            let until = (2 * self.samples_done).max(FIRST);
            while self.samples_done < until && !is_over {
                let Some(pass) = self.next_pass(self.samples_done) else { break };
                self.add(vec![pass], progress)?;
                is_over = is_late();
            }
            is_over |= self.film.settle(noise);
        }
        Ok(self.film.quality())
    }
}
