//! The twin in plain Rust: what the other levels are tested against. Nothing depends on inlining here.

use std::ops::{Add, BitAnd, BitOr, Mul, Neg, Sub};

use super::{Float, Mask, Part, Simd};

/// No instructions beyond those of the target.
#[derive(Clone, Copy, Debug)]
pub struct Scalar;

/// `N` floats.
#[derive(Clone, Copy, Debug)]
pub struct Array<const N: usize>([f32; N]);

/// Truth values, a word a lane: all its bits, or none. Compilers make vectors of that, of single bits they do not.
#[derive(Clone, Copy, Debug)]
pub struct Words<const N: usize>([u32; N]);

impl<const N: usize> Mask for Words<N> {
    #[inline]
    fn bits(self) -> u32 {
        let bit = |(i, word): (usize, u32)| word & 1 << i;
        self.0.into_iter().enumerate().map(bit).sum()
    }
}

impl<const N: usize> BitAnd for Words<N> {
    type Output = Self;
    #[inline]
    fn bitand(self, o: Self) -> Self {
        Words(std::array::from_fn(|i| self.0[i] & o.0[i]))
    }
}

impl<const N: usize> BitOr for Words<N> {
    type Output = Self;
    #[inline]
    fn bitor(self, o: Self) -> Self {
        Words(std::array::from_fn(|i| self.0[i] | o.0[i]))
    }
}

impl<const N: usize> Array<N> {
    #[inline]
    fn each(self, o: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Array(std::array::from_fn(|i| f(self.0[i], o.0[i])))
    }
    #[inline]
    fn compare(self, o: Self, f: impl Fn(f32, f32) -> bool) -> Words<N> {
        let word = |i: usize| if f(self.0[i], o.0[i]) { u32::MAX } else { 0 };
        Words(std::array::from_fn(word))
    }
}

macro_rules! operator {
    ($name:ident, $function:ident, $op:tt) => {
        impl<const N: usize> $name for Array<N> {
            type Output = Self;
            #[inline]
            fn $function(self, o: Self) -> Self {
                self.each(o, |a, b| a $op b)
            }
        }
    };
}

operator!(Add, add, +);
operator!(Sub, sub, -);
operator!(Mul, mul, *);

impl<const N: usize> Neg for Array<N> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Array(self.0.map(|x| -x))
    }
}

impl<const N: usize> Float<N> for Array<N> {
    type Mask = Words<N>;
    #[inline]
    fn to_array(self) -> [f32; N] {
        self.0
    }
    #[inline]
    fn min(self, o: Self) -> Self {
        self.each(o, |a, b| if a < b { a } else { b })
    }
    #[inline]
    fn max(self, o: Self) -> Self {
        self.each(o, |a, b| if a > b { a } else { b })
    }
    #[inline]
    fn mul_add(self, by: Self, plus: Self) -> Self {
        self * by + plus
    }
    #[inline]
    fn over(self, by: Self) -> Self {
        self.each(by, |a, b| a / b)
    }
    #[inline]
    fn sqrt(self) -> Self {
        Array(self.0.map(f32::sqrt))
    }
    #[inline]
    fn abs(self) -> Self {
        Array(self.0.map(f32::abs))
    }
    #[inline]
    fn lt(self, o: Self) -> Words<N> {
        self.compare(o, |a, b| a < b)
    }
    #[inline]
    fn le(self, o: Self) -> Words<N> {
        self.compare(o, |a, b| a <= b)
    }
    #[inline]
    fn or(self, mask: Words<N>, o: Self) -> Self {
        let chosen = |i: usize| {
            let (a, b) = (self.0[i].to_bits(), o.0[i].to_bits());
            f32::from_bits(a & mask.0[i] | b & !mask.0[i])
        };
        Array(std::array::from_fn(chosen))
    }
    #[inline]
    fn least(self) -> f32 {
        self.0.into_iter().fold(f32::INFINITY, f32::min)
    }
    #[inline]
    fn most(self) -> f32 {
        self.0.into_iter().fold(f32::NEG_INFINITY, f32::max)
    }
}

#[inline(never)]
fn apart<P: Part<Scalar>>(part: P) -> P::Output {
    part.run(Scalar)
}

impl Simd for Scalar {
    const WIDE: bool = false;
    fn apart<P: Part<Self>>(self, part: P) -> P::Output {
        apart(part)
    }
    type F8 = Array<8>;
    type F16 = Array<16>;
    type M16 = Words<16>;
    type Bits = [u64; 8];

