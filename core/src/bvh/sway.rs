//! Whether strands go apart from their neighbours so far that a tree for each half of the shutter pays.
//!
//! A chord from open to close of the shutter bounds each part of a strand well, however far it goes, as long as it goes straight. But a
//! node holds what is near each other all the time, and where strands go ways of their own, as in wind, none stays near
//! another: in half the time they part half as far. As measured for crossing fur whose strands part by so many times the
//! distance between them, time beside one tree, of rays of a camera and of rays that leave it at random times:
//!
//! | micropolygons | apart | camera | leaving |
//! |---|---|---|---|
//! | 30 thousand | 1.6 | 1.00 | 1.00 to 1.03 |
//! | 100 thousand | 4.3 | 0.96 | 0.98 |
//! | 300 thousand | 6.4 | 0.94 | 0.93 |
//! | 1 million | 9.1 | 0.92 | 0.86 |
//! | 4 million | 22 | 0.93 | 0.86 |
//!
//! That takes twice the memory, and builds of 2.3 times the time: [`APART`] lies where it begins to be worth it. Combed fur of 1
//! million parts by 2.2 times, for 0.95 and 0.87, and builds more slowly as it is. Sheets and patches of 1 million, which
//! stay together, gain nothing: 1.01 and 1.02, and rays that leave patches 1.15.

use glam::Vec3;
use rayon::prelude::*;

use super::block::{is_small, is_strip};
use super::thin::are_thin;
use crate::grid::{DicedMesh, Grid};

/// How far neighbours go apart, at least, in units of the distance between them.
const APART: f32 = 5.0;
/// Strands whose neighbours are looked for, about.
const SAMPLES: usize = 16;
/// Stations of a strand, in quarters of its micropolygons.
const QUARTERS: usize = 5;
/// Those of a sample whose neighbours are looked for.
const LOOKED_AT: [usize; 3] = [0, 2, 4];

/// True where most grids are strands, and go apart. Not where they are [thin](super::thin): their trees are twice as large already.
pub fn go_apart(mesh: &DicedMesh) -> bool {
    let is_strand = |g: &usize| is_strip(&mesh.grids[*g]) && !is_small(&mesh.grids[*g]);
    let strands: Vec<usize> = (0..mesh.grids.len()).filter(is_strand).collect();
    if 2 * strands.len() <= mesh.grids.len() || are_thin(mesh) {
        return false;
    }
    let places: Vec<[Vec3; QUARTERS]> = strands
        .par_iter()
        .with_min_len(1024)
        .map(|&g| quarters(&mesh.grids[g]).map(|i| mesh.grid_positions(g, 0)[i]))
        .collect();
    let every = strands.len().div_ceil(SAMPLES);
    let samples = (0..strands.len()).step_by(every);
    let samples: Vec<_> = samples.flat_map(|i| LOOKED_AT.map(|q| (i, q))).collect();
    let found = samples
        .into_par_iter()
        .map(|sample| apart(mesh, (&strands, &places), sample));
    let found: Vec<_> = found.collect();
    // Summed in order, so that any number of threads finds the same.
    let (mut apart, mut distance) = (0.0, 0.0);
    for (way, from) in found.into_iter().flatten() {
        (apart, distance) = (apart + way, distance + from);
    }
    apart > APART * distance
}

/// The numbers of a strand's vertices on one side, at its begin, three between, and its end.
fn quarters(grid: &Grid) -> [usize; QUARTERS] {
    let (nu, nv) = (usize::from(grid.nu), usize::from(grid.nv));
    // Rows follow each other.
    match nu == 1 {
        true => [0, 1, 2, 3, 4].map(|q| 2 * (q * nv / 4)),
        false => [0, 1, 2, 3, 4].map(|q| q * nu / 4),
    }
}

