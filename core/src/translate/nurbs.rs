//! Checks NURBS patches: knot vectors, counts and weights that fit, points that are finite.

use glam::Vec3;

use super::points::{Bends, PointKeys, point_keys};
use super::primvar::{Count, Counts};
use crate::diagnostics::{Code, Warning};
use crate::motion::Shutter;
use crate::motion::rates::{fault, usable};
use crate::nurbs::Knots;
use crate::scene::NurbsPatchDesc;
use crate::surface::nurbs::NurbsPatch;

/// A patch that dicing can take.
#[derive(Clone, Debug)]
pub struct CheckedPatch {
    /// The patch, with the points of `points`.
    pub patch: NurbsPatch,
    /// Points at keys, which bound it.
    pub points: PointKeys,
    /// How many values primvars have.
    pub counts: Counts,
}

/// Checks `desc`. `None` when nothing is left to render; no points at all are no reason to warn.
pub fn check(
    path: &str,
    desc: &NurbsPatchDesc,
    shutter: Shutter,
    bends: Bends<'_>,
    warnings: &mut Vec<Warning>,
) -> Option<CheckedPatch> {
    if desc.points.points.iter().all(|p| p.is_empty()) && desc.vertex_counts == [0; 2] {
        return None;
    }
    let mut knots = Vec::with_capacity(2);
    for (d, name) in ["u", "v"].into_iter().enumerate() {
        let (order, count) = (desc.orders[d], desc.vertex_counts[d]);
        match Knots::new(order, count, &desc.knots[d], desc.ranges[d]) {
            Ok((checked, cut)) => {
                if cut {
                    let text = format!("{name}Range reaches beyond its knots; it is cut to them");
                    warnings.push(Warning::new(path, Code::Topology, text));
                }
                knots.push(checked);
            }
            Err(error) => {
                let text = format!("along {name}, {error}; the prim is dropped");
                warnings.push(Warning::new(path, Code::Topology, text));
                return None;
            }
        }
    }
    let knots: [Knots; 2] = knots.try_into().ok()?;
    let [u, v] = [0, 1].map(|d: usize| knots[d].point_count());
    let needed = u.saturating_mul(v);
    if desc.points.points.iter().all(|p| p.is_empty()) {
        let text = format!("{u} x {v} points are needed, there are none; dropped");
        warnings.push(Warning::new(path, Code::Topology, text));
        return None;
    }
    let mut points = point_keys(path, &desc.points, needed, shutter, bends, warnings)?;
    let given = points.points[0].len();
    let mut warn = |code, text: String| warnings.push(Warning::new(path, code, text));
    if given < needed {
        let text = format!("{u} x {v} points are needed, there are {given}; the prim is dropped");
        warn(Code::Topology, text);
        return None;
    }
    if given > needed {
        let text = format!("{u} x {v} points are needed, there are {given}; the last are ignored");
        warn(Code::Topology, text);
        points.points.iter_mut().for_each(|p| p.truncate(needed));
    }
    let finite: Vec<bool> = (0..needed)
        .map(|i| points.points.iter().all(|key| usable(key[i])))
        .collect();
    let lost = finite.iter().filter(|f| !**f).count();
    if lost > 0 {
        let stand_in = finite.iter().position(|&f| f);
        let end = if stand_in.is_some() {
            "what they bend is left out"
        } else {
            "dropped"
        };
        let fault = fault(&points.points);
        let text = format!("{lost} of {needed} points are {fault}; {end}");
        warn(Code::NotFinite, text);
        let stand_in = stand_in?;
        for key in &mut points.points {
            let at: Vec3 = key[stand_in];
            let bad = key.iter_mut().zip(&finite).filter(|(_, f)| !**f);
            bad.for_each(|(p, _)| *p = at);
        }
    }
    let weights = weights(desc, needed, &mut warn);
    let ends = (knots[0].segment_count() + 1) * (knots[1].segment_count() + 1);
    let varying = Count(ends, "ends of segments");
    let counts = Counts {
        varying,
        vertex: Count(needed, "points"),
        face_varying: varying,
        ..Counts::one_value("patch")
    };
    let patch = NurbsPatch {
        knots,
        points: points.points.clone(),
        weights,
        usable: if lost > 0 { finite } else { Vec::new() },
        orientation: desc.orientation,
    };
    Some(CheckedPatch {
        patch,
        points,
        counts,
    })
}

