//! Frames of subtrees over strands: where the items of a range run in one direction, more or less, bounds
//! along that direction are a few times tighter than along the axes of space.
//!
//! After Woop, Benthin, Wald, Johnson, Tabellion, "Exploiting Local Orientation Similarity for Efficient Ray
//! Traversal of Hair and Fur", HPG 2014. Unlike there, a frame is chosen once for a whole subtree, which is then
//! built in it: splits and all nodes are along strands, and a ray that has been turned stays so from node to
//! node. Ranges are tried from [`MOST_ITEMS`] downward, each a quarter of the last or smaller, and last the
//! items of a single node, so that combed fur is turned in large parts, and tousled fur where a few
//! strands happen to agree. Where several ranges of a size were tried in vain, only some of the next are ([`super::tries`]): of fur whose
//! strands cross, what was tried took a sixth to a fifth of the time of a build. Which way strands go is looked up at their vertices only
//! where the boxes of some of a range's items tell that a frame may pay. Where strands swing, the frame turns with their mean direction, about what is at right angles to
//! it at both ends of the shutter ([`super::turn`]): its third axis goes along, and the first two stay.

use std::borrow::Cow;

use glam::Vec3;
use hdtrapeze_simd::{Kernel, Level, Scalar, Simd};

use super::block::{CellRect, GROUPS, is_small, loose};
use super::bound::bound_groups;
use super::extent::Extent;
use super::guess::{Guess, Guessed};
use super::object::loose_group;
use super::sorted::{Hull, Sorted};
use super::tries::Tries;
use super::turn::{Between, Pose, Turning};
use super::{Bounds8, Frame};
use crate::grid::PlanarMesh;
use crate::grid::planar::GridRows;

/// Most items of a range that is tried.
pub const MOST_ITEMS: usize = 2048;
/// A range of more items than a node has is turned where that leaves less than this part of the area of its
/// boxes. Figures are much the same from a quarter to a half.
const SHARE: f32 = 0.4;
/// The range of a single node is turned where that saves more of the area of its boxes than this part of the area of
/// the node. Combed fur is as fast with 0.3 as with 1.5; fur whose strands cross is a thirtieth slower with 0.3 than without any
/// frames, and with 1 has few of them.
const TURN_COST: f32 = 1.0;

/// What ranges are given before the directions of all their items are looked up, which are all over memory: those of some, by the diagonals of
/// their boxes, may be farther apart.
const ABOUT: f32 = 1.1;
/// Items that stand for a range, at most.
const SOME: usize = 64;

/// A range in a frame of its own.
pub struct Turned<B: Bounds8> {
    /// The frame.
    pub frame: B::Turning,
    /// The items of the range, as they are there.
    pub items: Vec<Sorted<B::Hull>>,
}

/// Ranges of one size that are tried in vain before some are passed over.
const PATIENCE: u32 = 4;
/// One of so many is tried from then on, until one is turned.
const EVERY: u32 = 16;

/// Ranges of one thread's part of a tree, by size, a quarter each: those of a node, up to 4 times as many, and so on.
#[derive(Clone, Copy, Debug, Default)]
pub struct BySize([Tries<PATIENCE, EVERY>; 5]);

impl BySize {
    /// As [`Strands::turn`], or none where that is not likely to pay.
    pub fn turn<B: Bounds8>(
        &mut self,
        strands: &Strands<'_>,
        items: &[Sorted<B::Hull>],
    ) -> Option<Turned<B>> {
        let tries = self.of(items.len());
        if !tries.is_due() {
            return None;
        }
        let turned = strands.turn::<B>(items);
        tries.tried(turned.is_none());
        turned
    }

    fn of(&mut self, count: usize) -> &mut Tries<PATIENCE, EVERY> {
        let (mut size, mut most) = (0, GROUPS);
        while count > most && size < self.0.len() - 1 {
            (size, most) = (size + 1, 4 * most);
        }
        &mut self.0[size]
    }
}

