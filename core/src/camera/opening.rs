//! When a sample sees: the shutter's opening, and the part of the shutter that is rendered.
//!
//! A shutter that opens and closes gradually gives instants unequal weight. Times are drawn with
//! that density, through the inverse of its running integral, which is monotone: well-spread numbers
//! become well-spread times, every sample weighs the same, and the image stays as bright.

use super::CameraNotes;
use crate::diagnostics::number;
use crate::scene::{ShutterCurveDesc, ShutterCurveKind};

/// Straight pieces that a Bezier segment becomes: their openness is within 1/8 (1/16)^2 of its
/// second derivative, 0.6 % of full openness where control points lie between 0 and 1.
const PIECES: usize = 16;

/// A corner of the curve, and the integral up to it as a share of the whole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// In [0, 1] across the shutter.
    pub time: f64,
    /// Of integral 1 across the shutter.
    pub openness: f64,
    /// The integral up to here, 0 to 1.
    pub share: f64,
}

/// Openness over the shutter, linear between corners, of integral 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Opening {
    corners: Vec<Corner>,
}

impl Opening {
    /// Resolves a curve. `None` for a shutter that is equally open throughout; a curve that cannot
    /// be used is noted and counts as such.
    pub fn new(desc: &ShutterCurveDesc, notes: &mut CameraNotes) -> Option<Self> {
        if desc.points.is_empty() {
            return None;
        }
        match corners(desc) {
            Ok(corners) => corners.map(|corners| Self { corners }),
            Err(why) => {
                notes.push(format!(
                    "the shutter's curve {why}; it is open throughout instead"
                ));
                None
            }
        }
    }

    /// Its corners; the first is at 0, the last at 1.
    pub fn corners(&self) -> &[Corner] {
        &self.corners
    }

    /// The time below which `share` of the openness lies.
    fn time(&self, share: f64) -> f64 {
        let last = self.corners.len() - 1;
        let next = self
            .corners
            .partition_point(|c| c.share <= share)
            .clamp(1, last);
        let (a, b) = (&self.corners[next - 1], &self.corners[next]);
        let span = b.time - a.time;
        if span <= 0.0 {
            return a.time;
        }
        // openness t + slope / 2 t^2 = area, in the form that has no cancellation.
        let area = (share - a.share).max(0.0);
        let slope = (b.openness - a.openness) / span;
        let root = (a.openness * a.openness + 2.0 * slope * area)
            .max(0.0)
            .sqrt();
        let divisor = a.openness + root;
        let t = if divisor > 0.0 {
            2.0 * area / divisor
        } else {
            0.0
        };
        (a.time + t).clamp(a.time, b.time)
    }

    /// The share of the openness before `time`.
    fn share(&self, time: f64) -> f64 {
        let last = self.corners.len() - 1;
        let next = self
            .corners
            .partition_point(|c| c.time <= time)
            .clamp(1, last);
        let (a, b) = (&self.corners[next - 1], &self.corners[next]);
        let span = b.time - a.time;
        if span <= 0.0 {
            return b.share;
        }
        let t = (time - a.time).clamp(0.0, span);
        let slope = (b.openness - a.openness) / span;
        (a.share + t * (a.openness + 0.5 * slope * t)).min(1.0)
    }
}

/// Corners from 0 to 1 with openness scaled to an integral of 1; `None` where it is all the same.
fn corners(desc: &ShutterCurveDesc) -> Result<Option<Vec<Corner>>, String> {
    let points = &desc.points;
    for (i, [position, openness]) in points.iter().enumerate() {
        if !(0.0..=1.0).contains(position) {
            let position = number(*position);
            return Err(format!("has position {position}, not from 0 to 1"));
        }
        if !(openness.is_finite() && *openness >= 0.0) {
            let openness = number(*openness);
            return Err(format!("has openness {openness}, not a number from 0 up"));
        }
        if i > 0 && *position < points[i - 1][0] {
            return Err("has positions that do not ascend".to_owned());
        }
    }
    let line = match desc.kind {
        ShutterCurveKind::Linear => points.clone(),
        ShutterCurveKind::Bezier if points.len() % 3 == 1 => straightened(points),
        ShutterCurveKind::Bezier => {
            return Err(format!(
                "has {} points, not 3 n + 1 as Bezier segments do",
                points.len()
            ));
        }
    };
    let (first, last) = (line[0], line[line.len() - 1]);
    let mut all = vec![[0.0, first[1]]];
    all.extend(line);
    all.push([1.0, last[1]]);
    all.dedup();
    if all.iter().all(|p| p[1] == first[1]) && first[1] > 0.0 {
        return Ok(None);
    }
    let largest = all.iter().fold(0.0f64, |a, p| a.max(p[1]));
    let area = |a: &[f64; 2], b: &[f64; 2]| (b[0] - a[0]) * (a[1] / largest + b[1] / largest) * 0.5;
    let total: f64 = all.windows(2).map(|w| area(&w[0], &w[1])).sum();
    // Also where it is NaN: closed throughout.
    if total.partial_cmp(&0.0) != Some(std::cmp::Ordering::Greater) {
        return Err("never opens".to_owned());
    }
    let mut share = 0.0;
    let corners = (0..all.len()).map(|i| {
        if i > 0 {
            share += area(&all[i - 1], &all[i]) / total;
        }
        Corner {
            time: all[i][0],
            openness: all[i][1] / largest / total,
            share,
        }
    });
    Ok(Some(corners.collect()))
}

