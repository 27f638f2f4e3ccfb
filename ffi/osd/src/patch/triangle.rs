//! Regular Loop triangles: quartic patches.
//!
//! The box spline over a regular triangle is one polynomial of degree 4, whatever its boundaries, so
//! it has 15 Bezier points that are fixed sums of its 12 control points. The sums are found once per
//! arrangement of boundaries, from the library's weights at 15 places in double precision.
//!
//! Barycentric places are (w, u, v) with w = 1 - u - v; corner 0 has w = 1.

use std::sync::LazyLock;

use glam::Vec4;

/// Control points of a regular triangle.
pub(crate) const CONTROLS: usize = 12;

/// Bezier points of a quartic triangle.
pub(crate) const BEZIER: usize = 15;

/// Sums that make Bezier points of control points.
pub(crate) type Conversion = [[f32; CONTROLS]; BEZIER];

/// Powers (of u, of v) that each Bezier point stands for: rows of v, u fastest.
const POWERS: [(usize, usize); BEZIER] = [
    (0, 0),
    (1, 0),
    (2, 0),
    (3, 0),
    (4, 0),
    (0, 1),
    (1, 1),
    (2, 1),
    (3, 1),
    (0, 2),
    (1, 2),
    (2, 2),
    (0, 3),
    (1, 3),
    (0, 4),
];

/// Number of the Bezier point with these powers.
const fn index(u: usize, v: usize) -> usize {
    // Rows of 5, 4, 3, 2, 1.
    v * (11 - v) / 2 + u
}

/// The 15 Bernstein polynomials at (u, v).
fn bernstein(u: f64, v: f64) -> [f64; BEZIER] {
    const FACTORIAL: [f64; 5] = [1.0, 1.0, 2.0, 6.0, 24.0];
    POWERS.map(|(i, j)| {
        let k = 4 - i - j;
        24.0 / (FACTORIAL[i] * FACTORIAL[j] * FACTORIAL[k])
            * u.powi(i as i32)
            * v.powi(j as i32)
            * (1.0 - u - v).powi(k as i32)
    })
}

/// Bezier points from values at the places (i/4, j/4): the inverse of the Bernstein matrix.
static INTERPOLATE: LazyLock<[[f64; BEZIER]; BEZIER]> = LazyLock::new(|| {
    let mut a = POWERS.map(|(i, j)| bernstein(i as f64 / 4.0, j as f64 / 4.0));
    let mut inverse: [[f64; BEZIER]; BEZIER] =
        std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    for column in 0..BEZIER {
        let pivot = (column..BEZIER)
            .max_by(|&i, &j| a[i][column].abs().total_cmp(&a[j][column].abs()))
            .unwrap_or(column);
        a.swap(column, pivot);
        inverse.swap(column, pivot);
        let (row, inverse_row) = (a[column], inverse[column]);
        for i in 0..BEZIER {
            let factor = if i == column {
                1.0 - 1.0 / row[column]
            } else {
                a[i][column] / row[column]
            };
            for j in 0..BEZIER {
                a[i][j] -= factor * row[j];
                inverse[i][j] -= factor * inverse_row[j];
            }
        }
    }
    inverse
});

/// The conversion of a patch whose control points have these weights: `weights(u, v)`.
pub(crate) fn conversion(
    mut weights: impl FnMut(f64, f64) -> Option<[f64; CONTROLS]>,
) -> Option<Conversion> {
    let mut samples = [[0.0; CONTROLS]; BEZIER];
    for (sample, (i, j)) in samples.iter_mut().zip(POWERS) {
        *sample = weights(i as f64 / 4.0, j as f64 / 4.0)?;
    }
    let row = |i: usize| -> [f64; CONTROLS] {
        std::array::from_fn(|j| (0..BEZIER).map(|k| INTERPOLATE[i][k] * samples[k][j]).sum())
    };
    let exact: [[f64; CONTROLS]; BEZIER] = std::array::from_fn(row);
    // The patch is what we think it is where it also agrees elsewhere.
    let (u, v) = (0.217, 0.461);
    let b = bernstein(u, v);
    let fits = weights(u, v)?.iter().enumerate().all(|(j, w)| {
        let ours: f64 = (0..BEZIER).map(|i| b[i] * exact[i][j]).sum();
        (ours - w).abs() < 1e-11
    });
    fits.then(|| exact.map(|row| row.map(|w| w as f32)))
}

