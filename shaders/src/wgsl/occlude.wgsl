// Stage `occlude`: whether each ray meets anything, a bit a ray by number; the twin of core's World::occluded. Its walk is in
// walk.wgsl, with ANY.

// The permutation fixes by `taken` in which order: taken_sorted.wgsl or taken_as_they_stand.wgsl. Bits do not depend on it.

@group(1) @binding(0) var<storage, read> rays: array<Ray>;
@group(1) @binding(1) var<storage, read_write> occluded: array<atomic<u32>>;

@compute @workgroup_size(64)
fn occlude(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = launch.first + group.y * launch.row + group.x * WORKGROUP + lane;
    if group.x * WORKGROUP + lane >= launch.row || index >= launch.end {
        return;
    }
    let ray = rays[taken(index)];
    let word = ray.number >> 5u;
    let bit = 1u << (ray.number & 31u);
    var done = launch.root == EMPTY || !(ray.t_min <= ray.t_max);
    if launch.page > 0u {
        done = done || (atomicLoad(&occluded[word]) & bit) != 0u;
    }
    var tests = vec2<u32>(0u);
    if !done {
        var best = Hit(ray.t_max, 0.0, 0.0, NONE, 0u, 0u);
        tests = walk(ray, &best);
        if best.instance != NONE {
            atomicOr(&occluded[word], bit);
        }
    }
    tell(ray.number, tests);
}
