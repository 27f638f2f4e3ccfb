// Stage `collapse`: nodes of 8 children out of the binary tree, level by level from the roots: of what is below a node, the
// largest is opened again until there are 8, or only items.
//
// Nodes have numbers level by level, and in each level in the order of their parents. A slot of a node holds an item with
// the highest bit set, the number of a node, or nothing.

const LANES: u32 = 128u;
const SLOTS: u32 = 8u;
const LAST_LEVEL: u32 = 254u;

@group(0) @binding(2) var<storage, read> clusters: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read> children: array<vec2<u32>>;
// The binary node that a node is made of.
@group(0) @binding(4) var<storage, read_write> opened: array<u32>;
@group(0) @binding(5) var<storage, read_write> slots: array<u32>;
// Of each workgroup of a level: nodes below.
@group(0) @binding(6) var<storage, read_write> sums: array<vec2<u32>>;
// Of each object, as a slot.
@group(0) @binding(7) var<storage, read_write> roots: array<u32>;
@group(0) @binding(8) var<storage, read_write> state: BuildState;

// One workgroup: the roots of all objects, which are the first level.
@compute @workgroup_size(LANES)
fn root(@builtin(local_invocation_index) lane: u32) {
    let count = state.count;
    let part = (count + LANES - 1u) / LANES;
    let first = min(lane * part, count);
    let end = min(first + part, count);
    var inner = 0u;
    for (var i = first; i < end; i++) {
        inner += select(0u, 1u, clusters[i].x >= launch.items);
    }
    var number = sum_before(lane, vec2<u32>(inner, 0u)).x;
    for (var i = first; i < end; i++) {
        let cluster = clusters[i];
        if cluster.x < launch.items {
            roots[cluster.y] = LEAF | cluster.x;
        } else {
            roots[cluster.y] = number;
            opened[number] = cluster.x;
            number += 1u;
        }
    }
    if lane == 0u {
        state.levels[1] = sum_of_all().x;
    }
}

fn is_inner(node: u32) -> bool {
    return node >= launch.items;
}

// Negative for an item, which is not opened.
fn weight(node: u32) -> f32 {
    if is_inner(node) {
        return area(box_at(node));
    }
    return -1.0;
}

@compute @workgroup_size(LANES)
fn open(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
        @builtin(local_invocation_index) lane: u32) {
    let tile = group.y * groups.x + group.x;
    let first = state.levels[state.level];
    let end = state.levels[state.level + 1u];
    let number = first + tile * LANES + lane;
    var below = 0u;
    if number < end {
        var nodes: array<u32, SLOTS>;
        var weights: array<f32, SLOTS>;
        nodes[0] = opened[number];
        weights[0] = 0.0;
        var count = 1u;
        while count < SLOTS {
            var most = 0u;
            for (var slot = 1u; slot < count; slot++) {
                most = select(most, slot, weights[slot] > weights[most]);
            }
            if weights[most] < 0.0 {
                break;
            }
            let pair = children[nodes[most] - launch.items];
            nodes[most] = pair.x;
            weights[most] = weight(pair.x);
            nodes[count] = pair.y;
            weights[count] = weight(pair.y);
            count += 1u;
        }
        for (var slot = 0u; slot < SLOTS; slot++) {
            var held = NONE;
            if slot < count {
                let node = nodes[slot];
                below += select(0u, 1u, is_inner(node));
                held = select(LEAF | node, node, is_inner(node));
            }
            slots[number * SLOTS + slot] = held;
        }
    }
    _ = sum_before(lane, vec2<u32>(below, 0u));
    if lane == 0u && first + tile * LANES < end {
        sums[tile] = sum_of_all();
    }
}

// One workgroup: where the nodes below each workgroup's begin; on to the next level.
@compute @workgroup_size(LANES)
fn sum(@builtin(local_invocation_index) lane: u32) {
    let level = state.level;
    let next = state.levels[level + 1u];
    let tiles = (next - state.levels[level] + LANES - 1u) / LANES;
    let part = (tiles + LANES - 1u) / LANES;
    let first = min(lane * part, tiles);
    let end = min(first + part, tiles);
    var here = vec2<u32>(0u);
    for (var i = first; i < end; i++) {
        here += sums[i];
    }
    var at = sum_before(lane, here) + vec2<u32>(next, 0u);
    for (var i = first; i < end; i++) {
        let these = sums[i];
        sums[i] = at;
        at += these;
    }
    if lane == 0u && level < LAST_LEVEL {
        state.levels[level + 2u] = next + sum_of_all().x;
        state.level = level + 1u;
    }
}

@compute @workgroup_size(LANES)
fn place(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
         @builtin(local_invocation_index) lane: u32) {
    let tile = group.y * groups.x + group.x;
    let level = state.level - 1u;
    let number = state.levels[level] + tile * LANES + lane;
    let valid = number < state.levels[level + 1u];
    var below = 0u;
    if valid {
        for (var slot = 0u; slot < SLOTS; slot++) {
            below += select(0u, 1u, (slots[number * SLOTS + slot] & LEAF) == 0u);
        }
    }
    var next = sum_before(lane, vec2<u32>(below, 0u)).x + sums[tile].x;
    if valid {
        for (var slot = 0u; slot < SLOTS; slot++) {
            let node = slots[number * SLOTS + slot];
            if (node & LEAF) == 0u {
                opened[next] = node;
                slots[number * SLOTS + slot] = next;
                next += 1u;
            }
        }
    }
}
