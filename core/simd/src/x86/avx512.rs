//! 16 floats in one register of AVX-512.

use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Mul, Neg, Sub};

use super::avx2::Pair;
use super::avx512_apart;
use super::eight::{
    BIT, F256, M256, all8, bytes_in_turns, bytes8, eight_unzipped, falling, four_pairs, from8,
    halves_swapped, high_bits, keys, mask8, ordered, outward8, transposed,
};
use super::rows::{expect, expect_lattice, long_rows, rows, within};
use crate::{Float, Mask, Part, Simd};

/// AVX-512 (F, BW, DQ, VL).
#[derive(Clone, Copy, Debug)]
pub struct Avx512(pub(super) ());

/// 16 floats.
#[derive(Clone, Copy, Debug)]
pub struct F512(__m512);

/// Truth values of 16 floats, one a bit.
#[derive(Clone, Copy, Debug)]
pub struct M512(__mmask16);

operators!(
    F512,
    |a, b| x86!(F512(_mm512_add_ps(a.0, b.0))),
    x86!(F512(_mm512_sub_ps(a.0, b.0))),
    x86!(F512(_mm512_mul_ps(a.0, b.0))),
    x86!(F512(_mm512_xor_ps(a.0, _mm512_set1_ps(-0.0))))
);

mask!(
    M512,
    |a, b| M512(a.0 & b.0),
    M512(a.0 | b.0),
    u32::from(a.0)
);

impl Float<16> for F512 {
    type Mask = M512;
    #[inline(always)]
    fn to_array(self) -> [f32; 16] {
        let mut out = [0.0; 16];
        x86!(_mm512_storeu_ps(out.as_mut_ptr(), self.0));
        out
    }
    #[inline(always)]
    fn min(self, o: Self) -> Self {
        x86!(F512(_mm512_min_ps(self.0, o.0)))
    }
    #[inline(always)]
    fn max(self, o: Self) -> Self {
        x86!(F512(_mm512_max_ps(self.0, o.0)))
    }
    #[inline(always)]
    fn mul_add(self, by: Self, plus: Self) -> Self {
        x86!(F512(_mm512_fmadd_ps(self.0, by.0, plus.0)))
    }
    #[inline(always)]
    fn over(self, by: Self) -> Self {
        x86!(F512(_mm512_div_ps(self.0, by.0)))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        x86!(F512(_mm512_sqrt_ps(self.0)))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        x86!(F512(_mm512_abs_ps(self.0)))
    }
    #[inline(always)]
    fn lt(self, o: Self) -> M512 {
        x86!(M512(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(self.0, o.0)))
    }
    #[inline(always)]
    fn le(self, o: Self) -> M512 {
        x86!(M512(_mm512_cmp_ps_mask::<_CMP_LE_OQ>(self.0, o.0)))
    }
    #[inline(always)]
    fn or(self, mask: M512, o: Self) -> Self {
        x86!(F512(_mm512_mask_blend_ps(mask.0, o.0, self.0)))
    }
    #[inline(always)]
    fn least(self) -> f32 {
        let halves = x86!((
            F256(_mm512_castps512_ps256(self.0)),
            F256(_mm512_extractf32x8_ps::<1>(self.0))
        ));
        halves.0.min(halves.1).least()
    }
    #[inline(always)]
    fn most(self) -> f32 {
        let halves = x86!((
            F256(_mm512_castps512_ps256(self.0)),
            F256(_mm512_extractf32x8_ps::<1>(self.0))
        ));
        halves.0.max(halves.1).most()
    }
}

#[inline(always)]
fn both(x: Pair) -> F512 {
    x86!(F512(_mm512_insertf32x8::<1>(
        _mm512_castps256_ps512(x.0.0),
        x.1.0
    )))
}

