//! Where a range of items is split in two: the cheapest plane between bins, by surface-area cost.
//!
//! Bins are of centres in mid-shutter. Up to some hundred items that drift apart may be split by how far they go instead: neighbours of
//! one moment, such as hairs that sway, each its own way, have large boxes at all others.

use std::marker::PhantomData;

use hdtrapeze_simd::{Float, Kernel, Level, Mask, Scalar, Simd};
use rayon::prelude::*;

use super::build::{Nodes, PARALLEL_ITEMS};
use super::sorted::{Hull, Sorted};

/// Bins on each axis.
const BINS: usize = 16;
/// Bins for small ranges: evaluating more takes longer than filling them, for hardly better nodes.
const FEW_BINS: usize = 8;
/// Nodes deeper than this split by halves only. 16 levels leave SAH all the freedom it uses in
/// practice; halving 2^31 items by 8 a level takes at most 11 more.
pub const SAH_DEPTH: usize = 16;
/// Ranges up to this size are small. They are split so that nodes are full, where that is asked for.
const FEW_ITEMS: usize = 64;
/// Items that move are split by drift, too, where that differs by more than this part of the extent of their centres. Swaying fur is
/// the same from 0.1 to 1, and has a tenth fewer node tests than without.
const DRIFT: f32 = 0.5;
/// In ranges of up to so many items. Fur of 1 million micropolygons, whose strands sway a dozen times as far as they are apart, is the same with 64;
/// that of 16 million, which sway fifty times as far, has 543 node tests a ray then, 377 with 512, and 374 with 4096.
const DRIFT_ITEMS: usize = 512;
/// What is added to a box, or a centre, that is on a side, and to one that is not: minima pass it over.
const BESIDE: [[f32; 8]; 2] = [[f32::INFINITY; 8], [0.0; 8]];
/// Above it, f32 are whole numbers: sums are rounded to the nearest, and end in it.
const WHOLE: f32 = (1 << 23) as f32;

/// What items extend over.
#[derive(Clone, Copy)]
pub struct Extent<H> {
    /// The box around theirs.
    pub bounds: H,
    /// The box around its centres: the least in each lane of [`Hull::centre4`].
    centres: [f32; 8],
}

impl<H: Hull> Extent<H> {
    const EMPTY: Self = Self {
        bounds: H::EMPTY,
        centres: [f32::INFINITY; 8],
    };

    /// Of boxes, and [centres](Piece::centres), joined.
    #[inline(always)]
    pub fn around<S: Simd>(bounds: H::In<S>, centres: S::F8) -> Self {
        Self {
            bounds: H::store::<S>(bounds),
            centres: centres.to_array(),
        }
    }

    /// As [`Piece::centres`].
    #[inline(always)]
    pub fn centres<S: Simd>(&self, simd: S) -> S::F8 {
        simd.from8(&self.centres)
    }

    /// How far centres go along each axis.
    pub fn spans(&self) -> [f32; 3] {
        let c = &self.centres;
        [-c[4] - c[0], -c[5] - c[1], -c[6] - c[2]]
    }

    /// Of an item that is not split.
    pub fn single(item: &Sorted<H>) -> Self {
        Self {
            bounds: item.bounds,
            ..Self::EMPTY
        }
    }

    /// Of items, in parallel where there are many.
    pub fn of(level: Level, items: &[Sorted<H>]) -> Self {
        if items.len() <= PARALLEL_ITEMS {
            return level.run(Extend(items));
        }
        let chunks: Vec<&[Sorted<H>]> = items.chunks(PARALLEL_ITEMS).collect();
        Self::of_all(level, &chunks)
    }

    /// Of chunks of items, in parallel.
    pub fn of_all(level: Level, chunks: &[&[Sorted<H>]]) -> Self {
        let extents = chunks.par_iter().map(|items| level.run(Extend(items)));
        extents.reduce(|| Self::EMPTY, |a, b| a.union(&b))
    }

    fn union(&self, o: &Self) -> Self {
        let [a, b] = [self, o].map(|e| e.bounds.load(Scalar));
        let [c, d] = [self, o].map(|e| Scalar.from8(&e.centres));
        Self {
            bounds: H::store(H::union::<Scalar>(a, b)),
            centres: c.min(d).to_array(),
        }
    }
}

