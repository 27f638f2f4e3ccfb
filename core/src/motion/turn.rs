//! Turns from one matrix to another.
//!
//! A matrix is split into a rotation and a stretch (polar decomposition, Higham 1986). Between two of
//! them the rotation turns at constant speed: what turns keeps its size, where entry-wise interpolation would
//! shrink it.
//!
//! Two samples tell little of what lies between them, so only what can hardly be anything else is turned: what has the
//! same stretch and the same place at both, or a third sample between them that is where turning takes it. A matrix that was interpolated entry by entry, as USD does with authored
//! ones, is shrunk, and gives itself away; so does a turn below a scale. A place that changes may be a wheel's that
//! rolls, or a door's about its hinge: entry-wise interpolation is right about both their middles, and turning is
//! about one of them alone.

use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3};

use crate::scene::Samples;

/// Newton steps of the polar decomposition: it converges quadratically from any matrix that is not
/// nearly singular; a rigid one needs one.
const POLAR_STEPS: usize = 32;
/// Differences of stretch, and of place, that are none: parts of the largest number.
const SAME: f64 = 1.0e-6;
/// How far a sample in the middle may be from what it shows, likewise.
const SHOWN: f64 = 1.0e-4;
/// Radians below which nothing turns: the line between two matrices is off by less than 2e-13.
const LEAST_TURN: f64 = 1.0e-6;

/// A matrix as rotation times stretch.
#[derive(Clone, Copy, Debug)]
pub struct Polar {
    /// A unit quaternion.
    pub rotation: DQuat,
    /// Symmetric; of a matrix that mirrors, negative.
    pub stretch: DMat3,
}

impl Polar {
    /// No rotation, no stretch.
    pub const IDENTITY: Self = Self {
        rotation: DQuat::IDENTITY,
        stretch: DMat3::IDENTITY,
    };

    /// `None` for a matrix that cannot be inverted.
    pub fn of(m: &DMat3) -> Option<Self> {
        let r = rotation(m)?;
        Some(Self {
            rotation: DQuat::from_mat3(&r).normalize(),
            stretch: r.transpose() * *m,
        })
    }

    /// The matrix at `f` in [0, 1] on the way to another.
    pub fn towards(&self, to: &Self, f: f64) -> DMat3 {
        DMat3::from_quat(self.rotation.slerp(to.rotation, f))
            * (self.stretch * (1.0 - f) + to.stretch * f)
    }
}

fn rotation(m: &DMat3) -> Option<DMat3> {
    let determinant = m.determinant();
    if !(determinant.is_finite() && determinant != 0.0) {
        return None;
    }
    let mut r = *m;
    for _ in 0..POLAR_STEPS {
        let next = (r + r.inverse().transpose()) * 0.5;
        let change = (next - r)
            .to_cols_array()
            .iter()
            .fold(0.0f64, |a, x| a.max(x.abs()));
        r = next;
        if change < 1.0e-15 {
            break;
        }
    }
    // The mirror goes into the stretch.
    let r = if determinant < 0.0 { r * -1.0 } else { r };
    r.is_finite().then_some(r)
}

/// The way from one matrix to another that is turned; the place goes linearly.
#[derive(Clone, Copy, Debug)]
pub struct Turn {
    ends: [Polar; 2],
    translations: [DVec3; 2],
}

fn largest(m: &DMat3) -> f64 {
    let entries = m.to_cols_array().into_iter();
    entries.fold(0.0, |most, x| most.max(x.abs()))
}

impl Turn {
    /// Turned in place. `None` where there is nothing to turn, or no telling how: one of them cannot be inverted, both are
    /// turned alike, or stretch or place change; see the module's text.
    pub fn between(a: &DAffine3, b: &DAffine3) -> Option<Self> {
        let place = a.translation.abs().max_element();
        let place = place.max(largest(&a.matrix3));
        let stays = (b.translation - a.translation).abs().max_element() <= SAME * place;
        Self::moving(a, b).filter(|_| stays)
    }

    /// Turned on the way from `a` over `middle`, at `f` of it, to `b`, where that shows that the place goes linearly: both
    /// parts of the way.
    pub fn shown([a, middle, b]: [&DAffine3; 3], f: f64) -> Option<[Self; 2]> {
        let at = Self::moving(a, b)?.at(f);
        let size = largest(&a.matrix3);
        let way = (b.translation - a.translation).abs().max_element();
        let shows = largest(&(at.matrix3 - middle.matrix3)) <= SHOWN * size
            && (at.translation - middle.translation).abs().max_element() <= SHOWN * size.max(way);
        let parts = [Self::moving(a, middle), Self::moving(middle, b)];
        match parts {
            [Some(first), Some(second)] if shows => Some([first, second]),
            _ => None,
        }
    }

    /// The same stretch, and turned.
    fn moving(a: &DAffine3, b: &DAffine3) -> Option<Self> {
        if a.matrix3 == b.matrix3 {
            return None;
        }
        let ends = [Polar::of(&a.matrix3)?, Polar::of(&b.matrix3)?];
        let same =
            largest(&(ends[1].stretch - ends[0].stretch)) <= SAME * largest(&ends[0].stretch);
        // The vector's length is the sine of half the angle.
        let half = (ends[0].rotation.conjugate() * ends[1].rotation).xyz();
        (same && half.length() > 0.5 * LEAST_TURN).then_some(Self {
            ends,
            translations: [a.translation, b.translation],
        })
    }

    /// The matrix at `f` in [0, 1] on the way.
    pub fn at(&self, f: f64) -> DAffine3 {
        DAffine3 {
            matrix3: self.ends[0].towards(&self.ends[1], f),
            translation: self.translations[0].lerp(self.translations[1], f),
        }
    }
}

