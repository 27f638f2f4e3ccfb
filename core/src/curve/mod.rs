//! Curves: how they are cut into segments and evaluated, and how they become grids.
//!
//! [`basis`] counts segments and primvar values and evaluates the bases; everything that depends on
//! UsdGeomBasisCurves' rules for bases and wraps is there, once. `strand` evaluates one curve at one
//! instant, with the frames of its cross-sections; `rate` chooses the stations that it needs on
//! screen; `layout` cuts these into grids; `keys` adds motion keys where cross-sections turn;
//! `emit` writes ribbons and tubes; [`mod@dice`] joins them.
//!
//! **Forms.** Curves with normals are flat ribbons that lie across them. Others stand for round tubes:
//! they are closed tubes where they are wide on screen, or where instances share them, and elsewhere
//! ribbons that face the camera at each key's own time, as wide as the tube's outline and with
//! normals that lean to the sides, so that a curve keeps its brightness where it changes form.
//! However thin it is, a curve has its full width: there is no opacity in it.
//!
//! **Watertightness.** A station is evaluated once a key, and a vertex follows from its station and its
//! place around alone: neighbouring grids of a curve have the same bits where they meet.

pub mod basis;
pub mod dice;
mod emit;
mod keys;
mod layout;
mod rate;
pub mod set;
mod strand;

pub use basis::CurveKind;
pub use dice::{CurveDice, CurveDiced, dice};
pub use set::{CurveChannel, CurveSet};
