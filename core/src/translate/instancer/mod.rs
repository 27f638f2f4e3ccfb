//! Instancers: from raw arrays to where each instance is at any time of the shutter.
//!
//! `arrays` checks one instancer's arrays and chooses samples or rates, `moment` evaluates them at one
//! time, [`placements`] multiplies nested instancers. The rules are UsdGeomPointInstancer's:
//!
//! * Without rates every array is interpolated between its own samples: positions, scales and matrices
//!   linearly, orientations along the great arc. Key times are the union of all arrays' samples.
//! * With velocities or angular velocities that count (see [`crate::motion::rates`]) each array stays at
//!   its sample at or before the frame; `dt` seconds after that sample, an instance is at
//!   `p + dt (v + dt a / 2)` and has turned by `dt |w|` degrees about w, after its orientation.
//! * Samples of another length than the number of instances are not interpolated with.
//!
//! Between key times a path may bend (turning, accelerating, products of what moves): [`Placements::bends`]
//! says so, and who places instances adds keys.

mod arrays;
mod moment;
pub mod placements;
pub mod primvars;

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::DAffine3;
use rayon::prelude::*;

use crate::diagnostics::{Code, Warning};
use crate::motion::{Hierarchy, Shutter};
use crate::scene::InstancerDesc;
use crate::translate::blur::prim_shutter;
use crate::translate::primvar::Resolved;
use arrays::Arrays;
pub use arrays::instance_count;
use moment::{Moment, State};
pub use placements::{Moments, Placements};

/// An instancer, checked and resolved to a shutter.
#[derive(Debug)]
pub struct Instancer {
    /// Path, for messages.
    pub path: String,
    arrays: Arrays,
    hierarchy: Hierarchy,
    parent: Option<(Arc<Instancer>, u32)>,
    /// Instances that are there, by prototype.
    members: BTreeMap<u32, Members>,
    /// Those that are asked for and can be used, by name.
    primvars: BTreeMap<String, Arc<Resolved>>,
}

impl Instancer {
    /// Resolves `desc`, whose parent is resolved already. Never fails: where nothing can be placed there
    /// are no instances, and a warning says why.
    pub fn new(
        desc: &InstancerDesc,
        parent: Option<(Arc<Instancer>, u32)>,
        shutter: Shutter,
        warnings: &mut Vec<Warning>,
    ) -> Self {
        let shutter = prim_shutter(&desc.path, desc.blur_scale, shutter, warnings);
        let mut warn = |code, text: String| warnings.push(Warning::new(&desc.path, code, text));
        let hierarchy = Hierarchy::new(&desc.transform, shutter).map_err(|error| {
            warn(
                Code::NotFinite,
                format!("{error}; what it places is not rendered"),
            );
        });
        let arrays = Arrays::check(&desc.arrays, desc.nonlinear_samples, shutter, &mut warn);
        let members = match (&arrays, &hierarchy) {
            (Some(arrays), Ok(_)) => members(arrays, &mut warn),
            _ => BTreeMap::new(),
        };
        Self {
            path: desc.path.clone(),
            arrays: arrays.unwrap_or_default(),
            hierarchy: hierarchy.unwrap_or_default(),
            parent,
            members,
            primvars: BTreeMap::new(),
        }
    }

    /// Instances of a prototype that are there, in the order of the arrays, or of the host's list.
    pub fn members(&self, prototype: u32) -> &[u32] {
        &self.members_of(prototype).instances
    }

    fn members_of(&self, prototype: u32) -> &Members {
        static NONE: Members = Members {
            instances: Vec::new(),
            places: Vec::new(),
            of: 0,
        };
        self.members.get(&prototype).unwrap_or(&NONE)
    }

    /// How often a part of a prototype appears, nesting counted; at most `u64::MAX`.
    pub fn placement_count(&self, prototype: u32) -> u64 {
        let mut count = self.members(prototype).len() as u64;
        let mut next = self.parent.as_ref();
        while let Some((parent, prototype)) = next {
            count = count.saturating_mul(parent.members(*prototype).len() as u64);
            next = parent.parent.as_ref();
        }
        count
    }

    /// Prototypes that have any.
    pub fn prototypes(&self) -> impl Iterator<Item = u32> {
        self.members.keys().copied()
    }

    /// Prototype to instancer space of an instance at `time`.
    pub fn instance(&self, i: usize, time: f64) -> DAffine3 {
        self.arrays.at(time).matrix(i)
    }

