//! What stays of the commit before: which objects may be taken over, by what they were diced for.
//!
//! Dicing depends on the camera, the image, some settings, and the shutter. What stands still is diced alike for any
//! shutter, where the camera stands still too.

use super::chains::Chain;
use super::prepare::View;
use super::prepared::{CacheEntry, Prepared};
use crate::motion::Shutter;
use crate::scene::{CameraDesc, Geometry, PrimDesc, PrimId, RenderSettings, ShutterCurveDesc};

/// The commit before, as one that objects are taken over from.
pub(super) struct Earlier<'a> {
    prepared: &'a Prepared,
    /// The image shows the same of what stands still.
    pub same_view: bool,
    /// What was diced for another view may stay where it fits.
    near_view: bool,
    same_shutter: bool,
    same_curves: bool,
}

impl<'a> Earlier<'a> {
    pub fn new(prepared: &'a Prepared, view: &View) -> Self {
        let (old, new) = (&prepared.settings, &view.settings);
        let same_shutter = prepared.shutter == view.shutter;
        let (old_camera, camera) = (&*prepared.camera_desc, &*view.camera_desc);
        let same_camera =
            old_camera == camera || (camera.is_still() && same_but_for_shutter(old_camera, camera));
        Self {
            prepared,
            same_view: same_camera && same_image(old, new) && same_dicing_settings(old, new),
            near_view: new.keep_finer && same_dicing_settings(old, new),
            same_shutter,
            same_curves: old.curves == new.curves,
        }
    }

    /// What it had of a prim, where nothing but its description may say otherwise now; of another view, where that
    /// is allowed at all.
    pub fn entry(&self, id: &PrimId, prim: &PrimDesc, chain: &Chain) -> Option<&'a CacheEntry> {
        let same = (self.same_view || self.near_view)
            && (self.same_shutter || is_still(prim, chain))
            && (self.same_curves || !is_curves(prim));
        same.then(|| self.prepared.cache.get(id)).flatten()
    }
}

/// True when nothing of a prim changes with time, nor of what places it.
pub(super) fn is_still(prim: &PrimDesc, chain: &Chain) -> bool {
    prim.is_still() && chain.iter().all(|instancer| instancer.is_still())
}

/// True when [`RenderSettings::curves`] may be about a prim.
fn is_curves(prim: &PrimDesc) -> bool {
    matches!(
        prim.geometry,
        Geometry::Curves(_) | Geometry::NurbsCurves(_)
    )
}

fn same_but_for_shutter(old: &CameraDesc, new: &CameraDesc) -> bool {
    let without = |camera: &CameraDesc| CameraDesc {
        shutter: [0.0; 2],
        shutter_curve: ShutterCurveDesc::default(),
        ..camera.clone()
    };
    without(old) == without(new)
}

/// True when everything that dicing and paths depend on, apart from the prims, is that of `view`.
pub(super) fn same_dicing(
    shutter: Shutter,
    camera: &CameraDesc,
    old: &RenderSettings,
    view: &View,
) -> bool {
    let settings = &view.settings;
    shutter == view.shutter
        && *camera == *view.camera_desc
        && old.curves == settings.curves
        && same_image(old, settings)
        && same_dicing_settings(old, settings)
}

/// True when a camera sees the same in the same number of pixels.
fn same_image(old: &RenderSettings, new: &RenderSettings) -> bool {
    old.resolution == new.resolution
        && old.pixel_aspect == new.pixel_aspect
        && old.window_policy == new.window_policy
        && old.window() == new.window()
        // What was kept before may be of another view.
        && (new.keep_finer || !old.keep_finer)
}

/// True when the settings that all dicing depends on are the same, apart from the view.
fn same_dicing_settings(old: &RenderSettings, new: &RenderSettings) -> bool {
    old.shading_rate == new.shading_rate
        && old.max_micropolygons == new.max_micropolygons
        && old.dices_on_demand() == new.dices_on_demand()
}

/// True when everything that the dicing of instanced prims depends on, apart from the prims, their
/// rates and the shutter, is that of `settings`.
pub(super) fn same_shared_dicing(previous: &Prepared, settings: &RenderSettings) -> bool {
    let old = &previous.settings;
    old.shading_rate == settings.shading_rate && old.max_micropolygons == settings.max_micropolygons
}
