//! Points at keys across the shutter, from raw samples or by rates: one way for every kind of prim
//! that has points.

use glam::Vec3;

use super::measure::ObjectBounds;
use crate::diagnostics::{Code, Warning};
use crate::motion::rates::{LARGEST_COORDINATE, RatedPoints};
use crate::motion::{Shutter, Timeline, transform};
use crate::scene::PointsSamples;

/// Straight segments that a path bent by accelerations gets on its own account, at most: the chord's
/// distance falls with their square.
const MAX_SEGMENTS: f64 = 32.0;

/// Object-space points at keys across the shutter.
#[derive(Clone, Debug, PartialEq)]
pub struct PointKeys {
    /// Key times in [0, 1]; `[0]` when the points stand still.
    pub times: Vec<f32>,
    /// Points at each key, all of one length.
    pub points: Vec<Vec<Vec3>>,
}

/// How many keys a path gets that accelerations bend.
#[derive(Clone, Copy)]
pub enum Bends<'a> {
    /// So many, evenly spaced (motion:nonlinearSampleCount); at least 2 and at most
    /// [`transform::MAX_KEYS`] are made.
    Samples(u32),
    /// As many as keep chords within a distance of the path, in object-space units: what the
    /// function makes of the box around the points.
    Within(&'a (dyn Fn(&ObjectBounds) -> f64 + Sync)),
}

/// Points at keys across `shutter`; equal keys become one.
///
/// Where velocities count, they move the sample at or before the frame (see
/// [`crate::motion::rates`]), and other samples are not used. Where they do not, samples are blended;
/// those that differ in length cannot be: the last at or before the frame is taken, of those that
/// have at least `needed` points where there are any.
pub fn point_keys(
    path: &str,
    samples: &PointsSamples,
    needed: usize,
    shutter: Shutter,
    bends: Bends<'_>,
    warnings: &mut Vec<Warning>,
) -> Option<PointKeys> {
    let mut faults = Vec::new();
    let rated = RatedPoints::new(samples, &mut faults);
    let fault = |f: &dyn std::fmt::Display| Warning::new(path, Code::TimeSamples, f.to_string());
    warnings.extend(faults.iter().map(|f| fault(f)));
    let (times, points) = match rated {
        Some(rated) => by_rates(path, &rated, shutter, bends, warnings),
        None => by_samples(path, samples, needed, shutter, warnings)?,
    };
    if points.windows(2).all(|w| w[0] == w[1]) {
        return Some(PointKeys {
            times: vec![0.0],
            points: points.into_iter().take(1).collect(),
        });
    }
    Some(PointKeys {
        times: times.iter().map(|&t| t as f32).collect(),
        points,
    })
}

type Keys = (Vec<f64>, Vec<Vec<Vec3>>);

fn by_rates(
    path: &str,
    rated: &RatedPoints<'_>,
    shutter: Shutter,
    bends: Bends<'_>,
    warnings: &mut Vec<Warning>,
) -> Keys {
    let even = |segments: u32| -> Vec<f64> {
        let time = |i| f64::from(i) / f64::from(segments);
        (0..=segments).map(time).collect()
    };
    let times = match bends {
        _ if shutter.is_still() => vec![0.0],
        _ if !rated.is_curved() => even(1),
        Bends::Samples(count) => even(count.clamp(2, transform::MAX_KEYS as u32) - 1),
        Bends::Within(tolerance) => {
            let (keys, _) = rated.at(&[0.0, 0.5, 1.0].map(|t| shutter.time_code(t)));
            let allowed = tolerance(&ObjectBounds::of(&keys));
            let bend = rated.bend(shutter.open, shutter.close);
            let segments = (bend / allowed).sqrt().ceil().clamp(1.0, MAX_SEGMENTS);
            // What is not a number, where nothing is to be seen, becomes 0 and then 1.
            even((segments as u32).max(1))
        }
    };
    let codes: Vec<f64> = times.iter().map(|&t| shutter.time_code(t)).collect();
    let (points, staying) = rated.at(&codes);
    if staying > 0 {
        let text = format!(
            "velocities or accelerations of {staying} points are not finite, or take them beyond \
             {LARGEST_COORDINATE:e}; these points do not move"
        );
        warnings.push(Warning::new(path, Code::NotFinite, text));
    }
    (times, points)
}

