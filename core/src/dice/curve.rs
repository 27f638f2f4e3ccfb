//! Edge curves: rates, edge trees, and the canonical vertices that every patch copies.
//!
//! A curve has a parameter in [0, 1], held as an integer in 0..=[`ONE`]. Its *edge tree* is a dyadic
//! tree over that range; only the leaves are kept, in order. A leaf has `rate` segments, uniform in
//! parameter; the curve's *segments* are all of its leaves' segments, and its canonical vertices
//! are the ends of those. The two end vertices are given from outside (base vertices, or vertices
//! of the curves that this one ends on), so that they are shared too.
//!
//! A parameter that falls between canonical vertices stands for the nearest one ([`CurveView::map`],
//! ties upwards in parameter, so that the answer does not depend on who asks). A lattice side with
//! at least [`CurveView::need`] steps thus visits every canonical vertex of its range: neighbouring
//! lattice vertices are at most one segment apart.

use super::sampler::{NotFinite, Sampler};
use super::source::CurveSource;
use crate::grid::MAX_GRID_RATE;
use glam::Vec3;

/// Parameter 1.
pub(super) const ONE: u32 = 1 << 16;
/// Deepest bisection of a base edge, and of a patch in each direction. Bounds the work where
/// geometry passes through the camera; below [`ONE`]'s bits, so that parameters stay exact.
pub(super) const MAX_DEPTH: u32 = 14;

/// A segment may be this much longer than the shading rate (in shading rates) before there is one
/// more: halfway between rounding up, which overshoots small counts, and rounding.
const SLACK: f32 = 0.25;
/// An interval is bisected where uniform steps would make this many times the segments needed...
const UNEVEN: f32 = 1.6;
/// ...and a few more: short intervals gain nothing.
const UNEVEN_SEGMENTS: f32 = 3.0;

/// Segments for a length of `x` shading rates at the fastest point; more than [`MAX_GRID_RATE`]
/// means: split. 9 and 10 become 8, 17 to 20 become 16, so that grids tile into 8x8 blocks.
pub(super) fn rate_for(x: f32) -> u32 {
    match (x - SLACK).ceil().clamp(1.0, 1.0e6) as u32 {
        9 | 10 => 8,
        17..=20 => 16,
        n => n,
    }
}

/// One leaf of an edge tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leaf {
    start: u16,
    log_length: u8,
    rate: u8,
    /// Canonical vertex at `start`.
    first: u32,
}

impl Leaf {
    fn length(&self) -> u32 {
        1 << self.log_length
    }
    fn end(&self) -> u32 {
        u32::from(self.start) + self.length()
    }
}

/// One curve of a pool.
#[derive(Clone, Copy, Debug)]
pub(super) struct Curve {
    pub first_leaf: u32,
    pub leaf_count: u32,
    /// Pool number of canonical vertex 1: the two ends are not in the pool.
    pub first_vertex: u32,
    /// Segments of all leaves; 0 where the curve is not finite.
    pub segments: u32,
}

/// Curves, with leaves and vertices in pools.
#[derive(Debug, Default)]
pub(super) struct CurvePool {
    pub curves: Vec<Curve>,
    pub leaves: Vec<Leaf>,
    /// Canonical vertices but the ends, `[vertex][key]`.
    pub vertices: Vec<Vec3>,
}

/// A finished curve.
#[derive(Clone, Copy, Debug)]
pub(super) struct CurveView<'a> {
    leaves: &'a [Leaf],
    inner: &'a [Vec3],
    start: &'a [Vec3],
    end: &'a [Vec3],
    segments: u32,
}

impl CurvePool {
    pub fn clear(&mut self) {
        self.curves.clear();
        self.leaves.clear();
        self.vertices.clear();
    }

