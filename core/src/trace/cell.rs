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
//! the triangle; so `t` is exact for the rounded vertices, but for one rounding to f32. Rays through
//! a shared edge hit both neighbours; `(t, instance, grid, cell)` decides.

use glam::Vec3;

use super::object_ray::ObjectRay;
use super::sides::Side;
use crate::bvh::block::CellRect;
use crate::grid::{DicedMesh, lerp_position, locate_key};

/// Lanes of a group: cell `(c, r)` of it has lane `4 r + c`.
const LANES: usize = 8;
/// Lattice vertices in a row of a full group.
const ROW: usize = 5;
/// Lattice rows of a full group.
const ROWS: usize = 3;

/// A ray prepared for the micropolygons of one mesh.
#[derive(Clone, Copy, Debug)]
pub struct CellRay {
    origin: Vec3,
    /// Axes in the order x, y, z of the sheared space; z is the one the ray is longest on.
    axes: [usize; 3],
    slope: [f32; 2],
    dir_z: f64,
    key: usize,
    fraction: f32,
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

impl CellRay {
    /// Prepares `ray` for a mesh with these key times.
    #[inline]
    pub fn new(ray: &ObjectRay, key_times: &[f32]) -> Self {
        let d = ray.dir.abs();
        let axes = if d.x >= d.y && d.x >= d.z {
            [1, 2, 0]
        } else if d.y >= d.z {
            [2, 0, 1]
        } else {
            [0, 1, 2]
        };
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

    /// Tests the cells `rect` of grid `g`, one group; calls `accept(cell, hit)` for every triangle
    /// hit, in no useful order. `MOVING` says that the mesh has more than one key; with `CULL`, triangles
    /// that show the ray their side `hidden` are not there.
    #[inline(always)]
    pub fn test_group<const MOVING: bool, const CULL: bool>(
        &self,
        mesh: &DicedMesh,
        g: u32,
        rect: CellRect,
        hidden: Option<Side>,
        mut accept: impl FnMut(u32, CellHit),
    ) {
        let grid = &mesh.grids[g as usize];
        let stride = usize::from(grid.nu) + 1;
        let (w, h) = (usize::from(rect.w), usize::from(rect.h));
        let first = usize::from(rect.j) * stride + usize::from(rect.i);
        let at_key = mesh.grid_positions(g as usize, self.key);
        let at_next = if MOVING {
            mesh.grid_positions(g as usize, self.key + 1)
        } else {
            at_key
        };
        let [kx, ky, kz] = self.axes;

        let mut x = [0.0f32; ROW * ROWS];
        let mut y = [0.0f32; ROW * ROWS];
        let mut z = [0.0f32; ROW * ROWS];
        for r in 0..=h.min(ROWS - 1) {
            let row = first + r * stride;
            let p0 = &at_key[row..row + w + 1];
            let p1 = &at_next[row..row + w + 1];
            for c in 0..=w.min(ROW - 1) {
                let p = if MOVING {
                    lerp_position(p0[c], p1[c], self.fraction)
                } else {
                    p0[c]
                };
                let p = (p - self.origin).to_array();
                let at = r * ROW + c;
                z[at] = p[kz];
                x[at] = p[kx] - self.slope[0] * p[kz];
                y[at] = p[ky] - self.slope[1] * p[kz];
            }
        }

        // Corners of each lane's cell: a (i,j), b (i+1,j), c (i+1,j+1), d (i,j+1).
        let corner = |v: &[f32; ROW * ROWS], offset: usize| -> [f32; LANES] {
            [0, 1, 2, 3, 4, 5, 6, 7].map(|l: usize| v[(l >> 2) * ROW + (l & 3) + offset])
        };
        let (ax, bx, cx, dx) = (
            corner(&x, 0),
            corner(&x, 1),
            corner(&x, ROW + 1),
            corner(&x, ROW),
        );
        let (ay, by, cy, dy) = (
            corner(&y, 0),
            corner(&y, 1),
            corner(&y, ROW + 1),
            corner(&y, ROW),
        );
        let mut candidates = 0u32;
        for l in 0..LANES {
            let ab = ax[l] * by[l] - ay[l] * bx[l];
            let bc = bx[l] * cy[l] - by[l] * cx[l];
            let ca = cx[l] * ay[l] - cy[l] * ax[l];
            let cd = cx[l] * dy[l] - cy[l] * dx[l];
            let da = dx[l] * ay[l] - dy[l] * ax[l];
            // Two triangles: a b c, and a c d whose first edge is `-ca`.
            let first = mixed(ab, bc, ca);
            let second = mixed(cd, da, -ca);
            candidates |= u32::from(!first) << l;
            candidates |= u32::from(!second) << (l + LANES);
        }
        candidates &= lane_mask(w, h);

        while candidates != 0 {
            let bit = candidates.trailing_zeros();
            candidates &= candidates - 1;
            let second = bit as usize >= LANES;
            let l = bit as usize % LANES;
            let (r, c) = (l >> 2, l & 3);
            let at = r * ROW + c;
            let corners = if second {
                [at, at + ROW + 1, at + ROW]
            } else {
                [at, at + 1, at + ROW + 1]
            };
            let p = corners.map(|i| [f64::from(x[i]), f64::from(y[i]), f64::from(z[i])]);
            let Some((t, [w1, w2])) = self.exact(p) else {
                continue;
            };
            if CULL && hidden.is_some_and(|side| side == self.side(p)) {
                continue;
            }
            // (u, v) from the weights of the second and third corner.
            let (u, v) = if second { (w1, w1 + w2) } else { (w1 + w2, w2) };
            let hit = CellHit {
                t,
                u: (u as f32).min(1.0),
                v: (v as f32).min(1.0),
            };
            let cell = (usize::from(rect.j) + r) * usize::from(grid.nu) + usize::from(rect.i) + c;
            accept(cell as u32, hit);
        }
    }

    /// The side that a triangle of sheared vertices shows the ray, exactly, where [`Self::exact`] finds
    /// a hit. Axes were turned in a cycle, and shearing turns nothing over.
    fn side(&self, [a, b, c]: [[f64; 3]; 3]) -> Side {
        let edge = |p: [f64; 3], q: [f64; 3]| p[0] * q[1] - p[1] * q[0];
        let det = edge(b, c) + edge(c, a) + edge(a, b);
        match (det < 0.0) == (self.dir_z < 0.0) {
            true => Side::Back,
            false => Side::Front,
        }
    }

    /// The exact test of one triangle of sheared vertices: `t`, and the weights of its second and
    /// third corner.
    fn exact(&self, [a, b, c]: [[f64; 3]; 3]) -> Option<(f32, [f64; 2])> {
        let edge = |p: [f64; 3], q: [f64; 3]| p[0] * q[1] - p[1] * q[0];
        let (wa, wb, wc) = (edge(b, c), edge(c, a), edge(a, b));
        let det = wa + wb + wc;
        let sound = (wa >= 0.0 && wb >= 0.0 && wc >= 0.0 && det > 0.0)
            || (wa <= 0.0 && wb <= 0.0 && wc <= 0.0 && det < 0.0);
        if !sound {
            return None;
        }
        let (wb, wc) = (wb / det, wc / det);
        let z = (wa / det) * a[2] + wb * b[2] + wc * c[2];
        // Adding 0 makes -0 into 0: hits are ordered by plain comparison.
        let t = (z / self.dir_z) as f32 + 0.0;
        t.is_finite().then_some((t, [wb, wc]))
    }
}

/// True when two of the numbers have different signs; NaN counts as none.
#[inline(always)]
fn mixed(a: f32, b: f32, c: f32) -> bool {
    ((a < 0.0) | (b < 0.0) | (c < 0.0)) & ((a > 0.0) | (b > 0.0) | (c > 0.0))
}

/// Bits of the lanes of a `w` by `h` group, for both triangles.
#[inline(always)]
fn lane_mask(w: usize, h: usize) -> u32 {
    let row = (1u32 << w) - 1;
    let lanes = if h > 1 { row | row << 4 } else { row };
    lanes | lanes << LANES
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ray(origin: Vec3, dir: Vec3) -> CellRay {
        let r = ObjectRay::new(origin, dir, 0.0, 1.0).expect("a sound ray");
        CellRay::new(&r, &[0.0])
    }

    #[test]
    fn thin_triangle_edge_is_exact() {
        // The ray passes a sliver at distance 1: all its corners lie in one direction from the
        // ray to within f32's rounding. In f32 alone the edge functions are (0, 0, +).
        let cell = ray(Vec3::ZERO, Vec3::Z);
        let e = 1.0 / f64::from(1 << 26);
        let tri = [[1.0, 1.0, 1.0], [2.0, 2.0 + e, 1.0], [1.5, 1.5 + e, 1.0]];
        assert_eq!(cell.exact(tri), None);
        let around = [
            [-1.0, -1.0, 1.0],
            [2.0, 2.0 + e, 1.0],
            [1.5, 1.5 + 3.0 * e, 1.0],
        ];
        assert!(cell.exact(around).is_none_or(|(t, _)| t == 1.0));
        let point = [[0.0, 0.0, 1.0]; 3];
        assert_eq!(cell.exact(point), None);
        assert_eq!(cell.exact([[f64::NAN; 3]; 3]), None);
    }

    #[test]
    fn tiny_triangles_survive_underflow() {
        // Products of coordinates near 1e-30 underflow to 0 in f32.
        let cell = ray(Vec3::ZERO, Vec3::Z);
        let s = f64::from(1e-30f32);
        let hit = cell.exact([[-s, -s, 2.0], [s, -s, 2.0], [0.0, s, 2.0]]);
        assert_eq!(hit.map(|h| h.0), Some(2.0));
    }
}
