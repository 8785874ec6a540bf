// Four samples of a pixel side by side. What differs between this file and lanes1.wgsl is the width alone.

alias Lanes = vec4f;
alias LanesU = vec4u;
alias LanesB = vec4<bool>;

fn any_of(lanes: LanesB) -> bool {
    return any(lanes);
}

fn max_of(lanes: Lanes) -> f32 {
    return max(max(lanes.x, lanes.y), max(lanes.z, lanes.w));
}

fn samples_x(first: u32) -> Lanes {
    return vec4f(samples[first].x, samples[first + 1u].x, samples[first + 2u].x, samples[first + 3u].x);
}

fn samples_y(first: u32) -> Lanes {
    return vec4f(samples[first].y, samples[first + 1u].y, samples[first + 2u].y, samples[first + 3u].y);
}

// Where nothing was met, there is no id.
fn smaller_id(node: u32, met: LanesU) -> LanesB {
    let than = select(met, LanesU(node), met == LanesU(NONE));
    return vec4<bool>(
        id_of(node) < id_of(than.x), id_of(node) < id_of(than.y), id_of(node) < id_of(than.z), id_of(node) < id_of(than.w));
}

fn store_hits(first: u32, depth: Lanes, node: LanesU) {
    let bits = bitcast<vec4u>(depth);
    hits[first] = vec2u(bits.x, node.x);
    hits[first + 1u] = vec2u(bits.y, node.y);
    hits[first + 2u] = vec2u(bits.z, node.z);
    hits[first + 3u] = vec2u(bits.w, node.w);
}

fn load_hits(first: u32) -> Found {
    let a = hits[first];
    let b = hits[first + 1u];
    let c = hits[first + 2u];
    let d = hits[first + 3u];
    return Found(bitcast<vec4f>(vec4u(a.x, b.x, c.x, d.x)), vec4u(a.y, b.y, c.y, d.y));
}
