// Stage `trace` where rays go on behind what they meet: the next hit of each ray after that of the layer before, in the order of
// hits. The first layer's is the nearest. Its walk is in walk.wgsl.

@group(1) @binding(0) var<storage, read> rays: array<Ray>;
@group(1) @binding(1) var<storage, read_write> hits: array<Hit>;
@group(1) @binding(3) var<storage, read_write> veils: Veils;

@compute @workgroup_size(64)
fn trace(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let place = launch.first + group.y * launch.row + group.x * WORKGROUP + lane;
    if group.x * WORKGROUP + lane >= launch.row || place >= launch.end {
        return;
    }
    let index = going_on(place);
    if index == NONE {
        return;
    }
    var ray = rays[index];
    let at = hit_place(launch.layer, ray.number);
    var best = Hit(ray.t_max, 0.0, 0.0, NONE, 0u, 0u);
    if launch.page > 0u {
        best = hits[at];
    }
    // Before all others.
    last = Hit(-3.0e38, 0.0, 0.0, 0u, 0u, 0u);
    if launch.layer > 0u {
        last = hits[hit_place(launch.layer + 1u, ray.number)];
        ray.t_min = max(ray.t_min, last.t);
    }
    if last.instance != NONE && launch.root != EMPTY && ray.t_min <= ray.t_max {
        tell(ray.number, walk(ray, &best));
    } else {
        tell(ray.number, vec2<u32>(0u));
    }
    hits[at] = best;
}