    #[inline]
    fn all8(self, x: f32) -> Array<8> {
        Array([x; 8])
    }
    #[inline]
    fn from8(self, x: &[f32; 8]) -> Array<8> {
        Array(*x)
    }
    #[inline]
    fn halves_swapped(self, x: Array<8>) -> Array<8> {
        Array(std::array::from_fn(|i| x.0[i ^ 4]))
    }
    #[inline]
    fn transposed(self, x: [Array<8>; 8]) -> [Array<8>; 8] {
        std::array::from_fn(|i| Array(std::array::from_fn(|k| x[k].0[i])))
    }
    #[inline]
    fn columns(self, rows: [&[f32; 8]; 16]) -> [Array<16>; 8] {
        std::array::from_fn(|i| Array(rows.map(|row| row[i])))
    }
    #[inline]
    fn unzipped(self, pairs: [&[f32; 2]; 16]) -> [Array<16>; 2] {
        [0, 1].map(|i: usize| Array(pairs.map(|pair| pair[i])))
    }
    #[inline]
    fn unzipped8(self, pairs: [&[f32; 2]; 8]) -> [Array<8>; 2] {
        [0, 1].map(|i: usize| Array(pairs.map(|pair| pair[i])))
    }
    #[inline]
    fn mask8(self, bits: u32) -> Words<8> {
        words(bits)
    }
    #[inline]
    fn high_bits(self, x: &[u32; 8]) -> u32 {
        x.iter().rev().fold(0, |bits, x| bits << 1 | x >> 31)
    }
    #[inline]
    fn bytes8(self, x: &[u8; 8]) -> Array<8> {
        Array(x.map(f32::from))
    }
    #[inline]
    fn halves(self, first: Array<8>, last: Array<8>) -> Array<16> {
        Array(std::array::from_fn(|i| [first, last][i / 8].0[i % 8]))
    }
    #[inline]
    fn of_halves(self, x: Array<16>) -> [Array<8>; 2] {
        [0, 8].map(|first| Array(std::array::from_fn(|i| x.0[first + i])))
    }
    #[inline]
    fn quarters(self, x: &[f32; 4]) -> Array<16> {
        Array(std::array::from_fn(|i| x[i % 4]))
    }
    #[inline]
    fn over_quarters<const LANE: usize>(self, x: Array<16>) -> Array<16> {
        Array(std::array::from_fn(|i| x.0[i / 4 * 4 + LANE % 4]))
    }
    #[inline]
    fn bytes16(self, x: &[[u8; 8]; 2], order: &[u8; 16]) -> Array<16> {
        let x = x.as_flattened();
        Array(order.map(|i| f32::from(x[usize::from(i & 15)])))
    }
    #[inline]
    fn kept(
        self,
        mask: u32,
        x: Array<8>,
        words: &[u32; 8],
        to: &mut [f32; 8],
        words_to: &mut [u32; 8],
    ) {
        let kept = (0..8).filter(|i| mask >> i & 1 == 1);
        for (k, i) in kept.enumerate() {
            (to[k], words_to[k]) = (x.0[i], words[i]);
        }
    }
    #[inline]
    fn falling(
        self,
        mask: u32,
        x: Array<8>,
        words: &[u32; 8],
        to: &mut [f32; 8],
        words_to: &mut [u32; 8],
    ) {
        let mut keys = [0; 8];
        let mut count = 0;
        for i in (0..8).filter(|i| mask >> i & 1 == 1) {
            // Sorted in as they come.
            let key = x.0[i].to_bits() & !7 | i as u32;
            let at = keys[..count]
                .iter()
                .take_while(|&&other| other > key)
                .count();
            keys[at..=count].rotate_right(1);
            keys[at] = key;
            count += 1;
        }
        for (k, key) in keys[..count].iter().enumerate() {
            let i = *key as usize & 7;
            (to[k], words_to[k]) = (x.0[i], words[i]);
        }
    }
    #[inline]
    fn all16(self, x: f32) -> Array<16> {
        Array([x; 16])
    }
    #[inline]
    fn from16(self, x: &[f32; 16]) -> Array<16> {
        Array(*x)
    }
    #[inline]
    fn bytes_in_turns(self, even: &[u8; 8], odd: &[u8; 8]) -> Array<16> {
        Array(std::array::from_fn(|i| {
            f32::from([even, odd][i % 2][i / 2])
        }))
    }
    #[inline]
    fn in_turns(self, pair: &[f32; 2]) -> Array<16> {
        Array(std::array::from_fn(|i| pair[i % 2]))
    }
    #[inline]
    fn swapped(self, x: Array<16>) -> Array<16> {
        Array(std::array::from_fn(|i| x.0[i ^ 1]))
    }
    #[inline]
    fn zip(self, even: Array<16>, odd: Array<16>) -> [Array<16>; 2] {
        [0, 8].map(|first| Array(std::array::from_fn(|i| [even, odd][i % 2].0[first + i / 2])))
    }
    #[inline]
    fn in_pairs(self, even: Array<8>, odd: Array<8>) -> Array<16> {
        Array(std::array::from_fn(|i| [even, odd][i % 2].0[i / 2]))
    }
    #[inline]
    fn no_bits(self) -> [u64; 8] {
        [0; 8]
    }
    #[inline]
    fn more_bits(self, bits: [u64; 8], mask: Words<16>, more: usize) -> [u64; 8] {
        let more = 1u64 << (more & 63);
        let words = |i: usize| u64::from(mask.0[2 * i]) | u64::from(mask.0[2 * i + 1]) << 32;
        std::array::from_fn(|i| bits[i] | words(i) & more)
    }
    #[inline]
    fn some_bits(self, bits: [u64; 8]) -> u32 {
        let some = |(i, &bits): (usize, &u64)| u32::from(bits != 0) << i;
        bits.iter().enumerate().map(some).sum()
    }
    #[inline]
    fn bits_of(self, bits: [u64; 8]) -> [u64; 8] {
        bits
    }
    #[inline]
    fn less16(self, x: Array<16>, by: f64) -> Array<16> {
        Array(x.0.map(|x| (f64::from(x) - by) as f32))
    }
    #[inline]
    fn mask16(self, bits: u32) -> Words<16> {
        words(bits)
    }
    #[inline]
    fn spread(self, bits: u32, places: u64) -> u64 {
        spread(bits, places)
    }
    #[inline]
    fn rows(self, plane: &[f32], at: [usize; 4]) -> [Array<16>; 2] {
        let at = |later: usize| {
            Array(std::array::from_fn(|i| {
                plane[at[i / 4]..][..5][i % 4 + later]
            }))
        };
        [at(0), at(1)]
    }
    #[inline]
    fn long_rows(self, plane: &[f32], at: [usize; 2]) -> [Array<16>; 2] {
        let at = |later: usize| {
            Array(std::array::from_fn(|i| {
                plane[at[i / 8]..][..9][i % 8 + later]
            }))
        };
        [at(0), at(1)]
    }
    #[inline]
    fn least_of_fours(self, a: Array<16>, b: Array<16>) -> Array<8> {
        fours(a, b, Array::min)
    }
    #[inline]
    fn most_of_fours(self, a: Array<16>, b: Array<16>) -> Array<8> {
        fours(a, b, Array::max)
    }
    #[inline]
    fn outward8(self, low: Array<8>, high: Array<8>) -> [[u8; 8]; 2] {
        // Casts saturate.
        [
            low.0.map(|x| x.floor() as u8),
            high.0.map(|x| x.ceil() as u8),
        ]
    }
    #[inline(always)]
    fn expect<T>(self, _: &[T], _: usize) {}
    #[inline(always)]
    fn expect_lattices<const KEYS: usize>(self, _: &[f32], _: usize, _: usize, _: usize) {}
    #[inline]
    fn lattice(self, floats: &[f32], first: usize, stride: usize) -> Array<16> {
        let mut out = [0.0; 16];
        for row in 0..3 {
            let at = first + row * stride;
            let row5 = &floats[at..at + 5];
            out[4 * row..4 * row + 4].copy_from_slice(&row5[..4]);
            out[12 + row] = row5[4];
        }
        Array(out)
    }
    #[inline]
    fn lattices<const KEYS: usize>(
        self,
        floats: &[f32],
        first: usize,
        columns: usize,
        key: usize,
        axes: [usize; 3],
    ) -> [[Array<16>; 3]; KEYS] {
        std::array::from_fn(|k| {
            axes.map(|axis| self.lattice(floats, first + k * key + axis * columns, 3 * columns))
        })
    }
    #[inline]
    fn corners(self, l: usize) -> [usize; 3] {
        corners(l)
    }
    #[inline]
    fn triangles(self, lattice: Array<16>) -> [Array<16>; 3] {
        TRIANGLES.map(|corner| Array(corner.map(|i| lattice.0[i as usize])))
    }
}

