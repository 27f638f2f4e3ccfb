//! Diced geometry as it is traced: positions as rows of one coordinate each.
//!
//! A row of lattice vertices is a row of floats for x, which vector instructions load as it is, then one for y and one for z; the
//! next row of vertices follows. So what a group of micropolygons needs is near each other, and all of a strand's part lies
//! in one or two lines of the cache. The vertices of grid `g`, of which there are `n`, have their first x at key `k` at
//! `3 first_vertex K + 3 k n`.

use std::ops::Range;

use glam::{DVec3, Vec3};
use hdtrapeze_simd::{Kernel, Level, Simd};
use rayon::prelude::*;

use super::{DicedMesh, Grid, GridChannel, MAX_GRID_RATE, sound_grids};

/// Floats after the last row: of any row of micropolygons, 8 floats from both rows of vertices and one more stay inside.
pub(super) const PAD: usize = 3 * (MAX_GRID_RATE as usize + 1) + 8;

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
    floats: Vec<f32>,
    /// The first grid, where all have its rates and vertices that follow each other: where they are need not be looked up.
    alike: Option<Grid>,
    /// Keys of `normals`.
    pub normal_key_count: usize,
    /// Unit normals, octahedral.
    pub normals: Vec<u32>,
    /// Channels in the surface's order.
    pub channels: Vec<GridChannel>,
}

/// Vertices of a row of a grid's lattice.
#[inline(always)]
fn columns(grid: &Grid) -> usize {
    usize::from(grid.nu) + 1
}

/// Where the x of vertex `i` of a grid is, from where its first one is.
#[inline(always)]
fn x_of(grid: &Grid, i: usize) -> usize {
    // Numbers of vertices are below 2^32, which are divided faster.
    let row = i as u32 / columns(grid) as u32;
    i + 2 * columns(grid) * row as usize
}

/// The rows of one grid.
#[derive(Clone, Copy, Debug)]
pub struct GridRows<'a> {
    /// The grid.
    pub grid: Grid,
    /// Key times across the shutter.
    pub key_times: &'a [f32],
    /// Its rows, from the first key's first x on, and [more floats](PlanarMesh::floats) after the last.
    pub floats: &'a [f32],
}

impl GridRows<'_> {
    /// Position of vertex `(i, j)` at key `k`.
    #[inline(always)]
    pub fn position(&self, k: usize, i: usize, j: usize) -> Vec3 {
        let columns = columns(&self.grid);
        let x = 3 * (k * self.grid.vertex_count() + j * columns) + i;
        Vec3::new(
            self.floats[x],
            self.floats[x + columns],
            self.floats[x + 2 * columns],
        )
    }
    /// The coordinates of all vertices at all keys.
    pub fn coordinates(&self) -> &[f32] {
        &self.floats[..self.grid.vertex_count() * 3 * self.key_times.len()]
    }
}

/// Where the vertices of a group of micropolygons are.
#[derive(Clone, Copy, Debug)]
pub struct Lattice<'a> {
    floats: &'a [f32],
    first: usize,
    columns: usize,
    key: usize,
}

impl Lattice<'_> {
    /// Says that [`Lattice::load`] will be called soon.
    #[inline(always)]
    pub fn expect<S: Simd, const KEYS: usize>(self, simd: S) {
        simd.expect_lattices::<KEYS>(self.floats, self.first, self.columns, self.key);
    }
    /// The coordinates in the order of `axes`, at `KEYS` keys, which are there; see [`Simd::lattices`].
    #[inline(always)]
    pub fn load<S: Simd, const KEYS: usize>(
        self,
        simd: S,
        axes: [usize; 3],
    ) -> [[S::F16; 3]; KEYS] {
        simd.lattices::<KEYS>(self.floats, self.first, self.columns, self.key, axes)
    }
    /// The coordinates at the first key, or `k` keys later, of two micropolygons in a row, or of one and what follows it, 2 or 3 `columns` of vertices:
    /// row by row, x before y before z. `room` is for those that are apart in memory.
    ///
    /// # Panics
    /// The key is not there.
    #[inline(always)]
    pub fn strip<'b>(
        &'b self,
        k: usize,
        columns: usize,
        room: &'b mut [f32; STRIP],
    ) -> &'b [f32; STRIP] {
        let floats = &self.floats[self.first + k * self.key..];
        if self.columns == columns
            && let Some(all) = floats.first_chunk()
        {
            return all;
        }
        for (i, row) in room.chunks_exact_mut(columns).enumerate() {
            row.copy_from_slice(&floats[i * self.columns..][..columns]);
        }
        room
    }
}

