// Stage `bound`: bounds of blocks and loose groups, from their vertices; the twin of core's bvh/bound.rs.
//
// One invocation bounds one item. A block's groups are bounded along the axes of space and, where that may pay, in a frame along
// its lattice; their bounds go to its place among the nodes in the form that slabs.wgsl has. The item's box, axis-aligned, is
// what the tree is made over.
//
// What is bounded is contained with real numbers. On the axes of space, the bounds of a key are coordinates. Elsewhere, in
// units of U = 2^-24:
// - In a frame (axes no longer than 1 + 32 U), the three products and two sums of a coordinate are off by 3 of
//   sum |P_i|, and moving it by the pad by 1: with what is of order U^2, less than the 6 of ROTATION_PAD.
// - In a frame that turns (core's bvh/turn.rs), what a vertex does along the step of the third axis, which is shorter than 2, is
//   off by 1 for each of the two differences, 3 for the products and sums, and 1 for its pad, of terms that are up to twice
//   as large: 12, and BOW_PAD is 16. Moving bounds by a quarter of what that leaves over the bow rounds 3 times: BOWED_PAD is 4.
// - At a key inside the shutter, with d from a bound's start to the coordinate and s from its start to its end, the excess
//   d - s time is off by 2 |d| + 3 |s|, and the sum with its own pad, 6 (|d| + |s|), by 1 (|d| + |s|). Bounds moved by
//   it are taken one float farther.
// - Each of these results may have been below normal numbers, and be flushed: TINY has room for 80 such. What is then
//   stored is no nearer to zero than LEAST.
// With products and sums fused, fewer roundings are left.

@group(0) @binding(5) var<storage, read> vertices: array<u32>;
@group(0) @binding(6) var<storage, read_write> words: array<u32>;
@group(0) @binding(7) var<storage, read_write> nodes: array<u32>;
// What nodes refer to an item by.
@group(0) @binding(8) var<storage, read_write> references: array<u32>;

const U: f32 = 5.9604644775390625e-8;
const ROTATION_PAD: f32 = 6.0 * U;
const BOW_PAD: f32 = 16.0 * U;
const BOWED_PAD: f32 = 4.0 * U;
const CHORD_PAD: f32 = 6.0 * U;
const TINY: f32 = 1.0e-36;
// Bits of 2^-125.
const LEAST: i32 = 0x01000000;
// Bits of 2^60: coordinates and bounds from there on are not traced.
const LIMIT: u32 = 0x5d800000u;
// Relative cost of turning a ray into a frame, and of what boxes there have above the surface; as core's.
const TURN_COST: f32 = 0.5;
const THICK: f32 = 2.0;
// Frames are tried for blocks that are larger and nearer than this: no product overflows.
const SMALLEST: f32 = 1.0e-12;
const LARGEST: f32 = 1.0e9;
// Cosine of the angle that a normal turns by, and the part that it is shortened to, at least; as core's.
const LEAST_COSINE: f32 = -0.3;
const LEAST_LENGTH: f32 = 0.25;
// Words of a block's frame, and what its place is marked by where it turns.
const FRAME_WORDS: u32 = select(9u, 15u, MOVES);
const TURNS: u32 = 0x80000000u;
const LOOSE: u32 = 0x40000000u;
// Grids from this number on have no loose groups.
const LOOSE_GRIDS: u32 = 0x02000000u;
// Micropolygons along a loose group of a strip.
const LOOSE_LENGTH: u32 = 2u;
// Bits of its number.
const LOOSE_BITS: u32 = 5u;

// A rectangle of micropolygons, and the groups that it is cut into.
struct Span {
    at: vec2<u32>,
    size: vec2<u32>,
    group: vec2<u32>,
    columns: u32,
    count: u32,
}

// A block's frame: the same at both ends of the shutter but for the third axis, and what is added along that, times `T (1 - T)`.
struct Turn {
    start: mat3x3<f32>,
    end: mat3x3<f32>,
    bow: f32,
}

// Vertices of a grid.
struct Lattice {
    // First x coordinate at the first key.
    first: u32,
    // Vertices of all rows.
    count: u32,
    // Vertices of a row, which is all its x, then y, then z.
    columns: u32,
}

