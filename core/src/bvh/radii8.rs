//! Radii of 8 groups at once: how near the vertices of each are to the diagonal of its box ([`super::diagonal`]).
//!
//! Vertices are in vectors as in [`super::group8`]: rows of 4 of each of 4 groups, and those that begin one later.

use glam::Vec3;
use hdtrapeze_simd::{Float, Simd};

use super::Frame;
use super::group8::{Groups, ROWS, Vertices, row_at};
use super::lanes::{Boxes8, Ranges8};

/// How far vertices of groups are from diagonals of their boxes, at most, on any axis and at any key. `down` has, for both ends of
/// the shutter and each axis, the groups whose diagonals go down along it. A frame is one that does not turn.
#[inline(always)]
pub fn radii<S: Simd>(
    simd: S,
    vertices: Vertices<'_>,
    groups: &Groups,
    boxes: &Boxes8<S::F8>,
    down: [[u32; 3]; 2],
    frame: Option<&Frame>,
) -> S::F8 {
    let start = Lines::of(simd, &boxes.start, down[0]).in_fours(simd);
    let end = Lines::of(simd, &boxes.end, down[1]).in_fours(simd);
    let a = radii_of_4(simd, vertices, groups, 0, [&start[0], &end[0]], frame);
    let b = if groups.more_than_4 {
        radii_of_4(simd, vertices, groups, 1, [&start[1], &end[1]], frame)
    } else {
        a
    };
    simd.most_of_fours(a, b)
}

/// Lines from corner to corner of boxes, a lane each.
#[derive(Clone, Copy)]
pub(super) struct Lines<F> {
    from: [F; 3],
    along: [F; 3],
}

impl<F: Float<8>> Lines<F> {
    /// The diagonals of 8 boxes; `down` has, for each axis, those that go down along it.
    #[inline(always)]
    pub(super) fn of<S: Simd<F8 = F>>(simd: S, ranges: &Ranges8<F>, down: [u32; 3]) -> Self {
        let mut lines = Self {
            from: ranges.lo,
            along: ranges.hi,
        };
        for axis in 0..3 {
            let (lo, hi) = (ranges.lo[axis], ranges.hi[axis]);
            let down = simd.mask8(down[axis]);
            lines.from[axis] = hi.or(down, lo);
            lines.along[axis] = (lo - hi).or(down, hi - lo);
        }
        lines
    }

    /// Those of the first 4 boxes, and of the other 4, each in 4 lanes.
    #[inline(always)]
    fn in_fours<S: Simd<F8 = F>>(self, simd: S) -> [Lines<S::F16>; 2] {
        let zero = [simd.all16(0.0); 3];
        let mut fours = [Lines {
            from: zero,
            along: zero,
        }; 2];
        for axis in 0..3 {
            let from = simd.in_pairs(self.from[axis], self.from[axis]);
            [fours[0].from[axis], fours[1].from[axis]] = simd.zip(from, from);
            let along = simd.in_pairs(self.along[axis], self.along[axis]);
            [fours[0].along[axis], fours[1].along[axis]] = simd.zip(along, along);
        }
        fours
    }
}

/// Vertices of 4 groups.
struct InGroups<'a, S> {
    simd: S,
    vertices: Vertices<'a>,
    groups: &'a Groups,
    half: usize,
    frame: Option<&'a Frame>,
}

impl<S: Simd> Points<S::F16> for InGroups<'_, S> {
    const ROWS: usize = ROWS;
    #[inline(always)]
    fn row(&self, row: usize, key: usize) -> [[S::F16; 3]; 2] {
        let rows = &self.groups.rows[row];
        let row = row_at(self.simd, self.vertices, self.groups, rows, self.half, key);
        [
            in_frame(self.simd, row, 0, self.frame),
            in_frame(self.simd, row, 1, self.frame),
        ]
    }
    #[inline(always)]
    fn all(&self, x: f32) -> S::F16 {
        self.simd.all16(x)
    }
}

