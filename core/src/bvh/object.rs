//! One object, ready to be traced: its diced mesh and the tree over its blocks and loose groups.
//!
//! Shared by `Arc` between instances.
//!
//! **Trees that may never be asked for.** Where a GPU is to trace, an object is made [without a tree](ObjectGeometry::later):
//! its bounds are those of its vertices, and the CPU makes its tree once something is traced here after all.

use std::sync::{Arc, OnceLock};

use hdtrapeze_simd::Level;
use rayon::prelude::*;

use super::block::Block;
use super::bowing::Bowing;
use super::build::{NEVER, Nodes, PARALLEL_ITEMS, Tree, build_sorted};
use super::diagonal::CHILDREN;
use super::gather::{Gathered, How, Part, gather, joined};
use super::node::magnitude;
use super::orient::Strands;
use super::outline::{self, Outline};
use super::relative::{self, Built, Relative};
use super::{Bounds8, LinearBox, LinearSlabs, Node, StaticSlabs};
use crate::alone::alone_or;
use crate::grid::{DicedMesh, PlanarMesh};

/// Set in an item of the tree that is a [loose group](super::block::loose) rather than a block; below it
/// are the number of the grid and, in the last [`LOOSE_BITS`], that of the group.
pub const LOOSE: u32 = 1 << 30;
/// Bits of the number of a loose group in its grid.
pub const LOOSE_BITS: u32 = 5;
/// Grids from this number on, 33.5 million, have no loose groups, but blocks.
pub const LOOSE_GRIDS: u32 = LOOSE >> LOOSE_BITS;

/// The item of a tree for loose group `slot` of a grid.
pub fn loose_item(grid: u32, slot: u32) -> u32 {
    LOOSE | grid << LOOSE_BITS | slot
}

/// Grid and number of the loose group that an item is, unless it is a block.
#[inline(always)]
pub fn loose_group(item: u32) -> Option<(u32, u32)> {
    let slot = item & ((1 << LOOSE_BITS) - 1);
    (item & LOOSE != 0).then_some(((item & !LOOSE) >> LOOSE_BITS, slot))
}

/// Tree and blocks of one object.
#[derive(Clone, Debug)]
pub struct BlockTree<B: Bounds8> {
    /// Tree over blocks, by number, and [loose groups](loose_group).
    pub tree: Tree<B>,
    /// Frames of the blocks; number 0 is the identity.
    pub frames: Vec<B::Turning>,
    /// Blocks, in the order of grids.
    pub blocks: Vec<Block<B>>,
    /// Most nodes have [diagonals](super::diagonal), and no frame of their own.
    pub diagonals: bool,
    /// Most items are parts of strands, longer than a group: of [strips](super::block::is_strip).
    pub strands: bool,
    /// How frames bow.
    pub bowing: Bowing,
}

impl<B: Bounds8> BlockTree<B> {
    /// Of nothing.
    const EMPTY: Self = Self {
        tree: Tree {
            nodes: Vec::new(),
            frames: Vec::new(),
            root: Tree::<B>::EMPTY,
        },
        frames: Vec::new(),
        blocks: Vec::new(),
        diagonals: false,
        strands: false,
        bowing: Bowing::parabola(),
    };
}

/// The tree of an object: of the static kind when no vertex has more than one key.
#[derive(Clone, Debug)]
pub enum Blas {
    /// Nothing moves.
    Static(BlockTree<StaticSlabs>),
    /// Bounds are linear in time.
    Moving(BlockTree<LinearSlabs>),
    /// The same in a space that moves along, or for parts of the shutter.
    Relative(Box<Relative>),
}

impl Blas {
    /// True where most of what trees hold are parts of strands: rays that have little in common are faster in turns than in
    /// packets.
    #[inline]
    pub fn is_of_strands(&self) -> bool {
        match self {
            Blas::Static(blocks) => blocks.strands,
            Blas::Moving(blocks) => blocks.strands,
            Blas::Relative(relative) => relative.trees.are_of_strands(),
        }
    }
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
    /// Groups that the tree refers to without a block.
    pub loose_groups: u64,
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
            loose_groups: self.loose_groups + o.loose_groups,
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
    /// Shared with whoever makes the tree.
    mesh: Arc<PlanarMesh>,
    /// Set from the start, but where it was left for later.
    tree: OnceLock<(Blas, BvhStats)>,
    bounds: LinearBox,
    radius: f32,
    /// What is known without the tree.
    stats: BvhStats,
}

impl ObjectGeometry {
    /// Builds the tree over a mesh, in parallel. Grids that cannot be traced (a vertex not finite, an
    /// index out of range) are left out and counted in [`BvhStats::dropped_grids`].
    pub fn new(mesh: DicedMesh) -> Self {
        Self::built(mesh).settled()
    }