fn rounded_up(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    return (a + b - vec2<u32>(1u)) / b;
}

// The smallest groups, and of equals the narrowest, of which at most 8 cover a block.
fn cut_groups(at: vec2<u32>, size: vec2<u32>) -> Span {
    var group = vec2<u32>(4u, 2u);
    for (var shape = 0u; shape < 8u; shape++) {
        let tried = vec2<u32>(1u + shape / 2u, 1u + shape % 2u);
        let needed = rounded_up(size, tried);
        if needed.x * needed.y <= 8u && tried.x * tried.y < group.x * group.y {
            group = tried;
        }
    }
    let needed = rounded_up(size, group);
    return Span(at, size, group, needed.x, needed.x * needed.y);
}

// Block `slot` of a grid: as few as the shapes 8x8, 4x16 and 16x4 allow, evenly.
fn block_span(rates: vec2<u32>, slot: u32) -> Span {
    var counts = rounded_up(rates, vec2<u32>(8u));
    let narrow = rounded_up(rates, vec2<u32>(4u, 16u));
    let flat = rounded_up(rates, vec2<u32>(16u, 4u));
    if narrow.x * narrow.y < counts.x * counts.y {
        counts = narrow;
    }
    if flat.x * flat.y < counts.x * counts.y {
        counts = flat;
    }
    let number = vec2<u32>(slot % counts.x, slot / counts.x);
    let at = number * rates / counts;
    let end = (number + vec2<u32>(1u)) * rates / counts;
    return cut_groups(at, end - at);
}

fn is_small(rates: vec2<u32>) -> bool {
    return rates.x <= 4u && rates.y <= 2u;
}

fn is_loose(rates: vec2<u32>, grid: u32) -> bool {
    let strip = min(rates.x, rates.y) == 1u && max(rates.x, rates.y) >= 3u;
    return (is_small(rates) || strip) && grid < LOOSE_GRIDS;
}

// Loose group `slot` of a grid.
fn loose_span(rates: vec2<u32>, slot: u32) -> Span {
    var at = vec2<u32>(0u);
    var size = rates;
    if !is_small(rates) {
        let along = select(vec2<u32>(1u, 0u), vec2<u32>(0u, 1u), rates.x == 1u);
        at = along * (slot * LOOSE_LENGTH);
        size = min(rates - at, along * LOOSE_LENGTH + (vec2<u32>(1u) - along) * rates);
    }
    return Span(at, size, size, 1u, 1u);
}

fn position(lattice: Lattice, key: u32, vertex: vec2<u32>) -> vec3<u32> {
    let at = lattice.first + 3u * (key * lattice.count + vertex.y * lattice.columns) + vertex.x;
    return vec3<u32>(vertices[at], vertices[at + lattice.columns], vertices[at + 2u * lattice.columns]);
}

// Bounds of the groups of a block at a key, along the rows of `axes` where `turns`; gives the largest bits of a coordinate
// without its sign.
fn ranges(span: Span, lattice: Lattice, key: u32, turns: bool, axes: mat3x3<f32>,
          out: ptr<function, array<Ends, 8>>) -> u32 {
    var most = 0u;
    for (var slot = 0u; slot < span.count; slot++) {
        let from_cell = vec2<u32>(slot % span.columns, slot / span.columns) * span.group;
        let to_cell = min(from_cell + span.group, span.size);
        var found = nothing();
        for (var j = from_cell.y; j <= to_cell.y; j++) {
            for (var i = from_cell.x; i <= to_cell.x; i++) {
                let bits = position(lattice, key, span.at + vec2<u32>(i, j));
                let magnitudes = bits & vec3<u32>(0x7fffffffu);
                most = max(most, max(magnitudes.x, max(magnitudes.y, magnitudes.z)));
                if turns {
                    let p = bitcast<vec3<f32>>(bits);
                    let q = p * axes;
                    let pad = (abs(p.x) + abs(p.y) + abs(p.z)) * ROTATION_PAD + TINY;
                    let lo = ordered(bitcast<vec3<u32>>(q - vec3<f32>(pad)));
                    let hi = ordered(bitcast<vec3<u32>>(q + vec3<f32>(pad)));
                    found = joined(found, Ends(lo, hi));
                } else {
                    let o = ordered(bits);
                    found = joined(found, Ends(o, o));
                }
            }
        }
        (*out)[slot] = found;
    }
    return most;
}

