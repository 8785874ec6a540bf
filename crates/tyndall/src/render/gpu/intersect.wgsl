// Rays that have nothing in common, a thread each.

@group(0) @binding(0) var<storage, read> rays: array<Ray>;
// By ray: the distance's bits and the node.
@group(0) @binding(1) var<storage, read_write> ray_hits: array<vec2u>;

@compute @workgroup_size(64)
fn intersect_rays(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32, @builtin(num_workgroups) groups: vec3u) {
    let at = 64u * (group.y * groups.x + group.x) + thread;
    if at < arrayLength(&rays) {
        let met = intersect(rays[at], NONE);
        ray_hits[at] = vec2u(bitcast<u32>(met.t), met.node);
    }
}
