//! Boxes whose bounds are linear in time over [0, 1]: the build's currency.

use glam::Vec3;

/// A box with bounds `lo0 + (lo1 - lo0) time` and `hi0 + (hi1 - hi0) time`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearBox {
    /// Lower bounds at time 0.
    pub lo0: Vec3,
    /// Upper bounds at time 0.
    pub hi0: Vec3,
    /// Lower bounds at time 1.
    pub lo1: Vec3,
    /// Upper bounds at time 1.
    pub hi1: Vec3,
}

impl LinearBox {
    /// The box of nothing: the neutral element of [`LinearBox::union`].
    pub const EMPTY: LinearBox = LinearBox {
        lo0: Vec3::INFINITY,
        hi0: Vec3::NEG_INFINITY,
        lo1: Vec3::INFINITY,
        hi1: Vec3::NEG_INFINITY,
    };

    /// The smallest box of this kind that contains both: bounds at each end are taken apart, since
    /// the larger of two linear functions lies below its chord.
    #[inline]
    pub fn union(&self, other: &LinearBox) -> LinearBox {
        LinearBox {
            lo0: self.lo0.min(other.lo0),
            hi0: self.hi0.max(other.hi0),
            lo1: self.lo1.min(other.lo1),
            hi1: self.hi1.max(other.hi1),
        }
    }

    /// True when every bound is a finite number.
    pub fn is_finite(&self) -> bool {
        self.lo0.is_finite() && self.hi0.is_finite() && self.lo1.is_finite() && self.hi1.is_finite()
    }

    /// True when the bounds do not move.
    pub fn is_static(&self) -> bool {
        self.lo0 == self.lo1 && self.hi0 == self.hi1
    }

    /// Four times the centre at time 1/2; what the build bins by.
    #[inline]
    pub fn centre4(&self) -> Vec3 {
        (self.lo0 + self.hi0) + (self.lo1 + self.hi1)
    }

    /// Half the surface area, averaged over time; 0 for an empty box. With extents linear in time,
    /// the mean of `x y` over [0, 1] is `(x0 y0 + x1 y1) / 3 + (x0 y1 + x1 y0) / 6`, exactly.
    #[inline]
    pub fn mean_half_area(&self) -> f32 {
        let e0 = (self.hi0 - self.lo0).max(Vec3::ZERO);
        let e1 = (self.hi1 - self.lo1).max(Vec3::ZERO);
        let pair = |a0: f32, a1: f32, b0: f32, b1: f32| {
            (a0 * b0 + a1 * b1) * (1.0 / 3.0) + (a0 * b1 + a1 * b0) * (1.0 / 6.0)
        };
        pair(e0.x, e1.x, e0.y, e1.y) + pair(e0.y, e1.y, e0.z, e1.z) + pair(e0.z, e1.z, e0.x, e1.x)
    }

    /// Largest magnitude of any bound.
    pub fn max_abs(&self) -> f32 {
        let m = self.lo0.abs().max(self.hi0.abs());
        m.max(self.lo1.abs()).max(self.hi1.abs()).max_element()
    }

    /// Widens every bound outward by `by`, rounding outward.
    pub fn widen(&self, by: f32) -> LinearBox {
        let down = |v: Vec3| Vec3::from_array(v.to_array().map(|x| (x - by).next_down()));
        let up = |v: Vec3| Vec3::from_array(v.to_array().map(|x| (x + by).next_up()));
        LinearBox {
            lo0: down(self.lo0),
            hi0: up(self.hi0),
            lo1: down(self.lo1),
            hi1: up(self.hi1),
        }
    }

    /// Raises the bounds, outward, until they contain `[lo, hi]` at the inner time `time`: both ends
    /// move by the excess over the chord, so that what was contained stays so.
    pub fn raise(&mut self, time: f32, lo: Vec3, hi: Vec3) {
        for a in 0..3 {
            let (lo0, lo1) = (&mut self.lo0[a], &mut self.lo1[a]);
            if lo0 == lo1 {
                // A constant chord: nothing is rounded.
                (*lo0, *lo1) = (lo0.min(lo[a]), lo1.min(lo[a]));
            } else {
                let excess = excess(*lo0, *lo1, time, lo[a], -1.0);
                if excess > 0.0 {
                    *lo0 = round_down(f64::from(*lo0) - excess);
                    *lo1 = round_down(f64::from(*lo1) - excess);
                }
            }
            let (hi0, hi1) = (&mut self.hi0[a], &mut self.hi1[a]);
            if hi0 == hi1 {
                (*hi0, *hi1) = (hi0.max(hi[a]), hi1.max(hi[a]));
            } else {
                let excess = excess(*hi0, *hi1, time, hi[a], 1.0);
                if excess > 0.0 {
                    *hi0 = round_up(f64::from(*hi0) + excess);
                    *hi1 = round_up(f64::from(*hi1) + excess);
                }
            }
        }
    }

