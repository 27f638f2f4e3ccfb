//! Instances that move, where they are few: they have a tree of their own, which is one item of the tree over those
//! that do not. See [`super::world::TopTree`].

use hdtrapeze_simd::{Kernel, Simd};

use super::late::Late;
use super::packet::Rays;
use super::queries::Queries;
use super::room::Room;
use super::traverse::{Query, Stack};
use super::world::World;
use super::{Ray, TraceCounts};

/// One query of the instances that move, where they have a tree of their own.
pub(super) struct Movers<'a, const CULL: bool> {
    pub world: &'a World,
    pub ray: &'a Ray,
    pub query: &'a mut Query,
    pub stack: &'a mut Stack,
    pub counts: &'a mut TraceCounts,
}

impl<const CULL: bool> Kernel for Movers<'_, CULL> {
    type Output = Vec<Late>;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Vec<Late> {
        let Self {
            world,
            ray,
            query,
            stack,
            counts,
        } = self;
        world.query_top::<_, _, CULL>(simd, &world.tops().movers, ray, query, stack, counts)
    }
}

/// The same of the rays `lanes` of a packet.
pub(super) struct MoversMany<'a> {
    pub world: &'a World,
    pub rays: &'a [Rays],
    pub lanes: u64,
    pub queries: &'a mut Queries,
    pub room: &'a mut Room,
}

impl Kernel for MoversMany<'_> {
    type Output = Vec<Late>;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Vec<Late> {
        let Self {
            world,
            rays,
            lanes,
            queries,
            room,
        } = self;
        world.top_packet::<S, _, true>(simd, &world.tops().movers, rays, lanes, queries, room)
    }
}
