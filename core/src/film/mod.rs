//! The film: what samples leave in pixels, and how pixels become AOVs.
//!
//! Samples are placed by filter importance sampling (Ernst, Stamminger, Greiner, "Filter Importance
//! Sampling", RT 2006): a sample belongs to one pixel only, so that pixels need no neighbours, and
//! the image has the same bits for any thread count and tile order.

pub mod filter;
pub mod frame;
pub mod tile;

pub use frame::{Frame, FrameError};
