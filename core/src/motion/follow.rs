//! Samples of what a host can evaluate at any time: as many as keep the lines between them to its path.
//!
//! The host knows the path, this module what is missing: [`Path::next`] looks at what has been evaluated
//! and says where to evaluate next, by halving, or which samples are enough. How large a prim is on screen
//! is not known when it is sampled, so the tolerance is relative to the path's own size.

use std::collections::{BTreeSet, VecDeque};

/// Largest distance of a path from the line between samples. Of matrices, the linear part's is relative
/// to its size, the translation's to the larger of that size and the path's extent; of points it is
/// relative to the box around all of their paths. A wheel with a radius of 500 pixels is off by at most
/// an eighth of a pixel.
pub const TOLERANCE: f64 = 2.5e-4;

/// Samples at most: a full turn keeps to a radius of 500 pixels within 0.6 pixels.
pub const MOST_SAMPLES: usize = 64;

/// Sizes below this count as this.
const SMALLEST: f64 = 1.0e-30;

/// What is evaluated at each time; one or several that get the same samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Of {
    /// USD's matrices, 16 numbers each.
    Matrices,
    /// Points, 3 numbers each.
    Points,
}

/// A path as far as it has been evaluated.
#[derive(Clone, Debug)]
pub struct Path<'a> {
    /// What it is of.
    pub of: Of,
    /// Times of the values. The first `start` are those where the path may have corners, ascending; the
    /// others are what [`Path::next`] asked for, in any order.
    pub times: &'a [f64],
    /// How many times there were to begin with.
    pub start: usize,
    /// The numbers at each time; as many at all.
    pub values: Vec<&'a [f64]>,
}

/// What to do next.
#[derive(Clone, Debug, PartialEq)]
pub enum Next {
    /// Evaluate the path at these times, too: none that are known, and each once.
    Evaluate(Vec<f64>),
    /// It is enough: the samples to keep, by index, ascending in time.
    Keep(Vec<usize>),
}

/// Between two samples, and where the path is compared with the line between them.
struct Segment {
    ends: [f64; 2],
    probes: Vec<f64>,
}

impl Segment {
    fn new(ends: [f64; 2], fractions: &[f64]) -> Self {
        let probes = fractions.iter().map(|f| ends[0] + (ends[1] - ends[0]) * f);
        Self {
            ends,
            probes: probes.collect(),
        }
    }

    fn middle(&self) -> f64 {
        self.ends[0] + (self.ends[1] - self.ends[0]) * 0.5
    }
}

