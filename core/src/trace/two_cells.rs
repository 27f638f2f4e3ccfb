//! Groups of two micropolygons, or one, the parts of strands: 8 or 16 rays at once against their triangles.
//!
//! A group of 4 x 2 fills a vector with one ray. Of a part of a strand a quarter of that would be used, while a packet
//! brings many rays to each; so a vector has one number of 8 rays here, or of 16 where there are as many and one register holds them. The operations are those of [`super::cell`] in the
//! same order, so hits are the same.

use hdtrapeze_simd::{Float, Mask, Simd};

use super::cell::{self, CellHit, exact};
use super::cell_rays::{CellLanes, CellRays};
use super::packet::{PACKET, axes_with};
use crate::bvh::block::CellRect;
use crate::grid::PlanarMesh;
use crate::grid::planar::STRIP;

/// Corners of the first micropolygon, in their order around it.
pub(super) const FIRST: [usize; 4] = [0, 1, 2, 3];

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
    rays: (usize, u64),
    mesh: &PlanarMesh,
    g: u32,
    rect: CellRect,
    accept: impl FnMut(usize, u32, CellHit),
) {
    let single = rect.w * rect.h == 1;
    match (rect.w == 1, single) {
        (true, false) => strip::<S, MOVING, true, false>(simd, cells, rays, mesh, g, rect, accept),
        (true, true) => strip::<S, MOVING, true, true>(simd, cells, rays, mesh, g, rect, accept),
        (false, _) => strip::<S, MOVING, false, false>(simd, cells, rays, mesh, g, rect, accept),
    }
}

/// The same for cells above each other where `DOWN`, else beside each other; and for a single one where `ONE`.
#[inline(always)]
fn strip<S: Simd, const MOVING: bool, const DOWN: bool, const ONE: bool>(
    simd: S,
    cells: &CellRays,
    (one, rays): (usize, u64),
    mesh: &PlanarMesh,
    g: u32,
    rect: CellRect,
    mut accept: impl FnMut(usize, u32, CellHit),
) {
    let grid = &mesh.traced(g);
    let key = cells.key[one & (PACKET - 1)] as usize;
    let lattice = mesh.lattice(grid, key, rect.i, rect.j);
    let (mut places, mut next) = ([0.0; STRIP], [0.0; STRIP]);
    let columns = if DOWN { 2 } else { 3 };
    let p = lattice.strip(0, columns, &mut places);
    let mut step = [0.0; STRIP];
    if MOVING {
        let to = lattice.strip(1, columns, &mut next);
        for (step, (to, p)) in step.iter_mut().zip(to.iter().zip(p)) {
            *step = to - p;
        }
    }
    let part = Strip {
        cells,
        axes: axes_with(cells.z_axis[one & (PACKET - 1)]),
        p,
        step: &step,
        first: u32::from(rect.j) * u32::from(grid.nu) + u32::from(rect.i),
        next: if DOWN { u32::from(grid.nu) } else { 1 },
    };
    // As measured, on Zen 5.
    let few = if MOVING { 8 } else { 12 };
    let mut rest = rays;
    while rest != 0 {
        rest = if S::WIDE && rest.count_ones() > few {
            part.some::<S, Sixteen, 16, MOVING, DOWN, ONE>(simd, rest, &mut accept)
        } else {
            part.some::<S, Eight, 8, MOVING, DOWN, ONE>(simd, rest, &mut accept)
        };
    }
}

/// A width of vectors: `N` rays.
trait Width<S: Simd, const N: usize> {
    /// One number of each ray.
    type Vector: Float<N>;
    /// The same number for all.
    fn all(simd: S, x: f32) -> Self::Vector;
    /// Vector `i` has number `i` of each ray.
    fn columns(simd: S, rays: [&CellLanes; N]) -> [Self::Vector; 8];
}

/// 8 rays.
struct Eight;
/// 16 rays.
struct Sixteen;

impl<S: Simd> Width<S, 8> for Eight {
    type Vector = S::F8;
    #[inline(always)]
    fn all(simd: S, x: f32) -> S::F8 {
        simd.all8(x)
    }
    #[inline(always)]
    fn columns(simd: S, rays: [&CellLanes; 8]) -> [S::F8; 8] {
        let mut eight = [simd.all8(0.0); 8];
        for (own, ray) in eight.iter_mut().zip(rays) {
            *own = simd.from8(ray);
        }
        simd.transposed(eight)
    }
}

impl<S: Simd> Width<S, 16> for Sixteen {
    type Vector = S::F16;
    #[inline(always)]
    fn all(simd: S, x: f32) -> S::F16 {
        simd.all16(x)
    }
    #[inline(always)]
    fn columns(simd: S, rays: [&CellLanes; 16]) -> [S::F16; 8] {
        simd.columns(rays)
    }
}

/// A part of a strand, and rays which agree on axes.
struct Strip<'a> {
    cells: &'a CellRays,
    axes: [usize; 3],
    /// Vertices where rays' segment of keys begins.
    p: &'a [f32; STRIP],
    /// How far they go until it ends.
    step: &'a [f32; STRIP],
    /// The number of the first one, and what is added for the second.
    first: u32,
    next: u32,
}

