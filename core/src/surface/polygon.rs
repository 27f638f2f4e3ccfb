//! [`PolygonSurface`]: meshes with `subdivisionScheme = none`, presented as a limit surface.
//!
//! Quads that are convex stay quads and are bilinear; triangles stay triangles; every other face is
//! cut into triangles once, at the first key, each a face of the surface that remembers its authored
//! face. Holes and faces without three different corners are dropped.
//!
//! Invariants: at the corners of its domain a face gives its base vertices bit by bit, and the middle
//! of an edge has the same bits from both sides. Normals are geometric: flat over triangles, bilinear
//! over quads; authored normals come as a channel. Object space, the mesh's units.

use glam::{DVec3, Vec2, Vec3};

use super::{
    Channel, ChannelInfo, ChannelKind, LimitEvaluator, LimitSamples, LimitSurface, MeshTopology,
    Orientation, PatchDomain, SurfaceError, nearest_corner, triangulate,
};

/// A polygon mesh as a limit surface.
pub struct PolygonSurface {
    is_left_handed: bool,
    /// Start of each face in `vertices` and `corners`, and the end.
    starts: Vec<u32>,
    /// Base vertices of the faces, three or four each.
    vertices: Vec<u32>,
    /// Authored face-vertex of each of them.
    corners: Vec<u32>,
    /// Authored face of each face.
    elements: Vec<u32>,
    points: Vec<Vec<Vec3>>,
    channels: Vec<Channel>,
    channel_infos: Vec<ChannelInfo>,
}

impl PolygonSurface {
    /// A surface over `topology`, whose subdivision options are ignored, with `points[key]`.
    ///
    /// # Errors
    /// [`SurfaceError::Topology`] where counts, indices or lengths contradict each other.
    pub fn new(
        topology: &MeshTopology,
        points: &[Vec<Vec3>],
        channels: Vec<Channel>,
    ) -> Result<Self, SurfaceError> {
        check(topology, points, &channels)?;
        let mut surface = Self {
            is_left_handed: topology.orientation == Orientation::LeftHanded,
            starts: Vec::with_capacity(topology.face_vertex_counts.len() + 1),
            vertices: Vec::with_capacity(topology.face_vertex_indices.len()),
            corners: Vec::with_capacity(topology.face_vertex_indices.len()),
            elements: Vec::with_capacity(topology.face_vertex_counts.len()),
            points: points.to_vec(),
            channel_infos: channels
                .iter()
                .map(|channel| ChannelInfo {
                    width: channel.width,
                })
                .collect(),
            channels,
        };
        surface.add_faces(topology);
        surface.starts.push(surface.vertices.len() as u32);
        Ok(surface)
    }

    fn add_faces(&mut self, topology: &MeshTopology) {
        let mut is_hole = vec![false; topology.face_vertex_counts.len()];
        for &hole in &topology.holes {
            if let Some(is_hole) = is_hole.get_mut(hole as usize) {
                *is_hole = true;
            }
        }
        let indices = &topology.face_vertex_indices;
        let mut next = 0;
        let (mut corners, mut loop_points) = (Vec::new(), Vec::new());
        for (face, &count) in topology.face_vertex_counts.iter().enumerate() {
            let (start, end) = (next, next + count as usize);
            next = end;
            if is_hole[face] {
                continue;
            }
            // Repeated neighbours are one corner.
            corners.clear();
            corners.extend((start..end).filter(|&i| {
                let before = if i == start { end - 1 } else { i - 1 };
                indices[i] != indices[before]
            }));
            if corners.len() < 3 {
                continue;
            }
            loop_points.clear();
            loop_points.extend(corners.iter().map(|&i| self.points[0][indices[i] as usize]));
            let mut add = |face_corners: &[usize]| {
                self.starts.push(self.vertices.len() as u32);
                self.elements.push(face as u32);
                self.vertices
                    .extend(face_corners.iter().map(|&i| indices[i]));
                self.corners.extend(face_corners.iter().map(|&i| i as u32));
            };
            if corners.len() == 3 || (corners.len() == 4 && triangulate::is_convex(&loop_points)) {
                add(&corners);
            } else {
                for triangle in triangulate::triangulate(&loop_points) {
                    add(&triangle.map(|i| corners[i as usize]));
                }
            }
        }
    }

