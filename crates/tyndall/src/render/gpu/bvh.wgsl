// The hierarchy as the CPU lays it out: twin of structure/bvh. `nodes`, `blocks`, `sizes` and `ids` read sixteen bytes each of its
// arrays; PACKING and SIZES say what blocks and sizes hold.

struct Bvh {
    // By level where it begins among the nodes, and how many it has; level 0 are the leaves.
    levels: array<vec4u, 12>,
    // The different radii, where they are few.
    radii: array<vec4f, 64>,
    // The root's level; 0 without particles.
    top: u32,
    particles: u32,
    slack: f32,
    // That of all, where it is one.
    radius: f32,
    // By what the others are scaled.
    radius_scale: f32,
    unused_0: u32,
    unused_1: u32,
    unused_2: u32,
}

@group(1) @binding(0) var<uniform> bvh: Bvh;

// The id of the particle at `node`.
fn id_of(node: u32) -> u32 {
    return ids(node >> 2u)[node & 3u];
}

fn particle_count() -> u32 {
    return bvh.particles;
}

// Center and radius of the particle at `node`.
fn sphere_of(node: u32) -> vec4f {
    return vec4f(center_of(node >> 4u, node & 15u), radius_of(node >> 4u, node & 15u));
}

// The center of the particle at `place` of a leaf.
fn center_of(leaf: u32, place: u32) -> vec3f {
    if PACKING == PACKING_EXACT {
        let at = 12u * leaf + (place >> 2u);
        let lane = place & 3u;
        return bitcast<vec3f>(vec3u(blocks(at)[lane], blocks(at + 4u)[lane], blocks(at + 8u)[lane]));
    }
    let at = BLOCK * leaf;
    let frame = blocks(at);
    var steps: vec3u;
    if PACKING == PACKING_16 {
        let row = at + 1u + (place >> 3u);
        let lane = (place >> 1u) & 3u;
        let words = vec3u(blocks(row)[lane], blocks(row + 2u)[lane], blocks(row + 4u)[lane]);
        steps = (words >> vec3u(16u * (place & 1u))) & vec3u(0xffffu);
    } else if PACKING == PACKING_11 {
        let word = blocks(at + 1u + (place >> 2u))[place & 3u];
        steps = vec3u(word & 0x7ffu, (word >> 11u) & 0x7ffu, word >> 22u);
    } else {
        let lane = place >> 2u;
        let words = vec3u(blocks(at + 1u)[lane], blocks(at + 2u)[lane], blocks(at + 3u)[lane]);
        steps = (words >> vec3u(8u * (place & 3u))) & vec3u(0xffu);
    }
    return bitcast<vec3f>(frame.xyz) + vec3f(steps) * steps_of(frame.w);
}

// Two to the power of `x` >= 0.
fn exp2_series(x: f32) -> f32 {
    let whole = i32(x);
    let t = (x - f32(whole) - 0.5) * 0.6931472;
    let series = 1.0 + t * (1.0 + t * (0.5 + t * (1.0 / 6.0 + t * (1.0 / 24.0 + t * (1.0 / 120.0 + t * (1.0 / 720.0))))));
    return 1.4142135 * series * power_of_two(u32(clamp(whole, 0, 127) + 127));
}

fn size_word(at: u32) -> u32 {
    return sizes(at >> 2u)[at & 3u];
}

// The radius of the particle at `place` of a leaf.
fn radius_of(leaf: u32, place: u32) -> f32 {
    if SIZES == SIZES_TABLE {
        let code = (sizes(leaf)[place >> 2u] >> (8u * (place & 3u))) & 255u;
        return bvh.radius_scale * bvh.radii[code >> 2u][code & 3u];
    }
    if SIZES == SIZES_EACH {
        return bvh.radius_scale * bitcast<f32>(sizes(4u * leaf + (place >> 2u))[place & 3u]);
    }
    if SIZES == SIZES_LOG {
        let at = 6u * leaf;
        let code = (size_word(at + 2u + (place >> 2u)) >> (8u * (place & 3u))) & 255u;
        let power = bitcast<f32>(size_word(at + 1u)) * f32(max(i32(code) - 1, 0));
        return bvh.radius_scale * select(bitcast<f32>(size_word(at)) * exp2_series(power), 0.0, code == 0u);
    }
    return bvh.radius;
}

// A leaf (level 0) or a node, by its place in its level: the level in the four highest bits.
fn place_of(level: u32, index: u32) -> u32 {
    return (level << 28u) | index;
}

fn level_of(place: u32) -> u32 {
    return place >> 28u;
}

fn index_of(place: u32) -> u32 {
    return place & 0xfffffffu;
}

// How many children the node at `place` has.
fn children_of(place: u32) -> u32 {
    return min(8u, bvh.levels[level_of(place) - 1u].y - 8u * index_of(place));
}

// Where the four words of the node at `place` are.
fn node_at(place: u32) -> u32 {
    return 4u * (bvh.levels[level_of(place)].x + index_of(place));
}

// Whether the node at `place` has that child, and shows any of it.
fn has_child(place: u32, child: u32) -> bool {
    if HIDES {
        return ((shown_children(node_at(place) >> 2u) >> child) & 1u) == 1u;
    }
    return child < children_of(place);
}

// The lower and the upper steps of one child, of the words of one axis.
fn child_steps(words: vec4u, child: u32) -> vec2f {
    let pair = select(words.xz, words.yw, child > 3u);
    return vec2f((pair >> vec2u(8u * (child & 3u))) & vec2u(255u));
}

struct Box {
    middle: vec3f,
    half: vec3f,
}

// Middle and half extent of a child's box, measured from `eye`; the extent grown by `margin` and against rounding.
fn child_box(at: u32, child: u32, eye: vec3f, margin: f32) -> Box {
    let head = nodes(at);
    let x = child_steps(nodes(at + 1u), child);
    let y = child_steps(nodes(at + 2u), child);
    let z = child_steps(nodes(at + 3u), child);
    let lower = vec3f(x.x, y.x, z.x);
    let upper = vec3f(x.y, y.y, z.y);
    let half_step = 0.5 * steps_of(head.w);
    let middle = (upper + lower) * half_step + (bitcast<vec3f>(head.xyz) - eye);
    let half = (upper - lower) * half_step;
    return Box(middle, (abs(middle) + half) * HIT_ROUNDING + (half + vec3f(margin)));
}