/// Coordinates of 2 x 3 vertices.
pub const STRIP: usize = 18;

/// Vertices that one thread turns at a time.
const PART: usize = 1 << 13;

/// A run of grids, whose positions are not rows yet.
pub struct Run<'a> {
    key_times: &'a [f32],
    grids: &'a [Grid],
    sound: &'a [bool],
    numbers: Range<usize>,
    /// First vertex of the floats.
    first: usize,
    floats: &'a mut [f32],
}

impl Run<'_> {
    /// Those of its grids that can be traced.
    pub fn grids(&self) -> impl Iterator<Item = &Grid> {
        let numbers = self.numbers.clone().filter(|&g| self.sound[g]);
        numbers.map(|g| &self.grids[g])
    }

    /// Turns all grids into rows, in their order, and shows them to `visit` by number; none for a grid that
    /// cannot be traced ([`DicedMesh::sound_grids`]).
    pub fn turn(self, level: Level, mut visit: impl FnMut(u32, Option<GridRows<'_>>)) {
        let mut floats = Vec::new();
        for g in self.numbers {
            if !self.sound[g] {
                visit(g as u32, None);
                continue;
            }
            let grid = self.grids[g];
            let size = 3 * grid.vertex_count() * self.key_times.len();
            let from = (grid.first_vertex as usize - self.first) * self.key_times.len() * 3;
            if floats.len() < size + PAD {
                floats.resize(size + PAD, 0.0);
            }
            level.run(Turn {
                floats: &mut self.floats[from..from + size],
                rows: &mut floats[..size],
                columns: columns(&grid),
            });
            let rows = GridRows {
                grid,
                key_times: self.key_times,
                floats: &floats[..size + PAD],
            };
            visit(g as u32, Some(rows));
        }
    }
}

/// Turns positions into rows, there and in a copy.
struct Turn<'a> {
    floats: &'a mut [f32],
    rows: &'a mut [f32],
    columns: usize,
}

impl Kernel for Turn<'_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let n = self.columns;
        if n == 2 {
            // Strands, whose rows are short.
            let rows = self.rows.as_chunks_mut::<6>().0;
            for (p, row) in self.floats.as_chunks::<6>().0.iter().zip(rows) {
                *row = [p[0], p[3], p[1], p[4], p[2], p[5]];
            }
            self.floats.copy_from_slice(self.rows);
            return;
        }
        let rows = self.floats.chunks_exact(3 * n);
        for (points, row) in rows.zip(self.rows.chunks_exact_mut(3 * n)) {
            let (x, yz) = row.split_at_mut(n);
            let (y, z) = yz.split_at_mut(n);
            let to = x.iter_mut().zip(y).zip(z);
            for (p, ((x, y), z)) in points.chunks_exact(3).zip(to) {
                (*x, *y, *z) = (p[0], p[1], p[2]);
            }
        }
        self.floats.copy_from_slice(self.rows);
    }
}

/// As [`PlanarMesh::alike`].
fn alike(grids: &[Grid]) -> Option<Grid> {
    let first = *grids.first()?;
    let n = first.vertex_count() as u64;
    let same = |(g, grid): (u64, &Grid)| {
        (grid.nu, grid.nv) == (first.nu, first.nv) && u64::from(grid.first_vertex) == g * n
    };
    (0u64..).zip(grids).all(same).then_some(first)
}

impl From<DicedMesh> for PlanarMesh {
    fn from(mesh: DicedMesh) -> Self {
        Self::turned(mesh, |run| run.turn(Level::best(), |_, _| {})).0
    }
}

