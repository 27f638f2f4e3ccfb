//! Rays of a packet that have little in common: each goes its own way through a tree, but some take steps in turns.
//!
//! One ray's step is a chain: its node comes from memory, what the ray enters is known a while later, and from that
//! follows the next node. A packet hides this where rays meet the same nodes. Where they do not, several rays take one step
//! each, in loops that are short and do not branch on what is found, so that their chains overlap: the nodes of all are
//! tested, then the diagonals of those that have come to items, then what was entered goes onto each one's stack. Items are handed on
//! when all have taken their step.
//!
//! A ray meets the same micropolygons as alone, or more; hits are the same.

use hdtrapeze_simd::Simd;

use super::packet::{PACKET, Packet, Record, Slabs, split, turn_few};
use super::queries::Queries;
use super::track::Track;
use crate::bvh::{Bounds8, Node, Tree};

/// Rays that take turns.
const TURNS: usize = 16;

/// A bit for each of their tracks.
const ALL: u32 = (1 << TURNS) - 1;

/// Room for rays that take turns.
pub struct Turns([Track; TURNS]);

impl Turns {
    /// The same number everywhere.
    pub const fn filled(x: f32) -> Self {
        Self([Track::filled(x); TURNS])
    }
}

/// Numbers of the tracks whose bits are set.
struct Tracks(u32);

impl Iterator for Tracks {
    type Item = usize;
    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        let number = self.0.trailing_zeros() as usize & (TURNS - 1);
        let some = self.0 != 0;
        self.0 &= self.0.wrapping_sub(1);
        some.then_some(number)
    }
}

/// Most items that all rays may come to in one step.
const ITEMS: usize = 8 * TURNS;

/// Items that rays have come to.
pub(super) struct Reached {
    count: usize,
    items: [u32; ITEMS],
    rays: [u32; ITEMS],
    near: [f32; ITEMS],
}

impl Reached {
    const NONE: Reached = Reached {
        count: 0,
        items: [0; ITEMS],
        rays: [0; ITEMS],
        near: [0.0; ITEMS],
    };

    /// References of items, with [`Tree::LEAF`], the ray that may hit each, and where it enters.
    #[inline(always)]
    pub fn each(&self) -> impl Iterator<Item = (u32, usize, f32)> {
        let items = self.items[..self.count.min(ITEMS)].iter().zip(&self.rays);
        let one = |((&item, &ray), &near)| (item, ray as usize & (PACKET - 1), near);
        items.zip(&self.near).map(one)
    }

    /// Those of 8 children whose bits are set.
    #[inline(always)]
    fn push<S: Simd>(&mut self, simd: S, mask: u32, children: &[u32; 8], track: &Track) {
        let at = self.count;
        let items = self.items.get_mut(at..).and_then(<[u32]>::first_chunk_mut);
        let rays = self.rays.get_mut(at..).and_then(<[u32]>::first_chunk_mut);
        let near = self.near.get_mut(at..).and_then(<[f32]>::first_chunk_mut);
        if let (Some(items), Some(rays), Some(to)) = (items, rays, near) {
            let near = simd.from8(&track.tested.near);
            simd.kept(mask, near, children, to, items);
            *rays = [track.ray as u32; 8];
            self.count += mask.count_ones() as usize;
        } else {
            debug_assert!(false, "there is room for all items of a step");
        }
    }
}

