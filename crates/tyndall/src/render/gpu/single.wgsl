// What each sample meets, by a single ray: for structures that no tile goes through as a whole. A thread is a sample, not a pixel: Mesa's
// driver in software counts the rounds of all loops of a thread together, and ends them after 65535.

@compute @workgroup_size(TILE_W, TILE_H)
fn find_hits(@builtin(global_invocation_id) place: vec3u) {
    let pixel = vec2u(place.x, place.y + pass_.first_row);
    if any(pixel >= pass_.size) {
        return;
    }
    let sample = place.z;
    let point = samples[first_sample(pixel) + sample] + pattern_corner(pixel);
    let met = intersect(view_ray(pass_.view, point.x, point.y), NONE);
    hits[first_hit(pixel) + sample] = vec2u(bitcast<u32>(met.t), met.node);
}
