//! Pairs of a ray and a group of micropolygons, tested one after the other without a branch between: the
//! test of [`super::cell`], split into its two halves, so that the first halves of many pairs overlap.
//!
//! The first half finds the triangles that may be hit; what it found is kept, and settled by the exact test
//! when all pairs at hand have been through. The same operations in the same order as for a ray
//! alone, so the same hits.

use hdtrapeze_simd::{Float, Simd};

use super::cell::{CellHit, candidates, corners, exact, lane_mask};
use super::cell_rays::CellRays;
use super::packet::{LANES, Lanes, PACKET, axes_with};
use crate::bvh::Bounds8;
use crate::bvh::block::CellRect;
use crate::grid::PlanarMesh;

/// Says that the vertices of a group, the cells `rect` of grid `g`, will be asked for soon, at `key`.
#[inline(always)]
pub fn expect<S: Simd, B: Bounds8>(simd: S, mesh: &PlanarMesh, g: u32, rect: CellRect, key: u32) {
    let grid = &mesh.traced(g);
    let lattice = mesh.lattice(grid, key as usize, rect.i, rect.j);
    if B::KEYS {
        lattice.expect::<S, 2>(simd);
    } else {
        lattice.expect::<S, 1>(simd);
    }
}

/// Pairs that are kept.
const MOST: usize = 2 * PACKET;

/// Where the group of a pair is.
#[derive(Clone, Copy, Debug, Default)]
struct Place {
    grid: u32,
    /// Micropolygons of the grid along u.
    nu: u32,
    /// The group's first micropolygon.
    first: u32,
}

/// A pair whose triangles `found` may be hit.
#[derive(Clone, Copy, Debug, Default)]
struct Pair {
    ray: u32,
    found: u32,
    place: Place,
}

/// Pairs that wait for their exact tests.
#[derive(Clone, Debug)]
pub struct Pairs {
    count: usize,
    pairs: [Pair; MOST],
    /// Sheared vertices of each pair.
    vertices: [[Lanes; 3]; MOST],
}

impl Default for Pairs {
    fn default() -> Self {
        Self {
            count: 0,
            pairs: [Pair::default(); MOST],
            vertices: [[[0.0; LANES]; 3]; MOST],
        }
    }
}

impl Pairs {
    /// True when there may be no room for the rays of another group.
    #[inline(always)]
    pub fn is_full(&self) -> bool {
        self.count > MOST - PACKET
    }

    /// The first half for `rays`, of which `one` is the first and which agree on axes and key, and the cells
    /// `rect` of grid `g`, one group. [`Pairs::is_full`] is false.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)] // one call, inlined
    pub fn test<S: Simd, const MOVING: bool>(
        &mut self,
        simd: S,
        cells: &CellRays,
        (one, rays): (usize, u64),
        mesh: &PlanarMesh,
        g: u32,
        rect: CellRect,
    ) {
        let grid = &mesh.traced(g);
        let key = cells.key[one] as usize;
        let axes = axes_with(cells.z_axis[one]);
        let lattice = mesh.lattice(grid, key, rect.i, rect.j);
        let mask = lane_mask(usize::from(rect.w), usize::from(rect.h));
        let place = Place {
            grid: g,
            nu: u32::from(grid.nu),
            first: u32::from(rect.j) * u32::from(grid.nu) + u32::from(rect.i),
        };
        let (p, step);
        if MOVING {
            let [from, to] = lattice.load::<S, 2>(simd, axes);
            (p, step) = (from, [to[0] - from[0], to[1] - from[1], to[2] - from[2]]);
        } else {
            [p] = lattice.load::<S, 1>(simd, axes);
            step = p;
        }
        let mut count = self.count;
        let mut rest = rays;
        while rest != 0 {
            let ray = rest.trailing_zeros();
            rest &= rest - 1;
            let [ox, oy, oz, fraction, slope_x, slope_y, ..] =
                &cells.rays[ray as usize & (PACKET - 1)];
            let mut corner = p;
            for (a, origin) in [ox, oy, oz].into_iter().enumerate() {
                if MOVING {
                    corner[a] = p[a] + step[a] * simd.all16(*fraction);
                }
                // It is mirrored: memory can be added, but not subtracted from.
                corner[a] = corner[a] + simd.all16(*origin);
            }
            let z = corner[2];
            let x = corner[0] - z * simd.all16(*slope_x);
            let y = corner[1] - z * simd.all16(*slope_y);
            let found = candidates(simd, x, y) & mask;
            let at = count & (MOST - 1);
            self.vertices[at] = [x.to_array(), y.to_array(), z.to_array()];
            self.pairs[at] = Pair { ray, found, place };
            count += usize::from(found != 0);
        }
        self.count = count;
    }

    /// The second half for all pairs that wait; calls `accept(ray, grid, cell, hit)` for every triangle
    /// hit, in no useful order.
    #[inline(always)]
    pub fn settle<S: Simd>(
        &mut self,
        simd: S,
        cells: &CellRays,
        mut accept: impl FnMut(usize, u32, u32, CellHit),
    ) {
        let count = self.count.min(MOST);
        for (pair, [x, y, z]) in self.pairs[..count].iter().zip(&self.vertices) {
            let ray = pair.ray as usize;
            let [.., dir_z, _] = cells.rays[ray & (PACKET - 1)];
            let dir_z = f64::from(dir_z);
            let mut found = pair.found;
            while found != 0 {
                let bit = found.trailing_zeros() as usize;
                found &= found - 1;
                let second = bit >= 8;
                let (r, c) = (bit >> 2 & 1, bit & 3);
                let corners = corners(
                    simd.corners(bit),
                    #[inline(always)]
                    |i| [x[i & 15], y[i & 15], z[i & 15]],
                );
                if let Some(hit) = exact(corners, second, dir_z) {
                    let cell = pair.place.first + r as u32 * pair.place.nu + c as u32;
                    accept(ray, pair.place.grid, cell, hit);
                }
            }
        }
        self.count = 0;
    }
}
