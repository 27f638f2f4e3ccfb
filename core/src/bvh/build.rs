//! The tree over blocks and loose groups (or instances): a parallel top-down build of 8-wide nodes by binned SAH.
//!
//! Each range of items is split in two at the cheapest of 16 bins (8 for few items) on each axis, by
//! `area(left) n(left) + area(right) n(right)` with areas averaged over the shutter (Wald, "On Fast
//! Construction of SAH-based Bounding Volume Hierarchies", RT 2007); the child of largest area is
//! split again until a node has 8 children. Where no bin separates the items (all centres equal), or
//! where the tree is already deep, the range is halved: depth stays logarithmic for any input.
//!
//! Where items are parts of strands, a range may be turned: its boxes are bounded anew in a frame along
//! the strands, and all below is split and bounded there ([`super::orient`]).
//!
//! Of many items, the first splits are made over cells of a grid, which hold a few each ([`super::coarse`]).
//!
//! The result does not depend on the number of threads: parallel work only joins minima, maxima and
//! counts, and subtrees are appended in child order.

use std::sync::atomic::{AtomicBool, Ordering};

use hdtrapeze_simd::{Level, Scalar};
use rayon::prelude::*;

use super::block::GROUPS;
use super::coarse::{COARSE_ITEMS, Known, coarse, numbered};
use super::diagonal;
use super::node::pack_hulls;
use super::orient::{MOST_ITEMS, Strands, Turned};
use super::sorted::{Hull, Sorted};
use super::split::{Extent, split};
use super::turn::Turning;
use super::{Bounds8, LinearBox, Node};

/// Ranges larger than this are split, and their children built, in parallel.
pub const PARALLEL_ITEMS: usize = 4096;
/// For builds that nobody cancels.
pub static NEVER: AtomicBool = AtomicBool::new(false);

/// A tree of 8-wide nodes over items that are known by number.
#[derive(Clone, Debug)]
pub struct Tree<B: Bounds8> {
    /// Nodes, parents before children.
    pub nodes: Vec<Node<B>>,
    /// Frames that nodes refer to; number 0 is the identity.
    pub frames: Vec<B::Turning>,
    /// The root: a reference like those in [`Node::children`], or [`Tree::EMPTY`].
    pub root: u32,
}

impl<B: Bounds8> Tree<B> {
    /// Set in a reference to an item; without it, a reference is the number of a node.
    pub const LEAF: u32 = 1 << 31;
    /// The root of a tree with no items.
    pub const EMPTY: u32 = u32::MAX;

    /// Bytes on the heap.
    pub fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice()) + size_of_val(self.frames.as_slice())
    }
}

/// An item being sorted into the tree.
#[derive(Clone, Copy, Debug)]
pub struct Item {
    /// Finite.
    pub bounds: LinearBox,
    /// Below 2^31.
    pub id: u32,
}

/// Builds the tree over boxes `(id, box)`; ids are below 2^31 and every box is finite.
pub fn build<B: Bounds8>(boxes: impl IntoIterator<Item = (u32, LinearBox)>) -> Tree<B> {
    let items = boxes.into_iter().map(|(id, bounds)| Item { bounds, id });
    build_items(items.collect(), Nodes::Cheap, &NEVER)
}

/// What matters where ranges become small.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Nodes {
    /// Surface-area cost alone: nodes have 4 to 5 children on average.
    Cheap,
    /// Full nodes: nearly half the memory, for 2 to 3 % more time a ray.
    Full,
}

/// Builds the tree over `items`, all in the space that they are given in. Once `cancel` is raised it ends soon, with
/// a tree that is of no use.
pub fn build_items<B: Bounds8>(items: Vec<Item>, kind: Nodes, cancel: &AtomicBool) -> Tree<B> {
    let sorted = items.par_iter().map(Sorted::of).collect();
    drop(items);
    build_sorted(vec![sorted], kind, None, cancel)
}