#[inline]
fn words<const N: usize>(bits: u32) -> Words<N> {
    let word = |i: usize| if bits >> i & 1 == 1 { u32::MAX } else { 0 };
    Words(std::array::from_fn(word))
}

/// Each bit in turn. What AVX2 does, too: its instruction for it is slow on some processors that have no AVX-512.
#[inline(always)]
pub(crate) fn spread(mut bits: u32, mut places: u64) -> u64 {
    let mut out = 0;
    while bits != 0 && places != 0 {
        let place = places & places.wrapping_neg();
        out |= place & (u64::from(bits & 1)).wrapping_neg();
        (bits, places) = (bits >> 1, places ^ place);
    }
    out
}

/// Each 4 lanes of `a`, then of `b`, joined: the first with the third, the second with the fourth, and both.
#[inline]
fn fours(a: Array<16>, b: Array<16>, join: impl Fn(Array<8>, Array<8>) -> Array<8>) -> Array<8> {
    let lanes = |k: usize| {
        Array(std::array::from_fn(|i| {
            let from = if i < 4 { &a } else { &b };
            from.0[i % 4 * 4 + k]
        }))
    };
    join(join(lanes(0), lanes(2)), join(lanes(1), lanes(3)))
}

/// Lanes of a lattice at the corners of triangles; see [`Simd::triangles`].
pub(crate) static TRIANGLES: [[i32; 16]; 3] = [
    [0, 1, 2, 3, 4, 5, 6, 7, 0, 1, 2, 3, 4, 5, 6, 7],
    [1, 2, 3, 12, 5, 6, 7, 13, 5, 6, 7, 13, 9, 10, 11, 14],
    [5, 6, 7, 13, 9, 10, 11, 14, 4, 5, 6, 7, 8, 9, 10, 11],
];

#[inline(always)]
pub(crate) fn corners(l: usize) -> [usize; 3] {
    let [a, b, c] = &TRIANGLES;
    [a[l & 15] as usize, b[l & 15] as usize, c[l & 15] as usize]
}
