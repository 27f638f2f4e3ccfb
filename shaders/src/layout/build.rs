//! What makes trees.

use bytemuck::{Pod, Zeroable};

/// An object whose tree is made on the device.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct BuildObject {
    /// Its first grid, among the grids of all such objects.
    pub first_grid: u32,
    /// First word of its [`GridHeader`](super::GridHeader)s.
    pub grids: u32,
    /// First float of its vertices.
    pub vertices: u32,
    /// First word of its key times.
    pub key_times: u32,
    /// Number of keys.
    pub key_count: u32,
}

/// What a dispatch of the stages that make trees works on.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct BuildLaunch {
    /// Items of all objects.
    pub items: u32,
    /// Objects.
    pub objects: u32,
    /// Grids of all objects.
    pub grids: u32,
    /// Bits of an axis of a Morton number.
    pub bits: u32,
    /// Workgroups that items are sorted by.
    pub tiles: u32,
    /// Place of the first unit of the bound buffer of nodes.
    pub base: u32,
    /// Place of the first block.
    pub blocks: u32,
    /// Place of the first node.
    pub nodes: u32,
    /// First word of the blocks' frames.
    pub frames: u32,
    /// The first item or node of this dispatch, or the lowest bit of a digit.
    pub first: u32,
    /// The one after the last.
    pub end: u32,
}

/// How far the stages `cluster` and `collapse` are.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct BuildState {
    /// Clusters.
    pub count: u32,
    /// Nodes of the binary tree.
    pub inner: u32,
    /// Clusters before the last round.
    pub count_before: u32,
    /// Nodes before it.
    pub inner_before: u32,
    /// Nodes that the last round made; 0 where all is done, 1 at first.
    pub made: u32,
    /// 1: the next round takes all areas as equal.
    pub equal: u32,
    /// Level of nodes that is opened next.
    pub level: u32,
    /// First node of each level.
    pub levels: [u32; 256],
}

/// What became of an object.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct BuildOutcome {
    /// Reference to the root of its tree.
    pub root: u32,
    /// Entries of the stack that a walk through it needs.
    pub need: u32,
    /// Largest magnitude of any coordinate or bound.
    pub radius: f32,
    /// Areas of all nodes, in parts of the root's: about the nodes that a ray opens which meets that.
    pub cost: f32,
}
