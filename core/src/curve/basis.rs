//! Bases and wraps: segments of a curve, values of its primvars, weights of its control values.
//!
//! A *segment* is one piece of a curve, over a parameter t in [0, 1]. It takes four control values
//! (two where it is linear). Between control values everything that a curve carries, positions and
//! `vertex` primvars alike, is blended with the same weights; `varying` primvars have one value at
//! each end of a segment.
//!
//! **Wraps.** A nonperiodic curve is as its basis has it. A periodic one begins again with its first
//! points. A pinned B-spline or Catmull-Rom curve has one more control value before its first, `2 P0 -
//! P1`, and one behind its last, so that it begins and ends on them; on the other bases, which do so
//! by themselves, pinned is nonperiodic.

use std::ops::{Add, Mul, Sub};

use crate::scene::{CurveBasis, CurveWrap};

/// Basis and wrap: the rules that all curves of a prim follow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CurveKind {
    /// Basis.
    pub basis: CurveBasis,
    /// Wrap.
    pub wrap: CurveWrap,
}

/// What control values can be blended from.
pub trait Blend: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<f64, Output = Self> {}
impl<T: Copy + Add<Output = T> + Sub<Output = T> + Mul<f64, Output = T>> Blend for T {}

/// Control values of one segment; a linear one uses the first two.
pub type Control<T> = [T; 4];

impl CurveKind {
    /// True where straight lines join the points.
    pub fn is_linear(self) -> bool {
        self.basis == CurveBasis::Linear
    }

    /// True where the last segment ends where the first begins.
    pub fn is_periodic(self) -> bool {
        self.wrap == CurveWrap::Periodic
    }

    /// True where control values are added before the first and behind the last.
    fn is_extended(self) -> bool {
        self.wrap == CurveWrap::Pinned
            && matches!(self.basis, CurveBasis::Bspline | CurveBasis::CatmullRom)
    }

    /// Points from the first of one segment to the first of the next.
    fn step(self) -> usize {
        match self.basis {
            CurveBasis::Bezier => 3,
            CurveBasis::Hermite => 2,
            CurveBasis::Linear | CurveBasis::Bspline | CurveBasis::CatmullRom => 1,
        }
    }

    /// Fewest points of a curve.
    pub fn fewest_points(self) -> usize {
        match (self.basis, self.is_periodic()) {
            (CurveBasis::Linear, false) => 2,
            (CurveBasis::Hermite, _) => 4,
            (_, true) => 3,
            (_, false) if self.is_extended() => 2,
            (_, false) => 4,
        }
    }

    /// Whole segments of a curve of `points` points; 0 where it has too few. Points that are over
    /// ([`Self::left_over`]) are not part of any.
    pub fn segments(self, points: usize) -> usize {
        if points < self.fewest_points() {
            return 0;
        }
        match (self.basis, self.is_periodic()) {
            (_, true) => points / self.step(),
            (CurveBasis::Linear, false) => points - 1,
            (CurveBasis::Hermite, false) => points / 2 - 1,
            (_, false) if self.is_extended() => points - 1,
            (_, false) => (points - 4) / self.step() + 1,
        }
    }

    /// Points behind the last whole segment, which no basis with this wrap can have.
    pub fn left_over(self, points: usize) -> usize {
        match (self.basis, self.is_periodic()) {
            (CurveBasis::Bezier, false) if points >= 4 => (points - 4) % 3,
            _ => points % self.step(),
        }
    }

    /// `vertex` primvar values of a curve of `points` points: one a point.
    pub fn vertex_values(self, points: usize) -> usize {
        points
    }

    /// `varying` primvar values of a curve of `points` points: one a segment end. They differ from the
    /// number of points wherever the curve is cubic.
    pub fn varying_values(self, points: usize) -> usize {
        match self.segments(points) {
            0 => 0,
            n if self.is_periodic() => n,
            n => n + 1,
        }
    }

