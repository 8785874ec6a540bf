// What a pass notes of its walk for later ones: the leaves that it drew, and the subtrees that it left out because they lay behind every
// sample. Together they hold every particle that touches the tile. See visible.rs.

// By tile of the picture: how many leaves, and how many entries that were left out; or NONE if there was no room, or the tile was laid aside.
@group(2) @binding(1) var<storage, read_write> noted_counts: array<vec2u>;
// By tile: entries of the stack, leaves first.
@group(2) @binding(2) var<storage, read_write> noted_entries: array<vec2u>;

// How many were left out so far.
var<workgroup> left_out: atomic<u32>;

fn tile_number(group: vec3u) -> u32 {
    return (pass_.first_row / TILE_H + group.y) * ((pass_.size.x + TILE_W - 1u) / TILE_W) + group.x;
}

fn noted_of(group: vec3u) -> vec2u {
    return select(vec2u(NONE), noted_counts[tile_number(group)], REMEMBERS);
}

fn noted_leaf(group: vec3u, number: u32) -> vec2u {
    return noted_entries[(NOTED_LEAVES + NOTED_LEFT_OUT) * tile_number(group) + number];
}

fn noted_left_out(group: vec3u, number: u32) -> vec2u {
    return noted_entries[(NOTED_LEAVES + NOTED_LEFT_OUT) * tile_number(group) + NOTED_LEAVES + number];
}

fn note_leaf(group: vec3u, number: u32, entry: vec2u) {
    if number < NOTED_LEAVES {
        noted_entries[(NOTED_LEAVES + NOTED_LEFT_OUT) * tile_number(group) + number] = entry;
    }
}

fn note_left_out(group: vec3u, entry: vec2u) {
    let number = atomicAdd(&left_out, 1u);
    if number < NOTED_LEFT_OUT {
        noted_entries[(NOTED_LEAVES + NOTED_LEFT_OUT) * tile_number(group) + NOTED_LEAVES + number] = entry;
    }
}

fn note_counts(group: vec3u, leaves: u32, is_aside: bool) {
    let others = atomicLoad(&left_out);
    let fits = leaves <= NOTED_LEAVES && others <= NOTED_LEFT_OUT && !is_aside;
    noted_counts[tile_number(group)] = select(vec2u(NONE), vec2u(leaves, others), fits);
}