fn by_samples(
    path: &str,
    samples: &PointsSamples,
    needed: usize,
    shutter: Shutter,
    warnings: &mut Vec<Warning>,
) -> Option<Keys> {
    let count = samples.points.len().min(samples.times.len());
    let lengths = samples.points[..count].iter().map(|p| p.len());
    if lengths.clone().min() != lengths.max() {
        // The topology is the frame's, and holds since the sample at or before it.
        let best = (0..count).min_by(|&a, &b| {
            let rank = |i: usize| {
                let (points, time) = (samples.points[i].len(), samples.times[i]);
                (points < needed, time > 0.0, time.abs())
            };
            rank(a)
                .partial_cmp(&rank(b))
                .unwrap_or(std::cmp::Ordering::Equal)
        })?;
        let text = "point samples differ in length within the shutter; one sample is rendered, \
                    without deformation blur";
        warnings.push(Warning::new(path, Code::TimeSamples, text));
        return Some((vec![0.0], vec![samples.points[best].to_vec()]));
    }
    let Some(timeline) = Timeline::new(&samples.times[..count], shutter) else {
        let text = "no point sample has a finite time; the prim is dropped";
        warnings.push(Warning::new(path, Code::TimeSamples, text));
        return None;
    };
    let times = timeline.key_times(shutter.is_still());
    let blended = |&t: &f64| {
        let blend = timeline.blend(t);
        let (a, b) = (&samples.points[blend.a], &samples.points[blend.b]);
        if blend.f == 0.0 {
            return a.to_vec();
        }
        let mix = |(a, b): (&Vec3, &Vec3)| {
            (a.as_dvec3() * (1.0 - blend.f) + b.as_dvec3() * blend.f).as_vec3()
        };
        a.iter().zip(b.iter()).map(mix).collect()
    };
    let points = times.iter().map(blended).collect();
    Some((times, points))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Rates, Samples};
    use std::sync::Arc;

    const SHUTTER: Shutter = Shutter {
        open: -0.5,
        close: 0.5,
    };

    fn two(x: f32) -> Arc<Vec<Vec3>> {
        Arc::new(vec![Vec3::ZERO, Vec3::X * x])
    }

    /// Two points, samples at -0.5 and 0.5; 24 units a second, and squared, for the second.
    fn rated() -> PointsSamples {
        let times = vec![-0.5, 0.5];
        let both = |values: Arc<Vec<Vec3>>| Samples {
            times: times.clone(),
            values: vec![values.clone(), values],
        };
        PointsSamples {
            times: times.clone(),
            points: vec![two(1.0), two(100.0)],
            rates: Rates {
                velocities: both(two(24.0)),
                accelerations: both(two(24.0 * 24.0)),
                time_codes_per_second: 24.0,
            },
        }
    }

    fn keys(samples: &PointsSamples, shutter: Shutter, bends: Bends<'_>) -> (Vec<f32>, Vec<f32>) {
        let mut warnings = Vec::new();
        let keys = point_keys("/p", samples, 0, shutter, bends, &mut warnings).unwrap();
        assert!(warnings.is_empty(), "{warnings:?}");
        let x = keys.points.iter().map(|p| p[1].x).collect();
        (keys.times, x)
    }

    #[test]
    fn velocities_alone_make_two_keys_and_a_still_shutter_one() {
        let mut samples = rated();
        samples.rates.accelerations = Samples::default();
        let few = Bends::Samples(7);
        let found = keys(&samples, SHUTTER, few);
        assert_eq!(found, (vec![0.0, 1.0], vec![1.0, 2.0]));
        let still = Shutter {
            open: 0.25,
            close: 0.25,
        };
        assert_eq!(keys(&samples, still, few), (vec![0.0], vec![1.75]));
        samples.rates.velocities.values = vec![two(0.0), two(0.0)];
        let found = keys(&samples, SHUTTER, few);
        assert_eq!(found, (vec![0.0], vec![1.0]), "nothing moves");
    }

    #[test]
    fn accelerations_add_keys_as_asked() {
        let samples = rated();
        let found = keys(&samples, SHUTTER, Bends::Samples(3));
        assert_eq!(found, (vec![0.0, 0.5, 1.0], vec![1.0, 1.625, 2.5]));
        for count in [0, 1, 2] {
            assert_eq!(keys(&samples, SHUTTER, Bends::Samples(count)).0.len(), 2);
        }
        let most = keys(&samples, SHUTTER, Bends::Samples(u32::MAX)).0.len();
        assert_eq!(most, transform::MAX_KEYS);
    }

    #[test]
    fn chords_keep_to_the_parabola() {
        let samples = rated();
        for allowed in [1.0, 0.05, 0.01, 1.0e-3] {
            let tolerance = |bounds: &ObjectBounds| {
                assert!((bounds.max.x - 2.5).abs() < 1e-6 && bounds.min.x.abs() < 1e-6);
                allowed
            };
            let (times, x) = keys(&samples, SHUTTER, Bends::Within(&tolerance));
            let worst = times
                .windows(2)
                .zip(x.windows(2))
                .fold(0.0f32, |worst, (t, x)| {
                    let middle = (t[0] + t[1]) / 2.0;
                    let exact = 1.0 + middle + middle * middle / 2.0;
                    worst.max((exact - (x[0] + x[1]) / 2.0).abs())
                });
            assert!(f64::from(worst) <= allowed * 1.001, "{worst} at {allowed}");
            let fewer = (times.len() - 2) as f64;
            let needed = fewer == 0.0 || 0.125 / fewer.powi(2) > allowed;
            assert!(needed, "{} keys are too many at {allowed}", times.len());
        }
        for never in [0.0, f64::NAN, f64::INFINITY, -1.0] {
            let segments = keys(&samples, SHUTTER, Bends::Within(&|_| never)).0.len() - 1;
            let wanted = if never == 0.0 { 32 } else { 1 };
            assert_eq!(segments, wanted, "{never}");
        }
    }

    #[test]
    fn samples_that_differ_in_length_are_blended_by_no_one_but_velocities() {
        let mut samples = rated();
        samples.points[1] = Arc::new(vec![Vec3::ZERO; 5]);
        let found = keys(&samples, SHUTTER, Bends::Samples(2));
        assert_eq!(found, (vec![0.0, 1.0], vec![1.0, 2.5]));
        samples.rates = Rates::default();
        let mut warnings = Vec::new();
        let none = Bends::Samples(2);
        let one = point_keys("/p", &samples, 0, SHUTTER, none, &mut warnings).unwrap();
        assert_eq!(
            (one.times, one.points),
            (vec![0.0], vec![two(1.0).to_vec()])
        );
        assert_eq!(warnings.len(), 1);
    }

    #[test]
    fn rates_that_do_not_fit_leave_the_samples_and_a_warning() {
        type Change = fn(&mut Rates);
        let changes: [(&str, Change); 4] = [
            ("velocities have other sample times", |r| {
                r.velocities.times[1] = 0.25
            }),
            ("3 velocities for 2 values", |r| {
                r.velocities.values[0] = Arc::new(vec![Vec3::ZERO; 3]);
            }),
            ("a number of time codes a second", |r| {
                r.time_codes_per_second = 0.0
            }),
            ("velocities or accelerations of 1 points", |r| {
                r.velocities.values[0] = two(f32::NAN);
            }),
        ];
        for (text, change) in changes {
            let mut samples = rated();
            change(&mut samples.rates);
            let mut warnings = Vec::new();
            let bends = Bends::Samples(2);
            let keys = point_keys("/p", &samples, 0, SHUTTER, bends, &mut warnings).unwrap();
            assert_eq!(warnings.len(), 1, "{warnings:?}");
            assert!(warnings[0].text.contains(text), "{warnings:?}");
            assert!(keys.points.iter().flatten().all(|p| p.is_finite()));
        }
    }
}
