//! Mesh topology and subdivision options, with UsdGeomMesh's names and meanings.

/// subdivisionScheme.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Scheme {
    /// Catmull-Clark (USD's default).
    #[default]
    CatmullClark,
    /// Loop; triangles only.
    Loop,
    /// Bilinear.
    Bilinear,
    /// Polygons.
    None,
}

/// interpolateBoundary.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum BoundaryInterpolation {
    /// Boundary faces have no limit surface.
    None,
    /// Boundary edges are sharp.
    EdgeOnly,
    /// Boundary edges and corners are sharp (USD's default).
    #[default]
    EdgeAndCorner,
}

/// faceVaryingLinearInterpolation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum FaceVaryingLinear {
    /// Smooth everywhere.
    None,
    /// Sharpen corners only.
    CornersOnly,
    /// USD's default.
    #[default]
    CornersPlus1,
    /// As CornersPlus1, and more.
    CornersPlus2,
    /// Sharpen boundaries.
    Boundaries,
    /// Linear everywhere.
    All,
}

/// triangleSubdivisionRule.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum TriangleRule {
    /// Catmull-Clark weights for triangles too.
    #[default]
    CatmullClark,
    /// Smoother weights for triangles.
    Smooth,
}

/// orientation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Orientation {
    /// Counter-clockwise from the front.
    #[default]
    RightHanded,
    /// Clockwise from the front.
    LeftHanded,
}

/// One crease: a chain of vertices with a sharpness per edge.
#[derive(Clone, Debug, PartialEq)]
pub struct Crease {
    /// Vertex chain, at least two.
    pub vertices: Vec<u32>,
    /// One sharpness an edge (`vertices.len() - 1`); 10 and above is infinitely sharp.
    pub sharpness: Vec<f32>,
}

/// Topology of one mesh. Checked: counts sum to the index count, indices are below `vertex_count`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshTopology {
    /// Scheme.
    pub scheme: Scheme,
    /// Boundary rule.
    pub boundary: BoundaryInterpolation,
    /// Face-varying rule.
    pub face_varying: FaceVaryingLinear,
    /// Triangle rule.
    pub triangles: TriangleRule,
    /// Winding.
    pub orientation: Orientation,
    /// Number of base vertices.
    pub vertex_count: usize,
    /// Vertices of each face.
    pub face_vertex_counts: Vec<u32>,
    /// Face vertices, concatenated.
    pub face_vertex_indices: Vec<u32>,
    /// Faces that are holes, ascending.
    pub holes: Vec<u32>,
    /// Creases.
    pub creases: Vec<Crease>,
    /// Sharp vertices: (vertex, sharpness).
    pub corners: Vec<(u32, f32)>,
}
