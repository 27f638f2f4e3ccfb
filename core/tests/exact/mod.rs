//! Exact arithmetic for oracles: sums of f64 that are never rounded (Shewchuk, "Adaptive Precision
//! Floating-Point Arithmetic and Fast Robust Geometric Predicates", 1997). Sums, differences and products of f32
//! come out exactly, as long as no term leaves f64's range of exponents: nine factors of f32 do not.
#![allow(dead_code)]

use std::ops::{Add, Mul, Neg, Sub};

/// A number: the sum of its terms, which do not overlap, the smallest first.
#[derive(Clone, Debug, Default)]
pub struct Exact(Vec<f64>);

/// `a + b` and what is lost of it.
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let of_b = sum - a;
    (sum, (a - (sum - of_b)) + (b - of_b))
}

/// `a b` and what is lost of it.
fn two_product(a: f64, b: f64) -> (f64, f64) {
    let split = |x: f64| {
        let high = f64::from_bits(x.to_bits() & !((1 << 27) - 1));
        (high, x - high)
    };
    let product = a * b;
    let ((ah, al), (bh, bl)) = (split(a), split(b));
    (
        product,
        (((ah * bh - product) + ah * bl) + al * bh) + al * bl,
    )
}

impl Exact {
    fn push(&mut self, x: f64) {
        let mut carry = x;
        self.0.retain_mut(|term| {
            let (sum, lost) = two_sum(carry, *term);
            (carry, *term) = (sum, lost);
            lost != 0.0
        });
        if carry != 0.0 {
            self.0.push(carry);
        }
    }

    /// The nearest f64, nearly; its sign is right.
    pub fn value(&self) -> f64 {
        self.0.iter().sum()
    }

    /// A product of two f32, or of anything else whose product needs no more than 106 bits.
    pub fn product(a: f64, b: f64) -> Exact {
        let (high, low) = two_product(a, b);
        let mut out = Exact::from(low);
        out.push(high);
        out
    }
}

impl From<f64> for Exact {
    fn from(x: f64) -> Self {
        Exact(if x == 0.0 { Vec::new() } else { vec![x] })
    }
}

impl From<f32> for Exact {
    fn from(x: f32) -> Self {
        f64::from(x).into()
    }
}

impl Add for Exact {
    type Output = Exact;
    fn add(mut self, o: Exact) -> Exact {
        o.0.into_iter().for_each(|x| self.push(x));
        self
    }
}

impl Neg for Exact {
    type Output = Exact;
    fn neg(mut self) -> Exact {
        self.0.iter_mut().for_each(|x| *x = -*x);
        self
    }
}

impl Sub for Exact {
    type Output = Exact;
    fn sub(self, o: Exact) -> Exact {
        self + -o
    }
}

impl Mul for Exact {
    type Output = Exact;
    fn mul(self, o: Exact) -> Exact {
        let mut out = Exact::default();
        for &a in &self.0 {
            for &b in &o.0 {
                let (high, low) = two_product(a, b);
                out.push(low);
                out.push(high);
            }
        }
        out
    }
}

/// `a . b`.
pub fn dot(a: [f32; 3], b: [f32; 3]) -> Exact {
    (0..3).fold(Exact::default(), |sum, i| {
        sum + Exact::product(a[i].into(), b[i].into())
    })
}
