// What leaves hold, of sorted records: blocks, radii and ids, as structure/bvh has them. A thread has four particles, a leaf four threads.

// The first of a thread's four particles.
fn first_of(group: vec3u, thread: u32) -> u32 {
    return 4u * (64u * (task.first + group.x) + thread);
}

fn has_leaf(first: u32) -> bool {
    return (first & ~15u) < task.count;
}

fn given_center(id: u32) -> vec3f {
    let at = id >> 2u;
    let lane = id & 3u;
    return bitcast<vec3f>(vec3u(xs(at)[lane], ys(at)[lane], zs(at)[lane]));
}

var<workgroup> lows: array<vec3f, 64>;
var<workgroup> highs: array<vec3f, 64>;

@compute @workgroup_size(64)
fn write_blocks(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    let first = first_of(group, thread);
    let leaf = first >> 4u;
    let place = first & 15u;
    var centers: array<vec3f, 4>;
    var low = vec3f(FAR);
    var high = vec3f(-FAR);
    for (var k = 0u; k < 4u; k += 1u) {
        if first + k < task.count {
            centers[k] = given_center(sorted(first + k).z);
            low = min(low, centers[k]);
            high = max(high, centers[k]);
        }
    }
    if PACKING == PACKING_EXACT {
        if has_leaf(first) {
            for (var axis = 0u; axis < 3u; axis += 1u) {
                for (var k = 0u; k < 4u; k += 1u) {
                    let bits = select(NAN_BITS, bitcast<u32>(centers[k][axis]), first + k < task.count);
                    set_blocks(48u * leaf + 16u * axis + place + k, bits);
                }
            }
        }
        return;
    }
    // The box of the leaf's centers.
    lows[thread] = low;
    highs[thread] = high;
    workgroupBarrier();
    let leader = thread & ~3u;
    for (var other = leader; other < leader + 4u; other += 1u) {
        low = min(low, lows[other]);
        high = max(high, highs[other]);
    }
    if !has_leaf(first) {
        return;
    }
    let most = PACKED_MOST;
    let extent = high - low;
    let exponents = vec3u(
        step_exponent(extent.x, most.x), step_exponent(extent.y, most.y), step_exponent(extent.z, most.z));
    let at = 4u * BLOCK * leaf;
    if place == 0u {
        set_blocks(at, bitcast<u32>(low.x));
        set_blocks(at + 1u, bitcast<u32>(low.y));
        set_blocks(at + 2u, bitcast<u32>(low.z));
        let held = min(16u, task.count - 16u * leaf);
        set_blocks(at + 3u, exponents.x | (exponents.y << 8u) | (exponents.z << 16u) | (held << 24u));
    }
    var steps: array<vec3u, 4>;
    for (var k = 0u; k < 4u; k += 1u) {
        if first + k < task.count {
            let off = centers[k] - low;
            steps[k] = vec3u(
                rounded(off.x * inv_step(exponents.x), most.x),
                rounded(off.y * inv_step(exponents.y), most.y),
                rounded(off.z * inv_step(exponents.z), most.z));
        }
    }
    let quarter = place >> 2u;
    if PACKING == PACKING_11 {
        for (var k = 0u; k < 4u; k += 1u) {
            set_blocks(at + 4u + place + k, steps[k].x | (steps[k].y << 11u) | (steps[k].z << 22u));
        }
        return;
    }
    for (var axis = 0u; axis < 3u; axis += 1u) {
        let own = vec4u(steps[0][axis], steps[1][axis], steps[2][axis], steps[3][axis]);
        if PACKING == PACKING_16 {
            set_blocks(at + 4u + 8u * axis + 2u * quarter, own.x | (own.y << 16u));
            set_blocks(at + 5u + 8u * axis + 2u * quarter, own.z | (own.w << 16u));
        } else {
            set_blocks(at + 4u + 4u * axis + quarter, bytes_of(own));
        }
    }
}

// Four bytes in a word.
fn bytes_of(bytes: vec4u) -> u32 {
    return bytes.x | (bytes.y << 8u) | (bytes.z << 16u) | (bytes.w << 24u);
}

// The place of a radius in the table, by its bits: of numbers that are not negative, these have their order.
fn code_of(radius: u32) -> u32 {
    var low = 0u;
    var high = 256u;
    while low + 1u < high {
        let middle = (low + high) >> 1u;
        if table(middle >> 2u)[middle & 3u] <= radius {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

var<workgroup> least: array<f32, 64>;
var<workgroup> greatest: array<f32, 64>;

@compute @workgroup_size(64)
fn write_sizes(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    let first = first_of(group, thread);
    let leaf = first >> 4u;
    let quarter = (first & 15u) >> 2u;
    var own = vec4u(0u);
    for (var k = 0u; k < 4u; k += 1u) {
        if first + k < task.count {
            own[k] = sorted(first + k).w;
        }
    }
    if SIZES == SIZES_EACH {
        if has_leaf(first) {
            for (var k = 0u; k < 4u; k += 1u) {
                set_sizes(first + k, own[k]);
            }
        }
        return;
    }
    if SIZES == SIZES_TABLE {
        if has_leaf(first) {
            var codes = vec4u(0u);
            for (var k = 0u; k < 4u; k += 1u) {
                codes[k] = select(0u, code_of(own[k]), first + k < task.count);
            }
            set_sizes(first >> 2u, bytes_of(codes));
        }
        return;
    }
    // In equal ratios from the leaf's least; what is zero stays zero.
    let radii_ = bitcast<vec4f>(own);
    let bounded = select(vec4f(FAR), radii_, radii_ > vec4f(0.0));
    least[thread] = min(min(bounded.x, bounded.y), min(bounded.z, bounded.w));
    greatest[thread] = max(max(radii_.x, radii_.y), max(radii_.z, radii_.w));
    workgroupBarrier();
    var low = FAR;
    var high = 0.0;
    let leader = thread & ~3u;
    for (var other = leader; other < leader + 4u; other += 1u) {
        low = min(low, least[other]);
        high = max(high, greatest[other]);
    }
    if !has_leaf(first) {
        return;
    }
    let ratio = (log2(high) - log2(low)) / 254.0;
    let is_some = high > 0.0;
    if quarter == 0u {
        set_sizes(6u * leaf, select(0u, bitcast<u32>(low), is_some));
        set_sizes(6u * leaf + 1u, select(0u, bitcast<u32>(ratio), is_some));
    }
    var codes = vec4u(0u);
    for (var k = 0u; k < 4u; k += 1u) {
        if is_some && radii_[k] > 0.0 {
            codes[k] = 1u + rounded((log2(radii_[k]) - log2(low)) / max(ratio, LEAST_RATIO), 254.0);
        }
    }
    set_sizes(6u * leaf + 2u + quarter, bytes_of(codes));
}

@compute @workgroup_size(64)
fn write_ids(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    let first = first_of(group, thread);
    for (var k = 0u; k < 4u; k += 1u) {
        if first + k < task.count {
            set_ids(first + k, sorted(first + k).z);
        }
    }
}
