// From the pixels' confidences to the depths at which their rays end: twin of render/confidence/neighborhood.rs and of `decide` in
// render/cpu/confidence.rs.

struct Level {
    // Pairs across and down of what is read, and of what is written.
    from_size: vec2u,
    to_size: vec2u,
}

// See culled.wgsl.
@group(0) @binding(0) var<storage, read> culling: Culling;
@group(0) @binding(1) var<storage, read> level: Level;
// Depth and confidence, row by row.
@group(0) @binding(2) var<storage, read> pairs: array<vec2f>;
// Those of the next level of the pyramid.
@group(0) @binding(3) var<storage, read_write> halved: array<vec2f>;
@group(0) @binding(4) var<storage, read_write> pixels: array<Pixel>;
// How many pixels are final.
@group(0) @binding(5) var<storage, read_write> converged: atomic<u32>;

// Largest depth and mean confidence of the pairs in [low, high) that there are.
fn over(low: vec2u, high: vec2u) -> vec2f {
    let end = min(high, level.from_size);
    var depth = 0.0;
    var sum = 0.0;
    for (var y = low.y; y < end.y; y++) {
        for (var x = low.x; x < end.x; x++) {
            let pair = pairs[y * level.from_size.x + x];
            depth = max(depth, pair.x);
            sum += pair.y;
        }
    }
    let size = end - low;
    return vec2f(depth, sum / f32(size.x * size.y));
}

// A pair of the next level is 2 x 2 of this one.
@compute @workgroup_size(8, 8)
fn halve(@builtin(global_invocation_id) place: vec3u) {
    if all(place.xy < level.to_size) {
        halved[place.y * level.to_size.x + place.x] = over(2u * place.xy, 2u * place.xy + 2u);
    }
}

// Where the rays of the next frame end. `to_size` is the picture's.
@compute @workgroup_size(8, 8)
fn decide(@builtin(global_invocation_id) place: vec3u) {
    if any(place.xy >= level.to_size) {
        return;
    }
    let at = place.y * level.to_size.x + place.x;
    var clip = pixels[at].clip;
    var unchanged = pixels[at].unchanged;
    if unchanged < culling.convergence_samples {
        unchanged = min(unchanged, 0xffffffffu - culling.samples) + culling.samples;
        let own = place.xy >> vec2u(culling.level);
        let reach = culling.kernel / 2u;
        let pair = over(max(own, vec2u(reach)) - reach, own + reach + 1u);
        if pair.y >= culling.occlusion_confidence && pair.x < clip {
            clip = pair.x;
            unchanged = 0u;
        }
        pixels[at].clip = clip;
        pixels[at].unchanged = unchanged;
    }
    if unchanged >= culling.convergence_samples {
        atomicAdd(&converged, 1u);
    }
}