/// How wide a strand is at a vertex of one side, when the shutter opens.
fn width(mesh: &DicedMesh, g: usize, i: usize) -> f32 {
    let (grid, points) = (&mesh.grids[g], mesh.grid_positions(g, 0));
    let across = if grid.nu == 1 {
        1
    } else {
        usize::from(grid.nu) + 1
    };
    points[i].distance(points[i + across])
}

/// How far a strand, at one of its quarters, and what of others is nearest to it there when the shutter opens, of their quarters, go apart until
/// it closes; and how far they were from each other, or how wide it is, if that is more. None where there is no other.
fn apart(
    mesh: &DicedMesh,
    (strands, places): (&[usize], &[[Vec3; QUARTERS]]),
    (i, quarter): (usize, usize),
) -> Option<(f32, f32)> {
    let at = places[i][quarter];
    let nearest = |(other, places): (usize, &[Vec3; QUARTERS])| {
        let squared = places.map(|p| p.distance_squared(at));
        (squared.into_iter().fold(f32::INFINITY, f32::min), other)
    };
    let others = places.iter().enumerate().filter(|(other, _)| *other != i);
    let (squared, other) = others.map(nearest).min_by(|a, b| a.0.total_cmp(&b.0))?;
    let is_it = |q: &usize| places[other][*q].distance_squared(at) == squared;
    let there = (0..QUARTERS).find(is_it)?;
    let last = mesh.key_count() - 1;
    let way = |strand: usize, quarter: usize| {
        let (g, vertex) = (
            strands[strand],
            quarters(&mesh.grids[strands[strand]])[quarter],
        );
        mesh.grid_positions(g, last)[vertex] - mesh.grid_positions(g, 0)[vertex]
    };
    let apart = way(i, quarter).distance(way(other, there));
    let vertex = quarters(&mesh.grids[strands[i]])[quarter];
    Some((apart, squared.sqrt().max(width(mesh, strands[i], vertex))))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Strands beside each other, whose ends go `way` to one side and the other in turns.
    fn strands(along_rows: bool, way: f32) -> DicedMesh {
        let mut mesh = DicedMesh {
            key_times: vec![0.0, 1.0],
            ..DicedMesh::default()
        };
        // As many as there are samples.
        for element in 0..SAMPLES as u32 {
            let (nu, nv) = if along_rows { (8, 1) } else { (1, 8) };
            for key in 0..2 {
                let side = if element % 2 == 0 { way } else { -way };
                for j in 0..=nv {
                    for i in 0..=nu {
                        let (v, u) = if along_rows { (i, j) } else { (j, i) };
                        let bend = side * (key * v * v) as f32 / 64.0;
                        let x = element as f32 + 0.1 * u as f32 + bend;
                        mesh.positions.push(Vec3::new(x, 0.0, v as f32));
                    }
                }
            }
            mesh.grids.push(Grid {
                first_vertex: mesh.vertex_count as u32,
                element,
                nu: nu as u16,
                nv: nv as u16,
            });
            mesh.vertex_count += 18;
        }
        mesh
    }

    #[test]
    fn strands_in_one_place_are_as_far_as_they_are_wide() {
        for along_rows in [false, true] {
            let together = |way: f32| {
                let mut mesh = strands(along_rows, way);
                for (i, p) in mesh.positions.iter_mut().enumerate() {
                    p.x -= (i / 36) as f32;
                }
                mesh
            };
            // They are 0.1 wide; half of them, and one, go another way than what is found beside them.
            assert!(!go_apart(&together(1.0)), "{along_rows}");
            assert!(go_apart(&together(1.15)), "{along_rows}");
        }
    }

    #[test]
    fn what_parts_far_enough_is_told_however_rows_run() {
        for along_rows in [false, true] {
            // Neighbours, 1 apart, part by (0 + 1/4 + 1) / 3 of twice the way.
            assert!(go_apart(&strands(along_rows, 6.1)), "{along_rows}");
            assert!(!go_apart(&strands(along_rows, 5.9)), "{along_rows}");
        }
    }
}
