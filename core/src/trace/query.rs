//! Queries: rays through the tree over instances, and from there through objects, one by one or in packets.
//!
//! Everything is written for any instruction set. The trees of objects are kernels of their own ([`super::inside`]), so that
//! each is compiled once for a set, whatever tree stands above it.

use std::cell::Cell;

use glam::Vec3;
use hdtrapeze_simd::{Kernel, Simd};

use super::inside::{Inside, InsideMany};
use super::instance::{INSTANCE_PAD, NEAR_CONDITION};
use super::late::Late;
use super::movers::{Movers, MoversMany};
use super::object_ray::{ObjectRay, SLAB_PAD};
use super::packet::{LANES, PACKET, Packet, Rays, VECTORS, part, split};
use super::traverse::{Query, Stack, slab_time, walk};
use super::traverse_packet::{Queries, Room, walk_packet};
use super::world::{MOVERS, Numbered, TopTree, World, clamp_time};
use super::{Hit, Ray, TraceCounts};
use crate::bvh::{Bounds8, ObjectGeometry, Tree};

thread_local! {
    /// The stack of this thread, kept between rays; taken while in use.
    static STACK: Cell<Stack> = const { Cell::new(Vec::new()) };
    /// The same for packets.
    static ROOM: Cell<Option<Box<Room>>> = const { Cell::new(None) };
}

impl World {
    /// The nearest hit between `t_min` and `t_max`, both inclusive. A ray with a number that is NaN, that
    /// starts nowhere finite, has no finite direction, or is absurdly long or far misses; time is clamped to [0, 1].
    /// Where many surfaces coincide, each has to be asked which is nearest: time is linear in their number.
    pub fn trace(&self, ray: &Ray, counts: &mut TraceCounts) -> Hit {
        self.next::<false>(ray, None, counts)
    }

    /// The next hit after `after` on the same ray, in the order of hits: also where surfaces
    /// coincide. `t_min` and `t_max` count as for [`World::trace`]. A ray that meets an edge which two
    /// cells share hits both.
    pub fn trace_after(&self, ray: &Ray, after: &Hit, counts: &mut TraceCounts) -> Hit {
        self.next::<false>(ray, Some(after), counts)
    }

    /// [`World::trace`], or with `after` [`World::trace_after`]. With `CULL`, rays pass through the sides
    /// that sets have culled, as if these were not there.
    pub fn next<const CULL: bool>(
        &self,
        ray: &Ray,
        after: Option<&Hit>,
        counts: &mut TraceCounts,
    ) -> Hit {
        if after.is_some_and(|after| !after.is_hit()) {
            return Hit::MISS;
        }
        self.ask::<CULL>(ray, after.copied(), false, counts)
    }

    /// True when anything is hit between `t_min` and `t_max`.
    pub fn occluded(&self, ray: &Ray, counts: &mut TraceCounts) -> bool {
        self.ask::<false>(ray, None, true, counts).is_hit()
    }

