//! Pixel filters by importance sampling: a place in the unit square becomes a place under the filter.
//!
//! Where: ray generation warps the `(x, y)` of each [sample](crate::sample) and shoots through
//! `centre + offset`; the film adds `weight * value` to that one pixel. No sample is splatted, so images do not
//! depend on the order of tiles. After Ernst, Stamminger, Greiner, "Filter Importance Sampling", 2006.
//!
//! Filters are separable, `F(x, y) = f(x) f(y)`, on a square of side `width` around the pixel's centre. Each
//! axis is warped by the inverse of the running integral of |f|: monotone, so that points spread well in the unit
//! square stay spread well under the filter. Where f is negative (Mitchell's lobes) the weight is.
//!
//! Estimator: with `(offset, weight) = filter.sample(u, v)` and u, v uniform,
//! `E[weight * L(offset)]` is the integral of F L over that of F, exactly; in particular `E[weight]` is 1. So the
//! mean of `weight * L` is unbiased, and dividing by the mean of the weights instead of 1 reproduces constants
//! exactly at a bias of order 1/N. Weights are exactly 1 for all kinds but Mitchell.
//!
//! The running integral is exact at [`CELLS`] + 1 abscissae of half the axis and linear between them: f is replaced by
//! its average in each of the cells, which moves its second moment by about 1e-7 of the width squared.
//!
//! Units: pixels, relative to the pixel's centre, in both axes.

use glam::Vec2;

pub use crate::scene::settings::FilterKind;

/// Cells that half an axis is tabulated in.
const CELLS: usize = 1024;
/// Powers of 2 keep shares exact.
const FINE: usize = 8;
/// Where Mitchell's filter of radius 2 changes its sign: its outer part, 32 - 60 x + 36 x^2 - 7 x^3, is
/// -(x - 2)^2 (7 x - 8).
const MITCHELL_ROOT: f64 = 8.0 / 7.0;

/// Value of the filter at `x`, in units of its radius (the filter ends at 1); not normalised.
fn profile(kind: FilterKind, x: f64) -> f64 {
    let x = x.abs();
    if x > 1.0 {
        return 0.0;
    }
    match kind {
        FilterKind::Box => 1.0,
        // RenderMan's: exp(-2 x^2), two standard deviations at the edge, cut there.
        FilterKind::Gaussian => (-2.0 * x * x).exp(),
        FilterKind::Mitchell => {
            // Mitchell and Netravali 1988, B = C = 1/3, times 18; its own radius is 2.
            let x = 2.0 * x;
            if x < 1.0 {
                (21.0 * x - 36.0) * x * x + 16.0
            } else {
                ((-7.0 * x + 36.0) * x - 60.0) * x + 32.0
            }
        }
        FilterKind::BlackmanHarris => {
            // The 4-term window (Harris 1978), centred.
            let angle = std::f64::consts::PI * x;
            0.35875
                + 0.48829 * angle.cos()
                + 0.14128 * (2.0 * angle).cos()
                + 0.01168 * (3.0 * angle).cos()
        }
    }
}

/// A filter of one kind and width, ready to be sampled. Immutable: share it between threads.
#[derive(Clone, Debug)]
pub struct Filter {
    kind: FilterKind,
    width: f32,
    /// `|integral of |f|| / |integral of f|` of one axis: 1 but for Mitchell.
    axis_weight: f32,
    /// Integral of the profile over [-1, 1].
    area: f64,
    /// Empty for the box.
    table: Vec<Cell>,
    /// `guide[k]` is the cell in which the share `k / CELLS` of the running integral lies.
    guide: Vec<u16>,
    /// The same for `FINE` times as many shares: most often, the next share is in the same cell.
    fine: Vec<u16>,
}

/// Part of half the axis in which the running integral is linear.
#[derive(Clone, Copy, Debug)]
pub struct Cell {
    /// Running integral of |f| at the left end, as a share of the half axis.
    pub share: f32,
    /// Left end, pixels.
    pub start: f32,
    /// Pixels for each unit of share.
    pub slope: f32,
    /// Sign of f.
    pub sign: f32,
}

impl Filter {
    /// A filter with a diameter of `width` pixels; a width that is not positive and finite gives
    /// [`FilterKind::default_width`].
    pub fn new(kind: FilterKind, width: f32) -> Filter {
        let width = if width > 0.0 && width.is_finite() {
            width
        } else {
            kind.default_width()
        };
        let mut filter = Filter {
            kind,
            width,
            axis_weight: 1.0,
            area: 2.0 * integrate_half(kind),
            table: Vec::new(),
            guide: Vec::new(),
            fine: Vec::new(),
        };
        if kind != FilterKind::Box {
            filter.tabulate();
        }
        filter
    }

