//! The world: instances of objects under one tree, and the queries that a renderer asks of it.

use std::collections::HashSet;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use glam::{DAffine3, DVec3};
use hdtrapeze_simd::{Float, Level, Simd};
use rayon::prelude::*;

use super::instance::{Bounded, InstanceTransform};
use super::places::{InstanceSet, Record, Shift};
use super::sides::Culled;
use crate::alone::alone_or;
use crate::bvh::build::{Item, NEVER, Nodes, build_items};
use crate::bvh::{BvhStats, LinearBox, LinearSlabs, ObjectGeometry, StaticSlabs, Tree};

/// One appearance of an object.
#[derive(Clone, Debug)]
pub struct WorldInstance {
    /// What appears.
    pub object: Arc<ObjectGeometry>,
    /// Where.
    pub transform: InstanceTransform,
    /// Any number of the caller's.
    pub user: u32,
}

/// A set of instances in a world.
#[derive(Clone, Debug)]
pub struct WorldSet {
    /// The instances.
    pub set: Arc<InstanceSet>,
    /// Any number of the caller's.
    pub user: u32,
    /// What rays that ask for it pass through.
    pub culled: Option<Culled>,
}

/// A set as traced: its instances are numbered from `first`.
#[derive(Clone, Debug)]
pub(super) struct Numbered {
    pub set: Arc<InstanceSet>,
    pub first: u32,
    pub user: u32,
    pub(super) culled: Option<Culled>,
}

impl Numbered {
    fn made(&self) -> Option<&Arc<ObjectGeometry>> {
        self.set.made()
    }
}

/// The tree over instances: of the static kind where none moves, and also where only few do. These have a tree of
/// their own then, which is one item of the other, so that the nodes over all that is still store no second bounds,
/// and rays that do not come near what moves never ask for it.
#[derive(Clone, Debug)]
pub(super) enum TopTree {
    Static(Tree<StaticSlabs>),
    Moving(Tree<LinearSlabs>),
}

/// Item of a static tree over instances that stands for all that move; no instance has this number.
pub(super) const MOVERS: u32 = Tree::<StaticSlabs>::LEAF - 1;

/// Those that move have a tree of their own where they are no more than one in so many. Their common box holds
/// all of them at all times: where they are many, every ray would come by.
const FEW_MOVERS: usize = 8;

/// The tree over instances, and what stands apart.
#[derive(Clone, Debug)]
pub(super) struct Tops {
    pub top: TopTree,
    /// The item [`MOVERS`] of a static tree; elsewhere empty.
    pub movers: Tree<LinearSlabs>,
}

impl Tops {
    /// Once `cancel` is raised it ends soon, and is of no use.
    fn new(mut items: Vec<Item>, cancel: &AtomicBool) -> Self {
        let mut moving: Vec<Item> = Vec::new();
        let movers = items.iter().filter(|item| !item.bounds.is_static()).count();
        if few_move(movers, items.len()) {
            moving.extend(items.extract_if(.., |item| !item.bounds.is_static()));
            let boxes: Vec<(u32, LinearBox)> = moving.iter().map(|i| (i.id, i.bounds)).collect();
            items.extend(common(&boxes).map(|bounds| Item { bounds, id: MOVERS }));
        }
        let top = if items.iter().all(|item| item.bounds.is_static()) {
            TopTree::Static(build_items(items, Nodes::Full, cancel))
        } else {
            TopTree::Moving(build_items(items, Nodes::Full, cancel))
        };
        let movers = build_items(moving, Nodes::Full, cancel);
        Self { top, movers }
    }
}

/// True where so many of all instances move that they have a tree of their own.
pub fn few_move(movers: usize, all: usize) -> bool {
    movers * FEW_MOVERS <= all
}

/// Positions of so many bytes do not fit into caches. While debugging, also those of small worlds do not.
const FAR: usize = if cfg!(debug_assertions) {
    16 << 10
} else {
    64 << 20
};

/// Whether positions of all objects together, each of them once, are as many.
fn are_far(sets: &[Numbered]) -> bool {
    let mut seen = HashSet::new();
    let mut bytes = 0usize;
    sets.iter().any(|set| {
        if seen.insert(set.set.address()) {
            bytes = bytes.saturating_add(set.set.position_bytes());
        }
        bytes >= FAR
    })
}