struct Extend<'a, H: Hull>(&'a [Sorted<H>]);

impl<H: Hull> Kernel for Extend<'_, H> {
    type Output = Extent<H>;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Extent<H> {
        let mut bounds = H::EMPTY.load(simd);
        let mut centres = simd.all8(f32::INFINITY);
        for item in self.0 {
            let own = item.bounds.load(simd);
            bounds = H::union::<S>(own, bounds);
            centres = H::centre4(simd, own).min(centres);
        }
        Extent::around::<S>(bounds, centres)
    }
}

/// What is sorted into bins: an item, or several.
pub trait Piece<H: Hull>: Copy + Sync {
    /// The box around it.
    fn bounds(&self) -> &H;
    /// The least of [`Hull::centre4`], by lane, over its items.
    fn centres<S: Simd>(&self, simd: S) -> S::F8;
    /// What its bin is chosen by, like [`Hull::centre4`].
    fn place<S: Simd>(&self, simd: S) -> S::F8;
    /// Items.
    fn count(&self) -> u32;
}

impl<H: Hull> Piece<H> for Sorted<H> {
    #[inline(always)]
    fn bounds(&self) -> &H {
        &self.bounds
    }
    #[inline(always)]
    fn centres<S: Simd>(&self, simd: S) -> S::F8 {
        H::centre4(simd, self.bounds.load(simd))
    }
    #[inline(always)]
    fn place<S: Simd>(&self, simd: S) -> S::F8 {
        self.centres(simd)
    }
    #[inline(always)]
    fn count(&self) -> u32 {
        1
    }
}

/// Items on both sides of a split.
#[derive(Clone, Copy)]
pub struct Halves<H> {
    /// Where the second side starts; neither is empty.
    pub middle: usize,
    /// What the sides extend over.
    pub extents: [Extent<H>; 2],
}

/// Reorders two or more items, so that each side of the split is a range.
pub fn split<H: Hull>(
    level: Level,
    items: &mut [Sorted<H>],
    extent: &Extent<H>,
    kind: Nodes,
    depth: usize,
) -> Halves<H> {
    if items.len() > 2
        && depth < SAH_DEPTH
        && let Some(halves) = level.run(SplitByArea {
            level,
            items,
            extent,
            kind,
        })
    {
        return halves;
    }
    let middle = match kind {
        Nodes::Cheap => items.len() / 2,
        Nodes::Full if items.len() <= 8 => items.len() / 2,
        Nodes::Full => whole_nodes(items.len() / 2, items.len()),
    };
    let (left, right) = items.split_at(middle);
    Halves {
        middle,
        extents: [Extent::of(level, left), Extent::of(level, right)],
    }
}

/// About `left` of `count` items, 9 or more, so that one side fills whole nodes: a node of 8 takes up one item, or makes 8 of
/// one, so full nodes hold `1 + 7 n` items.
fn whole_nodes(left: usize, count: usize) -> usize {
    let whole = |items: usize| 1 + 7 * ((items + 2) / 7).clamp(1, (count - 2) / 7);
    let (first, second) = (whole(left), count - whole(count - left));
    if first.abs_diff(left) <= second.abs_diff(left) {
        first
    } else {
        second
    }
}

/// The cheapest split; none where there is none.
struct SplitByArea<'a, H: Hull> {
    level: Level,
    items: &'a mut [Sorted<H>],
    extent: &'a Extent<H>,
    kind: Nodes,
}

impl<H: Hull> Kernel for SplitByArea<'_, H> {
    type Output = Option<Halves<H>>;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Option<Halves<H>> {
        let Self {
            level,
            items,
            extent,
            kind,
        } = self;
        if items.len() <= FEW_ITEMS {
            let (places, plane) = cheapest_of::<S, H, FEW_BINS>(simd, items, extent)?;
            return Some(match kind {
                Nodes::Full => split_full(simd, items, &places, &plane),
                Nodes::Cheap => partition(simd, items, &places, &plane).1,
            });
        }
        if H::MOVES && items.len() <= DRIFT_ITEMS {
            let (places, plane) = cheapest_of::<S, H, BINS>(simd, items, extent)?;
            return Some(partition(simd, items, &places, &plane).1);
        }
        let pieces = Pieces {
            level,
            pieces: items,
            extent,
        };
        pieces.run(simd).map(|(_, halves)| halves)
    }
}