/// Bezier segments to straight pieces. Positions ascend along each segment, since those of its control
/// points do.
fn straightened(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut line = vec![points[0]];
    for segment in points.windows(4).step_by(3) {
        for i in 1..PIECES {
            let f = i as f64 / PIECES as f64;
            let g = 1.0 - f;
            let weights = [g * g * g, 3.0 * g * g * f, 3.0 * g * f * f, f * f * f];
            let at = |axis: usize| -> f64 { (0..4).map(|k| weights[k] * segment[k][axis]).sum() };
            // Rounding must not turn the order around.
            let position = at(0).max(line[line.len() - 1][0]).min(segment[3][0]);
            line.push([position, at(1)]);
        }
        line.push(segment[3]);
    }
    line
}

/// How drawn numbers become times: over a part of the shutter, where it is open.
#[derive(Clone, Debug)]
pub struct Times {
    window: [f32; 2],
    /// The opening, its share before the window, and its share within.
    drawn: Option<(Opening, f64, f64)>,
}

impl Times {
    /// Times in `window`, part of [0, 1]. Where the shutter is closed throughout the window, it
    /// counts as open throughout.
    pub fn new(opening: Option<&Opening>, window: [f32; 2]) -> Self {
        let drawn = opening.and_then(|opening| {
            let [first, last] = window.map(|t| opening.share(f64::from(t)));
            (last > first).then(|| (opening.clone(), first, last - first))
        });
        Self { window, drawn }
    }

    /// The part of [0, 1] that times are in.
    pub fn window(&self) -> [f32; 2] {
        self.window
    }

    /// Where times are drawn from an opening: it, its share before the window, and its share within.
    pub fn drawn(&self) -> Option<(&Opening, f64, f64)> {
        let (opening, first, span) = self.drawn.as_ref()?;
        Some((opening, *first, *span))
    }

