//! What the rays of a packet look for, and what they found so far.

use hdtrapeze_simd::{Float, Simd};

use super::enter::Spans;
use super::packet::{All, LANES, PACKET, Ranges, VECTORS, in_turns, part, split};
use super::{Hit, TraceCounts};
use crate::bvh::block::CellRect;

/// What the rays of a packet look for, and the best so far.
pub(super) struct Queries {
    /// Any hit will do.
    pub any: bool,
    /// They were put together by [direction](super::by_direction).
    pub sorted: bool,
    /// The best hits; misses but for their `t`, which is `t_max`, before there are any.
    pub best: [Hit; PACKET],
    /// `t_min` of each, and `t_max` below mirrored.
    pub ranges: Ranges,
    /// The first of each of `ranges` again.
    pub t_min: All,
    /// `best.t` of each; nothing is nearer than that of a ray which looks no more.
    pub t_max: All,
    /// What all rays cost.
    pub counts: TraceCounts,
    /// What each cost is told, too.
    pub each: bool,
    /// Nodes opened by each, where that is told.
    pub nodes: All,
    /// Micropolygons tested, likewise.
    pub cells: All,
}

impl Queries {
    /// Rays that look for nothing.
    pub const NONE: Queries = Queries {
        any: false,
        sorted: false,
        best: [Hit::MISS; PACKET],
        ranges: [[[f32::INFINITY; 2]; LANES]; VECTORS],
        t_min: [[f32::INFINITY; LANES]; VECTORS],
        t_max: [[f32::NEG_INFINITY; LANES]; VECTORS],
        counts: TraceCounts {
            rays: 0,
            node_tests: 0,
            cell_tests: 0,
        },
        each: false,
        nodes: [[0.0; LANES]; VECTORS],
        cells: [[0.0; LANES]; VECTORS],
    };

    /// What must not be read: a hit of all rays, for instance.
    pub const SPOILED: Queries = Queries {
        any: true,
        sorted: true,
        best: [Hit {
            t: 0.0,
            instance: 0,
            ..Hit::MISS
        }; PACKET],
        ranges: [[[f32::NAN; 2]; LANES]; VECTORS],
        t_min: [[f32::NAN; LANES]; VECTORS],
        t_max: [[f32::NAN; LANES]; VECTORS],
        counts: TraceCounts {
            rays: u64::MAX / 2,
            node_tests: u64::MAX / 2,
            cell_tests: u64::MAX / 2,
        },
        each: true,
        nodes: [[f32::NAN; LANES]; VECTORS],
        cells: [[f32::NAN; LANES]; VECTORS],
    };

    /// Between what each ray looks.
    #[inline(always)]
    pub fn spans(&self) -> Spans<'_> {
        Spans {
            pairs: &self.ranges,
            t_min: &self.t_min,
            t_max: &self.t_max,
        }
    }

    /// Counts a node that `rays` open.
    #[inline(always)]
    pub fn count_node<S: Simd>(&mut self, simd: S, rays: u64) {
        self.counts.node_tests += u64::from(rays.count_ones());
        if self.each {
            add(simd, &mut self.nodes, rays, 1.0);
        }
    }

    /// Counts cells that `rays` are tested against.
    #[inline(always)]
    pub fn count_cells<S: Simd>(&mut self, simd: S, rays: u64, rect: CellRect) {
        let cells = u16::from(rect.w) * u16::from(rect.h);
        self.counts.cell_tests += u64::from(rays.count_ones()) * u64::from(cells);
        if self.each {
            add(simd, &mut self.cells, rays, f32::from(cells));
        }
    }

    /// Counts cells that one ray is tested against.
    #[inline(always)]
    pub fn count_cells_of(&mut self, ray: usize, cells: u32) {
        self.counts.cell_tests += u64::from(cells);
        if self.each {
            let (v, lane) = split(ray);
            self.cells[v][lane] += cells as f32;
        }
    }

    /// True where a ray looks no farther than to some place before `t`. What lies in bounds that it enters at `t` is no
    /// hit then: none in there is nearer, and one as near, which another may follow by number, is not beyond.
    #[inline(always)]
    pub fn is_beyond(&self, ray: usize, t: f32) -> bool {
        let (v, lane) = split(ray);
        t > self.t_max[v][lane]
    }

    /// A ray looks no farther than `t_max`.
    #[inline(always)]
    fn end(&mut self, ray: usize, t_max: f32) {
        let (v, lane) = split(ray);
        self.t_max[v][lane] = t_max;
        self.ranges[v][lane][1] = -t_max;
    }

    /// Begins to ask about `count` rays.
    #[inline(always)]
    pub fn ask(&mut self, any: bool, each: bool, count: usize) {
        (self.any, self.each) = (any, each);
        self.sorted = false;
        self.counts = TraceCounts {
            rays: count as u64,
            ..TraceCounts::default()
        };
        if each {
            (self.nodes, self.cells) = (Self::NONE.nodes, Self::NONE.cells);
        }
    }

    /// The rays of vector `v` are asked about what lies from `t_min` to `t_max`, if they are among `asks`; others miss.
    #[inline(always)]
    pub fn begin_all<S: Simd>(
        &mut self,
        simd: S,
        v: usize,
        asks: u32,
        t_min: S::F16,
        t_max: S::F16,
    ) {
        let asked = simd.mask16(asks);
        let ends = t_max.or(asked, simd.all16(f32::INFINITY)).to_array();
        for (best, t) in self.best[LANES * v..].iter_mut().zip(ends) {
            *best = Hit { t, ..Hit::MISS };
        }
        self.t_min[v] = t_min.to_array();
        self.t_max[v] = t_max.to_array();
        self.ranges[v] = in_turns(simd, t_min, -t_max);
    }

    /// A hit of a ray.
    #[inline(always)]
    pub fn offer(&mut self, ray: usize, hit: Hit) {
        let (v, lane) = split(ray);
        let best = &mut self.best[ray & (PACKET - 1)];
        // Written so that NaN is refused.
        let in_range = hit.t >= self.ranges[v][lane][0] && hit.t <= best.t;
        if in_range && hit.is_before(best) {
            *best = hit;
            self.end(ray, if self.any { f32::NEG_INFINITY } else { hit.t });
        }
    }
}

/// Adds to the counts of `rays`.
#[inline(always)]
fn add<S: Simd>(simd: S, to: &mut All, rays: u64, more: f32) {
    for (v, to) in to.iter_mut().enumerate() {
        let lanes = part(rays, v);
        if lanes != 0 {
            let more = simd.all16(more).or(simd.mask16(lanes), simd.all16(0.0));
            *to = (simd.from16(to) + more).to_array();
        }
    }
}
