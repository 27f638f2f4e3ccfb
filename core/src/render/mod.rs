//! A render from end to end: [`prepare`] turns a scene into what rays need, [`render`] fills a
//! [`Frame`] in progressive passes.
//!
//! Both run on the calling thread's rayon pool. A [`Prepared`] is immutable and shared; what an edit
//! did not touch is taken over from the one before.

mod ahead;
mod chains;
mod clusters;
mod earlier;
mod elsewhere;
mod generate;
mod given;
mod instances;
mod integrate;
mod kept;
mod looks;
mod nests;
mod objects;
mod passes;
mod prepare;
mod prepared;
mod primvar_aovs;
mod query;
mod shape;
mod watcher;

pub use crate::film::{Frame, FrameError};
pub use ahead::Ahead;
pub use elsewhere::{Elsewhere, Made, RayTracer, Stage};
pub use generate::{Generator, Job, TileSamples, block_size};
pub use integrate::{LEAST_TRANSMITTANCE, MAX_LAYERS};
pub use looks::{Look, Paint};
pub use passes::{RenderControl, RenderStatistics, render, render_with};
pub(crate) use prepare::resolve_shutter;
pub use prepare::{Preparation, PrepareError, prepare, prepare_with};
pub use prepared::{PrepareStatistics, Prepared};
pub use query::{WorldHit, WorldRay};
pub use watcher::Watcher;