macro_rules! fours512 {
    ($join:ident, $a:expr, $b:expr) => {
        x86!({
            let t = joined!(
                $join,
                _mm512_unpacklo_ps,
                _mm512_unpackhi_ps,
                _mm512_permute_ps,
                $a.0,
                $b.0
            );
            let at = _mm512_setr_epi32(0, 4, 8, 12, 1, 5, 9, 13, 0, 0, 0, 0, 0, 0, 0, 0);
            F256(_mm512_castps512_ps256(_mm512_permutexvar_ps(at, t)))
        })
    };
}

/// The 5 of each row of 8 that a lattice keeps, the third row being in the second vector.
static KEPT: [i32; 16] = [0, 1, 2, 3, 4, 8, 9, 10, 11, 12, 16, 17, 18, 19, 20, 20];

/// Lanes of a lattice in rows of 5 at the corners of triangles; see [`Simd::triangles`].
static ROWS: [[i32; 16]; 3] = [
    [0, 1, 2, 3, 5, 6, 7, 8, 0, 1, 2, 3, 5, 6, 7, 8],
    [1, 2, 3, 4, 6, 7, 8, 9, 6, 7, 8, 9, 11, 12, 13, 14],
    [6, 7, 8, 9, 11, 12, 13, 14, 5, 6, 7, 8, 10, 11, 12, 13],
];

/// Lanes of two vectors in turns; those of the second are 16 and more.
const ZIPPED: [[i32; 16]; 2] = [
    [0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23],
    [8, 24, 9, 25, 10, 26, 11, 27, 12, 28, 13, 29, 14, 30, 15, 31],
];

/// The first of each pair of lanes of two vectors, and the second.
const UNZIPPED: [[i32; 16]; 2] = [
    [0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30],
    [1, 3, 5, 7, 9, 11, 13, 15, 17, 19, 21, 23, 25, 27, 29, 31],
];

/// Vector `i` has lane `i` of each of these, in each quarter by itself.
#[inline(always)]
fn fours_transposed([a, b, c, d]: [F512; 4]) -> [F512; 4] {
    x86!({
        let (ab, cd) = (_mm512_unpacklo_ps(a.0, b.0), _mm512_unpacklo_ps(c.0, d.0));
        let (ef, gh) = (_mm512_unpackhi_ps(a.0, b.0), _mm512_unpackhi_ps(c.0, d.0));
        [
            F512(_mm512_shuffle_ps::<0b01_00_01_00>(ab, cd)),
            F512(_mm512_shuffle_ps::<0b11_10_11_10>(ab, cd)),
            F512(_mm512_shuffle_ps::<0b01_00_01_00>(ef, gh)),
            F512(_mm512_shuffle_ps::<0b11_10_11_10>(ef, gh)),
        ]
    })
}

/// Lanes `at` of `a`, then of `b`.
#[inline(always)]
fn chosen(at: &[i32; 16], a: F512, b: F512) -> F512 {
    x86!(F512(_mm512_permutex2var_ps(
        a.0,
        _mm512_loadu_si512(at.as_ptr().cast()),
        b.0
    )))
}

/// Lanes `at` of `x`.
#[inline(always)]
fn permuted(at: &[i32; 16], x: F512) -> F512 {
    x86!(F512(_mm512_permutexvar_ps(
        _mm512_loadu_si512(at.as_ptr().cast()),
        x.0
    )))
}

/// Rows of 8, of which 5 are kept: lanes 0 to 4, 5 to 9 and 10 to 14. Fewer of such loads lie across two lines of the cache
/// than of wider ones.
///
/// # Safety
/// [`within`] did not panic for it.
#[inline(always)]
unsafe fn lattice_at(floats: &[f32], first: usize, stride: usize) -> F512 {
    // SAFETY: AVX-512 is there, as the module's text says; the rows are, as above.
    unsafe {
        let p = floats.as_ptr().add(first);
        let near = _mm512_castps256_ps512(_mm256_loadu_ps(p));
        let near = _mm512_insertf32x8::<1>(near, _mm256_loadu_ps(p.add(stride)));
        let far = _mm512_castps256_ps512(_mm256_loadu_ps(p.add(2 * stride)));
        let lanes = _mm512_loadu_si512(KEPT.as_ptr().cast());
        F512(_mm512_permutex2var_ps(near, lanes, far))
    }
}

