//! The camera's pose over the shutter.
//!
//! Between keys the matrix is split into rotation and stretch (polar decomposition, Higham 1986);
//! the rotation turns at constant speed, stretch and position go linearly, so a turning camera never
//! shrinks its view, as entry-wise interpolation would.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use crate::motion::{Hierarchy, Shutter, TransformError};
use crate::scene::TransformSamples;

/// Newton steps of the polar decomposition: it converges quadratically from any matrix that is not
/// nearly singular; a rigid camera needs one.
const POLAR_STEPS: usize = 32;

#[derive(Clone, Copy, Debug)]
struct Pose {
    rotation: DQuat,
    stretch: DMat3,
    translation: DVec3,
}

/// A camera's poses at its keys.
#[derive(Clone, Debug)]
pub struct Poses {
    key_times: Vec<f64>,
    poses: Vec<Pose>,
    is_singular: bool,
}

impl Poses {
    /// Resolves the transform levels to `shutter`.
    ///
    /// # Errors
    /// A matrix that is not finite, or without samples.
    pub fn new(samples: &[TransformSamples], shutter: Shutter) -> Result<Self, TransformError> {
        let hierarchy = Hierarchy::new(samples, shutter)?;
        let key_times = hierarchy.key_times();
        let matrices: Vec<DAffine3> = key_times.iter().map(|&t| hierarchy.matrix(t)).collect();
        let is_singular = matrices
            .iter()
            .any(|m| polar_rotation(&m.matrix3).is_none());
        let poses = matrices.iter().map(split).collect();
        Ok(Self {
            key_times,
            poses,
            is_singular,
        })
    }

    /// True when a key's matrix cannot be inverted: there the camera looks along the world's -z.
    pub fn is_singular(&self) -> bool {
        self.is_singular
    }

    /// True when there is more than one key.
    pub fn is_moving(&self) -> bool {
        self.key_times.len() > 1
    }

    /// Key times in [0, 1].
    pub fn key_times(&self) -> &[f64] {
        &self.key_times
    }

    /// Camera to world at `time`.
    pub fn at(&self, time: f64) -> DAffine3 {
        let last = self.key_times.len() - 1;
        let next = self
            .key_times
            .partition_point(|&t| t <= time)
            .clamp(1.min(last), last);
        let first = next.saturating_sub(1);
        let (a, b) = (&self.poses[first], &self.poses[next]);
        let span = self.key_times[next] - self.key_times[first];
        let f = if span > 0.0 {
            ((time - self.key_times[first]) / span).clamp(0.0, 1.0)
        } else {
            0.0
        };
        DAffine3 {
            matrix3: DMat3::from_quat(a.rotation.slerp(b.rotation, f))
                * (a.stretch * (1.0 - f) + b.stretch * f),
            translation: a.translation.lerp(b.translation, f),
        }
    }
}

/// Rotation times stretch. A camera that cannot be inverted looks along the world's axes.
fn split(m: &DAffine3) -> Pose {
    let matrix = m.matrix3;
    let (rotation, stretch) = match polar_rotation(&matrix) {
        Some(r) => (r, r.transpose() * matrix),
        None => (DMat3::IDENTITY, DMat3::IDENTITY),
    };
    Pose {
        rotation: DQuat::from_mat3(&rotation).normalize(),
        stretch,
        translation: m.translation,
    }
}

fn polar_rotation(m: &DMat3) -> Option<DMat3> {
    let determinant = m.determinant();
    if !(determinant.is_finite() && determinant != 0.0) {
        return None;
    }
    let mut r = *m;
    for _ in 0..POLAR_STEPS {
        let next = (r + r.inverse().transpose()) * 0.5;
        let change = (next - r)
            .to_cols_array()
            .iter()
            .fold(0.0f64, |a, x| a.max(x.abs()));
        r = next;
        if change < 1.0e-15 {
            break;
        }
    }
    // A mirrored camera: the mirror goes into the stretch.
    let r = if determinant < 0.0 { r * -1.0 } else { r };
    r.is_finite().then_some(r)
}
