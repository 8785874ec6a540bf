// e^x - 1 and ln(1 + x) without cancellation, for x up to 0: what Rust's library has and WGSL lacks. The language's own exp and log are
// less exact near 0 and 1.

const LN_2: f32 = 0.693147181;
// The logarithm of less than any number: that of 0 is infinite.
const LN_LEAST: f32 = -104.0;

// e^-x for x of at least 0; 0 beyond 87. Twin of math.rs.
fn exp_minus(x: f32) -> f32 {
    let power = max(-1.44269504 * x, -125.0);
    let whole = round(power);
    let rest = power - whole;
    let series = 1.0 + rest * (LN_2 + rest * (0.2402265 + rest * (5.550411e-2
        + rest * (9.618129e-3 + rest * (1.3333558e-3 + rest * 1.540353e-4)))));
    return select(0.0, series * bitcast<f32>(u32(i32(whole) + 127) << 23u), x < 87.0);
}

// e^x - 1 for x up to 0.
fn exp_m1(x: f32) -> f32 {
    if x < -0.5 {
        return exp_minus(-x) - 1.0;
    }
    return x * (1.0 + x / 2.0 * (1.0 + x / 3.0 * (1.0 + x / 4.0 * (1.0 + x / 5.0
        * (1.0 + x / 6.0 * (1.0 + x / 7.0 * (1.0 + x / 8.0 * (1.0 + x / 9.0))))))));
}

// ln((1 + s) / (1 - s)), for s of at most a third.
fn ln_ratio(s: f32) -> f32 {
    let sq = s * s;
    return 2.0 * s * (1.0 + sq * (1.0 / 3.0 + sq * (1.0 / 5.0 + sq * (1.0 / 7.0 + sq * (1.0 / 9.0
        + sq * (1.0 / 11.0 + sq * (1.0 / 13.0 + sq * (1.0 / 15.0))))))));
}

// ln(1 + x) for x from -1 to 0; that of -1 is LN_LEAST.
fn ln_1p(x: f32) -> f32 {
    if x > -0.5 {
        return ln_ratio(x / (2.0 + x));
    }
    let y = 1.0 + x;
    if y <= 0.0 {
        return LN_LEAST;
    }
    // A power of 2 times what lies between 3/4 and 3/2.
    let exponent = (bitcast<u32>(y) + 0x00400000u) >> 23u;
    let mantissa = bitcast<f32>(bitcast<u32>(y) + ((127u - exponent) << 23u));
    return f32(i32(exponent) - 127) * LN_2 + ln_ratio((mantissa - 1.0) / (mantissa + 1.0));
}
