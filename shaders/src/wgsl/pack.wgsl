// Lattices of 8 boxes, packed outward: the twin of Lattice8::pack in core's bvh/node.rs.
//
// A plane is `origin + step q` with real numbers. The first plane is the least bound, exactly. WGSL's sums and products are
// rounded once each, its quotients are off by 2.5 ULP, which is 5 U, and results below normal numbers may be flushed.
// - The step: an extent is off by U and its product with STEP by U more; STEP has 16 U over 1/255, so the last plane
//   is not below the largest bound. Extents below FLAT, where that says nothing, have steps of FLAT.
// - Numbers: an offset is off by U, the reciprocal of the step by 5, their product by one: 7 U of at most 256, which is
//   2^-13.2, or less than 2^-18 where an offset was flushed: steps are no smaller than FLAT / 256. NUMBER_PAD moves numbers
//   outward by 2^-10 before they are rounded outward.

const STEP: f32 = 0.0039215725;
// 2^-100.
const FLAT: f32 = 7.888609052210118e-31;
const NUMBER_PAD: f32 = 0.0009765625;
// What the magnitude of a plane is multiplied by: a sum and a product are off by 3 U of the larger of both outer planes.
const REACH: f32 = 1.000001;

fn packed(numbers: array<u32, 8>, first: u32) -> u32 {
    return numbers[first] | (numbers[first + 1u] << 8u) | (numbers[first + 2u] << 16u) | (numbers[first + 3u] << 24u);
}

// Writes the lattice of `count` boxes from word `at` on; gives no less than the magnitude of any plane.
fn pack(at: u32, ends: ptr<function, array<Ends, 8>>, count: u32) -> f32 {
    var all = (*ends)[0];
    for (var slot = 1u; slot < count; slot++) {
        all = joined(all, (*ends)[slot]);
    }
    let first = real(all.lo);
    let last = real(all.hi);
    let extent = last - first;
    let flat = extent < vec3<f32>(FLAT);
    let step = select(extent * STEP, select(vec3<f32>(FLAT), vec3<f32>(0.0), all.lo == all.hi), flat);
    let inverse = vec3<f32>(1.0) / select(step, vec3<f32>(1.0), flat);
    for (var axis = 0u; axis < 3u; axis++) {
        // The bits as they are: what is below normal numbers is stored, too.
        nodes[at + axis] = ordered_bits(all.lo[axis]);
        nodes[at + 3u + axis] = bitcast<u32>(step[axis]);
        var lower: array<u32, 8>;
        var upper: array<u32, 8>;
        for (var slot = 0u; slot < count; slot++) {
            let lo = real((*ends)[slot].lo)[axis] - first[axis];
            let hi = real((*ends)[slot].hi)[axis] - first[axis];
            let from_plane = floor(lo * inverse[axis] - NUMBER_PAD);
            let to_plane = ceil(hi * inverse[axis] + NUMBER_PAD);
            lower[slot] = select(u32(clamp(from_plane, 0.0, 255.0)), 0u, flat[axis]);
            upper[slot] = select(u32(clamp(to_plane, 0.0, 255.0)), 255u, flat[axis]);
        }
        let words = at + 6u + 4u * axis;
        nodes[words] = packed(lower, 0u);
        nodes[words + 1u] = packed(lower, 4u);
        nodes[words + 2u] = packed(upper, 0u);
        nodes[words + 3u] = packed(upper, 4u);
    }
    let reach = max(abs(first), abs(first + 255.0 * step)) * REACH;
    return max(reach.x, max(reach.y, reach.z));
}

fn ordered_bits(o: i32) -> u32 {
    return bitcast<u32>(o ^ ((o >> 31u) & 0x7fffffff));
}