    /// Bounds at `time`, in f64.
    pub fn at(&self, time: f64) -> (glam::DVec3, glam::DVec3) {
        let mix = |a: Vec3, b: Vec3| {
            let (a, b) = (a.as_dvec3(), b.as_dvec3());
            a + (b - a) * time
        };
        (mix(self.lo0, self.lo1), mix(self.hi0, self.hi1))
    }
}

/// At least how far `value` at `time` lies beyond the chord from `b0` to `b1`, outward being `sign`; 0 or less where
/// it surely does not. Both ends of a bound may be moved by it with one rounding more.
///
/// In units of 2^-53 and with `m` the larger of `|b0|` and `|b1|`, the difference errs by `|b0| + |b1|`, the product by as
/// much again (`time` is at most 1), the chord, which lies between its ends, by `m`, and what `value` has more by
/// `m + |value|`: together at most `4 (|b0| + |b1|) + |value|`. Adding the rounding and moving a bound, in f64, err by
/// `3 (|b0| + |b1|) + 2 |value|` more. So 8 times the sum of all three covers everything. No exponent
/// of a product of two f32 leaves f64's range.
fn excess(b0: f32, b1: f32, time: f32, value: f32, sign: f64) -> f64 {
    /// See the function's text.
    const EXCESS_ROUNDING: f64 = 8.0 / (1u64 << 53) as f64;
    let (b0, b1, value) = (f64::from(b0), f64::from(b1), f64::from(value));
    let chord = b0 + (b1 - b0) * f64::from(time);
    (value - chord) * sign + EXCESS_ROUNDING * (b0.abs() + b1.abs() + value.abs())
}

/// Largest f32 not above `x`.
#[inline]
pub fn round_down(x: f64) -> f32 {
    let y = x as f32;
    if f64::from(y) > x { y.next_down() } else { y }
}

/// Smallest f32 not below `x`.
#[inline]
pub fn round_up(x: f64) -> f32 {
    let y = x as f32;
    if f64::from(y) < x { y.next_up() } else { y }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn mean_area_is_the_integral() {
        let b = LinearBox {
            lo0: Vec3::ZERO,
            hi0: Vec3::new(1.0, 2.0, 0.5),
            lo1: Vec3::new(-1.0, 0.0, 0.0),
            hi1: Vec3::new(3.0, 2.5, 0.0),
        };
        let n = 20_000;
        let sum: f64 = (0..n)
            .map(|i| {
                let (lo, hi) = b.at((f64::from(i) + 0.5) / f64::from(n));
                let e = hi - lo;
                e.x * e.y + e.y * e.z + e.z * e.x
            })
            .sum();
        let mean = sum / f64::from(n);
        assert!((mean - f64::from(b.mean_half_area())).abs() < 1e-5 * mean);
        assert_eq!(LinearBox::EMPTY.mean_half_area(), 0.0);
    }

    proptest! {
        #[test]
        fn raised_bounds_contain_inner_keys(
            b0 in -1e3f32..1e3, b1 in -1e3f32..1e3, inner in prop::collection::vec((0.0f32..1.0, -1e3f32..1e3), 1..6)
        ) {
            let mut b = LinearBox { lo0: Vec3::splat(b0), hi0: Vec3::splat(b0), lo1: Vec3::splat(b1), hi1: Vec3::splat(b1) };
            for &(t, v) in &inner {
                b.raise(t, Vec3::splat(v), Vec3::splat(v));
            }
            for &(t, v) in &inner {
                let (lo, hi) = b.at(f64::from(t));
                let slack = 1e-12;
                prop_assert!(lo.x <= f64::from(v) + slack && hi.x >= f64::from(v) - slack);
            }
            prop_assert!(b.lo0.x <= b0 && b.hi1.x >= b1);
        }
    }
}
