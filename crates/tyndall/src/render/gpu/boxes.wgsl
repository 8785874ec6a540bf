// Where a ray meets the boxes of a node, four at a time: twin of `Node::cross_axis` in structure/bvh.

// Where a ray enters and leaves four slabs along one axis.
struct Slabs {
    enter: vec4f,
    leave: vec4f,
}

// Bytes as numbers.
fn four_bytes(word: u32) -> vec4f {
    return vec4f((vec4u(word) >> vec4u(0u, 8u, 16u, 24u)) & vec4u(255u));
}

fn cross_axis(lower: u32, upper: u32, scale: f32, shift: f32, give: f32) -> Slabs {
    let a = four_bytes(lower) * scale + shift;
    let b = four_bytes(upper) * scale + shift;
    return Slabs(min(a, b) - give, max(a, b) + give);
}
