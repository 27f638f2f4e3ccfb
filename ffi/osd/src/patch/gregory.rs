//! Gregory patches: the library's approximation of the limit next to extraordinary vertices, after
//! Loop, Schaefer, Ni, Castano, "Approximating Subdivision Surfaces with Gregory Patches for Hardware
//! Tessellation", SIGGRAPH Asia 2009.
//!
//! Twenty points: for each corner, counter-clockwise, the corner, the edge point towards the next and
//! the previous corner, and the face point of the next and the previous edge. The two face points of a
//! corner are blended by (u, v) to one, and the patch is then a bicubic Bezier patch. Derivatives hold
//! the blend fixed, as the library's do: exact on the patch's sides, and close inside.

use glam::Vec4;

use super::bspline::combine;

/// Control points of a patch.
pub(crate) const CONTROLS: usize = 20;

/// Position of each Gregory point in the 4 by 4 Bezier grid (row-major, `u` fastest).
const GRID: [usize; CONTROLS] = [
    0, 1, 4, 5, 5, 3, 7, 2, 6, 6, 15, 14, 11, 10, 10, 12, 8, 13, 9, 9,
];

/// How much of each corner's blended face point is its first one (of the next edge).
#[inline(always)]
fn blends(u: f32, v: f32) -> Vec4 {
    let (ru, rv) = (1.0 - u, 1.0 - v);
    let part = |a: f32, b: f32| if a + b > 0.0 { a / (a + b) } else { 0.5 };
    Vec4::new(part(u, v), part(v, ru), part(ru, rv), part(rv, u))
}

#[inline(always)]
fn bernstein(x: f32) -> Vec4 {
    let y = 1.0 - x;
    Vec4::new(y * y * y, 3.0 * x * y * y, 3.0 * x * x * y, x * x * x)
}

#[inline(always)]
fn bernstein_derivative(x: f32) -> Vec4 {
    let y = 1.0 - x;
    let (a, b, c) = (3.0 * y * y, 6.0 * x * y, 3.0 * x * x);
    Vec4::new(-a, a - b, b - c, c)
}

/// What a sample needs that is the same for every lane.
pub(crate) struct Place {
    blend: Vec4,
    bu: Vec4,
    bv: Vec4,
    du: Vec4,
    dv: Vec4,
}

impl Place {
    /// At (u, v) in [0, 1].
    #[inline(always)]
    pub(crate) fn new(u: f32, v: f32) -> Self {
        Self {
            blend: blends(u, v),
            bu: bernstein(u),
            bv: bernstein(v),
            du: bernstein_derivative(u),
            dv: bernstein_derivative(v),
        }
    }

    /// Position and derivatives of one lane.
    #[inline(always)]
    pub(crate) fn evaluate(&self, p: &[Vec4; CONTROLS], derivatives: bool) -> [Vec4; 3] {
        let face = |i: usize, blend: f32| p[i + 4] + (p[i + 3] - p[i + 4]) * blend;
        let (f0, f1) = (face(0, self.blend.x), face(5, self.blend.y));
        let (f2, f3) = (face(10, self.blend.z), face(15, self.blend.w));
        let rows = [
            [p[0], p[1], p[7], p[5]],
            [p[2], f0, f1, p[6]],
            [p[16], f3, f2, p[12]],
            [p[15], p[17], p[11], p[10]],
        ];
        let along = |w: Vec4| rows.map(|[a, b, c, d]| combine(w, a, b, c, d));
        let [a, b, c, d] = along(self.bu);
        let position = combine(self.bv, a, b, c, d);
        if !derivatives {
            return [position, Vec4::ZERO, Vec4::ZERO];
        }
        let dv = combine(self.dv, a, b, c, d);
        let [a, b, c, d] = along(self.du);
        [position, combine(self.bv, a, b, c, d), dv]
    }
}

/// The weight of each point at (u, v), in f64: what the library's weights are compared with.
pub(crate) fn weights(u: f64, v: f64) -> [f64; CONTROLS] {
    let bernstein = |x: f64| {
        let y = 1.0 - x;
        [y * y * y, 3.0 * x * y * y, 3.0 * x * x * y, x * x * x]
    };
    let (bu, bv) = (bernstein(u), bernstein(v));
    let (ru, rv) = (1.0 - u, 1.0 - v);
    let blends = [u / (u + v), v / (v + ru), ru / (ru + rv), rv / (rv + u)];
    std::array::from_fn(|i| {
        let w = bu[GRID[i] % 4] * bv[GRID[i] / 4];
        match i % 5 {
            3 => w * blends[i / 5],
            4 => w * (1.0 - blends[i / 5]),
            _ => w,
        }
    })
}
