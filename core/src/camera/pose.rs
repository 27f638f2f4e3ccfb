//! The camera's pose over the shutter.
//!
//! Between keys a camera always turns ([`crate::motion::turn`]): it never shrinks its view, as
//! entry-wise interpolation would.

use glam::{DAffine3, DVec3};

use crate::motion::turn::Polar;
use crate::motion::{Hierarchy, Shutter, TransformError};
use crate::scene::TransformSamples;

/// A camera's pose at one key.
#[derive(Clone, Copy, Debug)]
pub struct Pose {
    /// How it is turned.
    pub polar: Polar,
    /// Where it is.
    pub translation: DVec3,
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
        let is_singular = matrices.iter().any(|m| Polar::of(&m.matrix3).is_none());
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

    /// The pose at each key.
    pub fn poses(&self) -> &[Pose] {
        &self.poses
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
            matrix3: a.polar.towards(&b.polar, f),
            translation: a.translation.lerp(b.translation, f),
        }
    }
}

/// A camera that cannot be inverted looks along the world's axes.
fn split(m: &DAffine3) -> Pose {
    Pose {
        polar: Polar::of(&m.matrix3).unwrap_or(Polar::IDENTITY),
        translation: m.translation,
    }
}