    fn built(mesh: DicedMesh) -> Self {
        match relative::build(&mesh) {
            Some(found) => Self::relative(mesh, found),
            None => Self::in_own_space(mesh, false),
        }
    }

    /// Its vertices are where rays find them soon.
    fn settled(self) -> Self {
        hdtrapeze_pages::settle(self.mesh.floats());
        self
    }

    /// The same without a tree, which is made when it is first asked for, or by [`ObjectGeometry::make_tree`]. Micropolygons
    /// that are hit are the same; bounds and radius may be larger.
    pub fn later(mesh: DicedMesh) -> Self {
        let Outline {
            mesh,
            bounds,
            dropped,
        } = outline::outline(mesh);
        Self {
            bounds,
            radius: outline::STORED * bounds_reach(&bounds),
            stats: BvhStats {
                cells: mesh.cell_count() as u64,
                dropped_grids: dropped,
                mesh_bytes: mesh.bytes() as u64,
                ..BvhStats::default()
            },
            mesh: Arc::new(mesh),
            tree: OnceLock::new(),
        }
    }

    /// The same with a single tree, in the mesh's own space, however it moves: for comparison.
    pub fn plain(mesh: DicedMesh) -> Self {
        Self::in_own_space(mesh, false).settled()
    }

    /// The same with all bounds along the axes of space: for comparison.
    pub fn upright(mesh: DicedMesh) -> Self {
        Self::in_own_space(mesh, true).settled()
    }

    fn in_own_space(mesh: DicedMesh, upright: bool) -> Self {
        let how = How {
            upright,
            ..How::of(&mesh)
        };
        match mesh.is_moving() {
            true => build_blocks(mesh, false, how).object(Blas::Moving),
            false => build_blocks(mesh, false, how).object(Blas::Static),
        }
    }

    /// The same micropolygons, without normals and channels, with a tree of the [plain](Self::plain) kind.
    pub fn made_plain(&self) -> Self {
        Self::plain(self.mesh.bare())
    }

    fn relative(mesh: DicedMesh, found: Built) -> Self {
        let mesh = PlanarMesh::from(mesh);
        let stats = BvhStats {
            cells: mesh.cell_count() as u64,
            mesh_bytes: mesh.bytes() as u64,
            ..found.stats
        };
        Self {
            mesh: Arc::new(mesh),
            tree: OnceLock::from((Blas::Relative(Box::new(found.relative)), stats)),
            bounds: found.bounds,
            radius: found.bounds.max_abs(),
            stats,
        }
    }

    /// The mesh.
    pub fn mesh(&self) -> &PlanarMesh {
        &self.mesh
    }

    /// The tree, which is made where it was left for later: on a thread of its own, for which others that ask wait.
    #[inline]
    pub fn blas(&self) -> &Blas {
        match self.tree.get() {
            Some((blas, _)) => blas,
            None => self.made_alone(),
        }
    }

    #[cold]
    fn made_alone(&self) -> &Blas {
        let (blas, _) = self.tree.get_or_init(|| {
            let mesh = Arc::clone(&self.mesh);
            alone_or(move || tree_of(&mesh), || tree_of(&PlanarMesh::default()))
        });
        blas
    }

    /// Makes the tree, in parallel, where it was left for later. Nobody waits for it meanwhile: who needs it at once makes
    /// another, of the same bits.
    pub fn make_tree(&self) {
        if self.tree.get().is_none() {
            // Nothing is lost where another was faster.
            let _ = self.tree.set(tree_of(&self.mesh));
        }
    }

    /// True where the tree is there.
    pub fn has_tree(&self) -> bool {
        self.tree.get().is_some()
    }

    /// Axis-aligned bounds of all micropolygons over time, in the mesh's space relative to its
    /// origin; [`LinearBox::EMPTY`] when there are none.
    pub fn bounds(&self) -> &LinearBox {
        &self.bounds
    }
    /// Largest magnitude of any coordinate or stored bound, or more; 0 when there are none: the scale that
    /// rounding errors are measured by.
    pub fn radius(&self) -> f32 {
        self.radius
    }
    /// True when nothing can be hit.
    pub fn is_empty(&self) -> bool {
        self.bounds == LinearBox::EMPTY
    }
    /// Numbers about the tree; where it was left for later, those of the mesh alone.
    pub fn stats(&self) -> &BvhStats {
        self.tree.get().map_or(&self.stats, |(_, stats)| stats)
    }
}

/// The tree over a mesh that was left for later: the bits are those of [`ObjectGeometry::new`].
fn tree_of(mesh: &PlanarMesh) -> (Blas, BvhStats) {
    hdtrapeze_pages::settle(mesh.floats());
    let made = ObjectGeometry::built(mesh.bare());
    // It has a tree from the start.
    let nothing = || (Blas::Static(BlockTree::EMPTY), BvhStats::default());
    let (tree, stats) = made.tree.into_inner().unwrap_or_else(nothing);
    let mesh_bytes = mesh.bytes() as u64;
    (
        tree,
        BvhStats {
            mesh_bytes,
            ..stats
        },
    )
}

