//! What trees that are made elsewhere, on a GPU, are made over, bounded here: grids are cut as they are there, where it follows from
//! their rates alone. No block is halved, all strips are loose, and none is cut into single micropolygons;
//! a frame is tried for each block where it may pay.

use hdtrapeze_simd::Level;

use super::block;
use super::bound::{BuiltBlock, bound_loose, bound_whole, is_bounded};
use super::object::LOOSE_GRIDS;
use super::{Bounds8, LinearBox};
use crate::grid::PlanarMesh;

/// The items of a grid.
pub enum Items<B: Bounds8> {
    /// Boxes of loose groups.
    Loose(Vec<LinearBox>),
    /// Blocks, whose frames have no numbers.
    Blocks(Vec<BuiltBlock<B>>),
}

/// The items of grid `g`, which is sound; none where a vertex or a bound cannot be traced: a grid is traced whole or not at all.
pub fn items<B: Bounds8>(mesh: &PlanarMesh, g: usize) -> Option<Items<B>> {
    let level = Level::best();
    let rows = mesh.grid_rows(g);
    if !is_bounded(level, &rows) {
        return None;
    }
    let (number, grid) = (g as u32, &rows.grid);
    if (block::is_small(grid) || block::is_strip(grid)) && number < LOOSE_GRIDS {
        let slots = block::loose_slots(grid, false);
        let count = slots.len();
        let boxes = bound_loose(level, &rows, slots)?;
        return Some(Items::Loose(boxes[..count].to_vec()));
    }
    let spans = block::cut(number, grid);
    let blocks = spans.map(|span| bound_whole(level, &rows, span));
    blocks.collect::<Option<_>>().map(Items::Blocks)
}
