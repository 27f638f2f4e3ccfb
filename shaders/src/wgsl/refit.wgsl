// Stage `refit`: the nodes of trees, from the boxes of their items: level by level, the lowest first, since WGSL orders
// what workgroups do in no other way. Trees that were just made get their bytes so, and trees whose vertices have moved.

const SLOTS: u32 = 8u;
// Set in a reference to a node whose bounds move.
const MOVING_NODE: u32 = 0x40000000u;
const FACTS: u32 = 7u;

// As in collapse.wgsl.
@group(0) @binding(2) var<storage, read> slots: array<u32>;
@group(0) @binding(3) var<storage, read> references: array<u32>;
@group(0) @binding(4) var<storage, read_write> nodes: array<u32>;
@group(0) @binding(5) var<storage, read_write> heights: array<Height>;
@group(0) @binding(6) var<storage, read> roots: array<u32>;
// As in items.wgsl.
@group(0) @binding(7) var<storage, read> facts: array<i32>;
// Of each object: the reference to its root, the entries of the stack that it needs, and the bits of its radius.
@group(0) @binding(8) var<storage, read_write> outcomes: array<BuildOutcome>;

// What is below a node, itself included.
struct Height {
    // Entries of the stack that a walk needs.
    need: u32,
    // The bits of the largest magnitude of a plane.
    reach: u32,
    // Areas of all nodes.
    area: f32,
}

// The reference to what a slot holds.
fn reference(held: u32) -> u32 {
    if held == NONE {
        return NONE;
    }
    if (held & LEAF) != 0u {
        return references[held & ~LEAF];
    }
    return select(0u, MOVING_NODE, MOVES) | (launch.nodes + held * NODE_UNITS);
}

@compute @workgroup_size(64)
fn refit(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
         @builtin(local_invocation_index) lane: u32) {
    let number = launch.first + (group.y * groups.x + group.x) * 64u + lane;
    if number >= launch.end {
        return;
    }
    let at = 4u * (launch.nodes - launch.base + number * NODE_UNITS);
    var start: array<Ends, 8>;
    var end: array<Ends, 8>;
    var all = Box(nothing(), nothing());
    var count = 0u;
    var below = Height(0u, 0u, 0.0);
    for (var slot = 0u; slot < SLOTS; slot++) {
        let held = slots[number * SLOTS + slot];
        nodes[at + LATTICE_WORDS + slot] = reference(held);
        if held == NONE {
            continue;
        }
        // Boxes of nodes come after those of items.
        var box: Box;
        if (held & LEAF) != 0u {
            box = box_at(held & ~LEAF);
        } else {
            box = box_at(launch.items + held);
            let height = heights[held];
            below.need = max(below.need, height.need);
            below.reach = max(below.reach, height.reach);
            below.area += height.area;
        }
        start[count] = box.start;
        end[count] = box.end;
        all = union_of(all, box);
        count += 1u;
    }
    var reach = pack(at, &start, count);
    if MOVES {
        reach = max(reach, pack(at + 18u, &end, count));
    }
    nodes[at + LATTICE_WORDS + SLOTS] = 0u;
    nodes[at + LATTICE_WORDS + SLOTS + 1u] = (1u << count) - 1u;
    store_box(launch.items + number, all);
    heights[number] = Height(below.need + count - 1u, max(below.reach, bitcast<u32>(reach)), below.area + area(all));
}

@compute @workgroup_size(64)
fn tell(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
        @builtin(local_invocation_index) lane: u32) {
    let object = (group.y * groups.x + group.x) * 64u + lane;
    if object >= launch.objects {
        return;
    }
    let root = roots[object];
    var height = Height(0u, 0u, 0.0);
    var cost = 0.0;
    if (root & LEAF) == 0u {
        height = heights[root];
        let whole = area(box_at(launch.items + root));
        cost = select(0.0, height.area / max(whole, 1.0e-30), whole > 1.0e-30);
    }
    let radius = max(height.reach, u32(facts[FACTS * object + 6u]));
    outcomes[object] = BuildOutcome(reference(root), height.need, bitcast<f32>(radius), cost);
}
