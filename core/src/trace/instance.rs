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
//! **Pads.** A hit is found on the object's own, rounded ray. In the world that ray misses the true
//! one by up to `34 U |M| S` (27.8 for vertices, 1.8 for `t`, 1.8 each for the rounded origin and
//! direction; S as in [`super::object_ray`], in object space), and `|M| S <= 3 c (|origin| + R)`,
//! with `c = |M| |M^-1|` the condition (Frobenius norms) and R the world's radius, which also bounds
//! translations and `|M| radius`. Boxes are widened by that for rays that start inside the radius;
//! for those that start farther out the slab pad grows ([`super::world`]).

use glam::{DAffine3, DMat3, DVec3, Vec3};

use crate::bvh::linear::{round_down, round_up};
use crate::bvh::{COORDINATE_LIMIT, LinearBox, ObjectGeometry, U};
use crate::grid::locate_key;

/// `3 * 34` of the module's text, rounded up.
pub const INSTANCE_PAD: f32 = 104.0 * U;

/// Largest condition of a transform (product of the Frobenius norms of the matrix and its inverse; 3
/// for a rotation) that is traced. Beyond, f32 rays in the object's space say little about the
/// world, and the instance is left out. A sheet flattened 10,000 times is well within.
pub const CONDITION_LIMIT: f64 = 65536.0;

/// How an instance's object maps to the world, as hosts give it: target space (positions plus
/// origin) to absolute world.
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

/// Where an instance stands, reduced to the two spaces.
#[derive(Clone, Debug)]
pub enum Place {
    /// Left out: nothing to hit, or a transform that cannot be traced.
    Nowhere,
    /// World = object + this.
    Translation(Vec3),
    /// Matrices to and from the world.
    Static(Box<[DAffine3; 2]>),
    /// Keys of the matrix to the world.
    Moving(Box<MovingPlace>),
}

/// Keys of a moving instance.
#[derive(Clone, Debug)]
pub struct MovingPlace {
    key_times: Vec<f32>,
    to_world: Vec<DAffine3>,
}

/// A place with what the world needs to bound it.
pub(super) struct Placed {
    pub place: Place,
    pub bounds: LinearBox,
    /// Bounds translations, `|M| radius` and the bounds themselves.
    pub reach: f32,
    /// Condition of the transform; 1 for translations.
    pub condition: f32,
}

impl Placed {
    const NOWHERE: Placed = Placed {
        place: Place::Nowhere,
        bounds: LinearBox::EMPTY,
        reach: 0.0,
        condition: 1.0,
    };

    /// Reduces a transform; `Nowhere` where it is not finite, singular, or the object is empty.
    pub fn new(
        object: &ObjectGeometry,
        transform: &InstanceTransform,
        world_origin: DVec3,
    ) -> Placed {
        let placed = if object.is_empty() {
            None
        } else {
            place(object, transform, world_origin)
        };
        placed
            .filter(|p| {
                p.bounds.is_finite() && p.reach < COORDINATE_LIMIT && p.condition.is_finite()
            })
            .unwrap_or(Placed::NOWHERE)
    }
}

fn place(
    object: &ObjectGeometry,
    transform: &InstanceTransform,
    world_origin: DVec3,
) -> Option<Placed> {
    let origin = object.mesh().origin;
    let reduce = |m: &DAffine3| DAffine3 {
        matrix3: m.matrix3,
        translation: m.transform_point3(origin) - world_origin,
    };
    let radius = f64::from(object.radius());
    match transform {
        InstanceTransform::Translation(by) => {
            let offset = (*by + origin - world_origin).as_vec3();
            let matrix = DAffine3::from_translation(offset.as_dvec3());
            let bounds = world_bounds(object.bounds(), &[0.0], &[matrix]);
            Some(Placed {
                place: Place::Translation(offset),
                bounds,
                reach: reach(&bounds, &[matrix], radius),
                condition: 1.0,
            })
        }
        InstanceTransform::Static(m) => {
            let m = reduce(m);
            let condition = condition(&m.matrix3)?;
            let bounds = world_bounds(object.bounds(), &[0.0], &[m]);
            Some(Placed {
                place: Place::Static(Box::new([m, m.inverse()])),
                bounds,
                reach: reach(&bounds, &[m], radius),
                condition,
            })
        }
        InstanceTransform::Moving {
            key_times,
            matrices,
        } => {
            let sound = !key_times.is_empty()
                && key_times.len() == matrices.len()
                && key_times.windows(2).all(|w| w[0] < w[1])
                && (key_times.len() == 1
                    || key_times.first() == Some(&0.0) && key_times.last() == Some(&1.0));
            if !sound {
                return None;
            }
            let to_world: Vec<DAffine3> = matrices.iter().map(reduce).collect();
            // Keys and the middle of segments stand for all times; twice the largest leaves room.
            let mut worst: f32 = 0.0;
            for m in &to_world {
                worst = worst.max(condition(&m.matrix3)?);
            }
            for w in to_world.windows(2) {
                let middle = (w[0].matrix3 + w[1].matrix3) * 0.5;
                worst = worst.max(condition(&middle).unwrap_or(CONDITION_LIMIT as f32));
            }
            let bounds = world_bounds(object.bounds(), key_times, &to_world);
            let reach = reach(&bounds, &to_world, radius);
            let key_times = key_times.clone();
            Some(Placed {
                place: Place::Moving(Box::new(MovingPlace {
                    key_times,
                    to_world,
                })),
                bounds,
                reach,
                condition: 2.0 * worst,
            })
        }
    }
}

