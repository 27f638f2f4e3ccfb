//! A commit: the scene as it stands to a [`Prepared`], taking over what an edit did not touch.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use rayon::prelude::*;

use super::ahead::Ahead;
use super::chains::{self, Chain, same_chain};
use super::earlier::{Earlier, is_still, same_shared_dicing};
use super::nests::{Member, beyond_memory};
use super::objects::{Context, PrimObjects, prepare_prim};
use super::prepared::{CacheEntry, PrepareStatistics, Prepared, PreparedPrim, SetEntry};
use super::primvar_aovs;
use super::watcher::Watcher;
use crate::aov::{Aov, primvar_of};
use crate::camera::Camera;
use crate::diagnostics::{Code, Warning};
use crate::effects::{EffectPlan, TimePlan};
use crate::motion::Shutter;
use crate::scene::{CameraDesc, Cull, Geometry, PrimDesc, PrimId, RenderSettings, Scene};
use crate::surface::SubdivisionFactory;
use crate::trace::world::WorldError;
use crate::trace::{Culled, Side, Winding, World, WorldSet};
use crate::translate::instancer::Instancer;
use crate::translate::points::Bends;
use crate::translate::subsets::subset_of_faces;

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
    /// More than there is memory for.
    #[error("{0}")]
    OutOfMemory(String),
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
    /// Names of the primvars that AOVs ask for, ascending.
    pub primvar_aovs: Vec<String>,
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
            primvar_aovs: primvar_aovs::names(settings),
        })
    }

    pub fn context<'a>(
        &'a self,
        instancers: &'a HashMap<PrimId, Arc<Instancer>>,
        factory: &'a dyn SubdivisionFactory,
        watcher: Option<&'a dyn Watcher>,
        cancel: &'a AtomicBool,
    ) -> Context<'a> {
        Context {
            camera: &self.camera,
            shutter: self.shutter,
            bends: Bends::Samples(2), // each prim has its own
            instancers,
            settings: &self.settings,
            factory,
            cancel,
            watcher,
            primvar_aovs: &self.primvar_aovs,
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
    prepare_with(scene, factory, previous, None, None, cancel)
}

