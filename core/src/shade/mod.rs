//! First shading: displayColor and displayOpacity, lit by a light that rides on the camera.
//!
//! The light is the one that hosts put at the camera when a scene has none: a distant light along the
//! view direction, 0.53 degrees wide, of radiance 15000, without shadows. Surfaces are Lambertian and
//! lit from both sides: outgoing radiance = albedo / pi * irradiance * |cos|.

use std::f32::consts::PI;
use std::sync::Arc;

use glam::Vec3;

mod source;

pub use source::{ChannelAccess, Source, Values};

/// Radiance of the camera light.
const CAMERA_LIGHT_RADIANCE: f64 = 15_000.0;
/// Its angular diameter in degrees.
const CAMERA_LIGHT_ANGLE: f64 = 0.53;
/// Albedo of a surface without displayColor (UsdPreviewSurface's diffuseColor).
pub const DEFAULT_ALBEDO: [f32; 3] = [0.18; 3];

/// Irradiance of the camera light on a surface that faces it: radiance times solid angle, about 1.
pub fn camera_light_irradiance() -> f32 {
    let half = (CAMERA_LIGHT_ANGLE / 2.0).to_radians();
    (CAMERA_LIGHT_RADIANCE * std::f64::consts::TAU * (1.0 - half.cos())) as f32
}

/// Radiance towards the camera of a surface with `albedo` and unit normal `n_eye` (camera space).
pub fn camera_lit(albedo: Vec3, n_eye: Vec3, irradiance: f32) -> Vec3 {
    albedo * (irradiance / PI * n_eye.z.abs())
}

/// What shading needs to know of one prim.
#[derive(Clone, Debug, PartialEq)]
pub struct PrimShading {
    /// Albedo.
    pub color: Arc<Source>,
    /// Opacity; `None` where the prim is opaque all over.
    pub opacity: Option<Arc<Source>>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_camera_light_gives_about_unit_irradiance() {
        assert!((camera_light_irradiance() - 1.0079).abs() < 1e-3);
        let lit = camera_lit(Vec3::ONE, Vec3::new(0.0, 0.6, -0.8), 1.0);
        assert!((lit.x - 0.8 / PI).abs() < 1e-6, "both sides are lit");
    }
}
