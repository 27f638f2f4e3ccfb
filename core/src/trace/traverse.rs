//! Traversal: nearest children first, with one small stack for both levels.
//!
//! Hits are compared by `(t, instance, grid, cell)`, and no micropolygon that could win is culled (the
//! pads of [`super::object_ray`] and [`super::instance`]; entries are dropped only when they start
//! *behind* the best hit, not at it). So the answer does not depend on the order in which nodes
//! are visited, on the shape of the tree or on how rays are batched.

use glam::Vec3;
use hdtrapeze_simd::Simd;

use super::cell::CellRay;
use super::object_ray::ObjectRay;
use super::pairs::expect;
use super::sides::Side;
use super::{Hit, TraceCounts};
use crate::bvh::block::{CellRect, loose};
use crate::bvh::node::{enter, enter_node};
use crate::bvh::object::{BlockTree, ObjectGeometry, loose_group};
use crate::bvh::{Bounds8, Tree};
use crate::grid::PlanarMesh;

/// No item.
const NONE: u32 = u32::MAX;

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
    pub fn offer(&mut self, hit: Hit) {
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

/// Walks a tree below `root`; `leaf(item, query, stack, counts)` is called for items that the ray may hit, and may
/// use the stack above what it finds there. `soon(item)` asks for an item from memory. If it says so, the item
/// is tested only after one more node or item, and comes meanwhile: that is opened in vain where the item is hit.
#[inline(always)]
#[allow(clippy::too_many_arguments)] // one call, inlined
pub(super) fn walk<S: Simd, B: Bounds8>(
    simd: S,
    tree: &Tree<B>,
    root: u32,
    ray: &ObjectRay,
    query: &mut Query,
    stack: &mut Stack,
    counts: &mut TraceCounts,
    soon: impl Fn(u32) -> bool,
    mut leaf: impl FnMut(u32, &mut Query, &mut Stack, &mut TraceCounts),
) {
    if root == Tree::<B>::EMPTY {
        return;
    }
    let floor = stack.len();
    let mut at = root;
    // An item that was asked for from memory.
    let mut waits = NONE;
    // The frame that the ray was turned into last: whole subtrees share one.
    let (mut frame, mut turned) = (0, None);
    loop {
        // What is entered here, and the item to be tested before that is followed.
        let (mut entered, mut children) = ((0, [0.0; 8]), &[0; 8]);
        let mut due = NONE;
        if at & Tree::<B>::LEAF != 0 {
            due = at & !Tree::<B>::LEAF;
            // Nothing is left to do meanwhile.
            let is_last = waits == NONE && stack.len() <= floor;
            if !is_last && soon(due) {
                std::mem::swap(&mut due, &mut waits);
            }
        } else {
            // All of it at once: which children there are is asked when their bounds were tested.
            simd.expect(&tree.nodes, at as usize);
            let node = &tree.nodes[at as usize];
            counts.node_tests += 1;
            let slab = if node.frame == 0 {
                &ray.slab
            } else {
                if node.frame != frame {
                    frame = node.frame;
                    turned = Some(ray.turned(&tree.frames[frame as usize]));
                }
                turned.as_ref().unwrap_or(&ray.slab)
            };
            let (t_min, t_max) = (query.t_min, query.best.t);
            entered = enter_node(simd, node, slab, t_min, t_max);
            children = &node.children;
            std::mem::swap(&mut due, &mut waits);
        }
        if due != NONE {
            leaf(due, query, stack, counts);
            if query.done() {
                stack.truncate(floor);
                return;
            }
        }
        let (mut mask, near) = entered;
        if mask != 0 {
            // The nearest child is next; the others wait, sorted so that nearer ones come off
            // the stack first.
            let mut slot = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            let (mut next, mut next_near) = (children[slot], near[slot]);
            let base = stack.len();
            while mask != 0 {
                slot = mask.trailing_zeros() as usize;
                mask &= mask - 1;
                let mut entry = (children[slot], near[slot]);
                if entry.0 & Tree::<B>::LEAF != 0 {
                    soon(entry.0 & !Tree::<B>::LEAF);
                } else {
                    simd.expect(&tree.nodes, entry.0 as usize);
                }
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
        // Next subtree that does not start behind the best hit.
        loop {
            if stack.len() <= floor {
                if waits == NONE {
                    return;
                }
                at = Tree::<B>::LEAF | waits;
                waits = NONE;
                break;
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

/// An object being traced as one instance. With `CULL`, the side `hidden` of its lattices is not there.
#[derive(Clone, Copy)]
pub(super) struct Target<'a, S, B: Bounds8, const CULL: bool> {
    pub simd: S,
    pub blocks: &'a BlockTree<B>,
    pub mesh: &'a PlanarMesh,
    pub radius: f32,
    pub instance: u32,
    pub hidden: Option<Side>,
}

/// The time of slab tests in a tree of this kind: none, where nothing moves.
#[inline(always)]
pub(super) fn slab_time<B: Bounds8>(time: f32) -> f32 {
    if B::MOVING { time } else { 0.0 }
}

impl<'a, S: Simd, B: Bounds8, const CULL: bool> Target<'a, S, B, CULL> {
    /// `object`, whose tree is `blocks`, as instance number `instance`.
    #[inline(always)]
    pub fn new(
        simd: S,
        blocks: &'a BlockTree<B>,
        object: &'a ObjectGeometry,
        instance: u32,
        hidden: Option<Side>,
    ) -> Self {
        Self {
            simd,
            blocks,
            mesh: object.mesh(),
            radius: object.radius(),
            instance,
            hidden,
        }
    }

    /// Traces a ray that is given in the object's space; and as the tree sees it, where that is otherwise.
    #[inline(always)]
    pub fn enter(
        &self,
        (origin, dir, time): (Vec3, Vec3, f32),
        seen: Option<&ObjectRay>,
        query: &mut Query,
        stack: &mut Stack,
        counts: &mut TraceCounts,
    ) {
        let time = if B::KEYS { time } else { 0.0 };
        if let Some(mut ray) = ObjectRay::new(origin, dir, time, self.radius) {
            if B::MOVING {
                ray = ray.bowing(&self.blocks.bowing);
            }
            let cells = CellRay::new(&ray, &self.mesh.key_times);
            let seen = seen.unwrap_or(&ray);
            self.trace(self.blocks.tree.root, seen, &cells, query, stack, counts);
        }
    }

    /// Traces one ray, in the object's space, below `root`.
    #[inline(always)]
    pub fn trace(
        &self,
        root: u32,
        ray: &ObjectRay,
        cells: &CellRay,
        query: &mut Query,
        stack: &mut Stack,
        counts: &mut TraceCounts,
    ) {
        walk(
            self.simd,
            &self.blocks.tree,
            root,
            ray,
            query,
            stack,
            counts,
            #[inline(always)]
            |item| {
                self.expect(item, cells.key as u32);
                loose_group(item).is_some()
            },
            #[inline(always)]
            |item, query, _, counts| self.item(item, ray, cells, query, counts),
        );
    }

    /// Says that an item of the tree may be tested soon, at `key`.
    #[inline(always)]
    pub fn expect(&self, item: u32, key: u32) {
        match loose_group(item) {
            None => self.simd.expect(&self.blocks.blocks, item as usize),
            Some((grid, slot)) => {
                let rect = loose(&self.mesh.traced(grid), slot);
                expect::<S, B>(self.simd, self.mesh, grid, rect, key);
            }
        }
    }

    /// Tests one item of the tree: a loose group or a block.
    #[inline(always)]
    fn item(
        &self,
        item: u32,
        ray: &ObjectRay,
        cells: &CellRay,
        query: &mut Query,
        counts: &mut TraceCounts,
    ) {
        if let Some((grid, slot)) = loose_group(item) {
            let rect = loose(&self.mesh.traced(grid), slot);
            self.group(grid, rect, cells, query, counts);
            return;
        }
        let block = &self.blocks.blocks[item as usize];
        counts.node_tests += 1;
        let turned;
        let slab = if block.frame == 0 {
            &ray.slab
        } else {
            turned = ray.turned(&self.blocks.frames[block.frame as usize]);
            &turned
        };
        let valid = (1u32 << block.span.count) - 1;
        let (t_min, t_max) = (query.t_min, query.best.t);
        let (mut mask, near) = enter(self.simd, &block.bounds, valid, slab, t_min, t_max);
        let grid = block.span.grid;
        while mask != 0 {
            let slot = nearest(mask, &near);
            mask &= !(1 << slot);
            if near[slot as usize] > query.best.t {
                return;
            }
            let rect = block.span.group_rect(slot);
            self.group(grid, rect, cells, query, counts);
            if query.done() {
                return;
            }
        }
    }

    /// Tests one group of micropolygons.
    #[inline(always)]
    pub fn group(
        &self,
        grid: u32,
        rect: CellRect,
        cells: &CellRay,
        query: &mut Query,
        counts: &mut TraceCounts,
    ) {
        counts.cell_tests += u64::from(rect.w) * u64::from(rect.h);
        self.group_with(
            grid,
            rect,
            cells,
            #[inline(always)]
            |hit| query.offer(hit),
        );
    }

    /// Tests one group of micropolygons; calls `offer` for each hit.
    #[inline(always)]
    pub fn group_with(
        &self,
        grid: u32,
        rect: CellRect,
        cells: &CellRay,
        mut offer: impl FnMut(Hit),
    ) {
        let Self {
            simd,
            mesh,
            instance,
            hidden,
            ..
        } = *self;
        if B::KEYS {
            cells.test_group::<S, true, CULL>(
                simd,
                mesh,
                grid,
                rect,
                hidden,
                #[inline(always)]
                |cell, hit| offer(hit.of(instance, grid, cell)),
            );
        } else {
            cells.test_group::<S, false, CULL>(
                simd,
                mesh,
                grid,
                rect,
                hidden,
                #[inline(always)]
                |cell, hit| offer(hit.of(instance, grid, cell)),
            );
        }
    }
}

/// The set bit whose `near` is least.
#[inline(always)]
pub(super) fn nearest(mask: u32, near: &[f32; 8]) -> u32 {
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
