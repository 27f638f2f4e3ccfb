//! Instances: where an object stands in the world, its bounds there, and rays turned into its space.
//!
//! Spaces: *object* is the mesh's f32 space, relative to its origin; *world* is relative to the world
//! origin. A transform maps the mesh's target space (positions + origin) to the absolute world; the
//! two origins are folded into it in f64, and only then anything is rounded to f32.
//!
//! **Bounds.** A point's path is M(t) P(t): on a segment between matrix keys, where M is linear, and
//! with P in a box whose bounds are linear over the whole shutter, each world coordinate is at most
//! `T(t) + sum_j max(M_j lo_j, M_j hi_j)`. Every product of two linear functions is its chord minus
//! `s (1 - s) dM dP` (s the fraction of the segment), so it exceeds the chord by at most
//! `max(0, -dM dP) / 4`, and the sum of maxima exceeds the chord of its ends by at most the sum over j
//! of the larger of the two. Both ends of a segment are raised by that; then the chord over the
//! shutter is raised over all of them, as for keys of vertices ([`crate::bvh::linear`]).
//!
//! All of this is computed in f64, whose rounding is 2^-29 of the pads below.
//!
//! **Pads.** A hit is found on the object's own, rounded ray. In the world that ray misses the true
//! one by up to `34 U |M| S` (27.8 for vertices, 1.8 for `t`, 1.8 each for the rounded origin and
//! direction; S as in [`super::object_ray`], in object space). With `c = |M| |M^-1|` the condition (Frobenius norms)
//! and R the instance's reach, which bounds its translations, `sqrt(3) |M| radius` and its box,
//! `|M| S <= sqrt(3) c (|origin| + R) + R / sqrt(3)`. Besides, the fraction between the keys of a matrix errs by 3 of a step
//! of up to 2 R of the linear part and as much of the translation: `12 U R`. As c is at least 3, both are
//! less than `102 U c (|origin| + R)`. The share of `R` widens the box. The share of `|origin|` is
//! the ray's: it pads slabs by `NEAR_CONDITION |origin|`, and what a worse condition needs beyond that
//! widens its own box, for origins inside the world's radius; rays that start farther out pay for the
//! worst condition ([`super::world`]). So a box grows with its distance from the world's origin, which is
//! near the camera, and not with the size of the world.
//!
//! **Condition between keys.** Where M goes straight from one key to the next, its norm is at most that of the worse
//! end. Its inverse is the transposed matrix of cofactors, of degree 2 in time, over the determinant, of degree 3; both
//! lie within the range of their Bernstein coefficients, which bounds the condition for all times between
//! ([`condition_between`]), in halves where the bound is loose. Where the determinant comes near 0 there is
//! no bound: [`CONDITION_LIMIT`] stands for it, and rays that meet a worse matrix at their time miss.

use glam::{DAffine3, DMat3, DVec3, Vec3};

use super::places::{InstanceSet, Places};
use crate::bvh::linear::{round_down, round_up};
use crate::bvh::{COORDINATE_LIMIT, LinearBox, U};

/// 102 of the module's text, rounded up.
pub const INSTANCE_PAD: f32 = 104.0 * U;

/// Condition (see [`INSTANCE_PAD`]'s derivation) that every ray's pad allows for: rotations and uniform
/// scales have 3.
pub(super) const NEAR_CONDITION: f32 = 8.0;

/// Largest condition of a transform (product of the Frobenius norms of the matrix and its inverse; 3
/// for a rotation) that is traced. Beyond, f32 rays in the object's space say little about the
/// world, and the instance is left out. A sheet flattened 10,000 times is well within.
pub const CONDITION_LIMIT: f64 = 65536.0;

/// How an instance's object maps to the world, for [`super::World::build`]: target space (positions
/// plus origin) to absolute world.
#[derive(Clone, Debug, PartialEq)]
pub enum InstanceTransform {
    /// A translation: rays keep their direction, and hits are as exact as untransformed ones.
    Translation(DVec3),
    /// A fixed matrix.
    Static(DAffine3),
    /// Matrices at keys, interpolated linearly between them.
    Moving {
        /// Ascending in [0, 1], the first 0 and the last 1.
        key_times: Vec<f32>,
        /// One a key.
        matrices: Vec<DAffine3>,
    },
}

/// What the world needs to know of an instance to bound it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounded {
    pub bounds: LinearBox,
    /// Bounds translations, `sqrt(3) |M| radius` and the bounds themselves.
    pub reach: f32,
    /// Condition of the transform; 1 for translations.
    pub condition: f32,
}