/// Weights that fit, or none.
fn weights(desc: &NurbsPatchDesc, needed: usize, warn: &mut dyn FnMut(Code, String)) -> Vec<f64> {
    let weights = &desc.weights;
    if weights.len() != needed {
        if !weights.is_empty() {
            let text = format!(
                "{} pointWeights for {needed} points; they are ignored",
                weights.len()
            );
            warn(Code::Topology, text);
        }
        return Vec::new();
    }
    let largest = weights.iter().copied().fold(0.0, f64::max);
    // Far smaller ones would make points that nothing but they have a part in rounding.
    let sound = |w: &f64| *w > largest * 1.0e-9 && w.is_finite();
    let bad = weights.iter().filter(|w| !sound(w)).count();
    if bad > 0 {
        let text = format!("{bad} of {needed} pointWeights are not above 0; all are ignored");
        warn(Code::NotFinite, text);
        return Vec::new();
    }
    if weights.iter().all(|w| *w == weights[0]) {
        return Vec::new();
    }
    weights.iter().map(|w| w / largest).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::PointsSamples;
    use std::sync::Arc;

    fn patch() -> NurbsPatchDesc {
        let points = (0..6).map(|i| Vec3::new((i % 3) as f32, (i / 3) as f32, 0.0));
        NurbsPatchDesc {
            vertex_counts: [3, 2],
            orders: [3, 2],
            knots: [
                Arc::new(vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0]),
                Arc::new(vec![0.0, 0.0, 1.0, 1.0]),
            ],
            points: PointsSamples {
                times: vec![0.0],
                points: vec![Arc::new(points.collect())],
                ..PointsSamples::default()
            },
            ..NurbsPatchDesc::default()
        }
    }

    fn run(change: impl FnOnce(&mut NurbsPatchDesc)) -> (Option<CheckedPatch>, Vec<Warning>) {
        let (mut desc, mut warnings) = (patch(), Vec::new());
        change(&mut desc);
        let shutter = Shutter {
            open: 0.0,
            close: 1.0,
        };
        let out = check("/n", &desc, shutter, Bends::Samples(2), &mut warnings);
        (out, warnings)
    }

    #[test]
    fn what_fits_is_silent() {
        let (out, warnings) = run(|_| {});
        let out = out.unwrap();
        assert!(warnings.is_empty());
        assert_eq!((out.counts.vertex.0, out.counts.varying.0), (6, 4));
        assert!(out.patch.weights.is_empty() && out.patch.usable.is_empty());
        let (out, warnings) = run(|d| d.weights = Arc::new(vec![2.0, 1.0, 2.0, 2.0, 1.0, 2.0]));
        assert_eq!(out.unwrap().patch.weights, [1.0, 0.5, 1.0, 1.0, 0.5, 1.0]);
        assert!(warnings.is_empty());
        let (out, warnings) = run(|d| *d = NurbsPatchDesc::default());
        assert!(out.is_none() && warnings.is_empty());
    }

    #[test]
    fn what_does_not_fit_gives_one_warning() {
        type Change = fn(&mut NurbsPatchDesc);
        let changes: [(Change, bool); 12] = [
            (|d| d.orders[0] = 1, false),
            (|d| d.orders[1] = 3, false),
            (|d| d.vertex_counts[0] = -3, false),
            (|d| d.vertex_counts = [i32::MAX; 2], false),
            (|d| Arc::make_mut(&mut d.knots[0])[2] = f64::NAN, false),
            (|d| d.knots[1] = Arc::new(vec![0.0; 4]), false),
            (|d| d.points = PointsSamples::default(), false),
            (
                |d| Arc::make_mut(&mut d.points.points[0]).truncate(5),
                false,
            ),
            (
                |d| Arc::make_mut(&mut d.points.points[0]).push(Vec3::ZERO),
                true,
            ),
            (|d| d.ranges[1] = Some([-1.0, 0.5]), true),
            (|d| d.weights = Arc::new(vec![1.0; 5]), true),
            (
                |d| d.weights = Arc::new(vec![1.0, 1.0, 0.0, 1.0, 1.0, 1.0]),
                true,
            ),
        ];
        for (number, (change, kept)) in changes.into_iter().enumerate() {
            let (out, warnings) = run(change);
            assert_eq!(out.is_some(), kept, "{number}");
            assert_eq!(warnings.len(), 1, "{number} {warnings:?}");
            assert!(out.is_none_or(|o| o.points.points[0].len() == 6));
        }
    }

    #[test]
    fn points_that_are_not_finite_are_marked() {
        let bad = |d: &mut NurbsPatchDesc| {
            Arc::make_mut(&mut d.points.points[0])[4].z = f32::INFINITY;
        };
        let (out, warnings) = run(bad);
        let out = out.unwrap();
        assert_eq!(warnings.len(), 1);
        assert_eq!(out.patch.usable.iter().filter(|u| !**u).count(), 1);
        assert!(out.patch.points[0].iter().all(|p| p.is_finite()));
        let (out, warnings) = run(|d| {
            Arc::make_mut(&mut d.points.points[0]).fill(Vec3::NAN);
        });
        assert!(out.is_none() && warnings.len() == 1);
    }
}