    /// Whether matrices of instances turn between samples.
    pub fn matrices_turn(&self) -> bool {
        self.arrays.matrices_turn
    }

    /// Key times of its own arrays, [0, 1] across the shutter; `[0]` where they do not move.
    pub fn key_times(&self) -> &[f64] {
        &self.arrays.key_times
    }
}

/// Instances of a prototype that are there.
#[derive(Debug, Default)]
struct Members {
    /// Which of the arrays' values are theirs.
    instances: Vec<u32>,
    /// What ids number, of each: its place in the host's list. Empty: its index in the arrays.
    places: Vec<u32>,
    /// How many numbers there are for ids.
    of: usize,
}

impl Members {
    /// The number that ids show of one of them.
    fn number(&self, member: usize) -> usize {
        let numbers = if self.places.is_empty() {
            &self.instances
        } else {
            &self.places
        };
        numbers[member] as usize
    }
}

/// Sorts instances by prototype; what is masked or cannot be placed is left out.
fn members(arrays: &Arrays, warn: &mut impl FnMut(Code, String)) -> BTreeMap<u32, Members> {
    let (prototypes, mask) = (&arrays.given.prototypes, arrays.mask());
    let moments: Vec<Moment<'_>> = arrays.key_times.iter().map(|&t| arrays.at(t)).collect();
    let state = |i: usize| {
        if mask.get(i) == Some(&0) {
            return State::Masked;
        }
        // Flat only where it is at every key.
        let mut all = State::Flat;
        for moment in &moments {
            match moment.state(i) {
                State::NotFinite => return State::NotFinite,
                State::Flat => {}
                State::Placed | State::Masked => all = State::Placed,
            }
        }
        all
    };
    // One byte an instance, so that the slow part is parallel and the rest in order.
    let states: Vec<State> = (0..arrays.count)
        .into_par_iter()
        .with_min_len(4096)
        .map(state)
        .collect();
    let mut lost = 0usize;
    let mut flat = 0usize;
    let mut outside = 0usize;
    let prototype = |i: usize| match prototypes.get(i) {
        Some(&p) => u32::try_from(p).ok().filter(|&p| arrays.has_prototype(p)),
        None => Some(0),
    };
    let mut counts: BTreeMap<u32, usize> = BTreeMap::new();
    let lists = &arrays.given.lists;
    for (i, state) in states.iter().enumerate() {
        match (state, prototype(i)) {
            (State::Masked, _) => {}
            (_, None) => outside += 1,
            (State::NotFinite, _) => lost += 1,
            (State::Flat, _) => flat += 1,
            (State::Placed, Some(p)) => *counts.entry(p).or_default() += 1,
        }
    }
    let of = arrays.count;
    if outside > 0 {
        let known = match arrays.given.prototype_count {
            0 => "no prototype".to_owned(),
            n => format!("none of its {n} prototypes"),
        };
        let text = format!("{outside} of {of} protoIndices point at {known}; left out");
        warn(Code::Topology, text);
    }
    if lost > 0 {
        let text = format!("{lost} of {of} instances have no finite transform; left out");
        warn(Code::NotFinite, text);
    }
    if flat > 0 {
        let text = format!("{flat} of {of} instances are scaled to nothing; left out");
        warn(Code::NotFinite, text);
    }
    if !lists.is_empty() {
        let lists = (0..).zip(lists);
        return lists.map(|(p, list)| (p, listed(list, &states))).collect();
    }
    let mut members: BTreeMap<u32, Members> = counts
        .into_iter()
        .map(|(p, n)| {
            let members = Members {
                instances: Vec::with_capacity(n),
                places: Vec::new(),
                of: arrays.count,
            };
            (p, members)
        })
        .collect();
    for (i, state) in states.iter().enumerate() {
        if let (State::Placed, Some(p)) = (state, prototype(i))
            && let Some(members) = members.get_mut(&p)
        {
            members.instances.push(i as u32);
        }
    }
    members
}

/// Those of a prototype's list that are placed.
fn listed(list: &[i32], states: &[State]) -> Members {
    let placed = |&i: &i32| {
        let i = usize::try_from(i).ok()?;
        (*states.get(i)? == State::Placed).then_some(i as u32)
    };
    let each = (0..)
        .zip(list)
        .filter_map(|(place, i)| Some((placed(i)?, place)));
    let (instances, places) = each.unzip();
    Members {
        instances,
        places,
        of: list.len(),
    }
}

#[cfg(test)]
mod tests;
