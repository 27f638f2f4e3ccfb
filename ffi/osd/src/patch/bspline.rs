//! Uniform bicubic B-spline patches: the limit surface of regular quads, and of the regular cells of
//! irregular ones.
//!
//! Control points are a 4 by 4 grid, row-major, `u` fastest; the patch lies over its middle cell. A
//! side without neighbours has phantom points on a straight line with the two inner rows, so that the
//! patch ends on the boundary curve.
//!
//! A lattice comes row by row. What depends on `v` alone is summed once a row: 4 points, and 4
//! derivatives; a sample then costs 4 products for its position. A sample on its own goes through
//! the same sums in the same order, so it has the same bits.

use glam::Vec4;

/// Control points of a patch.
pub(crate) const CONTROLS: usize = 16;

/// Sums of a row, per lane: 4 points and 4 derivatives along `v`.
pub(crate) const ROW: usize = 8;

const SIXTH: f32 = 1.0 / 6.0;

/// The four cubic B-splines that are not zero at `x` in [0, 1].
#[inline(always)]
pub(crate) fn basis(x: f32) -> Vec4 {
    const C0: Vec4 = Vec4::new(SIXTH, 4.0 * SIXTH, SIXTH, 0.0);
    const C1: Vec4 = Vec4::new(-0.5, 0.0, 0.5, 0.0);
    const C2: Vec4 = Vec4::new(0.5, -1.0, 0.5, 0.0);
    const C3: Vec4 = Vec4::new(-SIXTH, 0.5, -0.5, SIXTH);
    let x = Vec4::splat(x);
    C0 + x * (C1 + x * (C2 + x * C3))
}

/// Their derivatives.
#[inline(always)]
pub(crate) fn derivative(x: f32) -> Vec4 {
    const C0: Vec4 = Vec4::new(-0.5, 0.0, 0.5, 0.0);
    const C1: Vec4 = Vec4::new(1.0, -2.0, 1.0, 0.0);
    const C2: Vec4 = Vec4::new(-0.5, 1.5, -1.5, 0.5);
    let x = Vec4::splat(x);
    C0 + x * (C1 + x * C2)
}

/// `w.x a + w.y b + w.z c + w.w d`.
#[inline(always)]
pub(crate) fn combine(w: Vec4, a: Vec4, b: Vec4, c: Vec4, d: Vec4) -> Vec4 {
    (a * w.x + b * w.y) + (c * w.z + d * w.w)
}

/// Fills in the phantom points of the sides in `mask` (1: v = 0, 2: u = 1, 4: v = 1, 8: u = 0).
pub(crate) fn extrapolate(p: &mut [Vec4], mask: u8) {
    if mask == 0 {
        return;
    }
    for i in 0..4 {
        if mask & 8 != 0 {
            p[4 * i] = 2.0 * p[4 * i + 1] - p[4 * i + 2];
        }
        if mask & 2 != 0 {
            p[4 * i + 3] = 2.0 * p[4 * i + 2] - p[4 * i + 1];
        }
    }
    for i in 0..4 {
        if mask & 4 != 0 {
            p[12 + i] = 2.0 * p[8 + i] - p[4 + i];
        }
        if mask & 1 != 0 {
            p[i] = 2.0 * p[4 + i] - p[8 + i];
        }
    }
}

/// Bezier points of the same patch: their hull fits it closely.
pub(crate) fn bezier(p: &[Vec4; CONTROLS]) -> [Vec4; CONTROLS] {
    let line = |[a, b, c, d]: [Vec4; 4]| {
        [
            (a + b * 4.0 + c) * SIXTH,
            (b * 2.0 + c) * (2.0 * SIXTH),
            (b + c * 2.0) * (2.0 * SIXTH),
            (b + c * 4.0 + d) * SIXTH,
        ]
    };
    let rows: [[Vec4; 4]; 4] = std::array::from_fn(|j| line(std::array::from_fn(|i| p[4 * j + i])));
    let columns: [[Vec4; 4]; 4] =
        std::array::from_fn(|i| line(std::array::from_fn(|j| rows[j][i])));
    std::array::from_fn(|k| columns[k % 4][k / 4])
}

/// Sums the columns of one lane's control points at `v`.
#[inline(always)]
pub(crate) fn sum_columns(p: &[Vec4; CONTROLS], v: f32, derivatives: bool, row: &mut [Vec4; ROW]) {
    let b = basis(v);
    for i in 0..4 {
        row[i] = combine(b, p[i], p[4 + i], p[8 + i], p[12 + i]);
    }
    if derivatives {
        let d = derivative(v);
        for i in 0..4 {
            row[4 + i] = combine(d, p[i], p[4 + i], p[8 + i], p[12 + i]);
        }
    }
}

/// The weight of each control point at (u, v), in f64: what the library's weights are compared with.
pub(crate) fn weights(u: f64, v: f64, mask: u8) -> [f64; CONTROLS] {
    let basis = |x: f64| {
        let y = 1.0 - x;
        [
            y * y * y / 6.0,
            (4.0 - 6.0 * x * x + 3.0 * x * x * x) / 6.0,
            (4.0 - 6.0 * y * y + 3.0 * y * y * y) / 6.0,
            x * x * x / 6.0,
        ]
    };
    let fold = |mut w: [f64; 4], low: bool, high: bool| {
        if low {
            w[2] -= w[0];
            w[1] += 2.0 * w[0];
            w[0] = 0.0;
        }
        if high {
            w[1] -= w[3];
            w[2] += 2.0 * w[3];
            w[3] = 0.0;
        }
        w
    };
    let bu = fold(basis(u), mask & 8 != 0, mask & 2 != 0);
    let bv = fold(basis(v), mask & 1 != 0, mask & 4 != 0);
    std::array::from_fn(|i| bu[i % 4] * bv[i / 4])
}
