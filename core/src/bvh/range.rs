//! Ranges of items while a tree is built: each becomes a child of a node.

use arrayvec::ArrayVec;
use hdtrapeze_simd::{Level, Scalar};

use super::build::Nodes;
use super::coarse::{Cell, Known, Listed};
use super::extent::Extent;
use super::plan::Planned;
use super::sorted::{Hull, Sorted};
use super::split::split;

/// The items of a range.
pub enum Items<'a, H: Hull> {
    /// In memory side by side.
    There(&'a mut [Sorted<H>]),
    /// The same, by themselves.
    Own(Vec<Sorted<H>>),
    /// So many in cells, in the order of splits that are known: as long as these last, items are copied only when a thread comes to
    /// as many as its caches hold.
    InCells(usize, &'a [Cell<H>], &'a Listed<'a, H>),
}

impl<H: Hull> Items<'_, H> {
    /// How many they are.
    pub fn len(&self) -> usize {
        match self {
            Self::There(items) => items.len(),
            Self::Own(items) => items.len(),
            Self::InCells(count, ..) => *count,
        }
    }

    /// The first of them.
    pub fn first(&self) -> Option<&Sorted<H>> {
        match self {
            Self::There(items) => items.first(),
            Self::Own(items) => items.first(),
            Self::InCells(_, cells, listed) => listed.first(cells),
        }
    }

    /// All of them side by side, so that they may change places.
    pub fn side_by_side(&mut self) -> &mut [Sorted<H>] {
        if let Self::InCells(count, cells, listed) = self {
            *self = Self::Own(listed.copied(Level::best(), cells, *count));
        }
        match self {
            Self::There(items) => items,
            Self::Own(items) => items,
            Self::InCells(..) => &mut [],
        }
    }

    /// The first `middle`, in as many `cells` where they are in such, and the others.
    fn split_at(self, middle: usize, cells: usize) -> [Self; 2] {
        match self {
            Self::There(items) => {
                let (left, right) = items.split_at_mut(middle);
                [Self::There(left), Self::There(right)]
            }
            Self::Own(mut items) => {
                let right = items.split_off(middle);
                [Self::Own(items), Self::Own(right)]
            }
            Self::InCells(count, all, listed) => {
                let (left, right) = all.split_at(cells);
                [
                    Self::InCells(middle, left, listed),
                    Self::InCells(count - middle, right, listed),
                ]
            }
        }
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
    /// What becomes of it, where that is planned.
    pub planned: Option<Planned<'a, H>>,
}

impl<'a, H: Hull> Range<'a, H> {
    /// Items that extend so far.
    pub fn new(items: Items<'a, H>, extent: Extent<H>, known: Option<&'a Known<H>>) -> Self {
        Self {
            items,
            extent,
            known,
            area: H::area(Scalar, extent.bounds.load(Scalar)),
            planned: None,
        }
    }

    /// More than 8 items, in such a box, of which it is planned what becomes of them.
    pub fn planned(items: Items<'a, H>, bounds: H, planned: Planned<'a, H>) -> Self {
        Self {
            planned: Some(planned),
            ..Self::whole(items, bounds)
        }
    }

    /// Items in such a box that are not split.
    fn whole(items: Items<'a, H>, bounds: H) -> Self {
        Self {
            items,
            extent: Extent::unsplit(bounds),
            area: 0.0,
            known: None,
            planned: None,
        }
    }

    /// One item.
    fn single(items: Items<'a, H>, item: &Sorted<H>) -> Self {
        Self::whole(items, item.bounds)
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
        let cells = self.known.map_or(0, |known| known.cells);
        let known = |side: usize| self.known.and_then(|known| known.below[side].as_deref());
        let [a, b] = halves.extents;
        let [left, right] = self.items.split_at(halves.middle, cells);
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
    if let Some(planned) = range.planned {
        let mut rest = range.items;
        for child in planned.children() {
            let [own, others] = rest.split_at(child.count, 0);
            rest = others;
            ranges.push(match (own.first().copied(), child.planned) {
                (Some(item), _) if child.count == 1 => Range::single(own, &item),
                (_, Some(planned)) => Range::planned(own, child.bounds, planned),
                _ => Range::whole(own, child.bounds),
            });
        }
        return ranges;
    }
    ranges.push(range);
    let least = kind.least_split() - 1;
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