impl PlanarMesh {
    /// Turns the positions of a mesh into rows, in place. Runs of grids are handed to `visit`, from several
    /// threads, which turns them; what it returned, in the order of the grids. A mesh that is not
    /// [usable](DicedMesh::is_usable) has no rows, and no sound grids.
    pub fn turned<T: Send>(
        mesh: DicedMesh,
        visit: impl Fn(Run<'_>) -> T + Sync + Send,
    ) -> (Self, Vec<T>) {
        let usable = mesh.is_usable();
        let keys = mesh.key_count();
        let mut floats: Vec<f32> = Vec::new();
        let mut sound = vec![false; mesh.grids.len()];
        if usable {
            sound = mesh.sound_grids();
            let mut positions = mesh.positions;
            positions.truncate(mesh.vertex_count * keys);
            positions.reserve_exact(PAD.div_ceil(3));
            floats = bytemuck::cast_vec(positions);
            floats.resize(mesh.vertex_count * keys * 3 + PAD, 0.0);
            floats.shrink_to_fit();
        }
        let run = |numbers: Range<usize>, first, floats| Run {
            key_times: &mesh.key_times,
            grids: &mesh.grids,
            sound: &sound,
            numbers,
            first,
            floats,
        };
        let mut runs = Vec::new();
        let mut rest = &mut floats[..];
        let (mut number, mut from) = (0, 0);
        for (g, grid) in mesh.grids.iter().enumerate() {
            let first = grid.first_vertex as usize;
            if sound[g] && first >= from + PART {
                let (part, after) = rest.split_at_mut((first - from) * keys * 3);
                runs.push(run(number..g, from, part));
                (rest, number, from) = (after, g, first);
            }
        }
        runs.push(run(number..mesh.grids.len(), from, rest));
        let visited = runs.into_par_iter().map(visit).collect();
        let alike = alike(&mesh.grids);
        let mesh = Self {
            alike,
            origin: mesh.origin,
            key_times: mesh.key_times,
            grids: mesh.grids,
            vertex_count: mesh.vertex_count,
            floats,
            normal_key_count: mesh.normal_key_count,
            normals: mesh.normals,
            channels: mesh.channels,
        };
        (mesh, visited)
    }

    /// Rates and first vertex of grid `g`; its face may be another's. Of millions of strands that rays come to at random, looking
    /// them up is one more wait for memory, before vertices can be asked for.
    #[inline(always)]
    pub(crate) fn traced(&self, g: u32) -> Grid {
        match self.alike {
            Some(first) => Grid {
                first_vertex: g * first.vertex_count() as u32,
                ..first
            },
            None => self.grids[g as usize],
        }
    }

    /// The first grid, where all are as large and their vertices follow one another.
    pub(crate) fn alike(&self) -> Option<Grid> {
        self.alike
    }

    /// The rows of grid `g`.
    #[inline(always)]
    pub fn grid_rows(&self, g: usize) -> GridRows<'_> {
        self.rows_of(self.grids[g])
    }

    /// The same for [what is known](Self::traced) of grid `g`.
    #[inline(always)]
    pub(crate) fn traced_rows(&self, g: u32) -> GridRows<'_> {
        self.rows_of(self.traced(g))
    }

    #[inline(always)]
    fn rows_of(&self, grid: Grid) -> GridRows<'_> {
        GridRows {
            grid,
            key_times: &self.key_times,
            floats: &self.floats[self.first_float(&grid, 0)..],
        }
    }
}