    /// The time for a number in [0, 1); ascends with it.
    #[inline]
    pub fn at(&self, number: f32) -> f32 {
        let [a, b] = self.window;
        match &self.drawn {
            None => a + (b - a) * number,
            Some((opening, first, span)) => {
                let time = opening.time(first + span * f64::from(number));
                (time as f32).clamp(a, b)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn opening(kind: ShutterCurveKind, points: &[[f64; 2]]) -> Option<Opening> {
        let mut notes = CameraNotes::new();
        let points = points.to_vec();
        let opening = Opening::new(&ShutterCurveDesc { kind, points }, &mut notes);
        assert!(notes.is_empty(), "{notes:?}");
        opening
    }

    /// Mean of `f(time)` over well-spread numbers.
    fn mean(times: &Times, f: impl Fn(f64) -> f64) -> f64 {
        let n = 1 << 16;
        let number = |i: u32| (i as f32 + 0.5) / n as f32;
        let sum: f64 = (0..n).map(|i| f(f64::from(times.at(number(i))))).sum();
        sum / f64::from(n)
    }

    #[test]
    fn moments_of_a_trapezoid_a_ramp_and_a_step() {
        let trapezoid = [[0.0, 0.0], [0.25, 1.0], [0.5, 1.0], [1.0, 0.0]];
        // Areas 1/8, 1/4, 1/4 of 5/8; centroids 1/6, 3/8, 2/3.
        let centroid = (0.125 / 6.0 + 0.25 * 0.375 + 0.25 * 2.0 / 3.0) / 0.625;
        let cases: [(&[[f64; 2]], f64, f64); 4] = [
            (&trapezoid, centroid, f64::NAN),
            (&[[0.0, 0.0], [1.0, 7.0]], 2.0 / 3.0, 0.5),
            (&[[0.5, 3.0], [0.5, 0.0]], 0.25, 1.0 / 12.0),
            // Held before and after: 1 below 1/4, falling to 0 at 3/4.
            (&[[0.25, 1.0], [0.75, 0.0]], 13.0 / 48.0, f64::NAN),
        ];
        for (points, first, second) in cases {
            let times = Times::new(
                opening(ShutterCurveKind::Linear, points).as_ref(),
                [0.0, 1.0],
            );
            assert!((mean(&times, |t| t) - first).abs() < 1e-4, "{points:?}");
            let square = mean(&times, |t| t * t);
            assert!(
                second.is_nan() || (square - second).abs() < 1e-4,
                "{points:?} {square}"
            );
        }
    }

    #[test]
    fn numbers_keep_their_order_and_shares_invert_times() {
        let points = [
            [0.1, 0.0],
            [0.3, 2.0],
            [0.3, 0.5],
            [0.6, 0.0],
            [0.8, 0.0],
            [0.9, 1.0],
        ];
        let opening = opening(ShutterCurveKind::Linear, &points).unwrap();
        let mut before = 0.0;
        for i in 0..=1000 {
            let share = f64::from(i) / 1000.0;
            let time = opening.time(share);
            assert!(time >= before && time <= 1.0);
            before = time;
            assert!((opening.share(time) - share).abs() < 1e-9, "{share}");
            assert!(!(0.6 + 1e-6..0.8).contains(&time), "closed at {time}");
        }
    }

    #[test]
    fn bezier_ramps_are_their_polynomials() {
        // A segment whose control positions are evenly spread has position f, openness 3 f^2 - 2 f^3.
        let third = 1.0 / 3.0;
        let points = [[0.0, 0.0], [third, 0.0], [2.0 * third, 1.0], [1.0, 1.0]];
        let times = Times::new(
            opening(ShutterCurveKind::Bezier, &points).as_ref(),
            [0.0, 1.0],
        );
        // Integrals of t (3 t^2 - 2 t^3) and of 3 t^2 - 2 t^3 over [0, 1]: 3/4 - 2/5 and 1/2.
        assert!((mean(&times, |t| t) - 0.7).abs() < 1e-3);
    }

    #[test]
    fn only_ratios_of_openness_matter() {
        for scale in [1.0e-310, 1.0, 1.0e308] {
            let points = [[0.0, scale], [0.5, scale], [1.0, 0.0]];
            let times = Times::new(
                opening(ShutterCurveKind::Linear, &points).as_ref(),
                [0.0, 1.0],
            );
            // Areas 1/2 and 1/4, centroids 1/4 and 2/3.
            let expected = (0.125 + 1.0 / 6.0) / 0.75;
            assert!((mean(&times, |t| t) - expected).abs() < 1e-4, "{scale}");
        }
    }

    #[test]
    fn even_shutters_are_none_at_all() {
        for points in [
            &[][..],
            &[[0.5, 2.0]],
            &[[0.0, 1.0], [0.7, 1.0], [1.0, 1.0]],
        ] {
            assert_eq!(
                opening(ShutterCurveKind::Linear, points),
                None,
                "{points:?}"
            );
        }
        let times = Times::new(None, [0.25, 0.5]);
        assert_eq!(times.at(0.5), 0.375);
    }

    #[test]
    fn a_window_sees_its_part_of_the_curve() {
        let ramp = opening(ShutterCurveKind::Linear, &[[0.0, 0.0], [1.0, 1.0]]);
        let times = Times::new(ramp.as_ref(), [0.5, 1.0]);
        // Integrals of t^2 and t over [1/2, 1].
        assert!((mean(&times, |t| t) - (7.0 / 24.0) / (3.0 / 8.0)).abs() < 1e-4);
        assert_eq!(Times::new(ramp.as_ref(), [0.25, 0.25]).at(0.9), 0.25);
        let late = opening(ShutterCurveKind::Linear, &[[0.5, 0.0], [1.0, 1.0]]);
        assert_eq!(
            Times::new(late.as_ref(), [0.0, 0.5]).at(0.5),
            0.25,
            "closed"
        );
    }

    #[test]
    fn curves_that_cannot_be_are_noted() {
        let bad: [(ShutterCurveKind, &[[f64; 2]]); 8] = [
            (ShutterCurveKind::Linear, &[[0.0, 0.0], [1.0, 0.0]]),
            (ShutterCurveKind::Linear, &[[0.0, 1.0], [1.0, -1.0]]),
            (ShutterCurveKind::Linear, &[[0.0, 1.0], [1.5, 1.0]]),
            (ShutterCurveKind::Linear, &[[f64::NAN, 1.0], [1.0, 0.0]]),
            (
                ShutterCurveKind::Linear,
                &[[0.0, f64::INFINITY], [1.0, 0.0]],
            ),
            (ShutterCurveKind::Linear, &[[0.5, 1.0], [0.25, 0.0]]),
            (
                ShutterCurveKind::Bezier,
                &[[0.0, 0.0], [0.5, 1.0], [1.0, 0.0]],
            ),
            (ShutterCurveKind::Bezier, &[[0.5, 0.0]]),
        ];
        for (kind, points) in bad {
            let mut notes = CameraNotes::new();
            let points = points.to_vec();
            let desc = ShutterCurveDesc { kind, points };
            assert_eq!(Opening::new(&desc, &mut notes), None, "{desc:?}");
            assert_eq!(notes.len(), 1, "{desc:?}");
        }
    }
}
