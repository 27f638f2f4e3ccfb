//! A ray that takes turns with others ([`super::scattered`]) on its way through a tree: the node that is next, what was found
//! in the one before, and the subtrees that wait.

use std::hint::select_unpredictable;

use hdtrapeze_simd::{Float, Mask, Simd};

use super::laid::{Laid, Tested};
use super::packet::{LANES, Lanes, Slabs, split};
use super::queries::Queries;

/// Subtrees that may wait for a ray, a power of 2. Rays for which these are too few are traced otherwise. In tests, there are
/// such.
const DEPTH: usize = if cfg!(test) { 16 } else { 256 };

/// A ray on its way.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct Track {
    pub own: Laid,
    /// In the frame of the last node that had one.
    pub turned: Laid,
    /// Between what it looks: `t_min`, and `t_max` mirrored, in the two halves.
    pub span: Lanes,
    /// What was found in the node.
    pub tested: Tested,
    pub ray: usize,
    /// The node that is next.
    pub at: u32,
    /// The frame of `turned`.
    pub frame: u32,
    /// Subtrees that wait: how many, references, and where the ray enters.
    waiting: usize,
    nodes: [u32; DEPTH],
    near: [f32; DEPTH],
}

impl Track {
    /// The same number everywhere.
    pub const fn filled(x: f32) -> Self {
        let laid = Laid::filled(x);
        Track {
            own: laid,
            turned: laid,
            span: [x; LANES],
            tested: Tested::filled(x),
            ray: usize::MAX,
            at: u32::MAX,
            frame: u32::MAX,
            waiting: usize::MAX,
            nodes: [u32::MAX; DEPTH],
            near: [x; DEPTH],
        }
    }

    /// A ray starts at the root.
    #[inline(always)]
    pub fn start<S: Simd>(&mut self, simd: S, root: u32, ray: usize, slabs: &Slabs, moving: bool) {
        (self.ray, self.at, self.frame, self.waiting) = (ray, root, 0, 0);
        self.own.set(simd, slabs, ray, moving);
    }

    /// The ray looks where `queries` say.
    #[inline(always)]
    pub fn look<S: Simd>(&mut self, simd: S, queries: &Queries) {
        let (v, lane) = split(self.ray);
        let [t_min, t_max] = queries.ranges[v][lane];
        self.span = simd.halves(simd.all8(t_min), simd.all8(t_max)).to_array();
    }

    /// Takes the next subtree: the nearest of `children`, which were tested, that the ray enters, and the others wait; or one of
    /// those that wait. True where the ray is done: there is no subtree. Nothing is given, and nothing taken, where 8 more may have no room.
    ///
    /// What is next does not go by way of the stack, so that it is known soon.
    #[inline(always)]
    pub fn step<S: Simd>(&mut self, simd: S, children: &[u32; 8], sorted: bool) -> Option<bool> {
        let (inner, near) = (self.tested.inner, simd.from8(&self.tested.near));
        let none = inner == 0;
        let nearest = simd.smallest(inner, near) & 7;
        let others = inner & !(1 << nearest);
        let first = self.waiting;
        // What is taken where there is no child: the nearest of the last 8 that wait where these are `sorted`, else the last.
        // Without meaning where none wait.
        let from = first.saturating_sub(8);
        let last = first.saturating_sub(1) & (DEPTH - 1);
        let mut waits = last;
        if sorted && let Some(eight) = self.near.get(from..).and_then(<[f32]>::first_chunk) {
            let nearest = simd.smallest((1 << (first - from)) - 1, simd.from8(eight));
            waits = (from + nearest) & (DEPTH - 1);
        }
        let nodes = self
            .nodes
            .get_mut(first..)
            .and_then(<[u32]>::first_chunk_mut)?;
        let distances = self
            .near
            .get_mut(first..)
            .and_then(<[f32]>::first_chunk_mut)?;
        simd.kept(others, near, children, distances, nodes);
        // The last takes the place of the one that is taken.
        let node = self.nodes[waits];
        let kept = select_unpredictable(none, last, waits);
        (self.nodes[waits], self.near[waits]) = (self.nodes[kept], self.near[kept]);
        self.at = select_unpredictable(none, node, children[nearest]);
        let count = others.count_ones() as usize;
        self.waiting = select_unpredictable(none, last, first + count);
        Some(none && first == 0)
    }

