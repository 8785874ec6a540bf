//! The light of black bodies: from a temperature to linear RGB.
//!
//! Planck's law, weighted with the color matching functions of the CIE 1931 standard observer (2 degrees, 380 to 780 nm in steps of
//! 10 nm), gives XYZ; the matrix of Rec. 709 with its white D65 gives linear RGB. Below about 1900 K a black body is redder than the
//! primaries can show: what would be negative is 0. Brightness is relative: a chosen temperature has luminance 1.
//! Sources: CIE 15:2004, table T.4 (color matching functions); ITU-R BT.709-6 (primaries); CODATA 2018 (second radiation constant).

use crate::error::{Error, Result};

/// Second radiation constant h c / k, in micrometers times kelvins.
const SECOND_RADIATION: f64 = 14_387.768_775;
/// Wavelength of the first row of [`MATCHING`] and from one to the next, in micrometers.
const FIRST: f64 = 0.38;
const STEP: f64 = 0.01;
/// Linear RGB of Rec. 709 from XYZ, row by row.
const RGB_FROM_XYZ: [[f64; 3]; 3] = [
    [3.240_454_2, -1.537_138_5, -0.498_531_4],
    [-0.969_266_0, 1.876_010_8, 0.041_556_0],
    [0.055_643_4, -0.204_025_9, 1.057_225_2],
];
/// Temperatures that may have luminance 1, in kelvins: colder bodies are dark, hotter ones have one color.
const REFERENCES: [f64; 2] = [500.0, 1e9];

/// Black bodies of which that of one temperature has luminance 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlackBody {
    reference: f64,
    /// One over the luminance at the reference.
    scale: f64,
}

impl BlackBody {
    /// Luminance 1 at `reference` kelvins, from 500 to 1e9: [`Error::Setting`] else.
    pub fn new(reference: f64) -> Result<Self> {
        let [low, high] = REFERENCES;
        if !(low..=high).contains(&reference) {
            let allowed = "the temperature of luminance 1 in kelvins, from 500 to 1e9";
            return Err(Error::setting("reference temperature", reference, allowed));
        }
        Ok(Self { reference, scale: 1.0 / xyz(reference)[1] })
    }

    /// The temperature of luminance 1, in kelvins.
    pub fn reference(&self) -> f64 {
        self.reference
    }

    /// Linear RGB of Rec. 709 at a temperature in kelvins, at least 0; 0 where there is no temperature.
    pub fn radiance(&self, kelvins: f64) -> [f32; 3] {
        let xyz = xyz(kelvins);
        RGB_FROM_XYZ.map(|row| {
            let sum: f64 = row.iter().zip(xyz).map(|(share, it)| share * it).sum();
            (self.scale * sum).clamp(0.0, f64::from(f32::MAX) / 1e6) as f32
        })
    }
}

/// CIE XYZ of a black body, but for a factor that is common to all temperatures; 0 at 0 kelvins and below.
pub fn xyz(kelvins: f64) -> [f64; 3] {
    let mut sums = [0.0; 3];
    // A temperature that is no number gives no light either.
    if kelvins > 0.0 {
        for (row, matching) in MATCHING.iter().enumerate() {
            let wavelength = FIRST + row as f64 * STEP;
            let radiance = wavelength.powi(-5) / (SECOND_RADIATION / (wavelength * kelvins)).exp_m1();
            sums.iter_mut().zip(matching).for_each(|(sum, share)| *sum += radiance * share);
        }
    }
    sums
}

/// CIE chromaticity x, y of a black body; NaN where it gives no light.
pub fn chromaticity(kelvins: f64) -> [f64; 2] {
    let [x, y, z] = xyz(kelvins);
    [x / (x + y + z), y / (x + y + z)]
}

