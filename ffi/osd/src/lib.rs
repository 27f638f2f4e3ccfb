//! OpenSubdiv limit surfaces for hdTrapeze, behind [`SubdivisionFactory`] of the core.
//!
//! Where it sits: core's scene translation hands checked [`MeshTopology`], points at every key and
//! channels to [`OsdFactory`]; dicing evaluates the [`LimitSurface`] that comes back. Nothing of C++
//! or OpenSubdiv is visible outside this crate.
//!
//! How it works: `Far::TopologyRefiner` holds the base topology and `Bfr` gives the limit surface of
//! one face at a time (patch points of all position keys side by side). Lattices are then evaluated
//! on this side of the bridge.
//!
//! Units and spaces: object space, the mesh's own units, f32. Normals point out of the front, so a
//! left-handed mesh flips them; the parameterization is never flipped.
//!
//! [`SubdivisionFactory`]: hdtrapeze_core::surface::SubdivisionFactory
//! [`MeshTopology`]: hdtrapeze_core::surface::MeshTopology
//! [`LimitSurface`]: hdtrapeze_core::surface::LimitSurface

mod bridge;
mod domain;
mod evaluator;
mod normal;
mod patch;
mod shapes;
mod size;
mod surface;
mod topology;

pub use evaluator::OsdEvaluator;
pub use surface::{OsdFactory, OsdSurface};