impl Simd for Avx512 {
    const WIDE: bool = true;
    #[inline(always)]
    fn apart<P: Part<Self>>(self, part: P) -> P::Output {
        x86!(avx512_apart(part))
    }
    type F8 = F256;
    type F16 = F512;
    type M16 = M512;
    type Bits = __m512i;

    #[inline(always)]
    fn all8(self, x: f32) -> F256 {
        all8(x)
    }
    #[inline(always)]
    fn from8(self, x: &[f32; 8]) -> F256 {
        from8(x)
    }
    #[inline(always)]
    fn halves_swapped(self, x: F256) -> F256 {
        halves_swapped(x)
    }
    #[inline(always)]
    fn transposed(self, x: [F256; 8]) -> [F256; 8] {
        transposed(x)
    }
    #[inline(always)]
    fn columns(self, rows: [&[f32; 8]; 16]) -> [F512; 8] {
        let [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p] = rows;
        // Fours are side by side in the end: those 4 later are in the other half meanwhile.
        let two = |low: &[f32; 8], high: &[f32; 8]| both(Pair(from8(low), from8(high)));
        let first = fours_transposed([two(a, e), two(b, f), two(c, g), two(d, h)]);
        let second = fours_transposed([two(i, m), two(j, n), two(k, o), two(l, p)]);
        let mut out = [first[0]; 8];
        for i in 0..4 {
            let (first, second) = (first[i].0, second[i].0);
            out[i] = x86!(F512(_mm512_shuffle_f32x4::<0b10_00_10_00>(first, second)));
            out[i + 4] = x86!(F512(_mm512_shuffle_f32x4::<0b11_01_11_01>(first, second)));
        }
        out
    }
    #[inline(always)]
    fn unzipped(self, pairs: [&[f32; 2]; 16]) -> [F512; 2] {
        let [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p] = pairs;
        let eight = |low, high| both(Pair(F256(four_pairs(low)), F256(four_pairs(high))));
        let (low, high) = (
            eight([a, b, c, d], [e, f, g, h]),
            eight([i, j, k, l], [m, n, o, p]),
        );
        [
            chosen(&UNZIPPED[0], low, high),
            chosen(&UNZIPPED[1], low, high),
        ]
    }
    #[inline(always)]
    fn unzipped8(self, pairs: [&[f32; 2]; 8]) -> [F256; 2] {
        eight_unzipped(pairs)
    }
    #[inline(always)]
    fn mask8(self, bits: u32) -> M256 {
        mask8(bits)
    }
    #[inline(always)]
    fn high_bits(self, x: &[u32; 8]) -> u32 {
        high_bits(x)
    }
    #[inline(always)]
    fn bytes8(self, x: &[u8; 8]) -> F256 {
        bytes8(x)
    }
    #[inline(always)]
    fn halves(self, first: F256, last: F256) -> F512 {
        both(Pair(first, last))
    }
    #[inline(always)]
    fn of_halves(self, x: F512) -> [F256; 2] {
        x86!([
            F256(_mm512_castps512_ps256(x.0)),
            F256(_mm512_extractf32x8_ps::<1>(x.0))
        ])
    }
    #[inline(always)]
    fn quarters(self, x: &[f32; 4]) -> F512 {
        x86!(F512(_mm512_broadcast_f32x4(_mm_loadu_ps(x.as_ptr()))))
    }
    #[inline(always)]
    fn over_quarters<const LANE: usize>(self, x: F512) -> F512 {
        x86!(F512(match LANE & 3 {
            0 => _mm512_permute_ps::<0b00_00_00_00>(x.0),
            1 => _mm512_permute_ps::<0b01_01_01_01>(x.0),
            2 => _mm512_permute_ps::<0b10_10_10_10>(x.0),
            _ => _mm512_permute_ps::<0b11_11_11_11>(x.0),
        }))
    }
    #[inline(always)]
    fn bytes16(self, x: &[[u8; 8]; 2], order: &[u8; 16]) -> F512 {
        let bytes = ordered(x, order);
        x86!(F512(_mm512_cvtepi32_ps(_mm512_cvtepu8_epi32(bytes))))
    }
    #[inline(always)]
    fn kept(
        self,
        mask: u32,
        x: F256,
        words: &[u32; 8],
        to: &mut [f32; 8],
        words_to: &mut [u32; 8],
    ) {
        x86!({
            let mask = mask as u8;
            let words = _mm256_loadu_si256(words.as_ptr().cast());
            let words = _mm256_maskz_compress_epi32(mask, words);
            _mm256_storeu_ps(to.as_mut_ptr(), _mm256_maskz_compress_ps(mask, x.0));
            _mm256_storeu_si256(words_to.as_mut_ptr().cast(), words);
        });
    }
    #[inline(always)]
    fn falling(
        self,
        mask: u32,
        x: F256,
        words: &[u32; 8],
        to: &mut [f32; 8],
        words_to: &mut [u32; 8],
    ) {
        x86!({
            let keys = _mm256_maskz_mov_epi32(mask as u8, keys(x));
            falling(keys, x, words, to, words_to);
        });
    }
    #[inline(always)]
    fn all16(self, x: f32) -> F512 {
        x86!(F512(_mm512_set1_ps(x)))
    }
    #[inline(always)]
    fn from16(self, x: &[f32; 16]) -> F512 {
        x86!(F512(_mm512_loadu_ps(x.as_ptr())))
    }
    #[inline(always)]
    fn bytes_in_turns(self, even: &[u8; 8], odd: &[u8; 8]) -> F512 {
        let bytes = bytes_in_turns(even, odd);
        x86!(F512(_mm512_cvtepi32_ps(_mm512_cvtepu8_epi32(bytes))))
    }
    #[inline(always)]
    fn in_turns(self, pair: &[f32; 2]) -> F512 {
        x86!(F512(_mm512_castpd_ps(_mm512_broadcastsd_pd(_mm_load_sd(
            pair.as_ptr().cast()
        )))))
    }
    #[inline(always)]
    fn swapped(self, x: F512) -> F512 {
        x86!(F512(_mm512_permute_ps::<0b10_11_00_01>(x.0)))
    }
    #[inline(always)]
    fn zip(self, even: F512, odd: F512) -> [F512; 2] {
        [chosen(&ZIPPED[0], even, odd), chosen(&ZIPPED[1], even, odd)]
    }
    #[inline(always)]
    fn in_pairs(self, even: F256, odd: F256) -> F512 {
        let [even, odd] = x86!([
            F512(_mm512_castps256_ps512(even.0)),
            F512(_mm512_castps256_ps512(odd.0))
        ]);
        chosen(&ZIPPED[0], even, odd)
    }
    #[inline(always)]
    fn no_bits(self) -> __m512i {
        x86!(_mm512_setzero_si512())
    }
    #[inline(always)]
    fn more_bits(self, bits: __m512i, mask: M512, more: usize) -> __m512i {
        let more = BIT[more & 63].cast_signed();
        x86!(_mm512_mask_or_epi32(
            bits,
            mask.0,
            bits,
            _mm512_set1_epi64(more)
        ))
    }
    #[inline(always)]
    fn some_bits(self, bits: __m512i) -> u32 {
        u32::from(x86!(_mm512_test_epi64_mask(bits, bits)))
    }
    #[inline(always)]
    fn bits_of(self, bits: __m512i) -> [u64; 8] {
        let mut out = [0; 8];
        x86!(_mm512_storeu_si512(out.as_mut_ptr().cast(), bits));
        out
    }
    #[inline(always)]
    fn less16(self, x: F512, by: f64) -> F512 {
        x86!({
            let by = _mm512_set1_pd(by);
            let lo = _mm512_cvtps_pd(_mm512_castps512_ps256(x.0));
            let hi = _mm512_cvtps_pd(_mm512_extractf32x8_ps::<1>(x.0));
            let lo = _mm512_cvtpd_ps(_mm512_sub_pd(lo, by));
            let hi = _mm512_cvtpd_ps(_mm512_sub_pd(hi, by));
            F512(_mm512_insertf32x8::<1>(_mm512_castps256_ps512(lo), hi))
        })
    }
    #[inline(always)]
    fn mask16(self, bits: u32) -> M512 {
        M512(bits as u16)
    }
    #[inline(always)]
    fn spread(self, bits: u32, places: u64) -> u64 {
        x86!(_pdep_u64(u64::from(bits), places))
    }
    #[inline(always)]
    fn rows(self, plane: &[f32], at: [usize; 4]) -> [F512; 2] {
        let [first, later] = rows(plane, at);
        [both(first), both(later)]
    }
    #[inline(always)]
    fn long_rows(self, plane: &[f32], at: [usize; 2]) -> [F512; 2] {
        let [first, later] = long_rows(plane, at);
        [both(first), both(later)]
    }
    #[inline(always)]
    fn least_of_fours(self, a: F512, b: F512) -> F256 {
        fours512!(_mm512_min_ps, a, b)
    }
    #[inline(always)]
    fn most_of_fours(self, a: F512, b: F512) -> F256 {
        fours512!(_mm512_max_ps, a, b)
    }
    #[inline(always)]
    fn outward8(self, low: F256, high: F256) -> [[u8; 8]; 2] {
        outward8(low, high)
    }
    #[inline(always)]
    fn expect<T>(self, from: &[T], at: usize) {
        expect(from, at);
    }
    #[inline(always)]
    fn expect_lattices<const KEYS: usize>(
        self,
        floats: &[f32],
        first: usize,
        columns: usize,
        key: usize,
    ) {
        for k in 0..KEYS {
            expect_lattice(floats, first.wrapping_add(k * key), columns);
        }
    }
    #[inline(always)]
    fn lattice(self, floats: &[f32], first: usize, stride: usize) -> F512 {
        within(floats, first, stride, (0, 0));
        // SAFETY: `within` says that it is there.
        unsafe { lattice_at(floats, first, stride) }
    }
    #[inline(always)]
    fn lattices<const KEYS: usize>(
        self,
        floats: &[f32],
        first: usize,
        columns: usize,
        key: usize,
        axes: [usize; 3],
    ) -> [[F512; 3]; KEYS] {
        // So that no product wraps.
        assert!(columns < 1 << 14 && key < 1 << 16);
        let stride = 3 * columns;
        within(floats, first, stride, (2 * columns, (KEYS - 1) * key));
        let mut out = [[self.all16(0.0); 3]; KEYS];
        for (k, out) in out.iter_mut().enumerate() {
            for (out, axis) in out.iter_mut().zip(axes) {
                let at = first + k * key + axis.min(2) * columns;
                // SAFETY: `within` says that the last lattice is there, and so those before it: `axis` is at most 2.
                *out = unsafe { lattice_at(floats, at, stride) };
            }
        }
        out
    }
    #[inline(always)]
    fn corners(self, l: usize) -> [usize; 3] {
        let [a, b, c] = &ROWS;
        [a[l & 15] as usize, b[l & 15] as usize, c[l & 15] as usize]
    }
    #[inline(always)]
    fn triangles(self, lattice: F512) -> [F512; 3] {
        [
            permuted(&ROWS[0], lattice),
            permuted(&ROWS[1], lattice),
            permuted(&ROWS[2], lattice),
        ]
    }
}
