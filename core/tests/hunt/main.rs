//! Hunts for counterexamples to what is proven of bounds and pads: candidates that come near are changed
//! until they come nearer. Each hunt prints the share of a pad that its worst candidate uses, fails where that is more
//! than all, and fails too where it is less than the hunt is known to reach: a hunt that finds nothing proves nothing.
//!
//! Bounded to some seconds in all; `HDTRAPEZE_HUNT=1000 cargo test -p hdtrapeze-core --test hunt -- --nocapture`
//! hunts a thousand times longer, from other seeds.

mod boxes;
mod climb;
#[path = "../exact/mod.rs"]
mod exact;
mod places;
mod slabs;
#[path = "../trace_scenes/mod.rs"]
mod trace_scenes;
mod whole;
