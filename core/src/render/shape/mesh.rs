//! Meshes: subdivision surfaces and polygons.

use std::sync::Arc;

use glam::Vec3;

use super::primvars::Primvars;
use super::surface::dice_surface;
use super::{Shape, Target};
use crate::diagnostics::{Code, Warning};
use crate::grid::{DicedMesh, octahedral};
use crate::motion::PointPath;
use crate::render::objects::{Context, PrimObjects};
use crate::scene::{MeshDesc, PrimDesc};
use crate::shade::{ChannelAccess, Source};
use crate::surface::polygon::PolygonSurface;
use crate::surface::{Channel, LimitSurface, Orientation, Scheme, SubdivisionFactory};
use crate::translate::mesh::{CheckedMesh, check};
use crate::translate::points::PointKeys;
use crate::translate::subsets;

struct Mesh {
    surface: Box<dyn LimitSurface>,
    mesh: CheckedMesh,
    normals: Option<Arc<Source>>,
}

impl Shape for Mesh {
    fn points(&self) -> &PointKeys {
        &self.mesh.points
    }

    fn is_left_handed(&self) -> bool {
        self.mesh.topology.orientation == Orientation::LeftHanded
    }

    fn surface(&self) -> Option<&dyn LimitSurface> {
        // Authored normals are put in when all is diced.
        self.normals.is_none().then_some(self.surface.as_ref())
    }

    fn element(&self, element: u32) -> u32 {
        self.mesh.elements[element as usize]
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
            grid.element = self.element(grid.element);
        }
        if let Some(normals) = &self.normals {
            let frame = context.shutter.normalize(0.0).clamp(0.0, 1.0) as f32;
            author_normals(&mut diced, normals, self, frame, target.path);
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
    subsets::check(path, &desc.subsets, mesh.authored_faces, &mut out.warnings);
    let spread = |resolved| mesh.spread(resolved);
    let counts = mesh.primvar_counts();
    let mut primvars = Primvars::new(&prim.common, counts, context.shutter, &spread);
    primvars.shading(out);
    // USD: authored normals are for polygons; a subdivision surface has its own.
    let normals = match mesh.topology.scheme {
        Scheme::None => primvars.floats("normals", 3, &mut out.warnings),
        _ => None,
    };
    let channels = primvars.finish(context, out);
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
/// They are those of the points' keys; where the points stand still, of the time `still`.
fn author_normals(
    mesh: &mut DicedMesh,
    source: &Source,
    shape: &Mesh,
    still: f32,
    path: &PointPath,
) {
    let keys = if path.turns_normals() {
        path.key_times().len()
    } else {
        1
    };
    let times = match shape.mesh.points.times.as_slice() {
        [_] => &[still],
        times => times,
    };
    let mut normals = Vec::with_capacity(mesh.vertex_count * keys);
    let (mut authored, mut placed) = (Vec::new(), Vec::new());
    for grid in &mesh.grids {
        let first = grid.first_vertex as usize;
        let n = grid.vertex_count();
        authored.clear();
        for &time in times {
            authored.extend((first..first + n).map(|v| {
                let mut value = [0.0; 3];
                source.read(grid.element, time, &AtVertex(mesh, v), &mut value);
                Vec3::from_array(value).normalize_or_zero()
            }));
        }
        path.map_normals(&authored, n, &mut placed);
        normals.extend(placed[..n * keys].iter().map(|&v| octahedral::encode(v)));
    }
    mesh.normal_key_count = keys;
    mesh.normals = normals;
}

/// Channels at a vertex.
struct AtVertex<'a>(&'a DicedMesh, usize);

impl ChannelAccess for AtVertex<'_> {
    fn smooth(&self, channel: usize, first: usize, out: &mut [f32]) {
        let Self(mesh, vertex) = self;
        let channel = &mesh.channels[channel];
        out.copy_from_slice(&channel.values[vertex * channel.width + first..][..out.len()]);
    }
    fn nearest(&self, channel: usize, first: usize, out: &mut [f32]) {
        self.smooth(channel, first, out);
    }
    fn instance(&self, _level: usize) -> usize {
        0 // what a prim itself has
    }
}
