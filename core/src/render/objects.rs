//! One prim to traceable objects: check, resolve, surface, route, dice, build.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use glam::{DAffine3, DVec3};

use super::shape::{self, Shape, Target};
use crate::bvh::ObjectGeometry;
use crate::camera::Camera;
use crate::diagnostics::{Code, Warning};
use crate::dice::RasterMetric;
use crate::motion::{Hierarchy, PointPath, Shutter};
use crate::scene::{PrimDesc, RenderSettings};
use crate::shade::{DEFAULT_ALBEDO, PrimShading, Source};
use crate::surface::SubdivisionFactory;
use crate::trace::InstanceTransform;
use crate::translate::blur::prim_shutter;
use crate::translate::measure::{
    CHORD_TOLERANCE, ObjectBounds, largest_scale, pixels_per_unit, views_at_keys,
};
use crate::translate::points::Bends;
use crate::translate::route::{self, MatrixPath, RouteError};

/// What a prim is prepared with.
#[derive(Clone, Copy)]
pub(super) struct Context<'a> {
    pub camera: &'a Camera,
    /// The camera's; while one prim is prepared, the shutter of its motion (its blur scaled).
    pub shutter: Shutter,
    /// Keys of paths that bend, of the prim that is prepared.
    pub bends: Bends<'a>,
    pub settings: &'a RenderSettings,
    pub factory: &'a dyn SubdivisionFactory,
    pub cancel: &'a AtomicBool,
}

/// One appearance of an object.
#[derive(Clone, Debug)]
pub(super) struct Placed {
    pub geometry: Arc<ObjectGeometry>,
    pub transform: InstanceTransform,
    pub instance_id: i32,
    /// The mesh stores no normals, and its facets' outside is not where its lattices' is.
    pub flip: bool,
}

/// What one prim became.
#[derive(Clone, Debug)]
pub(super) struct PrimObjects {
    pub shading: PrimShading,
    pub placed: Vec<Placed>,
    pub warnings: Vec<Warning>,
    pub limit_evaluations: u64,
    /// Checking, surfaces and paths: all that is not dicing or building.
    pub translate_seconds: f64,
    pub dice_seconds: f64,
    pub build_seconds: f64,
    /// Straight segments of the path with the most; 0 when nothing moves.
    pub segments: usize,
}

impl PrimObjects {
    fn empty() -> Self {
        let color = Source::Constant(DEFAULT_ALBEDO);
        Self {
            shading: PrimShading {
                color,
                opacity: None,
            },
            placed: Vec::new(),
            warnings: Vec::new(),
            limit_evaluations: 0,
            translate_seconds: 0.0,
            dice_seconds: 0.0,
            build_seconds: 0.0,
            segments: 0,
        }
    }
}

/// Prepares one prim. Never fails: what cannot be rendered is left out with a warning.
pub(super) fn prepare_prim(prim: &PrimDesc, context: &Context<'_>) -> PrimObjects {
    let start = Instant::now();
    let mut out = translate(prim, context);
    out.translate_seconds = start.elapsed().as_secs_f64() - out.dice_seconds - out.build_seconds;
    out
}

