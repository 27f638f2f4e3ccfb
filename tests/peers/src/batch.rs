//! Rays in Embree's layouts, and the ways to have them traced.

use std::ffi::c_uint;

use hdtrapeze_core::trace::Ray;
use rayon::prelude::*;

use crate::ffi::{INVALID_ID, Packet, RayHit};

/// How many rays a call takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Width {
    One,
    Eight,
    Sixteen,
    /// A stream of single rays.
    Stream,
    /// A stream of packets of 16.
    Stream16,
}

/// How rays are traced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Call {
    pub width: Width,
    /// The context flag "coherent".
    pub coherent: bool,
    /// Any hit rather than the nearest.
    pub any: bool,
}

impl Call {
    pub fn name(&self) -> String {
        let width = match self.width {
            Width::One => "1",
            Width::Eight => "8",
            Width::Sixteen => "16",
            Width::Stream => "1M",
            Width::Stream16 => "NM",
        };
        format!("{width}{}", if self.coherent { " coherent" } else { "" })
    }
}

/// Rays in Embree's layouts, with room for its answers.
#[derive(Clone, Debug)]
pub enum Batch {
    One(Vec<RayHit<1>>),
    Eight(Vec<Packet<8>>),
    Sixteen(Vec<Packet<16>>),
}

/// What Embree says of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    pub t: f32,
    /// Micropolygon, counted over all grids.
    pub cell: usize,
}

impl Batch {
    /// # Panics
    /// The number of rays is not a multiple of 16.
    pub fn new(width: Width, rays: &[Ray]) -> Self {
        assert!(rays.len().is_multiple_of(16), "rays come by sixteens");
        match width {
            Width::One | Width::Stream => Batch::One(rays.par_chunks(1).map(packed).collect()),
            Width::Eight => Batch::Eight(
                rays.par_chunks(8)
                    .map(|rays| Packet(packed(rays)))
                    .collect(),
            ),
            Width::Sixteen | Width::Stream16 => Batch::Sixteen(
                rays.par_chunks(16)
                    .map(|rays| Packet(packed(rays)))
                    .collect(),
            ),
        }
    }

    /// `(t, primitive, u, v)` of ray `i`.
    pub fn raw(&self, i: usize) -> Option<(f32, u32, f32, f32)> {
        match self {
            Batch::One(v) => of_lane(&v[i], 0),
            Batch::Eight(v) => of_lane(&v[i / 8].0, i % 8),
            Batch::Sixteen(v) => of_lane(&v[i / 16].0, i % 16),
        }
    }

    /// Whether ray `i` was found occluded.
    pub fn occluded(&self, i: usize) -> bool {
        let t_far = match self {
            Batch::One(v) => v[i].t_far[0],
            Batch::Eight(v) => v[i / 8].0.t_far[i % 8],
            Batch::Sixteen(v) => v[i / 16].0.t_far[i % 16],
        };
        t_far == f32::NEG_INFINITY
    }
}

fn of_lane<const N: usize>(r: &RayHit<N>, lane: usize) -> Option<(f32, u32, f32, f32)> {
    (r.geometry[lane] != INVALID_ID)
        .then(|| (r.t_far[lane], r.primitive[lane], r.u[lane], r.v[lane]))
}

fn packed<const N: usize>(rays: &[Ray]) -> RayHit<N> {
    let lane = std::array::from_fn::<usize, N, _>(|lane| lane);
    RayHit {
        origin: [0, 1, 2].map(|axis| lane.map(|l| rays[l].origin[axis])),
        t_near: lane.map(|l| rays[l].t_min),
        dir: [0, 1, 2].map(|axis| lane.map(|l| rays[l].dir[axis])),
        time: lane.map(|l| rays[l].time),
        t_far: lane.map(|l| rays[l].t_max),
        mask: [c_uint::MAX; N],
        id: lane.map(|l| l as c_uint),
        flags: [0; N],
        normal: [[0.0; N]; 3],
        u: [0.0; N],
        v: [0.0; N],
        primitive: [INVALID_ID; N],
        geometry: [INVALID_ID; N],
        instance: [INVALID_ID; N],
    }
}
