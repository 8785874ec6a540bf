// A frame of culling by confidence: a ray a sample, cut where its pixel is likely to be covered. A thread is a pixel. Twin of
// render/cpu/confidence.rs and of the walk in structure/bvh/rays.rs, in whose order the particles are told.

// No uniform: Mesa 22.3 makes kernels anew for the values of uniforms that decide where they branch, and fails at this one.
@group(2) @binding(0) var<storage, read> culling: Culling;
// By pixel of the picture what it knows, and depth and confidence of its cull buffer.
@group(2) @binding(1) var<storage, read_write> pixels: array<Pixel>;
@group(2) @binding(2) var<storage, read_write> pairs: array<vec2f>;
// By slab and pixel of the band: particles in front.
@group(2) @binding(3) var<storage, read_write> histograms: array<f32>;

// What the thread's pixel knows; its histogram, once a particle was met.
var<private> pixel_: Pixel;
var<private> histogram: Histogram;
var<private> is_marched: bool;
// By level which children are left to visit, the nearest in the lowest bits: eight and its number.
var<private> left_children: array<u32, LEVELS + 1u>;

// The children of a node that a ray meets, in order. All of them will be visited, so that only their order is kept.
fn in_order(children: Children) -> u32 {
    var enter = array<f32, 8>(
        children.lower.x, children.lower.y, children.lower.z, children.lower.w,
        children.upper.x, children.upper.y, children.upper.z, children.upper.w);
    var order = 0u;
    for (var child = 0u; child < 8u; child++) {
        let near = max(enter[child], 0.0);
        if near == FAR {
            continue;
        }
        var before = 0u;
        for (var other = 0u; other < 8u; other++) {
            let is_nearer = max(enter[other], 0.0) < near || (max(enter[other], 0.0) == near && other < child);
            before += select(0u, 1u, is_nearer);
        }
        order |= (8u + child) << (4u * before);
    }
    return order;
}

// One particle that the sample's ray enters, the number `number` that it tells of.
fn learn(ray: Ray, place: vec2u, sample: u32, number: u32, t: f32, node: u32) {
    let view = pass_.view;
    if !is_marched {
        is_marched = true;
        var center = view_ray(view, f32(place.x) + 0.5, f32(place.y) + 0.5);
        center.t_max = ray.t_max;
        histogram = march(view, center, (place.y - pass_.first_row) * pass_.size.x + place.x);
    }
    let cosine = select(1.0, dot(ray.direction, view.forward), PERSPECTIVE);
    let pixel_edge = select(view.pixel, view.pixel * t * cosine, PERSPECTIVE);
    let share = share_of(min(radius_of(node >> 4u, node & 15u) / pixel_edge, 1e15));
    let depth = select(t, back_of_slab(histogram, t), culling.depth_quantization == 1u);
    let key = vec4u(place.x | (place.y << 16u), culling.first + sample, number, culling.seed);
    pixel_ = add_sample(pixel_, histogram, depth, share, key);
}

// Tells every particle that the ray enters; the first along it.
fn hits_of(ray: Ray, place: vec2u, sample: u32) -> Met {
    var met = Met(ray.t_max, NONE);
    let inverse = inv_direction(ray.direction);
    var number = 0u;
    var level = bvh.top;
    var index = 0u;
    var is_on = bvh.top > 0u;
    while is_on {
        if level > 0u {
            left_children[level] = in_order(cross_children(ray, inverse, place_of(level, index), ray.t_max));
        } else {
            for (var part = 0u; part < 4u; part++) {
                let t = enter_four(ray, index, part);
                for (var lane = 0u; lane < 4u; lane++) {
                    let node = 16u * index + 4u * part + lane;
                    if t[lane] < FAR && node < bvh.particles {
                        learn(ray, place, sample, number, t[lane], node);
                        number++;
                        met = nearer(met, t[lane], node, NONE);
                    }
                }
            }
            level = 1u;
            index = index >> 3u;
        }
        // Up to the lowest level that has a child left, and down to that child.
        while level < bvh.top && left_children[level] == 0u {
            level++;
            index = index >> 3u;
        }
        let left = left_children[level];
        is_on = left != 0u;
        left_children[level] = left >> 4u;
        level--;
        index = 8u * index + (left & 7u);
    }
    return met;
}

@compute @workgroup_size(8, 8)
fn find_hits(@builtin(global_invocation_id) thread: vec3u) {
    let place = vec2u(thread.x, thread.y + pass_.first_row);
    if any(place >= pass_.size) {
        return;
    }
    let at = place.y * pass_.size.x + place.x;
    pixel_ = pixels[at];
    if culling.is_new == 1u {
        pixel_ = Pixel(Estimate(FAR, 0.0, 1u, 0.0), Estimate(FAR, 0.0, 1u, 0.0), FAR, 0u);
    }
    is_marched = false;
    let is_final = pixel_.unchanged >= culling.convergence_samples;
    // What is met at the depth itself is not behind it.
    let t_max = select(FAR, bitcast<f32>(bitcast<u32>(pixel_.clip) + 1u), pixel_.clip < FAR);
    for (var sample = 0u; sample < SAMPLES; sample++) {
        let point = samples[first_sample(place) + sample] + pattern_corner(place);
        var ray = view_ray(pass_.view, point.x, point.y);
        ray.t_max = t_max;
        var met: Met;
        if is_final {
            met = intersect(ray, NONE);
        } else {
            met = hits_of(ray, place, sample);
        }
        hits[first_hit(place) + sample] = vec2u(bitcast<u32>(select(met.t, FAR, met.node == NONE)), met.node);
    }
    if !is_final || culling.is_new == 1u {
        pixels[at] = pixel_;
        pairs[at] = vec2f(pixel_.cull.depth, pixel_.cull.confidence);
    }
}
