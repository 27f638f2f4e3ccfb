//! Where a shape that faces the camera finds it.

use glam::{DAffine3, DVec3};

use crate::camera::Camera;
use crate::motion::PointPath;

/// The camera at one instant, in the space that is traced, relative to a path's origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Eye {
    /// Perspective: its position.
    At(DVec3),
    /// Orthographic: the direction towards it, unit length.
    Along(DVec3),
}

impl Eye {
    /// The camera at `time`, relative to `origin` (world space).
    pub fn new(camera: &Camera, time: f64, origin: DVec3) -> Self {
        let view = camera.raster_view(time);
        let camera_to_world: DAffine3 = view.world_to_camera.inverse();
        if view.orthographic {
            Eye::Along(camera_to_world.matrix3.z_axis.normalize_or_zero())
        } else {
            Eye::At(camera_to_world.translation - origin)
        }
    }

    /// The camera at each key of `path`.
    pub fn at_keys(camera: &Camera, path: &PointPath) -> Vec<Self> {
        Self::at_times(camera, path.key_times(), path.origin())
    }

    /// The camera at the key times of what it sees, relative to `origin`. What stands still faces it as it is in
    /// mid-shutter.
    pub fn at_times(camera: &Camera, key_times: &[f32], origin: DVec3) -> Vec<Self> {
        let still = key_times.len() == 1;
        let time = |&time: &f32| if still { 0.5 } else { f64::from(time) };
        let eye = |key: &f32| Eye::new(camera, time(key), origin);
        key_times.iter().map(eye).collect()
    }

    /// From `p` to the camera; of any length.
    pub fn from(&self, p: DVec3) -> DVec3 {
        match *self {
            Eye::At(eye) => eye - p,
            Eye::Along(direction) => direction,
        }
    }
}
