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
//! That takes twice the memory, and builds of 2.6 times the time: [`APART`] lies where it begins to be worth it. Combed fur of 1 million parts by 2.2 times, for
//! 0.95 and 0.87, and builds more slowly as it is. Sheets and patches of 1 million, which stay together, gain nothing: 1.01 and 1.02, and rays that leave patches 1.15.

use glam::Vec3;
use rayon::prelude::*;

use super::block::{is_small, is_strip};
use super::thin::are_thin;
use crate::grid::DicedMesh;

/// How far neighbours go apart, at least, in units of the distance between them.
const APART: f32 = 5.0;
/// Strands whose neighbours are looked for, about.
const SAMPLES: usize = 32;

/// True where most grids are strands, and go apart. Not where they are [thin](super::thin): their trees are twice as large already.
/// Positions are finite.
pub fn go_apart(mesh: &DicedMesh) -> bool {
    let is_strand = |g: &usize| is_strip(&mesh.grids[*g]) && !is_small(&mesh.grids[*g]);
    let strands: Vec<usize> = (0..mesh.grids.len()).filter(is_strand).collect();
    if 2 * strands.len() <= mesh.grids.len() || are_thin(mesh) {
        return false;
    }
    let every = strands.len().div_ceil(SAMPLES);
    let (apart, distance) = strands
        .par_iter()
        .step_by(every)
        .filter_map(|&strand| apart(mesh, &strands, strand))
        .reduce(|| (0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
    apart > APART * distance
}

/// How far a strand and the one nearest to it, by their middles when the shutter opens, go apart until it closes, in the mean of
/// their ends and middles; and how far they were from each other. None where there is no other.
fn apart(mesh: &DicedMesh, strands: &[usize], strand: usize) -> Option<(f32, f32)> {
    let last = mesh.key_count() - 1;
    let middle = |g: usize| {
        let points = mesh.grid_positions(g, 0);
        points[points.len() / 2]
    };
    let from = middle(strand);
    let others = strands.iter().filter(|&&other| other != strand);
    let (distance, nearest) = others
        .map(|&other| (middle(other).distance_squared(from), other))
        .min_by(|a, b| a.0.total_cmp(&b.0))?;
    let ways = |g: usize| -> [Vec3; 3] {
        let (from, to) = (mesh.grid_positions(g, 0), mesh.grid_positions(g, last));
        [0, from.len() / 2, from.len() - 1].map(|i| to[i] - from[i])
    };
    let apart = ways(strand).into_iter().zip(ways(nearest));
    let sum: f32 = apart.map(|(a, b)| a.distance(b)).sum();
    Some((sum / 3.0, distance.sqrt()))
}
