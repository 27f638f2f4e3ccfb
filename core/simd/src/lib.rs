//! Vectors of 8 and 16 floats, for AVX-512, AVX2 and plain Rust, chosen at run time.
//!
//! A computation is written once, generic over [`Simd`], as a [`Kernel`]; [`Level::run`] compiles it
//! for each instruction set and enters the one that was asked for. A [`Simd`] value is proof that its
//! instructions exist, and vectors are made from one: that is why their operations are safe.
//!
//! **Same bits.** Every operation but [`Float::mul_add`] rounds as IEEE 754 says, on every level, and
//! `mul_add` may or may not round its product. So what is computed without it has the same bits on
//! every machine; with it, only results that allow for one rounding more may be computed.
//!
//! Kernels are compiled for a level only as far as they are inlined: functions on the way from
//! [`Kernel::run`] to vector operations carry `#[inline(always)]`.

mod scalar;
#[cfg(target_arch = "x86_64")]
mod x86;

use std::fmt::Debug;
use std::ops::{Add, BitAnd, BitOr, Mul, Neg, Sub};

pub use scalar::Scalar;

/// Lanes of a vector, as truth values.
pub trait Mask: Copy + Debug + BitAnd<Output = Self> + BitOr<Output = Self> {
    /// Bit `i` is lane `i`; bits beyond the lanes are 0.
    fn bits(self) -> u32;
}

/// A vector of `N` f32.
pub trait Float<const N: usize>:
    Copy + Debug + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self>
{
    /// Truth values of its lanes.
    type Mask: Mask;
    /// Its lanes.
    fn to_array(self) -> [f32; N];
    /// The smaller of each pair; `other` where either is NaN.
    fn min(self, other: Self) -> Self;
    /// The larger of each pair; `other` where either is NaN.
    fn max(self, other: Self) -> Self;
    /// `self * by + plus`; whether the product is rounded depends on the level.
    fn mul_add(self, by: Self, plus: Self) -> Self;
    /// Quotients.
    fn over(self, by: Self) -> Self;
    /// Square roots.
    fn sqrt(self) -> Self;
    /// Magnitudes.
    fn abs(self) -> Self;
    /// `self < other`; false for NaN.
    fn lt(self, other: Self) -> Self::Mask;
    /// `self <= other`; false for NaN.
    fn le(self, other: Self) -> Self::Mask;
    /// `self` where `mask` is true, else `other`.
    fn or(self, mask: Self::Mask, other: Self) -> Self;
    /// The smallest lane. None may be NaN.
    fn least(self) -> f32;
    /// The largest lane. None may be NaN.
    fn most(self) -> f32;
}

/// An instruction set, known to be there.
pub trait Simd: Copy + Debug {
    /// True where 16 floats are one register. Twice as many as 8 take no longer then, or as long as 8 twice.
    const WIDE: bool;
    /// Runs a part of a kernel that is compiled on its own, once for all who ask for it: for what is large and
    /// used in several places.
    fn apart<P: Part<Self>>(self, part: P) -> P::Output
    where
        Self: Sized;
    /// 8 floats.
    type F8: Float<8>;
    /// 16 floats.
    type F16: Float<16, Mask = Self::M16>;
    /// Truth values of 16 floats.
    type M16: Mask;
    /// 64 bits in each of 8 pairs of lanes.
    type Bits: Copy + Debug;

