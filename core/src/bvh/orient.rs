//! Frames of subtrees over strands: where the groups of a range run in one direction, more or less, bounds
//! along that direction are a few times tighter than along the axes of space.
//!
//! After Woop, Benthin, Wald, Johnson, Tabellion, "Exploiting Local Orientation Similarity for Efficient Ray
//! Traversal of Hair and Fur", HPG 2014.

use glam::Vec3;
use hdtrapeze_simd::Level;

use super::Frame;
use super::block::{CellRect, GROUPS, loose};
use super::bound::{TURN_COST, bound_groups};
use super::object::loose_group;
use super::sorted::{Hull, Sorted};
use crate::grid::PlanarMesh;

/// A range of more items than a node has is turned where the boxes of its items have less than this part of
/// their area after that.
fn share() -> f32 {
    env("SHARE", 0.4)
}
fn env(n: &str, d: f32) -> f32 {
    std::env::var(n)
        .ok()
        .and_then(|s| s.parse().ok())
        .unwrap_or(d)
}

/// Ranges with a smaller mean cosine of the angle to the mean direction are not tried.
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
    /// A frame for a range, which is aligned yet, and its items there, if that pays.
    pub fn turn<H: Hull>(&self, items: &[Sorted<H>]) -> Option<(Frame, Vec<Sorted<H>>)> {
        let frame = common_frame(items)?;
        let mut turned = items.to_vec();
        for part in turned.chunks_mut(GROUPS) {
            let mut groups = [(0, CellRect::default()); GROUPS];
            for (to, item) in groups.iter_mut().zip(part.iter()) {
                let (grid, slot) = loose_group(item.id)?;
                *to = (grid, loose(&self.mesh.grids[grid as usize], slot));
            }
            let groups = &groups[..part.len()];
            let boxes = bound_groups(self.level, self.mesh, groups, Some(&frame));
            for (item, bounds) in part.iter_mut().zip(&boxes) {
                item.bounds = H::of(bounds);
            }
        }
        let area = |items: &[Sorted<H>]| items.iter().map(|i| i.bounds.area()).sum::<f32>();
        let (before, after) = (area(items), area(&turned));
        let pays = if items.len() > GROUPS {
            after < share() * before
        } else {
            let whole = items.iter().fold(H::EMPTY, |h, i| h.union(&i.bounds));
            after + TURN_COST * whole.area() < before
        };
        pays.then_some((frame, turned))
    }
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

/// From end to end of a group, longwise, at both ends of the shutter together.
pub fn direction(mesh: &PlanarMesh, grid: u32, rect: CellRect) -> Vec3 {
    let g = grid as usize;
    let stride = usize::from(mesh.grids[g].nu) + 1;
    let [i, j, w, h] = [rect.i, rect.j, rect.w, rect.h].map(usize::from);
    let to = if mesh.grids[g].nv > mesh.grids[g].nu {
        (j + h) * stride + i
    } else {
        j * stride + i + w
    };
    let edge = |k: usize| mesh.position(g, k, to) - mesh.position(g, k, j * stride + i);
    edge(0) + edge(mesh.key_count() - 1)
}