/// What cannot be hit.
const NOTHING: Item = Item {
    bounds: LinearBox::EMPTY,
    id: 0,
};

/// Everything rays can hit.
#[derive(Clone, Debug)]
pub struct World {
    pub(super) sets: Vec<Numbered>,
    /// The set of each instance.
    set_of: Vec<u32>,
    /// Set from the start, but where it was left for later.
    tops: OnceLock<Tops>,
    pub(super) origin: DVec3,
    /// What instances' bounds are widened for.
    reach: f32,
    /// Bounds every instance's bounds, translation, and `sqrt(3) |M| radius`.
    pub(super) radius: f32,
    /// Largest condition of a transform.
    pub(super) condition: f32,
    /// See [`World::is_far`].
    pub(super) far: bool,
    /// Instances that cannot be hit.
    left_out: u64,
    /// Instructions that rays are traced with.
    pub(super) level: Level,
}

/// Why a world is not built.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WorldError {
    /// There is no memory for so many instances.
    #[error("no memory for {0} instances")]
    OutOfMemory(u64),
    /// Asked to stop.
    #[error("cancelled")]
    Cancelled,
}

/// Numbers about a world.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WorldStats {
    /// Instances, as given.
    pub instances: u64,
    /// Instances that cannot be hit: the object is empty, or the transform not finite or singular.
    pub left_out: u64,
    /// Different objects, but for those that are not made yet.
    pub objects: u64,
    /// Those of them whose tree is here by now: the others' are made where they are asked for.
    pub trees: u64,
    /// Objects' trees together; `cells` counts each object once.
    pub object: BvhStats,
    /// Nodes of the tree over instances, where that is here.
    pub top_nodes: u64,
    /// Bytes of the tree over instances, and of their transforms.
    pub top_bytes: u64,
    /// Micropolygons with each instance counted.
    pub instanced_cells: u64,
}

impl World {
    /// A world of instances with a set each, for few of them. Instance numbers of hits are positions in
    /// `instances`; for the rest see [`World::new`].
    ///
    /// # Panics
    /// No memory.
    pub fn build(instances: Vec<WorldInstance>, world_origin: DVec3) -> World {
        let sets = Self::sets_of(instances);
        Self::new(sets, world_origin, &NEVER).expect("memory for the instances")
    }

    /// The same as [`World::later`] leaves it.
    ///
    /// # Panics
    /// No memory.
    pub fn build_later(instances: Vec<WorldInstance>, world_origin: DVec3) -> World {
        let sets = Self::sets_of(instances);
        Self::later(sets, world_origin, &NEVER).expect("memory for the instances")
    }

    fn sets_of(instances: Vec<WorldInstance>) -> Vec<WorldSet> {
        let set = |i: WorldInstance| {
            let origin = i.object.mesh().origin;
            let set = match i.transform {
                InstanceTransform::Translation(by) => {
                    InstanceSet::translated(i.object, vec![Shift::new(by, origin, 0)])
                }
                InstanceTransform::Static(m) => {
                    InstanceSet::fixed(i.object, vec![Record::fixed(&m, origin, 0)])
                }
                InstanceTransform::Moving {
                    key_times,
                    mut matrices,
                } => {
                    matrices.resize(key_times.len(), DAffine3::NAN);
                    let keys = matrices.iter().map(|m| Record::key(m, origin, 0)).collect();
                    InstanceSet::moving(i.object, key_times.into(), keys)
                }
            };
            WorldSet {
                set: Arc::new(set),
                user: i.user,
                culled: None,
            }
        };
        instances.into_iter().map(set).collect()
    }

    /// Builds the tree over all instances, in parallel. Rays and answers are relative to
    /// `world_origin`, which is best near the camera. Instances are numbered set by set.
    ///
    /// # Errors
    /// More instances than there is memory or numbers for, or `cancel` was raised.
    pub fn new(
        sets: Vec<WorldSet>,
        world_origin: DVec3,
        cancel: &AtomicBool,
    ) -> Result<World, WorldError> {
        let (world, items) = Self::placed(sets, world_origin, cancel)?;
        let tops = Tops::new(items, cancel);
        if cancel.load(Ordering::Relaxed) {
            return Err(WorldError::Cancelled);
        }
        Ok(World {
            tops: OnceLock::from(tops),
            ..world
        })
    }

