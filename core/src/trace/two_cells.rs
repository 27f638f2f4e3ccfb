//! Groups of two micropolygons, the parts of strands: four rays at once against their four triangles.
//!
//! A group of 4 x 2 fills a vector with one ray. Of a part of a strand a quarter of that would be used, while a packet
//! brings many rays to each; so a vector has four rays here. The operations are those of [`super::cell`] in the
//! same order, so hits are the same.

use hdtrapeze_simd::{Float, Simd};

use super::cell::{CellHit, exact, maybe_hit};
use super::cell_rays::CellRays;
use super::packet::{LANES, PACKET, axes_with};
use crate::bvh::block::CellRect;
use crate::grid::PlanarMesh;

/// Rays of a vector.
const RAYS: usize = 4;

/// True for a group that [`test`] takes.
#[inline(always)]
pub fn is_small(rect: CellRect) -> bool {
    rect.w * rect.h <= 2
}

/// Tests `rays`, of which `one` is the first and which agree on axes and key, against the cells `rect` of grid `g`, two
/// or one; calls `accept(ray, cell, hit)` for every triangle hit, in no useful order.
#[inline(always)]
pub fn test<S: Simd, const MOVING: bool>(
    simd: S,
    cells: &CellRays,
    (one, rays): (usize, u64),
    mesh: &PlanarMesh,
    g: u32,
    rect: CellRect,
    mut accept: impl FnMut(usize, u32, CellHit),
) {
    let grid = &mesh.grids[g as usize];
    let key = cells.key[one & (PACKET - 1)] as usize;
    let axes = axes_with(cells.z_axis[one & (PACKET - 1)]);
    let stride = usize::from(grid.nu) + 1;
    let n = grid.vertex_count();
    let start = mesh.plane_start(grid, key) + usize::from(rect.j) * stride + usize::from(rect.i);
    let down = rect.w == 1;
    let zero = simd.all16(0.0);
    // `[corner][axis]`
    let (mut p, mut step) = ([[zero; 3]; 3], [[zero; 3]; 3]);
    let (from, to);
    if MOVING {
        [from, to] = simd.lattices::<2>(mesh.planes(), start, stride, n, axes);
    } else {
        [from] = simd.lattices::<1>(mesh.planes(), start, stride, n, axes);
        to = from;
    }
    for a in 0..3 {
        let corners = simd.two_cells(from[a], down);
        let steps = match MOVING {
            true => simd.two_cells(to[a] - from[a], down),
            false => corners,
        };
        for corner in 0..3 {
            (p[corner][a], step[corner][a]) = (corners[corner], steps[corner]);
        }
    }
    // Triangles of each ray that there are.
    let of_each = if rect.w * rect.h == 2 { 0xffff } else { 0x3333 };
    let mut rest = rays;
    while rest != 0 {
        // Any rays where there are fewer, whose lanes do not count.
        let lanes = (1u32 << (RAYS as u32 * rest.count_ones().min(RAYS as u32))) - 1;
        let mut four = [0; RAYS];
        for ray in &mut four {
            *ray = rest.trailing_zeros() as usize & (PACKET - 1);
            rest &= rest.wrapping_sub(1);
        }
        let [[a, a2], [b, b2], [c, c2], [d, d2]] = [
            &cells.rays[four[0]],
            &cells.rays[four[1]],
            &cells.rays[four[2]],
            &cells.rays[four[3]],
        ];
        let [ox, oy, oz, fraction] = simd.copies_in_fours(simd.fours([a, b, c, d]));
        let [slope_x, slope_y, ..] = simd.copies_in_fours(simd.fours([a2, b2, c2, d2]));
        let (mut x, mut y, mut z) = ([zero; 3], [zero; 3], [zero; 3]);
        for k in 0..3 {
            let mut corner = p[k];
            for (a, origin) in [ox, oy, oz].into_iter().enumerate() {
                if MOVING {
                    corner[a] = corner[a] + step[k][a] * fraction;
                }
                corner[a] = corner[a] + origin;
            }
            z[k] = corner[2];
            x[k] = corner[0] - z[k] * slope_x;
            y[k] = corner[1] - z[k] * slope_y;
        }
        let mut found = maybe_hit(simd, x, y) & of_each & lanes;
        if found == 0 {
            continue;
        }
        let mut sheared = [[[0.0; LANES]; 3]; 3];
        for k in 0..3 {
            sheared[k] = [x[k].to_array(), y[k].to_array(), z[k].to_array()];
        }
        while found != 0 {
            let lane = found.trailing_zeros() as usize & 15;
            found &= found - 1;
            let ray = four[lane / RAYS];
            let at = |k: usize| {
                let [x, y, z] = &sheared[k];
                [f64::from(x[lane]), f64::from(y[lane]), f64::from(z[lane])]
            };
            let corners = [at(0), at(1), at(2)];
            let [_, [.., dir_z, _]] = cells.rays[ray];
            if let Some(hit) = exact(corners, lane % 2 == 1, f64::from(dir_z)) {
                let first = u32::from(rect.j) * u32::from(grid.nu) + u32::from(rect.i);
                let next = if down { u32::from(grid.nu) } else { 1 };
                let second = lane % RAYS >= 2;
                accept(ray, first + if second { next } else { 0 }, hit);
            }
        }
    }
}
