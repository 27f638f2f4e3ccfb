//! Queries of packets: as [`super::query`] asks for one ray.

use std::cell::Cell;

use hdtrapeze_simd::{Float, Kernel, Mask, Simd};

use super::inside::InsideMany;
use super::late::Late;
use super::movers::MoversMany;
use super::packet::{LANES, Lanes, PACKET, Packet, Rays, VECTORS, columns, part, split};
use super::queries::Queries;
use super::room::{Room, Space};
use super::traverse_packet::{Items, walk_packet};
use super::world::{MOVERS, Numbered, TopTree, World, clamp_times};
use super::{Hit, Ray, TraceCounts};
use crate::bvh::bowing::PARABOLA;
use crate::bvh::{Bounds8, ObjectGeometry, Tree};

thread_local! {
    /// What this thread keeps between packets; taken while in use.
    static ROOM: Cell<Option<Box<Room>>> = const { Cell::new(None) };
}

/// What this thread keeps.
#[cfg(test)]
pub(super) fn with_room<T>(f: impl FnOnce(&mut Room) -> T) -> T {
    ROOM.with(|cell| {
        let mut room = cell.take().unwrap_or_default();
        let out = f(&mut room);
        cell.set(Some(room));
        out
    })
}

impl World {
    /// [`World::trace`] for many rays, best near each other in space and time; each answer is the
    /// same as alone. Traces the first `min(rays.len(), hits.len())`.
    pub fn trace_many(&self, rays: &[Ray], hits: &mut [Hit], counts: &mut TraceCounts) {
        for (rays, hits) in rays.chunks(PACKET).zip(hits.chunks_mut(PACKET)) {
            let count = rays.len().min(hits.len());
            let own = self.ask_packet(&rays[..count], false, &mut hits[..count], None);
            *counts = *counts + own;
        }
    }

    /// [`World::occluded`] for many rays, best near each other in space and time. Asks the first
    /// `min(rays.len(), found.len())`.
    pub fn occluded_many(&self, rays: &[Ray], found: &mut [bool], counts: &mut TraceCounts) {
        let mut hits = [Hit::MISS; PACKET];
        for (rays, found) in rays.chunks(PACKET).zip(found.chunks_mut(PACKET)) {
            let hits = &mut hits[..rays.len().min(found.len())];
            *counts = *counts + self.ask_packet(&rays[..hits.len()], true, hits, None);
            for (found, hit) in found.iter_mut().zip(hits) {
                *found = hit.is_hit();
            }
        }
    }

    /// [`World::trace_many`] for up to [`PACKET`] rays, which tells what each of them cost.
    ///
    /// # Panics
    /// The slices have different lengths, or more elements.
    pub fn trace_packet(&self, rays: &[Ray], hits: &mut [Hit], counts: &mut [TraceCounts]) {
        assert!(rays.len() <= PACKET && rays.len() == hits.len() && rays.len() == counts.len());
        self.ask_packet(rays, false, hits, Some(counts));
    }

    /// What all rays cost; `each` hears what each of them did. Slices are of one length, at most [`PACKET`].
    fn ask_packet(
        &self,
        rays: &[Ray],
        any: bool,
        hits: &mut [Hit],
        each: Option<&mut [TraceCounts]>,
    ) -> TraceCounts {
        let level = self.level;
        ROOM.with(|cell| {
            let mut room = cell.take().unwrap_or_default();
            let counts = level.run(Many {
                world: self,
                rays,
                any,
                hits,
                each,
                room: &mut room,
            });
            cell.set(Some(room));
            counts
        })
    }

