//! One prim to traceable objects: check, resolve, surface, route, dice, build.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use std::collections::HashMap;

use glam::{DAffine3, DVec3};

use super::chains::Chain;
use super::clusters::OnDemand;
use super::given::Given;
use super::instances::{self, Shared};
use super::kept::DicedFor;
use super::primvar_aovs::{PrimPrimvar, PrimPrimvars, asked_of};
use super::shape::{self, Shape, Target};
use super::watcher::Watcher;
use crate::bvh::ObjectGeometry;
use crate::camera::Camera;
use crate::diagnostics::{Code, Warning};
use crate::dice::RasterMetric;
use crate::grid::DicedMesh;
use crate::motion::{Hierarchy, Shutter, TransformError};
use crate::scene::{PrimDesc, PrimId, RenderSettings};
use crate::shade::{DEFAULT_ALBEDO, PrimShading, Source};
use crate::surface::SubdivisionFactory;
use crate::trace::Winding;
use crate::trace::places::{InstanceSet, Shift};
use crate::translate::blur::prim_shutter;
use crate::translate::instancer::{Instancer, Placements};
use crate::translate::measure::{CHORD_TOLERANCE, ObjectBounds, instance_pixels, views_at_keys};
use crate::translate::points::Bends;
use crate::translate::route;

/// What a prim is prepared with.
#[derive(Clone, Copy)]
pub(super) struct Context<'a> {
    pub camera: &'a Camera,
    /// The camera's; while one prim is prepared, the shutter of its motion (its blur scaled).
    pub shutter: Shutter,
    /// Keys of paths that bend, of the prim that is prepared.
    pub bends: Bends<'a>,
    /// Those that its prims are part of.
    pub instancers: &'a HashMap<PrimId, Arc<Instancer>>,
    pub settings: &'a RenderSettings,
    pub factory: &'a dyn SubdivisionFactory,
    pub cancel: &'a AtomicBool,
    pub watcher: Option<&'a dyn Watcher>,
    /// Names of the primvars that AOVs ask for, ascending.
    pub primvar_aovs: &'a [String],
}

/// Appearances of an object.
#[derive(Clone, Debug)]
pub(super) struct PlacedSet {
    pub set: Arc<InstanceSet>,
    /// Where its lattices' fronts are.
    pub winding: Winding,
    /// For each of [`Given::links`]: the instancer's instance that each of the set is in.
    pub numbers: Vec<Vec<u32>>,
}

/// What one prim became.
#[derive(Clone, Debug)]
pub(super) struct PrimObjects {
    /// What it has itself.
    pub shading: PrimShading,
    /// What its instancers give it.
    pub given: Given,
    pub primvars: PrimPrimvars,
    pub placed: Vec<PlacedSet>,
    pub warnings: Vec<Warning>,
    /// Those of its geometry, where it is part of instancers.
    pub shape_warnings: Vec<Warning>,
    /// What it was diced to there.
    pub shared: Option<Shared>,
    /// What it was diced for, where it appears once.
    pub diced_for: Option<DicedFor>,
    /// What of it is diced on demand.
    pub on_demand: Option<Arc<OnDemand>>,
    /// True where grids were made, and not only taken over.
    pub diced: bool,
    /// True where it was diced more coarsely than was asked for.
    pub coarsened: bool,
    pub limit_evaluations: u64,
    /// Checking, surfaces and paths: all that is not dicing or building.
    pub translate_seconds: f64,
    pub dice_seconds: f64,
    pub build_seconds: f64,
    /// Straight segments of the path with the most; 0 when nothing moves.
    pub segments: usize,
}

impl Context<'_> {
    /// An object; where a GPU is to trace, it makes the tree, unless the CPU has to after all.
    pub fn object(&self, diced: DicedMesh) -> Arc<ObjectGeometry> {
        let object = Arc::new(match self.settings.backend.is_gpu() {
            true => ObjectGeometry::later(diced),
            false => ObjectGeometry::new(diced),
        });
        if let Some(watcher) = self.watcher {
            watcher.diced(&object);
        }
        object
    }
}