    /// The same without a tree over instances, which is made when a ray first asks for it, or by [`World::make_trees`].
    ///
    /// # Errors
    /// As [`World::new`].
    pub fn later(
        sets: Vec<WorldSet>,
        world_origin: DVec3,
        cancel: &AtomicBool,
    ) -> Result<World, WorldError> {
        Self::placed(sets, world_origin, cancel).map(|(world, _)| world)
    }

    /// A world without a tree, and what that is to be made over.
    fn placed(
        sets: Vec<WorldSet>,
        world_origin: DVec3,
        cancel: &AtomicBool,
    ) -> Result<(World, Vec<Item>), WorldError> {
        let total: u64 = sets.iter().map(|s| s.set.len() as u64).sum();
        let error = WorldError::OutOfMemory(total);
        if total >= u64::from(MOVERS) {
            return Err(error);
        }
        let mut set_of: Vec<u32> = Vec::new();
        let mut items: Vec<Item> = Vec::new();
        let total = total as usize;
        set_of.try_reserve_exact(total).map_err(|_| error)?;
        items.try_reserve_exact(total).map_err(|_| error)?;
        let mut numbered: Vec<Numbered> = Vec::with_capacity(sets.len());
        for (s, WorldSet { set, user, culled }) in sets.into_iter().enumerate() {
            let first = set_of.len() as u32;
            set_of.resize(set_of.len() + set.len(), s as u32);
            numbered.push(Numbered {
                set,
                first,
                user,
                culled,
            });
        }
        let mut world = World {
            sets: numbered,
            set_of,
            tops: OnceLock::new(),
            origin: world_origin,
            reach: 0.0,
            radius: 0.0,
            condition: 1.0,
            far: false,
            left_out: 0,
            level: Level::best(),
        };
        world.far = are_far(&world.sets);
        (world.reach, world.condition) = (0..total)
            .into_par_iter()
            .with_min_len(1024)
            .map_init(Vec::new, |scratch, i| {
                if cancel.load(Ordering::Relaxed) {
                    return (0.0, 1.0);
                }
                let bounded = world.bounded(i, scratch);
                bounded.map_or((0.0, 1.0), |b| (b.reach, b.condition))
            })
            .reduce(|| (0.0f32, 1.0f32), |a, b| (a.0.max(b.0), a.1.max(b.1)));
        world.bound_all(&mut items, cancel);
        if cancel.load(Ordering::Relaxed) {
            return Err(WorldError::Cancelled);
        }
        world.left_out = (total - items.len()) as u64;
        world.radius = items
            .par_iter()
            .map(|item| item.bounds.max_abs())
            .reduce(|| world.reach, f32::max);
        Ok((world, items))
    }

    fn bounded(&self, i: usize, scratch: &mut Vec<DAffine3>) -> Option<Bounded> {
        let set = &self.sets[self.set_of[i] as usize];
        Bounded::new(&set.set, i - set.first as usize, self.origin, scratch)
    }

    /// What is known of an instance where the tree over them is made; its bounds are empty where it cannot be hit.
    fn item(&self, i: usize, scratch: &mut Vec<DAffine3>) -> Item {
        let bounds = self.bounded(i, scratch);
        let bounds = bounds.map(|b| b.bounds.widen(b.pad(self.reach)));
        Item {
            bounds: bounds.unwrap_or(LinearBox::EMPTY),
            id: i as u32,
        }
    }

    /// All instances that can be hit. Bounds are found a second time rather than kept: they are as large as the tree.
    fn bound_all(&self, items: &mut Vec<Item>, cancel: &AtomicBool) {
        let bound = |scratch: &mut Vec<DAffine3>, i: usize| match cancel.load(Ordering::Relaxed) {
            true => NOTHING,
            false => self.item(i, scratch),
        };
        (0..self.set_of.len())
            .into_par_iter()
            .with_min_len(1024)
            .map_init(Vec::new, bound)
            .collect_into_vec(items);
        items.retain(|item| item.bounds != LinearBox::EMPTY);
    }

