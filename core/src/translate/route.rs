//! How a prim reaches the world.
//!
//! * **Flattened**: a prim that appears once. Its vertices are M(t) p(t) in world space, relative to
//!   an origin of its own; keys are added until chords are within tolerance of that path.
//! * **Instanced**: a prim that appears many times is diced once, in object space, and each instance
//!   carries its matrices. An instance whose matrix comes near to singular within the shutter
//!   (half-turns between two keys, scales through zero) cannot carry rays into object space: it is
//!   flattened by itself.
//!
//! Both follow the same path of motion, M(t) p(t) with M as its levels interpolate it.

use glam::{DAffine3, DVec3};

use super::measure::{CHORD_TOLERANCE, ObjectBounds, pixels_per_unit};
use super::points::PointKeys;
use crate::camera::Camera;
use crate::grid::locate_key;
use crate::motion::rates::LARGEST_COORDINATE;
use crate::motion::transform::{keys_within, lerp};
use crate::motion::{PointPath, TransformError, keys};

/// Points probed for the curvature of a deforming prim's path, at most.
const PROBES: usize = 4096;
/// A matrix path is safe to invert between two keys when the change, seen in the first key's frame,
/// is below this: then M(t) = M0 (I + t E) with |E| < 1/2 has a condition at most 3 times M0's.
const SAFE_CHANGE: f64 = 0.5;
/// Halvings of a segment in that test.
const SAFE_HALVINGS: u32 = 5;
/// Largest condition number (product of the largest entries of M and its inverse) through which
/// rays are carried in f32: 24 bits, less 12 for the ray's own accuracy.
const LARGEST_CONDITION: f64 = 4096.0;

/// Why a prim cannot be placed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RouteError {
    /// See [`TransformError`].
    #[error(transparent)]
    Transform(#[from] TransformError),
    /// The placed points are too far apart for f32.
    #[error("its transform makes it too large to render")]
    TooLarge,
}

/// True when rays can be carried into object space at every time, along a path that goes straight from
/// each of `matrices` to the next.
pub fn is_invertible(matrices: &[DAffine3]) -> bool {
    let sound = |m: &DAffine3| {
        let inverse = m.matrix3.inverse();
        let largest =
            |m: &glam::DMat3| m.to_cols_array().iter().fold(0.0f64, |a, x| a.max(x.abs()));
        let condition = largest(&m.matrix3) * largest(&inverse);
        inverse.is_finite() && condition < LARGEST_CONDITION
    };
    matrices.iter().all(sound)
        && matrices
            .windows(2)
            .all(|w| stays_invertible(&w[0], &w[1], 0))
}

fn stays_invertible(a: &DAffine3, b: &DAffine3, depth: u32) -> bool {
    let change = a.matrix3.inverse() * (b.matrix3 - a.matrix3);
    // Frobenius norm, at least the operator norm.
    let norm = change
        .to_cols_array()
        .iter()
        .map(|x| x * x)
        .sum::<f64>()
        .sqrt();
    if norm < SAFE_CHANGE {
        return true;
    }
    if depth == SAFE_HALVINGS || !norm.is_finite() {
        return false;
    }
    let middle = lerp(a, b, 0.5);
    stays_invertible(a, &middle, depth + 1) && stays_invertible(&middle, b, depth + 1)
}

/// World units that a chord may miss the path by, for a prim of `bounds` under `matrix(time)`.
fn chord_tolerance(
    camera: &Camera,
    matrix: &dyn Fn(f64) -> DAffine3,
    bounds: &ObjectBounds,
    key_times: &[f64],
) -> f64 {
    let finest = key_times
        .iter()
        .chain(camera.key_times())
        .map(|&t| {
            let m = matrix(t);
            let scale = super::measure::largest_scale(&m).max(f64::MIN_POSITIVE);
            // Pixels per world unit: the object's own scale is not part of it.
            pixels_per_unit(&camera.raster_view(t), &m, bounds) / scale
        })
        .fold(0.0f64, f64::max);
    CHORD_TOLERANCE / finest.max(f64::MIN_POSITIVE)
}

/// The path of a flattened prim: `matrix(time)` with keys at `matrix_keys`, over the points of a prim.
///
/// # Errors
/// Placed points that f32 cannot hold.
pub fn flatten(
    points: &PointKeys,
    matrix: &dyn Fn(f64) -> DAffine3,
    matrix_keys: &[f64],
    camera: &Camera,
) -> Result<PointPath, RouteError> {
    let bounds = ObjectBounds::of(&points.points);
    let point_keys: Vec<f64> = points.times.iter().map(|&t| f64::from(t)).collect();
    let mut key_times = keys::union([matrix_keys, point_keys.as_slice()]);
    if matrix_keys.len() > 1 {
        let tolerance = chord_tolerance(camera, matrix, &bounds, &key_times);
        let corners = bounds.corners();
        let stride = (points.points[0].len() / PROBES).max(1);
        let probe = |time: f64| -> Vec<DVec3> {
            if points.points.len() == 1 {
                return corners.clone();
            }
            let (k, f) = locate_key(&points.times, time as f32);
            let (a, b) = (&points.points[k], &points.points[k + 1]);
            let mix = |i: usize| a[i].as_dvec3().lerp(b[i].as_dvec3(), f64::from(f));
            (0..a.len()).step_by(stride).map(mix).collect()
        };
        key_times = keys_within(matrix, &key_times, tolerance, &probe);
    }
    let matrices: Vec<DAffine3> = key_times.iter().map(|&t| matrix(t)).collect();
    let origin = matrices[0].transform_point3(bounds.centre());
    let extent = matrices
        .iter()
        .flat_map(|m| {
            bounds
                .corners()
                .into_iter()
                .map(|c| m.transform_point3(c) - origin)
        })
        .fold(0.0f64, |a, p| a.max(p.abs().max_element()));
    if extent >= f64::from(LARGEST_COORDINATE) {
        return Err(RouteError::TooLarge);
    }
    let key_times = key_times.iter().map(|&t| t as f32).collect();
    Ok(PointPath::new(&points.times, key_times, &matrices, origin))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat4;

    fn invertible(a: DMat4, b: DMat4) -> bool {
        is_invertible(&[DAffine3::from_mat4(a), DAffine3::from_mat4(b)])
    }

    #[test]
    fn half_turns_and_scales_through_zero_are_not_invertible() {
        let turn = |a: f64| DMat4::from_rotation_z(a);
        assert!(invertible(turn(0.0), turn(1.0)));
        assert!(invertible(turn(0.0), turn(2.5)));
        assert!(!invertible(turn(0.0), turn(std::f64::consts::PI)));
        let scale = |s: f64| DMat4::from_scale(DVec3::new(s, 1.0, 1.0));
        assert!(invertible(scale(1.0), scale(3.0)));
        assert!(!invertible(scale(1.0), scale(-1.0)));
        assert!(!invertible(scale(1.0), scale(0.0)));
        assert!(!invertible(scale(0.0), scale(0.0)));
    }
}
