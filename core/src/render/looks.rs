//! How instances look, for those that shade elsewhere: on a GPU.

use super::prepared::Prepared;
use crate::aov::Aov;
use crate::shade::{Source, Values, camera_light_irradiance};
use crate::trace::Hit;

/// How one instance looks.
#[derive(Clone, Copy, Debug)]
pub struct Look<'a> {
    /// See [`crate::scene::PrimCommon::matte`].
    pub matte: bool,
    /// Its colour.
    pub color: Paint<'a>,
    /// Its opacity; nothing where it is opaque all over.
    pub opacity: Option<Paint<'a>>,
}

/// What one instance has of a source.
#[derive(Clone, Copy, Debug)]
pub struct Paint<'a> {
    /// The source.
    pub source: &'a Source,
    /// Which of an instancer's values it has, where these are [`Values::Instance`].
    pub item: usize,
}

impl Prepared {
    /// Why samples must be shaded and filmed here, in words. The one place that says so.
    pub fn shaded_here(&self) -> Option<String> {
        if self.camera.lens_changes() {
            return Some("the lens changes while the shutter is open".to_owned());
        }
        let is_here = |aov: &&Aov| {
            matches!(
                aov,
                Aov::Normal | Aov::Neye | Aov::MotionVectors | Aov::Primvar(_)
            )
        };
        let aov = self.aovs.iter().find(is_here);
        aov.map(|aov| format!("the AOV {} is asked for", aov.name()))
    }

    /// How instance number `instance` of the world looks.
    pub fn look(&self, instance: u32) -> Look<'_> {
        let hit = Hit {
            instance,
            ..Hit::MISS
        };
        let (_, prim) = self.hit_prim(&hit);
        let paint = |source| {
            let item = match Source::values(source) {
                Values::Instance(level, _) => self.instance(&hit, *level),
                _ => 0,
            };
            Paint { source, item }
        };
        Look {
            matte: prim.matte,
            color: paint(&prim.shading.color),
            opacity: prim.shading.opacity.as_deref().map(paint),
        }
    }

    /// Irradiance of the light that rides on the camera, exposed.
    pub fn irradiance(&self) -> f32 {
        let irradiance = match self.plan.camera_light {
            true => camera_light_irradiance(),
            false => 0.0,
        };
        irradiance * self.camera.exposure_scale()
    }
}
