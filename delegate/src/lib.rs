//! The session that hosts talk to, above the renderer and below the C ABI.
//!
//! Flow: a host pushes *edits* from any thread ([`Session::edit`]); [`Session::commit`] stops a
//! running render, applies them in order, and has the renderer dice and build; [`Session::start`]
//! commits and renders on a thread of the session; AOVs, image files and ray hits are read back at
//! any time. Warnings and other messages go to the host's log function, through a `tracing`
//! dispatcher that belongs to the session, so that two sessions of one process do not mix.
//!
//! Knows neither C types nor OpenSubdiv: the layer above injects the subdivision factory.
#![forbid(unsafe_code)]

mod ahead;
mod aov;
pub mod backend;
pub mod buffer;
pub mod edit;
mod engine;
pub mod error;
pub mod file;
pub mod frame_name;
pub mod image;
mod log;
pub mod plan;
mod pool;
pub mod primvar;
pub mod product;
pub mod progress;
pub mod render_loop;
pub mod samples;
pub mod session;
mod status;
pub mod translate;

pub use aov::AovShape;
pub use edit::{Edit, Edits, Kind};
pub use error::Error;
pub use log::{LogFn, in_log_callback};
pub use progress::{Progress, State, Statistics};
pub use render_loop::RenderLoop;
pub use session::Session;
pub use tracing::Level;
pub use translate::AuthoredTopology;
