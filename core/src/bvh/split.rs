//! Where a range of items is split in two: the cheapest plane between bins, by surface-area cost.

use glam::Vec3A;
use rayon::prelude::*;

use super::build::{Nodes, PARALLEL_ITEMS};
use super::sorted::{Hull, Sorted};

/// Bins on each axis.
const BINS: usize = 16;
/// Bins for small ranges whose nodes are to be full: the number of a side is rounded anyway.
const FEW_BINS: usize = 8;
/// Nodes deeper than this split by halves only. 16 levels leave SAH all the freedom it uses in
/// practice; halving 2^31 items by 8 a level takes at most 11 more.
pub const SAH_DEPTH: usize = 16;
/// Ranges up to this size are split so that nodes are full, where that is asked for.
const FEW_ITEMS: usize = 64;

/// Reorders the items and returns where the second half starts; both are never empty.
pub fn split<H: Hull>(items: &mut [Sorted<H>], kind: Nodes, depth: usize) -> usize {
    let half = match kind {
        Nodes::Cheap => items.len() / 2,
        Nodes::Full => whole_nodes(items.len() / 2, items.len()),
    };
    if depth >= SAH_DEPTH {
        return half;
    }
    let (lo, hi) = centre_range(items);
    let few = kind == Nodes::Full && items.len() <= FEW_ITEMS;
    let bins = if few { FEW_BINS } else { BINS };
    let Some(plane) = best_plane(items, lo, hi, bins) else {
        return half;
    };
    if few {
        return split_full(items, plane.axis, lo, plane.bin as f32 / plane.scale);
    }
    let middle = partition(items, |item| {
        bin_of(
            item.bounds.centre4()[plane.axis],
            lo[plane.axis],
            plane.scale,
            bins,
        ) < plane.bin
    });
    if middle == 0 || middle == items.len() {
        half
    } else {
        middle
    }
}

/// About `left` of `count` items, 9 or more: what fills whole nodes, and leaves some.
fn whole_nodes(left: usize, count: usize) -> usize {
    8 * ((left + 4) / 8).clamp(1, (count - 1) / 8)
}

/// Splits 9 to [`FEW_ITEMS`] items near `at` (above `lo`), so that one side fills whole nodes.
fn split_full<H: Hull>(items: &mut [Sorted<H>], axis: usize, lo: Vec3A, at: f32) -> usize {
    let centre = |item: &Sorted<H>| item.bounds.centre4()[axis];
    let left = items.iter().filter(|i| centre(i) - lo[axis] < at).count();
    let middle = whole_nodes(left, items.len());
    items.select_nth_unstable_by(middle, |a, b| {
        centre(a).total_cmp(&centre(b)).then(a.id.cmp(&b.id))
    });
    middle
}

/// Moves the items that satisfy `left` to the front, and returns their number.
fn partition<H: Hull>(items: &mut [Sorted<H>], left: impl Fn(&Sorted<H>) -> bool) -> usize {
    let mut middle = 0;
    for i in 0..items.len() {
        if left(&items[i]) {
            items.swap(i, middle);
            middle += 1;
        }
    }
    middle
}

fn centre_range<H: Hull>(items: &[Sorted<H>]) -> (Vec3A, Vec3A) {
    let of = |items: &[Sorted<H>]| {
        items.iter().fold(
            (Vec3A::INFINITY, Vec3A::NEG_INFINITY),
            |(lo, hi): (Vec3A, Vec3A), i| {
                let c = i.bounds.centre4();
                (lo.min(c), hi.max(c))
            },
        )
    };
    if items.len() <= PARALLEL_ITEMS {
        return of(items);
    }
    items.par_chunks(PARALLEL_ITEMS).map(of).reduce(
        || (Vec3A::INFINITY, Vec3A::NEG_INFINITY),
        |a, b| (a.0.min(b.0), a.1.max(b.1)),
    )
}

#[inline]
fn bin_of(centre: f32, lo: f32, scale: f32, bins: usize) -> usize {
    // Casts saturate: whatever rounding does, the bin exists.
    (((centre - lo) * scale) as usize).min(bins - 1)
}

/// A split plane: items in bins below `bin` go left.
struct Plane {
    axis: usize,
    bin: usize,
    scale: f32,
}

#[derive(Clone, Copy)]
struct Bin<H> {
    bounds: H,
    count: u32,
}

type Bins<H> = [[Bin<H>; BINS]; 3];

fn no_bins<H: Hull>() -> Bins<H> {
    let bin = Bin {
        bounds: H::EMPTY,
        count: 0,
    };
    [[bin; BINS]; 3]
}

fn fill_bins<H: Hull>(items: &[Sorted<H>], lo: Vec3A, scale: Vec3A, count: usize) -> Bins<H> {
    let mut bins: Bins<H> = no_bins();
    for item in items {
        let c = item.bounds.centre4();
        for axis in 0..3 {
            let bin = &mut bins[axis][bin_of(c[axis], lo[axis], scale[axis], count)];
            bin.bounds = bin.bounds.union(&item.bounds);
            bin.count += 1;
        }
    }
    bins
}

fn join_bins<H: Hull>(mut a: Bins<H>, b: Bins<H>) -> Bins<H> {
    for (x, y) in a.iter_mut().flatten().zip(b.iter().flatten()) {
        x.bounds = x.bounds.union(&y.bounds);
        x.count += y.count;
    }
    a
}

/// The cheapest plane over all axes, or none where every centre is the same.
fn best_plane<H: Hull>(
    items: &[Sorted<H>],
    lo: Vec3A,
    hi: Vec3A,
    bin_count: usize,
) -> Option<Plane> {
    // Not a division by an extent: an axis without extent gets one bin, and is passed over.
    let scale = Vec3A::from_array([0, 1, 2].map(|a| {
        let s = bin_count as f32 / (hi[a] - lo[a]);
        if s.is_finite() { s } else { 0.0 }
    }));
    let bins = if items.len() > PARALLEL_ITEMS {
        items
            .par_chunks(PARALLEL_ITEMS)
            .map(|chunk| fill_bins(chunk, lo, scale, bin_count))
            .reduce(no_bins, join_bins)
    } else {
        fill_bins(items, lo, scale, bin_count)
    };
    let mut best: Option<(f32, Plane)> = None;
    for axis in (0..3).filter(|&a| scale[a] > 0.0) {
        let bins = &bins[axis];
        let mut right_cost = [0.0f32; BINS];
        let mut side = H::EMPTY;
        let mut count = 0;
        for i in (1..bin_count).rev() {
            side = side.union(&bins[i].bounds);
            count += bins[i].count;
            right_cost[i] = side.area() * count as f32;
        }
        let total = count + bins[0].count;
        let mut side = H::EMPTY;
        let mut count = 0;
        for i in 1..bin_count {
            side = side.union(&bins[i - 1].bounds);
            count += bins[i - 1].count;
            if count == 0 || count == total {
                continue;
            }
            let cost = side.area() * count as f32 + right_cost[i];
            if best.as_ref().is_none_or(|(c, _)| cost < *c) {
                let scale = scale[axis];
                best = Some((
                    cost,
                    Plane {
                        axis,
                        bin: i,
                        scale,
                    },
                ));
            }
        }
    }
    best.map(|(_, plane)| plane)
}
