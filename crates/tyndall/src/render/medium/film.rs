//! What the samples of a picture of a medium add up to, and which parts of the picture get more of them.
//!
//! Takes sums of samples, pixel by pixel; gives their means, and for each half of the samples its own. A part of 32 x 32 pixels
//! that has enough is left out of further passes as a whole. Invariant: a pixel's sums are those of its part's samples, which come in
//! one order.

use glam::Vec3;

use super::denoise::denoised;
use super::refine::Goal;
use crate::film::Window;
use crate::render::refine::{Earlier, Quality, shown};

/// A pixel of a picture of a medium: means over its samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pixel {
    /// RGB radiance that the medium scatters and emits to the camera.
    pub scattered: Vec3,
    /// RGB radiance of the environment lights that comes through the medium.
    pub environment: Vec3,
    /// RGB share of what is behind the medium that comes through.
    pub transmittance: Vec3,
    /// Distance from the eye (orthographic: from the plane through it) at which light is scattered or absorbed, on average;
    /// infinite where none is.
    pub depth: f32,
}

/// What the samples of a pixel add up to.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    pub(super) scattered: Vec3,
    pub(super) environment: Vec3,
    pub(super) transmittance: Vec3,
    /// Distances times what is lost there, and what is lost.
    pub(super) depth: f32,
    pub(super) lost: f32,
}

impl Sums {
    /// Adds light that is lost at a distance.
    #[inline(always)]
    pub(super) fn add_depth(&mut self, distance: f32, lost: Vec3) {
        let lost = lost.element_sum();
        self.depth += lost * distance;
        self.lost += lost;
    }

    /// The means of so many samples.
    fn mean(&self, samples: u32) -> Pixel {
        let scale = 1.0 / samples.max(1) as f32;
        Pixel {
            scattered: scale * self.scattered,
            environment: scale * self.environment,
            transmittance: scale * self.transmittance,
            depth: if self.lost > 0.0 { self.depth / self.lost } else { f32::INFINITY },
        }
    }

    /// What was added since.
    fn since(&self, earlier: &Self) -> Self {
        Self {
            scattered: self.scattered - earlier.scattered,
            environment: self.environment - earlier.environment,
            transmittance: self.transmittance - earlier.transmittance,
            depth: self.depth - earlier.depth,
            lost: self.lost - earlier.lost,
        }
    }
}

/// Pixels along an edge of a part.
pub(super) const EDGE: u32 = 32;

/// A part of the picture.
#[derive(Clone, Debug)]
struct Part {
    window: Window,
    samples: u32,
    /// Those of the first half.
    half: u32,
    settled: bool,
    earlier: Earlier,
}

/// The sums of a picture.
#[derive(Clone, Debug)]
pub(super) struct Film {
    width: u32,
    /// Pixel by pixel, row by row from the top left.
    pub(super) sums: Vec<Sums>,
    /// The same of the first half of the samples, where that is kept.
    halves: Option<Vec<Sums>>,
    parts: Vec<Part>,
    /// Samples of the pixels that get more.
    pub(super) samples_done: u32,
}

/// A picture in two halves, of the first and of the last of its samples.
pub(super) struct Halves {
    pub(super) pixels: [Vec<Pixel>; 2],
    /// Of each pixel the share of its samples that are in the first half.
    pub(super) first_share: Vec<f32>,
}

impl Film {
    /// Without samples.
    pub(super) fn new(width: u32, height: u32) -> Self {
        let (across, down) = (width.div_ceil(EDGE), height.div_ceil(EDGE));
        let part = |number: u32| {
            let (x, y) = (number % across * EDGE, number / across * EDGE);
            let window = Window { x, y, width: EDGE.min(width - x), height: EDGE.min(height - y) };
            Part { window, samples: 0, half: 0, settled: false, earlier: Earlier::NONE }
        };
        let sums = vec![Sums::default(); width as usize * height as usize];
        Self { width, sums, halves: None, parts: (0..across * down).map(part).collect(), samples_done: 0 }
    }

    /// The same, which keeps halves: see [`Film::halves`].
    pub(super) fn with_halves(self) -> Self {
        Self { halves: Some(self.sums.clone()), ..self }
    }

    fn part(&self, column: u32, row: u32) -> &Part {
        &self.parts[(row / EDGE * self.width.div_ceil(EDGE) + column / EDGE) as usize]
    }