fn translate(prim: &PrimDesc, context: &Context<'_>) -> PrimObjects {
    let mut out = PrimObjects::empty();
    let path = &prim.common.path;
    let common = &prim.common;
    let mut warnings = Vec::new();
    let shutter = prim_shutter(path, common.blur_scale, context.shutter, &mut warnings);
    let places = Places::new(prim, shutter);
    let tolerance = |bounds: &ObjectBounds| {
        let pixels = places
            .as_ref()
            .map_or(0.0, |p| p.pixels(context.camera, bounds));
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
    let Some(shape) = shape::make(prim, context, &mut out) else {
        return out;
    };
    let shape = shape.as_ref();
    out.warnings.append(&mut warnings);
    match &places {
        Ok(Places::One(hierarchy)) => {
            let matrix = |t: f64| hierarchy.matrix(t);
            out.flatten(path, shape, &matrix, &hierarchy.key_times(), 0, context);
        }
        Ok(Places::Many(paths, ids)) => {
            let id = |i: usize| ids.get(i).copied().unwrap_or(i as i32);
            out.instance(path, shape, paths, &id, context);
        }
        Err((code, error)) => out.drop_prim(path, *code, &error.to_string()),
    }
    out
}

/// Where a prim is over the shutter.
enum Places<'a> {
    One(Hierarchy),
    /// Paths of instances, and their ids.
    Many(Vec<Option<MatrixPath>>, &'a [i32]),
}

impl<'a> Places<'a> {
    fn new(prim: &'a PrimDesc, shutter: Shutter) -> Result<Self, (Code, RouteError)> {
        let hierarchy = Hierarchy::new(&prim.common.transform, shutter)
            .map_err(|error| (Code::NotFinite, error.into()))?;
        let Some(instances) = &prim.common.instances else {
            return Ok(Self::One(hierarchy));
        };
        route::instance_paths(instances, &hierarchy, shutter)
            .map(|paths| Self::Many(paths, &instances.ids))
            .map_err(|error| (Code::TimeSamples, error))
    }

    /// Pixels per object-space unit where the prim is largest over the shutter.
    fn pixels(&self, camera: &Camera, bounds: &ObjectBounds) -> f64 {
        match self {
            Self::One(hierarchy) => largest_pixels(
                camera,
                &|t| hierarchy.matrix(t),
                &hierarchy.key_times(),
                bounds,
            ),
            Self::Many(paths, _) => {
                let pixels = |p: &MatrixPath| instance_pixels(camera, p, bounds);
                paths.iter().flatten().map(pixels).fold(0.0, f64::max)
            }
        }
    }
}

impl PrimObjects {
    pub fn warn(&mut self, path: &str, code: Code, text: impl Into<String>) {
        self.warnings.push(Warning::new(path, code, text));
    }

    pub fn drop_prim(&mut self, path: &str, code: Code, why: &str) {
        self.warn(path, code, format!("{why}; the prim is dropped"));
    }

    /// Places the shape once, with its vertices in world space.
    fn flatten(
        &mut self,
        path: &str,
        shape: &dyn Shape,
        matrix: &dyn Fn(f64) -> DAffine3,
        matrix_keys: &[f64],
        instance_id: i32,
        context: &Context<'_>,
    ) {
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
        if let Some(geometry) = self.build(path, shape, &target, context) {
            let transform = InstanceTransform::Translation(DVec3::ZERO);
            let mirrored = matrix(matrix_keys[0]).matrix3.determinant() < 0.0;
            let flip =
                geometry.mesh().normal_key_count == 0 && (mirrored != shape.is_left_handed());
            self.placed.push(Placed {
                geometry,
                transform,
                instance_id,
                flip,
            });
        }
    }

    /// Places the shape at every path, diced once where rays can be carried into object space.
    fn instance(
        &mut self,
        path: &str,
        shape: &dyn Shape,
        paths: &[Option<MatrixPath>],
        id: &dyn Fn(usize) -> i32,
        context: &Context<'_>,
    ) {
        let lost = paths.iter().filter(|p| p.is_none()).count();
        if lost > 0 {
            let text = format!(
                "{lost} of {} instances have no finite transform; dropped",
                paths.len()
            );
            self.warn(path, Code::NotFinite, text);
        }
        let numbered = || {
            paths
                .iter()
                .enumerate()
                .filter_map(|(i, p)| Some((i, p.as_ref()?)))
        };
        let (shared, alone): (Vec<_>, Vec<_>) = numbered().partition(|(_, p)| p.is_invertible());
        if !shared.is_empty() {
            let bounds = ObjectBounds::of(&shape.points().points);
            let scale = shared
                .iter()
                .map(|(_, p)| instance_pixels(context.camera, p, &bounds))
                .fold(0.0f64, f64::max);
            let points = PointPath::identity(&shape.points().times, bounds.centre());
            self.segments = self.segments.max(points.key_times().len() - 1);
            let metric = RasterMetric::uniform(scale as f32);
            let target = Target {
                path: &points,
                metric: &metric,
                instanced: true,
            };
            if let Some(geometry) = self.build(path, shape, &target, context) {
                let flip = geometry.mesh().normal_key_count == 0 && shape.is_left_handed();
                for (i, p) in shared {
                    self.segments = self.segments.max(p.key_times.len() - 1);
                    let transform = match p.matrices.as_slice() {
                        [m] => InstanceTransform::Static(*m),
                        _ => InstanceTransform::Moving {
                            key_times: p.key_times.iter().map(|&t| t as f32).collect(),
                            matrices: p.matrices.clone(),
                        },
                    };
                    let geometry = Arc::clone(&geometry);
                    self.placed.push(Placed {
                        geometry,
                        transform,
                        instance_id: id(i),
                        flip,
                    });
                }
            }
        }
        for (i, p) in alone {
            self.flatten(path, shape, &|t| p.at(t), &p.key_times, id(i), context);
        }
        self.placed.sort_by_key(|p| p.instance_id);
    }

    fn build(
        &mut self,
        path: &str,
        shape: &dyn Shape,
        target: &Target<'_>,
        context: &Context<'_>,
    ) -> Option<Arc<ObjectGeometry>> {
        let start = Instant::now();
        let diced = shape.dice(path, target, context, self)?;
        self.dice_seconds += start.elapsed().as_secs_f64();
        if diced.grids.is_empty() {
            return None;
        }
        let start = Instant::now();
        let geometry = ObjectGeometry::new(diced);
        self.build_seconds += start.elapsed().as_secs_f64();
        let lost = geometry.stats().dropped_grids;
        if lost > 0 {
            self.warn(
                path,
                Code::NotFinite,
                format!("{lost} grids are not finite; dropped"),
            );
        }
        Some(Arc::new(geometry))
    }
}

/// The same of an instance.
fn instance_pixels(camera: &Camera, path: &MatrixPath, bounds: &ObjectBounds) -> f64 {
    largest_pixels(camera, &|t| path.at(t), &path.key_times, bounds)
}

/// Pixels per object-space unit of a prim under `matrix(time)`, at its largest over the shutter.
fn largest_pixels(
    camera: &Camera,
    matrix: &dyn Fn(f64) -> DAffine3,
    key_times: &[f64],
    bounds: &ObjectBounds,
) -> f64 {
    let times = key_times.iter().chain(camera.key_times());
    times
        .map(|&t| {
            let m = matrix(t);
            // Off-screen instances must not decide the rate: those wholly behind the camera count less.
            let view = camera.raster_view(t);
            let centre = view
                .world_to_camera
                .transform_point3(m.transform_point3(bounds.centre()));
            let behind = !view.orthographic && centre.z > bounds.radius() * largest_scale(&m);
            pixels_per_unit(&view, &m, bounds) * if behind { 0.125 } else { 1.0 }
        })
        .fold(0.0f64, f64::max)
}