    /// The bounds of each instance that can be hit, by number: what a tree over instances is made over.
    pub fn boxes(&self) -> Vec<(u32, LinearBox)> {
        let mut items = Vec::new();
        self.bound_all(&mut items, &NEVER);
        let boxes = items.into_iter().map(|item| (item.id, item.bounds));
        boxes.collect()
    }

    /// The tree over instances, which is made where it was left for later, on a thread of its own.
    #[inline]
    pub(super) fn tops(&self) -> &Tops {
        match self.tops.get() {
            Some(tops) => tops,
            None => self.tops_alone(),
        }
    }

    #[cold]
    fn tops_alone(&self) -> &Tops {
        self.tops.get_or_init(|| {
            let mut scratch = Vec::new();
            // By this thread alone, which takes up no other work meanwhile.
            let items = (0..self.set_of.len()).map(|i| self.item(i, &mut scratch));
            let items = items.filter(|item| item.bounds != LinearBox::EMPTY);
            let items: Vec<Item> = items.collect();
            alone_or(
                move || Tops::new(items, &NEVER),
                || Tops::new(Vec::new(), &NEVER),
            )
        })
    }

    /// True where the tree over instances is there.
    pub fn has_tree(&self) -> bool {
        self.tops.get().is_some()
    }

    /// Makes all trees that were left for later, in parallel, before rays ask for one after the other; until `cancel` is
    /// raised.
    pub fn make_trees(&self, cancel: &AtomicBool) {
        let goes_on = || !cancel.load(Ordering::Relaxed);
        let later = self.objects().into_par_iter();
        let later = later.filter(|object| goes_on() && !object.has_tree());
        later.for_each(|object| object.make_tree());
        if self.tops.get().is_none() && goes_on() {
            let mut items = Vec::new();
            self.bound_all(&mut items, cancel);
            let tops = Tops::new(items, cancel);
            if goes_on() {
                // Nothing is lost where another was faster.
                let _ = self.tops.set(tops);
            }
        }
    }

    /// All objects, but for those that are not made yet, each once.
    fn objects(&self) -> Vec<&Arc<ObjectGeometry>> {
        let mut objects: Vec<_> = self.sets.iter().filter_map(Numbered::made).collect();
        objects.sort_unstable_by_key(|o| Arc::as_ptr(o));
        objects.dedup_by_key(|o| Arc::as_ptr(o));
        objects
    }

    /// Set and number in it of an instance.
    #[inline]
    pub(super) fn find(&self, instance: u32) -> (&Numbered, usize) {
        let set = &self.sets[self.set_of[instance as usize] as usize];
        (set, (instance - set.first) as usize)
    }

    /// True where positions of objects come from memory, most often, and not from caches: there are 64 MiB of them, those that are not made
    /// yet included.
    pub fn is_far(&self) -> bool {
        self.far
    }

    /// Bounds the magnitude of every coordinate of every instance, translations and `|M| radius`
    /// included: with a ray's origin, the scale that rounding is measured by.
    pub fn radius(&self) -> f32 {
        self.radius
    }

    /// Bounds the condition (product of the Frobenius norms of a matrix and its inverse) of every instance at every
    /// time, but where rays miss for it; see [`super::instance::CONDITION_LIMIT`].
    pub fn condition(&self) -> f32 {
        self.condition
    }

    /// The same world, traced with other instructions than the best that there are.
    #[must_use]
    pub fn with_level(self, level: Level) -> World {
        World { level, ..self }
    }

    /// What rays are relative to, in absolute world space.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Number of instances.
    pub fn instance_count(&self) -> usize {
        self.set_of.len()
    }

