// The formulas of culling by confidence: twins of render/confidence, function by function.

const PI: f32 = 3.14159265;
const TWICE_DISTANCE: f32 = 512.0 / (45.0 * PI * PI);
// Of a pixel a particle covers never quite all.
const MOST: f32 = 0x1.fffffep-1f;

// footprint.rs: the mean share of the pixel that a particle covers; `radius` is in pixels.
fn share_of(radius: f32) -> f32 {
    let small = PI * radius * radius * (1.0 - TWICE_DISTANCE * radius + radius * radius / PI);
    let wide = max(radius, 0.5);
    let large = min(1.0 - (1.0 / 3.0 - 0.00773 / (wide * wide)) / wide, MOST);
    return select(large, small, radius <= 0.5);
}

// footprint.rs: how many particles samples are drawn from for each that has its center in the frustum, where a pixel's edge is `pixel`.
fn drawn_from(pixel: f32) -> f32 {
    let share = share_of(culling.radius / pixel);
    let drawn = PI * culling.radius_sq / (pixel * pixel * select(1.0, share, share > 0.0));
    return select(1.0, drawn, share > 0.0);
}

// gaussian.rs: the integral of the standard normal density up to `z`.
fn normal_integral(z: f32) -> f32 {
    let place = (z + culling.normal_limit) * (f32(NORMAL_STEPS) / (2.0 * culling.normal_limit));
    if !(place > 0.0) {
        return 0.0;
    }
    if place >= f32(NORMAL_STEPS) {
        return 1.0;
    }
    let step = u32(place);
    let low = culling.normal[step >> 2u][step & 3u];
    let high = culling.normal[(step + 1u) >> 2u][(step + 1u) & 3u];
    return low + (high - low) * (place - f32(step));
}

// grid.rs: the count of a voxel.
fn count_at(x: u32, y: u32, z: u32) -> f32 {
    let at = (z * culling.voxels.y + y) * culling.voxels.x + x;
    return f32(voxels(at >> 2u)[at & 3u]);
}

// grid.rs: the count at a place between the centers of voxels, which lie at whole numbers.
fn count_between(place: vec3f) -> f32 {
    let last = culling.voxels - vec3u(1u);
    let inside = clamp(place, vec3f(0.0), vec3f(last));
    let low = min(vec3u(inside), last);
    let high = min(low + vec3u(1u), last);
    let along = inside - vec3f(low);
    var planes: vec2f;
    for (var k = 0u; k < 2u; k++) {
        let z = select(low.z, high.z, k == 1u);
        let a = count_at(low.x, low.y, z);
        let b = count_at(low.x, high.y, z);
        let line_a = a + (count_at(high.x, low.y, z) - a) * along.x;
        let line_b = b + (count_at(high.x, high.y, z) - b) * along.x;
        planes[k] = line_a + (line_b - line_a) * along.y;
    }
    return planes.x + (planes.y - planes.x) * along.z;
}

// grid.rs: particles per voxel at a point.
fn density_at(point: vec3f) -> f32 {
    if any(point < culling.low) || any(point > culling.high) {
        return 0.0;
    }
    let place = (point - culling.low) * culling.inv_edge;
    if culling.trilinear == 1u {
        return count_between(place - 0.5) * culling.unit;
    }
    let own = min(vec3u(place), culling.voxels - vec3u(1u));
    return count_at(own.x, own.y, own.z) * culling.unit;
}

// math.rs, `Bounds::clip` of the grid's box: where the ray is inside of it; twice 0 if it never is.
fn clip_to_grid(ray: Ray) -> vec2f {
    let inverse = inv_direction(ray.direction);
    let is_forward = inverse > vec3f(0.0);
    let near = (select(culling.high, culling.low, is_forward) - ray.origin) * inverse;
    let far = (select(culling.low, culling.high, is_forward) - ray.origin) * inverse;
    let enter = max(max(near.x, near.y), max(near.z, ray.t_min));
    let leave = min(min(far.x, far.y), min(far.z, ray.t_max));
    return select(vec2f(0.0), vec2f(enter, leave), enter < leave);
}

