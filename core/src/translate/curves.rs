//! Checks curves: counts that the basis and wrap can have, points that are finite at every key.

use glam::Vec3;

use super::points::{Bends, PointKeys, point_keys};
use super::values::Counts;
use crate::curve::CurveKind;
use crate::diagnostics::{Code, Warning};
use crate::motion::Shutter;
use crate::motion::rates::{fault, usable};
use crate::scene::CurvesDesc;

/// One curve of a prim, in the prim's arrays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CurveSpan {
    /// Authored number of the curve.
    pub element: u32,
    /// Its first point, and so its first `vertex` value.
    pub first_point: u32,
    /// Its points.
    pub point_count: u32,
    /// Its first `varying` value.
    pub first_varying: u32,
    /// Its segments, 1 or more.
    pub segments: u32,
}

/// Curves that dicing can take.
#[derive(Clone, Debug)]
pub struct CheckedCurves {
    /// Basis and wrap.
    pub kind: CurveKind,
    /// Curves that can be rendered, in authored order.
    pub spans: Vec<CurveSpan>,
    /// How many values primvars have, over the authored curves.
    pub counts: Counts,
    /// Points at keys. Those that no curve uses are finite too.
    pub points: PointKeys,
}

/// Checks `curves`. `None` when nothing is left to render; no curves are no reason to warn.
pub fn check(
    path: &str,
    curves: &CurvesDesc,
    shutter: Shutter,
    bends: Bends<'_>,
    warnings: &mut Vec<Warning>,
) -> Option<CheckedCurves> {
    let authored = &*curves.vertex_counts;
    if authored.is_empty() {
        if curves.points.points.iter().any(|p| !p.is_empty()) {
            let text = "points but no curves; nothing to render";
            warnings.push(Warning::new(path, Code::Topology, text));
        }
        return None;
    }
    let total = authored.len();
    if curves.points.points.iter().all(|p| p.is_empty()) {
        let text = format!("{total} curves but no points; dropped");
        warnings.push(Warning::new(path, Code::Topology, text));
        return None;
    }
    let kind = CurveKind {
        basis: curves.basis,
        wrap: curves.wrap,
    };
    let count = |c: &i32| usize::try_from(*c).unwrap_or(0);
    let needed = authored.iter().map(count).fold(0, usize::saturating_add);
    let mut points = point_keys(path, &curves.points, needed, shutter, bends, warnings)?;
    let point_count = points.points[0].len();
    let finite: Vec<bool> = (0..point_count)
        .map(|p| points.points.iter().all(|key| usable(key[p])))
        .collect();

    let mut counts = Counts {
        uniform: total,
        varying: 0,
        vertex: 0,
    };
    let mut spans = Vec::new();
    let (mut few, mut over, mut beyond, mut not_finite) = (0usize, 0usize, 0usize, 0usize);
    for (element, c) in authored.iter().enumerate() {
        let n = count(c);
        let (first, varying) = (counts.vertex, counts.varying);
        counts.vertex = counts.vertex.saturating_add(kind.vertex_values(n));
        counts.varying = counts.varying.saturating_add(kind.varying_values(n));
        let segments = kind.segments(n);
        if segments == 0 {
            // A curve without points is empty, which is no fault.
            few += usize::from(*c != 0);
        } else if first.saturating_add(n) > point_count {
            beyond += 1;
        } else if !finite[first..first + n].iter().all(|&f| f) {
            not_finite += 1;
        } else {
            over += usize::from(kind.left_over(n) > 0);
            spans.push(CurveSpan {
                element: u32::try_from(element).ok()?,
                first_point: u32::try_from(first).ok()?,
                point_count: n as u32,
                first_varying: u32::try_from(varying).ok()?,
                segments: segments as u32,
            });
        }
    }
    let name = format!("{:?} {:?}", kind.basis, kind.wrap).to_lowercase();
    let mut complain = |code, text: String| warnings.push(Warning::new(path, code, text));
    if few > 0 {
        let fewest = kind.fewest_points();
        complain(
            Code::Topology,
            format!(
                "{few} of {total} curves have fewer than the {fewest} points that {name} curves need; \
                 dropped"
            ),
        );
    }
    if over > 0 {
        complain(
            Code::Topology,
            format!(
                "{over} of {total} curves have points behind their last whole {name} segment; these \
                 points are ignored"
            ),
        );
    }
    if beyond > 0 {
        complain(
            Code::Topology,
            format!(
                "curveVertexCounts sum to {needed} but there are {point_count} points; {beyond} of \
                 {total} curves are dropped"
            ),
        );
    } else if needed < point_count {
        complain(
            Code::Topology,
            format!(
                "curveVertexCounts sum to {needed} but there are {point_count} points; the last {} are \
                 ignored",
                point_count - needed
            ),
        );
    }
    if not_finite > 0 {
        complain(
            Code::NotFinite,
            format!(
                "{not_finite} of {total} curves have points that are {}; dropped",
                fault(&points.points)
            ),
        );
    }
    let stand_in = spans.first()?.first_point as usize;
    for key in &mut points.points {
        let at: Vec3 = key[stand_in];
        for (p, finite) in key.iter_mut().zip(&finite) {
            if !finite {
                *p = at;
            }
        }
    }
    Some(CheckedCurves {
        kind,
        spans,
        counts,
        points,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{CurveBasis, CurveWrap, PointsSamples};
    use std::sync::Arc;

    fn curves(basis: CurveBasis, counts: &[i32], points: usize) -> CurvesDesc {
        CurvesDesc {
            basis,
            wrap: CurveWrap::Nonperiodic,
            vertex_counts: Arc::new(counts.to_vec()),
            points: PointsSamples {
                times: vec![0.0],
                points: vec![Arc::new(
                    (0..points).map(|i| Vec3::new(i as f32, 1.0, 2.0)).collect(),
                )],
                ..PointsSamples::default()
            },
            ..CurvesDesc::default()
        }
    }

    fn run(desc: &CurvesDesc) -> (Option<CheckedCurves>, Vec<Warning>) {
        let mut warnings = Vec::new();
        let shutter = Shutter {
            open: -0.5,
            close: 0.5,
        };
        let out = check("/c", desc, shutter, Bends::Samples(2), &mut warnings);
        (out, warnings)
    }

    fn elements(checked: &CheckedCurves) -> Vec<u32> {
        checked.spans.iter().map(|s| s.element).collect()
    }

    #[test]
    fn good_curves_keep_their_numbers_and_values() {
        let (out, warnings) = run(&curves(CurveBasis::Bezier, &[4, 2, -3, 7], 13));
        let out = out.unwrap();
        assert_eq!(elements(&out), [0, 3]);
        assert_eq!((out.spans[1].first_point, out.spans[1].segments), (6, 2));
        assert_eq!(out.spans[1].first_varying, 2, "faulty curves have none");
        assert_eq!((out.counts.varying, out.counts.vertex), (5, 13));
        assert_eq!(warnings.len(), 1, "{warnings:?}");
    }

    #[test]
    fn counts_that_do_not_add_up() {
        let (out, warnings) = run(&curves(CurveBasis::Bezier, &[4, 4], 7));
        assert_eq!(elements(&out.unwrap()), [0]);
        assert_eq!(warnings.len(), 1);
        let (out, warnings) = run(&curves(CurveBasis::Bezier, &[4], 7));
        assert_eq!(elements(&out.unwrap()), [0]);
        assert_eq!(warnings.len(), 1);
        let (out, warnings) = run(&curves(CurveBasis::Bezier, &[6], 6));
        assert_eq!(out.unwrap().spans[0].segments, 1);
        assert_eq!(warnings.len(), 1);
        let (out, warnings) = run(&curves(CurveBasis::Linear, &[i32::MAX, i32::MAX, 2], 7));
        assert!(out.is_none());
        assert_eq!(warnings.len(), 1);
    }

    #[test]
    fn points_that_are_not_finite_take_their_curve_only() {
        let mut desc = curves(CurveBasis::Linear, &[2, 2, 2], 7);
        let points = Arc::make_mut(&mut desc.points.points[0]);
        points[3].y = f32::NAN;
        points[6].x = f32::INFINITY;
        let (out, warnings) = run(&desc);
        let out = out.unwrap();
        assert_eq!(elements(&out), [0, 2]);
        assert!(out.points.points[0].iter().all(|p| p.is_finite()));
        assert_eq!(warnings.len(), 2, "one for the curve, one for the rest");
    }

    #[test]
    fn nothing_is_silent_and_half_of_it_is_not() {
        assert!(run(&curves(CurveBasis::Linear, &[], 0)).1.is_empty());
        let (out, warnings) = run(&curves(CurveBasis::Linear, &[], 3));
        assert!(out.is_none() && warnings.len() == 1);
        let (out, warnings) = run(&curves(CurveBasis::Linear, &[2], 0));
        assert!(out.is_none() && warnings.len() == 1);
    }
}