/// Builds the tree over items, given in parts, as [`build_items`]. With `strands`, which bounds items that have a direction,
/// ranges are turned where that pays.
pub fn build_sorted<B: Bounds8>(
    parts: Vec<Vec<Sorted<B::Hull>>>,
    kind: Nodes,
    strands: Option<&Strands<'_>>,
    cancel: &AtomicBool,
) -> Tree<B> {
    let mut tree = Tree {
        nodes: Vec::new(),
        frames: vec![B::Turning::IDENTITY],
        root: Tree::<B>::EMPTY,
    };
    let below = Below {
        kind,
        strands,
        cancel,
        level: Level::best(),
        depth: 0,
        frame: 0,
        try_below: MOST_ITEMS,
    };
    let count = parts.iter().map(Vec::len).sum::<usize>();
    let (mut items, extent, known);
    if count >= COARSE_ITEMS && numbered(&parts) {
        let coarse = coarse(below.level, &parts);
        items = coarse.items;
        (extent, known) = (Some(coarse.extent), coarse.known);
    } else {
        items = parts.concat();
        (extent, known) = (None, None);
    }
    drop(parts);
    match &mut items[..] {
        [] => {}
        [item] => tree.root = Tree::<B>::LEAF | item.id(),
        items => {
            if items.len() <= PARALLEL_ITEMS {
                tree.nodes.reserve(items.len() / 4 + 1);
            }
            tree.root = build_node(&mut tree, items, (extent, known.as_deref()), below);
        }
    }
    tree.nodes.shrink_to_fit();
    tree
}

/// What holds for a range.
#[derive(Clone, Copy)]
struct Below<'a> {
    kind: Nodes,
    strands: Option<&'a Strands<'a>>,
    cancel: &'a AtomicBool,
    level: Level,
    depth: usize,
    /// Number of the frame of boxes, and so of nodes.
    frame: u32,
    /// Frames are tried for ranges of no more items, and for those of a single node.
    try_below: usize,
}

/// A range of items that becomes a child.
struct Range<'a, H: Hull> {
    items: &'a mut [Sorted<H>],
    extent: Extent<H>,
    area: f32,
    /// Its split, where that is known.
    known: Option<&'a Known<H>>,
}

impl<'a, H: Hull> Range<'a, H> {
    fn new(items: &'a mut [Sorted<H>], extent: Extent<H>, known: Option<&'a Known<H>>) -> Self {
        Self {
            items,
            extent,
            known,
            area: H::area(Scalar, extent.bounds.load(Scalar)),
        }
    }

    /// Each item by itself.
    fn singles(items: &'a mut [Sorted<H>]) -> impl Iterator<Item = Self> {
        let of = |item: &'a mut [Sorted<H>]| Self {
            extent: Extent::single(&item[0]),
            items: item,
            area: 0.0,
            known: None,
        };
        items.chunks_mut(1).map(of)
    }
}

/// What a range extends over, and its split, where these are known.
type Given<'a, H> = (Option<Extent<H>>, Option<&'a Known<H>>);

