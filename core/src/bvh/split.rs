//! Where a range of items is split in two: the cheapest plane between bins, by surface-area cost.
//!
//! Bins are of centres in mid-shutter. Up to some hundred items that drift apart may be split by how far they go instead: neighbours of
//! one moment, such as hairs that sway, each its own way, have large boxes at all others.

use std::marker::PhantomData;

use hdtrapeze_simd::{Float, Kernel, Level, Mask, Simd};
use rayon::prelude::*;

use super::bins::{Counts, Few, Filled, Many, Places, Plane, WHOLE, cheapest};
use super::build::{Nodes, PARALLEL_ITEMS};
use super::extent::{Extent, Piece};
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
const _: () = assert!(FEW_ITEMS <= Few::MOST);
/// Items that move are split by drift, too, where that differs by more than this part of the extent of their centres. Swaying fur is
/// the same from 0.1 to 1, and has a tenth fewer node tests than without.
const DRIFT: f32 = 0.5;
/// In ranges of up to so many items. Fur of 1 million micropolygons, whose strands sway a dozen times as far as they are apart, is the same with 64;
/// that of 16 million, which sway fifty times as far, has 543 node tests a ray then, 377 with 512, and 374 with 4096.
const DRIFT_ITEMS: usize = 512;
/// What is added to a box, or a centre, that is on a side, and to one that is not: minima pass it over.
const BESIDE: [[f32; 8]; 2] = [[f32::INFINITY; 8], [0.0; 8]];

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
            let (places, plane) = cheapest_of::<S, H, Few, FEW_BINS>(simd, items, extent)?;
            return Some(match kind {
                Nodes::Full => split_full(simd, items, &places, &plane),
                Nodes::Cheap => partition(simd, items, &places, &plane).1,
            });
        }
        if H::MOVES && items.len() <= DRIFT_ITEMS {
            let (places, plane) = cheapest_of::<S, H, Many<BINS>, BINS>(simd, items, extent)?;
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
fn cheapest_of<S: Simd, H: Hull, C: Counts, const N: usize>(
    simd: S,
    items: &[Sorted<H>],
    extent: &Extent<H>,
) -> Option<(Places, Plane<H>)> {
    let best = between::<S, H, C, N>(simd, items, Places::new(extent, [N; 3]));
    if H::MOVES
        && let Some(drift) = drift(simd, items, extent)
        && let Some(other) = between::<S, H, C, N>(simd, items, Places::of_drift(&drift, [N; 3]))
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
fn between<S: Simd, H: Hull, C: Counts, const N: usize>(
    simd: S,
    items: &[Sorted<H>],
    places: Places,
) -> Option<(Places, Plane<H>)> {
    let filled = Filled::<H, C, N>::with(simd, items, &places);
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

/// What is in bins of any number of items.
type InBins<H> = Filled<H, Many<BINS>, BINS>;

struct Fill<'a, H, P>(&'a [P], &'a Places, PhantomData<H>);

impl<H: Hull, P: Piece<H>> Kernel for Fill<'_, H, P> {
    type Output = InBins<H>;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> InBins<H> {
        InBins::with(simd, self.0, self.1)
    }
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
                .reduce(|| InBins::EMPTY, |a, b| a.join(&b))
        } else {
            InBins::with(simd, pieces, &places)
        };
        let plane = cheapest(simd, &filled, &places)?;
        Some(partition(simd, pieces, &places, &plane))
    }
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
    let extent = |side: usize| Extent::around::<S>(plane.bounds[side].load(simd), centres[side]);
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
