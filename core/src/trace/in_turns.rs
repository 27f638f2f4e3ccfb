//! A packet of rays that have little in common, in the tree of an object: the walk is that of [`super::scattered`], parts of strands
//! go to [`super::waits`], and what else there is goes the way of packets, ray by ray.

use hdtrapeze_simd::{Part, Simd};

use super::cell::CellHit;
use super::cell_rays::CellRays;
use super::packet::{InBlock, PACKET, Packet, Record, Slabs};
use super::pairs::Pairs;
use super::queries::Queries;
use super::scattered::{Turns, walk_scattered};
use super::strip::Strip;
use super::traverse::Target;
use super::waits::Waits;
use crate::bvh::object::loose_group;
use crate::bvh::{Bounds8, Tree};

/// A packet of rays that have little in common, [apart](Simd::apart).
pub(super) struct InTurns<'a, 't, 'p, 'r, S: Simd, B: Bounds8> {
    pub target: &'a Target<'t, S, B, false>,
    pub packet: &'a Packet<'p, S>,
    /// For rays turned into frames of nodes, and for those that take turns.
    pub room: (&'a mut [Record; PACKET], &'a mut Slabs, &'a mut Turns),
    pub in_block: &'a mut InBlock<'r>,
    pub cells: &'a CellRays,
    pub pairs: &'a mut Pairs,
    pub queries: &'a mut Queries,
}

impl<S: Simd, B: Bounds8> Part<S> for InTurns<'_, '_, '_, '_, S, B> {
    /// Rays that were not traced to their end.
    type Output = u64;
    #[inline(always)]
    fn run(self, _: S) -> u64 {
        let Self {
            target,
            packet,
            room,
            in_block,
            cells,
            pairs,
            queries,
        } = self;
        target.in_turns(packet, room, in_block, cells, pairs, queries)
    }
}

/// An item that is no part of a strand, and one ray, [apart](Simd::apart).
struct OtherItem<'a, 't, 'p, 'r, S: Simd, B: Bounds8> {
    target: &'a Target<'t, S, B, false>,
    item: u32,
    ray: usize,
    packet: &'a Packet<'p, S>,
    in_block: &'a mut InBlock<'r>,
    cells: &'a CellRays,
    pairs: &'a mut Pairs,
    queries: &'a mut Queries,
}

impl<S: Simd, B: Bounds8> Part<S> for OtherItem<'_, '_, '_, '_, S, B> {
    type Output = ();
    #[inline(always)]
    fn run(self, _: S) {
        let Self {
            target,
            item,
            ray,
            packet,
            in_block,
            cells,
            pairs,
            queries,
        } = self;
        target.item_packet(item, 1 << ray, packet, in_block, cells, pairs, queries);
    }
}

/// Parts of strands that wait for rays, [apart](Simd::apart).
struct TestWaits<'a, 't, S: Simd, B: Bounds8> {
    target: &'a Target<'t, S, B, false>,
    waits: &'a mut Waits,
    cells: &'a CellRays,
    queries: &'a mut Queries,
}

impl<S: Simd, B: Bounds8> Part<S> for TestWaits<'_, '_, S, B> {
    /// The rays that found something.
    type Output = u64;
    #[inline(always)]
    fn run(self, simd: S) -> u64 {
        let Self {
            target,
            waits,
            cells,
            queries,
        } = self;
        let (mesh, instance) = (target.mesh, target.instance);
        let mut found = 0;
        let accept = |ray: usize, grid: u32, cell: u32, hit: CellHit| {
            queries.offer(ray, hit.of(instance, grid, cell));
            found |= 1 << ray;
        };
        if B::KEYS {
            waits.test::<S, true>(simd, cells, mesh, accept);
        } else {
            waits.test::<S, false>(simd, cells, mesh, accept);
        }
        found
    }
}

impl<S: Simd, B: Bounds8> Target<'_, S, B, false> {
    /// Traces the rays of a packet in turns; those that were not traced to their end are given.
    #[inline(always)]
    fn in_turns(
        &self,
        packet: &Packet<'_, S>,
        (records, turned, turns): (&mut [Record; PACKET], &mut Slabs, &mut Turns),
        in_block: &mut InBlock<'_>,
        cells: &CellRays,
        pairs: &mut Pairs,
        queries: &mut Queries,
    ) -> u64 {
        let (simd, mesh, blocks) = (self.simd, self.mesh, self.blocks);
        // What all grids are, where they are alike.
        let strip = mesh.alike().map(|grid| Strip::of(&grid));
        let mut waits = Waits::default();
        let left_out = walk_scattered(
            simd,
            (&blocks.tree, blocks.diagonals),
            packet,
            (records, turned),
            turns,
            queries,
            #[inline(always)]
            |items, queries| {
                let mut found = 0;
                // A step after there were enough, so that most vertices are there.
                if waits.are_enough() {
                    found |= self.test_waits(&mut waits, cells, queries);
                }
                for (item, ray, near) in items.each() {
                    if queries.is_beyond(ray, near) {
                        // What was found meanwhile is nearer.
                        continue;
                    }
                    let item = item & !Tree::<B>::LEAF;
                    if let Some((grid, slot)) = loose_group(item) {
                        if waits.are_full() {
                            found |= self.test_waits(&mut waits, cells, queries);
                        }
                        let placed = mesh.traced(grid);
                        if let Some(strip) = &strip.unwrap_or_else(
                            #[inline(always)]
                            || Strip::of(&placed),
                        ) {
                            let part = (grid, placed.first_vertex, slot);
                            let added = if B::KEYS {
                                let key = cells.key[ray & (PACKET - 1)];
                                waits.add::<S, 2>(simd, mesh, strip, part, (ray, key))
                            } else {
                                waits.add::<S, 1>(simd, mesh, strip, part, (ray, 0))
                            };
                            if let Some(part) = added {
                                queries.count_cells_of(ray, 1 + u32::from(part.two));
                                continue;
                            }
                        }
                    }
                    simd.apart(OtherItem {
                        target: self,
                        item,
                        ray,
                        packet,
                        in_block: &mut *in_block,
                        cells,
                        pairs: &mut *pairs,
                        queries,
                    });
                    found |= 1 << ray;
                }
                found
            },
        );
        while !waits.are_none() {
            self.test_waits(&mut waits, cells, queries);
        }
        left_out
    }

    /// Tests parts of strands that wait; gives the rays that found something.
    #[inline(always)]
    fn test_waits(&self, waits: &mut Waits, cells: &CellRays, queries: &mut Queries) -> u64 {
        self.simd.apart(TestWaits {
            target: self,
            waits,
            cells,
            queries,
        })
    }
}
