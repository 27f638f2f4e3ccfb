// Nodes of 8 children and slab tests: the twin of core's bvh/node.rs and trace/object_ray.rs.
//
// Space: an object's, relative to its mesh's origin, or the world's, relative to the world's origin.
//
// A reference is a leaf where its highest bit is set. Otherwise its low 30 bits are the place of a node
// in `nodes`, in units of 16 bytes, and the bit above them says that the node's bounds move. A leaf
// of the tree over instances is an instance's number. One of an object's tree is a loose group, with bit 30, as in core's
// bvh/object.rs, or else the place of a block.
//
// A node is 7 or, where it moves, 12 units: the lattice of its planes (at both ends of the shutter), 8 children, its frame,
// and the mask of its children. A lattice is 18 words: origin, step, and bytes [axis][lower, upper][child].
// A block is 6 or 10 units: lattices, 3 words of its span, its frame. A frame is its first word in `words`, 9
// floats; 0 is the identity. With bit 31, it turns, as in core's bvh/turn.rs: 15 floats, two axes, the third at both ends of the
// shutter, and the bows along all three.
//
// WGSL divides to 2.5 ULP, may fuse a product and a sum, and may flush what is below normal numbers. SLAB_PAD is core's
// derivation with that: in units of U (|origin| + radius) a reciprocal is off by 5 where it was off by 1, which adds 4 to
// every product of a slab test (12 R + 4 |o|; 20.8 with the rotation of a frame), 6.9 to a sheared vertex and 13.9 to its
// place between keys, 6.9 to the quotient that `t` is; its weights are rounded to f32 here, 10. With core's 76.5 that is
// 135; 160 has room for terms of second order and for tests that are not exact. A frame that turns adds core's 39, and 6
// for what it makes larger; its pad is half as much again.

const U: f32 = 5.9604644775390625e-8;
const SLAB_PAD: f32 = 160.0 * U;
// What slab tests are padded by besides: below it numbers may be flushed.
const TINY_PAD: f32 = 1.0e-30;
const LONGEST_DIR: f32 = 1.152921504606846976e18;
const SHORTEST_DIR: f32 = 8.673617379884035e-19;
const FARTHEST: f32 = 1.152921504606846976e18;
// Smallest magnitude of a direction's largest component, in pads: clamped components are 2^24 smaller, and coordinates at
// most 2^17 pads, so terms stay below 2^124.
const LEAST_DIR: f32 = 8.271806125530277e-25;

const LEAF: u32 = 0x80000000u;
const MOVES: u32 = 0x40000000u;
const LOOSE: u32 = 0x40000000u;
const PLACE: u32 = 0x3fffffffu;
const EMPTY: u32 = 0xffffffffu;
// Of a frame that turns, and what its slab tests are padded by, in pads.
const TURNS: u32 = 0x80000000u;
const TURN_PADS: f32 = 1.5;

// A ray in the frame of a node. Lower planes are moved down and upper planes up by the pad.
struct SlabRay {
    to_start: vec3<f32>,
    to_end: vec3<f32>,
    // For lower and for upper planes.
    lower: vec3<f32>,
    upper: vec3<f32>,
    negative: vec3<bool>,
}

// A ray against one tree.
struct TreeRay {
    origin: vec3<f32>,
    dir: vec3<f32>,
    time: f32,
    pad: f32,
    // What bows of frames are multiplied by.
    bow: f32,
}

// Children that a ray may hit, and where it enters them.
struct Entered {
    near: array<vec4<f32>, 2>,
    mask: u32,
}

fn longest(v: vec3<f32>) -> f32 {
    let a = abs(v);
    return max(a.x, max(a.y, a.z));
}

// A ray against a tree whose coordinates are no larger than `radius`; slab tests are padded by `more` besides.
fn tree_ray(origin: vec3<f32>, dir: vec3<f32>, time: f32, radius: f32, more: f32) -> TreeRay {
    let pad = SLAB_PAD * (longest(origin) + radius) + more;
    return TreeRay(origin, dir, time, pad + (longest(dir) + 1.0) * TINY_PAD, time * (1.0 - time));
}

// False for a ray that cannot be traced. Nothing here relies on NaN or infinity: what is beyond the limits fails, rays
// with either are kept from the device, and no term of a slab test overflows.
fn is_sound(ray: TreeRay) -> bool {
    let most = longest(ray.dir);
    return longest(ray.origin) < FARTHEST && most <= LONGEST_DIR && most >= max(SHORTEST_DIR, ray.pad * LEAST_DIR);
}

fn slab_ray(ray: TreeRay, origin: vec3<f32>, dir: vec3<f32>, most: f32) -> SlabRay {
    let least = vec3<f32>(most * U);
    let clamped = select(dir, select(least, -least, dir < vec3<f32>(0.0)), abs(dir) < least);
    let inverse = vec3<f32>(1.0) / clamped;
    var out: SlabRay;
    out.to_start = (1.0 - ray.time) * inverse;
    out.to_end = ray.time * inverse;
    out.lower = -(origin + vec3<f32>(ray.pad)) * inverse;
    out.upper = -(origin - vec3<f32>(ray.pad)) * inverse;
    out.negative = clamped < vec3<f32>(0.0);
    return out;
}

// The ray in a frame; 0 is the identity.
fn turned(ray: TreeRay, frame: u32) -> SlabRay {
    let most = longest(ray.dir);
    if frame == 0u {
        return slab_ray(ray, ray.origin, ray.dir, most);
    }
    let at = frame & ~TURNS;
    let x = axis_of(at);
    let y = axis_of(at + 3u);
    var z = axis_of(at + 6u);
    var own = ray;
    var bow = vec3<f32>(0.0);
    if TIME && (frame & TURNS) != 0u {
        z += (axis_of(at + 9u) - z) * ray.time;
        bow = axis_of(at + 12u) * ray.bow;
        own.pad *= TURN_PADS;
    }
    let origin = vec3<f32>(dot(x, ray.origin), dot(y, ray.origin), dot(z, ray.origin)) + bow;
    let dir = vec3<f32>(dot(x, ray.dir), dot(y, ray.dir), dot(z, ray.dir));
    return slab_ray(own, origin, dir, most);
}

