//! One prim to traceable objects: check, resolve, surface, route, dice, build.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use glam::{DAffine3, DVec3, Vec3};

use crate::bvh::ObjectGeometry;
use crate::camera::Camera;
use crate::diagnostics::{Code, Warning};
use crate::dice::{DiceError, DiceInput, RasterMetric, dice};
use crate::grid::{DicedMesh, octahedral};
use crate::motion::{Hierarchy, PointPath, Shutter};
use crate::scene::prim::Geometry;
use crate::scene::{MeshDesc, PrimDesc, RenderSettings};
use crate::shade::{DEFAULT_ALBEDO, PrimShading, Source};
use crate::surface::polygon::PolygonSurface;
use crate::surface::{Channel, LimitSurface, Orientation, Scheme, SubdivisionFactory};
use crate::trace::InstanceTransform;
use crate::translate::measure::{ObjectBounds, largest_scale, pixels_per_unit, views_at_keys};
use crate::translate::mesh::{self, CheckedMesh, PointKeys};
use crate::translate::route::{self, MatrixPath};
use crate::translate::{grids, primvar};

/// What every prim is prepared with.
pub(super) struct Context<'a> {
    pub camera: &'a Camera,
    pub shutter: Shutter,
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

/// A prim's geometry before it is placed: how to dice it along a path.
enum Shape {
    Surface {
        surface: Box<dyn LimitSurface>,
        mesh: Box<CheckedMesh>,
        normals: Option<Source>,
    },
    Grids {
        desc: grids::CheckedGrids,
    },
}

impl Shape {
    fn points(&self) -> &PointKeys {
        match self {
            Shape::Surface { mesh, .. } => &mesh.points,
            Shape::Grids { desc } => &desc.points,
        }
    }