// histogram.rs: how many particles are in a pixel's frustum up to each depth.
struct Histogram {
    enter: f32,
    leave: f32,
    first: f32,
    step: f32,
    // Particles in front of the end.
    total: f32,
    // Slabs: those in front of each stand in `histograms` from `at` on, a stride apart.
    slabs: u32,
    at: u32,
}

// histogram.rs: marches along `ray`, the ray through the center of a pixel of `view`, up to its end.
fn march(view: View, ray: Ray, at: u32) -> Histogram {
    let direction = abs(ray.direction);
    var axis = select(0u, 1u, direction.y > direction.x);
    axis = select(axis, 2u, direction.z > direction[axis]);
    let speed = ray.direction[axis];
    let start = culling.low[axis];
    let edge = culling.edge[axis];
    let most = culling.voxels[axis];
    let inside = clip_to_grid(ray);
    let place = clamp((ray.origin[axis] + inside.x * speed - start) / edge, 0.0, f32(most));
    let side = select(ceil(place), floor(place), speed >= 0.0);
    let step = edge / abs(speed);
    let first = min((start + side * edge - ray.origin[axis]) / speed, inside.x);
    let cosine = dot(ray.direction, view.forward);
    let slabs = u32(clamp(ceil((inside.y - first) / step), 0.0, f32(most + 2u)));
    var sum = 0.0;
    histograms[at] = 0.0;
    for (var number = 0u; number < slabs; number++) {
        let near = max(first + f32(number) * step, inside.x);
        let far = min(first + f32(number + 1u) * step, inside.y);
        if near < far {
            let t = 0.5 * (near + far);
            let density = density_at(ray.origin + t * ray.direction);
            if density > 0.0 {
                let pixel = select(view.pixel, view.pixel * t * cosine, PERSPECTIVE);
                let sides = vec3f(pixel, pixel, cosine * (far - near)) / culling.edge;
                sum += density * (sides.x * sides.y * sides.z) * drawn_from(pixel);
            }
        }
        histograms[at + (number + 1u) * culling.stride] = sum;
    }
    return Histogram(inside.x, inside.y, first, step, sum, slabs, at);
}

// histogram.rs: particles in front of depth `t`.
fn before(histogram: Histogram, t: f32) -> f32 {
    if t <= histogram.enter {
        return 0.0;
    }
    if t >= histogram.leave {
        return histogram.total;
    }
    let last = f32(max(histogram.slabs, 1u) - 1u);
    let place = clamp(floor((t - histogram.first) / histogram.step), 0.0, last);
    let near = max(histogram.first + place * histogram.step, histogram.enter);
    let far = min(histogram.first + (place + 1.0) * histogram.step, histogram.leave);
    let along = select(1.0, clamp((t - near) / (far - near), 0.0, 1.0), near < far);
    let at = histogram.at + u32(place) * culling.stride;
    let low = histograms[at];
    return low + (histograms[at + culling.stride] - low) * along;
}

// histogram.rs: particles behind depth `t`.
fn behind(histogram: Histogram, t: f32) -> f32 {
    return max(histogram.total - before(histogram, t), 0.0);
}

// histogram.rs: where the pixel's ray leaves the slab of voxels that depth `t` is in.
fn back_of_slab(histogram: Histogram, t: f32) -> f32 {
    let number = floor((t - histogram.first) / histogram.step);
    return max(histogram.first + (number + 1.0) * histogram.step, t);
}

// accumulate.rs: equation 5.1.
fn expected_unique(population: f32, samples: u32) -> f32 {
    return -population * exp_m1(f32(samples) * ln_1p(-1.0 / population));
}

