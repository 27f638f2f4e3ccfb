//! Which ranges of a binary tree become nodes, so that rays open the fewest: of up to a thousand items all splits are made first, and then
//! the children of each node are chosen among the ranges that they have, by dynamic programming.
//!
//! Rays that meet a node open another one within it about as often as their areas are to each other, so the areas of all
//! nodes tell how many are opened. A node has up to 8 children. Let `least[k]` be the least sum of areas within a range that takes up to
//! `k + 1` of them: as one it is a node, with its own area, whose two sides share 8 children; as more, both sides
//! share these. An item takes one, and costs nothing. After Ylitie, Karras, Laine, "Efficient Incoherent Ray Traversal on GPUs Through
//! Compressed Wide BVHs", HPG 2017, section 3.1; they count items too, but here a node's are single, so that they cost the same however
//! nodes are chosen.

use arrayvec::ArrayVec;
use hdtrapeze_simd::{Level, Scalar};

use super::build::Nodes;
use super::extent::Extent;
use super::sorted::{Hull, Sorted};
use super::split::split;

/// Ranges of up to so many items are planned. Of more, nodes become hardly better.
pub const MOST_ITEMS: usize = 1024;
/// Children of a node.
const CHILDREN: usize = 8;
/// About as many splits lead from a node to the next. Below so many times [`super::split::SAH_DEPTH`] of them ranges are halved, so that
/// depth stays logarithmic for any input.
const SPLITS: usize = 3;

/// What a node costs besides its area, in areas of the whole range: of nodes whose areas are as good as the same, the fewest.
const LEAST: f32 = 1e-6;

/// The least sums of areas within a range that takes up to 1, 2, ... children of a node.
type Sums = [f32; CHILDREN];

/// A side of a split.
#[derive(Clone, Copy)]
struct Side<H> {
    /// Items.
    count: u32,
    /// The number of its own split, if it has one.
    cut: Option<u32>,
    bounds: H,
    least: Sums,
}

/// All splits of a range, those of sides before their own.
pub struct Plan<H> {
    cuts: Vec<[Side<H>; 2]>,
    /// What is added to the area of each node.
    least: f32,
}

/// A planned range of more than 8 items: a node.
pub struct Planned<'a, H> {
    plan: &'a Plan<H>,
    cut: u32,
}

impl<H> Clone for Planned<'_, H> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<H> Copy for Planned<'_, H> {}

/// A child of a planned node.
pub struct Child<'a, H> {
    /// Its items, which follow those of the children before.
    pub count: usize,
    /// The box around them, but of no use for one.
    pub bounds: H,
    /// Their plan, where they are more than 8.
    pub planned: Option<Planned<'a, H>>,
}

impl<H: Hull> Plan<H> {
    /// Splits more than 8 items, which change places, for a node that is so deep in the tree.
    pub fn new(
        level: Level,
        items: &mut [Sorted<H>],
        extent: &Extent<H>,
        kind: Nodes,
        depth: usize,
    ) -> Self {
        let area = H::area(Scalar, extent.bounds.load(Scalar));
        let mut plan = Self {
            cuts: Vec::with_capacity(items.len() / kind.least_split()),
            least: if area > 0.0 { area * LEAST } else { 1.0 },
        };
        plan.divide(level, items, extent, kind, depth * SPLITS);
        plan
    }

    /// The whole range.
    pub fn whole(&self) -> Planned<'_, H> {
        Planned {
            plan: self,
            cut: self.cuts.len() as u32 - 1,
        }
    }

    /// Splits a range, about so many splits below the root, and its sides; gives their least sums for up to 2, 3, ... children.
    fn divide(
        &mut self,
        level: Level,
        items: &mut [Sorted<H>],
        extent: &Extent<H>,
        kind: Nodes,
        splits: usize,
    ) -> Sums {
        let halves = split(level, items, extent, kind, splits / SPLITS);
        let (left, right) = items.split_at_mut(halves.middle);
        let [a, b] = &halves.extents;
        let cut = [(left, a), (right, b)].map(|(items, extent)| {
            let count = items.len();
            let bounds = extent.bounds;
            let area = H::area(Scalar, bounds.load(Scalar)) + self.least;
            let mut least = [0.0; CHILDREN];
            let mut cut = None;
            if count < kind.least_split() {
                least[..count - 1].fill(area);
            } else {
                let shared = self.divide(level, items, extent, kind, splits + 1);
                cut = Some(self.cuts.len() as u32 - 1);
                let whole = area + shared[CHILDREN - 1];
                least = shared.map(|shared| shared.min(whole));
            }
            Side {
                count: count as u32,
                cut,
                bounds,
                least,
            }
        });
        let sums = shared(&cut);
        self.cuts.push(cut);
        sums
    }
}

