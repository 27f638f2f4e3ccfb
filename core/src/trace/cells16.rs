//! Watertight tests of a vector of rays against one group of micropolygons: the test of [`super::cell`],
//! with rays for lanes. The same operations in the same order on each ray, so the same hits.

use hdtrapeze_simd::{Float, Mask, Simd};

use super::cell::{CellHit, exact};
use super::packet::{CellRays, LANES, Lanes, PACKET, axes_with};
use crate::bvh::block::CellRect;
use crate::grid::PlanarMesh;

/// Most vertices of a group: 5x3.
const VERTICES: usize = 15;
/// Vertices in a row of a full group.
const ROW: usize = 5;

/// Tests the rays `lanes` of vector `v` against the cells `rect` of grid `g`, one group; calls
/// `accept(lane, cell, hit)` for every triangle hit, in no useful order.
#[inline(always)]
#[allow(clippy::too_many_arguments)] // one call, inlined
pub fn test_group16<S: Simd, const MOVING: bool>(
    simd: S,
    cells: &CellRays,
    v: usize,
    lanes: u32,
    mesh: &PlanarMesh,
    g: u32,
    rect: CellRect,
    mut accept: impl FnMut(usize, u32, CellHit),
) {
    let grid = &mesh.grids[g as usize];
    let one = (LANES * v + lanes.trailing_zeros() as usize) & (PACKET - 1);
    let axes = axes_with(cells.z_axis[one]);
    let stride = usize::from(grid.nu) + 1;
    let n = grid.vertex_count();
    let first = usize::from(rect.j) * stride + usize::from(rect.i);
    let (w, h) = (usize::from(rect.w).min(4), usize::from(rect.h).min(2));
    let zero = simd.all16(0.0);
    let fraction = simd.from16(&cells.fraction[v]);
    let start = mesh.plane_start(grid, cells.key[one] as usize) + first;

    // Vertices relative to each ray's origin, at its time, sheared.
    let (mut x, mut y, mut z) = ([zero; VERTICES], [zero; VERTICES], [zero; VERTICES]);
    for (to, a) in [(&mut z, 2), (&mut x, 0), (&mut y, 1)] {
        let axis = axes[a];
        let origin = simd.from16(&cells.origin[a][v]);
        for r in 0..=h {
            let at = start + axis * n + r * stride;
            let p0 = &mesh.planes()[at..at + w + 1];
            for (c, &p0) in p0.iter().enumerate() {
                let p = if MOVING {
                    let p1 = mesh.planes()[at + 3 * n + c];
                    simd.all16(p0) + simd.all16(p1 - p0) * fraction
                } else {
                    simd.all16(p0)
                };
                to[r * ROW + c] = p - origin;
            }
        }
    }
    let slope = [
        simd.from16(&cells.slope[0][v]),
        simd.from16(&cells.slope[1][v]),
    ];
    for r in 0..=h {
        for at in r * ROW..r * ROW + w + 1 {
            x[at] = x[at] - z[at] * slope[0];
            y[at] = y[at] - z[at] * slope[1];
        }
    }

    // For each cell, the rays that do not pass its first triangle, and its second.
    let mut hits = [[0u32; 2]; 8];
    let mut any = 0;
    for r in 0..h {
        for c in 0..w {
            let (a, b) = (r * ROW + c, r * ROW + c + 1);
            let (d, o) = (a + ROW, b + ROW);
            let ab = x[a] * y[b] - y[a] * x[b];
            let bo = x[b] * y[o] - y[b] * x[o];
            let oa = x[o] * y[a] - y[o] * x[a];
            let od = x[o] * y[d] - y[o] * x[d];
            let da = x[d] * y[a] - y[d] * x[a];
            let ao = -oa;
            let first = ab.min(bo).min(oa).lt(zero) & zero.lt(ab.max(bo).max(oa));
            let second = od.min(da).min(ao).lt(zero) & zero.lt(od.max(da).max(ao));
            let cell = &mut hits[r * 4 + c];
            *cell = [!first.bits() & lanes, !second.bits() & lanes];
            any |= cell[0] | cell[1];
        }
    }
    if any == 0 {
        return;
    }

    let mut arrays = [[[0.0; LANES]; VERTICES]; 3];
    for (out, v) in arrays.iter_mut().zip([&x, &y, &z]) {
        for (out, v) in out.iter_mut().zip(v) {
            *out = v.to_array();
        }
    }
    for r in 0..h {
        for c in 0..w {
            for (second, &rays) in hits[r * 4 + c].iter().enumerate() {
                let mut rays = rays;
                while rays != 0 {
                    let lane = rays.trailing_zeros() as usize & (LANES - 1);
                    rays &= rays - 1;
                    let at = r * ROW + c;
                    let corners = if second == 1 {
                        [at, at + ROW + 1, at + ROW]
                    } else {
                        [at, at + 1, at + ROW + 1]
                    };
                    let corners = [
                        corner(&arrays, corners[0], lane),
                        corner(&arrays, corners[1], lane),
                        corner(&arrays, corners[2], lane),
                    ];
                    if let Some(hit) = exact(corners, second == 1, f64::from(cells.dir_z[v][lane]))
                    {
                        let row = usize::from(rect.j) + r;
                        let cell = row * usize::from(grid.nu) + usize::from(rect.i) + c;
                        accept(lane, cell as u32, hit);
                    }
                }
            }
        }
    }
}

#[inline(always)]
fn corner(vertices: &[[Lanes; VERTICES]; 3], at: usize, lane: usize) -> [f64; 3] {
    [
        f64::from(vertices[0][at][lane]),
        f64::from(vertices[1][at][lane]),
        f64::from(vertices[2][at][lane]),
    ]
}
