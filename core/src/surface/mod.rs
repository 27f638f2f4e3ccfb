//! Limit surfaces: what dicing evaluates.
//!
//! A [`LimitSurface`] is a mesh whose faces can be evaluated anywhere, at every position key at
//! once. Subdivision surfaces come from an implementation outside this crate (OpenSubdiv); polygons
//! (`subdivisionScheme = none`) are [`polygon::PolygonSurface`]; spheres, cylinders, cones and capsules
//! are [`quadric::QuadricSurface`].
//!
//! **Patches.** Dicing sees unit squares only. A face is presented through one or more
//! [`PatchDomain`]s, each the image of the unit square `(s, t)`:
//!
//! * `Whole`: a quad. (0,0) (1,0) (1,1) (0,1) are face corners 0, 1, 2, 3.
//! * `Corner(i)`: one quad sub-face of a triangle or n-gon. (0,0) is corner `i`, (1,0) the middle
//!   of the edge from corner `i` to `i+1`, (1,1) the face centre, (0,1) the middle of the edge from
//!   corner `i-1` to `i`.
//! * `Collapsed`: a triangle as a quad whose edge `t = 1` is collapsed: (0,0) (1,0) (1,1)=(0,1)
//!   are corners 0, 1, 2, 2.
//!
//! Positions are object space, in the mesh's own units, in f32; times are the position keys' own.

pub mod nurbs;
pub mod polygon;
pub mod quadric;
pub mod topology;
mod triangulate;

use glam::{Vec2, Vec3};

pub use topology::{
    BoundaryInterpolation, Crease, FaceVaryingLinear, MeshTopology, Orientation, Scheme,
    TriangleRule,
};

/// How a face is cut into patches with unit-square domains; see the module's text.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PatchDomain {
    /// A quad face as it is.
    Whole,
    /// The quad sub-face at this corner of a triangle or n-gon.
    Corner(u32),
    /// A triangle as a quad with a collapsed edge.
    Collapsed,
}

/// What one evaluation writes: key-major arrays, `[key][sample]`.
#[derive(Clone, Debug, Default)]
pub struct LimitSamples {
    /// Limit positions, `key_count * sample_count`.
    pub positions: Vec<Vec3>,
    /// Unit limit normals, same shape, or empty when not asked for. A normal that is not defined
    /// (a degenerate point) is zero. Orientation is applied: normals point out of the front.
    pub normals: Vec<Vec3>,
}

/// A primvar that is interpolated over the limit surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ChannelInfo {
    /// Floats per sample.
    pub width: usize,
}

/// A mesh that can be evaluated at the limit. Shared between threads; each thread makes its own
/// [`LimitEvaluator`].
pub trait LimitSurface: Send + Sync {
    /// Number of faces, in this surface's own numbering.
    fn face_count(&self) -> usize;
    /// Base vertices of a face in authored order, or an empty slice where the face has no limit
    /// surface (a hole, or a boundary face that interpolateBoundary drops).
    fn face_vertices(&self, face: u32) -> &[u32];
    /// The authored face (elementId) that this face belongs to: differs from `face` where polygons
    /// were triangulated.
    fn element(&self, face: u32) -> u32;
    /// Number of position keys.
    fn key_count(&self) -> usize;
    /// Channels that [`LimitEvaluator::evaluate_channel`] knows, in the order they were given.
    fn channels(&self) -> &[ChannelInfo];
    /// What the surface leaves out of what was authored, as sentences for warnings.
    fn notes(&self) -> &[String] {
        &[]
    }
    /// True where the surface is made of facets between its base vertices, so that dicing it finer
    /// adds no shape (polygons without displacement).
    fn is_polygonal(&self) -> bool;
    /// An evaluator for the calling thread.
    fn evaluator(&self) -> Box<dyn LimitEvaluator + '_>;
}

