//! Ranges of items while a tree is built: each becomes a child of a node.

use arrayvec::ArrayVec;
use hdtrapeze_simd::{Kernel, Level, Scalar, Simd};
use rayon::prelude::*;

use super::build::{Nodes, PARALLEL_ITEMS};
use super::coarse::{Chunks, Known};
use super::extent::Extent;
use super::sorted::{Hull, Sorted};
use super::split::split;

/// The items of a range.
pub enum Items<'a, H: Hull> {
    /// In memory side by side.
    There(&'a mut [Sorted<H>]),
    /// The same, by themselves.
    Own(Vec<Sorted<H>>),
    /// By their numbers, in the order of splits that are known: as long as these last, items are copied only when a thread comes to
    /// as many as its caches hold.
    Numbered(&'a [u32], &'a Chunks<'a, H>),
}

impl<'a, H: Hull> Items<'a, H> {
    /// How many they are.
    pub fn len(&self) -> usize {
        match self {
            Self::There(items) => items.len(),
            Self::Own(items) => items.len(),
            Self::Numbered(numbers, _) => numbers.len(),
        }
    }

    /// The first of them.
    pub fn first(&self) -> Option<&Sorted<H>> {
        match self {
            Self::There(items) => items.first(),
            Self::Own(items) => items.first(),
            Self::Numbered(numbers, chunks) => numbers.first().map(|&number| chunks.item(number)),
        }
    }

    /// All of them side by side, so that they may change places.
    pub fn side_by_side(&mut self) -> &mut [Sorted<H>] {
        if let Self::Numbered(numbers, chunks) = self {
            *self = Self::Own(if numbers.len() > PARALLEL_ITEMS {
                let item = |&i: &u32| *chunks.item(i);
                let mut items = Vec::new();
                hdtrapeze_pages::reserve(&mut items, numbers.len());
                numbers.par_iter().map(item).collect_into_vec(&mut items);
                items
            } else {
                Level::best().run(Copied { numbers, chunks })
            });
        }
        match self {
            Self::There(items) => items,
            Self::Own(items) => items,
            Self::Numbered(..) => &mut [],
        }
    }

    /// The first `middle`, and the others.
    fn split_at(self, middle: usize) -> [Self; 2] {
        match self {
            Self::There(items) => {
                let (left, right) = items.split_at_mut(middle);
                [Self::There(left), Self::There(right)]
            }
            Self::Own(mut items) => {
                let right = items.split_off(middle);
                [Self::Own(items), Self::Own(right)]
            }
            Self::Numbered(numbers, chunks) => {
                let (left, right) = numbers.split_at(middle);
                [Self::Numbered(left, chunks), Self::Numbered(right, chunks)]
            }
        }
    }
}

/// Items by their numbers.
struct Copied<'a, H: Hull> {
    numbers: &'a [u32],
    chunks: &'a Chunks<'a, H>,
}

impl<H: Hull> Kernel for Copied<'_, H> {
    type Output = Vec<Sorted<H>>;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Vec<Sorted<H>> {
        let Self { numbers, chunks } = self;
        let item = |at| *chunks.item_of(simd, numbers, at);
        (0..numbers.len()).map(item).collect()
    }
}

/// A range of items that becomes a child.
pub struct Range<'a, H: Hull> {
    /// At least one.
    pub items: Items<'a, H>,
    /// What they extend over.
    pub extent: Extent<H>,
    area: f32,
    /// Its split, where that is known.
    pub known: Option<&'a Known<H>>,
}

impl<'a, H: Hull> Range<'a, H> {
    /// Items that extend so far.
    pub fn new(items: Items<'a, H>, extent: Extent<H>, known: Option<&'a Known<H>>) -> Self {
        Self {
            items,
            extent,
            known,
            area: H::area(Scalar, extent.bounds.load(Scalar)),
        }
    }

    /// One item.
    fn single(items: Items<'a, H>, item: &Sorted<H>) -> Self {
        Self {
            items,
            extent: Extent::single(item),
            area: 0.0,
            known: None,
        }
    }

    /// The item of a range that has no others.
    pub fn only(&self) -> Option<&Sorted<H>> {
        self.items.first().filter(|_| self.items.len() == 1)
    }

    /// Both parts of a range of two items or more, split as is known or where that is cheapest.
    fn split(mut self, level: Level, kind: Nodes, depth: usize) -> [Self; 2] {
        let halves = match self.known {
            Some(known) => known.halves,
            None => split(level, self.items.side_by_side(), &self.extent, kind, depth),
        };
        let known = |side: usize| self.known.and_then(|known| known.below[side].as_deref());
        let [a, b] = halves.extents;
        let [left, right] = self.items.split_at(halves.middle);
        [
            Range::new(left, a, known(0)),
            Range::new(right, b, known(1)),
        ]
    }
}

/// Those of a node.
pub type Children<'a, H> = ArrayVec<Range<'a, H>, 8>;

/// Each item of a range by itself.
fn singles<'a, H: Hull>(items: Items<'a, H>, ranges: &mut Children<'a, H>) {
    match items {
        Items::There(items) => {
            let all = items.chunks_mut(1).map(|item| {
                let only = item[0];
                Range::single(Items::There(item), &only)
            });
            ranges.extend(all);
        }
        mut items => {
            let all = items.side_by_side().iter();
            ranges.extend(all.map(|item| Range::single(Items::Own(vec![*item]), item)));
        }
    }
}

/// The children of a node over a range of more than 8 items: up to 8.
pub fn children<'a, H: Hull>(
    range: Range<'a, H>,
    level: Level,
    kind: Nodes,
    depth: usize,
) -> Children<'a, H> {
    let mut ranges = Children::new();
    ranges.push(range);
    // Up to 8 items are one full node.
    let least = if kind == Nodes::Full { 8 } else { 1 };
    while ranges.len() < 8 {
        // The largest range first. Ties (and areas that are all 0) go to the one with most
        // items, so that flat input stays balanced too.
        let widest = (0..ranges.len())
            .filter(|&i| ranges[i].items.len() > least)
            .max_by(|&a, &b| {
                let key = |i: usize| (ranges[i].area, ranges[i].items.len());
                let (a, b) = (key(a), key(b));
                a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
            });
        let Some(widest) = widest else { break };
        let range = ranges.swap_remove(widest);
        ranges.extend(range.split(level, kind, depth));
    }
    // What fits into this node needs none of its own.
    while let Some(smallest) = (0..ranges.len())
        .filter(|&i| ranges[i].items.len() > 1)
        .min_by_key(|&i| ranges[i].items.len())
        .filter(|&i| ranges.len() + ranges[i].items.len() <= 9)
    {
        let range = ranges.swap_remove(smallest);
        singles(range.items, &mut ranges);
    }
    ranges
}
