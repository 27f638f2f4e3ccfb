//! A prim's geometry between checking and placing: one module a kind.
//!
//! [`make`] checks a prim's description and answers a [`Shape`], or nothing where nothing is left to
//! render (with warnings that say why). A shape is diced once for every [`Target`] it is placed at.

mod curves;
mod grids;
mod implicit;
mod mesh;
mod nurbs;
mod primvars;
mod spheres;
mod surface;

use super::objects::{Context, PrimObjects};
use crate::dice::RasterMetric;
use crate::grid::DicedMesh;
use crate::motion::PointPath;
use crate::scene::{Geometry, PrimDesc};
use crate::surface::LimitSurface;
use crate::translate::points::PointKeys;

/// Where, and how finely, a shape is diced.
pub(super) struct Target<'a> {
    /// From object-space points at their keys to output keys, in the space that is traced.
    pub path: &'a PointPath,
    /// Pixels per unit of that space.
    pub metric: &'a RasterMetric,
    /// Diced in object space and shared by many instances: nothing may depend on where the camera
    /// is. Otherwise the space is the world's, relative to the path's origin.
    pub instanced: bool,
}

/// Checked geometry that can be diced.
pub(super) trait Shape: Send + Sync {
    /// Object-space points that bound the shape and carry its motion, at keys of the shutter.
    fn points(&self) -> &PointKeys;

    /// True where the authored outside is not that of the lattices (`dP/du x dP/dv`).
    fn is_left_handed(&self) -> bool {
        false
    }

    /// The limit surface, where that is all that is diced.
    fn surface(&self) -> Option<&dyn LimitSurface> {
        None
    }

    /// True where it is shaped to face the camera.
    fn faces_camera(&self) -> bool {
        false
    }

    /// The authored face of an element of the surface.
    fn element(&self, element: u32) -> u32 {
        element
    }

    /// Grids for `target`; `None`, with a warning in `out`, where the prim is dropped.
    fn dice(
        &self,
        path: &str,
        target: &Target<'_>,
        context: &Context<'_>,
        out: &mut PrimObjects,
    ) -> Option<DicedMesh>;
}

/// Checks a prim's geometry and its shading.
pub(super) fn make(
    prim: &PrimDesc,
    context: &Context<'_>,
    out: &mut PrimObjects,
) -> Option<Box<dyn Shape>> {
    match &prim.geometry {
        Geometry::Mesh(desc) => mesh::make(prim, desc, context, out),
        Geometry::Grids(desc) => grids::make(prim, desc, context, out),
        Geometry::Implicit(desc) => implicit::make(prim, desc, context, out),
        Geometry::NurbsPatch(desc) => nurbs::make(prim, desc, context, out),
        Geometry::NurbsCurves(desc) => nurbs::make_curves(prim, desc, context, out),
        Geometry::Curves(desc) => curves::make(prim, desc, context, out),
        Geometry::Spheres(desc) => spheres::make(prim, desc, context, out),
    }
}