    /// Drops subtrees that begin behind `t_max`.
    #[inline(always)]
    pub fn drop_behind<S: Simd>(&mut self, simd: S, t_max: f32) {
        let mut kept = 0;
        for k in 0..DEPTH / 8 {
            let Some(left) = self.waiting.checked_sub(8 * k).filter(|&left| left > 0) else {
                break;
            };
            let (nodes, near) = (self.nodes.as_chunks().0[k], self.near.as_chunks().0[k]);
            let near = simd.from8(&near);
            let there = ((1u64 << left.min(8)) - 1) as u32;
            let mask = near.le(simd.all8(t_max)).bits() & there;
            let to = self
                .nodes
                .get_mut(kept..)
                .and_then(<[u32]>::first_chunk_mut);
            let near_to = self.near.get_mut(kept..).and_then(<[f32]>::first_chunk_mut);
            if let (Some(to), Some(near_to)) = (to, near_to) {
                simd.kept(mask, near, &nodes, near_to, to);
            }
            kept += mask.count_ones() as usize;
        }
        self.waiting = kept;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::random::unit;

    /// For each number of subtrees that wait.
    struct Subtrees;

    impl hdtrapeze_simd::Kernel for Subtrees {
        type Output = ();
        #[inline(always)]
        fn run<S: Simd>(self, simd: S) {
            let state = &mut 3;
            let mut track = Track::filled(f32::NAN);
            let children: [u32; 8] = std::array::from_fn(|i| 1000 + i as u32);
            for (first, inner) in (0..=DEPTH - 8).flat_map(|n| (0..256).map(move |m| (n, m))) {
                track.waiting = first;
                for i in 0..first {
                    (track.nodes[i], track.near[i]) = (i as u32, unit(state));
                }
                let waiting = |track: &Track| -> Vec<(u32, f32)> {
                    let all = track.nodes.iter().copied().zip(track.near);
                    all.take(track.waiting).collect()
                };
                // Those behind are dropped.
                let mut left = waiting(&track);
                left.retain(|&(_, near)| near <= 0.7);
                track.drop_behind(simd, 0.7);
                assert_eq!(waiting(&track), left);
                // The next is one of all, and the others wait.
                for sorted in [true, false] {
                    let mut before = waiting(&track);
                    track.tested.inner = inner;
                    track.tested.near = std::array::from_fn(|_| unit(state));
                    let some = (0..8).filter(|i| inner >> i & 1 == 1);
                    let entered = some.map(|i| (children[i], track.tested.near[i]));
                    let entered: Vec<(u32, f32)> = entered.collect();
                    let last = before.len().saturating_sub(if sorted { 8 } else { 1 });
                    let among = if inner == 0 {
                        &before[last..]
                    } else {
                        &entered[..]
                    };
                    let nearest = among.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1));
                    let Some(done) = track.step(simd, &children, sorted) else {
                        assert!(before.len() > DEPTH - 8);
                        continue;
                    };
                    assert_eq!(done, nearest.is_none());
                    let mut after = waiting(&track);
                    if let Some((_, least)) = nearest {
                        // Which one, where some are all but equal, is left open.
                        let next = |&&(node, near): &&(u32, f32)| {
                            node == track.at && near <= least * (1.0 + 1e-6)
                        };
                        after.extend(among.iter().find(next));
                    }
                    before.extend(entered);
                    let key = |&(node, near): &(u32, f32)| (node, near.to_bits());
                    before.sort_by_key(key);
                    after.sort_by_key(key);
                    assert_eq!(after, before);
                }
            }
        }
    }

    #[test]
    fn no_subtree_is_lost() {
        for level in hdtrapeze_simd::Level::available() {
            level.run(Subtrees);
        }
    }
}
