//! Watertight tests of a ray against groups of micropolygons (Woop, Benthin, Wald, "Watertight
//! Ray/Triangle Intersection", JCGT 2(1), 2013).
//!
//! Vertices are interpolated to the ray's time, translated and sheared, so that the ray becomes the
//! z axis; a triangle is hit where its three edge functions `fl(ax by) - fl(ay bx)` do not differ in
//! sign. A vertex has the same bits in every triangle that shares it, so what follows is about
//! rounded vertices, as exact numbers.
//!
//! **No leaks.** Rounding is monotonic: where the exact product `ax by` is not less than `ay bx`, the
//! rounded one is not less either, and the difference of two f32 is zero only where they are equal
//! (gradual underflow). So the sign of an edge function in f32 is right or zero, and never wrong: the
//! first test, over 8 cells at once and with zero counted on both sides, accepts every triangle that
//! contains the ray, and on edges a few that do not. Each accepted one is then tested in f64, where
//! products of f32 are exact and differences are rounded once: signs are exact. A cell is hit exactly when
//! the ray meets one of its two closed triangles of non-zero projected area.
//!
//! **Distances.** The weights are the f64 edge functions, each with a relative error of 2^-53 however thin
//! the triangle; their sums and products with f32 are far from f64's limits, so `t` is exact for the rounded
//! vertices, but for one rounding to f32. Rays through a shared edge hit both neighbours; `(t, instance, grid,
//! cell)` decides.

use glam::Vec3;
use hdtrapeze_simd::{Float, Mask, Simd};

use super::Hit;
use super::object_ray::ObjectRay;
use super::sides::Side;
use crate::bvh::block::CellRect;
use crate::grid::planar::Lattice;
use crate::grid::{PlanarMesh, locate_key};

/// Cells of a full group: cell `(c, r)` of it has lane `4 r + c`, for the first of its triangles, and
/// the second is this much later.
const LANES: usize = 8;

/// A ray prepared for the micropolygons of one mesh.
#[derive(Clone, Copy, Debug)]
pub struct CellRay {
    pub(super) origin: Vec3,
    /// Axes in the order x, y, z of the sheared space; z is the one the ray is longest on.
    pub(super) axes: [usize; 3],
    pub(super) slope: [f32; 2],
    pub(super) dir_z: f64,
    pub(super) key: usize,
    pub(super) fraction: f32,
}

/// A hit inside a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellHit {
    /// Distance, in units of the ray's direction.
    pub t: f32,
    /// Position inside the cell, as [`super::Hit::u`].
    pub u: f32,
    /// Position inside the cell, as [`super::Hit::v`].
    pub v: f32,
}

impl CellHit {
    /// The hit, with what was hit.
    #[inline(always)]
    pub fn of(self, instance: u32, grid: u32, cell: u32) -> Hit {
        Hit {
            t: self.t,
            u: self.u,
            v: self.v,
            instance,
            grid,
            cell,
        }
    }
}

impl CellRay {
    /// Axes of the sheared space of a ray.
    #[inline(always)]
    pub(super) fn axes_of(dir: Vec3) -> [usize; 3] {
        let d = dir.abs();
        if d.x >= d.y && d.x >= d.z {
            [1, 2, 0]
        } else if d.y >= d.z {
            [2, 0, 1]
        } else {
            [0, 1, 2]
        }
    }

    /// Prepares `ray` for a mesh with these key times.
    #[inline]
    pub fn new(ray: &ObjectRay, key_times: &[f32]) -> Self {
        let axes = Self::axes_of(ray.dir);
        let dir_z = ray.dir[axes[2]];
        let (key, fraction) = locate_key(key_times, ray.time);
        Self {
            origin: ray.origin,
            axes,
            slope: [ray.dir[axes[0]] / dir_z, ray.dir[axes[1]] / dir_z],
            dir_z: f64::from(dir_z),
            key,
            fraction,
        }
    }

