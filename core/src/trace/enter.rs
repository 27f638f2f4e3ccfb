//! Slab tests of a packet against the children of a node, which are decoded once for all rays.

use hdtrapeze_simd::{Float, Mask, Part, Simd};

use super::packet::{All, LANES, Lanes, Slabs, VECTORS, part};
use crate::bvh::Bounds8;
use crate::bvh::node::Lattice8;

/// Children that some of the rays may hit.
#[derive(Clone, Copy, Debug)]
pub struct Entered {
    /// Bit `i` is set when some ray may hit child `i`.
    pub children: u32,
    /// The rays that may hit each child.
    pub rays: [u64; 8],
    /// Where the first of them enters it; of no use for children that none enters.
    pub near: [f32; 8],
}

impl Entered {
    #[inline(always)]
    fn new(rays: [u64; 8], near: [f32; 8], valid: u32) -> Self {
        let mut children = 0;
        for (child, &rays) in rays.iter().enumerate() {
            children |= u32::from(rays != 0) << child;
        }
        Self {
            children: children & valid,
            rays,
            near,
        }
    }

    /// Children that were entered, the nearest first, and their number.
    #[inline(always)]
    pub fn by_distance(&self) -> ([usize; 8], usize) {
        let mut slots = [0; 8];
        let mut count = 0;
        let mut rest = self.children;
        while rest != 0 {
            let slot = (rest.trailing_zeros() & 7) as usize;
            rest &= rest - 1;
            let mut i = count & 7;
            while i > 0 && self.near[slots[i - 1] & 7] > self.near[slot] {
                slots[i] = slots[i - 1];
                i -= 1;
            }
            slots[i] = slot;
            count += 1;
        }
        (slots, count)
    }
}

/// Tests fewer rays than this one after the other, each against all children, else all rays against one child
/// after the other.
const MANY: u32 = 9;

/// Tests the rays `lanes` against 8 children, each between its own `t_min` and `t_max`.
#[inline(always)]
pub fn enter_packet<S: Simd, B: Bounds8>(
    simd: S,
    bounds: &B,
    valid: u32,
    slabs: &[Slabs<S::F16>; VECTORS],
    lanes: u64,
    t_min: &All,
    t_max: &All,
) -> Entered {
    simd.apart(Enter::<S, B> {
        bounds,
        valid,
        slabs,
        lanes,
        t_min,
        t_max,
    })
}

struct Enter<'a, S: Simd, B> {
    bounds: &'a B,
    valid: u32,
    slabs: &'a [Slabs<S::F16>; VECTORS],
    lanes: u64,
    t_min: &'a All,
    t_max: &'a All,
}

impl<S: Simd, B: Bounds8> Part<S> for Enter<'_, S, B> {
    type Output = Entered;
    #[inline(always)]
    fn run(self, simd: S) -> Entered {
        let Self {
            bounds,
            valid,
            slabs,
            lanes,
            t_min,
            t_max,
        } = self;
        if lanes.count_ones() < MANY {
            enter_each(simd, bounds, valid, slabs, lanes, t_min, t_max)
        } else {
            enter_all(simd, bounds, valid, slabs, lanes, t_min, t_max)
        }
    }
}

/// What slab tests of all rays share: coefficients of the numbers of planes at both ends of the shutter, and what
/// remains, for lower and for upper planes.
struct Terms<F> {
    scale: [F; 3],
    end_scale: [F; 3],
    base: [[F; 3]; 2],
}

#[inline(always)]
fn terms<S: Simd, B: Bounds8>(simd: S, bounds: &B, slabs: &Slabs<S::F16>) -> Terms<S::F16> {
    let (start, end) = (bounds.start(), bounds.end());
    let mut out = Terms {
        scale: slabs.to_start,
        end_scale: slabs.to_end,
        base: slabs.base,
    };
    for a in 0..3 {
        out.scale[a] = simd.all16(start.step[a]) * slabs.to_start[a];
        let mut origin = simd.all16(start.origin[a]) * slabs.to_start[a];
        if B::MOVING {
            out.end_scale[a] = simd.all16(end.step[a]) * slabs.to_end[a];
            origin = origin + simd.all16(end.origin[a]) * slabs.to_end[a];
        }
        out.base[0][a] = origin + slabs.base[0][a];
        out.base[1][a] = origin + slabs.base[1][a];
    }
    out
}

