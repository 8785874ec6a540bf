// Single rays through the hierarchy: nearest hit and any hit, a thread each. Twin of structure/bvh/rays.rs.
//
// Since a child's place follows from its parent's, and the parent's from that of any node below, no place is kept on a stack: only which
// children are left to visit, of each level. An any hit needs a bit a child, which fits registers; a nearest hit needs the distance of each,
// in order.

// Entries that the deepest hierarchy can leave when the nearest child is followed at once: seven a level.
const RAY_STACK: u32 = 7u * LEVELS + 1u;
// What is no child.
const MISSED: u32 = 0xffffffffu;

// Which children of a node a ray meets before `t_far`: where it enters their boxes, or FAR.
struct Children {
    lower: vec4f,
    upper: vec4f,
}

fn cross_children(ray: Ray, inv_direction: vec3f, place: u32, t_far: f32) -> Children {
    let at = node_at(place);
    let head = nodes(at);
    let x = nodes(at + 1u);
    let y = nodes(at + 2u);
    let z = nodes(at + 3u);
    let steps = steps_of(head.w);
    let to_corner = bitcast<vec3f>(head.xyz) - ray.origin;
    let give = (HIT_ROUNDING * (abs(to_corner) + 256.0 * steps) + vec3f(bvh.slack)) * abs(inv_direction);
    let scale = steps * inv_direction;
    let shift = to_corner * inv_direction;
    let count = vec4u(children_of(place));
    var exists0 = vec4u(0u, 1u, 2u, 3u) < count;
    var exists1 = vec4u(4u, 5u, 6u, 7u) < count;
    if HIDES {
        let shown = vec4u(shown_children(at >> 2u));
        exists0 = (shown & vec4u(1u, 2u, 4u, 8u)) != vec4u(0u);
        exists1 = (shown & vec4u(16u, 32u, 64u, 128u)) != vec4u(0u);
    }

    let x0 = cross_axis(x.x, x.z, scale.x, shift.x, give.x);
    let y0 = cross_axis(y.x, y.z, scale.y, shift.y, give.y);
    let z0 = cross_axis(z.x, z.z, scale.z, shift.z, give.z);
    let enter0 = max(max(x0.enter, y0.enter), max(z0.enter, vec4f(ray.t_min)));
    let leave0 = min(min(x0.leave, y0.leave), min(z0.leave, vec4f(t_far)));
    let met0 = (enter0 <= leave0) & exists0;

    let x1 = cross_axis(x.y, x.w, scale.x, shift.x, give.x);
    let y1 = cross_axis(y.y, y.w, scale.y, shift.y, give.y);
    let z1 = cross_axis(z.y, z.w, scale.z, shift.z, give.z);
    let enter1 = max(max(x1.enter, y1.enter), max(z1.enter, vec4f(ray.t_min)));
    let leave1 = min(min(x1.leave, y1.leave), min(z1.leave, vec4f(t_far)));
    let met1 = (enter1 <= leave1) & exists1;
    return Children(select(vec4f(FAR), enter0, met0), select(vec4f(FAR), enter1, met1));
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
        radius = bvh.radius_scale * bitcast<vec4f>(sizes(4u * leaf + part));
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

// Where the ray enters particles 4 `part` to 4 `part` + 3 of a leaf, or FAR, as where they are not shown: enter_sphere for four.
fn enter_four(ray: Ray, leaf: u32, part: u32) -> vec4f {
    let four = four_of(leaf, part);
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
    var enters = (half_chord_sq > vec4f(0.0)) & (t > vec4f(ray.t_min)) & (t < vec4f(ray.t_max));
    if HIDES {
        enters = enters & shows_four(16u * leaf + 4u * part);
    }
    return select(vec4f(FAR), t, enters);
}

// Four children as sorting keys: the distance's bits, of which the lowest three are the child. Rounded down: nothing is lost.
fn keys_of(enter: vec4f, first: u32) -> vec4u {
    let keys = (bitcast<vec4u>(max(enter, vec4f(0.0))) & vec4u(~7u)) | (vec4u(first) + vec4u(0u, 1u, 2u, 3u));
    return select(keys, vec4u(MISSED), enter == vec4f(FAR));
}

var<private> ray_stack: array<u32, RAY_STACK>;

// The particle that the ray enters first, not counting the one at node `except`. Its t_min is not negative.
fn intersect(ray: Ray, except: u32) -> Met {
    var met = Met(ray.t_max, NONE);
    let inverse = inv_direction(ray.direction);
    // How many children are left to visit, of each level: four bits.
    var left = vec2u(0u);
    var size = 0u;
    var level = bvh.top;
    var index = 0u;
    var is_on = bvh.top > 0u;
    while is_on {
        var is_down = false;
        if level > 0u {
            let children = cross_children(ray, inverse, place_of(level, index), met.t);
            let a = keys_of(children.lower, 0u);
            let b = keys_of(children.upper, 4u);
            // Batcher's network for eight: pairs, fours, eights.
            let p = min(a.xz, a.yw);
            let q = max(a.xz, a.yw);
            let r = min(b.xz, b.yw);
            let s = max(b.xz, b.yw);
            let low_a = vec2u(min(p.x, p.y), max(p.x, p.y));
            let high_a = vec2u(min(q.x, q.y), max(q.x, q.y));
            let low_b = vec2u(min(r.x, r.y), max(r.x, r.y));
            let high_b = vec2u(min(s.x, s.y), max(s.x, s.y));
            let k0 = vec4u(low_a.x, min(low_a.y, high_a.x), max(low_a.y, high_a.x), high_a.y);
            let k1 = vec4u(low_b.x, min(low_b.y, high_b.x), max(low_b.y, high_b.x), high_b.y);
            // Two sorted fours, of which one is turned around, are halves of a sequence that rises and falls.
            let turned = k1.wzyx;
            var near = min(k0, turned);
            var far = max(k0, turned);
            near = vec4u(min(near.xy, near.zw), max(near.xy, near.zw));
            near = vec4u(min(near.x, near.y), max(near.x, near.y), min(near.z, near.w), max(near.z, near.w));
            far = vec4u(min(far.xy, far.zw), max(far.xy, far.zw));
            far = vec4u(min(far.x, far.y), max(far.x, far.y), min(far.z, far.w), max(far.z, far.w));
            if near.x != MISSED {
                let before = size;
                if near.y != MISSED {
                    // The farthest lies lowest.
                    if far.w != MISSED { ray_stack[size] = far.w; size++; }
                    if far.z != MISSED { ray_stack[size] = far.z; size++; }
                    if far.y != MISSED { ray_stack[size] = far.y; size++; }
                    if far.x != MISSED { ray_stack[size] = far.x; size++; }
                    if near.w != MISSED { ray_stack[size] = near.w; size++; }
                    if near.z != MISSED { ray_stack[size] = near.z; size++; }
                    ray_stack[size] = near.y;
                    size++;
                }
                let count = size - before;
                let shift = 4u * (level & 7u);
                left |= select(vec2u(count << shift, 0u), vec2u(0u, count << shift), level > 7u);
                index = 8u * index + (near.x & 7u);
                level--;
                is_down = true;
            }
        } else {
            for (var part = 0u; part < 4u; part++) {
                let node = 16u * index + 4u * part;
                let t = enter_four(ray, index, part);
                met = nearer(met, t.x, node, except);
                met = nearer(met, t.y, node + 1u, except);
                met = nearer(met, t.z, node + 2u, except);
                met = nearer(met, t.w, node + 3u, except);
            }
        }
        // Up to the lowest level that has a child left. What lies behind the nearest hit is hidden, and so is what lies behind that.
        while !is_down && size > 0u {
            let is_low = left.x != 0u;
            let word = select(left.y, left.x, is_low);
            let place = firstTrailingBit(word) >> 2u;
            let parent = place + select(8u, 0u, is_low);
            let key = ray_stack[size - 1u];
            let count = (word >> (4u * place)) & 15u;
            is_down = bitcast<f32>(key & ~7u) <= met.t;
            let taken = select(count, 1u, is_down);
            size -= taken;
            left -= select(vec2u(0u, taken << (4u * place)), vec2u(taken << (4u * place), 0u), is_low);
            if is_down {
                index = 8u * (index >> (3u * (parent - level))) + (key & 7u);
                level = parent - 1u;
            }
        }
        is_on = is_down;
    }
    return met;
}

// Whether the ray enters any particle but the one at node `except`.
fn occluded(ray: Ray, except: u32) -> bool {
    let inverse = inv_direction(ray.direction);
    // Which children are left to visit, of each level: eight bits, from level 1 on.
    var left = vec3u(0u);
    var level = bvh.top;
    var index = 0u;
    while level <= bvh.top {
        if level == 0u {
            for (var part = 0u; part < 4u; part++) {
                let own = vec4u(16u * index + 4u * part) + vec4u(0u, 1u, 2u, 3u);
                let t = enter_four(ray, index, part);
                if any((t < vec4f(FAR)) & (own != vec4u(except)) & (own < vec4u(bvh.particles))) {
                    return true;
                }
            }
        } else {
            let children = cross_children(ray, inverse, place_of(level, index), ray.t_max);
            let lower = select(vec4u(0u), vec4u(1u, 2u, 4u, 8u), children.lower < vec4f(FAR));
            let upper = select(vec4u(0u), vec4u(16u, 32u, 64u, 128u), children.upper < vec4f(FAR));
            let sums = lower + upper;
            let mask = (sums.x + sums.y + sums.z + sums.w) << (8u * ((level - 1u) & 3u));
            left |= select(select(vec3u(0u, 0u, mask), vec3u(0u, mask, 0u), level < 9u), vec3u(mask, 0u, 0u), level < 5u);
        }
        // To a child of the lowest level that has one left.
        var word = left.x;
        var first = 1u;
        if left.x == 0u {
            word = select(left.z, left.y, left.y != 0u);
            first = select(9u, 5u, left.y != 0u);
        }
        if word == 0u {
            return false;
        }
        let bit = firstTrailingBit(word);
        let parent = first + (bit >> 3u);
        let rest = word & (word - 1u);
        left = vec3u(
            select(left.x, rest, first == 1u), select(left.y, rest, first == 5u), select(left.z, rest, first == 9u));
        index = 8u * (index >> (3u * (parent - level))) + (bit & 7u);
        level = parent - 1u;
    }
    return false;
}