/// 0 for the box of nothing.
fn bounds_reach(bounds: &LinearBox) -> f32 {
    match *bounds == LinearBox::EMPTY {
        true => 0.0,
        false => bounds.max_abs(),
    }
}

/// A mesh and its tree.
pub(super) struct Blocks<B: Bounds8> {
    mesh: PlanarMesh,
    pub tree: BlockTree<B>,
    bounds: LinearBox,
    /// As [`ObjectGeometry::radius`].
    pub radius: f32,
    /// About the tree and the mesh.
    pub stats: BvhStats,
}

impl<B: Bounds8> Blocks<B> {
    fn object(self, kind: impl Fn(BlockTree<B>) -> Blas) -> ObjectGeometry {
        ObjectGeometry {
            mesh: Arc::new(self.mesh),
            tree: OnceLock::from((kind(self.tree), self.stats)),
            bounds: self.bounds,
            radius: self.radius,
            stats: self.stats,
        }
    }
}

/// Numbers about nodes.
struct About {
    /// As [`Bounds8::reach`].
    reach: f64,
    /// Those with a frame.
    oriented: u64,
    /// Those without one, and with diagonals.
    diagonal: u64,
}

impl About {
    const NOTHING: Self = Self {
        reach: 0.0,
        oriented: 0,
        diagonal: 0,
    };

    fn of<B: Bounds8>(nodes: &[Node<B>]) -> Self {
        nodes.iter().fold(Self::NOTHING, |all, node| {
            all.join(Self {
                reach: node.bounds.reach(),
                oriented: u64::from(node.frame != 0),
                diagonal: u64::from(node.frame == 0 && node.slots > CHILDREN),
            })
        })
    }

    fn join(self, o: Self) -> Self {
        Self {
            reach: self.reach.max(o.reach),
            oriented: self.oriented + o.oriented,
            diagonal: self.diagonal + o.diagonal,
        }
    }
}

/// Turns a mesh into rows and builds the tree over it, of full nodes where `full`, or where that costs no time.
pub(super) fn build_blocks<B: Bounds8>(mesh: DicedMesh, full: bool, how: How) -> Blocks<B> {
    let (mesh, parts): (PlanarMesh, Vec<Part<B>>) = gather(mesh, how);
    let mut bounds = LinearBox::EMPTY;
    let (mut reach, mut strips, mut dropped) = (0.0f64, 0, 0);
    for part in &parts {
        bounds = bounds.union(&part.bounds);
        reach = reach.max(part.reach);
        strips += part.strips;
        dropped += part.dropped;
    }
    let Gathered {
        blocks,
        frames,
        items,
    } = joined(parts);
    hdtrapeze_pages::settle(&blocks);
    let oriented_blocks = frames.len() as u64 - 1;
    let item_count = items.iter().map(Vec::len).sum::<usize>();
    let empty = item_count == 0;
    // Where strands are most of the items, so many that memory counts, full nodes cost no time either.
    let nodes = if full || 2 * strips > item_count {
        Nodes::Full
    } else {
        Nodes::Cheap
    };
    let strands = Strands {
        mesh: &mesh,
        level: Level::best(),
    };
    let tree: Tree<B> = build_sorted(
        items,
        nodes,
        (strips > 0 && !how.upright).then_some(&strands),
        &NEVER,
    );
    hdtrapeze_pages::settle(&tree.nodes);
    // Oriented bounds, and bounds as packed, may reach farther than any vertex: they are part of the radius.
    let about = tree.nodes.par_chunks(PARALLEL_ITEMS).map(About::of);
    let about = about.reduce(|| About::NOTHING, About::join);
    reach = reach.max(about.reach);
    let radius = if empty {
        0.0
    } else {
        bounds.max_abs().max(magnitude(reach))
    };
    let tree_nodes = tree.nodes.len() as u64;
    let bowing = Bowing::of(&mesh.key_times);
    let stats = BvhStats {
        nodes: tree_nodes,
        oriented_nodes: about.oriented,
        blocks: blocks.len() as u64,
        loose_groups: (item_count - blocks.len()) as u64,
        oriented_blocks,
        cells: mesh.cell_count() as u64,
        dropped_grids: dropped,
        bvh_bytes: (tree.bytes() + size_of_val(blocks.as_slice()) + size_of_val(frames.as_slice()))
            as u64,
        mesh_bytes: mesh.bytes() as u64,
    };
    Blocks {
        mesh,
        tree: BlockTree {
            tree,
            frames,
            blocks,
            diagonals: 2 * about.diagonal > tree_nodes,
            strands: 2 * strips > item_count,
            bowing,
        },
        bounds,
        radius,
        stats,
    }
}
