//! What a world is made of, for those that trace it elsewhere: on a GPU.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};

use super::places::{InstanceSet, Places};
use super::sides::Culled;
use super::world::{MOVERS, TopTree, World};
use crate::bvh::{LinearSlabs, StaticSlabs, Tree};

/// The tree over instances.
#[derive(Clone, Copy, Debug)]
pub enum Top<'a> {
    /// Nothing moves but what `movers` holds: the tree's item [`Parts::MOVERS`] stands for all of it.
    Static {
        /// Over what is still.
        tree: &'a Tree<StaticSlabs>,
        /// Over what moves; may be empty.
        movers: &'a Tree<LinearSlabs>,
    },
    /// Over everything.
    Moving(&'a Tree<LinearSlabs>),
}

/// Where an instance is: how its object's positions reach the world, relative to the world's origin.
#[derive(Clone, Debug, PartialEq)]
pub enum Placement {
    /// Moved by this.
    Translated(DVec3),
    /// A matrix that does not move: the inverse of its linear part, and where the object's origin is.
    Fixed {
        /// From the world to the object.
        inverse: DMat3,
        /// The object's origin.
        origin: DVec3,
    },
    /// Matrices to the world at key times, straight between.
    Moving {
        /// Ascending from 0 to 1.
        key_times: Vec<f32>,
        /// One a key.
        matrices: Vec<DAffine3>,
    },
}

/// See the module's text.
#[derive(Clone, Copy, Debug)]
pub struct Parts<'a> {
    world: &'a World,
}

impl World {
    /// What the world is made of.
    pub fn parts(&self) -> Parts<'_> {
        Parts { world: self }
    }
}

impl<'a> Parts<'a> {
    /// The world.
    pub fn world(&self) -> &'a World {
        self.world
    }

    /// Item of a static tree over instances that stands for all that move.
    pub const MOVERS: u32 = MOVERS;

    /// The tree over instances, which is made where it was left for later; its items are their numbers.
    pub fn top(&self) -> Top<'a> {
        match &self.world.tops().top {
            TopTree::Static(tree) => Top::Static {
                tree,
                movers: &self.world.tops().movers,
            },
            TopTree::Moving(tree) => Top::Moving(tree),
        }
    }

    /// The sets of instances, in the order of their numbers.
    pub fn sets(&self) -> impl ExactSizeIterator<Item = &'a Arc<InstanceSet>> {
        self.world.sets.iter().map(|numbered| &numbered.set)
    }

    /// What rays that ask for it pass through, of instance number `instance`.
    pub fn culled(&self, instance: u32) -> Option<&'a Culled> {
        self.world.find(instance).0.culled.as_ref()
    }

    /// Where instance number `instance` is.
    pub fn placement(&self, instance: u32) -> Placement {
        let (numbered, i) = self.world.find(instance);
        numbered.set.placement(i, self.world.origin)
    }
}

impl InstanceSet {
    fn placement(&self, i: usize, world_origin: DVec3) -> Placement {
        match &self.places {
            Places::Translated(shifts) => Placement::Translated(shifts[i].origin - world_origin),
            Places::Fixed(records) => Placement::Fixed {
                inverse: records[i].matrix(),
                origin: records[i].origin - world_origin,
            },
            Places::Moving { key_times, records } => Placement::Moving {
                key_times: key_times.to_vec(),
                matrices: records[i * key_times.len()..][..key_times.len()]
                    .iter()
                    .map(|record| record.at_key(world_origin))
                    .collect(),
            },
        }
    }
}
