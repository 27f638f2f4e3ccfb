//! The renderer: scene description in, AOV pixels out.
//!
//! Data flow, in the order of the modules:
//!
//! `scene` (what hosts describe) -> `motion` (samples resolved to the shutter) -> `surface` (limit
//! surfaces), `curve`, `sphere` -> `dice` (raster-space rates, watertight lattices) -> `grid` (diced micropolygons) ->
//! `bvh` (hyper-trapezoids) -> `trace` (rays with time) -> `shade` -> `film` -> `aov`.
//!
//! Knows nothing of USD, C++ or C types. After Hou, Qin, Li, Guo, Zhou, "Micropolygon Ray Tracing
//! with Defocus and Motion Blur", ACM TOG 29(4), 2010.
#![forbid(unsafe_code)]

pub mod alone;
pub mod aov;
pub mod bvh;
pub mod camera;
pub mod curve;
pub mod diagnostics;
pub mod dice;
pub mod dump;
pub mod effects;
pub mod film;
pub mod grid;
pub mod memory;
pub mod motion;
pub mod nurbs;
pub mod render;
pub mod sample;
pub mod scene;
pub mod shade;
pub mod sphere;
pub mod surface;
pub mod trace;
pub mod translate;
