//! AVX2 with FMA, and AVX-512.
//!
//! Vectors of these types are made by [`Avx2`] and [`Avx512`] alone, and those by [`run_avx2`] and
//! [`run_avx512`] alone, after the processor was asked. That is what every `unsafe` below rests on.
#![allow(unsafe_code)]

use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Mul, Neg, Sub};

use super::{Float, Kernel, Mask, Part, Simd};

pub(crate) fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("fma")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
        && is_x86_feature_detected!("lzcnt")
        && is_x86_feature_detected!("popcnt")
}

pub(crate) fn has_avx512() -> bool {
    has_avx2()
        && is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl")
}

#[inline]
pub(crate) fn run_avx2<K: Kernel>(kernel: K) -> K::Output {
    // SAFETY: `Level` holds this set only where `has_avx2` said so.
    unsafe { avx2(kernel) }
}

#[inline]
pub(crate) fn run_avx512<K: Kernel>(kernel: K) -> K::Output {
    // SAFETY: `Level` holds this set only where `has_avx512` said so.
    unsafe { avx512(kernel) }
}

#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run(Avx2(()))
}

#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512bw,avx512dq,avx512vl")]
fn avx512<K: Kernel>(kernel: K) -> K::Output {
    kernel.run(Avx512(()))
}

#[inline(never)]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn avx2_apart<P: Part<Avx2>>(part: P) -> P::Output {
    part.run(Avx2(()))
}

#[inline(never)]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512bw,avx512dq,avx512vl")]
fn avx512_apart<P: Part<Avx512>>(part: P) -> P::Output {
    part.run(Avx512(()))
}

/// An expression of intrinsics.
macro_rules! x86 {
    ($e:expr) => {{
        // SAFETY: the instructions exist, as the module's text says; pointers come from references to
        // arrays of the size that is read or written.
        unsafe { $e }
    }};
}

/// AVX2 with FMA.
#[derive(Clone, Copy, Debug)]
pub struct Avx2(());

/// AVX-512 (F, BW, DQ, VL).
#[derive(Clone, Copy, Debug)]
pub struct Avx512(());

/// 8 floats.
#[derive(Clone, Copy, Debug)]
pub struct F256(__m256);

/// Truth values of 8 floats: all bits of a lane, or none.
#[derive(Clone, Copy, Debug)]
pub struct M256(__m256);

/// 16 floats in two registers.
#[derive(Clone, Copy, Debug)]
pub struct Pair(F256, F256);

/// Truth values of a [`Pair`].
#[derive(Clone, Copy, Debug)]
pub struct PairMask(M256, M256);

/// 16 floats.
#[derive(Clone, Copy, Debug)]
pub struct F512(__m512);

/// Truth values of 16 floats, one a bit.
#[derive(Clone, Copy, Debug)]
pub struct M512(__mmask16);

macro_rules! operators {
    ($type:ty, |$a:ident, $b:ident| $add:expr, $sub:expr, $mul:expr, $neg:expr) => {
        impl Add for $type {
            type Output = Self;
            #[inline(always)]
            fn add(self, $b: Self) -> Self {
                let $a = self;
                $add
            }
        }
        impl Sub for $type {
            type Output = Self;
            #[inline(always)]
            fn sub(self, $b: Self) -> Self {
                let $a = self;
                $sub
            }
        }
        impl Mul for $type {
            type Output = Self;
            #[inline(always)]
            fn mul(self, $b: Self) -> Self {
                let $a = self;
                $mul
            }
        }
        impl Neg for $type {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                let $a = self;
                $neg
            }
        }
    };
}

operators!(
    F256,
    |a, b| x86!(F256(_mm256_add_ps(a.0, b.0))),
    x86!(F256(_mm256_sub_ps(a.0, b.0))),
    x86!(F256(_mm256_mul_ps(a.0, b.0))),
    x86!(F256(_mm256_xor_ps(a.0, _mm256_set1_ps(-0.0))))
);
operators!(
    Pair,
    |a, b| Pair(a.0 + b.0, a.1 + b.1),
    Pair(a.0 - b.0, a.1 - b.1),
    Pair(a.0 * b.0, a.1 * b.1),
    Pair(-a.0, -a.1)
);
operators!(
    F512,
    |a, b| x86!(F512(_mm512_add_ps(a.0, b.0))),
    x86!(F512(_mm512_sub_ps(a.0, b.0))),
    x86!(F512(_mm512_mul_ps(a.0, b.0))),
    x86!(F512(_mm512_xor_ps(a.0, _mm512_set1_ps(-0.0))))
);