/// Evaluates one bound face at a time, a whole lattice per call.
pub trait LimitEvaluator {
    /// Prepares `face` (patch points at every key). The face must have a limit surface.
    fn bind(&mut self, face: u32);
    /// Evaluates positions, and normals where asked, at `st` inside `domain` of the bound face.
    /// `out` is overwritten. The same `(face, domain, st)` always gives the same bits.
    fn evaluate(
        &mut self,
        domain: PatchDomain,
        st: &[Vec2],
        with_normals: bool,
        out: &mut LimitSamples,
    );
    /// Evaluates channel `channel` at `st`: `out` becomes `st.len() * width` floats.
    fn evaluate_channel(
        &mut self,
        channel: usize,
        domain: PatchDomain,
        st: &[Vec2],
        out: &mut Vec<f32>,
    );
    /// Points whose convex hull contains the bound face at each key: `out` becomes `[key][n]`. At every
    /// key each position that [`Self::evaluate`] answers is the same mean of the points, with weights of 0
    /// or more, up to rounding by `HULL_ROUNDING` of the largest coordinate. False where no such points
    /// are known.
    fn hull(&mut self, out: &mut Vec<Vec3>) -> bool {
        out.clear();
        false
    }
}

/// By how much a position may lie outside of its hull (see [`LimitEvaluator::hull`]), per unit of the largest
/// coordinate of the surface's hulls. A bicubic position in f32 errs by about 40 units of roundoff (each
/// basis function by 4, their sums by 4, in two directions), a patch point that is summed from the
/// controls around a vertex of valence n by about 2 n; and twice that, since a vertex may have been
/// evaluated on the face beside.
pub const HULL_ROUNDING: f64 = 256.0 / (1u64 << 24) as f64;

/// How a channel's values are spread over the mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ChannelKind {
    /// One value a vertex, smoothed with the scheme.
    Vertex,
    /// One value a vertex, interpolated linearly over each face.
    Varying,
    /// One value a face-vertex, smoothed as faceVaryingLinearInterpolation says.
    FaceVarying,
    /// One value a face-vertex, that of the nearest one (see [`nearest_corner`]), bit for bit.
    Nearest,
}

impl ChannelKind {
    /// True for kinds with an index a face-vertex.
    pub fn is_indexed(self) -> bool {
        matches!(self, ChannelKind::FaceVarying | ChannelKind::Nearest)
    }
}

/// The corner of a face of `size` sides that a place is nearest to, by its parameters: each corner
/// has its quarter of a quad, and its sub-face of any other face.
pub fn nearest_corner(size: usize, domain: PatchDomain, st: Vec2) -> usize {
    let last = size.saturating_sub(1);
    let (right, up) = (st.x >= 0.5, st.y >= 0.5);
    match domain {
        PatchDomain::Corner(i) => (i as usize).min(last),
        PatchDomain::Whole => match (right, up) {
            (false, false) => 0,
            (true, false) => 1,
            (true, true) => 2.min(last),
            (false, true) => 3.min(last),
        },
        PatchDomain::Collapsed => {
            // Weights of the triangle's corners.
            let w = [(1.0 - st.x) * (1.0 - st.y), st.x * (1.0 - st.y), st.y];
            let best = if w[0] > w[1] { 0 } else { 1 };
            if w[2] >= w[best] { 2.min(last) } else { best }
        }
    }
}

/// A channel handed to a surface when it is made. Lengths were checked by the caller.
#[derive(Clone, Debug)]
pub struct Channel {
    /// Spread over the mesh.
    pub kind: ChannelKind,
    /// Floats per value.
    pub width: usize,
    /// `value_count * width` floats.
    pub values: Vec<f32>,
    /// For data by face-vertex: index into `values` for each face-vertex (length: index count), which
    /// carries the seams. Empty for the other kinds.
    pub indices: Vec<u32>,
}

/// Why a surface could not be made.
#[derive(Debug, thiserror::Error)]
pub enum SurfaceError {
    /// The topology cannot be used with the scheme (loop on quads, for one).
    #[error("{0}")]
    Topology(String),
    /// The subdivision library refused.
    #[error("subdivision failed: {0}")]
    Library(String),
}

/// Makes limit surfaces for subdivision schemes; the session is given one.
pub trait SubdivisionFactory: Send + Sync {
    /// A limit surface over checked topology. `points[key]` are object-space base vertices, all of
    /// one length. Scheme is never `None`.
    fn create(
        &self,
        topology: &MeshTopology,
        points: &[Vec<Vec3>],
        channels: Vec<Channel>,
    ) -> Result<Box<dyn LimitSurface>, SurfaceError>;
}
