//! A commit: the scene as it stands to a [`Prepared`], taking over what an edit did not touch.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use rayon::prelude::*;

use super::ahead::Ahead;
use super::objects::{Context, PrimObjects, prepare_prim};
use super::prepared::{CacheEntry, InstanceEntry, PrepareStatistics, Prepared, PreparedPrim};
use crate::aov::Aov;
use crate::camera::Camera;
use crate::diagnostics::{Code, Warning};
use crate::effects::{EffectPlan, TimePlan};
use crate::motion::Shutter;
use crate::scene::{CameraDesc, PrimDesc, PrimId, RenderSettings, Scene};
use crate::surface::SubdivisionFactory;
use crate::trace::{World, WorldInstance};
use crate::translate::points::Bends;

/// Why a scene cannot be prepared at all.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum PrepareError {
    /// The scene has no active camera.
    #[error("no camera to render through")]
    NoCamera,
    /// The camera cannot be used.
    #[error("camera {0}: {1}")]
    Camera(String, String),
    /// A setting is out of range.
    #[error("{0}")]
    Setting(String),
    /// Asked to stop.
    #[error("cancelled")]
    Cancelled,
}

/// A prepared scene, and what there was to complain about, in prim order.
#[derive(Debug)]
pub struct Preparation {
    /// The scene.
    pub prepared: Prepared,
    /// Warnings of every prim that was prepared or taken over.
    pub warnings: Vec<Warning>,
}

/// What prims are prepared for: camera, shutter and settings.
#[derive(Debug)]
pub(super) struct View {
    pub camera: Camera,
    pub camera_desc: Arc<CameraDesc>,
    pub settings: Arc<RenderSettings>,
    pub shutter: Shutter,
}

impl View {
    pub fn new(scene: &Scene, warnings: &mut Vec<Warning>) -> Result<Self, PrepareError> {
        let settings = &scene.settings;
        check_settings(settings)?;
        let camera_desc = scene
            .active_camera
            .and_then(|id| scene.cameras.get(&id))
            .ok_or(PrepareError::NoCamera)?;
        let shutter = resolve_shutter(camera_desc, settings, warnings);
        let path = &camera_desc.path;
        let (camera, notes) = Camera::new(camera_desc, settings, shutter)
            .map_err(|e| PrepareError::Camera(path.clone(), e.to_string()))?;
        let notes = notes.into_iter();
        warnings.extend(notes.map(|n| Warning::new(path, Code::NotFinite, n)));
        Ok(Self {
            camera,
            camera_desc: Arc::clone(camera_desc),
            settings: Arc::clone(settings),
            shutter,
        })
    }

    pub fn context<'a>(
        &'a self,
        factory: &'a dyn SubdivisionFactory,
        cancel: &'a AtomicBool,
    ) -> Context<'a> {
        Context {
            camera: &self.camera,
            shutter: self.shutter,
            bends: Bends::Samples(2), // each prim has its own
            settings: &self.settings,
            factory,
            cancel,
        }
    }
}

/// Prepares `scene`. `previous` is the commit before, whose objects are taken over where neither the
/// prim nor anything it was diced for has changed.
///
/// # Errors
/// No usable camera or settings, or `cancel` was raised.
pub fn prepare(
    scene: &Scene,
    factory: &dyn SubdivisionFactory,
    previous: Option<&Prepared>,
    cancel: &AtomicBool,
) -> Result<Preparation, PrepareError> {
    prepare_with(scene, factory, previous, None, cancel)
}

