//! Light in a participating medium, on the CPU.
//!
//! The road: [`photons`] or the sweeps of the [`cache`] light the medium, [`march`] makes the picture; [`brute`] does without the
//! cache and [`mod@reference`] without any of it. [`picture`] is the last step of all.

mod balls;
pub mod brute;
pub mod cache;
mod columns;
mod denoise;
mod diffuse;
mod field;
mod film;
pub mod free_path;
pub mod gather;
mod glowing;
mod harmonics;
mod lights;
mod lit;
pub mod march;
mod packet;
pub mod photons;
pub mod reference;
pub mod refine;
mod regular;
pub mod show;
pub mod solids;
mod space;
mod sweep;
#[cfg(test)]
mod tests;
mod walk;

use glam::Vec3;

use crate::film::Image;
use march::Pixel;

/// What is behind a medium.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Backdrop {
    /// Nothing: the picture is transparent there.
    Nothing,
    /// A color, linear RGB.
    Color([f32; 3]),
    /// The environment lights.
    Lights,
}

/// How a picture of a medium is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Showing {
    /// What is behind it.
    pub backdrop: Backdrop,
    /// What light is multiplied with; the color of the backdrop is not.
    pub exposure: f32,
}

impl Showing {
    /// Linear RGB, and alpha.
    pub(super) fn color(&self, pixel: &Pixel) -> [f32; 4] {
        let scattered = self.exposure * pixel.scattered;
        let (light, alpha) = match self.backdrop {
            Backdrop::Nothing => (scattered, 1.0 - pixel.transmittance.element_sum() / 3.0),
            Backdrop::Color(color) => (scattered + pixel.transmittance * Vec3::from(color), 1.0),
            Backdrop::Lights => (scattered + self.exposure * pixel.environment, 1.0),
        };
        light.extend(alpha).to_array()
    }
}

/// The picture of pixels, row by row from the top left, `width` a row. There are no ids.
pub fn picture(pixels: &[Pixel], width: u32, showing: Showing) -> Image {
    Image {
        width,
        height: (pixels.len() / (width as usize).max(1)) as u32,
        color: pixels.iter().map(|pixel| showing.color(pixel)).collect(),
        depth: pixels.iter().map(|pixel| pixel.depth).collect(),
        id: vec![-1; pixels.len()],
    }
}
