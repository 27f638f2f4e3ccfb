//! The camera of one render: where it is at each instant, its window, its lens.
//!
//! Camera space: x right, y up, looking down -z; depth is `-z`. Raster space: x right, **y down**,
//! pixel (i, j) covers [i, i+1) x [j, j+1), origin at the image's top left.
//!
//! Rays leave the lens towards the plane in focus with `dir.z = -1` in camera space, so that the ray
//! parameter `t` *is* depth, and the clipping range is the ray's range.

pub mod pose;
pub mod window;

use glam::{DAffine3, DVec3, Mat3, Vec2, Vec3};

use crate::dice::RasterView;
use crate::motion::{Shutter, TransformError};
use crate::scene::{CameraDesc, Projection, RenderSettings};
use crate::trace::Ray;
use pose::Poses;
use window::Window;

/// Smallest near clip that is used, relative to the far clip or one unit: f32 depth has 24 bits, so
/// a nearer near plane would only lose depth precision.
const SMALLEST_NEAR: f64 = 1.0e-6;

/// A camera resolved to a shutter, an image size and the settings.
#[derive(Clone, Debug)]
pub struct Camera {
    poses: Poses,
    origin: DVec3,
    /// The pose relative to `origin` in f32, for a camera that stands still.
    fixed: Option<(Mat3, Vec3)>,
    projection: Projection,
    window: Window,
    resolution: [u32; 2],
    lens_radius: f32,
    focus_distance: f32,
    clipping: [f32; 2],
    exposure_scale: f32,
}

/// What was odd about a camera, as sentences for warnings.
pub type CameraNotes = Vec<String>;

impl Camera {
    /// Resolves `desc` for `settings` over `shutter`.
    ///
    /// # Errors
    /// A transform that is not finite.
    pub fn new(
        desc: &CameraDesc,
        settings: &RenderSettings,
        shutter: Shutter,
    ) -> Result<(Self, CameraNotes), TransformError> {
        let mut notes = Vec::new();
        let poses = Poses::new(&desc.transform, shutter)?;
        if poses.is_singular() {
            let text = "its transform cannot be inverted; it looks along the world's -z";
            notes.push(text.to_owned());
        }
        let origin = poses.at(0.5).translation;
        let (clipping, note) = usable_clipping(desc.clipping);
        notes.extend(note);
        let (window, note) = Window::new(desc, settings);
        notes.extend(note);
        let (lens_radius, note) = lens_radius(desc, settings);
        notes.extend(note);
        let fixed = (!poses.is_moving()).then(|| {
            let m = poses.at(0.0);
            (m.matrix3.as_mat3(), (m.translation - origin).as_vec3())
        });
        let focus = desc.focus_distance;
        let camera = Self {
            poses,
            origin,
            fixed,
            projection: desc.projection,
            window,
            resolution: settings.resolution,
            lens_radius,
            focus_distance: if focus.is_finite() && focus > 0.0 {
                focus as f32
            } else {
                1.0
            },
            clipping,
            exposure_scale: usable_exposure(desc.exposure_scale, &mut notes),
        };
        Ok((camera, notes))
    }

    /// What world-space rays are relative to: the camera's position in the middle of the shutter.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Radius of the lens, scene units; 0 for a pinhole.
    pub fn lens_radius(&self) -> f32 {
        self.lens_radius
    }

    /// Depth in focus, scene units.
    pub fn focus_distance(&self) -> f32 {
        self.focus_distance
    }

    /// Near and far clipping depth, scene units.
    pub fn clipping(&self) -> [f32; 2] {
        self.clipping
    }

    /// Linear factor on radiance.
    pub fn exposure_scale(&self) -> f32 {
        self.exposure_scale
    }

    /// True when the camera moves within the shutter.
    pub fn is_moving(&self) -> bool {
        self.poses.is_moving()
    }

    /// Key times of the camera's motion; `[0]` when it stands still.
    pub fn key_times(&self) -> &[f64] {
        self.poses.key_times()
    }

    /// Camera to world at `time`, rotation and position relative to [`Camera::origin`].
    pub fn pose(&self, time: f32) -> (Mat3, Vec3) {
        self.fixed.unwrap_or_else(|| {
            let m = self.poses.at(f64::from(time));
            (m.matrix3.as_mat3(), (m.translation - self.origin).as_vec3())
        })
    }

    /// The ray through raster position `raster` (pixels) and lens point `lens` (unit disk) at `time`.
    /// World space relative to [`Camera::origin`]; `t` is depth.
    pub fn ray(&self, raster: Vec2, lens: Vec2, time: f32) -> Ray {
        let at = self.window.point(raster / self.size());
        let lens = lens * self.lens_radius;
        // The ray goes from the lens through the point in focus; both relative to the axis.
        let (from, dir) = match self.projection {
            Projection::Perspective => (lens, at - lens / self.focus_distance),
            Projection::Orthographic => (at + lens, -lens / self.focus_distance),
        };
        let (rotation, position) = self.pose(time);
        Ray {
            origin: rotation * from.extend(0.0) + position,
            dir: rotation * dir.extend(-1.0),
            time,
            t_min: self.clipping[0],
            t_max: self.clipping[1],
        }
    }

