//! Meshes: subdivision surfaces and polygons.

use glam::Vec3;

use super::surface::dice_surface;
use super::{Shape, Target};
use crate::diagnostics::{Code, Warning};
use crate::grid::{DicedMesh, octahedral};
use crate::motion::PointPath;
use crate::render::objects::{Context, PrimObjects};
use crate::scene::{MeshDesc, PrimDesc};
use crate::shade::{DEFAULT_ALBEDO, PrimShading, Source};
use crate::surface::polygon::PolygonSurface;
use crate::surface::{Channel, LimitSurface, Orientation, Scheme, SubdivisionFactory};
use crate::translate::mesh::{CheckedMesh, check};
use crate::translate::points::PointKeys;
use crate::translate::primvar;

struct Mesh {
    surface: Box<dyn LimitSurface>,
    mesh: CheckedMesh,
    normals: Option<Source>,
}

impl Shape for Mesh {
    fn points(&self) -> &PointKeys {
        &self.mesh.points
    }

    fn is_left_handed(&self) -> bool {
        self.mesh.topology.orientation == Orientation::LeftHanded
    }

    fn dice(
        &self,
        path: &str,
        target: &Target<'_>,
        context: &Context<'_>,
        out: &mut PrimObjects,
    ) -> Option<DicedMesh> {
        let mut diced = dice_surface(path, self.surface.as_ref(), target, context, out)?;
        for grid in &mut diced.grids {
            grid.element = self.mesh.elements[grid.element as usize];
        }
        if let Some(normals) = &self.normals {
            author_normals(&mut diced, normals, target.path);
        }
        Some(diced)
    }
}

/// Checks a mesh and makes its surface and shading.
pub(super) fn make(
    prim: &PrimDesc,
    desc: &MeshDesc,
    context: &Context<'_>,
    out: &mut PrimObjects,
) -> Option<Box<dyn Shape>> {
    let path = &prim.common.path;
    let mesh = check(
        path,
        desc,
        context.shutter,
        context.bends,
        &mut out.warnings,
    )?;
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
    Some(Box::new(Mesh {
        surface,
        mesh,
        normals,
    }))
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
