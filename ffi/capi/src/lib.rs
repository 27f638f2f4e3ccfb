//! The C ABI: `include/hdtrapeze.h` is generated from this crate, and says what every function does.
//!
//! Where it sits: hosts (the C++ shim of Hydra, Python, C programs) above, the session of
//! `hdtrapeze-delegate` below, into which OpenSubdiv's factory is put here. Nothing is done in this
//! crate but checking, copying and translating.
//!
//! Layers: `constants` and `types` are what the header shows; `session`, `scene`, `instancer`, `path`,
//! `words`, `setting`, `frame_name`, `render`, `view`, `plan` and `output` hold the exported functions; `input` reads what callers
//! pass, `convert` translates it, `fault` carries failures and catches panics.
//!
//! From Rust the same functions can be called directly; what the header demands of pointers is
//! their safety contract.
// The documentation becomes the C header's comments, where brackets are array indices.
#![allow(rustdoc::broken_intra_doc_links)]
#![allow(unsafe_code)]
// Every function has one contract for its pointers, which the header states at its top.
#![allow(clippy::missing_safety_doc)]

pub mod constants;
mod convert;
pub mod device;
mod fault;
pub mod frame_name;
mod input;
pub mod instancer;
pub mod output;
pub mod path;
pub mod plan;
pub mod render;
pub mod scene;
pub mod session;
pub mod setting;
pub mod types;
pub mod view;
pub mod words;

use hdtrapeze_core::surface::SubdivisionFactory;
use hdtrapeze_delegate::Session;
use hdtrapeze_osd::OsdFactory;

pub use constants::*;
pub use device::*;
pub use frame_name::*;
pub use instancer::*;
pub use output::*;
pub use path::*;
pub use plan::*;
pub use render::*;
pub use scene::*;
pub use session::*;
pub use setting::*;
pub use types::*;
pub use view::*;
pub use words::*;

/// A session for the functions of the ABI that subdivides with `factory` in place of OpenSubdiv:
/// for Rust hosts and tests. It is given back to `trz_session_destroy`.
pub fn session_with(factory: Box<dyn SubdivisionFactory>) -> *mut trz_session {
    Box::into_raw(Box::new(trz_session::new(Session::new(factory))))
}

fn default_factory() -> Box<dyn SubdivisionFactory> {
    Box::new(OsdFactory::new())
}
