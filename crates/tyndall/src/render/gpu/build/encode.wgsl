// Formulas of the build: twins of build/order.rs, of curve.rs and of structure/bvh.

// The cell of the curve's lattice in which a center lies: the nearest one, outside.
fn cell_of(center: vec3f, low: vec3f, inv_edge: f32) -> vec3u {
    return vec3u(clamp((center - low) * inv_edge, vec3f(0.0), vec3f(f32((1u << CURVE_BITS) - 1u))));
}

// How large a particle is: 0 up to `giant`, and one more for each power of two beyond.
fn class_of(radius: f32, giant: f32) -> u32 {
    var class_ = 0u;
    var least = giant;
    while class_ < CLASSES - 1u && radius > least {
        class_ += 1u;
        least *= 2.0;
    }
    return class_;
}

// Ten bits with two zeros between neighbors.
fn spread(ten: u32) -> u32 {
    var bits = ten & 0x3ffu;
    bits = (bits | (bits << 16u)) & 0x030000ffu;
    bits = (bits | (bits << 8u)) & 0x0300f00fu;
    bits = (bits | (bits << 4u)) & 0x030c30c3u;
    return (bits | (bits << 2u)) & 0x09249249u;
}

// The place of a cell on the curve: the lower and the upper thirty bits.
fn hilbert(cell: vec3u) -> vec2u {
    var at = cell;
    // Undo the excess rotations and reflections, from the coarsest cube to the finest.
    for (var bit = 1u << (CURVE_BITS - 1u); bit > 1u; bit >>= 1u) {
        let mask = bit - 1u;
        if (at.x & bit) != 0u {
            at.x ^= mask;
        }
        if (at.y & bit) != 0u {
            at.x ^= mask;
        } else {
            let swapped = (at.x ^ at.y) & mask;
            at.x ^= swapped;
            at.y ^= swapped;
        }
        if (at.z & bit) != 0u {
            at.x ^= mask;
        } else {
            let swapped = (at.x ^ at.z) & mask;
            at.x ^= swapped;
            at.z ^= swapped;
        }
    }
    // Gray code.
    at.y ^= at.x;
    at.z ^= at.y;
    var flips = 0u;
    for (var bit = 1u << (CURVE_BITS - 1u); bit > 1u; bit >>= 1u) {
        flips ^= select(0u, bit - 1u, (at.z & bit) != 0u);
    }
    at ^= vec3u(flips);
    return vec2u(
        (spread(at.x) << 2u) | (spread(at.y) << 1u) | spread(at.z),
        (spread(at.x >> 10u) << 2u) | (spread(at.y >> 10u) << 1u) | spread(at.z >> 10u));
}

// By what particles are sorted: 64 bits, the lower word first. Sixty have the place on the curve, four the class.
fn key_of(center: vec3f, radius: f32, low: vec3f, inv_edge: f32, giant: f32) -> vec2u {
    let place = hilbert(cell_of(center, low, inv_edge));
    return vec2u(place.x | (place.y << 30u), (place.y >> 2u) | (class_of(radius, giant) << 28u));
}

fn two_to(exponent: u32) -> f32 {
    return bitcast<f32>(exponent << 23u);
}

// The biased exponent of the least power of two of which `steps` reach as far as `extent`.
fn step_exponent(extent: f32, steps: f32) -> u32 {
    let least = extent / steps;
    let exponent = clamp(bitcast<u32>(least) >> 23u, 1u, 254u);
    return exponent + select(0u, 1u, two_to(exponent) < least && exponent < 254u);
}

// One over the step with that exponent, which is a power of two too: products with it are as exact as quotients.
fn inv_step(exponent: u32) -> f32 {
    return two_to(254u - exponent);
}

// The nearest whole number of steps; halves go up.
fn rounded(steps: f32, most: f32) -> u32 {
    let whole = floor(steps);
    return u32(clamp(whole + select(0.0, 1.0, steps - whole >= 0.5), 0.0, most));
}

// A bound in steps of a node's box, which it holds: the lower ones and the upper ones.
fn lower_step(distance: f32, exponent: u32) -> u32 {
    return u32(clamp(floor(distance * inv_step(exponent)), 0.0, 255.0));
}

fn upper_step(distance: f32, exponent: u32) -> u32 {
    return u32(clamp(ceil(distance * inv_step(exponent)), 0.0, 255.0));
}
