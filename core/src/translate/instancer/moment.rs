//! All instances of an instancer at one time.

use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3, Quat, Vec3};

use crate::motion::rates::turn;
use crate::motion::transform::{is_usable, lerp};
use crate::motion::turn::Turn;

/// Quaternions with a squared length within this of 1 are meant to be unit (half precision leaves 0.002,
/// numbers typed by hand more). They are taken as they are, as USD does; others are normalized.
const UNIT_SLACK: f32 = 0.25;
/// Quaternions with a squared length below this are zero.
const ZERO_QUATERNION: f32 = 1.0e-12;
/// Below this `1 - cosine`, quaternions are mixed linearly; USD's own number.
const NEARLY_PARALLEL: f64 = 1.0e-5;
/// Cofactors this small beside the square of the largest entry mean a matrix of rank 1 or 0.
const FLAT: f64 = 1.0e-12;

/// Two samples of an array and the weight of the second.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mix<'a, T> {
    pub a: &'a [T],
    pub b: &'a [T],
    pub f: f64,
}

impl Mix<'_, Vec3> {
    fn value(&self, i: usize) -> DVec3 {
        let a = self.a[i].as_dvec3();
        match self.f == 0.0 {
            true => a,
            false => a + (self.b[i].as_dvec3() - a) * self.f,
        }
    }
}

/// An array of rates, and seconds since the sample that it moves.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rated<'a> {
    pub values: &'a [Vec3],
    pub seconds: f64,
}

/// The arrays at one time.
#[derive(Clone, Debug)]
pub(super) struct Moment<'a> {
    pub positions: Option<Mix<'a, Vec3>>,
    pub orientations: Option<Mix<'a, Quat>>,
    pub scales: Option<Mix<'a, Vec3>>,
    pub matrices: Option<Mix<'a, DMat4>>,
    pub matrices_turn: bool,
    pub velocities: Option<Rated<'a>>,
    pub accelerations: Option<&'a [Vec3]>,
    pub spins: Option<Rated<'a>>,
    /// Another moment, and how far the way there this one is.
    pub chord: Option<(Box<Moment<'a>>, f64)>,
}

/// Whether an instance is placed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum State {
    /// It is.
    Placed,
    /// It is not there.
    Masked,
    /// A number is not finite, or absurdly large.
    NotFinite,
    /// A matrix of rank 1 or 0: nothing is seen.
    Flat,
}

impl Moment<'_> {
    /// Prototype to instancer space: matrix, then scale, orientation, position.
    pub fn matrix(&self, i: usize) -> DAffine3 {
        let m = self.exact(i);
        match &self.chord {
            Some((next, f)) => lerp(&m, &next.exact(i), *f),
            None => m,
        }
    }

    fn exact(&self, i: usize) -> DAffine3 {
        let mut linear = DMat3::IDENTITY;
        if let Some(orientations) = &self.orientations {
            linear = DMat3::from_quat(orientation(orientations, i));
            if let Some(spins) = &self.spins {
                linear = DMat3::from_quat(turn(spins.values[i], spins.seconds)) * linear;
            }
        }
        if let Some(scales) = &self.scales {
            linear *= DMat3::from_diagonal(scales.value(i));
        }
        let mut translation = self.positions.map_or(DVec3::ZERO, |p| p.value(i));
        if let Some(rate) = &self.velocities {
            let mut velocity = rate.values[i].as_dvec3();
            if let Some(accelerations) = self.accelerations {
                velocity += accelerations[i].as_dvec3() * (0.5 * rate.seconds);
            }
            translation += velocity * rate.seconds;
        }
        let m = DAffine3 {
            matrix3: linear,
            translation,
        };
        match &self.matrices {
            Some(mix) => {
                let (a, b) = (DAffine3::from_mat4(mix.a[i]), DAffine3::from_mat4(mix.b[i]));
                let turns = self.matrices_turn && mix.f != 0.0;
                m * match turns.then(|| Turn::between(&a, &b)).flatten() {
                    Some(turn) => turn.at(mix.f),
                    None => lerp(&a, &b, mix.f),
                }
            }
            None => m,
        }
    }

    /// Whether an instance can be placed at this time.
    pub fn state(&self, i: usize) -> State {
        let m = self.matrix(i);
        if !is_usable(&m) {
            return State::NotFinite;
        }
        let (x, y, z) = (m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis);
        let largest = |v: [DVec3; 3]| v.iter().fold(0.0f64, |a, v| a.max(v.abs().max_element()));
        let cofactor = largest([x.cross(y), y.cross(z), z.cross(x)]);
        let entry = largest([x, y, z]);
        if cofactor <= FLAT * entry * entry {
            State::Flat
        } else {
            State::Placed
        }
    }
}

/// What a quaternion is worth, better ones first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Quality {
    Unit,
    NotUnit,
    Zero,
}

/// How good a quaternion is; those that are not finite are found by [`Moment::state`].
pub(super) fn quality(q: Quat) -> Quality {
    let length2 = q.length_squared();
    if length2 < ZERO_QUATERNION {
        Quality::Zero
    } else if length2.is_finite() && (length2 - 1.0).abs() > UNIT_SLACK {
        Quality::NotUnit
    } else {
        Quality::Unit
    }
}

/// A quaternion as it is used.
fn unit(q: Quat) -> DQuat {
    match quality(q) {
        Quality::Unit => q.as_dquat(),
        Quality::NotUnit => q.as_dquat().normalize(),
        Quality::Zero => DQuat::IDENTITY,
    }
}

/// Between two orientations along the shorter great arc.
fn orientation(mix: &Mix<'_, Quat>, i: usize) -> DQuat {
    let a = unit(mix.a[i]);
    if mix.f == 0.0 {
        return a;
    }
    let mut b = unit(mix.b[i]);
    let mut cosine = a.dot(b);
    if cosine < 0.0 {
        (b, cosine) = (-b, -cosine);
    }
    let (wa, wb) = if 1.0 - cosine > NEARLY_PARALLEL {
        let angle = cosine.acos();
        let sine = angle.sin();
        (
            ((1.0 - mix.f) * angle).sin() / sine,
            (mix.f * angle).sin() / sine,
        )
    } else {
        (1.0 - mix.f, mix.f)
    };
    a * wa + b * wb
}
