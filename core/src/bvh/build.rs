//! The tree over blocks and loose groups (or instances): a parallel top-down build of 8-wide nodes by binned SAH.
//!
//! Each range of items is split in two at the cheapest of 16 bins (8 for few items) on each axis, by
//! `area(left) n(left) + area(right) n(right)` with areas averaged over the shutter (Wald, "On Fast
//! Construction of SAH-based Bounding Volume Hierarchies", RT 2007); the child of largest area is
//! split again until a node has 8 children. Of up to a thousand items all splits are made first, and the children of nodes are chosen
//! among them so that rays open the fewest ([`super::plan`]). Where no bin separates the items (all centres equal), or
//! where the tree is already deep, the range is halved: depth stays logarithmic for any input.
//!
//! Where items are parts of strands, a range may be turned: its boxes are bounded anew in a frame along
//! the strands, and all below is split and bounded there ([`super::orient`]).
//!
//! Of many items, the first splits are made over cells of a grid, which hold a few each ([`super::coarse`]).
//!
//! The result does not depend on the number of threads: parallel work only joins minima, maxima and
//! counts. Each large range is one thread's task, with nodes of its own; in the end all are put together, in the order of children.

use std::sync::atomic::{AtomicBool, Ordering};

use hdtrapeze_simd::Level;
use rayon::prelude::*;

use super::block::GROUPS;
use super::coarse::{COARSE_ITEMS, coarse, numbered};
use super::diagonal;
use super::extent::Extent;
use super::node::pack_hulls;
use super::orient::{BySize, MOST_ITEMS, Strands, Turned};
use super::plan::{self, Plan};
use super::range::{Items, Range, children};
use super::sorted::{Hull, Sorted};
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

    fn of_none() -> Self {
        Self {
            nodes: Vec::new(),
            frames: vec![B::Turning::IDENTITY],
            root: Self::EMPTY,
        }
    }

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
    /// Surface-area cost alone: nodes have 5 to 7 children on average.
    Cheap,
    /// Full nodes: less memory, for up to 3 % more time a ray.
    Full,
}

impl Nodes {
    /// Ranges of so many items, or more, are split.
    pub fn least_split(self) -> usize {
        match self {
            // To split fewer takes a tenth more of a build, for rays that take as long.
            Self::Cheap => 5,
            // Up to 8 items are one full node.
            Self::Full => 9,
        }
    }
}

/// Builds the tree over `items`, all in the space that they are given in. Once `cancel` is raised it ends soon, with
/// a tree that is of no use.
pub fn build_items<B: Bounds8>(items: Vec<Item>, kind: Nodes, cancel: &AtomicBool) -> Tree<B> {
    let sorted = items.par_iter().map(Sorted::of).collect();
    drop(items);
    build_sorted(vec![sorted], kind, None, cancel)
}

/// Builds the tree over items, given in parts, as [`build_items`]. With `strands`, which knows which way items go and bounds them,
/// ranges are turned where that pays.
pub fn build_sorted<B: Bounds8>(
    mut parts: Vec<Vec<Sorted<B::Hull>>>,
    kind: Nodes,
    strands: Option<&Strands<'_>>,
    cancel: &AtomicBool,
) -> Tree<B> {
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
    let grown = if count >= COARSE_ITEMS && numbered(&parts) {
        let coarse = coarse(below.level, &mut parts);
        let items = Items::InCells(count, &coarse.cells, &coarse.listed);
        let range = Range::new(items, coarse.extent, coarse.known.as_deref());
        let grown = grow(range, below);
        drop(coarse);
        drop(parts);
        grown
    } else {
        let mut items = parts.concat();
        drop(parts);
        if items.is_empty() {
            return Tree::of_none();
        }
        let extent = Extent::of(below.level, &items);
        grow(Range::new(Items::There(&mut items), extent, None), below)
    };
    grown.joined()
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

/// The node over some children, whose references it has not yet: their boxes, and those that are single items.
fn node_over<'h, B: Bounds8>(
    children: impl ExactSizeIterator<Item = (&'h B::Hull, Option<&'h Sorted<B::Hull>>)>,
    below: Below<'_>,
) -> Node<B> {
    let count = children.len();
    debug_assert!((1..=8).contains(&count));
    let none = B::Hull::EMPTY;
    let mut hulls = [&none; 8];
    let mut numbers = [[0.0; 8]; 2];
    for (slot, (hull, item)) in children.enumerate().take(8) {
        hulls[slot] = hull;
        if let Some(item) = item {
            [numbers[0][slot], numbers[1][slot]] = item.bounds.diagonal();
        }
    }
    // What has no child is taken for the first.
    let first = hulls[0];
    hulls.iter_mut().skip(count).for_each(|hull| *hull = first);
    let bounds: B = pack_hulls(below.level, hulls);
    let grids = (bounds.start(), bounds.end());
    let (diagonals, at_end) = diagonal::packed(below.level, grids, &numbers);
    Node {
        bounds,
        children: [0; 8],
        frame: below.frame,
        slots: ((1u32 << count) - 1) | diagonals,
        at_end,
    }
}