/// One ray after the other, each against the near and the far planes of all children at once.
#[inline(always)]
fn enter_each<S: Simd, B: Bounds8>(
    simd: S,
    bounds: &B,
    valid: u32,
    slabs: &[Slabs<S::F16>; VECTORS],
    lanes: u64,
    t_min: &All,
    t_max: &All,
) -> Entered {
    let infinity = simd.all8(f32::INFINITY);
    let mut nearest = infinity;
    let mut rays = [0; 8];
    for v in 0..VECTORS {
        let lanes = part(lanes, v);
        if lanes != 0 {
            let (slabs, t_min, t_max) = (&slabs[v], &t_min[v], &t_max[v]);
            let (hits, near) = each_of(simd, bounds, slabs, lanes, t_min, t_max);
            nearest = nearest.min(near);
            for (rays, hits) in rays.iter_mut().zip(simd.columns(&hits)) {
                *rays |= u64::from(hits) << (LANES * v);
            }
        }
    }
    Entered::new(rays, nearest.to_array(), valid)
}

/// The children that each ray of a vector enters, and where the first one enters each.
#[inline(always)]
fn each_of<S: Simd, B: Bounds8>(
    simd: S,
    bounds: &B,
    slabs: &Slabs<S::F16>,
    lanes: u32,
    t_min: &Lanes,
    t_max: &Lanes,
) -> ([u8; LANES], S::F8) {
    let Terms {
        scale,
        end_scale,
        base,
    } = terms(simd, bounds, slabs);
    // Near planes, then far ones; where rays disagree, lower and upper ones.
    let agree = slabs.near_side.iter().all(|&side| side < 2);
    let zero = simd.all16(0.0);
    // Far planes count negated, so that the least of them is the largest.
    let signs = if agree {
        simd.halves(1.0, -1.0)
    } else {
        simd.all16(1.0)
    };
    let (mut start, mut end) = ([zero; 3], [zero; 3]);
    let (mut scales, mut end_scales) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
    let (mut near_base, mut far_base) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
    for a in 0..3 {
        let side = if agree { slabs.near_side[a] & 1 } else { 0 };
        let planes = &bounds.start().planes[a];
        start[a] = simd.bytes16(&planes[side], &planes[side ^ 1]) * signs;
        scales[a] = scale[a].to_array();
        if B::MOVING {
            let planes = &bounds.end().planes[a];
            end[a] = simd.bytes16(&planes[side], &planes[side ^ 1]) * signs;
            end_scales[a] = end_scale[a].to_array();
        }
        near_base[a] = base[side][a].to_array();
        let far = base[side ^ 1][a];
        far_base[a] = if agree {
            (-far).to_array()
        } else {
            far.to_array()
        };
    }
    let infinity = simd.all8(f32::INFINITY);
    let mut nearest = infinity;
    let mut hits = [0u8; LANES];
    let mut rest = lanes;
    while rest != 0 {
        let lane = rest.trailing_zeros() as usize & (LANES - 1);
        rest &= rest - 1;
        let mut t = [zero; 3];
        for a in 0..3 {
            let base = simd.halves(near_base[a][lane], far_base[a][lane]);
            t[a] = start[a].mul_add(simd.all16(scales[a][lane]), base);
            if B::MOVING {
                t[a] = end[a].mul_add(simd.all16(end_scales[a][lane]), t[a]);
            }
        }
        let (near, far) = if agree {
            let range = simd.halves(t_min[lane], -t_max[lane]);
            let (near, far) = simd.split(t[0].max(t[1]).max(t[2].max(range)));
            (near, -far)
        } else {
            let (mut near, mut far) = (simd.all8(t_min[lane]), simd.all8(t_max[lane]));
            for t in t {
                let (lower, upper) = simd.split(t);
                near = lower.min(upper).max(near);
                far = lower.max(upper).min(far);
            }
            (near, far)
        };
        let hit = near.le(far);
        hits[lane] = hit.bits() as u8;
        nearest = near.or(hit, infinity).min(nearest);
    }
    (hits, nearest)
}

/// Planes of a node's children, `[axis][side][child]`, at one end of the shutter.
type Planes = [[[f32; 8]; 2]; 3];

#[inline(always)]
fn decode<S: Simd>(simd: S, lattice: &Lattice8) -> Planes {
    let mut out = [[[0.0; 8]; 2]; 3];
    for (out, planes) in out.iter_mut().zip(&lattice.planes) {
        for (out, planes) in out.iter_mut().zip(planes) {
            *out = simd.bytes8(planes).to_array();
        }
    }
    out
}