/// Walks a tree, whose items have diagonals or not, with the rays of a packet; `records` and `turned` are room for them.
/// `take(items, queries)` is called after each step, with items and the rays that may hit them, or none, and gives the rays that
/// have found something meanwhile.
/// What it returns are the rays that were not traced to their end.
#[inline(always)]
#[allow(clippy::too_many_arguments)] // one call, inlined
pub(super) fn walk_scattered<S: Simd, B: Bounds8>(
    simd: S,
    (tree, diagonals): (&Tree<B>, bool),
    packet: &Packet<'_, S>,
    (records, turned): (&mut [Record; PACKET], &mut Slabs),
    Turns(tracks): &mut Turns,
    queries: &mut Queries,
    mut take: impl FnMut(&Reached, &mut Queries) -> u64,
) -> u64 {
    if tree.root & Tree::<B>::LEAF != 0 {
        // Nothing to walk: a single item, or none.
        return packet.sound;
    }
    if tree.frames.len() > 1 {
        packet.records(records);
    }
    let mut left_out = 0;
    let mut rest = packet.sound;
    let mut items = Reached::NONE;
    // Tracks without a ray, which the next take, and the track that each ray had.
    let mut idle = ALL;
    let mut track_of = [0u8; PACKET];
    loop {
        while rest != 0 && idle != 0 {
            let number = idle.trailing_zeros() as usize & (TURNS - 1);
            idle &= idle - 1;
            let ray = rest.trailing_zeros() as usize & (PACKET - 1);
            rest &= rest - 1;
            track_of[ray] = number as u8;
            let track = &mut tracks[number];
            track.start(simd, tree.root, ray, packet.slabs, B::MOVING);
            track.look(simd, queries);
        }
        if idle == ALL {
            return left_out;
        }
        queries.counts.node_tests += u64::from((ALL & !idle).count_ones());
        // Nodes, and the tracks that have come to items, and to several subtrees.
        let (mut with_items, mut with_several) = (0, 0);
        if queries.each {
            for number in Tracks(ALL & !idle) {
                let (v, lane) = split(tracks[number].ray);
                queries.nodes[v][lane] += 1.0;
            }
        }
        for number in Tracks(ALL & !idle) {
            let track = &mut tracks[number];
            let node = &tree.nodes[track.at as usize];
            let laid = if node.frame == 0 {
                &track.own
            } else {
                if node.frame != track.frame {
                    track.frame = node.frame;
                    let frame = (&tree.frames[node.frame as usize], packet.bowing);
                    turn_few(simd, frame, 1 << track.ray, B::MOVING, records, turned);
                    track.turned.set(simd, turned, 0, B::MOVING);
                }
                &track.turned
            };
            laid.test(simd, node, &track.span, &mut track.tested);
            with_items |= u32::from(track.tested.items != 0) << number;
            with_several |= u32::from(track.tested.enters_several()) << number;
        }
        // Diagonals.
        items.count = 0;
        for number in Tracks(with_items) {
            let track = &tracks[number];
            let node = &tree.nodes[track.at as usize];
            let mut own = track.tested.items;
            if diagonals {
                let turned = node.frame != 0;
                let laid = if turned { &track.turned } else { &track.own };
                own = laid.near_diagonals(simd, node, &track.tested);
            }
            items.push(simd, own, &node.children, track);
        }
        // Stacks. One subtree or none needs no order.
        for number in Tracks(ALL & !idle & !with_several) {
            let track = &mut tracks[number];
            let step = track.step_to_one(&tree.nodes[track.at as usize].children);
            stepped(
                simd,
                step,
                (number, track),
                &tree.nodes,
                (&mut idle, &mut left_out),
            );
        }
        for number in Tracks(with_several) {
            let track = &mut tracks[number];
            let step = track.step(simd, &tree.nodes[track.at as usize].children);
            stepped(
                simd,
                step,
                (number, track),
                &tree.nodes,
                (&mut idle, &mut left_out),
            );
        }
        // Items.
        let mut found = take(&items, queries);
        while found != 0 {
            let ray = found.trailing_zeros() as usize & (PACKET - 1);
            found &= found - 1;
            let number = usize::from(track_of[ray]) & (TURNS - 1);
            let track = &mut tracks[number];
            if track.ray != ray || idle >> number & 1 == 1 {
                // It is done, or was before, and another has its track.
                continue;
            }
            let (v, lane) = split(ray);
            let t_max = queries.t_max[v][lane];
            track.look(simd, queries);
            track.drop_behind(simd, t_max);
            // It looks no more.
            idle |= u32::from(t_max == f32::NEG_INFINITY) << number;
        }
    }
}

