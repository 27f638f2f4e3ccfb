//! A ray laid out for slab tests against 8 children: near planes in the first half of a vector, far planes, mirrored, in the
//! second. What all planes of an axis have in them is one product and one sum for all axes, which lie in each quarter of a vector, and
//! what their numbers are multiplied by one product; within its quarters each axis is spread over the children, which takes less than it takes
//! across them. The latest near plane and the earliest far one are one maximum.
//! Some processors slow down, and for longer than that takes, where products of 16 floats follow each other closely: there are few.
//!
//! A plane's terms are those of [`crate::bvh::node::SlabRay`], for which [`super::object_ray`] derives pads, but the ray's own comes first:
//! the three sums before the last are of up to R + |o|, at most `20 R + 8 |o|` for all terms in place of `20 R + 7 |o|`. In a
//! rotated frame that is less than the 34.7 there, since sqrt(3) is the share of R alone.

use hdtrapeze_simd::{Float, Mask, Simd};

use super::packet::{LANES, Lanes, PACKET, Slabs, split};
use crate::bvh::Bounds8;
use crate::bvh::diagonal::{CHILDREN, Diagonals, PADS, Planes8, STEP, passed_by, reaching};
use crate::bvh::node::{Lattice8, Node};

/// A ray in the frame of a node.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct Laid {
    /// By axis, in each quarter: what origins at the start of the shutter are multiplied by; the last is 0.
    to_start: Lanes,
    /// The same at its end.
    to_end: Lanes,
    /// By axis, in each quarter: what is added.
    base: Lanes,
    /// What steps are multiplied by at both ends: that of origins, one lane to the right; the first is 0.
    steps_to: [Lanes; 2],
    /// For diagonals: [`PADS`] of what padding has near and far planes apart by, as steps lie in a quarter.
    pads: Lanes,
    /// The order of planes, which are lower ones before upper ones: near ones before far ones.
    order: [[u8; 16]; 3],
    /// Axes along which it sees diagonals the other way; see [`passed_by`].
    turned: [u32; 3],
}

impl Laid {
    /// The same numbers everywhere.
    pub const fn filled(x: f32) -> Self {
        Self {
            to_start: [x; LANES],
            to_end: [x; LANES],
            base: [x; LANES],
            steps_to: [[x; LANES]; 2],
            pads: [x; LANES],
            order: [ORDERS[0]; 3],
            turned: [u32::MAX; 3],
        }
    }

