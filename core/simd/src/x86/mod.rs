//! AVX2 with FMA, and AVX-512.
//!
//! Vectors of these types are made by [`Avx2`] and [`Avx512`] alone, and those by [`run_avx2`] and
//! [`run_avx512`] alone, after the processor was asked. That is what every `unsafe` here and below rests on.
#![allow(unsafe_code)]

/// An expression of intrinsics.
macro_rules! x86 {
    ($e:expr) => {{
        // SAFETY: the instructions exist, as the module's text says; pointers come from references to
        // arrays of the size that is read or written.
        unsafe { $e }
    }};
}

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

/// Joins the first and third, and the second and fourth of each 4 lanes, then both: `a`'s and `b`'s, in turns,
/// in each half.
macro_rules! joined {
    ($join:ident, $lo:ident, $hi:ident, $swap:ident, $a:expr, $b:expr) => {{
        let t = $join($lo($a, $b), $hi($a, $b));
        $join(t, $swap::<0b01_00_11_10>(t))
    }};
}

mod avx2;
mod avx512;
mod eight;
mod rows;

use avx2::Avx2;
use avx512::Avx512;

use super::{Kernel, Part};

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
