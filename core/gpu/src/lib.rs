//! The stages of hdTrapeze on a GPU, through wgpu: Vulkan, Metal or DX12.
//!
//! `core` -> **`gpu`** -> `delegate`. The text of the stages and the layouts they share with the CPU come
//! from `hdtrapeze_shaders`; core knows nothing of devices. Nothing here panics where there is no device, where one is too
//! small, or where it is lost: every fault is a [`GpuError`], and callers go on with the CPU.
//!
//! [`device`] finds and opens devices, [`kernel`] compiles stages, which [`kept`] keeps on disk, [`scene`] lays a world out for them, [`early`] takes vertices there before the world is complete, [`build`] makes
//! trees there. Stages: [`generate`] draws camera rays, [`trace`] traces rays, [`shade`] tells what their hits give, [`film`]
//! sums that up by pixel; where hits are not opaque, `trace` and `shade` take turns, layer after layer; [`occlude`] sends rays
//! on from hits, and tells how many meet nothing; [`frame`] runs those that core's passes need, from the [`first`] on; [`pace`] tells how much
//! goes there at once. [`trial`] tells whether a device is faster than the CPU.
//!
//! Unsafe code is denied but for one call, by which [`kept`] hands a driver what it has compiled before.

mod axes;
pub mod build;
pub mod contents;
pub mod device;
pub mod early;
pub mod error;
pub mod film;
pub mod first;
pub mod frame;
pub mod generate;
mod kept;
pub mod kernel;
mod layers;
pub mod occlude;
mod order;
pub mod pace;
mod pages;
pub mod scene;
pub mod shade;
mod stack;
pub mod tiles;
pub mod trace;
pub mod trial;
mod vertices;

pub use build::{BuildOptions, TreeBuilder};
pub use device::{Device, Found};
pub use early::{EarlyBytes, EarlyLimits, EarlyVertices};
pub use error::GpuError;
pub use first::{FirstOnDevice, SecondaryStage};
pub use frame::{FrameOptions, GpuFrame, Stages};
pub use generate::{GpuCamera, RayMaker};
pub use occlude::{Occluder, Occlusion};
pub use pace::Submitted;
pub use scene::GpuScene;
pub use tiles::GpuTiles;
pub use trace::Tracer;
