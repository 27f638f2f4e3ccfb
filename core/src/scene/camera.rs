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

/// The shape of the lens' opening. Whatever the shape, its area is that of the round opening of the
/// same f-number, so that blades and squeezing change the look of a blur and not its amount.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ApertureDesc {
    /// Blades, that is corners; below 3 the opening is round.
    pub blades: u32,
    /// Degrees by which the blades are turned, counter-clockwise as the camera looks; at 0 a corner
    /// points up. A light behind the plane in focus shows the opening so, one before it upside down.
    pub rotation: f64,
    /// Width over height, after turning: 0.5 for the upright ovals of a two-fold anamorphic lens.
    pub ratio: f64,
    /// 0: the blades' edges are straight; 1: they are arcs of one circle; between: flatter arcs.
    pub roundness: f64,
}

impl Default for ApertureDesc {
    /// Round.
    fn default() -> Self {
        Self {
            blades: 0,
            rotation: 0.0,
            ratio: 1.0,
            roundness: 0.0,
        }
    }
}

/// How the points of a shutter's curve are joined.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ShutterCurveKind {
    /// By straight lines.
    #[default]
    Linear,
    /// By cubic Bezier segments: 3 n + 1 points, of which every third is on the curve.
    Bezier,
}

/// How open the shutter is over its interval. It says which instants count how much, not how bright
/// the image is: only ratios of openness matter.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShutterCurveDesc {
    /// Joins.
    pub kind: ShutterCurveKind,
    /// Position (0 where the shutter opens, 1 where it closes, ascending) and openness (0 or above).
    /// Before the first and after the last position openness holds. No points: fully open
    /// throughout.
    pub points: Vec<[f64; 2]>,
}

/// Lens, film back and exposure at one instant; fields as in [`CameraDesc`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs)] // as in CameraDesc
pub struct LensSample {
    /// Time codes relative to the frame.
    pub time: f64,
    pub horizontal_aperture: f64,
    pub vertical_aperture: f64,
    pub horizontal_aperture_offset: f64,
    pub vertical_aperture_offset: f64,
    pub focal_length: f64,
    pub focus_distance: f64,
    pub f_stop: f64,
    pub exposure_scale: f64,
}

impl LensSample {
    /// Every number on the straight line to `other`, `f` of the way.
    pub fn lerp(&self, other: &Self, f: f64) -> Self {
        let mix = |a: f64, b: f64| a + (b - a) * f;
        Self {
            time: mix(self.time, other.time),
            horizontal_aperture: mix(self.horizontal_aperture, other.horizontal_aperture),
            vertical_aperture: mix(self.vertical_aperture, other.vertical_aperture),
            horizontal_aperture_offset: mix(
                self.horizontal_aperture_offset,
                other.horizontal_aperture_offset,
            ),
            vertical_aperture_offset: mix(
                self.vertical_aperture_offset,
                other.vertical_aperture_offset,
            ),
            focal_length: mix(self.focal_length, other.focal_length),
            focus_distance: mix(self.focus_distance, other.focus_distance),
            f_stop: mix(self.f_stop, other.f_stop),
            exposure_scale: mix(self.exposure_scale, other.exposure_scale),
        }
    }
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
    /// Shape of the lens' opening.
    pub aperture: ApertureDesc,
    /// How the shutter opens and closes.
    pub shutter_curve: ShutterCurveDesc,
    /// Planes (a, b, c, d) in camera space: points with a x + b y + c z + d < 0 are not seen.
    pub clipping_planes: Vec<[f64; 4]>,
    /// The lens at several instants, in any order, in place of the fields above where there are any:
    /// rack focus and zoom. Each number is interpolated linearly, and held outside.
    pub lens_samples: Vec<LensSample>,
}

impl CameraDesc {
    /// The fields that a [`LensSample`] has, as one at the frame's own time.
    pub fn lens(&self) -> LensSample {
        LensSample {
            time: 0.0,
            horizontal_aperture: self.horizontal_aperture,
            vertical_aperture: self.vertical_aperture,
            horizontal_aperture_offset: self.horizontal_aperture_offset,
            vertical_aperture_offset: self.vertical_aperture_offset,
            focal_length: self.focal_length,
            focus_distance: self.focus_distance,
            f_stop: self.f_stop,
            exposure_scale: self.exposure_scale,
        }
    }
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
            aperture: ApertureDesc::default(),
            shutter_curve: ShutterCurveDesc::default(),
            clipping_planes: Vec::new(),
            lens_samples: Vec::new(),
        }
    }
}