    /// Curve `index` between the given end positions (one a key).
    pub fn view<'a>(&'a self, index: usize, start: &'a [Vec3], end: &'a [Vec3]) -> CurveView<'a> {
        let curve = &self.curves[index];
        let first_leaf = curve.first_leaf as usize;
        let first = curve.first_vertex as usize * start.len();
        let count = curve.segments.saturating_sub(1) as usize * start.len();
        CurveView {
            leaves: &self.leaves[first_leaf..first_leaf + curve.leaf_count as usize],
            inner: &self.vertices[first..first + count],
            start,
            end,
            segments: curve.segments,
        }
    }

    /// Adds a curve that is one straight segment.
    pub fn push_segment(&mut self, key_count: usize) {
        self.curves.push(Curve {
            first_leaf: self.leaves.len() as u32,
            leaf_count: 1,
            first_vertex: (self.vertices.len() / key_count) as u32,
            segments: 1,
        });
        self.leaves.push(Leaf {
            start: 0,
            log_length: ONE.trailing_zeros() as u8,
            rate: 1,
            first: 0,
        });
    }

    /// Adds a curve that cannot be used.
    pub fn push_broken(&mut self, key_count: usize) {
        self.push_segment(key_count);
        if let Some(curve) = self.curves.last_mut() {
            curve.segments = 0;
        }
    }

    /// Builds the tree of `source` and evaluates its vertices. `samples` are the curve's points at
    /// parameters 0, 1/2 and 1, `[sample][key]`. `rate` is the wanted segment length in pixels.
    pub fn build(
        &mut self,
        sampler: &mut Sampler<'_>,
        source: &CurveSource,
        samples: &[Vec3],
        depth: u32,
        rate: f32,
    ) -> Result<(), NotFinite> {
        let key_count = sampler.key_count();
        let (longest, _) = sampler.polyline(samples);
        if rate_for(2.0 * longest / rate) == 1 {
            self.push_segment(key_count);
            return Ok(());
        }
        let first_leaf = self.leaves.len();
        let k = key_count;
        let quarters = sampler.curve(source, &[0.25, 0.75])?;
        let five: Vec<Vec3> = [
            &samples[..k],
            &quarters[..k],
            &samples[k..2 * k],
            &quarters[k..],
            &samples[2 * k..],
        ]
        .concat();
        let mut segments = 0;
        let root = Interval {
            start: 0,
            log_length: ONE.trailing_zeros(),
            depth,
        };
        self.refine(sampler, source, root, &five, rate, &mut segments)?;

        let mut params = Vec::with_capacity(segments as usize);
        for leaf in &self.leaves[first_leaf..] {
            let step = f64::from(leaf.length()) / f64::from(leaf.rate);
            params.extend(
                (1..=leaf.rate).map(|j| {
                    ((f64::from(leaf.start) + step * f64::from(j)) / f64::from(ONE)) as f32
                }),
            );
        }
        params.pop();
        let first_vertex = (self.vertices.len() / k) as u32;
        let points = sampler.curve(source, &params)?;
        self.vertices.extend_from_slice(&points);
        self.curves.push(Curve {
            first_leaf: first_leaf as u32,
            leaf_count: (self.leaves.len() - first_leaf) as u32,
            first_vertex,
            segments,
        });
        Ok(())
    }

    /// Leaves below one interval, of which five even samples are known.
    fn refine(
        &mut self,
        sampler: &mut Sampler<'_>,
        source: &CurveSource,
        at: Interval,
        five: &[Vec3],
        rate: f32,
        segments: &mut u32,
    ) -> Result<(), NotFinite> {
        let (longest, total) = sampler.polyline(five);
        let x = 4.0 * longest / rate;
        let n = rate_for(x);
        let uneven = x > UNEVEN * total / rate + UNEVEN_SEGMENTS;
        if at.depth == 0 || (n <= MAX_GRID_RATE && !uneven) {
            let n = n.min(MAX_GRID_RATE);
            self.leaves.push(Leaf {
                start: at.start as u16,
                log_length: at.log_length as u8,
                rate: n as u8,
                first: *segments,
            });
            *segments += n;
            return Ok(());
        }
        let eighths = [0.125, 0.375, 0.625, 0.875].map(|f| {
            let length = f64::from(1u32 << at.log_length);
            ((f64::from(at.start) + length * f) / f64::from(ONE)) as f32
        });
        let between = sampler.curve(source, &eighths)?;
        let k = sampler.key_count();
        for half in 0..2u32 {
            let h = half as usize;
            let child: Vec<Vec3> = [
                &five[2 * h * k..][..k],
                &between[2 * h * k..][..k],
                &five[(2 * h + 1) * k..][..k],
                &between[(2 * h + 1) * k..][..k],
                &five[(2 * h + 2) * k..][..k],
            ]
            .concat();
            let log_length = at.log_length - 1;
            let at = Interval {
                start: at.start + (half << log_length),
                log_length,
                depth: at.depth - 1,
            };
            self.refine(sampler, source, at, &child, rate, segments)?;
        }
        Ok(())
    }

    /// Appends another pool, whose vertices follow this one's.
    pub fn append(&mut self, other: &CurvePool, key_count: usize) {
        let leaf = self.leaves.len() as u32;
        let vertex = (self.vertices.len() / key_count) as u32;
        self.curves.extend(other.curves.iter().map(|c| Curve {
            first_leaf: c.first_leaf + leaf,
            first_vertex: c.first_vertex + vertex,
            ..*c
        }));
        self.leaves.extend_from_slice(&other.leaves);
        self.vertices.extend_from_slice(&other.vertices);
    }
}

