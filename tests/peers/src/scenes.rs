//! Four families of micropolygons, moving and frozen, and their copies in Embree's layouts.
//!
//! **The same triangles.** Embree splits a quad `v0 v1 v2 v3` by the diagonal `v1 v3`, and a grid's cell
//! by the one from `(i+1, j)` to `(i, j+1)`; ours is the other. So vertex buffers hold the rows of each
//! lattice in reverse, which turns a grid's diagonals into ours, and quads begin one corner later.
//! Every geometry of Embree is then the very triangles that we trace.

use glam::Vec3;
use hdtrapeze_core::grid::{DicedMesh, Grid, PlanarMesh, lerp_position};
use rayon::prelude::*;

use crate::ffi;
use crate::rays::Lens;
use crate::trace_scenes::{combed, fur, keys, patches, sheet};

/// What the micropolygons are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// One surface that ripples.
    Sheet,
    /// Patches that tumble and drift.
    Patches,
    /// Ribbons that sway, and cross.
    Fur,
    /// Ribbons that sway, and run alike.
    Combed,
}

impl Family {
    pub const ALL: [Family; 4] = [Family::Sheet, Family::Patches, Family::Fur, Family::Combed];

    pub fn name(self) -> &'static str {
        match self {
            Family::Sheet => "sheet",
            Family::Patches => "patches",
            Family::Fur => "fur",
            Family::Combed => "combed",
        }
    }

    /// About `millions` of micropolygons with two keys.
    pub fn moving(self, millions: f64) -> DicedMesh {
        let keys = keys(2);
        match self {
            Family::Sheet => sheet(
                (62.5 * millions.sqrt()).round().max(1.0) as usize,
                16,
                &keys,
            ),
            Family::Patches => patches((4000.0 * millions).ceil() as usize, 16, &keys, 1),
            Family::Fur => fur((62500.0 * millions).ceil() as usize, &keys, 1),
            Family::Combed => {
                let count = (62500.0 * millions).ceil() as usize;
                // As wide as fur.
                combed(count, 0.6 / (count as f32).sqrt(), &keys, 1)
            }
        }
    }

    /// A camera with a lens that sees it.
    pub fn lens(self) -> Lens {
        match self {
            Family::Sheet => Lens::new(Vec3::new(0.3, -1.6, 1.8), Vec3::ZERO, 0.03, 0.45),
            Family::Patches => Lens::new(Vec3::new(0.4, 0.3, 4.0), Vec3::ZERO, 0.05, 0.35),
            Family::Fur | Family::Combed => Lens::new(
                Vec3::new(0.2, -1.5, 1.5),
                Vec3::new(0.0, 0.0, 0.1),
                0.02,
                0.3,
            ),
        }
    }
}

/// A mesh of two keys as it is at one instant.
pub fn frozen(mesh: &DicedMesh, time: f32) -> DicedMesh {
    let mut out = DicedMesh {
        key_times: vec![0.0],
        grids: mesh.grids.clone(),
        vertex_count: mesh.vertex_count,
        ..DicedMesh::default()
    };
    out.reserve_positions(mesh.vertex_count)
        .expect("there is room");
    for g in 0..mesh.grids.len() {
        let ends = mesh
            .grid_positions(g, 0)
            .iter()
            .zip(mesh.grid_positions(g, 1));
        out.positions
            .extend(ends.map(|(&a, &b)| lerp_position(a, b, time)));
    }
    out
}

/// Vertices, a buffer a key, rows of each lattice in reverse.
#[derive(Debug)]
pub struct Vertices {
    keys: Vec<Vec<f32>>,
    grids: Vec<Grid>,
    /// Number of each grid's first micropolygon.
    first_cell: Vec<usize>,
    count: usize,
}

