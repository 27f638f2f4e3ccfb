//! What a scene is made of: grids, objects and instances.

use bytemuck::{Pod, Zeroable};

/// One micropolygon grid of a diced mesh.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct GridHeader {
    /// Number of the grid's first lattice vertex.
    pub first_vertex: u32,
    /// Micropolygons along u in the low 16 bits, along v in the high 16; each 1 to 16.
    pub rates: u32,
}

/// One object: where its parts are in the buffers of a scene.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Object {
    /// Reference to the root of its tree, as `slabs.wgsl` has it.
    pub root: u32,
    /// First word of its [`GridHeader`]s.
    pub grids: u32,
    /// First float of its vertices.
    pub vertices: u32,
    /// First word of its key times.
    pub key_times: u32,
    /// Number of keys.
    pub key_count: u32,
    /// Largest magnitude of any coordinate or bound.
    pub radius: f32,
    /// First word of the numbers that its grids have in the whole object, where a page has only some of them;
    /// `u32::MAX` where they are all there. They ascend.
    pub numbers: u32,
    /// How many grids it has here.
    pub grid_count: u32,
}

/// One instance of an object.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Instance {
    /// Its number in the world.
    pub number: u32,
    /// Number of its object in the page.
    pub object: u32,
    /// First of its rows of matrices: 1 of a translation, 3 of a fixed matrix, 3 a key of moving ones.
    pub matrices: u32,
    /// First word of its key times.
    pub key_times: u32,
    /// Number of keys; 0 for a translation, 1 for a fixed matrix.
    pub key_count: u32,
}
