//! A ray laid out for slab tests against 8 children: near planes in the first half of a vector, far planes, mirrored, in the
//! second. What all planes of an axis have in them, and what their numbers are multiplied by, is one product and one sum for all axes
//! and both halves; from there it is spread over the children. The latest near plane and the earliest far one are one maximum.
//! Some processors slow down, and for longer than that takes, where products of 16 floats follow each other closely: there are few.
//!
//! A plane's terms are those of [`crate::bvh::node::SlabRay`], for which [`super::object_ray`] derives pads, but the ray's own comes first:
//! the three sums before the last are of up to R + |o|, at most `20 R + 8 |o|` for all terms in place of `20 R + 7 |o|`. In a
//! rotated frame that is less than the 34.7 there, since sqrt(3) is the share of R alone.

use hdtrapeze_simd::{Float, Mask, Simd};

use super::packet::{LANES, Lanes, PACKET, Slabs, split};
use crate::bvh::Bounds8;
use crate::bvh::diagonal::{CHILDREN, Diagonals, PADS, Planes8, Sight, passed_by};
use crate::bvh::node::Node;

/// A ray in the frame of a node.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct Laid {
    /// By axis, in each half: what origins at the start of the shutter are multiplied by, and steps again; the last two are 0.
    to_start: Lanes,
    /// The same at its end.
    to_end: Lanes,
    /// By axis, in each half: what is added.
    base: Lanes,
    /// The order of planes, which are lower ones before upper ones: near ones before far ones.
    order: [[u8; 16]; 3],
    /// For diagonals.
    sight: Sight,
}

impl Laid {
    /// The same numbers everywhere.
    pub const fn filled(x: f32) -> Self {
        Self {
            to_start: [x; LANES],
            to_end: [x; LANES],
            base: [x; LANES],
            order: [ORDERS[0]; 3],
            sight: Sight {
                turned: [u32::MAX; 3],
                scale: [[x; 3]; 2],
                pads: [x; 3],
            },
        }
    }

    /// Lays out ray number `at` of `slabs`.
    #[inline(always)]
    pub fn set<S: Simd>(&mut self, simd: S, slabs: &Slabs, at: usize, moving: bool) {
        let (v, lane) = split(at);
        let mut start = [0.0; 3];
        let mut end = [0.0; 3];
        let mut base = [[0.0; 3]; 2];
        for a in 0..3 {
            let side = (slabs.negative[a] >> (at & (PACKET - 1)) & 1) as usize;
            self.order[a] = ORDERS[side];
            let first = slabs.negative[0] >> (at & (PACKET - 1)) & 1;
            self.sight.turned[a] = (side as u32 ^ first as u32).wrapping_neg() & CHILDREN;
            let sign = (side as u32) << 31;
            let signed = |x: f32| f32::from_bits(x.to_bits() ^ sign);
            let to = slabs.to_start[a][v][lane];
            self.sight.scale[0][a] = to;
            start[a] = signed(to);
            if moving {
                let to = slabs.to_end[a][v][lane];
                self.sight.scale[1][a] = to;
                end[a] = signed(to);
            }
            let [near, far] = slabs.base[a][v][lane];
            (base[0][a], base[1][a]) = (near, far);
            self.sight.pads[a] = (-far - near) * PADS;
        }
        let mirrored = |x: S::F16| {
            let [near, far] = simd.of_halves(x);
            simd.halves(near, -far).to_array()
        };
        self.to_start = mirrored(simd.sixes(&start, &start));
        if moving {
            self.to_end = mirrored(simd.sixes(&end, &end));
        }
        let none = [0.0; 3];
        let [near, _] = simd.of_halves(simd.sixes(&base[0], &none));
        let [far, _] = simd.of_halves(simd.sixes(&base[1], &none));
        self.base = simd.halves(near, far).to_array();
    }

