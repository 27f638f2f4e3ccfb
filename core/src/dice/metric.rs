//! How long things are in raster space: pixels, at each output key of a path.

use glam::{DAffine3, DVec3, Mat3, Vec2, Vec3};

/// A camera at one instant, as dicing sees it. Camera space looks down -z; depth is `-z_cam`.
#[derive(Clone, Copy, Debug)]
pub struct RasterView {
    /// World to camera.
    pub world_to_camera: DAffine3,
    /// Pixels per unit at depth 1 (perspective), or per unit (orthographic), in x and y.
    pub scale: Vec2,
    /// Raster position of the camera axis, pixels.
    pub centre: Vec2,
    /// Orthographic instead of perspective.
    pub orthographic: bool,
    /// Nearest depth used for measuring: things nearer are measured as if here. Positive.
    pub near: f32,
    /// Raster size in pixels; what lies outside is diced more coarsely.
    pub size: Vec2,
}

#[derive(Clone, Copy, Debug)]
struct LocalView {
    rotation: Mat3,
    translation: Vec3,
    view: RasterView,
}

/// Measures segments in pixels at each output key.
#[derive(Clone, Debug)]
pub struct RasterMetric {
    views: Vec<LocalView>,
    uniform: f32,
}

impl RasterMetric {
    /// Measures positions that are relative to `origin` (world space): `views[k]` is the camera at
    /// the time of output key `k`.
    pub fn new(views: &[RasterView], origin: DVec3) -> Self {
        let views = views
            .iter()
            .map(|view| {
                let m = &view.world_to_camera;
                LocalView {
                    rotation: m.matrix3.as_mat3(),
                    translation: m.transform_point3(origin).as_vec3(),
                    view: *view,
                }
            })
            .collect();
        Self {
            views,
            uniform: 0.0,
        }
    }

    /// Measures in a fixed scale, in pixels per unit, everywhere (instanced prototypes: the scale of
    /// the largest instance on screen).
    pub fn uniform(pixels_per_unit: f32) -> Self {
        Self {
            views: Vec::new(),
            uniform: pixels_per_unit,
        }
    }

    /// Raster length of the segment from `a` to `b` at output key `key`, in pixels. Foreshortened
    /// as seen, except nearer than the near depth, where depth is clamped. Never NaN.
    pub fn length(&self, key: usize, a: Vec3, b: Vec3) -> f32 {
        let Some(local) = self.views.get(key) else {
            return (b - a).length() * self.uniform;
        };
        let (a, b) = (local.to_camera(a), local.to_camera(b));
        let view = &local.view;
        if view.orthographic {
            return ((b - a).truncate() * view.scale).length();
        }
        let (da, db) = (-a.z, -b.z);
        if da >= view.near && db >= view.near {
            return ((b.truncate() / db - a.truncate() / da) * view.scale).length();
        }
        (b - a).length() * view.scale.max_element() / da.min(db).max(view.near)
    }
}

impl LocalView {
    fn to_camera(self, p: Vec3) -> Vec3 {
        self.rotation * p + self.translation
    }
}