    /// Control values of `segment` (below `segments(points)`) of a curve of `points` points, `value`
    /// being one at each of them.
    pub fn control<T: Blend>(
        self,
        points: usize,
        segment: usize,
        value: impl Fn(usize) -> T,
    ) -> Control<T> {
        let first = segment * self.step();
        if self.is_linear() {
            let (a, b) = (value(first), value((first + 1) % points));
            return [a, b, b, b];
        }
        if self.is_extended() {
            let beyond = |a: T, b: T| a * 2.0 - b;
            let last = points - 1;
            let before = match segment {
                0 => beyond(value(0), value(1)),
                s => value(s - 1),
            };
            let behind = match segment + 2 {
                s if s > last => beyond(value(last), value(last - 1)),
                s => value(s),
            };
            return [before, value(segment), value(segment + 1), behind];
        }
        [0, 1, 2, 3].map(|i| value((first + i) % points))
    }

    /// The two values that a `varying` primvar has at the ends of `segment`; `value` is one at each
    /// segment end.
    pub fn ends<T>(self, points: usize, segment: usize, value: impl Fn(usize) -> T) -> [T; 2] {
        [
            value(segment),
            value((segment + 1) % self.varying_values(points).max(1)),
        ]
    }

    /// The point at `t` in [0, 1].
    pub fn point<T: Blend>(self, control: &Control<T>, t: f64) -> T {
        combine(control, self.weights(t))
    }

    /// The derivative by t.
    pub fn derivative<T: Blend>(self, control: &Control<T>, t: f64) -> T {
        combine(control, self.derivative_weights(t))
    }

    /// The second derivative by t at both ends of the segment; it is linear in between.
    pub fn bends<T: Blend>(self, control: &Control<T>) -> [T; 2] {
        self.bend_weights().map(|w| combine(control, w))
    }

    fn weights(self, t: f64) -> [f64; 4] {
        let s = 1.0 - t;
        match self.basis {
            CurveBasis::Linear => [s, t, 0.0, 0.0],
            CurveBasis::Bezier => [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t],
            CurveBasis::Bspline => [
                s * s * s / 6.0,
                (4.0 + t * t * (3.0 * t - 6.0)) / 6.0,
                (4.0 + s * s * (3.0 * s - 6.0)) / 6.0,
                t * t * t / 6.0,
            ],
            CurveBasis::CatmullRom => [
                -0.5 * t * s * s,
                1.0 + t * t * (1.5 * t - 2.5),
                1.0 + s * s * (1.5 * s - 2.5),
                -0.5 * s * t * t,
            ],
            // Position, tangent, position, tangent.
            CurveBasis::Hermite => [
                s * s * (1.0 + 2.0 * t),
                t * s * s,
                t * t * (1.0 + 2.0 * s),
                -s * t * t,
            ],
        }
    }

    fn derivative_weights(self, t: f64) -> [f64; 4] {
        let s = 1.0 - t;
        match self.basis {
            CurveBasis::Linear => [-1.0, 1.0, 0.0, 0.0],
            CurveBasis::Bezier => [
                -3.0 * s * s,
                3.0 * s * (s - 2.0 * t),
                3.0 * t * (2.0 * s - t),
                3.0 * t * t,
            ],
            CurveBasis::Bspline => [
                -0.5 * s * s,
                t * (1.5 * t - 2.0),
                -s * (1.5 * s - 2.0),
                0.5 * t * t,
            ],
            CurveBasis::CatmullRom => [
                -0.5 * s * (s - 2.0 * t),
                t * (4.5 * t - 5.0),
                -s * (4.5 * s - 5.0),
                -0.5 * t * (2.0 * s - t),
            ],
            CurveBasis::Hermite => [
                -6.0 * s * t,
                s * (s - 2.0 * t),
                6.0 * s * t,
                t * (t - 2.0 * s),
            ],
        }
    }

    fn bend_weights(self) -> [[f64; 4]; 2] {
        match self.basis {
            CurveBasis::Linear => [[0.0; 4]; 2],
            CurveBasis::Bezier => [[6.0, -12.0, 6.0, 0.0], [0.0, 6.0, -12.0, 6.0]],
            CurveBasis::Bspline => [[1.0, -2.0, 1.0, 0.0], [0.0, 1.0, -2.0, 1.0]],
            CurveBasis::CatmullRom => [[2.0, -5.0, 4.0, -1.0], [-1.0, 4.0, -5.0, 2.0]],
            CurveBasis::Hermite => [[-6.0, -4.0, 6.0, -2.0], [6.0, 2.0, -6.0, 4.0]],
        }
    }
}

