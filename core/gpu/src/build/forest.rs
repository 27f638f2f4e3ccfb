//! What trees are made over, as it follows from the rates of grids alone.

use hdtrapeze_core::bvh::block;
use hdtrapeze_core::bvh::object::LOOSE_GRIDS;
use hdtrapeze_core::grid::{Grid, PlanarMesh};
use hdtrapeze_shaders::layout::{BuildObject, Object};

use crate::axes::{FRAME_WORDS, TURN_WORDS};

/// Objects whose trees are made together: all that move, or all that do not.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Forest {
    /// Bounds have two ends.
    pub moves: bool,
    pub objects: Vec<BuildObject>,
    /// Numbers of the objects in the scene.
    pub numbers: Vec<u32>,
    /// For each grid of all objects its first item, and its first block.
    pub starts: Vec<[u32; 2]>,
    /// Items of all objects.
    pub items: u32,
    /// Those that are blocks.
    pub blocks: u32,
    /// Items of the largest object.
    pub most_items: u32,
}

impl Forest {
    /// A single tree over so many boxes, which are known already: it has neither grids nor blocks.
    pub fn over(boxes: u32, moves: bool) -> Self {
        Self {
            moves,
            objects: vec![BuildObject::default()],
            numbers: Vec::new(),
            starts: vec![[0, 0]],
            items: boxes,
            blocks: 0,
            most_items: boxes,
        }
    }

    /// Words that are kept for the frame of a block.
    pub fn frame_words(&self) -> u32 {
        if self.moves { TURN_WORDS } else { FRAME_WORDS }
    }

    /// Adds an object, which the scene has under `number`. False where there are more items than can be numbered.
    #[must_use]
    pub fn add(&mut self, mesh: &PlanarMesh, number: u32, object: &Object) -> bool {
        self.objects.push(BuildObject {
            first_grid: self.starts.len() as u32,
            grids: object.grids,
            vertices: object.vertices,
            key_times: object.key_times,
            key_count: object.key_count,
        });
        self.numbers.push(number);
        let first = self.items;
        for (g, (grid, sound)) in (0..).zip(mesh.grids.iter().zip(mesh.sound_grids())) {
            self.starts.push([self.items, self.blocks]);
            if !sound {
                continue;
            }
            let (items, blocks) = items_of(g, grid);
            // The highest bits mark what a number is of.
            if self.items >= 1 << 29 {
                return false;
            }
            self.items += items;
            self.blocks += blocks;
        }
        self.most_items = self.most_items.max(self.items - first);
        true
    }

    /// True where the same trees may be over both, wherever grids and vertices are.
    pub fn is_alike(&self, other: &Self) -> bool {
        let keys = |forest: &Self| -> Vec<u32> {
            let objects = forest.objects.iter();
            objects.map(|object| object.key_count).collect()
        };
        self.moves == other.moves
            && self.numbers == other.numbers
            && self.starts == other.starts
            && self.items == other.items
            && self.blocks == other.blocks
            && keys(self) == keys(other)
            && self.firsts().eq(other.firsts())
    }

    fn firsts(&self) -> impl Iterator<Item = u32> {
        self.objects.iter().map(|object| object.first_grid)
    }

    /// Units of 16 bytes of a node.
    pub fn node_units(&self) -> u32 {
        if self.moves { 12 } else { 7 }
    }

    /// Units of 16 bytes of a block.
    pub fn block_units(&self) -> u32 {
        if self.moves { 10 } else { 6 }
    }

    /// The most nodes that there may be: those of less than 8 children have items below them only, two or more.
    pub fn most_nodes(&self) -> u32 {
        (u64::from(self.items) * 4 / 7) as u32
    }

    /// What is known of objects and grids before anything is bounded, as `items.wgsl` has it.
    pub fn no_facts(&self) -> Vec<i32> {
        let none = [
            i32::MAX,
            i32::MAX,
            i32::MAX,
            i32::MIN,
            i32::MIN,
            i32::MIN,
            0,
        ];
        let mut facts = none.repeat(self.objects.len());
        facts.resize(facts.len() + self.starts.len().div_ceil(32), 0);
        facts
    }

    /// Bits of an axis of a Morton number: some more than are needed to tell the items of a surface apart.
    pub fn bits(&self) -> u32 {
        let needed = (u32::BITS - self.most_items.leading_zeros()) / 2 + 4;
        needed.clamp(6, 16).min((63 - self.object_bits()) / 3)
    }

    /// Bits that keys have.
    pub fn key_bits(&self) -> u32 {
        // One for items that are dropped, which come last.
        3 * self.bits() + self.object_bits() + 1
    }

    fn object_bits(&self) -> u32 {
        u32::BITS - (self.objects.len() as u32).leading_zeros()
    }
}

/// Items of grid `number`, and how many of them are blocks: all, or none.
pub(crate) fn items_of(number: u32, grid: &Grid) -> (u32, u32) {
    match loose_count(number, grid) {
        0 => {
            let blocks = block::cut(number, grid).count() as u32;
            (blocks, blocks)
        }
        loose => (loose, 0),
    }
}

/// Loose groups of grid `number`; none where it is cut into blocks. As `bound.wgsl` has it.
fn loose_count(number: u32, grid: &Grid) -> u32 {
    let loose = block::is_small(grid) || block::is_strip(grid);
    match loose && number < LOOSE_GRIDS {
        true => block::loose_slots(grid, false).end,
        false => 0,
    }
}
