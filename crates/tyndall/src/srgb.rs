//! The sRGB transfer curve (IEC 61966-2-1), exact and piecewise: between light, which adds up, and what a screen is sent.

/// The encoded value of a linear one. Both run from 0 to 1; beyond that the curve goes on, and negative values are mirrored.
pub fn encoded_from_linear(linear: f32) -> f32 {
    let value = linear.abs();
    let encoded = if value <= 0.003_130_8 { 12.92 * value } else { 1.055 * value.powf(1.0 / 2.4) - 0.055 };
    encoded.copysign(linear)
}

/// The linear value of an encoded one: the inverse of [`encoded_from_linear`].
pub fn linear_from_encoded(encoded: f32) -> f32 {
    let value = encoded.abs();
    let linear = if value <= 0.040_45 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) };
    linear.copysign(encoded)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_passes_through_the_values_of_the_standard() {
        for (linear, encoded) in
            [(0.0, 0.0), (1.0, 1.0), (0.214_041, 0.5), (0.002, 0.025_84), (0.5, 0.735_357)]
        {
            assert!((encoded_from_linear(linear) - encoded).abs() < 1e-5, "{linear}");
            assert!((linear_from_encoded(encoded) - linear).abs() < 1e-5, "{encoded}");
        }
    }

    #[test]
    fn there_and_back_is_the_identity() {
        for step in -1000..=2000 {
            let value = step as f32 / 1000.0;
            assert!((encoded_from_linear(linear_from_encoded(value)) - value).abs() < 2e-6, "{value}");
        }
    }
}
