//! Pieces of a world that is too large for one place: each is a world of its own, with fewer instances or with some
//! grids of an object. The nearest of the hits in all pieces is the hit in the world.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

use super::parts::Parts;
use super::places::{InstanceSet, Places};
use super::world::{World, WorldError, WorldSet};
use crate::bvh::ObjectGeometry;
use crate::bvh::build::NEVER;

/// What a piece takes of one set.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pick {
    /// Number of the set.
    pub set: usize,
    /// Instances of it.
    pub instances: Range<usize>,
    /// Numbers of grids of its object, without order; nothing for all.
    pub grids: Option<Arc<[u32]>>,
}

/// Some of a world.
#[derive(Clone, Debug)]
pub struct Piece {
    /// It, relative to the origin of the whole.
    pub world: World,
    /// Of each of its instances what it is of the whole.
    pub numbers: Vec<InWhole>,
}

/// What an instance of a piece is of the whole.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InWhole {
    /// Its number there.
    pub instance: u32,
    /// The number there of each grid of its object, where these are not all.
    pub grids: Option<Arc<[u32]>>,
}

/// Where the trees of a piece are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trees {
    /// Here, at once.
    Now,
    /// Elsewhere, or when they are asked for.
    Later,
}

impl Parts<'_> {
    /// A piece of the world. Objects of which grids are picked have no normals and channels in there, and trees of
    /// their own.
    ///
    /// # Errors
    /// No memory.
    pub fn piece(&self, picks: &[Pick], trees: Trees) -> Result<Piece, WorldError> {
        type Cut = (*const ObjectGeometry, *const u32);
        let mut cut: HashMap<Cut, Arc<ObjectGeometry>> = HashMap::new();
        let mut numbers = Vec::new();
        let mut sets = Vec::with_capacity(picks.len());
        for pick in picks {
            let whole = &self.world().sets[pick.set];
            let first = whole.first + pick.instances.start as u32;
            numbers.extend((0..pick.instances.len() as u32).map(|i| InWhole {
                instance: first + i,
                grids: pick.grids.clone(),
            }));
            let mut object = whole.set.object();
            if let Some(grids) = &pick.grids {
                let key = (Arc::as_ptr(object), grids.as_ptr());
                object = cut.entry(key).or_insert_with(|| {
                    let mesh = object.mesh().grids_of(grids);
                    Arc::new(match trees {
                        Trees::Now => ObjectGeometry::plain(mesh),
                        Trees::Later => ObjectGeometry::later(mesh),
                    })
                });
            }
            sets.push(WorldSet {
                set: Arc::new(whole.set.picked(object, &pick.instances)),
                user: whole.user,
                culled: whole.culled.clone(),
            });
        }
        let origin = self.world().origin();
        let world = match trees {
            Trees::Now => World::new(sets, origin, &NEVER)?,
            Trees::Later => World::later(sets, origin, &NEVER)?,
        };
        Ok(Piece { world, numbers })
    }
}

impl InstanceSet {
    /// Some of the instances, of another object with the same origin.
    fn picked(&self, object: &Arc<ObjectGeometry>, instances: &Range<usize>) -> Self {
        let object = Arc::clone(object);
        match &self.places {
            Places::Translated(shifts) => {
                Self::translated(object, shifts[instances.clone()].to_vec())
            }
            Places::Fixed(records) => Self::fixed(object, records[instances.clone()].to_vec()),
            Places::Moving { key_times, records } => {
                let keys = key_times.len();
                let records = &records[instances.start * keys..instances.end * keys];
                Self::moving(object, key_times.clone(), records.to_vec())
            }
        }
    }
}
