//! Base topology as OpenSubdiv takes it.
//!
//! Repairs what the library would refuse or trip over: a face's repeated neighbours become one
//! vertex, and a face left with fewer than three is dropped; creases, corners and holes that name
//! nothing are dropped. Faces keep their authored numbers: `library_face` maps them.
//!
//! OpenSubdiv 3.5.0 reads memory that it never wrote where a face has a vertex in the middle of just
//! two faces, a boundary, and a crease (3.5.1 mends it). With that version the creases around such
//! faces are left out. Faces that are too large for the library stay linear (`size`).

use std::collections::HashSet;

use hdtrapeze_core::surface::{
    BoundaryInterpolation, Channel, ChannelKind, FaceVaryingLinear, MeshTopology, Scheme,
    SurfaceError, TriangleRule,
};

use crate::bridge::ffi::{self, MeshSpec};
use crate::size;

/// Sharpness from which OpenSubdiv takes an edge or vertex as infinitely sharp.
const INFINITE_SHARPNESS: f32 = 10.0;

/// The version with the fault that the module's text describes.
const CREASES_READ_TOO_FAR: i32 = 30500;

/// Most vertices that OpenSubdiv takes in a face, and most faces at a vertex.
const VALENCE_LIMIT: usize = 65_535;

/// Topology in the library's terms, and the way back to authored faces.
pub(crate) struct Prepared {
    counts: Vec<i32>,
    indices: Vec<i32>,
    crease_pairs: Vec<i32>,
    crease_sharpness: Vec<f32>,
    corners: Vec<i32>,
    corner_sharpness: Vec<f32>,
    holes: Vec<i32>,
    channel_value_counts: Vec<i32>,
    /// Value indices of the face-varying channels, then of those of nearest values, which the library
    /// is not told of; one after the other, each as long as the library's vertex indices.
    pub(crate) channel_indices: Vec<i32>,
    /// Start of each authored face in the library's vertex indices.
    pub(crate) corner_starts: Vec<u32>,
    /// Start of each authored face in `face_vertices`, and the end.
    pub(crate) face_starts: Vec<u32>,
    /// Vertices of the authored faces after repair; none for dropped faces and holes.
    pub(crate) face_vertices: Vec<u32>,
    /// The library's number of each authored face, or -1.
    pub(crate) library_face: Vec<i32>,
    /// The library's faces that are too large for it, ascending.
    too_large: Vec<i32>,
    /// What was left out, as sentences.
    pub(crate) notes: Vec<String>,
}

fn topology_error<T>(text: String) -> Result<T, SurfaceError> {
    Err(SurfaceError::Topology(text))
}