fn axis_of(word: u32) -> vec3<f32> {
    return bitcast<vec3<f32>>(vec3<u32>(words[word], words[word + 1u], words[word + 2u]));
}

fn bytes(word: u32) -> vec4<f32> {
    return vec4<f32>(unpack4xU8(word));
}

// Planes of one axis of a lattice whose numbers are bytes: `plane = bytes * scale + base`.
struct Axis {
    lower: vec2<u32>,
    upper: vec2<u32>,
    origin: f32,
    step: f32,
}

// Narrows [near, far] by the planes of one axis that do not move.
fn narrow_static(near: ptr<function, array<vec4<f32>, 2>>, far: ptr<function, array<vec4<f32>, 2>>,
                 a: Axis, to_start: f32, lower: f32, upper: f32, negative: bool) {
    let scale = a.step * to_start;
    let base = a.origin * to_start;
    let low = base + lower;
    let high = base + upper;
    for (var h = 0; h < 2; h++) {
        let l = bytes(a.lower[h]) * scale + low;
        let u = bytes(a.upper[h]) * scale + high;
        (*near)[h] = max((*near)[h], select(l, u, negative));
        (*far)[h] = min((*far)[h], select(u, l, negative));
    }
}

// The same for planes that go from those of `a` to those of `b`.
fn narrow_moving(near: ptr<function, array<vec4<f32>, 2>>, far: ptr<function, array<vec4<f32>, 2>>,
                 a: Axis, b: Axis, to_start: f32, to_end: f32, lower: f32, upper: f32, negative: bool) {
    let scale = a.step * to_start;
    let scale_end = b.step * to_end;
    let base = a.origin * to_start + b.origin * to_end;
    let low = base + lower;
    let high = base + upper;
    for (var h = 0; h < 2; h++) {
        let l = bytes(b.lower[h]) * scale_end + (bytes(a.lower[h]) * scale + low);
        let u = bytes(b.upper[h]) * scale_end + (bytes(a.upper[h]) * scale + high);
        (*near)[h] = max((*near)[h], select(l, u, negative));
        (*far)[h] = min((*far)[h], select(u, l, negative));
    }
}

fn entered(near: array<vec4<f32>, 2>, far: array<vec4<f32>, 2>, valid: u32) -> Entered {
    let bit = vec4<u32>(1u, 2u, 4u, 8u);
    let first = select(vec4<u32>(0u), bit, near[0] <= far[0]);
    let second = select(vec4<u32>(0u), bit, near[1] <= far[1]);
    let low = first.x | first.y | first.z | first.w;
    let high = second.x | second.y | second.z | second.w;
    return Entered(near, (low | (high << 4u)) & valid);
}

// Tests 8 children whose planes stand at `at`, between two distances, both inclusive.
fn enter(at: u32, moves: bool, valid: u32, ray: SlabRay, t_min: f32, t_max: f32) -> Entered {
    let v0 = bitcast<vec4<f32>>(nodes[at]);
    let n1 = nodes[at + 1u];
    let v1 = bitcast<vec4<f32>>(n1);
    let n2 = nodes[at + 2u];
    let n3 = nodes[at + 3u];
    let n4 = nodes[at + 4u];
    let x = Axis(n1.zw, n2.xy, v0.x, v0.w);
    let y = Axis(n2.zw, n3.xy, v0.y, v1.x);
    let z = Axis(n3.zw, n4.xy, v0.z, v1.y);
    var near = array<vec4<f32>, 2>(vec4<f32>(t_min), vec4<f32>(t_min));
    var far = array<vec4<f32>, 2>(vec4<f32>(t_max), vec4<f32>(t_max));
    if TIME && moves {
        let v4 = bitcast<vec4<f32>>(n4);
        let v5 = bitcast<vec4<f32>>(nodes[at + 5u]);
        let n6 = nodes[at + 6u];
        let n7 = nodes[at + 7u];
        let n8 = nodes[at + 8u];
        let x1 = Axis(n6.xy, n6.zw, v4.z, v5.y);
        let y1 = Axis(n7.xy, n7.zw, v4.w, v5.z);
        let z1 = Axis(n8.xy, n8.zw, v5.x, v5.w);
        narrow_moving(&near, &far, x, x1, ray.to_start.x, ray.to_end.x, ray.lower.x, ray.upper.x, ray.negative.x);
        narrow_moving(&near, &far, y, y1, ray.to_start.y, ray.to_end.y, ray.lower.y, ray.upper.y, ray.negative.y);
        narrow_moving(&near, &far, z, z1, ray.to_start.z, ray.to_end.z, ray.lower.z, ray.upper.z, ray.negative.z);
    } else {
        // What stands still has the same planes at both ends.
        let inverse = ray.to_start + ray.to_end;
        narrow_static(&near, &far, x, inverse.x, ray.lower.x, ray.upper.x, ray.negative.x);
        narrow_static(&near, &far, y, inverse.y, ray.lower.y, ray.upper.y, ray.negative.y);
        narrow_static(&near, &far, z, inverse.z, ray.lower.z, ray.upper.z, ray.negative.z);
    }
    return entered(near, far, valid);
}

// Word `i` after place `at`.
fn node_word(at: u32, i: u32) -> u32 {
    return nodes[at + (i >> 2u)][i & 3u];
}
