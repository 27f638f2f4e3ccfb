//! First shading: displayColor and displayOpacity, lit by a light that rides on the camera.
//!
//! The light is the one that hosts put at the camera when a scene has none: a distant light along the
//! view direction, 0.53 degrees wide, of radiance 15000, without shadows. Surfaces are Lambertian and
//! lit from both sides: outgoing radiance = albedo / pi * irradiance * |cos|.

use std::f32::consts::PI;

use glam::Vec3;

use crate::translate::primvar::Resolved;

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

/// Where a shading value comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum Source {
    /// One value for the prim.
    Constant([f32; 3]),
    /// `width` floats for each authored face.
    Uniform {
        /// Floats a face: 1 or 3.
        width: usize,
        /// The values.
        values: Vec<f32>,
    },
    /// Channel of the diced mesh.
    Channel(usize),
}

impl Source {
    /// The source of a resolved primvar; channels go to `channels` and are numbered there.
    pub fn from_resolved(
        resolved: Resolved,
        width: usize,
        channels: &mut Vec<crate::surface::Channel>,
    ) -> Self {
        match resolved {
            Resolved::Constant(v) => Source::Constant(spread(&v)),
            Resolved::Uniform(values) => Source::Uniform { width, values },
            Resolved::Channel(data) => {
                channels.push(data.into());
                Source::Channel(channels.len() - 1)
            }
        }
    }

    /// The value on `element`; `channel` evaluates a channel at the hit. One float fills all three.
    pub fn value(&self, element: u32, channel: impl FnOnce(usize) -> [f32; 3]) -> [f32; 3] {
        match self {
            Source::Constant(v) => *v,
            Source::Uniform { width, values } => {
                let start = element as usize * width;
                values.get(start..start + width).map_or([0.0; 3], spread)
            }
            Source::Channel(i) => channel(*i),
        }
    }
}

/// One float to three, or three as they are.
fn spread(v: &[f32]) -> [f32; 3] {
    match v {
        [x] => [*x; 3],
        [x, y, z, ..] => [*x, *y, *z],
        _ => [0.0; 3],
    }
}

/// What shading needs to know of one prim.
#[derive(Clone, Debug, PartialEq)]
pub struct PrimShading {
    /// Albedo.
    pub color: Source,
    /// Opacity; `None` where the prim is opaque all over.
    pub opacity: Option<Source>,
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

    #[test]
    fn sources_spread_and_stay_in_range() {
        let uniform = Source::Uniform {
            width: 1,
            values: vec![0.25, 0.5],
        };
        assert_eq!(uniform.value(1, |_| unreachable!()), [0.5; 3]);
        assert_eq!(uniform.value(9, |_| unreachable!()), [0.0; 3]);
        assert_eq!(Source::Channel(4).value(0, |i| [i as f32; 3]), [4.0; 3]);
    }
}