/// [`prepare`], with prims that were prepared already.
///
/// # Errors
/// As [`prepare`].
pub fn prepare_with(
    scene: &Scene,
    factory: &dyn SubdivisionFactory,
    previous: Option<&Prepared>,
    ahead: Option<&Ahead>,
    cancel: &AtomicBool,
) -> Result<Preparation, PrepareError> {
    let start = Instant::now();
    let mut warnings = Vec::new();
    let view = View::new(scene, &mut warnings)?;
    let settings = &scene.settings;
    let aovs = resolve_aovs(settings, &mut warnings);

    let ahead = ahead.map(|ahead| ahead.take_for(&view)).unwrap_or_default();
    let reusable = previous.filter(|p| same_dicing(p.shutter, &p.camera_desc, &p.settings, &view));
    let context = view.context(factory, cancel);
    let visible: Vec<(&PrimId, &Arc<PrimDesc>)> = scene
        .prims
        .iter()
        .filter(|(_, p)| p.common.visible)
        .collect();
    let prepared: Vec<(Arc<PrimObjects>, bool)> = visible
        .par_iter()
        .map(|(id, prim)| {
            let new = ahead.get(id).filter(|new| Arc::ptr_eq(&new.desc, prim));
            if let Some(new) = new {
                return (Arc::clone(&new.objects), false);
            }
            let old = reusable.and_then(|p| p.cache.get(id));
            match old.filter(|old| same_geometry(&old.desc, prim)) {
                Some(old) => (Arc::clone(&old.objects), true),
                None => (Arc::new(prepare_prim(prim, &context)), false),
            }
        })
        .collect();
    if cancel.load(Ordering::Relaxed) {
        return Err(PrepareError::Cancelled);
    }

    let mut prims = Vec::with_capacity(visible.len());
    let mut cache = HashMap::with_capacity(visible.len());
    let mut statistics = PrepareStatistics {
        prims: visible.len() as u64,
        ..Default::default()
    };
    for ((id, desc), (objects, reused)) in visible.iter().zip(prepared) {
        warnings.extend(objects.warnings.iter().cloned());
        if reused {
            statistics.objects_reused += 1;
        } else {
            statistics.objects_diced += 1;
            statistics.translate_seconds += objects.translate_seconds;
            statistics.dice_seconds += objects.dice_seconds;
            statistics.build_seconds += objects.build_seconds;
        }
        let entry = CacheEntry {
            desc: Arc::clone(desc),
            objects: Arc::clone(&objects),
        };
        cache.insert(**id, entry);
        let path = desc.common.path.clone();
        prims.push(PreparedPrim {
            path,
            pick_id: desc.common.pick_id,
            matte: desc.common.matte,
            objects,
        });
    }
    let (world, instances) = place(&prims, &view.camera, &mut statistics);
    let View {
        camera,
        camera_desc,
        shutter,
        ..
    } = view;
    let plan = plan_effects(&prims, &camera, &camera_desc, settings, shutter);
    statistics.total_seconds = start.elapsed().as_secs_f64();
    let prepared = Prepared {
        settings: Arc::clone(settings),
        camera_desc,
        camera,
        shutter,
        aovs,
        world,
        prims,
        instances,
        plan,
        statistics,
        cache,
    };
    Ok(Preparation { prepared, warnings })
}

fn check_settings(settings: &RenderSettings) -> Result<(), PrepareError> {
    let refuse = |text: String| Err(PrepareError::Setting(text));
    if settings.samples == 0 {
        return refuse("samples must be at least 1".to_owned());
    }
    if !(settings.shading_rate.is_finite() && settings.shading_rate > 0.0) {
        return refuse(format!(
            "shading rate {} must be above 0",
            settings.shading_rate
        ));
    }
    let [a, b] = settings.time_window;
    if !(0.0 <= a && a <= b && b <= 1.0) {
        return refuse(format!("time window {a} to {b} must lie in 0 to 1"));
    }
    if !(settings.filter_width.is_finite() && settings.filter_width >= 0.0) {
        return refuse(format!(
            "filter width {} must be 0 or above",
            settings.filter_width
        ));
    }
    if settings
        .resolution
        .iter()
        .any(|&r| r == 0 || r > crate::film::frame::LARGEST_RESOLUTION)
    {
        let [w, h] = settings.resolution;
        return refuse(format!(
            "resolution {w} x {h} is not between 1 x 1 and 65536 x 65536"
        ));
    }
    Ok(())
}

pub(crate) fn resolve_shutter(
    camera: &CameraDesc,
    settings: &RenderSettings,
    warnings: &mut Vec<Warning>,
) -> Shutter {
    if settings.disable_motion_blur {
        return Shutter {
            open: 0.0,
            close: 0.0,
        };
    }
    let [open, close] = settings.shutter.unwrap_or(camera.shutter);
    if !(open.is_finite() && close.is_finite()) {
        let text = format!("shutter {open} to {close} is not finite; the frame's time is rendered");
        warnings.push(Warning::new(&camera.path, Code::NotFinite, text));
        return Shutter {
            open: 0.0,
            close: 0.0,
        };
    }
    if close < open {
        let text = format!(
            "shutter closes at {close}, before it opens at {open}; rendered at {open} without blur"
        );
        warnings.push(Warning::new(&camera.path, Code::TimeSamples, text));
        return Shutter { open, close: open };
    }
    Shutter { open, close }
}

