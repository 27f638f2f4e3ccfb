//! Diced geometry as it is traced: positions as planes of one coordinate each.
//!
//! A row of lattice vertices is then a row of floats, which vector instructions load as it is. The
//! vertices of grid `g`, of which there are `n`, have at key `k` their x, y and z coordinates at
//! `3 first_vertex K + 3 k n`, and `n` and `2 n` after that.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{DicedMesh, Grid, GridChannel, MAX_GRID_RATE};

/// Floats after the last plane: a row of 5 from any lattice row or the two after it stays inside.
const PAD: usize = 2 * (MAX_GRID_RATE as usize + 1) + 5;

/// One object's grids, ready to be traced. Fields that [`DicedMesh`] has too mean the same.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlanarMesh {
    /// What positions are relative to.
    pub origin: DVec3,
    /// Key times across the shutter.
    pub key_times: Vec<f32>,
    /// Grids, in the order of their vertices.
    pub grids: Vec<Grid>,
    /// Lattice vertices of all grids, per key.
    pub vertex_count: usize,
    planes: Vec<f32>,
    /// Keys of `normals`.
    pub normal_key_count: usize,
    /// Unit normals, octahedral.
    pub normals: Vec<u32>,
    /// Channels in the surface's order.
    pub channels: Vec<GridChannel>,
}

impl From<DicedMesh> for PlanarMesh {
    /// Grids that are not sound (see [`DicedMesh::is_sound`]) get zeros for positions.
    fn from(mesh: DicedMesh) -> Self {
        let planes = if mesh.is_usable() {
            planes_of(&mesh)
        } else {
            Vec::new()
        };
        Self {
            origin: mesh.origin,
            key_times: mesh.key_times,
            grids: mesh.grids,
            vertex_count: mesh.vertex_count,
            planes,
            normal_key_count: mesh.normal_key_count,
            normals: mesh.normals,
            channels: mesh.channels,
        }
    }
}

/// Vertices that one thread turns at a time.
const PART: usize = 1 << 14;

fn planes_of(mesh: &DicedMesh) -> Vec<f32> {
    let keys = mesh.key_count();
    let mut planes = vec![0.0; mesh.vertex_count * keys * 3 + PAD];
    // Runs of grids, each with its part of the planes.
    let mut parts: Vec<(std::ops::Range<usize>, usize, &mut [f32])> = Vec::new();
    let mut rest = &mut planes[..];
    let (mut first, mut from) = (0, 0);
    for (g, grid) in mesh.grids.iter().enumerate() {
        let start = grid.first_vertex as usize;
        if mesh.is_sound(g) && start >= from + PART {
            let (part, after) = rest.split_at_mut((start - from) * keys * 3);
            parts.push((first..g, from, part));
            (rest, first, from) = (after, g, start);
        }
    }
    parts.push((first..mesh.grids.len(), from, rest));
    parts.into_par_iter().for_each(|(grids, from, part)| {
        for g in grids.filter(|&g| mesh.is_sound(g)) {
            let grid = &mesh.grids[g];
            let (start, n) = (grid.first_vertex as usize, grid.vertex_count());
            let positions = &mesh.positions[start * keys..][..n * keys];
            let part = &mut part[(start - from) * keys * 3..][..n * keys * 3];
            for (positions, planes) in positions.chunks_exact(n).zip(part.chunks_exact_mut(3 * n)) {
                let (x, yz) = planes.split_at_mut(n);
                let (y, z) = yz.split_at_mut(n);
                for (i, p) in positions.iter().enumerate() {
                    (x[i], y[i], z[i]) = (p.x, p.y, p.z);
                }
            }
        }
    });
    planes
}

impl PlanarMesh {
    /// Number of position keys.
    pub fn key_count(&self) -> usize {
        self.key_times.len()
    }
    /// True when vertices move within the shutter.
    pub fn is_moving(&self) -> bool {
        self.key_times.len() > 1
    }
    /// Micropolygons of all grids.
    pub fn cell_count(&self) -> usize {
        self.grids.iter().map(Grid::cell_count).sum()
    }
    /// The planes of all grids.
    #[inline(always)]
    pub fn planes(&self) -> &[f32] {
        &self.planes
    }
    /// Where in [`PlanarMesh::planes`] those of `grid` at key `k` begin; they are `vertex_count` apart.
    #[inline(always)]
    pub fn plane_start(&self, grid: &Grid, k: usize) -> usize {
        3 * (grid.first_vertex as usize * self.key_times.len() + k * grid.vertex_count())
    }
    /// Position of vertex `i` of grid `g` at key `k`.
    pub fn position(&self, g: usize, k: usize, i: usize) -> Vec3 {
        let grid = &self.grids[g];
        let (start, n) = (self.plane_start(grid, k), grid.vertex_count());
        Vec3::from_array([0, 1, 2].map(|axis| self.planes[start + axis * n + i]))
    }
    /// Normals of grid `g` at key `k` (`k < normal_key_count`).
    pub fn grid_normals(&self, g: usize, k: usize) -> &[u32] {
        let grid = &self.grids[g];
        let n = grid.vertex_count();
        let start = grid.first_vertex as usize * self.normal_key_count + k * n;
        &self.normals[start..start + n]
    }
    /// Bytes on the heap.
    pub fn bytes(&self) -> usize {
        let channels = self.channels.iter().map(|c| size_of_val(&c.values[..]));
        size_of_val(&self.planes[..])
            + size_of_val(&self.normals[..])
            + size_of_val(&self.grids[..])
            + channels.sum::<usize>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_hold_the_positions() {
        // Enough grids for several parts, some of which are not sound.
        let mut mesh = DicedMesh {
            key_times: vec![0.0, 0.5, 1.0],
            ..DicedMesh::default()
        };
        for g in 0..400u16 {
            let grid = Grid {
                first_vertex: mesh.vertex_count as u32,
                element: 0,
                nu: 1 + g % 16,
                nv: 1 + g / 7 % 16,
            };
            let n = grid.vertex_count();
            let at = |i: usize| Vec3::new(i as f32, f32::from(g), i as f32 * 0.5 - f32::from(g));
            mesh.positions.extend((0..3 * n).map(at));
            mesh.vertex_count += n;
            mesh.grids.push(grid);
        }
        mesh.grids[77].nu = 99;
        mesh.grids[200].first_vertex = 3;
        mesh.grids[201].first_vertex = u32::MAX;
        assert!(mesh.vertex_count > 2 * PART);
        let planar = PlanarMesh::from(mesh.clone());
        for g in (0..400).filter(|&g| ![77, 78, 200, 201, 202].contains(&g)) {
            for k in 0..3 {
                for (i, &p) in mesh.grid_positions(g, k).iter().enumerate() {
                    assert_eq!(planar.position(g, k, i), p, "{g} {k} {i}");
                }
            }
        }
        let last = &planar.grids[399];
        let rows = planar.plane_start(last, 2) + 3 * last.vertex_count() - 1;
        assert!(rows + PAD <= planar.planes().len());
    }
}
