// Stage `share`: which share of the rays of each hit meets nothing, by the bits that `occlude` told.

@group(0) @binding(0) var<uniform> launch: ShareLaunch;
@group(0) @binding(1) var<storage, read> occluded: array<u32>;
@group(0) @binding(2) var<storage, read_write> shares: array<f32>;

const WORKGROUP: u32 = 64u;

@compute @workgroup_size(64)
fn share(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = group.y * launch.row + group.x * WORKGROUP + lane;
    if group.x * WORKGROUP + lane >= launch.row || index >= launch.hit_count {
        return;
    }
    // A run of bits: parts of words, and whole ones between.
    var bit = index * launch.samples;
    let end = bit + launch.samples;
    var met = 0u;
    while bit < end {
        let shift = bit & 31u;
        let count = min(32u - shift, end - bit);
        met += countOneBits(extractBits(occluded[bit >> 5u], shift, count));
        bit += count;
    }
    shares[index] = f32(launch.samples - met) / f32(launch.samples);
}
