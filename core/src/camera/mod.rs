//! The camera of one render: where it is at each instant, its window, its lens.
//!
//! Camera space: x right, y up, looking down -z; depth is `-z`. Raster space: x right, **y down**,
//! pixel (i, j) covers [i, i+1) x [j, j+1), origin at the image's top left.
//!
//! Rays leave the lens towards the plane in focus with `dir.z = -1` in camera space, so that the ray
//! parameter `t` *is* depth, and the clipping range is the ray's range.

//!
//! What a camera does not use costs nothing: the lens is one set of numbers unless it changes while
//! the shutter is open, a round opening and an even shutter have no tables, and no clipping plane is
//! no test.

pub mod aperture;
pub mod clip;
pub mod lens;
pub mod opening;
pub mod pose;
pub mod projector;
pub mod window;

use glam::{DAffine3, DVec3, Mat3, Vec2, Vec3};

use crate::diagnostics::number;
use crate::dice::RasterView;
use crate::motion::{Shutter, TransformError, keys};
use crate::scene::{CameraDesc, Projection, RenderSettings};
use crate::trace::Ray;
use aperture::Aperture;
pub use aperture::concentric_disk;
use clip::ClippingPlanes;
use lens::{Lens, LensPath};
use opening::Opening;
use pose::Poses;
pub use projector::Projector;

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
    /// Key times of pose and lens.
    key_times: Vec<f64>,
    projection: Projection,
    resolution: [u32; 2],
    /// Corners of the pixels to render.
    data_window: [Vec2; 2],
    /// The lens when the shutter opens.
    lens: Lens,
    /// Where the lens changes while the shutter is open.
    lens_path: Option<LensPath>,
    aperture: Aperture,
    opening: Option<Opening>,
    clipping: [f32; 2],
    planes: ClippingPlanes,
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
        let planes = ClippingPlanes::new(&desc.clipping_planes, &mut notes);
        let (lens, lens_path) = lens::resolve(desc, settings, shutter, &mut notes);
        let aperture = Aperture::new(&desc.aperture, &mut notes);
        let opening = Opening::new(&desc.shutter_curve, &mut notes);
        let fixed = (!poses.is_moving()).then(|| {
            let m = poses.at(0.0);
            (m.matrix3.as_mat3(), (m.translation - origin).as_vec3())
        });
        let lens_keys = lens_path.as_ref().map_or(&[][..], LensPath::key_times);
        let key_times = keys::union([poses.key_times(), lens_keys]);
        let [width, height] = settings.resolution;
        let whole = [0, 0, width as i32, height as i32];
        let [x0, y0, x1, y1] = settings.data_window.unwrap_or(whole).map(|x| x as f32);
        let camera = Self {
            poses,
            origin,
            fixed,
            key_times,
            projection: desc.projection,
            resolution: settings.resolution,
            data_window: [Vec2::new(x0, y0), Vec2::new(x1, y1)],
            lens,
            lens_path,
            aperture,
            opening,
            clipping,
            planes,
        };
        Ok((camera, notes))
    }

    /// What world-space rays are relative to: the camera's position in the middle of the shutter.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Radius of the lens, scene units, the largest while the shutter is open; 0 for a pinhole.
    pub fn lens_radius(&self) -> f32 {
        let radii = self.key_times.iter().map(|&t| self.lens(t as f32).radius);
        radii.fold(0.0, f32::max)
    }

    /// The lens at `time`.
    #[inline]
    pub fn lens(&self, time: f32) -> Lens {
        match &self.lens_path {
            None => self.lens,
            Some(path) => path.at(time),
        }
    }

    /// True when the lens, the film back or the exposure changes while the shutter is open.
    pub fn lens_changes(&self) -> bool {
        self.lens_path.is_some()
    }

    /// Its path where it does.
    pub fn lens_path(&self) -> Option<&LensPath> {
        self.lens_path.as_ref()
    }

    /// The point of the lens' opening for a point of the unit square, in units of the lens' radius.
    #[inline]
    pub fn lens_point(&self, u: f32, v: f32) -> Vec2 {
        self.aperture.point(u, v)
    }

    /// The shutter's opening; `None` where it is equally open throughout.
    pub fn opening(&self) -> Option<&Opening> {
        self.opening.as_ref()
    }

    /// Near and far clipping depth, scene units.
    pub fn clipping(&self) -> [f32; 2] {
        self.clipping
    }

    /// Linear factor on radiance that all samples have: 1 where the lens changes, see
    /// [`Camera::lens`].
    pub fn exposure_scale(&self) -> f32 {
        if self.lens_changes() {
            1.0
        } else {
            self.lens.exposure
        }
    }

    /// True when the camera or its lens changes within the shutter.
    pub fn is_moving(&self) -> bool {
        self.poses.is_moving() || self.lens_changes()
    }

    /// Key times of the camera's motion and of its lens; `[0]` when nothing of it changes.
    pub fn key_times(&self) -> &[f64] {
        &self.key_times
    }

    /// How rays leave.
    pub fn projection(&self) -> Projection {
        self.projection
    }

    /// Its opening's shape.
    pub fn aperture(&self) -> &Aperture {
        &self.aperture
    }

    /// Its own planes, beside the clipping range.
    pub fn planes(&self) -> &ClippingPlanes {
        &self.planes
    }

    /// Its poses over the shutter.
    pub fn poses(&self) -> &Poses {
        &self.poses
    }

    /// Width and height of the image in pixels.
    pub fn resolution(&self) -> [u32; 2] {
        self.resolution
    }

    /// Camera to world at `time`, rotation and position relative to [`Camera::origin`].
    #[inline]
    pub fn pose(&self, time: f32) -> (Mat3, Vec3) {
        self.fixed.unwrap_or_else(|| {
            let m = self.poses.at(f64::from(time));
            (m.matrix3.as_mat3(), (m.translation - self.origin).as_vec3())
        })
    }

    /// The ray through raster position `raster` (pixels) and lens point `lens` (in units of the
    /// lens' radius) at `time`. World space relative to [`Camera::origin`]; `t` is depth.
    #[inline]
    pub fn ray(&self, raster: Vec2, lens: Vec2, time: f32) -> Ray {
        self.ray_through::<true>(raster, lens, time)
    }

    /// [`Camera::ray`] through the middle of the lens, for cameras that have none.
    #[inline]
    pub fn pinhole_ray(&self, raster: Vec2, time: f32) -> Ray {
        self.ray_through::<false>(raster, Vec2::ZERO, time)
    }

    #[inline]
    fn ray_through<const LENS: bool>(&self, raster: Vec2, lens: Vec2, time: f32) -> Ray {
        let now = self.lens(time);
        let at = now.window.point(raster / self.size());
        let (from, dir) = if LENS {
            let lens = lens * now.radius;
            // The ray goes from the lens through the point in focus; both relative to the axis.
            match self.projection {
                Projection::Perspective => (lens, at - lens / now.focus_distance),
                Projection::Orthographic => (at + lens, -lens / now.focus_distance),
            }
        } else {
            match self.projection {
                Projection::Perspective => (Vec2::ZERO, at),
                Projection::Orthographic => (at, Vec2::ZERO),
            }
        };
        let (from, dir) = (from.extend(0.0), dir.extend(-1.0));
        let mut range = self.clipping;
        if !self.planes.is_empty() {
            range = self.planes.clip(from, dir, range);
        }
        let (rotation, position) = self.pose(time);
        Ray {
            origin: rotation * from + position,
            dir: rotation * dir,
            time,
            t_min: range[0],
            t_max: range[1],
        }
    }

    /// Where points are in the image at `time`.
    pub fn projector(&self, time: f32) -> Projector {
        let (rotation, position) = self.pose(time);
        Projector {
            projection: self.projection,
            rotation: rotation.inverse(),
            position,
            window: self.lens(time).window,
            size: self.size(),
        }
    }

    /// Camera-space direction of a world-space normal at `time`, unit length.
    #[inline]
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
        let window = self.lens(time as f32).window;
        let mut view = RasterView {
            world_to_camera: camera_to_world.inverse(),
            scale: size / window.size(),
            centre: window.unit(Vec2::ZERO) * size,
            orthographic: self.projection == Projection::Orthographic,
            near: self.clipping[0],
            size,
        };
        view.widen(self.data_window);
        view
    }

    #[inline]
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
    let ends = [near, far].map(number).join(", ");
    let text = format!("clippingRange ({ends}) is empty; (1, 1000000) is used");
    ([1.0, 1_000_000.0], Some(text))
}

#[cfg(test)]
mod tests;
