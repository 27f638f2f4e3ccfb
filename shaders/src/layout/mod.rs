//! Rust mirrors of the structs in `layout.wgsl`, in the layout of a storage buffer.
//!
//! Bytes that WGSL leaves as padding are named `_pad` here, so that the mirrors are plain old data
//! and can be cast to bytes. Spaces and units are those of the WGSL text.

mod build;
mod camera;
mod rays;
mod scene;
mod secondary;
mod shading;
#[cfg(test)]
mod tests;

pub use build::{BuildLaunch, BuildObject, BuildOutcome, BuildState};
pub use camera::{Camera, TileSamples, TilesLaunch};
pub use rays::{Hit, Ray, TraceLaunch};
pub use scene::{GridHeader, Instance, Object};
pub use secondary::{OrderLaunch, ScatterLaunch, ShareLaunch, Site, SiteLaunch};
pub use shading::{Look, Pixel, Sample, ShadeLaunch, Veil};

/// The WGSL text that declares the structs of this module.
pub const SOURCE: &str = include_str!("../wgsl/layout.wgsl");