/// Color matching functions x, y, z of the CIE 1931 standard observer.
const MATCHING: [[f64; 3]; 41] = [
    [0.001368, 0.000039, 0.00645],
    [0.004243, 0.00012, 0.02005],
    [0.01431, 0.000396, 0.06785],
    [0.04351, 0.00121, 0.2074],
    [0.13438, 0.004, 0.6456],
    [0.2839, 0.0116, 1.3856],
    [0.34828, 0.023, 1.74706],
    [0.3362, 0.038, 1.77211],
    [0.2908, 0.06, 1.6692],
    [0.19536, 0.09098, 1.28764],
    [0.09564, 0.13902, 0.81295],
    [0.03201, 0.20802, 0.46518],
    [0.0049, 0.323, 0.272],
    [0.0093, 0.503, 0.1582],
    [0.06327, 0.71, 0.07825],
    [0.1655, 0.862, 0.04216],
    [0.2904, 0.954, 0.0203],
    [0.43345, 0.99495, 0.00875],
    [0.5945, 0.995, 0.0039],
    [0.7621, 0.952, 0.0021],
    [0.9163, 0.87, 0.00165],
    [1.0263, 0.757, 0.0011],
    [1.0622, 0.631, 0.0008],
    [1.0026, 0.503, 0.00034],
    [0.85445, 0.381, 0.00019],
    [0.6424, 0.265, 0.00005],
    [0.4479, 0.175, 0.00002],
    [0.2835, 0.107, 0.0],
    [0.1649, 0.061, 0.0],
    [0.0874, 0.032, 0.0],
    [0.04677, 0.017, 0.0],
    [0.0227, 0.00821, 0.0],
    [0.011359, 0.004102, 0.0],
    [0.00579, 0.002091, 0.0],
    [0.002899, 0.001047, 0.0],
    [0.00144, 0.00052, 0.0],
    [0.00069, 0.000249, 0.0],
    [0.000332, 0.00012, 0.0],
    [0.000166, 0.00006, 0.0],
    [0.000083, 0.00003, 0.0],
    [0.000042, 0.000015, 0.0],
];

#[cfg(test)]
mod tests {
    use super::*;

    /// Chromaticities of the Planckian locus, by the color matching functions in steps of 1 nm from 360 to 830 nm.
    const LOCUS: [(f64, f64, f64); 6] = [
        (1000.0, 0.652_75, 0.344_46),
        (1500.0, 0.585_72, 0.393_12),
        (2856.0, 0.447_55, 0.407_43),
        (6504.0, 0.313_46, 0.323_57),
        (20_000.0, 0.256_46, 0.257_63),
        (1e6, 0.240_13, 0.234_42),
    ];

    #[test]
    fn chromaticities_are_those_of_the_planckian_locus() {
        for (kelvins, x, y) in LOCUS {
            let found = chromaticity(kelvins);
            let off = (found[0] - x).hypot(found[1] - y);
            assert!(off < 4e-4, "{kelvins} K: {found:?}");
        }
        assert_eq!(xyz(0.0), [0.0; 3]);
        assert_eq!(xyz(f64::NAN), [0.0; 3]);
    }

    #[test]
    fn luminance_is_one_at_the_reference_and_grows_as_planck_says() {
        let body = BlackBody::new(1500.0).unwrap();
        let luminance = |kelvins: f64| {
            let [r, g, b] = body.radiance(kelvins).map(f64::from);
            0.212_672_9 * r + 0.715_152_2 * g + 0.072_175_0 * b
        };
        // Blue is cut at 1500 K, which adds next to nothing.
        assert!((luminance(1500.0) - 1.0).abs() < 0.02, "{}", luminance(1500.0));
        // The ratio of luminances of 2856 K and 1500 K, from the same sums in steps of 1 nm.
        assert!((luminance(2856.0) / (0.242_780_0 / 9.515_008e-5) - 1.0).abs() < 1e-3);
        // Near D65 the color is nearly white.
        let [r, g, b] = BlackBody::new(6504.0).unwrap().radiance(6504.0);
        assert!([r, g, b].iter().all(|it| (it - 1.0).abs() < 0.06), "{r} {g} {b}");
        let red = body.radiance(900.0);
        assert!(red[0] > 5.0 * red[1] && red[2] == 0.0, "{red:?}");
        assert_eq!(body.radiance(0.0), [0.0; 3]);
    }

    #[test]
    fn a_reference_without_light_is_refused() {
        for bad in [0.0, 300.0, -5.0, f64::NAN, f64::INFINITY] {
            assert_eq!(BlackBody::new(bad).unwrap_err().code(), "setting");
        }
        assert!(BlackBody::new(1e9).unwrap().radiance(1e9)[2].is_finite());
        assert!(BlackBody::new(500.0).unwrap().radiance(1e30)[2].is_finite());
    }
}
