//! Traversal by packets: a node is fetched, decoded and sorted once for all rays, and what waits for what in
//! one ray's test overlaps with another's.
//!
//! A packet goes where any of its rays goes, with those that do. Every ray meets the same
//! micropolygons as alone, or more; hits are the same.

use hdtrapeze_simd::{Float, Mask, Part, Simd};

use super::beam::{BEAM_RAYS, Beam};
use super::cell_rays::CellRays;
use super::enter::{Entered, Spans, by_child_pays, enter_few, enter_packet};
use super::enter_block::enter_block;
use super::in_turns::InTurns;
use super::opened::{Along, Meetings};
use super::packet::{
    All, Form, LANES, Lanes, PACKET, Packet, Ranges, Rays, Record, Slabs, VECTORS, in_turns, part,
    split,
};
use super::pairs::{Pairs, expect};
use super::relative::SeenMany;
use super::room::{Room, Space};
use super::traverse::Target;
use super::{Hit, TraceCounts, two_cells};
use crate::bvh::block::{Block, CellRect, loose};
use crate::bvh::object::{BlockTree, loose_group};
use crate::bvh::{Bounds8, ObjectGeometry, Tree};

/// As many rays at a block are tested one after the other.
const FEW: u32 = 8;

/// A subtree that waits: where the first ray enters it, reference, and rays.
#[derive(Clone, Copy, Debug)]
pub(super) struct Waiting {
    near: f32,
    at: u32,
    rays: u64,
}

/// What the rays of a packet look for, and the best so far.
pub(super) struct Queries {
    /// Any hit will do.
    pub any: bool,
    /// The best hits; misses but for their `t`, which is `t_max`, before there are any.
    pub best: [Hit; PACKET],
    /// `t_min` of each, and `t_max` below mirrored.
    pub ranges: Ranges,
    /// The first of each of `ranges` again.
    pub t_min: All,
    /// `best.t` of each; nothing is nearer than that of a ray which looks no more.
    pub t_max: All,
    /// What all rays cost.
    pub counts: TraceCounts,
    /// What each cost is told, too.
    pub each: bool,
    /// Nodes opened by each, where that is told.
    pub nodes: All,
    /// Micropolygons tested, likewise.
    pub cells: All,
}

impl Queries {
    /// Rays that look for nothing.
    pub const NONE: Queries = Queries {
        any: false,
        best: [Hit::MISS; PACKET],
        ranges: [[[f32::INFINITY; 2]; LANES]; VECTORS],
        t_min: [[f32::INFINITY; LANES]; VECTORS],
        t_max: [[f32::NEG_INFINITY; LANES]; VECTORS],
        counts: TraceCounts {
            rays: 0,
            node_tests: 0,
            cell_tests: 0,
        },
        each: false,
        nodes: [[0.0; LANES]; VECTORS],
        cells: [[0.0; LANES]; VECTORS],
    };

    /// What must not be read: a hit of all rays, for instance.
    pub const SPOILED: Queries = Queries {
        any: true,
        best: [Hit {
            t: 0.0,
            instance: 0,
            ..Hit::MISS
        }; PACKET],
        ranges: [[[f32::NAN; 2]; LANES]; VECTORS],
        t_min: [[f32::NAN; LANES]; VECTORS],
        t_max: [[f32::NAN; LANES]; VECTORS],
        counts: TraceCounts {
            rays: u64::MAX / 2,
            node_tests: u64::MAX / 2,
            cell_tests: u64::MAX / 2,
        },
        each: true,
        nodes: [[f32::NAN; LANES]; VECTORS],
        cells: [[f32::NAN; LANES]; VECTORS],
    };

