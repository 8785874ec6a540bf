// The second walk: a workgroup is a part of a tile that was laid aside, and begins with what the first walk has found.

struct Aside {
    count: u32,
    parts: u32,
    one: u32,
    unused: u32,
    tiles: array<u32>,
}

@group(2) @binding(0) var<storage, read> aside: Aside;

fn tile_corner_of(group: vec3u) -> vec2u {
    let tile = aside.tiles[group.x];
    let part = vec2u(group.y % PARTS_ACROSS, group.y / PARTS_ACROSS);
    let extent = vec2u(TILE_W, TILE_H);
    let whole = extent * vec2u(PARTS_ACROSS, PARTS_DOWN);
    return whole * vec2u(tile & 0xffffu, tile >> 16u) + extent * part + vec2u(0u, pass_.first_row);
}

// Nobody waits for it: it is walked to the end.
fn lay_aside(group: vec3u) -> bool {
    return false;
}