impl Strip<'_> {
    /// Tests the first `N` of `rest`; which are left.
    #[inline(always)]
    fn some<
        S: Simd,
        W: Width<S, N>,
        const N: usize,
        const MOVING: bool,
        const DOWN: bool,
        const ONE: bool,
    >(
        &self,
        simd: S,
        mut rest: u64,
        accept: &mut impl FnMut(usize, u32, CellHit),
    ) -> u64 {
        let Self {
            cells,
            axes,
            p,
            step,
            ..
        } = *self;
        let columns = if DOWN { 2 } else { 3 };
        // Row and column of each corner; the second cell has two of the first.
        let corners: [[usize; 2]; 6] = match DOWN {
            true => [[0, 0], [0, 1], [1, 1], [1, 0], [2, 1], [2, 0]],
            false => [[0, 0], [0, 1], [1, 1], [1, 0], [1, 2], [0, 2]],
        };
        let second: [usize; 4] = if DOWN { [3, 2, 4, 5] } else { [1, 5, 4, 2] };
        // Any rays where there are fewer, whose lanes do not count.
        let count = (1u32 << rest.count_ones().min(N as u32)) - 1;
        let (mut numbers, mut own) = ([0; N], [&cells.rays[0]; N]);
        for (number, own) in numbers.iter_mut().zip(&mut own) {
            *number = rest.trailing_zeros() as usize & (PACKET - 1);
            rest &= rest.wrapping_sub(1);
            *own = &cells.rays[*number];
        }
        let [ox, oy, oz, fraction, slope_x, slope_y, ..] = W::columns(simd, own);
        let zero = W::all(simd, 0.0);
        let (mut x, mut y, mut z) = ([zero; 6], [zero; 6], [zero; 6]);
        let corner_count = if ONE { 4 } else { 6 };
        for k in 0..corner_count {
            let [row, column] = corners[k];
            let mut corner = [ox, oy, oz];
            for a in 0..3 {
                let x = (3 * row + axes[a].min(2)) * columns + column;
                let mut at = W::all(simd, p[x]);
                if MOVING {
                    at = at + W::all(simd, step[x]) * fraction;
                }
                corner[a] = at + corner[a];
            }
            z[k] = corner[2];
            x[k] = corner[0] - z[k] * slope_x;
            y[k] = corner[1] - z[k] * slope_y;
        }
        let [missed_a, missed_b] = missed(zero, &x, &y, FIRST);
        let [missed_c, missed_d] = if ONE {
            [missed_a, missed_b]
        } else {
            missed(zero, &x, &y, second)
        };
        let all = missed_a & missed_b & missed_c & missed_d;
        if !all.bits() & count == 0 {
            return rest;
        }
        let (mut sx, mut sy, mut sz) = ([[0.0; N]; 6], [[0.0; N]; 6], [[0.0; N]; 6]);
        for k in 0..corner_count {
            (sx[k], sy[k], sz[k]) = (x[k].to_array(), y[k].to_array(), z[k].to_array());
        }
        let triangles = [
            (missed_a.bits(), [0, 1, 2]),
            (missed_b.bits(), [0, 2, 3]),
            (missed_c.bits(), [second[0], second[1], second[2]]),
            (missed_d.bits(), [second[0], second[2], second[3]]),
        ];
        for (i, (missed, corners)) in triangles.into_iter().enumerate() {
            let in_second = i >= 2;
            if in_second && ONE {
                break;
            }
            let mut found = !missed & count;
            while found != 0 {
                let lane = found.trailing_zeros() as usize & (N - 1);
                found &= found - 1;
                let corners = cell::corners(
                    corners,
                    #[inline(always)]
                    |k| [sx[k][lane], sy[k][lane], sz[k][lane]],
                );
                let ray = numbers[lane];
                let [.., dir_z, _] = cells.rays[ray];
                if let Some(hit) = exact(corners, i % 2 == 1, f64::from(dir_z)) {
                    accept(ray, self.first + if in_second { self.next } else { 0 }, hit);
                }
            }
        }
        rest
    }
}

/// Rays that miss each triangle of a cell, whose corners are given in their order around it: those for which its
/// rounded edge functions differ in sign, as [`super::cell::maybe_hit`] has them. The edge between both has the same number for
/// both, but for its sign.
#[inline(always)]
pub(super) fn missed<F: Float<N>, const N: usize>(
    zero: F,
    x: &[F; 6],
    y: &[F; 6],
    [a, b, c, d]: [usize; 4],
) -> [F::Mask; 2] {
    let (ab, bc) = (x[a] * y[b] - y[a] * x[b], x[b] * y[c] - y[b] * x[c]);
    let (cd, da) = (x[c] * y[d] - y[c] * x[d], x[d] * y[a] - y[d] * x[a]);
    let ac = x[a] * y[c] - y[a] * x[c];
    [differ(zero, [ab, bc, -ac]), differ(zero, [ac, cd, da])]
}

/// True where some numbers are below 0 and others above.
#[inline(always)]
fn differ<F: Float<N>, const N: usize>(zero: F, [p, q, r]: [F; 3]) -> F::Mask {
    p.min(q).min(r).lt(zero) & zero.lt(p.max(q).max(r))
}