    #[inline(always)]
    fn query_packet<S: Simd>(&self, simd: S, asked: Many<'_>) -> TraceCounts {
        let Many {
            rays,
            any,
            hits,
            each,
            room,
            ..
        } = asked;
        let mut queries = room.take_queries();
        let mut space = room.take();
        room.opened.far = self.is_far();
        queries.ask(any, each.is_some(), rays.len());
        let packed = &mut space.rays;
        let mut lanes = 0;
        for (v, (rays, packed)) in rays.chunks(LANES).zip(packed.iter_mut()).enumerate() {
            lanes |= u64::from(pack(simd, rays, packed, &mut queries, v)) << (LANES * v);
        }
        let packed = &packed[..rays.len().div_ceil(LANES)];
        let late = match &self.tops().top {
            TopTree::Static(tree) => {
                self.top_packet::<S, _, false>(simd, tree, packed, lanes, &mut queries, room)
            }
            TopTree::Moving(tree) => {
                self.top_packet::<S, _, true>(simd, tree, packed, lanes, &mut queries, room)
            }
        };
        if !late.is_empty() {
            self.finish_packet(simd, late, packed, &mut queries, room);
        }
        for (hit, best) in hits.iter_mut().zip(&queries.best) {
            *hit = if best.is_hit() { *best } else { Hit::MISS };
        }
        for (i, each) in each.into_iter().flatten().enumerate() {
            let (v, lane) = split(i);
            *each = TraceCounts {
                rays: 1,
                node_tests: queries.nodes[v][lane] as u64,
                cell_tests: queries.cells[v][lane] as u64,
            };
        }
        let counts = queries.counts;
        room.give_back_queries(queries);
        room.give_back(space);
        counts
    }

    /// Gives the instances that rays came to, and whose objects are not made.
    #[inline(always)]
    pub(super) fn top_packet<S: Simd, B: Bounds8, const MOVING: bool>(
        &self,
        simd: S,
        tree: &Tree<B>,
        rays: &[Rays],
        lanes: u64,
        queries: &mut Queries,
        room: &mut Room,
    ) -> Vec<Late> {
        let mut late = Vec::new();
        if tree.root & Tree::<B>::LEAF != 0 && tree.root != Tree::<B>::EMPTY {
            // A single instance, which bounds rays itself.
            let item = tree.root & !Tree::<B>::LEAF;
            match self.find(item).0.set.made() {
                Some(object) => {
                    self.inside_packet(simd, object, item, rays, lanes, queries, room);
                }
                None => late.push(Late { item, lanes }),
            }
            return late;
        }
        // The pads of `query_top`.
        let mut pads = [[0.0; LANES]; VECTORS];
        for (pads, rays) in pads.iter_mut().zip(rays) {
            for (lane, pad) in pads.iter_mut().enumerate() {
                *pad = self.pad(rays.origin_of(lane));
            }
        }
        let mut space = room.take();
        let Space { slabs, turned, .. } = &mut *space;
        let packet = Packet::new::<MOVING>(simd, rays, lanes, 0.0, Some(&pads), (slabs, &PARABOLA));
        let mut instances = Instances {
            world: self,
            simd,
            rays,
            moving: B::MOVING,
            late,
        };
        walk_packet(simd, tree, &packet, turned, queries, room, &mut instances);
        let late = instances.late;
        room.give_back(space);
        late
    }

    /// Traces the rays `lanes` through an instance of `object`.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)] // inlined
    pub(super) fn inside_packet<S: Simd>(
        &self,
        simd: S,
        object: &ObjectGeometry,
        item: u32,
        rays: &[Rays],
        lanes: u64,
        queries: &mut Queries,
        room: &mut Room,
    ) {
        let (Numbered { set, .. }, i) = self.find(item);
        let mut space = room.take();
        for (v, (local, rays)) in space.rays.iter_mut().zip(rays).enumerate() {
            let lanes = part(lanes, v);
            if lanes != 0 {
                *local = set.to_object16(simd, i, rays, lanes, self.origin);
            }
        }
        let rays = &space.rays[..rays.len().min(VECTORS)];
        let scattered = object.blas().is_of_strands() && are_scattered(simd, rays, lanes);
        self.level.run(InsideMany {
            object,
            instance: item,
            rays,
            lanes,
            scattered,
            queries,
            room,
        });
        room.give_back(space);
    }
}

/// The items of a world's tree, to a packet.
struct Instances<'a, S> {
    world: &'a World,
    simd: S,
    /// In the space of the world.
    rays: &'a [Rays],
    /// The tree is that of all instances, and moves.
    moving: bool,
    /// Instances whose objects are not made.
    late: Vec<Late>,
}