/// The cheapest plane between bins of centres, or of drift where that is cheaper, and the bins.
#[inline(always)]
fn cheapest_of<S: Simd, H: Hull, const N: usize>(
    simd: S,
    items: &[Sorted<H>],
    extent: &Extent<H>,
) -> Option<(Places, Plane<H>)> {
    let best = between::<S, H, N>(simd, items, Places::new(extent, [N; 3]));
    if H::MOVES
        && let Some(drift) = drift(simd, items, extent)
        && let Some(other) = between::<S, H, N>(simd, items, Places::of_drift(&drift, [N; 3]))
        && best
            .as_ref()
            .is_none_or(|(_, plane)| other.1.cost < plane.cost)
    {
        return Some(other);
    }
    best
}

/// The cheapest plane between some bins, and these.
#[inline(always)]
fn between<S: Simd, H: Hull, const N: usize>(
    simd: S,
    items: &[Sorted<H>],
    places: Places,
) -> Option<(Places, Plane<H>)> {
    let filled = fill::<S, H, _, N>(simd, items, &places);
    cheapest(simd, &filled, &places).map(|plane| (places, plane))
}

/// The box around the [drifts](Hull::drift4) of items, in place of that around their centres, where they differ much.
#[inline(always)]
fn drift<S: Simd, H: Hull>(simd: S, items: &[Sorted<H>], extent: &Extent<H>) -> Option<Extent<H>> {
    let mut drifts = simd.all8(f32::INFINITY);
    for item in items {
        drifts = H::drift4(simd, item.bounds.load(simd)).min(drifts);
    }
    let drift = Extent::around::<S>(extent.bounds.load(simd), drifts);
    let most = |extent: &Extent<H>| {
        let [x, y, z] = extent.spans();
        x.max(y).max(z)
    };
    (most(&drift) > DRIFT * most(extent)).then_some(drift)
}

/// Reorders pieces, so that each side of the cheapest split is a range; returns where the second begins. None where there is
/// no split.
pub fn split_pieces<H: Hull, P: Piece<H>>(
    level: Level,
    pieces: &mut [P],
    extent: &Extent<H>,
) -> Option<(usize, Halves<H>)> {
    level.run(Pieces {
        level,
        pieces,
        extent,
    })
}

struct Pieces<'a, H, P> {
    level: Level,
    pieces: &'a mut [P],
    extent: &'a Extent<H>,
}

impl<H: Hull, P: Piece<H>> Kernel for Pieces<'_, H, P> {
    type Output = Option<(usize, Halves<H>)>;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        let Self {
            level,
            pieces,
            extent,
        } = self;
        let places = Places::new(extent, [BINS; 3]);
        let filled = if pieces.len() > PARALLEL_ITEMS {
            pieces
                .par_chunks(PARALLEL_ITEMS)
                .map(|pieces| level.run(Fill(pieces, &places, PhantomData)))
                .reduce(|| Filled::EMPTY, |a, b| a.join(&b))
        } else {
            fill::<S, H, P, BINS>(simd, pieces, &places)
        };
        let plane = cheapest(simd, &filled, &places)?;
        Some(partition(simd, pieces, &places, &plane))
    }
}

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
            (lo[a], scale[a]) = (extent.centres[a], if s.is_finite() { s } else { 0.0 });
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
    fn of_drift<H: Hull>(drift: &Extent<H>, counts: [usize; 3]) -> Self {
        Self {
            drift: true,
            ..Self::new(drift, counts)
        }
    }

    /// What the bin of a piece is chosen by.
    #[inline(always)]
    fn place<S: Simd, H: Hull>(&self, simd: S, piece: &impl Piece<H>) -> S::F8 {
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
    fn whole<S: Simd>(&self, simd: S, place: S::F8) -> S::F8 {
        let at = (place - simd.from8(&self.lo)) * simd.from8(&self.scale) - simd.all8(0.5);
        at.max(simd.all8(0.0)).min(simd.from8(&self.most)) + simd.all8(WHOLE)
    }
}

/// A split plane: items in bins below `bin` go left.
struct Plane<H> {
    axis: usize,
    bin: usize,
    /// Items on the left.
    left: usize,
    /// Boxes of both sides.
    bounds: [H; 2],
    /// The sum of their areas, each as often as it has items.
    cost: f32,
}