// At least how far `value` is above the chord from `a` to `b` at `time`; below, where both are negated.
fn excess(a: vec3<f32>, b: vec3<f32>, time: f32, value: vec3<f32>) -> vec3<f32> {
    let d = value - a;
    let s = b - a;
    return (d - s * time) + (CHORD_PAD * (abs(d) + abs(s)) + vec3<f32>(TINY));
}

// The integer of a float that is surely above `x`.
fn above(x: vec3<f32>) -> vec3<i32> {
    let bits = bitcast<vec3<u32>>(x);
    let small = (bits & vec3<u32>(0x7fffffffu)) < vec3<u32>(u32(LEAST));
    return select(ordered(bits) + vec3<i32>(1), vec3<i32>(LEAST), small);
}

// Raises bounds that go from `a` to `b`, until their chord is not below `value` at `time`.
fn raise(a: ptr<function, vec3<i32>>, b: ptr<function, vec3<i32>>, time: f32, value: vec3<i32>) {
    let from_real = real(*a);
    let to_real = real(*b);
    let by = excess(from_real, to_real, time, real(value));
    let moved = by > vec3<f32>(0.0);
    // A constant chord: nothing is rounded.
    let level = *a == *b;
    let most = max(*a, value);
    let raised_a = select(*a, above(from_real + by), moved);
    let raised_b = select(*b, above(to_real + by), moved);
    *a = select(raised_a, most, level);
    *b = select(raised_b, most, level);
}

// Moves the bounds along the third axis of a frame that turns outward, by what chords of vertices leave.
fn bow_out(span: Span, lattice: Lattice, turn: Turn,
           start: ptr<function, array<Ends, 8>>, end: ptr<function, array<Ends, 8>>) {
    let step = turn.end[2] - turn.start[2];
    for (var slot = 0u; slot < span.count; slot++) {
        let from_cell = vec2<u32>(slot % span.columns, slot / span.columns) * span.group;
        let to_cell = min(from_cell + span.group, span.size);
        var below = 0.0;
        var beyond = 0.0;
        for (var j = from_cell.y; j <= to_cell.y; j++) {
            for (var i = from_cell.x; i <= to_cell.x; i++) {
                let vertex = span.at + vec2<u32>(i, j);
                let d = bitcast<vec3<f32>>(position(lattice, 1u, vertex)) - bitcast<vec3<f32>>(position(lattice, 0u, vertex));
                let w = dot(step, d);
                let pad = (abs(d.x) + abs(d.y) + abs(d.z)) * BOW_PAD + TINY;
                below = max(below, (w + pad) - turn.bow);
                beyond = max(beyond, turn.bow - (w - pad));
            }
        }
        below *= 0.25;
        beyond *= 0.25;
        for (var side = 0u; side < 2u; side++) {
            var ends = (*start)[slot];
            if side == 1u {
                ends = (*end)[slot];
            }
            var lo = real(ends.lo);
            var hi = real(ends.hi);
            lo.z = (lo.z - below) - ((abs(lo.z) + below) * BOWED_PAD + TINY);
            hi.z = (hi.z + beyond) + ((abs(hi.z) + beyond) * BOWED_PAD + TINY);
            ends.lo.z = ordered(bitcast<vec3<u32>>(lo)).z;
            ends.hi.z = ordered(bitcast<vec3<u32>>(hi)).z;
            if side == 1u {
                (*end)[slot] = ends;
            } else {
                (*start)[slot] = ends;
            }
        }
    }
}

