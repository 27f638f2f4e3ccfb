//! The bridge to OpenSubdiv: the only module with `unsafe` in this crate, and the only one that
//! names C++ types.
//!
//! `Mesh` is topology and a surface factory, immutable and shared between threads. `Patch` is the
//! limit surface of one face for one kind of data with its patch points, owned by one thread.
//! Functions that return `Result` turn C++ exceptions into errors; the others do not throw.
#![allow(unsafe_code)]

#[cxx::bridge(namespace = "hdtrapeze::osd")]
#[allow(missing_docs, unused_qualifications)]
pub(crate) mod ffi {
    /// Checked topology, in OpenSubdiv's own terms.
    struct MeshSpec<'a> {
        /// Sdc::SchemeType: 0 bilinear, 1 Catmull-Clark, 2 Loop.
        scheme: u8,
        /// 0 none, 1 edge only, 2 edge and corner.
        boundary: u8,
        /// 0 none, 1 corners only, 2 plus1, 3 plus2, 4 boundaries, 5 all.
        face_varying: u8,
        /// Smooth triangle rule.
        smooth_triangles: bool,
        vertex_count: i32,
        counts: &'a [i32],
        indices: &'a [i32],
        crease_pairs: &'a [i32],
        crease_sharpness: &'a [f32],
        corners: &'a [i32],
        corner_sharpness: &'a [f32],
        holes: &'a [i32],
        /// Values of each face-varying channel.
        channel_value_counts: &'a [i32],
        /// Indices of the channels, one after the other, each as long as `indices`.
        channel_indices: &'a [i32],
    }

    /// What a patch is after it was bound.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    struct PatchInfo {
        /// The face has a limit surface.
        valid: bool,
        /// One regular patch (bicubic B-spline or box spline).
        regular: bool,
        /// Linear: bilinear quads, or a flat triangle.
        linear: bool,
        /// Bits of the sides of a regular quad patch that have no neighbour: v=0, u=1, v=1, u=0.
        mask: u8,
        /// Identifies the irregular topology within its cache; 0 where it is not known.
        key: u64,
        /// Vertices of the face.
        face_size: i32,
        /// Control points: the first patch points.
        control_count: i32,
        /// Patch points.
        point_count: i32,
    }

    unsafe extern "C++" {
        include!("hdtrapeze-osd/src/cpp/bridge.h");

        /// OPENSUBDIV_VERSION_NUMBER of the headers: 30500 is 3.5.0.
        fn library_version() -> i32;

        /// Irregular patches, shared by meshes that have the same options; thread-safe.
        type PatchCache;
        fn make_cache() -> SharedPtr<PatchCache>;

        /// Topology and surface factory.
        type Mesh;
        fn make_mesh(spec: &MeshSpec<'_>, cache: SharedPtr<PatchCache>) -> Result<SharedPtr<Mesh>>;
        /// The face has a limit surface.
        fn has_limit(self: &Mesh, face: i32) -> Result<bool>;

        /// One face's surface for one kind of data.
        type Patch;
        fn make_patch() -> UniquePtr<Patch>;
        /// Makes a face's surface and gathers its control points: `values` are `size` floats a value,
        /// `channel` is a face-varying channel, or -1 for vertex data.
        fn bind(
            self: Pin<&mut Patch>,
            mesh: &Mesh,
            face: i32,
            channel: i32,
            values: &[f32],
            size: usize,
        ) -> Result<PatchInfo>;
        /// Weights of the 12 control points of a regular Loop triangle at one place, which tell its
        /// arrangement of boundaries; empty for other patches.
        fn signature(self: &Patch) -> &[f32];
        /// Patch points of the bound face, `size` floats each.
        fn points(self: &Patch) -> &[f32];
        /// Derives the patch points that follow the control points; needed before `evaluate`.
        fn complete(self: Pin<&mut Patch>) -> Result<()>;
        /// Evaluates at `uv` (pairs, in the library's parameterization), with first derivatives
        /// where asked; one library call a point.
        fn evaluate(self: Pin<&mut Patch>, uv: &[f32], derivatives: bool) -> Result<()>;
        /// What `evaluate` computed: `size` floats a point.
        fn position(self: &Patch) -> &[f32];
        fn du(self: &Patch) -> &[f32];
        fn dv(self: &Patch) -> &[f32];
        /// Origin of sub-face `i` in the library's parameterization of a face of `face_size`
        /// vertices: u and v, integers below 256.
        fn sub_face_origin(face_size: i32, i: i32) -> [f32; 2];

        /// Weights of one irregular surface in double precision.
        type Weights;
        fn make_weights(mesh: &Mesh, face: i32, channel: i32) -> Result<UniquePtr<Weights>>;
        /// The weight of every patch point at (u, v).
        fn at(self: Pin<&mut Weights>, u: f64, v: f64) -> Result<&[f64]>;
        /// The weight of every control point in every patch point, a row a patch point.
        fn stencils(self: Pin<&mut Weights>) -> Result<&[f64]>;
    }
}

// SAFETY: after construction a Mesh is only read: TopologyRefiner and RefinerSurfaceFactoryBase have
// no mutable state but the patch cache, which is guarded by a shared mutex.
unsafe impl Send for ffi::Mesh {}
// SAFETY: as above.
unsafe impl Sync for ffi::Mesh {}
// SAFETY: every access to the cache's map takes its shared mutex.
unsafe impl Send for ffi::PatchCache {}
// SAFETY: as above.
unsafe impl Sync for ffi::PatchCache {}
// SAFETY: a Patch owns its buffers; what it shares (irregular patches) is immutable and counted
// atomically.
unsafe impl Send for ffi::Patch {}
