//! NURBS curves to cubic Bezier curves, with all that they carry.
//!
//! Every span becomes cubics that agree with it in position and tangent at both ends. Spans up to
//! order 4 without weights are such cubics themselves, so the curve is exact; others are cut into
//! [`PARTS`], which keeps a quarter of a circle within 2 10^-5 of its radius. Bezier points are sums of
//! control points with weights that depend on knots alone: samples, velocities and `vertex` primvars
//! are mapped alike, so that everything moves as the NURBS would.

use std::collections::BTreeMap;
use std::ops::{Add, Mul};
use std::sync::Arc;

use glam::DVec3;

use super::primvar::WIDEST;
use super::values::{self, Counts, Values};
use crate::diagnostics::{Code, Warning};
use crate::nurbs::Knots;
use crate::scene::{
    CurveBasis, CurveWrap, CurvesDesc, Interpolation, NurbsCurvesDesc, PointsSamples, PrimvarDesc,
    PrimvarSample, PrimvarValues, Rates, Samples,
};

/// Cubics that stand for a span which is none.
const PARTS: usize = 8;

/// Basis curves, and primvars that fit them.
#[derive(Clone, Debug, PartialEq)]
pub struct Converted {
    /// The curves; those that could not be converted have no points.
    pub curves: CurvesDesc,
    /// Primvars by name.
    pub primvars: BTreeMap<String, PrimvarDesc>,
}

/// One curve that can be converted.
struct Curve {
    knots: Knots,
    /// Its first point, and its first varying value.
    first: usize,
    first_varying: usize,
    /// Weights of its points; empty: all are 1.
    weights: Vec<f64>,
    /// Ends of its cubics: knot, parameter, and step to the next end; the last has none.
    ends: Vec<End>,
}

#[derive(Clone, Copy)]
struct End {
    knot: usize,
    at: f64,
    /// Length of the cubics before and after; 0 where there is none.
    steps: [f64; 2],
    /// Last knot before the cubic that ends here: where its tangent is taken.
    knot_before: usize,
}

/// Converts `desc` and `primvars`. `None` when nothing is left to render; no curves are no reason to
/// warn.
pub fn convert(
    path: &str,
    desc: &NurbsCurvesDesc,
    primvars: &BTreeMap<String, PrimvarDesc>,
    warnings: &mut Vec<Warning>,
) -> Option<Converted> {
    if desc.vertex_counts.is_empty() {
        return None;
    }
    let (curves, counts) = check(path, desc, warnings);
    if curves.iter().all(Option::is_none) {
        return None;
    }
    let point_count = |curve: &Option<Curve>| {
        let points = curve.as_ref().map_or(0, |c| 3 * c.ends.len() - 2);
        i32::try_from(points).unwrap_or(0)
    };
    let converted = CurvesDesc {
        basis: CurveBasis::Bezier,
        wrap: CurveWrap::Nonperiodic,
        vertex_counts: Arc::new(curves.iter().map(point_count).collect()),
        points: map_samples(&desc.points, &curves),
        form: desc.form,
    };
    let primvars = primvars.iter().filter_map(|(name, primvar)| {
        let mapped = map_primvar(path, name, primvar, &counts, &curves, warnings)?;
        Some((name.clone(), mapped))
    });
    Some(Converted {
        primvars: primvars.collect(),
        curves: converted,
    })
}