impl Path<'_> {
    /// Where to evaluate the path next, or what of it to keep: where nothing changes the first sample
    /// alone, and where a number is not finite those that there were to begin with.
    pub fn next(&self) -> Next {
        let begin = &self.times[..self.start];
        // A path may cross the line in the middle, so at first it is compared at the quarters as well.
        let segments = begin
            .windows(2)
            .map(|ends| Segment::new([ends[0], ends[1]], &[0.25, 0.5, 0.75]));
        let mut pending: VecDeque<Segment> = segments.collect();
        let probes = pending.iter().flat_map(|segment| segment.probes.iter());
        let first: Vec<f64> = begin.iter().chain(probes).copied().collect();
        let mut order: Vec<usize> = (0..self.times.len()).collect();
        order.sort_by(|&a, &b| self.times[a].total_cmp(&self.times[b]));
        let find = |time: f64| {
            let at = order.binary_search_by(|&i| self.times[i].total_cmp(&time));
            at.ok().map(|at| order[at])
        };
        let mut missing: Vec<f64> = first
            .iter()
            .copied()
            .filter(|&t| find(t).is_none())
            .collect();
        if !missing.is_empty() {
            missing.dedup();
            return Next::Evaluate(missing);
        }
        let values: Vec<&[f64]> = first
            .iter()
            .filter_map(|&t| Some(self.values[find(t)?]))
            .collect();
        if !values.iter().all(|v| v.iter().all(|x| x.is_finite())) {
            return Next::Keep((0..self.start).collect());
        }
        if values.iter().all(|v| *v == values[0]) {
            return Next::Keep((0..self.start.min(1)).collect());
        }
        let limits = self.limits(&values);
        let mut kept: BTreeSet<usize> = (0..self.start).collect();
        while let Some(segment) = pending.pop_front() {
            if kept.len() >= MOST_SAMPLES {
                break;
            }
            let ([a, b], middle) = (segment.ends, segment.middle());
            let (Some(first), Some(last)) = (find(a), find(b)) else {
                continue;
            };
            if !(a < middle && middle < b) {
                continue;
            }
            let unknown = segment.probes.iter().filter(|&&t| find(t).is_none());
            let before = missing.len();
            missing.extend(unknown);
            if missing.len() > before {
                continue; // what follows is seen once they are known
            }
            let misses = |&t: &f64| {
                let f = (t - a) / (b - a);
                find(t).is_some_and(|probe| self.misses([first, probe, last], f, limits))
            };
            if segment.probes.iter().any(misses)
                && let Some(middle_sample) = find(middle)
            {
                kept.insert(middle_sample);
                pending.push_back(Segment::new([a, middle], &[0.5]));
                pending.push_back(Segment::new([middle, b], &[0.5]));
            }
        }
        if missing.is_empty() {
            let mut kept: Vec<usize> = kept.into_iter().collect();
            kept.sort_by(|&a, &b| self.times[a].total_cmp(&self.times[b]));
            return Next::Keep(kept);
        }
        Next::Evaluate(missing)
    }

    /// What the linear part and what the place of one element may be off by.
    fn limits(&self, values: &[&[f64]]) -> [f64; 2] {
        let column = |from: usize, step: usize| {
            let each = values
                .iter()
                .flat_map(move |v| v[from..].iter().step_by(step));
            each.copied()
        };
        let (mut linear, mut extent) = (SMALLEST, SMALLEST);
        match self.of {
            Of::Matrices => {
                let count = values[0].len();
                for i in 0..count {
                    match i % 16 {
                        k if k % 4 == 3 => {}
                        0..12 => linear = column(i, count).fold(linear, |m, x| m.max(x.abs())),
                        _ => extent = extent.max(range(column(i, count))),
                    }
                }
            }
            Of::Points => {
                for axis in 0..values[0].len().min(3) {
                    extent = extent.max(range(column(axis, 3)));
                }
            }
        }
        [TOLERANCE * linear, TOLERANCE * extent.max(linear)]
    }

    /// Whether a sample is off the line between two others, `f` of the way along.
    fn misses(&self, [first, probe, last]: [usize; 3], f: f64, limits: [f64; 2]) -> bool {
        let limit = |i: usize| match (self.of, i % 16) {
            (Of::Points, _) => limits[1],
            (_, k) if k % 4 == 3 => f64::INFINITY, // USD's matrices are affine
            (_, k) => limits[usize::from(k >= 12)],
        };
        let ends = self.values[first].iter().zip(self.values[last]);
        let mut numbers = self.values[probe].iter().zip(ends).enumerate();
        numbers.any(|(i, (x, (a, b)))| (x - (a * (1.0 - f) + b * f)).abs() > limit(i))
    }
}

/// From the least to the largest number; 0 where there is none.
fn range(numbers: impl Iterator<Item = f64>) -> f64 {
    let (low, high) = numbers.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
        (low.min(x), high.max(x))
    });
    (high - low).max(0.0)
}

#[cfg(test)]
mod tests {
    use glam::{DMat4, DVec3};

    use super::*;

    /// Follows a path to its end, as a host does: times and values of the samples that are kept, and how
    /// often it was evaluated.
    fn follow(
        of: Of,
        start: &[f64],
        evaluate: impl Fn(f64) -> Vec<f64>,
    ) -> (Vec<f64>, Vec<Vec<f64>>, usize) {
        let mut times = start.to_vec();
        let mut values: Vec<Vec<f64>> = start.iter().map(|&t| evaluate(t)).collect();
        loop {
            let path = Path {
                of,
                times: &times,
                start: start.len(),
                values: values.iter().map(Vec::as_slice).collect(),
            };
            match path.next() {
                Next::Evaluate(more) => {
                    assert!(!more.is_empty() && more.iter().all(|t| !times.contains(t)));
                    values.extend(more.iter().map(|&t| evaluate(t)));
                    times.extend(more);
                }
                Next::Keep(kept) => {
                    let value = |&i: &usize| values[i].clone();
                    return (
                        kept.iter().map(|&i| times[i]).collect(),
                        kept.iter().map(value).collect(),
                        times.len(),
                    );
                }
            }
        }
    }

