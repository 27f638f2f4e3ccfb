//! 8-wide nodes with bounds of 8 bits, in structure-of-arrays form.
//!
//! Nodes are generic over [`Bounds8`]: [`StaticSlabs`] where nothing moves, [`LinearSlabs`] where
//! bounds are linear in time. Bytes on a grid of the node's own are after Ylitie, Karras, Laine, "Efficient
//! Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs", HPG 2017.
//!
//! **The grid of a node.** A plane of a child is `origin + step q`, q from 0 to 255, for each axis and,
//! where things move, for each end of the shutter. Packing rounds outward: with real numbers, not f32,
//! a packed lower plane is not above the plane it stands for, and an upper one not below. Between the
//! ends both are linear in time, so what holds at the ends holds between.
//!
//! **A slab test** multiplies out `(plane(time) - o) / d`: what depends on the ray and the node, but not
//! on the child, is computed once, and a plane costs one product and one sum an end.

use glam::DVec3;
use hdtrapeze_simd::{Float, Kernel, Level, Mask, Part, Simd};

use super::diagonal::{AtEnd, CHILDREN, Diagonals, PADS, Planes8, STEP, passed_by, reaching};
use super::lanes::{Boxes8, Ranges8};
use super::linear::round_up;
use super::sorted::{Hull, LinearHull, StaticHull};
use super::turn::{StoredTurn, Turning};
use super::{Frame, LinearBox};

/// Bytes of 8 children: `[axis][0 lower, 1 upper][child]`.
type Bytes = [[[u8; 8]; 2]; 3];

/// Bounds of 8 children.
pub trait Bounds8: Clone + Copy + Send + Sync + std::fmt::Debug + 'static {
    /// True when the bounds change with time.
    const MOVING: bool;
    /// True when vertices move: with the bounds, or in a space that moves along with them.
    const KEYS: bool = Self::MOVING;
    /// The boxes that a tree of this kind is built by.
    type Hull: Hull;
    /// What its blocks are turned by.
    type Turning: Turning;
    /// Where diagonals of children go at the end of the shutter.
    type AtEnd: AtEnd;
    /// Packs the boxes of children, outward. Boxes in lanes without a child must be among those of the others.
    fn pack<S: Simd>(simd: S, boxes: &Boxes8<S::F8>) -> Self;
    /// The box of one child, as stored.
    fn unpack(&self, slot: usize) -> StoredBox;
    /// What slab tests need at the start of the shutter.
    fn start(&self) -> &Lattice8;
    /// The same at its end; [`Bounds8::start`] where nothing moves.
    fn end(&self) -> &Lattice8;
    /// Largest magnitude of a stored plane, but for a rounding of f64.
    #[inline(always)]
    fn reach(&self) -> f64 {
        let start = self.start().reach();
        if Self::MOVING {
            start.max(self.end().reach())
        } else {
            start
        }
    }
}

/// At least the magnitude of any plane, by [`Bounds8::reach`].
pub fn magnitude(reach: f64) -> f32 {
    // Rounded up twice, once for f64's sum.
    if reach > 0.0 {
        round_up(reach).next_up()
    } else {
        0.0
    }
}

/// Packs 1 to 8 boxes, outward.
pub fn pack<B: Bounds8>(level: Level, boxes: &[LinearBox]) -> B {
    let mut hulls = [B::Hull::of(&boxes[0]); 8];
    for (to, own) in hulls.iter_mut().zip(boxes) {
        *to = B::Hull::of(own);
    }
    pack_hulls(level, hulls.each_ref())
}

/// The same for boxes as the build sorts them, where some may stand in several lanes.
pub fn pack_hulls<B: Bounds8>(level: Level, hulls: [&B::Hull; 8]) -> B {
    level.run(Pack(hulls))
}

struct Pack<'a, B: Bounds8>([&'a B::Hull; 8]);

impl<B: Bounds8> Kernel for Pack<'_, B> {
    type Output = B;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> B {
        B::pack(simd, &B::Hull::boxes(simd, self.0))
    }
}

/// Planes of 8 children at one instant.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Lattice8 {
    /// The plane with number 0, on each axis, then from plane to plane.
    pub grid: [f32; 6],
    /// Numbers of planes.
    pub planes: Bytes,
}

/// Bounds that do not move.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct StaticSlabs(Lattice8);

/// Bounds that do not move in a space that moves ([`super::carrier`]).
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct CarriedSlabs(StaticSlabs);

/// Bounds at both ends of the shutter, interpolated linearly.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct LinearSlabs {
    start: Lattice8,
    end: Lattice8,
}

