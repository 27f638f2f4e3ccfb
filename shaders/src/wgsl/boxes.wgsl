// Boxes as the stages that make trees hold them: bounds at both ends of the shutter, or once where nothing moves.
//
// Bounds are integers in the order of the floats whose bits they are: an integer's least and most are exact, where a
// float below normal numbers may be flushed to zero, and NaN has a place as well, beyond all that is finite.
//
// The permutation fixes MOVES (bounds have two ends).

// Words of a box.
const BOX: u32 = select(6u, 12u, MOVES);
// Units of 16 bytes of a node, and of a block.
const NODE_UNITS: u32 = select(7u, 12u, MOVES);
const BLOCK_UNITS: u32 = select(6u, 10u, MOVES);
// Words of the lattices of a node or block.
const LATTICE_WORDS: u32 = select(18u, 36u, MOVES);

const LEAF: u32 = 0x80000000u;
const NONE: u32 = 0xffffffffu;

@group(0) @binding(0) var<uniform> launch: BuildLaunch;
// Of items by number, then of inner nodes.
@group(0) @binding(1) var<storage, read_write> boxes: array<i32>;

// Bounds at one instant.
struct Ends {
    lo: vec3<i32>,
    hi: vec3<i32>,
}

// At the start of the shutter and at its end, the same where nothing moves.
struct Box {
    start: Ends,
    end: Ends,
}

// The integers of floats, given their bits.
fn ordered(bits: vec3<u32>) -> vec3<i32> {
    let b = bitcast<vec3<i32>>(bits);
    return b ^ ((b >> vec3<u32>(31u)) & vec3<i32>(0x7fffffff));
}

// The floats of integers.
fn real(o: vec3<i32>) -> vec3<f32> {
    return bitcast<vec3<f32>>(o ^ ((o >> vec3<u32>(31u)) & vec3<i32>(0x7fffffff)));
}

// Bounds of nothing: of a finite float, and beyond all that is traced.
fn nothing() -> Ends {
    let far = vec3<i32>(0x7f000000);
    return Ends(far, ~far);
}

fn joined(a: Ends, b: Ends) -> Ends {
    return Ends(min(a.lo, b.lo), max(a.hi, b.hi));
}

fn union_of(a: Box, b: Box) -> Box {
    return Box(joined(a.start, b.start), joined(a.end, b.end));
}

fn products(e: vec3<f32>) -> f32 {
    return e.x * e.y + e.y * e.z + e.z * e.x;
}

fn extents(e: Ends) -> vec3<f32> {
    return max(real(e.hi) - real(e.lo), vec3<f32>(0.0));
}

// Half the surface area, averaged over time, but for rounding: as LinearBox::mean_half_area. With extents e and f
// at the ends and s their sum, the mean of x y is (ex ey + fx fy + sx sy) / 6.
fn area(b: Box) -> f32 {
    let e = extents(b.start);
    if !MOVES {
        return products(e);
    }
    let f = extents(b.end);
    return (products(e) + products(f) + products(e + f)) * (1.0 / 6.0);
}

// Four times the centre in mid-shutter.
fn centre(b: Box) -> vec3<f32> {
    return (real(b.start.lo) + real(b.start.hi)) + (real(b.end.lo) + real(b.end.hi));
}

fn triple(at: u32) -> vec3<i32> {
    return vec3<i32>(boxes[at], boxes[at + 1u], boxes[at + 2u]);
}

fn box_at(i: u32) -> Box {
    let at = i * BOX;
    let start = Ends(triple(at), triple(at + 3u));
    if !MOVES {
        return Box(start, start);
    }
    return Box(start, Ends(triple(at + 6u), triple(at + 9u)));
}

fn store_triple(at: u32, v: vec3<i32>) {
    boxes[at] = v.x;
    boxes[at + 1u] = v.y;
    boxes[at + 2u] = v.z;
}

fn store_box(i: u32, b: Box) {
    let at = i * BOX;
    store_triple(at, b.start.lo);
    store_triple(at + 3u, b.start.hi);
    if MOVES {
        store_triple(at + 6u, b.end.lo);
        store_triple(at + 9u, b.end.hi);
    }
}