    /// Between what each ray looks.
    #[inline(always)]
    fn spans(&self) -> Spans<'_> {
        Spans {
            pairs: &self.ranges,
            t_min: &self.t_min,
            t_max: &self.t_max,
        }
    }

    #[inline(always)]
    fn count_node<S: Simd>(&mut self, simd: S, rays: u64) {
        self.counts.node_tests += u64::from(rays.count_ones());
        if self.each {
            add(simd, &mut self.nodes, rays, 1.0);
        }
    }

    #[inline(always)]
    pub fn count_cells<S: Simd>(&mut self, simd: S, rays: u64, rect: CellRect) {
        let cells = u16::from(rect.w) * u16::from(rect.h);
        self.counts.cell_tests += u64::from(rays.count_ones()) * u64::from(cells);
        if self.each {
            add(simd, &mut self.cells, rays, f32::from(cells));
        }
    }

    /// Counts cells that one ray is tested against.
    #[inline(always)]
    pub fn count_cells_of(&mut self, ray: usize, cells: u32) {
        self.counts.cell_tests += u64::from(cells);
        if self.each {
            let (v, lane) = split(ray);
            self.cells[v][lane] += cells as f32;
        }
    }

    /// True where a ray looks no farther than to some place before `t`. What lies in bounds that it enters at `t` is no
    /// hit then: none in there is nearer, and one as near, which another may follow by number, is not beyond.
    #[inline(always)]
    pub fn is_beyond(&self, ray: usize, t: f32) -> bool {
        let (v, lane) = split(ray);
        t > self.t_max[v][lane]
    }

    /// A ray looks no farther than `t_max`.
    #[inline(always)]
    fn end(&mut self, ray: usize, t_max: f32) {
        let (v, lane) = split(ray);
        self.t_max[v][lane] = t_max;
        self.ranges[v][lane][1] = -t_max;
    }

    /// Begins to ask about `count` rays.
    #[inline(always)]
    pub fn ask(&mut self, any: bool, each: bool, count: usize) {
        (self.any, self.each) = (any, each);
        self.counts = TraceCounts {
            rays: count as u64,
            ..TraceCounts::default()
        };
        if each {
            (self.nodes, self.cells) = (Self::NONE.nodes, Self::NONE.cells);
        }
    }

    /// The rays of vector `v` are asked about what lies from `t_min` to `t_max`, if they are among `asks`; others miss.
    #[inline(always)]
    pub fn begin_all<S: Simd>(
        &mut self,
        simd: S,
        v: usize,
        asks: u32,
        t_min: &Lanes,
        t_max: &Lanes,
    ) {
        let asked = simd.mask16(asks);
        let (least, most) = (simd.from16(t_min), simd.from16(t_max));
        let ends = most.or(asked, simd.all16(f32::INFINITY)).to_array();
        for (best, t) in self.best[LANES * v..].iter_mut().zip(ends) {
            *best = Hit { t, ..Hit::MISS };
        }
        self.t_min[v] = *t_min;
        self.t_max[v] = *t_max;
        self.ranges[v] = in_turns(simd, least, -most);
    }

    /// A hit of a ray.
    #[inline(always)]
    pub fn offer(&mut self, ray: usize, hit: Hit) {
        let (v, lane) = split(ray);
        let best = &mut self.best[ray & (PACKET - 1)];
        // Written so that NaN is refused.
        let in_range = hit.t >= self.ranges[v][lane][0] && hit.t <= best.t;
        if in_range && hit.is_before(best) {
            *best = hit;
            self.end(ray, if self.any { f32::NEG_INFINITY } else { hit.t });
        }
    }
}

/// Adds to the counts of `rays`.
#[inline(always)]
fn add<S: Simd>(simd: S, to: &mut All, rays: u64, more: f32) {
    for (v, to) in to.iter_mut().enumerate() {
        let lanes = part(rays, v);
        if lanes != 0 {
            let more = simd.all16(more).or(simd.mask16(lanes), simd.all16(0.0));
            *to = (simd.from16(to) + more).to_array();
        }
    }
}

/// What a packet does at the items of a tree.
pub(super) trait Items {
    /// Rays may come to an item soon.
    fn soon(&self, item: u32, rays: u64);
    /// Some rays may hit an item, of which was said that it may be so, unless they came at once. Gives all that wait for
    /// something: none of them goes on until there is nothing to do for others.
    fn test(&mut self, item: u32, rays: u64, queries: &mut Queries, room: &mut Room) -> u64;
    /// There is nothing else to do. Gives those that wait still; none, after some calls.
    fn go_on(&mut self, queries: &mut Queries, room: &mut Room) -> u64;
}

