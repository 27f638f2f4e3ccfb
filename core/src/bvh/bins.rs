//! Bins on each axis that items are sorted into, by their centres or by their drift, and the cheapest plane between them.

use hdtrapeze_simd::{Float, Mask, Scalar, Simd};

use super::extent::{Extent, Piece};
use super::sorted::Hull;

/// Above it, f32 are whole numbers: sums are rounded to the nearest, and end in it.
pub const WHOLE: f32 = (1 << 23) as f32;

/// Where bins are, on each axis: numbers grow with centres.
#[derive(Clone, Copy)]
pub struct Places {
    lo: [f32; 8],
    /// Bins in a unit; 0 on an axis without extent, and in lanes of none.
    scale: [f32; 8],
    /// The last bin.
    most: [f32; 8],
    /// They are bins of drift, not of centres.
    drift: bool,
}

impl Places {
    /// So many bins on each axis.
    pub fn new<H: Hull>(extent: &Extent<H>, counts: [usize; 3]) -> Self {
        let (mut lo, mut scale, mut most) = ([0.0; 8], [0.0; 8], [0.0; 8]);
        let spans = extent.spans();
        for a in 0..3 {
            // Not a division by an extent: an axis without extent gets one bin, and is passed over.
            let s = counts[a] as f32 / spans[a];
            (lo[a], scale[a]) = (extent.first(a), if s.is_finite() { s } else { 0.0 });
            most[a] = (counts[a] - 1) as f32;
        }
        Self {
            lo,
            scale,
            most,
            drift: false,
        }
    }

    /// So many bins of what items drift by, which `drift` has in place of centres.
    pub fn of_drift<H: Hull>(drift: &Extent<H>, counts: [usize; 3]) -> Self {
        Self {
            drift: true,
            ..Self::new(drift, counts)
        }
    }

    /// Bins on an axis differ.
    fn has_several(&self, axis: usize) -> bool {
        self.scale[axis] > 0.0
    }

    /// What the bin of a piece is chosen by.
    #[inline(always)]
    pub fn place<S: Simd, H: Hull>(&self, simd: S, piece: &impl Piece<H>) -> S::F8 {
        if H::MOVES && self.drift {
            H::drift4(simd, piece.bounds().load(simd))
        } else {
            piece.place(simd)
        }
    }

    /// The bins of a place.
    #[inline(always)]
    pub fn numbers<S: Simd>(&self, simd: S, place: S::F8) -> [usize; 3] {
        let [x, y, z, ..] = self.whole(simd, place).to_array();
        let number = |x: f32| (x.to_bits() - WHOLE.to_bits()) as usize;
        [number(x), number(y), number(z)]
    }

    /// The same plus [`WHOLE`].
    #[inline(always)]
    pub fn whole<S: Simd>(&self, simd: S, place: S::F8) -> S::F8 {
        let at = (place - simd.from8(&self.lo)) * simd.from8(&self.scale) - simd.all8(0.5);
        at.max(simd.all8(0.0)).min(simd.from8(&self.most)) + simd.all8(WHOLE)
    }
}

/// How many items are in bins on each axis, of which there are multiples of 8.
pub trait Counts: Copy + Send {
    /// Bins there may be.
    const BINS: usize;
    /// Nothing is in any.
    const NONE: Self;
    /// More items in a bin.
    fn add(&mut self, axis: usize, bin: usize, count: u32);
    /// Items in all bins up to each of 8, the first of which is number `8 part`, and those in the bins beyond it.
    fn sides<S: Simd>(&self, simd: S, axis: usize, part: usize) -> [S::F8; 2];
    /// Items in all bins below one.
    fn below(&self, axis: usize, bin: usize) -> usize;
}

/// Any number of items in each of `N` bins.
pub type Many<const N: usize> = [[u32; N]; 3];

impl<const N: usize> Counts for Many<N> {
    const BINS: usize = N;
    const NONE: Self = [[0; N]; 3];
    #[inline(always)]
    fn add(&mut self, axis: usize, bin: usize, count: u32) {
        self[axis][bin] += count;
    }
    #[inline(always)]
    fn sides<S: Simd>(&self, simd: S, axis: usize, part: usize) -> [S::F8; 2] {
        let (before, own) = self[axis].split_at(8 * part);
        let mut sum = before.iter().sum::<u32>();
        // In whole numbers: of more than 2^24 items, a few would be none in f32.
        let mut rest = own.iter().sum::<u32>();
        let (mut sums, mut rests) = ([0.0; 8], [0.0; 8]);
        for ((to, beyond), count) in sums.iter_mut().zip(&mut rests).zip(own) {
            sum += count;
            rest -= count;
            (*to, *beyond) = (sum as f32, rest as f32);
        }
        [simd.from8(&sums), simd.from8(&rests)]
    }
    #[inline(always)]
    fn below(&self, axis: usize, bin: usize) -> usize {
        self[axis][..bin].iter().sum::<u32>() as usize
    }
}