fn resolve_aovs(settings: &RenderSettings, warnings: &mut Vec<Warning>) -> Vec<Aov> {
    let mut aovs = Vec::new();
    for name in &settings.aovs {
        match Aov::from_name(name) {
            Some(aov) => aovs.push(aov),
            None => {
                let text = format!("AOV {name} is not known; it is left out");
                warnings.push(Warning::new("", Code::Unsupported, text));
            }
        }
    }
    aovs.sort();
    aovs.dedup();
    aovs
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
        && old.resolution == settings.resolution
        && old.pixel_aspect == settings.pixel_aspect
        && old.window_policy == settings.window_policy
        && old.shading_rate == settings.shading_rate
        && old.max_micropolygons == settings.max_micropolygons
        && old.curves == settings.curves
        && old.window() == settings.window()
}

/// True when two descriptions of a prim give the same objects: ids and visibility do not matter.
fn same_geometry(old: &Arc<PrimDesc>, new: &Arc<PrimDesc>) -> bool {
    Arc::ptr_eq(old, new)
        || (old.geometry == new.geometry
            && old.common.transform == new.common.transform
            && old.common.blur_scale == new.common.blur_scale
            && old.common.nonlinear_samples == new.common.nonlinear_samples
            && old.common.instances == new.common.instances
            && old.common.primvars == new.common.primvars)
}

fn place(
    prims: &[PreparedPrim],
    camera: &Camera,
    statistics: &mut PrepareStatistics,
) -> (World, Vec<InstanceEntry>) {
    let start = Instant::now();
    let mut entries = Vec::new();
    let mut instances = Vec::new();
    let mut seen = std::collections::HashSet::new();
    for (p, prim) in prims.iter().enumerate() {
        statistics.limit_evaluations += prim.objects.limit_evaluations;
        for placed in &prim.objects.placed {
            if seen.insert(Arc::as_ptr(&placed.geometry)) {
                let stats = placed.geometry.stats();
                statistics.objects += 1;
                statistics.grids += placed.geometry.mesh().grids.len() as u64;
                statistics.micropolygons += stats.cells;
                statistics.geometry_bytes += stats.mesh_bytes;
                statistics.bvh_bytes += stats.bvh_bytes;
                statistics.bvh_nodes += stats.nodes + stats.blocks;
            }
            entries.push(InstanceEntry {
                prim: p as u32,
                instance_id: placed.instance_id,
                flip: placed.flip,
            });
            instances.push(WorldInstance {
                object: Arc::clone(&placed.geometry),
                transform: placed.transform.clone(),
                user: entries.len() as u32 - 1,
            });
        }
    }
    let world = World::build(instances, camera.origin());
    statistics.instances = entries.len() as u64;
    let stats = world.stats();
    statistics.bvh_bytes += stats.top_bytes;
    statistics.bvh_nodes += stats.top_nodes;
    statistics.world_seconds = start.elapsed().as_secs_f64();
    (world, entries)
}

fn plan_effects(
    prims: &[PreparedPrim],
    camera: &Camera,
    camera_desc: &CameraDesc,
    settings: &RenderSettings,
    shutter: Shutter,
) -> EffectPlan {
    let mut plan = EffectPlan {
        camera_light: settings.camera_light,
        ..EffectPlan::default()
    };
    let placed = prims.iter().filter(|p| !p.objects.placed.is_empty());
    let most = placed
        .clone()
        .max_by_key(|p| p.objects.segments)
        .filter(|p| p.objects.segments > 0);
    if let Some(prim) = most {
        plan.time = TimePlan::Segments(prim.objects.segments);
        plan.time_by = Some(prim.path.clone());
    } else if camera.is_moving() {
        plan.time = TimePlan::CameraOnly;
        plan.time_by = Some(camera_desc.path.clone());
    } else if settings.disable_motion_blur {
        plan.time_note = Some("motion blur is switched off".to_owned());
    } else if shutter.is_still() {
        plan.time_note = Some("the shutter has no length".to_owned());
    }
    plan.moving_instances = placed
        .clone()
        .flat_map(|p| &p.objects.placed)
        .filter(|p| matches!(p.transform, crate::trace::InstanceTransform::Moving { .. }))
        .count();
    if camera.lens_radius() > 0.0 {
        plan.lens_radius = camera.lens_radius();
        plan.lens_by = Some(camera_desc.path.clone());
    }
    plan.lens_changes = camera.lens_changes();
    plan.matte_by = placed.clone().find(|p| p.matte).map(|p| p.path.clone());
    plan.transparency_by = placed
        .clone()
        .find(|p| p.objects.shading.opacity.is_some())
        .map(|p| p.path.clone());
    plan
}
