//! Bounds of blocks: the central invariant is made here.
//!
//! Each group of a block is bounded at every key of its vertices, along the axes of space and along
//! those of a frame or two that its lattice suggests; the cheapest by surface area is kept. A group's
//! vertices are one vector.

use std::marker::PhantomData;

use glam::Vec3;
use hdtrapeze_simd::{Float, Kernel, Level, Mask, Simd};

use super::block::{Block, CellRect, GROUPS, Span, loose, loose_count};
use super::{Bounds8, COORDINATE_LIMIT, Frame, LinearBox, ROTATION_PAD, ROTATION_TINY};
use crate::grid::PlanarMesh;

/// Relative cost of turning a ray into a node's frame (9 products, 3 reciprocals), in units of
/// one group test. An estimate, not yet measured; only the choice of frames depends on it.
pub const TURN_COST: f32 = 0.3;

/// A block before its frame has a number.
pub struct BuiltBlock<B> {
    /// The block; its frame number is not set.
    pub block: Block<B>,
    /// Axis-aligned bounds of the block.
    pub aabb: LinearBox,
    /// Frame, if oriented bounds pay.
    pub frame: Option<Frame>,
    /// The magnitude of no bound of the block is larger, as packed or as it was.
    pub max_abs: f32,
}

/// Bounds the groups of a block in the frame that costs least. None where a vertex is not finite,
/// or beyond [`COORDINATE_LIMIT`].
pub fn bound<B: Bounds8>(level: Level, mesh: &PlanarMesh, span: Span) -> Option<BuiltBlock<B>> {
    level.run(Bound {
        mesh,
        span,
        kind: PhantomData,
    })
}

/// Axis-aligned bounds of the [loose groups](loose) of a grid. None where a vertex is not finite, or
/// beyond [`COORDINATE_LIMIT`].
pub fn bound_loose(level: Level, mesh: &PlanarMesh, number: u32) -> Option<LooseBoxes> {
    level.run(BoundLoose { mesh, number })
}

/// Bounds of as many groups as [`loose_count`] says.
pub type LooseBoxes = [LinearBox; GROUPS];

/// Bounds in a frame of up to [`GROUPS`] groups of grids whose vertices are finite and within
/// [`COORDINATE_LIMIT`]; each is a grid and its micropolygons.
pub fn bound_groups(
    level: Level,
    mesh: &PlanarMesh,
    groups: &[(u32, CellRect)],
    frame: &Frame,
) -> [LinearBox; GROUPS] {
    level.run(BoundGroups {
        mesh,
        groups,
        frame,
    })
}

struct Bound<'a, B> {
    mesh: &'a PlanarMesh,
    span: Span,
    kind: PhantomData<B>,
}

impl<B: Bounds8> Kernel for Bound<'_, B> {
    type Output = Option<BuiltBlock<B>>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Option<BuiltBlock<B>> {
        let Self { mesh, span, .. } = self;
        if !all_finite(simd, mesh, &span) {
            return None;
        }
        let boxes = group_boxes(simd, mesh, &span, None);
        let count = usize::from(span.count);
        let aabb = union(&boxes[..count]);
        // Bounds may have been raised.
        if !(aabb.is_finite() && aabb.max_abs() < COORDINATE_LIMIT) {
            return None;
        }
        let mut cost = area(&boxes[..count]);
        let turn = aabb.mean_half_area() * TURN_COST;
        let (mut best, mut frame) = (boxes, None);
        let (u, v) = lattice_edges(mesh, &span);
        // Boxes of any frame have at least the area of the surface: where that saves nothing, none is tried.
        if u.cross(v).length() + turn < cost {
            for candidate in [Frame::from_edges(u, v), Frame::from_edges(v, u)] {
                let Some(candidate) = candidate else { continue };
                let boxes = group_boxes(simd, mesh, &span, Some(&candidate));
                let oriented = area(&boxes[..count]) + turn;
                if oriented < cost {
                    (cost, best, frame) = (oriented, boxes, Some(candidate));
                }
            }
        }
        let bounds = B::pack(&best[..count]);
        Some(BuiltBlock {
            block: Block {
                bounds,
                frame: 0,
                span,
            },
            aabb,
            frame,
            max_abs: aabb.max_abs().max(bounds.max_abs()),
        })
    }
}

struct BoundGroups<'a> {
    mesh: &'a PlanarMesh,
    groups: &'a [(u32, CellRect)],
    frame: &'a Frame,
}

impl Kernel for BoundGroups<'_> {
    type Output = [LinearBox; GROUPS];

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> [LinearBox; GROUPS] {
        let mut out = [LinearBox::EMPTY; GROUPS];
        for (out, &(grid, rect)) in out.iter_mut().zip(self.groups) {
            let span = Span::group(grid, rect);
            *out = group_boxes(simd, self.mesh, &span, Some(self.frame))[0];
        }
        out
    }
}

struct BoundLoose<'a> {
    mesh: &'a PlanarMesh,
    number: u32,
}

impl Kernel for BoundLoose<'_> {
    type Output = Option<LooseBoxes>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Option<LooseBoxes> {
        let Self { mesh, number } = self;
        let grid = &mesh.grids[number as usize];
        let mut out = [LinearBox::EMPTY; GROUPS];
        for (slot, out) in out.iter_mut().enumerate().take(loose_count(grid)) {
            let span = Span::group(number, loose(grid, slot as u32));
            if !all_finite(simd, mesh, &span) {
                return None;
            }
            let bounds = group_boxes(simd, mesh, &span, None)[0];
            // Bounds may have been raised.
            if !(bounds.is_finite() && bounds.max_abs() < COORDINATE_LIMIT) {
                return None;
            }
            *out = bounds;
        }
        Some(out)
    }
}

