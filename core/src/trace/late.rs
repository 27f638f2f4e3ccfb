//! Objects that are not made yet when rays come to their bounds wait until the rays have been to all others:
//! what these hide of them need not be made. Then they are asked again, nearest first.

use std::cmp::Ordering;

use hdtrapeze_simd::Simd;

use super::Ray;
use super::TraceCounts;
use super::packet::{PACKET, Rays, split};
use super::queries::Queries;
use super::room::Room;
use super::traverse::{Query, Stack};
use super::world::{Numbered, World, clamp_time};

/// An instance whose object is not made, and the rays that came to it.
pub(super) struct Late {
    pub item: u32,
    pub lanes: u64,
}

/// Distances in their order.
#[derive(PartialEq)]
struct Distance(f64);

impl Eq for Distance {}

impl PartialOrd for Distance {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Distance {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl World {
    /// Makes those objects that the ray may still hit, and traces it through them.
    #[cold]
    #[inline(never)]
    pub(super) fn finish<const CULL: bool>(
        &self,
        mut late: Vec<Late>,
        ray: &Ray,
        query: &mut Query,
        stack: &mut Stack,
        counts: &mut TraceCounts,
    ) {
        let time = clamp_time(ray.time);
        let entry = |item: u32, query: &Query| {
            let (Numbered { set, .. }, i) = self.find(item);
            let (origin, dir) = set.to_object(i, ray.origin, ray.dir, time, self.origin);
            set.entry(origin, dir, time, [query.t_min, query.best.t])
        };
        late.sort_by_cached_key(|late| Distance(entry(late.item, query).unwrap_or(f64::INFINITY)));
        for Late { item, .. } in late {
            if !query.done() && entry(item, query).is_some() {
                let object = self.find(item).0.set.object();
                self.inside::<CULL>(object, item, ray, time, query, stack, counts);
            }
        }
    }

    /// [`Self::finish`] for a packet.
    #[cold]
    #[inline(never)]
    pub(super) fn finish_packet<S: Simd>(
        &self,
        simd: S,
        mut late: Vec<Late>,
        rays: &[Rays],
        queries: &mut Queries,
        room: &mut Room,
    ) {
        // Rays that may still hit, and where the first of them enters.
        let entering = |late: &Late, queries: &Queries| {
            let (Numbered { set, .. }, i) = self.find(late.item);
            let (mut lanes, mut first) = (0, f64::INFINITY);
            for ray in (0..PACKET).filter(|ray| late.lanes >> ray & 1 == 1) {
                let (v, lane) = split(ray);
                let (origin, dir) = (rays[v].origin_of(lane), rays[v].dir_of(lane));
                let time = rays[v].time[lane];
                let (origin, dir) = set.to_object(i, origin, dir, time, self.origin);
                let between = [queries.ranges[v][lane][0], queries.t_max[v][lane]];
                if let Some(near) = set.entry(origin, dir, time, between) {
                    lanes |= 1 << ray;
                    first = first.min(near);
                }
            }
            (lanes, first)
        };
        late.sort_by_cached_key(|late| Distance(entering(late, queries).1));
        for late in late {
            let (lanes, _) = entering(&late, queries);
            if lanes != 0 {
                let object = self.find(late.item).0.set.object();
                self.inside_packet(simd, object, late.item, rays, lanes, queries, room);
            }
        }
    }
}
