//! Light in a participating medium, on the CPU.
//!
//! The road: [`photons`] or the sweeps of the [`cache`] light the medium, [`march`] makes the picture; [`brute`] does without the
//! cache and [`mod@reference`] without any of it. [`picture`] is the last step of all.

mod balls;
pub mod brute;
pub mod cache;
mod columns;
mod diffuse;
mod field;
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

impl From<reference::Pixel> for Pixel {
    fn from(pixel: reference::Pixel) -> Self {
        let reference::Pixel { scattered, environment, transmittance } = pixel;
        Self { scattered, environment, transmittance, depth: f32::INFINITY }
    }
}

/// The picture of pixels, row by row from the top left, `width` a row: light is multiplied with `exposure`, the color of the
/// backdrop is not. There are no ids.
pub fn picture(pixels: &[Pixel], width: u32, backdrop: Backdrop, exposure: f32) -> Image {
    let color = |pixel: &Pixel| {
        let scattered = exposure * pixel.scattered;
        let (light, alpha) = match backdrop {
            Backdrop::Nothing => (scattered, 1.0 - pixel.transmittance.element_sum() / 3.0),
            Backdrop::Color(color) => (scattered + pixel.transmittance * Vec3::from(color), 1.0),
            Backdrop::Lights => (scattered + exposure * pixel.environment, 1.0),
        };
        light.extend(alpha).to_array()
    };
    Image {
        width,
        height: (pixels.len() / (width as usize).max(1)) as u32,
        color: pixels.iter().map(color).collect(),
        depth: pixels.iter().map(|pixel| pixel.depth).collect(),
        id: vec![-1; pixels.len()],
    }
}
