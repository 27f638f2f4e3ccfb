//! Curves: how they are cut into segments and evaluated, and how they become grids.
//!
//! [`basis`] counts segments and primvar values and evaluates the bases; everything that depends on
//! UsdGeomBasisCurves' rules for bases and wraps is there, once.

pub mod basis;

pub use basis::ShutterCurveKind;