/// Curves by number, `None` where they cannot be used; and how many values primvars have.
fn check(
    path: &str,
    desc: &NurbsCurvesDesc,
    warnings: &mut Vec<Warning>,
) -> (Vec<Option<Curve>>, Counts) {
    let total = desc.vertex_counts.len();
    let mut counts = Counts {
        uniform: total,
        varying: 0,
        vertex: 0,
    };
    let authored: usize = desc.vertex_counts.iter().map(|&n| size(n)).sum();
    let mut warn = |code, text: String| warnings.push(Warning::new(path, code, text));
    let mut weights = desc.weights.as_slice();
    if !weights.is_empty() && weights.len() != authored {
        let text = format!(
            "{} pointWeights for {authored} points; they are ignored",
            weights.len()
        );
        warn(Code::Topology, text);
        weights = &[];
    }
    if !weights.iter().all(|w| *w > 0.0 && w.is_finite()) {
        let text = "some pointWeights are not above 0; all are ignored";
        warn(Code::NotFinite, text.to_owned());
        weights = &[];
    }
    let samples = desc.points.points.iter().map(|p| p.len());
    let given = samples.filter(|&n| n > 0).min().unwrap_or(usize::MAX);
    let mut faults: Vec<(usize, String)> = Vec::new();
    let mut cut = 0;
    let mut knot = 0usize;
    let mut curves = Vec::with_capacity(total);
    for (number, &count) in desc.vertex_counts.iter().enumerate() {
        let order = desc.orders.get(number).copied().unwrap_or(0);
        let points = size(count);
        let first = (counts.vertex, counts.varying);
        let knots = desc.knots.get(knot..).unwrap_or_default();
        let knots = &knots[..knots.len().min(points.saturating_add(size(order)))];
        knot = knot.saturating_add(points).saturating_add(size(order));
        counts.vertex = counts.vertex.saturating_add(points);
        let range = desc.ranges.get(number).copied();
        let found = Knots::new(order, count, knots, range.filter(|r| *r != [0.0; 2]));
        curves.push(match found {
            Ok((knots, _)) if knots.spans().iter().skip(1).any(|s| knots.breaks_before(s)) => {
                faults.push((number, "a knot as often as the order tears it".to_owned()));
                None
            }
            Ok(_) if counts.vertex > given => {
                faults.push((number, "points are missing".to_owned()));
                None
            }
            Ok((knots, outside)) => {
                cut += usize::from(outside);
                counts.varying += knots.segment_count() + 1;
                let weights = weights.get(first.0..first.0 + points).unwrap_or_default();
                let ends = ends(&knots, weights);
                Some(Curve {
                    knots,
                    first: first.0,
                    first_varying: first.1,
                    weights: weights.to_vec(),
                    ends,
                })
            }
            Err(error) => {
                faults.push((number, error.to_string()));
                None
            }
        });
    }
    if let Some((number, fault)) = faults.first() {
        let text = format!(
            "{} of {total} curves cannot be used (of curve {number}, {fault}); dropped",
            faults.len()
        );
        warn(Code::Topology, text);
    }
    if given != usize::MAX && given > counts.vertex {
        let text = format!(
            "curveVertexCounts sum to {authored} but there are {given} points; the last {} are ignored",
            given - authored
        );
        warn(Code::Topology, text);
    }
    if cut > 0 {
        let text =
            format!("ranges of {cut} of {total} curves reach beyond their knots; they are cut");
        warn(Code::Topology, text);
    }
    (curves, counts)
}

/// A count, 0 where it is negative.
fn size(count: i32) -> usize {
    usize::try_from(count).unwrap_or(0)
}

fn ends(knots: &Knots, weights: &[f64]) -> Vec<End> {
    let parts = if knots.degree() <= 3 && weights.is_empty() {
        1
    } else {
        PARTS
    };
    let mut ends: Vec<End> = Vec::with_capacity(knots.spans().len() * parts + 1);
    for span in knots.spans() {
        let step = (span.end - span.start) / parts as f64;
        for part in 0..parts {
            let before = ends
                .last()
                .map_or((0.0, span.knot), |e| (e.steps[1], e.knot));
            ends.push(End {
                knot: span.knot,
                at: span.start + step * part as f64,
                steps: [before.0, step],
                knot_before: before.1,
            });
        }
        if span == knots.spans().last().unwrap_or(span) {
            ends.push(End {
                knot: span.knot,
                at: span.end,
                steps: [step, 0.0],
                knot_before: span.knot,
            });
        }
    }
    ends
}

/// What control values can be summed from.
trait Value: Copy + Add<Output = Self> + Mul<f64, Output = Self> {}
impl<T: Copy + Add<Output = T> + Mul<f64, Output = T>> Value for T {}

impl Curve {
    /// Value and slope at a parameter, blended from `value`, one at each of the curve's points.
    fn at<T: Value>(&self, knot: usize, at: f64, value: &dyn Fn(usize) -> T) -> (T, T) {
        let p = self.knots.degree();
        let (mut basis, mut slopes) = (vec![0.0; p + 1], vec![0.0; p + 1]);
        self.knots.basis(knot, at, &mut basis, &mut slopes);
        let first = knot - p;
        if !self.weights.is_empty() {
            let weights = &self.weights[first..=knot];
            let total: f64 = basis.iter().zip(weights).map(|(n, w)| n * w).sum();
            let slope: f64 = slopes.iter().zip(weights).map(|(n, w)| n * w).sum();
            for ((n, d), w) in basis.iter_mut().zip(&mut slopes).zip(weights) {
                *n *= w / total;
                *d = (*d * w - *n * slope) / total;
            }
        }
        let sum = |weights: &[f64]| {
            let parts = weights.iter().zip(first..).map(|(w, i)| value(i) * *w);
            parts.reduce(|a, b| a + b)
        };
        let zero = value(first) * 0.0;
        (sum(&basis).unwrap_or(zero), sum(&slopes).unwrap_or(zero))
    }

    /// Bezier points of `value`, one at each of the curve's points.
    fn bezier<T: Value>(&self, value: &dyn Fn(usize) -> T, out: &mut dyn FnMut(T)) {
        for end in &self.ends {
            let (point, slope) = self.at(end.knot, end.at, value);
            let [before, after] = end.steps;
            if before > 0.0 {
                // On the other side of a knot the tangent may be another.
                let (_, slope) = self.at(end.knot_before, end.at, value);
                out(point + slope * (-before / 3.0));
            }
            out(point);
            if after > 0.0 {
                out(point + slope * (after / 3.0));
            }
        }
    }

