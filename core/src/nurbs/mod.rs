//! Non-uniform rational B-splines: knot vectors and basis functions, in f64.
//!
//! [`Knots`] is one direction of a patch, or a curve, as Piegl and Tiller ("The NURBS Book", 1997)
//! have it: order is degree plus one, and there are as many knots as points and order together.

mod knots;

pub use knots::{Knots, KnotsError, Span};
