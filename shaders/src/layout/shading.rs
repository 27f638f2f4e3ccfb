//! What hits give, and what that adds up to.

use bytemuck::{Pod, Zeroable};

use super::Hit;

/// How an instance looks. Places are words of a scene's paints.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Look {
    /// 1: it takes rays away, and gives nothing. 2: its fronts are the backs of its lattices. 4: normals are told for the side that
    /// is seen. Of a primvar: the floats that are kept of it.
    pub marks: u32,
    /// Of its colour: 0 one for all, 1 one a grid, 2 one a vertex.
    pub kind: u32,
    /// First word of its colours, or of its own.
    pub paint: u32,
    /// Words from one colour to the next.
    pub stride: u32,
    /// Words of a colour at one key.
    pub lanes: u32,
    /// Its key times.
    pub paint_times: u32,
    /// How many; 0 where nothing changes.
    pub paint_keys: u32,
    /// Octahedral normals of its vertices.
    pub normals: u32,
    /// How many keys they have; 0 without any.
    pub normal_keys: u32,
}

/// What a launch of the stage `shade` works on.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct ShadeLaunch {
    /// Rays in the buffer.
    pub ray_count: u32,
    /// Rays of one row of workgroups.
    pub row: u32,
    /// Radiance of a white surface that looks along the axis of view.
    pub light: f32,
    /// Number of the page.
    pub page: u32,
    /// Instances on it.
    pub instances: u32,
    /// First word of their numbers, which ascend, and after these of the place of each; `u32::MAX` where they are their places.
    pub places: u32,
    /// Number of the layer, where rays go on behind what they meet.
    pub layer: u32,
}

/// What is left of a ray behind the layers that it has met.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Veil {
    /// Share that goes on.
    pub transmittance: f32,
    /// Share that matte surfaces took.
    pub held_out: f32,
    /// 1 once something was met that is not wholly transparent.
    pub seen: u32,
    /// Not of this ray: places in the buffer of rays, those that go on to layers of even numbers, and of odd ones.
    pub going: [u32; 2],
}

/// What one camera sample brings home.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Sample {
    /// Premultiplied radiance, and coverage.
    pub color: [f32; 4],
    /// Filter weight, mean 1.
    pub weight: f32,
    /// Squared distance from the pixel's centre, pixels.
    pub distance2: f32,
    /// In [0, 1] across the shutter.
    pub time: f32,
    /// To the next multiple of 16 bytes; its content means nothing.
    pub _pad: f32,
}

/// What samples of a pixel add up to.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Pixel {
    /// Weighted.
    pub red: f32,
    /// Weighted.
    pub green: f32,
    /// Weighted.
    pub blue: f32,
    /// Weighted coverage.
    pub alpha: f32,
    /// Of all weights.
    pub weight: f32,
    /// Of the sample nearest to the pixel's centre.
    pub distance2: f32,
    /// Its time.
    pub time: f32,
    /// What it met first.
    pub hit: Hit,
}
