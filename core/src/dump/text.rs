//! Lines, numbers and arrays of a dump.

use std::fmt::Write;

use glam::DAffine3;

pub(super) use crate::diagnostics::number;

/// Arrays up to this length are printed whole.
const WHOLE: usize = 24;
/// Values printed at either end of longer arrays.
const ENDS: usize = 4;
/// A value this much smaller than the largest of its group is printed as 0.
const NOTHING: f64 = 1.0e-7;

/// Indented lines.
#[derive(Default)]
pub(super) struct Page {
    text: String,
    depth: usize,
}

impl Page {
    /// One line.
    pub fn line(&mut self, text: &str) {
        if !text.is_empty() {
            self.text.extend(std::iter::repeat_n("  ", self.depth));
            self.text.push_str(text);
        }
        self.text.push('\n');
    }

    /// Lines one step to the right.
    pub fn indented(&mut self, write: impl FnOnce(&mut Self)) {
        self.depth += 1;
        write(self);
        self.depth -= 1;
    }

    /// Everything that was written.
    pub fn finish(self) -> String {
        self.text
    }
}

/// Which of `count` keys, by its part of the shutter; nothing where there is one only: a value that
/// stays has no time.
pub(super) fn at(count: usize, time: impl Into<f64>) -> String {
    match count {
        1 => String::new(),
        _ => format!(" at shutter {}", number(time)),
    }
}

/// Two numbers.
pub(super) fn pair(values: [f64; 2]) -> String {
    numbers(&values)
}

/// Numbers of one group, apart by spaces.
pub(super) fn numbers(values: &[f64]) -> String {
    let scale = largest(values);
    join(values, scale)
}

fn largest(values: &[f64]) -> f64 {
    let finite = values.iter().filter(|x| x.is_finite());
    finite.fold(0.0f64, |m, x| m.max(x.abs()))
}

fn join(values: &[f64], scale: f64) -> String {
    let mut text = String::new();
    for (i, &x) in values.iter().enumerate() {
        let x = if x.abs() < NOTHING * scale { 0.0 } else { x };
        let _ = write!(text, "{}{}", if i > 0 { " " } else { "" }, number(x));
    }
    text
}

/// `width` numbers a value: `count: (x y z) (x y z)`. Long arrays show both ends, and the least, the
/// largest and the mean of each component.
pub(super) fn array(values: &[f64], width: usize) -> String {
    array_of(values, width, join)
}

/// As [`array`], of whole numbers with all their digits.
pub(super) fn whole_array(values: &[f64], width: usize) -> String {
    array_of(values, width, |values, _| {
        let each: Vec<String> = values.iter().map(|x| format!("{x:.0}")).collect();
        each.join(" ")
    })
}

fn array_of(values: &[f64], width: usize, print: fn(&[f64], f64) -> String) -> String {
    let width = width.max(1);
    let count = values.len() / width;
    let scale = largest(values);
    let value = |i: usize| {
        let text = print(&values[i * width..(i + 1) * width], scale);
        match width {
            1 => text,
            _ => format!("({text})"),
        }
    };
    let list = |range: std::ops::Range<usize>| range.map(value).collect::<Vec<_>>().join(" ");
    if count <= WHOLE {
        return format!("{count}: {}", list(0..count)).trim_end().to_owned();
    }
    let component = |c: usize| values[c..].iter().step_by(width).copied();
    let each = |f: &dyn Fn(usize) -> f64| (0..width).map(f).collect::<Vec<f64>>();
    let least = each(&|c| component(c).fold(f64::INFINITY, f64::min));
    let most = each(&|c| component(c).fold(f64::NEG_INFINITY, f64::max));
    let mean = each(&|c| component(c).sum::<f64>() / count as f64);
    let (least, most) = (print(&least, scale), print(&most, scale));
    let mean = join(&mean, scale);
    format!(
        "{count}: {} ... {}, least {least}, most {most}, mean {mean}",
        list(0..ENDS),
        list(count - ENDS..count)
    )
}

/// Integers, as [`array`].
pub(super) fn integers<T: Copy + Into<i64>>(values: &[T]) -> String {
    let values: Vec<f64> = values.iter().map(|&v| v.into() as f64).collect();
    whole_array(&values, 1)
}

/// A matrix as USD prints it.
pub(super) fn matrix(m: &DAffine3) -> String {
    let size = largest(&m.matrix3.to_cols_array());
    let reach = size.max(largest(&m.translation.to_array()));
    let row = |v: glam::DVec3, w: u8, scale: f64| format!("({} {w})", join(&v.to_array(), scale));
    format!(
        "({} {} {} {})",
        row(m.matrix3.x_axis, 0, size),
        row(m.matrix3.y_axis, 0, size),
        row(m.matrix3.z_axis, 0, size),
        row(m.translation, 1, reach)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn numbers_are_short_and_rounded() {
        let cases = [
            (0.0, "0"),
            (-0.0, "0"),
            (1.0, "1"),
            (-2.5, "-2.5"),
            (0.1f32.into(), "0.1"),
            (1.0 / 3.0, "0.333333"),
            (123_456_789.0, "123457000"),
            (1.0e12, "1e12"),
            (1.25e-9, "1.25e-9"),
            (99_999_999.0, "100000000"),
            (f64::NAN, "nan"),
            (f64::INFINITY, "inf"),
        ];
        for (x, text) in cases {
            assert_eq!(number(x), text);
        }
    }

    #[test]
    fn noise_is_nothing_and_arrays_are_summed_up() {
        assert_eq!(numbers(&[1.0, 1.0e-9]), "1 0");
        assert_eq!(array(&[1.0, 2.0, 3.0, 4.0], 2), "2: (1 2) (3 4)");
        assert_eq!(array(&[], 3), "0:");
        let many: Vec<f64> = (0..100).map(f64::from).collect();
        assert_eq!(
            array(&many, 1),
            "100: 0 1 2 3 ... 96 97 98 99, least 0, most 99, mean 49.5"
        );
        let m = DAffine3::from_translation(DVec3::new(1.0, 2.0, 3.0));
        assert_eq!(matrix(&m), "((1 0 0 0) (0 1 0 0) (0 0 1 0) (1 2 3 1))");
    }
}
