//! A ray that takes turns with others ([`super::scattered`]) on its way through a tree: the node that is next, what was found
//! in the one before, and the subtrees that wait.

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

    /// The subtrees among `children`, which were tested, that the ray enters wait, and the last that waits is taken: the nearest
    /// of these, where there are some. True where the ray is done: there is no subtree. Nothing is given, and nothing taken, where 8
    /// more may have no room.
    #[inline(always)]
    pub fn step<S: Simd>(&mut self, simd: S, children: &[u32; 8]) -> Option<bool> {
        let (inner, near) = (self.tested.inner, simd.from8(&self.tested.near));
        let first = self.waiting;
        let nodes = self.nodes.get_mut(first..);
        let nodes = nodes.and_then(<[u32]>::first_chunk_mut)?;
        let distances = self.near.get_mut(first..);
        let distances = distances.and_then(<[f32]>::first_chunk_mut)?;
        simd.falling(inner, near, children, distances, nodes);
        let count = first + inner.count_ones() as usize;
        self.waiting = count.saturating_sub(1);
        // Without meaning where none waits.
        self.at = self.nodes[self.waiting & (DEPTH - 1)];
        Some(count == 0)
    }

    /// As [`Self::step`], where no more than one subtree is entered.
    #[inline(always)]
    pub fn step_to_one(&mut self, children: &[u32; 8]) -> Option<bool> {
        let inner = self.tested.inner;
        debug_assert!(!self.tested.enters_several());
        let child = inner.trailing_zeros() as usize & 7;
        let first = self.waiting;
        if first > DEPTH - 8 {
            return None;
        }
        // Without meaning where none is entered.
        (self.nodes[first], self.near[first]) = (children[child], self.tested.near[child]);
        let count = first + usize::from(inner != 0);
        self.waiting = count.saturating_sub(1);
        self.at = self.nodes[self.waiting & (DEPTH - 1)];
        Some(count == 0)
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
                // The next is the nearest of those that were entered, or else the last; the others wait.
                let before = waiting(&track);
                track.tested.inner = inner;
                track.tested.near = std::array::from_fn(|_| unit(state));
                let some = (0..8).filter(|i| inner >> i & 1 == 1);
                let mut all: Vec<(u32, f32)> =
                    some.map(|i| (children[i], track.tested.near[i])).collect();
                all.sort_by(|a, b| b.1.total_cmp(&a.1));
                all.splice(0..0, before.iter().copied());
                let next = all.pop();
                let alone = inner.count_ones() < 2;
                for to_one in [false, true] {
                    let mut track = track;
                    let step = match to_one {
                        false => track.step(simd, &children),
                        true if alone => track.step_to_one(&children),
                        true => continue,
                    };
                    let Some(done) = step else {
                        assert!(before.len() > DEPTH - 8);
                        continue;
                    };
                    assert_eq!(done, next.is_none());
                    if let Some((node, _)) = next {
                        assert_eq!(track.at, node);
                    }
                    assert_eq!(waiting(&track), all);
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