/// Up to [`Few::MOST`] items in 8 bins, a byte each, from the lowest on: they stay in registers.
#[derive(Clone, Copy)]
pub struct Few([u64; 3]);

impl Few {
    /// Items in all bins together, at most.
    pub const MOST: usize = u8::MAX as usize;

    #[inline(always)]
    fn sums(&self, axis: usize) -> [u8; 8] {
        self.0[axis]
            .wrapping_mul(0x0101_0101_0101_0101)
            .to_le_bytes()
    }
}

impl Counts for Few {
    const BINS: usize = 8;
    const NONE: Self = Self([0; 3]);
    #[inline(always)]
    fn add(&mut self, axis: usize, bin: usize, count: u32) {
        debug_assert!(self.below(axis, 8) + count as usize <= Self::MOST);
        self.0[axis] += u64::from(count) << (8 * (bin % 8));
    }
    #[inline(always)]
    fn sides<S: Simd>(&self, simd: S, axis: usize, _: usize) -> [S::F8; 2] {
        let sums = self.sums(axis);
        let up_to = simd.bytes8(&sums);
        [up_to, simd.all8(f32::from(sums[7])) - up_to]
    }
    #[inline(always)]
    fn below(&self, axis: usize, bin: usize) -> usize {
        bin.checked_sub(1)
            .map_or(0, |bin| usize::from(self.sums(axis)[bin % 8]))
    }
}

/// What is in `N` bins on each axis.
pub struct Filled<H, C, const N: usize> {
    bounds: [[H; N]; 3],
    counts: C,
}

impl<H: Hull, C: Counts, const N: usize> Filled<H, C, N> {
    /// Nothing.
    pub const EMPTY: Self = Self {
        bounds: [[H::EMPTY; N]; 3],
        counts: C::NONE,
    };

    /// Pieces in their bins.
    #[inline(always)]
    pub fn with<S: Simd, P: Piece<H>>(simd: S, pieces: &[P], places: &Places) -> Self {
        let mut filled = Self::EMPTY;
        for piece in pieces {
            let own = piece.bounds().load(simd);
            let numbers = places.numbers(simd, places.place(simd, piece));
            for (axis, number) in numbers.into_iter().enumerate() {
                // Whatever rounding does, the bin exists.
                let number = number % N;
                let bin = &mut filled.bounds[axis][number];
                *bin = H::store::<S>(H::union::<S>(own, bin.load(simd)));
                filled.counts.add(axis, number, piece.count());
            }
        }
        filled
    }
}

impl<H: Hull, const N: usize> Filled<H, Many<N>, N> {
    /// What is in either.
    pub fn join(mut self, o: &Self) -> Self {
        for axis in 0..3 {
            for (a, b) in self.bounds[axis].iter_mut().zip(&o.bounds[axis]) {
                *a = H::store(H::union::<Scalar>(a.load(Scalar), b.load(Scalar)));
            }
            for (a, b) in self.counts[axis].iter_mut().zip(&o.counts[axis]) {
                *a += b;
            }
        }
        self
    }
}

/// A split plane: items in bins below `bin` go left.
pub struct Plane<H> {
    /// What it is at right angles to.
    pub axis: usize,
    /// The first bin on the right.
    pub bin: usize,
    /// Items on the left.
    pub left: usize,
    /// Boxes of both sides.
    pub bounds: [H; 2],
    /// The sum of their areas, each as often as it has items.
    pub cost: f32,
}