// Bounds over the shutter, as `ranges`; what is bounded in a frame that turns has two keys.
fn bound_groups(span: Span, lattice: Lattice, object: BuildObject, turns: bool, turn: Turn,
                start: ptr<function, array<Ends, 8>>, end: ptr<function, array<Ends, 8>>) -> u32 {
    var most = ranges(span, lattice, 0u, turns, turn.start, start);
    if !MOVES {
        return most;
    }
    let last = object.key_count - 1u;
    most = max(most, ranges(span, lattice, last, turns, turn.end, end));
    if turns && does_turn(turn) {
        bow_out(span, lattice, turn, start, end);
    }
    for (var key = 1u; key < last; key++) {
        let time = bitcast<f32>(words[object.key_times + key]);
        var inner: array<Ends, 8>;
        most = max(most, ranges(span, lattice, key, turns, turn.start, &inner));
        for (var slot = 0u; slot < span.count; slot++) {
            var hi_a = (*start)[slot].hi;
            var hi_b = (*end)[slot].hi;
            raise(&hi_a, &hi_b, time, inner[slot].hi);
            // The complement of an integer here is that of the float with the other sign.
            var lo_a = ~(*start)[slot].lo;
            var lo_b = ~(*end)[slot].lo;
            raise(&lo_a, &lo_b, time, ~inner[slot].lo);
            (*start)[slot] = Ends(~lo_a, hi_a);
            (*end)[slot] = Ends(~lo_b, hi_b);
        }
    }
    return most;
}

fn hull(count: u32, start: ptr<function, array<Ends, 8>>, end: ptr<function, array<Ends, 8>>) -> Box {
    var all = Box((*start)[0], (*start)[0]);
    for (var slot = 1u; slot < count; slot++) {
        all.start = joined(all.start, (*start)[slot]);
    }
    all.end = all.start;
    if MOVES {
        all.end = (*end)[0];
        for (var slot = 1u; slot < count; slot++) {
            all.end = joined(all.end, (*end)[slot]);
        }
    }
    return all;
}

// The sum of the areas of groups.
fn cost(count: u32, start: ptr<function, array<Ends, 8>>, end: ptr<function, array<Ends, 8>>) -> f32 {
    var sum = 0.0;
    for (var slot = 0u; slot < count; slot++) {
        var one = Box((*start)[slot], (*start)[slot]);
        if MOVES {
            one.end = (*end)[slot];
        }
        sum += area(one);
    }
    return sum;
}

// The largest bits of a bound without its sign.
fn magnitude(b: Box) -> u32 {
    let sides = max(max(positive(b.start.lo), positive(b.start.hi)), max(positive(b.end.lo), positive(b.end.hi)));
    return u32(max(sides.x, max(sides.y, sides.z)));
}

fn positive(o: vec3<i32>) -> vec3<i32> {
    return o ^ (o >> vec3<u32>(31u));
}

fn length_of(v: vec3<f32>) -> f32 {
    return sqrt(dot(v, v));
}

// Unit, but for some 10 U; zero where there is no direction.
fn direction(v: vec3<f32>) -> vec3<f32> {
    let a = abs(v);
    let most = max(a.x, max(a.y, a.z));
    if most < SMALLEST {
        return vec3<f32>(0.0);
    }
    let scaled = v / most;
    return scaled * inverseSqrt(dot(scaled, scaled));
}

// Some direction at right angles to a unit one.
fn across(x: vec3<f32>) -> vec3<f32> {
    let side = select(vec3<f32>(1.0, 0.0, 0.0), vec3<f32>(0.0, 1.0, 0.0), abs(x.x) > 0.6);
    return direction(cross(x, side));
}

// True where the first of a block's edges is the one that groups fill more.
fn runs_along_u(edges: array<vec3<f32>, 2>, span: Span) -> bool {
    let share = vec2<f32>(span.group) / vec2<f32>(span.size);
    return length_of(edges[0]) * share.x >= length_of(edges[1]) * share.y;
}

// The frame along one of a block's edges, in its plane.
fn frame_along(edges: array<vec3<f32>, 2>, along_u: bool) -> mat3x3<f32> {
    let a = direction(select(edges[1], edges[0], along_u));
    let b = direction(select(edges[0], edges[1], along_u));
    let x = select(a, b, dot(a, a) == 0.0);
    var z = cross(x, b);
    // Nearly in line, the product is mostly rounding.
    if dot(z, z) < 1.0e-8 {
        z = across(x);
    } else {
        z = direction(z);
    }
    return mat3x3<f32>(x, cross(z, x), z);
}