    fn tabulate(&mut self) {
        // Cells end where f changes its sign.
        let inner_end = match self.kind {
            FilterKind::Mitchell => MITCHELL_ROOT / 2.0,
            _ => 1.0,
        };
        let inner_cells = (CELLS as f64 * inner_end) as usize;
        let edge = |i: usize| {
            if i <= inner_cells {
                inner_end * i as f64 / inner_cells as f64
            } else {
                inner_end
                    + (1.0 - inner_end) * (i - inner_cells) as f64 / (CELLS - inner_cells) as f64
            }
        };
        let areas: Vec<f64> = (0..CELLS)
            .map(|i| integrate(self.kind, edge(i), edge(i + 1)))
            .collect();
        let signed: f64 = areas.iter().sum();
        let total: f64 = areas.iter().map(|a| a.abs()).sum();
        self.axis_weight = (total / signed) as f32;

        let radius = 0.5 * f64::from(self.width);
        let mut share = 0.0;
        self.table = Vec::with_capacity(CELLS);
        for (i, area) in areas.iter().enumerate() {
            let part = area.abs() / total;
            self.table.push(Cell {
                share: share as f32,
                start: (radius * edge(i)) as f32,
                slope: (radius * (edge(i + 1) - edge(i)) / part) as f32,
                sign: area.signum() as f32,
            });
            share += part;
        }
        let mut cell = 0;
        let begins = (0..FINE * CELLS).map(|k| {
            let share = k as f32 / (FINE * CELLS) as f32;
            while cell + 1 < CELLS && self.table[cell + 1].share <= share {
                cell += 1;
            }
            cell as u16
        });
        self.fine = begins.collect();
        self.guide = self.fine.iter().copied().step_by(FINE).collect();
    }

    /// The kind.
    pub fn kind(&self) -> FilterKind {
        self.kind
    }

    /// The diameter, pixels.
    pub fn width(&self) -> f32 {
        self.width
    }

    /// Half the axis, from the centre out; empty for the box.
    pub fn cells(&self) -> &[Cell] {
        &self.table
    }

    /// Of as many equal shares of the running integral as there are cells, the cell in which each begins.
    pub fn guide(&self) -> &[u16] {
        &self.guide
    }

    /// Magnitude of the weight along one axis.
    pub fn axis_weight(&self) -> f32 {
        self.axis_weight
    }

    /// The filter at `offset` (pixels from the centre), normalised to an integral of 1; negative in
    /// Mitchell's lobes, 0 outside the filter.
    pub fn evaluate(&self, offset: Vec2) -> f32 {
        let radius = 0.5 * f64::from(self.width);
        let area = radius * self.area;
        let axis = |x: f32| profile(self.kind, f64::from(x) / radius) / area;
        (axis(offset.x) * axis(offset.y)) as f32
    }

    /// Warps a point of the unit square: the offset from the pixel's centre (pixels, at most half the
    /// width in each axis, increasing with `u` and `v`) and the weight of the sample (its mean is 1).
    #[inline]
    pub fn sample(&self, u: f32, v: f32) -> (Vec2, f32) {
        let (x, wx) = self.axis(u);
        let (y, wy) = self.axis(v);
        (Vec2::new(x, y), wx * wy)
    }

    #[inline]
    fn axis(&self, u: f32) -> (f32, f32) {
        // Exact for multiples of 2^-24, as samples are.
        let u = if u.is_nan() { 0.5 } else { u.clamp(0.0, 1.0) };
        let s = 2.0 * u - 1.0;
        if self.table.is_empty() {
            return (0.5 * self.width * s, 1.0);
        }
        let share = s.abs();
        let part = (share * (FINE * CELLS) as f32) as usize;
        let mut k = usize::from(self.fine[part.min(FINE * CELLS - 1)]);
        while k + 1 < CELLS && self.table[k + 1].share <= share {
            k += 1;
        }
        let cell = &self.table[k];
        let end = self
            .table
            .get(k + 1)
            .map_or(0.5 * self.width, |next| next.start);
        let x = (cell.start + (share - cell.share) * cell.slope).min(end);
        (x.copysign(s), cell.sign * self.axis_weight)
    }
}