    /// Lays out ray number `at` of `slabs`.
    #[inline(always)]
    pub fn set<S: Simd>(&mut self, simd: S, slabs: &Slabs, at: usize, moving: bool) {
        let (v, lane) = split(at);
        let mut start = [0.0; 4];
        let mut end = [0.0; 4];
        let mut base = [[0.0; 4]; 2];
        let mut pads = [0.0; 4];
        for a in 0..3 {
            let side = (slabs.negative[a] >> (at & (PACKET - 1)) & 1) as usize;
            self.order[a] = ORDERS[side];
            let first = slabs.negative[0] >> (at & (PACKET - 1)) & 1;
            self.turned[a] = (side as u32 ^ first as u32).wrapping_neg() & CHILDREN;
            let sign = (side as u32) << 31;
            let signed = |x: f32| f32::from_bits(x.to_bits() ^ sign);
            let to = slabs.to_start[a][v][lane];
            start[a] = signed(to);
            if moving {
                let to = slabs.to_end[a][v][lane];
                end[a] = signed(to);
            }
            let [near, far] = slabs.base[a][v][lane];
            (base[0][a], base[1][a]) = (near, far);
            pads[a] = (-far - near) * PADS;
        }
        self.to_start = mirrored(simd, start);
        self.steps_to[0] = mirrored(simd, right(start));
        if moving {
            self.to_end = mirrored(simd, end);
            self.steps_to[1] = mirrored(simd, right(end));
        }
        let [near, _] = simd.of_halves(simd.quarters(&base[0]));
        let [far, _] = simd.of_halves(simd.quarters(&base[1]));
        self.base = simd.halves(near, far).to_array();
        self.pads = simd.quarters(&right(pads)).to_array();
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
        // By axis, what all planes have in them, and what their numbers are multiplied by, one lane to the right.
        let [origins, steps] = quarters(simd, start);
        let mut own = origins.mul_add(simd.from16(&self.to_start), simd.from16(&self.base));
        let scale = steps * simd.from16(&self.steps_to[0]);
        let mut end_scale = scale;
        if B::MOVING {
            let [origins, steps] = quarters(simd, end);
            own = origins.mul_add(simd.from16(&self.to_end), own);
            end_scale = steps * simd.from16(&self.steps_to[1]);
        }
        let own = over_axes(simd, own, false);
        let scale = over_axes(simd, scale, true);
        let end_scale = over_axes(simd, end_scale, true);
        let mut planes = own;
        for a in 0..3 {
            planes[a] = self
                .numbers(simd, &start.planes[a], a)
                .mul_add(scale[a], own[a]);
            if B::MOVING {
                tested.at_start[a] = planes[a].to_array();
                let numbers = self.numbers(simd, &end.planes[a], a);
                planes[a] = numbers.mul_add(end_scale[a], planes[a]);
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
        let radius = diagonals.radius;
        let pads = simd.from16(&self.pads);
        let mut reach = add_reach(simd, (start, radius), &self.steps_to[0], pads);
        if B::MOVING {
            reach = add_reach(simd, (end, radius), &self.steps_to[1], reach);
        }
        let [x, y, z] = over_axes(simd, reach, true);
        let reach = [
            simd.of_halves(x)[0],
            simd.of_halves(y)[0],
            simd.of_halves(z)[0],
        ];
        let passed = passed_by::<S, B>(simd, &diagonals, self.turned, reach, planes);
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

/// In each quarter, the origins of a grid by axis; and its steps, one lane to the right. What is besides is of the other, so that
/// each is one piece of memory.
#[inline(always)]
fn quarters<S: Simd>(simd: S, grid: &Lattice8) -> [S::F16; 2] {
    let [origins @ .., _, _] = &grid.grid;
    let [_, _, steps @ ..] = &grid.grid;
    [simd.quarters(origins), simd.quarters(steps)]
}

/// One lane to the right.
#[inline(always)]
fn right([x, y, z, none]: [f32; 4]) -> [f32; 4] {
    [none, x, y, z]
}

/// In each quarter, for near planes and, mirrored, for far ones.
#[inline(always)]
fn mirrored<S: Simd>(simd: S, x: [f32; 4]) -> Lanes {
    let [near, far] = simd.of_halves(simd.quarters(&x));
    simd.halves(near, -far).to_array()
}

/// What ray and diagonals may be apart by, as [`reaching`] has it, as steps lie in a quarter: `to` is what these are multiplied by.
#[inline(always)]
fn add_reach<S: Simd>(
    simd: S,
    (grid, radius): (&Lattice8, f32),
    to: &Lanes,
    others: S::F16,
) -> S::F16 {
    let [_, steps] = quarters(simd, grid);
    let parts = (steps, simd.all16(STEP), simd.all16(radius));
    reaching(parts, simd.from16(to).abs(), others)
}

/// Numbers of axes, which begin with the first lane of each quarter, or with the second, each all over its quarters.
#[inline(always)]
fn over_axes<S: Simd>(simd: S, x: S::F16, to_the_right: bool) -> [S::F16; 3] {
    let middle = [simd.over_quarters::<1>(x), simd.over_quarters::<2>(x)];
    if to_the_right {
        [middle[0], middle[1], simd.over_quarters::<3>(x)]
    } else {
        [simd.over_quarters::<0>(x), middle[0], middle[1]]
    }
}

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

    /// True where more than one child that is a node may be hit.
    #[inline(always)]
    pub fn enters_several(&self) -> bool {
        self.inner & self.inner.wrapping_sub(1) != 0
    }
}

/// The order of planes for rays that go upward, and downward.
static ORDERS: [[u8; 16]; 2] = [
    [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15],
    [8, 9, 10, 11, 12, 13, 14, 15, 0, 1, 2, 3, 4, 5, 6, 7],
];