fn fixed(axes: mat3x3<f32>) -> Turn {
    return Turn(axes, axes, 0.0);
}

fn does_turn(turn: Turn) -> bool {
    return any(turn.start[2] != turn.end[2]);
}

// The frame of a block whose edges are known at its middle key: with two keys, one that follows its normal.
fn turn_of(span: Span, lattice: Lattice, edges: array<vec3<f32>, 2>, key_count: u32) -> Turn {
    if !MOVES || key_count != 2u {
        return fixed(frame_along(edges, runs_along_u(edges, span)));
    }
    let before = lattice_edges(span, lattice, 0u);
    let after = lattice_edges(span, lattice, 1u);
    let along_u = runs_along_u(array<vec3<f32>, 2>(before[0] + after[0], before[1] + after[1]), span);
    let start = frame_along(before, along_u);
    let end = frame_along(after, along_u);
    let along = start[0] + end[0];
    let side = cross(start[2] + end[2], along);
    if dot(start[2], end[2]) < LEAST_COSINE || dot(side, side) < 1.0e-8 {
        return fixed(start);
    }
    let middle = frame_along(array<vec3<f32>, 2>(along, side), true);
    // The shortened normal: of all `l0 a0.E1 + l1 a1.E0`, the least squares.
    let ahead = vec2<f32>(dot(start[2], after[0]), dot(start[2], after[1]));
    let behind = vec2<f32>(dot(end[2], before[0]), dot(end[2], before[1]));
    let own = dot(ahead, ahead);
    let both = -dot(ahead, behind);
    var lengths = vec2<f32>(1.0);
    if both >= LEAST_LENGTH * own && both <= own && both > 0.0 {
        lengths.x = min(both / own, 1.0);
    } else if both > own && LEAST_LENGTH * both <= own {
        lengths.y = min(own / both, 1.0);
    }
    let from_normal = start[2] * lengths.x;
    let to_normal = end[2] * lengths.y;
    let way = middle_of(span, lattice, 1u) - middle_of(span, lattice, 0u);
    return Turn(mat3x3<f32>(middle[0], middle[1], from_normal), mat3x3<f32>(middle[0], middle[1], to_normal),
                dot(to_normal - from_normal, way));
}

// The mean of a block's corners at a key.
fn middle_of(span: Span, lattice: Lattice, key: u32) -> vec3<f32> {
    let a = bitcast<vec3<f32>>(position(lattice, key, span.at));
    let b = bitcast<vec3<f32>>(position(lattice, key, span.at + vec2<u32>(span.size.x, 0u)));
    let c = bitcast<vec3<f32>>(position(lattice, key, span.at + vec2<u32>(0u, span.size.y)));
    let d = bitcast<vec3<f32>>(position(lattice, key, span.at + span.size));
    return ((a + b) + (c + d)) * 0.25;
}

// The block's edges along u and v at a key, each the mean of the two that face each other.
fn lattice_edges(span: Span, lattice: Lattice, key: u32) -> array<vec3<f32>, 2> {
    let across_u = vec2<u32>(span.size.x, 0u);
    let across_v = vec2<u32>(0u, span.size.y);
    let a = bitcast<vec3<f32>>(position(lattice, key, span.at));
    let b = bitcast<vec3<f32>>(position(lattice, key, span.at + across_u));
    let c = bitcast<vec3<f32>>(position(lattice, key, span.at + across_v));
    let d = bitcast<vec3<f32>>(position(lattice, key, span.at + span.size));
    return array<vec3<f32>, 2>(((b - a) + (d - c)) * 0.5, ((c - a) + (d - b)) * 0.5);
}

fn write_axis(at: u32, axis: vec3<f32>) {
    for (var c = 0u; c < 3u; c++) {
        words[at + c] = bitcast<u32>(axis[c]);
    }
}

