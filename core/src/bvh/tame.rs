//! Ranges of coordinates at every key, where all are finite and not absurdly large.

use glam::Vec3;
use hdtrapeze_simd::{Float, Kernel, Level, Mask, Simd};
use rayon::prelude::*;

use crate::grid::DicedMesh;

/// Coordinates beyond are left to trees of the ordinary kind, which drop what cannot be traced grid by grid.
pub const TAME: f32 = (1u64 << 52) as f32;

/// Ranges of coordinates at every key. None where a coordinate is not finite, or not tame.
pub fn key_ranges(mesh: &DicedMesh) -> Option<Vec<(Vec3, Vec3)>> {
    let empty = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let level = Level::best();
    let mut out = Vec::with_capacity(mesh.key_count());
    for k in 0..mesh.key_count() {
        let of = |g: usize| level.run(TameRange(mesh.grid_positions(g, k)));
        let grids = (0..mesh.grids.len()).into_par_iter().with_min_len(64);
        let range = grids
            .map(of)
            .try_reduce(|| empty, |a, b| Some((a.0.min(b.0), a.1.max(b.1))))?;
        out.push(range);
    }
    Some(out)
}

/// The range of coordinates of some points; none where one is not finite, or not tame.
struct TameRange<'a>(&'a [Vec3]);

impl Kernel for TameRange<'_> {
    type Output = Option<(Vec3, Vec3)>;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        let limit = simd.all16(TAME);
        let mut tame = simd.all16(0.0).lt(limit);
        let mut lo = [simd.all16(f32::INFINITY); 3];
        let mut hi = [simd.all16(f32::NEG_INFINITY); 3];
        // 16 points are 3 vectors, whose lanes are of one axis each.
        let (whole, rest) = self.0.as_chunks::<16>();
        for points in whole {
            let (vectors, _) = bytemuck::cast_slice::<Vec3, f32>(points).as_chunks::<16>();
            for (i, x) in vectors.iter().enumerate() {
                let x = simd.from16(x);
                // Comparisons with NaN are false.
                tame = tame & x.abs().lt(limit);
                lo[i] = lo[i].min(x);
                hi[i] = hi[i].max(x);
            }
        }
        let is_tame = |p: &Vec3| p.abs().cmplt(Vec3::splat(TAME)).all();
        if tame.bits() != 0xffff || !rest.iter().all(is_tame) {
            return None;
        }
        let lanes =
            |vectors: [S::F16; 3]| bytemuck::cast::<_, [Vec3; 16]>(vectors.map(S::F16::to_array));
        let lo = lanes(lo)
            .iter()
            .chain(rest)
            .fold(Vec3::INFINITY, |lo, p| lo.min(*p));
        let hi = lanes(hi)
            .iter()
            .chain(rest)
            .fold(Vec3::NEG_INFINITY, |hi, p| hi.max(*p));
        Some((lo, hi))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn range(points: &[Vec3]) -> Option<(Vec3, Vec3)> {
        let levels = Level::available().into_iter();
        let all: Vec<_> = levels.map(|level| level.run(TameRange(points))).collect();
        assert!(all.windows(2).all(|w| w[0] == w[1]), "{all:?}");
        all[0]
    }

    #[test]
    fn ranges_are_of_all_points_and_axes() {
        for count in [1, 15, 16, 17, 34, 289] {
            let points: Vec<Vec3> = (0..count)
                .map(|i| Vec3::new(1.0, 2.0, 3.0) * (1 + i % 2) as f32)
                .collect();
            for at in 0..count {
                for axis in 0..3 {
                    for far in [-TAME.next_down(), 0.25, TAME.next_down()] {
                        let mut points = points.clone();
                        points[at][axis] = far;
                        let empty = (Vec3::INFINITY, Vec3::NEG_INFINITY);
                        let of = |(lo, hi): (Vec3, Vec3), p: &Vec3| (lo.min(*p), hi.max(*p));
                        assert_eq!(range(&points), Some(points.iter().fold(empty, of)));
                    }
                    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, TAME, -TAME] {
                        let mut points = points.clone();
                        points[at][axis] = bad;
                        assert_eq!(range(&points), None, "{count} {at} {axis} {bad}");
                    }
                }
            }
        }
    }
}
