//! Up to 8 boxes at once, a lane of vectors each: what bounds are made of, and packed from.

use glam::Vec3;
use hdtrapeze_simd::{Float, Simd};

use super::LinearBox;

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
    pub fn to_vectors(self) -> ([Vec3; 8], [Vec3; 8]) {
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

#[inline(always)]
fn products<F: Float<8>>(e: [F; 3]) -> F {
    e[0] * e[1] + e[1] * e[2] + e[2] * e[0]
}