/// The groups of a mesh that a tree is built over.
#[derive(Clone, Copy)]
pub struct Strands<'a> {
    /// The mesh.
    pub mesh: &'a PlanarMesh,
    /// For bounds.
    pub level: Level,
}

impl Strands<'_> {
    /// A frame for a range that has none yet, and its items there, if that pays.
    fn turn<B: Bounds8>(&self, items: &[Sorted<B::Hull>]) -> Option<Turned<B>> {
        // Most ranges that fail do so by what the boxes of some tell.
        let some = some_of(items);
        self.guess::<B>(&some, &about(&some), ABOUT)?;
        let directions = self.directions(items)?;
        let (ends, least) = self.guess::<B>(items, &directions, 1.0)?;
        let frame = self.frame(items, &directions, &ends)?;
        let items = self.turned(items, &directions, &frame)?;
        (self.level.run(Area(&items)) < least).then_some(Turned { frame, items })
    }

    /// Both ends of a frame that may suit a range, and what areas in it must be below, if they are likely to be; `room` times that, for
    /// directions that are not the items' own.
    fn guess<B: Bounds8>(
        &self,
        items: &[Sorted<B::Hull>],
        directions: &[[Vec3; 2]],
        room: f32,
    ) -> Option<([Frame; 2], f32)> {
        let Guess {
            ends,
            before,
            after,
        } = self.level.run(Guessed {
            items,
            directions,
            coherence: 1.0 / room,
        })?;
        let least = if items.len() > GROUPS {
            SHARE * before
        } else {
            let whole = Extent::of(self.level, items).bounds;
            before - TURN_COST * B::Hull::area(Scalar, whole.load(Scalar))
        };
        (after < room * least).then_some((ends, least))
    }

    /// From end to end of each item in mid-shutter, and half of what that changes by from start to end; none where one is no part of a
    /// strip.
    fn directions<H: Hull>(&self, items: &[Sorted<H>]) -> Option<Vec<[Vec3; 2]>> {
        let last = self.mesh.key_times.len() - 1;
        let direction = |item: &Sorted<H>| {
            let (grid, slot) = loose_group(item.id())?;
            let rows = self.mesh.traced_rows(grid);
            if is_small(&rows.grid) {
                return None;
            }
            let rect = loose(&rows.grid, slot);
            let edge = |k| Piece::of(&rows, rect, k).edge;
            let start = edge(0);
            let end = if last > 0 { edge(last) } else { start };
            Some([(start + end) * 0.5, (end - start) * 0.5])
        };
        items.iter().map(direction).collect()
    }

    /// The frame that is so at both ends of the shutter, and follows strands between them; none where an item is a block.
    fn frame<H: Hull, T: Turning>(
        &self,
        items: &[Sorted<H>],
        directions: &[[Vec3; 2]],
        ends: &[Frame; 2],
    ) -> Option<T> {
        let times = &self.mesh.key_times;
        if !T::TURNS || (times.len() <= 2 && ends[0] == ends[1]) {
            return Some(T::fixed(ends[0]));
        }
        let along = ends[0].axes[0] + ends[1].axes[0];
        let mut sums = vec![Piece::default(); times.len()];
        for (item, [mean, _]) in items.iter().zip(directions) {
            let (grid, slot) = loose_group(item.id())?;
            let rows = self.mesh.traced_rows(grid);
            let rect = loose(&rows.grid, slot);
            let back = mean.dot(along) < 0.0;
            for (k, sum) in sums.iter_mut().enumerate() {
                let own = Piece::of(&rows, rect, k);
                sum.edge += if back { -own.edge } else { own.edge };
                sum.middle += own.middle;
            }
        }
        let part = 1.0 / items.len() as f32;
        let edges = |sum: &Piece| [sum.edge * part, Vec3::ZERO];
        let pose = |sum: &Piece, frame: Frame| Pose {
            frame,
            edges: edges(sum),
            middle: sum.middle * part,
        };
        let (first, rest) = sums.split_first()?;
        let (last, inner) = rest.split_last()?;
        let (start, end) = (pose(first, ends[0]), pose(last, ends[1]));
        if inner.is_empty() {
            return Some(T::between(&start, &end));
        }
        let inner = inner.iter().zip(&times[1..]).map(|(sum, &time)| Between {
            time,
            edges: edges(sum),
            middle: sum.middle * part,
        });
        let inner: Vec<Between> = inner.collect();
        Some(T::through(&start, &inner, &end, &ends[0]))
    }

    /// The items of a range in a frame; none where one of them is a block.
    fn turned<H: Hull, T: Turning>(
        &self,
        items: &[Sorted<H>],
        directions: &[[Vec3; 2]],
        frame: &T,
    ) -> Option<Vec<Sorted<H>>> {
        let mut turned = items.to_vec();
        let parts = turned.chunks_mut(GROUPS).zip(directions.chunks(GROUPS));
        for (part, directions) in parts {
            let mut groups = [(0, CellRect::default(), [Vec3::ZERO; 2]); GROUPS];
            let own = part.iter().zip(directions);
            for (to, (item, &[mean, half])) in groups.iter_mut().zip(own) {
                let (grid, slot) = loose_group(item.id())?;
                let rect = loose(&self.mesh.traced(grid), slot);
                *to = (grid, rect, [mean - half, mean + half]);
            }
            let (boxes, diagonals) =
                bound_groups(self.level, self.mesh, &groups[..part.len()], frame);
            for ((item, bounds), diagonal) in part.iter_mut().zip(&boxes).zip(diagonals) {
                *item = item.within(bounds, diagonal);
            }
        }
        Some(turned)
    }
}