    /// Tests the children of a node within `span`. Nothing here branches on what is found.
    #[inline(always)]
    pub fn test<S: Simd, B: Bounds8>(
        &self,
        simd: S,
        node: &Node<B>,
        span: &Lanes,
        tested: &mut Tested,
    ) {
        let (start, end) = (node.bounds.start(), node.bounds.end());
        // By axis, what all planes have in them; then, what their numbers are multiplied by.
        let at_start = simd.sixes(&start.origin, &start.step);
        let at_start = at_start.mul_add(simd.from16(&self.to_start), simd.from16(&self.base));
        let (mut own, mut at_end) = (at_start, at_start);
        if B::MOVING {
            let origins = simd.mask16(ORIGINS);
            at_end = simd.sixes(&end.origin, &end.step).mul_add(
                simd.from16(&self.to_end),
                at_start.or(origins, simd.all16(0.0)),
            );
            own = at_end;
        }
        let mut planes = [own; 3];
        for (a, plane) in planes.iter_mut().enumerate() {
            let numbers = self.numbers(simd, &start.planes[a], a);
            let scale = simd.over_halves(at_start, 3 + a);
            *plane = numbers.mul_add(scale, simd.over_halves(own, a));
            if B::MOVING {
                tested.at_start[a] = plane.to_array();
                let numbers = self.numbers(simd, &end.planes[a], a);
                let scale = simd.over_halves(at_end, 3 + a);
                *plane = numbers.mul_add(scale, *plane);
            }
        }
        let [x, y, z] = planes;
        let [near, far] = simd.of_halves(x.max(y).max(z.max(simd.from16(span))));
        let mask = near.le(-far).bits() & node.valid();
        let items = mask & simd.high_bits(&node.children);
        (tested.inner, tested.items) = (mask & !items, items);
        tested.near = near.to_array();
        tested.planes = [x.to_array(), y.to_array(), z.to_array()];
    }

    /// Those items of a node that was [tested](Self::test) whose diagonals the ray does not pass by.
    #[inline(always)]
    pub fn near_diagonals<S: Simd, B: Bounds8>(
        &self,
        simd: S,
        node: &Node<B>,
        tested: &Tested,
    ) -> u32 {
        let (start, end) = (node.bounds.start(), node.bounds.end());
        let diagonals = Diagonals::of(node.slots, node.at_end, start, end);
        let planes = sides(simd, &tested.planes);
        let at_start = if B::MOVING {
            sides(simd, &tested.at_start)
        } else {
            planes
        };
        let planes = (&planes, &at_start);
        let passed = passed_by(simd, &node.bounds, &diagonals, &self.sight, planes);
        // Nothing is said of items in nodes that have none.
        let some = u32::from(node.slots > CHILDREN).wrapping_neg();
        tested.items & !(passed & some)
    }

    /// Numbers of the planes along axis `a`: near, then far.
    #[inline(always)]
    fn numbers<S: Simd>(&self, simd: S, planes: &[[u8; 8]; 2], a: usize) -> S::F16 {
        simd.bytes16(planes, &self.order[a])
    }
}

/// Lanes of origins.
const ORIGINS: u32 = 0b111 << 8 | 0b111;

/// Near and far planes.
#[inline(always)]
fn sides<S: Simd>(simd: S, planes: &[Lanes; 3]) -> Planes8<S::F8> {
    let mut out = [[simd.all8(0.0); 2]; 3];
    for (out, planes) in out.iter_mut().zip(planes) {
        let [near, far] = simd.of_halves(simd.from16(planes));
        *out = [near, -far];
    }
    out
}

/// Children that a ray may hit: nodes and items, by bit masks, and where it enters them (meaningless for others).
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct Tested {
    planes: [Lanes; 3],
    /// The same, but for what the end of the shutter has in them besides its origin; without meaning where nothing moves.
    at_start: [Lanes; 3],
    /// Where the ray enters each child.
    pub near: [f32; 8],
    /// Those that are nodes.
    pub inner: u32,
    /// Those that are items.
    pub items: u32,
}

impl Tested {
    /// The same numbers everywhere.
    pub const fn filled(x: f32) -> Self {
        Self {
            planes: [[x; LANES]; 3],
            at_start: [[x; LANES]; 3],
            near: [x; 8],
            inner: u32::MAX,
            items: u32::MAX,
        }
    }
}

/// The order of planes for rays that go upward, and downward.
static ORDERS: [[u8; 16]; 2] = [
    [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15],
    [8, 9, 10, 11, 12, 13, 14, 15, 0, 1, 2, 3, 4, 5, 6, 7],
];