    fn turning(turns: f64) -> impl Fn(f64) -> Vec<f64> {
        move |t| {
            let turn = DMat4::from_rotation_z(t * turns * std::f64::consts::TAU);
            let place = DMat4::from_translation(DVec3::new(100.0 * t, 0.0, 0.0));
            (place * turn).to_cols_array().to_vec()
        }
    }

    #[test]
    fn lines_keep_to_the_arc_and_few_are_needed() {
        let (times, values, evaluated) = follow(Of::Matrices, &[0.0, 1.0], turning(0.1));
        assert!((8..=17).contains(&times.len()), "{times:?}");
        assert!(evaluated <= 3 * times.len());
        assert!(times.is_sorted() && times[0] == 0.0 && times[times.len() - 1] == 1.0);
        for (w, v) in times.windows(2).zip(values.windows(2)) {
            let middle = turning(0.1)(0.5 * (w[0] + w[1]));
            for i in (0..12).filter(|i| i % 4 < 3) {
                assert!((0.5 * (v[0][i] + v[1][i]) - middle[i]).abs() <= TOLERANCE);
            }
        }
    }

    #[test]
    fn samples_are_limited_and_spread() {
        let (times, ..) = follow(Of::Matrices, &[0.0, 1.0], turning(1.0));
        assert_eq!(times.len(), MOST_SAMPLES);
        let widest = times.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max);
        assert_eq!(widest, 1.0 / 32.0);
    }

    /// In the middle it is where the line is.
    #[test]
    fn what_crosses_the_line_is_seen_at_the_quarters() {
        let wave = |t: f64| vec![t, (t * std::f64::consts::TAU).sin(), 0.0];
        let (times, ..) = follow(Of::Points, &[0.0, 1.0], wave);
        assert!(times.len() > 16, "{times:?}");
    }

    #[test]
    fn straight_paths_keep_what_they_began_with_and_still_ones_one_sample() {
        let straight = |t: f64| vec![t, 3.0 * t, 5.0, -t, 0.0, 1.0];
        let start = [0.0, 0.3, 1.0];
        let (times, ..) = follow(Of::Points, &start, straight);
        assert_eq!(times, start);
        let (times, ..) = follow(Of::Points, &start, |_| vec![1.0, 2.0, 3.0]);
        assert_eq!(times, [0.0]);
        let (times, ..) = follow(Of::Points, &start, |_| Vec::new());
        assert_eq!(times, [0.0]);
        let (times, ..) = follow(Of::Matrices, &[2.0], turning(1.0));
        assert_eq!(times, [2.0]);
    }

    /// A corner at a time to begin with needs no sample beside it.
    #[test]
    fn corners_are_where_the_host_says() {
        let corner = |t: f64| vec![t.min(0.3), 0.0, 0.0];
        let (times, ..) = follow(Of::Points, &[0.0, 0.3, 1.0], corner);
        assert_eq!(times, [0.0, 0.3, 1.0]);
    }

    #[test]
    fn of_several_the_one_that_bends_most_counts() {
        let both = |t: f64| [turning(0.0)(t), turning(0.1)(t)].concat();
        let (times, ..) = follow(Of::Matrices, &[0.0, 1.0], both);
        let (alone, ..) = follow(Of::Matrices, &[0.0, 1.0], turning(0.1));
        assert_eq!(times, alone);
    }

    #[test]
    fn what_is_not_finite_stays_as_it_was() {
        let broken = |t: f64| vec![if t > 0.7 { f64::NAN } else { t }, t * t, 0.0];
        let (times, ..) = follow(Of::Points, &[0.0, 1.0], broken);
        assert_eq!(times, [0.0, 1.0]);
    }
}
