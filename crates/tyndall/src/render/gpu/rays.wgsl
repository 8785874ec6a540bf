// Single rays through the hierarchy: nearest hit and any hit, a thread each. Twin of structure/bvh/rays.rs.

// Entries that the deepest hierarchy can leave on the stack when the nearest child is followed at once: seven a level.
const RAY_STACK: u32 = 7u * LEVELS + 1u;

struct RayEntry {
    near: f32,
    place: u32,
}

var<private> ray_stack: array<RayEntry, RAY_STACK>;
var<private> ray_stack_size: u32;

// The child to follow next; the others lie on the stack.
var<private> followed: RayEntry;

// Follows the child at once if it is the nearest so far, else keeps it for later.
fn visit(near: f32, is_met: bool, place: u32) {
    if !is_met {
        return;
    }
    var later = RayEntry(near, place);
    if near < followed.near {
        later = followed;
        followed = RayEntry(near, place);
    }
    if later.place != NONE {
        ray_stack[ray_stack_size] = later;
        ray_stack_size++;
    }
}

// Where a ray enters and leaves four slabs along one axis.
struct Slabs {
    enter: vec4f,
    leave: vec4f,
}

// Bytes as numbers.
fn four_bytes(word: u32) -> vec4f {
    return vec4f((vec4u(word) >> vec4u(0u, 8u, 16u, 24u)) & vec4u(255u));
}

fn cross_axis(lower: u32, upper: u32, step: f32, to_corner: f32, inv_direction: f32, margin: f32) -> Slabs {
    let give = (HIT_ROUNDING * (abs(to_corner) + 256.0 * step) + margin) * abs(inv_direction);
    let scale = step * inv_direction;
    let shift = to_corner * inv_direction;
    let a = four_bytes(lower) * scale + shift;
    let b = four_bytes(upper) * scale + shift;
    return Slabs(min(a, b) - give, max(a, b) + give);
}

// Meets the eight boxes of a node, and pushes those that the ray is in before `t_far`.
fn visit_children(ray: Ray, inv_direction: vec3f, place: u32, t_far: f32) {
    let at = node_at(place);
    let head = nodes(at);
    let steps = steps_of(head.w);
    let to_corner = bitcast<vec3f>(head.xyz) - ray.origin;
    let x = nodes(at + 1u);
    let y = nodes(at + 2u);
    let z = nodes(at + 3u);
    let below = place_of(level_of(place) - 1u, 8u * index_of(place));
    let count = children_of(place);
    for (var half = 0u; half < 2u; half++) {
        let slabs_x = cross_axis(select(x.x, x.y, half == 1u), select(x.z, x.w, half == 1u), steps.x, to_corner.x, inv_direction.x, bvh.slack);
        let slabs_y = cross_axis(select(y.x, y.y, half == 1u), select(y.z, y.w, half == 1u), steps.y, to_corner.y, inv_direction.y, bvh.slack);
        let slabs_z = cross_axis(select(z.x, z.y, half == 1u), select(z.z, z.w, half == 1u), steps.z, to_corner.z, inv_direction.z, bvh.slack);
        let enter = max(max(slabs_x.enter, slabs_y.enter), max(slabs_z.enter, vec4f(ray.t_min)));
        let leave = min(min(slabs_x.leave, slabs_y.leave), min(slabs_z.leave, vec4f(t_far)));
        let exists = vec4u(0u, 1u, 2u, 3u) + vec4u(4u * half) < vec4u(count);
        let is_met = (enter <= leave) & exists;
        let child = below + 4u * half;
        visit(enter.x, is_met.x, child);
        visit(enter.y, is_met.y, child + 1u);
        visit(enter.z, is_met.z, child + 2u);
        visit(enter.w, is_met.w, child + 3u);
    }
}

// Four neighbors of a leaf.
struct Four {
    x: vec4f,
    y: vec4f,
    z: vec4f,
    radius: vec4f,
}

// Four steps along one axis, of columns with 16 bits.
fn four_words(pair: vec2u) -> vec4f {
    return vec4f(vec4u(pair.x & 0xffffu, pair.x >> 16u, pair.y & 0xffffu, pair.y >> 16u));
}