/// What is in bins on each axis.
struct Filled<H, const N: usize> {
    bounds: [[H; N]; 3],
    counts: [[u32; N]; 3],
}

impl<H: Hull, const N: usize> Filled<H, N> {
    const EMPTY: Self = Self {
        bounds: [[H::EMPTY; N]; 3],
        counts: [[0; N]; 3],
    };

    fn join(mut self, o: &Self) -> Self {
        let both = self.bounds.iter_mut().zip(&o.bounds);
        for (a, b) in both.flat_map(|(a, b)| a.iter_mut().zip(b)) {
            *a = H::store(H::union::<Scalar>(a.load(Scalar), b.load(Scalar)));
        }
        let both = self.counts.iter_mut().zip(&o.counts);
        for (a, b) in both.flat_map(|(a, b)| a.iter_mut().zip(b)) {
            *a += b;
        }
        self
    }
}

struct Fill<'a, H, P>(&'a [P], &'a Places, PhantomData<H>);

impl<H: Hull, P: Piece<H>> Kernel for Fill<'_, H, P> {
    type Output = Filled<H, BINS>;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Filled<H, BINS> {
        fill(simd, self.0, self.1)
    }
}

#[inline(always)]
fn fill<S: Simd, H: Hull, P: Piece<H>, const N: usize>(
    simd: S,
    pieces: &[P],
    places: &Places,
) -> Filled<H, N> {
    let mut filled = Filled::<H, N>::EMPTY;
    for piece in pieces {
        let own = piece.bounds().load(simd);
        let numbers = places.numbers(simd, places.place(simd, piece));
        for (axis, number) in numbers.into_iter().enumerate() {
            // Whatever rounding does, the bin exists.
            let number = number % N;
            let bin = &mut filled.bounds[axis][number];
            *bin = H::store::<S>(H::union::<S>(own, bin.load(simd)));
            filled.counts[axis][number] += piece.count();
        }
    }
    filled
}

/// The cheapest plane over all axes, or none where every centre is the same.
#[inline(always)]
fn cheapest<S: Simd, H: Hull, const N: usize>(
    simd: S,
    filled: &Filled<H, N>,
    places: &Places,
) -> Option<Plane<H>> {
    let mut best: Option<Plane<H>> = None;
    for axis in 0..3 {
        if places.scale[axis] <= 0.0 {
            continue;
        }
        let (bounds, counts) = (&filled.bounds[axis], &filled.counts[axis]);
        let mut right = [(H::EMPTY, 0.0f32); N];
        let (mut side, mut count) = (H::EMPTY.load(simd), 0);
        for i in (1..N).rev() {
            side = H::union::<S>(side, bounds[i].load(simd));
            count += counts[i];
            right[i] = (H::store::<S>(side), H::area(simd, side) * count as f32);
        }
        let total = count + counts[0];
        let (mut side, mut count) = (H::EMPTY.load(simd), 0);
        for i in 1..N {
            side = H::union::<S>(side, bounds[i - 1].load(simd));
            count += counts[i - 1];
            if count == 0 || count == total {
                continue;
            }
            let cost = H::area(simd, side) * count as f32 + right[i].1;
            if best.as_ref().is_none_or(|best| cost < best.cost) {
                best = Some(Plane {
                    axis,
                    bin: i,
                    left: count as usize,
                    bounds: [H::store::<S>(side), right[i].0],
                    cost,
                });
            }
        }
    }
    best
}

/// Moves pieces to their sides of a plane; returns where the second begins.
#[inline(always)]
fn partition<S: Simd, H: Hull, P: Piece<H>>(
    simd: S,
    pieces: &mut [P],
    places: &Places,
    plane: &Plane<H>,
) -> (usize, Halves<H>) {
    let bin = simd.all8(WHOLE + plane.bin as f32);
    let mut centres = [simd.all8(f32::INFINITY); 2];
    let mut middle = 0;
    for i in 0..pieces.len() {
        let piece = pieces[i];
        let below = places
            .whole(simd, places.place(simd, &piece))
            .lt(bin)
            .bits();
        let left = (below >> plane.axis & 1) as usize;
        let own = piece.centres(simd);
        centres[0] = (own + simd.from8(&BESIDE[left])).min(centres[0]);
        centres[1] = (own + simd.from8(&BESIDE[1 - left])).min(centres[1]);
        // Without a branch, which nobody could foresee: the first piece on the right makes room.
        pieces[i] = pieces[middle];
        pieces[middle] = piece;
        middle += left;
    }
    debug_assert!(middle > 0 && middle < pieces.len());
    let extent = |side: usize| Extent {
        bounds: plane.bounds[side],
        centres: centres[side].to_array(),
    };
    let halves = Halves {
        middle: plane.left,
        extents: [extent(0), extent(1)],
    };
    (middle, halves)
}

