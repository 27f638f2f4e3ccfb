//! Where a range of items is split in two: the cheapest plane between bins, by surface-area cost.

use glam::Vec3A;
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

/// What items extend over.
#[derive(Clone, Copy)]
pub struct Extent<H> {
    /// The box around theirs.
    pub bounds: H,
    /// The box around its centres, see [`Hull::centre4`].
    centres: [Vec3A; 2],
}

impl<H: Hull> Extent<H> {
    const EMPTY: Self = Self {
        bounds: H::EMPTY,
        centres: [Vec3A::INFINITY, Vec3A::NEG_INFINITY],
    };

    /// Of items, in parallel where there are many.
    pub fn of(items: &[Sorted<H>]) -> Self {
        if items.len() <= PARALLEL_ITEMS {
            let with = |e: Self, item: &Sorted<H>| e.with(item.bounds.centre4(), &item.bounds);
            return items.iter().fold(Self::EMPTY, with);
        }
        items
            .par_chunks(PARALLEL_ITEMS)
            .map(Self::of)
            .reduce(|| Self::EMPTY, |a, b| a.union(&b))
    }

    #[inline(always)]
    fn with(&self, centre: Vec3A, bounds: &H) -> Self {
        Self {
            bounds: self.bounds.union(bounds),
            centres: [self.centres[0].min(centre), self.centres[1].max(centre)],
        }
    }

    fn union(&self, o: &Self) -> Self {
        Self {
            bounds: self.bounds.union(&o.bounds),
            centres: [
                self.centres[0].min(o.centres[0]),
                self.centres[1].max(o.centres[1]),
            ],
        }
    }
}

/// Items on both sides of a split.
pub struct Halves<H> {
    /// Where the second side starts; neither is empty.
    pub middle: usize,
    /// What the sides extend over.
    pub extents: [Extent<H>; 2],
}

/// Reorders two or more items, so that each side of the split is a range.
pub fn split<H: Hull>(
    items: &mut [Sorted<H>],
    extent: &Extent<H>,
    kind: Nodes,
    depth: usize,
) -> Halves<H> {
    if items.len() > 2
        && depth < SAH_DEPTH
        && let Some(halves) = split_by_area(items, extent, kind)
    {
        return halves;
    }
    let half = match kind {
        Nodes::Cheap => items.len() / 2,
        Nodes::Full if items.len() <= 8 => items.len() / 2,
        Nodes::Full => whole_nodes(items.len() / 2, items.len()),
    };
    Halves::at(items, half)
}

impl<H: Hull> Halves<H> {
    fn at(items: &[Sorted<H>], middle: usize) -> Self {
        let (left, right) = items.split_at(middle);
        Self {
            middle,
            extents: [Extent::of(left), Extent::of(right)],
        }
    }
}

