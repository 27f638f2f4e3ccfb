// Stage `trace`: the nearest hit of each ray, or with ANY some hit where there is one. Its walk is in walk.wgsl.

@group(1) @binding(0) var<storage, read> rays: array<Ray>;
@group(1) @binding(1) var<storage, read_write> hits: array<Hit>;

@compute @workgroup_size(64)
fn trace(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = launch.first + group.y * launch.row + group.x * WORKGROUP + lane;
    if group.x * WORKGROUP + lane >= launch.row || index >= launch.end {
        return;
    }
    let ray = rays[index];
    var best = Hit(ray.t_max, 0.0, 0.0, NONE, 0u, 0u);
    if launch.page > 0u {
        best = hits[ray.number];
    }
    let done = ANY && best.instance != NONE;
    if !done && launch.root != EMPTY && ray.t_min <= ray.t_max {
        tell(ray.number, walk(ray, &best));
    } else {
        tell(ray.number, vec2<u32>(0u));
    }
    hits[ray.number] = best;
}
