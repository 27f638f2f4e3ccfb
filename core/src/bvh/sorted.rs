//! Boxes as the build sorts them: lower bounds and mirrored upper ones in one vector, so that a single minimum joins
//! two boxes; and the second bounds only where things move. An item is its box alone, since sorting copies it again and again, and reads
//! many from all over memory: what else is known of it is in lanes that bounds leave, or found by its number.

use std::ops::{Add, Mul};

use glam::Vec3;
use hdtrapeze_simd::{Float, Simd};

use super::LinearBox;
use super::build::Item;
use super::diagonal::Diagonal;
use super::lanes::{Boxes8, Ranges8};

/// A box of one kind: what grows, and has an area.
pub trait Hull: Clone + Copy + Send + Sync {
    /// The box of nothing.
    const EMPTY: Self;
    /// The box in registers.
    type In<S: Simd>: Copy;
    /// The box; one that does not move contains both ends of one that does.
    fn of(bounds: &LinearBox) -> Self;
    /// The same box with another diagonal; without one it has none.
    #[must_use]
    fn along(self, diagonal: Diagonal) -> Self;
    /// The diagonal that what is in the box of one item is near to, [in numbers](Diagonal::to_numbers).
    fn diagonal(&self) -> [f32; 2];
    /// About the way from end to end of the part of a strand in the box of one item, at both ends of the shutter: that of its diagonal, along
    /// each axis as far as the box goes. Zero where it has none.
    fn ways(&self) -> [Vec3; 2];
    /// The same box, of an item of this number, which is below 2^31.
    #[must_use]
    fn of_item(self, id: u32) -> Self;
    /// The number of the item that it is of.
    fn id(&self) -> u32;
    /// 8 boxes of items of these numbers, each along a diagonal, [in numbers](Diagonal::to_numbers).
    fn of8<S: Simd>(
        simd: S,
        boxes: &Boxes8<S::F8>,
        diagonals: &[[f32; 8]; 2],
        ids: [u32; 8],
    ) -> [Self; 8];
    /// Into registers.
    fn load<S: Simd>(&self, simd: S) -> Self::In<S>;
    /// Out of them.
    fn store<S: Simd>(bounds: Self::In<S>) -> Self;
    /// As [`LinearBox::union`].
    fn union<S: Simd>(a: Self::In<S>, b: Self::In<S>) -> Self::In<S>;
    /// The same box, or with infinities in `by`, where there are zeros elsewhere, that of nothing.
    fn unless<S: Simd>(bounds: Self::In<S>, by: S::F8) -> Self::In<S>;
    /// As [`LinearBox::centre4`], in lanes 0 to 2, and mirrored in lanes 4 to 6; numbers without meaning in the others.
    fn centre4<S: Simd>(simd: S, bounds: Self::In<S>) -> S::F8;
    /// How far the centre goes over the shutter, in the lanes and the units of [`Hull::centre4`]; nothing of use where nothing moves.
    fn drift4<S: Simd>(simd: S, bounds: Self::In<S>) -> S::F8;
    /// Extents in lanes 0 to 2, the mean over the shutter.
    fn extents<S: Simd>(simd: S, bounds: Self::In<S>) -> S::F8;
    /// As [`LinearBox::mean_half_area`].
    fn area<S: Simd>(simd: S, bounds: Self::In<S>) -> f32;
    /// The same of 8 boxes, a lane each.
    fn areas<S: Simd>(simd: S, bounds: [Self::In<S>; 8]) -> S::F8;
    /// True where it moves.
    const MOVES: bool;
    /// 8 boxes, a lane each.
    fn boxes<S: Simd>(simd: S, hulls: [&Self; 8]) -> Boxes8<S::F8>;
}

/// A box that does not move: lower bounds in lanes 0 to 2, and mirrored upper ones in lanes 4 to 6. Of an item's, lane 3 has the number of
/// its diagonal, mirrored, and lane 7 the item's own, [coded](code), or where there are two boxes, that of the first has: sums and differences
/// of these are of no use, but finite, and hardly ever below f32's normal numbers, which are slow.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub struct StaticHull([f32; 8]);

/// What is added to the lower 30 bits of an item's number, as a float's, so that all are between 2^-63 and 2^65.
const CODE: u32 = 0x2000_0000;
/// The bits that it is added to. The next is the sign.
const CODED: u32 = (1 << 30) - 1;

/// A number below 2^31 as a float that is safe to calculate with.
#[inline(always)]
fn code(id: u32) -> f32 {
    debug_assert!(id >> 31 == 0);
    f32::from_bits(((id & CODED) + CODE) | (id & !CODED) << 1)
}

/// The number that was made a float.
#[inline(always)]
fn decode(coded: f32) -> u32 {
    let bits = coded.to_bits();
    ((bits & (u32::MAX >> 1)) - CODE) | (bits >> 31) << 30
}

