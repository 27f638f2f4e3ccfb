//! One thread's evaluator with the path and the metric: limit positions at output keys, in pixels.

use super::metric::RasterMetric;
use super::source::CurveSource;
use crate::motion::PointPath;
use crate::surface::{LimitEvaluator, LimitSamples, LimitSurface, PatchDomain};
use glam::{Vec2, Vec3};

/// A limit position was not finite: the face cannot be used.
#[derive(Clone, Copy, Debug)]
pub(super) struct NotFinite;

/// Evaluates and measures; see the module's text.
pub(super) struct Sampler<'a> {
    evaluator: Box<dyn LimitEvaluator + 'a>,
    path: &'a PointPath,
    metric: &'a RasterMetric,
    limit: LimitSamples,
    mapped: Vec<Vec3>,
    normals: Vec<Vec3>,
    st: Vec<Vec2>,
    /// Surface points evaluated (all keys count as one).
    pub evaluations: u64,
}

impl<'a> Sampler<'a> {
    pub fn new(
        surface: &'a dyn LimitSurface,
        path: &'a PointPath,
        metric: &'a RasterMetric,
    ) -> Self {
        Self {
            evaluator: surface.evaluator(),
            path,
            metric,
            limit: LimitSamples::default(),
            mapped: Vec::new(),
            normals: Vec::new(),
            st: Vec::new(),
            evaluations: 0,
        }
    }

    pub fn key_count(&self) -> usize {
        self.path.key_times().len()
    }

    pub fn metric(&self) -> &'a RasterMetric {
        self.metric
    }

    pub fn bind(&mut self, face: u32) {
        self.evaluator.bind(face);
    }

    /// Positions at output keys, `[key][n]`, and normals likewise (empty unless asked for).
    pub fn lattice(
        &mut self,
        domain: PatchDomain,
        st: &[Vec2],
        with_normals: bool,
    ) -> Result<(&[Vec3], &[Vec3]), NotFinite> {
        self.evaluate(domain, st, with_normals)?;
        Ok((&self.mapped, &self.normals))
    }

    /// Positions at output keys, `[key][n]`, finite or not.
    pub fn unchecked(&mut self, domain: PatchDomain, st: &[Vec2]) -> &[Vec3] {
        // Each position is looked at by the caller.
        let _ = self.evaluate(domain, st, false);
        &self.mapped
    }

    /// Points whose hull contains the bound face at output keys, `[key][n]`, and the largest coordinate of
    /// those in object space; nothing where none are known.
    pub fn hull(&mut self, out: &mut Vec<Vec3>) -> Option<f32> {
        let points = &mut self.limit.positions;
        if !self.evaluator.hull(points) || points.is_empty() {
            return None;
        }
        let reach = points.iter().fold(Vec3::ZERO, |most, p| most.max(p.abs()));
        // A maximum passes over NaN.
        let finite = points.iter().all(|p| p.is_finite());
        self.path
            .map_positions(points, points.len() / self.path.point_key_count(), out);
        (finite && out.iter().all(|p| p.is_finite())).then(|| reach.max_element())
    }

    fn evaluate(
        &mut self,
        domain: PatchDomain,
        st: &[Vec2],
        with_normals: bool,
    ) -> Result<(), NotFinite> {
        self.evaluations += st.len() as u64;
        self.evaluator
            .evaluate(domain, st, with_normals, &mut self.limit);
        self.path
            .map_positions(&self.limit.positions, st.len(), &mut self.mapped);
        self.normals.clear();
        if with_normals {
            self.path
                .map_normals(&self.limit.normals, st.len(), &mut self.normals);
        }
        if self.mapped.iter().all(|p| p.is_finite()) {
            Ok(())
        } else {
            Err(NotFinite)
        }
    }

    /// Values of a channel, `[n][width]`; what is not finite becomes 0.
    pub fn channel(
        &mut self,
        channel: usize,
        domain: PatchDomain,
        st: &[Vec2],
        out: &mut Vec<f32>,
    ) {
        self.evaluator.evaluate_channel(channel, domain, st, out);
        for x in out {
            if !x.is_finite() {
                *x = 0.0;
            }
        }
    }

    /// Points of a curve at the parameters `params`, `[param][key]`.
    pub fn curve(&mut self, source: &CurveSource, params: &[f32]) -> Result<Vec<Vec3>, NotFinite> {
        let keys = self.key_count();
        let mut out = Vec::with_capacity(params.len() * keys);
        let mut i = 0;
        while i < params.len() {
            let mut st = std::mem::take(&mut self.st);
            st.clear();
            let (domain, first) = source.place(params[i]);
            st.push(first);
            while let Some(&p) = params.get(i + st.len()) {
                let (other, at) = source.place(p);
                if other != domain {
                    break;
                }
                st.push(at);
            }
            let n = st.len();
            let result = self.evaluate(domain, &st, false);
            self.st = st;
            result?;
            for j in 0..n {
                out.extend((0..keys).map(|k| self.mapped[k * n + j]));
            }
            i += n;
        }
        Ok(out)
    }

    /// Longest segment and total length, in pixels, of a polyline `[vertex][key]`: each at its
    /// worst key.
    pub fn polyline(&self, points: &[Vec3]) -> (f32, f32) {
        let keys = self.key_count();
        let (mut longest, mut total) = (0.0f32, 0.0f32);
        for k in 0..keys {
            let mut sum = 0.0;
            let mut last = self.metric.measure(k, points[k]);
            for &p in points[k..].iter().step_by(keys).skip(1) {
                let next = self.metric.measure(k, p);
                let l = self.metric.length_between(k, &last, &next);
                longest = longest.max(l);
                sum += l;
                last = next;
            }
            total = total.max(sum);
        }
        (longest, total)
    }
}