    fn range(&self, face: u32) -> std::ops::Range<usize> {
        let face = face as usize;
        self.starts[face] as usize..self.starts[face + 1] as usize
    }
}

fn check(
    topology: &MeshTopology,
    points: &[Vec<Vec3>],
    channels: &[Channel],
) -> Result<(), SurfaceError> {
    let fail = |text: String| Err(SurfaceError::Topology(text));
    let index_count = topology.face_vertex_indices.len();
    let total: u64 = topology
        .face_vertex_counts
        .iter()
        .map(|&n| u64::from(n))
        .sum();
    if total != index_count as u64 {
        return fail(format!(
            "faces have {total} vertices, there are {index_count} indices"
        ));
    }
    // Cutting a polygon into triangles makes at most three corners of one.
    if index_count > (u32::MAX / 3) as usize {
        return fail("more than 2^32 / 3 face-vertices".to_owned());
    }
    if points.is_empty() || points.iter().any(|key| key.len() != topology.vertex_count) {
        return fail("every key must have as many points as the topology has vertices".to_owned());
    }
    let out_of_range = |&&v: &&u32| v as usize >= topology.vertex_count;
    if let Some(bad) = topology.face_vertex_indices.iter().find(out_of_range) {
        return fail(format!(
            "vertex {bad} is out of range ({} vertices)",
            topology.vertex_count
        ));
    }
    for (i, channel) in channels.iter().enumerate() {
        let count = channel.values.len().checked_div(channel.width).unwrap_or(0);
        let fits = channel.width > 0
            && match channel.kind {
                ChannelKind::Vertex | ChannelKind::Varying => count >= topology.vertex_count,
                ChannelKind::FaceVarying | ChannelKind::Nearest => {
                    channel.indices.len() == index_count
                        && channel.indices.iter().all(|&j| (j as usize) < count)
                }
            };
        if !fits {
            return fail(format!("channel {i} does not fit the topology"));
        }
    }
    Ok(())
}

impl LimitSurface for PolygonSurface {
    fn face_count(&self) -> usize {
        self.elements.len()
    }
    fn face_vertices(&self, face: u32) -> &[u32] {
        &self.vertices[self.range(face)]
    }
    fn element(&self, face: u32) -> u32 {
        self.elements[face as usize]
    }
    fn key_count(&self) -> usize {
        self.points.len()
    }
    fn channels(&self) -> &[ChannelInfo] {
        &self.channel_infos
    }
    fn is_polygonal(&self) -> bool {
        true
    }
    fn evaluator(&self) -> Box<dyn LimitEvaluator + '_> {
        Box::new(PolygonEvaluator {
            surface: self,
            face: 0,
        })
    }
}

struct PolygonEvaluator<'a> {
    surface: &'a PolygonSurface,
    face: u32,
}