/// True where a matrix of an array is turned between two samples that follow each other in time.
pub fn any_turns(samples: &Samples<DMat4>) -> bool {
    let mut order: Vec<usize> = (0..samples.times.len().min(samples.values.len())).collect();
    order.sort_by(|&a, &b| samples.times[a].total_cmp(&samples.times[b]));
    order.windows(2).any(|pair| {
        let [a, b] = [pair[0], pair[1]].map(|i| samples.values[i].iter());
        let mut each = a.zip(b);
        each.any(|(a, b)| {
            let [a, b] = [a, b].map(|m| DAffine3::from_mat4(*m));
            Turn::between(&a, &b).is_some()
        })
    })
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use super::*;

    fn turned(angle: f64) -> DAffine3 {
        DAffine3::from_rotation_z(angle)
    }

    fn assert_near(a: &DAffine3, b: &DAffine3) {
        assert!(a.abs_diff_eq(*b, 1.0e-12), "{a} is not {b}");
    }

    #[test]
    fn a_quarter_turn_goes_along_its_arc_at_constant_speed() {
        let stretch = DAffine3::from_scale(DVec3::new(2.0, 3.0, 0.5));
        let (a, b) = (turned(0.3) * stretch, turned(0.3 + FRAC_PI_2) * stretch);
        let turn = Turn::between(&a, &b).unwrap();
        for i in 0..=100 {
            let f = f64::from(i) / 100.0;
            assert_near(&turn.at(f), &(turned(0.3 + FRAC_PI_2 * f) * stretch));
            let radius = turn.at(f).transform_vector3(DVec3::X).length();
            assert!((radius - 2.0).abs() < 1.0e-12);
        }
    }

    #[test]
    fn nearly_half_a_turn_goes_the_shorter_way() {
        let turn = Turn::between(&turned(0.0), &turned(-0.999 * PI)).unwrap();
        assert_near(&turn.at(0.5), &turned(-0.4995 * PI));
    }

    #[test]
    fn a_third_sample_shows_what_moves_as_it_turns() {
        let stretch = DAffine3::from_scale(DVec3::new(1.0, 2.0, 0.5));
        let wheel = |f: f64| DAffine3::from_translation(DVec3::X * 3.0 * f) * turned(f) * stretch;
        let hinge = DAffine3::from_translation(DVec3::X * 3.0);
        let door = |f: f64| hinge * turned(f) * hinge.inverse();
        let shown =
            |path: &dyn Fn(f64) -> DAffine3| Turn::shown([&path(0.0), &path(0.3), &path(1.0)], 0.3);
        let [first, second] = shown(&wheel).unwrap();
        assert_near(&first.at(0.5), &wheel(0.15));
        assert_near(&second.at(0.5), &wheel(0.65));
        assert!(shown(&door).is_none(), "its origin goes along an arc");
        assert!(shown(&|f| wheel(f * f)).is_none());
    }

    /// Whatever lies between such samples, a turn about the origin is a guess.
    #[test]
    fn what_changes_its_stretch_or_its_place_is_not_turned() {
        let (a, b) = (turned(0.2), turned(0.2 + FRAC_PI_2));
        let none = |a: &DAffine3, b: &DAffine3| assert!(Turn::between(a, b).is_none());
        assert!(Turn::between(&a, &b).is_some());
        // Interpolated entry by entry, as authored matrices are.
        let at = |f: f64| crate::motion::transform::lerp(&a, &b, f);
        none(&a, &at(0.5));
        none(&at(0.1), &at(0.3));
        // Below a scale that is not uniform.
        let squash = DAffine3::from_scale(DVec3::new(1.0, 0.5, 1.0));
        none(&(squash * a), &(squash * b));
        // A wheel, and a door.
        none(&a, &(DAffine3::from_translation(DVec3::X) * b));
        let hinge = DAffine3::from_translation(DVec3::X * 3.0);
        none(
            &(hinge * a * hinge.inverse()),
            &(hinge * b * hinge.inverse()),
        );
        let far = DAffine3::from_translation(DVec3::splat(1.0e5));
        assert!(Turn::between(&(far * a), &(far * b)).is_some());
    }

    #[test]
    fn mirrored_matrices_turn_as_others_do() {
        let mirror = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 2.0));
        let turn = Turn::between(&mirror, &(turned(FRAC_PI_2) * mirror)).unwrap();
        assert_near(&turn.at(0.25), &(turned(FRAC_PI_2 / 4.0) * mirror));
        assert!(Turn::between(&DAffine3::IDENTITY, &(turned(1.0) * mirror)).is_none());
    }

    #[test]
    fn what_is_flat_or_not_turned_has_no_turn() {
        let flat = turned(1.0) * DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0));
        assert!(Turn::between(&DAffine3::IDENTITY, &flat).is_none());
        let larger = turned(0.7) * DAffine3::from_scale(DVec3::splat(1.7));
        assert!(Turn::between(&turned(0.7), &larger).is_none());
        let moved = DAffine3::from_translation(DVec3::X);
        assert!(Turn::between(&DAffine3::IDENTITY, &moved).is_none());
    }

    #[test]
    fn arrays_are_looked_through_in_order_of_time() {
        let matrix = |angle: f64| vec![DMat4::IDENTITY, DMat4::from_rotation_z(angle)].into();
        let samples = |last: f64| Samples {
            times: vec![1.0, 0.0, 2.0],
            values: vec![matrix(0.0), matrix(last), matrix(last)],
        };
        assert!(any_turns(&samples(0.5)));
        assert!(!any_turns(&samples(0.0)));
    }
}
