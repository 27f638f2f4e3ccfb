//! From samples to pixels.

pub mod filter;
