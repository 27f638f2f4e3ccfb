// Stage `sort`: items in the order of their keys, equal ones in the order of their numbers: a radix sort, 4 bits of the
// keys in each round, the lowest first.
//
// A workgroup counts how often each digit comes in its tile, a single one sums these counts up, and each then puts its tile's
// items where they belong: lanes take items that are next to each other, so that order is kept without exchange.

const LANES: u32 = 128u;
// Items of a lane, and of a workgroup.
const RUN: u32 = 8u;
const TILE: u32 = LANES * RUN;
const DIGITS: u32 = 16u;
const NONE: u32 = 0xffffffffu;

@group(0) @binding(0) var<uniform> launch: BuildLaunch;
@group(0) @binding(1) var<storage, read> keys: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read> numbers: array<u32>;
@group(0) @binding(3) var<storage, read_write> keys_to: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read_write> numbers_to: array<u32>;
// For each digit, and in it for each tile.
@group(0) @binding(5) var<storage, read_write> histogram: array<u32>;
// What trees are made of: the number of an item, and its object.
@group(0) @binding(6) var<storage, read_write> clusters: array<vec2<u32>>;
@group(0) @binding(7) var<storage, read_write> state: BuildState;

var<workgroup> tile_counts: array<atomic<u32>, DIGITS>;
// For each digit, and in it for each lane.
var<workgroup> lane_counts: array<u32, DIGITS * LANES>;
// What the number of an item of a digit in its tile is short by.
var<workgroup> offsets: array<u32, DIGITS>;

fn digit(key: vec2<u32>) -> u32 {
    let shift = launch.first;
    return select(key.x >> shift, key.y >> (shift - 32u), shift >= 32u) & (DIGITS - 1u);
}

@compute @workgroup_size(LANES)
fn count(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
         @builtin(local_invocation_index) lane: u32) {
    let tile = group.y * groups.x + group.x;
    if lane < DIGITS {
        atomicStore(&tile_counts[lane], 0u);
    }
    workgroupBarrier();
    for (var k = 0u; k < RUN; k++) {
        let i = tile * TILE + k * LANES + lane;
        if i < launch.items {
            atomicAdd(&tile_counts[digit(keys[i])], 1u);
        }
    }
    workgroupBarrier();
    if lane < DIGITS && tile < launch.tiles {
        histogram[lane * launch.tiles + tile] = atomicLoad(&tile_counts[lane]);
    }
}

// One workgroup: where the items of each digit and tile begin.
@compute @workgroup_size(LANES)
fn sum(@builtin(local_invocation_index) lane: u32) {
    let counts = DIGITS * launch.tiles;
    let part = (counts + LANES - 1u) / LANES;
    let first = min(lane * part, counts);
    let end = min(first + part, counts);
    var here = 0u;
    for (var i = first; i < end; i++) {
        here += histogram[i];
    }
    var at = sum_before(lane, vec2<u32>(here, 0u)).x;
    for (var i = first; i < end; i++) {
        let count = histogram[i];
        histogram[i] = at;
        at += count;
    }
}

@compute @workgroup_size(LANES)
fn scatter(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
           @builtin(local_invocation_index) lane: u32) {
    let tile = group.y * groups.x + group.x;
    for (var d = 0u; d < DIGITS; d++) {
        lane_counts[d * LANES + lane] = 0u;
    }
    let first = tile * TILE + lane * RUN;
    let end = min(first + RUN, launch.items);
    for (var i = first; i < end; i++) {
        lane_counts[digit(keys[i]) * LANES + lane] += 1u;
    }
    workgroupBarrier();
    // Each lane sums up a run of the counts of all.
    var here = 0u;
    for (var k = 0u; k < DIGITS; k++) {
        here += lane_counts[lane * DIGITS + k];
    }
    var at = sum_before(lane, vec2<u32>(here, 0u)).x;
    for (var k = 0u; k < DIGITS; k++) {
        let count = lane_counts[lane * DIGITS + k];
        lane_counts[lane * DIGITS + k] = at;
        at += count;
    }
    workgroupBarrier();
    if lane < DIGITS && tile < launch.tiles {
        offsets[lane] = histogram[lane * launch.tiles + tile] - lane_counts[lane * LANES];
    }
    workgroupBarrier();
    for (var i = first; i < end; i++) {
        let key = keys[i];
        let d = digit(key);
        let number = lane_counts[d * LANES + lane];
        lane_counts[d * LANES + lane] = number + 1u;
        let place = offsets[d] + number;
        keys_to[place] = key;
        numbers_to[place] = numbers[i];
    }
}

// Hands sorted items on to the stage `cluster`.
@compute @workgroup_size(LANES)
fn begin(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
         @builtin(local_invocation_index) lane: u32) {
    let i = (group.y * groups.x + group.x) * LANES + lane;
    if i >= launch.items {
        return;
    }
    let key = keys[i];
    if is_dropped(key) {
        return;
    }
    let shift = 3u * launch.bits;
    var object = 0u;
    if shift >= 32u {
        object = key.y >> (shift - 32u);
    } else {
        object = (key.x >> shift) | (key.y << (32u - shift));
    }
    clusters[i] = vec2<u32>(numbers[i], object);
    if i + 1u == launch.items || is_dropped(keys[min(i + 1u, launch.items - 1u)]) {
        state.count = i + 1u;
    }
}

fn is_dropped(key: vec2<u32>) -> bool {
    return key.x == NONE && key.y == NONE;
}
