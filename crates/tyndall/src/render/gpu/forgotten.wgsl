// In place of noted.wgsl where no pass notes anything.

var<workgroup> left_out: atomic<u32>;

fn noted_of(group: vec3u) -> vec2u {
    return vec2u(NONE);
}

fn noted_leaf(group: vec3u, number: u32) -> vec2u {
    return vec2u(0u);
}

fn noted_left_out(group: vec3u, number: u32) -> vec2u {
    return vec2u(0u);
}

fn note_leaf(group: vec3u, number: u32, entry: vec2u) {
}

fn note_left_out(group: vec3u, entry: vec2u) {
}

fn note_counts(group: vec3u, leaves: u32, is_aside: bool) {
}