#[inline(always)]
fn radii_of_4<S: Simd>(
    simd: S,
    vertices: Vertices<'_>,
    groups: &Groups,
    half: usize,
    lines: [&Lines<S::F16>; 2],
    frame: Option<&Frame>,
) -> S::F16 {
    let vertices_of = InGroups {
        simd,
        vertices,
        groups,
        half,
        frame,
    };
    let most = radius(lines, vertices.key_times(), &vertices_of);
    // Where columns of micropolygons begin, and one later: those beyond the last are of no group.
    most.or(simd.mask16(groups.lanes[half]), simd.all16(0.0))
}

/// Rows of two points, a lane each.
pub(super) trait Points<F> {
    /// How many.
    const ROWS: usize;
    /// A row at a key. Give it `#[inline(always)]`.
    fn row(&self, row: usize, key: usize) -> [[F; 3]; 2];
    /// Copies.
    fn all(&self, x: f32) -> F;
}

/// How far points are from [`Lines`] at both ends of the shutter, at most, on any axis and at any key.
#[inline(always)]
pub(super) fn radius<F: Float<N>, P: Points<F>, const N: usize>(
    [start, end]: [&Lines<F>; 2],
    key_times: &[f32],
    points: &P,
) -> F {
    let (zero, one) = (points.all(0.0), points.all(1.0));
    let last = key_times.len() - 1;
    // Where along the diagonal a vertex is in mid-shutter: anywhere would do.
    let (middle, way) = match last {
        0 => (start.from, start.along),
        _ => (plus3(start.from, end.from), plus3(start.along, end.along)),
    };
    let scale = one.over(dot3(way, way));
    let mut most = zero;
    for row in 0..P::ROWS {
        let at_start = points.row(row, 0);
        let at_end = match last {
            0 => at_start,
            _ => points.row(row, last),
        };
        for side in 0..2 {
            let p0 = at_start[side];
            if last == 0 {
                let s = dot3(less3(p0, middle), way) * scale;
                let s = s.max(zero).min(one);
                most = most.max(apart(p0, start.from, start.along, s));
                continue;
            }
            let p1 = at_end[side];
            let s = dot3(less3(plus3(p0, p1), middle), way) * scale;
            let s = s.max(zero).min(one);
            most = most.max(apart(p0, start.from, start.along, s));
            most = most.max(apart(p1, end.from, end.along, s));
            for (k, &time) in key_times.iter().enumerate().take(last).skip(1) {
                let p = points.row(row, k)[side];
                let time = points.all(time);
                let from = plus3(start.from, times3(less3(end.from, start.from), time));
                let along = plus3(start.along, times3(less3(end.along, start.along), time));
                most = most.max(apart(p, from, along, s));
            }
        }
    }
    most
}

/// The largest difference along an axis between a point and one of a segment.
#[inline(always)]
fn apart<F: Float<N>, const N: usize>(p: [F; 3], from: [F; 3], along: [F; 3], s: F) -> F {
    let [x, y, z] = less3(p, plus3(from, times3(along, s)));
    x.abs().max(y.abs()).max(z.abs())
}

#[inline(always)]
fn in_frame<S: Simd>(
    simd: S,
    [x, y, z]: [[S::F16; 2]; 3],
    side: usize,
    frame: Option<&Frame>,
) -> [S::F16; 3] {
    let p = [x[side], y[side], z[side]];
    let Some(frame) = frame else {
        return p;
    };
    let along = |axis: Vec3| dot3(p, axis.to_array().map(|a| simd.all16(a)));
    [
        along(frame.axes[0]),
        along(frame.axes[1]),
        along(frame.axes[2]),
    ]
}

#[inline(always)]
fn plus3<F: Float<N>, const N: usize>(a: [F; 3], b: [F; 3]) -> [F; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
fn less3<F: Float<N>, const N: usize>(a: [F; 3], b: [F; 3]) -> [F; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn times3<F: Float<N>, const N: usize>(a: [F; 3], by: F) -> [F; 3] {
    [a[0] * by, a[1] * by, a[2] * by]
}

#[inline(always)]
fn dot3<F: Float<N>, const N: usize>(a: [F; 3], b: [F; 3]) -> F {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