    /// 8 copies.
    fn all8(self, x: f32) -> Self::F8;
    /// 8 lanes.
    fn from8(self, x: &[f32; 8]) -> Self::F8;
    /// The last 4 lanes, then the first 4.
    fn halves_swapped(self, x: Self::F8) -> Self::F8;
    /// Vector `i` has lane `i` of each of these.
    fn transposed(self, x: [Self::F8; 8]) -> [Self::F8; 8];
    /// Vector `i` has number `i` of each of these.
    fn columns(self, rows: [&[f32; 8]; 16]) -> [Self::F16; 8];
    /// The first of each pair, and the second.
    fn unzipped(self, pairs: [&[f32; 2]; 16]) -> [Self::F16; 2];
    /// The first of each pair, and the second.
    fn unzipped8(self, pairs: [&[f32; 2]; 8]) -> [Self::F8; 2];
    /// The lanes whose bits are set, of 8.
    fn mask8(self, bits: u32) -> <Self::F8 as Float<8>>::Mask;
    /// The highest bit of each word, from the lowest bit on.
    fn high_bits(self, x: &[u32; 8]) -> u32;
    /// 8 whole numbers from 0 to 255.
    fn bytes8(self, x: &[u8; 8]) -> Self::F8;
    /// 8 lanes, then 8 more.
    fn halves(self, first: Self::F8, last: Self::F8) -> Self::F16;
    /// The first 8 lanes, and the last.
    fn of_halves(self, x: Self::F16) -> [Self::F8; 2];
    /// 4 numbers, four times.
    fn quarters(self, x: &[f32; 4]) -> Self::F16;
    /// Lane `LANE` of each quarter, below 4, all over that quarter.
    fn over_quarters<const LANE: usize>(self, x: Self::F16) -> Self::F16;
    /// 16 whole numbers from 0 to 255, those of `order`: each is below 16.
    fn bytes16(self, x: &[[u8; 8]; 2], order: &[u8; 16]) -> Self::F16;
    /// Writes the lanes of `x` whose bits are set, and those of `words`, to the front, in their order. What is behind them then
    /// is of no use.
    fn kept(
        self,
        mask: u32,
        x: Self::F8,
        words: &[u32; 8],
        to: &mut [f32; 8],
        words_to: &mut [u32; 8],
    );
    /// [`Simd::kept`], the largest first. By their bits, so what has a sign comes before all that has none; what is larger by less
    /// than 8 units in the last place may come after.
    fn falling(
        self,
        mask: u32,
        x: Self::F8,
        words: &[u32; 8],
        to: &mut [f32; 8],
        words_to: &mut [u32; 8],
    );
    /// 16 copies.
    fn all16(self, x: f32) -> Self::F16;
    /// 16 lanes.
    fn from16(self, x: &[f32; 16]) -> Self::F16;
    /// 16 whole numbers from 0 to 255, from each in turns.
    fn bytes_in_turns(self, even: &[u8; 8], odd: &[u8; 8]) -> Self::F16;
    /// 8 copies of a pair.
    fn in_turns(self, pair: &[f32; 2]) -> Self::F16;
    /// The lanes of each pair in the other order.
    fn swapped(self, x: Self::F16) -> Self::F16;
    /// Lanes of one and the other, in turns.
    fn zip(self, even: Self::F16, odd: Self::F16) -> [Self::F16; 2];
    /// Lanes of one and the other, in turns.
    fn in_pairs(self, even: Self::F8, odd: Self::F8) -> Self::F16;
    /// No bits.
    fn no_bits(self) -> Self::Bits;
    /// `bits`, and in the pairs of lanes of `mask` bit number `more`, less than 64. Both lanes of a pair agree.
    fn more_bits(self, bits: Self::Bits, mask: Self::M16, more: usize) -> Self::Bits;
    /// The pairs that have a bit.
    fn some_bits(self, bits: Self::Bits) -> u32;
    /// The bits of each pair.
    fn bits_of(self, bits: Self::Bits) -> [u64; 8];
    /// `x - by` in f64, rounded once.
    fn less16(self, x: Self::F16, by: f64) -> Self::F16;
    /// The lanes whose bits are set.
    fn mask16(self, bits: u32) -> Self::M16;
    /// Bit `i` of `bits` is moved to where `places` has its bit `i`, counted from the lowest; those beyond are lost.
    fn spread(self, bits: u32, places: u64) -> u64;

    /// 4 floats from each of 4 places, and the 4 that begin one later.
    ///
    /// # Panics
    /// `plane` ends before the fifth float of a place.
    fn rows(self, plane: &[f32], at: [usize; 4]) -> [Self::F16; 2];
    /// 8 floats from each of 2 places, and the 8 that begin one later.
    ///
    /// # Panics
    /// `plane` ends before the ninth float of a place.
    fn long_rows(self, plane: &[f32], at: [usize; 2]) -> [Self::F16; 2];
    /// The smallest of each 4 lanes of `a`, then of `b`. None may be NaN.
    fn least_of_fours(self, a: Self::F16, b: Self::F16) -> Self::F8;
    /// The largest of each 4 lanes of `a`, then of `b`. None may be NaN.
    fn most_of_fours(self, a: Self::F16, b: Self::F16) -> Self::F8;
    /// The whole numbers from 0 to 255 that are next, downward from `low` and upward from `high`. None may be
    /// NaN.
    fn outward8(self, low: Self::F8, high: Self::F8) -> [[u8; 8]; 2];

