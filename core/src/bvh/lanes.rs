//! Up to 8 boxes at once, a lane of vectors each: what bounds are made of, and packed from.

use glam::Vec3;
use hdtrapeze_simd::{Float, Simd};

use super::LinearBox;

/// What rounding may have the excess over a chord, and the bounds that it moves, too small by, of the sum of their magnitudes.
///
/// In units of 2^-24, with `s` the sum of `|b0|` and `|b1|`: the difference of the ends errs by `s`, the product by as much again (times are
/// at most 1), and the chord, which lies between its ends, by `s`; what a value `v` has more by `s + |v|`. Adding the rounding to that
/// errs by `s + |v|`, and moving a bound by `2 s + |v|`: together `7 s + 3 |v|`. So 8 times the sum of all three covers everything,
/// errors of errors too.
pub const EXCESS_ROUNDING: f32 = 8.0 / (1 << 24) as f32;
/// The same where numbers are below f32's normal range: the results of eight operations, and three numbers that are given, err
/// by less than the smallest normal number each, even where such are flushed to zero.
pub const EXCESS_TINY: f32 = f32::MIN_POSITIVE * 16.0;

/// Ranges of coordinates of 8 boxes at one instant, on each axis.
#[derive(Clone, Copy, Debug)]
pub struct Ranges8<F> {
    /// Lower bounds.
    pub lo: [F; 3],
    /// Upper bounds.
    pub hi: [F; 3],
}

/// 8 boxes with bounds at both ends of the shutter. Where there are fewer, some stand in several lanes.
#[derive(Clone, Copy, Debug)]
pub struct Boxes8<F> {
    /// At its start.
    pub start: Ranges8<F>,
    /// At its end.
    pub end: Ranges8<F>,
}

/// 1 for each of so many lanes.
static COUNTED: [[f32; 8]; 9] = {
    let mut counted = [[0.0; 8]; 9];
    let mut at = 0;
    while at < 9 * 8 {
        if at % 8 < at / 8 {
            counted[at / 8][at % 8] = 1.0;
        }
        at += 1;
    }
    counted
};

impl<F: Float<8>> Ranges8<F> {
    /// The same bounds as numbers, by lane.
    #[inline(always)]
    fn to_vectors(self) -> ([Vec3; 8], [Vec3; 8]) {
        let (mut lo, mut hi) = ([Vec3::ZERO; 8], [Vec3::ZERO; 8]);
        for axis in 0..3 {
            let (low, high) = (self.lo[axis].to_array(), self.hi[axis].to_array());
            for i in 0..8 {
                (lo[i][axis], hi[i][axis]) = (low[i], high[i]);
            }
        }
        (lo, hi)
    }

    #[inline(always)]
    fn of<S: Simd<F8 = F>>(
        simd: S,
        lo: impl Fn(usize) -> Vec3,
        hi: impl Fn(usize) -> Vec3,
    ) -> Self {
        let (mut low, mut high) = ([[0.0; 8]; 3], [[0.0; 8]; 3]);
        for i in 0..8 {
            let (lo, hi) = (lo(i), hi(i));
            for axis in 0..3 {
                (low[axis][i], high[axis][i]) = (lo[axis], hi[axis]);
            }
        }
        let [x0, y0, z0] = low;
        let [x1, y1, z1] = high;
        Self {
            lo: [simd.from8(&x0), simd.from8(&y0), simd.from8(&z0)],
            hi: [simd.from8(&x1), simd.from8(&y1), simd.from8(&z1)],
        }
    }

    /// The box around all lanes.
    #[inline(always)]
    pub fn hull(&self) -> (Vec3, Vec3) {
        let (mut lo, mut hi) = (Vec3::ZERO, Vec3::ZERO);
        for axis in 0..3 {
            (lo[axis], hi[axis]) = (self.lo[axis].least(), self.hi[axis].most());
        }
        (lo, hi)
    }

    #[inline(always)]
    fn extents(&self) -> [F; 3] {
        [
            self.hi[0] - self.lo[0],
            self.hi[1] - self.lo[1],
            self.hi[2] - self.lo[2],
        ]
    }
}

impl<F: Float<8>> Boxes8<F> {
    /// 1 to 8 boxes; the first stands in the lanes that are left.
    #[inline(always)]
    pub fn of<S: Simd<F8 = F>>(simd: S, boxes: &[LinearBox]) -> Self {
        let mut all = [boxes[0]; 8];
        for (to, b) in all.iter_mut().zip(boxes) {
            *to = *b;
        }
        Self {
            start: Ranges8::of(simd, |i| all[i].lo0, |i| all[i].hi0),
            end: Ranges8::of(simd, |i| all[i].lo1, |i| all[i].hi1),
        }
    }

    /// The same boxes, by lane.
    #[inline(always)]
    pub fn to_boxes(self) -> [LinearBox; 8] {
        let (lo0, hi0) = self.start.to_vectors();
        let (lo1, hi1) = self.end.to_vectors();
        let mut boxes = [LinearBox::EMPTY; 8];
        for (i, b) in boxes.iter_mut().enumerate() {
            *b = LinearBox {
                lo0: lo0[i],
                hi0: hi0[i],
                lo1: lo1[i],
                hi1: hi1[i],
            };
        }
        boxes
    }

    /// Raises the bounds, outward, until they contain `inner` at the inner time `time`, as [`LinearBox::raise`] does, but in f32.
    #[inline(always)]
    pub fn raise<S: Simd<F8 = F>>(&mut self, simd: S, time: f32, inner: &Ranges8<F>) {
        let (start, end) = (&mut self.start, &mut self.end);
        for a in 0..3 {
            [start.hi[a], end.hi[a]] = raised(simd, time, [start.hi[a], end.hi[a]], inner.hi[a]);
            let below = raised(simd, time, [-start.lo[a], -end.lo[a]], -inner.lo[a]);
            [start.lo[a], end.lo[a]] = [-below[0], -below[1]];
        }
    }