/// A box as stored, in f64: exact but for f64's rounding.
#[derive(Clone, Copy, Debug)]
pub struct StoredBox {
    /// Lower and upper bounds at time 0.
    pub start: [DVec3; 2],
    /// Lower and upper bounds at time 1.
    pub end: [DVec3; 2],
}

impl StoredBox {
    /// Bounds at `time`.
    pub fn at(&self, time: f64) -> (DVec3, DVec3) {
        let mix = |i: usize| self.start[i] + (self.end[i] - self.start[i]) * time;
        (mix(0), mix(1))
    }
}

/// Planes of a lattice: 255 steps.
const STEPS: f64 = 255.0;

/// What numbers of planes are moved outward by before they are rounded outward. In f32, the quotient of an
/// offset by a step, at most 256, is off by at most 4 roundings of 2^-24 of it: 2^-14.
const NUMBER_PAD: f32 = 1.0 / (1 << 10) as f32;

impl Lattice8 {
    /// The plane with number 0, on each axis.
    #[inline(always)]
    pub fn origin(&self) -> [f32; 3] {
        let [x, y, z, ..] = self.grid;
        [x, y, z]
    }

    /// From plane to plane, on each axis.
    #[inline(always)]
    pub fn step(&self) -> [f32; 3] {
        let [.., x, y, z] = self.grid;
        [x, y, z]
    }

    #[inline(always)]
    fn pack<S: Simd>(simd: S, boxes: &Ranges8<S::F8>) -> Self {
        let mut out = Self {
            grid: [0.0; 6],
            planes: Bytes::default(),
        };
        let (first, last) = boxes.hull();
        for axis in 0..3 {
            let extent = f64::from(last[axis]) - f64::from(first[axis]);
            // Rounded up twice, once for f64's quotient: the last plane is not below the largest bound.
            let step = if extent > 0.0 {
                round_up(extent / STEPS).next_up()
            } else {
                0.0
            };
            (out.grid[axis], out.grid[3 + axis]) = (first[axis], step);
            let inverse = 1.0 / step;
            if !inverse.is_finite() {
                // A flat axis, or nearly: all planes will do.
                out.planes[axis][1] = [255; 8];
                continue;
            }
            let (origin, inverse) = (simd.all8(first[axis]), simd.all8(inverse));
            let pad = simd.all8(NUMBER_PAD);
            // Saturated: at the first plane, which is the least bound, and at the last.
            out.planes[axis] = simd.outward8(
                (boxes.lo[axis] - origin) * inverse - pad,
                (boxes.hi[axis] - origin) * inverse + pad,
            );
        }
        out
    }

    fn unpack(&self, slot: usize) -> [DVec3; 2] {
        [0, 1].map(|side: usize| {
            DVec3::from_array([0, 1, 2].map(|axis: usize| {
                let q = f64::from(self.planes[axis][side][slot]);
                f64::from(self.origin()[axis]) + f64::from(self.step()[axis]) * q
            }))
        })
    }

    #[inline(always)]
    fn reach(&self) -> f64 {
        let mut most: f64 = 0.0;
        for axis in 0..3 {
            let (origin, step) = (f64::from(self.origin()[axis]), f64::from(self.step()[axis]));
            most = most.max(origin.abs()).max((origin + STEPS * step).abs());
        }
        most
    }
}

impl Bounds8 for StaticSlabs {
    const MOVING: bool = false;
    type Hull = StaticHull;
    type Turning = Frame;
    type AtEnd = ();
    #[inline(always)]
    fn pack<S: Simd>(simd: S, boxes: &Boxes8<S::F8>) -> Self {
        // A box that moves is contained by the union of its two ends.
        let (a, b) = (&boxes.start, &boxes.end);
        let hulls = Ranges8 {
            lo: [
                a.lo[0].min(b.lo[0]),
                a.lo[1].min(b.lo[1]),
                a.lo[2].min(b.lo[2]),
            ],
            hi: [
                a.hi[0].max(b.hi[0]),
                a.hi[1].max(b.hi[1]),
                a.hi[2].max(b.hi[2]),
            ],
        };
        Self(Lattice8::pack(simd, &hulls))
    }
    fn unpack(&self, slot: usize) -> StoredBox {
        let planes = self.0.unpack(slot);
        StoredBox {
            start: planes,
            end: planes,
        }
    }
    #[inline(always)]
    fn start(&self) -> &Lattice8 {
        &self.0
    }
    #[inline(always)]
    fn end(&self) -> &Lattice8 {
        &self.0
    }
}

