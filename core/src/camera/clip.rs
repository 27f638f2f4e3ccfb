//! Clipping planes: what of a ray the camera's planes leave.

use glam::{DVec3, Vec3};

use super::CameraNotes;
use crate::diagnostics::number;

/// The part of a ray that is all cut off.
const NOTHING: [f32; 2] = [1.0, 0.0];

/// A plane in camera space: points with normal . p + offset < 0 are cut off.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Plane {
    normal: Vec3,
    offset: f32,
}

/// A camera's own planes, beside the clipping range.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ClippingPlanes {
    planes: Vec<Plane>,
}

impl ClippingPlanes {
    /// Resolves planes (a, b, c, d); those without a direction or with numbers that are not finite
    /// are noted, once, and left out.
    pub fn new(planes: &[[f64; 4]], notes: &mut CameraNotes) -> Self {
        let mut out = Vec::new();
        let mut bad = None;
        for plane in planes {
            let [a, b, c, d] = *plane;
            // Of unit length, so that f32 holds any; by the largest first, so that f64 does.
            let largest = DVec3::new(a, b, c).abs().max_element();
            let scaled = DVec3::new(a, b, c) / largest;
            let normal = scaled.normalize().as_vec3();
            let offset = (d / largest / scaled.length()) as f32;
            if largest > 0.0 && normal.is_finite() && offset.is_finite() {
                out.push(Plane { normal, offset });
            } else {
                bad = bad.or(Some(plane));
            }
        }
        if let Some(plane) = bad {
            let plane = plane.map(number).join(", ");
            notes.push(format!("clipping plane ({plane}) is none; it is ignored"));
        }
        Self { planes: out }
    }

    /// Normal and offset of each: points with `normal . p + offset < 0` (camera space) are cut off.
    pub fn iter(&self) -> impl Iterator<Item = (Vec3, f32)> {
        self.planes.iter().map(|p| (p.normal, p.offset))
    }

    /// True without planes.
    pub fn is_empty(&self) -> bool {
        self.planes.is_empty()
    }

    /// The part of `range` in which `origin + t dir` (camera space) is not cut off; begins after its
    /// end where nothing is left.
    #[inline]
    pub fn clip(&self, origin: Vec3, dir: Vec3, range: [f32; 2]) -> [f32; 2] {
        let [mut from, mut to] = range;
        for plane in &self.planes {
            let at = plane.normal.dot(origin) + plane.offset;
            let slope = plane.normal.dot(dir);
            if slope > 0.0 {
                from = from.max(-at / slope);
            } else if slope < 0.0 {
                to = to.min(-at / slope);
            } else if at < 0.0 {
                return NOTHING;
            }
        }
        if from <= to { [from, to] } else { NOTHING }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_of_a_ray() {
        let clip = |planes: &[[f64; 4]], origin, dir| {
            let mut notes = CameraNotes::new();
            let planes = ClippingPlanes::new(planes, &mut notes);
            assert!(notes.is_empty());
            planes.clip(origin, dir, [1.0, 10.0])
        };
        let (o, d) = (Vec3::ZERO, Vec3::NEG_Z);
        assert_eq!(clip(&[], o, d), [1.0, 10.0]);
        // -z - 3 >= 0: beyond depth 3, and the same with another scale.
        assert_eq!(clip(&[[0.0, 0.0, -1.0, -3.0]], o, d), [3.0, 10.0]);
        assert_eq!(clip(&[[0.0, 0.0, -1e200, -3e200]], o, d), [3.0, 10.0]);
        assert_eq!(clip(&[[0.0, 0.0, 1.0, 4.0]], o, d), [1.0, 4.0]);
        let slice = [[0.0, 0.0, -1.0, -3.0], [0.0, 0.0, 1.0, 4.0]];
        assert_eq!(clip(&slice, o, d), [3.0, 4.0]);
        let [from, to] = clip(&[[0.0, 0.0, -1.0, -5.0], [0.0, 0.0, 1.0, 4.0]], o, d);
        assert!(from > to, "nothing is left");
        // A plane along the ray keeps all of it or nothing; a slanted one cuts where it is met.
        assert_eq!(clip(&[[1.0, 0.0, 0.0, 0.5]], o, d), [1.0, 10.0]);
        let [from, to] = clip(&[[1.0, 0.0, 0.0, -0.5]], o, d);
        assert!(from > to);
        let [from, to] = clip(&[[1.0, 0.0, 1.0, 2.0]], Vec3::X, d);
        assert!(
            from == 1.0 && (to - 3.0).abs() < 1e-6,
            "x + z + 2 = 1 - t + 2"
        );
    }

    #[test]
    fn planes_that_are_none_are_left_out() {
        let mut notes = CameraNotes::new();
        let bad = [
            [0.0, 0.0, 0.0, -1.0],
            [f64::NAN, 0.0, 0.0, 1.0],
            [1.0, f64::INFINITY, 0.0, 1.0],
            [1.0, 0.0, 0.0, f64::INFINITY],
            [1e-200, 0.0, 0.0, 1.0],
        ];
        assert!(ClippingPlanes::new(&bad, &mut notes).is_empty());
        assert_eq!(notes.len(), 1, "{notes:?}");
    }
}
