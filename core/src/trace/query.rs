//! Queries: rays through the tree over instances, and from there through objects, one by one or sixteen
//! at a time.
//!
//! Everything is written for any instruction set. The trees of objects are kernels of their own, so that
//! each is compiled once for a set, whatever tree stands above it.

use std::cell::Cell;

use glam::Vec3;
use hdtrapeze_simd::{Kernel, Simd};

use super::instance::{INSTANCE_PAD, NEAR_CONDITION};
use super::object_ray::{ObjectRay, SLAB_PAD};
use super::packet::{LANES, Packet, Rays};
use super::sides::Side;
use super::traverse::{Query, Stack, Target, slab_time, walk};
use super::traverse16::{Queries, Stack16, walk16};
use super::world::{Numbered, TopTree, World, clamp_time};
use super::{Hit, Ray, TraceCounts};
use crate::bvh::object::Blas;
use crate::bvh::{Bounds8, ObjectGeometry, Tree};

thread_local! {
    /// The stack of this thread, kept between rays; taken while in use.
    static STACK: Cell<Stack> = const { Cell::new(Vec::new()) };
    /// The same for packets.
    static STACKS: Cell<(Stack16, Stack)> = const { Cell::new((Vec::new(), Vec::new())) };
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
        let mut own = [TraceCounts::default(); LANES];
        for (rays, hits) in rays.chunks(LANES).zip(hits.chunks_mut(LANES)) {
            let count = rays.len().min(hits.len());
            let own = &mut own[..count];
            own.fill(TraceCounts::default());
            self.trace_packet(&rays[..count], &mut hits[..count], own);
            for own in own {
                *counts = *counts + *own;
            }
        }
    }

    /// [`World::trace_many`] for up to 16 rays, which tells what each of them cost.
    ///
    /// # Panics
    /// The slices have different lengths, or more than 16 elements.
    pub fn trace_packet(&self, rays: &[Ray], hits: &mut [Hit], counts: &mut [TraceCounts]) {
        assert!(rays.len() <= LANES && rays.len() == hits.len() && rays.len() == counts.len());
        let level = self.level;
        STACKS.with(|cell| {
            let mut stacks = cell.take();
            level.run(Sixteen {
                world: self,
                rays,
                hits,
                counts,
                stacks: &mut stacks,
            });
            cell.set(stacks);
        });
    }

    #[inline(always)]
    fn query16<S: Simd>(&self, simd: S, asked: Sixteen<'_>) {
        let Sixteen {
            rays,
            hits,
            counts,
            stacks,
            ..
        } = asked;
        let mut queries = Queries {
            best: [Hit::MISS; LANES],
            t_min: [f32::INFINITY; LANES],
            t_max: [f32::NEG_INFINITY; LANES],
            nodes: [0.0; LANES],
            cells: [0.0; LANES],
        };
        let mut packed = Rays::NONE;
        let mut lanes = 0;
        for (lane, ray) in rays.iter().enumerate() {
            // Written so that NaN is left out.
            if ray.t_min <= ray.t_max && !ray.time.is_nan() {
                lanes |= 1 << lane;
                queries.best[lane].t = ray.t_max;
                queries.t_min[lane] = ray.t_min;
                queries.t_max[lane] = ray.t_max;
            }
            for axis in 0..3 {
                packed.origin[axis][lane] = ray.origin[axis];
                packed.dir[axis][lane] = ray.dir[axis];
            }
            packed.time[lane] = clamp_time(ray.time);
        }
        match &self.top {
            TopTree::Static(tree) => {
                self.top16::<S, _, false>(simd, tree, &packed, lanes, &mut queries, stacks);
            }
            TopTree::Moving(tree) => {
                self.top16::<S, _, true>(simd, tree, &packed, lanes, &mut queries, stacks);
            }
        }
        for (lane, (hit, counts)) in hits.iter_mut().zip(counts).enumerate() {
            let best = &queries.best[lane];
            *hit = if best.is_hit() { *best } else { Hit::MISS };
            *counts = TraceCounts {
                rays: 1,
                node_tests: queries.nodes[lane] as u64,
                cell_tests: queries.cells[lane] as u64,
            };
        }
    }

    #[inline(always)]
    fn top16<S: Simd, B: Bounds8, const MOVING: bool>(
        &self,
        simd: S,
        tree: &Tree<B>,
        rays: &Rays,
        lanes: u32,
        queries: &mut Queries,
        (stack16, stack): &mut (Stack16, Stack),
    ) {
        stack16.clear();
        stack.clear();
        // The pads of `query_top`.
        let mut pad = [0.0; LANES];
        for (lane, pad) in pad.iter_mut().enumerate() {
            *pad = self.pad(rays.origin_of(lane));
        }
        let pad = simd.from16(&pad);
        let packet = Packet::new::<MOVING>(simd, rays, lanes, 0.0, Some(pad));
        walk16(
            simd,
            tree,
            &packet,
            queries,
            stack16,
            #[inline(always)]
            |item, lanes, queries, stack16| {
                let (Numbered { set, .. }, i) = self.find(item);
                let local = set.to_object16(simd, i, rays, lanes, self.origin);
                self.level.run(Inside16 {
                    object: set.object(),
                    instance: item,
                    rays: &local,
                    lanes,
                    queries,
                    stacks: (stack16, stack),
                });
            },
            #[inline(always)]
            |root, lanes, queries| {
                let mut rest = lanes;
                while rest != 0 {
                    let lane = rest.trailing_zeros() as usize & (LANES - 1);
                    rest &= rest - 1;
                    let ray = Ray {
                        origin: rays.origin_of(lane),
                        dir: rays.dir_of(lane),
                        time: rays.time[lane],
                        t_min: 0.0,
                        t_max: 0.0,
                    };
                    // The packets' own stack of single rays is the leaves' to use.
                    let mut own = STACK.with(Cell::take);
                    own.clear();
                    queries.alone(
                        lane,
                        #[inline(always)]
                        |query, counts| {
                            self.query_top::<_, _, false>(
                                simd, tree, root, &ray, query, &mut own, counts,
                            );
                        },
                    );
                    STACK.with(|cell| cell.set(own));
                }
            },
        );
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
        match &self.top {
            TopTree::Static(tree) => {
                self.query_top::<_, _, CULL>(simd, tree, tree.root, ray, &mut query, stack, counts);
            }
            TopTree::Moving(tree) => {
                self.query_top::<_, _, CULL>(simd, tree, tree.root, ray, &mut query, stack, counts);
            }
        }
        query.answer()
    }

    #[inline(always)]
    #[allow(clippy::too_many_arguments)] // inlined
    fn query_top<S: Simd, B: Bounds8, const CULL: bool>(
        &self,
        simd: S,
        tree: &Tree<B>,
        root: u32,
        ray: &Ray,
        query: &mut Query,
        stack: &mut Stack,
        counts: &mut TraceCounts,
    ) {
        let time = clamp_time(ray.time);
        let pad = self.pad(ray.origin);
        let Some(world_ray) = ObjectRay::padded(ray.origin, ray.dir, slab_time::<B>(time), pad)
        else {
            return;
        };
        walk(
            simd,
            tree,
            root,
            &world_ray,
            query,
            stack,
            counts,
            #[inline(always)]
            |item, query, stack, counts| {
                let (Numbered { set, culled, .. }, i) = self.find(item);
                let (origin, dir) = set.to_object(i, ray.origin, ray.dir, time, self.origin);
                let hidden = match culled {
                    Some(culled) if CULL => Some(culled.of_lattices(time)),
                    _ => None,
                };
                self.level.run(Inside::<'_, CULL> {
                    object: set.object(),
                    instance: item,
                    hidden,
                    ray: (origin, dir, time),
                    query,
                    stack,
                    counts,
                });
            },
        );
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

