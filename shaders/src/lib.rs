//! WGSL sources, and Rust mirrors of the structs that CPU and GPU share.
//!
//! Nothing here runs on a device or knows of wgpu: the GPU backend of the renderer's crate takes the
//! text and the layouts from here. Sources stand in `src/wgsl`, one file a stage; shared structs
//! stand once, in `layout.wgsl`.
//!
//! Invariant: a Rust mirror and its WGSL struct have the same bytes. The tests read the WGSL with
//! naga and compare size and offset of every member; nothing is kept in step by comment alone.
#![forbid(unsafe_code)]

pub mod layout;
pub mod stage;
