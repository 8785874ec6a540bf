//! Real spherical harmonics up to order 3: how radiance and phase functions are kept where they depend on direction.
//!
//! Normalised so that for unit directions a and b the sum of Y(a) Y(b) over one order l is (2l + 1) / 4 pi P_l(a . b). The phase
//! function of Henyey and Greenstein then multiplies the coefficients of order l by g^l.
//! Source: P.-P. Sloan, "Stupid spherical harmonics tricks", 2008, appendix A2.

use glam::Vec3;

/// Functions up to order 3.
pub(super) const COUNT: usize = 16;

/// How many functions there are up to an order.
pub(super) const fn count(order: usize) -> usize {
    (order + 1) * (order + 1)
}

/// The order of a function by its number.
pub(super) const ORDER: [i32; COUNT] = [0, 1, 1, 1, 2, 2, 2, 2, 2, 3, 3, 3, 3, 3, 3, 3];

/// The order that radiance needs where the mean cosine of scattering is `g`: what is left out has the share |g|^(order + 1) of
/// light scattered in one direction.
pub(super) fn order_for(g: f32) -> usize {
    match g.abs() {
        0.0 => 0,
        g if g < 0.2 => 1,
        g if g < 0.5 => 2,
        _ => 3,
    }
}

/// The share of scattering with the mean cosine `g` that goes so straight on that radiance up to `order` cannot tell it from light that was not scattered.
/// Source: W. Wiscombe, "The delta-M method", Journal of the Atmospheric Sciences 34, 1977.
pub(super) fn peak(g: f32, order: usize) -> f32 {
    if g > 0.0 { g.powi(order as i32 + 1) } else { 0.0 }
}

/// All functions in a direction of unit length.
pub(super) fn evaluate(direction: Vec3) -> [f32; COUNT] {
    let Vec3 { x, y, z } = direction;
    [
        0.282_094_8,
        0.488_602_5 * y,
        0.488_602_5 * z,
        0.488_602_5 * x,
        1.092_548_4 * x * y,
        1.092_548_4 * y * z,
        0.315_391_57 * (3.0 * z * z - 1.0),
        1.092_548_4 * x * z,
        0.546_274_2 * (x * x - y * y),
        0.590_043_6 * y * (3.0 * x * x - y * y),
        2.890_611_4 * x * y * z,
        0.457_045_8 * y * (5.0 * z * z - 1.0),
        0.373_176_33 * z * (5.0 * z * z - 3.0),
        0.457_045_8 * x * (5.0 * z * z - 1.0),
        1.445_305_7 * z * (x * x - y * y),
        0.590_043_6 * x * (x * x - 3.0 * y * y),
    ]
}

/// The functions in the direction of travel, each times g^order: the weights with which coefficients of radiance become light
/// scattered that way.
pub(super) fn scattered(direction: Vec3, g: f32) -> [f32; COUNT] {
    let mut weights = evaluate(direction);
    for (weight, order) in weights.iter_mut().zip(ORDER) {
        *weight *= g.powi(order);
    }
    weights
}

/// Directions spread evenly over the sphere (a spherical Fibonacci lattice), each for the same solid angle.
pub(super) fn directions(count: usize) -> Vec<Vec3> {
    let golden = 0.5 * (5_f64.sqrt() - 1.0);
    let direction = |place: usize| {
        let z = 1.0 - (2.0 * place as f64 + 1.0) / count as f64;
        let around = std::f64::consts::TAU * (place as f64 * golden).fract();
        let across = (1.0 - z * z).sqrt();
        glam::DVec3::new(across * around.cos(), across * around.sin(), z).as_vec3()
    };
    (0..count).map(direction).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    #[test]
    fn each_order_sums_to_its_legendre_polynomial() {
        let mut stream = Stream::new(21, 0);
        for _ in 0..100 {
            let (a, b) = (stream.direction(), stream.direction());
            let x = a.dot(b);
            let legendre = [1.0, x, 0.5 * (3.0 * x * x - 1.0), 0.5 * (5.0 * x * x * x - 3.0 * x)];
            for (order, polynomial) in legendre.into_iter().enumerate() {
                let of_order = (0..COUNT).filter(|&k| ORDER[k] == order as i32);
                let sum: f32 = of_order.map(|k| evaluate(a)[k] * evaluate(b)[k]).sum();
                let wanted = (2 * order + 1) as f32 / (4.0 * std::f32::consts::PI) * polynomial;
                assert!((sum - wanted).abs() < 1e-5, "order {order}: {sum} {wanted}");
            }
        }
        assert_eq!([count(0), count(1), count(3)], [1, 4, COUNT]);
    }

    #[test]
    fn the_even_directions_integrate_the_harmonics() {
        for number in [32, 64, 200] {
            let weight = 4.0 * std::f32::consts::PI / number as f32;
            for a in 0..COUNT {
                for b in 0..=a {
                    let product = |direction| evaluate(direction)[a] * evaluate(direction)[b];
                    let integral: f32 = directions(number).into_iter().map(product).sum::<f32>() * weight;
                    let wanted = if a == b { 1.0 } else { 0.0 };
                    // Of each other order up to 6 the lattice of 32 directions still leaves some percent.
                    assert!((integral - wanted).abs() < 3.0 / number as f32, "{number}: {a} {b} {integral}");
                }
            }
        }
    }
}
