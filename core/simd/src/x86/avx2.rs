//! 16 floats in two registers of AVX, with AVX2 and FMA.

use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Mul, Neg, Sub};

use super::avx2_apart;
use super::eight::{
    BIT, F256, M256, all8, bytes_in_turns, bytes8, eight_unzipped, falling, from8, halves_swapped,
    high_bits, keys, mask8, ordered, outward8, transposed,
};
use super::rows::{expect, expect_lattice, long_rows, rows, within};
use crate::{Float, Mask, Part, Simd, scalar};

/// AVX2 with FMA.
#[derive(Clone, Copy, Debug)]
pub struct Avx2(pub(super) ());

/// 16 floats in two registers.
#[derive(Clone, Copy, Debug)]
pub struct Pair(pub(super) F256, pub(super) F256);

/// Truth values of a [`Pair`].
#[derive(Clone, Copy, Debug)]
pub struct PairMask(M256, M256);

operators!(
    Pair,
    |a, b| Pair(a.0 + b.0, a.1 + b.1),
    Pair(a.0 - b.0, a.1 - b.1),
    Pair(a.0 * b.0, a.1 * b.1),
    Pair(-a.0, -a.1)
);

mask!(
    PairMask,
    |a, b| PairMask(a.0 & b.0, a.1 & b.1),
    PairMask(a.0 | b.0, a.1 | b.1),
    a.0.bits() | a.1.bits() << 8
);

impl Float<16> for Pair {
    type Mask = PairMask;
    #[inline(always)]
    fn to_array(self) -> [f32; 16] {
        let mut out = [0.0; 16];
        x86!({
            _mm256_storeu_ps(out.as_mut_ptr(), self.0.0);
            _mm256_storeu_ps(out.as_mut_ptr().add(8), self.1.0);
        });
        out
    }
    #[inline(always)]
    fn min(self, o: Self) -> Self {
        Pair(self.0.min(o.0), self.1.min(o.1))
    }
    #[inline(always)]
    fn max(self, o: Self) -> Self {
        Pair(self.0.max(o.0), self.1.max(o.1))
    }
    #[inline(always)]
    fn mul_add(self, by: Self, plus: Self) -> Self {
        Pair(self.0.mul_add(by.0, plus.0), self.1.mul_add(by.1, plus.1))
    }
    #[inline(always)]
    fn over(self, by: Self) -> Self {
        Pair(self.0.over(by.0), self.1.over(by.1))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Pair(self.0.sqrt(), self.1.sqrt())
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Pair(self.0.abs(), self.1.abs())
    }
    #[inline(always)]
    fn lt(self, o: Self) -> PairMask {
        PairMask(self.0.lt(o.0), self.1.lt(o.1))
    }
    #[inline(always)]
    fn le(self, o: Self) -> PairMask {
        PairMask(self.0.le(o.0), self.1.le(o.1))
    }
    #[inline(always)]
    fn or(self, mask: PairMask, o: Self) -> Self {
        Pair(self.0.or(mask.0, o.0), self.1.or(mask.1, o.1))
    }
    #[inline(always)]
    fn least(self) -> f32 {
        self.0.min(self.1).least()
    }
    #[inline(always)]
    fn most(self) -> f32 {
        self.0.max(self.1).most()
    }
}

#[inline(always)]
fn less8(x: F256, by: f64) -> F256 {
    x86!({
        let by = _mm256_set1_pd(by);
        let lo = _mm256_cvtps_pd(_mm256_castps256_ps128(x.0));
        let hi = _mm256_cvtps_pd(_mm256_extractf128_ps::<1>(x.0));
        let lo = _mm256_cvtpd_ps(_mm256_sub_pd(lo, by));
        let hi = _mm256_cvtpd_ps(_mm256_sub_pd(hi, by));
        F256(_mm256_insertf128_ps::<1>(_mm256_castps128_ps256(lo), hi))
    })
}

/// Lanes of one and the other, in turns.
#[inline(always)]
fn zip8(even: F256, odd: F256) -> Pair {
    x86!({
        let low = _mm256_unpacklo_ps(even.0, odd.0);
        let high = _mm256_unpackhi_ps(even.0, odd.0);
        Pair(
            F256(_mm256_permute2f128_ps::<0x20>(low, high)),
            F256(_mm256_permute2f128_ps::<0x31>(low, high)),
        )
    })
}

/// One to the right in each of two rows of a lattice; the last of each is the row's end.
#[inline(always)]
fn right(rows: __m256, ends: __m256) -> F256 {
    x86!({
        let shifted = _mm256_permute_ps::<0b00_11_10_01>(rows);
        F256(_mm256_blend_ps::<0b1000_1000>(shifted, ends))
    })
}

