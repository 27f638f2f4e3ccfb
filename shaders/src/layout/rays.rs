//! Rays, and what they meet.

use bytemuck::{Pod, Zeroable};

/// A ray at one instant, world space relative to the world's origin.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Ray {
    /// Where `t` is 0.
    pub origin: [f32; 3],
    /// Hits nearer than this are ignored; `t` is in units of `dir`'s length.
    pub t_min: f32,
    /// Need not be unit length.
    pub dir: [f32; 3],
    /// Hits farther than this are ignored; finite on the GPU.
    pub t_max: f32,
    /// In [0, 1] across the shutter.
    pub time: f32,
    /// Where its hit goes.
    pub number: u32,
    /// Filter weight of its sample, mean 1.
    pub weight: f32,
    /// Squared distance of its sample from the pixel's centre, pixels.
    pub distance2: f32,
}

/// The nearest micropolygon along a ray.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Hit {
    /// Distance in units of the ray's `dir`; means nothing for a miss.
    pub t: f32,
    /// Position inside the cell along u, 0 to 1.
    pub u: f32,
    /// Position inside the cell along v, 0 to 1.
    pub v: f32,
    /// Instance in the world; `u32::MAX` for a miss.
    pub instance: u32,
    /// Grid of the instance's object.
    pub grid: u32,
    /// Cell of the grid.
    pub cell: u32,
}

/// What a launch of the stage `trace` works on.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct TraceLaunch {
    /// Reference to the root of the tree over instances.
    pub root: u32,
    /// Rays in the buffer.
    pub ray_count: u32,
    /// Rays of one row of workgroups.
    pub row: u32,
    /// Number of the page; from the second on there are hits already.
    pub page: u32,
    /// Bounds the magnitude of every coordinate of every instance.
    pub radius: f32,
    /// Pad of slab tests against the tree over instances, per unit of distance from the world's origin.
    pub pad: f32,
    /// Number of the layer, where rays go on behind what they meet.
    pub layer: u32,
    /// First word of the sides of instances, where some are passed through.
    pub sides: u32,
    /// The first ray that is traced.
    pub first: u32,
    /// One past the last.
    pub end: u32,
}
