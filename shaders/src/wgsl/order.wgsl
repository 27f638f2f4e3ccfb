// Stage `order`: what rays are sorted by, so that those of a workgroup take nearly one way through the trees: by runs of
// neighbours, which start near each other where rays leave the hits of neighbouring pixels; in a run by direction, and those
// of one direction by time. Counts speak for this order: sorted by direction or time over the whole image, rays of a
// workgroup open many more different nodes.
//
// Directions are the cells of a grid over the octahedron, along a Morton curve.

@group(0) @binding(0) var<uniform> launch: OrderLaunch;
@group(0) @binding(1) var<storage, read> rays: array<Ray>;
@group(0) @binding(2) var<storage, read_write> keys: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read_write> numbers: array<u32>;

const WORKGROUP: u32 = 64u;

// The cell of a number in [0, 1], of so many to the power of two.
fn cell(x: f32, bits: u32) -> u32 {
    let count = f32(1u << bits);
    return u32(clamp(x * count, 0.0, count - 1.0));
}

// The low 8 bits, one apart.
fn spread2(v: u32) -> u32 {
    var x = v & 0xffu;
    x = (x | (x << 4u)) & 0x0f0fu;
    x = (x | (x << 2u)) & 0x3333u;
    return (x | (x << 1u)) & 0x5555u;
}

// A direction on the unfolded octahedron, in the unit square.
fn unfolded(dir: vec3<f32>) -> vec2<f32> {
    let size = max(abs(dir.x) + abs(dir.y) + abs(dir.z), 1.0e-30);
    let p = dir.xy / size;
    let signs = select(vec2<f32>(1.0), vec2<f32>(-1.0), p < vec2<f32>(0.0));
    let folded = (1.0 - abs(p.yx)) * signs;
    return 0.5 * select(p, folded, dir.z < 0.0) + 0.5;
}

@compute @workgroup_size(64)
fn order(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = group.y * launch.row + group.x * WORKGROUP + lane;
    if group.x * WORKGROUP + lane >= launch.row || index >= launch.ray_count {
        return;
    }
    let ray = rays[index];
    let at = unfolded(ray.dir);
    let direction = spread2(cell(at.x, launch.direction_bits)) | (spread2(cell(at.y, launch.direction_bits)) << 1u);
    var key = index >> launch.run_bits;
    key = (key << (2u * launch.direction_bits)) | direction;
    key = (key << launch.time_bits) | cell(ray.time, launch.time_bits);
    keys[index] = vec2<u32>(key, 0u);
    numbers[index] = index;
}
