// What a single ray has met: twin of `Hit` in structure/mod.rs.

// What a ray met: distance, or the ray's t_max, and node, or NONE.
struct Met {
    t: f32,
    node: u32,
}

// The nearer of the two; equally near, that with the smaller id.
fn nearer(met: Met, t: f32, node: u32, except: u32) -> Met {
    if t > met.t || t == FAR || node == except || node >= particle_count() {
        return met;
    }
    if t == met.t && met.node != NONE && id_of(met.node) < id_of(node) {
        return met;
    }
    return Met(t, node);
}
