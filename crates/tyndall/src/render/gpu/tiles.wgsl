// The tile sample buffer: what every sample of a tile of pixels meets. Twin of render/cpu/tiles.rs.
//
// A workgroup is a tile. Its threads walk the hierarchy together, front to back, with one stack: a step takes the nearest entries
// that can still matter, which are leaves before nodes, since deeper levels lie above higher ones. Of nodes eight threads test the
// eight children and push those that can matter, the nearest last; of leaves sixteen threads project the sixteen particles, and
// then each thread tests its samples against those that cover its pixel.
// Two copies of what is gathered take turns, so that one is emptied while the other is read.

// Entries looked at in a step.
const WINDOW: u32 = min(THREADS, 64u);
// Words of a mask with a bit a thread, and of one with a bit an entry of the window.
const WORDS: u32 = (THREADS + 31u) / 32u;
const HALF_TILE: vec2f = 0.5 * vec2f(f32(TILE_W), f32(TILE_H));

// Subtrees still to be walked: the nearest depth's bits, of which the lowest four are the tile's quarters, and the place.
var<workgroup> stack: array<vec2u, STACK>;
var<workgroup> stack_size: u32;
// Whether the second walk goes on with the tile.
var<workgroup> is_aside: bool;
// Deepest sample of each quarter.
var<workgroup> deepest: array<atomic<u32>, 8>;
// Which of the topmost entries can still matter, and which of those are leaves.
var<workgroup> open_entries: array<atomic<u32>, 4>;
var<workgroup> open_leaves: array<atomic<u32>, 4>;
// Which threads' children are pushed, and where they start.
var<workgroup> kept: array<atomic<u32>, 2u * WORDS>;
var<workgroup> child_near: array<f32, THREADS>;
// By column and row of pixels which threads' particles cover it.
var<workgroup> columns: array<atomic<u32>, 2u * TILE_W * WORDS>;
var<workgroup> rows: array<atomic<u32>, 2u * TILE_H * WORDS>;
// Center and radius of each thread's particle, and where it starts and its node.
var<workgroup> sphere: array<vec4f, THREADS>;
var<workgroup> sphere_near: array<f32, THREADS>;
var<workgroup> sphere_node: array<u32, THREADS>;

// The rays of a group of samples: their origins (orthographic) or directions (perspective); the other is the view's.
struct Rays {
    x: Lanes,
    y: Lanes,
    z: Lanes,
}

// What a group of samples has met so far.
struct Found {
    depth: Lanes,
    node: LanesU,
}

// The rays through the samples from `first` on, of the pixel in the pattern at `corner`: view_ray on lanes.
fn rays_of(first: u32, corner: vec2f) -> Rays {
    let view = pass_.view;
    let u = (samples_x(first) + Lanes(corner.x)) * view.pixel + Lanes(view.left);
    let v = Lanes(view.top) - (samples_y(first) + Lanes(corner.y)) * view.pixel;
    let base = select(view.eye, view.forward, PERSPECTIVE);
    var x = u * view.right.x + v * view.up.x + Lanes(base.x);
    var y = u * view.right.y + v * view.up.y + Lanes(base.y);
    var z = u * view.right.z + v * view.up.z + Lanes(base.z);
    if PERSPECTIVE {
        let scale = Lanes(1.0) / sqrt(x * x + y * y + z * z);
        x *= scale;
        y *= scale;
        z *= scale;
    }
    return Rays(x, y, z);
}

// What a walk did: tests of a thread's samples against a particle; steps, leaves and nodes of the tile.
struct Work {
    tests: u32,
    steps: u32,
    leaves: u32,
    nodes: u32,
}

// Tests a particle against a group of samples and keeps what is nearer; equally near, the smaller id. enter_sphere on lanes.
fn test(found: Found, rays: Rays, center: vec3f, radius: f32, node: u32) -> Found {
    let view = pass_.view;
    let d = Rays(
        select(Lanes(view.forward.x), rays.x, PERSPECTIVE),
        select(Lanes(view.forward.y), rays.y, PERSPECTIVE),
        select(Lanes(view.forward.z), rays.z, PERSPECTIVE));
    let to_x = Lanes(center.x) - select(rays.x, Lanes(view.eye.x), PERSPECTIVE);
    let to_y = Lanes(center.y) - select(rays.y, Lanes(view.eye.y), PERSPECTIVE);
    let to_z = Lanes(center.z) - select(rays.z, Lanes(view.eye.z), PERSPECTIVE);
    let closest = to_x * d.x + to_y * d.y + to_z * d.z;
    let off_x = to_x - closest * d.x;
    let off_y = to_y - closest * d.y;
    let off_z = to_z - closest * d.z;
    let half_chord_sq = Lanes(radius * radius) - (off_x * off_x + off_y * off_y + off_z * off_z);
    let t = closest - sqrt(max(half_chord_sq, Lanes(0.0)));
    let enters = (half_chord_sq > Lanes(0.0)) & (t > Lanes(0.0));
    var wins = enters & (t < found.depth);
    let ties = enters & (t == found.depth);
    if any_of(ties) {
        wins = wins | (ties & smaller_id(node, found.node));
    }
    return Found(select(found.depth, t, wins), select(found.node, LanesU(node), wins));
}