/// Appends the node over `items`, two or more, and all below it; returns the node's number.
fn build_node<B: Bounds8>(
    tree: &mut Tree<B>,
    items: &mut [Sorted<B::Hull>],
    (extent, known): Given<'_, B::Hull>,
    mut below: Below<'_>,
) -> u32 {
    if let Some(strands) = below.strands
        && below.frame == 0
        && items.len() <= below.try_below.max(GROUPS)
    {
        below.try_below = items.len() / 4;
        if let Some(Turned { frame, mut items }) = strands.turn::<B>(items) {
            below.frame = tree.frames.len() as u32;
            tree.frames.push(frame);
            return build_node(tree, &mut items, (None, None), below);
        }
    }
    let parallel = items.len() > PARALLEL_ITEMS;
    let kind = below.kind;
    let mut ranges: Vec<Range<'_, B::Hull>> = Vec::with_capacity(8);
    if items.len() <= 8 {
        ranges.extend(Range::singles(items));
    } else {
        let extent = extent.unwrap_or_else(|| Extent::of(below.level, items));
        ranges.push(Range::new(items, extent, known));
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
            let halves = match range.known {
                Some(known) => known.halves,
                None => split(below.level, range.items, &range.extent, kind, below.depth),
            };
            let known = |side: usize| range.known.and_then(|known| known.below[side].as_deref());
            let [a, b] = halves.extents;
            let (left, right) = range.items.split_at_mut(halves.middle);
            ranges.extend([
                Range::new(left, a, known(0)),
                Range::new(right, b, known(1)),
            ]);
        }
        // What fits into this node needs none of its own.
        while let Some(smallest) = (0..ranges.len())
            .filter(|&i| ranges[i].items.len() > 1)
            .min_by_key(|&i| ranges[i].items.len())
            .filter(|&i| ranges.len() + ranges[i].items.len() <= 9)
        {
            let range = ranges.swap_remove(smallest);
            ranges.extend(Range::singles(range.items));
        }
    }

    let index = tree.nodes.len() as u32;
    let mut hulls = [&ranges[0].extent.bounds; 8];
    for (to, range) in hulls.iter_mut().zip(&ranges) {
        *to = &range.extent.bounds;
    }
    let bounds: B = pack_hulls(below.level, hulls);
    let mut numbers = [[0.0; 8]; 2];
    for (slot, range) in ranges.iter().enumerate() {
        if let [item] = &*range.items {
            [numbers[0][slot], numbers[1][slot]] = item.bounds.diagonal();
        }
    }
    let grids = (bounds.start(), bounds.end());
    let (diagonals, at_end) = diagonal::packed(below.level, grids, &numbers);
    tree.nodes.push(Node {
        bounds,
        children: [0; 8],
        frame: below.frame,
        slots: ((1u32 << ranges.len()) - 1) | diagonals,
        at_end,
    });
    below.depth += 1;
    if parallel {
        let subtrees: Vec<Tree<B>> = ranges
            .into_par_iter()
            .map(|range| {
                let mut subtree = Tree {
                    nodes: Vec::new(),
                    frames: vec![B::Turning::IDENTITY],
                    root: Tree::<B>::EMPTY,
                };
                subtree.root = build_child(&mut subtree, range, below);
                subtree
            })
            .collect();
        // Only the node over them is there yet.
        let sum = |count: fn(&Tree<B>) -> usize| subtrees.iter().map(count).sum();
        hdtrapeze_pages::reserve(&mut tree.nodes, sum(|tree| tree.nodes.len()));
        hdtrapeze_pages::reserve(&mut tree.frames, sum(|tree| tree.frames.len() - 1));
        for (slot, subtree) in subtrees.into_iter().enumerate() {
            let child = tree.append(subtree);
            tree.nodes[index as usize].children[slot] = child;
        }
    } else {
        for (slot, range) in ranges.into_iter().enumerate() {
            let child = build_child(tree, range, below);
            tree.nodes[index as usize].children[slot] = child;
        }
    }
    index
}

impl<B: Bounds8> Tree<B> {
    /// Takes over the nodes and frames of another tree; returns its root.
    fn append(&mut self, other: Tree<B>) -> u32 {
        let (base, frame_base) = (self.nodes.len() as u32, self.frames.len() as u32 - 1);
        let shift = |r: u32| if r & Self::LEAF == 0 { r + base } else { r };
        self.frames.extend_from_slice(&other.frames[1..]);
        self.nodes.extend(other.nodes.into_iter().map(|mut node| {
            node.children = node.children.map(shift);
            if node.frame != 0 {
                node.frame += frame_base;
            }
            node
        }));
        shift(other.root)
    }
}