impl Bounded {
    /// Bounds instance `i` of a set, relative to `world_origin`; none where it cannot be traced: not
    /// finite, singular, or the object is empty. `matrices` is for reuse.
    pub fn new(
        set: &InstanceSet,
        i: usize,
        world_origin: DVec3,
        matrices: &mut Vec<DAffine3>,
    ) -> Option<Bounded> {
        let (object_bounds, radius) = set.object_bounds()?;
        matrices.clear();
        let mut worst: f32 = 1.0;
        match &set.places {
            Places::Translated(shifts) => {
                matrices.push(DAffine3::from_translation(shifts[i].origin - world_origin));
            }
            Places::Fixed(records) => {
                matrices.push(records[i].inverted(world_origin));
                worst = condition(&matrices[0].matrix3)?;
            }
            Places::Moving { key_times, records } => {
                let sound = key_times.len() > 1
                    && key_times.windows(2).all(|w| w[0] < w[1])
                    && key_times.first() == Some(&0.0)
                    && key_times.last() == Some(&1.0);
                if !sound {
                    return None;
                }
                let keys = &records[i * key_times.len()..][..key_times.len()];
                matrices.extend(keys.iter().map(|r| r.at_key(world_origin)));
                for m in matrices.iter() {
                    worst = worst.max(condition(&m.matrix3)?);
                }
                for w in matrices.windows(2) {
                    let between = condition_between(&w[0].matrix3, &w[1].matrix3, HALVINGS);
                    worst = worst.max(round_up(between.min(CONDITION_LIMIT)));
                }
            }
        }
        let key_times = set.key_times().unwrap_or(&[0.0]);
        let bounds = world_bounds(object_bounds, key_times, matrices);
        let reach = reach(&bounds, matrices, f64::from(radius));
        let sound = bounds.is_finite() && reach < COORDINATE_LIMIT && worst.is_finite();
        sound.then_some(Bounded {
            bounds,
            reach,
            condition: worst,
        })
    }

    /// What the box is widened by in a world of this radius; see the module's text.
    pub fn pad(&self, world_radius: f32) -> f32 {
        let worse = (self.condition - NEAR_CONDITION).max(0.0);
        INSTANCE_PAD * (self.condition * self.reach + worse * world_radius)
    }
}

fn frobenius(m: &DMat3) -> f64 {
    m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Condition of a matrix, or none where it cannot be traced (also NaN).
fn condition(m: &DMat3) -> Option<f32> {
    let c = frobenius(m) * frobenius(&m.inverse());
    (c <= CONDITION_LIMIT).then_some(round_up(c))
}

/// Halvings of a segment whose condition is not bounded well.
const HALVINGS: u32 = 6;

/// Bounds the condition of all matrices straight between two; infinity where no bound is found. Derived in the
/// module's text.
fn condition_between(a: &DMat3, b: &DMat3, halvings: u32) -> f64 {
    let cofactors = |m: &DMat3| {
        let [x, y, z] = columns(m);
        DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y))
    };
    let middle = (*a + *b) * 0.5;
    let (first, last) = (cofactors(a), cofactors(b));
    let inner = cofactors(&middle) * 2.0 - (first + last) * 0.5;
    let norm = frobenius(&first)
        .max(frobenius(&last))
        .max(frobenius(&inner));
    // A third of the determinant's derivative at an end is what its second coefficient there has more.
    let step = *b - *a;
    let third = |c: &DMat3| {
        columns(c)
            .iter()
            .zip(columns(&step))
            .map(|(c, s)| c.dot(s))
            .sum::<f64>()
            / 3.0
    };
    let (d0, d3) = (a.determinant(), b.determinant());
    let coefficients = [d0, d0 + third(&first), d3 - third(&last), d3];
    let least = coefficients
        .iter()
        .fold(f64::INFINITY, |l, &d| l.min(d * d0.signum()));
    let bound = if least > 0.0 {
        frobenius(a).max(frobenius(b)) * norm / least
    } else {
        f64::INFINITY
    };
    let ends =
        [(a, &first, d0), (b, &last, d3)].map(|(m, c, d)| frobenius(m) * frobenius(c) / d.abs());
    if halvings == 0 || bound <= 2.0 * ends[0].max(ends[1]) {
        return bound;
    }
    condition_between(a, &middle, halvings - 1).max(condition_between(&middle, b, halvings - 1))
}