impl Vertices {
    pub fn new(mesh: &PlanarMesh) -> Self {
        let key = |k: usize| {
            let mut key: Vec<f32> = mesh
                .grids
                .par_iter()
                .enumerate()
                .flat_map_iter(|(g, grid)| {
                    let row = usize::from(grid.nu) + 1;
                    let rows = (0..=usize::from(grid.nv)).rev();
                    let numbers = rows.flat_map(move |j| j * row..(j + 1) * row);
                    numbers.flat_map(move |i| mesh.position(g, k, i).to_array())
                })
                .collect();
            // Embree loads vertices by 16 bytes.
            key.push(0.0);
            key
        };
        let mut first_cell = vec![0];
        let mut cells = 0;
        for grid in &mesh.grids {
            cells += grid.cell_count();
            first_cell.push(cells);
        }
        Self {
            keys: (0..mesh.key_count()).map(key).collect(),
            grids: mesh.grids.clone(),
            first_cell,
            count: mesh.vertex_count,
        }
    }

    /// Coordinates at each key, and one float more.
    pub fn keys(&self) -> &[Vec<f32>] {
        &self.keys
    }

    /// Vertices of a key.
    pub fn count(&self) -> usize {
        self.count
    }
}

/// What Embree is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    Grid,
    Quad,
    Triangle,
}

impl Shape {
    pub fn name(self) -> &'static str {
        match self {
            Shape::Grid => "GRID",
            Shape::Quad => "QUAD",
            Shape::Triangle => "TRIANGLE",
        }
    }
}

/// Primitives over [`Vertices`].
#[derive(Debug)]
pub enum Indices {
    Grids(Vec<ffi::Grid>),
    Quads(Vec<[u32; 4]>),
    Triangles(Vec<[u32; 3]>),
}

impl Indices {
    pub fn new(shape: Shape, vertices: &Vertices) -> Self {
        let grids = &vertices.grids;
        match shape {
            Shape::Grid => Indices::Grids(
                grids
                    .iter()
                    .map(|grid| ffi::Grid {
                        first: grid.first_vertex,
                        stride: u32::from(grid.nu) + 1,
                        width: grid.nu + 1,
                        height: grid.nv + 1,
                    })
                    .collect(),
            ),
            Shape::Quad => {
                let quad = |[p00, p10, p11, p01]: [u32; 4]| [p10, p11, p01, p00];
                Indices::Quads(grids.par_iter().flat_map_iter(corners).map(quad).collect())
            }
            Shape::Triangle => {
                let split = |[p00, p10, p11, p01]: [u32; 4]| [[p00, p10, p11], [p00, p11, p01]];
                let cells = grids.par_iter().flat_map_iter(corners);
                Indices::Triangles(cells.flat_map_iter(split).collect())
            }
        }
    }

    /// Bytes of the buffer.
    pub fn bytes(&self) -> usize {
        match self {
            Indices::Grids(v) => size_of_val(&v[..]),
            Indices::Quads(v) => size_of_val(&v[..]),
            Indices::Triangles(v) => size_of_val(&v[..]),
        }
    }

    /// Our number, over all grids, of the micropolygon that was hit.
    pub fn cell(&self, vertices: &Vertices, primitive: usize, u: f32, v: f32) -> usize {
        match self {
            Indices::Quads(_) => primitive,
            Indices::Triangles(_) => primitive / 2,
            Indices::Grids(_) => {
                let grid = &vertices.grids[primitive];
                let at = |x: f32, n: u16| ((x * f32::from(n)).floor().max(0.0) as u16).min(n - 1);
                let (i, reversed) = (at(u, grid.nu), at(v, grid.nv));
                let cell = usize::from(grid.nv - 1 - reversed) * usize::from(grid.nu);
                vertices.first_cell[primitive] + cell + usize::from(i)
            }
        }
    }
}

/// Corners `(i,j) (i+1,j) (i+1,j+1) (i,j+1)` of each micropolygon, by numbers in [`Vertices`].
fn corners(grid: &Grid) -> impl Iterator<Item = [u32; 4]> + use<> {
    let (first, nu, nv) = (grid.first_vertex, u32::from(grid.nu), u32::from(grid.nv));
    let at = move |i: u32, j: u32| first + (nv - j) * (nu + 1) + i;
    (0..nu * nv).map(move |cell| {
        let (i, j) = (cell % nu, cell / nu);
        [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]
    })
}
