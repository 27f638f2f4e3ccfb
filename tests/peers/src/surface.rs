//! Camera rays by where they meet surfaces: ours finds the order while it is timed, Embree is given it, and so is ours once more.

use std::ops::Range;

use hdtrapeze_core::trace::packet::PACKET;
use hdtrapeze_core::trace::surface_order::{Usual, by_surface, probed};
use hdtrapeze_core::trace::{Hit, Ray, TraceCounts, World};
use rayon::prelude::*;

/// Rays of a square of pixels, among which an order is found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Square {
    /// Among all rays.
    pub rays: Range<usize>,
    /// Of each block of pixels, from the square's first on.
    pub blocks: Vec<Range<usize>>,
}

impl Square {
    /// The order of its rays, where one is found, by their numbers in the square. What it costs is added to `counts`.
    fn order(&self, world: &World, rays: &[Ray], counts: &mut TraceCounts) -> Option<Vec<u32>> {
        // By strata, and so by time, already.
        let usual = Usual {
            blocks: &self.blocks,
            by_time: false,
        };
        let ray = |i: usize| &rays[i];
        let expected = probed(world, rays.len(), ray, counts)?;
        by_surface(world, &expected, ray, usual)
    }
}

/// Splits what belongs to all rays by square.
fn split<'a, T>(squares: &[Square], mut rest: &'a mut [T]) -> Vec<&'a mut [T]> {
    let mut parts = Vec::with_capacity(squares.len());
    for square in squares {
        let (part, others) = rest.split_at_mut(square.rays.len());
        parts.push(part);
        rest = others;
    }
    parts
}

/// Our hits, on all threads: finds an order in each square, and traces its rays in that.
pub fn trace(world: &World, rays: &[Ray], squares: &[Square], hits: &mut [Hit]) {
    let each = squares.par_iter().zip(split(squares, hits));
    // A thread's hits lie where caches have them, as those of a tile do in renders, until they are in the order of rays.
    each.for_each_init(Vec::new, |own, (square, hits)| {
        let rays = &rays[square.rays.clone()];
        let mut counts = TraceCounts::default();
        let Some(order) = square.order(world, rays, &mut counts) else {
            world.trace_many(rays, hits, &mut counts);
            return;
        };
        let Some(&any) = rays.first() else { return };
        own.resize(rays.len(), Hit::MISS);
        let (mut packet, mut found) = ([any; PACKET], [Hit::MISS; PACKET]);
        for order in order.chunks(PACKET) {
            for (ray, &i) in packet.iter_mut().zip(order) {
                *ray = rays[i as usize];
            }
            let count = order.len();
            world.trace_many(&packet[..count], &mut found[..count], &mut counts);
            for (hit, &i) in found.iter().zip(order) {
                own[i as usize] = *hit;
            }
        }
        hits.copy_from_slice(own);
    });
}

/// Numbers of all rays in that order.
pub fn order(world: &World, rays: &[Ray], squares: &[Square]) -> Vec<u32> {
    let each = squares.par_iter().map(|square| {
        let own = &rays[square.rays.clone()];
        let order = square.order(world, own, &mut TraceCounts::default());
        let order = order.unwrap_or_else(|| (0..own.len() as u32).collect());
        let first = square.rays.start as u32;
        order.into_iter().map(|i| first + i).collect::<Vec<_>>()
    });
    each.collect::<Vec<_>>().concat()
}
