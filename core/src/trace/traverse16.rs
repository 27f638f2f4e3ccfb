//! Traversal by packets of sixteen rays: a node is fetched and decoded once for all of them.
//!
//! A packet goes where any of its rays goes. Where few of them are left, they go on one by one
//! ([`super::traverse`]); so rays that have nothing to do with each other cost little more than alone.
//! Every ray meets the same micropolygons as alone, or more; hits are the same.

use hdtrapeze_simd::{Float, Simd};

use super::cells16::test_group16;
use super::packet::{CellRays, Entered16, LANES, Lanes, Packet, Rays, alone, enter16};
use super::traverse::{Query, Stack, Target, slab_time};
use super::{Hit, TraceCounts};
use crate::bvh::block::{CellRect, loose};
use crate::bvh::object::loose_group;
use crate::bvh::{Bounds8, Tree};

/// At most so many rays go on alone.
const FEW: u32 = 2;
/// A group is tested by single rays when fewer than this many reach it, else by all at once.
const DENSE: u32 = 6;

/// A subtree that waits: reference, rays, and where the first of them enters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Waiting {
    at: u32,
    rays: u32,
    near: f32,
}

/// Subtrees still to visit, farthest first.
pub(super) type Stack16 = Vec<Waiting>;

/// What sixteen rays look for, and the best so far.
pub(super) struct Queries {
    /// The best hits; misses but for their `t`, which is `t_max`, before there are any.
    pub best: [Hit; LANES],
    /// `t_min` of each.
    pub t_min: Lanes,
    /// `best.t` of each.
    pub t_max: Lanes,
    /// Nodes opened.
    pub nodes: Lanes,
    /// Micropolygons tested.
    pub cells: Lanes,
}

impl Queries {
    /// The largest `t_max` of `lanes`.
    #[inline(always)]
    fn farthest<S: Simd>(&self, simd: S, lanes: u32) -> f32 {
        let none = simd.all16(f32::NEG_INFINITY);
        simd.from16(&self.t_max).or(simd.mask16(lanes), none).most()
    }

    #[inline(always)]
    fn count_node<S: Simd>(&mut self, simd: S, lanes: u32) {
        let one = simd.all16(1.0).or(simd.mask16(lanes), simd.all16(0.0));
        self.nodes = (simd.from16(&self.nodes) + one).to_array();
    }

    #[inline(always)]
    fn count_cells<S: Simd>(&mut self, simd: S, lanes: u32, rect: CellRect) {
        let cells = f32::from(u16::from(rect.w) * u16::from(rect.h));
        let cells = simd.all16(cells).or(simd.mask16(lanes), simd.all16(0.0));
        self.cells = (simd.from16(&self.cells) + cells).to_array();
    }

    /// A hit of ray `lane`.
    #[inline(always)]
    fn offer(&mut self, lane: usize, hit: Hit) {
        let best = &mut self.best[lane];
        // Written so that NaN is refused.
        let in_range = hit.t >= self.t_min[lane] && hit.t <= best.t;
        if in_range && hit.is_before(best) {
            *best = hit;
            self.t_max[lane] = hit.t;
        }
    }

    /// Lets ray `lane` go on alone for a while.
    #[inline(always)]
    pub fn alone(&mut self, lane: usize, ask: impl FnOnce(&mut Query, &mut TraceCounts)) {
        let mut query = Query {
            t_min: self.t_min[lane],
            best: self.best[lane],
            after: None,
            any: false,
        };
        let mut counts = TraceCounts::default();
        ask(&mut query, &mut counts);
        self.best[lane] = query.best;
        self.t_max[lane] = query.best.t;
        self.nodes[lane] += counts.node_tests as f32;
        self.cells[lane] += counts.cell_tests as f32;
    }
}

/// Walks a tree with the rays `lanes`. `leaf(item, rays, queries)` is called for items that some rays may
/// hit, and `few(reference, rays, queries)` for subtrees that few rays may hit.
#[inline(always)]
pub(super) fn walk16<S: Simd, B: Bounds8>(
    simd: S,
    tree: &Tree<B>,
    packet: &Packet<'_, S>,
    queries: &mut Queries,
    stack: &mut Stack16,
    mut leaf: impl FnMut(u32, u32, &mut Queries, &mut Stack16),
    mut few: impl FnMut(u32, u32, &mut Queries),
) {
    if tree.root == Tree::<B>::EMPTY || packet.sound == 0 {
        return;
    }
    let floor = stack.len();
    let (mut at, mut rays) = (tree.root, packet.sound);
    // The frame that the packet was turned into last: whole subtrees share one.
    let (mut frame, mut turned) = (0, None);
    loop {
        if at & Tree::<B>::LEAF != 0 {
            leaf(at & !Tree::<B>::LEAF, rays, queries, stack);
        } else if rays.count_ones() <= FEW {
            few(at, rays, queries);
        } else {
            let node = &tree.nodes[at as usize];
            queries.count_node(simd, rays);
            let slabs = if node.frame == 0 {
                &packet.slabs
            } else {
                if node.frame != frame {
                    frame = node.frame;
                    turned = Some(packet.turned(&tree.frames[frame as usize]));
                }
                turned.as_ref().unwrap_or(&packet.slabs)
            };
            let found = enter16(
                simd,
                &node.bounds,
                node.valid,
                slabs,
                rays,
                &queries.t_min,
                &queries.t_max,
            );
            let mut children = found.children;
            if children != 0 {
                let base = stack.len();
                while children != 0 {
                    let slot = (children.trailing_zeros() & 7) as usize;
                    children &= children - 1;
                    stack.push(Waiting {
                        at: node.children[slot],
                        rays: found.rays[slot],
                        near: found.near[slot],
                    });
                    let mut i = stack.len() - 1;
                    while i > base && stack[i - 1].near < stack[i].near {
                        stack.swap(i - 1, i);
                        i -= 1;
                    }
                }
            }
        }
        // Next subtree that does not start behind the best hits.
        loop {
            if stack.len() <= floor {
                return;
            }
            let Some(next) = stack.pop() else { return };
            if next.near <= queries.farthest(simd, next.rays) {
                (at, rays) = (next.at, next.rays);
                break;
            }
        }
    }
}

