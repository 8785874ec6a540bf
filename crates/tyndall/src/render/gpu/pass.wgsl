// What all tiles of a pass have in common, and where it puts what it finds. See layout.rs.

struct Pass {
    view: View,
    // Pixels across and down.
    size: vec2u,
    // The band's first row of pixels.
    first_row: u32,
    // Pixels along the edge of the pattern in which samples repeat.
    pattern_px: u32,
    // Whether samples lie in the middle of their pixel.
    centered: u32,
    // Whether the film has no samples yet.
    is_first: u32,
    lighting: u32,
    unused: u32,
    // By the pixel's place in the pattern of 8x8: which sample is nearer its center than all before, or NONE.
    nearest: array<vec4u, 16>,
    // By sample: toward the key light and what it sends, then the same of the sky.
    lights: array<vec4f, 32>,
}

@group(0) @binding(0) var<uniform> pass_: Pass;
// Where the samples of each pixel of the pattern lie, in pixels from its corner.
@group(0) @binding(1) var<storage, read> samples: array<vec2f>;
// By pixel of the band and sample: the distance's bits and the node.
@group(0) @binding(2) var<storage, read_write> hits: array<vec2u>;

// Where the first sample of a pixel stands among `samples`.
fn first_sample(pixel: vec2u) -> u32 {
    let place = pixel % vec2u(pass_.pattern_px);
    return (place.y * pass_.pattern_px + place.x) * SAMPLES;
}

// The corner of the pattern in which a pixel lies.
fn pattern_corner(pixel: vec2u) -> vec2f {
    return vec2f(pixel - pixel % vec2u(pass_.pattern_px));
}

// Where the first sample of a pixel stands among `hits`.
fn first_hit(pixel: vec2u) -> u32 {
    return ((pixel.y - pass_.first_row) * pass_.size.x + pixel.x) * SAMPLES;
}