fn build_child<B: Bounds8>(tree: &mut Tree<B>, range: Range<'_, B::Hull>, below: Below<'_>) -> u32 {
    match range.items {
        [item, ..] if below.cancel.load(Ordering::Relaxed) => Tree::<B>::LEAF | item.id(),
        [item] => Tree::<B>::LEAF | item.id(),
        items => build_node(tree, items, (Some(range.extent), range.known), below),
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::bvh::StaticSlabs;
    use crate::bvh::split::SAH_DEPTH;

    fn depth(tree: &Tree<StaticSlabs>, r: u32) -> usize {
        if r & Tree::<StaticSlabs>::LEAF != 0 {
            return 0;
        }
        let node = &tree.nodes[r as usize];
        (0..8)
            .filter(|i| node.slots >> i & 1 == 1)
            .map(|i| 1 + depth(tree, node.children[i]))
            .max()
            .unwrap_or(0)
    }

    fn items_below(tree: &Tree<StaticSlabs>, r: u32, out: &mut Vec<u32>) {
        if r & Tree::<StaticSlabs>::LEAF != 0 {
            out.push(r & !Tree::<StaticSlabs>::LEAF);
            return;
        }
        let node = &tree.nodes[r as usize];
        for i in (0..8).filter(|i| node.slots >> i & 1 == 1) {
            items_below(tree, node.children[i], out);
        }
    }

    fn point(p: Vec3) -> LinearBox {
        LinearBox {
            lo0: p,
            hi0: p,
            lo1: p,
            hi1: p,
        }
    }

    #[test]
    fn equal_boxes_stay_balanced() {
        let n = 1_000_000;
        let tree = build((0..n).map(|i| (i, point(Vec3::ONE))));
        assert!(depth(&tree, tree.root) <= 8, "{}", depth(&tree, tree.root));
        assert_ne!(hdtrapeze_pages::were_asked_for(&tree.nodes), Some(false));
        let mut all = Vec::new();
        items_below(&tree, tree.root, &mut all);
        all.sort_unstable();
        assert!(all.into_iter().eq(0..n));
    }

    #[test]
    fn full_nodes_take_little_memory_and_lose_nothing() {
        for (n, spread) in [
            (9u32, 1.0),
            (63, 1.0),
            (65, 1.0),
            (50_000, 1.0),
            (50_000, 0.0),
        ] {
            let h = |i: u32, k: u32| (i.wrapping_mul(k) >> 8) as f32 / (1 << 24) as f32 * spread;
            let at = |i| Vec3::new(h(i, 2654435761), h(i, 2246822519), h(i, 3266489917));
            let item = |id| Item {
                bounds: point(at(id)),
                id,
            };
            let tree: Tree<StaticSlabs> =
                build_items((0..n).map(item).collect(), Nodes::Full, &NEVER);
            let least = (n as usize - 1).div_ceil(7);
            assert!(
                tree.nodes.len() <= least + least / 5 + 1,
                "{n}: {}",
                tree.nodes.len()
            );
            let mut all = Vec::new();
            items_below(&tree, tree.root, &mut all);
            all.sort_unstable();
            assert!(all.into_iter().eq(0..n));
        }
    }

    #[test]
    fn geometric_progression_stays_shallow() {
        // Each centre is twice as far as the last: bins peel off a few items at a time.
        let tree = build((0..5000u32).map(|i| {
            let x = (f64::from(i) * 0.04 - 100.0).exp2() as f32;
            (i, point(Vec3::new(x, 0.0, 0.0)))
        }));
        assert!(depth(&tree, tree.root) <= SAH_DEPTH + 8);
        let mut all = Vec::new();
        items_below(&tree, tree.root, &mut all);
        all.sort_unstable();
        assert!(all.into_iter().eq(0..5000));
    }

    #[test]
    fn one_thread_builds_the_same_tree() {
        let boxes = || {
            (0..50_000u32).map(|i| {
                let h = |k: u32| (i.wrapping_mul(k) >> 8) as f32 / (1 << 24) as f32;
                (
                    i,
                    point(Vec3::new(h(2654435761), h(2246822519), h(3266489917))),
                )
            })
        };
        let many = build::<StaticSlabs>(boxes());
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .build()
            .expect("a pool of one thread");
        let one = pool.install(|| build::<StaticSlabs>(boxes()));
        assert_eq!(many.root, one.root);
        assert!(
            many.nodes
                .iter()
                .zip(&one.nodes)
                .all(|(a, b)| a.children == b.children)
        );
    }
}