/// True where rays may be carried through `inverse`, that of `m`: the condition is within the limit. False for NaN.
#[inline]
pub(super) fn may_invert(m: &DMat3, inverse: &DMat3) -> bool {
    let squared = |m: &DMat3| columns(m).iter().map(|c| c.length_squared()).sum::<f64>();
    squared(m) * squared(inverse) <= CONDITION_LIMIT * CONDITION_LIMIT
}

fn reach(bounds: &LinearBox, matrices: &[DAffine3], radius: f64) -> f32 {
    /// Smaller objects count as this large: below f32's normal numbers, rays err by 2^-150, absolutely.
    const LEAST_RADIUS: f64 = 1.0 / (1u128 << 100) as f64;
    let radius = radius.max(LEAST_RADIUS);
    matrices.iter().fold(bounds.max_abs(), |r, m| {
        let t = m.translation.abs().max_element();
        r.max(t as f32)
            .max((frobenius(&m.matrix3) * radius * 3f64.sqrt()) as f32)
    })
}

/// World bounds of an object's box under a transform; derived in the module's text.
pub fn world_bounds(object: &LinearBox, key_times: &[f32], matrices: &[DAffine3]) -> LinearBox {
    let down = |v: DVec3| Vec3::from_array(v.to_array().map(round_down));
    let up = |v: DVec3| Vec3::from_array(v.to_array().map(round_up));
    let last = matrices.len() - 1;
    if last == 0 {
        // One matrix: the box moves as the object's does.
        let (lo0, hi0) = placed(object, 0.0, &matrices[0]);
        let (lo1, hi1) = placed(object, 1.0, &matrices[0]);
        return LinearBox {
            lo0: down(lo0),
            hi0: up(hi0),
            lo1: down(lo1),
            hi1: up(hi1),
        };
    }
    // The excess of each segment is put on both its ends.
    let raised = |k: usize| {
        let (mut lo, mut hi) = placed(object, f64::from(key_times[k]), &matrices[k]);
        let before = k
            .checked_sub(1)
            .map(|k| excess(object, key_times, matrices, k));
        let after = (k < last).then(|| excess(object, key_times, matrices, k));
        let none = (DVec3::ZERO, DVec3::ZERO);
        let (a, b) = (before.unwrap_or(none), after.unwrap_or(none));
        lo -= a.0.max(b.0);
        hi += a.1.max(b.1);
        (down(lo), up(hi))
    };
    let ((lo0, hi0), (lo1, hi1)) = (raised(0), raised(last));
    let mut out = LinearBox { lo0, hi0, lo1, hi1 };
    for (k, &time) in key_times.iter().enumerate().take(last).skip(1) {
        let (lo, hi) = raised(k);
        out.raise(time, lo, hi);
    }
    out
}

/// Bounds of the object's box at `time` under one matrix.
fn placed(object: &LinearBox, time: f64, m: &DAffine3) -> (DVec3, DVec3) {
    let (blo, bhi) = object.at(time);
    let (mut lo, mut hi) = (m.translation, m.translation);
    for (j, column) in columns(&m.matrix3).into_iter().enumerate() {
        let (p, q) = (column * blo[j], column * bhi[j]);
        lo += p.min(q);
        hi += p.max(q);
    }
    (lo, hi)
}

/// By how much a point may lie below and above the chord of segment `k`.
fn excess(
    object: &LinearBox,
    key_times: &[f32],
    matrices: &[DAffine3],
    k: usize,
) -> (DVec3, DVec3) {
    let (mut down, mut up) = (DVec3::ZERO, DVec3::ZERO);
    if object.is_static() {
        return (down, up);
    }
    let share = f64::from(key_times[k + 1]) - f64::from(key_times[k]);
    let dlo = (object.lo1 - object.lo0).as_dvec3() * share;
    let dhi = (object.hi1 - object.hi0).as_dvec3() * share;
    let dm = columns(&(matrices[k + 1].matrix3 - matrices[k].matrix3));
    for j in 0..3 {
        let (p, q) = (dm[j] * dlo[j], dm[j] * dhi[j]);
        up += (-p).max(-q).max(DVec3::ZERO) * 0.25;
        down += p.max(q).max(DVec3::ZERO) * 0.25;
    }
    (down, up)
}

fn columns(m: &DMat3) -> [DVec3; 3] {
    [m.x_axis, m.y_axis, m.z_axis]
}

/// Carries normals through `m` up to a positive scale: the cofactor matrix, with the sign of the
/// determinant, so that fronts stay in front where `m` mirrors.
pub fn normal_matrix(m: &DMat3) -> DMat3 {
    let [x, y, z] = columns(m);
    let cofactor = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y));
    if m.determinant() < 0.0 {
        -cofactor
    } else {
        cofactor
    }
}
