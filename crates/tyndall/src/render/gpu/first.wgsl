// The first walk: a workgroup is a tile of the band. A tile that takes too many steps is laid aside with what it has found so far.

struct Aside {
    // Workgroups of the second walk: tiles that were laid aside, and parts of each.
    count: atomic<u32>,
    parts: u32,
    one: u32,
    unused: u32,
    // Column and row of each tile, sixteen bits each.
    tiles: array<u32>,
}

@group(2) @binding(0) var<storage, read_write> aside: Aside;

fn tile_corner_of(group: vec3u) -> vec2u {
    return vec2u(TILE_W, TILE_H) * group.xy + vec2u(0u, pass_.first_row);
}

// Whether there is room for the tile among those that wait.
fn lay_aside(group: vec3u) -> bool {
    let at = atomicAdd(&aside.count, 1u);
    if at >= MOST_ASIDE {
        atomicMin(&aside.count, MOST_ASIDE);
        return false;
    }
    aside.tiles[at] = group.x | (group.y << 16u);
    return true;
}
