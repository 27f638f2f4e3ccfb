//! The world: instances of objects under one tree, and the queries that a renderer asks of it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use glam::{DAffine3, DVec3, Vec3};
use hdtrapeze_simd::Level;
use rayon::prelude::*;

use super::instance::{Bounded, InstanceTransform};
use super::places::{InstanceSet, Record, Shift};
use super::sides::Culled;
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

/// Everything rays can hit.
#[derive(Clone, Debug)]
pub struct World {
    pub(super) sets: Vec<Numbered>,
    /// The set of each instance.
    set_of: Vec<u32>,
    pub(super) top: TopTree,
    /// The item [`MOVERS`] of a static tree; elsewhere empty.
    pub(super) movers: Tree<LinearSlabs>,
    pub(super) origin: DVec3,
    /// Bounds every instance's bounds, translation, and `sqrt(3) |M| radius`.
    pub(super) radius: f32,
    /// Largest condition of a transform.
    pub(super) condition: f32,
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
    /// Objects' trees together; `cells` counts each object once.
    pub object: BvhStats,
    /// Nodes of the tree over instances.
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
        let sets = instances.into_iter().map(set).collect();
        Self::new(sets, world_origin, &NEVER).expect("memory for the instances")
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
        let bounded = |i: usize, scratch: &mut Vec<DAffine3>| {
            if cancel.load(Ordering::Relaxed) {
                return None;
            }
            let set = &numbered[set_of[i] as usize];
            Bounded::new(&set.set, i - set.first as usize, world_origin, scratch)
        };
        let (reach, condition) = (0..total)
            .into_par_iter()
            .with_min_len(1024)
            .map_init(Vec::new, |scratch, i| {
                bounded(i, scratch).map_or((0.0, 1.0), |b| (b.reach, b.condition))
            })
            .reduce(|| (0.0f32, 1.0f32), |a, b| (a.0.max(b.0), a.1.max(b.1)));
        // Bounds are found a second time rather than kept: they are as large as the tree.
        (0..total)
            .into_par_iter()
            .with_min_len(1024)
            .map_init(Vec::new, |scratch, i| {
                let bounds = bounded(i, scratch).map(|b| b.bounds.widen(b.pad(reach)));
                Item {
                    bounds: bounds.unwrap_or(LinearBox::EMPTY),
                    id: i as u32,
                    along: Vec3::ZERO,
                }
            })
            .collect_into_vec(&mut items);
        items.retain(|item| item.bounds != LinearBox::EMPTY);
        let left_out = (total - items.len()) as u64;
        let radius = items
            .par_iter()
            .map(|item| item.bounds.max_abs())
            .reduce(|| reach, f32::max);
        let mut moving: Vec<Item> = Vec::new();
        let movers = items.iter().filter(|item| !item.bounds.is_static()).count();
        if movers * FEW_MOVERS <= items.len() {
            moving.extend(items.extract_if(.., |item| !item.bounds.is_static()));
            items.extend(common(&moving));
        }
        let top = if items.iter().all(|item| item.bounds.is_static()) {
            TopTree::Static(build_items(items, Nodes::Full, cancel))
        } else {
            TopTree::Moving(build_items(items, Nodes::Full, cancel))
        };
        let movers = build_items(moving, Nodes::Full, cancel);
        if cancel.load(Ordering::Relaxed) {
            return Err(WorldError::Cancelled);
        }
        Ok(World {
            sets: numbered,
            set_of,
            top,
            movers,
            origin: world_origin,
            radius,
            condition,
            left_out,
            level: Level::best(),
        })
    }

    /// Set and number in it of an instance.
    #[inline]
    pub(super) fn find(&self, instance: u32) -> (&Numbered, usize) {
        let set = &self.sets[self.set_of[instance as usize] as usize];
        (set, (instance - set.first) as usize)
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
        let made = |s| Numbered::made(s);
        let mut objects: Vec<&Arc<ObjectGeometry>> = self.sets.iter().filter_map(made).collect();
        objects.sort_unstable_by_key(|o| Arc::as_ptr(o));
        objects.dedup_by_key(|o| Arc::as_ptr(o));
        let (top_nodes, tree_bytes) = match &self.top {
            TopTree::Static(t) => (t.nodes.len(), t.bytes()),
            TopTree::Moving(t) => (t.nodes.len(), t.bytes()),
        };
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
            top_nodes: (top_nodes + self.movers.nodes.len()) as u64,
            top_bytes: (tree_bytes
                + self.movers.bytes()
                + places
                + size_of_val(self.set_of.as_slice())) as u64,
            instanced_cells: self.sets.iter().map(cells).sum(),
        }
    }
}

/// All that move as one item that does not; none where nothing moves.
fn common(moving: &[Item]) -> Option<Item> {
    let all = moving.iter().map(|item| item.bounds);
    let all = all.reduce(|a, b| a.union(&b))?;
    let (lo, hi) = (all.lo0.min(all.lo1), all.hi0.max(all.hi1));
    let bounds = LinearBox {
        lo0: lo,
        hi0: hi,
        lo1: lo,
        hi1: hi,
    };
    Some(Item {
        bounds,
        id: MOVERS,
        along: Vec3::ZERO,
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
