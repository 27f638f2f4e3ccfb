//! One object, ready to be traced: its diced mesh and the tree over its blocks and small grids.
//!
//! Shared by `Arc` between instances.

use rayon::prelude::*;

use hdtrapeze_simd::Level;

use super::block::{self, Block, Span};
use super::bound::{BuiltBlock, bound, bound_small};
use super::build::{self, Tree};
use super::{Bounds8, Frame, LinearBox, LinearSlabs, StaticSlabs};
use crate::grid::{DicedMesh, PlanarMesh};

/// Set in an item of the tree that is a small grid ([`block::is_small`]) rather than a block.
pub const SMALL_GRID: u32 = 1 << 30;

/// Tree and blocks of one object.
#[derive(Clone, Debug)]
pub struct BlockTree<B> {
    /// Tree over blocks, by number, and small grids, by number and [`SMALL_GRID`]. Blocks use its
    /// frames too.
    pub tree: Tree<B>,
    /// Blocks, in the order of grids.
    pub blocks: Vec<Block<B>>,
}

/// The tree of an object: of the static kind when no vertex has more than one key.
#[derive(Clone, Debug)]
pub enum Blas {
    /// Nothing moves.
    Static(BlockTree<StaticSlabs>),
    /// Bounds are linear in time.
    Moving(BlockTree<LinearSlabs>),
}

/// What a tree holds, in numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BvhStats {
    /// Inner nodes above blocks, or above instances.
    pub nodes: u64,
    /// Inner nodes with a rotated frame.
    pub oriented_nodes: u64,
    /// Blocks.
    pub blocks: u64,
    /// Grids that the tree refers to without a block.
    pub small_grids: u64,
    /// Blocks with a rotated frame.
    pub oriented_blocks: u64,
    /// Micropolygons.
    pub cells: u64,
    /// Grids that were left out: a vertex was not finite or absurdly far, or indices pointed nowhere.
    pub dropped_grids: u64,
    /// Bytes of nodes, blocks and frames.
    pub bvh_bytes: u64,
    /// Bytes of positions, normals, channels and grids.
    pub mesh_bytes: u64,
}

impl BvhStats {
    /// Adds up two.
    #[must_use]
    pub fn plus(&self, o: &BvhStats) -> BvhStats {
        BvhStats {
            nodes: self.nodes + o.nodes,
            oriented_nodes: self.oriented_nodes + o.oriented_nodes,
            blocks: self.blocks + o.blocks,
            small_grids: self.small_grids + o.small_grids,
            oriented_blocks: self.oriented_blocks + o.oriented_blocks,
            cells: self.cells + o.cells,
            dropped_grids: self.dropped_grids + o.dropped_grids,
            bvh_bytes: self.bvh_bytes + o.bvh_bytes,
            mesh_bytes: self.mesh_bytes + o.mesh_bytes,
        }
    }
}

/// A diced mesh with its tree.
#[derive(Clone, Debug)]
pub struct ObjectGeometry {
    mesh: PlanarMesh,
    blas: Blas,
    bounds: LinearBox,
    radius: f32,
    stats: BvhStats,
}

impl ObjectGeometry {
    /// Builds the tree over a mesh, in parallel. Grids that cannot be traced (a vertex not finite, an
    /// index out of range) are left out and counted in [`BvhStats::dropped_grids`].
    pub fn new(mesh: DicedMesh) -> Self {
        let mut spans: Vec<Span> = Vec::new();
        let mut small: Vec<u32> = Vec::new();
        let mut dropped: u64 = 0;
        let sound: Vec<bool> = (0..mesh.grids.len())
            .map(|g| mesh.is_usable() && mesh.is_sound(g))
            .collect();
        let mesh = PlanarMesh::from(mesh);
        for (g, grid) in mesh.grids.iter().enumerate() {
            if sound[g] {
                if block::is_small(grid) && g < SMALL_GRID as usize {
                    small.push(g as u32);
                    continue;
                }
                for span in block::cut(g as u32, grid) {
                    block::refine(&mesh, span, &mut spans);
                }
            } else {
                dropped += 1;
            }
        }
        let mut stats = BvhStats {
            cells: mesh.cell_count() as u64,
            mesh_bytes: mesh.bytes() as u64,
            dropped_grids: dropped,
            ..BvhStats::default()
        };
        let (blas, bounds, radius) = if mesh.is_moving() {
            let (tree, bounds, radius) = build_blocks(&mesh, spans, &small, &mut stats);
            (Blas::Moving(tree), bounds, radius)
        } else {
            let (tree, bounds, radius) = build_blocks(&mesh, spans, &small, &mut stats);
            (Blas::Static(tree), bounds, radius)
        };
        Self {
            mesh,
            blas,
            bounds,
            radius,
            stats,
        }
    }

