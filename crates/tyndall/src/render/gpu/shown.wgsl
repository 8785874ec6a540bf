// Which particles are shown: twin of structure/selection.rs. `shown` reads sixteen bytes of the bits: of particles by node, then, from an
// element of their own on, of subtrees: of the hierarchy a byte a node with a bit for every child, of heaps a bit a node. Where all
// particles are shown, HIDES is false, and nobody asks.

fn shows(node: u32) -> bool {
    return ((shown(node >> 7u)[(node >> 5u) & 3u] >> (node & 31u)) & 1u) == 1u;
}

// The same of four particles, of which the first is at a multiple of four.
fn shows_four(node: u32) -> vec4<bool> {
    let bits = shown(node >> 7u)[(node >> 5u) & 3u] >> (node & 31u);
    return (vec4u(bits) & vec4u(1u, 2u, 4u, 8u)) != vec4u(0u);
}

// The element with which the bits of subtrees begin. There is a particle.
fn first_subtree() -> u32 {
    return ((particle_count() - 1u) >> 7u) + 1u;
}

// Of the hierarchy's node number `number` a bit for every child that shows any.
fn shown_children(number: u32) -> u32 {
    return (shown(first_subtree() + (number >> 4u))[(number >> 2u) & 3u] >> (8u * (number & 3u))) & 255u;
}

// Whether anything below the heaps' node `node` is shown, itself included.
fn shows_any(node: u32) -> bool {
    return ((shown(first_subtree() + (node >> 7u))[(node >> 5u) & 3u] >> (node & 31u)) & 1u) == 1u;
}
