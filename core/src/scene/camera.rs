//! A camera as hosts describe it.

use super::TransformSamples;

/// Projection.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Projection {
    /// Perspective.
    #[default]
    Perspective,
    /// Orthographic; apertures are the size of the view in scene units.
    Orthographic,
}

/// A thin-lens camera that looks down its local -z with +y up. All lengths are scene units
/// (UsdGeomCamera's apertures and focal length are tenths: multiply by 0.1).
#[derive(Clone, Debug, PartialEq)]
pub struct CameraDesc {
    /// Path, for messages and metadata.
    pub path: String,
    /// Camera to world, the camera's own level first.
    pub transform: Vec<TransformSamples>,
    /// Projection.
    pub projection: Projection,
    /// Width of the film back.
    pub horizontal_aperture: f64,
    /// Height of the film back.
    pub vertical_aperture: f64,
    /// Offset of the film back to the right.
    pub horizontal_aperture_offset: f64,
    /// Offset of the film back upwards.
    pub vertical_aperture_offset: f64,
    /// Focal length.
    pub focal_length: f64,
    /// Distance from the lens to the plane in focus.
    pub focus_distance: f64,
    /// f-number; 0 is a pinhole. Lens radius = focal_length / (2 f_stop).
    pub f_stop: f64,
    /// Near and far clipping depth.
    pub clipping: [f64; 2],
    /// Shutter open and close, time codes relative to the frame.
    pub shutter: [f64; 2],
    /// Linear factor on radiance (2^EV); 1 for none.
    pub exposure_scale: f64,
}

impl Default for CameraDesc {
    /// UsdGeomCamera's fallbacks, in scene units.
    fn default() -> Self {
        Self {
            path: String::new(),
            transform: Vec::new(),
            projection: Projection::Perspective,
            horizontal_aperture: 2.0955,
            vertical_aperture: 1.52908,
            horizontal_aperture_offset: 0.0,
            vertical_aperture_offset: 0.0,
            focal_length: 5.0,
            focus_distance: 0.0,
            f_stop: 0.0,
            clipping: [1.0, 1_000_000.0],
            shutter: [0.0, 0.0],
            exposure_scale: 1.0,
        }
    }
}
