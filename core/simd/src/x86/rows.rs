//! Rows of floats as they lie in memory, joined into vectors.

use std::arch::x86_64::*;

use super::avx2::Pair;
use super::eight::F256;

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
pub(super) fn rows(plane: &[f32], at: [usize; 4]) -> [Pair; 2] {
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
pub(super) fn long_rows(plane: &[f32], at: [usize; 2]) -> [Pair; 2] {
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

/// Floats from the start of a lattice's last row to the end of what may be read of it.
pub(super) const ROW: usize = 8;

/// # Panics
/// A lattice that begins at `first`, or up to the sum of both numbers of floats later, is not in `floats`.
#[inline(always)]
pub(super) fn within(floats: &[f32], first: usize, stride: usize, later: (usize, usize)) {
    // So no sum below wraps.
    assert!(stride < 1 << 16 && later.0.max(later.1) < 1 << 16 && first < floats.len());
    assert!(first + later.0 + later.1 + 2 * stride + ROW <= floats.len());
}

/// Rows of a lattice, x, y and z of each.
const LATTICE_ROWS: usize = 9;

/// Brings the rows of a lattice at one key nearer, as [`Simd::expect_lattices`](crate::Simd::expect_lattices) says.
#[inline(always)]
pub(super) fn expect_lattice(floats: &[f32], first: usize, columns: usize) {
    let row = floats.as_ptr().wrapping_add(first);
    // What may be asked for of a narrow one is whole.
    let all = LATTICE_ROWS * columns;
    let (step, last) = match all * size_of::<f32>() <= 2 * LINE {
        true => (LINE / size_of::<f32>(), all - 1),
        false => (columns, all - columns),
    };
    let mut at = 0;
    while at < last {
        // SAFETY: a hint reads nothing, wherever it points.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(row.wrapping_add(at).cast()) };
        at += step;
    }
    // SAFETY: as above.
    unsafe { _mm_prefetch::<_MM_HINT_T0>(row.wrapping_add(last).cast()) };
}

/// Bytes of a line of the processor's caches.
const LINE: usize = 64;

/// Brings all of `from[at]` nearer, as [`Simd::expect`](crate::Simd::expect) says.
#[inline(always)]
pub(super) fn expect<T>(from: &[T], at: usize) {
    let first = from.as_ptr().wrapping_add(at).cast::<i8>();
    let mut by = 0;
    while by < size_of::<T>() {
        // SAFETY: a hint reads nothing, wherever it points.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(first.wrapping_add(by)) };
        by += LINE;
    }
    // Where it does not begin with a line it may end in one more.
    if size_of::<T>() > align_of::<T>() {
        // SAFETY: as above.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(first.wrapping_add(size_of::<T>() - 1)) };
    }
}