/// Bezier points of one lane.
pub(crate) fn convert(conversion: &Conversion, p: &[Vec4; CONTROLS]) -> [Vec4; BEZIER] {
    conversion.map(|row| {
        let mut sum = p[0] * row[0];
        for j in 1..CONTROLS {
            sum += p[j] * row[j];
        }
        sum
    })
}

/// The cubic Bernstein polynomials at (u, v), rows of v, u fastest.
#[inline(always)]
pub(crate) fn cubics(u: f32, v: f32) -> [f32; 10] {
    let w = 1.0 - u - v;
    let (uu, vv, ww) = (u * u, v * v, w * w);
    [
        ww * w,
        3.0 * u * ww,
        3.0 * uu * w,
        uu * u,
        3.0 * v * ww,
        6.0 * u * v * w,
        3.0 * uu * v,
        3.0 * vv * w,
        3.0 * u * vv,
        vv * v,
    ]
}

/// Position and derivatives along u and v of one lane: de Casteljau's last step over three cubics.
#[inline(always)]
pub(crate) fn evaluate(b: &[Vec4; BEZIER], cubics: &[f32; 10], u: f32, v: f32) -> [Vec4; 3] {
    let (mut at_w, mut at_u, mut at_v) = (Vec4::ZERO, Vec4::ZERO, Vec4::ZERO);
    let mut k = 0;
    for j in 0..4 {
        for i in 0..4 - j {
            let weight = cubics[k];
            k += 1;
            at_w += b[index(i, j)] * weight;
            at_u += b[index(i + 1, j)] * weight;
            at_v += b[index(i, j + 1)] * weight;
        }
    }
    let (du, dv) = (at_u - at_w, at_v - at_w);
    [at_w + (du * u + dv * v), du, dv]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Any quartic is reproduced, with its derivatives (times 1/4).
    #[test]
    fn quartics_are_reproduced() {
        let f = |u: f64, v: f64| {
            let p = 1.0 + u - 2.0 * v + u * v * v * v - 3.0 * u.powi(4) + u * u * v * v;
            let mut all = [0.0; CONTROLS];
            all[3] = p;
            all[7] = 0.5 * v;
            all
        };
        let conversion = conversion(|u, v| Some(f(u, v))).expect("a quartic");
        let mut p = [Vec4::ZERO; CONTROLS];
        (p[3], p[7]) = (Vec4::X, Vec4::Y);
        let bezier = convert(&conversion, &p);
        let step = 1e-5;
        for (u, v) in [(0.0, 0.0), (1.0, 0.0), (0.2, 0.7), (0.4, 0.1), (0.0, 1.0)] {
            let [at, du, dv] = evaluate(&bezier, &cubics(u as f32, v as f32), u as f32, v as f32);
            assert!((f64::from(at.x) - f(u, v)[3]).abs() < 1e-5);
            assert!((f64::from(at.y) - f(u, v)[7]).abs() < 1e-6);
            let slope_u = (f(u + step, v)[3] - f(u - step, v)[3]) / (2.0 * step);
            let slope_v = (f(u, v + step)[3] - f(u, v - step)[3]) / (2.0 * step);
            assert!((f64::from(4.0 * du.x) - slope_u).abs() < 1e-4);
            assert!((f64::from(4.0 * dv.x) - slope_v).abs() < 1e-4);
        }
        // A quintic is refused.
        assert!(super::conversion(|u, _| Some([u.powi(5); CONTROLS])).is_none());
    }
}
