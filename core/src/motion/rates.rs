//! Rates: samples that move on by their velocities, accelerations and angular velocities, as
//! UsdGeomPointBased and UsdGeomPointInstancer have it.
//!
//! The sample at or before the frame moves, or the first one where all are later; other samples are
//! not used. `dt` seconds after its own time a point is at `p + dt (v + dt a / 2)`, and an
//! orientation `q` has turned by `dt |w|` degrees about the axis `w` of the space that `q` is in.
//! Velocities count where their samples below and above the frame have the times of the samples that
//! they move, and arrays are of one length; accelerations where theirs have those of the velocities.

use glam::{DQuat, Vec3};

use crate::scene::{PointsSamples, Samples};

/// Largest usable coordinate: squares and products of a few stay inside f32.
pub const LARGEST_COORDINATE: f32 = 1.0e12;

/// True for a point that arithmetic in f32 can take.
pub fn usable(p: Vec3) -> bool {
    p.is_finite() && p.abs().max_element() < LARGEST_COORDINATE
}

/// What is wrong with those of `points`, at all keys, that are not [`usable`].
pub fn fault(points: &[Vec<Vec3>]) -> String {
    let unusable = || points.iter().flatten().filter(|p| !usable(**p));
    let far = format!("beyond the largest coordinate, {LARGEST_COORDINATE:e}");
    match (
        unusable().any(|p| !p.is_finite()),
        unusable().any(|p| p.is_finite()),
    ) {
        (true, true) => format!("not finite or {far}"),
        (true, false) => "not finite".to_owned(),
        (false, _) => far,
    }
}

/// The samples on either side of the frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bracket {
    /// Index of the sample at or before the frame; the first one where there is none.
    pub sample: usize,
    /// Its time, in time codes relative to the frame.
    pub below: f64,
    /// Time of the first sample after the frame; `below` where there is none, or none before.
    pub above: f64,
}

impl Bracket {
    /// The samples of `times` on either side of time 0; of equal times the last given counts.
    /// `None` where no time is finite.
    pub fn of(times: &[f64]) -> Option<Self> {
        let finite = || {
            times
                .iter()
                .copied()
                .enumerate()
                .filter(|t| t.1.is_finite())
        };
        let before = finite().filter(|t| t.1 <= 0.0);
        let below = before.max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((sample, below)) = below else {
            let (sample, first) = finite().rev().min_by(|a, b| a.1.total_cmp(&b.1))?;
            return Some(Self {
                sample,
                below: first,
                above: first,
            });
        };
        let after = finite().map(|t| t.1).filter(|&t| t > 0.0);
        Some(Self {
            sample,
            below,
            above: after.min_by(f64::total_cmp).unwrap_or(below),
        })
    }

    fn has_times_of(&self, other: &Self) -> bool {
        self.below == other.below && self.above == other.above
    }
}

/// Why rates are not used.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum RateFault {
    /// Their samples around the frame are at other times.
    #[error("{0} have other sample times than what they move; they are ignored")]
    Times(&'static str),
    /// Their number is another one.
    #[error("{found} {name} for {expected} values; they are ignored")]
    Length {
        /// What they are.
        name: &'static str,
        /// Their number.
        found: usize,
        /// What it should be.
        expected: usize,
    },
    /// Time codes have no length in seconds.
    #[error("velocities need a number of time codes a second above 0; they are ignored")]
    NoSeconds,
}

/// The `rates` of the sample that `base` tells, which has `count` values: `None` where there are
/// none. `name` is for messages, in the plural.
///
/// # Errors
/// Rates that do not fit.
pub fn matching<'a, T>(
    base: &Bracket,
    rates: &'a Samples<T>,
    count: usize,
    name: &'static str,
) -> Result<Option<&'a [T]>, RateFault> {
    let samples = rates.times.len().min(rates.values.len());
    let Some(bracket) = Bracket::of(&rates.times[..samples]) else {
        return Ok(None);
    };
    let values = rates.values[bracket.sample].as_slice();
    if values.is_empty() {
        return Ok(None);
    }
    if !bracket.has_times_of(base) {
        return Err(RateFault::Times(name));
    }
    if values.len() != count {
        let found = values.len();
        return Err(RateFault::Length {
            name,
            found,
            expected: count,
        });
    }
    Ok(Some(values))
}

/// Points that velocities move.
#[derive(Clone, Copy, Debug)]
pub struct RatedPoints<'a> {
    points: &'a [Vec3],
    velocities: &'a [Vec3],
    accelerations: Option<&'a [Vec3]>,
    /// Of the sample, in time codes relative to the frame.
    time: f64,
    time_codes_per_second: f64,
}

