//! Rays with time against the world: two-level traversal and watertight micropolygon tests.
//!
//! Space: rays are world space relative to [`World::origin`] (f64, near the camera),
//! in f32. `time` is in [0, 1] across the shutter; `t` is distance along the ray in units of
//! `dir`'s length. Instances carry f64 transforms that are reduced to f32 after the world origin was
//! subtracted.

pub mod beam;
pub mod brute;
pub mod by_direction;
pub mod cell;
pub mod cell_rays;
pub mod deferred;
pub mod enter;
pub mod enter_block;
mod expected;
mod in_tree;
mod in_turns;
mod inside;
pub mod instance;
pub mod laid;
mod late;
mod movers;
pub mod object_ray;
mod opened;
pub mod packet;
mod pairs;
pub mod parts;
pub mod piece;
pub mod places;
mod queries;
mod query;
mod query_packet;
#[cfg(test)]
mod random;
mod rectangles;
mod relative;
mod room;
mod scattered;
pub mod shading;
pub mod sides;
mod strip;
pub mod surface_order;
mod track;
mod traverse;
mod traverse_packet;
mod two_cells;
mod waits;
pub mod world;

pub use deferred::Deferred;
pub use instance::InstanceTransform;
pub use places::InstanceSet;
pub use sides::{Culled, Side, Winding};
pub use world::{World, WorldInstance, WorldSet, WorldStats};

use glam::Vec3;

/// A ray at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// World space, relative to the world's origin.
    pub origin: Vec3,
    /// Need not be unit length.
    pub dir: Vec3,
    /// Instant in [0, 1]; clamped, but NaN misses.
    pub time: f32,
    /// Hits nearer than this are ignored.
    pub t_min: f32,
    /// Hits farther than this are ignored.
    pub t_max: f32,
}

impl Ray {
    /// Misses everything.
    pub(crate) const NONE: Ray = Ray {
        origin: Vec3::ZERO,
        dir: Vec3::ZERO,
        time: f32::NAN,
        t_min: f32::INFINITY,
        t_max: f32::NEG_INFINITY,
    };
}

/// The nearest micropolygon along a ray. Hits are ordered by `(t, instance, grid, cell)`, so that
/// the answer does not depend on traversal order, and "the next hit after this one" is defined even
/// where surfaces coincide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance in units of the ray's `dir`; infinity for a miss.
    pub t: f32,
    /// Position inside the cell: 0 at corner (i,j), 1 towards i+1.
    pub u: f32,
    /// Position inside the cell: 0 at corner (i,j), 1 towards j+1. The triangle with `u >= v` is
    /// `(i,j) (i+1,j) (i+1,j+1)`, where P = (1-u) P00 + (u-v) P10 + v P11; the other is
    /// `(i,j) (i+1,j+1) (i,j+1)`, where P = (1-v) P00 + u P11 + (v-u) P01.
    pub v: f32,
    /// Instance in the world, or [`Hit::NONE`].
    pub instance: u32,
    /// Grid of the instance's object.
    pub grid: u32,
    /// Cell of the grid.
    pub cell: u32,
}

impl Hit {
    /// Instance number of a miss.
    pub const NONE: u32 = u32::MAX;
    /// A miss.
    pub const MISS: Hit = Hit {
        t: f32::INFINITY,
        u: 0.0,
        v: 0.0,
        instance: Hit::NONE,
        grid: 0,
        cell: 0,
    };
    /// True unless a miss.
    pub fn is_hit(&self) -> bool {
        self.instance != Hit::NONE
    }
}

/// Work done by traversal, for statistics and the cost AOV.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TraceCounts {
    /// Rays traced.
    pub rays: u64,
    /// Nodes opened: one node is one test of up to 8 children.
    pub node_tests: u64,
    /// Micropolygons tested.
    pub cell_tests: u64,
}

impl TraceCounts {
    /// Nodes and micropolygons that rays were tested against.
    pub(crate) fn tests(&self) -> u64 {
        self.node_tests + self.cell_tests
    }
}

impl std::ops::Add for TraceCounts {
    type Output = TraceCounts;

    fn add(self, o: TraceCounts) -> TraceCounts {
        TraceCounts {
            rays: self.rays + o.rays,
            node_tests: self.node_tests + o.node_tests,
            cell_tests: self.cell_tests + o.cell_tests,
        }
    }
}
