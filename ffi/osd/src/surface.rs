//! [`OsdSurface`]: a mesh with its limit surface, shared between threads; [`OsdFactory`] makes it.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use cxx::SharedPtr;
use glam::Vec3;
use hdtrapeze_core::surface::{
    BoundaryInterpolation, Channel, ChannelInfo, ChannelKind, LimitEvaluator, LimitSurface,
    MeshTopology, Orientation, Scheme, SubdivisionFactory, SurfaceError, TriangleRule,
};

use crate::bridge::ffi;
use crate::evaluator::OsdEvaluator;
use crate::topology::Prepared;

/// Floats a position takes in control and patch points: x, y, z and one of padding.
pub(crate) const POINT: usize = 4;

/// A channel as the evaluators read it.
pub(crate) struct ChannelData {
    pub(crate) kind: ChannelKind,
    pub(crate) width: usize,
    pub(crate) values: Vec<f32>,
    /// The library's face-varying channel, or -1.
    pub(crate) library_channel: i32,
}

/// A subdivision mesh that can be evaluated at the limit.
pub struct OsdSurface {
    pub(crate) mesh: SharedPtr<ffi::Mesh>,
    pub(crate) is_loop: bool,
    pub(crate) is_left_handed: bool,
    is_bilinear: bool,
    face_starts: Vec<u32>,
    face_vertices: Vec<u32>,
    library_face: Vec<i32>,
    key_count: usize,
    /// `[vertex][key][POINT]`: all keys of a vertex lie side by side.
    pub(crate) points: Vec<f32>,
    pub(crate) channels: Vec<ChannelData>,
    channel_infos: Vec<ChannelInfo>,
}

impl OsdSurface {
    /// The library's number of a face, or -1 where it was dropped.
    pub(crate) fn library_face(&self, face: u32) -> i32 {
        self.library_face.get(face as usize).copied().unwrap_or(-1)
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
    fn is_polygonal(&self) -> bool {
        self.is_bilinear
    }
    fn evaluator(&self) -> Box<dyn LimitEvaluator + '_> {
        Box::new(OsdEvaluator::new(self))
    }
}

type CacheKey = (Scheme, BoundaryInterpolation, TriangleRule, u8);

/// Makes [`OsdSurface`]s. Irregular patches are shared by all meshes with the same options.
#[derive(Default)]
pub struct OsdFactory {
    caches: Mutex<HashMap<CacheKey, SharedPtr<ffi::PatchCache>>>,
}

impl OsdFactory {
    /// A factory with empty caches.
    pub fn new() -> Self {
        Self::default()
    }

    fn cache(&self, topology: &MeshTopology) -> SharedPtr<ffi::PatchCache> {
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
            .or_insert_with(ffi::make_cache)
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
        let mesh = if prepared.is_empty() {
            SharedPtr::null()
        } else {
            ffi::make_mesh(&prepared.spec(topology), self.cache(topology)).map_err(library)?
        };
        if topology.boundary == BoundaryInterpolation::None {
            drop_faces_without_limit(&mesh, &mut prepared).map_err(library)?;
        }
        let mut face_varying = 0;
        let channels: Vec<ChannelData> = channels
            .into_iter()
            .map(|channel| {
                let library_channel = match channel.kind {
                    ChannelKind::FaceVarying => {
                        face_varying += 1;
                        face_varying - 1
                    }
                    _ => -1,
                };
                ChannelData {
                    kind: channel.kind,
                    width: channel.width,
                    values: channel.values,
                    library_channel,
                }
            })
            .collect();
        Ok(OsdSurface {
            mesh,
            is_loop: topology.scheme == Scheme::Loop,
            is_left_handed: topology.orientation == Orientation::LeftHanded,
            is_bilinear: topology.scheme == Scheme::Bilinear,
            face_starts: prepared.face_starts,
            face_vertices: prepared.face_vertices,
            library_face: prepared.library_face,
            key_count: points.len(),
            points: interleave(points, topology.vertex_count),
            channel_infos: channels
                .iter()
                .map(|channel| ChannelInfo {
                    width: channel.width,
                })
                .collect(),
            channels,
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
