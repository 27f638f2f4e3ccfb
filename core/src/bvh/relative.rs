//! Trees for motion that one chord from open to close of the shutter bounds badly.
//!
//! Bounds are linear in time, and where points run along curves they are raised until they contain what
//! a chord misses ([`super::linear`]). That is little for most motion, but a blade of a propeller would be
//! bounded by a good part of its disc. Two things help, and are chosen by the surface area of a sample:
//!
//! - **A carried space** ([`super::carrier`]): the tree is built over positions relative to a rotation and a
//!   translation that the whole object follows. What is rigid does not move there, and has a tree that does not either.
//! - **Parts of the shutter**: a tree of its own for the time before an instant, most often a key, and one for that after it. Each is
//!   half as long, and strays a quarter as far. This doubles the memory, but for nodes that are fuller, so there are no more than two.
//!   Strands that go apart from each other gain by that however straight they go ([`super::sway`]), and are parted half way between two keys, too.
//!
//! Trees are built by [`super::build`] over a *model*: a mesh with the positions that the tree sees. Rays are taken
//! to carried space and to a part's time before they meet it. Micropolygons are tested in the mesh's own space,
//! so hits have the same bits as without.
//!
//! **Rounding.** A part from time `a` to `b` sees time `t` as `(t - a) / (b - a)`, and each of its keys likewise.
//! In f32 each is off by at most 3 roundings of at most 1 (difference, difference, quotient), and so `6 U` together;
//! over a motion of at most 2 radii that is `12 U` radii. A model's positions, found in f64, are rounded once: `1 U`
//! radius. On the axes of a frame both are up to sqrt(3) larger, 22.6. [`MODEL_PAD`] has room for them, and for
//! terms of order `U^2`. Axes that turn, and bows, are those of the rounded time for bounds and rays alike, with the model's own
//! rounded keys: they are no part of this. Straying and standing still (see
//! [`super::carrier`]) come on top; together they are [`Relative::slack`]. What becomes of the ray is derived in
//! `trace::relative`.

use std::ops::RangeInclusive;

use glam::Vec3;
use rayon::prelude::*;

use super::carrier::{Carrier, sample};
use super::gather::How;
use super::linear::round_up;
use super::model::{Instant, model};
use super::object::{BlockTree, BvhStats, build_blocks};
use super::sway;
use super::tame::{TAME, key_ranges};
use super::{CarriedSlabs, LinearBox, LinearSlabs, U};
use crate::grid::DicedMesh;

/// What bounds of models are short by at most, per unit of their radius; derived in the module's text.
const MODEL_PAD: f32 = 32.0 * U;
/// Positions within this part of the radius are the same position, rounded twice.
const STILL: f64 = 64.0 * U as f64;
/// Grids in a sample.
const SAMPLE: usize = 128;
/// A carried space must leave less than this part of the area of the sample.
const SHARE: f32 = 0.7;
/// Halves of the shutter must leave less than this part of it. Where a chord is good enough they leave 0.92 and more,
/// on arcs 0.76 and less.
const HALVES_SHARE: f32 = 0.85;
/// Objects of fewer micropolygons are not worth a carried space for standing still in it alone.
const LEAST_STILL: usize = 4096;

/// How the trees of an object see it, and the trees.
#[derive(Clone, Debug)]
pub struct Relative {
    /// What the object follows.
    pub carrier: Option<Carrier>,
    /// Where the second part of the shutter begins: the time of a key, or half way between two.
    pub middle: Option<f32>,
    /// The trees.
    pub trees: Trees,
    /// Largest magnitude of any coordinate or bound that the trees know.
    pub radius: f32,
    /// Vertices are within their bounds but for this.
    pub slack: f32,
}

impl Relative {
    /// When a part of the shutter begins, and how long it is.
    #[inline(always)]
    pub fn part(&self, part: usize) -> (f32, f32) {
        match self.middle {
            None => (0.0, 1.0),
            Some(middle) if part == 0 => (0.0, middle),
            Some(middle) => (middle, 1.0 - middle),
        }
    }
}

/// Trees in carried space.
#[derive(Clone, Debug)]
pub enum Trees {
    /// Nothing moves there.
    Still(BlockTree<CarriedSlabs>),
    /// One for each part of the shutter.
    Moving(Vec<BlockTree<LinearSlabs>>),
}

impl Trees {
    /// As [`BlockTree::strands`], of all.
    pub fn are_of_strands(&self) -> bool {
        match self {
            Trees::Still(tree) => tree.strands,
            Trees::Moving(trees) => trees.iter().all(|tree| tree.strands),
        }
    }
}

/// What has been chosen.
struct Plan {
    carrier: Option<Carrier>,
    still: bool,
    middle: Option<Instant>,
}