/// The cheapest plane over all axes, or none where every centre is the same.
#[inline(always)]
pub fn cheapest<S: Simd, H: Hull, C: Counts, const N: usize>(
    simd: S,
    filled: &Filled<H, C, N>,
    places: &Places,
) -> Option<Plane<H>> {
    const {
        assert!(N.is_multiple_of(8) && N <= C::BINS);
    }
    let Filled { bounds, counts } = filled;
    let mut best: Option<(usize, usize, f32)> = None;
    for axis in (0..3).filter(|&axis| places.has_several(axis)) {
        // What is up to each bin, and beyond it.
        let (mut low, mut high) = ([H::EMPTY.load(simd); N], [H::EMPTY.load(simd); N]);
        let mut side = H::EMPTY.load(simd);
        for i in 0..N {
            side = H::union::<S>(side, bounds[axis][i].load(simd));
            low[i] = side;
        }
        side = H::EMPTY.load(simd);
        for i in (1..N).rev() {
            side = H::union::<S>(side, bounds[axis][i].load(simd));
            high[i - 1] = side;
        }
        for part in 0..N / 8 {
            let [count, rest] = counts.sides(simd, axis, part);
            let (low, high) = (eight(&low, part), eight(&high, part));
            let cost = H::areas(simd, low) * count + H::areas(simd, high) * rest;
            let zero = simd.all8(0.0);
            let both = zero.lt(count) & zero.lt(rest);
            let cost = cost.or(both, simd.all8(f32::INFINITY));
            let least = cost.least();
            if both.bits() != 0 && best.is_none_or(|(.., cost)| least < cost) {
                let first = (cost.le(simd.all8(least)) & both).bits().trailing_zeros();
                best = Some((axis, 8 * part + first as usize + 1, least));
            }
        }
    }
    let (axis, bin, cost) = best?;
    let (left, right) = bounds[axis].split_at(bin);
    let (mut low, mut high) = (H::EMPTY.load(simd), H::EMPTY.load(simd));
    for bounds in left {
        low = H::union::<S>(low, bounds.load(simd));
    }
    for bounds in right.iter().rev() {
        high = H::union::<S>(high, bounds.load(simd));
    }
    Some(Plane {
        axis,
        bin,
        left: counts.below(axis, bin),
        bounds: [H::store::<S>(low), H::store::<S>(high)],
        cost,
    })
}