impl<S: Simd> Items for Instances<'_, S> {
    #[inline(always)]
    fn soon(&self, _: u32, _: u64) {}

    #[inline(always)]
    fn test(&mut self, item: u32, lanes: u64, queries: &mut Queries, room: &mut Room) -> u64 {
        let Self {
            world,
            simd,
            rays,
            moving,
            late,
        } = self;
        if !*moving && item == MOVERS {
            late.extend(world.level.run(MoversMany {
                world,
                rays,
                lanes,
                queries,
                room,
            }));
            return 0;
        }
        match world.find(item).0.set.made() {
            Some(object) => {
                world.inside_packet(*simd, object, item, rays, lanes, queries, room);
            }
            None => late.push(Late { item, lanes }),
        }
        0
    }

    #[inline(always)]
    fn go_on(&mut self, _: &mut Queries, _: &mut Room) -> u64 {
        0
    }
}

/// Directions that differ by more than this part of the largest component of any, along an axis, are scattered.
const SCATTERED: f32 = 1.0;

/// True where the rays `lanes` go in all directions, more or less: few of a packet meet the same nodes.
#[inline(always)]
fn are_scattered<S: Simd>(simd: S, rays: &[Rays], lanes: u64) -> bool {
    let (mut widest, mut longest) = (0.0f32, 0.0f32);
    for axis in 0..3 {
        let (above, below) = (simd.all16(f32::INFINITY), simd.all16(f32::NEG_INFINITY));
        let (mut least, mut most) = (above, below);
        for (v, rays) in rays.iter().enumerate() {
            let lanes = simd.mask16(part(lanes, v));
            let dir = simd.from16(&rays.dir[axis]);
            least = dir.or(lanes, above).min(least);
            most = dir.or(lanes, below).max(most);
        }
        let (least, most) = (least.least(), most.most());
        widest = widest.max(most - least);
        longest = longest.max(most).max(-least);
    }
    widest > SCATTERED * longest
}

/// Rays of a vector by what they are made of, and what is asked about each; the lanes of those that ask for something.
#[inline(always)]
fn pack<S: Simd>(simd: S, rays: &[Ray], packed: &mut Rays, queries: &mut Queries, v: usize) -> u32 {
    let mut t_max = [f32::NAN; LANES];
    let mut t_min = [f32::NAN; LANES];
    for (half, rays) in rays.chunks(LANES / 2).enumerate() {
        let at = LANES / 2 * half;
        for (t_max, ray) in t_max[at..].iter_mut().zip(rays) {
            *t_max = ray.t_max;
        }
        let [x, y, z, dx, dy, dz, time, least] = columns(simd, rays);
        let set = |to: &mut Lanes, x: S::F8| {
            to[at..at + LANES / 2].copy_from_slice(&x.to_array());
        };
        for (to, x) in packed.origin.iter_mut().zip([x, y, z]) {
            set(to, x);
        }
        for (to, x) in packed.dir.iter_mut().zip([dx, dy, dz]) {
            set(to, x);
        }
        set(&mut packed.time, time);
        set(&mut t_min, least);
    }
    let time = simd.from16(&packed.time);
    // Comparisons with NaN are false.
    let asks = simd.from16(&t_min).le(simd.from16(&t_max)) & time.le(time);
    packed.time = clamp_times(simd, time).to_array();
    let asks = asks.bits() & ((1u32 << rays.len()) - 1);
    queries.begin_all(simd, v, asks, &t_min, &t_max);
    asks
}

/// A packet of queries, for any instruction set.
struct Many<'a> {
    world: &'a World,
    rays: &'a [Ray],
    any: bool,
    hits: &'a mut [Hit],
    each: Option<&'a mut [TraceCounts]>,
    room: &'a mut Room,
}

impl Kernel for Many<'_> {
    type Output = TraceCounts;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> TraceCounts {
        self.world.query_packet(simd, self)
    }
}