    fn ask<const CULL: bool>(
        &self,
        ray: &Ray,
        after: Option<Hit>,
        any: bool,
        counts: &mut TraceCounts,
    ) -> Hit {
        with_stack(|stack| {
            self.level.run(One::<'_, CULL> {
                world: self,
                ray,
                after,
                any,
                stack,
                counts,
            })
        })
    }

    /// [`World::trace`] for many rays, best near each other in space and time; each answer is the
    /// same as alone. Traces the first `min(rays.len(), hits.len())`.
    pub fn trace_many(&self, rays: &[Ray], hits: &mut [Hit], counts: &mut TraceCounts) {
        let mut own = [TraceCounts::default(); PACKET];
        for (rays, hits) in rays.chunks(PACKET).zip(hits.chunks_mut(PACKET)) {
            let count = rays.len().min(hits.len());
            let own = &mut own[..count];
            self.trace_packet(&rays[..count], &mut hits[..count], own);
            for own in own {
                *counts = *counts + *own;
            }
        }
    }

    /// [`World::occluded`] for many rays, best near each other in space and time. Asks the first
    /// `min(rays.len(), found.len())`.
    pub fn occluded_many(&self, rays: &[Ray], found: &mut [bool], counts: &mut TraceCounts) {
        let mut own = [TraceCounts::default(); PACKET];
        let mut hits = [Hit::MISS; PACKET];
        for (rays, found) in rays.chunks(PACKET).zip(found.chunks_mut(PACKET)) {
            let count = rays.len().min(found.len());
            let (own, hits) = (&mut own[..count], &mut hits[..count]);
            self.ask_packet(&rays[..count], true, hits, own);
            for ((found, hit), own) in found.iter_mut().zip(hits).zip(own) {
                *found = hit.is_hit();
                *counts = *counts + *own;
            }
        }
    }

    /// [`World::trace_many`] for up to [`PACKET`] rays, which tells what each of them cost.
    ///
    /// # Panics
    /// The slices have different lengths, or more elements.
    pub fn trace_packet(&self, rays: &[Ray], hits: &mut [Hit], counts: &mut [TraceCounts]) {
        assert!(rays.len() <= PACKET && rays.len() == hits.len() && rays.len() == counts.len());
        self.ask_packet(rays, false, hits, counts);
    }

    /// Slices are of one length, at most [`PACKET`].
    fn ask_packet(&self, rays: &[Ray], any: bool, hits: &mut [Hit], counts: &mut [TraceCounts]) {
        let level = self.level;
        ROOM.with(|cell| {
            let mut room = cell.take().unwrap_or_default();
            level.run(Many {
                world: self,
                rays,
                any,
                hits,
                counts,
                room: &mut room,
            });
            cell.set(Some(room));
        });
    }

    #[inline(always)]
    fn query_packet<S: Simd>(&self, simd: S, asked: Many<'_>) {
        let Many {
            rays,
            any,
            hits,
            counts,
            room,
            ..
        } = asked;
        let mut queries = Queries::NONE;
        queries.any = any;
        let mut packed = [Rays::NONE; VECTORS];
        let mut lanes = 0;
        for (i, ray) in rays.iter().enumerate().take(PACKET) {
            let (v, lane) = split(i);
            // Written so that NaN is left out.
            if ray.t_min <= ray.t_max && !ray.time.is_nan() {
                lanes |= 1 << i;
                queries.best[i].t = ray.t_max;
                queries.t_min[v][lane] = ray.t_min;
                queries.t_max[v][lane] = ray.t_max;
            }
            for axis in 0..3 {
                packed[v].origin[axis][lane] = ray.origin[axis];
                packed[v].dir[axis][lane] = ray.dir[axis];
            }
            packed[v].time[lane] = clamp_time(ray.time);
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
        for (i, (hit, counts)) in hits.iter_mut().zip(counts).enumerate().take(PACKET) {
            let (v, lane) = split(i);
            let best = &queries.best[i];
            *hit = if best.is_hit() { *best } else { Hit::MISS };
            *counts = TraceCounts {
                rays: 1,
                node_tests: queries.nodes[v][lane] as u64,
                cell_tests: queries.cells[v][lane] as u64,
            };
        }
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
        let packet = Packet::new::<MOVING>(simd, rays, lanes, 0.0, Some(&pads));
        walk_packet(
            simd,
            tree,
            &packet,
            queries,
            room,
            #[inline(always)]
            |item, lanes, queries, room| {
                if !B::MOVING && item == MOVERS {
                    late.extend(self.level.run(MoversMany {
                        world: self,
                        rays,
                        lanes,
                        queries,
                        room,
                    }));
                    return;
                }
                match self.find(item).0.set.made() {
                    Some(object) => {
                        self.inside_packet(simd, object, item, rays, lanes, queries, room);
                    }
                    None => late.push(Late { item, lanes }),
                }
            },
        );
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
        let mut local = [Rays::NONE; VECTORS];
        for (v, (local, rays)) in local.iter_mut().zip(rays).enumerate() {
            let lanes = part(lanes, v);
            if lanes != 0 {
                *local = set.to_object16(simd, i, rays, lanes, self.origin);
            }
        }
        self.level.run(InsideMany {
            object,
            instance: item,
            rays: &local[..rays.len().min(VECTORS)],
            lanes,
            queries,
            room,
        });
    }

    #[inline(always)]
    fn query<S: Simd, const CULL: bool>(
        &self,
        simd: S,
        ray: &Ray,
        after: Option<Hit>,
        any: bool,
        stack: &mut Stack,
        counts: &mut TraceCounts,
    ) -> Hit {
        counts.rays += 1;
        let mut query = Query {
            t_min: after.map_or(ray.t_min, |a| ray.t_min.max(a.t)),
            best: Hit {
                t: ray.t_max,
                ..Hit::MISS
            },
            after,
            any,
        };
        // Written so that NaN is left out.
        let sound = query.t_min <= ray.t_max && !ray.time.is_nan();
        if !sound {
            return Hit::MISS;
        }
        stack.clear();
        let late = match &self.tops().top {
            TopTree::Static(tree) => {
                self.query_top::<_, _, CULL>(simd, tree, ray, &mut query, stack, counts)
            }
            TopTree::Moving(tree) => {
                self.query_top::<_, _, CULL>(simd, tree, ray, &mut query, stack, counts)
            }
        };
        if !late.is_empty() {
            self.finish::<CULL>(late, ray, &mut query, stack, counts);
        }
        query.answer()
    }

    /// Gives the instances that the ray came to, and whose objects are not made.
    #[inline(always)]
    pub(super) fn query_top<S: Simd, B: Bounds8, const CULL: bool>(
        &self,
        simd: S,
        tree: &Tree<B>,
        ray: &Ray,
        query: &mut Query,
        stack: &mut Stack,
        counts: &mut TraceCounts,
    ) -> Vec<Late> {
        let mut late = Vec::new();
        let time = clamp_time(ray.time);
        let pad = self.pad(ray.origin);
        let Some(world_ray) = ObjectRay::padded(ray.origin, ray.dir, slab_time::<B>(time), pad)
        else {
            return late;
        };
        walk(
            simd,
            tree,
            tree.root,
            &world_ray,
            query,
            stack,
            counts,
            #[inline(always)]
            |item, query, stack, counts| {
                if !B::MOVING && item == MOVERS {
                    late.extend(self.level.run(Movers::<'_, CULL> {
                        world: self,
                        ray,
                        query,
                        stack,
                        counts,
                    }));
                    return;
                }
                match self.find(item).0.set.made() {
                    Some(object) => {
                        self.inside::<CULL>(object, item, ray, time, query, stack, counts);
                    }
                    None => late.push(Late { item, lanes: 1 }),
                }
            },
        );
        late
    }

    /// Traces a ray through an instance of `object`.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)] // inlined
    pub(super) fn inside<const CULL: bool>(
        &self,
        object: &ObjectGeometry,
        instance: u32,
        ray: &Ray,
        time: f32,
        query: &mut Query,
        stack: &mut Stack,
        counts: &mut TraceCounts,
    ) {
        let (Numbered { set, culled, .. }, i) = self.find(instance);
        let (origin, dir) = set.to_object(i, ray.origin, ray.dir, time, self.origin);
        let hidden = match culled {
            Some(culled) if CULL => Some(culled.of_lattices(time)),
            _ => None,
        };
        self.level.run(Inside::<'_, CULL> {
            object,
            instance,
            hidden,
            ray: (origin, dir, time),
            query,
            stack,
            counts,
        });
    }

    /// What slab tests of the tree over instances are padded by, for a ray from here.
    #[inline(always)]
    fn pad(&self, origin: Vec3) -> f32 {
        let reach = origin.abs().max_element();
        let worst = if reach > self.radius {
            self.condition
        } else {
            NEAR_CONDITION
        };
        SLAB_PAD * (reach + self.radius) + INSTANCE_PAD * worst * reach
    }
}

/// One query, for any instruction set.
struct One<'a, const CULL: bool> {
    world: &'a World,
    ray: &'a Ray,
    after: Option<Hit>,
    any: bool,
    stack: &'a mut Stack,
    counts: &'a mut TraceCounts,
}

/// A packet of queries, for any instruction set.
struct Many<'a> {
    world: &'a World,
    rays: &'a [Ray],
    any: bool,
    hits: &'a mut [Hit],
    counts: &'a mut [TraceCounts],
    room: &'a mut Room,
}

impl Kernel for Many<'_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        self.world.query_packet(simd, self);
    }
}

impl<const CULL: bool> Kernel for One<'_, CULL> {
    type Output = Hit;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Hit {
        let Self { world, ray, .. } = self;
        world.query::<_, CULL>(simd, ray, self.after, self.any, self.stack, self.counts)
    }
}

/// Runs `f` with this thread's stack. Should `f` come here again, it gets a fresh one.
fn with_stack<R>(f: impl FnOnce(&mut Stack) -> R) -> R {
    STACK.with(|cell| {
        let mut stack = cell.take();
        let result = f(&mut stack);
        cell.set(stack);
        result
    })
}
