//! C structs to the renderer's types and back. Input is copied; enum values, flags, counts and
//! strings are checked, and whether numbers make sense where nothing later would.

mod camera;
mod instancer;
mod output;
mod primvar;
mod scene;
mod settings;
mod subset;
mod view;

use crate::fault::Fault;

pub(crate) use camera::*;
pub(crate) use instancer::*;
pub(crate) use output::*;
pub(crate) use primvar::*;
pub(crate) use scene::*;
pub(crate) use settings::*;
pub(crate) use subset::*;
pub(crate) use view::*;

/// The element of `values` that an enum-like field stands for.
pub(crate) fn pick<T: Copy>(values: &[T], number: u32, what: &str) -> Result<T, Fault> {
    let found = usize::try_from(number)
        .ok()
        .and_then(|at| values.get(at).copied());
    found.ok_or_else(|| Fault::invalid(format!("{what} {number} is not known")))
}

fn refuse<T>(what: &str, value: impl std::fmt::Display, why: &str) -> Result<T, Fault> {
    Err(Fault::invalid(format!("{what} {value} {why}")))
}
