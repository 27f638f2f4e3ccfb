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
use hdtrapeze_simd::Level;

use super::Frame;
use super::block::{CellRect, GROUPS, loose};
use super::bound::{TURN_COST, bound_groups};
use super::object::loose_group;
use super::sorted::{Hull, Sorted};
use crate::grid::PlanarMesh;
use crate::grid::planar::GridPlanes;

/// Most items of a range that is tried.
pub const MOST_ITEMS: usize = 2048;
/// A range of more items than a node has is turned where that leaves less than this part of the area of its
/// boxes. Figures are much the same from a quarter to a half.
const SHARE: f32 = 0.4;
/// Ranges with a smaller mean cosine of the angle to the mean direction are not turned.
const LEAST_COSINE: f32 = 0.8;

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
        let frame = common_frame(items)?;
        // First without width: most ranges that fail do so here.
        let area = |items: &[Sorted<H>]| items.iter().map(|i| i.bounds.area()).sum::<f32>();
        let before = area(items);
        let least = if items.len() > GROUPS {
            SHARE * before
        } else {
            let whole = items.iter().fold(H::EMPTY, |h, i| h.union(&i.bounds));
            before - TURN_COST * whole.area()
        };
        let lines = items.iter().map(|i| line_area(frame.turn(i.along)));
        if lines.sum::<f32>() >= least {
            return None;
        }
        let turned = self.turned(items, &frame)?;
        (area(&turned) < least).then_some((frame, turned))
    }

    /// The items of a range in a frame; none where one of them is a block.
    fn turned<H: Hull>(&self, items: &[Sorted<H>], frame: &Frame) -> Option<Vec<Sorted<H>>> {
        let mut turned = items.to_vec();
        for part in turned.chunks_mut(GROUPS) {
            let mut groups = [(0, CellRect::default()); GROUPS];
            for (to, item) in groups.iter_mut().zip(part.iter()) {
                let (grid, slot) = loose_group(item.id)?;
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

/// Half the area of the box of a line.
fn line_area(along: Vec3) -> f32 {
    let e = along.abs();
    e.x * e.y + e.y * e.z + e.z * e.x
}

/// Along the mean direction of strands, and the direction in which they differ most. None where an item has
/// no direction, or directions differ too much.
fn common_frame<H: Hull>(items: &[Sorted<H>]) -> Option<Frame> {
    let (mut mean, mut lengths) = (Vec3::ZERO, 0.0);
    for item in items {
        let length = item.along.length();
        if length <= 0.0 {
            return None;
        }
        // Strands have no sense: what points the other way is turned round.
        mean += if item.along.dot(mean) < 0.0 {
            -item.along
        } else {
            item.along
        };
        lengths += length;
    }
    // Written so that NaN fails.
    let coherent = mean.length() > LEAST_COSINE * lengths;
    if !coherent {
        return None;
    }
    let axis = mean.try_normalize()?;
    let spread = items
        .iter()
        .map(|i| i.along - axis * i.along.dot(axis))
        .max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))?;
    Frame::from_edges(axis, spread)
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
