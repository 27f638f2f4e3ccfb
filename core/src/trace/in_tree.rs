//! A packet in one tree of an object: what it does at blocks and at loose groups of micropolygons.

use hdtrapeze_simd::{Part, Simd};

use super::cell_rays::CellRays;
use super::enter::{Entered, by_child_pays, enter_few, enter_packet};
use super::enter_block::enter_block;
use super::in_turns::InTurns;
use super::opened::{GoOn, Meetings};
use super::packet::{Form, InBlock, PACKET, Packet, Rays, VECTORS};
use super::pairs::{Pairs, expect};
use super::queries::Queries;
use super::relative::SeenMany;
use super::room::{Room, Space};
use super::traverse::Target;
use super::traverse_packet::{Items, walk_packet};
use super::two_cells;
use crate::bvh::block::{Block, CellRect, loose};
use crate::bvh::object::{BlockTree, loose_group};
use crate::bvh::{Bounds8, ObjectGeometry};

/// As many rays at a block are tested one after the other.
const FEW: u32 = 8;

/// A packet in one tree of an object.
pub(super) struct InTree<'a, B: Bounds8> {
    pub blocks: &'a BlockTree<B>,
    pub object: &'a ObjectGeometry,
    pub instance: u32,
    /// In the space of the object.
    pub rays: &'a [Rays],
    pub lanes: u64,
    /// They have little in common.
    pub scattered: bool,
    /// As the tree sees the rays, where that is otherwise.
    pub seen: Option<&'a SeenMany>,
    pub queries: &'a mut Queries,
    pub room: &'a mut Room,
}

impl<S: Simd, B: Bounds8> Part<S> for InTree<'_, B> {
    type Output = ();
    #[inline(always)]
    fn run(self, simd: S) {
        let Self {
            blocks,
            object,
            instance,
            ..
        } = self;
        Target::new(simd, blocks, object, instance, None).enter_packet(
            self.rays,
            (self.lanes, self.scattered),
            self.seen,
            self.queries,
            self.room,
        );
    }
}

/// A block and a packet, [apart](Simd::apart).
struct BlockItem<'a, 't, 'p, 'r, S: Simd, B: Bounds8> {
    target: &'a Target<'t, S, B, false>,
    block: &'a Block<B>,
    rays: u64,
    packet: &'a Packet<'p, S>,
    room: &'a mut InBlock<'r>,
    cells: &'a CellRays,
    pairs: &'a mut Pairs,
    queries: &'a mut Queries,
}

impl<S: Simd, B: Bounds8> Part<S> for BlockItem<'_, '_, '_, '_, S, B> {
    type Output = ();
    #[inline(always)]
    fn run(self, _: S) {
        let Self {
            target,
            block,
            rays,
            packet,
            room,
            cells,
            pairs,
            queries,
        } = self;
        let found = target.open_block(block, rays, packet, room, queries);
        // Their vertices are not asked for ahead: that took longer than what processors, which look ahead, wait for.
        target.groups_packet(block, found.children, &found.rays, cells, pairs, queries);
        target.settle(cells, pairs, queries);
    }
}

/// The items of an object's tree, to a packet.
struct ObjectItems<'a, 't, 'p, 'r, S: Simd, B: Bounds8> {
    target: &'a Target<'t, S, B, false>,
    packet: &'a Packet<'p, S>,
    in_block: InBlock<'r>,
    cells: &'a CellRays,
    /// There are several segments of keys.
    segments: bool,
    /// Blocks are waited for.
    waits: bool,
    meetings: Meetings,
}

impl<S: Simd, B: Bounds8> Items for ObjectItems<'_, '_, '_, '_, S, B> {
    #[inline(always)]
    fn soon(&self, item: u32, rays: u64) {
        if !self.segments {
            self.target.expect(item, 0);
            return;
        }
        // They go through one segment, most often. Asking for what the others need, too, costs more than it
        // saves.
        let first = rays.trailing_zeros() as usize & (PACKET - 1);
        self.target.expect(item, self.cells.key[first]);
    }

    #[inline(always)]
    fn test(&mut self, item: u32, rays: u64, queries: &mut Queries, room: &mut Room) -> u64 {
        let Self {
            target,
            packet,
            in_block,
            cells,
            ..
        } = self;
        let is_block = loose_group(item).is_none();
        if is_block {
            self.meetings.add(rays);
        }
        if self.waits && is_block {
            target.ask(&mut room.opened, item, rays);
            if room.opened.is_full() {
                return self.go_on(queries, room);
            }
        } else {
            target.item_packet(
                item,
                rays,
                packet,
                in_block,
                cells,
                &mut room.pairs,
                queries,
            );
        }
        if self.waits { room.opened.rays() } else { 0 }
    }

