//! How two pictures differ: PSNR, SSIM and FLIP, and how many pixels lost something to the background.

use flip_rs::{DEFAULT_PPD, RgbImage, ldr_flip};
use tyndall::Image;
use tyndall::srgb::encoded_from_linear;

/// How far a picture is from another one.
#[derive(Clone, Copy, Default)]
pub(super) struct Quality {
    /// Of sRGB values, in decibels; infinite for equal pictures.
    pub(super) psnr: f64,
    /// Of the gray picture, Gaussian windows of 11 pixels with a deviation of 1.5.
    pub(super) ssim: f64,
    /// Mean over the pixels.
    pub(super) flip: f64,
    /// Share of the pixels that are brighter, because background shows, by more than a twentieth.
    pub(super) pierced: f64,
}

/// Compares pictures on a white background with those they should be; all have the same size.
pub(super) fn quality(expected: &[Image], found: &[Image]) -> Quality {
    let mut sum = Quality::default();
    let (mut error_sq, mut values) = (0.0, 0);
    for (expected, found) in expected.iter().zip(found) {
        let (width, height) = (expected.width as usize, expected.height as usize);
        let (a, b) = (encoded(expected), encoded(found));
        error_sq += a.iter().zip(&b).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>();
        values += a.len();
        let (gray_a, gray_b) = (gray(&a), gray(&b));
        sum.ssim += ssim(&gray_a, &gray_b, width);
        let pierced = gray_a.iter().zip(&gray_b).filter(|(a, b)| *b - *a > 0.05).count();
        sum.pierced += pierced as f64 / (width * height) as f64;
        let map = RgbImage::new(width, height, a)
            .and_then(|a| ldr_flip(&a, &RgbImage::new(width, height, b)?, DEFAULT_PPD));
        sum.flip += map.map_or(f64::NAN, |map| f64::from(map.statistics().mean));
    }
    let count = expected.len().max(1) as f64;
    Quality {
        psnr: -10.0 * (error_sq / values.max(1) as f64).log10(),
        ssim: sum.ssim / count,
        flip: sum.flip / count,
        pierced: sum.pierced / count,
    }
}

/// sRGB values, pixel by pixel.
fn encoded(image: &Image) -> Vec<f32> {
    let values = image.color.iter().flat_map(|color| [color[0], color[1], color[2]]);
    values.map(|value| encoded_from_linear(value).clamp(0.0, 1.0)).collect()
}

/// Luma by Rec. 709.
fn gray(values: &[f32]) -> Vec<f64> {
    let luma =
        |rgb: &[f32]| 0.2126 * f64::from(rgb[0]) + 0.7152 * f64::from(rgb[1]) + 0.0722 * f64::from(rgb[2]);
    values.chunks_exact(3).map(luma).collect()
}

/// The mean structural similarity (Wang, Bovik, Sheikh, Simoncelli 2004) of gray pictures that are `width` wide.
fn ssim(a: &[f64], b: &[f64], width: usize) -> f64 {
    let product = |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a * b).collect() };
    let [mean_a, mean_b] = [a, b].map(|values| blurred(values, width));
    let [aa, bb, ab] = [product(a, a), product(b, b), product(a, b)].map(|values| blurred(&values, width));
    let (c1, c2) = (0.01_f64.powi(2), 0.03_f64.powi(2));
    let at = |place: usize| {
        let (u, v) = (mean_a[place], mean_b[place]);
        let (spread_a, spread_b, both) = (aa[place] - u * u, bb[place] - v * v, ab[place] - u * v);
        (2.0 * u * v + c1) * (2.0 * both + c2) / ((u * u + v * v + c1) * (spread_a + spread_b + c2))
    };
    (0..a.len()).map(at).sum::<f64>() / a.len().max(1) as f64
}

/// Weighted by a Gaussian of deviation 1.5 over 11 x 11 pixels, of those that there are.
fn blurred(values: &[f64], width: usize) -> Vec<f64> {
    let weight = |away: usize| (-0.5 * (away as f64 / 1.5).powi(2)).exp();
    let along = |values: &[f64], step: usize, length: usize| -> Vec<f64> {
        let at = |place: usize| {
            let here = place / step % length;
            let reach = here.saturating_sub(5)..(here + 6).min(length);
            let mut sums = [0.0; 2];
            for there in reach {
                let weight = weight(here.abs_diff(there));
                sums[0] += weight * values[place + there * step - here * step];
                sums[1] += weight;
            }
            sums[0] / sums[1]
        };
        (0..values.len()).map(at).collect()
    };
    along(&along(values, 1, width), width, values.len() / width.max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(color: impl Fn(usize) -> f32) -> Image {
        let color = (0..32 * 16).map(|at| [color(at), color(at), color(at), 1.0]).collect();
        Image { width: 32, height: 16, color, ..Image::default() }
    }

    #[test]
    fn equal_pictures_do_not_differ() {
        let checks = image(|at| ((at / 4 + at / 32) % 2) as f32);
        let found = quality(std::slice::from_ref(&checks), std::slice::from_ref(&checks));
        assert!(found.psnr.is_infinite() && (found.ssim - 1.0).abs() < 1e-12);
        assert_eq!([found.flip, found.pierced], [0.0, 0.0]);
    }

    #[test]
    fn what_differs_is_measured() {
        // Even gray, a step of sRGB brighter in one quarter of the pixels.
        let (dark, bright) = (image(|_| 0.1), image(|at| if at % 32 < 8 { 0.2 } else { 0.1 }));
        let found = quality(std::slice::from_ref(&dark), std::slice::from_ref(&bright));
        let step = f64::from(encoded_from_linear(0.2) - encoded_from_linear(0.1));
        let expected = -10.0 * (step * step / 4.0).log10();
        assert!((found.psnr - expected).abs() < 1e-4, "{}", found.psnr);
        assert!(found.ssim < 0.99 && found.flip > 0.01);
        assert_eq!(found.pierced, 0.25);
        // Darker is no hole.
        assert_eq!(quality(&[bright], &[dark]).pierced, 0.0);
    }

    #[test]
    fn similarity_of_even_pictures_is_that_of_their_brightness() {
        let (u, v) = (0.25, 0.5);
        let expected = (2.0 * u * v + 1e-4) / (u * u + v * v + 1e-4);
        let found = ssim(&[u; 400], &[v; 400], 20);
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    }
}