// accumulate.rs: equation 5.4.
fn covered(confidence: f32, share: f32, new_ones: f32) -> f32 {
    return confidence - (1.0 - confidence) * exp_m1(new_ones * ln_1p(-share));
}

// accumulate.rs, `Estimate::accumulate`: with a sample more in front of the depth.
fn accumulate(estimate: Estimate, share: f32, population: f32) -> Estimate {
    let unique = expected_unique(population, estimate.next);
    let confidence = covered(estimate.confidence, share, max(unique - estimate.unique, 0.0));
    return Estimate(estimate.depth, confidence, estimate.next + select(1u, 0u, estimate.next == 0xffffffffu), unique);
}

// accumulate.rs, `Estimate::occluded`: equation 2.2.
fn occluded_behind(estimate: Estimate, histogram: Histogram) -> f32 {
    return behind(histogram, estimate.depth) * estimate.confidence;
}

// accumulate.rs, `Accumulator::population`: the particles that samples up to `depth` are drawn from.
fn population(histogram: Histogram, depth: f32) -> f32 {
    if culling.up_to_depth == 1u {
        return max(before(histogram, depth), 1.0);
    }
    return max(histogram.total, 1.0);
}

// accumulate.rs: samples that it takes to reach a confidence above `wanted`; 0 if no number does.
fn samples_needed(wanted: f32, share: f32, population: f32) -> u32 {
    if wanted < share {
        return 1u;
    }
    if wanted >= 1.0 || share <= 0.0 {
        return 0u;
    }
    let unique = ln_1p(-wanted) / ln_1p(-share);
    if unique >= population {
        return 0u;
    }
    // More than any budget are as many as none.
    return u32(min(ln_1p(-unique / population) / ln_1p(-1.0 / population), 1e9)) + 1u;
}

// accumulate.rs: the probability of at least `wanted` successes of probability `p` in the budget of samples (equation 5.5).
fn at_least(wanted: u32, p: f32) -> f32 {
    let trials = f32(culling.sample_budget);
    if wanted == 0u {
        return 1.0;
    }
    if wanted > culling.sample_budget {
        return 0.0;
    }
    let deviation = sqrt(max(trials * p * (1.0 - p), 0.0));
    let below = f32(wanted) - 0.5 - trials * p;
    if deviation < 1e-6 {
        return select(0.0, 1.0, below < 0.0);
    }
    return normal_integral(-below / deviation);
}

// accumulate.rs: the probability that the nearer `depth` will save more than `current` within the budget of samples.
fn acceptance(current: Estimate, histogram: Histogram, depth: f32, share: f32) -> f32 {
    let left = behind(histogram, depth);
    if !(left > 0.0 && histogram.total > 0.0) {
        return 0.0;
    }
    let wanted = occluded_behind(current, histogram) / left;
    let samples = samples_needed(wanted, share, population(histogram, depth));
    if samples == 0u {
        return 0.0;
    }
    return at_least(samples - 1u, before(histogram, depth) / histogram.total);
}

// accumulate.rs, `Accumulator::add`: a particle that covers `share` of the pixel was met at `depth`; `key` gives the random number.
fn add_sample(pixel: Pixel, histogram: Histogram, depth: f32, share: f32, key: vec4u) -> Pixel {
    var after = pixel;
    if depth <= after.cull.depth {
        after.cull = accumulate(after.cull, share, population(histogram, after.cull.depth));
    }
    if depth <= after.accumulation.depth {
        var is_taken = false;
        if depth < after.accumulation.depth {
            is_taken = unit_f32(hash4(key).x) < acceptance(after.accumulation, histogram, depth, share);
        }
        if is_taken {
            after.accumulation = Estimate(depth, share, 2u, 1.0);
        } else {
            after.accumulation = accumulate(after.accumulation, share, population(histogram, after.accumulation.depth));
        }
    }
    if occluded_behind(after.cull, histogram) < occluded_behind(after.accumulation, histogram) {
        after.cull = after.accumulation;
    }
    return after;
}
