//! Where points are in the image at one instant.

use glam::{Mat3, Vec2, Vec3};

use super::window::Window;
use crate::scene::Projection;

/// A camera at one instant, for points to be projected. Any thread.
#[derive(Clone, Copy, Debug)]
pub struct Projector {
    pub(super) projection: Projection,
    /// From the world's axes to the camera's.
    pub(super) rotation: Mat3,
    /// Where the camera is, relative to [`super::Camera::origin`].
    pub(super) position: Vec3,
    pub(super) window: Window,
    /// Pixels.
    pub(super) size: Vec2,
}

impl Projector {
    /// Camera-space position of a world-space point (relative to [`super::Camera::origin`]).
    #[inline]
    pub fn to_camera(&self, p: Vec3) -> Vec3 {
        self.rotation * (p - self.position)
    }

    /// Raster position of a world-space point (relative to [`super::Camera::origin`]); none where that is not before a
    /// perspective camera.
    #[inline]
    pub fn project(&self, p: Vec3) -> Option<Vec2> {
        let p = self.to_camera(p);
        let at = match self.projection {
            Projection::Perspective if p.z < 0.0 => p.truncate() / -p.z,
            Projection::Perspective => return None,
            Projection::Orthographic => p.truncate(),
        };
        Some(self.window.unit(at) * self.size)
    }
}
