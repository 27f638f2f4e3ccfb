//! Traversal: nearest children first, with one small stack for both levels.
//!
//! Hits are compared by `(t, instance, grid, cell)`, and no micropolygon that could win is culled (the
//! pads of [`super::object_ray`] and [`super::instance`]; entries are dropped only when they start
//! *behind* the best hit, not at it). So the answer does not depend on the order in which nodes
//! are visited, on the shape of the tree or on how rays are batched.

use super::cell::{CellHit, CellRay};
use super::object_ray::ObjectRay;
use super::sides::Side;
use super::{Hit, TraceCounts};
use crate::bvh::block::{CellRect, whole};
use crate::bvh::node::enter;
use crate::bvh::object::{BlockTree, SMALL_GRID};
use crate::bvh::{Bounds8, Tree};
use crate::grid::DicedMesh;

/// Subtrees still to visit, farthest first: reference, and where the ray enters.
pub(super) type Stack = Vec<(u32, f32)>;

/// What is looked for, and the best so far.
#[derive(Clone, Copy, Debug)]
pub(super) struct Query {
    /// Hits nearer than this are ignored.
    pub t_min: f32,
    /// Best hit so far; before there is one, its `t` is the ray's `t_max`.
    pub best: Hit,
    /// Only hits after this one count, in the order of hits.
    pub after: Option<Hit>,
    /// Any hit will do.
    pub any: bool,
}

impl Query {
    /// A hit that has been found, or a miss.
    pub fn answer(&self) -> Hit {
        if self.best.is_hit() {
            self.best
        } else {
            Hit::MISS
        }
    }

    /// True when nothing found from now on can matter.
    #[inline(always)]
    pub fn done(&self) -> bool {
        self.any && self.best.is_hit()
    }

    #[inline(always)]
    fn offer(&mut self, hit: Hit) {
        // Written so that NaN is refused.
        let in_range = hit.t >= self.t_min && hit.t <= self.best.t;
        if !in_range || !hit.is_before(&self.best) {
            return;
        }
        if let Some(after) = &self.after
            && !after.is_before(&hit)
        {
            return;
        }
        self.best = hit;
    }
}

impl Hit {
    /// The order of hits: `(t, instance, grid, cell)`.
    #[inline(always)]
    pub fn is_before(&self, other: &Hit) -> bool {
        if self.t != other.t {
            return self.t < other.t;
        }
        (self.instance, self.grid, self.cell) < (other.instance, other.grid, other.cell)
    }
}

/// Walks a tree; `leaf(item, query, stack, counts)` is called for items that the ray may hit, and may
/// use the stack above what it finds there.
#[inline(always)]
pub(super) fn walk<B: Bounds8>(
    tree: &Tree<B>,
    ray: &ObjectRay,
    query: &mut Query,
    stack: &mut Stack,
    counts: &mut TraceCounts,
    mut leaf: impl FnMut(u32, &mut Query, &mut Stack, &mut TraceCounts),
) {
    if tree.root == Tree::<B>::EMPTY {
        return;
    }
    let floor = stack.len();
    let mut at = tree.root;
    loop {
        if at & Tree::<B>::LEAF != 0 {
            leaf(at & !Tree::<B>::LEAF, query, stack, counts);
            if query.done() {
                stack.truncate(floor);
                return;
            }
        } else {
            let node = &tree.nodes[at as usize];
            counts.node_tests += 1;
            let turned;
            let slab = if node.frame == 0 {
                &ray.slab
            } else {
                turned = ray.turned(&tree.frames[node.frame as usize]);
                &turned
            };
            let (mut mask, near) = enter(
                &node.bounds,
                node.valid,
                slab,
                ray.time,
                query.t_min,
                query.best.t,
            );
            if mask != 0 {
                // The nearest child is next; the others wait, sorted so that nearer ones come off
                // the stack first.
                let mut slot = mask.trailing_zeros() as usize;
                mask &= mask - 1;
                let (mut next, mut next_near) = (node.children[slot], near[slot]);
                let base = stack.len();
                while mask != 0 {
                    slot = mask.trailing_zeros() as usize;
                    mask &= mask - 1;
                    let mut entry = (node.children[slot], near[slot]);
                    if entry.1 < next_near {
                        std::mem::swap(&mut entry.0, &mut next);
                        std::mem::swap(&mut entry.1, &mut next_near);
                    }
                    stack.push(entry);
                    let mut i = stack.len() - 1;
                    while i > base && stack[i - 1].1 < stack[i].1 {
                        stack.swap(i - 1, i);
                        i -= 1;
                    }
                }
                at = next;
                continue;
            }
        }
        // Next subtree that does not start behind the best hit.
        loop {
            if stack.len() <= floor {
                return;
            }
            match stack.pop() {
                Some((next, near)) if near <= query.best.t => {
                    at = next;
                    break;
                }
                Some(_) => {}
                None => return,
            }
        }
    }
}

/// Traces one object. With `CULL`, the side `hidden` of its lattices is not there.
#[inline(always)]
#[allow(clippy::too_many_arguments)] // one call, inlined
pub(super) fn trace_object<B: Bounds8, const CULL: bool>(
    blocks: &BlockTree<B>,
    mesh: &DicedMesh,
    instance: u32,
    hidden: Option<Side>,
    ray: &ObjectRay,
    query: &mut Query,
    stack: &mut Stack,
    counts: &mut TraceCounts,
) {
    let cells = CellRay::new(ray, &mesh.key_times);
    let group = |grid: u32, rect: CellRect, query: &mut Query, counts: &mut TraceCounts| {
        counts.cell_tests += u64::from(rect.w) * u64::from(rect.h);
        let accept = |cell: u32, hit: CellHit| {
            query.offer(Hit {
                t: hit.t,
                u: hit.u,
                v: hit.v,
                instance,
                grid,
                cell,
            });
        };
        if B::MOVING {
            cells.test_group::<true, CULL>(mesh, grid, rect, hidden, accept);
        } else {
            cells.test_group::<false, CULL>(mesh, grid, rect, hidden, accept);
        }
    };
    let leaf = |item: u32, query: &mut Query, _: &mut Stack, counts: &mut TraceCounts| {
        if item & SMALL_GRID != 0 {
            let grid = item & !SMALL_GRID;
            group(grid, whole(&mesh.grids[grid as usize]), query, counts);
            return;
        }
        let block = &blocks.blocks[item as usize];
        counts.node_tests += 1;
        let turned;
        let slab = if block.frame == 0 {
            &ray.slab
        } else {
            turned = ray.turned(&blocks.tree.frames[block.frame as usize]);
            &turned
        };
        let valid = (1u32 << block.span.count) - 1;
        let (mut mask, near) = enter(
            &block.bounds,
            valid,
            slab,
            ray.time,
            query.t_min,
            query.best.t,
        );
        while mask != 0 {
            let slot = nearest(mask, &near);
            mask &= !(1 << slot);
            if near[slot as usize] > query.best.t {
                return;
            }
            group(block.span.grid, block.span.group_rect(slot), query, counts);
            if query.done() {
                return;
            }
        }
    };
    walk(&blocks.tree, ray, query, stack, counts, leaf);
}

/// The set bit whose `near` is least.
#[inline(always)]
fn nearest(mask: u32, near: &[f32; 8]) -> u32 {
    let mut best = mask.trailing_zeros();
    let mut rest = mask & (mask - 1);
    while rest != 0 {
        let slot = rest.trailing_zeros();
        rest &= rest - 1;
        if near[slot as usize] < near[best as usize] {
            best = slot;
        }
    }
    best
}