macro_rules! mask {
    ($type:ty, |$a:ident, $b:ident| $and:expr, $or:expr, $bits:expr) => {
        impl BitAnd for $type {
            type Output = Self;
            #[inline(always)]
            fn bitand(self, $b: Self) -> Self {
                let $a = self;
                $and
            }
        }
        impl BitOr for $type {
            type Output = Self;
            #[inline(always)]
            fn bitor(self, $b: Self) -> Self {
                let $a = self;
                $or
            }
        }
        impl Mask for $type {
            #[inline(always)]
            fn bits(self) -> u32 {
                let $a = self;
                $bits
            }
        }
    };
}

mask!(
    M256,
    |a, b| x86!(M256(_mm256_and_ps(a.0, b.0))),
    x86!(M256(_mm256_or_ps(a.0, b.0))),
    x86!(_mm256_movemask_ps(a.0)).cast_unsigned()
);
mask!(
    PairMask,
    |a, b| PairMask(a.0 & b.0, a.1 & b.1),
    PairMask(a.0 | b.0, a.1 | b.1),
    a.0.bits() | a.1.bits() << 8
);
mask!(
    M512,
    |a, b| M512(a.0 & b.0),
    M512(a.0 | b.0),
    u32::from(a.0)
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
fn all8(x: f32) -> F256 {
    x86!(F256(_mm256_set1_ps(x)))
}

#[inline(always)]
fn from8(x: &[f32; 8]) -> F256 {
    x86!(F256(_mm256_loadu_ps(x.as_ptr())))
}

#[inline(always)]
fn bytes8(x: &[u8; 8]) -> F256 {
    x86!({
        let bytes = _mm_loadl_epi64(x.as_ptr().cast());
        F256(_mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(bytes)))
    })
}