/// What [`build`] found.
pub struct Built {
    /// The trees.
    pub relative: Relative,
    /// Bounds of the mesh in its own space.
    pub bounds: LinearBox,
    /// Of the trees; those of the mesh are not set.
    pub stats: BvhStats,
}

/// Builds the trees of a mesh, if it is one that gains by it: all its grids can be traced, and nothing is absurdly far.
pub fn build(mesh: &DicedMesh) -> Option<Built> {
    let usable = mesh.is_moving() && mesh.is_usable() && !mesh.grids.is_empty();
    if !usable || mesh.sound_grids().contains(&false) {
        return None;
    }
    let plan = choose(mesh)?;
    let ranges = key_ranges(mesh)?;
    let last = mesh.key_count() - 1;
    let carrier = plan.carrier.as_ref();
    let (mut radius, mut slack) = (0.0f32, 0.0f64);
    let mut stats = BvhStats::default();
    let trees = if plan.still {
        let carrier = carrier?;
        let e = unrest(mesh, carrier);
        let first = ranges[0].0.abs().max(ranges[0].1.abs()).max_element();
        let still = e <= STILL * f64::from(first);
        if !still {
            return None;
        }
        slack = carrier.stretch() * e;
        let model = model(mesh, None, &[Instant::at(0)]);
        let how = How::of(&model);
        let found = build_blocks(model, false, how);
        (radius, stats) = (found.radius, found.stats);
        Trees::Still(found.tree)
    } else {
        let parts = match plan.middle {
            Some(middle) => vec![middle.part(false, last), middle.part(true, last)],
            None => vec![(0..=last).map(Instant::at).collect()],
        };
        let mut trees = Vec::new();
        // Of the first part, for both: the second is not of twice the size where strands lean later.
        let mut how = None;
        for instants in parts {
            let first = instants[0].key;
            let model = model(mesh, carrier, &instants);
            if let Some(carrier) = carrier.filter(|c| c.turns()) {
                slack = slack.max(straying(&model, carrier, first));
            }
            let how = *how.get_or_insert_with(|| How::of(&model));
            let found = build_blocks(model, plan.middle.is_some(), how);
            radius = radius.max(found.radius);
            stats = stats.plus(&found.stats);
            trees.push(found.tree);
        }
        Trees::Moving(trees)
    };
    stats.bvh_bytes += carrier.map_or(0, Carrier::bytes) as u64;
    let relative = Relative {
        middle: plan.middle.map(|middle| middle.time(mesh)),
        carrier: plan.carrier,
        trees,
        radius,
        slack: round_up(slack) + MODEL_PAD * radius,
    };
    Some(Built {
        relative,
        bounds: bounds(mesh, &ranges),
        stats,
    })
}

/// Weighs what can be done by the area of a sample of blocks, averaged over the shutter.
fn choose(mesh: &DicedMesh) -> Option<Plan> {
    let last = mesh.key_count().checked_sub(1).filter(|&last| last > 0)?;
    let samples = sample(mesh, SAMPLE);
    let reach = |points: &Vec<Vec3>| {
        points
            .iter()
            .map(|p| p.abs().max_element())
            .fold(0.0, f32::max)
    };
    let radius = f64::from(samples.iter().map(reach).fold(0.0, f32::max));
    if !(radius > 0.0 && radius < f64::from(TAME)) {
        return None;
    }
    let plain = Seen::new(&samples, None);
    let mut best = (plain.area(mesh, 0..=last), plain, None);
    for turns in [false, true] {
        let Some(carrier) = Carrier::fit(&samples, turns) else {
            continue;
        };
        let seen = Seen::new(&samples, Some(&carrier));
        if seen.unrest <= STILL * radius {
            let worth =
                mesh.cell_count() >= LEAST_STILL || seen.area(mesh, 0..=last) < SHARE * best.0;
            return worth.then_some(Plan {
                carrier: Some(carrier),
                still: true,
                middle: None,
            });
        }
        // Not for little: rays must follow.
        let area = seen.area(mesh, 0..=last);
        if area < SHARE * best.0 {
            best = (area, seen, Some(carrier));
        }
    }
    let (area, seen, carrier) = best;
    let halves = (1..last)
        .map(|k| (seen.area(mesh, 0..=k) + seen.area(mesh, k..=last), k))
        .min_by(|a, b| a.0.total_cmp(&b.0));
    let halves = halves.filter(|h| h.0 < HALVES_SHARE * area);
    let middle = match halves {
        Some((_, key)) => Some(Instant::at(key)),
        // What follows a carrier is told to go apart by the turn alone.
        None if carrier.is_none() && sway::go_apart(mesh) => Instant::half_way(mesh),
        None => None,
    };
    (carrier.is_some() || middle.is_some()).then_some(Plan {
        carrier,
        still: false,
        middle,
    })
}

/// A sample as a tree would see it.
struct Seen {
    points: Vec<Vec<Vec3>>,
    /// Farthest that a point gets from where it was first.
    unrest: f64,
    /// Largest distance from a chord, for segments of keys.
    strays: Vec<f64>,
}

