//! 8 floats, in a register of AVX.

use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Mul, Neg, Sub};

use crate::{Float, Mask};

/// 8 floats.
#[derive(Clone, Copy, Debug)]
pub struct F256(pub(super) __m256);

/// Truth values of 8 floats: all bits of a lane, or none.
#[derive(Clone, Copy, Debug)]
pub struct M256(pub(super) __m256);

operators!(
    F256,
    |a, b| x86!(F256(_mm256_add_ps(a.0, b.0))),
    x86!(F256(_mm256_sub_ps(a.0, b.0))),
    x86!(F256(_mm256_mul_ps(a.0, b.0))),
    x86!(F256(_mm256_xor_ps(a.0, _mm256_set1_ps(-0.0))))
);

mask!(
    M256,
    |a, b| x86!(M256(_mm256_and_ps(a.0, b.0))),
    x86!(M256(_mm256_or_ps(a.0, b.0))),
    x86!(_mm256_movemask_ps(a.0)).cast_unsigned()
);

impl Float<8> for F256 {
    type Mask = M256;
    #[inline(always)]
    fn to_array(self) -> [f32; 8] {
        let mut out = [0.0; 8];
        x86!(_mm256_storeu_ps(out.as_mut_ptr(), self.0));
        out
    }
    #[inline(always)]
    fn min(self, o: Self) -> Self {
        x86!(F256(_mm256_min_ps(self.0, o.0)))
    }
    #[inline(always)]
    fn max(self, o: Self) -> Self {
        x86!(F256(_mm256_max_ps(self.0, o.0)))
    }
    #[inline(always)]
    fn mul_add(self, by: Self, plus: Self) -> Self {
        x86!(F256(_mm256_fmadd_ps(self.0, by.0, plus.0)))
    }
    #[inline(always)]
    fn over(self, by: Self) -> Self {
        x86!(F256(_mm256_div_ps(self.0, by.0)))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        x86!(F256(_mm256_sqrt_ps(self.0)))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        x86!(F256(_mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0)))
    }
    #[inline(always)]
    fn lt(self, o: Self) -> M256 {
        x86!(M256(_mm256_cmp_ps::<_CMP_LT_OQ>(self.0, o.0)))
    }
    #[inline(always)]
    fn le(self, o: Self) -> M256 {
        x86!(M256(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, o.0)))
    }
    #[inline(always)]
    fn or(self, mask: M256, o: Self) -> Self {
        x86!(F256(_mm256_blendv_ps(o.0, self.0, mask.0)))
    }
    #[inline(always)]
    fn least(self) -> f32 {
        x86!({
            let a = _mm_min_ps(
                _mm256_castps256_ps128(self.0),
                _mm256_extractf128_ps::<1>(self.0),
            );
            let a = _mm_min_ps(a, _mm_movehl_ps(a, a));
            _mm_cvtss_f32(_mm_min_ss(a, _mm_movehdup_ps(a)))
        })
    }
    #[inline(always)]
    fn most(self) -> f32 {
        x86!({
            let a = _mm_max_ps(
                _mm256_castps256_ps128(self.0),
                _mm256_extractf128_ps::<1>(self.0),
            );
            let a = _mm_max_ps(a, _mm_movehl_ps(a, a));
            _mm_cvtss_f32(_mm_max_ss(a, _mm_movehdup_ps(a)))
        })
    }
}

#[inline(always)]
pub(super) fn all8(x: f32) -> F256 {
    x86!(F256(_mm256_set1_ps(x)))
}

#[inline(always)]
pub(super) fn from8(x: &[f32; 8]) -> F256 {
    x86!(F256(_mm256_loadu_ps(x.as_ptr())))
}

#[inline(always)]
pub(super) fn halves_swapped(x: F256) -> F256 {
    x86!(F256(_mm256_permute2f128_ps::<1>(x.0, x.0)))
}

