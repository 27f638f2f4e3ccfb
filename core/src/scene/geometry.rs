//! Geometry as hosts describe it: raw samples and authored topology, unchecked.

use std::sync::Arc;

use glam::Vec3;

use super::SubsetDesc;
use crate::surface::{MeshTopology, Orientation};

/// An array at several times. Arrays may differ in length between samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Samples<T> {
    /// Time codes relative to the frame; any order.
    pub times: Vec<f64>,
    /// One array a time.
    pub values: Vec<Arc<Vec<T>>>,
}

impl<T> Default for Samples<T> {
    fn default() -> Self {
        Self {
            times: Vec::new(),
            values: Vec::new(),
        }
    }
}

/// Point samples. Arrays may differ in length between samples: then one key is rendered, with a
/// warning, unless velocities move it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointsSamples {
    /// Time codes relative to the frame; any order.
    pub times: Vec<f64>,
    /// Object-space points at each time.
    pub points: Vec<Arc<Vec<Vec3>>>,
    /// How points move on from their sample, or none.
    pub rates: Rates,
}

/// Velocities and accelerations of points, object space (UsdGeomPointBased): with them, points move
/// on from the sample at or before the frame, and later samples are not used.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rates {
    /// Units a second.
    pub velocities: Samples<Vec3>,
    /// Units a second squared.
    pub accelerations: Samples<Vec3>,
    /// The stage's time codes a second; rates are ignored where it is not above 0.
    pub time_codes_per_second: f64,
}

/// A polygon or subdivision mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshDesc {
    /// Options of the scheme; counts and indices in it are as authored (`vertex_count` is ignored:
    /// the points decide), and not checked yet.
    pub topology: Arc<MeshTopology>,
    /// Points.
    pub points: PointsSamples,
    /// Subsets of its faces; the AOV subsetId has their numbers in this list.
    pub subsets: Arc<Vec<SubsetDesc>>,
}

/// Grids that the host has diced itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GridsDesc {
    /// Time codes relative to the frame, one a position key.
    pub times: Vec<f64>,
    /// (nu, nv, element) of each grid, rates 1 to 16.
    pub grids: Vec<(u16, u16, u32)>,
    /// Object-space positions: for each grid, for each key, (nv+1) rows of (nu+1) vertices.
    pub positions: Arc<Vec<Vec3>>,
}

/// A coordinate axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(missing_docs)] // they are what they are called
pub enum Axis {
    X,
    Y,
    #[default]
    Z,
}

/// UsdGeom's implicit prims, about the origin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ImplicitKind {
    /// Sizes: edge.
    #[default]
    Cube,
    /// A rectangle that faces along the axis. Sizes: width, length.
    Plane,
    /// Sizes: radius.
    Sphere,
    /// Closed. Sizes: height along the axis, radius at its lower and at its upper end.
    Cylinder,
    /// Closed, with its apex up the axis. Sizes: height, radius.
    Cone,
    /// A cylinder with domes that touch its side. Sizes: height of the side, its radius at its lower
    /// and at its upper end.
    Capsule,
}

/// An implicit prim. Primvars of a cube or a plane have values for the faces and vertices of the mesh that
/// Hydra draws for it (a cube's faces are +z, -z, +y, -y, +x, -x), and elementId is its face; others
/// have one value, and elementId 0.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImplicitDesc {
    /// What it is.
    pub kind: ImplicitKind,
    /// The axis, for kinds that have one.
    pub axis: Axis,
    /// Winding: left-handed turns the outside in.
    pub orientation: Orientation,
    /// Time codes relative to the frame; any order.
    pub times: Vec<f64>,
    /// Sizes at each time, as [`ImplicitKind`] lists them, 0 where it has fewer.
    pub sizes: Vec<[f64; 3]>,
}

/// A tensor product of NURBS (UsdGeomNurbsPatch); elementId is 0. Whether it is closed is seen from the
/// points. Pairs are along u and along v; numbers are as authored.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NurbsPatchDesc {
    /// Points along u and along v; u runs fastest.
    pub vertex_counts: [i32; 2],
    /// Degree plus one.
    pub orders: [i32; 2],
    /// Knots, as many as points and order.
    pub knots: [Arc<Vec<f64>>; 2],
    /// Parameters from and to which it is rendered, or all.
    pub ranges: [Option<[f64; 2]>; 2],
    /// Weights of the points, which are not multiplied by them; empty: all are 1.
    pub weights: Arc<Vec<f64>>,
    /// Winding: the front of a right-handed patch is where u, v and the normal are right-handed.
    pub orientation: Orientation,
    /// Control points.
    pub points: PointsSamples,
}

