//! What sends rays on from first hits, orders them, and sums up what they met.

use bytemuck::{Pod, Zeroable};

/// Where rays leave a first hit, world space relative to the world's origin.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Site {
    /// Off the surface.
    pub origin: [f32; 3],
    /// In [0, 1] across the shutter.
    pub time: f32,
    /// Unit length, on the side that the first ray came from; 0 where there is no site.
    pub normal: [f32; 3],
    /// How far the origin is off the surface.
    pub offset: f32,
}

/// What a launch of the stage `site` works on.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct SiteLaunch {
    /// Rays in the buffer.
    pub ray_count: u32,
    /// Rays of one row of workgroups.
    pub row: u32,
    /// Number of the page.
    pub page: u32,
    /// Instances on it.
    pub instances: u32,
    /// First word of their numbers, which ascend, and after these of the place of each; `u32::MAX` where they are their places.
    pub places: u32,
}

/// What a launch of the stage `scatter` works on.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct ScatterLaunch {
    /// Of all patterns; the lower word first.
    pub seed: [u32; 2],
    /// Digits of a net's numbers.
    pub digits: u32,
    /// Rays of a site.
    pub samples: u32,
    /// Rays of all sites.
    pub ray_count: u32,
    /// Rays of one row of workgroups.
    pub row: u32,
    /// What is added to the numbers of sites, for their patterns.
    pub first: u32,
    /// What is farther occludes nothing; scene units.
    pub reach: f32,
}

/// What a launch of the stage `order` works on.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct OrderLaunch {
    /// Rays in the buffer.
    pub ray_count: u32,
    /// Rays of one row of workgroups.
    pub row: u32,
    /// Bits of a ray's number in its run.
    pub run_bits: u32,
    /// Bits of each axis of a direction.
    pub direction_bits: u32,
    /// Bits of a time.
    pub time_bits: u32,
}

/// What a launch of the stage `share` works on.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct ShareLaunch {
    /// Hits there are.
    pub hit_count: u32,
    /// Hits of one row of workgroups.
    pub row: u32,
    /// Rays of a hit.
    pub samples: u32,
}