/// The node over some ranges.
fn node_over_ranges<B: Bounds8>(ranges: &[Range<'_, B::Hull>], below: Below<'_>) -> Node<B> {
    let children = ranges.iter();
    node_over(
        children.map(|range| (&range.extent.bounds, range.only())),
        below,
    )
}

/// The node over up to 8 items.
fn node_over_items<B: Bounds8>(items: &[Sorted<B::Hull>], below: Below<'_>) -> Node<B> {
    let mut node = node_over(items.iter().map(|item| (&item.bounds, Some(item))), below);
    for (child, item) in node.children.iter_mut().zip(items) {
        *child = Tree::<B>::LEAF | item.id();
    }
    node
}

/// Appends the node over a range of two items or more, and all below it; returns the node's number.
fn build_node<B: Bounds8>(
    tree: &mut Tree<B>,
    mut range: Range<'_, B::Hull>,
    mut below: Below<'_>,
    tries: &mut BySize,
) -> u32 {
    if let Some(strands) = below.strands
        && below.frame == 0
        && range.items.len() <= below.try_below.max(GROUPS)
    {
        below.try_below = range.items.len() / 4;
        let items = range.items.side_by_side();
        if let Some(Turned { frame, mut items }) = tries.turn::<B>(strands, items) {
            below.frame = tree.frames.len() as u32;
            tree.frames.push(frame);
            let extent = Extent::of(below.level, &items);
            let range = Range::new(Items::There(&mut items), extent, None);
            return build_node(tree, range, below, tries);
        }
    }
    let index = tree.nodes.len() as u32;
    if range.items.len() <= 8 {
        let items = range.items.side_by_side();
        tree.nodes.push(node_over_items(items, below));
        return index;
    }
    if range.planned.is_some() || range.items.len() > plan::MOST_ITEMS {
        return build_children(tree, range, below, tries);
    }
    let items = range.items.side_by_side();
    let plan = Plan::new(below.level, items, &range.extent, below.kind, below.depth);
    let range = Range::planned(Items::There(items), range.extent.bounds, plan.whole());
    build_children(tree, range, below, tries)
}

/// The same of more than 8 items, which stay in the frame that they are in.
fn build_children<B: Bounds8>(
    tree: &mut Tree<B>,
    range: Range<'_, B::Hull>,
    mut below: Below<'_>,
    tries: &mut BySize,
) -> u32 {
    let index = tree.nodes.len() as u32;
    let ranges = children(range, below.level, below.kind, below.depth);
    tree.nodes.push(node_over_ranges(&ranges, below));
    below.depth += 1;
    for (slot, range) in ranges.into_iter().enumerate() {
        let child = build_child(tree, range, below, tries);
        tree.nodes[index as usize].children[slot] = child;
    }
    index
}

fn build_child<B: Bounds8>(
    tree: &mut Tree<B>,
    range: Range<'_, B::Hull>,
    below: Below<'_>,
    tries: &mut BySize,
) -> u32 {
    match range.items.first() {
        None => Tree::<B>::EMPTY,
        Some(item) if range.items.len() == 1 || below.cancel.load(Ordering::Relaxed) => {
            Tree::<B>::LEAF | item.id()
        }
        Some(_) => build_node(tree, range, below, tries),
    }
}

/// A tree in pieces, as threads have made them.
struct Grown<B: Bounds8> {
    /// A whole tree where there is none below, or a single node.
    tree: Tree<B>,
    /// Those of the node's children.
    below: Vec<Grown<B>>,
}

const _: () = assert!(MOST_ITEMS <= PARALLEL_ITEMS);

/// Builds the tree over a range, in parallel where that is large.
fn grow<B: Bounds8>(range: Range<'_, B::Hull>, mut below: Below<'_>) -> Grown<B> {
    let mut grown = Grown {
        tree: Tree::of_none(),
        below: Vec::new(),
    };
    let tree = &mut grown.tree;
    if let Some(item) = range.items.first()
        && below.cancel.load(Ordering::Relaxed)
    {
        tree.root = Tree::<B>::LEAF | item.id();
        return grown;
    }
    let (mut items, extent, known) = (range.items, range.extent, range.known);
    let count = items.len();
    let range = if count <= PARALLEL_ITEMS || known.is_none() {
        // Into this thread's caches, or since they are split by themselves.
        Range::new(Items::There(items.side_by_side()), extent, known)
    } else {
        Range::new(items, extent, known)
    };
    if count <= PARALLEL_ITEMS {
        tree.nodes.reserve(count / 4 + 1);
        tree.root = build_child(tree, range, below, &mut BySize::default());
        return grown;
    }
    let ranges = children(range, below.level, below.kind, below.depth);
    tree.root = 0;
    tree.nodes.push(node_over_ranges(&ranges, below));
    below.depth += 1;
    let ranges: Vec<_> = ranges.into_iter().collect();
    let children = ranges.into_par_iter().map(|range| grow(range, below));
    grown.below = children.collect();
    grown
}

/// Nodes of a piece, and what is added to the numbers of nodes and frames in there.
struct Piece<B: Bounds8> {
    nodes: Vec<Node<B>>,
    first_node: u32,
    first_frame: u32,
}

impl<B: Bounds8> Grown<B> {
    /// The tree in one piece: parents before children, and these in their order.
    fn joined(self) -> Tree<B> {
        if self.below.is_empty() {
            let mut tree = self.tree;
            tree.nodes.shrink_to_fit();
            return tree;
        }
        let mut pieces = Vec::new();
        let mut tree = Tree::of_none();
        let mut count = 0;
        hdtrapeze_pages::reserve(&mut tree.frames, self.frame_count());
        tree.root = self.place(&mut pieces, &mut count, &mut tree.frames);
        let nodes = pieces.iter().map(|piece| piece.nodes.as_slice()).collect();
        tree.nodes = hdtrapeze_pages::joined(nodes, |k, node: &Node<B>| {
            let piece: &Piece<B> = &pieces[k];
            let mut node = *node;
            for child in &mut node.children {
                if *child & Tree::<B>::LEAF == 0 {
                    *child += piece.first_node;
                }
            }
            if node.frame != 0 {
                node.frame += piece.first_frame;
            }
            node
        });
        tree
    }

    /// Frames besides the identity.
    fn frame_count(&self) -> usize {
        let below = self.below.iter().map(Self::frame_count);
        self.tree.frames.len() - 1 + below.sum::<usize>()
    }

    /// Says where each piece goes; gives the reference of its root.
    fn place(
        self,
        pieces: &mut Vec<Piece<B>>,
        count: &mut u32,
        frames: &mut Vec<B::Turning>,
    ) -> u32 {
        let Tree {
            mut nodes,
            frames: own,
            root,
        } = self.tree;
        let first_node = *count;
        let first_frame = frames.len() as u32 - 1;
        *count += nodes.len() as u32;
        frames.extend_from_slice(&own[1..]);
        if self.below.is_empty() {
            pieces.push(Piece {
                nodes,
                first_node,
                first_frame,
            });
            return match root & Tree::<B>::LEAF {
                0 => root + first_node,
                _ => root,
            };
        }
        let at = pieces.len();
        pieces.push(Piece {
            nodes: Vec::new(),
            first_node: 0,
            first_frame: 0,
        });
        for (slot, child) in self.below.into_iter().enumerate() {
            nodes[0].children[slot] = child.place(pieces, count, frames);
        }
        pieces[at].nodes = nodes;
        first_node
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
