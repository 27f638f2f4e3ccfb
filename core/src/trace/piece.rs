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
    /// Grids of its object; nothing for all.
    pub grids: Option<Range<usize>>,
}

/// Some of a world.
#[derive(Clone, Debug)]
pub struct Piece {
    /// It, relative to the origin of the whole.
    pub world: World,
    /// Of each of its instances the number in the whole, and the first of the grids in its object there.
    pub numbers: Vec<(u32, u32)>,
}

impl Parts<'_> {
    /// A piece of the world. Objects of which grids are picked have no normals and channels in there, and trees that
    /// are built anew.
    ///
    /// # Errors
    /// No memory.
    pub fn piece(&self, picks: &[Pick]) -> Result<Piece, WorldError> {
        type Cut = (*const ObjectGeometry, usize, usize);
        let mut cut: HashMap<Cut, Arc<ObjectGeometry>> = HashMap::new();
        let mut numbers = Vec::new();
        let mut sets = Vec::with_capacity(picks.len());
        for pick in picks {
            let whole = &self.world().sets[pick.set];
            let first = whole.first + pick.instances.start as u32;
            let first_grid = pick.grids.as_ref().map_or(0, |grids| grids.start as u32);
            numbers.extend((0..pick.instances.len() as u32).map(|i| (first + i, first_grid)));
            let mut object = whole.set.object();
            if let Some(grids) = &pick.grids {
                let key = (Arc::as_ptr(object), grids.start, grids.end);
                object = cut.entry(key).or_insert_with(|| {
                    let mesh = object.mesh().grids_of(grids.clone());
                    Arc::new(ObjectGeometry::plain(mesh))
                });
            }
            sets.push(WorldSet {
                set: Arc::new(whole.set.picked(object, &pick.instances)),
                user: whole.user,
                culled: whole.culled.clone(),
            });
        }
        let world = World::new(sets, self.world().origin(), &NEVER)?;
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
