//! The hyper-trapezoid BVH: slabs whose bounds are linear in time, over micropolygon grids.
//!
//! `grid` -> **`bvh`** -> `trace`. After Hou et al., "Micropolygon Ray Tracing with Defocus and
//! Motion Blur", ACM TOG 29(4), 2010, section 4; the wide shape after Wald et al., "Getting Rid of
//! Packets", RT 2008, and the linear bounds of several keys after Embree.
//!
//! **The central invariant.** For every axis `a` of a node's frame and every time in [0, 1], each
//! micropolygon vertex `P` below a child satisfies `lo(time) <= a.P(time) <= hi(time)` in exact
//! arithmetic, where `lo(time) = lo(0) + (lo(1) - lo(0)) time`, the same for `hi`, and `a` is the
//! axis as stored. Micropolygons are triangles of such vertices, so they are contained too.
//!
//! **Why it holds.** The largest of several functions that are linear in time lies below its chord;
//! so on one fixed set of axes, bounds at both ends, interpolated, contain all vertices that move
//! linearly between. Vertices with more keys move linearly between neighbouring keys; the chord
//! over the whole shutter is raised by its largest excess at an inner key ([`linear`], of 8 boxes at once [`lanes`]). Where a block's frame turns,
//! the same is said of coordinates along axes that move ([`turn`]).
//!
//! **Shape.** A grid is cut into *blocks* of up to 8x8 micropolygons ([`block`]). A block is one node
//! with 8 implicit children, each a *group* of up to 4x2 micropolygons: no pointers. Small grids and tilted
//! strands need no block: the tree refers to their groups ([`gather`]), and to each micropolygon of thin strands ([`thin`]). Over all stands a tree of 8-wide nodes
//! ([`build`]), built by binned SAH on the time-averaged area. The 8 children of a node share one frame
//! ([`frame`]): the identity (an AABB) or a rotation, chosen where surface-area cost says that it pays, for single
//! blocks ([`bound`]), whose frames follow a normal that turns ([`turn`]), and for subtrees over strands ([`orient`]).
//! What does not move stores no second bounds: all nodes are generic over [`node::Bounds8`]. Boxes of parts of strands have
//! diagonals ([`diagonal`]), which rays that are traced one by one, or in turns, are tested against as well.
//!
//! **Curves.** Where raised chords bound motion badly, trees are built in a space that moves along with the
//! object, or for halves of the shutter ([`relative`], [`sway`]).
//!
//! **Units.** Bounds are in the space of [`DicedMesh`](crate::grid::DicedMesh)'s positions for objects,
//! and in world space relative to the world origin for the tree over instances.

mod bins;
pub mod block;
pub mod bound;
pub mod bowing;
pub mod build;
pub mod carrier;
mod coarse;
pub mod diagonal;
pub mod elsewhere;
mod extent;
pub mod frame;
pub mod gather;
pub mod group8;
mod guess;
pub mod lanes;
pub mod linear;
mod model;
pub mod node;
pub mod object;
pub mod orient;
pub mod outline;
mod plan;
mod radii8;
mod range;
pub mod relative;
pub mod sorted;
mod split;
mod strip8;
mod sway;
mod tame;
mod thin;
mod tries;
pub mod turn;

pub use build::Tree;
pub use frame::Frame;
pub use linear::LinearBox;
pub use node::{Bounds8, CarriedSlabs, LinearSlabs, Node, StaticSlabs, StoredBox};
pub use object::{BvhStats, LOOSE, ObjectGeometry};

/// Unit roundoff of f32: `|fl(x) - x| <= U |x|`.
pub const U: f32 = 1.0 / (1 << 24) as f32;

/// Largest magnitude of a coordinate that is traced. Products of two differences of coordinates
/// stay below f32's largest number, 2^128. Blocks beyond are dropped, and counted. What an instance reaches is bounded from its
/// object's radius, by 3 times that, or 30 times where the tree was left for later; an instance that may reach beyond the limit
/// is left out whole, and counted.
pub const COORDINATE_LIMIT: f32 = (1u64 << 60) as f32;

/// What bounds in a rotated frame are widened by, per `sum |P_i|` of the vertex at hand. In units of `U sum |P_i|`,
/// with `|a_i| <= 1 + 4 U`: the products of the dot product are off by 1, each of its two sums by at most 1, and
/// adding the pad to it by 1 again. The fifth is for all that is of order `U`: the pad's own sums and the axes' length.
pub const ROTATION_PAD: f32 = 5.0 * U;

/// What they are widened by besides: 2^-146, for products below f32's normal numbers. There, each of the three products
/// and the pad itself are off by at most 2^-150, absolutely, 2^-148 together; adding this rounds by at most 2^-147
/// below 2^-122, and beyond, the unit that [`ROTATION_PAD`] has to spare is larger.
pub const ROTATION_TINY: f32 = f32::from_bits(8);
