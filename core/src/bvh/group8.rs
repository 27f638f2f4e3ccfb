//! Bounds of 8 groups at once.
//!
//! A vector holds a row of 4 vertices of each of 4 groups, and another the 4 vertices that begin one later: with
//! the smaller of each pair, over the rows of a group, a lane stands for a column of its micropolygons.

use glam::Vec3;
use hdtrapeze_simd::{Float, Simd};

use super::block::{CellRect, GROUP, GROUPS};
use super::lanes::{Boxes8, Ranges8};
use super::{Frame, ROTATION_PAD, ROTATION_TINY};
use crate::grid::Grid;

/// Rows of vertices of a group, at most.
const ROWS: usize = GROUP.1 + 1;
const _: () = assert!(GROUP.0 == 4 && GROUPS == 8);

/// Where the vertices of up to 8 groups are.
#[derive(Clone, Copy, Debug, Default)]
pub struct Groups {
    /// Where their rows begin in the plane of the first key's x.
    rows: [[usize; GROUPS]; ROWS],
    /// Floats of each plane.
    plane: [usize; GROUPS],
    /// Lanes that are columns of micropolygons, of the first 4 groups and of the others.
    lanes: [u32; 2],
    more_than_4: bool,
}

impl Groups {
    /// Sets a group of a grid whose planes begin at `start`.
    #[inline(always)]
    pub fn put(&mut self, slot: usize, start: usize, grid: &Grid, rect: CellRect) {
        let stride = usize::from(grid.nu) + 1;
        let first = start + usize::from(rect.j) * stride + usize::from(rect.i);
        for (row, at) in self.rows.iter_mut().enumerate() {
            // A row again where there are fewer.
            at[slot % GROUPS] = first + row.min(rect.h.into()) * stride;
        }
        self.plane[slot % GROUPS] = grid.vertex_count();
        let columns = (1 << rect.w) - 1;
        self.lanes[slot / 4 % 2] |= columns << (slot % 4 * 4);
    }

    /// All 8 groups, the first again where there are fewer than that.
    #[inline(always)]
    pub fn filled(mut self, count: u8) -> Self {
        let first = self.lanes[0] & 0xf;
        for slot in count.into()..GROUPS {
            for row in &mut self.rows {
                row[slot] = row[0];
            }
            self.plane[slot] = self.plane[0];
            self.lanes[slot / 4] |= first << (slot % 4 * 4);
        }
        self.more_than_4 = count > 4;
        self
    }
}

/// Bounds over the shutter, in a frame or axis-aligned.
#[inline(always)]
pub fn boxes<S: Simd>(
    simd: S,
    planes: &[f32],
    key_times: &[f32],
    groups: &Groups,
    frame: Option<&Frame>,
) -> Boxes8<S::F8> {
    let last = key_times.len() - 1;
    let start = ranges(simd, planes, groups, 0, frame);
    if last == 0 {
        return Boxes8 { start, end: start };
    }
    let end = ranges(simd, planes, groups, last, frame);
    let found = Boxes8 { start, end };
    if last == 1 {
        return found;
    }
    let mut raised = found.to_boxes();
    for (k, &time) in key_times.iter().enumerate().take(last).skip(1) {
        let (lo, hi) = ranges(simd, planes, groups, k, frame).to_vectors();
        for (slot, b) in raised.iter_mut().enumerate() {
            b.raise(time, lo[slot], hi[slot]);
        }
    }
    Boxes8::of(simd, &raised)
}

/// Ranges of coordinates at key `k`, widened for the rounding of the rotation where there is one.
#[inline(always)]
fn ranges<S: Simd>(
    simd: S,
    planes: &[f32],
    groups: &Groups,
    k: usize,
    frame: Option<&Frame>,
) -> Ranges8<S::F8> {
    let near = ranges_of_4(simd, planes, groups, 0, k, frame);
    let far = if groups.more_than_4 {
        ranges_of_4(simd, planes, groups, 1, k, frame)
    } else {
        near
    };
    let (a, b) = (near, far);
    let mut found = Ranges8 {
        lo: [
            simd.least_of_fours(a.0[0], b.0[0]),
            simd.least_of_fours(a.0[1], b.0[1]),
            simd.least_of_fours(a.0[2], b.0[2]),
        ],
        hi: [
            simd.most_of_fours(a.1[0], b.1[0]),
            simd.most_of_fours(a.1[1], b.1[1]),
            simd.most_of_fours(a.1[2], b.1[2]),
        ],
    };
    if frame.is_some() {
        let tiny = simd.all8(ROTATION_TINY);
        for axis in 0..3 {
            found.lo[axis] = found.lo[axis] - tiny;
            found.hi[axis] = found.hi[axis] + tiny;
        }
    }
    found
}

/// Lower and upper bounds on each axis, of columns of micropolygons.
type Columns<F> = ([F; 3], [F; 3]);

/// Bounds of the columns of the first 4 groups, or of the last.
#[inline(always)]
fn ranges_of_4<S: Simd>(
    simd: S,
    planes: &[f32],
    groups: &Groups,
    half: usize,
    k: usize,
    frame: Option<&Frame>,
) -> Columns<S::F16> {
    let (above, below) = (simd.all16(f32::INFINITY), simd.all16(f32::NEG_INFINITY));
    let (mut lo, mut hi) = ([above; 3], [below; 3]);
    for row in &groups.rows {
        let (mut at, mut step) = ([0; 4], [0; 4]);
        for i in 0..4 {
            step[i] = groups.plane[4 * half + i];
            at[i] = row[4 * half + i] + 3 * k * step[i];
        }
        let x = simd.rows(planes, at);
        let y = simd.rows(planes, plus(at, step));
        let z = simd.rows(planes, plus(plus(at, step), step));
        for i in 0..2 {
            let p = [x[i], y[i], z[i]];
            let Some(frame) = frame else {
                for axis in 0..3 {
                    lo[axis] = p[axis].min(lo[axis]);
                    hi[axis] = p[axis].max(hi[axis]);
                }
                continue;
            };
            let [x, y, z] = p;
            let pad = (x.abs() + y.abs() + z.abs()) * simd.all16(ROTATION_PAD);
            for axis in 0..3 {
                let a: Vec3 = frame.axes[axis];
                let q = x * simd.all16(a.x) + y * simd.all16(a.y) + z * simd.all16(a.z);
                lo[axis] = (q - pad).min(lo[axis]);
                hi[axis] = (q + pad).max(hi[axis]);
            }
        }
    }
    let lanes = simd.mask16(groups.lanes[half]);
    for axis in 0..3 {
        lo[axis] = lo[axis].or(lanes, above);
        hi[axis] = hi[axis].or(lanes, below);
    }
    (lo, hi)
}

#[inline(always)]
fn plus(a: [usize; 4], b: [usize; 4]) -> [usize; 4] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]]
}