fn combine<T: Blend>(control: &Control<T>, w: [f64; 4]) -> T {
    control[0] * w[0] + control[1] * w[1] + control[2] * w[2] + control[3] * w[3]
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    const BASES: [CurveBasis; 5] = [
        CurveBasis::Linear,
        CurveBasis::Bezier,
        CurveBasis::Bspline,
        CurveBasis::CatmullRom,
        CurveBasis::Hermite,
    ];

    fn kind(basis: CurveBasis, wrap: CurveWrap) -> CurveKind {
        CurveKind { basis, wrap }
    }

    fn wiggle(i: usize) -> DVec3 {
        let x = i as f64;
        DVec3::new(x, (1.7 * x).sin(), (0.3 * x * x).cos())
    }

    /// An independent evaluation: knots and de Boor for B-splines, de Casteljau for Bezier, the
    /// definition of each of the others by divided differences of its neighbours.
    fn reference(basis: CurveBasis, p: [DVec3; 4], t: f64) -> DVec3 {
        let de_casteljau = |mut q: Vec<DVec3>| {
            while q.len() > 1 {
                q = q.windows(2).map(|w| w[0].lerp(w[1], t)).collect();
            }
            q[0]
        };
        match basis {
            CurveBasis::Linear => p[0].lerp(p[1], t),
            CurveBasis::Bezier => de_casteljau(p.to_vec()),
            CurveBasis::Bspline => {
                // Uniform knots -2 ... 3 around the interval [0, 1].
                let mut d = p;
                for r in 1..4usize {
                    for j in (r..4).rev() {
                        let left = j as f64 - 3.0;
                        let a = (t - left) / (4.0 - r as f64);
                        d[j] = d[j - 1].lerp(d[j], a);
                    }
                }
                d[3]
            }
            CurveBasis::CatmullRom => {
                // Aitken-Neville at the knots -1, 0, 1, 2 (Barry and Goldman).
                let a = |i: usize| p[i].lerp(p[i + 1], t - (i as f64 - 1.0));
                let b = |i: usize| a(i).lerp(a(i + 1), (t - (i as f64 - 1.0)) / 2.0);
                b(0).lerp(b(1), t)
            }
            CurveBasis::Hermite => {
                de_casteljau(vec![p[0], p[0] + p[1] / 3.0, p[2] - p[3] / 3.0, p[2]])
            }
        }
    }

    #[test]
    fn bases_agree_with_an_independent_evaluation() {
        for basis in BASES {
            let kind = kind(basis, CurveWrap::Nonperiodic);
            let control = [0, 1, 2, 3].map(wiggle);
            for i in 0..=16 {
                let t = f64::from(i) / 16.0;
                let p = kind.point(&control, t);
                let q = reference(basis, control, t);
                assert!((p - q).length() < 1e-12, "{basis:?} at {t}: {p} {q}");
                let h = 1e-5;
                let d = (reference(basis, control, t + h) - reference(basis, control, t - h))
                    / (2.0 * h);
                assert!(
                    (kind.derivative(&control, t) - d).length() < 1e-8,
                    "{basis:?} derivative at {t}"
                );
            }
            let bends = kind.bends(&control);
            for (t, bend) in [(0.0, bends[0]), (1.0, bends[1])] {
                let h = 1e-3;
                let d = (kind.derivative(&control, t + h) - kind.derivative(&control, t - h))
                    / (2.0 * h);
                assert!((bend - d).length() < 1e-5, "{basis:?} bend at {t}");
            }
        }
    }

    /// The tables of UsdGeomBasisCurves' documentation.
    #[test]
    fn segments_and_varying_values_are_counted_as_usd_does() {
        use CurveWrap::{Nonperiodic, Periodic, Pinned};
        type Row<'a> = (CurveBasis, CurveWrap, &'a [usize], &'a [usize], &'a [usize]);
        let table: [Row<'_>; 8] = [
            (
                CurveBasis::Linear,
                Nonperiodic,
                &[2, 3, 2, 5],
                &[1, 2, 1, 4],
                &[2, 3, 2, 5],
            ),
            (
                CurveBasis::Bezier,
                Nonperiodic,
                &[4, 7, 10, 4, 7],
                &[1, 2, 3, 1, 2],
                &[2, 3, 4, 2, 3],
            ),
            (
                CurveBasis::Bspline,
                Nonperiodic,
                &[5, 4, 6, 7],
                &[2, 1, 3, 4],
                &[3, 2, 4, 5],
            ),
            (
                CurveBasis::Bezier,
                Periodic,
                &[6, 9, 6],
                &[2, 3, 2],
                &[2, 3, 2],
            ),
            (CurveBasis::Linear, Periodic, &[3, 7], &[3, 7], &[3, 7]),
            (
                CurveBasis::CatmullRom,
                Pinned,
                &[2, 3, 8],
                &[1, 2, 7],
                &[2, 3, 8],
            ),
            (CurveBasis::Bezier, Pinned, &[4, 7], &[1, 2], &[2, 3]),
            (CurveBasis::CatmullRom, Periodic, &[3, 5], &[3, 5], &[3, 5]),
        ];
        for (basis, wrap, points, segments, varying) in table {
            let kind = kind(basis, wrap);
            for ((&n, &s), &v) in points.iter().zip(segments).zip(varying) {
                assert_eq!(kind.segments(n), s, "{kind:?} {n}");
                assert_eq!(kind.varying_values(n), v, "{kind:?} {n}");
                assert_eq!(kind.vertex_values(n), n);
                assert_eq!(kind.left_over(n), 0, "{kind:?} {n}");
            }
        }
    }

    #[test]
    fn counts_that_no_basis_has() {
        use CurveWrap::{Nonperiodic, Periodic, Pinned};
        for (basis, wrap, points) in [
            (CurveBasis::Linear, Nonperiodic, 1),
            (CurveBasis::Linear, Periodic, 2),
            (CurveBasis::Bezier, Nonperiodic, 3),
            (CurveBasis::Bspline, Nonperiodic, 3),
            (CurveBasis::CatmullRom, Pinned, 1),
            (CurveBasis::Bezier, Periodic, 2),
            (CurveBasis::Hermite, Nonperiodic, 3),
        ] {
            let kind = kind(basis, wrap);
            assert_eq!((kind.segments(points), kind.varying_values(points)), (0, 0));
        }
        assert_eq!(kind(CurveBasis::Bezier, Nonperiodic).left_over(6), 2);
        assert_eq!(kind(CurveBasis::Bezier, Nonperiodic).segments(6), 1);
        assert_eq!(kind(CurveBasis::Bezier, Periodic).left_over(7), 1);
        assert_eq!(kind(CurveBasis::Hermite, Nonperiodic).left_over(5), 1);
    }

    #[test]
    fn segments_meet_and_wraps_end_where_they_should() {
        for basis in BASES {
            for wrap in [
                CurveWrap::Nonperiodic,
                CurveWrap::Periodic,
                CurveWrap::Pinned,
            ] {
                let kind = kind(basis, wrap);
                // 10 points fit every wrap but periodic Bezier curves.
                let n = if basis == CurveBasis::Bezier && wrap == CurveWrap::Periodic {
                    9
                } else {
                    10
                };
                let segments = kind.segments(n);
                let at = |s: usize, t: f64| kind.point(&kind.control(n, s, wiggle), t);
                for s in 1..segments {
                    assert!((at(s - 1, 1.0) - at(s, 0.0)).length() < 1e-12, "{kind:?}");
                }
                let (first, last) = (at(0, 0.0), at(segments - 1, 1.0));
                if wrap == CurveWrap::Periodic {
                    assert!((first - last).length() < 1e-12, "{kind:?}");
                }
                if wrap == CurveWrap::Pinned {
                    let end = if basis == CurveBasis::Hermite {
                        n - 2
                    } else {
                        n - 1
                    };
                    assert!((first - wiggle(0)).length() < 1e-12, "{kind:?}");
                    assert!((last - wiggle(end)).length() < 1e-12, "{kind:?}");
                }
                let ends = kind.ends(n, segments - 1, |i| i);
                let next = if wrap == CurveWrap::Periodic {
                    0
                } else {
                    segments
                };
                assert_eq!(ends, [segments - 1, next]);
            }
        }
    }
}
