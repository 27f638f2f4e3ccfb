//! Radii of 8 groups at once: how near the vertices of each are to the diagonal of its box ([`super::diagonal`]).
//!
//! Vertices are in vectors as in [`super::group8`]: rows of 4 of each of 4 groups, and those that begin one later.

use glam::Vec3;
use hdtrapeze_simd::{Float, Simd};

use super::Frame;
use super::group8::{Groups, Vertices, row_at};
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
    let last = if vertices.moving {
        vertices.key_times.len() - 1
    } else {
        0
    };
    let segments = [
        Segments::of(simd, &boxes.start, down[0]),
        Segments::of(simd, &boxes.end, down[1]),
    ];
    let a = radii_of_4(simd, vertices, groups, 0, (&segments, last), frame);
    let b = if groups.more_than_4 {
        radii_of_4(simd, vertices, groups, 1, (&segments, last), frame)
    } else {
        a
    };
    simd.most_of_fours(a, b)
}

/// Diagonals of the first 4 boxes, and of the other 4, each in 4 lanes, by axis.
struct Segments<F> {
    from: [[F; 3]; 2],
    along: [[F; 3]; 2],
}

impl<F: Float<16>> Segments<F> {
    #[inline(always)]
    fn of<S: Simd<F16 = F>>(simd: S, ranges: &Ranges8<S::F8>, down: [u32; 3]) -> Self {
        let zero = simd.all16(0.0);
        let mut segments = Self {
            from: [[zero; 3]; 2],
            along: [[zero; 3]; 2],
        };
        for axis in 0..3 {
            let (lo, hi) = (ranges.lo[axis], ranges.hi[axis]);
            let down = simd.mask8(down[axis]);
            let from = hi.or(down, lo);
            let from = simd.in_pairs(from, from);
            [segments.from[0][axis], segments.from[1][axis]] = simd.zip(from, from);
            let along = (lo - hi).or(down, hi - lo);
            let along = simd.in_pairs(along, along);
            [segments.along[0][axis], segments.along[1][axis]] = simd.zip(along, along);
        }
        segments
    }
}

#[inline(always)]
fn radii_of_4<S: Simd>(
    simd: S,
    vertices: Vertices<'_>,
    groups: &Groups,
    half: usize,
    (segments, last): (&[Segments<S::F16>; 2], usize),
    frame: Option<&Frame>,
) -> S::F16 {
    let (zero, one) = (simd.all16(0.0), simd.all16(1.0));
    let (from0, along0) = (segments[0].from[half], segments[0].along[half]);
    let (from1, along1) = (segments[1].from[half], segments[1].along[half]);
    // Where along the diagonal a vertex is in mid-shutter: anywhere would do.
    let (middle, way) = match last {
        0 => (from0, along0),
        _ => (plus3(from0, from1), plus3(along0, along1)),
    };
    let scale = one.over(dot3(way, way));
    let mut most = zero;
    for rows in &groups.rows {
        let start = row_at(simd, vertices, groups, rows, half, 0);
        let end = match last {
            0 => start,
            _ => row_at(simd, vertices, groups, rows, half, last),
        };
        for side in 0..2 {
            let p0 = in_frame(simd, start, side, frame);
            if last == 0 {
                let s = dot3(less3(p0, middle), way) * scale;
                let s = s.max(zero).min(one);
                most = most.max(apart(p0, from0, along0, s));
                continue;
            }
            let p1 = in_frame(simd, end, side, frame);
            let s = dot3(less3(plus3(p0, p1), middle), way) * scale;
            let s = s.max(zero).min(one);
            most = most.max(apart(p0, from0, along0, s));
            most = most.max(apart(p1, from1, along1, s));
            for k in 1..last {
                let row = row_at(simd, vertices, groups, rows, half, k);
                let p = in_frame(simd, row, side, frame);
                let time = simd.all16(vertices.key_times[k]);
                let from = plus3(from0, times3(less3(from1, from0), time));
                let along = plus3(along0, times3(less3(along1, along0), time));
                most = most.max(apart(p, from, along, s));
            }
        }
    }
    // Where columns of micropolygons begin, and one later: those beyond the last are of no group.
    most.or(simd.mask16(groups.lanes[half]), zero)
}

/// The largest difference along an axis between a point and one of a segment.
#[inline(always)]
fn apart<F: Float<16>>(p: [F; 3], from: [F; 3], along: [F; 3], s: F) -> F {
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
fn plus3<F: Float<16>>(a: [F; 3], b: [F; 3]) -> [F; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
fn less3<F: Float<16>>(a: [F; 3], b: [F; 3]) -> [F; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn times3<F: Float<16>>(a: [F; 3], by: F) -> [F; 3] {
    [a[0] * by, a[1] * by, a[2] * by]
}

#[inline(always)]
fn dot3<F: Float<16>>(a: [F; 3], b: [F; 3]) -> F {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