/// The least sums of two sides that share up to 2, 3, ... children; infinite for one.
fn shared<H>([a, b]: &[Side<H>; 2]) -> Sums {
    let mut sums = [f32::INFINITY; CHILDREN];
    for (i, a) in a.least.iter().enumerate() {
        for (sum, b) in sums[i..].iter_mut().skip(1).zip(&b.least) {
            *sum = sum.min(a + b);
        }
    }
    sums
}

impl<'a, H: Hull> Planned<'a, H> {
    /// The children of the node, in the order of their items.
    pub fn children(self) -> ArrayVec<Child<'a, H>, CHILDREN> {
        let mut children = ArrayVec::new();
        let sides = &self.plan.cuts[self.cut as usize];
        self.plan.share(sides, CHILDREN, &mut children);
        children
    }
}

impl<H: Hull> Plan<H> {
    /// Two sides share `most` children, 2 or more.
    fn share<'a>(
        &'a self,
        sides: &'a [Side<H>; 2],
        most: usize,
        children: &mut ArrayVec<Child<'a, H>, CHILDREN>,
    ) {
        let first = best(sides, most).0;
        for (side, most) in sides.iter().zip([first, most - first]) {
            let count = side.count as usize;
            let below = side.cut.map(|cut| &self.cuts[cut as usize]);
            match below {
                Some(below) if most > 1 && best(below, most).1 <= side.least[0] => {
                    self.share(below, most, children);
                }
                None if count <= most => children.extend((0..count).map(|_| Child {
                    count: 1,
                    bounds: side.bounds,
                    planned: None,
                })),
                _ => children.push(Child {
                    count,
                    bounds: side.bounds,
                    planned: side
                        .cut
                        .filter(|_| count > CHILDREN)
                        .map(|cut| Planned { plan: self, cut }),
                }),
            }
        }
    }
}