impl Seen {
    fn new(samples: &[Vec<Vec3>], carrier: Option<&Carrier>) -> Seen {
        let place = |k: usize, p: Vec3| match carrier {
            Some(carrier) => {
                let (m, by) = carrier.inverse_at_key(k);
                (m * (p.as_dvec3() - by)).as_vec3()
            }
            None => p,
        };
        let points: Vec<Vec<Vec3>> = samples
            .iter()
            .enumerate()
            .map(|(k, points)| points.iter().map(|&p| place(k, p)).collect())
            .collect();
        let far = |a: &[Vec3], b: &[Vec3]| {
            let most = a
                .iter()
                .zip(b)
                .map(|(a, b)| a.distance(*b))
                .fold(0.0, f32::max);
            f64::from(most)
        };
        let unrest = points
            .iter()
            .map(|p| far(p, &points[0]))
            .fold(0.0, f64::max);
        let stray = |k: usize| carrier.map_or(0.0, |c| c.stray(k));
        let strays = (0..points.len() - 1)
            .map(|k| stray(k) * far(&points[k], &points[k + 1]))
            .collect();
        Seen {
            points,
            unrest,
            strays,
        }
    }

    /// The area of blocks bounded from the first of `keys` to the last, times how long that is.
    fn area(&self, mesh: &DicedMesh, keys: RangeInclusive<usize>) -> f32 {
        let (first, last) = (*keys.start(), *keys.end());
        let times = &mesh.key_times;
        let stray = self.strays[first..last].iter().copied().fold(0.0, f64::max);
        let mut sum = 0.0;
        for block in 0..self.points[0].len() / 9 {
            let range = |k: usize| {
                let points = &self.points[k][block * 9..][..9];
                let start = (Vec3::INFINITY, Vec3::NEG_INFINITY);
                points
                    .iter()
                    .fold(start, |(lo, hi), &p| (lo.min(p), hi.max(p)))
            };
            let ((lo0, hi0), (lo1, hi1)) = (range(first), range(last));
            let mut b = LinearBox { lo0, hi0, lo1, hi1 };
            for k in first + 1..last {
                let (lo, hi) = range(k);
                b.raise(
                    (times[k] - times[first]) / (times[last] - times[first]),
                    lo,
                    hi,
                );
            }
            sum += b.widen(stray as f32).mean_half_area();
        }
        sum * (times[last] - times[first])
    }
}

/// The largest of numbers about grids.
fn most(mesh: &DicedMesh, of: impl Fn(usize) -> f64 + Send + Sync) -> f64 {
    let grids = (0..mesh.grids.len()).into_par_iter().with_min_len(16);
    grids.map(of).reduce(|| 0.0, f64::max)
}

/// How far a vertex gets in carried space, at most, from where it is at the first key.
fn unrest(mesh: &DicedMesh, carrier: &Carrier) -> f64 {
    let maps: Vec<_> = (0..mesh.key_count())
        .map(|k| carrier.inverse_at_key(k))
        .collect();
    let squared = most(mesh, |g| {
        let first = mesh.grid_positions(g, 0);
        let mut most = 0.0f64;
        for (k, (m, by)) in maps.iter().enumerate().skip(1) {
            for (p, q) in mesh.grid_positions(g, k).iter().zip(first) {
                let e = *m * (p.as_dvec3() - *by) - q.as_dvec3();
                most = most.max(e.length_squared());
            }
        }
        most
    });
    squared.sqrt()
}

/// How far a vertex of a model strays from its chords, at most. The model's first key is key `first`.
fn straying(model: &DicedMesh, carrier: &Carrier, first: usize) -> f64 {
    let rates = (0..model.key_count() - 1).map(|k| carrier.stray(first + k));
    let rates: Vec<f64> = rates.collect();
    most(model, |g| {
        let mut most = 0.0f64;
        for (k, rate) in rates.iter().enumerate() {
            let (from, to) = (model.grid_positions(g, k), model.grid_positions(g, k + 1));
            let chords = from
                .iter()
                .zip(to)
                .map(|(p, q)| (q.as_dvec3() - p.as_dvec3()).length());
            most = most.max(rate * chords.fold(0.0, f64::max));
        }
        most
    })
}

/// Axis-aligned bounds of a mesh over time, in its own space.
fn bounds(mesh: &DicedMesh, ranges: &[(Vec3, Vec3)]) -> LinearBox {
    let last = ranges.len() - 1;
    let ((lo0, hi0), (lo1, hi1)) = (ranges[0], ranges[last]);
    let mut out = LinearBox { lo0, hi0, lo1, hi1 };
    for (&time, &(lo, hi)) in mesh.key_times.iter().zip(ranges).take(last).skip(1) {
        out.raise(time, lo, hi);
    }
    out
}