impl Bounds8 for CarriedSlabs {
    const MOVING: bool = false;
    const KEYS: bool = true;
    type Hull = StaticHull;
    type Turning = Frame;
    type AtEnd = ();
    #[inline(always)]
    fn pack<S: Simd>(simd: S, boxes: &Boxes8<S::F8>) -> Self {
        Self(StaticSlabs::pack(simd, boxes))
    }
    fn unpack(&self, slot: usize) -> StoredBox {
        self.0.unpack(slot)
    }
    #[inline(always)]
    fn start(&self) -> &Lattice8 {
        self.0.start()
    }
    #[inline(always)]
    fn end(&self) -> &Lattice8 {
        self.0.end()
    }
}

impl Bounds8 for LinearSlabs {
    const MOVING: bool = true;
    type Hull = LinearHull;
    type Turning = StoredTurn;
    type AtEnd = u32;
    #[inline(always)]
    fn pack<S: Simd>(simd: S, boxes: &Boxes8<S::F8>) -> Self {
        Self {
            start: Lattice8::pack(simd, &boxes.start),
            end: Lattice8::pack(simd, &boxes.end),
        }
    }
    fn unpack(&self, slot: usize) -> StoredBox {
        StoredBox {
            start: self.start.unpack(slot),
            end: self.end.unpack(slot),
        }
    }
    #[inline(always)]
    fn start(&self) -> &Lattice8 {
        &self.start
    }
    #[inline(always)]
    fn end(&self) -> &Lattice8 {
        &self.end
    }
}

/// An inner node: bounds of up to 8 children, and where they are.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Node<B: Bounds8> {
    /// Bounds of the children, in the node's frame.
    pub bounds: B,
    /// Where the children are; see [`super::build::Tree`].
    pub children: [u32; 8],
    /// Number of the node's frame in the tree; 0 is the identity.
    pub frame: u32,
    /// Bit `i` is set when slot `i` has a child; above [`CHILDREN`] are their [`Diagonals`].
    pub slots: u32,
    /// Where these go at the end of the shutter.
    pub at_end: B::AtEnd,
}

impl<B: Bounds8> Node<B> {
    /// Bit `i` is set when slot `i` has a child.
    #[inline(always)]
    pub fn valid(&self) -> u32 {
        self.slots & CHILDREN
    }

    /// The diagonals of those children that are items, if they have some.
    #[inline(always)]
    pub fn diagonals(&self) -> Option<Diagonals> {
        let (start, end) = (self.bounds.start(), self.bounds.end());
        (self.slots > CHILDREN).then(|| Diagonals::of(self.slots, self.at_end, start, end))
    }
}

/// A ray in the frame of a node, prepared for slab tests. Lower planes are moved down and upper planes up
/// by a pad, which is derived in [`crate::trace::object_ray`].
#[derive(Clone, Copy, Debug)]
pub struct SlabRay {
    /// `(1 - time) / direction`, on each axis, finite.
    pub to_start: [f32; 3],
    /// `time / direction`; not used where nothing moves.
    pub to_end: [f32; 3],
    /// `-(origin + pad) / direction` and `-(origin - pad) / direction`: for lower and for upper planes.
    pub base: [[f32; 3]; 2],
    /// Side of the near plane on each axis: 0 (lower) where the direction is positive, else 1.
    pub near_side: [usize; 3],
}

/// Children that a ray may hit: a bit mask, and where it enters each of them (meaningless for the
/// others).
pub type Entered = (u32, [f32; 8]);

/// Tests 8 children between `t_min` and `t_max`, both inclusive.
#[inline(always)]
pub fn enter<S: Simd, B: Bounds8>(
    simd: S,
    bounds: &B,
    valid: u32,
    ray: &SlabRay,
    t_min: f32,
    t_max: f32,
) -> Entered {
    let (mask, near) = Slabs8::new(simd, bounds, ray).between(simd, t_min, t_max);
    (mask & valid, near.to_array())
}

/// Tests the children of a node; those that are items by their diagonals, too, if they have some.
#[inline(always)]
pub fn enter_node<S: Simd, B: Bounds8>(
    simd: S,
    node: &Node<B>,
    ray: &SlabRay,
    t_min: f32,
    t_max: f32,
) -> Entered {
    let slabs = Slabs8::new(simd, &node.bounds, ray);
    let (mask, near) = slabs.between(simd, t_min, t_max);
    let mut mask = mask & node.valid();
    if let Some(diagonals) = node.diagonals() {
        let items = mask & simd.high_bits(&node.children);
        if items != 0 {
            let passed = simd.apart(PassedBy {
                slabs: &slabs,
                bounds: &node.bounds,
                diagonals: &diagonals,
                ray,
            });
            mask &= !(items & passed);
        }
    }
    (mask, near.to_array())
}

