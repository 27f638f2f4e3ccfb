//! Unit vectors in 32 bits: octahedral mapping, 16 bits a coordinate (Cigolle et al., "A Survey of
//! Efficient Representations for Independent Unit Vectors", JCGT 2014). Largest error about
//! 0.0001 rad.

use glam::Vec3;
use hdtrapeze_simd::{Float, Kernel, Level, Simd};

/// Encodes a unit vector. The zero vector (no normal) becomes +z.
pub fn encode(n: Vec3) -> u32 {
    let s = n.x.abs() + n.y.abs() + n.z.abs();
    if !s.is_finite() || s <= 0.0 {
        return encode(Vec3::Z);
    }
    let (mut x, mut y) = (n.x / s, n.y / s);
    if n.z < 0.0 {
        let (ox, oy) = (x, y);
        x = (1.0 - oy.abs()) * 1.0f32.copysign(ox);
        y = (1.0 - ox.abs()) * 1.0f32.copysign(oy);
    }
    let q = |v: f32| ((v.clamp(-1.0, 1.0) * 32767.0).round() as i32 + 32767) as u32;
    q(x) | (q(y) << 16)
}

/// Decodes to a unit vector.
pub fn decode(bits: u32) -> Vec3 {
    let d = |q: u32| (q as i32 - 32767) as f32 / 32767.0;
    let (x, y) = (d(bits & 0xffff), d(bits >> 16));
    let z = 1.0 - x.abs() - y.abs();
    let fold = (-z).max(0.0);
    Vec3::new(x - fold.copysign(x), y - fold.copysign(y), z).normalize()
}

/// The sum of the unit vectors at four corners, each times its weight; between those of `from` and those of `to` by `f`, a part
/// of the way from 0 to 1.
pub fn blended(level: Level, [from, to]: [[u32; 4]; 2], f: f32, weights: [f32; 4]) -> Vec3 {
    level.run(Blend {
        from,
        to,
        f,
        weights,
    })
}

struct Blend {
    from: [u32; 4],
    to: [u32; 4],
    f: f32,
    weights: [f32; 4],
}

impl Kernel for Blend {
    type Output = Vec3;
    /// All eight side by side, in the operations of [`decode`]: the same bits.
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Vec3 {
        let Self {
            from,
            to,
            f,
            weights,
        } = self;
        let (mut x, mut y) = ([0.0; 8], [0.0; 8]);
        for (i, code) in from.into_iter().chain(to).enumerate() {
            x[i] = ((code & 0xffff) as i32 - 32767) as f32;
            y[i] = ((code >> 16) as i32 - 32767) as f32;
        }
        let (zero, one, scale) = (simd.all8(0.0), simd.all8(1.0), simd.all8(32767.0));
        let (x, y) = (simd.from8(&x).over(scale), simd.from8(&y).over(scale));
        let z = one - x.abs() - y.abs();
        let fold = (-z).max(zero);
        // Neither is -0.
        let x = (x + fold).or(x.lt(zero), x - fold);
        let y = (y + fold).or(y.lt(zero), y - fold);
        let scale = one.over((x * x + y * y + z * z).sqrt());
        let part = simd.all8(f).or(simd.mask8(0xf0), simd.all8(1.0 - f));
        let [a, b, c, d] = weights;
        let weights = simd.from8(&[a, b, c, d, 0.0, 0.0, 0.0, 0.0]);
        let mut sum = [0.0; 3];
        for (sum, x) in sum.iter_mut().zip([x, y, z]) {
            let parts = x * scale * part;
            let blended = (parts + simd.halves_swapped(parts)) * weights;
            let [a, b, c, d, ..] = blended.to_array();
            *sum = 0.0 + a + b + c + d;
        }
        Vec3::from_array(sum)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// To the bit, on all levels: at and between keys, with weights of 0, in all octants.
    #[test]
    fn blended_vectors_are_those_that_are_decoded_alone() {
        let mut state = 1u64;
        let mut random = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 32) as u32
        };
        for round in 0..4000 {
            // Codes of encoded vectors have 0 to 65534 in both halves.
            let mut code = || (random() % 65535) | (random() % 65535) << 16;
            let codes: [[u32; 4]; 2] = [(); 2].map(|()| [(); 4].map(|()| code()));
            let mut unit = || (random() >> 8) as f32 / 16_777_216.0;
            let f = if round % 3 == 0 { 0.0 } else { unit() };
            let mut weights = [(); 4].map(|()| unit());
            weights[round % 4] = 0.0;
            let mut alone = Vec3::ZERO;
            for i in 0..4 {
                let [from, to] = [0, 1].map(|k: usize| decode(codes[k][i]));
                if weights[i] != 0.0 {
                    let at = if f == 0.0 { from } else { from.lerp(to, f) };
                    alone += at * weights[i];
                }
            }
            for level in Level::available() {
                let found = blended(level, codes, f, weights);
                let bits = |v: Vec3| v.to_array().map(f32::to_bits);
                assert_eq!(bits(found), bits(alone), "{codes:?} {f} {weights:?}");
            }
        }
    }

    #[test]
    fn round_trip_error_is_small() {
        let mut worst: f32 = 0.0;
        for i in 0..2000 {
            let z = 1.0 - 2.0 * (i as f32 + 0.5) / 2000.0;
            let phi = i as f32 * 2.399_963_2;
            let r = (1.0 - z * z).sqrt();
            let n = Vec3::new(r * phi.cos(), r * phi.sin(), z);
            worst = worst.max((decode(encode(n)) - n).length());
        }
        assert!(worst < 1.0e-4, "{worst}");
        for n in [Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Y, Vec3::Z, -Vec3::Z] {
            assert!((decode(encode(n)) - n).length() < 1.0e-6);
        }
    }
}