    #[inline(always)]
    fn go_on(&mut self, queries: &mut Queries, room: &mut Room) -> u64 {
        let Room { opened, pairs, .. } = room;
        self.target.simd.apart(GoOn {
            target: self.target,
            packet: self.packet,
            room: &mut self.in_block,
            cells: self.cells,
            opened: &mut *opened,
            pairs,
            queries,
        });
        opened.rays()
    }
}

impl<S: Simd, B: Bounds8> Target<'_, S, B, false> {
    /// Traces the rays `lanes`, given in the object's space, which are `scattered` or not; and as the tree sees them, where that
    /// is otherwise.
    #[inline(always)]
    fn enter_packet(
        &self,
        rays: &[Rays],
        (lanes, scattered): (u64, bool),
        seen: Option<&SeenMany>,
        queries: &mut Queries,
        room: &mut Room,
    ) {
        let (slab_rays, pads) = match seen {
            Some(seen) => (&seen.rays[..rays.len().min(VECTORS)], Some(&seen.pads)),
            None => (rays, None),
        };
        let mut space = room.take();
        let Space {
            slabs,
            turned,
            in_block,
            records,
            cells: own,
            turns,
            turns_records,
            ..
        } = &mut *space;
        let slabs = (slabs, &self.blocks.bowing);
        let mut packet = if B::MOVING {
            Packet::new::<true>(self.simd, slab_rays, lanes, self.radius, pads, slabs)
        } else {
            Packet::new::<false>(self.simd, slab_rays, lanes, self.radius, pads, slabs)
        };
        if packet.sound == 0 {
            room.give_back(space);
            return;
        }
        let cells = match seen {
            Some(seen) => &seen.cells,
            None => {
                own.set(self.simd, rays, packet.sound, &self.mesh.key_times);
                &*own
            }
        };
        let mut in_block = InBlock {
            turned: in_block,
            records,
            ready: false,
        };
        if scattered {
            packet.sound = self.simd.apart(InTurns {
                target: self,
                packet: &packet,
                room: (&mut *turns_records, &mut *turned, turns),
                in_block: &mut in_block,
                cells,
                pairs: &mut room.pairs,
                queries,
            });
        }
        let far = room.opened.far;
        debug_assert!(room.opened.is_empty(), "nothing waits in another tree");
        let mut items = ObjectItems {
            target: self,
            packet: &packet,
            in_block,
            cells,
            segments: B::KEYS && self.mesh.key_times.len() > 2,
            waits: far && room.opened.pays,
            meetings: Meetings::default(),
        };
        walk_packet(
            self.simd,
            &self.blocks.tree,
            &packet,
            turned,
            queries,
            room,
            &mut items,
        );
        if far && let Some(few) = items.meetings.are_of_few() {
            // The next packet is like this one, most often.
            room.opened.pays = few;
        }
        debug_assert!(room.opened.is_empty(), "all that was asked for was tested");
        room.give_back(space);
    }

    /// Tests one item of the tree: a loose group or a block.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)] // one call, inlined
    pub(super) fn item_packet(
        &self,
        item: u32,
        rays: u64,
        packet: &Packet<'_, S>,
        room: &mut InBlock<'_>,
        cells: &CellRays,
        pairs: &mut Pairs,
        queries: &mut Queries,
    ) {
        if let Some((grid, slot)) = loose_group(item) {
            let rect = loose(&self.mesh.traced(grid), slot);
            self.group_packet(grid, rect, rays, cells, pairs, queries);
            self.settle(cells, pairs, queries);
        } else {
            // So that the tests of loose groups, such as parts of strands, do not share registers with them.
            self.simd.apart(BlockItem {
                target: self,
                block: &self.blocks.blocks[item as usize],
                rays,
                packet,
                room,
                cells,
                pairs,
                queries,
            });
        }
    }

    /// Finds which groups of a block rays enter.
    #[inline(always)]
    pub(super) fn open_block(
        &self,
        block: &Block<B>,
        rays: u64,
        packet: &Packet<'_, S>,
        room: &mut InBlock<'_>,
        queries: &mut Queries,
    ) -> Entered {
        queries.count_node(self.simd, rays);
        let valid = (1u32 << block.span.count) - 1;
        let (simd, bounds) = (self.simd, &block.bounds);
        let frame = &self.blocks.frames[block.frame as usize];
        let InBlock {
            turned,
            records,
            ready,
        } = room;
        if block.frame == 0 {
            enter_packet(simd, bounds, valid, packet.slabs, rays, queries.spans())
        } else if by_child_pays(rays, valid) {
            packet.turn(frame, rays, B::MOVING, Form::Apart, turned);
            if !turned.agree(rays) {
                turned.pair(simd, rays);
            }
            enter_packet(simd, bounds, valid, turned, rays, queries.spans())
        } else {
            if !*ready {
                packet.records(records);
                *ready = true;
            }
            let frame = (frame, packet.bowing);
            if B::MOVING && rays.count_ones() > FEW {
                enter_block(simd, bounds, valid, frame, rays, records, &queries.ranges)
            } else {
                let room = (&**records, &mut **turned);
                enter_few(simd, bounds, valid, frame, rays, room, &queries.ranges)
            }
        }
    }

    /// Says that some groups of a block will be asked for soon by `rays`.
    #[inline(always)]
    pub(super) fn expect_groups(
        &self,
        block: &Block<B>,
        mut groups: u32,
        rays: u64,
        cells: &CellRays,
    ) {
        let key = cells.key[rays.trailing_zeros() as usize & (PACKET - 1)];
        while groups != 0 {
            let slot = groups.trailing_zeros() & 7;
            groups &= groups - 1;
            let rect = block.span.group_rect(slot);
            expect::<S, B>(self.simd, self.mesh, block.span.grid, rect, key);
        }
    }

    /// Tests groups of a block, each by its own of `rays`; the exact tests may wait.
    #[inline(always)]
    pub(super) fn groups_packet(
        &self,
        block: &Block<B>,
        mut groups: u32,
        rays: &[u64; 8],
        cells: &CellRays,
        pairs: &mut Pairs,
        queries: &mut Queries,
    ) {
        while groups != 0 {
            let slot = groups.trailing_zeros() & 7;
            groups &= groups - 1;
            let rays = rays[slot as usize];
            let rect = block.span.group_rect(slot);
            self.group_packet(block.span.grid, rect, rays, cells, pairs, queries);
        }
    }

    /// Exact tests of the pairs that wait.
    #[inline(always)]
    pub(super) fn settle(&self, cells: &CellRays, pairs: &mut Pairs, queries: &mut Queries) {
        let instance = self.instance;
        pairs.settle(
            self.simd,
            cells,
            #[inline(always)]
            |ray, grid, cell, hit| queries.offer(ray, hit.of(instance, grid, cell)),
        );
    }

    /// Tests one group of micropolygons; the exact tests may wait.
    #[inline(always)]
    fn group_packet(
        &self,
        grid: u32,
        rect: CellRect,
        mut rays: u64,
        cells: &CellRays,
        pairs: &mut Pairs,
        queries: &mut Queries,
    ) {
        queries.count_cells(self.simd, rays, rect);
        while rays != 0 {
            let one = rays.trailing_zeros() as usize & (PACKET - 1);
            let like = rays & cells.like[one];
            rays &= !cells.like[one];
            if two_cells::is_small(rect) {
                self.two_cells(grid, rect, (one, like), cells, queries);
            } else {
                self.pairs(grid, rect, (one, like), cells, pairs, queries);
            }
        }
    }

    /// Tests a group of two cells, or one, by rays which agree on axes and key; the first is given.
    #[inline(always)]
    fn two_cells(
        &self,
        grid: u32,
        rect: CellRect,
        rays: (usize, u64),
        cells: &CellRays,
        queries: &mut Queries,
    ) {
        let (simd, mesh, instance) = (self.simd, self.mesh, self.instance);
        if B::KEYS {
            two_cells::test::<S, true>(
                simd,
                cells,
                rays,
                mesh,
                grid,
                rect,
                #[inline(always)]
                |ray, cell, hit| queries.offer(ray, hit.of(instance, grid, cell)),
            );
        } else {
            two_cells::test::<S, false>(
                simd,
                cells,
                rays,
                mesh,
                grid,
                rect,
                #[inline(always)]
                |ray, cell, hit| queries.offer(ray, hit.of(instance, grid, cell)),
            );
        }
    }

    /// Tests one group by one ray after the other, which agree on axes and key; the first is given.
    #[inline(always)]
    fn pairs(
        &self,
        grid: u32,
        rect: CellRect,
        rays: (usize, u64),
        cells: &CellRays,
        pairs: &mut Pairs,
        queries: &mut Queries,
    ) {
        if pairs.is_full() {
            self.settle(cells, pairs, queries);
        }
        if B::KEYS {
            pairs.test::<S, true>(self.simd, cells, rays, self.mesh, grid, rect);
        } else {
            pairs.test::<S, false>(self.simd, cells, rays, self.mesh, grid, rect);
        }
    }
}
