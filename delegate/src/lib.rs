//! hdTrapeze: delegate.

pub mod image;