impl<S: Simd, B: Bounds8> Target<'_, S, B, false> {
    /// Traces the rays `lanes`, given in the object's space.
    #[inline(always)]
    pub fn enter16(
        &self,
        rays: &Rays,
        lanes: u32,
        queries: &mut Queries,
        stack16: &mut Stack16,
        stack: &mut Stack,
    ) {
        let packet = if B::MOVING {
            Packet::new::<true>(self.simd, rays, lanes, self.radius, None)
        } else {
            Packet::new::<false>(self.simd, rays, lanes, self.radius, None)
        };
        let cells = CellRays::new(&packet, &self.mesh.key_times);
        walk16(
            self.simd,
            &self.blocks.tree,
            &packet,
            queries,
            stack16,
            #[inline(always)]
            |item, lanes, queries, _| self.item16(item, lanes, &packet, &cells, queries),
            #[inline(always)]
            |root, lanes, queries| {
                let mut rest = lanes;
                while rest != 0 {
                    let lane = rest.trailing_zeros() as usize & (LANES - 1);
                    rest &= rest - 1;
                    let time = slab_time::<B>(rays.time[lane]);
                    if let Some(ray) = alone(rays, lane, time, self.radius) {
                        let cells = cells.lane(rays, lane);
                        queries.alone(
                            lane,
                            #[inline(always)]
                            |query, counts| self.trace(root, &ray, &cells, query, stack, counts),
                        );
                    }
                }
            },
        );
    }

    /// Tests one item of the tree: a loose group or a block.
    #[inline(always)]
    fn item16(
        &self,
        item: u32,
        lanes: u32,
        packet: &Packet<'_, S>,
        cells: &CellRays,
        queries: &mut Queries,
    ) {
        if let Some((grid, slot)) = loose_group(item) {
            let rect = loose(&self.mesh.grids[grid as usize], slot);
            self.group16(grid, rect, lanes, packet.rays, cells, queries);
            return;
        }
        let block = &self.blocks.blocks[item as usize];
        queries.count_node(self.simd, lanes);
        let turned;
        let slabs = if block.frame == 0 {
            &packet.slabs
        } else {
            turned = packet.turned(&self.blocks.tree.frames[block.frame as usize]);
            &turned
        };
        let valid = (1u32 << block.span.count) - 1;
        let Entered16 {
            mut children,
            rays,
            near,
        } = enter16(
            self.simd,
            &block.bounds,
            valid,
            slabs,
            lanes,
            &queries.t_min,
            &queries.t_max,
        );
        while children != 0 {
            let slot = super::traverse::nearest(children, &near);
            children &= !(1 << slot);
            let lanes = rays[slot as usize];
            if near[slot as usize] > queries.farthest(self.simd, lanes) {
                continue;
            }
            let rect = block.span.group_rect(slot);
            self.group16(block.span.grid, rect, lanes, packet.rays, cells, queries);
        }
    }

    /// Tests one group of micropolygons.
    #[inline(always)]
    fn group16(
        &self,
        grid: u32,
        rect: CellRect,
        lanes: u32,
        rays: &Rays,
        cells: &CellRays,
        queries: &mut Queries,
    ) {
        queries.count_cells(self.simd, lanes, rect);
        if lanes.count_ones() >= DENSE
            && let Some(common) = cells.common
        {
            let (simd, mesh, instance) = (self.simd, self.mesh, self.instance);
            if B::MOVING {
                test_group16::<S, true>(
                    simd,
                    rays,
                    cells,
                    common,
                    lanes,
                    mesh,
                    grid,
                    rect,
                    #[inline(always)]
                    |lane, cell, hit| queries.offer(lane, hit.of(instance, grid, cell)),
                );
            } else {
                test_group16::<S, false>(
                    simd,
                    rays,
                    cells,
                    common,
                    lanes,
                    mesh,
                    grid,
                    rect,
                    #[inline(always)]
                    |lane, cell, hit| queries.offer(lane, hit.of(instance, grid, cell)),
                );
            }
            return;
        }
        let mut rest = lanes;
        while rest != 0 {
            let lane = rest.trailing_zeros() as usize & (LANES - 1);
            rest &= rest - 1;
            let cell = cells.lane(rays, lane);
            self.group_with(
                grid,
                rect,
                &cell,
                #[inline(always)]
                |hit| queries.offer(lane, hit),
            );
        }
    }
}
