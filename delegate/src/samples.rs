//! Samples of transforms, from what a host knows of their paths.

use glam::DMat4;
use hdtrapeze_core::motion::follow::{Next, Of, Path};

/// Differences that are rounding: parts of the largest number.
const SAME: f64 = 1.0e-6;

/// Evaluates a transform, in USD's layout, until the lines between its samples keep to its path: times,
/// ascending, and matrices. `start`, ascending, are the times where the path may have corners, its ends
/// included. `None` where a value is held next to one of them: that is no path, but samples of one.
pub fn sample(
    start: &[f64],
    mut at: impl FnMut(f64) -> [f64; 16],
) -> Option<Vec<(f64, [f64; 16])>> {
    let mut times = start.to_vec();
    let mut values: Vec<[f64; 16]> = start.iter().map(|&t| at(t)).collect();
    for (ends, pair) in start.windows(2).zip(values.windows(2)) {
        let quarter = 0.25 * (ends[1] - ends[0]);
        if pair[0] != pair[1]
            && (at(ends[0] + quarter) == pair[0] || at(ends[1] - quarter) == pair[1])
        {
            return None;
        }
    }
    loop {
        let path = Path {
            of: Of::Matrices,
            times: &times,
            start: start.len(),
            values: values.iter().map(<[f64; 16]>::as_slice).collect(),
        };
        match path.next() {
            Next::Evaluate(more) => {
                values.extend(more.iter().map(|&t| at(t)));
                times.extend(more);
            }
            Next::Keep(kept) => return Some(kept.iter().map(|&i| (times[i], values[i])).collect()),
        }
    }
}

/// The sample at the frame, by its place, where its matrices lie on the lines between those of the samples
/// before and after it, but for rounding. `None` also where there is no such sample, or none on one of
/// its sides.
pub fn straight_frame<'a>(times: &[f64], at: impl Fn(usize) -> &'a [DMat4]) -> Option<usize> {
    let places = || 0..times.len();
    let nearest = |a: &usize, b: &usize| times[*a].abs().total_cmp(&times[*b].abs());
    let frame = places().find(|&i| times[i] == 0.0)?;
    let before = places().filter(|&i| times[i] < 0.0).min_by(nearest)?;
    let after = places().filter(|&i| times[i] > 0.0).min_by(nearest)?;
    let [first, now, last] = [before, frame, after].map(at);
    let part = times[before] / (times[before] - times[after]);
    let is_straight =
        |((a, m), b): ((&DMat4, &DMat4), &DMat4)| is_same(&(*a + (*b - *a) * part), m);
    let fits = first.len() == now.len() && last.len() == now.len();
    (fits && first.iter().zip(now).zip(last).all(is_straight)).then_some(frame)
}

/// To a part of the largest number of the linear part, and of the translation.
fn is_same(a: &DMat4, b: &DMat4) -> bool {
    let linear =
        |m: &DMat4| [m.x_axis, m.y_axis, m.z_axis].map(|axis| axis.truncate().abs().max_element());
    let largest = |m: &DMat4| {
        [
            linear(m).into_iter().fold(0.0, f64::max),
            m.w_axis.truncate().abs().max_element(),
        ]
    };
    let (error, size) = (largest(&(*a - *b)), largest(b));
    // Not where one is no number.
    (0..2).all(|i| error[i] <= SAME * size[i])
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn turned(time: f64) -> DMat4 {
        DMat4::from_translation(DVec3::new(7.0, 0.0, 0.0)) * DMat4::from_rotation_z(time)
    }

    #[test]
    fn a_path_is_evaluated_until_lines_keep_to_it() {
        let samples = sample(&[-0.5, 0.0, 0.5], |t| turned(t).to_cols_array()).unwrap();
        assert!((8..=33).contains(&samples.len()), "{}", samples.len());
        assert!(samples.is_sorted_by(|a, b| a.0 < b.0));
        assert!(
            samples
                .iter()
                .all(|(t, m)| *m == turned(*t).to_cols_array())
        );
        let still = sample(&[-0.5, 0.5], |_| turned(1.0).to_cols_array()).unwrap();
        assert_eq!(still.len(), 1);
    }

    #[test]
    fn what_is_held_is_no_path() {
        let held = |t: f64| turned(t.floor()).to_cols_array();
        assert!(sample(&[0.0, 1.0], held).is_none());
        let held = |t: f64| turned(t.ceil()).to_cols_array();
        assert!(sample(&[0.0, 1.0], held).is_none());
    }

    #[test]
    fn the_frame_lies_on_the_line_or_off_it() {
        let blend = |f: f64| turned(-1.0) * (1.0 - f) + turned(0.5) * f;
        let find = |times: &[f64], values: &[&[DMat4]]| straight_frame(times, |i| values[i]);
        let (first, last) = (&[turned(-1.0)][..], &[turned(0.5)][..]);
        let (on, off) = (&[blend(2.0 / 3.0)][..], &[turned(0.0)][..]);
        let times = [-1.0, 0.5, 0.0];
        assert_eq!(find(&times, &[first, last, on]), Some(2));
        assert_eq!(find(&times, &[first, last, off]), None);
        // The nearest ones count, in any order, and there must be one on each side.
        let far = &[turned(3.0)][..];
        assert_eq!(
            find(&[-2.0, -1.0, 0.0, 0.5], &[far, first, on, last]),
            Some(2)
        );
        assert_eq!(find(&[0.0, 0.5], &[on, last]), None);
        assert_eq!(find(&[-1.0, 0.5], &[first, last]), None);
        // One of an array is enough.
        let both = |m: &[DMat4]| [turned(0.2), m[0]];
        let (first, on, off, last) = (both(first), both(on), both(off), both(last));
        assert_eq!(find(&times, &[&first, &last, &on]), Some(2));
        assert_eq!(find(&times, &[&first, &last, &off]), None);
        assert_eq!(find(&times, &[&first, &last, &on[..1]]), None);
        let nan = [DMat4::NAN];
        assert_eq!(find(&times, &[&nan, &nan, &nan]), None);
    }
}
