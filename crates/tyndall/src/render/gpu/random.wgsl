// Random numbers as a pure function of integers: twin of random.rs.

// Four words that depend on all bits of `key`.
fn hash4(key: vec4u) -> vec4u {
    var v = key * 1664525u + 1013904223u;
    for (var round = 0u; round < 2u; round++) {
        v.x += v.y * v.w;
        v.y += v.z * v.x;
        v.z += v.x * v.y;
        v.w += v.y * v.z;
        if round == 0u {
            v ^= v >> vec4u(16u);
        }
    }
    return v;
}

// A word as a number in [0, 1).
fn unit_f32(word: u32) -> f32 {
    return f32(word >> 8u) * (1.0 / 16777216.0);
}