    /// Raster position of a world-space point (relative to [`Camera::origin`]) at `time`; `None`
    /// behind the camera.
    pub fn project(&self, p: Vec3, time: f32) -> Option<Vec2> {
        let p = self.to_camera(p, time);
        let at = match self.projection {
            Projection::Perspective if p.z < 0.0 => p.truncate() / -p.z,
            Projection::Perspective => return None,
            Projection::Orthographic => p.truncate(),
        };
        Some(self.window.unit(at) * self.size())
    }

    /// Camera-space position of a world-space point (relative to [`Camera::origin`]) at `time`.
    pub fn to_camera(&self, p: Vec3, time: f32) -> Vec3 {
        let (rotation, position) = self.pose(time);
        rotation.inverse() * (p - position)
    }

    /// Camera-space direction of a world-space normal at `time`, unit length.
    pub fn normal_to_camera(&self, n: Vec3, time: f32) -> Vec3 {
        let (rotation, _) = self.pose(time);
        (rotation.transpose() * n).normalize_or_zero()
    }

    /// Clip-space depth of a camera-space depth: 0 at the near clip, 1 at the far clip.
    pub fn clip_depth(&self, depth: f32) -> f32 {
        let [near, far] = self.clipping.map(f64::from);
        let d = f64::from(depth);
        let z = match self.projection {
            Projection::Perspective => far * (d - near) / (d * (far - near)),
            Projection::Orthographic => (d - near) / (far - near),
        };
        z.clamp(0.0, 1.0) as f32
    }

    /// The camera at `time` as dicing sees it.
    pub fn raster_view(&self, time: f64) -> RasterView {
        let camera_to_world: DAffine3 = self.poses.at(time);
        let size = self.size();
        RasterView {
            world_to_camera: camera_to_world.inverse(),
            scale: size / self.window.size(),
            centre: self.window.unit(Vec2::ZERO) * size,
            orthographic: self.projection == Projection::Orthographic,
            near: self.clipping[0],
            size,
        }
    }

    fn size(&self) -> Vec2 {
        Vec2::new(self.resolution[0] as f32, self.resolution[1] as f32)
    }
}

fn usable_clipping(clipping: [f64; 2]) -> ([f32; 2], Option<String>) {
    let [near, far] = clipping;
    if near.is_finite() && !far.is_nan() && far > near.max(0.0) {
        let far = far.clamp(1.0e-30, 1.0e30);
        // A near clip of 0 has no clip-space depth: take the nearest that f32 depth can tell apart.
        let near = near.max(far.min(1.0) * SMALLEST_NEAR);
        return ([near as f32, far as f32], None);
    }
    let text = format!("clippingRange ({near}, {far}) is empty; (1, 1000000) is used");
    ([1.0, 1_000_000.0], Some(text))
}

fn lens_radius(desc: &CameraDesc, settings: &RenderSettings) -> (f32, Option<String>) {
    if settings.disable_defocus || desc.f_stop == 0.0 {
        return (0.0, None);
    }
    let radius = desc.focal_length / (2.0 * desc.f_stop);
    if !(radius.is_finite() && radius > 0.0) {
        let text = format!(
            "fStop {} with focal length {} gives no lens; a pinhole is used",
            desc.f_stop, desc.focal_length
        );
        return (0.0, Some(text));
    }
    if !(desc.focus_distance.is_finite() && desc.focus_distance > 0.0) {
        let text = format!(
            "fStop is {} but focusDistance is {}; with no distance in focus, a pinhole is used",
            desc.f_stop, desc.focus_distance
        );
        return (0.0, Some(text));
    }
    (radius as f32, None)
}

fn usable_exposure(scale: f64, notes: &mut CameraNotes) -> f32 {
    if scale.is_finite() && scale >= 0.0 {
        return scale as f32;
    }
    notes.push(format!("exposure scale {scale} is not usable; 1 is used"));
    1.0
}

/// Unit square to unit disk, keeping strata together (Shirley and Chiu, "A Low Distortion Map
/// Between Disk and Square", JGT 1997).
pub fn concentric_disk(u: f32, v: f32) -> Vec2 {
    use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};
    let p = Vec2::new(2.0 * u - 1.0, 2.0 * v - 1.0);
    if p == Vec2::ZERO {
        return Vec2::ZERO;
    }
    let (r, angle) = if p.x.abs() > p.y.abs() {
        (p.x, FRAC_PI_4 * (p.y / p.x))
    } else {
        (p.y, FRAC_PI_2 - FRAC_PI_4 * (p.x / p.y))
    };
    Vec2::new(angle.cos(), angle.sin()) * r
}

#[cfg(test)]
mod tests;
