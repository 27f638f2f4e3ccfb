//! Frames of nodes over strands: where the groups below a node run in one direction, more or less, bounds
//! along that direction are a few times tighter than along the axes of space.
//!
//! After Woop, Benthin, Wald, Johnson, Tabellion, "Exploiting Local Orientation Similarity for Efficient Ray
//! Traversal of Hair and Fur", HPG 2014. The tree is built by position; then each node over loose groups
//! alone gets the frame of its groups' mean direction, and of the direction in which they spread most, if
//! surface-area cost says that it pays. Nodes higher up are much wider than a strand is long: whatever their
//! axes, their boxes are as wide.

use glam::Vec3;
use hdtrapeze_simd::Level;
use rayon::prelude::*;

use super::block::{CellRect, loose};
use super::bound::{TURN_COST, bound_groups};
use super::build::Tree;
use super::object::loose_group;
use super::{Bounds8, Frame, LinearBox};
use crate::grid::PlanarMesh;

/// Turns the nodes for which it pays.
pub fn orient<B: Bounds8>(level: Level, mesh: &PlanarMesh, tree: &mut Tree<B>) {
    let turned: Vec<Option<(Frame, B)>> = tree
        .nodes
        .par_iter()
        .with_min_len(256)
        .map(|node| {
            let mut groups = [(0, CellRect::default()); 8];
            let count = node.valid.count_ones() as usize;
            for (to, child) in groups[..count].iter_mut().zip(node.children) {
                let (grid, slot) = loose_group(child.checked_sub(Tree::<B>::LEAF)?)?;
                *to = (grid, loose(&mesh.grids[grid as usize], slot));
            }
            turn(level, mesh, &groups[..count])
        })
        .collect();
    for (node, turned) in tree.nodes.iter_mut().zip(turned) {
        if let Some((frame, bounds)) = turned {
            node.bounds = bounds;
            node.frame = tree.frames.len() as u32;
            tree.frames.push(frame);
        }
    }
}

/// The frame of a node over groups and their bounds in it, if it pays.
fn turn<B: Bounds8>(
    level: Level,
    mesh: &PlanarMesh,
    groups: &[(u32, CellRect)],
) -> Option<(Frame, B)> {
    let frame = common_frame(mesh, groups)?;
    let area = |boxes: &[LinearBox]| boxes.iter().map(LinearBox::mean_half_area).sum::<f32>();
    let aligned = bound_groups(level, mesh, groups, None);
    let aligned = &aligned[..groups.len()];
    let whole = aligned.iter().fold(LinearBox::EMPTY, |a, b| a.union(b));
    let turned = bound_groups(level, mesh, groups, Some(&frame));
    let turned = &turned[..groups.len()];
    let pays = area(turned) + turn_cost() * whole.mean_half_area() < area(aligned);
    pays.then(|| (frame, B::pack(turned)))
}
fn turn_cost() -> f32 {
    static S: std::sync::OnceLock<f32> = std::sync::OnceLock::new();
    *S.get_or_init(|| {
        std::env::var("TURN")
            .ok()
            .and_then(|s| s.parse().ok())
            .unwrap_or(TURN_COST)
    })
}

/// Along the mean direction of strands, and the direction in which they differ most.
fn common_frame(mesh: &PlanarMesh, groups: &[(u32, CellRect)]) -> Option<Frame> {
    let mut along = [Vec3::ZERO; 8];
    let mut mean = Vec3::ZERO;
    for (to, &(grid, rect)) in along.iter_mut().zip(groups) {
        let d = direction(mesh, grid, rect);
        // Strands have no sense: what points the other way is turned round.
        *to = if d.dot(mean) < 0.0 { -d } else { d };
        mean += *to;
    }
    let axis = mean.try_normalize()?;
    let spread = along
        .iter()
        .map(|d| *d - axis * d.dot(axis))
        .max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))?;
    Frame::from_edges(axis, spread)
}

/// From end to end of a group, longwise, at both ends of the shutter together.
fn direction(mesh: &PlanarMesh, grid: u32, rect: CellRect) -> Vec3 {
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