impl Prepared {
    /// Checks and repairs.
    pub(crate) fn new(topology: &MeshTopology, channels: &[Channel]) -> Result<Self, SurfaceError> {
        let face_count = topology.face_vertex_counts.len();
        let index_count = topology.face_vertex_indices.len();
        let total: u64 = topology
            .face_vertex_counts
            .iter()
            .map(|&n| u64::from(n))
            .sum();
        if total != index_count as u64 {
            return topology_error(format!(
                "faces have {total} vertices, {index_count} indices"
            ));
        }
        if topology.vertex_count > i32::MAX as usize || index_count > i32::MAX as usize {
            return topology_error("more than 2^31 vertices or indices".to_owned());
        }
        if let Some(bad) = topology
            .face_vertex_indices
            .iter()
            .find(|&&v| v as usize >= topology.vertex_count)
        {
            return topology_error(format!(
                "vertex {bad} is out of range ({} vertices)",
                topology.vertex_count
            ));
        }
        let face_varying: Vec<&Channel> = channels
            .iter()
            .filter(|channel| channel.kind == ChannelKind::FaceVarying)
            .collect();
        check_channels(topology, channels)?;

        // Which corners stay.
        let mut kept = Vec::with_capacity(index_count);
        let mut counts = Vec::with_capacity(face_count);
        let mut library_face = Vec::with_capacity(face_count);
        let mut corner_starts = Vec::with_capacity(face_count);
        let mut valence = vec![0u32; topology.vertex_count];
        let mut start = 0;
        for (face, &count) in topology.face_vertex_counts.iter().enumerate() {
            let vertices = &topology.face_vertex_indices[start..start + count as usize];
            let first = kept.len();
            corner_starts.push(first as u32);
            for (i, &v) in vertices.iter().enumerate() {
                let previous = if i == 0 { vertices.len() - 1 } else { i - 1 };
                if v != vertices[previous] {
                    kept.push(start + i);
                }
            }
            let size = kept.len() - first;
            start += count as usize;
            if size < 3 {
                kept.truncate(first);
                library_face.push(-1);
                continue;
            }
            if topology.scheme == Scheme::Loop && size != 3 {
                return topology_error(format!(
                    "loop needs triangles, face {face} has {size} sides"
                ));
            }
            if size > VALENCE_LIMIT {
                return topology_error(format!("face {face} has {size} sides"));
            }
            for &i in &kept[first..] {
                valence[topology.face_vertex_indices[i] as usize] += 1;
            }
            library_face.push(counts.len() as i32);
            counts.push(size as i32);
        }
        if let Some(v) = valence.iter().position(|&n| n as usize >= VALENCE_LIMIT) {
            return topology_error(format!("vertex {v} has {} faces", valence[v]));
        }
        let indices: Vec<i32> = kept
            .iter()
            .map(|&i| topology.face_vertex_indices[i] as i32)
            .collect();

        let holes: HashSet<u32> = topology.holes.iter().copied().collect();
        let (face_starts, face_vertices) = authored_faces(&counts, &indices, &library_face, &holes);
        let mut library_holes: Vec<i32> = holes
            .iter()
            .filter_map(|&f| library_face.get(f as usize).copied())
            .filter(|&f| f >= 0)
            .collect();
        library_holes.sort_unstable();

        let mut channel_indices = Vec::with_capacity(face_varying.len() * kept.len());
        let nearest = |channel: &&Channel| channel.kind == ChannelKind::Nearest;
        for channel in face_varying
            .iter()
            .copied()
            .chain(channels.iter().filter(nearest))
        {
            channel_indices.extend(kept.iter().map(|&i| channel.indices[i] as i32));
        }
        let mut prepared = Self {
            counts,
            indices,
            crease_pairs: Vec::new(),
            crease_sharpness: Vec::new(),
            corners: Vec::new(),
            corner_sharpness: Vec::new(),
            holes: library_holes,
            channel_value_counts: face_varying
                .iter()
                .map(|channel| (channel.values.len() / channel.width.max(1)) as i32)
                .collect(),
            channel_indices,
            corner_starts,
            face_starts,
            face_vertices,
            library_face,
            too_large: Vec::new(),
            notes: Vec::new(),
        };
        prepared.sharpen(topology);
        // The bilinear scheme has no irregular faces.
        if topology.scheme != Scheme::Bilinear {
            prepared.too_large = size::too_large(prepared.faces(), topology.vertex_count);
        }
        if !prepared.too_large.is_empty() {
            prepared.notes.push(format!(
                "{} faces have too many sides, or vertices with too many faces, to be smooth; linear",
                prepared.too_large.len()
            ));
        }
        Ok(prepared)
    }

    fn faces(&self) -> impl Iterator<Item = &[i32]> + Clone {
        let mut rest = &self.indices[..];
        self.counts.iter().map(move |&count| {
            let (face, after) = rest.split_at(count as usize);
            rest = after;
            face
        })
    }

    /// The authored faces that are linear, because they are too large for the library; ascending.
    pub(crate) fn linear_faces(&self) -> Vec<u32> {
        if self.too_large.is_empty() {
            return Vec::new();
        }
        let is_linear = |&(library, _): &(&i32, u32)| self.too_large.binary_search(library).is_ok();
        let faces = self.library_face.iter().zip(0..);
        faces.filter(is_linear).map(|(_, face)| face).collect()
    }

    /// Vertices of faces that have a vertex which two faces surround.
    fn around_two_face_vertices(&self) -> HashSet<i32> {
        let around = |face: &[i32], i: usize| {
            let (a, b) = (
                face[(i + 1) % face.len()],
                face[(i + face.len() - 1) % face.len()],
            );
            (face[i], a.min(b), a.max(b))
        };
        let (mut once, mut twice) = (HashSet::new(), HashSet::new());
        for face in self.faces() {
            for i in 0..face.len() {
                if !once.insert(around(face, i)) {
                    twice.insert(face[i]);
                }
            }
        }
        self.faces()
            .filter(|face| face.iter().any(|v| twice.contains(v)))
            .flatten()
            .copied()
            .collect()
    }