    /// The mesh.
    pub fn mesh(&self) -> &PlanarMesh {
        &self.mesh
    }
    /// The tree.
    pub fn blas(&self) -> &Blas {
        &self.blas
    }
    /// Axis-aligned bounds of all micropolygons over time, in the mesh's space relative to its
    /// origin; [`LinearBox::EMPTY`] when there are none.
    pub fn bounds(&self) -> &LinearBox {
        &self.bounds
    }
    /// Largest magnitude of any coordinate or stored bound, 0 when there are none: the scale that
    /// rounding errors are measured by.
    pub fn radius(&self) -> f32 {
        self.radius
    }
    /// True when nothing can be hit.
    pub fn is_empty(&self) -> bool {
        self.stats.blocks + self.stats.small_grids == 0
    }
    /// Numbers about the tree.
    pub fn stats(&self) -> &BvhStats {
        &self.stats
    }
}

fn build_blocks<B: Bounds8>(
    mesh: &PlanarMesh,
    spans: Vec<Span>,
    small: &[u32],
    stats: &mut BvhStats,
) -> (BlockTree<B>, LinearBox, f32) {
    let level = Level::best();
    let built: Vec<Option<BuiltBlock<B>>> = spans
        .par_iter()
        .with_min_len(64)
        .map(|&span| bound(level, mesh, span))
        .collect();
    // A grid is traced whole or not at all.
    let mut bad: Vec<u32> = spans
        .iter()
        .zip(&built)
        .filter(|(_, b)| b.is_none())
        .map(|(s, _)| s.grid)
        .collect();
    bad.dedup();
    stats.dropped_grids += bad.len() as u64;

    let grids: Vec<Option<LinearBox>> = small
        .par_iter()
        .with_min_len(256)
        .map(|&g| bound_small(level, mesh, g))
        .collect();
    stats.dropped_grids += grids.iter().filter(|b| b.is_none()).count() as u64;

    let mut blocks = Vec::with_capacity(built.len());
    let mut boxes = Vec::with_capacity(built.len() + grids.len());
    let mut frames: Vec<Frame> = vec![Frame::IDENTITY];
    let mut bounds = LinearBox::EMPTY;
    let mut radius: f32 = 0.0;
    for b in built.into_iter().flatten() {
        if bad.binary_search(&b.block.span.grid).is_ok() {
            continue;
        }
        let mut block = b.block;
        if let Some(frame) = b.frame {
            block.frame = frames.len() as u32;
            frames.push(frame);
        }
        boxes.push((blocks.len() as u32, b.aabb));
        blocks.push(block);
        bounds = bounds.union(&b.aabb);
        radius = radius.max(b.max_abs);
    }
    for (&g, b) in small.iter().zip(&grids) {
        let Some(b) = b else { continue };
        boxes.push((SMALL_GRID | g, *b));
        bounds = bounds.union(b);
        radius = radius.max(b.max_abs());
    }
    stats.oriented_blocks = frames.len() as u64 - 1;
    let is_empty = boxes.is_empty();
    let mut tree: Tree<B> = build::build(boxes);
    tree.frames = frames;
    // Oriented bounds, and bounds as packed, may reach farther than any vertex: they are part of the radius.
    radius = radius.max(if is_empty { 0.0 } else { bounds.max_abs() });
    for node in &tree.nodes {
        radius = radius.max(node.bounds.max_abs());
    }
    stats.nodes = tree.nodes.len() as u64;
    stats.oriented_nodes = tree.nodes.iter().filter(|n| n.frame != 0).count() as u64;
    stats.blocks = blocks.len() as u64;
    stats.small_grids = grids.iter().flatten().count() as u64;
    stats.bvh_bytes = (tree.bytes() + size_of_val(blocks.as_slice())) as u64;
    (BlockTree { tree, blocks }, bounds, radius)
}
