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

/// What some faces need of a base mesh.
#[derive(Debug)]
pub(super) struct BasePart {
    /// The faces, with numbers of their own for edges and slots: those in the lists below. Nothing in it is
    /// owned.
    pub rows: BaseMesh,
    /// The faces that own the edges and slots, ascending.
    pub owners: Vec<u32>,
    /// Edges and slots of the mesh, ascending, which is the order of their owners too.
    edges: Vec<u32>,
    slots: Vec<u32>,
}

impl BasePart {
    /// True where an edge of the mesh is needed.
    pub fn has_edge(&self, edge: u32) -> bool {
        self.edges.binary_search(&edge).is_ok()
    }

    /// True where a vertex slot of the mesh is needed.
    pub fn has_slot(&self, slot: u32) -> bool {
        self.slots.binary_search(&slot).is_ok()
    }
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

    /// Bytes on the heap.
    pub fn bytes(&self) -> usize {
        let of = |numbers: &[u32]| size_of_val(numbers);
        of(&self.first)
            + of(&self.edges)
            + of(&self.corners)
            + of(&self.edge_owner)
            + size_of_val(self.edge_ends.as_slice())
            + of(&self.vertex_owner)
    }

    /// The face of a face-edge.
    pub fn face_of(&self, face_edge: u32) -> u32 {
        self.first.partition_point(|&first| first <= face_edge) as u32 - 1
    }

    /// True where no face-edge but two that run against each other share an edge, and the faces around
    /// each vertex hang together by their edges: then whatever evaluates a vertex or an edge, it is the
    /// same place. An edge from a vertex to itself (a pole) is that vertex.
    pub fn is_manifold(&self) -> bool {
        let total = self.edges.len();
        let next = |face_edge: u32| {
            let range = self.face_edges(self.face_of(face_edge));
            let after = face_edge as usize + 1;
            if after == range.end {
                range.start
            } else {
                after
            }
        };
        fn root(parents: &mut [u32], mut i: u32) -> u32 {
            while parents[i as usize] != i {
                parents[i as usize] = parents[parents[i as usize] as usize];
                i = parents[i as usize];
            }
            i
        }
        // Corners around a vertex, joined across edges.
        let mut parents: Vec<u32> = (0..total as u32).collect();
        let mut joined = 0;
        let mut shared = vec![false; self.edge_owner.len()];
        for (face_edge, &edge) in self.edges.iter().enumerate() {
            let own = self.edge_owner[edge as usize];
            let [from, to] = self.edge_ends[edge as usize];
            let b = next(face_edge as u32);
            if from == to {
                let (a, b) = (
                    root(&mut parents, face_edge as u32),
                    root(&mut parents, b as u32),
                );
                joined += usize::from(a != b);
                parents[a as usize] = b;
                continue;
            }
            if own as usize == face_edge {
                continue;
            }
            if std::mem::replace(&mut shared[edge as usize], true) {
                return false;
            }
            let a = next(own);
            if self.corners[own as usize] != self.corners[b]
                || self.corners[a] != self.corners[face_edge]
            {
                return false;
            }
            for [a, b] in [[own, b as u32], [a as u32, face_edge as u32]] {
                let (a, b) = (root(&mut parents, a), root(&mut parents, b));
                if a != b {
                    joined += 1;
                    parents[a as usize] = b;
                }
            }
        }
        // As many groups as vertices: none has two.
        total - joined == self.vertex_owner.len()
    }

    /// What `faces` need. Their rows in the part are in the order given.
    pub fn part(&self, faces: &[u32]) -> BasePart {
        let mut edges: Vec<u32> = Vec::new();
        let mut slots: Vec<u32> = Vec::new();
        for &face in faces {
            edges.extend_from_slice(&self.edges[self.face_edges(face)]);
            slots.extend_from_slice(&self.corners[self.face_edges(face)]);
        }
        for numbers in [&mut edges, &mut slots] {
            numbers.sort_unstable();
            numbers.dedup();
        }
        let at = |numbers: &[u32], wanted: u32| numbers.partition_point(|&n| n < wanted) as u32;
        let mut rows = BaseMesh::default();
        for &face in faces {
            let range = self.face_edges(face);
            rows.first.push(rows.edges.len() as u32);
            let own = self.edges[range.clone()].iter();
            rows.edges.extend(own.map(|&e| at(&edges, e)));
            let own = self.corners[range].iter();
            rows.corners.extend(own.map(|&s| at(&slots, s)));
        }
        rows.first.push(rows.edges.len() as u32);
        let ends = |&e: &u32| self.edge_ends[e as usize].map(|s| at(&slots, s));
        rows.edge_ends = edges.iter().map(ends).collect();
        let edge_owners = edges.iter().map(|&e| self.edge_owner[e as usize]);
        let slot_owners = slots.iter().map(|&s| self.vertex_owner[s as usize]);
        let owners = edge_owners.chain(slot_owners);
        let mut owners: Vec<u32> = owners.map(|face_edge| self.face_of(face_edge)).collect();
        owners.sort_unstable();
        owners.dedup();
        BasePart {
            rows,
            owners,
            edges,
            slots,
        }
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