    /// Numbers about the world.
    pub fn stats(&self) -> WorldStats {
        let objects = self.objects();
        let (top_nodes, tree_bytes) = self.tops.get().map_or((0, 0), |tops| {
            let (nodes, bytes) = match &tops.top {
                TopTree::Static(t) => (t.nodes.len(), t.bytes()),
                TopTree::Moving(t) => (t.nodes.len(), t.bytes()),
            };
            let movers = &tops.movers;
            (nodes + movers.nodes.len(), bytes + movers.bytes())
        });
        let places: usize = self
            .sets
            .iter()
            .map(|s| size_of::<Numbered>() + size_of::<InstanceSet>() + s.set.bytes())
            .sum();
        let cells = |s: &Numbered| s.set.made().map_or(0, |o| o.stats().cells) * s.set.len() as u64;
        WorldStats {
            instances: self.set_of.len() as u64,
            left_out: self.left_out,
            objects: objects.len() as u64,
            object: objects
                .iter()
                .fold(BvhStats::default(), |s, o| s.plus(o.stats())),
            trees: objects.iter().filter(|o| o.has_tree()).count() as u64,
            top_nodes: top_nodes as u64,
            top_bytes: (tree_bytes + places + size_of_val(self.set_of.as_slice())) as u64,
            instanced_cells: self.sets.iter().map(cells).sum(),
        }
    }
}

/// A box that does not move and holds these at all times; none where there are none.
pub fn common(moving: &[(u32, LinearBox)]) -> Option<LinearBox> {
    let all = moving.iter().map(|&(_, bounds)| bounds);
    let all = all.reduce(|a, b| a.union(&b))?;
    let (lo, hi) = (all.lo0.min(all.lo1), all.hi0.max(all.hi1));
    Some(LinearBox {
        lo0: lo,
        hi0: hi,
        lo1: lo,
        hi1: hi,
    })
}

/// Time in [0, 1]; NaN becomes 0.
#[inline]
pub(super) fn clamp_time(time: f32) -> f32 {
    if time.is_nan() {
        0.0
    } else {
        time.clamp(0.0, 1.0)
    }
}

/// The same for many.
#[inline(always)]
pub(super) fn clamp_times<S: Simd>(simd: S, time: S::F16) -> S::F16 {
    time.max(simd.all16(0.0)).min(simd.all16(1.0))
}

#[cfg(test)]
mod tests {
    use super::super::deferred::Deferred;
    use super::*;
    use crate::grid::{DicedMesh, Grid};

    /// Grids whose positions take half of what is far, and a little more.
    fn half() -> Arc<ObjectGeometry> {
        const SIZE: usize = 4;
        let count = FAR / size_of::<[f32; 3]>() / 2 / SIZE + 1;
        let grid = |i: usize| Grid {
            first_vertex: (i * SIZE) as u32,
            element: 0,
            nu: 1,
            nv: 1,
        };
        let mesh = DicedMesh {
            key_times: vec![0.0],
            grids: (0..count).map(grid).collect(),
            vertex_count: count * SIZE,
            positions: vec![glam::Vec3::ONE; count * SIZE],
            ..DicedMesh::default()
        };
        Arc::new(ObjectGeometry::new(mesh))
    }

    #[test]
    fn a_world_is_far_by_all_of_its_objects_each_once() {
        let place = || Shift::new(DVec3::ZERO, DVec3::ZERO, 0);
        let made = |object: &Arc<ObjectGeometry>| {
            InstanceSet::translated(object.clone(), vec![place(); 3])
        };
        let (a, b) = (half(), half());
        let later = |bytes: usize| {
            let make = Arc::new(|| ObjectGeometry::new(DicedMesh::default()));
            InstanceSet::deferred(
                Arc::new(Deferred::new(LinearBox::EMPTY, bytes, make)),
                place(),
            )
        };
        let far = |sets: Vec<InstanceSet>| {
            let sets = sets.into_iter().map(|set| WorldSet {
                set: Arc::new(set),
                user: 0,
                culled: None,
            });
            let world = World::new(sets.collect(), DVec3::ZERO, &NEVER).expect("a world");
            world.is_far()
        };
        assert!(a.mesh().position_bytes() < FAR);
        assert!(!far(vec![]) && !far(vec![made(&a)]) && !far(vec![made(&a), made(&a)]));
        assert!(far(vec![made(&a), made(&b)]));
        // Those that are not made count as expected.
        assert!(!far(vec![made(&a), later(FAR / 4)]));
        assert!(far(vec![made(&a), later(FAR / 2)]));
        assert!(far(vec![later(FAR / 2), later(FAR / 2)]));
        assert!(far(vec![later(usize::MAX), made(&a)]));
        // Those that were, as they are.
        let empty = later(FAR);
        assert_eq!(empty.object().mesh().position_bytes(), 0);
        assert!(!far(vec![made(&a), empty]));
    }
}
