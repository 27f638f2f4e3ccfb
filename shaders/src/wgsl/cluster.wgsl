// Stage `cluster`: a binary tree over sorted items, from below: PLOC, after Meister, Bittner, "Parallel Locally-Ordered
// Clustering for Bounding Volume Hierarchy Construction", TVCG 2018.
//
// In each round every cluster finds that one of its neighbours in the order with which it makes the smallest box; two that
// find each other become one. Rounds are four dispatches: WGSL orders what workgroups do in no other way. All objects are
// clustered together, each by itself, until no two of an object are left.
//
// Of pairs with equal areas, that comes first whose numbers differ least, as bits: such pairs have no member in common, so
// each round joins some, and where all areas are equal nearly half of all. Where a round joins few all the same (boxes
// inside boxes), the next takes all areas as equal: the tree cannot become much deeper than balanced ones.

const LANES: u32 = 128u;
// Neighbours that are looked at, to each side.
const RADIUS: u32 = 8u;
const WINDOW: u32 = LANES + 2u * RADIUS;
// A round joins few where that is less than this part of what is still to be joined.
const FEW: u32 = 8u;

@group(0) @binding(2) var<storage, read_write> clusters: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read_write> clusters_to: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read_write> nearest: array<u32>;
// Of each workgroup: clusters that stay, and nodes that are made.
@group(0) @binding(5) var<storage, read_write> sums: array<vec2<u32>>;
@group(0) @binding(6) var<storage, read_write> children: array<vec2<u32>>;
@group(0) @binding(7) var<storage, read_write> state: BuildState;

var<workgroup> near_lo0: array<vec3<f32>, WINDOW>;
var<workgroup> near_hi0: array<vec3<f32>, WINDOW>;
var<workgroup> near_lo1: array<vec3<f32>, select(1u, WINDOW, MOVES)>;
var<workgroup> near_hi1: array<vec3<f32>, select(1u, WINDOW, MOVES)>;
var<workgroup> near_objects: array<u32, WINDOW>;

// The area of the box around two of the window.
fn joint_area(a: u32, b: u32) -> f32 {
    let e = max(near_hi0[a], near_hi0[b]) - min(near_lo0[a], near_lo0[b]);
    if !MOVES {
        return products(e);
    }
    let f = max(near_hi1[a], near_hi1[b]) - min(near_lo1[a], near_lo1[b]);
    return products(e) + products(f) + products(e + f);
}

@compute @workgroup_size(LANES)
fn find(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
        @builtin(local_invocation_index) lane: u32) {
    let first = (group.y * groups.x + group.x) * LANES;
    let count = select(0u, state.count, state.made != 0u);
    for (var k = lane; k < WINDOW; k += LANES) {
        // Wraps round below the first cluster, beyond the last.
        let at = first + k - RADIUS;
        near_objects[k] = NONE;
        if first < count && at < count {
            let cluster = clusters[at];
            let box = box_at(cluster.x);
            near_objects[k] = cluster.y;
            near_lo0[k] = real(box.start.lo);
            near_hi0[k] = real(box.start.hi);
            if MOVES {
                near_lo1[k] = real(box.end.lo);
                near_hi1[k] = real(box.end.hi);
            }
        }
    }
    workgroupBarrier();
    let i = first + lane;
    if i >= count {
        return;
    }
    let own = lane + RADIUS;
    var best = NONE;
    var best_area = 0.0;
    for (var k = lane; k <= lane + 2u * RADIUS; k++) {
        if k == own || near_objects[k] != near_objects[own] {
            continue;
        }
        let other = first + k - RADIUS;
        var joint = 0.0;
        if state.equal == 0u {
            joint = joint_area(own, k);
        }
        if best == NONE || joint < best_area || (joint == best_area && (i ^ other) < (i ^ best)) {
            best = other;
            best_area = joint;
        }
    }
    nearest[i] = best;
}

// Whether cluster `i` stays, and whether it becomes a node.
fn fate(i: u32, count: u32) -> vec2<u32> {
    if i >= count {
        return vec2<u32>(0u);
    }
    let other = nearest[i];
    if other == NONE || nearest[min(other, count - 1u)] != i {
        return vec2<u32>(1u, 0u);
    }
    return select(vec2<u32>(0u), vec2<u32>(1u), i < other);
}

@compute @workgroup_size(LANES)
fn count(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
         @builtin(local_invocation_index) lane: u32) {
    let tile = group.y * groups.x + group.x;
    let clusters_now = select(0u, state.count, state.made != 0u);
    _ = sum_before(lane, fate(tile * LANES + lane, clusters_now));
    if lane == 0u && tile * LANES < clusters_now {
        sums[tile] = sum_of_all();
    }
}

// One workgroup: where the clusters and nodes of each workgroup begin.
@compute @workgroup_size(LANES)
fn sum(@builtin(local_invocation_index) lane: u32) {
    let goes_on = state.made != 0u;
    let clusters_now = select(0u, state.count, goes_on);
    let tiles = (clusters_now + LANES - 1u) / LANES;
    let part = (tiles + LANES - 1u) / LANES;
    let first = min(lane * part, tiles);
    let end = min(first + part, tiles);
    var here = vec2<u32>(0u);
    for (var i = first; i < end; i++) {
        here += sums[i];
    }
    var at = sum_before(lane, here);
    for (var i = first; i < end; i++) {
        let these = sums[i];
        sums[i] = at;
        at += these;
    }
    workgroupBarrier();
    if lane == 0u && goes_on {
        let all = sum_of_all();
        state.count_before = state.count;
        state.inner_before = state.inner;
        state.count = all.x;
        state.inner += all.y;
        state.made = all.y;
        let left = state.count_before - min(state.count_before, launch.objects);
        state.equal = select(0u, 1u, state.equal == 0u && all.y * FEW < left);
    }
}

// Where nothing is left to be joined, clusters are copied: they stand in the other array after each round.
@compute @workgroup_size(LANES)
fn join(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
        @builtin(local_invocation_index) lane: u32) {
    let tile = group.y * groups.x + group.x;
    let i = tile * LANES + lane;
    let fated = fate(i, state.count_before);
    let at = sums[tile] + sum_before(lane, fated);
    if fated.x == 0u {
        return;
    }
    var cluster = clusters[i];
    if fated.y != 0u {
        let other = clusters[nearest[i]];
        let inner = state.inner_before + at.y;
        children[inner] = vec2<u32>(cluster.x, other.x);
        let node = launch.items + inner;
        store_box(node, union_of(box_at(cluster.x), box_at(other.x)));
        cluster.x = node;
    }
    clusters_to[at.x] = cluster;
}
