//! Pixels as files of integers have them: sRGB-encoded, straight alpha.

use rayon::prelude::*;
use tyndall::Image;
use tyndall::srgb::encoded_from_linear;

/// Pixels that a thread converts at a time.
const CHUNK: usize = 1 << 12;

/// How a pixel is stored.
pub(super) struct Stored {
    /// Whether a channel has 16 bits, most significant first, instead of 8.
    pub(super) is_wide: bool,
    pub(super) has_alpha: bool,
}

impl Stored {
    /// The bytes of pixels, red first, in chunks that follow each other.
    pub(super) fn bytes(&self, pixels: &[[f32; 4]]) -> Vec<Vec<u8>> {
        pixels.par_chunks(CHUNK).map(|pixels| self.chunk(pixels)).collect()
    }

    fn chunk(&self, pixels: &[[f32; 4]]) -> Vec<u8> {
        let channels = if self.has_alpha { 4 } else { 3 };
        let full = if self.is_wide { 65535.0 } else { 255.0 };
        let mut bytes = Vec::with_capacity(pixels.len() * channels * 2);
        for &[red, green, blue, alpha] in pixels {
            let straight = if alpha > 0.0 { alpha.recip() } else { 0.0 };
            let encoded = [red, green, blue].map(|light| encoded_from_linear(light * straight));
            let values = [encoded[0], encoded[1], encoded[2], alpha];
            for value in &values[..channels] {
                // Rounded to the nearest; NaN becomes 0.
                let word = (full * value.clamp(0.0, 1.0)).round() as u16;
                if self.is_wide {
                    bytes.extend(word.to_be_bytes());
                } else {
                    bytes.push(word as u8);
                }
            }
        }
        bytes
    }
}

/// Whether nothing shines through the picture.
pub(super) fn is_opaque(image: &Image) -> bool {
    image.color.par_iter().all(|color| color[3] >= 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_are_no_colors_are_clamped() {
        let format = Stored { is_wide: false, has_alpha: true };
        let pixels = [[f32::NAN, f32::INFINITY, -1.0, 1.0], [1.0, 1.0, 1.0, 0.0], [9.0, 0.25, 0.0, 0.5]];
        assert_eq!(format.bytes(&pixels).concat(), [0, 255, 0, 255, 0, 0, 0, 0, 255, 188, 0, 128]);
    }
}