    /// Creases on edges that exist and corners on vertices that exist.
    fn sharpen(&mut self, topology: &MeshTopology) {
        if !topology.creases.is_empty() {
            let mut edges = HashSet::new();
            for face in self.faces() {
                for (i, &a) in face.iter().enumerate() {
                    let b = face[(i + 1) % face.len()];
                    edges.insert((a.min(b), a.max(b)));
                }
            }
            let mut avoid = HashSet::new();
            if ffi::library_version() == CREASES_READ_TOO_FAR {
                avoid = self.around_two_face_vertices();
            }
            let (mut nowhere, mut avoided) = (0usize, 0usize);
            for crease in &topology.creases {
                for (pair, &sharpness) in crease.vertices.windows(2).zip(&crease.sharpness) {
                    let (a, b) = (pair[0] as i32, pair[1] as i32);
                    if sharpness <= 0.0 {
                        continue;
                    }
                    if !edges.contains(&(a.min(b), a.max(b))) {
                        nowhere += 1;
                    } else if avoid.contains(&a) || avoid.contains(&b) {
                        avoided += 1;
                    } else {
                        self.crease_pairs.extend_from_slice(&[a, b]);
                        self.crease_sharpness
                            .push(sharpness.min(INFINITE_SHARPNESS));
                    }
                }
            }
            if nowhere > 0 {
                self.notes.push(format!(
                    "{nowhere} crease edges are no edges of a face; ignored"
                ));
            }
            if avoided > 0 {
                self.notes.push(format!(
                    "{avoided} crease edges lie next to a vertex with just two faces, where OpenSubdiv \
                     3.5.0 fails; ignored"
                ));
            }
        }
        for &(vertex, sharpness) in &topology.corners {
            if sharpness > 0.0 && (vertex as usize) < topology.vertex_count {
                self.corners.push(vertex as i32);
                self.corner_sharpness
                    .push(sharpness.min(INFINITE_SHARPNESS));
            }
        }
    }

    /// Face-vertices that the library knows.
    pub(crate) fn corner_count(&self) -> usize {
        self.indices.len()
    }

    /// Nothing is left to refine.
    pub(crate) fn is_empty(&self) -> bool {
        self.counts.is_empty()
    }

    /// What the bridge takes.
    pub(crate) fn spec(&self, topology: &MeshTopology) -> MeshSpec<'_> {
        MeshSpec {
            scheme: match topology.scheme {
                Scheme::Bilinear | Scheme::None => 0,
                Scheme::CatmullClark => 1,
                Scheme::Loop => 2,
            },
            boundary: match topology.boundary {
                BoundaryInterpolation::None => 0,
                BoundaryInterpolation::EdgeOnly => 1,
                BoundaryInterpolation::EdgeAndCorner => 2,
            },
            face_varying: match topology.face_varying {
                FaceVaryingLinear::None => 0,
                FaceVaryingLinear::CornersOnly => 1,
                FaceVaryingLinear::CornersPlus1 => 2,
                FaceVaryingLinear::CornersPlus2 => 3,
                FaceVaryingLinear::Boundaries => 4,
                FaceVaryingLinear::All => 5,
            },
            smooth_triangles: topology.triangles == TriangleRule::Smooth,
            vertex_count: topology.vertex_count as i32,
            counts: &self.counts,
            indices: &self.indices,
            crease_pairs: &self.crease_pairs,
            crease_sharpness: &self.crease_sharpness,
            corners: &self.corners,
            corner_sharpness: &self.corner_sharpness,
            holes: &self.holes,
            channel_value_counts: &self.channel_value_counts,
            channel_indices: &self.channel_indices
                [..self.channel_value_counts.len() * self.indices.len()],
        }
    }
}

/// Vertices of the authored faces: empty for dropped faces and holes.
fn authored_faces(
    counts: &[i32],
    indices: &[i32],
    library_face: &[i32],
    holes: &HashSet<u32>,
) -> (Vec<u32>, Vec<u32>) {
    let mut starts = Vec::with_capacity(library_face.len() + 1);
    let mut vertices = Vec::with_capacity(indices.len());
    let mut start = 0;
    for (face, &library) in library_face.iter().enumerate() {
        starts.push(vertices.len() as u32);
        if library < 0 {
            continue;
        }
        let end = start + counts[library as usize] as usize;
        if !holes.contains(&(face as u32)) {
            vertices.extend(indices[start..end].iter().map(|&v| v as u32));
        }
        start = end;
    }
    starts.push(vertices.len() as u32);
    (starts, vertices)
}

fn check_channels(topology: &MeshTopology, channels: &[Channel]) -> Result<(), SurfaceError> {
    for (i, channel) in channels.iter().enumerate() {
        if channel.width == 0 {
            return topology_error(format!("channel {i} has no width"));
        }
        let count = channel.values.len() / channel.width;
        let fits = match channel.kind {
            ChannelKind::Vertex | ChannelKind::Varying => count >= topology.vertex_count,
            ChannelKind::FaceVarying | ChannelKind::Nearest => {
                count <= i32::MAX as usize
                    && channel.indices.len() == topology.face_vertex_indices.len()
                    && channel.indices.iter().all(|&j| (j as usize) < count)
            }
        };
        if !fits {
            return topology_error(format!("channel {i} does not fit the topology"));
        }
    }
    Ok(())
}
