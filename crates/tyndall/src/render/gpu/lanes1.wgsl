// One sample a thread. What differs between this file and lanes4.wgsl is the width alone.

alias Lanes = f32;
alias LanesU = u32;
alias LanesB = bool;

fn any_of(lanes: LanesB) -> bool {
    return lanes;
}

fn max_of(lanes: Lanes) -> f32 {
    return lanes;
}

fn samples_x(first: u32) -> Lanes {
    return samples[first].x;
}

fn samples_y(first: u32) -> Lanes {
    return samples[first].y;
}

// Where nothing was met, there is no id.
fn smaller_id(node: u32, met: LanesU) -> LanesB {
    let than = select(met, LanesU(node), met == LanesU(NONE));
    return id_of(node) < id_of(than);
}

fn store_hits(first: u32, depth: Lanes, node: LanesU) {
    hits[first] = vec2u(bitcast<u32>(depth), node);
}

fn load_hits(first: u32) -> Found {
    let hit = hits[first];
    return Found(bitcast<f32>(hit.x), hit.y);
}