impl<'a> RatedPoints<'a> {
    /// The points that move, or `None` where no velocities count; `faults` gets why given ones do
    /// not.
    pub fn new(samples: &'a PointsSamples, faults: &mut Vec<RateFault>) -> Option<Self> {
        let rates = &samples.rates;
        if rates.velocities.values.is_empty() {
            return None;
        }
        let count = samples.points.len().min(samples.times.len());
        let base = Bracket::of(&samples.times[..count])?;
        let points = samples.points[base.sample].as_slice();
        let mut fits = |rates, name| {
            matching(&base, rates, points.len(), name).unwrap_or_else(|fault| {
                faults.push(fault);
                None
            })
        };
        let velocities = fits(&rates.velocities, "velocities")?;
        let accelerations = fits(&rates.accelerations, "accelerations");
        let time_codes_per_second = rates.time_codes_per_second;
        if !(time_codes_per_second > 0.0 && time_codes_per_second.is_finite()) {
            faults.push(RateFault::NoSeconds);
            return None;
        }
        Some(Self {
            points,
            velocities,
            accelerations: accelerations.filter(|a| a.iter().any(|a| *a != Vec3::ZERO)),
            time: base.below,
            time_codes_per_second,
        })
    }

    /// Seconds from the sample to `time_code`, which is relative to the frame.
    pub fn seconds(&self, time_code: f64) -> f64 {
        (time_code - self.time) / self.time_codes_per_second
    }

    /// The points at each of `time_codes` (relative to the frame), and how many of them stay where
    /// their sample is, because rates would take them to where f32 cannot follow.
    pub fn at(&self, time_codes: &[f64]) -> (Vec<Vec<Vec3>>, usize) {
        let seconds: Vec<f64> = time_codes.iter().map(|&t| self.seconds(t)).collect();
        let mut keys = vec![self.points.to_vec(); seconds.len()];
        let mut staying = 0;
        for i in 0..self.points.len() {
            if seconds.iter().all(|&dt| usable(self.place(i, dt))) {
                for (key, &dt) in keys.iter_mut().zip(&seconds) {
                    key[i] = self.place(i, dt);
                }
            } else if usable(self.points[i]) {
                staying += 1;
            }
        }
        (keys, staying)
    }

    fn place(&self, i: usize, dt: f64) -> Vec3 {
        let mut velocity = self.velocities[i].as_dvec3();
        if let Some(accelerations) = self.accelerations {
            velocity += accelerations[i].as_dvec3() * (0.5 * dt);
        }
        (self.points[i].as_dvec3() + velocity * dt).as_vec3()
    }

    /// How far the chord from `open` to `close` (time codes relative to the frame) is from the path
    /// of the point that accelerates most: `a dt^2 / 8`. 0 without accelerations.
    pub fn bend(&self, open: f64, close: f64) -> f64 {
        let dt = (close - open) / self.time_codes_per_second;
        let largest = self.accelerations.iter().copied().flatten();
        let largest = largest
            .map(|a| a.as_dvec3().length())
            .filter(|a| a.is_finite())
            .fold(0.0, f64::max);
        largest * dt * dt / 8.0
    }

    /// True where accelerations bend the path.
    pub fn is_curved(&self) -> bool {
        self.accelerations.is_some()
    }
}

