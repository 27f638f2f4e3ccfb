//! 8-wide nodes in structure-of-arrays form, and the slab test of one ray against 8 children.
//!
//! Nodes are generic over [`Bounds8`]: [`StaticSlabs`] where nothing moves, [`LinearSlabs`] where
//! bounds are linear in time. All loops run over `[f32; 8]`, without branches, so that the compiler
//! makes vectors of them.
//!
//! A slab test is conservative: the bounds are widened by [`SlabRay`]'s pad, derived in
//! [`crate::trace::object_ray`].

use super::LinearBox;

/// Lower and upper planes of 8 children on 3 axes: `[axis][0 lower, 1 upper][child]`.
pub type Planes = [[[f32; 8]; 2]; 3];

/// Bounds of 8 children.
pub trait Bounds8: Clone + Copy + Send + Sync + std::fmt::Debug + 'static {
    /// True when the bounds change with time.
    const MOVING: bool;
    /// Packs the boxes of up to 8 children; the other slots hold finite numbers that are never used.
    fn pack(boxes: &[LinearBox]) -> Self;
    /// One plane of all children at `time`.
    fn plane(&self, axis: usize, side: usize, time: f32) -> [f32; 8];
    /// The box of one child, as stored.
    fn unpack(&self, slot: usize) -> LinearBox;
}

/// Bounds that do not move.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct StaticSlabs {
    planes: Planes,
}

/// Bounds at both ends of the shutter, interpolated linearly.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct LinearSlabs {
    start: Planes,
    end: Planes,
}

fn planes(boxes: &[LinearBox], ends: impl Fn(&LinearBox) -> [glam::Vec3; 2]) -> Planes {
    let mut planes = Planes::default();
    for (slot, b) in boxes.iter().enumerate() {
        for (side, corner) in ends(b).iter().enumerate() {
            for axis in 0..3 {
                planes[axis][side][slot] = corner[axis];
            }
        }
    }
    planes
}

fn corner(planes: &Planes, side: usize, slot: usize) -> glam::Vec3 {
    glam::Vec3::from_array([0, 1, 2].map(|axis: usize| planes[axis][side][slot]))
}

impl Bounds8 for StaticSlabs {
    const MOVING: bool = false;
    fn pack(boxes: &[LinearBox]) -> Self {
        // A box that moves is contained by the union of its two ends.
        Self {
            planes: planes(boxes, |b| [b.lo0.min(b.lo1), b.hi0.max(b.hi1)]),
        }
    }
    #[inline(always)]
    fn plane(&self, axis: usize, side: usize, _time: f32) -> [f32; 8] {
        self.planes[axis][side]
    }
    fn unpack(&self, slot: usize) -> LinearBox {
        let (lo, hi) = (corner(&self.planes, 0, slot), corner(&self.planes, 1, slot));
        LinearBox {
            lo0: lo,
            hi0: hi,
            lo1: lo,
            hi1: hi,
        }
    }
}

impl Bounds8 for LinearSlabs {
    const MOVING: bool = true;
    fn pack(boxes: &[LinearBox]) -> Self {
        Self {
            start: planes(boxes, |b| [b.lo0, b.hi0]),
            end: planes(boxes, |b| [b.lo1, b.hi1]),
        }
    }
    #[inline(always)]
    fn plane(&self, axis: usize, side: usize, time: f32) -> [f32; 8] {
        let (a, b) = (&self.start[axis][side], &self.end[axis][side]);
        let mut out = [0.0; 8];
        for i in 0..8 {
            out[i] = a[i] + (b[i] - a[i]) * time;
        }
        out
    }
    fn unpack(&self, slot: usize) -> LinearBox {
        LinearBox {
            lo0: corner(&self.start, 0, slot),
            hi0: corner(&self.start, 1, slot),
            lo1: corner(&self.end, 0, slot),
            hi1: corner(&self.end, 1, slot),
        }
    }
}

/// An inner node: bounds of up to 8 children, and where they are.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub struct Node<B> {
    /// Bounds of the children, in the node's frame.
    pub bounds: B,
    /// Where the children are; see [`super::build::Tree`].
    pub children: [u32; 8],
    /// Number of the node's frame in the tree; 0 is the identity.
    pub frame: u32,
    /// Bit `i` is set when slot `i` has a child.
    pub valid: u32,
}

/// A ray in the frame of a node, prepared for slab tests.
#[derive(Clone, Copy, Debug)]
pub struct SlabRay {
    /// Origin, moved by the pad so that near planes come nearer: `origin + pad` on axes where the
    /// direction is positive, else `origin - pad`.
    pub near_origin: [f32; 3],
    /// Origin moved the other way, for far planes.
    pub far_origin: [f32; 3],
    /// 1 / direction, finite.
    pub inv_dir: [f32; 3],
    /// Side of the near plane on each axis: 0 (lower) where the direction is positive, else 1.
    pub near_side: [usize; 3],
}

/// Children that a ray may hit: a bit mask, and where it enters each of them (meaningless for the
/// others).
pub type Entered = (u32, [f32; 8]);

/// Tests 8 children between `t_min` and `t_max`, both inclusive.
#[inline(always)]
pub fn enter<B: Bounds8>(
    bounds: &B,
    valid: u32,
    ray: &SlabRay,
    time: f32,
    t_min: f32,
    t_max: f32,
) -> Entered {
    let mut near = [t_min; 8];
    let mut far = [t_max; 8];
    for axis in 0..3 {
        let side = ray.near_side[axis] & 1;
        let n = bounds.plane(axis, side, time);
        let f = bounds.plane(axis, side ^ 1, time);
        let (no, fo, inv) = (
            ray.near_origin[axis],
            ray.far_origin[axis],
            ray.inv_dir[axis],
        );
        for i in 0..8 {
            let tn = (n[i] - no) * inv;
            let tf = (f[i] - fo) * inv;
            // Plain comparisons: one vector instruction each, and no rule for NaN needed.
            near[i] = if tn > near[i] { tn } else { near[i] };
            far[i] = if tf < far[i] { tf } else { far[i] };
        }
    }
    let mut mask = 0;
    for i in 0..8 {
        mask |= u32::from(near[i] <= far[i]) << i;
    }
    (mask & valid, near)
}