/// The cheapest split; none where there is none.
fn split_by_area<H: Hull>(
    items: &mut [Sorted<H>],
    extent: &Extent<H>,
    kind: Nodes,
) -> Option<Halves<H>> {
    let full = kind == Nodes::Full && items.len() <= FEW_ITEMS;
    let bins = Bins::new(
        extent,
        if items.len() <= FEW_ITEMS {
            FEW_BINS
        } else {
            BINS
        },
    );
    let plane = best_plane(items, &bins)?;
    if full {
        let middle = split_full(
            items,
            plane.axis,
            bins.lo,
            plane.bin as f32 / bins.scale[plane.axis],
        );
        return Some(Halves::at(items, middle));
    }
    let mut extents = [Extent::EMPTY; 2];
    let mut middle = 0;
    for i in 0..items.len() {
        let item = &items[i];
        let centre = item.bounds.centre4();
        let left = bins.numbers(centre)[plane.axis] < plane.bin;
        let side = &mut extents[usize::from(!left)];
        *side = side.with(centre, &item.bounds);
        if left {
            items.swap(i, middle);
            middle += 1;
        }
    }
    debug_assert!(middle > 0 && middle < items.len());
    Some(Halves { middle, extents })
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

/// Where bins are, on each axis: numbers grow with centres.
#[derive(Clone, Copy)]
struct Bins {
    count: usize,
    lo: Vec3A,
    /// Bins in a unit; 0 on an axis without extent.
    scale: Vec3A,
}

impl Bins {
    fn new<H>(extent: &Extent<H>, count: usize) -> Self {
        let [lo, hi] = extent.centres;
        // Not a division by an extent: an axis without extent gets one bin, and is passed over.
        let scale = Vec3A::from_array([0, 1, 2].map(|a| {
            let s = count as f32 / (hi[a] - lo[a]);
            if s.is_finite() { s } else { 0.0 }
        }));
        Self { count, lo, scale }
    }

    /// Bins of a centre.
    #[inline(always)]
    fn numbers(&self, centre: Vec3A) -> [usize; 3] {
        /// Above it, f32 are whole numbers: sums are rounded to the nearest, and end in it.
        const WHOLE: f32 = (1 << 23) as f32;
        let most = Vec3A::splat((self.count - 1) as f32);
        let at = (centre - self.lo) * self.scale - Vec3A::splat(0.5);
        let whole = at.max(Vec3A::ZERO).min(most) + Vec3A::splat(WHOLE);
        // Whatever rounding does, the bin exists.
        whole.to_array().map(|x| x.to_bits() as usize % BINS)
    }
}

/// A split plane: items in bins below `bin` go left.
struct Plane {
    axis: usize,
    bin: usize,
}

#[derive(Clone, Copy)]
struct Bin<H> {
    bounds: H,
    count: u32,
}

impl<H: Hull> Bin<H> {
    const EMPTY: Self = Self {
        bounds: H::EMPTY,
        count: 0,
    };

    #[inline(always)]
    fn union(&self, o: &Self) -> Self {
        Self {
            bounds: self.bounds.union(&o.bounds),
            count: self.count + o.count,
        }
    }

    #[inline(always)]
    fn cost(&self) -> f32 {
        self.bounds.area() * self.count as f32
    }
}

type Filled<H, const N: usize> = [[Bin<H>; N]; 3];

fn fill<H: Hull, const N: usize>(items: &[Sorted<H>], bins: &Bins) -> Filled<H, N> {
    let mut filled: Filled<H, N> = [[Bin::EMPTY; N]; 3];
    for item in items {
        let numbers = bins.numbers(item.bounds.centre4());
        for axis in 0..3 {
            let bin = &mut filled[axis][numbers[axis] % N];
            bin.bounds = bin.bounds.union(&item.bounds);
            bin.count += 1;
        }
    }
    filled
}

fn join<H: Hull, const N: usize>(mut a: Filled<H, N>, b: Filled<H, N>) -> Filled<H, N> {
    for (x, y) in a.iter_mut().flatten().zip(b.iter().flatten()) {
        *x = x.union(y);
    }
    a
}

/// The cheapest plane over all axes, or none where every centre is the same.
fn best_plane<H: Hull>(items: &[Sorted<H>], bins: &Bins) -> Option<Plane> {
    if bins.count == FEW_BINS {
        return cheapest(&fill::<H, FEW_BINS>(items, bins), bins);
    }
    let filled = if items.len() > PARALLEL_ITEMS {
        items
            .par_chunks(PARALLEL_ITEMS)
            .map(|chunk| fill::<H, BINS>(chunk, bins))
            .reduce(|| [[Bin::EMPTY; BINS]; 3], join)
    } else {
        fill::<H, BINS>(items, bins)
    };
    cheapest(&filled, bins)
}

fn cheapest<H: Hull, const N: usize>(filled: &Filled<H, N>, bins: &Bins) -> Option<Plane> {
    let mut best: Option<(f32, Plane)> = None;
    for axis in (0..3).filter(|&a| bins.scale[a] > 0.0) {
        let bins = &filled[axis];
        let mut right_cost = [0.0f32; N];
        let mut side = Bin::EMPTY;
        for i in (1..N).rev() {
            side = side.union(&bins[i]);
            right_cost[i] = side.cost();
        }
        let total = side.count + bins[0].count;
        let mut side = Bin::EMPTY;
        for i in 1..N {
            side = side.union(&bins[i - 1]);
            if side.count == 0 || side.count == total {
                continue;
            }
            let cost = side.cost() + right_cost[i];
            if best.as_ref().is_none_or(|(c, _)| cost < *c) {
                best = Some((cost, Plane { axis, bin: i }));
            }
        }
    }
    best.map(|(_, plane)| plane)
}