    fn is_left_handed(&self) -> bool {
        match self {
            Shape::Surface { mesh, .. } => mesh.topology.orientation == Orientation::LeftHanded,
            Shape::Grids { .. } => false,
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
    let shape = match &prim.geometry {
        Geometry::Mesh(desc) => mesh_shape(prim, desc, context, &mut out),
        Geometry::Grids(desc) => {
            let desc = grids::check(path, desc, context.shutter, &mut out.warnings);
            if let Some(desc) = &desc {
                grid_shading(prim, desc, &mut out);
            }
            desc.map(|desc| Shape::Grids { desc })
        }
    };
    let Some(shape) = shape else { return out };
    let hierarchy = match Hierarchy::new(&prim.common.transform, context.shutter) {
        Ok(hierarchy) => hierarchy,
        Err(error) => {
            out.drop_prim(path, Code::NotFinite, &error.to_string());
            return out;
        }
    };
    match &prim.common.instances {
        None => {
            let matrix = |t: f64| hierarchy.matrix(t);
            out.flatten(path, &shape, &matrix, &hierarchy.key_times(), 0, context);
        }
        Some(instances) => match route::instance_paths(instances, &hierarchy, context.shutter) {
            Ok(paths) => {
                let id = |i: usize| instances.ids.get(i).copied().unwrap_or(i as i32);
                out.instance(path, &shape, &paths, &id, context);
            }
            Err(error) => out.drop_prim(path, Code::TimeSamples, &error.to_string()),
        },
    }
    out
}

impl PrimObjects {
    fn warn(&mut self, path: &str, code: Code, text: impl Into<String>) {
        self.warnings.push(Warning::new(path, code, text));
    }

    fn drop_prim(&mut self, path: &str, code: Code, why: &str) {
        self.warn(path, code, format!("{why}; the prim is dropped"));
    }

    /// Places the shape once, with its vertices in world space.
    fn flatten(
        &mut self,
        path: &str,
        shape: &Shape,
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
        self.segments = self.segments.max(points.key_times().len() - 1);
        if let Some(geometry) = self.build(path, shape, &points, &metric, context) {
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
        shape: &Shape,
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
            if let Some(geometry) = self.build(path, shape, &points, &metric, context) {
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
        shape: &Shape,
        points: &PointPath,
        metric: &RasterMetric,
        context: &Context<'_>,
    ) -> Option<Arc<ObjectGeometry>> {
        let start = Instant::now();
        let diced = match shape {
            Shape::Grids { desc } => desc.place(points),
            Shape::Surface {
                surface,
                mesh,
                normals,
            } => {
                let input = DiceInput {
                    surface: surface.as_ref(),
                    path: points,
                    metric,
                    shading_rate: context.settings.shading_rate,
                    // Facets need none: the tracer has the triangle at the ray's own time.
                    with_normals: !surface.is_polygonal(),
                    polygons_coarse: true,
                    max_micropolygons: context.settings.max_micropolygons,
                    cancel: context.cancel,
                };
                let output = match dice(&input) {
                    Ok(output) => output,
                    Err(DiceError::Cancelled) => return None,
                    Err(error) => {
                        self.drop_prim(path, Code::Budget, &error.to_string());
                        return None;
                    }
                };
                self.limit_evaluations += output.limit_evaluations;
                if output.coarsened {
                    let text = format!(
                        "needs more than {} micropolygons at this shading rate; it is diced more \
                         coarsely",
                        context.settings.max_micropolygons
                    );
                    self.warn(path, Code::Budget, text);
                }
                if output.dropped_faces > 0 {
                    let text = format!(
                        "{} faces have a limit surface that is not finite; dropped",
                        output.dropped_faces
                    );
                    self.warn(path, Code::NotFinite, text);
                }
                let mut diced = output.mesh;
                for grid in &mut diced.grids {
                    grid.element = mesh.elements[grid.element as usize];
                }
                if let Some(normals) = normals {
                    author_normals(&mut diced, normals, points);
                }
                diced
            }
        };
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

/// Pixels per object-space unit of an instance, at its largest over the shutter.
fn instance_pixels(camera: &Camera, path: &MatrixPath, bounds: &ObjectBounds) -> f64 {
    let times = path.key_times.iter().chain(camera.key_times());
    times
        .map(|&t| {
            let m = path.at(t);
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

/// Checks a mesh and makes its surface and shading.
fn mesh_shape(
    prim: &PrimDesc,
    desc: &MeshDesc,
    context: &Context<'_>,
    out: &mut PrimObjects,
) -> Option<Shape> {
    let path = &prim.common.path;
    let mesh = mesh::check(path, desc, context.shutter, &mut out.warnings)?;
    let mut channels = Vec::new();
    let mut source = |name: &str, width: usize, warnings: &mut Vec<Warning>| {
        let primvar = prim.common.primvars.get(name)?;
        let resolved = primvar::resolve(path, name, primvar, width, &mesh, warnings)?;
        Some(Source::from_resolved(resolved, width, &mut channels))
    };
    let color = source("displayColor", 3, &mut out.warnings);
    let opacity = source("displayOpacity", 1, &mut out.warnings);
    // USD: authored normals are for polygons; a subdivision surface has its own.
    let polygonal = mesh.topology.scheme == Scheme::None;
    let normals = if polygonal {
        source("normals", 3, &mut out.warnings)
    } else {
        None
    };
    out.shading = PrimShading {
        color: color.unwrap_or(Source::Constant(DEFAULT_ALBEDO)),
        opacity: opacity.filter(|o| *o != Source::Constant([1.0; 3])),
    };
    let surface = make_surface(path, &mesh, channels, context.factory, &mut out.warnings)?;
    Some(Shape::Surface {
        surface,
        mesh: Box::new(mesh),
        normals,
    })
}

fn make_surface(
    path: &str,
    mesh: &CheckedMesh,
    channels: Vec<Channel>,
    factory: &dyn SubdivisionFactory,
    warnings: &mut Vec<Warning>,
) -> Option<Box<dyn LimitSurface>> {
    let points = &mesh.points.points;
    let mut why = None;
    if mesh.topology.scheme != Scheme::None {
        match factory.create(&mesh.topology, points, channels.clone()) {
            Ok(surface) => {
                let notes = surface.notes().iter();
                warnings.extend(notes.map(|n| Warning::new(path, Code::Topology, n.clone())));
                return Some(surface);
            }
            Err(error) => why = Some(error.to_string()),
        }
    }
    match PolygonSurface::new(&mesh.topology, points, channels) {
        Ok(surface) => {
            if let Some(why) = why {
                let text = format!("{why}; rendered as polygons");
                warnings.push(Warning::new(path, Code::Topology, text));
            }
            Some(Box::new(surface))
        }
        Err(error) => {
            let text = format!("{error}; the prim is dropped");
            warnings.push(Warning::new(path, Code::Topology, text));
            None
        }
    }
}

/// Shading of pre-diced grids: constant and uniform primvars.
fn grid_shading(prim: &PrimDesc, desc: &grids::CheckedGrids, out: &mut PrimObjects) {
    let path = &prim.common.path;
    let mut source = |name: &str, width: usize| {
        let primvar = prim.common.primvars.get(name)?;
        grids::resolve_primvar(path, name, primvar, width, desc, &mut out.warnings)
    };
    let color = source("displayColor", 3);
    let opacity = source("displayOpacity", 1);
    out.shading = PrimShading {
        color: color.unwrap_or(Source::Constant(DEFAULT_ALBEDO)),
        opacity: opacity.filter(|o| *o != Source::Constant([1.0; 3])),
    };
}

/// Puts authored object-space normals in the place of the surface's own, carried along the path.
fn author_normals(mesh: &mut DicedMesh, source: &Source, path: &PointPath) {
    let keys = if path.turns_normals() {
        path.key_times().len()
    } else {
        1
    };
    let mut normals = Vec::with_capacity(mesh.vertex_count * keys);
    let (mut authored, mut placed) = (Vec::new(), Vec::new());
    for grid in &mesh.grids {
        let first = grid.first_vertex as usize;
        let n = grid.vertex_count();
        let value = |v: usize| {
            let [x, y, z] = source.value(grid.element, |channel| {
                let values = &mesh.channels[channel].values;
                [values[3 * v], values[3 * v + 1], values[3 * v + 2]]
            });
            Vec3::new(x, y, z).normalize_or_zero()
        };
        authored.clear();
        for _ in 0..path.point_key_count() {
            authored.extend((first..first + n).map(value));
        }
        path.map_normals(&authored, n, &mut placed);
        normals.extend(placed[..n * keys].iter().map(|&v| octahedral::encode(v)));
    }
    mesh.normal_key_count = keys;
    mesh.normals = normals;
}
