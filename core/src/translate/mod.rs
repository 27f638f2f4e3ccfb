//! From what hosts describe to what dicing takes: checked topology, points at keys, primvars as
//! channels, transforms as paths. Everything that is wrong with a prim is found here: it is repaired
//! or dropped with one warning, and nothing that is not finite goes further.
//!
//! `blur` scales the shutter for a prim, `points` makes keys of samples and rates, `mesh` checks
//! topology, `curves` curves, `nurbs` patches, `nurbs_curves` makes curves of NURBS, `implicit` sizes, `subsets` subsets of faces; `primvar` resolves one primvar of a mesh, `values` one of other kinds,
//! `route` decides how the prim reaches the world (flattened, or instanced), `measure` how large it
//! is on screen.

pub mod blur;
pub mod curves;
pub mod grids;
pub mod implicit;
pub mod instancer;
pub mod measure;
pub mod mesh;
pub mod nurbs;
pub mod nurbs_curves;
pub mod points;
pub mod primvar;
pub mod route;
pub mod spheres;
pub mod subsets;
pub mod values;
