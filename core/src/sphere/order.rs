//! The order of spheres: along a Morton curve through their bounds.

use glam::Vec3;
use rayon::prelude::*;

/// Bits a coordinate.
const BITS: u32 = 21;

/// The numbers of `points` in order. Equal places keep the order they have.
pub fn morton(points: &[Vec3], chosen: impl Iterator<Item = u32>) -> Vec<u32> {
    let mut chosen: Vec<u32> = chosen.collect();
    let (mut lo, mut hi) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for &i in &chosen {
        lo = lo.min(points[i as usize]);
        hi = hi.max(points[i as usize]);
    }
    let most = ((1u32 << BITS) - 1) as f64;
    let scale = (hi - lo).max_element();
    let scale = if scale > 0.0 {
        most / f64::from(scale)
    } else {
        0.0
    };
    let code = |i: u32| {
        let p = (points[i as usize].as_dvec3() - lo.as_dvec3()) * scale;
        spread(p.x as u64) | spread(p.y as u64) << 1 | spread(p.z as u64) << 2
    };
    chosen.par_sort_by_cached_key(|&i| (code(i), i));
    chosen
}

/// Puts two zero bits behind each of the lowest 21.
fn spread(x: u64) -> u64 {
    let mut x = x & 0x1f_ffff;
    x = (x | x << 32) & 0x1f_0000_0000_ffff;
    x = (x | x << 16) & 0x1f_0000_ff00_00ff;
    x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_in_order_are_neighbours() {
        let n = 16u32;
        let points: Vec<Vec3> = (0..n * n * n)
            .map(|i| {
                let j = i.wrapping_mul(2_654_435_761) % (n * n * n);
                Vec3::new((j % n) as f32, (j / n % n) as f32, (j / n / n) as f32)
            })
            .collect();
        let order = morton(&points, 0..points.len() as u32);
        let step = |w: &[u32]| (points[w[0] as usize] - points[w[1] as usize]).length();
        let mean = order.windows(2).map(step).sum::<f32>() / order.len() as f32;
        assert!(mean < 2.0, "{mean}");
        let mut all = order.clone();
        all.sort_unstable();
        assert!(all.into_iter().eq(0..n * n * n));
        assert_eq!(morton(&[Vec3::ONE; 3], [2, 0, 1].into_iter()), [0, 1, 2]);
    }
}
