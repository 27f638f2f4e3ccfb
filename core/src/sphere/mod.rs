//! Spheres: points with widths, each a few cells that face the camera, or a full sphere.
//!
//! What stands for a sphere depends on its size on screen at the worst key: below a pixel one cell as
//! large as its outline; up to a few pixels a hemisphere towards the camera, at each key's own time; above,
//! and where instances share it, both halves. Outlines have the disk's area, and normals lean so that
//! the mean brightness is the sphere's, whatever stands for it: a particle that comes nearer does
//! not flicker. Each sphere has grids of its own, so that a hit knows which it is; they are in the order of
//! a space-filling curve, so that neighbours in memory are neighbours in space.

pub mod dice;
pub mod lattice;
mod order;

pub use dice::{SphereDice, SphereDiced, SphereSet, dice};