/// The turn of `seconds` by an angular velocity: degrees a second about its own direction, in the space
/// that orientations are in, after them. Turns that are not finite are none.
pub fn turn(angular_velocity: Vec3, seconds: f64) -> DQuat {
    let w = angular_velocity.as_dvec3();
    let speed = w.length();
    let angle = (speed * seconds).to_radians();
    if speed > 0.0 && angle.is_finite() {
        DQuat::from_axis_angle(w / speed, angle)
    } else {
        DQuat::IDENTITY
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Rates;
    use glam::DVec3;
    use std::sync::Arc;

    fn samples(times: &[f64], values: &[f32]) -> Samples<Vec3> {
        Samples {
            times: times.to_vec(),
            values: values
                .iter()
                .map(|&x| Arc::new(vec![Vec3::X * x]))
                .collect(),
        }
    }

    fn points(times: &[f64], velocity_times: &[f64]) -> PointsSamples {
        let at = |times: &[f64]| samples(times, &vec![12.0; times.len()]);
        PointsSamples {
            times: times.to_vec(),
            points: samples(times, &[1.0, 2.0, 3.0][..times.len()]).values,
            rates: Rates {
                velocities: at(velocity_times),
                accelerations: at(velocity_times),
                time_codes_per_second: 24.0,
            },
        }
    }

    #[test]
    fn faults_are_told_apart() {
        let nan = Vec3::new(0.0, f32::NAN, 0.0);
        let far = Vec3::new(0.0, 0.0, -1.0e30);
        let tell = |points: &[Vec3]| fault(&[vec![Vec3::ZERO], points.to_vec()]);
        assert_eq!(tell(&[nan]), "not finite");
        assert_eq!(tell(&[far]), "beyond the largest coordinate, 1e12");
        assert_eq!(
            tell(&[far, nan]),
            "not finite or beyond the largest coordinate, 1e12"
        );
    }

    #[test]
    fn the_frame_is_between_two_samples() {
        let of = |times: &[f64]| {
            let b = Bracket::of(times).unwrap();
            (b.sample, b.below, b.above)
        };
        assert_eq!(of(&[2.0, -1.0, -0.5, 1.0]), (2, -0.5, 1.0));
        assert_eq!(
            of(&[0.0, 1.0]),
            (0, 0.0, 1.0),
            "at a sample the next is above"
        );
        assert_eq!(of(&[2.0, 1.0]), (1, 1.0, 1.0), "all later");
        assert_eq!(of(&[-2.0, -1.0]), (1, -1.0, -1.0), "all earlier");
        assert_eq!(
            of(&[-1.0, -1.0, 3.0, 3.0]),
            (1, -1.0, 3.0),
            "the last counts"
        );
        assert_eq!(of(&[3.0, 3.0]), (1, 3.0, 3.0), "the last counts");
        assert_eq!(of(&[f64::NAN, 0.0]).0, 1);
        assert_eq!(Bracket::of(&[f64::INFINITY]), None);
    }

    #[test]
    fn points_follow_the_parabola_from_their_own_time() {
        let samples = points(&[-2.0, 1.0], &[-2.0, 1.0]);
        let mut faults = Vec::new();
        let moving = RatedPoints::new(&samples, &mut faults).unwrap();
        assert!(faults.is_empty());
        let (keys, staying) = moving.at(&[-2.0, 0.0, 22.0]);
        let x: Vec<f32> = keys.iter().map(|k| k[0].x).collect();
        // One second on: 1 + 12 + 6.
        assert_eq!(x, [1.0, 1.0 + 12.0 / 12.0 + 6.0 / 144.0, 19.0]);
        assert_eq!(staying, 0);
        assert!((moving.bend(-1.0, 1.0) - 12.0 / 144.0 / 8.0).abs() < 1e-12);
    }

    #[test]
    fn rates_of_other_times_or_lengths_do_not_count() {
        for times in [&[-2.5, 1.0][..], &[-2.0, 0.5], &[-2.0]] {
            let samples = points(&[-2.0, 1.0], times);
            let mut faults = Vec::new();
            assert!(RatedPoints::new(&samples, &mut faults).is_none());
            assert_eq!(faults, [RateFault::Times("velocities")], "{times:?}");
        }
        let mut samples = points(&[0.0], &[0.0]);
        samples.rates.accelerations.values[0] = Arc::new(vec![Vec3::X; 2]);
        let mut faults = Vec::new();
        let moving = RatedPoints::new(&samples, &mut faults).unwrap();
        assert!(!moving.is_curved());
        let text = faults[0].to_string();
        assert_eq!(text, "2 accelerations for 1 values; they are ignored");
        samples.rates.velocities.values[0] = Arc::new(vec![]);
        assert!(RatedPoints::new(&samples, &mut faults).is_none());
        assert_eq!(faults.len(), 1, "empty rates are as none");
    }

    #[test]
    fn seconds_must_be_there() {
        for rate in [0.0, -24.0, f64::NAN, f64::INFINITY] {
            let mut samples = points(&[0.0], &[0.0]);
            samples.rates.time_codes_per_second = rate;
            let mut faults = Vec::new();
            assert!(RatedPoints::new(&samples, &mut faults).is_none());
            assert_eq!(faults, [RateFault::NoSeconds]);
        }
    }

    #[test]
    fn what_cannot_be_followed_stays() {
        let mut samples = points(&[0.0], &[0.0]);
        samples.points[0] = Arc::new(vec![Vec3::ONE; 4]);
        let x = |x: f32| Vec3::new(x, 0.0, 0.0);
        samples.rates.velocities.values[0] =
            Arc::new(vec![x(f32::NAN), x(1.0e30), Vec3::ZERO, x(24.0)]);
        samples.rates.accelerations.values[0] =
            Arc::new(vec![Vec3::ZERO, Vec3::ZERO, x(f32::INFINITY), Vec3::ZERO]);
        let moving = RatedPoints::new(&samples, &mut Vec::new()).unwrap();
        let (keys, staying) = moving.at(&[0.0, 1.0]);
        assert_eq!(staying, 3);
        assert_eq!(
            keys[1],
            [Vec3::ONE, Vec3::ONE, Vec3::ONE, x(1.0) + Vec3::ONE]
        );
        assert_eq!(moving.bend(0.0, 1.0), 0.0);
    }

    #[test]
    fn orientations_turn_about_axes_of_their_space() {
        let q = DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
        // The x axis is along x after q, and along y after a quarter turn about z.
        let turned = turn(Vec3::Z * 180.0, 0.5) * q;
        assert!((turned * DVec3::X - DVec3::Y).length() < 1e-12);
        for none in [Vec3::ZERO, Vec3::NAN, Vec3::INFINITY] {
            assert_eq!(turn(none, 0.5), DQuat::IDENTITY);
        }
    }
}
