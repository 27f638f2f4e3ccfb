//! [`OsdSurface`]: a mesh with its limit surface, shared between threads; [`OsdFactory`] makes it.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use cxx::SharedPtr;
use glam::Vec3;
use hdtrapeze_core::surface::{
    BoundaryInterpolation, Channel, ChannelInfo, ChannelKind, FaceVaryingLinear, LimitEvaluator,
    LimitSurface, MeshTopology, Orientation, Scheme, SubdivisionFactory, SurfaceError,
    TriangleRule,
};

use crate::bridge::ffi;
use crate::evaluator::OsdEvaluator;
use crate::shapes::SharedPatches;
use crate::topology::Prepared;

/// Floats a position takes in control and patch points: x, y, z and one of padding.
pub(crate) const POINT: usize = 4;

/// How a channel is evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ChannelSource {
    /// The limit surface over the vertices.
    Vertex,
    /// Linear over each face, from its vertices.
    LinearVertex,
    /// The limit surface of the library's face-varying channel.
    FaceVarying(i32),
    /// Linear over each face, from the values of the face-varying channel with this number.
    LinearFaceVarying(usize),
    /// The value of the nearest corner, from those with this number.
    Nearest(usize),
}

/// A channel as the evaluators read it.
pub(crate) struct ChannelData {
    pub(crate) source: ChannelSource,
    pub(crate) width: usize,
    /// Width in lanes of [`POINT`] floats.
    pub(crate) lanes: usize,
    /// `[value][lane][POINT]`, padded with zeros.
    pub(crate) values: Vec<f32>,
}

impl ChannelData {
    fn new(channel: &Channel, source: ChannelSource) -> Self {
        let lanes = channel.width.div_ceil(POINT);
        let mut values = vec![0.0; channel.values.len() / channel.width * lanes * POINT];
        for (to, from) in values
            .chunks_exact_mut(lanes * POINT)
            .zip(channel.values.chunks_exact(channel.width))
        {
            to[..channel.width].copy_from_slice(from);
        }
        Self {
            source,
            width: channel.width,
            lanes,
            values,
        }
    }
}

/// A subdivision mesh that can be evaluated at the limit.
pub struct OsdSurface {
    pub(crate) mesh: SharedPtr<ffi::Mesh>,
    pub(crate) is_loop: bool,
    pub(crate) is_left_handed: bool,
    pub(crate) is_bilinear: bool,
    pub(crate) shared: Arc<SharedPatches>,
    face_starts: Vec<u32>,
    face_vertices: Vec<u32>,
    library_face: Vec<i32>,
    /// Faces that are linear whatever the scheme, ascending: too large for the library.
    linear_faces: Vec<u32>,
    key_count: usize,
    /// `[vertex][key][POINT]`: all keys of a vertex lie side by side.
    pub(crate) points: Vec<f32>,
    pub(crate) channels: Vec<ChannelData>,
    /// Start of each face in the face-vertices that the library knows.
    corner_starts: Vec<u32>,
    /// Value indices of the channels by face-vertex over those face-vertices, see
    /// [`Prepared::channel_indices`].
    channel_indices: Vec<i32>,
    corner_count: usize,
    channel_infos: Vec<ChannelInfo>,
    notes: Vec<String>,
}

impl OsdSurface {
    /// The library's number of a face, or -1 where it was dropped.
    pub(crate) fn library_face(&self, face: u32) -> i32 {
        self.library_face.get(face as usize).copied().unwrap_or(-1)
    }

    /// Whether a face is too large for the library, and linear in its place.
    pub(crate) fn is_linear_face(&self, face: u32) -> bool {
        self.linear_faces.binary_search(&face).is_ok()
    }

    /// Value indices of the corners of a face in a channel by face-vertex.
    pub(crate) fn value_indices(&self, channel: usize, face: u32, size: usize) -> &[i32] {
        let start = channel * self.corner_count + self.corner_starts[face as usize] as usize;
        &self.channel_indices[start..start + size]
    }

    /// The evaluator behind [`LimitSurface::evaluator`], as its own type.
    pub fn lattice_evaluator(&self) -> OsdEvaluator<'_> {
        OsdEvaluator::new(self, false)
    }

    /// An evaluator that asks the library for every point on its own: the oracle of tests and
    /// benches, several times slower.
    pub fn library_evaluator(&self) -> OsdEvaluator<'_> {
        OsdEvaluator::new(self, true)
    }
}

impl LimitSurface for OsdSurface {
    fn face_count(&self) -> usize {
        self.library_face.len()
    }
    fn face_vertices(&self, face: u32) -> &[u32] {
        let face = face as usize;
        &self.face_vertices[self.face_starts[face] as usize..self.face_starts[face + 1] as usize]
    }
    fn element(&self, face: u32) -> u32 {
        face
    }
    fn key_count(&self) -> usize {
        self.key_count
    }
    fn channels(&self) -> &[ChannelInfo] {
        &self.channel_infos
    }
    fn notes(&self) -> &[String] {
        &self.notes
    }

    fn is_polygonal(&self) -> bool {
        // The bilinear scheme is curved too where a quad is not planar.
        false
    }
    fn evaluator(&self) -> Box<dyn LimitEvaluator + '_> {
        Box::new(self.lattice_evaluator())
    }
}

type CacheKey = (Scheme, BoundaryInterpolation, TriangleRule, u8);

/// Makes [`OsdSurface`]s. Irregular patches are shared by all meshes with the same options.
#[derive(Default)]
pub struct OsdFactory {
    caches: Mutex<HashMap<CacheKey, Arc<SharedPatches>>>,
}

