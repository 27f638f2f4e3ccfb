//! Traversal by packets: a node is fetched, decoded and sorted once for all rays, and what waits for what in
//! one ray's test overlaps with another's.
//!
//! A packet goes where any of its rays goes, with those that do. Every ray meets the same
//! micropolygons as alone, or more; hits are the same.

use hdtrapeze_simd::{Float, Mask, Simd};

use super::beam::{BEAM_RAYS, Beam};
use super::enter::{Entered, enter_packet};
use super::packet::{Form, LANES, Packet, Slabs};
use super::queries::Queries;
use super::room::Room;
use crate::bvh::{Bounds8, Tree};

/// A subtree that waits: where the first ray enters it, reference, and rays.
#[derive(Clone, Copy, Debug)]
pub(super) struct Waiting {
    near: f32,
    at: u32,
    rays: u64,
}

/// What a packet does at the items of a tree.
pub(super) trait Items {
    /// Rays may come to an item soon.
    fn soon(&self, item: u32, rays: u64);
    /// Some rays may hit an item, for which [`Items::soon`] was called unless it is the nearest child. Gives all that wait for
    /// something: none of them goes on before it was told, here or by [`Items::go_on`], that it waits no more.
    fn test(&mut self, item: u32, rays: u64, queries: &mut Queries, room: &mut Room) -> u64;
    /// There is nothing else to do. Gives those that wait still; none, after some calls.
    fn go_on(&mut self, queries: &mut Queries, room: &mut Room) -> u64;
}

/// Walks a tree with a packet; `turned` is room for rays in a node's frame.
#[inline(always)]
pub(super) fn walk_packet<S: Simd, B: Bounds8>(
    simd: S,
    tree: &Tree<B>,
    packet: &Packet<'_, S>,
    turned: &mut Slabs,
    queries: &mut Queries,
    room: &mut Room,
    items: &mut impl Items,
) {
    if tree.root == Tree::<B>::EMPTY || packet.sound == 0 {
        return;
    }
    let mut wait = 0;
    let floor = room.waiting.len();
    let (mut at, mut rays) = (tree.root, packet.sound);
    // The frame that rays were turned into last, and which of them: whole subtrees share one.
    let (mut frame, mut ready) = (0, 0);
    let mut beam: Option<Option<Beam>> = None;
    loop {
        if at & Tree::<B>::LEAF != 0 {
            wait = items.test(at & !Tree::<B>::LEAF, rays, queries, room);
        } else {
            // All of it at once: which children there are is asked when their bounds were tested.
            simd.expect(&tree.nodes, at as usize);
            let node = &tree.nodes[at as usize];
            queries.count_node(simd, rays);
            let slabs = if node.frame == 0 {
                &*packet.slabs
            } else {
                if node.frame != frame || rays & !ready != 0 {
                    (frame, ready) = (node.frame, rays);
                    let frame = &tree.frames[frame as usize];
                    packet.turn(frame, rays, B::MOVING, Form::Both, turned);
                }
                &*turned
            };
            let mut valid = node.valid();
            // Children that all rays are taken to meet: testing them would leave out few.
            let mut all = 0;
            let mut near = [0.0; LANES];
            if node.frame == 0
                && rays.count_ones() >= BEAM_RAYS
                && let Some(beam) = beam.get_or_insert_with(
                    #[inline(always)]
                    || Beam::new(simd, packet, tree, &queries.t_min),
                )
            {
                let touched = beam.touched(simd, &node.bounds, valid);
                valid = touched.children;
                let child = node.children[valid.trailing_zeros() as usize & 7];
                if valid.is_power_of_two() && child & Tree::<B>::LEAF == 0 {
                    at = child;
                    continue;
                }
                near = touched.near;
                let mut wide = touched.wide;
                while wide != 0 {
                    let slot = wide.trailing_zeros() as usize & 7;
                    wide &= wide - 1;
                    all |= u32::from(node.children[slot] & Tree::<B>::LEAF == 0) << slot;
                }
            }
            if valid != 0 {
                let mut found = Entered::NONE;
                if valid != all {
                    let spans = queries.spans();
                    found = enter_packet(simd, &node.bounds, valid & !all, slabs, rays, spans);
                }
                if all != 0 {
                    found.enter_all(all, rays, &near);
                }
                if found.children != 0 {
                    // The nearest child is next; the others wait, nearer ones on top.
                    let (slots, count) = found.by_distance(simd);
                    for &slot in slots[1..count].iter().rev() {
                        let child = node.children[slot];
                        if child & Tree::<B>::LEAF != 0 {
                            items.soon(child & !Tree::<B>::LEAF, found.rays[slot]);
                        } else {
                            simd.expect(&tree.nodes, child as usize);
                        }
                        room.waiting.push(Waiting {
                            near: found.near(slot),
                            at: node.children[slot],
                            rays: found.rays[slot],
                        });
                    }
                    (at, rays) = (node.children[slots[0]], found.rays[slots[0]]);
                    continue;
                }
            }
        }
        // Next subtree that does not start behind the best hits.
        loop {
            let next = loop {
                if let Some(next) = next_but(&mut room.waiting, floor, wait) {
                    break next;
                }
                if wait == 0 {
                    return;
                }
                wait = items.go_on(queries, room);
            };
            let near = simd.all16(next.near);
            let mut left = 0;
            for (v, t_max) in queries.t_max.iter().enumerate() {
                let reach = near.le(simd.from16(t_max)).bits();
                left |= u64::from(reach) << (LANES * v);
            }
            left &= next.rays;
            if left != 0 {
                (at, rays) = (next.at, left);
                break;
            }
        }
    }
}

/// As many subtrees are looked at for one that rays can go on with.
const LOOK: usize = 4;

/// Takes what is next for some rays, of which none are among those that `wait`; if none do, the last there is above `floor`, or nothing
/// where the tree is done. Where some wait, nothing may also say that it is not among the [`LOOK`] that were looked at.
#[inline(always)]
fn next_but(waiting: &mut Vec<Waiting>, floor: usize, wait: u64) -> Option<Waiting> {
    if wait == 0 {
        return if waiting.len() > floor {
            waiting.pop()
        } else {
            None
        };
    }
    let count = waiting.len();
    // Those that are here no more, since something else is before it.
    let mut taken = wait;
    for at in (floor..count).rev().take(LOOK) {
        let next = waiting[at];
        if next.rays & taken == 0 {
            waiting.copy_within(at + 1.., at);
            waiting.truncate(count - 1);
            return Some(next);
        }
        taken |= next.rays;
    }
    None
}
