//! Checks spheres: centres that are finite at every key.

use super::points::{Bends, PointKeys, point_keys};
use super::values::Counts;
use crate::diagnostics::{Code, Warning};
use crate::motion::Shutter;
use crate::motion::rates::{fault, usable};
use crate::scene::SpheresDesc;

/// Spheres that dicing can take.
#[derive(Clone, Debug)]
pub struct CheckedSpheres {
    /// Authored numbers of the points that can be rendered.
    pub elements: Vec<u32>,
    /// How many values primvars have.
    pub counts: Counts,
    /// All authored points at keys, finite.
    pub points: PointKeys,
}

/// Checks `spheres`. `None` when nothing is left to render; no points are no reason to warn.
pub fn check(
    path: &str,
    spheres: &SpheresDesc,
    shutter: Shutter,
    bends: Bends<'_>,
    warnings: &mut Vec<Warning>,
) -> Option<CheckedSpheres> {
    if spheres.points.points.iter().all(|p| p.is_empty()) {
        return None;
    }
    let mut points = point_keys(path, &spheres.points, 0, shutter, bends, warnings)?;
    let total = points.points[0].len();
    let finite = |i: &u32| points.points.iter().all(|key| usable(key[*i as usize]));
    let elements: Vec<u32> = (0..u32::try_from(total).ok()?).filter(finite).collect();
    let lost = total - elements.len();
    if lost > 0 {
        let fault = fault(&points.points);
        let text = format!("{lost} of {total} points are {fault}; dropped");
        warnings.push(Warning::new(path, Code::NotFinite, text));
        let stand_in = *elements.first()? as usize;
        let mut kept = elements.iter().copied().peekable();
        for i in 0..total {
            if kept.next_if_eq(&(i as u32)).is_none() {
                for key in &mut points.points {
                    key[i] = key[stand_in];
                }
            }
        }
    }
    Some(CheckedSpheres {
        elements,
        counts: Counts {
            uniform: total,
            varying: total,
            vertex: total,
        },
        points,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::PointsSamples;
    use glam::Vec3;
    use std::sync::Arc;

    #[test]
    fn points_that_are_not_finite_are_left_out() {
        let run = |points: Vec<Vec3>| {
            let desc = SpheresDesc {
                points: PointsSamples {
                    times: vec![0.0],
                    points: vec![Arc::new(points)],
                    ..PointsSamples::default()
                },
            };
            let mut warnings = Vec::new();
            let out = check(
                "/s",
                &desc,
                Shutter::default(),
                Bends::Samples(2),
                &mut warnings,
            );
            (out, warnings.len())
        };
        let (out, warnings) = run(vec![Vec3::NAN, Vec3::X, Vec3::INFINITY, Vec3::Y]);
        let out = out.unwrap();
        assert_eq!((out.elements, warnings), (vec![1, 3], 1));
        assert_eq!(out.points.points[0], [Vec3::X, Vec3::X, Vec3::X, Vec3::Y]);
        let (out, warnings) = run(vec![Vec3::NAN]);
        assert!(out.is_none() && warnings == 1);
        let (out, warnings) = run(vec![]);
        assert!(out.is_none() && warnings == 0);
    }
}