/// All rays against one child after the other.
#[inline(always)]
fn enter_all<S: Simd, B: Bounds8>(
    simd: S,
    bounds: &B,
    valid: u32,
    slabs: &[Slabs<S::F16>; VECTORS],
    lanes: u64,
    t_min: &All,
    t_max: &All,
) -> Entered {
    let start = decode(simd, bounds.start());
    let end = if B::MOVING {
        decode(simd, bounds.end())
    } else {
        [[[0.0; 8]; 2]; 3]
    };
    let infinity = simd.all16(f32::INFINITY);
    let mut rays = [0; 8];
    let mut nears = [infinity; 8];
    for v in 0..VECTORS {
        let lanes = part(lanes, v);
        if lanes != 0 {
            let range = (simd.from16(&t_min[v]), simd.from16(&t_max[v]));
            let terms = terms(simd, bounds, &slabs[v]);
            let side = slabs[v].near_side;
            let hits = if side.iter().all(|&side| side < 2) {
                all_of::<S, B>(simd, &start, &end, &terms, side, lanes, range, &mut nears)
            } else {
                any_of::<S, B>(simd, &start, &end, &terms, lanes, range, &mut nears)
            };
            for (rays, hits) in rays.iter_mut().zip(hits) {
                *rays |= u64::from(hits) << (LANES * v);
            }
        }
    }
    let mut out = Entered::new(rays, [0.0; 8], valid);
    let mut rest = out.children;
    while rest != 0 {
        let child = (rest.trailing_zeros() & 7) as usize;
        rest &= rest - 1;
        out.near[child] = nears[child].least();
    }
    out
}

/// A vector of rays that agree on which planes are near, against one child after the other.
#[inline(always)]
#[allow(clippy::too_many_arguments)] // one call, inlined
fn all_of<S: Simd, B: Bounds8>(
    simd: S,
    start: &Planes,
    end: &Planes,
    terms: &Terms<S::F16>,
    side: [usize; 3],
    lanes: u32,
    (t_min, t_max): (S::F16, S::F16),
    nears: &mut [S::F16; 8],
) -> [u32; 8] {
    let lanes = simd.mask16(lanes);
    let zero = simd.all16(0.0);
    let (mut near_base, mut far_base) = ([zero; 3], [zero; 3]);
    let none = &start[0][0];
    let (mut start_near, mut start_far) = ([none; 3], [none; 3]);
    let (mut end_near, mut end_far) = ([none; 3], [none; 3]);
    for a in 0..3 {
        let (near, far) = (side[a] & 1, side[a] & 1 ^ 1);
        (near_base[a], far_base[a]) = (terms.base[near][a], terms.base[far][a]);
        (start_near[a], start_far[a]) = (&start[a][near], &start[a][far]);
        (end_near[a], end_far[a]) = (&end[a][near], &end[a][far]);
    }
    let mut hits = [0; 8];
    for child in 0..8 {
        let (mut n, mut f) = ([zero; 3], [zero; 3]);
        for a in 0..3 {
            let scale = terms.scale[a];
            n[a] = simd
                .all16(start_near[a][child])
                .mul_add(scale, near_base[a]);
            f[a] = simd.all16(start_far[a][child]).mul_add(scale, far_base[a]);
            if B::MOVING {
                let scale = terms.end_scale[a];
                n[a] = simd.all16(end_near[a][child]).mul_add(scale, n[a]);
                f[a] = simd.all16(end_far[a][child]).mul_add(scale, f[a]);
            }
        }
        let near = n[0].max(n[1]).max(n[2].max(t_min));
        let far = f[0].min(f[1]).min(f[2].min(t_max));
        let hit = near.le(far) & lanes;
        hits[child] = hit.bits();
        nears[child] = near.min(nears[child]).or(hit, nears[child]);
    }
    hits
}

/// A vector of rays, of which some see lower planes first and some upper ones.
#[inline(always)]
fn any_of<S: Simd, B: Bounds8>(
    simd: S,
    start: &Planes,
    end: &Planes,
    terms: &Terms<S::F16>,
    lanes: u32,
    (t_min, t_max): (S::F16, S::F16),
    nears: &mut [S::F16; 8],
) -> [u32; 8] {
    let lanes = simd.mask16(lanes);
    let mut hits = [0; 8];
    for child in 0..8 {
        let (mut near, mut far) = (t_min, t_max);
        for a in 0..3 {
            let mut t = [t_min; 2];
            for side in 0..2 {
                let plane = simd.all16(start[a][side][child]);
                t[side] = plane.mul_add(terms.scale[a], terms.base[side][a]);
                if B::MOVING {
                    let plane = simd.all16(end[a][side][child]);
                    t[side] = plane.mul_add(terms.end_scale[a], t[side]);
                }
            }
            near = t[0].min(t[1]).max(near);
            far = t[0].max(t[1]).min(far);
        }
        let hit = near.le(far) & lanes;
        hits[child] = hit.bits();
        nears[child] = near.min(nears[child]).or(hit, nears[child]);
    }
    hits
}