/// 8 of them.
#[inline(always)]
fn eight<T: Copy, const N: usize>(all: &[T; N], part: usize) -> [T; 8] {
    std::array::from_fn(|i| all[8 * part + i])
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use hdtrapeze_simd::Level;

    use super::super::LinearBox;
    use super::super::build::Item;
    use super::super::sorted::{LinearHull, Sorted, StaticHull};
    use super::*;

    /// Boxes in a slab, all over it or in a few places.
    fn items<H: Hull>(count: u32, slab: Vec3, places: u32) -> Vec<Sorted<H>> {
        let number = |i: u32| (i.wrapping_mul(2_654_435_761) >> 8) as f32 / (1 << 24) as f32;
        let item = |id: u32| {
            let own = if places == 0 { id } else { id % places };
            let at = |k: u32| {
                let seed = 31 * own + 7 * k;
                Vec3::new(number(seed), number(seed + 1), number(seed + 2))
            };
            let bounds = LinearBox {
                lo0: at(1) * slab,
                hi0: at(1) * slab + at(2) * 0.1,
                lo1: at(3) * slab,
                hi1: at(3) * slab + at(4) * 0.2,
            };
            Sorted::of(&Item { bounds, id })
        };
        (0..count).map(item).collect()
    }

    /// The cheapest plane, one by one: axis, first bin on the right, items on the left, and the cost.
    fn one_by_one<H: Hull>(
        items: &[Sorted<H>],
        places: &Places,
        bins: usize,
    ) -> Option<(usize, usize, usize, f32)> {
        let mut best: Option<(usize, usize, usize, f32)> = None;
        for axis in 0..3 {
            for bin in 1..bins {
                let mut sides = [(H::EMPTY, 0); 2];
                for item in items {
                    let own = places.numbers(Scalar, places.place(Scalar, item))[axis];
                    let (bounds, count) = &mut sides[usize::from(own >= bin)];
                    let own = item.bounds.load(Scalar);
                    *bounds = H::store(H::union::<Scalar>(own, bounds.load(Scalar)));
                    *count += 1;
                }
                let [left, right] = sides;
                if left.1 == 0 || right.1 == 0 {
                    continue;
                }
                let cost = |(bounds, count): (H, usize)| {
                    H::area(Scalar, bounds.load(Scalar)) * count as f32
                };
                let cost = cost(left) + cost(right);
                if best.is_none_or(|(.., least)| cost < least) {
                    best = Some((axis, bin, left.1, cost));
                }
            }
        }
        best
    }

    struct Cheapest<'a, H: Hull, C, const N: usize>(&'a [Sorted<H>], &'a Places, C);

    impl<H: Hull, C: Counts, const N: usize> hdtrapeze_simd::Kernel for Cheapest<'_, H, C, N> {
        type Output = Option<Plane<H>>;
        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> Self::Output {
            let filled = Filled::<H, C, N>::with(simd, self.0, self.1);
            cheapest(simd, &filled, self.1)
        }
    }

    fn check<H: Hull, C: Counts, const N: usize>(items: &[Sorted<H>]) -> bool {
        let mut planes = 0;
        for level in Level::available() {
            let places = Places::new(&Extent::of(level, items), [N; 3]);
            let want = one_by_one(items, &places, N);
            let found = level.run(Cheapest::<H, C, N>(items, &places, C::NONE));
            let found = found.map(|plane| {
                let (left, right) = sides(items, &places, &plane);
                let bits = |hull: &H| format!("{:?}", H::boxes(Scalar, [hull; 8]).to_boxes()[0]);
                assert_eq!(bits(&plane.bounds[0]), bits(&left));
                assert_eq!(bits(&plane.bounds[1]), bits(&right));
                (plane.axis, plane.bin, plane.left, plane.cost)
            });
            assert_eq!(found, want, "{level:?}, {} items in {N} bins", items.len());
            planes += usize::from(found.is_some());
        }
        planes > 0
    }

    fn sides<H: Hull>(items: &[Sorted<H>], places: &Places, plane: &Plane<H>) -> (H, H) {
        let mut sides = [H::EMPTY; 2];
        for item in items {
            let own = places.numbers(Scalar, places.place(Scalar, item))[plane.axis];
            let side = &mut sides[usize::from(own >= plane.bin)];
            let own = item.bounds.load(Scalar);
            *side = H::store(H::union::<Scalar>(own, side.load(Scalar)));
        }
        sides.into()
    }

    fn checks<H: Hull>() {
        for slab in [Vec3::ONE, Vec3::new(3.0, 1e-3, 1.0), Vec3::X] {
            for (count, places) in [(2, 0), (3, 0), (9, 0), (64, 0), (255, 0), (255, 2), (40, 3)] {
                let items = items::<H>(count, slab, places);
                assert!(check::<H, Few, 8>(&items));
                assert!(check::<H, Many<8>, 8>(&items));
                assert!(check::<H, Many<16>, 16>(&items));
            }
            // In a row, the last of which is the largest, the last plane is the cheapest.
            let row = |id: u32| {
                let size = if id == 60 { 900.0 } else { 0.01 };
                let at = slab * id as f32;
                let [lo, hi] = [-size, size].map(|size| at + Vec3::splat(size));
                let bounds = LinearBox {
                    lo0: lo,
                    hi0: hi,
                    lo1: lo,
                    hi1: hi,
                };
                Sorted::of(&Item { bounds, id })
            };
            let items: Vec<Sorted<H>> = (0..61).map(row).collect();
            let places = Places::new(&Extent::of(Level::SCALAR, &items), [8; 3]);
            assert_eq!(one_by_one(&items, &places, 8).map(|plane| plane.1), Some(7));
            assert!(check::<H, Few, 8>(&items));
            assert!(check::<H, Many<16>, 16>(&items));
            let same = self::items::<H>(50, slab, 1);
            assert!(!check::<H, Few, 8>(&same));
            assert!(!check::<H, Many<16>, 16>(&same));
            assert!(check::<H, Many<16>, 16>(&self::items::<H>(3000, slab, 0)));
        }
    }

    /// The first bins hold so many items that one more makes no difference in f32.
    struct OneApart;

    impl hdtrapeze_simd::Kernel for OneApart {
        type Output = ();
        #[inline(always)]
        fn run<S: Simd>(self, simd: S) {
            let item = items::<StaticHull>(1, Vec3::ONE, 0)[0];
            let far = items::<StaticHull>(1, Vec3::splat(9.0), 0)[0];
            let places = Places::new(&Extent::of(Level::SCALAR, &[item, far]), [16; 3]);
            let mut filled = Filled::<StaticHull, Many<16>, 16>::with(simd, &[item, far], &places);
            for axis in 0..3 {
                filled.counts.add(axis, 0, 19_999_999);
            }
            let plane = cheapest(simd, &filled, &places).expect("one is far");
            assert_eq!(plane.left, 20_000_000);
        }
    }

    #[test]
    fn one_item_of_many_is_not_rounded_away() {
        for level in Level::available() {
            level.run(OneApart);
        }
    }

    #[test]
    fn the_cheapest_plane_is_found_among_all() {
        checks::<StaticHull>();
        checks::<LinearHull>();
    }
}
