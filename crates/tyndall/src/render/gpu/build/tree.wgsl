// Nodes over leaves, level by level. `boxes` has two elements a box, level by level too: what a leaf or a node holds, not rounded to steps.

fn set_box(at: u32, low: vec3f, high: vec3f) {
    set_boxes(2u * at, vec4u(bitcast<vec3u>(low), 0u));
    set_boxes(2u * at + 1u, vec4u(bitcast<vec3u>(high), 0u));
}

// A leaf a thread: its spheres as they are decoded.
@compute @workgroup_size(64)
fn write_leaf_boxes(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    let leaf = 64u * (task.first + group.x) + thread;
    if leaf >= task.count {
        return;
    }
    var low = vec3f(FAR);
    var high = vec3f(-FAR);
    for (var place = 0u; place < min(16u, bvh.particles - 16u * leaf); place += 1u) {
        let center = center_of(leaf, place);
        let radius = radius_of(leaf, place);
        low = min(low, center - vec3f(radius));
        high = max(high, center + vec3f(radius));
    }
    set_box(leaf, low, high);
}

// A node a thread, over up to eight of `count` boxes.
@compute @workgroup_size(64)
fn write_nodes(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    let node = 64u * (task.first + group.x) + thread;
    if 8u * node >= task.count {
        return;
    }
    let first = task.level + 8u * node;
    let children = min(8u, task.count - 8u * node);
    var low = vec3f(FAR);
    var high = vec3f(-FAR);
    for (var child = 0u; child < children; child += 1u) {
        low = min(low, bitcast<vec3f>(boxes(2u * (first + child)).xyz));
        high = max(high, bitcast<vec3f>(boxes(2u * (first + child) + 1u).xyz));
    }
    // A hair more than the extent, so that 255 steps reach past its end in spite of rounding.
    let extent = (high - low) * 1.000001;
    let exponents =
        vec3u(step_exponent(extent.x, 255.0), step_exponent(extent.y, 255.0), step_exponent(extent.z, 255.0));
    var words: array<vec4u, 3>;
    for (var child = 0u; child < children; child += 1u) {
        let from_corner = bitcast<vec3f>(boxes(2u * (first + child)).xyz) - low;
        let to_end = bitcast<vec3f>(boxes(2u * (first + child) + 1u).xyz) - low;
        let word = child >> 2u;
        let shift = 8u * (child & 3u);
        for (var axis = 0u; axis < 3u; axis += 1u) {
            words[axis][word] |= lower_step(from_corner[axis], exponents[axis]) << shift;
            words[axis][word + 2u] |= upper_step(to_end[axis], exponents[axis]) << shift;
        }
    }
    let at = 4u * (task.nodes + node);
    set_nodes(at, vec4u(bitcast<vec3u>(low), exponents.x | (exponents.y << 8u) | (exponents.z << 16u)));
    set_nodes(at + 1u, words[0]);
    set_nodes(at + 2u, words[1]);
    set_nodes(at + 3u, words[2]);
    set_box(task.next_level + node, low, high);
}