/// Splits 9 to [`FEW_ITEMS`] items near a plane, so that one side fills whole nodes.
#[inline(always)]
fn split_full<S: Simd, H: Hull>(
    simd: S,
    items: &mut [Sorted<H>],
    places: &Places,
    plane: &Plane<H>,
) -> Halves<H> {
    let left = whole_nodes(plane.left, items.len());
    let mut keys = [f32::INFINITY; FEW_ITEMS];
    for (key, item) in keys.iter_mut().zip(&*items) {
        *key = places.place(simd, item).to_array()[plane.axis % 8];
    }
    let mut bounds = [H::EMPTY.load(simd); 2];
    let mut centres = [simd.all8(f32::INFINITY); 2];
    let mut middle = 0;
    for i in 0..items.len() {
        // Its place follows from how many are less, or the same and before it.
        let own = simd.all16(keys[i % FEW_ITEMS]);
        let before = (1u64 << (i % FEW_ITEMS)) - 1;
        let mut place = 0;
        for (part, keys) in keys.as_chunks::<16>().0.iter().enumerate() {
            if 16 * part < items.len() {
                let keys = simd.from16(keys);
                let same = keys.le(own).bits() & (before >> (16 * part)) as u32;
                place += (keys.lt(own).bits() | same).count_ones() as usize;
            }
        }
        let is_left = usize::from(place < left);
        let item = items[i];
        let own = item.bounds.load(simd);
        let centre = H::centre4(simd, own);
        for side in 0..2 {
            let beside = simd.from8(&BESIDE[if side == 0 { is_left } else { 1 - is_left }]);
            bounds[side] = H::union::<S>(H::unless::<S>(own, beside), bounds[side]);
            centres[side] = (centre + beside).min(centres[side]);
        }
        items[i] = items[middle];
        items[middle] = item;
        middle += is_left;
    }
    debug_assert!(middle == left && middle > 0 && middle < items.len());
    let extent = |side: usize| Extent::around::<S>(bounds[side], centres[side]);
    Halves {
        middle,
        extents: [extent(0), extent(1)],
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::super::LinearBox;
    use super::super::build::Item;
    use super::super::sorted::LinearHull;
    use super::*;

    /// Side by side in mid-shutter, by turns on their way to both sides.
    #[test]
    fn what_drifts_apart_is_split_by_drift_up_to_some_hundred_items() {
        let item = |id: u32| {
            let at = Vec3::new(id as f32 * 0.01, 0.0, 0.0);
            let drift = if id.is_multiple_of(2) {
                Vec3::Y
            } else {
                Vec3::NEG_Y
            } * 50.0;
            let size = Vec3::splat(0.1);
            let bounds = LinearBox {
                lo0: at - drift,
                hi0: at - drift + size,
                lo1: at + drift,
                hi1: at + drift + size,
            };
            Sorted::<LinearHull>::of(&Item { bounds, id })
        };
        for level in Level::available() {
            for (count, by_drift) in [
                (FEW_ITEMS, true),
                (FEW_ITEMS + 2, true),
                (DRIFT_ITEMS, true),
                (DRIFT_ITEMS + 2, false),
            ] {
                let mut items: Vec<_> = (0..count as u32).map(item).collect();
                let extent = Extent::of(level, &items);
                let halves = split(level, &mut items, &extent, Nodes::Cheap, 0);
                let (left, right) = items.split_at(halves.middle);
                let odd = |items: &[Sorted<LinearHull>]| {
                    items.iter().filter(|item| item.id() % 2 == 1).count()
                };
                let (some, all) = (odd(left).min(odd(right)), odd(left).max(odd(right)));
                assert_eq!((some, all) == (0, count / 2), by_drift, "{count}");
            }
        }
    }
}
