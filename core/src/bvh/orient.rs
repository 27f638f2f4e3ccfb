//! Frames of subtrees over strands: where the items of a range run in one direction, more or less, bounds
//! along that direction are a few times tighter than along the axes of space.
//!
//! After Woop, Benthin, Wald, Johnson, Tabellion, "Exploiting Local Orientation Similarity for Efficient Ray
//! Traversal of Hair and Fur", HPG 2014. Unlike there, a frame is chosen once for a whole subtree, which is then
//! built in it: splits and all nodes are along strands, and a ray that has been turned stays so from node to
//! node. Ranges are tried from [`MOST_ITEMS`] downward, each a quarter of the last or smaller, and last the
//! items of a single node, so that combed fur is turned in large parts, and tousled fur where a few
//! strands happen to agree. A frame does not move: it follows the mean of both ends of the shutter.

use glam::Vec3;
use hdtrapeze_simd::{Kernel, Level, Scalar, Simd};

use super::Frame;
use super::block::{CellRect, GROUPS, loose};
use super::bound::{TURN_COST, bound_groups};
use super::guess::{Guess, Guessed};
use super::object::loose_group;
use super::sorted::{Hull, Sorted};
use super::split::Extent;
use crate::grid::PlanarMesh;
use crate::grid::planar::GridPlanes;

/// Most items of a range that is tried.
pub const MOST_ITEMS: usize = 2048;
/// A range of more items than a node has is turned where that leaves less than this part of the area of its
/// boxes. Figures are much the same from a quarter to a half.
const SHARE: f32 = 0.4;

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
    pub fn turn<H: Hull>(&self, items: &[Sorted<H>]) -> Option<(Frame, Vec<Sorted<H>>)> {
        let Guess {
            frame,
            before,
            after,
        } = self.level.run(Guessed(items))?;
        let least = if items.len() > GROUPS {
            SHARE * before
        } else {
            let whole = Extent::of(self.level, items).bounds;
            before - TURN_COST * H::area(Scalar, whole.load(Scalar))
        };
        // Most ranges that fail do so here.
        if after >= least {
            return None;
        }
        let turned = self.turned(items, &frame)?;
        (self.level.run(Area(&turned)) < least).then_some((frame, turned))
    }

    /// The items of a range in a frame; none where one of them is a block.
    fn turned<H: Hull>(&self, items: &[Sorted<H>], frame: &Frame) -> Option<Vec<Sorted<H>>> {
        let mut turned = items.to_vec();
        for part in turned.chunks_mut(GROUPS) {
            let mut groups = [(0, CellRect::default()); GROUPS];
            for (to, item) in groups.iter_mut().zip(part.iter()) {
                let (grid, slot) = loose_group(item.id())?;
                *to = (grid, loose(&self.mesh.grids[grid as usize], slot));
            }
            let boxes = bound_groups(self.level, self.mesh, &groups[..part.len()], frame);
            for (item, bounds) in part.iter_mut().zip(&boxes) {
                item.bounds = H::of(bounds);
            }
        }
        Some(turned)
    }
}

/// The sum of the areas of boxes.
struct Area<'a, H>(&'a [Sorted<H>]);

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

/// From end to end of a group of a strip, the mean of both ends of the shutter.
pub fn direction(planes: &GridPlanes<'_>, rect: CellRect) -> Vec3 {
    let stride = usize::from(planes.grid.nu) + 1;
    let [i, j, w, h] = [rect.i, rect.j, rect.w, rect.h].map(usize::from);
    let from = j * stride + i;
    let to = if planes.grid.nu == 1 {
        from + h * stride
    } else {
        from + w
    };
    let edge = |k: usize| planes.position(k, to) - planes.position(k, from);
    (edge(0) + edge(planes.key_times.len() - 1)) * 0.5
}