// Notes a centre and a magnitude for an object. Most have nothing to add, and wait for nobody.
fn note(object: u32, at: vec3<f32>, reach: i32) {
    let o = ordered(bitcast<vec3<u32>>(at));
    let first = FACTS * object;
    for (var axis = 0u; axis < 3u; axis++) {
        if atomicLoad(&facts[first + axis]) > o[axis] {
            atomicMin(&facts[first + axis], o[axis]);
        }
        if atomicLoad(&facts[first + 3u + axis]) < o[axis] {
            atomicMax(&facts[first + 3u + axis], o[axis]);
        }
    }
    if atomicLoad(&facts[first + 6u]) < reach {
        atomicMax(&facts[first + 6u], reach);
    }
}

@compute @workgroup_size(64)
fn bound(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
         @builtin(local_invocation_index) lane: u32) {
    let i = launch.first + (group.y * groups.x + group.x) * 64u + lane;
    if i >= launch.end {
        return;
    }
    let item = item_at(i);
    let object = objects[item.object];
    let header = object.grids + 2u * item.grid;
    let rates = vec2<u32>(words[header + 1u] & 0xffffu, words[header + 1u] >> 16u);
    var lattice: Lattice;
    lattice.columns = rates.x + 1u;
    lattice.count = (rates.x + 1u) * (rates.y + 1u);
    lattice.first = object.vertices + 3u * words[header] * object.key_count;
    let loose = is_loose(rates, item.grid);
    var span: Span;
    if loose {
        span = loose_span(rates, item.slot);
    } else {
        span = block_span(rates, item.slot);
    }
    var start: array<Ends, 8>;
    var end: array<Ends, 8>;
    let space = fixed(mat3x3<f32>());
    let coordinate = bound_groups(span, lattice, object, false, space, &start, &end);
    let box = hull(span.count, &start, &end);
    let most = max(coordinate, magnitude(box));
    if most >= LIMIT {
        // A grid is traced whole or not at all.
        atomicOr(&facts[drop_word(item.number)], drop_bit(item.number));
        return;
    }
    store_box(i, box);
    var reach = i32(most);
    if loose {
        references[i] = LEAF | LOOSE | (item.grid << LOOSE_BITS) | item.slot;
    } else {
        let block = starts[item.number].y + item.slot * BLOCK_UNITS;
        var frame = 0u;
        let whole = area(box);
        let edges = lattice_edges(span, lattice, object.key_count / 2u);
        let longest = max(length_of(edges[0]), length_of(edges[1]));
        if bitcast<f32>(most) < LARGEST && longest > SMALLEST {
            let surface = length_of(cross(edges[0], edges[1]));
            let price = whole * TURN_COST;
            let straight = cost(span.count, &start, &end);
            if surface + price < straight {
                let turn = turn_of(span, lattice, edges, object.key_count);
                var turned_start: array<Ends, 8>;
                var turned_end: array<Ends, 8>;
                _ = bound_groups(span, lattice, object, true, turn, &turned_start, &turned_end);
                let turned = cost(span.count, &turned_start, &turned_end);
                if turned + THICK * (turned - surface) + price < straight {
                    start = turned_start;
                    end = turned_end;
                    frame = launch.frames + FRAME_WORDS * ((block - launch.blocks) / BLOCK_UNITS);
                    for (var axis = 0u; axis < 3u; axis++) {
                        write_axis(frame + 3u * axis, turn.start[axis]);
                    }
                    if MOVES && does_turn(turn) {
                        write_axis(frame + 9u, turn.end[2]);
                        // With two keys nothing bows along fixed axes.
                        write_axis(frame + 12u, vec3<f32>(0.0, 0.0, turn.bow));
                        frame |= TURNS;
                    }
                }
            }
        }
        let at = 4u * (block - launch.base);
        var plane = pack(at, &start, span.count);
        if MOVES {
            plane = max(plane, pack(at + 18u, &end, span.count));
        }
        reach = max(reach, bitcast<i32>(plane));
        let tail = at + LATTICE_WORDS;
        nodes[tail] = item.grid;
        nodes[tail + 1u] = span.at.x | (span.at.y << 8u) | (span.size.x << 16u) | (span.size.y << 24u);
        nodes[tail + 2u] = span.group.x | (span.group.y << 8u) | (span.columns << 16u) | (span.count << 24u);
        nodes[tail + 3u] = frame;
        references[i] = LEAF | block;
    }
    note(item.object, centre(box), reach);
}
