//! The stage `bound` on the CPU: what it leaves for those after it, to tell what comes of bounds from what comes of trees.

use glam::Vec3;
use hdtrapeze_core::bvh::elsewhere::{Items, items};
use hdtrapeze_core::bvh::node::magnitude;
use hdtrapeze_core::bvh::object::loose_item;
use hdtrapeze_core::bvh::{Bounds8, LinearBox, LinearSlabs, StaticSlabs};
use hdtrapeze_core::grid::PlanarMesh;

use super::Planted;
use super::forest::Forest;
use super::trees::{FACTS, Places, ordered};
use crate::axes::FrameWords;
use crate::scene::{Unit, block_of};
use crate::stack::LEAF;

/// What is known of a forest once its items are bounded, as `bound.wgsl` leaves it.
pub(super) struct Bounded {
    pub boxes: Vec<i32>,
    pub references: Vec<u32>,
    pub facts: Vec<i32>,
    pub blocks: Vec<Unit>,
}

impl Bounded {
    /// Bounds the items of a forest; frames of its blocks go to their places among the words.
    pub fn new(planted: &Planted<'_>, words: &mut [u32]) -> Self {
        let Planted { forest, places, .. } = planted;
        let (items, units) = (forest.items as usize, forest.block_units() * forest.blocks);
        let mut out = Self {
            boxes: vec![0; items * floats(forest)],
            references: vec![0; items],
            facts: forest.no_facts(),
            blocks: vec![[0; 4]; units as usize],
        };
        let objects = planted.meshes.iter().zip(&forest.objects);
        for (number, (mesh, object)) in objects.enumerate() {
            let sound = mesh.sound_grids();
            for g in (0..mesh.grids.len()).filter(|&g| sound[g]) {
                let at = Place {
                    forest,
                    places,
                    object: number,
                    grid: object.first_grid + g as u32,
                };
                let traced = match forest.moves {
                    true => out.grid::<LinearSlabs>(mesh, g, &at, words),
                    false => out.grid::<StaticSlabs>(mesh, g, &at, words),
                };
                if traced.is_none() {
                    let word = FACTS * forest.objects.len() + at.grid as usize / 32;
                    out.facts[word] |= 1 << (at.grid % 32);
                }
            }
        }
        out
    }

    /// Adds the items of grid `g`; none where it cannot be traced.
    fn grid<B: Bounds8>(
        &mut self,
        mesh: &PlanarMesh,
        g: usize,
        at: &Place<'_>,
        words: &mut [u32],
    ) -> Option<()> {
        let [first, first_block] = at.forest.starts[at.grid as usize];
        match items::<B>(mesh, g)? {
            Items::Loose(boxes) => {
                for (slot, bounds) in (0..).zip(&boxes) {
                    let reference = LEAF | loose_item(g as u32, slot);
                    self.item(at, first + slot, bounds, reference, 0.0);
                }
            }
            Items::Blocks(blocks) => {
                for (slot, built) in (0..).zip(blocks) {
                    let number = first_block + slot;
                    let mut frame = 0;
                    if let Some(turning) = &built.frame {
                        let first = at.places.frames + at.forest.frame_words() * number;
                        let own = FrameWords::of(turning);
                        words[first as usize..][..own.words().len()].copy_from_slice(own.words());
                        frame = own.placed(first);
                    }
                    let place = number * at.forest.block_units();
                    let block = block_of(&built.block, frame);
                    self.blocks[place as usize..][..block.len()].copy_from_slice(&block);
                    let reference = LEAF | (at.places.blocks + place);
                    let reach = magnitude(built.block.bounds.reach());
                    self.item(at, first + slot, &built.aabb, reference, reach);
                }
            }
        }
        Some(())
    }

    /// Notes item `number`, whose block has planes as large as `reach`.
    fn item(
        &mut self,
        at: &Place<'_>,
        number: u32,
        bounds: &LinearBox,
        reference: u32,
        reach: f32,
    ) {
        let floats = floats(at.forest);
        let ends = [bounds.lo0, bounds.hi0, bounds.lo1, bounds.hi1];
        let all = ends.iter().flat_map(|v| v.to_array().map(ordered));
        let to = &mut self.boxes[number as usize * floats..][..floats];
        to.iter_mut().zip(all).for_each(|(to, x)| *to = x);
        self.references[number as usize] = reference;
        let facts = &mut self.facts[FACTS * at.object..][..FACTS];
        let centre: Vec3 = bounds.centre4();
        for (axis, centre) in centre.to_array().map(ordered).into_iter().enumerate() {
            facts[axis] = facts[axis].min(centre);
            facts[3 + axis] = facts[3 + axis].max(centre);
        }
        facts[6] = facts[6].max(ordered(reach.max(bounds.max_abs())));
    }
}

/// Numbers of a box.
fn floats(forest: &Forest) -> usize {
    if forest.moves { 12 } else { 6 }
}

/// Whose items are bounded.
struct Place<'a> {
    forest: &'a Forest,
    places: &'a Places,
    /// Its number in the forest.
    object: usize,
    /// Among the grids of all objects.
    grid: u32,
}
