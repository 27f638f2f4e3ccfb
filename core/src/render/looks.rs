//! How instances look, for those that shade elsewhere: on a GPU.

use super::prepared::{Prepared, SetEntry};
use crate::aov::Aov;
use crate::film::tile::{Keeps, MeanValues};
use crate::shade::{Source, Values, camera_light_irradiance};
use crate::trace::{Hit, Winding};

/// How one instance looks.
#[derive(Clone, Copy, Debug)]
pub struct Look<'a> {
    /// See [`crate::scene::PrimCommon::matte`].
    pub matte: bool,
    /// See [`crate::scene::PrimCommon::double_sided`].
    pub double_sided: bool,
    /// The front of its surfaces is the back of its lattices: normals of these point there.
    pub inverted: bool,
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
        if let Some(name) = self.mixed_primvar() {
            return Some(format!("some values of the AOV {name} are whole numbers"));
        }
        let values = self.mean_values();
        let turns = |entry: &SetEntry| matches!(entry.facets, Winding::Changes(_));
        let turned = (values.normal || values.n_eye) && self.sets.iter().any(turns);
        turned.then(|| "normals turn over while the shutter is open".to_owned())
    }

    /// Which values are summed up beside colours where samples are filmed elsewhere.
    pub fn mean_values(&self) -> MeanValues {
        let asks = |aov: Aov| self.aovs.contains(&aov);
        MeanValues {
            normal: asks(Aov::Normal),
            n_eye: asks(Aov::Neye),
            motion: asks(Aov::MotionVectors) && self.plan.has_time(),
            primvars: Keeps::of(&self.aovs).primvar_floats(),
        }
    }

    /// The primvar AOVs of floats: how many each has, in the order of [`Prepared::mean_values`].
    pub fn primvar_floats(&self) -> impl Iterator<Item = usize> {
        let floats = self.primvar_aovs.iter().filter(|aov| !aov.is_integer);
        floats.map(|aov| aov.components)
    }

    /// What instance number `instance` of the world has of each of these; nothing where it has no such primvar.
    pub fn primvar_paints(&self, instance: u32) -> impl Iterator<Item = Option<Paint<'_>>> {
        let hit = Hit {
            instance,
            ..Hit::MISS
        };
        let (_, prim) = self.hit_prim(&hit);
        let sources = self.primvar_aovs.iter().zip(&prim.primvars);
        let floats = sources.filter(|(aov, _)| !aov.is_integer);
        floats.map(move |(_, source)| Some(self.paint(&hit, source.as_deref()?)))
    }

    /// The AOV of floats that is made of whole numbers on some prims.
    fn mixed_primvar(&self) -> Option<&str> {
        let aovs = self.primvar_aovs.iter().enumerate();
        let mixed = aovs.filter(|(_, aov)| !aov.is_integer).find(|&(i, _)| {
            let mut sources = self
                .prims
                .iter()
                .filter_map(|prim| prim.primvars[i].as_ref());
            sources.any(|source| source.is_integer())
        });
        mixed.map(|(_, aov)| &aov.name[..])
    }

    fn paint<'a>(&self, hit: &Hit, source: &'a Source) -> Paint<'a> {
        let item = match Source::values(source) {
            Values::Instance(level, _) => self.instance(hit, *level),
            _ => 0,
        };
        Paint { source, item }
    }

    /// How instance number `instance` of the world looks.
    pub fn look(&self, instance: u32) -> Look<'_> {
        let hit = Hit {
            instance,
            ..Hit::MISS
        };
        let (entry, prim) = self.hit_prim(&hit);
        let paint = |source| self.paint(&hit, source);
        Look {
            matte: prim.matte,
            double_sided: prim.double_sided,
            inverted: entry.facets.is_inverted(0.0),
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
