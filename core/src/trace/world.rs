//! The world: instances of objects under one tree, and the queries that a renderer asks of it.

use std::cell::Cell;
use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use super::instance::{INSTANCE_PAD, InstanceTransform, Place, Placed};
use super::object_ray::{ObjectRay, SLAB_PAD};
use super::traverse::{Query, Stack, trace_object, walk};
use super::{Hit, Ray, TraceCounts};
use crate::bvh::object::Blas;
use crate::bvh::{Bounds8, BvhStats, LinearSlabs, ObjectGeometry, StaticSlabs, Tree, build};

/// One appearance of an object.
#[derive(Clone, Debug)]
pub struct WorldInstance {
    /// What appears.
    pub object: Arc<ObjectGeometry>,
    /// Where.
    pub transform: InstanceTransform,
    /// Any number of the caller's.
    pub user: u32,
}

/// An instance as traced.
#[derive(Clone, Debug)]
pub(super) struct Instance {
    pub object: Arc<ObjectGeometry>,
    pub place: Place,
    pub user: u32,
}

#[derive(Clone, Debug)]
enum TopTree {
    Static(Tree<StaticSlabs>),
    Moving(Tree<LinearSlabs>),
}

/// Everything rays can hit.
#[derive(Clone, Debug)]
pub struct World {
    pub(super) instances: Vec<Instance>,
    top: TopTree,
    origin: DVec3,
    /// Bounds every instance's bounds, translation, and `|M| radius`.
    radius: f32,
    /// Pad of the top tree per unit of `|origin| + radius`, for rays that start beyond the radius.
    far_pad: f32,
    /// Instances that cannot be hit.
    left_out: u64,
}

/// Numbers about a world.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WorldStats {
    /// Instances, as given.
    pub instances: u64,
    /// Instances that cannot be hit: the object is empty, or the transform not finite or singular.
    pub left_out: u64,
    /// Different objects.
    pub objects: u64,
    /// Objects' trees together; `cells` counts each object once.
    pub object: BvhStats,
    /// Nodes of the tree over instances.
    pub top_nodes: u64,
    /// Bytes of the tree over instances, and of their transforms.
    pub top_bytes: u64,
    /// Micropolygons with each instance counted.
    pub instanced_cells: u64,
}

thread_local! {
    /// The stack of this thread, kept between rays; taken while in use.
    static STACK: Cell<Stack> = const { Cell::new(Vec::new()) };
}

impl World {
    /// Builds the tree over instances, in parallel. Rays and answers are relative to `world_origin`,
    /// which is best near the camera. Instance numbers of hits are positions in `instances`.
    pub fn build(instances: Vec<WorldInstance>, world_origin: DVec3) -> World {
        let placed: Vec<Placed> = instances
            .par_iter()
            .with_min_len(256)
            .map(|i| Placed::new(&i.object, &i.transform, world_origin))
            .collect();
        let radius = placed.iter().fold(0.0f32, |r, p| r.max(p.reach));
        let condition = placed.iter().fold(1.0f32, |c, p| c.max(p.condition));
        let boxes: Vec<_> = placed
            .par_iter()
            .enumerate()
            .filter(|(_, p)| !matches!(p.place, Place::Nowhere))
            .map(|(i, p)| {
                // For rays that start inside the radius: `|origin| + R <= 2 R`.
                let pad = INSTANCE_PAD * p.condition * 2.0 * radius;
                (i as u32, p.bounds.widen(pad))
            })
            .collect();
        let left_out = (placed.len() - boxes.len()) as u64;
        let top = if boxes.iter().all(|(_, b)| b.is_static()) {
            TopTree::Static(build::build(boxes))
        } else {
            TopTree::Moving(build::build(boxes))
        };
        let instances = instances
            .into_iter()
            .zip(placed)
            .map(|(i, p)| Instance {
                object: i.object,
                place: p.place,
                user: i.user,
            })
            .collect();
        World {
            instances,
            top,
            origin: world_origin,
            // The widened boxes are what slabs are stored from.
            radius: radius * (1.0 + 4.0 * INSTANCE_PAD * condition),
            far_pad: SLAB_PAD + INSTANCE_PAD * condition,
            left_out,
        }
    }

    /// Bounds the magnitude of every coordinate of every instance, translations and `|M| radius`
    /// included: with a ray's origin, the scale that rounding is measured by.
    pub fn radius(&self) -> f32 {
        self.radius
    }

    /// What rays are relative to, in absolute world space.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Number of instances.
    pub fn instance_count(&self) -> usize {
        self.instances.len()
    }