impl PlanarMesh {
    /// Which grids can be traced: none of a mesh that was not usable.
    pub fn sound_grids(&self) -> Vec<bool> {
        match self.floats.is_empty() {
            true => vec![false; self.grids.len()],
            false => sound_grids(&self.grids, self.vertex_count),
        }
    }
    /// Bytes of the positions of all keys.
    pub fn position_bytes(&self) -> usize {
        size_of_val(&self.floats[..])
    }
    /// Some of the grids by themselves, in this order, without normals and channels. Those that are not sound are not
    /// there either, but have numbers.
    pub fn grids_of(&self, grids: &[u32]) -> DicedMesh {
        let keys = self.key_count();
        let mut out = DicedMesh {
            origin: self.origin,
            key_times: self.key_times.clone(),
            ..DicedMesh::default()
        };
        let sound = self.sound_grids();
        let count = |&g: &u32| match sound[g as usize] {
            true => self.grids[g as usize].vertex_count(),
            false => 1,
        };
        // Where there is no room, adding to them says so.
        let _ = out.reserve_positions(grids.iter().map(count).sum());
        for g in grids.iter().map(|&g| g as usize) {
            let mut grid = self.grids[g];
            if !sound[g] {
                (grid.nu, grid.nv) = (0, 0);
            }
            let n = grid.vertex_count();
            let places = (0..keys).flat_map(|k| (0..n).map(move |i| (k, i)));
            let position = |(k, i)| match sound[g] {
                true => self.position(g, k, i),
                false => Vec3::ZERO,
            };
            out.positions.extend(places.map(position));
            grid.first_vertex = out.vertex_count as u32;
            out.vertex_count += n;
            out.grids.push(grid);
        }
        out
    }
    /// The positions again, by themselves: those of grids that are not sound are zero, and there are no normals nor channels.
    pub fn bare(&self) -> DicedMesh {
        let mut out = DicedMesh {
            origin: self.origin,
            key_times: self.key_times.clone(),
            grids: self.grids.clone(),
            vertex_count: self.vertex_count,
            ..DicedMesh::default()
        };
        out.zero_positions();
        let sound = self.sound_grids();
        for g in (0..self.grids.len()).filter(|&g| sound[g]) {
            let n = self.grids[g].vertex_count();
            let first = self.grids[g].first_vertex as usize * self.key_count();
            let places = (0..self.key_count()).flat_map(|k| (0..n).map(move |i| (k, i)));
            for (place, (k, i)) in places.enumerate() {
                out.positions[first + place] = self.position(g, k, i);
            }
        }
        out
    }
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
    /// The rows of all grids, and so many floats more that a row of 5 from any row of a lattice, or the two
    /// after it, is in there.
    #[inline(always)]
    pub fn floats(&self) -> &[f32] {
        &self.floats
    }
    /// Where in [`PlanarMesh::floats`] the rows of `grid` at key `k` begin.
    #[inline(always)]
    pub fn first_float(&self, grid: &Grid, k: usize) -> usize {
        3 * (grid.first_vertex as usize * self.key_times.len() + k * grid.vertex_count())
    }
    /// The lattice of a group of micropolygons of `grid`, the first of which is `(i, j)`, from key `k` on.
    #[inline(always)]
    pub(crate) fn lattice(&self, grid: &Grid, k: usize, i: u8, j: u8) -> Lattice<'_> {
        let columns = columns(grid);
        Lattice {
            floats: &self.floats,
            first: self.first_float(grid, k) + usize::from(j) * 3 * columns + usize::from(i),
            columns,
            key: 3 * grid.vertex_count(),
        }
    }
    /// Position of vertex `i` of grid `g` at key `k`.
    pub fn position(&self, g: usize, k: usize, i: usize) -> Vec3 {
        let grid = &self.grids[g];
        let x = self.first_float(grid, k) + x_of(grid, i);
        Vec3::from_array([0, 1, 2].map(|axis| self.floats[x + axis * columns(grid)]))
    }
    /// Corners `(i, j) (i+1, j) (i+1, j+1) (i, j+1)` of micropolygon `(i, j)` of `grid` at key `k`.
    ///
    /// # Panics
    /// It is not there.
    #[inline]
    pub fn corners(&self, grid: &Grid, k: usize, i: usize, j: usize) -> [Vec3; 4] {
        let columns = columns(grid);
        let first = self.first_float(grid, k) + 3 * columns * j + i;
        let floats = &self.floats[first..][..5 * columns + 2];
        let at = |x: usize| Vec3::new(floats[x], floats[x + columns], floats[x + 2 * columns]);
        [at(0), at(1), at(3 * columns + 1), at(3 * columns)]
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
        size_of_val(&self.floats[..])
            + size_of_val(&self.normals[..])
            + size_of_val(&self.grids[..])
            + channels.sum::<usize>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Moved, they would lose their large pages.
    #[test]
    fn positions_that_have_room_stay_where_they_are() {
        let mut mesh = DicedMesh {
            key_times: vec![0.0, 1.0],
            ..DicedMesh::default()
        };
        let count = 17 * 17 * 5000;
        mesh.reserve_positions(count).expect("there is room");
        let at = mesh.positions.as_ptr().addr();
        let room = 3 * mesh.positions.capacity();
        assert!(room >= 3 * 2 * count + PAD, "{room}");
        mesh.positions.resize(2 * count, Vec3::ONE);
        mesh.grids = (0..5000)
            .map(|g| Grid {
                first_vertex: 17 * 17 * g,
                element: 0,
                nu: 16,
                nv: 16,
            })
            .collect();
        mesh.vertex_count = count;
        let copy = mesh.clone();
        assert!(3 * copy.positions.capacity() >= room);
        assert_eq!(copy, mesh);
        let mesh = PlanarMesh::from(mesh);
        assert_eq!(mesh.floats.as_ptr().addr(), at);
        let bare = mesh.bare();
        let at = bare.positions.as_ptr().addr();
        let bare = PlanarMesh::from(bare);
        assert_eq!((bare.floats.as_ptr().addr(), &bare), (at, &mesh));
        for floats in [mesh.floats, PlanarMesh::from(copy).floats, bare.floats] {
            assert_ne!(hdtrapeze_pages::were_asked_for(&floats), Some(false));
        }
    }

    #[test]
    fn traced_grids_are_those_of_the_mesh() {
        let mesh = |rates: &[(u16, u16)]| {
            let mut mesh = DicedMesh {
                key_times: vec![0.0],
                ..DicedMesh::default()
            };
            for &(nu, nv) in rates {
                let first_vertex = mesh.vertex_count as u32;
                let grid = Grid {
                    first_vertex,
                    element: 7,
                    nu,
                    nv,
                };
                mesh.vertex_count += grid.vertex_count();
                mesh.grids.push(grid);
            }
            mesh.positions = vec![Vec3::ZERO; mesh.vertex_count + 9];
            mesh
        };
        let check = |mesh: DicedMesh, alike: bool| {
            let mesh = PlanarMesh::from(mesh);
            assert_eq!(mesh.alike.is_some(), alike);
            for (g, grid) in (0..).zip(&mesh.grids) {
                let traced = mesh.traced(g);
                let of = |grid: &Grid| (grid.first_vertex, grid.nu, grid.nv);
                assert_eq!(of(&traced), of(grid), "{g}");
            }
        };
        check(mesh(&[(1, 16); 9]), true);
        check(mesh(&[(3, 2)]), true);
        check(mesh(&[]), false);
        check(mesh(&[(1, 16), (1, 16), (1, 15)]), false);
        // As many vertices, in other rows.
        check(mesh(&[(3, 2), (2, 3), (3, 2)]), false);
        // Vertices that no grid has, before the first one or between two.
        for from in [0, 2] {
            let mut mesh = mesh(&[(1, 16); 4]);
            for grid in &mut mesh.grids[from..] {
                grid.first_vertex += 9;
            }
            mesh.vertex_count += 9;
            check(mesh, false);
        }
    }

    #[test]
    fn rows_hold_the_positions() {
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
        // After the grid before it, but among the vertices of others.
        mesh.grids[300].first_vertex = 3;
        mesh.grids[301].first_vertex = 1000;
        assert!(mesh.vertex_count > 2 * PART);
        let planar = PlanarMesh::from(mesh.clone());
        let left_out = [77, 200, 201, 300, 301];
        for g in (0..400).filter(|g| !left_out.contains(g)) {
            for k in 0..3 {
                for (i, &p) in mesh.grid_positions(g, k).iter().enumerate() {
                    assert_eq!(planar.position(g, k, i), p, "{g} {k} {i}");
                }
            }
        }
        // Every second one, backwards.
        let picked: Vec<u32> = (70..310).rev().step_by(2).collect();
        let some = PlanarMesh::from(planar.grids_of(&picked));
        for (g, &whole) in picked.iter().enumerate() {
            let (n, whole) = (some.grids[g].vertex_count(), whole as usize);
            assert_eq!(some.grids[g].nu == 0, left_out.contains(&whole), "{whole}");
            for (k, i) in (0..3).flat_map(|k| (0..n).map(move |i| (k, i))) {
                let expected = match left_out.contains(&whole) {
                    true => Vec3::ZERO,
                    false => planar.position(whole, k, i),
                };
                assert_eq!(some.position(g, k, i), expected, "{whole} {k} {i}");
            }
        }
        let last = &planar.grids[399];
        let rows = planar.first_float(last, 2) + 3 * last.vertex_count() - 1;
        assert!(rows + PAD <= planar.floats().len());
    }
}