/// A box with bounds at both ends of the shutter.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct LinearHull {
    start: StaticHull,
    end: StaticHull,
}

impl StaticHull {
    const EMPTY: Self = Self([f32::INFINITY; 8]);

    fn between(lo: Vec3, hi: Vec3) -> Self {
        let none = -Diagonal::NONE.radius;
        Self([lo.x, lo.y, lo.z, none, -hi.x, -hi.y, -hi.z, code(0)])
    }

    fn numbered(mut self, number: f32) -> Self {
        self.0[3] = -number;
        self
    }

    fn of_item(mut self, id: u32) -> Self {
        self.0[7] = code(id);
        self
    }

    /// 8 boxes, with the numbers of diagonals and items.
    #[inline(always)]
    fn of_ranges<S: Simd>(
        simd: S,
        lo: [S::F8; 3],
        hi: [S::F8; 3],
        diagonals: &[f32; 8],
        ids: [u32; 8],
    ) -> [Self; 8] {
        let (diagonals, ids) = (simd.from8(diagonals), simd.from8(&ids.map(code)));
        let [x, y, z] = lo;
        let [u, v, w] = hi;
        let rows = simd.transposed([x, y, z, -diagonals, -u, -v, -w, ids]);
        let mut hulls = [Self([0.0; 8]); 8];
        for i in 0..8 {
            hulls[i] = Self(rows[i].to_array());
        }
        hulls
    }

    /// From corner to corner.
    #[inline(always)]
    fn way(&self) -> Vec3 {
        let [x, y, z, _, u, v, w, _] = self.0;
        Diagonal::way(self.number(), -Vec3::new(x + u, y + v, z + w))
    }

    #[inline(always)]
    fn number(&self) -> f32 {
        -self.0[3]
    }

    #[inline(always)]
    fn ranges<S: Simd>(simd: S, hulls: [&Self; 8]) -> Ranges8<S::F8> {
        let [a, b, c, d, e, f, g, h] = hulls;
        let [x, y, z, _, u, v, w, _] = simd.transposed([
            simd.from8(&a.0),
            simd.from8(&b.0),
            simd.from8(&c.0),
            simd.from8(&d.0),
            simd.from8(&e.0),
            simd.from8(&f.0),
            simd.from8(&g.0),
            simd.from8(&h.0),
        ]);
        Ranges8 {
            lo: [x, y, z],
            hi: [-u, -v, -w],
        }
    }
}

/// Lower bounds plus mirrored upper ones: mirrored extents, twice.
#[inline(always)]
fn mirrored_extents<S: Simd>(simd: S, bounds: S::F8) -> S::F8 {
    (bounds + simd.halves_swapped(bounds)).min(simd.all8(0.0))
}

/// The same of 8 boxes, by axis, once.
#[inline(always)]
fn mirrored_extents8<S: Simd>(simd: S, bounds: [S::F8; 8]) -> [S::F8; 3] {
    let [x, y, z, _, u, v, w, _] = simd.transposed(bounds);
    let zero = simd.all8(0.0);
    [(x + u).min(zero), (y + v).min(zero), (z + w).min(zero)]
}

/// `x y + y z + z x` of both signs.
#[inline(always)]
fn products<T: Copy + Add<Output = T> + Mul<Output = T>>([x, y, z]: [T; 3]) -> T {
    x * y + y * z + z * x
}

/// As [`products`], of a box's extents.
#[inline(always)]
fn area<F: Float<8>>(extents: F) -> f32 {
    let [x, y, z, ..] = extents.to_array();
    products([x, y, z])
}

