//! Rays in the space of an object, one by one or in packets: the way to its tree, or to the one of several that knows
//! of a ray.

use glam::Vec3;
use hdtrapeze_simd::{Kernel, Part, Simd};

use super::TraceCounts;
use super::in_tree::InTree;
use super::object_ray::ObjectRay;
use super::packet::Rays;
use super::queries::Queries;
use super::relative::{RelativeMany, Seen};
use super::room::Room;
use super::sides::Side;
use super::traverse::{Query, Stack, Target};
use crate::bvh::object::Blas;
use crate::bvh::{CarriedSlabs, ObjectGeometry};

/// One ray in the space of an object.
pub(super) struct Inside<'a, const CULL: bool> {
    pub object: &'a ObjectGeometry,
    pub instance: u32,
    pub hidden: Option<Side>,
    /// Origin, direction and time.
    pub ray: (Vec3, Vec3, f32),
    pub query: &'a mut Query,
    pub stack: &'a mut Stack,
    pub counts: &'a mut TraceCounts,
}

impl<const CULL: bool> Kernel for Inside<'_, CULL> {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self {
            object,
            instance,
            hidden,
            ray,
            query,
            stack,
            counts,
        } = self;
        let seen;
        let (blocks, seen) = match object.blas() {
            Blas::Static(blocks) => {
                return Target::<_, _, CULL>::new(simd, blocks, object, instance, hidden)
                    .enter(ray, None, query, stack, counts);
            }
            Blas::Moving(blocks) => (blocks, None),
            Blas::Relative(relative) => match relative.see(object, ray) {
                Some(Seen::Moving(blocks, as_seen)) => {
                    seen = as_seen;
                    (blocks, Some(&seen))
                }
                Some(Seen::Still(blocks, seen)) => {
                    return simd.apart(InStill::<'_, S, CULL> {
                        target: Target::new(simd, blocks, object, instance, hidden),
                        ray,
                        seen: &seen,
                        query,
                        stack,
                        counts,
                    });
                }
                None => return,
            },
        };
        Target::<_, _, CULL>::new(simd, blocks, object, instance, hidden)
            .enter(ray, seen, query, stack, counts);
    }
}

/// One ray in the space of an object that stands still in a space that moves along.
struct InStill<'a, S, const CULL: bool> {
    target: Target<'a, S, CarriedSlabs, CULL>,
    ray: (Vec3, Vec3, f32),
    seen: &'a ObjectRay,
    query: &'a mut Query,
    stack: &'a mut Stack,
    counts: &'a mut TraceCounts,
}

impl<S: Simd, const CULL: bool> Part<S> for InStill<'_, S, CULL> {
    type Output = ();
    #[inline(always)]
    fn run(self, _: S) {
        self.target.enter(
            self.ray,
            Some(self.seen),
            self.query,
            self.stack,
            self.counts,
        );
    }
}

/// A packet in the space of an object.
pub(super) struct InsideMany<'a> {
    pub object: &'a ObjectGeometry,
    pub instance: u32,
    pub rays: &'a [Rays],
    pub lanes: u64,
    /// Rays have little in common.
    pub scattered: bool,
    pub queries: &'a mut Queries,
    pub room: &'a mut Room,
}

impl Kernel for InsideMany<'_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self {
            object,
            instance,
            rays,
            lanes,
            scattered,
            queries,
            room,
        } = self;
        match object.blas() {
            Blas::Static(blocks) => simd.apart(InTree {
                blocks,
                object,
                instance,
                rays,
                lanes,
                scattered,
                seen: None,
                queries,
                room,
            }),
            Blas::Moving(blocks) => simd.apart(InTree {
                blocks,
                object,
                instance,
                rays,
                lanes,
                scattered,
                seen: None,
                queries,
                room,
            }),
            Blas::Relative(relative) => simd.apart(RelativeMany {
                relative,
                object,
                instance,
                rays,
                lanes,
                scattered,
                queries,
                room,
            }),
        }
    }
}
