//! What the tree of an object is built over: blocks, and groups that need none.
//!
//! A grid that is no larger than a group is an item by itself. So is each group of a *strip* (a strand of
//! fur) whose box is mostly empty: groups of neighbouring strands fill boxes of the tree far better than
//! those of one strand fill a box that is as long as the strand, whatever way strands lean, and one level is
//! saved. All other grids are cut into blocks ([`super::block`]).

use glam::Vec3;
use hdtrapeze_simd::Level;
use rayon::prelude::*;

use super::block::{self, Span};
use super::bound::{BuiltBlock, bound, bound_loose};
use super::build::Item;
use super::object::{LOOSE_GRIDS, loose_item};
use super::orient::direction;
use super::{Bounds8, LinearBox};
use crate::grid::PlanarMesh;

/// A strip is cut loose where the boxes of its groups have less than this part of its own area together.
const LOOSE_SHARE: f32 = 0.5;
/// Grids that one thread gathers at a time.
const PART: usize = 512;

/// Items of a run of grids, in their order.
pub struct Part<B> {
    /// Blocks.
    pub blocks: Vec<BuiltBlock<B>>,
    /// Loose groups, numbered as the tree does.
    pub loose: Vec<Item>,
    /// Those of the loose groups that are parts of strips.
    pub strips: usize,
    /// Grids left out: not sound, or a vertex that is absurdly far.
    pub dropped: u64,
}

/// Gathers all grids, in parallel; those that are not `sound` are left out.
pub fn gather<B: Bounds8>(mesh: &PlanarMesh, sound: &[bool]) -> Vec<Part<B>> {
    let level = Level::best();
    let parts = mesh.grids.len().div_ceil(PART);
    (0..parts)
        .into_par_iter()
        .map(|part| {
            let mut out = Part {
                blocks: Vec::new(),
                loose: Vec::new(),
                strips: 0,
                dropped: 0,
            };
            let mut spans = Vec::new();
            let from = part * PART;
            for g in from..(from + PART).min(mesh.grids.len()) {
                let sound = sound[g] && add(level, mesh, g as u32, &mut out, &mut spans).is_some();
                out.dropped += u64::from(!sound);
            }
            out
        })
        .collect()
}

/// Adds the items of one grid: all, or none where a vertex cannot be traced.
fn add<B: Bounds8>(
    level: Level,
    mesh: &PlanarMesh,
    g: u32,
    out: &mut Part<B>,
    spans: &mut Vec<Span>,
) -> Option<()> {
    let grid = &mesh.grids[g as usize];
    let small = block::is_small(grid);
    if (small || block::is_strip(grid)) && g < LOOSE_GRIDS {
        let boxes = bound_loose(level, mesh, g)?;
        let boxes = &boxes[..block::loose_count(grid)];
        let whole = boxes.iter().fold(LinearBox::EMPTY, |a, b| a.union(b));
        let area: f32 = boxes.iter().map(LinearBox::mean_half_area).sum();
        if small || area < LOOSE_SHARE * whole.mean_half_area() {
            let items = boxes.iter().zip(0..).map(|(&bounds, slot)| Item {
                bounds,
                id: loose_item(g, slot),
                along: if small {
                    Vec3::ZERO
                } else {
                    direction(mesh, g, block::loose(grid, slot))
                },
            });
            out.loose.extend(items);
            out.strips += if small { 0 } else { boxes.len() };
            return Some(());
        }
    }
    let before = out.blocks.len();
    spans.clear();
    for span in block::cut(g, grid) {
        block::refine(mesh, span, spans);
    }
    for &span in spans.iter() {
        let Some(block) = bound(level, mesh, span) else {
            // A grid is traced whole or not at all.
            out.blocks.truncate(before);
            return None;
        };
        out.blocks.push(block);
    }
    Some(())
}