impl Hull for StaticHull {
    const EMPTY: Self = Self::EMPTY;
    type In<S: Simd> = S::F8;
    const MOVES: bool = false;
    fn of(b: &LinearBox) -> Self {
        Self::between(b.lo0.min(b.lo1), b.hi0.max(b.hi1))
    }
    fn along(self, diagonal: Diagonal) -> Self {
        let [start, _] = diagonal.to_numbers();
        self.numbered(start)
    }
    #[inline(always)]
    fn diagonal(&self) -> [f32; 2] {
        [self.number(); 2]
    }
    #[inline(always)]
    fn ways(&self) -> [Vec3; 2] {
        [self.way(); 2]
    }
    fn of_item(self, id: u32) -> Self {
        self.of_item(id)
    }
    #[inline(always)]
    fn id(&self) -> u32 {
        decode(self.0[7])
    }
    #[inline(always)]
    fn of8<S: Simd>(
        simd: S,
        Boxes8 { start, end }: &Boxes8<S::F8>,
        [diagonals, _]: &[[f32; 8]; 2],
        ids: [u32; 8],
    ) -> [Self; 8] {
        let (mut lo, mut hi) = (start.lo, start.hi);
        for axis in 0..3 {
            lo[axis] = lo[axis].min(end.lo[axis]);
            hi[axis] = hi[axis].max(end.hi[axis]);
        }
        Self::of_ranges(simd, lo, hi, diagonals, ids)
    }
    #[inline(always)]
    fn load<S: Simd>(&self, simd: S) -> S::F8 {
        simd.from8(&self.0)
    }
    #[inline(always)]
    fn store<S: Simd>(bounds: S::F8) -> Self {
        Self(bounds.to_array())
    }
    #[inline(always)]
    fn union<S: Simd>(a: S::F8, b: S::F8) -> S::F8 {
        a.min(b)
    }
    #[inline(always)]
    fn unless<S: Simd>(bounds: S::F8, by: S::F8) -> S::F8 {
        bounds + by
    }
    #[inline(always)]
    fn centre4<S: Simd>(simd: S, bounds: S::F8) -> S::F8 {
        let sum = bounds - simd.halves_swapped(bounds);
        sum + sum
    }
    #[inline(always)]
    fn drift4<S: Simd>(simd: S, _: S::F8) -> S::F8 {
        simd.all8(0.0)
    }
    #[inline(always)]
    fn extents<S: Simd>(simd: S, bounds: S::F8) -> S::F8 {
        -mirrored_extents(simd, bounds)
    }
    #[inline(always)]
    fn area<S: Simd>(simd: S, bounds: S::F8) -> f32 {
        area(mirrored_extents(simd, bounds))
    }
    #[inline(always)]
    fn areas<S: Simd>(simd: S, bounds: [S::F8; 8]) -> S::F8 {
        products(mirrored_extents8(simd, bounds))
    }
    #[inline(always)]
    fn boxes<S: Simd>(simd: S, hulls: [&Self; 8]) -> Boxes8<S::F8> {
        let ranges = Self::ranges(simd, hulls);
        Boxes8 {
            start: ranges,
            end: ranges,
        }
    }
}

impl Hull for LinearHull {
    const EMPTY: Self = Self {
        start: StaticHull::EMPTY,
        end: StaticHull::EMPTY,
    };
    type In<S: Simd> = [S::F8; 2];
    const MOVES: bool = true;
    fn of(b: &LinearBox) -> Self {
        Self {
            start: StaticHull::between(b.lo0, b.hi0),
            end: StaticHull::between(b.lo1, b.hi1),
        }
    }
    fn along(self, diagonal: Diagonal) -> Self {
        let [start, end] = diagonal.to_numbers();
        Self {
            start: self.start.numbered(start),
            end: self.end.numbered(end),
        }
    }
    #[inline(always)]
    fn diagonal(&self) -> [f32; 2] {
        [self.start.number(), self.end.number()]
    }
    #[inline(always)]
    fn ways(&self) -> [Vec3; 2] {
        [self.start.way(), self.end.way()]
    }
    fn of_item(self, id: u32) -> Self {
        Self {
            start: self.start.of_item(id),
            ..self
        }
    }
    #[inline(always)]
    fn id(&self) -> u32 {
        self.start.id()
    }
    #[inline(always)]
    fn of8<S: Simd>(
        simd: S,
        Boxes8 { start, end }: &Boxes8<S::F8>,
        diagonals: &[[f32; 8]; 2],
        ids: [u32; 8],
    ) -> [Self; 8] {
        let start = StaticHull::of_ranges(simd, start.lo, start.hi, &diagonals[0], ids);
        let end = StaticHull::of_ranges(simd, end.lo, end.hi, &diagonals[1], [0; 8]);
        let mut hulls = [Self::EMPTY; 8];
        for i in 0..8 {
            let (start, end) = (start[i], end[i]);
            hulls[i] = Self { start, end };
        }
        hulls
    }
    #[inline(always)]
    fn load<S: Simd>(&self, simd: S) -> [S::F8; 2] {
        [self.start.load(simd), self.end.load(simd)]
    }
    #[inline(always)]
    fn store<S: Simd>([start, end]: [S::F8; 2]) -> Self {
        Self {
            start: StaticHull(start.to_array()),
            end: StaticHull(end.to_array()),
        }
    }
    #[inline(always)]
    fn union<S: Simd>(a: [S::F8; 2], b: [S::F8; 2]) -> [S::F8; 2] {
        [a[0].min(b[0]), a[1].min(b[1])]
    }
    #[inline(always)]
    fn unless<S: Simd>([start, end]: [S::F8; 2], by: S::F8) -> [S::F8; 2] {
        [start + by, end + by]
    }
    #[inline(always)]
    fn centre4<S: Simd>(simd: S, [start, end]: [S::F8; 2]) -> S::F8 {
        let [a, b] = [simd.halves_swapped(start), simd.halves_swapped(end)];
        (start - a) + (end - b)
    }
    #[inline(always)]
    fn drift4<S: Simd>(simd: S, [start, end]: [S::F8; 2]) -> S::F8 {
        let [a, b] = [simd.halves_swapped(start), simd.halves_swapped(end)];
        let drift = (end - b) - (start - a);
        drift + drift
    }
    #[inline(always)]
    fn extents<S: Simd>(simd: S, [start, end]: [S::F8; 2]) -> S::F8 {
        (mirrored_extents(simd, start) + mirrored_extents(simd, end)) * simd.all8(-0.5)
    }
    #[inline(always)]
    fn area<S: Simd>(simd: S, [start, end]: [S::F8; 2]) -> f32 {
        // The mean of x y over time, as in `LinearBox::mean_half_area`, regrouped: with the sum s of both ends'
        // extents, it is (x0 y0 + x1 y1 + sx sy) / 6.
        let (e0, e1) = (mirrored_extents(simd, start), mirrored_extents(simd, end));
        (area(e0) + area(e1) + area(e0 + e1)) * (1.0 / 6.0)
    }
    #[inline(always)]
    fn areas<S: Simd>(simd: S, bounds: [[S::F8; 2]; 8]) -> S::F8 {
        let e0 = mirrored_extents8(simd, bounds.map(|[start, _]| start));
        let e1 = mirrored_extents8(simd, bounds.map(|[_, end]| end));
        let both = [e0[0] + e1[0], e0[1] + e1[1], e0[2] + e1[2]];
        (products(e0) + products(e1) + products(both)) * simd.all8(1.0 / 6.0)
    }
    #[inline(always)]
    fn boxes<S: Simd>(simd: S, hulls: [&Self; 8]) -> Boxes8<S::F8> {
        let [a, b, c, d, e, f, g, h] = hulls;
        Boxes8 {
            start: StaticHull::ranges(
                simd,
                [
                    &a.start, &b.start, &c.start, &d.start, &e.start, &f.start, &g.start, &h.start,
                ],
            ),
            end: StaticHull::ranges(
                simd,
                [
                    &a.end, &b.end, &c.end, &d.end, &e.end, &f.end, &g.end, &h.end,
                ],
            ),
        }
    }
}