#[derive(Clone, Copy)]
struct Interval {
    start: u32,
    log_length: u32,
    depth: u32,
}

impl<'a> CurveView<'a> {
    fn leaf_at(&self, p: u32) -> &'a Leaf {
        let i = self.leaves.partition_point(|l| u32::from(l.start) <= p);
        &self.leaves[i - 1]
    }

    /// True where the curve goes nowhere, at no key (a pole, the tip of a cone).
    pub fn is_point(&self) -> bool {
        self.segments == 1 && self.start == self.end
    }

    /// True where `[a, b]` reaches over more than one leaf.
    pub fn is_split(&self, a: u32, b: u32) -> bool {
        self.leaf_at(a).end() < b
    }

    /// Lattice steps that visit every canonical vertex of `[a, b]`, which lies within one leaf;
    /// where it does not, about the number of segments in it.
    pub fn need(&self, a: u32, b: u32) -> u32 {
        let leaf = self.leaf_at(a);
        if leaf.end() >= b {
            return (u32::from(leaf.rate) * (b - a))
                .div_ceil(leaf.length())
                .max(1);
        }
        self.map(b, 1) - self.map(a, 1)
    }

    /// The canonical vertex nearest to parameter `p / steps`.
    pub fn map(&self, p: u32, steps: u32) -> u32 {
        let leaf = self.leaf_at((p / steps).min(ONE - 1));
        // At most 2^16 times 16 steps times 16 segments, twice: fits.
        let x = (p - u32::from(leaf.start) * steps) * u32::from(leaf.rate);
        let d = leaf.length() * steps;
        leaf.first + (2 * x + d) / (2 * d)
    }

    /// Parameter (of [`ONE`]) of a canonical vertex.
    pub fn parameter(&self, vertex: u32) -> f32 {
        let i = self.leaves.partition_point(|l| l.first <= vertex);
        let leaf = &self.leaves[i - 1];
        let step = leaf.length() as f32 / f32::from(leaf.rate);
        f32::from(leaf.start) + step * (vertex - leaf.first) as f32
    }

    /// Position of a canonical vertex at each key.
    pub fn vertex(&self, vertex: u32) -> &'a [Vec3] {
        if vertex == 0 {
            self.start
        } else if vertex >= self.segments {
            self.end
        } else {
            let k = self.start.len();
            &self.inner[(vertex as usize - 1) * k..][..k]
        }
    }
}