/// Rows of a lattice, as [`Simd::lattice`] says: the first 8 lanes, and the last.
///
/// # Safety
/// [`within`] did not panic for it.
#[inline(always)]
unsafe fn lattice_at(floats: &[f32], first: usize, stride: usize) -> Pair {
    // SAFETY: AVX is there, as the module's text says; the rows are, as above.
    unsafe {
        let r0 = floats.as_ptr().add(first);
        let (r1, r2) = (r0.add(stride), r0.add(2 * stride));
        let near =
            _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(_mm_loadu_ps(r0)), _mm_loadu_ps(r1));
        let ends = _mm_insert_ps::<0x10>(_mm_load_ss(r0.add(4)), _mm_load_ss(r1.add(4)));
        let ends = _mm_insert_ps::<0x20>(ends, _mm_load_ss(r2.add(4)));
        let far = _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(_mm_loadu_ps(r2)), ends);
        Pair(F256(near), F256(far))
    }
}

macro_rules! fours256 {
    ($join:ident, $a:expr, $b:expr) => {
        x86!({
            let near = joined!(
                $join,
                _mm256_unpacklo_ps,
                _mm256_unpackhi_ps,
                _mm256_permute_ps,
                $a.0.0,
                $b.0.0
            );
            let far = joined!(
                $join,
                _mm256_unpacklo_ps,
                _mm256_unpackhi_ps,
                _mm256_permute_ps,
                $a.1.0,
                $b.1.0
            );
            let near = _mm256_permutevar8x32_ps(near, _mm256_setr_epi32(0, 4, 0, 0, 1, 5, 0, 0));
            let far = _mm256_permutevar8x32_ps(far, _mm256_setr_epi32(0, 0, 0, 4, 0, 0, 1, 5));
            F256(_mm256_blend_ps::<0b1100_1100>(near, far))
        })
    };
}

/// The lanes whose bits are set, for each set of 8.
static KEPT: [[u8; 8]; 256] = {
    let mut out = [[0; 8]; 256];
    let mut mask = 0;
    while mask < 256 {
        let (mut lane, mut k) = (0, 0);
        while lane < 8 {
            if mask >> lane & 1 == 1 {
                out[mask][k] = lane as u8;
                k += 1;
            }
            lane += 1;
        }
        mask += 1;
    }
    out
};