impl PrimObjects {
    pub fn empty() -> Self {
        let color = Arc::new(Source::constant(&DEFAULT_ALBEDO));
        Self {
            shading: PrimShading {
                color,
                opacity: None,
            },
            given: Given::default(),
            primvars: PrimPrimvars::default(),
            placed: Vec::new(),
            warnings: Vec::new(),
            shape_warnings: Vec::new(),
            shared: None,
            diced_for: None,
            on_demand: None,
            diced: false,
            coarsened: false,
            limit_evaluations: 0,
            translate_seconds: 0.0,
            dice_seconds: 0.0,
            build_seconds: 0.0,
            segments: 0,
        }
    }
}

/// Prepares one prim, which is part of the instancers of `chain`. Never fails: what cannot be rendered is
/// left out with a warning. `old` is what it was before, where only its place may have changed.
pub(super) fn prepare_prim(
    prim: &PrimDesc,
    chain: &Chain,
    old: Option<&PrimObjects>,
    context: &Context<'_>,
) -> PrimObjects {
    let start = Instant::now();
    let mut out = translate(prim, chain, old, context);
    out.translate_seconds = start.elapsed().as_secs_f64() - out.dice_seconds - out.build_seconds;
    out
}

fn translate(
    prim: &PrimDesc,
    chain: &Chain,
    old: Option<&PrimObjects>,
    context: &Context<'_>,
) -> PrimObjects {
    let mut out = PrimObjects::empty();
    let path = &prim.common.path;
    let common = &prim.common;
    let mut warnings = Vec::new();
    let shutter = prim_shutter(path, common.blur_scale, context.shutter, &mut warnings);
    let places = Places::new(prim, shutter, context.instancers);
    out.primvars.asked = asked_of(prim, chain, context.primvar_aovs)
        .cloned()
        .collect();
    if let Ok(Places::Many(placements)) = &places
        && placements.count() == 0
    {
        return out;
    }
    let tolerance = |bounds: &ObjectBounds| {
        let pixels = places.as_ref().map_or(0.0, |p| p.pixels(context, bounds));
        CHORD_TOLERANCE / pixels
    };
    let context = &Context {
        shutter,
        bends: match common.nonlinear_samples {
            Some(count) => Bends::Samples(count),
            None => Bends::Within(&tolerance),
        },
        ..*context
    };
    let make = |out: &mut PrimObjects| {
        let shape = shape::make(prim, context, out);
        out.warnings.extend(warnings.iter().cloned());
        shape
    };
    match &places {
        Ok(Places::One(hierarchy)) => {
            if let Some(shape) = make(&mut out) {
                let matrix = |t: f64| hierarchy.matrix(t);
                let keys = hierarchy.key_times();
                let shape: Arc<dyn Shape> = shape.into();
                out.flatten(path, Flat::Once(&shape), &matrix, &keys, 0, context);
            }
        }
        Ok(Places::Many(placements)) => {
            out.given = Given::new(prim, placements, context.primvar_aovs);
            out.instance(path, placements, old, make, context);
        }
        Err(error) => {
            out.warnings.extend(warnings.iter().cloned());
            out.drop_prim(path, Code::NotFinite, &error.to_string());
        }
    }
    out
}

/// Where a prim is over the shutter.
enum Places {
    One(Hierarchy),
    /// A part of instancers.
    Many(Placements),
}

impl Places {
    fn new(
        prim: &PrimDesc,
        shutter: Shutter,
        instancers: &HashMap<PrimId, Arc<Instancer>>,
    ) -> Result<Self, TransformError> {
        let hierarchy = Hierarchy::new(&prim.common.transform, shutter)?;
        let of = |(id, prototype)| Some((instancers.get(&id)?.clone(), prototype));
        Ok(match prim.common.instancer.and_then(of) {
            Some((instancer, prototype)) => {
                Self::Many(Placements::new(instancer, prototype, hierarchy))
            }
            None => Self::One(hierarchy),
        })
    }