#[inline(always)]
fn union(boxes: &[LinearBox]) -> LinearBox {
    boxes.iter().fold(LinearBox::EMPTY, |a, b| a.union(b))
}

#[inline(always)]
fn area(boxes: &[LinearBox]) -> f32 {
    boxes.iter().map(LinearBox::mean_half_area).sum()
}

/// The block's edges along u and v, each the mean of the two that face each other, in mid-shutter.
fn lattice_edges(mesh: &PlanarMesh, span: &Span) -> (Vec3, Vec3) {
    let g = span.grid as usize;
    let stride = usize::from(mesh.grids[g].nu) + 1;
    let [i, j, w, h] = [span.rect.i, span.rect.j, span.rect.w, span.rect.h].map(usize::from);
    let key = mesh.key_count() / 2;
    let at = |x: usize, y: usize| mesh.position(g, key, (j + y) * stride + i + x);
    let (a, b, c, d) = (at(0, 0), at(w, 0), at(0, h), at(w, h));
    (((b - a) + (d - c)) * 0.5, ((c - a) + (d - b)) * 0.5)
}

/// The vertices of a group: its vectors' lanes that count, and where it begins in a plane.
struct Vertices {
    lanes: u32,
    first: usize,
    stride: usize,
}

#[inline(always)]
fn vertices<S: Simd>(simd: S, mesh: &PlanarMesh, span: &Span, rect: CellRect) -> Vertices {
    let stride = usize::from(mesh.grids[span.grid as usize].nu) + 1;
    let mut lanes = 0;
    for row in 0..=usize::from(rect.h) {
        for column in 0..=usize::from(rect.w) {
            lanes |= 1 << simd.lane(column, row);
        }
    }
    Vertices {
        lanes,
        first: usize::from(rect.j) * stride + usize::from(rect.i),
        stride,
    }
}

/// Coordinates of a group's vertices at key `k`.
#[inline(always)]
fn coordinates<S: Simd>(
    simd: S,
    mesh: &PlanarMesh,
    span: &Span,
    group: &Vertices,
    k: usize,
) -> [S::F16; 3] {
    let grid = &mesh.grids[span.grid as usize];
    let (start, n) = (mesh.plane_start(grid, k) + group.first, grid.vertex_count());
    let planes = mesh.planes();
    [
        simd.lattice(planes, start, group.stride),
        simd.lattice(planes, start + n, group.stride),
        simd.lattice(planes, start + 2 * n, group.stride),
    ]
}

#[inline(always)]
fn all_finite<S: Simd>(simd: S, mesh: &PlanarMesh, span: &Span) -> bool {
    let limit = simd.all16(COORDINATE_LIMIT);
    let mut sound = true;
    for slot in 0..u32::from(span.count) {
        let group = vertices(simd, mesh, span, span.group_rect(slot));
        for k in 0..mesh.key_count() {
            for x in coordinates(simd, mesh, span, &group, k) {
                // Comparisons with NaN are false.
                sound &= !x.abs().lt(limit).bits() & group.lanes == 0;
            }
        }
    }
    sound
}

/// Bounds of each group of a block, in a frame or axis-aligned.
#[inline(always)]
fn group_boxes<S: Simd>(
    simd: S,
    mesh: &PlanarMesh,
    span: &Span,
    frame: Option<&Frame>,
) -> [LinearBox; GROUPS] {
    let mut boxes = [LinearBox::EMPTY; GROUPS];
    let last = mesh.key_count() - 1;
    for (slot, out) in boxes.iter_mut().enumerate().take(span.count.into()) {
        let group = vertices(simd, mesh, span, span.group_rect(slot as u32));
        let (lo0, hi0) = ranges(simd, mesh, span, &group, 0, frame);
        let (lo1, hi1) = if last > 0 {
            ranges(simd, mesh, span, &group, last, frame)
        } else {
            (lo0, hi0)
        };
        *out = LinearBox { lo0, hi0, lo1, hi1 };
        for k in 1..last {
            let (lo, hi) = ranges(simd, mesh, span, &group, k, frame);
            out.raise(mesh.key_times[k], lo, hi);
        }
    }
    boxes
}

/// Ranges of the coordinates of a group's vertices at key `k`, widened for the rounding of the rotation
/// where there is one.
#[inline(always)]
fn ranges<S: Simd>(
    simd: S,
    mesh: &PlanarMesh,
    span: &Span,
    group: &Vertices,
    k: usize,
    frame: Option<&Frame>,
) -> (Vec3, Vec3) {
    let [x, y, z] = coordinates(simd, mesh, span, group, k);
    let lanes = simd.mask16(group.lanes);
    let (above, below) = (simd.all16(f32::INFINITY), simd.all16(f32::NEG_INFINITY));
    let (mut lo, mut hi) = (Vec3::ZERO, Vec3::ZERO);
    for (axis, plain) in [x, y, z].into_iter().enumerate() {
        let (mut least, mut most) = (plain, plain);
        if let Some(frame) = frame {
            let a = frame.axes[axis];
            let q = x * simd.all16(a.x) + y * simd.all16(a.y) + z * simd.all16(a.z);
            let pad = (x.abs() + y.abs() + z.abs()) * simd.all16(ROTATION_PAD);
            (least, most) = (q - pad, q + pad);
        }
        lo[axis] = least.or(lanes, above).least();
        hi[axis] = most.or(lanes, below).most();
        if frame.is_some() {
            lo[axis] -= ROTATION_TINY;
            hi[axis] += ROTATION_TINY;
        }
    }
    (lo, hi)
}
