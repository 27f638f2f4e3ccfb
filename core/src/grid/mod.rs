//! Diced geometry: micropolygon grids with time-sampled vertices.
//!
//! A [`DicedMesh`] is one object's grids, ready for the BVH. Positions are f32 relative to
//! [`DicedMesh::origin`] (f64), so that an object far from the world's origin loses nothing.
//!
//! **Layout.** Grid `g` has `(nu+1) * (nv+1)` lattice vertices, row-major, `u` fastest. Its
//! vertices have numbers `first_vertex .. first_vertex + vertex_count`. With `K` keys, positions are
//! stored key-major inside the grid: vertex `i` of the grid at key `k` stands at
//! `first_vertex * K + k * vertex_count + i`. Normals have the same layout with `normal_key_count`
//! keys. Channels are per vertex number, not per key.
//!
//! **Motion.** Between neighbouring keys a vertex moves on a straight line at constant speed:
//! `P(time) = (1 - f) P_k + f P_{k+1}`, with `f = (time - t_k) / (t_{k+1} - t_k)`. Where the path
//! the scene asks for is curved, dicing has already added keys.
//!
//! **Micropolygons.** Cell `(i, j)` of a grid has corners `(i,j) (i+1,j) (i+1,j+1) (i,j+1)`, and is
//! two triangles split by the diagonal `(i,j)-(i+1,j+1)`; cell number `j * nu + i`. Cells may be
//! degenerate (stitching copies vertices).

use std::collections::TryReserveError;

use glam::{DVec3, Vec3};

/// One micropolygon grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    /// Number of this grid's first lattice vertex.
    pub first_vertex: u32,
    /// Authored face that the grid lies on.
    pub element: u32,
    /// Micropolygons along u, 1 to [`MAX_GRID_RATE`].
    pub nu: u16,
    /// Micropolygons along v, 1 to [`MAX_GRID_RATE`].
    pub nv: u16,
}

/// Most micropolygons along one side of a grid.
pub const MAX_GRID_RATE: u32 = 16;

impl Grid {
    /// Lattice vertices of the grid.
    pub fn vertex_count(&self) -> usize {
        (self.nu as usize + 1) * (self.nv as usize + 1)
    }
    /// Micropolygons of the grid.
    pub fn cell_count(&self) -> usize {
        self.nu as usize * self.nv as usize
    }
    /// Where its vertices end, when rates are from 1 to [`MAX_GRID_RATE`] and its vertices are in `from..to`.
    fn sound_end(&self, from: usize, to: usize) -> Option<usize> {
        let rate = 1..=MAX_GRID_RATE as u16;
        let first = self.first_vertex as usize;
        let end = first + self.vertex_count();
        let sound =
            rate.contains(&self.nu) && rate.contains(&self.nv) && first >= from && end <= to;
        sound.then_some(end)
    }
}

/// A primvar over the lattice vertices of a diced mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GridChannel {
    /// Floats per vertex.
    pub width: usize,
    /// `vertex_count * width` floats.
    pub values: Vec<f32>,
}

/// One object's grids.
#[derive(Debug, Default, PartialEq)]
pub struct DicedMesh {
    /// What positions are relative to, in the space they were diced in (world for flattened
    /// objects, object space for instanced prototypes).
    pub origin: DVec3,
    /// Key times across the shutter, ascending; one key (0) when nothing moves, else the first is 0
    /// and the last is 1.
    pub key_times: Vec<f32>,
    /// Grids.
    pub grids: Vec<Grid>,
    /// Lattice vertices of all grids, per key.
    pub vertex_count: usize,
    /// Positions; see the module's text for the layout.
    pub positions: Vec<Vec3>,
    /// Keys of `normals`: 0 (none stored: flat shading), 1, or the number of position keys.
    pub normal_key_count: usize,
    /// Unit normals, octahedral, see [`crate::grid::octahedral`].
    pub normals: Vec<u32>,
    /// Channels in the surface's order.
    pub channels: Vec<GridChannel>,
}

/// Positions of the copy have [room](DicedMesh::reserve_positions), too.
impl Clone for DicedMesh {
    fn clone(&self) -> Self {
        let Self {
            origin,
            ref key_times,
            ref grids,
            vertex_count,
            ref positions,
            normal_key_count,
            ref normals,
            ref channels,
        } = *self;
        let mut copy = Self {
            origin,
            key_times: key_times.clone(),
            grids: grids.clone(),
            vertex_count,
            positions: Vec::new(),
            normal_key_count,
            normals: normals.clone(),
            channels: channels.clone(),
        };
        // Of a mesh that is not usable there may be fewer. Where there is no room, the next line says so.
        let _ = copy.reserve_positions(vertex_count.min(positions.len()));
        copy.positions.extend_from_slice(positions);
        copy
    }
}

