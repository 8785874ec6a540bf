//! Samples of a medium until the noise is small enough, or the time is over: as [`crate::render::refine`] of spheres.
//!
//! Rounds double the samples. A part of 32 x 32 pixels that has changed by less than is wanted since the round before has enough; the
//! others go on.

use super::Showing;
use super::film::Film;
use crate::error::Result;
use crate::progress::Progress;
use crate::render::refine::Quality;

/// When a picture of a medium has samples enough.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Goal {
    /// The most noise of a part of the picture, as [`Quality`] measures it; with 0 no part ever has enough.
    pub noise: f32,
    /// The most samples of a pixel.
    pub samples: u32,
    /// How the picture is shown.
    pub showing: Showing,
}

/// Samples of the first round.
const FIRST: u32 = 4;

/// A picture to which samples can be added.
pub(super) trait Gathering {
    fn film(&mut self) -> &mut Film;

    /// Adds a sample to every pixel that gets more.
    fn add(&mut self, progress: &dyn Progress) -> Result<()>;
}

/// Adds samples until the goal is reached, or `is_late` says so, which is asked after each pass.
pub(super) fn refine(
    picture: &mut impl Gathering,
    goal: &Goal,
    is_late: &mut dyn FnMut() -> bool,
    progress: &dyn Progress,
) -> Result<Quality> {
    let mut is_over = false;
    while !is_over && picture.film().samples_done < goal.samples {
        let until = (2 * picture.film().samples_done).max(FIRST).min(goal.samples);
        while picture.film().samples_done < until && !is_over {
            picture.add(progress)?;
            is_over = is_late();
        }
        is_over |= picture.film().settle(goal);
    }
    Ok(picture.film().quality())
}