/// A track has taken a step, or cannot: it is idle where its ray is done, and asks for its next node.
#[inline(always)]
fn stepped<S: Simd, B: Bounds8>(
    simd: S,
    step: Option<bool>,
    (number, track): (usize, &Track),
    nodes: &[Node<B>],
    (idle, left_out): (&mut u32, &mut u64),
) {
    *idle |= u32::from(step.unwrap_or(true)) << number;
    if step.is_none() {
        *left_out |= 1 << track.ray;
    }
    simd.expect(nodes, track.at as usize);
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::{DVec3, Vec3};

    use super::*;
    use crate::bvh::ObjectGeometry;
    use crate::grid::{DicedMesh, Grid};
    use crate::trace::instance::InstanceTransform;
    use crate::trace::random::{cube, unit};
    use crate::trace::{Hit, Ray, TraceCounts, World, WorldInstance};

    /// Straight strands of `length` micropolygons, across rows or `along` them, in a cube. Some are there twice.
    fn strands(count: u32, length: u16, along: bool, keys: usize) -> World {
        let state = &mut 7;
        let mut mesh = DicedMesh {
            key_times: (0..keys)
                .map(|k| k as f32 / (keys.max(2) - 1) as f32)
                .collect(),
            ..DicedMesh::default()
        };
        let (nu, nv) = if along { (length, 1) } else { (1, length) };
        let mut strand = [Vec3::ZERO; 4];
        for element in 0..count {
            if element % 4 != 3 {
                strand = [1.0, 0.3, 0.02, 0.1].map(|size| cube(state) * size);
            }
            let [root, way, side, sway] = strand;
            for k in 0..keys {
                for j in 0..=nv {
                    for i in 0..=nu {
                        let (at, across) = if along { (i, j) } else { (j, i) };
                        let at = f32::from(at) / f32::from(length);
                        let p = root + way * at + side * f32::from(across) + sway * (at * k as f32);
                        mesh.positions.push(p);
                    }
                }
            }
            let first_vertex = mesh.vertex_count as u32;
            mesh.grids.push(Grid {
                first_vertex,
                element,
                nu,
                nv,
            });
            mesh.vertex_count += usize::from(nu + 1) * usize::from(nv + 1);
        }
        let instance = WorldInstance {
            object: Arc::new(ObjectGeometry::new(mesh)),
            transform: InstanceTransform::Translation(DVec3::ZERO),
            user: 0,
        };
        World::build(vec![instance], DVec3::ZERO)
    }

    /// Also rays for which stacks are too small: in tests they are.
    #[test]
    fn rays_in_turns_hit_what_they_hit_alone() {
        for keys in [1, 2, 4] {
            // Of 9, the last part is a single micropolygon.
            for (along, length) in [(false, 9), (true, 9), (false, 3), (true, 16)] {
                let world = strands(3000, length, along, keys);
                let state = &mut 11;
                let rays: Vec<Ray> = (0..40 * PACKET)
                    .map(|i| Ray {
                        origin: cube(state),
                        dir: cube(state),
                        time: unit(state),
                        t_min: 0.0,
                        t_max: if i % 3 == 0 { 0.5 } else { f32::INFINITY },
                    })
                    .collect();
                let mut hits = vec![Hit::MISS; rays.len()];
                let mut found = vec![false; rays.len()];
                let counts = &mut TraceCounts::default();
                world.trace_many(&rays, &mut hits, counts);
                world.occluded_many(&rays, &mut found, counts);
                let mut some = 0;
                for ((ray, hit), found) in rays.iter().zip(&hits).zip(&found) {
                    let alone = world.trace(ray, counts);
                    assert_eq!(alone, *hit, "{keys} keys, {along}, {length}: {ray:?}");
                    assert_eq!(
                        alone.is_hit(),
                        *found,
                        "{keys} keys, {along}, {length}: {ray:?}"
                    );
                    some += usize::from(alone.is_hit());
                }
                assert!(some > rays.len() / 8 && some < rays.len(), "{some}");
            }
        }
    }
}