/// An item being sorted.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct Sorted<H: Hull> {
    /// Its box.
    pub bounds: H,
}

impl<H: Hull> Sorted<H> {
    /// Of an item.
    pub fn of(item: &Item) -> Self {
        Self::along(item, Diagonal::NONE)
    }

    /// Of a part of a strand near to a diagonal of its box.
    pub fn along(item: &Item, diagonal: Diagonal) -> Self {
        let bounds = H::of(&item.bounds).along(diagonal);
        Self {
            bounds: bounds.of_item(item.id),
        }
    }

    /// The same item in another box, near to a diagonal of it.
    #[must_use]
    pub fn within(self, bounds: &LinearBox, diagonal: Diagonal) -> Self {
        let bounds = H::of(bounds).along(diagonal);
        Self {
            bounds: bounds.of_item(self.id()),
        }
    }

    /// Its number.
    #[inline(always)]
    pub fn id(&self) -> u32 {
        self.bounds.id()
    }

    /// The same item with another number.
    #[must_use]
    pub fn numbered(self, id: u32) -> Self {
        Self {
            bounds: self.bounds.of_item(id),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_floats_that_are_safe_to_calculate_with() {
        for id in (0..31).flat_map(|bit| [(1u32 << bit) - 1, 1 << bit, (1 << bit) + 1, !0 >> 1]) {
            let coded = code(id);
            assert_eq!(decode(coded), id);
            let (least, most) = (2.0f32.powi(-63), 2.0f32.powi(65));
            assert!((least..most).contains(&coded.abs()), "{id}: {coded}");
        }
    }

    #[test]
    fn an_item_keeps_its_number_and_its_diagonal() {
        let bounds = LinearBox {
            lo0: Vec3::ZERO,
            hi0: Vec3::ONE,
            lo1: Vec3::ONE,
            hi1: Vec3::ONE * 3.0,
        };
        let diagonal = Diagonal {
            radius: 0.25,
            down: [2, 5],
        };
        fn check<H: Hull>(bounds: LinearBox, diagonal: Diagonal, moves: bool) {
            let item = Sorted::<H>::along(&Item { bounds, id: 77 }, diagonal);
            let [start, end] = diagonal.to_numbers();
            let expected = [start, if moves { end } else { start }];
            for (item, id) in [(item, 77), (item.numbered(!0 >> 1), !0 >> 1)] {
                assert_eq!((item.id(), item.bounds.diagonal()), (id, expected));
            }
        }
        check::<StaticHull>(bounds, diagonal, false);
        check::<LinearHull>(bounds, diagonal, true);
    }
}
