//! Geometry prims: meshes and pre-diced grids, with their transforms, primvars and instances.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DMat4, Vec3};

use crate::surface::MeshTopology;

/// Matrix samples of one level of the hierarchy. Matrices map local to parent, column vectors
/// (USD's row-vector matrices in row-major order have the same sixteen numbers in memory).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TransformSamples {
    /// Time codes relative to the frame; any order; one or more.
    pub times: Vec<f64>,
    /// One matrix a time.
    pub matrices: Vec<DMat4>,
}

/// Point samples. Arrays may differ in length between samples: then one key is rendered, with a
/// warning.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointsSamples {
    /// Time codes relative to the frame; any order.
    pub times: Vec<f64>,
    /// Object-space points at each time.
    pub points: Vec<Arc<Vec<Vec3>>>,
}

/// UsdGeomPrimvar's interpolation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Interpolation {
    /// One value.
    Constant,
    /// One a face.
    Uniform,
    /// One a vertex, linear over faces.
    Varying,
    /// One a vertex, smoothed with the scheme.
    Vertex,
    /// One a face-vertex.
    FaceVarying,
}

/// A primvar, one sample.
#[derive(Clone, Debug, PartialEq)]
pub struct PrimvarDesc {
    /// Interpolation.
    pub interpolation: Interpolation,
    /// Floats per value.
    pub width: usize,
    /// `value_count * width` floats.
    pub values: Arc<Vec<f32>>,
    /// Indices into the values, or empty.
    pub indices: Arc<Vec<i32>>,
}

/// Instances of a prim: where a point of the prim goes is `instance * prim transform`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct InstancesDesc {
    /// Time codes relative to the frame.
    pub times: Vec<f64>,
    /// `[time][instance]` matrices.
    pub matrices: Vec<DMat4>,
    /// Number of instances.
    pub instance_count: usize,
    /// instanceId of each, or empty for 0, 1, 2...
    pub ids: Vec<i32>,
}

/// What all geometry prims have.
#[derive(Clone, Debug, PartialEq)]
pub struct PrimCommon {
    /// Path, for messages and metadata.
    pub path: String,
    /// Transform levels, the prim's own first, then its parent's, up to the root.
    pub transform: Vec<TransformSamples>,
    /// Instances, or none: the prim appears once.
    pub instances: Option<Arc<InstancesDesc>>,
    /// Primvars by name; `displayColor`, `displayOpacity` and `normals` are shaded with.
    pub primvars: BTreeMap<String, PrimvarDesc>,
    /// Visible to the camera.
    pub visible: bool,
    /// primId AOV value.
    pub pick_id: i32,
}

/// A polygon or subdivision mesh, unchecked.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshDesc {
    /// Options of the scheme; counts and indices in it are as authored (`vertex_count` is ignored:
    /// the points decide), and not checked yet.
    pub topology: Arc<MeshTopology>,
    /// Points.
    pub points: PointsSamples,
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

/// Geometry of one prim.
#[derive(Clone, Debug, PartialEq)]
pub enum Geometry {
    /// A mesh.
    Mesh(MeshDesc),
    /// Diced grids.
    Grids(GridsDesc),
}

/// One prim.
#[derive(Clone, Debug, PartialEq)]
pub struct PrimDesc {
    /// What all prims have.
    pub common: PrimCommon,
    /// Geometry.
    pub geometry: Geometry,
}

impl PrimCommon {
    /// A visible prim at the origin with no primvars.
    pub fn new(path: impl Into<String>) -> Self {
        Self {
            path: path.into(),
            transform: Vec::new(),
            instances: None,
            primvars: BTreeMap::new(),
            visible: true,
            pick_id: 0,
        }
    }
}