/// How curves go between their points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CurveBasis {
    /// Straight lines.
    #[default]
    Linear,
    /// Cubic Bezier, a segment every three points.
    Bezier,
    /// Uniform cubic B-spline.
    Bspline,
    /// Catmull-Rom.
    CatmullRom,
    /// Cubic Hermite, positions and tangents by turns.
    Hermite,
}

/// How curves end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CurveWrap {
    /// As the basis has it.
    #[default]
    Nonperiodic,
    /// The last segment ends at the first point.
    Periodic,
    /// B-splines and Catmull-Rom curves reach their first and last points.
    Pinned,
}

/// What curves without normals are rendered as.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum CurveForm {
    /// Tubes where a curve is wide on screen, else ribbons.
    #[default]
    Auto,
    /// Flat ribbons that face the camera, shaded as if they were round. Instanced curves, which many
    /// cameras' views share, are tubes all the same.
    Ribbons,
    /// Round tubes, closed at their ends.
    Tubes,
}

/// Curves (UsdGeomBasisCurves). The primvar `widths` gives diameters, `normals` turns them to flat
/// ribbons that lie across these; elementId is the curve.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CurvesDesc {
    /// Basis.
    pub basis: CurveBasis,
    /// Wrap.
    pub wrap: CurveWrap,
    /// Points of each curve, as authored.
    pub vertex_counts: Arc<Vec<i32>>,
    /// Control points.
    pub points: PointsSamples,
    /// What they are rendered as where they have no normals; `None`: as the settings say.
    pub form: Option<CurveForm>,
}

/// NURBS curves (UsdGeomNurbsCurves); primvars as for [`CurvesDesc`], a `varying` one with a value at
/// each end of a segment: points less order plus 2.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NurbsCurvesDesc {
    /// Points of each curve, as authored.
    pub vertex_counts: Arc<Vec<i32>>,
    /// Degree plus one of each curve.
    pub orders: Arc<Vec<i32>>,
    /// Knots of all curves: each has as many as points and order.
    pub knots: Arc<Vec<f64>>,
    /// Parameters of each curve from and to which it is rendered; 0 and 0, or none, for all.
    pub ranges: Arc<Vec<[f64; 2]>>,
    /// Weights of the points, which are not multiplied by them; empty: all are 1.
    pub weights: Arc<Vec<f64>>,
    /// What they are rendered as where they have no normals; `None`: as the settings say.
    pub form: Option<CurveForm>,
    /// Control points.
    pub points: PointsSamples,
}

/// Spheres (UsdGeomPoints). The primvar `widths` gives diameters; elementId is the point.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SpheresDesc {
    /// Centres.
    pub points: PointsSamples,
}

/// Geometry of one prim.
#[derive(Clone, Debug, PartialEq)]
pub enum Geometry {
    /// A mesh.
    Mesh(MeshDesc),
    /// Diced grids.
    Grids(GridsDesc),
    /// A cube, sphere and so on.
    Implicit(ImplicitDesc),
    /// A NURBS patch.
    NurbsPatch(NurbsPatchDesc),
    /// NURBS curves.
    NurbsCurves(NurbsCurvesDesc),
    /// Curves.
    Curves(CurvesDesc),
    /// Spheres.
    Spheres(SpheresDesc),
}

impl Geometry {
    /// True for surfaces with a front and a back. Curves and points are bodies that are seen from
    /// without, or ribbons that turn to the camera.
    pub fn has_sides(&self) -> bool {
        match self {
            Geometry::Mesh(_)
            | Geometry::Grids(_)
            | Geometry::Implicit(_)
            | Geometry::NurbsPatch(_) => true,
            Geometry::NurbsCurves(_) | Geometry::Curves(_) | Geometry::Spheres(_) => false,
        }
    }

    /// The points of kinds that have some.
    pub fn points_mut(&mut self) -> Option<&mut PointsSamples> {
        match self {
            Geometry::Mesh(mesh) => Some(&mut mesh.points),
            Geometry::NurbsPatch(patch) => Some(&mut patch.points),
            Geometry::NurbsCurves(curves) => Some(&mut curves.points),
            Geometry::Curves(curves) => Some(&mut curves.points),
            Geometry::Spheres(spheres) => Some(&mut spheres.points),
            Geometry::Grids(_) | Geometry::Implicit(_) => None,
        }
    }
}
