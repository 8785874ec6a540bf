// Records to be sorted: by what, a particle's id, and the bits of its radius.

@compute @workgroup_size(64)
fn write_records(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    let id = 64u * (task.first + group.x) + thread;
    if id < task.count {
        let at = id >> 2u;
        let lane = id & 3u;
        let center = bitcast<vec3f>(vec3u(xs(at)[lane], ys(at)[lane], zs(at)[lane]));
        var radius = 0u;
        if SIZES != SIZES_UNIFORM {
            radius = radii(at)[lane];
        }
        let key = key_of(center, bitcast<f32>(radius), task.low, task.inv_edge, task.giant);
        set_records(id, vec4u(key, id, radius));
    }
}