    /// A group's vertices relative to the ray's origin, at its time, in the order of its axes:
    /// [`crate::grid::lerp_position`], for all of them.
    #[inline(always)]
    fn relative<S: Simd, const MOVING: bool>(&self, simd: S, lattice: Lattice<'_>) -> [S::F16; 3] {
        let mut p;
        if MOVING {
            let next;
            [p, next] = lattice.load::<S, 2>(simd, self.axes);
            for a in 0..3 {
                p[a] = p[a] + (next[a] - p[a]) * simd.all16(self.fraction);
            }
        } else {
            [p] = lattice.load::<S, 1>(simd, self.axes);
        }
        for (p, axis) in p.iter_mut().zip(self.axes) {
            *p = *p - simd.all16(self.origin[axis]);
        }
        p
    }

    /// Tests the cells `rect` of grid `g`, one group; calls `accept(cell, hit)` for every triangle
    /// hit, in no useful order. `MOVING` says that the mesh has more than one key; with `CULL`, triangles
    /// that show the ray their side `hidden` are not there.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)] // one call, inlined
    pub fn test_group<S: Simd, const MOVING: bool, const CULL: bool>(
        &self,
        simd: S,
        mesh: &PlanarMesh,
        g: u32,
        rect: CellRect,
        hidden: Option<Side>,
        mut accept: impl FnMut(u32, CellHit),
    ) {
        let grid = &mesh.traced(g);
        let lattice = mesh.lattice(grid, self.key, rect.i, rect.j);
        let [x, y, z] = self.relative::<S, MOVING>(simd, lattice);
        let x = x - z * simd.all16(self.slope[0]);
        let y = y - z * simd.all16(self.slope[1]);

        let (w, h) = (usize::from(rect.w), usize::from(rect.h));
        let mut candidates = candidates(simd, x, y) & lane_mask(w, h);
        if candidates == 0 {
            return;
        }

        let (x, y, z) = (x.to_array(), y.to_array(), z.to_array());
        while candidates != 0 {
            let bit = candidates.trailing_zeros();
            candidates &= candidates - 1;
            let second = bit as usize >= LANES;
            let l = bit as usize % LANES;
            let (r, c) = (l >> 2, l & 3);
            let corners = corners(
                simd.corners(bit as usize),
                #[inline(always)]
                |i| [x[i & 15], y[i & 15], z[i & 15]],
            );
            if CULL && hidden.is_some_and(|side| side == seen(corners, self.dir_z)) {
                continue;
            }
            if let Some(hit) = exact(corners, second, self.dir_z) {
                let cell =
                    (usize::from(rect.j) + r) * usize::from(grid.nu) + usize::from(rect.i) + c;
                accept(cell as u32, hit);
            }
        }
    }
}

/// Triangles of a lattice of sheared vertices that the ray may hit, by [`Simd::triangles`]'s lanes: those whose
/// rounded edge functions do not differ in sign.
#[inline(always)]
pub(super) fn candidates<S: Simd>(simd: S, x: S::F16, y: S::F16) -> u32 {
    maybe_hit(simd, simd.triangles(x), simd.triangles(y))
}

/// Those of 16 triangles, whose corners are given, that [`candidates`] tells.
#[inline(always)]
pub(super) fn maybe_hit<S: Simd>(
    simd: S,
    [ax, bx, cx]: [S::F16; 3],
    [ay, by, cy]: [S::F16; 3],
) -> u32 {
    let ab = ax * by - ay * bx;
    let bc = bx * cy - by * cx;
    let ca = cx * ay - cy * ax;
    let zero = simd.all16(0.0);
    let mixed = ab.min(bc).min(ca).lt(zero) & zero.lt(ab.max(bc).max(ca));
    !mixed.bits()
}

