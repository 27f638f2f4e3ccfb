//! Camera rays by where they meet surfaces: ours finds the order while it is timed, Embree is given it.

use std::ops::Range;

use hdtrapeze_core::trace::packet::PACKET;
use hdtrapeze_core::trace::surface_order::{Usual, by_surface};
use hdtrapeze_core::trace::{Hit, Ray, TraceCounts, World};
use rayon::prelude::*;

/// Rays of a square of pixels, among which an order is found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    /// Among all rays.
    pub rays: Range<usize>,
    /// Of each block of pixels, from the group's first on.
    pub blocks: Vec<Range<usize>>,
}

impl Group {
    /// The order of its rays, where one is found, by their numbers in the group. What it costs is added to `counts`.
    fn order(&self, world: &World, rays: &[Ray], counts: &mut TraceCounts) -> Option<Vec<u32>> {
        // By strata, and so by time, already.
        let usual = Usual {
            blocks: &self.blocks,
            by_time: false,
        };
        by_surface(world, |i| &rays[i], usual, counts)
    }
}

/// Splits what belongs to all rays by group.
fn split<'a, T>(groups: &[Group], mut rest: &'a mut [T]) -> Vec<&'a mut [T]> {
    let mut parts = Vec::with_capacity(groups.len());
    for group in groups {
        let (part, others) = rest.split_at_mut(group.rays.len());
        parts.push(part);
        rest = others;
    }
    parts
}

/// Our hits, on all threads: finds an order in each group, and traces its rays in that.
pub fn trace(world: &World, rays: &[Ray], groups: &[Group], hits: &mut [Hit]) {
    let each = groups.par_iter().zip(split(groups, hits));
    each.for_each(|(group, hits)| {
        let rays = &rays[group.rays.clone()];
        let mut counts = TraceCounts::default();
        let Some(order) = group.order(world, rays, &mut counts) else {
            world.trace_many(rays, hits, &mut counts);
            return;
        };
        let Some(&any) = rays.first() else { return };
        let (mut packet, mut found) = ([any; PACKET], [Hit::MISS; PACKET]);
        for order in order.chunks(PACKET) {
            for (ray, &i) in packet.iter_mut().zip(order) {
                *ray = rays[i as usize];
            }
            let count = order.len();
            world.trace_many(&packet[..count], &mut found[..count], &mut counts);
            for (hit, &i) in found.iter().zip(order) {
                hits[i as usize] = *hit;
            }
        }
    });
}

/// Numbers of all rays in that order.
pub fn order(world: &World, rays: &[Ray], groups: &[Group]) -> Vec<u32> {
    let each = groups.par_iter().map(|group| {
        let own = &rays[group.rays.clone()];
        let order = group.order(world, own, &mut TraceCounts::default());
        let order = order.unwrap_or_else(|| (0..own.len() as u32).collect());
        let first = group.rays.start as u32;
        order.into_iter().map(|i| first + i).collect::<Vec<_>>()
    });
    each.collect::<Vec<_>>().concat()
}
