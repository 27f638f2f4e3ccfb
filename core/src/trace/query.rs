//! Queries: rays through the tree over instances, and from there through objects, one by one; [`super::query_packet`] has
//! those of packets.
//!
//! Everything is written for any instruction set. The trees of objects are kernels of their own ([`super::inside`]), so that
//! each is compiled once for a set, whatever tree stands above it.

use std::cell::Cell;

use glam::Vec3;
use hdtrapeze_simd::{Kernel, Simd};

use super::inside::Inside;
use super::instance::{INSTANCE_PAD, NEAR_CONDITION};
use super::late::Late;
use super::movers::Movers;
use super::object_ray::{ObjectRay, SLAB_PAD};
use super::traverse::{Query, Stack, slab_time, walk};
use super::world::{MOVERS, Numbered, TopTree, World, clamp_time};
use super::{Hit, Ray, TraceCounts};
use crate::bvh::{Bounds8, ObjectGeometry, Tree};

thread_local! {
    /// The stack of this thread, kept between rays; taken while in use.
    static STACK: Cell<Stack> = const { Cell::new(Vec::new()) };
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
            |_| false,
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
    pub(super) fn pad(&self, origin: Vec3) -> f32 {
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
