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
    pub color: &'a Source,
    /// Which of an instancer's colours it has, where these are [`Values::Instance`].
    pub item: usize,
}

impl Prepared {
    /// Why samples must be shaded and filmed here, in words: elsewhere knows first hits of what is opaque, and no more. The
    /// one place that says so.
    pub fn shaded_here(&self) -> Option<String> {
        let plan = &self.plan;
        if let Some(path) = &plan.transparency_by {
            return Some(format!("{path} is not opaque"));
        }
        if let Some(path) = &plan.culled_by {
            return Some(format!("rays pass through a side of {path}"));
        }
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
        let color = &*prim.shading.color;
        let item = match color.values() {
            Values::Instance(level, _) => self.instance(&hit, *level),
            _ => 0,
        };
        Look {
            matte: prim.matte,
            color,
            item,
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