impl OsdFactory {
    /// A factory with empty caches.
    pub fn new() -> Self {
        Self::default()
    }

    fn shared(&self, topology: &MeshTopology) -> Arc<SharedPatches> {
        let key = (
            topology.scheme,
            topology.boundary,
            topology.triangles,
            topology.face_varying as u8,
        );
        self.caches
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .entry(key)
            .or_insert_with(|| Arc::new(SharedPatches::new()))
            .clone()
    }

    /// A limit surface, as [`SubdivisionFactory::create`].
    ///
    /// # Errors
    /// [`SurfaceError::Topology`] where counts, indices or lengths do not fit, or loop is given
    /// anything but triangles; [`SurfaceError::Library`] where OpenSubdiv refuses.
    pub fn create_surface(
        &self,
        topology: &MeshTopology,
        points: &[Vec<Vec3>],
        channels: Vec<Channel>,
    ) -> Result<OsdSurface, SurfaceError> {
        if points.is_empty() || points.iter().any(|key| key.len() != topology.vertex_count) {
            return Err(SurfaceError::Topology(
                "every key must have as many points as the topology has vertices".to_owned(),
            ));
        }
        let mut prepared = Prepared::new(topology, &channels)?;
        let library = |error: cxx::Exception| SurfaceError::Library(error.what().to_owned());
        let shared = self.shared(topology);
        let mesh = if prepared.is_empty() {
            SharedPtr::null()
        } else {
            ffi::make_mesh(&prepared.spec(topology), shared.cache.clone()).map_err(library)?
        };
        if topology.boundary == BoundaryInterpolation::None {
            drop_faces_without_limit(&mesh, &mut prepared).map_err(library)?;
        }
        let is_bilinear = topology.scheme == Scheme::Bilinear;
        let is_linear = is_bilinear || topology.face_varying == FaceVaryingLinear::All;
        let mut face_varying = 0;
        let is_face_varying = |channel: &&Channel| channel.kind == ChannelKind::FaceVarying;
        let mut nearest = channels.iter().filter(is_face_varying).count();
        let channel_infos = channels
            .iter()
            .map(|c| ChannelInfo { width: c.width })
            .collect();
        let channels: Vec<ChannelData> = channels
            .iter()
            .map(|channel| {
                let source = match channel.kind {
                    ChannelKind::Vertex if !is_bilinear => ChannelSource::Vertex,
                    ChannelKind::Vertex | ChannelKind::Varying => ChannelSource::LinearVertex,
                    ChannelKind::Nearest => {
                        nearest += 1;
                        ChannelSource::Nearest(nearest - 1)
                    }
                    ChannelKind::FaceVarying => {
                        face_varying += 1;
                        match is_linear {
                            true => ChannelSource::LinearFaceVarying(face_varying - 1),
                            false => ChannelSource::FaceVarying(face_varying as i32 - 1),
                        }
                    }
                };
                ChannelData::new(channel, source)
            })
            .collect();
        Ok(OsdSurface {
            mesh,
            is_loop: topology.scheme == Scheme::Loop,
            is_left_handed: topology.orientation == Orientation::LeftHanded,
            is_bilinear,
            shared,
            linear_faces: prepared.linear_faces(),
            corner_count: prepared.corner_count(),
            corner_starts: prepared.corner_starts,
            channel_indices: prepared.channel_indices,
            face_starts: prepared.face_starts,
            face_vertices: prepared.face_vertices,
            library_face: prepared.library_face,
            key_count: points.len(),
            points: interleave(points, topology.vertex_count),
            channel_infos,
            channels,
            notes: prepared.notes,
        })
    }
}

impl SubdivisionFactory for OsdFactory {
    fn create(
        &self,
        topology: &MeshTopology,
        points: &[Vec<Vec3>],
        channels: Vec<Channel>,
    ) -> Result<Box<dyn LimitSurface>, SurfaceError> {
        Ok(Box::new(self.create_surface(topology, points, channels)?))
    }
}

/// Empties the faces that have no limit surface under boundary interpolation `none`.
fn drop_faces_without_limit(
    mesh: &SharedPtr<ffi::Mesh>,
    prepared: &mut Prepared,
) -> Result<(), cxx::Exception> {
    let Some(mesh) = mesh.as_ref() else {
        return Ok(());
    };
    let mut starts = Vec::with_capacity(prepared.face_starts.len());
    let mut vertices = Vec::with_capacity(prepared.face_vertices.len());
    for (ends, &library) in prepared.face_starts.windows(2).zip(&prepared.library_face) {
        starts.push(vertices.len() as u32);
        if library >= 0 && mesh.has_limit(library)? {
            vertices.extend_from_slice(&prepared.face_vertices[ends[0] as usize..ends[1] as usize]);
        }
    }
    starts.push(vertices.len() as u32);
    prepared.face_starts = starts;
    prepared.face_vertices = vertices;
    Ok(())
}

/// `[vertex][key][POINT]` from points by key.
fn interleave(points: &[Vec<Vec3>], vertex_count: usize) -> Vec<f32> {
    let stride = points.len() * POINT;
    let mut all = vec![0.0; vertex_count * stride];
    for (key, points) in points.iter().enumerate() {
        for (vertex, p) in points.iter().enumerate() {
            let at = vertex * stride + key * POINT;
            all[at..at + 3].copy_from_slice(&p.to_array());
        }
    }
    all
}