impl DicedMesh {
    /// Number of position keys.
    pub fn key_count(&self) -> usize {
        self.key_times.len()
    }
    /// Makes room for the positions of `count` vertices in all, at all keys, in large pages of memory, where rays are quick to
    /// find them; and for [what follows them](PlanarMesh::floats) where they are traced, so that they need not move. Key times are
    /// known by then, and positions are not there yet.
    ///
    /// # Errors
    /// There is no such room.
    pub fn reserve_positions(&mut self, count: usize) -> Result<(), TryReserveError> {
        let all = count.saturating_mul(self.key_count());
        let all = all.saturating_add(planar::PAD.div_ceil(3));
        self.positions.try_reserve_exact(all)?;
        hdtrapeze_pages::expect_large(&mut self.positions);
        Ok(())
    }
    /// Makes the positions of all vertices zero, at all keys, in the same pages and with the same room, which nobody has written to yet:
    /// several threads may, at once.
    pub fn zero_positions(&mut self) {
        let all = self.vertex_count * self.key_count();
        // Of plain numbers, since only such vectors come zeroed from the system.
        let floats = vec![0.0f32; 3 * (all + planar::PAD.div_ceil(3))];
        self.positions = bytemuck::cast_vec(floats);
        hdtrapeze_pages::expect_large(&mut self.positions);
        self.positions.truncate(all);
    }
    /// True when vertices move within the shutter.
    pub fn is_moving(&self) -> bool {
        self.key_times.len() > 1
    }
    /// Micropolygons of all grids.
    pub fn cell_count(&self) -> usize {
        self.grids.iter().map(Grid::cell_count).sum()
    }
    /// True when keys ascend from 0 to 1 and there is a position for every vertex and key.
    pub fn is_usable(&self) -> bool {
        let keys = &self.key_times;
        let needed = self.vertex_count.checked_mul(self.key_count());
        needed.is_some_and(|needed| self.positions.len() >= needed)
            && keys.windows(2).all(|w| w[0] < w[1])
            && (keys.len() == 1 || keys.first() == Some(&0.0) && keys.last() == Some(&1.0))
    }
    /// Which grids have rates that are allowed and vertices within the mesh, after those of all such grids before.
    /// What a grid that is not sound says of its vertices counts for none after it.
    pub fn sound_grids(&self) -> Vec<bool> {
        sound_grids(&self.grids, self.vertex_count)
    }
    /// Positions of grid `g` at key `k`.
    pub fn grid_positions(&self, g: usize, k: usize) -> &[Vec3] {
        let grid = &self.grids[g];
        let n = grid.vertex_count();
        let start = grid.first_vertex as usize * self.key_count() + k * n;
        &self.positions[start..start + n]
    }
    /// Normals of grid `g` at key `k` (`k < normal_key_count`).
    pub fn grid_normals(&self, g: usize, k: usize) -> &[u32] {
        let grid = &self.grids[g];
        let n = grid.vertex_count();
        let start = grid.first_vertex as usize * self.normal_key_count + k * n;
        &self.normals[start..start + n]
    }
}

/// As [`DicedMesh::sound_grids`].
fn sound_grids(grids: &[Grid], vertex_count: usize) -> Vec<bool> {
    let mut from = 0;
    let sound = |grid: &Grid| {
        let end = grid.sound_end(from, vertex_count);
        from = end.unwrap_or(from);
        end.is_some()
    };
    grids.iter().map(sound).collect()
}

/// Segment of `key_times` that holds `time` (clamped to the keys), and the fraction inside it. One
/// key gives `(0, 0.0)`. The only place where a time becomes a segment.
#[inline]
pub fn locate_key(key_times: &[f32], time: f32) -> (usize, f32) {
    let n = key_times.len();
    if n < 2 {
        return (0, 0.0);
    }
    let k = key_times[1..n - 1].partition_point(|&t| t <= time);
    let (a, b) = (key_times[k], key_times[k + 1]);
    (k, ((time - a) / (b - a)).clamp(0.0, 1.0))
}

/// A vertex between two keys: the one interpolation order that every stage uses, so that a shared
/// vertex has the same bits in every grid that holds it.
#[inline(always)]
pub fn lerp_position(p0: Vec3, p1: Vec3, f: f32) -> Vec3 {
    p0 + (p1 - p0) * f
}

pub mod octahedral;
pub mod planar;

pub use planar::PlanarMesh;
