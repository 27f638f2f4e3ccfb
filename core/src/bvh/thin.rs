//! Whether the strands of an object are so thin that each of their micropolygons is an item of its tree, not every two.
//!
//! The box of a part that leans has an area of about the square of its length, whatever its width. Half as long, two parts have half of
//! that together, and rays meet half as many; for a tree of twice the size, that takes nearly twice as long to build. How many boxes a ray
//! meets before it hits a strand is about what boxes have of the area of strands ([`THIN`]). As measured, time beside
//! parts of two: crossing fur of 1 million micropolygons, with 16 times the area of its strands, 0.92 for rays of a camera and 0.95
//! for rays that leave it where nothing moves, 1.10 and 1.03 where things do; of 4 million, with 32 times, 0.88 and 0.76, and 0.93 and
//! 0.88; of 16 million, with 63 times, 0.73 and 0.55, and 0.80 and 0.75. Combed fur, whose boxes are along strands, gains less: of 1
//! million, with 39 times, 0.96 and 0.87 where nothing moves. Fifty lies between what builds in half the time and what traces in two
//! thirds of it.
//!
//! It is asked of an object as a whole: where a few strands in a hundred of the largest fur kept parts of two, rays took up to a tenth
//! longer.

use glam::Vec3;

use super::COORDINATE_LIMIT;
use super::block::{is_small, is_strip};
use crate::grid::DicedMesh;

/// What the boxes around every two micropolygons of strands have of these strands' area, at least, where strands are thin.
const THIN: f64 = 50.0;

/// Grids that are looked at, about.
const SAMPLES: usize = 1024;

/// True where strands are thin, by some of them as they are at the first key. Not where there is nothing to be hit.
pub fn are_thin(mesh: &DicedMesh) -> bool {
    let every = mesh.grids.len().div_ceil(SAMPLES).max(1);
    let looked_at = || (0..mesh.grids.len()).step_by(every);
    let is_strand = |&g: &usize| is_strip(&mesh.grids[g]) && !is_small(&mesh.grids[g]);
    if !looked_at().any(|g| is_strand(&g)) {
        return false;
    }
    let sound = mesh.sound_grids();
    let (mut boxes, mut strands) = (0.0, 0.0);
    for g in looked_at().filter(is_strand).filter(|&g| sound[g]) {
        let grid = &mesh.grids[g];
        let first = grid.first_vertex as usize * mesh.key_count();
        let Some(p) = mesh.positions.get(first..first + grid.vertex_count()) else {
            continue;
        };
        // Comparisons with NaN are false.
        if !p
            .iter()
            .all(|p| p.abs().cmplt(Vec3::splat(COORDINATE_LIMIT)).all())
        {
            continue;
        }
        let [nu, nv] = [grid.nu, grid.nv].map(usize::from);
        let at = |station: usize, side: usize| match nu {
            1 => p[2 * station + side],
            _ => p[(nu + 1) * side + station],
        };
        for station in (0..nu.max(nv) - 1).step_by(2) {
            let edge = at(station + 2, 0) - at(station, 0);
            let [x, y, z] = edge.abs().to_array().map(f64::from);
            let width = at(station + 1, 0).distance(at(station + 1, 1));
            boxes += x * y + y * z + z * x;
            strands += f64::from(edge.length()) * f64::from(width);
        }
    }
    strands > 0.0 && boxes > THIN * strands
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Grid;

    /// A strand along `way`, across the rows of its grid or along them.
    fn strand(way: Vec3, width: f32, along: bool) -> DicedMesh {
        let (nu, nv) = if along { (16, 1) } else { (1, 16) };
        let mut mesh = DicedMesh {
            key_times: vec![0.0],
            vertex_count: 34,
            grids: vec![Grid {
                first_vertex: 0,
                element: 0,
                nu,
                nv,
            }],
            ..DicedMesh::default()
        };
        let side = way.normalize().any_orthonormal_vector() * width;
        for j in 0..=nv {
            for i in 0..=nu {
                let (k, side) = match along {
                    true => (i, side * f32::from(j)),
                    false => (j, side * f32::from(i)),
                };
                mesh.positions.push(way * f32::from(k) + side);
            }
        }
        mesh
    }

    #[test]
    fn strands_are_thin_by_the_boxes_around_them() {
        for along in [false, true] {
            // Every two micropolygons have a box whose half area is 12, and an area of 2 sqrt(3) widths.
            let limit = 12.0 / (2.0 * 3f32.sqrt() * THIN as f32);
            assert!(are_thin(&strand(Vec3::ONE, limit * 0.99, along)));
            assert!(!are_thin(&strand(Vec3::ONE, limit * 1.01, along)));
            // Along an axis the box is the strand.
            assert!(!are_thin(&strand(Vec3::X, limit * 0.1, along)));
            assert!(!are_thin(&strand(Vec3::ONE, 0.0, along)));
        }
        assert!(!are_thin(&DicedMesh::default()));
        // What cannot be traced says nothing.
        let mut bad = strand(Vec3::ONE, 1e-3, false);
        bad.grids[0].first_vertex = 7;
        assert!(!are_thin(&bad));
        let mut bad = strand(Vec3::ONE, 1e-3, false);
        for x in [f32::NAN, f32::INFINITY, COORDINATE_LIMIT] {
            bad.positions[33].x = x;
            assert!(!are_thin(&bad));
        }
    }
}
