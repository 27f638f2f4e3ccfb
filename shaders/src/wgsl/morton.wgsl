// Stage `morton`: what items are sorted by: their object, and in it the place of their centre in mid-shutter on a Morton
// curve. Items of grids that cannot be traced come last.

@group(0) @binding(5) var<storage, read_write> keys: array<vec2<u32>>;
@group(0) @binding(6) var<storage, read_write> numbers: array<u32>;

// The low 10 bits, two apart.
fn spread(v: u32) -> u32 {
    var x = v & 0x3ffu;
    x = (x | (x << 16u)) & 0x030000ffu;
    x = (x | (x << 8u)) & 0x0300f00fu;
    x = (x | (x << 4u)) & 0x030c30c3u;
    return (x | (x << 2u)) & 0x09249249u;
}

fn interleaved(q: vec3<u32>) -> u32 {
    return spread(q.x) | (spread(q.y) << 1u) | (spread(q.z) << 2u);
}

fn fact(i: u32) -> i32 {
    return atomicLoad(&facts[i]);
}

@compute @workgroup_size(64)
fn key(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
       @builtin(local_invocation_index) lane: u32) {
    let i = (group.y * groups.x + group.x) * 64u + lane;
    if i >= launch.items {
        return;
    }
    numbers[i] = i;
    let item = item_at(i);
    if (fact(drop_word(item.number)) & drop_bit(item.number)) != 0 {
        keys[i] = vec2<u32>(NONE);
        return;
    }
    let first = FACTS * item.object;
    let lo = real(vec3<i32>(fact(first), fact(first + 1u), fact(first + 2u)));
    let hi = real(vec3<i32>(fact(first + 3u), fact(first + 4u), fact(first + 5u)));
    let e = hi - lo;
    let extent = max(e.x, max(e.y, e.z));
    // Cells are cubes. Where all is in one place, order does not matter.
    let most = f32((1u << launch.bits) - 1u);
    let scale = select(0.0, most / max(extent, 1.0e-30), extent > 1.0e-30);
    let q = vec3<u32>(clamp((centre(box_at(i)) - lo) * scale, vec3<f32>(0.0), vec3<f32>(most)));
    // Up to 20 bits of each axis, the low 10 in 30 bits, and the number of the object above them all.
    let high = interleaved(q >> vec3<u32>(10u));
    var place = vec2<u32>(interleaved(q) | (high << 30u), high >> 2u);
    let shift = 3u * launch.bits;
    if shift >= 32u {
        place.y |= item.object << (shift - 32u);
    } else {
        place.x |= item.object << shift;
        place.y |= item.object >> (32u - shift);
    }
    keys[i] = place;
}