#[inline(always)]
pub(super) fn transposed([a, b, c, d, e, f, g, h]: [F256; 8]) -> [F256; 8] {
    let [a, b, c, d] = fours_transposed([a, b, c, d]);
    let [e, f, g, h] = fours_transposed([e, f, g, h]);
    x86!([
        F256(_mm256_permute2f128_ps::<0x20>(a.0, e.0)),
        F256(_mm256_permute2f128_ps::<0x20>(b.0, f.0)),
        F256(_mm256_permute2f128_ps::<0x20>(c.0, g.0)),
        F256(_mm256_permute2f128_ps::<0x20>(d.0, h.0)),
        F256(_mm256_permute2f128_ps::<0x31>(a.0, e.0)),
        F256(_mm256_permute2f128_ps::<0x31>(b.0, f.0)),
        F256(_mm256_permute2f128_ps::<0x31>(c.0, g.0)),
        F256(_mm256_permute2f128_ps::<0x31>(d.0, h.0)),
    ])
}

/// Four pairs: the first and second, then the third and fourth.
#[inline(always)]
pub(super) fn four_pairs([a, b, c, d]: [&[f32; 2]; 4]) -> __m256 {
    x86!({
        let two = |a: &[f32; 2], b: &[f32; 2]| {
            _mm_castpd_ps(_mm_loadh_pd(
                _mm_load_sd(a.as_ptr().cast()),
                b.as_ptr().cast(),
            ))
        };
        _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(two(a, b)), two(c, d))
    })
}

/// The first of each pair, and the second.
#[inline(always)]
pub(super) fn eight_unzipped([a, b, c, d, e, f, g, h]: [&[f32; 2]; 8]) -> [F256; 2] {
    let (first, second) = (four_pairs([a, b, e, f]), four_pairs([c, d, g, h]));
    x86!([
        F256(_mm256_shuffle_ps::<0b10_00_10_00>(first, second)),
        F256(_mm256_shuffle_ps::<0b11_01_11_01>(first, second)),
    ])
}

/// The same for 4 vectors, in each half by itself.
#[inline(always)]
fn fours_transposed([a, b, c, d]: [F256; 4]) -> [F256; 4] {
    x86!({
        let (ab, cd) = (_mm256_unpacklo_ps(a.0, b.0), _mm256_unpacklo_ps(c.0, d.0));
        let (ef, gh) = (_mm256_unpackhi_ps(a.0, b.0), _mm256_unpackhi_ps(c.0, d.0));
        [
            F256(_mm256_shuffle_ps::<0b01_00_01_00>(ab, cd)),
            F256(_mm256_shuffle_ps::<0b11_10_11_10>(ab, cd)),
            F256(_mm256_shuffle_ps::<0b01_00_01_00>(ef, gh)),
            F256(_mm256_shuffle_ps::<0b11_10_11_10>(ef, gh)),
        ]
    })
}

#[inline(always)]
pub(super) fn mask8(bits: u32) -> M256 {
    x86!({
        let lane = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
        let set = _mm256_and_si256(_mm256_set1_epi32(bits.cast_signed()), lane);
        M256(_mm256_castsi256_ps(_mm256_cmpeq_epi32(set, lane)))
    })
}

/// 8 floats by their bits, whose lowest are the lanes' numbers.
#[inline(always)]
pub(super) fn keys(x: F256) -> __m256i {
    x86!({
        let numbers = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
        let rest = _mm256_andnot_si256(_mm256_set1_epi32(7), _mm256_castps_si256(x.0));
        _mm256_or_si256(rest, numbers)
    })
}

/// Lanes that are compared hold each other's key: those of `LOW` take the smaller one.
#[inline(always)]
fn exchanged<const LOW: i32>(keys: __m256i, others: __m256i) -> __m256i {
    x86!(_mm256_blend_epi32::<LOW>(
        _mm256_max_epu32(keys, others),
        _mm256_min_epu32(keys, others)
    ))
}