/// As [`Simd::columns`] says: a shift brings bit `c` of each byte to its top.
#[inline(always)]
fn columns(rows: &[u8; 16]) -> [u32; 8] {
    x86!({
        let rows = _mm_loadu_si128(rows.as_ptr().cast());
        let column = |x: __m128i| _mm_movemask_epi8(x).cast_unsigned();
        [
            column(_mm_slli_epi16::<7>(rows)),
            column(_mm_slli_epi16::<6>(rows)),
            column(_mm_slli_epi16::<5>(rows)),
            column(_mm_slli_epi16::<4>(rows)),
            column(_mm_slli_epi16::<3>(rows)),
            column(_mm_slli_epi16::<2>(rows)),
            column(_mm_slli_epi16::<1>(rows)),
            column(rows),
        ]
    })
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

#[inline(always)]
fn mask8(bits: u32) -> M256 {
    x86!({
        let lane = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
        let set = _mm256_and_si256(_mm256_set1_epi32(bits.cast_signed()), lane);
        M256(_mm256_castsi256_ps(_mm256_cmpeq_epi32(set, lane)))
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

#[inline(always)]
fn row(plane: &[f32], at: usize) -> &[f32; 5] {
    plane[at..].first_chunk().expect("a row of 5 floats")
}

/// Rows of a lattice, as [`Simd::lattice`] says: the first 8 lanes, and the last.
#[inline(always)]
fn lattice(plane: &[f32], first: usize, stride: usize) -> (__m256, __m256) {
    let (r0, r1, r2) = (
        row(plane, first),
        row(plane, first + stride),
        row(plane, first + 2 * stride),
    );
    x86!({
        let near = _mm256_insertf128_ps::<1>(
            _mm256_castps128_ps256(_mm_loadu_ps(r0.as_ptr())),
            _mm_loadu_ps(r1.as_ptr()),
        );
        let ends = _mm_insert_ps::<0x10>(_mm_load_ss(&r0[4]), _mm_load_ss(&r1[4]));
        let ends = _mm_insert_ps::<0x20>(ends, _mm_load_ss(&r2[4]));
        let far =
            _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(_mm_loadu_ps(r2.as_ptr())), ends);
        (near, far)
    })
}

/// 4 floats from each of 2 places.
///
/// # Safety
/// 4 floats can be read from both.
#[inline(always)]
unsafe fn two_rows(a: *const f32, b: *const f32) -> F256 {
    // SAFETY: as above.
    unsafe {
        let near = _mm256_castps128_ps256(_mm_loadu_ps(a));
        F256(_mm256_insertf128_ps::<1>(near, _mm_loadu_ps(b)))
    }
}

/// 4 floats from each of 4 places, and the 4 that begin one later.
#[inline(always)]
fn rows(plane: &[f32], at: [usize; 4]) -> [Pair; 2] {
    let last = at[0].max(at[1]).max(at[2].max(at[3]));
    assert!(plane.len() >= 5 && last <= plane.len() - 5);
    // SAFETY: the fifth float from each place is in the plane.
    unsafe {
        let (a, b) = (plane.as_ptr().add(at[0]), plane.as_ptr().add(at[1]));
        let (c, d) = (plane.as_ptr().add(at[2]), plane.as_ptr().add(at[3]));
        [
            Pair(two_rows(a, b), two_rows(c, d)),
            Pair(two_rows(a.add(1), b.add(1)), two_rows(c.add(1), d.add(1))),
        ]
    }
}

/// 8 floats from each of 2 places, and the 8 that begin one later.
#[inline(always)]
fn long_rows(plane: &[f32], at: [usize; 2]) -> [Pair; 2] {
    assert!(plane.len() >= 9 && at[0].max(at[1]) <= plane.len() - 9);
    // SAFETY: AVX is there, as the module's text says; the ninth float from each place is in the plane.
    unsafe {
        let (a, b) = (plane.as_ptr().add(at[0]), plane.as_ptr().add(at[1]));
        [
            Pair(F256(_mm256_loadu_ps(a)), F256(_mm256_loadu_ps(b))),
            Pair(
                F256(_mm256_loadu_ps(a.add(1))),
                F256(_mm256_loadu_ps(b.add(1))),
            ),
        ]
    }
}

#[inline(always)]
fn both(x: Pair) -> F512 {
    x86!(F512(_mm512_insertf32x8::<1>(
        _mm512_castps256_ps512(x.0.0),
        x.1.0
    )))
}

#[inline(always)]
fn outward8(low: F256, high: F256) -> [[u8; 8]; 2] {
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

/// Joins the first and third, and the second and fourth of each 4 lanes, then both: `a`'s and `b`'s, in turns,
/// in each half.
macro_rules! joined {
    ($join:ident, $lo:ident, $hi:ident, $swap:ident, $a:expr, $b:expr) => {{
        let t = $join($lo($a, $b), $hi($a, $b));
        $join(t, $swap::<0b01_00_11_10>(t))
    }};
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

impl Simd for Avx2 {
    #[inline(always)]
    fn apart<P: Part<Self>>(self, part: P) -> P::Output {
        x86!(avx2_apart(part))
    }
    type F8 = F256;
    type F16 = Pair;
    type M16 = PairMask;

    #[inline(always)]
    fn all8(self, x: f32) -> F256 {
        all8(x)
    }
    #[inline(always)]
    fn from8(self, x: &[f32; 8]) -> F256 {
        from8(x)
    }
    #[inline(always)]
    fn bytes8(self, x: &[u8; 8]) -> F256 {
        bytes8(x)
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
    fn bytes16(self, low: &[u8; 8], high: &[u8; 8]) -> Pair {
        Pair(bytes8(low), bytes8(high))
    }
    #[inline(always)]
    fn halves(self, low: f32, high: f32) -> Pair {
        Pair(all8(low), all8(high))
    }
    #[inline(always)]
    fn split(self, x: Pair) -> (F256, F256) {
        (x.0, x.1)
    }
    #[inline(always)]
    fn columns(self, rows: &[u8; 16]) -> [u32; 8] {
        columns(rows)
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
    fn lattice(self, plane: &[f32], first: usize, stride: usize) -> Pair {
        let (near, far) = lattice(plane, first, stride);
        Pair(F256(near), F256(far))
    }
    #[inline(always)]
    fn lane(self, column: usize, row: usize) -> usize {
        super::scalar::lane(column, row)
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

/// The 5 of each row of 8 that a lattice keeps, the third row being in the second vector.
const KEPT: [i32; 16] = [0, 1, 2, 3, 4, 8, 9, 10, 11, 12, 16, 17, 18, 19, 20, 20];

/// Lanes of a lattice in rows of 5 at the corners of triangles; see [`Simd::triangles`].
const ROWS: [[i32; 16]; 3] = [
    [0, 1, 2, 3, 5, 6, 7, 8, 0, 1, 2, 3, 5, 6, 7, 8],
    [1, 2, 3, 4, 6, 7, 8, 9, 6, 7, 8, 9, 11, 12, 13, 14],
    [6, 7, 8, 9, 11, 12, 13, 14, 5, 6, 7, 8, 10, 11, 12, 13],
];

/// Lanes `at` of `x`.
#[inline(always)]
fn permuted(at: &[i32; 16], x: F512) -> F512 {
    x86!(F512(_mm512_permutexvar_ps(
        _mm512_loadu_si512(at.as_ptr().cast()),
        x.0
    )))
}

impl Simd for Avx512 {
    #[inline(always)]
    fn apart<P: Part<Self>>(self, part: P) -> P::Output {
        x86!(avx512_apart(part))
    }
    type F8 = F256;
    type F16 = F512;
    type M16 = M512;

    #[inline(always)]
    fn all8(self, x: f32) -> F256 {
        all8(x)
    }
    #[inline(always)]
    fn from8(self, x: &[f32; 8]) -> F256 {
        from8(x)
    }
    #[inline(always)]
    fn bytes8(self, x: &[u8; 8]) -> F256 {
        bytes8(x)
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
    fn bytes16(self, low: &[u8; 8], high: &[u8; 8]) -> F512 {
        x86!({
            let low = _mm_loadl_epi64(low.as_ptr().cast());
            let high = _mm_loadl_epi64(high.as_ptr().cast());
            let bytes = _mm_unpacklo_epi64(low, high);
            F512(_mm512_cvtepi32_ps(_mm512_cvtepu8_epi32(bytes)))
        })
    }
    #[inline(always)]
    fn halves(self, low: f32, high: f32) -> F512 {
        x86!(F512(_mm512_mask_blend_ps(
            0xff00,
            _mm512_set1_ps(low),
            _mm512_set1_ps(high)
        )))
    }
    #[inline(always)]
    fn split(self, x: F512) -> (F256, F256) {
        x86!((
            F256(_mm512_castps512_ps256(x.0)),
            F256(_mm512_extractf32x8_ps::<1>(x.0))
        ))
    }
    #[inline(always)]
    fn columns(self, rows: &[u8; 16]) -> [u32; 8] {
        columns(rows)
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
    fn lattice(self, plane: &[f32], first: usize, stride: usize) -> F512 {
        assert!(stride < 1 << 16 && first < plane.len());
        assert!(first + 2 * stride + 8 <= plane.len());
        // Rows of 8, of which 5 are kept: lanes 0 to 4, 5 to 9 and 10 to 14. Fewer of such loads lie
        // across two lines of the cache than of wider ones.
        // SAFETY: AVX-512 is there; the 8 floats of each row are in `plane`.
        unsafe {
            let p = plane.as_ptr().wrapping_add(first);
            let near = _mm512_castps256_ps512(_mm256_loadu_ps(p));
            let near = _mm512_insertf32x8::<1>(near, _mm256_loadu_ps(p.wrapping_add(stride)));
            let far = _mm512_castps256_ps512(_mm256_loadu_ps(p.wrapping_add(2 * stride)));
            let lanes = _mm512_loadu_si512(KEPT.as_ptr().cast());
            F512(_mm512_permutex2var_ps(near, lanes, far))
        }
    }
    #[inline(always)]
    fn lane(self, column: usize, row: usize) -> usize {
        5 * row + column
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