// Particles 4 `part` to 4 `part` + 3 of a leaf: center_of and radius_of for four.
fn four_of(leaf: u32, part: u32) -> Four {
    var radius = vec4f(bvh.radius);
    if SIZES == SIZES_EACH {
        radius = bitcast<vec4f>(sizes(4u * leaf + part));
    } else if SIZES != SIZES_UNIFORM {
        let place = 4u * part;
        radius = vec4f(
            radius_of(leaf, place), radius_of(leaf, place + 1u), radius_of(leaf, place + 2u), radius_of(leaf, place + 3u));
    }
    let at = BLOCK * leaf;
    if PACKING == PACKING_EXACT {
        return Four(
            bitcast<vec4f>(blocks(at + part)), bitcast<vec4f>(blocks(at + 4u + part)), bitcast<vec4f>(blocks(at + 8u + part)), radius);
    }
    let frame = blocks(at);
    let corner = bitcast<vec3f>(frame.xyz);
    let step = steps_of(frame.w);
    var x: vec4f;
    var y: vec4f;
    var z: vec4f;
    if PACKING == PACKING_16 {
        let row = at + 1u + (part >> 1u);
        let upper = (part & 1u) == 1u;
        let words_x = blocks(row);
        let words_y = blocks(row + 2u);
        let words_z = blocks(row + 4u);
        x = four_words(select(words_x.xy, words_x.zw, upper));
        y = four_words(select(words_y.xy, words_y.zw, upper));
        z = four_words(select(words_z.xy, words_z.zw, upper));
    } else if PACKING == PACKING_11 {
        let words = blocks(at + 1u + part);
        x = vec4f(words & vec4u(0x7ffu));
        y = vec4f((words >> vec4u(11u)) & vec4u(0x7ffu));
        z = vec4f(words >> vec4u(22u));
    } else {
        x = four_bytes(blocks(at + 1u)[part]);
        y = four_bytes(blocks(at + 2u)[part]);
        z = four_bytes(blocks(at + 3u)[part]);
    }
    return Four(x * step.x + corner.x, y * step.y + corner.y, z * step.z + corner.z, radius);
}

// What a ray met: distance, or the ray's t_max, and node, or NONE.
struct Met {
    t: f32,
    node: u32,
}

// Where the ray enters four particles of a leaf, in one of which it may begin to be hidden before `t_far`: enter_sphere for four.
fn enter_four(ray: Ray, four: Four) -> vec4f {
    let to_x = four.x - ray.origin.x;
    let to_y = four.y - ray.origin.y;
    let to_z = four.z - ray.origin.z;
    let d = ray.direction;
    let closest = to_x * d.x + to_y * d.y + to_z * d.z;
    let off_x = to_x - closest * d.x;
    let off_y = to_y - closest * d.y;
    let off_z = to_z - closest * d.z;
    let half_chord_sq = four.radius * four.radius - (off_x * off_x + off_y * off_y + off_z * off_z);
    let t = closest - sqrt(max(half_chord_sq, vec4f(0.0)));
    let enters = (half_chord_sq > vec4f(0.0)) & (t > vec4f(ray.t_min)) & (t < vec4f(ray.t_max));
    return select(vec4f(FAR), t, enters);
}

// The nearer of the two; equally near, that with the smaller id.
fn nearer(met: Met, t: f32, node: u32, except: u32) -> Met {
    if t > met.t || t == FAR || node == except || node >= bvh.particles {
        return met;
    }
    if t == met.t && met.node != NONE && id_of(met.node) < id_of(node) {
        return met;
    }
    return Met(t, node);
}

// The particle that the ray enters first, not counting the one at node `except`.
fn intersect(ray: Ray, except: u32) -> Met {
    var met = Met(ray.t_max, NONE);
    let inverse = inv_direction(ray.direction);
    ray_stack_size = 0u;
    var place = place_of(bvh.top, 0u);
    var is_on = bvh.top > 0u;
    while is_on {
        if level_of(place) == 0u {
            let leaf = index_of(place);
            for (var part = 0u; part < 4u; part++) {
                let node = 16u * leaf + 4u * part;
                let t = enter_four(ray, four_of(leaf, part));
                met = nearer(met, t.x, node, except);
                met = nearer(met, t.y, node + 1u, except);
                met = nearer(met, t.z, node + 2u, except);
                met = nearer(met, t.w, node + 3u, except);
            }
            followed = RayEntry(FAR, NONE);
        } else {
            followed = RayEntry(FAR, NONE);
            visit_children(ray, inverse, place, met.t);
        }
        // What lies behind the nearest hit is hidden.
        while followed.place == NONE && ray_stack_size > 0u {
            ray_stack_size--;
            let entry = ray_stack[ray_stack_size];
            if entry.near <= met.t {
                followed = entry;
            }
        }
        is_on = followed.place != NONE;
        place = followed.place;
    }
    return met;
}

// Whether the ray enters any particle but the one at node `except`.
fn occluded(ray: Ray, except: u32) -> bool {
    let inverse = inv_direction(ray.direction);
    ray_stack_size = 0u;
    var place = place_of(bvh.top, 0u);
    while true {
        followed = RayEntry(FAR, NONE);
        if level_of(place) == 0u {
            let leaf = index_of(place);
            for (var part = 0u; part < 4u; part++) {
                let nodes_of = vec4u(16u * leaf + 4u * part) + vec4u(0u, 1u, 2u, 3u);
                let t = enter_four(ray, four_of(leaf, part));
                if any((t < vec4f(FAR)) & (nodes_of != vec4u(except)) & (nodes_of < vec4u(bvh.particles))) {
                    return true;
                }
            }
        } else {
            visit_children(ray, inverse, place, ray.t_max);
        }
        if followed.place == NONE {
            if ray_stack_size == 0u {
                return false;
            }
            ray_stack_size--;
            followed = ray_stack[ray_stack_size];
        }
        place = followed.place;
    }
    return false;
}