/// [`prepare`], with prims that were prepared already; `watcher` is told of objects that are diced now.
///
/// # Errors
/// As [`prepare`].
pub fn prepare_with(
    scene: &Scene,
    factory: &dyn SubdivisionFactory,
    previous: Option<&Prepared>,
    ahead: Option<&Ahead>,
    watcher: Option<&dyn Watcher>,
    cancel: &AtomicBool,
) -> Result<Preparation, PrepareError> {
    let start = Instant::now();
    let mut warnings = Vec::new();
    let view = View::new(scene, &mut warnings)?;
    let settings = &scene.settings;
    let mut aovs = resolve_aovs(settings, &mut warnings);

    let ahead = ahead.map(|ahead| ahead.take_for(&view)).unwrap_or_default();
    let (places, hidden) = find_places(scene, &mut warnings);
    let visible: Vec<(&PrimId, &Arc<PrimDesc>, &Chain)> = places
        .iter()
        .map(|(id, prim, chain)| (*id, *prim, chain))
        .collect();
    let earlier = previous.map(|previous| Earlier::new(previous, &view));
    let same_rates = previous.filter(|p| same_shared_dicing(p, settings));
    let same_primvars = |objects: &PrimObjects, prim: &PrimDesc, chain: &Chain| {
        objects.primvars.fit(prim, chain, &view.primvar_aovs)
    };
    let taken = |id: &PrimId, prim: &Arc<PrimDesc>, chain: &Chain| {
        let new = ahead.get(id).filter(|new| Arc::ptr_eq(&new.desc, prim));
        let new = new.filter(|new| same_primvars(&new.objects, prim, chain));
        if let Some(new) = new {
            return Some((Arc::clone(&new.objects), Taken::Ahead));
        }
        let earlier = earlier.as_ref()?;
        let old = earlier.entry(id, prim, chain)?;
        let same = same_geometry(&old.desc, prim) && same_place(&old.desc, prim);
        let same =
            same && same_chain(&old.chain, chain) && same_primvars(&old.objects, prim, chain);
        let fits = || earlier.same_view || (chain.is_empty() && old.objects.fits(&view.camera));
        (same && fits()).then(|| (Arc::clone(&old.objects), Taken::Whole))
    };
    let found: Vec<Option<(Arc<PrimObjects>, Taken)>> = visible
        .par_iter()
        .map(|(id, prim, chain)| taken(id, prim, chain))
        .collect();
    let parts = visible
        .iter()
        .zip(&found)
        .filter(|(_, found)| found.is_none())
        .filter_map(|((_, prim, _), _)| prim.common.instancer);
    let instancers = chains::resolve(
        scene,
        parts,
        view.shutter,
        &view.primvar_aovs,
        &mut warnings,
    );
    let members: Vec<Member<'_>> = visible
        .iter()
        .zip(&found)
        .map(|((_, prim, chain), found)| Member {
            prim,
            chain,
            known: found.as_ref().map(|(objects, _)| &**objects),
        })
        .collect();
    let too_many = beyond_memory(&members, &instancers, &mut warnings);
    drop(members);
    let context = view.context(&instancers, factory, watcher, cancel);
    let prepared: Vec<(Arc<PrimObjects>, Taken)> = visible
        .par_iter()
        .zip(found)
        .zip(too_many)
        .map(|(((id, prim, chain), found), too_many)| {
            if too_many {
                return (Arc::new(PrimObjects::empty()), Taken::LeftOut);
            }
            if let Some(found) = found {
                return found;
            }
            let old = same_rates.filter(|p| p.shutter == view.shutter || is_still(prim, chain));
            let old = old.and_then(|p| p.cache.get(id));
            let same = |old: &&CacheEntry| {
                same_geometry(&old.desc, prim) && same_primvars(&old.objects, prim, chain)
            };
            let old = old.filter(same);
            let old = old.map(|old| &*old.objects);
            let objects = Arc::new(prepare_prim(prim, chain, old, &context));
            let taken = match objects.diced || old.is_none() {
                true => Taken::Nothing,
                false => Taken::Grids,
            };
            (objects, taken)
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
    for ((id, desc, chain), (objects, taken)) in visible.into_iter().zip(prepared) {
        warnings.extend(objects.warnings.iter().cloned());
        match taken {
            Taken::Whole => statistics.objects_reused += 1,
            Taken::Grids => {
                statistics.objects_reused += 1;
                statistics.objects_placed += 1;
            }
            Taken::Nothing | Taken::Ahead => statistics.objects_diced += 1,
            Taken::LeftOut => {}
        }
        if let Some(on_demand) = objects.on_demand.as_ref().filter(|_| taken == Taken::Whole) {
            // What was spent before this commit is not its own.
            let [dice, build] = on_demand.seconds();
            statistics.dice_seconds -= dice;
            statistics.build_seconds -= build;
        }
        if taken != Taken::Whole {
            statistics.translate_seconds += objects.translate_seconds;
            statistics.dice_seconds += objects.dice_seconds;
            statistics.build_seconds += objects.build_seconds;
        }
        let entry = CacheEntry {
            desc: Arc::clone(desc),
            chain: chain.clone(),
            objects: Arc::clone(&objects),
        };
        if taken != Taken::LeftOut {
            cache.insert(*id, entry);
        }
        let path = desc.common.path.clone();
        let subsets = match &desc.geometry {
            Geometry::Mesh(mesh) if aovs.contains(&Aov::SubsetId) => {
                let faces = mesh.topology.face_vertex_counts.len();
                subset_of_faces(&path, &mesh.subsets, faces, &mut warnings)
            }
            _ => Vec::new(),
        };
        prims.push(PreparedPrim {
            path,
            pick_id: desc.common.pick_id,
            matte: desc.common.matte,
            double_sided: desc.common.double_sided,
            culled: culled_side(settings.cull, desc),
            subsets,
            shading: objects.given.shading(&objects.shading),
            objects,
            primvars: Vec::new(),
        });
    }
    drop(instancers);
    if settings.keep_finer {
        // Shown again, they are as they were.
        let kept = hidden.par_iter().filter_map(|(id, prim)| {
            let earlier = earlier.as_ref()?;
            let old = earlier.entry(id, prim, &previous?.cache.get(id)?.chain)?;
            let near = || old.chain.is_empty() && old.objects.fits(&view.camera);
            let stays = same_geometry(&old.desc, prim) && (earlier.same_view || near());
            stays.then(|| (**id, old.clone()))
        });
        cache.extend(kept.collect::<Vec<_>>());
    }
    warnings.extend(coarsened(&prims));
    let primvar_aovs = primvar_aovs::assign(&view.primvar_aovs, &mut prims, &mut warnings);
    aovs.extend(primvar_aovs.iter().cloned().map(Aov::Primvar));
    let (world, sets) = place(&prims, &view, cancel, &mut statistics)?;
    drop(places);
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
        primvar_aovs,
        world,
        prims,
        sets,
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

/// How many prims have fewer micropolygons than they need, since the settings allow no more.
fn coarsened(prims: &[PreparedPrim]) -> Option<Warning> {
    let mut coarse = prims.iter().filter(|prim| prim.objects.coarsened);
    let first = coarse.next()?;
    // How many others there are changes from view to view, and with it what was told before.
    let text = match coarse.count() {
        0 => "needs more micropolygons than a prim may have; it is diced more coarsely",
        _ => {
            "this prim and others need more micropolygons than a prim may have; they are diced more coarsely"
        }
    };
    Some(Warning::new(&first.path, Code::Budget, text))
}

fn resolve_aovs(settings: &RenderSettings, warnings: &mut Vec<Warning>) -> Vec<Aov> {
    let mut aovs = Vec::new();
    for name in &settings.aovs {
        match Aov::from_name(name) {
            Some(aov) => aovs.push(aov),
            None if primvar_of(name).is_some() => {}
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

/// What of a prim was there already.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Taken {
    /// Nothing.
    Nothing,
    /// It was prepared while the host was still reading.
    Ahead,
    /// Its grids, from the commit before; its places are new.
    Grids,
    /// All of it, from the commit before.
    Whole,
    /// It is not prepared: there is no memory for where it would be.
    LeftOut,
}

/// A prim with the instancers that it is part of.
type Placed<'a> = (&'a PrimId, &'a Arc<PrimDesc>, Chain);

/// Prims that are visible, with their instancers, in the order of their paths; and those that are not. Warns
/// of those that have no place.
///
/// Where surfaces lie on one another the first one is seen, and hosts may create prims in any order.
fn find_places<'a>(
    scene: &'a Scene,
    warnings: &mut Vec<Warning>,
) -> (Vec<Placed<'a>>, Vec<(&'a PrimId, &'a Arc<PrimDesc>)>) {
    let mut found = Vec::with_capacity(scene.prims.len());
    let mut hidden = Vec::new();
    let mut broken = Vec::new();
    for (id, prim) in &scene.prims {
        if !prim.common.visible {
            hidden.push((id, prim));
            continue;
        }
        match chains::chain(scene, prim) {
            Ok(chain) if chain.iter().all(|i| i.visible) => found.push((id, prim, chain)),
            Ok(_) => hidden.push((id, prim)),
            Err(why) => broken.push((&**prim, why)),
        }
    }
    chains::warn_of(&broken, scene, warnings);
    found.sort_by(|a, b| a.1.common.path.cmp(&b.1.common.path));
    (found, hidden)
}

/// True when two descriptions of a prim put it in the same place.
fn same_place(old: &PrimDesc, new: &PrimDesc) -> bool {
    old.common.transform == new.common.transform && old.common.instancer == new.common.instancer
}

/// True when two descriptions of a prim give the same objects, apart from where they are: ids and
/// visibility do not matter.
fn same_geometry(old: &Arc<PrimDesc>, new: &Arc<PrimDesc>) -> bool {
    Arc::ptr_eq(old, new)
        || (old.geometry == new.geometry
            && old.common.blur_scale == new.common.blur_scale
            && old.common.nonlinear_samples == new.common.nonlinear_samples
            && old.common.primvars == new.common.primvars)
}

/// The side of a prim that rays pass through.
fn culled_side(cull: Cull, prim: &PrimDesc) -> Option<Side> {
    let side = match cull {
        Cull::None => None,
        Cull::Back => Some(Side::Back),
        Cull::Front => Some(Side::Front),
        Cull::BackUnlessDoubleSided => (!prim.common.double_sided).then_some(Side::Back),
    };
    side.filter(|_| prim.geometry.has_sides())
}

fn place(
    prims: &[PreparedPrim],
    view: &View,
    cancel: &AtomicBool,
    statistics: &mut PrepareStatistics,
) -> Result<(World, Vec<SetEntry>), PrepareError> {
    let start = Instant::now();
    let mut entries = Vec::new();
    let mut sets = Vec::new();
    let mut seen = std::collections::HashSet::new();
    let mut parts = 0;
    for (p, prim) in prims.iter().enumerate() {
        statistics.limit_evaluations += prim.objects.limit_evaluations;
        // Its clusters are parts of one object, which appears once.
        if prim.objects.on_demand.is_some() {
            statistics.objects += 1;
            parts += prim.objects.placed.len() as u64 - 1;
        }
        for (k, placed) in prim.objects.placed.iter().enumerate() {
            let made = match placed.set.as_deferred() {
                Some(_) => None, // counted when it is asked
                None => placed.set.made(),
            };
            if let Some(object) = made
                && seen.insert(Arc::as_ptr(object))
            {
                statistics.objects += 1;
                statistics.add_object(object);
            }
            let winding = &placed.winding;
            sets.push(WorldSet {
                set: Arc::clone(&placed.set),
                user: entries.len() as u32,
                culled: prim.culled.map(|side| Culled {
                    side,
                    winding: winding.clone(),
                }),
            });
            // Deferred ones store normals.
            let facets = match made.map(|object| object.mesh().normal_key_count) {
                Some(0) => winding.clone(),
                _ => Winding::Same,
            };
            entries.push(SetEntry {
                prim: p as u32,
                placed: k as u32,
                facets,
            });
        }
    }
    let make = match view.settings.backend.is_gpu() {
        // It makes the tree over instances as well.
        true => World::later,
        false => World::new,
    };
    let world = make(sets, view.camera.origin(), cancel).map_err(|error| match error {
        WorldError::OutOfMemory(_) => PrepareError::OutOfMemory(error.to_string()),
        WorldError::Cancelled => PrepareError::Cancelled,
    })?;
    statistics.instances = world.instance_count() as u64 - parts;
    let stats = world.stats();
    statistics.bvh_bytes += stats.top_bytes;
    statistics.bvh_nodes += stats.top_nodes;
    statistics.world_seconds = start.elapsed().as_secs_f64();
    Ok((world, entries))
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
    plan.primvar_time_by = placed
        .clone()
        .find(|p| p.objects.primvars.segments > 0 || p.objects.given.segments > 0)
        .map(|p| p.path.clone());
    plan.moving_instances = placed
        .clone()
        .flat_map(|p| &p.objects.placed)
        .filter(|p| p.set.key_times().is_some())
        .map(|p| p.set.len())
        .sum();
    if camera.lens_radius() > 0.0 {
        plan.lens_radius = camera.lens_radius();
        plan.lens_by = Some(camera_desc.path.clone());
    }
    plan.lens_changes = camera.lens_changes();
    plan.matte_by = placed.clone().find(|p| p.matte).map(|p| p.path.clone());
    let culled = placed.clone().find(|p| p.culled.is_some());
    plan.culled_by = culled.map(|p| p.path.clone());
    plan.transparency_by = placed
        .clone()
        .find(|p| p.shading.opacity.is_some())
        .map(|p| p.path.clone());
    plan
}