/// Writes floats and words in the order in which `keys`, made by [`keys`] or 0, fall. Those that are 0 come last, and all but the
/// first of these stand for nothing.
#[inline(always)]
pub(super) fn falling(
    keys: __m256i,
    x: F256,
    words: &[u32; 8],
    to: &mut [f32; 8],
    words_to: &mut [u32; 8],
) {
    // Pairs are sorted, then fours, then eights, after Batcher.
    let pairs = |k| exchanged::<0b1010_1010>(k, x86!(_mm256_shuffle_epi32::<0b10_11_00_01>(k)));
    let fours = |k| exchanged::<0b1100_1100>(k, x86!(_mm256_shuffle_epi32::<0b01_00_11_10>(k)));
    let mirrored = |k| x86!(_mm256_shuffle_epi32::<0b00_01_10_11>(k));
    let k = pairs(keys);
    let k = pairs(exchanged::<0b1100_1100>(k, mirrored(k)));
    let others = x86!(_mm256_permute4x64_epi64::<0b01_00_11_10>(mirrored(k)));
    let k = pairs(fours(exchanged::<0b1111_0000>(k, others)));
    x86!({
        let words = _mm256_loadu_si256(words.as_ptr().cast());
        // Of a key, what is above the lane's number does not count here.
        _mm256_storeu_ps(to.as_mut_ptr(), _mm256_permutevar8x32_ps(x.0, k));
        let words = _mm256_permutevar8x32_epi32(words, k);
        _mm256_storeu_si256(words_to.as_mut_ptr().cast(), words);
    });
}

#[inline(always)]
pub(super) fn high_bits(x: &[u32; 8]) -> u32 {
    x86!(_mm256_movemask_ps(_mm256_loadu_ps(x.as_ptr().cast()))).cast_unsigned()
}

#[inline(always)]
pub(super) fn bytes8(x: &[u8; 8]) -> F256 {
    x86!({
        let bytes = _mm_loadl_epi64(x.as_ptr().cast());
        F256(_mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(bytes)))
    })
}

/// Each bit of 64: a broadcast from memory is cheaper than a shift and one from a register.
pub(super) static BIT: [u64; 64] = {
    let mut out = [0; 64];
    let mut i = 0;
    while i < 64 {
        out[i] = 1 << i;
        i += 1;
    }
    out
};

/// 16 whole numbers from 0 to 255, in bytes, from each in turns.
#[inline(always)]
pub(super) fn bytes_in_turns(even: &[u8; 8], odd: &[u8; 8]) -> __m128i {
    x86!(_mm_unpacklo_epi8(
        _mm_loadl_epi64(even.as_ptr().cast()),
        _mm_loadl_epi64(odd.as_ptr().cast())
    ))
}

/// 16 bytes in another order.
#[inline(always)]
pub(super) fn ordered(x: &[[u8; 8]; 2], order: &[u8; 16]) -> __m128i {
    x86!({
        let order = _mm_loadu_si128(order.as_ptr().cast());
        _mm_shuffle_epi8(_mm_loadu_si128(x.as_ptr().cast()), order)
    })
}

#[inline(always)]
pub(super) fn outward8(low: F256, high: F256) -> [[u8; 8]; 2] {
    x86!({
        let (zero, most) = (_mm256_setzero_ps(), _mm256_set1_ps(255.0));
        let low = _mm256_max_ps(_mm256_floor_ps(low.0), zero);
        let high = _mm256_max_ps(_mm256_ceil_ps(high.0), zero);
        let low = _mm256_cvtps_epi32(_mm256_min_ps(low, most));
        let high = _mm256_cvtps_epi32(_mm256_min_ps(high, most));
        // In each half: four of `low`, four of `high`, as 16 bits; then as bytes.
        let words = _mm256_packus_epi32(low, high);
        let bytes = _mm256_packus_epi16(words, words);
        let bytes = _mm256_permutevar8x32_epi32(bytes, _mm256_setr_epi32(0, 4, 1, 5, 0, 4, 1, 5));
        let mut out = [[0; 8]; 2];
        _mm_storeu_si128(out.as_mut_ptr().cast(), _mm256_castsi256_si128(bytes));
        out
    })
}