fn frobenius(m: &DMat3) -> f64 {
    m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Condition of a matrix, or none where it cannot be traced (also NaN).
fn condition(m: &DMat3) -> Option<f32> {
    let c = frobenius(m) * frobenius(&m.inverse());
    (c <= CONDITION_LIMIT).then_some(c as f32)
}

fn reach(bounds: &LinearBox, matrices: &[DAffine3], radius: f64) -> f32 {
    matrices.iter().fold(bounds.max_abs(), |r, m| {
        let t = m.translation.abs().max_element();
        r.max(t as f32)
            .max((frobenius(&m.matrix3) * radius * 3f64.sqrt()) as f32)
    })
}

/// World bounds of an object's box under a transform; derived in the module's text.
pub fn world_bounds(object: &LinearBox, key_times: &[f32], matrices: &[DAffine3]) -> LinearBox {
    let mut lo = vec![DVec3::ZERO; matrices.len()];
    let mut hi = lo.clone();
    for (k, m) in matrices.iter().enumerate() {
        let (blo, bhi) = object.at(f64::from(key_times[k]));
        (lo[k], hi[k]) = (m.translation, m.translation);
        for (j, column) in columns(&m.matrix3).into_iter().enumerate() {
            let (p, q) = (column * blo[j], column * bhi[j]);
            lo[k] += p.min(q);
            hi[k] += p.max(q);
        }
    }
    // Excess of each segment, put on both its ends.
    let mut raise_lo = vec![DVec3::ZERO; matrices.len()];
    let mut raise_hi = raise_lo.clone();
    for k in 0..matrices.len() - 1 {
        let share = f64::from(key_times[k + 1]) - f64::from(key_times[k]);
        let dlo = (object.lo1 - object.lo0).as_dvec3() * share;
        let dhi = (object.hi1 - object.hi0).as_dvec3() * share;
        let dm = columns(&(matrices[k + 1].matrix3 - matrices[k].matrix3));
        let (mut up, mut down) = (DVec3::ZERO, DVec3::ZERO);
        for j in 0..3 {
            let (p, q) = (dm[j] * dlo[j], dm[j] * dhi[j]);
            up += (-p).max(-q).max(DVec3::ZERO) * 0.25;
            down += p.max(q).max(DVec3::ZERO) * 0.25;
        }
        for end in [k, k + 1] {
            raise_lo[end] = raise_lo[end].max(down);
            raise_hi[end] = raise_hi[end].max(up);
        }
    }
    for k in 0..matrices.len() {
        lo[k] -= raise_lo[k];
        hi[k] += raise_hi[k];
    }
    let down = |v: DVec3| Vec3::from_array(v.to_array().map(round_down));
    let up = |v: DVec3| Vec3::from_array(v.to_array().map(round_up));
    let last = matrices.len() - 1;
    let mut out = LinearBox {
        lo0: down(lo[0]),
        hi0: up(hi[0]),
        lo1: down(lo[last]),
        hi1: up(hi[last]),
    };
    if last == 0 {
        // One matrix: the box moves as the object's does.
        let m = &matrices[0];
        let (blo, bhi) = object.at(1.0);
        let (mut l, mut h) = (m.translation, m.translation);
        for (j, column) in columns(&m.matrix3).into_iter().enumerate() {
            let (p, q) = (column * blo[j], column * bhi[j]);
            l += p.min(q);
            h += p.max(q);
        }
        (out.lo1, out.hi1) = (down(l), up(h));
    }
    for k in 1..last.max(1) {
        out.raise(key_times[k], down(lo[k]), up(hi[k]));
    }
    out
}

fn columns(m: &DMat3) -> [DVec3; 3] {
    [m.x_axis, m.y_axis, m.z_axis]
}

impl MovingPlace {
    fn at(&self, time: f32) -> DAffine3 {
        let (k, f) = locate_key(&self.key_times, time);
        let a = &self.to_world[k];
        let b = self.to_world.get(k + 1).unwrap_or(a);
        let f = f64::from(f);
        DAffine3 {
            matrix3: a.matrix3 + (b.matrix3 - a.matrix3) * f,
            translation: a.translation + (b.translation - a.translation) * f,
        }
    }
}

impl Place {
    /// True when the transform itself moves.
    pub fn is_moving(&self) -> bool {
        matches!(self, Place::Moving(m) if m.to_world.windows(2).any(|w| w[0] != w[1]))
    }

    /// Origin and direction of a world ray in the object's space; none where there is no such thing.
    #[inline]
    pub fn to_object(&self, origin: Vec3, dir: Vec3, time: f32) -> Option<(Vec3, Vec3)> {
        let through = |inverse: &DAffine3| {
            let o = inverse.transform_point3(origin.as_dvec3()).as_vec3();
            let d = inverse.transform_vector3(dir.as_dvec3()).as_vec3();
            (o, d)
        };
        match self {
            Place::Nowhere => None,
            Place::Translation(by) => Some((origin - *by, dir)),
            Place::Static(m) => Some(through(&m[1])),
            // A singular matrix gives infinities or NaN, which no ray can be prepared from.
            Place::Moving(m) => Some(through(&m.at(time).inverse())),
        }
    }

    /// Bytes on the heap.
    pub(super) fn heap_bytes(&self) -> usize {
        match self {
            Place::Nowhere | Place::Translation(_) => 0,
            Place::Static(_) => size_of::<[DAffine3; 2]>(),
            Place::Moving(m) => {
                size_of::<MovingPlace>()
                    + size_of_val(m.key_times.as_slice())
                    + size_of_val(m.to_world.as_slice())
            }
        }
    }

    /// The matrix from object to world at `time`.
    pub fn to_world(&self, time: f32) -> DAffine3 {
        match self {
            Place::Nowhere => DAffine3::IDENTITY,
            Place::Translation(by) => DAffine3::from_translation(by.as_dvec3()),
            Place::Static(m) => m[0],
            Place::Moving(m) => m.at(time),
        }
    }
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