/// Walks a tree with a packet; `turned` is room for rays in a node's frame.
#[inline(always)]
pub(super) fn walk_packet<S: Simd, B: Bounds8>(
    simd: S,
    tree: &Tree<B>,
    packet: &Packet<'_, S>,
    turned: &mut Slabs,
    queries: &mut Queries,
    room: &mut Room,
    items: &mut impl Items,
) {
    if tree.root == Tree::<B>::EMPTY || packet.sound == 0 {
        return;
    }
    let mut wait = 0;
    let floor = room.waiting.len();
    let (mut at, mut rays) = (tree.root, packet.sound);
    // The frame that rays were turned into last, and which of them: whole subtrees share one.
    let (mut frame, mut ready) = (0, 0);
    let mut beam: Option<Option<Beam>> = None;
    loop {
        if at & Tree::<B>::LEAF != 0 {
            wait = items.test(at & !Tree::<B>::LEAF, rays, queries, room);
        } else {
            // All of it at once: which children there are is asked when their bounds were tested.
            simd.expect(&tree.nodes, at as usize);
            let node = &tree.nodes[at as usize];
            queries.count_node(simd, rays);
            let slabs = if node.frame == 0 {
                &*packet.slabs
            } else {
                if node.frame != frame || rays & !ready != 0 {
                    (frame, ready) = (node.frame, rays);
                    let frame = &tree.frames[frame as usize];
                    packet.turn(frame, rays, B::MOVING, Form::Both, turned);
                }
                &*turned
            };
            let mut valid = node.valid();
            // Children that all rays are taken to meet: testing them would leave out few.
            let mut all = 0;
            let mut near = [0.0; 8];
            if node.frame == 0
                && rays.count_ones() >= BEAM_RAYS
                && let Some(beam) = beam.get_or_insert_with(
                    #[inline(always)]
                    || Beam::new(simd, packet, tree, &queries.t_min),
                )
            {
                let touched = beam.touched(simd, &node.bounds, valid);
                valid = touched.children;
                let child = node.children[valid.trailing_zeros() as usize & 7];
                if valid.is_power_of_two() && child & Tree::<B>::LEAF == 0 {
                    at = child;
                    continue;
                }
                near = touched.near;
                let mut wide = touched.wide;
                while wide != 0 {
                    let slot = wide.trailing_zeros() as usize & 7;
                    wide &= wide - 1;
                    all |= u32::from(node.children[slot] & Tree::<B>::LEAF == 0) << slot;
                }
            }
            if valid != 0 {
                let mut found = Entered::NONE;
                if valid != all {
                    let spans = queries.spans();
                    found = enter_packet(simd, &node.bounds, valid & !all, slabs, rays, spans);
                }
                if all != 0 {
                    found.enter_all(all, rays, &near);
                }
                if found.children != 0 {
                    // The nearest child is next; the others wait, nearer ones on top.
                    let (slots, count) = found.by_distance(simd);
                    for &slot in slots[1..count].iter().rev() {
                        let child = node.children[slot];
                        if child & Tree::<B>::LEAF != 0 {
                            items.soon(child & !Tree::<B>::LEAF, found.rays[slot]);
                        } else {
                            simd.expect(&tree.nodes, child as usize);
                        }
                        room.waiting.push(Waiting {
                            near: found.near(slot),
                            at: node.children[slot],
                            rays: found.rays[slot],
                        });
                    }
                    (at, rays) = (node.children[slots[0]], found.rays[slots[0]]);
                    continue;
                }
            }
        }
        // Next subtree that does not start behind the best hits.
        loop {
            let next = loop {
                if let Some(next) = next_but(&mut room.waiting, floor, wait) {
                    break next;
                }
                if wait == 0 {
                    return;
                }
                wait = items.go_on(queries, room);
            };
            let near = simd.all16(next.near);
            let mut left = 0;
            for (v, t_max) in queries.t_max.iter().enumerate() {
                let reach = near.le(simd.from16(t_max)).bits();
                left |= u64::from(reach) << (LANES * v);
            }
            left &= next.rays;
            if left != 0 {
                (at, rays) = (next.at, left);
                break;
            }
        }
    }
}

/// As many subtrees are looked at for one that rays can go on with.
const LOOK: usize = 4;

/// Takes what is next for some rays, of which none are among those that `wait`; if none do, the last there is above `floor`.
#[inline(always)]
fn next_but(waiting: &mut Vec<Waiting>, floor: usize, wait: u64) -> Option<Waiting> {
    if wait == 0 {
        return if waiting.len() > floor {
            waiting.pop()
        } else {
            None
        };
    }
    let count = waiting.len();
    // Those that are here no more, since something else is before it.
    let mut taken = wait;
    for at in (floor..count).rev().take(LOOK) {
        let next = waiting[at];
        if next.rays & taken == 0 {
            waiting.copy_within(at + 1.., at);
            waiting.truncate(count - 1);
            return Some(next);
        }
        taken |= next.rays;
    }
    None
}

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

/// Room for a packet in the frames of blocks.
pub(super) struct InBlock<'a> {
    /// For its rays in one of them.
    turned: &'a mut Slabs,
    /// For what they are turned from.
    records: &'a mut [Record; PACKET],
    /// True where that is there: from the first block on that has a frame of its own.
    ready: bool,
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
        let groups = found.children;
        // The first group is waited for; the others come meanwhile.
        target.expect_groups(block, groups & groups.wrapping_sub(1), rays, cells);
        target.groups_packet(block, groups, &found.rays, cells, pairs, queries);
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

/// What waits goes on, [apart](Simd::apart).
struct GoOn<'a, 'b, 't, 'p, 'r, S: Simd, B: Bounds8> {
    items: &'a mut ObjectItems<'b, 't, 'p, 'r, S, B>,
    queries: &'a mut Queries,
    room: &'a mut Room,
}

impl<S: Simd, B: Bounds8> Part<S> for GoOn<'_, '_, '_, '_, '_, S, B> {
    type Output = u64;
    #[inline(always)]
    fn run(self, _: S) -> u64 {
        let Self {
            items,
            queries,
            room: Room { opened, pairs, .. },
        } = self;
        let mut along = Along {
            packet: items.packet,
            room: &mut items.in_block,
            cells: items.cells,
            pairs,
            queries,
        };
        items.target.go_on(opened, &mut along);
        opened.rays()
    }
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
        if loose_group(item).is_none() {
            self.meetings.add(rays);
        }
        if self.waits && loose_group(item).is_none() {
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
        self.target.simd.apart(GoOn {
            items: self,
            queries,
            room,
        })
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
        let far = self.mesh.is_far();
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
        if far {
            // The next packet is like this one, most often.
            room.opened.pays = items.meetings.are_of_few();
        }
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
