// What a kernel of the build is told. See layout.rs.

struct Task {
    // The curve's lattice: its corner, and one over a cell's edge.
    low: vec3f,
    inv_edge: f32,
    // Radii beyond this are sorted apart.
    giant: f32,
    // How many things there are: particles, counts, or boxes.
    count: u32,
    // The first workgroup of this dispatch.
    first: u32,
    // Runs that are sorted by a workgroup each.
    runs: u32,
    // The digit's first bit.
    bit: u32,
    // Where among the counts or the boxes those of this level begin, and where those of the next.
    level: u32,
    next_level: u32,
    // Where the level's nodes begin.
    nodes: u32,
}

@group(0) @binding(0) var<uniform> task: Task;