    /// Whether a pixel gets more samples.
    #[inline(always)]
    pub(super) fn wants(&self, column: u32, row: u32) -> bool {
        !self.part(column, row).settled
    }

    /// How many samples may be added before [`Film::begin`] must be called again.
    pub(super) fn at_once(&self) -> u32 {
        match (self.samples_done, &self.halves) {
            (_, None) => u32::MAX,
            (0, Some(_)) => 1,
            (done, Some(_)) => (done + 1).next_power_of_two() - done,
        }
    }

    /// Before samples are added. A first half ends wherever the number of samples is a power of two, at which sequences of points are
    /// spread evenly.
    pub(super) fn begin(&mut self) {
        let Some(halves) = self.halves.as_mut().filter(|_| self.samples_done.is_power_of_two()) else {
            return;
        };
        for part in self.parts.iter_mut().filter(|part| !part.settled) {
            let Window { x, y, width, height } = part.window;
            for row in y..y + height {
                let first = (row * self.width + x) as usize;
                let pixels = first..first + width as usize;
                halves[pixels.clone()].copy_from_slice(&self.sums[pixels]);
            }
            part.half = part.samples;
        }
    }

    /// After so many samples were added to every pixel that gets more.
    pub(super) fn advance(&mut self, samples: u32) {
        self.samples_done += samples;
        self.parts.iter_mut().filter(|part| !part.settled).for_each(|part| part.samples += samples);
    }

    fn pixels_by<T>(&self, of: impl Fn(&Part, usize) -> T) -> Vec<T> {
        let place = |number: usize| (number as u32 % self.width, number as u32 / self.width);
        let value = |number: usize| {
            let (column, row) = place(number);
            of(self.part(column, row), number)
        };
        (0..self.sums.len()).map(value).collect()
    }

    /// The means so far, row by row from the top left.
    pub(super) fn pixels(&self) -> Vec<Pixel> {
        self.pixels_by(|part, number| self.sums[number].mean(part.samples))
    }

    /// Both halves of the samples, if they were kept and each pixel has samples in both.
    pub(super) fn halves(&self) -> Option<Halves> {
        let halves = self.halves.as_ref()?;
        if self.parts.iter().any(|part| part.half == 0 || part.half == part.samples) {
            return None;
        }
        let first = self.pixels_by(|part, number| halves[number].mean(part.half));
        let last = self.pixels_by(|part, number| {
            self.sums[number].since(&halves[number]).mean(part.samples - part.half)
        });
        let first_share = self.pixels_by(|part, _| part.half as f32 / part.samples as f32);
        Some(Halves { pixels: [first, last], first_share })
    }

    /// The means so far with less noise, if each pixel has two samples or more and halves were kept.
    pub(super) fn denoised(&self) -> Option<Vec<Pixel>> {
        self.halves().map(|halves| denoised(&halves, self.width))
    }

    /// Compares all parts that got samples with what they were at the last call; those that changed by less than the noise of `goal` are
    /// settled. Whether all are.
    pub(super) fn settle(&mut self, goal: &Goal) -> bool {
        for part in self.parts.iter_mut().filter(|part| !part.settled) {
            let Window { x, y, width, height } = part.window;
            let rows = (y..y + height).map(|row| (row * self.width + x) as usize);
            let sums = rows.flat_map(|first| &self.sums[first..first + width as usize]);
            let color = |sums: &Sums| {
                let [r, g, b, _] = goal.showing.color(&sums.mean(part.samples));
                shown([r, g, b])
            };
            part.settled = part.earlier.settle(sums.map(color).collect(), goal.noise, |_| true);
        }
        self.parts.iter().all(|part| part.settled)
    }

    /// What the parts came to, after [`Self::settle`].
    pub(super) fn quality(&self) -> Quality {
        let pixels = |part: &Part| part.window.width as f32 * part.window.height as f32;
        let errors: f32 = self.parts.iter().map(|part| part.earlier.change_sq * pixels(part)).sum();
        let samples = self.parts.iter().map(|part| part.samples);
        Quality {
            noise: (errors / self.sums.len() as f32).sqrt(),
            samples: [samples.clone().min().unwrap_or(0), samples.max().unwrap_or(0)],
        }
    }
}