    /// The nearest hit between `t_min` and `t_max`, both inclusive. A ray that is not finite, has no
    /// direction, or is absurdly long or far misses; time is clamped to [0, 1], NaN counting as 0.
    pub fn trace(&self, ray: &Ray, counts: &mut TraceCounts) -> Hit {
        with_stack(|stack| self.query(ray, None, false, stack, counts))
    }

    /// The next hit after `after` on the same ray, in the order of hits: also where surfaces
    /// coincide. `t_min` and `t_max` count as for [`World::trace`]. A ray that meets an edge which two
    /// cells share hits both.
    pub fn trace_after(&self, ray: &Ray, after: &Hit, counts: &mut TraceCounts) -> Hit {
        if !after.is_hit() {
            return Hit::MISS;
        }
        with_stack(|stack| self.query(ray, Some(*after), false, stack, counts))
    }

    /// True when anything is hit between `t_min` and `t_max`.
    pub fn occluded(&self, ray: &Ray, counts: &mut TraceCounts) -> bool {
        with_stack(|stack| self.query(ray, None, true, stack, counts)).is_hit()
    }

    /// [`World::trace`] for many rays, best near each other in space and time; each answer is the
    /// same as alone. Traces the first `min(rays.len(), hits.len())`.
    pub fn trace_many(&self, rays: &[Ray], hits: &mut [Hit], counts: &mut TraceCounts) {
        with_stack(|stack| {
            for (ray, hit) in rays.iter().zip(hits) {
                *hit = self.query(ray, None, false, stack, counts);
            }
        });
    }

    fn query(
        &self,
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
        if query.t_min > ray.t_max || query.t_min.is_nan() || ray.t_max.is_nan() {
            return Hit::MISS;
        }
        match &self.top {
            TopTree::Static(tree) => self.query_top(tree, ray, &mut query, stack, counts),
            TopTree::Moving(tree) => self.query_top(tree, ray, &mut query, stack, counts),
        }
        query.answer()
    }

    #[inline(always)]
    fn query_top<B: Bounds8>(
        &self,
        tree: &Tree<B>,
        ray: &Ray,
        query: &mut Query,
        stack: &mut Stack,
        counts: &mut TraceCounts,
    ) {
        let time = clamp_time(ray.time);
        let far = ray.origin.abs().max_element() > self.radius;
        let pad = if far { self.far_pad } else { SLAB_PAD };
        let Some(world_ray) = ObjectRay::new(ray.origin, ray.dir, time, self.radius, pad) else {
            return;
        };
        stack.clear();
        walk(
            tree,
            &world_ray,
            query,
            stack,
            counts,
            |item, query, stack, counts| {
                let instance = &self.instances[item as usize];
                let Some((origin, dir)) = instance.place.to_object(ray.origin, ray.dir, time)
                else {
                    return;
                };
                let object = &*instance.object;
                let Some(ray) = ObjectRay::new(origin, dir, time, object.radius(), SLAB_PAD) else {
                    return;
                };
                let mesh = object.mesh();
                match object.blas() {
                    Blas::Static(blocks) => {
                        trace_object(blocks, mesh, item, &ray, query, stack, counts);
                    }
                    Blas::Moving(blocks) => {
                        trace_object(blocks, mesh, item, &ray, query, stack, counts);
                    }
                }
            },
        );
    }

    /// Numbers about the world; walks all instances.
    pub fn stats(&self) -> WorldStats {
        let mut objects: Vec<&Arc<ObjectGeometry>> =
            self.instances.iter().map(|i| &i.object).collect();
        objects.sort_unstable_by_key(|o| Arc::as_ptr(o));
        objects.dedup_by_key(|o| Arc::as_ptr(o));
        let (top_nodes, tree_bytes) = match &self.top {
            TopTree::Static(t) => (t.nodes.len(), t.bytes()),
            TopTree::Moving(t) => (t.nodes.len(), t.bytes()),
        };
        let places: usize = self.instances.iter().map(|i| i.place.heap_bytes()).sum();
        WorldStats {
            instances: self.instances.len() as u64,
            left_out: self.left_out,
            objects: objects.len() as u64,
            object: objects
                .iter()
                .fold(BvhStats::default(), |s, o| s.plus(o.stats())),
            top_nodes: top_nodes as u64,
            top_bytes: (tree_bytes + places + size_of_val(self.instances.as_slice())) as u64,
            instanced_cells: self.instances.iter().map(|i| i.object.stats().cells).sum(),
        }
    }
}

/// Time in [0, 1]; NaN becomes 0.
#[inline]
pub(super) fn clamp_time(time: f32) -> f32 {
    if time.is_nan() {
        0.0
    } else {
        time.clamp(0.0, 1.0)
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
