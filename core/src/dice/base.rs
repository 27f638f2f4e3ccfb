//! The base mesh as dicing needs it: which faces share which edges and vertices, and which face
//! evaluates each of them.
//!
//! A *face-edge* is one entry of the concatenated face-vertex list: edge `k` of a face runs from its
//! corner `k` to corner `k + 1`. An edge is a pair of vertices, whatever the number of faces on it;
//! its owner is the first face-edge on it. Edges and vertices are numbered in the order of their
//! owners, so that a run of faces owns a run of edges and a run of vertex slots.

use super::DiceError;
use crate::surface::LimitSurface;

/// Edges and vertices of the base mesh, with owners.
#[derive(Debug, Default)]
pub(super) struct BaseMesh {
    /// First face-edge of each face, and their number at the end. Faces without a limit surface,
    /// and those with less than three corners, have none.
    pub first: Vec<u32>,
    /// Edge of each face-edge.
    pub edges: Vec<u32>,
    /// Vertex slot of each face-edge's first corner.
    pub corners: Vec<u32>,
    /// Owning face-edge of each edge.
    pub edge_owner: Vec<u32>,
    /// Vertex slots at the two ends of each edge. Parameter 0 is the end whose vertex number is
    /// smaller.
    pub edge_ends: Vec<[u32; 2]>,
    /// Owning face-edge of each vertex slot (it starts there).
    pub vertex_owner: Vec<u32>,
}

const NONE: u32 = u32::MAX;

impl BaseMesh {
    /// Reads the faces of `surface`.
    pub fn new(surface: &dyn LimitSurface) -> Result<Self, DiceError> {
        let face_count = surface.face_count();
        let mut mesh = Self::default();
        mesh.first.try_reserve_exact(face_count + 1)?;
        let mut total = 0u64;
        let mut vertex_count = 0usize;
        for face in 0..face_count {
            mesh.first.push(total as u32);
            let vertices = usable(surface.face_vertices(face as u32));
            total += vertices.len() as u64;
            for &v in vertices {
                vertex_count = vertex_count.max(v as usize + 1);
            }
            if total >= u64::from(NONE / 2) {
                return Err(DiceError::TooLarge);
            }
        }
        mesh.first.push(total as u32);
        let total = total as usize;

        // Vertex slots, in the order of first use.
        let mut slots = filled(vertex_count, NONE)?;
        mesh.corners.try_reserve_exact(total)?;
        for face in 0..face_count {
            for &v in usable(surface.face_vertices(face as u32)) {
                let slot = &mut slots[v as usize];
                if *slot == NONE {
                    *slot = mesh.vertex_owner.len() as u32;
                    mesh.vertex_owner.push(mesh.corners.len() as u32);
                }
                mesh.corners.push(*slot);
            }
        }

        // Face-edges by smaller end (a counting sort), then by larger end within each.
        let ends = |vertices: &[u32], k: usize| {
            let (a, b) = (vertices[k], vertices[(k + 1) % vertices.len()]);
            (a.min(b), a.max(b))
        };
        let mut begin = filled(vertex_count + 1, 0u32)?;
        for face in 0..face_count {
            let vertices = usable(surface.face_vertices(face as u32));
            for k in 0..vertices.len() {
                begin[ends(vertices, k).0 as usize + 1] += 1;
            }
        }
        for v in 0..vertex_count {
            begin[v + 1] += begin[v];
        }
        let mut sorted = filled(total, (0u32, 0u32))?;
        let mut next = begin.clone();
        for face in 0..face_count {
            let vertices = usable(surface.face_vertices(face as u32));
            for k in 0..vertices.len() {
                let (low, high) = ends(vertices, k);
                let at = &mut next[low as usize];
                sorted[*at as usize] = (high, mesh.first[face] + k as u32);
                *at += 1;
            }
        }
        let mut owner = next;
        owner.clear();
        owner.try_reserve_exact(total)?;
        owner.resize(total, 0);
        for v in 0..vertex_count {
            let group = &mut sorted[begin[v] as usize..begin[v + 1] as usize];
            group.sort_unstable();
            let mut first = (NONE, NONE);
            for &mut entry in group {
                if entry.0 != first.0 {
                    first = entry;
                }
                owner[entry.1 as usize] = first.1;
            }
        }

        mesh.edges.try_reserve_exact(total)?;
        for face in 0..face_count {
            let vertices = usable(surface.face_vertices(face as u32));
            for k in 0..vertices.len() {
                let face_edge = mesh.edges.len();
                let own = owner[face_edge] as usize;
                if own == face_edge {
                    let (low, high) = ends(vertices, k);
                    mesh.edges.push(mesh.edge_owner.len() as u32);
                    mesh.edge_owner.push(own as u32);
                    mesh.edge_ends
                        .push([slots[low as usize], slots[high as usize]]);
                } else {
                    mesh.edges.push(mesh.edges[own]);
                }
            }
        }
        Ok(mesh)
    }

    /// Face-edges of a face.
    pub fn face_edges(&self, face: u32) -> std::ops::Range<usize> {
        self.first[face as usize] as usize..self.first[face as usize + 1] as usize
    }

    /// True where the face-edge is the owner of its edge.
    pub fn owns_edge(&self, face_edge: usize) -> bool {
        self.edge_owner[self.edges[face_edge] as usize] as usize == face_edge
    }

    /// True where the face-edge is the owner of its first corner's vertex.
    pub fn owns_corner(&self, face_edge: usize) -> bool {
        self.vertex_owner[self.corners[face_edge] as usize] as usize == face_edge
    }
}

/// The vertices of a face that can be diced; empty for one that cannot.
pub(super) fn usable(vertices: &[u32]) -> &[u32] {
    if vertices.len() < 3 { &[] } else { vertices }
}

/// True where edge `k` of a face runs from its parameter 0 to 1.
pub(super) fn runs_forward(vertices: &[u32], k: usize) -> bool {
    vertices[k] <= vertices[(k + 1) % vertices.len()]
}

fn filled<T: Clone>(count: usize, value: T) -> Result<Vec<T>, DiceError> {
    let mut v = Vec::new();
    v.try_reserve_exact(count)?;
    v.resize(count, value);
    Ok(v)
}