    /// Pixels per object-space unit where the prim is largest over the shutter.
    fn pixels(&self, context: &Context<'_>, bounds: &ObjectBounds) -> f64 {
        let camera = context.camera;
        match self {
            Self::One(hierarchy) => {
                let keys = hierarchy.key_times();
                let times = keys.iter().chain(camera.key_times());
                let pixels = times.map(|&t| {
                    instance_pixels(&camera.raster_view(t), &hierarchy.matrix(t), bounds)
                });
                pixels.fold(0.0f64, f64::max)
            }
            Self::Many(placements) => {
                instances::largest_pixels(placements, bounds, camera, context.cancel)
            }
        }
    }
}

/// What is placed with its vertices in world space.
#[derive(Clone, Copy)]
pub(super) enum Flat<'a> {
    /// A prim that appears once.
    Once(&'a Arc<dyn Shape>),
    /// One of its many instances.
    OneOfMany(&'a dyn Shape),
}

impl PrimObjects {
    /// Primvars that AOVs ask for: its own, and those that it is given.
    pub fn sources(&self) -> impl Iterator<Item = &PrimPrimvar> {
        self.primvars.sources.iter().chain(&self.given.primvars)
    }

    pub fn warn(&mut self, path: &str, code: Code, text: impl Into<String>) {
        self.warnings.push(Warning::new(path, code, text));
    }

    pub fn drop_prim(&mut self, path: &str, code: Code, why: &str) {
        self.warn(path, code, format!("{why}; the prim is dropped"));
    }

    /// Places the shape once, with its vertices in world space.
    pub(super) fn flatten(
        &mut self,
        path: &str,
        flat: Flat<'_>,
        matrix: &dyn Fn(f64) -> DAffine3,
        matrix_keys: &[f64],
        instance_id: i32,
        context: &Context<'_>,
    ) {
        let shape = match flat {
            Flat::Once(shape) => shape.as_ref(),
            Flat::OneOfMany(shape) => shape,
        };
        let points = match route::flatten(shape.points(), matrix, matrix_keys, context.camera) {
            Ok(points) => points,
            Err(error) => return self.drop_prim(path, Code::NotFinite, &error.to_string()),
        };
        let views = views_at_keys(context.camera, points.key_times());
        let metric = RasterMetric::new(&views, points.origin());
        let target = Target {
            path: &points,
            metric: &metric,
            instanced: false,
        };
        self.segments = self.segments.max(points.key_times().len() - 1);
        let keys = points.key_times();
        let matrices = (0..keys.len()).map(|k| points.matrix(k).matrix3).collect();
        let winding = Winding::placed(shape.is_left_handed(), keys, matrices);
        if let Flat::Once(shape) = flat {
            self.diced_for = Some(DicedFor::new(shape.as_ref(), &points, &metric, context));
        }
        if let Flat::Once(shape) = flat
            && self.place_clusters(shape, &points, &metric, &winding, context)
        {
            return;
        }
        if let Some(geometry) = self.build(path, shape, &target, context) {
            let place = Shift::new(DVec3::ZERO, geometry.mesh().origin, instance_id);
            let set = Arc::new(InstanceSet::translated(geometry, vec![place]));
            self.placed.push(PlacedSet {
                set,
                winding,
                numbers: Vec::new(),
            });
        }
    }

    pub(super) fn build(
        &mut self,
        path: &str,
        shape: &dyn Shape,
        target: &Target<'_>,
        context: &Context<'_>,
    ) -> Option<Arc<ObjectGeometry>> {
        let start = Instant::now();
        self.diced = true;
        let diced = shape.dice(path, target, context, self)?;
        self.dice_seconds += start.elapsed().as_secs_f64();
        if diced.grids.is_empty() {
            return None;
        }
        let start = Instant::now();
        let geometry = context.object(diced);
        self.build_seconds += start.elapsed().as_secs_f64();
        let lost = geometry.stats().dropped_grids;
        if lost > 0 {
            self.warn(
                path,
                Code::NotFinite,
                format!("{lost} grids are not finite; dropped"),
            );
        }
        Some(geometry)
    }
}