/// How many of 2 children or more the first of two sides takes, and their sum. Of those that are as good, the most even.
fn best<H>([a, b]: &[Side<H>; 2], most: usize) -> (usize, f32) {
    let sum = |first: usize| a.least[first - 1] + b.least[most - first - 1];
    let even = most / 2;
    let mut best = (even, sum(even));
    for first in (1..even).rev().chain(even + 1..most) {
        let sum = sum(first);
        if sum < best.1 {
            best = (first, sum);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::super::LinearBox;
    use super::super::build::Item;
    use super::super::sorted::{LinearHull, StaticHull};
    use super::*;

    /// Boxes of all sizes, that move, in a slab.
    fn items<H: Hull>(count: u32, slab: Vec3) -> Vec<Sorted<H>> {
        let item = |id: u32| {
            let number = |k: u32| {
                let bits = (31 * id + 7 * count + k).wrapping_mul(2_654_435_761);
                (bits >> 8) as f32 / (1 << 24) as f32
            };
            let at = |k: u32| Vec3::new(number(k), number(k + 1), number(k + 2));
            let (lo, drift) = (at(1) * slab, at(11) * 0.1);
            let size = Vec3::ONE * (number(21) * number(22) * 0.2);
            let bounds = LinearBox {
                lo0: lo,
                hi0: lo + size,
                lo1: lo + drift,
                hi1: lo + drift + size,
            };
            Sorted::of(&Item { bounds, id })
        };
        (0..count).map(item).collect()
    }

    fn area<H: Hull>(bounds: &H) -> f32 {
        H::area(Scalar, bounds.load(Scalar))
    }

    /// The area of all nodes in a planned one, which holds these items.
    fn area_within<H: Hull>(planned: Planned<'_, H>, items: &[Sorted<H>]) -> f64 {
        let least = planned.plan.least;
        let (mut sum, mut rest) = (0.0, items);
        for child in planned.children() {
            let (own, others) = rest.split_at(child.count);
            rest = others;
            if own.len() == 1 {
                continue;
            }
            let around = Extent::of(Level::SCALAR, own).bounds;
            assert_eq!(area(&around), area(&child.bounds));
            sum += f64::from(area(&child.bounds) + least);
            assert_eq!(child.planned.is_some(), own.len() > CHILDREN);
            sum += child.planned.map_or(0.0, |node| area_within(node, own));
        }
        assert!(rest.is_empty());
        sum
    }

    /// The least area of all nodes in one of two sides that has 8 children or fewer, by trying all.
    fn least_within<H: Hull>(plan: &Plan<H>, cut: u32) -> f64 {
        let mut ways = vec![(0usize, 0.0)];
        for side in &plan.cuts[cut as usize] {
            ways = both(&ways, &ways_of(plan, side));
        }
        let fit = ways.iter().filter(|(children, _)| *children <= CHILDREN);
        fit.fold(f64::INFINITY, |least, (_, sum)| least.min(*sum))
    }

    /// Children that a side may take, and the area of all nodes then.
    fn ways_of<H: Hull>(plan: &Plan<H>, side: &Side<H>) -> Vec<(usize, f64)> {
        let own = f64::from(area(&side.bounds) + plan.least);
        let count = side.count as usize;
        let mut ways = match (side.cut, count) {
            (_, 1) => return vec![(1, 0.0)],
            (None, _) | (_, ..=CHILDREN) => vec![(1, own)],
            (Some(cut), _) => vec![(1, own + least_within(plan, cut))],
        };
        match side.cut {
            None => ways.push((count, 0.0)),
            Some(cut) => {
                let [a, b] = &plan.cuts[cut as usize];
                ways.extend(both(&ways_of(plan, a), &ways_of(plan, b)));
            }
        }
        ways
    }

    /// The best of each number of children.
    fn both(a: &[(usize, f64)], b: &[(usize, f64)]) -> Vec<(usize, f64)> {
        let mut best = [f64::INFINITY; CHILDREN + 1];
        for (some, sum) in a {
            for (more, other) in b {
                if let Some(best) = best.get_mut(some + more) {
                    *best = best.min(sum + other);
                }
            }
        }
        let found = best.into_iter().enumerate();
        found.filter(|(_, sum)| sum.is_finite()).collect()
    }

    fn check<H: Hull>() {
        for kind in [Nodes::Cheap, Nodes::Full] {
            for slab in [Vec3::ONE, Vec3::new(3.0, 0.02, 1.0)] {
                for count in [9, 10, 16, 17, 40, 64, 65, 300] {
                    let mut items = items::<H>(count, slab);
                    let extent = Extent::of(Level::best(), &items);
                    let plan = Plan::new(Level::best(), &mut items, &extent, kind, 0);
                    let mut ids: Vec<u32> = items.iter().map(Sorted::id).collect();
                    let found = area_within(plan.whole(), &items);
                    let want = least_within(&plan, plan.cuts.len() as u32 - 1);
                    let off = (found - want).abs();
                    assert!(off <= 1e-5 * want, "{kind:?} {count}: {found}, not {want}");
                    ids.sort_unstable();
                    assert!(ids.into_iter().eq(0..count));
                }
            }
        }
    }

    #[test]
    fn no_other_nodes_have_less_area() {
        check::<StaticHull>();
        check::<LinearHull>();
    }

    /// Nodes in a planned one, itself included, and how deep they are.
    fn count_within<H: Hull>(planned: Planned<'_, H>) -> [usize; 2] {
        let (mut nodes, mut depth) = (1, 0);
        for child in planned.children() {
            let [more, below] = match child.planned {
                Some(node) => count_within(node),
                None => [usize::from(child.count > 1); 2],
            };
            (nodes, depth) = (nodes + more, depth.max(below));
        }
        [nodes, depth + 1]
    }

    #[test]
    fn nodes_without_area_are_few_and_not_deep() {
        let point = LinearBox {
            lo0: Vec3::ONE,
            hi0: Vec3::ONE,
            lo1: Vec3::ONE,
            hi1: Vec3::ONE,
        };
        // At least 73, and halved 6 times.
        for (kind, most) in [(Nodes::Cheap, 110), (Nodes::Full, 75)] {
            let item = |id| Sorted::<StaticHull>::of(&Item { bounds: point, id });
            let mut items: Vec<_> = (0..512).map(item).collect();
            let extent = Extent::of(Level::best(), &items);
            let plan = Plan::new(Level::best(), &mut items, &extent, kind, 0);
            let [nodes, depth] = count_within(plan.whole());
            assert!(
                nodes <= most && depth <= 7,
                "{kind:?}: {nodes} nodes, {depth} deep"
            );
        }
    }
}