/// Up to sixteen queries, for any instruction set.
struct Sixteen<'a> {
    world: &'a World,
    rays: &'a [Ray],
    hits: &'a mut [Hit],
    counts: &'a mut [TraceCounts],
    stacks: &'a mut (Stack16, Stack),
}

impl Kernel for Sixteen<'_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        self.world.query16(simd, self);
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

/// One ray in the space of an object.
struct Inside<'a, const CULL: bool> {
    object: &'a ObjectGeometry,
    instance: u32,
    hidden: Option<Side>,
    /// Origin, direction and time.
    ray: (Vec3, Vec3, f32),
    query: &'a mut Query,
    stack: &'a mut Stack,
    counts: &'a mut TraceCounts,
}

impl<const CULL: bool> Kernel for Inside<'_, CULL> {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self {
            object,
            instance,
            hidden,
            ray: (origin, dir, time),
            query,
            stack,
            counts,
        } = self;
        match object.blas() {
            Blas::Static(blocks) => {
                Target::<_, _, CULL>::new(simd, blocks, object, instance, hidden)
                    .enter(origin, dir, time, query, stack, counts);
            }
            Blas::Moving(blocks) => {
                Target::<_, _, CULL>::new(simd, blocks, object, instance, hidden)
                    .enter(origin, dir, time, query, stack, counts);
            }
        }
    }
}

/// Sixteen rays in the space of an object.
struct Inside16<'a> {
    object: &'a ObjectGeometry,
    instance: u32,
    rays: &'a Rays,
    lanes: u32,
    queries: &'a mut Queries,
    stacks: (&'a mut Stack16, &'a mut Stack),
}

impl Kernel for Inside16<'_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self {
            object,
            instance,
            rays,
            lanes,
            queries,
            stacks: (stack16, stack),
        } = self;
        match object.blas() {
            Blas::Static(blocks) => {
                Target::new(simd, blocks, object, instance, None)
                    .enter16(rays, lanes, queries, stack16, stack);
            }
            Blas::Moving(blocks) => {
                Target::new(simd, blocks, object, instance, None)
                    .enter16(rays, lanes, queries, stack16, stack);
            }
        }
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
