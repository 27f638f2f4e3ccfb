//! How many entries the stack of a ray may need: known before it starts, since a GPU's stack cannot grow.

use hdtrapeze_core::bvh::{Bounds8, StaticSlabs, Tree};

/// Set in a reference to an item, of trees of any kind.
pub(crate) const LEAF: u32 = Tree::<StaticSlabs>::LEAF;
/// The root of a tree with no items.
pub(crate) const EMPTY: u32 = Tree::<StaticSlabs>::EMPTY;

/// The most entries that a walk below the root of `tree` leaves on the stack at once, where `leaf` tells the same of
/// an item: at each node all children but one may wait.
pub(crate) fn need<B: Bounds8>(tree: &Tree<B>, leaf: impl Fn(u32) -> u32) -> u32 {
    if tree.root == EMPTY {
        return 0;
    }
    // Parents stand before their children.
    let mut needs = vec![0u32; tree.nodes.len()];
    for (i, node) in tree.nodes.iter().enumerate().rev() {
        let slots = (0..8).filter(|slot| node.slots >> slot & 1 != 0);
        let below = slots.map(|slot| below(node.children[slot], &needs, &leaf));
        needs[i] = node.valid().count_ones().saturating_sub(1) + below.max().unwrap_or(0);
    }
    below(tree.root, &needs, &leaf)
}

fn below(reference: u32, needs: &[u32], leaf: &impl Fn(u32) -> u32) -> u32 {
    match reference & LEAF {
        0 => needs[reference as usize],
        _ => leaf(reference & !LEAF),
    }
}
