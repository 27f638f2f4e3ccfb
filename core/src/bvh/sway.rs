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
//! | 100 thousand | 3.9 | 0.96 | 0.98 |
//! | 300 thousand | 5.9 | 0.94 | 0.93 |
//! | 1 million | 10.6 | 0.92 | 0.86 |
//! | 4 million | 20.9 | 0.93 | 0.86 |
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
const SAMPLES: usize = 32;

/// True where most grids are strands, and go apart. Not where they are [thin](super::thin): their trees are twice as large already.
pub fn go_apart(mesh: &DicedMesh) -> bool {
    let is_strand = |g: &usize| is_strip(&mesh.grids[*g]) && !is_small(&mesh.grids[*g]);
    let strands: Vec<usize> = (0..mesh.grids.len()).filter(is_strand).collect();
    if 2 * strands.len() <= mesh.grids.len() || are_thin(mesh) {
        return false;
    }
    let middles: Vec<Vec3> = strands
        .par_iter()
        .with_min_len(1024)
        .map(|&g| mesh.grid_positions(g, 0)[along(&mesh.grids[g])[1]])
        .collect();
    let every = strands.len().div_ceil(SAMPLES);
    let samples = (0..strands.len()).into_par_iter().step_by(every);
    let found: Vec<_> = samples
        .map(|i| apart(mesh, (&strands, &middles), i))
        .collect();
    // Summed in order, so that any number of threads finds the same.
    let (mut apart, mut distance) = (0.0, 0.0);
    for (way, from) in found.into_iter().flatten() {
        (apart, distance) = (apart + way, distance + from);
    }
    apart > APART * distance
}

/// The numbers of a strand's vertices on one side at its begin, middle and end.
fn along(grid: &Grid) -> [usize; 3] {
    let (nu, nv) = (usize::from(grid.nu), usize::from(grid.nv));
    // Rows follow each other.
    match nu == 1 {
        true => [0, 2 * (nv / 2), 2 * nv],
        false => [0, nu / 2, nu],
    }
}

/// How wide a strand is in the middle, when the shutter opens.
fn width(mesh: &DicedMesh, g: usize) -> f32 {
    let (grid, points) = (&mesh.grids[g], mesh.grid_positions(g, 0));
    let [_, middle, _] = along(grid);
    let across = if grid.nu == 1 {
        1
    } else {
        usize::from(grid.nu) + 1
    };
    points[middle].distance(points[middle + across])
}

/// How far strand number `i` and the one nearest to it, by their middles when the shutter opens, go apart until it closes, in the mean of
/// their ends and middles; and how far they were from each other, or how wide, if that is more. None where there is no other.
fn apart(
    mesh: &DicedMesh,
    (strands, middles): (&[usize], &[Vec3]),
    i: usize,
) -> Option<(f32, f32)> {
    let last = mesh.key_count() - 1;
    let others = (0..strands.len()).filter(|&other| other != i);
    let (distance, nearest) = others
        .map(|other| (middles[other].distance_squared(middles[i]), other))
        .min_by(|a, b| a.0.total_cmp(&b.0))?;
    let ways = |g: usize| -> [Vec3; 3] {
        let (from, to) = (mesh.grid_positions(g, 0), mesh.grid_positions(g, last));
        along(&mesh.grids[g]).map(|i| to[i] - from[i])
    };
    let apart = ways(strands[i]).into_iter().zip(ways(strands[nearest]));
    let sum: f32 = apart.map(|(a, b)| a.distance(b)).sum();
    Some((sum / 3.0, distance.sqrt().max(width(mesh, strands[i]))))
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
        for element in 0..30 {
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
            assert!(!go_apart(&together(1.1)), "{along_rows}");
            assert!(go_apart(&together(1.3)), "{along_rows}");
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
