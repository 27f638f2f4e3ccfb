//! Motion: raw time samples resolved to the shutter, and the one path that every point follows.
//!
//! Hosts give samples at any times, in time codes relative to the frame. [`keys`] turns a set of
//! samples into keys on [0, 1] across the shutter (sorted, de-duplicated, interpolated at open and
//! close; one key where nothing changes). [`follow`] tells hosts that can evaluate at any time how many
//! samples are enough. [`rates`] moves one sample on by velocities and the like.
//! [`path`] composes transforms and points: a point's path is
//! M(t) p(t), M interpolated as a matrix, or along arcs ([`turn`]) where the host says so, p linearly.

pub mod follow;
pub mod keys;
pub mod path;
pub mod rates;
pub mod transform;
pub mod turn;

pub use keys::{Shutter, Timeline};
pub use path::PointPath;
pub use transform::{Hierarchy, TransformError};