/// Integral of the profile over [a, b], by Gauss and Legendre's rule of three points: exact for the cubics
/// of Mitchell's filter, and to 1e-15 for cells of the others.
fn integrate(kind: FilterKind, a: f64, b: f64) -> f64 {
    let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
    let step = half * 0.6f64.sqrt();
    half / 9.0
        * (5.0 * profile(kind, middle - step)
            + 8.0 * profile(kind, middle)
            + 5.0 * profile(kind, middle + step))
}

/// Integral of the profile over [0, 1].
fn integrate_half(kind: FilterKind) -> f64 {
    let parts = 64;
    let edge = |i: u32| f64::from(i) / f64::from(parts);
    (0..parts)
        .map(|i| integrate(kind, edge(i), edge(i + 1)))
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const KINDS: [FilterKind; 4] = [
        FilterKind::Box,
        FilterKind::Gaussian,
        FilterKind::Mitchell,
        FilterKind::BlackmanHarris,
    ];

    /// Mean of `g(x, weight)` over `n` equal steps of one axis, the other axis in the middle of its range.
    fn axis_mean(filter: &Filter, n: u32, g: impl Fn(f64, f64) -> f64) -> f64 {
        let sum: f64 = (0..n)
            .map(|i| {
                let (x, w) = filter.axis((i as f32 + 0.5) / n as f32);
                g(f64::from(x), f64::from(w))
            })
            .sum();
        sum / f64::from(n)
    }

    /// Integral over [a, b] of `f(x) x^power`, f the normalised filter of one axis: the midpoint rule.
    fn moment(kind: FilterKind, width: f64, a: f64, b: f64, power: i32) -> f64 {
        let n = 40_000;
        let (mut part, mut area) = (0.0, 0.0);
        for i in 0..n {
            let share = (f64::from(i) + 0.5) / f64::from(n);
            let x = a + share * (b - a);
            part += profile(kind, 2.0 * x / width) * x.powi(power) * (b - a) / f64::from(n);
            area += profile(kind, 2.0 * share - 1.0) * width / f64::from(n);
        }
        part / area
    }

    #[test]
    fn profiles_have_their_known_values() {
        let at = |kind, x| profile(kind, x) / profile(kind, 0.0);
        assert_eq!(at(FilterKind::Box, 1.0), 1.0);
        assert!((at(FilterKind::Gaussian, 1.0) - 0.135_335_283).abs() < 1e-9);
        // Mitchell: 8/9 at 0, 1/18 at 1, 0 at 2 of radius 2, and both parts meet at 1.
        assert!((at(FilterKind::Mitchell, 0.5) - 1.0 / 16.0).abs() < 1e-12);
        assert!((at(FilterKind::Mitchell, 0.5 + 1e-9) - 1.0 / 16.0).abs() < 1e-8);
        assert!(at(FilterKind::Mitchell, 1.0).abs() < 1e-12);
        assert!(at(FilterKind::Mitchell, 0.75) < 0.0);
        assert!((profile(FilterKind::BlackmanHarris, 0.0) - 1.0).abs() < 1e-12);
        assert!((profile(FilterKind::BlackmanHarris, 1.0) - 6e-5).abs() < 1e-9);
        assert!(KINDS.iter().all(|&k| profile(k, 1.000_001) == 0.0));
    }

    #[test]
    fn the_mean_weight_is_one() {
        for kind in KINDS {
            for width in [0.5, 1.0, 2.0, 4.0, 7.3] {
                let mean = axis_mean(&Filter::new(kind, width), 1 << 20, |_, w| w);
                assert!((mean - 1.0).abs() < 5e-6, "{kind:?} {width}: {mean}");
            }
        }
    }

    #[test]
    fn weighted_histograms_match_the_filter() {
        for kind in KINDS {
            let width = 3.0;
            let filter = Filter::new(kind, width);
            let bins = 48;
            let n = 1 << 20;
            let mut histogram = vec![0.0; bins];
            for i in 0..n {
                let (x, w) = filter.axis((i as f32 + 0.5) / n as f32);
                let bin = ((x / width + 0.5) * bins as f32) as usize;
                histogram[bin.min(bins - 1)] += f64::from(w) / f64::from(n);
            }
            for (b, &share) in histogram.iter().enumerate() {
                let edge = |b: usize| 3.0 * (b as f64 / bins as f64 - 0.5);
                let expected = moment(kind, 3.0, edge(b), edge(b + 1), 0);
                assert!(
                    (share - expected).abs() < 5e-6,
                    "{kind:?} {b}: {share} {expected}"
                );
            }
        }
    }

    #[test]
    fn polynomials_have_the_filters_expectation() {
        for kind in KINDS {
            for width in [1.0f32, 2.0, 4.0] {
                let filter = Filter::new(kind, width);
                for power in 1..=6 {
                    let mean = axis_mean(&filter, 1 << 20, |x, w| w * x.powi(power));
                    let r = 0.5 * f64::from(width);
                    let expected = moment(kind, f64::from(width), -r, r, power);
                    let tolerance = 2e-6 * r.powi(power);
                    assert!(
                        (mean - expected).abs() < tolerance,
                        "{kind:?} {width} x^{power}: {mean} {expected}"
                    );
                }
            }
        }
    }

    #[test]
    fn both_axes_are_used_and_independent() {
        // E[w x^2 y^4] factors into the moments of the axes.
        for kind in KINDS {
            let filter = Filter::new(kind, 2.0);
            let n = 1024;
            let mut mean = 0.0;
            for i in 0..n * n {
                let u = ((i % n) as f32 + 0.5) / n as f32;
                let v = ((i / n) as f32 + 0.5) / n as f32;
                let (o, w) = filter.sample(u, v);
                mean += f64::from(w) * f64::from(o.x).powi(2) * f64::from(o.y).powi(4);
            }
            mean /= f64::from(n * n);
            let expected = moment(kind, 2.0, -1.0, 1.0, 2) * moment(kind, 2.0, -1.0, 1.0, 4);
            assert!(
                (mean - expected).abs() < 1e-4,
                "{kind:?}: {mean} {expected}"
            );
        }
    }

    #[test]
    fn symmetric_monotone_and_inside() {
        for kind in KINDS {
            let filter = Filter::new(kind, 2.5);
            let mut before = f32::NEG_INFINITY;
            for i in 0..=1u32 << 16 {
                let u = i as f32 / 65536.0;
                let (x, w) = filter.axis(u);
                let (mirrored, w_mirrored) = filter.axis(1.0 - u);
                assert_eq!((x, w), (-mirrored, w_mirrored), "{kind:?} {u}");
                assert!(x >= before && x.abs() <= 1.25, "{kind:?} {u}: {x}");
                before = x;
            }
            assert_eq!(filter.sample(0.5, 0.5).0, Vec2::ZERO);
            let corner = filter.sample(0.0, 1.0).0;
            // Tails that hold less than 2^-24 of the filter are out of reach.
            assert!(
                (corner - Vec2::new(-1.25, 1.25)).abs().max_element() < 0.01,
                "{kind:?} {corner}"
            );
        }
    }

    #[test]
    fn weights_are_one_but_for_mitchell() {
        for kind in KINDS {
            let filter = Filter::new(kind, 2.0);
            let weights: Vec<f32> = (0..1000)
                .map(|i| filter.sample(i as f32 / 1000.0, 0.4).1)
                .collect();
            if kind == FilterKind::Mitchell {
                assert!(weights.iter().any(|&w| w < 0.0) && weights.iter().any(|&w| w > 1.0));
            } else {
                assert!(weights.iter().all(|&w| w == 1.0));
            }
        }
    }

    #[test]
    fn evaluate_integrates_to_one() {
        for kind in KINDS {
            let filter = Filter::new(kind, 3.0);
            let n = 300;
            let at = |i: i32| 3.0 * ((i as f32 + 0.5) / n as f32 - 0.5);
            let mut sum = 0.0;
            for i in 0..n * n {
                sum += f64::from(filter.evaluate(Vec2::new(at(i % n), at(i / n))));
            }
            assert!(
                (sum * 9.0 / f64::from(n * n) - 1.0).abs() < 1e-4,
                "{kind:?} {sum}"
            );
        }
        assert_eq!(
            Filter::new(FilterKind::Box, 2.0).evaluate(Vec2::new(1.5, 0.0)),
            0.0
        );
    }

    #[test]
    fn bad_input_gets_the_default() {
        for width in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert_eq!(Filter::new(FilterKind::Mitchell, width).width(), 4.0);
        }
        for kind in KINDS {
            let filter = Filter::new(kind, 1.0);
            for u in [f32::NAN, f32::INFINITY, -1.0, 2.0] {
                let (o, w) = filter.sample(u, u);
                assert!(o.is_finite() && w.is_finite() && o.abs().max_element() <= 0.5);
            }
        }
    }
}