// The place of bit number `n` among those that are set.
fn place_of_bit(mask: vec2u, n: u32) -> u32 {
    let in_low = countOneBits(mask.x);
    var word = select(mask.y, mask.x, n < in_low);
    for (var left = select(n - in_low, n, n < in_low); left > 0u; left--) {
        word &= word - 1u;
    }
    return firstTrailingBit(word) + select(32u, 0u, n < in_low);
}

fn count_of(mask: vec2u) -> u32 {
    return countOneBits(mask.x) + countOneBits(mask.y);
}

@compute @workgroup_size(THREADS)
fn find_hits(@builtin(workgroup_id) tile: vec3u, @builtin(local_invocation_index) thread: u32) {
    let view = pass_.view;
    let tile_corner = tile_corner_of(tile);
    let beam = beam_of(view, vec2f(tile_corner), 2.0 * HALF_TILE);
    let margin = HIT_ROUNDING * beam.spread + bvh.slack;

    // The thread's pixel, and its samples.
    let in_tile = vec2u((thread / SPLIT) % TILE_W, (thread / SPLIT) / TILE_W);
    let pixel = tile_corner + in_tile;
    let quad = select(0u, 1u, 2u * in_tile.x >= TILE_W) + select(0u, 2u, 2u * in_tile.y >= TILE_H);
    // With fewer samples than threads of a pixel, some only help to walk.
    let own_first = (thread % SPLIT) * OWN_SAMPLES;
    let inside = pixel.x < pass_.size.x && pixel.y < pass_.size.y && own_first < SAMPLES;
    let first = first_sample(pixel) + min(own_first, SAMPLES - OWN_SAMPLES);
    let corner = pattern_corner(pixel);
    let rays_a = rays_of(first, corner);
    var rays_b = rays_a;
    var rays_c = rays_a;
    var rays_d = rays_a;
    if GROUPS > 1u {
        rays_b = rays_of(first + 4u, corner);
        rays_c = rays_of(first + 8u, corner);
        rays_d = rays_of(first + 12u, corner);
    }
    // Samples beside the picture are closed from the start.
    let open = Found(Lanes(select(0.0, FAR, inside)), LanesU(NONE));
    var found_a = open;
    var found_b = open;
    var found_c = open;
    var found_d = open;
    if IS_SECOND && inside {
        let at = first_hit(pixel) + own_first;
        found_a = load_hits(at);
        if GROUPS > 1u {
            found_b = load_hits(at + 4u);
            found_c = load_hits(at + 8u);
            found_d = load_hits(at + 12u);
        }
    }
    var own_deepest = max_of(found_a.depth);
    if GROUPS > 1u {
        own_deepest = max(
            max(own_deepest, max_of(found_b.depth)), max(max_of(found_c.depth), max_of(found_d.depth)));
    }

    // Empty what is gathered, and begin at the root, or with what an earlier pass has noted.
    let noted = noted_of(tile);
    let is_remembered = REMEMBERS && noted.x != NONE;
    if thread < 4u {
        atomicStore(&deepest[thread], select(bitcast<u32>(FAR), 0u, IS_SECOND));
        atomicStore(&deepest[4u + thread], 0u);
        atomicStore(&open_entries[thread], 0u);
        atomicStore(&open_leaves[thread], 0u);
    }
    if thread < 2u * WORDS {
        atomicStore(&kept[thread], 0u);
    }
    for (var k = thread; k < 2u * TILE_W * WORDS; k += THREADS) {
        atomicStore(&columns[k], 0u);
    }
    for (var k = thread; k < 2u * TILE_H * WORDS; k += THREADS) {
        atomicStore(&rows[k], 0u);
    }
    if thread == 0u {
        stack[0] = vec2u(15u, place_of(bvh.top, 0u));
        stack_size = select(0u, 1u, bvh.top > 0u && !is_remembered);
        is_aside = false;
        if NOTES {
            atomicStore(&left_out, 0u);
        }
    }
    if IS_SECOND {
        workgroupBarrier();
        atomicMax(&deepest[quad], bitcast<u32>(own_deepest));
    }

    // What the walk does, where that is asked for instead of what it finds.
    var work = Work(0u, 0u, 0u, 0u);
    // How much of what an earlier pass has noted was taken up: leaves, and what it left out.
    var taken_up = vec2u(0u);
    // Which copy is in use: of what is looked at, what leaves gather, what nodes gather.
    var turn = 0u;
    var leaf_turn = 0u;
    var node_turn = 0u;
    loop {
        workgroupBarrier();
        let size = stack_size;
        if size == 0u {
            if !is_remembered || all(taken_up == noted) {
                break;
            }
            // Leaves that were drawn before come first, the nearest on top.
            if taken_up.x < noted.x {
                let count = min(WINDOW, noted.x - taken_up.x);
                if thread < count {
                    stack[count - 1u - thread] = noted_leaf(tile, taken_up.x + thread);
                }
                taken_up.x += count;
                // All have read that the stack is empty.
                workgroupBarrier();
                if thread == 0u {
                    stack_size = count;
                }
                continue;
            }
            // Then what lay behind all samples, where it no longer does; deeper levels on top.
            let count = min(WINDOW, noted.y - taken_up.y);
            var entry = vec2u(0u);
            var is_open = false;
            if thread < count {
                entry = noted_left_out(tile, taken_up.y + thread);
                for (var k = 0u; k < 4u; k++) {
                    let depth = bitcast<f32>(atomicLoad(&deepest[4u * leaf_turn + k]));
                    is_open = is_open || (((entry.x >> k) & 1u) == 1u && bitcast<f32>(entry.x & ~15u) <= depth && depth > 0.0);
                }
                // What is closed has the level of nothing.
                child_near[thread] = select(16.0, f32(level_of(entry.y)), is_open);
                if is_open {
                    atomicOr(&kept[node_turn * WORDS + (thread >> 5u)], 1u << (thread & 31u));
                }
            }
            taken_up.y += count;
            workgroupBarrier();
            var open_count = 0u;
            for (var word = 0u; word < min(WORDS, 2u); word++) {
                open_count += countOneBits(atomicLoad(&kept[node_turn * WORDS + word]));
            }
            if is_open {
                let level = f32(level_of(entry.y));
                var below = 0u;
                for (var k = 0u; k < count; k++) {
                    let is_below = child_near[k] < 16.0 && (child_near[k] > level || (child_near[k] == level && k > thread));
                    below += select(0u, 1u, is_below);
                }
                stack[below] = entry;
            }
            if thread == 0u {
                stack_size = open_count;
            }
            node_turn = 1u - node_turn;
            if thread < WORDS {
                atomicStore(&kept[node_turn * WORDS + thread], 0u);
            }
            continue;
        }
        if PATIENCE > 0u && work.steps == PATIENCE {
            if thread == 0u {
                is_aside = lay_aside(tile);
            }
            workgroupBarrier();
            if is_aside {
                break;
            }
        }

        // Which of the topmost entries can still matter?
        var own_entry = vec2u(0u);
        var own_closed = false;
        if thread < WINDOW && thread < size {
            let entry = stack[size - 1u - thread];
            let near = bitcast<f32>(entry.x & ~15u);
            var is_open = false;
            for (var k = 0u; k < 4u; k++) {
                let depth = bitcast<f32>(atomicLoad(&deepest[4u * leaf_turn + k]));
                is_open = is_open || (((entry.x >> k) & 1u) == 1u && near <= depth && depth > 0.0);
            }
            if is_open {
                atomicOr(&open_entries[2u * turn + (thread >> 5u)], 1u << (thread & 31u));
                if level_of(entry.y) == 0u {
                    atomicOr(&open_leaves[2u * turn + (thread >> 5u)], 1u << (thread & 31u));
                }
            }
            own_entry = entry;
            own_closed = !is_open;
        }
        if thread < 2u {
            atomicStore(&open_entries[2u * (1u - turn) + thread], 0u);
            atomicStore(&open_leaves[2u * (1u - turn) + thread], 0u);
        }
        workgroupBarrier();
        let entries = vec2u(atomicLoad(&open_entries[2u * turn]), atomicLoad(&open_entries[2u * turn + 1u]));
        let leaves = vec2u(atomicLoad(&open_leaves[2u * turn]), atomicLoad(&open_leaves[2u * turn + 1u]));
        turn = 1u - turn;
        work.steps++;

        // Leaves first: they lie above all nodes. What is taken, and what is closed above it, leaves the stack.
        let leaf_count = count_of(leaves);
        if leaf_count > 0u {
            let taken = min(leaf_count, LEAVES);
            work.leaves += taken;
            let others = entries & ~leaves;
            var dropped = min(size, WINDOW);
            if leaf_count > LEAVES {
                dropped = place_of_bit(leaves, LEAVES - 1u) + 1u;
            } else if count_of(others) > 0u {
                dropped = place_of_bit(others, 0u);
            }
            if NOTES {
                if thread < taken {
                    note_leaf(tile, work.leaves - taken + thread, stack[size - 1u - place_of_bit(leaves, thread)]);
                }
                if own_closed && thread < dropped {
                    note_left_out(tile, own_entry);
                }
            }

            // Each thread projects a particle.
            if thread / 16u < taken {
                let entry = stack[size - 1u - place_of_bit(leaves, thread / 16u)];
                let leaf = index_of(entry.y);
                let node = 16u * leaf + (thread & 15u);
                if node < bvh.particles && (!HIDES || shows(node)) {
                    let center = center_of(leaf, thread & 15u);
                    let radius = radius_of(leaf, thread & 15u);
                    let from_eye = center - view.eye;
                    let reach = reach_of_ball(view, beam, grown(radius, from_eye, beam.spread));
                    let shadow = project(view, beam, from_eye, reach);
                    let quads = quads_of(shadow, HALF_TILE);
                    var is_open = false;
                    for (var k = 0u; k < 4u; k++) {
                        let depth = bitcast<f32>(atomicLoad(&deepest[4u * leaf_turn + k]));
                        is_open = is_open || (((quads >> k) & 1u) == 1u && shadow.near <= depth);
                    }
                    var low = floor(shadow.low + HALF_TILE);
                    var high = floor(shadow.high + HALF_TILE);
                    if pass_.centered == 1u {
                        low = ceil(shadow.low + (HALF_TILE - 0.5));
                        high = floor(shadow.high + (HALF_TILE - 0.5));
                    }
                    if is_open && low.x <= high.x && low.y <= high.y {
                        let begin = vec2u(max(low, vec2f(0.0)));
                        let end = vec2u(clamp(high, vec2f(-1.0), 2.0 * HALF_TILE - 1.0) + 1.0);
                        let bit = 1u << (thread & 31u);
                        let word = leaf_turn * WORDS + (thread >> 5u);
                        for (var x = begin.x; x < end.x; x++) {
                            atomicOr(&columns[2u * WORDS * x + word], bit);
                        }
                        for (var y = begin.y; y < end.y; y++) {
                            atomicOr(&rows[2u * WORDS * y + word], bit);
                        }
                        sphere[thread] = vec4f(center, radius);
                        sphere_near[thread] = shadow.near;
                        sphere_node[thread] = node;
                    }
                }
            }
            workgroupBarrier();
            if thread == 0u {
                stack_size = size - dropped;
            }

            // Each thread tests its samples against what covers its pixel.
            for (var word = 0u; word < (16u * taken + 31u) / 32u; word++) {
                var mask = atomicLoad(&columns[2u * WORDS * in_tile.x + leaf_turn * WORDS + word])
                    & atomicLoad(&rows[2u * WORDS * in_tile.y + leaf_turn * WORDS + word]);
                while mask != 0u {
                    let at = 32u * word + firstTrailingBit(mask);
                    mask &= mask - 1u;
                    if sphere_near[at] <= own_deepest {
                        work.tests++;
                        let ball = sphere[at];
                        let node = sphere_node[at];
                        found_a = test(found_a, rays_a, ball.xyz, ball.w, node);
                        own_deepest = max_of(found_a.depth);
                        if GROUPS > 1u {
                            found_b = test(found_b, rays_b, ball.xyz, ball.w, node);
                            found_c = test(found_c, rays_c, ball.xyz, ball.w, node);
                            found_d = test(found_d, rays_d, ball.xyz, ball.w, node);
                            own_deepest = max(
                                max(own_deepest, max_of(found_b.depth)),
                                max(max_of(found_c.depth), max_of(found_d.depth)));
                        }
                    }
                }
            }

            // The deepest samples of the quarters; the other copies are emptied for the next leaves.
            if thread < 4u {
                atomicStore(&deepest[4u * leaf_turn + thread], 0u);
            }
            leaf_turn = 1u - leaf_turn;
            for (var k = thread; k < TILE_W * WORDS; k += THREADS) {
                atomicStore(&columns[2u * k - k % WORDS + leaf_turn * WORDS], 0u);
            }
            for (var k = thread; k < TILE_H * WORDS; k += THREADS) {
                atomicStore(&rows[2u * k - k % WORDS + leaf_turn * WORDS], 0u);
            }
            atomicMax(&deepest[4u * leaf_turn + quad], bitcast<u32>(own_deepest));
            continue;
        }

        // Eight threads a node, a child each.
        let node_count = min(count_of(entries), NODES);
        work.nodes += node_count;
        var dropped = min(size, WINDOW);
        if count_of(entries) > NODES {
            dropped = place_of_bit(entries, NODES - 1u) + 1u;
        }
        if NOTES && own_closed && thread < dropped {
            note_left_out(tile, own_entry);
        }
        var is_kept = false;
        var pushed = vec2u(0u);
        if thread / 8u < node_count {
            let parent = stack[size - 1u - place_of_bit(entries, thread / 8u)].y;
            let child = thread & 7u;
            if has_child(parent, child) {
                let bounds = child_box(node_at(parent), child, view.eye, margin);
                let shadow = project(view, beam, bounds.middle, reach_of_box(view, beam, bounds.half));
                let quads = quads_of(shadow, HALF_TILE);
                let near = max(shadow.near, 0.0);
                var open_quads = 0u;
                for (var k = 0u; k < 4u; k++) {
                    let depth = bitcast<f32>(atomicLoad(&deepest[4u * leaf_turn + k]));
                    open_quads |= select(0u, 1u << k, ((quads >> k) & 1u) == 1u && near <= depth && depth > 0.0);
                }
                is_kept = open_quads != 0u;
                // Another pass may look also into quarters that are closed in this one.
                let noted_quads = select(open_quads, quads, NOTES);
                pushed = vec2u((bitcast<u32>(near) & ~15u) | noted_quads,
                    place_of(level_of(parent) - 1u, 8u * index_of(parent) + child));
                child_near[thread] = near;
                if is_kept {
                    atomicOr(&kept[node_turn * WORDS + (thread >> 5u)], 1u << (thread & 31u));
                } else if NOTES && quads != 0u {
                    note_left_out(tile, pushed);
                }
            }
        }
        workgroupBarrier();
        // Children of farther nodes lie below those of nearer ones; of one node the nearest lies on top.
        let base = size - dropped;
        var total = 0u;
        var below = 0u;
        for (var word = 0u; word < WORDS; word++) {
            let mask = atomicLoad(&kept[node_turn * WORDS + word]);
            total += countOneBits(mask);
            let own_word = thread >> 5u;
            if word > own_word {
                below += countOneBits(mask);
            } else if word == own_word {
                // Shifted in two steps, since a shift by 32 is none.
                let group = (thread >> 3u) & 3u;
                below += countOneBits((mask >> (8u * group + 7u)) >> 1u);
                let siblings = (mask >> (8u * group)) & 255u;
                for (var k = 0u; k < 8u; k++) {
                    let other = child_near[(thread & ~7u) + k];
                    let is_farther = other > child_near[thread] || (other == child_near[thread] && k > (thread & 7u));
                    below += select(0u, 1u, ((siblings >> k) & 1u) == 1u && is_farther);
                }
            }
        }
        if is_kept {
            stack[base + below] = pushed;
        }
        if thread == 0u {
            stack_size = base + total;
        }
        node_turn = 1u - node_turn;
        if thread < WORDS {
            atomicStore(&kept[node_turn * WORDS + thread], 0u);
        }
    }

    if NOTES && thread == 0u {
        note_counts(tile, work.leaves, is_aside);
    }
    if COUNTED {
        // The tile's first pixels tell one more number each.
        let place = thread / SPLIT;
        let of_tile = select(select(work.nodes, work.leaves, place == 1u), work.steps, place == 0u);
        if inside && own_first == 0u {
            hits[first_hit(pixel)] = vec2u(work.tests, select(0u, of_tile, place < 3u));
        }
    } else if inside {
        let at = first_hit(pixel) + own_first;
        store_hits(at, found_a.depth, found_a.node);
        if GROUPS > 1u {
            store_hits(at + 4u, found_b.depth, found_b.node);
            store_hits(at + 8u, found_c.depth, found_c.node);
            store_hits(at + 12u, found_d.depth, found_d.node);
        }
    }
}
