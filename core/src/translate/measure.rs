//! How large a prim is on screen: pixels per unit, the tolerance of its path, the views that dicing
//! measures with.

use glam::{DAffine3, DVec3, Vec3};

use crate::camera::Camera;
use crate::dice::RasterView;
use crate::dice::metric::OFF_SCREEN;

/// Farthest that a chord of a path may be from the path, in pixels: well below what a pixel filter
/// can show.
pub const CHORD_TOLERANCE: f64 = 0.1;

/// An axis-aligned box in object space, over all point keys.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObjectBounds {
    /// Least corner.
    pub min: DVec3,
    /// Greatest corner.
    pub max: DVec3,
}

impl ObjectBounds {
    /// Box of the finite points at every key.
    pub fn of(points: &[Vec<Vec3>]) -> Self {
        let mut min = DVec3::INFINITY;
        let mut max = DVec3::NEG_INFINITY;
        for p in points.iter().flatten().filter(|p| p.is_finite()) {
            min = min.min(p.as_dvec3());
            max = max.max(p.as_dvec3());
        }
        Self { min, max }
    }

    /// Centre.
    pub fn centre(&self) -> DVec3 {
        (self.min + self.max) * 0.5
    }

    /// Radius of the sphere around the box.
    pub fn radius(&self) -> f64 {
        (self.max - self.min).length() * 0.5
    }

    /// The eight corners.
    pub fn corners(&self) -> Vec<DVec3> {
        let pick = |i: u32, bit: u32, lo: f64, hi: f64| if i & bit == 0 { lo } else { hi };
        (0..8)
            .map(|i| {
                DVec3::new(
                    pick(i, 1, self.min.x, self.max.x),
                    pick(i, 2, self.min.y, self.max.y),
                    pick(i, 4, self.min.z, self.max.z),
                )
            })
            .collect()
    }
}

/// Pixels per object-space unit at the nearest depth of a sphere around `bounds` placed by `matrix`,
/// seen by `view`. Depth is clamped to the near depth and to a twentieth of the sphere's radius: a
/// camera inside an object would otherwise ask for boundless detail.
pub fn pixels_per_unit(view: &RasterView, matrix: &DAffine3, bounds: &ObjectBounds) -> f64 {
    let scale = largest_scale(matrix);
    let pixels = f64::from(view.scale.max_element());
    if view.orthographic {
        return pixels * scale;
    }
    let centre = view
        .world_to_camera
        .transform_point3(matrix.transform_point3(bounds.centre()));
    let radius = bounds.radius() * scale;
    let depth = (-centre.z - radius)
        .max(f64::from(view.near))
        .max(radius * 0.05);
    pixels * scale / depth
}

/// Pixels per object-space unit of one of many instances. Those outside of the image must not decide
/// how finely all are diced: they count less, and by their distance rather than their depth.
pub fn instance_pixels(view: &RasterView, matrix: &DAffine3, bounds: &ObjectBounds) -> f64 {
    let centre = view
        .world_to_camera
        .transform_point3(matrix.transform_point3(bounds.centre()));
    let scale = largest_scale(matrix);
    if view.may_show(centre, bounds.radius() * scale) {
        return pixels_per_unit(view, matrix, bounds);
    }
    let pixels = f64::from(view.scale.max_element()) * scale * f64::from(OFF_SCREEN);
    match view.orthographic {
        true => pixels,
        false => pixels / centre.length().max(f64::from(view.near)),
    }
}

/// Longest axis of a matrix: no direction is stretched by more than sqrt(3) times this.
pub fn largest_scale(m: &DAffine3) -> f64 {
    let (x, y, z) = (m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis);
    x.length().max(y.length()).max(z.length())
}

/// The camera's views for each of a path's key times. Every key of the camera's own motion is given
/// to the nearest key of the path, so that a thing at rest is measured over the whole shutter too.
pub fn views_at_keys(camera: &Camera, key_times: &[f32]) -> Vec<Vec<RasterView>> {
    let mut views: Vec<Vec<RasterView>> = key_times
        .iter()
        .map(|&t| vec![camera.raster_view(f64::from(t))])
        .collect();
    for &time in camera.key_times() {
        let distance = |k: &usize| (f64::from(key_times[*k]) - time).abs();
        let nearest = (0..key_times.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
        if let Some(k) = nearest.filter(|k| distance(k) > 1.0e-6) {
            views[k].push(camera.raster_view(time));
        }
    }
    views
}
