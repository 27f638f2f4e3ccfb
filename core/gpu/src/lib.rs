//! The stages of hdTrapeze on a GPU, through wgpu: Vulkan, Metal or DX12.
//!
//! `core` -> **`gpu`** -> `delegate`. The text of the stages and the layouts they share with the CPU come
//! from `hdtrapeze_shaders`; core knows nothing of devices. Nothing here panics where there is no device, where one is too
//! small, or where it is lost: every fault is a [`GpuError`], and callers go on with the CPU.
//!
//! [`device`] finds and opens devices, [`kernel`] compiles stages, [`scene`] lays a world out for them, [`generate`] draws camera
//! rays, [`trace`] traces rays.
#![forbid(unsafe_code)]

pub mod device;
pub mod error;
pub mod generate;
pub mod kernel;
mod pages;
pub mod scene;
mod stack;
pub mod trace;

pub use device::{Device, Found};
pub use error::GpuError;
pub use generate::{GpuCamera, RayMaker};
pub use scene::GpuScene;
pub use trace::Tracer;