    /// Says that `from[at]` will be asked for soon. There may be no such thing.
    fn expect<T>(self, from: &[T], at: usize);
    /// Says that [`Simd::lattices`] of `KEYS` keys will be asked for soon. They may lie outside of `floats`.
    fn expect_lattices<const KEYS: usize>(
        self,
        floats: &[f32],
        first: usize,
        columns: usize,
        key: usize,
    );
    /// 15 vertices of a lattice, rows of 5 that start at `first`, `first + stride` and
    /// `first + 2 stride`, in lanes of its own: see [`Simd::corners`].
    ///
    /// # Panics
    /// `floats` end less than 3 after the last of them, or `stride` is absurd.
    fn lattice(self, floats: &[f32], first: usize, stride: usize) -> Self::F16;
    /// Lattices of x, y and z in the order of `axes`, at `KEYS` keys. A row of a lattice is `columns` floats of x, then as many
    /// of y and of z; the next row follows, and the next key is `key` floats later. `first` is where the x of the
    /// first vertex is.
    ///
    /// # Panics
    /// As [`Simd::lattice`], or `key` is absurd.
    fn lattices<const KEYS: usize>(
        self,
        floats: &[f32],
        first: usize,
        columns: usize,
        key: usize,
        axes: [usize; 3],
    ) -> [[Self::F16; 3]; KEYS];
    /// Lanes of the corners of triangle `l` of a [`Simd::lattice`], below 16, as [`Simd::triangles`] has them.
    fn corners(self, l: usize) -> [usize; 3];
    /// Corners of 16 triangles of a [`Simd::lattice`], 4 x 2 cells with two each. Lane `l < 8`
    /// is cell `(l % 4, l / 4)`, with corners `(i,j) (i+1,j) (i+1,j+1)`; lane `l + 8` is the same cell with
    /// `(i,j) (i+1,j+1) (i,j+1)`.
    fn triangles(self, lattice: Self::F16) -> [Self::F16; 3];
}

/// A computation, generic over the instruction set.
pub trait Kernel {
    /// What it computes.
    type Output;
    /// Computes it. Give it `#[inline(always)]`.
    fn run<S: Simd>(self, simd: S) -> Self::Output;
}

/// A part of a computation, for one instruction set; see [`Simd::apart`].
pub trait Part<S: Simd> {
    /// What it computes.
    type Output;
    /// Computes it. Give it `#[inline(always)]`.
    fn run(self, simd: S) -> Self::Output;
}

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
enum Set {
    Scalar,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

/// An instruction set that this machine has.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Level(Set);

impl Level {
    /// Plain Rust: everywhere.
    pub const SCALAR: Level = Level(Set::Scalar);

    /// All that this machine has, the slowest first.
    pub fn available() -> Vec<Level> {
        #[allow(unused_mut)]
        let mut levels = vec![Level::SCALAR];
        #[cfg(target_arch = "x86_64")]
        {
            if x86::has_avx2() {
                levels.push(Level(Set::Avx2));
            }
            if x86::has_avx512() {
                levels.push(Level(Set::Avx512));
            }
        }
        levels
    }

    /// The fastest.
    pub fn best() -> Level {
        Self::available().pop().unwrap_or(Level::SCALAR)
    }

    /// `scalar`, `avx2` or `avx512`.
    pub fn name(self) -> &'static str {
        match self.0 {
            Set::Scalar => "scalar",
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => "avx2",
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => "avx512",
        }
    }

    /// Runs a kernel with these instructions.
    #[inline]
    pub fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self.0 {
            Set::Scalar => kernel.run(Scalar),
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => x86::run_avx2(kernel),
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => x86::run_avx512(kernel),
        }
    }
}

#[cfg(test)]
mod tests;
