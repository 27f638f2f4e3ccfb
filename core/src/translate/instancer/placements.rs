//! Every appearance of a prim: instances of its instancer, times those of the instancer's parent, and so
//! on, outermost first.
//!
//! Placements are numbered, and evaluated from their number: nothing is stored for each.

use std::sync::Arc;

use glam::DAffine3;

use super::moment::Moment;
use super::{Instancer, Members};
use crate::motion::{Hierarchy, keys};

/// One instancer of a chain.
#[derive(Debug)]
pub(super) struct Link {
    pub(super) instancer: Arc<Instancer>,
    prototype: u32,
}

impl Link {
    pub(super) fn members(&self) -> &Members {
        self.instancer.members_of(self.prototype)
    }

    /// How many instances of it there are.
    fn len(&self) -> u64 {
        self.members().instances.len() as u64
    }
}

/// See the module.
#[derive(Debug)]
pub struct Placements {
    /// Outermost first; at least one.
    pub(super) links: Vec<Link>,
    /// The prim's own levels, inside its prototype.
    prim: Hierarchy,
}

/// What is the same for every placement at one time.
#[derive(Debug)]
struct Instant<'a> {
    /// One a link: its arrays, and the instancer's own matrix.
    links: Vec<(Moment<'a>, DAffine3)>,
    prim: DAffine3,
}

/// Placements at a list of times.
#[derive(Debug)]
pub struct Moments<'a> {
    of: &'a Placements,
    instants: Vec<Instant<'a>>,
}

impl Placements {
    /// Of a prim with this transform that is part of a prototype of `instancer`.
    pub fn new(instancer: Arc<Instancer>, prototype: u32, prim: Hierarchy) -> Self {
        let mut links = vec![Link {
            instancer,
            prototype,
        }];
        while let Some((parent, prototype)) = links.last().and_then(|l| l.instancer.parent.clone())
        {
            links.push(Link {
                instancer: parent,
                prototype,
            });
        }
        links.reverse();
        Self { links, prim }
    }

    /// How many there are, at most `u64::MAX`.
    pub fn count(&self) -> u64 {
        self.links
            .iter()
            .fold(1u64, |n, link| n.saturating_mul(link.len()))
    }

    /// Times, in [0, 1] across the shutter, between which every array and every level goes its own way
    /// without a corner; `[0]` when nothing moves.
    pub fn key_times(&self) -> Vec<f64> {
        let mut lists = vec![self.prim.key_times()];
        for link in &self.links {
            lists.push(link.instancer.arrays.key_times.clone());
            lists.push(link.instancer.hierarchy.key_times());
        }
        keys::union(lists.iter().map(Vec::as_slice))
    }

    /// True where matrices need not go straight from key to key: an array or a level bends, or moving
    /// things multiply.
    pub fn bends(&self) -> bool {
        let moving = |link: &Link| {
            let own = usize::from(link.instancer.arrays.key_times.len() > 1);
            own + link.instancer.hierarchy.moving_levels()
        };
        let factors: usize = self.links.iter().map(moving).sum();
        factors + self.prim.moving_levels() > 1
            || self.prim.turns()
            || self
                .links
                .iter()
                .any(|link| link.instancer.arrays.bends || link.instancer.hierarchy.turns())
    }

    /// Degrees that a placement spins by over the shutter, whatever its keys show of it.
    pub fn spin(&self, number: u64) -> f64 {
        let mut spin = 0.0;
        self.digits(number, |link, member| {
            let i = link.members().instances[member];
            spin += link.instancer.arrays.spin(i as usize);
        });
        spin
    }

    /// What the instanceId AOV shows: for one instancer its number for the instance; for nested ones
    /// the flat number with the outermost instancer's index first, modulo 2^31.
    pub fn id(&self, number: u64) -> i32 {
        let mut flat = 0u64;
        let mut own = 0;
        self.digits(number, |link, member| {
            let members = link.members();
            let i = members.number(member);
            flat = flat.wrapping_mul(members.of as u64).wrapping_add(i as u64);
            own = link.instancer.arrays.id(i);
        });
        match self.links.len() {
            1 => own,
            _ => (flat & 0x7fff_ffff) as i32,
        }
    }

    /// The matrix of one placement at `time`; for many see [`Moments::walker`].
    pub fn matrix(&self, number: u64, time: f64) -> DAffine3 {
        self.at(&[time]).walker().matrices(number)[0]
    }

    /// Placements at `times`.
    pub fn at(&self, times: &[f64]) -> Moments<'_> {
        let own = |link: &'_ Link, time| link.instancer.hierarchy.matrix(time);
        let instant = |&time: &f64| Instant {
            links: self
                .links
                .iter()
                .map(|link| (link.instancer.arrays.at(time), own(link, time)))
                .collect(),
            prim: self.prim.matrix(time),
        };
        let instants = times.iter().map(instant).collect();
        Moments { of: self, instants }
    }

    /// Calls `f` with each link, outermost first, and which of its members it is.
    pub(super) fn digits(&self, number: u64, mut f: impl FnMut(&Link, usize)) {
        let mut rest = number;
        let mut below: u64 = self.count();
        for link in &self.links {
            below /= link.len();
            f(link, (rest / below) as usize);
            rest %= below;
        }
    }
}

impl<'a> Moments<'a> {
    /// Evaluates placements; best in ascending order, since neighbours share their outer instances.
    pub fn walker(&'a self) -> Walker<'a> {
        Walker {
            of: self,
            above: Vec::with_capacity(self.instants.len()),
            above_of: None,
            matrices: Vec::with_capacity(self.instants.len()),
        }
    }
}

/// See [`Moments::walker`].
#[derive(Debug)]
pub struct Walker<'a> {
    of: &'a Moments<'a>,
    /// At each time: everything above the arrays of the innermost instancer.
    above: Vec<DAffine3>,
    above_of: Option<u64>,
    matrices: Vec<DAffine3>,
}

impl Walker<'_> {
    /// Prim to world of placement `number`, one matrix a time.
    pub fn matrices(&mut self, number: u64) -> &[DAffine3] {
        self.matrices.clear();
        let Some((inner, outer)) = self.of.of.links.split_last() else {
            return &self.matrices;
        };
        let members = &inner.members().instances;
        let width = members.len() as u64;
        let instants = &self.of.instants;
        if self.above_of != Some(number / width) {
            self.above_of = Some(number / width);
            self.above.clear();
            let above = instants.iter().map(|t| t.above(outer, number / width));
            self.above.extend(above);
        }
        let i = members[(number % width) as usize] as usize;
        let each = self.above.iter().zip(instants);
        self.matrices.extend(each.map(|(above, instant)| {
            let (moment, _) = &instant.links[outer.len()];
            *above * (moment.matrix(i) * instant.prim)
        }));
        &self.matrices
    }
}

impl Instant<'_> {
    /// The product of everything above the innermost instancer's arrays: its own matrix included.
    fn above(&self, outer: &[Link], number: u64) -> DAffine3 {
        let mut below: u64 = outer.iter().map(Link::len).product();
        let mut rest = number;
        let mut product = DAffine3::IDENTITY;
        for (link, (moment, own)) in outer.iter().zip(&self.links) {
            let members = &link.members().instances;
            below /= members.len() as u64;
            let i = members[(rest / below) as usize] as usize;
            rest %= below;
            product = product * *own * moment.matrix(i);
        }
        product * self.links[outer.len()].1
    }
}