    /// Values of `value`, one at each end of a segment, at the ends of cubics.
    fn varying<T: Value>(&self, value: &dyn Fn(usize) -> T, out: &mut dyn FnMut(T)) {
        for end in &self.ends {
            let segment = end.knot - self.knots.degree();
            let f = self.knots.fraction(end.knot, end.at);
            out(value(segment) * (1.0 - f) + value(segment + 1) * f);
        }
    }
}

fn map_samples(samples: &PointsSamples, curves: &[Option<Curve>]) -> PointsSamples {
    let map = |points: &Arc<Vec<glam::Vec3>>| {
        let mut out = Vec::new();
        if points.is_empty() {
            return Arc::new(out);
        }
        for curve in curves.iter().flatten() {
            // Rates may be missing; that there are points was seen.
            let value = |i: usize| {
                points
                    .get(curve.first + i)
                    .map_or(DVec3::ZERO, |p| p.as_dvec3())
            };
            curve.bezier(&value, &mut |p| out.push(p.as_vec3()));
        }
        Arc::new(out)
    };
    let rates = |from: &Samples<glam::Vec3>| Samples {
        times: from.times.clone(),
        values: from.values.iter().map(map).collect(),
    };
    PointsSamples {
        times: samples.times.clone(),
        points: samples.points.iter().map(map).collect(),
        rates: Rates {
            velocities: rates(&samples.rates.velocities),
            accelerations: rates(&samples.rates.accelerations),
            time_codes_per_second: samples.rates.time_codes_per_second,
        },
    }
}

/// A primvar of the curves that these become, sample by sample. Whole numbers cannot be blended: they
/// are left out where they differ along curves.
fn map_primvar(
    path: &str,
    name: &str,
    primvar: &PrimvarDesc,
    counts: &Counts,
    curves: &[Option<Curve>],
    warnings: &mut Vec<Warning>,
) -> Option<PrimvarDesc> {
    let along = !matches!(
        primvar.interpolation,
        Interpolation::Constant | Interpolation::Uniform
    );
    if primvar.is_integer() {
        if along {
            let text =
                format!("primvar {name} has whole numbers along NURBS curves; it is ignored");
            warnings.push(Warning::new(path, Code::Unsupported, text));
        }
        return (!along).then(|| primvar.clone());
    }
    let width = primvar.width.saturating_mul(size(primvar.element_size));
    if !(1..=WIDEST).contains(&width) {
        return None;
    }
    let mut out = PrimvarDesc {
        interpolation: Interpolation::Constant,
        width,
        element_size: 1,
        samples: Vec::new(),
        ..primvar.clone()
    };
    let mut found = Vec::new();
    for sample in &primvar.samples {
        let one = PrimvarDesc {
            width,
            element_size: 1,
            samples: vec![sample.clone()],
            ..primvar.clone()
        };
        let resolved = match name {
            "widths" => Some(values::resolve_widths(path, Some(&one), counts, &mut found)),
            _ => values::resolve(path, name, &one, width, counts, &mut found),
        };
        let Some(resolved) = resolved else { continue };
        let (interpolation, floats) = match resolved {
            Values::Constant(values) => (Interpolation::Constant, values),
            Values::Uniform(values) => (Interpolation::Uniform, values),
            Values::Varying(values) => {
                let mapped = map_floats(&values, width, curves, false);
                (Interpolation::Varying, mapped)
            }
            Values::Vertex(values) => {
                let mapped = map_floats(&values, width, curves, true);
                (Interpolation::Vertex, mapped)
            }
        };
        if interpolation != Interpolation::Constant {
            out.interpolation = interpolation;
        }
        out.samples.push(PrimvarSample {
            time: sample.time,
            values: Arc::new(PrimvarValues::Float(floats)),
            indices: Arc::default(),
        });
    }
    warnings.extend(found.into_iter().take(1));
    (!out.samples.is_empty()).then_some(out)
}

/// Values at each of the curves' points, or at the ends of their segments, of `width` floats.
fn map_floats(floats: &[f32], width: usize, curves: &[Option<Curve>], points: bool) -> Vec<f32> {
    let mut out = Vec::new();
    for curve in curves.iter().flatten() {
        let first = match points {
            true => curve.first,
            false => curve.first_varying,
        };
        let start = out.len();
        for component in 0..width {
            let value = |i: usize| f64::from(floats[(first + i) * width + component]);
            let mut at = start + component;
            let mut put = |x: f64| {
                if component == 0 {
                    out.resize(out.len() + width, 0.0);
                }
                out[at] = x as f32;
                at += width;
            };
            if points {
                curve.bezier(&value, &mut put);
            } else {
                curve.varying(&value, &mut put);
            }
        }
    }
    out
}

#[cfg(test)]
#[path = "nurbs_curves_tests.rs"]
mod tests;