    /// The box around all lanes.
    #[inline(always)]
    pub fn hull(&self) -> LinearBox {
        let (lo0, hi0) = self.start.hull();
        let (lo1, hi1) = self.end.hull();
        LinearBox { lo0, hi0, lo1, hi1 }
    }

    /// The sum of the areas of the first `count` boxes, each as [`LinearBox::mean_half_area`].
    #[inline(always)]
    pub fn area<S: Simd<F8 = F>>(&self, simd: S, moving: bool, count: u8) -> f32 {
        let e = self.start.extents();
        let areas = if moving {
            // With the sum s of both ends' extents, the mean of x y is (x0 y0 + x1 y1 + sx sy) / 6.
            let f = self.end.extents();
            let s = [e[0] + f[0], e[1] + f[1], e[2] + f[2]];
            (products(e) + products(f) + products(s)) * simd.all8(1.0 / 6.0)
        } else {
            products(e)
        };
        let counted = simd.from8(&COUNTED[usize::from(count.min(8))]);
        let [a, b, c, d, e, f, g, h] = (areas * counted).to_array();
        ((a + b) + (c + d)) + ((e + f) + (g + h))
    }
}

/// Upper bounds at both ends that are not below `value` at `time` either.
#[inline(always)]
fn raised<S: Simd>(simd: S, time: f32, [b0, b1]: [S::F8; 2], value: S::F8) -> [S::F8; 2] {
    // Not fused: the same bits on all levels.
    let chord = b0 + (b1 - b0) * simd.all8(time);
    let all = b0.abs() + b1.abs() + value.abs();
    let rounding = all * simd.all8(EXCESS_ROUNDING) + simd.all8(EXCESS_TINY);
    // What is no number stays so.
    let excess = simd.all8(0.0).max((value - chord) + rounding);
    // Of a constant chord nothing is rounded.
    let (constant, level) = (b0.le(b1) & b1.le(b0), b0.max(value));
    [
        level.or(constant, b0 + excess),
        level.or(constant, b1 + excess),
    ]
}

#[inline(always)]
fn products<F: Float<8>>(e: [F; 3]) -> F {
    e[0] * e[1] + e[1] * e[2] + e[2] * e[0]
}

#[cfg(test)]
mod tests {
    use hdtrapeze_simd::{Kernel, Level};
    use proptest::prelude::*;

    use super::*;

    type Lanes = [f32; 8];

    /// Upper bounds at both ends, raised at each key.
    struct Raise<'a>([Lanes; 2], &'a [(f32, Lanes)]);

    impl Kernel for Raise<'_> {
        type Output = [Lanes; 2];
        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> [Lanes; 2] {
            let mut bounds = self.0.map(|ends| simd.from8(&ends));
            for (time, values) in self.1 {
                bounds = raised(simd, *time, bounds, simd.from8(values));
            }
            bounds.map(Float::to_array)
        }
    }

    fn lanes() -> impl Strategy<Value = Lanes> {
        prop::array::uniform8((any::<bool>(), -1.0f32..1.0, -30i32..1))
            .prop_map(|x| x.map(|(is_size, x, e)| if is_size { x } else { x * (e as f32).exp2() }))
    }

    proptest! {
        #[test]
        fn raised_bounds_contain_inner_keys_and_hardly_more(
            ends in prop::array::uniform2(lanes()), inner in prop::collection::vec((0.0f32..=1.0, lanes()), 1..5),
            constant in 0usize..8, size in -149i32..60
        ) {
            let scaled = |x: Lanes| x.map(|x| (f64::from(x) * f64::from(size).exp2()) as f32);
            let mut ends = ends.map(scaled);
            ends[1][constant] = ends[0][constant];
            let inner: Vec<_> = inner.iter().map(|&(time, x)| (time, scaled(x))).collect();
            let [start, end] = Level::SCALAR.run(Raise(ends, &inner));
            for level in Level::available() {
                let found = level.run(Raise(ends, &inner));
                prop_assert_eq!(found.map(|x| x.map(f32::to_bits)), [start, end].map(|x| x.map(f32::to_bits)));
            }
            for lane in 0..8 {
                let [b0, b1] = ends.map(|ends| f64::from(ends[lane]));
                let (r0, r1) = (f64::from(start[lane]), f64::from(end[lane]));
                prop_assert!(r0 >= b0 && r1 >= b1);
                let (mut needed, mut largest, mut highest) = (0.0f64, b0.abs() + b1.abs(), b0);
                for (time, values) in &inner {
                    let (time, value) = (f64::from(*time), f64::from(values[lane]));
                    let above = |a: f64, b: f64| value - (a + (b - a) * time);
                    largest = largest.max(b0.abs() + b1.abs() + value.abs());
                    // f64 errs too.
                    prop_assert!(above(r0, r1) <= 1e-15 * largest, "{} of {largest}", above(r0, r1));
                    needed = needed.max(above(b0, b1));
                    highest = highest.max(value);
                }
                let slack = 4.0 * inner.len() as f64 * (f64::from(EXCESS_ROUNDING) * largest + f64::from(EXCESS_TINY));
                prop_assert!(r0 - b0 <= needed + slack && r1 - b1 <= needed + slack);
                prop_assert!(b0 != b1 || (r0, r1) == (highest, highest));
            }
        }
    }
}
