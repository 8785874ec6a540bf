// Records of culling by confidence: what a pixel knows, and what all have in common. See layout.rs.

// Twin of `Estimate` in render/confidence/accumulate.rs; before any sample the depth is FAR.
struct Estimate {
    depth: f32,
    confidence: f32,
    // Number of the next sample.
    next: u32,
    unique: f32,
}

// Twin of `Pixel` in render/confidence/accumulate.rs.
struct Pixel {
    accumulation: Estimate,
    cull: Estimate,
    // The depth behind which nothing is traced, or FAR.
    clip: f32,
    // Samples since that depth changed.
    unchanged: u32,
}

struct Culling {
    // The density grid: its box, the edges of a voxel, one over them, and voxels along each axis.
    low: vec3f,
    // Particles that one of a voxel's count stands for.
    unit: f32,
    high: vec3f,
    // Means over the particles, of the radius and of its square.
    radius: f32,
    edge: vec3f,
    radius_sq: f32,
    inv_edge: vec3f,
    // From an entry of a pixel's histogram to the next: the pixels that there is room for.
    stride: u32,
    voxels: vec3u,
    // The first sample of the frame, and how many it has.
    first: u32,
    samples: u32,
    seed: u32,
    // Whether the pixels know nothing yet.
    is_new: u32,
    // Options of render/confidence.
    convergence_samples: u32,
    sample_budget: u32,
    occlusion_confidence: f32,
    depth_quantization: u32,
    trilinear: u32,
    up_to_depth: u32,
    // Pixels along an edge of the square that decides, and the level of the pyramid on which it lies.
    kernel: u32,
    level: u32,
    // The integral of the Gaussian: where its table ends, and the table.
    normal_limit: f32,
    normal: array<vec4f, NORMAL_VECTORS>,
}