/// The corners `numbers` of a triangle, of which `vertex` gives each.
#[inline(always)]
pub(super) fn corners([a, b, c]: [usize; 3], vertex: impl Fn(usize) -> [f32; 3]) -> [[f64; 3]; 3] {
    let ([ax, ay, az], [bx, by, bz], [cx, cy, cz]) = (vertex(a), vertex(b), vertex(c));
    let exact = f64::from;
    [
        [exact(ax), exact(ay), exact(az)],
        [exact(bx), exact(by), exact(bz)],
        [exact(cx), exact(cy), exact(cz)],
    ]
}

/// The exact test of one triangle of sheared vertices, the first of its cell or the second.
#[inline(always)]
pub(super) fn exact([a, b, c]: [[f64; 3]; 3], second: bool, dir_z: f64) -> Option<CellHit> {
    let edge = |p: [f64; 3], q: [f64; 3]| p[0] * q[1] - p[1] * q[0];
    let (wa, wb, wc) = (edge(b, c), edge(c, a), edge(a, b));
    let det = wa + wb + wc;
    let sound = (wa >= 0.0 && wb >= 0.0 && wc >= 0.0 && det > 0.0)
        || (wa <= 0.0 && wb <= 0.0 && wc <= 0.0 && det < 0.0);
    if !sound {
        return None;
    }
    // Both quotients are of sums, so that neither waits for the other.
    let z = wa * a[2] + wb * b[2] + wc * c[2];
    // Adding 0 makes -0 into 0: hits are ordered by plain comparison.
    let t = (z / (det * dir_z)) as f32 + 0.0;
    let inverse = 1.0 / det;
    let (u, v) = if second { (wb, wb + wc) } else { (wb + wc, wc) };
    let (u, v) = ((u * inverse) as f32, (v * inverse) as f32);
    let (u, v) = (u.min(1.0), v.min(1.0));
    t.is_finite().then_some(CellHit { t, u, v })
}

/// The side that a triangle of sheared vertices shows the ray, exactly, where [`exact`] finds
/// a hit. Axes were turned in a cycle, and shearing turns nothing over.
fn seen([a, b, c]: [[f64; 3]; 3], dir_z: f64) -> Side {
    let edge = |p: [f64; 3], q: [f64; 3]| p[0] * q[1] - p[1] * q[0];
    let det = edge(b, c) + edge(c, a) + edge(a, b);
    match (det < 0.0) == (dir_z < 0.0) {
        true => Side::Back,
        false => Side::Front,
    }
}

/// Bits of the lanes of a `w` by `h` group, for both triangles.
#[inline(always)]
pub(super) fn lane_mask(w: usize, h: usize) -> u32 {
    let row = (1u32 << w) - 1;
    let lanes = if h > 1 { row | row << 4 } else { row };
    lanes | lanes << LANES
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thin_triangle_edge_is_exact() {
        // The ray passes a sliver at distance 1: all its corners lie in one direction from the
        // ray to within f32's rounding. In f32 alone the edge functions are (0, 0, +).
        let e = 1.0 / f64::from(1 << 26);
        let tri = [[1.0, 1.0, 1.0], [2.0, 2.0 + e, 1.0], [1.5, 1.5 + e, 1.0]];
        assert_eq!(exact(tri, false, 1.0), None);
        let around = [
            [-1.0, -1.0, 1.0],
            [2.0, 2.0 + e, 1.0],
            [1.5, 1.5 + 3.0 * e, 1.0],
        ];
        assert!(exact(around, false, 1.0).is_none_or(|h| h.t == 1.0));
        let point = [[0.0, 0.0, 1.0]; 3];
        assert_eq!(exact(point, false, 1.0), None);
        assert_eq!(exact([[f64::NAN; 3]; 3], false, 1.0), None);
    }

    #[test]
    fn tiny_triangles_survive_underflow() {
        // Products of coordinates near 1e-30 underflow to 0 in f32.
        let s = f64::from(1e-30f32);
        let hit = exact([[-s, -s, 2.0], [s, -s, 2.0], [0.0, s, 2.0]], false, 1.0);
        assert_eq!(hit.map(|h| h.t), Some(2.0));
    }
}