/// Apart, so that nodes without diagonals are tested as if there were none.
struct PassedBy<'a, F, B> {
    slabs: &'a Slabs8<F>,
    bounds: &'a B,
    diagonals: &'a Diagonals,
    ray: &'a SlabRay,
}

impl<S: Simd, B: Bounds8> Part<S> for PassedBy<'_, S::F8, B> {
    type Output = u32;
    #[inline(always)]
    fn run(self, simd: S) -> u32 {
        let Self {
            slabs,
            bounds,
            diagonals,
            ray,
        } = self;
        let planes = (&slabs.planes, &slabs.start);
        let (turned, reach) = ray.sight(simd, bounds, diagonals);
        passed_by::<S, B>(simd, diagonals, turned, reach, planes)
    }
}

impl SlabRay {
    /// The ray as [diagonals](passed_by) ask for it: axes along which it sees them the other way, and what they may be apart by.
    #[inline(always)]
    fn sight<S: Simd, B: Bounds8>(
        &self,
        simd: S,
        bounds: &B,
        diagonals: &Diagonals,
    ) -> ([u32; 3], [S::F8; 3]) {
        let (mut turned, mut reach) = ([0; 3], [simd.all8(0.0); 3]);
        for axis in 0..3 {
            if self.near_side[axis] != self.near_side[0] {
                turned[axis] = CHILDREN;
            }
            let side = self.near_side[axis] & 1;
            let pads = (self.base[side ^ 1][axis] - self.base[side][axis]) * PADS;
            reach[axis] = simd.all8(pads);
            let (most, radius) = (simd.all8(STEP), simd.all8(diagonals.radius));
            let step = simd.all8(bounds.start().step()[axis]);
            let to = simd.all8(self.to_start[axis].abs());
            reach[axis] = reaching((step, most, radius), to, reach[axis]);
            if B::MOVING {
                let step = simd.all8(bounds.end().step()[axis]);
                let to = simd.all8(self.to_end[axis].abs());
                reach[axis] = reaching((step, most, radius), to, reach[axis]);
            }
        }
        (turned, reach)
    }
}

/// Where a ray meets the near and the far planes of 8 children, by axis.
struct Slabs8<F> {
    /// The planes.
    planes: Planes8<F>,
    /// What the start of the shutter has in them: all, where nothing moves.
    start: Planes8<F>,
}

impl<F: Float<8>> Slabs8<F> {
    #[inline(always)]
    fn new<S: Simd<F8 = F>, B: Bounds8>(simd: S, bounds: &B, ray: &SlabRay) -> Self {
        let (start, end) = (bounds.start(), bounds.end());
        let mut slabs = Self {
            planes: [[simd.all8(0.0); 2]; 3],
            start: [[simd.all8(0.0); 2]; 3],
        };
        for axis in 0..3 {
            let near = ray.near_side[axis] & 1;
            let scale = start.step()[axis] * ray.to_start[axis];
            let mut base = start.origin()[axis] * ray.to_start[axis];
            let end_scale = end.step()[axis] * ray.to_end[axis];
            if B::MOVING {
                base += end.origin()[axis] * ray.to_end[axis];
            }
            for (i, side) in [near, near ^ 1].into_iter().enumerate() {
                let q = simd.bytes8(&start.planes[axis][side]);
                let base = simd.all8(base + ray.base[side][axis]);
                let mut plane = q.mul_add(simd.all8(scale), base);
                slabs.start[axis][i] = plane;
                if B::MOVING {
                    let q = simd.bytes8(&end.planes[axis][side]);
                    plane = q.mul_add(simd.all8(end_scale), plane);
                }
                slabs.planes[axis][i] = plane;
            }
        }
        slabs
    }

    /// Children whose slabs a ray is in at once, between `t_min` and `t_max`, and where it enters them.
    #[inline(always)]
    fn between<S: Simd<F8 = F>>(&self, simd: S, t_min: f32, t_max: f32) -> (u32, F) {
        let mut near = simd.all8(t_min);
        let mut far = simd.all8(t_max);
        for axis in &self.planes {
            near = axis[0].max(near);
            far = axis[1].min(far);
        }
        (near.le(far).bits(), near)
    }
}