/// Items of a range, evenly.
fn some_of<H: Hull>(items: &[Sorted<H>]) -> Cow<'_, [Sorted<H>]> {
    match items.len().div_ceil(SOME) {
        0 | 1 => Cow::Borrowed(items),
        step => Cow::Owned(items.iter().step_by(step).copied().collect()),
    }
}

/// As [`Strands::directions`], by the diagonals of boxes.
fn about<H: Hull>(items: &[Sorted<H>]) -> Vec<[Vec3; 2]> {
    let about = |item: &Sorted<H>| {
        let [start, end] = item.bounds.ways();
        [(start + end) * 0.5, (end - start) * 0.5]
    };
    items.iter().map(about).collect()
}

/// The sum of the areas of boxes.
struct Area<'a, H: Hull>(&'a [Sorted<H>]);

impl<H: Hull> Kernel for Area<'_, H> {
    type Output = f32;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> f32 {
        let mut sum = 0.0;
        for item in self.0 {
            sum += H::area(simd, item.bounds.load(simd));
        }
        sum
    }
}

/// A group of a strip at a key.
#[derive(Clone, Copy, Debug, Default)]
pub struct Piece {
    /// From end to end of it.
    pub edge: Vec3,
    /// Half-way between.
    pub middle: Vec3,
}

impl Piece {
    /// Of a group of these micropolygons.
    pub fn of(rows: &GridRows<'_>, rect: CellRect, key: usize) -> Self {
        let [i, j, w, h] = [rect.i, rect.j, rect.w, rect.h].map(usize::from);
        let from = rows.position(key, i, j);
        let to = match rows.grid.nu {
            1 => rows.position(key, i, j + h),
            _ => rows.position(key, i + w, j),
        };
        Self {
            edge: to - from,
            middle: (from + to) * 0.5,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_of_each_size_are_tried_by_themselves() {
        let mut sizes = BySize::default();
        for (size, count) in [8, 32, 128, 512, 2048].into_iter().enumerate() {
            for count in [count, count / 4 + 1] {
                for _ in 0..=size {
                    sizes.of(count).tried(true);
                }
            }
        }
        let in_vain = |times: u32| {
            let mut tries = Tries::default();
            (0..times).for_each(|_| tries.tried(true));
            tries
        };
        assert_eq!(sizes.0, [2, 4, 6, 8, 10].map(in_vain));
    }
}
