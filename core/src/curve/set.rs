//! The curves of a prim with all that they carry, and its values at any place of them.

use crate::curve::CurveKind;
use crate::scene::Interpolation;
use crate::translate::curves::{CheckedCurves, CurveSpan};
use crate::translate::primvar::{Resolved, Spread};
use crate::translate::values::Values;

/// A primvar that is shaded with, varying along the curves.
#[derive(Clone, Debug)]
pub struct CurveChannel {
    /// Floats per value.
    pub width: usize,
    /// Values.
    pub values: Values,
    /// A place has the value of the nearest point or segment end, bit for bit.
    pub nearest: bool,
}

impl CurveChannel {
    /// Spreads a primvar over curves.
    pub fn spread(resolved: Resolved) -> Spread<Self> {
        let (width, nearest) = (resolved.stride(), resolved.is_integer);
        let values = match resolved.interpolation {
            Interpolation::Constant => return resolved.into_constant(),
            Interpolation::Uniform => return Spread::Uniform(resolved.into_items()),
            Interpolation::Varying | Interpolation::FaceVarying => {
                Values::Varying(resolved.into_items())
            }
            Interpolation::Vertex => Values::Vertex(resolved.into_items()),
        };
        Spread::Channel(Self {
            width,
            values,
            nearest,
        })
    }
}

/// Curves, ready to be diced.
#[derive(Clone, Debug)]
pub struct CurveSet {
    /// Basis, spans and points.
    pub curves: CheckedCurves,
    /// Diameters, finite and not negative.
    pub widths: Values,
    /// Normals, finite; with them curves are flat ribbons.
    pub normals: Option<Values>,
    /// Channels, in the order of the diced mesh's.
    pub channels: Vec<CurveChannel>,
}

/// A place on a curve: where a lattice has vertices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Station {
    /// Segment of the curve.
    pub segment: u32,
    /// Place on the segment, 0 to 1; it is 1 at the end of the curve only.
    pub t: f32,
    /// The curve turns sharply here: shading normals differ on either side.
    pub corner: bool,
}

impl CurveSet {
    /// Basis and wrap.
    pub fn kind(&self) -> CurveKind {
        self.curves.kind
    }

    /// Float `component` of the value at a place, of values with `width` floats each.
    pub fn value(
        &self,
        values: &Values,
        width: usize,
        component: usize,
        span: &CurveSpan,
        at: &Station,
    ) -> f64 {
        let (n, segment) = (span.point_count as usize, at.segment as usize);
        let float = |floats: &[f32], i: usize| f64::from(floats[i * width + component]);
        match values {
            Values::Constant(v) => float(v, 0),
            Values::Uniform(v) => float(v, span.element as usize),
            Values::Varying(v) => {
                let first = span.first_varying as usize;
                let [a, b] = self.kind().ends(n, segment, |i| float(v, first + i));
                a + (b - a) * f64::from(at.t)
            }
            Values::Vertex(v) => {
                let first = span.first_point as usize;
                let control = self.kind().control(n, segment, |i| float(v, first + i));
                self.kind().point(&control, f64::from(at.t))
            }
        }
    }

    /// Float `component` of a channel at a place.
    pub fn channel_value(
        &self,
        channel: &CurveChannel,
        component: usize,
        span: &CurveSpan,
        at: &Station,
    ) -> f32 {
        let CurveChannel { width, values, .. } = channel;
        if !channel.nearest {
            return self.value(values, *width, component, span, at) as f32;
        }
        let (n, segment) = (span.point_count as usize, at.segment as usize);
        let item = match values {
            Values::Constant(_) => 0,
            Values::Uniform(_) => span.element as usize,
            Values::Varying(_) => {
                let ends = self.kind().ends(n, segment, |i| i);
                span.first_varying as usize + ends[usize::from(at.t >= 0.5)]
            }
            Values::Vertex(_) => {
                // Points are spread evenly over the segments.
                let periodic = self.kind().is_periodic();
                let gaps = if periodic { n } else { n - 1 };
                let along = (f64::from(at.segment) + f64::from(at.t)) / f64::from(span.segments);
                span.first_point as usize + (along * gaps as f64).round() as usize % n
            }
        };
        values.floats()[item * width + component]
    }

    /// Radii at places, object space, of all keys: in place of what is there.
    pub fn radii(&self, span: &CurveSpan, stations: &[Station], out: &mut Vec<f64>) {
        let radius = |at| (0.5 * self.value(&self.widths, 1, 0, span, at)).max(0.0);
        out.clear();
        out.extend(stations.iter().map(radius));
    }

    /// Largest second derivative of the radius over a segment.
    pub fn radius_bend(&self, span: &CurveSpan, segment: u32) -> f64 {
        let Values::Vertex(v) = &self.widths else {
            return 0.0;
        };
        let value = |i: usize| f64::from(v[span.first_point as usize + i]);
        let n = span.point_count as usize;
        let control = self.kind().control(n, segment as usize, value);
        let [a, b] = self.kind().bends(&control);
        0.5 * a.abs().max(b.abs())
    }
}