/// Weights of the corners 0 to 3 of a face of `size` corners (3 or 4; of a triangle the last is 0).
/// They sum to one, are exactly 0 and 1 at corners, and exactly halves in the middle of edges.
fn weights(size: usize, domain: PatchDomain, st: Vec2) -> [f32; 4] {
    let Vec2 { x: s, y: t } = st.clamp(Vec2::ZERO, Vec2::ONE);
    let square = [(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t];
    let PatchDomain::Corner(i) = domain else {
        return match size {
            3 => [square[0], square[1], t, 0.0],
            _ => square,
        };
    };
    // The square's corners are the face's corner i, the middle of the next edge, the centre, and the
    // middle of the edge before.
    let centre = square[2] / size as f32;
    let mut out = [centre; 4];
    let i = i as usize % size;
    out[(i + 1) % size] += 0.5 * square[1];
    out[(i + size - 1) % size] += 0.5 * square[3];
    out[i] += square[0] + 0.5 * square[1] + 0.5 * square[3];
    if size == 3 {
        out[3] = 0.0;
    }
    out
}

/// The weighted sum of corners; a corner itself where it has all the weight.
fn blend(p: &[Vec3], w: &[f32; 4]) -> Vec3 {
    match w.iter().position(|&w| w == 1.0) {
        Some(i) if i < p.len() => p[i],
        _ if p.len() == 3 => p[0] * w[0] + p[1] * w[1] + p[2] * w[2],
        // Opposite pairs: then two neighbouring corners are added to zeros only, in any order.
        _ => (p[0] * w[0] + p[2] * w[2]) + (p[1] * w[1] + p[3] * w[3]),
    }
}

/// The unit vector along `v`, or zero where it has none.
fn unit(v: DVec3) -> Vec3 {
    v.normalize_or_zero().as_vec3()
}

impl PolygonEvaluator<'_> {
    /// Corner positions of the bound face at one key; the number of corners.
    fn corners(&self, key: usize) -> ([Vec3; 4], usize) {
        let vertices = self.surface.face_vertices(self.face);
        let mut p = [Vec3::ZERO; 4];
        for (p, &v) in p.iter_mut().zip(vertices) {
            *p = self.surface.points[key][v as usize];
        }
        (p, vertices.len())
    }
}

impl LimitEvaluator for PolygonEvaluator<'_> {
    fn bind(&mut self, face: u32) {
        self.face = face;
    }

    fn evaluate(
        &mut self,
        domain: PatchDomain,
        st: &[Vec2],
        with_normals: bool,
        out: &mut LimitSamples,
    ) {
        out.positions.clear();
        out.normals.clear();
        let front = if self.surface.is_left_handed {
            -1.0
        } else {
            1.0
        };
        for key in 0..self.surface.key_count() {
            let (p, size) = self.corners(key);
            let p = &p[..size];
            out.positions
                .extend(st.iter().map(|&st| blend(p, &weights(size, domain, st))));
            if !with_normals {
                continue;
            }
            let facet = unit(triangulate::area_vector(p)) * front;
            if size == 3 {
                out.normals.extend(st.iter().map(|_| facet));
                continue;
            }
            out.normals.extend(st.iter().map(|&st| {
                // Bilinear coordinates are sums of the weights along two sides.
                let w = weights(size, domain, st);
                let (s, t) = (w[1] + w[2], w[2] + w[3]);
                let du = (p[1] - p[0]) * (1.0 - t) + (p[2] - p[3]) * t;
                let dv = (p[3] - p[0]) * (1.0 - s) + (p[2] - p[1]) * s;
                let n = unit(du.as_dvec3().cross(dv.as_dvec3())) * front;
                if n == Vec3::ZERO { facet } else { n }
            }));
        }
    }

    fn evaluate_channel(
        &mut self,
        channel: usize,
        domain: PatchDomain,
        st: &[Vec2],
        out: &mut Vec<f32>,
    ) {
        out.clear();
        let surface = self.surface;
        let channel = &surface.channels[channel];
        let width = channel.width;
        let range = surface.range(self.face);
        let size = range.len();
        let value = |i: usize| {
            let index = match channel.kind {
                ChannelKind::Vertex | ChannelKind::Varying => surface.vertices[range.start + i],
                ChannelKind::FaceVarying | ChannelKind::Nearest => {
                    channel.indices[surface.corners[range.start + i] as usize]
                }
            };
            &channel.values[index as usize * width..][..width]
        };
        if channel.kind == ChannelKind::Nearest {
            for &st in st {
                out.extend_from_slice(value(nearest_corner(size, domain, st)));
            }
            return;
        }
        // A triangle's fourth corner has no weight.
        let p = [value(0), value(1), value(2), value(size - 1)];
        for &st in st {
            let w = weights(size, domain, st);
            match w.iter().position(|&w| w == 1.0) {
                Some(i) => out.extend_from_slice(p[i]),
                None => out.extend((0..width).map(|j| {
                    (p[0][j] * w[0] + p[2][j] * w[2]) + (p[1][j] * w[1] + p[3][j] * w[3])
                })),
            }
        }
    }
}

#[cfg(test)]
#[path = "polygon_tests.rs"]
mod tests;