impl Simd for Avx2 {
    const WIDE: bool = false;
    #[inline(always)]
    fn apart<P: Part<Self>>(self, part: P) -> P::Output {
        x86!(avx2_apart(part))
    }
    type F8 = F256;
    type F16 = Pair;
    type M16 = PairMask;
    type Bits = [__m256i; 2];

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
    fn columns(self, rows: [&[f32; 8]; 16]) -> [Pair; 8] {
        let [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p] = rows;
        let first = transposed([a, b, c, d, e, f, g, h].map(from8));
        let second = transposed([i, j, k, l, m, n, o, p].map(from8));
        let mut out = [Pair(first[0], second[0]); 8];
        for (out, (first, second)) in out.iter_mut().zip(first.into_iter().zip(second)) {
            *out = Pair(first, second);
        }
        out
    }
    #[inline(always)]
    fn unzipped(self, pairs: [&[f32; 2]; 16]) -> [Pair; 2] {
        let [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p] = pairs;
        let first = eight_unzipped([a, b, c, d, e, f, g, h]);
        let second = eight_unzipped([i, j, k, l, m, n, o, p]);
        [Pair(first[0], second[0]), Pair(first[1], second[1])]
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
    fn halves(self, first: F256, last: F256) -> Pair {
        Pair(first, last)
    }
    #[inline(always)]
    fn of_halves(self, x: Pair) -> [F256; 2] {
        [x.0, x.1]
    }
    #[inline(always)]
    fn quarters(self, x: &[f32; 4]) -> Pair {
        let half = x86!({
            let x = _mm_loadu_ps(x.as_ptr());
            F256(_mm256_insertf128_ps::<1>(_mm256_castps128_ps256(x), x))
        });
        Pair(half, half)
    }
    #[inline(always)]
    fn over_quarters<const LANE: usize>(self, x: Pair) -> Pair {
        let over = |x: F256| {
            x86!(F256(match LANE & 3 {
                0 => _mm256_permute_ps::<0b00_00_00_00>(x.0),
                1 => _mm256_permute_ps::<0b01_01_01_01>(x.0),
                2 => _mm256_permute_ps::<0b10_10_10_10>(x.0),
                _ => _mm256_permute_ps::<0b11_11_11_11>(x.0),
            }))
        };
        Pair(over(x.0), over(x.1))
    }
    #[inline(always)]
    fn bytes16(self, x: &[[u8; 8]; 2], order: &[u8; 16]) -> Pair {
        let bytes = ordered(x, order);
        x86!(Pair(
            F256(_mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(bytes))),
            F256(_mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(
                _mm_unpackhi_epi64(bytes, bytes)
            )))
        ))
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
            let lanes = _mm_loadl_epi64((&raw const KEPT[mask as usize & 0xff]).cast());
            let lanes = _mm256_cvtepu8_epi32(lanes);
            let words = _mm256_loadu_si256(words.as_ptr().cast());
            let words = _mm256_permutevar8x32_epi32(words, lanes);
            _mm256_storeu_ps(to.as_mut_ptr(), _mm256_permutevar8x32_ps(x.0, lanes));
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
            let keys = _mm256_and_si256(keys(x), _mm256_castps_si256(mask8(mask).0));
            falling(keys, x, words, to, words_to);
        });
    }
    #[inline(always)]
    fn all16(self, x: f32) -> Pair {
        Pair(all8(x), all8(x))
    }
    #[inline(always)]
    fn from16(self, x: &[f32; 16]) -> Pair {
        x86!(Pair(
            F256(_mm256_loadu_ps(x.as_ptr())),
            F256(_mm256_loadu_ps(x.as_ptr().add(8)))
        ))
    }
    #[inline(always)]
    fn bytes_in_turns(self, even: &[u8; 8], odd: &[u8; 8]) -> Pair {
        let bytes = bytes_in_turns(even, odd);
        x86!(Pair(
            F256(_mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(bytes))),
            F256(_mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(
                _mm_unpackhi_epi64(bytes, bytes)
            )))
        ))
    }
    #[inline(always)]
    fn in_turns(self, pair: &[f32; 2]) -> Pair {
        let pair = x86!(F256(_mm256_castpd_ps(_mm256_broadcastsd_pd(_mm_load_sd(
            pair.as_ptr().cast()
        )))));
        Pair(pair, pair)
    }
    #[inline(always)]
    fn swapped(self, x: Pair) -> Pair {
        x86!(Pair(
            F256(_mm256_permute_ps::<0b10_11_00_01>(x.0.0)),
            F256(_mm256_permute_ps::<0b10_11_00_01>(x.1.0))
        ))
    }
    #[inline(always)]
    fn zip(self, even: Pair, odd: Pair) -> [Pair; 2] {
        [zip8(even.0, odd.0), zip8(even.1, odd.1)]
    }
    #[inline(always)]
    fn in_pairs(self, even: F256, odd: F256) -> Pair {
        zip8(even, odd)
    }
    #[inline(always)]
    fn no_bits(self) -> [__m256i; 2] {
        x86!([_mm256_setzero_si256(); 2])
    }
    #[inline(always)]
    fn more_bits(self, [low, high]: [__m256i; 2], mask: PairMask, more: usize) -> [__m256i; 2] {
        let more = BIT[more & 63].cast_signed();
        x86!({
            let more = _mm256_set1_epi64x(more);
            let marked = |mask: M256| _mm256_and_si256(_mm256_castps_si256(mask.0), more);
            [
                _mm256_or_si256(low, marked(mask.0)),
                _mm256_or_si256(high, marked(mask.1)),
            ]
        })
    }
    #[inline(always)]
    fn some_bits(self, bits: [__m256i; 2]) -> u32 {
        x86!({
            let [low, high] = bits.map(|bits| {
                let none = _mm256_cmpeq_epi64(bits, _mm256_setzero_si256());
                _mm256_movemask_pd(_mm256_castsi256_pd(none)).cast_unsigned()
            });
            !(low | high << 4) & 0xff
        })
    }
    #[inline(always)]
    fn bits_of(self, [low, high]: [__m256i; 2]) -> [u64; 8] {
        let mut out = [0; 8];
        x86!({
            _mm256_storeu_si256(out.as_mut_ptr().cast(), low);
            _mm256_storeu_si256(out.as_mut_ptr().add(4).cast(), high);
        });
        out
    }
    #[inline(always)]
    fn less16(self, x: Pair, by: f64) -> Pair {
        Pair(less8(x.0, by), less8(x.1, by))
    }
    #[inline(always)]
    fn mask16(self, bits: u32) -> PairMask {
        PairMask(mask8(bits), mask8(bits >> 8))
    }
    #[inline(always)]
    fn spread(self, bits: u32, places: u64) -> u64 {
        scalar::spread(bits, places)
    }
    #[inline(always)]
    fn rows(self, plane: &[f32], at: [usize; 4]) -> [Pair; 2] {
        rows(plane, at)
    }
    #[inline(always)]
    fn long_rows(self, plane: &[f32], at: [usize; 2]) -> [Pair; 2] {
        long_rows(plane, at)
    }
    #[inline(always)]
    fn least_of_fours(self, a: Pair, b: Pair) -> F256 {
        fours256!(_mm256_min_ps, a, b)
    }
    #[inline(always)]
    fn most_of_fours(self, a: Pair, b: Pair) -> F256 {
        fours256!(_mm256_max_ps, a, b)
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
    fn lattice(self, floats: &[f32], first: usize, stride: usize) -> Pair {
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
    ) -> [[Pair; 3]; KEYS] {
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
        scalar::corners(l)
    }
    #[inline(always)]
    fn triangles(self, Pair(F256(near), F256(far)): Pair) -> [Pair; 3] {
        // The rows' ends are in `far`'s upper half.
        let (next, ends0, ends1) = x86!((
            _mm256_permute2f128_ps::<0x21>(near, far),
            _mm256_permutevar8x32_ps(far, _mm256_setr_epi32(0, 0, 0, 4, 0, 0, 0, 5)),
            _mm256_permutevar8x32_ps(far, _mm256_setr_epi32(0, 0, 0, 5, 0, 0, 0, 6))
        ));
        let (a, d) = (F256(near), F256(next));
        let (b, c) = (right(near, ends0), right(next, ends1));
        [Pair(a, a), Pair(b, c), Pair(c, d)]
    }
}
